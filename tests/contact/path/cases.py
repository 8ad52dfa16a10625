"""Reference solutions for path following that share no code with it: enumeration of all combinations of pieces."""

from __future__ import annotations

from itertools import product

import numpy as np
from numpy.typing import NDArray

from tcstudy.contact.contact import nearest_minimum
from tcstudy.contact.path.follow import Follower, ParametricProblem, Path
from tcstudy.laws.laws import Laws
from tests.contact import contact_cases as cases

Array = NDArray[np.float64]


def follow(problem: ParametricProblem, v: Array, t: float, t_min: float = -np.inf, t_max: float = np.inf) -> Path:
    """The path through the solution v of parameter t in both directions."""
    return Follower(t_min=t_min, t_max=t_max).follow(problem, v, t)


def pieces_of(law: Laws) -> list[tuple[int, str]]:
    """Segments ("s", k) and vertical sides ("v", k) of the filled graph."""
    jumps = [k for k in range(len(law.kinks)) if law.kinds[k] != 0]
    return [(k, "s") for k in range(len(law.kinks) + 1)] + [(k, "v") for k in jumps]


def all_solutions(problem: ParametricProblem, t: float) -> list[tuple[Array, bool]]:
    """(v, stable) of every solution of one t: one linear system for each combination of pieces."""
    A, c = problem.A_tilde, problem.c
    laws = [problem.law.single(i) for i in range(problem.m)]
    found = []
    for combination in product(*(pieces_of(law) for law in laws)):
        free = np.array([kind == "s" for _, kind in combination])
        places = [(law, i) for law, (i, _) in zip(laws, combination, strict=True)]
        v = np.array([0.0 if f else law.kinks[i] for f, (law, i) in zip(free, places, strict=True)])
        q = np.array([law.q[i] if f else 0.0 for f, (law, i) in zip(free, places, strict=True)])
        at_0 = np.array([law.b_0[i] - law.q[i] * law.s_0[i] for law, i in places])
        H = A[np.ix_(free, free)] + np.diag((c * q)[free])
        if free.any():
            rhs = problem.load(t)[free] - (c * at_0)[free] - A[np.ix_(free, ~free)] @ v[~free]
            v[free] = np.linalg.solve(H, rhs)
        traction = (problem.load(t) - A @ v) / c
        if all(_holds(*row) for row in zip(places, free, v, traction, strict=True)):
            definite = not free.any() or np.linalg.eigvalsh(H)[0] > 0.0
            down = any(not f and law.kinds[i] < 0 for f, (law, i) in zip(free, places, strict=True))
            found.append((v, bool(definite and not down)))
    return found


def _holds(place: tuple[Laws, int], free: bool, s: float, traction: float) -> bool:
    """Whether a node is on the piece that it was put on."""
    law, i = place
    if free:
        ends = np.concatenate([[-np.inf], law.kinks, [np.inf]])
        return bool(ends[i] <= s <= ends[i + 1])
    return bool(min(law.b_left[i], law.b_right[i]) <= traction <= max(law.b_left[i], law.b_right[i]))


def random_path_problem(rng: np.random.Generator, m: int, max_kinks: int = 6) -> ParametricProblem:
    """A random law and stiffness with a load that does not vanish at t = 0."""
    p = cases.random_problem(rng, m, max_kinks)
    return ParametricProblem(p.A_tilde, 0.3 * rng.normal(size=m) * p.l_tilde, p.l_tilde, p.c, p.law)


def a_solution(problem: ParametricProblem, t: float) -> Array:
    """Some solution of one t."""
    return nearest_minimum(problem.at(t), np.zeros(problem.m), 1e-12)[0]


def softening_line(m: int, d: float = 0.02, mu_k: float = 0.2, seed: int = 0) -> ParametricProblem:
    """A half-plane model under slip weakening; the load rises along the line with some noise (no symmetry)."""
    A_tilde, c = cases.half_laplacian(m)
    x = (np.arange(m) + 0.5) / m
    noise = 0.05 * np.random.default_rng(seed).normal(size=m)
    law = cases.slip_weakening(1.0, mu_k, d)
    return ParametricProblem(A_tilde, np.zeros(m), c * (0.5 + 0.5 * x + noise), c, law)


def one_node(law: Laws, stiffness: float = 1.0) -> ParametricProblem:
    """Ã = stiffness, c = 1, l̃ = t."""
    return ParametricProblem(np.array([[stiffness]]), np.zeros(1), np.ones(1), np.ones(1), law)
