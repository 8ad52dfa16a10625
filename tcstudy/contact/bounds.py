"""How far j bends below its tangent at a solution, on a box that holds all solutions: what certificates are made of.

D_i = sup over s in [low_i, high_i] of 2 [j(v_i) + ζ_i (s − v_i) − j(s)] / (s − v_i)²,  ζ_i ∈ b̂(v_i), so that
j(s) ≥ j(v_i) + ζ_i (s − v_i) − ½ D_i (s − v_i)² there. Summed over the nodes:
L̃(w) − L̃(v) ≥ ½ (w−v)ᵀ(Ã − C diag D)(w−v) for every w in the box.

On a linear piece the quotient is a parabola in 1/(s − v_i): its largest value is known in closed form. An exponential
piece is cut into parts; on each b is bounded from below by a line through its value at the near end (the tangent
where b is convex, the chord where it is concave), while j at the near end is exact. A smaller b makes the
quotient larger, so the result is an upper bound of D_i, too large by O(part length²).

The box: every solution satisfies v = Ã⁻¹(l̃ − Cζ) with ζ_i ∈ b̂(v_i), so a box for v gives an interval for ζ and that
gives a better box; the iteration starts from what the energy allows. All bounds are widened by the rounding of the
inverse, so that a box is never too small.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from tcstudy.contact.problem import ContactProblem, kept
from tcstudy.laws.laws import Laws
from tcstudy.laws.pieces import DOWN

Array = NDArray[np.float64]
Index = NDArray[np.intp]

FEW, PARTS = 6, 48
"""Parts of an exponential piece: for a first try, which proves most of what can be proved, and of the careful bound."""
_ROUNDS, _SHRINKS = 30, 0.01
"""Improvements of a box at most, and by which part of its size one must shrink it."""
_STEPS = 80
"""To the zero of a function."""
_DECAY, _ROUNDINGS = 16.0, 64.0
"""Decay lengths that the parts cover (one more takes the rest), and roundings of j by which every D is enlarged."""


def bends_below_tangent(
    laws: Laws, v: Array, zeta: Array, low: Array, high: Array, parts: int = PARTS
) -> tuple[Array, Array]:
    """(upper, lower) bounds of D_i for slips between low and high (…, m) [Pa/m]; inf where v_i sits on a down-jump.

    zeta:  elements of b̂(v), exactly b(v) off the kinks [Pa]
    parts: of an exponential piece
    """
    tables, law = laws.tables, np.broadcast_to(laws.index, v.shape).ravel()
    flat = v.ravel(), zeta.ravel(), low.ravel(), high.ravel()
    right = _one_side(tables, law, flat[0], flat[1], flat[3], parts)
    left = _one_side(tables.mirrored, law, -flat[0], -flat[1], -flat[2], parts)
    upper, lower = (np.maximum(one, other).reshape(v.shape) for one, other in zip(right, left, strict=True))
    return upper, lower


def _one_side(tables: Laws, law: Index, v: Array, zeta: Array, high: Array, parts: int) -> tuple[Array, Array]:
    """(upper, lower) bounds of the sup of the quotient over s ∈ (v, high], −∞ where that is empty; law: of every v.

    Nodes go from v to the right, part after part of their pieces, with the gap j(v) + ζ(s − v) − j(s) there.
    """
    begin = tables.locate(v, law)
    first = begin.piece + begin.on
    at, gap, size = v.copy(), np.zeros(len(v)), np.abs(zeta)
    upper, lower = np.full((2, len(v)), -np.inf)

    def advance(nodes: Index, piece: Index, width: Array) -> None:
        x, start, value_and_slope = at[nodes], v[nodes], tables.value_and_slope(at[nodes], piece)
        value, slope = value_and_slope
        excess = np.where(x == start, start_excess(value, zeta[nodes]), zeta[nodes] - value)
        tangent = np.where((x == start) & (excess == 0.0) & (width > 0.0), -slope, -np.inf)
        concave = tables.concave.take(piece)
        if np.any(concave):
            chord = (tables.value(x + width, piece) - value) / np.where(width > 0.0, width, 1.0)
            slope = np.where(concave & (width > 0.0), np.minimum(chord, slope), slope)
        size[nodes] = np.maximum(size[nodes], np.abs(value))
        noise, distance = _ROUNDINGS * np.finfo(float).eps * size[nodes], x - start
        largest = quotient(gap[nodes], excess, slope, distance, width)
        # at v itself the quotient is a limit, without rounding
        largest += np.divide(noise, distance, out=np.zeros(len(nodes)), where=distance > 0.0)
        upper[nodes] = np.maximum(upper[nodes], np.where(width > 0.0, largest, -np.inf))
        gap[nodes] += width * zeta[nodes] - tables.piece_integral(piece, x, x + width)
        at[nodes] = x + width
        distance = at[nodes] - start
        known, reached = (distance > 0.0) & np.isfinite(distance), np.full(len(nodes), -np.inf)
        with np.errstate(invalid="ignore"):
            np.divide(2.0 * (gap[nodes] - noise * distance), distance**2, out=reached, where=known)
        lower[nodes] = np.maximum(lower[nodes], np.maximum(tangent, reached))

    for column in range(tables.q.shape[1]):
        piece = tables.first[law] + column
        end = np.minimum(tables.upper.take(piece), high)
        active = ((first <= piece) & (at < end)).nonzero()[0]
        if not len(active):
            continue
        bent = tables.bent.take(piece[active])
        for nodes, count in ((active[~bent], 1), (active[bent], parts)):
            if len(nodes):
                for width in _parts(tables, piece[nodes], end[nodes] - at[nodes], count):
                    advance(nodes, piece[nodes], width)
                at[nodes] = end[nodes]
    return upper, lower


def _parts(tables: Laws, piece: Index, width: Array, count: int) -> list[Array]:
    """Widths of the parts into which [at, at + width] is cut: fine on the side where b changes fast.

    Of two exponentials the slower one has parts of its own behind those of the faster.
    """
    if count == 1:
        return [width]
    rates = [np.where(a.take(piece) != 0.0, r.take(piece), 0.0) for a, r in tables.exponentials]
    grows = np.where(rates[0] != 0.0, rates[0], rates[-1]) < 0.0
    parts, covered = [], np.zeros(len(width))
    with np.errstate(divide="ignore"):
        for fine in np.sort([np.minimum(width, _DECAY / np.abs(rate)) for rate in rates], axis=0):
            parts += [(fine - covered) / count] * count
            covered = fine
    parts.append(width - covered)
    return [np.where(grows, last, first) for first, last in zip(parts, reversed(parts), strict=True)]


def start_excess(value: Array, zeta: Array) -> Array:
    """ζ − b(v + 0) at v itself: 0 inside a piece, negative on an up-jump; rounding above 0 is removed."""
    excess = zeta - value
    rounding = _ROUNDINGS * np.finfo(float).eps * np.maximum(np.abs(zeta), np.abs(value))
    return np.where(np.abs(excess) <= rounding, np.minimum(excess, 0.0), excess)


def quotient(gap: Array, excess: Array, slope: Array, distance: Array, width: Array) -> Array:
    """sup over 0 < w ≤ width of 2 (gap + excess w − ½ slope w²)/(distance + w)², a parabola in 1/(distance + w).

    Where its vertex is too far away for a double it is at infinity, beyond the width.
    """
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        touching = np.where(excess > 0.0, np.inf, 2.0 * excess / width - slope)
        h_0 = gap - excess * distance - 0.5 * slope * distance**2
        vertex = -2.0 * h_0 / (excess + slope * distance) - distance
        apart = np.full(len(gap), -np.inf)
        for w in (np.zeros(len(gap)), width, np.clip(np.nan_to_num(vertex), 0.0, width)):
            value = 2.0 * (gap + w * (excess - 0.5 * slope * w)) / (distance + w) ** 2
            apart = np.maximum(apart, value)
    return np.where(distance == 0.0, touching, apart)


def solution_boxes(rows: ContactProblem) -> tuple[Array, Array]:
    """(low, high), (R, m) each: every solution of a row lies between them [m].

    Ã⁻¹ of an interval is Ã⁻¹ of its middle and |Ã⁻¹| of its radius: two products a round. Rows that shrink no more
    drop out.
    """
    body, c, size = rows.body, rows.body.c, np.abs(rows.l_tilde)
    push = np.max(largest_push(rows.law)[rows.law.index], axis=1)
    load = np.sqrt((rows.l_tilde / c) ** 2 @ c)
    high = energy_reach(load[:, None], push[:, None], c, kept(body.A_error) * body.lambda_1)
    low, absolute, answer, at = -high, np.abs(body.inverse), rows.l_tilde @ body.inverse, np.arange(len(high))
    for _ in range(_ROUNDS):
        own_low, own_high = low[at], high[at]
        least, largest = value_range(rows.law.of_nodes(at), own_low, own_high)
        middle, radius = c * (0.5 * (largest + least)), c * (0.5 * (largest - least))
        # what rounding adds goes through the same product: row sums of |Ã⁻¹| would be far too much for slender bodies
        reach = (radius + body.rounding * (size[at] + np.abs(middle) + radius)) @ absolute
        centre = answer[at] - middle @ body.inverse
        low[at] = np.maximum(own_low, centre - reach)
        high[at] = np.maximum(np.minimum(own_high, centre + reach), low[at])
        gain = np.max(np.maximum(low[at] - own_low, own_high - high[at]), axis=1, initial=0.0)
        at = at[gain > _SHRINKS * np.max(own_high - own_low, axis=1, initial=0.0)]
        if not len(at):
            break
    return low, high


def energy_reach(load: float | Array, push: float | Array, c: Array, lambda_1: float) -> Array:
    """How far from 0 the energy allows solutions to be (m,), or (R, m) with ‖l̃/c‖ and push (R, 1) [m].

    With B = sup −sign(s) b(s) a solution has λ₁‖v‖² ≤ vᵀÃv = vᵀ(l̃ − Cζ) ≤ (‖l̃/c‖ + B‖1‖)‖v‖ in the norm weighted by c.
    """
    return np.asarray((1.0 + 1e-6) * (load + push * np.sqrt(c.sum())) / lambda_1 / np.sqrt(c))


def value_range(laws: Laws, low: Array, high: Array) -> tuple[Array, Array]:
    """(least, largest) value of the filled graph of b on [low, high] (shape of low) [Pa]."""
    law, ends = laws.index, [laws.interval(s) for s in (low, high)]
    least, largest = np.minimum(ends[0][0], ends[1][0]), np.maximum(ends[0][1], ends[1][1])
    for s, below, above in zip(*(x.T for x in _extremes(laws.tables)), strict=True):
        own = s[law]
        inside = (low <= own) & (own <= high)
        if np.any(inside):
            np.minimum(least, below[law], out=least, where=inside)
            np.maximum(largest, above[law], out=largest, where=inside)
    return least, largest


def _extremes(tables: Laws) -> tuple[Array, Array, Array]:
    """(L, n) slips where b̂ may be extreme, NaN for none, and its (least, largest) value there.

    The kinks, and where b′, which is monotone on a piece, vanishes inside one.
    """
    if "extremes" not in tables.facts:
        s, reach, piece = np.full(tables.q.shape, np.nan), far(tables)[:, None], tables.addresses
        low, high = np.clip(tables.lower, -reach, reach), np.clip(tables.upper, -reach, reach)
        rises = [tables.slope(end, piece) > 0.0 for end in (low, high)]
        turns = tables.bent & (low < high) & (rises[0] != rises[1])
        s[turns] = slip_of_slope(tables, piece[turns], low[turns], high[turns], 0.0)
        b, at_kinks = tables.value(s, piece), (tables.b_left, tables.b_right)
        used = np.append(np.ones(tables.kinks.shape[1], dtype=bool), np.any(turns, axis=0))
        found = (tables.kinks, s), (np.minimum(*at_kinks), b), (np.maximum(*at_kinks), b)
        tables.facts["extremes"] = tuple(np.concatenate(pair, axis=1)[:, used] for pair in found)
    return tables.facts["extremes"]


def slip_of_slope(laws: Laws, piece: Index, low: Array, high: Array, slope: Array | float) -> Array:
    """Where b′ of the addressed pieces passes `slope` between low and high, (n,) each."""
    slope, middle = np.broadcast_to(slope, low.shape), 0.5 * (low + high)
    way = np.where(laws.slope(low, piece) > slope, -1.0, 1.0)
    s_0, _, q, a, r, *_ = laws.numbers(piece)
    with np.errstate(divide="ignore", invalid="ignore"):
        start = s_0 - np.log((q - slope) / (r * a)) / r  # of one exponential the slip itself

    def excess(k: Index, s: Array) -> tuple[Array, Array, Array]:
        value = way[k] * (laws.slope(s, piece[k]) - slope[k])
        return value, way[k] * laws.bend(s, piece[k]), np.abs(q[k]) + np.abs(slope[k])

    return rising_zeros(excess, np.where((low < start) & (start < high), start, middle), low, high)


def rising_zeros(
    function: Callable[[Index, Array], tuple[Array, Array, Array]], start: Array, low: Array, high: Array
) -> Array:
    """(n,) where n rising functions are 0 between low and high, by Newton's method within what is known of each.

    function: (which of them, where) → values, slopes, and the sizes of what values are made of, whose rounding ends it
    """
    found, open_ = start.copy(), np.arange(len(start))
    for _ in range(_STEPS):
        if not len(open_):
            break
        s = found[open_]
        value, slope, size = function(open_, s)
        low, high = np.where(value < 0.0, s, low), np.where(value < 0.0, high, s)
        following = s - value / np.where(slope > 0.0, slope, np.nan)
        following = np.where((low <= following) & (following <= high), following, 0.5 * (low + high))
        on = (np.abs(value) > 4.0 * np.finfo(float).eps * size) & (following != s)
        open_, low, high = open_[on], low[on], high[on]
        found[open_] = following[on]
    return found


def least_slopes(laws: Laws, low: Array, high: Array) -> Array:
    """inf (b(s₁) − b(s₂))/(s₁ − s₂) over [low, high]: −∞ with a down-jump in it (shape of low) [Pa/m].

    b′ is monotone on a piece: the least is at an end of the interval or beside a kink in it.
    """
    tables, law, ends = laws.tables, laws.index, [laws.locate(s) for s in (low, high)]
    least = np.minimum(laws.slope(low, ends[0].piece + ends[0].on), laws.slope(high, ends[1].piece))
    before, after = tables.end_slopes[1][:, :-1], tables.end_slopes[0][:, 1:]
    beside = np.where(tables.kinds == DOWN, -np.inf, np.minimum(before, after))
    for s, slope in zip(tables.kinks.T, beside.T, strict=True):
        own = s[law]
        np.minimum(least, slope[law], out=least, where=(low <= own) & (own <= high))
    return least


def largest_push(laws: Laws) -> Array:
    """(L,) sup over s of −sign(s) b(s), at least 0: how hard friction may push slip on (finite by (15)) [Pa]."""
    reach = far(laws)
    every = laws.tables.at(np.arange(len(reach)))
    least, _ = value_range(every, np.zeros(len(reach)), reach)
    _, largest = value_range(every, -reach, np.zeros(len(reach)))
    return np.maximum(0.0, np.maximum(-least, largest))


def far(laws: Laws) -> Array:
    """(L,) slip beyond which a law has no kink and its exponentials have decayed [m]."""
    tables = laws.tables
    kinks = np.where(np.isfinite(tables.kinks), np.abs(tables.kinks), 0.0)
    decays = np.divide(40.0, tables.rate, out=np.zeros(tables.q.shape), where=tables.rate > 0.0)
    return np.asarray(2.0 * np.max(kinks, axis=1) + np.max(decays, axis=1))
