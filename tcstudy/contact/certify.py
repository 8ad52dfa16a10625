"""What can be proved about P points at once; the flags of tcstudy/contact/certificates.py with the same meaning.

Before any solution: convex (ω < λ₁) or convex on the box that holds all solutions → unique.
At a solution v:     global minimum, if Ã − C diag D is positive definite with D below; that proves a strict one,
                     too. Else a strict minimum by the second-order test on the free nodes.

Which of many matrices Ã + C diag(s_r − μ) are positive definite, with as few factorisations as may be.

Steps d ← |Ã⁻¹|(w d) with w = C(μ − s)₊ ≥ 0 of all rows at once go to the direction in which Ã can hold w least, at the
price of two products each. A row with dᵀ(Ã + C diag(s − μ))d ≤ 0 is refuted; one with |Ã⁻¹|(w d) < d for a d > 0 is
proved, for then the spectral radius of Ã⁻¹w is below 1 (Collatz, Wielandt). Few rows are left:
If the matrix with the pointwise least diagonal of a group is positive definite, all of the group are. If its Cholesky
factorisation breaks down, its direction of negative curvature is one more d for all rows; what is left is halved.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from tcstudy.contact.bounds import FEW, PARTS, bends, boxes_of, largest_push, value_range
from tcstudy.contact.factors import factor_free, negative_curvature
from tcstudy.contact.newton import slopes
from tcstudy.contact.problem import CondensedBody, ContactProblem, kept, least_lowered
from tcstudy.laws.laws import Laws
from tcstudy.laws.pieces import UP

Array = NDArray[np.float64]
Index = NDArray[np.intp]
Flags = NDArray[np.bool_]


def definite(body: CondensedBody, slope: Array) -> Flags:
    """(R,) whether Ã + C diag(slope − μ) ≻ 0 is proved, for rows of slopes (R, m) [Pa/m]."""
    proved = np.zeros(len(slope), dtype=bool)
    if body.m == 0:
        return ~proved
    A_tilde, added = body.A_tilde, body.c * (slope - body.shift) / kept(body.A_error)
    open_ = np.flatnonzero(np.all(np.diagonal(A_tilde) + added > 0.0, axis=1))
    sure, open_ = _by_products(body, added[open_], open_)
    proved[sure] = True
    groups = [open_[np.argsort(added[open_].sum(axis=1), kind="stable")]]
    while groups:
        group = groups.pop()
        if not len(group):
            continue
        direction = negative_curvature(A_tilde, np.arange(body.m), added[group].min(axis=0))
        if direction is None:
            proved[group] = True
            continue
        squares, stiffness = direction**2, float(direction @ (A_tilde @ direction))
        groups = [own[stiffness + added[own] @ squares > 0.0] for own in groups]
        if len(group) > 1:
            group = group[stiffness + added[group] @ squares > 0.0]
            half = (len(group) + 1) // 2
            groups += [group[:half], group[half:]]
    return proved


_PRODUCTS = 4
"""Steps of all rows towards directions that prove or refute them."""


def _by_products(body: CondensedBody, added: Array, rows: Index) -> tuple[Index, Index]:
    """(proved, open) of rows whose matrices Ã + diag `added` are in question; those that are neither are refuted."""
    absolute, weight = np.abs(body.inverse), np.maximum(-added, 0.0)
    slack, proved = body.rounding * absolute.sum(axis=1), []
    d = np.ones(weight.shape)
    for _ in range(_PRODUCTS):
        pushed = weight * d
        held = pushed @ absolute
        sure = np.all(held + np.max(pushed, axis=1, initial=0.0)[:, None] * slack < d, axis=1)
        d = np.maximum(held / np.maximum(np.max(held, axis=1), np.finfo(float).tiny)[:, None], _LEAST)
        squares = np.einsum("ri,ri->r", d, d @ body.A_tilde) + np.einsum("ri,ri->r", added, d * d)
        proved.append(rows[sure])
        on = ~sure & (squares > 0.0)
        rows, added, weight, d = rows[on], added[on], weight[on], d[on]
    return np.concatenate([*proved, rows[:0]]), rows


_LEAST = 1e-9
"""Least part of its largest entry that an entry of such a direction has, since all must be positive."""


def solution_boxes(rows: ContactProblem) -> tuple[Array, Array]:
    """(low, high), (R, m) each: every solution lies between them [m]."""
    body, laws = rows.body, rows.law
    known = (body.c, kept(body.A_error) * body.lambda_1, body.inverse, body.rounding)
    push = np.max(largest_push(laws)[laws.index], axis=1)
    return boxes_of(rows.l_tilde[None], push, known, lambda at, *box: value_range(laws, laws.index[at], *box))


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
        again, _ = bends_below_tangent(rows.law.nodes(row, node), own_v, own_zeta, own_low, own_high)
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


def bends_below_tangent(
    laws: Laws, v: Array, zeta: Array, low: Array, high: Array, parts: int = PARTS
) -> tuple[Array, Array]:
    """(upper, lower) bounds of D (R, m) for slips between low and high [Pa/m]; inf where v_i sits on a down-jump.

    zeta: elements of b̂(v), exactly b(v) off the kinks [Pa]
    """
    law = np.broadcast_to(laws.index, v.shape).ravel()
    sides = bends(laws, law, v.ravel(), zeta.ravel(), low.ravel(), high.ravel(), parts)
    upper, lower = zip(*sides, strict=True)
    return np.maximum(*upper).reshape(v.shape), np.maximum(*lower).reshape(v.shape)
