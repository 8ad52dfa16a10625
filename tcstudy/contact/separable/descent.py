"""The moves of the separable Newton method: clipped path, node by node, escape from saddles, refinement.

Node by node (one-dimensional minimisations on the exact pieces, one node after the other) is slow but certain, and
used only where a Newton path gives no decrease.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from tcstudy.contact.loop import Status
from tcstudy.contact.problem import ContactProblem
from tcstudy.contact.separable.convex_step import convex_step
from tcstudy.contact.separable.pieces import FreeSystem, Slopes, energy_change, slopes
from tcstudy.laws.laws import Laws

Array = NDArray[np.float64]
Index = NDArray[np.intp]

STALLED = (
    "no node can lower the energy although the inclusion does not hold; the data span too many orders of magnitude "
    "for double precision: check the units, start from another point, or use another solver"
)
ROUNDING = (
    "the inclusion residual stays at rounding level above the tolerance; the displacements are large against those "
    "that friction causes: allow a larger tolerance or use a coarser contact mesh"
)
_REFINEMENTS, _MAJORANT_STEPS = 8, 8
"""Of a solution at rounding level; and with a curvature majorant inside an exponential piece, where each descends."""
ROUNDINGS = 64.0
"""Residuals below this many roundings of the largest terms of ξ count as rounding, as decreases of energy do below so
many of the work of ξ."""
_WHOLE = ("newton/1", "escape", "model")
"""Steps after which progress is not called slow."""
ARMIJO, HALVINGS = 1e-4, 4
"""Share of the first-order decrease that a step must realise; step lengths 1, ½, ¼ … tried before going node by node.
"""
_PUT_OFF = 20
"""Slow steps more before a step on the convex model is tried again that was of no use."""


@dataclass(frozen=True)
class SeparableState:
    """One iterate.

    v, xi:          displacements [m] and nodal friction forces ξ = l̃ − Ãv [N/m], (m,)
    slopes:         one-sided slopes at v
    piece:          (m,) smooth piece of every node, at a kink the one on its descending side
    residual:       max |descending slope|/c over the scale of b: zero at a first-order stationary point
    rounding:       the same for one rounding of the largest terms of ξ
    f:              L̃(v) [J/m]
    moved:          what the last step was, for the log
    second_order:   what the second-order test found, None while untested
    evaluations, factorisations: work so far
    slow:           steps since the last whole one, or since all nodes were moved together
    stopped:        (status, reason) if the last step could not be made
    """

    v: Array
    xi: Array
    slopes: Slopes
    piece: Index
    residual: float
    rounding: float
    f: float
    moved: str = "start"
    second_order: str | None = None
    evaluations: int = 1
    factorisations: int = 0
    slow: int = 0
    stopped: tuple[Status, str] | None = None

    @property
    def at_rounding(self) -> bool:
        """True if the residual is no more than rounding."""
        return self.residual <= ROUNDINGS * self.rounding


def new_state(problem: ContactProblem, v: Array) -> SeparableState:
    """The state at v."""
    xi = problem.xi(v)
    s = slopes(problem, v, xi)
    piece = np.where(s.descent <= 0.0, problem.law.piece(v, +1), problem.law.piece(v, -1))
    terms = np.diagonal(problem.A_tilde) * np.abs(v) + np.abs(problem.l_tilde) + np.abs(xi)
    residual = problem.relative(s.descent / problem.c, xi)
    rounding = problem.relative(np.finfo(float).eps * terms / problem.c, xi)
    f = float(-0.5 * v @ (xi + problem.l_tilde) + problem.c @ problem.law.integral(np.zeros(problem.m), v))
    second_order = "every node rests" if np.all(s.at_rest) else None
    return SeparableState(v, xi, s, piece, residual, rounding, f, second_order=second_order)


def along_path(problem: ContactProblem, state: SeparableState, system: FreeSystem) -> SeparableState | None:
    """The first of the step lengths 1, ½, ¼ … on the clipped Newton path that satisfies Armijo's rule, else None."""
    s = state.slopes
    direction = np.zeros(problem.m)
    direction[system.free] = -system.solve(s.descent[system.free])
    uphill = np.where(direction > 0.0, s.right, -s.left) > 0.0
    direction[s.at_jump & uphill] = 0.0
    stop = problem.law.next_up_jump(problem.law.locate(state.v), direction)
    slope = np.where(direction > 0.0, s.right, s.left)
    for halving in range(HALVINGS + 1):
        target = state.v + 0.5**halving * direction
        reached = np.where(direction > 0.0, target >= stop, target <= stop) & (direction != 0.0)
        target = np.where(reached, stop, target)
        step = target - state.v
        change = energy_change(problem, state.v, state.xi, step, problem.A_tilde @ step)
        state = replace(state, evaluations=state.evaluations + 1)
        if change < 0.0 and change <= -ARMIJO * abs(float(slope @ step)):
            new = moved(problem, state, target, f"newton/{2**halving}")
            same = np.array_equal(new.slopes.at_rest, s.at_rest) and np.array_equal(new.piece, state.piece)
            if system.curvature is None and same:
                new = replace(new, second_order="a local minimum")
            return new
    return None


def on_model(problem: ContactProblem, state: SeparableState) -> SeparableState:
    """The first of the step lengths 1, ½, ¼ … towards the minimum of the convex model that lowers L̃.

    Without one the state itself, with the next such step put off.
    """
    found = convex_step(problem, state.v, state.piece)
    if found is not None:
        target, factorisations = found
        state = replace(state, factorisations=state.factorisations + factorisations)
        for halving in range(HALVINGS + 1):
            at = target if halving == 0 else state.v + 0.5**halving * (target - state.v)
            step = at - state.v
            state = replace(state, evaluations=state.evaluations + 1)
            if energy_change(problem, state.v, state.xi, step, problem.A_tilde @ step) < 0.0:
                return moved(problem, state, at, "model")
    return replace(state, slow=-_PUT_OFF)


def first_rest(problem: ContactProblem, state: SeparableState, target: Array) -> Array | None:
    """Where on the straight way to `target` the energy first stops falling (m,); None if it rises at once.

    On straight pieces the slope of the energy along the way is a line between the kinks that nodes pass; a node that
    stops on a kink is there to the bit.
    """
    law, c, v, step = problem.law, problem.c, state.v, target - state.v
    piece = np.where(step > 0.0, law.piece(v, +1), law.piece(v, -1))
    moving = np.flatnonzero(step)
    tables, index = law.tables, law.node_index(problem.m)
    kinks = tables.kinks[index[moving]]
    shares = (kinks - v[moving, None]) / step[moving, None]
    row, kink = np.nonzero((shares > 0.0) & (shares < 1.0))
    order = np.argsort(shares[row, kink], kind="stable")
    row, kink = row[order], kink[order]
    node, s, at = moving[row], kinks[row, kink], shares[row, kink]
    kink, on = tables.first[index[node]] + kink, (step[node] > 0.0).astype(np.intp)
    weight = c[node] * step[node]
    jump = weight * (tables.value(s, kink + on) - tables.value(s, kink + 1 - on))
    bend = weight * step[node] * (tables.slope(s, kink + on) - tables.slope(s, kink + 1 - on))
    begins = np.append(0.0, at)
    curvature = step @ (problem.A_tilde @ step + c * law.slope(v, piece) * step) + np.append(0.0, np.cumsum(bend))
    rise = curvature * np.diff(np.append(begins, 1.0))
    first = step @ (c * law.value(v, piece) - state.xi) + np.append(0.0, np.cumsum(rise[:-1] + jump))
    k = int(np.argmax(first + rise > 0.0))
    if not first[k] + rise[k] > 0.0:
        return target
    if first[k] < 0.0:
        return np.asarray(v + (begins[k] - first[k] / curvature[k]) * step)
    if k == 0:
        return None
    found = v + at[k - 1] * step
    found[node[k - 1]] = s[k - 1]
    return np.asarray(found)


def node_by_node(problem: ContactProblem, state: SeparableState) -> SeparableState:
    """One pass of one-dimensional minimisations over the descending nodes."""
    target = descend_nodes(problem, state.v, state.xi, state.slopes.descent)
    step = target - state.v
    if not energy_change(problem, state.v, state.xi, step, problem.A_tilde @ step) < 0.0:
        return replace(state, stopped=(Status.STALLED, STALLED))
    return moved(problem, state, target, "nodes")


def refine(problem: ContactProblem, state: SeparableState, system: FreeSystem, tolerance: float) -> SeparableState:
    """The last digits of a solution: refinement with the factor at hand, judged by the residual.

    Here L̃ cannot tell two points apart any more. What stays above the tolerance is reported as such.
    """
    best = state
    for _ in range(_REFINEMENTS):
        direction = np.zeros(problem.m)
        direction[system.free] = -system.solve(best.slopes.descent[system.free])
        new = moved(problem, best, best.v + direction, "refined")
        if not new.residual < best.residual:
            break
        slow = new.residual > 0.5 * best.residual
        best = new
        if best.residual <= tolerance or slow:
            break
    if best.residual > tolerance:
        return replace(best, stopped=(Status.INCLUSION_VIOLATED, ROUNDING))
    return replace(best, second_order="a local minimum" if system.curvature is None else best.second_order)


def escape(problem: ContactProblem, state: SeparableState, system: FreeSystem) -> SeparableState:
    """Second-order test at a stationary point; if it fails, a step along the negative curvature."""
    if system.curvature is None:
        return replace(state, second_order="a local minimum")
    direction, s = np.zeros(problem.m), state.slopes
    direction[system.free] = system.curvature
    for step in off_saddle(state.v, direction, (s.left, s.right), problem.law.ends(state.piece)):
        change = energy_change(problem, state.v, state.xi, step, problem.A_tilde @ step)
        state = replace(state, evaluations=state.evaluations + 1)
        if change < -ROUNDINGS * np.finfo(float).eps * float(np.abs(state.xi) @ np.abs(step)):
            return moved(problem, state, state.v + step, "escape")
    return replace(state, second_order="the second-order test is undecided (singular matrix)")


def off_saddle(v: Array, direction: Array, slopes: tuple[Array, Array], ends: tuple[Array, Array]) -> list[Array]:
    """Steps (m,) to be tried from a stationary point v along ±direction of negative curvature; none without a kink.

    slopes: left and right ones of L̃;  ends: left and right ones of the nodes' pieces

    Until a node reaches its next kink the energy of a piecewise-linear law is an exact parabola that opens downwards:
    the first step ends there. Exponential pieces may need shorter ones.
    """
    first_order = np.where(direction > 0.0, slopes[1], slopes[0])
    direction = -direction if float(first_order @ direction) > 0.0 else direction
    end = np.where(direction > 0.0, ends[1], ends[0])
    with np.errstate(divide="ignore", invalid="ignore"):
        reach = np.where(direction != 0.0, (end - v) / direction, np.inf)
    length = float(np.min(reach[reach > 0.0], initial=np.inf))
    return [part * length * direction for part in (1.0, 0.25, 0.05)] if np.isfinite(length) else []


def moved(problem: ContactProblem, state: SeparableState, v: Array, how: str) -> SeparableState:
    """The state at the accepted point v, with the work so far."""
    new = new_state(problem, v)
    slow = 0 if how in _WHOLE else state.slow + 1
    return replace(new, moved=how, evaluations=state.evaluations + 1, factorisations=state.factorisations, slow=slow)


def descend_nodes(problem: ContactProblem, v: Array, xi: Array, descent: Array) -> Array:
    """v after one Gauss–Seidel pass over the descending nodes, largest expected gain first (m,).

    descent: the descending one-sided slopes at v (0 at rest) [N/m]
    """
    A_tilde, c, law = problem.A_tilde, problem.c, problem.law
    diagonal = np.diagonal(A_tilde)
    gain = descent**2 / diagonal
    v, xi = v.copy(), xi.copy()
    for node in map(int, np.argsort(-gain, kind="stable")[: np.count_nonzero(gain)]):
        own = law.single(node), float(v[node]), float(xi[node] / c[node]), float(diagonal[node] / c[node])
        target = NodeEnergy(*own).descend()
        xi -= A_tilde[node] * (target - v[node])
        v[node] = target
    return v


@dataclass(frozen=True)
class NodeEnergy:
    """½ k (s − s₀)² − traction (s − s₀) + j(s), the energy per length of one node with the others held.

    s_0 [m], traction ξ/c at s₀ [Pa], stiffness k = Ã_ii/c_i [Pa/m]
    """

    law: Laws
    s_0: float
    traction: float
    stiffness: float

    def derivative(self, s: float, piece: int) -> float:
        """Slope of the energy on the named piece."""
        return float(self.law.value(s, piece)) + self.stiffness * (s - self.s_0) - self.traction

    def descend(self) -> float:
        """First resting place downhill from s₀: a zero of the slope, or a jump behind which it climbs."""
        s = self.s_0
        left = self.derivative(s, int(self.law.piece(s, -1)))
        right = self.derivative(s, int(self.law.piece(s, +1)))
        if max(-right, left) <= 0.0:
            return s
        sign = 1 if -right >= left else -1
        piece = int(self.law.piece(s, sign))
        while True:
            end = float(self.law.ends(np.asarray(piece))[sign > 0])
            s = self._descend_piece(piece, sign, s, end)
            if s != end or sign * self.derivative(s, piece + sign) >= 0.0:
                return s
            piece += sign

    def _descend_piece(self, piece: int, sign: int, s: float, end: float) -> float:
        """First zero of the slope on the way to `end`, or `end`; exponential pieces stop short of the zero.

        The curvature k + b′ is monotone on a piece, so its larger end bounds it and no step passes a zero.
        """
        far = float(self.law.slope(end, piece)) if np.isfinite(end) else float(self.law.q[piece])
        for _ in range(_MAJORANT_STEPS if self.law.bent[piece] else 1):
            bound = self.stiffness + max(float(self.law.slope(s, piece)), far)
            downhill = -sign * self.derivative(s, piece)
            if downhill <= 0.0:
                return s
            if bound <= 0.0 or abs(end - s) * bound <= downhill:
                return end
            s += sign * downhill / bound
        return s
