"""What a page says of a path: the folds that a person sees, smaller turns apart."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

from tcstudy.read.study import read_study_text
from tcstudy.reports.page.container import Container
from tcstudy.reports.page.other_part import path_part
from tcstudy.reports.page.stored import read
from tcstudy.study.path_run import execute_path

PULLED = """
units: none
body: {rectangle: {width: 2, height: 1}}
boundary: {bottom: contact, left: clamped, top: {role: traction, g: [0.02, 0]}, right: free}
material: {E: 1, nu: 0.3}
friction: {law: tresca, tau: 0.01}
mesh: {maxh: 0.5}
path: {parameter: load, from: 0, to: 2, hysteresis: false}
"""


def test_turns_that_nobody_sees_are_no_folds(tmp_path: Path) -> None:
    execute_path(read_study_text(PULLED), tmp_path / "pulled.nc")
    stored = read(tmp_path / "pulled.nc")
    vertices = stored.data.sizes["vertex"] // 2 + np.arange(3)
    data = stored.data.drop_dims("fold") if "fold" in stored.data.sizes else stored.data
    data = data.assign(fold_vertex=("fold", vertices), fold_size=("fold", [0.5, 1e-4, 1e-4]))
    part = path_part(replace(stored, data=data), Container())
    assert part["folds"] == [vertices[0]]
    assert part["turns"] == 2
    assert "with 1 fold in the range asked for, 2 smaller turns" in part["verdict"]["text"]
