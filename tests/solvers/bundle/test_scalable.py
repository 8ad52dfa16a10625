"""Bundle-Newton on problems of many variables, and on pieces whose slopes are numerically dependent."""

from __future__ import annotations

import numpy as np
import pytest

from tcstudy.solvers.bundle.newton import BundleNewton
from tcstudy.solvers.loop import iterate

from .scalable import Problem, hilbert, published, random_problem

BY_NAME = {n: {p.name: p for p in published(n)} for n in (10, 50)}
FAST = ("Goffin", "Maxl", "chained LQ", "chained CB3 II", "active faces", "chained Crescent I", "chained Crescent II")


def assert_solved(problem: Problem, accuracy: float = 1e-9) -> None:
    outcome = iterate(BundleNewton(), problem.oracle, problem.x0)
    assert outcome.converged, outcome.reason
    assert abs(outcome.f - problem.f_star) <= accuracy * (1.0 + abs(problem.f_star))


@pytest.mark.parametrize("name", [n for n, p in BY_NAME[10].items() if np.isfinite(p.f_star)])
def test_ten_variables(name: str) -> None:
    assert_solved(BY_NAME[10][name])


@pytest.mark.parametrize("name", FAST)
def test_fifty_variables(name: str) -> None:
    assert_solved(BY_NAME[50][name])


@pytest.mark.parametrize(("name", "iterations"), [("MXHILB", 40), ("L1HILB", 50)])
def test_hilbert_slopes_take_few_iterations(name: str, iterations: int) -> None:
    """Measured 27 and 17."""
    problem = BY_NAME[50][name]
    assert np.linalg.matrix_rank(hilbert(50, 50)) < 25
    outcome = iterate(BundleNewton(), problem.oracle, problem.x0)
    assert outcome.converged, outcome.reason
    assert outcome.f <= 1e-9
    assert outcome.iterations <= iterations


@pytest.mark.parametrize("seed", [1, 2, 3, 4, 6, 7, 9, 10, 11])
def test_random_maxima_and_sums_of_moduli(seed: int) -> None:
    assert_solved(random_problem(seed), 1e-6)
