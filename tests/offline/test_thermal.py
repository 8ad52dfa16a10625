"""Many α from few columns: the columns span all temperatures of a sweep to rounding, and are few."""

from __future__ import annotations

import numpy as np
import pytest

from tcstudy.condense import Condensation
from tcstudy.fem.geometry import build
from tcstudy.fem.meshes import PlaneMesh
from tcstudy.offline.level import Level
from tcstudy.scene.study import Study
from tests.verification.scenes import HEATED_BRACKET, mesh_family, study_of

MANY = "sweep={alpha: {geomspace: [1e-8, 1e8, 200]}}"


def swept(*overrides: str) -> tuple[Study, PlaneMesh]:
    study = study_of(HEATED_BRACKET, *overrides)
    return study, list(mesh_family(build(study.scenes[0].body), study.mesh))[-1]


class Columns:
    """Counts the columns that go back through a factor, among them the one that tells whether the mesh is sound."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.count = 0
        original = Condensation.expand

        def counting(condensation: Condensation, u_k: np.ndarray, F: object = None) -> np.ndarray:
            full = original(condensation, u_k, F)  # type: ignore[arg-type]
            self.count += full.shape[1] if full.ndim == 2 else 1
            return full

        monkeypatch.setattr(Condensation, "expand", counting)


@pytest.mark.parametrize("k", ["k: 0.7", "k: 50"])
def test_many_alpha_cost_a_handful_of_columns(monkeypatch: pytest.MonkeyPatch, k: str) -> None:
    """200 α over sixteen decades: q and θ̄ vary in space, fewer than 40 columns for each, 1e-12 throughout."""
    study, mesh = swept(MANY, "material.k=" + k.split()[1], "heat.q=0.6 + x*y")
    columns = Columns(monkeypatch)
    level = Level(mesh, study.scenes[0], study.scenes)
    condensed = [level.condensed(scene) for scene in study.scenes]
    temperatures = [level.temperature(scene) for scene in study.scenes]
    assert columns.count < 80
    for i in range(0, 200, 40):
        scene = study.scenes[i]
        alone = Level(mesh, scene)
        direct = alone.temperature(scene)
        assert np.max(np.abs(temperatures[i].theta - direct.theta)) < 1e-12 * np.max(np.abs(direct.theta))
        assert temperatures[i].mean == pytest.approx(direct.mean, rel=1e-12)
        assert temperatures[i].heat_balance < 1e-12
        one = alone.condensed(scene)
        l_tilde = one.problem.l_tilde
        assert np.max(np.abs(condensed[i].problem.l_tilde - l_tilde)) < 1e-12 * np.max(np.abs(l_tilde))
        assert condensed[i].constant == pytest.approx(one.constant, rel=1e-11)


def test_an_alpha_outside_the_sweep_is_as_exact() -> None:
    """Within the range of the sweep, and far beyond it, where the columns do not reach."""
    study, mesh = swept("sweep={alpha: {geomspace: [0.1, 10, 100]}}")
    level = Level(mesh, study.scenes[0], study.scenes)
    for alpha in (0.3217, 1e-6, 1e6):
        scene = study_of(HEATED_BRACKET, f"heat.alpha={alpha!r}").scenes[0]
        direct = Level(mesh, scene).temperature(scene).theta
        assert np.max(np.abs(level.temperature(scene).theta - direct)) < 1e-12 * np.max(np.abs(direct))
