"""Files of sweeps over geometries that grow, are mended and are joined: what was there stays to the bit."""

from __future__ import annotations

import shutil
from pathlib import Path

import numpy as np
import pytest
import xarray as xr

import tcstudy
from tcstudy.data.records import PointStatus
from tcstudy.read.study import read_study_text
from tcstudy.study.append import appended
from tcstudy.study.run import execute
from tests.study.test_append import Counted
from tests.study.test_variants import BAR, HOLED, Stops

ONE = BAR.replace(", levels: 2", "")


def same(one: Path, two: Path, at: dict[str, object]) -> None:
    """The points of one file are those of the other, to the bit: numbers, and profiles of their geometries."""
    with xr.open_datatree(one) as a, xr.open_datatree(two) as b:
        for name in ("status", "energy", "u_T_max", "h_max"):
            pair = [t[name].sel({k: v for k, v in at.items() if k in t[name].dims}).values for t in (a, b)]
            assert np.array_equal(*pair), name
        inner = {name: at[name] for name in ("E",) if name in at}
        for i, j in {*zip(*(t["geometry"].sel(at).values.ravel() for t in (a, b)), strict=True)}:
            pair = [t[f"geometry_{k}/level_0"].to_dataset().sel(inner) for t, k in ((a, i), (b, j))]
            for name in ("arclength", "u_T", "xi"):
                assert np.array_equal(*(lines[name].values for lines in pair)), (name, i, j)


def right(tree: xr.DataTree) -> bool:
    """Whether all bars have their length g L/E."""
    at = tree.to_dataset().isel(level=0)
    return bool((abs(at["u_T_max"] / (1e6 * at["width"] / at["E"]) - 1.0) < 1e-10).all())


def test_files_of_geometries_grow_and_are_mended(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """New lengths, and new moduli at old ones, are added, also after a stop; what was there stays to the bit."""
    path, before, counted = tmp_path / "out.nc", tmp_path / "before.nc", Counted(monkeypatch)
    execute(read_study_text(ONE, "s", ["sweep={body.rectangle.width: [400 mm, 100 mm], E: [70 GPa]}"]), path)
    shutil.copy(path, before)
    more = read_study_text(ONE, "s", ["sweep={body.rectangle.width: [0.1, 0.2], E: [70 GPa, 35 GPa]}"])
    study, kept = appended(path, more)
    with pytest.raises(KeyboardInterrupt):
        execute(study, path, Stops(2), kept=kept)
    assert counted.points == 2 + 3
    tree = tcstudy.run(more, path, append=True)
    assert counted.points == 2 + 3  # the stop came when all were solved
    assert tree["status"].isel(level=0).sel(width=0.4).values.tolist() == [int(PointStatus.OK), 0]
    same(before, path, {"width": [0.4, 0.1], "E": [70e9]})
    assert right(tcstudy.run(read_study_text(ONE), path, append=True))
    assert counted.points == 6
    same(before, path, {"width": [0.4, 0.1], "E": [70e9]})
    assert sorted(one.name for one in tmp_path.iterdir()) == ["before.nc", "out.nc"]


def test_what_is_refused_stays_so_where_a_file_grows(tmp_path: Path) -> None:
    path = tmp_path / "a.nc"
    execute(read_study_text(HOLED, "s", ["sweep={parameters.height: [8 mm, 30 mm]}"]), path)
    tree = tcstudy.run(read_study_text(HOLED, "s", ["sweep={parameters.height: [10 mm, 20 mm]}"]), path, append=True)
    refused = int(PointStatus.MESH_FAILED)
    assert tree["height"].values.tolist() == [0.008, 0.01, 0.02, 0.03]
    assert tree["status"].values[:, 0].tolist() == [refused, refused, 1, 1]
    assert str(tree["reason"].values[0, 0]).startswith("body.holes[0]: the hole")
