"""Starts from which descent finds less energy: graduated nonconvexity, and exchanges of single
nodes.

The problems with the envelopes b_κ of the laws, κ growing from below λ₁, are solved one after the
other: the first is convex, and each is a start of the next one (Blake & Zisserman, Visual
Reconstruction, MIT Press 1987).

At a strict local minimum v let F be the nodes that do not rest on an up-jump and H = A_FF + C b_F′
≻ 0. If node i is put at s and the others of F follow on their pieces (linearised), the energy
changes by c_i φ_i(s),

    φ_i(s) = ½ (k_i/c_i) (s − v_i)² − (ξ_i/c_i) (s − v_i) + j(s) − j(v_i),
    k_i = 1/(H⁻¹)_ii − c_i b_i′ for i in F,   k_i = ã_ii − ã_iFᵀ H⁻¹ ã_Fi for a resting node,

exactly so for linear pieces as long as nobody else leaves its piece. A promise only: descent puts
it to the test.

Moreau envelopes of friction laws are laws whose b falls nowhere faster than κ, from below and as
close as can be:

j_κ(s) = conv(j + ½κ s²)(s) − ½κ s²,  b_κ = j_κ′ (Rockafellar & Wets, Variational Analysis, 1.44; the Lasry–Lions or
double envelope). j_κ ≤ j, j_κ grows with κ to j, and b_κ is b except on common tangents [s₁, s₂], where b_κ = σ − κ s:

    b(s₁) + κ s₁ = σ = b(s₂) + κ s₂,   ∫_{s₁}^{s₂} (σ − κ s − b) ds = 0      (equal areas, as Maxwell's rule has it)

Up-jumps stay, down-jumps and steep falls become falls of slope −κ. With κ ≤ λ₁ the problem with b_κ
is convex, and its least energy is a lower bound of the original one.

The tangents of h = j + ½κ s² are those that samples of it have, samples above the line between
those beside them left out until there are none; then both ends go by Newton's steps to where h′ is
the slope of the line between them. Where two tangents no longer leave an arc between them the one
from first to last lies below.
"""

from __future__ import annotations

import numpy as np
import scipy.linalg
from numpy.typing import NDArray

from tcstudy.contact.certificates import far, largest_push
from tcstudy.contact.descent import descend, descend_nested
from tcstudy.contact.newton import factor_free, slopes
from tcstudy.contact.problem import ContactProblem
from tcstudy.laws.laws import Laws
from tcstudy.laws.pieces import DOWN

Array = NDArray[np.float64]
Index = NDArray[np.intp]
Flags = NDArray[np.bool_]

_CONTINUOUS = 1e-8
"""Jumps of an envelope below this part of the scale of b come from unfinished tangents."""


_SAMPLES, _TOUCHES, _SETTLED = 6, 60, 1e-11
"""Samples of every piece for the convex hull, Newton steps at most by which the tangents found are
made exact, and the part of its length by which none moves any more."""


def moreau_envelopes(laws: Laws, kappa: float) -> Laws:
    """b_κ of the laws in use; κ > 0 [Pa/m]. Those that nowhere fall faster than κ stay as they
    are."""
    tables = laws.tables
    law, ends = _tangents(
        tables, np.intersect1d(np.flatnonzero(tables.falls > kappa), laws.index), kappa
    )
    right, settled, steps = np.array([[False], [True]]), False, 0
    while True:
        law, ends = law[ends[0] < ends[1]], ends[:, ends[0] < ends[1]]
        own, (s, t) = tables.at(law), ends
        sigma = own.integral(s, t) / (t - s) + 0.5 * kappa * (s + t)
        apart = (
            (law[1:] != law[:-1]) | (t[:-1] < s[1:]) | (sigma[:-1] < sigma[1:])
        )  # or the tangent of both lies below
        if not np.all(apart):
            first, last = np.append(True, apart), np.append(apart, True)
            law, ends = law[first], np.stack([s[first], t[last]])
        elif settled or steps == _TOUCHES:
            break
        else:  # a Newton step towards h′ = σ, across no down-jump; a kink where h′ rises across σ is kept
            at = own.locate(ends)
            before, behind = (
                own.value(ends, piece) + kappa * ends - sigma
                for piece in (at.piece, at.piece + at.on)
            )
            down = own.kind(at) == DOWN
            onward = (behind < 0.0) & (right | ~((before > 0.0) | down))
            excess = np.where(onward, behind, np.where(right & down, 0.0, np.maximum(before, 0.0)))
            piece = at.toward(onward)
            bend = own.slope(ends, piece) + kappa
            ends = np.clip(ends - excess / np.where(bend > 0.0, bend, np.inf), *own.ends(piece))
            steps, settled = steps + 1, bool(np.all(np.abs(ends - (s, t)) <= _SETTLED * (t - s)))
    return _assembled(tables, kappa, law, s, t, sigma).at(laws.index)


def _tangents(tables: Laws, rows: Index, kappa: float) -> tuple[Index, Array]:
    """(law (n,), from and to (2, n)) of common tangents of the named laws from left to right, to
    the next samples."""
    reach, piece = (far(tables) + 4.0 * tables.scales / kappa)[rows, None], tables.addresses[rows]
    low, high = (
        np.clip(tables.lower[rows], -reach, reach),
        np.clip(tables.upper[rows], -reach, reach),
    )
    share = np.linspace(0.0, 1.0, _SAMPLES, endpoint=False)
    s = low[..., None] + share * (high - low)[..., None]
    used = np.broadcast_to((low < high)[..., None], s.shape).copy()
    used[:, 1:, 0] &= tables.kinds[rows] != DOWN  # which no tangent touches
    law, piece = (
        np.broadcast_to(x, s.shape)[used] for x in (rows[:, None, None], piece[..., None])
    )
    s, number, kept = s[used], np.flatnonzero(used), np.arange(np.count_nonzero(used))
    h = tables.at(law).integral(np.zeros(len(s)), s) + 0.5 * kappa * s**2
    while True:
        same = law[kept][1:] == law[kept][:-1]
        rise = np.diff(h[kept]) / np.where(same, np.diff(s[kept]), 1.0)
        above = same[1:] & same[:-1] & (rise[1:] <= rise[:-1])
        if not np.any(above):
            break
        kept = kept[~np.concatenate([[False], above, [False]])]
    i, j = kept[:-1][same], kept[1:][same]
    ends = s[i], np.minimum(s[j], tables.upper.take(piece[i]))
    falls = np.minimum(*(tables.slope(end, piece[i]) for end in ends)) < -kappa
    bridged = falls | (number[j] > number[i] + 1)
    return law[i[bridged]], np.stack([s[i[bridged]], s[j[bridged]]])


def _assembled(
    tables: Laws, kappa: float, law: Index, left: Array, right: Array, sigma: Array
) -> Laws:
    """The laws with the lines σ − κ s between left and right."""
    covered = np.zeros(tables.q.shape, dtype=bool)
    inside = (tables.lower[law] >= left[:, None]) & (tables.lower[law] <= right[:, None])
    np.logical_or.at(covered, law, inside)
    changed = np.isin(np.arange(len(covered)), law)
    stays = tables.addresses[~covered & (tables.lower < tables.upper) & changed[:, None]]
    near, at = np.where(np.abs(left) <= np.abs(right), left, right), tables.locate(right, law)
    joined = np.append((law[1:] == law[:-1]) & (right[:-1] >= left[1:]), False)[: len(law)]
    behind = (at.piece + at.on)[~joined]
    slope = np.full(len(near), -kappa)
    lines = (near, sigma - kappa * near, slope, *[0.0 * slope] * (len(tables.pieces) - 3))
    owner = np.concatenate([stays // tables.q.shape[1], law, law[~joined]])
    starts = np.concatenate([tables.lower.take(stays), left, right[~joined]])
    order = np.lexsort([starts, owner])
    owner, starts = owner[order], starts[order]
    rank = np.arange(len(owner)) - np.searchsorted(owner, owner)
    width = max(tables.q.shape[1], int(np.max(rank, initial=0)) + 1)
    kinks = np.full(
        (len(tables.q), width), np.inf
    )  # of the left ends of all pieces but the first, and one behind
    kinks[:, : tables.kinks.shape[1]] = tables.kinks
    kinks[changed] = np.inf
    kinks[owner[rank > 0], rank[rank > 0] - 1] = starts[rank > 0]
    columns = []
    for numbers, line in zip(tables.pieces, lines, strict=True):
        column = np.append(
            numbers, np.repeat(numbers[:, -1:], width - numbers.shape[1], axis=1), axis=1
        )
        own = np.concatenate([numbers.take(stays), line, numbers.take(behind)])[order]
        column[owner] = own[:, None]  # its last number stays
        column[owner, rank] = own
        columns.append(column)
    found = Laws(tables.name, kinks[:, :-1], *columns).known(scales=tables.scales)
    return found.smooth_to(_CONTINUOUS * tables.scales[:, None])


_BELOW = 0.9
"""First κ over λ₁."""
LOOSE = 1e-3
"""Tolerance of the convexified problems; 1e-6 led to the same energies in trials, 1e-2 to higher
ones."""
GROWTH = 4.0
"""Factor from one κ to the next. Of 486 problems 2, 4, 8 left 9, 11, 22 above the lowest energy
known, before moves of single nodes; 92 were above it before."""
PROMISES = 2
"""How many promises of a move are put to the test."""
_NO_GAIN = 1e-10
"""Gains below this part of the terms that they are made of are rounding."""


def envelope_starts(rows: ContactProblem, v: Array) -> tuple[Array, Flags]:
    """(starts (R, m), whether the first, convex problem is the original one at its solution, which
    then is the lowest).

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
            descend_nested(smooth, v, LOOSE, coarse=LOOSE)
            if nested
            else descend(smooth, v, LOOSE, minima=not first)
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
    """(starts (n, m), the rows they belong to (n,), which promise of its row each is (n,)), the
    best promise first.

    None for rows whose free nodes have no positive definite matrix, or where no move promises less
    energy.
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
        response = np.eye(
            body.m
        )  # columns: how nodes move if one moves by 1 and the free ones relax
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
    return (
        np.concatenate(starts),
        np.array(owners, dtype=np.intp),
        np.array(promises, dtype=np.intp),
    )


def best_places(laws: Laws, v: Array, force: Array, k: Array, push: Array) -> tuple[Array, Array]:
    """(φ, s) (m,): the least φ of every node, 0 where nothing is gained, and where it is taken
    [Pa·m, m].

    Candidates are the kinks and, on every piece, where Newton's steps towards φ′ = b + k (s − v) −
    ξ/c = 0 lead from its ends. push: how hard friction may push the slip on [Pa]
    """
    law = np.broadcast_to(laws.index, v.shape)[:, None]
    v, force, k = v[:, None], force[:, None], k[:, None]
    piece = laws.first[law] + np.arange(laws.q.shape[1])
    reach = (
        2.0 * np.abs(v) + (np.abs(force) + np.reshape(push, (-1, 1))) / k
    )  # friction opposes slip, but for its push
    kinks = laws.upper.take(piece)
    low, high = (np.clip(end, v - reach, v + reach) for end in (laws.lower.take(piece), kinks))
    real, found = low < high, [np.where(np.isfinite(kinks), kinks, v)]
    low, high = (np.where(real, end, laws.s_0.take(piece)) for end in (low, high))
    for s in (low, high):
        for _ in range(8 if laws.exponentials else 1):
            climb, bend = laws.value(s, piece) + k * (s - v) - force, laws.slope(s, piece) + k
            s = np.clip(s - climb / np.where(bend > 0.0, bend, np.inf), low, high)
        found.append(np.where(real, s, v))
    s = np.concatenate(found, axis=1)
    parts = np.stack([0.5 * k * (s - v) ** 2, -force * (s - v), laws.at(law).integral(v, s)])
    phi = parts.sum(axis=0)
    phi[phi >= -_NO_GAIN * np.abs(parts).sum(axis=0)] = 0.0
    best = np.arange(len(s)), np.argmin(phi, axis=1)
    return phi[best], s[best]
