"""A law for each contact edge: closed forms of two films and a gap, and of a chosen solution; what is refused."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import xarray as xr

import tcstudy
from tcstudy.errors import StudyError
from tcstudy.read.study import read_study_text

CONFIG = Path(__file__).parents[2] / "configs" / "two_films.yaml"
D, SHOE = 80e6, 0.05
"""Stiffness of the strip [N] per metre of width and length of the shoe [m]."""


def solved(text: str, tmp_path: Path) -> xr.DataTree:
    return tcstudy.run(read_study_text(text, "s", ["path=null"]), tmp_path / "a.nc")


def test_two_films_and_a_gap_have_the_closed_form(tmp_path: Path) -> None:
    tree = solved(CONFIG.read_text(encoding="utf-8"), tmp_path)
    data = tree.dataset.isel(level=-1)
    assert np.all(data["status"] == 1)
    for tau_f in (1.5e6, 2e6, 4e6):
        for strength in (0.0, 0.5, 1.0):
            point = data.sel(tau=tau_f, strength=strength)
            tau_s = strength * 1e6
            half = D * 1e-4 - 0.5 * tau_s * SHOE**2  # = tau_f (l²/2 + 50 mm l)
            length = -SHOE + np.sqrt(SHOE**2 + 2.0 * half / tau_f)
            assert float(point["slip_length"]) == pytest.approx(SHOE + length, abs=2.5e-3)
            assert float(point["friction_resultant"]) == pytest.approx(tau_f * length + tau_s * SHOE, rel=0.01)
    line = tree["level_1"].dataset
    assert {"film", "shoe"} <= set(str(line["edge"].attrs["flag_meanings"]).split())


CHOSEN = """
units: none
body: {outline: [{from: [0, 0], edge: film}, {from: [0.5, 0], edge: shoe}, {from: [1, 0], edge: right},
  {from: [1, 1], edge: top}, {from: [0, 1], edge: left}]}
boundary: {film: contact, shoe: contact, top: clamped, left: {role: traction}, right: {role: traction}}
material: {lambda: 1.5, mu: 1}
friction:
  film: {law: slip-weakening, tau_s: 1, tau_k: 0.4, delta: 1}
  shoe: {law: tresca, tau: 2, strength: "0.41 - 0.06*sin(pi*x)"}
mesh: {maxh: 0.25, levels: 5}
exact: {u: ["y + (1 - 0.6*y)*(0.3 + 0.2*sin(pi*x))", "0.1*y*cos(pi*x)"], loads: derived}
"""


def test_a_chosen_solution_of_two_laws_is_met_at_the_orders_of_theory(tmp_path: Path) -> None:
    """ξ = 1 − 0.6 u_T on all of Γ_C: a falling law on the film, a strength that varies along the shoe."""
    data = tcstudy.converge(read_study_text(CHOSEN), tmp_path / "out.nc").to_dataset()
    assert np.all(data["status"] == 1)
    for name, order in (("u_energy", 1.0), ("u_L2", 2.0), ("u_T_L2", 2.0), ("xi_L2", 1.0)):
        assert float(data[f"slope_{name}"]) == pytest.approx(order, abs=0.15), name
    mean = 0.3 + 0.2 * 2.0 / np.pi
    assert float(data["exact_friction_resultant"]) == pytest.approx(1.0 - 0.6 * mean, rel=1e-9)
    assert float(data["exact_slip_length"]) == pytest.approx(1.0)
    assert float(data["limit_friction_resultant"]) == pytest.approx(1.0 - 0.6 * mean, rel=1e-4)
    before, last = abs(data["value_energy"].values - float(data["exact_energy"]))[-2:]
    assert 3.8 < before / last < 4.2  # the nodes' quadrature, of second order also where the films meet
    with pytest.raises(StudyError, match=r"the friction law does not hold on shoe: .* but b\(u_T\) is 1;"):
        read_study_text(CHOSEN.replace("0.41 - 0.06*sin(pi*x)", "0.5"))
