"""Measure the convergence of a study into its file: of one body, or of every geometry of a sweep."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from tcstudy.data.files import check_writable
from tcstudy.data.measured import Convergence, PointConvergence, write_convergence
from tcstudy.data.provenance import collect, tell
from tcstudy.data.records import PointStatus
from tcstudy.data.writer import geometry_place, outer_axes
from tcstudy.errors import ConvergenceError, GeometryFailed, StoreError
from tcstudy.scene.study import Study, Variant
from tcstudy.study.convergence import of_body
from tcstudy.study.plan import once, warnings
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
    convergence = converge(study, say, length)
    write_convergence(path, study, convergence, collect(study, command, remarks=remarks))
    return sum(status != PointStatus.OK for point in convergence.points for status in point.status)


def converge(study: Study, say: Say = lambda text: None, length: Length = BARE) -> Convergence:
    """The convergence of a study.

    say: called with a line of text as work goes on;  length: how that has h
    Raises GeometryFailed if the body cannot be meshed, of several geometries if none can.
    """
    return (_of_geometries if study.variants else of_body)(study, say, length)


def _of_geometries(study: Study, say: Say, length: Length) -> Convergence:
    """The convergence of all geometries, each measured on its own levels.

    Raises GeometryFailed if none has a mesh.
    """
    found: list[tuple[Variant, Convergence]] = []
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
    index = [tuple(int(i) for i in np.unravel_index(place, study.shape)) for place in range(len(study.scenes))]
    none = (PointStatus.MESH_FAILED,) * study.mesh.levels
    points = [
        replace(point, index=index[place])
        for variant, one in found
        for place, point in zip(variant.places, one.points, strict=True)
    ]
    points += [PointConvergence(index[place], none, {}, {}) for variant, _ in lost for place in variant.places]
    sizes = study.shape if study.mode != "grid" else tuple(len(axis.values) for axis in outer_axes(study))
    by_level: dict[str, Any] = {}
    for name, missing in (("h_max", np.nan), ("n_dof", -1), ("n_contact", -1), ("compared", False)):
        kind = getattr(found[0][1], name).dtype
        by_level[name] = np.full((*sizes, study.mesh.levels), missing, dtype=kind)
        for variant, one in found:
            by_level[name][geometry_place(study, variant)] = getattr(one, name)
    words = list(dict.fromkeys(one.reference for _, one in found))
    notes = [f"refused, {variant.words}: {reason}" for variant, reason in lost]
    notes += map(str, once([(variant.words, one.notes) for variant, one in found]))
    return Convergence(reference="; or ".join(words), points=tuple(points), notes=tuple(notes), **by_level)
