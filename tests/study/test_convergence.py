"""What is said of orders, levels and references, without a fine mesh."""

import math
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from tcstudy.accuracy.orders import Fit
from tcstudy.errors import ConvergenceError, UsageError
from tcstudy.read.study import read_study, read_study_text
from tcstudy.study import convergence
from tcstudy.study.convergence import converge, converge_to_file, own_error, verdict
from tcstudy.study.stored import check_kind
from tests.commands import CONFIGS
from tests.verification.scenes import RECTANGLE, study_of
from tests.verification.series import errors, notes, points

PULLED = "boundary.top={role: traction, g: [0.02, -0.01]}"
COARSE = "mesh={maxh: 0.8, levels: 4}"


def fitted(slope: float, rates: int = 3, error: float = 0.0, settled: bool = True) -> Fit:
    rate = np.array([np.nan] + [slope] * rates)
    return Fit(rate, slope, error, 0, settled, exact=False)


def test_a_verdict_needs_two_rates_and_allows_a_margin() -> None:
    assert verdict(fitted(1.0, rates=1), 1.0, nested=False) == "too_few_levels"
    assert verdict(fitted(1.0, rates=2), 1.0, nested=False) == "as_expected"
    assert verdict(fitted(1.0, settled=False), 1.0, nested=False) == "pre_asymptotic"
    assert verdict(fitted(1.19), 1.0, nested=False) == "as_expected"
    assert verdict(fitted(1.21), 1.0, nested=False) == "faster"
    assert verdict(fitted(0.81), 1.0, nested=False) == "as_expected"
    assert verdict(fitted(0.79), 1.0, nested=False) == "slower"
    assert verdict(fitted(1.25, error=0.15), 1.0, nested=False) == "as_expected"
    assert verdict(fitted(1.35, error=0.15), 1.0, nested=False) == "faster"
    assert verdict(fitted(0.79), 1.0, nested=False, log=0.02) == "as_expected"
    assert verdict(fitted(1.4), 1.0, nested=True) == "as_expected"
    assert verdict(fitted(1.45), 1.0, nested=True) == "faster"


def test_a_reference_with_an_error_makes_rates_look_larger() -> None:
    """With h² and a reference two refinements finer: log₂((1 − 2⁻⁶)/(1 − 2⁻⁴))."""
    assert own_error(2.0) == pytest.approx(math.log2((1 - 2**-6) / (1 - 2**-4)), rel=1e-14)
    assert own_error(1.0) == pytest.approx(math.log2(7 / 6), rel=1e-14)
    assert own_error(0.0) == own_error(-1.0) == math.inf


def test_one_level_and_adaptive_meshes_have_no_convergence(tmp_path: Path) -> None:
    for change, said in (
        ("mesh.levels=1", "one level has no convergence"),
        ("mesh={maxh: 0.8, max_levels: 3, tolerance: 0.3}", "adaptive meshes have no common h"),
    ):
        study = study_of(RECTANGLE, PULLED, change)
        with pytest.raises(ConvergenceError, match=said):
            converge_to_file(study, tmp_path / "a.nc", lambda text: None)
    assert not list(tmp_path.iterdir())


def test_two_levels_have_values_and_no_errors(tmp_path: Path) -> None:
    study = study_of(RECTANGLE, PULLED, "mesh={maxh: 0.8, levels: 2}")
    converge_to_file(study, tmp_path / "a.nc", lambda text: None)
    assert (tmp_path / "a.nc").exists()
    result = converge(study)
    assert result.attributes["reference"] == "none"
    assert notes(result)[0].startswith("No errors are measured: there are 2 levels, and the")
    [point] = points(result)
    assert errors(point) == {}
    assert np.isfinite(point["value_energy"]).all()
    assert np.isnan(point["exact_energy"])


def test_the_finest_of_four_levels_is_the_reference() -> None:
    result = converge(study_of(RECTANGLE, PULLED, COARSE))
    assert result.attributes["reference"] == (
        "level 3, the finest (levels compared are at least 4 times coarser; level 2 is not used)"
    )
    [point] = points(result)
    error = errors(point)["u_energy"].error
    assert np.isfinite(error).tolist() == [True, True, False, False]
    assert error[1] < error[0] < 1.0
    assert "an order of 0.5 as 0.87, 1 as 1.22, 2 as 2.07 at most." in " ".join(notes(result))
    assert errors(point)["u_energy"].size > 0.0
    # where the clamped side meets the film, u ~ r^0.7 on meshes that are not graded
    assert 0.5 < errors(point)["u_energy"].expected < 0.9


def test_words_of_a_reference_name_the_levels_left_out() -> None:
    compared = np.array([True, True, False, False, False])
    words = convergence._reference_words
    assert words(4, 5, compared).endswith("coarser; levels 2, 3 are not used)")
    assert words(3, 5, compared).startswith("level 3, the finest that is solved (")
    assert words(3, 5, compared).endswith("coarser; level 2 is not used)")
    assert words(2, 3, compared[:3]) == (
        "level 2, the finest (levels compared are at least 4 times coarser)"
    )


def orders(sticks: list[bool], xi: list[float], beside_held: list[bool]) -> dict[str, Any]:
    """The orders to expect of an exact solution that is smooth in the body."""
    solution: Any = SimpleNamespace(ok=True, sticks=np.array(sticks), xi=np.array(xi))
    level: Any = SimpleNamespace(next_to_held=np.array(beside_held))
    study: Any = SimpleNamespace(exact=SimpleNamespace(exponent=None))
    scene: Any = None
    return convergence.orders_to_expect(study, level, solution, scene)


def test_orders_follow_from_stick_and_slip_beside_a_constrained_node() -> None:
    inside = [False, False, False, False]
    first = [True, False, False, False]
    all_stick, all_slip = [True] * 4, [False] * 4
    even = [1.0, 1.0, 1.0, 1.0]
    front = "stick meets slip on Γ_C, where ξ has a kink"
    for one_sticks in ([True, False, False, False], [False, False, False, True]):
        assert orders(one_sticks, even, inside)["xi_max"].reason == front
    for sticks in (all_stick, all_slip):
        assert "stick meets slip" not in orders(sticks, even, inside)["xi_max"].reason
    assert "slipping node" in orders(all_slip, even, first)["xi_max"].reason
    assert "sticking node" in orders(all_stick, even, first)["xi_max"].reason
    assert "node" not in orders(all_stick, even, inside)["xi_max"].reason
    for xi, matters in (([0.11, 1.0, 1.0, 1.0], True), ([0.09, 1.0, 1.0, -1.0], False)):
        for unit in (1.0, 1e-3, 1e3):
            scaled = [unit * value for value in xi]
            assert ("node" in orders(all_stick, scaled, first)["xi_max"].reason) == matters


def test_a_new_order_on_the_finest_level_asks_for_one_more(monkeypatch: pytest.MonkeyPatch) -> None:
    study = read_study_text(RECTANGLE, "test", [COARSE])
    level: Any = SimpleNamespace(solutions={(): None})

    def advice(*by_level: str) -> list[str]:
        states = [SimpleNamespace(order=order) for order in by_level]
        monkeypatch.setattr(convergence, "_contact_states", lambda *_: states)
        return [*convergence._new_order_note(study, [level])]

    assert advice("0", "0", "0-") == [
        "Stick (0) and slip (+, −) first change their order on the finest level (0 → 0−): "
        "give one more level (mesh.levels=5)."
    ]
    assert advice("0", "0-", "0-") == []
    assert advice("0", "0-") == []  # two levels tell nothing


def test_an_error_that_does_not_fall_is_noted() -> None:
    def stuck(*error: float) -> list[str]:
        return [*convergence._stuck_note([{"error_u_energy": np.array(error)}])]

    assert stuck(0.5, 0.4) == stuck(0.5) == stuck(1e-12, 1e-12) == []
    [note] = stuck(0.5, 0.49)
    assert note.startswith("The error of u does not decrease at 1 of 1 points")
    assert [*convergence._stuck_note([{}])] == []


@pytest.mark.parametrize("kind", ["convergence", "cost"])
def test_a_path_is_no_set_of_points_to_compare(kind: str) -> None:
    """Its points lie along the parameter, where `converge` has the loads of the study alone."""
    study = read_study(CONFIGS / "pull_test.yaml")
    with pytest.raises(UsageError, match=r"compares single points, not a path; .*path=null"):
        check_kind(study, kind, "pull_test.yaml")
