"""Load histories against closed forms that no study of the gallery has: bars on films that remember."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import xarray as xr

from tcstudy.read.study import read_study_text
from tcstudy.study.history_run import execute_history


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
