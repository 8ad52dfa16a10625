"""The point of a file by its labels, and what is said if there is none."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import xarray

pytest.importorskip("matplotlib")


from tcstudy.errors import DrawError
from tcstudy.reports.picture import read_picture
from tcstudy.reports.select_point import parameter
from tests.reports.figures.draw_cases import level_record, point_record


@pytest.mark.parametrize(
    ("point", "label"),
    [
        (None, "alpha = 25 W m-2 K-1, friction = tresca"),
        ({"alpha": 100}, "alpha = 100 W m-2 K-1, friction = tresca"),
        ({"alpha": 100.0001, "friction": "tresca"}, "alpha = 100 W m-2 K-1, friction = tresca"),
        ({"alpha": "0.01 W/(cm^2*K)"}, "alpha = 100 W m-2 K-1, friction = tresca"),
        ({"friction": "softening"}, "alpha = 25 W m-2 K-1, friction = softening"),
        ({"heat.alpha": 100}, "alpha = 100 W m-2 K-1, friction = tresca"),
    ],
)
def test_a_point_by_its_labels(grid: Path, point: dict[str, float | str] | None, label: str) -> None:
    assert read_picture(grid, point).point == label


def test_a_parameter_by_the_end_of_its_path() -> None:
    paths = {"a": "boundary.grip.u_x", "b": "boundary.grip.g", "c": "boundary.end.g"}
    values = {name: (name, [0.0, 1.0], {"long_name": path}) for name, path in paths.items()}
    data = xarray.Dataset({"status": ([*paths, "level"], np.ones((2, 2, 2, 1)))}, values)
    assert [parameter(data, given) for given in ("a", "u_x", "grip.u_x", "end.g")] == ["a", "a", "a", "c"]
    with pytest.raises(DrawError, match="no swept parameter 'g'"):
        parameter(data, "g")


@pytest.mark.parametrize(("point", "index"), [(None, 0), ({"tau": "20 MPa"}, 2), ({"alpha": 25, "tau": 2e7}, 2)])
def test_a_point_of_a_list(listed: Path, point: dict[str, float | str] | None, index: int) -> None:
    picture = read_picture(listed, point)
    np.testing.assert_array_equal(picture.line.u_T, point_record((index,), level_record(1, False)).u_T)
    assert "tau = " in picture.point
    with pytest.raises(DrawError, match=r"alpha = 100 and tau = 20 MPa together; .* alpha = 100 .* tau = 1 MPa"):
        read_picture(listed, {"alpha": 100, "tau": "20 MPa"})


@pytest.mark.parametrize(
    ("point", "message"),
    [
        ({"alhpa": 1}, r"no swept parameter 'alhpa'; did you mean 'alpha'\? it has alpha, friction"),
        ({"friction": "softning"}, r"friction = softning; did you mean 'softening'\? it has tresca, softening"),
        ({"alpha": 90}, r"no point of the file has alpha = 90; the nearest values are 25, 100"),
        ({"alpha": "warm"}, r"alpha = 'warm' is not a number; give one in W m-2 K-1"),
        ({"alpha": "20 MPa"}, r"alpha = '20 MPa': 'MPa' is not a unit of a heat transfer coefficient"),
        ({"alpha": float("nan")}, r"no point of the file has alpha = nan"),
        ({"heat.alpha": 90}, r"no point of the file has alpha = 90"),
        ({"alpha": 25, "heat.alpha": 100}, r"alpha and heat.alpha are one parameter; give it once"),
    ],
)
def test_a_point_that_the_file_does_not_hold(grid: Path, point: dict[str, float | str], message: str) -> None:
    with pytest.raises(DrawError, match=message):
        read_picture(grid, point)


def test_a_failed_point_says_why_and_names_a_solved_one(grid: Path) -> None:
    point = {"alpha": 100, "friction": "softening"}
    message = r"no solution on level 1 \(singular: the stiffness matrix is singular\); draw another .* alpha = 25"
    with pytest.raises(DrawError, match=message):
        read_picture(grid, point)
    assert read_picture(grid, point, 0).level == 0
