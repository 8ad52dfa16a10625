"""Fronts between stick and slip within their cells, hidden ones, and what cells beside held nodes
may hide."""

import numpy as np
import pytest

from tcstudy.contact.problem import ContactProblem
from tcstudy.fem.forms import ContactLine
from tcstudy.laws.laws import Laws
from tcstudy.laws.shapes import SHAPES
from tcstudy.refine.goals import fronts, hidden_effects, slip_length, slopes
from tcstudy.scene.mesh_plan import Goal, Quantity

TRESCA = SHAPES["tresca"].build(tau=1.0)


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
    own = free, s[free], at[free], c[free], np.zeros(len(free), np.int8), ("base",)
    return ContactLine(*own, segments, ends, np.arange(m), np.zeros(m, int))


def test_two_fronts_of_either_sign_are_found_exactly_and_move_as_differences_say() -> None:
    """Slip of 3/2 power on both sides of a sticking zone from 3.3 to 6.4, to the right
    backwards."""
    line = line_of(10)
    s, problem = line.arclength, ContactProblem(np.eye(line.m), np.zeros(line.m), line.c, TRESCA)
    v = np.maximum(0.0, 3.3 - s) ** 1.5 - 2.0 * np.maximum(0.0, s - 6.4) ** 1.5
    assert [front.segment for front in fronts(line, problem, v)] == [3, 6]
    assert slip_length(line, problem, v) == (pytest.approx(3.3 + 3.6, rel=1e-12), 0.0)
    v = np.maximum(0.0, 4.3 - s) ** 1.4 - 2.0 * np.maximum(0.0, s - 6.4) ** 1.7
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
    problem = ContactProblem(np.eye(line.m), np.zeros(line.m), line.c, TRESCA)
    v = (line.arclength - 0.7) ** 1.5
    (front,) = fronts(line, problem, v)
    assert front.hidden
    assert (front.excess, slip_length(line, problem, v)[0]) == (
        pytest.approx(-0.7),
        pytest.approx(8.0 - 0.7),
    )
    assert (
        fronts(line, problem, line.arclength**0.7) == []
    )  # slip up to the held node hides nothing


FALL = SHAPES["slip-weakening"].build(tau_s=5.0, tau_k=2.0, delta=1.0)


def hidden(law: Laws, slip: float, given: float = 0.0, held: tuple[int, ...] = (0,),
           goal: Quantity = "friction_resultant", z: float = 0.0) -> np.ndarray:  # fmt: skip
    """What four cells of length 1 hide whose free nodes have one slip, in equilibrium; of ∫ξ with z
    = 0 it is b."""
    line = line_of(4, held)
    v = np.full(line.m, slip)
    load = v + line.c * law.b(v)
    u = np.concatenate([np.where(np.isin(np.arange(5), held), given, slip), np.zeros(5)])
    problem = ContactProblem(np.eye(line.m), load, line.c, law)
    return hidden_effects(Goal(goal), line, problem, v, u, np.full(line.m, z))


def test_what_cells_beside_held_nodes_hide_and_what_it_changes_of_numbers() -> None:
    assert hidden(TRESCA, 0.3) == pytest.approx(
        [1.0, 0.0, 0.0, 0.0]
    )  # from 0 in the corner to the bound
    assert hidden(TRESCA, 0.3, held=(0, 4)) == pytest.approx([1.0, 0.0, 0.0, 1.0])
    assert hidden(FALL, 7.0)[0] == pytest.approx(3.0)  # 5 beside the corner, 2 at the node
    assert hidden(FALL, 0.1)[0] == pytest.approx(4.7)  # 0 in a zone that sticks against 5 − 0.3
    assert hidden(FALL, 0.1, given=0.01)[0] == pytest.approx(
        0.27
    )  # no jump between: falls with the cell
    assert hidden(TRESCA, 0.3, z=0.4)[0] == pytest.approx(0.5 * (1.0 + 0.6))
    assert hidden(TRESCA, 0.3, goal="u_T", z=0.4)[0] == pytest.approx(0.5 * 0.4)
    assert hidden(TRESCA, 0.3, goal="slip_length", z=0.4)[0] == pytest.approx(
        0.5 * 0.4 + 1.0
    )  # the zone may stick
    assert hidden(FALL, 0.1, given=0.01, goal="slip_length", z=0.4)[0] == pytest.approx(
        0.5 * 0.4 * 0.27
    )
