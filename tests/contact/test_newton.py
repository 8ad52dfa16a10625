"""Newton's equations of rows against dense solves: both sides, stacked or not, lifted exactly where they must be."""

from __future__ import annotations

import numpy as np
import pytest

from tcstudy.contact.certificates import definite
from tcstudy.contact.newton import directions
from tcstudy.contact.problem import CondensedBody
from tests.contact import contact_cases as cases


@pytest.mark.parametrize("m", [12, 70])
@pytest.mark.parametrize("loaded", [0.1, 0.9])
def test_directions_solve_the_equations_and_lift_falls_where_indefinite(m: int, loaded: float) -> None:
    rng = np.random.default_rng(m)
    body = CondensedBody.of(*cases.half_laplacian(m))
    shape = (60, m)
    free = rng.random(shape) < 0.8
    k = np.where(rng.random(shape) < loaded, rng.normal(scale=3.0, size=shape), 0.0) * body.c
    k *= np.where(rng.random(shape[0]) < 0.5, 30.0, 0.3)[:, None] * np.where(free, 1.0, 0.0)
    g = rng.normal(size=shape)
    d = directions(body, free, k, g, careful=True)
    lifted = 0
    for row in range(shape[0]):
        F = np.flatnonzero(free[row])
        H = body.A_tilde[np.ix_(F, F)]
        own = k[row, F]
        if np.linalg.eigvalsh(H + np.diag(own))[0] < 0.0:
            own, lifted = np.maximum(own, 0.0), lifted + 1
        expected = np.linalg.solve(H + np.diag(own), -g[row, F])
        np.testing.assert_allclose(d[row, F], expected, rtol=1e-7, atol=1e-9 * np.max(np.abs(expected)))
        assert np.all(d[row, ~free[row]] == 0.0)
    assert 0 < lifted < shape[0]


def test_shared_tests_of_definiteness_agree_with_eigenvalues() -> None:
    rng = np.random.default_rng(1)
    body = CondensedBody.of(*cases.half_laplacian(15))
    slope = rng.normal(size=(200, 15)) * rng.choice([0.5, 3.0, 10.0], 200)[:, None]
    slope[rng.random(200) < 0.1, 3] = -np.inf
    lowered = slope - body.shift
    expected = [
        np.all(np.isfinite(row)) and np.linalg.eigvalsh(body.A_tilde + np.diag(body.c * row))[0] > 0.0
        for row in lowered
    ]
    assert 0 < sum(expected) < 200
    assert np.array_equal(definite(body, slope), expected)
