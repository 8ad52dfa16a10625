"""Parameters from measurements, and distances of measured points to a curve.

Distances of measured points to a polygon that may turn back in both coordinates, such as a path
through folds.

Points come in the order of a test, so their feet must not go back along the polygon. Among all
sequences of sides that do not, dynamic programming finds the one of least Σ d²: exact, at n·K
operations for n points and K sides. (The order within one side is left alone: feet of neighbours
may change places by less than a side.)

The distance is signed: positive on the left of the direction of travel, at a corner of that of both
its sides, so that rounding, which chooses one of them, decides nothing. By the envelope theorem its
derivative by any parameter of the curve is −nᵀ ∂(curve)/∂p at the foot, n the unit vector from foot
to point, whatever coordinate along the curve is held fixed. Left out: several measured coordinates
beside the parameter.

Parameters from measurements: least squares in bounds, and what the data say of them and what not.

Residuals r_i(p) = (model − datum)_i/σ_i; minimised is ½ Σ ρ(r_i²) by a trust region that stays
inside the bounds, with the model's Jacobian, in q = ln p where a parameter has a logarithmic scale.
At the minimum, with n data and k free parameters, the covariance of q is s²(JᵀJ)⁻¹, s² = 1 where
the noise is known and RSS/(n − k) where it is estimated; intervals are Student's. A direction of J
by ln p whose singular value is below WEAK of the largest, or whose interval is wider than a factor
e, is one along which the data say nothing: named are the products that they do determine.

The signs of residuals of a right model come in as many runs as those of coins (Wald & Wolfowitz):
fewer say that the curve is of the wrong shape. Literature: Nocedal & Wright, Numerical Optimization
(2006), ch. 10; Seber & Wild, Nonlinear Regression (2003), ch. 2 and 5; Branch, Coleman & Li, SIAM
J. Sci. Comput. 21 (1999) 1–23 (the trust region).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray
from scipy import optimize, stats

Array = NDArray[np.float64]
Index = NDArray[np.intp]


@dataclass(frozen=True, eq=False)
class Feet:
    """Feet of n points on a polygon.

    side:     (n,) the side that a foot lies on;  share: (n,) where on it, 0 … 1
    point:    (n, 2) the feet;  distance: (n,) signed;  normal: (n, 2) with point − foot = distance × normal, length 1
    """

    side: Index
    share: Array
    point: Array
    distance: Array
    normal: Array


def feet(points: Array, corners: Array) -> Feet:
    """Feet of points (n, 2) in their order on the polygon of K + 1 corners (K + 1, 2), K ≥ 1."""
    begin, way = corners[:-1], np.diff(corners, axis=0)
    length = np.sum(way**2, axis=1)
    apart = points[:, None, :] - begin[None, :, :]
    share = np.clip(np.sum(apart * way, axis=2) / np.where(length > 0.0, length, 1.0), 0.0, 1.0)
    square = np.sum((apart - share[:, :, None] * way) ** 2, axis=2)
    side = _in_order(square)
    rows = np.arange(len(points))
    own = share[rows, side]
    foot = begin[side] + own[:, None] * way[side]
    across = points - foot
    distance = np.sqrt(square[rows, side])
    lefts = np.stack([-way[:, 1], way[:, 0]], axis=1)
    lefts /= np.maximum(np.linalg.norm(lefts, axis=1), np.finfo(float).tiny)[:, None]
    left, last = lefts[side], len(way) - 1
    other = np.clip(
        side + (own == 1.0) - (own == 0.0), 0, last
    )  # the other side of a corner, which is as near as its own
    sign = np.where(np.sum(across * (left + lefts[other]), axis=1) >= 0.0, 1.0, -1.0)
    near = distance <= 1e-12 * np.maximum(np.max(np.abs(points), axis=1), np.sqrt(np.max(length)))
    normal = np.where(near[:, None], left, across / np.where(near, 1.0, sign * distance)[:, None])
    return Feet(side, own, foot, sign * distance, normal)


def _in_order(square: Array) -> Index:
    """(n,) sides of least sum of squares (n, K) that never go back."""
    n, K = square.shape
    total, came = square[0], np.zeros((n, K), dtype=np.intp)
    for i in range(1, n):
        least = np.minimum.accumulate(total)
        first = np.concatenate(
            [[True], total[1:] < least[:-1]]
        )  # the latest side that set the minimum
        came[i] = np.maximum.accumulate(np.where(first, np.arange(K), 0))
        total = least + square[i]
    side = np.empty(n, dtype=np.intp)
    side[-1] = int(np.argmin(total))
    for i in range(n - 1, 0, -1):
        side[i - 1] = came[i, side[i]]
    return side


Flags = NDArray[np.bool_]
Model = Callable[[Array], tuple[Array, Array]]
"""p (k,) to the residuals (n,) in units of their noise and ∂r/∂p (n, k)."""

LEVEL = 0.95
"""Probability of an interval."""
WEAK = 1e-3
"""Singular value, of the largest, below which a direction is not determined."""
WIDE = 1.0
"""Half width of the interval along a direction in ln p above which it is not determined either."""
ROUNDING = 1e-8
"""Singular value, of the largest, of what is rounding of derivatives: the numbers along it have no
variance at all."""
MOST = 200
"""Evaluations of one start at most."""
AT_BOUND = 1e-6
"""Part of the range from a bound within which a parameter lies on it."""
SAME = 1e-3
"""Difference in q, relative to the range, up to which two minima are one."""
TOGETHER = 0.1
"""Change of all predictions between two minima, in standard deviations of the noise, up to which
they are one."""
PROBABLE = 0.05
"""Chance of a larger Σr² from which on a fit is as good as its noise lets expect."""


@dataclass(frozen=True, eq=False)
class Box:
    """Where k parameters may lie: low, high (k,), and which are fitted by their logarithm."""

    low: Array
    high: Array
    log: Flags

    def inner(self, p: Array) -> Array:
        """q of p."""
        return np.where(self.log, np.log(np.where(self.log, p, 1.0)), p)

    def outer(self, q: Array) -> Array:
        """p of q, inside the bounds to the bit."""
        return np.clip(
            np.where(self.log, np.exp(np.where(self.log, q, 0.0)), q), self.low, self.high
        )

    def rate(self, p: Array) -> Array:
        """dp/dq."""
        return np.where(self.log, p, 1.0)

    @property
    def span(self) -> Array:
        """Range of q."""
        return self.inner(self.high) - self.inner(self.low)

    def starts(self, first: Array, count: int, seed: int) -> list[Array]:
        """The first start and count − 1 others, a Latin hypercube in q."""
        low, high = self.inner(self.low), self.inner(self.high)
        draws = stats.qmc.LatinHypercube(len(first), rng=np.random.default_rng(seed)).random(
            max(0, count - 1)
        )
        return [first, *(self.outer(low + u * (high - low)) for u in draws)]


@dataclass(frozen=True, eq=False)
class Minimum:
    """A local minimum: p (k,), residuals (n,), ∂r/∂p (n, k), ½Σρ whenever it was lower,
    evaluations.

    prior:   (d, k) by q, of what is minimised beside the data;  weight: of that, where the data choose it
    numbers: how many numbers the data then decide, None where nothing is minimised beside them
    """

    p: Array
    residual: Array
    jacobian: Array
    costs: tuple[float, ...]
    evaluations: int
    prior: Array
    weight: float = 0.0
    numbers: float | None = None

    @property
    def cost(self) -> float:
        """The least ½Σρ."""
        return self.costs[-1]


def minimise(
    model: Model,
    start: Array,
    box: Box,
    loss: Literal["linear", "soft_l1"] = "linear",
    prior: int = 0,
) -> Minimum:
    """The minimum that a start leads to. What the model raises passes through.

    prior: residuals at the end that are no measurements: the loss does not act on them
    """
    low, span, margin, costs = box.inner(box.low), box.span, 1e-9, list[float]()

    @cache
    def at(z: bytes) -> tuple[Array, Array, Array]:
        p = box.outer(low + np.frombuffer(z) * span)
        residual, jacobian = model(p)
        cost = 0.5 * float(np.sum(_rho(residual**2, loss, prior)[0]))
        if not costs or cost < costs[-1]:
            costs.append(cost)
        return p, residual, jacobian

    found = optimize.least_squares(
        lambda z: at(z.tobytes())[1],
        np.clip((box.inner(start) - low) / span, margin, 1.0 - margin),
        jac=lambda z: at(z.tobytes())[2] * box.rate(at(z.tobytes())[0]) * span,
        bounds=(0.0, 1.0),  # its norms of steps must not depend on units
        method="trf",
        x_scale="jac",
        loss="linear" if loss == "linear" else lambda z: _rho(z, loss, prior),
        # a few hundredths of a standard error; distances to a polygon have small steps in their
        # slope
        ftol=1e-5,
        xtol=1e-6,
        gtol=1e-10,
        max_nfev=MOST,
    )
    count = at.cache_info().misses
    return Minimum(*at(found.x.tobytes()), tuple(costs), count, np.zeros((0, len(start))))


def _rho(z: Array, loss: str, prior: int) -> Array:
    """(3, n) ρ(z) of squared residuals z and its first two derivatives; ρ = z for the last `prior`
    of them."""
    root = np.sqrt(1.0 + z)
    soft = np.stack([2.0 * (root - 1.0), 1.0 / root, -0.5 / root**3])
    plain = np.full(len(z), loss == "linear") | (np.arange(len(z)) >= len(z) - prior)
    return np.where(plain, np.stack([z, np.ones_like(z), np.zeros_like(z)]), soft)


def misfit(residual: Array, loss: str) -> float:
    """Σ ρ(r²), Σ r² for a linear loss."""
    return float(np.sum(_rho(residual**2, loss, 0)[0]))


def different(minima: Sequence[Minimum], box: Box, known_noise: bool) -> list[list[Minimum]]:
    """The minima, the lowest first, each with all those that are the same."""
    found = list[list[Minimum]]()
    for one in sorted(minima, key=lambda minimum: minimum.cost):
        for group in found:
            if _same(group[0], one, box, known_noise):
                group.append(one)
                break
        else:
            found.append([one])
    return found


def _same(one: Minimum, two: Minimum, box: Box, known_noise: bool) -> bool:
    """Whether two minima lie together, or predict the same in a valley along which the data say
    nothing."""
    J, (n, k) = one.jacobian * box.rate(one.p) * box.span, one.jacobian.shape
    apart, sigma = (
        (box.inner(two.p) - box.inner(one.p)) / box.span,
        np.linalg.svd(J, compute_uv=False),
    )
    if np.max(np.abs(apart)) <= SAME:
        return True
    noise = 1.0 if known_noise else float(np.linalg.norm(one.residual)) / np.sqrt(max(n - k, 1))
    tolerance = max(TOGETHER * noise, ROUNDING * sigma[0])
    alike = float(np.linalg.norm(two.residual - one.residual)) <= tolerance
    return alike and bool(
        float(np.linalg.norm(J @ apart)) <= tolerance or sigma[-1] <= WEAK * sigma[0]
    )


def uncertainty(
    minimum: Minimum, box: Box, groups: Sequence[NDArray[np.intp]], known_noise: bool
) -> dict[str, Any]:
    """Covariance, intervals, what is not determined, and whether the model has the shape of the
    data.

    groups: residuals of one curve each, in the order of the data, for the runs of their signs
    known_noise: whether residuals are in units of a noise that is known
    With a prior P of the minimum the covariance is s²(JᵀJ + PᵀP)⁻¹.

    By name, as in the file of a fit:
    covariance:       (k, k) of q; NaN for parameters on a bound and where JᵀJ is singular
    standard_error:   (k,) of p;  interval: (k, 2);  at_bound: (k,)
    singular_value:   (k,) of J by ln p (by p/start where p has no logarithm), falling
    singular_vector:  (k, k) its right singular vectors, a row each;  weak: how many of the last are not determined
    chi_square:       Σr²;  degrees_of_freedom: n − k;  fit_probability: chance of a larger Σr² if the noise is what it
                      is said to be (NaN if estimated)
    runs:             of signs of the residuals;  runs_probability: chance of as few or fewer
    information_criterion: Akaike's, corrected for few data (AICc): of two models of the same data the lower is better
    """
    p, r = minimum.p, minimum.residual
    n, k = len(r), len(p)
    by_q = minimum.jacobian * box.rate(p)
    low, high, q = box.inner(box.low), box.inner(box.high), box.inner(p)
    at_bound = np.minimum(q - low, high - q) <= AT_BOUND * (high - low)
    free = np.flatnonzero(~at_bound)
    count = float(k) if minimum.numbers is None else minimum.numbers
    freedom = n - int(np.ceil(count))
    square = float(r @ r)
    scale = 1.0 if known_noise else square / max(freedom, 1)
    _, sigma, rows = np.linalg.svd(by_q * np.where(box.log, 1.0, np.abs(p)), full_matrices=False)
    covariance = np.full((k, k), np.nan)
    own = np.concatenate([by_q, minimum.prior])[:, free]
    if len(free):
        covariance[np.ix_(free, free)] = scale * _inverse(own)
    error = np.sqrt(np.diagonal(covariance))
    student = float(stats.t.ppf(0.5 + 0.5 * LEVEL, max(freedom, 1)))
    reach = student * error
    vague = (sigma < WEAK * sigma[0]) | (student * np.sqrt(scale) > WIDE * sigma)
    with np.errstate(over="ignore"):
        ends = (
            np.where(box.log, p * np.exp(-reach), p - reach),
            np.where(box.log, p * np.exp(reach), p + reach),
        )
    runs, runs_p = _runs([r[group] for group in groups])
    likelihood = square if known_noise else n * float(np.log(max(square, 1e-300) / n))
    count += not known_noise
    penalty = 2.0 * count + 2.0 * count * (count + 1) / max(n - count - 1, 1)
    return {
        "covariance": covariance,
        "standard_error": error * box.rate(p),
        "interval": np.stack(ends, axis=1),
        "at_bound": at_bound,
        "singular_value": sigma,
        "singular_vector": rows,
        "weak": int(np.count_nonzero(vague)) if minimum.numbers is None else 0,
        "chi_square": square,
        "degrees_of_freedom": np.int32(freedom),
        "fit_probability": float(stats.chi2.sf(square, max(freedom, 1)))
        if known_noise
        else float("nan"),
        "runs": np.int32(runs),
        "runs_probability": runs_p,
        "information_criterion": likelihood + penalty,
    }


def settled(said: Mapping[str, Any]) -> bool:
    """Whether Σr² is probable for a known noise and every number determined: no other start can say
    more."""
    probable = said["fit_probability"] >= PROBABLE
    return bool(probable and said["weak"] == 0 and np.all(np.isfinite(said["standard_error"])))


def _inverse(J: Array) -> Array:
    """(JᵀJ)⁻¹ of J (n, k); NaN for numbers that have a part in a direction along which J is 0 but
    for rounding."""
    size = np.linalg.norm(J, axis=0)
    _, sigma, rows = np.linalg.svd(J / np.where(size > 0.0, size, 1.0), full_matrices=False)
    null = sigma <= ROUNDING * sigma[0]
    found = (rows[~null].T / sigma[~null] ** 2) @ rows[~null] / np.outer(size, size)
    lost = np.any(np.abs(rows[null]) > np.sqrt(ROUNDING), axis=0) | (size == 0.0)
    found[lost], found[:, lost] = np.nan, np.nan
    return np.asarray(found)


def _runs(curves: Sequence[Array]) -> tuple[int, float]:
    """Runs of signs of all curves, and the chance of as few or fewer for independent signs."""
    count, mean, variance = 0, 0.0, 0.0
    for r in curves:
        above, below = int(np.count_nonzero(r > 0.0)), int(np.count_nonzero(r <= 0.0))
        n = above + below
        count += 1 + int(np.count_nonzero(np.diff(r > 0.0)))
        mean += 1.0 + 2.0 * above * below / n
        variance += 2.0 * above * below * (2.0 * above * below - n) / (n**2 * max(n - 1, 1))
    return count, float(
        stats.norm.cdf((count + 0.5 - mean) / np.sqrt(variance))
    ) if variance > 0.0 else float("nan")


def product(direction: Array, names: Sequence[str]) -> str:
    """A direction in ln p as the product of powers that grows along it: tau_s·delta,
    E·alpha^-0.5."""
    powers = direction / direction[np.argmax(np.abs(direction))]
    factors = [
        (name, round(float(x), 2)) for name, x in zip(names, powers, strict=True) if abs(x) >= 0.05
    ]
    return "·".join(name if x == 1.0 else f"{name}^{x:g}" for name, x in factors)
