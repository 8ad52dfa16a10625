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

from tcstudy.contact.bounds import largest_push, rising_zeros, slip_of_slope
from tcstudy.contact.descent import descend, descend_nested
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
        nested = first and rows.body.shared
        ended = (
            descend_nested(smooth, v, LOOSE, coarse=LOOSE) if nested else descend(smooth, v, LOOSE, minima=not first)
        )
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
    added, response = body.c * rows.law.slope(v, s.piece), dict[int, Array]()
    for i, free in enumerate(s.free):
        nodes = np.flatnonzero(free)
        found = responses(body.A_tilde, nodes, added[i, nodes])
        response |= {} if found is None else {i: found}
    known, c = np.array(list(response), dtype=np.intp), body.c
    stiffness = np.array([np.einsum("ij,ji->i", body.A_tilde, one) for one in response.values()]).reshape(-1, body.m)
    gain, place = best_places(rows.law.of_nodes(known), v[known], xi[known] / c, stiffness / c)
    starts, owners, promises = [np.empty((0, body.m))], list[int](), list[int]()
    for i, own_gain, own_place in zip(known.tolist(), gain * c, place, strict=True):
        nodes = np.argsort(own_gain, kind="stable")[: min(PROMISES, np.count_nonzero(own_gain))]
        starts.append(v[i] + response[i].T[nodes] * (own_place - v[i])[nodes, None])
        owners += [i] * len(nodes)
        promises += range(len(nodes))
    return np.concatenate(starts), np.array(owners, dtype=np.intp), np.array(promises, dtype=np.intp)


def responses(A: Array, free: Index, added: Array) -> Array | None:
    """(m, m) columns: how nodes move if one moves by 1 and the free ones relax; None unless A_FF + diag `added` ≻ 0.

    The stiffness k_i of a node so moved is that of its column, (A · response)_ii.
    """
    factor, info = factor_free(A, free, added)
    if info != 0:
        return None
    response, held = np.eye(len(A)), np.setdiff1d(np.arange(len(A)), free)
    if len(free):
        half = np.tril(scipy.linalg.lapack.dpotri(factor, lower=1)[0])
        inverse = half + np.tril(half, -1).T
        response[np.ix_(free, free)] = inverse / np.diagonal(inverse)
        response[np.ix_(free, held)] = -inverse @ A[np.ix_(free, held)]
    return response


def best_places(laws: Laws, v: Array, force: Array, k: Array) -> tuple[Array, Array]:
    """(φ, s), shape of v: the least φ, 0 where nothing is gained, and where it is taken [Pa·m, m]."""
    tables, law, at = laws.tables, laws.index, laws.locate(v)
    gain, place = np.zeros(v.shape), v.copy()
    reach = 2.0 * np.abs(v) + (np.abs(force) + largest_push(tables)[law]) / k  # friction opposes slip, but for its push

    def consider(s: Array) -> None:
        known = np.isfinite(s)
        s = np.where(known, s, v)
        move = s - v
        parts = np.stack([0.5 * k * move**2, -force * move, laws.integral(v, s, at)])
        phi = parts.sum(axis=0)
        better = known & (phi < -_NO_GAIN * np.abs(parts).sum(axis=0)) & (phi < gain)
        gain[better], place[better] = phi[better], s[better]

    for column in range(tables.q.shape[1]):
        piece = np.broadcast_to((tables.first + column)[law], v.shape)
        if np.any(tables.lower[:, column] < tables.upper[:, column]):
            consider(_stationary(tables, piece, v, force, k, reach))
        if column and np.any(tables.kinds[:, column - 1] == UP):
            consider(np.where(tables.kind_above.take(piece - 1) == UP, tables.lower.take(piece), np.nan))
    return gain, place


def _stationary(tables: Laws, piece: Index, v: Array, force: Array, k: Array, reach: Array) -> Array:
    """Where φ is least inside the addressed pieces, NaN where it is not or v is on that piece.

    b′ is monotone on a piece, so that φ′ = b + k (s − v) − ξ/c rises on one part of it at most; reach: of zeros from v
    """
    ends = [np.clip(end.take(piece), v - reach, v + reach) for end in (tables.lower, tables.upper)]
    inside = np.flatnonzero((ends[0] < ends[1]) & ((v <= ends[0]) | (v >= ends[1])))
    found, address = np.full(v.size, np.nan), piece.ravel()[inside]
    own_v, own_force, own_k, low, high = (x.ravel()[inside] for x in (v, force, k, *ends))

    def climb(i: Index | slice, s: Array) -> tuple[Array, Array, Array]:
        value, slope = tables.value_and_slope(s, address[i])
        rest = own_k[i] * (s - own_v[i]) - own_force[i]
        return value + rest, slope + own_k[i], np.abs(value) + np.abs(rest)

    rises = [climb(slice(None), s)[1] > 0.0 for s in (low, high)]
    turns = np.flatnonzero(rises[0] != rises[1])
    turn = slip_of_slope(tables, address[turns], low[turns], high[turns], -own_k[turns])
    low[turns], high[turns] = np.where(rises[0][turns], low[turns], turn), np.where(rises[1][turns], high[turns], turn)
    below, above = (climb(slice(None), s)[0] for s in (low, high))
    on = np.flatnonzero((below < 0.0) & (above > 0.0) & (rises[0] | rises[1]))
    found[inside[on]] = rising_zeros(lambda i, s: climb(on[i], s), 0.5 * (low + high)[on], low[on], high[on])
    return found.reshape(v.shape)
