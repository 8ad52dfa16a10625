"""Sweeps whose points are drawn or stand in a table: values, labels, what is refused."""

from __future__ import annotations

from pathlib import Path

import pytest

from tcstudy.data.writer import sweep_points
from tcstudy.errors import StoreError, StudyError
from tcstudy.read.study import read_study_text
from tcstudy.scene.study import Study
from tcstudy.study.union import places_in, union

BASE = """
body: {rectangle: {width: 2 m, height: 1 m}}
boundary: {bottom: contact, left: clamped, top: free, right: free}
material: {E: 1 GPa, nu: 0.3}
friction: {law: slip-weakening, tau_s: 2 MPa, tau_k: 1 MPa, delta: 1 mm}
mesh: {maxh: 0.5 m}
"""


def swept(text: str, source: Path | None = None) -> Study:
    return read_study_text(f"{BASE}sweep: {text}\n", "test", (), source)


def drawn(mode: str, points: int = 8, seed: int = 7) -> Study:
    said = f"tau_s: {{lognormal: {{median: 2 MPa, sigma: 0.1}}}}, nu: {{choice: [0.2, 0.3]}}, points: {points}"
    return swept(f"{{mode: {mode}, seed: {seed}, {said}}}")


@pytest.mark.parametrize("mode", ["random", "latin-hypercube", "sobol"])
def test_drawn_points_are_a_list_whose_coordinates_know_their_distribution(mode: str) -> None:
    study = drawn(mode)
    assert (study.mode, study.shape) == ("list", (8,))
    tau, nu = study.axes
    assert [float(scene.friction.interval(0.0)[1]) for scene in study.scenes] == list(tau.labels)
    assert {scene.material.nu for scene in study.scenes} == {0.2, 0.3}
    data = sweep_points(study)
    assert data["tau_s"].attrs["distribution"] == "lognormal(median=2000000, sigma=0.1)"
    assert data["nu"].attrs["distribution"] == "choice(0.2, 0.3)"
    assert data["tau_s"].attrs["units"] == "Pa"
    assert 1e6 < min(tau.labels) < 2e6 < max(tau.labels) < 4e6
    assert len(nu.labels) == 8


def test_a_design_grows_by_its_own_points_only() -> None:
    old, new = drawn("sobol"), drawn("sobol", 16)
    assert union(old, new) is new
    assert places_in(new, old).tolist() == list(range(8))
    with pytest.raises(StoreError, match="not the first of this design; keep mode, seed"):
        union(old, drawn("sobol", 16, seed=8))


def test_laws_are_chosen_by_name() -> None:
    laws = "friction: {a: {law: tresca, tau: 1 MPa}, b: {law: tresca, tau: 2 MPa}}"
    study = swept(f"{{mode: random, points: 6, {laws}, E: {{uniform: [1 GPa, 2 GPa]}}}}")
    assert set(study.axes[0].labels) == {"a", "b"}
    assert study.axes[0].distribution == "choice(a, b)"


@pytest.mark.parametrize(
    ("sweep", "what"),
    [
        ("{mode: random, E: {uniform: [1, 2]}}", "test:7:8: sweep.points: is missing"),
        ("{mode: random, points: 4}", "test:7:8: sweep: has no parameter to draw"),
        ("{mode: random, points: 4, E: [1, 2]}", "sweep.E: must be a distribution, but is a list of 2"),
        ("{mode: random, points: 4, E: {uniform: [2, 1]}}", "test:7:47: sweep.E.uniform: ends at 1, but begins at 2"),
        ("{mode: random, points: 4, E: {uniform: [1, 2 m]}}", "'m' is not a unit of a stress"),
        ("{mode: random, points: 4, E: {lognormal: {median: 1 GPa}}}", "sweep.E.lognormal.sigma: is missing"),
        ("{mode: random, points: 4, E: {lognormal: {median: 1 GPa, sigma: 1 Pa}}}", "a plain number"),
        ("{mode: random, points: 4, E: {linspace: [1, 2, 3]}}", "sweep.E.linspace: unknown key"),
        ("{mode: random, points: 4, seed: -1, E: {uniform: [1, 2]}}", "sweep.seed: must be 0 or more"),
        ("{mode: random, points: 4, nu: {normal: {mean: 0.4, sigma: 5}}}", "(at the sweep point 0: nu ="),
        ("{mode: random, points: 9, nu: {choice: [0.1, 0.2]}}", "is repeated"),
        ("{mode: saltelli, points: 4, nu: {choice: [0.1, 0.2]}}", "a choice has no indices"),
        ("{mode: saltelli, points: 400000, E: {uniform: [1, 2]}}", "400000 × (1 + 2) points"),
        ("{points: 4, E: [1, 2]}", "points are for modes that list or draw points"),
        ("{seed: 4, E: [1, 2]}", "seed is for modes that list or draw points"),
    ],
)
def test_what_is_refused(sweep: str, what: str) -> None:
    with pytest.raises(StudyError) as caught:
        swept(sweep)
    assert what in str(caught.value)


def test_a_law_that_a_draw_makes_inadmissible_is_refused_with_its_point() -> None:
    with pytest.raises(StudyError) as caught:
        swept("{mode: random, points: 50, seed: 1, tau_k: {normal: {mean: 0 MPa, sigma: 1 MPa}}}")
    assert "at the sweep point" in str(caught.value)
    assert len(caught.value.problems) == 1
