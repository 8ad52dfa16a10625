"""Loads as sums of basis loads: equal shapes are one load, numbers are coefficients, the sum is the load itself."""

from __future__ import annotations

import pytest

from tcstudy.expressions.expression import parse
from tcstudy.offline.loads import BodyForce, EdgePressure, EdgeTraction, LoadTerm, mechanical_terms
from tcstudy.scene.records import Clamped, Contact, Convection, Traction


def test_numbers_are_coefficients_of_the_unit_shape() -> None:
    boundary = (("top", Traction(g=(0.0, -2.0), pressure=3.0)), ("left", Convection(g=(5.0, 0.0))))
    assert list(mechanical_terms((0.0, 7.0), boundary)) == [
        LoadTerm(BodyForce(1, 1.0), 7.0),
        LoadTerm(EdgeTraction("top", 1, 1.0), -2.0),
        LoadTerm(EdgePressure("top", 1.0), 3.0),
        LoadTerm(EdgeTraction("left", 0, 1.0), 5.0),
    ]


def test_equal_expressions_are_one_load_and_other_places_are_others() -> None:
    same, other = BodyForce(0, parse("x*y")), BodyForce(0, parse("x + y"))
    assert BodyForce(0, parse("x*y")) == same
    assert len({same, other, BodyForce(1, parse("x*y")), BodyForce(0, parse("x*y"))}) == 3
    assert EdgeTraction("top", 0, 1.0) != EdgeTraction("left", 0, 1.0)
    assert EdgePressure("top", 1.0) != EdgeTraction("top", 0, 1.0)


def test_what_holds_or_weighs_nothing_makes_no_load() -> None:
    assert list(mechanical_terms((0.0, 0.0), (("base", Contact()), ("top", Clamped()), ("left", Traction())))) == []


@pytest.mark.parametrize("axis", [0, 1])
def test_a_basis_load_says_what_makes_it(axis: int) -> None:
    other = 1 - axis
    shape = parse("sin(x)")
    assert BodyForce(axis, shape).f[axis] == EdgeTraction("top", axis, shape).role.g[axis] == shape
    assert BodyForce(axis, shape).f[other] == EdgeTraction("top", axis, shape).role.g[other] == 0.0
    assert EdgePressure("top", shape).role == Traction(pressure=shape)
