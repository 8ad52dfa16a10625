"""What cells beside held nodes may hide: laws and given slips, by hand."""

from __future__ import annotations

import numpy as np
import pytest

from tcstudy.contact.problem import ContactProblem
from tcstudy.laws.laws import Laws
from tcstudy.refine.ends import end_cells
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


def cells(law: Laws, slip: float, given: float = 0.0, held: tuple[int, ...] = (0,)):  # type: ignore[no-untyped-def]
    """End cells of four cells of length 1 whose free nodes have one slip, in equilibrium."""
    line = line_of(4, held)
    v = np.full(line.m, slip)
    load = v + line.c * law.b(v)
    u = np.concatenate([np.where(np.isin(np.arange(5), held), given, slip), np.zeros(5)])
    return end_cells(line, ContactProblem(np.eye(line.m), load, line.c, law), v, u)


def test_a_zone_may_stick_where_the_line_slips() -> None:
    (cell,) = cells(TRESCA, 0.3)
    assert (cell.segment, cell.node, cell.width, cell.sticks) == (0, 0, 1.0, True)
    assert cell.most == pytest.approx(1.0)  # from 0 in the corner to the bound
    assert len(cells(TRESCA, 0.3, held=(0, 4))) == 2


def test_a_zone_that_is_seen_hides_nothing() -> None:
    assert cells(TRESCA, 0.0) == []


def test_given_slips() -> None:
    assert cells(TRESCA, 0.3, given=0.2) == []  # one bound all along
    (turns,) = cells(TRESCA, 0.3, given=-0.2)
    assert turns.most == pytest.approx(2.0)
    (rounded,) = cells(TRESCA, 0.3, given=1e-17)
    assert rounded.most == pytest.approx(1.0)


def test_a_fall_within_the_cell_is_hidden_until_it_is_resolved() -> None:
    (past,) = cells(FALL, 7.0)
    assert past.most == pytest.approx(3.0)  # 5 beside the corner, 2 at the node
    (on,) = cells(FALL, 0.1)
    assert on.most == pytest.approx(4.7)  # 0 in a zone that sticks against 5 − 0.3
    (free,) = cells(FALL, 0.1, given=0.01)
    assert free.most == pytest.approx(0.27)  # no jump between: falls with the cell
    assert not free.sticks


def test_effects_on_numbers() -> None:
    (cell,) = cells(TRESCA, 0.3)
    z = np.full(4, 0.4)
    assert cell.effect(1.0, z) == pytest.approx(0.5 * (1.0 + 0.6))
    assert cell.effect(0.0, z) == pytest.approx(0.5 * 0.4)
