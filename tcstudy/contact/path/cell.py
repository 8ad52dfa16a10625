"""Cells of the piecewise-linear system: the exact segment of solutions in each, and where it goes on.

In a cell every node is on one straight piece of its graph: *free* (displacement u_i moves, force g_i = k_i u_i + const
with k_i = c_i × slope of b) or *held* (u_i fixed on a kink, force g_i moves). With x_i = u_i of a free node, g_i of a
held one, Ãu + g = l̃₀ + t l̃₁ are m equations M x − t l̃₁ = r for m + 1 coordinates (x, t): one line, cut by the ends of
the pieces. It is measured by its largest coordinate, so that folds and upright pieces are no special case.

Sources: Cottle, Pang & Stone, The Linear Complementarity Problem (1992), §2.3 (principal pivots); Rump, Acta Numer. 19
(2010) 287–449, §10 (verified linear systems).
"""

from __future__ import annotations

from enum import IntEnum
from typing import NamedTuple

import numpy as np
import scipy.linalg
from numpy.typing import NDArray

from tcstudy.contact.path.problem import ParametricProblem

Array = NDArray[np.float64]
Index = NDArray[np.intp]
EPS = float(np.finfo(float).eps)


class Found(IntEnum):
    """What is proved of a cell: no solution, one segment, or nothing (a corner within rounding, or a lost rank)."""

    NONE = 0
    ONE = 1
    UNDECIDED = 2


class Segments(NamedTuple):
    """The solutions of n cells, t falling or growing from the first end to the second.

    found: (n,) of Found; where it is not ONE the rest means nothing
    u:     (n, 2, m) displacements at both ends [m];  t: (n, 2) the parameter there
    node:  (n, 2) the node that ends its piece there, m where t reaches the end of its range
    upper: (n, 2) whether that is the upper end of its piece (of the range)
    """

    found: NDArray[np.int8]
    u: Array
    t: Array
    node: Index
    upper: NDArray[np.bool_]


def segments(problem: ParametricProblem, codes: NDArray[np.integer], t_min: float, t_max: float) -> Segments:
    """The exact segment of every cell and the facets in which it ends, t between t_min and t_max.

    codes: (n, m) code of a piece that every node's law has, as `ParametricProblem.graph` counts them; behind the facet
           of a node the path goes on in the cell with graph.after_low or graph.after_high of its code
    Proof: with x measured by its largest component and Y the inverse of the rest S, ‖I − YS‖ < 0.01 bounds the error
    of every coordinate; ONE and NONE hold whatever rounding does within that.
    """
    graph, A, c, m, n = problem.graph, problem.A_tilde, problem.c, problem.m, len(codes)
    own, rows, free = np.arange(m), np.arange(n), graph.free[codes]
    moves, slope, kink = free.astype(float), c * graph.slope[codes], graph.kink[codes]
    unit = np.where(free, 1.0, c)  # bounds of a held node are tractions
    low, high = graph.low[codes] * unit, graph.high[codes] * unit
    width = np.where(
        np.isfinite(high - low), high - low, problem.traction_scale * c * (1.0 / A[own, own] * moves + 1.0 - moves)
    )
    start = moves * c * (graph.start[codes] - graph.slope[codes] * graph.anchor[codes])
    length = t_max - t_min
    # unknowns in units of their pieces: x = base + width · y, t = t_min + length · y_m, every y in [0, 1] at best
    base = np.where(np.isfinite(low), low, np.where(np.isfinite(high), high - width, 0.0))
    M = A * (moves * width)[:, None, :]
    M[:, own, own] += np.where(free, slope, 1.0) * width
    N = np.concatenate([M, np.broadcast_to(-problem.l_1[:, None] * length, (n, m, 1))], axis=-1)
    fixed = moves * base + kink
    load = problem.load(t_min)
    rhs = load - fixed @ A - start - np.where(free, slope, 1.0) * base
    size = np.abs(problem.l_0) + (abs(t_min) + length) * np.abs(problem.l_1) + np.abs(fixed) @ np.abs(A)
    size += np.abs(moves * c * graph.start[codes]) + np.abs(slope * graph.anchor[codes]) + np.abs(slope) * np.abs(base)
    size += np.where(free, 0.0, np.abs(base))
    row_size = np.abs(N).max(axis=-1)
    N, rhs, size = N / row_size[..., None], rhs / row_size, size / row_size
    way = np.array([scipy.linalg.qr(one.T, check_finite=False)[0][:, -1] for one in N])
    way = way.reshape(n, m + 1)  # about the line's direction
    pivot = np.argmax(np.abs(way), axis=-1)
    rest = np.array([np.delete(np.arange(m + 1), j) for j in pivot], dtype=np.intp).reshape(n, m)
    S = np.take_along_axis(N, rest[:, None, :].repeat(m, axis=1), axis=-1)
    column = np.take_along_axis(N, pivot[:, None, None].repeat(m, axis=1), axis=-1)[..., 0]
    Y = np.array([scipy.linalg.pinv(one) if np.linalg.matrix_rank(one) < m else np.linalg.inv(one) for one in S])
    Y = Y.reshape(n, m, m)
    rho = np.abs(np.eye(m) - Y @ S).sum(axis=-1).max(axis=-1)
    rho += 2 * m * EPS * (np.abs(Y) @ np.abs(S)).sum(axis=-1).max(axis=-1)
    alpha, gamma = (Y @ rhs[..., None])[..., 0], -(Y @ column[..., None])[..., 0]
    noise = (np.abs(Y) @ (4 * m * EPS * size)[..., None])[..., 0]
    noise += (rho / (1 - np.minimum(rho, 0.5)))[:, None] * (np.abs(alpha) + np.abs(gamma)).max(axis=-1, keepdims=True)
    first = np.concatenate([(low - base) / width, np.zeros((n, 1))], axis=-1)
    last = np.concatenate([(high - base) / width, np.ones((n, 1))], axis=-1)
    order = np.concatenate([rest, pivot[:, None]], axis=-1)
    first, last = np.take_along_axis(first, order, axis=-1), np.take_along_axis(last, order, axis=-1)
    one = np.ones((n, 1))
    alpha, gamma, noise = (
        np.concatenate([x, y], axis=-1) for x, y in ((alpha, 0 * one), (gamma, one), (noise, 0 * one))
    )
    flat, rising = np.abs(gamma) <= noise, gamma > 0
    with np.errstate(divide="ignore", invalid="ignore"):
        to_first, to_last, error = (first - alpha) / gamma, (last - alpha) / gamma, noise / np.abs(gamma)
    enter = np.where(flat, -np.inf, np.where(rising, to_first, to_last))
    leave, error = np.where(flat, np.inf, np.where(rising, to_last, to_first)), np.where(flat, 0.0, error)
    out = (flat & ((alpha < first - 2 * noise) | (alpha > last + 2 * noise))).any(axis=-1)
    doubt = (flat & ~((alpha > first + 2 * noise) & (alpha < last - 2 * noise))).any(axis=-1)
    at = np.argmax(enter, axis=-1), np.argmin(leave, axis=-1)
    x = enter[rows, at[0]], leave[rows, at[1]]
    out |= (enter - error).max(axis=-1) > (leave + error).min(axis=-1)
    sure = (enter + error).max(axis=-1) < (leave - error).min(axis=-1)
    later, sooner = enter + error, leave - error  # which facet comes first has to be sure as well
    later[rows, at[0]], sooner[rows, at[1]] = -np.inf, np.inf
    sure &= (later.max(axis=-1) < x[0] - error[rows, at[0]]) & (sooner.min(axis=-1) > x[1] + error[rows, at[1]])
    decided = np.where(out, Found.NONE, np.where(sure & ~doubt, Found.ONE, Found.UNDECIDED))
    ends = np.empty((n, 2, m + 1))
    for h in (0, 1):
        along = np.where(flat, alpha, alpha + gamma * np.where(np.isfinite(x[h]), x[h], 0.0)[:, None])
        np.put_along_axis(ends[:, h], order, along, axis=-1)
    node = np.stack([order[rows, j] for j in at], axis=1)
    upper = np.stack([~rising[rows, at[0]], rising[rows, at[1]]], axis=1)
    y = base[:, None] + width[:, None] * ends[..., :m]
    cell, end = np.nonzero(node < m)  # the slip of the node that ends its piece is that end to the bit
    own = node[cell, end]
    y[cell, end, own] = np.where(upper[cell, end], high[cell, own], low[cell, own])
    return Segments(
        np.where(rho < 0.01, decided, Found.UNDECIDED).astype(np.int8),
        np.where(free[:, None], y, kink[:, None]),
        t_min + length * ends[..., m],
        node,
        upper,
    )
