"""Measure the convergence of a study into its file: of one body, or of every geometry of a sweep."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from tcstudy.data.files import check_writable
from tcstudy.data.measured import LEVELS, Measured, convergence_record
from tcstudy.data.provenance import collect, tell
from tcstudy.data.records import PointStatus
from tcstudy.data.store import missing, write_record
from tcstudy.data.writer import geometry_place, outer_axes
from tcstudy.errors import ConvergenceError, GeometryFailed, StoreError
from tcstudy.scene.study import Study, Variant
from tcstudy.study.convergence import of_body
from tcstudy.study.lint import once, warnings
from tcstudy.study.solved_levels import BARE, Length, Say


def converge_to_file(
    study: Study, path: Path, say: Say, command: Sequence[str] = ("tcstudy",), length: Length = BARE
) -> int:
    """Measure the convergence of a study into a file; returns the number of solutions that failed.

    Raises ConvergenceError if the study's levels do not suit, StoreError if the file cannot be written, GeometryFailed
    if the body cannot be meshed.
    """
    if study.mesh.levels < 2:
        raise ConvergenceError("one level has no convergence; give mesh.levels: 4 or more, or --set mesh.levels=4")
    if study.mesh.strategy.adapts:
        what = "adaptive meshes have no common h to show rates over, and they come with their own error estimates"
        raise ConvergenceError(f"{what}; use tcstudy run or tcstudy cost, or --set mesh.family=uniform")
    if problems := check_writable(path, 1_000_000):
        raise StoreError("; ".join(problems))
    tell(remarks := warnings(study))
    measured = converge(study, say, length)
    write_record(path, study, convergence_record(study, measured), collect(study, command, remarks=remarks))
    return int(np.count_nonzero([point["status"] != PointStatus.OK for point in measured.points]))


def converge(study: Study, say: Say = lambda text: None, length: Length = BARE) -> Measured:
    """The convergence of a study.

    say: called with a line of text as work goes on;  length: how that has h
    Raises GeometryFailed if the body cannot be meshed, of several geometries if none can.
    """
    return (_of_geometries if study.variants else of_body)(study, say, length)


def _of_geometries(study: Study, say: Say, length: Length) -> Measured:
    """The convergence of all geometries, each measured on its own levels.

    Raises GeometryFailed if none has a mesh.
    """
    found: list[tuple[Variant, Measured]] = []
    lost: list[tuple[Variant, str]] = []
    for variant in study.variants:
        reason = variant.reason
        if variant.study is not None:
            say(f"{variant.words}:")
            try:
                found.append((variant, of_body(variant.study, say, length)))
            except GeometryFailed as error:
                reason = str(error)
        if reason:
            lost.append((variant, reason))
    if not found:
        raise GeometryFailed(f"no geometry of the sweep has a mesh ({lost[0][0].words}: {lost[0][1]})", ("sweep",))
    none = {"status": np.full(study.mesh.levels, PointStatus.MESH_FAILED, dtype=np.int8)}
    points: list[Mapping[str, Any]] = [none] * len(study.scenes)
    sizes = study.shape if study.mode != "grid" else tuple(len(axis.values) for axis in outer_axes(study))
    meshes = {v.name: missing(v, (*sizes, study.mesh.levels)) for v in LEVELS}
    for variant, one in found:
        for place, point in zip(variant.places, one.points, strict=True):
            points[place] = point
        for name, values in meshes.items():
            values[geometry_place(study, variant)] = one.meshes[name]
    words = list(dict.fromkeys(one.reference for _, one in found))
    notes = [f"refused, {variant.words}: {reason}" for variant, reason in lost]
    notes += map(str, once([(variant.words, one.notes) for variant, one in found]))
    return Measured(points, meshes, "; or ".join(words), notes)
