"""The held ends of the contact line in a file: what clamped edges prescribe there, against the
solved body."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import tcstudy
from tcstudy.read.study import read_study_text

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
def test_their_slip_is_that_of_the_body(
    tmp_path: Path, changes: list[str], ends: list[tuple[Any, Any]]
) -> None:
    """u_T of the file is t·u of the solved body there, t along the exact edge in the direction of
    the line."""
    tree = tcstudy.run(read_study_text(TEXT, "s", changes), tmp_path / "out.nc")
    for level in ("level_0", "level_1"):
        data = {name: one.values for name, one in tree[level].variables.items()}
        assert np.allclose(
            np.column_stack([data["held_x"], data["held_y"]]), [at for at, _ in ends]
        )
        for k, ((x, y), t) in enumerate(ends):
            node = int(np.argmin(np.hypot(data["node_x"] - x, data["node_y"] - y)))
            slip = (t[0] * data["u_x"][node] + t[1] * data["u_y"][node]) / np.hypot(*t)
            assert data["held_u_T"][k] == pytest.approx(slip, abs=1e-14)
            assert data["held_arclength"][k] == pytest.approx(2.0 * (x == 2.0), abs=1e-12)
