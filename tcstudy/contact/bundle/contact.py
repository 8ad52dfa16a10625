"""The condensed contact problem as an oracle of the bundle-Newton method.

f(v) = L̃(v) = ½vᵀÃv − l̃ᵀv + Σc_i j(v_i),   g(v) = Ãv − l̃ + c b(v),   G(v) = Ã + diag(c b′(v))
with the right limits of b and b′ at a kink: one selection of ∂L̃(v).

Literature: Šestak & Jovanović, Appl. Math. Mech. 31 (2010), §3 (condensation, eqs. 20, 21);
            Lukšan & Vlček, Math. Programming 83 (1998) 373–391 (the method)

A node that slips is smooth and costs nothing; every sticking node is a direction in which L̃ is nonsmooth and
needs a subgradient of its own, so iterations grow with the number of sticking nodes. The separable structure of
Ψ is deliberately not used by the iteration. It is used to stop: once the predicted decrease is small, the pieces
that the nodes seem to rest on are tried (finish.py), and where they satisfy the inclusion (21) at no higher
energy the remaining iterations, which would only add digits, are left out.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from tcstudy.contact.active_set import finish
from tcstudy.contact.bundle.model import DiagonalShift
from tcstudy.contact.bundle.newton import BundleNewton, Oracle, State
from tcstudy.contact.loop import Outcome, Status, iterate
from tcstudy.contact.problem import ContactProblem

Array = NDArray[np.float64]

IDENTIFY, EVERY = 1e-4, 10
"""Decrease predicted within the radius, relative to |f|, below which the active pieces are tried, and the most that
they may lower the energy by; evaluations between two trials."""


def contact_oracle(problem: ContactProblem) -> Oracle:
    """v (m,) [m] → L̃(v) [J/m], one g ∈ ∂L̃(v) (m,) [N/m], G = Ã + diag [Pa]."""
    law, c, A_tilde = problem.law, problem.c, problem.A_tilde

    def oracle(v: Array) -> tuple[float, Array, DiagonalShift]:
        piece = law.piece(v)
        g = A_tilde @ v - problem.l_tilde + c * law.value(v, piece)
        return problem.energy(v), g, DiagonalShift(A_tilde, c * law.slope(v, piece))

    return oracle


@dataclass(frozen=True)
class IdentifyingBundle(BundleNewton):
    """Bundle-Newton that ends on the exact active pieces of the contact problem as soon as they are found.

    inclusion: inclusion residual that the pieces must reach, as far as rounding allows it
    """

    contact: ContactProblem = field(kw_only=True)
    inclusion: float = field(kw_only=True)

    def identified(self, state: State) -> tuple[Array, float] | None:
        """The point on the active pieces and its residual, if it satisfies the inclusion and only adds digits.

        Its energy must not be higher, nor lower by more than IDENTIFY: the descent is the bundle's.
        """
        left = IDENTIFY * state.scale
        if state.step.decrease > left:
            return None
        v, residual = finish(self.contact, state.x)
        change = self.contact.energy_change(state.x, v)[0]
        found = residual <= max(self.inclusion, self.contact.xi_rounding(v)) and -left <= change <= 0.0
        return (v, residual) if found else None

    def verdict(self, problem: Oracle, state: State) -> tuple[Status, str] | None:
        """As bundle-Newton's, or converged on the active pieces."""
        own = super().verdict(problem, state)
        if own is None and state.evaluations % EVERY == 0:
            found = self.identified(state)
            if found is not None:
                return Status.CONVERGED, f"the active pieces satisfy the inclusion to {found[1]:.1e}"
        return own

    def outcome(self, problem: Oracle, state: State, status: Status, reason: str, iterations: int) -> Outcome:
        """The final state, on its active pieces where these were found."""
        found = self.identified(state) if status == Status.CONVERGED else None
        plain = super().outcome(problem, state, status, reason, iterations)
        return plain if found is None else replace(plain, x=found[0], f=self.contact.energy(found[0]))


def contact_method(problem: ContactProblem, tolerance: float = 1e-13, max_iterations: int = 2000) -> BundleNewton:
    """Bundle-Newton with the norm of the frictionless solution, or the law's slip scale, as the first length.

    tolerance: of the energy; the error of v and of ξ is of the order of its root
    """
    length = float(np.linalg.norm(problem.frictionless())) or problem.law.s_scale
    return BundleNewton(tolerance=tolerance, max_iterations=max_iterations, x_unit=length or None)


def solve_with_bundle(
    problem: ContactProblem,
    x0: Array,
    max_iterations: int | None = None,
    log: Callable[[str], None] | None = None,
    inclusion: float = 1e-12,
) -> Outcome:
    """Run the method on the contact problem from x0 (m,) [m]; log gets one line an iteration.

    inclusion: inclusion residual to work for
    """
    plain = contact_method(problem, max_iterations=max_iterations or 2000)
    method = IdentifyingBundle(**vars(plain), contact=problem, inclusion=inclusion)
    return iterate(method, contact_oracle(problem), x0, log)
