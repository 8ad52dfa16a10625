"""The record of a body: what it holds, that it travels, and what it refuses."""

from __future__ import annotations

import pickle

import numpy as np
import pytest

from tcstudy.online import CondensedBody
from tcstudy.online.problems import prolonged, restricted
from tcstudy.solvers.problem import ContactProblem
from tcstudy.solvers.separable.newton import interpolation
from tcstudy.solvers.separable.newton import restricted as restricted_problem
from tests.solvers import contact_cases as cases


@pytest.mark.parametrize("m", [41, 44, 90])
def test_coarse_copies_are_galerkin(m: int) -> None:
    rng = np.random.default_rng(m)
    body = CondensedBody.of(*cases.random_stiffness(rng, m))
    P = interpolation(m)
    assert body.coarse is not None
    expected = restricted_problem(ContactProblem(body.A_tilde, np.zeros(m), body.c, cases.spring()), P)
    np.testing.assert_allclose(body.coarse.A_tilde, expected.A_tilde, rtol=1e-13)
    np.testing.assert_allclose(body.coarse.c, expected.c)
    rows = rng.normal(size=(3, m))
    np.testing.assert_allclose(restricted(rows), rows @ P.toarray(), rtol=1e-13, atol=1e-14)
    coarse = rng.normal(size=(3, P.shape[1]))
    np.testing.assert_allclose(prolonged(coarse, m), coarse @ P.toarray().T, rtol=1e-13, atol=1e-14)


def test_a_body_travels_and_holds_its_inverse() -> None:
    body = CondensedBody.of(*cases.half_laplacian(50))
    again = pickle.loads(pickle.dumps(body))
    assert np.array_equal(again.inverse, body.inverse)
    assert again.coarse is not None
    np.testing.assert_allclose(body.inverse @ body.A_tilde, np.eye(50), atol=1e-12)
    assert abs(body.lambda_1 / np.pi - 1.0) < 0.03


def test_a_body_that_moves_freely_is_refused() -> None:
    with pytest.raises(ValueError, match="clamp it"):
        CondensedBody.of(np.array([[1.0, -1.0], [-1.0, 1.0]]), np.ones(2))
