"""Indices of runs: exact ones of a linear scene, sides of a jump told apart, files without a design refused."""

import json
from pathlib import Path

import numpy as np
import pytest
import xarray as xr

import tcstudy
from tcstudy.errors import UsageError
from tcstudy.reports.terminal.indices import indices, indices_text
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
        assert np.all((estimate.low <= exact) & (exact <= estimate.high))
        np.testing.assert_allclose(estimate.value, exact, atol=0.05)
    for word, remedy in (("work", "choose of"), ("friction_resutlant", "did you mean 'friction_resultant'")):
        with pytest.raises(UsageError, match=f"no number '{word}' at its points; {remedy}"):
            indices(file, word)


def test_the_example(tmp_path: Path) -> None:
    """On a coarse mesh: what its guide says of it holds, the strength decides whether the pad holds."""
    words = ("--set", "mesh.maxh=10 mm", "--set", "sweep.points=32", "--output", tmp_path / "pad.nc", "-q")
    ran = tcstudy_command("run", CONFIGS / "random_adhesive.yaml", *words)
    assert "160 of 160 solved" in ran.stdout, ran.stderr
    words = ("show", tmp_path / "pad.nc", "--of", "friction_resultant")
    assert "  Indices of the side on which a point lies:" in tcstudy_command(*words).stdout
    found = json.loads(tcstudy_command(*words, "--json").stdout)["indices"]
    side = {name: index["value"] for name, index in found["tables"][0]["total"].items()}
    assert "leaves a gap" in found["said"][-1]
    assert max(side, key=lambda name: side[name]) == "tau_s"


def test_points_that_were_there_have_first_orders_of_numbers_and_choices(tmp_path: Path) -> None:
    """∫ξ is linear in a and in the law's elastic stiffness chosen by name nothing: the body sticks."""
    drawn = "a: {uniform: [0, 1]}, friction: {one: {law: tresca, tau: 1000}, two: {law: tresca, tau: 2000}}"
    file = finished(tmp_path, LINEAR.split("sweep:")[0] + f"sweep: {{mode: latin-hypercube, points: 256, {drawn}}}\n")
    found = indices(file, "friction_resultant")
    assert found.said[0].startswith("256 points, 95% confidence by resampling them; totals need")
    np.testing.assert_allclose(found.estimates["first order"].value, [1.0, 0.0], atol=0.02)
    assert "first order" in indices_text(file, "friction_resultant")


def test_points_without_a_design_have_no_indices(stored: Stored) -> None:
    said = tcstudy_command("show", stored("block"), "--of", "slip_length")
    assert said.returncode == 2
    assert "no design for indices; run its study with sweep: {mode: saltelli, points: 256" in said.stderr
