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
import scipy.linalg
from numpy.typing import NDArray

from tcstudy.solvers.path.problem import LawGraph, ParametricProblem
from tcstudy.solvers.path.tableau import SingularCellError, Tableau

Array = NDArray[np.float64]
Codes = NDArray[np.int32]
Index = NDArray[np.intp]

TIE = 1e-12
"""Nodes this close to their bound, relative to slip and traction there, reach it together with the first one, or as
close as rounding of the problem lets their place be known (Units.blur)."""

BLURS = 64.0
"""Where a whole zone reaches its bounds at once its motion is nearly singular, and rounding that much larger."""

LARGEST_TIE = 1e-9
"""Whatever rounding is, nodes farther from their bound have not reached it."""

DRIFTED = 1e3
"""How many times farther than a tie nodes are looked at again, with the point corrected first."""

STILL = 1e-14
"""Speeds below this part of the largest one are rounding, and zero."""


@dataclass(frozen=True)
class Units:
    """Working units and scales of one problem.

    stiffness: mean diagonal of Ã [Pa]
    A, load:   Ã and l̃₁ divided by it
    diagonal:  diagonal of A, (m,)
    compliance: largest of some diagonal entries of A⁻¹
    weight:    c divided by it, (m,)
    traction:  scale of b [Pa]
    slip:      (m,) slip that changes a node's own traction by the scale of b [m]
    blur:      rounding of a displacement relative to the largest one, about: ε √m times a condition number of Ã
    """

    stiffness: float
    A: Array
    load: Array
    diagonal: Array
    compliance: float
    weight: Array
    traction: float
    slip: Array
    blur: float

    @property
    def tie(self) -> float:
        """Relative distance from a bound at which a node has reached it."""
        return max(TIE, min(BLURS * self.blur, LARGEST_TIE))


def units_of(problem: ParametricProblem, t: float) -> Units:
    """Scales that make every tolerance below relative; raises ValueError if Ã is not positive definite."""
    diagonal = np.diagonal(problem.A_tilde)
    stiffness = float(np.mean(diagonal))
    traction = problem.at(t).traction_scale
    if traction == 0.0:
        traction = float(np.max(np.abs(problem.l_1 / problem.c)))
    A = np.asfortranarray(problem.A_tilde / stiffness)
    factor, info = scipy.linalg.lapack.dpotrf(A, lower=1, clean=0)
    if info != 0 or not stiffness > 0.0:
        raise ValueError(
            "the condensed stiffness is not positive definite; clamp the body, check its elastic constants"
        )
    probes = np.unique(np.linspace(0, problem.m - 1, 16).astype(int))
    columns = scipy.linalg.lapack.dpotrs(factor, np.eye(problem.m)[:, probes], lower=1)[0]
    compliance = float(np.max(np.abs(columns)))
    slip = traction * problem.c / diagonal
    return Units(
        stiffness,
        A,
        problem.l_1 / stiffness,
        diagonal / stiffness,
        compliance,
        problem.c / stiffness,
        traction,
        slip,
        float(np.sqrt(problem.m) * np.finfo(float).eps * compliance * np.linalg.norm(A, np.inf)),
    )


class Walk:
    """The present cell with its bounds and linear algebra, the present point, and the direction of travel.

    codes: (m,) piece of every node;  x: (m,) moving coordinates;  t: parameter
    dx, dt: direction of travel; its length has no meaning
    negatives: negative eigenvalues of the free nodes' matrix
    """

    def __init__(self, problem: ParametricProblem, units: Units, codes: Codes, x: Array, t: float) -> None:
        self.problem, self.units = problem, units
        self.graph: LawGraph = problem.graph
        self.codes, self.x, self.t = codes.copy(), x.copy(), t
        self.tie = units.tie
        self.free, self.kink = self.graph.free[codes], self.graph.kink[codes]
        unit = np.where(self.free, 1.0, units.weight)
        self.own = np.where(self.free, 1.0, units.diagonal)
        self.low, self.high = self.graph.low[codes] * unit, self.graph.high[codes] * unit
        stiffness = units.weight * self.graph.slope[codes]
        self.tableau = Tableau(units.A, units.load, units.compliance, self.free, stiffness)
        self.negatives = self.tableau.negatives()
        self.dx, self.dt = np.zeros(problem.m), 0.0
        self.downs = int(np.count_nonzero(self.graph.sense[codes] < 0))

    def place(self, nodes: Sequence[int], codes: Sequence[int]) -> None:
        """Put nodes on other pieces, at the kink where they stand."""
        changes: list[tuple[int, bool, float]] = []
        for i, code in zip(nodes, codes, strict=True):
            if self.codes[i] != code:
                changes.append(self._place(i, code))
        self.tableau.change_many(changes)

    def _place(self, i: int, code: int) -> tuple[int, bool, float]:
        """Put one node on another piece: (node, whether it is free there, c × slope of b there)."""
        graph, old = self.graph, int(self.codes[i])
        was_free, free = bool(graph.free[old]), bool(graph.free[code])
        weight = float(self.units.weight[i])
        self.downs += int(graph.sense[code] < 0) - int(graph.sense[old] < 0)
        kink = float(graph.kink[old] if not was_free else self.x[i] if free else graph.kink[code])
        # Onto a vertical side: the traction it begins with is that of the segment the node comes from.
        x = kink if free else weight * float(graph.start[old] + graph.slope[old] * (kink - graph.anchor[old]))
        unit = 1.0 if free else weight
        low, high = float(graph.low[code]) * unit, float(graph.high[code]) * unit
        self.codes[i], self.free[i], self.kink[i] = code, free, graph.kink[code]
        self.own[i] = 1.0 if free else self.units.diagonal[i]
        self.low[i], self.high[i] = low, high
        self.x[i] = high if high - x < x - low else low
        return i, free, weight * float(graph.slope[code])

    @property
    def u(self) -> Array:
        """(m,) displacements; held nodes sit on their kink bitwise."""
        return np.where(self.free, self.x, self.kink)

    @property
    def traction(self) -> Array:
        """(m,) ξ/c on the graph [Pa]."""
        return self.graph.traction(self.codes, self.x, self.x / self.units.weight)

    @property
    def stable(self) -> bool:
        """Strict local minimum: positive definite on the free nodes, nobody inside a down-jump, t not at rest."""
        return self.negatives == 0 and self.downs == 0 and self.dt != 0.0

    def turn(self, dx: Array, dt: float) -> None:
        """Take a direction; speeds at rounding level become zero."""
        size = np.abs(dx)
        largest = float(size.max())
        dx[size <= STILL * largest] = 0.0
        self.dx, self.dt = dx, dt if self.tableau.load_size * abs(dt) > STILL * largest else 0.0

    def reach(self) -> tuple[float, Array]:
        """(step to the first bound, inf if none; all nodes' steps)."""
        way = np.where(self.dx > 0.0, self.high, self.low)
        way -= self.x
        steps = np.full(len(way), np.inf)
        np.divide(way, self.dx, out=steps, where=self.dx != 0.0)
        return max(0.0, float(steps.min())), steps

    def arrive(self, step: float, steps: Array) -> Index:
        """Advance by `step`; nodes that have reached a bound (or rested on one) are put on it and returned."""
        self.x += step * self.dx
        self.t += step * self.dt
        first = int(steps.argmin())
        self.x[first] = self.high[first] if self.dx[first] > 0.0 else self.low[first]
        gaps = self.gaps()
        if np.count_nonzero(gaps <= DRIFTED * self.tie) > 1:  # are they there, or has the point drifted?
            with suppress(SingularCellError):
                self.refine(first)
                gaps = self.gaps()
        near = gaps <= self.tie
        if np.count_nonzero(near) > 1:
            upper = self.high - self.x < self.x - self.low
            near &= ~np.where(upper, self.dx < 0.0, self.dx > 0.0)  # from a bound it has only just left
            at = np.flatnonzero(near)
            if len(at):
                self.x[at] = np.where(upper[at], self.high[at], self.low[at])
                return at
        return np.array([first])

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
        p, u = self.problem, self.u
        return (p.load(self.t) - p.A_tilde @ u - p.c * self.traction) / self.units.stiffness

    def residual(self) -> float:
        """Largest defect per length, relative to the scale of b."""
        return float(np.max(np.abs(self.defect()) / self.units.weight)) / self.units.traction

    def direction_defect(self) -> float:
        """How far the direction is from satisfying the equations of the cell, relative to its speeds."""
        force = np.where(self.free, self.tableau.k * self.dx, self.dx)
        defect = self.units.A @ np.where(self.free, self.dx, 0.0) + force - self.dt * self.units.load
        return float(np.max(np.abs(defect)) / np.max(np.abs(self.dx)))

    def refine(self, node: int | None) -> None:
        """One correction of the present point, with `node` (or t, if None) held where it is."""
        dx, dt = self.tableau.direction(node, 0.0, self.defect())
        self.x += dx
        self.t += dt
