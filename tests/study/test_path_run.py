"""A study's path: the stable solutions of runs lie on it, thermal and mechanical parameters, clear refusals."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from tcstudy.data.records import BlockRecord, PointStatus
from tcstudy.data.store import Record
from tcstudy.fem.geometry import build
from tcstudy.offline.level import Level
from tcstudy.read.study import read_study, read_study_text
from tcstudy.scene.parameters import path_scene
from tcstudy.scene.study import Study
from tcstudy.study.path_affine import PathError, affine_load
from tcstudy.study.path_run import follow_path, shortfalls
from tcstudy.study.run import run
from tests.data.by_points import one_by_one
from tests.verification.scenes import HEATED_BRACKET, mesh_family

PAD = Path(__file__).parents[2] / "configs" / "path.yaml"
VALUES = (0.2e-3, 0.75e-3, 0.85e-3, 0.9e-3, 1.0e-3, 1.1e-3, 1.6e-3)


def softer(text: str) -> str:
    """The bracket with a law that falls faster than the body is stiff."""
    law = "friction: {law: slip-weakening, tau_s: 0.004, tau_k: 0.001, delta: 0.002}"
    return re.sub(r"friction: .*", law, text)


def distance(record: Record, t: float, v: np.ndarray) -> float:
    """How far v is from the nearest solution of t on the path, relative to the largest slip on it."""
    T, u = record.values["parameter"], record.values["u_T"]
    pieces = np.flatnonzero((np.minimum(T[:-1], T[1:]) <= t) & (np.maximum(T[:-1], T[1:]) >= t))
    s = (t - T[pieces]) / (T[pieces + 1] - T[pieces])
    points = u[pieces] + s[:, None] * (u[pieces + 1] - u[pieces])
    return float(np.min(np.max(np.abs(points - v), axis=1)) / np.max(np.abs(u)))


@pytest.fixture(scope="module")
def pad() -> tuple[Study, Record]:
    study = read_study(PAD, ["mesh.levels=2"])
    return study, follow_path(study)


def test_stable_solutions_of_a_run_lie_on_the_path(pad: tuple[Study, Record]) -> None:
    sweep = f"sweep={{boundary.plate.u_x: [{', '.join(map(repr, VALUES))}]}}"
    study = read_study(PAD, ["solver=separable-newton", "mesh.levels=2", "solver.branch=lowest", sweep])
    blocks = (record for record in run(study) if isinstance(record, BlockRecord) and record.level == 1)
    points = [point for block in blocks for point in one_by_one(block)]
    assert len(points) == len(VALUES)
    for point in points:
        assert point.status == PointStatus.OK
        assert distance(pad[1], VALUES[point.index[0]], point.u_T) <= 1e-10


def test_every_vertex_is_a_solution_and_energy_follows_its_rate(pad: tuple[Study, Record]) -> None:
    study, record = pad
    assert study.path
    curve = record.values
    assert shortfalls(study, record) == []
    assert len(curve["fold_vertex"]) >= 8
    assert curve["residual"].max() <= 1e-11
    mean = 0.5 * (curve["energy_rate"][1:] + curve["energy_rate"][:-1])
    assert np.diff(curve["energy"]) == pytest.approx(
        np.diff(curve["parameter"]) * mean, abs=1e-9 * np.ptp(curve["energy"])
    )
    level = Level(list(mesh_family(build(study.path.scene.body), study.mesh))[-1], study.path.scene)
    for k in range(0, len(curve["parameter"]), 7):
        scene = path_scene(study.path.scene, study.path.parameter, float(curve["parameter"][k]))
        condensed = level.condensed(scene)
        assert condensed.problem.inclusion_residual(curve["u_T"][k], 1e-9 * np.ptp(curve["u_T"])) <= 1e-10
        energy = condensed.problem.energy(curve["u_T"][k]) + condensed.constant
        assert curve["energy"][k] == pytest.approx(energy, abs=1e-11 * np.max(np.abs(curve["energy"])))


@pytest.mark.parametrize(
    "section",
    [
        "{parameter: q, from: 0, to: 3, at: [1]}",
        "{parameter: load, from: 0, to: -4, at: [-2], level: 0}",
        "{parameter: boundary.left.g_x, from: 0.1, to: -0.3, at: [0], direction: forward}",
    ],
)
def test_all_kinds_of_parameters_on_the_heated_bracket(section: str) -> None:
    """Solutions at the requested value are those of the assembled scene, whatever carries the parameter."""
    text = softer(HEATED_BRACKET)
    study = read_study_text(f"{text}path: {section}\n")
    assert study.path
    record = follow_path(study)
    assert record.values["solution_count"] != [0]
    assert record.values["affine_defect"] <= 1e-12
    meshes = list(mesh_family(build(study.path.scene.body), study.mesh))
    level = Level(meshes[record.values["level"]], study.path.scene)
    scene = path_scene(study.path.scene, study.path.parameter, study.path.at[0])
    condensed = level.condensed(scene)
    for v, energy in zip(record.values["solution_u_T"], record.values["solution_energy"], strict=True):
        assert condensed.problem.inclusion_residual(v) <= 1e-10
        assert energy == pytest.approx(condensed.problem.energy(v) + condensed.constant, rel=1e-10)
    if "direction: forward" in section:
        assert record.values["start"] == 0
        assert record.values["parameter"][0] == study.path.begin


def test_a_parameter_that_is_not_affine_is_refused() -> None:
    study = read_study_text(HEATED_BRACKET)
    scene = study.scenes[0]
    level = Level(next(iter(mesh_family(build(scene.body), study.mesh))), scene)
    with pytest.raises(PathError, match=r"not affine in alpha \(relative deviation"):
        affine_load(level, lambda t: replace(scene, heat=replace(scene.heat, alpha=t)), 0.5, 2.0, "alpha")
    with pytest.raises(PathError, match="stiffness changes with mu"):
        affine_load(level, lambda t: replace(scene, material=replace(scene.material, mu=t)), 0.5, 2.0, "mu")
    with pytest.raises(PathError, match="does not depend on nothing"):
        affine_load(level, lambda t: scene, 0.5, 2.0, "nothing")
