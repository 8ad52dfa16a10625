"""Proximal hulls of friction laws: laws whose b falls nowhere faster than κ, from below and as close as can be.

j_κ(s) = conv(j + ½κ s²)(s) − ½κ s²,  b_κ = j_κ′ (Rockafellar & Wets, Variational Analysis, 1.44; also called the
Lasry–Lions or double envelope). j_κ ≤ j, j_κ grows with κ to j, and b_κ is b except on *bridges* [s₁, s₂], where
b_κ = σ − κ s with the two conditions of a common tangent (equal areas, as Maxwell's rule has it with κ = 0):

    b(s₁) + κ s₁ = σ = b(s₂) + κ s₂,   ∫_{s₁}^{s₂} (σ − κ s − b) ds = 0.

Up-jumps stay, down-jumps and steep falls become falls of slope −κ. With κ ≤ λ₁ the problem with b_κ is convex, and its
least energy is a lower bound of the original one.

The tangents are sought on samples (kinks, and _SAMPLES slips on every piece), those of all laws side by side; then,
wherever j + ½κ s² dips below a bridge, the bottom of the dip becomes a sample, until there is none; at last they are
refined on the pieces. A second dip on one exponential piece may be overlooked; b_κ is a start only, so that this costs
quality, never correctness.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from tcstudy.laws.laws import Laws
from tcstudy.laws.pieces import DOWN

Array = NDArray[np.float64]
Index = NDArray[np.intp]
Flags = NDArray[np.bool_]

_SAMPLES, _REFINEMENTS, _HALVINGS = 8, 5, 12
"""Samples on a piece, tangent iterations, and samples on an outer piece, each half as far out as the one before."""
PASSES, _DIP = 30, 1e-8
"""Passes over the samples at most; the part of its terms, or of a chord from a sample, below which a dip is none."""
_CONTINUOUS = 1e-8
"""Jumps of a hull below this part of the scale of b come from unfinished refinement."""


class Bridges(NamedTuple):
    """n bridges of hulls, in growing order law by law: row of the tables, ends s₁ < s₂ [m], mean of b between [Pa]."""

    law: Index
    left: Array
    right: Array
    mean: Array

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


def proximal_hulls(tables: Laws, kappa: float, passes: int = PASSES) -> tuple[Laws, Bridges]:
    """(tables of b_κ, the bridges); κ > 0 [Pa/m]. Laws that nowhere fall faster than κ stay as they are.

    passes: over the samples at most; one alone overlooks more and costs half
    """
    if not np.any(tables.falls > kappa):
        none = np.empty(0)
        return tables, Bridges(np.empty(0, dtype=np.intp), none, none, none)
    bridges = _refined(tables, kappa, _chords(tables, kappa, passes))
    return _assembled(tables, kappa, bridges), bridges


class _Chords(NamedTuple):
    """n segments of lower hulls of samples, on which b + κ s does not rise, in growing order law by law.

    law:         (n,) row of the tables
    left, right: (n,) their ends [m];  before, after: the vertices of the hull beside them
    """

    law: Index
    left: Array
    right: Array
    before: Array
    after: Array

    def take(self, which: Index | Flags) -> _Chords:
        """The named ones."""
        columns: tuple[Any, ...] = self
        return _Chords(*(column[which] for column in columns))


def _chords(tables: Laws, kappa: float, passes: int) -> tuple[_Chords, Array]:
    """The segments of every law that falls faster than κ, once nothing dips below them; the samples of all laws."""
    rows = np.flatnonzero(tables.falls > kappa)
    own, found = tables.rows(rows), []
    s = _samples(own, kappa)
    samples = np.full((len(tables.q), s.shape[1]), np.nan)
    samples[rows] = s
    for further in reversed(range(passes)):
        chords, vertices = _segments(own, kappa, s)
        law, dips = _dips(own, kappa, chords, s) if further else (np.empty(0, dtype=np.intp), np.empty(0))
        again = np.unique(law)
        done = chords.take(~np.isin(chords.law, again))
        found.append(done._replace(law=rows[done.law]))
        if not len(again):
            break
        s = _with_more(vertices[again], np.searchsorted(again, law), dips)
        rows, own = rows[again], own.rows(again)
    chords = _Chords(*(np.concatenate(column) for column in zip(*found, strict=True)))
    return chords.take(np.lexsort((chords.left, chords.law))), samples


def _samples(tables: Laws, kappa: float) -> Array:
    """(L, S) growing slips at which a hull may touch j, NaN behind: kinks where b does not fall, and inside pieces."""
    count = np.count_nonzero(np.isfinite(tables.kinks), axis=1)
    rows, has = np.arange(len(count)), count > 0
    first = np.where(has, tables.kinks[:, 0], 0.0)
    last = np.where(has, tables.kinks[rows, np.maximum(count - 1, 0)], 0.0)
    decay = np.divide(4.0, tables.rate, out=np.zeros(tables.q.shape), where=tables.rate > 0.0)
    outer = (2.0 * tables.scales / kappa + decay.max(axis=1))[:, None] * 0.5 ** np.arange(_HALVINGS)
    low, high = tables.lower[:, 1:-1, None], tables.upper[:, 1:-1, None]
    steep = ~tables.bent[:, 1:-1] & (tables.q[:, 1:-1] + kappa <= 0.0)  # concave: the hull cannot touch inside
    inside = np.isfinite(high) & ~steep[:, :, None]
    part = np.arange(1, _SAMPLES + 1) / (_SAMPLES + 1)
    with np.errstate(invalid="ignore"):
        inner = np.where(inside, low + (high - low) * part, np.nan).reshape(len(rows), -1)
    held = np.where(np.isfinite(tables.kinks) & (tables.kinds != DOWN), tables.kinks, np.nan)
    columns = [first[:, None] - outer, held, inner, _beside_down_jumps(tables, kappa), last[:, None] + outer]
    return _packed(np.concatenate(columns, axis=1))


def _beside_down_jumps(tables: Laws, kappa: float) -> Array:
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


def _with_more(s: Array, law: Index, more: Array) -> Array:
    """Slips (L, S) with more of them, given by law; NaN behind."""
    wide = np.full((len(s), int(np.max(np.bincount(law)))), np.nan)
    wide[law, _rank(law)] = more
    return _packed(np.concatenate([s, wide], axis=1))


def _packed(s: Array) -> Array:
    """(L, S) growing slips without those that stand twice, NaN behind."""
    s = np.sort(s, axis=1)
    s[:, 1:][s[:, 1:] == s[:, :-1]] = np.nan
    s = np.sort(s, axis=1)
    return s[:, : int(np.max(np.count_nonzero(np.isfinite(s), axis=1), initial=0))]


def _segments(tables: Laws, kappa: float, s: Array) -> tuple[_Chords, Array]:
    """Segments of the lower hulls of (s, j + ½κ s²) on which b + κ s does not rise; vertices (L, H), NaN behind.

    Inside a piece on which b + κ s rises the hull is the law itself, however many samples rounding leaves out.
    """
    row, count = np.arange(len(s), dtype=np.intp)[:, None], np.count_nonzero(np.isfinite(s), axis=1)
    known, zero = np.where(np.isnan(s), 0.0, s), np.zeros(s.shape)
    height = tables.integral(zero, known, tables.locate(zero, row), tables.locate(known, row)) + 0.5 * kappa * s * s
    hulls = [lower_hull(x[:n].tolist(), y[:n].tolist()) for x, y, n in zip(s, height, count, strict=True)]
    size = np.array([len(hull) for hull in hulls])
    law, k = np.repeat(row[:, 0], size), np.concatenate([np.arange(n) for n in size])
    vertices = np.full((len(s), int(size.max()) + 2), np.nan)
    vertices[law, k] = s[law, np.concatenate(hulls)]
    law, k = law[k > 0], k[k > 0]
    left, right = vertices[law, k - 1], vertices[law, k]
    before = vertices[law, np.maximum(k - 2, 0)]
    after = np.where(np.isnan(vertices[law, k + 1]), right, vertices[law, k + 1])
    at = tables.locate(left, law)
    piece = at.piece + at.on
    falls = (tables.slope(left, piece) + kappa <= 0.0) | (tables.slope(right, piece) + kappa <= 0.0)
    chords = _Chords(law, left, right, before, after)
    return chords.take((piece != tables.locate(right, law).piece) | falls), vertices


def lower_hull(x: list[float], height: list[float]) -> list[int]:
    """Vertices of the lower convex hull of the points (x, height), x growing."""
    hull: list[int] = []
    for i in range(len(x)):
        while len(hull) > 1:
            a, b = hull[-2], hull[-1]
            if (height[b] - height[a]) * (x[i] - x[b]) < (height[i] - height[b]) * (x[b] - x[a]):
                break
            hull.pop()
        hull.append(i)
    return hull


def _dips(tables: Laws, kappa: float, chords: _Chords, known: Array) -> tuple[Index, Array]:
    """(law, slip) where j + ½κ s² lies lowest below a chord, one for each piece on which it does.

    A chord is looked at as far as the vertices beside it, since it may cut through the arc that it should touch.
    Slips that are samples `known` (L, S) already are none: rounding left them out.
    """
    marks = np.stack([chords.before, chords.left, chords.right, chords.after], axis=1)
    low = np.maximum(tables.lower[chords.law][:, None, :], marks[:, :-1, None])
    high = np.minimum(tables.upper[chords.law][:, None, :], marks[:, 1:, None])
    chord, part, column = np.nonzero(low < high)
    low, high = low[chord, part, column], high[chord, part, column]
    law, left, right = chords.law[chord], chords.left[chord], chords.right[chord]
    piece, middle = tables.first[law] + column, 0.5 * (left + right)
    mean = _mean(tables, law, left, right)  # b + κ s = σ in terms that do not cancel: b + κ (s − middle) = mean
    s = 0.5 * (low + high)
    for _ in range(1 if tables.piecewise_linear else _REFINEMENTS):
        slope = tables.slope(s, piece) + kappa
        excess = tables.value(s, piece) - mean + kappa * (s - middle)
        s = np.clip(s - np.where(slope > 0.0, excess / np.where(slope > 0.0, slope, 1.0), 0.0), low, high)
    friction = tables.integral(left, s, tables.locate(left, law), tables.locate(s, law))
    straight, bend = mean * (s - left), 0.5 * kappa * (s - left) * (right - s)
    noise = _DIP * (np.abs(friction) + np.abs(straight) + np.abs(bend))
    below = (low < s) & (s < high) & (friction - straight - bend < -noise)
    below[below] = ~np.any(np.abs(known[law[below]] - s[below, None]) <= _DIP * (right - left)[below, None], axis=1)
    order = np.argsort(law[below], kind="stable")
    return law[below][order], s[below][order]


def _refined(tables: Laws, kappa: float, found: tuple[_Chords, Array]) -> Bridges:
    """The common tangents, each end kept between the samples beside its own."""
    (law, left, right, before, after), samples = found
    near = samples[law]
    left_range = [np.fmax(before, _last(near, left)), np.fmin(right, _next(near, left))]
    right_range = [np.fmax(left, _last(near, right)), np.fmin(after, _next(near, right))]
    for _ in range(_REFINEMENTS):
        sigma = _mean(tables, law, left, right) + 0.5 * kappa * (left + right)
        new_left = np.clip(_tangent(tables, kappa, law, left, sigma), *left_range)
        new_right = np.clip(_tangent(tables, kappa, law, right, sigma), *right_range)
        apart = new_left < new_right
        left, right = np.where(apart, new_left, left), np.where(apart, new_right, right)
    same = law[1:] == law[:-1]
    left[1:] = np.where(same, np.maximum(left[1:], right[:-1]), left[1:])  # bridges may meet but not overlap
    kept = left < right
    law, left, right = law[kept], left[kept], right[kept]
    return Bridges(law, left, right, _mean(tables, law, left, right))


def _last(samples: Array, s: Array) -> Array:
    """(n,) the last of the samples (n, S) before s, NaN if there is none."""
    return np.fmax.reduce(np.where(samples < s[:, None], samples, np.nan), axis=1)


def _next(samples: Array, s: Array) -> Array:
    """(n,) the first of the samples (n, S) after s, NaN if there is none."""
    return np.fmin.reduce(np.where(samples > s[:, None], samples, np.nan), axis=1)


def _mean(tables: Laws, law: Index, left: Array, right: Array) -> Array:
    """(n,) mean of b between left and right [Pa]; with ½κ (left + right) the slope of the chord of j + ½κ s²."""
    integral = tables.integral(left, right, tables.locate(left, law), tables.locate(right, law))
    return np.asarray(integral / (right - left))


def _tangent(tables: Laws, kappa: float, law: Index, s: Array, sigma: Array) -> Array:
    """(n,) one Newton step for b + κ s = σ on the piece at the side where the solution lies; s itself on an up-jump."""
    moved, at = s.copy(), tables.locate(s, law)
    for side, piece in ((-1, at.piece), (1, at.piece + at.on)):
        excess = tables.value(s, piece) + kappa * s - sigma
        slope = tables.slope(s, piece) + kappa
        step = np.where((slope > 0.0) & (side * excess < 0.0), -excess / np.where(slope > 0.0, slope, 1.0), 0.0)
        target = np.clip(s + step, tables.lower.take(piece), tables.upper.take(piece))
        moved = np.where(step != 0.0, target, moved)
    return moved


def _assembled(tables: Laws, kappa: float, bridges: Bridges) -> Laws:
    """Tables of the laws that are σ − κ s on the bridges, each hung on its end nearer to 0, and else as they were."""
    L, K = tables.kinks.shape
    own = np.repeat(np.arange(L, dtype=np.intp), K)
    kinks, pieces = tables.kinks.ravel(), (tables.first[:, None] + 1 + np.arange(K)).ravel()
    kept = np.isfinite(kinks) & ~_from_bridge(tables, bridges)
    ends = tables.locate(bridges.right, bridges.law)
    resumes = np.ones(len(bridges.law), dtype=bool)
    resumes[:-1] = (bridges.law[1:] != bridges.law[:-1]) | (bridges.left[1:] != bridges.right[:-1])
    resumes &= ~(ends.on & kept[np.minimum(ends.piece - bridges.law, len(kept) - 1)])
    law = np.concatenate([own[kept], bridges.law, bridges.law[resumes]])
    at = np.concatenate([kinks[kept], bridges.left, bridges.right[resumes]])
    after = np.concatenate([pieces[kept], (ends.piece + ends.on)[resumes]])
    zero, fall = np.zeros(len(bridges.law)), 0.5 * kappa * (bridges.right - bridges.left)
    near = np.abs(bridges.left) <= np.abs(bridges.right)
    start, value = np.where(near, bridges.left, bridges.right), bridges.mean + np.where(near, fall, -fall)
    tangent = (start, value, zero - kappa, *[zero] * (len(tables.pieces) - 3))
    n = np.count_nonzero(kept)
    order = np.lexsort((at, law))
    rank = _rank(law[order])
    width = int(np.max(rank, initial=-1)) + 2
    new_kinks = np.full((L, max(1, width - 1)), np.inf)
    new_kinks[law[order], rank] = at[order]
    columns = []
    for values, line in zip(tables.pieces, tangent, strict=True):
        moved = np.concatenate([values.take(after[:n]), line, values.take(after[n:])])[order]
        table = np.repeat(values[:, :1], new_kinks.shape[1] + 1, axis=1)
        table[law[order], rank + 1] = moved
        columns.append(table)
    hulls = Laws(tables.name, new_kinks, *columns).known(scales=tables.scales, falls=tables.falls)
    return hulls.smooth_to(_CONTINUOUS * tables.scales[:, None])


def _from_bridge(tables: Laws, bridges: Bridges) -> Flags:
    """(L·K,) kinks of the laws that a bridge replaces: s₁ ≤ kink < s₂."""
    replaced = np.zeros(tables.kinks.shape, dtype=bool)
    for column, kinks in enumerate(tables.kinks.T):
        own = kinks[bridges.law]
        replaced[bridges.law[(bridges.left <= own) & (own < bridges.right)], column] = True
    return replaced.ravel()


def _rank(law: Index) -> Index:
    """(n,) place of every entry among those of its law; `law` is sorted."""
    return np.arange(len(law)) - np.searchsorted(law, law)
