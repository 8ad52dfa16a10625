"""Two-double arithmetic, and what is stated of an inclusion residual, against exact rational
arithmetic."""

from decimal import Decimal, localcontext
from fractions import Fraction

import numpy as np
from numpy.typing import NDArray

from tcstudy.contact.extended import extended_residual, friction_defect, two_product, two_sum
from tcstudy.contact.problem import ContactProblem
from tcstudy.contact.solve import solve_contact
from tcstudy.laws.laws import Laws
from tcstudy.laws.shapes import piecewise_linear
from tests.contact.contact_cases import ill_conditioned

Array = NDArray[np.float64]


def random_problem(rng: np.random.Generator) -> ContactProblem:
    """One to eight nodes, one law of one to five points."""
    m, unit = int(rng.integers(1, 9)), 10.0 ** rng.uniform(-6.0, 6.0)
    A_tilde = unit * (
        np.diag(10.0 ** rng.uniform(-4.0, 1.0, m))
        if rng.random() < 0.3
        else ill_conditioned(rng, m, 1e4)
    )
    c = 10.0 ** rng.uniform(-2.0, 1.0, m)
    stiff = float(np.max(np.diagonal(A_tilde) / c))
    length, count = 10.0 ** rng.uniform(-3.0, 3.0), int(rng.integers(1, 6))
    s = np.sort(length * rng.choice(np.linspace(-1.0, 1.0, 9), count, replace=False)).tolist()
    slopes = np.where(
        rng.random(count + 1) < 0.3, 0.0, stiff * 10.0 ** rng.uniform(-12.0, 12.0, count + 1)
    )
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
    law, whole, worst = (
        problem.law.single(0),
        [Fraction(x) + Fraction(y) for x, y in zip(v, v_low, strict=True)],
        0,
    )
    kinks, forces = [Fraction(s) for s in law.kinks], []
    for row, load, length, s in zip(
        problem.A_tilde, problem.l_tilde, problem.c, whole, strict=True
    ):
        traction = (
            Fraction(load) - sum(Fraction(a) * x for a, x in zip(row, whole, strict=True))
        ) / Fraction(length)
        forces.append(max(abs(traction), abs(Fraction(load) / Fraction(length))))
        first = sum(s > kink for kink in kinks)
        sides = [_value(law, k, s) for k in {first, first + (s in kinks)}]
        worst = max(worst, min(sides) - traction, traction - max(sides))
    return float(worst / (Fraction(law.b_scale) or max(forces))) if worst else 0.0


def _value(law: Laws, k: int, s: Fraction) -> Fraction:
    return Fraction(law.b_0[k]) + Fraction(law.q[k]) * (s - Fraction(law.s_0[k]))


def test_sums_and_products_are_free_of_error() -> None:
    rng = np.random.default_rng(3)
    a, b = rng.normal(size=(2, 200)) * 10.0 ** rng.integers(-60, 60, (2, 200))
    for x, y, *parts in zip(a, b, *two_sum(a, b), *two_product(a, b), strict=True):
        high, low, product, rest = map(Fraction, parts)
        assert high + low == Fraction(x) + Fraction(y)
        assert product + rest == Fraction(x) * Fraction(y)
    empty = np.zeros(0)
    assert len(extended_residual(empty, np.zeros((0, 0)), empty, empty)[0]) == 0


def test_no_residual_is_understated() -> None:
    """Slopes 1e-12 to 1e12 times the stiffness of a node; loads, lengths and units that fit one
    another or clash."""
    for seed in (
        *range(10),
        *range(11, 19),
    ):  # 10 and 19 take three quarters of the time and are as 13 and 6
        problem = random_problem(np.random.default_rng(seed))
        answer = solve_contact(problem)
        exact = exact_residual(problem, answer.v, answer.v_low)
        assert exact <= (1.0 + 1e-12) * answer.inclusion_residual, seed


def test_exponentials_state_their_rounding() -> None:
    """c b(v) − ξ of a decay against the same in 50 digits."""
    s_0, b_0, a, r = 0.1, 0.2, 0.8, 7.0
    v, xi, length = np.linspace(0.2, 3.0, 50), np.linspace(0.0, 1.0, 50), 0.3
    numbers = tuple(np.full(50, x) for x in (s_0, b_0, 0.0, a, r))
    found, error = friction_defect(numbers, np.full(50, length), (v, 1e-18 * v), (xi, 0.0 * xi))
    with localcontext() as context:
        context.prec = 50
        for s, load, given, slack in zip(v, xi, found, error, strict=True):
            apart = Decimal(s) + Decimal(1e-18 * s) - Decimal(s_0)
            exact = Decimal(length) * (
                Decimal(b_0) + Decimal(a) * (-Decimal(r) * apart).exp()
            ) - Decimal(load)
            assert abs(Decimal(given) - exact) <= Decimal(slack + 1e-16 * abs(given))
