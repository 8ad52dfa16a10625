"""Estimated over true errors of goals, scene by scene: `python -m tests.benchmarks.goals`, half a
minute."""

import math
from collections.abc import Iterator

import numpy as np

from tcstudy.scene.mesh_plan import FamilyName, Goal
from tcstudy.scene.study import Study
from tests.verification import goal_scenes as scenes
from tests.verification import manufactured
from tests.verification.goal_scenes import RESULTANT, SLIP_LENGTH


def goal_cases() -> Iterator[tuple[str, Study, Goal, float]]:
    """Scene, study, goal and its true value: scenes of tests/verification/."""
    smooth = manufactured.manufactured_study(1, 0.25)
    resultant = np.array([1.0, 4.0, 1.0]) @ manufactured.friction(np.array([0.0, 0.5, 1.0])) / 6.0
    yield (
        "thermoelastic, smooth",
        smooth,
        RESULTANT,
        float(resultant),
    )  # ∫ξ of a quadratic, by Simpson's rule
    yield (
        "thermoelastic, smooth",
        smooth,
        Goal("u_T", (0.4, 0.0)),
        float(manufactured.slip(np.array(0.4))),
    )
    for change in (1 / 3, 0.447, 0.683):
        study, name = scenes.front_study(change), f"front at {change:.3f}"
        yield name, study, RESULTANT, scenes.front_resultant(change)
        yield name, study, Goal("u_T", (0.85, 0.0)), scenes.front_slip(change, 0.85)
        yield name, study, SLIP_LENGTH, 1.0 - change
    ring, resultant, slip = scenes.ring_scene()
    yield "ring", ring, RESULTANT, resultant
    yield "ring", ring, Goal("u_T", (math.cos(0.7), math.sin(0.7))), slip
    springs, resultant = scenes.spring_scene()
    yield "springs", springs, RESULTANT, resultant
    yield "springs", springs, Goal("u_T", (0.3, 0.0)), math.sin(0.3 * math.pi)
    for name, text in (("film", scenes.FILM), ("heated", scenes.HEATED)):
        for goal in (
            Goal("u_T", (1.4, 0.0)),
            SLIP_LENGTH,
            *([RESULTANT] if name == "film" else []),
        ):
            yield name, scenes.scene_of(text), goal, scenes.fine_value(text, goal, 3000)
    bracket = scenes.scene_of(scenes.BRACKET)
    yield "bracket", bracket, RESULTANT, scenes.value_at_corner(bracket, RESULTANT, scenes.OBTUSE)


def main() -> None:
    """A row for each scene, goal and family: median, and true relative error and effectivity by
    level."""
    print(
        "| scene | goal | meshes | median | unknowns: relative error (estimate/error, * at a crossing) |"
    )
    print("|---|---|---|---|---|")
    families: tuple[tuple[FamilyName, int], ...] = (("uniform", 4), ("adaptive", 20))
    for name, study, goal, known in goal_cases():
        for family, levels in families:
            rows = scenes.table(study, goal, known, family, levels, 3000)
            crossing = [scenes.at_crossing(rows, i) for i in range(len(rows))]
            usual = [
                row.effectivity for row, at in zip(rows[2:], crossing[2:], strict=True) if not at
            ]
            cells = [
                f"{row.n_dof}: {abs(row.signed):.0e} ({row.effectivity:.2f}{'*' if at else ''})"
                for row, at in zip(rows, crossing, strict=True)
            ]
            median = f"{np.median(usual):.2f}" if usual else "–"
            print(
                f"| {name} | {goal.quantity} | {family} | {median} | {', '.join(cells)} |",
                flush=True,
            )


if __name__ == "__main__":
    main()
