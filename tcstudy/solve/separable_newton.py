"""Globalised separable Newton method for 0 ∈ Ãv − l̃ + ∂Ψ(v), Ψ(v) = Σ c_i j(v_i).

Ψ is separable: a bundle kept per node is the law's own exact one-dimensional pieces. One step
  1. rests the nodes whose one-sided slopes hold them on an up-jump (left ≤ 0 ≤ right),
  2. solves Newton's equations on the pieces of all others (falls of b lifted until positive definite),
  3. goes along that direction, each node stopping on the first up-jump it would cross, and accepts by Armijo's
     rule on the exact energy difference; if the path gives no decrease within a few halvings,
  4. minimises node by node along the descending one-sided slopes, which always lowers the energy.
Every accepted step lowers L̃, so no iterate returns and cycles are impossible. A point at which no node descends is
first-order stationary in every direction, because L̃′(v; d) is the sum of the nodes' one-sided slopes.

What counts as a solution: ξ_i/c_i ∈ b̂(v_i) *and* left_i ≤ 0 ≤ right_i at every node. On an up-jump and inside a piece
both say the same. On a down-jump (concave kink) the inclusion alone would also admit local maxima of a node's
energy; there one side always descends and the method leaves. A stationary point whose second-order test fails is
left along a direction of negative curvature. So what it finds is a local minimum (up to a singular matrix), not
every solution; solutions of other kinds are the business of path following.

Literature: Gräser & Kornhuber, J. Comput. Math. 27 (2009) 1–44 (truncated nonsmooth Newton, convex case); Bertsekas,
SIAM J. Control Optim. 20 (1982) 221–246 (projected Newton). Left out: multigrid; a rule for choosing among
several local minima (start from more than one point instead).
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from tcstudy.solve.newton_system import NotPositiveDefiniteError, factorise
from tcstudy.solve.node_descent import descend_nodes
from tcstudy.solve.nodal_pieces import Slopes, energy_change, next_up_jump, relative_residual, slopes
from tcstudy.solve.outcome import Outcome, Status
from tcstudy.solve.problem import ContactProblem

Array = NDArray[np.float64]


@dataclass(frozen=True)
class SeparableState:
    """One iterate.

    v, xi:          displacements [m] and nodal friction forces ξ = l̃ − Ãv [N/m], (m,)
    slopes:         one-sided slopes at v
    residual:       max |descending slope|/c over the scale of b: zero at a first-order stationary point
    f:              L̃(v) [J/m]
    moved:          what the last step was, one word for the log
    evaluations, factorisations: work so far
    stopped:        (status, reason) if the last step could not be made
    """

    v: Array
    xi: Array
    slopes: Slopes
    residual: float
    f: float
    moved: str = "start"
    evaluations: int = 1
    factorisations: int = 0
    stopped: tuple[Status, str] | None = None


@dataclass(frozen=True)
class SeparableNewton:
    """Options of the separable Newton method; a Method for tcstudy.solve.loop.iterate.

    tolerance:      largest accepted residual, relative to the scale of b
    max_iterations: steps before giving up
    armijo:         fraction of the first-order decrease that a step must realise
    halvings:       step lengths 1, ½, ¼ … tried before going node by node
    lifts:          halvings of the steepest fall before all falls are lifted to zero
    """

    tolerance: float = 1e-12
    max_iterations: int = 300
    armijo: float = 1e-4
    halvings: int = 4
    lifts: int = 2

    def start(self, problem: ContactProblem, x0: Array) -> SeparableState:
        """State at x0."""
        return _state(problem, x0, problem.xi(x0))

    def step(self, problem: ContactProblem, state: SeparableState) -> SeparableState:
        """One Newton step along the clipped path, or one pass node by node."""
        at_rest = state.slopes.at_rest
        free = np.flatnonzero(~at_rest)
        side = state.slopes.descent <= 0.0
        piece = np.where(side, problem.law.piece(state.v, +1), problem.law.piece(state.v, -1))
        q = problem.law.slope(state.v[free], piece[free])
        try:
            system = factorise(problem, free, q, self.lifts)
        except NotPositiveDefiniteError:
            return replace(state, stopped=(Status.NOT_POSITIVE_DEFINITE, _NOT_POSITIVE_DEFINITE))
        state = replace(state, factorisations=state.factorisations + system.factorisations)
        direction = np.zeros(problem.m)
        direction[free] = -system.solve(state.slopes.descent[free])
        direction = _descending(state.slopes, direction)
        return self._along(problem, state, direction) or self._node_by_node(problem, state)

    def _along(self, problem: ContactProblem, state: SeparableState, direction: Array) -> SeparableState | None:
        """The first of the step lengths 1, ½, ¼ … on the clipped path that satisfies Armijo's rule, else None."""
        stop = next_up_jump(problem.law, state.v, direction)
        slope = np.where(direction > 0.0, state.slopes.right, state.slopes.left)
        for halving in range(self.halvings + 1):
            target = state.v + 0.5**halving * direction
            clipped = np.where(direction > 0.0, target >= stop, target <= stop) & (direction != 0.0)
            target = np.where(clipped, stop, target)
            step = target - state.v
            A_step = problem.A_tilde @ step
            change = energy_change(problem, state.v, state.xi, step, A_step)
            state = replace(state, evaluations=state.evaluations + 1)
            if change < 0.0 and change <= -self.armijo * abs(float(slope @ step)):
                return _moved(problem, state, target, f"newton/{2**halving}")
        return None

    def _node_by_node(self, problem: ContactProblem, state: SeparableState) -> SeparableState:
        """One pass of one-dimensional minimisations over the descending nodes."""
        target = descend_nodes(problem, state.v, state.xi, state.slopes.descent)
        if np.array_equal(target, state.v):
            return replace(state, stopped=(Status.STALLED, _STALLED))
        return _moved(problem, state, target, "nodes")

    def verdict(self, problem: ContactProblem, state: SeparableState) -> tuple[Status, str] | None:
        """Converged when no node descends by more than the tolerance."""
        if not np.isfinite(state.residual):
            return Status.NOT_FINITE, _NOT_FINITE
        if state.residual <= self.tolerance:
            return Status.CONVERGED, "no node descends and the inclusion holds"
        return state.stopped

    def outcome(
        self, problem: ContactProblem, state: SeparableState, status: Status, reason: str, iterations: int
    ) -> Outcome:
        """Pack the state; `accuracy` is the inclusion residual."""
        accuracy = relative_residual(problem, state.v)
        return Outcome(
            state.v, state.f, status, reason, iterations, state.evaluations, state.factorisations, accuracy
        )

    def line(self, state: SeparableState, iteration: int) -> str:
        """One aligned log line."""
        rest = int(np.count_nonzero(state.slopes.at_rest))
        return (
            f"{iteration:4d}  L = {state.f: .12e}  residual = {state.residual:.2e}  at rest = {rest:5d}  "
            f"factorisations = {state.factorisations:3d}  {state.moved}"
        )
_NOT_FINITE = "n"; _STALLED="s"; _NOT_POSITIVE_DEFINITE="p"

def _state(problem: ContactProblem, v: Array, xi: Array) -> SeparableState:
    """State at v with nodal forces ξ."""
    s = slopes(problem, v, xi)
    worst = float(np.max(np.abs(s.descent) / problem.c, initial=0.0))
    scale = problem.traction_scale
    residual = worst / scale if scale > 0.0 else (0.0 if worst == 0.0 else float("inf"))
    f = float(-0.5 * v @ (xi + problem.l_tilde) + problem.c @ problem.law.j(v))
    return SeparableState(v, xi, s, residual, f)


def _moved(problem: ContactProblem, state: SeparableState, v: Array, how: str) -> SeparableState:
    """State at the accepted point v."""
    new = _state(problem, v, problem.xi(v))
    return replace(new, moved=how, evaluations=state.evaluations + 1, factorisations=state.factorisations)


def _descending(s: Slopes, direction: Array) -> Array:
    """The direction without the nodes that would leave a jump uphill."""
    toward = np.where(direction > 0.0, s.right, -s.left)
    return np.where(s.at_jump & (toward > 0.0), 0.0, direction)
