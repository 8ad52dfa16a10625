"""The result file: what is written comes back."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Literal

import netCDF4
import numpy as np
import pytest

from tcstudy.data import schema
from tcstudy.data.files import StoreError
from tcstudy.data.records import LevelRecord, PointStatus
from tcstudy.data.store import open_results
from tcstudy.scene.study import Study
from tests.data.by_points import PointRecord, write
from tests.data.conftest import make_level, make_point

pytestmark = pytest.mark.filterwarnings("error")

Levels = tuple[LevelRecord, ...]

Points = list[PointRecord]


def test_every_number_of_every_point_comes_back_exactly(written: Path, points: Points) -> None:
    with open_results(written) as tree:
        root = tree.to_dataset().load()
        groups = [tree[f"level_{n}"].to_dataset().load() for n in range(2)]
    for p in points:
        place = (*p.index, p.level)
        stored = {name: root[name].values[place] for name in p.numbers}
        assert {n: tuple(v) if np.ndim(v) else v for n, v in stored.items()} == p.numbers
        assert root["status"].values[place] == PointStatus.OK
        assert root["reason"].values[place] == ""
        np.testing.assert_array_equal(groups[p.level]["u_T"].values[p.index], p.u_T)
        np.testing.assert_array_equal(groups[p.level]["sticks"].values[p.index], p.sticks)
        np.testing.assert_array_equal(groups[p.level]["xi"].values[p.index], p.xi)


def test_not_run_points_are_visible_and_keep_integers_integer(
    output: Path, study: Study, levels: Levels, points: Points
) -> None:
    missing = points.pop()
    write(output, study, levels, points)
    with open_results(output) as tree:
        here = tree.to_dataset().isel(dict(zip(tree["status"].dims, (*missing.index, missing.level), strict=True)))
        assert here["status"] == PointStatus.NOT_RUN
        assert here["reason"] == "not run"
        assert here["iterations"] == -1
        assert here["iterations"].dtype == np.int32
        assert np.isnan(here["energy"])
        assert np.isnan(tree["level_1"]["u_T"].values[missing.index]).all()
        assert (tree["level_1"]["sticks"].values[missing.index] == schema.UNKNOWN).all()
        assert tree["level_1"]["sticks"].dtype == np.int8
        assert int((tree["status"] == PointStatus.NOT_RUN).sum()) == 1
    with netCDF4.Dataset(output) as nc:  # netCDF4 masks by valid_min
        assert nc["iterations"][...].mask.sum() == 1


def test_whole_body_fields_stand_on_their_mesh(output: Path, study: Study) -> None:
    levels = [make_level(n, fields=True) for n in range(2)]
    points = [make_point(i, n, fields=True) for n in range(2) for i in np.ndindex(study.shape)]
    missing = points.pop()
    write(output, study, levels, points)
    with open_results(output) as tree:
        for p in points:
            for name, values in p.fields.items():
                np.testing.assert_array_equal(tree[f"level_{p.level}"][name].values[p.index], values)
        group = tree["level_1"]
        assert np.isnan(group["u_x"].values[missing.index]).all()
        np.testing.assert_array_equal(group["triangle"].values, levels[1].fields["triangle"])
        np.testing.assert_array_equal(group["node_y"].values, levels[1].fields["node_y"])
        assert group["mesh"].attrs["face_node_connectivity"] == "triangle"
        assert group["theta"].attrs["mesh"] == "mesh"


def test_names_of_axes_that_collide_are_refused(output: Path, study: Study, levels: Levels, points: Points) -> None:
    for name, text in (("energy", "name of a result"), ("node", "name of a result"), ("a b", "letters")):
        bad = replace(study, axes=(replace(study.axes[0], name=name, path=(name,)), *study.axes[1:]))
        with pytest.raises(StoreError, match=text):
            write(output, bad, levels, points)
    twice = replace(study, axes=(study.axes[0], study.axes[0]))
    with pytest.raises(StoreError, match="two swept parameters are named 'alpha'"):
        write(output, twice, levels, [])


@pytest.mark.parametrize("mode", ["grid", "list"])
def test_an_axis_with_the_name_of_a_result_gets_its_path_for_a_name(
    output: Path, list_study: Study, mode: Literal["grid", "list"]
) -> None:
    alpha, friction = list_study.axes
    axes = (
        replace(alpha, name="theta", path=("heat", "theta")),
        replace(friction, name="omega", path=("heat", "omega")),
    )
    named = replace(list_study, mode=mode, axes=axes)
    points = [make_point(index, 1, fields=True) for index in np.ndindex(named.shape)]
    write(output, named, [make_level(n, fields=True) for n in range(2)], points)
    with open_results(output) as tree:
        assert tree["heat_theta"].values.tolist() == [100.0, 25.0]
        assert tree["heat_omega"].values.tolist() == ["tresca", "decay"]
        for p in points:
            assert tree["omega"].values[(*p.index, 1)] == p.numbers["omega"]
            np.testing.assert_array_equal(tree["level_1"]["theta"].values[p.index], p.fields["theta"])


def _counts(level: LevelRecord) -> tuple[int, int]:
    return level.n_contact, len(level.fields.get("node_x", ()))


def test_expected_bytes_is_close_to_the_file(written: Path, study: Study, levels: Levels) -> None:
    size = written.stat().st_size
    assert size <= schema.expected_bytes(study, [_counts(level) for level in levels]) <= 2 * size
    n = 2000
    long = replace(
        levels[0],
        n_contact=n,
        edge=np.zeros(n, np.int8),
        **{name: np.linspace(0, 1, n) for name in ("arclength", "x", "y", "c")},
    )
    rng = np.random.default_rng(1)  # what cannot be compressed
    points = [replace(make_point(index, 0), u_T=rng.random(n), xi=rng.random(n)) for index in np.ndindex(study.shape)]
    points = [replace(point, sticks=rng.integers(0, 2, n).astype(np.int8)) for point in points]
    write(written, study, [long, levels[1]], points)
    assert schema.expected_bytes(study, [_counts(long), _counts(levels[1])]) == pytest.approx(
        written.stat().st_size, rel=0.25
    )
