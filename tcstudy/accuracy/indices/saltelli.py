"""First-order and total Sobol indices of a Saltelli design, with bootstrap intervals.

First order S_i = Var(E[Y|X_i])/Var(Y), total T_i = E[Var(Y|X_~i)]/Var(Y) of independent inputs, by
the estimators (b) and (f) of Saltelli et al., Comput. Phys. Commun. 181 (2010) 259, table 2. They
are those of scipy.stats.sobol_indices, which takes neither a number of rows that is no power of two
nor rows left out. The base points are of a Sobol sequence, while the bootstrap takes them as
independent: intervals are too wide for results that are almost additive. Where parameters act
together, few base points have errors that no resampling of them shows (columns of a short sequence
depend on each other), so that there is no interval.
"""

from __future__ import annotations

import numpy as np

from tcstudy.accuracy.indices.bases import Array
from tcstudy.accuracy.indices.first_order import LEVEL, ROUNDING, SobolIndex

RESAMPLES = 1000
"""Bootstrap resamples of the base points."""
MIN_BASE_POINTS = 64
"""Base points from which indices have intervals."""
MIN_BASE_POINTS_TOGETHER = 256
"""The same where first-order indices add up to less than MIN_ADDITIVE_SHARE."""
MIN_ADDITIVE_SHARE = 0.5


def saltelli_indices(f: Array, seed: int = 0) -> tuple[list[SobolIndex], list[SobolIndex]]:
    """Return the first-order and the total indices of results f (n, d + 2), n ≥ 2.

    The columns of f are the results at A, at B and at the d mixtures.
    """
    count, d = len(f), f.shape[1] - 2
    if np.ptp(f[:, :2]) <= ROUNDING * np.abs(f).max():
        constant = SobolIndex(np.nan, reason="the result is the same at all points")
        return [constant] * d, [constant] * d
    f = f - f[:, :2].mean()
    at_A, at_B, at_mixtures = f[:, :1], f[:, 1:2], f[:, 2:]
    first_terms = at_B * (at_mixtures - at_A)
    total_terms = (at_A - at_mixtures) ** 2
    moments = [at_A + at_B, at_A**2 + at_B**2]
    terms = np.concatenate([*moments, first_terms, total_terms], axis=1)
    generator = np.random.default_rng(seed)
    resampled = generator.multinomial(count, np.full(count, 1.0 / count), RESAMPLES)
    means = np.vstack([np.ones(count), resampled]) @ terms / count
    variance = means[:, 1:2] / 2.0 - (means[:, :1] / 2.0) ** 2
    ratios = np.full((len(means), 2 * d), np.nan)
    np.divide(means[:, 2:], variance, out=ratios, where=variance > 0.0)
    first, total = ratios[:, :d], ratios[:, d:] / 2.0
    reason = ""
    if count < MIN_BASE_POINTS:
        reason = f"fewer than {MIN_BASE_POINTS} base points"
    elif count < MIN_BASE_POINTS_TOGETHER and first[0].sum() < MIN_ADDITIVE_SHARE:
        reason = f"fewer than {MIN_BASE_POINTS_TOGETHER} base points, and parameters act together"
    return _estimates(first, reason), _estimates(total, reason)


def _estimates(samples: Array, reason: str) -> list[SobolIndex]:
    """Return the indices of all resamples (1 + RESAMPLES, d), the first of which is the design."""
    if reason:
        return [SobolIndex(float(value), reason=reason) for value in samples[0]]
    levels = [(1.0 - LEVEL) / 2.0, (1.0 + LEVEL) / 2.0]
    lows, highs = np.nanquantile(samples[1:], levels, axis=0)
    ends = zip(samples[0].tolist(), lows.tolist(), highs.tolist(), strict=True)
    return [SobolIndex(value, low, high) for value, low, high in ends]
