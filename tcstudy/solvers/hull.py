"""The proximal hull of a friction law: the law whose b falls nowhere faster than κ, from below and as close as can be.

j_κ(s) = conv(j + ½κ s²)(s) − ½κ s²,  b_κ = j_κ′ (Rockafellar & Wets, Variational Analysis, 1.44; also called the
Lasry–Lions or double envelope). j_κ ≤ j, j_κ grows with κ to j, and b_κ is b except on *bridges* [s₁, s₂], where
b_κ = σ − κ s with the two conditions of a common tangent (equal areas, as Maxwell's rule has it with κ = 0):

    b(s₁) + κ s₁ = σ = b(s₂) + κ s₂,   ∫_{s₁}^{s₂} (σ − κ s − b) ds = 0.

Up-jumps stay, down-jumps and steep falls become falls of slope −κ. With κ ≤ λ₁ the problem with b_κ is convex, and its
least energy is a lower bound of the original one.

The tangents are sought on samples (kinks, and _SAMPLES slips on every piece); then, wherever j + ½κ s² dips below a
bridge, the bottom of the dip becomes a sample, until there is none; at last they are refined on the pieces. A second
dip on one exponential piece may be overlooked; b_κ is a start only, so that this costs quality, never correctness.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from tcstudy.scene.friction import DOWN, FrictionLaw
from tcstudy.solvers.separable.pieces import integral

Array = NDArray[np.float64]
Index = NDArray[np.intp]

_SAMPLES = 8
_REFINEMENTS = 5
_HALVINGS = 12
_PASSES = 30
_DIP = 1e-8
"""Samples on a piece, tangent iterations, samples on an outer piece, each half as far out as the one before, passes
over the samples at most, and the part of its terms below which a dip does not count."""


@lru_cache(maxsize=64)
def proximal_hull(law: FrictionLaw, kappa: float) -> tuple[FrictionLaw, Array]:
    """(law of b_κ, its bridges (n, 2) in growing order); κ > 0 [Pa/m]. Without a bridge the law itself.

    Cached, since a sweep asks for few laws and bodies many times.
    """
    if law.omega <= kappa:
        return law, np.empty((0, 2))
    s, j = law_samples(law, kappa)
    for further in reversed(range(_PASSES)):
        hull = np.array(lower_hull(s.tolist(), (j + 0.5 * kappa * s * s).tolist()))
        first, last, before, after = _bridges(law, kappa, s, hull)
        below = _below(law, kappa, s[first], s[last], s[before], s[after])
        if not (further and len(below)):
            break
        s = np.union1d(s, below)
        j = law.j(s)
    left, right = _refined(law, kappa, first, last, s)
    return _assembled(law, kappa, left, right), np.column_stack([left, right])


@lru_cache(maxsize=64)
def law_samples(law: FrictionLaw, kappa: float) -> tuple[Array, Array]:
    """(s, j(s)), growing: slips at which the hull may touch j, on the outer pieces as far as a bridge may reach.

    That is at kinks where b does not fall and inside pieces. Cached as proximal_hull is.
    """
    reach = 2.0 * law.b_scale / kappa + float(np.max(4.0 / np.abs(law.r[law.r != 0.0]), initial=0.0))
    outer = reach * 0.5 ** np.arange(_HALVINGS)
    part = np.arange(1, _SAMPLES + 1) / (_SAMPLES + 1)
    inner = law.kinks[:-1, None] + np.diff(law.kinks)[:, None] * part
    steep = (law.a[1:-1] == 0.0) & (law.q[1:-1] + kappa <= 0.0)  # concave throughout: the hull cannot touch inside
    held = law.kinks[law.kinds != DOWN]
    inner = np.concatenate([inner[~steep].ravel(), _beside_down_jumps(law, kappa)])
    s = np.unique(np.concatenate([law.kinks[0] - outer, held, inner, law.kinks[-1] + outer]))
    return s, law.j(s)


def _beside_down_jumps(law: FrictionLaw, kappa: float) -> Array:
    """Ends of the bridge over every down-jump by itself, from b's values and slopes there (exact for linear pieces).

    Such a bridge may be far shorter than the distance of two samples.
    """
    down = np.flatnonzero(law.kinds == DOWN)
    kink, fall = law.kinks[down], (law.b_left - law.b_right)[down]
    rise = [np.sqrt(np.maximum(law.slope(kink, down + side) + kappa, 0.0)) for side in (0, 1)]
    with np.errstate(divide="ignore"):
        left, right = (fall / (r * (rise[0] + rise[1])) for r in rise)
    gap = np.diff(np.concatenate([[-np.inf], law.kinks, [np.inf]]))
    fits = (left < gap[down]) & (right < gap[down + 1])
    return np.concatenate([(kink - left)[fits], (kink + right)[fits]])


def lower_hull(x: list[float], height: list[float]) -> list[int]:
    """Vertices of the lower convex hull of the points (x, height), x growing."""
    hull: list[int] = []
    for i in range(len(x)):
        while len(hull) > 1:
            a, b = hull[-2], hull[-1]
            if (height[b] - height[a]) * (x[i] - x[b]) < (height[i] - height[b]) * (x[b] - x[a]):
                break
            hull.pop()
        hull.append(i)
    return hull


def _bridges(law: FrictionLaw, kappa: float, s: Array, hull: Index) -> tuple[Index, Index, Index, Index]:
    """(first, last) sample of every segment of the hull on which b + κ s does not rise, and the vertices beside it.

    Inside a piece on which b + κ s rises the hull is the law itself, however many samples rounding leaves out.
    """
    first, last = hull[:-1], hull[1:]
    piece = law.piece(s[first], +1)
    falls = (law.slope(s[first], piece) + kappa <= 0.0) | (law.slope(s[last], piece) + kappa <= 0.0)
    bridge = (piece != law.piece(s[last], -1)) | falls
    before, after = np.append(hull[0], hull[:-2]), np.append(hull[2:], hull[-1])
    return first[bridge], last[bridge], before[bridge], after[bridge]


def _below(law: FrictionLaw, kappa: float, left: Array, right: Array, before: Array, after: Array) -> Array:
    """Slips where j + ½κ s² lies lowest below the line from left to right, one for each piece that it dips on.

    before, after: how far the line is looked at on either side, since it may cut through the arc that it should touch
    """
    edges = np.unique(np.concatenate([law.kinks, left, right, before, after]))
    line, part = np.nonzero((before[:, None] <= edges[:-1]) & (edges[1:] <= after[:, None]))
    low, high, begin, end = edges[part], edges[part + 1], left[line], right[line]
    piece = law.piece(low, +1)
    middle = 0.5 * (begin + end)
    mean = _mean(law, begin, end)  # b + κ s = σ in terms that do not cancel: b + κ (s − middle) = mean
    s = 0.5 * (low + high)
    for _ in range(1 if law.piecewise_linear else _REFINEMENTS):
        slope = law.slope(s, piece) + kappa
        excess = law.value(s, piece) - mean + kappa * (s - middle)
        s = np.clip(s - np.where(slope > 0.0, excess / np.where(slope > 0.0, slope, 1.0), 0.0), low, high)
    friction, straight = integral(law, begin, s), mean * (s - begin)
    bend = 0.5 * kappa * (s - begin) * (end - s)
    noise = _DIP * (np.abs(friction) + np.abs(straight) + np.abs(bend))
    return np.unique(s[(low < s) & (s < high) & (friction - straight - bend < -noise)])


def _refined(law: FrictionLaw, kappa: float, first: Index, last: Index, s: Array) -> tuple[Array, Array]:
    """(s₁, s₂) of the common tangents, each end kept between the samples beside its own."""
    left, right = s[first], s[last]
    left_range = s[np.maximum(first - 1, 0)], s[np.minimum(first + 1, last)]
    right_range = s[np.maximum(last - 1, first)], s[np.minimum(last + 1, len(s) - 1)]
    for _ in range(_REFINEMENTS):
        sigma = _mean(law, left, right) + 0.5 * kappa * (left + right)
        new_left = np.clip(_tangent(law, kappa, left, sigma), *left_range)
        new_right = np.clip(_tangent(law, kappa, right, sigma), *right_range)
        apart = new_left < new_right
        left, right = np.where(apart, new_left, left), np.where(apart, new_right, right)
    left[1:] = np.maximum(left[1:], right[:-1])  # bridges may meet but not overlap
    kept = left < right
    return left[kept], right[kept]


def _mean(law: FrictionLaw, left: Array, right: Array) -> Array:
    """Mean of b between left and right [Pa]; with ½κ (left + right) it is the slope of the chord of j + ½κ s²."""
    return integral(law, left, right) / (right - left)


def _tangent(law: FrictionLaw, kappa: float, s: Array, sigma: Array) -> Array:
    """One Newton step for b + κ s = σ on the piece at the side of s where the solution lies; s itself on an up-jump."""
    moved = s.copy()
    for side in (-1, 1):
        piece = law.piece(s, side)
        excess = law.value(s, piece) + kappa * s - sigma
        slope = law.slope(s, piece) + kappa
        step = np.where((slope > 0.0) & (side * excess < 0.0), -excess / np.where(slope > 0.0, slope, 1.0), 0.0)
        ends = np.concatenate([[-np.inf], law.kinks, [np.inf]])
        moved = np.where(step != 0.0, np.clip(s + step, ends[piece], ends[piece + 1]), moved)
    return moved


def _assembled(law: FrictionLaw, kappa: float, left: Array, right: Array) -> FrictionLaw:
    """The law that is σ − κ s on the bridges and `law` between them; a bridge hangs on its end nearer to s = 0."""
    own = list(zip(*(x.tolist() for x in (law.s_0, law.b_0, law.q, law.a, law.r)), strict=True))
    after = {float(kink): own[k + 1] for k, kink in enumerate(law.kinks)}
    mean = _mean(law, left, right)
    for s_1, s_2, middle in zip(left.tolist(), right.tolist(), mean.tolist(), strict=True):
        after = {kink: piece for kink, piece in after.items() if not s_1 <= kink < s_2}
        fall = 0.5 * kappa * (s_2 - s_1)
        anchor, value = (s_1, middle + fall) if abs(s_1) <= abs(s_2) else (s_2, middle - fall)
        after[s_1] = (anchor, value, -kappa, 0.0, 0.0)
        after.setdefault(s_2, own[int(law.piece(s_2, +1))])
    kinks = sorted(after)
    pieces = [own[0], *(after[kink] for kink in kinks)]
    columns = (np.array(column) for column in zip(*pieces, strict=True))
    return FrictionLaw(f"proximal hull of {law.name}", np.array(kinks), *columns)
