"""The rules of a measurement of accuracy against cost, without fine meshes."""

from collections.abc import Callable, Iterator
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from tcstudy.data.schema import PointStatus
from tcstudy.data.tables import BOUND, MEASURES
from tcstudy.errors import CostError, GeometryFailed
from tcstudy.scene.mesh_plan import MeshPlan
from tcstudy.scene.solver_plan import SOLVERS
from tcstudy.study import cost
from tcstudy.study.cost import CostCurve, at_point, family_plan, follow, reference_of, walk
from tcstudy.study.level_solver import Times
from tcstudy.study.reference import SolvedLevel
from tests.verification.scenes import RECTANGLE, study_of

WIDTHS = "sweep={body.rectangle.width: [1.5, 2, 2.5], friction.tau: [0.01, 0.02]}"


def silent(text: str, left: float | None) -> None:
    """Say nothing of the progress."""


def test_a_point_is_taken_on_its_own_geometry() -> None:
    study = study_of(RECTANGLE, WIDTHS)
    alone = at_point(study, (1, 1))
    assert alone.axes == ()
    (scene,) = alone.scenes
    assert scene.body.outline is not None
    assert max(x for edge in scene.body.edges for x in (edge.start[0], edge.end[0])) == 2.0
    (law,) = scene.laws
    assert law.b_scale == 0.02


def test_two_solvers_agree_up_to_rounding_only() -> None:
    def agree(difference: float, parts: tuple[int, ...] = (1,)) -> bool:
        v = np.array([1.0, -2.0])
        solution: Any = SimpleNamespace(v=v, parts=parts)
        other: Any = SimpleNamespace(v=v + difference, parts=(1,))
        return cost._is_same(solution, other)

    assert agree(0.0)
    assert agree(1e-8)
    assert not agree(1e-7)
    assert not agree(0.0, parts=())


def test_errors_are_measured_once_for_equal_solutions() -> None:
    study: Any = SimpleNamespace(solver=SimpleNamespace(names=("a", "b", "c")), scenes=(None,))
    v = {"a": 1.0, "b": 1.0, "c": 2.0}
    level: Any = SimpleNamespace(
        solutions={name: SimpleNamespace(v=np.array([x]), parts=(1,)) for name, x in v.items()}
    )
    measured = list[str]()

    def errors(level: object, name: str, scene: object) -> dict[str, tuple[float, float]]:
        measured.append(name)
        return {"u_L2": (v[name], 1.0)}

    reference: Any = SimpleNamespace(errors=errors)
    found = cost._errors_by_solver(study, level, reference)
    assert measured == ["a", "c"]
    assert {name: error["u_L2"][0] for name, error in found.items()} == v


def test_errors_are_relative_and_those_measured_nowhere_are_left_out() -> None:
    values = dict[str, Any]()
    for measure in MEASURES:
        values[f"error_{measure.name}"] = np.array([np.nan, np.nan])
        values[f"dominated_{measure.name}"] = np.array([False, False])
    nothing = {name: array.copy() for name, array in values.items()}
    values["error_u_L2"] = np.array([1.0, 0.5])
    cost._divide_by_norms(values, {"u_L2": 4.0, BOUND.name: 1.0})
    assert {*values} == {"error_u_L2", "dominated_u_L2"}
    assert values["error_u_L2"].tolist() == [0.25, 0.125]
    with pytest.raises(CostError, match="nothing loads this scene"):
        cost._divide_by_norms(nothing, {BOUND.name: 1.0})


def walked(sizes: list[int], failure: GeometryFailed | None = None) -> Callable[..., Iterator[Any]]:
    """A walk along meshes of these sizes, whose mesher fails at the end."""

    def steps(study: object, plan: MeshPlan, is_wanted: object = None) -> Iterator[Any]:
        for n_dof in sizes:
            solution = SimpleNamespace(status=PointStatus.OK, numbers={"error_estimate": 0.01})
            solutions: Any = {"separable-newton": solution}
            level: Any = None
            yield SolvedLevel(n_dof, level, level, solutions), {"separable-newton": 1.0}
        if failure is not None:
            raise failure

    return steps


def test_a_reference_has_ten_times_the_unknowns_and_two_at_least(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    study = study_of(RECTANGLE)
    curve: Any = SimpleNamespace(levels=[SimpleNamespace(n_dof=100)])
    failure = GeometryFailed("triangles are too small")

    def dofs(*sizes: int) -> int:
        monkeypatch.setattr(cost, "walk", walked([*sizes], failure))
        words = reference_of(study, [curve], silent).words
        assert words.endswith("with an estimated error of 1 % in energy")
        return int(words.split()[3])

    assert dofs(150, 999, 1000, 5000) == 1000
    assert dofs(100, 200) == 200  # the mesher ends there
    for sizes in ((), (100, 199)):
        with pytest.raises(GeometryFailed, match="too small"):
            dofs(*sizes)


def test_other_solvers_run_only_where_they_are_wanted(monkeypatch: pytest.MonkeyPatch) -> None:
    """A walk keeps the fields that errors need, and no data of live points."""
    asked = list[tuple[str, int]]()
    outputs = list[tuple[bool, bool]]()
    stage = SimpleNamespace(level=object(), times=Times(), stop=lambda: "", blocks=[None])
    solution = SimpleNamespace(numbers={"time_solve": 1.0})

    def stages(study: Any) -> Iterator[Any]:
        outputs.append((study.output.fields, study.output.live))
        yield from (stage, stage)

    def solve(study: Any, level: object, place: int) -> None:
        asked.append((study.solver.names[0], place))

    monkeypatch.setattr(cost, "stages", stages)
    monkeypatch.setattr(cost, "solve_point", solve)
    monkeypatch.setattr(cost, "solution_of", lambda *_: solution)
    monkeypatch.setattr(SolvedLevel, "of", lambda level, solutions: solutions)
    study = study_of(RECTANGLE, f"solver=[{', '.join(SOLVERS)}]", "output.live=true")
    plan = MeshPlan((0.8,), 2)
    assert [len(times) for _, times in walk(study, plan)] == [1, 1]
    assert asked == []
    assert [len(times) for _, times in walk(study, plan, lambda name, i: i == 1)] == [1, 2]
    assert asked == [(SOLVERS[1], 0)]
    assert outputs == [(True, False), (True, False)]


def test_families_are_timed_again_without_their_guarantee(monkeypatch: pytest.MonkeyPatch) -> None:
    """The study's own meshes may depend on it."""
    guarantees = list[str]()

    def steps(study: object, plan: MeshPlan, is_wanted: object = None) -> Iterator[Any]:
        guarantees.append(plan.guarantee)
        yield None, {"separable-newton": 2.0}
        yield None, {"separable-newton": 3.0}

    monkeypatch.setattr(cost, "walk", steps)
    plan = MeshPlan((0.8,), 2, guarantee="bounds")
    level: Any = SimpleNamespace(solutions={})
    for family in ("uniform", cost.OWN):
        curve = CostCurve(family, plan, levels=[level])
        assert cost._times_of_another_run(study_of(RECTANGLE), curve) == [{"separable-newton": 2.0}]
    assert guarantees == ["none", "bounds"]


@pytest.mark.parametrize(
    ("solve", "other", "is_left_out"), [(3.0, 0.5, False), (4.0, 1.0, False), (4.0, 0.5, True)]
)
def test_a_solver_is_left_out_beyond_both_limits(
    solve: float, other: float, is_left_out: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    solutions = {
        "one": SimpleNamespace(numbers={"time_solve": 0.25}),
        "two": SimpleNamespace(numbers={"time_solve": solve}),
    }
    level = SimpleNamespace(n_dof=10, solutions=solutions)
    times = {"one": 0.25 + other, "two": solve + other}
    monkeypatch.setattr(cost, "walk", lambda *_: iter([(level, times)]))
    notes = list[str]()
    study: Any = None
    list(follow(CostCurve("uniform", MeshPlan((0.5,), 1)), study, silent, notes))
    assert bool(notes) == is_left_out


def test_the_next_level_is_expected_to_grow_as_the_last_one() -> None:
    level: Any = SimpleNamespace(n_dof=100)
    finer: Any = SimpleNamespace(n_dof=300)
    plan = family_plan(MeshPlan((0.5,), 1), "uniform")
    assert CostCurve("uniform", plan, levels=[level]).next_dofs == 400.0
    assert CostCurve("uniform", plan, levels=[level, finer]).next_dofs == 900.0
    assert (plan.levels, plan.tolerance, plan.maxh) == (cost.MAX_LEVELS, None, (0.5,))
