"""Recovered gradients: exact where they can be, one order better than the gradients themselves elsewhere."""

from __future__ import annotations

import numpy as np
import pytest

from tcstudy.fem.geometry import build
from tcstudy.fem.meshes import PlaneMesh, mesh_at, refine_marked
from tests.verification.scenes import HEATED_BRACKET, RECTANGLE, study_of


def meshes(text: str, count: int) -> list[PlaneMesh]:
    study = study_of(text)
    geometry = build(study.scenes[0].body)
    found: list[PlaneMesh] = []
    for i in range(count):
        found.append(mesh_at(geometry, study.mesh, i, found[-1] if found else None))
    return found


@pytest.mark.parametrize("text", [RECTANGLE, HEATED_BRACKET])
def test_linear_data_are_recovered_exactly(text: str) -> None:
    """On irregular meshes, bisected ones too, up to the boundary and into its corners."""
    mesh = meshes(text, 1)[0]
    mesh = refine_marked(mesh, np.arange(len(mesh.triangles)) % 3 == 0)
    triangles = mesh
    centres = triangles.corners.mean(axis=1)
    recovered = triangles.recovery @ (1.0 + 2.0 * centres[:, 0] - 3.0 * centres[:, 1])
    assert recovered == pytest.approx(1.0 + 2.0 * mesh.points[:, 0] - 3.0 * mesh.points[:, 1], abs=1e-11)


def test_recovery_gains_an_order() -> None:
    """|∇u − Gu_h| ~ h^1.5 in L² against h: order 2 inside, 1 on irregular points and a strip of width h."""
    own, better = [], []
    for mesh in meshes(RECTANGLE.replace("maxh: 0.1", "maxh: 0.3"), 4):
        triangles = mesh
        x, y = mesh.points.T
        gradient = triangles.gradient(np.sin(2 * x) * np.exp(y))
        exact = np.column_stack([2 * np.cos(2 * x) * np.exp(y), np.sin(2 * x) * np.exp(y)])
        at_corners = exact[mesh.triangles]
        own.append(np.sqrt(np.mean((gradient[:, None] - at_corners) ** 2)))
        better.append(np.sqrt(np.mean((triangles.recovery @ gradient - exact) ** 2)))
    assert np.log2(own[-2] / own[-1]) == pytest.approx(1.0, abs=0.1)
    assert np.log2(better[-2] / better[-1]) > 1.4
    assert better[-1] < 0.15 * own[-1]
