"""Sizes of meshes before a run: counted ones are those of the run, others near them; meshes that cannot be made.

Such a mesh ends a run before work if it is the first, and is a status of its points if it is not.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import tcstudy
from tcstudy.data.records import PointStatus
from tcstudy.fem import study_meshes as families_module
from tcstudy.fem.geometry import GeometryFailed
from tcstudy.offline.level import Level
from tcstudy.read.study import read_study
from tcstudy.refine.family import Family
from tcstudy.scene.study import Study
from tcstudy.study import sizes as sizes_module
from tcstudy.study.sizes import predicted, refined, sizes
from tests.commands import CONFIGS
from tests.verification.scenes import HEATED_BRACKET, RECTANGLE, study_of

RING = """
units: none
body:
  outline:
    - {from: [1, 0], edge: rim, through: [0, 1]}
    - {from: [-1, 0], edge: rim, through: [0, -1]}
  holes: [{circle: {center: [0.2, 0], radius: 0.1, edge: bore}}]
boundary: {rim: contact, bore: {role: clamped, u_x: 0}}
material: {E: 1, nu: 0.3}
friction: {law: tresca, tau: 0.01}
mesh: {maxh: 0.5, levels: 4}
"""
"""A closed contact line, a small hole that refines the mesh, and a component left free."""
ROLLER = RECTANGLE.replace("left: clamped", "left: {role: clamped, u_N: 0}")
STRIPS = RECTANGLE.replace(
    "width: 2, height: 1}}",
    "width: 2, height: 1}, regions: {thin: {rectangle: {corner: [0.5, 0.4], width: 1, height: 0.02}}}}",
)


def of_run(study: Study) -> list[tuple[int, int, int]]:
    """Nodes, displacement and contact unknowns of the levels that a run makes."""
    family, scene = Family(study), study.scenes[0]
    levels = [Level(family.next(i), scene, (scene,)) for i in range(study.mesh.levels)]
    return [(level.mesh.n_points, level.frames.n_dof, level.line.m) for level in levels]


def said(study: Study) -> list[tuple[int, int, int]]:
    return [(v.nodes, v.n_dof, v.n_contact) for v in sizes(study)]


@pytest.mark.parametrize(
    "study",
    [
        study_of(RECTANGLE),
        study_of(RECTANGLE, "mesh={maxh: 0.3}"),
        study_of(HEATED_BRACKET),
        study_of(RING),
        study_of(ROLLER),
        study_of(STRIPS),
        study_of(RECTANGLE, "mesh={maxh: [0.5, 0.3, 0.1]}"),
        study_of(HEATED_BRACKET, "mesh={maxh: 0.4, levels: 3, family: graded}"),
        read_study(CONFIGS / "quickstart.yaml"),
    ],
)
def test_counted_sizes_are_those_of_the_run(study: Study) -> None:
    assert said(study) == of_run(study)
    assert all(v.exact for v in sizes(study))


@pytest.mark.parametrize("mesh", ["{maxh: [0.2, 0.1, 0.05]}", "{maxh: 0.2, levels: 3, family: graded}"])
def test_large_meshes_are_predicted_from_the_last_small_one(monkeypatch: pytest.MonkeyPatch, mesh: str) -> None:
    study = study_of(STRIPS, f"mesh={mesh}")
    monkeypatch.setattr(sizes_module, "MOST_NODES", 250)
    assert [v.exact for v in sizes(study)] == [True, False, False]
    for (nodes, n_dof, m), real in zip(said(study), of_run(study), strict=True):
        assert (nodes, n_dof) == pytest.approx(real[:2], rel=0.2)
        assert m == pytest.approx(real[2], rel=0.3)


def test_no_mesh_that_is_large_already_is_made(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(families_module, "mesh_at", None)
    study = study_of(RECTANGLE, "mesh={maxh: 0.005, levels: 2}")
    assert sizes(study) == predicted(study)
    assert not any(v.exact for v in sizes(study))


def fail_at(monkeypatch: pytest.MonkeyPatch, bad: int) -> None:
    original = families_module.mesh_at

    def mesh_at(geometry: object, plan: object, level: int, coarser: object) -> object:
        if level == bad:
            raise GeometryFailed("the mesher gave up")
        return original(geometry, plan, level, coarser)  # type: ignore[arg-type]

    monkeypatch.setattr(families_module, "mesh_at", mesh_at)


@pytest.mark.parametrize("bad", [0, 1])
def test_a_mesh_that_cannot_be_made(monkeypatch: pytest.MonkeyPatch, bad: int) -> None:
    fail_at(monkeypatch, bad)
    with pytest.raises(GeometryFailed, match="gave up"):
        sizes(study_of(RECTANGLE))
    listed = study_of(RECTANGLE, "mesh={maxh: [0.5, 0.3, 0.2]}")
    if bad == 0:
        with pytest.raises(GeometryFailed, match="gave up"):
            sizes(listed)
    else:
        assert [v.exact for v in sizes(listed)] == [True, False, True]


def test_a_later_mesh_fails(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    fail_at(monkeypatch, 1)
    tree = tcstudy.run(study_of(RECTANGLE, "mesh={maxh: [0.5, 0.3, 0.2]}"), tmp_path / "out.nc")
    assert tree["status"].values.tolist() == [1, int(PointStatus.MESH_FAILED), 1]
    assert tree["reason"].values[1] == "the mesher gave up"
    assert np.isnan(tree["energy"].values[1])


def test_meshes_after_the_known_ones_are_bounded() -> None:
    study = study_of(RECTANGLE, "mesh={maxh: 0.5, tolerance: 1e-3, of: friction_resultant, max_dofs: 10000}")
    n_dofs = [v.n_dof for v in refined(sizes(study), study.mesh)]
    assert n_dofs[-1] == pytest.approx(10000, rel=0.01)
    assert n_dofs[1] == pytest.approx(2 * n_dofs[0])
    few = study_of(RECTANGLE, "mesh={maxh: 0.5, levels: 3, family: adaptive}")
    assert len(refined(sizes(few), few.mesh)) == 3
    assert refined(sizes(study_of(RECTANGLE)), study_of(RECTANGLE).mesh) == sizes(study_of(RECTANGLE))
