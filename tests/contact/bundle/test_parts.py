"""Parts of bundle-Newton against plain dense algebra and an independent QP solver."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from numpy.typing import NDArray

from tcstudy.contact.bundle.contact import contact_oracle
from tcstudy.contact.bundle.newton import BundleNewton
from tcstudy.contact.bundle.simplex_qp import direction, dual_decrease, positive_definite
from tests.contact import contact_cases as cases

from .scalable import hilbert

Array = NDArray[np.float64]


def symmetric(rng: np.random.Generator, n: int) -> Array:
    R = rng.standard_normal((n, n))
    return R + R.T


@pytest.mark.parametrize("lift", [-20.0, 0.0, 20.0])
def test_metric_reverses_negative_eigenvalues_and_leaves_a_positive_matrix(lift: float) -> None:
    rng = np.random.default_rng(2)
    H = symmetric(rng, 7) + lift * np.eye(7)
    metric = positive_definite(H, 0.5, 1e-8, 0.0)
    w, V = np.linalg.eigh(H)
    assert np.allclose(metric.matrix, (V * (np.abs(w) + 0.5)) @ V.T)
    rows = rng.standard_normal((3, 7))
    white = metric.whiten(rows)
    assert np.allclose(white @ white.T, rows @ np.linalg.solve(metric.matrix, rows.T))
    assert np.allclose(metric.unwhiten(metric.whiten(rows[0])), np.linalg.solve(metric.matrix, rows[0]))


@pytest.mark.parametrize("kind", ["Hilbert", "low rank", "repeated"])
def test_the_gap_is_rounding_where_slopes_are_numerically_dependent(kind: str) -> None:
    """Primal minus dual value, relative to the decrease of the primal from q = 0, whatever the guess."""
    rng = np.random.default_rng(6)
    for _ in range(60):
        n, N = int(rng.integers(2, 60)), int(rng.integers(2, 100))
        A = rng.choice([-1.0, 1.0], (N, 1)) * hilbert(N, n)
        if kind == "low rank":
            A = rng.standard_normal((N, 2)) @ rng.standard_normal((2, n))
        elif kind == "repeated":
            A = rng.standard_normal((N, n))[rng.integers(0, 1 + N // 3, N)]
        metric = positive_definite(np.diag(10.0 ** rng.uniform(-9, 0, n)), 0.0, 1e-8, 0.0)
        c = -(10.0 ** rng.uniform(-8, 1)) * rng.random(N)
        lam, q = direction(c, A, np.zeros(n), metric, rng.random(N) * (rng.random(N) < 0.4))
        primal = float(0.5 * q @ metric.matrix @ q + np.max(c + A @ q))
        gap = primal + dual_decrease(c, A, lam, metric)
        slope = float(np.max(np.linalg.norm(metric.whiten(A), axis=1)))
        assert abs(gap) <= 1e-9 * (np.max(c) - primal) + 1e-14 * np.max(np.abs(c)) + (1e-12 * slope) ** 2


def test_the_gap_is_rounding_where_rows_span_twelve_decades() -> None:
    """Bound: what doubles leave of c + Aq at q, and of ‖Tᵀλ‖² where λ is rounded."""
    eps = np.finfo(float).eps
    for seed in range(100):
        rng = np.random.default_rng(seed)
        n, N = int(rng.integers(2, 60)), int(rng.integers(2, 100))
        A = rng.standard_normal((N, n)) * 10.0 ** rng.uniform(-6, 6, (N, 1))
        metric = positive_definite(np.diag(10.0 ** rng.uniform(-9, 0, n)), 0.0, 1e-8, 0.0)
        c = -(10.0 ** rng.uniform(-8, 1)) * rng.random(N)
        lam, q = direction(c, A, np.zeros(n), metric, rng.random(N) * (rng.random(N) < 0.4))
        primal = float(0.5 * q @ metric.matrix @ q + np.max(c + A @ q))
        values = np.max(np.abs(c)) + np.max(np.linalg.norm(A[lam > 0.0], axis=1)) * np.linalg.norm(q)
        white = lam[:, None] * metric.whiten(A)
        slope = np.linalg.norm(white.sum(axis=0)) * np.max(np.linalg.norm(white, axis=1))
        gap = primal + dual_decrease(c, A, lam, metric)
        assert gap <= 1e-9 * (np.max(c) - primal) + 16 * eps * (values + slope)


def test_dense_and_structured_oracle_give_the_same_run() -> None:
    problem = cases.random_problem(np.random.default_rng(5), 12)
    oracle = contact_oracle(problem)

    def dense(v: Array) -> tuple[float, Array, Array]:
        f, g, h = oracle(v)
        return f, g, problem.A_tilde + np.diag(h)

    runs: list[list[float]] = [[], []]
    for values, each, base in zip(runs, (oracle, dense), (problem.A_tilde, None), strict=True):
        method = BundleNewton(1e-8, x_unit=float(np.linalg.norm(problem.frictionless())), base=base)
        outcome = method.run(each, np.zeros(12), watch=lambda state, values=values: values.append(state.f))
        assert outcome.converged
    assert runs[0][:8] == pytest.approx(runs[1][:8], rel=1e-9)
    assert runs[0][-1] == pytest.approx(runs[1][-1], rel=1e-7)
    assert all(b <= a for a, b in pairwise(runs[0]))
