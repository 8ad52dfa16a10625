"""Whether tolerances of goals are met: true against asked-for errors on whole scenes at random.

    python -m tests.benchmarks.tolerances --scenes 24 --seed 1     # prints every one; ten seconds a scene
    python -m tests.benchmarks.tolerances --fronts 24 --seed 1001  # closed forms, a table only; about a minute

Scenes:    tests.benchmarks.tolerance_scenes, one goal each, three tolerances, from one coarse mesh
Fronts:    stick meets slip in closed form (tests.verification.goal_scenes.front_study), the front at random places, on
           coarse meshes of three sizes
Judged by: true relative error of the last solution over the tolerance; above 1 the tolerance is missed. The truth of a
           scene is tests.benchmarks.tolerance_reference; tolerances that it is not good enough for (SHARP) are left out
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from tcstudy.contact.contact import solve_contact
from tcstudy.offline.level import Level
from tcstudy.refine.family import Family
from tcstudy.scene.study import Goal, MeshPlan, Study
from tests.benchmarks.tolerance_reference import reference
from tests.benchmarks.tolerance_scenes import draw_scene
from tests.verification.goal_scenes import (
    RESULTANT,
    SLIP_LENGTH,
    front_resultant,
    front_slip,
    front_study,
    to_tolerance,
)

COUNT, SEED = 24, 1
SECONDS = 900.0
"""No scene is begun after so long."""
SHARP = 0.25
"""Largest uncertainty of the reference over a tolerance that it can judge."""
MOST = 60_000
"""max_dofs of a run."""
TOLERANCES = (1e-2, 3e-3, 1e-3)
AT = 0.95
"""Where u_T is asked for, in the slipping part of every scene."""


@dataclass(frozen=True)
class Trial:
    """One tolerance: the goal's name, true error over tolerance, unknowns of the last mesh."""

    goal: str
    tolerance: float
    ratio: float
    n_dof: int


def trials(count: int = COUNT, seed: int = SEED) -> list[Trial]:
    """All goals and tolerances at `count` places of the front."""
    rng, found = np.random.default_rng(seed), []
    for _ in range(count):
        front, maxh = float(rng.uniform(0.15, 0.85)), float(rng.choice([0.25, 0.2, 0.15]))
        study = front_study(front, maxh)
        goals = (
            (RESULTANT, front_resultant(front)),
            (Goal("u_T", (AT, 0.0)), front_slip(front, AT)),
            (SLIP_LENGTH, 1.0 - front),
        )
        for goal, true in goals:
            for tolerance in TOLERANCES:
                value, _, n_dof = to_tolerance(study, goal, tolerance)
                found.append(Trial(goal.quantity, tolerance, abs(value - true) / abs(true) / tolerance, n_dof))
    return found


@dataclass(frozen=True)
class SceneTrial:
    """One tolerance of a scene.

    ratio:   true error over tolerance;  estimate: estimated error over tolerance;  met: the run says that it is
    seconds: wall time
    """

    scene: int
    goal: str
    law: str
    tolerance: float
    met: bool
    ratio: float
    estimate: float
    n_dof: int
    seconds: float

    def __str__(self) -> str:
        said = "MISSED" if self.met and self.ratio > 1.0 else "met" if self.met else "not met, and says so"
        return (
            f"{self.scene:4d} {self.law:17} {self.goal:18} {self.tolerance:5.0e} {said:6} error {self.ratio:5.2f} "
            f"estimate {self.estimate:5.2f} (of the tolerance) {self.n_dof:6d} dofs {self.seconds:5.1f} s"
        )


def scene_trials(count: int, seed: int, seconds: float = SECONDS) -> Iterator[SceneTrial]:
    """Tolerances of whole scenes, as long as there is time."""
    start = time.perf_counter()
    for i in range(count):
        if time.perf_counter() - start > seconds:
            return
        drawn = draw_scene(seed, i)
        goal = drawn.goals[i % len(drawn.goals)]
        truth = reference(drawn.study, goal)
        for tolerance in TOLERANCES:
            if truth.uncertainty <= SHARP * tolerance:
                yield judged(i, drawn.study, goal, tolerance, truth.value)


def judged(scene: int, study: Study, goal: Goal, tolerance: float, true: float) -> SceneTrial:
    """Run to one tolerance."""
    plan = MeshPlan(study.mesh.maxh, 20, "adaptive", goal=goal, tolerance=tolerance, max_dofs=MOST)
    family, problem = Family(replace(study, mesh=plan)), study.scenes[0]
    start = time.perf_counter()
    for i in range(plan.levels):
        level = Level(family.next(i), problem)
        condensed = level.condensed(problem)
        estimator = family.estimator(level)
        assert estimator is not None
        estimator.look((), problem, solve_contact(condensed.problem).v)
        found, n_dof = estimator.estimates[()], level.frames.n_dof
        if stop := estimator.stop(i + 1 == plan.levels):
            break
    ratio, estimate = abs(found.value - true) / abs(true) / tolerance, found.error / tolerance
    law, elapsed = problem.friction.name, time.perf_counter() - start
    met = stop.startswith(f"tolerance {tolerance:g} met")
    return SceneTrial(scene, goal.quantity, law, tolerance, met, ratio, estimate, n_dof, elapsed)


def scene_table(found: list[SceneTrial]) -> str:
    """How many were met, by how much the others are missed."""
    claimed = [t for t in found if t.met]
    ratios = np.array([t.ratio for t in claimed])
    effectivity = np.array([t.estimate / t.ratio for t in claimed if t.ratio > 0.0])
    return (
        f"met {np.count_nonzero(ratios <= 1)} of {len(ratios)} that say so, worst {ratios.max():.2f}, median "
        f"{np.median(ratios):.2f}; {len(found) - len(claimed)} stopped at max_dofs or max_levels and say so\n"
        f"estimate over error: median {np.median(effectivity):.2f}, least {effectivity.min():.2f}"
    )


def table(found: list[Trial]) -> str:
    """A line for each goal."""
    lines = []
    for goal in dict.fromkeys(t.goal for t in found):
        own = [t for t in found if t.goal == goal]
        ratios = np.array([t.ratio for t in own])
        sizes = ", ".join(
            f"{np.median([t.n_dof for t in own if t.tolerance == tolerance]):.0f}" for tolerance in TOLERANCES
        )
        lines.append(
            f"{goal:20} met {np.count_nonzero(ratios <= 1)} of {len(own)}; true error over tolerance: median "
            f"{np.median(ratios):.2f}, worst {ratios.max():.2f}; median unknowns {sizes}"
        )
    return "\n".join(lines)


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--scenes", type=int, default=COUNT)
    parser.add_argument("--fronts", type=int, default=0, help="closed forms instead of scenes, as many")
    parser.add_argument("--seed", type=int, default=SEED)
    parser.add_argument("--seconds", type=float, default=SECONDS, help="no scene is begun after so long")
    options = parser.parse_args()
    if options.fronts:
        print(table(trials(options.fronts, options.seed)))
        return
    found = []
    for trial in scene_trials(options.scenes, options.seed, options.seconds):
        print(trial, flush=True)
        found.append(trial)
    print(scene_table(found))


if __name__ == "__main__":
    main()
