"""Numbers come out of a page as they went in, or as close as was said."""

import numpy as np

from tcstudy.reports.page.container import Container
from tests.reports.page.unpacked import unpacked


def test_arrays_and_json_come_back() -> None:
    box = Container()
    header = {
        "a": box.array([[1.0, np.nan], [3.0, np.inf]]),
        "b": box.array([1, 2, 3], "i1"),
        "c": [np.nan, np.inf, 1.5],
    }
    back = unpacked(box.packed(header))
    np.testing.assert_array_equal(back["a"], [[1.0, np.nan], [3.0, np.inf]])
    np.testing.assert_array_equal(back["b"], [1, 2, 3])
    assert back["c"] == [None, "inf", 1.5]


def test_rows_keep_four_digits_of_their_largest_value() -> None:
    values = np.random.default_rng(1).normal(size=(5, 40)) * 10.0 ** np.arange(-8, 12, 4)[:, None]
    values[2, 3] = np.nan
    values[4] = 0.0
    box = Container()
    back = unpacked(box.packed(box.rows(values)))
    found = np.where(back["rows"] == -32768, np.nan, back["rows"] * back["scale"][:, None])
    largest = np.nanmax(np.abs(values), axis=1, keepdims=True)
    assert np.nanmax(np.abs(found - values) / np.where(largest > 0.0, largest, 1.0)) <= 0.51 / 32767
    np.testing.assert_array_equal(np.isnan(found), np.isnan(values))


def test_fields_of_many_points_need_few_modes() -> None:
    generator = np.random.default_rng(2)
    fields = generator.normal(size=(60, 3)) @ generator.normal(size=(3, 500))
    box = Container()
    back = unpacked(box.packed(box.fields(fields)))
    assert back["factor"].shape == (60, 3)
    modes = back["mode"]["rows"] * back["mode"]["scale"][:, None]
    assert np.max(np.abs(back["factor"] @ modes - fields)) <= 1.1e-3 * np.ptp(fields)
