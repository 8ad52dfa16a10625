"""The numbers that a study stores of one solved scene."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from tcstudy.scene.friction import UP, FrictionLaw
from tcstudy.solve.contact import Answer
from tcstudy.study.level import Condensed, Temperature

Array = NDArray[np.float64]


def sticking(law: FrictionLaw, v: Array) -> NDArray[np.bool_]:
    """(m,) nodes that rest on an up-jump of b."""
    if not len(law.kinks):
        return np.zeros(len(v), dtype=bool)
    near = law.nearest_kink(v)
    return (law.kinks[near] == v) & (law.kinds[near] == UP)


def numbers(
    condensed: Condensed,
    answer: Answer,
    temperature: Temperature | None,
    lambda_1: float,
    time_solve: float,
) -> dict[str, float]:
    """Scalars by variable name; units as in data.schema."""
    problem = condensed.problem
    xi = problem.xi(answer.v)
    omega = problem.law.omega
    return {
        "energy": answer.energy + condensed.constant,
        "inclusion_residual": answer.inclusion_residual,
        "iterations": answer.iterations,
        "evaluations": answer.evaluations,
        "u_T_max": float(np.max(np.abs(answer.v), initial=0.0)),
        "friction_resultant": float(xi.sum()),
        "slip_length": float(problem.c[~sticking(problem.law, answer.v)].sum()),
        "lambda_1": lambda_1,
        "omega": omega,
        "uniqueness_margin": lambda_1 - omega,
        "theta_mean": temperature.mean if temperature is not None else float("nan"),
        "heat_balance": temperature.heat_balance if temperature is not None else float("nan"),
        "time_condense": condensed.time,
        "time_solve": time_solve,
    }
