"""lowest: against the least of all energies at many values of t, computed from the definition."""

from __future__ import annotations

import numpy as np
import pytest

from tcstudy.solvers.path.follow import Path, follow
from tcstudy.solvers.path.lowest import lowest
from tcstudy.solvers.path.query import solutions_at
from tests.solvers import contact_cases as cases
from tests.solvers.path.cases import a_solution, one_node, random_path_problem


def check(path: Path, rng: np.random.Generator) -> int:
    low = lowest(path)
    assert np.all(low.begin < low.end)
    assert low.begin[1:] == pytest.approx(low.end[:-1], abs=1e-12)
    assert (low.begin[0], low.end[-1]) == (path.t.min(), path.t.max())
    assert np.all(low.piece[1:] != low.piece[:-1])
    size = float(np.max(np.abs(path.energy)))
    several = 0
    for t in rng.uniform(path.t.min(), path.t.max(), 60):
        found = solutions_at(path, float(t))
        several += len(found) > 1
        piece = low.piece[np.searchsorted(low.begin, t, side="right") - 1]
        energy = next(s.energy for s in found if s.piece == piece)
        assert energy <= min(s.energy for s in found) + 1e-11 * size
    return several


def test_maxwell_point_of_one_node() -> None:
    path = follow(one_node(cases.slip_weakening(1.0, 0.2, 0.4)), np.zeros(1), 0.0, 0.0, 1.5)
    low = lowest(path)
    assert path.u[low.piece, 0] == pytest.approx([0.0, 0.4], abs=1e-14)
    assert path.stable[low.piece].all()
    assert low.end[0] == low.begin[1] == pytest.approx(0.2 + np.sqrt(0.32), abs=1e-14)
    assert check(path, np.random.default_rng(0)) > 10


@pytest.mark.parametrize("seed", range(8))
def test_random_paths(seed: int) -> None:
    rng = np.random.default_rng([seed, 97])
    problem = random_path_problem(rng, int(rng.integers(1, 10)))
    check(follow(problem, a_solution(problem, 0.0), 0.0, -2.0, 2.0), rng)
