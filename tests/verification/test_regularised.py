"""An independent solution of the same discrete problem: NGSolve's own Newton method on a smoothed law.

|s| is replaced by √(s² + ε²) − ε in j and the friction term is integrated by the trapezoidal rule, which with free
ends is exactly Σ c_i j(v_i). As ε vanishes the minimiser tends to ours; nothing of our condensation, boundary
treatment or solver takes part in it.
"""

from __future__ import annotations

import ngsolve as ngs
import numpy as np
from ngsolve.solvers import NewtonMinimization

from tcstudy.contact.solve import solve_contact
from tcstudy.fem.geometry import build
from tcstudy.offline.level import Level
from tests.verification.scenes import mesh_family, study_of

A, B, DELTA = 0.08, 0.05, 0.3
STUDY = f"""
units: none
body: {{rectangle: {{width: 2, height: 1}}}}
boundary: {{bottom: contact, top: clamped, right: {{role: traction, g: ["0.25*(1 - y)", 0]}}, left: free}}
material: {{lambda: 1.2, mu: 0.8}}
friction: {{law: exponential, a: {A}, b: {B}, delta: {DELTA}}}
mesh: {{maxh: 0.15}}
"""


def smoothed_solution(level: Level, eps: float, start: object = None) -> tuple[object, np.ndarray]:
    """u of the smoothed problem by NewtonMinimization, started from a less smooth neighbour's."""
    mesh = level.mesh.mesh
    space = ngs.VectorH1(mesh, order=1, dirichlet=level.mesh.region("top"), dirichlety=level.mesh.region("bottom"))
    u = space.TrialFunction()
    energy = ngs.BilinearForm(space)
    strain = ngs.Sym(ngs.Grad(u))
    energy += ngs.Variation((0.5 * 1.2 * ngs.div(u) ** 2 + 0.8 * ngs.InnerProduct(strain, strain)) * ngs.dx)
    energy += ngs.Variation(-0.25 * (1 - ngs.y) * u[0] * ngs.ds(level.mesh.region("right"), bonus_intorder=2))
    slip = ngs.sqrt(u[0] ** 2 + eps**2) - eps
    j = B * slip + (A - B) * DELTA * (1 - ngs.exp(-slip / DELTA))
    trapezoid = {ngs.SEGM: ngs.IntegrationRule(points=[(0,), (1,)], weights=[0.5, 0.5])}
    energy += ngs.Variation(j * ngs.ds(level.mesh.region("bottom"), intrules=trapezoid))
    solution = ngs.GridFunction(space)
    if start is not None:
        solution.vec.data = start.vec
    NewtonMinimization(
        energy, solution, maxit=100, maxerr=1e-13, linesearch=True, printing=False, inverse="sparsecholesky"
    )
    return solution, np.array(solution.vec.FV().NumPy())


def test_the_smoothed_solution_converges_to_ours() -> None:
    study = study_of(STUDY)
    scene = study.scenes[0]
    mesh = next(iter(mesh_family(build(scene.body), study.mesh)))
    level = Level(mesh, scene)
    condensed = level.condensed(scene)
    answer = solve_contact(condensed.problem)
    ours = level.displacement(scene, answer.v)
    stuck = int(np.count_nonzero(answer.v == 0.0))
    assert 2 < stuck < len(answer.v) - 2
    errors, start = [], None
    for eps in (1e-2, 1e-3, 1e-4, 1e-5, 1e-6, 1e-7):
        start, smoothed = smoothed_solution(level, eps, start)
        errors.append(float(np.max(np.abs(smoothed - ours))) / float(np.max(np.abs(ours))))
    assert errors[-1] < 1e-5, errors
    ratios = np.array(errors[:-1]) / np.array(errors[1:])
    assert np.all(ratios > 5), errors
