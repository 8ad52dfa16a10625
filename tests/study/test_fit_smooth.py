"""Laws by points that are smooth: nearer to the true law than free points are, and not straight where that is bent."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from tcstudy.errors import StudyError
from tcstudy.read.study import read_study_text
from tcstudy.scene.study import Study
from tcstudy.study.fit import fit, model_of

PLACES = np.linspace(0.0, 160.0, 7)
TEXT = """
title: pull
body:
  outline: [{from: [0, 0], edge: bond}, {from: [190 mm, 0], edge: grip},
            {from: [190 mm, 1 mm], edge: top}, {from: [0, 1 mm], edge: tail}]
boundary: {bond: contact, grip: {role: clamped, u_x: 0, u_y: free}, top: free, tail: free}
material: {E: 42.24 GPa, nu: 0, plane: stress}
friction: {law: piecewise-linear, points: [POINTS]}
mesh: {maxh: 19 mm}
fit:
  data: {file: data.csv, columns: {boundary.grip.u_x: "Delta [mm]", friction_resultant: "P [N/mm]"}}
  noise: {friction_resultant: 2.2 N/mm}
  starts: 1
  smooth: SMOOTH
  parameters:
"""


def study_of(folder: Path, P: np.ndarray, delta: np.ndarray, smooth: bool) -> Study:
    start = [f"{6.0 - s / 30.0:g} MPa" for s in PLACES]
    points = ", ".join(f"[{s:g} um, {b}]" for s, b in zip(PLACES, start, strict=True))
    rows = "".join(f"{a!r},{b!r}\n" for a, b in zip(delta.tolist(), P.tolist(), strict=True))
    (folder / "data.csv").write_text("Delta [mm],P [N/mm]\n" + rows, encoding="utf-8")
    text = TEXT.replace("POINTS", points).replace("SMOOTH", str(smooth).lower())
    text += "".join(f"    friction.points.{i}: {{start: {b}, within: [0 MPa, 20 MPa]}}\n" for i, b in enumerate(start))
    return read_study_text(text, "a.yaml", source=folder / "a.yaml")


@pytest.mark.parametrize(("bent", "factor"), [(False, 0.9), (True, 1.5)])
def test_a_smooth_law_is_nearer_to_the_true_one(tmp_path: Path, bent: bool, factor: float) -> None:
    """A straight fall is found with two or three numbers; one that bends is not flattened by the weight."""
    truth = 1e6 * (np.maximum(7.2 - PLACES / 11.0, 1.5) if bent else 7.2 - 7.2 * PLACES / 170.0)
    delta = 1e-3 * np.linspace(5.0, 210.0, 16)
    own = study_of(tmp_path, delta, delta, smooth=False)
    assert own.fit is not None
    P = 1e-3 * model_of(own, own.fit).compared(truth).predicted + 2.2 * np.random.default_rng(1).normal(size=16)
    free, smooth = (fit(study_of(tmp_path, P, delta, one)) for one in (False, True))
    apart = [np.sqrt(np.mean((record.values["estimate"] - truth) ** 2)) for record in (free, smooth)]
    assert apart[1] < factor * apart[0]
    assert np.all(smooth.values["standard_error"] < 1.05 * free.values["standard_error"])
    decided = float(smooth.attributes["numbers_decided"])
    assert 2.0 < decided < 7.0
    assert (decided < 4.0) is not bent
    assert "numbers_decided" not in free.attributes
    assert 5.0 < float(smooth.attributes["chi_square"]) < 30.0


def test_a_law_of_two_points_cannot_be_smooth(tmp_path: Path) -> None:
    study = study_of(tmp_path, np.arange(9.0), np.arange(9.0), smooth=True)
    rest = "\n".join(line for line in study.text.splitlines() if "points." not in line or "points.1" in line)
    with pytest.raises(StudyError, match="at least three of its points"):
        read_study_text(rest, "a.yaml", source=tmp_path / "a.yaml")
