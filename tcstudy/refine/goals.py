"""Numbers that a study is after, and how errors of the solution carry over to them.

A goal J is linear in (ξ, u_T) near a solution. With the sticking nodes S held and the slipping ones F on their piece of
b, a change δl̃ of the condensed load changes J = aᵀξ + wᵀu_T by zᵀδl̃:

    z_S = a_S,   (Ã_FF + C b′) z_F = w_F + C b′ a_F − Ã_FS a_S,

one more solve with the tangent of the solution. z is extended into the body without load; then

    J(u) − J(u_h) = a(u − u_h, z − z_h) to first order                                       (dual weighted residual)

for homogeneous data. It says where to refine; how large the error is, see goal_error.py.
Literature: Becker & Rannacher, Acta Numerica 10 (2001) 1–102; Suttmeier, Numerical Solution of Variational
            Inequalities by Adaptive Finite Elements (2008) for contact
Slip length: as the sum of slipping cells it is no differentiable function of the solution. Its dual problem is that of
            the fronts' positions within their cells (fronts.py), which are
"""

from __future__ import annotations

import numpy as np
import scipy.linalg
from numpy.typing import NDArray

from tcstudy.contact.problem import ContactProblem
from tcstudy.fem.boundary import ContactLine
from tcstudy.refine.fronts import slopes
from tcstudy.scene.records import Point
from tcstudy.scene.study import Goal

Array = NDArray[np.float64]


def goal_value(goal: Goal, problem: ContactProblem, line: ContactLine, v: Array) -> float:
    """J of a contact solution v (m,); NaN for the energy norm, which is no number to compare."""
    if goal.quantity == "friction_resultant":
        return float(problem.xi(v).sum())
    if goal.quantity == "slip_length":
        return float(problem.c[~problem.law.sticking(v)].sum())
    if goal.quantity == "u_T":
        assert goal.at is not None
        return float(point_weights(line, goal.at) @ v)
    return float("nan")


def weight_of_friction(goal: Goal) -> float:
    """a of J = aᵀξ + wᵀu_T at every node."""
    return 1.0 if goal.quantity == "friction_resultant" else 0.0


def point_weights(line: ContactLine, at: Point) -> Array:
    """w (m,) with u_T(at) = wᵀv for the point of Γ_C nearest to `at`; held nodes have no weight."""
    nearest, t = line.nearest(at)
    w = np.zeros(line.m)
    for unknown, share in zip(line.unknowns[nearest], (1.0 - t, t), strict=True):
        if unknown >= 0:
            w[unknown] = share
    return w


def lost(line: ContactLine, problem: ContactProblem, v: Array) -> Array:
    """(s,) friction that ∫ξ misses on the segments of Γ_C between a held node and a sticking one [N/m].

    ξ_i of a sticking node is what its hat function sees, ½ t·width less than the traction t carries there. A slipping
    node's cell c_i reaches up to the held node.
    """
    stick, xi = problem.law.sticking(v), problem.xi(v)
    own = line.unknowns
    node, width = own.max(axis=1), line.lengths
    at_held = (own.min(axis=1) < 0) & stick[node]
    hat = line.c.copy()
    np.add.at(hat, node[at_held], -0.5 * width[at_held])
    return np.where(at_held, 0.5 * width * xi[node] / hat[node], 0.0)


def torn(line: ContactLine, problem: ContactProblem, v: Array) -> Array:
    """(s,) half of what b does between the slips of two neighbours that its chord does not say, times the cell [N/m].

    A jump counts as it is: such a front rests on a node wherever the load would have it, so that ∫ξ is known to a cell
    there. So does a fall from a sticking node to one that has passed it all, and a turn of the slip from one node to
    the next. Bends between nodes close to each other leave O(h²).
    """
    own = line.unknowns
    low, high = np.sort(v[own], axis=1).T
    law, free = problem.law.of_nodes(own.max(axis=1)), np.all(own >= 0, axis=1)
    at, tables = law.node_index(len(own)), law.tables
    first, last, kinks = law.b(low, 1)[:, None], law.b(high, -1)[:, None], tables.kinks[at]
    low, high = low[:, None], high[:, None]
    inside = free[:, None] & (low < kinks) & (kinks < high)
    with np.errstate(invalid="ignore", divide="ignore"):
        chord = first + (kinks - low) / (high - low) * (last - first)
        above = np.maximum(tables.b_left, tables.b_right)[at] - chord
        below = chord - np.minimum(tables.b_left, tables.b_right)[at]
    unsaid = sum(np.max(np.where(inside, off, 0.0), axis=1, initial=0.0) for off in (above, below))
    return np.asarray(0.5 * line.lengths * unsaid)


def steps(line: ContactLine, problem: ContactProblem, v: Array) -> Array:
    """(s,) how far apart the laws of two neighbours are at the slip there, where the law steps along Γ_C [Pa].

    A step is more than twice what it is on both sides of it: strength that varies smoothly changes from cell to cell by
    about the same. Nodes that stick carry what the body asks for, not b. Where edges meet the cell of the node has its
    parts of both laws, and nothing steps.
    """
    law, own = problem.law, line.unknowns
    if law.one:
        return np.zeros(len(own))
    (p, q), slips = own.T, ~law.sticking(v)
    slip = np.where(slips[p], v[p], v[q])
    known = (own.min(axis=1) >= 0) & (slips[p] | slips[q]) & ~np.isin(own, line.joints.node).any(axis=1)
    apart = np.where(known, np.abs(law.of_nodes(p).b(slip) - law.of_nodes(q).b(slip)), 0.0)
    beside = np.maximum(np.append(0.0, apart[:-1]), np.append(apart[1:], 0.0))
    return np.where(apart > 2.0 * beside, apart, 0.0)


def dual(goal: Goal, problem: ContactProblem, line: ContactLine, v: Array) -> Array:
    """z (m,), the change of J with the condensed load. Raises LinAlgError at a turning point of the solution."""
    a, w = np.full(line.m, weight_of_friction(goal)), np.zeros(line.m)
    if goal.at is not None:
        w = point_weights(line, goal.at)
    elif goal.quantity == "slip_length":
        w = slopes(line, problem, v)
    stick = problem.law.sticking(v)
    slip = ~stick
    tangent = problem.c * problem.law.slope(v, problem.law.piece(v))
    z = np.where(stick, a, 0.0)
    if np.any(slip):
        matrix = problem.A_tilde[np.ix_(slip, slip)] + np.diag(tangent[slip])
        load = w[slip] + tangent[slip] * a[slip] - problem.A_tilde[np.ix_(slip, stick)] @ a[stick]
        z[slip] = scipy.linalg.solve(matrix, load, assume_a="sym")
    return z
