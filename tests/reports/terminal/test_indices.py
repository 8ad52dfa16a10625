"""Indices of runs: exact ones of a linear scene, sides of a jump told apart, files without a design
refused."""

import json
from pathlib import Path

import numpy as np
import pytest
import xarray as xr

import tcstudy
from tcstudy.errors import UsageError
from tcstudy.reports.terminal.indices import correlation_ratios, indices, indices_text, jump, sobol
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
    assert "one side: every solution is certified to be the only one" in found.said
    assert found.caption == "Indices of friction_resultant"
    for estimate in found.estimates.values():
        assert np.all((estimate[1] <= exact) & (exact <= estimate[2]))
        np.testing.assert_allclose(estimate[0], exact, atol=0.05)
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
    assert "leaves a gap" in found["said"][-1]
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
    assert found.said[0].startswith("256 points, 95% confidence by resampling them; totals need")
    np.testing.assert_allclose(found.estimates["first order"][0], [1.0, 0.0], atol=0.02)
    assert "first order" in indices_text(file, "friction_resultant")


def test_points_without_a_design_have_no_indices(stored: Stored) -> None:
    said = tcstudy_command("show", stored("block"), "--of", "slip_length")
    assert said.returncode == 2
    assert (
        "no design for indices; run its study with sweep: {mode: saltelli, points: 256"
        in said.stderr
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
    for estimate, exact in zip(sobol(f), (FIRST, TOTAL), strict=True):
        np.testing.assert_allclose(estimate[0], exact, atol=0.015)
        assert np.all((estimate[1] <= exact) & (exact <= estimate[2]))
    moved = sobol(1e-6 * f + 3.0)
    np.testing.assert_allclose(moved[0][0], sobol(f)[0][0], rtol=1e-7)


def test_a_choice_has_the_share_of_the_means_of_its_values() -> None:
    """y = (0, 3, 1)_c + x: Var E[y|c] = 14/9, Var x = 1/12."""
    rng = np.random.default_rng(2)
    c, x = rng.integers(0, 3, 5000), rng.random(5000)
    exact = np.array([14 / 9, 1 / 12]) / (14 / 9 + 1 / 12)
    found = correlation_ratios(
        np.stack([c, x], axis=1), np.array([0.0, 3.0, 1.0])[c] + x, (True, False)
    )
    np.testing.assert_allclose(found[0], exact, atol=0.01)


def test_what_does_not_vary_has_no_indices_but_zero() -> None:
    assert not any(
        np.any(one[0]) for one in sobol(1.0 + 1e-14 * np.random.default_rng(0).random((64, 5)))
    )


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
