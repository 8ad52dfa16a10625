"""The search for all branches of one problem whose load varies, on fine meshes.

As the search for all solutions by soft modes (contact/soft_modes.py), with s as one more coordinate
of the boxes. It ends in parts of the graphs whose solutions, for all s, are on one curve.

Over s: where the inertia is the same for all slopes of a part there is one solution for every s
        (contact/curves.py, Unique).
Past folds: let that hold for Ĥ = C^−½(A + σNNᵀ)C^−½ + diag q with one soft mode N. Solutions have
        (A + σNNᵀ)v + Cζ = l̃ + s l̃₁ + βN and β = σNᵀv. Two of the same β differ by y, Δs with
        Ĥ C^½y = Δs C^−½l̃₁ and Nᵀy = 0, so that Δs NᵀĤ⁻¹l̃₁ = 0 (N, l̃₁ scaled). Where
        |NᵀĤ⁻¹l̃₁| ≥ κ > 0 for all slopes of the part there is one solution for every β: a curve
        over β, on which s may turn.
κ:      Ĥ(q)⁻¹ falls with q as long as the inertia stays (Loewner). With X± = Ĥ(q±)⁻¹ and
        Δ = X₋ − X₊ ≥ 0, NᵀĤ⁻¹l̃₁ is within ½ √(NᵀΔN · l̃₁ᵀΔl̃₁) of ½ Nᵀ(X₋ + X₊)l̃₁.
Errors: a point of the graph with residual r and G = β − σNᵀv has
        |Δs| ≤ (|G/σ| + ‖N‖‖r‖/g)/κ and ‖Δv‖ ≤ (‖r‖ + |Δs|‖l̃₁‖)/g, in the norms of C. Both are
        convex along an edge of a polygon, so that its vertices bound them.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from tcstudy.contact.boxes import EPS, Limits, PolygonProblems
from tcstudy.contact.curves import GraphPart, SlopeRange, SoftDirection, amplitudes
from tcstudy.contact.graph_walk import GraphWalk, LostWayError, SolutionCurve, along
from tcstudy.contact.soft_modes import ModeBoxes, ModeSearch

Array = NDArray[np.float64]
Index = NDArray[np.intp]
Flags = NDArray[np.bool_]


class BranchCells(NamedTuple):
    """Cells that may hold solutions for some s.

    sides: (n, m);  boxes: their number;  stopped: whether a limit ended the search
    """

    sides: Index
    boxes: int
    stopped: bool


def branch_cells(slabs: PolygonProblems, rows: list[int], limits: Limits) -> dict[int, BranchCells]:
    """Return the cells of some slabs of s, none if they have no soft modes.

    Neighbours are searched as one and have the same cells, and the limits of all of them.
    """
    cells = dict[int, BranchCells]()
    for neighbours in np.split(rows, np.flatnonzero(np.diff(rows) > 1) + 1):
        first, last = int(neighbours[0]), int(neighbours[-1])
        begin = slabs.load[first] - slabs.change[first]
        end = slabs.load[last] + slabs.change[last]
        load, change = 0.5 * (begin + end), 0.5 * (end - begin)
        search = BranchSearch(slabs.single(first).with_loads(load[None], change[None]))
        if search.has_modes:
            count = len(neighbours)
            found = search.cells(Limits(count * limits.boxes, count * limits.seconds))
            cells |= dict.fromkeys(neighbours.tolist(), found)
    return cells


class _Window(NamedTuple):
    """A box: ends (2, m) of v, and of s."""

    ends: Array
    s_low: float
    s_high: float


class BranchSearch(ModeSearch):
    """The search for all branches of one problem (`PolygonProblems.single`) with a load per s."""

    def __init__(self, problems: PolygonProblems) -> None:
        super().__init__(problems)
        self._scaled_change = self.change / self.parts.root_c

    def cells(self, limits: Limits) -> BranchCells:
        """Return all cells that may hold solutions, depth first, within limits."""
        cells = [np.zeros((0, self.m), dtype=np.intp)]

        def decided(box: ModeBoxes) -> Flags:
            part = self.parts.part_of(box.low, box.high)
            slopes = self.parts.slopes(part)
            inertia = self.parts.inertia(slopes)
            is_decided = (part.first == part.last).all(axis=-1)
            cells.append(part.first[is_decided])
            for row in np.flatnonzero(~is_decided & (inertia.lost <= 1)).tolist():
                one = SlopeRange(slopes.low[[row]], slopes.high[[row]], slopes.pinned[[row]])
                part_of_row = GraphPart(part.first[row], part.last[row])
                window = self._window(box.take(slice(row, row + 1)))
                gap = float(inertia.gap[row])
                on_curve = self._on_curve(part_of_row, one, gap, window)
                if on_curve is not None:
                    cells.append(on_curve)
                    is_decided[row] = True
            return is_decided

        boxes, stopped = self.split(decided, limits)
        return BranchCells(np.unique(np.concatenate(cells), axis=0), boxes, stopped)

    def _window(self, box: ModeBoxes) -> _Window:
        """Return the window of the only box."""
        places = box.places
        ends = [self.problems.points_at(places.problem, x)[0, :, 0] for x in places[1:]]
        return _Window(np.stack(ends), float(box.x_low[0, -1]), float(box.x_high[0, -1]))

    def _on_curve(
        self, part: GraphPart, slopes: SlopeRange, gap: float, window: _Window
    ) -> Index | None:
        """Return the cells (n, m) of the curve of a part, None if it is not proved to have one."""
        if gap > 0.0:
            return self._over_load(part, gap, window)
        soft = self.parts.soft_direction(slopes)
        if soft is None:
            return None
        kappa = self.kappa(slopes, soft)
        return self._past_folds(part, soft, kappa, window) if kappa > 0.0 else None

    def _over_load(self, part: GraphPart, gap: float, window: _Window) -> Index | None:
        """Return the cells of the curve over s of a part with one solution for every s."""
        columns = self.change[:, None]
        try:
            walk = self.parts.walk(part, self.problems.A, columns, np.array([window.s_low]))
            walk.go(along(0, window.s_high), record=True)
        except LostWayError:
            return None
        curve = walk.curve
        unsoftened = SoftDirection(np.zeros(self.m), 0.0, gap)
        error = self.parts.curve_errors(unsoftened, curve, columns).of_curve
        return self._cells_in(window, curve, curve.x[:, 0], error, 0.0)

    def _past_folds(
        self, part: GraphPart, soft: SoftDirection, kappa: float, window: _Window
    ) -> Index | None:
        """Return the cells of the curve over the amplitude of a mode."""
        N, sigma = soft.N, soft.sigma
        columns = np.column_stack([N, self.change])
        least, greatest = (sigma * bound for bound in amplitudes(N, window.ends))
        begin = np.array([least, 0.5 * (window.s_low + window.s_high)])

        def to_curve(walk: GraphWalk) -> tuple[Array, float]:
            missing = float(walk.x[0]) / sigma - float(N @ walk.v)
            way = missing / float(N @ walk.rates(1))
            if not np.isfinite(way):
                raise LostWayError
            return np.array([0.0, np.sign(way), 0.0]), abs(way)

        def along_curve(walk: GraphWalk) -> tuple[Array, float]:
            s_rate = (1.0 / sigma - float(N @ walk.rates(0))) / float(N @ walk.rates(1))
            if not np.isfinite(s_rate):
                raise LostWayError
            return np.array([1.0, s_rate, 0.0]), greatest - float(walk.x[0])

        try:
            walk = self.parts.walk(part, self.parts.A + sigma * np.outer(N, N), columns, begin)
            walk.go(to_curve)
            walk.go(along_curve, record=True)
        except LostWayError:
            return None
        curve = walk.curve
        root_c = self.parts.root_c
        residual = self.parts.curve_errors(soft, curve, columns).of_curve * soft.gap
        beta, s = curve.x.T
        sizes = np.abs(beta).max() / sigma + float(np.abs(N) @ np.abs(curve.v).max(axis=0))
        missing = np.abs(beta / sigma - curve.v @ N).max() + 4.0 * (self.m + 8) * EPS * sizes
        of_N = float(np.linalg.norm(N / root_c))
        error_s = (missing + of_N * residual / soft.gap) / kappa
        error = (residual + error_s * float(np.linalg.norm(self._scaled_change))) / soft.gap
        return self._cells_in(window, curve, s, error, error_s)

    def kappa(self, slopes: SlopeRange, soft: SoftDirection) -> float:
        """Return κ of one part, not positive without a proof."""
        n = soft.N / self.parts.root_c
        forms = []
        room = np.zeros((2, 2))
        for q in (slopes.low, slopes.high):
            H, is_free, _ = self.parts.hessians(q, slopes.pinned)
            vectors = np.stack([n, self._scaled_change], axis=1) * is_free[0][:, None]
            H_soft = H[0] + soft.sigma * np.outer(vectors[:, 0], vectors[:, 0])
            try:
                solution = np.linalg.solve(H_soft, vectors)
            except np.linalg.LinAlgError:
                return 0.0
            residual = np.abs(vectors - H_soft @ solution)
            sizes = np.abs(H_soft) @ np.abs(solution) + np.abs(vectors)
            residual += 4.0 * (self.m + 8) * EPS * sizes
            sizes_of_residuals = np.linalg.norm(residual, axis=0)
            scale = np.linalg.norm(vectors, axis=0)
            forms.append(vectors.T @ solution)
            errors = np.outer(scale, sizes_of_residuals) / soft.gap
            rounding = 4.0 * (self.m + 8) * EPS * np.outer(scale, np.linalg.norm(solution, axis=0))
            room = np.maximum(room, errors + rounding)
        of_low, of_high = forms
        change = np.maximum(of_low - of_high, 0.0) + 2.0 * room
        half = 0.5 * float(np.sqrt(change[0, 0] * change[1, 1]))
        middle = 0.5 * abs(float(of_low[0, 1] + of_high[0, 1]))
        return middle - half * (1.0 + 8.0 * EPS) - float(np.max(room))

    def _cells_in(
        self, window: _Window, curve: SolutionCurve, s: Array, error: float, error_s: float
    ) -> Index | None:
        """Return the cells of a curve in a box, None where its errors are too large."""
        if not error <= self.parts.max_error:
            return None
        error_v = error / self.parts.root_c + 8.0 * EPS * np.abs(curve.v).max(axis=0)
        begin, end = curve.v[:-1], curve.v[1:]
        is_inside = (np.maximum(begin, end) >= window.ends[0] - error_v).all(axis=-1)
        is_inside &= (np.minimum(begin, end) <= window.ends[1] + error_v).all(axis=-1)
        room = error_s + 8.0 * EPS * (abs(window.s_low) + abs(window.s_high))
        is_inside &= np.maximum(s[:-1], s[1:]) >= window.s_low - room
        is_inside &= np.minimum(s[:-1], s[1:]) <= window.s_high + room
        return curve.sides[is_inside]
