"""Questions to a followed path: its solutions at one t, those of the true smooth law, folds, the least energy proved.

Folds: a turn of t and its neighbour that comes back the least are one small step back: such pairs are taken away,
smallest first, as long as they step back too little (persistence, Edelsbrunner, Letscher & Zomorodian, Discrete Comput.
Geom. 28 (2002) 511–533). So a wiggle at a large fold goes, and the fold itself stays.

Least energy: the lower envelope of parabolas, exact up to rounding. Along a piece dL̃/dt = −W with W = l̃₁ᵀu linear in
t, so L̃ is a parabola of t there; where two of them cross (a Maxwell point) the lowest solution changes without a fold.
"""

from __future__ import annotations

from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from tcstudy.contact.certificates import Proofs
from tcstudy.contact.path.problem import Path
from tcstudy.contact.path.smooth import SmoothPath
from tcstudy.contact.solution import polished
from tcstudy.laws.laws import Laws
from tcstudy.scene.study import Acceptance

Array = NDArray[np.float64]
Index = NDArray[np.intp]

CARRIED = 1e-9
"""A solution of straight pieces has led to one of the law itself if the residual is no larger."""


def folds(path: Path, least: float) -> Index:
    """Vertices at which t turns and steps back by this much or more."""
    t, left = path.t, [0, *path.folds.tolist(), path.pieces]
    while len(left) > 3:
        steps = np.abs(np.diff(t[left]))[1:-1]
        at = int(np.argmin(steps))
        if steps[at] >= least:
            break
        del left[at + 1 : at + 3]
    none = len(left) == 3 and np.abs(np.diff(t[left])).min() < least
    return np.array([] if none else left[1:-1], dtype=np.intp)


class PathSolution(NamedTuple):
    """One solution on a path.

    v:      (m,) displacements [m]
    stable: strict local minimum of L̃ (at a vertex: on both sides)
    piece:  index of the piece of the path that holds it
    """

    v: Array
    stable: bool
    piece: int


def solutions_at(path: Path, t: float) -> list[PathSolution]:
    """All solutions of the path at t in its order; a vertex counts once.

    Along a piece on which t stands still all points are solutions of the same t: its two ends are returned.
    """
    low, high = np.minimum(path.t[:-1], path.t[1:]), np.maximum(path.t[:-1], path.t[1:])
    found, last = list[PathSolution](), -1.0
    for piece in np.flatnonzero((low <= t) & (t <= high)).tolist():
        (t_0, t_1), (begin, end) = path.t[piece : piece + 2], path.u[piece : piece + 2]
        for s in (0.0, 1.0) if t_0 == t_1 else (float((t - t_0) / (t_1 - t_0)),):
            before = found.pop().stable if piece + s == last else True  # the vertex between two pieces
            v, last = end if s == 1.0 else begin + s * (end - begin), piece + s
            found.append(PathSolution(v, before and bool(path.stable[piece]), piece))
    return found


def solutions_of(law: Laws, path: Path, t: float) -> list[PathSolution]:
    """The solutions of the law that the path's law approximates, by Newton's method from those of the path.

    Each node keeps its place: on the same jump, or on the piece of `law` in which it lies. A solution that does not
    carry over (its residual says so) is handed to active_set.polished; judge every answer by its residual.
    """
    problem, curve, found = path.problem.with_law(law).at(t), SmoothPath(path, law), list[PathSolution]()
    for solution in solutions_at(path, t):
        point = curve.at(solution.piece, (np.zeros(problem.m), 1.0), t, solution.v, t)
        residual = np.inf if point is None else problem.inclusion_residual(point.v)
        other = polished(problem, solution.v, exact=False) if not residual <= CARRIED else None
        carried = point is not None and (other is None or residual <= other.residual)
        v = point.v if carried and point is not None else other.v if other is not None else solution.v
        found.append(solution._replace(v=v))
    return found


SHORT = 1e-13
"""Intervals below this part of the range of t are vertices that differ by rounding."""


class Lowest(NamedTuple):
    """The lowest solutions of a path, by growing t: piece[i] is lowest for begin[i] ≤ t ≤ end[i], all (n,)."""

    begin: Array
    end: Array
    piece: Index


def lowest(path: Path) -> Lowest:
    """The piece of least energy among all solutions on the path, for every t that it reaches."""
    values, (t, energy, w) = np.unique(path.t), (path.t, path.energy, path.conjugate)
    low, high = np.minimum(t[:-1], t[1:]), np.maximum(t[:-1], t[1:])
    found: list[tuple[float, float, int]] = []
    for a, b in pairwise(values):
        k = np.flatnonzero((low <= a) & (high >= b))
        if b - a <= SHORT * (values[-1] - values[0]) or not len(k):
            continue
        slope = (w[k + 1] - w[k]) / (t[k + 1] - t[k])
        at_a = w[k] + slope * (a - t[k])
        e = energy[k] - 0.5 * (w[k] + at_a) * (a - t[k])  # L̃ = e + f s + g s², s = 0 at a and 1 at b
        for s_0, s_1, i in _envelope(e, -at_a * (b - a), -0.5 * slope * (b - a) ** 2):
            begin, end, piece = a + s_0 * (b - a), a + s_1 * (b - a), int(k[i])
            if found and found[-1][2] == piece:
                begin = found.pop()[0]
            found.append((begin, end, piece))
    columns = list(zip(*found, strict=True)) or [(), (), ()]
    return Lowest(np.array(columns[0]), np.array(columns[1]), np.array(columns[2], dtype=np.intp))


def _envelope(e: Array, f: Array, g: Array) -> list[tuple[float, float, int]]:
    """(from, to, which) of the lower envelope of e + f s + g s² on 0 ≤ s ≤ 1."""
    noise = 1e-13 * float(np.max(np.abs(e) + np.abs(f) + np.abs(g)))
    s, parts, now = 0.0, [], int(np.argmin(e - np.min(e) + f * 1e-6 + g * 1e-12))
    for _ in range(2 * len(e) + 1):
        d, h, q = e - e[now], f - f[now], g - g[now]  # which others fall through zero first beyond s?
        root = np.sqrt(np.maximum(h * h - 4.0 * d * q, 0.0))
        half = -0.5 * (h + np.where(h >= 0.0, root, -root))
        with np.errstate(divide="ignore", invalid="ignore"):
            x = np.stack([half / q, d / half])
            falls = (h + 2.0 * q * x < 0.0) & (h * h > 4.0 * d * q) & (x > s + 1e-9) & (x < 1.0)
        falls &= np.minimum(d + h + q, 0.0) < -noise  # a branch that only touches is no change
        x = np.where(falls, x, np.inf).min(axis=0)
        which = int(np.argmin(x))
        if not x[which] < 1.0:
            break
        parts.append((s, float(x[which]), now))
        s, now = float(x[which]), which
    return [*parts, (s, 1.0, now)]


AT_ONCE = 2**20
"""Entries of the arrays of solutions that are proved together."""


def proved_minima(path: Path, low: Lowest, lambda_1: float, acceptance: Acceptance) -> NDArray[np.bool_]:
    """(n,) whether the lowest solution in the middle of every interval is proved to have the least energy of all.

    lambda_1: λ_min(C^{−½}ÃC^{−½}) [Pa/m];  acceptance: which residual makes a solution
    """
    proved = np.zeros(len(low.piece), dtype=bool)
    for own in np.array_split(np.arange(len(proved)), 1 + len(proved) * path.problem.m // AT_ONCE):
        t, k = 0.5 * (low.begin + low.end)[own], low.piece[own]
        share = (t - path.t[k]) / (path.t[k + 1] - path.t[k])
        v = path.u[k] + share[:, None] * (path.u[k + 1] - path.u[k])
        rows = path.problem.rows(t, lambda_1)
        solved, proofs = acceptance.accepts(rows.inclusion_residual(v), rows.xi_rounding(v)), Proofs(rows)
        proofs.prove_lowest(np.flatnonzero(solved), v)
        proved[own] = solved & (proofs.unique | proofs.lowest)
    return proved
