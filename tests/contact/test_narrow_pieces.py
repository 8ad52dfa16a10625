"""Laws with pieces a few roundings wide: nodes come to rest on them, and the law that is judged is the one given."""

from __future__ import annotations

import numpy as np
import pytest

from tcstudy.contact.certificates import certify
from tcstudy.contact.problem import ContactProblem, Status
from tcstudy.contact.solve import solve_contact
from tcstudy.laws.pieces import DOWN, UP
from tcstudy.laws.shapes import piecewise_linear
from tests.contact import contact_cases as cases


@pytest.mark.parametrize("width", [6e-17, 1e-13, 1e-8])
def test_nodes_rest_on_a_narrow_rise(width: float) -> None:
    """From one rounding of 0.3 on."""
    law = piecewise_linear([(0.0, 0.5), (0.3, 0.5), (0.3 + width, 0.8), (1.0, 1.0)], True, None, None)
    A_tilde, c = cases.half_laplacian(20)
    problem = ContactProblem(A_tilde, c * np.linspace(0.4, 3.0, 20), c, law)
    answer = solve_contact(problem)
    assert answer.status == Status.CONVERGED
    assert answer.inclusion_residual <= 1e-10
    within = (answer.v >= 0.3) & (answer.v <= 0.3 + width)
    assert np.any(within)
    traction = answer.xi[within] / c[within]
    assert np.all((traction > 0.5) & (traction < 0.8))
    assert certify(problem, answer.v, tolerance=1.0).unique


def test_narrow_pieces_become_jumps_and_odd_laws_stay_odd() -> None:
    rise, fall = float(np.nextafter(0.3, 1.0)), float(np.nextafter(0.7, 1.0))
    points = [(0.0, 0.5), (0.3, 0.5), (rise, 0.8), (0.7, 0.8), (fall, 0.2), (1.0, 0.2)]
    law = piecewise_linear(points, True, None, None)
    other = law.without_narrow_pieces
    assert other.kinks.tolist() == [-0.7, -0.3, 0.0, 0.3, 0.7]
    assert other.kinds.tolist() == [DOWN, UP, UP, UP, DOWN]
    s = np.random.default_rng(3).uniform(0.0, 1.5, 300)
    assert np.array_equal(other.b(s), -other.b(-s))
    assert np.array_equal(other.b(s), law.b(s))
