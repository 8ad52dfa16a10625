"""Limits h → 0: the order of exact sequences, and uncertainties that hold the limit of real ones."""

import numpy as np
import pytest

from tcstudy.accuracy.limits import FACTORS, StickSlip, limit_of

H = 0.5 ** np.arange(6)


@pytest.mark.parametrize("h", [H, np.array([1.0, 0.6, 0.25, 0.1])], ids=["halved", "uneven"])
def test_a_power_of_h_is_extrapolated_exactly(h: np.ndarray) -> None:
    found = limit_of("energy", h, 2.0 + 0.3 * h**1.4)
    assert found.value == pytest.approx(2.0, rel=1e-10)
    assert found.order == pytest.approx(1.4, rel=1e-9)


REAL = {
    # rectangle on a spring: turns back from the second level on, and again on the fifth
    "friction_resultant, turns back": (
        "friction_resultant",
        [-0.03607206, -0.04168552, -0.03877589, -0.03733343, -0.03805077, -0.03840986],
        0.0,
        -0.0382,
    ),
    "friction_resultant, seems settled": (
        "friction_resultant",
        [-1275.613627, -1634.788947, -1690.296223, -1696.245978],
        24.994,
        -1666.56,
    ),
    "friction_resultant, first order": (
        "friction_resultant",
        [-489.816878, -495.170366, -497.592612, -498.679050],
        1.107,
        -499.4381,
    ),
    "slip_length, steady": ("slip_length", [6.10475, 6.10475, 6.10475, 6.10475], 0.3906, 6.02073),
    "slip_length, halves": ("slip_length", [0.59592, 0.69524, 0.7449, 0.76973], 0.04966, 0.750106),
    "u_T_max, starts late": (
        "u_T_max",
        [0.08414137, 0.09473889, 0.09333319, 0.08789997],
        0.0,
        0.07722798,
    ),
    "u_T_max, swings": (
        "u_T_max",
        [1.852773515e-3, 1.851608941e-3, 1.840452961e-3, 1.845807687e-3],
        0.0,
        1.854306066e-3,
    ),
}
"""Result, its values on meshes of halved size, what their finest cannot resolve, and the limit that
three levels more lead to. Plain extrapolation from these levels misses every one of them."""


@pytest.mark.parametrize("case", REAL)
def test_the_uncertainty_holds_the_limit_of_real_scenes(case: str) -> None:
    name, values, unresolved, truth = REAL[case]
    for count in range(4, len(values) + 1):
        found = limit_of(name, H[:count], np.array(values[:count]), unresolved)
        assert abs(found.value - truth) <= found.uncertainty < abs(truth)


@pytest.mark.parametrize("name", FACTORS)
def test_two_levels_have_no_limit_and_a_failed_one_does_not_count(name: str) -> None:
    values = 1.0 + 0.5 * H
    assert np.isnan(limit_of(name, H[:2], values[:2]).value)
    gap = values.copy()
    gap[[1, 5]] = np.nan
    assert np.isnan(limit_of(name, H[:3], gap[:3]).uncertainty)
    kept = [0, 2, 3, 4]
    assert limit_of(name, H, gap) == limit_of(name, H[kept], values[kept])


def state(v: list[float], sticks: list[bool], can_stick: bool = True) -> StickSlip:
    """A line of cells 0.1, with traction 2 where nodes slip and 1 where they stick."""
    xi = np.where(sticks, 1.0, 2.0 * np.sign(v))
    places = np.arange(len(v))
    neighbours = np.stack([places[:-1], places[1:]], axis=1)
    return StickSlip(np.full(len(v), 0.1), np.array(v), xi, np.array(sticks), neighbours, can_stick)


def test_cells_limit_what_a_mesh_resolves() -> None:
    mixed = state([0.0, 0.0, 1.0, 1.0, -1.0], [True, True, False, False, False])
    assert mixed.order == "0+-"
    assert mixed.unresolved("slip_length") == pytest.approx(0.2)
    assert mixed.unresolved("friction_resultant") == pytest.approx(0.25 * (1.0 + 4.0) * 0.1)
    sliding = state([1.0, 2.0, 1e-12], [False] * 3)
    assert sliding.order == "+0"  # a slip that is rounding has no sign
    sliding = state([1.0, 2.0, 1.0], [False] * 3)
    assert sliding.unresolved("slip_length") == pytest.approx(0.1)
    assert sliding.unresolved("friction_resultant") == pytest.approx(0.25 * 0.5 * 2.0 * 0.1)
    assert state([1.0, 2.0], [False] * 2, False).unresolved("friction_resultant") == 0.0
    assert mixed.unresolved("energy") == mixed.unresolved("u_T_max") == 0.0


def test_cells_do_not_blur_a_resultant_that_equilibrium_fixes() -> None:
    """A slip length keeps its cell, whatever its values do."""
    values = 3.0 + 1e-9 * H
    assert limit_of("friction_resultant", H, values, 0.5).uncertainty < 1e-8
    assert limit_of("slip_length", H, np.full(6, 3.0), 0.5).uncertainty == 0.5
    assert limit_of("slip_length", H, values, 0.5).uncertainty == 0.5
