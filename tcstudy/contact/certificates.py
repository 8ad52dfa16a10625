"""Proofs that a solution v of a contact problem is unique, or a strict or global minimum.

Uniqueness:      ω < λ₁ makes L̃ strictly convex. Otherwise every solution lies in a box (below).
                 Two solutions v, w in it have (v−w)ᵀ(Ã + C diag b′_min)(v−w) ≤ 0 with the least
                 slopes of b on the box. If that matrix is positive definite there is only one.
Strict minimum:  A_FF + C b′ ≻ 0 on the free nodes, and every other node sticks on an up-jump with
                 left < 0 < right.
Global minimum:  L̃(w) − L̃(v) ≥ ½ (w−v)ᵀ(Ã − C diag D)(w−v) − Σ (ξ_i − c_i ζ_i)(w_i − v_i), with D
                 as below and ζ the element of b̂(v) nearest to ξ/c. If Ã − C diag(D + μ) ⪰ 0, no
                 point of the box, and so no point at all, has an energy below
                 L̃(v) − ‖ξ/c − ζ‖²/(2μ) in the norm weighted by c. This difference is
                 `energy_gap`, the square of rounding.

Every flag is one-sided: True is proved, False means "not certified". Positive definiteness is
decided by Cholesky with the diagonal lowered by μ = margin·λ₁. μ is never less than the rounding of
the factorisation, so that the proof holds in floating-point arithmetic too. Where Ã has lost more
digits than that to stiff springs or materials, it is taken softer by its relative error. Left out:
interval arithmetic (the inclusion residual of v enters through `energy_gap` only), and branch and
bound for what is not certified.

For many points at once few factorisations decide which of many matrices Ã + C diag(s_r − μ) are
positive definite. Steps d ← |Ã⁻¹|(w d) with w = C(μ − s)₊ ≥ 0 of all rows at once go to the
direction in which Ã resists w least. Each costs two products. A row with
dᵀ(Ã + C diag(s − μ))d ≤ 0 is refuted. One with |Ã⁻¹|(w d) < d for a d > 0 is proved: the spectral
radius of Ã⁻¹w is then below 1 (Collatz, Wielandt). One or two of 100 rows are left open.

D bounds how far j bends below its tangent at a solution, on a box that holds all solutions:

D_i = sup over s in [low_i, high_i] of 2 [j(v_i) + ζ_i (s − v_i) − j(s)] / (s − v_i)²

with ζ_i ∈ b̂(v_i), so that j(s) ≥ j(v_i) + ζ_i (s − v_i) − ½ D_i (s − v_i)² there. The sum over
the nodes gives L̃(w) − L̃(v) ≥ ½ (w−v)ᵀ(Ã − C diag D)(w−v) for every w in the box.

On a linear piece the quotient is a parabola in 1/(s − v_i), and its largest value has a closed
form. An exponential piece is cut into parts. On each part b is bounded from below by a line through
its value at the near end (the tangent where b is convex, the chord where it is concave), while j at
the near end is exact. A smaller b makes the quotient larger, so the result is an upper bound of
D_i, too large by O(part length²).

The box: every solution satisfies v = Ã⁻¹(l̃ − Cζ) with ζ_i ∈ b̂(v_i). A box for v gives an interval
for ζ, and that gives a better box. The iteration starts from what the energy allows. All bounds are
widened by the rounding of the inverse, so that a box is never too small.
"""

from __future__ import annotations

from dataclasses import dataclass, fields, is_dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tcstudy.contact.newton import factor_free, slopes
from tcstudy.contact.problem import (
    PROOF_MARGIN,
    CondensedBody,
    ContactProblem,
    least_lowered,
    pivot_shift,
    trusted_share,
)
from tcstudy.contact.solution import Acceptance, extended
from tcstudy.laws.laws import Laws
from tcstudy.laws.pieces import DOWN, UP

Array = NDArray[np.float64]
Index = NDArray[np.intp]
Flags = NDArray[np.bool_]

EPS = float(np.finfo(float).eps)
"""Rounding of a double, relative."""
FIRST_PARTS = 6
"""Parts of an exponential piece in a first try, which proves most of what can be proved."""
PARTS = 48
"""Parts of an exponential piece in the careful bound."""
_DECAY_LENGTHS = 16.0
"""Decay lengths of an exponential piece that the parts cover; one more part takes the rest."""
_BEND_ROUNDINGS = 64.0
"""Roundings of j by which every D is enlarged."""
_MAX_BOX_ROUNDS = 30
"""Most rounds in which a box is improved."""
_MIN_SHRINKAGE = 0.01
"""Part of its size by which a box must shrink in a round to be improved again."""


def bends_below_tangent(
    laws: Laws, v: Array, zeta: Array, low: Array, high: Array, parts: int = PARTS
) -> tuple[Array, Array]:
    """Return (upper, lower) bounds of D_i for slips between low and high (…, m) [Pa/m].

    They are inf where v_i sits on a down-jump.

    zeta:  elements of b̂(v), exactly b(v) off the kinks [Pa]
    parts: of an exponential piece
    """
    law = np.broadcast_to(laws.index, v.shape).ravel()
    to_right = _BendBound(laws.tables, law, v.ravel(), zeta.ravel())
    to_right.walk(high.ravel(), parts)
    to_left = _BendBound(laws.tables.mirrored, law, -v.ravel(), -zeta.ravel())
    to_left.walk(-low.ravel(), parts)
    upper = np.maximum(to_right.upper, to_left.upper).reshape(v.shape)
    lower = np.maximum(to_right.lower, to_left.lower).reshape(v.shape)
    return upper, lower


class _BendBound:
    """Bounds of the quotient D for s > v, gathered while n nodes walk from v to the right.

    tables, law:  the laws, and which of them each node has
    slip:         where the nodes are [m]
    gap:          j(v) + ζ(s − v) − j(s) there [Pa·m]
    size:         largest traction passed, on which rounding depends [Pa]
    upper, lower: bounds of the sup of the quotient so far, −∞ before the first step [Pa/m]
    """

    def __init__(self, tables: Laws, law: Index, v: Array, zeta: Array) -> None:
        self.tables = tables
        self.law = law
        self.v = v
        self.zeta = zeta
        self.slip = v.copy()
        self.gap = np.zeros(len(v))
        self.size = np.abs(zeta)
        self.upper = np.full(len(v), -np.inf)
        self.lower = np.full(len(v), -np.inf)

    def walk(self, high: Array, parts: int) -> None:
        """Go on to the slips `high`, piece after piece and part after part of exponential ones."""
        tables = self.tables
        place = tables.locate(self.v, self.law)
        first = place.piece + place.on
        for column in range(tables.q.shape[1]):
            piece = tables.first[self.law] + column
            end = np.minimum(tables.upper.take(piece), high)
            active = np.flatnonzero((first <= piece) & (self.slip < end))
            is_bent = tables.bent.take(piece[active])
            for nodes, count in ((active[~is_bent], 1), (active[is_bent], parts)):
                if not len(nodes):
                    continue
                stretch = end[nodes] - self.slip[nodes]
                for width in _part_widths(tables, piece[nodes], stretch, count):
                    self._advance(nodes, piece[nodes], width)
                self.slip[nodes] = end[nodes]

    def _advance(self, nodes: Index, piece: Index, width: Array) -> None:
        """Move nodes by `width` along their pieces, and bound the quotient on the way."""
        slip = self.slip[nodes]
        start = self.v[nodes]
        zeta = self.zeta[nodes]
        value = self.tables.value(slip, piece)
        slope = self.tables.slope(slip, piece)
        is_start = slip == start
        moves = width > 0.0
        excess = np.where(is_start, start_excess(value, zeta), zeta - value)
        self.size[nodes] = np.maximum(self.size[nodes], np.abs(value))
        noise = _BEND_ROUNDINGS * EPS * self.size[nodes]

        distance = slip - start
        slope_below = self._slope_below(slip, piece, width, value, slope)
        largest = quotient(self.gap[nodes], excess, slope_below, distance, width)
        # at v itself the quotient is a limit, without rounding
        largest += np.divide(noise, distance, out=np.zeros(len(nodes)), where=distance > 0.0)
        largest = np.where(moves, largest, -np.inf)
        self.upper[nodes] = np.maximum(self.upper[nodes], largest)

        end = slip + width
        self.gap[nodes] += width * zeta - self.tables.piece_integral(piece, slip, end)
        self.slip[nodes] = end
        distance = end - start
        is_known = (distance > 0.0) & np.isfinite(distance)
        at_end = np.full(len(nodes), -np.inf)
        reached_gap = 2.0 * (self.gap[nodes] - noise * distance)
        with np.errstate(invalid="ignore"):
            np.divide(reached_gap, distance**2, out=at_end, where=is_known)
        at_start = np.where(is_start & (excess == 0.0) & moves, -slope, -np.inf)
        self.lower[nodes] = np.maximum(self.lower[nodes], np.maximum(at_start, at_end))

    def _slope_below(
        self, slip: Array, piece: Index, width: Array, value: Array, slope: Array
    ) -> Array:
        """Return slopes of lines from b(slip) that lie below b on the next `width`."""
        is_concave = self.tables.concave.take(piece)
        if not np.any(is_concave):
            return slope
        moves = width > 0.0
        rise = self.tables.value(slip + width, piece) - value
        chord = rise / np.where(moves, width, 1.0)
        return np.where(is_concave & moves, np.minimum(chord, slope), slope)


def _part_widths(tables: Laws, piece: Index, width: Array, count: int) -> list[Array]:
    """Return widths of the parts of stretches of pieces, narrow on the side where b changes fast.

    Of two exponentials the slower one has parts of its own behind those of the faster.
    """
    if count == 1:
        return [width]
    rates = []
    for a, r in tables.exponentials:
        rates.append(np.where(a.take(piece) != 0.0, r.take(piece), 0.0))
    grows = np.where(rates[0] != 0.0, rates[0], rates[-1]) < 0.0
    with np.errstate(divide="ignore"):
        decayed = [np.minimum(width, _DECAY_LENGTHS / np.abs(rate)) for rate in rates]
    parts = []
    covered = np.zeros(len(width))
    for reach in np.sort(decayed, axis=0):
        parts += [(reach - covered) / count] * count
        covered = reach
    parts.append(width - covered)
    pairs = zip(parts, reversed(parts), strict=True)
    return [np.where(grows, from_end, from_start) for from_start, from_end in pairs]


def start_excess(value: Array, zeta: Array) -> Array:
    """Return ζ − b(v + 0) at v itself: 0 inside a piece, negative on an up-jump.

    Rounding above 0 is removed.
    """
    excess = zeta - value
    size = np.maximum(np.abs(zeta), np.abs(value))
    rounding = _BEND_ROUNDINGS * EPS * size
    return np.where(np.abs(excess) <= rounding, np.minimum(excess, 0.0), excess)


def quotient(gap: Array, excess: Array, slope: Array, distance: Array, width: Array) -> Array:
    """Return sup over 0 < w ≤ width of 2 (gap + excess w − ½ slope w²)/(distance + w)².

    It is a parabola in 1/(distance + w). Where its vertex is too far away for a double it is at
    infinity, beyond the width.
    """
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        at_v = np.where(excess > 0.0, np.inf, 2.0 * excess / width - slope)
        gap_at_v = gap - excess * distance - 0.5 * slope * distance**2
        vertex = -2.0 * gap_at_v / (excess + slope * distance) - distance
        inner_vertex = np.clip(np.nan_to_num(vertex), 0.0, width)
        largest = np.full(len(gap), -np.inf)
        for w in (np.zeros(len(gap)), width, inner_vertex):
            value = 2.0 * (gap + w * (excess - 0.5 * slope * w)) / (distance + w) ** 2
            largest = np.maximum(largest, value)
    return np.where(distance == 0.0, at_v, largest)


def solution_boxes(rows: ContactProblem, spread: Array | None = None) -> tuple[Array, Array]:
    """Return (low, high), (R, m) each: every solution of a row lies between them [m].

    spread: (R, m) by how much the loads may differ from those of the rows, 0 by default [N/m]

    Ã⁻¹ of an interval is Ã⁻¹ of its middle and |Ã⁻¹| of its radius: two products a round. Rows that
    stop shrinking drop out. At a ray the traction is bounded by what the box allows.
    """
    body = rows.body
    c = body.c
    load_size = np.abs(rows.l_tilde)
    load_norm = np.sqrt((rows.l_tilde / c) ** 2 @ c)
    if spread is not None:
        load_size = load_size + spread
        load_norm = load_norm + np.sqrt((spread / c) ** 2 @ c)
    push_of_law = largest_push(rows.law)
    push = np.max(push_of_law[rows.law.index], axis=1)
    lambda_1 = trusted_share(body.A_error) * body.lambda_1
    high = energy_reach(load_norm[:, None], push[:, None], c, lambda_1)
    low = -high
    absolute_inverse = np.abs(body.inverse)
    frictionless = rows.l_tilde @ body.inverse
    if rows.law.has_rays:
        low, high = _boxes_of_openings(rows, frictionless, low, high, spread)
    active = np.arange(len(high))
    for _ in range(_MAX_BOX_ROUNDS):
        old_low, old_high = low[active], high[active]
        spread_of_rows = None if spread is None else spread[active]
        laws = rows.law.of_nodes(active)
        least, largest = value_range(laws.without_rays, old_low, old_high)
        if laws.has_rays:
            pressure = largest_pressure(rows.take(active), old_low, old_high, spread_of_rows)
            is_on_ray = laws.is_closed & (old_low <= laws.admissible(old_low))
            least = np.where(is_on_ray, np.minimum(least, -pressure), least)
        middle = c * (0.5 * (largest + least))
        radius = c * (0.5 * (largest - least))
        if spread_of_rows is not None:
            radius = radius + spread_of_rows
        # rounding goes through the same product: row sums of |Ã⁻¹| would be far too much for
        # slender bodies
        rounding = body.rounding * (load_size[active] + np.abs(middle) + radius)
        reach = (radius + rounding) @ absolute_inverse
        centre = frictionless[active] - middle @ body.inverse
        low[active] = np.maximum(old_low, centre - reach)
        new_high = np.minimum(old_high, centre + reach)
        high[active] = np.maximum(new_high, low[active])

        moved = np.maximum(low[active] - old_low, old_high - high[active])
        shrinkage = np.max(moved, axis=1, initial=0.0)
        old_size = np.max(old_high - old_low, axis=1, initial=0.0)
        active = active[shrinkage > _MIN_SHRINKAGE * old_size]
        if not len(active):
            break
    return low, high


def _boxes_of_openings(
    rows: ContactProblem, frictionless: Array, low: Array, high: Array, spread: Array | None
) -> tuple[Array, Array]:
    """Return boxes (R, m) between the ends of the domains, and those of the energy by node.

    Where no law pushes, vᵀÃv ≤ l̃ᵀv: v is in an ellipsoid about half the frictionless solution.
    """
    body = rows.body
    if not np.any(largest_push(rows.law)[rows.law.index]):
        change = np.zeros(low.shape) if spread is None else spread
        absolute_inverse = np.abs(body.inverse)
        work = np.einsum("ri,ri->r", rows.l_tilde, frictionless)
        spread_work = np.einsum("ri,ri->r", change @ absolute_inverse, change)
        norm = np.sqrt(np.maximum(work, 0.0)) + np.sqrt(spread_work)
        compliance = np.sqrt(np.maximum(np.diagonal(body.inverse), 0.0))
        reach = 0.5 * (norm[:, None] * compliance + change @ absolute_inverse)
        size = (np.abs(rows.l_tilde) + change) @ absolute_inverse
        reach = (1.0 + 1e-6) * reach + (1e-6 + body.rounding) * size
        low = np.maximum(low, 0.5 * frictionless - reach)
        high = np.minimum(high, 0.5 * frictionless + reach)
    low = rows.law.admissible(low)
    return low, np.maximum(low, high)


def largest_pressure(
    rows: ContactProblem, low: Array, high: Array, spread: Array | None = None
) -> Array:
    """Return bounds (R, m) of −ξ_i/c_i for points of boxes whose node i is on its ray [Pa].

    −ξ_i = Ã_ii v_i + Σ_{j≠i} Ã_ij v_j − l̃_i, and v_i is the ray's slip.
    """
    A = rows.body.A_tilde
    diagonal = np.diagonal(A)
    off_diagonal = A - np.diag(diagonal)
    end = rows.law.admissible(np.full(low.shape, -np.inf))
    at_ray = diagonal * np.where(np.isfinite(end), end, 0.0)
    pull = high @ np.maximum(off_diagonal, 0.0) + low @ np.minimum(off_diagonal, 0.0)
    size = np.maximum(np.abs(low), np.abs(high)) @ np.abs(A) + np.abs(rows.l_tilde)
    rounding = 4.0 * (rows.m + 8) * EPS * size
    if spread is not None:
        rounding = rounding + spread
    return np.asarray((at_ray + pull - rows.l_tilde + rounding) / rows.c)


def energy_reach(load: float | Array, push: float | Array, c: Array, lambda_1: float) -> Array:
    """Return how far from 0 the energy allows solutions to be, (m,) or (R, m) [m].

    With B = sup −sign(s) b(s) a solution has λ₁‖v‖² ≤ vᵀÃv = vᵀ(l̃ − Cζ) ≤ (‖l̃/c‖ + B‖1‖)‖v‖ in
    the norm weighted by c.

    load, push: ‖l̃/c‖ and B, numbers or (R, 1)
    """
    norm = load + push * np.sqrt(c.sum())
    return np.asarray((1.0 + 1e-6) * norm / lambda_1 / np.sqrt(c))


def value_range(laws: Laws, low: Array, high: Array) -> tuple[Array, Array]:
    """Return (least, largest) value of the filled graph of b on [low, high] (shape of low) [Pa]."""
    law = laws.index
    least_at_low, largest_at_low = laws.interval(low)
    least_at_high, largest_at_high = laws.interval(high)
    least = np.minimum(least_at_low, least_at_high)
    largest = np.maximum(largest_at_low, largest_at_high)
    columns = (extremes.T for extremes in _extremes(laws.tables))
    for slip_of_law, below_of_law, above_of_law in zip(*columns, strict=True):
        slip = slip_of_law[law]
        is_inside = (low <= slip) & (slip <= high)
        if np.any(is_inside):
            np.minimum(least, below_of_law[law], out=least, where=is_inside)
            np.maximum(largest, above_of_law[law], out=largest, where=is_inside)
    return least, largest


def _extremes(tables: Laws) -> tuple[Array, Array, Array]:
    """Return (L, n) slips where b̂ may be extreme, and its (least, largest) value there.

    They are the kinks, and where b′, which is monotone on a piece, vanishes inside one. Slips are
    NaN where a law has fewer.
    """
    if "extremes" not in tables.facts:
        turns = _turns(tables)
        b = tables.value(turns, tables.addresses)
        least_at_kinks = np.minimum(tables.b_left, tables.b_right)
        largest_at_kinks = np.maximum(tables.b_left, tables.b_right)
        has_turn = np.any(~np.isnan(turns), axis=0)
        is_used = np.append(np.ones(tables.kinks.shape[1], dtype=bool), has_turn)
        pairs = (tables.kinks, turns), (least_at_kinks, b), (largest_at_kinks, b)
        joined = [np.concatenate(pair, axis=1) for pair in pairs]
        tables.facts["extremes"] = tuple(columns[:, is_used] for columns in joined)
    return tables.facts["extremes"]


def _turns(tables: Laws) -> Array:
    """Return (L, K+1) slips where b′ vanishes inside a piece, NaN in pieces where it does not."""
    turns = np.full(tables.q.shape, np.nan)
    reach = far(tables)[:, None]
    piece = tables.addresses
    low = np.clip(tables.lower, -reach, reach)
    high = np.clip(tables.upper, -reach, reach)
    rises_at_low = tables.slope(low, piece) > 0.0
    rises_at_high = tables.slope(high, piece) > 0.0
    has_turn = tables.bent & (low < high) & (rises_at_low != rises_at_high)
    for place in zip(*np.nonzero(has_turn), strict=True):
        # imported here, because every run imports this module and few laws turn
        from scipy.optimize import brentq

        ends = low[place], high[place]
        tolerance = np.finfo(float).tiny
        turns[place] = brentq(tables.slope, *ends, piece[place], xtol=tolerance)
    return turns


def least_slopes(laws: Laws, low: Array, high: Array) -> Array:
    """Return inf (b(s₁) − b(s₂))/(s₁ − s₂) over [low, high] (shape of low) [Pa/m].

    It is −∞ with a down-jump in the interval. b′ is monotone on a piece: the least is at an end of
    the interval or beside a kink in it.
    """
    tables, law = laws.tables, laws.index
    place_low, place_high = laws.locate(low), laws.locate(high)
    slope_at_low = laws.slope(low, place_low.piece + place_low.on)
    slope_at_high = laws.slope(high, place_high.piece)
    least = np.minimum(slope_at_low, slope_at_high)
    slopes_at_left_ends, slopes_at_right_ends = tables.end_slopes
    before, after = slopes_at_right_ends[:, :-1], slopes_at_left_ends[:, 1:]
    beside = np.where(tables.kinds == DOWN, -np.inf, np.minimum(before, after))
    for kink_of_law, slope_of_law in zip(tables.kinks.T, beside.T, strict=True):
        kink = kink_of_law[law]
        is_inside = (low <= kink) & (kink <= high)
        np.minimum(least, slope_of_law[law], out=least, where=is_inside)
    return least


def largest_push(laws: Laws) -> Array:
    """Return (L,) sup over s of −sign(s) b(s), at least 0 [Pa].

    Friction may push the slip on with so much traction. It is finite by (15). A law with a ray has
    slips to one side alone, and on its ray no slip.
    """
    if laws.has_rays:
        return _push_off_kinks(laws.tables)
    reach = far(laws)
    zero = np.zeros(len(reach))
    all_laws = laws.tables.at(np.arange(len(reach)))
    least, _ = value_range(all_laws, zero, reach)
    _, largest = value_range(all_laws, -reach, zero)
    return np.maximum(0.0, np.maximum(-least, largest))


def _push_off_kinks(tables: Laws) -> Array:
    """Return (L,) the largest push of laws of which some have rays, jumps at 0 left out [Pa]."""
    reach = far(tables)[:, None]
    push = np.zeros(len(reach))
    for sign in (1.0, -1.0):
        bounds = np.sort([np.zeros(reach.shape), sign * reach], axis=0)
        low = np.clip(tables.lower, *bounds)
        high = np.clip(tables.upper, *bounds)
        turns = np.clip(np.nan_to_num(_turns(tables)), low, high)
        is_side = (low < high) & ~tables.outside
        for s in (low, high, turns):
            against = np.where(is_side, -sign * tables.value(s, tables.addresses), 0.0)
            push = np.maximum(push, np.max(against, axis=1))
    return push


def far(laws: Laws) -> Array:
    """Return (L,) slips beyond which a law has no kink and its exponentials have decayed [m]."""
    tables = laws.tables
    kinks = np.where(np.isfinite(tables.kinks), np.abs(tables.kinks), 0.0)
    decays = np.zeros(tables.q.shape)
    np.divide(40.0, tables.rate, out=decays, where=tables.rate > 0.0)
    return np.asarray(2.0 * np.max(kinks, axis=1) + np.max(decays, axis=1))


@dataclass(frozen=True, eq=False)
class Certificate:
    """Proved properties of one solution, or (P,) of P solutions.

    A flag that is False means "not certified", not the opposite.

    residual:        inclusion residual of v; above the tolerance only `convex` and `unique` are set
    lambda_1, omega: uniqueness threshold of the body and maximum softening slope of the law [Pa/m]
                     (method §5)
    lambda_1_error:  relative error of λ₁; above 1e-6 every proof takes the body softer by that
    margin:          λ_min(C^{−½}ÃC^{−½} − diag ω_i) with the maximum softening slope of every
                     node's law, λ₁ − ω where all have one law [Pa/m]; positive if every load has
                     one solution, −∞ with a down-jump
    convex:          margin > 0: one solution for every load
    unique:          one solution for this load (convex, or convex on the box of all solutions)
    strict_minimum:  v is a strict local minimum of L̃
    global_minimum:  no point has an energy below L̃(v) − energy_gap
    energy_gap:      what rounding in v leaves open [J/m]; nan if not certified
    """

    residual: Any
    lambda_1: Any
    lambda_1_error: Any
    omega: Any
    margin: Any
    convex: Any
    unique: Any
    strict_minimum: Any
    global_minimum: Any
    energy_gap: Any


def certify(
    problem: ContactProblem,
    v: Array,
    lambda_1: float | None = None,
    tolerance: float | None = None,
    inverse: Array | None = None,
    residual: float | None = None,
) -> Certificate:
    """Return the certificate of the solution v (m,).

    lambda_1:  λ₁ if known (it depends on the body only); its error then is `A_error`
    tolerance: largest inclusion residual of a solution, None for the default of scene/study.py
    inverse:   Ã⁻¹ if known (it depends on the body only)
    residual:  inclusion residual if known better than from v in double precision
    """
    error = problem.A_error
    if lambda_1 is None:
        lambda_1, error = problem.lambda_1, problem.lambda_1_error
    if residual is None:
        residual = extended(problem, v).residual
    loose = None if lambda_1 > 0.0 else True
    body = CondensedBody.known(
        problem.A_tilde,
        problem.c,
        error,
        problem.blocks,
        lambda_1=lambda_1,
        inverse=inverse,
        loose=loose,
    )
    rows = ContactProblem.on(body, problem.l_tilde, problem.law).rows
    certificates = certify_rows(rows, v[None], tolerance, np.array([residual]))
    return row_of(certificates, 0)


def certify_rows(
    rows: ContactProblem, v: Array, tolerance: float | None = None, residual: Array | None = None
) -> Certificate:
    """Return the certificates of solutions v (R, m), one of each row.

    residual: (R,) inclusion residuals, by default those in double precision
    """
    proofs = Proofs(rows)
    if residual is None:
        residual = rows.inclusion_residual(v)
    solved = Acceptance(tolerance).accepts(residual, rows.xi_rounding(v))
    proofs.prove_lowest(np.flatnonzero(solved), v)
    return proofs.certificate(v, residual, solved)


class Proofs:
    """What is proved about rows of problems: `unique` before they are solved, then `lowest`.

    convex, unique, lowest: (R,) flags, as of a Certificate; `lowest` is for solutions that are not
                            unique
    low, high:              (R, m) boxes of all solutions of rows that are not convex [m]
    omega, margin:          (R,) as of a Certificate [Pa/m]

    enabled: False if nothing is to be proved
    """

    def __init__(self, rows: ContactProblem, enabled: bool = True) -> None:
        body, count = rows.body, len(rows.l_tilde)
        self.rows, self.enabled = rows, enabled
        self.convex, self.unique, self.lowest = np.zeros((3, count), dtype=bool)
        self.low, self.high = np.zeros((2, count, body.m))
        if enabled:
            self._prove_convex()
            self._prove_unique()

    def _prove_convex(self) -> None:
        """Prove that rows have one solution whatever their load."""
        body, law = self.rows.body, self.rows.law
        share = trusted_share(body.A_error)
        self.omega = law.omega_by_row
        with np.errstate(invalid="ignore"):  # of no nodes
            self.margin = share * body.lambda_1 - self.omega
        max_omega = (1.0 - PROOF_MARGIN) * share * body.lambda_1
        self.convex = (self.omega < max_omega) | (body.m == 0)
        has_laws_by_node = law.index.shape[1] > 1
        if has_laws_by_node and not body.loose:
            # an eigenvalue for rows with the same slopes serves all of them
            falls, row = np.unique(law.falls[law.index], axis=0, return_inverse=True)
            least = [least_lowered(share * body.A_tilde, body.c, omega) for omega in falls]
            self.margin = np.array(least)[row.reshape(-1)]
            self.convex |= self.margin > body.shift

    def _prove_unique(self) -> None:
        """Prove that rows have one solution for their load."""
        body = self.rows.body
        self.unique = self.convex.copy()
        open_rows = np.flatnonzero(~self.convex)
        if len(open_rows) and not body.loose:
            rows = self.rows.take(open_rows)
            low, high = solution_boxes(rows)
            self.low[open_rows], self.high[open_rows] = low, high
            slopes_of_box = least_slopes(rows.law, low, high)
            if rows.law.has_rays:  # a node that cannot leave its ray is fixed
                slopes_of_box = np.where(low < high, slopes_of_box, _rigid_slope(body))
            self.unique[open_rows] = definite(body, slopes_of_box)

    def prove_lowest(self, points: Index, v: Array) -> None:
        """Prove that solutions v (R, m) of these points, unless unique, are global minima."""
        points = points[~self.unique[points]]
        if self.enabled and len(points) and not self.rows.body.loose:
            rows = self.rows.take(points)
            low, high = self.low[points], self.high[points]
            self.lowest[points] = global_minimum(rows, v[points], low, high)

    def certificate(self, v: Array, residual: Array, solved: Flags) -> Certificate:
        """Return what is proved about the points v (R, m).

        solved: (R,) which of them are solutions; of others only `convex` and `unique` are proved
        """
        rows, body = self.rows, self.rows.body
        unique = self.unique
        lowest = solved & (unique | self.lowest)
        strict = lowest.copy()  # a proved global minimum is a strict one
        open_rows = np.flatnonzero(solved & ~lowest)
        if len(open_rows):
            strict[open_rows] = strict_minimum(rows.take(open_rows), v[open_rows])
        energy_gap = np.full(len(v), np.nan)
        if body.loose:
            # without softening L̃ is convex: a solution is a global minimum, alone if it is strict
            lowest = solved & (self.omega == 0.0)
            unique = lowest & strict
        elif body.m:
            distance = rows.take(np.flatnonzero(lowest)).distance(v[lowest])
            energy_gap[lowest] = distance**2 @ body.c / (2.0 * body.shift)
        return Certificate(
            residual=residual,
            lambda_1=np.full(len(v), body.lambda_1),
            lambda_1_error=np.full(len(v), body.A_error),
            omega=self.omega,
            margin=self.margin,
            convex=self.convex,
            unique=unique,
            strict_minimum=strict,
            global_minimum=lowest,
            energy_gap=energy_gap,
        )


def row_of(record: Any, row: int) -> Any:
    """Return one row of a record of rows, which may hold None or such records.

    Its single numbers are those of Python.
    """
    if is_dataclass(record) and not isinstance(record, type):
        values: dict[str, Any] = {}
        for field in fields(record):
            values[field.name] = row_of(getattr(record, field.name), row)
        return type(record)(**values)
    if record is None:
        return None
    value = record[row]
    return value.item() if isinstance(value, np.generic) else value


def as_row(record: Any) -> Any:
    """Return a record as a record of one row."""
    if is_dataclass(record) and not isinstance(record, type):
        values: dict[str, Any] = {}
        for field in fields(record):
            values[field.name] = as_row(getattr(record, field.name))
        return replace(record, **values)
    return None if record is None else np.asarray(record)[None]


def positive_definite(
    problem: ContactProblem, slope: Array, lambda_1: float, named: Index | None = None
) -> bool:
    """Return whether Ã + C diag(slope − μ) is positive definite on the named nodes.

    named: all by default
    """
    nodes = np.arange(problem.m, dtype=np.intp) if named is None else named
    shift = pivot_shift(problem.A_tilde, problem.c, lambda_1)
    lowered = problem.c[nodes] * (slope - shift) / trusted_share(problem.A_error)
    is_possible = np.all(np.diagonal(problem.A_tilde)[nodes] + lowered > 0.0)
    return bool(is_possible) and factor_free(problem.A_tilde, nodes, lowered)[1] == 0


# -- of many points at once ------------------------------------------------------------------------


_MAX_STEPS = 4
"""Most steps of all rows towards directions that prove or refute them."""
_MIN_ENTRY = 1e-9
"""Least part of the largest entry of such a direction that an entry has, since all must be > 0."""


def definite(body: CondensedBody, slope: Array) -> Flags:
    """Return (R,) whether Ã + C diag(slope − μ) ≻ 0 is proved, for rows of slopes (R, m) [Pa/m]."""
    proved = np.zeros(len(slope), dtype=bool)
    if body.m == 0:
        return ~proved
    tiny = np.finfo(float).tiny
    diagonal = body.c * (slope - body.shift) / trusted_share(body.A_error)
    has_positive_diagonal = np.diagonal(body.A_tilde) + diagonal > 0.0
    open_rows = np.flatnonzero(np.all(has_positive_diagonal, axis=1))
    absolute_inverse = np.abs(body.inverse)
    slack = body.rounding * absolute_inverse.sum(axis=1)
    added = diagonal[open_rows]
    weight = np.maximum(-added, 0.0)
    d = np.ones(added.shape)
    for _ in range(_MAX_STEPS):
        pushed = weight * d
        image = pushed @ absolute_inverse
        rounding = np.max(pushed, axis=1, initial=0.0)[:, None] * slack
        is_proved = np.all(image + rounding < d, axis=1)
        proved[open_rows[is_proved]] = True
        largest = np.maximum(np.max(image, axis=1), tiny)
        d = np.maximum(image / largest[:, None], _MIN_ENTRY)
        elastic = np.einsum("ri,ri->r", d, d @ body.A_tilde)
        is_open = ~is_proved & (elastic + np.einsum("ri,ri->r", added, d * d) > 0.0)
        open_rows, added = open_rows[is_open], added[is_open]
        weight, d = weight[is_open], d[is_open]
    nodes = np.arange(body.m)
    for row in open_rows:
        _, info = factor_free(body.A_tilde, nodes, diagonal[row])
        proved[row] = info == 0
    return proved


def _rigid_slope(body: CondensedBody) -> float:
    """Return the slope of a rigid support, for bounds that are infinite [Pa/m]."""
    return float(1e6 * np.max(np.diagonal(body.A_tilde) / body.c))


def global_minimum(rows: ContactProblem, v: Array, low: Array, high: Array) -> Flags:
    """Return (R,) whether v is proved to be a global minimum.

    A few parts of exponential pieces prove most rows, and lower bounds of D refute most others. In
    the rows that are left, nodes whose bounds lie apart are bounded again with more parts.

    low, high: the boxes of all solutions
    """
    law, body = rows.law, rows.body
    zeta = np.clip(rows.xi(v) / body.c, *law.interval(v))
    low, high = np.minimum(low, v), np.maximum(high, v)
    parts = PARTS if law.piecewise_linear else FIRST_PARTS
    upper, lower = bends_below_tangent(law, v, zeta, low, high, parts)
    rigid = _rigid_slope(body)
    upper = np.where(np.isneginf(upper), -rigid, upper)  # the node cannot leave its ray
    proved = np.all(np.isfinite(upper), axis=1)
    open_rows = np.flatnonzero(proved)
    proved[open_rows] = definite(body, -upper[open_rows])
    if parts == PARTS:
        return proved

    open_rows = open_rows[~proved[open_rows]]
    open_rows = open_rows[definite(body, -np.maximum(lower[open_rows], -rigid))]
    row, node = np.nonzero(lower[open_rows] < upper[open_rows])
    row = open_rows[row]
    law_of_node = np.broadcast_to(law.index, v.shape)[row, node][:, None]
    arguments = (values[row, node][:, None] for values in (v, zeta, low, high))
    careful_upper, _ = bends_below_tangent(law.at(law_of_node), *arguments)
    upper[row, node] = careful_upper[:, 0]
    proved[open_rows] = definite(body, -upper[open_rows])
    return proved


def strict_minimum(rows: ContactProblem, v: Array) -> Flags:
    """Return (R,) whether the second-order test proves v, sufficient but not necessary.

    Nodes that stick without slack count as free. A node at the end of a rising piece that is narrow
    is inside it if its traction is: slips do not resolve such a piece.
    """
    body, law = rows.body, rows.law
    xi = rows.xi(v)
    first_order = slopes(rows, v, xi)
    place = first_order.at
    size = np.diagonal(body.A_tilde) * np.abs(v) + np.abs(xi)
    noise = 1e3 * EPS * size
    is_on_up_jump = law.kind(place) == UP
    sticks = is_on_up_jump & (first_order.left < -noise) & (first_order.right > noise)
    left_piece, right_piece = place.piece, place.piece + place.on
    left_slope, right_slope = law.slope(v, left_piece), law.slope(v, right_piece)
    least_slope = np.minimum(left_slope, right_slope)
    if law.has_narrow_pieces:
        for piece in (left_piece, right_piece):
            low, high = (body.c * b for b in law.end_values(piece))
            has_traction_inside = (low < xi - noise) & (xi + noise < high)
            is_inside = place.on & law.narrow(piece) & has_traction_inside
            least_slope = np.where(is_inside, law.slope(v, piece), least_slope)
    added = body.c * (least_slope - body.shift) / trusted_share(body.A_error)
    proved = ~np.any(first_order.jump & ~is_on_up_jump, axis=1)
    for row in np.flatnonzero(proved):
        free = np.flatnonzero(~sticks[row])
        _, info = factor_free(body.A_tilde, free, added[row, free])
        proved[row] = info == 0
    return proved
