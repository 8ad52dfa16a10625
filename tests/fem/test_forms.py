"""Contact nodes in order, corners, closed and several contact parts, held ends; data that count as
nothing."""

import numpy as np
import pytest

from tcstudy.expressions.expression import parse
from tcstudy.fem.forms import ContactLine, constrain, edge_load, source_load
from tcstudy.fem.geometry import GeometryFailed
from tcstudy.scene.records import Clamped, Contact
from tests.verification.scenes import RECTANGLE, levels_of, study_of


def line_of(text: str) -> ContactLine:
    return levels_of(study_of(text, "mesh.levels=1"))[0].line


L_SHAPE = """
units: none
body: {outline: [{from: [0, 0], edge: floor}, {from: [1, 0], edge: wall}, {from: [1, -1], edge: rest},
  {from: [2, -1], edge: rest}, {from: [2, 1], edge: top}, {from: [0, 1], edge: rest}]}
boundary: {floor: contact, wall: contact, rest: free, top: clamped}
material: {E: 1, nu: 0.3}
friction: {law: tresca, tau: 0.01}
mesh: {maxh: 0.2}
"""


def test_a_corner_of_the_contact_line_is_held() -> None:
    """Both normals hold at (1, 0): no unknown there, its half cells go to both neighbours."""
    line = line_of(L_SHAPE)
    assert line.edge_names == ("floor", "wall")
    assert not np.any(np.all(line.xy == [1.0, 0.0], axis=1))
    assert line.c.sum() == pytest.approx(2.0, rel=1e-13)
    assert np.all(np.diff(line.arclength) > 0)
    floor = line.edge == 0
    assert np.allclose(line.xy[floor, 1], 0)
    assert np.allclose(line.xy[~floor, 0], 1)
    assert line.c[floor].sum() == pytest.approx(1.0)


def test_loads_integrate_polynomials_of_degree_4_and_5_times_hats() -> None:
    mesh = levels_of(study_of(L_SHAPE, "mesh.levels=1"))[0].mesh
    x = mesh.points[:, 0]
    assert x @ source_load(mesh, parse("x^4"), ()) == pytest.approx((1 + 2 * 63) / 6, rel=1e-13)
    assert x @ edge_load(mesh, parse("x^5"), ("floor",)) == pytest.approx(1 / 7, rel=1e-13)


def test_two_separate_parts_and_a_closed_hole() -> None:
    hole = "holes: [{circle: {center: [1, 0.5], radius: 0.2, edge: pin}}]"
    line = line_of(
        RECTANGLE.replace("1}}", f"1}}, {hole}}}").replace("top: free", "top: free, pin: contact")
    )
    pin = line.edge == line.edge_names.index("pin")
    radius = np.linalg.norm(line.xy[pin] - [1, 0.5], axis=1)
    assert np.allclose(radius, 0.2, atol=1e-14)
    count = int(pin.sum())
    assert line.c[pin].sum() == pytest.approx(2 * count * 0.2 * np.sin(np.pi / count), rel=1e-2)
    assert np.all(np.diff(line.arclength[pin]) > 0)
    assert line.arclength[pin][0] == pytest.approx(2.0)  # parts are counted on one after the other
    # the body is on the left of the line, so around a hole it runs clockwise
    turn = np.unwrap(np.arctan2(line.xy[pin, 1] - 0.5, line.xy[pin, 0] - 1))
    assert turn[-1] < turn[0]


def test_disagreeing_clamps_are_an_error() -> None:
    """The reader refuses such a study; a body from a file, whose corners it cannot see, is refused
    here."""
    mesh = levels_of(study_of(RECTANGLE, "mesh.levels=1"))[0].mesh
    boundary = (("left", Clamped()), ("top", Clamped((0.1, 0.0))), ("bottom", Contact()))
    with pytest.raises(
        GeometryFailed, match=r"left, top prescribe different displacements.*\(0, 1\)"
    ):
        constrain(mesh, boundary)


def test_a_roller_along_the_contact_keeps_the_corner_node() -> None:
    """u_y = 0 on the side and u_N = 0 below are one condition: the corner slips and is an
    unknown."""
    text = RECTANGLE.replace(
        "left: clamped, top: free", "left: {role: clamped, u_y: 0}, top: clamped"
    )
    assert line_of(text).xy[0].tolist() == [0.0, 0.0]
    fixed = RECTANGLE.replace(
        "left: clamped, top: free", "left: {role: clamped, u_x: 0}, top: clamped"
    )
    assert line_of(fixed).xy[0, 0] > 0


HEATED = RECTANGLE.replace("nu: 0.3}", "nu: 0.3, k: 1, alpha_T: 0.1}").replace(
    "top: free", "top: convection"
)


def test_data_that_vanish_as_a_formula_count_as_nothing() -> None:
    nothing = "0*sin(x*y)"
    load = f"loads={{f: ['{nothing}', '{nothing}']}}"
    heat = f"heat={{alpha: 1, theta_bar: '{nothing}', q: '{nothing}'}}"
    push = f"boundary.right={{role: traction, g: ['{nothing}', 0.01], pressure: '{nothing}'}}"
    held = f"boundary.left={{role: clamped, u: ['{nothing}', 0]}}"
    pull = "boundary.right={role: traction, g: [0, 0.01]}"
    own, wanted = (
        levels_of(study)[0].condensed(study.scenes[0]).problem
        for study in (
            study_of(HEATED, "mesh={maxh: 0.5, levels: 1}", load, heat, push, held),
            study_of(HEATED, "mesh={maxh: 0.5, levels: 1}", "heat={alpha: 1, theta_bar: 0}", pull),
        )
    )
    assert np.array_equal(own.A_tilde, wanted.A_tilde)
    assert own.l_tilde == pytest.approx(
        wanted.l_tilde, abs=1e-15 * float(np.max(np.abs(wanted.l_tilde)))
    )
