"""P1 functions between meshes that are not nested."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import tcstudy
from tcstudy.accuracy.norms import Triangles
from tcstudy.accuracy.transfer import interpolation, located, prolongation
from tcstudy.fem.geometry import build
from tcstudy.scene.study import MeshPlan
from tests.verification.scenes import mesh_family


def test_nested_meshes_get_the_exact_prolongation_also_around_a_corner() -> None:
    study = tcstudy.load(Path(__file__).parents[2] / "configs" / "singular.yaml")
    coarse, fine = mesh_family(build(study.scenes[0].body), MeshPlan((study.mesh.maxh[0],), 2))
    v = np.random.default_rng(0).normal(size=coarse.n_points)
    exact = prolongation(coarse.points, fine.points, fine.triangles)
    assert exact.off_midpoint < 1e-12
    carried = interpolation(Triangles(coarse.points, coarse.triangles), fine.points) @ v
    assert carried == pytest.approx(exact(v), abs=1e-10)


def _square(corner: float, n: int) -> tuple[np.ndarray, np.ndarray]:
    """Nodes and triangles of a unit square at (corner, 0) with n × n cells."""
    x, y = (c.ravel() for c in np.meshgrid(np.linspace(0, 1, n + 1), np.linspace(0, 1, n + 1)))
    first = (np.arange(n)[:, None] * (n + 1) + np.arange(n)).ravel()
    cells = np.concatenate([first[:, None] + [0, 1, n + 2], first[:, None] + [0, n + 2, n + 1]])
    return np.column_stack([corner + x, y]), cells.astype(np.intp)


def test_points_beside_a_slot_are_found_on_their_own_side() -> None:
    """Centres of the fine side are nearer, and no way leads across."""
    (left, coarse), (right, fine) = _square(0.0, 2), _square(1.001, 20)
    mesh = Triangles(np.concatenate([left, right]), np.concatenate([coarse, fine + len(left)]))
    at = np.column_stack([np.full(50, 0.995), np.linspace(0.01, 0.99, 50)])
    found, weights = located(mesh, at)
    assert np.all(found < len(coarse))
    assert weights.min() > -1e-12
