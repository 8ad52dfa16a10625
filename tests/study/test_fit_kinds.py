"""Numbers of every kind found again to rounding: laws by edge, materials by region, springs, from starts far away."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from tcstudy.read.study import read_study_text
from tcstudy.study.fit import fit, model_of

LAYERED = """
title: layers
body:
  outline: [{from: [0, 0], edge: film}, {from: [0.5 m, 0], edge: shoe}, {from: [1 m, 0], edge: right},
            {from: [1 m, 20 mm], edge: top}, {from: [0, 20 mm], edge: left}]
  regions: {coat: {rectangle: {corner: [0 mm, 15 mm], width: 1 m, height: 5 mm}}}
boundary:
  film: contact
  shoe: contact
  left: {role: clamped, u_x: 0, u_y: free}
  right: {role: traction, spring: {normal: 5 GPa/m}}
  top: free
material: {E: 200 GPa, nu: 0.3, plane: stress, alpha_T: 10e-6 1/K}
materials: {coat: {E: 100 GPa, nu: 0.3, alpha_T: 20e-6 1/K}}
heat: {theta: 0 K}
friction:
  film: {law: tresca, tau: 1.5 MPa}
  shoe: {law: slip-weakening, tau_s: 3 MPa, tau_k: 1 MPa, delta: 4 mm}
mesh: {maxh: 20 mm}
fit:
  data: {file: data.csv, columns: {theta: "T [K]", u_T_max: "u [um]", friction_resultant: "R [kN/m]"}}
  noise: {u_T_max: 0.5 um, friction_resultant: 4 kN/m}
  starts: 1
  parameters:
"""
TRUE = {
    "friction.film.tau": (1.5, "MPa"),
    "friction.shoe.tau_s": (3.0, "MPa"),
    "materials.coat.E": (100.0, "GPa"),
    "materials.coat.alpha_T": (20e-6, "1/K"),
    "material.nu": (0.3, ""),
    "boundary.right.spring.normal": (5.0, "GPa/m"),
}
"""With the units in which the study has them."""


@pytest.mark.parametrize(
    ("names", "factor"),
    [
        (("friction.film.tau", "friction.shoe.tau_s"), 0.3),
        (("friction.film.tau", "materials.coat.E"), 10.0),
        (("materials.coat.alpha_T", "boundary.right.spring.normal"), 0.1),
        (("material.nu", "materials.coat.E"), 0.4),
    ],
)
def test_what_the_study_itself_says_is_found_again(tmp_path: Path, names: tuple[str, ...], factor: float) -> None:
    """Its own results as data, without noise, from starts up to ten times off."""
    rows = ""
    for name in names:
        value, unit = TRUE[name]
        low, start, high = (f"{x * value:g} {unit}".strip() for x in (min(0.05, factor), factor, max(1.5, factor)))
        rows += f"    {name}: {{start: {start}, within: [{low}, {high}]}}\n"
    T, path = np.linspace(20.0, 90.0, 7), tmp_path / "data.csv"

    def study(u: np.ndarray, R: np.ndarray):  # type: ignore[no-untyped-def]
        lines = (f"{t!r},{1e6 * a:.17g},{1e-3 * b:.17g}\n" for t, a, b in zip(T.tolist(), u, R, strict=True))
        path.write_text("T [K],u [um],R [kN/m]\n" + "".join(lines), encoding="utf-8")
        return read_study_text(LAYERED + rows, "a.yaml", source=tmp_path / "a.yaml")

    own = study(T, T)
    model = model_of(own, own.fit)
    truth = np.array([one.start / factor for one in model.plan.parameters])
    record = fit(study(*model.compared(truth).predicted.reshape(2, -1)))
    assert record.values["estimate"] == pytest.approx(truth, rel=1e-9)
    assert int(record.attributes["evaluations"]) <= 20
