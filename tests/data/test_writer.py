"""How a sweep gets into its file: points and axes in its order, tile by tile in several passes, compressed if long."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import netCDF4
import numpy as np
import pytest

from tcstudy.data import store
from tcstudy.data.provenance import collect
from tcstudy.data.records import BlockRecord, LevelRecord, PointStatus
from tcstudy.data.schema import FileVariable
from tcstudy.data.store import open_results
from tcstudy.data.writer import CHUNK, storage, sweep_points, tile_shape, tiles
from tcstudy.reports.select_point import describe, locate
from tcstudy.scene.study import START_NAMES, Axis, MeshPlan, Study
from tests.verification.scenes import RECTANGLE, study_of

STARTS = np.arange(len(START_NAMES)) % 3


@pytest.mark.parametrize("shape", [(), (1,), (7,), (3, 5), (4, 1, 6), (2, 3, 4, 5), (1000,)])
@pytest.mark.parametrize("points", [1, 2, 7, 20, 10_000])
def test_tiles_follow_one_another_and_cover_the_sweep_once(shape: tuple[int, ...], points: int) -> None:
    places = np.arange(math.prod(shape)).reshape(shape)
    tile = tile_shape(shape, points)
    assert math.prod(tile) <= points
    found = [(places[cut].ravel().tolist(), start, stop) for cut, start, stop in tiles(shape, tile)]
    assert [values for values, *_ in found] == [[*range(start, stop)] for _, start, stop in found]
    assert [place for values, *_ in found for place in values] == [*range(math.prod(shape))]


def test_small_variables_lie_in_one_piece_and_large_ones_in_compressed_chunks_with_checksums() -> None:
    variable = FileVariable("energy", "f8", "J m-1", "energy")
    assert storage(variable, (8000,)) == {"contiguous": True}
    assert storage(variable, ()) == {"contiguous": True}
    large = storage(variable, (1000, 1000))
    assert large.pop("chunksizes") == tile_shape((1000, 1000), CHUNK // 8)
    assert large == {"compression": "zlib", "complevel": 1, "shuffle": True, "fletcher32": True}


def long_sweep(study: Study) -> tuple[Study, list[BlockRecord]]:
    """20 × 30 × 25 points, blocks a stride apart, in no order, with every tenth failed."""
    rng = np.random.default_rng(3)
    labels = (np.arange(20.0), np.arange(30.0), np.arange(25.0))
    named = zip("abd", (tuple(x.tolist()) for x in labels), strict=True)
    long = replace(study, axes=tuple(Axis(n, ("heat", n), x, x, "1") for n, x in named), mesh=MeshPlan((0.1,), 1))
    order = np.arange(15_000).reshape(long.shape).transpose(2, 0, 1).ravel()
    parts, blocks = np.array_split(order, 40), []
    for number in rng.permutation(len(parts)).tolist():
        points = parts[number]
        failed = points % 10 == 0
        status = np.where(failed, PointStatus.NOT_CONVERGED, PointStatus.OK).astype(np.int8)
        reasons = {int(row): f"point {points[row]}" for row in np.flatnonzero(failed) if points[row] < 1000}
        line = np.where(failed, np.nan, points.astype(float))[:, None] + np.arange(3.0)
        numbers = {"energy": points / 7.0, "iterations": points % 13 + 0.0, "start_energy": line[:, STARTS]}
        sticks = (line > 5.0).astype(np.int8)
        blocks.append(BlockRecord(0, long.shape, points, status, reasons, numbers, line, -line, sticks))
    return long, blocks


@pytest.mark.parametrize("memory", [2**26, 200_000])
def test_a_long_sweep_comes_back_whatever_the_passes(
    output: Path,
    study: Study,
    levels: tuple[LevelRecord, ...],
    memory: int,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    long, blocks = long_sweep(study)
    passes = 0

    def again() -> Iterator[BlockRecord]:
        nonlocal passes
        passes += 1
        yield from blocks

    for name, value in (("MEMORY", memory), ("CHUNK", 2**15)):
        monkeypatch.setattr(store, name, value)
    store.write(output, long, levels[:1], again, collect(long, ["tcstudy"]))
    assert not list(output.parent.glob(".*.tmp"))
    assert passes > 10 if memory < 2**26 else passes == 1
    with netCDF4.Dataset(output) as nc:
        for name in ("energy", "start_energy", "level_0/u_T"):
            assert nc[name].filters()["fletcher32"]
            assert nc[name].filters()["zlib"]
    places = np.arange(15_000.0).reshape(long.shape)
    failed = places % 10 == 0
    with open_results(output) as tree:
        root = tree.to_dataset().isel(level=0)
        np.testing.assert_array_equal(root["energy"], places / 7.0)
        np.testing.assert_array_equal(root["iterations"], places % 13)
        np.testing.assert_array_equal(root["status"] == PointStatus.OK, ~failed)
        words = np.vectorize(lambda p: f"point {p:.0f}" if p % 10 == 0 and p < 1000 else "", otypes=[object])(places)
        np.testing.assert_array_equal(root["reason"].values.astype(object), words)
        u_T = np.where(failed, np.nan, places)[..., None] + np.arange(3.0)
        np.testing.assert_array_equal(tree["level_0"]["u_T"], u_T)
        np.testing.assert_array_equal(tree["level_0"]["sticks"], np.where(failed[..., None], -1, u_T > 5))
        np.testing.assert_array_equal(root["start_energy"], u_T[..., STARTS])


def test_axes_ascend_or_fall_and_points_are_found_by_their_labels() -> None:
    """CF wants monotonic coordinates: values that go up and down are sorted, falling ones and texts stay."""
    study = study_of(RECTANGLE, "sweep={tau: [0.02, 0.01, 0.03], nu: [0.3, 0.2], mode: grid}")
    assert [axis.labels for axis in study.axes] == [(0.01, 0.02, 0.03), (0.3, 0.2)]
    points = sweep_points(study)
    where = locate(points, {"tau": "0.02", "nu": 0.3})
    assert tuple(where.values()) == (1, 0)
    assert describe(points, where) == "tau = 0.02, nu = 0.3"
    scene = study.scenes[1 * 2 + 0]
    assert (scene.material.nu, scene.friction.b_scale) == (0.3, 0.02)
