"""Two result files: what differs is said, the worst point by its parameters; how they were made is not."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import netCDF4
import numpy as np
import pytest

import tcstudy
from tcstudy.cli import main
from tcstudy.data.provenance import Provenance
from tcstudy.errors import StoreError, UsageError
from tests.data.by_points import write
from tests.reports.figures.draw_cases import ALPHA, FILM, TAU, level_record, point_record, study

SECTIONS = FILM | {"sweep": {"tau": [0.1, 0.2]}}


def plate(path: Path, factor: float = 1.0, seconds: float = 1.0, axes: Any = (ALPHA, TAU), mode: Any = "grid") -> Path:
    """The plate with u_T of one point on one level times a factor, and other wall times."""
    plan = study(mode, axes)
    levels = [replace(level_record(n, fields=False), time_mesh=seconds) for n in range(2)]
    points = []
    for level in levels:
        for index in np.ndindex(plan.shape):
            point = point_record(index, level)
            if index == (1, 1) and level.level == 1:
                point = replace(point, u_T=factor * point.u_T)
            points.append(replace(point, numbers={**point.numbers, "time_solve": seconds, "iterations": seconds}))
    write(path, plan, levels, points, Provenance("now", (("python", f"3.{seconds:g}"),), "abc"))
    return path


def test_wall_times_and_versions_are_no_difference(tmp_path: Path) -> None:
    found = tcstudy.compare(plate(tmp_path / "a.nc"), plate(tmp_path / "b.nc", seconds=2.0))
    assert found.equal
    assert found.versions == ("python: 3.1 | 3.2",)
    assert "hold the same results: " in found.verdict


def test_the_worst_point_is_named(tmp_path: Path) -> None:
    one = plate(tmp_path / "a.nc")
    found = tcstudy.compare(one, plate(tmp_path / "b.nc", factor=1.0 + 1e-6))
    (number,) = found.numbers
    assert (number.name, number.units, number.points, number.of) == ("level_1/u_T", "m", 1, 4)
    assert number.where == "alpha = 100 W m-2 K-1, tau = 20000000 Pa, node 7"
    assert number.relative == pytest.approx(1e-6, rel=1e-5)
    assert not found.equal
    assert found.text.count("\n") == 3
    assert tcstudy.compare(one, tmp_path / "b.nc", rtol=2e-6).equal
    below = plate(tmp_path / "c.nc", factor=1.0 + 1e-10)
    assert tcstudy.compare(one, below).equal
    assert not tcstudy.compare(one, below, rtol=0.0).equal


def test_points_are_found_by_their_labels(tmp_path: Path) -> None:
    """Of axes that go the other way, and of a list, the shared points agree where their numbers do."""
    one = plate(tmp_path / "a.nc", axes=(ALPHA,))
    turned = replace(ALPHA, values=(100, 50), labels=(100.0, 50.0))
    found = tcstudy.compare(one, plate(tmp_path / "b.nc", axes=(turned,)))
    assert found.points == (
        f"1 only in {one}: alpha = 25 W m-2 K-1",
        f"1 only in {tmp_path / 'b.nc'}: alpha = 50 W m-2 K-1",
    )
    assert {number.where.partition(",")[0] for number in found.numbers} == {"alpha = 100 W m-2 K-1"}
    listed = plate(tmp_path / "c.nc", axes=(ALPHA,), mode="list")
    assert tcstudy.compare(one, listed).equal
    other = tcstudy.compare(one, plate(tmp_path / "d.nc", axes=(TAU,)))
    assert other.study == ("swept parameters: alpha | tau",)


def test_points_that_were_not_run_are_points_that_the_other_has_alone(tmp_path: Path) -> None:
    """Of a grid with gaps, on one body and on several; named in the unit of the study."""
    body = {"parameters": {"w": "2 m"}, "body": {"rectangle": {"width": "w", "height": "1 m"}}}
    si = {**SECTIONS, "units": "SI"}
    for name, sections, key in (("one", si, "E"), ("several", si | body, "parameters.w")):
        units, values = ("Pa", (1.0, 2.0)) if key == "E" else ("mm", (2000, 2500))
        first, second = (f"{value} {units}" for value in values)
        gaps, whole = tmp_path / f"{name}-gaps.nc", tmp_path / f"{name}.nc"
        of = lambda sweep, sections=sections: tcstudy.Study.from_dict(sections | {"sweep": sweep})  # noqa: E731
        tcstudy.run(of({"tau": ["0.1 mPa"], key: [first]}), gaps, jobs=1)
        tcstudy.run(of({"tau": ["0.2 mPa"], key: [second]}), gaps, append=True, jobs=1)
        tcstudy.run(of({"tau": ["0.1 mPa", "0.2 mPa"], key: [first, second]}), whole, jobs=1)
        found = tcstudy.compare(gaps, whole)
        assert not found.numbers, found.text
        assert not found.layout
        one, two = (f"{values[k]:g} {units}" for k in (0, 1))
        assert f"2 only in {whole}: " in found.points[0]
        assert len(found.points) == 1
        swept = key.rpartition(".")[2]
        assert f"{swept} = {two}" in found.points[0]
        assert f"{swept} = {one}" in found.points[0]
        assert "tau = 0.1 mPa" in found.points[0]
        assert tcstudy.compare(gaps, gaps).equal


def test_exit_codes_and_studies(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    small = tcstudy.Study.from_dict(SECTIONS)
    names = [str(tmp_path / name) for name in ("a.nc", "b.nc", "path.nc")]
    tcstudy.run(small, names[0], jobs=1)
    tcstudy.run(small.with_({"material.nu": 0.25, "title": "Another"}), names[1], jobs=1)
    tcstudy.path(small, names[2])
    assert main(["compare", names[0], names[0]]) == 0
    assert main(["compare", names[2], names[2], "-q"]) == 0
    capsys.readouterr()
    assert main(["compare", names[0], names[1]]) == 1
    said = capsys.readouterr().out
    assert "material.nu: 0.3 | 0.25" in said
    assert "title" not in said
    assert "  lambda_1: at 2 of 2 points, worst tau = " in said
    assert main(["compare", names[0], names[1], "--json"]) == 1
    found = json.loads(capsys.readouterr().out)
    assert (found["equal"], found["files"], found["study"]) == (False, names[:2], ["material.nu: 0.3 | 0.25"])
    assert found["numbers"][0]["name"] in said
    for words in ([names[0], names[2]], [names[0], names[1], "--rtol", "-1"], [names[0], str(tmp_path / "none.nc")]):
        with pytest.raises(SystemExit) as stop:
            main(["compare", *words])
        assert stop.value.code == 2
    with pytest.raises(UsageError, match=r"of tcstudy run, .* of path"):
        tcstudy.compare(names[0], names[2])
    with pytest.raises(StoreError, match="there is no file"):
        tcstudy.compare(names[0], tmp_path / "none.nc")


def test_geometries_are_found_by_their_points(tmp_path: Path) -> None:
    """Their numbers follow the order of the sweep; what a mesh has as long as itself is compared, too."""
    sections = SECTIONS | {"parameters": {"w": 2.0}, "body": {"rectangle": {"width": "w", "height": 1.0}}}
    names = [tmp_path / f"{i}.nc" for i in range(3)]
    for name, widths in zip(names, ([2.0, 2.5], [2.5, 2.0], [2.5]), strict=True):
        swept = sections | {"sweep": {"parameters.w": widths, "tau": [0.1, 0.2]}}
        tcstudy.run(tcstudy.Study.from_dict(swept), name, jobs=1)
    found = tcstudy.compare(names[0], names[1])
    assert found.equal, found.text
    with netCDF4.Dataset(names[0], "a") as nc:
        before = found.compared
        nc["geometry_1/level_0/u_T"][0, 0] += 1e-6
    found = tcstudy.compare(names[0], names[2])
    assert not found.layout
    assert found.points == (f"2 only in {names[0]}: tau = 0.1, w = 2; tau = 0.2, w = 2",)
    assert [number.name for number in found.numbers] == ["geometry_1/level_0/u_T"]
    assert found.compared < before
