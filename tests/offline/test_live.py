"""Live data give the problems that a level itself condenses, also between the points of a sweep."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import xarray as xr

from tcstudy.offline.level import Level
from tcstudy.offline.live import Rational, interpolated, live_arrays
from tcstudy.read.study import read_study_text
from tcstudy.refine.family import Family
from tcstudy.scene.study import Study
from tcstudy.study.execute import execute

STUDY = """
body: {outline: [{from: [0, 0], edge: film}, {from: [0.2, 0], edge: end}, {from: [0.2, 0.1], edge: top},
                 {from: [0, 0.1], edge: back}]}
boundary: {film: contact, back: {role: clamped, u_x: 10 um, u_y: 0 m}, top: convection,
           end: {role: traction, g: [3 MPa, 0]}}
material: {E: 210 GPa, nu: 0.3, k: 45, alpha_T: 12e-6}
heat: {alpha: 200, theta_bar: "10 + 50*x", q: 5e5}
friction: {law: tresca, tau: 40 MPa}
mesh: {maxh: 40 mm, levels: 2}
sweep: {alpha: [400, 100, 200], nu: [0.3, 0.2]}
output: {live: true}
"""


@pytest.fixture(scope="module")
def study() -> Study:
    return read_study_text(STUDY)


@pytest.fixture(scope="module")
def level(study: Study) -> Level:
    return Level(Family(study).next(0), study.scenes[0], study.scenes)


def _function(arrays: dict[str, np.ndarray], name: str) -> Rational:
    return Rational(*(arrays[f"live_{name}_{part}"] for part in ("node", "weight", "load")))


def test_loads_between_the_points_of_the_sweep(study: Study, level: Level) -> None:
    arrays = live_arrays(study, level)
    source, surroundings = _function(arrays, "source"), _function(arrays, "surroundings")
    scene = study.scenes[0]
    for alpha in (30.0, 137.0, 1500.0):
        wanted = level.condensed(replace(scene, heat=replace(scene.heat, alpha=alpha))).problem.l_tilde
        a, beta = alpha / 45.0, scene.material.beta
        thermal = beta * (5e5 / alpha * source(a) + surroundings(a))
        found = arrays["live_mechanical_load"][0] + arrays["live_held_load"][0] + thermal
        np.testing.assert_allclose(found, wanted, rtol=0, atol=1e-11 * np.max(np.abs(wanted)))


def test_points_of_another_elastic_ratio_are_not_valid(study: Study, level: Level) -> None:
    assert live_arrays(study, level)["live_valid"].tolist() == [[1.0, 0.0]] * 3


def test_a_level_with_many_contact_nodes_is_not_kept(
    study: Study, level: Level, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("tcstudy.offline.live.MOST_NODES", level.line.m - 1)
    assert live_arrays(study, level) == {}


def test_the_file_has_a_group_in_its_own_order(study: Study, tmp_path: Path) -> None:
    execute(study, tmp_path / "study.nc")
    with xr.open_datatree(tmp_path / "study.nc") as tree:
        live = tree["level_1/live"].dataset
        assert live["alpha"].dims == ("alpha", "nu")
        np.testing.assert_array_equal(live["alpha"].values[:, 0], tree["alpha"].values)
        np.testing.assert_array_equal(live["A_tilde"].values, live["A_tilde"].values.T)
        assert live["A_tilde"].attrs["units"] == "Pa"


def test_without_being_asked_nothing_is_kept(study: Study, tmp_path: Path) -> None:
    execute(replace(study, output=replace(study.output, live=False)), tmp_path / "study.nc")
    with xr.open_datatree(tmp_path / "study.nc") as tree:
        assert "live" not in tree["level_1"].children


@pytest.mark.parametrize("bounds", [(0.1, 100.0), (2.0, 2.5)])
def test_functions_with_poles_below_zero_are_interpolated(bounds: tuple[float, float]) -> None:
    def function(a: float) -> np.ndarray:
        return np.array([1.0 / (a + 0.3), a / (a + 7.0) + 2.0, 5.0])

    found = interpolated(function, bounds)
    for a in np.geomspace(*bounds, 57):
        np.testing.assert_allclose(found(float(a)), function(float(a)), rtol=1e-12)
