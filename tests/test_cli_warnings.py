"""No NumPy warning ever reaches a user: scenes with every kind of law, run with warnings as errors."""

from __future__ import annotations

from pathlib import Path

from tests.commands import tcstudy_command

HEATED = """units: none
body: {rectangle: {width: 2, height: 1}}
boundary: {bottom: contact, top: {role: clamped, u: [0, 0]}, left: convection, right: convection}
material: {E: 1, nu: 0.3, k: 1, beta: 0.5}
heat: {alpha: 1, theta_bar: 0.5}
friction: {law: slip-weakening, tau_s: 0.05, tau_k: 0.0, delta: 0.01}
mesh: {maxh: 0.25, levels: 3}
"""
SWEPT = """sweep:
  friction:
    soft: {law: slip-weakening, tau_s: 0.05, tau_k: 0.0, delta: 0.01}
    none: {law: tresca, tau: 0}
    tresca: {law: tresca, tau: 0.02}
    spring: {law: linear, k: 1}
    fading: {law: exponential, a: 0.05, b: 0, delta: 0.01}
    rising: {law: exponential, a: 0.01, b: 0.05, delta: 1.0e-6}
    teeth: {law: saw-tooth, tau: 0.05, delta: 0.01, teeth: 4, drop: 1}
    steep: {law: piecewise-linear, points: [[0, 0.05], [0.03, 0.05], [0.030000000000000002, 0.05], [0.1, 0.1]]}
    pushing: {law: piecewise-linear, points: [[0.01, -0.02], [0.02, 0.03]], odd: false, slopes: [0, 1]}
"""


def test_a_run_with_every_law(tmp_path: Path) -> None:
    (tmp_path / "scene.yaml").write_text(HEATED + SWEPT)
    result = tcstudy_command("run", "scene.yaml", cwd=tmp_path)
    assert result.returncode == 0, result.stderr
    assert "Warning" not in result.stderr + result.stdout
