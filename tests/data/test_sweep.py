"""The points of a sweep as their files have them."""

from __future__ import annotations

import numpy as np
import pytest

from tcstudy.data.writer import axis_labels, axis_order, in_file_order, sweep_points
from tcstudy.reports.select_point import describe, locate
from tcstudy.reports.style import DrawError
from tests.verification.scenes import RECTANGLE, study_of


def test_points_are_found_in_the_order_of_the_study() -> None:
    study = study_of(RECTANGLE, "sweep={tau: [0.02, 0.01, 0.03], nu: [0.2, 0.3]}")
    points = sweep_points(study)
    where = locate(points, {"tau": "0.01", "nu": 0.3})
    assert tuple(where.values()) == (1, 1)
    assert describe(points, where) == "tau = 0.01, nu = 0.3"
    scene = study.scenes[1 * 2 + 1]
    assert (scene.material.nu, scene.friction.b_scale) == (0.3, 0.01)


def test_points_are_found_by_key_paths_and_messages_name_the_study() -> None:
    points = sweep_points(study_of(RECTANGLE, "sweep={tau: [0.02, 0.01], boundary.left.u_x: [0, 1]}"))
    assert tuple(locate(points, {"friction.tau": 0.01, "boundary.left.u_x": "1"}, "study").values()) == (1, 1)
    with pytest.raises(DrawError, match=r"no point of the study has tau = 7"):
        locate(points, {"friction.tau": 7}, "study")
    with pytest.raises(DrawError, match=r"the study has no swept parameter 'tua'; did you mean 'tau'"):
        locate(points, {"tua": 7}, "study")


def test_axes_that_go_up_and_down_are_sorted_with_their_values() -> None:
    study = study_of(RECTANGLE, "sweep={tau: [0.02, 0.01, 0.03], nu: [0.3, 0.2]}")
    tau, nu = ([float(label) for label in axis_labels(axis)[axis_order(axis)]] for axis in study.axes)
    assert tau == [0.01, 0.02, 0.03]
    assert nu == [0.3, 0.2]  # one way only is no fault
    values = np.array([[2.3, 2.2], [1.3, 1.2], [3.3, 3.2]])
    assert in_file_order(study, values).tolist() == [[1.3, 1.2], [2.3, 2.2], [3.3, 3.2]]


def test_points_read_together_stay_in_their_order() -> None:
    study = study_of(RECTANGLE, "sweep={mode: zip, tau: [0.02, 0.01, 0.03], nu: [0.3, 0.2, 0.3]}")
    assert sweep_points(study)["tau"].values.tolist() == [0.02, 0.01, 0.03]
    assert in_file_order(study, np.arange(3.0)).tolist() == [0.0, 1.0, 2.0]
    assert locate(sweep_points(study), {"tau": 0.01}) == {"point": 1}
