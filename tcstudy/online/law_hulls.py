"""Proximal hulls of many laws at once: b_κ of tcstudy/solvers/hull.py, from tables to tables.

j_κ(s) = conv(j + ½κ s²)(s) − ½κ s²,  b_κ = j_κ′: b except on *bridges* [s₁, s₂], where b_κ = σ − κ s with
b(s₁) + κ s₁ = σ = b(s₂) + κ s₂ and ∫ (σ − κ s − b) ds = 0 over the bridge.

The tangents are sought on samples of every law (a convex hull of points, all laws side by side) and then refined on the
pieces. Hulls give starts only, so that a contact set between two samples costs quality, never correctness.
"""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from tcstudy.scene.friction import BEND, DOWN
from tcstudy.solvers.hull import lower_hull
from tcstudy.solvers.law_tables import LawTables

Array = NDArray[np.float64]
Index = NDArray[np.intp]
Flags = NDArray[np.bool_]

_SAMPLES, _REFINEMENTS, _HALVINGS = 8, 5, 12
"""Samples on a piece, tangent iterations, and samples on an outer piece, each half as far out as the one before."""
_CONTINUOUS = 1e-8
"""Jumps of a hull below this part of the scale of b come from unfinished refinement."""


class Bridges(NamedTuple):
    """n bridges of hulls, in growing order law by law: row of the tables, ends s₁ < s₂ [m], σ [Pa]."""

    law: Index
    left: Array
    right: Array
    sigma: Array

    def cover(self, law: Index, s: Array) -> Flags:
        """Whether slips (R, m) of the named laws (R, 1) or (R, m) lie strictly inside a bridge."""
        covered = np.zeros(s.shape, dtype=bool)
        rank = _rank(self.law)
        laws = int(max(np.max(law, initial=0), np.max(self.law, initial=0))) + 1
        for n in range(int(np.max(rank, initial=-1)) + 1):
            left, right = np.full(laws, np.nan), np.full(laws, np.nan)
            mine = rank == n
            left[self.law[mine]], right[self.law[mine]] = self.left[mine], self.right[mine]
            covered |= (left[law] < s) & (s < right[law])
        return covered


def proximal_hulls(tables: LawTables, kappa: float) -> tuple[LawTables, Bridges]:
    """(tables of b_κ, the bridges); κ > 0 [Pa/m]. Laws that nowhere fall faster than κ stay as they are."""
    s = _samples(tables, kappa)
    law = np.broadcast_to(np.arange(len(s), dtype=np.intp)[:, None], s.shape)
    known = np.where(np.isnan(s), 0.0, s)
    zero = np.zeros(s.shape)
    j = tables.integral(zero, known, tables.locate(law, zero), tables.locate(law, known))
    bridges = _refined(tables, kappa, s, *_segments(tables, kappa, s, j))
    return _assembled(tables, kappa, bridges), bridges


def _samples(tables: LawTables, kappa: float) -> Array:
    """(L, S) growing slips at which a hull may touch j, NaN behind: kinks where b does not fall, and inside pieces."""
    count = np.count_nonzero(np.isfinite(tables.kinks), axis=1)
    rows, has = np.arange(len(count)), count > 0
    first = np.where(has, tables.kinks[:, 0], 0.0)
    last = np.where(has, tables.kinks[rows, np.maximum(count - 1, 0)], 0.0)
    decay = np.divide(4.0, np.abs(tables.r), out=np.zeros(tables.r.shape), where=tables.r != 0.0)
    outer = (2.0 * tables.b_scale / kappa + decay.max(axis=1))[:, None] * 0.5 ** np.arange(_HALVINGS)
    low, high = tables.lower[:, 1:-1, None], tables.upper[:, 1:-1, None]
    steep = (tables.a[:, 1:-1] == 0.0) & (tables.q[:, 1:-1] + kappa <= 0.0)  # concave: the hull cannot touch inside
    inside = np.isfinite(high) & ~steep[:, :, None]
    part = np.arange(1, _SAMPLES + 1) / (_SAMPLES + 1)
    with np.errstate(invalid="ignore"):
        inner = np.where(inside, low + (high - low) * part, np.nan).reshape(len(rows), -1)
    held = np.where(np.isfinite(tables.kinks) & (tables.kinds != DOWN), tables.kinks, np.nan)
    columns = [first[:, None] - outer, held, inner, _beside_down_jumps(tables, kappa), last[:, None] + outer]
    s = np.sort(np.concatenate(columns, axis=1), axis=1)
    s[:, 1:][s[:, 1:] == s[:, :-1]] = np.nan
    s = np.sort(s, axis=1)
    return s[:, : int(np.max(np.count_nonzero(np.isfinite(s), axis=1), initial=0))]


def _beside_down_jumps(tables: LawTables, kappa: float) -> Array:
    """(L, 2K) ends of the bridge over every down-jump by itself, exact for linear pieces; NaN where there is none."""
    down = tables.kinds == DOWN
    kink = np.where(down, tables.kinks, 0.0)
    piece = tables.first[:, None] + np.arange(kink.shape[1])
    fall = tables.value(kink, piece) - tables.value(kink, piece + 1)
    rise = [np.sqrt(np.maximum(tables.slope(kink, piece + side) + kappa, 0.0)) for side in (0, 1)]
    with np.errstate(divide="ignore", invalid="ignore"):
        left, right = (fall / (r * (rise[0] + rise[1])) for r in rise)
        fits = down & (left < kink - tables.lower[:, :-1]) & (right < tables.upper[:, 1:] - kink)
        return np.where(
            np.concatenate([fits, fits], axis=1), np.concatenate([kink - left, kink + right], axis=1), np.nan
        )


def _segments(tables: LawTables, kappa: float, s: Array, j: Array) -> tuple[Index, Index, Index]:
    """(law, first, last sample) of the segments of the lower hulls of (s, j + ½κ s²) on which b + κ s does not rise."""
    falling, count = np.flatnonzero(tables.omega > kappa), np.count_nonzero(np.isfinite(s), axis=1)
    y = j + 0.5 * kappa * s * s
    hulls = [lower_hull(s[row, : count[row]].tolist(), y[row, : count[row]].tolist()) for row in falling]
    law = np.repeat(falling, [len(hull) - 1 for hull in hulls])
    first = np.array([i for hull in hulls for i in hull[:-1]], dtype=np.intp)
    last = np.array([i for hull in hulls for i in hull[1:]], dtype=np.intp)
    s_1, s_2 = s[law, first], s[law, last]
    piece = tables.locate(law, s_1).toward(np.ones(len(law), dtype=bool))
    falls = (tables.slope(s_1, piece) + kappa <= 0.0) | (tables.slope(s_2, piece) + kappa <= 0.0)
    bridge = (last > first + 1) | (piece != tables.locate(law, s_2).piece) | falls
    return law[bridge], first[bridge], last[bridge]


def _refined(tables: LawTables, kappa: float, s: Array, law: Index, first: Index, last: Index) -> Bridges:
    """The common tangents, each end kept between the samples beside its own."""
    left, right = s[law, first], s[law, last]
    end = np.count_nonzero(np.isfinite(s), axis=1)[law] - 1
    left_range = s[law, np.maximum(first - 1, 0)], s[law, np.minimum(first + 1, last)]
    right_range = s[law, np.maximum(last - 1, first)], s[law, np.minimum(last + 1, end)]
    for _ in range(_REFINEMENTS):
        sigma = _chord(tables, kappa, law, left, right)
        new_left = np.clip(_tangent(tables, kappa, law, left, sigma), *left_range)
        new_right = np.clip(_tangent(tables, kappa, law, right, sigma), *right_range)
        apart = new_left < new_right
        left, right = np.where(apart, new_left, left), np.where(apart, new_right, right)
    same = law[1:] == law[:-1]
    left[1:] = np.where(same, np.maximum(left[1:], right[:-1]), left[1:])  # bridges may meet but not overlap
    kept = left < right
    law, left, right = law[kept], left[kept], right[kept]
    return Bridges(law, left, right, _chord(tables, kappa, law, left, right))


def _chord(tables: LawTables, kappa: float, law: Index, left: Array, right: Array) -> Array:
    """(n,) slope of the chord of j + ½κ s² [Pa]."""
    integral = tables.integral(left, right, tables.locate(law, left), tables.locate(law, right))
    return integral / (right - left) + 0.5 * kappa * (left + right)


def _tangent(tables: LawTables, kappa: float, law: Index, s: Array, sigma: Array) -> Array:
    """(n,) one Newton step for b + κ s = σ on the piece at the side where the solution lies; s itself on an up-jump."""
    moved, at = s.copy(), tables.locate(law, s)
    for side, piece in ((-1, at.piece), (1, at.piece + at.on)):
        excess = tables.value(s, piece) + kappa * s - sigma
        slope = tables.slope(s, piece) + kappa
        step = np.where((slope > 0.0) & (side * excess < 0.0), -excess / np.where(slope > 0.0, slope, 1.0), 0.0)
        target = np.clip(s + step, tables.lower.take(piece), tables.upper.take(piece))
        moved = np.where(step != 0.0, target, moved)
    return moved


def _assembled(tables: LawTables, kappa: float, bridges: Bridges) -> LawTables:
    """Tables of the laws that are σ − κ s on the bridges and as they were between them."""
    L, K = tables.kinks.shape
    own = np.repeat(np.arange(L, dtype=np.intp), K)
    kinks, pieces = tables.kinks.ravel(), (tables.first[:, None] + 1 + np.arange(K)).ravel()
    kept = np.isfinite(kinks) & ~_from_bridge(tables, bridges)
    ends = tables.locate(bridges.law, bridges.right)
    resumes = np.ones(len(bridges.law), dtype=bool)
    resumes[:-1] = (bridges.law[1:] != bridges.law[:-1]) | (bridges.left[1:] != bridges.right[:-1])
    resumes &= ~(ends.on & kept[np.minimum(ends.piece - bridges.law, len(kept) - 1)])
    law = np.concatenate([own[kept], bridges.law, bridges.law[resumes]])
    at = np.concatenate([kinks[kept], bridges.left, bridges.right[resumes]])
    after = np.concatenate([pieces[kept], (ends.piece + ends.on)[resumes]])
    zero = np.zeros(len(bridges.law))
    tangent = (bridges.left, bridges.sigma - kappa * bridges.left, zero - kappa, zero, zero)
    n = np.count_nonzero(kept)
    order = np.lexsort((at, law))
    rank = _rank(law[order])
    width = int(np.max(rank, initial=-1)) + 2
    new_kinks = np.full((L, max(1, width - 1)), np.inf)
    new_kinks[law[order], rank] = at[order]
    columns = []
    for values, line in zip((tables.s_0, tables.b_0, tables.q, tables.a, tables.r), tangent, strict=True):
        moved = np.concatenate([values.take(after[:n]), line, values.take(after[n:])])[order]
        table = np.repeat(values[:, :1], new_kinks.shape[1] + 1, axis=1)
        table[law[order], rank + 1] = moved
        columns.append(table)
    return _with_kinds(new_kinks, columns, tables)


def _from_bridge(tables: LawTables, bridges: Bridges) -> Flags:
    """(L·K,) kinks of the laws that a bridge replaces: s₁ ≤ kink < s₂."""
    replaced = np.zeros(tables.kinks.shape, dtype=bool)
    for column, kinks in enumerate(tables.kinks.T):
        own = kinks[bridges.law]
        replaced[bridges.law[(bridges.left <= own) & (own < bridges.right)], column] = True
    return replaced.ravel()


def _with_kinds(kinks: Array, pieces: list[Array], of: LawTables) -> LawTables:
    """Tables whose kinds follow from the jumps of their pieces; scales as those of the laws they are hulls of."""
    s_0, b_0, q, a, r = pieces
    plain = LawTables(kinks, np.zeros(kinks.shape, dtype=np.int8), s_0, b_0, q, a, r, of.b_scale, of.omega)
    s = np.where(np.isfinite(kinks), kinks, 0.0)
    piece = plain.first[:, None] + np.arange(kinks.shape[1])
    jump = plain.value(s, piece + 1) - plain.value(s, piece)
    small = ~np.isfinite(kinks) | (np.abs(jump) <= _CONTINUOUS * of.b_scale[:, None])
    return replace(plain, kinds=np.where(small, BEND, np.sign(jump)).astype(np.int8))


def _rank(law: Index) -> Index:
    """(n,) place of every entry among those of its law; `law` is sorted."""
    return np.arange(len(law)) - np.searchsorted(law, law)
