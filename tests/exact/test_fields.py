"""Normals as expressions: of one curve, of several, of holes."""

from __future__ import annotations

import numpy as np
import pytest

from tcstudy.exact.fields import body_edges, edge_samples, normal_field
from tcstudy.expressions.algebra import scalar
from tcstudy.expressions.expression import value_of
from tcstudy.read.study import read_study_text
from tcstudy.scene.records import Body

TEXT = """
units: none
body:
  outline:
    - {from: [0, 0], edge: base}
    - {from: [3, 0], edge: right}
    - {from: [3, 1], edge: dome, through: [1.5, 2]}
    - {from: [0, 1], edge: left}
  holes: [{circle: {center: [1.5, 0.9], radius: 0.3, edge: bore}}]
boundary: {base: contact, right: free, dome: free, left: clamped, bore: free}
material: {E: 1, nu: 0.3}
friction: {law: tresca, tau: 1}
mesh: {maxh: 0.5}
"""


def body() -> Body:
    return read_study_text(TEXT).scenes[0].body


def normals(own: Body, names: tuple[str, ...] | None, points: np.ndarray) -> np.ndarray:
    """(n, 2) the field of some edges at points."""
    field = normal_field(own, body_edges(own, names))
    return np.column_stack([value_of(scalar(component), *points.T) for component in field])


@pytest.mark.parametrize(
    "names", [("base",), ("dome",), ("bore",), ("right", "left"), ("base", "right", "dome", "left", "bore")]
)
def test_the_field_is_the_normal_on_every_curve(names: tuple[str, ...]) -> None:
    for edge, hole in body_edges(body(), names):
        points, expected = edge_samples(edge, hole)
        np.testing.assert_allclose(normals(body(), names, points), expected, rtol=0, atol=1e-13)


L_SHAPE = (
    TEXT[: TEXT.index("body")]
    + """
body:
  outline:
    - {from: [0, 0], edge: base}
    - {from: [2, 0], edge: rest}
    - {from: [2, 1], edge: rest}
    - {from: [1, 1], edge: rest}
    - {from: [1, 2], edge: rest}
    - {from: [0, 2], edge: wall}
boundary: {base: contact, rest: free, wall: clamped}
"""
    + TEXT[TEXT.index("material") :]
)


@pytest.mark.parametrize(("point", "normal"), [((1.0, 0.0), (0.0, -1.0)), ((0.0, 1.0), (-1.0, 0.0))])
def test_an_edge_ends_where_its_line_goes_on(point: tuple[float, float], normal: tuple[float, float]) -> None:
    """The lines of the re-entrant corner's edges meet base and wall, one before its start, one behind its end."""
    own = read_study_text(L_SHAPE).scenes[0].body
    np.testing.assert_allclose(normals(own, None, np.array([point]))[0], normal, atol=1e-13)
