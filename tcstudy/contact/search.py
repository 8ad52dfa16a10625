"""Starts from which descent finds less energy: graduated nonconvexity, and moves of single nodes.

The problems with the envelopes b_κ of the laws, κ growing from below λ₁, are solved in turn. The
first is convex, and each is a start of the next one (Blake & Zisserman, Visual Reconstruction, MIT
Press 1987).

At a strict local minimum v let F be the nodes that do not stick on an up-jump and H = A_FF + C b_F′
≻ 0. If node i is put at s and the others of F follow on their pieces (linearised), the energy
changes by c_i φ_i(s),

    φ_i(s) = ½ (k_i/c_i) (s − v_i)² − (ξ_i/c_i) (s − v_i) + j(s) − j(v_i),
    k_i = 1/(H⁻¹)_ii − c_i b_i′ for i in F,   k_i = ã_ii − ã_iFᵀ H⁻¹ ã_Fi for a sticking node.

This is exact for linear pieces as long as no other node leaves its piece. It is an estimate only:
descent puts it to the test.

Moreau envelopes of friction laws are the closest laws from below whose softening slope is nowhere
steeper than κ:

    j_κ(s) = conv(j + ½κ s²)(s) − ½κ s²,  b_κ = j_κ′

(Rockafellar & Wets, Variational Analysis, 1.44; the Lasry–Lions or double envelope). j_κ ≤ j, j_κ
grows with κ to j, and b_κ is b except on common tangents [s₁, s₂], where b_κ = σ − κ s:

    b(s₁) + κ s₁ = σ = b(s₂) + κ s₂,   ∫_{s₁}^{s₂} (σ − κ s − b) ds = 0      (Maxwell's equal areas)

Up-jumps stay, down-jumps and steep softening become lines of slope −κ. With κ ≤ λ₁ the problem with
b_κ is convex, and its least energy is a lower bound of the original one.

The tangents of h = j + ½κ s² start as those of its samples: samples above the line between their
neighbours are left out until none is. Then Newton steps move both ends to where h′ is the slope of
the line between them. Where two tangents have no arc between them, the tangent from the first end
to the last one lies below.
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

_MAX_JUMP = 1e-8
"""Jumps of an envelope below this part of the scale of b come from unfinished tangents."""
_SAMPLES = 6
"""Samples of every piece for the convex hull."""
_MAX_TANGENT_STEPS = 60
"""Most Newton steps that make the tangents of the samples exact."""
_MAX_END_MOVE = 1e-11
"""Part of the length of a tangent by which an end that is exact may still move in a step."""


def moreau_envelopes(laws: Laws, kappa: float) -> Laws:
    """Return b_κ of the laws in use.

    Laws whose softening slope is nowhere steeper than κ stay as they are.

    kappa: > 0 [Pa/m]
    """
    tables = laws.tables
    steep = np.intersect1d(np.flatnonzero(tables.falls > kappa), laws.index)
    law, ends = _sampled_tangents(tables, steep, kappa)
    is_exact = False
    steps = 0
    while True:
        has_length = ends[0] < ends[1]
        law = law[has_length]
        ends = ends[:, has_length]
        law_of_end = tables.at(law)
        begin, end = ends
        mean_b = law_of_end.integral(begin, end) / (end - begin)
        sigma = mean_b + 0.5 * kappa * (begin + end)
        # neighbours without an arc between them are one tangent, from the first end to the last
        is_new_law = law[1:] != law[:-1]
        has_arc = (end[:-1] < begin[1:]) | (sigma[:-1] < sigma[1:])
        is_apart = is_new_law | has_arc
        if not np.all(is_apart):
            is_first = np.append(True, is_apart)
            is_last = np.append(is_apart, True)
            law = law[is_first]
            ends = np.stack([begin[is_first], end[is_last]])
        elif is_exact or steps == _MAX_TANGENT_STEPS:
            break
        else:
            ends = _moved_ends(law_of_end, ends, sigma, kappa)
            moves = np.abs(ends - (begin, end))
            is_exact = bool(np.all(moves <= _MAX_END_MOVE * (end - begin)))
            steps += 1
    return _assembled(tables, kappa, law, begin, end, sigma).at(laws.index)


def _moved_ends(laws: Laws, ends: Array, sigma: Array, kappa: float) -> Array:
    """Return the ends (2, n) of tangents after a Newton step towards h′ = σ.

    The step crosses no down-jump, and keeps a kink where h′ rises across σ.
    """
    place = laws.locate(ends)
    before = laws.value(ends, place.piece) + kappa * ends - sigma
    behind = laws.value(ends, place.piece + place.on) + kappa * ends - sigma
    is_right_end = np.array([[False], [True]])
    is_down_jump = laws.kind(place) == DOWN
    goes_right = (behind < 0.0) & (is_right_end | ~((before > 0.0) | is_down_jump))
    excess_left = np.where(is_right_end & is_down_jump, 0.0, np.maximum(before, 0.0))
    excess = np.where(goes_right, behind, excess_left)
    piece = place.toward(goes_right)
    bend = laws.slope(ends, piece) + kappa
    step = excess / np.where(bend > 0.0, bend, np.inf)
    return np.clip(ends - step, *laws.ends(piece))


def _sampled_tangents(tables: Laws, rows: Index, kappa: float) -> tuple[Index, Array]:
    """Return (law (n,), ends (2, n)) of common tangents of h at samples of the named laws.

    They are sorted by law and from left to right.
    """
    s, law, piece, rank = _samples(tables, rows, kappa)
    j = tables.at(law).integral(np.zeros(len(s)), s)
    h = j + 0.5 * kappa * s**2
    hull = np.arange(len(s))
    while True:
        same_law = law[hull][1:] == law[hull][:-1]
        distance = np.where(same_law, np.diff(s[hull]), 1.0)
        rise = np.diff(h[hull]) / distance
        is_inner = same_law[1:] & same_law[:-1]
        is_above = is_inner & (rise[1:] <= rise[:-1])
        if not np.any(is_above):
            break
        hull = hull[~np.concatenate([[False], is_above, [False]])]
    begin, end = hull[:-1][same_law], hull[1:][same_law]
    end_in_piece = np.minimum(s[end], tables.upper.take(piece[begin]))
    first_slope = tables.slope(s[begin], piece[begin])
    last_slope = tables.slope(end_in_piece, piece[begin])
    is_steep = np.minimum(first_slope, last_slope) < -kappa
    skips_samples = rank[end] > rank[begin] + 1
    is_tangent = is_steep | skips_samples
    begin = begin[is_tangent]
    end = end[is_tangent]
    return law[begin], np.stack([s[begin], s[end]])


def _samples(tables: Laws, rows: Index, kappa: float) -> tuple[Array, Index, Index, Index]:
    """Return (slip, law, piece, rank) of the samples of the named laws, from left to right."""
    reach = (far(tables) + 4.0 * tables.scales / kappa)[rows, None]
    low = np.clip(tables.lower[rows], -reach, reach)
    high = np.clip(tables.upper[rows], -reach, reach)
    share = np.linspace(0.0, 1.0, _SAMPLES, endpoint=False)
    s = low[..., None] + share * (high - low)[..., None]
    has_width = (low < high) & ~tables.outside[rows]
    is_used = np.broadcast_to(has_width[..., None], s.shape).copy()
    is_used[:, 1:, 0] &= tables.kinds[rows] != DOWN  # no tangent touches a down-jump
    law = np.broadcast_to(rows[:, None, None], s.shape)
    piece = np.broadcast_to(tables.addresses[rows][..., None], s.shape)
    return s[is_used], law[is_used], piece[is_used], np.flatnonzero(is_used)


def _assembled(
    tables: Laws, kappa: float, law: Index, begin: Array, end: Array, sigma: Array
) -> Laws:
    """Return the laws with the lines σ − κ s from `begin` to `end`.

    The changed laws have three kinds of pieces: those that stay, the lines, and the remainder of
    the piece in which a line ends.
    """
    covered = np.zeros(tables.q.shape, dtype=bool)
    lower = tables.lower[law]
    is_inside = (lower >= begin[:, None]) & (lower <= end[:, None])
    np.logical_or.at(covered, law, is_inside)
    is_changed = np.isin(np.arange(len(covered)), law)
    has_width = tables.lower < tables.upper
    kept_piece = tables.addresses[~covered & has_width & is_changed[:, None]]
    place = tables.locate(end, law)
    meets_next = (law[1:] == law[:-1]) & (end[:-1] >= begin[1:])
    has_remainder = ~np.append(meets_next, False)[: len(law)]
    cut_piece = (place.piece + place.on)[has_remainder]

    table_row = np.concatenate([kept_piece // tables.q.shape[1], law, law[has_remainder]])
    start = np.concatenate([tables.lower.take(kept_piece), begin, end[has_remainder]])
    order = np.lexsort([start, table_row])
    table_row = table_row[order]
    start = start[order]
    rank = np.arange(len(table_row)) - np.searchsorted(table_row, table_row)
    largest_rank = int(np.max(rank, initial=0))
    width = max(tables.q.shape[1], largest_rank + 1)

    # kinks are the starts of all pieces but the first
    kinks = np.full((len(tables.q), width - 1), np.inf)
    kinks[:, : tables.kinks.shape[1]] = tables.kinks
    kinks[is_changed] = np.inf
    has_kink = rank > 0
    kinks[table_row[has_kink], rank[has_kink] - 1] = start[has_kink]

    nearest_end = np.where(np.abs(begin) <= np.abs(end), begin, end)
    slope = np.full(len(law), -kappa)
    lines = [nearest_end, sigma - kappa * nearest_end, slope]
    lines += [0.0 * slope] * (len(tables.pieces) - len(lines))
    columns = []
    for column, line in zip(tables.pieces, lines, strict=True):
        missing = width - column.shape[1]
        padding = np.repeat(column[:, -1:], missing, axis=1)
        new_column = np.append(column, padding, axis=1)
        numbers = np.concatenate([column.take(kept_piece), line, column.take(cut_piece)])[order]
        new_column[table_row] = numbers[:, None]  # pads a row with its last number
        new_column[table_row, rank] = numbers
        columns.append(new_column)
    envelopes = Laws(tables.name, kinks, *columns).known(scales=tables.scales)
    return envelopes.smooth_to(_MAX_JUMP * tables.scales[:, None])


_FIRST_KAPPA = 0.9
"""First κ over λ₁."""
LOOSE = 1e-3
"""Tolerance of the convexified problems. In trials 1e-6 gave the same energies, 1e-2 higher."""
GROWTH = 4.0
"""Factor from one κ to the next.

Of 486 problems 2, 4, 8 left 9, 11, 22 above the lowest energy known, before moves of single nodes;
without envelopes it was 92.
"""
MAX_MOVES_TRIED = 2
"""Moves of single nodes that are tried for each row, the most promising first."""
_MIN_GAIN = 1e-10
"""Gains below this part of the terms that they are made of are rounding."""


def envelope_starts(rows: ContactProblem, v: Array) -> tuple[Array, Flags]:
    """Return (starts (R, m), (R,) whether a start is proved to be the lowest solution).

    It is if the first, convex problem is the original one at its solution. Of a loose body no
    problem is convex.

    v: (R, m) where the first problem begins
    """
    starts = v.copy()
    is_lowest = np.zeros(len(v), dtype=bool)
    active = np.arange(len(v))
    kappa = _FIRST_KAPPA * rows.body.softest
    is_first = True
    stiffest = float(np.max(np.diagonal(rows.body.A_tilde) / rows.body.c))
    max_kappa = np.minimum(rows.law.omega_by_row, stiffest)
    while len(active):
        laws = moreau_envelopes(rows.law, kappa)
        convexified = ContactProblem.on(rows.body, rows.l_tilde, laws)
        if is_first and rows.body.shared:
            end = descend_nested(convexified, v, LOOSE, coarse=LOOSE)
        else:
            end = descend(convexified, v, LOOSE, minima=not is_first)
        has_line = np.any(_on_tangent(laws, end.v, kappa), axis=1)
        starts[active] = end.v
        if is_first:
            is_convex = not rows.body.loose
            is_lowest[active] = is_convex & ~has_line & (end.residual <= LOOSE)
        kappa = GROWTH * kappa
        is_first = False
        still_open = np.flatnonzero(has_line & (kappa < max_kappa[active]))
        rows = rows.take(still_open)
        active = active[still_open]
        v = end.v[still_open]
    return starts, is_lowest


def _on_tangent(laws: Laws, v: Array, kappa: float) -> Flags:
    """Return whether slips are inside a line of slope −κ of the envelopes."""
    place = laws.locate(v)
    has_slope = laws.q.take(place.piece) == -kappa
    return ~place.on & has_slope & ~laws.bent.take(place.piece)


def move_starts(rows: ContactProblem, v: Array) -> tuple[Array, Index, Index]:
    """Return (starts (n, m), their rows (n,), their ranks (n,)), the best move of a row first.

    There is none for rows whose free nodes have no positive definite matrix, or where no move
    promises less energy.
    """
    body, laws = rows.body, rows.law
    xi = rows.xi(v)
    push = largest_push(laws)[laws.index]
    first_order = slopes(rows, v, xi)
    added = body.c * laws.slope(v, first_order.piece)
    starts = [np.empty((0, body.m))]
    owners = list[int]()
    ranks = list[int]()
    for row, is_free in enumerate(first_order.free):
        response = _responses(body.A_tilde, is_free, added[row])
        if response is None:
            continue
        k = np.einsum("ij,ji->i", body.A_tilde, response) / body.c
        if body.loose:  # with it a node may move the whole body
            k = np.maximum(k, body.softest)
        force = xi[row] / body.c
        gain, place = best_places(laws.of_nodes(row), v[row], force, k, push[row])
        count = min(MAX_MOVES_TRIED, np.count_nonzero(gain))
        nodes = np.argsort(gain * body.c, kind="stable")[:count]
        move = (place - v[row])[nodes, None]
        starts.append(v[row] + response.T[nodes] * move)
        owners += [row] * len(nodes)
        ranks += range(len(nodes))
    row_of_start = np.array(owners, dtype=np.intp)
    return np.concatenate(starts), row_of_start, np.array(ranks, dtype=np.intp)


def _responses(A_tilde: Array, is_free: Flags, added: Array) -> Array | None:
    """Return (m, m) columns: how nodes move if one moves by 1 and the free ones relax.

    None if A_FF + diag `added` is not positive definite.
    """
    free, stuck = np.flatnonzero(is_free), np.flatnonzero(~is_free)
    factor, info = factor_free(A_tilde, free, added[free])
    if info != 0:
        return None
    response = np.eye(len(A_tilde))
    if len(free):
        half = np.tril(scipy.linalg.lapack.dpotri(factor, lower=1)[0])
        inverse = half + np.tril(half, -1).T
        response[np.ix_(free, free)] = inverse / np.diagonal(inverse)
        response[np.ix_(free, stuck)] = -inverse @ A_tilde[np.ix_(free, stuck)]
    return response


def best_places(laws: Laws, v: Array, force: Array, k: Array, push: Array) -> tuple[Array, Array]:
    """Return (φ, s) (m,): the least φ of every node and where it is reached [Pa·m, m].

    φ is 0 where nothing is gained. Candidates are the kinks and, on every piece, where Newton's
    steps towards φ′ = b + k (s − v) − ξ/c = 0 lead from its ends.

    force: ξ/c [Pa];  k: [Pa/m]
    push:  how hard friction may push the slip on [Pa]
    """
    law = np.broadcast_to(laws.index, v.shape)[:, None]
    v = v[:, None]
    force = force[:, None]
    k = k[:, None]
    piece = laws.first[law] + np.arange(laws.q.shape[1])
    kinks = laws.upper.take(piece)
    # friction opposes slip, but for its push
    largest_force = np.abs(force) + np.reshape(push, (-1, 1))
    reach = 2.0 * np.abs(v) + largest_force / k
    low = np.clip(laws.lower.take(piece), v - reach, v + reach)
    high = np.clip(kinks, v - reach, v + reach)
    has_width = (low < high) & ~laws.outside.take(piece)
    piece = laws.inside(piece)  # values to the left of a ray are not used
    anchor = laws.s_0.take(piece)
    low = np.where(has_width, low, anchor)
    high = np.where(has_width, high, anchor)
    candidates = [np.where(np.isfinite(kinks), kinks, v)]
    steps = 8 if laws.exponentials else 1
    for s in (low, high):
        for _ in range(steps):
            climb = laws.value(s, piece) + k * (s - v) - force
            bend = laws.slope(s, piece) + k
            step = climb / np.where(bend > 0.0, bend, np.inf)
            s = np.clip(s - step, low, high)
        candidates.append(np.where(has_width, s, v))
    s = np.concatenate(candidates, axis=1)
    move = s - v
    friction = laws.at(law).integral(v, s)
    terms = np.stack([0.5 * k * move**2, -force * move, friction])
    phi = terms.sum(axis=0)
    phi[phi >= -_MIN_GAIN * np.abs(terms).sum(axis=0)] = 0.0
    best = np.arange(len(s)), np.argmin(phi, axis=1)
    return phi[best], s[best]
