"""Where the exact solution is one of several and not the least, errors are those of its own branch, and it is said."""

from __future__ import annotations

from pathlib import Path

import numpy as np

import tcstudy
from tcstudy.accuracy.expected import HeldEnds, expected_orders, smooth_up_to
from tcstudy.read.study import read_study_text
from tcstudy.study.convergence import converge
from tests.verification.series import errors, series

FALLING_FILM = """\
units: none
body: {rectangle: {width: 1, height: 1}}
boundary: {bottom: contact, top: clamped, left: convection, right: convection}
material: {lambda: 1.5, mu: 1, beta: 0.5, k: 1}
heat: {alpha: 2}
friction: {law: exponential, a: 0.6, b: 0.2, delta: 0.125}
mesh: {maxh: 0.25, levels: 4}
exact:
  u: ["(x^2-y^2)/60 + 0.05 + y*(0.2 + 0.4*exp(-8*(x^2/60+0.05)))", "x*y/30"]
  theta: "x/3"
  loads: derived
"""
QUICK = """\
units: none
body: {rectangle: {width: 2, height: 1}}
boundary: {bottom: contact, left: clamped, top: {role: traction, g: [0.02, 0]}, right: free}
material: {E: 1, nu: 0.3}
friction: {law: slip-weakening, tau_s: 0.01, tau_k: 0.005, delta: 0.001}
mesh: {maxh: 0.5, levels: 1}
"""


def test_errors_on_a_falling_film_are_those_of_the_exact_solutions_branch() -> None:
    """It is a saddle of the energy there: L = 0.1238, where 0.106 is the least found."""
    found = converge(read_study_text(FALLING_FILM))
    [point] = found.points
    assert abs(errors(point)["u_energy"].slope - 1.0) < 0.05
    assert errors(point)["u_energy"].verdict == "as_expected"
    assert errors(point)["u_L2"].error[-1] < 0.01
    # at the corner of Γ_C the error is h² (A + B log(1/h)) to four digits on seven levels: rates 1.50, 1.65, 1.74, …
    assert 1.6 < errors(point)["u_T_max"].slope < 1.8
    assert errors(point)["u_T_max"].verdict == errors(point)["xi_max"].verdict == "as_expected"
    assert "|log h|" in errors(point)["xi_max"].reason
    assert abs(series(point, "energy").value[-1] - series(point, "energy").exact) < 1e-5
    [note] = [note for note in found.notes if "lower energy" in note]
    assert note.startswith("At 1 of 1 points a state of lower energy than the exact solution's was found: by 0.017")


def test_a_front_on_the_line_limits_the_orders_of_xi() -> None:
    without, front = (expected_orders(smooth_up_to(None, HeldEnds(), front)) for front in (False, True))
    assert (without["xi_nodes"].order, without["xi_max"].order) == (2.0, 2.0)
    assert (front["xi_L2"].order, front["xi_nodes"].order, front["xi_max"].order) == (1.0, 1.5, 1.0)
    assert "stick meets slip" in front["xi_max"].reason
    singular = expected_orders(smooth_up_to(1.5, HeldEnds(), True))
    assert np.isclose(singular["xi_max"].order, 0.5)  # what the study gives is worse


def test_a_run_stores_the_energy_on_the_exact_solutions_branch(tmp_path: Path) -> None:
    """Together in a block and one by one: the exact solution is a start, and not the least; without one NaN stands."""
    together, singly = (
        tcstudy.run(read_study_text(FALLING_FILM, "study", ["mesh.levels=2", *own]), tmp_path / f"{len(own)}.nc")
        for own in ([], ["solver=[separable-newton, bundle-newton]"])
    )
    for tree in (together, singly):
        energy = tree["start_energy"].isel(level=1)
        assert abs(float(energy.sel(start="exact")) - 0.1238) < 2e-4
        assert float(energy.min()) == float(tree["energy"].isel(level=1)) < 0.108
    assert np.allclose(
        together["start_energy"].sel(start="exact"), singly["start_energy"].sel(start="exact"), rtol=1e-12
    )
    without = read_study_text(QUICK)
    assert np.isnan(tcstudy.run(without, tmp_path / "none.nc")["start_energy"].sel(start="exact")).all()
