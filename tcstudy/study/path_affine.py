"""A study along one parameter t: l̃(t) = l̃₀ + t l̃₁ found from two values of t and checked at two others (method: l̃ is
affine in f, g, q, θ̄ and in prescribed displacements, eq. (20) of the paper with fixed Ã)."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.polynomial import Polynomial
from numpy.typing import NDArray

from tcstudy.contact.certificates import solution_boxes
from tcstudy.contact.path.follow import Follower, ParametricProblem, Path
from tcstudy.contact.path.piecewise_linear_approximation import piecewise_linear
from tcstudy.contact.path.walk import NoSolutionError
from tcstudy.contact.problem import Status
from tcstudy.contact.solve import solve_contact
from tcstudy.errors import PathError
from tcstudy.offline.level import Level
from tcstudy.scene.records import Scene
from tcstudy.scene.study import Branch, Direction

Array = NDArray[np.float64]

AFFINE = 1e-9
"""Largest relative deviation from a straight line that counts as rounding."""


@dataclass(frozen=True)
class AffineLoad:
    """The contact problem of a level along t.

    problem:  Ã, l̃₀, l̃₁, c and the law
    defect:   largest |l̃ − l̃₀ − t l̃₁| at the values that were checked, relative to the largest |l̃|
    constant: what the total potential energy has beside L̃(u₁), eq. (20), a parabola of t [J/m]
    """

    problem: ParametricProblem
    defect: float
    constant: Polynomial


SHARES = np.array([0.0, 1.0, 0.4, 0.75])
"""Where between two values of t the load is taken: the first two give it, it is checked at the others."""


def affine_load(level: Level, scene_of: Callable[[float], Scene], begin: float, end: float, name: str) -> AffineLoad:
    """The problem of `scene_of` along t.

    begin, end: two values of t;  name: of the parameter, for messages
    Raises PathError if l̃ is not affine in t or does not depend on it.
    """
    length = end - begin
    solved = [level.condensed(scene_of(end if x == 1.0 else begin + x * length)) for x in SHARES.tolist()]
    first = solved[0].problem
    if not all(np.array_equal(first.A_tilde, one.problem.A_tilde) for one in solved):
        raise PathError(f"the stiffness changes with {name}: a path needs a parameter of the loads alone")
    loads = np.array([one.problem.l_tilde for one in solved])
    change, size = loads[1] - loads[0], float(np.max(np.abs(loads), initial=0.0))
    if np.max(np.abs(change), initial=0.0) <= 1e-13 * size:
        raise PathError(f"the load on the contact line does not depend on {name}; choose another path.parameter")
    off = float(np.max(np.abs(loads - loads[0] - SHARES[:, None] * change)))
    if off > AFFINE * size:
        raise PathError(
            f"the load is not affine in {name} (relative deviation {off / size:.1e} from a straight line), so there "
            "is no piecewise-linear path along it; use a sweep"
        )
    l_1 = change / length
    span = begin, end
    problem = ParametricProblem(first.A_tilde, loads[0] - begin * l_1, l_1, first.c, first.law, span, first.A_error)
    at_1, at_04 = (one.constant - solved[0].constant for one in solved[1:3])  # of a parabola
    k_2 = (at_1 - at_04 / 0.4) / 0.6
    constant = Polynomial([solved[0].constant, at_1 - k_2, k_2], domain=span, window=(0.0, 1.0))
    return AffineLoad(problem, off / size, constant)


def straightened(
    level: Level, scene: Scene, problem: ParametricProblem, law_error: float, within: tuple[float, float]
) -> ParametricProblem:
    """The problem with straight pieces in the place of exponential ones, as far as solutions within two t may slip."""
    if problem.law.piecewise_linear:
        return problem
    boxes = [solution_boxes(problem.at(t).rows) for t in within]
    reach = max(float(np.max(np.abs(side))) for box in boxes for side in box)
    return problem.with_law(level.law(scene.with_laws(lambda law: piecewise_linear(law, law_error, reach))))


def followed(
    problem: ParametricProblem,
    follower: Follower,
    branch: Branch,
    begin: float,
    direction: Direction,
    name: str,
    progress: Callable[[int, float], None] | None = None,
) -> tuple[Path, Array]:
    """The path from a solution at t = begin, and that (m,); branch: of `solve_contact`;  name: of t, for messages.

    Raises PathError without a solution to start from.
    """
    answer = solve_contact(problem.at(begin), tolerance=follower.tolerance, branch=branch)
    if answer.status != Status.CONVERGED:
        raise PathError(f"there is no solution to start from at {name} = {begin:g}: {answer.reason}")
    try:
        return follower.follow(problem, answer.v, begin, direction, progress), answer.v
    except NoSolutionError as error:
        raise PathError(str(error)) from error
