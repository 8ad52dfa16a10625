"""basis_inverse: lines, corrections and inertia against dense algebra through many changes."""

from __future__ import annotations

import numpy as np
import pytest

from tcstudy.contact.path.basis_inverse import BasisInverse, SingularCellError
from tests.contact import contact_cases as cases


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
        M, way = np.where(free, A + np.diag(k), np.eye(m)), basis.way
        exact = np.linalg.solve(M, load)
        assert way / way[m] == pytest.approx(np.append(exact, 1.0), rel=1e-9, abs=1e-11 * np.max(np.abs(exact)))
        defect = rng.normal(size=m)
        moved = basis.moved(defect)
        assert moved[basis.driver] == 0.0
        assert M @ moved[:m] - moved[m] * load == pytest.approx(defect, abs=1e-10)
        assert basis.negatives == np.count_nonzero(np.linalg.eigvalsh((A + np.diag(k))[np.ix_(free, free)]) < 0.0)


def test_a_singular_cell_has_a_line_with_t_at_rest_or_none() -> None:
    """H = [[2, −1], [−1, 2]] + diag(k): singular for k = −1 along (1, 1), along which the load pulls, or not."""
    A = np.array([[2.0, -1.0], [-1.0, 2.0]])
    free, k, pull = np.array([True, True]), np.array([-1.0, -1.0]), np.array([1.0, 1.0])
    assert BasisInverse(A, pull, free, k).way == pytest.approx([1.0, 1.0, 0.0], abs=1e-15)
    with pytest.raises(SingularCellError):
        BasisInverse(A, np.array([1.0, -1.0]), free, k)
    passing = BasisInverse(A, pull, free, np.zeros(2))
    passing.place(0, True, -1.0)
    passing.place(1, True, -1.0)
    assert passing.way / passing.way[0] == pytest.approx([1.0, 1.0, 0.0], abs=1e-15)
    passing.place(1, False, 0.0)
    assert passing.negatives == 0
