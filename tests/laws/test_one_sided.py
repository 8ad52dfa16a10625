"""Laws of an opening: a ray for non-penetration, or a closing that gives way."""

import numpy as np
import pytest

from tcstudy.laws.composed import (
    EdgeLaws,
    Joints,
    law_along,
    law_slopes,
    nodal,
    piecewise_linear,
    total,
)
from tcstudy.laws.laws import NONE, Laws
from tcstudy.laws.pieces import UP, GrowthError
from tcstudy.laws.shapes import SHAPES, LawError, one_sided, unilateral

BILINEAR = SHAPES["bilinear"].build(tau=20.0, s0=0.004, sf=0.014)
BOND = one_sided(BILINEAR)
LAYER = one_sided(BILINEAR, 3e3)
DECAY = one_sided(SHAPES["exponential"].build(a=2.0, b=0.5, delta=0.1))
OPEN = np.array([1e-9, 0.002, 0.004, 0.01, 0.02])


def test_an_opening_has_the_law_of_the_slip_and_no_penetration() -> None:
    for law, base in (
        (BOND, BILINEAR),
        (DECAY, SHAPES["exponential"].build(a=2.0, b=0.5, delta=0.1)),
    ):
        np.testing.assert_array_equal(law.b(OPEN), base.b(OPEN))
        np.testing.assert_allclose(law.j(OPEN), base.j(OPEN), rtol=1e-14)
        low, high = law.interval(np.array([0.0, 0.002]))
        assert low[0] == -np.inf
        assert high[0] == base.b(0.0)
        assert low[1] == high[1] == base.b(0.002)
        assert law.j(np.array([-1e-300]))[0] == np.inf
        assert law.kinds[0] == UP
        assert law.closed


def test_no_scale_slope_or_growth_knows_the_ray() -> None:
    assert BOND.b_scale == 20.0
    assert BOND.omega == BILINEAR.omega
    assert unilateral().b_scale == 0.0
    assert unilateral().omega == 0.0
    assert not unilateral().vanishes
    np.testing.assert_array_equal(BOND.terms(np.zeros(1), BOND.piece(np.zeros(1), -1)), [0.0])
    for law in (BOND, DECAY, LAYER, unilateral(), one_sided(NONE, 5.0)):
        law.check_growth()
    falling = one_sided(SHAPES["piecewise-linear"].builder([(0.0, 1.0)], True, -1.0, None))
    with pytest.raises(GrowthError, match="∞"):
        falling.check_growth()


def test_a_closing_gives_way_by_its_stiffness() -> None:
    np.testing.assert_allclose(LAYER.b(np.array([-0.01, 0.002])), [-30.0, 10.0])
    np.testing.assert_allclose(LAYER.j(np.array([-0.01])), 0.5 * 3e3 * 0.01**2)
    base = one_sided(NONE, 5.0)
    np.testing.assert_allclose(base.b(np.array([-2.0, 1.0])), [-10.0, 0.0])
    for wrong in (0.0, -1.0, np.nan):
        with pytest.raises(LawError, match="closing"):
            one_sided(BILINEAR, wrong)


def test_a_strength_is_of_the_bond_and_not_of_what_closes_it() -> None:
    laws = nodal([BOND, LAYER, NONE], [0, 0, 1, 1, 2], [0.5, 0.0, 0.5, 0.0, 1.0])
    np.testing.assert_allclose(laws.b(np.full(5, 0.004), -1), [10.0, 0.0, 10.0, 0.0, 0.0])
    np.testing.assert_allclose(laws.b(np.full(5, -0.01)), [-np.inf, -np.inf, -30.0, -30.0, 0.0])
    assert BOND.times(0.0).closed
    assert LAYER.times(0.0).b(-1.0) == -3e3
    half = BOND.times(0.5)
    assert half.made is not None
    assert (half.made.strength, half.made.closing) == (0.5, np.inf)


def test_the_sum_of_a_ray_and_a_law_is_a_ray() -> None:
    for both in (total(BOND, BILINEAR), total(BILINEAR, BOND), total(BOND, unilateral())):
        assert both.closed
        assert both.kinks[0] == 0.0
        assert both.j(np.array([-0.1]))[0] == np.inf
    np.testing.assert_allclose(total(BOND, BILINEAR).b(OPEN), 2.0 * BILINEAR.b(OPEN))
    assert not total(LAYER, BILINEAR).closed
    np.testing.assert_allclose(total(LAYER, LAYER).b(np.array([-0.01])), -60.0)


def test_laws_with_and_without_rays_share_a_table() -> None:
    laws = Laws.of([BILINEAR, BOND, unilateral()], [0, 1, 2, 1])
    np.testing.assert_array_equal(laws.closed, [False, True, True])
    np.testing.assert_array_equal(laws.admissible(np.full(4, -1.0)), [-1.0, 0.0, 0.0, 0.0])
    np.testing.assert_allclose(laws.j(np.full(4, 0.01)), [0.124, 0.124, 0.0, 0.124])
    np.testing.assert_array_equal(laws.scales, [20.0, 20.0, 0.0])
    assert laws.laws[1] == BOND != LAYER


def test_straight_pieces_keep_the_ray() -> None:
    polygon = piecewise_linear(DECAY, 1e-3, 1.0)
    s = np.linspace(0.0, 1.0, 400)
    assert polygon.closed
    assert polygon.closing == np.inf
    np.testing.assert_allclose(polygon.b(s), DECAY.b(s), atol=2.1e-3)


def test_derivatives_of_one_sided_laws_are_those_of_differences() -> None:
    s = np.array([0.002, 0.01, -0.001])

    def built(tau: float, closing: float) -> Laws:
        base = SHAPES["bilinear"].build(tau=tau, s0=0.004, sf=0.014)
        return one_sided(base, closing)

    by_tau = law_slopes(LAYER, "tau").value(s, LAYER.piece(s))
    by_closing = law_slopes(LAYER, "closing").value(s, LAYER.piece(s))
    h = 1e-3
    np.testing.assert_allclose(
        by_tau, (built(20.0 + h, 3e3).b(s) - built(20.0 - h, 3e3).b(s)) / (2 * h), atol=1e-9
    )
    np.testing.assert_allclose(
        by_closing, (built(20.0, 3e3 + h).b(s) - built(20.0, 3e3 - h).b(s)) / (2 * h), atol=1e-9
    )
    assert np.all(np.isfinite(law_slopes(BOND, "strength").value(s[:2], BOND.piece(s[:2]))))
    with pytest.raises(KeyError):
        law_slopes(BOND, "closing")


def test_what_closes_a_joint_has_its_share_of_the_cell() -> None:
    """Of two layers with 3 and 6 kPa/m, a quarter of the cell on the first, which is unbonded."""
    stiff = one_sided(BILINEAR, 6e3)
    edges = EdgeLaws((("left", LAYER, 0.0), ("right", stiff, 1.0)))
    joints = Joints(np.array([1]), np.array([0]), np.array([0.25]))
    edge, xy = np.array([0, 1, 1]), np.zeros((3, 2))
    laws = law_along(edges, ("left", "right"), edge, xy, joints)
    np.testing.assert_allclose(laws.b(np.full(3, -0.01)), [-30.0, -52.5, -60.0])
    np.testing.assert_allclose(laws.b(np.full(3, 0.002)), [0.0, 7.5, 10.0])
