"""A mesh that cannot be made ends a run before work if it is the first, and is a status of its points if it is not."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import tcstudy
from tcstudy.data.records import PointStatus
from tcstudy.fem import meshes as family_module
from tcstudy.fem.geometry import GeometryFailed
from tests.verification.scenes import RECTANGLE, study_of


def fail_at(monkeypatch: pytest.MonkeyPatch, bad: int) -> None:
    original = family_module.mesh_at

    def mesh_at(geometry: object, plan: object, level: int, coarser: object) -> object:
        if level == bad:
            raise GeometryFailed("the mesher gave up")
        return original(geometry, plan, level, coarser)  # type: ignore[arg-type]

    monkeypatch.setattr(family_module, "mesh_at", mesh_at)


def test_a_later_mesh_fails(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    fail_at(monkeypatch, 1)
    tree = tcstudy.run(study_of(RECTANGLE, "mesh={maxh: [0.5, 0.3, 0.2]}"), tmp_path / "out.nc")
    assert tree["status"].values.tolist() == [1, int(PointStatus.MESH_FAILED), 1]
    assert tree["reason"].values[1] == "the mesher gave up"
    assert np.isnan(tree["energy"].values[1])


def test_the_first_mesh_fails(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    fail_at(monkeypatch, 0)
    with pytest.raises(GeometryFailed, match="gave up"):
        tcstudy.run(study_of(RECTANGLE), tmp_path / "out.nc")
    assert not (tmp_path / "out.nc").exists()
