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
    centres = mesh.centres
    recovered = mesh.recovery @ (1.0 + 2.0 * centres[:, 0] - 3.0 * centres[:, 1])
    assert recovered == pytest.approx(1.0 + 2.0 * mesh.points[:, 0] - 3.0 * mesh.points[:, 1], abs=1e-11)
