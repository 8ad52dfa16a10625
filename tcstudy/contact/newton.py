"""One-sided slopes, Newton's equations for many rows at once, ways out of saddles, and a step by a
convex model.

Newton's equations of a row, (A_FF + C b′_F) d_F = −g_F on its free nodes F, are solved on the
smaller of two sides: on F, or, with the compliance G = Ã⁻¹, on the nodes K that rest or have b′ ≠
0:

    y = −G g,   (G_KK + D) z = y_K,   d = y − G z,   D = 1/(c b′) on sliding nodes of K, 0 on resting ones.

A_FF + C b′ is positive definite exactly if G_KK + D has as many negative eigenvalues as b′
(Sylvester's law of inertia on both Schur complements of one block matrix). Where it is not, the
falls of b are lifted to zero, since Ã alone is positive definite.

Where A_FF + C b′ of a stationary point is not positive definite, that is no minimum but for luck,
and a direction d with dᵀ(A_FF + C b′)d ≤ 0 leads down from it; a row at a time, since few rows end
so.

The convex model of L̃ knows all rising pieces and up-jumps of b; its minimum is found by interior
points. Newton's steps and the moves of single nodes settle few nodes at a time where the body
couples all of them strongly (Ã dense and badly conditioned); an interior point method settles all
together, in some twenty factorisations whatever their number. The model at v: b = b_↑ + rest, where
b_↑ has the up-jumps of b and its slopes where they are positive, and the rest, which only falls,
stays what it is at v:

    min over w  ½wᵀÃw − (l̃ − c·rest)ᵀw + Σ c_i j_↑(w_i)

For a law that nowhere falls this is the problem itself; else −j of the rest bends up, so that the
model lies above L̃ and its minimum is no higher than v. The law b_↑ is a sum of elements: a line of
the least slope, and for each up-jump or steeper piece a force e in [0, h] that grows as the slip
passes s:

    w_i − s = γ e + x⁺ − x⁻,   0 ≤ e ⟂ x⁻ ≥ 0,   0 ≤ h − e ⟂ x⁺ ≥ 0      (γ = 0 for a jump, 1/slope for a piece)

Method: Mehrotra's predictor and corrector, SIAM J. Optim. 2 (1992) 575–601; e and x are eliminated,
so that each step costs one Cholesky factor of Ã plus a diagonal.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy.linalg
from numpy.typing import NDArray

from tcstudy.contact.problem import CondensedBody, ContactProblem
from tcstudy.laws.laws import Laws
from tcstudy.laws.pieces import BEND, UP, Place

Array = NDArray[np.float64]
Index = NDArray[np.intp]
Flags = NDArray[np.bool_]


def with_diagonal(M: Array, nodes: Index, added: Array) -> Array:
    """M[nodes, nodes] + diag `added`."""
    matrix = M.take(nodes, axis=0).take(nodes, axis=1)  # faster than one fancy index
    matrix.reshape(-1)[:: len(nodes) + 1] += added
    return matrix


def cholesky(matrix: Array) -> tuple[Array, int]:
    """Lower factor of a symmetric C-ordered matrix (overwritten) and LAPACK's info (0 if positive
    definite)."""
    factor, info = scipy.linalg.lapack.dpotrf(matrix.T, lower=1, clean=0, overwrite_a=1)
    return factor, int(info)


def factor_free(A_tilde: Array, free: Index, added: Array) -> tuple[Array, int]:
    """Cholesky factor of A_FF + diag `added` and LAPACK's info (0 if positive definite)."""
    return cholesky(with_diagonal(A_tilde, free, added)) if len(free) else (np.zeros((0, 0)), 0)


def negative_curvature(A_tilde: Array, free: Index, added: Array) -> Array | None:
    """(n,) d with dᵀ(A_FF + diag `added`)d ≤ 0, None if that matrix is positive definite.

    Where the factorisation breaks down at a pivot, d solves the equations of the nodes before it.
    """
    diagonal = np.diagonal(A_tilde)[free]
    if np.any(diagonal + added <= 0.0):
        return np.where(np.arange(len(free)) == np.argmin((diagonal + added) / diagonal), 1.0, 0.0)
    factor, info = factor_free(A_tilde, free, added)
    if info == 0:
        return None
    k, direction = info - 1, np.zeros(len(free))
    direction[k] = 1.0
    if k:
        row = A_tilde[free[k], free[:k]]
        direction[:k] = -scipy.linalg.lapack.dpotrs(
            np.asfortranarray(factor[:k, :k]), row, lower=1
        )[0]
    return direction


STACKED, TRUSTED = 24, 64
"""Up to so many unknowns linear systems are stacked for one call, and systems with falls of b taken
as they are."""
_WIDTH = 8
"""Stacked systems are padded to multiples of this."""
_NOTHING = 2.0**-60
"""Part of the diagonal of Ã below which slopes of b are nothing beside it."""
_PROXIMAL = 1e-6
"""What holds a body that nothing else holds, of the diagonal of Ã."""
ROUNDINGS = 64.0
"""Decreases of energy below so many roundings of the work of ξ count as rounding."""
_INDEFINITE_COST = 1.5
"""What a symmetric indefinite factorisation costs, in Cholesky factorisations."""


@dataclass(frozen=True, eq=False)
class Slopes:
    """One-sided first-order information at v, (m,) or (R, m) each.

    at:          where v sits
    left, right: derivatives of L̃ in v_i from both sides [N/m]
    descent:     the steeper descending one of both (the derivative itself where L̃ is smooth), 0 at rest
    jump:        v_i sits bitwise on a jump of b
    residual:    max |descent|/c over the scale of b, (R,) of rows
    """

    at: Place
    left: Array
    right: Array
    descent: Array
    jump: Flags
    residual: Array

    @property
    def at_rest(self) -> Flags:
        """Nodes on an up-jump that hold: left ≤ 0 ≤ right."""
        return self.jump & (self.descent == 0.0)

    @property
    def free(self) -> Flags:
        """All others."""
        return ~self.at_rest

    @property
    def piece(self) -> Index:
        """Address of the piece on the descending side."""
        return self.at.toward(self.descent <= 0.0)

    def take(self, rows: Index) -> Slopes:
        """The named rows."""
        at = Place(self.at.piece[rows], self.at.on[rows])
        left, right, descent = self.left[rows], self.right[rows], self.descent[rows]
        return Slopes(at, left, right, descent, self.jump[rows], self.residual[rows])


def slopes(problem: ContactProblem, v: Array, xi: Array) -> Slopes:
    """Slopes c b(v∓0) − ξ of L̃."""
    law, c = problem.law, problem.c
    at = law.locate(v)
    left = c * law.value(v, at.piece) - xi
    right, jump = left, np.zeros(v.shape, dtype=bool)
    if np.any(at.on):
        right = np.where(at.on, c * law.value(v, at.piece + at.on) - xi, left)
        jump = law.kind(at) != BEND
    descent = steeper(left, right, jump)
    residual = np.max(np.abs(descent) / c, axis=-1, initial=0.0) / problem.scale(xi)
    return Slopes(at, left, right, descent, jump, residual)


def steeper(left: Array, right: Array, jump: Flags) -> Array:
    """The steeper descending one of two slopes at a jump of b, 0 at rest; the derivative
    elsewhere."""
    climb_right, climb_left = np.maximum(-right, 0.0), np.maximum(left, 0.0)
    return np.where(jump, np.where(climb_right >= climb_left, -climb_right, climb_left), right)


def directions(
    body: CondensedBody, free: Flags, stiffness: Array, g: Array, careful: bool = False
) -> Array:
    """(R, m) d with (A_FF + diag k) d_F = −g_F and 0 elsewhere, k = `stiffness` = c b′ [N/m per m].

    Rows in which that matrix is not positive definite get the k lifted to at least 0; of small
    systems only those whose d does not descend.

    careful: also of small systems all
    """
    loaded = free & (np.abs(stiffness) > _NOTHING * np.diagonal(body.A_tilde))
    held = ~free | loaded
    d, size = np.zeros(free.shape), np.count_nonzero(free, axis=1)
    other = np.count_nonzero(held, axis=1)
    falls, least = np.any(loaded & (stiffness < 0.0), axis=1), np.minimum(size, other)
    trusted = falls & (least <= (0 if careful else TRUSTED))
    stack = (trusted | ~falls) & (least <= STACKED)
    compliant = np.where(falls & ~trusted, _INDEFINITE_COST, 1.0) * other < size
    compliant &= body.shared
    if body.loose:  # its systems may be singular, and are looked at one by one
        stack[:], trusted[:] = False, False
    g = np.where(free, g, 0.0)
    y = np.zeros(free.shape)
    if np.any(compliant):
        y[compliant] = -(g[compliant] @ body.inverse)
    z, softness = (
        np.zeros(free.shape),
        np.divide(1.0, stiffness, out=np.zeros(free.shape), where=loaded),
    )
    rows, others = np.flatnonzero(stack & ~compliant), np.flatnonzero(stack & compliant)
    d[rows] = _stacked(body.A_tilde, free[rows], stiffness[rows], -g[rows])
    if len(others):
        z[others] = _stacked(body.inverse, held[others], softness[others], y[others])
    for i in np.flatnonzero(~stack & ~compliant):
        nodes = free[i].nonzero()[0]
        d[i, nodes] = _on_free(
            body, nodes, stiffness[i].take(nodes), -g[i].take(nodes), bool(trusted[i])
        )
    k = np.where(loaded, stiffness, 0.0)
    for i in np.flatnonzero(~stack & compliant):
        nodes = held[i].nonzero()[0]
        z[i, nodes] = _on_held(body, nodes, k[i].take(nodes), y[i].take(nodes), bool(trusted[i]))
    if np.any(compliant):
        d[compliant] = y[compliant] - z[compliant] @ body.inverse
    d[~free] = 0.0
    uphill = np.flatnonzero(trusted)
    uphill = uphill[~(np.einsum("ri,ri->r", g[uphill], d[uphill]) < 0.0)]
    if len(uphill):
        d[uphill] = directions(body, free[uphill], np.maximum(stiffness[uphill], 0.0), g[uphill])
    return d


def _stacked(M: Array, mask: Flags, diagonal: Array, rhs: Array) -> Array:
    """(R, m) x with (M + diag) x = rhs on the masked nodes of each row; systems of similar size in
    one stack."""
    x, size = np.zeros(mask.shape), np.count_nonzero(mask, axis=1)
    order = np.argsort(~mask, axis=1, kind="stable")
    width = np.minimum(mask.shape[1], -(-size // _WIDTH) * _WIDTH)
    for n in np.unique(width[size > 0]):
        rows = np.flatnonzero(width == n)
        nodes, valid = order[rows, :n], np.arange(n) < size[rows, None]
        stack = M.reshape(-1).take(nodes[:, :, None] * len(M) + nodes[:, None, :])
        stack *= valid[:, :, None] & valid[:, None, :]
        own = np.where(valid, np.take_along_axis(diagonal[rows], nodes, 1), 1.0)
        np.einsum("rii->ri", stack)[...] += own
        right = np.where(valid, np.take_along_axis(rhs[rows], nodes, 1), 0.0)
        solved = np.linalg.solve(stack, right[..., None])[..., 0]
        x[rows[:, None], nodes] = np.where(valid, solved, 0.0)
    return x


def _positive(matrix: Array, rhs: Array) -> tuple[Array, int]:
    """Solution with a symmetric matrix (overwritten) and LAPACK's info, 0 if it is positive
    definite."""
    _, x, info = scipy.linalg.lapack.dposv(matrix.T, rhs, lower=1, overwrite_a=1)
    return x, info


def _on_free(body: CondensedBody, free: Index, k: Array, rhs: Array, trusted: bool) -> Array:
    """(n,) solution of one row on its free nodes."""
    if not len(free):
        return rhs
    lifted = np.maximum(k, 0.0)
    # at last only friction holds the body, and too little of it: a proximal step, which up-jumps
    # will stop
    for own in (k, lifted, lifted + _PROXIMAL * np.diagonal(body.A_tilde)[free]):
        x, info = _positive(with_diagonal(body.A_tilde, free, own), rhs)
        if info == 0:
            return x
        if trusted:
            return np.asarray(np.linalg.solve(with_diagonal(body.A_tilde, free, k), rhs))
    return np.zeros(len(free))


def _on_held(body: CondensedBody, held: Index, k: Array, y: Array, trusted: bool) -> Array:
    """(n,) forces z of one row on the nodes that rest or have k ≠ 0."""
    if not len(held):
        return y
    matrix = with_diagonal(
        body.inverse, held, np.divide(1.0, k, out=np.zeros(len(k)), where=k != 0.0)
    )
    falls = np.count_nonzero(k < 0.0)
    if not falls:
        return _positive(matrix, y)[0]
    factor, pivots, z, _ = scipy.linalg.lapack.dsysv(
        matrix.T, y, lwork=64 * len(held), lower=1, overwrite_a=1
    )
    negative = (
        np.count_nonzero((pivots > 0) & (np.diagonal(factor) < 0.0))
        + np.count_nonzero(pivots < 0) // 2
    )
    if not trusted and negative != falls:
        kept, z = k >= 0.0, np.zeros(len(k))
        z[kept] = _on_held(body, held[kept], k[kept], y[kept], trusted)
    return z


def leave_saddles(rows: ContactProblem, v: Array, xi: Array, s: Slopes) -> tuple[Array, Flags]:
    """(points of less energy where there are such, whether), for stationary points v (R, m).

    They lie towards the first kink along ±d of negative curvature. Until a node reaches its next
    kink the energy of a piecewise-linear law is an exact parabola that opens downwards: the first
    step ends there. Exponential pieces may need shorter ones.
    """
    body, free, law = rows.body, s.free, rows.law
    added = np.where(free, body.c * law.slope(v, s.piece), 0.0)
    new, left = v.copy(), np.zeros(len(v), dtype=bool)
    for i in np.flatnonzero(np.any(added < 0.0, axis=1)):
        nodes = np.flatnonzero(free[i])
        curvature = negative_curvature(body.A_tilde, nodes, added[i, nodes])
        if curvature is None:
            continue
        direction = np.zeros(body.m)
        direction[nodes] = curvature
        first_order = np.where(direction > 0.0, s.right[i], s.left[i])
        direction = -direction if float(first_order @ direction) > 0.0 else direction
        end = np.where(direction > 0.0, law.upper.take(s.piece[i]), law.lower.take(s.piece[i]))
        reach = np.divide(
            end - v[i], direction, out=np.full(body.m, np.inf), where=direction != 0.0
        )
        length = float(np.min(reach[reach > 0.0], initial=np.inf))
        row, at = rows.take(np.array([i])), Place(s.at.piece[[i]], s.at.on[[i]])
        for part in (1.0, 0.25, 0.05) if np.isfinite(length) else ():
            target = v[i] + part * length * direction
            change, work = row.energy_change(v[[i]], target[None], xi[[i]], at)
            if change[0] < -ROUNDINGS * np.finfo(float).eps * work[0]:
                new[i], left[i] = target, True
                break
    return new, left


_STEPS = 80
_TO_BOUNDARY = 0.995
_SMALL = 1e-14
"""Most steps, how far each goes towards the boundary, and the complementarity, relative to its
first, that ends it."""


def convex_step(problem: ContactProblem, v: Array) -> Array | None:
    """The minimum of the model at v (m,), None if the iteration fails.

    Nodes on an up-jump at the minimum are put on it bitwise.
    """
    law, c, index = problem.law, problem.c, problem.law.node_index(problem.m)
    (s, h, gamma, sign, kink), slope = _elements(law.tables, index)
    descent = slopes(problem, v, problem.xi(v)).descent
    piece = np.where(descent <= 0.0, law.piece(v, +1), law.piece(v, -1))
    own = piece if law.one else piece - law.tables.first[index]
    with np.errstate(divide="ignore", invalid="ignore"):
        force = np.where(
            gamma > 0.0, np.clip(sign * (v - s) / gamma, 0.0, h), np.where(kink < own, h, 0.0)
        )
    rest = law.value(v, piece) - (slope * v + np.sum(sign * force, axis=0))
    matrix, load = problem.A_tilde.copy(), problem.l_tilde - c * rest
    diagonal = matrix.reshape(-1)[:: len(v) + 1]
    diagonal += c * slope
    if not len(s):
        _, w, info = scipy.linalg.lapack.dposv(matrix, load, lower=1)
        return w if info == 0 else None
    capped = np.isfinite(h)
    both = np.stack(
        [np.ones(h.shape), capped]
    )  # of e with x⁻ and, where there is a cap, of h − e with x⁺
    size = float(np.max(np.abs(h[capped]), initial=0.0)) or problem.traction_scale
    reach = float(np.max(np.abs(problem.l_tilde) + c * size) / np.min(diagonal))
    reach = max(float(np.max(np.abs(v - s))), reach if np.isfinite(reach) else 0.0)
    w, e = v.copy(), np.where(capped, 0.5 * h, size)
    # h − e is a variable of its own, as it would lose its digits; without a cap x⁺ = 0, here y = 0
    # beside an x of 1
    x = np.stack([e, np.where(capped, h - e, 1.0)])
    gap = sign * (v - s) - gamma * e
    y = np.stack(
        [np.maximum(-gap, 0.0) + reach, np.where(capped, np.maximum(gap, 0.0) + reach, 0.0)]
    )
    kinds = 1.0 + float(np.mean(capped))
    first = mu = float(np.sum(x * y)) / (e.size * kinds)
    for _ in range(_STEPS):
        if mu <= _SMALL * first:
            break
        theta = gamma + y[1] / x[1] + y[0] / x[0]
        balance, gap = (
            load - matrix @ w - c * np.sum(sign * x[0], axis=0),
            sign * (w - s) - gamma * x[0] - y[1] + y[0],
        )
        lifted = matrix.copy()
        lifted.reshape(-1)[:: len(v) + 1] += c * np.sum(sign**2 / theta, axis=0)
        factor, info = cholesky(lifted)
        if info != 0:
            break
        target = -both * x * y  # of the predictor: x y → x y + target
        for share in (1.0, _TO_BOUNDARY):
            known = gap - target[1] / x[1] + target[0] / x[0]
            rhs = balance - c * np.sum(sign * known / theta, axis=0)
            dw = scipy.linalg.lapack.dpotrs(factor, rhs, lower=1)[0]
            de = (sign * dw + known) / theta
            dx, dy = (
                np.stack([de, np.where(capped, -de, 0.0)]),
                (target - y * np.stack([de, -de])) / x,
            )
            with np.errstate(divide="ignore", invalid="ignore"):
                ends = [np.where(d < 0.0, -share * z / d, 1.0) for z, d in ((x, dx), (y, dy))]
            length = min(1.0, float(np.min(ends)))
            after = float(np.sum((x + length * dx) * (y + length * dy)))
            target = both * (
                mu * min(1.0, after / (mu * e.size * kinds)) ** 3 - x * y - dx * dy
            )  # of the corrector
        if not (length > 1e-6 and np.all(np.isfinite(dw))):
            break
        w, x, y = w + length * dw, x + length * dx, y + length * dy
        mu = float(np.sum(x * y)) / (e.size * kinds)
    if not mu <= 1e-3 * first:
        return None
    reach = max(float(np.max(np.abs(w - s))), float(np.finfo(float).tiny))
    row, node = np.nonzero((kink >= 0) & np.all(y < x / h * reach, axis=0))
    w[node] = np.broadcast_to(s, h.shape)[row, node]
    return w


def _elements(laws: Laws, index: NDArray[np.intp]) -> tuple[list[Array], Array]:
    """(s, h, γ, sign, kink) of the elements of b_↑ at every node (n, m) each, and the least slopes
    (m,).

    laws: tables;  sign: −1 for the outer piece on the left, whose slip counts to the left;  kink: of an up-jump its
    index, −1 for a piece. Exponential pieces rise from end to end. A node with fewer elements than others has some of
    sign 0 and of the scale of b, which act on nothing.
    """
    low, high, up = laws.lower, laws.upper, laws.kinds == UP
    outer = ~(np.isfinite(low) & np.isfinite(high))
    ends = [np.where(outer, laws.s_0, s) for s in (low, high)]
    width, start, end = (
        np.where(outer, 1.0, ends[1] - ends[0]),
        *(laws.value(s, laws.addresses) for s in ends),
    )
    rise = np.maximum(np.where(laws.bent & ~outer, (end - start) / width, laws.q), 0.0)
    least = np.min(rise, axis=1, keepdims=True)
    rises, steeper = (rise > least) & (low < high), np.where(rise > least, rise - least, 1.0)
    sign = np.where(np.isfinite(low), 1.0, -1.0)
    jumps: tuple[Any, ...] = (
        laws.kinks,
        laws.b_right - laws.b_left,
        np.zeros(up.shape),
        1.0,
        np.arange(up.shape[1]),
    )
    pieces: tuple[Any, ...] = (
        np.where(np.isfinite(low), low, high),
        np.where(outer, np.inf, steeper * width),
        1.0 / steeper,
        sign,
        -1.0,
    )
    found, none = [], (0.0, laws.at(index).b_scale or 1.0, 0.0, 0.0, -1.0)
    used = np.any(np.append(up, rises, axis=1)[np.unique(index)], axis=0)
    for of_jump, of_piece, nothing in zip(jumps, pieces, none, strict=True):
        column = np.append(
            np.where(up, of_jump, nothing), np.where(rises, of_piece, nothing), axis=1
        )
        found.append(column[:, used][index].T)
    return found, least[index, 0]
