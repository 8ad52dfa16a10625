"""Problems whose paths are followed."""

import numpy as np
from numpy.typing import NDArray

from tcstudy.contact.path.follow import Follower, ParametricProblem, Path
from tcstudy.contact.solve import nearest_minimum
from tcstudy.laws.laws import Laws
from tests.contact import contact_cases as cases

Array = NDArray[np.float64]


def follow(
    problem: ParametricProblem, v: Array, t: float, t_min: float = -np.inf, t_max: float = np.inf
) -> Path:
    """The path through the solution v of parameter t in both directions."""
    return Follower(t_min=t_min, t_max=t_max).follow(problem, v, t)


def random_path_problem(rng: np.random.Generator, m: int, max_kinks: int = 6) -> ParametricProblem:
    """A random law and stiffness with a load that does not vanish at t = 0."""
    p = cases.random_problem(rng, m, max_kinks)
    return ParametricProblem(p.A_tilde, 0.3 * rng.normal(size=m) * p.l_tilde, p.l_tilde, p.c, p.law)


def a_solution(problem: ParametricProblem, t: float) -> Array:
    """Some solution of one t."""
    return nearest_minimum(problem.at(t), np.zeros(problem.m), 1e-12)[0]


def softening_line(m: int, d: float = 0.02, mu_k: float = 0.2, seed: int = 0) -> ParametricProblem:
    """A half-plane model under slip weakening; the load rises along the line with some noise (no
    symmetry)."""
    A_tilde, c = cases.half_laplacian(m)
    x = (np.arange(m) + 0.5) / m
    noise = 0.05 * np.random.default_rng(seed).normal(size=m)
    law = cases.slip_weakening(1.0, mu_k, d)
    return ParametricProblem(A_tilde, np.zeros(m), c * (0.5 + 0.5 * x + noise), c, law)


def one_node(law: Laws, stiffness: float = 1.0) -> ParametricProblem:
    """Ã = stiffness, c = 1, l̃ = t."""
    return ParametricProblem(np.array([[stiffness]]), np.zeros(1), np.ones(1), np.ones(1), law)
