"""Edges that turn as a whole, and a rail on its spring in closed form;
tests/verification/test_rich_scenes.py has the other supports and resultants against a plain
solve."""

from dataclasses import dataclass, replace

import numpy as np
import pytest

from tcstudy.contact.solve import solve_contact
from tcstudy.expressions.expression import Scalar, parse
from tcstudy.offline.error_bound import ErrorBounds
from tcstudy.offline.level import Level, loaded_by
from tcstudy.offline.requested_outputs import RequestedOutputs
from tcstudy.read.study import read_study
from tcstudy.refine.family import ErrorEstimator
from tcstudy.reports.picture import is_loaded
from tcstudy.scene.guarantee import why_no_bound
from tcstudy.scene.parameters import path_scene
from tcstudy.scene.records import Direction, Role, Scene, Traction, TractionTerm
from tcstudy.study.lint import loaded
from tcstudy.study.path_run import affine_load
from tests.commands import CONFIGS
from tests.verification.scenes import RECTANGLE, levels_of, study_of

RIGID = """
units: none
body:
  outline: [{from: [0, 0], edge: foot}, {from: [0.5, 0], edge: film}, {from: [2, 0], edge: right},
    {from: [2, 1], edge: top}, {from: [0, 1], edge: left}]
boundary: {foot: clamped, film: contact, left: free, top: PLATE, right: free}
material: {E: 1, nu: 0.3, alpha_T: 0.01}
heat: {theta: "x*y"}
friction: {law: slip-weakening, tau_s: 0.02, tau_k: 0.005, delta: 0.2}
mesh: {maxh: 0.3}
"""


def solved(plate: str) -> tuple[Scene, Level, np.ndarray, np.ndarray]:
    """Scene, level, slip and the displacement of the body (2, n)."""
    study = study_of(RIGID.replace("PLATE", plate))
    scene, level = study.scenes[0], levels_of(study)[0]
    v = solve_contact(level.condensed(scene).problem).v
    return scene, level, v, level.displacement(scene, v).reshape(2, -1)


def test_an_edge_that_turns_is_the_clamped_one_whose_reactions_are_its_resultants() -> None:
    """The plate moves as u = a + phi × (x − 1, 0) under its force and moment; a path runs along
    either."""
    scene, level, v, u = solved("{role: rigid, force: [0.05, -0.1], moment: 0.03}")
    plate = level.mesh.points[:, 1] > 1 - 1e-12
    s, U = level.mesh.points[plate, 0] - 1.0, u[:, plate]
    phi = float((U[1, s.argmax()] - U[1, s.argmin()]) / 2.0)
    a = U.mean(axis=1) - [0.0, phi * s.mean()]
    assert np.abs(U - np.array([a[0] + 0 * s, a[1] + phi * s])).max() < 1e-14
    assert phi > 1e-3
    other, same, w, moved = solved(
        f'{{role: clamped, u: [{float(a[0])!r}, "{float(a[1])!r} + {phi!r}*(x - 1)"]}}'
    )
    assert w == pytest.approx(v, abs=1e-11)
    assert moved == pytest.approx(u, abs=1e-11)
    K = same.elastic.stiffness_of((((), other.material.lam, other.material.mu),))
    forces = (K @ moved.ravel() - same.load(other)).reshape(2, -1)[:, plate]
    assert [*forces.sum(axis=1), forces[1] @ s] == pytest.approx([0.05, -0.1, 0.03], abs=1e-11)
    keys = ("boundary", "top", "moment")
    along = affine_load(level, lambda t: path_scene(scene, keys, t), -1.0, 3.0, "moment").problem
    between = level.condensed(path_scene(scene, keys, 1.7)).problem.l_tilde
    assert along.load(1.7) == pytest.approx(between, abs=1e-12 * np.max(np.abs(between)))


def test_end_of_the_rail_on_its_spring() -> None:
    """The numbers in the head of configs/spring_rail.yaml."""
    study = read_study(CONFIGS / "spring_rail.yaml")
    level = levels_of(study)[0]
    slips = [solve_contact(level.condensed(scene).problem).v for scene in study.scenes]
    found = [
        RequestedOutputs(level, study.output).of(*one)
        for one in zip(study.scenes, slips, strict=True)
    ]
    assert [1e3 * one["probe_end_u_T"] for one in found] == pytest.approx(
        [12.0960, 9.8479, 6.5940], rel=1e-3
    )
    held = 21e9 * 4.8e-4  # the middle, far from the end, holds all of the thermal force
    assert [one["reaction_middle_x"] for one in found] == pytest.approx([held] * 3, rel=1e-3)


@dataclass(frozen=True)
class Sheared(Traction):
    """A traction edge with a load that the package does not have: a shear along the edge."""

    loads = (*Traction.loads, "shear")
    shear: Scalar = 0.0

    @property
    def traction_terms(self) -> tuple[TractionTerm, ...]:
        shear = TractionTerm("shear", self.shear, Direction(tangential=1.0))
        return (*super().traction_terms, shear)


def test_a_new_load_of_an_edge_needs_its_role_alone() -> None:
    """Solutions, estimate, proved bound and warnings of a shear are those of the same `g`; t of the
    top edge is (−1, 0)."""
    study = study_of(RECTANGLE, "mesh={maxh: 0.3, levels: 1}")
    [level] = levels_of(study)
    boundary = dict(study.scenes[0].boundary)

    def scene_of(top: Role) -> Scene:
        return replace(study.scenes[0], boundary=tuple((boundary | {"top": top}).items()))

    def results(scene: Scene) -> list[float]:
        v = solve_contact(level.condensed(scene).problem).v
        estimates = ErrorEstimator(level, study.mesh).look((), scene, v)
        bounds = ErrorBounds(level).look(scene, v)
        return [*v, *level.displacement(scene, v), *estimates.values(), *bounds.values()]

    sheared = scene_of(Sheared(shear=0.02))
    pulled = scene_of(Traction(g=(-0.02, 0.0)))
    assert results(sheared) == pytest.approx(results(pulled), rel=1e-9, abs=1e-12)
    assert np.max(np.abs(results(sheared))) > 0.01
    unloaded = loaded_by(sheared)
    assert [*loaded([sheared, unloaded])] == [True, False]
    assert is_loaded(dict(sheared.boundary)["top"])
    doubled = path_scene(sheared, ("load",), 2.0)
    assert level.load(doubled) == pytest.approx(2.0 * level.load(sheared), rel=1e-12)
    curved = scene_of(Sheared(shear=parse("x^2")))
    assert why_no_bound(curved) == ""  # its rest adds to the bound
