"""P1 functions between meshes that are not nested."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scipy.spatial import Delaunay

import tcstudy
from tcstudy.accuracy.locating import interpolation, located
from tcstudy.accuracy.nesting import prolongation
from tcstudy.accuracy.norms import Triangles
from tcstudy.fem.geometry import build
from tcstudy.fem.meshes import mesh_family
from tcstudy.scene.records import MeshPlan


def _unit_square(n: int, seed: int) -> Triangles:
    rng = np.random.default_rng(seed)
    side = np.linspace(0, 1, 9)
    low, high = 0 * side, 0 * side + 1
    edges = [np.column_stack(pair) for pair in ((side, low), (side, high), (low, side), (high, side))]
    points = np.unique(np.concatenate([*edges, rng.uniform(0.02, 0.98, (n, 2))]), axis=0)
    triangles = Delaunay(points).simplices.astype(np.intp)
    a, b, c = np.moveaxis(points[triangles], 1, 0)
    twice = (b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0]
    keep = np.abs(twice) > 1e-12
    triangles[twice < 0] = triangles[twice < 0][:, [0, 2, 1]]
    return Triangles(points, triangles[keep])


@pytest.mark.parametrize("seed", [0, 1, 2])
def test_points_lie_in_the_triangles_that_are_named(seed: int) -> None:
    mesh = _unit_square(300, seed)
    at = np.random.default_rng(seed + 10).uniform(0, 1, (5000, 2))
    found, weights = located(mesh, at)
    assert weights.min() > -1e-9
    assert np.einsum("qk,qkd->qd", weights, mesh.points[mesh.triangles[found]]) == pytest.approx(at, abs=1e-12)


def test_linear_functions_are_carried_exactly_and_others_at_the_nodes() -> None:
    mesh, other = _unit_square(300, 0), _unit_square(2000, 5)
    x, y = mesh.points.T
    assert interpolation(mesh, other.points) @ (3 * x - y + 2) == pytest.approx(
        3 * other.points[:, 0] - other.points[:, 1] + 2, abs=1e-12
    )
    assert interpolation(mesh, mesh.points) @ np.sin(9 * x * y) == pytest.approx(np.sin(9 * x * y), abs=1e-12)


def test_nested_meshes_get_the_exact_prolongation_also_around_a_corner() -> None:
    study = tcstudy.load(Path(__file__).parents[2] / "configs" / "singular.yaml")
    coarse, fine = mesh_family(build(study.scenes[0].body), MeshPlan((study.mesh.maxh[0],), 2))
    v = np.random.default_rng(0).normal(size=coarse.n_points)
    exact = prolongation(coarse.points, fine.points, fine.triangles)
    assert exact.off_midpoint < 1e-12
    carried = interpolation(Triangles(coarse.points, coarse.triangles), fine.points) @ v
    assert carried == pytest.approx(exact(v), abs=1e-10)


def test_points_just_outside_get_the_nearest_triangles_function() -> None:
    mesh = _unit_square(300, 0)
    outside = np.array([[-1e-4, 0.5], [1.0 + 1e-4, 0.3], [0.4, -1e-4]])
    assert interpolation(mesh, outside) @ mesh.points[:, 0] == pytest.approx(outside[:, 0], abs=1e-12)
