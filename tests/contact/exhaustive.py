"""Small contact problems with piecewise-linear laws, their energies from the numbers of the pieces,
their least energy.

All solutions are those of `random_polygons`: every piece and kink of every node is tried.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from tcstudy.contact.certificates import Certificate, certify
from tcstudy.contact.problem import ContactProblem
from tcstudy.contact.solve import solve_contact
from tcstudy.laws.laws import Laws
from tcstudy.scene.solver_plan import ESCAPE
from tests.benchmarks.cases import down_jumps, up_jumps
from tests.contact import contact_cases as cases
from tests.contact.random_polygons import by_brute_force

Array = NDArray[np.float64]


def primitive(law: Laws, s: Array) -> Array:
    """∫₀ˢ b by adding the trapezia of all pieces between 0 and s (exact for linear pieces)."""
    low, high, total = np.minimum(s, 0.0), np.maximum(s, 0.0), np.zeros_like(s)
    ends = [-np.inf, *law.kinks, np.inf]
    for piece in range(len(law.q)):
        x, y = np.clip(ends[piece], low, high), np.clip(ends[piece + 1], low, high)
        middle = 0.5 * (x - law.s_0[piece]) + 0.5 * (y - law.s_0[piece])
        total = total + (y - x) * (law.b_0[piece] + law.q[piece] * middle)
    return np.sign(s) * total


def energy(problem: ContactProblem, v: Array) -> Array:
    """L̃ from `primitive` at the points v (…, m)."""
    quadratic = 0.5 * np.sum(v * (v @ problem.A_tilde), axis=-1) - np.sum(
        v * problem.l_tilde, axis=-1
    )
    laws = (problem.law.single(i) for i in range(problem.m))
    friction = [
        c * primitive(law, x)
        for law, x, c in zip(laws, np.moveaxis(v, -1, 0), problem.c, strict=True)
    ]
    return np.asarray(quadratic + np.sum(friction, axis=0))


def least_energy(problem: ContactProblem) -> float:
    """The least energy of all: that of the lowest stationary point that is on pieces and up-jumps
    alone.

    A minimum never sits on a down-jump, and a kink without a jump belongs to its pieces.
    """
    v, _, _ = by_brute_force(problem, minima=True)
    return float(np.min(energy(problem, v)))


def is_strict_minimum(problem: ContactProblem, v: Array, rng: np.random.Generator) -> bool:
    """Whether 4,000 points on each of two small spheres around v all have a larger energy.

    Half of them move the nodes off the kinks only: with nodes at rest the directions of descent of
    a saddle form a wedge too narrow to be hit otherwise.
    """
    step = rng.normal(size=(4000, problem.m))
    step[::2] *= ~np.isin(v, problem.law.kinks)
    step = step[np.any(step != 0.0, axis=1)]
    step /= np.linalg.norm(step, axis=1, keepdims=True)
    point = v.astype(
        np.longdouble
    )  # soft bodies: the difference is below the rounding of both energies
    here, length = energy(problem, point), max(1.0, float(np.max(np.abs(v))))
    return all(
        bool(np.all(energy(problem, point + radius * length * step) > here))
        for radius in (1e-6, 3e-7)
    )


def small_problem(seed: int, m: int) -> ContactProblem:
    """Soft bodies, so that a node has several wells: down-jumps, slip weakening, up-jumps or a
    random law."""
    rng = np.random.default_rng([seed, m, 5])
    A_tilde, c = cases.half_laplacian(m, rng.choice([0.05, 0.15, 0.4, 1.0]))
    laws = (
        down_jumps(rng.uniform(0.2, 0.9), 1, 10.0 ** rng.uniform(-1.5, -0.3)),
        cases.slip_weakening(1.0, rng.uniform(0.1, 0.7), 10.0 ** rng.uniform(-1.5, 0.0)),
        up_jumps(rng.uniform(0.3, 0.95), 1, 0.3),
        cases.random_law(rng, cases.least_eigenvalue(A_tilde, c), 3),
    )
    law = laws[seed % 4]
    x = (np.arange(m) + 0.5) / m
    waves = (rng.normal() / k * np.sin(np.pi * k * x + rng.uniform(0, 6)) for k in range(1, 4))
    shape = rng.normal() + sum(waves) + 0.1 * rng.normal(size=m)
    return ContactProblem(
        A_tilde, c * shape * rng.uniform(0.7, 2.0) * law.b_scale / np.abs(shape).max(), c, law
    )


PLACES = {1: 30, 2: 16, 3: 10, 4: 7, 5: 5, 6: 4, 7: 3, 8: 3}
"""Most pieces and up-jumps that a law of `any_problem` has with m nodes, so that at most 6,561
choices are tried."""


def any_law(rng: np.random.Generator, places: int) -> Laws:
    """Any law that grows as (15) asks for: it may push the slip on, be odd or not, jump and fall as
    it likes."""
    while True:
        odd = bool(rng.random() < 0.3)
        s = np.cumsum(rng.uniform(0.02, 1.0, rng.integers(1, 9)) * 10.0 ** rng.uniform(-1.0, 0.5))
        s = s - (s[0] if odd else rng.uniform(-0.5, 1.5) * s[-1])
        left = rng.normal(size=len(s)) + rng.choice([0.0, 1.0]) * np.sign(s)
        right = np.where(rng.random(len(s)) < 0.4, rng.normal(size=len(s)), left)
        steep = np.where(rng.random(2) < 0.5, 0.0, 10.0 ** rng.uniform(-1.0, 1.0, 2))
        if odd:
            right[0] = abs(left[0]) * rng.integers(0, 2)
            left[0] = -right[0]
        left[0], right[-1] = (left[0] if odd else -abs(left[0])), abs(right[-1])
        kinks = [*-s[:0:-1], *s] if odd else list(s)
        low = [*-right[:0:-1], *left] if odd else list(left)
        high = [*-left[:0:-1], *right] if odd else list(right)
        law = cases.linear_law("any", kinks, low, high, (steep[int(odd)], steep[1]))
        if len(law.q) + np.count_nonzero(law.b_right > law.b_left) <= places:
            law.check_growth()
            return law


def any_problem(seed: int, m: int) -> ContactProblem:
    """Any law on a body that is soft or stiff, an elastic line or a random matrix, neighbours
    coupled either way."""
    rng = np.random.default_rng([seed, m, 7])
    law = any_law(rng, PLACES[m])
    A_tilde, c = cases.random_stiffness(rng, m)
    if rng.random() < 0.3:
        factor = rng.normal(size=(m, m))
        A_tilde = c.mean() * (factor @ factor.T / m + 10.0 ** rng.uniform(-2.0, 0.0) * np.eye(m))
    A_tilde = A_tilde * 10.0 ** rng.uniform(-2.5, 0.5)
    load = rng.normal() + rng.choice([0.1, 1.0]) * rng.normal(size=m)
    return ContactProblem(A_tilde, c * load * 10.0 ** rng.uniform(-2.0, 0.5) * law.b_scale, c, law)


class Search(NamedTuple):
    """Of one `any_problem`: whether it is solved, has the least energy of all, has it without the
    search for less, and certificates that the enumeration or the sampling refutes."""

    solved: bool
    found: bool
    plain: bool
    contradicted: tuple[str, ...]


def search(seed: int, m: int) -> Search:
    """The default solver and its certificates on one `any_problem`."""
    problem = any_problem(seed, m)
    least = least_energy(problem)
    answer = solve_contact(problem)
    certificate = certify(problem, answer.v)
    above = least + 1e-10 * (abs(least) + float(problem.c @ np.abs(problem.law.j(answer.v))))
    found, plain = answer.energy <= above, float(np.nanmin(answer.energies[:ESCAPE])) <= above
    strict = not certificate.strict_minimum or is_strict_minimum(
        problem, answer.v, np.random.default_rng(seed)
    )
    wrong = {
        "unique": certificate.unique and not found,
        "global_minimum": certificate.global_minimum
        and answer.energy > above + certificate.energy_gap,
        "strict_minimum": not strict,
    }
    return Search(not answer.reason, found, plain, tuple(name for name in wrong if wrong[name]))


class Comparison(NamedTuple):
    """One solution of a small problem, its certificate and the truth."""

    certificate: Certificate
    solutions: int
    above_least: float
    strict: bool


def compare(seed: int, m: int, max_kinks: int) -> list[Comparison]:
    """Certificates of all solutions of one random small problem beside the exhaustive search."""
    rng = np.random.default_rng([seed, m])
    A_tilde, c = cases.half_laplacian(m)
    law = cases.random_law(
        rng, cases.least_eigenvalue(A_tilde, c) * rng.choice([0.03, 0.1, 1.0]), max_kinks
    )
    if rng.random() < 0.5:
        law = cases.slip_weakening(1.0, 0.5, 10.0 ** rng.uniform(-1.5, 0.0))
    load = (
        c
        * law.b_scale
        * (rng.choice([-1.0, 1.0]) * rng.uniform(0.3, 1.3) + 0.2 * rng.normal(size=m))
    )
    problem = ContactProblem(A_tilde, load, c, law)
    solutions, _, _ = by_brute_force(problem)
    energies = [float(energy(problem, v)) for v in solutions]
    return [
        Comparison(
            certify(problem, v),
            len(solutions),
            e - min(energies),
            is_strict_minimum(problem, v, rng),
        )
        for v, e in zip(solutions, energies, strict=True)
    ]


def hit_rates(comparisons: list[Comparison]) -> dict[str, float]:
    """Share of what is true that was certified: unique, global minimum, strict minimum."""

    def share(flags: list[bool]) -> float:
        return float(np.mean(flags)) if flags else float("nan")

    return {
        "unique": share([x.certificate.unique for x in comparisons if x.solutions == 1]),
        "global_minimum": share(
            [x.certificate.global_minimum for x in comparisons if x.above_least <= 1e-12]
        ),
        "strict_minimum": share([x.certificate.strict_minimum for x in comparisons if x.strict]),
    }
