"""Corners of a body and the orders they let expect."""

from dataclasses import replace

import numpy as np
import pytest

from tcstudy.accuracy.corners import vertices
from tcstudy.accuracy.expected import HeldEnds, expected_orders, smooth_up_to, smoothness
from tcstudy.accuracy.rates import fit
from tcstudy.read.study import read_study_text
from tcstudy.study.convergence import verdict

L_SHAPE = """
units: none
body:
  outline:
    - {from: [0, 0], edge: base}
    - {from: [2, 0], edge: rest}
    - {from: [2, 1], edge: rest}
    - {from: [1, 1], edge: rest}
    - {from: [1, 2], edge: rest}
    - {from: [0, 2], edge: wall}
  holes: [{rectangle: {corner: [0.2, 0.2], width: 0.2, height: 0.2, edge: hole}}]
boundary: {base: contact, rest: convection, wall: {role: clamped, u_x: 0}, hole: free}
material: {E: 1, nu: 0.3, k: 1}
heat: {alpha: 1, theta_bar: 1}
friction: {law: tresca, tau: 1}
mesh: {maxh: 0.5}
"""


def corners(sticks=False, text=L_SHAPE):
    scene = read_study_text(text).scenes[0]
    return vertices(scene, lambda edge, at: sticks)


def test_angles_and_exponents_of_an_l_shape():
    found = {v.at: v for v in corners()}
    assert len(found) == 10
    inner = found[1.0, 1.0]
    assert inner.half_turns == pytest.approx(1.5)
    assert inner.exponent == pytest.approx(0.5445, abs=1e-4)
    assert found[0.2, 0.2].half_turns == pytest.approx(1.5)  # a corner of the hole is re-entrant
    assert found[0.2, 0.2].exponent == pytest.approx(0.5445, abs=1e-4)
    assert found[2.0, 0.0].contact
    assert found[2.0, 0.0].exponent == 2.0
    assert found[0.0, 0.0].words == ("slipping contact", "roller")
    assert found[0.0, 2.0].exponent == 2.0
    orders = expected_orders(smoothness(list(found.values()), stick_slip=False))
    names = ("u_H1", "u_L2", "theta_H1", "theta_L2", "u_T_max")
    assert [orders[n].order for n in names] == pytest.approx([0.5445, 1.089, 2 / 3, 4 / 3, 1.0], abs=2e-4)
    assert "270°" in orders["u_H1"].reason


def test_given_exponents_and_held_ends():
    smooth = expected_orders(smooth_up_to(None, HeldEnds()))
    assert [smooth[n].order for n in ("u_H1", "u_L2", "u_T_L2", "u_T_max", "xi_L2", "xi_nodes", "xi_max")] == [
        1, 2, 2, 2, 1, 2, 2,
    ]  # fmt: skip
    assert {e.reason for e in smooth.values() if not e.log} == {"smooth"}
    assert {n for n, e in smooth.items() if e.log} == {"u_T_max", "xi_max"}  # h² |log h| and no better
    mixed = expected_orders(smooth_up_to(1.5, HeldEnds()))
    assert [mixed[n].order for n in ("u_H1", "u_T_L2", "u_T_max", "xi_L2", "xi_nodes", "xi_max")] == [
        1, 2, 1.5, 1, 1, 0.5,
    ]  # fmt: skip
    held = expected_orders(smooth_up_to(None, HeldEnds(slip=True, stick=True)))
    assert [held[n].order for n in ("u_L2", "u_T_L2", "u_T_max", "xi_L2", "xi_max")] == [2, 1.5, 1, 0.5, 0]


def test_heat_limits_what_it_loads():
    """θ ~ r^{2/3} errs by h^{4/3}, and r^{1/4} (360°, held beside insulated) by h^{1/2}, and so does u then."""
    found = corners()
    apart = expected_orders(smoothness(found, False))
    assert apart["u_energy"].order == expected_orders(smoothness(found, False, loads=True))["u_energy"].order
    weak = [replace(v, heat=0.25) if v.at == (1.0, 1.0) else v for v in found]
    orders = expected_orders(smoothness(weak, False, loads=True))
    assert [orders[n].order for n in ("theta_H1", "theta_L2", "u_energy", "u_L2", "xi_L2")] == [0.25] + 4 * [0.5]
    assert "θ ~ r^0.250" in orders["u_energy"].reason
    assert expected_orders(smoothness(weak, False))["u_energy"].order == apart["u_energy"].order


def test_what_is_not_analysed_is_called_neither_smooth_nor_slow():
    orders = expected_orders(smoothness(None, stick_slip=True))
    assert orders["u_energy"].reason == "corners not analysed"
    assert orders["xi_max"].reason.endswith("u ~ r^1.5; corners not analysed")
    assert not orders["u_energy"].analysed
    assert {e.reason for n, e in expected_orders(smoothness([], False)).items() if not e.log} == {"smooth"}
    slow = fit(np.array([4.0, 2.0, 1.0]), np.array([1.0, 0.7, 0.49]), np.ones(3, dtype=bool))
    assert verdict(slow, 1.0, nested=False) == "slower"
    assert verdict(slow, 1.0, nested=False, analysed=False) == "unknown"
