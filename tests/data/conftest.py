"""A small study and records with known, pairwise different numbers."""

import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tcstudy.data import schema
from tcstudy.data.records import BlockRecord, LevelRecord
from tcstudy.data.schema import PointStatus
from tcstudy.scene.mesh_plan import MeshPlan
from tcstudy.scene.solver_plan import SolverPlan
from tcstudy.scene.study import Axis, OutputPlan, Study
from tests.data.by_points import write

NODES = (3, 6)
ALPHA = Axis("alpha", ("heat", "alpha"), (25, 100), (25.0, 100.0), "W m-2 K-1")
THETA_BAR = Axis("theta_bar", ("heat", "theta_bar"), (0, 20, 40), (0.0, 20.0, 40.0), "K")
FRICTION = Axis("friction", ("friction",), ({}, {}), ("tresca", "slip weakening"), "1")
NUMBERS = sorted(
    v.name
    for v in schema.ROOT
    if v.dims[:2] == schema.POINT_LEVEL and v.name not in ("status", "reason")
)


def make_study(**other: Any) -> Study:
    plans = (MeshPlan((0.1,), 2), SolverPlan(), OutputPlan())
    text, axes = "title: Bärenstark\nsweep:\n  alpha: [25, 100]\n", (ALPHA, THETA_BAR, FRICTION)
    study = Study("Bärenstark", text, None, "SI", "grid", axes, (), *plans, "Institute of Friction")
    return replace(study, **{"overrides": ("mesh.levels=2",), **other})


def make_level(level: int, fields: bool = False) -> LevelRecord:
    m = NODES[level]
    s = np.linspace(0.0, 1.0, m)
    corners = {
        "node_x": np.array([0.0, 1.0, 1.0, 0.0]),
        "node_y": np.array([0.0, 0.0, 1.0, 1.0]) + level,
    }
    mesh = {**corners, "triangle": np.array([[0, 1, 2], [0, 2, 3]], dtype=np.int32)}
    line = (
        s,
        s + 1.0,
        0.0 * s - 2.0,
        np.full(m, 1.0 / m),
        np.array([0] * (m - 1) + [1], dtype=np.int8),
    )
    sizes = (level, 0.1 / 2**level, 40 * 4**level, m)
    return LevelRecord(
        *sizes, *line, ("film", "pad_2"), 0.25 + level, 0.5 + level, mesh if fields else {}
    )


def make_block(
    level: int, *places: int, shape: tuple[int, ...] = (2, 3, 2), fields: bool = False, **other: Any
) -> BlockRecord:
    """The points at these places, or all; every number is different, and not exact in single
    precision."""
    points = np.array(places or range(math.prod(shape)), dtype=np.intp)
    seed = points + 1000.0 * level + 0.1
    types = {v.name: (v.dtype, v.dims[-1] == "start") for v in schema.ROOT}
    numbers = {}
    for k, name in enumerate(NUMBERS):
        dtype, by_start = types[name]
        own = {"f8": seed + k / 64.0, "i4": np.floor(seed) + k, "i1": (np.floor(seed) + k) % 2}[
            dtype
        ]
        numbers[name] = (
            own[:, None] + 0.25 * np.arange(len(schema.START_NAMES)) if by_start else own
        )
    nodes = np.arange(NODES[level])
    bodies = {
        name: seed[:, None] + np.arange(4.0) * (k + 1)
        for k, name in enumerate(("theta", "u_x", "u_y"))
    }
    status = np.full(len(points), PointStatus.OK, dtype=np.int8)
    block = BlockRecord(
        *(level, shape, points, status, {}, numbers),
        u_T=seed[:, None] + nodes / 3.0,
        xi=-seed[:, None] + nodes / 7.0,
        sticks=((nodes + points[:, None]) % 2).astype(np.int8),
        fields=bodies if fields else {},
    )
    return replace(block, **other)


def failed(place: int, level: int, reason: str) -> BlockRecord:
    status = np.array([PointStatus.SINGULAR], dtype=np.int8)
    none = {"u_T": None, "xi": None, "sticks": None, "numbers": {"time_solve": np.array([0.125])}}
    return make_block(level, place, status=status, reasons={0: reason}, **none)


@pytest.fixture
def study() -> Study:
    return make_study()


@pytest.fixture
def levels() -> tuple[LevelRecord, ...]:
    return make_level(0), make_level(1)


@pytest.fixture
def output(tmp_path: Path) -> Path:
    return tmp_path / "results" / "study.nc"


@pytest.fixture
def written(output: Path, study: Study, levels: tuple[LevelRecord, ...]) -> Path:
    """The file of the study with all points."""
    write(output, study, levels, (make_block(0), make_block(1)))
    return output
