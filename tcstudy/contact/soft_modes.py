"""The search for all solutions of one problem on fine meshes, by amplitudes of its soft modes.

The number of boxes depends on the body and the law, not on the mesh: nodes need not be on one side
each, as parts with one solution, or with solutions on one curve, end it (contact/curves.py).

Modes:     N_j = C^½ φ_j, φ_j the eigenvectors of C^−½ A C^−½ + diag q⁻ with negative eigenvalues,
           q⁻ the least slopes of the laws; none for laws that jump down, or if more than half are
           negative
Box:       places of all nodes (contact/boxes.py) and amplitudes a_j = N_jᵀv of the modes
Mode step: (A + σ Σ N_j N_jᵀ) v + Cζ = l + σ Σ N_j a_j. The strip step of this matrix, which no
           slopes make nearly singular, gives v and ζ by a, and a = Nᵀv (a) narrows a.
Split:     the widest range of amplitudes in half, or, where all are narrow, a bend
Start:     bounds by two monotone problems. With Z the diagonal and the negative part of A,
           l′ = l − (A − Z) v at the bounds of v, and β the largest nondecreasing function below the
           part of the polygon, Zv + Cβ(v) ≤ l′ for every solution. If Zx > 0 for some x > 0, then
           v ≤ w where Zw + Cβ(w) ≥ l′: on the nodes with v > w, Z(v − w) ≤ 0 for them alone, so
           that v − w ≤ 0. Likewise from below.
Nothing is lost: every step is implied for solutions, and halves share their middle.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from tcstudy.contact.boxes import (
    EPS,
    Boxes,
    Condition,
    Enclosure,
    Limits,
    PolygonProblems,
    Strips,
    product,
)
from tcstudy.contact.curves import (
    Decision,
    Found,
    GraphPart,
    Parts,
    SlopeRange,
    distinct_parts,
    distinct_solutions,
)
from tcstudy.contact.graph_walk import LostWayError

Array = NDArray[np.float64]
Index = NDArray[np.intp]
Flags = NDArray[np.bool_]

_MAX_ROUNDS = 24
"""Most rounds of steps before a box is split."""
_MAX_LEFT = 0.98
"""Share of the size of a box, and of its amplitudes, after a round above which it is split."""
_ROW_TURNS = 2
"""Turns of row steps in a round; what they would move further, the other steps do sooner."""
_BATCH = 16
"""Most boxes that are reduced together."""
_NARROW = 0.02
"""Share of the widest range of an amplitude at the start below which bends are split instead."""
_SWEEPS = 3
"""Times that the equations of the amplitudes narrow them in a step."""


class ModeBoxes(NamedTuple):
    """n boxes: places from and to (n, m), coordinates x from and to (n, k).

    The coordinates are amplitudes of the modes, and s last where the load varies.
    """

    low: Array
    high: Array
    x_low: Array
    x_high: Array

    def take(self, rows: Flags | Index | slice) -> ModeBoxes:
        """Return the named boxes."""
        return ModeBoxes._make(column[rows] for column in self)

    def put(self, rows: Flags, boxes: ModeBoxes) -> None:
        """Replace the named boxes."""
        for column, values in zip(self, boxes, strict=True):
            column[rows] = values

    @property
    def places(self) -> Boxes:
        return Boxes(np.zeros(len(self.low), dtype=np.intp), self.low, self.high)

    @property
    def alive(self) -> Flags:
        """(n,) boxes that are not empty."""
        has_places = (self.low <= self.high).all(axis=-1)
        return np.asarray(has_places & (self.x_low <= self.x_high).all(axis=-1))


class ModeAnswer(NamedTuple):
    """What a search found.

    solutions: each proved to be one;  undecided: parts that may hold others
    boxes:     their number;  stopped: whether a limit ended the search
    """

    solutions: list[Found]
    undecided: list[GraphPart]
    boxes: int
    stopped: bool


class ModeSearch:
    """The search for all solutions of one problem (`PolygonProblems.single`).

    N: (m, k) the modes;  columns: (m, k) σN, the load by each coordinate, and l̃₁ by s where the
       load varies
    """

    def __init__(self, problems: PolygonProblems) -> None:
        self.problems = problems
        self.parts = Parts(problems)
        self.m = problems.m
        self.N, self.sigma = self._modes()
        self.change = problems.change[0]
        self.has_s = problems.varies
        self.columns = self.sigma * self.N
        if self.has_s:
            self.columns = np.column_stack([self.columns, self.change])
        size_of_N = np.abs(self.N)
        self.stiff = problems.with_matrix(
            problems.A + self.sigma * self.N @ self.N.T,
            problems.size_of_A + self.sigma * size_of_N @ size_of_N.T,
        )

    def _modes(self) -> tuple[Array, float]:
        """Return the soft modes (m, k) and σ, k = 0 where they are no use."""
        whole = GraphPart(np.zeros(self.m, dtype=np.intp), self.parts.side_counts - 1)
        q = self.parts.slopes(whole.alone).low[0]
        if np.isfinite(q).all():
            eigenvalues, vectors = np.linalg.eigh(self.parts.scaled_A + np.diag(q))
            count = int(np.count_nonzero(eigenvalues < 0.0))
            if 0 < 2 * count <= self.m:
                lowest, following = -float(eigenvalues[0]), float(eigenvalues[count])
                sigma = lowest + max(lowest, following)
                return vectors[:, :count] * self.parts.root_c[:, None], sigma
        return np.zeros((self.m, 0)), 0.0

    @property
    def has_modes(self) -> bool:
        """Return whether amplitudes are coordinates of the boxes."""
        return self.N.shape[1] > 0

    def search(self, limits: Limits) -> ModeAnswer:
        """Return all solutions, depth first, within limits."""
        solutions = list[Found]()
        undecided = list[GraphPart]()

        def decided(box: ModeBoxes) -> Flags:
            is_decided, decisions = self._decided(box)
            for decision in decisions:
                solutions.extend(decision.solutions)
                undecided.extend(decision.undecided)
            return is_decided

        boxes, stopped = self.split(decided, limits)
        distinct, doubtful = distinct_solutions(self.parts, solutions)
        open_parts = distinct_parts([*undecided, *doubtful], distinct)
        return ModeAnswer(distinct, open_parts, boxes, stopped)

    def split(self, decided: Callable[[ModeBoxes], Flags], limits: Limits) -> tuple[int, bool]:
        """Make boxes smaller and split them until all are decided, depth first, within limits.

        Return the number of boxes, and whether a limit ended the search.

        decided: returns (n,) which boxes need not be split
        """
        began = time.perf_counter()
        start = self._start()
        root_width = self._root_width(start)
        waiting = [start]
        boxes = 0
        while waiting:
            batch = _stacked(waiting[-_BATCH:])
            del waiting[-_BATCH:]
            boxes += len(batch.low)
            if boxes > limits.boxes or time.perf_counter() - began > limits.seconds:
                return boxes, True
            batch = self._reduced(batch)
            if len(batch.low):
                waiting += self._halves(batch.take(~decided(batch)), root_width)
        return boxes, False

    # -- steps -------------------------------------------------------------------------------------

    def _start(self) -> ModeBoxes:
        """Return the box of all places, between the two monotone problems."""
        places = self.problems.whole()
        for _ in range(2):
            places = self._enveloped(places)
        x_low, x_high = self._amplitudes(places)
        if self.has_s:
            x_low, x_high = np.append(x_low, [[-1.0]], 1), np.append(x_high, [[1.0]], 1)
        return ModeBoxes(places.low, places.high, x_low, x_high)

    def _root_width(self, start: ModeBoxes) -> Array:
        """Return (k,) the widths with which those of boxes are compared: one of all amplitudes."""
        width = (start.x_high - start.x_low)[0]
        count = self.N.shape[1]
        width[:count] = np.max(width[:count], initial=0.0)
        return np.asarray(width)

    def _amplitudes(self, box: Boxes) -> tuple[Array, Array]:
        """Return bounds (n, k) of Nᵀv in boxes."""
        v_low = self.problems.points_at(box.problem, box.low)[..., 0]
        v_high = self.problems.points_at(box.problem, box.high)[..., 0]
        up, down = np.maximum(self.N, 0.0), np.minimum(self.N, 0.0)
        size = np.maximum(np.abs(v_low), np.abs(v_high)) @ np.abs(self.N)
        room = 4.0 * (self.m + 2) * EPS * size
        return v_low @ up + v_high @ down - room, v_high @ up + v_low @ down + room

    def _loaded(self, box: ModeBoxes) -> tuple[PolygonProblems, Boxes]:
        """Return the problems of boxes, each with the loads between its own ends of s."""
        if not self.has_s:
            return self.problems, box.places
        s_low, s_high = box.x_low[:, -1:], box.x_high[:, -1:]
        room = 4.0 * EPS * (np.abs(s_low) + np.abs(s_high))
        load = self.problems.load + 0.5 * (s_low + s_high) * self.change
        change = (0.5 * np.abs(s_high - s_low) + room) * self.change
        places = Boxes(np.arange(len(box.low)), box.low, box.high)
        return self.problems.with_loads(load, change), places

    def _reduced(self, box: ModeBoxes) -> ModeBoxes:
        """Return boxes made smaller until that pays no more, without the empty ones."""
        done = []
        for _ in range(_MAX_ROUNDS):
            if not len(box.low):
                break
            old_size = box.places.size
            old_width = (box.x_high - box.x_low).sum(axis=-1)
            problems, places = self._loaded(box)
            places = problems.row_steps(places, _ROW_TURNS)
            box = box._replace(low=places.low, high=places.high)
            alive = box.alive
            box, old_size, old_width = box.take(alive), old_size[alive], old_width[alive]
            strips = self.problems.strips(box.places)
            straight = strips.straight
            bent = ~straight
            if bent.any():
                box.put(bent, self._bent_step(box.take(bent), strips.take(bent)))
            alive = box.alive
            width = (box.x_high - box.x_low).sum(axis=-1)
            is_done = box.places.size > _MAX_LEFT * old_size
            is_done &= width >= _MAX_LEFT * old_width
            is_done |= straight
            done.append(box.take(is_done & alive))
            box = box.take(alive & ~is_done)
        return _stacked([*done, box])

    def _bent_step(self, box: ModeBoxes, strips: Strips) -> ModeBoxes:
        """Return boxes after the strip step, and the mode step where there are modes."""
        problems, places = self._loaded(box)
        places = problems.strip_step(places, strips)
        new = ModeBoxes(places.low, places.high, box.x_low.copy(), box.x_high.copy())
        alive = new.alive
        if not (self.has_modes and alive.any()):
            return new
        inner = new.take(alive)
        least, greatest = self._amplitudes(inner.places)
        count = self.N.shape[1]
        inner.x_low[:, :count] = np.maximum(inner.x_low[:, :count], least)
        inner.x_high[:, :count] = np.minimum(inner.x_high[:, :count], greatest)
        new.put(alive, self._mode_step(inner))
        return new

    def _mode_step(self, box: ModeBoxes) -> ModeBoxes:
        """Return boxes made smaller with the stiffened matrix, where an inverse proves that."""
        x_0 = 0.5 * (box.x_low + box.x_high)
        radius = 0.5 * (box.x_high - box.x_low) * (1.0 + 4.0 * EPS) + 2.0 * EPS * np.abs(x_0)
        load = self.problems.load + x_0 @ self.columns.T
        columns = np.broadcast_to(self.columns, (len(x_0), *self.columns.shape))
        strips = self.stiff.strips(box.places)
        enclosure = self.stiff.enclosure(strips, load, columns, radius)
        low, high = self._narrowed(box, enclosure, x_0)
        is_alive = (low <= high).all(-1, keepdims=True)
        low, high = np.where(is_alive, low, -radius), np.where(is_alive, high, radius)
        conditions = self.problems.conditions(box.places, enclosure.between(low, high))
        places = self.problems.clipped(box.places, conditions)
        room = 4.0 * EPS * (np.abs(x_0) + radius)
        x_low = np.where(is_alive, np.maximum(box.x_low, x_0 + low - room), np.inf)
        return ModeBoxes(places.low, places.high, x_low, np.minimum(box.x_high, x_0 + high + room))

    def _narrowed(self, box: ModeBoxes, enclosure: Enclosure, x_0: Array) -> tuple[Array, Array]:
        """Return bounds (n, k) of x − x₀ by the equations of the amplitudes, and by hulls of v, ζ.

        With v = v₀ + V(x − x₀) + X δ, a = Nᵀv reads (E − NᵀV)(x − x₀) = Nᵀv₀ − a₀ + NᵀX δ.
        """
        k = self.N.shape[1]
        size_of_N = np.abs(self.N)
        v_0, V = enclosure.centre(0), enclosure.along(0)
        NX = self.N.T @ enclosure.bends(0)
        size_of_v = np.abs(v_0) + enclosure.reach(0, v_0)
        small = (enclosure.room(0, v_0) + 4.0 * (self.m + 8) * EPS * size_of_v) @ size_of_N
        small += 8.0 * EPS * (np.abs(x_0) + enclosure.radius)[:, :k]
        bends = product(np.abs(NX), enclosure.bend_radius) * (1.0 + 8.0 * EPS)
        g = v_0 @ self.N - x_0[:, :k]
        equations = _Equations(np.eye(k, x_0.shape[1]) - self.N.T @ V, g, bends + small)
        low, high = equations.narrowed(-enclosure.radius, enclosure.radius)
        sizes = np.abs(g) + product(np.abs(equations.S), enclosure.radius)
        for column in range(x_0.shape[1] if self.has_s else 1):
            kept = np.delete(np.arange(x_0.shape[1]), column) if self.has_s else slice(None)
            Z = _inverse(equations.S[..., kept])
            rounding = 8.0 * (k + self.m + 4) * EPS * (sizes + bends)
            room = product(np.abs(Z @ NX), enclosure.bend_radius) * (1.0 + 8.0 * EPS)
            room += product(np.abs(Z), small + rounding)
            low, high = _Equations(Z @ equations.S, product(Z, g), room).narrowed(low, high)
        for axis, (least, greatest) in enumerate(self.problems.hulls(box.places)):
            centre = enclosure.centre(axis)
            room = 0.5 * (greatest - least) + enclosure.bent(axis, centre)
            room += 8.0 * EPS * (np.abs(least) + np.abs(greatest) + np.abs(centre))
            g = 0.5 * (least + greatest) - centre
            low, high = _Equations(enclosure.along(axis), g, room).narrowed(low, high)
        return low, high

    # -- ends --------------------------------------------------------------------------------------

    def _decided(self, box: ModeBoxes) -> tuple[Flags, list[Decision]]:
        """Return (n,) which boxes are decided, and what they hold."""
        part = self.parts.part_of(box.low, box.high)
        slopes = self.parts.slopes(part)
        gap, _, lost = self.parts.inertia(slopes)
        straight = (part.first == part.last).all(axis=-1)
        decided = np.zeros(len(gap), dtype=bool)
        decisions = list[Decision]()
        for row in range(len(gap)):
            own = GraphPart(part.first[row], part.last[row])
            decision: Decision | None = None
            if gap[row] > 0.0:
                decision = self.parts.decide(own, float(gap[row]))
                if decision.undecided and not straight[row]:
                    is_small = [np.all(x.last - x.first <= 1) for x in decision.undecided]
                    decision = decision if all(is_small) else None
            elif straight[row]:
                decision = Decision([], [own])
            elif lost[row] == 1:
                one = SlopeRange(slopes.low[[row]], slopes.high[[row]], slopes.pinned[[row]])
                soft = self.parts.soft_direction(one)
                if soft is not None:
                    places = box.take(slice(row, row + 1)).places
                    ends = [self.problems.points_at(places.problem, x)[0, :, 0] for x in places[1:]]
                    decision = self.parts.on_curve(own, np.stack(ends), soft)
            if decision is not None:
                decided[row] = True
                decisions.append(decision)
        return decided, decisions

    def _halves(self, box: ModeBoxes, root_width: Array) -> list[ModeBoxes]:
        """Return boxes cut in the middle of their widest coordinate, or at their heaviest bend."""
        halves = list[ModeBoxes]()
        strips = self.problems.strips(box.places)
        for row in range(len(box.low)):
            one = box.take(slice(row, row + 1))
            share = (one.x_high - one.x_low)[0] / root_width
            if np.max(share, initial=0.0) > _NARROW:
                widest = int(np.argmax(share))
                below, above = one.x_high.copy(), one.x_low.copy()
                cut = 0.5 * (one.x_low[0, widest] + one.x_high[0, widest])
                below[0, widest] = above[0, widest] = cut
                halves += [one._replace(x_low=above), one._replace(x_high=below)]
            else:
                node = int(np.argmax(strips.weight[row]))
                below, above = one.high.copy(), one.low.copy()
                below[0, node] = above[0, node] = strips.vertex[row, node]
                halves += [one._replace(high=below), one._replace(low=above)]
        return halves

    # -- the monotone problems ---------------------------------------------------------------------

    def _enveloped(self, box: Boxes) -> Boxes:
        """Return a box between the solutions of its monotone problems, where Z is an M-matrix."""
        problems = self.problems
        Z = np.diag(problems.diagonal) + problems.minus
        try:
            x = np.linalg.solve(Z, problems.c)
        except np.linalg.LinAlgError:
            return box
        Zx = Z @ x - 4.0 * (self.m + 8) * EPS * (np.abs(Z) @ np.abs(x))
        if not (np.all(x > 0.0) and np.all(Zx > 0.5 * problems.c)):
            return box
        v_low, v_high = (problems.points_at(box.problem, place)[0, :, 0] for place in box[1:])
        load = problems.load[0]
        bounds = np.full((2, self.m), np.inf)
        for sign, v in ((1.0, v_low), (-1.0, v_high)):
            points, counts = self._monotone(box, sign)
            pull = sign * (load - problems.plus @ v) + problems.noise + np.abs(self.change)
            others = problems.with_matrix(Z, problems.size_of_A).with_points(points, counts)
            others.load = pull[None]
            whole = GraphPart(np.zeros(self.m, dtype=np.intp), counts - 1)
            try:
                walk = Parts(others).walk(whole, Z, np.zeros((self.m, 0)), np.zeros(0))
            except LostWayError:
                continue
            w, zeta = walk.v, walk.zeta
            missing = np.abs(pull - Z @ w - problems.c * zeta)
            missing += problems.noise + problems.rounding(np.abs(w), np.abs(zeta), np.abs(pull))
            bounds[int(sign < 0.0)] = w + 1.01 * np.max(missing / Zx) * x
        condition = Condition(problems.points[..., 0], -bounds[1][None], bounds[0][None])
        smaller = problems.clipped(box, [condition])
        return smaller if smaller.alive.all() else box

    def _monotone(self, box: Boxes, sign: float) -> tuple[Array, Index]:
        """Return the largest nondecreasing polygons below the parts of a box (1, m, V, 2), and
        their numbers of sides; with sign −1 of the parts turned by half a turn."""
        problems = self.problems
        low, high = box.low[0], box.high[0]
        ends = [problems.points_at(box.problem, place)[0] for place in box[1:]]
        lines = []
        for node in range(self.m):
            vertex = np.arange(problems.points.shape[2])
            is_inner = (vertex > low[node]) & (vertex < high[node])
            inner = problems.points[0, node, is_inner]
            part = np.concatenate([ends[0][node][None], inner, ends[1][node][None]])
            lines.append(_largest_below(part if sign > 0.0 else -part[::-1]))
        counts = np.array([len(line) - 1 for line in lines], dtype=np.intp)
        points = np.empty((1, self.m, int(counts.max()) + 1, 2))
        for node, line in enumerate(lines):
            points[0, node, : len(line)] = line
            points[0, node, len(line) :] = line[-1]
        return points, counts


def _largest_below(points: Array) -> Array:
    """Return the vertices (k, 2) of the largest nondecreasing function below a polygon."""
    least = float(points[-1, 1])
    vertices = [(float(points[-1, 0]), least)]
    for (v_0, z_0), (v_1, z_1) in zip(points[-2::-1].tolist(), points[:0:-1].tolist(), strict=True):
        if z_0 < least:
            if z_1 > least:
                vertices.append((v_0 + (v_1 - v_0) * (least - z_0) / (z_1 - z_0), least))
            vertices.append((v_0, z_0))
            least = z_0
    if points[0, 0] < vertices[-1][0]:
        vertices.append((float(points[0, 0]), least))
    line = [vertices[-1]]
    for vertex in vertices[-2::-1]:
        if vertex != line[-1]:
            line.append(vertex)
    if len(line) == 1:
        line.append((line[0][0], line[0][1] + 1.0))
    return np.array(line)


def _stacked(parts: list[ModeBoxes]) -> ModeBoxes:
    """Return boxes one after the other, in arrays of their own."""
    return ModeBoxes._make(np.concatenate(columns) for columns in zip(*parts, strict=True))


class _Equations(NamedTuple):
    """|S x − g| ≤ room of n boxes: S (n, r, k), g and room (n, r); room may be infinite."""

    S: Array
    g: Array
    room: Array

    def narrowed(self, low: Array, high: Array) -> tuple[Array, Array]:
        """Return bounds (n, k) of x from bounds low to high; of an empty box they cross."""
        size_of_S = np.abs(self.S)
        for _ in range(_SWEEPS):
            middle, half = 0.5 * (low + high), 0.5 * np.abs(high - low)
            terms = product(size_of_S, np.abs(middle) + half) + np.abs(self.g)
            reach = product(size_of_S, half) + self.room
            reach += 8.0 * (self.S.shape[-1] + 4) * EPS * terms
            missing = (self.g - product(self.S, middle))[..., None] + self.S * middle[:, None, :]
            spread = reach[..., None] - size_of_S * half[:, None, :]
            with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
                best, width = missing / self.S, spread / size_of_S
                width += 8.0 * EPS * (np.abs(best) + width)
                is_known = np.isfinite(best) & np.isfinite(width)
                least = np.where(is_known, best - width, -np.inf)
                most = np.where(is_known, best + width, np.inf)
            low, high = np.maximum(low, least.max(axis=1)), np.minimum(high, most.min(axis=1))
        return low, high


def _inverse(S: Array) -> Array:
    """Return the inverses of matrices (n, k, k), 0 where one is singular."""
    try:
        Z = np.linalg.inv(S)
    except np.linalg.LinAlgError:
        Z = np.zeros_like(S)
    return np.where(np.isfinite(Z).all(axis=(-2, -1), keepdims=True), Z, 0.0)
