"""The held ends of the contact line in a file: what clamped edges prescribe there, against the solved body."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray as xr

import tcstudy
from tcstudy.read.study import read_study_text
from tcstudy.reports.page.write import write_page
from tests.reports.page.unpacked import data_of

TEXT = """
units: none
body: {outline: [{from: [0, 0], edge: low}, {from: [2, 0], edge: bend}, {from: [2, 1], edge: right},
  {from: [1.8, 2], edge: top}, {from: [-0.3, 2], edge: left}]}
boundary: {low: contact, bend: contact, right: free, top: free, left: clamped}
material: {E: 1, nu: 0.3}
friction: {law: tresca, tau: 0.01}
mesh: {maxh: 0.5, levels: 2}
output: {fields: true}
"""
ARC = """[{from: [0, 0], through: [1, -0.4], edge: low}, {from: [2, 0], edge: bend}, {from: [2, 2], edge: top},
  {from: [0, 2], edge: left}]"""
ROUND = "boundary={low: contact, bend: free, top: free, left: {role: clamped, u_x: 0.1}}"
RIGHT, UP, STEEP = (1.0, 0.0), (0.0, 1.0), (1.05, -1.0)
CORNERS = [((0.0, 0.0), RIGHT), ((2.0, 0.0), RIGHT), ((2.0, 0.0), UP)]


@pytest.mark.parametrize(
    ("changes", "ends"),
    [
        (["boundary.left={role: clamped, u: [0.1, 0]}"], CORNERS),
        (["boundary.left={role: clamped}"], CORNERS),
        (["boundary.left={role: clamped, u_N: 0.05}"], CORNERS),
        (["boundary.bend={role: clamped, u_y: 0, u_x: '0.2 + y + x/10'}"], CORNERS[:2]),
        (["boundary.bend={role: clamped, u_y: 0}", "boundary.left={role: clamped}"], CORNERS[:1]),
        ([f"body={{outline: {ARC}}}", ROUND], [((0.0, 0.0), STEEP)]),
    ],
)
def test_their_slip_is_that_of_the_body(tmp_path: Path, changes: list[str], ends: list[tuple[Any, Any]]) -> None:
    """u_T of the file is t·u of the solved body there, t along the exact edge in the direction of the line."""
    tree = tcstudy.run(read_study_text(TEXT, "s", changes), tmp_path / "out.nc")
    for level in ("level_0", "level_1"):
        data = {name: one.values for name, one in tree[level].variables.items()}
        assert np.allclose(np.column_stack([data["held_x"], data["held_y"]]), [at for at, _ in ends])
        for k, ((x, y), t) in enumerate(ends):
            node = int(np.argmin(np.hypot(data["node_x"] - x, data["node_y"] - y)))
            slip = (t[0] * data["u_x"][node] + t[1] * data["u_y"][node]) / np.hypot(*t)
            assert data["held_u_T"][k] == pytest.approx(slip, abs=1e-14)
            assert data["held_arclength"][k] == pytest.approx(2.0 * (x == 2.0), abs=1e-12)


def test_files_that_grow_have_them_at_all_points(tmp_path: Path) -> None:
    """Of one run and of one that grew: the same values in the order of the file."""
    sweep = "sweep={boundary.left.u_x: [%s]}"
    start = ["output.fields=false", "boundary.left={role: clamped}"]
    studies = [read_study_text(TEXT, "s", [*start, sweep % values]) for values in ("0.1, 0.3", "0.2", "0.2, 0.1, 0.3")]
    one, whole = (tmp_path / f"{name}.nc" for name in "ab")
    tcstudy.run(studies[0], one)
    tcstudy.run(studies[2], whole)
    tcstudy.run(studies[1], one, append=True)
    for path in (whole, one):
        with xr.open_datatree(path) as tree:
            moved = tree["boundary_left_u_x"].values
            for level in ("level_0", "level_1"):
                assert np.array_equal(tree[level]["held_u_T"].values[:, 0], moved), path.name
    write_page(whole, tmp_path / "page.html")
    line = data_of(tmp_path / "page.html")["lines"]["1"]
    assert [part["ends"] for part in line["parts"]] == [[0, 1], [2, -1]]
    rows = line["held_u_T"]
    assert np.allclose(rows["rows"][:, 0] * rows["scale"], [0.1, 0.2, 0.3], rtol=1e-4)


def test_a_line_without_held_ends_has_none_of_it(tmp_path: Path) -> None:
    free = ["boundary={low: contact, bend: free, right: clamped, top: free, left: free}"]
    tree = tcstudy.run(read_study_text(TEXT, "s", free), tmp_path / "out.nc")
    assert not [name for name in tree["level_0"].variables if "held" in str(name)]
