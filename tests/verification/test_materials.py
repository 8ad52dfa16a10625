"""Materials by region against closed forms: layers in shear and in conduction, the bimetal strip, split bodies."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import xarray as xr
from numpy.typing import NDArray

import tcstudy
from tcstudy.contact.solve import solve_contact
from tcstudy.read.study import read_study_text
from tcstudy.reports.picture import body_fields
from tcstudy.reports.stresses import stresses, von_mises
from tests.verification.scenes import levels_of

Array = NDArray[np.float64]
L, H, BASE = 1.3, 1.0, 0.3
G_LAYER, G_REST, U = 0.25, 1.0, 0.8
SLIP = 0.6
"""Of the softening law at its residual traction 0.2 where the compliances of both layers carry it (see below)."""


def layered(degrees: float, maxh: float, law: str, top: float) -> str:
    """A block of two layers, turned: base in contact, top moved along, sides that roll; and its layer as a region."""
    c, s = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))

    def at(x: float, y: float) -> str:
        return f"[{float(c * x - s * y)!r}, {float(s * x + c * y)!r}]"

    corners = zip([(0, 0), (L, 0), (L, H), (0, H)], ["base", "right", "top", "left"], strict=True)
    outline = ", ".join(f"{{from: {at(*corner)}, edge: {edge}}}" for corner, edge in corners)
    polygon = ", ".join(at(*corner) for corner in [(0, 0), (L, 0), (L, BASE), (0, BASE)])
    return f"""
units: none
body: {{outline: [{outline}], regions: {{layer: {{polygon: [{polygon}]}}}}}}
boundary:
  base: contact
  top: {{role: clamped, u: [{float(c * top)!r}, {float(s * top)!r}]}}
  left: {{role: clamped, u_T: 0}}
  right: {{role: clamped, u_T: 0}}
material: {{lambda: 1.7, mu: {G_REST}}}
materials: {{layer: {{lambda: 5.1, mu: {G_LAYER}}}}}
friction: {law}
mesh: {{maxh: {maxh}}}
"""


@pytest.mark.parametrize(("degrees", "maxh"), [(0.0, 0.35), (37.0, 0.17)])
def test_patch_across_the_interface(degrees: float, maxh: float) -> None:
    """Shear of two layers carries one traction τ = (U − s)/(h₁/G₁ + h₂/G₂): u is linear in each, exact in P1."""
    compliance = BASE / G_LAYER + (H - BASE) / G_REST
    top = SLIP + 0.2 * compliance
    law = "{law: slip-weakening, tau_s: 1, tau_k: 0.2, delta: 0.4}"
    [level] = levels_of(study := read_study_text(layered(degrees, maxh, law, top)))
    condensed = level.condensed(study.scenes[0])
    v = np.full(condensed.problem.m, SLIP)
    assert condensed.problem.inclusion_residual(v, tolerance=1e-12) < 1e-12
    u = level.displacement(study.scenes[0], v)
    turn = np.radians(degrees)
    y = level.mesh.points @ [-np.sin(turn), np.cos(turn)]
    along = SLIP + 0.2 * (np.minimum(y, BASE) / G_LAYER + np.maximum(y - BASE, 0.0) / G_REST)
    assert np.max(np.abs(u - np.concatenate([np.cos(turn) * along, np.sin(turn) * along]))) < 1e-12
    energy = L * (0.2**2 * compliance / 2 + float(study.scenes[0].one_law.j(np.array(SLIP))))
    assert condensed.problem.energy(v) + condensed.constant == pytest.approx(energy, abs=1e-12)


SLAB = """
body:
  rectangle: {width: 40 mm, height: 30 mm}
  regions:
    coating: {rectangle: {corner: [0 mm, 0 mm], width: 40 mm, height: 3 mm}}
    middle: {rectangle: {corner: [0 mm, 3 mm], width: 40 mm, height: 17 mm}}
boundary: {bottom: convection, left: contact, top: convection, right: {role: clamped, u: [0, 0]}}
material: {E: 200 GPa, nu: 0.3, k: 45, alpha_T: 12e-6}
materials:
  coating: {E: 3 GPa, nu: 0.35, k: 0.25, alpha_T: 60e-6}
  middle: {E: 70 GPa, nu: 0.33, k: 200, alpha_T: 23e-6}
heat: {alpha: 500, theta_bar: "20 + 80*y/0.03"}
friction: {law: tresca, tau: 1 MPa}
mesh: {maxh: 5 mm}
"""


def test_layered_slab_conducts_like_resistances_in_series() -> None:
    """Air of 20 K below and of 100 K above: q'' = ΔT/(2/α + Σ h_i/k_i), θ linear in every layer, exact in P1."""
    study = read_study_text(SLAB.replace("alpha: 500, ", "") + "sweep: {alpha: [5, 500, 5e4]}\n")
    [level] = levels_of(study)
    y = level.mesh.points[:, 1]
    for scene, alpha in zip(study.scenes, [5.0, 500.0, 5e4], strict=True):
        flux = 80.0 / (2 / alpha + 3e-3 / 0.25 + 17e-3 / 200.0 + 10e-3 / 45.0)
        below = [np.clip(y - bottom, 0.0, height) for bottom, height in ((0.0, 3e-3), (3e-3, 17e-3), (20e-3, 10e-3))]
        resistance = sum(part / k for part, k in zip(below, (0.25, 200.0, 45.0), strict=True))
        theta = 20.0 + flux * (1 / alpha + resistance)
        assert np.max(np.abs(level.temperature(scene).theta - theta)) < 1e-10


def test_bimetal_strip() -> None:
    """Timoshenko 1925, eq. (4): 1/ρ = 6 (α₂ − α₁) ΔT (1 + m)² / (h (3 (1 + m)² + (1 + mn)(m² + 1/(mn)))).

    J. Opt. Soc. Am. 11, 233. m = t₁/t₂, n = E₁/E₂. In plane stress it is exact away from the ends; the strip is half of
    one, its middle (left) rolls without friction and is held by one short edge.
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
    expected = 6 * difference * (1 + m) ** 2 / (3 * (1 + m) ** 2 + (1 + m * n) * (m**2 + 1 / (m * n)))
    errors = []
    for level in levels_of(study := read_study_text(text)):
        condensed = level.condensed(study.scenes[0])
        u = level.displacement(study.scenes[0], solve_contact(condensed.problem).v)
        x, y = level.mesh.points.T
        line = np.flatnonzero((np.abs(y - 0.4) < 1e-9) & (x > 1.9) & (x < 6.1))
        curvature = 2 * np.polyfit(x[line], u[level.mesh.n_points + line], 2)[0]
        errors.append(abs(curvature / expected - 1))
    assert errors[-1] < 5e-3
    assert errors[0] / errors[1] > 3.5
    assert errors[1] / errors[2] > 3.8


def test_stresses_are_those_of_the_region(tmp_path: Path) -> None:
    """A bar of two layers under a common strain ε: σ = E ε in each, 0 across; the region of a triangle is stored."""
    study = read_study_text("""
units: none
body:
  rectangle: {width: 2, height: 1}
  regions: {upper: {rectangle: {corner: [0, 0.5], width: 2, height: 0.5}}}
boundary: {bottom: contact, left: {role: clamped, u_x: 0}, top: free, right: {role: clamped, u_x: 0.02}}
material: {E: 3, nu: 0, plane: stress}
materials: {upper: {E: 7, nu: 0, alpha_T: 0.001}}
heat: {theta: 4}
friction: {law: linear, k: 0}
mesh: {maxh: 0.5}
output: {fields: true}
""")
    tcstudy.run(study, tmp_path / "bar.nc")
    with xr.open_dataset(tmp_path / "bar.nc", group="level_0") as group:
        body, region = body_fields(group), group["region"].values
        assert group["region"].attrs["flag_meanings"] == "body upper"
    assert body is not None
    middle = body.xy[body.triangles, 1].mean(axis=1)
    assert np.array_equal(region, (middle > 0.5).astype(int))
    sigma, energy = stresses(body, study.scenes[0].material)
    expected = np.where(middle > 0.5, 7 * (0.01 - 0.004), 3 * 0.01)
    assert np.allclose(sigma[:, 0], expected, rtol=1e-10)
    assert np.allclose(von_mises(sigma), expected, rtol=1e-10)
    assert np.allclose(energy, expected**2 / 2 / np.where(middle > 0.5, 7, 3), rtol=1e-9)
