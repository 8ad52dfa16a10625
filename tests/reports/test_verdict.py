"""The sentence on a run, and where the slip jumps."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from tcstudy.reports.verdict import RunSeen, abrupt, mesh_error, verdict
from tests.reports.conftest import Stored


def test_a_file_says_what_slips_and_last_how_many_points_are_solved(stored: Stored) -> None:
    text, _, ok = verdict(stored("failed"))
    assert text.startswith("Largest slip")
    assert text.endswith("5 of 6 solved.")
    assert not ok


def _run(slip: Any) -> RunSeen:
    """A grid of slips over θ̄, and over a number or a text before it."""
    values = np.asarray(slip, dtype=float)
    known: dict[str, Any] = {"theta_bar": (np.arange(values.shape[-1], dtype=float), {"units": "K"})}
    dims = ("theta_bar",)
    if values.ndim > 1:
        known["friction"] = np.array([f"law {i}" for i in range(len(values))], dtype=object), {}
        dims = ("friction", *dims)
    return RunSeen(dims, 1, "grid", known.__getitem__, lambda name, level: values if name == "u_T_max" else None)


@pytest.mark.parametrize(
    ("slip", "said"),
    [
        ([0.0, 1.0, 2.0, 9.0, 10.0, 11.0], ["between θ̄ = 2 and 3 K"]),
        ([0.0, 1.0, 2.0, 3.0, 4.0, 5.0], []),
        ([10.0, 10.1, 10.1, 10.9, 10.9, 11.0], []),
        ([[0.0, 1.0, 2.0, 9.0, 10.0], [0.0, 1.0, 20.0, 21.0, 22.0]], ["between θ̄ = 1 and 2 K (friction: law 1)"]),
        ([[0.0, 1.0, 2.0, 9.0, 10.0], [0.0, 1.0, np.nan, 21.0, 22.0]], ["between θ̄ = 2 and 3 K (friction: law 0)"]),
    ],
)
def test_an_abrupt_change_is_told_from_a_slope(slip: Any, said: list[str]) -> None:
    solved = np.ones(np.shape(slip), dtype=bool)
    places = [one.partition("between")[2] for one in abrupt(_run(slip), solved, ~solved)]
    assert places == [one.removeprefix("between") for one in said]


def test_a_jump_is_said_where_two_solutions_were_seen() -> None:
    """At one end of the step; at the next point it does not count."""
    run, solved = _run([0.0, 1.0, 2.0, 9.0, 10.0, 11.0]), np.ones(6, dtype=bool)
    for several, said in ((3, "slip jumps between"), (4, "slip changes by 7 between")):
        assert abrupt(run, solved, np.arange(6) == several)[0].startswith(said)


@pytest.mark.parametrize(
    ("numbers", "friction", "error", "said"),
    [
        ({"friction_resultant": [90.0, 100.0]}, 100.0, 0.1, "change of ∫ξ"),
        ({"friction_resultant": [-3.0e-12, 1.0e-12]}, 50.0, 8e-14, "change of ∫ξ"),  # by symmetry: nothing of nothing
        ({"friction_resultant": [0.0, 0.0]}, 0.0, None, "no friction"),
        (
            {"error_estimate": [0.3, 0.26], "goal": [90.0, 100.0], "goal_estimate": [9.0, 0.5]},
            0.0,
            0.005,
            "of the goal",
        ),
    ],
)
def test_a_mesh_error_is_relative_to_what_there_is(
    numbers: dict[str, list[float]], friction: float, error: float | None, said: str
) -> None:
    """Two levels of one point."""
    held = {name: np.array(values) for name, values in numbers.items()} | {"status": np.ones(2)}
    run = RunSeen(
        *((), 2, "grid", lambda name: (np.zeros(0), {})),
        lambda name, level: held[name][level] if name in held else None,
        lambda place: friction,
    )
    found, no_larger, _, how = mesh_error(run, run.ok())
    assert found == (pytest.approx(error) if error is not None else None)
    assert no_larger == 0
    assert said in how


def test_a_goal_within_its_error_is_not_divided_by() -> None:
    held = {"status": np.ones((2, 3)), "goal": np.array([1.0, 1e-9, 0.0]), "goal_estimate": np.array([0.1, 0.1, 0.0])}
    take = lambda name, level: None if name not in held else held[name] if name != "status" else held[name][level]  # noqa: E731
    run = RunSeen(("at",), 2, "list", lambda name: (np.zeros(0), {}), take)
    assert mesh_error(run, run.ok())[:3] == (pytest.approx(0.1), 1, True)
