"""Every solution of a contact problem with piecewise-linear laws, stable or not, proved to be all or said why not.

Statement:  of the given doubles Ã, l̃, c and the polygons through the laws' values at their kinks `boxes` finds all
            cells (one side of its polygon for every node) that may hold a solution. In a cell the problem is linear:
            one solution if its matrix is proved regular and the solution inside, none if that is proved outside, else
            undecided (a solution on a kink within rounding, as exact symmetry makes them, or a singular cell)
Count:      with growth (15), (16) and Ã positive definite the degree is 1, so that the number of regular solutions is
            odd: a check of every list
Stable:     a strict local minimum of L̃: no node inside a jump down, and Ã + C diag b′ positive definite on the nodes
            off the jumps

Left out: laws with exponential pieces; their polygon is another problem
(`path.piecewise_linear_approximation`), which the caller names.

Boxes that hold all solutions of piecewise-linear contact problems, made smaller by proof and split until none bends.

Problems:  Ãv + Cζ = l̃_p + s l̃₁ with (v_i, ζ_i) on the filled graph of b̂_i, a polygon; s ∈ [0, 1], or l̃₁ = 0
Place:     t = k + f is the point at the share f of side k of a polygon; a box is an interval of places for every node,
           and of s
Row step:  y_i = Ã_ii v + c_i ζ along the polygon of node i lies in l̃_i − Σ_{j≠i} Ã_ij [v_j]. Where no Ã_ij, i ≠ j, is
           positive, bounds from below follow from those from below alone, so that the steps rise to the least solution
           and fall to the largest one: no box is smaller (a lattice system, Tarski 1955)
Strip step: the part of a polygon in the box lies about its chord, (v, ζ) ∈ p + Dτ + W [middle ± radius], so that
           (ÃD_v + CD_ζ) τ = l̃ − … − Kδ, |δ| ≤ radius: one inverse bounds v, ζ and s. Falling sides are part of the
           matrix; only bends count
Cell:      what is left when every node is on one side of its polygon
Rounding:  every bound is widened by what rounding may do to it, places by `SLACK`; an inverse Y of M is used only where
           ‖I − YM‖_∞ is proved small, and what it leaves out is added (S. M. Rump, Acta Numerica 19 (2010) 287–449)
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from tcstudy.contact.certificates import energy_reach, largest_push, strict_minimum
from tcstudy.contact.path.piecewise_linear_approximation import piecewise_linear
from tcstudy.contact.problem import CondensedBody, ContactProblem
from tcstudy.laws.laws import Laws
from tcstudy.laws.pieces import BEND

Array = NDArray[np.float64]
Index = NDArray[np.intp]
Flags = NDArray[np.bool_]

EPS = float(np.finfo(float).eps)
PROVED = 0.01
"""Largest ‖I − YM‖_∞ with which an inverse is used."""
SLACK = 32.0
"""Roundings of the largest place by which places are widened; a part of a box half as wide is no part of it."""
ROUNDS = 40
"""Of row steps and a strip step, before a box is split whatever they bring."""
_MEMORY = 4_000_000
"""Numbers in the matrices of the boxes that are at work together."""


class Effort(NamedTuple):
    """When steps pay no more.

    turns, steps: most row steps, in turns after each of which boxes that moved less than `least` sides leave
    enough: share of a box's size left, from which it is split instead of reduced again
    """

    turns: int
    steps: int
    least: float
    enough: float


AT_A_LOAD = Effort(16, 30, 3e-4, 0.7)
OVER_LOADS = Effort(4, 12, 1e-3, 0.9)


class Boxes(NamedTuple):
    """n boxes: problem of each (n,), s from and to (n,), places from and to (n, m)."""

    problem: Index
    s_0: Array
    s_1: Array
    low: Array
    high: Array

    def take(self, which: Flags | Index | slice) -> Boxes:
        return Boxes._make(x[which] for x in self)

    @property
    def alive(self) -> Flags:
        return np.asarray((self.low <= self.high).all(-1) & (self.s_0 <= self.s_1))

    @property
    def size(self) -> Array:
        """Sides that the boxes take, those within one side by their share."""
        return np.asarray(np.minimum(self.high - self.low, 1.0).sum(-1))


def joined(parts: list[Boxes]) -> Boxes:
    """Boxes one after the other."""
    return Boxes._make(np.concatenate(x) for x in zip(*parts, strict=True))


class Strips(NamedTuple):
    """Parts of the polygons in n boxes: start p and chord D (n, m, 2), and how they leave the chord.

    slip:   whether that is measured in slip, else in traction (n, m);  middle, radius: how far
    weight: of the bends in the balance of the node, 0 without any;  vertex: the place of the largest
    """

    p: Array
    D: Array
    slip: Flags
    middle: Array
    radius: Array
    weight: Array
    vertex: Index

    @property
    def straight(self) -> Flags:
        """(n,) boxes in which every node is on one side."""
        return np.asarray((self.weight <= 0.0).all(-1))

    def take(self, which: Flags) -> Strips:
        return Strips._make(x[which] for x in self)


@dataclass(frozen=True)
class Limits:
    """How much is spent on one problem.

    boxes: most of them;  seconds: wall time
    """

    boxes: int = 20_000
    seconds: float = 60.0


class Cells(NamedTuple):
    """What a search ends in.

    problem, sides: (n,), (n, m) sides of all nodes in each cell that may hold solutions
    boxes: (P,) looked at of each problem;  stopped: (P,) by a limit: there may be more cells
    """

    problem: Index
    sides: Index
    boxes: Index
    stopped: Flags


def inverse_of(M: Array, size: Callable[[Array], Array], scale: Array) -> tuple[Array, Array]:
    """(Y, rho): Y ≈ (M/scale)⁻¹ (n, m, m) and a bound of ‖I − YM/scale‖_∞, rounding of M included; ∞ without a proof.

    scale: (n, m) of the columns;  size(w): (n, m) magnitudes that the products M w are made of
    """
    m, M = M.shape[-1], M / scale[:, None, :]
    try:
        Y = np.linalg.inv(M)
    except np.linalg.LinAlgError:  # one is singular, the others are not
        Y = np.stack([np.linalg.pinv(x) if np.isfinite(x).all() else np.zeros_like(x) for x in M])
    R = Y @ M
    R[:, np.arange(m), np.arange(m)] -= 1.0
    with np.errstate(invalid="ignore", over="ignore"):
        rho = np.abs(R, out=R).sum(-1).max(-1)
        rho += 2.0 * (m + 4) * EPS * (np.abs(Y) @ size(1.0 / scale)[..., None])[..., 0].max(-1)
    return np.asarray(Y), np.where(rho < PROVED, rho, np.inf)


class PolygonProblems:
    """Problems on one body, with laws and loads of their own.

    A, c:   as in ContactProblem;  load: (P, m) l̃ [N/m];  l_1: (m,) load per s, None for none
    laws:   piecewise linear, of one problem or of all (index of the shape (), (m,), (R, 1) or (R, m), R = 1 or P)
    reach:  (m,) no solution of any problem has a larger |v_i| [m]
    points: (G, m, V, 2) vertices (s, b) of the polygons of the G kinds of problem;  last: (G, m) number of sides
    """

    def __init__(self, A: Array, c: Array, laws: Laws, load: Array, reach: Array, l_1: Array | None = None) -> None:
        self.A, self.c, self.m, self.load, self.l_1 = A, c, len(c), load, l_1
        self.diagonal, self.size_of_A = np.diagonal(A).copy(), np.abs(A)
        off = A - np.diag(self.diagonal)
        self.minus, self.plus = np.minimum(off, 0.0), np.maximum(off, 0.0)
        self.positive = bool(np.any(self.plus))
        index = np.atleast_2d(laws.index)
        index = np.broadcast_to(index, (len(index), self.m))
        kinds, kind = np.unique(index, axis=0, return_inverse=True)
        self.kind = np.broadcast_to(kind.reshape(-1), len(load))
        self.points, self.last = polygons(laws, kinds, reach)
        count = self.points.shape[2]
        self.slack = SLACK * EPS * (1 + count)
        v, z = self.points[..., 0], self.points[..., 1]
        self.Y = self.diagonal[:, None] * v + c[:, None] * z
        self.noise = np.abs(v).max((0, 2)) @ self.size_of_A + c * np.abs(z).max((0, 2)) + np.abs(load).max(0)
        self.noise = 4.0 * (self.m + 8) * EPS * (self.noise + (0.0 if l_1 is None else np.abs(l_1)))
        sides = (v[..., :-1], np.diff(v), self.Y[..., :-1], np.diff(self.Y))
        self._sides = [np.ascontiguousarray(x).reshape(-1) for x in sides]
        self._base = (np.arange(len(kinds) * self.m) * (count - 1)).reshape(len(kinds), self.m)
        self._vertex = np.arange(count)

    def of(self, table: NDArray[Any], problem: Index) -> NDArray[Any]:
        """The rows of a table (G, …) of problems (n,); one row if all have the same."""
        return table if len(table) == 1 else table[self.kind[problem]]

    def loads(self, box: Boxes) -> tuple[Array, Array]:
        """Least and largest load (n, m) over a box's s."""
        load = self.load[box.problem]
        if self.l_1 is None:
            return load, load
        x, y = box.s_0[:, None] * self.l_1, box.s_1[:, None] * self.l_1
        return load + np.minimum(x, y), load + np.maximum(x, y)

    def at(self, problem: Index, place: Array) -> Array:
        """The points (n, m, 2) at places (n, m)."""
        k = np.minimum(place.astype(np.intp), self.points.shape[2] - 2)
        start, chord = self.ends(problem, k)
        f = (place - k)[..., None]
        return np.where(f <= 0.0, start, np.where(f >= 1.0, start + chord, start + f * chord))

    def ends(self, problem: Index, sides: Index) -> tuple[Array, Array]:
        """(start, chord) (n, m, 2) of sides (n, m) of the polygons."""
        points, k = self.of(self.points, problem), sides[..., None, None]
        start, end = (np.take_along_axis(points, k + i, axis=-2)[..., 0, :] for i in (0, 1))
        return start, end - start

    def row_steps(self, box: Boxes, effort: Effort) -> Boxes:
        """Row steps until they pay no more, and one over all sides: the bounds move only along the side they are on."""
        low, high = self.loads(box)
        low, high, busy = low - self.noise, high + self.noise, np.arange(len(low))
        a, b = box.low.copy(), box.high.copy()
        base, last = self.of(self._base, box.problem), self.of(self.last, box.problem)
        for _ in range(effort.turns):
            x, y, p, q = a[busy], b[busy], low[busy], high[busy]
            address, end = (x if len(x) == 1 else x[busy] for x in (base, last - 1))
            for _ in range(effort.steps):
                x_0, y_0 = x, y
                x, y = self._row_step(address, end, p, q, x, y)
            a[busy], b[busy] = x, y
            busy = busy[(x <= y).all(-1) & (np.maximum(x - x_0, y_0 - y).max(-1) > effort.least)]
            if not len(busy):
                break
        ok = np.flatnonzero((a <= b).all(-1))
        own = box._replace(low=a, high=b).take(ok)
        v, w = self.at(own.problem, own.low)[..., 0], self.at(own.problem, own.high)[..., 0]
        low, high = low[ok] - v @ self.minus - w @ self.plus, high[ok] - w @ self.minus - v @ self.plus
        own = self._clipped(own, [(self.of(self.Y, own.problem), low, high)])
        a[ok], b[ok] = own.low, own.high
        return box._replace(low=a, high=b)

    def _row_step(
        self, base: Index, end: Index, low_0: Array, high_0: Array, a: Array, b: Array
    ) -> tuple[Array, Array]:
        """The places a, b moved along their sides, by one side at most, to where y meets [low, high]."""
        k, n = np.minimum(a.astype(np.intp), end), np.maximum(np.ceil(b).astype(np.intp) - 1, 0)
        f, g = a - k, b - n
        v, dv, y, dy = (x.take(base + k) for x in self._sides)
        w, dw, z, dz = (x.take(base + n) for x in self._sides)
        v, w, y_a, z_b = v + f * dv, w + g * dw, y + f * dy, z + g * dz
        low, high = low_0 - v @ self.minus, high_0 - w @ self.minus
        if self.positive:
            low, high = low - w @ self.plus, high - v @ self.plus
        with np.errstate(divide="ignore", invalid="ignore"):
            f, g = np.where(dy > 0.0, (low - y) / dy, np.inf), np.where(dz > 0.0, (high - z) / dz, -np.inf)
        # on a side that does not rise all of the rest is below where its start is
        a_1 = np.where(y_a < low, np.where(f < 1.0, k + f - self.slack, k + 1.0), a)
        b_1 = np.where(z_b > high, np.where(g > 0.0, n + g + self.slack, n), b)
        return np.maximum(a_1, a), np.minimum(b_1, b)

    def _clipped(self, box: Boxes, conditions: list[tuple[Array, Array, Array]]) -> Boxes:
        """Hull of the parts of the polygons in the box on which functions of them lie between bounds.

        conditions: (values at the vertices (…, m, V), low, high (n, m)) of each function
        """
        last = self.of(self.last, box.problem)
        first, end = np.full(box.low.shape, np.inf), np.full(box.low.shape, -np.inf)
        for k in range(self.points.shape[2] - 1):
            f, g = np.clip(box.low - k, 0.0, 1.0), np.clip(box.high - k, 0.0, 1.0)
            on = (box.low <= k + 1) & (box.high >= k) & (k < last)
            for values, low, high in conditions:
                y, d = values[..., k], values[..., k + 1] - values[..., k]
                with np.errstate(divide="ignore", invalid="ignore"):
                    x_0, x_1 = (low - y) / d, (high - y) / d
                x_0, x_1 = np.where(d < 0.0, x_1, x_0), np.where(d < 0.0, x_0, x_1)
                on = on & ((d != 0.0) | ((low <= y) & (y <= high)))
                f = np.where(d == 0.0, f, np.maximum(f, x_0))
                g = np.where(d == 0.0, g, np.minimum(g, x_1))
            on = on & (f <= g)
            first = np.where(on, np.minimum(first, k + f), first)
            end = np.where(on, np.maximum(end, k + g), end)
        low, high = np.maximum(first - self.slack, box.low), np.minimum(end + self.slack, box.high)
        return box._replace(low=low, high=high)

    def strips(self, box: Boxes) -> Strips:
        """The parts of the polygons in the boxes about their chords."""
        points = self.of(self.points, box.problem)
        p, e = self.at(box.problem, box.low), self.at(box.problem, box.high)
        D = e - p
        apart = 0.5 * self.slack
        inside = (self._vertex > box.low[..., None] + apart) & (self._vertex < box.high[..., None] - apart)
        x, z = points[..., 0] - p[..., None, 0], points[..., 1] - p[..., None, 1]
        with np.errstate(divide="ignore", invalid="ignore"):
            off_z = np.where(inside, z - (D[..., 1] / D[..., 0])[..., None] * x, 0.0)
            off_v = np.where(inside, x - (D[..., 0] / D[..., 1])[..., None] * z, 0.0)
        off_z, off_v = (np.where(np.isfinite(off), off, np.inf) for off in (off_z, off_v))
        (z_0, z_1), (v_0, v_1) = ((np.minimum(x.min(-1), 0.0), np.maximum(x.max(-1), 0.0)) for x in (off_z, off_v))
        slip = (v_1 - v_0) * self.diagonal < (z_1 - z_0) * self.c
        low, high = np.where(slip, v_0, z_0), np.where(slip, v_1, z_1)
        bends = inside.any(-1)
        weight = np.where(slip, self.diagonal, self.c) * (high - low)
        weight = np.where(bends, np.maximum(weight, np.finfo(float).tiny), 0.0)
        away = np.where(inside, np.abs(np.where(slip[..., None], off_v, off_z)), -1.0)
        middle, radius = 0.5 * (low + high), 0.5 * (high - low) * (1.0 + 8.0 * EPS)
        return Strips(p, D, slip, middle, radius, weight, np.argmax(away, axis=-1))

    def matrix(self, D: Array) -> tuple[Array, Callable[[Array], Array], Array]:
        """(ÃD_v + CD_ζ, magnitudes of its products, scale of its columns) for chords D (n, m, 2)."""
        i, d_v, d_z = np.arange(self.m), np.abs(D[..., 0]), np.abs(D[..., 1])
        M = self.A * D[:, None, :, 0]
        M[:, i, i] += self.c * D[..., 1]
        scale = d_v * self.size_of_A.max(0) + self.c * d_z
        scale = np.where(scale > 0.0, scale, 1.0)
        return M, lambda w: (d_v * w) @ self.size_of_A + self.c * d_z * w, scale

    def strip_step(self, box: Boxes, strip: Strips) -> Boxes:
        """Places and s of boxes by one inverse; s is a variable, v_i ∈ centre_i + slope_i (s − middle) ± reach_i."""
        m, n, c = self.m, len(box.low), self.c
        M, size, scale = self.matrix(strip.D)
        Y, rho = inverse_of(M, size, scale)
        good = np.isfinite(rho)
        W = np.stack([strip.slip, ~strip.slip], axis=-1).astype(float)
        q = strip.p + W * strip.middle[..., None]
        s, s_radius = 0.5 * (box.s_0 + box.s_1), 0.5 * (box.s_1 - box.s_0) * (1.0 + 4.0 * EPS)
        rhs = self.load[box.problem] - q[..., 0] @ self.A - c * q[..., 1]
        beta = np.zeros((n, m))
        if self.l_1 is not None:
            rhs, beta = rhs + s[:, None] * self.l_1, Y @ self.l_1
        tau = (Y @ rhs[..., None])[..., 0]
        bends = max(1, int(np.count_nonzero(strip.radius > 0.0, axis=-1).max()))
        j = np.argpartition(-strip.radius, min(bends, m - 1), axis=-1)[:, :bends]  # those that bend, padded
        r, by_z = np.take_along_axis(strip.radius, j, -1), np.take_along_axis(W[..., 1], j, -1)
        YK = np.take_along_axis(Y, j[:, None, :], -1) * (c[j] * by_z)[:, None, :]
        if np.any(by_z < 1.0):
            YK += (Y @ self.A[:, j].transpose(1, 0, 2)) * (1.0 - by_z)[:, None, :]
        largest = np.abs(strip.p) + np.abs(strip.D) + W * (np.abs(strip.middle) + strip.radius)[..., None]
        noise = largest[..., 0] @ self.size_of_A + c * largest[..., 1] + np.abs(self.load[box.problem])
        noise = 4.0 * (m + 8) * EPS * (noise + (0.0 if self.l_1 is None else np.abs(self.l_1)))
        error = (np.abs(Y) @ noise[..., None])[..., 0]
        with np.errstate(invalid="ignore", over="ignore"):
            terms = np.abs(tau) + np.abs(beta) + (np.abs(YK) @ r[..., None])[..., 0] + error
            error += (rho / (1.0 - np.minimum(rho, 0.5)))[:, None] * terms.max(-1, keepdims=True)
        points, ends, conditions = self.of(self.points, box.problem), [box.s_0, box.s_1], []
        for axis in (0, 1):
            d = strip.D[..., axis] / scale
            centre, slope = q[..., axis] + d * tau, d * beta
            X = -d[..., None] * YK
            X[np.arange(n)[:, None], j, np.arange(bends)] += np.take_along_axis(W[..., axis], j, -1)
            with np.errstate(invalid="ignore"):
                reach = (np.abs(X) @ r[..., None])[..., 0] * (1.0 + 8.0 * bends * EPS) + np.abs(d) * error
                reach += 4.0 * EPS * (np.abs(centre) + np.abs(q[..., axis]))
                half = reach + np.abs(slope) * s_radius[:, None]
            known = good[:, None] & np.isfinite(centre) & np.isfinite(half)
            low, high = np.where(known, centre - half, -np.inf), np.where(known, centre + half, np.inf)
            conditions.append((points[..., axis], low, high))
            if self.l_1 is not None:
                ends = self._clip_s(ends, box, axis, good, s[:, None], centre, slope, reach)
        s_0, s_1 = ends
        return self._clipped(box._replace(s_0=s_0, s_1=s_1), conditions)

    def _clip_s(
        self, ends: list[Array], box: Boxes, axis: int, good: Flags, s: Array, centre: Array, slope: Array, reach: Array
    ) -> list[Array]:
        """The part of s in which every node's slip (axis 0) or traction (1) may lie on its part of the polygon."""
        values = self.of(self.points, box.problem)[..., axis]
        start, end = self.at(box.problem, box.low)[..., axis], self.at(box.problem, box.high)[..., axis]
        inside = (self._vertex > box.low[..., None]) & (self._vertex < box.high[..., None])
        low = np.minimum(np.minimum(start, end), np.where(inside, values, np.inf).min(-1))
        high = np.maximum(np.maximum(start, end), np.where(inside, values, -np.inf).max(-1))
        reach = reach + 16.0 * EPS * (np.abs(low) + np.abs(high) + np.abs(centre))
        with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
            x, y = (low - centre - reach) / slope, (high - centre + reach) / slope
        x, y = np.where(slope > 0.0, x, y), np.where(slope > 0.0, y, x)
        used = good[:, None] & (slope != 0.0) & np.isfinite(x) & np.isfinite(y)
        x, y = np.where(used, x, -4.0), np.where(used, y, 4.0)
        s_0, s_1 = s + x - 16.0 * EPS * (1.0 + np.abs(x)), s + y + 16.0 * EPS * (1.0 + np.abs(y))
        return [np.maximum(ends[0], s_0.max(-1)), np.minimum(ends[1], s_1.min(-1))]

    def reduced(self, box: Boxes, effort: Effort) -> Boxes:
        """The boxes made smaller until that pays no more; those without a solution fall out."""
        done = []
        for _ in range(ROUNDS):
            if not len(box.low):
                break
            size, width = box.size, box.s_1 - box.s_0
            box = self.row_steps(box, effort)
            alive = box.alive
            box, size, width = box.take(alive), size[alive], width[alive]
            strip = self.strips(box)
            straight = strip.straight
            if not straight.all():
                fresh = self.strip_step(box.take(~straight), strip.take(~straight))
                for old, new in zip(box[1:], fresh[1:], strict=True):
                    old[~straight] = new
            slow = (box.size > effort.enough * size) & (box.s_1 - box.s_0 >= effort.enough * width)
            ends, alive = straight | slow, box.alive
            done.append(box.take(ends & alive))
            box = box.take(alive & ~ends)
        return joined([*done, box])

    def search(self, start: Boxes, limits: Limits, effort: Effort = AT_A_LOAD) -> Cells:
        """All cells that may hold a solution in the boxes `start`, which cover them; problem by problem within limits.

        Depth first, so that few boxes wait.
        """
        count, batch = len(self.load), max(1, min(512, _MEMORY // self.m**2))
        boxes, spent, stopped = np.zeros(count, dtype=np.intp), np.zeros(count), np.zeros(count, dtype=bool)
        waiting, found = start, [np.empty((0, 1 + self.m), dtype=np.intp)]
        while len(waiting.low):
            began, rest = time.perf_counter(), max(0, len(waiting.low) - batch)
            waiting, box = waiting.take(slice(rest)), waiting.take(slice(rest, None))
            np.add.at(boxes, box.problem, 1)
            stopped[box.problem] |= (boxes[box.problem] > limits.boxes) | (spent[box.problem] > limits.seconds)
            box = box.take(~stopped[box.problem])
            own = box.problem
            if not len(own):
                continue
            box = self.reduced(box, effort)
            strip = self.strips(box)
            cell = box.take(strip.straight)
            last = np.broadcast_to(self.of(self.last, cell.problem), cell.low.shape)
            sides = np.minimum(np.floor(cell.low + 0.5 * self.slack).astype(np.intp), last - 1)
            found.append(np.column_stack([cell.problem, sides]))
            bent = ~strip.straight
            box, vertex, weight = box.take(bent), strip.vertex[bent], strip.weight[bent]
            n, i = np.arange(len(vertex)), np.argmax(weight, axis=-1) if len(vertex) else np.zeros(0, dtype=np.intp)
            below, above = box.high.copy(), box.low.copy()
            below[n, i] = above[n, i] = vertex[n, i]
            waiting = joined([waiting, box._replace(high=below), box._replace(low=above)])
            np.add.at(spent, own, (time.perf_counter() - began) / len(own))
        cells = np.unique(np.concatenate(found), axis=0)
        return Cells(cells[:, 0], cells[:, 1:], boxes, stopped)

    def whole(self, problem: Index, s_0: float | Array = 0.0, s_1: float | Array = 0.0) -> Boxes:
        """The boxes that hold all solutions of problems (n,) for s between s_0 and s_1."""
        n = len(problem)
        high = np.array(np.broadcast_to(self.of(self.last, problem), (n, self.m)), dtype=float)
        ends = [np.broadcast_to(np.asarray(s, dtype=float), n).copy() for s in (s_0, s_1)]
        return Boxes(problem, ends[0], ends[1], np.zeros((n, self.m)), high)


def polygons(laws: Laws, index: Index, reach: Array) -> tuple[Array, Index]:
    """(vertices (G, m, V, 2) of the filled graphs between −reach and reach, number of their sides (G, m)).

    index: (G, m) which of the laws a node has. Jumps that are rounding are none; short polygons repeat their end.
    """
    inner = []
    for law in laws.laws:
        jump = law.kind_above[:-1] != BEND
        s, b = np.repeat(law.kinks, 1 + jump), np.stack([law.b_left, law.b_right], -1)
        inner.append(np.column_stack([s, b[np.column_stack([np.full(len(jump), True), jump])]]))
    count = np.array([len(vertices) for vertices in inner], dtype=np.intp)
    points = np.empty((*index.shape, int(count.max()) + 2, 2))
    for k, (law, vertices) in enumerate(zip(laws.laws, inner, strict=True)):
        at = index == k
        far = np.maximum(np.broadcast_to(reach, index.shape)[at], 2.0 * np.max(np.abs(law.kinks), initial=0.0))
        tails = [np.stack([s, law.value(s, piece)], -1) for s, piece in ((-far, 0), (far, len(law.q) - 1))]
        rows = np.repeat(tails[1][:, None], points.shape[2], axis=1)
        rows[:, 0], rows[:, 1 : 1 + len(vertices)] = tails[0], vertices
        points[at] = rows
    return points, count[index] + 1


def reach_of(c: Array, laws: Laws, loads: Array, lambda_1: float) -> Array:
    """(m,) bounds of |v_i| for every solution with one of the loads (P, m) [m].

    A hundredth more than the energy allows, for the rounding of λ₁.
    """
    push = float(np.max(largest_push(laws)[laws.index], initial=0.0))
    load = float(np.sqrt(np.max((loads**2) @ (1.0 / c), initial=0.0)))
    return 1.01 * energy_reach(load, push, c, lambda_1)


LAW_ERROR = 1e-3
"""Of the polygon of a law with exponential pieces, relative to its scale."""


@dataclass(frozen=True, eq=False)
class Equilibria:
    """The solutions of one problem, lowest energy first.

    v:         (S, m) slips [m], each proved to be within rounding of one solution;  xi: (S, m) l̃ − Ãv [N/m]
    energy:    (S,) L̃ [J/m];  stable: (S,) strict local minimum
    sides:     (S, m) side of its polygon that every node is on, which tells solutions apart
    complete:  True if these are proved to be all;  reason: why they are not, "" if they are
    undecided: (U, m) sides of the cells that may hold one more solution each
    boxes:     number that was looked at
    law_error: 0, or of the polygon that stands for an exponential law and that all this is of, relative to its scale
    """

    v: Array
    xi: Array
    energy: Array
    stable: Flags
    sides: Index
    complete: bool
    reason: str
    undecided: Index
    boxes: int
    law_error: float = 0.0

    def __len__(self) -> int:
        return len(self.v)


def all_solutions(problem: ContactProblem, limits: Limits | None = None, law_error: float = LAW_ERROR) -> Equilibria:
    """Every solution of one problem; of laws with exponential pieces every one of their polygon."""
    load = problem.l_tilde[None]
    return of_rows(problem.A_tilde, problem.c, problem.law, load, problem.lambda_1, limits, law_error)[0]


def of_rows(
    A_tilde: Array,
    c: Array,
    laws: Laws,
    loads: Array,
    lambda_1: float,
    limits: Limits | None = None,
    law_error: float = LAW_ERROR,
) -> list[Equilibria]:
    """The same of P problems on one body.

    laws: of one problem or of all (index of the shape (), (m,), (R, 1) or (R, m), R = 1 or P)
    loads: (P, m) [N/m];  lambda_1: of the body [Pa/m]
    """
    errors = np.zeros(len(loads))
    if not laws.piecewise_linear:
        errors[:] = np.where(np.any(laws.tables.bent, axis=-1)[np.atleast_2d(laws.index)].any(-1), law_error, 0.0)
        far = float(np.max(reach_of(c, laws, loads, lambda_1), initial=0.0))
        laws = laws.mapped(lambda law: piecewise_linear(law, law_error, far))
    limits, count = limits or Limits(), len(loads)
    problems = PolygonProblems(A_tilde, c, laws, loads, reach_of(c, laws, loads, lambda_1))
    cells = problems.search(problems.whole(np.arange(count)), limits)
    v, inside, outside = solved(problems, cells.problem, cells.sides)
    body, index = CondensedBody.known(A_tilde, c, lambda_1=lambda_1), np.atleast_2d(laws.index)
    found = []
    for i in range(count):
        own = cells.problem == i
        sure, undecided = own & inside, cells.sides[own & ~inside & ~outside]
        own_v, sides = v[sure], cells.sides[sure]
        own_laws = laws.tables.at(np.repeat(index[[min(i, len(index) - 1)]], len(sides), axis=0))
        rows = ContactProblem.on(body, np.repeat(loads[[i]], len(sides), axis=0), own_laws)
        energy, stable = rows.energy(own_v), strict_minimum(rows, own_v)
        reason = _reason(int(cells.boxes[i]), bool(cells.stopped[i]), len(undecided), len(sides), limits)
        k, told = np.argsort(energy, kind="stable"), (not reason, reason, undecided, int(cells.boxes[i]))
        found.append(Equilibria(own_v[k], rows.xi(own_v)[k], energy[k], stable[k], sides[k], *told, float(errors[i])))
    return found


def _reason(boxes: int, stopped: bool, undecided: int, count: int, limits: Limits) -> str:
    """Why a list is not proved complete; empty if it is."""
    if stopped:
        what = "boxes" if boxes > limits.boxes else "seconds"
        return f"the limit of {getattr(limits, what):g} {what} was met"
    if undecided:
        return (
            f"{undecided} combination{'s' if undecided > 1 else ''} of pieces of the law cannot be decided within "
            "rounding (a solution on a kink, as exact symmetry makes them, or a singular piece)"
        )
    return "" if count % 2 else f"the number of solutions, {count}, is even, which no regular problem has"


def solved(problems: PolygonProblems, problem: Index, sides: Index) -> tuple[Array, Flags, Flags]:
    """(v (n, m), whether it is proved inside its cell, whether the cell is proved to have none) of cells (n, m)."""
    m, step = problems.m, max(1, 2_000_000 // problems.m**2)
    parts = [(np.empty((0, m)), np.empty(0, dtype=bool), np.empty(0, dtype=bool))]
    for first in range(0, len(problem), step):
        own, k = problem[first : first + step], sides[first : first + step]
        p, D = problems.ends(own, k)
        M, size, scale = problems.matrix(D)
        Y, rho = inverse_of(M, size, scale)
        load, largest = problems.load[own], np.abs(p) + np.abs(D)
        noise = np.abs(load) + largest[..., 0] @ problems.size_of_A + problems.c * largest[..., 1]
        tau = (Y @ (load - p[..., 0] @ problems.A - problems.c * p[..., 1])[..., None])[..., 0]
        error = 4.0 * (m + 8) * EPS * (np.abs(Y) @ noise[..., None])[..., 0]
        share = np.where(np.isfinite(rho), rho / (1.0 - np.minimum(rho, 0.5)), 0.0)[:, None]
        error += share * (np.abs(tau) + error).max(-1, keepdims=True)
        tau, error = tau / scale, error / scale
        good = np.isfinite(rho) & np.isfinite(tau).all(-1)
        outside = good & ((tau < -error) | (tau > 1.0 + error)).any(-1)
        inside = good & ((tau > error) & (tau < 1.0 - error)).all(-1)
        parts.append((p[..., 0] + tau * D[..., 0], inside, outside))
    v, inside, outside = (np.concatenate(x) for x in zip(*parts, strict=True))
    return v, inside, outside
