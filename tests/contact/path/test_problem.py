"""smooth: the stated interpolation error, exact kinks and symmetry, and Newton back onto the true law."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import brentq

from tcstudy.contact.path.piecewise_linear_approximation import piecewise_linear
from tcstudy.contact.path.query import solutions_of
from tcstudy.laws.shapes import SHAPES
from tests.contact import contact_cases as cases
from tests.contact.path.cases import follow, one_node


@pytest.mark.parametrize("tolerance", [1e-1, 1e-2, 1e-4])
def test_error_bound_and_its_sharpness(tolerance: float) -> None:
    law = SHAPES["exponential"].build(a=2.0, b=0.5, delta=0.3)
    approximation = piecewise_linear(law, tolerance, 4.0)
    s = np.linspace(-4.0, 4.0, 400_001)
    error = np.max(np.abs(approximation.b(s) - law.b(s)))
    assert error <= tolerance * law.b_scale * (1 + 1e-9)
    assert error >= 0.4 * tolerance * law.b_scale
    assert np.array_equal(approximation.kinks, -approximation.kinks[::-1])
    assert approximation.b_right == pytest.approx(-approximation.b_left[::-1], abs=1e-15)
    assert np.count_nonzero(approximation.kinds) == 1


@pytest.mark.parametrize("tolerance", [1e-2, 1e-4, 1e-6])
def test_no_more_sides_than_the_error_needs(tolerance: float) -> None:
    """∫√(|b″|/(16 E)) sides in the limit of many, with E the error; two more for the ends that stay on the curve."""
    law = SHAPES["exponential"].build(a=2.0, b=0.5, delta=0.3)
    sides = np.count_nonzero(piecewise_linear(law, tolerance, 40.0).kinks > 0.0)
    part, error = 1.5, tolerance * law.b_scale
    least = 2.0 * (np.sqrt(part / (16.0 * error)) - np.sqrt(2.0 / 16.0))
    assert least - 1 <= sides <= least + 3


def test_random_laws_keep_kinks_and_error() -> None:
    for seed in range(20):
        rng = np.random.default_rng([seed, 83])
        law = cases.random_law(rng, 3.0, 6, smooth=True)
        reach = 1.5 * float(np.max(np.abs(law.kinks))) + 1.0
        approximation = piecewise_linear(law, 1e-3, reach)
        assert set(law.kinks) <= set(approximation.kinks)
        assert approximation.piecewise_linear
        s = np.linspace(-reach, reach, 20_001)
        assert np.max(np.abs(approximation.b(s) - law.b(s))) <= 1.001e-3 * law.b_scale


def test_bad_tolerance_is_named_and_linear_laws_pass_through() -> None:
    law = cases.slip_weakening()
    assert piecewise_linear(law, 1e-3, 1.0) is law
    with pytest.raises(ValueError, match="must be positive"):
        piecewise_linear(cases.exponential_decay(), 0.0, 1.0)


def test_all_three_solutions_of_an_exponential_law() -> None:
    """s + 0.2 + 0.8 exp(−5 s) = t has two roots with s > 0 beside sticking between the fold and t = 1."""
    law = cases.exponential_decay(1.0, 0.2, 0.2)
    problem = one_node(piecewise_linear(law, 1e-3, 3.0))
    path = follow(problem, np.zeros(1), 0.0, 0.0, 2.0)
    t = 0.8
    found = solutions_of(law, path, t)
    assert [s.stable for s in found] == [True, False, True]
    assert max(s.residual for s in found) <= 1e-14
    g = lambda s: s + 0.2 + 0.8 * np.exp(-5 * s) - t  # noqa: E731
    roots = [brentq(g, *ends, xtol=1e-15) for ends in ((0.0, np.log(4.0) / 5), (np.log(4.0) / 5, 1.0))]
    assert [float(s.v[0]) for s in found] == pytest.approx([0.0, *roots], abs=1e-13)
