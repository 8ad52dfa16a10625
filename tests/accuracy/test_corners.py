"""Corner exponents against published values and characteristic equations, and the orders they let
expect."""

from dataclasses import replace
from math import atan, pi, radians, sin

import numpy as np
import pytest
from scipy.optimize import brentq

from tcstudy.accuracy.corners import (
    CLAMPED,
    FREE,
    SLIDING,
    SMOOTH,
    corner_exponent,
    corner_words,
    heat_exponent,
    vertices,
)
from tcstudy.accuracy.orders import expected_orders, fit, smooth_up_to, smoothness
from tcstudy.fem.geometry import build
from tcstudy.read.study import read_study_text
from tcstudy.study.convergence import verdict

KAPPA = 3 - 4 * 0.3


@pytest.mark.parametrize(
    ("angle", "first", "second", "exponent"),
    [
        (
            90,
            CLAMPED,
            FREE,
            0.7112,
        ),  # plane strain, nu = 0.3: Roessle, J. Elasticity 60 (2000); Williams (1952)
        (270, FREE, FREE, 0.5445),  # the L-shaped domain
        (360, FREE, FREE, 0.5),  # a crack
        (180, CLAMPED, FREE, 0.5),  # 1/2 ± iε
        (180, CLAMPED, SLIDING, 0.5),  # stick–slip before the law bounds it
        (90, SLIDING, SLIDING, SMOOTH),  # by reflection no corner at all
        (180, FREE, FREE, SMOOTH),
        (90, CLAMPED, SLIDING, SMOOTH),  # by reflection a clamped straight edge
        (45, FREE, SLIDING, SMOOTH),  # by reflection a free 90° corner
    ],
)
def test_published_exponents(angle, first, second, exponent):
    assert corner_exponent(((radians(angle), 1.0, KAPPA),), first, second) == pytest.approx(
        exponent, abs=5e-5
    )
    assert corner_exponent(((radians(angle), 1.0, KAPPA),), second, first) == pytest.approx(
        exponent, abs=5e-5
    )


@pytest.mark.parametrize("kappa", [1.2, 2.6])
def test_characteristic_equations(kappa):
    """Clamped: κ sin αω = α|sin ω|;  clamped–free: 4κ sin²αω = (κ+1)² − 4α² sin²ω;  free: sin αω = −α sin ω."""
    w, v, u = 1.5 * pi, 0.4 * pi, 1.25 * pi
    clamped = brentq(lambda a: kappa * sin(a * w) + a * sin(w), 0.4, 0.9)
    mixed = brentq(
        lambda a: 4 * kappa * sin(a * v) ** 2 - (kappa + 1) ** 2 + 4 * a**2 * sin(v) ** 2, 0.3, 1.2
    )
    free = brentq(lambda a: sin(a * u) + a * sin(u), 0.45, 0.9)
    for angle, first, second, root in (
        (w, CLAMPED, CLAMPED, clamped),
        (v, CLAMPED, FREE, mixed),
        (u, FREE, FREE, free),
    ):
        assert corner_exponent(((angle, 1.0, kappa),), first, second) == pytest.approx(
            root, rel=1e-9
        )


def bogy(p, a, b, alpha, beta):
    """Two bonded wedges with free sides: D. B. Bogy, J. Appl. Mech. 38 (1971), in Dundurs'
    parameters of the first."""
    K = lambda x: np.sin(p * x) ** 2 - p**2 * np.sin(x) ** 2  # noqa: E731
    A, B = 4 * K(a) * K(b), 2 * p**2 * (np.sin(a) ** 2 * K(b) + np.sin(b) ** 2 * K(a))
    C = 4 * p**2 * (p**2 - 1) * np.sin(a) ** 2 * np.sin(b) ** 2 + K(a - b)
    D = 2 * p**2 * (np.sin(a) ** 2 * np.sin(p * b) ** 2 - np.sin(b) ** 2 * np.sin(p * a) ** 2)
    return (
        A * beta**2
        + 2 * B * alpha * beta
        + C * alpha**2
        + 2 * D * beta
        + 2 * (K(b) - K(a) - D) * alpha
        + K(a + b)
    )


@pytest.mark.parametrize(("first", "second"), [(90, 180), (45, 135)])
@pytest.mark.parametrize(("mu", "kappa"), [(0.2, 2.2), (50.0, 2.0)])
def test_two_bonded_wedges(first, second, mu, kappa):
    a, b = radians(first), radians(second)
    whole = (KAPPA + 1) * mu + kappa + 1
    dundurs = ((KAPPA + 1) * mu - kappa - 1) / whole, ((KAPPA - 1) * mu - kappa + 1) / whole
    found = corner_exponent(((a, 1.0, KAPPA), (b, mu, kappa)), FREE, FREE)
    p = np.linspace(0.02, 0.999, 2000)
    signs = np.sign(bogy(p, a, b, *dundurs))
    at = np.flatnonzero(signs[1:] != signs[:-1])
    real = (
        brentq(bogy, p[at[0]], p[at[0] + 1], args=(a, b, *dundurs), xtol=1e-14) if len(at) else None
    )
    assert found == pytest.approx(real, rel=1e-9) if real else found > 0.999


def test_heat():
    """π/ω, π/2ω where θ meets the flux; a checkerboard: Kellogg (1975), 161.4476… for 1/10."""
    assert heat_exponent(((1.5 * pi, 3.0),), False, False) == pytest.approx(2 / 3)
    assert heat_exponent(((1.5 * pi, 3.0),), True, False) == pytest.approx(1 / 3)
    assert heat_exponent(((pi, 3.0),), False, True) == pytest.approx(1 / 2)
    assert heat_exponent(((pi / 2, 3.0),), True, True) == SMOOTH
    for ratio, exponent in ((161.4476387975881, 0.1), (4.0, 4 / pi * atan(1 / 2)), (1.0, SMOOTH)):
        board = tuple((pi / 2, k) for k in (ratio, 1.0, ratio, 1.0))
        assert heat_exponent(board) == pytest.approx(exponent, rel=1e-9)
    # an interface that ends at an insulated edge of an L, where it does not lie on a symmetry
    lower = heat_exponent(((pi / 2, 1.0), (pi, 9.0)), False, False)
    assert lower == pytest.approx(
        brentq(lambda g: np.tan(pi * g / 2) + 9 * np.tan(pi * g), 0.55, 0.95), rel=1e-9
    )


BLOCK = """
units: none
body:
  rectangle: {width: 4, height: 3}
  regions: {coat: {rectangle: {corner: [0, 0], width: 4, height: 1}}, stud: {%s}}
boundary: {bottom: contact, left: free, right: free, top: clamped}
material: {E: 1, nu: 0.3, k: 1, alpha_T: 1}
materials: {coat: {E: 5, nu: 0.2, k: 1, alpha_T: 1}, stud: {E: 9, nu: 0.3, k: 1, alpha_T: 1}}
friction: {law: tresca, tau: 1}
mesh: {maxh: 0.5}
"""


def places(text):
    scene = read_study_text(text).scenes[0]
    return {v.at: v for v in vertices(build(scene.body).corners, scene, lambda edge, at: False)}


def test_places_where_materials_meet():
    found = places(BLOCK % "rectangle: {corner: [1, 1], width: 1, height: 1}")
    assert len(found) == 4 + 2 + 4
    end = found[0.0, 1.0]
    assert (
        corner_words(end) == "coat and body meeting in a traction–traction corner of 180° at (0, 1)"
    )
    assert corner_words(found[1.0, 1.0]) == "stud and body and coat meeting at (1, 1)"
    assert (found[2.0, 2.0].words, found[0.0, 0.0].meeting) == ((), ())
    expected = corner_exponent(((pi / 2, 1.0, 1.8), (pi / 2, 5 / 1.2 * 1.3, 2.2)), FREE, FREE)
    assert end.exponent == pytest.approx(expected, rel=1e-9)
    assert (
        len(places(BLOCK % "circle: {center: [2, 2], radius: 0.5}")) == 4 + 2
    )  # a circle has no corner
    for touching in (
        "circle: {center: [2, 1.5], radius: 0.5}",
        "circle: {center: [0.5, 2], radius: 0.5}",
    ):
        cusps = [at for at, v in places(BLOCK % touching).items() if np.isnan(v.exponent)]
        assert len(cusps) == 1  # which is not analysed


L_SHAPE = """
units: none
body:
  outline: [{from: [0, 0], edge: base}, {from: [2, 0], edge: rest}, {from: [2, 1], edge: rest},
            {from: [1, 1], edge: rest}, {from: [1, 2], edge: rest}, {from: [0, 2], edge: wall}]
  holes: [{rectangle: {corner: [0.2, 0.2], width: 0.2, height: 0.2, edge: hole}}]
boundary: {base: contact, rest: convection, wall: {role: clamped, u_x: 0}, hole: free}
material: {E: 1, nu: 0.3, k: 1}
heat: {alpha: 1, theta_bar: 1}
friction: {law: tresca, tau: 1}
mesh: {maxh: 0.5}
"""


def test_orders_of_an_l_shape():
    """θ ~ r^{2/3} errs by h^{4/3}, and r^{1/4} (360°, held beside insulated) by h^{1/2}, and so
    does u then."""
    found = places(L_SHAPE)
    assert len(found) == 10
    for re_entrant in (found[1.0, 1.0], found[0.2, 0.2]):
        assert re_entrant.exponent == pytest.approx(0.5445, abs=1e-4)
    assert found[2.0, 0.0].exponent == found[0.0, 2.0].exponent == 2.0
    assert found[0.0, 0.0].words == ("slipping contact", "roller")
    corners = list(found.values())
    orders = expected_orders(smoothness(corners, stick_slip=False))
    names = ("u_H1", "u_L2", "theta_H1", "theta_L2", "u_T_max")
    assert [orders[n].order for n in names] == pytest.approx(
        [0.5445, 1.089, 2 / 3, 4 / 3, 1.0], abs=2e-4
    )
    assert "270°" in orders["u_H1"].reason
    assert (
        orders["u_energy"].order
        == expected_orders(smoothness(corners, False, loads=True))["u_energy"].order
    )
    weak = [replace(v, heat=0.25) if v.at == (1.0, 1.0) else v for v in corners]
    heated = expected_orders(smoothness(weak, False, loads=True))
    assert [heated[n].order for n in ("theta_H1", "theta_L2", "u_energy", "u_L2", "xi_L2")] == [
        0.25
    ] + 4 * [0.5]
    assert "θ ~ r^0.250" in heated["u_energy"].reason
    assert expected_orders(smoothness(weak, False))["u_energy"].order == orders["u_energy"].order


def test_given_exponents_and_held_ends():
    smooth = expected_orders(smooth_up_to(None))
    assert [smooth[n].order for n in ("u_H1", "u_L2", "u_T_L2", "u_T_max", "xi_L2", "xi_nodes", "xi_max")] == [
        1, 2, 2, 2, 1, 2, 2,
    ]  # fmt: skip
    assert {e.reason for e in smooth.values() if not e.log} == {"smooth"}
    assert {n for n, e in smooth.items() if e.log} == {
        "u_T_max",
        "xi_max",
    }  # h² |log h| and no better
    mixed = expected_orders(smooth_up_to(1.5))
    assert [mixed[n].order for n in ("u_H1", "u_T_L2", "u_T_max", "xi_L2", "xi_nodes", "xi_max")] == [
        1, 2, 1.5, 1, 1, 0.5,
    ]  # fmt: skip
    held = expected_orders(smooth_up_to(None, slip=True, stick=True))
    assert [held[n].order for n in ("u_L2", "u_T_L2", "u_T_max", "xi_L2", "xi_max")] == [
        2,
        1.5,
        1,
        0.5,
        0,
    ]


def test_what_is_not_analysed_is_called_neither_smooth_nor_slow():
    orders = expected_orders(smoothness((), stick_slip=True), analysed=False)
    assert orders["u_energy"].reason == "corners not analysed"
    assert orders["xi_max"].reason.endswith("u ~ r^1.5; corners not analysed")
    assert not orders["u_energy"].analysed
    slow = fit(np.array([4.0, 2.0, 1.0]), np.array([1.0, 0.7, 0.49]), np.ones(3, dtype=bool))
    assert verdict(slow, 1.0, nested=False) == "slower"
    assert verdict(slow, 1.0, nested=False, analysed=False) == "unknown"
