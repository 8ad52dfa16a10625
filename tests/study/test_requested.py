"""Numbers on request: probes and reactions on linear fields, where P1 is exact, and in global balance on any body."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray as xr

import tcstudy
from tcstudy.contact.contact import solve_contact
from tcstudy.data.records import PointStatus
from tcstudy.errors import StudyError
from tcstudy.offline.level import Level
from tcstudy.offline.requested_outputs import RequestedOutputs
from tcstudy.read.study import read_study_text
from tcstudy.scene.records import Scene
from tcstudy.scene.study import OutputPlan
from tcstudy.study import sensitivities
from tests.verification.scenes import HEATED_BRACKET, levels_of, study_of

BAR = """
body: {rectangle: {width: 200 mm, height: 50 mm}}
boundary:
  bottom: contact
  left: {role: symmetry, heat: {theta: 40 K}}
  right: {role: convection, g: [3 MPa, 0], alpha: 450 W/(m^2*K), theta_bar: 10 K}
  top: free
material: {E: 200 GPa, nu: 0.25, plane: PLANE, k: 45 W/(m*K), alpha_T: 0}
friction: {law: linear, k: 0}
mesh: {maxh: 40 mm}
sweep: {alpha_T: [0, 1e-5 1/K]}
output: {probes: {tip: [200 mm, 0 mm], core: [70 mm, 20 mm]}, quantities: [reactions, theta_edges, von_mises]}
"""


def stored(text: str, folder: Path, name: str = "bar") -> xr.Dataset:
    """The root of the file of a study."""
    (folder / f"{name}.yaml").write_text(text, encoding="utf-8")
    return tcstudy.run(folder / f"{name}.yaml", folder / f"{name}.nc").to_dataset()


@pytest.mark.parametrize("plane", ["stress", "strain"])
def test_linear_fields_are_exact(tmp_path: Path, plane: str) -> None:
    """Without expansion σ_xx = 3 MPa alone; θ falls from 40 K by q (L/k + 1/α) to 10 K, q = 4500 W/m²."""
    data = stored(BAR.replace("PLANE", plane), tmp_path).isel(level=0, alpha_T=0)
    sigma, E, nu = 3e6, 200e9, 0.25
    if plane == "strain":
        E, nu = E / (1 - nu**2), nu / (1 - nu)
    for name, (x, y) in {"tip": (0.2, 0.0), "core": (0.07, 0.02)}.items():
        assert float(data[f"probe_{name}_u_x"]) == pytest.approx(sigma * x / E, rel=1e-11)
        assert float(data[f"probe_{name}_u_y"]) == pytest.approx(-nu * sigma * y / E, abs=1e-17)
        assert float(data[f"probe_{name}_sigma_xx"]) == pytest.approx(sigma, rel=1e-11)
        assert abs(float(data[f"probe_{name}_sigma_yy"])) < 1e-10 * sigma
    assert float(data["probe_tip_u_T"]) == pytest.approx(float(data["probe_tip_u_x"]), rel=1e-13)
    assert "probe_core_u_T" not in data
    assert float(data["reaction_left_x"]) == pytest.approx(-sigma * 0.05, rel=1e-11)
    assert abs(float(data["reaction_bottom_y"])) < 1e-10 * sigma
    exact = sigma if plane == "stress" else sigma * np.sqrt(1 - 0.25 + 0.25**2)
    assert float(data["von_mises_max"]) == pytest.approx(exact, rel=1e-11)
    assert data["von_mises_max"].attrs["units"] == "Pa"


def test_temperatures_of_edges_and_points(tmp_path: Path) -> None:
    data = stored(BAR.replace("PLANE", "stress"), tmp_path).isel(level=0, alpha_T=1)
    for name, exact in {"left": 40.0, "right": 20.0, "top": 30.0, "bottom": 30.0}.items():
        assert float(data[f"theta_mean_{name}"]) == pytest.approx(exact, rel=1e-12)
    assert float(data["probe_core_theta"]) == pytest.approx(33.0, rel=1e-12)


@pytest.mark.parametrize("changes", [(), ("boundary.left={role: traction, g: [0.02, -0.01], spring: {normal: 0.3}}",)])
def test_reactions_balance_the_loads(changes: tuple[str, ...]) -> None:
    """Arcs, a hole, heat, given displacements: Σ reactions = −Σ loads + what springs carry."""
    study = study_of(HEATED_BRACKET, *changes)
    scene, level = study.scenes[0], levels_of(study)[0]
    condensed = level.condensed(scene)
    answer = solve_contact(condensed.problem)
    found = RequestedOutputs(level, OutputPlan(quantities=("reactions",))).of(scene, answer.v)
    u = level.displacement(scene, answer.v)
    carried = np.zeros(2)
    if scene.springs:
        R = level.frames.rotation
        carried = (R @ (level.elastic.springs(scene.springs, level.frames) @ (R.T @ u))).reshape(2, -1).sum(axis=1)
    loads = level.load(scene).reshape(2, -1).sum(axis=1)
    for i, axis in enumerate("xy"):
        total = sum(found[f"reaction_{edge}_{axis}"] for edge in ("slope", "curve", "top"))
        assert total == pytest.approx(carried[i] - loads[i], abs=1e-12 * np.abs(level.load(scene)).sum())


def test_a_number_that_breaks_down_ends_its_point_and_no_run(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The solution stays in the file with the reason beside it, and nothing of what was asked for."""
    original = sensitivities.of_point

    def broken(level: Level, scene: Scene, *more: Any) -> dict[str, float]:
        if not scene.material.expands:
            raise RuntimeError("no such element")
        return original(level, scene, *more)

    monkeypatch.setattr(sensitivities, "of_point", broken)
    text = BAR.replace("PLANE", "stress").replace("output: {", "output: {sensitivity: [E], ")
    data = stored(text, tmp_path).isel(level=0)
    assert data["status"].values.tolist() == [PointStatus.ERROR, PointStatus.OK]
    assert str(data["reason"][0].values) == "numbers on request: RuntimeError: no such element"
    assert np.isnan(data["probe_tip_u_x"].values).tolist() == [True, False]
    assert np.isnan(data["sensitivity_u_T_max_E"].values).tolist() == [True, False]
    assert np.isfinite(data["u_T_max"].values).all()


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("[70 mm, 20 mm]", "[70 mm, 80 mm]", "output.probes.core: the point (0.07, 0.08) is 0.03 outside the body"),
        (
            "{tip: [200 mm, 0 mm], core: [70 mm, 20 mm]}",
            "[1, 2]",
            "output.probes: must be a mapping of names to points, but is a list",
        ),
        ("core: [70 mm", "a b: [70 mm", "is not a name; use letters, digits and _"),
        ("von_mises]", "von_mieses]", "did you mean 'von_mises'?"),
    ],
)
def test_faults_are_one_line(old: str, new: str, said: str) -> None:
    text = BAR.replace("PLANE", "stress")
    assert old in text
    with pytest.raises(StudyError) as caught:
        read_study_text(text.replace(old, new))
    assert said in str(caught.value)
    assert len(caught.value.problems) == 1
