"""cell: exact segments against enumeration."""

from __future__ import annotations

from itertools import product

import numpy as np
import pytest

from tcstudy.contact.path.complete import Found, segments
from tcstudy.contact.path.follow import ParametricProblem
from tests.contact import contact_cases as cases
from tests.contact.path.cases import a_solution, all_solutions, follow, random_path_problem


@pytest.mark.parametrize("seed", range(8))
def test_segments_of_all_cells_are_all_solutions(seed: int) -> None:
    """Every combination of pieces at once; at random t as many pieces as plain solves find, and there."""
    rng = np.random.default_rng([seed, 11])
    problem = random_path_problem(rng, 2, 4)
    pieces = np.flatnonzero(problem.graph.high > problem.graph.low)
    codes = np.array(list(product(pieces, repeat=2)))
    found = segments(problem, codes, -2.0, 2.0)
    one = found.found == Found.ONE
    assert not np.any(found.found == Found.UNDECIDED)
    for t in rng.uniform(-2.0, 2.0, 5):
        here = np.flatnonzero(one & (np.min(found.t, axis=1) < t) & (t < np.max(found.t, axis=1)))
        share = (t - found.t[here, 0]) / (found.t[here, 1] - found.t[here, 0])
        u = found.u[here, 0] + share[:, None] * (found.u[here, 1] - found.u[here, 0])
        expected = np.array([v for v, _ in all_solutions(problem, t)])
        assert len(u) == len(expected)
        assert np.max(np.min(np.max(np.abs(u[:, None] - expected), axis=2), axis=0)) <= 1e-9


def test_segments_are_the_pieces_of_the_path() -> None:
    problem = random_path_problem(np.random.default_rng([3, 41]), 20, 12)
    path = follow(problem, a_solution(problem, 0.0), 0.0, -3.0, 3.0)
    found = segments(problem, path.codes, -3.0, 3.0)
    assert np.all(found.found == Found.ONE)
    for k in range(path.pieces - 1):
        if k in (path.start - 1, path.start):
            continue
        end = int(np.argmin([np.max(np.abs(u - path.u[k + 1])) for u in found.u[k]]))
        assert found.u[k, end] == pytest.approx(path.u[k + 1], abs=1e-10)
        assert found.t[k, end] == pytest.approx(path.t[k + 1], abs=1e-10)


def test_a_corner_within_rounding_and_a_lost_rank_are_left_undecided() -> None:
    """Two equal springs under equal loads let go together; of a cell beside that vertex nothing is claimed."""
    law = cases.slip_weakening(1.0, 0.2, 0.4)
    problem = ParametricProblem(np.eye(2), np.zeros(2), np.ones(2), np.ones(2), law)
    codes = np.array([[3, 3], [3, 4], [4, 4]])
    assert list(segments(problem, codes, -0.5, 0.5).found) == [Found.ONE, Found.NONE, Found.NONE]
    assert list(segments(problem, codes, 0.0, 2.0).found) == [Found.UNDECIDED] * 3
