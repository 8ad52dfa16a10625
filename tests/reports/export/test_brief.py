"""A result file as one JSON object: the numbers that stand in it."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np

from tcstudy.data.store import open_results
from tcstudy.reports.export.brief import brief, json_text
from tests.reports.figures.draw_cases import FAILED


def test_points_have_the_numbers_of_the_file(grid: Path) -> None:
    found = json.loads(json_text(brief(grid)))
    assert (found["kind"], found["title"]) == ("run", "Plate for $5 and $6")
    assert found["verdict"].endswith("3 of 4 solved.")
    assert [(point["alpha"], point["friction"]) for point in found["points"]] == [
        (25.0, "tresca"), (25.0, "softening"), (100.0, "tresca"), (100.0, "softening"),
    ]  # fmt: skip
    with open_results(grid) as tree:
        slip = tree["slip_length"].values
        assert found["levels"]["n_dof"] == tree["n_dof"].values.tolist()
    for point, index in zip(found["points"], np.ndindex(2, 2), strict=True):
        solved = index != FAILED
        assert point["status"] == ["ok", "ok" if solved else "singular"]
        assert (point["reason"][1] == "") == solved
        np.testing.assert_array_equal(np.array(point["slip_length"], dtype=float), slip[index])
    assert found["units"]["slip_length"] == "m"
