"""tableau against dense algebra: directions, corrections and inertia through many changes of cell."""

from __future__ import annotations

import numpy as np
import pytest

from tcstudy.contact.path.dense import SingularCellError, positive_eigenvalues, sound_pivots
from tcstudy.contact.path.tableau import CAPACITY, Tableau
from tests.contact import contact_cases as cases


def dense(A: np.ndarray, free: np.ndarray, k: np.ndarray) -> np.ndarray:
    """Matrix of the moving coordinates: A's column plus k for a free node, a unit column for a held one."""
    return np.where(free[None, :], A + np.diag(k), np.eye(len(A)))


@pytest.mark.parametrize("seed", range(6))
def test_directions_and_inertia_after_random_changes(seed: int) -> None:
    rng = np.random.default_rng([seed, 61])
    m = 80
    A, _ = cases.half_laplacian(m)
    A = A / np.mean(np.diagonal(A))
    load = rng.normal(size=m)
    free = rng.random(m) < 0.3
    k = np.where(free, 0.1, 0.0)
    compliance = float(np.max(np.linalg.inv(A)))
    tableau = Tableau(A, load, compliance, free, k)
    for step in range(4 * CAPACITY):
        i = int(rng.integers(m))
        free[i] = not free[i] if rng.random() < 0.7 else free[i]
        k[i] = rng.choice([0.0, -0.2, 0.3]) if free[i] else 0.0
        tableau.change(i, bool(free[i]), float(k[i]))
        if step % 7:
            continue
        M = dense(A, free, k)
        dx, dt = tableau.direction(None, 1.0)
        exact = np.linalg.solve(M, load)
        assert dt == 1.0
        assert dx == pytest.approx(exact, rel=1e-8, abs=1e-9 * np.max(np.abs(exact)))
        node = int(np.argmax(np.abs(exact)))
        dx, dt = tableau.direction(node, -2.0)
        assert dx == pytest.approx(exact * (-2.0 / exact[node]), rel=1e-8, abs=1e-9)
        r = rng.normal(size=m)
        fixed, _ = tableau.direction(None, 0.0, r)
        assert fixed == pytest.approx(np.linalg.solve(M, r), rel=1e-7, abs=1e-8 * np.max(np.abs(exact)))
        held, shift = tableau.direction(node, 0.0, r)
        assert held[node] == pytest.approx(0.0, abs=1e-10)
        assert M @ held - shift * load == pytest.approx(r, abs=1e-7)
        H = (A + np.diag(k))[np.ix_(free, free)]
        assert tableau.negatives() == np.count_nonzero(np.linalg.eigvalsh(H) < 0.0)
    assert tableau.factorisations < 5


def test_a_singular_cell_has_a_direction_with_t_at_rest_or_none() -> None:
    """H = [[2, −1], [−1, 2]] + diag(k): singular for k = −1 along (1, 1), along which the load pulls, or not."""
    A = np.array([[2.0, -1.0], [-1.0, 2.0]])
    free = np.array([True, True])
    k = np.array([-1.0, -1.0])
    dx, dt = Tableau(A, np.array([1.0, 1.0]), 0.7, free, k).direction(0, 1.0)
    assert dt == pytest.approx(0.0, abs=1e-15)
    assert dx == pytest.approx([1.0, 1.0], abs=1e-15)
    with pytest.raises(SingularCellError):
        Tableau(A, np.array([1.0, -1.0]), 0.7, free, k).direction(0, 1.0)


def test_unsound_pivots_are_left_out() -> None:
    matrix = np.array([[1.0, 1.0, 0.0], [1.0, 1.0 + 1e-9, 0.0], [0.0, 0.0, -2.0]])
    assert sorted(sound_pivots(matrix, np.abs(np.diagonal(matrix)))) in ([0, 2], [1, 2])


def test_inertia_is_that_of_the_eigenvalues() -> None:
    rng = np.random.default_rng(3)
    for n in (1, 2, 7, 30):
        for _ in range(20):
            half = rng.normal(size=(n, n)) * (rng.random((n, n)) < 0.6)
            matrix = half + half.T
            matrix[np.diag_indices(n)] *= rng.random() < 0.5  # zeros there ask for blocks of two
            exact = np.linalg.eigvalsh(matrix)
            if np.min(np.abs(exact)) > 1e-9:
                assert positive_eigenvalues(matrix) == np.count_nonzero(exact > 0.0)
