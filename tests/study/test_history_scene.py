"""Derivatives stored with the steps of a history: against whole histories of other numbers, and gone on from a file."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from tcstudy.data.on_request import DIFFERENTIABLE, name_of
from tests.study.test_history_run import SOFT, followed

NUMBERS = {"friction.tau_s": 20e6, "friction.delta": 1e-3, "E": 210e9, "history.stiffness": 500e9}
ASKED = f"output.sensitivity=[{', '.join(NUMBERS)}]"
HISTORY = "{memory: elastic-plastic, stiffness: 500 GPa/m, steps: [{theta: 60 K, in: 2}, {theta: -30 K, in: 2}]}"


def test_derivatives_of_steps_against_histories_and_gone_on_from_a_file(tmp_path: Path) -> None:
    data = followed(tmp_path, SOFT, HISTORY, ASKED)
    assert data["sensitivity_status"].values.tolist() == [DIFFERENTIABLE] * 5
    quantities = ("u_T_max", "friction_resultant")
    for name, value in NUMBERS.items():
        ends = []
        for h in (1e-4, -1e-4):
            other = followed(tmp_path, SOFT, HISTORY, f"{name}={value * (1.0 + h)!r}", name=f"{name}{h}.nc")
            ends.append(np.array([other[q].values for q in quantities]))
        exact = np.array([data[name_of(q, name)].values for q in quantities])
        apart = (ends[0] - ends[1]) / (2e-4 * value)
        assert exact == pytest.approx(apart, abs=2e-6 * np.max(np.abs(apart)) + 1e-9 * np.max(np.abs(exact)))
        assert np.all(exact[:, 0] == 0.0)
    grown = followed(tmp_path, SOFT, HISTORY.replace("]}", ", {theta: 50 K}]}"), ASKED)
    whole = followed(tmp_path, SOFT, HISTORY.replace("]}", ", {theta: 50 K}]}"), ASKED, name="whole.nc")
    assert grown.sizes["step"] == 6
    assert np.isfinite(grown["sensitivity_u_T_max_history_stiffness"].values).all()
    for name in data:
        if name.startswith("sensitivity"):
            assert np.array_equal(grown[name].values, whole[name].values), name


STOPS = """
units: none
body: {rectangle: {width: 2.2324723790194616, height: 0.8591188145243812}}
boundary: {bottom: contact, left: clamped, top: free, right: {role: traction, g: [0, 0]}}
material: {E: 1.3012522407224956, nu: 0.3288450301226269, alpha_T: 0.8}
heat: {theta: 0}
friction: {law: slip-weakening, tau_s: 0.3860451627262666, tau_k: 0.14047222250773428, delta: 0.42213692902206257}
mesh: {maxh: 0.2}
solver: {tolerance: 1e-13}
"""
PULLED = """{memory: friction, steps: [
  {boundary.right.g_x: 1.1, theta: 0.3, in: 3}, {boundary.right.g_x: -0.3, theta: 0.1, in: 3},
  {boundary.right.g_x: 0.9, theta: -0.6, in: 3}, {theta: 0.5, boundary.right.g_x: -1.2, in: 3}]}"""


def test_a_node_that_slides_and_stops_within_a_step(tmp_path: Path) -> None:
    """Its κ is not what the ends of the step tell; differences of fourth order of histories at other steps."""
    data = followed(tmp_path, STOPS, PULLED, "output.sensitivity=[friction.tau_s]")
    assert data["sensitivity_status"].values[-1] == DIFFERENTIABLE
    tau, h, ends = 0.3860451627262666, 3e-6, []
    for way in (2.0, 1.0, -1.0, -2.0):
        other = followed(tmp_path, STOPS, PULLED, f"friction.tau_s={tau * (1.0 + way * h)!r}", name=f"{way}.nc")
        ends.append(np.array([other["u_T_max"].values[-1], other["friction_resultant"].values[-1]]))
    exact = (8.0 * (ends[1] - ends[2]) - (ends[0] - ends[3])) / (12.0 * h * tau)
    found = [float(data[name_of(q, "friction.tau_s")][-1]) for q in ("u_T_max", "friction_resultant")]
    assert found == pytest.approx(exact, rel=1e-5)


def test_a_number_at_the_end_of_what_it_may_be_has_the_derivative_of_its_side(tmp_path: Path) -> None:
    """A film that falls to nothing: τ_k can only grow; one of no size at all has a scale as well."""
    study = SOFT.replace("tau_k: 15 MPa", "tau_k: 0 MPa").replace("delta: 1 mm", "delta: 4 mm")
    history = "{memory: friction, steps: [{theta: 60 K}, {theta: -30 K}]}"
    data = followed(tmp_path, study, history, "output.sensitivity=[friction.tau_k, loads.f_x]")
    for name, change, key in (("friction.tau_k", 2e3, "friction.tau_k={}"), ("loads.f_x", 1e3, "loads.f=[{}, 0]")):
        runs = [followed(tmp_path, study, history, key.format(k * change), name=f"{name}{k}.nc") for k in (0, 1, 2)]
        ends = [run["friction_resultant"].values for run in runs]
        exact = (4.0 * ends[1] - ends[2] - 3.0 * ends[0]) / (2.0 * change)
        assert data[name_of("friction_resultant", name)].values == pytest.approx(exact, rel=1e-5, abs=1e-9)
