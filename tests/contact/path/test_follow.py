"""Paths: lost accuracy, reasons for the end, loops, ties; lines and inertia against dense
algebra."""

from dataclasses import replace

import numpy as np
import pytest

from tcstudy.contact.path.basis_inverse import CAPACITY, BasisInverse, SingularCellError
from tcstudy.contact.path.follow import Follower, ParametricProblem, PathStatus
from tcstudy.contact.path.query import solutions_at
from tcstudy.contact.path.walk import NoSolutionError
from tests.contact import contact_cases as cases
from tests.contact.path.cases import a_solution, follow, one_node, softening_line


def test_lost_accuracy_is_noticed_and_repaired(monkeypatch: pytest.MonkeyPatch) -> None:
    """The inverse is spoilt by a relative error now and then; residuals and path stay where they
    were."""
    problem = softening_line(60, 0.01)
    exact = follow(problem, np.zeros(60), 0.0, 0.0, 3.0)
    assert exact.pieces > 2 * 60
    assert len(exact.folds) > 20
    room, rng = BasisInverse._next_change, np.random.default_rng(0)

    def spoilt(self: BasisInverse) -> int:
        full, at = self.size == CAPACITY, room(self)
        if full:
            self.T *= 1.0 + 1e-6 * rng.normal(size=self.T.shape)
        return at

    monkeypatch.setattr(BasisInverse, "_next_change", spoilt)
    path = follow(problem, np.zeros(60), 0.0, 0.0, 3.0)
    assert path.end == PathStatus.RANGE_END
    assert path.residual.max() <= 1e-11
    assert path.pieces == exact.pieces
    assert np.max(np.abs(path.u - exact.u)) <= 1e-9


def test_a_node_at_rest_near_its_bound_costs_no_factorisation(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Of uncoupled nodes five slip one after the other, while the load leaves the last two as they
    are.

    These two are nearer to sliding than a tie, which is wide as one stiffness is small.
    """
    stiffness = np.array([1.0, 1.0, 1.0, 1.0, 1.0, 1e-5, 1.0])
    l_0 = np.array([0.0, 0.0, 0.0, 0.0, 0.0, 1.0 - 1e-10, 1.0 - 3e-10])
    # two nodes within what a tie is looked at again for make every vertex a possible tie
    l_1 = np.array([1.0, 0.9, 0.8, 0.7, 0.6, 0.0, 0.0])
    law = cases.linear_law("tresca", [0.0], [-1.0], [1.0], (0.0, 0.0))
    problem = ParametricProblem(np.diag(stiffness), l_0, l_1, np.ones(7), law)
    refactor = BasisInverse.refactor
    factorisations = []

    def counted(self: BasisInverse) -> None:
        factorisations.append(self)
        refactor(self)

    monkeypatch.setattr(BasisInverse, "refactor", counted)
    path = Follower(t_min=0.0, t_max=2.0).follow(problem, np.zeros(7), 0.0, "forward")
    assert path.end == PathStatus.RANGE_END
    assert path.t == pytest.approx([0.0, *1.0 / l_1[:5], 2.0], rel=1e-14)
    assert not path.u[:, 5:].any()
    assert path.residual[1:].max() <= 1e-14  # at the start itself they are put on their bounds
    assert len(factorisations) == 1


def test_reasons_for_the_end() -> None:
    problem, zero = softening_line(20, 0.02), np.zeros(20)
    short = Follower(max_pieces=5).follow(problem, zero, 0.0)
    assert (short.end, short.pieces) == (PathStatus.PIECE_LIMIT, 10)
    free = follow(problem, zero, 0.0)
    assert free.begin == free.end == PathStatus.UNBOUNDED
    branch = Follower(stable_only=True).follow(problem, zero, 0.0, "forward")
    assert (branch.begin, branch.end) == (PathStatus.START, PathStatus.UNSTABLE)
    assert branch.stable.tolist() == [True] * (branch.pieces - 1) + [False]
    hopeless = Follower(tolerance=1e-20).follow(problem, zero, 0.0, "forward")
    assert hopeless.end == PathStatus.LOST_ACCURACY
    assert "tolerance" in hopeless.end.reason
    assert len(hopeless.t) == len(hopeless.residual) == hopeless.pieces + 1


@pytest.mark.parametrize("seed", [249, 386])
def test_a_closed_loop_is_recognised(seed: int) -> None:
    """The start lies on an isolated loop: the path returns to it exactly, from either side."""
    rng = np.random.default_rng(seed)
    p = cases.random_problem(rng, int(rng.integers(1, 4)), max_kinks=6)
    problem = ParametricProblem(
        p.A_tilde, rng.normal(size=p.m) * p.l_tilde * 0.3, p.l_tilde, p.c, p.law
    )
    v = a_solution(problem, 0.0)
    path = follow(problem, v, 0.0, -3.0, 3.0)
    assert path.begin == path.end == PathStatus.CLOSED_LOOP
    assert path.t[0] == path.t[-1]
    assert np.max(np.abs(path.u[0] - path.u[-1])) <= 1e-12
    assert len(path.folds) >= 2
    assert Follower(t_min=-3.0, t_max=3.0).follow(problem, v, 0.0, "backward").pieces == path.pieces


def test_bad_input_is_named() -> None:
    problem = softening_line(5)
    with pytest.raises(NoSolutionError, match="no solution at t = 3"):
        follow(problem, np.zeros(5), 3.0)
    with pytest.raises(ValueError, match="outside the range"):
        follow(problem, np.zeros(5), 3.0, 0.0, 1.0)
    for bad, said in (
        (problem.with_law(cases.exponential_decay()), "piecewise linear"),
        (replace(problem, A_tilde=-problem.A_tilde), "not positive definite"),
        (replace(problem, l_1=0 * problem.l_1), "l_1 is zero"),
    ):
        with pytest.raises(ValueError, match=said):
            follow(bad, np.zeros(5), 0.0)


def test_a_start_at_the_end_of_the_range_is_one_solution() -> None:
    problem = softening_line(5)
    for low, high in ((0.0, 1.0), (-1.0, 0.0)):
        path = follow(problem, np.zeros(5), 0.0, low, high)
        assert (path.begin, path.end) == (PathStatus.RANGE_END, PathStatus.RANGE_END)
        assert np.all(np.diff(path.t) > 0.0)
        assert len(solutions_at(path, 0.0)) == 1


def integer_problem(rng: np.random.Generator, m: int) -> ParametricProblem:
    """Small whole numbers everywhere: ties, starts on kinks, singular and flat pieces are the
    rule."""
    A_tilde = np.eye(m) * float(rng.integers(1, 4))
    if rng.random() < 0.7:
        A_tilde = A_tilde + 2 * np.eye(m) - np.eye(m, k=1) - np.eye(m, k=-1)
    elif rng.random() < 0.5:
        A_tilde = A_tilde + m * np.eye(m) - np.ones((m, m))
    l_0 = rng.integers(-1, 2, m) * float(rng.random() < 0.3)
    l_1 = np.ones(m) if rng.random() < 0.6 else rng.integers(1, 3, m).astype(float)
    count = int(rng.integers(1, 5))
    kinks = np.sort(rng.choice(np.arange(-3, 4), count, replace=False)).astype(float)
    left, right = (rng.integers(-2, 3, count).astype(float) for _ in range(2))
    left[0], right[-1] = -abs(left[0]) - (left[0] == 0), abs(right[-1]) + (right[-1] == 0)
    ends = (float(rng.integers(0, 2)), float(rng.integers(0, 2)))
    law = cases.linear_law("integers", list(kinks), list(left), list(right), ends)
    return ParametricProblem(A_tilde, l_0, l_1, np.ones(m), law)


def test_integer_data_full_of_ties() -> None:
    """No stall, no cycle, an end with a reason, the inclusion at every vertex, stability by
    eigenvalues."""
    orderly = 0
    for seed in range(100):
        rng = np.random.default_rng([seed, 53])
        problem = integer_problem(rng, int(rng.integers(1, 6)))
        path = Follower(t_min=-9.0, t_max=9.0, max_pieces=2000).follow(
            problem, a_solution(problem, 0.0), 0.0
        )
        ends = {path.begin, path.end}
        assert not ends & {PathStatus.PIECE_LIMIT, PathStatus.LOST_ACCURACY, PathStatus.UNBOUNDED}
        orderly += ends <= {PathStatus.RANGE_END, PathStatus.CLOSED_LOOP}
        assert path.residual.max() <= 1e-12
        assert all(
            problem.at(t).inclusion_residual(u, 1e-13) <= 1e-12
            for t, u in zip(path.t, path.u, strict=True)
        )
        for codes, stable in zip(path.codes, path.stable, strict=True):
            free = codes % 2 == 0
            H = problem.A_tilde[np.ix_(free, free)] + np.diag(problem.law.q[codes[free] // 2])
            least = np.linalg.eigvalsh(H)[0] if free.any() else 1.0
            down = np.any(problem.law.kinds[codes[~free] // 2] < 0)
            assert stable == (least > 1e-9 and not down)
    assert orderly >= 97


def test_a_flat_piece_is_followed_and_not_called_stable() -> None:
    """b falls exactly as fast as the spring pulls: along 0 < s < 1 t stands still at 1."""
    path = follow(one_node(cases.slip_weakening(1.0, 0.0, 1.0)), np.zeros(1), 0.0, -2.0, 2.0)
    assert path.t == pytest.approx([-2, -1, -1, 0, 1, 1, 2], abs=1e-15)
    assert path.u[:, 0] == pytest.approx([-2, -1, 0, 0, 0, 1, 2], abs=1e-15)
    assert list(path.stable) == [True, False, True, True, False, True]
    assert not len(path.folds)
    assert [s.v[0] for s in solutions_at(path, 1.0)] == pytest.approx([0.0, 1.0], abs=1e-15)


@pytest.mark.parametrize("direction", ["both", "forward", "backward"])
def test_starts_on_every_vertex_of_a_path(direction: str) -> None:
    """Restarting exactly on a vertex (a node on a kink, some of them folds) gives the same set of
    vertices."""
    A_tilde, c = cases.half_laplacian(6)
    law = cases.slip_weakening(1, 0.2, 0.2)
    problem = ParametricProblem(A_tilde, np.zeros(6), c * np.linspace(1.0, 1.6, 6), c, law)
    path = follow(problem, np.zeros(6), 0.0, -2.0, 2.0)
    points = {tuple(np.round(u, 9) + 0.0) for u in path.u}
    for k in range(1, path.pieces):
        again = Follower(t_min=-2.0, t_max=2.0).follow(problem, path.u[k], path.t[k], direction)  # type: ignore[arg-type]
        assert {tuple(np.round(u, 9) + 0.0) for u in again.u} <= points
        if direction == "both":
            assert len(again.t) == len(path.t) - (
                k != path.start
            )  # that start is a vertex of its own


def test_lines_corrections_and_inertia_after_random_changes() -> None:
    rng, m = np.random.default_rng([1, 61]), 80
    A, _ = cases.half_laplacian(m)
    A = A / np.mean(np.diagonal(A))
    load, free = rng.normal(size=m), rng.random(m) < 0.3
    k = np.where(free, 0.1, 0.0)
    basis = BasisInverse(A, load, free, k)
    for step in range(150):
        i = int(rng.integers(m))
        free[i] = not free[i] if rng.random() < 0.7 else free[i]
        k[i] = rng.choice([0.0, -0.2, 0.3]) if free[i] else 0.0
        basis.place(i, bool(free[i]), float(k[i]))
        if step == 100:
            load = rng.normal(size=m)
            basis.load, basis.stale = load, True
            basis.settle()
        if step % 5:
            continue
        M = np.where(free, A + np.diag(k), np.eye(m))
        direction = basis.direction
        exact = np.linalg.solve(M, load)
        assert direction / direction[m] == pytest.approx(
            np.append(exact, 1.0), rel=1e-9, abs=1e-11 * np.max(np.abs(exact))
        )
        defect = rng.normal(size=m)
        moved = basis.correction(defect)
        assert moved[basis.driver] == 0.0
        assert M @ moved[:m] - moved[m] * load == pytest.approx(defect, abs=1e-10)
        assert basis.negatives == np.count_nonzero(
            np.linalg.eigvalsh((A + np.diag(k))[np.ix_(free, free)]) < 0.0
        )


def test_a_singular_cell_has_a_line_with_t_at_rest_or_none() -> None:
    """H = [[2, −1], [−1, 2]] + diag(k): singular for k = −1 along (1, 1), along which the load
    pulls, or not."""
    A = np.array([[2.0, -1.0], [-1.0, 2.0]])
    free, k, pull = np.array([True, True]), np.array([-1.0, -1.0]), np.array([1.0, 1.0])
    assert BasisInverse(A, pull, free, k).direction == pytest.approx([1.0, 1.0, 0.0], abs=1e-15)
    with pytest.raises(SingularCellError):
        BasisInverse(A, np.array([1.0, -1.0]), free, k)
    passing = BasisInverse(A, pull, free, np.zeros(2))
    passing.place(0, True, -1.0)
    passing.place(1, True, -1.0)
    assert passing.direction / passing.direction[0] == pytest.approx([1.0, 1.0, 0.0], abs=1e-15)
    passing.place(1, False, 0.0)
    assert passing.negatives == 0
