"""Fronts between stick and slip within their cells: against closed forms, by differences, hidden and lonely ones."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from tcstudy.contact.contact import solve_contact
from tcstudy.contact.problem import ContactProblem
from tcstudy.fem.boundary import ContactLine
from tcstudy.laws.laws import Laws
from tcstudy.offline.level import Level
from tcstudy.refine.family import Family
from tcstudy.refine.fronts import fronts, slip_length, slopes
from tcstudy.scene.study import MeshPlan
from tests.verification.goal_scenes import front_study

ZERO = np.zeros(2)
TRESCA = Laws("tresca", np.zeros(1), ZERO, np.array([-1.0, 1.0]), ZERO, ZERO, ZERO)


def line_of(m: int, held: tuple[int, ...] = ()) -> ContactLine:
    """m + 1 nodes at distance 1 on a line, those of `held` without an unknown."""
    s = np.arange(m + 1.0)
    at = np.column_stack([s, 0 * s])
    free = np.array([i for i in range(m + 1) if i not in held])
    segments = np.column_stack([np.arange(m), np.arange(1, m + 1)])
    ends, c = np.stack([at[:-1], at[1:]], axis=1), np.zeros(m + 1)
    for a, b in segments:
        whole = [i for i in (a, b) if i not in held]
        c[whole] += 1.0 / len(whole)
    edge = np.zeros(len(free), np.int8)
    return ContactLine(
        free, s[free], at[free], c[free], edge, ("base",), segments, ends, np.arange(m), np.zeros(m, int)
    )


def problem_of(line: ContactLine) -> ContactProblem:
    return ContactProblem(np.eye(line.m), np.zeros(line.m), line.c, TRESCA)


def test_two_fronts_of_either_sign_are_found_exactly() -> None:
    """Slip of 3/2 power on both sides of a sticking zone from 3.3 to 6.4, to the right backwards."""
    line = line_of(10)
    s = line.arclength
    v = np.maximum(0.0, 3.3 - s) ** 1.5 - 2.0 * np.maximum(0.0, s - 6.4) ** 1.5
    found = fronts(line, problem_of(line), v)
    assert [front.segment for front in found] == [3, 6]
    length, doubt = slip_length(line, problem_of(line), v)
    assert length == pytest.approx(3.3 + 3.6, rel=1e-12)
    assert doubt == 0.0


def test_slopes_against_differences() -> None:
    line = line_of(10)
    problem = problem_of(line)
    v = np.maximum(0.0, 4.3 - line.arclength) ** 1.4 - 2.0 * np.maximum(0.0, line.arclength - 6.4) ** 1.7
    w = slopes(line, problem, v)
    assert np.count_nonzero(w) == 4
    for i in np.flatnonzero(w):
        step = np.zeros(line.m)
        step[i] = 1e-6 * abs(v[i])
        plus, minus = (slip_length(line, problem, v + sign * step)[0] for sign in (1.0, -1.0))
        assert (plus - minus) / (2 * step[i]) == pytest.approx(w[i], rel=1e-6)


def test_a_zone_that_hides_beside_a_held_node() -> None:
    """No node sticks, but the slip points to a front 0.7 of a cell away from the held one."""
    line = line_of(8, held=(0,))
    problem = problem_of(line)
    v = (line.arclength - 0.7) ** 1.5
    (front,) = fronts(line, problem, v)
    assert front.hidden
    assert front.more == pytest.approx(-0.7)
    assert slip_length(line, problem, v)[0] == pytest.approx(8.0 - 0.7)
    assert fronts(line, problem, line.arclength**0.7) == []  # slip up to the held node hides nothing


@pytest.mark.parametrize("change", [0.283, 0.41, 0.55, 0.637])
def test_fronts_of_the_closed_form(change: float) -> None:
    """Within a sixth of a cell wherever the front lies in it, as the module says; cells alone know it to a half."""
    study = front_study(change)
    study = replace(study, mesh=MeshPlan((0.2,), 4))
    scene, family = study.scenes[0], Family(study)
    level = [Level(family.next(i), scene) for i in range(4)][-1]
    condensed = level.condensed(scene)
    v = solve_contact(condensed.problem).v
    length, doubt = slip_length(level.line, condensed.problem, v)
    assert doubt == 0.0
    assert abs(length - (1.0 - change)) < np.median(level.line.c) / 6.0
