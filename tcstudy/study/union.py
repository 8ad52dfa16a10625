"""Two studies that differ only in their sweep: what else differs, and the study with the points of both.

The union of two grids is the grid of both axes' values; a point of it that neither has is not run. The union of point
lists, or of a list and a grid, is a list. Either is a study of its own: the text of the newer one with the option
`sweep={…}`, as `--set` would put it. Its numbers stand in the unit of the newer study, or else of the older one.
"""

from __future__ import annotations

import json
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import replace

import numpy as np

from tcstudy.errors import StoreError, shortened
from tcstudy.read.document import tree_of, with_sweep
from tcstudy.read.node import Node
from tcstudy.read.study import read_study_text
from tcstudy.read.sweep import MAX_POINTS
from tcstudy.scene.study import Axis, Study
from tcstudy.scene.units import same_quantity, split_quantity, text_in
from tcstudy.study.shared_points import places_in

Label = float | str

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
            lines.append(f"{key}: " + " | ".join(shortened(_word(value)) for value in pair))
    return lines + _other_values(one, two)


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


def _word(value: object) -> str:
    return value if isinstance(value, str) else json.dumps(value)


def _other_values(one: Study, two: Study) -> list[str]:
    """Texts that name other values in the two studies, such as laws."""
    lines = []
    for axis in one.axes:
        other = _axis(two, axis)
        values = dict(zip(other.labels, other.values, strict=True))
        if {type(label) for label in axis.labels} != {type(label) for label in other.labels}:
            lines.append(f"{'.'.join(axis.path)}: numbers | texts")
        for label, value in zip(axis.labels, axis.values, strict=True):
            if isinstance(label, str) and label in values and values[label] != value:
                pair = (shortened(json.dumps(v, ensure_ascii=False), 120) for v in (value, values[label]))
                lines.append(f"{'.'.join(axis.path)}.{label}: " + " | ".join(pair))
    return lines


def _axis(study: Study, axis: Axis) -> Axis:
    """The axis of the same parameter."""
    return next(other for other in study.axes if other.path == axis.path)


def union(old: Study, new: Study) -> Study:
    """The study with the points of both; one of the two where it has them all. Raises StoreError, StudyError.

    Title, output and the like are those of the new one.
    """
    if all(places_in(new, old, absent=-1) >= 0):
        return new
    if all(places_in(old, new, absent=-1) >= 0):
        return old
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


def _grid(old: Study, new: Study) -> dict[str, object]:
    """The section `sweep` of the grid of all values."""
    sweep: dict[str, object] = {}
    count = 1
    for axis in old.axes:
        values = list(zip(axis.labels, axis.values, strict=True))
        other = _axis(new, axis)
        values += [pair for pair in zip(other.labels, other.values, strict=True) if pair[0] not in axis.labels]
        sweep[".".join(axis.path)] = dict(values) if _is_whole(axis) else [value for _, value in values]
        count *= len(values)
    if count > MAX_POINTS:
        raise StoreError(f"the grid of all values has {count} points, at most {MAX_POINTS}; give points by mode: list")
    return sweep


def _is_whole(axis: Axis) -> bool:
    """Whether its values are laws or materials, by name."""
    return axis.path == ("friction",) or all(isinstance(value, Mapping) for value in axis.values)


def _list(old: Study, new: Study) -> dict[str, object]:
    """The section `sweep` of the list of all points."""
    known = {key: point for study in (new, old) for key, point in points_of(study, old.axes)}
    order = dict.fromkeys(key for study in (old, new) for key, _ in points_of(study, old.axes))
    return {"mode": "list", "points": [known[key] for key in order]}


def points_of(study: Study, axes: Sequence[Axis]) -> Iterator[tuple[tuple[Label, ...], dict[str, object]]]:
    """Labels of every point along the axes, and the point as a list has it."""
    own = [_axis(study, axis) for axis in axes]
    places = [study.axes.index(axis) for axis in own]
    for index in np.ndindex(study.shape):
        rows = [index[place if study.mode == "grid" else 0] for place in places]
        values = {
            ".".join(axis.path): {axis.labels[i]: axis.values[i]} if _is_whole(axis) else axis.values[i]
            for axis, i in zip(own, rows, strict=True)
        }
        yield tuple(axis.labels[i] for axis, i in zip(own, rows, strict=True)), values
