"""What can be proved about a solution v of a contact problem: unique, strict local minimum, global minimum.

Uniqueness:      ω < λ₁ makes L̃ strictly convex. Otherwise every solution lies in a box (bounds.py), and two
                 solutions v, w in it have (v−w)ᵀ(Ã + C diag b′_min)(v−w) ≤ 0 with the least slopes of b on the
                 box; if that matrix is positive definite there is only one.
Strict minimum:  A_FF + C b′ ≻ 0 on the free nodes, and every other node rests on an up-jump with left < 0 < right.
Global minimum:  L̃(w) − L̃(v) ≥ ½ (w−v)ᵀ(Ã − C diag D)(w−v) − Σ (ξ_i − c_i ζ_i)(w_i − v_i), D from bounds.py and
                 ζ the element of b̂(v) nearest to ξ/c. If Ã − C diag(D + μ) ⪰ 0 no point of the box, so no point
                 at all, has an energy below L̃(v) − ‖ξ/c − ζ‖²/(2μ) in the norm weighted by c: `energy_gap`,
                 rounding squared.

Every flag is one-sided: True is proved, False says "not certified". Positive definiteness is decided by Cholesky with
the diagonal lowered by μ = margin·λ₁ and never by less than the rounding of the factorisation, so that it holds in
floating-point arithmetic too; where Ã has lost more digits than that to stiff springs or materials, it is taken softer
by its relative error. Left out: interval arithmetic (the inclusion residual of v enters through
`energy_gap` only) and branch and bound for what is not certified.

Of many points at once, which of many matrices Ã + C diag(s_r − μ) are positive definite, with few factorisations:
steps d ← |Ã⁻¹|(w d) with w = C(μ − s)₊ ≥ 0 of all rows at once go to the direction in which Ã can hold w least, at the
price of two products each. A row with dᵀ(Ã + C diag(s − μ))d ≤ 0 is refuted; one with |Ã⁻¹|(w d) < d for a d > 0 is
proved, for then the spectral radius of Ã⁻¹w is below 1 (Collatz, Wielandt). Of 100 rows one or two are left open.
"""

from __future__ import annotations

from dataclasses import dataclass, fields, is_dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tcstudy.contact.active_set import extended
from tcstudy.contact.bounds import FEW, PARTS, bends_below_tangent, least_slopes, solution_boxes
from tcstudy.contact.factors import factor_free
from tcstudy.contact.newton import slopes
from tcstudy.contact.problem import MARGIN, CondensedBody, ContactProblem, kept, least_lowered, pivot_shift
from tcstudy.laws.pieces import UP
from tcstudy.scene.study import Acceptance

Array = NDArray[np.float64]
Index = NDArray[np.intp]
Flags = NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class Certificate:
    """Proved properties of one solution, or (P,) of P; a flag that is False means "not certified", not the opposite.

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
    proofs = Proofs(ContactProblem.on(body, problem.l_tilde, problem.law).rows)
    residual = extended(problem, v).residual if residual is None else residual
    solved = np.array([Acceptance(tolerance).accepts(residual, problem.xi_rounding(v))])
    proofs.prove_unique()
    proofs.prove_lowest(np.flatnonzero(solved), v[None])
    proofs.prove_strict(np.flatnonzero(solved), v[None])
    return row_of(proofs.certificate(v[None], np.array([residual]), solved), 0)


class Proofs:
    """What is proved of rows of problems, each flag (R,): `unique` before they are solved, the others of solutions."""

    def __init__(self, rows: ContactProblem) -> None:
        count, body = len(rows.l_tilde), rows.body
        self.rows, self.omega, share = rows, rows.law.omega_by_row, kept(body.A_error)
        with np.errstate(invalid="ignore"):  # of no nodes
            self.margin = share * body.lambda_1 - self.omega
        self.convex = (self.omega < (1.0 - MARGIN) * share * body.lambda_1) | (body.m == 0)
        if rows.law.index.shape[1] > 1 and not body.loose:
            self.margin = margins(rows)
            self.convex |= self.margin > body.shift
        self.unique, self.low, self.high = self.convex.copy(), *np.zeros((2, count, body.m))
        self.lowest, self.strict = np.zeros((2, count), dtype=bool)

    def prove_unique(self) -> None:
        """Boxes of all solutions, and what is convex on them."""
        open_, body = np.flatnonzero(~self.convex), self.rows.body
        if len(open_) and not body.loose:
            rows = self.rows.take(open_)
            self.low[open_], self.high[open_] = low, high = solution_boxes(rows)
            self.unique[open_] = definite(body, least_slopes(rows.law, low, high))

    def prove_lowest(self, points: Index, v: Array) -> None:
        """That solutions v (R, m) of these points, as far as they are not unique, are global minima."""
        points = points[~self.unique[points]]
        if len(points) and not self.rows.body.loose:
            rows = self.rows.take(points)
            self.lowest[points] = global_minimum(rows, v[points], self.low[points], self.high[points])

    def prove_strict(self, points: Index, v: Array) -> None:
        """That solutions of these points are strict minima; one that is unique or lowest is one."""
        self.strict[points] = self.unique[points] | self.lowest[points]
        open_ = points[~self.strict[points]]
        if len(open_):
            self.strict[open_] = strict_minimum(self.rows.take(open_), v[open_])

    def certificate(self, v: Array, residual: Array, solved: Flags) -> Certificate:
        """What is proved about the points, of solutions only beside `convex` and `unique`."""
        body, lowest = self.rows.body, solved & (self.unique | self.lowest)
        lambda_1, error = np.full((2, len(v)), [[body.lambda_1], [body.A_error]])
        gap = np.full(len(v), np.nan)
        if body.m:
            gap[lowest] = self.rows.take(np.flatnonzero(lowest)).distance(v[lowest]) ** 2 @ body.c / (2.0 * body.shift)
        strict = solved & (self.strict | lowest)
        return Certificate(residual, lambda_1, error, self.omega, self.margin, self.convex, self.unique, strict, lowest,
                           gap)  # fmt: skip


def row_of(record: Any, row: int) -> Any:
    """One row of a record of rows, which may hold None or such records."""
    if is_dataclass(record) and not isinstance(record, type):
        values: dict[str, Any] = {field.name: row_of(getattr(record, field.name), row) for field in fields(record)}
        return type(record)(**values)
    return None if record is None else record[row]


def as_row(record: Any) -> Any:
    """A record as one row of such."""
    if is_dataclass(record) and not isinstance(record, type):
        values: dict[str, Any] = {field.name: as_row(getattr(record, field.name)) for field in fields(record)}
        return replace(record, **values)
    return None if record is None else np.asarray(record)[None]


def positive_definite(
    problem: ContactProblem, slope: Array, lambda_1: float, named: Index | None = None, margin: float = MARGIN
) -> bool:
    """Whether Ã + C diag(slope − μ) is positive definite on the named nodes (all by default)."""
    nodes = np.arange(problem.m, dtype=np.intp) if named is None else named
    shift = pivot_shift(problem.A_tilde, problem.c, lambda_1, margin)
    lowered = problem.c[nodes] * (slope - shift) / kept(problem.A_error)
    possible = np.all(np.diagonal(problem.A_tilde)[nodes] + lowered > 0.0)
    return bool(possible) and factor_free(problem.A_tilde, nodes, lowered)[1] == 0


# -- of many points at once ------------------------------------------------------------------------


_PRODUCTS = 4
"""Steps of all rows towards directions that prove or refute them."""
_LEAST = 1e-9
"""Least part of its largest entry that an entry of such a direction has, since all must be positive."""


def definite(body: CondensedBody, slope: Array) -> Flags:
    """(R,) whether Ã + C diag(slope − μ) ≻ 0 is proved, for rows of slopes (R, m) [Pa/m]."""
    proved = np.zeros(len(slope), dtype=bool)
    if body.m == 0:
        return ~proved
    diagonal = body.c * (slope - body.shift) / kept(body.A_error)
    rows = np.flatnonzero(np.all(np.diagonal(body.A_tilde) + diagonal > 0.0, axis=1))
    absolute, added = np.abs(body.inverse), diagonal[rows]
    slack, weight, d = body.rounding * absolute.sum(axis=1), np.maximum(-added, 0.0), np.ones(added.shape)
    for _ in range(_PRODUCTS):
        pushed = weight * d
        held = pushed @ absolute
        sure = np.all(held + np.max(pushed, axis=1, initial=0.0)[:, None] * slack < d, axis=1)
        proved[rows[sure]] = True
        d = np.maximum(held / np.maximum(np.max(held, axis=1), np.finfo(float).tiny)[:, None], _LEAST)
        squares = np.einsum("ri,ri->r", d, d @ body.A_tilde) + np.einsum("ri,ri->r", added, d * d)
        on = ~sure & (squares > 0.0)
        rows, added, weight, d = rows[on], added[on], weight[on], d[on]
    for row in rows:
        proved[row] = factor_free(body.A_tilde, np.arange(body.m), diagonal[row])[1] == 0
    return proved


def margins(rows: ContactProblem) -> Array:
    """(R,) λ_min(C^{−½}ÃC^{−½} − diag ω_i) of rows with laws by node, once for rows of the same falls [Pa/m]."""
    body = rows.body
    different, row = np.unique(rows.law.falls[rows.law.index], axis=0, return_inverse=True)
    A_tilde = kept(body.A_error) * body.A_tilde
    return np.array([least_lowered(A_tilde, body.c, omega) for omega in different])[row.reshape(-1)]


def global_minimum(rows: ContactProblem, v: Array, low: Array, high: Array) -> Flags:
    """(R,) whether v is proved to be a global minimum; low, high: the boxes of all solutions.

    A few parts of exponential pieces prove most rows, and lower bounds of D refute most others; nodes of what is left
    whose bounds lie apart are bounded again with more parts.
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
    """(R,) the second-order test with nodes that rest without slack counted as free (sufficient, not necessary)."""
    body, xi = rows.body, rows.xi(v)
    s = slopes(rows, v, xi)
    noise = 1e3 * np.finfo(float).eps * (np.diagonal(body.A_tilde) * np.abs(v) + np.abs(xi))
    on_up = rows.law.kind(s.at) == UP
    held = on_up & (s.left < -noise) & (s.right > noise)
    least = np.minimum(rows.law.slope(v, s.at.piece), rows.law.slope(v, s.at.piece + s.at.on))
    added = body.c * (least - body.shift) / kept(body.A_error)
    proved = ~np.any(s.jump & ~on_up, axis=1)
    for i in np.flatnonzero(proved):
        free = np.flatnonzero(~held[i])
        proved[i] = factor_free(body.A_tilde, free, added[i, free])[1] == 0
    return proved
