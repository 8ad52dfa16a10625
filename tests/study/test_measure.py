"""Errors over levels, against an exact solution or a finer mesh, and what they cost by mesh family
and solver."""

import itertools
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

import tcstudy
from tcstudy.accuracy.norms import nodal, norms, prolongation
from tcstudy.contact.problem import ContactProblem, Status
from tcstudy.contact.solve import Answer
from tcstudy.data.records import Record
from tcstudy.data.schema import PointStatus
from tcstudy.errors import CostError
from tcstudy.read.study import read_study_text
from tcstudy.scene.mesh_plan import MeshPlan
from tcstudy.scene.study import Study
from tcstudy.study import cost as cost_module
from tcstudy.study import level_solver as point_module
from tcstudy.study.convergence import converge
from tcstudy.study.cost import CostCurve, at_point, cost_to_file, follow, measure, walk
from tcstudy.study.level_solver import Times
from tcstudy.study.reference import ExactReference, FineReference, SolvedLevel, solve_levels
from tests.commands import CONFIGS
from tests.verification.scenes import RECTANGLE, study_of
from tests.verification.series import errors, notes, points, series

FALLING_FILM = """\
units: none
body: {rectangle: {width: 1, height: 1}}
boundary: {bottom: contact, top: clamped, left: convection, right: convection}
material: {lambda: 1.5, mu: 1, beta: 0.5, k: 1}
heat: {alpha: 2}
friction: {law: exponential, a: 0.6, b: 0.2, delta: 0.125}
mesh: {maxh: 0.25, levels: 4}
exact:
  u: ["(x^2-y^2)/60 + 0.05 + y*(0.2 + 0.4*exp(-8*(x^2/60+0.05)))", "x*y/30"]
  theta: "x/3"
  loads: derived
"""


def test_errors_on_a_falling_film_are_those_of_the_exact_solutions_branch() -> None:
    """It is a saddle of the energy there: L = 0.1238, where 0.106 is the least found."""
    found = converge(read_study_text(FALLING_FILM))
    [point] = points(found)
    assert abs(errors(point)["u_energy"].slope - 1.0) < 0.05
    assert errors(point)["u_energy"].verdict == "as_expected"
    assert errors(point)["u_L2"].error[-1] < 0.01
    # at the corner of Γ_C the error is h² (A + B log(1/h)) to four digits on seven levels: rates
    # 1.50, 1.65, 1.74, …
    assert 1.6 < errors(point)["u_T_max"].slope < 1.8
    assert errors(point)["u_T_max"].verdict == errors(point)["xi_max"].verdict == "as_expected"
    assert "|log h|" in errors(point)["xi_max"].reason
    assert abs(series(point, "energy").value[-1] - series(point, "energy").exact) < 1e-5
    [note] = [note for note in notes(found) if "lower energy" in note]
    assert note.startswith(
        "At 1 of 1 points a state of lower energy than the exact solution's was found: by 0.017"
    )


def test_costs_are_those_of_the_exact_solutions_branch() -> None:
    """The lowest state of the film is 60 % of u away on every mesh."""
    cost = _measure(read_study_text(FALLING_FILM, "study", ["mesh.levels=2"]))
    uniform = cost.values["error_u_energy"][0, 0]
    assert uniform[:2] == pytest.approx([0.0197, 0.00998], rel=0.01)
    assert np.isfinite(cost.values["time"][0, 0, :2]).all()


def test_a_run_stores_the_energy_on_the_exact_solutions_branch(tmp_path: Path) -> None:
    """Together in a block and one by one: the exact solution is a start, and not the least; without
    one NaN stands."""
    film = [read_study_text(FALLING_FILM, "study", ["mesh.levels=2", *own])
            for own in ([], ["solver=[separable-newton, bundle-newton]"])]  # fmt: skip
    plain = study_of(PULLED, "mesh={maxh: 0.5}", WEAK)
    together, singly, without = (
        tcstudy.run(one, tmp_path / f"{i}.nc") for i, one in enumerate((*film, plain))
    )
    for tree in (together, singly):
        energy = tree["start_energy"].isel(level=1)
        assert abs(float(energy.sel(start="exact")) - 0.1238) < 2e-4
        assert float(energy.min()) == float(tree["energy"].isel(level=1)) < 0.108
    on_branch = [tree["start_energy"].sel(start="exact") for tree in (together, singly, without)]
    assert np.allclose(on_branch[0], on_branch[1], rtol=1e-12)
    assert np.isnan(on_branch[2]).all()


WARM = (
    RECTANGLE.replace("nu: 0.3}", "nu: 0.3, alpha_T: 0.05, k: 1}")
    + "heat: {theta: '0.3*x*x + 0.1*y'}\n"
)


def test_nested_meshes_give_the_errors_of_exact_prolongation() -> None:
    study = study_of(
        WARM, "mesh={maxh: 0.3, levels: 3}", "boundary.top={role: traction, g: [0.02, -0.01]}"
    )
    levels, scene = solve_levels(study), study.scenes[0]
    mesh, best, reference = (
        levels[-1].mesh,
        levels[-1].solutions[()],
        FineReference(levels[-1], nested=True),
    )
    for level in (0, 1):
        own, found = levels[level].solutions[()], reference.errors(levels[level], (), scene)
        values = own.parts
        for coarse, fine in itertools.pairwise(levels[level:]):
            step = prolongation(coarse.mesh.n_points, fine.mesh.points, fine.mesh.triangles)
            values = tuple(step @ one for one in values)
        off = [nodal(mesh, v - w) for v, w in zip(values, best.parts, strict=True)]
        exact = norms(mesh, off, scene.material.lam, scene.material.mu)
        assert "theta_H1" in exact
        for name, error in exact.items():
            assert found[name][0] == pytest.approx(error, rel=1e-6), name
        nodes = levels[level].line.nodes  # which keep their numbers
        at = [levels[-1].line.nodes.tolist().index(node) for node in nodes]
        assert found["u_T_max"][0] == pytest.approx(abs(own.v - best.v[at]).max(), rel=1e-12)
        assert found["xi_max"][0] == pytest.approx(abs(own.xi - best.xi[at]).max(), rel=1e-12)


SLOT = """
units: none
body:
  outline: [{from: [0, 0], edge: base}, {from: [0.995, 0], edge: slot}, {from: [0.995, 0.6], edge: tip},
    {from: [1.005, 0.6], edge: slot}, {from: [1.005, 0], edge: base}, {from: [2, 0], edge: wall},
    {from: [2, 1], edge: top}, {from: [0, 1], edge: wall}]
boundary: {base: clamped, slot: contact, tip: free, wall: clamped, top: {role: traction, g: [0.05, -0.1]}}
material: {E: 1, nu: 0.3}
friction: {law: slip-weakening, tau_s: 0.02, tau_k: 0.01, delta: 0.5}
mesh: {maxh: 0.3, levels: 4}
"""


def test_friction_is_looked_up_on_its_own_side_of_a_slot() -> None:
    """Both sides are one edge, a thirtieth of a cell apart, and friction has opposite signs
    there."""
    study = study_of(SLOT)
    *coarse, _, last = solve_levels(study)
    for level in coarse:
        error, size = FineReference(last).errors(level, (), study.scenes[0])["xi_L2"]
        assert error < 0.12 * size


def _solved(study: Study, plan: MeshPlan, levels: int) -> list[SolvedLevel]:
    return [level for level, _ in itertools.islice(walk(study, plan), levels)]


def test_an_adaptive_reference_measures_the_true_error_of_uniform_meshes() -> None:
    study = tcstudy.load(CONFIGS / "convergence.yaml")
    scene = study.scenes[0]
    assert study.exact is not None
    uniform = _solved(study, MeshPlan((0.25,), 2), 2)
    fine = _solved(study, MeshPlan((0.25,), 40, "adaptive", marking=0.7), 9)[-1]
    assert fine.n_dof > 10 * uniform[-1].n_dof
    exact, reference = ExactReference(study.exact), FineReference(fine)
    for level in uniform:
        true, measured = (
            one.errors(level, "separable-newton", scene) for one in (exact, reference)
        )
        for name in true.keys() & measured.keys() - {"friction_resultant"}:
            error, _ = measured[name]
            # ξ is a step function on both meshes, and the reference's own error is not small beside
            # it
            slack = 0.2 if name.startswith("xi") else 0.05
            assert error == pytest.approx(true[name][0], rel=slack), (level.n_dof, name)


PULLED = RECTANGLE.replace(
    "left: clamped, top: free", "left: clamped, top: {role: traction, g: [0.02, -0.01]}"
)
WEAK = "friction={law: slip-weakening, tau_s: 0.01, tau_k: 0.005, delta: 1}"
SMALL = ("mesh={maxh: 0.8, levels: 3}",)


def _measure(study: Study) -> Record:
    return measure(at_point(study, (0,) * len(study.shape)), 1, lambda text, left: None)


def own(cost: Record) -> tuple[int, int, int]:
    """(family, solver, level) of the study's settings."""
    told = cost.attributes
    return (
        *(list(cost.values[k]).index(told[f"own_{k}"]) for k in ("family", "solver")),
        int(told["own_level"]),
    )  # type: ignore[return-value]


@pytest.fixture(scope="module")
def cost() -> Record:
    return _measure(study_of(PULLED, *SMALL))


def test_all_families_and_solvers_are_measured_and_errors_fall(cost: Record) -> None:
    assert cost.values["family"] == ["uniform", "graded", "adaptive"]
    assert cost.values["solver"] == ("separable-newton", "bundle-newton")
    assert own(cost) == (0, 0, 2)
    n_dof = cost.values["n_dof"]
    held = n_dof >= 0
    assert np.array_equal(cost.values["status"][:, 0] == PointStatus.OK, held)
    assert np.all(held.sum(axis=1) >= [3, 2, 3])
    assert n_dof[0, 2] == n_dof[0].max() or n_dof[0, 3] < 4.3 * n_dof[0, 2]
    for name in ("u_energy", "u_L2", "xi_L2", "u_T_L2"):
        error = cost.values[f"error_{name}"][:, 0]
        assert all(
            one[-1] < 0.75 * one[0] for one in (family[np.isfinite(family)] for family in error)
        )
        solved = np.isfinite(cost.values[f"error_{name}"][:, 1])
        assert cost.values[f"error_{name}"][:, 1][solved] == pytest.approx(error[solved], rel=1e-6)
    assert "error_theta_L2" not in cost.values


def test_a_guarantee_charts_the_proved_bound_above_the_error() -> None:
    cost = _measure(study_of(PULLED, *SMALL, "mesh.guarantee=true", WEAK))
    held = cost.values["status"][:, 0] == PointStatus.OK
    assert np.isfinite(cost.values["error_u_estimate"][:, 0][held]).all()
    bound, error = (cost.values[f"error_{name}"][:, 0][held] for name in ("u_bound", "u_energy"))
    assert np.all(bound > error)
    assert np.all(
        (bound < 1.4 * error)[error < 0.15]
    )  # the bound is over the least that ‖u‖ can be: wide where coarse


def test_uniform_errors_are_those_of_converge() -> None:
    study = tcstudy.load(CONFIGS / "convergence.yaml", ["mesh.levels=3"])
    cost, known = _measure(study), points(converge(study))[0]
    assert [cost.attributes[name] for name in ("reference", "reference_error")] == [
        "the exact solution",
        0.0,
    ]
    for name, one in errors(known).items():
        slack = 0.15 if name.endswith("max") else 1e-2  # norms at nodes depend on the finest mesh
        assert cost.values[f"error_{name}"][0, 0, :3] == pytest.approx(one.error, rel=slack), name
    resultant, found = (
        series(known, "friction_resultant"),
        cost.values["error_friction_resultant"][0, 0, :3],
    )
    assert found == pytest.approx(
        np.abs(resultant.value - resultant.exact) / abs(resultant.exact), rel=1e-6
    )


def test_meshes_of_no_family_stand_for_themselves() -> None:
    cost = _measure(study_of(PULLED, "mesh={maxh: 0.8, tolerance: 0.3}"))
    assert cost.values["family"][-1] == "study"
    assert own(cost)[:2] == (3, 0)
    assert cost.values["n_dof"][3, own(cost)[2]] > 0
    assert (
        cost.values["error_u_energy"][own(cost)] < 0.39
    )  # the tolerance with a margin for the estimate
    assert np.all(np.diff(cost.values["time"][3, 0, : own(cost)[2] + 1, 0]) > 0.0)
    listed = _measure(study_of(PULLED, "mesh={maxh: [0.8, 0.6]}"))
    assert own(listed) == (3, 0, 1)


def test_the_named_solver_comes_first_and_failures_are_kept(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    original, failed_as = (
        point_module.solve_contact,
        {"status": Status.ITERATION_LIMIT, "reason": "made to fail"},
    )

    def fail(problem: ContactProblem, name: str, *options: object, **more: object) -> Answer:
        answer = original(problem, name, *options, **more)  # type: ignore[arg-type]
        return replace(answer, **failed_as) if name == "bundle-newton" else answer

    monkeypatch.setattr(point_module, "solve_contact", fail)
    with pytest.raises(CostError, match="reference"):
        _measure(study_of(PULLED, *SMALL, "solver=bundle-newton"))
    changes = ["mesh={maxh: 0.25, levels: 2}", "solver=bundle-newton"]
    cost = _measure(tcstudy.load(CONFIGS / "convergence.yaml", changes))
    assert cost.values["solver"][0] == "bundle-newton"
    failed = (cost.values["status"] != PointStatus.OK) & (
        cost.values["status"] != PointStatus.NOT_RUN
    )
    assert failed[:, 0].any()
    assert all(cost.values["reason"][tuple(at)] == "made to fail" for at in np.argwhere(failed))
    assert np.all(cost.values["dominated_u_energy"][failed])


def test_a_scene_without_load_is_refused_and_nothing_is_written(tmp_path: Path) -> None:
    study = study_of(RECTANGLE, *SMALL)
    with pytest.raises(CostError, match=r"nothing loads this scene.*--at"):
        cost_to_file(study, (), "", 1, tmp_path / "a.nc", lambda text, left: None, ["tcstudy"])
    assert not list(tmp_path.iterdir())


def test_meshes_cost_what_they_are_made_of(monkeypatch: pytest.MonkeyPatch) -> None:
    """Uniform meshes all refinements, listed ones their own mesh alone, adaptive ones all solutions
    and estimates before, and meshes to a tolerance the last estimate, which ends them."""
    spent = Times(geometry=1.0, mesh=10.0, assemble=100.0, points=1000.0, estimate=10000.0)
    taken = SimpleNamespace(numbers={"time_solve": 1.0})
    stage = SimpleNamespace(level=object(), times=spent, stop=lambda: "")
    monkeypatch.setattr(
        cost_module, "stages", lambda study: (replace_in(stage, blocks=[None]) for _ in range(3))
    )
    monkeypatch.setattr(cost_module, "solution_of", lambda *of: taken)
    monkeypatch.setattr(SolvedLevel, "of", lambda *of: None)
    study = at_point(study_of(PULLED, *SMALL), ())

    def times(plan: MeshPlan) -> list[float]:
        return [one["separable-newton"] for _, one in walk(study, plan)]

    assert times(MeshPlan((0.8,), 3)) == [1111.0, 1121.0, 1131.0]
    assert times(MeshPlan((0.8, 0.4, 0.2), 3)) == [1111.0] * 3
    assert times(MeshPlan((0.8,), 3, "adaptive")) == [1111.0, 12221.0, 23331.0]
    assert times(MeshPlan((0.8,), 3, "adaptive", tolerance=0.1)) == [11111.0, 22221.0, 33331.0]


def replace_in(one: SimpleNamespace, **more: Any) -> SimpleNamespace:
    return SimpleNamespace(**vars(one) | more)


def test_a_solver_is_left_behind_only_where_it_is_slow_in_both_ways(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """More than 3 s and more than four times all other work."""

    def dropped(solve: float, other: float) -> bool:
        level = SimpleNamespace(
            n_dof=10,
            solutions={
                name: SimpleNamespace(numbers={"time_solve": s})
                for name, s in (("one", 0.1), ("two", solve))
            },
        )
        asked = list[bool]()

        def walk(
            study: object, plan: object, wanted: Callable[[str, int], bool]
        ) -> Iterator[tuple[Any, Any]]:
            for i in range(2):
                asked.append(wanted("two", i))
                yield level, {"one": 0.1 + other, "two": solve + other}

        monkeypatch.setattr(cost_module, "walk", walk)
        notes: list[str] = []
        list(
            follow(CostCurve("uniform", MeshPlan((0.5,), 1)), None, lambda text, left: None, notes)
        )  # type: ignore[arg-type]
        assert bool(notes) == (asked == [True, False])
        return asked == [True, False]

    assert [dropped(2.9, 0.1), dropped(4.0, 1.1), dropped(4.0, 0.9)] == [False, False, True]
