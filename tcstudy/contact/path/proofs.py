"""Which of the lowest solutions of a path are proved to be global minima, many at once.

One solution v is certified by Ã − C diag(D + μ) ≻ 0 (contact/certificates.py). For a group the largest D of every
node decides for all, and if the smallest D fails none is certified; a group that is neither is halved. So the tests
follow the few places along the path where the answer changes, not the pieces.

What D is on a group costs two evaluations for every node and piece of its graph: as long as a node stays on one
segment of slope q, with G(s) = j extended from the segment − j(s),
    D = −q + sup over s of 2 G(s)/(s − v)²,
which on either side is largest at one end of the way that v has gone; on an up-jump D is affine in ζ for every s,
growing with it on the right and falling on the left. The box of all solutions is that of all loads of the group.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.linalg
from numpy.typing import NDArray

from tcstudy.contact.bounds import bends_by_side, solution_box
from tcstudy.contact.certificates import positive_definite, uniqueness_margin
from tcstudy.contact.path.problem import ParametricProblem
from tcstudy.contact.path.query import Lowest
from tcstudy.contact.path.record import Path
from tcstudy.contact.problem import MARGIN, ContactProblem
from tcstudy.scene.study import Acceptance

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]

STIFF = 1e6
"""Stiffness of a node whose box is a point, relative to the largest stiffness per length of the body."""


@dataclass(frozen=True)
class States:
    """Solutions of one problem at growing t: t (n,), v (n, m), zeta ∈ b̂(v) nearest to ξ/c (n, m), codes (n, m)."""

    problem: ParametricProblem
    t: Array
    v: Array
    zeta: Array
    codes: NDArray[np.int32]


def proved_minima(path: Path, low: Lowest, lambda_1: float, acceptance: Acceptance) -> Flags:
    """(n,) whether the lowest solution in the middle of every interval is proved to have the least energy of all.

    lambda_1: λ_min(C^{−½}ÃC^{−½}) [Pa/m];  acceptance: which residual makes a solution
    """
    if not len(low.piece):
        return np.zeros(0, dtype=bool)
    states, solved = _middles(path, low, acceptance)
    if uniqueness_margin(path.problem.at(0.0), lambda_1) > MARGIN * lambda_1:
        return solved
    return solved & _certified(states, lambda_1)


def _middles(path: Path, low: Lowest, acceptance: Acceptance) -> tuple[States, Flags]:
    """The solutions in the middle of the intervals, and which of them are exact enough to be solutions."""
    p = path.problem
    t, k = 0.5 * (low.begin + low.end), low.piece
    share = (t - path.t[k]) / (path.t[k + 1] - path.t[k])
    v = path.u[k] + share[:, None] * (path.u[k + 1] - path.u[k])
    traction = (p.l_0 + t[:, None] * p.l_1 - v @ p.A_tilde) / p.c
    zeta = np.clip(traction, *p.law.interval(v))
    residual = np.max(np.abs(traction - zeta), axis=1) / p.traction_scale
    solved = residual <= acceptance.aim
    for i in np.flatnonzero(~solved):
        solved[i] = acceptance.accepts(float(residual[i]), p.xi_rounding(float(t[i]), v[i]))
    return States(p, t, v, zeta, path.codes[k]), solved


def _certified(states: States, lambda_1: float) -> Flags:
    """Halving: a group is settled as a whole where its largest D passes or its smallest fails."""
    inverse = np.asarray(scipy.linalg.inv(states.problem.A_tilde))
    certified = np.zeros(len(states.t), dtype=bool)
    groups = [(0, len(states.t))]
    while groups:
        first, last = groups.pop()
        group = slice(first, last)
        problem = states.problem.at(float(states.t[first]))
        least, largest = _bends(states, group, lambda_1, inverse)
        if _passes(problem, largest, lambda_1):
            certified[group] = True
        elif last - first > 1 and _passes(problem, least, lambda_1):
            middle = (first + last) // 2
            groups += [(first, middle), (middle, last)]
    return certified


def _passes(problem: ContactProblem, bend: Array, lambda_1: float) -> bool:
    """Whether Ã − C diag(D + μ) ≻ 0; a node that cannot move (D = −∞) is very stiff instead."""
    if np.any(bend == np.inf):
        return False
    stiff = STIFF * float(np.max(np.diagonal(problem.A_tilde) / problem.c))
    return positive_definite(problem, -np.maximum(bend, -stiff), lambda_1)


def _bends(states: States, group: slice, lambda_1: float, inverse: Array) -> tuple[Array, Array]:
    """(lower, upper) bounds of D over the states of a group, (m,) each."""
    problem = states.problem.at(float(states.t[group][0]))
    end = states.problem.load(float(states.t[group][-1]))[None, :]
    node, v, zeta = _stays(states, group)
    law = problem.law.of_nodes(node)
    least, largest = np.full(problem.m, np.inf), np.full(problem.m, -np.inf)
    for common in (True, False):
        low, high = solution_box(problem, lambda_1, inverse=inverse, others=end, common=common)
        sides = []
        for x, y in zip(v, zeta, strict=True):
            sides.append(bends_by_side(law, x, y, np.minimum(low[node], x), np.maximum(high[node], x)))
        (right_0, left_0), (right_1, left_1) = sides
        if common:
            lower = np.maximum(np.minimum(right_0, right_1), np.minimum(left_0, left_1))
            np.minimum.at(least, node, lower)
        else:
            np.maximum.at(largest, node, np.maximum.reduce([right_0, right_1, left_0, left_1]))
    return least, largest


def _stays(states: States, group: slice) -> tuple[NDArray[np.intp], Array, Array]:
    """The ways that nodes go on one piece of their graph within the group: node (k,), v and ζ at both ends (2, k)."""
    graph = states.problem.graph
    codes, v, zeta = (np.ascontiguousarray(x[group].T) for x in (states.codes, states.v, states.zeta))
    enters = np.ones(codes.shape, dtype=bool)
    enters[:, 1:] = codes[:, 1:] != codes[:, :-1]
    starts = np.flatnonzero(enters)
    code: NDArray[np.int32] = codes.ravel()[starts].astype(np.int32)
    ends = [np.stack([f.reduceat(x.ravel(), starts) for f in (np.minimum, np.maximum)]) for x in (v, zeta)]
    on_graph = np.stack([np.where(graph.free[code], graph.on_segment(code, x), y) for x, y in zip(*ends, strict=True)])
    return starts // codes.shape[1], ends[0], on_graph
