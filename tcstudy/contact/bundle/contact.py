"""The condensed contact problem as an oracle of the bundle-Newton method.

f(v) = L̃(v) = ½vᵀÃv − l̃ᵀv + Σc_i j(v_i),   g(v) = Ãv − l̃ + c b(v),   G(v) = Ã + diag(c b′(v))
with the right limits of b and b′ at a kink: one selection of ∂L̃(v).

Literature: Šestak & Jovanović, Appl. Math. Mech. 31 (2010), §3 (condensation, eqs. 20, 21);
            Lukšan & Vlček, Math. Programming 83 (1998) 373–391 (the method)

A node that slips is smooth and costs nothing; every sticking node is a direction in which L̃ is nonsmooth and
needs a subgradient of its own, so iterations grow with the number of sticking nodes. The separable structure of
Ψ is deliberately not used by the iteration. It is used to stop: once the predicted decrease is small, the pieces
that the nodes seem to rest on are tried (active_set.py), and where they satisfy the inclusion (21) at no higher
energy the remaining iterations, which would only add digits, are left out.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from tcstudy.contact.active_set import polished
from tcstudy.contact.bundle.newton import BundleNewton, Oracle, State
from tcstudy.contact.problem import ContactProblem
from tcstudy.contact.status import Outcome

Array = NDArray[np.float64]


def contact_oracle(problem: ContactProblem) -> Oracle:
    """v (m,) [m] → L̃(v) [J/m], one g ∈ ∂L̃(v) (m,) [N/m], the diagonal that Ã lacks of G (m,) [Pa]."""
    law, c, A_tilde = problem.law, problem.c, problem.A_tilde

    def oracle(v: Array) -> tuple[float, Array, Array]:
        piece = law.piece(v)
        g = A_tilde @ v - problem.l_tilde + c * law.value(v, piece)
        return problem.energy(v), g, c * law.slope(v, piece)

    return oracle


def solve_with_bundle(
    problem: ContactProblem,
    x0: Array,
    max_iterations: int | None = None,
    inclusion: float | None = 1e-12,
    tolerance: float = 1e-13,
    watch: Callable[[State], None] | None = None,
) -> Outcome:
    """Run the method on the contact problem from x0 (m,) [m].

    inclusion: inclusion residual to work for on the active pieces, as far as rounding allows it; None: without these
    tolerance: of the energy; the error of v and of ξ is of the order of its root
    The first length is the norm of the frictionless solution, or the law's slip scale.
    """

    def exact(x: Array, left: float) -> Array | None:
        """The point on the active pieces, if it satisfies the inclusion and only adds digits.

        Its energy must not be higher, nor lower by more than `left`: the descent is the bundle's.
        """
        end = polished(problem, x, exact=False)
        change = problem.energy_change(x, end.v)[0]
        good = end.residual <= max(inclusion or 0.0, problem.xi_rounding(end.v))
        return end.v if good and -left <= change <= 0.0 else None

    length = float(np.linalg.norm(problem.frictionless())) or problem.law.s_scale
    method = BundleNewton(tolerance, max_iterations or 2000, length or None, base=problem.A_tilde)
    return method.run(contact_oracle(problem), x0, None if inclusion is None else exact, watch)
