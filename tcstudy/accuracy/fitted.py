"""Parameter identification, and distances of measured points to a curve.

The curve is a polygon that may turn back in both coordinates, such as a path through folds.

Points come in the order of a test, so their feet must not go back along the polygon. Among all
sequences of sides that do not, dynamic programming finds the one of least Σ d²: exact, at n·K
operations for n points and K sides. (The order within one side is left alone: feet of neighbours
may change places by less than a side.)

The distance is signed: positive on the left of the direction of travel, at a corner of that of both
its sides, so that rounding, which chooses one of them, decides nothing. By the envelope theorem its
derivative by any parameter of the curve is −nᵀ ∂(curve)/∂p at the foot, n the unit vector from foot
to point, whatever coordinate along the curve is held fixed. Left out: several measured coordinates
beside the parameter.

Parameters from measurements: least squares in bounds, and which parameters the data identify.

Residuals r_i(p) = (model − datum)_i/σ_i; minimised is ½ Σ ρ(r_i²) by a trust region that stays
inside the bounds, with the model's Jacobian, in q = ln p where a parameter has a logarithmic scale.
At the minimum, with n data and k free parameters, the covariance of q is s²(JᵀJ)⁻¹, s² = 1 where
the noise is known and RSS/(n − k) where it is estimated; intervals are Student's. A direction of J
by ln p whose singular value is below WEAK of the largest, or whose interval is wider than a factor
e, is not identifiable: the products that the data do identify are reported.

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

    side:     (n,) the side that a foot lies on
    share:    (n,) its position there, 0 … 1
    point:    (n, 2) the feet
    distance: (n,) signed
    normal:   (n, 2) with point − foot = distance × normal, length 1
    """

    side: Index
    share: Array
    point: Array
    distance: Array
    normal: Array


def feet(points: Array, corners: Array) -> Feet:
    """Return the feet of points (n, 2) in their order on a polygon.

    corners: (K + 1, 2) of the polygon, K ≥ 1
    """
    starts = corners[:-1]
    chords = np.diff(corners, axis=0)
    squared_length = np.sum(chords**2, axis=1)
    divisor = np.where(squared_length > 0.0, squared_length, 1.0)
    offset = points[:, None, :] - starts[None, :, :]
    shares = np.clip(np.sum(offset * chords, axis=2) / divisor, 0.0, 1.0)
    squared_distance = np.sum((offset - shares[:, :, None] * chords) ** 2, axis=2)
    side = _in_order(squared_distance)
    rows = np.arange(len(points))
    share = shares[rows, side]
    foot = starts[side] + share[:, None] * chords[side]
    across = points - foot
    distance = np.sqrt(squared_distance[rows, side])

    left_normals = np.stack([-chords[:, 1], chords[:, 0]], axis=1)
    length = np.maximum(np.linalg.norm(left_normals, axis=1), np.finfo(float).tiny)
    left_normals /= length[:, None]
    # at a corner the neighbouring side is as near as the side itself
    neighbour = np.clip(side + (share == 1.0) - (share == 0.0), 0, len(chords) - 1)
    left_of_both = np.sum(across * (left_normals[side] + left_normals[neighbour]), axis=1)
    sign = np.where(left_of_both >= 0.0, 1.0, -1.0)
    size = np.maximum(np.max(np.abs(points), axis=1), np.sqrt(np.max(squared_length)))
    is_on_polygon = distance <= 1e-12 * size
    divisor = np.where(is_on_polygon, 1.0, sign * distance)
    normal = np.where(is_on_polygon[:, None], left_normals[side], across / divisor[:, None])
    return Feet(side, share, foot, sign * distance, normal)


def _in_order(cost: Array) -> Index:
    """Return (n,) sides of least sum of costs (n, K) that never go back."""
    n, K = cost.shape
    total = cost[0]
    previous_side = np.zeros((n, K), dtype=np.intp)
    for i in range(1, n):
        smallest = np.minimum.accumulate(total)
        sets_minimum = np.concatenate([[True], total[1:] < smallest[:-1]])
        # the latest side that set the minimum
        previous_side[i] = np.maximum.accumulate(np.where(sets_minimum, np.arange(K), 0))
        total = smallest + cost[i]
    side = np.empty(n, dtype=np.intp)
    side[-1] = int(np.argmin(total))
    for i in range(n - 1, 0, -1):
        side[i - 1] = previous_side[i, side[i]]
    return side


Flags = NDArray[np.bool_]
Model = Callable[[Array], tuple[Array, Array]]
"""p (k,) to the residuals (n,) in units of their noise and ∂r/∂p (n, k)."""

LEVEL = 0.95
"""Probability of an interval."""
WEAK = 1e-3
"""Singular value, relative to the largest, below which a direction is not identifiable."""
WIDE = 1.0
"""Half width of the interval in ln p above which a direction is not identifiable either."""
ROUNDING = 1e-8
"""Singular value, relative to the largest, that is rounding of derivatives.

The parameters along it have no variance at all.
"""
MAX_EVALUATIONS = 200
"""Largest number of evaluations from one start."""
AT_BOUND = 1e-6
"""Distance from a bound, relative to the range, within which a parameter lies on it."""
SAME = 1e-3
"""Difference in q, relative to the range, up to which two minima are the same."""
TOGETHER = 0.1
"""Change of all predictions, in standard deviations, up to which two minima are the same."""
PROBABLE = 0.05
"""p-value of Σr² from which on a fit is consistent with the stated noise."""


@dataclass(frozen=True, eq=False)
class Box:
    """Bounds of k parameters: low, high (k,), and which are fitted by their logarithm."""

    low: Array
    high: Array
    log: Flags

    def inner(self, p: Array) -> Array:
        """Return q of p."""
        logarithm = np.log(np.where(self.log, p, 1.0))
        return np.where(self.log, logarithm, p)

    def outer(self, q: Array) -> Array:
        """Return p of q, inside the bounds to the bit."""
        exponential = np.exp(np.where(self.log, q, 0.0))
        return np.clip(np.where(self.log, exponential, q), self.low, self.high)

    def rate(self, p: Array) -> Array:
        """Return dp/dq."""
        return np.where(self.log, p, 1.0)

    @property
    def span(self) -> Array:
        """Range of q."""
        return self.inner(self.high) - self.inner(self.low)

    def starts(self, first: Array, count: int, seed: int) -> list[Array]:
        """Return the first start and count − 1 further ones, a Latin hypercube in q."""
        low = self.inner(self.low)
        high = self.inner(self.high)
        sampler = stats.qmc.LatinHypercube(len(first), rng=np.random.default_rng(seed))
        positions = sampler.random(max(0, count - 1))
        return [first, *(self.outer(low + position * (high - low)) for position in positions)]


@dataclass(frozen=True, eq=False)
class Minimum:
    """A local minimum of ½Σρ.

    p:           (k,) parameters
    residual:    (n,);  jacobian: (n, k) ∂r/∂p
    costs:       ½Σρ whenever it was lower than before
    evaluations: of the model
    prior:       (d, k) derivatives by q of further terms that are minimised beside the data
    weight:      of these terms, where the data choose it
    numbers:     effective degrees of freedom, None where there are no further terms
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
        """The smallest ½Σρ."""
        return self.costs[-1]


def minimise(
    model: Model,
    start: Array,
    box: Box,
    loss: Literal["linear", "soft_l1"] = "linear",
    prior: int = 0,
) -> Minimum:
    """Return the minimum that a start leads to. Exceptions of the model pass through.

    prior: number of residuals at the end that are not measurements: the loss does not act on them
    """
    low = box.inner(box.low)
    span = box.span
    margin = 1e-9
    costs: list[float] = []

    @cache
    def evaluated(z: bytes) -> tuple[Array, Array, Array]:
        p = box.outer(low + np.frombuffer(z) * span)
        residual, jacobian = model(p)
        cost = 0.5 * float(np.sum(_rho(residual**2, loss, prior)[0]))
        if not costs or cost < costs[-1]:
            costs.append(cost)
        return p, residual, jacobian

    def residual_at(z: Array) -> Array:
        return evaluated(z.tobytes())[1]

    def jacobian_at(z: Array) -> Array:
        p, _, jacobian = evaluated(z.tobytes())
        return jacobian * box.rate(p) * span

    result = optimize.least_squares(
        residual_at,
        np.clip((box.inner(start) - low) / span, margin, 1.0 - margin),
        jac=jacobian_at,
        bounds=(0.0, 1.0),  # its norms of steps must not depend on units
        method="trf",
        x_scale="jac",
        loss="linear" if loss == "linear" else lambda z: _rho(z, loss, prior),
        # a few hundredths of a standard error; distances to a polygon have small steps in their
        # slope
        ftol=1e-5,
        xtol=1e-6,
        gtol=1e-10,
        max_nfev=MAX_EVALUATIONS,
    )
    count = evaluated.cache_info().misses
    p, residual, jacobian = evaluated(result.x.tobytes())
    return Minimum(p, residual, jacobian, tuple(costs), count, np.zeros((0, len(start))))


def _rho(z: Array, loss: str, prior: int) -> Array:
    """Return (3, n) ρ(z) of squared residuals z and its first two derivatives.

    ρ = z for the last `prior` of them.
    """
    root = np.sqrt(1.0 + z)
    soft = np.stack([2.0 * (root - 1.0), 1.0 / root, -0.5 / root**3])
    linear = np.stack([z, np.ones_like(z), np.zeros_like(z)])
    is_prior = np.arange(len(z)) >= len(z) - prior
    is_linear = np.full(len(z), loss == "linear") | is_prior
    return np.where(is_linear, linear, soft)


def misfit(residual: Array, loss: str) -> float:
    """Return Σ ρ(r²), Σ r² for a linear loss."""
    return float(np.sum(_rho(residual**2, loss, 0)[0]))


def different(minima: Sequence[Minimum], box: Box, known_noise: bool) -> list[list[Minimum]]:
    """Return the minima, the lowest first, each with all those that are the same."""
    groups: list[list[Minimum]] = []
    for minimum in sorted(minima, key=lambda minimum: minimum.cost):
        for group in groups:
            if _same(group[0], minimum, box, known_noise):
                group.append(minimum)
                break
        else:
            groups.append([minimum])
    return groups


def _same(first: Minimum, second: Minimum, box: Box, known_noise: bool) -> bool:
    """Return whether two minima lie together, or predict the same.

    The latter is so along a combination of parameters that is not identifiable.
    """
    difference = (box.inner(second.p) - box.inner(first.p)) / box.span
    if np.max(np.abs(difference)) <= SAME:
        return True
    n, k = first.jacobian.shape
    J = first.jacobian * box.rate(first.p) * box.span
    sigma = np.linalg.svd(J, compute_uv=False)
    noise = 1.0
    if not known_noise:
        noise = float(np.linalg.norm(first.residual)) / np.sqrt(max(n - k, 1))
    tolerance = max(TOGETHER * noise, ROUNDING * sigma[0])
    if not float(np.linalg.norm(second.residual - first.residual)) <= tolerance:
        return False
    is_flat = float(np.linalg.norm(J @ difference)) <= tolerance
    return bool(is_flat or sigma[-1] <= WEAK * sigma[0])


def uncertainty(
    minimum: Minimum, box: Box, groups: Sequence[NDArray[np.intp]], known_noise: bool
) -> dict[str, Any]:
    """Return covariance, intervals, identifiability, and whether the model has the data's shape.

    groups:      residuals of one curve each, in the order of the data, for the runs of their signs
    known_noise: whether residuals are in units of a noise that is known

    With a prior P of the minimum the covariance is s²(JᵀJ + PᵀP)⁻¹.

    By name, as in the file of a fit:
    covariance:            (k, k) of q; NaN for parameters on a bound and where JᵀJ is singular
    standard_error:        (k,) of p
    interval:              (k, 2)
    at_bound:              (k,)
    singular_value:        (k,) of J by ln p (by p/start where p has no logarithm), falling
    singular_vector:       (k, k) its right singular vectors, one per row
    weak:                  number of the last of them that are not identifiable
    chi_square:            Σr²
    degrees_of_freedom:    n − k
    fit_probability:       p-value of Σr² with the stated noise (NaN if estimated)
    runs:                  of signs of the residuals
    runs_probability:      p-value of as few or fewer
    information_criterion: Akaike's, corrected for few data (AICc): of two models of the same data
                           the lower is better
    """
    p = minimum.p
    residual = minimum.residual
    n = len(residual)
    k = len(p)
    by_q = minimum.jacobian * box.rate(p)
    low = box.inner(box.low)
    high = box.inner(box.high)
    q = box.inner(p)
    at_bound = np.minimum(q - low, high - q) <= AT_BOUND * (high - low)
    free = np.flatnonzero(~at_bound)
    count = float(k) if minimum.numbers is None else minimum.numbers
    freedom = n - int(np.ceil(count))
    chi_square = float(residual @ residual)
    variance = 1.0 if known_noise else chi_square / max(freedom, 1)

    by_ln_p = by_q * np.where(box.log, 1.0, np.abs(p))
    _, sigma, vectors = np.linalg.svd(by_ln_p, full_matrices=False)
    student = float(stats.t.ppf(0.5 + 0.5 * LEVEL, max(freedom, 1)))
    is_wide = student * np.sqrt(variance) > WIDE * sigma
    is_weak = (sigma < WEAK * sigma[0]) | is_wide
    covariance = np.full((k, k), np.nan)
    if len(free):
        J = np.concatenate([by_q, minimum.prior])[:, free]
        covariance[np.ix_(free, free)] = variance * _inverse(J)
    error = np.sqrt(np.diagonal(covariance))
    half_width = student * error
    with np.errstate(over="ignore"):
        lower = np.where(box.log, p * np.exp(-half_width), p - half_width)
        upper = np.where(box.log, p * np.exp(half_width), p + half_width)

    runs, runs_probability = _runs([residual[group] for group in groups])
    if known_noise:
        fit_probability = float(stats.chi2.sf(chi_square, max(freedom, 1)))
        likelihood = chi_square
    else:
        fit_probability = float("nan")
        likelihood = n * float(np.log(max(chi_square, 1e-300) / n))
    count += not known_noise
    penalty = 2.0 * count + 2.0 * count * (count + 1) / max(n - count - 1, 1)
    return {
        "covariance": covariance,
        "standard_error": error * box.rate(p),
        "interval": np.stack([lower, upper], axis=1),
        "at_bound": at_bound,
        "singular_value": sigma,
        "singular_vector": vectors,
        "weak": int(np.count_nonzero(is_weak)) if minimum.numbers is None else 0,
        "chi_square": chi_square,
        "degrees_of_freedom": np.int32(freedom),
        "fit_probability": fit_probability,
        "runs": np.int32(runs),
        "runs_probability": runs_probability,
        "information_criterion": likelihood + penalty,
    }


def settled(statistics: Mapping[str, Any]) -> bool:
    """Return whether no further start can change the result of a fit.

    Σr² is consistent with a known noise and every parameter is identified.
    """
    is_probable = statistics["fit_probability"] >= PROBABLE
    has_errors = np.all(np.isfinite(statistics["standard_error"]))
    return bool(is_probable and statistics["weak"] == 0 and has_errors)


def _inverse(J: Array) -> Array:
    """Return (JᵀJ)⁻¹ of J (n, k).

    It is NaN for parameters with a part in a direction along which J is 0 but for rounding.
    """
    size = np.linalg.norm(J, axis=0)
    scaled = J / np.where(size > 0.0, size, 1.0)
    _, sigma, vectors = np.linalg.svd(scaled, full_matrices=False)
    is_null = sigma <= ROUNDING * sigma[0]
    kept_vectors = vectors[~is_null]
    inverse = (kept_vectors.T / sigma[~is_null] ** 2) @ kept_vectors / np.outer(size, size)
    has_null_part = np.any(np.abs(vectors[is_null]) > np.sqrt(ROUNDING), axis=0)
    is_singular = has_null_part | (size == 0.0)
    inverse[is_singular] = np.nan
    inverse[:, is_singular] = np.nan
    return np.asarray(inverse)


def _runs(curves: Sequence[Array]) -> tuple[int, float]:
    """Return the runs of signs of all curves, and the p-value of as few or fewer."""
    count = 0
    mean = 0.0
    variance = 0.0
    for residual in curves:
        is_above = residual > 0.0
        above = int(np.count_nonzero(is_above))
        below = int(np.count_nonzero(residual <= 0.0))
        n = above + below
        count += 1 + int(np.count_nonzero(np.diff(is_above)))
        mean += 1.0 + 2.0 * above * below / n
        variance += 2.0 * above * below * (2.0 * above * below - n) / (n**2 * max(n - 1, 1))
    if not variance > 0.0:
        return count, float("nan")
    return count, float(stats.norm.cdf((count + 0.5 - mean) / np.sqrt(variance)))


def product(direction: Array, names: Sequence[str]) -> str:
    """Return a direction in ln p as the product of powers that grows along it.

    Examples: tau_s·delta, E·alpha^-0.5.
    """
    powers = direction / direction[np.argmax(np.abs(direction))]
    factors = []
    for name, power in zip(names, powers, strict=True):
        if abs(power) >= 0.05:
            exponent = round(float(power), 2)
            factors.append(name if exponent == 1.0 else f"{name}^{exponent:g}")
    return "·".join(factors)
