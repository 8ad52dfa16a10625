"""Estimated over true errors of goals, scene by scene: `python -m tests.benchmarks.goals`, half a minute."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from tcstudy.scene.study import FamilyName, Goal, Study
from tests.verification import manufactured
from tests.verification.goal_scenes import (
    BRACKET,
    FILM,
    HEATED,
    OBTUSE,
    RESULTANT,
    SLIP_LENGTH,
    at_crossing,
    fine_value,
    front_resultant,
    front_slip,
    front_study,
    ring_scene,
    scene_of,
    spring_scene,
    table,
    value_at_corner,
)


def manufactured_resultant() -> float:
    """∫₀¹ ξ of the manufactured solution, a quadratic: exact by Simpson's rule."""
    return float(np.array([1.0, 4.0, 1.0]) @ manufactured.friction(np.array([0.0, 0.5, 1.0])) / 6.0)


def goal_cases() -> Iterator[tuple[str, Study, Goal, float]]:
    """Scene, study, goal and its true value: scenes of tests/verification/."""
    smooth = manufactured.manufactured_study(1, 0.25)
    yield "thermoelastic, smooth", smooth, RESULTANT, manufactured_resultant()
    yield "thermoelastic, smooth", smooth, Goal("u_T", (0.4, 0.0)), float(manufactured.slip(np.array(0.4)))
    for change in (1 / 3, 0.447, 0.683):
        study = front_study(change)
        name = f"front at {change:.3f}"
        yield name, study, RESULTANT, front_resultant(change)
        yield name, study, Goal("u_T", (0.85, 0.0)), front_slip(change, 0.85)
        yield name, study, SLIP_LENGTH, 1.0 - change
    ring, resultant, slip = ring_scene()
    yield "ring", ring, RESULTANT, resultant
    yield "ring", ring, Goal("u_T", (math.cos(0.7), math.sin(0.7))), slip
    springs, resultant = spring_scene()
    yield "springs", springs, RESULTANT, resultant
    yield "springs", springs, Goal("u_T", (0.3, 0.0)), math.sin(0.3 * math.pi)
    for name, text in (("film", FILM), ("heated", HEATED)):
        for goal in (Goal("u_T", (1.4, 0.0)), SLIP_LENGTH, *([RESULTANT] if name == "film" else [])):
            yield name, scene_of(text), goal, fine_value(text, goal, 3000)
    bracket = scene_of(BRACKET)
    yield "bracket", bracket, RESULTANT, value_at_corner(bracket, RESULTANT, OBTUSE)


def main() -> None:
    """A row for each scene, goal and family: median, and true relative error and effectivity by level."""
    print("| scene | goal | meshes | median | unknowns: relative error (estimate/error, * at a crossing) |")
    print("|---|---|---|---|---|")
    families: tuple[tuple[FamilyName, int], ...] = (("uniform", 4), ("adaptive", 20))
    for name, study, goal, known in goal_cases():
        for family, levels in families:
            rows = table(study, goal, known, family, levels, 3000)
            crossing = [at_crossing(rows, i) for i in range(len(rows))]
            usual = [row.effectivity for row, at in zip(rows[2:], crossing[2:], strict=True) if not at]
            cells = [
                f"{row.n_dof}: {abs(row.signed):.0e} ({row.effectivity:.2f}{'*' if at else ''})"
                for row, at in zip(rows, crossing, strict=True)
            ]
            median = f"{np.median(usual):.2f}" if usual else "–"
            print(f"| {name} | {goal.quantity} | {family} | {median} | {', '.join(cells)} |", flush=True)


if __name__ == "__main__":
    main()
