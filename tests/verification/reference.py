"""Solutions on families of meshes, and their distance in the energy norm from a reference on a much finer mesh.

The distance is ‖u_ref − u_h‖_a itself, by quadrature on the reference mesh, not by a difference of energies. With
friction the energy of a discrete solution is Σ c_i j(v_i) and not ∫j, and L(u_h) − L(u) = ½‖u_h − u‖²_a + ∫(j(u_h,T) −
j(u_T) − ξ(u_h,T − u_T)), so that √(2(L_h − L_ref)) measures the square of the error together with terms of its size.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from matplotlib.tri import Triangulation
from numpy.typing import NDArray

from tcstudy.contact.problem import Status
from tcstudy.contact.solve import solve_contact
from tcstudy.fem.energy_error import own_strain
from tcstudy.fem.meshes import PlaneMesh
from tcstudy.offline.level import Level
from tcstudy.refine.family import Family
from tcstudy.scene.study import MeshPlan, Study

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Solved:
    """One level of a family: its unknowns, estimated relative error, mesh and strain on the triangles (t, 3)."""

    n_dof: int
    estimate: float
    triangles: PlaneMesh
    strain: Array


def solved_levels(study: Study, plan: MeshPlan, most: float = np.inf) -> Iterator[Solved]:
    """Solve the first scene level by level, as a run does; ends with the first level of more than `most` unknowns."""
    study = replace(study, mesh=replace(plan, estimate=True))
    scene, family = study.scenes[0], Family(study)
    for i in range(plan.levels):
        level = Level(family.next(i), scene)
        estimator = family.estimator(level)
        assert estimator is not None
        condensed = level.condensed(scene)
        answer = solve_contact(condensed.problem)
        assert answer.status == Status.CONVERGED, answer.reason
        estimator.look((), scene, answer.v)
        own = own_strain(level.mesh, level.displacement(scene, answer.v))
        yield Solved(level.frames.n_dof, estimator.estimates[()].energy, level.mesh, own)
        if level.frames.n_dof > most:
            return


def distance(solved: Solved, reference: Solved, study: Study) -> float:
    """‖u_ref − u_h‖_a/‖u_ref‖_a by one point for each triangle of the reference mesh."""
    lam, mu = study.scenes[0].material.lam, study.scenes[0].material.mu
    own, fine = solved.triangles, reference.triangles
    centres = fine.corners.mean(axis=1)
    x, y = own.points.T
    found = Triangulation(x, y, own.triangles).get_trifinder()(*centres.T)
    assert np.all(found >= 0)

    def energy(e: Array) -> float:
        square = lam * (e[:, 0] + e[:, 1]) ** 2 + 2.0 * mu * (e[:, 0] ** 2 + e[:, 1] ** 2 + 2.0 * e[:, 2] ** 2)
        return float(fine.area @ square)

    return float(np.sqrt(energy(reference.strain - solved.strain[found]) / energy(reference.strain)))
