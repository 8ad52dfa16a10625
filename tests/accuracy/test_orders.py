"""Expected orders from what is singular where, and settings that are the same."""

from math import pi

import numpy as np
import pytest

from tcstudy.accuracy.corners import SMOOTH, Vertex
from tcstudy.accuracy.orders import (
    ROUNDING,
    TIED,
    Singularity,
    dominated,
    equal_settings,
    expected_orders,
    fit,
    log_share,
    smooth_up_to,
    smoothness,
)

H = 0.5 ** np.arange(5)
ALL = np.ones(5, dtype=bool)


def corner(
    exponent: float, *words: str, heat: float = SMOOTH, steps: bool = False, x: float = 0.0
) -> Vertex:
    return Vertex((x, 0.0), pi, words, exponent, heat, steps)


def orders(*corners: Vertex, grading: tuple[float, ...] = (), loads: bool = False) -> dict:
    return expected_orders(smoothness(corners, False, grading, loads))


def test_levels_without_a_rate() -> None:
    none = fit(H, H**2, ~ALL)
    assert (none.first_level, none.settled, none.exact) == (-1, False, False)
    assert np.isnan([none.slope, none.slope_error, *none.rate]).all()
    usable = np.array([False, True, True, True, True])
    at_rounding = fit(H, np.full(5, ROUNDING), usable)
    assert (at_rounding.first_level, at_rounding.settled, at_rounding.exact) == (1, True, True)
    assert np.isnan(at_rounding.slope)
    two = fit(H[:2], H[:2] ** 2, ALL[:2])
    assert (two.first_level, two.settled, two.slope) == (0, False, pytest.approx(2.0))
    assert np.isnan(two.slope_error)
    one = fit(H[:1], H[:1], ALL[:1])
    assert (one.first_level, one.settled, one.exact) == (0, False, False)
    ended = fit(H, np.array([1.0, 0.25, ROUNDING, ROUNDING, np.nan]), ALL)
    assert ended.rate[1] == pytest.approx(2.0)
    assert np.isnan(ended.rate[[0, 2, 3, 4]]).all()


def test_a_level_left_out_lengthens_the_step() -> None:
    found = fit(H, H**1.5, np.array([True, False, True, True, True]))
    assert np.isnan(found.rate[:2]).all()
    assert found.rate[2:] == pytest.approx([1.5] * 3)
    assert (found.first_level, found.settled) == (0, True)


def test_the_share_of_a_logarithm() -> None:
    assert log_share(H[:1]) == 0.0
    h = np.array([0.5, 0.25])
    share = np.log((1 + np.log(4)) / (1 + np.log(2))) / np.log(2)
    assert log_share(h) == pytest.approx(share, rel=1e-12)


def test_equal_settings_have_one_mesh_and_one_error() -> None:
    sizes = np.array([[8, 1], [8, 2], [8, 1], [9, 1], [8, 1], [8, 1]], dtype=float)
    error = np.array([0.5, 0.5, 0.5 * (1 + TIED / 2), 0.5, 0.4, 0.5 * (1 - TIED / 2)])
    assert equal_settings(sizes, error).tolist() == [0, 1, 0, 3, 4, 0]


def test_a_difference_of_rounding_dominates_nothing() -> None:
    cost = np.array([1.0, 1.0, 2.0, np.nan, 2.0])
    error = np.array([0.5, 0.5 * (1 + TIED / 2), 0.5, 0.1, 0.1])
    assert dominated(cost, error).tolist() == [False, False, True, True, False]


def test_a_graded_mesh_divides_by_mu() -> None:
    uniform = Singularity(0.5, "corner").order(2.0, 0.5)
    assert (uniform.exponent, uniform.why) == (1.5, "corner")
    graded = Singularity(0.5, "corner", 0.8).order(2.0, 0.5)
    assert graded.exponent == pytest.approx(1.5 / 0.8)
    assert graded.why == "corner, graded with mu = 0.8"
    assert Singularity(SMOOTH, "corner", 0.5).order(2.0).exponent == SMOOTH
    sharp, blunt = corner(0.5, "free"), corner(0.6, "free", x=1.0)
    found = orders(sharp, blunt, grading=(0.5, 1.0))
    assert [found[n].order for n in ("u_H1", "u_L2")] == [0.6, 1.2]
    assert "at (1, 0)" in found["u_H1"].reason
    full = orders(sharp, grading=(0.5,))["u_H1"]
    assert full.order == 1.0
    assert full.reason.startswith("smooth enough for the full order (free corner of 180° at (0, 0)")
    assert full.reason.endswith("graded with mu = 0.5)")
    assert orders(corner(1.5, "free"))["u_H1"].reason == "smooth enough for the full order"


def test_orders_on_the_contact_line() -> None:
    """Of a corner away from it, one that sticks, one that slips, and a front."""
    names = ("u_T_L2", "u_T_max", "xi_L2", "xi_nodes", "xi_max")

    def on_contact(found: dict) -> list[float]:
        return [found[name].order for name in names]

    assert on_contact(orders(corner(0.625, "free"))) == [1.25, 1.25, 1.0, 1.25, 1.25]
    sticking = orders(corner(0.75, "sticking contact", "free"))
    assert on_contact(sticking) == [1.25, 0.75, 0.25, 0.25, -0.25]
    assert on_contact(orders(corner(SMOOTH, "sticking contact"))) == [2.0, 2.0, 1.0, 2.0, 2.0]
    slipping = orders(corner(SMOOTH, "slipping contact", steps=True))
    assert on_contact(slipping) == [1.5, 1.0, 1.0, 1.5, 1.0]
    assert "shear stress may jump" in slipping["xi_max"].reason
    sharp = orders(corner(0.75, "slipping contact", steps=True))
    assert on_contact(sharp) == [1.25, 0.75, 1.0, 1.25, 0.75]
    assert "u ~ r^0.750" in sharp["xi_max"].reason
    front = expected_orders(smoothness((), stick_slip=True))
    assert on_contact(front) == [2.0, 1.5, 1.0, 1.0, 0.5]
    assert on_contact(orders(corner(np.nan, "free"))) == [2.0, 2.0, 1.0, 2.0, 2.0]
    given_front = expected_orders(smooth_up_to(None, front=True))
    assert on_contact(given_front) == [2.0, 2.0, 1.0, 1.5, 1.0]


def test_a_temperature_lowers_orders_where_it_loads() -> None:
    warm = corner(SMOOTH, "free", heat=0.375)
    names = ("theta_H1", "theta_L2", "u_H1", "u_L2", "u_T_max", "xi_L2")
    loaded = orders(warm, loads=True)
    assert [loaded[n].order for n in names] == [0.375, 0.75, 0.75, 0.75, 0.75, 0.75]
    beside = orders(warm)
    assert [beside[n].order for n in names] == [0.375, 0.75, 1.0, 2.0, 2.0, 1.0]
    assert smoothness([warm], False, loads=True)["body"][0].exponent == 1.375
    regular = orders(corner(SMOOTH, "free", heat=1.0), loads=True)
    assert {regular[n].reason for n in ("theta_H1", "u_L2")} == {"smooth"}
    assert all(expected.analysed for expected in regular.values())
    assert [name for name, expected in regular.items() if expected.log] == ["u_T_max", "xi_max"]


def test_a_given_exponent_limits_slip_and_friction() -> None:
    """u ~ r^1.5 and ξ ~ r^0.5 at a point of the line, where P1 is of order 1 for u in energy."""
    expected = expected_orders(smooth_up_to(1.5))
    limited = {"u_energy": 1.0, "u_T_max": 1.5, "xi_L2": 1.0, "xi_nodes": 1.0, "xi_max": 0.5}
    assert {name: expected[name].order for name in limited} == limited
    smooth = {"theta_L2": 2.0, "theta_H1": 1.0, "u_L2": 2.0, "xi_L2": 1.0, "xi_max": 2.0}
    of_smooth = expected_orders(smooth_up_to(None))
    assert {name: of_smooth[name].order for name in smooth} == smooth
