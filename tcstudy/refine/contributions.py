"""Where on the body a number J changes when every triangle is cut into four.

With e = u_{h/2} − u_h, the dual solution z on the finer mesh, its interpolant I z and ξ = c b(u_T) on slipping nodes F,

    J(u_{h/2}) − J(u_h) = a(e, z − I z) + Σ_j (z − I z)_j ξ_{h/2,j}
                        + Σ_{j∈F} (a − z)_j c_j b(u_h)_j − Σ_{i∈F} (a − z)_i ξ_{h,i},

the first three sums over nodes of the finer mesh, the last over those of the level, a = 1 for ∫ξ and 0 otherwise,
to first order: the residual of u_h on the finer mesh weighted with what the mesh cannot represent of z, and what lumped
friction says on half the cells. Each hat function of the finer mesh gets its part, signs included, with
a(e, z − I z) = Σ_j (z − I z)_j a(e, φ_j). So parts of the body may be extrapolated with orders of their own, and what
cancels between them is seen: a sum that is small by accident has large parts.

Literature: Richter & Wick, J. Comput. Appl. Math. 279 (2015) 192–208 (localisation by a partition of unity)
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from tcstudy.fem.estimators import own_strain
from tcstudy.fem.recovery import ElementGeometry
from tcstudy.refine.halved import Halved
from tcstudy.scene.friction import sticking
from tcstudy.scene.records import Material
from tcstudy.scene.study import Goal
from tcstudy.solvers.problem import ContactProblem

Array = NDArray[np.float64]


def contributions(
    goal: Goal,
    halved: Halved,
    material: Material,
    problems: tuple[ContactProblem, ContactProblem],
    v: tuple[Array, Array],
    u: tuple[Array, Array],
    z: Array,
) -> Array:
    """(n_f,) parts of J(u_{h/2}) − J(u_h) at the nodes of the finer mesh.

    problems, v: the contact problems of the level and the finer one, and their solutions
    u, z:        (2n_f,) displacements of both and the dual solution, on the finer mesh
    """
    fine = halved.level
    nodes, local = fine.line.nodes, fine.frames.local
    rest = np.where(fine.frames.fixed, 0.0, local(z - halved.interpolated(z)))
    e = u[1] - u[0]
    by_node = np.sum((rest * local(_nodal_forces(halved.triangles, e, material))).reshape(2, -1), axis=0)
    by_node[nodes] += rest[nodes] * problems[1].xi(v[1])
    weight = 1.0 if goal.quantity == "friction_resultant" else 0.0
    lacks = weight - local(z)[nodes]
    law, slips = problems[1].law, ~sticking(problems[1].law, v[1])
    lumped = lacks * fine.line.c * law.value(local(u[0])[nodes], law.piece(v[1]))
    # on the nodes of the level, where both sums of friction all but cancel one by one
    by_node[: halved.coarse.mesh.n_points] += halved.restricted(np.where(slips, lumped, 0.0))
    by_node[halved.coarse.line.nodes] -= halved.at_coarse(np.where(slips, lacks, 0.0)) * problems[0].xi(v[0])
    return by_node


def _nodal_forces(triangles: ElementGeometry, u: Array, material: Material) -> Array:
    """(2n,) a(u, φ_j) of the hat functions in x and y [N/m]."""
    strain = own_strain(triangles, u)
    stress = 2.0 * material.mu * strain
    stress[:, :2] += material.lam * (strain[:, 0] + strain[:, 1])[:, None]
    rows = stress[:, [[0, 2], [2, 1]]] * triangles.area[:, None, None]
    forces = np.einsum("tcd,tkd->ctk", rows, triangles.slopes)
    at, n = triangles.mesh.triangles.ravel(), triangles.mesh.n_points
    return np.concatenate([np.bincount(at, force.ravel(), minlength=n) for force in forces])
