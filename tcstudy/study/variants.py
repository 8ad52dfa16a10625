"""A sweep over geometries at work: one run after the other, each with its meshes and factors, then one file of all.

A run of a geometry is a run like any other, with a file and a journal of its own in a folder beside the output; what is
finished there stays, so that a stopped sweep goes on within the geometry where it was. The folder goes when the file of
all geometries stands.
"""

from __future__ import annotations

import re
import shutil
from collections.abc import Iterable, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from tcstudy.data.files import StoreError
from tcstudy.data.provenance import collect, holds, identity
from tcstudy.data.records import BlockRecord, LevelRecord, PointStatus
from tcstudy.data.variants import write_variants
from tcstudy.data.writer import axis_problems
from tcstudy.errors import GeometryFailed
from tcstudy.scene.study import Study, Variant
from tcstudy.study.expected import Resources, of_run
from tcstudy.study.grow import Kept
from tcstudy.study.plan import Plan
from tcstudy.study.plan import plan as plan_of
from tcstudy.study.run import LevelWork, Summary, Watcher, execute
from tcstudy.study.workshop import all_failed


def execute_variants(
    study: Study,
    output: Path,
    watcher: Watcher,
    command: Sequence[str],
    jobs: int | None,
    dask: str | None,
    kept: Kept | None = None,
) -> Summary:
    """Run all geometries and join their files.

    kept: what the output has of the study already and keeps
    Raises as `execute`; a geometry without a mesh is a status of its points.
    """
    if problems := axis_problems(study):
        raise StoreError("; ".join(problems))
    folder = output.with_name(f"{output.name}.geometries")
    todo = np.ones((len(study.scenes), study.mesh.levels), dtype=bool) if kept is None else kept.todo
    one = _OneSweep(study, watcher, todo)
    folder.mkdir(parents=True, exist_ok=True)
    before = [None] * len(study.variants) if kept is None else kept.of_geometries(study, folder)
    files: list[Path | None] = []
    failed = [] if kept is None else kept.without_geometry(study)
    for number, (variant, own) in enumerate(zip(study.variants, before, strict=True)):
        file, reason = folder / (f"{number}.nc" if own is None else f"{own.mark[:16]}-{number}.nc"), variant.reason
        if variant.study is not None:
            one.variant = variant
            try:
                if not _finished(file, variant.study):
                    _grow(variant.study, file, one, command, jobs, dask, own)
            except GeometryFailed as error:
                reason = str(error)
        files.append(None if reason else file)
        if reason:
            wanted = todo[variant.places]
            for level in np.flatnonzero(wanted.any(axis=0)).tolist():
                at, status = variant.places[wanted[:, level]], PointStatus.MESH_FAILED
                failed.append(all_failed(study, level, at, status, reason))
                watcher.block(failed[-1])
    provenance = collect(study, command)
    provenance = provenance if kept is None else kept.before(provenance)
    points, bad = write_variants(output, study, files, failed, provenance)
    shutil.rmtree(folder, ignore_errors=True)
    return Summary(output, points, bad, one.resumed)


def _grow(
    study: Study,
    file: Path,
    watcher: Watcher,
    command: Sequence[str],
    jobs: int | None,
    dask: str | None,
    kept: Kept | None,
) -> None:
    """The file of one geometry; without a mesh where nothing is left to solve."""
    if kept is None or kept.todo.any() or study.output.live:
        execute(study, file, watcher, command, jobs, dask, kept)
    else:
        kept.write(file, study, collect(study, command))


def _finished(file: Path, study: Study) -> bool:
    """Whether the file of a geometry stands; one of another study or version is made again."""
    try:
        return holds(file, identity("run", study))
    except StoreError:
        file.unlink()
        return False


class _OneSweep:
    """Shows the runs of all geometries as one."""

    def __init__(self, study: Study, watcher: Watcher, todo: NDArray[np.bool_]) -> None:
        """todo: (points, levels) which solutions are sought."""
        self._study, self._watcher, self._begun = study, watcher, False
        self._todo = todo.sum(axis=0).tolist()
        self.variant: Variant = study.variants[0]
        self.resumed = 0

    def begin(self, work: Sequence[LevelWork], warnings: Sequence[str]) -> None:
        """The first geometry stands for all."""
        self.resumed += sum(level.done for level in work)
        if not self._begun:
            whole = [replace(level, points=points) for level, points in zip(work, self._todo, strict=True)]
            self._watcher.begin(whole, warnings)
        self._begun = True

    def level(self, record: LevelRecord) -> None:
        """A level of the geometry at work."""
        self._watcher.level(record)

    def block(self, record: BlockRecord) -> None:
        """Points of it, by their places in the whole sweep."""
        points, shape = self.variant.places[record.points], self._study.shape
        self._watcher.block(replace(record, points=points, shape=shape, u_T=None, xi=None, sticks=None, fields={}))


def plan_variants(study: Study) -> tuple[Plan, Resources]:
    """The forecast of all geometries, with the meshes of the largest, and what a run takes."""
    found = [(one.study, plan_of(one.study)) for one in study.variants if one.study is not None]
    spent = [of_run(own, plan.levels, plan.factorisations, plan.heat_solves) for own, plan in found]
    largest = max((plan for _, plan in found), key=lambda plan: plan.levels[-1].n_dof)
    factors, meshes = sum(plan.factorisations for _, plan in found), sum(own.mesh.levels for own, _ in found)
    note = (
        f"{len(found)} {'geometry' if len(found) == 1 else 'geometries'}, one after the other: {meshes} meshes, "
        f"{factors * study.mesh.levels} stiffness factorisations; the points of a geometry share both. "
        "Sizes are those of the largest"
    )
    refused = [f"refused, {one.words}: {one.reason}" for one in study.variants if one.study is None]
    plan = replace(
        largest,
        points=len(study.scenes),
        factorisations=factors,
        heat_solves=sum(plan.heat_solves for _, plan in found),
        notes=(note, *refused, *_once(note for _, plan in found for note in plan.notes)),
        bytes=sum(plan.bytes for _, plan in found),
    )
    return plan, Resources(sum(one.seconds for one in spent), max(one.memory for one in spent))


NUMBER = re.compile(r"\d+(?:\.\d+)?(?:e[+-]?\d+)?")


def _once(notes: Iterable[str]) -> list[str]:
    """Every note once; of those that differ in numbers only one, with the least and the greatest of each."""
    alike: dict[str, list[list[str]]] = {}
    for note in dict.fromkeys(notes):
        alike.setdefault(NUMBER.sub("{}", note.replace("{", "{{").replace("}", "}}")), []).append(NUMBER.findall(note))
    return [words.format(*map(_span, zip(*numbers, strict=True))) for words, numbers in alike.items()]


def _span(texts: Sequence[str]) -> str:
    least, greatest = min(texts, key=float), max(texts, key=float)
    return least if least == greatest else f"{least} to {greatest}"
