"""What the cells of Γ_C beside held nodes may hide, and what that may change of a number J.

From a held node with its given slip s₀ (0 where a clamp meets Γ_C) to the next node with u_T = v₁, u_T takes every
value between, but the cell has one ξ₁/c₁ = b(v₁). Where |v₁| passes the length over which b falls, or friction turns,
that is the same on all meshes too coarse to see what lies between: ∫ξ stays on a plateau, and no change from mesh to
mesh says that it will leave it.

Zones that stick: u_T → s₀ towards the node. If b jumps up at s₀, a zone beside it sticks unless slip there is driven by
            more than friction holds back. Beside a clamp at an angle up to 90° it always does: at 90° slip is
            r (A − C ln(1/r)), C from friction, and turns at a distance that A/C puts at any power of ten. In the zone
            ξ goes from where friction holds nothing, the corner, to the jump's end that slips
Most:       so |ξ/c| is off in the cell by no more than max |b(s) − b(v₁)| over s between s₀ and v₁, and over
            0 put into [b⁻(s₀), b⁺(s₀)]
Effect:     a change δξ of friction in the cell changes J by ∫(a − z) δξ, z linear from 0 at the held node to z₁, a = 1
            for ∫ξ and 0 otherwise (goals.py): |δJ| ≤ ½ (|a| + |a − z₁|) · most · width. The slip length lacks the width
            besides. Where b is continuous from s₀ on, that is O(h²); under an up-jump it is halved with the cell
Left out:   traction at a corner itself, which displacements that grow along a side beside a sticking zone may give it
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tcstudy.contact.problem import ContactProblem
from tcstudy.fem.boundary import ContactLine
from tcstudy.fem.meshes import PlaneMesh
from tcstudy.laws.laws import Laws
from tcstudy.laws.pieces import UP
from tcstudy.refine.goals import weight_of_friction
from tcstudy.scene.study import Goal

Array = NDArray[np.float64]

ROUNDINGS = 8.0 * float(np.finfo(float).eps)
"""Distance from a kink, over the largest displacement of the body, at which a given slip is still on it."""


def hidden_effects(goal: Goal, line: ContactLine, problem: ContactProblem, v: Array, u: Array, z: Array) -> Array:
    """(s,) the most that the end cells of a solution v (m,), u (2n,) may change of J, with the dual solution z (m,)."""
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
        most, rests = _most(law, given, float(v[node]), float(traction[node]))
        found[i] = 0.5 * (abs(a) + abs(a - float(z[node]))) * most * width[i]
        if goal.quantity == "slip_length" and rests and most > 0.0:
            found[i] += width[i]
    return found


def _most(law: Laws, given: float, slip: float, traction: float) -> tuple[float, bool]:
    """Largest |b − traction| between a given slip and that of the next node, and whether a hidden zone may stick."""
    between = (law.kinks > min(given, slip)) & (law.kinks < max(given, slip))
    values = [*law.b_left[between], *law.b_right[between], float(law.b(given, 1 if slip > given else -1))]
    rests = (law.kinks == given) & (law.kinds == UP)
    values += [float(np.clip(0.0, law.b_left[k], law.b_right[k])) for k in np.flatnonzero(rests)]
    return float(np.max(np.abs(np.array(values) - traction))), bool(np.any(rests | (between & (law.kinds == UP))))


@dataclass(frozen=True)
class Hidden:
    """Parts of an error that end cells hide, for marking: they shrink with the length of their cell.

    nodes: (k,) held mesh nodes;  curves: (k,) curves of the boundary on which their cells lie
    parts: (k,) of the error;  lengths: (k,) of the cells [m]
    """

    nodes: NDArray[np.intp]
    curves: NDArray[np.intp]
    parts: Array
    lengths: Array

    def on(self, mesh: PlaneMesh) -> Array:
        """(t,) the parts at the triangles that have the cells now, on a mesh refined since."""
        shares = np.zeros(len(mesh.triangles))
        for node, curve, part, length in zip(self.nodes, self.curves, self.parts, self.lengths, strict=True):
            i = np.flatnonzero((mesh.segments == node).any(axis=1) & (mesh.segment_curve == curve))[0]
            a, b = mesh.segments[i]
            own = np.isin(mesh.triangles, (a, b)).sum(axis=1) == 2
            shares[own] += part * float(np.linalg.norm(mesh.points[b] - mesh.points[a])) / length
        return shares


def hidden_on(mesh: PlaneMesh, line: ContactLine, parts: Array) -> Hidden:
    """What (s,) parts on the segments of Γ_C say of the mesh, those at held nodes only."""
    cells = np.flatnonzero(parts)
    nodes = line.segments[cells, np.argmin(line.unknowns[cells], axis=1)]
    return Hidden(nodes, mesh.segment_curve[line.which[cells]], parts[cells], line.lengths[cells])
