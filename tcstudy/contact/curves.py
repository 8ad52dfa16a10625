"""Parts of polygons that hold at most one solution, or solutions on one curve, by inertia.

Problem:  Av + Cζ = l with (v_i, ζ_i) on sides first_i…last_i of the polygon of node i, whose first
          and last side go on straight without end (the extended part)
Slopes:   q⁻_i, q⁺_i, least and greatest slope of these sides; −∞ down a jump, ∞ up one. A node with
          upright sides alone is pinned: its row and column are struck out.
Scaled:   H(q) = C^−½ A C^−½ + diag q on the nodes where q is finite; ‖e‖_C² = Σ c_i e_i²

Lemma 1:  two points of an extended part with v ≠ v′ have ζ − ζ′ = q (v − v′), q⁻ ≤ q ≤ q⁺, as
          slopes are averaged, jumps up add and jumps down take away.
Lemma 2:  let e be the number of nodes with q⁻ = −∞ that are not pinned, and, for some ν ≥ e,
          g > 0 no larger than the eigenvalue ν + 1 − e of H(q⁻) and than minus the eigenvalue ν of
          H(q⁺), by size. Then no eigenvalue of H(q), q⁻ ≤ q ≤ q⁺ finite, is within g of 0:
          H(q) ≤ H(q⁺) where q⁺ is finite, H(q) ≥ H(q⁻) where q⁻ is, and by Cauchy a matrix with
          rows and columns struck out has eigenvalues ν no lower, ν + 1 − e no higher.
Unique:   then the extended part has one solution. A point (v̂, ζ̂) of it with the residual r has
          ‖v − v̂‖_C ≤ ‖C^−½r‖/g. Where v_i ≠ v̂_i take q_i of Lemma 1; where v_i = v̂_i without an
          upright side ζ_i = ζ̂_i and any q_i will do; on other nodes let q_i go to ±∞, so that rows
          drop out and the bound stays. Existence: (v, ζ) ↦ Av + Cζ is continuous, injective and
          proper on extended parts, which are an R^m (invariance of domain).
Stable:   a strict minimum if ν = 0, and not if ν > 0
Curve:    let that hold for A + σNNᵀ. v is a solution if and only if (A + σNNᵀ)v + Cζ = l + βN with
          β = σNᵀv. For every β there is one v(β): all solutions are on this curve, at zeros of
          G(β) = β − σNᵀv(β). Along a polygon of points of the graph residuals are between those of
          its vertices, so that with e the largest bound of these ‖v(β) − v̂(β)‖_C ≤ e and
          |G − Ĝ| ≤ |σ| ‖C^−½N‖ e for all β. How the polygon was found needs no proof.
Zeros:    an interval of β with |Ĝ| within its error is decided by "unique" on the sides T that its
          points touch. Where T has no such proof branches meet on kinks: loads as near as one
          likes have no solution there and two, or one and three.
Tie:      a solution on kinks is on 2^t cells, none of which can be decided. T, the sides touched of
          all nodes, is one part, for which "unique" can.
Sources:  J. Katzenelson, Bell Syst. Tech. J. 44 (1965) 1605–1620 (the walk); S. M. Robinson, Math.
          Oper. Res. 17 (1992) 691–714 (normal maps)
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from tcstudy.contact.boxes import EPS, PolygonProblems
from tcstudy.contact.graph_walk import (
    GraphWalk,
    LostWayError,
    Sides,
    SolutionCurve,
    along,
)

Array = NDArray[np.float64]
Index = NDArray[np.intp]
Flags = NDArray[np.bool_]

_EIGEN_ROUNDINGS = 64.0
"""Roundings of its norm, for each row of a matrix, by which computed eigenvalues may be wrong."""
_MAX_STEPS = 40
"""Most steps of Newton's method before the walk from a point of the graph replaces it."""
_MAX_CURVE_ERROR = 1e-4
"""Largest error of a curve, relative to the shortest side of every node."""
_SIGMA = (1.0, 0.3, 0.1, 3.0)
"""Sizes of σ that are tried, beyond what lifts the eigenvalue to 0."""
_MAX_GROWTHS = 3
"""How often the sides that a solution may touch are gathered again."""


class GraphPart(NamedTuple):
    """Sides first to last (m,) of the polygons, whose ends go on without end."""

    first: Index
    last: Index

    def has(self, sides: Index) -> bool:
        """Return whether a cell (m,) is in the part."""
        return bool(np.all((self.first <= sides) & (sides <= self.last)))

    def holds(self, other: GraphPart) -> bool:
        """Return whether another part is in this one."""
        return self.has(other.first) and self.has(other.last)

    def meets(self, other: GraphPart) -> bool:
        """Return whether two parts share sides of every node; an empty one shares none."""
        return not self.shared(other).is_empty

    @property
    def alone(self) -> GraphPart:
        """The part as the only one of several."""
        return GraphPart(self.first[None], self.last[None])

    @property
    def is_empty(self) -> bool:
        return bool(np.any(self.first > self.last))

    def shared(self, other: GraphPart) -> GraphPart:
        """Return the sides that are in both parts."""
        first = np.maximum(self.first, other.first)
        return GraphPart(first, np.minimum(self.last, other.last))

    def joined(self, other: GraphPart) -> GraphPart:
        """Return the least part with both."""
        return GraphPart(np.minimum(self.first, other.first), np.maximum(self.last, other.last))


class SlopeRange(NamedTuple):
    """Least and greatest slopes of n parts, and which nodes are pinned, all (n, m)."""

    low: Array
    high: Array
    pinned: Flags


class Inertia(NamedTuple):
    """g of Lemma 2, not positive without a proof, ν, and how much lower it is at q⁺, all (n,)."""

    gap: Array
    negative: Index
    lost: Index


class Found(NamedTuple):
    """The one solution in a part.

    sides:  (m,) the cell where it was computed
    v:      (m,) displacements, and their error (m,) [m]
    stable: whether it is a strict minimum
    """

    part: GraphPart
    sides: Index
    v: Array
    error: Array
    stable: bool

    def may_be(self, other: Found) -> bool:
        """Return whether the other one may be the same solution."""
        distance = np.abs(self.v - other.v)
        is_near = not np.any(distance > self.error + other.error)
        return is_near and self.part.meets(other.part)


class Decision(NamedTuple):
    """The solutions in a part, and the parts that are undecided."""

    solutions: list[Found]
    undecided: list[GraphPart]


NONE = Decision([], [])


class Hull(NamedTuple):
    """Least and greatest v and ζ (m,)."""

    v_low: Array
    v_high: Array
    zeta_low: Array
    zeta_high: Array

    def wider(self, error_v: Array, error_zeta: Array) -> Hull:
        """Return the hull of points as far from these as errors (m,)."""
        v_low, v_high = self.v_low - error_v, self.v_high + error_v
        return Hull(v_low, v_high, self.zeta_low - error_zeta, self.zeta_high + error_zeta)

    def joined(self, other: Hull) -> Hull:
        """Return the hull of both."""
        v_low, v_high = np.minimum(self.v_low, other.v_low), np.maximum(self.v_high, other.v_high)
        zeta_low = np.minimum(self.zeta_low, other.zeta_low)
        return Hull(v_low, v_high, zeta_low, np.maximum(self.zeta_high, other.zeta_high))


class _Point(NamedTuple):
    """A point of the graph near the solution of an extended part, with errors, all (m,)."""

    sides: Index
    v: Array
    zeta: Array
    error_v: Array
    error_zeta: Array

    @property
    def hull(self) -> Hull:
        """Where the solution may be."""
        point = Hull(self.v, self.v, self.zeta, self.zeta)
        return point.wider(self.error_v, self.error_zeta)


class SoftDirection(NamedTuple):
    """N (m,), σ and g with which the solutions of a part are on one curve."""

    N: Array
    sigma: float
    gap: float


class Parts:
    """The parts of the polygons of one problem.

    problems: with one load and one kind of polygons (`PolygonProblems.single`)
    """

    def __init__(self, problems: PolygonProblems) -> None:
        self.problems = problems
        self.A, self.c = problems.A, problems.c
        self.m = problems.m
        self.load = problems.load[0]
        self.points = problems.points[0]
        self.side_counts = np.broadcast_to(problems.side_counts[0], (self.m,))
        self.node = np.arange(self.m)
        chords = np.diff(self.points, axis=1)
        self.run, self.rise = chords[..., 0], chords[..., 1]
        jump = np.where(self.rise > 0.0, np.inf, -np.inf)
        with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
            self.slope = np.where(self.run > 0.0, self.rise / self.run, jump)
        size = np.abs(self.run) * problems.diagonal[:, None] + np.abs(self.rise) * self.c[:, None]
        self.length = np.where(size > 0.0, size, 1.0)
        self.sides = Sides(self.points, self.run, self.rise, self.length)
        self.root_c = np.sqrt(self.c)
        self.scaled_A = self.A / self.root_c[:, None] / self.root_c
        self.norm_of_A = float(np.abs(self.scaled_A).sum(axis=1).max())
        side = np.arange(self.run.shape[1])
        self._is_inner = (side > 0) & (side < self.side_counts[:, None] - 1)
        shortest = np.where(self._is_inner & (self.run > 0.0), self.run, np.inf).min(axis=1)
        self.max_error = _MAX_CURVE_ERROR * float(np.min(shortest * self.root_c))

    def part_of(self, low: Array, high: Array) -> GraphPart:
        """Return the sides in boxes from places low to high (…, m)."""
        slack = 0.5 * self.problems.slack
        final = self.side_counts - 1
        first = np.minimum(np.floor(low + slack).astype(np.intp), final)
        last = np.clip(np.ceil(high - slack).astype(np.intp) - 1, first, final)
        return GraphPart(first, last)

    def slopes(self, part: GraphPart) -> SlopeRange:
        """Return the slopes of n parts, first and last (n, m)."""
        low = np.full(part.first.shape, np.inf)
        high = np.full(part.first.shape, -np.inf)
        for side in range(self.slope.shape[1]):
            is_inside = (part.first <= side) & (side <= part.last)
            slope = self.slope[:, side]
            low = np.where(is_inside, np.minimum(low, slope), low)
            high = np.where(is_inside, np.maximum(high, slope), high)
        return SlopeRange(low, high, np.isposinf(low) | np.isneginf(high))

    def hessians(self, q: Array, pinned: Flags) -> tuple[Array, Flags, Array]:
        """Return H(q) (n, m, m), the nodes that are left (n, m), and norms (n,).

        Nodes that are struck out have a row of the identity, by twice the norm.
        """
        is_free = np.isfinite(q) & ~pinned
        finite = np.where(is_free, q, 0.0)
        norm = self.norm_of_A + np.abs(finite).max(axis=-1)
        H = self.scaled_A * (is_free[:, :, None] & is_free[:, None, :])
        H[:, self.node, self.node] += np.where(is_free, finite, 2.0 * norm[:, None])
        return H, is_free, norm

    def inertia(self, slopes: SlopeRange, soft: SoftDirection | None = None) -> Inertia:
        """Return g and ν of n parts, for A + σNNᵀ with a soft direction."""
        eigenvalues = []
        margins = []
        for q in (slopes.low, slopes.high):
            H, is_free, norm = self.hessians(q, slopes.pinned)
            if soft is not None:
                n = np.where(is_free, soft.N / self.root_c, 0.0)
                H += soft.sigma * n[:, :, None] * n[:, None, :]
                norm = norm + abs(soft.sigma) * float(np.sum((soft.N / self.root_c) ** 2))
            eigenvalues.append(np.linalg.eigvalsh(H))
            margins.append(_EIGEN_ROUNDINGS * self.m * EPS * norm)
        of_low, of_high = eigenvalues
        row = np.arange(len(of_low))
        jumps_down = np.count_nonzero(np.isneginf(slopes.low) & ~slopes.pinned, axis=-1)
        negative = np.count_nonzero(of_low < 0.0, axis=-1)
        next_low = of_low[row, np.minimum(negative, self.m - 1)]
        above = np.where(negative < self.m, next_low - margins[0], np.inf)
        count = negative + jumps_down
        last_high = of_high[row, np.maximum(count - 1, 0)]
        below = np.where(count > 0, -last_high - margins[1], np.inf)
        lost = count - np.count_nonzero(of_high < 0.0, axis=-1)
        return Inertia(np.minimum(above, below), count, lost)

    def soft_direction(self, slopes: SlopeRange) -> SoftDirection | None:
        """Return what makes one curve of the solutions of one part, None if nothing does.

        slopes: of one part (1, m), whose inertia changes by one
        """
        if np.any(np.isneginf(slopes.low) & ~slopes.pinned):
            return None
        H, is_free, _ = self.hessians(slopes.low, slopes.pinned)
        eigenvalues, vectors = np.linalg.eigh(H[0])
        negative = int(np.count_nonzero(eigenvalues < 0.0))
        if not negative:
            return None
        last = -float(eigenvalues[negative - 1])
        following = float(eigenvalues[negative]) if negative < self.m else 0.0
        N = np.where(is_free[0], vectors[:, negative - 1], 0.0) * self.root_c
        for share in _SIGMA:
            soft = SoftDirection(N, last + share * max(last, following), 0.0)
            gap = float(self.inertia(slopes, soft).gap[0])
            if gap > 0.0:
                return soft._replace(gap=gap)
        return None

    # -- at most one solution ----------------------------------------------------------------------

    def gap_of(self, part: GraphPart) -> float:
        """Return g of one part, not positive where it may have several solutions."""
        return float(self.inertia(self.slopes(part.alone)).gap[0])

    def decide(self, part: GraphPart, gap: float) -> Decision:
        """Return the solution of a part with at most one, g > 0; none, or the part that is not
        decided."""
        point = self._solution(part, gap)
        if point is None:
            return Decision([], [part])
        touched = self._met(point.hull)
        if not touched.meets(part):
            return NONE
        for _ in range(_MAX_GROWTHS):
            slopes = self.slopes(touched.alone)
            inertia = self.inertia(slopes)
            own_gap = float(inertia.gap[0])
            own = self._solution(touched, own_gap) if own_gap > 0.0 else None
            if own is None:
                return Decision([], [touched])
            again = self._met(own.hull)
            if not again.meets(touched):
                return NONE
            larger = touched.joined(again)
            if touched.holds(larger):
                if not self._is_inside(own, touched):
                    break
                is_on_down_jump = bool(np.any(np.isneginf(slopes.high)))
                stable = bool(inertia.negative[0] == 0) and not is_on_down_jump
                return Decision([Found(touched, own.sides, own.v, own.error_v, stable)], [])
            touched = larger
        return Decision([], [touched])

    def _solution(self, part: GraphPart, gap: float) -> _Point | None:
        """Return a point of the graph near the solution of an extended part."""
        sides = self._newton(part)
        if sides is None:
            try:
                sides = self.walk(part, self.A, np.zeros((self.m, 0)), np.zeros(0)).sides
            except LostWayError:
                return None
        shares = self._shares_of(sides)
        if shares is None:
            return None
        low = np.where(sides == part.first, -np.inf, 0.0)
        high = np.where(sides == part.last, np.inf, 1.0)
        shares = np.clip(shares, low, high)
        return self._with_errors(sides, shares, gap)

    def _with_errors(self, sides: Index, shares: Array, gap: float) -> _Point:
        """Return a point of the graph with how far the solution may be, in v and ζ."""
        v, zeta, residual = self._balance(sides, shares)
        sizes = np.abs(v), np.abs(zeta), np.abs(self.load)
        residual = np.abs(residual) + self.problems.rounding(*sizes)
        error_v = np.sqrt(np.sum(residual**2 / self.c)) / gap / self.root_c
        error_v += 8.0 * EPS * np.abs(v)
        error_zeta = (residual + self.problems.size_of_A @ error_v) / self.c
        error_zeta += 8.0 * EPS * np.abs(zeta)
        return _Point(sides, v, zeta, error_v, error_zeta)

    def _balance(self, sides: Index, shares: Array) -> tuple[Array, Array, Array]:
        """Return v, ζ at shares of sides, and the residual l − Av − Cζ."""
        start = self.points[self.node, sides]
        v = start[:, 0] + shares * self.run[self.node, sides]
        zeta = start[:, 1] + shares * self.rise[self.node, sides]
        return v, zeta, self.load - self.A @ v - self.c * zeta

    def _newton(self, part: GraphPart) -> Index | None:
        """Return the cell of an extended part in which steps of Newton's method end."""
        sides = (part.first + part.last) // 2
        for _ in range(_MAX_STEPS):
            shares = self._shares_of(sides)
            if shares is None:
                return None
            rises = (shares > 1.0) & (sides < part.last)
            falls = (shares < 0.0) & (sides > part.first)
            if not np.any(rises | falls):
                return sides
            sides = sides + rises - falls
        return None

    def _shares_of(self, sides: Index) -> Array | None:
        """Return the shares (m,) of sides at which the balance holds."""
        start = self.points[self.node, sides]
        M = self.A * self.run[self.node, sides]
        M[self.node, self.node] += self.c * self.rise[self.node, sides]
        try:
            shares = np.linalg.solve(M, self.load - self.A @ start[:, 0] - self.c * start[:, 1])
        except np.linalg.LinAlgError:
            return None
        return shares if np.isfinite(shares).all() else None

    def _met(self, hull: Hull) -> GraphPart:
        """Return the first and last sides that meet rectangles, empty if none does."""
        ends_v, ends_zeta = self.points[..., 0], self.points[..., 1]
        is_side = np.arange(self.run.shape[1]) < self.side_counts[:, None]
        meets = is_side & _overlap(ends_v, hull.v_low, hull.v_high)
        meets &= _overlap(ends_zeta, hull.zeta_low, hull.zeta_high)
        meets &= self._on_line(hull)
        side = np.arange(self.run.shape[1])
        first = np.where(meets, side, len(side)).min(axis=1)
        last = np.where(meets, side, -1).max(axis=1)
        return GraphPart(first, last)

    def _on_line(self, hull: Hull) -> Flags:
        """Return (m, S) whether rectangles meet the lines on which the sides are."""
        start = self.points[:, :-1]
        to_v, half_v = _from(start[..., 0], hull.v_low, hull.v_high)
        to_zeta, half_zeta = _from(start[..., 1], hull.zeta_low, hull.zeta_high)
        reach = np.abs(self.rise) * half_v + np.abs(self.run) * half_zeta
        return np.asarray(np.abs(to_v * self.rise - to_zeta * self.run) <= reach)

    def _is_inside(self, point: _Point, part: GraphPart) -> bool:
        """Return whether the solution of an extended part is not on what goes on beyond its ends.

        The ends of a polygon are as far as no solution is.
        """
        ends = ((part.first, 0, -1.0), (part.last, 1, 1.0))
        finals = (part.first == 0, part.last == self.side_counts - 1)
        for (side, at, outward), is_final in zip(ends, finals, strict=True):
            end = self.points[self.node, side + at]
            run, rise = self.run[self.node, side], self.rise[self.node, side]
            room_v = outward * (end[:, 0] - point.v)
            room_zeta = outward * np.sign(rise) * (end[:, 1] - point.zeta)
            is_clear = (run > 0.0) & (room_v > point.error_v)
            is_clear |= (rise != 0.0) & (room_zeta > point.error_zeta)
            if not np.all(is_clear | is_final):
                return False
        return True

    # -- one curve ---------------------------------------------------------------------------------

    def on_curve(self, part: GraphPart, ends: Array, soft: SoftDirection) -> Decision | None:
        """Return the solutions of a part on its curve, None where its errors are too large.

        ends: (2, m) least and greatest v of the box
        """
        N, sigma = soft.N, soft.sigma
        A = self.A + sigma * np.outer(N, N)
        least, greatest = amplitudes(N, ends)
        try:
            walk = self.walk(part, A, N[:, None], np.array([sigma * least]))
            walk.go(along(0, sigma * greatest), record=True)
        except LostWayError:
            return None
        curve = walk.curve
        errors = self.curve_errors(soft, curve, N[:, None])
        if not errors.of_curve <= self.max_error:
            return None
        beta = curve.x[:, 0]
        G = beta - sigma * (curve.v @ N)
        error_G = sigma * errors.of_curve * float(np.linalg.norm(N / self.root_c))
        sizes = np.abs(beta).max() + sigma * float(np.abs(N) @ np.abs(curve.v).max(axis=0))
        error_G += 4.0 * (self.m + 8) * EPS * sizes
        solutions = list[Found]()
        undecided = list[GraphPart]()
        for hull in _crossings(curve, G, error_G):
            touched = self._touched_by(hull, errors, ends).shared(part)
            if touched.is_empty:
                continue
            gap = self.gap_of(touched)
            if gap > 0.0:
                decision = self.decide(touched, gap)
                solutions += decision.solutions
                undecided += decision.undecided
            elif np.all(touched.last - touched.first <= 1):
                undecided.append(touched)
            else:
                return None
        return Decision(solutions, undecided)

    def walk(self, part: GraphPart, A: Array, columns: Array, x: Array) -> GraphWalk:
        """Return a walk in a part that begins with the load l + columns x.

        All cells of the part are regular with A, and alike. Raises LostWayError.
        """
        ends = (part.first, part.last)
        return GraphWalk(self.sides, A, self.c, ends, self.load, columns, x)

    def curve_errors(
        self, soft: SoftDirection, curve: SolutionCurve, columns: Array
    ) -> CurveErrors:
        """Return how far a curve may be from the solutions of (A + σNNᵀ)v + Cζ = l + columns x."""
        v, zeta = curve.v, curve.zeta
        largest_v, largest_zeta = np.abs(v).max(axis=0), np.abs(zeta).max(axis=0)
        size_of_N, sigma = np.abs(soft.N), abs(soft.sigma)
        pull = sigma * float(size_of_N @ largest_v)
        load = np.abs(self.load) + np.abs(columns) @ np.abs(curve.x).max(axis=0) + pull * size_of_N
        A = self.A + soft.sigma * np.outer(soft.N, soft.N)
        residual = np.abs(self.load + curve.x @ columns.T - v @ A - self.c * zeta).max(axis=0)
        residual += self.problems.rounding(largest_v, largest_zeta, load)
        error = float(np.sqrt(np.sum(residual**2 / self.c))) / soft.gap
        error_v = error / self.root_c + 8.0 * EPS * largest_v
        error_zeta = (residual + np.abs(A) @ error_v) / self.c + 8.0 * EPS * largest_zeta
        return CurveErrors(error, error_v, error_zeta)

    def _touched_by(self, hull: Hull, errors: CurveErrors, ends: Array) -> GraphPart:
        """Return the sides that solutions near a piece of curve touch, none outside the box."""
        wide = hull.wider(errors.of_v, errors.of_zeta)
        if np.any(wide.v_high < ends[0]) or np.any(wide.v_low > ends[1]):
            return GraphPart(np.ones(self.m, dtype=np.intp), np.zeros(self.m, dtype=np.intp))
        return self._met(wide)


class CurveErrors(NamedTuple):
    """Errors of all points of a curve: in the norm of C, of v and of ζ (m,)."""

    of_curve: float
    of_v: Array
    of_zeta: Array


def _overlap(ends: Array, low: Array, high: Array) -> Flags:
    """Return (m, S) whether sides between ends (m, S + 1) meet intervals (m,)."""
    least = np.minimum(ends[:, :-1], ends[:, 1:])
    greatest = np.maximum(ends[:, :-1], ends[:, 1:])
    return np.asarray((least <= high[:, None]) & (greatest >= low[:, None]))


def _from(start: Array, low: Array, high: Array) -> tuple[Array, Array]:
    """Return the ways (m, S) from where sides start to the middle of intervals (m,), and half their
    lengths, widened by what rounding may do."""
    size = np.maximum(np.abs(low), np.abs(high))[:, None] + np.abs(start)
    half = 0.5 * (high - low)[:, None] + 8.0 * EPS * size
    return 0.5 * (low + high)[:, None] - start, half


def amplitudes(N: Array, ends: Array) -> tuple[float, float]:
    """Return a little less and more than Nᵀv is in a box with v from ends[0] to ends[1]."""
    terms = N * ends
    room = 1e-9 * float(np.abs(terms).sum())
    return float(terms.min(axis=0).sum()) - room, float(terms.max(axis=0).sum()) + room


def _crossings(curve: SolutionCurve, G: Array, error: float) -> list[Hull]:
    """Return the hulls of the pieces of curve with |G| ≤ error."""
    is_near = np.minimum(G[:-1], G[1:]) <= error
    is_near &= np.maximum(G[:-1], G[1:]) >= -error
    hulls = list[Hull]()
    last_end = (-1, 1.0)
    for edge in np.flatnonzero(is_near).tolist():
        begin, end = _shares(float(G[edge]), float(G[edge + 1]), error)
        hull = _hull(curve, edge, begin, end)
        if hulls and last_end == (edge - 1, 1.0) and begin == 0.0:
            hull = hulls.pop().joined(hull)
        hulls.append(hull)
        last_end = (edge, end)
    return hulls


def _shares(G_begin: float, G_end: float, error: float) -> tuple[float, float]:
    """Return from which share of an edge to which |G| ≤ error."""
    change = G_end - G_begin
    if change == 0.0:
        return 0.0, 1.0
    to_low, to_high = (-error - G_begin) / change, (error - G_begin) / change
    room = 1e-12 * (abs(to_low) + abs(to_high))
    return max(0.0, min(to_low, to_high) - room), min(1.0, max(to_low, to_high) + room)


def _hull(curve: SolutionCurve, edge: int, begin: float, end: float) -> Hull:
    """Return the hull of an edge of a curve between two shares of it."""
    bounds = list[Array]()
    for vertices in (curve.v, curve.zeta):
        chord = vertices[edge + 1] - vertices[edge]
        points = np.stack([vertices[edge] + share * chord for share in (begin, end)])
        room = 4.0 * EPS * np.abs(points).max(axis=0)
        bounds += [points.min(axis=0) - room, points.max(axis=0) + room]
    return Hull(*bounds)


def distinct_solutions(parts: Parts, solutions: list[Found]) -> tuple[list[Found], list[GraphPart]]:
    """Return solutions without those that are listed before, and parts where that is not sure.

    Each is inside its part. One that is in two parts is on a side of each that is in both.
    """
    distinct = list[Found]()
    doubtful = list[GraphPart]()
    for solution in solutions:
        known = next((one for one in distinct if one.may_be(solution)), None)
        if known is None:
            distinct.append(solution)
            continue
        is_same = known.part.holds(solution.part) or solution.part.holds(known.part)
        union = known.part.joined(solution.part)
        if not is_same and not parts.gap_of(union) > 0.0:
            doubtful.append(union)
    return distinct, doubtful


def distinct_parts(undecided: list[GraphPart], solutions: list[Found]) -> list[GraphPart]:
    """Return parts that may hold more than the solutions, those that meet as one."""
    distinct = list[GraphPart]()
    for part in undecided:
        if any(known.part.holds(part) for known in solutions):
            continue
        union = part
        apart = list[GraphPart]()
        for other in distinct:
            if other.meets(union):
                union = union.joined(other)
            else:
                apart.append(other)
        distinct = [*apart, union]
    return distinct


def ties(parts: Parts, cells: Index, known: list[Found]) -> tuple[list[Found], list[GraphPart]]:
    """Return the known solutions and those of undecided cells (n, m), and what is left undecided.

    A solution on kinks is on all cells beside it.
    """
    solutions = list(known)
    undecided = list[GraphPart]()
    for cell in cells:
        if any(solution.part.has(cell) for solution in solutions):
            continue
        part = GraphPart(cell, cell)
        gap = parts.gap_of(part)
        decision = parts.decide(part, gap) if gap > 0.0 else Decision([], [part])
        solutions += decision.solutions
        undecided += decision.undecided
    distinct, doubtful = distinct_solutions(parts, solutions)
    return distinct, distinct_parts([*undecided, *doubtful], distinct)
