"""A study along one parameter t: l̃(t) = l̃₀ + t l̃₁ found from two values of t and checked at two others (method: l̃ is
affine in f, g, q, θ̄ and in prescribed displacements, eq. (20) of the paper with fixed Ã)."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tcstudy.contact.bounds import solution_boxes
from tcstudy.contact.contact import solve_contact
from tcstudy.contact.path.chords import piecewise_linear
from tcstudy.contact.path.follow import Follower, ParametricProblem, Path
from tcstudy.contact.path.start import NoSolutionError
from tcstudy.contact.status import Status
from tcstudy.errors import PathError
from tcstudy.offline.level import Condensed, Level
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
    origin, length, coefficients: constant(t) = k₀ + k₁ s + k₂ s² with s = (t − origin)/length [J/m]
    """

    problem: ParametricProblem
    defect: float
    origin: float
    length: float
    coefficients: tuple[float, float, float]

    def constant(self, t: Array) -> Array:
        """What the total potential energy has beside L̃(u₁), eq. (20) [J/m] (shape of t)."""
        s = (np.asarray(t, dtype=float) - self.origin) / self.length
        k_0, k_1, k_2 = self.coefficients
        return np.asarray(k_0 + s * (k_1 + s * k_2))

    def constant_rate(self, t: Array) -> Array:
        """Derivative of `constant` by t."""
        s = (np.asarray(t, dtype=float) - self.origin) / self.length
        return np.asarray((self.coefficients[1] + 2.0 * s * self.coefficients[2]) / self.length)


def affine_load(level: Level, scene_of: Callable[[float], Scene], begin: float, end: float, name: str) -> AffineLoad:
    """The problem of `scene_of` along t.

    begin, end: two values of t;  name: of the parameter, for messages
    Raises PathError if l̃ is not affine in t or does not depend on it.
    """
    length = end - begin
    shares = (0.0, 1.0, 0.4, 0.75)
    solved: list[Condensed] = []
    for share in shares:
        t = end if share == 1.0 else begin + share * length
        solved.append(level.condensed(scene_of(t)))
        if not np.array_equal(solved[0].problem.A_tilde, solved[-1].problem.A_tilde):
            raise PathError(f"the stiffness changes with {name}: a path needs a parameter of the loads alone")
    loads = [c.problem.l_tilde for c in solved]
    l_1 = (loads[1] - loads[0]) / length
    l_0 = loads[0] - begin * l_1
    size = max(float(np.max(np.abs(load), initial=0.0)) for load in loads)
    difference = float(np.max(np.abs(loads[1] - loads[0]), initial=0.0))
    if difference <= 1e-13 * size:
        raise PathError(f"the load on the contact line does not depend on {name}; choose another path.parameter")
    checked = zip(shares[2:], loads[2:], strict=True)
    off = max(float(np.max(np.abs(load - loads[0] - share * (loads[1] - loads[0])))) for share, load in checked)
    if off > AFFINE * size:
        raise PathError(
            f"the load is not affine in {name} (relative deviation {off / size:.1e} from a straight line), so there "
            "is no piecewise-linear path along it; use a sweep"
        )
    first = solved[0].problem
    problem = ParametricProblem(first.A_tilde, l_0, l_1, first.c, first.law, (begin, end), first.A_error)
    at_1, at_04 = (c.constant - solved[0].constant for c in solved[1:3])  # of a parabola
    k_2 = (at_1 - at_04 / 0.4) / 0.6
    return AffineLoad(problem, off / size, begin, length, (solved[0].constant, at_1 - k_2, k_2))


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
