"""cell: the kept inverse against dense algebra through many changes, and exact segments against enumeration."""

from __future__ import annotations

from itertools import product

import numpy as np
import pytest

from tcstudy.contact.path.cell import BasisInverse, Found, segments
from tcstudy.contact.path.dense import SingularCellError, positive_eigenvalues
from tcstudy.contact.path.follow import ParametricProblem
from tests.contact import contact_cases as cases
from tests.contact.path.cases import a_solution, all_solutions, follow, random_path_problem


def dense(A: np.ndarray, free: np.ndarray, k: np.ndarray) -> np.ndarray:
    """Matrix of the moving coordinates: A's column plus k for a free node, a unit column for a held one."""
    return np.where(free[None, :], A + np.diag(k), np.eye(len(A)))


@pytest.mark.parametrize("seed", range(4))
def test_lines_corrections_and_inertia_after_random_changes(seed: int) -> None:
    rng, m = np.random.default_rng([seed, 61]), 80
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
            basis.reload(load)
        if step % 5:
            continue
        M, way = dense(A, free, k), basis.way
        exact = np.linalg.solve(M, load) / basis.load_size
        assert way / way[m] == pytest.approx(np.append(exact, 1.0), rel=1e-9, abs=1e-11 * np.max(np.abs(exact)))
        defect = rng.normal(size=m)
        moved = basis.correction(defect)
        assert moved[basis.driver] == 0.0
        assert M @ moved[:m] - moved[m] * load / basis.load_size == pytest.approx(defect, abs=1e-10)
        assert basis.negatives == np.count_nonzero(np.linalg.eigvalsh((A + np.diag(k))[np.ix_(free, free)]) < 0.0)
    assert basis.factorisations == 1


def test_a_singular_cell_has_a_line_with_t_at_rest_or_none() -> None:
    """H = [[2, −1], [−1, 2]] + diag(k): singular for k = −1 along (1, 1), along which the load pulls, or not."""
    A = np.array([[2.0, -1.0], [-1.0, 2.0]])
    free, k = np.array([True, True]), np.array([-1.0, -1.0])
    assert BasisInverse(A, np.array([1.0, 1.0]), free, k).way == pytest.approx([1.0, 1.0, 0.0], abs=1e-15)
    with pytest.raises(SingularCellError):
        BasisInverse(A, np.array([1.0, -1.0]), free, k)
    passing = BasisInverse(A, np.array([1.0, 1.0]), free, np.zeros(2))
    passing.place(0, True, -1.0)
    passing.place(1, True, -1.0)
    assert passing.way / passing.way[0] == pytest.approx([1.0, 1.0, 0.0], abs=1e-15)
    passing.place(1, False, 0.0)
    assert passing.negatives == 0


def test_inertia_is_that_of_the_eigenvalues() -> None:
    rng = np.random.default_rng(3)
    for n in (0, 1, 2, 7, 30):
        for _ in range(20):
            half = rng.normal(size=(n, n)) * (rng.random((n, n)) < 0.6)
            matrix = half + half.T
            matrix[np.diag_indices(n)] *= rng.random() < 0.5  # zeros there ask for blocks of two
            exact = np.linalg.eigvalsh(matrix)
            if np.min(np.abs(exact), initial=1.0) > 1e-9:
                assert positive_eigenvalues(matrix) == np.count_nonzero(exact > 0.0)


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


def test_segments_are_the_pieces_of_the_path_and_lead_to_the_next_one() -> None:
    problem = random_path_problem(np.random.default_rng([3, 41]), 20, 12)
    path = follow(problem, a_solution(problem, 0.0), 0.0, -3.0, 3.0)
    found, graph = segments(problem, path.codes, -3.0, 3.0), problem.graph
    assert np.all(found.found == Found.ONE)
    for k in range(path.pieces - 1):
        if k in (path.start - 1, path.start):
            continue
        end = int(np.argmin([np.max(np.abs(u - path.u[k + 1])) for u in found.u[k]]))
        assert found.u[k, end] == pytest.approx(path.u[k + 1], abs=1e-10)
        assert found.t[k, end] == pytest.approx(path.t[k + 1], abs=1e-10)
        node, after = int(found.node[k, end]), graph.after_high if found.upper[k, end] else graph.after_low
        assert after[path.codes[k, node]] == path.codes[k + 1, node]


def test_a_corner_within_rounding_and_a_lost_rank_are_left_undecided() -> None:
    """Two equal springs under equal loads let go together; of a cell beside that vertex nothing is claimed."""
    law = cases.slip_weakening(1.0, 0.2, 0.4)
    problem = ParametricProblem(np.eye(2), np.zeros(2), np.ones(2), np.ones(2), law)
    codes = np.array([[3, 3], [3, 4], [4, 4]])
    assert list(segments(problem, codes, -0.5, 0.5).found) == [Found.ONE, Found.NONE, Found.NONE]
    assert list(segments(problem, codes, 0.0, 2.0).found) == [Found.UNDECIDED] * 3
