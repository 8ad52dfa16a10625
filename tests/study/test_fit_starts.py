"""All starts, or until one is as good as the noise lets expect: what is told of them, and of noise that is assumed."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import tcstudy
from tcstudy.read.study import read_study_text
from tcstudy.reports.terminal.summary import text_of
from tcstudy.scene.study import Study
from tcstudy.study.fit import model_of
from tests.study.test_fit import HEATED, heated

SHEARED = """
title: film of a sheared block, pulled, pushed and pulled
body: {rectangle: {width: 60 mm, height: 12 mm, edges: {bottom: film}}}
boundary: {film: contact, right: free, top: {role: clamped, u_x: 0, u_y: 0}, left: free}
material: {E: 3 MPa, nu: 0.3}
friction: {law: slip-weakening, tau_s: 100 kPa, tau_k: 40 kPa, delta: 1.5 mm}
mesh: {maxh: 12 mm}
history:
  memory: damage
  steps: [{boundary.top.u_x: 1.6 mm, in: 4}, {boundary.top.u_x: -0.4 mm, in: 3}, {boundary.top.u_x: 2.4 mm, in: 5}]
fit:
  data: {file: data.csv, columns: {step: step, friction_resultant: "P [N/m]"}}
  noise: {friction_resultant: 40 N/m}
  parameters:
    friction.tau_s: {start: 60 kPa, within: [10 kPa, 500 kPa]}
    friction.tau_k: {start: 20 kPa, within: [1 kPa, 200 kPa]}
    friction.delta: {start: 3 mm, within: [0.2 mm, 10 mm]}
"""
TRUE = (100e3, 40e3, 1.5e-3)


def sheared(folder: Path, P: np.ndarray) -> Study:
    rows = "".join(f"{n},{value:.17g}\n" for n, value in enumerate(P, 1))
    (folder / "data.csv").write_text("step,P [N/m]\n" + rows, encoding="utf-8")
    return read_study_text(SHEARED, "fit.yaml", source=folder / "fit.yaml")


def test_one_solution_for_every_load_does_not_end_the_search(tmp_path: Path) -> None:
    """Data without noise of the model itself, λ₁ > ω: the first start ends 46 % off, in a minimum of its own."""
    study = sheared(tmp_path, np.zeros(12))
    model = model_of(study, study.fit)
    assert model.level.lambda_1(model.scene(np.array(TRUE))) > max(law.omega for law in model.scene(TRUE).laws)
    found = tcstudy.run(sheared(tmp_path, model.compared(np.array(TRUE)).predicted), tmp_path / "a.nc")
    assert found["estimate"].values == pytest.approx(TRUE, rel=1e-6)
    tried, failed = int(found.attrs["starts_tried"]), int(found.attrs["starts_failed"])
    assert 1 < tried <= int(found.attrs["starts"]) == 5
    assert found["start_count"].values.sum() == tried - failed
    assert np.all(np.diff(found["start_cost"].values) > 100.0)  # distinct minima
    text = text_of(tmp_path / "a.nc")
    assert f"starts: {tried} of 5 tried, the last has a probable χ² and every number determined" in text


def test_an_assumed_noise_does_not_end_the_search(tmp_path: Path) -> None:
    """A known one does (test_fit)."""
    found = tcstudy.run(heated(tmp_path, HEATED.replace("  noise: {", "  # {")), tmp_path / "b.nc")
    assert found["start_count"].values.tolist() == [5]  # all agree
    words = "u_T_max and friction_resultant are measured equally well, in parts of their ranges"
    assert found.attrs["noise_assumed"] == words
    text = text_of(tmp_path / "b.nc")
    assert "starts: 5 of 5 tried; 5 of 5 end in this minimum" in text
    assert f"the 95 % intervals assume that {words}" in text
