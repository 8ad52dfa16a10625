"""Simultaneous events: the patch test, mirror symmetry, integer data full of ties, starts on a vertex, flat pieces."""

from __future__ import annotations

import numpy as np
import pytest

from tcstudy.contact.path.follow import Follower, ParametricProblem, PathStatus
from tcstudy.contact.path.query import solutions_at
from tcstudy.laws.laws import Laws
from tests.contact import contact_cases as cases
from tests.contact.path.cases import a_solution, follow, one_node

DROPPING = cases.linear_law("drops", [-0.4, 0.0, 0.4], [-0.2, -1.0, 1.0], [-1.0, 1.0, 0.2], (0.0, 0.0))


@pytest.mark.parametrize(
    ("law", "slip", "t", "third"),
    [
        (cases.slip_weakening(1.0, 0.2, 0.4), 0.0, 1.0, 0.2),
        (cases.slip_weakening(1.0, 0.2, 0.4), 0.4, 0.6, 0.2),
        (DROPPING, 0.4, 1.4, 0.4),
        (DROPPING, 0.4, 0.6, 0.4),
    ],
)
def test_starts_exactly_on_the_folds_of_a_uniform_body(law: Laws, slip: float, t: float, third: float) -> None:
    """All nodes on a kink, all tied: both uniform branches are found from the fold itself."""
    A, c = cases.half_laplacian(7)
    A = A - np.diag(A.sum(axis=1) - c)  # uniform slips s need the load c s
    path = follow(ParametricProblem(A, np.zeros(7), c, c, law), np.full(7, slip), t, -2.0, 2.0)
    assert np.max(np.ptp(path.u, axis=1)) <= 1e-12
    assert len(path.folds) == 4
    assert path.start in path.folds
    assert sorted(s.v[0] for s in solutions_at(path, 0.8)) == pytest.approx([0.0, third, 0.6], abs=1e-12)


def test_mirror_symmetry_is_kept() -> None:
    """Pairs of nodes always switch together; the path of the whole equals that of the symmetric half."""
    for law in (cases.slip_weakening(1.0, 0.2, 0.02), cases.sawtooth(1.0, 0.03, 5.0, 0.5)):
        A_tilde, c = cases.half_laplacian(40)
        load = c * (1.0 + 0.3 * np.sin(np.pi * (np.arange(40) + 0.5) / 40))
        problem = ParametricProblem(A_tilde, np.zeros(40), load, c, law)
        path = follow(problem, np.zeros(40), 0.0, 0.0, 2.0)
        assert path.end == PathStatus.RANGE_END
        assert np.max(np.abs(path.u - path.u[:, ::-1])) <= 1e-11
        assert path.residual.max() <= 1e-11
        fold = np.vstack([np.eye(20), np.eye(20)[::-1]])
        half = ParametricProblem(fold.T @ A_tilde @ fold, np.zeros(20), fold.T @ problem.l_1, fold.T @ c, law)
        other = follow(half, np.zeros(20), 0.0, 0.0, 2.0)
        assert other.pieces == path.pieces
        assert other.t == pytest.approx(path.t, abs=1e-10)


def integer_law(rng: np.random.Generator) -> Laws:
    count = int(rng.integers(1, 5))
    kinks = np.sort(rng.choice(np.arange(-3, 4), count, replace=False)).astype(float)
    left, right = (rng.integers(-2, 3, count).astype(float) for _ in range(2))
    left[0], right[-1] = -abs(left[0]) - (left[0] == 0), abs(right[-1]) + (right[-1] == 0)
    ends = (float(rng.integers(0, 2)), float(rng.integers(0, 2)))
    return cases.linear_law("integers", list(kinks), list(left), list(right), ends)


def integer_problem(rng: np.random.Generator, m: int) -> ParametricProblem:
    """Small whole numbers everywhere: ties, starts on kinks, singular and flat pieces are the rule."""
    A_tilde = np.eye(m) * float(rng.integers(1, 4))
    if rng.random() < 0.7:
        A_tilde = A_tilde + 2 * np.eye(m) - np.eye(m, k=1) - np.eye(m, k=-1)
    elif rng.random() < 0.5:
        A_tilde = A_tilde + m * np.eye(m) - np.ones((m, m))
    l_0 = rng.integers(-1, 2, m) * float(rng.random() < 0.3)
    l_1 = np.ones(m) if rng.random() < 0.6 else rng.integers(1, 3, m).astype(float)
    return ParametricProblem(A_tilde, l_0, l_1, np.ones(m), integer_law(rng))


def test_integer_data_full_of_ties() -> None:
    """No stall, no cycle, an end with a reason, the inclusion at every vertex, stability by eigenvalues."""
    orderly = 0
    for seed in range(150):
        rng = np.random.default_rng([seed, 53])
        problem = integer_problem(rng, int(rng.integers(1, 6)))
        path = Follower(t_min=-9.0, t_max=9.0, max_pieces=2000).follow(problem, a_solution(problem, 0.0), 0.0)
        ends = {path.begin, path.end}
        assert not ends & {PathStatus.PIECE_LIMIT, PathStatus.LOST_ACCURACY, PathStatus.UNBOUNDED}
        orderly += ends <= {PathStatus.RANGE_END, PathStatus.CLOSED_LOOP}
        assert path.residual.max() <= 1e-12
        assert all(problem.at(t).inclusion_residual(u, 1e-13) <= 1e-12 for t, u in zip(path.t, path.u, strict=True))
        for codes, stable in zip(path.codes, path.stable, strict=True):
            free = codes % 2 == 0
            H = problem.A_tilde[np.ix_(free, free)] + np.diag(problem.law.q[codes[free] // 2])
            least = np.linalg.eigvalsh(H)[0] if free.any() else 1.0
            down = np.any(problem.law.kinds[codes[~free] // 2] < 0)
            if abs(least) > 1e-9:
                assert stable == (least > 0 and not down)
            else:
                assert not stable
    assert orderly >= 147


def test_a_flat_piece_is_followed_and_not_called_stable() -> None:
    """b falls exactly as fast as the spring pulls: along 0 < s < 1 t stands still at 1."""
    path = follow(one_node(cases.slip_weakening(1.0, 0.0, 1.0)), np.zeros(1), 0.0, -2.0, 2.0)
    assert path.t == pytest.approx([-2, -1, -1, 0, 1, 1, 2], abs=1e-15)
    assert path.u[:, 0] == pytest.approx([-2, -1, 0, 0, 0, 1, 2], abs=1e-15)
    assert list(path.stable) == [True, False, True, True, False, True]
    assert not len(path.folds)
    at = solutions_at(path, 1.0)
    assert [s.v[0] for s in at] == pytest.approx([0.0, 1.0], abs=1e-15)


@pytest.mark.parametrize("direction", ["both", "forward", "backward"])
def test_starts_on_every_vertex_of_a_path(direction: str) -> None:
    """Restarting exactly on a vertex (a node on a kink, some of them folds) gives the same set of vertices."""
    A_tilde, c = cases.half_laplacian(6)
    load = c * np.linspace(1.0, 1.6, 6)
    problem = ParametricProblem(A_tilde, np.zeros(6), load, c, cases.slip_weakening(1, 0.2, 0.2))
    path = follow(problem, np.zeros(6), 0.0, -2.0, 2.0)
    for k in range(1, path.pieces):
        again = Follower(t_min=-2.0, t_max=2.0).follow(problem, path.u[k], path.t[k], direction)  # type: ignore[arg-type]
        points = {tuple(np.round(u, 9)) for u in path.u}
        assert {tuple(np.round(u, 9) + 0.0) for u in again.u} <= {tuple(np.array(p) + 0.0) for p in points}
        if direction == "both":
            assert len(again.t) == len(path.t) - (k != path.start)  # that start is a vertex of its own
