"""First-order Sobol indices of drawn points with confidence intervals.

S_i = Var(E[Y|X_i])/Var(Y), whatever design drew the points. E[Y|X_i] is fitted by least squares
(`fits`), and the interval comes from the influence of every point (`intervals`). An input that
depends on others has in its index what comes along with it, so that the sum may pass 1. The theory
holds for a basis that is given; that the choice of the basis leaves the intervals as they are is
shown by trials (tests/benchmarks/indices.py).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tcstudy.accuracy.indices.bases import Array
from tcstudy.accuracy.indices.fits import choose_fit, is_classed
from tcstudy.accuracy.indices.intervals import ALMOST_ONE, IndexTest

LEVEL = 0.95
"""Confidence of all intervals."""
ROUNDING = 1e-9
"""Differences of results, relative to the largest, that solutions do not resolve."""
MIN_POINTS = 50
"""Points from which an index has an interval."""
MIN_CLASS_POINTS = 5
"""Points of each value of a choice from which it has one."""
MIN_EFFECTIVE_POINTS = 5.0
"""Points that must carry the variance, (Σy²)²/Σy⁴."""
MIN_DEGREES_OF_FREEDOM = 2.0
"""Of the variance of the influence."""


@dataclass(frozen=True)
class SobolIndex:
    """An index with the ends of its interval, and the reason where it has none.

    NaN stands for a value or an end that there is not.
    """

    value: float
    low: float = np.nan
    high: float = np.nan
    reason: str = ""


def first_order(
    x: Array, y: Array, named: tuple[bool, ...] = (), balanced: bool = False
) -> list[SobolIndex]:
    """Return the index of each column of x (N, d) for the results y (N,).

    named:    (d,) columns that number the values of a choice
    balanced: the points are of a Sobol sequence
    """
    is_named = named or (False,) * x.shape[1]
    columns = zip(x.T, is_named, strict=True)
    return [first_order_of(column, y, name, balanced) for column, name in columns]


def first_order_of(x: Array, y: Array, named: bool = False, balanced: bool = False) -> SobolIndex:
    """Return the index of one input x (N,) for the results y (N,)."""
    count = len(y)
    if not varies(y):
        return SobolIndex(np.nan, reason="the result is the same at all points")
    if np.ptp(x) == 0.0:
        return SobolIndex(0.0, reason="the parameter is the same at all points")
    y = (y - y.mean()) / np.abs(y - y.mean()).max()
    total = float(y @ y) / (count - 1)
    classed = is_classed(x, named)
    choice = choose_fit(x, y, named)
    test = IndexTest.of(choice.chosen, choice.chosen.variance, y, LEVEL)
    value = max(test.value, 0.0)

    if count < MIN_POINTS:
        return SobolIndex(value, reason=f"fewer than {MIN_POINTS} points")
    if classed and np.unique(x, return_counts=True)[1].min() < MIN_CLASS_POINTS:
        return SobolIndex(value, reason=f"a value has fewer than {MIN_CLASS_POINTS} points")
    effective_points = np.sum(y**2) ** 2 / np.sum(y**4)
    is_heavy = test.degrees_of_freedom < MIN_DEGREES_OF_FREEDOM
    if effective_points < MIN_EFFECTIVE_POINTS or is_heavy:
        return SobolIndex(value, reason="a few points carry the variance")

    # the upper end allows for what the chosen basis may miss, and for jumps whose places are known
    best = min(choice.chosen, choice.best, key=lambda fit: fit.least_variance)
    variance = min(best.least_variance, total)
    correlation = neighbour_correlation(x, best.residual)
    if not (classed or balanced) and correlation >= 2.0 / count**0.5:
        variance *= 1.0 - correlation
    upper = IndexTest.of(best, variance, y, LEVEL)
    return SobolIndex(value, test.end(0.0), max(value, upper.end(ALMOST_ONE)))


def varies(y: Array) -> bool:
    """Return whether results differ by more than rounding."""
    return bool(np.ptp(y) > ROUNDING * np.abs(y).max(initial=0.0))


def neighbour_correlation(x: Array, residual: Array) -> float:
    """Return the correlation of residuals (N,) of neighbours in x (N,).

    Points with the same x count in their mean order, so that the order of the rows does not matter.
    """
    _, class_of_point, counts = np.unique(x, return_inverse=True, return_counts=True)
    sums = np.bincount(class_of_point, residual)
    squares = np.bincount(class_of_point, residual**2)
    means = sums / counts
    within = np.sum((sums**2 - squares) / counts)
    between = np.sum(means[1:] * means[:-1])
    total = float(np.sum(squares))
    return float(within + between) / total if total > 0.0 else 0.0
