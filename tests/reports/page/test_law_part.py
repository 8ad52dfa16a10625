"""What a law was made of is told in the page, and every law is drawn."""

import pytest

from tcstudy.reports.page.law_part import drawn, spec
from tcstudy.scene.laws import SHAPES
from tcstudy.scene.nodal_laws import times

LAWS = [
    {"law": "tresca", "tau": 4e7},
    {"law": "slip-weakening", "tau_s": 4e7, "tau_k": 1e7, "delta": 4e-5},
    {"law": "exponential", "a": 4e7, "b": 1e7, "delta": 1.5e-5},
    {"law": "saw-tooth", "tau": 3.0, "delta": 0.1, "teeth": 4, "drop": 0.6, "decay": 0.8},
    {"law": "saw-tooth", "tau": 3.0, "delta": 0.1, "teeth": 1, "drop": 0.6, "decay": 1.0},
    {"law": "linear", "k": 5e9},
]


@pytest.mark.parametrize("wanted", LAWS, ids=lambda one: one["law"])
def test_parameters_of_a_law_are_told(wanted: dict[str, object]) -> None:
    law = SHAPES[str(wanted["law"])].build(**{k: v for k, v in wanted.items() if k != "law"})
    found = spec(law)
    assert found is not None
    assert found["law"] == wanted["law"]
    assert {k: pytest.approx(v, rel=1e-12) for k, v in wanted.items() if k != "law"} == {
        k: v for k, v in found.items() if k != "law"
    }


def test_points_with_a_jump_are_told() -> None:
    points = [[0.0, 4.0], [1.0, 4.0], [1.0, 1.0], [2.0, 3.0]]
    found = spec(SHAPES["piecewise-linear"].build(points=points, slope=0.5))
    assert found == {"law": "piecewise-linear", "points": points, "slope": 0.5}


def test_a_strength_scales_tractions_alone() -> None:
    law = times(SHAPES["slip-weakening"].build(tau_s=4e7, tau_k=1e7, delta=4e-5), 0.5)
    assert spec(law) == {"law": "slip-weakening", "tau_s": 2e7, "tau_k": 5e6, "delta": 4e-5}


def test_a_law_that_is_not_odd_has_no_parameters_but_is_drawn() -> None:
    law = SHAPES["piecewise-linear"].build(points=[[-1.0, -2.0], [1.0, 5.0]], odd=False)
    assert spec(law) is None
    assert len(drawn(law)["curves"]) == len(law.kinks) + 1


@pytest.mark.parametrize(("name", "parameters"), [("tresca", {"tau": 4e7}), ("linear", {"k": 5e9})])
def test_a_law_without_a_length_of_its_own_is_still_drawn(name: str, parameters: dict[str, float]) -> None:
    found = drawn(SHAPES[name].build(**parameters))
    assert found["reach"] == 0.0
    assert all(s[-1] > s[0] for s, _ in found["curves"])
