"""Forces of sections and edges against closed forms of thin strips, and in balance on any body."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import xarray as xr

import tcstudy
from tcstudy.contact.solve import solve_contact
from tcstudy.errors import StudyError
from tcstudy.offline.loads import loaded_by
from tcstudy.offline.requested_outputs import edge_forces, section_force
from tests.commands import CONFIGS
from tests.verification.scenes import HEATED_BRACKET, levels_of, study_of

STRIP = """
body: {rectangle: {width: 100 mm, height: 1 mm}}
boundary:
  bottom: contact
  left: {role: clamped, u_x: 0 mm, u_y: free}
  right: {role: traction, g: [100 MPa, 0]}
  top: free
material: {E: 70 GPa, nu: 0, plane: stress}
friction: FRICTION
mesh: {maxh: 4 mm, levels: 3}
output: {quantities: [section_force, forces]}
"""
E, H, L, P = 70e9, 1e-3, 0.1, 1e5


def levels(friction: str, folder: Path, *overrides: str) -> tuple[xr.Dataset, list[xr.Dataset]]:
    """The root of a file, and the contact line of its levels."""
    (folder / "strip.yaml").write_text(STRIP.replace("FRICTION", friction), encoding="utf-8")
    tree = tcstudy.run(tcstudy.load(folder / "strip.yaml", overrides), folder / "strip.nc")
    return tree.to_dataset(), [tree[f"level_{i}"].to_dataset() for i in range(tree.to_dataset().sizes["level"])]


def test_shear_lag_of_a_lap_joint(tmp_path: Path) -> None:
    """Volkersen: N = P cosh λx/cosh λL, λ² = k/EH, of second order; the strip's own shear adds H/3G to 1/k."""
    data, lines = levels("{law: linear, k: 200 GPa/m}", tmp_path)
    slope = np.sqrt(1.0 / (1.0 / 200e9 + H / (1.5 * E)) / (E * H))
    exact = [P * np.cosh(slope * one["arclength"]) / np.cosh(slope * L) for one in lines]
    errors = [float(np.abs(one["section_force"] - N).max()) / P for one, N in zip(lines, exact, strict=True)]
    assert errors[-1] < 1e-4
    assert errors[0] / errors[1] > 3.5
    assert data["section_force_max"].values == pytest.approx(np.full(3, P), rel=1e-12)
    assert data["section_force_at"].values == pytest.approx(np.full(3, L))
    sums = data["force_left_x"] + data["force_right_x"] + data["force_bottom_x"]
    assert np.abs(sums).max() < 1e-9 * P
    # what the load does at its end over 2 is the energy of strip and bond; ξ does −2 times that of the bond
    assert data["work_right"].values == pytest.approx(-2.0 * data["energy"].values, rel=1e-9)


def test_welded_rail_is_restrained_behind_its_breathing_end(tmp_path: Path) -> None:
    """−N = EHαΔT in the middle and τ times the distance from the end in the breathing length."""
    study = tcstudy.load(CONFIGS / "welded_rail.yaml", ["output.quantities=section_force", "sweep={}"])
    tree = tcstudy.run(study, tmp_path / "rail.nc")
    line, theta = tree["level_0"].to_dataset(), float(study.scenes[0].heat.theta)  # type: ignore[arg-type]
    N, at, slips = line["section_force"].values, line["arclength"].values, line["sticks"].values == 0
    whole, tau, end = 210e9 * 0.172 * 1.2e-5 * theta, float(np.abs(line["xi"]).max()), 140.0
    assert N[slips] == pytest.approx(-tau * (end - at[slips]), abs=1e-9 * whole)
    assert N[at < 0.9 * (end - whole / tau)] == pytest.approx(-whole, rel=1e-6)
    assert float(tree["section_force_max"][0]) == pytest.approx(-whole, rel=1e-6)


def test_layers_share_the_force_by_their_stiffness(tmp_path: Path) -> None:
    """A bar of two layers of one ν that yields along its bond: N of both sum to that of the body, E_k H_k/ΣEH each."""
    text = STRIP.replace("height: 1 mm}", "height: 1 mm}, regions: {coat: {rectangle: {corner: [0 mm, 0.5 mm], "
                         "width: 100 mm, height: 0.5 mm}}, foil: {rectangle: {corner: [0 mm, 0 mm], width: 100 mm, "
                         "height: 0.5 mm}}}").replace("friction: FRICTION", "materials: {coat: {E: 210 GPa, nu: 0}, "
                         "foil: {E: 70 GPa, nu: 0}}\nfriction: {law: tresca, tau: 2 MPa}")  # fmt: skip
    text = text.replace("maxh: 4 mm, levels: 3", "maxh: 1 mm, levels: 2")
    (tmp_path / "layers.yaml").write_text(text, encoding="utf-8")
    tree = tcstudy.run(tmp_path / "layers.yaml", tmp_path / "layers.nc")
    for level, most in ((0, 1e-5), (1, 4e-6)):
        line = tree[f"level_{level}"].to_dataset()
        N, coat, foil = (line[name].values for name in ("section_force", "layer_force_coat", "layer_force_foil"))
        assert np.abs(coat + foil - N).max() < 1e-9 * P
        inner = (line["arclength"].values > 0.6 * L) & (line["arclength"].values < 0.9 * L)
        assert np.abs(coat - 0.75 * N)[inner].max() < most * P


def test_forces_of_edges_balance_on_any_body() -> None:
    """With heat, springs, a hole, traction and weight all forces add up to 0; a line that bends has no section."""
    study = study_of(HEATED_BRACKET, "boundary.right.spring={normal: 0.7, tangential: 0.2}")
    level, scene = levels_of(study)[-1], study.scenes[0]
    v = solve_contact(level.condensed(scene).problem).v
    u = level.displacement(scene, v)
    force = np.sum([one.reshape(2, -1).sum(axis=1) for one in edge_forces(level, scene, u).values()], axis=0)
    body = level.load(replace(loaded_by(scene, loads=True), boundary=())).reshape(2, -1).sum(axis=1)
    assert force + body == pytest.approx(np.zeros(2), abs=1e-12)
    assert np.abs(body).min() > 1e-3
    assert section_force(level, scene, u, v, np.zeros((len(level.mesh.triangles), 4))) is None


def test_a_line_that_bends_is_told_before_the_work() -> None:
    with pytest.raises(StudyError, match=r"quantities: section_force: the contact line is not straight"):
        study_of(HEATED_BRACKET, "output.quantities=section_force")
