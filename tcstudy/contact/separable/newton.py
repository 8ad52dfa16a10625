"""Globalised separable Newton method for 0 ∈ Ãv − l̃ + ∂Ψ(v), Ψ(v) = Σ c_i j(v_i).

Ψ is separable: the bundle kept per node is the law's own exact one-dimensional pieces. One step
  1. rests the nodes whose one-sided slopes hold them on an up-jump (left ≤ 0 ≤ right),
  2. solves Newton's equations on the pieces of all others (falls of b lifted where the matrix is indefinite),
  3. goes along that direction, each node stopping on the first up-jump it would cross, and accepts by Armijo's
     rule on the exact energy difference; if the path gives no decrease within a few halvings,
  4. minimises node by node along the descending one-sided slopes, which always lowers the energy,
  5. after several steps that were shortened or node by node it goes to the minimum of a convex model (convex_step),
     by interior points: under thin layers, and where Ã is dense and badly conditioned, steps 3 and 4 settle few nodes
     at a time.
Every accepted step lowers L̃, so no iterate returns and cycles are impossible. (Only at rounding level, where L̃ can no
longer tell two points apart, is the residual the judge.) A point at which no node descends is first-order
stationary in every direction, because L̃′(v; d) is the sum of the nodes' one-sided slopes.

What counts as a solution: ξ_i/c_i ∈ b̂(v_i) *and* left_i ≤ 0 ≤ right_i at every node. On an up-jump and inside a piece
both say the same. On a down-jump (concave kink) the inclusion alone would also admit local maxima of a node's
energy; there one side always descends and the method leaves. A stationary point whose second-order test fails is
left along a direction of negative curvature. So what it finds is a local minimum (up to a singular matrix), not
every solution; solutions of other kinds are the business of path following.

Literature: Gräser & Kornhuber, J. Comput. Math. 27 (2009) 1–44 (truncated nonsmooth Newton, convex case); Bertsekas,
SIAM J. Control Optim. 20 (1982) 221–246 (projected Newton). Left out: a choice among several local minima
(start from more than one point, and search.py).

Large problems start from coarser copies of themselves (nested iteration): the Galerkin restriction to every second
contact node with linear interpolation P, Ã_c = PᵀÃP, l̃_c = Pᵀl̃, c_c = Pᵀc and those nodes' laws, is a contact problem
again and costs an eighth. The nodes are taken in the order of their numbers, along Γ_C; another order costs quality of
the start, never correctness.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import scipy.sparse
from numpy.typing import NDArray

from tcstudy.contact.loop import Outcome, Status, iterate
from tcstudy.contact.problem import ContactProblem
from tcstudy.contact.separable.descent import (
    SeparableState,
    along_path,
    escape,
    first_rest,
    moved,
    new_state,
    node_by_node,
    on_model,
    refine,
)
from tcstudy.contact.separable.pieces import IndefiniteSystem, energy_change, factorise

Array = NDArray[np.float64]

NOT_FINITE = (
    "the energy is not a finite number; check the loads, the stiffness and the law for values that are not finite "
    "or for units that overflow"
)
NOT_POSITIVE_DEFINITE = (
    "the condensed stiffness is not positive definite; the body can move freely (clamp it) or its elastic "
    "constants are wrong"
)

ITERATIONS, COARSEST = 300, 40
"""Steps before giving up; contact nodes up to which a problem has no coarser copy."""
PATIENCE = 6
"""Slow steps (shortened, node by node) before the minimum of a convex model is gone to."""


@dataclass(frozen=True)
class SeparableNewton:
    """Options of the separable Newton method; a Method for tcstudy.contact.loop.iterate.

    tolerance:      largest accepted residual, relative to the scale of b
    max_iterations: steps before giving up
    coarsest:       problems larger than this start from coarser copies of themselves where that start has the
                    lower energy and x0 is not a solution already; 0 to start from x0 always

    Outcome.accuracy is the inclusion residual; factorisations are those of the problem itself, without the coarser
    copies (together about a seventh of one each).
    """

    tolerance: float = 1e-12
    max_iterations: int = ITERATIONS
    coarsest: int = COARSEST

    def start(self, problem: ContactProblem, x0: Array) -> SeparableState:
        """State at x0 or at the coarse start."""
        state = new_state(problem, x0)
        if self.coarsest == 0 or problem.m <= self.coarsest or not state.residual > self.tolerance:
            return state
        return new_state(problem, self._coarse_start(problem, x0))

    def _coarse_start(self, problem: ContactProblem, x0: Array) -> Array:
        """x0, or the interpolated solution of the coarser problem where its energy is lower (m,)."""
        if problem.m <= self.coarsest:
            return x0
        P = interpolation(problem.m)
        A_coarse, c = galerkin(problem.A_tilde, problem.c, P)
        coarse = ContactProblem(A_coarse, P.T @ problem.l_tilde, c, problem.law.of_nodes(slice(None, None, 2)))
        start = self._coarse_start(coarse, x0[::2])
        interpolated = P @ iterate(replace(self, coarsest=0), coarse, start).x
        step = interpolated - x0
        lower = energy_change(problem, x0, problem.xi(x0), step, problem.A_tilde @ step) < 0.0
        return interpolated if lower else x0

    def step(self, problem: ContactProblem, state: SeparableState) -> SeparableState:
        """One Newton step along the clipped path, or one pass node by node, or the last refinement."""
        free = np.flatnonzero(~state.slopes.at_rest)
        q = problem.law.of_nodes(free).slope(state.v[free], state.piece[free])
        try:
            system = factorise(problem, free, q)
        except IndefiniteSystem:
            return replace(state, stopped=(Status.NOT_POSITIVE_DEFINITE, NOT_POSITIVE_DEFINITE))
        state = replace(state, factorisations=state.factorisations + system.factorisations)
        if state.residual <= self.tolerance:
            return escape(problem, state, system)
        if state.slow >= PATIENCE and not state.at_rounding:
            state = on_model(problem, state)
            if state.moved == "model" and state.slow == 0:
                return state
        moved = along_path(problem, state, system)
        if moved is not None and not (moved.at_rounding and moved.residual > self.tolerance):
            return moved
        if moved is not None and moved.second_order is not None:
            return refine(problem, moved, system, self.tolerance)
        if state.at_rounding:
            return refine(problem, state, system, self.tolerance)
        return moved if moved is not None else node_by_node(problem, state)

    def verdict(self, problem: ContactProblem, state: SeparableState) -> tuple[Status, str] | None:
        """Converged when no node descends by more than the tolerance and the second-order test was passed."""
        if not np.isfinite(state.f):
            return Status.NOT_FINITE, NOT_FINITE
        if state.residual <= self.tolerance and state.second_order is not None:
            return Status.CONVERGED, "no node descends and the inclusion holds; " + state.second_order
        return state.stopped

    def outcome(
        self, problem: ContactProblem, state: SeparableState, status: Status, reason: str, iterations: int
    ) -> Outcome:
        """Pack the state; `accuracy` is the inclusion residual."""
        accuracy = problem.inclusion_residual(state.v)
        return Outcome(state.v, state.f, status, reason, iterations, state.evaluations, state.factorisations, accuracy)

    def line(self, state: SeparableState, iteration: int) -> str:
        """One aligned log line."""
        rest = int(np.count_nonzero(state.slopes.at_rest))
        return (
            f"{iteration:4d}  L = {state.f: .12e}  residual = {state.residual:.2e}  at rest = {rest:5d}  "
            f"factorisations = {state.factorisations:3d}  {state.moved}"
        )


@dataclass(frozen=True)
class Downhill(SeparableNewton):
    """The same along ways on which the energy falls all along: to the well that is nearest downhill, over no barrier.

    Armijo's rule takes any lower point, also one behind a barrier. For laws of straight pieces.
    """

    coarsest: int = 0

    def step(self, problem: ContactProblem, state: SeparableState) -> SeparableState:
        """A step of the method, up to where the energy would rise on the straight way."""
        new = super().step(problem, state)
        if new.at_rounding:
            return new
        rest = first_rest(problem, state, new.v)
        if rest is None:
            return node_by_node(problem, state)
        return new if rest is new.v else moved(problem, new, rest, "downhill")


def interpolation(m: int) -> scipy.sparse.csr_matrix:
    """(m, ⌈m/2⌉) linear interpolation from the nodes 0, 2, 4, …"""
    coarse = (m + 1) // 2
    node = np.arange(m)
    columns = np.concatenate([node // 2, np.minimum((node + 1) // 2, coarse - 1)])
    rows = np.concatenate([node, node])
    return scipy.sparse.csr_matrix((np.full(2 * m, 0.5), (rows, columns)), shape=(m, coarse))


def galerkin(A_tilde: Array, c: Array, P: scipy.sparse.csr_matrix) -> tuple[Array, Array]:
    """(PᵀÃP, Pᵀc), the Galerkin restriction of a body to the columns of P."""
    coarse = P.T @ (P.T @ A_tilde).T
    return np.ascontiguousarray(0.5 * (coarse + coarse.T)), P.T @ c
