"""Points whose friction knows the pressure, as answers that the record of a block is made of.

There is no energy, so that nothing is said of minima; a solution is unique where the contraction of
its pressures is proved (contact/pressure_friction.py).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from tcstudy.contact.certificates import Certificate
from tcstudy.contact.pressure_friction import PressureFriction, solve_with_pressure
from tcstudy.contact.problem import ContactProblem, Status
from tcstudy.contact.solution import Acceptance
from tcstudy.contact.solve import Answer
from tcstudy.laws.laws import Laws
from tcstudy.scene.solver_plan import NEIGHBOUR, START_NAMES, ZERO

Array = NDArray[np.float64]
NAN = float("nan")


def pressed_answer(
    problem: ContactProblem,
    friction: PressureFriction,
    tolerance: float | None,
    neighbour: Array | None,
) -> tuple[Answer, Laws, float]:
    """Return the answer of a point, the laws of its unknowns there, and the contraction κ.

    problem:   with the bonds that do not know the pressure
    neighbour: (m,) a state to start from, if there is one [m]
    """
    solved = solve_with_pressure(problem, friction, tolerance, neighbour)
    laws = friction.laws_with(problem.law, problem.m, solved.strengths)
    with_friction = ContactProblem.on(problem.body, problem.l_tilde, laws)
    rounding = float(with_friction.xi_rounding(solved.v))
    is_solved = solved.status == Status.CONVERGED
    certificate = Certificate(
        residual=solved.inclusion_residual,
        lambda_1=NAN,
        lambda_1_error=problem.A_error,
        omega=NAN,
        margin=NAN,
        convex=False,
        unique=solved.unique,
        strict_minimum=False,
        global_minimum=False,
        energy_gap=NAN,
    )
    answer = Answer(
        v=solved.v,
        v_low=np.zeros(problem.m),
        xi=solved.xi,
        inclusion_residual=solved.inclusion_residual,
        rounding=rounding,
        limited=is_solved and solved.inclusion_residual > Acceptance(tolerance).aim,
        energy=NAN,
        status=solved.status,
        reason=solved.reason,
        start=ZERO if neighbour is None else NEIGHBOUR,
        energies=np.full(len(START_NAMES), NAN),
        iterations=solved.steps,
        evaluations=solved.steps,
        certificate=certificate,
    )
    return answer, laws, solved.contraction
