"""A point on the path, the cell it is in, and the way to the cell's boundary.

Everything here is in working units: stiffness divided by its mean diagonal, so forces c·(ξ/c) and slips have the same
unit. `x` holds the coordinate of every node that moves in the present cell: u_i of a free node, the force at a node on
a vertical side.
"""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tcstudy.contact.path.dense import SingularCellError
from tcstudy.contact.path.problem import LawGraph, ParametricProblem, ScaledBody
from tcstudy.contact.path.tableau import Tableau

Array = NDArray[np.float64]
Codes = NDArray[np.int32]
Index = NDArray[np.intp]

TIE = 1e-12
"""Nodes this close to their bound, relative to slip and traction there, reach it together with the first one, or as
close as rounding of the problem lets their place be known (ScaledBody.blur)."""

BLURS = 64.0
"""Where a whole zone reaches its bounds at once its motion is nearly singular, and rounding that much larger."""

LARGEST_TIE = 1e-9
"""Whatever rounding is, nodes farther from their bound have not reached it."""

DRIFTED = 1e3
"""How many times farther than a tie nodes are looked at again, with the point corrected first."""

SLOW = 1e-4
"""A node slower than this part of the fastest one hardly knows its place on the path: a corrected point is not held
where that node has reached its bound, or rounding of its coordinate would move the point along the path."""

STILL = 1e-14
"""Speeds below this part of the largest one are rounding, and zero."""


@dataclass(frozen=True)
class Units:
    """Working units and scales of one problem.

    body:      Ã divided by its mean diagonal
    load:      l̃₁ divided by that, (m,)
    diagonal:  diagonal of A, (m,)
    weight:    c divided by it, (m,)
    traction:  scale of b [Pa]
    slip:      (m,) slip that changes a node's own traction by the scale of b [m]
    """

    body: ScaledBody
    load: Array
    diagonal: Array
    weight: Array
    traction: float
    slip: Array

    @property
    def stiffness(self) -> float:
        """Mean diagonal of Ã [Pa]."""
        return self.body.stiffness

    @property
    def tie(self) -> float:
        """Relative distance from a bound at which a node has reached it."""
        return max(TIE, min(BLURS * self.body.blur, LARGEST_TIE))


def units_of(problem: ParametricProblem) -> Units:
    """Scales that make every tolerance below relative; raises ValueError if Ã is not positive definite."""
    body, diagonal, traction = problem.body, np.diagonal(problem.A_tilde), problem.traction_scale
    stiffness, slip = body.stiffness, traction * problem.c / diagonal
    return Units(body, problem.l_1 / stiffness, diagonal / stiffness, problem.c / stiffness, traction, slip)


class Walk:
    """The present cell with its bounds and linear algebra, the present point, and the direction of travel.

    codes: (m,) piece of every node;  x: (m,) moving coordinates;  t: parameter
    dx, dt: direction of travel; its length has no meaning
    negatives: negative eigenvalues of the free nodes' matrix
    """

    def __init__(
        self,
        problem: ParametricProblem,
        units: Units,
        codes: Codes,
        x: Array,
        t: float,
        tableau: Tableau | None = None,
    ) -> None:
        """tableau: that of a walk on the same body, which this one takes over."""
        self.problem, self.units = problem, units
        self.graph: LawGraph = problem.graph
        self.tie, self.watch = units.tie, 1.001 * DRIFTED * units.tie
        body = units.body
        if tableau is None:
            free, k = self.graph.free[codes], units.weight * self.graph.slope[codes]
            tableau = Tableau(body.A, units.load, body.compliance, free, k, body.spread)
        elif tableau.load is not units.load:
            tableau.reload(units.load)
        self.tableau = tableau
        self.put(codes, x, t)

    def put(self, codes: Codes, x: Array, t: float) -> None:
        """To another point, with the node's pieces there, at rest."""
        units = self.units
        self.codes, self.x, self.t = codes.copy(), x.copy(), t
        self.free, self.kink = self.graph.free[codes], self.graph.kink[codes]
        unit = np.where(self.free, 1.0, units.weight)
        self.own = np.where(self.free, 1.0, units.diagonal)
        self.low, self.high = self.graph.low[codes] * unit, self.graph.high[codes] * unit
        self.near_low, self.near_high = self._watched(self.low, 1.0), self._watched(self.high, -1.0)
        self.tableau.become(self.free, units.weight * self.graph.slope[codes])
        self.negatives = self.tableau.negatives()
        self.dx, self.dt = np.zeros(len(x)), 0.0
        self.downs = int(np.count_nonzero(self.graph.sense[codes] < 0))

    def place(self, nodes: Sequence[int], codes: Sequence[int]) -> None:
        """Put nodes on other pieces, at the kink where they stand."""
        at, new = np.array(nodes, dtype=np.intp), np.array(codes, dtype=np.int32)
        moved = self.codes[at] != new
        pairs = zip(at[moved].tolist(), new[moved].tolist(), strict=True)
        self.tableau.change_many([self._place(i, code) for i, code in pairs])

    def place_one(self, i: int, code: int) -> None:
        """Put one node on another piece, at the kink where it stands."""
        self.tableau.change(*self._place(i, code))

    def _place(self, i: int, code: int) -> tuple[int, bool, float]:
        """Put one node on another piece: (node, whether it is free there, c × slope of b there)."""
        units, rows = self.units, self.graph.rows
        was_free, _, _, old_sense, _, _, old_slope, anchor, start, old_kink = rows[self.codes.item(i)]
        free, low, high, sense, _, _, slope, _, _, new_kink = rows[code]
        weight, slip = units.weight.item(i), units.slip.item(i)
        self.downs += (sense < 0) - (old_sense < 0)
        kink = old_kink if not was_free else self.x.item(i) if free else new_kink
        # Onto a vertical side: the traction it begins with is that of the segment the node comes from.
        x = kink if free else weight * (start + old_slope * (kink - anchor))
        unit, own = (1.0, 1.0) if free else (weight, units.diagonal.item(i))
        low, high = low * unit, high * unit
        self.codes[i], self.free[i], self.kink[i] = code, free, new_kink
        self.own[i], self.low[i], self.high[i] = own, low, high
        margin = self.watch * own
        self.near_low[i] = low + margin * (abs(low if free else new_kink) + slip)
        self.near_high[i] = high - margin * (abs(high if free else new_kink) + slip)
        self.x[i] = high if high - x < x - low else low
        return i, free, weight * slope

    def _watched(self, bound: Array, inwards: float) -> Array:
        """(m,) coordinates beyond which `gaps` may be below DRIFTED ties."""
        size = (np.abs(np.where(self.free, bound, self.kink)) + self.units.slip) * self.own
        return bound + np.where(np.isfinite(bound), inwards * self.watch * size, 0.0)

    @property
    def u(self) -> Array:
        """(m,) displacements; held nodes sit on their kink bitwise."""
        return np.where(self.free, self.x, self.kink)

    @property
    def stable(self) -> bool:
        """Strict local minimum: positive definite on the free nodes, nobody inside a down-jump, t not at rest."""
        return self.negatives == 0 and self.downs == 0 and self.dt != 0.0

    def turn(self, dx: Array, dt: float, size: Array) -> None:
        """Take a direction; speeds at rounding level become zero. size: |dx|"""
        largest = size.item(size.argmax())
        still = size <= STILL * largest
        if np.count_nonzero(still):
            dx[still] = 0.0
        self.dx, self.dt = dx, dt if self.tableau.load_size * abs(dt) > STILL * largest else 0.0

    def reach(self) -> tuple[float, int]:
        """(step to the first bound, inf if none; the node that has it). The caller ignores divisions by zero."""
        steps = np.maximum((self.high - self.x) / self.dx, (self.low - self.x) / self.dx)
        first = int(steps.argmin())
        step = steps.item(first)
        if not step >= 0.0:  # also where a node rests on its bound, 0/0
            steps[self.dx == 0.0] = np.inf
            first = int(steps.argmin())
            step = steps.item(first)
        return max(0.0, step), first

    def arrive(self, step: float, first: int) -> list[int]:
        """Advance by `step`; nodes that have reached a bound (or rested on one) are put on it and returned.

        first: the node that comes to its bound first
        """
        self.x += step * self.dx
        self.t += step * self.dt
        self._reach(first)
        if np.count_nonzero(self.x <= self.near_low) + np.count_nonzero(self.x >= self.near_high) < 2:
            return [first]
        return self._arrived(first)

    def _arrived(self, first: int) -> list[int]:
        """The same where several nodes are near a bound."""
        gaps = self.gaps()
        if np.count_nonzero(gaps <= DRIFTED * self.tie) > 1:  # are they there, or has the point drifted?
            with suppress(SingularCellError):
                self.refine(self.held_by(np.array([first])))
                gaps = self.gaps()
        near = gaps <= self.tie
        if np.count_nonzero(near) > 1:
            upper = self.high - self.x < self.x - self.low
            near &= ~np.where(upper, self.dx < 0.0, self.dx > 0.0)  # from a bound it has only just left
            at = np.flatnonzero(near)
            if len(at):
                self.x[at] = np.where(upper[at], self.high[at], self.low[at])
                return [int(i) for i in at]
        self._reach(first)  # where the correction has moved it off
        return [first]

    def _reach(self, first: int) -> None:
        """Put a node exactly on the bound to which it goes: by that `cross` tells where it goes on."""
        self.x[first] = self.high[first] if self.dx[first] > 0.0 else self.low[first]

    def gaps(self) -> Array:
        """(m,) distance of every node from its nearer bound, relative to slip and traction there."""
        size = np.abs(self.u)
        size += self.units.slip
        size *= self.own
        gap = np.minimum(self.high - self.x, self.x - self.low)
        gap /= size
        return gap

    def defect(self) -> Array:
        """l̃ − Ãu − ξ at the present point, working units (m,)."""
        p, (u, traction) = self.problem, self.graph.points(self.codes, self.x, self.units.weight)
        return (p.load(self.t) - p.A_tilde @ u - p.c * traction) / self.units.stiffness

    def residual(self) -> float:
        """Largest defect per length, relative to the scale of b."""
        return float(np.max(np.abs(self.defect()) / self.units.weight)) / self.units.traction

    def direction_defect(self) -> float:
        """How far the direction is from satisfying the equations of the cell, relative to its speeds."""
        force = np.where(self.free, self.tableau.k * self.dx, self.dx)
        defect = self.units.body.A @ np.where(self.free, self.dx, 0.0) + force - self.dt * self.units.load
        return float(np.max(np.abs(defect)) / np.max(np.abs(self.dx)))

    def held_by(self, nodes: Index) -> int:
        """Which coordinate a correction keeps: that of the fastest of these nodes, or of all if it is slow."""
        speed = np.abs(self.dx)
        lead = int(speed.argmax())
        own = int(nodes[speed[nodes].argmax()]) if len(nodes) else lead
        return own if speed[own] > SLOW * speed[lead] else lead

    def refine(self, node: int | None) -> None:
        """One correction of the present point, with `node` (or t, if None) held where it is."""
        dx, dt = self.tableau.direction(node, 0.0, self.defect())
        self.x += dx
        self.t += dt
