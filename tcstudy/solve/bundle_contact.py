"""The condensed contact problem as an oracle of the bundle-Newton method.

f(v) = L̃(v) = ½vᵀÃv − l̃ᵀv + Σc_i j(v_i),   g(v) = Ãv − l̃ + c b(v),   G(v) = Ã + diag(c b′(v))
with the right limits of b and b′ at a kink: one selection of ∂L̃(v).

Literature: Šestak & Jovanović, Appl. Math. Mech. 31 (2010), §3 (condensation, eqs. 20, 21);
            Lukšan & Vlček, Math. Programming 83 (1998) 373–391 (the method)

A node that slips is smooth and costs nothing; every sticking node is a direction in which L̃ is nonsmooth and
needs a subgradient of its own, so iterations grow with the number of sticking nodes. The separable structure of
Ψ is deliberately not used here.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from tcstudy.solve.bundle_newton import BundleNewton
from tcstudy.solve.bundle_state import Oracle
from tcstudy.solve.loop import iterate
from tcstudy.solve.outcome import Outcome
from tcstudy.solve.problem import ContactProblem

Array = NDArray[np.float64]


def contact_oracle(problem: ContactProblem) -> Oracle:
    """v (m,) [m] → L̃(v) [J/m], one g ∈ ∂L̃(v) (m,) [N/m], G (m, m) [Pa]."""
    law, c, A_tilde = problem.law, problem.c, problem.A_tilde

    def oracle(v: Array) -> tuple[float, Array, Array]:
        piece = law.piece(v)
        g = A_tilde @ v - problem.l_tilde + c * law.value(v, piece)
        return problem.energy(v), g, A_tilde + np.diag(c * law.slope(v, piece))

    return oracle


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
) -> Outcome:
    """Run the method on the contact problem from x0 (m,) [m]; log gets one line an iteration."""
    method = contact_method(problem)
    if max_iterations is not None:
        method = replace(method, max_iterations=max_iterations)
    return iterate(method, contact_oracle(problem), x0, log)
