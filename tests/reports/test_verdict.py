"""The sentence on a run, and where the slip jumps."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tcstudy.reports.verdict import RunSeen, jumps, mesh_error, verdict


def test_a_file_says_how_many_points_are_solved(grid: Path) -> None:
    said = verdict(grid)
    assert said["text"].startswith("3 of 4 solved")
    assert not said["ok"]


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
def test_a_jump_is_told_from_a_slope(slip: Any, said: list[str]) -> None:
    run = _run(slip)
    assert jumps(run, np.ones(np.shape(slip), dtype=bool)) == said


@pytest.mark.parametrize(
    ("numbers", "error", "said"),
    [
        ({"friction_resultant": [90.0, 100.0], "u_T_max": [1.0, 2.0]}, 0.1, "change of the friction resultant"),
        ({"friction_resultant": [-3.0, 1.0], "u_T_max": [0.99, 1.0]}, 0.01, "all but cancels"),
        ({"friction_resultant": [0.0, 0.0]}, None, "no friction"),
        ({"error_estimate": [0.3, 0.26], "goal": [90.0, 100.0], "goal_estimate": [9.0, 0.5]}, 0.005, "of the goal"),
    ],
)
def test_the_mesh_error_is_that_of_the_goal_or_of_a_number_that_does_not_cancel(
    numbers: dict[str, list[float]], error: float | None, said: str
) -> None:
    """Two levels of one point."""
    held = {name: np.array(values) for name, values in numbers.items()} | {"status": np.ones(2)}
    run = RunSeen(
        (), 2, "grid", lambda name: (np.zeros(0), {}), lambda name, level: held[name][level] if name in held else None
    )
    found, how = mesh_error(run, run.ok())
    assert found == (pytest.approx(error) if error is not None else None)
    assert said in how
