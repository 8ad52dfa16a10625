"""The rule that says which inclusion residual makes a solution."""

import numpy as np
import pytest

from tcstudy.contact.problem import ContactProblem
from tcstudy.contact.solution import MAX_ROUNDING, Acceptance
from tcstudy.laws.shapes import tresca
from tcstudy.scene.solver_plan import TOLERANCE


@pytest.mark.parametrize(
    ("tolerance", "rounding", "limit", "residual", "accepted"),
    [
        (None, 1e-13, TOLERANCE, 1e-11, True),
        (None, 4e-9, 4e-9, 1e-9, True),
        (None, 4e-9, 4e-9, 5e-9, False),
        (None, 4e-9, 4e-9, float("nan"), False),
        (None, 0.5, MAX_ROUNDING, 0.1, False),  # friction that rounding has lost is no solution
        (1e-10, 4e-9, 1e-10, 1e-9, False),  # a tolerance that a study writes is strict
    ],
)
def test_the_default_goes_as_far_as_rounding_and_a_written_tolerance_no_further(
    tolerance: float | None, rounding: float, limit: float, residual: float, accepted: bool
) -> None:
    rule = Acceptance(tolerance)
    assert (rule.limit(rounding), rule.aim) == (limit, TOLERANCE)
    assert rule.accepts(residual, rounding) == accepted


def test_rounding_has_no_unit() -> None:
    rng = np.random.default_rng(1)
    A, load, v = np.eye(4) + 0.1, rng.normal(size=4), rng.normal(size=4)
    problem = ContactProblem(A, load, np.ones(4), tresca(0.5))
    scaled = ContactProblem(A * 1e20, load * 1e20, np.ones(4), tresca(0.5e20))
    assert scaled.xi_rounding(v) == pytest.approx(problem.xi_rounding(v), rel=1e-12)
