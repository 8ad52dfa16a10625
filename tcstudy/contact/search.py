"""Starts from which descent finds less energy: graduated nonconvexity, and exchanges of single nodes.

The problems with the envelopes b_κ of the laws, κ growing from below λ₁, are solved one after the other: the first is
convex, and each is a start of the next one (Blake & Zisserman, Visual Reconstruction, MIT Press 1987).

At a strict local minimum v let F be the nodes that do not rest on an up-jump and H = A_FF + C b_F′ ≻ 0. If node i is
put at s and the others of F follow on their pieces (linearised), the energy changes by c_i φ_i(s),

    φ_i(s) = ½ (k_i/c_i) (s − v_i)² − (ξ_i/c_i) (s − v_i) + j(s) − j(v_i),
    k_i = 1/(H⁻¹)_ii − c_i b_i′ for i in F,   k_i = ã_ii − ã_iFᵀ H⁻¹ ã_Fi for a resting node,

exactly so for linear pieces as long as nobody else leaves its piece. A promise only: descent puts it to the test.

Moreau envelopes of friction laws are laws whose b falls nowhere faster than κ, from below and as close as can be:

j_κ(s) = conv(j + ½κ s²)(s) − ½κ s²,  b_κ = j_κ′ (Rockafellar & Wets, Variational Analysis, 1.44; the Lasry–Lions or
double envelope). j_κ ≤ j, j_κ grows with κ to j, and b_κ is b except on common tangents [s₁, s₂], where b_κ = σ − κ s:

    b(s₁) + κ s₁ = σ = b(s₂) + κ s₂,   ∫_{s₁}^{s₂} (σ − κ s − b) ds = 0      (equal areas, as Maxwell's rule has it)

Up-jumps stay, down-jumps and steep falls become falls of slope −κ. With κ ≤ λ₁ the problem with b_κ is convex, and its
least energy is a lower bound of the original one.

b′ is monotone on a piece, so that b + κ s rises on one part of it at most: an arc of h = j + ½κ s² that the envelope
may touch, as it may touch a kink. Arcs of all laws stand in one row. An arc into which the tangent from the one before
rises more steeply than the tangent to the next one rises out of it lies above what these two span, and the envelope
does not touch it: all such are left out at once, until there are none.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import scipy.linalg
from numpy.typing import NDArray

from tcstudy.contact.certificates import far, largest_push, rising_zeros, slip_of_slope
from tcstudy.contact.descent import descend, descend_nested
from tcstudy.contact.newton import factor_free, slopes
from tcstudy.contact.problem import ContactProblem
from tcstudy.laws.laws import Laws
from tcstudy.laws.pieces import DOWN, UP, Place

Array = NDArray[np.float64]
Index = NDArray[np.intp]
Flags = NDArray[np.bool_]

_CONTINUOUS = 1e-8
"""Jumps of an envelope below this part of the scale of b come from unfinished tangents."""


class _Arcs(NamedTuple):
    """Where h is convex on a piece: the law, the address, from and to, h′ there; a kink is an arc of no length."""

    law: Index
    piece: Index
    low: Array
    high: Array
    first: Array
    last: Array

    def take(self, which: Index | Flags) -> _Arcs:
        return _Arcs._make(x[which] for x in self)


def moreau_envelopes(laws: Laws, kappa: float) -> Laws:
    """b_κ of the laws in use; κ > 0 [Pa/m]. Those that nowhere fall faster than κ stay as they are."""
    tables = laws.tables
    arcs = _arcs(tables, np.intersect1d(np.flatnonzero(tables.falls > kappa), laws.index), kappa)
    land, leave, sigma = np.full((3, len(arcs.law)), -np.inf)  # of every arc, of the one before it, of both
    new = np.append(False, arcs.law[1:] == arcs.law[:-1])
    while np.any(new):
        i = np.flatnonzero(new)
        leave[i], land[i], sigma[i] = _tangents(tables, kappa, arcs.take(i - 1), arcs.take(i))
        out = np.append(sigma[1:], -np.inf)
        kept = ~((out < sigma) & (np.append(arcs.law[1:], -1) == arcs.law))
        new = np.append(False, ~kept[:-1])[kept] & np.append(False, arcs.law[kept][1:] == arcs.law[kept][:-1])
        arcs, land, leave, sigma = arcs.take(kept), land[kept], leave[kept], sigma[kept]
    return _assembled(tables, kappa, arcs, land, leave, sigma).at(laws.index)


def _arcs(tables: Laws, rows: Index, kappa: float) -> _Arcs:
    """The arcs of the named laws, law by law from left to right."""
    reach = (far(tables) + 4.0 * tables.scales / kappa)[rows, None]
    low, high = np.clip(tables.lower[rows], -reach, reach), np.clip(tables.upper[rows], -reach, reach)
    piece = tables.addresses[rows]
    begins, ends = (tables.slope(s, piece) > -kappa for s in (low, high))
    real, turn = low < high, np.where(begins, high, low)
    turns = real & (begins != ends)
    turn[turns] = slip_of_slope(tables, piece[turns], low[turns], high[turns], -kappa)
    joined = np.append(np.zeros((len(rows), 1), dtype=bool), ends[:, :-1], axis=1)  # the arc before ends on the kink
    before = np.maximum(piece - 1, tables.first[rows, None])
    is_kink = real & ~begins & ~joined & (np.arange(low.shape[1]) > 0) & (tables.kind_above.take(before) != DOWN)
    is_arc = real & (begins | ends)
    start, end = np.where(begins, low, turn), np.where(ends, high, turn)
    law = np.broadcast_to(rows[:, None], low.shape)

    def slope(s: Array, address: Index) -> Array:
        return tables.value(s, address) + kappa * s

    kinks = (law, piece, low, low, slope(low, before), slope(low, piece))
    parts = (law, piece, start, end, slope(start, piece), slope(end, piece))
    chosen = np.stack([is_kink, is_arc], axis=-1)
    return _Arcs._make(np.stack(both, axis=-1)[chosen] for both in zip(kinks, parts, strict=True))


def _touches(tables: Laws, kappa: float, arcs: _Arcs, sigma: Array, start: Array) -> Array:
    """Where h′ = σ on arcs, or their ends on that side; sought from `start` on."""
    _, piece, low, high, first, last = arcs
    inside = (first < sigma) & (sigma < last) & (low < high)
    straight = low + (sigma - first) / np.where(inside, tables.q.take(piece) + kappa, 1.0)
    s = np.where(inside, straight, np.where(sigma <= first, low, high))
    bent = np.flatnonzero(inside & tables.bent.take(piece))
    piece, sigma = piece[bent], sigma[bent]

    def excess(k: Index, s: Array) -> tuple[Array, Array, Array]:
        value, slope = tables.value(s, piece[k]), tables.slope(s, piece[k])
        return value + kappa * s - sigma[k], slope + kappa, kappa * np.abs(s) + np.abs(sigma[k])

    s[bent] = rising_zeros(excess, start[bent], low[bent], high[bent])
    return s


def _tangents(tables: Laws, kappa: float, left: _Arcs, right: _Arcs) -> tuple[Array, Array, Array]:
    """(s₁, s₂, σ) of common tangents, where ∫ σ − h′ between, which rises with σ, is 0; none where arcs join."""
    x, y, sigma = left.high.copy(), right.low.copy(), left.last.copy()
    apart = np.flatnonzero((x < y) | (tables.kind_above.take(right.piece - 1) == DOWN))
    both = zip(left.take(apart), right.take(apart), strict=True)
    n, ends = len(apart), _Arcs._make(np.concatenate(pair) for pair in both)
    at, none = 0.5 * (ends.low + ends.high), np.zeros(n, dtype=bool)

    def excess(k: Index, own: Array) -> tuple[Array, Array, Array]:
        sides = np.append(k, k + n)
        at[sides] = _touches(tables, kappa, ends.take(sides), np.tile(own, 2), at[sides])
        s, t = at[k], at[k + n]
        width, places = t - s, (Place(ends.piece[side], none[k]) for side in (k, k + n))
        rest = tables.integral(s, t, *places) + (0.5 * kappa * (s + t) - own) * width
        return -rest, width, width * (np.abs(own) + kappa * (np.abs(s) + np.abs(t)))

    far_off = np.full(n, np.inf)
    sigma[apart] = rising_zeros(excess, 0.5 * (ends.last[:n] + ends.first[n:]), -far_off, far_off)
    x[apart], y[apart] = at[:n], at[n:]
    return x, y, sigma


def _assembled(tables: Laws, kappa: float, arcs: _Arcs, land: Array, leave: Array, sigma: Array) -> Laws:
    """The laws with, of every arc, the tangent that leads to it and its own piece from where that lands."""
    ends = np.append(leave[1:], np.inf)
    ends[np.append(arcs.law[1:] != arcs.law[:-1], True)] = np.inf
    near = np.where(np.abs(leave) <= np.abs(land), leave, land)
    near, none = np.where(np.isfinite(near), near, 0.0), np.zeros(len(near))
    tangent = (near, sigma - kappa * near, none - kappa, *[none] * (len(tables.pieces) - 3))
    there = np.stack([land > leave, ends > land], axis=1)
    law, starts = np.repeat(arcs.law[:, None], 2, axis=1)[there], np.stack([leave, land], axis=1)[there]
    rank = np.arange(len(law)) - np.searchsorted(law, law)
    width = max(tables.q.shape[1], int(np.max(rank, initial=0)) + 1)
    kinks = np.full((len(tables.q), width), np.inf)  # of the left ends of all pieces but the first, and one behind
    kinks[:, : tables.kinks.shape[1]] = tables.kinks
    kinks[law] = np.inf
    kinks[law[rank > 0], rank[rank > 0] - 1] = starts[rank > 0]
    columns = []
    for numbers, line in zip(tables.pieces, tangent, strict=True):
        column = np.repeat(numbers[:, -1:], width, axis=1)
        column[:, : numbers.shape[1]] = numbers
        own = np.stack([line, numbers.take(arcs.piece)], axis=1)[there]
        column[law] = own[:, None]  # its last number stays
        column[law, rank] = own
        columns.append(column)
    found = Laws(tables.name, kinks[:, :-1], *columns).known(scales=tables.scales)
    return found.smooth_to(_CONTINUOUS * tables.scales[:, None])


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
        place = laws.locate(ended.v)
        on_tangent = ~place.on & (laws.q.take(place.piece) == -kappa) & ~laws.bent.take(place.piece)
        on_line = np.any(on_tangent, axis=1)
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
    body, c, xi, laws = rows.body, rows.body.c, rows.xi(v), rows.law
    s, push = slopes(rows, v, xi), largest_push(laws)[laws.index]
    added = c * laws.slope(v, s.piece)
    starts, owners, promises = [np.empty((0, body.m))], list[int](), list[int]()
    for i, free in enumerate(s.free):
        nodes, held = np.flatnonzero(free), np.flatnonzero(~free)
        factor, info = factor_free(body.A_tilde, nodes, added[i, nodes])
        if info != 0:
            continue
        response = np.eye(body.m)  # columns: how nodes move if one moves by 1 and the free ones relax
        if len(nodes):
            half = np.tril(scipy.linalg.lapack.dpotri(factor, lower=1)[0])
            inverse = half + np.tril(half, -1).T
            response[np.ix_(nodes, nodes)] = inverse / np.diagonal(inverse)
            response[np.ix_(nodes, held)] = -inverse @ body.A_tilde[np.ix_(nodes, held)]
        k = np.einsum("ij,ji->i", body.A_tilde, response) / c
        gain, place = best_places(laws.of_nodes(i), v[i], xi[i] / c, k, push[i])
        best = np.argsort(gain * c, kind="stable")[: min(PROMISES, np.count_nonzero(gain))]
        starts.append(v[i] + response.T[best] * (place - v[i])[best, None])
        owners += [i] * len(best)
        promises += range(len(best))
    return np.concatenate(starts), np.array(owners, dtype=np.intp), np.array(promises, dtype=np.intp)


def best_places(laws: Laws, v: Array, force: Array, k: Array, push: Array) -> tuple[Array, Array]:
    """(φ, s) (m,): the least φ of every node, 0 where nothing is gained, and where it is taken [Pa·m, m].

    Candidates are the up-jumps and, on every piece that v is not on, the zero of φ′ = b + k (s − v) − ξ/c: b′ is
    monotone there, so that φ′ rises on one part of it at most. push: how hard friction may push the slip on [Pa]
    """
    law = np.broadcast_to(laws.index, v.shape)[:, None]
    v, force, k = v[:, None], force[:, None], k[:, None]
    piece = laws.first[law] + np.arange(laws.q.shape[1])
    reach = 2.0 * np.abs(v) + (np.abs(force) + np.reshape(push, (-1, 1))) / k  # friction opposes slip, but for its push
    low, high = (np.clip(end.take(piece), v - reach, v + reach) for end in (laws.lower, laws.upper))
    at = np.nonzero((low < high) & ((v <= low) | (v >= high)))
    address, low, high = piece[at], low[at], high[at]
    own_v, own_force, own_k = (x[at[0], 0] for x in (v, force, k))

    def climb(i: Index | slice, s: Array) -> tuple[Array, Array, Array]:
        value, slope = laws.value(s, address[i]), laws.slope(s, address[i])
        rest = own_k[i] * (s - own_v[i]) - own_force[i]
        return value + rest, slope + own_k[i], np.abs(value) + np.abs(rest)

    rises = [climb(slice(None), s)[1] > 0.0 for s in (low, high)]
    turns = np.flatnonzero(rises[0] != rises[1])
    turn = slip_of_slope(laws, address[turns], low[turns], high[turns], -own_k[turns])
    low[turns], high[turns] = np.where(rises[0][turns], low[turns], turn), np.where(rises[1][turns], high[turns], turn)
    below, above = (climb(slice(None), s)[0] for s in (low, high))
    on = np.flatnonzero((below < 0.0) & (above > 0.0) & (rises[0] | rises[1]))
    zeros = np.full(piece.shape, np.nan)
    zeros[at[0][on], at[1][on]] = rising_zeros(lambda i, s: climb(on[i], s), 0.5 * (low + high)[on], low[on], high[on])
    jumps = np.where(laws.kind_above.take(piece) == UP, laws.upper.take(piece), np.nan)
    s = np.append(zeros, jumps, axis=1)
    s = np.where(np.isfinite(s), s, v)
    parts = np.stack([0.5 * k * (s - v) ** 2, -force * (s - v), laws.at(law).integral(v, s)])
    phi = parts.sum(axis=0)
    phi[phi >= -_NO_GAIN * np.abs(parts).sum(axis=0)] = 0.0
    best = np.arange(len(s)), np.argmin(phi, axis=1)
    return phi[best], s[best]
