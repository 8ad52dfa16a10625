"""Recovered gradients: exact where they can be, one order better than the gradients themselves elsewhere."""

from __future__ import annotations

import numpy as np
import pytest

from tcstudy.fem.geometry import build
from tcstudy.fem.meshes import PlaneMesh, mesh_at, refine_marked
from tcstudy.fem.recovery import ElementGeometry
from tests.verification.scenes import HEATED_BRACKET, RECTANGLE, study_of


def meshes(text: str, count: int) -> list[PlaneMesh]:
    study = study_of(text)
    geometry = build(study.scenes[0].body)
    found: list[PlaneMesh] = []
    for i in range(count):
        found.append(mesh_at(geometry, study.mesh, i, found[-1] if found else None))
    return found


def test_gradient_of_a_linear_function() -> None:
    triangles = ElementGeometry(meshes(HEATED_BRACKET, 1)[0])
    x, y = triangles.mesh.points.T
    gradient = triangles.gradient(np.column_stack([3 * x - 2 * y, y]))
    assert np.allclose(gradient, [[3, -2], [0, 1]], atol=1e-12)
    assert triangles.area.sum() == pytest.approx(triangles.mesh.geometry.area, rel=2e-2)


@pytest.mark.parametrize("text", [RECTANGLE, HEATED_BRACKET])
def test_linear_data_are_recovered_exactly(text: str) -> None:
    """On irregular meshes, bisected ones too, up to the boundary and into its corners."""
    mesh = meshes(text, 1)[0]
    mesh = refine_marked(mesh, np.arange(len(mesh.triangles)) % 3 == 0)
    triangles = ElementGeometry(mesh)
    centres = triangles.corners.mean(axis=1)
    recovered = triangles.recovery @ (1.0 + 2.0 * centres[:, 0] - 3.0 * centres[:, 1])
    assert recovered == pytest.approx(1.0 + 2.0 * mesh.points[:, 0] - 3.0 * mesh.points[:, 1], abs=1e-11)


def test_a_single_patch_that_is_too_small_takes_the_mean() -> None:
    """Two triangles: no fit of three coefficients is possible, a constant is still recovered."""
    mesh = meshes(RECTANGLE.replace("maxh: 0.1", "maxh: 2"), 1)[0]
    triangles = ElementGeometry(mesh)
    assert triangles.recovery @ np.full(len(mesh.triangles), 0.7) == pytest.approx(np.full(mesh.n_points, 0.7))


def test_recovery_gains_an_order() -> None:
    """|∇u − Gu_h| ~ h^1.5 in L² against h: order 2 inside, 1 on irregular points and a strip of width h."""
    own, better = [], []
    for mesh in meshes(RECTANGLE.replace("maxh: 0.1", "maxh: 0.3"), 4):
        triangles = ElementGeometry(mesh)
        x, y = mesh.points.T
        gradient = triangles.gradient(np.sin(2 * x) * np.exp(y))
        exact = np.column_stack([2 * np.cos(2 * x) * np.exp(y), np.sin(2 * x) * np.exp(y)])
        at_corners = exact[mesh.triangles]
        own.append(np.sqrt(np.mean((gradient[:, None] - at_corners) ** 2)))
        better.append(np.sqrt(np.mean((triangles.recovery @ gradient - exact) ** 2)))
    assert np.log2(own[-2] / own[-1]) == pytest.approx(1.0, abs=0.1)
    assert np.log2(better[-2] / better[-1]) > 1.4
    assert better[-1] < 0.15 * own[-1]


def test_the_owner_of_a_segment_has_both_of_its_nodes() -> None:
    triangles = ElementGeometry(meshes(HEATED_BRACKET, 1)[0])
    mesh = triangles.mesh
    for segment, owner in zip(mesh.segments, triangles.owner, strict=True):
        assert set(segment) <= set(mesh.triangles[owner])


def test_bisection_keeps_what_a_mesh_is() -> None:
    """Old nodes keep their numbers, names stay, new nodes lie on arcs, angles stay away from zero."""
    mesh = meshes(HEATED_BRACKET, 1)[0]
    points, first = mesh.points, mesh
    for _ in range(12):
        centres = mesh.points[mesh.triangles].mean(axis=1)
        near = np.linalg.norm(centres - [1.05, 0.5], axis=1)
        mesh = refine_marked(mesh, near < np.quantile(near, 0.2))
        assert np.array_equal(mesh.points[: len(points)], points)
        points = mesh.points
    bore = [i for i, curve in enumerate(mesh.geometry.curves) if curve.name == "bore"]
    nodes = np.unique(mesh.segments[np.isin(mesh.segment_curve, bore)])
    assert np.max(np.abs(np.linalg.norm(points[nodes] - [0.9, 0.5], axis=1) - 0.15)) < 1e-14
    assert set(mesh.mesh.GetMaterials()) == {"body", "heater"}
    assert mesh.level == 12
    assert first.mesh.nv == first.n_points  # the coarse mesh is still usable
    sides = np.sort(np.linalg.norm(np.diff(points[mesh.triangles[:, [0, 1, 2, 0]]], axis=1), axis=2), axis=1)
    a, b, c = sides.T
    assert np.degrees(np.arccos((b**2 + c**2 - a**2) / (2 * b * c))).min() > 15
