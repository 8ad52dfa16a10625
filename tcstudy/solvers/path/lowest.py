"""Which piece of a path has the least energy at every t: the lower envelope of parabolas, exact up to rounding.

Along a piece dL̃/dt = −W with W = l̃₁ᵀu linear in t, so L̃ is a parabola of t there; where two of them cross (a Maxwell
point) the lowest solution changes without a fold.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from tcstudy.solvers.path.record import Path

Array = NDArray[np.float64]
Index = NDArray[np.intp]

SHORT = 1e-13
"""Intervals below this part of the range of t are vertices that differ by rounding."""


@dataclass(frozen=True)
class Lowest:
    """The lowest solutions of a path, by growing t: piece[i] is lowest for begin[i] ≤ t ≤ end[i], all (n,)."""

    begin: Array
    end: Array
    piece: Index


def lowest(path: Path) -> Lowest:
    """The piece of least energy among all solutions on the path, for every t that it reaches."""
    values = np.unique(path.t)
    low, high = np.minimum(path.t[:-1], path.t[1:]), np.maximum(path.t[:-1], path.t[1:])
    found: list[tuple[float, float, int]] = []
    for a, b in pairwise(values):
        if b - a <= SHORT * (values[-1] - values[0]):
            continue
        pieces = np.flatnonzero((low <= a) & (high >= b))
        for s_0, s_1, i in _envelope(*_parabolas(path, pieces, a, b)) if len(pieces) else ():
            begin, end, piece = a + s_0 * (b - a), a + s_1 * (b - a), int(pieces[i])
            if found and found[-1][2] == piece:
                begin = found.pop()[0]
            found.append((begin, end, piece))
    columns = list(zip(*found, strict=True)) or [(), (), ()]
    return Lowest(np.array(columns[0]), np.array(columns[1]), np.array(columns[2], dtype=np.intp))


def _parabolas(path: Path, pieces: Index, a: float, b: float) -> tuple[Array, Array, Array]:
    """(e, f, g) of L̃ = e + f s + g s² on every piece, with s = 0 at t = a and s = 1 at t = b."""
    t_0, t_1 = path.t[pieces], path.t[pieces + 1]
    w_0, w_1 = path.conjugate[pieces], path.conjugate[pieces + 1]
    slope = (w_1 - w_0) / (t_1 - t_0)
    at_a = w_0 + slope * (a - t_0)
    e = path.energy[pieces] - 0.5 * (w_0 + at_a) * (a - t_0)
    return e, -at_a * (b - a), -0.5 * slope * (b - a) ** 2


def _envelope(e: Array, f: Array, g: Array) -> list[tuple[float, float, int]]:
    """(from, to, which) of the lower envelope of e + f s + g s² on 0 ≤ s ≤ 1."""
    noise = 1e-13 * float(np.max(np.abs(e) + np.abs(f) + np.abs(g)))
    s, parts = 0.0, []
    first = e + f * 1e-6 + g * 1e-12 - np.min(e)
    now = int(np.argmin(first))
    for _ in range(2 * len(e) + 1):
        crossing = _next_crossing(e - e[now], f - f[now], g - g[now], s, noise)
        which = int(np.argmin(crossing))
        if not crossing[which] < 1.0:
            break
        parts.append((s, float(crossing[which]), now))
        s, now = float(crossing[which]), which
    return [*parts, (s, 1.0, now)]


def _next_crossing(e: Array, f: Array, g: Array, s: float, noise: float) -> Array:
    """Where e + f s + g s² first falls through zero beyond s; inf where it does not before 1."""
    root = np.sqrt(np.maximum(f * f - 4.0 * e * g, 0.0))
    q = -0.5 * (f + np.where(f >= 0.0, root, -root))
    result = np.full(len(e), np.inf)
    with np.errstate(divide="ignore", invalid="ignore"):
        for x in (q / g, e / q):
            falls = (f + 2.0 * g * x < 0.0) & (f * f > 4.0 * e * g) & (x > s + 1e-9) & (x < 1.0)
            deep = np.minimum(e + f + g, 0.0) < -noise  # a branch that only touches is no change
            result = np.where(falls & deep & (x < result), x, result)
    return result
