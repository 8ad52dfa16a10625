"""What can be proved about a solution v of a contact problem: unique, strict local minimum, global
minimum.

Uniqueness:      ω < λ₁ makes L̃ strictly convex. Otherwise every solution lies in a box (below), and two
                 solutions v, w in it have (v−w)ᵀ(Ã + C diag b′_min)(v−w) ≤ 0 with the least slopes
                 of b on the
                 box; if that matrix is positive definite there is only one.
Strict minimum:  A_FF + C b′ ≻ 0 on the free nodes, and every other node rests on an up-jump with left < 0 < right.
Global minimum:  L̃(w) − L̃(v) ≥ ½ (w−v)ᵀ(Ã − C diag D)(w−v) − Σ (ξ_i − c_i ζ_i)(w_i − v_i), D as below and
                 ζ the element of b̂(v) nearest to ξ/c. If Ã − C diag(D + μ) ⪰ 0 no point of the
                 box, so no point
                 at all, has an energy below L̃(v) − ‖ξ/c − ζ‖²/(2μ) in the norm weighted by c:
                 `energy_gap`,
                 rounding squared.

Every flag is one-sided: True is proved, False says "not certified". Positive definiteness is
decided by Cholesky with the diagonal lowered by μ = margin·λ₁ and never by less than the rounding
of the factorisation, so that it holds in floating-point arithmetic too; where Ã has lost more
digits than that to stiff springs or materials, it is taken softer by its relative error. Left out:
interval arithmetic (the inclusion residual of v enters through `energy_gap` only) and branch and
bound for what is not certified.

Of many points at once, which of many matrices Ã + C diag(s_r − μ) are positive definite, with few
factorisations: steps d ← |Ã⁻¹|(w d) with w = C(μ − s)₊ ≥ 0 of all rows at once go to the direction
in which Ã can hold w least, at the price of two products each. A row with dᵀ(Ã + C diag(s − μ))d ≤
0 is refuted; one with |Ã⁻¹|(w d) < d for a d > 0 is proved, for then the spectral radius of Ã⁻¹w is
below 1 (Collatz, Wielandt). Of 100 rows one or two are left open.

How far j bends below its tangent at a solution, on a box that holds all solutions, is

D_i = sup over s in [low_i, high_i] of 2 [j(v_i) + ζ_i (s − v_i) − j(s)] / (s − v_i)²,  ζ_i ∈ b̂(v_i), so that
j(s) ≥ j(v_i) + ζ_i (s − v_i) − ½ D_i (s − v_i)² there. Summed over the nodes:
L̃(w) − L̃(v) ≥ ½ (w−v)ᵀ(Ã − C diag D)(w−v) for every w in the box.

On a linear piece the quotient is a parabola in 1/(s − v_i): its largest value is known in closed
form. An exponential piece is cut into parts; on each b is bounded from below by a line through its
value at the near end (the tangent where b is convex, the chord where it is concave), while j at the
near end is exact. A smaller b makes the quotient larger, so the result is an upper bound of D_i,
too large by O(part length²).

The box: every solution satisfies v = Ã⁻¹(l̃ − Cζ) with ζ_i ∈ b̂(v_i), so a box for v gives an
interval for ζ and that gives a better box; the iteration starts from what the energy allows. All
bounds are widened by the rounding of the inverse, so that a box is never too small.
"""

from __future__ import annotations

from dataclasses import dataclass, fields, is_dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tcstudy.contact.newton import factor_free, slopes
from tcstudy.contact.problem import (
    MARGIN,
    CondensedBody,
    ContactProblem,
    kept,
    least_lowered,
    pivot_shift,
)
from tcstudy.contact.solution import Acceptance, extended
from tcstudy.laws.laws import Laws
from tcstudy.laws.pieces import DOWN, UP

Array = NDArray[np.float64]
Index = NDArray[np.intp]
Flags = NDArray[np.bool_]

FEW, PARTS = 6, 48
"""Parts of an exponential piece: for a first try, which proves most of what can be proved, and of
the careful bound."""
_ROUNDS, _SHRINKS = 30, 0.01
"""Improvements of a box at most, and by which part of its size one must shrink it."""
_DECAY, _ROUNDINGS = 16.0, 64.0
"""Decay lengths that the parts cover (one more takes the rest), and roundings of j by which every D
is enlarged."""


def bends_below_tangent(
    laws: Laws, v: Array, zeta: Array, low: Array, high: Array, parts: int = PARTS
) -> tuple[Array, Array]:
    """(upper, lower) bounds of D_i for slips between low and high (…, m) [Pa/m]; inf where v_i sits
    on a down-jump.

    zeta:  elements of b̂(v), exactly b(v) off the kinks [Pa]
    parts: of an exponential piece
    """
    tables, law = laws.tables, np.broadcast_to(laws.index, v.shape).ravel()
    flat = v.ravel(), zeta.ravel(), low.ravel(), high.ravel()
    right = _one_side(tables, law, flat[0], flat[1], flat[3], parts)
    left = _one_side(tables.mirrored, law, -flat[0], -flat[1], -flat[2], parts)
    upper, lower = (
        np.maximum(one, other).reshape(v.shape) for one, other in zip(right, left, strict=True)
    )
    return upper, lower


def _one_side(
    tables: Laws, law: Index, v: Array, zeta: Array, high: Array, parts: int
) -> tuple[Array, Array]:
    """(upper, lower) bounds of the sup of the quotient over s ∈ (v, high], −∞ where that is empty;
    law: of every v.

    Nodes go from v to the right, part after part of their pieces, with the gap j(v) + ζ(s − v) −
    j(s) there.
    """
    begin = tables.locate(v, law)
    first = begin.piece + begin.on
    at, gap, size = v.copy(), np.zeros(len(v)), np.abs(zeta)
    upper, lower = np.full((2, len(v)), -np.inf)

    def advance(nodes: Index, piece: Index, width: Array) -> None:
        x, start = at[nodes], v[nodes]
        value, slope = tables.value(x, piece), tables.slope(x, piece)
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
    """Widths of the parts into which [at, at + width] is cut: fine on the side where b changes
    fast.

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
    return [
        np.where(grows, last, first) for first, last in zip(parts, reversed(parts), strict=True)
    ]


def start_excess(value: Array, zeta: Array) -> Array:
    """ζ − b(v + 0) at v itself: 0 inside a piece, negative on an up-jump; rounding above 0 is
    removed."""
    excess = zeta - value
    rounding = _ROUNDINGS * np.finfo(float).eps * np.maximum(np.abs(zeta), np.abs(value))
    return np.where(np.abs(excess) <= rounding, np.minimum(excess, 0.0), excess)


def quotient(gap: Array, excess: Array, slope: Array, distance: Array, width: Array) -> Array:
    """sup over 0 < w ≤ width of 2 (gap + excess w − ½ slope w²)/(distance + w)², a parabola in
    1/(distance + w).

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

    Ã⁻¹ of an interval is Ã⁻¹ of its middle and |Ã⁻¹| of its radius: two products a round. Rows that
    shrink no more drop out.
    """
    body, c, size = rows.body, rows.body.c, np.abs(rows.l_tilde)
    push = np.max(largest_push(rows.law)[rows.law.index], axis=1)
    load = np.sqrt((rows.l_tilde / c) ** 2 @ c)
    high = energy_reach(load[:, None], push[:, None], c, kept(body.A_error) * body.lambda_1)
    low, absolute, answer, at = (
        -high,
        np.abs(body.inverse),
        rows.l_tilde @ body.inverse,
        np.arange(len(high)),
    )
    for _ in range(_ROUNDS):
        own_low, own_high = low[at], high[at]
        least, largest = value_range(rows.law.of_nodes(at), own_low, own_high)
        middle, radius = c * (0.5 * (largest + least)), c * (0.5 * (largest - least))
        # what rounding adds goes through the same product: row sums of |Ã⁻¹| would be far too much
        # for slender bodies
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
    """How far from 0 the energy allows solutions to be (m,), or (R, m) with ‖l̃/c‖ and push (R, 1)
    [m].

    With B = sup −sign(s) b(s) a solution has λ₁‖v‖² ≤ vᵀÃv = vᵀ(l̃ − Cζ) ≤ (‖l̃/c‖ + B‖1‖)‖v‖ in
    the norm weighted by c.
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
        for at in zip(*np.nonzero(turns), strict=True):
            from scipy.optimize import (
                brentq,
            )  # here, because every run imports this module, and few laws turn

            s[at] = brentq(tables.slope, low[at], high[at], piece[at], xtol=np.finfo(float).tiny)
        b, at_kinks = tables.value(s, piece), (tables.b_left, tables.b_right)
        used = np.append(np.ones(tables.kinks.shape[1], dtype=bool), np.any(turns, axis=0))
        found = (tables.kinks, s), (np.minimum(*at_kinks), b), (np.maximum(*at_kinks), b)
        tables.facts["extremes"] = tuple(np.concatenate(pair, axis=1)[:, used] for pair in found)
    return tables.facts["extremes"]


def least_slopes(laws: Laws, low: Array, high: Array) -> Array:
    """inf (b(s₁) − b(s₂))/(s₁ − s₂) over [low, high]: −∞ with a down-jump in it (shape of low)
    [Pa/m].

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
    """(L,) sup over s of −sign(s) b(s), at least 0: how hard friction may push slip on (finite by
    (15)) [Pa]."""
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


@dataclass(frozen=True, eq=False)
class Certificate:
    """Proved properties of one solution, or (P,) of P; a flag that is False means "not certified",
    not the opposite.

    residual:        inclusion residual of v; above the tolerance no flag is set except `convex` and `unique`
    lambda_1, omega: uniqueness threshold of the body and steepest fall of the law [Pa/m] (method §5)
    lambda_1_error:  relative error of λ₁; above 1e-6 every proof takes the body softer by that
    margin:          λ_min(C^{−½}ÃC^{−½} − diag ω_i) with the steepest fall of every node's law, λ₁ − ω where all have
                     one law [Pa/m]: positive if every load has one solution; −∞ with a down-jump
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
    """Certificate of the solution v (m,).

    lambda_1:  λ₁ if known (it depends on the body only), whose error then is `A_error`, else it is computed
    tolerance: largest inclusion residual that counts as a solution, None for the default of scene/study.py
    residual:  inclusion residual if known better than from v in double precision, else it is computed
    inverse:   Ã⁻¹ if known (it depends on the body only), else it is computed
    """
    error = problem.lambda_1_error if lambda_1 is None else problem.A_error
    known = problem.lambda_1 if lambda_1 is None else lambda_1
    body = CondensedBody.known(problem.A_tilde, problem.c, error, lambda_1=known, inverse=inverse)
    residual = extended(problem, v).residual if residual is None else residual
    rows = ContactProblem.on(body, problem.l_tilde, problem.law).rows
    return row_of(certify_rows(rows, v[None], tolerance, np.array([residual])), 0)


def certify_rows(
    rows: ContactProblem, v: Array, tolerance: float | None = None, residual: Array | None = None
) -> Certificate:
    """The same of a row each (R, m); residuals (R,) are those in double precision if none are
    given."""
    proofs, residual = Proofs(rows), rows.inclusion_residual(v) if residual is None else residual
    solved = Acceptance(tolerance).accepts(residual, rows.xi_rounding(v))
    proofs.prove_lowest(np.flatnonzero(solved), v)
    return proofs.certificate(v, residual, solved)


class Proofs:
    """What is proved of rows of problems, each flag (R,): `unique` before they are solved, the
    others of solutions.

    asked: False if nothing is to be proved
    """

    def __init__(self, rows: ContactProblem, asked: bool = True) -> None:
        self.rows, self.asked, body, count = rows, asked, rows.body, len(rows.l_tilde)
        self.convex, self.unique, self.lowest = np.zeros((3, count), dtype=bool)
        self.low, self.high = np.zeros((2, count, body.m))
        if not asked:
            return
        share, self.omega = kept(body.A_error), rows.law.omega_by_row
        with np.errstate(invalid="ignore"):  # of no nodes
            self.margin = share * body.lambda_1 - self.omega
        self.convex = (self.omega < (1.0 - MARGIN) * share * body.lambda_1) | (body.m == 0)
        if (
            rows.law.index.shape[1] > 1 and not body.loose
        ):  # laws by node: once for rows of the same falls
            falls, row = np.unique(rows.law.falls[rows.law.index], axis=0, return_inverse=True)
            least = [least_lowered(share * body.A_tilde, body.c, omega) for omega in falls]
            self.margin = np.array(least)[row.reshape(-1)]
            self.convex |= self.margin > body.shift
        self.unique = self.convex.copy()
        open_ = np.flatnonzero(~self.convex)
        if len(open_) and not body.loose:
            rows = self.rows.take(open_)
            self.low[open_], self.high[open_] = low, high = solution_boxes(rows)
            self.unique[open_] = definite(body, least_slopes(rows.law, low, high))

    def prove_lowest(self, points: Index, v: Array) -> None:
        """That solutions v (R, m) of these points, as far as they are not unique, are global
        minima."""
        points = points[~self.unique[points]]
        if self.asked and len(points) and not self.rows.body.loose:
            rows = self.rows.take(points)
            self.lowest[points] = global_minimum(
                rows, v[points], self.low[points], self.high[points]
            )

    def certificate(self, v: Array, residual: Array, solved: Flags) -> Certificate:
        """What is proved about the points, of solutions only beside `convex` and `unique`."""
        rows, body, lowest = self.rows, self.rows.body, solved & (self.unique | self.lowest)
        strict, open_ = lowest.copy(), np.flatnonzero(solved & ~lowest)  # what is lowest is strict
        if len(open_):
            strict[open_] = strict_minimum(rows.take(open_), v[open_])
        lambda_1, error = np.full((2, len(v)), [[body.lambda_1], [body.A_error]])
        gap = np.full(len(v), np.nan)
        if body.m:
            gap[lowest] = (
                rows.take(np.flatnonzero(lowest)).distance(v[lowest]) ** 2
                @ body.c
                / (2.0 * body.shift)
            )
        return Certificate(residual, lambda_1, error, self.omega, self.margin, self.convex, self.unique, strict, lowest,
                           gap)  # fmt: skip


def row_of(record: Any, row: int) -> Any:
    """One row of a record of rows, which may hold None or such records."""
    if is_dataclass(record) and not isinstance(record, type):
        values: dict[str, Any] = {
            field.name: row_of(getattr(record, field.name), row) for field in fields(record)
        }
        return type(record)(**values)
    return None if record is None else record[row]


def as_row(record: Any) -> Any:
    """A record as one row of such."""
    if is_dataclass(record) and not isinstance(record, type):
        values: dict[str, Any] = {
            field.name: as_row(getattr(record, field.name)) for field in fields(record)
        }
        return replace(record, **values)
    return None if record is None else np.asarray(record)[None]


def positive_definite(
    problem: ContactProblem, slope: Array, lambda_1: float, named: Index | None = None
) -> bool:
    """Whether Ã + C diag(slope − μ) is positive definite on the named nodes (all by default)."""
    nodes = np.arange(problem.m, dtype=np.intp) if named is None else named
    shift = pivot_shift(problem.A_tilde, problem.c, lambda_1)
    lowered = problem.c[nodes] * (slope - shift) / kept(problem.A_error)
    possible = np.all(np.diagonal(problem.A_tilde)[nodes] + lowered > 0.0)
    return bool(possible) and factor_free(problem.A_tilde, nodes, lowered)[1] == 0


# -- of many points at once ------------------------------------------------------------------------


_PRODUCTS = 4
"""Steps of all rows towards directions that prove or refute them."""
_LEAST = 1e-9
"""Least part of its largest entry that an entry of such a direction has, since all must be
positive."""


def definite(body: CondensedBody, slope: Array) -> Flags:
    """(R,) whether Ã + C diag(slope − μ) ≻ 0 is proved, for rows of slopes (R, m) [Pa/m]."""
    proved = np.zeros(len(slope), dtype=bool)
    if body.m == 0:
        return ~proved
    diagonal = body.c * (slope - body.shift) / kept(body.A_error)
    rows = np.flatnonzero(np.all(np.diagonal(body.A_tilde) + diagonal > 0.0, axis=1))
    absolute, added = np.abs(body.inverse), diagonal[rows]
    slack, weight, d = (
        body.rounding * absolute.sum(axis=1),
        np.maximum(-added, 0.0),
        np.ones(added.shape),
    )
    for _ in range(_PRODUCTS):
        pushed = weight * d
        held = pushed @ absolute
        sure = np.all(held + np.max(pushed, axis=1, initial=0.0)[:, None] * slack < d, axis=1)
        proved[rows[sure]] = True
        d = np.maximum(
            held / np.maximum(np.max(held, axis=1), np.finfo(float).tiny)[:, None], _LEAST
        )
        squares = np.einsum("ri,ri->r", d, d @ body.A_tilde) + np.einsum("ri,ri->r", added, d * d)
        on = ~sure & (squares > 0.0)
        rows, added, weight, d = rows[on], added[on], weight[on], d[on]
    for row in rows:
        proved[row] = factor_free(body.A_tilde, np.arange(body.m), diagonal[row])[1] == 0
    return proved


def global_minimum(rows: ContactProblem, v: Array, low: Array, high: Array) -> Flags:
    """(R,) whether v is proved to be a global minimum; low, high: the boxes of all solutions.

    A few parts of exponential pieces prove most rows, and lower bounds of D refute most others;
    nodes of what is left whose bounds lie apart are bounded again with more parts.
    """
    zeta = np.clip(rows.xi(v) / rows.body.c, *rows.law.interval(v))
    low, high = np.minimum(low, v), np.maximum(high, v)
    few = PARTS if rows.law.piecewise_linear else FEW
    upper, lower = bends_below_tangent(rows.law, v, zeta, low, high, few)
    proved = np.all(np.isfinite(upper), axis=1)
    open_ = np.flatnonzero(proved)
    proved[open_] = definite(rows.body, -upper[open_])
    if few < PARTS:
        rigid = 1e6 * np.max(np.diagonal(rows.body.A_tilde) / rows.body.c)
        open_ = open_[~proved[open_]]
        open_ = open_[definite(rows.body, -np.maximum(lower[open_], -rigid))]
        row, node = np.nonzero(lower[open_] < upper[open_])
        row = open_[row]
        own_v, own_zeta, own_low, own_high = (x[row, node][:, None] for x in (v, zeta, low, high))
        index = np.broadcast_to(rows.law.index, v.shape)[row, node][:, None]
        again, _ = bends_below_tangent(rows.law.at(index), own_v, own_zeta, own_low, own_high)
        upper[row, node] = again[:, 0]
        proved[open_] = definite(rows.body, -upper[open_])
    return proved


def strict_minimum(rows: ContactProblem, v: Array) -> Flags:
    """Return (R,) whether the second-order test proves v, sufficient but not necessary.

    Nodes that rest without slack count as free. A node at the end of a rising piece that is narrow
    is inside it if its traction is: slips do not resolve such a piece.
    """
    body, xi = rows.body, rows.xi(v)
    s = slopes(rows, v, xi)
    noise = 1e3 * np.finfo(float).eps * (np.diagonal(body.A_tilde) * np.abs(v) + np.abs(xi))
    on_up = rows.law.kind(s.at) == UP
    held = on_up & (s.left < -noise) & (s.right > noise)
    least = np.minimum(rows.law.slope(v, s.at.piece), rows.law.slope(v, s.at.piece + s.at.on))
    for piece in (s.at.piece, s.at.piece + s.at.on) if rows.law.has_narrow_pieces else ():
        low, high = (body.c * b for b in rows.law.end_values(piece))
        inside = s.at.on & rows.law.narrow(piece) & (low < xi - noise) & (xi + noise < high)
        least = np.where(inside, rows.law.slope(v, piece), least)
    added = body.c * (least - body.shift) / kept(body.A_error)
    proved = ~np.any(s.jump & ~on_up, axis=1)
    for i in np.flatnonzero(proved):
        free = np.flatnonzero(~held[i])
        proved[i] = factor_free(body.A_tilde, free, added[i, free])[1] == 0
    return proved
