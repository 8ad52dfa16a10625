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
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from tcstudy.contact.boxes import (
    EPS,
    Boxes,
    Condition,
    Limits,
    PolygonProblems,
    Strips,
    inverse_of,
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

_MAX_ROUNDS = 12
"""Most rounds of steps before a box is split."""
_MAX_LEFT = 0.9
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
    """n boxes: places from and to (n, m), amplitudes from and to (n, k)."""

    low: Array
    high: Array
    a_low: Array
    a_high: Array

    def take(self, rows: Flags | Index | slice) -> ModeBoxes:
        """Return the named boxes."""
        return ModeBoxes._make(column[rows] for column in self)

    @property
    def places(self) -> Boxes:
        return Boxes(np.zeros(len(self.low), dtype=np.intp), self.low, self.high)

    @property
    def alive(self) -> Flags:
        """(n,) boxes that are not empty."""
        has_places = (self.low <= self.high).all(axis=-1)
        return np.asarray(has_places & (self.a_low <= self.a_high).all(axis=-1))


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
    """The search for all solutions of one problem (`PolygonProblems.single`)."""

    def __init__(self, problems: PolygonProblems) -> None:
        self.problems = problems
        self.parts = Parts(problems)
        self.m = problems.m
        whole = GraphPart(np.zeros((1, self.m), dtype=np.intp), self.parts.side_counts[None] - 1)
        q = self.parts.slopes(whole).low[0]
        self.N = np.zeros((self.m, 0))
        self.sigma = 0.0
        if np.isfinite(q).all():
            eigenvalues, vectors = np.linalg.eigh(self.parts.scaled_A + np.diag(q))
            count = int(np.count_nonzero(eigenvalues < 0.0))
            if 0 < 2 * count <= self.m:
                lowest = -float(eigenvalues[0])
                following = float(eigenvalues[count]) if count < self.m else 0.0
                self.sigma = lowest + max(lowest, following)
                self.N = vectors[:, :count] * self.parts.root_c[:, None]
        size_of_N = np.abs(self.N)
        self.stiff = problems.with_matrix(
            problems.A + self.sigma * self.N @ self.N.T,
            problems.size_of_A + self.sigma * size_of_N @ size_of_N.T,
        )

    @property
    def has_modes(self) -> bool:
        """Return whether amplitudes are coordinates of the boxes."""
        return self.N.shape[1] > 0

    def search(self, limits: Limits) -> ModeAnswer:
        """Return all solutions, depth first, within limits."""
        began = time.perf_counter()
        start = self._start()
        root_width = float(np.max(start.a_high - start.a_low, initial=0.0))
        waiting = [start]
        boxes = 0
        solutions = list[Found]()
        undecided = list[GraphPart]()
        while waiting:
            batch = _stacked(waiting[-_BATCH:])
            del waiting[-_BATCH:]
            boxes += len(batch.low)
            if boxes > limits.boxes or time.perf_counter() - began > limits.seconds:
                return self._answer(solutions, undecided, boxes, True)
            batch = self._reduced(batch)
            if not len(batch.low):
                continue
            is_decided, decisions = self._decided(batch)
            for decision in decisions:
                solutions += decision.solutions
                undecided += decision.undecided
            waiting += self._halves(batch.take(~is_decided), root_width)
        return self._answer(solutions, undecided, boxes, False)

    def _answer(
        self, solutions: list[Found], undecided: list[GraphPart], boxes: int, stopped: bool
    ) -> ModeAnswer:
        distinct, doubtful = distinct_solutions(self.parts, solutions)
        open_parts = distinct_parts([*undecided, *doubtful], distinct)
        return ModeAnswer(distinct, open_parts, boxes, stopped)

    # -- steps -------------------------------------------------------------------------------------

    def _start(self) -> ModeBoxes:
        """Return the box of all places, between the two monotone problems."""
        places = self.problems.whole()
        for _ in range(2):
            places = self._enveloped(places)
        a_low, a_high = self._amplitudes(places)
        return ModeBoxes(places.low, places.high, a_low, a_high)

    def _amplitudes(self, box: Boxes) -> tuple[Array, Array]:
        """Return bounds (n, k) of Nᵀv in boxes."""
        v_low = self.problems.points_at(box.problem, box.low)[..., 0]
        v_high = self.problems.points_at(box.problem, box.high)[..., 0]
        up, down = np.maximum(self.N, 0.0), np.minimum(self.N, 0.0)
        room = (
            4.0 * (self.m + 2) * EPS * (np.maximum(np.abs(v_low), np.abs(v_high)) @ np.abs(self.N))
        )
        return v_low @ up + v_high @ down - room, v_high @ up + v_low @ down + room

    def _reduced(self, box: ModeBoxes) -> ModeBoxes:
        """Return boxes made smaller until that pays no more, without the empty ones."""
        done = []
        for _ in range(_MAX_ROUNDS):
            if not len(box.low):
                break
            old_size = box.places.size
            old_width = (box.a_high - box.a_low).sum(axis=-1)
            places = self.problems.row_steps(box.places, _ROW_TURNS)
            box = box._replace(low=places.low, high=places.high)
            alive = box.alive
            box, old_size, old_width = box.take(alive), old_size[alive], old_width[alive]
            strips = self.problems.strips(box.places)
            straight = strips.straight
            bent = ~straight
            if bent.any():
                smaller = self._bent_step(box.take(bent), strips.take(bent))
                for column, values in zip(box, smaller, strict=True):
                    column[bent] = values
            alive = box.alive
            width = (box.a_high - box.a_low).sum(axis=-1)
            is_done = box.places.size > _MAX_LEFT * old_size
            is_done &= width >= _MAX_LEFT * old_width
            is_done |= straight
            done.append(box.take(is_done & alive))
            box = box.take(alive & ~is_done)
        return _stacked([*done, box])

    def _bent_step(self, box: ModeBoxes, strips: Strips) -> ModeBoxes:
        """Return boxes after the strip step, and the mode step where there are modes."""
        places = self.problems.strip_step(box.places, strips)
        if not self.has_modes:
            return box._replace(low=places.low, high=places.high)
        alive = places.alive
        a_low, a_high = box.a_low.copy(), box.a_high.copy()
        new = ModeBoxes(places.low, places.high, a_low, a_high)
        if not alive.any():
            return new
        inner = places.take(alive)
        least, greatest = self._amplitudes(inner)
        part = ModeBoxes(
            inner.low,
            inner.high,
            np.maximum(a_low[alive], least),
            np.minimum(a_high[alive], greatest),
        )
        stepped = self._mode_step(part)
        for column, values in zip(new, stepped, strict=True):
            column[alive] = values
        return new

    def _mode_step(self, box: ModeBoxes) -> ModeBoxes:
        """Return boxes and amplitudes made smaller with the stiffened matrix, where an inverse
        proves that.

        τ = τ₀ + YN δa − YK δ, |δ| ≤ radius, so that (I − NᵀD_v YN) δa = Nᵀv₀ − a₀ + NᵀX δ.
        """
        stiff = self.stiff
        strips = stiff.strips(box.places)
        M, products, scale = stiff.matrix(strips.D)
        Y, share = inverse_of(M, products, scale)
        a_0 = 0.5 * (box.a_low + box.a_high)
        radius_a = 0.5 * (box.a_high - box.a_low) * (1.0 + 4.0 * EPS) + 2.0 * EPS * np.abs(a_0)
        load = self.problems.load[0]
        middle = strips.p + strips.W * strips.middle[..., None]
        pull = self.sigma * (a_0 @ self.N.T)
        tau = _times(Y, load + pull - middle[..., 0] @ stiff.A - stiff.c * middle[..., 1])
        K = stiff.A * strips.W[:, None, :, 0]
        node = np.arange(self.m)
        K[:, node, node] += stiff.c * strips.W[..., 1]
        YK = Y @ K
        YN = self.sigma * (Y @ self.N)
        radius = strips.radius
        far = (np.abs(strips.middle) + radius)[..., None]
        largest = np.abs(strips.p) + np.abs(strips.D) + strips.W * far
        size_of_N = np.abs(self.N)
        largest_a = np.abs(a_0) + radius_a
        size_of_load = np.abs(load) + self.sigma * (largest_a @ size_of_N.T)
        with np.errstate(invalid="ignore", over="ignore"):
            noise = stiff.rounding(largest[..., 0], largest[..., 1], size_of_load)
            error = _times(np.abs(Y), noise)
            terms = np.abs(tau) + _times(np.abs(YK), radius) + _times(np.abs(YN), radius_a) + error
            error += share[:, None] * terms.max(axis=-1, keepdims=True)
        is_proved = np.isfinite(share) & np.isfinite(error).all(-1) & np.isfinite(tau).all(-1)
        is_proved &= np.isfinite(radius).all(-1)
        if not is_proved.any():
            return box
        if not is_proved.all():
            part = self._mode_step(box.take(is_proved))
            for column, values in zip(box, part, strict=True):
                column[is_proved] = values
            return box
        tau, error = tau / scale, error / scale
        YK, YN = YK / scale[..., None], YN / scale[..., None]

        # amplitudes
        D_v = strips.D[..., 0]
        X = -D_v[..., None] * YK
        X[:, node, node] += strips.W[..., 0]
        v = middle[..., 0] + D_v * tau
        S = np.eye(self.N.shape[1]) - self.N.T @ (D_v[..., None] * YN)
        g = v @ self.N - a_0
        of_v = np.abs(D_v) * error
        size_of_v = np.abs(v) + np.abs(middle[..., 0])
        size_of_v += np.abs(D_v) * _times(np.abs(YN), radius_a) + _times(np.abs(X), radius)
        of_v += 4.0 * (self.m + 8) * EPS * size_of_v
        small = of_v @ size_of_N + 8.0 * EPS * largest_a
        NX = self.N.T @ X
        room = _times(np.abs(NX), radius) * (1.0 + 8.0 * EPS) + small
        low, high = _narrowed(S, g, room, -radius_a, radius_a)
        try:
            Z: Array = np.asarray(np.linalg.inv(S), dtype=float)
        except np.linalg.LinAlgError:
            Z = np.zeros_like(S)
        if np.isfinite(Z).all() and Z.any():
            k = S.shape[-1]
            size_of_Z = np.abs(Z)
            sizes = np.abs(g) + _times(np.abs(S), radius_a)
            room = _times(np.abs(Z @ NX), radius) * (1.0 + 8.0 * EPS)
            rounding = 8.0 * (k + self.m + 4) * EPS
            room += _times(size_of_Z, small + rounding * (sizes + _times(np.abs(NX), radius)))
            low, high = _narrowed(Z @ S, _times(Z, g), room, low, high)
        is_alive = np.asarray((low <= high).all(-1))
        middle_a = np.where(is_alive[:, None], 0.5 * (low + high), 0.0)
        half_a = np.where(is_alive[:, None], 0.5 * (high - low), radius_a) * (1.0 + 8.0 * EPS)
        half_a += 4.0 * EPS * np.abs(middle_a)

        # places
        points = self.problems.points
        conditions = []
        for axis in (0, 1):
            d = strips.D[..., axis]
            X = -d[..., None] * YK
            X[:, node, node] += strips.W[..., axis]
            along = _times(YN, middle_a)
            centre = middle[..., axis] + d * (tau + along)
            reach = _times(np.abs(X), radius) * (1.0 + 8.0 * (self.m + 1) * EPS)
            reach += np.abs(d) * (_times(np.abs(YN), half_a) + error)
            size = np.abs(centre) + np.abs(middle[..., axis]) + np.abs(d) * np.abs(tau)
            size += np.abs(d) * _times(np.abs(YN), np.abs(middle_a) + half_a)
            reach += 8.0 * (S.shape[-1] + 4) * EPS * size
            is_known = np.isfinite(centre) & np.isfinite(reach)
            least = np.where(is_known, centre - reach, -np.inf)
            greatest = np.where(is_known, centre + reach, np.inf)
            conditions.append(Condition(points[..., axis], least, greatest))
        places = self.problems.clipped(box.places, conditions)
        room_a = 4.0 * EPS * largest_a
        a_low = np.maximum(box.a_low, a_0 + low - room_a)
        a_high = np.minimum(box.a_high, a_0 + high + room_a)
        return ModeBoxes(places.low, places.high, a_low, a_high)

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

    def _halves(self, box: ModeBoxes, root_width: float) -> list[ModeBoxes]:
        """Return boxes cut in the middle of their widest amplitude, or at their heaviest bend."""
        if not len(box.low):
            return []
        halves = list[ModeBoxes]()
        strips = self.problems.strips(box.places)
        for row in range(len(box.low)):
            one = box.take(slice(row, row + 1))
            width = (one.a_high - one.a_low)[0]
            if np.max(width, initial=0.0) > _NARROW * root_width:
                mode = int(np.argmax(width))
                below, above = one.a_high.copy(), one.a_low.copy()
                cut = 0.5 * (one.a_low[0, mode] + one.a_high[0, mode])
                below[0, mode] = above[0, mode] = cut
                halves.append(one._replace(a_low=above))
                halves.append(one._replace(a_high=below))
            else:
                node = int(np.argmax(strips.weight[row]))
                below, above = one.high.copy(), one.low.copy()
                below[0, node] = above[0, node] = strips.vertex[row, node]
                halves.append(one._replace(high=below))
                halves.append(one._replace(low=above))
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
            pull = sign * (load - problems.plus @ v) + problems.noise
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


def _times(M: Array, x: Array) -> Array:
    """Return the products (n, j) of matrices (n, j, k) and vectors (n, k)."""
    return np.asarray((M @ x[..., None])[..., 0])


def _stacked(parts: list[ModeBoxes]) -> ModeBoxes:
    """Return boxes one after the other, in arrays of their own."""
    return ModeBoxes._make(np.concatenate(columns) for columns in zip(*parts, strict=True))


def _narrowed(S: Array, g: Array, room: Array, low: Array, high: Array) -> tuple[Array, Array]:
    """Return bounds (n, k) of δ with |S δ − g| ≤ room, from bounds low to high.

    Boxes whose bounds cross are empty.
    """
    size_of_S = np.abs(S)
    for _ in range(_SWEEPS):
        middle = 0.5 * (low + high)
        half = 0.5 * np.abs(high - low)
        centre = _times(S, middle)
        reach = _times(size_of_S, half) + room
        terms = _times(size_of_S, np.abs(middle) + half) + np.abs(g)
        reach += 8.0 * (S.shape[-1] + 4) * EPS * terms
        with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
            others = (centre - g)[..., None] - S * middle[:, None, :]
            spread = reach[..., None] - size_of_S * half[:, None, :]
            best = -others / S
            width = spread / size_of_S
            margin = 8.0 * EPS * (np.abs(best) + width)
            least = np.where(np.isfinite(best) & np.isfinite(width), best - width - margin, -np.inf)
            most = np.where(np.isfinite(best) & np.isfinite(width), best + width + margin, np.inf)
        low = np.maximum(low, least.max(axis=1))
        high = np.minimum(high, most.min(axis=1))
    return low, high
