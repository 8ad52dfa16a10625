"""Where a path starts: the pieces on which a given solution sits, and the two ways that lead away from it."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tcstudy.scene.friction import BEND
from tcstudy.solvers.path.base import SingularCellError
from tcstudy.solvers.path.problem import ParametricProblem, law_graph
from tcstudy.solvers.path.vertex import Corner, along_perturbation, corner, move, place
from tcstudy.solvers.path.walk import Codes, Units, Walk

Array = NDArray[np.float64]

NEAR = 1e-8
"""A given solution may miss the exact one by this much, relative to slip and traction; it is corrected."""


class NoSolutionError(ValueError):
    """The given point is no solution at the given t."""


def locate(problem: ParametricProblem, units: Units, v: Array, t: float) -> Walk:
    """A walk at the solution v of parameter t, corrected to rounding.

    Raises NoSolutionError if no solution lies within NEAR of v.
    """
    codes = _codes(problem, units, v, t)
    graph = law_graph(problem.law)
    xi = (problem.load(t) - problem.A_tilde @ v) / units.stiffness
    for _ in range(20):
        free = graph.free[codes]
        x = np.where(free, v, xi)
        walk = Walk(problem, units, codes, x, t)
        with suppress(SingularCellError):  # where t is at rest no correction at fixed t exists
            for _ in range(3):
                walk.refine(None)
        outside = (walk.x < walk.low) | (walk.x > walk.high)
        outside &= walk.gaps() < -walk.tie
        if not np.any(outside):
            break
        after = np.where(walk.x > walk.high, graph.after_high[codes], graph.after_low[codes])
        codes = np.where(outside, after, codes).astype(np.int32)
    u = walk.u
    moved = np.max(np.abs(u - v) / (np.abs(u) + units.slip), initial=0.0)
    if not (moved <= 1e3 * NEAR and walk.residual() <= NEAR) or np.any(outside):
        raise NoSolutionError(
            f"the start is no solution at t = {t:g}: inclusion residual {problem.at(t).inclusion_residual(v):.1e}; "
            "solve the problem at this t first and start from its answer"
        )
    at = np.flatnonzero(walk.gaps() <= walk.tie)
    upper = walk.high[at] - walk.x[at] < walk.x[at] - walk.low[at]
    walk.x[at] = np.where(upper, walk.high[at], walk.low[at])
    return walk


def _codes(problem: ParametricProblem, units: Units, v: Array, t: float) -> Codes:
    """First guess of the pieces: on a jump where v_i is near one and ξ_i/c_i in it, else the segment of v_i."""
    law = problem.law
    codes = (2 * law.piece(v)).astype(np.int32)
    if not len(law.kinks):
        return codes
    traction = (problem.load(t) - problem.A_tilde @ v) / problem.c
    near = law.nearest_kink(v)
    on = np.abs(v - law.kinks[near]) <= NEAR * (np.abs(v) + units.slip)
    low = np.minimum(law.b_left, law.b_right)[near]
    high = np.maximum(law.b_left, law.b_right)[near]
    margin = NEAR * units.traction
    inside = (traction > low + margin) & (traction < high - margin) | (law.kinks[near] == v)
    inside &= (traction >= low - margin) & (traction <= high + margin)
    return np.where(on & inside & (law.kinds[near] != BEND), 2 * near + 1, codes).astype(np.int32)


@dataclass(frozen=True)
class Ray:
    """A way out of the start: codes, moving coordinates and direction."""

    codes: Codes
    x: Array
    dx: Array
    dt: float


def rays(walk: Walk) -> tuple[Ray, Ray]:
    """(forward, backward) ways out of the start; forward is the one along which t grows, if only one does.

    Raises SingularCellError if there is none.
    """
    at = np.flatnonzero((walk.x == walk.low) | (walk.x == walk.high))
    _any_direction(walk)
    if not len(at):
        here = _ray(walk)
        pair = here, Ray(here.codes, here.x, -here.dx, -here.dt)
    else:
        c = corner(walk, at)
        pair = _uniform(walk, c) or _perturbed(walk, c)
    return pair if pair[0].dt >= pair[1].dt else (pair[1], pair[0])


def _any_direction(walk: Walk) -> None:
    """The direction of growing t; where t stands still, that of some node."""
    try:
        move(walk, None, 1.0)
        if np.max(np.abs(walk.dx)) < 1e10 * np.max(np.abs(walk.units.load)) * len(walk.dx):
            return None
    except SingularCellError:
        pass
    for node in range(len(walk.dx)):
        try:
            return move(walk, node, 1.0)
        except SingularCellError:
            continue
    raise SingularCellError


def _ray(walk: Walk) -> Ray:
    return Ray(walk.codes.copy(), walk.x.copy(), walk.dx.copy(), walk.dt)


def _uniform(walk: Walk, c: Corner) -> tuple[Ray, Ray] | None:
    """Ways out with all tied nodes on one side: kept together, as a symmetric solution wants it."""
    found: list[Ray] = []
    for side, sign, leave in ((c.near, c.near_sign, -1.0), (c.far, c.far_sign, 1.0)):
        place(walk, c.nodes, side)
        try:
            _any_direction(walk)
        except SingularCellError:
            continue
        speeds = sign * walk.dx[c.nodes] * leave
        if np.all(speeds >= 0.0):
            found.append(_ray(walk))
        elif np.all(speeds <= 0.0):
            walk.turn(-walk.dx, -walk.dt)
            found.append(_ray(walk))
    place(walk, c.nodes, c.near)
    return (found[0], found[1]) if len(found) == 2 else None


def _perturbed(walk: Walk, c: Corner) -> tuple[Ray, Ray]:
    """Both ends of the perturbed path through the cone at the start."""
    _any_direction(walk)
    start = _ray(walk)
    along_perturbation(walk, c, resting=True)
    one = _ray(walk)
    place(walk, c.nodes, c.near)
    walk.turn(-start.dx, -start.dt)
    along_perturbation(walk, c, resting=True)
    return one, _ray(walk)


def depart(problem: ParametricProblem, units: Units, ray: Ray, t: float) -> Walk:
    """A fresh walk from the start along one ray."""
    walk = Walk(problem, units, ray.codes, ray.x, t)
    lead = int(np.argmax(np.abs(ray.dx)))
    move(walk, lead, float(ray.dx[lead]))
    return walk
