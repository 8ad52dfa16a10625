"""Whether tolerances of goals are met: true against asked-for errors on solutions with fronts at random places.

    python -m tests.benchmarks.tolerances          # prints a table; about a minute

Scenes:    stick meets slip in closed form (tests.verification.goal_scenes.front_study), the front at COUNT places drawn
           from a fixed seed, on coarse meshes of three sizes
Judged by: true relative error of the last solution over the tolerance; above 1 the tolerance is missed
"""

from __future__ import annotations

import argparse
from dataclasses import dataclass

import numpy as np

from tcstudy.scene.records import Goal
from tests.verification.goal_scenes import (
    RESULTANT,
    SLIP_LENGTH,
    front_resultant,
    front_slip,
    front_study,
    to_tolerance,
)

COUNT, SEED = 24, 1001
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
    parser.add_argument("--count", type=int, default=COUNT)
    parser.add_argument("--seed", type=int, default=SEED)
    options = parser.parse_args()
    print(table(trials(options.count, options.seed)))


if __name__ == "__main__":
    main()
