"""The law solved is the law given: polygons through points one rounding to 1e-12 apart pass through all of them."""

from __future__ import annotations

import numpy as np
import pytest

from tcstudy.laws.pieces import BEND, UP
from tcstudy.laws.shapes import SHAPES


def close_points(rng: np.random.Generator, odd: bool) -> list[tuple[float, float]]:
    """Clusters of two to four points, some with a jump, that lie 1 ulp to 1e-12 (relative) apart."""
    points = [(0.0, float(rng.uniform(0.1, 1.0)))] if odd else []
    for centre in np.cumsum(rng.uniform(0.05, 2.0, rng.integers(1, 5))) - (0.0 if odd else 1.5):
        s = float(centre)
        for _ in range(rng.integers(2, 5)):
            b = float(rng.uniform(-1.0, 1.0) * rng.choice([1.0, 1e-3, 1e3]))
            points.append((s, b))
            if rng.random() < 0.2:
                points.append((s, float(rng.uniform(-1.0, 1.0))))
            s = max(float(np.nextafter(s, np.inf)), s + abs(s) * 10.0 ** rng.uniform(-16.0, -12.0))
    if not odd:
        points[0] = (points[0][0], -abs(points[0][1]))
    points[-1] = (points[-1][0], abs(points[-1][1]))
    return points


@pytest.mark.parametrize("odd", [True, False])
def test_close_points_keep_their_values(odd: bool) -> None:
    for seed in range(100):
        points = close_points(np.random.default_rng([seed, odd]), odd)
        law = SHAPES["piecewise-linear"].build(points=points, odd=odd)
        rounding = 4 * float(np.spacing(max(abs(b) for _, b in points)))
        first = dict(reversed(points))
        last = dict(points)
        if odd:
            del first[0.0]  # the left limit there is that of the mirror image
        for s, b in first.items():
            assert abs(float(law.b(s, -1)) - b) <= rounding
        for s, b in last.items():
            assert abs(float(law.b(s, +1)) - b) <= rounding
        s = np.array([*last, *(0.5 * (x + y) for x, y in zip(list(last)[:-1], list(last)[1:], strict=True))])
        if odd:
            assert np.array_equal(law.b(s, +1), -law.b(-s, -1))
            assert np.array_equal(law.j(s), law.j(-s))


@pytest.mark.parametrize("width", [1e-6, 1e-9, 1e-12])
def test_the_foot_of_a_steep_piece_is_no_jump(width: float) -> None:
    law = SHAPES["piecewise-linear"].build(points=[(0, 1), (1, 1), (1 + width, 0.2)])
    assert law.b_left[-1] == pytest.approx(0.2, abs=4e-16)
    assert law.kinds.tolist() == [BEND, BEND, UP, BEND, BEND]
    assert float(law.j(2.0)) == pytest.approx(1 + 0.6 * width + 0.2 * (1 - width), rel=1e-15)


def test_other_units_keep_the_values_at_the_ends_of_narrow_pieces() -> None:
    """Divided by a unit, points one rounding apart may coincide: then the piece is a jump between the same values."""
    for seed in range(30):
        law = SHAPES["piecewise-linear"].build(points=close_points(np.random.default_rng([seed, 1]), True))
        other = law.placed(1.0 / 7.0e6, 1.0 / 3.0e-5)
        size = float(np.max(np.abs(law.b_left)))
        assert np.all(np.diff(other.kinks) > 0)
        for kink, left, right in zip(law.kinks, law.b_left, law.b_right, strict=True):
            low, high = other.interval(kink * (1.0 / 3.0e-5))
            assert float(low) * 7.0e6 <= min(left, right) + 1e-15 * size
            assert float(high) * 7.0e6 >= max(left, right) - 1e-15 * size
