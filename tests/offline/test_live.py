"""What a page solves by itself: the problems that a level condenses, where points share the elastic ratio."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import xarray as xr

from tcstudy.offline import level as offline
from tcstudy.offline.level import Level
from tcstudy.read.study import read_study_text
from tcstudy.refine.family import Family
from tcstudy.study.run import execute

STUDY = """
body: {outline: [{from: [0, 0], edge: film}, {from: [0.2, 0], edge: end}, {from: [0.2, 0.1], edge: top},
                 {from: [0, 0.1], edge: back}]}
boundary: {film: contact, back: {role: clamped, u_x: 10 um, u_y: 0 m}, top: convection,
           end: {role: traction, g: [3 MPa, 0]}}
material: {E: 210 GPa, nu: 0.3, k: 45, alpha_T: 12e-6}
heat: {alpha: 200, theta_bar: "10 + 50*x", q: 5e5}
friction: {law: tresca, tau: 40 MPa}
mesh: {maxh: 40 mm, levels: 1}
sweep: {nu: [0.3, 0.2], alpha: [400, 100, 200]}
output: {live: true}
"""


def test_problems_of_the_points_that_share_the_elastic_ratio(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    study = read_study_text(STUDY)
    execute(study, tmp_path / "study.nc")
    level = Level(Family(study).next(0), study.scenes[0], study.scenes)
    with xr.open_datatree(tmp_path / "study.nc") as tree:
        live = tree["level_0/live"].dataset
        assert live["valid"].sel(nu=0.3).values.all()
        assert not live["valid"].sel(nu=0.2).values.any()
        for scene, alpha in zip(study.scenes, (100, 200, 400), strict=False):
            problem, own = level.condensed(scene).problem, live.sel(nu=0.3, alpha=alpha)
            np.testing.assert_array_equal(own["stiffness"] * live["A_tilde"], problem.A_tilde)
            np.testing.assert_array_equal(own["load"], problem.l_tilde)
            pull = own["mechanical_load"].values.sum() / own["load"].values.sum()
            assert 0.0 < abs(pull) < 1.0
    monkeypatch.setattr(offline, "MOST_NODES", level.line.m - 1)
    assert offline.live_arrays(level, study.scenes, study.shape) == {}
