"""Load histories against closed forms that no study of the gallery has: bars on films that remember."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import xarray as xr
from numpy.typing import NDArray

from tcstudy.read.study import read_study_text
from tcstudy.study.history_run import execute_history

Array = NDArray[np.float64]


def followed(folder: Path, text: str) -> xr.Dataset:
    """The data of a history, every step solved along its path, nothing missed."""
    execute_history(read_study_text(text), folder / "a.nc")
    with xr.open_dataset(folder / "a.nc") as opened:
        data = opened.load()
    assert data["reason"].item() == ""
    assert np.all(np.abs(data["closure"].values) <= 1e-8 * float(np.abs(data["work"]).sum()))
    return data


def test_a_pipeline_walks_down_a_slope(tmp_path: Path) -> None:
    """Weight w a length along the slope against friction r: anchors at L (1 ∓ w/r)/2, a walk between them a cycle.

    Hot N = −(r − w)(L − x) and cold N = (r − w) x between the anchors, so that it is (ε − (r − w) L/D) L w/r. Where
    nodes neither load nor unload (the middle of a cooling line), rounding must not move the path.
    """
    D, length, r, w, epsilon = 3.2913e9, 2000.0, 1e3, 300.0, 1.17e-5 * 80.0
    data = followed(
        tmp_path,
        """
body: {rectangle: {width: 2000 m, height: 9 m}}
boundary: {bottom: contact, left: free, right: free, top: free}
material: {E: 365.7 MPa, nu: 0, plane: stress, alpha_T: 1.17e-5 1/K}
heat: {theta: 0 K}
loads: {f: [33.3333333333333 N/m^3, 0]}
friction: {law: tresca, tau: 1 kPa}
mesh: {maxh: 10 m}
history: {memory: friction, steps: [{theta: 80 K}, {theta: 0 K}], repeat: 2}
""",
    )
    walk = data["u_T"].values[4] - data["u_T"].values[2]
    assert walk == pytest.approx(
        (epsilon - (r - w) * length / D) * length * w / r, rel=4e-4
    )  # a plane strip, not a bar
    assert np.ptp(walk) <= 1e-10


BLOCK = """
body: {{rectangle: {{width: 1.3 m, height: 1 m}}}}
boundary:
  bottom: contact
  top: {{role: clamped, u_x: 0, u_y: 0}}
  left: {{role: clamped, u_x: free, u_y: 0}}
  right: {{role: clamped, u_x: free, u_y: 0}}
material: {{E: {E} Pa, nu: 0}}
friction: {{law: piecewise-linear, points: {points}}}
mesh: {{maxh: 0.4 m}}
history: {{memory: {memory}, steps: [{steps}]}}
"""
"""A block in uniform shear, exact on any mesh: G (U − s) ∈ b̂(s), G = E/2, U the way of its top."""


def block(points: str, memory: str, ways: list[float], E: float = 2.0) -> str:
    """The block, its top led to U = `ways`."""
    steps = ", ".join(f"{{boundary.top.u_x: {way:.15g} m}}" for way in ways)
    return BLOCK.format(points=points, memory=memory, steps=steps, E=E)


def test_a_film_as_steep_as_the_block_is_stiff(tmp_path: Path) -> None:
    """ω = λ₁: at U = 0.5 every slip from 0 to 0.4 is in balance; the block goes on from 0.4, nothing is released."""
    data = followed(tmp_path, block("[[0, 1 Pa], [0.4 m, 0.2 Pa]]", "friction", [0.8, 1.2, 0.8, -0.2], E=4.0))
    assert np.abs(data["u_T"].values[1:, 0]) == pytest.approx([0.7, 1.1, 0.9, 0.1], abs=1e-12)
    assert float(data["released"].sum()) <= 1e-5 * float(data["dissipated"].sum())


def test_a_hardening_film_shakes_down(tmp_path: Path) -> None:
    """±U in turns: τ_n+1 = τ_n + h Δp, Δp = 2 (k_e U − τ_n)/(k_e + h), 1/k_e = 1/k + 1/G, at last elastic."""
    k, h, U = 3.0, 0.4, 2.4
    k_e = 1.0 / (1.0 / k + 1.0)
    data = followed(tmp_path, block("[[0, 1 Pa], [10 m, 5 Pa]]", f"elastic-plastic, stiffness: {k} Pa/m", [U, -U] * 6))
    kappa = [(k_e * U - 1.0) / (k_e + h)]
    for _ in range(11):
        kappa.append(kappa[-1] + 2.0 * (k_e * U - 1.0 - h * kappa[-1]) / (k_e + h))
    assert data["kappa"].values[1:, 0] == pytest.approx(kappa, rel=1e-12)
    assert np.abs(data["xi"].values[1:, 0]) == pytest.approx(1.0 + h * np.array(kappa), rel=1e-12)
    assert kappa[-1] == pytest.approx((k_e * U - 1.0) / h, rel=1e-2)


def test_without_friction_nothing_is_remembered(tmp_path: Path) -> None:
    """Law 0: the block's base follows its top there and back, whatever the memory."""
    for memory in ("friction", "damage", "elastic-plastic, stiffness: 50 Pa/m"):
        folder = tmp_path / memory[:3]
        folder.mkdir()
        data = followed(folder, block("[[0, 0 Pa], [1 m, 0 Pa]]", memory, [0.8, -0.2]))
        assert np.abs(data["u_T"].values[1:, 0]) == pytest.approx([0.8, 0.2], rel=1e-12)
        assert not np.any(data["dissipated"].values)


STRIP = """
body: {{outline: [{{from: [0 mm, 0 mm], edge: bond}}, {joint} {{from: [{end}, 0 mm], edge: grip}},
                 {{from: [{end}, 1 mm], edge: top}}, {{from: [0 mm, 1 mm], edge: left}}]}}
boundary: {{bond: contact, {edges}, top: free, left: free}}
material: {{E: 42.24 GPa, nu: 0, plane: stress}}
friction: {friction}
mesh: {{maxh: 1 mm}}
history: {{memory: {memory}, steps: [{steps}]}}
"""
"""A strip of D = 42.24 kN/mm on a film, a bar 1 mm high pulled at its right end."""
D, TAU, S_0, S_F = 42.24e6, 7.2e6, 0.02e-3, 0.16e-3
BILINEAR = "{law: bilinear, tau: 7.2 MPa, s0: 0.02 mm, sf: 0.16 mm}"


def energy(s: Array) -> Array:
    """T = ∫ b of the bilinear law, so that a long bond has P² = 2 D T(Δ) as it is first pulled [J/m²]."""
    falls = np.clip(s, S_0, S_F) - S_0
    return TAU * (0.5 * np.minimum(s, S_0) ** 2 / S_0 + falls - 0.5 * falls**2 / (S_F - S_0))


def spent(s: Array) -> Array:
    """R = T − ½ s b, what damage up to the slip s has dissipated [J/m²]."""
    return energy(s) - 0.5 * s * TAU * np.minimum(s / S_0, np.maximum(S_F - s, 0.0) / (S_F - S_0))


def test_a_long_bond_of_a_bilinear_law_is_torn_from_its_end(tmp_path: Path) -> None:
    """The front moves by D/P_max a slip of the end; the way back is straight to the origin and costs nothing."""
    ways = np.array([0.01, 0.5, 0.2, -0.3])
    steps = ", ".join(f"{{boundary.grip.u_x: {way} mm}}" for way in ways)
    grip = "grip: {role: clamped, u_x: 0 mm, u_y: free}"
    scene = STRIP.format(joint="", end="190 mm", edges=grip, friction=BILINEAR, memory="damage", steps=steps)
    data, P = followed(tmp_path, scene), np.sqrt(2.0 * D * energy(np.array(S_F)))
    assert data["friction_resultant"].values[2:] == pytest.approx(ways[1:] / ways[1] * P, rel=5e-4)
    s = np.linspace(S_0, S_F, 20_001)
    zone = np.trapezoid(spent(s) / np.sqrt(2.0 * energy(s) / D), s)
    length = (0.5e-3 - S_F) * D / P
    lost = np.cumsum(data["dissipated"].values)[1:]
    assert lost == pytest.approx([0.0, *[zone + energy(np.array(S_F)) * length] * 3], rel=1e-3)
    assert data["debonded_from"].values[1:] == pytest.approx([np.nan, *[0.19 - length] * 3], rel=5e-4, nan_ok=True)
    assert data["debonded_to"].values[-1] == pytest.approx(0.19)
    kappa = data["kappa"].values[-1]
    lost = data["dissipation"].values.sum(axis=0)  # of every node
    assert lost == pytest.approx(np.where(kappa > S_0, spent(kappa), 0.0), abs=1e-12 * energy(np.array(S_F)))
    assert lost @ data["c"].values == pytest.approx(data["dissipated"].values.sum(), rel=1e-13)


def test_a_bond_that_damages_beside_a_joint_that_slides(tmp_path: Path) -> None:
    """Pulled by P, then by P': the joint of length l turns all its friction r, the bond behind it goes back straight.

    P_b = P − r l pulls the bond to Δ, P'_b = P' + r l leaves Δ P'_b/P_b; the joint adds ∫ N/D. The node between them
    has the memory of one for the law of both: an error of first order.
    """
    own, r, P = 60e-3, 1e6, np.array([200e3, 40e3])
    on_bond, s = P + np.array([-r * own, r * own]), np.linspace(0.0, S_F, 200_001)
    ends = on_bond / on_bond[0] * np.interp(on_bond[0] ** 2 / (2.0 * D), energy(s), s)
    ways = ends + (0.5 * own / D) * (P + on_bond)
    scene = STRIP.format(
        joint="{from: [190 mm, 0 mm], edge: joint},",
        end="250 mm",
        edges="joint: contact, grip: {role: clamped, u_x: 0 mm, u_y: free}",
        friction=f"{{bond: {BILINEAR}, joint: {{law: tresca, tau: 1 MPa}}}}",
        memory="{bond: damage, joint: friction}",
        steps=", ".join(f"{{boundary.grip.u_x: {way:.15g} m}}" for way in ways),
    )
    data = followed(tmp_path, scene)
    assert data["friction_resultant"].values[1:] == pytest.approx(P, rel=5e-3)
    found = [np.interp(0.19, data["arclength"].values, u) for u in data["u_T"].values[1:]]
    assert found == pytest.approx(ends, rel=1e-2)
    assert data.attrs["memory"] == "bond: damage, joint: friction"
