"""The forecast: counts, sizes of meshes before a run, what is left out with its reason, what it
takes."""

import math
from pathlib import Path

import numpy as np
import pytest

import tcstudy
from tcstudy.data.schema import PointStatus
from tcstudy.errors import GeometryFailed
from tcstudy.fem import meshes
from tcstudy.fem.geometry import Geometry
from tcstudy.fem.meshes import PlaneMesh
from tcstudy.offline.level import Level
from tcstudy.read.study import read_study
from tcstudy.refine.family import Family
from tcstudy.scene.mesh_plan import MeshPlan
from tcstudy.scene.study import Study
from tcstudy.study import plan as plan_module
from tcstudy.study import workers as workers_module
from tcstudy.study.plan import plan, resources
from tcstudy.study.workers import (
    PROGRAM_BYTES,
    START_SECONDS,
    counted_sizes,
    predicted_sizes,
    with_refinement,
)
from tests.commands import CONFIGS
from tests.verification.scenes import HEATED_BRACKET, RECTANGLE, study_of


def test_the_file_of_a_run_is_about_as_large_as_said(tmp_path: Path) -> None:
    swept = "sweep={tau: {linspace: [0.001, 0.02, 40]}}"
    loaded = RECTANGLE.replace(
        "top: free", 'top: {role: traction, g: ["0.03*x", -0.01]}'
    )  # zeros would be compressed
    study = study_of(loaded, swept, "mesh={maxh: 0.2, levels: 2}", "output={fields: true}")
    tcstudy.run(study, tmp_path / "out.nc").close()
    size = (tmp_path / "out.nc").stat().st_size
    assert size < plan(study).bytes < 1.5 * size + 1e5


def test_what_a_tolerance_may_need_is_bounded_by_its_unknowns() -> None:
    """Fields of 3 points on meshes that grow twofold up to 400,000 dofs: about 2 · 24 · 200,000
    bytes a point."""
    tolerance = "mesh={maxh: 0.5, tolerance: 1e-3, of: friction_resultant}"
    swept = "sweep={tau: [0.005, 0.01, 0.02]}"
    lines, fields = (
        plan(study_of(RECTANGLE, tolerance, swept, *more))
        for more in ((), ("output={fields: true}",))
    )
    assert len(lines.levels) == 1
    assert 5e5 < lines.bytes < 5e6
    assert 3 * 24 * 2e5 < fields.bytes < 3 * 3 * 40 * 2e5
    assert (
        plan(study_of(RECTANGLE, tolerance.replace("}", ", max_dofs: 5000}"), swept)).bytes
        < lines.bytes / 4
    )


def test_counts_and_what_is_left_out_and_why() -> None:
    swept = HEATED_BRACKET + "sweep: {alpha: [1, 2, 3], E: [1, 2], friction.a: [0.003, 0.004]}\n"
    forecast = plan(study_of(swept))
    assert (forecast.points, len(forecast.levels), forecast.left_out) == (12, 2, ())
    for change, reason in (
        ("material.alpha_T=0", "heat problem: alpha_T (or beta) is 0"),
        (
            "heat={alpha: 1, theta_bar: 5}",
            "heat problem: q is 0 and all given temperatures are equal, so theta is",
        ),
    ):
        assert any(
            text.startswith(reason) for text in plan(study_of(HEATED_BRACKET, change)).left_out
        )
    found = plan(study_of(HEATED_BRACKET, "path={parameter: load, from: 0, to: 2}"))
    assert (
        f"{found.asked}: run does this; for the points of the sweep add --set path=null"
        in found.notes
    )


@pytest.mark.parametrize(
    ("sweep", "changes", "idle"),
    [
        ("alpha: [1, 2, 3], theta_bar: [0, 1], k: [1, 2], friction.a: [0.003, 0.004]", ["heat={}"], ["alpha", "k"]),
        ("alpha: [1, 2, 3], theta_bar: [0, 1], k: [1, 2]", ["heat={}", "material.alpha_T=0"],
         ["alpha", "theta_bar", "k"]),
        ("alpha: [1, 2, 3], q: [0, 0.5]", ["heat={theta_bar: 5}"], []),
        ("theta_bar: [0, 1]", [f"boundary.{edge}={{role: convection, theta_bar: 1}}" for edge in ("right", "bore")],
         ["theta_bar"]),
        ("E: [1, 2]", ["heat={alpha: 1, theta_bar: 5}"], []),
    ],
)  # fmt: skip
def test_a_swept_parameter_that_changes_nothing_is_named(
    sweep: str, changes: list[str], idle: list[str]
) -> None:
    """α and k where θ = θ̄, everything thermal without β; not θ̄ itself, nor α where heat is solved
    at some point."""
    notes = plan(study_of(f"{HEATED_BRACKET}sweep: {{{sweep}}}\n", *changes)).notes
    assert [note.split()[0] for note in notes if "changes nothing (" in note] == idle
    if idle == ["alpha", "k"]:
        assert notes[0].startswith("alpha changes nothing (q is 0 and all given temperatures are")
        assert notes[0].endswith("its 3 values give equal solutions")


AIR = (
    "boundary={bottom: contact, left: {role: convection, alpha: 5, theta_bar: 80}, right: clamped, "
)


@pytest.mark.parametrize(
    ("name", "edges", "why"),
    [
        ("theta_bar", "top: free}", "every edge that exchanges heat has its own theta_bar"),
        ("alpha", "top: free}", "every edge that exchanges heat has its own alpha"),
        ("boundary.left.alpha", "top: free}", "q is 0 and all given temperatures are equal"),
        (
            "theta_bar",
            "top: {role: convection, theta_bar: 20}}",
            "every edge that exchanges heat has its own theta_bar",
        ),
        ("alpha", "top: {role: convection, theta_bar: 80}}", "q is 0 and all given"),
    ],
)
def test_the_reason_why_a_parameter_changes_nothing_is_true(
    name: str, edges: str, why: str
) -> None:
    """θ is 80, θ̄ of the section is not: an edge has its own."""
    text = RECTANGLE.replace("material: {", "material: {k: 1, alpha_T: 0.01, ")
    other = "theta_bar: 0" if name == "alpha" else "alpha: 1"
    air = AIR.replace("alpha: 5, ", "") if name == "boundary.left.alpha" else AIR
    study = study_of(text, f"{air}{edges}", f"heat={{{other}}}", f"sweep={{{name}: [1, 2]}}")
    [note] = [note for note in plan(study).notes if "changes nothing" in note]
    assert f"({why}" in note


def test_a_history_with_elements_much_longer_than_its_strip_is_high_is_told() -> None:
    """By the elements that Netgen makes, which are up to a third shorter than maxh in a thin
    strip."""
    strip = RECTANGLE.replace("width: 2, height: 1", "width: 40, height: 0.25")
    steps = "history={memory: friction, steps: [{f_x: 0.1, in: 2}]}"
    for maxh, more, said in ((1.0, [steps], True), (0.45, [steps], False), (2.0, [], False)):
        notes = plan(study_of(strip, *more, f"mesh={{maxh: {maxh}}}", "loads.f=[0, 0]")).notes
        told = [
            float(note.split()[6])
            for note in notes
            if note.startswith("elements on the contact line are ")
        ]
        assert len(told) == said, maxh
        assert all(0.65 * maxh / 0.25 < ratio < 1.05 * maxh / 0.25 for ratio in told), told


def test_dear_meshing_is_said_with_what_makes_it_cheap(monkeypatch: pytest.MonkeyPatch) -> None:
    """In seconds of this machine, which is timed only where there is much to mesh."""

    def dear(mesh: str) -> list[str]:
        return [
            n
            for n in plan(study_of(RECTANGLE, f"mesh={mesh}")).notes
            if n.startswith("meshing takes about")
        ]

    monkeypatch.setattr(meshes, "triangles_a_second", lambda: 100.0)
    assert (
        15 < float(dear("{maxh: 0.05}")[0].split()[3]) < 25
    )  # 2 · 1 body, 0.866 h² for two triangles
    monkeypatch.setattr(meshes, "triangles_a_second", None)
    assert dear("{maxh: 0.1}") == []
    monkeypatch.undo()
    refine = dear("{maxh: 0.005}")[0].split("mesh.refine: ")[1].split()[0]
    assert dear(f"{{maxh: 0.005, refine: {refine}}}") == []


def test_what_a_run_takes_follows_from_a_trial(monkeypatch: pytest.MonkeyPatch) -> None:
    """By a trial of known times: N^1.08 for mesh and factor, half of it again for a second ratio of
    moduli, a point by its contact nodes, and 60 µs a solution for what is written."""
    sweep, asked = "sweep={nu: [0.2, 0.3], friction.tau: {linspace: [0.01, 0.1, 200]}}", list[int]()
    study = study_of(RECTANGLE, sweep, "mesh={maxh: 0.1, levels: 3}")

    def timed(few: Study, many: Study) -> plan_module.Trial:
        asked.extend((len(few.scenes), len(many.scenes)))
        return plan_module.Trial(1000, 20, 0.05, 1e-3)

    monkeypatch.setattr(plan_module, "_timed", timed)
    found = plan(study)
    each = [
        1e-3 * (0.08e-3 + 2.6e-6 * v.n_contact) / (0.08e-3 + 2.6e-6 * 20) + 6e-5
        for v in found.levels
    ]
    expected = (
        START_SECONDS + sum(0.05 * (v.n_dof / 1000) ** 1.08 for v in found.levels) + 392 * sum(each)
    )
    assert resources(study, found).seconds == pytest.approx(expected)
    assert asked == [plan_module.FEW, plan_module.MANY]


@pytest.mark.parametrize(
    ("study", "why"),
    [
        (study_of(RECTANGLE, "mesh={maxh: 0.5, levels: 6, family: adaptive}"), "estimated error"),
        (
            study_of(
                RECTANGLE,
                "history={memory: friction, steps: [{f_x: 0.1, in: 2}]}",
                "loads.f=[0, 0]",
            ),
            "history step",
        ),
        (study_of(RECTANGLE, "solver=[separable-newton, bundle-newton]"), "solvers"),
    ],
    ids=["adaptive", "history", "bundle"],
)
def test_what_no_trial_tells_is_unknown(
    study: Study, why: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(plan_module, "meshes_of", None)  # nothing is solved for it
    spent = resources(study, plan(study))
    assert math.isnan(spent.seconds)
    assert why in spent.unknown
    assert spent.memory > PROGRAM_BYTES


def test_of_many_geometries_one_mesh_is_made(monkeypatch: pytest.MonkeyPatch) -> None:
    """And counts are those of all; refused ones are named."""
    made, original = list[float](), meshes.mesh_at

    def mesh_at(geometry: Geometry, plan: MeshPlan, *more: object) -> PlaneMesh:
        made.append(geometry.size)
        return original(geometry, plan, *more)  # type: ignore[arg-type]

    monkeypatch.setattr(meshes, "mesh_at", mesh_at)
    widths = "sweep={body.rectangle.width: [1, 1.6, 2, 3], nu: [0.2, 0.3]}"
    region = "body.regions={inner: {rectangle: {corner: [0.5, 0.4], width: 1, height: 0.2}}}"
    found = plan(study_of(RECTANGLE, region, widths))
    assert {round(size, 3) for size in made} == {3.162}
    assert found.points == 8
    assert found.notes[0].startswith("3 geometries: 9 meshes, which the points of a geometry share")
    assert found.notes[1].startswith("refused, body.rectangle.width = 1: ")
    assert found.levels == plan(study_of(RECTANGLE, region, "body.rectangle.width=3")).levels


RING = """
units: none
body:
  outline: [{from: [1, 0], edge: rim, through: [0, 1]}, {from: [-1, 0], edge: rim, through: [0, -1]}]
  holes: [{circle: {center: [0.2, 0], radius: 0.1, edge: bore}}]
boundary: {rim: contact, bore: {role: clamped, u_x: 0}}
material: {E: 1, nu: 0.3}
friction: {law: tresca, tau: 0.01}
mesh: {maxh: 0.5, levels: 4}
"""
"""A closed contact line, a small hole that refines the mesh, and a component left free."""
ROLLER = RECTANGLE.replace("left: clamped", "left: {role: clamped, u_N: 0}")
THIN = "regions: {thin: {rectangle: {corner: [0.5, 0.4], width: 1, height: 0.02}}}"
STRIPS = RECTANGLE.replace("width: 2, height: 1}}", f"width: 2, height: 1}}, {THIN}}}")


def of_run(study: Study) -> list[tuple[int, int, int]]:
    """Nodes, displacement and contact DOFs of the levels that a run makes."""
    family, scene = Family(study), study.scenes[0]
    levels = [Level(family.next(i), scene, (scene,)) for i in range(study.mesh.levels)]
    return [(level.mesh.n_points, level.frames.n_dof, level.line.m) for level in levels]


def said(study: Study) -> list[tuple[int, int, int]]:
    return [(v.nodes, v.n_dof, v.n_contact) for v in counted_sizes(study)]


@pytest.mark.parametrize(
    "study",
    [
        *map(study_of, (RECTANGLE, HEATED_BRACKET, RING, ROLLER, STRIPS)),
        study_of(RECTANGLE, "mesh={maxh: 0.3}"),
        study_of(RECTANGLE, "mesh={maxh: [0.5, 0.3, 0.1]}"),
        study_of(HEATED_BRACKET, "mesh={maxh: 0.4, levels: 3, family: graded}"),
        read_study(CONFIGS / "quickstart.yaml"),
    ],
)
def test_counted_sizes_are_those_of_the_run(study: Study) -> None:
    assert said(study) == of_run(study)
    assert all(v.exact for v in counted_sizes(study))


@pytest.mark.parametrize(
    "mesh", ["{maxh: [0.2, 0.1, 0.05]}", "{maxh: 0.2, levels: 3, family: graded}"]
)
def test_large_meshes_are_predicted_from_the_last_small_one(
    monkeypatch: pytest.MonkeyPatch, mesh: str
) -> None:
    study = study_of(STRIPS, f"mesh={mesh}")
    monkeypatch.setattr(workers_module, "MAX_COUNTED_NODES", 250)
    assert [v.exact for v in counted_sizes(study)] == [True, False, False]
    for (nodes, n_dof, m), real in zip(said(study), of_run(study), strict=True):
        assert (nodes, n_dof) == pytest.approx(real[:2], rel=0.2)
        assert m == pytest.approx(real[2], rel=0.3)


def test_no_mesh_that_is_large_already_is_made(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(meshes, "mesh_at", None)
    study = study_of(RECTANGLE, "mesh={maxh: 0.005, levels: 2}")
    assert counted_sizes(study) == predicted_sizes(study)
    assert not any(v.exact for v in counted_sizes(study))


def fail_at(monkeypatch: pytest.MonkeyPatch, bad: int) -> None:
    original = meshes.mesh_at

    def mesh_at(geometry: object, plan: object, level: int, coarser: object) -> object:
        if level == bad:
            raise GeometryFailed("the mesher gave up")
        return original(geometry, plan, level, coarser)  # type: ignore[arg-type]

    monkeypatch.setattr(meshes, "mesh_at", mesh_at)


def test_a_mesh_that_cannot_be_made(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """It ends a run before work if it is the first or others follow from it, else it is a status of
    its points."""
    listed = study_of(RECTANGLE, "mesh={maxh: [0.5, 0.3, 0.2]}")
    for bad, study in ((0, study_of(RECTANGLE)), (1, study_of(RECTANGLE)), (0, listed)):
        with monkeypatch.context() as patch:
            fail_at(patch, bad)
            with pytest.raises(GeometryFailed, match="gave up"):
                counted_sizes(study)
    fail_at(monkeypatch, 1)
    assert [v.exact for v in counted_sizes(listed)] == [True, False, True]
    tree = tcstudy.run(listed, tmp_path / "out.nc")
    assert tree["status"].values.tolist() == [1, int(PointStatus.MESH_FAILED), 1]
    assert (tree["reason"].values[1], np.isnan(tree["energy"].values[1])) == (
        "the mesher gave up",
        True,
    )


def test_meshes_after_the_known_ones_are_bounded() -> None:
    study = study_of(
        RECTANGLE, "mesh={maxh: 0.5, tolerance: 1e-3, of: friction_resultant, max_dofs: 10000}"
    )
    n_dofs = [v.n_dof for v in with_refinement(counted_sizes(study), study.mesh)]
    assert n_dofs[-1] == pytest.approx(10000, rel=0.01)
    assert n_dofs[1] == pytest.approx(2 * n_dofs[0])
    few = study_of(RECTANGLE, "mesh={maxh: 0.5, levels: 3, family: adaptive}")
    assert len(with_refinement(counted_sizes(few), few.mesh)) == 3
    assert with_refinement(
        counted_sizes(study_of(RECTANGLE)), study_of(RECTANGLE).mesh
    ) == counted_sizes(study_of(RECTANGLE))
