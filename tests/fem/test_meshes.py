"""Meshes: names, lengths, congruent refinement, nodes on arcs, and bodies from files."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from netgen import occ

from tcstudy.fem.geometry import GeometryFailed, build
from tcstudy.fem.meshes import PlaneMesh, mesh_family
from tcstudy.scene.reader import read_study
from tcstudy.scene.records import Study
from tests.verification.scenes import HEATED_BRACKET, RECTANGLE, study_of


def meshes_of(study: Study) -> list[PlaneMesh]:
    return list(mesh_family(build(study.scenes[0].body), study.mesh))


def curve_nodes(mesh: PlaneMesh, name: str) -> np.ndarray:
    curves = [i for i, c in enumerate(mesh.geometry.curves) if c.name == name]
    return np.unique(mesh.segments[np.isin(mesh.segment_curve, curves)])


def test_refinement_is_congruent_and_nested() -> None:
    """Each triangle has four children of a quarter of its area; coarse nodes stay where they are."""
    coarse, fine, _ = meshes_of(study_of(RECTANGLE))
    assert len(fine.triangles) == 4 * len(coarse.triangles)
    assert fine.h_max == pytest.approx(coarse.h_max / 2, rel=1e-12)
    assert np.array_equal(fine.points[: coarse.n_points], coarse.points)
    assert coarse.mesh.nv == coarse.n_points


def test_nodes_lie_on_arcs_and_names_survive_refinement() -> None:
    for mesh in meshes_of(study_of(HEATED_BRACKET, "mesh.levels=3")):
        radius = np.linalg.norm(mesh.points[curve_nodes(mesh, "bore")] - [0.9, 0.5], axis=1)
        assert np.max(np.abs(radius - 0.15)) < 1e-14
        assert {c.name for c in mesh.geometry.curves} == {"slope", "curve", "right", "top", "left", "bore"}
        assert set(mesh.mesh.GetMaterials()) == {"body", "heater"}


def test_segments_have_the_body_on_their_left() -> None:
    mesh = meshes_of(study_of(HEATED_BRACKET))[0]
    a, b = mesh.points[mesh.segments[:, 0]], mesh.points[mesh.segments[:, 1]]
    twice_area = float((a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]).sum())
    corners = mesh.points[mesh.triangles]
    e, f = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    assert twice_area == pytest.approx(float((e[:, 0] * f[:, 1] - e[:, 1] * f[:, 0]).sum()), rel=1e-12)


def test_sizes_by_maxh() -> None:
    sizes = [m.h_max for m in meshes_of(study_of(RECTANGLE, "mesh={maxh: [0.4, 0.2, 0.1]}"))]
    assert sizes == sorted(sizes, reverse=True)
    assert sizes[2] < 0.5 * sizes[0]


def ring_sector(path: Path) -> None:
    """A quarter ring, inner radius 10, outer 20, written by the kernel itself in millimetres."""
    plane = occ.WorkPlane().MoveTo(10, 0).Line(10).Rotate(90).Arc(20, 90).Rotate(90).Line(10).Rotate(90)
    plane.Arc(10, -90).Close().Face().WriteStep(str(path))


FILE_STUDY = """
body:
  file:
    path: ring.step
    edges: {inner: [[0.00707, 0.00707]], foot: [[0.015, 0]], outer: [[0.01414, 0.01414]]}
    other: head
boundary: {inner: contact, foot: clamped, outer: {role: traction, g: [1e6, 0]}, head: free}
material: {E: 210 GPa, nu: 0.3}
friction: {law: tresca, tau: 1 MPa}
mesh: {maxh: 2 mm, levels: 2}
"""


def test_a_face_of_a_step_file(tmp_path: Path) -> None:
    """Named by points, scaled to metres, with exact normals on its arcs."""
    ring_sector(tmp_path / "ring.step")
    (tmp_path / "study.yaml").write_text(FILE_STUDY)
    study = read_study(tmp_path / "study.yaml")
    geometry = build(study.scenes[0].body)
    assert geometry.area == pytest.approx(np.pi / 4 * (0.02**2 - 0.01**2), rel=1e-9)
    lengths = {c.name: c.length for c in geometry.curves}
    assert lengths == pytest.approx(
        {"inner": np.pi / 2 * 0.01, "foot": 0.01, "outer": np.pi / 2 * 0.02, "head": 0.01}, rel=1e-9
    )
    for mesh in mesh_family(geometry, study.mesh):
        nodes = curve_nodes(mesh, "inner")
        index = next(i for i, c in enumerate(geometry.curves) if c.name == "inner")
        points = mesh.points[nodes]
        normals = geometry.curves[index].normal(points)
        radial = points / np.linalg.norm(points, axis=1)[:, None]
        assert np.max(np.abs(np.linalg.norm(points, axis=1) - 0.01)) < 1e-15
        assert np.max(np.abs(np.abs(np.einsum("ij,ij->i", normals, radial)) - 1)) < 1e-12


def test_an_unnamed_edge_of_a_file_is_an_error(tmp_path: Path) -> None:
    ring_sector(tmp_path / "ring.step")
    text = FILE_STUDY.replace("    other: head\n", "").replace(", head: free", "")
    (tmp_path / "study.yaml").write_text(text)
    with pytest.raises(GeometryFailed, match="has no name"):
        build(read_study(tmp_path / "study.yaml").scenes[0].body)
