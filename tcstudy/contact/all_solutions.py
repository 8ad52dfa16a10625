"""Every solution of a contact problem with piecewise-linear laws, stable or not, proved to be all
or said why not.

Statement: of the given doubles Ã, l̃, c and the polygons through the laws' values at their kinks
the search finds all
           cells (one side of its polygon for every node) that may hold a solution. In a cell the
           problem is linear:
           one solution if its matrix is proved regular and the solution inside, none if that is
           proved outside, else
           undecided (a solution on a kink within rounding, as exact symmetry makes them, or a
           singular cell)
Count:     with growth (15), (16) and Ã positive definite the degree is 1, so that the number of regular solutions is
           odd: a check of every list
Stable:    a strict local minimum of L̃: no node inside a jump down, and Ã + C diag b′ positive definite on the nodes
           off the jumps

Left out: laws with exponential pieces; their polygon is another problem
(`laws.composed.piecewise_linear`), which the caller names.

The search makes boxes that hold all solutions smaller by proof and splits them until none bends.

Problems:  Ãv + Cζ = l̃_p + s l̃₁ with (v_i, ζ_i) on the filled graph of b̂_i, a polygon; s ∈ [−1, 1], or l̃₁ = 0
Place:     t = k + f is the point at the share f of side k of a polygon; a box is an interval of places for every node
Row step:  y_i = Ã_ii v + c_i ζ along the polygon of node i lies in l̃_i − Σ_{j≠i} Ã_ij [v_j]. Where no Ã_ij, i ≠ j, is
           positive, bounds from below follow from those from below alone, so that the steps rise to
           the least solution
           and fall to the largest one: no box is smaller (a lattice system, Tarski 1955)
Strip step: the part of a polygon in the box lies about its chord, (v, ζ) ∈ p + Dτ + W [middle ±
radius], so that
           (ÃD_v + CD_ζ) τ = l̃ + s l̃₁ − … − Kδ, |δ| ≤ radius: one inverse bounds v and ζ. Falling
           sides are part of
           the matrix; only bends count
Cell:      what is left when every node is on one side of its polygon: one segment of solutions, a point for one load
Rounding:  every bound is widened by what rounding may do to it, places by `SLACK`; an inverse Y of M is used only where
           ‖I − YM‖_∞ is proved small, and what it leaves out is added (S. M. Rump, Acta Numerica 19
           (2010) 287–449)
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from tcstudy.contact.certificates import energy_reach, largest_push, strict_minimum
from tcstudy.contact.problem import CondensedBody, ContactProblem
from tcstudy.laws.composed import piecewise_linear
from tcstudy.laws.laws import Laws
from tcstudy.laws.pieces import BEND

Array = NDArray[np.float64]
Index = NDArray[np.intp]
Flags = NDArray[np.bool_]

SAME = 1e-7
"""Solutions that differ by less than this part of the largest slip are one."""
LAW_ERROR = 1e-3
"""Of the polygon of a law with exponential pieces, relative to its scale."""
EPS = float(np.finfo(float).eps)
PROVED = 0.01
"""Largest ‖I − YM‖_∞ with which an inverse is used."""
SLACK = 32.0
"""Roundings of the largest place by which places are widened; a part of a box half as wide is no
part of it."""
ROUNDS = 40
"""Of row steps and a strip step, before a box is split whatever they bring."""
_TURNS, _STEPS, _LEAST = 8, 20, 1e-3
"""Most row steps, in turns after each of which boxes leave that moved less than so many sides."""
_ENOUGH = 0.8
"""Share of a box's size left, from which it is split instead of reduced again."""
_MEMORY = 4_000_000
"""Numbers in the matrices of the boxes that are at work together."""


@dataclass(frozen=True)
class Limits:
    """How much is spent on one problem.

    boxes: most of them;  seconds: wall time
    """

    boxes: int = 20_000
    seconds: float = 60.0


@dataclass(frozen=True, eq=False)
class Equilibria:
    """The solutions of one problem, lowest energy first.

    v:         (S, m) slips [m], each proved to be within rounding of one solution, or found by the solver where
               these are not all;  xi: (S, m) l̃ − Ãv [N/m]
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


def all_solutions(
    problem: ContactProblem, limits: Limits | None = None, law_error: float = LAW_ERROR
) -> Equilibria:
    """Every solution of one problem; of laws with exponential pieces every one of their polygon."""
    return of_rows(problem.rows, limits, law_error, problem.lambda_1)[0]


def of_rows(
    rows: ContactProblem,
    limits: Limits | None = None,
    law_error: float = LAW_ERROR,
    lambda_1: float | None = None,
) -> list[Equilibria]:
    """The same of every row of problems on one body, whose λ₁ may be known [Pa/m]."""
    A_tilde, c, loads, index = rows.A_tilde, rows.c, rows.l_tilde, rows.law.index
    limits, lambda_1 = limits or Limits(), lambda_1 or rows.body.lambda_1
    errors = np.zeros(len(loads))
    if not rows.law.piecewise_linear:
        errors[:] = np.where(np.any(rows.law.bent, axis=-1)[index].any(-1), law_error, 0.0)
    laws = polygon_laws(rows, law_error, lambda_1)
    problems = PolygonProblems(A_tilde, c, laws, loads, lambda_1)
    cells = problems.search(limits)
    at = problems.segments(cells.problem, cells.sides, loads[cells.problem], problems.change)
    body, found = CondensedBody.known(A_tilde, c, lambda_1=lambda_1), []
    for i in range(len(loads)):
        own = cells.problem == i
        sure, undecided = own & at.one, cells.sides[own & ~at.one & ~at.none]
        row = np.full(np.count_nonzero(sure), i)
        solved = ContactProblem.on(body, loads[row], laws.at(index[row]))
        v = at.u[sure, 0]
        energy, stable = solved.energy(v), strict_minimum(solved, v)
        limit = (
            f"{limits.boxes:g} boxes"
            if cells.boxes[i] > limits.boxes
            else f"{limits.seconds:g} seconds"
        )
        reason = unproved(f"{limit} was met" if cells.stopped[i] else "", len(undecided), len(row))
        k = np.argsort(energy, kind="stable")
        v, told = v[k], (not reason, reason, undecided, int(cells.boxes[i]), float(errors[i]))
        found.append(Equilibria(v, solved.xi(v), energy[k], stable[k], cells.sides[sure][k], *told))
    return found


def polygon_laws(rows: ContactProblem, law_error: float, lambda_1: float) -> Laws:
    """Return the laws of rows of problems with straight pieces in the place of exponential ones."""
    laws = rows.law
    if laws.piecewise_linear:
        return laws
    reach = reach_of(rows.c, laws, rows.l_tilde, lambda_1)
    largest_slip = float(np.max(reach, initial=0.0))
    return laws.mapped(lambda law: piecewise_linear(law, law_error, largest_slip))


def with_solution(equilibria: Equilibria, problem: ContactProblem, v: Array) -> Equilibria:
    """Return the solutions of one problem and v (m,), another one, unless it is among them.

    The laws of the problem must be piecewise linear.
    """
    largest = float(np.max(np.abs(v), initial=0.0))
    apart = np.max(np.abs(equilibria.v - v), axis=1, initial=0.0)
    if np.any(apart <= SAME * largest):
        return equilibria
    energy = np.append(equilibria.energy, problem.energy(v))
    order = np.argsort(energy, kind="stable")
    stable = np.append(equilibria.stable, strict_minimum(problem.rows, v[None]))
    return replace(
        equilibria,
        v=np.concatenate([equilibria.v, v[None]])[order],
        xi=np.concatenate([equilibria.xi, problem.xi(v)[None]])[order],
        energy=energy[order],
        stable=stable[order],
        sides=np.concatenate([equilibria.sides, sides_at(problem.law, v)[None]])[order],
    )


def sides_at(laws: Laws, v: Array) -> Index:
    """Return the side of its polygon that every slip v (m,) is on, at a bend the one to its left."""
    at = laws.locate(v)
    is_upright = at.on & (laws.kind(at) != BEND)
    # a law of K kinks has K + 1 pieces, but 2 K + 1 codes of pieces and upright sides
    codes = 2 * at.piece + is_upright - laws.node_index(len(v))
    return sides_of_codes(laws)[codes]


def sides_of_codes(laws: Laws) -> Index:
    """Return the side of its polygon that every code of the laws' graph is.

    The polygons leave out the upright sides where a law only bends.
    """
    kinds = laws.tables.kinds
    kept = np.ones((len(kinds), 2 * kinds.shape[1] + 1), dtype=bool)
    kept[:, 1::2] = kinds != BEND
    return np.asarray((np.cumsum(kept, axis=-1) - 1).ravel(), dtype=np.intp)


def unproved(limit: str, undecided: int, count: int) -> str:
    """Why solutions of a load, or of a range, are not proved to be all; empty if they are.

    limit: that was met, in words;  count: of the solutions, where a range begins
    """
    if limit:
        return f"the limit of {limit}"
    if undecided:
        return (
            f"{undecided} combination{'s' if undecided > 1 else ''} of pieces of the law cannot be decided within "
            "rounding (a solution on a kink, as exact symmetry makes them, or a singular piece)"
        )
    return (
        ""
        if count % 2
        else f"the number of solutions, {count}, is even, which no regular problem has"
    )


class Boxes(NamedTuple):
    """n boxes: problem of each (n,), places from and to (n, m)."""

    problem: Index
    low: Array
    high: Array

    def take(self, which: Flags | Index | slice) -> Boxes:
        return Boxes._make(x[which] for x in self)

    @property
    def alive(self) -> Flags:
        return np.asarray((self.low <= self.high).all(-1))

    @property
    def size(self) -> Array:
        """Sides that the boxes take, those within one side by their share."""
        return np.asarray(np.minimum(self.high - self.low, 1.0).sum(-1))


def joined(parts: list[Boxes]) -> Boxes:
    """Boxes one after the other."""
    return Boxes._make(np.concatenate(x) for x in zip(*parts, strict=True))


class Strips(NamedTuple):
    """Parts of the polygons in n boxes: start p and chord D (n, m, 2), and how they leave the
    chord.

    W:      1 where that is measured, in slip or else in traction (n, m, 2);  middle, radius: how far (n, m)
    weight: of the bends in the balance of the node, 0 without any;  vertex: the place of the largest
    """

    p: Array
    D: Array
    W: Array
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


class Cells(NamedTuple):
    """What a search ends in.

    problem, sides: (n,), (n, m) sides of all nodes in each cell that may hold solutions
    boxes: (P,) looked at of each problem;  stopped: (P,) by a limit: there may be more cells
    """

    problem: Index
    sides: Index
    boxes: Index
    stopped: Flags


class Segments(NamedTuple):
    """The solutions of n cells.

    one, none: (n,) proved to have one segment, or no solution; else a corner is within rounding, or rank is lost
    u:     (n, 2, m) displacements at both ends [m];  s: (n, 2) share of the interval there; without `one` these and
    open_end: (n, 2), whether s reaches an end of the interval there, which it then is to the bit, mean nothing
    """

    one: Flags
    none: Flags
    u: Array
    s: Array
    open_end: Flags


def inverse_of(M: Array, size: Callable[[Array], Array], scale: Array) -> tuple[Array, Array]:
    """(Y, share): Y ≈ (M/scale)⁻¹ (n, m, m); how much larger than Y r a solution may be, ∞ without
    a proof (n,).

    scale: (n, m) of the columns;  size(w): (n, m) magnitudes that the products M w are made of
    share: ρ/(1 − ρ) with ρ a bound of ‖I − YM/scale‖_∞, rounding of M included
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
        share = np.where(rho < PROVED, rho / (1.0 - np.minimum(rho, PROVED)), np.inf)
    return np.asarray(Y), share


class PolygonProblems:
    """P problems on one body, with laws and loads of their own.

    A, c, lambda_1: as of ContactProblem;  load: (P, m) l̃ [N/m];  change: (m,) load per s, None for none
    laws:   piecewise linear, of one problem or of all (index of the shape (), (m,), (R, 1) or (R, m), R = 1 or P)
    points: (G, m, V, 2) vertices (s, b) of the polygons of the G kinds of problem;  last: (G, m) number of sides
    """

    def __init__(
        self,
        A: Array,
        c: Array,
        laws: Laws,
        load: Array,
        lambda_1: float,
        change: Array | None = None,
    ) -> None:
        self.A, self.c, self.m, self.load = A, c, len(c), load
        self.change = np.zeros(len(c)) if change is None else change
        self.diagonal, self.size_of_A = np.diagonal(A).copy(), np.abs(A)
        off = A - np.diag(self.diagonal)
        self.minus, self.plus = np.minimum(off, 0.0), np.maximum(off, 0.0)
        self.positive = bool(np.any(self.plus))
        index = np.atleast_2d(laws.index)
        index = np.broadcast_to(index, (len(index), self.m))
        kinds, kind = np.unique(index, axis=0, return_inverse=True)
        self.kind = np.broadcast_to(kind.reshape(-1), len(load))
        ends = np.concatenate([load - self.change, load + self.change])
        self.points, self.last = polygons(laws, kinds, reach_of(c, laws, ends, lambda_1))
        count = self.points.shape[2]
        self.slack = SLACK * EPS * (1 + count)
        v, z = self.points[..., 0], self.points[..., 1]
        self.Y = self.diagonal[:, None] * v + c[:, None] * z
        largest = np.abs(self.points).max((0, 2))
        self.noise = self.rounding(largest[..., 0], largest[..., 1], np.abs(load).max(0))
        sides = (v[..., :-1], np.diff(v), self.Y[..., :-1], np.diff(self.Y))
        self._sides = [np.ascontiguousarray(x).reshape(-1) for x in sides]
        self._base = (np.arange(len(kinds) * self.m) * (count - 1)).reshape(len(kinds), self.m)
        self._vertex = np.arange(count)

    def rounding(self, v: Array, z: Array, load: Array) -> Array:
        """What rounding may do to the balance of slips, tractions and loads of these sizes (…, m)
        [N/m]."""
        return np.asarray(
            4.0
            * (self.m + 8)
            * EPS
            * (v @ self.size_of_A + self.c * z + load + np.abs(self.change))
        )

    def of(self, table: NDArray[Any], problem: Index) -> NDArray[Any]:
        """The rows of a table (G, …) of problems (n,); one row if all have the same."""
        return table if len(table) == 1 else table[self.kind[problem]]

    def at(self, problem: Index, place: Array) -> Array:
        """The points (n, m, 2) at places (n, m)."""
        points, k = (
            self.of(self.points, problem),
            np.minimum(place.astype(np.intp), self.points.shape[2] - 2),
        )
        start, end = (
            np.take_along_axis(points, k[..., None, None] + i, axis=-2)[..., 0, :] for i in (0, 1)
        )
        f = (place - k)[..., None]
        return np.where(f <= 0.0, start, np.where(f >= 1.0, end, start + f * (end - start)))

    def row_steps(self, box: Boxes) -> Boxes:
        """Row steps until they pay no more, and one over all sides: the bounds move only along the
        side they are on."""
        margin = self.noise + np.abs(self.change)
        low, high = self.load[box.problem] - margin, self.load[box.problem] + margin
        a, b, busy = box.low.copy(), box.high.copy(), np.arange(len(low))
        base, last = self.of(self._base, box.problem), self.of(self.last, box.problem)
        for _ in range(_TURNS):
            x, y, p, q = a[busy], b[busy], low[busy], high[busy]
            address, end = (x if len(x) == 1 else x[busy] for x in (base, last - 1))
            for _ in range(_STEPS):
                x_0, y_0 = x, y
                x, y = self._row_step(address, end, p, q, x, y)
            a[busy], b[busy] = x, y
            busy = busy[(x <= y).all(-1) & (np.maximum(x - x_0, y_0 - y).max(-1) > _LEAST)]
            if not len(busy):
                break
        ok = np.flatnonzero((a <= b).all(-1))
        own = Boxes(box.problem, a, b).take(ok)
        v, w = self.at(own.problem, own.low)[..., 0], self.at(own.problem, own.high)[..., 0]
        low, high = (
            low[ok] - v @ self.minus - w @ self.plus,
            high[ok] - w @ self.minus - v @ self.plus,
        )
        own = self._clipped(own, [(self.of(self.Y, own.problem), low, high)])
        a[ok], b[ok] = own.low, own.high
        return Boxes(box.problem, a, b)

    def _row_step(
        self, base: Index, end: Index, low_0: Array, high_0: Array, a: Array, b: Array
    ) -> tuple[Array, Array]:
        """The places a, b moved along their sides, by one side at most, to where y meets [low,
        high]."""
        k, n = np.minimum(a.astype(np.intp), end), np.maximum(np.ceil(b).astype(np.intp) - 1, 0)
        f, g = a - k, b - n
        v, dv, y, dy = (x.take(base + k) for x in self._sides)
        w, dw, z, dz = (x.take(base + n) for x in self._sides)
        v, w, y_a, z_b = v + f * dv, w + g * dw, y + f * dy, z + g * dz
        low, high = low_0 - v @ self.minus, high_0 - w @ self.minus
        if self.positive:
            low, high = low - w @ self.plus, high - v @ self.plus
        with np.errstate(divide="ignore", invalid="ignore"):
            f, g = (
                np.where(dy > 0.0, (low - y) / dy, np.inf),
                np.where(dz > 0.0, (high - z) / dz, -np.inf),
            )
        # on a side that does not rise all of the rest is below where its start is
        a_1 = np.where(y_a < low, np.where(f < 1.0, k + f - self.slack, k + 1.0), a)
        b_1 = np.where(z_b > high, np.where(g > 0.0, n + g + self.slack, n), b)
        return np.maximum(a_1, a), np.minimum(b_1, b)

    def _clipped(self, box: Boxes, conditions: list[tuple[Array, Array, Array]]) -> Boxes:
        """Hull of the parts of the polygons in the box on which functions of them lie between
        bounds.

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
        return Boxes(box.problem, low, high)

    def strips(self, box: Boxes) -> Strips:
        """The parts of the polygons in the boxes about their chords."""
        points = self.of(self.points, box.problem)
        p = self.at(box.problem, box.low)
        D = self.at(box.problem, box.high) - p
        apart = 0.5 * self.slack
        inside = (self._vertex > box.low[..., None] + apart) & (
            self._vertex < box.high[..., None] - apart
        )
        x, z = points[..., 0] - p[..., None, 0], points[..., 1] - p[..., None, 1]
        with np.errstate(divide="ignore", invalid="ignore"):
            off_z = np.where(inside, z - (D[..., 1] / D[..., 0])[..., None] * x, 0.0)
            off_v = np.where(inside, x - (D[..., 0] / D[..., 1])[..., None] * z, 0.0)
        off_z, off_v = (np.where(np.isfinite(off), off, np.inf) for off in (off_z, off_v))
        (z_0, z_1), (v_0, v_1) = (
            (np.minimum(x.min(-1), 0.0), np.maximum(x.max(-1), 0.0)) for x in (off_z, off_v)
        )
        slip = (v_1 - v_0) * self.diagonal < (z_1 - z_0) * self.c
        low, high = np.where(slip, v_0, z_0), np.where(slip, v_1, z_1)
        weight = np.maximum(
            np.where(slip, self.diagonal, self.c) * (high - low), np.finfo(float).tiny
        )
        weight = np.where(inside.any(-1), weight, 0.0)
        away = np.where(inside, np.abs(np.where(slip[..., None], off_v, off_z)), -1.0)
        middle, radius = 0.5 * (low + high), 0.5 * (high - low) * (1.0 + 8.0 * EPS)
        W = np.stack([slip, ~slip], axis=-1).astype(float)
        return Strips(p, D, W, middle, radius, weight, np.argmax(away, axis=-1))

    def matrix(self, D: Array) -> tuple[Array, Callable[[Array], Array], Array]:
        """(ÃD_v + CD_ζ, magnitudes of its products, scale of its columns) for chords D (n, m,
        2)."""
        i, d_v, d_z = np.arange(self.m), np.abs(D[..., 0]), np.abs(D[..., 1])
        M = self.A * D[:, None, :, 0]
        M[:, i, i] += self.c * D[..., 1]
        scale = d_v * self.size_of_A.max(0) + self.c * d_z
        scale = np.where(scale > 0.0, scale, 1.0)
        return M, lambda w: (d_v * w) @ self.size_of_A + self.c * d_z * w, scale

    def strip_step(self, box: Boxes, strip: Strips) -> Boxes:
        """Boxes made smaller by v_i, ζ_i ∈ centre_i ± reach_i, where one inverse proves that.

        The shares of the chords are τ ± error − Σ YK δ, |δ| ≤ r, of bends of nodes j and of s in
        the last column.
        """
        M, size, scale = self.matrix(strip.D)
        Y, share = inverse_of(M, size, scale)
        load, q = self.load[box.problem], strip.p + strip.W * strip.middle[..., None]
        tau = (Y @ (load - q[..., 0] @ self.A - self.c * q[..., 1])[..., None])[..., 0]
        bends = int(np.count_nonzero(strip.radius > 0.0, axis=-1).max(initial=0))
        j = np.argpartition(-strip.radius, min(bends, self.m - 1), axis=-1)[
            :, :bends
        ]  # those that bend, padded
        r, by_z = (
            np.take_along_axis(strip.radius, j, -1),
            np.take_along_axis(strip.W[..., 1], j, -1),
        )
        YK = np.take_along_axis(Y, j[:, None, :], -1) * (self.c[j] * by_z)[:, None, :]
        if np.any(by_z < 1.0):
            YK += (Y @ self.A[:, j].transpose(1, 0, 2)) * (1.0 - by_z)[:, None, :]
        YK, r = (
            np.append(YK, (Y @ self.change)[..., None], axis=-1),
            np.append(r, np.ones((len(r), 1)), axis=-1),
        )
        largest = (
            np.abs(strip.p)
            + np.abs(strip.D)
            + strip.W * (np.abs(strip.middle) + strip.radius)[..., None]
        )
        noise = self.rounding(largest[..., 0], largest[..., 1], np.abs(load))
        error = (np.abs(Y) @ noise[..., None])[..., 0]
        with np.errstate(invalid="ignore", over="ignore"):
            terms = np.abs(tau) + (np.abs(YK) @ r[..., None])[..., 0] + error
            error += share[:, None] * terms.max(-1, keepdims=True)
        good = np.isfinite(share) & np.isfinite(tau).all(-1)
        tau, error, YK = tau / scale, error / scale, YK / scale[..., None]
        points, conditions = self.of(self.points, box.problem), []
        for axis in (0, 1):
            d, off = strip.D[..., axis], strip.W[..., axis]
            centre, X = q[..., axis] + d * tau, -d[..., None] * YK
            X[np.arange(len(X))[:, None], j, np.arange(bends)] += np.take_along_axis(off, j, -1)
            with np.errstate(invalid="ignore"):
                reach = (np.abs(X) @ r[..., None])[..., 0] * (1.0 + 8.0 * (bends + 1) * EPS)
                reach += np.abs(d) * error + 4.0 * EPS * (np.abs(centre) + np.abs(q[..., axis]))
            known = good[:, None] & np.isfinite(centre) & np.isfinite(reach)
            low, high = (
                np.where(known, centre - reach, -np.inf),
                np.where(known, centre + reach, np.inf),
            )
            conditions.append((points[..., axis], low, high))
        return self._clipped(box, conditions)

    def reduced(self, box: Boxes) -> Boxes:
        """The boxes made smaller until that pays no more; those without a solution fall out."""
        done = []
        for _ in range(ROUNDS):
            if not len(box.low):
                break
            size, box = box.size, self.row_steps(box)
            box, size = box.take(box.alive), size[box.alive]
            strip = self.strips(box)
            straight = strip.straight
            if not straight.all():
                fresh = self.strip_step(box.take(~straight), strip.take(~straight))
                box.low[~straight], box.high[~straight] = fresh.low, fresh.high
            ends, alive = straight | (box.size > _ENOUGH * size), box.alive
            done.append(box.take(ends & alive))
            box = box.take(alive & ~ends)
        return joined([*done, box])

    def search(self, limits: Limits) -> Cells:
        """All cells that may hold a solution, problem by problem within limits; depth first, so
        that few boxes wait."""
        count, batch = len(self.load), max(1, min(512, _MEMORY // self.m**2))
        boxes, spent, stopped = (
            np.zeros(count, dtype=np.intp),
            np.zeros(count),
            np.zeros(count, dtype=bool),
        )
        last = np.broadcast_to(
            self.last if len(self.last) == 1 else self.last[self.kind], (count, self.m)
        )
        waiting, found = (
            Boxes(np.arange(count), np.zeros(last.shape), last.astype(float)),
            list[Index](),
        )
        while len(waiting.low):
            began, rest = time.perf_counter(), max(0, len(waiting.low) - batch)
            waiting, box = waiting.take(slice(rest)), waiting.take(slice(rest, None))
            np.add.at(boxes, box.problem, 1)
            stopped[box.problem] |= (boxes[box.problem] > limits.boxes) | (
                spent[box.problem] > limits.seconds
            )
            box = box.take(~stopped[box.problem])
            own, box = box.problem, self.reduced(box)
            strip = self.strips(box)
            cell, bent = box.take(strip.straight), ~strip.straight
            sides = np.minimum(
                np.floor(cell.low + 0.5 * self.slack).astype(np.intp), last[cell.problem] - 1
            )
            found.append(np.column_stack([cell.problem, sides]))
            box, vertex, i = (
                box.take(bent),
                strip.vertex[bent],
                np.argmax(strip.weight[bent], axis=-1),
            )
            n, below, above = np.arange(len(i)), box.high.copy(), box.low.copy()
            below[n, i] = above[n, i] = vertex[n, i]
            waiting = joined([waiting, box._replace(high=below), box._replace(low=above)])
            np.add.at(spent, own, (time.perf_counter() - began) / max(1, len(own)))
        cells = np.unique(np.concatenate(found), axis=0)
        return Cells(cells[:, 0], cells[:, 1:], boxes, stopped)

    def segments(self, problem: Index, sides: Index, load: Array, per_s: Array) -> Segments:
        """The exact segment of every cell, of which the nodes are on these sides (n, m), for loads
        (n or 1, m) from s = 0 to 1.

        Places τ_i on the sides and s, in units of the columns, are x with m equations N x = r: one
        line x = α + γ σ, σ along the direction of the line, about, which the last row of B = [N;
        γᵀ] adds; it is cut by the ends 0 and 1. Where the load stands still it is the solution of
        the cell, from s = 0 to 1. Proof: with Y the inverse of B, ‖I − YB‖ < 0.01 bounds the error
        of every coordinate; `one` and `none` hold whatever rounding does within that. Sources:
        Cottle, Pang & Stone, The Linear Complementarity Problem (1992), §2.3 (principal pivots);
        Rump, Acta Numer. 19 (2010) 287–449, §10 (verified linear systems).
        """
        step = max(1, _MEMORY // (8 * self.m**2))
        cuts = (slice(first, first + step) for first in range(0, max(len(sides), 1), step))
        parts = [
            self._segments(problem[i], sides[i], load[i] if len(load) > 1 else load, per_s)
            for i in cuts
        ]
        return Segments(*map(np.concatenate, zip(*parts, strict=True)))

    def _segments(self, problem: Index, sides: Index, load: Array, per_s: Array) -> Segments:
        (n, m), c, rows = sides.shape, self.c, np.arange(len(sides))
        p = self.at(problem, sides.astype(float))
        D = self.at(problem, sides.astype(float) + 1.0) - p
        M, size, scale = self.matrix(D)
        l_1, largest = np.abs(per_s), np.abs(p) + np.abs(D)
        widest = np.full((n, 1), l_1.max()) if np.any(l_1) else scale.max(axis=-1, keepdims=True)
        scale = np.concatenate([scale, widest], axis=-1)
        N = np.concatenate([M, np.broadcast_to(-per_s[:, None], (n, m, 1))], axis=-1)
        unit = np.abs(N / scale[:, None]).max(axis=-1)
        unit[unit == 0.0] = 1.0
        N /= unit[..., None]
        line = np.linalg.qr((N / scale[:, None]).swapaxes(1, 2), mode="complete")[0][..., m] * scale

        def products(w: Array) -> Array:
            return np.column_stack(
                [(size(w[:, :m]) + l_1 * w[:, m:]) / unit, np.sum(np.abs(line * w), axis=-1)]
            )

        Y, share = inverse_of(np.concatenate([N, line[:, None]], axis=1), products, scale)
        r = (load - p[..., 0] @ self.A - c * p[..., 1]) / unit
        off = self.rounding(largest[..., 0], largest[..., 1], np.abs(load)) / unit
        alpha, gamma = (Y[..., :m] @ r[..., None])[..., 0], Y[..., m]
        noise, far = (
            (np.abs(Y[..., :m]) @ off[..., None])[..., 0],
            np.sqrt(m + 1.0) * scale.max(axis=-1, keepdims=True),
        )
        terms = np.abs(alpha) + noise + far * np.abs(gamma)
        proved = np.isfinite(share)
        noise += np.where(proved, share, 0.0)[:, None] * terms.max(axis=-1, keepdims=True)
        flat, rising = far * np.abs(gamma) <= noise, gamma > 0.0
        alpha, gamma, noise = alpha / scale, gamma / scale, noise / scale
        off_middle, slack = np.abs(alpha - 0.5), 2.0 * noise
        with np.errstate(divide="ignore", invalid="ignore"):
            to_0, to_1, error = (
                -alpha / gamma,
                (1.0 - alpha) / gamma,
                np.where(flat, 0.0, noise / np.abs(gamma)),
            )
        never = np.where(off_middle > 0.5 + slack, np.inf, -np.inf)
        enter = np.where(flat, never, np.where(rising, to_0, to_1))
        leave = np.where(flat, -never, np.where(rising, to_1, to_0))
        out = (enter - error).max(axis=-1) > (leave + error).min(axis=-1)
        sure = (enter + error).max(axis=-1) < (leave - error).min(axis=-1)
        sure &= (~flat | (off_middle < 0.5 - slack)).all(axis=-1)
        node = np.stack([np.argmax(enter, axis=-1), np.argmin(leave, axis=-1)], axis=1)
        ends = np.stack([enter[rows, node[:, 0]], leave[rows, node[:, 1]]], axis=1)
        later, sooner = (
            enter + error,
            leave - error,
        )  # which facet comes first has to be sure as well
        later[rows, node[:, 0]], sooner[rows, node[:, 1]] = -np.inf, np.inf
        sure &= later.max(axis=-1) < ends[:, 0] - error[rows, node[:, 0]]
        sure &= sooner.min(axis=-1) > ends[:, 1] + error[rows, node[:, 1]]
        none, one = out & proved, sure & proved
        x = alpha[:, None] + gamma[:, None] * np.where(np.isfinite(ends), ends, 0.0)[..., None]
        facets = np.stack([~rising, rising], axis=1).astype(float)
        x = np.where(np.arange(m + 1) == node[..., None], facets, x)
        u = p[:, None, :, 0] + x[..., :m] * D[:, None, :, 0]
        return Segments(one, none, u, x[..., m], node == m)


def polygons(laws: Laws, index: Index, reach: Array) -> tuple[Array, Index]:
    """(vertices (G, m, V, 2) of the filled graphs between −reach and reach, number of their sides
    (G, m)).

    index: (G, m) which of the laws a node has. Jumps that are rounding are none; short polygons
    repeat their end.
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
        far = np.maximum(
            np.broadcast_to(reach, index.shape)[at], 2.0 * np.max(np.abs(law.kinks), initial=0.0)
        )
        tails = [
            np.stack([s, law.value(s, piece)], -1)
            for s, piece in ((-far, 0), (far, len(law.q) - 1))
        ]
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
