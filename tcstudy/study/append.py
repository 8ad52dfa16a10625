"""Finished files that grow: points are added to them, those that broke down are solved again.

Points are found by the labels of their swept parameters, so that a list and a grid, axes in another order and sweeps
that overlap have their points in common. What a file has is read back as records, as a run finds in its journal what
one that was stopped has left, and written again, to the bit; of a sweep over geometries every geometry by itself.

The study of both is the newer one if its sweep has the points of the file, as it has when the sweep has grown; else it
is one of its own: the text of the newer one with the option `sweep={…}`, as `--set` would put it: the grid of the
values of two grids, with a list the list of all points.
"""

from __future__ import annotations

import itertools
import json
import operator
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import ExitStack
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from tcstudy.data.files import attributes
from tcstudy.data.provenance import Kind, holds, study_sha256
from tcstudy.data.reading import opened, read_blocks, read_level
from tcstudy.data.records import BlockRecord, LevelRecord
from tcstudy.data.schema import PointStatus
from tcstudy.errors import StoreError, StudyError, shortened
from tcstudy.read.document import changes, with_sweep
from tcstudy.read.study import read_study_text
from tcstudy.scene.study import Axis, Study

if TYPE_CHECKING:
    import netCDF4

Places = NDArray[np.intp]
Keys = tuple[str, ...]


def appended(path: Path, new: Study) -> tuple[Study, Kept]:
    """The study with the points of a finished file and of `new`, and what the file has of it.

    Raises StoreError if they differ in more than the sweep.
    """
    old = stored_study(path, new.source)
    if found := differences(old, new):
        remedy = "give another --output, or --force to compute all anew"
        raise StoreError(f"{path} holds another study, not only another sweep ({'; '.join(found[:5])}); {remedy}")
    study = merge_studies(old, new)
    return study, Kept.of(path, old, study)


def stored_study(path: Path, source: Path | None = None, kind: Kind = "run") -> Study:
    """The study of a file of this kind. source: file of a study beside which its geometry lies, if any.

    Raises StoreError if it is of another, was computed by another version, or if its study cannot be read again.
    """
    found = attributes(path)
    holds(path, kind, None)
    overrides = tuple(filter(None, str(found["overrides"]).split("\n")))
    try:
        study = read_study_text(str(found["study_yaml"]), str(path), overrides, source)
    except StudyError as error:
        what = shortened(str(error).splitlines()[0], 300)
        raise StoreError(
            f"the study in {path} cannot be read again ({what}); a geometry must be in its place"
        ) from error
    if study.scenes[0].body.brep is not None and study_sha256(study) != found["study_sha256"]:
        raise StoreError(f"{path} was computed for another geometry file; run its study again with --force")
    if study.mesh.open_ended:
        why = "its meshes follow from the solutions at all points of its sweep"
        raise StoreError(f"{path} cannot be added to: {why}; run the whole study with --force")
    return study


@dataclass(frozen=True, eq=False)
class Kept:
    """What a finished file has of a study, and what is still to be solved.

    todo:   (P, levels) points that are not there, or broke down unexpectedly
    stored: the study of the file; None where nothing is kept
    """

    study: Study
    todo: NDArray[np.bool_]
    path: Path = Path()
    stored: Study | None = None

    @classmethod
    def of(cls, path: Path, stored: Study, study: Study) -> Kept:
        """What failed by its own numbers would fail again; on meshes that follow from solutions all points stay."""
        with opened(path) as nc:
            again = np.isin(nc["status"][...], (PointStatus.NOT_RUN, PointStatus.ERROR)) & (not study.mesh.open_ended)
        todo = np.ones((len(study.scenes), study.mesh.levels), dtype=bool)
        todo[places_in(study, stored)] = again.reshape(-1, again.shape[-1])
        return cls(study, todo, path, stored)

    @classmethod
    def none(cls, study: Study) -> Kept:
        return cls(study, np.ones((len(study.scenes), study.mesh.levels), dtype=bool))

    @cached_property
    def _file(self) -> ExitStack:
        return ExitStack()

    @cached_property
    def _groups(self) -> dict[int | None, tuple[netCDF4.Dataset, Study]]:
        """The file and its study; of every body of the study that it has, its group there and its study there."""
        if self.stored is None:
            return {}
        nc = self._file.enter_context(opened(self.path))
        found: dict[int | None, tuple[netCDF4.Dataset, Study]] = {None: (nc, self.stored)}
        if not self.study.variants:
            return found | {0: (nc, self.stored)}
        numbers = np.full(len(self.study.scenes), -1)  # of the groups that points belong to, −1 for none
        numbers[places_in(self.study, self.stored)] = nc["geometry"][...].ravel()
        for i, body in enumerate(self.study.bodies):
            if (n := int(numbers[body.places].max())) >= 0 and (own := self.stored.bodies[n].study) is not None:
                found[i] = nc[f"geometry_{n}"], own
        return found

    def levels(self, number: int) -> list[LevelRecord]:
        """The levels of a body of the study, as a run found them."""
        if number not in self._groups:
            return []
        nc, _ = self._groups[number]
        return [read_level(nc, group) for group in nc.groups.values()]

    def blocks(self, number: int) -> Iterator[BlockRecord]:
        """The points of a body that stay."""
        body = self.study.bodies[number]
        if number in self._groups and body.study is not None:
            nc, own = self._groups[number]
            yield from read_blocks(nc, body.study, places_in(body.study, own), ~self.todo[body.places])

    def before(self, attributes: Mapping[str, Any], number: int | None = None) -> Mapping[str, Any]:
        """The attributes of a run, or of one of its geometries, with the file's history before its own."""
        if number not in self._groups:
            return attributes
        return {**attributes, "history": f"{self._groups[number][0].getncattr('history')}\n{attributes['history']}"}

    def close(self) -> None:
        """Close the file, which stays open once something of it was asked for: with many groups opening takes long."""
        self._file.close()


def places_in(study: Study, other: Study) -> Places:
    """(P,) where the points of another study with the same axes stand in this one, in C order of both; −1: nowhere."""
    if not study.axes:
        return np.zeros(1, dtype=np.intp)
    paths, labels = [axis.path for axis in study.axes], operator.attrgetter("labels")
    own = {point: i for i, point in enumerate(_points(study, paths, labels))}
    return np.array([own.get(point, -1) for point in _points(other, paths, labels)], dtype=np.intp)


def _points(study: Study, paths: Sequence[Keys], of: Callable[[Axis], Iterable[Any]]) -> Iterator[tuple[Any, ...]]:
    """What every point has of the axes of these parameters, in C order of the points."""
    at = [next(i for i, axis in enumerate(study.axes) if axis.path == path) for path in paths]
    every = itertools.product if study.mode == "grid" else zip
    return (tuple(point[i] for i in at) for point in every(*map(of, study.axes)))


def merge_studies(old: Study, new: Study) -> Study:
    """The study with the points of both; one of the two where it has them all. Raises StoreError, StudyError.

    Title, output and the like are those of the new one.
    """
    for one, other in ((new, old), (old, new)):
        if np.all(places_in(one, other) >= 0):
            return one
    if old.design is not None or new.design is not None:
        keep = "keep mode, seed and distributions, and double the points of a latin-hypercube"
        raise StoreError(f"the points of the file are not the first of this design; {keep}, or give another --output")
    if old.mode == new.mode == "grid":
        columns = [[*dict([*one.labelled(), *_axis(new, one.path).labelled()]).items()] for one in old.axes]
    else:
        every = (
            point for study in (old, new) for point in _points(study, [one.path for one in old.axes], Axis.labelled)
        )
        points = {tuple(label for label, _ in point): point for point in every}
        columns = [[*column] for column in zip(*points.values(), strict=True)]
    pairs = [zip(*column, strict=True) for column in columns]
    axes = [replace(axis, labels=labels, values=values) for axis, (labels, values) in zip(old.axes, pairs, strict=True)]
    name = str(new.source) if new.source is not None else "<text>"
    mode = "grid" if old.mode == new.mode == "grid" else "list"
    return read_study_text(new.text, name, with_sweep(new.overrides, mode, axes), new.source)


def _axis(study: Study, path: Keys) -> Axis:
    """The axis of a parameter."""
    return next(axis for axis in study.axes if axis.path == path)


DECIDE_NOTHING = ("title", "institution", "path", "output was", "output.path", "output.live")
FREE = ("sweep", *DECIDE_NOTHING)
"""How what is said of keys begins in which studies may differ: they decide nothing about a point."""


def differences(old: Study, new: Study, free: tuple[str, ...] = FREE) -> list[str]:
    """What differs beside what is free, "key was value, is value" each; empty if the studies are one."""
    swept = [{".".join(axis.path) for axis in study.axes} for study in (old, new)]
    if swept[0] != swept[1]:
        before, now = (", ".join(sorted(names)) or "nothing" for names in swept)
        return [f"swept parameters were {before}, are {now}"]
    lines = [line for line in changes(old.text, old.overrides, new) if not line.startswith(free)]
    for axis in old.axes:  # texts may name other values in the two studies, such as laws
        key, values = ".".join(axis.path), dict(_axis(new, axis.path).labelled())
        if {type(label) for label in axis.labels} != {type(label) for label in values}:
            lines.append(f"{key} was swept by texts, or is")
        for label, value in axis.labelled():
            if isinstance(label, str) and values.get(label, value) != value:
                was, now = (shortened(json.dumps(v, ensure_ascii=False), 120) for v in (value, values[label]))
                lines.append(f"{key}.{label} was {was}, is {now}")
    return lines
