"""What does the proved bound of a heated body cost? `python -m tests.benchmarks.bound_costs` adds a
chapter to results/speed.md in a minute.

A block with a source, cooled on its top, on a softening film. Times are process CPU times of one
thread over that of the P1 factorisation of the same mesh: elastic matrix, Ã and its condition.
"""

import gc
import time
from collections.abc import Callable

import numpy as np
from threadpoolctl import threadpool_limits

from tcstudy.contact.solve import solve_contact
from tcstudy.fem.meshes import PlaneMesh
from tcstudy.offline import heat_bound
from tcstudy.offline.error_bound import ErrorBounds
from tcstudy.offline.heat_bound import HeatBounds
from tcstudy.offline.level import Level
from tcstudy.scene.records import Scene
from tests.benchmarks.cases import publish_chapter
from tests.benchmarks.peers import machine
from tests.evidence import record
from tests.verification.scenes import levels_of, study_of

BLOCK = """
units: none
body: {rectangle: {width: 2, height: 1}}
boundary:
  {bottom: contact, left: clamped, right: free, top: {role: convection, alpha: 1, theta_bar: 0}}
material: {E: 1, nu: 0.3, k: 1, alpha_T: 1e-2}
heat: {q: 2}
friction: {law: slip-weakening, tau_s: 2e-3, tau_k: 1e-3, delta: 6e-3}
mesh: {maxh: 0.33, levels: 6}
"""
RUNS = 9
WHOLE = "the whole bound"
PARTS = (
    "equilibrium elements of the triangles",
    "their assembly and factorisation",
    "loads, contact problem, M",
    "temperature that is quadratic, its flux, η_t",
    "M_h of a coarser mesh",
)
OWN = "M_h of this mesh, only where T is large"


def main() -> None:
    study = study_of(BLOCK)
    scene, levels = study.scenes[0], levels_of(study)
    meshes = [level.mesh for level in levels[3:]]
    shares = []
    with threadpool_limits(limits=1):
        for mesh in meshes:
            costs(mesh, scene)  # what is loaded and planned once is no part of any cost
            shares.append(np.median([costs(mesh, scene) for _ in range(RUNS)], axis=0))
            gc.collect()
    titles = [f"{len(mesh.triangles):,} triangles" for mesh in meshes]
    rows = [f"| cost / P1 factorisation | {' | '.join(titles)} |", "|---|" + "--:|" * len(meshes)]
    for name, row in zip((WHOLE, *PARTS, OWN), np.transpose(shares), strict=True):
        rows.append(f"| {name} | {' | '.join(f'{share:.1f}' for share in row)} |")
    publish_chapter(
        "speed", "The proved bound of a heated body", "bound_costs", [machine(), "", *rows]
    )
    middle = dict(zip((WHOLE, *PARTS, OWN), shares[len(shares) // 2], strict=True))
    whole, factor = (middle[name] for name in (WHOLE, PARTS[1]))
    record("speed.bound", f"{whole:.0f} times, its factorisation alone {factor:.1f} times")


def costs(mesh: PlaneMesh, scene: Scene) -> list[float]:
    """CPU times of a bound and its parts over that of the P1 factorisation, in the order of the
    table."""
    level, fresh = Level(mesh, scene), Level(mesh, scene)
    p1 = seconds(lambda: level.lambda_1(scene))
    v = solve_contact(level.condensed(scene).problem).v
    for solved in (level, fresh):  # what a study has anyway
        solved.displacement(scene, v)
    heat_bound._CONSTANTS.clear()
    whole = seconds(lambda: ErrorBounds(fresh).look(scene, v))
    heat_bound._CONSTANTS.clear()
    bounds, theta = ErrorBounds(level), level.temperature(scene).theta
    dual = seconds(lambda: level.dual(scene))
    elements = seconds(level.dual(scene)[0].elements.factorised)
    heat, ancestor = bounds._heat, mesh.ancestor
    assert ancestor is not None
    flux = seconds(lambda: heat.energy(scene, heat.improved(scene, theta)))
    coarse = seconds(lambda: HeatBounds(ancestor).constant(scene))
    heat.bound(scene, theta, residual=np.inf)  # is kept for `look`
    rest = seconds(lambda: bounds.look(scene, v))
    own = seconds(lambda: heat.constant(scene))
    return [part / p1 for part in (whole, elements, dual - elements, rest, flux, coarse, own)]


def seconds(action: Callable[[], object]) -> float:
    start = time.process_time()
    action()
    return time.process_time() - start


if __name__ == "__main__":
    main()
