"""Meshes: names, lengths, congruent refinement, nodes on arcs, bodies from files, and gradients
recovered on them."""

import re
from pathlib import Path

import numpy as np
import pytest
from netgen import occ

from tcstudy.fem import geometry as foreign_file
from tcstudy.fem.geometry import GeometryFailed, build, file_fault
from tcstudy.fem.meshes import REACH, WEAK, PlaneMesh, graded_mesh, mesh_at, refine, singular_points
from tcstudy.read.study import read_study
from tcstudy.scene.study import Study
from tests.verification.scenes import HEATED_BRACKET, RECTANGLE, mesh_family, study_of


def meshes_of(study: Study) -> list[PlaneMesh]:
    return list(mesh_family(build(study.scenes[0].body), study.mesh))


def curve_nodes(mesh: PlaneMesh, name: str) -> np.ndarray:
    curves = [i for i, c in enumerate(mesh.geometry.curves) if c.name == name]
    return np.unique(mesh.segments[np.isin(mesh.segment_curve, curves)])


def assert_round(mesh: PlaneMesh, unit: float = 1.0) -> None:
    radius = np.linalg.norm(mesh.points[curve_nodes(mesh, "bore")] / unit - [0.9, 0.5], axis=1)
    assert np.max(np.abs(radius - 0.15)) < 1e-14


def test_nodes_lie_on_arcs_and_names_survive_refinement() -> None:
    for mesh in meshes_of(study_of(HEATED_BRACKET, "mesh.levels=3")):
        assert_round(mesh)
        assert {c.name for c in mesh.geometry.curves} == {
            "slope",
            "curve",
            "right",
            "top",
            "left",
            "bore",
        }
        assert set(mesh.mesh.GetMaterials()) == {"body", "heater"}


FILE_STUDY = """
body: {file: {path: ring.step, other: head,
  edges: {inner: [[0.00707, 0.00707]], foot: [[0.015, 0]], outer: [[0.01414, 0.01414]]}}}
boundary: {inner: contact, foot: clamped, outer: {role: traction, g: [1e6, 0]}, head: free}
material: {E: 210 GPa, nu: 0.3}
friction: {law: tresca, tau: 1 MPa}
mesh: {maxh: 2 mm, levels: 2}
"""


def test_a_face_of_a_step_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A quarter ring of 10 and 20 mm: named by points, scaled to metres, with exact normals, judged
    once."""
    plane = (
        occ.WorkPlane().MoveTo(10, 0).Line(10).Rotate(90).Arc(20, 90).Rotate(90).Line(10).Rotate(90)
    )
    plane.Arc(10, -90).Close().Face().WriteStep(str(tmp_path / "ring.step"))
    file = tmp_path / "study.yaml"
    file.write_text(FILE_STUDY)
    study = read_study(file)
    geometry = build(study.scenes[0].body)
    assert geometry.area == pytest.approx(np.pi / 4 * (0.02**2 - 0.01**2), rel=1e-9)
    lengths = {c.name: c.length for c in geometry.curves}
    known = {"inner": np.pi / 2 * 0.01, "foot": 0.01, "outer": np.pi / 2 * 0.02, "head": 0.01}
    assert lengths == pytest.approx(known, rel=1e-9)
    corners = {tuple(np.round(c.at, 9)): (c.sides[0].name, *c.wedges) for c in geometry.corners}
    right = (pytest.approx(np.pi / 2), "body")
    assert corners == {
        (0.01, 0.0): ("foot", right),
        (0.02, 0.0): ("outer", right),
        (0.0, 0.02): ("head", right),
        (0.0, 0.01): ("inner", right),
    }
    (inner,) = (c for c in geometry.curves if c.name == "inner")
    for mesh in mesh_family(geometry, study.mesh):
        points = mesh.points[curve_nodes(mesh, "inner")]
        radius = np.linalg.norm(points, axis=1)
        assert np.max(np.abs(radius - 0.01)) < 1e-15
        along = np.einsum("ij,ij->i", inner.normal(points), points) / radius
        assert np.max(np.abs(np.abs(along) - 1)) < 1e-12
    monkeypatch.setattr(foreign_file.subprocess, "run", None)
    file.write_text(FILE_STUDY.replace(" other: head,", "").replace(", head: free", ""))
    with pytest.raises(GeometryFailed, match="has no name"):
        build(read_study(file).scenes[0].body)


HANGS = """DBRep_DrawableShape

CASCADE Topology V1, (c) Matra-Datavision
Locations 0
Curve2ds 2000000000
1 0 0 1 0
"""


def test_a_file_that_keeps_the_kernel_busy_crashes_it_or_has_no_shape_is_said_to_be_so(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """It costs a child process, not this one."""
    bad, crashes, empty = (tmp_path / f"{name}.brep" for name in "abc")
    bad.write_text(HANGS)
    crashes.write_text(HANGS + " ")
    empty.write_text("hello")
    assert "cannot be read as STEP or BREP" in str(file_fault(empty))
    monkeypatch.setattr(foreign_file, "MAX_SECONDS", 0.7)
    assert "did not finish reading it within" in str(file_fault(bad))
    monkeypatch.setattr(
        foreign_file, "PROGRAM", "import os, signal; os.kill(os.getpid(), signal.SIGSEGV)"
    )
    assert file_fault(crashes) == "the geometry kernel crashes on it"


def scaled_bracket(unit: float) -> list[PlaneMesh]:
    """Meshes of the bracket with all lengths in another unit."""
    numbers = re.compile(r"(?<=[\[\s])-?\d+(\.\d+)?(?=[,\]}])")
    body, rest = HEATED_BRACKET.split("boundary:")
    body = numbers.sub(lambda match: repr(float(match.group()) * unit), body)
    return meshes_of(
        study_of(f"{body}boundary:{rest}", f"mesh={{maxh: {0.2 * unit!r}, levels: 2}}")
    )


@pytest.mark.parametrize("unit", [1e-12, 1e12])
def test_bodies_of_every_size_have_meshes(unit: float) -> None:
    """The kernel's tolerances are lengths: without care a body of a micrometre has no mesh, one of
    1e12 m no box."""
    for one, other in zip(scaled_bracket(1.0), scaled_bracket(unit), strict=True):
        assert len(other.triangles) == pytest.approx(len(one.triangles), rel=0.1)
        assert other.geometry.size / unit == pytest.approx(one.geometry.size, rel=1e-5)
        assert other.geometry.area / unit**2 == pytest.approx(one.geometry.area, rel=1e-9)
        areas, own = one.geometry.face_areas(), other.geometry.face_areas()
        assert {name: area / unit**2 for name, area in own.items()} == pytest.approx(
            areas, rel=1e-7
        )
    assert_round(refine(other, np.arange(len(other.triangles)) % 7 == 0), unit)
    pairs = zip(other.geometry.samples(), one.geometry.samples(), strict=True)
    for (_, points, normals), (_, expected, directions) in pairs:
        np.testing.assert_allclose(points / unit, expected, atol=1e-6)
        np.testing.assert_allclose(normals, directions, atol=1e-6)


@pytest.mark.parametrize("family", ["uniform", "adaptive"])
def test_a_fine_mesh_by_refinement_is_the_finer_level_of_a_coarse_one(family: str) -> None:
    coarse = meshes_of(study_of(HEATED_BRACKET, "mesh={maxh: 0.4, levels: 3}"))[2]
    fine = meshes_of(study_of(HEATED_BRACKET, f"mesh={{maxh: 0.1, refine: 2, family: {family}}}"))[
        0
    ]
    assert fine.level == 0
    assert np.array_equal(fine.triangles, coarse.triangles)
    np.testing.assert_allclose(fine.points, coarse.points, rtol=0, atol=1e-14)
    assert_round(fine)


L_SHAPE = """
units: none
body: {outline: [{from: [0, 0], edge: base}, {from: [2, 0], edge: rest}, {from: [2, 1], edge: rest},
  {from: [1, 1], edge: rest}, {from: [1, 2], edge: rest}, {from: [0, 2], edge: wall}, {from: [0, 1], edge: rest}]}
boundary: {base: contact, wall: clamped, rest: free}
material: {E: 1, nu: 0.3}
friction: {law: tresca, tau: 0.1}
mesh: {maxh: 0.5, levels: 4, family: graded, grading: 0.4}
"""


def points_of(text: str) -> tuple[set[tuple[float, float]], set[tuple[float, float]]]:
    """Strong and weak singular points."""
    study = study_of(text)
    scene = study.scenes[0]
    found = {
        (round(x, 12), round(y, 12)): mu
        for (x, y), mu in singular_points(build(scene.body), scene.boundary, 0.3).items()
    }
    weak = {p for p, mu in found.items() if mu == WEAK}
    return found.keys() - weak, weak


def test_re_entrant_corners_and_ends_of_clamps_are_singular() -> None:
    strong, weak = points_of(L_SHAPE)
    assert strong == {(1.0, 1.0), (0.0, 1.0), (0.0, 2.0)}
    assert weak == {(0.0, 0.0), (2.0, 0.0)}  # friction ends at a free edge
    assert points_of(RECTANGLE) == (
        {(0.0, 1.0)},
        {(2.0, 0.0)},
    )  # a square corner of contact and clamp is none


def test_sizes_follow_the_law() -> None:
    """h(r) = h (r/R)^(1−μ), the smallest about R (h/R)^(1/μ); the count grows by four whatever
    μ."""
    study = study_of(L_SHAPE)
    scene, plan = study.scenes[0], study.mesh
    first = mesh_at(build(scene.body), plan, 0, None)
    meshes: list[PlaneMesh] = []
    for i in range(4):
        meshes.append(graded_mesh(first, plan, i, meshes[-1] if meshes else None, scene.boundary))
    counts = np.array([len(mesh.triangles) for mesh in meshes])
    assert counts[2:] / counts[1:-1] == pytest.approx(4.0, rel=0.2)
    for i, mesh in enumerate(meshes):
        assert mesh.level == i
        corners = mesh.points[mesh.triangles]
        sides = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).max(axis=1)
        r = np.linalg.norm(corners.mean(axis=1) - [1.0, 1.0], axis=1)
        reach = REACH * mesh.geometry.size
        allowed = first.h_max / 2**i * np.minimum(1.0, r / reach) ** (1.0 - 0.4)
        assert np.all(sides <= allowed * (1 + 1e-8))
        ring = (r > 0.1 * reach) & (r < 0.5 * reach)
        assert np.median(sides[ring] / allowed[ring]) > 0.4  # and not much finer than asked
    fine = meshes[-1]
    assert np.array_equal(fine.points[: meshes[-2].n_points], meshes[-2].points)


@pytest.mark.parametrize("text", [RECTANGLE, HEATED_BRACKET])
def test_linear_data_are_recovered_exactly(text: str) -> None:
    """On irregular meshes, bisected ones too, up to the boundary and into its corners."""
    mesh = meshes_of(study_of(text, "mesh.levels=1"))[0]
    mesh = refine(mesh, np.arange(len(mesh.triangles)) % 3 == 0)
    recovered = mesh.recovery @ (1.0 + mesh.centres @ [2.0, -3.0])
    assert recovered == pytest.approx(1.0 + mesh.points @ [2.0, -3.0], abs=1e-11)
