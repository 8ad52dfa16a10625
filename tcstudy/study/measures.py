"""The numbers that a study stores of one solved scene."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tcstudy.data.schema import BALANCED, HEAT_BOUND, LIMITED, MET, NOT_JUDGED, UNBALANCED
from tcstudy.scene.friction import UP, FrictionLaw
from tcstudy.solve.certificates import Certificate
from tcstudy.solve.contact import Answer
from tcstudy.solve.outcome import Status
from tcstudy.solve.problem import ContactProblem
from tcstudy.study.level import Condensed
from tcstudy.study.temperature import Temperature

Array = NDArray[np.float64]
Numbers = dict[str, float | tuple[float, ...]]


@dataclass(frozen=True)
class Timed:
    """The answer of one solver and its wall time [s]."""

    answer: Answer
    time: float


def sticking(law: FrictionLaw, v: Array) -> NDArray[np.bool_]:
    """(m,) nodes that rest on an up-jump of b."""
    if not len(law.kinks):
        return np.zeros(len(v), dtype=bool)
    near = law.nearest_kink(v)
    return (law.kinks[near] == v) & (law.kinds[near] == UP)


def friction_forces(problem: ContactProblem, answer: Answer) -> Array:
    """(m,) nodal friction forces ξ = l̃ − Ãv [N/m], and 0 where the law b ≡ 0 leaves a solution nothing but rounding.

    How far from 0 the forces of that solution are is its inclusion residual.
    """
    if problem.law.vanishes and answer.status == Status.CONVERGED:
        return np.zeros(problem.m)
    return answer.xi


def inclusion_status(answer: Answer) -> int:
    """What the inclusion residual says of a solution; nothing of a failure."""
    if answer.status != Status.CONVERGED:
        return NOT_JUDGED
    return LIMITED if answer.limited else MET


def heat_status(balance: float) -> int:
    """What the heat balance says of a temperature; NaN where there is no heat problem."""
    if np.isnan(balance):
        return NOT_JUDGED
    return BALANCED if balance <= HEAT_BOUND else UNBALANCED


def numbers(
    condensed: Condensed, solved: Sequence[Timed], temperature: Temperature | None, certificate: Certificate
) -> Numbers:
    """Results by variable name, units as in data.schema; the first of `solved` is the stored solution."""
    problem, answer = condensed.problem, solved[0].answer
    xi = friction_forces(problem, answer)
    balance = temperature.heat_balance if temperature is not None else float("nan")
    values: Numbers = {
        "energy": answer.energy + condensed.constant,
        "inclusion_residual": answer.inclusion_residual,
        "inclusion_rounding": answer.rounding,
        "inclusion_status": inclusion_status(answer),
        "iterations": answer.iterations,
        "evaluations": answer.evaluations,
        "u_T_max": float(np.max(np.abs(answer.v), initial=0.0)),
        "friction_resultant": float(xi.sum()),
        "slip_length": float(problem.c[~sticking(problem.law, answer.v)].sum()),
        "lambda_1": certificate.lambda_1,
        "omega": certificate.omega,
        "uniqueness_margin": certificate.margin,
        "unique": int(certificate.unique),
        "strict_minimum": int(certificate.strict_minimum),
        "global_minimum": int(certificate.global_minimum),
        "start_used": answer.start,
        "start_energy": tuple(energy + condensed.constant for energy in answer.energies),
        "theta_mean": temperature.mean if temperature is not None else float("nan"),
        "heat_balance": balance,
        "heat_status": heat_status(balance),
        "time_condense": condensed.time,
        "time_solve": solved[0].time,
    }
    return values | _by_solver(condensed, solved) if len(solved) > 1 else values


def _by_solver(condensed: Condensed, solved: Sequence[Timed]) -> Numbers:
    """What each solver found, and how far from the first one's solution."""
    answers = [s.answer for s in solved]
    first = answers[0].v
    scale = float(np.max(np.abs(first), initial=0.0))
    apart = [float(np.max(np.abs(a.v - first), initial=0.0)) for a in answers]
    return {
        "solver_residual": tuple(a.inclusion_residual for a in answers),
        "solver_energy": tuple(a.energy + condensed.constant for a in answers),
        "solver_iterations": tuple(a.iterations for a in answers),
        "solver_time": tuple(s.time for s in solved),
        "solver_difference": tuple(d / scale if scale > 0.0 else d for d in apart),
    }
