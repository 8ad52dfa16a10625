"""One-sided slopes, Newton's equations of many rows, ways out of saddles, a step by a convex model.

Newton's equations of a row, (A_FF + C b′_F) d_F = −g_F on its free nodes F, are solved on the
smaller of two sides: on F, or, with the compliance G = Ã⁻¹, on the nodes K that stick or have
b′ ≠ 0:

    y = −G g,   (G_KK + D) z = y_K,   d = y − G z,   D = 1/(c b′) on slipping nodes of K, else 0.

A_FF + C b′ is positive definite exactly if G_KK + D has as many negative eigenvalues as b′
(Sylvester's law of inertia on both Schur complements of one block matrix). Where it is not, the
negative slopes of b are lifted to zero, since Ã alone is positive definite.

Where A_FF + C b′ of a stationary point is not positive definite, the point is hardly ever a
minimum. A direction d with dᵀ(A_FF + C b′)d ≤ 0 leads down from it. Rows are treated one at a time,
since few end so.

The convex model of L̃ knows all rising pieces and up-jumps of b; its minimum is found by interior
points. Newton's steps and the moves of single nodes settle few nodes at a time where the body
couples all of them strongly (Ã dense and badly conditioned). An interior point method settles all
together, in some twenty factorisations whatever their number. The model at v: b = b_↑ + rest, where
b_↑ has the up-jumps of b and its slopes where they are positive, and the rest, which only falls,
keeps its value at v:

    min over w  ½wᵀÃw − (l̃ − c·rest)ᵀw + Σ c_i j_↑(w_i)

For a law that nowhere softens this is the problem itself. Otherwise −j of the rest bends up, so
that the model lies above L̃ and its minimum is no higher than v. The law b_↑ is a sum of elements:
a line of the least slope, and for each up-jump or steeper piece a force e in [0, h] that grows as
the slip passes s:

    w_i − s = γ e + x⁺ − x⁻,   0 ≤ e ⟂ x⁻ ≥ 0,   0 ≤ h − e ⟂ x⁺ ≥ 0

with γ = 0 for a jump and 1/slope for a piece.

Method: Mehrotra's predictor and corrector, SIAM J. Optim. 2 (1992) 575–601; e and x are eliminated,
so that each step costs one Cholesky factor of Ã plus a diagonal.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.linalg
from numpy.typing import ArrayLike, NDArray

from tcstudy.contact.problem import CondensedBody, ContactProblem, is_singular
from tcstudy.laws.laws import Laws
from tcstudy.laws.pieces import BEND, UP, Place

Array = NDArray[np.float64]
Index = NDArray[np.intp]
Flags = NDArray[np.bool_]

MAX_STACKED = 24
"""Unknowns up to which linear systems are stacked for one call."""
MAX_TRUSTED = 64
"""Unknowns up to which systems with negative slopes of b are solved before they are lifted."""
_STACK_WIDTH = 8
"""Stacked systems are padded to multiples of this."""
_NEGLIGIBLE_SLOPE = 2.0**-60
"""Part of the diagonal of Ã below which a slope of b is rounding beside it."""
_PROXIMAL = 1e-6
"""Stiffness that restrains a body that nothing else does, as part of the diagonal of Ã."""
ROUNDINGS = 64.0
"""Decreases of energy below so many roundings of the work of ξ count as rounding."""
_INDEFINITE_COST = 1.5
"""Cost of a symmetric indefinite factorisation in Cholesky factorisations."""
_SADDLE_STEPS = (1.0, 0.25, 0.05)
"""Parts of the way to the first kink that are tried along negative curvature."""
_MAX_INTERIOR_STEPS = 80
"""Steps of the interior point method."""
_TO_BOUNDARY = 0.995
"""Part of the way to the boundary that each of them goes at most."""
_COMPLEMENTARITY = 1e-14
"""Complementarity, relative to its first value, that ends them."""
_MIN_INTERIOR_STEP = 1e-6
"""Length of a step at which they fail."""
_USEFUL_COMPLEMENTARITY = 1e-3
"""Complementarity, relative to its first value, up to which their end is of use."""


def with_diagonal(M: Array, nodes: Index, added: Array) -> Array:
    """Return M[nodes, nodes] + diag `added`."""
    matrix = M.take(nodes, axis=0).take(nodes, axis=1)  # faster than one fancy index
    matrix.reshape(-1)[:: len(nodes) + 1] += added
    return matrix


def _diagonal(matrix: Array) -> Array:
    """Return a view of the diagonal of a matrix in C order."""
    return matrix.reshape(-1)[:: len(matrix) + 1]


def cholesky(matrix: Array) -> tuple[Array, int]:
    """Return the lower factor and LAPACK's info, 0 if the matrix is positive definite.

    matrix: (n, n) symmetric in C order; it is overwritten
    """
    factor, info = scipy.linalg.lapack.dpotrf(matrix.T, lower=1, clean=0, overwrite_a=1)
    return factor, int(info)


def factor_free(A_tilde: Array, free: Index, added: Array) -> tuple[Array, int]:
    """Return the Cholesky factor of A_FF + diag `added` and LAPACK's info."""
    if not len(free):
        return np.zeros((0, 0)), 0
    return cholesky(with_diagonal(A_tilde, free, added))


def negative_curvature(A_tilde: Array, free: Index, added: Array) -> Array | None:
    """Return (n,) d with dᵀ(A_FF + diag `added`)d ≤ 0, None if that matrix is positive definite.

    Where the factorisation breaks down at a pivot, d solves the equations of the nodes before it.
    """
    diagonal = np.diagonal(A_tilde)[free]
    d = np.zeros(len(free))
    if np.any(diagonal + added <= 0.0):
        d[np.argmin((diagonal + added) / diagonal)] = 1.0
        return d
    factor, info = factor_free(A_tilde, free, added)
    if info == 0:
        return None
    k = info - 1
    d[k] = 1.0
    if k > 0:
        row = A_tilde[free[k], free[:k]]
        leading = np.asfortranarray(factor[:k, :k])
        d[:k] = -scipy.linalg.lapack.dpotrs(leading, row, lower=1)[0]
    return d


# -- slopes ----------------------------------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class Slopes:
    """One-sided first-order information at v, (m,) or (R, m) each.

    at:          place of v among the pieces
    left, right: derivatives of L̃ in v_i from both sides [N/m]
    descent:     the steeper descending one of both, 0 if the node sticks; the derivative itself
                 where L̃ is smooth
    jump:        v_i sits to the bit on a jump of b
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
        """Nodes that an up-jump holds: left ≤ 0 ≤ right."""
        return self.jump & (self.descent == 0.0)

    @property
    def free(self) -> Flags:
        """Nodes that no up-jump holds."""
        return ~self.at_rest

    @property
    def piece(self) -> Index:
        """Address of the piece on the descending side."""
        return self.at.toward(self.descent <= 0.0)

    def take(self, rows: Index) -> Slopes:
        """Return the numbered rows."""
        return Slopes(
            Place(self.at.piece[rows], self.at.on[rows]),
            self.left[rows],
            self.right[rows],
            self.descent[rows],
            self.jump[rows],
            self.residual[rows],
        )


def slopes(problem: ContactProblem, v: Array, xi: Array) -> Slopes:
    """Return the slopes c b(v∓0) − ξ of L̃."""
    law, c = problem.law, problem.c
    at = law.locate(v)
    left = c * law.value(v, at.piece) - xi
    if np.any(at.on):
        right = np.where(at.on, c * law.value(v, at.piece + at.on) - xi, left)
        jump = law.kind(at) != BEND
    else:
        right = left
        jump = np.zeros(v.shape, dtype=bool)
    descent = steeper(left, right, jump)
    largest = np.max(np.abs(descent) / c, axis=-1, initial=0.0)
    return Slopes(at, left, right, descent, jump, largest / problem.scale(xi))


def steeper(left: Array, right: Array, jump: Flags) -> Array:
    """Return the steeper descending slope at jumps of b, 0 where none descends.

    Elsewhere the derivative.
    """
    climb_right = np.maximum(-right, 0.0)
    climb_left = np.maximum(left, 0.0)
    return np.where(jump, np.where(climb_right >= climb_left, -climb_right, climb_left), right)


# -- Newton's equations ----------------------------------------------------------------------------


def directions(
    body: CondensedBody, free: Flags, stiffness: Array, g: Array, careful: bool = False
) -> Array:
    """Return (R, m) d with (A_FF + diag k) d_F = −g_F and 0 elsewhere.

    Rows in which that matrix is not positive definite get k lifted to at least 0. Of small systems
    only those get it whose d does not descend.

    stiffness: k = c b′ [N/m per m]
    careful:   lift in all small systems, too
    """
    loaded = free & (np.abs(stiffness) > _NEGLIGIBLE_SLOPE * np.diagonal(body.A_tilde))
    held = ~free | loaded
    n_free = np.count_nonzero(free, axis=1)
    n_held = np.count_nonzero(held, axis=1)
    n_least = np.minimum(n_free, n_held)
    softens = np.any(loaded & (stiffness < 0.0), axis=1)
    trusted = softens & (n_least <= (0 if careful else MAX_TRUSTED))
    stacked = (trusted | ~softens) & (n_least <= MAX_STACKED)
    held_cost = np.where(softens & ~trusted, _INDEFINITE_COST, 1.0) * n_held
    on_held = (held_cost < n_free) & body.shared
    if body.loose:  # its systems may be singular, so each is solved alone
        stacked[:] = trusted[:] = False
    g = np.where(free, g, 0.0)
    systems = _Systems(body, free, loaded, held, stiffness, g, stacked, trusted)
    d = systems.solve_on_free(~on_held)
    if np.any(on_held):
        d[on_held] = systems.solve_on_held(on_held)
    d[~free] = 0.0
    rows = np.flatnonzero(trusted)
    uphill = rows[~(np.einsum("ri,ri->r", g[rows], d[rows]) < 0.0)]
    if len(uphill):
        lifted = np.maximum(stiffness[uphill], 0.0)
        d[uphill] = directions(body, free[uphill], lifted, g[uphill])
    return d


@dataclass(eq=False)
class _Systems:
    """Newton's equations of R rows.

    free, loaded, held: (R, m) the nodes F, those of them with k ≠ 0, the nodes K
    stiffness, g:       (R, m) k, and g with 0 on nodes that stick
    stacked, trusted:   (R,) solved with others in one call; solved before k is lifted
    """

    body: CondensedBody
    free: Flags
    loaded: Flags
    held: Flags
    stiffness: Array
    g: Array
    stacked: Flags
    trusted: Flags

    def solve_on_free(self, chosen: Flags) -> Array:
        """Return (R, m) d of the chosen rows, 0 of all others."""
        d = np.zeros(self.free.shape)
        rows = np.flatnonzero(self.stacked & chosen)
        d[rows] = _solve_stacked(
            self.body.A_tilde, self.free[rows], self.stiffness[rows], -self.g[rows]
        )
        for i in np.flatnonzero(~self.stacked & chosen):
            nodes = self.free[i].nonzero()[0]
            k, rhs = self.stiffness[i].take(nodes), -self.g[i].take(nodes)
            d[i, nodes] = _solve_free(self.body, nodes, k, rhs, bool(self.trusted[i]))
        return d

    def solve_on_held(self, chosen: Flags) -> Array:
        """Return d of the chosen rows, through the forces z on their nodes K."""
        compliance = self.body.inverse
        y = np.zeros(self.free.shape)
        z = np.zeros(self.free.shape)
        y[chosen] = -(self.g[chosen] @ compliance)
        rows = np.flatnonzero(self.stacked & chosen)
        if len(rows):
            softness = np.zeros(self.free.shape)
            np.divide(1.0, self.stiffness, out=softness, where=self.loaded)
            z[rows] = _solve_stacked(compliance, self.held[rows], softness[rows], y[rows])
        k = np.where(self.loaded, self.stiffness, 0.0)
        for i in np.flatnonzero(~self.stacked & chosen):
            nodes = self.held[i].nonzero()[0]
            y_K = y[i].take(nodes)
            z[i, nodes] = _solve_held(
                self.body, nodes, k[i].take(nodes), y_K, bool(self.trusted[i])
            )
        return np.asarray(y[chosen] - z[chosen] @ compliance)


def _solve_stacked(M: Array, mask: Flags, diagonal: Array, rhs: Array) -> Array:
    """Return (R, m) x with (M + diag) x = rhs on the masked nodes of each row.

    Systems of similar size go to LAPACK in one stack. x is 0 where a system is singular.
    """
    x = np.zeros(mask.shape)
    size = np.count_nonzero(mask, axis=1)
    order = np.argsort(~mask, axis=1, kind="stable")
    width = np.minimum(mask.shape[1], -(-size // _STACK_WIDTH) * _STACK_WIDTH)
    for n in np.unique(width[size > 0]):
        rows = np.flatnonzero(width == n)
        nodes = order[rows, :n]
        valid = np.arange(n) < size[rows, None]
        entries = nodes[:, :, None] * len(M) + nodes[:, None, :]
        stack = M.reshape(-1).take(entries)
        stack *= valid[:, :, None] & valid[:, None, :]
        added = np.where(valid, np.take_along_axis(diagonal[rows], nodes, 1), 1.0)
        np.einsum("rii->ri", stack)[...] += added
        right = np.where(valid, np.take_along_axis(rhs[rows], nodes, 1), 0.0)
        solution = _solve_regular(stack, right)
        x[rows[:, None], nodes] = np.where(valid, solution, 0.0)
    return x


def _solve_regular(stack: Array, rhs: Array) -> Array:
    """Return (R, n) the solutions of systems, 0 of those that are singular."""
    try:
        return np.asarray(np.linalg.solve(stack, rhs[..., None])[..., 0])
    except np.linalg.LinAlgError:
        if len(stack) == 1:  # the law softens by as much as the body is stiff
            return np.zeros(rhs.shape)
    alone = [_solve_regular(stack[[row]], rhs[[row]]) for row in range(len(stack))]
    return np.concatenate(alone)


def _solve_positive(matrix: Array, rhs: Array) -> tuple[Array, int]:
    """Return the solution with a symmetric matrix (overwritten) and LAPACK's info.

    info is 0 if the matrix is positive definite.
    """
    _, x, info = scipy.linalg.lapack.dposv(matrix.T, rhs, lower=1, overwrite_a=1)
    return x, info


def _solve_free(body: CondensedBody, free: Index, k: Array, rhs: Array, trusted: bool) -> Array:
    """Return (n,) d of one row on its free nodes."""
    if not len(free):
        return rhs
    matrix = with_diagonal(body.A_tilde, free, k)
    if body.loose and _is_lost(matrix):
        return _proximal_step(body, free, np.maximum(k, 0.0), rhs)
    x, info = _solve_positive(matrix, rhs)
    if info == 0:
        return x
    if trusted:
        return _solve_regular(with_diagonal(body.A_tilde, free, k)[None], rhs[None])[0]
    lifted = np.maximum(k, 0.0)
    matrix = with_diagonal(body.A_tilde, free, lifted)
    if not (body.loose and _is_lost(matrix)):
        x, info = _solve_positive(matrix, rhs)
        if info == 0:
            return x
    return _proximal_step(body, free, lifted, rhs)


def _is_lost(matrix: Array) -> bool:
    """Return whether a matrix is singular to rounding, as that of a loose body; not indefinite."""
    return cholesky(matrix.copy())[1] == 0 and is_singular(matrix)


def _proximal_step(body: CondensedBody, free: Index, k: Array, rhs: Array) -> Array:
    """Return a step of a body that contact alone holds, and too little; up-jumps stop it."""
    proximal = k + _PROXIMAL * np.diagonal(body.A_tilde)[free]
    x, info = _solve_positive(with_diagonal(body.A_tilde, free, proximal), rhs)
    return x if info == 0 else np.zeros(len(free))


def _solve_held(body: CondensedBody, held: Index, k: Array, y: Array, trusted: bool) -> Array:
    """Return (n,) forces z of one row on the nodes that stick or have k ≠ 0."""
    if not len(held):
        return y
    softness = np.divide(1.0, k, out=np.zeros(len(k)), where=k != 0.0)
    matrix = with_diagonal(body.inverse, held, softness)
    n_softening = np.count_nonzero(k < 0.0)
    if n_softening == 0:
        return _solve_positive(matrix, y)[0]
    factor, pivots, z, _ = scipy.linalg.lapack.dsysv(
        matrix.T, y, lwork=64 * len(held), lower=1, overwrite_a=1
    )
    n_negative = np.count_nonzero((pivots > 0) & (np.diagonal(factor) < 0.0))
    n_negative += np.count_nonzero(pivots < 0) // 2  # blocks of two rows have one each
    if not trusted and n_negative != n_softening:
        rises = k >= 0.0
        z = np.zeros(len(k))
        z[rises] = _solve_held(body, held[rises], k[rises], y[rises], trusted)
    return z


# -- saddles ---------------------------------------------------------------------------------------


def leave_saddles(rows: ContactProblem, v: Array, xi: Array, s: Slopes) -> tuple[Array, Flags]:
    """Return points of less energy where there are such, and whether, for stationary v (R, m).

    They lie towards the first kink along ±d of negative curvature. Until a node reaches its next
    kink the energy of a piecewise-linear law is an exact parabola that opens downwards: the first
    step ends there. Exponential pieces may need shorter ones.
    """
    body, law = rows.body, rows.law
    free, piece = s.free, s.piece
    stiffness = np.where(free, body.c * law.slope(v, piece), 0.0)
    target = v.copy()
    is_saddle = np.zeros(len(v), dtype=bool)
    for i in np.flatnonzero(np.any(stiffness < 0.0, axis=1)):
        nodes = np.flatnonzero(free[i])
        curvature = negative_curvature(body.A_tilde, nodes, stiffness[i, nodes])
        if curvature is None:
            continue
        direction = np.zeros(body.m)
        direction[nodes] = curvature
        slope = np.where(direction > 0.0, s.right[i], s.left[i])
        slope[direction == 0.0] = 0.0  # at a ray it is infinite
        if float(slope @ direction) > 0.0:
            direction = -direction
        upper, lower = law.upper.take(piece[i]), law.lower.take(piece[i])
        end = np.where(direction > 0.0, upper, lower)
        reach = np.full(body.m, np.inf)
        np.divide(end - v[i], direction, out=reach, where=direction != 0.0)
        length = float(np.min(reach[reach > 0.0], initial=np.inf))
        if not np.isfinite(length):
            continue
        index = np.array([i])
        row = rows.take(index)
        at = Place(s.at.piece[index], s.at.on[index])
        for part in _SADDLE_STEPS:
            end = v[i] + part * length * direction
            change, work = row.energy_change(v[index], end[None], xi[index], at)
            if change[0] < -ROUNDINGS * np.finfo(float).eps * work[0]:
                target[i] = end
                is_saddle[i] = True
                break
    return target, is_saddle


# -- convex model ----------------------------------------------------------------------------------


def convex_step(problem: ContactProblem, v: Array) -> Array | None:
    """Return the minimum of the model at v (m,), None if the iteration fails.

    Nodes on an up-jump at the minimum are put on it to the bit.
    """
    elements = _elements(problem.law.tables, problem.law.node_index(problem.m))
    matrix = problem.A_tilde.copy()
    _diagonal(matrix)[:] += problem.c * elements.slope
    load = problem.l_tilde - problem.c * _rest_of_law(problem, v, elements)
    if not len(elements.s):
        _, w, info = scipy.linalg.lapack.dposv(matrix, load, lower=1)
        return w if info == 0 else None
    model = _ConvexModel(problem, matrix, load, elements)
    point = model.start(v)
    first = mu = model.complementarity(point)
    for _ in range(_MAX_INTERIOR_STEPS):
        if mu <= _COMPLEMENTARITY * first:
            break
        change = model.predict_and_correct(point, mu)
        if change is None:
            break
        length = change.length_from(point, _TO_BOUNDARY)
        if not (length > _MIN_INTERIOR_STEP and np.all(np.isfinite(change.w))):
            break
        point = point.moved(change, length)
        mu = model.complementarity(point)
    if not mu <= _USEFUL_COMPLEMENTARITY * first:
        return None
    return model.on_jumps(point)


@dataclass(frozen=True, eq=False)
class _Elements:
    """Elements of b_↑ at every node, (n, m) each.

    A node with fewer elements than others has some of sign 0 and of the scale of b, which act on
    nothing.

    s, h, gamma: as in the head of this file; h is infinite for outer pieces
    sign:        −1 for the outer piece on the left, whose slip counts to the left, and for a ray,
                 a jump without a cap
    kink:        of an up-jump its index, −1 for a piece
    slope:       (m,) least slope of b_↑
    """

    s: Array
    h: Array
    gamma: Array
    sign: Array
    kink: Array
    slope: Array


def _elements(laws: Laws, index: Index) -> _Elements:
    """Return the elements of laws, given by their tables; exponential pieces rise end to end."""
    low, high = laws.lower, laws.upper
    is_outer = ~(np.isfinite(low) & np.isfinite(high))
    start, end = np.where(is_outer, laws.s_0, low), np.where(is_outer, laws.s_0, high)
    width = np.where(is_outer, 1.0, end - start)
    with np.errstate(invalid="ignore"):  # to the left of a ray
        rise = laws.value(end, laws.addresses) - laws.value(start, laws.addresses)
    slope = np.maximum(np.where(laws.bent & ~is_outer, rise / width, laws.q), 0.0)
    least = np.min(slope, axis=1, keepdims=True)
    extra = np.where(slope > least, slope - least, 1.0)
    is_jump = laws.kinds == UP
    is_ray = laws.outside[:, :-1]
    is_steeper = (slope > least) & (low < high)
    is_element = np.append(is_jump, is_steeper, axis=1)
    is_used = np.any(is_element[np.unique(index)], axis=0)

    def column(of_jump: ArrayLike, of_piece: ArrayLike, otherwise: float) -> Array:
        jumps = np.where(is_jump, of_jump, otherwise)
        pieces = np.where(is_steeper, of_piece, otherwise)
        return np.append(jumps, pieces, axis=1)[:, is_used][index].T

    b_scale = laws.at(index).b_scale or 1.0
    return _Elements(
        s=column(laws.kinks, np.where(np.isfinite(low), low, high), 0.0),
        h=column(laws.b_right - laws.b_left, np.where(is_outer, np.inf, extra * width), b_scale),
        gamma=column(0.0, 1.0 / extra, 0.0),
        sign=column(np.where(is_ray, -1.0, 1.0), np.where(np.isfinite(low), 1.0, -1.0), 0.0),
        kink=column(np.arange(is_jump.shape[1]), -1.0, -1.0),
        slope=least[index, 0],
    )


def _rest_of_law(problem: ContactProblem, v: Array, elements: _Elements) -> Array:
    """Return (m,) b(v) − b_↑(v) on the descending side of v."""
    law = problem.law
    descent = slopes(problem, v, problem.xi(v)).descent
    piece = np.where(descent <= 0.0, law.piece(v, +1), law.piece(v, -1))
    index = law.node_index(problem.m)
    piece_of_law = piece if law.one else piece - law.tables.first[index]
    s, h, gamma, sign = elements.s, elements.h, elements.gamma, elements.sign
    with np.errstate(divide="ignore", invalid="ignore"):
        of_piece = np.clip(sign * (v - s) / gamma, 0.0, h)
    is_passed = (elements.kink < piece_of_law) & (sign > 0.0)
    of_jump = np.where(is_passed, h, 0.0)
    force = np.where(gamma > 0.0, of_piece, of_jump)
    rising: Array = elements.slope * v + np.sum(sign * force, axis=0)
    return law.value(v, piece) - rising


@dataclass(frozen=True, eq=False)
class _Point:
    """An interior point of the convex model, or a change of it.

    w:      (m,) displacements
    forces: (2, n, m) e and h − e, a variable of its own as a difference would lose its digits
    gaps:   (2, n, m) x⁻ and x⁺; without a cap h on the force x⁺ = 0 beside a force of 1
    """

    w: Array
    forces: Array
    gaps: Array

    def moved(self, change: _Point, length: float) -> _Point:
        return _Point(
            self.w + length * change.w,
            self.forces + length * change.forces,
            self.gaps + length * change.gaps,
        )

    def length_from(self, point: _Point, share: float) -> float:
        """Return how far this change goes: `share` of the way to the boundary, at most 1."""
        lengths = []
        with np.errstate(divide="ignore", invalid="ignore"):
            for size, change in ((point.forces, self.forces), (point.gaps, self.gaps)):
                lengths.append(np.where(change < 0.0, -share * size / change, 1.0))
        return min(1.0, float(np.min(lengths)))


class _ConvexModel:
    """The model's matrix, load and elements, and the steps of the interior point method on it."""

    def __init__(
        self, problem: ContactProblem, matrix: Array, load: Array, elements: _Elements
    ) -> None:
        self.problem = problem
        self.matrix = matrix
        self.load = load
        self.elements = elements
        self.is_capped = np.isfinite(elements.h)
        # e goes with x⁻ and, where there is a cap, h − e with x⁺
        self.is_pair = np.stack([np.ones(elements.h.shape), self.is_capped])
        self.pairs_per_element = 1.0 + float(np.mean(self.is_capped))
        largest_cap = float(np.max(np.abs(elements.h[self.is_capped]), initial=0.0))
        self.size = largest_cap or problem.traction_scale or 1.0

    def start(self, v: Array) -> _Point:
        """Return the point of forces at half their caps, and gaps that no step is to cross."""
        s, h = self.elements.s, self.elements.h
        gamma, sign = self.elements.gamma, self.elements.sign
        is_capped, problem = self.is_capped, self.problem
        size = self.size
        largest_load = np.max(np.abs(problem.l_tilde) + problem.c * size)
        reach = float(largest_load / np.min(_diagonal(self.matrix)))
        if not np.isfinite(reach):
            reach = 0.0
        reach = max(float(np.max(np.abs(v - s))), reach)
        e = np.where(is_capped, 0.5 * h, size)
        gap = sign * (v - s) - gamma * e
        behind = np.where(is_capped, np.maximum(gap, 0.0) + reach, 0.0)
        return _Point(
            v.copy(),
            forces=np.stack([e, np.where(is_capped, h - e, 1.0)]),
            gaps=np.stack([np.maximum(-gap, 0.0) + reach, behind]),
        )

    def complementarity(self, point: _Point) -> float:
        """Return the mean product μ of a force and its gap."""
        count = self.elements.s.size * self.pairs_per_element
        return float(np.sum(point.forces * point.gaps)) / count

    def predict_and_correct(self, point: _Point, mu: float) -> _Point | None:
        """Return the change by Mehrotra's two solutions with one factor, None without a factor."""
        gamma, sign = self.elements.gamma, self.elements.sign
        forces, gaps, c = point.forces, point.gaps, self.problem.c
        theta = gamma + gaps[1] / forces[1] + gaps[0] / forces[0]
        friction = c * np.sum(sign * forces[0], axis=0)
        balance = self.load - self.matrix @ point.w - friction
        missing = sign * (point.w - self.elements.s) - gamma * forces[0] - gaps[1] + gaps[0]
        lifted = self.matrix.copy()
        _diagonal(lifted)[:] += c * np.sum(sign**2 / theta, axis=0)
        factor, info = cholesky(lifted)
        if info != 0:
            return None

        def solve(target: Array) -> _Point:
            """Return the change after which force · gap has changed by `target`, to first order."""
            gap = missing - target[1] / forces[1] + target[0] / forces[0]
            rhs = balance - c * np.sum(sign * gap / theta, axis=0)
            w = scipy.linalg.lapack.dpotrs(factor, rhs, lower=1)[0]
            e = (sign * w + gap) / theta
            capped = np.stack([e, np.where(self.is_capped, -e, 0.0)])
            return _Point(w, capped, (target - gaps * np.stack([e, -e])) / forces)

        predictor = solve(-self.is_pair * forces * gaps)
        after = point.moved(predictor, predictor.length_from(point, 1.0))
        left = float(np.sum(after.forces * after.gaps))
        share = left / (mu * theta.size * self.pairs_per_element)
        centre = mu * min(1.0, share) ** 3
        second_order = predictor.forces * predictor.gaps
        return solve(self.is_pair * (centre - forces * gaps - second_order))

    def on_jumps(self, point: _Point) -> Array:
        """Return w (m,), put to the bit on the jumps whose force is inside its range."""
        s = self.elements.s
        h = np.where(self.is_capped, self.elements.h, self.size)
        w = point.w
        reach = max(np.max(np.abs(w - s)), np.finfo(float).tiny)
        sticks = np.all(point.gaps < point.forces / h * reach, axis=0)
        row, node = np.nonzero((self.elements.kink >= 0) & sticks)
        w[node] = np.broadcast_to(s, h.shape)[row, node]
        return w
