"""Finished files that grow: points are added to them, those that broke down are solved again.

Points are found by the labels of their swept parameters, so that a list and a grid, axes in another order and sweeps
that overlap have their points in common. What a file has is read back as records, which a run finds in its journal as
if it had been stopped after them, and written again, to the bit; in a sweep over geometries every geometry is taken out
of the file, grows by itself, and goes back.

The study of both is one of its own: the text of the newer one with the option `sweep={…}`, as `--set` would put it. Of
two grids it is the grid of both axes' values, and a point of it that neither has is not run; with a list it is a list.
Its numbers stand in the unit of the newer study, or else of the older one.
"""

from __future__ import annotations

import itertools
import json
import operator
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tcstudy.data.files import attributes, refuse_changed
from tcstudy.data.provenance import program, study_sha256
from tcstudy.data.reading import opened, read_blocks, read_geometries, read_levels, read_status
from tcstudy.data.records import BlockRecord, LevelRecord
from tcstudy.data.schema import PointStatus
from tcstudy.errors import StoreError, StudyError, shortened
from tcstudy.read.document import tree_of, with_sweep
from tcstudy.read.node import Node
from tcstudy.read.study import read_study_text
from tcstudy.read.sweep import MAX_POINTS
from tcstudy.scene.study import Axis, Study
from tcstudy.scene.units import same_quantity, split_quantity, text_in
from tcstudy.study.point import all_failed

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
    asked = np.zeros(len(study.scenes), dtype=bool)
    asked[places_in(study, new)] = True
    return study, Kept.of(path, old, study, asked)


def mended(path: Path, study: Study) -> Kept:
    """What the file of this very study has without the points that broke down unexpectedly.

    What failed by its own numbers would fail again; on meshes that follow from the solutions all points stay.
    """
    if study.mesh.open_ended or not np.any(read_status(path) == PointStatus.ERROR):
        nothing = np.zeros((len(study.scenes), study.mesh.levels), dtype=bool)
        return Kept(path, study, nothing[:, 0], todo=nothing)
    return Kept.of(path, stored_study(path, study.source), study, np.zeros(len(study.scenes), dtype=bool))


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


@dataclass(frozen=True, eq=False)
class Kept:
    """What a finished file, or the group of a geometry in it, has of a study, and what is still to be solved.

    asked:  (P,) points of the study that are wanted, or there: of a grid of all values, some may be neither
    todo:   (P, levels) those that are not there, or broke down unexpectedly
    places: (P of the file,) where the points of the file stand in the study
    stored: the study of the file, for what geometries its groups are of
    """

    path: Path
    study: Study
    asked: NDArray[np.bool_]
    todo: NDArray[np.bool_]
    places: Places = field(default_factory=lambda: np.zeros(0, dtype=np.intp))
    group: str = ""
    stored: Study | None = None

    @classmethod
    def of(cls, path: Path, stored: Study, study: Study, asked: NDArray[np.bool_], group: str = "") -> Kept:
        """asked: (P,) of those that are not in the file."""
        status = read_status(path, group)
        places = places_in(study, stored)
        asked = asked.copy()
        asked[places] |= np.any(status != PointStatus.NOT_RUN, axis=1)
        todo = np.repeat(asked[:, None], study.mesh.levels, axis=1)
        todo[places] &= np.isin(status, (PointStatus.NOT_RUN, PointStatus.ERROR))
        return cls(path, study, asked, todo, places, group, stored)

    @classmethod
    def none(cls, study: Study, asked: NDArray[np.bool_] | None = None) -> Kept:
        """Nothing; asked: (P,) points to solve, all of them unless given."""
        asked = np.ones(len(study.scenes), dtype=bool) if asked is None else asked
        return cls(Path(), study, asked, np.repeat(asked[:, None], study.mesh.levels, axis=1))

    def records(self) -> Iterator[LevelRecord | BlockRecord]:
        """What stays, as a run found it."""
        if len(self.places):
            yield from read_levels(self.path, self.group).values()
            yield from read_blocks(self.path, self.study, self.places, ~self.todo, self.group)

    def left_out(self) -> list[BlockRecord]:
        """The points that nobody asked for, as blocks that are finished without results."""
        idle = np.flatnonzero(~self.asked)
        levels = range(self.study.mesh.levels) if len(idle) else ()
        return [all_failed(self.study, level, idle, PointStatus.NOT_RUN, "") for level in levels]

    def before(self, attributes: Mapping[str, Any]) -> Mapping[str, Any]:
        """The attributes of a run with the file's history before its own."""
        if not len(self.places):
            return attributes
        with opened(self.path, self.group) as nc:
            return {**attributes, "history": f"{nc.getncattr('history')}\n{attributes['history']}"}

    def of_geometries(self) -> Iterator[Kept]:
        """The same of every geometry of the study, by its group in the file."""
        numbers = np.full(len(self.study.scenes), -1, dtype=np.intp)
        if self.stored is not None:
            numbers[self.places] = read_geometries(self.path)
        for variant in self.study.variants:
            number, asked = int(numbers[variant.places].max()), self.asked[variant.places]
            own = self.stored.variants[number].study if self.stored is not None and number >= 0 else None
            if own is not None and variant.study is not None:
                yield Kept.of(self.path, own, variant.study, asked, f"geometry_{number}")
            else:
                yield Kept.none(variant.study or self.study, asked)


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
    units = {axis.path: axis.written if axis.written[0] else _axis(old, axis).written for axis in new.axes}
    old, new = (replace(one, axes=tuple(_in_unit(axis, *units[axis.path]) for axis in one.axes)) for one in (old, new))
    sweep = _grid(old, new) if old.mode == new.mode == "grid" else _list(old, new)
    if (h := tree_of(new).at("sweep")) is not None and (sizes := h.at("h")) is not None:
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
    points, paths = dict[tuple[float | str, ...], dict[str, object]](), [axis.path for axis in old.axes]
    for study in (old, new):
        for point in _points(study, paths, lambda axis: zip(axis.labels, axis.values, strict=True)):
            values = {
                ".".join(axis.path): {label: value} if _is_whole(axis) else value
                for axis, (label, value) in zip(old.axes, point, strict=True)
            }
            points.setdefault(tuple(label for label, _ in point), values)
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
