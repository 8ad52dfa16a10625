"""Boxes that hold all solutions of problems with piecewise-linear laws, made smaller by proof.

The search makes boxes that hold all solutions smaller by proof, and splits them until every node of
a box is on one side.

Problems:  Ãv + Cζ = l̃_p + s l̃₁ with (v_i, ζ_i) on the filled graph of b̂_i, a polygon;
           s ∈ [−1, 1], or l̃₁ = 0
Place:     t = k + f is the point at the share f of side k of a polygon; a box is an interval of
           places for every node
Row step:  y_i = Ã_ii v + c_i ζ along the polygon of node i lies in l̃_i − Σ_{j≠i} Ã_ij [v_j]. Where
           no Ã_ij, i ≠ j, is positive, bounds from below follow from those from below alone, so
           that the steps rise to the least solution and fall to the largest one: no box is smaller
           (a lattice system, Tarski 1955)
Strip step: the part of a polygon in the box lies about its chord,
           (v, ζ) ∈ p + Dτ + W [middle ± radius], so that (ÃD_v + CD_ζ) τ = l̃ + s l̃₁ − … − Kδ,
           |δ| ≤ radius. One inverse bounds v and ζ. Sides on which b falls are part of the matrix,
           only bends add to the radius.
Cell:      a box in which every node is on one side of its polygon: one segment of solutions, a
           point for one load
Rounding:  every bound is widened by what rounding may do to it, places by `SLACK`. An inverse Y of
           M is used only where ‖I − YM‖_∞ is proved small, and its error is added (S. M. Rump, Acta
           Numerica 19 (2010) 287–449).
"""

from __future__ import annotations

import time
from collections.abc import Callable
from copy import copy
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from tcstudy.contact.certificates import (
    energy_reach,
    largest_pressure,
    largest_push,
    solution_boxes,
)
from tcstudy.contact.problem import CondensedBody, ContactProblem
from tcstudy.laws.laws import Laws
from tcstudy.laws.pieces import BEND

Array = NDArray[np.float64]
Index = NDArray[np.intp]
Flags = NDArray[np.bool_]

EPS = float(np.finfo(float).eps)
TINY = float(np.finfo(float).tiny)
MAX_INVERSE_ERROR = 0.01
"""Largest ‖I − YM‖_∞ with which an inverse is used."""
SLACK = 32.0
"""Roundings of the largest place by which places are widened.

A part of a box that is half as wide does not count.
"""
MAX_ROUNDS = 40
"""Most rounds of row steps and a strip step before a box is split."""
MAX_TURNS = 8
"""Most turns of row steps; after each turn boxes leave that have stopped moving."""
_STEPS_PER_TURN = 20
_MIN_MOVE = 1e-3
"""Move in the last step of a turn below which a box has stopped, in sides."""
_MAX_LEFT = 0.8
"""Share of the size of a box after a round above which it is split."""
_MAX_ENTRIES = 1_000_000
"""Entries in the matrices of the boxes that are reduced together; it limits memory."""


@dataclass(frozen=True)
class Limits:
    """How much is spent on one problem.

    boxes: most of them;  seconds: wall time
    """

    boxes: int = 20_000
    seconds: float = 60.0

    def met(self, boxes: int) -> str:
        """Return which limit was met after so many boxes, in words."""
        limit = f"{self.boxes:g} boxes" if boxes > self.boxes else f"{self.seconds:g} seconds"
        return f"{limit} was met"


class Boxes(NamedTuple):
    """n boxes: problem of each (n,), places from and to (n, m)."""

    problem: Index
    low: Array
    high: Array

    def take(self, rows: Flags | Index | slice) -> Boxes:
        """Return the named boxes."""
        return Boxes._make(column[rows] for column in self)

    @property
    def alive(self) -> Flags:
        """(n,) boxes that are not empty."""
        return np.asarray((self.low <= self.high).all(-1))

    @property
    def size(self) -> Array:
        """Sides that the boxes take, those within one side by their share."""
        return np.asarray(np.minimum(self.high - self.low, 1.0).sum(-1))


def joined(parts: list[Boxes]) -> Boxes:
    """Return boxes one after the other."""
    return Boxes._make(np.concatenate(columns) for columns in zip(*parts, strict=True))


class Condition(NamedTuple):
    """Bounds low, high (n, m) of a function with these values at the vertices (…, m, V)."""

    values: Array
    low: Array
    high: Array


class Strips(NamedTuple):
    """Parts of the polygons in n boxes: start p and chord D (n, m, 2), and their distance from it.

    W:      (n, m, 2) 1 where the distance is measured, in slip or else in traction
    middle, radius: (n, m) of the distance
    weight: (n, m) of the bends in the balance of the node, 0 without any
    vertex: (n, m) the place of the largest distance
    """

    p: Array
    D: Array
    W: Array
    middle: Array
    radius: Array
    weight: Array
    vertex: Index

    @property
    def centre(self) -> Array:
        """(n, m, 2) the points from which shares of the chords are measured."""
        return np.asarray(self.p + self.W * self.middle[..., None])

    @property
    def straight(self) -> Flags:
        """(n,) boxes in which every node is on one side."""
        return np.asarray((self.weight <= 0.0).all(-1))

    def take(self, rows: Flags) -> Strips:
        """Return the strips of the named boxes."""
        return Strips._make(column[rows] for column in self)


@dataclass(frozen=True, eq=False)
class Enclosure:
    """Bounds of v and ζ of all solutions in n boxes: centre + along x + bends δ ± room.

    strip:     parts of the polygons;  node: (n, B) the nodes that bend
    tau, YK, YL: (n, m), (n, m, B), (n, m, k) shares of the chords, and what changes them by δ, x
    error:     (n, m) of these shares, infinite where nothing is proved
    radius:    (n, k) of |x|;  bend_radius: (n, B) of |δ|
    """

    strip: Strips
    node: Index
    tau: Array
    YK: Array
    YL: Array
    error: Array
    radius: Array
    bend_radius: Array

    def centre(self, axis: int) -> Array:
        """Return (n, m) v or ζ in the middle."""
        return np.asarray(self.strip.centre[..., axis] + self.strip.D[..., axis] * self.tau)

    def along(self, axis: int) -> Array:
        """Return (n, m, k) how x moves v or ζ."""
        return np.asarray(self.strip.D[..., axis, None] * self.YL)

    def bends(self, axis: int) -> Array:
        """Return (n, m, B) how bends move v or ζ."""
        X = -self.strip.D[..., axis, None] * self.YK
        row, bend = np.arange(len(X))[:, None], np.arange(X.shape[-1])
        X[row, self.node, bend] += np.take_along_axis(self.strip.W[..., axis], self.node, -1)
        return X

    def room(self, axis: int, centre: Array) -> Array:
        """Return (n, m) the error of v or ζ, rounding included."""
        size = np.abs(centre) + np.abs(self.strip.centre[..., axis])
        with np.errstate(invalid="ignore"):
            return np.asarray(np.abs(self.strip.D[..., axis]) * self.error + 4.0 * EPS * size)

    def bent(self, axis: int, centre: Array) -> Array:
        """Return (n, m) how far v or ζ is from the centre without x."""
        rounding = 1.0 + 8.0 * (self.YK.shape[-1] + 1) * EPS
        bends = product(np.abs(self.bends(axis)), self.bend_radius)
        return np.asarray(bends * rounding + self.room(axis, centre))

    def reach(self, axis: int, centre: Array) -> Array:
        """Return (n, m) how far v or ζ is from the centre."""
        rounding = 1.0 + 8.0 * (self.YL.shape[-1] + 1) * EPS
        along = product(np.abs(self.along(axis)), self.radius)
        return np.asarray(along * rounding + self.bent(axis, centre))

    def between(self, low: Array, high: Array) -> Enclosure:
        """Return the bounds for x from low to high (n, k), which is within the radius."""
        middle = 0.5 * (low + high)
        radius = 0.5 * (high - low) * (1.0 + 8.0 * EPS) + 4.0 * EPS * np.abs(middle)
        size = np.abs(self.tau) + product(np.abs(self.YL), np.abs(middle) + radius)
        error = self.error + 8.0 * (middle.shape[-1] + 4) * EPS * size
        return replace(self, tau=self.tau + product(self.YL, middle), error=error, radius=radius)


class Cells(NamedTuple):
    """Cells in which a search ends.

    problem, sides: (n,), (n, m) sides of all nodes in each cell that may hold solutions
    boxes:   (P,) number of boxes of each problem
    stopped: (P,) whether a limit ended the search: there may be more cells
    waiting: boxes that a limit left
    """

    problem: Index
    sides: Index
    boxes: Index
    stopped: Flags
    waiting: Boxes | None = None


class Segments(NamedTuple):
    """The solutions of n cells.

    has_segment: (n,) cells proved to have one segment of solutions
    is_empty:    (n,) cells proved to have no solution; in others a corner is within rounding, or
                 rank is lost
    u:           (n, 2, m) displacements at both ends [m]
    s:           (n, 2) share of the interval there
    open_end:    (n, 2) whether s reaches an end of the interval there, which it then is to the bit

    Without `has_segment` the last three mean nothing.
    """

    has_segment: Flags
    is_empty: Flags
    u: Array
    s: Array
    open_end: Flags


class SolutionLine(NamedTuple):
    """Lines x = α + γ σ of places and s, in which the solutions of n cells lie.

    alpha, gamma: (n, m + 1);  noise: (n, m + 1) error of x
    rises:     (n, m + 1) whether γ > 0
    is_flat:   (n, m + 1) whether x does not change by more than its error
    is_proved: (n,) whether the error is proved
    """

    alpha: Array
    gamma: Array
    noise: Array
    rises: Flags
    is_flat: Flags
    is_proved: Flags


def inverse_of(M: Array, size: Callable[[Array], Array], scale: Array) -> tuple[Array, Array]:
    """Return (Y, share): Y ≈ (M/scale)⁻¹ (n, m, m) and its relative error (n,).

    A solution may be larger than Y r by the share, which is ∞ without a proof. It is ρ/(1 − ρ) with
    ρ a bound of ‖I − YM/scale‖_∞, rounding of M included.

    scale:   (n, m) of the columns
    size(w): (n, m) magnitudes that the products M w are made of
    """
    m = M.shape[-1]
    scaled = M / scale[:, None, :]
    try:
        Y = np.linalg.inv(scaled)
    except np.linalg.LinAlgError:  # one is singular, the others are not
        Y = np.stack([_pseudo_inverse(matrix) for matrix in scaled])
    residual = Y @ scaled
    diagonal = np.arange(m)
    residual[:, diagonal, diagonal] -= 1.0
    with np.errstate(invalid="ignore", over="ignore"):
        magnitudes = size(1.0 / scale)
        largest_error = product(np.abs(Y), magnitudes).max(-1)
        rho = np.abs(residual, out=residual).sum(-1).max(-1)
        rho += 2.0 * (m + 4) * EPS * largest_error
        proved_share = rho / (1.0 - np.minimum(rho, MAX_INVERSE_ERROR))
        share = np.where(rho < MAX_INVERSE_ERROR, proved_share, np.inf)
    return np.asarray(Y), share


def product(M: Array, x: Array) -> Array:
    """Return the products (n, k) of matrices (n, k, m) and vectors (n, m)."""
    return np.asarray((M @ x[..., None])[..., 0])


def _pseudo_inverse(matrix: Array) -> Array:
    if not np.isfinite(matrix).all():
        return np.zeros_like(matrix)
    return np.asarray(np.linalg.pinv(matrix))


class PolygonProblems:
    """P problems on one body, with laws and loads of their own.

    A, c, lambda_1: as of ContactProblem
    laws:   piecewise linear, of one problem or of all (index of the shape (), (m,), (R, 1) or
            (R, m), R = 1 or P)
    load:   (P, m) l̃ [N/m]
    change: (m,) or (P, m) load per s, None for none

    urgency: (P, m) factors of the weights by which a bend is split before others, None for none

    points: (G, m, V, 2) vertices (s, b) of the polygons of the G kinds of problem
    varies: whether loads change with s
    side_counts: (G, m) number of sides of each polygon
    Y:      (G, m, V) y = Ã_ii v + c_i ζ at the vertices [N/m]
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
        self.A = A
        self.c = c
        self.m = len(c)
        self.load = load
        self.change = np.broadcast_to(0.0 if change is None else change, load.shape)
        self.varies = bool(np.any(self.change))
        self.urgency: Array | None = None
        self.diagonal = np.diagonal(A).copy()
        self.size_of_A = np.abs(A)
        off_diagonal = A - np.diag(self.diagonal)
        self.minus = np.minimum(off_diagonal, 0.0)
        self.plus = np.maximum(off_diagonal, 0.0)
        self.has_plus = bool(np.any(self.plus))

        index = np.atleast_2d(laws.index)
        index = np.broadcast_to(index, (len(index), self.m))
        kinds, kind = np.unique(index, axis=0, return_inverse=True)
        self.kind = np.broadcast_to(kind.reshape(-1), len(load))
        loads_at_ends = np.concatenate([load - self.change, load + self.change])
        pressure = None
        if laws.has_rays or not lambda_1 > 0.0:
            loose = None if lambda_1 > 0.0 else True
            body = CondensedBody.known(A, c, lambda_1=lambda_1, loose=loose)
            all_laws = laws.tables.at(np.broadcast_to(index, load.shape))
            rows = ContactProblem.on(body, load, all_laws)
            reach, pressure = reach_of_openings(rows, np.abs(self.change))
        else:
            reach = reach_of(c, laws, loads_at_ends, lambda_1)
        self.points, self.side_counts = polygons(laws, kinds, reach, pressure)
        vertex_count = self.points.shape[2]
        self.slack = SLACK * EPS * (1 + vertex_count)
        self._vertex = np.arange(vertex_count)

        v, zeta = self.points[..., 0], self.points[..., 1]
        self.Y = self.diagonal[:, None] * v + c[:, None] * zeta
        largest = np.abs(self.points).max((0, 2))
        largest_load = (np.abs(load) + np.abs(self.change)).max(0)
        self.noise = self.rounding(largest[..., 0], largest[..., 1], largest_load)
        sides = (v[..., :-1], np.diff(v), self.Y[..., :-1], np.diff(self.Y))
        self._sides = [np.ascontiguousarray(column).reshape(-1) for column in sides]
        first_side = np.arange(len(kinds) * self.m) * (vertex_count - 1)
        self.first_side = first_side.reshape(len(kinds), self.m)

    def single(self, row: int) -> PolygonProblems:
        """Return one of the problems."""
        others = self.with_loads(self.load[[row]], self.change[[row]])
        others.kind = np.zeros(1, dtype=np.intp)
        one = np.array([row])
        others.points = self.rows_of(self.points, one)
        others.side_counts = self.rows_of(self.side_counts, one)
        others.Y = self.rows_of(self.Y, one)
        others.first_side = self.rows_of(self.first_side, one)
        return others

    def with_loads(self, load: Array, change: Array) -> PolygonProblems:
        """Return problems with other loads and loads per s (P, m), all with the first polygons.

        The loads must be within those of these problems.
        """
        others = copy(self)
        others.load = load
        others.change = change
        others.varies = bool(np.any(change))
        others.urgency = None
        return others

    def with_matrix(self, A: Array, size: Array) -> PolygonProblems:
        """Return problems with another matrix, and magnitudes that it is made of, for strips."""
        others = copy(self)
        others.A = A
        others.size_of_A = size
        others.diagonal = np.diagonal(A).copy()
        return others

    def with_points(self, points: Array, side_counts: Index) -> PolygonProblems:
        """Return one problem with other polygons, for the parts of these."""
        others = copy(self)
        others.points = points
        others.side_counts = side_counts[None]
        return others

    def whole(self) -> Boxes:
        """Return the boxes of all places, one of each problem."""
        count = len(self.load)
        side_counts = self.rows_of(self.side_counts, np.arange(count))
        high = np.broadcast_to(side_counts, (count, self.m)).astype(float)
        return Boxes(np.arange(count), np.zeros(high.shape), high)

    def rounding(self, v: Array, zeta: Array, load: Array) -> Array:
        """Return what rounding may do to the balance of a node (…, m) [N/m].

        v, zeta, load: sizes of slips, tractions and loads (…, m)
        """
        size = v @ self.size_of_A + self.c * zeta + load
        return np.asarray(4.0 * (self.m + 8) * EPS * size)

    def rows_of(self, table: NDArray[Any], problem: Index) -> NDArray[Any]:
        """Return the rows of a table (G, …) of problems (n,); one row if all have the same."""
        return table if len(table) == 1 else table[self.kind[problem]]

    def points_at(self, problem: Index, place: Array) -> Array:
        """Return the points (n, m, 2) at places (n, m)."""
        points = self.rows_of(self.points, problem)
        side = np.minimum(place.astype(np.intp), self.points.shape[2] - 2)
        vertex = side[..., None, None]
        start = np.take_along_axis(points, vertex, axis=-2)[..., 0, :]
        end = np.take_along_axis(points, vertex + 1, axis=-2)[..., 0, :]
        share = (place - side)[..., None]
        inner = start + share * (end - start)
        return np.where(share <= 0.0, start, np.where(share >= 1.0, end, inner))

    def row_steps(self, box: Boxes, turns: int = MAX_TURNS) -> Boxes:
        """Return boxes after row steps until they pay no more, and one over all sides.

        The bounds of a step move only along the side they are on.
        """
        margin = self.noise + np.abs(self.change[box.problem])
        load_low = self.load[box.problem] - margin
        load_high = self.load[box.problem] + margin
        a, b = box.low.copy(), box.high.copy()
        first_side = self.rows_of(self.first_side, box.problem)
        last_side = self.rows_of(self.side_counts, box.problem) - 1
        active = np.arange(len(a))
        for _ in range(turns):
            new_a, new_b = a[active], b[active]
            low = load_low[active]
            high = load_high[active]
            first = first_side if len(first_side) == 1 else first_side[active]
            last_of_node = last_side if len(last_side) == 1 else last_side[active]
            for _ in range(_STEPS_PER_TURN):
                old_a, old_b = new_a, new_b
                new_a, new_b = self._row_step(first, last_of_node, low, high, old_a, old_b)
            a[active], b[active] = new_a, new_b
            moved = np.maximum(new_a - old_a, old_b - new_b).max(-1)
            is_alive = (new_a <= new_b).all(-1)
            active = active[is_alive & (moved > _MIN_MOVE)]
            if not len(active):
                break
        alive = np.flatnonzero((a <= b).all(-1))
        moved_box = Boxes(box.problem, a, b).take(alive)
        inner = self._row_clipped(moved_box, load_low[alive], load_high[alive])
        a[alive], b[alive] = inner.low, inner.high
        return Boxes(box.problem, a, b)

    def _row_clipped(self, box: Boxes, load_low: Array, load_high: Array) -> Boxes:
        """Return boxes after a row step over all their sides."""
        v_low = self.points_at(box.problem, box.low)[..., 0]
        v_high = self.points_at(box.problem, box.high)[..., 0]
        low = load_low - v_low @ self.minus - v_high @ self.plus
        high = load_high - v_high @ self.minus - v_low @ self.plus
        condition = Condition(self.rows_of(self.Y, box.problem), low, high)
        return self.clipped(box, [condition])

    def _row_step(
        self,
        first_side: Index,
        last_side: Index,
        load_low: Array,
        load_high: Array,
        a: Array,
        b: Array,
    ) -> tuple[Array, Array]:
        """Return places a, b moved along their sides to where y meets its bounds.

        They move by one side at most.
        """
        side_a = np.minimum(a.astype(np.intp), last_side)
        side_b = np.maximum(np.ceil(b).astype(np.intp) - 1, 0)
        share_a, share_b = a - side_a, b - side_b
        v_start, v_rise, y_a, rise_a = (column.take(first_side + side_a) for column in self._sides)
        v_a = v_start + share_a * v_rise
        v_start, v_rise, y_b, rise_b = (column.take(first_side + side_b) for column in self._sides)
        v_b = v_start + share_b * v_rise
        low = load_low - v_a @ self.minus
        high = load_high - v_b @ self.minus
        if self.has_plus:
            low = low - v_b @ self.plus
            high = high - v_a @ self.plus
        with np.errstate(divide="ignore", invalid="ignore"):
            share_low = np.where(rise_a > 0.0, (low - y_a) / rise_a, np.inf)
            share_high = np.where(rise_b > 0.0, (high - y_b) / rise_b, -np.inf)
        # on a side that does not rise, y stays below its value at the start
        end_a = np.where(share_low < 1.0, side_a + share_low - self.slack, side_a + 1.0)
        end_b = np.where(share_high > 0.0, side_b + share_high + self.slack, side_b)
        is_below = y_a + share_a * rise_a < low
        is_above = y_b + share_b * rise_b > high
        new_a = np.where(is_below, end_a, a)
        new_b = np.where(is_above, end_b, b)
        return np.maximum(new_a, a), np.minimum(new_b, b)

    def clipped(self, box: Boxes, conditions: list[Condition]) -> Boxes:
        """Return the hull of the parts of the polygons in the boxes that meet the conditions."""
        side_counts = self.rows_of(self.side_counts, box.problem)
        first = np.full(box.low.shape, np.inf)
        end = np.full(box.low.shape, -np.inf)
        for side in range(self.points.shape[2] - 1):
            begin_share = np.clip(box.low - side, 0.0, 1.0)
            end_share = np.clip(box.high - side, 0.0, 1.0)
            meets = (box.low <= side + 1) & (box.high >= side) & (side < side_counts)
            for values, low, high in conditions:
                start = values[..., side]
                rise = values[..., side + 1] - start
                with np.errstate(divide="ignore", invalid="ignore"):
                    to_low = (low - start) / rise
                    to_high = (high - start) / rise
                falls = rise < 0.0
                is_level = rise == 0.0
                enter = np.where(falls, to_high, to_low)
                leave = np.where(falls, to_low, to_high)
                meets &= ~is_level | ((low <= start) & (start <= high))
                begin_share = np.where(is_level, begin_share, np.maximum(begin_share, enter))
                end_share = np.where(is_level, end_share, np.minimum(end_share, leave))
            meets &= begin_share <= end_share
            first = np.where(meets, np.minimum(first, side + begin_share), first)
            end = np.where(meets, np.maximum(end, side + end_share), end)
        low = np.maximum(first - self.slack, box.low)
        high = np.minimum(end + self.slack, box.high)
        return Boxes(box.problem, low, high)

    def hulls(self, box: Boxes) -> list[tuple[Array, Array]]:
        """Return the least and greatest v, and ζ, of the parts of the polygons (n, m) each."""
        points = self.rows_of(self.points, box.problem)
        is_inside = self._vertex > box.low[..., None]
        is_inside &= self._vertex < box.high[..., None]
        begin, end = self.points_at(box.problem, box.low), self.points_at(box.problem, box.high)
        hulls = []
        for axis in (0, 1):
            ends = np.stack([begin[..., axis], end[..., axis]])
            inner = points[..., axis]
            least = np.where(is_inside, inner, np.inf).min(axis=-1)
            greatest = np.where(is_inside, inner, -np.inf).max(axis=-1)
            hulls.append((np.minimum(ends.min(0), least), np.maximum(ends.max(0), greatest)))
        return hulls

    def strips(self, box: Boxes) -> Strips:
        """Return the parts of the polygons in the boxes about their chords."""
        points = self.rows_of(self.points, box.problem)
        p = self.points_at(box.problem, box.low)
        D = self.points_at(box.problem, box.high) - p
        min_distance = 0.5 * self.slack
        is_above_low = self._vertex > box.low[..., None] + min_distance
        is_inside = is_above_low & (self._vertex < box.high[..., None] - min_distance)
        v = points[..., 0] - p[..., None, 0]
        zeta = points[..., 1] - p[..., None, 1]
        off_v = _off_chord(v, zeta, D[..., 0], D[..., 1], is_inside)
        off_zeta = _off_chord(zeta, v, D[..., 1], D[..., 0], is_inside)
        low_v, high_v = _range_with_0(off_v)
        low_zeta, high_zeta = _range_with_0(off_zeta)
        by_slip = (high_v - low_v) * self.diagonal < (high_zeta - low_zeta) * self.c
        low = np.where(by_slip, low_v, low_zeta)
        high = np.where(by_slip, high_v, high_zeta)
        width = high - low
        weight = np.maximum(np.where(by_slip, self.diagonal, self.c) * width, TINY)
        distance = np.abs(np.where(by_slip[..., None], off_v, off_zeta))
        return Strips(
            p=p,
            D=D,
            W=np.stack([by_slip, ~by_slip], axis=-1).astype(float),
            middle=0.5 * (low + high),
            radius=0.5 * width * (1.0 + 8.0 * EPS),
            weight=np.where(is_inside.any(-1), weight, 0.0),
            vertex=np.argmax(np.where(is_inside, distance, -1.0), axis=-1),
        )

    def matrix(self, D: Array) -> tuple[Array, Callable[[Array], Array], Array]:
        """Return ÃD_v + CD_ζ for chords D (n, m, 2), with sizes.

        These are the magnitudes of its products, and the scale of its columns.
        """
        node = np.arange(self.m)
        size_v = np.abs(D[..., 0])
        size_zeta = np.abs(D[..., 1])
        M = self.A * D[:, None, :, 0]
        M[:, node, node] += self.c * D[..., 1]
        scale = size_v * self.size_of_A.max(0) + self.c * size_zeta
        scale = np.where(scale > 0.0, scale, 1.0)
        return M, lambda w: (size_v * w) @ self.size_of_A + self.c * size_zeta * w, scale

    def strip_step(self, box: Boxes, strip: Strips) -> Boxes:
        """Return boxes made smaller by the bounds of v and ζ, where an inverse proves them."""
        per_s = self.change[box.problem][..., None]
        if not self.varies:
            per_s = per_s[..., :0]
        ends = np.ones((len(per_s), per_s.shape[-1]))
        enclosure = self.enclosure(strip, self.load[box.problem], per_s, ends)
        return self.clipped(box, self.conditions(box, enclosure))

    def enclosure(self, strip: Strips, load: Array, columns: Array, radius: Array) -> Enclosure:
        """Return affine bounds of all solutions in n boxes, where an inverse proves them.

        The shares of the chords are τ = Y(l̃ + L x − …) − Σ YK δ, |δ| ≤ radius, of bends of nodes.

        load: (n, m) l̃;  columns: (n, m, k) L, the load per x;  radius: (n, k) of |x|
        """
        M, products, scale = self.matrix(strip.D)
        Y, share = inverse_of(M, products, scale)
        middle = strip.centre
        tau = product(Y, load - middle[..., 0] @ self.A - self.c * middle[..., 1])
        node, YK, bend_radius = self._bends(strip, Y)
        YL = Y @ columns

        far_from_chord = (np.abs(strip.middle) + strip.radius)[..., None]
        largest = np.abs(strip.p) + np.abs(strip.D) + strip.W * far_from_chord
        size_of_load = np.abs(load) + product(np.abs(columns), radius)
        with np.errstate(invalid="ignore", over="ignore"):
            noise = self.rounding(largest[..., 0], largest[..., 1], size_of_load)
            error = product(np.abs(Y), noise)
            terms = np.abs(tau) + product(np.abs(YK), bend_radius) + error
            terms += product(np.abs(YL), radius)
            error += share[:, None] * terms.max(-1, keepdims=True)
        is_proved = np.isfinite(share) & np.isfinite(tau).all(-1) & np.isfinite(error).all(-1)
        if not is_proved.all():
            error[~is_proved] = np.inf
            for shares in (tau, YK, YL):
                shares[~is_proved] = 0.0
        error = error / scale
        tau, YK, YL = tau / scale, YK / scale[..., None], YL / scale[..., None]

        return Enclosure(strip, node, tau, YK, YL, error, radius, bend_radius)

    def conditions(self, box: Boxes, enclosure: Enclosure) -> list[Condition]:
        """Return the bounds of v and ζ of an enclosure."""
        points = self.rows_of(self.points, box.problem)
        conditions = []
        for axis in (0, 1):
            centre = enclosure.centre(axis)
            reach = enclosure.reach(axis, centre)
            is_known = np.isfinite(centre) & np.isfinite(reach)
            low = np.where(is_known, centre - reach, -np.inf)
            high = np.where(is_known, centre + reach, np.inf)
            conditions.append(Condition(points[..., axis], low, high))
        return conditions

    def _bends(self, strip: Strips, Y: Array) -> tuple[Index, Array, Array]:
        """Return nodes that bend (n, B), and YK (n, m, B) and radius (n, B) of these.

        Boxes with fewer bends are padded.
        """
        bends = int(np.count_nonzero(strip.radius > 0.0, axis=-1).max(initial=0))
        order = np.argpartition(-strip.radius, min(bends, self.m - 1), axis=-1)
        node = order[:, :bends]
        radius = np.take_along_axis(strip.radius, node, -1)
        by_zeta = np.take_along_axis(strip.W[..., 1], node, -1)
        weight = (self.c[node] * by_zeta)[:, None, :]
        YK = np.take_along_axis(Y, node[:, None, :], -1) * weight
        if np.any(by_zeta < 1.0):
            by_slip = (1.0 - by_zeta)[:, None, :]
            YK += (Y @ self.A[:, node].transpose(1, 0, 2)) * by_slip
        return node, YK, radius

    def reduced(self, box: Boxes) -> Boxes:
        """Return boxes made smaller until that pays no more, without the empty ones."""
        done = []
        for _ in range(MAX_ROUNDS):
            if not len(box.low):
                break
            old_size = box.size
            box = self.row_steps(box)
            alive = box.alive
            box, old_size = box.take(alive), old_size[alive]
            strip = self.strips(box)
            straight = strip.straight
            if not straight.all():
                smaller = self.strip_step(box.take(~straight), strip.take(~straight))
                box.low[~straight], box.high[~straight] = smaller.low, smaller.high
            alive = box.alive
            is_done = straight | (box.size > _MAX_LEFT * old_size)
            done.append(box.take(is_done & alive))
            box = box.take(alive & ~is_done)
        return joined([*done, box])

    def search(self, limits: Limits, earlier: Cells | None = None) -> Cells:
        """Return all cells that may hold a solution, problem by problem within limits.

        The search goes depth first, so that few boxes wait.

        earlier: search to go on with where limits had stopped it; boxes count from its beginning,
                 seconds anew
        """
        count = len(self.load)
        batch = max(1, min(512, _MAX_ENTRIES // self.m**2))
        boxes = np.zeros(count, dtype=np.intp)
        seconds = np.zeros(count)
        stopped = np.zeros(count, dtype=bool)
        waiting = self.whole()
        cells = list[Index]()
        if earlier is not None and earlier.waiting is not None:
            waiting = earlier.waiting
            boxes = earlier.boxes - np.bincount(waiting.problem, minlength=count)
            cells.append(np.column_stack([earlier.problem, earlier.sides]))
        left = [waiting.take(slice(0))]
        while len(waiting.low):
            began = time.perf_counter()
            first = max(0, len(waiting.low) - batch)
            box = waiting.take(slice(first, None))
            waiting = waiting.take(slice(first))
            np.add.at(boxes, box.problem, 1)
            has_too_many = boxes[box.problem] > limits.boxes
            is_too_slow = seconds[box.problem] > limits.seconds
            stopped[box.problem] |= has_too_many | is_too_slow
            is_left = stopped[box.problem]
            left.append(box.take(is_left))
            box = box.take(~is_left)
            problems_of_batch = box.problem
            box = self.reduced(box)
            strip = self.strips(box)
            straight = strip.straight
            cells.append(self._cells(box.take(straight)))
            bent, bends = box.take(~straight), strip.take(~straight)
            if self.urgency is not None:
                bends = bends._replace(weight=bends.weight * self.urgency[bent.problem])
            halves = _halves(bent, bends)
            waiting = joined([waiting, *halves])
            duration = time.perf_counter() - began
            np.add.at(seconds, problems_of_batch, duration / max(1, len(problems_of_batch)))
        distinct = np.unique(np.concatenate(cells), axis=0)
        return Cells(distinct[:, 0], distinct[:, 1:], boxes, stopped, joined(left))

    def _cells(self, box: Boxes) -> Index:
        """Return (n, 1 + m) the problem and the sides of boxes on one side each."""
        last_side = self.rows_of(self.side_counts, box.problem) - 1
        side = np.floor(box.low + 0.5 * self.slack).astype(np.intp)
        return np.column_stack([box.problem, np.minimum(side, last_side)])

    def segments(self, problem: Index, sides: Index, load: Array, per_s: Array) -> Segments:
        """Return the exact segment of solutions of every cell.

        Places τ_i on the sides and s, in units of the columns, are x with m equations N x = r. They
        are a line x = α + γ σ, σ along the direction of the line, about, which the last row of
        B = [N; γᵀ] adds. It is cut by the ends 0 and 1. Where the load stands still it is the
        solution of the cell, from s = 0 to 1. Proof: with Y the inverse of B, ‖I − YB‖ < 0.01
        bounds the error of every coordinate; `has_segment` and `is_empty` hold whatever rounding
        does within that. Sources: Cottle, Pang & Stone, The Linear Complementarity Problem (1992),
        §2.3 (principal pivots); Rump, Acta Numer. 19 (2010) 287–449, §10 (verified linear systems).

        sides: (n, m) of the cells;  load: (n or 1, m) at s = 0;  per_s: (m,) load per s
        """
        step = max(1, _MAX_ENTRIES // (8 * self.m**2))
        parts = []
        for first in range(0, max(len(sides), 1), step):
            part = slice(first, first + step)
            part_load = load[part] if len(load) > 1 else load
            parts.append(self._segments(problem[part], sides[part], part_load, per_s))
        return Segments(*map(np.concatenate, zip(*parts, strict=True)))

    def unbalanced(self, problem: Index, sides: Index, load: Array) -> Flags:
        """Return (n,) cells without a solution, as their loads do work on a motion they allow.

        With a y for which yᵀM is small, M x = r, 0 ≤ x ≤ 1, has no solution if |yᵀr| > |yᵀM| 1
        (Farkas). It is the left singular vector of the least singular value.
        """
        is_empty = np.zeros(len(sides), dtype=bool)
        for row in range(len(sides)):
            place = sides[row : row + 1].astype(float)
            start = self.points_at(problem[row : row + 1], place)
            end = self.points_at(problem[row : row + 1], place + 1.0)
            M, _, scale = self.matrix(end - start)
            y = np.linalg.svd(M[0] / scale[0])[0][:, -1]
            r = load[row] - start[0, :, 0] @ self.A - self.c * start[0, :, 1]
            largest = np.maximum(np.abs(start[0]), np.abs(end[0]))
            noise = self.rounding(largest[:, 0], largest[:, 1], np.abs(load[row]))
            slack = np.abs(y @ M[0]) + 4.0 * (self.m + 4) * EPS * (np.abs(y) @ np.abs(M[0]))
            is_empty[row] = abs(y @ r) > (1.0 + 1e-6) * float(np.sum(slack) + np.abs(y) @ noise)
        return is_empty

    def _segments(self, problem: Index, sides: Index, load: Array, per_s: Array) -> Segments:
        """Return the segments of cells that are few enough to be solved together."""
        m = self.m
        start = self.points_at(problem, sides.astype(float))
        chord = self.points_at(problem, sides.astype(float) + 1.0) - start
        line = self._line(start, chord, load, per_s)
        has_segment, is_empty, coordinate, ends = _cut(line)
        sigma = np.where(np.isfinite(ends), ends, 0.0)
        x = line.alpha[:, None] + line.gamma[:, None] * sigma[..., None]
        facets = np.stack([~line.rises, line.rises], axis=1).astype(float)
        x = np.where(np.arange(m + 1) == coordinate[..., None], facets, x)
        u = start[:, None, :, 0] + x[..., :m] * chord[:, None, :, 0]
        return Segments(has_segment, is_empty, u, x[..., m], coordinate == m)

    def _line(self, start: Array, chord: Array, load: Array, per_s: Array) -> SolutionLine:
        """Return the lines of the solutions of cells, whose sides go from `start` by `chord`."""
        n, m = len(start), self.m
        M, size, scale = self.matrix(chord)
        size_per_s = np.abs(per_s)
        scale_of_s = scale.max(axis=-1, keepdims=True)
        if np.any(size_per_s):
            scale_of_s = np.full((n, 1), size_per_s.max())
        scale = np.concatenate([scale, scale_of_s], axis=-1)
        column_of_s = np.broadcast_to(-per_s[:, None], (n, m, 1))
        N = np.concatenate([M, column_of_s], axis=-1)
        unit = np.abs(N / scale[:, None]).max(axis=-1)
        unit[unit == 0.0] = 1.0
        N /= unit[..., None]
        columns = (N / scale[:, None]).swapaxes(1, 2)
        basis, _ = np.linalg.qr(columns, mode="complete")
        direction = basis[..., m] * scale

        def products(w: Array) -> Array:
            equations = (size(w[:, :m]) + size_per_s * w[:, m:]) / unit
            return np.column_stack([equations, np.sum(np.abs(direction * w), axis=-1)])

        B = np.concatenate([N, direction[:, None]], axis=1)
        Y, share = inverse_of(B, products, scale)
        r = (load - start[..., 0] @ self.A - self.c * start[..., 1]) / unit
        largest = np.abs(start) + np.abs(chord)
        size_of_load = np.abs(load) + size_per_s
        error = self.rounding(largest[..., 0], largest[..., 1], size_of_load) / unit
        alpha = product(Y[..., :m], r)
        gamma = Y[..., m]
        noise = product(np.abs(Y[..., :m]), error)
        length = np.sqrt(m + 1.0) * scale.max(axis=-1, keepdims=True)
        terms = np.abs(alpha) + noise + length * np.abs(gamma)
        is_proved = np.isfinite(share)
        proved_share = np.where(is_proved, share, 0.0)
        noise += proved_share[:, None] * terms.max(axis=-1, keepdims=True)
        return SolutionLine(
            alpha=alpha / scale,
            gamma=gamma / scale,
            noise=noise / scale,
            rises=gamma > 0.0,
            is_flat=length * np.abs(gamma) <= noise,
            is_proved=is_proved,
        )


def _off_chord(distance: Array, along: Array, rise: Array, run: Array, is_inside: Flags) -> Array:
    """Return (n, m, V) distances of inner vertices from a chord, inf from an upright one.

    distance, along: of the vertices from the start of the chord;  rise, run: of the chord, likewise
    """
    with np.errstate(divide="ignore", invalid="ignore"):
        off = np.where(is_inside, distance - (rise / run)[..., None] * along, 0.0)
    return np.where(np.isfinite(off), off, np.inf)


def _range_with_0(values: Array) -> tuple[Array, Array]:
    return np.minimum(values.min(-1), 0.0), np.maximum(values.max(-1), 0.0)


def _halves(box: Boxes, strip: Strips) -> tuple[Boxes, Boxes]:
    """Return boxes cut at the vertex of their heaviest bend."""
    row = np.arange(len(box.low))
    node = np.argmax(strip.weight, axis=-1)
    below = box.high.copy()
    above = box.low.copy()
    below[row, node] = above[row, node] = strip.vertex[row, node]
    return box._replace(high=below), box._replace(low=above)


def _cut(line: SolutionLine) -> tuple[Flags, Flags, Index, Array]:
    """Return the segments of lines where all coordinates are between 0 and 1.

    These are (has_segment (n,), is_empty (n,), coordinate (n, 2) that ends a segment, σ (n, 2)
    there).
    """
    alpha, gamma, is_flat = line.alpha, line.gamma, line.is_flat
    row = np.arange(len(alpha))
    from_middle = np.abs(alpha - 0.5)
    slack = 2.0 * line.noise
    with np.errstate(divide="ignore", invalid="ignore"):
        to_0 = -alpha / gamma
        to_1 = (1.0 - alpha) / gamma
        error = np.where(is_flat, 0.0, line.noise / np.abs(gamma))
    never = np.where(from_middle > 0.5 + slack, np.inf, -np.inf)
    enter = np.where(is_flat, never, np.where(line.rises, to_0, to_1))
    leave = np.where(is_flat, -never, np.where(line.rises, to_1, to_0))
    latest = enter + error
    earliest = leave - error
    is_empty = (enter - error).max(axis=-1) > (leave + error).min(axis=-1)
    is_sure = latest.max(axis=-1) < earliest.min(axis=-1)
    is_sure &= (~is_flat | (from_middle < 0.5 - slack)).all(axis=-1)

    # which coordinate ends the segment has to be sure as well
    first = np.argmax(enter, axis=-1)
    final = np.argmin(leave, axis=-1)
    begin = enter[row, first]
    end = leave[row, final]
    latest[row, first] = -np.inf
    earliest[row, final] = np.inf
    is_sure &= latest.max(axis=-1) < begin - error[row, first]
    is_sure &= earliest.min(axis=-1) > end + error[row, final]
    coordinate = np.stack([first, final], axis=1)
    ends = np.stack([begin, end], axis=1)
    return is_sure & line.is_proved, is_empty & line.is_proved, coordinate, ends


def polygons(
    laws: Laws, index: Index, reach: Array, pressure: Array | None = None
) -> tuple[Array, Index]:
    """Return (vertices (G, m, V, 2), side counts (G, m)) of filled graphs from −reach to reach.

    Jumps that are rounding are left out. Short polygons repeat their end. A ray is their first
    side, from −`pressure` on.

    index:    (G, m) which of the laws a node has
    pressure: (m,) or (G, m) bounds of −ξ_i/c_i on rays [Pa]
    """
    inner = [_inner_vertices(law) for law in laws.laws]
    counts = np.array([len(vertices) for vertices in inner], dtype=np.intp)
    points = np.empty((*index.shape, int(counts.max()) + 2, 2))
    reach = np.broadcast_to(reach, index.shape)
    for k, (law, vertices) in enumerate(zip(laws.laws, inner, strict=True)):
        has_law = index == k
        farthest_kink = np.max(np.abs(law.kinks), initial=0.0)
        end = np.maximum(reach[has_law], 2.0 * farthest_kink)
        last_piece = len(law.q) - 1
        final = np.stack([end, law.value(end, last_piece)], -1)
        rows = np.repeat(final[:, None], points.shape[2], axis=1)
        if law.closed and pressure is not None:
            rows[:, : len(vertices)] = vertices
            rows[:, 0, 1] = -np.broadcast_to(pressure, index.shape)[has_law]
        else:
            rows[:, 0] = np.stack([-end, law.value(-end, 0)], -1)
            rows[:, 1 : 1 + len(vertices)] = vertices
        points[has_law] = rows
    side_counts = counts + 1 - np.array([law.closed for law in laws.laws])
    return points, side_counts[index]


def _inner_vertices(law: Laws) -> Array:
    """Return the vertices (s, b) of the filled graph of one law at its kinks, two at a jump."""
    is_jump = law.kind_above[:-1] != BEND
    s = np.repeat(law.kinks, 1 + is_jump)
    b = np.stack([law.b_left, law.b_right], -1)
    is_vertex = np.column_stack([np.full(len(is_jump), True), is_jump])
    return np.column_stack([s, b[is_vertex]])


def reach_of_openings(rows: ContactProblem, change: Array) -> tuple[Array, Array]:
    """Return (m,) bounds of |v_i| [m] and of the pressure on rays [Pa], for every solution of rows.

    A body that nothing but contact holds has those of its rigid motions.

    change: (R, m) by how much the loads may differ from those of the rows [N/m]
    """
    if rows.body.lambda_1 > 0.0 and not rows.body.loose:
        low, high = solution_boxes(rows, change)
    else:
        from tcstudy.contact.loose_body import LooseBody

        count = len(rows.l_tilde)
        bodies = [LooseBody(rows.single(row)) for row in range(count)]
        high = np.array([body.reach(change[row]) for row, body in enumerate(bodies)])
        low = rows.law.admissible(-high)
    reach = np.max(np.maximum(np.abs(low), np.abs(high)), axis=0)
    pressure = np.max(largest_pressure(rows, low, high, change), axis=0)
    # also where nothing presses a ray has some length
    b_0 = np.max(np.abs(rows.law.without_rays.b(np.zeros(rows.l_tilde.shape))), axis=0)
    length = np.max(np.abs(rows.l_tilde), axis=0) / rows.c + b_0
    largest = float(np.max(length)) or 1.0
    return 1.01 * reach, 1.01 * np.maximum(pressure, 0.01 * largest) + b_0


def reach_of(c: Array, laws: Laws, loads: Array, lambda_1: float) -> Array:
    """Return (m,) bounds of |v_i| for every solution with one of the loads (P, m) [m].

    A hundredth more than the energy allows, for the rounding of λ₁.
    """
    push_of_law = largest_push(laws)
    push = float(np.max(push_of_law[laws.index], initial=0.0))
    squares = (loads**2) @ (1.0 / c)
    load = float(np.sqrt(np.max(squares, initial=0.0)))
    return 1.01 * energy_reach(load, push, c, lambda_1)
