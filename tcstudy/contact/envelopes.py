"""Moreau envelopes of friction laws: laws whose b falls nowhere faster than κ, from below and as close as can be.

j_κ(s) = conv(j + ½κ s²)(s) − ½κ s²,  b_κ = j_κ′ (Rockafellar & Wets, Variational Analysis, 1.44; the Lasry–Lions or
double envelope). j_κ ≤ j, j_κ grows with κ to j, and b_κ is b except on common tangents [s₁, s₂], where b_κ = σ − κ s:

    b(s₁) + κ s₁ = σ = b(s₂) + κ s₂,   ∫_{s₁}^{s₂} (σ − κ s − b) ds = 0      (equal areas, as Maxwell's rule has it)

Up-jumps stay, down-jumps and steep falls become falls of slope −κ. With κ ≤ λ₁ the problem with b_κ is convex, and its
least energy is a lower bound of the original one.

b′ is monotone on a piece, so that b + κ s rises on one part of it at most: an arc of j + ½κ s² that the envelope may
touch, as it may touch a kink. As the lower hull of points is made by a monotone chain, arcs are joined from left to
right, and one that the tangent to the next passes below is left out.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from tcstudy.laws.laws import Laws
from tcstudy.laws.pieces import DOWN

_STEPS = 80
"""To a slip of known slope, to a common tangent, to where b′ = −κ."""
_ROUNDING = 4.0 * float(np.finfo(float).eps)
_CONTINUOUS = 1e-8
"""Jumps of an envelope below this part of the scale of b come from unfinished tangents."""


def moreau_envelopes(laws: Laws, kappa: float) -> Laws:
    """The tables of b_κ; κ > 0 [Pa/m]. Laws that nowhere fall faster than κ stay as they are."""
    tables, numbers, rows = laws.tables, np.stack(laws.tables.pieces, axis=-1), list[tuple[Numbers, list[Numbers]]]()
    for row, falls in enumerate(tables.falls > kappa):
        count = int(np.count_nonzero(np.isfinite(tables.kinks[row])))
        own = tables.kinks[row, :count].tolist(), numbers[row, : count + 1].tolist()
        down = (tables.kinds[row, :count] == DOWN).tolist()
        rows.append(_envelope(*own, down, float(tables.scales[row]), kappa) if falls else own)
    width = max(1, *(len(kinks) for kinks, _ in rows))
    kinks, columns = np.full((len(rows), width), np.inf), np.empty((len(rows), width + 1, numbers.shape[2]))
    for row, (ends, pieces) in enumerate(rows):
        kinks[row, : len(ends)], columns[row, : len(pieces)], columns[row, len(pieces) :] = ends, pieces, pieces[-1]
    found = Laws(tables.name, kinks, *np.moveaxis(columns, -1, 0).copy()).known(scales=tables.scales)
    return found.smooth_to(_CONTINUOUS * tables.scales[:, None]).at(laws.index)


def on_tangent(envelopes: Laws, kappa: float, s: np.ndarray) -> np.ndarray:
    """Whether slips lie inside a common tangent."""
    at = envelopes.locate(s)
    return ~at.on & (envelopes.q.take(at.piece) == -kappa) & ~envelopes.bent.take(at.piece)


class _Arc(NamedTuple):
    """Where h = j + ½κ s² is convex on a piece, with h′ at both ends; a kink is an arc of no length."""

    piece: int
    low: float
    high: float
    first: float
    last: float


Numbers = list[float]


def _envelope(
    kinks: Numbers, pieces: list[Numbers], down: list[bool], scale: float, kappa: float
) -> tuple[Numbers, list[Numbers]]:
    """Kinks and pieces of b_κ of one law; down: which of its kinks are jumps down."""
    exponentials = [[(a, r) for a, r in zip(own[3::2], own[4::2], strict=True) if a] for own in pieces]
    offset = [0.0]

    def slopes(k: int, s: float) -> tuple[float, float]:
        """h′ = b + κ s and h″ on a piece."""
        s_0, b_0, q = pieces[k][:3]
        first, second = b_0 + q * (s - s_0) + kappa * s, q + kappa
        for a, r in exponentials[k]:
            decay = a * math.exp(-r * (s - s_0))
            first, second = first + decay, second - r * decay
        return first, second

    def height(k: int, s: float) -> float:
        """h, beside the offset of the piece."""
        s_0, b_0, q = pieces[k][:3]
        decays = sum(-a / r * math.expm1(-r * (s - s_0)) for a, r in exponentials[k])
        return (s - s_0) * (b_0 + 0.5 * q * (s - s_0)) + decays + 0.5 * kappa * s * s

    def touches(arc: _Arc, sigma: float) -> float:
        """Where h′ = σ on an arc, or its end on that side."""
        k, low, high, first, last = arc
        if sigma <= first or low == high:
            return low
        if sigma >= last:
            return high
        if not exponentials[k]:
            return low + (sigma - first) / (pieces[k][2] + kappa)
        s = 0.5 * (low + high)
        for _ in range(_STEPS):
            first, second = slopes(k, s)
            low, high = (low, s) if first > sigma else (s, high)
            step = (sigma - first) / second if second > 0.0 else math.inf
            following = s + step if low < s + step < high else 0.5 * (low + high)
            if abs(following - s) <= _ROUNDING * abs(s):
                break
            s = following
        return s

    def tangent(left: _Arc, right: _Arc) -> tuple[float, float, float]:
        """(s₁, s₂, σ) of the common tangent, where ∫ h′ − σ between, which falls with σ, is 0; no tangent at a join."""
        if left.high == right.low and not down[right.piece - 1]:
            return left.high, right.low, left.last
        sigma, below, above = 0.5 * (left.last + right.first), -math.inf, math.inf
        for _ in range(_STEPS):
            x, y = touches(left, sigma), touches(right, sigma)
            terms = offset[right.piece] - offset[left.piece], height(right.piece, y), -height(left.piece, x)
            rest = sum(terms) - sigma * (y - x)
            below, above = (sigma, above) if rest > 0.0 else (below, sigma)
            step = rest / (y - x) if y > x else math.copysign(math.inf, rest)
            following = sigma + step if below <= sigma + step <= above else 0.5 * (below + above)
            if abs(following - sigma) <= _ROUNDING * (abs(sigma) + kappa * (abs(x) + abs(y))):
                break
            sigma = following
        return x, y, sigma

    for k, s in enumerate(kinks):
        offset.append(offset[k] + height(k, s) - height(k + 1, s))
    decay = max((40.0 / abs(r) for own in exponentials for _, r in own), default=0.0)
    reach = 2.0 * max(map(abs, kinks), default=0.0) + decay + 4.0 * scale / kappa
    arcs = list[_Arc]()
    for k, (low, high) in enumerate(zip([-reach, *kinks], [*kinks, reach], strict=True)):
        begins, ends = slopes(k, low)[1] > 0.0, slopes(k, high)[1] > 0.0
        x, y = low, high
        for _ in range(_STEPS if begins != ends else 0):
            middle = 0.5 * (x + y)
            x, y = (middle, y) if (slopes(k, middle)[1] > 0.0) == begins else (x, middle)
        if not begins and k and not (arcs and arcs[-1].high == low):
            arcs.append(_Arc(k, low, low, slopes(k - 1, low)[0], slopes(k, low)[0]))
        if begins or ends:
            low, high = (low if begins else y), (high if ends else x)
            arcs.append(_Arc(k, low, high, slopes(k, low)[0], slopes(k, high)[0]))
    chain, leaves = [(arcs[0], -math.inf, -math.inf)], Numbers()  # arcs, where they are landed on, with which slope
    for arc in arcs[1:]:
        x, y, sigma = tangent(chain[-1][0], arc)
        while len(chain) > 1 and sigma < chain[-1][2]:
            chain.pop()
            leaves.pop()
            x, y, sigma = tangent(chain[-1][0], arc)
        leaves.append(x)
        chain.append((arc, y, sigma))
    starts, found, end = Numbers(), list[Numbers](), -math.inf
    for (arc, land, sigma), leave in zip(chain, [*leaves, math.inf], strict=True):
        if land > end:
            near = end if abs(end) <= abs(land) else land
            starts.append(end)
            found.append([near, sigma - kappa * near, -kappa, *[0.0] * (len(pieces[0]) - 3)])
        if leave > land:
            starts.append(land)
            found.append(pieces[arc.piece])
        end = leave
    return starts[1:], found
