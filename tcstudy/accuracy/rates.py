"""Rates of convergence with their uncertainty, and Richardson's extrapolation of numbers.

Rate between levels:  r_i = log(e_{i−1}/e_i) / log(h_{i−1}/h_i)
Asymptotic levels:    the longest run of levels up to the finest over which the rates differ by at most SETTLED
Slope:                least squares of log e over log h on the asymptotic levels, with its standard error; on all
                      levels if no two rates agree, and then marked as not settled
Extrapolation:        q(h) = q* + C h^p through the three finest levels

What is worth its cost: the points that no other beats in cost and error together.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

SETTLED = 0.2
"""Rates that differ by no more than this belong to one asymptotic range."""
ROUNDING = 1e-11
"""Relative error below which a solution is called exact: what is left is rounding and has no rate."""
CONDITION = 64.0
"""Condition of a stiffness matrix over (size of the body/h)²: rounding grows like it. On patch tests, whose errors are
nothing else, errors come to 0.01 to 12 of it."""
STEADY = 1e-12
"""Relative change of a number below which it does not depend on the level: what is left is rounding."""
NAN = float("nan")


@dataclass(frozen=True)
class Fit:
    """The convergence of one error.

    rates:          (levels,) rate from the level before; NaN where there is none
    slope:          least-squares order from level `first` on; NaN with fewer than two levels
    standard_error: of the slope; NaN with fewer than three levels
    first:          the first asymptotic level, the first level at all if not settled; −1 if there is none
    settled:        at least two rates agree; otherwise the levels are pre-asymptotic or too few
    exact:          the error is rounding on all levels
    """

    rates: Array
    slope: float
    standard_error: float
    first: int
    settled: bool
    exact: bool


def rounding_level(h: Array, tolerance: float = 0.0) -> Array:
    """(levels,) relative error that may be rounding, h being over the size of the body; `tolerance` at least."""
    return np.asarray(np.maximum(max(ROUNDING, tolerance), CONDITION * np.finfo(float).eps / h**2))


def fit(h: Array, error: Array, usable: NDArray[np.bool_], rounding: Array | float = ROUNDING) -> Fit:
    """Rates and slope of relative errors (levels,) on meshes of size h, from the usable levels alone.

    rounding: error (levels,) at which rates end, for example the tolerance of the solver
    """
    good = usable & np.isfinite(error)
    rates = np.full(len(h), NAN)
    if not good.any():
        return Fit(rates, NAN, NAN, -1, False, False)
    if np.all((error <= rounding)[good]):
        return Fit(rates, NAN, NAN, int(np.flatnonzero(good)[0]), True, True)
    good &= error > rounding
    levels = np.flatnonzero(good)
    for before, level in itertools.pairwise(levels):
        rates[level] = np.log(error[before] / error[level]) / np.log(h[before] / h[level])
    run = _asymptotic(levels, rates)
    settled = len(run) >= 3
    run = run if settled else levels
    slope, standard_error = _slope(np.log(h[run]), np.log(error[run]))
    return Fit(rates, slope, standard_error, int(run[0]) if len(run) else -1, settled, False)


def log_share(h: Array) -> float:
    """By how much the slope of h² (1 + log(1/h)) stays below 2; h: (levels,) over the size of the body."""
    return -_slope(np.log(h), np.log1p(-np.log(h)))[0] if len(h) > 1 else 0.0


def _asymptotic(levels: NDArray[np.intp], rates: Array) -> NDArray[np.intp]:
    """The finest levels whose rates lie within SETTLED of each other; two levels at least, if there are."""
    if len(levels) < 2:
        return levels
    start = len(levels) - 2
    while start > 0:
        own = rates[levels[start:]]
        if np.max(own) - np.min(own) > SETTLED:
            break
        start -= 1
    return levels[start:]


def _slope(x: Array, y: Array) -> tuple[float, float]:
    """Slope of the least-squares line and its standard error."""
    if len(x) < 2:
        return NAN, NAN
    dx = x - x.mean()
    slope = float(dx @ y / (dx @ dx))
    if len(x) < 3:
        return slope, NAN
    rest = y - y.mean() - slope * dx
    return slope, float(np.sqrt(rest @ rest / (len(x) - 2) / (dx @ dx)))


@dataclass(frozen=True)
class Limit:
    """The extrapolated value of a number.

    value, uncertainty: q* and how far it may be off: twice what the extrapolation from the three levels before gives
                        differently, at least a tenth of the extrapolated step; with three levels that step itself
    order:              p; NaN where the values do not approach a limit monotonically: then value is the finest one
                        and uncertainty its largest distance from the two before
    orders:             (levels,) p from the three levels that end at each level
    """

    value: float
    uncertainty: float
    order: float
    orders: Array


def richardson(h: Array, q: Array, usable: NDArray[np.bool_]) -> Limit:
    """Extrapolate q(h) (levels,) to h = 0 from its three finest usable levels."""
    orders, limits = np.full(len(h), NAN), np.full(len(h), NAN)
    levels = np.flatnonzero(usable & np.isfinite(q))
    if not len(levels):
        return Limit(NAN, NAN, NAN, orders)
    for i in range(2, len(levels)):
        three = levels[i - 2 : i + 1]
        orders[three[-1]], limits[three[-1]] = _extrapolate(h[three], q[three])
    last = levels[-1]
    if len(levels) < 2:
        return Limit(float(q[last]), NAN, NAN, orders)
    if not np.isfinite(limits[last]):
        spread = float(np.max(np.abs(q[levels[-3:]] - q[last])))
        return Limit(float(q[last]), spread, NAN, orders)
    step = abs(limits[last] - q[last])
    before = limits[levels[-2]]
    uncertainty = max(0.1 * step, 2.0 * abs(limits[last] - before)) if np.isfinite(before) else step
    return Limit(float(limits[last]), float(uncertainty), float(orders[last]), orders)


def _extrapolate(h: Array, q: Array) -> tuple[float, float]:
    """(p, q*) from three levels; NaN unless the steps shrink in one direction, or are rounding."""
    first, second = q[1] - q[0], q[2] - q[1]
    rounding = STEADY * np.max(np.abs(q))
    if max(abs(first), abs(second)) <= rounding:
        return NAN, float(q[2])
    if first * second <= 0.0 or abs(second) <= rounding:
        return NAN, NAN

    def mismatch(p: float) -> float:
        a, b, c = (float(x) ** p for x in h / h[0])
        return float(first * (b - c) - second * (a - b))

    low, high = 0.1, 8.0
    if mismatch(low) * mismatch(high) > 0.0:
        return NAN, NAN
    from scipy.optimize import brentq  # here, because a run imports this module and needs it for estimates alone

    p = float(brentq(mismatch, low, high, xtol=1e-12))
    b, c = (float(x) ** p for x in h[1:] / h[0])
    return p, float(q[2] + second * c / (b - c))


def dominated(cost: Array, error: Array) -> NDArray[np.bool_]:
    """(n,) points for which another costs no more and errs no more, and less in one of the two.

    Points with NaN are dominated and dominate nothing.
    """
    known = np.isfinite(cost) & np.isfinite(error)
    out = np.ones(len(cost), dtype=bool)
    for i in np.flatnonzero(known):
        no_worse = known & (cost <= cost[i]) & (error <= error[i])
        better = no_worse & ((cost < cost[i]) | (error < error[i]))
        out[i] = bool(better.any())
    return out
