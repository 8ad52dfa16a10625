"""Scenes of a sweep: few records, the same scenes as a list would hold."""

from __future__ import annotations

import pickle
from pathlib import Path

import pytest

import tcstudy
from tcstudy.scene.points import Scenes, combinations, count_points, distinct

QUICKSTART = Path(__file__).parents[2] / "configs" / "quickstart.yaml"
GRID = "sweep={alpha: [25, 50], friction.delta: [10 um, 20 um, 30 um], theta_bar: [0, 10]}"


def test_points_are_in_c_order_of_the_axes():
    scenes = tcstudy.load(QUICKSTART, [GRID]).scenes
    found = [(s.heat.alpha, s.friction.kinks.max(), s.heat.theta_bar) for s in scenes]
    assert found == [(a, d, t) for a in (25, 50) for d in (1e-5, 2e-5, 3e-5) for t in (0, 10)]


@pytest.mark.parametrize("mode", ["zip", "list"])
def test_axes_read_together(mode):
    points = {
        "zip": "sweep={mode: zip, alpha: [25, 50, 75], theta_bar: [0, 10, 20]}",
        "list": "sweep={mode: list, points: [{alpha: 25, theta_bar: 0}, {alpha: 50, theta_bar: 10}, "
        "{alpha: 75, theta_bar: 20}]}",
    }
    scenes = tcstudy.load(QUICKSTART, [points[mode]]).scenes
    assert [(s.heat.alpha, s.heat.theta_bar) for s in scenes] == [(25, 0), (50, 10), (75, 20)]


def test_distinct_scenes_stand_for_all():
    scenes = tcstudy.load(QUICKSTART, [GRID]).scenes
    assert [s.heat.alpha for s in distinct(scenes, "heat")] == [25, 25, 50, 50]
    some, of = combinations(scenes, "heat", "material")
    assert all(some[k].heat == scene.heat for k, scene in zip(of, scenes, strict=True))
    assert count_points(scenes, ("heat",), lambda s: s.heat.alpha == 50) == 6
    assert len(distinct(scenes, "friction")) == 3
    assert len(distinct(scenes, "material")) == 1


def test_a_list_of_scenes_is_the_same():
    scenes = tcstudy.load(QUICKSTART, [GRID]).scenes
    listed = tuple(scenes)
    assert Scenes.of(listed) == scenes
    assert len(distinct(listed, "heat")) == 4
    assert combinations((), "heat")[0] == ()
    assert pickle.loads(pickle.dumps(scenes)) == scenes
    assert scenes[-1] == listed[-1]
    assert scenes[2:4] == listed[2:4]


def test_a_million_points_are_their_axes():
    """No list of scenes: the records of a section are as many as its own combinations."""
    values = "{linspace: [1, 100, 100]}"
    study = tcstudy.load(QUICKSTART, [f"sweep={{alpha: {values}, theta_bar: {values}, friction.tau_s: {values}}}"])
    assert len(study.scenes) == 10**6
    assert isinstance(study.scenes, Scenes)
    assert len(study.scenes.records["heat"]) == 10**4
    last = study.scenes[10**6 - 2]
    assert (last.heat.alpha, last.heat.theta_bar) == (100, 100)
    assert last.friction.b(0.0, +1) == pytest.approx(99.0)
