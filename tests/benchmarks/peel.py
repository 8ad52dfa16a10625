"""What does a whole peel test cost? `python -m tests.benchmarks.peel` adds a chapter to
results/speed.md in a minute.

The study peel_arm.yaml on a mesh of 30,000 unknowns, peeled until its crack has run 27 mm. Times are
process CPU times of one thread, medians of runs.
"""

import time
from collections.abc import Callable
from typing import Any

import numpy as np
from threadpoolctl import threadpool_limits

import tcstudy
from tcstudy.contact.path.follow import Follower
from tcstudy.fem.geometry import build
from tcstudy.offline.level import Level
from tcstudy.scene.parameters import path_scene
from tcstudy.scene.records import Scene
from tcstudy.scene.study import Study
from tcstudy.study.path_run import affine_load, follow_branch, follow_path
from tests.benchmarks.cases import publish_chapter
from tests.benchmarks.peers import machine
from tests.commands import CONFIGS
from tests.evidence import record
from tests.verification.scenes import mesh_family

FINER = ("mesh.maxh=0.086 mm", "path.to=4.5 mm", "path.within=[0 mm, 4.5 mm]")
RUNS = 5
PARTS = ("the mesh", "matrices, Ã, loads", "the path", "its minima, forces, results")


def main() -> None:
    study = tcstudy.load(str(CONFIGS / "peel_arm.yaml"), list(FINER))
    with threadpool_limits(limits=1):
        parts(study)  # what is loaded once is no part of any cost
        costs = np.median([parts(study) for _ in range(RUNS)], axis=0)
        values = follow_path(study).values
    segments = len(values["parameter"]) - 1
    crack = 30.0 + 1e3 * float(values["debonded_length"].max())
    size = f"{values['n_dof']:,} displacement DOFs, {values['n_contact']} contact DOFs"
    rows = [f"| {segments:,} segments, {size} | CPU time [s] |", "|---|--:|"]
    rows += [f"| {name} | {cost:.2f} |" for name, cost in zip(PARTS, costs, strict=True)]
    rows += [f"| all | {costs.sum():.2f} |", "", f"The crack is {crack:.1f} mm long at the end."]
    publish_chapter("speed", "A peel test", "peel", [machine(), "", *rows])
    mesh, _, path, _ = costs
    record("speed.peel", f"{costs.sum() / mesh:.1f} times, the path itself {path / mesh:.2f}")


def parts(study: Study) -> list[float]:
    """Return the CPU times [s] of PARTS."""
    plan = study.path
    assert plan
    whole, _ = timed(lambda: follow_path(study))
    of_mesh, meshes = timed(lambda: list(mesh_family(build(plan.scene.body), study.mesh)))
    level = Level(meshes[-1], plan.scene)

    def scene_of(t: float) -> Scene:
        return path_scene(plan.scene, plan.parameter, t)

    of_load, load = timed(lambda: affine_load(level, scene_of, plan.begin, plan.end, plan.name))
    follower = Follower(*plan.within, plan.max_pieces, study.solver.tolerance)
    of_path, _ = timed(
        lambda: follow_branch(load.problem, follower, "from-zero", plan.begin, "forward", plan.name)
    )
    return [of_mesh, of_load, of_path, whole - of_mesh - of_load - of_path]


def timed(action: Callable[[], Any]) -> tuple[float, Any]:
    """Return the CPU time [s] and the result of an action."""
    start = time.process_time()
    result = action()
    return time.process_time() - start, result


if __name__ == "__main__":
    main()
