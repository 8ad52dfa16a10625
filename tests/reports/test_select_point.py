"""The point of a file by its labels, and what is said if there is none."""

import numpy as np
import pytest
import xarray

from tcstudy.errors import DrawError
from tcstudy.reports.picture import read_picture
from tcstudy.reports.select_point import locate, parameter
from tests.reports.conftest import REASON, Stored

Point = dict[str, float | str]


@pytest.mark.parametrize(
    ("point", "label"),
    [
        (None, "theta_bar = 20 K, friction = weak"),  # the largest slip
        ({"theta_bar": 20.0001, "friction": "plain"}, "theta_bar = 20 K, friction = plain"),
        ({"theta_bar": "20000 mK"}, "theta_bar = 20 K, friction = plain"),
        ({"friction": "weak"}, "theta_bar = 0 K, friction = weak"),
        ({"heat.theta_bar": 10}, "theta_bar = 10 K, friction = plain"),
    ],
)
def test_a_point_by_its_labels(stored: Stored, point: Point | None, label: str) -> None:
    assert read_picture(stored("block"), point).point == label


def test_a_parameter_by_the_end_of_its_path() -> None:
    paths = {"a": "boundary.grip.u_x", "b": "boundary.grip.g", "c": "boundary.end.g"}
    values = {name: (name, [0.0, 1.0], {"long_name": path}) for name, path in paths.items()}
    data = xarray.Dataset({"status": ([*paths, "level"], np.ones((2, 2, 2, 1)))}, values)
    assert [parameter(data, given) for given in ("a", "u_x", "grip.u_x", "end.g")] == [
        "a",
        "a",
        "a",
        "c",
    ]
    with pytest.raises(DrawError, match="no swept parameter 'g'"):
        parameter(data, "g")
    pairs = xarray.Dataset(
        {"status": (["g", "level"], np.ones((2, 1)))}, {"g": ("g", ["[8 MPa, 0]", "[4 MPa, 0]"])}
    )
    assert locate(pairs, {"g": ["4 MPa", 0]}) == {"g": 1}  # as the study has it


@pytest.mark.parametrize(
    ("point", "index"), [(None, -1), ({"tau_s": "95 MPa"}, 2), ({"alpha": 25, "tau_s": 95e6}, 2)]
)
def test_a_point_of_a_list(stored: Stored, point: Point | None, index: int) -> None:
    picture = read_picture(stored("listed"), point)
    with xarray.open_datatree(stored("listed")) as tree:
        if index < 0:  # without labels the point of the largest slip
            index = int(np.argmax(tree["u_T_max"].values[:, -1]))
        np.testing.assert_array_equal(picture.line.u_T, tree["level_0"]["u_T"].values[index])
    assert "tau_s = " in picture.point
    with pytest.raises(
        DrawError,
        match=r"alpha = 100 and tau_s = 95 MPa together; .* alpha = 100 .* tau_s = 90 MPa",
    ):
        read_picture(stored("listed"), {"alpha": 100, "tau_s": "95 MPa"})


@pytest.mark.parametrize(
    ("point", "message"),
    [
        (
            {"theta_bra": 1},
            r"no swept parameter 'theta_bra'; did you mean 'theta_bar'\? there is theta_bar, friction",
        ),
        ({"friction": "wake"}, r"friction = wake; did you mean 'weak'\? there is plain, weak"),
        ({"theta_bar": 11}, r"no point has theta_bar = 11; the nearest values are 0, 10, 20"),
        ({"theta_bar": "warm"}, r"theta_bar = 'warm' is not a number; give one in K"),
        ({"theta_bar": "20 MPa"}, r"theta_bar = '20 MPa': 'MPa' is not a unit of a temperature"),
        (
            {"theta_bar": 10, "heat.theta_bar": 20},
            r"theta_bar and heat.theta_bar are one parameter; give it once",
        ),
    ],
)
def test_a_point_that_the_file_does_not_hold(stored: Stored, point: Point, message: str) -> None:
    with pytest.raises(DrawError, match=message):
        read_picture(stored("block"), point)


def test_a_failed_point_says_why_and_names_a_solved_one(stored: Stored) -> None:
    point = {"theta_bar": 20, "friction": "weak"}
    with pytest.raises(
        DrawError, match=rf"no solution on level 1 \(singular: {REASON}\); draw .* theta_bar = 0"
    ):
        read_picture(stored("failed"), point)
    assert read_picture(stored("failed"), point, 0).level == 0
