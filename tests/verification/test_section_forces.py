"""Thin strips in closed form: forces of sections, layers of two materials; forces and energy of any
body."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import xarray as xr

import tcstudy
from tcstudy.contact.solve import solve_contact
from tcstudy.errors import StudyError
from tcstudy.offline.level import loaded_by
from tcstudy.offline.requested_outputs import edge_forces, section_force
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
    (folder / "strip.yaml").write_text(STRIP.replace("FRICTION", friction), encoding="utf-8")
    tree = tcstudy.run(tcstudy.load(folder / "strip.yaml", overrides), folder / "strip.nc")
    return tree.to_dataset(), [
        tree[f"level_{i}"].to_dataset() for i in range(tree.to_dataset().sizes["level"])
    ]


def test_shear_lag_of_a_lap_joint(tmp_path: Path) -> None:
    """Volkersen: N = P cosh λx/cosh λL, λ² = k/EH, of second order; the strip's own shear adds H/3G
    to 1/k."""
    data, lines = levels("{law: linear, k: 200 GPa/m}", tmp_path)
    slope = np.sqrt(1.0 / (1.0 / 200e9 + H / (1.5 * E)) / (E * H))
    exact = [P * np.cosh(slope * one["arclength"]) / np.cosh(slope * L) for one in lines]
    errors = [
        float(np.abs(one["section_force"] - N).max()) / P
        for one, N in zip(lines, exact, strict=True)
    ]
    assert errors[-1] < 1e-4
    assert errors[0] / errors[1] > 3.5
    assert data["section_force_max"].values == pytest.approx(np.full(3, P), rel=1e-12)
    assert data["section_force_at"].values == pytest.approx(np.full(3, L))
    sums = data["force_left_x"] + data["force_right_x"] + data["force_bottom_x"]
    assert np.abs(sums).max() < 1e-9 * P
    # what the load does at its end over 2 is the energy of strip and bond; ξ does −2 times that of
    # the bond
    assert data["work_right"].values == pytest.approx(-2.0 * data["energy"].values, rel=1e-9)


def test_layers_share_the_force_by_their_stiffness(tmp_path: Path) -> None:
    """A bar of two layers of one ν that yields along its bond: N of both sum to that of the body,
    E_k H_k/ΣEH each."""
    text = STRIP.replace(
        "height: 1 mm}",
        "height: 1 mm}, regions: {coat: {rectangle: {corner: [0 mm, 0.5 mm], "
        "width: 100 mm, height: 0.5 mm}}, foil: {rectangle: {corner: [0 mm, 0 mm], width: 100 mm, "
        "height: 0.5 mm}}}",
    ).replace(
        "friction: FRICTION",
        "materials: {coat: {E: 210 GPa, nu: 0}, "
        "foil: {E: 70 GPa, nu: 0}}\nfriction: {law: tresca, tau: 2 MPa}",
    )
    text = text.replace("maxh: 4 mm, levels: 3", "maxh: 1 mm, levels: 2")
    (tmp_path / "layers.yaml").write_text(text, encoding="utf-8")
    tree = tcstudy.run(tmp_path / "layers.yaml", tmp_path / "layers.nc")
    for level, most in ((0, 1e-5), (1, 4e-6)):
        line = tree[f"level_{level}"].to_dataset()
        N, coat, foil = (
            line[name].values for name in ("section_force", "layer_force_coat", "layer_force_foil")
        )
        assert np.abs(coat + foil - N).max() < 1e-9 * P
        inner = (line["arclength"].values > 0.6 * L) & (line["arclength"].values < 0.9 * L)
        assert np.abs(coat - 0.75 * N)[inner].max() < most * P


def test_bimetal_strip() -> None:
    """Timoshenko 1925, eq. (4): 1/ρ = 6 (α₂ − α₁) ΔT (1 + m)² / (h (3 (1 + m)² + (1 + mn)(m² +
    1/(mn)))).

    J. Opt. Soc. Am. 11, 233. m = t₁/t₂, n = E₁/E₂. In plane stress it is exact away from the ends;
    the strip is half of one, its middle (left) rolls without friction and is held by one short
    edge.
    """
    t_1, t_2, E_1, E_2, difference = 0.6, 0.4, 210.0, 100.0, 7e-6 * 50.0
    text = """
units: none
body:
  outline:
    - {from: [0, 0], edge: bottom}
    - {from: [8, 0], edge: end}
    - {from: [8, 1], edge: top}
    - {from: [0, 1], edge: middle}
    - {from: [0, 0.02], edge: held}
  regions: {lower: {rectangle: {corner: [0, 0], width: 8, height: 0.4}}}
boundary: {bottom: free, end: free, top: free, middle: contact, held: {role: clamped, u: [0, 0]}}
material: {E: 210, nu: 0.3, plane: stress, alpha_T: 12e-6}
materials: {lower: {E: 100, nu: 0.3, alpha_T: 19e-6}}
heat: {theta: 50}
friction: {law: linear, k: 0}
mesh: {maxh: 0.2, levels: 3}
"""
    m, n = t_1 / t_2, E_1 / E_2
    expected = (
        6 * difference * (1 + m) ** 2 / (3 * (1 + m) ** 2 + (1 + m * n) * (m**2 + 1 / (m * n)))
    )
    errors = []
    for level in levels_of(study := study_of(text)):
        condensed = level.condensed(study.scenes[0])
        u = level.displacement(study.scenes[0], solve_contact(condensed.problem).v)
        x, y = level.mesh.points.T
        line = np.flatnonzero((np.abs(y - 0.4) < 1e-9) & (x > 1.9) & (x < 6.1))
        curvature = 2 * np.polyfit(x[line], u[level.mesh.n_points + line], 2)[0]
        errors.append(abs(curvature / expected - 1))
    assert errors[-1] < 5e-3
    assert errors[0] / errors[1] > 3.5
    assert errors[1] / errors[2] > 3.8


def test_forces_of_edges_balance_on_any_body() -> None:
    """With heat, springs, a hole, traction and weight all forces add up to 0; a line that bends has
    no section."""
    study = study_of(HEATED_BRACKET, "boundary.right.spring={normal: 0.7, tangential: 0.2}")
    level, scene = levels_of(study)[-1], study.scenes[0]
    v = solve_contact(level.condensed(scene).problem).v
    u = level.displacement(scene, v)
    force = np.sum([one.sum(axis=1) for one in edge_forces(level, scene, u).values()], axis=0)
    body = level.load(replace(loaded_by(scene, loads=True), boundary=())).reshape(2, -1).sum(axis=1)
    assert force + body == pytest.approx(np.zeros(2), abs=1e-12)
    assert np.abs(body).min() > 1e-3
    assert section_force(level, scene, v, np.zeros((len(level.mesh.triangles), 4))) is None


def test_a_line_that_bends_is_told_before_the_work() -> None:
    with pytest.raises(
        StudyError, match=r"quantities: section_force: the contact line is not straight"
    ):
        study_of(HEATED_BRACKET, "output.quantities=section_force")


def test_total_energy_is_that_of_the_whole_system() -> None:
    """L̃(u₁) + constant = ½uᵀAu − Fᵀu + Σ c_i j(u_T)."""
    study = study_of(HEATED_BRACKET)
    scene, level = study.scenes[0], levels_of(study)[1]
    condensed = level.condensed(scene)
    answer = solve_contact(condensed.problem)
    u = level.displacement(scene, answer.v)
    A = level.elastic.stiffness_of((((), scene.material.lam, scene.material.mu),))
    direct = 0.5 * u @ (A @ u) - level.load(scene) @ u + level.line.c @ scene.friction.j(answer.v)
    assert answer.energy + condensed.constant == pytest.approx(direct, rel=1e-11)
