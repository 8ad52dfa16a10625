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

Array = NDArray[np.float64]
Index = NDArray[np.intp]
Flags = NDArray[np.bool_]

_EIGEN_ROUNDINGS = 64.0
"""Roundings of its norm, for each row of a matrix, by which computed eigenvalues may be wrong."""
_MAX_STEPS = 40
"""Most steps of Newton's method before the walk from a point of the graph replaces it."""
_MAX_PIVOTS = 6000
"""Most changes of side along a curve."""
_REFRESH = 25
"""Changes of side after which the inverse is made anew."""
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
        first = np.maximum(self.first, other.first)
        last = np.minimum(self.last, other.last)
        return bool(np.all(first <= last))

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


class Decision(NamedTuple):
    """The solutions in a part, and the parts that are undecided."""

    solutions: list[Found]
    undecided: list[GraphPart]


NONE = Decision([], [])


class SolutionCurve(NamedTuple):
    """Vertices of a curve: β (T,), v and ζ (T, m), and the sides between them (T − 1, m)."""

    beta: Array
    v: Array
    zeta: Array
    sides: Index


class _Point(NamedTuple):
    """A point of the graph near the solution of an extended part, with errors, all (m,)."""

    sides: Index
    v: Array
    zeta: Array
    error_v: Array
    error_zeta: Array


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

    def _hessians(self, q: Array, pinned: Flags) -> tuple[Array, Flags, Array]:
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
            H, is_free, norm = self._hessians(q, slopes.pinned)
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
        H, is_free, _ = self._hessians(slopes.low, slopes.pinned)
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

    def decide(self, part: GraphPart, gap: float) -> Decision:
        """Return the solution of a part with at most one, g > 0; none, or the part that is not
        decided."""
        point = self._solution(part, gap)
        if point is None:
            return Decision([], [part])
        touched = self._touched(point)
        if not touched.meets(part):
            return NONE
        for _ in range(_MAX_GROWTHS):
            slopes = self.slopes(GraphPart(touched.first[None], touched.last[None]))
            inertia = self.inertia(slopes)
            own_gap = float(inertia.gap[0])
            own = self._solution(touched, own_gap) if own_gap > 0.0 else None
            if own is None:
                return Decision([], [touched])
            again = self._touched(own)
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
            curve = self.walk(self.A, part, np.zeros(self.m), (0.0, 0.0))
            if curve is None:
                return None
            sides = curve.sides[-1]
        tau = self._shares(self.A, sides, self.load)
        if tau is None:
            return None
        is_first, is_last = sides == part.first, sides == part.last
        low = np.where(is_first, -np.inf, 0.0)
        high = np.where(is_last, np.inf, 1.0)
        tau = np.clip(tau, low, high)
        v = self.points[self.node, sides, 0] + tau * self.run[self.node, sides]
        zeta = self.points[self.node, sides, 1] + tau * self.rise[self.node, sides]
        return self._with_errors(_Point(sides, v, zeta, v, v), gap)

    def _with_errors(self, point: _Point, gap: float) -> _Point:
        """Return a point with how far the solution may be, in v and ζ."""
        residual = np.abs(self.load - self.A @ point.v - self.c * point.zeta)
        sizes = np.abs(point.v), np.abs(point.zeta), np.abs(self.load)
        residual += self.problems.rounding(*sizes)
        error_v = np.sqrt(np.sum(residual**2 / self.c)) / gap / self.root_c
        error_v += 8.0 * EPS * np.abs(point.v)
        error_zeta = (residual + self.problems.size_of_A @ error_v) / self.c
        error_zeta += 8.0 * EPS * np.abs(point.zeta)
        return point._replace(error_v=error_v, error_zeta=error_zeta)

    def _newton(self, part: GraphPart) -> Index | None:
        """Return the cell of an extended part in which steps of Newton's method end."""
        sides = (part.first + part.last) // 2
        for _ in range(_MAX_STEPS):
            tau = self._shares(self.A, sides, self.load)
            if tau is None:
                return None
            rises = (tau > 1.0) & (sides < part.last)
            falls = (tau < 0.0) & (sides > part.first)
            if not np.any(rises | falls):
                return sides
            sides = sides + rises - falls
        return None

    def _shares(self, A: Array, sides: Index, load: Array) -> Array | None:
        """Return the shares (m,) of sides at which the balance holds."""
        start = self.points[self.node, sides]
        M = A * self.run[self.node, sides]
        M[self.node, self.node] += self.c * self.rise[self.node, sides]
        try:
            tau = np.linalg.solve(M, load - A @ start[:, 0] - self.c * start[:, 1])
        except np.linalg.LinAlgError:
            return None
        return tau if np.isfinite(tau).all() else None

    def _touched(self, point: _Point) -> GraphPart:
        """Return the sides that the solution may be on."""
        return self._met(
            point.v - point.error_v,
            point.v + point.error_v,
            point.zeta - point.error_zeta,
            point.zeta + point.error_zeta,
        )

    def _met(self, v_low: Array, v_high: Array, zeta_low: Array, zeta_high: Array) -> GraphPart:
        """Return the first and last sides that meet rectangles (m,), empty if none does."""
        v, zeta = self.points[..., 0], self.points[..., 1]
        side = np.arange(self.run.shape[1])
        meets = (v[:, :-1] <= v_high[:, None]) & (v[:, 1:] >= v_low[:, None])
        meets &= np.minimum(zeta[:, :-1], zeta[:, 1:]) <= zeta_high[:, None]
        meets &= np.maximum(zeta[:, :-1], zeta[:, 1:]) >= zeta_low[:, None]
        meets &= side < self.side_counts[:, None]
        # nor is a rectangle beside the line of a side
        to_v = 0.5 * (v_low + v_high)[:, None] - v[:, :-1]
        to_zeta = 0.5 * (zeta_low + zeta_high)[:, None] - zeta[:, :-1]
        size_v = np.maximum(np.abs(v_low), np.abs(v_high))[:, None] + np.abs(v[:, :-1])
        size_zeta = np.maximum(np.abs(zeta_low), np.abs(zeta_high))[:, None]
        size_zeta = size_zeta + np.abs(zeta[:, :-1])
        half_v = 0.5 * (v_high - v_low)[:, None] + 8.0 * EPS * size_v
        half_zeta = 0.5 * (zeta_high - zeta_low)[:, None] + 8.0 * EPS * size_zeta
        reach = np.abs(self.rise) * half_v + np.abs(self.run) * half_zeta
        meets &= np.abs(to_v * self.rise - to_zeta * self.run) <= reach
        first = np.where(meets, side, len(side)).min(axis=1)
        last = np.where(meets, side, -1).max(axis=1)
        return GraphPart(first, last)

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
        terms = N * ends
        reach = sigma * np.array([terms.min(axis=0).sum(), terms.max(axis=0).sum()])
        room = 1e-9 * float(np.abs(terms).sum()) * sigma
        A = self.A + sigma * np.outer(N, N)
        curve = self.walk(A, part, N, (float(reach[0]) - room, float(reach[1]) + room))
        if curve is None:
            return None
        v, zeta, beta = curve.v, curve.zeta, curve.beta
        residual = np.abs(self.load + beta[:, None] * N - v @ A - self.c * zeta).max(axis=0)
        largest_v = np.abs(v).max(axis=0)
        pull = np.abs(beta).max() + sigma * float(np.abs(N) @ largest_v)
        load = np.abs(self.load) + pull * np.abs(N)
        noise = self.problems.rounding(largest_v, np.abs(zeta).max(axis=0), load)
        residual = residual + noise
        error = float(np.sqrt(np.sum(residual**2 / self.c))) / soft.gap
        if not error <= self.max_error:
            return None
        error_v = error / self.root_c + 8.0 * EPS * largest_v
        error_zeta = (residual + np.abs(A) @ error_v) / self.c
        error_zeta += 8.0 * EPS * np.abs(zeta).max(axis=0)
        G = beta - sigma * (v @ N)
        error_G = sigma * error * float(np.linalg.norm(N / self.root_c))
        error_G += 4.0 * (self.m + 8) * EPS * pull
        solutions = list[Found]()
        undecided = list[GraphPart]()
        for low_v, high_v, low_zeta, high_zeta in _crossings(curve, G, error_G):
            if np.any(high_v < ends[0] - error_v) or np.any(low_v > ends[1] + error_v):
                continue
            touched = self._met(
                low_v - error_v, high_v + error_v, low_zeta - error_zeta, high_zeta + error_zeta
            )
            touched = GraphPart(
                np.maximum(touched.first, part.first), np.minimum(touched.last, part.last)
            )
            if np.any(touched.first > touched.last):
                continue
            slopes = self.slopes(GraphPart(touched.first[None], touched.last[None]))
            gap = float(self.inertia(slopes).gap[0])
            if gap > 0.0:
                decision = self.decide(touched, gap)
                solutions += decision.solutions
                undecided += decision.undecided
            elif np.all(touched.last - touched.first <= 1):
                undecided.append(touched)
            else:
                return None
        return Decision(solutions, undecided)

    def walk(
        self,
        A: Array,
        part: GraphPart,
        N: Array,
        betas: tuple[float, float],
        load: Array | None = None,
    ) -> SolutionCurve | None:
        """Return the curve of Av + Cζ = l + βN over a part, β from the first to the second value.

        It begins at a point of the graph, from which the load is changed to that of the problem.
        None if it does not arrive. A is such that all cells of the part are regular, and alike.
        """
        node = self.node
        load = self.load if load is None else load
        sides = (part.first + part.last) // 2
        share = 0.3 + 0.4 * np.mod(0.618033988749895 * (node + 1), 1.0)  # no two nodes alike
        tau = share * self.length[node, sides]
        start = self.points[node, sides]
        v = start[:, 0] + share * self.run[node, sides]
        zeta = start[:, 1] + share * self.rise[node, sides]
        missing = load + betas[0] * N - A @ v - self.c * zeta
        Y = self._inverse(A, sides)
        if Y is None:
            return None
        at = [np.array(betas[0])]
        vs: list[Array] = []
        zetas: list[Array] = []
        cells: list[Index] = []
        pivots = 0
        stages = ((missing, 1.0), (N, betas[1] - betas[0]))
        for stage, (rhs, length) in enumerate(stages):
            done = 0.0
            if stage:
                vs.append(v)
                zetas.append(zeta)
            while True:
                rate = Y @ rhs
                size = self.length[node, sides]
                can_rise = (rate > 0.0) & (sides < part.last)
                can_fall = (rate < 0.0) & (sides > part.first)
                with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
                    to_end = np.where(can_rise, (size - tau) / rate, np.inf)
                    to_end = np.where(can_fall, -tau / rate, to_end)
                to_end = np.maximum(to_end, 0.0)
                turning = int(np.argmin(to_end))
                step = min(float(to_end[turning]), length - done)
                is_end = float(to_end[turning]) >= length - done
                tau = tau + step * rate
                if not is_end:
                    tau[turning] = size[turning] if rate[turning] > 0.0 else 0.0
                start = self.points[node, sides]
                # on the graph: rounding of tau is part of the residual
                no_less = np.where(sides == part.first, -np.inf, 0.0)
                no_more = np.where(sides == part.last, np.inf, 1.0)
                part_done = np.clip(tau / size, no_less, no_more)
                v = start[:, 0] + part_done * self.run[node, sides]
                zeta = start[:, 1] + part_done * self.rise[node, sides]
                done = length if is_end else done + step
                if not is_end:
                    corner = sides[turning] + int(rate[turning] > 0.0)
                    v[turning], zeta[turning] = self.points[turning, corner]
                if stage:
                    at.append(np.array(betas[0] + done))
                    vs.append(v)
                    zetas.append(zeta)
                    cells.append(sides)
                if is_end:
                    break
                pivots += 1
                if pivots > _MAX_PIVOTS:
                    return None
                sides = sides.copy()
                is_up = rate[turning] > 0.0
                sides[turning] += 1 if is_up else -1
                tau[turning] = 0.0 if is_up else self.length[turning, sides[turning]]
                if pivots % _REFRESH:
                    Y = self._exchanged(Y, A, turning, int(sides[turning]))
                else:
                    Y = self._inverse(A, sides)
                    now = load + betas[0] * N + (done * N if stage else (done - 1.0) * missing)
                    tau = self._moved(Y, A, sides, now, tau, turning)
                if Y is None:
                    return None
        return SolutionCurve(np.array(at), np.array(vs), np.array(zetas), np.array(cells))

    def _columns(self, A: Array, sides: Index) -> Array:
        size = self.length[self.node, sides]
        M = A * (self.run[self.node, sides] / size)
        M[self.node, self.node] += self.c * self.rise[self.node, sides] / size
        return np.asarray(M)

    def _inverse(self, A: Array, sides: Index) -> Array | None:
        try:
            Y: Array = np.asarray(np.linalg.inv(self._columns(A, sides)), dtype=float)
        except np.linalg.LinAlgError:
            return None
        return Y if np.isfinite(Y).all() else None

    def _exchanged(self, Y: Array, A: Array, node: int, side: int) -> Array | None:
        """Return the inverse after the column of a node has changed to that of another side."""
        size = self.length[node, side]
        column = A[:, node] * (self.run[node, side] / size)
        column[node] += self.c[node] * self.rise[node, side] / size
        x = Y @ column
        pivot = x[node]
        if pivot == 0.0 or not np.isfinite(pivot):
            return None
        row = Y[node] / pivot
        Y = Y - x[:, None] * row
        Y[node] = row
        return Y

    def _moved(
        self, Y: Array | None, A: Array, sides: Index, load: Array, tau: Array, turning: int
    ) -> Array:
        """Return the places on sides for a load, the node that turns where it is."""
        if Y is None:
            return tau
        start = self.points[self.node, sides]
        fresh = Y @ (load - A @ start[:, 0] - self.c * start[:, 1])
        fresh[turning] = tau[turning]
        return np.asarray(fresh)


def _crossings(
    curve: SolutionCurve, G: Array, error: float
) -> list[tuple[Array, Array, Array, Array]]:
    """Return the hulls (least, greatest v, least, greatest ζ) of intervals with |G| ≤ error."""
    begin, end = G[:-1], G[1:]
    change = end - begin
    near = (np.minimum(begin, end) <= error) & (np.maximum(begin, end) >= -error)
    hulls = list[tuple[Array, Array, Array, Array]]()
    last_end = (-1, 1.0)
    for edge in np.flatnonzero(near).tolist():
        if change[edge] == 0.0:
            shares = (0.0, 1.0)
        else:
            to_low = (-error - begin[edge]) / change[edge]
            to_high = (error - begin[edge]) / change[edge]
            width = 1e-12 * (abs(to_low) + abs(to_high))
            shares = (
                max(0.0, min(to_low, to_high) - width),
                min(1.0, max(to_low, to_high) + width),
            )
        v = [curve.v[edge] + x * (curve.v[edge + 1] - curve.v[edge]) for x in shares]
        zeta = [curve.zeta[edge] + x * (curve.zeta[edge + 1] - curve.zeta[edge]) for x in shares]
        hull = (
            np.minimum(*v) - 4.0 * EPS * np.abs(v).max(axis=0),
            np.maximum(*v) + 4.0 * EPS * np.abs(v).max(axis=0),
            np.minimum(*zeta) - 4.0 * EPS * np.abs(zeta).max(axis=0),
            np.maximum(*zeta) + 4.0 * EPS * np.abs(zeta).max(axis=0),
        )
        if hulls and last_end == (edge - 1, 1.0) and shares[0] == 0.0:
            old = hulls.pop()
            hull = (
                np.minimum(old[0], hull[0]),
                np.maximum(old[1], hull[1]),
                np.minimum(old[2], hull[2]),
                np.maximum(old[3], hull[3]),
            )
        hulls.append(hull)
        last_end = (edge, shares[1])
    return hulls


def distinct_solutions(parts: Parts, solutions: list[Found]) -> tuple[list[Found], list[GraphPart]]:
    """Return solutions without those that are listed before, and parts where that is not sure.

    Each is inside its part. One that is in two parts is on a side of each that is in both.
    """
    distinct = list[Found]()
    doubtful = list[GraphPart]()
    for solution in solutions:
        is_new = True
        for known in distinct:
            if not known.part.meets(solution.part):
                continue
            if np.any(np.abs(known.v - solution.v) > known.error + solution.error):
                continue
            union = known.part.joined(solution.part)
            slopes = parts.slopes(GraphPart(union.first[None], union.last[None]))
            is_same = known.part.holds(solution.part) or solution.part.holds(known.part)
            if not is_same and not parts.inertia(slopes).gap[0] > 0.0:
                doubtful.append(union)
            is_new = False
            break
        if is_new:
            distinct.append(solution)
    return distinct, doubtful


def distinct_parts(undecided: list[GraphPart], solutions: list[Found]) -> list[GraphPart]:
    """Return parts that may hold more than the solutions, those that meet as one."""
    distinct = list[GraphPart]()
    for part in undecided:
        if any(known.part.holds(part) for known in solutions):
            continue
        own = part
        others = list[GraphPart]()
        for other in distinct:
            if other.meets(own):
                own = own.joined(other)
            else:
                others.append(other)
        distinct = [*others, own]
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
        gap = float(parts.inertia(parts.slopes(GraphPart(cell[None], cell[None]))).gap[0])
        decision = parts.decide(part, gap) if gap > 0.0 else Decision([], [part])
        solutions += decision.solutions
        undecided += decision.undecided
    distinct, doubtful = distinct_solutions(parts, solutions)
    return distinct, distinct_parts([*undecided, *doubtful], distinct)
