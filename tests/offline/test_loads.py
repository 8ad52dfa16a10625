"""Loads as sums of basis loads: equal shapes are one load, numbers are coefficients, the sum is the load itself."""

from __future__ import annotations

from tcstudy.expressions.expression import parse
from tcstudy.offline.loads import BasisLoad, mechanical_terms
from tcstudy.scene.records import Clamped, Contact, Convection, Traction


def test_numbers_are_coefficients_of_the_unit_shape() -> None:
    boundary = (("top", Traction(g=(0.0, -2.0), pressure=3.0)), ("left", Convection(g=(5.0, 0.0))))
    assert list(mechanical_terms((0.0, 7.0), boundary)) == [
        (BasisLoad("body", (0.0, 1.0)), 7.0),
        (BasisLoad("edge", Traction(g=(0.0, 1.0)), ("top",)), -2.0),
        (BasisLoad("edge", Traction(pressure=1.0), ("top",)), 3.0),
        (BasisLoad("edge", Traction(g=(1.0, 0.0)), ("left",)), 5.0),
    ]


def test_equal_expressions_are_one_load_and_other_places_are_others() -> None:
    given = [((parse(text), 0.0), (("top", Traction(pressure=parse(text))),)) for text in ("x*y", "x + y", "x*y")]
    loads = [tuple(load for load, _ in mechanical_terms(*one)) for one in given]
    assert loads[0] == loads[2] != loads[1]
    assert len({load for some in loads for load in some}) == 4


def test_what_holds_or_weighs_nothing_makes_no_load() -> None:
    assert list(mechanical_terms((0.0, 0.0), (("base", Contact()), ("top", Clamped()), ("left", Traction())))) == []
