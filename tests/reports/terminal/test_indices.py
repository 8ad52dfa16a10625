"""Indices of runs: exact ones of a linear scene, sides of a jump told apart, files without a design
refused."""

import json
from pathlib import Path

import numpy as np
import pytest
import xarray as xr
from scipy.special import ndtri

import tcstudy
from tcstudy.accuracy.indices.saltelli import saltelli_indices
from tcstudy.errors import UsageError
from tcstudy.reports.terminal.indices import indices, indices_text, jump
from tcstudy.scene.designs import Design, cube
from tests.commands import CONFIGS, tcstudy_command
from tests.reports.conftest import Stored
from tests.verification.scenes import study_of

LINEAR = """
units: none
body: {rectangle: {width: 2, height: 1}}
parameters: {a: 1, b: 1}
boundary: {bottom: contact, left: clamped, top: {role: traction, g: ["a", 0]}, right: {role: traction, pressure: "b"}}
material: {E: 1, nu: 0.3}
friction: {law: tresca, tau: 1000}
mesh: {maxh: 1}
sweep: {mode: saltelli, points: 128, parameters.a: {uniform: [0, 1]}, parameters.b: {normal: {mean: 1, sigma: 0.5}}}
"""


def finished(folder: Path, text: str) -> Path:
    tcstudy.run(study_of(text), folder / "run.nc").close()
    return folder / "run.nc"


def test_a_body_that_sticks_has_the_indices_of_a_linear_function(tmp_path: Path) -> None:
    file = finished(tmp_path, LINEAR)
    with xr.open_dataset(file) as data:
        f = data["friction_resultant"].values[:, -1]
        x = np.column_stack([np.ones(f.size), data["a"].values, data["b"].values])
    slopes, *_ = np.linalg.lstsq(x, f, rcond=None)
    np.testing.assert_allclose(x @ slopes, f, rtol=1e-10)
    parts = slopes[1:] ** 2 * [1 / 12, 0.25]
    exact = parts / parts.sum()
    found = indices(file, "friction_resultant")
    assert "one side: every solution is certified to be the only one" in found.notes
    assert found.caption == "Indices of friction_resultant"
    for estimates in found.estimates.values():
        for index, share in zip(estimates, exact, strict=True):
            assert index.low <= share <= index.high
            assert index.value == pytest.approx(share, abs=0.05)
    for word, remedy in (
        ("work", "choose of"),
        ("friction_resutlant", "did you mean 'friction_resultant'"),
    ):
        with pytest.raises(UsageError, match=f"no number '{word}' at its points; {remedy}"):
            indices(file, word)


def test_the_example(tmp_path: Path) -> None:
    """On a coarse mesh: what its guide says of it holds, the strength decides whether the pad
    holds."""
    words = (
        "--set",
        "mesh.maxh=10 mm",
        "--set",
        "sweep.points=32",
        "--output",
        tmp_path / "pad.nc",
        "-q",
    )
    ran = tcstudy_command("run", CONFIGS / "random_adhesive.yaml", *words)
    assert "160 of 160 points" in ran.stdout, ran.stderr
    words = ("show", tmp_path / "pad.nc", "--of", "friction_resultant")
    assert "  Indices of the side on which a point lies:" in tcstudy_command(*words).stdout
    found = json.loads(tcstudy_command(*words, "--json").stdout)["indices"]
    side = {name: index["value"] for name, index in found["tables"][0]["total"].items()}
    assert any("is bimodal" in note for note in found["said"])
    assert max(side, key=lambda name: side[name]) == "tau_s"


def test_points_that_were_there_have_first_orders_of_numbers_and_choices(tmp_path: Path) -> None:
    """∫ξ is linear in a and in the law's elastic stiffness chosen by name nothing: the body
    sticks."""
    drawn = "a: {uniform: [0, 1]}, friction: {one: {law: tresca, tau: 1000}, two: {law: tresca, tau: 2000}}"
    file = finished(
        tmp_path,
        LINEAR.split("sweep:")[0] + f"sweep: {{mode: latin-hypercube, points: 256, {drawn}}}\n",
    )
    found = indices(file, "friction_resultant")
    assert found.notes[0].startswith("256 points, 95% confidence intervals; totals need points")
    linear, idle = found.estimates["first order"]
    assert (linear.low, linear.high) == pytest.approx((1.0, 1.0), abs=1e-9)
    assert idle.low == 0.0
    assert idle.value < 0.02
    assert "1.000  1.000 … 1.000" in indices_text(file, "friction_resultant")


def test_few_points_have_values_and_the_reason_for_no_interval(tmp_path: Path) -> None:
    drawn = "points: 40, parameters.a: {uniform: [0, 1]}, parameters.b: {uniform: [0, 1]}"
    correlation = 'correlation: {"parameters.a, parameters.b": 0.8}'
    text = LINEAR.split("sweep:")[0] + f"sweep: {{mode: random, {drawn}, {correlation}}}\n"
    file = finished(tmp_path, text)
    said = indices_text(file, "friction_resultant")
    assert "no interval of a, b: fewer than 50 points" in said
    assert "a and b depend on each other (rank correlation 0." in said
    assert "–" in said.splitlines()[-1]
    shown = tcstudy_command("show", file, "--of", "friction_resultant", "--json")
    index = json.loads(shown.stdout)["indices"]["tables"][0]["first order"]["b"]
    assert index["reason"] == "fewer than 50 points"
    assert index["low"] is None
    assert index["value"] > 0.0


def test_points_without_a_design_have_no_indices(stored: Stored) -> None:
    said = tcstudy_command("show", stored("block"), "--of", "slip_length")
    assert said.returncode == 2
    assert (
        "no design for them; run its study with sweep: {mode: saltelli, points: 256" in said.stderr
    )


# -- the estimators
# ------------------------------------------------------------------------------------

N = 1024


def ishigami(u: np.ndarray) -> np.ndarray:
    """sin x₁ + 7 sin² x₂ + 0.1 x₃⁴ sin x₁, x_i uniform in (−π, π) (Ishigami & Homma, ISUMA
    1990)."""
    x = np.pi * (2.0 * u - 1.0)
    return (
        np.sin(x[..., 0]) + 7.0 * np.sin(x[..., 1]) ** 2 + 0.1 * x[..., 2] ** 4 * np.sin(x[..., 0])
    )


V1, V2, V13 = 0.5 * (1 + 0.1 * np.pi**4 / 5) ** 2, 49 / 8, 0.01 * np.pi**8 * (1 / 18 - 1 / 50)
FIRST = np.array([V1, V2, 0.0]) / (V1 + V2 + V13)
TOTAL = np.array([V1 + V13, V2, V13]) / (V1 + V2 + V13)


def test_indices_of_ishigami_are_the_closed_form_within_their_intervals() -> None:
    f = ishigami(cube(Design("saltelli", N, 1), 3)).reshape(N, 5)
    orders = saltelli_indices(f)
    for estimates, exact in zip(orders, (FIRST, TOTAL), strict=True):
        for index, share in zip(estimates, exact, strict=True):
            assert index.value == pytest.approx(share, abs=0.015)
            assert index.low <= share <= index.high
    moved = saltelli_indices(1e-6 * f + 3.0)
    assert moved[0][0].value == pytest.approx(orders[0][0].value, rel=1e-7)


@pytest.mark.parametrize("share", [0.98, 0.9, 0.54, 0.3])
def test_intervals_of_a_saltelli_design_hold_the_truth(share: float) -> None:
    slopes, held = np.sqrt([share, 1.0 - share, 0.0]), np.zeros((2, 3))
    for seed in range(60):
        f = (ndtri(cube(Design("saltelli", 128, seed), 3)) @ slopes).reshape(-1, 5)
        for order, estimates in enumerate(saltelli_indices(f)):
            ends = np.array([(index.low, index.high) for index in estimates])
            held[order] += (ends[:, 0] <= slopes**2) & (slopes**2 <= ends[:, 1])
    assert np.all(held >= 0.85 * 60)


def test_few_base_points_have_no_intervals() -> None:
    """Of a product of inputs a short Sobol sequence gives intervals that miss: none up to 256."""
    for count, slopes, reason in ((32, 1.0, "fewer than 64"), (128, 0.0, "fewer than 256")):
        z = ndtri(cube(Design("saltelli", count, 1), 3))
        f = (slopes * z[:, 0] + z[:, 0] * z[:, 1]).reshape(-1, 5)
        for estimates in saltelli_indices(f):
            assert all(index.reason.startswith(reason) for index in estimates)
            assert np.all(np.isfinite([index.value for index in estimates]))


def test_what_does_not_vary_has_no_indices() -> None:
    f = 1.0 + 1e-14 * np.random.default_rng(0).random((64, 5))
    for estimates in saltelli_indices(f):
        for index in estimates:
            assert np.isnan(index.value)
            assert index.reason == "the result is the same at all points"


@pytest.mark.parametrize("scale", [1e-9, 1e6])
def test_a_jump_is_found_at_every_scale_and_in_no_smooth_distribution(scale: float) -> None:
    rng = np.random.default_rng(3)
    for smooth in (rng.normal(size=500), rng.lognormal(sigma=1.5, size=500), rng.random(200) ** 4):
        assert jump(scale * smooth) is None
        low, high = np.quantile(smooth, 0.3), np.ptp(smooth)
        ends = jump(scale * np.where(smooth > low, smooth + high, smooth))
        assert ends is not None
        assert ends[0] <= scale * low < ends[1]


def test_steps_of_a_mesh_are_no_jumps_and_dependent_values_narrow_a_jump_or_close_it() -> None:
    steps = np.round(np.random.default_rng(3).random(500), 1)
    assert jump(steps, 0.1) is None
    assert jump(np.where(steps > 0.5, steps + 1.0, steps), 0.1) == (0.5, 1.6)
    assert jump(np.repeat([0.0, 1.0], 40)) == (0.0, 1.0)
    assert jump(np.ones(100)) is None
    values = np.concatenate([np.linspace(0.0, 0.1, 40), np.linspace(1.0, 1.1, 40)])
    assert jump(values, 0.0, np.array([0.12, 1.05])) == (0.12, 1.0)
    assert jump(values, 0.0, np.linspace(0.1, 1.0, 30)) is None
