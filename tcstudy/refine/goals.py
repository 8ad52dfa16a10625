"""Numbers that a study is after: fronts, how errors carry over to a number, what end cells hide.

A goal J is linear in (ξ, u_T) near a solution. With the sticking nodes S held and the slipping ones
F on their piece of b, a change δl̃ of the condensed load changes J = aᵀξ + wᵀu_T by zᵀδl̃:

    z_S = a_S,   (Ã_FF + C b′) z_F = w_F + C b′ a_F − Ã_FS a_S,

and J(u) − J(u_h) = a(u − u_h, z − z_h) to first order, z extended into the body without load (dual
weighted residual): where to refine; how large the error is, see goal_error.py. The slip length is
no differentiable function of the solution as the sum of slipping cells; its dual problem is that of
the fronts' positions within their cells, which are.

Fronts:     |u_T − s_k| ~ r^{3/2} at the distance r from a front, s_k the kink that the sticking nodes rest on
            (Williams' exponents with u_N = 0 are ½, 3/2, …, and r^{1/2} would break the bound), so
            that |u_T −
            s_k|^{2/3} is linear and the front lies where the line through two slipping nodes is
            zero. The node next to
            it carries the front's own discretisation error and is left out where there are two
            more. On uniform meshes
            it lies (0.10 ± 0.03) h inside the sticking side of the true one (25 positions of a
            closed form); the nodal
            one is off by up to h/2. Beside a held node of given u_T = s_k a zone shorter than the
            cell may stick
            although no node does: if the same line is zero inside the cell, there is a front; its
            place is a guess
Held ends:  from a held node with its given slip s₀ to the next node with v₁, u_T takes every value between, but the
            cell has one ξ₁/c₁ = b(v₁). Where |v₁| passes the length over which b falls, or friction
            turns, that is the
            same on all meshes too coarse to see it. Under an up-jump at s₀ a zone beside it sticks
            unless slip there is
            driven by more than friction holds back (beside a clamp at 90° slip is r (A − C ln(1/r))
            and turns at a
            distance that A/C puts at any power of ten). So ξ/c is off in the cell by no more than
            max |b(s) − b(v₁)|
            over s between s₀ and v₁, and over 0 put into [b⁻(s₀), b⁺(s₀)], and |δJ| ≤ ½ (|a| + |a −
            z₁|) · most ·
            width; the slip length lacks the width besides
Left out:   fronts that a jump of the data or a corner holds in place have other exponents. Where the slip does not grow
            away from a front, or only one node slips, the middle of the cell stands. Traction at a
            corner itself, which
            displacements that grow along a side beside a sticking zone may give it
Literature: Becker & Rannacher, Acta Numerica 10 (2001) 1–102; Suttmeier, Numerical Solution of
Variational
            Inequalities by Adaptive Finite Elements (2008) for contact
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.linalg
from numpy.typing import NDArray

from tcstudy.contact.problem import ContactProblem
from tcstudy.fem.forms import ContactLine
from tcstudy.fem.meshes import PlaneMesh
from tcstudy.laws.pieces import UP
from tcstudy.scene.mesh_plan import Goal
from tcstudy.scene.records import Point

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]

EXPONENT = 1.5
"""u_T ~ r^EXPONENT at a front."""
HELD = -1
"""Stands for the contact unknown of a node that has none."""
REACH = 0.5
"""How many cells a front may lie outside the cell between its sticking and its slipping node."""


@dataclass(frozen=True)
class SlipFront:
    """One place where stick meets slip.

    segment: index of its cell in line.segments;  width: length of the cell [m]
    more:    by how much the slip zone is longer than the nodes say, ½ width − (distance from the sticking node) [m]
    doubt:   how far it may lie off for lack of slipping nodes: ½ width where the middle of the cell stands, else 0 [m]
    hidden:  it lies beside a held node, and no node sticks
    nodes:   contact unknowns that `more` depends on;  slopes: its derivatives with respect to their u_T [1]
    """

    segment: int
    width: float
    more: float
    doubt: float
    nodes: tuple[int, ...]
    slopes: tuple[float, ...]
    hidden: bool = False


def fronts(line: ContactLine, problem: ContactProblem, v: Array) -> list[SlipFront]:
    """All fronts of a contact solution v (m,), hidden ones last; an end of Γ_C is none."""
    law, ends = problem.law, line.unknowns
    if not len(law.kinks):
        return []
    stick, held, found = law.sticking(v), ends == HELD, list[SlipFront]()
    sticks = stick[ends] & ~held
    seen = ~held.any(axis=1) & (sticks[:, 0] != sticks[:, 1])
    hidden = (held[:, 0] != held[:, 1]) & ~sticks.any(axis=1)
    for i in (*np.flatnonzero(seen).tolist(), *np.flatnonzero(hidden).tolist()):
        towards = 1 if (held if hidden[i] else sticks)[i, 0] else -1
        rests, slides = ends[i, ::towards].tolist()
        node = slides if hidden[i] else rests
        own = law.single(node)
        if not len(own.kinks):
            continue
        kink = own.nearest_kink(v[node])
        if hidden[i] and own.kinds[kink] != UP:
            continue
        slip = v - own.kinks[kink]
        nodes, at = _beyond(line, i, towards, stick, slip)
        width = at[0]
        # beside a held node the nearest two: slip like r^λ, λ < 3/2, gives a zero outside the body,
        # and no front
        some = 2 if hidden[i] else len(nodes)
        zero = _zero(at[:some], nodes[:some], slip)
        if hidden[i]:
            if zero is not None and zero[0] > 0.0:
                found.append(SlipFront(i, width, -min(zero[0], width), 0.0, *zero[1:], hidden=True))
        elif zero is not None:
            more = 0.5 * width - float(np.clip(zero[0], -REACH * width, (1.0 + REACH) * width))
            found.append(SlipFront(i, width, more, 0.0, *zero[1:]))
        else:  # u_T = C r^{3/2} with C held, half a cell from the front
            slope = 0.5 * width / (EXPONENT * float(slip[nodes[0]]))
            found.append(SlipFront(i, width, 0.0, 0.5 * width, (nodes[0],), (slope,)))
    return found


def _beyond(
    line: ContactLine, i: int, towards: int, stick: Flags, slip: Array
) -> tuple[list[int], list[float]]:
    """Up to three nodes that slip one way from segment i on, along the line (towards = 1) or
    against it, and how far they are from the node before them all.
    """
    nodes, at, ends, inner = list[int](), list[float](), line.unknowns, 1 if towards > 0 else 0
    while True:
        node = int(ends[i, inner])
        if (
            node == HELD
            or stick[node]
            or (nodes and slip[node] * slip[nodes[0]] <= 0.0)
            or len(nodes) == 3
        ):
            return nodes, at
        nodes.append(node)
        at.append((at[-1] if at else 0.0) + float(line.lengths[i]))
        i += towards
        if not (
            0 <= i < len(ends) and line.segments[i - towards, inner] == line.segments[i, 1 - inner]
        ):
            return nodes, at


def slip_length(line: ContactLine, problem: ContactProblem, v: Array) -> tuple[float, float]:
    """Length of Γ_C that does not stick, fronts taken where they are found within their cells, and
    their doubt [m]."""
    found = fronts(line, problem, v)
    nodal = float(problem.c[~problem.law.sticking(v)].sum())
    return nodal + sum(front.more for front in found), sum(front.doubt for front in found)


def slopes(line: ContactLine, problem: ContactProblem, v: Array) -> Array:
    """w (m,), the derivative of `slip_length` with respect to u_T [1]."""
    w = np.zeros(line.m)
    for front in fronts(line, problem, v):
        np.add.at(w, list(front.nodes), front.slopes)
    return w


def _zero(
    at: list[float], nodes: list[int], slip: Array
) -> tuple[float, tuple[int, int], tuple[float, float]] | None:
    """Where |slip|^{2/3} through the two farthest nodes is zero, the nodes, minus its derivatives;
    None if it falls."""
    if len(nodes) < 2:
        return None
    (p, q), (r_p, r_q) = nodes[-2:], at[-2:]
    y_p, y_q = np.abs(slip[[p, q]]) ** (1 / EXPONENT)
    if y_q <= y_p:
        return None
    rise = (r_q - r_p) * y_p * y_q / ((y_q - y_p) ** 2 * EXPONENT)
    return (
        float(r_p - y_p * (r_q - r_p) / (y_q - y_p)),
        (p, q),
        (float(rise / slip[p]), float(-rise / slip[q])),
    )


def goal_value(goal: Goal, problem: ContactProblem, line: ContactLine, v: Array) -> float:
    """J of a contact solution v (m,)."""
    if goal.at is not None:
        return float(point_weights(line, goal.at) @ v)
    sliding = problem.c[~problem.law.sticking(v)]
    return float(sliding.sum() if goal.quantity == "slip_length" else problem.xi(v).sum())


def weight_of_friction(goal: Goal) -> float:
    """a of J = aᵀξ + wᵀu_T at every node."""
    return float(goal.quantity == "friction_resultant")


def point_weights(line: ContactLine, at: Point) -> Array:
    """w (m,) with u_T(at) = wᵀv for the point of Γ_C nearest to `at`; held nodes have no weight."""
    nearest, t = line.nearest(at)
    w = np.zeros(line.m)
    for unknown, share in zip(line.unknowns[nearest], (1.0 - t, t), strict=True):
        if unknown >= 0:
            w[unknown] = share
    return w


def lost(line: ContactLine, problem: ContactProblem, v: Array) -> Array:
    """(s,) friction that ∫ξ misses on the segments of Γ_C between a held node and a sticking one
    [N/m].

    ξ_i of a sticking node is what its hat function sees, ½ t·width less than the traction t carries
    there. A slipping node's cell c_i reaches up to the held node.
    """
    stick, xi = problem.law.sticking(v), problem.xi(v)
    own = line.unknowns
    node, width = own.max(axis=1), line.lengths
    at_held = (own.min(axis=1) < 0) & stick[node]
    hat = line.c.copy()
    np.add.at(hat, node[at_held], -0.5 * width[at_held])
    return np.where(at_held, 0.5 * width * xi[node] / hat[node], 0.0)


def torn(line: ContactLine, problem: ContactProblem, v: Array) -> Array:
    """(s,) half of what b does between the slips of two neighbours that its chord does not say,
    times the cell [N/m].

    A jump counts as it is: such a front rests on a node wherever the load would have it, so that ∫ξ
    is known to a cell there. So does a fall from a sticking node to one that has passed it all, and
    a turn of the slip from one node to the next. Bends between nodes close to each other leave
    O(h²).
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
    """(s,) how far apart the laws of two neighbours are at the slip there, where the law steps
    along Γ_C [Pa].

    A step is more than twice what it is on both sides of it: strength that varies smoothly changes
    from cell to cell by about the same. Nodes that stick carry what the body asks for, not b. Where
    edges meet the cell of the node has its parts of both laws, and nothing steps.
    """
    law, own = problem.law, line.unknowns
    if law.one:
        return np.zeros(len(own))
    (p, q), slips = own.T, ~law.sticking(v)
    slip = np.where(slips[p], v[p], v[q])
    known = (
        (own.min(axis=1) >= 0) & (slips[p] | slips[q]) & ~np.isin(own, line.joints.node).any(axis=1)
    )
    apart = np.where(known, np.abs(law.of_nodes(p).b(slip) - law.of_nodes(q).b(slip)), 0.0)
    beside = np.maximum(np.append(0.0, apart[:-1]), np.append(apart[1:], 0.0))
    return np.where(apart > 2.0 * beside, apart, 0.0)


def dual(goal: Goal, problem: ContactProblem, line: ContactLine, v: Array) -> Array:
    """z (m,), the change of J with the condensed load. Raises LinAlgError at a turning point of the
    solution."""
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


ROUNDINGS = 8.0 * float(np.finfo(float).eps)
"""Distance from a kink, over the largest displacement of the body, at which a given slip is still
on it."""


def hidden_effects(
    goal: Goal, line: ContactLine, problem: ContactProblem, v: Array, u: Array, z: Array
) -> Array:
    """(s,) the most that the end cells of a solution v (m,), u (2n,) may change of J, with the dual
    solution z (m,)."""
    found = np.zeros(len(line.segments))
    if not len(problem.law.kinks):
        return found
    own, across, a = line.unknowns, u.reshape(2, -1), weight_of_friction(goal)
    along, width, stick = line.ends[:, 1] - line.ends[:, 0], line.lengths, problem.law.sticking(v)
    traction, noise = problem.xi(v) / problem.c, ROUNDINGS * float(np.abs(u).max())
    for i in np.flatnonzero(own.min(axis=1) < 0).tolist():
        node, held = int(own[i].max()), int(line.segments[i, np.argmin(own[i])])
        given = float(across[:, held] @ along[i]) / float(width[i])
        law = problem.law.single(node)
        on = np.flatnonzero(np.abs(law.kinks - given) <= noise)
        given = float(law.kinks[on[0]]) if len(on) else given
        if stick[node] and given == v[node]:
            continue  # the zone is seen
        between = (law.kinks > min(given, v[node])) & (law.kinks < max(given, v[node]))
        values = [
            *law.b_left[between],
            *law.b_right[between],
            float(law.b(given, 1 if v[node] > given else -1)),
        ]
        rests = (law.kinks == given) & (law.kinds == UP)
        values += [
            float(np.clip(0.0, law.b_left[k], law.b_right[k])) for k in np.flatnonzero(rests)
        ]
        most = float(np.max(np.abs(np.array(values) - traction[node])))
        found[i] = 0.5 * (abs(a) + abs(a - float(z[node]))) * most * width[i]
        # a hidden zone may stick
        if (
            goal.quantity == "slip_length"
            and most > 0.0
            and np.any(rests | (between & (law.kinds == UP)))
        ):
            found[i] += width[i]
    return found


Hidden = list[tuple[int, int, float]]
"""Parts of an error that end cells hide, for marking, as they shrink with the length of their cell:
held mesh nodes, curves of the boundary on which their cells lie, and parts over the lengths of the
cells [1/m]."""


def hidden_on(mesh: PlaneMesh, line: ContactLine, parts: Array) -> Hidden:
    """What (s,) parts on the segments of Γ_C say of the mesh, those at held nodes only."""
    cells = np.flatnonzero(parts)
    nodes = line.segments[cells, np.argmin(line.unknowns[cells], axis=1)]
    curves, density = mesh.segment_curve[line.which[cells]], parts[cells] / line.lengths[cells]
    return list(zip(nodes.tolist(), curves.tolist(), density.tolist(), strict=True))


def hidden_shares(mesh: PlaneMesh, hidden: Hidden) -> Array:
    """(t,) the parts at the triangles that have the cells now, on a mesh refined since."""
    found = np.zeros(len(mesh.segments))
    for node, curve, density in hidden:
        cell = np.flatnonzero((mesh.segments == node).any(axis=1) & (mesh.segment_curve == curve))[
            0
        ]
        found[cell] += density * mesh.boundary.length[cell]
    return mesh.from_segments(found)
