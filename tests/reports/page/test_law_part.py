"""The pieces of a law, by which the page solves, and its curves."""

import numpy as np
import pytest

from tcstudy.laws.shapes import SHAPES
from tcstudy.reports.page.law_part import drawn
from tests.reports.figures.draw_cases import example_laws


def test_its_pieces_are_the_law() -> None:
    for law in example_laws():
        found = drawn(law)["pieces"]
        s = np.linspace(-3.0, 3.0, 61) * (law.s_scale or 1.0) + 1e-9 * (law.s_scale or 1.0)
        k = np.searchsorted(found["kinks"], s)
        s_0, b_0, q, a, r = (np.array(found[name])[k] for name in ("s0", "b0", "q", "a", "r"))
        np.testing.assert_allclose(b_0 + q * (s - s_0) + a * np.exp(-r * (s - s_0)), law.b(s), rtol=1e-12)


@pytest.mark.parametrize(("name", "parameters"), [("tresca", {"tau": 4e7}), ("linear", {"k": 5e9})])
def test_a_law_without_a_length_of_its_own_is_still_drawn(name: str, parameters: dict[str, float]) -> None:
    found = drawn(SHAPES[name].build(**parameters))
    assert found["reach"] == 0.0
    assert all(s[-1] > s[0] for s, _ in found["curves"])
