"""A result file as one JSON object: the numbers that stand in it."""

from __future__ import annotations

import json

import numpy as np

from tcstudy.data.reading import open_results
from tcstudy.reports.export.table import brief, json_text
from tests.reports.conftest import REASON, Stored


def test_points_have_the_numbers_of_the_file(stored: Stored) -> None:
    found = json.loads(json_text(brief(stored("failed"))))
    assert (found["kind"], found["title"]) == ("run", "A block <on> a film for $5 and $6")
    assert found["verdict"].endswith("5 of 6 solved.")
    places = [(theta, law) for theta in (0.0, 10.0, 20.0) for law in ("plain", "weak")]
    assert [(point["theta_bar"], point["friction"]) for point in found["points"]] == places
    with open_results(stored("failed")) as tree:
        slip = tree["slip_length"].values
        assert found["levels"]["n_dof"] == tree["n_dof"].values.tolist()
    for point, index in zip(found["points"], np.ndindex(3, 2), strict=True):
        failed = index == (2, 1)
        assert point["status"] == ["ok", "singular" if failed else "ok"]
        assert point["reason"] == ["", REASON if failed else ""]
        np.testing.assert_array_equal(np.array(point["slip_length"], dtype=float), slip[index])
    assert found["units"]["slip_length"] == "m"
