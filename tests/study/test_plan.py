"""The forecast: counts, sizes near those of the real meshes, and what is left out with its reason."""

from __future__ import annotations

import math
from pathlib import Path

import pytest

import tcstudy
from tcstudy.fem import meshes, study_meshes
from tcstudy.fem.geometry import Geometry
from tcstudy.fem.meshes import PlaneMesh
from tcstudy.scene.study import MeshPlan, Study
from tcstudy.study import plan as plan_module
from tcstudy.study.plan import plan, resources
from tcstudy.study.sizes import MEMORY, START
from tests.verification.scenes import HEATED_BRACKET, RECTANGLE, study_of


def test_the_file_of_a_run_is_about_as_large_as_said(tmp_path: Path) -> None:
    swept = "sweep={tau: {linspace: [0.001, 0.02, 40]}}"
    loaded = RECTANGLE.replace("top: free", 'top: {role: traction, g: ["0.03*x", -0.01]}')  # zeros would be compressed
    study = study_of(loaded, swept, "mesh={maxh: 0.2, levels: 2}", "output={fields: true}")
    tcstudy.run(study, tmp_path / "out.nc").close()
    size = (tmp_path / "out.nc").stat().st_size
    assert size < plan(study).bytes < 1.5 * size + 1e5


def test_what_a_tolerance_may_need_is_bounded_by_its_unknowns() -> None:
    """Fields of 3 points on meshes that grow twofold up to 400,000 dofs: about 2 · 24 · 200,000 bytes a point."""
    tolerance = "mesh={maxh: 0.5, tolerance: 1e-3, of: friction_resultant}"
    swept = "sweep={tau: [0.005, 0.01, 0.02]}"
    lines, fields = (plan(study_of(RECTANGLE, tolerance, swept, *more)) for more in ((), ("output={fields: true}",)))
    assert len(lines.levels) == 1
    assert 5e5 < lines.bytes < 5e6
    assert 3 * 24 * 2e5 < fields.bytes < 3 * 3 * 40 * 2e5
    assert plan(study_of(RECTANGLE, tolerance.replace("}", ", max_dofs: 5000}"), swept)).bytes < lines.bytes / 4


def test_counts_of_points_factorisations_and_heat_solves() -> None:
    swept = HEATED_BRACKET + "sweep: {alpha: [1, 2, 3], E: [1, 2], friction.a: [0.003, 0.004]}\n"
    forecast = plan(study_of(swept))
    assert (forecast.points, forecast.factorisations, forecast.heat_solves) == (12, 1, 3)  # one factor for every E
    assert plan(study_of(swept.replace("E: [1, 2]", "nu: [0.2, 0.3]"))).factorisations == 2


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        ("material.alpha_T=0", "heat problem: beta is 0"),
        ("heat={alpha: 1, theta_bar: 5}", "heat problem: q is 0 and theta_bar is constant, so theta = theta_bar"),
        ("loads=null", "body force: f is zero"),
    ],
)
def test_what_is_left_out_and_why(change: str, reason: str) -> None:
    assert any(text.startswith(reason) for text in plan(study_of(HEATED_BRACKET, change)).left_out)


def test_notes_on_locking_and_down_jumps() -> None:
    notes = plan(study_of(RECTANGLE, "material.nu=0.49")).notes
    assert any("lock" in text for text in notes)
    dropping = "friction={law: piecewise-linear, points: [[0, 1], [0.4, 1], [0.4, 0.2]]}"
    assert any("down-jumps" in text for text in plan(study_of(RECTANGLE, dropping)).notes)
    assert plan(study_of(RECTANGLE, "loads.f=[0.01, 0]")).notes == ()


def test_a_section_is_run_before_the_sweep() -> None:
    found = plan(study_of(HEATED_BRACKET, "path={parameter: load, from: 0, to: 2}"))
    assert (found.asked, found.points) == ("path along load from 0 to 2", 1)
    assert f"{found.asked}: run does this; for the points of the sweep add --set path=null" in found.notes


def test_a_swept_parameter_that_changes_nothing_is_named() -> None:
    """α and k where θ = θ̄, everything thermal without β; not θ̄ itself, nor α where heat is solved at some point."""
    constant = "heat={}"
    swept = HEATED_BRACKET + "sweep: {alpha: [1, 2, 3], theta_bar: [0, 1], k: [1, 2], friction.a: [0.003, 0.004]}\n"
    (alpha, k) = (note for note in plan(study_of(swept, constant)).notes if "changes nothing" in note)
    assert alpha.startswith("alpha changes nothing (q is 0 and theta_bar is constant")
    assert alpha.endswith("its 3 values give equal solutions")
    assert k.startswith("k changes nothing")
    without = plan(study_of(swept, constant, "material.alpha_T=0")).notes
    assert [note.split()[0] for note in without if "changes nothing" in note] == ["alpha", "theta_bar", "k"]
    some = HEATED_BRACKET + "sweep: {alpha: [1, 2, 3], q: [0, 0.5]}\n"
    assert not any("changes nothing" in note for note in plan(study_of(some, "heat={theta_bar: 5}")).notes)
    of_edges = [f"boundary.{edge}={{role: convection, theta_bar: 1}}" for edge in ("right", "bore")]
    own = plan(study_of(HEATED_BRACKET + "sweep: {theta_bar: [0, 1]}\n", *of_edges)).notes
    assert own[0].startswith("theta_bar changes nothing (every edge that exchanges heat has its own)")
    elastic = HEATED_BRACKET + "sweep: {E: [1, 2]}"
    assert not any("changes nothing" in note for note in plan(study_of(elastic, "heat={alpha: 1, theta_bar: 5}")).notes)


def test_a_history_with_elements_much_longer_than_its_strip_is_high_is_told() -> None:
    """By the elements that Netgen makes, which are up to a third shorter than maxh in a thin strip."""
    strip = RECTANGLE.replace("width: 2, height: 1", "width: 40, height: 0.25")
    steps = "history={memory: friction, steps: [{f_x: 0.1, in: 2}]}"
    for maxh, said in ((2.0, True), (1.0, True), (0.45, False)):
        notes = plan(study_of(strip, steps, f"mesh={{maxh: {maxh}}}", "loads.f=[0, 0]")).notes
        told = [float(note.split()[6]) for note in notes if note.startswith("elements on the contact line are ")]
        assert len(told) == said, maxh
        assert all(0.65 * maxh / 0.25 < ratio < 1.05 * maxh / 0.25 for ratio in told), told
    assert not any("as long as" in n for n in plan(study_of(strip, "mesh={maxh: 2}")).notes)


def test_dear_meshing_is_said_with_what_makes_it_cheap(monkeypatch: pytest.MonkeyPatch) -> None:
    """In seconds of this machine, which is timed only where there is much to mesh."""
    monkeypatch.setattr(meshes, "triangles_a_second", lambda: 100.0)
    slow = [n for n in plan(study_of(RECTANGLE, "mesh={maxh: 0.05}")).notes if "meshing" in n]
    assert 15 < float(slow[0].split()[3]) < 25  # 2 · 1 body, 0.866 h² for two triangles
    monkeypatch.setattr(meshes, "triangles_a_second", None)
    assert not any("meshing" in n for n in plan(study_of(RECTANGLE)).notes)
    monkeypatch.undo()
    (note,) = [n for n in plan(study_of(RECTANGLE, "mesh={maxh: 0.005}")).notes if "meshing" in n]
    assert note.startswith("meshing takes about")
    assert "mesh.refine: " in note
    refine = note.split("mesh.refine: ")[1].split()[0]
    cheap = plan(study_of(RECTANGLE, f"mesh={{maxh: 0.005, refine: {refine}}}"))
    assert not any("meshing" in n for n in cheap.notes)
    assert not any("meshing" in n for n in plan(study_of(RECTANGLE)).notes)


def test_what_a_run_takes_follows_from_a_trial(monkeypatch: pytest.MonkeyPatch) -> None:
    """By a trial of known times: N^1.08 for mesh and factor, half of it again for a second ratio of moduli, a point
    by its contact nodes, and 60 µs a solution for what is written."""
    study = study_of(
        RECTANGLE + "sweep: {nu: [0.2, 0.3], friction.tau: {linspace: [0.01, 0.1, 200]}}\n",
        "mesh={maxh: 0.1, levels: 3}",
    )
    asked = list[int]()

    def timed(small: Study) -> tuple[int, int, float]:
        asked.append(len(small.scenes))
        return 1000, 20, 0.05 + 1e-3 * (len(small.scenes) - plan_module.FEW)

    monkeypatch.setattr(plan_module, "_timed", timed)
    found = plan(study)
    each = [1e-3 * (0.08e-3 + 2.6e-6 * v.n_contact) / (0.08e-3 + 2.6e-6 * 20) + 6e-5 for v in found.levels]
    expected = START + sum(0.05 * (v.n_dof / 1000) ** 1.08 for v in found.levels) + 392 * sum(each)
    assert resources(study, found).seconds == pytest.approx(expected)
    assert asked == [plan_module.FEW, plan_module.MANY]


@pytest.mark.parametrize(
    ("study", "why"),
    [
        (study_of(RECTANGLE, "mesh={maxh: 0.5, levels: 6, family: adaptive}"), "estimated error"),
        (study_of(RECTANGLE, "history={memory: friction, steps: [{f_x: 0.1, in: 2}]}", "loads.f=[0, 0]"), "a step"),
        (study_of(RECTANGLE, "solver=[separable-newton, bundle-newton]"), "solvers"),
    ],
    ids=["adaptive", "history", "bundle"],
)
def test_what_no_trial_tells_is_unknown(study: Study, why: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(plan_module, "stages", None)  # nothing is solved for it
    spent = resources(study, plan(study))
    assert math.isnan(spent.seconds)
    assert why in spent.unknown
    assert spent.memory > MEMORY


def test_of_many_geometries_one_mesh_is_made(monkeypatch: pytest.MonkeyPatch) -> None:
    """And counts are those of all; refused ones are named."""
    made, original = list[float](), study_meshes.mesh_at

    def mesh_at(geometry: Geometry, plan: MeshPlan, *more: object) -> PlaneMesh:
        made.append(geometry.size)
        return original(geometry, plan, *more)  # type: ignore[arg-type]

    monkeypatch.setattr(study_meshes, "mesh_at", mesh_at)
    widths = "sweep={body.rectangle.width: [1, 1.6, 2, 3], nu: [0.2, 0.3]}"
    region = "body.regions={inner: {rectangle: {corner: [0.5, 0.4], width: 1, height: 0.2}}}"
    found = plan(study_of(RECTANGLE, region, widths))
    assert {round(size, 3) for size in made} == {3.162}
    assert (found.points, found.factorisations) == (8, 6)
    assert found.notes[0].startswith("3 geometries: 9 meshes, 18 stiffness factorisations")
    assert found.notes[1].startswith("refused, body.rectangle.width = 1: ")
    largest = plan(study_of(RECTANGLE, region, "body.rectangle.width=3"))
    assert found.levels == largest.levels
