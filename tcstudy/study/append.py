"""Append points to finished files; points that broke down are solved again.

Points are found by the labels of their swept parameters, so that a list and a grid, axes in another
order and sweeps that overlap have their points in common. The content of a file is read back as
records, as a run finds them in its journal, and written again, to the bit. In a sweep over
geometries, every geometry is read by itself.

The study of both is the newer one if its sweep has the points of the file, as a sweep that has
grown has. Otherwise it is a new one: the text of the newer one with the option `sweep={…}`, as
`--set` would put it. Its sweep is the grid of the values of two grids, or the list of all points.
"""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np

from tcstudy.data.files import Kind, attributes, holds, study_sha256
from tcstudy.data.reading import places_in, points_of
from tcstudy.errors import StoreError, StudyError, shortened
from tcstudy.read.document import changes, with_sweep
from tcstudy.read.study import read_study_text
from tcstudy.scene.study import Axis, Study


def appended(path: Path, new: Study) -> tuple[Study, Study]:
    """Return the study of a finished file, and that with its points and those of `new`.

    Raises StoreError if they differ in more than the sweep.
    """
    old = stored_study(path, new.source)
    lines = differences(old, new)
    if lines:
        raise StoreError(
            f"{path} holds another study, not only another sweep ({'; '.join(lines[:5])}); give "
            "another --output, or --force to compute all points again"
        )
    return old, merge_studies(old, new)


def stored_study(path: Path, source: Path | None = None, kind: Kind = "run") -> Study:
    """Return the study of a file of this kind.

    source: file of a study beside which its geometry lies, if any
    Raises StoreError if the file is of another kind, was computed by another version, or if its
    study cannot be read again.
    """
    about = attributes(path)
    holds(path, kind, None)
    overrides = tuple(filter(None, str(about["overrides"]).split("\n")))
    try:
        study = read_study_text(str(about["study_yaml"]), str(path), overrides, source)
    except StudyError as error:
        reason = shortened(str(error).splitlines()[0], 300)
        raise StoreError(
            f"the study in {path} cannot be read again ({reason}); a geometry must be in its place"
        ) from error
    if study.scenes[0].body.brep is not None and study_sha256(study) != about["study_sha256"]:
        raise StoreError(
            f"{path} was computed for another geometry file; run its study again with --force"
        )
    if study.mesh.open_ended:
        raise StoreError(
            f"{path} cannot be added to: its meshes follow from the solutions at all points of its "
            "sweep; run the whole study with --force"
        )
    return study


def merge_studies(old: Study, new: Study) -> Study:
    """Return the study with the points of both; one of the two where it has them all.

    Title, output and the like are those of the new one. Raises StoreError, StudyError.
    """
    fitted = with_labels_of(old, new)
    if np.all(places_in(new, old) >= 0):
        return new
    if np.all(places_in(old, fitted) >= 0):
        return old
    if old.design is not None or new.design is not None:
        raise StoreError(
            "the points of the file are not the first of this design; keep mode, seed and "
            "distributions, and double the points of a latin-hypercube, or give another --output"
        )
    mode = "grid" if old.mode == new.mode == "grid" else "list"
    merged = _merged_grids(old, fitted) if mode == "grid" else _merged_lists(old, fitted)
    axes = list[Axis]()
    for axis, labelled in zip(old.axes, merged, strict=True):
        labels, values = zip(*labelled, strict=True)
        axes.append(replace(axis, labels=labels, values=values))
    name = str(new.source) if new.source is not None else "<text>"
    return read_study_text(new.text, name, with_sweep(new.overrides, mode, axes), new.source)


Labelled = list[tuple[float | str, object]]
"""Labels of an axis with their values."""


def _merged_grids(old: Study, new: Study) -> list[Labelled]:
    """Return the labels and values of both studies by axis of the old one."""
    merged = list[Labelled]()
    for axis in old.axes:
        values = dict(axis.labelled() + _axis(new, axis.path).labelled())
        merged.append(list(values.items()))
    return merged


def _merged_lists(old: Study, new: Study) -> list[Labelled]:
    """Return the labels and values of all points by axis of the old study, one per point."""
    points = dict[tuple[float | str, ...], tuple[tuple[float | str, object], ...]]()
    for study in (old, new):
        for point in points_of(study, old, Axis.labelled):
            points[tuple(label for label, _ in point)] = point
    return [list(column) for column in zip(*points.values(), strict=True)]


MAX_ROUNDING = 4.0 * np.finfo(float).eps
"""Relative difference of two labels that are one number, computed or written differently."""


def with_labels_of(old: Study, new: Study) -> Study:
    """Return the new study with the labels of the old one where they differ by rounding only.

    Those of a range and of the same numbers in a list differ so.
    """
    axes = tuple(_with_labels_of(_axis(old, axis.path), axis) for axis in new.axes)
    return replace(new, axes=axes)


def _with_labels_of(old: Axis, new: Axis) -> Axis:
    if any(isinstance(label, str) for label in (*old.labels, *new.labels)):
        return new
    old_labels = np.sort(np.array(old.labels, dtype=float))
    labels = np.array(new.labels, dtype=float)
    above = np.clip(np.searchsorted(old_labels, labels), 1, max(1, len(old_labels) - 1))
    neighbours = old_labels[np.clip([above - 1, above], 0, len(old_labels) - 1)]
    closer = np.argmin(np.abs(neighbours - labels), axis=0)
    nearest = neighbours[closer, np.arange(len(labels))]
    is_equal = np.abs(nearest - labels) <= MAX_ROUNDING * np.abs(labels)
    fitted_labels = np.where(is_equal, nearest, labels).tolist()
    value_of_label = dict(zip(fitted_labels, new.values, strict=True)) | dict(old.labelled())
    values = tuple(value_of_label[label] for label in fitted_labels)
    return replace(new, labels=tuple(fitted_labels), values=values)


def _axis(study: Study, path: tuple[str, ...]) -> Axis:
    """Return the axis of a parameter."""
    return next(axis for axis in study.axes if axis.path == path)


DECIDE_NOTHING = ("title", "institution", "path", "output was", "output.path", "output.live")
"""Beginnings of the lines about keys that decide nothing about a point."""
FREE = ("sweep", *DECIDE_NOTHING)
"""The same for all keys in which studies with common points may differ."""


def differences(old: Study, new: Study, free: tuple[str, ...] = FREE) -> list[str]:
    """Return the differences beside those that are free, "key was value, is value" each.

    Empty if the studies have their points in common.
    """
    old_names = {".".join(axis.path) for axis in old.axes}
    new_names = {".".join(axis.path) for axis in new.axes}
    if old_names != new_names:
        old_words = ", ".join(sorted(old_names)) or "nothing"
        new_words = ", ".join(sorted(new_names)) or "nothing"
        return [f"swept parameters were {old_words}, are {new_words}"]
    lines = [line for line in changes(old.text, old.overrides, new) if not line.startswith(free)]
    for axis in old.axes:
        lines += _differences_of_texts(axis, _axis(new, axis.path))
    return lines


def _differences_of_texts(old: Axis, new: Axis) -> list[str]:
    """Return the differences of values with the same text as label, such as laws."""
    lines = list[str]()
    key = ".".join(old.path)
    new_values = dict(new.labelled())
    if {type(label) for label in old.labels} != {type(label) for label in new_values}:
        lines.append(f"{key} was swept by texts, or is")
    for label, value in old.labelled():
        if isinstance(label, str) and new_values.get(label, value) != value:
            old_text = shortened(json.dumps(value, ensure_ascii=False), 120)
            new_text = shortened(json.dumps(new_values[label], ensure_ascii=False), 120)
            lines.append(f"{key}.{label} was {old_text}, is {new_text}")
    return lines
