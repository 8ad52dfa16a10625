"""`exact.loads: derived`: what the scenes get, and every study that it cannot be right for, with
its place."""

from contextlib import nullcontext
from typing import Any

import numpy as np
import pytest

from tcstudy.errors import StudyError
from tcstudy.exact.solution import body_edges, edge_samples, normal_field
from tcstudy.expressions.expression import Expression, parse, scalar, value_and_gradient, value_of
from tcstudy.read.study import read_study_text
from tcstudy.scene.records import Body, Scene
from tcstudy.shapes.edges import polygon_loop
from tests.benchmarks.mutated import DERIVED

TEXT = DERIVED.replace("output: {live: true, fields: true}\n", "")
U = '"y + (1 - 0.6*y)*(0.3 + 0.2*sin(pi*x))", "0.1*y*cos(pi*x)"'
THETA = '"1 + x*(1 + 0.5*cos(pi*y))"'
X, Y = np.array([0.2, 0.7]), np.array([0.35, 0.6])


def boundary_of(*changes: tuple[str, str]) -> tuple[Scene, dict[str, Any]]:
    """Scene and roles of the study with parts of its text replaced."""
    text = TEXT
    for old, new in changes:
        assert old in text
        text = text.replace(old, new)
    scene = read_study_text(text).scenes[0]
    return scene, dict(scene.boundary)


def at(scalar: float | Expression, x: object, y: object) -> np.ndarray:
    if isinstance(scalar, Expression):
        return scalar.evaluate(x, y)
    return np.broadcast_to(float(scalar), np.broadcast_shapes(np.shape(x), np.shape(y)))


def test_what_vanishes_is_the_number_zero() -> None:
    """Uniform shear, and what is uniform though it does not look so; the slip is beyond δ."""
    scene, roles = boundary_of(
        (U, '"0.3 + 0.22*y + sin(x)^2 + cos(x)^2", 0'),
        (THETA, "1"),
        ("beta: 0.5", "beta: 0"),
        ("tau_k: 0.4", "tau_k: 0.22"),
    )
    assert scene.f == (0.0, 0.0)
    assert (scene.heat.q, scene.heat.theta_bar) == (0.0, 1.0)
    assert roles["right"].g[0] == 0.0
    np.testing.assert_allclose(at(roles["right"].g[1], 1.0, Y), 0.22, rtol=1e-13)
    known, _ = boundary_of(
        ("convection", "traction"), ("heat: {alpha: 3}\n", "")
    )  # nothing convects: θ is known
    assert str(known.heat.theta) == "1 + x*(1 + 0.5*cos(pi*y))"


def test_components_and_the_word_derived() -> None:
    """Uniform shear: frames of edges, and the word where a number would stand."""
    _, roles = boundary_of(
        (U, '"0.4 + 0.76*y", 0'),
        (f"  theta: {THETA}\n", ""),
        ("beta: 0.5", "beta: 0"),
        ("heat: {alpha: 3}\n", ""),
        ("right: convection", "right: {role: traction, g: derived}"),
        ("top: clamped", "top: {role: clamped, u_N: derived, u_T: derived}"),
        ("left: convection", "left: {role: clamped, u: derived}"),
    )
    left, right, top = roles["left"], roles["right"], roles["top"]
    assert (left.frame, top.frame) == ("xy", "nt")
    np.testing.assert_allclose(at(left.u[0], 0.0, Y), 0.4 + 0.76 * Y, rtol=1e-14)
    assert left.u[1] == 0.0
    assert top.u[0] == 0.0
    np.testing.assert_allclose(at(top.u[1], X, 1.0), -1.16, rtol=1e-14)  # n = (0, 1), t = (−1, 0)
    np.testing.assert_allclose([at(g, 1.0, Y) for g in right.g], [0 * Y, 0.76 + 0 * Y], rtol=1e-13)


FAULTS = [
    ("loads: derived", "loads: derivd", "11:10: exact.loads", "must be one of given, derived"),
    ("heat: {alpha: 3}", "heat: {alpha: 3}\nloads: {f: [0, 1]}", "6:9: loads.f", "is given, but"),
    ("heat: {alpha: 3}", "heat: {alpha: 3, theta_bar: 1}", "5:18: heat.theta_bar", "is given, but"),
    (
        "top: clamped",
        "top: {role: clamped, u: [0, free]}",
        "3:73: boundary.top.u[0]",
        "is given, but",
    ),
    (
        "right: convection",
        "right: {role: convection, g: [1, 2]}",
        "3:55: boundary.right.g",
        "is given, but",
    ),
    ("mesh:", "sweep: {theta_bar: [1, 2]}\nmesh:", "7:9: sweep.theta_bar", "is swept, but"),
    (
        "mesh:",
        "path: {parameter: load, from: 0, to: 1}\nmesh:",
        "7:1: path",
        "a path changes a load",
    ),
    ("left: convection", "left: free", "9:6: exact.u", "component of sigma n is"),
    (
        "left: convection",
        "left: traction",
        "10:10: exact.theta",
        "on the edge left, which is insulated",
    ),
    (
        "top: clamped",
        "top: {role: clamped, u_x: derived}",
        "9:6: exact.u",
        "u_y is free on top, but the traction",
    ),
    (
        "0.1*y*cos(pi*x)",
        "0.1*(y+0.001)*cos(pi*x)",
        "9:6: exact.u",
        "u_N is -0.0001 on the contact edge bottom",
    ),
    ("tau_s: 1,", "tau_s: 1.01,", "9:6: exact.u", "the friction law does not hold on bottom"),
    (
        "loads: derived",
        "loads: derived\n  xi: 1",
        "12:7: exact.xi",
        "xi differs from -S_T of u by 0.",
    ),
    (
        "0.1*y*cos(pi*x)",
        "0.1*y*cos(pi*x) + 0.1*max(0, y-0.5)",
        "9:48: exact.u[1]",
        "its gradient jumps by 0.1",
    ),
    (
        '"1 + x*(1 + 0.5*cos(pi*y))"',
        '"1 + x*(1 + 0.5*cos(pi*y)) + abs(x-0.3)"',
        "10:10: exact.theta",
        "jumps by 2",
    ),
    (
        "0.1*y*cos(pi*x)",
        "0.1*y*cos(pi*x) + sqrt(max(0, y-0.5)^3)",
        "9:6: exact.u",
        "f, derived from it, has no finite",
    ),
    ('  theta: "1 + x*(1 + 0.5*cos(pi*y))"\n', "", "9:3: exact", "theta is missing"),
    (
        "{rectangle: {width: 1, height: 1}}",
        "{file: {path: a.brep, other: top}}",
        "11:10: exact.loads",
        "from a file",
    ),
]


@pytest.mark.parametrize(("old", "new", "where", "what"), FAULTS)
def test_faults(old: str, new: str, where: str, what: str) -> None:
    assert old in TEXT
    with pytest.raises(StudyError) as caught:
        read_study_text(TEXT.replace(old, new), "a.yaml")
    told = [str(problem) for problem in caught.value.problems]
    if "file" not in new:
        assert len(told) == 1, told
    assert any(f"a.yaml:{where}: " in line and what in line and "; " in line for line in told), told


HOLES = """
units: none
body:
  outline:
    - {from: [0, 0], edge: base}
    - {from: [3, 0], edge: right}
    - {from: [3, 1], edge: dome, through: [1.5, 2]}
    - {from: [0, 1], edge: left}
  holes:
    - {circle: {center: [1, 0.9], radius: 0.3, edge: bore}}
    - {rectangle: {corner: [2, 0.5], width: 0.4, height: 0.3, edge: slot}}
boundary: {base: contact, right: traction, dome: traction, left: clamped, bore: traction, slot: traction}
material: {lambda: 1.5, mu: 1}
friction: {law: linear, k: 0.5}
mesh: {maxh: 0.5}
exact: {u: ["(1 + x^2)*(1 + 0.5*y)", "y^2*sin(x) - x*y^2/3 - x*y^4"], loads: derived}
"""


def test_tractions_around_holes_on_arcs_and_on_four_sides_of_one_name() -> None:
    """Against σn from gradients in numbers and the geometry's own normals; u_x,y = k u_x on the
    base."""
    scene = read_study_text(HOLES).scenes[0]
    for name in ("dome", "bore", "slot"):
        role: Any = dict(scene.boundary)[name]
        for edge, hole in body_edges(scene.body, (name,)):
            points, n = edge_samples(edge, hole)
            (u_xx, u_xy), (u_yx, u_yy) = (
                value_and_gradient(parse(u), *points.T)[1] for u in HOLES.split('"')[1:4:2]
            )
            s_xx, s_yy, s_xy = 3.5 * u_xx + 1.5 * u_yy, 1.5 * u_xx + 3.5 * u_yy, u_xy + u_yx
            expected = [s_xx * n[:, 0] + s_xy * n[:, 1], s_xy * n[:, 0] + s_yy * n[:, 1]]
            found = [at(component, *points.T) for component in role.g]
            np.testing.assert_allclose(
                found, expected, rtol=1e-12, atol=1e-12 * np.max(np.abs(expected))
            )


def test_one_field_is_the_normal_on_all_curves_and_an_edge_ends_where_its_line_goes_on() -> None:
    """The lines of the re-entrant corner's edges meet base and wall, one before its start, one
    behind its end."""
    corners = [(0.0, 0.0), (2.0, 0.0), (2.0, 1.0), (1.0, 1.0), (1.0, 2.0), (0.0, 2.0)]
    body = Body(polygon_loop(corners, ["base", *4 * ["rest"], "wall"]))
    curved = read_study_text(HOLES).scenes[0].body
    samples = [(curved, *edge_samples(*edge)) for edge in body_edges(curved, None)]
    samples += [
        (body, np.array([at]), np.array([n]))
        for at, n in (((1.0, 0.0), (0.0, -1.0)), ((0.0, 1.0), (-1.0, 0.0)))
    ]
    for own, points, normals in samples:
        field = normal_field(own, body_edges(own, None))
        found = np.column_stack([value_of(scalar(part), *points.T) for part in field])
        np.testing.assert_allclose(found, normals, rtol=0, atol=1e-13)


@pytest.mark.parametrize(
    ("u_y", "accepted"), [("x*(x^2+y^2-1)^2 + x", True), ("x*(x^2+y^2-1)^2 + 1.00001*x", False)]
)
def test_a_film_without_friction_on_an_arc(u_y: str, accepted: bool) -> None:
    """u = ((r² − 1)² + 1) r e_φ has no shear at r = 1, but for the rounding of points; there b sets
    no scale."""
    text = """\
units: none
body:
  outline:
    - {from: [1, 0], edge: foot}
    - {from: [2, 0], edge: outer, through: [1.4142135623730951, 1.4142135623730951]}
    - {from: [0, 2], edge: side}
    - {from: [0, 1], edge: inner, through: [0.7071067811865476, 0.7071067811865476]}
boundary: {foot: clamped, outer: traction, side: clamped, inner: contact}
material: {lambda: 1.5, mu: 1}
friction: {law: tresca, tau: 0}
mesh: {maxh: 0.5}
exact: {u: ["-y*(x^2+y^2-1)^2 - y", "U_Y"], loads: derived}
""".replace("U_Y", u_y)
    with nullcontext() if accepted else pytest.raises(StudyError, match=r"exact\.u: "):
        assert read_study_text(text).exact is not None
