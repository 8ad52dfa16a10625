"""Laws by node, row and edge, what meets at a joint, and straight pieces away from 0."""

import numpy as np
import pytest

from tcstudy.laws.composed import (
    EdgeLaws,
    Joints,
    _equal,
    _march,
    law_along,
    laws_along,
    nodal,
    piecewise_linear,
    row_laws,
    total,
)
from tcstudy.laws.laws import NONE, Laws
from tcstudy.laws.shapes import SHAPES

TRESCA = SHAPES["tresca"].build(tau=2.0)
SLIP = SHAPES["slip-weakening"].build(tau_s=3.0, tau_k=1.0, delta=0.5)
DECAY = SHAPES["exponential"].build(a=2.0, b=0.5, delta=0.25)
S = np.linspace(-2.0, 2.0, 81) + 0.003


def test_nodes_have_their_own_strength_stretch_and_shift() -> None:
    index = [0, 1, 2, 0, 1, 1]
    strength = [1.0, 0.5, 2.0, 3.0, 0.0, 0.5]
    stretch = [1.0, 2.0, 1.0, 0.5, 1.0, 2.0]
    shift = [0.0, 0.25, 0.0, 0.5, 0.0, 0.25]
    laws = (SLIP, DECAY, NONE)
    found = nodal(laws, index, strength, stretch, shift)
    assert found.index.shape == (6,)
    for s in S[::8]:
        expected = [
            beta * float(laws[k].b((s - a) / sigma))
            for k, beta, sigma, a in zip(index, strength, stretch, shift, strict=True)
        ]
        np.testing.assert_allclose(found.b(np.full(6, s)), expected, rtol=1e-12)
    # one table for the gaps and the film without friction, one for the nodes that are alike
    assert len(found.laws) == 4
    assert found.single(2) == found.single(4) == NONE
    assert found.index[1] == found.index[5]
    assert nodal((SLIP, SLIP.times(1.0)), [0, 1]) is SLIP
    assert nodal((TRESCA, SLIP), [1, 1]) is SLIP
    for wrong in (
        {"strength": -1.0},
        {"stretch": 0.0},
        {"shift": np.inf},
        {"strength": [1.0, np.nan]},
    ):
        with pytest.raises(ValueError, match="a stretch above 0"):
            nodal((SLIP,), [0, 0], **wrong)


def test_rows_are_divided_by_their_stiffness() -> None:
    by_node = nodal((SLIP, DECAY), [0, 1, 1])
    laws = (TRESCA, by_node, TRESCA, by_node)
    factor = np.array([1.0, 4.0, 0.5, 4.0])
    found = row_laws(laws, factor)
    assert found.index.shape == (4, 3)
    assert len(found.laws) == 1 + 2 + 1
    for s in S[::8]:
        slips = np.full((4, 3), s)
        expected = [law.b(slips[0]) / f for law, f in zip(laws, factor, strict=True)]
        np.testing.assert_allclose(found.b(slips), expected, rtol=1e-15)
    assert row_laws((TRESCA, TRESCA), np.ones(2)).index.shape == (2, 1)


def test_a_sum_of_laws_without_exponentials_has_none() -> None:
    both = total(TRESCA, SHAPES["tresca"].build(tau=3.0))
    assert both == SHAPES["tresca"].build(tau=5.0)
    assert (both.name, both.a_2, both.r_2) == ("tresca", None, None)
    assert total(DECAY, DECAY).a_2 is None
    assert total(DECAY, NONE).name == "exponential"
    assert total(NONE, NONE).vanishes
    assert total(SLIP, DECAY).name == "slip-weakening and exponential"


EDGES = EdgeLaws((("", SLIP, 1.0), ("left", DECAY, 0.5), ("right", SLIP, 0.25)))
NAMES = ("left", "middle", "right", "far")
EDGE = np.array([0, 0, 1, 2, 3])
XY = np.column_stack([np.arange(5.0), np.zeros(5)])
JOINTS = Joints(np.array([2, 4]), np.array([0, 1]), np.array([0.25, 0.75]))


def test_points_have_the_law_of_their_edge() -> None:
    index, strength = EDGES.along(NAMES, EDGE, XY)
    assert index.tolist() == [1, 1, 0, 2, 0]
    assert strength.tolist() == [0.5, 0.5, 1.0, 0.25, 1.0]
    found = law_along(EDGES, NAMES, EDGE, XY)
    for s in S[::8]:
        decay, slip = float(DECAY.b(s)), float(SLIP.b(s))
        expected = [0.5 * decay, 0.5 * decay, slip, 0.25 * slip, slip]
        np.testing.assert_allclose(found.b(np.full(5, s)), expected, rtol=1e-14)
    assert law_along(SLIP, NAMES, EDGE, XY) is SLIP
    assert not EDGES.vanishes
    assert EdgeLaws((("", NONE, 1.0), ("left", NONE, 2.0))).vanishes
    for strength, words in ((-0.5, "is -0.5 at \\(3, 0\\)"), (np.nan, "is nan at \\(3, 0\\)")):
        wrong = EdgeLaws((("", SLIP, 1.0), ("right", DECAY, strength)))
        with pytest.raises(ValueError, match=words):
            law_along(wrong, NAMES, EDGE, XY)
    unbonded = EdgeLaws((("", SLIP, 0.0),))
    assert law_along(unbonded, NAMES, EDGE, XY) is NONE


def test_a_joint_has_the_share_of_both_edges() -> None:
    """Of two laws their sum, of one law the mean of its strengths."""
    laws, index, strength = laws_along(EDGES, NAMES, EDGE, XY, JOINTS)
    assert [name for name, _ in laws] == ["", "left", "right", " and left"]
    assert index.tolist() == [1, 1, 3, 2, 0]
    assert strength.tolist() == [0.5, 0.5, 1.0, 0.25, 1.0]
    joint = laws[3][1]
    np.testing.assert_allclose(joint.b(S), 0.75 * SLIP.b(S) + 0.125 * DECAY.b(S), rtol=1e-13)
    factors = EdgeLaws((("", SLIP, 1.0), ("left", DECAY, 0.5))).factors(NAMES, EDGE, XY, JOINTS)
    np.testing.assert_array_equal(factors[:, 2], [0.75, 0.125])
    np.testing.assert_array_equal(factors[:, 4], [1.0, np.nan])
    one_law = EdgeLaws((("", SLIP, 1.0),))
    assert one_law.factors(NAMES, EDGE, XY, JOINTS).tolist() == [[1.0] * 5]


def largest_error(law: Laws, polygon: Laws, reach: float) -> float:
    s = np.unique(np.concatenate([np.linspace(-reach, reach, 20001), law.kinks, polygon.kinks]))
    s = s[np.abs(s) <= reach]
    return max(float(np.max(np.abs(law.b(s, side) - polygon.b(s, side)))) for side in (-1, 1))


@pytest.mark.parametrize("shift", [0.0, 0.5, -0.75])
@pytest.mark.parametrize("tolerance", [1e-1, 1e-2, 1e-4])
def test_straight_pieces_use_all_of_the_tolerance(shift: float, tolerance: float) -> None:
    """Kinks stay to the bit, with the limits there."""
    law = DECAY.placed(1.0, 1.0, shift)
    polygon = piecewise_linear(law, tolerance, 3.0)
    allowed = tolerance * law.b_scale
    assert 0.5 * allowed < largest_error(law, polygon, 3.0) <= allowed * (1.0 + 1e-9)
    assert set(law.kinks) <= set(polygon.kinks)
    np.testing.assert_allclose(polygon.interval(shift), law.interval(shift), rtol=1e-14)
    assert polygon.piecewise_linear


def test_a_polygon_has_fewer_sides_than_chords() -> None:
    """Of exp(−x) on [0, L] chords with the error e need (1 − exp(−L/2))·2/√(8e), this polygon √2
    times fewer."""
    tolerance, reach = 1e-4, 1.0
    polygon = piecewise_linear(DECAY, tolerance, reach)
    length, amplitude = reach / 0.25, DECAY.b(0.0) - 0.5
    relative = tolerance * DECAY.b_scale / amplitude
    chords = 2.0 * (1.0 - np.exp(-length / 2.0)) / np.sqrt(8.0 * relative)
    inside = polygon.kinks[(polygon.kinks > 0.0) & (polygon.kinks < reach)]
    assert len(inside) + 1 == pytest.approx(chords / np.sqrt(2.0), abs=1.5)
    assert np.all(polygon.b([1.5, 3.0]) == polygon.b(reach))
    with pytest.raises(ValueError, match="tolerance must be positive, not 0"):
        piecewise_linear(DECAY, 0.0, 1.0)
    with pytest.raises(ValueError, match="not negative, not -1"):
        piecewise_linear(DECAY, 1e-3, -1.0)


@pytest.mark.parametrize("tail", [0.0, 0.004, 0.01])
def test_all_sides_of_a_polygon_rise_equally_far_above_a_decay(tail: float) -> None:
    """Also the last one, which ends below the curve by the tail: so no polygon of as many sides is
    closer."""
    cuts, error = _equal(0.01, 3.0, tail)
    depths = np.array([0.0, *[error] * (len(cuts) - 2), tail])
    for i in range(len(cuts) - 1):
        x = np.linspace(cuts[i], cuts[i + 1], 4001)
        line = np.interp(x, cuts, np.exp(-np.array(cuts)) - depths)
        assert np.max(line - np.exp(-x)) == pytest.approx(error, rel=1e-3)
    assert len(_march(0.99 * error, 3.0, tail)) > len(cuts)
