"""Moreau envelopes of friction laws: closed forms and an independent convex hull."""

import numpy as np
import pytest

from tcstudy.contact.search import moreau_envelopes
from tcstudy.laws.laws import Laws
from tcstudy.laws.pieces import DOWN
from tests.contact import contact_cases as cases


def envelope(law: Laws, kappa: float) -> tuple[Laws, np.ndarray]:
    """The envelope of a law and its common tangents (n, 2)."""
    found = moreau_envelopes(law, kappa).laws[0]
    tangents = np.flatnonzero((found.q == -kappa) & ~found.bent)
    return found, np.column_stack([found.lower[tangents], found.upper[tangents]])


def test_slip_weakening_in_closed_form() -> None:
    """b falls from 1 to 0.5 over 0.1. Equal areas: the tangent from 0 ends at √((1 − 0.5)·0.1/κ), b there 0.5."""
    law, kappa = cases.slip_weakening(1.0, 0.5, 0.1), 0.8
    hull, tangents = envelope(law, kappa)
    end = np.sqrt(0.05 / kappa)
    assert tangents == pytest.approx(np.array([[-end, 0.0], [0.0, end]]), rel=1e-13)
    s = np.linspace(1e-3, 0.999 * end, 7)
    assert hull.b(s) == pytest.approx(0.5 + kappa * (end - s), rel=1e-13)
    assert hull.b(-s) == pytest.approx(-hull.b(s), rel=1e-13)
    assert hull.j(np.array([2.0])) == pytest.approx(law.j(np.array([2.0])), rel=1e-14)
    assert hull.omega == pytest.approx(kappa, rel=1e-14)
    same, none = envelope(law, 5.1)  # it falls by 5 a length
    assert (same.kinks.tolist(), len(none)) == (law.kinks.tolist(), 0)


def sampled_hull(law: Laws, kappa: float, s: np.ndarray, j: np.ndarray) -> np.ndarray:
    """conv(j + ½κ s²) − ½κ s² at the samples, as the largest of all their supporting lines (brute force)."""
    height = j + 0.5 * kappa * s**2
    slopes = np.unique(np.diff(height) / np.diff(s))
    supports = np.array([np.min(height - slope * s) for slope in slopes])
    return np.max(slopes[:, None] * s + supports[:, None], axis=0) - 0.5 * kappa * s**2


@pytest.mark.parametrize("smooth", [False, True])
def test_random_laws(smooth: bool) -> None:
    """j_κ ≤ j and equal off the tangents; b_κ falls by κ at most; against a brute-force hull of dense samples."""
    bridged = 0
    for seed in range(15):
        rng = np.random.default_rng([seed, int(smooth), 21])
        law = cases.random_law(rng, 3.0, 15, smooth)
        kappa = 3.0 * 4.0 ** rng.integers(0, 3)
        hull, tangents = envelope(law, kappa)
        bridged += len(tangents)
        reach = 2.0 * np.max(np.abs(law.kinks)) + 2.0 * law.b_scale / kappa
        s = np.unique(np.concatenate([np.linspace(-reach, reach, 1001), law.kinks, tangents.ravel()]))
        j, below = law.j(s), hull.j(s)
        below = below + (j - below)[0]  # both are primitives; far out they are the same
        scale = np.max(np.abs(j))
        assert np.all(below <= j + 1e-10 * scale)
        if len(tangents):
            inside = np.any((tangents[:, :1] < s) & (s < tangents[:, 1:]), axis=0)
            assert below[~inside] == pytest.approx(j[~inside], abs=1e-10 * scale)
        assert np.min(hull.end_slopes) >= -kappa * (1.0 + 1e-9) or len(tangents) == 0
        fall = (hull.b_left - hull.b_right)[hull.kinds == DOWN]
        assert np.max(fall, initial=0.0) <= 1e-9 * law.b_scale
        brute = sampled_hull(law, kappa, s, j)
        assert np.max(np.abs(below - brute)) <= 3e-3 * law.b_scale * reach
    assert bridged >= 25
