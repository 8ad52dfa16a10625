"""Quantities of interest: slip fronts, dual solutions, and errors hidden in end cells.

A goal J is linear in (ξ, u_T) near a solution. With the sticking nodes S held and the slipping ones
F on their piece of b, a change δl̃ of the condensed load changes J = aᵀξ + wᵀu_T by zᵀδl̃:

    z_S = a_S,   (Ã_FF + C b′) z_F = w_F + C b′ a_F − Ã_FS a_S,

and J(u) − J(u_h) = a(u − u_h, z − z_h) to first order, z extended into the body without load (dual
weighted residual): where to refine; how large the error is, see goal_error.py. The slip length is
no differentiable function of the solution as the sum of slipping cells; its dual problem is that of
the fronts' positions within their cells, which are.

Fronts:     |u_T − s_k| ~ r^{3/2} at the distance r from a front, s_k the kink that the sticking
            nodes rest on (Williams' exponents with u_N = 0 are ½, 3/2, …, and r^{1/2} would break
            the bound), so that |u_T − s_k|^{2/3} is linear and the front lies where the line
            through two slipping nodes is zero. The node next to it carries the front's own
            discretisation error and is left out where there are two more. On uniform meshes it lies
            (0.10 ± 0.03) h inside the sticking side of the true one (25 positions of a closed
            form); the nodal one is off by up to h/2. Beside a held node of given u_T = s_k a zone
            shorter than the cell may stick although no node does: if the same line is zero inside
            the cell, there is a front; its place is a guess
Held ends:  from a held node with its given slip s₀ to the next node with v₁, u_T takes every value
            between, but the cell has one ξ₁/c₁ = b(v₁). Where |v₁| passes the length over which b
            falls, or friction turns, that is the same on all meshes too coarse to see it. Under an
            up-jump at s₀ a zone beside it sticks unless slip there is driven by more than friction
            holds back (beside a clamp at 90° slip is r (A − C ln(1/r)) and turns at a distance that
            A/C puts at any power of ten). So ξ/c is off in the cell by no more than max |b(s) −
            b(v₁)| over s between s₀ and v₁, and over 0 put into [b⁻(s₀), b⁺(s₀)], and |δJ| ≤ ½ (|a|
            + |a − z₁|) · most · width; the slip length lacks the width besides
Left out:   fronts that a jump of the data or a corner holds in place have other exponents. Where
            the slip does not grow away from a front, or only one node slips, the middle of the cell
            stands. Traction at a corner itself, which displacements that grow along a side beside a
            sticking zone may give it
Literature: Becker & Rannacher, Acta Numerica 10 (2001) 1–102; Suttmeier, Numerical Solution of
            Variational Inequalities by Adaptive Finite Elements (2008) for contact
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.linalg
from numpy.typing import NDArray

from tcstudy.contact.problem import ContactProblem
from tcstudy.fem.forms import ContactLine
from tcstudy.fem.meshes import PlaneMesh
from tcstudy.laws.laws import Laws
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
"""Cells by which a front may lie outside the cell between its sticking and its slipping node."""


@dataclass(frozen=True)
class SlipFront:
    """A stick–slip transition.

    segment: index of its cell in line.segments
    width:   length of the cell [m]
    excess:  length of the slip zone beyond that of its nodes, ½ width − (distance from the sticking
             node) [m]
    doubt:   uncertainty for lack of slipping nodes: ½ width where the middle of the cell is taken,
             else 0 [m]
    nodes:   contact DOFs on which `excess` depends
    slopes:  its derivatives by their u_T [1]
    hidden:  whether it lies beside a held node and no node sticks
    """

    segment: int
    width: float
    excess: float
    doubt: float
    nodes: tuple[int, ...]
    slopes: tuple[float, ...]
    hidden: bool = False


def fronts(line: ContactLine, problem: ContactProblem, v: Array) -> list[SlipFront]:
    """Return all fronts of a contact solution v (m,), hidden ones last; ends of Γ_C are none."""
    law = problem.law
    ends = line.unknowns
    if not len(law.kinks):
        return []
    sticks = law.sticking(v)
    held = ends == HELD
    end_sticks = sticks[ends] & ~held
    visible = ~held.any(axis=1) & (end_sticks[:, 0] != end_sticks[:, 1])
    beside_held = (held[:, 0] != held[:, 1]) & ~end_sticks.any(axis=1)
    candidates = list[SlipFront | None]()
    for segment in np.flatnonzero(visible).tolist():
        direction = 1 if end_sticks[segment, 0] else -1
        candidates.append(_visible_front(line, law, v, segment, direction))
    for segment in np.flatnonzero(beside_held).tolist():
        direction = 1 if held[segment, 0] else -1
        candidates.append(_hidden_front(line, law, v, segment, direction))
    return [front for front in candidates if front is not None]


def _visible_front(
    line: ContactLine, law: Laws, v: Array, segment: int, direction: int
) -> SlipFront | None:
    """Return the front between a sticking node and the slipping one after it in a direction."""
    sticking_node = int(line.unknowns[segment, ::direction][0])
    node_law = law.single(sticking_node)
    if not len(node_law.kinks):
        return None
    slip = v - node_law.kinks[node_law.nearest_kink(v[sticking_node])]
    nodes, distances = _slipping_nodes(line, segment, direction, law.sticking(v), slip)
    width = distances[0]
    zero = _zero(distances, nodes, slip)
    if zero is None:  # u_T = C r^{3/2} with constant C, half a cell from the front
        slope = 0.5 * width / (EXPONENT * float(slip[nodes[0]]))
        return SlipFront(segment, width, 0.0, 0.5 * width, (nodes[0],), (slope,))
    place, pair, zero_slopes = zero
    distance = float(np.clip(place, -REACH * width, (1.0 + REACH) * width))
    return SlipFront(segment, width, 0.5 * width - distance, 0.0, pair, zero_slopes)


def _hidden_front(
    line: ContactLine, law: Laws, v: Array, segment: int, direction: int
) -> SlipFront | None:
    """Return the front between a held node and the slipping one beside it, if there is one."""
    slipping_node = int(line.unknowns[segment, ::direction][1])
    node_law = law.single(slipping_node)
    if not len(node_law.kinks):
        return None
    kink = node_law.nearest_kink(v[slipping_node])
    if node_law.kinds[kink] != UP:
        return None
    slip = v - node_law.kinks[kink]
    nodes, distances = _slipping_nodes(line, segment, direction, law.sticking(v), slip)
    # the nearest two nodes: slip like r^λ, λ < 3/2, has its zero outside the body, and no front
    zero = _zero(distances[:2], nodes[:2], slip)
    if zero is None or not zero[0] > 0.0:
        return None
    place, pair, zero_slopes = zero
    width = distances[0]
    return SlipFront(segment, width, -min(place, width), 0.0, pair, zero_slopes, hidden=True)


def _slipping_nodes(
    line: ContactLine, segment: int, direction: int, sticks: Flags, slip: Array
) -> tuple[list[int], list[float]]:
    """Return up to three nodes from a segment on that slip one way, and their distances.

    direction: 1 along the line, −1 against it
    The distances are from the node at the beginning of the segment.
    """
    nodes = list[int]()
    distances = list[float]()
    distance = 0.0
    far_end = 1 if direction > 0 else 0
    while len(nodes) < 3:
        node = int(line.unknowns[segment, far_end])
        if node == HELD or sticks[node]:
            break
        if nodes and slip[node] * slip[nodes[0]] <= 0.0:
            break
        distance += float(line.lengths[segment])
        nodes.append(node)
        distances.append(distance)
        segment += direction
        if not 0 <= segment < len(line.unknowns):
            break
        if line.segments[segment - direction, far_end] != line.segments[segment, 1 - far_end]:
            break
    return nodes, distances


def slip_length(line: ContactLine, problem: ContactProblem, v: Array) -> tuple[float, float]:
    """Return the length of Γ_C that slips, fronts located within their cells, and its doubt [m]."""
    slip_fronts = fronts(line, problem, v)
    nodal = float(problem.c[~problem.law.sticking(v)].sum())
    length = nodal + sum(front.excess for front in slip_fronts)
    return length, sum(front.doubt for front in slip_fronts)


def slopes(line: ContactLine, problem: ContactProblem, v: Array) -> Array:
    """Return w (m,), the derivative of `slip_length` by u_T [1]."""
    w = np.zeros(line.m)
    for front in fronts(line, problem, v):
        np.add.at(w, list(front.nodes), front.slopes)
    return w


def _zero(
    distances: list[float], nodes: list[int], slip: Array
) -> tuple[float, tuple[int, int], tuple[float, float]] | None:
    """Return the zero of the line through |slip|^{2/3} of the two farthest nodes, if it rises.

    The nodes and minus the derivatives of the zero by their slips come with it.
    """
    if len(nodes) < 2:
        return None
    p, q = nodes[-2:]
    r_p, r_q = distances[-2:]
    y_p, y_q = np.abs(slip[[p, q]]) ** (1 / EXPONENT)
    if y_q <= y_p:
        return None
    rise = (r_q - r_p) * y_p * y_q / ((y_q - y_p) ** 2 * EXPONENT)
    zero = float(r_p - y_p * (r_q - r_p) / (y_q - y_p))
    zero_slopes = float(rise / slip[p]), float(-rise / slip[q])
    return zero, (p, q), zero_slopes


def goal_value(goal: Goal, problem: ContactProblem, line: ContactLine, v: Array) -> float:
    """Return J of a contact solution v (m,)."""
    if goal.at is not None:
        return float(point_weights(line, goal.at) @ v)
    if goal.quantity == "slip_length":
        return float(problem.c[~problem.law.sticking(v)].sum())
    return float(problem.xi(v).sum())


def weight_of_friction(goal: Goal) -> float:
    """Return a of J = aᵀξ + wᵀu_T at every node."""
    return float(goal.quantity == "friction_resultant")


def point_weights(line: ContactLine, point: Point) -> Array:
    """Return w (m,) with u_T = wᵀv at the point of Γ_C nearest to a point; 0 at held nodes."""
    nearest, t = line.nearest(point)
    w = np.zeros(line.m)
    for unknown, share in zip(line.unknowns[nearest], (1.0 - t, t), strict=True):
        if unknown >= 0:
            w[unknown] = share
    return w


def lost(line: ContactLine, problem: ContactProblem, v: Array) -> Array:
    """Return the friction (s,) that ∫ξ lacks between a held node and a sticking one [N/m].

    ξ_i of a sticking node is the integral with its hat function, ½ t·width less than that of the
    traction t there. The cell c_i of a slipping node reaches up to the held node.
    """
    sticks = problem.law.sticking(v)
    xi = problem.xi(v)
    ends = line.unknowns
    node = ends.max(axis=1)
    width = line.lengths
    at_held = (ends.min(axis=1) < 0) & sticks[node]
    hat = line.c.copy()
    np.add.at(hat, node[at_held], -0.5 * width[at_held])
    return np.where(at_held, 0.5 * width * xi[node] / hat[node], 0.0)


def torn(line: ContactLine, problem: ContactProblem, v: Array) -> Array:
    """Return half the change (s,) of b between two neighbours beyond its chord, times the cell.

    It is a force per unit of thickness [N/m]. A jump counts fully: such a front sticks at a node
    whatever the load, so that ∫ξ is known to a cell there. So do softening from a sticking node to
    one beyond it, and a change of the sign of the slip between two nodes. Bends between nodes close
    to each other leave O(h²).
    """
    ends = line.unknowns
    low, high = np.sort(v[ends], axis=1).T
    law = problem.law.of_nodes(ends.max(axis=1))
    free = np.all(ends >= 0, axis=1)
    tables = law.tables
    rows = law.node_index(len(ends))
    b_low = law.b(low, 1)[:, None]
    b_high = law.b(high, -1)[:, None]
    kinks = tables.kinks[rows]
    low = low[:, None]
    high = high[:, None]
    inside = free[:, None] & (low < kinks) & (kinks < high)
    with np.errstate(invalid="ignore", divide="ignore"):
        chord = b_low + (kinks - low) / (high - low) * (b_high - b_low)
        above = np.maximum(tables.b_left, tables.b_right)[rows] - chord
        below = chord - np.minimum(tables.b_left, tables.b_right)[rows]
    largest_above = np.max(np.where(inside, above, 0.0), axis=1, initial=0.0)
    largest_below = np.max(np.where(inside, below, 0.0), axis=1, initial=0.0)
    return np.asarray(0.5 * line.lengths * (largest_above + largest_below))


def steps(line: ContactLine, problem: ContactProblem, v: Array) -> Array:
    """Return the difference (s,) of the laws of two neighbours where the law steps along Γ_C [Pa].

    A step is more than twice the difference on both sides of it: strength that varies smoothly
    changes by about the same from cell to cell. Sticking nodes carry the reaction of the body, not
    b. At an interface junction a node has parts of both laws, and nothing steps.
    """
    law = problem.law
    ends = line.unknowns
    if law.one:
        return np.zeros(len(ends))
    p, q = ends.T
    slips = ~law.sticking(v)
    slip = np.where(slips[p], v[p], v[q])
    is_free = ends.min(axis=1) >= 0
    at_joint = np.isin(ends, line.joints.node).any(axis=1)
    is_compared = is_free & (slips[p] | slips[q]) & ~at_joint
    difference = np.abs(law.of_nodes(p).b(slip) - law.of_nodes(q).b(slip))
    difference = np.where(is_compared, difference, 0.0)
    before = np.append(0.0, difference[:-1])
    after = np.append(difference[1:], 0.0)
    return np.where(difference > 2.0 * np.maximum(before, after), difference, 0.0)


def dual(goal: Goal, problem: ContactProblem, line: ContactLine, v: Array) -> Array:
    """Return z (m,), the derivative of J by the condensed load.

    Raises LinAlgError at a turning point of the solution.
    """
    a = np.full(line.m, weight_of_friction(goal))
    w = np.zeros(line.m)
    if goal.at is not None:
        w = point_weights(line, goal.at)
    elif goal.quantity == "slip_length":
        w = slopes(line, problem, v)
    sticks = problem.law.sticking(v)
    slips = ~sticks
    tangent = problem.c * problem.law.slope(v, problem.law.piece(v))
    z = np.where(sticks, a, 0.0)
    if np.any(slips):
        matrix = problem.A_tilde[np.ix_(slips, slips)] + np.diag(tangent[slips])
        held_load = problem.A_tilde[np.ix_(slips, sticks)] @ a[sticks]
        load = w[slips] + tangent[slips] * a[slips] - held_load
        z[slips] = scipy.linalg.solve(matrix, load, assume_a="sym")
    return z


ROUNDINGS = 8.0 * float(np.finfo(float).eps)
"""Distance up to which a given slip is at a kink, relative to the largest displacement."""


def hidden_effects(
    goal: Goal, line: ContactLine, problem: ContactProblem, v: Array, u: Array, z: Array
) -> Array:
    """Return bounds (s,) of the changes of J that the end cells of a solution may hide.

    v: (m,) slips;  u: (2n,) displacement;  z: (m,) dual solution
    """
    effects = np.zeros(len(line.segments))
    if not len(problem.law.kinks):
        return effects
    ends = line.unknowns
    a = weight_of_friction(goal)
    displacement = u.reshape(2, -1)
    along = line.ends[:, 1] - line.ends[:, 0]
    widths = line.lengths
    sticks = problem.law.sticking(v)
    traction = problem.xi(v) / problem.c
    noise = ROUNDINGS * float(np.abs(u).max())
    for cell in np.flatnonzero(ends.min(axis=1) < 0).tolist():
        node = int(ends[cell].max())
        held_node = int(line.segments[cell, np.argmin(ends[cell])])
        law = problem.law.single(node)
        held_slip = float(displacement[:, held_node] @ along[cell]) / float(widths[cell])
        near_kinks = np.flatnonzero(np.abs(law.kinks - held_slip) <= noise)
        if len(near_kinks):
            held_slip = float(law.kinks[near_kinks[0]])
        if sticks[node] and held_slip == v[node]:
            continue  # the sticking zone is visible
        low, high = sorted((held_slip, v[node]))
        is_between = (law.kinks > low) & (law.kinks < high)
        is_stick = (law.kinks == held_slip) & (law.kinds == UP)
        tractions = [*law.b_left[is_between], *law.b_right[is_between]]
        tractions.append(float(law.b(held_slip, 1 if v[node] > held_slip else -1)))
        for kink in np.flatnonzero(is_stick):
            tractions.append(float(np.clip(0.0, law.b_left[kink], law.b_right[kink])))
        largest = float(np.max(np.abs(np.array(tractions) - traction[node])))
        weight = 0.5 * (abs(a) + abs(a - float(z[node])))
        effects[cell] = weight * largest * widths[cell]
        may_stick = np.any(is_stick | (is_between & (law.kinds == UP)))
        if goal.quantity == "slip_length" and largest > 0.0 and may_stick:
            effects[cell] += widths[cell]
    return effects


Hidden = list[tuple[int, int, float]]
"""Parts of an error that end cells hide, which shrink with the lengths of the cells.

They are held mesh nodes, boundary curves of their cells, and parts over the lengths of the cells
[1/m].
"""


def hidden_on(mesh: PlaneMesh, line: ContactLine, parts: Array) -> Hidden:
    """Return the parts (s,) of the segments of Γ_C at held nodes in terms of the mesh."""
    cells = np.flatnonzero(parts)
    nodes = line.segments[cells, np.argmin(line.unknowns[cells], axis=1)]
    curves = mesh.segment_curve[line.which[cells]]
    densities = parts[cells] / line.lengths[cells]
    return list(zip(nodes.tolist(), curves.tolist(), densities.tolist(), strict=True))


def hidden_shares(mesh: PlaneMesh, hidden: Hidden) -> Array:
    """Return the parts (t,) at the triangles of the cells, on a mesh refined since."""
    parts = np.zeros(len(mesh.segments))
    for node, curve, density in hidden:
        touches = (mesh.segments == node).any(axis=1)
        cell = np.flatnonzero(touches & (mesh.segment_curve == curve))[0]
        parts[cell] += density * mesh.boundary.length[cell]
    return mesh.from_segments(parts)
