"""Scenes with a known number, and tables of the effectivity of goals on them.

Fronts:     configs/convergence.yaml with its front elsewhere, in closed form: ∫ξ, u_T at a point, slip length; the same
            turned (tests/verification/closed_forms.py)
Ring:       turning ring on a curved contact line: ∫ξ = τ·arc length, u_T constant
Spring:     linear law, u_T = sin(πx), ∫ξ = 2k/π
Heated:     a four-sided block between oblique sides, heated inside, exponential softening, two fronts
Film:       a pulled block on a softening film that has let go of its right part
Bracket:    plane stress, heat, a hole, an arc, and two slipping edges that meet at 174°, where u ~ r^0.03
Known:      in closed form, or the value itself on a mesh with some 16 times the triangles of the finest compared
            with it; for the bracket on meshes bisected at that corner until its share has gone
"""

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path

import numpy as np

from tcstudy.contact.solve import solve_contact
from tcstudy.data.records import BlockRecord, LevelRecord
from tcstudy.fem.meshes import PlaneMesh, refine
from tcstudy.offline.level import Level
from tcstudy.read.study import read_study_text
from tcstudy.refine.family import Family
from tcstudy.refine.goals import goal_value
from tcstudy.scene.mesh_plan import FamilyName, Goal, MeshPlan
from tcstudy.scene.records import Point
from tcstudy.scene.study import Study
from tcstudy.study.run import run
from tests.data.by_points import one_by_one
from tests.verification import closed_forms
from tests.verification.scenes import HEATED_BRACKET

CONFIGS = Path(__file__).parents[2] / "configs"
RESULTANT = Goal("friction_resultant")
SLIP_LENGTH = Goal("slip_length")

HEATED = """
units: none
body:
  outline:
    - {from: [0, 0], edge: base}
    - {from: [3, 0], edge: side}
    - {from: [2.2, 1], edge: top}
    - {from: [0.5, 1.2], edge: other}
boundary: {base: contact, side: convection, top: clamped, other: convection}
material: {E: 1, nu: 0.3, k: 1, alpha_T: 0.1}
heat: {alpha: 2, theta_bar: 0.1, q: "1 + sin(3*x)"}
friction: {law: exponential, a: 0.03, b: 0.02, delta: 0.05}
mesh: {maxh: 0.5, levels: 1}
"""

FILM = """
units: none
body: {rectangle: {width: 2, height: 1}}
boundary: {bottom: contact, left: clamped, top: {role: traction, g: ["0.03*x", -0.01]}, right: free}
material: {E: 1, nu: 0.3}
friction: {law: slip-weakening, tau_s: 0.012, tau_k: 0.006, delta: 0.1}
mesh: {maxh: 0.5, levels: 1}
"""

GRADED = """
units: none
body: {rectangle: {width: 1, height: 1}}
boundary: {bottom: contact, left: clamped, right: clamped, top: clamped}
material: {lambda: 1, mu: 1}
friction: {law: linear, k: 0.8, strength: "1 + x"}
mesh: {maxh: 0.25, levels: 1}
exact: {loads: derived, u: ["sin(pi*x)*(1 + 0.8*(1 + x)*y)", "x*y^2"]}
"""
"""A linear law that grows along the edge: u_T = sin(πx), ∫ξ = 2.4/π, with loads that follow."""

PRESSED = FILM.replace(
    '{role: traction, g: ["0.03*x", -0.01]}', "{role: rigid, force: [0.03, -0.02], moment: 0.01}"
).replace("left: clamped", "left: {role: traction, spring: {normal: 0.2}}")
"""The film under a block whose rigid top is pushed and turned, its side on springs."""
_SPLIT = """body:
  outline:
    - {from: [0, 0], edge: bottom}
    - {from: [AT, 0], edge: shoe}
    - {from: [2, 0], edge: right}
    - {from: [2, 1], edge: top}
    - {from: [0, 1], edge: left}
boundary: {shoe: contact, bottom"""
PATCH = FILM.replace(
    "delta: 0.1}", 'delta: 0.1, strength: "1 - 0.6*max(0, min(1, (x - 0.83)*1e9))"}'
)
"""The film weaker beyond x = 0.83, which is no node."""
PATCH_AT_NODE = PATCH.replace(
    "body: {rectangle: {width: 2, height: 1}}\nboundary: {bottom", _SPLIT.replace("AT", "0.83")
).replace("*1e9", "*1e9 + 0.5")
"""The same with a node there, of half the step: lumping does not see the step."""

BRACKET = (
    HEATED_BRACKET.replace(
        "  regions:\n    heater: {rectangle: {corner: [1.3, 0.4], width: 0.4, height: 0.3}}\n", ""
    )
    .replace(", omega: heater", "")
    .replace("{law: exponential, a: 0.004, b: 0.002, delta: 0.02}", "{law: tresca, tau: 0.01}")
    .replace("{maxh: 0.2, levels: 2}", "{maxh: 0.4, levels: 1}")
)
"""The bracket heated all over, with Tresca friction."""
LAYERED = """
units: none
body: {rectangle: {width: 2, height: 1}, regions: {r: {polygon: [[0, 0.4], [2, 0.5], [2, 1], [0, 1]]}}}
boundary: {bottom: contact, left: clamped, top: {role: convection, g: ["0.02*x", -0.01]}, right: free}
material: {E: 1, nu: 0.3, alpha_T: 0.02, k: 1}
materials: {r: {E: 5, nu: 0.2, alpha_T: 0.04, k: 0.2}}
heat: {alpha: 1, theta_bar: "0.5*(1 + x)", q: 0.3, omega: r}
friction: {law: slip-weakening, tau_s: 0.012, tau_k: 0.008, delta: 0.1}
mesh: {maxh: 0.5, levels: 1}
"""
"""A heated block of two layers that differ in all numbers."""
OBTUSE: Point = (1.0, -0.3)


@dataclass(frozen=True)
class Row:
    """One level: unknowns, J(u_h) − J(u), estimated error (both over |J(u)|)."""

    n_dof: int
    signed: float
    estimate: float

    @property
    def effectivity(self) -> float:
        return self.estimate / abs(self.signed) if self.signed else math.inf


def front_study(change: float, maxh: float = 0.2) -> Study:
    """configs/convergence.yaml with stick for x < change."""
    text = (CONFIGS / "convergence.yaml").read_text().replace("1/3", repr(change))
    return read_study_text(text, "front", (f"mesh={{maxh: {maxh}, levels: 1}}",))


def front_resultant(change: float) -> float:
    """∫ξ = ∫₀¹ 0.5 − 0.84 √max(0, change − x)."""
    return 0.5 - 0.56 * change**1.5


def front_slip(change: float, x: float) -> float:
    """u_T = 0.36 (x − change)^{3/2}."""
    return 0.36 * (x - change) ** 1.5


def ring_scene() -> tuple[Study, float, float]:
    """The ring, its ∫ξ and its u_T (held nodes give their cells away, and chords are shorter than
    arcs)."""
    A, B = closed_forms.A, closed_forms.B
    return closed_forms.ring(1), 2 * closed_forms.MU * B * math.radians(70), A + B


def spring_scene() -> tuple[Study, float]:
    return closed_forms.incompressible(1, (0.3,)), 2 * closed_forms.SPRING / math.pi


def scene_of(text: str) -> Study:
    return read_study_text(text, "scene")


def solved_meshes(
    study: Study, goal: Goal, most: int, marking: float = 0.6
) -> Iterator[tuple[Level, float]]:
    """Adaptive meshes for a goal up to `most` unknowns, with J(u_h)."""
    plan = MeshPlan(study.mesh.maxh, 60, "adaptive", goal=goal, marking=marking)
    scene, family = study.scenes[0], Family(replace(study, mesh=plan))
    for i in range(plan.levels):
        level = Level(family.next(i), scene)
        problem = level.condensed(scene).problem
        v = solve_contact(problem).v
        family.estimator(level).look((), scene, v)  # type: ignore[union-attr]
        yield level, goal_value(goal, problem, level.line, v)
        if level.frames.n_dof > most:
            return


@cache
def fine_value(text: str, goal: Goal, most: int = 1500) -> float:
    """J(u_h) itself, nothing extrapolated, where every triangle of a mesh of `most` unknowns is cut
    into sixteen."""
    study = scene_of(text)
    mesh = [level for level, _ in solved_meshes(study, goal, most)][-1].mesh
    for _ in range(2):
        mesh = refine(mesh)
    return _value(study, goal, mesh)


def _value(study: Study, goal: Goal, mesh: PlaneMesh) -> float:
    level = Level(mesh, study.scenes[0])
    problem = level.condensed(study.scenes[0]).problem
    return goal_value(goal, problem, level.line, solve_contact(problem).v)


def value_at_corner(
    study: Study, goal: Goal, at: Point, most: int = 6000, steps: int = 36
) -> float:
    """J with the mesh bisected at one corner `steps` times, extrapolated by Aitken's rule over
    thirds of them."""
    mesh = [level for level, _ in solved_meshes(study, goal, most)][-1].mesh
    values = []
    for k in range(1, steps + 1):
        node = int(np.argmin(np.linalg.norm(mesh.points - np.array(at), axis=1)))
        mesh = refine(mesh, np.any(mesh.triangles == node, axis=1))
        if k % (steps // 3) == 0:
            values.append(_value(study, goal, mesh))
    first, second = values[1] - values[0], values[2] - values[1]
    return values[2] + second**2 / (first - second)


def table(
    study: Study, goal: Goal, known: float, family: FamilyName, levels: int, most: int = 8000
) -> list[Row]:
    plan = MeshPlan(
        study.mesh.maxh,
        levels,
        family,
        goal=replace(goal, known=known),
        estimate=True,
        max_dofs=4 * most,
    )
    records = list(run(replace(study, mesh=plan)))
    sizes = [r.n_dof for r in records if isinstance(r, LevelRecord) and not r.stop]
    points = [p for r in records if isinstance(r, BlockRecord) for p in one_by_one(r)]
    assert all(p.reason == "" for p in points), [p.reason for p in points]
    rows = []
    for n_dof, point in zip(sizes, points, strict=True):
        value, estimate = float(point.numbers["goal"]), float(point.numbers["goal_estimate"])  # type: ignore[arg-type]
        rows.append(Row(n_dof, (value - known) / abs(known), estimate / abs(known)))
    return rows


def at_crossing(rows: list[Row], i: int) -> bool:
    """Whether the error of level i is small by accident, as the true errors alone tell.

    Its sign changes beside level i, or it is less than a third of what N^{-1} through all levels'
    errors says.
    """
    near = [row.signed for row in rows[max(i - 1, 0) : i + 2]]
    typical = float(np.median([abs(row.signed) * row.n_dof for row in rows]))
    return min(near) <= 0.0 <= max(near) or abs(rows[i].signed) * rows[i].n_dof < typical / 3.0


def to_tolerance(study: Study, goal: Goal, tolerance: float) -> tuple[float, str, int]:
    """J, why refinement stopped, and the unknowns of an adaptive run to a tolerance."""
    plan = MeshPlan(study.mesh.maxh, 40, "adaptive", goal=goal, tolerance=tolerance)
    records = list(run(replace(study, mesh=plan)))
    point = [p for r in records if isinstance(r, BlockRecord) for p in one_by_one(r)][-1]
    last = records[-1]
    return float(point.numbers["goal"]), last.stop, last.n_dof  # type: ignore[arg-type]
