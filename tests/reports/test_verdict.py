"""The sentence on a run, and where the slip jumps."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from tcstudy.reports.sentences import HOW, RunSeen, abrupt, mesh_error, verdict
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
    ("numbers", "friction", "error", "how"),
    [
        ({"friction_resultant": [90.0, 100.0]}, 100.0, "∫ξ changed by 10 % with the last level", "change"),
        # by symmetry: nothing of nothing
        ({"friction_resultant": [-3e-12, 1e-12]}, 50.0, "∫ξ changed by 8.0e-14 with the last level", "change"),
        ({"friction_resultant": [0.0, 0.0]}, 0.0, "", "no friction"),
        ({"error_estimate": [0.3, 0.26]}, 0.0, "mesh error about 26 %", "energy"),
        ({"error_estimate": [0.3, 1.2]}, 0.0, "mesh too coarse for the order of magnitude", "energy"),
        ({"error_estimate": [0.3, 0.26], "goal": [9.0, 10.0], "goal_estimate": [0.9, 0.5]}, 0.0, "mesh error about 5 %",
         "goal"),
        ({"goal": [9.0, 1e-9], "goal_estimate": [0.9, 0.1]}, 0.0, "the goal no larger than its mesh error at 1",
         "goal"),
    ],
)  # fmt: skip
def test_a_mesh_error_is_relative_to_what_there_is(
    numbers: dict[str, list[float]], friction: float, error: str, how: str
) -> None:
    """Two levels of one point."""
    held = {name: np.array(values) for name, values in numbers.items()} | {"status": np.ones(2)}
    run = RunSeen(
        *((), 2, "grid", lambda name: (np.zeros(0), {})),
        lambda name, level: held[name][level] if name in held else None,
        lambda place: friction,
    )
    assert mesh_error(run, run.ok()) == (error, HOW[how])
