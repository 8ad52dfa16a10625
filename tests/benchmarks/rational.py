"""Whether the inclusion residuals that are stated hold in rational arithmetic.

Random bodies, laws of straight pieces whose slopes are 1e-12 to 1e12 times the stiffness of a node, loads, lengths and
units that fit one another or clash. Both engines solve them; the residual of v + v_low in `fractions` must be no larger
than what is stated, be the answer a solution or a failure.

    python -m tests.benchmarks.rational 2000
"""

from __future__ import annotations

import sys
from collections import Counter
from fractions import Fraction

import numpy as np
from numpy.typing import NDArray

from tcstudy.contact.block import solve_block
from tcstudy.contact.contact import solve_contact
from tcstudy.contact.problem import CondensedBody, ContactProblem
from tcstudy.contact.status import Status
from tcstudy.laws.laws import Laws
from tcstudy.laws.shapes import piecewise_linear
from tests.contact.ill_conditioned import body

Array = NDArray[np.float64]


def random_problem(rng: np.random.Generator) -> ContactProblem:
    """One to eight nodes, one law of one to five points."""
    m, unit = int(rng.integers(1, 9)), 10.0 ** rng.uniform(-6.0, 6.0)
    A_tilde = unit * (np.diag(10.0 ** rng.uniform(-4.0, 1.0, m)) if rng.random() < 0.3 else body(rng, m, 1e4))
    c = 10.0 ** rng.uniform(-2.0, 1.0, m)
    stiff = float(np.max(np.diagonal(A_tilde) / c))
    length, count = 10.0 ** rng.uniform(-3.0, 3.0), int(rng.integers(1, 6))
    s = np.sort(length * rng.choice(np.linspace(-1.0, 1.0, 9), count, replace=False)).tolist()
    slopes = np.where(rng.random(count + 1) < 0.3, 0.0, stiff * 10.0 ** rng.uniform(-12.0, 12.0, count + 1))
    b = np.cumsum([0.0, *(slopes[1:count] * np.diff(s))])
    b -= rng.choice(b) if rng.random() < 0.7 else stiff * length * rng.normal()
    points = [(at, float(value)) for at, value in zip(s, b, strict=True)]
    ends = slopes[[0, -1]]
    ends = np.where(np.array([b[0] > 0.0, b[-1] < 0.0]), np.maximum(ends, 1e-3 * stiff), ends)
    law = piecewise_linear(points, False, None, ends.tolist())
    load = A_tilde @ (length * rng.normal(size=m)) * 10.0 ** rng.choice([-8.0, -1.0, 0.0, 1.0, 3.0])
    return ContactProblem(A_tilde, load, c, law)


def exact_residual(problem: ContactProblem, v: Array, v_low: Array) -> float:
    """The inclusion residual of v + v_low in rational arithmetic."""
    law, whole, worst = problem.law.single(0), [Fraction(x) + Fraction(y) for x, y in zip(v, v_low, strict=True)], 0
    kinks, forces = [Fraction(s) for s in law.kinks], []
    for row, load, length, s in zip(problem.A_tilde, problem.l_tilde, problem.c, whole, strict=True):
        traction = (Fraction(load) - sum(Fraction(a) * x for a, x in zip(row, whole, strict=True))) / Fraction(length)
        forces.append(max(abs(traction), abs(Fraction(load) / Fraction(length))))
        first = sum(s > kink for kink in kinks)
        sides = [_value(law, k, s) for k in {first, first + (s in kinks)}]
        worst = max(worst, min(sides) - traction, traction - max(sides))
    return float(worst / (Fraction(law.b_scale) or max(forces))) if worst else 0.0


def _value(law: Laws, k: int, s: Fraction) -> Fraction:
    return Fraction(law.b_0[k]) + Fraction(law.q[k]) * (s - Fraction(law.s_0[k]))


def stated(problem: ContactProblem) -> list[tuple[str, float, float]]:
    """(engine and outcome, stated residual, the one in rational arithmetic) of both engines."""
    one = solve_contact(problem)
    laws = Laws.of([problem.law.single(0)], np.zeros((1, 1)))
    block = solve_block(CondensedBody.of(problem.A_tilde, problem.c), problem.l_tilde[None], laws)
    found = []
    for engine, v, v_low, residual, limited, status in (
        ("scalar", one.v, one.v_low, one.inclusion_residual, one.limited, one.status),
        ("block", block.v[0], block.v_low[0], block.inclusion_residual[0], block.limited[0], block.status[0]),
    ):
        outcome = "limited" if limited else "solved" if status == Status.CONVERGED else "failed"
        found.append((f"{engine} {outcome}", float(residual), exact_residual(problem, v, v_low)))
    return found


def understated(residual: float, exact: float) -> bool:
    """Whether the exact residual is larger than the stated one, beyond the last digits of both."""
    return not exact <= (1.0 + 1e-12) * residual


def main(arguments: list[str]) -> None:
    """Count outcomes and what is understated."""
    seen, count = Counter[str](), int(arguments[0]) if arguments else 2000
    for seed in range(count):
        for outcome, residual, exact in stated(random_problem(np.random.default_rng(seed))):
            seen[outcome] += 1
            if understated(residual, exact):
                seen[f"{outcome.split()[0]} understated"] += 1
                print(f"seed {seed}: {outcome}, stated {residual:.2e}, exact {exact:.2e}")
    print(dict(sorted(seen.items())))


if __name__ == "__main__":
    main(sys.argv[1:])
