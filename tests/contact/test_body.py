"""The record of a body: what it holds, that it travels, and what it refuses."""

from __future__ import annotations

import numpy as np
import pytest

from tcstudy.contact.problem import CondensedBody
from tests.contact import contact_cases as cases


@pytest.mark.parametrize("m", [41, 44, 90])
def test_coarse_copies_are_galerkin(m: int) -> None:
    rng = np.random.default_rng(m)
    body = CondensedBody.of(*cases.random_stiffness(rng, m))
    P = body.P.toarray()
    assert body.coarse is not None
    np.testing.assert_allclose(body.coarse.A_tilde, P.T @ body.A_tilde @ P, rtol=1e-13)
    np.testing.assert_allclose(body.coarse.c, body.c @ P)


def test_a_body_that_moves_freely_is_refused() -> None:
    with pytest.raises(ValueError, match="clamp it"):
        CondensedBody.of(np.array([[1.0, -1.0], [-1.0, 1.0]]), np.ones(2))
