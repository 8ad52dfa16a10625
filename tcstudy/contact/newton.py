"""One-sided slopes and Newton's equations for many rows at once.

Newton's equations of a row, (A_FF + C b′_F) d_F = −g_F on its free nodes F, are solved on the smaller of two sides:
on F, or, with the compliance G = Ã⁻¹, on the nodes K that rest or have b′ ≠ 0:

    y = −G g,   (G_KK + D) z = y_K,   d = y − G z,   D = 1/(c b′) on sliding nodes of K, 0 on resting ones.

A_FF + C b′ is positive definite exactly if G_KK + D has as many negative eigenvalues as b′ (Sylvester's law of inertia
on both Schur complements of one block matrix). Where it is not, the falls of b are lifted to zero, since
Ã alone is positive definite.

Where A_FF + C b′ of a stationary point is not positive definite, that is no minimum but for luck, and a direction d
with dᵀ(A_FF + C b′)d ≤ 0 leads down from it; a row at a time, since few rows end so.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.linalg
from numpy.typing import NDArray

from tcstudy.contact.factors import negative_curvature, with_diagonal
from tcstudy.contact.problem import CondensedBody, ContactProblem
from tcstudy.laws.pieces import BEND, Place

Array = NDArray[np.float64]
Index = NDArray[np.intp]
Flags = NDArray[np.bool_]

STACKED, TRUSTED = 24, 64
"""Up to so many unknowns linear systems are stacked for one call, and systems with falls of b taken as they are."""
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
    """The steeper descending one of two slopes at a jump of b, 0 at rest; the derivative elsewhere."""
    climb_right, climb_left = np.maximum(-right, 0.0), np.maximum(left, 0.0)
    return np.where(jump, np.where(climb_right >= climb_left, -climb_right, climb_left), right)


def directions(body: CondensedBody, free: Flags, stiffness: Array, g: Array, careful: bool = False) -> Array:
    """(R, m) d with (A_FF + diag k) d_F = −g_F and 0 elsewhere, k = `stiffness` = c b′ [N/m per m].

    Rows in which that matrix is not positive definite get the k lifted to at least 0; of small systems only those
    whose d does not descend.

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
    z, softness = np.zeros(free.shape), np.divide(1.0, stiffness, out=np.zeros(free.shape), where=loaded)
    rows, others = np.flatnonzero(stack & ~compliant), np.flatnonzero(stack & compliant)
    d[rows] = _stacked(body.A_tilde, free[rows], stiffness[rows], -g[rows])
    if len(others):
        z[others] = _stacked(body.inverse, held[others], softness[others], y[others])
    for i in np.flatnonzero(~stack & ~compliant):
        nodes = free[i].nonzero()[0]
        d[i, nodes] = _on_free(body, nodes, stiffness[i].take(nodes), -g[i].take(nodes), bool(trusted[i]))
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
    """(R, m) x with (M + diag) x = rhs on the masked nodes of each row; systems of similar size in one stack."""
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
    """Solution with a symmetric matrix (overwritten) and LAPACK's info, 0 if it is positive definite."""
    _, x, info = scipy.linalg.lapack.dposv(matrix.T, rhs, lower=1, overwrite_a=1)
    return x, info


def _on_free(body: CondensedBody, free: Index, k: Array, rhs: Array, trusted: bool) -> Array:
    """(n,) solution of one row on its free nodes."""
    if not len(free):
        return rhs
    lifted = np.maximum(k, 0.0)
    # at last only friction holds the body, and too little of it: a proximal step, which up-jumps will stop
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
    matrix = with_diagonal(body.inverse, held, np.divide(1.0, k, out=np.zeros(len(k)), where=k != 0.0))
    falls = np.count_nonzero(k < 0.0)
    if not falls:
        return _positive(matrix, y)[0]
    factor, pivots, z, _ = scipy.linalg.lapack.dsysv(matrix.T, y, lwork=64 * len(held), lower=1, overwrite_a=1)
    negative = np.count_nonzero((pivots > 0) & (np.diagonal(factor) < 0.0)) + np.count_nonzero(pivots < 0) // 2
    if not trusted and negative != falls:
        kept, z = k >= 0.0, np.zeros(len(k))
        z[kept] = _on_held(body, held[kept], k[kept], y[kept], trusted)
    return z


def leave_saddles(rows: ContactProblem, v: Array, xi: Array, s: Slopes) -> tuple[Array, Flags]:
    """(points of less energy where there are such, whether), for stationary points v (R, m)."""
    body, free = rows.body, s.free
    added = np.where(free, body.c * rows.law.slope(v, s.piece), 0.0)
    new, left = v.copy(), np.zeros(len(v), dtype=bool)
    for i in np.flatnonzero(np.any(added < 0.0, axis=1)):
        nodes = np.flatnonzero(free[i])
        curvature = negative_curvature(body.A_tilde, nodes, added[i, nodes])
        if curvature is not None:
            direction = np.zeros(body.m)
            direction[nodes] = curvature
            new[i], left[i] = _lower_along(rows.take(np.array([i])), v[i], xi[i], s.take(np.array([i])), direction)
    return new, left


def _lower_along(row: ContactProblem, v: Array, xi: Array, s: Slopes, direction: Array) -> tuple[Array, bool]:
    """(the point towards the first kink along ±direction, True) if it is lower, else (v, False).

    Until a node reaches its next kink the energy of a piecewise-linear law is an exact parabola that opens downwards:
    the first step ends there. Exponential pieces may need shorter ones.
    """
    first_order = np.where(direction > 0.0, s.right[0], s.left[0])
    direction = -direction if float(first_order @ direction) > 0.0 else direction
    end = np.where(direction > 0.0, row.law.upper.take(s.piece[0]), row.law.lower.take(s.piece[0]))
    with np.errstate(divide="ignore", invalid="ignore"):
        reach = np.where(direction != 0.0, (end - v) / direction, np.inf)
    length = float(np.min(reach[reach > 0.0], initial=np.inf))
    for part in (1.0, 0.25, 0.05) if np.isfinite(length) else ():
        target = v + part * length * direction
        change, work = row.energy_change(v[None], target[None], xi[None], s.at)
        if change[0] < -ROUNDINGS * np.finfo(float).eps * work[0]:
            return target, True
    return v, False
