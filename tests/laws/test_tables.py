"""Laws in tables against the laws themselves: values, primitives, ranges, bends, hulls; by row and by node."""

from __future__ import annotations

import numpy as np

from tcstudy.laws.laws import Laws
from tests.online.rows import some_laws

LAWS = some_laws()
TABLES = Laws.of(LAWS)


def slips(rng: np.random.Generator, shape: tuple[int, int]) -> tuple[np.ndarray, np.ndarray]:
    """(law by node, slips): a third of them on a kink of their law."""
    law = rng.integers(0, len(LAWS), shape)
    s = rng.normal(scale=0.5, size=shape)
    for place in zip(*np.nonzero(rng.random(shape) < 0.3), strict=True):
        kinks = LAWS[law[place]].kinks
        if len(kinks):
            s[place] = rng.choice(kinks)
    return law, s


def by_law(law: np.ndarray, *arguments: np.ndarray, of) -> np.ndarray:
    """`of`(law, its own entries of the arguments), put together again."""
    result = np.empty(law.shape)
    for k, own in enumerate(LAWS):
        mine = law == k
        result[mine] = of(own, *(x[mine] for x in arguments))
    return result


def test_values_slopes_and_primitives_are_those_of_the_laws() -> None:
    rng = np.random.default_rng(1)
    law, x = slips(rng, (8, 40))
    _, y = slips(rng, (8, 40))
    at, end = TABLES.locate(x, law), TABLES.locate(y, law)
    for side, piece in ((-1, at.piece), (1, at.piece + at.on)):
        assert np.array_equal(TABLES.value(x, piece), by_law(law, x, of=lambda b, s, side=side: b.b(s, side)))
        slope = by_law(law, x, of=lambda b, s, side=side: b.slope(s, b.piece(s, side)))
        np.testing.assert_allclose(TABLES.slope(x, piece), slope, rtol=1e-14)
    expected = by_law(law, x, y, of=Laws.integral)
    np.testing.assert_allclose(TABLES.integral(x, y, at, end), expected, rtol=1e-12, atol=1e-14)
    for row, own in enumerate(LAWS):
        count = len(own.kinks)
        for name in ("kinks", "kinds", "b_left", "b_right"):
            assert np.array_equal(getattr(TABLES, name)[row, :count], getattr(own, name))
        assert (TABLES.falls[row], TABLES.scales[row]) == (own.omega, own.b_scale)
    towards = rng.normal(size=x.shape)
    jumps = by_law(law, x, towards, of=lambda b, s, way: b.next_up_jump(b.locate(s), way))
    assert np.array_equal(TABLES.next_up_jump(at, towards), jumps)
