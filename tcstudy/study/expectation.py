"""The orders of convergence to expect of a computed solution, and what measured ones say beside them."""

from __future__ import annotations

import math

import numpy as np

from tcstudy.accuracy.expected import Expected, HeldEnds, expected_orders, smooth_up_to, smoothness
from tcstudy.accuracy.rates import Fit
from tcstudy.accuracy.vertices import vertices
from tcstudy.scene.records import Point, Scene, Study
from tcstudy.study.family import graded_points
from tcstudy.study.solved_levels import Solution, SolvedLevel

GAP = 2
"""Uniform refinements between a reference and the finest level that is compared with it."""
NEAR = 0.2
"""A slope within this of the expected order (or two standard errors) is as expected."""
NOTABLE = 0.1
"""Share of the largest ξ from which on ξ beside a held end decides about orders."""


def orders_to_expect(study: Study, finest: SolvedLevel, solution: Solution, scene: Scene) -> dict[str, Expected]:
    """Expected orders from the corners and from stick and slip on the finest level, or as the study gives them."""
    if study.exact is not None:
        front = solution.ok and bool(solution.sticks.any()) and not bool(solution.sticks.all())
        return expected_orders(smooth_up_to(study.exact.exponent, _held_ends(finest, solution), front))

    def sticks(edge: str, at: Point) -> bool:
        own = np.array([name == edge for name in finest.edges])
        if not solution.ok or not own.any():
            return False
        distance = np.linalg.norm(finest.mesh.points[finest.line.nodes] - np.array(at), axis=1)
        return bool(solution.sticks[np.argmin(np.where(own, distance, np.inf))])

    corners = vertices(scene.body, scene.boundary, scene.material, sticks)
    mixed = solution.ok and bool(solution.sticks.any()) and not bool(solution.sticks.all())
    graded = graded_points(study)
    return expected_orders(smoothness(corners, mixed, [_grading(corner.at, graded) for corner in corners]))


def _grading(at: Point, graded: list[tuple[Point, float]]) -> float:
    """μ of the meshes at a corner: that of the graded point which is this corner, 1 if there is none."""
    size = max((math.hypot(*point) for point, _ in graded), default=0.0)
    return next((mu for point, mu in graded if math.dist(point, at) <= 1e-6 * size), 1.0)


def _held_ends(finest: SolvedLevel, solution: Solution) -> HeldEnds:
    """What the contact nodes beside held ones do; those that carry next to no ξ make no difference."""
    if not solution.ok:
        return HeldEnds()
    held = finest.line.next_to_held & (np.abs(solution.xi) > NOTABLE * np.max(np.abs(solution.xi), initial=0.0))
    return HeldEnds(slip=bool((held & ~solution.sticks).any()), stick=bool((held & solution.sticks).any()))


def own_error(order: float) -> float:
    """How much larger than `order` the finest rate may look because the reference has an error of its own.

    Errors e_i ~ h_i^p seen as e_i − e_ref have the rate p + log₂((1 − 2^{−p(GAP+1)})/(1 − 2^{−p GAP})).
    """
    if order <= 0.0:
        return math.inf
    return math.log2((1 - 2 ** (-order * (GAP + 1))) / (1 - 2 ** (-order * GAP)))


def verdict(fitted: Fit, expected: float, nested: bool) -> str:
    """What the rates say; see data.convergence.VERDICTS."""
    if fitted.exact:
        return "exact"
    if np.count_nonzero(np.isfinite(fitted.rates)) < 2:
        return "too_few_levels"
    if not fitted.settled:
        return "pre_asymptotic"
    margin = max(NEAR, 2 * fitted.standard_error if math.isfinite(fitted.standard_error) else 0.0)
    if -margin <= fitted.slope - expected <= margin + (own_error(expected) if nested else 0.0):
        return "as_expected"
    return "faster" if fitted.slope > expected else "slower"
