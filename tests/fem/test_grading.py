"""Meshes graded towards singular points: which points these are, and how sizes and counts behave."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from tcstudy.fem.geometry import build
from tcstudy.fem.grading import REACH, graded_mesh, singular_points
from tcstudy.fem.meshes import PlaneMesh, mesh_at
from tests.verification.scenes import RECTANGLE, study_of

L_SHAPE = """
units: none
body:
  outline:
    - {from: [0, 0], edge: base}
    - {from: [2, 0], edge: end}
    - {from: [2, 1], edge: shelf}
    - {from: [1, 1], edge: inner}
    - {from: [1, 2], edge: top}
    - {from: [0, 2], edge: wall}
    - {from: [0, 1], edge: side}
boundary: {base: contact, wall: clamped, end: free, shelf: free, inner: free, top: free, side: free}
material: {E: 1, nu: 0.3}
friction: {law: tresca, tau: 0.1}
mesh: {maxh: 0.5, levels: 4, family: graded, grading: 0.4}
"""


def points_of(text: str) -> tuple[set[tuple[float, float]], set[tuple[float, float]]]:
    """Strong and weak singular points."""
    study = study_of(text)
    scene = study.scenes[0]
    found = singular_points(mesh_at(build(scene.body), study.mesh, 0, None), scene.boundary)
    points = [(round(float(x), 12), round(float(y), 12)) for x, y in found.points]
    weak = {p for p, is_weak in zip(points, found.weak, strict=True) if is_weak}
    return set(points) - weak, weak


def test_re_entrant_corners_and_ends_of_clamps_are_singular() -> None:
    strong, weak = points_of(L_SHAPE)
    assert strong == {(1.0, 1.0), (0.0, 1.0), (0.0, 2.0)}
    assert weak == {(0.0, 0.0), (2.0, 0.0)}  # friction ends at a free edge


def test_a_square_corner_of_contact_and_clamp_is_regular() -> None:
    """Reflected at the contact line it is a straight clamped edge."""
    strong, weak = points_of(RECTANGLE)
    assert strong == {(0.0, 1.0)}
    assert weak == {(2.0, 0.0)}


def test_a_closed_round_hole_has_no_singular_point() -> None:
    holed = RECTANGLE.replace(
        "height: 1}}", "height: 1}, holes: [{circle: {center: [1, 0.5], radius: 0.2, edge: pin}}]}"
    )
    assert points_of(holed.replace("top: free", "top: free, pin: free")) == points_of(RECTANGLE)
    through = L_SHAPE.replace("wall: clamped", "wall: free").replace("side: free", "side: clamped")
    assert points_of(through)[0] == {(1.0, 1.0), (0.0, 1.0)}  # (0, 0) is contact and clamp at a right angle


def family(levels: int, grading: float) -> tuple[float, list[PlaneMesh]]:
    """Longest edge of the mesh without grading, and the graded meshes."""
    study = study_of(L_SHAPE)
    scene, plan = study.scenes[0], replace(study.mesh, grading=grading, levels=levels)
    first = mesh_at(build(scene.body), plan, 0, None)
    meshes: list[PlaneMesh] = []
    for i in range(levels):
        meshes.append(graded_mesh(first, plan, i, meshes[-1] if meshes else None, scene.boundary))
    return first.h_max, meshes


@pytest.mark.parametrize("grading", [0.3, 0.6])
def test_sizes_follow_the_law(grading: float) -> None:
    """h(r) = h (r/R)^(1−μ), the smallest about R (h/R)^(1/μ); the count grows by four whatever μ."""
    h_0, meshes = family(4, grading)
    counts = np.array([len(mesh.triangles) for mesh in meshes])
    assert counts[2:] / counts[1:-1] == pytest.approx(4.0, rel=0.2)
    for i, mesh in enumerate(meshes):
        assert mesh.level == i
        corners = mesh.points[mesh.triangles]
        sides = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).max(axis=1)
        r = np.linalg.norm(corners.mean(axis=1) - [1.0, 1.0], axis=1)
        reach = REACH * mesh.geometry.size
        h = h_0 / 2**i
        allowed = h * np.minimum(1.0, r / reach) ** (1.0 - grading)
        assert np.all(sides <= allowed * (1 + 1e-8))
        ring = (r > 0.1 * reach) & (r < 0.5 * reach)
        assert np.median(sides[ring] / allowed[ring]) > 0.4  # and not much finer than asked
    fine = meshes[-1]
    assert np.array_equal(fine.points[: meshes[-2].n_points], meshes[-2].points)


def test_grading_of_one_is_uniform() -> None:
    """μ → 1 leaves the uniform family."""
    _, graded = family(3, 0.999999)
    assert [len(m.triangles) for m in graded] == [len(graded[0].triangles) * 4**i for i in range(3)]
