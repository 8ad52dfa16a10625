"""What cells beside held nodes may hide: laws and given slips, by hand."""

from __future__ import annotations

import numpy as np
import pytest

from tcstudy.contact.problem import ContactProblem
from tcstudy.laws.laws import Laws
from tcstudy.refine.ends import hidden_effects
from tcstudy.scene.study import Goal, Quantity
from tests.refine.test_fronts import TRESCA, line_of

ZERO = np.zeros(4)
FALL = Laws(
    "falls",
    np.array([-1.0, 0.0, 1.0]),
    np.array([-1.0, 0.0, 0.0, 1.0]),
    np.array([-2.0, -5.0, 5.0, 2.0]),
    np.array([0.0, -3.0, -3.0, 0.0]),
    ZERO,
    ZERO,
)
"""5 at 0+, 2 from 1 on, odd."""


def hidden(
    law: Laws,
    slip: float,
    given: float = 0.0,
    held: tuple[int, ...] = (0,),
    goal: Quantity = "friction_resultant",
    z: float = 0.0,
) -> np.ndarray:
    """What four cells of length 1 hide whose free nodes have one slip, in equilibrium; of ∫ξ with z = 0 it is b."""
    line = line_of(4, held)
    v = np.full(line.m, slip)
    load = v + line.c * law.b(v)
    u = np.concatenate([np.where(np.isin(np.arange(5), held), given, slip), np.zeros(5)])
    problem = ContactProblem(np.eye(line.m), load, line.c, law)
    return hidden_effects(Goal(goal), line, problem, v, u, np.full(line.m, z))


def test_a_zone_may_stick_where_the_line_slips() -> None:
    assert hidden(TRESCA, 0.3) == pytest.approx([1.0, 0.0, 0.0, 0.0])  # from 0 in the corner to the bound
    assert hidden(TRESCA, 0.3, held=(0, 4)) == pytest.approx([1.0, 0.0, 0.0, 1.0])


def test_a_fall_within_the_cell_is_hidden_until_it_is_resolved() -> None:
    assert hidden(FALL, 7.0)[0] == pytest.approx(3.0)  # 5 beside the corner, 2 at the node
    assert hidden(FALL, 0.1)[0] == pytest.approx(4.7)  # 0 in a zone that sticks against 5 − 0.3
    assert hidden(FALL, 0.1, given=0.01)[0] == pytest.approx(0.27)  # no jump between: falls with the cell


def test_effects_on_numbers() -> None:
    assert hidden(TRESCA, 0.3, z=0.4)[0] == pytest.approx(0.5 * (1.0 + 0.6))
    assert hidden(TRESCA, 0.3, goal="u_T", z=0.4)[0] == pytest.approx(0.5 * 0.4)
    assert hidden(TRESCA, 0.3, goal="slip_length", z=0.4)[0] == pytest.approx(0.5 * 0.4 + 1.0)  # the zone may stick
    assert hidden(FALL, 0.1, given=0.01, goal="slip_length", z=0.4)[0] == pytest.approx(0.5 * 0.4 * 0.27)
