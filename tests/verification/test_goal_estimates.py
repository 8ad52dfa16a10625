"""Goals on other scenes than test_estimators.py: effectivity between 0.5 and 3, and tolerances that hold.

The factors of corners were made on the bracket, and film and block had been looked at; the other scenes had not.

Left out of the bounds, by construction: levels 0 and 1, on which no tolerance of a goal is accepted, and the upper
bound where the true error is small by accident (`at_crossing`; the estimate cannot know that, and must not follow it).
"""

from __future__ import annotations

import math
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from tcstudy.contact.solve import solve_contact
from tcstudy.offline.level import Level
from tcstudy.refine.family import ErrorEstimator, Family
from tcstudy.scene.study import FamilyName, Goal, MeshPlan, Study
from tests.verification import closed_forms
from tests.verification.goal_scenes import (
    BRACKET,
    FILM,
    GRADED,
    HEATED,
    LAYERED,
    OBTUSE,
    PATCH,
    PATCH_AT_NODE,
    PRESSED,
    RESULTANT,
    SLIP_LENGTH,
    Row,
    at_crossing,
    fine_value,
    front_resultant,
    front_slip,
    front_study,
    ring_scene,
    scene_of,
    spring_scene,
    table,
    to_tolerance,
    value_at_corner,
)

LOW, HIGH = 0.5, 4.5
"""Bounds of estimated over true error; the upper one for meshes on which much of the body's parts cancels."""
MOST, FEWER = 2500, 1000
"""Unknowns beyond which no mesh is compared with closed forms, and with finer solutions."""


def check(rows: list[Row], first: int = 2) -> None:
    """All levels from `first` on within the bounds; half of them much closer."""
    ratios = [row.effectivity for row in rows]
    usual = [ratio for i, ratio in enumerate(ratios) if i >= first and not at_crossing(rows, i)]
    assert len(rows) >= first + 2
    assert min(ratios[first:]) >= LOW, ratios
    assert all(ratio <= HIGH for ratio in usual), ratios
    if len(usual) > 2:
        assert 0.8 < float(np.median(usual)) < 2.75, ratios


def both(study: Study, goal: Goal, known: float) -> None:
    """Adaptive and uniform meshes."""
    families: tuple[tuple[FamilyName, int], ...] = (("adaptive", 20), ("uniform", 4))
    for family, levels in families:
        check(table(study, goal, known, family, levels, MOST))


@pytest.mark.parametrize(("study", "goals"), [
    (ring_scene()[0], ((RESULTANT, ring_scene()[1]), (Goal("u_T", (math.cos(0.7), math.sin(0.7))), ring_scene()[2]))),
    (spring_scene()[0], ((RESULTANT, spring_scene()[1]), (Goal("u_T", (0.3, 0.0)), math.sin(0.3 * math.pi)))),
], ids=["ring", "springs"])  # fmt: skip
def test_numbers_on_a_curved_contact_line_and_on_springs(study: Study, goals: tuple[tuple[Goal, float], ...]) -> None:
    for goal, known in goals:
        both(study, goal, known)
        met(study, goal, known, 2e-3)


SLIP = Goal("u_T", (1.4, 0.0))


@pytest.mark.parametrize(
    ("text", "goal", "first"),
    [
        (HEATED, SLIP, 2),  # thermal load, softening, two fronts, oblique sides
        (LAYERED, RESULTANT, 4),  # with under 45 unknowns the estimate is up to 11 times too large
        (PRESSED, SLIP, 2),
    ],
)
def test_numbers_against_much_finer_solutions(text: str, goal: Goal, first: int) -> None:
    check(table(scene_of(text), goal, fine_value(text, goal), "adaptive", 20, FEWER), first)


def test_numbers_under_a_law_that_grows_along_its_edge() -> None:
    """All is smooth, so that what the parts are extrapolated to on uniform meshes comes to be the error itself."""
    study, resultant = scene_of(GRADED), 2.4 / math.pi
    both(study, RESULTANT, resultant)
    plan = MeshPlan(study.mesh.maxh, 4, goal=RESULTANT, estimate=True)
    family, scene, ratios = Family(replace(study, mesh=plan)), study.scenes[0], []
    for i in range(plan.levels):
        level = Level(family.next(i), scene)
        estimator, condensed = ErrorEstimator(level, plan), level.condensed(scene)
        estimator.look((), scene, solve_contact(condensed.problem).v)
        found = estimator.estimates[()]
        ratios.append((found.limit - found.value) / (resultant - found.value))
    assert all(abs(after - 1.0) < 0.6 * abs(before - 1.0) for before, after in pairwise(ratios)), ratios
    assert abs(ratios[-1] - 1.0) < 0.05, ratios


def test_a_film_that_is_weaker_from_somewhere_within_a_cell_on() -> None:
    """What half a cell may hide there covers the error, which is anything from nothing to that."""
    study = scene_of(PATCH)
    for goal in (RESULTANT, Goal("u_T", (1.4, 0.0))):
        rows = table(study, goal, fine_value(PATCH_AT_NODE, goal), "adaptive", 20, FEWER)
        assert min(row.effectivity for row in rows[1:]) > 1.0, rows
        assert rows[-1].estimate < 0.01


def test_numbers_of_a_bracket_with_an_obtuse_contact_corner() -> None:
    """u ~ r^0.03, so that halving takes 4 % off the corner's share of the error, and the estimate has to know it."""
    study = scene_of(BRACKET)
    rows = table(study, RESULTANT, value_at_corner(study, RESULTANT, OBTUSE, 1000), "adaptive", 20, FEWER)
    ratios = [row.effectivity for row in rows[2:]]
    assert all(ratio > LOW for ratio in ratios), ratios
    assert all(ratio < 3.0 for ratio in ratios[-3:]), ratios  # the factor 17 is for the corner's share, not the rest
    assert rows[-1].signed > 0.05  # a tolerance of 5 % is out of reach, and the estimate says so
    assert rows[-1].estimate > 0.05


# -- slip length -------------------------------------------------------------------------------------

FRONTS = (0.183, 0.438, 0.521, 0.742)


@pytest.fixture(scope="module")
def slip_rows() -> list[list[Row]]:
    cases = [(front_study(change, maxh), 1.0 - change) for change, maxh in zip(FRONTS, (0.25, 0.2) * 2, strict=True)]
    cases += [(closed_forms.stick_slip(1, degrees), 1.0 - closed_forms.CHANGE) for degrees in (112.0,)]
    return [table(study, SLIP_LENGTH, length, "adaptive", 20, FEWER) for study, length in cases]


def test_estimates_of_the_slip_length_cover_its_error(slip_rows: list[list[Row]]) -> None:
    """Sum of slipping cells: its error is anything from nothing to half a cell, so the bounds are for most cases."""
    ratios = np.array([row.effectivity for rows in slip_rows for row in rows[2:]])
    assert len(ratios) > 30
    assert np.mean(ratios >= 1.0) >= 0.9
    assert np.mean(ratios > 5.0) <= 0.15
    assert np.min(ratios) > 0.3
    assert 1.0 < float(np.median(ratios)) < 2.5


# -- tolerances --------------------------------------------------------------------------------------


def met(study: Study, goal: Goal, known: float, tolerance: float) -> None:
    value, stop, n_dof = to_tolerance(study, goal, tolerance)
    assert stop.startswith(f"tolerance {tolerance:g} met"), stop
    assert abs(value - known) <= tolerance * abs(known), (value, known)
    assert n_dof < 20_000


@pytest.mark.parametrize(("change", "tolerance"), [(0.27, 1e-3)])
def test_tolerances_of_closed_forms_are_met(change: float, tolerance: float) -> None:
    study = front_study(change)
    met(study, SLIP_LENGTH, 1.0 - change, tolerance)
    met(study, RESULTANT, front_resultant(change), tolerance)
    met(study, Goal("u_T", (0.9, 0.0)), front_slip(change, 0.9), 3.0 * tolerance)


# -- units -------------------------------------------------------------------------------------------


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
    for goal, unit in ((RESULTANT, p * s), (SLIP_LENGTH, s)):
        one = table(scene_of(FILM), goal, 1.0, "adaptive", 5)
        other = table(scene_of(scaled), goal, unit, "adaptive", 5)
        assert [row.n_dof for row in one] == [row.n_dof for row in other]
        assert [row.estimate for row in one] == pytest.approx([row.estimate for row in other], rel=1e-9)
