"""A small study and records with known, pairwise different numbers."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Literal

import numpy as np
import pytest

from tcstudy.data import schema
from tcstudy.data.records import LevelRecord, PointStatus
from tcstudy.data.schema import FileVariable
from tcstudy.scene.study import Axis, MeshPlan, OutputPlan, SolverPlan, Study
from tests.data.by_points import PointRecord, write

TEXT = "title: Bärenstark\nsweep:\n  alpha: [25, 100]\n"
NODES = (3, 6)

ALPHA = Axis("alpha", ("heat", "alpha"), (25, 100), (25.0, 100.0), "W m-2 K-1")
THETA_BAR = Axis("theta_bar", ("heat", "theta_bar"), (0, 20, 40), (0.0, 20.0, 40.0), "K")
FRICTION = Axis("friction", ("friction",), ({}, {}), ("tresca", "slip weakening"), "1")


def make_study(mode: Literal["grid", "list"] = "grid", axes: tuple[Axis, ...] = (ALPHA, THETA_BAR, FRICTION)) -> Study:
    return Study(
        title="Bärenstark",
        text=TEXT,
        source=None,
        units="SI",
        mode=mode,
        axes=axes,
        scenes=(),
        mesh=MeshPlan((0.1,), 2),
        solver=SolverPlan(),
        output=OutputPlan(),
        institution="Institute of Friction",
        overrides=("mesh.levels=2",),
    )


def make_level(level: int, fields: bool = False) -> LevelRecord:
    m = NODES[level]
    s = np.linspace(0.0, 1.0, m)
    mesh = {
        "node_x": np.array([0.0, 1.0, 1.0, 0.0]),
        "node_y": np.array([0.0, 0.0, 1.0, 1.0]) + level,
        "triangle": np.array([[0, 1, 2], [0, 2, 3]], dtype=np.int32),
    }
    return LevelRecord(
        level=level,
        h_max=0.1 / 2**level,
        n_dof=40 * 4**level,
        n_contact=m,
        arclength=s,
        x=s + 1.0,
        y=0.0 * s - 2.0,
        c=np.full(m, 1.0 / m),
        edge=np.array([0] * (m - 1) + [1], dtype=np.int8),
        edge_names=("film", "pad_2"),
        time_mesh=0.25 + level,
        time_assemble=0.5 + level,
        fields=mesh if fields else {},
    )


def make_number(variable: FileVariable, seed: float, k: int) -> float | tuple[float, ...]:
    """A flag, a count or a float; several of them where there is one for each start."""
    if variable.dtype == "i1":
        return int(seed + k) % 2
    value = float(int(seed) + k) if variable.dtype == "i4" else seed + k / 64.0
    by_start = tuple(value + 0.25 * i for i in range(len(schema.START_NAMES)))
    return by_start if variable.dims[-1] == "start" else value


def make_point(index: tuple[int, ...], level: int, fields: bool = False) -> PointRecord:
    """Every number of every record is different, and not exactly representable in single precision."""
    seed = float(sum(i * 10**k for k, i in enumerate(index))) + 1000.0 * level + 0.1
    own = [v for v in schema.ROOT if v.dims[:2] == schema.POINT_LEVEL and v.name not in ("status", "reason")]
    numbers = {v.name: make_number(v, seed, k) for k, v in enumerate(sorted(own, key=lambda v: v.name))}
    m = NODES[level]
    bodies = {n: seed + np.arange(4.0) * (k + 1) for k, n in enumerate(("theta", "u_x", "u_y"))} if fields else {}
    return PointRecord(
        index,
        level,
        PointStatus.OK,
        "",
        numbers,
        seed + np.arange(m) / 3.0,
        -seed + np.arange(m) / 7.0,
        bodies,
        ((np.arange(m) + int(seed)) % 2).astype(np.int8),
    )


def long(point: PointRecord, shift: float, m: int = 20000) -> PointRecord:
    """The point with so many words that writing it takes its time."""
    return replace(point, reason=f"{shift:.9f} ".rjust(17) * m)


def failed(index: tuple[int, ...], level: int, reason: str) -> PointRecord:
    return PointRecord(index, level, PointStatus.SINGULAR, reason, {"time_solve": 0.125}, np.empty(0), np.empty(0))


@pytest.fixture
def study() -> Study:
    return make_study()


@pytest.fixture
def list_study() -> Study:
    short = (
        replace(ALPHA, values=(25, 100), labels=(100.0, 25.0)),
        replace(FRICTION, labels=("tresca", "decay")),
    )
    return make_study("list", short)


@pytest.fixture
def levels() -> tuple[LevelRecord, ...]:
    return tuple(make_level(n) for n in range(2))


@pytest.fixture
def points(study: Study) -> list[PointRecord]:
    return [make_point(index, n) for n in range(2) for index in np.ndindex(study.shape)]


@pytest.fixture
def output(tmp_path: Path) -> Path:
    return tmp_path / "results" / "study.nc"


@pytest.fixture
def written(output: Path, study: Study, levels: tuple[LevelRecord, ...], points: list[PointRecord]) -> Path:
    """The file of the study with all points."""
    write(output, study, levels, points)
    return output
