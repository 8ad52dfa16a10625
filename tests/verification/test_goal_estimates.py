"""Goals on other scenes than test_estimators.py: effectivity between 0.5 and 3, and tolerances that
hold.

The factors of corners were made on the bracket, and film and block had been looked at; the other
scenes had not.

Left out of the bounds, by construction: levels 0 and 1, on which no tolerance of a goal is
accepted, and the upper bound where the true error is small by accident (`at_crossing`; the estimate
cannot know that, and must not follow it).
"""

import math
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from tcstudy.contact.solve import solve_contact
from tcstudy.offline.level import Level
from tcstudy.refine.family import ErrorEstimator, Family
from tcstudy.scene.mesh_plan import FamilyName, Goal, MeshPlan
from tcstudy.scene.study import Study
from tests.benchmarks.tolerance_scenes import draw_scene
from tests.benchmarks.tolerances import judged
from tests.verification import goal_scenes as scenes

LOW, HIGH = 0.5, 4.5
"""Bounds of estimated over true error; the upper one for meshes on which much of the body's parts
cancels."""
MOST, FEWER = 1000, 500
"""Unknowns beyond which no mesh is compared with closed forms, and with finer solutions."""


def check(rows: list[scenes.Row], first: int = 2) -> None:
    """All levels from `first` on within the bounds; half of them much closer."""
    ratios = [row.effectivity for row in rows]
    usual = [
        ratio for i, ratio in enumerate(ratios) if i >= first and not scenes.at_crossing(rows, i)
    ]
    assert len(rows) >= first + 2
    assert min(ratios[first:]) >= LOW, ratios
    assert all(ratio <= HIGH for ratio in usual), ratios
    if len(usual) > 2:
        assert 0.8 < float(np.median(usual)) < 2.75, ratios


FAMILIES: tuple[tuple[FamilyName, int], ...] = (("adaptive", 20), ("uniform", 4))


def test_numbers_on_a_curved_contact_line_and_on_springs() -> None:
    """Held nodes give their cells away, and chords are shorter than arcs: ∫ξ of the ring; u_T of
    the springs."""
    (ring, resultant, _), (springs, _) = scenes.ring_scene(), scenes.spring_scene()
    for study, goal, known in (
        (ring, scenes.RESULTANT, resultant),
        (springs, Goal("u_T", (0.3, 0.0)), math.sin(0.3 * math.pi)),
    ):
        for family, levels in FAMILIES:
            check(scenes.table(study, goal, known, family, levels, MOST))
        met(study, goal, known, 2e-3)


SLIP = Goal("u_T", (1.4, 0.0))


@pytest.mark.parametrize(
    ("text", "goal", "first"),
    [
        (
            scenes.LAYERED,
            scenes.RESULTANT,
            4,
        ),  # with under 45 unknowns the estimate is up to 11 times too large
        (scenes.PRESSED, SLIP, 2),
    ],
)
def test_numbers_against_much_finer_solutions(text: str, goal: Goal, first: int) -> None:
    check(
        scenes.table(
            scenes.scene_of(text), goal, scenes.fine_value(text, goal, 700), "adaptive", 20, FEWER
        ),
        first,
    )


def test_numbers_under_a_law_that_grows_along_its_edge() -> None:
    """All is smooth, so that what the parts are extrapolated to on uniform meshes comes to be the
    error itself."""
    study, resultant = scenes.scene_of(scenes.GRADED), 2.4 / math.pi
    check(scenes.table(study, scenes.RESULTANT, resultant, "adaptive", 20, MOST))
    plan = MeshPlan(study.mesh.maxh, 4, goal=scenes.RESULTANT, estimate=True)
    family, scene, ratios = Family(replace(study, mesh=plan)), study.scenes[0], []
    for i in range(plan.levels):
        level = Level(family.next(i), scene)
        estimator, condensed = ErrorEstimator(level, plan), level.condensed(scene)
        estimator.look((), scene, solve_contact(condensed.problem).v)
        found = estimator.estimates[()]
        ratios.append((found.limit - found.value) / (resultant - found.value))
    assert all(abs(after - 1.0) < 0.6 * abs(before - 1.0) for before, after in pairwise(ratios)), (
        ratios
    )
    assert abs(ratios[-1] - 1.0) < 0.05, ratios


def test_a_film_that_is_weaker_from_somewhere_within_a_cell_on() -> None:
    """What half a cell may hide there covers the error, which is anything from nothing to that."""
    study = scenes.scene_of(scenes.PATCH)
    for goal in (scenes.RESULTANT, Goal("u_T", (1.4, 0.0))):
        rows = scenes.table(
            study, goal, scenes.fine_value(scenes.PATCH_AT_NODE, goal, 700), "adaptive", 20, FEWER
        )
        assert min(row.effectivity for row in rows[1:]) > 1.0, rows
        assert rows[-1].estimate < 0.01


def met(study: Study, goal: Goal, known: float, tolerance: float) -> None:
    value, stop, n_dof = scenes.to_tolerance(study, goal, tolerance)
    assert stop.startswith(f"tolerance {tolerance:g} met"), stop
    assert abs(value - known) <= tolerance * abs(known), (value, known)
    assert n_dof < 20_000


def test_tolerances_of_closed_forms_are_met() -> None:
    change, tolerance = 0.27, 1e-3
    study = scenes.front_study(change)
    met(study, scenes.SLIP_LENGTH, 1.0 - change, tolerance)
    met(study, scenes.RESULTANT, scenes.front_resultant(change), tolerance)
    met(study, Goal("u_T", (0.9, 0.0)), scenes.front_slip(change, 0.9), 3.0 * tolerance)


CANCELS = """
body:
  outline:
    - {from: [0.0, 0.0], edge: c}
    - {from: [68.6, 0.0], edge: right}
    - {from: [68.6, 10.3952], edge: shelf}
    - {from: [32.4556, 10.3952], edge: inner}
    - {from: [32.4556, 25.18], edge: top}
    - {from: [0.0, 25.18], edge: left}
  holes:
    - circle: {center: [16.22779687168009, 8.316189282361558], radius: 3.777, edge: bore}
boundary:
  c: contact
  inner: clamped
  right: free
  shelf: free
  top: free
  left: {role: traction, g: [-4936.0, -6100.0]}
  bore: {role: traction, pressure: -5643.0}
material: {E: 29600000.0, nu: 0.0221, plane: stress}
friction: {law: exponential, a: 513.2, b: 289.1, delta: 0.002851}
mesh: {maxh: 3.03, levels: 1}
"""
PLATEAU = """
units: none
body: {rectangle: {width: 3.148, height: 1}}
boundary: {bottom: contact, right: clamped, left: convection, top: convection}
material: {E: 1, nu: 0.391, k: 1, alpha_T: 0.1}
heat: {alpha: 0.2185, theta_bar: -0.1573, q: 0.8325}
friction: {law: slip-weakening, tau_s: 0.04069, tau_k: 0.01652, delta: 0.08833}
mesh: {maxh: 0.5, levels: 1}
"""


@pytest.mark.parametrize(
    ("study", "goal", "tolerance", "known", "most"),
    [
        # u ~ r^0.3 at the re-entrant corner and the rest of the body move the front to opposite
        # sides, so that halving all triangles barely moves it while it is still 3 % off; known: an
        # adaptive mesh of 32,829 unknowns
        (scenes.scene_of(CANCELS), scenes.SLIP_LENGTH, 1e-2, 40.5174, 4000),
        # beside the clamp the film passes its whole fall within the first cell: ∫ξ is the same on
        # all coarse meshes
        (scenes.scene_of(PLATEAU), scenes.RESULTANT, 1e-3, -0.0535319, 1000),
        # Tresca, a held corner: the line slips as a whole until the cell beside it is 1/40 of the
        # starting mesh's
        (draw_scene(4002, 16).study, scenes.RESULTANT, 1e-3, 0.618826, 1000),
    ],
    ids=["front", "plateau", "zone"],
)
def test_tolerances_hold_where_parts_cancel_on_the_way(
    study: Study, goal: Goal, tolerance: float, known: float, most: int
) -> None:
    trial = judged(0, study, goal, tolerance, known)
    assert trial.met
    assert trial.ratio <= 1.0, trial
    assert trial.n_dof < most


def test_estimates_do_not_depend_on_units() -> None:
    """FILM in lengths 2⁻¹⁰ and stresses 2³⁷ as large: the same meshes and relative estimates."""
    s, p = 2.0**-10, 2.0**37
    scaled = f"""
units: none
body: {{rectangle: {{width: {2 * s}, height: {s}}}}}
boundary: {{bottom: contact, left: clamped, top: {{role: traction, g: ["{0.03 * p / s}*x", {-0.01 * p}]}}, right: free}}
material: {{E: {p}, nu: 0.3}}
friction: {{law: slip-weakening, tau_s: {0.012 * p}, tau_k: {0.006 * p}, delta: {0.1 * s}}}
mesh: {{maxh: {0.5 * s}, levels: 1}}
"""
    for goal, unit in ((scenes.RESULTANT, p * s), (scenes.SLIP_LENGTH, s)):
        one = scenes.table(scenes.scene_of(scenes.FILM), goal, 1.0, "adaptive", 5)
        other = scenes.table(scenes.scene_of(scaled), goal, unit, "adaptive", 5)
        assert [row.n_dof for row in one] == [row.n_dof for row in other]
        assert [row.estimate for row in one] == pytest.approx(
            [row.estimate for row in other], rel=1e-9
        )
