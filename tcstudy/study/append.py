"""Finished files that grow: points are added to them, those that broke down are solved again.

Points are found by the labels of their swept parameters, so that a list and a grid, axes in another order and sweeps
that overlap have their points in common. What a file has is read back as records and written again, to the bit; in a
sweep over geometries every geometry is taken out of the file, grows by itself, and goes back.

The study of both is one of its own: the text of the newer one with the option `sweep={…}`, as `--set` would put it. Of
two grids it is the grid of both axes' values, and a point of it that neither has is not run; with a list it is a list.
Its numbers stand in the unit of the newer study, or else of the older one.
"""

from __future__ import annotations

import json
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from hashlib import sha256
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from tcstudy.data.provenance import Provenance, program, study_sha256
from tcstudy.data.reading import attributes, refuse_changed
from tcstudy.data.records import BlockRecord, LevelRecord, PointStatus
from tcstudy.data.stored import digest, opened, read_blocks, read_geometries, read_levels, read_status
from tcstudy.data.writer import file_places
from tcstudy.errors import StoreError, StudyError, shortened
from tcstudy.read.document import tree_of, with_sweep
from tcstudy.read.node import Node
from tcstudy.read.study import read_study_text
from tcstudy.read.sweep import MAX_POINTS
from tcstudy.scene.study import Axis, Study
from tcstudy.scene.units import same_quantity, split_quantity, text_in

if TYPE_CHECKING:
    import pandas

Places = NDArray[np.intp]


def appended(path: Path, new: Study) -> tuple[Study, ExistingResults]:
    """The study with the points of a finished file and of `new`, and what the file has of it.

    Raises StoreError if they differ in more than the sweep.
    """
    old = stored_study(path, new.source)
    if found := differences(old, new):
        remedy = "give another --output, or --force to compute all anew"
        raise StoreError(f"{path} holds another study, not only another sweep ({'; '.join(found[:5])}); {remedy}")
    study = merge_studies(old, new)
    return study, _kept(path, old, study, new, again=read_status(path) == PointStatus.NOT_RUN)


def all_but_broken(path: Path, study: Study) -> ExistingResults | None:
    """What the file of this very study has without the points that broke down unexpectedly; None if none did.

    What failed by its own numbers would fail again; on meshes that follow from the solutions all points stay.
    """
    if study.mesh.open_ended or not (broken := read_status(path) == PointStatus.ERROR).any():
        return None
    return _kept(path, stored_study(path, study.source), study, study, again=broken)


def stored_study(path: Path, source: Path | None = None) -> Study:
    """The study of a run's file. source: file of a study beside which its geometry lies, if any.

    Raises StoreError if it is no run, was computed by another version, or if its study cannot be read again.
    """
    found = attributes(path)
    refuse_changed(path)
    if "content" in found or "reference" in found:
        raise StoreError(f"{path} holds results of another command; name the file of a run")
    if found.get("program") != program():
        what = "was computed by another version of the program or its libraries"
        raise StoreError(f"{path} {what}; run its study again with --force")
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
        raise StoreError(f"{path} cannot be added to or mended: {why}; run the whole study with --force")
    return study


def _kept(path: Path, stored: Study, study: Study, new: Study, again: NDArray[np.bool_]) -> ExistingResults:
    """What the file of the study `stored` has of a study, of which the points of `new` are asked for.

    again: (P of the file, levels) those that it has not
    """
    places = _in_file_order(stored, study)
    todo = np.zeros((len(study.scenes), study.mesh.levels), dtype=bool)
    todo[places_in(study, new)] = True
    todo[places] &= again
    return ExistingResults(path, stored, str(path), places, todo)


def _in_file_order(stored: Study, study: Study) -> Places:
    """(P,) where the points of a file, in its order, stand in the sweep of a study that has them all."""
    places = np.empty(len(stored.scenes), dtype=np.intp)
    places[file_places(stored, np.arange(len(places)))] = places_in(study, stored)
    return places


@dataclass(frozen=True, eq=False)
class ExistingResults:
    """What a finished file has of a study, and what is still to be solved.

    stored: the study of the file, or of its group;  name: of that in words
    places: (P of the file,) where its points stand in the study;  todo: (points of the study, levels)
    mark:   by which journals know that they go on from this file; that of the file of all geometries for one of them
    """

    path: Path
    stored: Study
    name: str
    places: Places
    todo: NDArray[np.bool_]
    mark: str = ""
    group: str = ""

    @cached_property
    def levels(self) -> dict[int, LevelRecord]:
        """The levels that the file has, by number."""
        return read_levels(self.path, self.group) if len(self.places) else {}

    @cached_property
    def digest(self) -> str:
        """By which a journal knows that it went on from this file."""
        return self.mark or digest(self.path)

    def blocks(self, study: Study, level: int | None = None) -> Iterator[BlockRecord]:
        """The points that are not solved again, of one level or of all."""
        wanted = ~self.todo
        if level is not None:
            wanted &= np.arange(self.todo.shape[1]) == level
        return read_blocks(self.path, study, self.places, wanted, self.group) if len(self.places) else iter(())

    def of_geometries(self, study: Study) -> list[ExistingResults]:
        """The same of every geometry of the study, by its group in the file."""
        mark = sha256(self.digest.encode() + np.packbits(self.todo).tobytes()).hexdigest()
        numbers = np.full(len(study.scenes), -1, dtype=np.intp)
        numbers[self.places] = read_geometries(self.path)
        kept = []
        for variant in study.variants:
            one = replace(self, places=np.zeros(0, dtype=np.intp), todo=self.todo[variant.places], mark=mark)
            number = int(numbers[variant.places].max(initial=-1))
            own = self.stored.variants[number].study if number >= 0 else None
            if own is not None and variant.study is not None:
                places, name = _in_file_order(own, variant.study), f"{self.name} ({variant.words})"
                one = replace(one, group=f"geometry_{number}", stored=own, name=name, places=places)
            kept.append(one)
        return kept

    def without_geometry(self, study: Study) -> list[BlockRecord]:
        """The points that are not solved again and whose geometry has no mesh."""
        wanted = ~self.todo
        wanted[self.places[read_geometries(self.path) >= 0]] = False
        return list(read_blocks(self.path, study, self.places, wanted))

    def with_levels(self, new: Sequence[LevelRecord]) -> tuple[LevelRecord, ...]:
        """The levels of the file and those of the journal, coarse to fine."""
        levels = self.levels | {level.level: level for level in new}
        return tuple(levels[i] for i in sorted(levels))

    def before(self, provenance: Provenance) -> Provenance:
        """The provenance with the file's history before it."""
        if not len(self.places):
            return provenance
        with opened(self.path, self.group) as nc:
            return replace(provenance, history=f"{nc.getncattr('history')}\n{provenance.history}")

    def joined(self, record: LevelRecord) -> LevelRecord:
        """The file's record of a level, with what a page needs of all points. Raises StoreError for another mesh."""
        old = self.levels.get(record.level)
        if old is None:
            return record
        same = old.n_dof == record.n_dof and all(
            np.array_equal(getattr(old, name), getattr(record, name)) for name in ("arclength", "x", "y", "c", "edge")
        )
        if not same:
            what = f"the mesh of level {record.level} is not that of {self.name}, whose points stay"
            raise StoreError(f"{what}; run the whole study with --force")
        return replace(old, fields=record.fields)


def places_in(study: Study, other: Study) -> Places:
    """(P,) where the points of another study with the same axes stand in this one, in C order of both; −1: nowhere."""
    if not study.axes:
        return np.zeros(1, dtype=np.intp)
    own, wanted = (_labels(one, [axis.path for axis in study.axes]) for one in (study, other))
    return np.asarray(own.get_indexer(wanted), dtype=np.intp)


def _labels(study: Study, paths: Sequence[tuple[str, ...]]) -> pandas.MultiIndex:
    """The labels of every point along the axes of these parameters, in C order."""
    import pandas  # here, because a run that nothing is added to does without

    index = np.unravel_index(np.arange(len(study.scenes)), study.shape)
    codes, levels = [], []
    for path in paths:
        i, axis = next((i, axis) for i, axis in enumerate(study.axes) if axis.path == path)
        code, level = pandas.factorize(np.array(axis.labels, dtype=object))
        codes.append(code[index[i if study.mode == "grid" else 0]])
        levels.append(level)
    return pandas.MultiIndex(levels=levels, codes=codes)


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
    units = {axis.path: axis.written if axis.written[0] else _axis(old, axis).written for axis in new.axes}
    old, new = (replace(one, axes=tuple(_in_unit(axis, *units[axis.path]) for axis in one.axes)) for one in (old, new))
    sweep = _grid(old, new) if old.mode == new.mode == "grid" else _list(old, new)
    if (h := tree_of(new).child("sweep")) is not None and (sizes := h.child("h")) is not None:
        sweep["h"] = sizes.plain()
    name = str(new.source) if new.source is not None else "<text>"
    return read_study_text(new.text, name, with_sweep(new.overrides, sweep), new.source)


def _axis(study: Study, axis: Axis) -> Axis:
    """The axis of the same parameter."""
    return next(other for other in study.axes if other.path == axis.path)


def _in_unit(axis: Axis, unit: str, size: float) -> Axis:
    """The axis with its numbers written in a unit of a study, if it has one; expressions stay."""
    if not unit:
        return axis
    values = tuple(
        value
        if isinstance(label, str) or (isinstance(value, str) and split_quantity(value) is None)
        else text_in(label, unit, size) or value
        for value, label in zip(axis.values, axis.labels, strict=True)
    )
    return replace(axis, values=values)


def _is_whole(axis: Axis) -> bool:
    """Whether its values are laws or materials, by name."""
    return axis.path == ("friction",) or all(isinstance(value, Mapping) for value in axis.values)


def _grid(old: Study, new: Study) -> dict[str, object]:
    """The section `sweep` of the grid of all values."""
    sweep: dict[str, object] = {}
    count = 1
    for axis in old.axes:
        values = dict(zip(axis.labels, axis.values, strict=True))
        other = _axis(new, axis)
        values |= {label: v for label, v in zip(other.labels, other.values, strict=True) if label not in values}
        sweep[".".join(axis.path)] = values if _is_whole(axis) else [*values.values()]
        count *= len(values)
    if count > MAX_POINTS:
        raise StoreError(f"the grid of all values has {count} points, at most {MAX_POINTS}; give points by mode: list")
    return sweep


def _list(old: Study, new: Study) -> dict[str, object]:
    """The section `sweep` of the list of all points."""
    points: dict[tuple[float | str, ...], dict[str, object]] = {}
    for study in (old, new):
        axes = [(_axis(study, axis), study.axes.index(_axis(study, axis))) for axis in old.axes]
        for index in np.ndindex(study.shape):
            rows = [(axis, index[place if study.mode == "grid" else 0]) for axis, place in axes]
            values = {
                ".".join(axis.path): {axis.labels[i]: axis.values[i]} if _is_whole(axis) else axis.values[i]
                for axis, i in rows
            }
            points.setdefault(tuple(axis.labels[i] for axis, i in rows), values)
    return {"mode": "list", "points": [*points.values()]}


FREE = ("sweep", "title", "institution", "path", "output.path", "output.live")
"""Keys in which studies may differ: they decide nothing about a point. `sweep.h` is compared."""
WORDS = {"solver": "name", "output": "path"}
"""Sections that may be one word, and the key that it stands for."""


def differences(one: Study, two: Study) -> list[str]:
    """What differs beside the sweep, "key: value | value" each; empty if the studies are one."""
    swept = [{".".join(axis.path) for axis in study.axes} for study in (one, two)]
    if swept[0] != swept[1]:
        words = (", ".join(sorted(names)) or "nothing" for names in swept)
        return ["swept parameters: " + " | ".join(words)]
    leaves = [dict(_leaves(tree_of(study), swept[0])) for study in (one, two)]
    lines = []
    for key in dict.fromkeys((*leaves[0], *leaves[1])):
        pair = [found.get(key, "not given") for found in leaves]
        if not same_quantity(*pair):
            words = (value if isinstance(value, str) else json.dumps(value) for value in pair)
            lines.append(f"{key}: " + " | ".join(map(shortened, words)))
    for axis in one.axes:  # texts may name other values in the two studies, such as laws
        key, other = ".".join(axis.path), _axis(two, axis)
        values = dict(zip(other.labels, other.values, strict=True))
        if {type(label) for label in axis.labels} != {type(label) for label in other.labels}:
            lines.append(f"{key}: numbers | texts")
        for label, value in zip(axis.labels, axis.values, strict=True):
            if isinstance(label, str) and values.get(label, value) != value:
                texts = (shortened(json.dumps(v, ensure_ascii=False), 120) for v in (value, values[label]))
                lines.append(f"{key}.{label}: " + " | ".join(texts))
    return lines


def _leaves(node: Node, swept: Collection[str], path: str = "") -> Iterator[tuple[str, object]]:
    """Values by key path, without those in which studies may differ or that the sweep gives."""
    if path in swept or (path in FREE and path != "sweep"):
        return
    value = node.value
    if isinstance(value, Mapping):
        for key, item in value.items():
            if path != "sweep" or key == "h":
                yield from _leaves(item, swept, f"{path}.{key}" if path else key)
    elif isinstance(value, tuple):
        yield f"{path}[]", len(value)
        for i, item in enumerate(value):
            yield from _leaves(item, swept, f"{path}[{i}]")
    elif path != "sweep":
        word = "role" if path.startswith("boundary.") and path.count(".") == 1 else WORDS.get(path)
        if word is None or f"{path}.{word}" not in FREE:
            yield f"{path}.{word}" if word else path, value
