"""Bundle-Newton on problems of many variables, and on pieces whose slopes are numerically dependent."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import linprog

from tcstudy.contact.bundle.newton import BundleNewton

from .scalable import Problem, affine_maximum, hilbert, published, random_problem, slopes, sum_of_moduli

BY_NAME = {n: {p.name: p for p in published(n)} for n in (10, 50)}
FAST = ("Goffin", "Maxl", "chained LQ", "chained CB3 II", "chained Crescent II")


def assert_solved(problem: Problem, accuracy: float = 1e-9) -> None:
    outcome = BundleNewton().run(problem.oracle, problem.x0)
    assert outcome.converged, outcome.reason
    assert abs(outcome.f - problem.f_star) <= accuracy * (1.0 + abs(problem.f_star))


@pytest.mark.parametrize("name", list(BY_NAME[10]))
def test_ten_variables(name: str) -> None:
    assert_solved(BY_NAME[10][name])


@pytest.mark.parametrize(("name", "iterations"), [("MXHILB", 40), ("L1HILB", 50)])
def test_hilbert_slopes_take_few_iterations(name: str, iterations: int) -> None:
    """Measured 27 and 17."""
    problem = BY_NAME[50][name]
    assert np.linalg.matrix_rank(hilbert(50, 50)) < 25
    outcome = BundleNewton().run(problem.oracle, problem.x0)
    assert outcome.converged, outcome.reason
    assert outcome.f <= 1e-9
    assert outcome.iterations <= iterations


@pytest.mark.parametrize(("seed", "iterations"), [(0, 20), (32, 60)])
def test_pieces_without_curvature_are_minimised_whatever_the_spread_of_slopes(seed: int, iterations: int) -> None:
    """Measured 8 and 26: W must not hold back the steps along the flattest pieces."""
    problem = random_problem(seed)
    outcome = BundleNewton().run(problem.oracle, problem.x0)
    assert outcome.converged, outcome.reason
    assert outcome.f == pytest.approx(problem.f_star, rel=1e-9)
    assert outcome.iterations <= iterations


@pytest.mark.parametrize("seed", range(10))
def test_minima_are_those_of_linear_programmes(seed: int) -> None:
    """Nothing is known of these minima but what HiGHS says, to its own 1e-7 of the data."""
    rng = np.random.default_rng([seed, 11])
    n = int(rng.integers(2, 16))
    A = np.vstack([slopes(rng, int(rng.integers(2, 3 * n)), n), np.eye(n)])  # without I minima lie at 1e8
    N, size, x0 = len(A), float(np.max(np.abs(A))), rng.standard_normal(n)
    b, free = size * rng.standard_normal(N), [(None, None)] * n
    moduli = BundleNewton().run(lambda x: sum_of_moduli(A, b, x), x0)
    split = linprog(
        np.repeat([0.0, 1.0, 1.0], [n, N, N]),
        A_eq=np.hstack([A, np.eye(N), -np.eye(N)]),
        b_eq=b,
        bounds=free + [(0, None)] * (2 * N),
    )
    box = np.vstack([A, 2 * n * size * np.eye(n), -2 * n * size * np.eye(n)])
    offset = np.append(b, np.zeros(2 * n))
    maximum = BundleNewton().run(lambda x: affine_maximum(box, offset, x), x0)
    epigraph = linprog(
        np.repeat([0.0, 1.0], [n, 1]),
        A_ub=np.hstack([box, -np.ones((len(box), 1))]),
        b_ub=-offset,
        bounds=[*free, (None, None)],
    )
    for outcome, exact in ((moduli, split), (maximum, epigraph)):
        assert outcome.converged, outcome.reason
        assert outcome.f == pytest.approx(exact.fun, rel=1e-6, abs=1e-6 * size)
