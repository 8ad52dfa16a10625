"""What a run costs, by a clock that every part of the work moves on by a known time."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from tcstudy.data.records import BlockRecord
from tcstudy.fem.study_meshes import Meshes
from tcstudy.scene.study import MeshPlan
from tcstudy.study import cost, level_solver, run
from tcstudy.study.cost import CostCurve, MeasuredLevel, Stages, walk
from tests.verification.scenes import RECTANGLE, study_of

GEOMETRY, MESH, ASSEMBLY, POINT, SOLVE, ESTIMATE = 1000.0, 1.0, 10.0, 100.0, 30.0, 5.0


class Clock:
    """Stands for the module `time`."""

    def __init__(self) -> None:
        self.now = 0.0

    def perf_counter(self) -> float:
        return self.now

    def timed(self, seconds: float, do: Callable[..., Any]) -> Callable[..., Any]:
        """The same work, which takes so long."""

        def slow(*arguments: Any, **named: Any) -> Any:
            self.now += seconds
            return do(*arguments, **named)

        return slow


@pytest.fixture
def clock(monkeypatch: pytest.MonkeyPatch) -> Clock:
    clock = Clock()
    family, finish = run.Family, level_solver.LevelSolver._finish

    def make(study: Any) -> Any:
        meshes = family(study) if study.mesh.estimates else Meshes(study)
        clock.now += GEOMETRY
        meshes.next = clock.timed(MESH, meshes.next)  # type: ignore[method-assign]
        if isinstance(meshes, family):
            meshes.estimator = clock.timed(ESTIMATE, meshes.estimator)  # type: ignore[method-assign]
        return meshes

    def slow(*arguments: Any) -> Iterator[BlockRecord]:
        for block in finish(*arguments):
            clock.now += POINT
            yield replace(block, numbers={**block.numbers, "time_solve": np.array([SOLVE])})

    for module in (run, level_solver):
        monkeypatch.setattr(module, "time", clock)
    monkeypatch.setattr(run, "meshes_of", make)
    monkeypatch.setattr(run, "Level", clock.timed(ASSEMBLY, run.Level))
    monkeypatch.setattr(level_solver.LevelSolver, "_finish", slow)
    return clock


def stages(plan: MeshPlan) -> list[Stages]:
    study = study_of(RECTANGLE, "boundary.top={role: traction, g: [0.02, -0.01]}")
    steps = walk(study, plan, lambda name, level: False)
    return [step.stages["separable-newton"] for step in steps]


def test_uniform_meshes_cost_all_refinements_and_one_solution(clock: Clock) -> None:
    for level, found in enumerate(stages(MeshPlan((0.5,), 3))):
        assert found == Stages(GEOMETRY + (level + 1) * MESH, ASSEMBLY, POINT - SOLVE, SOLVE, 0.0)


def test_listed_meshes_cost_their_own_meshing_only(clock: Clock) -> None:
    for found in stages(MeshPlan((0.6, 0.5, 0.4), 3)):
        assert found == Stages(GEOMETRY + MESH, ASSEMBLY, POINT - SOLVE, SOLVE, 0.0)


@pytest.mark.parametrize("tolerance", [None, 1e-9])
def test_meshes_that_follow_from_solutions_cost_all_levels_before(clock: Clock, tolerance: float | None) -> None:
    """With a tolerance the last level's estimate, too: without it no one would know to stop."""
    before, last = MESH + ASSEMBLY + POINT + ESTIMATE, ESTIMATE if tolerance else 0.0
    found = stages(MeshPlan((0.5,), 3, "adaptive", tolerance=tolerance))
    assert len(found) == 3
    for level, one in enumerate(found):
        assert one == Stages(GEOMETRY + MESH, ASSEMBLY, POINT - SOLVE, SOLVE, level * before + last)
        assert one.total == pytest.approx(GEOMETRY + MESH + ASSEMBLY + POINT + level * before + last)


def test_a_solver_is_left_behind_only_where_it_is_slow_in_both_ways(monkeypatch: pytest.MonkeyPatch) -> None:
    """More than 3 s and more than four times all other work."""
    level = SimpleNamespace(n_dof=10)

    def dropped(solve: float, other: float) -> bool:
        taken = {"first": Stages(other, 0, 0, 0.1, 0), "second": Stages(other, 0, 0, solve, 0)}
        asked = list[bool]()

        def walk(study: object, plan: object, wanted: Callable[[str, int], bool]) -> Iterator[MeasuredLevel]:
            for i in range(2):
                asked.append(wanted("second", i))
                yield MeasuredLevel({"first": level}, taken, 0.0)  # type: ignore[dict-item]

        monkeypatch.setattr(cost, "walk", walk)
        notes: list[str] = []
        list(CostCurve("uniform", MeshPlan((0.5,), 1)).first_run(None, lambda text, left: None, notes))  # type: ignore[arg-type]
        assert bool(notes) == (asked == [True, False])
        return asked == [True, False]

    assert [dropped(2.9, 0.1), dropped(4.0, 1.1), dropped(4.0, 0.9)] == [False, False, True]
