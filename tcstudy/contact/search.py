"""Starts from which descent finds less energy: graduated nonconvexity, and exchanges of single nodes.

The problems with the envelopes b_κ of the laws, κ growing from below λ₁, are solved one after the other: the first is
convex, and each is a start of the next one (Blake & Zisserman, Visual Reconstruction, MIT Press 1987).

At a strict local minimum v let F be the nodes that do not rest on an up-jump and H = A_FF + C b_F′ ≻ 0. If node i is
put at s and the others of F follow on their pieces (linearised), the energy changes by c_i φ_i(s),

    φ_i(s) = ½ (k_i/c_i) (s − v_i)² − (ξ_i/c_i) (s − v_i) + j(s) − j(v_i),
    k_i = 1/(H⁻¹)_ii − c_i b_i′ for i in F,   k_i = ã_ii − ã_iFᵀ H⁻¹ ã_Fi for a resting node,

exactly so for linear pieces as long as nobody else leaves its piece. A promise only: descent puts it to the test.
"""

from __future__ import annotations

import numpy as np
import scipy.linalg
from numpy.typing import NDArray

from tcstudy.contact.descent import descend
from tcstudy.contact.envelopes import moreau_envelopes, on_tangent
from tcstudy.contact.factors import factor_free
from tcstudy.contact.newton import slopes
from tcstudy.contact.problem import ContactProblem
from tcstudy.laws.laws import Laws
from tcstudy.laws.pieces import UP

Array = NDArray[np.float64]
Index = NDArray[np.intp]
Flags = NDArray[np.bool_]

_BELOW = 0.9
"""First κ over λ₁."""
LOOSE = 1e-3
"""Tolerance of the convexified problems; 1e-6 led to the same energies in trials, 1e-2 to higher ones."""
GROWTH = 4.0
"""Factor from one κ to the next. Of 486 problems 2, 4, 8 left 9, 11, 22 above the lowest energy known, before moves
of single nodes; 92 were above it before."""
PROMISES = 2
"""How many promises of a move are put to the test."""
_STEPS = 5
"""Newton steps for the stationary point on an exponential piece; a linear one needs one."""
_NO_GAIN = 1e-10
"""Gains below this part of the terms that they are made of are rounding."""


def envelope_starts(rows: ContactProblem, v: Array) -> tuple[Array, Flags]:
    """(starts (R, m), whether the first, convex problem is the original one at its solution, which then is the lowest).

    v: (R, m) where the first problem begins
    """
    lowest = np.zeros(len(v), dtype=bool)
    found, at, kappa, first = v.copy(), np.arange(len(v)), _BELOW * rows.body.lambda_1, True
    stiffest = float(np.max(np.diagonal(rows.body.A_tilde) / rows.body.c))
    ceiling = np.minimum(rows.law.omega_by_row, stiffest)
    while len(at):
        laws = moreau_envelopes(rows.law, kappa)
        smooth = ContactProblem.on(rows.body, rows.l_tilde, laws)
        ended = descend(smooth, v, LOOSE, minima=not first)
        on_line = np.any(on_tangent(laws, kappa, ended.v), axis=1)
        found[at] = ended.v
        if first:
            lowest[at] = ~on_line & (ended.residual <= LOOSE)
        kappa, first = GROWTH * kappa, False
        on = np.flatnonzero(on_line & (kappa < ceiling[at]))
        rows, at, v = rows.take(on), at[on], ended.v[on]
    return found, lowest


def move_starts(rows: ContactProblem, v: Array) -> tuple[Array, Index, Index]:
    """(starts (n, m), the rows they belong to (n,), which promise of its row each is (n,)), the best promise first.

    None for rows whose free nodes have no positive definite matrix, or where no move promises less energy.
    """
    body, xi = rows.body, rows.xi(v)
    s = slopes(rows, v, xi)
    free, added = s.free, body.c * rows.law.slope(v, s.piece)
    stiffness, factors = np.full(v.shape, np.nan), {}
    for i in range(len(v)):
        nodes = np.flatnonzero(free[i])
        factor, info = factor_free(body.A_tilde, nodes, added[i, nodes])
        if info == 0:
            stiffness[i] = relaxed_stiffness(body.A_tilde, nodes, np.flatnonzero(~free[i]), factor, added[i, nodes])
            factors[i] = nodes, factor
    known = np.array(sorted(factors), dtype=np.intp)
    c = body.c
    laws = rows.law.of_nodes(known)
    gain, place = best_places(laws, laws.index, v[known], xi[known] / c, stiffness[known] / c)
    gain = gain * c
    starts, owners, promises = [], [], []
    for i, own_gain, own_place in zip(known, gain, place, strict=True):
        order = np.argsort(own_gain, kind="stable")[: min(PROMISES, np.count_nonzero(own_gain))]
        for promise, node in enumerate(order):
            step = follow(body.A_tilde, *factors[int(i)], int(node), float(own_place[node] - v[i, node]))
            starts.append(v[i] + step)
            owners.append(i)
            promises.append(promise)
    shape = len(starts), v.shape[1]
    return np.array(starts).reshape(shape), np.array(owners, dtype=np.intp), np.array(promises, dtype=np.intp)


def relaxed_stiffness(A: Array, free: Index, resting: Index, factor: Array, added: Array) -> Array:
    """(m,) k_i: how stiff a node is while the free ones follow; factor: Cholesky, lower, of H = A_FF + diag added."""
    stiffness = np.diagonal(A).copy()
    if len(free):
        inverse = np.tril(scipy.linalg.lapack.dtrtri(factor, lower=1)[0])
        stiffness[free] = 1.0 / np.einsum("ij,ij->j", inverse, inverse) - added
        if len(resting):
            held = scipy.linalg.blas.dtrmm(1.0, inverse, A.take(free, axis=0).take(resting, axis=1), lower=1)
            stiffness[resting] -= np.einsum("ij,ij->j", held, held)
    return stiffness


def follow(A: Array, free: Index, factor: Array, node: int, move: float) -> Array:
    """(m,) step of all nodes if one is moved and the free ones relax."""
    step, place = np.zeros(len(A)), int(np.searchsorted(free, node))
    if place < len(free) and free[place] == node:
        unit = np.zeros(len(free))
        unit[place] = 1.0
        response = scipy.linalg.lapack.dpotrs(factor, unit, lower=1)[0]
        step[free] = response * (move / response[place])
    elif len(free):
        step[free] = -move * scipy.linalg.lapack.dpotrs(factor, A[free, node], lower=1)[0]
    step[node] = move
    return step


def best_places(tables: Laws, law: Index, v: Array, force: Array, k: Array) -> tuple[Array, Array]:
    """(φ, s), shape of v: the least φ, 0 where nothing is gained, and where it is taken [Pa·m, m]."""
    gain, place, at = np.zeros(v.shape), v.copy(), tables.locate(v, law)

    def consider(s: Array) -> None:
        known = np.isfinite(s)
        s = np.where(known, s, v)
        move = s - v
        parts = 0.5 * k * move**2, -force * move, tables.integral(v, s, at, tables.locate(s, law))
        phi = parts[0] + parts[1] + parts[2]
        size = np.abs(parts[0]) + np.abs(parts[1]) + np.abs(parts[2])
        better = known & (phi < -_NO_GAIN * size) & (phi < gain)
        gain[better], place[better] = phi[better], s[better]

    for column in range(tables.q.shape[1]):
        if not np.all(np.isinf(tables.lower[:, column])) or column == 0:
            for s in _stationary(tables, law, column, v, force, k):
                consider(s)
    for column in np.flatnonzero(np.any(tables.kinds == UP, axis=0)).tolist():
        s = np.where(tables.kinds[:, column] == UP, tables.kinks[:, column], np.nan)[law]
        consider(np.broadcast_to(s, v.shape))
    return gain, place


def _stationary(tables: Laws, law: Index, column: int, v: Array, force: Array, k: Array) -> list[Array]:
    """Stationary slips of φ inside one piece of every law, NaN where there is none or v is on that piece.

    Newton begins at the end of the piece that is nearest to v. A law that falls like an exponential is steepest there
    and φ concave; so it begins also where the slip would be without the exponential, beyond the minimum.
    """
    piece = np.broadcast_to((tables.first + column)[law], v.shape)
    low, high = tables.lower.take(piece), tables.upper.take(piece)
    elsewhere = ((v <= low) | (v >= high)) & (low < high)
    starts, steps = [np.clip(v, low, high)], 1
    if np.any(tables.bent[:, column]):
        with np.errstate(divide="ignore", invalid="ignore"):
            q = tables.q.take(piece)
            beyond = (force + k * v - tables.b_0.take(piece) + q * tables.s_0.take(piece)) / (q + k)
        starts, steps = [starts[0], np.clip(beyond, low, high)], _STEPS
    found = []
    for s in starts:
        s = np.where(elsewhere & np.isfinite(s), s, np.nan)
        for _ in range(steps):
            slope = tables.slope(s, piece) + k
            defect = tables.value(s, piece) + k * (s - v) - force
            s = np.where(slope > 0.0, np.clip(s - defect / np.where(slope > 0.0, slope, 1.0), low, high), np.nan)
        found.append(np.where((low < s) & (s < high), s, np.nan))
    return found
