"""Where a path starts: the pieces on which a given solution sits."""

from __future__ import annotations

import numpy as np

from tcstudy.contact.path.basis_inverse import BasisInverse
from tcstudy.contact.path.problem import Codes, ParametricProblem
from tcstudy.contact.path.walk import Array, Walk
from tcstudy.scene.study import Acceptance

REMEMBERED = 1e-10
"""Where a node is said to go on from where two pieces meet it stands there, as exactly as a solution is accepted."""

NEAR = 1e-8
"""A given solution may miss the exact one by this much, relative to slip and traction, or by what rounding of its
residual allows if that is more; it is corrected."""


class NoSolutionError(ValueError):
    """The given point is no solution at the given t."""


def locate(
    problem: ParametricProblem, v: Array, t: float, ways: Array | None = None, basis: BasisInverse | None = None
) -> Walk:
    """A walk at the solution v of parameter t, corrected to rounding.

    ways:  (m,) sense in which nodes that stand where two pieces meet are to go along their graphs, 0 for no wish
    basis: of another walk on the same body, which this one takes over
    Raises NoSolutionError if no solution lies within NEAR of v, or as near as rounding lets v be one, and
    SingularCellError where it is in a cell without a line.
    """
    graph, m, at_t = problem.graph, problem.m, problem.at(t)
    codes, force = _codes(problem, v, t, ways), at_t.xi(v) / problem.body.stiffness
    for _ in range(20):
        walk = Walk(problem, codes, np.where(graph.free[codes], v, force), t, basis)
        basis, tie = walk.basis, walk.tie if ways is None else max(walk.tie, REMEMBERED)
        for _ in range(3 if walk.dx[m] != 0.0 else 0):  # where t is at rest no correction at fixed t exists
            walk.correct(np.array([m]))
        outside = walk.gaps() < -tie
        if not np.any(outside):
            break
        after = np.where(walk.x[:m] > walk.high[:m], graph.after_high[codes], graph.after_low[codes])
        codes = np.where(outside, after, codes)
    u, residual, rounding = walk.u, at_t.inclusion_residual(v), problem.xi_rounding(t, v)
    moved = np.max(np.abs(u - v) / (np.abs(u) + walk.slip), initial=0.0)
    missed = np.max(np.abs(walk.defect) / problem.c) / problem.traction_scale
    near = (moved <= 1e3 * NEAR or residual <= rounding) and missed <= max(NEAR, Acceptance().limit(rounding))
    if not near or np.any(outside):
        raise NoSolutionError(
            f"the start is no solution at t = {t:g}: inclusion residual {residual:.1e}; "
            "solve the problem at this t first and start from its answer"
        )
    walk.snap(np.flatnonzero(walk.gaps() <= tie))
    return walk


def _codes(problem: ParametricProblem, v: Array, t: float, ways: Array | None) -> Codes:
    """First guess of the pieces: on a jump where v_i is near one and ξ_i/c_i in it, else the segment of v_i.

    Where two pieces meet, the one in the sense of `ways`, without it that of v_i beside the kink.
    """
    law, graph = problem.law, problem.graph
    row = law.node_index(len(v))  # the graph has 2K + 1 codes where the law has K + 1 pieces
    codes = (2 * law.piece(v) - row).astype(np.int32)
    if not law.kinks.size:
        return codes
    near = law.nearest_kink(v)
    kink, (left, right) = law.kink(near), law.limits(near)
    slip, margin = problem.traction_scale * problem.c / np.diagonal(problem.A_tilde), NEAR * problem.traction_scale
    on = np.isfinite(kink) & (np.abs(v - kink) <= NEAR * (np.abs(v) + slip))
    side = np.where(on, 2 * near + 1 - row, codes).astype(np.int32)
    jumps = graph.after_high[side - 1] == side  # a side that only bends is passed over
    height = np.abs(right - left)
    along = np.sign(right - left) * (problem.at(t).xi(v) / problem.c - left)  # from 0 to the height
    way = np.sign(v - kink) if ways is None else np.where(ways < 0.0, -1.0, 1.0)
    to_left = np.where(jumps, (along < -margin) | ((along <= margin) & (way < 0.0)), way < 0.0)
    to_right = np.where(jumps, (along > height + margin) | ((along >= height - margin) & (way > 0.0)), way >= 0.0)
    return np.where(on, np.where(to_left, side - 1, np.where(to_right, side + 1, side)), codes).astype(np.int32)
