"""The result file: what is written comes back, in one piece or not at all."""

from __future__ import annotations

import os
import subprocess
import sys
import warnings
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Literal

import netCDF4
import numpy as np
import pytest
import xarray

from tcstudy.data import schema, store
from tcstudy.data.provenance import Provenance
from tcstudy.data.records import LevelRecord, PointRecord, PointStatus
from tcstudy.data.store import StoreError, check_writable, open_results, write
from tcstudy.scene.records import Study

pytestmark = pytest.mark.filterwarnings("error")

Levels = tuple[LevelRecord, ...]
Points = list[PointRecord]


@pytest.fixture
def written(output: Path, study: Study, levels: Levels, points: Points, provenance: Provenance) -> Path:
    write(output, study, levels, points, provenance)
    return output


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
        np.testing.assert_array_equal(groups[p.level]["xi"].values[p.index], p.xi)


def test_levels_come_back_exactly(written: Path, levels: Levels) -> None:
    with open_results(written) as tree:
        for level in levels:
            for name in ("h_max", "n_dof", "n_contact", "time_mesh", "time_assemble"):
                assert tree[name].values[level.level] == getattr(level, name)
            group = tree[f"level_{level.level}"]
            assert group.sizes["node"] == level.n_contact
            for name in ("arclength", "x", "y", "c", "edge"):
                np.testing.assert_array_equal(group[name].values, getattr(level, name))
            assert group["edge"].attrs["flag_meanings"].split() == list(level.edge_names)


@pytest.mark.parametrize("reader", ["open_dataset", "open_datatree"])
def test_xarray_keeps_the_dtypes_and_does_not_warn(written: Path, points: Points, reader: str) -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        with getattr(xarray, reader)(written) as data:
            for v in schema.ROOT:
                kind = {"f8": "float64", "i4": "int32", "i1": "int8"}.get(v.dtype)
                assert kind is None or str(data[v.name].dtype) == kind, v.name
        for v in schema.CONTACT:
            with xarray.open_dataset(written, group="level_1") as group:
                assert str(group[v.name].dtype) == ("int8" if v.dtype == "i1" else "float64")


def test_not_run_points_are_visible_and_keep_integers_integer(
    output: Path, study: Study, levels: Levels, points: Points, provenance: Provenance
) -> None:
    missing = points.pop()
    write(output, study, levels, points, provenance)
    with open_results(output) as tree:
        here = tree.to_dataset().isel(dict(zip(tree["status"].dims, (*missing.index, missing.level), strict=True)))
        assert here["status"] == PointStatus.NOT_RUN
        assert here["reason"] == "not run"
        assert here["iterations"] == -1
        assert here["iterations"].dtype == np.int32
        assert np.isnan(here["energy"])
        assert np.isnan(tree["level_1"]["u_T"].values[missing.index]).all()
        assert int((tree["status"] == PointStatus.NOT_RUN).sum()) == 1
    with netCDF4.Dataset(output) as nc:  # netCDF4 masks by valid_min
        assert nc["iterations"][...].mask.sum() == 1


def test_a_failed_point_keeps_its_reason_and_what_it_has(
    output: Path,
    study: Study,
    levels: Levels,
    provenance: Provenance,
    new_failure: Callable[..., PointRecord],
) -> None:
    reason = "Ã is singular: is an edge of /home/someone/body.step clamped? (slope 3 N/m)"
    write(output, study, levels, [new_failure((1, 2, 0), 1, reason)], provenance)
    with open_results(output) as tree:
        here = tree.to_dataset().isel(alpha=1, theta_bar=2, friction=0, level=1)
        assert here["status"] == PointStatus.SINGULAR
        assert here["reason"] == "Ã is singular: is an edge of body.step clamped? (slope 3 N/m)"
        assert here["time_solve"] == 0.125
        assert np.isnan(here["energy"])
        assert here["iterations"] == -1


def test_nan_stands_for_a_missing_count(
    output: Path, study: Study, levels: Levels, points: Points, provenance: Provenance
) -> None:
    first = replace(points[0], numbers={"iterations": float("nan"), "omega": float("inf")})
    write(output, study, levels, [first], provenance)
    with open_results(output) as tree:
        assert tree["iterations"].values[0, 0, 0, 0] == -1
        assert tree["omega"].values[0, 0, 0, 0] == np.inf


def test_a_level_without_a_mesh_is_missing_only_itself(
    output: Path, study: Study, levels: Levels, points: Points, provenance: Provenance
) -> None:
    lost = replace(points[-1], status=PointStatus.MESH_FAILED, reason="the mesher gave up", numbers={})
    lost = replace(lost, u_T=np.empty(0), xi=np.empty(0))
    write(output, study, levels[:1], [points[0], lost], provenance)
    with open_results(output) as tree:
        assert list(tree.children) == ["level_0"]
        assert tree["n_dof"].values.tolist() == [40, -1]
        assert tree["status"].values[lost.index].tolist() == [PointStatus.NOT_RUN, PointStatus.MESH_FAILED]


def test_labels_select_points_in_a_grid(written: Path, points: Points) -> None:
    with open_results(written) as tree:
        here = tree.to_dataset().sel(alpha=100.0, theta_bar=20.0, friction="slip weakening", level=1)
        wanted = next(p for p in points if p.index == (1, 1, 1) and p.level == 1)
        assert here["energy"] == wanted.numbers["energy"]
        # the coordinates of the sweep hold in the groups, too
        line = tree["level_1"].to_dataset().sel(alpha=100.0, theta_bar=20.0, friction="slip weakening")
        np.testing.assert_array_equal(line["u_T"].values, wanted.u_T)


def test_list_mode_has_one_dimension_and_a_coordinate_for_each_axis(
    output: Path,
    list_study: Study,
    levels: Levels,
    provenance: Provenance,
    new_point: Callable[..., PointRecord],
) -> None:
    points = [new_point((i,), n) for i in range(2) for n in range(2)]
    write(output, list_study, levels, points, provenance)
    with open_results(output) as tree:
        root = tree.to_dataset()
        assert root["energy"].dims == ("point", "level")
        assert tree["level_0"]["xi"].dims == ("point", "node")
        assert root["alpha"].values.tolist() == [100.0, 25.0]
        assert root["friction"].values.tolist() == ["tresca", "decay"]
        assert {"alpha", "friction"} <= set(root.coords)
        assert [root["energy"].values[p.index[0], p.level] for p in points] == [p.numbers["energy"] for p in points]


def test_a_study_without_a_sweep_has_levels_only(
    output: Path, study: Study, levels: Levels, provenance: Provenance, new_point: Callable[..., PointRecord]
) -> None:
    single = replace(study, axes=())
    write(output, single, levels, [new_point((), 0), new_point((), 1)], provenance)
    with open_results(output) as tree:
        assert tree["energy"].dims == ("level",)
        assert tree["level_1"]["u_T"].dims == ("node",)
        assert (tree["status"] == PointStatus.OK).all()


def test_whole_body_fields_stand_on_their_mesh(
    output: Path,
    study: Study,
    provenance: Provenance,
    new_level: Callable[..., LevelRecord],
    new_point: Callable[..., PointRecord],
) -> None:
    levels = [new_level(n, fields=True) for n in range(2)]
    points = [new_point(i, n, fields=True) for n in range(2) for i in np.ndindex(study.shape)]
    missing = points.pop()
    write(output, study, levels, points, provenance)
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


@pytest.mark.parametrize(
    ("change", "text"),
    [
        ({"index": (0, 0)}, "outside the sweep"),
        ({"index": (0, 0, -1)}, "outside the sweep"),
        ({"index": (2, 0, 0)}, "outside the sweep"),
        ({"level": 2}, "outside the sweep"),
        ({"numbers": {"enrgy": 1.0}}, "no variable enrgy"),
        ({"fields": {"theta": np.zeros(4)}}, "has no mesh"),
        ({"u_T": np.zeros(5)}, "broadcast"),
    ],
)
def test_a_record_that_does_not_fit_is_refused_and_nothing_is_left(
    output: Path,
    study: Study,
    levels: Levels,
    points: Points,
    provenance: Provenance,
    change: dict[str, object],
    text: str,
) -> None:
    with pytest.raises(ValueError, match=text):
        write(output, study, levels, [replace(points[0], **change)], provenance)  # type: ignore[arg-type]
    assert os.listdir(output.parent) == []


def test_a_reader_of_the_old_file_keeps_it(
    written: Path, study: Study, levels: Levels, points: Points, provenance: Provenance
) -> None:
    old = points[0].numbers["energy"]
    with open_results(written) as tree:
        write(written, study, levels, [replace(points[0], numbers={"energy": -1.0})], provenance)
        assert tree["energy"].values[0, 0, 0, 0] == old
        assert np.isfinite(tree["energy"].values).all()
    with open_results(written) as tree:
        assert tree["energy"].values[0, 0, 0, 0] == -1.0


def _fail(*_: object, **__: object) -> None:
    raise OSError(28, "No space left on device")


@pytest.mark.parametrize("step", ["fsync", "replace"])
def test_a_full_disk_leaves_the_old_file(
    written: Path,
    study: Study,
    levels: Levels,
    points: Points,
    provenance: Provenance,
    step: str,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    before = written.read_bytes()
    monkeypatch.setattr(os, step, _fail)
    with pytest.raises(StoreError, match=r"No space left on device.*Free some space"):
        write(written, study, levels, points[:1], provenance)
    assert written.read_bytes() == before
    assert os.listdir(written.parent) == [written.name]


_LIMITED = """
import resource, sys
from pathlib import Path
sys.path.insert(0, sys.argv[2])
from conftest import make_level, make_point, make_study, Provenance
from tcstudy.data.store import StoreError, write
resource.setrlimit(resource.RLIMIT_FSIZE, (int(sys.argv[3]), int(sys.argv[3])))
try:
    write(Path(sys.argv[1]), make_study(), [make_level(0), make_level(1)], [make_point((0, 0, 0), 0)],
          Provenance("now", (), "unknown"))
except StoreError as error:
    print(error)
    sys.exit(3)
"""


@pytest.mark.skipif(not hasattr(os, "fork"), reason="file size limits are a matter of POSIX")
@pytest.mark.parametrize("limit", [1, 4096, 20_000, 40_000])
def test_a_disk_that_fills_while_netcdf_writes_leaves_the_old_file(written: Path, limit: int) -> None:
    before = written.read_bytes()
    assert len(before) > limit
    command = [sys.executable, "-c", _LIMITED, str(written), str(Path(__file__).parent), str(limit)]
    done = subprocess.run(command, capture_output=True, text=True, timeout=60, env=_environment())
    assert (done.returncode, done.stderr) == (3, "")
    assert "cannot write" in done.stdout
    assert "space" in done.stdout
    assert written.read_bytes() == before
    assert os.listdir(written.parent) == [written.name]


def _environment() -> dict[str, str]:
    return {**os.environ, "PYTHONPATH": str(Path(store.__file__).parents[2])}


def test_an_interrupt_leaves_the_old_file(
    written: Path, study: Study, levels: Levels, points: Points, provenance: Provenance
) -> None:
    before = written.read_bytes()

    def interrupted() -> Iterator[PointRecord]:
        yield points[0]
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        write(written, study, levels, interrupted(), provenance)
    assert written.read_bytes() == before
    assert os.listdir(written.parent) == [written.name]


def test_mode_and_symbolic_link_of_the_output_are_kept(
    written: Path, study: Study, levels: Levels, points: Points, provenance: Provenance
) -> None:
    written.chmod(0o640)
    link = written.with_name("link.nc")
    link.symlink_to(written)
    write(link, study, levels, points[:1], provenance)
    assert link.is_symlink()
    assert written.stat().st_mode & 0o777 == 0o640
    with open_results(written) as tree:
        assert int((tree["status"] == PointStatus.OK).sum()) == 1


def test_a_write_protected_file_is_not_replaced(
    written: Path, study: Study, levels: Levels, points: Points, provenance: Provenance
) -> None:
    written.chmod(0o444)
    assert any("write-protected" in problem for problem in check_writable(written, 0))
    before = written.read_bytes()
    with pytest.raises(StoreError, match="write-protected"):
        write(written, study, levels, points, provenance)
    assert written.read_bytes() == before


def test_check_writable_finds_what_is_wrong_and_leaves_nothing(
    output: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert check_writable(output, 1000) == []
    assert os.listdir(tmp_path) == []
    assert "is a directory" in check_writable(tmp_path, 0)[0]
    (tmp_path / "file").touch()
    assert "is a file" in check_writable(tmp_path / "file" / "deep" / "study.nc", 0)[0]
    monkeypatch.setattr(store.shutil, "disk_usage", lambda _: SimpleNamespace(free=3_000_000))
    assert check_writable(output, 1_000_000) == []
    assert "3 MB free, but the results need 3.3 MB" in check_writable(output, 1_100_000)[0]


def test_check_writable_finds_a_directory_without_permission(output: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(**_: object) -> None:
        raise PermissionError(13, "Permission denied")

    monkeypatch.setattr(store.tempfile, "TemporaryFile", refuse)
    (problem,) = check_writable(output, 0)
    assert "Permission denied" in problem
    assert "choose another output" in problem


def test_files_that_are_no_finished_results_are_refused(tmp_path: Path, written: Path) -> None:
    with pytest.raises(StoreError, match="there is no file"):
        open_results(tmp_path / "none.nc")
    (tmp_path / "run.nc.partial").touch()
    with pytest.raises(StoreError, match=r"has not finished.*resume"):
        open_results(tmp_path / "run.nc")
    short = tmp_path / "short.nc"
    short.write_bytes(written.read_bytes()[:-1000])
    with pytest.raises(StoreError, match="cut short"):
        open_results(short)
    with netCDF4.Dataset(tmp_path / "midway.nc", "w") as nc:  # what a dead writer leaves opens without an error
        nc.title = "midway"
    with pytest.raises(StoreError, match="is unfinished"):
        open_results(tmp_path / "midway.nc")


def test_names_of_axes_that_collide_are_refused(
    output: Path, study: Study, levels: Levels, points: Points, provenance: Provenance
) -> None:
    for name, text in (("energy", "name of a result"), ("node", "name of a result"), ("a b", "letters")):
        bad = replace(study, axes=(replace(study.axes[0], name=name, path=(name,)), *study.axes[1:]))
        with pytest.raises(StoreError, match=text):
            write(output, bad, levels, points, provenance)
    twice = replace(study, axes=(study.axes[0], study.axes[0]))
    with pytest.raises(StoreError, match="two swept parameters are named 'alpha'"):
        write(output, twice, levels, [], provenance)


@pytest.mark.parametrize("mode", ["grid", "list"])
def test_an_axis_with_the_name_of_a_result_gets_its_path_for_a_name(
    output: Path,
    list_study: Study,
    provenance: Provenance,
    new_level: Callable[..., LevelRecord],
    new_point: Callable[..., PointRecord],
    mode: Literal["grid", "list"],
) -> None:
    alpha, friction = list_study.axes
    axes = (
        replace(alpha, name="theta", path=("heat", "theta")),
        replace(friction, name="omega", path=("heat", "omega")),
    )
    named = replace(list_study, mode=mode, axes=axes)
    points = [new_point(index, 1, fields=True) for index in np.ndindex(named.shape)]
    write(output, named, [new_level(n, fields=True) for n in range(2)], points, provenance)
    with open_results(output) as tree:
        assert tree["heat_theta"].values.tolist() == [100.0, 25.0]
        assert tree["heat_omega"].values.tolist() == ["tresca", "decay"]
        for p in points:
            assert tree["omega"].values[(*p.index, 1)] == p.numbers["omega"]
            np.testing.assert_array_equal(tree["level_1"]["theta"].values[p.index], p.fields["theta"])


def test_a_long_study_text_is_kept_exactly(output: Path, study: Study, levels: Levels, provenance: Provenance) -> None:
    text = "# β in Pa/K, ünïcode\n" + "x: 1\n" * 50_000  # beyond the 64 kB of a compact HDF5 attribute
    write(output, replace(study, text=text), levels, [], provenance)
    with open_results(output) as tree:
        assert tree.attrs["study_yaml"] == text


def test_a_directory_without_permission_is_named_as_such(
    output: Path,
    study: Study,
    levels: Levels,
    provenance: Provenance,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    def refuse(*_: object, **__: object) -> None:
        raise PermissionError(13, "Permission denied")

    monkeypatch.setattr(Path, "touch", refuse)  # the superuser, who may run the tests, is refused nothing
    with pytest.raises(StoreError, match=r"Permission denied\. Make the place writable"):
        write(output, study, levels, [], provenance)


def test_expected_bytes_is_close_to_the_file(
    written: Path, study: Study, levels: Levels, provenance: Provenance, new_point: Callable[..., PointRecord]
) -> None:
    size = written.stat().st_size
    assert size <= schema.expected_bytes(study, levels) <= size + 100_000
    n = 2000
    long = replace(
        levels[0],
        n_contact=n,
        edge=np.zeros(n, np.int8),
        **{name: np.linspace(0, 1, n) for name in ("arclength", "x", "y", "c")},
    )
    write(written, study, [long, levels[1]], [], provenance)
    assert schema.expected_bytes(study, [long, levels[1]]) == pytest.approx(written.stat().st_size, rel=0.25)


def test_neither_store_nor_journal_import_what_they_do_not_need() -> None:
    code = (
        "import sys, tcstudy.data.journal, tcstudy.data.store;"
        "print(sorted({'ngsolve', 'netgen', 'xarray', 'netCDF4'} & set(sys.modules)))"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, env=_environment(), check=True)
    assert done.stdout.strip() == "[]"
