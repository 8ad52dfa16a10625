"""Scenes of a sweep: few records, the same scenes as a list would hold."""

import pickle
from pathlib import Path

import pytest

import tcstudy
from tcstudy.scene.points import Scenes, combinations, count_points, distinct, load_axes

QUICKSTART = Path(__file__).parents[2] / "configs" / "quickstart.yaml"
GRID = "sweep={alpha: [25, 50], friction.delta: [10 um, 20 um, 30 um], theta_bar: [0, 10]}"


def test_distinct_scenes_stand_for_all_and_a_list_of_scenes_is_the_same():
    scenes = tcstudy.load(QUICKSTART, [GRID]).scenes
    assert [s.heat.alpha for s in distinct(scenes, "heat")] == [25, 25, 50, 50]
    some, of = combinations(scenes, "heat", "material")
    assert all(some[k].heat == scene.heat for k, scene in zip(of, scenes, strict=True))
    assert count_points(scenes, ("heat",), lambda s: s.heat.alpha == 50) == 6
    assert [len(distinct(scenes, section)) for section in ("friction", "material")] == [3, 1]
    listed = tuple(scenes)
    assert ((*Scenes.of(listed),), len(distinct(listed, "heat"))) == (listed, 4)
    assert combinations((), "heat")[0] == ()
    assert (*pickle.loads(pickle.dumps(scenes)),) == listed
    assert (scenes[-1], scenes[2:4]) == (listed[-1], listed[2:4])


def test_many_points_are_their_axes():
    values = "{linspace: [1, 100, 50]}"
    study = tcstudy.load(
        QUICKSTART, [f"sweep={{alpha: {values}, theta_bar: {values}, friction.tau_s: {values}}}"]
    )
    assert len(study.scenes) == 50**3
    assert isinstance(study.scenes, Scenes)
    assert len(study.scenes.records["heat"]) == 50**2
    last = study.scenes[50**3 - 2]
    assert (last.heat.alpha, last.heat.theta_bar) == (100, 100)
    assert last.friction.b(0.0, +1) == pytest.approx(100 - 99 / 49)


def test_axes_of_loads_change_nothing_else():
    """Not those of heat transfer, laws, materials or supports, nor a list of points."""
    spring = "boundary.end.spring.normal: [1 GPa/m, 2 GPa/m]"
    swept = (
        f"theta_bar: [0, 10], E: [1 GPa, 2 GPa], boundary.end.pressure: [1 MPa, 2 MPa], {spring}"
    )
    study = tcstudy.load(QUICKSTART, [f"sweep={{alpha: [25, 50], {swept}}}"])
    assert [study.axes[d].name for d in load_axes(study)] == ["theta_bar", "pressure"]
    assert load_axes(tcstudy.load(QUICKSTART, ["sweep={mode: zip, theta_bar: [0, 10]}"])) == ()
