"""Laws in tables against the laws themselves: values, primitives, ranges, bends, hulls; by row and by node."""

from __future__ import annotations

import numpy as np
import pytest

from tcstudy.contact.bounds import bends_below_tangent, largest_push
from tcstudy.contact.envelopes import moreau_envelopes
from tcstudy.laws.laws import Laws
from tests.contact.rows import some_laws

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


def test_the_largest_push_is_that_of_samples() -> None:
    for own, push in zip(LAWS, largest_push(TABLES), strict=True):
        s = np.union1d(np.linspace(-3.0, 3.0, 20001), own.kinks)
        sampled = max(0.0, *(float(np.max(-np.sign(s) * own.b(s, side))) for side in (-1, 1)))
        assert sampled - 1e-12 <= push <= max(1.001 * sampled, own.b_scale) + 1e-12


def test_bends_are_those_of_the_laws_and_few_parts_never_less() -> None:
    rng = np.random.default_rng(3)
    law, v = slips(rng, (1, 60))
    law, v = law[0], v[0]
    low, high = v - rng.exponential(0.5, len(v)), v + rng.exponential(0.5, len(v))
    zeta = by_law(law, v, of=lambda b, s: np.mean(b.interval(s), axis=0))
    given = (TABLES.at(law[None]), v[None], zeta[None], low[None], high[None])
    exact = bends_below_tangent(*given, 400)[0]
    expected = by_law(law, v, zeta, low, high, of=lambda *x: bends_below_tangent(*x)[0])
    finite = np.isfinite(expected)
    for parts in (6, 48):
        upper, lower = bends_below_tangent(*given, parts)
        assert np.all(lower <= upper)
        assert np.all(lower <= exact + 1e-7 * np.abs(exact))
        assert np.count_nonzero(np.isclose(lower, exact)) > 20
        assert np.all(upper[0][finite] >= expected[finite] - 1e-9 * np.abs(expected[finite]))
    np.testing.assert_allclose(upper[0], expected, rtol=1e-9, atol=1e-9)


@pytest.mark.parametrize("kappa", [0.5, 3.0, 20.0])
def test_envelopes_of_many_laws_are_those_of_each_alone(kappa: float) -> None:
    envelopes = moreau_envelopes(TABLES.at(np.arange(len(LAWS))), kappa)
    s = np.linspace(-1.2, 1.2, 501)
    for k, law in enumerate(LAWS):
        alone = moreau_envelopes(law, kappa).laws[0]
        at = envelopes.locate(s, np.full(s.shape, k))
        np.testing.assert_array_equal(envelopes.value(s, at.piece), alone.b(s, -1))
