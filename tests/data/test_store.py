"""The result file: what is written comes back, in the order of its sweep, whatever the passes of
the writer."""

import math
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Literal

import netCDF4
import numpy as np
import pytest

from tcstudy.data import schema, store
from tcstudy.data.files import collect
from tcstudy.data.reading import open_results
from tcstudy.data.records import BlockRecord, LevelRecord, Record
from tcstudy.data.schema import POINT_LEVEL, SWEEP, FileVariable, PointStatus
from tcstudy.data.tables import axis_names
from tcstudy.data.variables import sweep_points, tile_shape, tiles
from tcstudy.reports.select_point import describe, locate
from tcstudy.scene.mesh_plan import MeshPlan
from tcstudy.scene.solver_plan import START_NAMES
from tcstudy.scene.study import Axis, Study
from tests.data.by_points import write
from tests.data.conftest import ALPHA, FRICTION, make_block, make_level, make_study
from tests.verification.scenes import RECTANGLE, study_of

pytestmark = pytest.mark.filterwarnings("error")
Levels = tuple[LevelRecord, ...]


def assert_held(file: Path, *blocks: BlockRecord) -> None:
    """Every number of every point is in the file."""
    with open_results(file) as tree:
        for block in blocks:
            place, line = np.unravel_index(block.points, block.shape), tree[f"level_{block.level}"]
            for name, values in block.numbers.items():
                np.testing.assert_array_equal(
                    tree[name].values[(*place, block.level)], values, name
                )
            np.testing.assert_array_equal(
                tree["status"].values[(*place, block.level)], block.status
            )
            for name, values in {
                "u_T": block.u_T,
                "xi": block.xi,
                "sticks": block.sticks,
                **block.fields,
            }.items():
                np.testing.assert_array_equal(line[name].values[place], values, name)


def test_points_and_whole_body_fields_come_back_and_those_not_run_are_visible(
    output: Path, study: Study
) -> None:
    levels = [make_level(n, fields=True) for n in range(2)]
    blocks = [make_block(0, fields=True), make_block(1, *range(11), fields=True)]
    write(output, study, levels, blocks)
    assert_held(output, *blocks)
    with open_results(output) as tree:
        here = tree.to_dataset().isel(dict(zip(tree["status"].dims, (1, 2, 1, 1), strict=True)))
        assert (here["status"], here["reason"], here["iterations"]) == (
            PointStatus.NOT_RUN,
            "not run",
            -1,
        )
        assert here["iterations"].dtype == np.int32
        group = tree["level_1"]
        assert all(
            np.isnan([*here["energy"].values.ravel(), *group[n].values[1, 2, 1]]).all()
            for n in ("u_T", "u_x")
        )
        assert (group["sticks"].values[1, 2, 1] == schema.UNKNOWN).all()
        assert group["sticks"].dtype == np.int8
        assert int((tree["status"] == PointStatus.NOT_RUN).sum()) == 1
        for name in ("triangle", "node_y"):
            np.testing.assert_array_equal(group[name].values, levels[1].fields[name])
        assert group["mesh"].attrs["face_node_connectivity"] == "triangle"
        assert group["theta"].attrs["mesh"] == "mesh"
    with netCDF4.Dataset(output) as nc:  # netCDF4 masks by valid_min
        assert nc["iterations"][...].mask.sum() == 1
        filled = {
            name: "_FillValue" in nc[name].ncattrs() for name in ("energy", "iterations", "unique")
        }
        assert filled == {
            "energy": True,
            "iterations": False,
            "unique": False,
        }  # filled integers are read as floats


def test_numbers_of_points_include_those_of_each_start(study: Study) -> None:
    names = {variable.name for variable in store.numbers(study)}
    assert {"energy", "start_energy"} <= names
    assert not {"status", "reason", "h_max"} & names


def test_only_a_level_with_live_arrays_has_their_group(output: Path, study: Study) -> None:
    level = make_level(0)
    matrix = np.arange(9.0).reshape(3, 3)
    live = replace(level, fields={"live_A_tilde": matrix})
    for record, groups in ((level, []), (live, ["live"])):
        write(output, study, [record], [make_block(0)])
        with netCDF4.Dataset(output) as nc:
            assert [*nc["level_0"].groups] == groups
    with netCDF4.Dataset(output) as nc:
        np.testing.assert_array_equal(nc["level_0/live/A_tilde"], matrix)


@pytest.mark.parametrize("axes", [(), (ALPHA,)], ids=["one point", "a sweep"])
def test_a_record_lies_along_its_sweep_and_names_no_folder(
    output: Path, axes: tuple[Axis, ...]
) -> None:
    """A table may have variables without values, which are left out."""
    study = make_study(axes=axes)
    count = math.prod(study.shape)
    tables = [
        FileVariable("slope", "f8", "1", "order"),
        FileVariable("reason", "str", "", "why there is no solution", (SWEEP,)),
        FileVariable("absent", "f8", "1", "a variable without values", POINT_LEVEL),
    ]
    values = {
        "slope": np.arange(2.0 * count).reshape(count, 2),
        "reason": ["cannot read /home/me/a.step"] * count,
    }
    record = Record("convergence", tables, values, {"reference": "in /home/me/b.nc", "number": 3})
    attributes = collect(study, ["tcstudy"])
    store.write_record(output, study, record, attributes)
    with netCDF4.Dataset(output) as nc:
        names = ["alpha"] if axes else []
        assert [*nc.variables] == [*names, "slope", "reason"]
        assert nc["slope"].dimensions == (*names, "level")
        np.testing.assert_array_equal(nc["slope"], values["slope"].reshape(*study.shape, 2))
        assert [*np.ravel(nc["reason"][...])] == ["cannot read a.step"] * count
        assert (nc.content, nc.reference, nc.number) == ("convergence", "in b.nc", 3)
    without_reasons = replace(record, values={"slope": values["slope"]})
    store.write_record(output, study, without_reasons, attributes)
    with netCDF4.Dataset(output) as nc:
        assert [*nc.variables] == [*names, "slope"]


TAKEN = ("level_0", "geometry_12", "own_point", "live", "step", "probe_p_u_x", "error_u_T_L2")


@pytest.mark.parametrize("name", TAKEN)
def test_a_swept_name_that_files_use_themselves_is_stored_by_its_path(
    output: Path, name: str
) -> None:
    axis = Axis(name, ("parameters", name), (1.0, 2.0), (1.0, 2.0), "m")
    study = make_study(axes=(axis,))
    write(output, study, [make_level(0)], [make_block(0, 0, 1, shape=study.shape)])
    with open_results(output) as tree:
        assert tree["status"].dims == (f"parameters_{name}", "level")
        np.testing.assert_array_equal(tree[f"parameters_{name}"], [1.0, 2.0])


def test_no_two_axes_have_one_name_in_a_file() -> None:
    paths = ("heat", "omega"), ("parameters", "heat_omega"), ("parameters", "E")
    axes = [Axis(path[-1], path, (1.0,), (1.0,), "1") for path in paths]
    assert axis_names(axes) == ("heat_omega", "parameters_heat_omega", "E")


@pytest.mark.parametrize("mode", ["grid", "list"])
def test_an_axis_with_the_name_of_a_result_gets_its_path_for_a_name(
    output: Path, mode: Literal["grid", "list"]
) -> None:
    axes = (
        replace(ALPHA, name="theta", path=("heat", "theta"), labels=(100.0, 25.0)),
        replace(FRICTION, name="omega", path=("heat", "omega")),
    )
    named = make_study(mode=mode, axes=axes)
    block = make_block(1, shape=named.shape, fields=True)
    write(output, named, [make_level(n, fields=True) for n in range(2)], [block])
    assert_held(output, block)
    with open_results(output) as tree:
        assert tree["heat_theta"].values.tolist() == [100.0, 25.0]
        assert tree["heat_omega"].values.tolist() == ["tresca", "slip weakening"]


def test_expected_bytes_is_close_to_the_file(written: Path, study: Study, levels: Levels) -> None:
    def expected(*levels: LevelRecord) -> int:
        return schema.expected_bytes(
            study, [(one.n_contact, len(one.fields.get("node_x", ()))) for one in levels]
        )

    size = written.stat().st_size
    assert size <= expected(*levels) <= 2 * size
    n, rng = 2000, np.random.default_rng(1)  # what cannot be compressed
    line = {name: np.linspace(0, 1, n) for name in ("arclength", "x", "y", "c")}
    long = replace(levels[0], n_contact=n, edge=np.zeros(n, np.int8), **line)
    rows = {name: rng.random((12, n)) for name in ("u_T", "xi")}
    write(
        written,
        study,
        [long, levels[1]],
        [make_block(0, **rows, sticks=rng.integers(0, 2, (12, n), dtype=np.int8))],
    )
    assert expected(long, levels[1]) == pytest.approx(written.stat().st_size, rel=0.25)


@pytest.mark.parametrize("shape", [(), (1,), (7,), (3, 5), (4, 1, 6), (2, 3, 4, 5), (1000,)])
@pytest.mark.parametrize("points", [1, 2, 7, 20, 10_000])
def test_tiles_follow_one_another_and_cover_the_sweep_once(
    shape: tuple[int, ...], points: int
) -> None:
    places = np.arange(math.prod(shape)).reshape(shape)
    tile = tile_shape(shape, points)
    assert math.prod(tile) <= points
    found = [(places[cut].ravel().tolist(), start, stop) for cut, start, stop in tiles(shape, tile)]
    assert [values for values, *_ in found] == [[*range(start, stop)] for _, start, stop in found]
    assert [place for values, *_ in found for place in values] == [*range(math.prod(shape))]


@pytest.mark.parametrize("memory", [2**26, 200_000])
def test_a_long_sweep_comes_back_whatever_the_passes(
    output: Path, memory: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """15,000 points, blocks a stride apart, in no order, with every tenth failed."""
    axes = [
        Axis(n, ("heat", n), (*range(x),), (*range(x),), "1")
        for n, x in (("a", 20), ("b", 30), ("d", 25))
    ]
    study, rng = make_study(axes=tuple(axes), mesh=MeshPlan((0.1,), 1)), np.random.default_rng(3)
    order, starts = (
        np.arange(15_000).reshape(study.shape).transpose(2, 0, 1).ravel(),
        np.arange(len(START_NAMES)) % 3,
    )
    blocks = []
    for points in rng.permutation(np.array_split(order, 40)):
        failed = points % 10 == 0
        status = np.where(failed, PointStatus.NOT_CONVERGED, PointStatus.OK).astype(np.int8)
        reasons = {
            int(row): f"point {points[row]}" for row in np.flatnonzero(failed) if points[row] < 1000
        }
        line = np.where(failed, np.nan, points.astype(float))[:, None] + np.arange(3.0)
        numbers = {
            "energy": points / 7.0,
            "iterations": points % 13 + 0.0,
            "start_energy": line[:, starts],
        }
        sticks = np.where(failed[:, None], -1, line > 5.0).astype(np.int8)
        blocks.append(
            BlockRecord(0, study.shape, points, status, reasons, numbers, line, -line, sticks)
        )
    passes = 0

    def again() -> Iterator[BlockRecord]:
        nonlocal passes
        passes += 1
        yield from blocks

    monkeypatch.setattr(store, "MAX_MEMORY", memory)
    monkeypatch.setattr(store, "CHUNK", 2**15)
    store.write(
        output, store.Results(study, lambda: [make_level(0)], again, collect(study, ["tcstudy"]))
    )
    assert not list(output.parent.glob(".*.tmp"))
    assert passes > 10 if memory < 2**26 else passes == 1
    assert_held(output, *blocks)
    with netCDF4.Dataset(output) as nc:
        for name in ("energy", "start_energy", "level_0/u_T"):
            assert {"fletcher32": True, "zlib": True}.items() <= nc[name].filters().items()
        assert nc["h_max"].chunking() == "contiguous"
        words = [f"point {p}" if p % 10 == 0 and p < 1000 else "" for p in range(15_000)]
        assert nc["reason"][...].ravel().tolist() == words


def test_axes_ascend_or_fall_and_points_are_found_by_their_labels() -> None:
    """CF wants monotonic coordinates: values that go up and down are sorted, falling ones and texts
    stay."""
    study = study_of(RECTANGLE, "sweep={tau: [0.02, 0.01, 0.03], nu: [0.3, 0.2], mode: grid}")
    assert [axis.labels for axis in study.axes] == [(0.01, 0.02, 0.03), (0.3, 0.2)]
    points = sweep_points(study)
    where = locate(points, {"tau": "0.02", "nu": 0.3})
    assert tuple(where.values()) == (1, 0)
    assert describe(points, where) == "tau = 0.02, nu = 0.3"
    scene = study.scenes[1 * 2 + 0]
    assert (scene.material.nu, scene.friction.b_scale) == (0.3, 0.02)
