"""Finished files that grow: points are added to them, those that broke down are solved again.

Points are found by the labels of their swept parameters, so that a list and a grid, axes in another
order and sweeps that overlap have their points in common. What a file has is read back as records,
as a run finds in its journal what one that was stopped has left, and written again, to the bit; of
a sweep over geometries every geometry by itself.

The study of both is the newer one if its sweep has the points of the file, as it has when the sweep
has grown; else it is one of its own: the text of the newer one with the option `sweep={…}`, as
`--set` would put it: the grid of the values of two grids, with a list the list of all points.
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
    """The study of a finished file, and that with its points and those of `new`.
    Raises StoreError if they differ in more than the sweep."""
    old = stored_study(path, new.source)
    if found := differences(old, new):
        remedy = "give another --output, or --force to compute all anew"
        raise StoreError(
            f"{path} holds another study, not only another sweep ({'; '.join(found[:5])}); {remedy}"
        )
    return old, merge_studies(old, new)


def stored_study(path: Path, source: Path | None = None, kind: Kind = "run") -> Study:
    """The study of a file of this kind. source: file of a study beside which its geometry lies, if
    any. Raises StoreError if it is of another, was computed by another version, or if its study
    cannot be read again."""
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
        raise StoreError(
            f"{path} was computed for another geometry file; run its study again with --force"
        )
    if study.mesh.open_ended:
        why = "its meshes follow from the solutions at all points of its sweep"
        raise StoreError(f"{path} cannot be added to: {why}; run the whole study with --force")
    return study


def merge_studies(old: Study, new: Study) -> Study:
    """The study with the points of both; one of the two where it has them all. Raises StoreError,
    StudyError. Title, output and the like are those of the new one."""
    fitted = with_labels_of(old, new)
    for one, other in ((new, old), (old, fitted)):
        if np.all(places_in(one, other) >= 0):
            return one
    if old.design is not None or new.design is not None:
        keep = "keep mode, seed and distributions, and double the points of a latin-hypercube"
        raise StoreError(
            f"the points of the file are not the first of this design; {keep}, or give another --output"
        )
    if old.mode == new.mode == "grid":
        columns = [
            [*dict([*one.labelled(), *_axis(fitted, one.path).labelled()]).items()]
            for one in old.axes
        ]
    else:
        every = (point for study in (old, fitted) for point in points_of(study, old, Axis.labelled))
        points = {tuple(label for label, _ in point): point for point in every}
        columns = [[*column] for column in zip(*points.values(), strict=True)]
    pairs = [zip(*column, strict=True) for column in columns]
    axes = [
        replace(axis, labels=labels, values=values)
        for axis, (labels, values) in zip(old.axes, pairs, strict=True)
    ]
    name = str(new.source) if new.source is not None else "<text>"
    mode = "grid" if old.mode == new.mode == "grid" else "list"
    return read_study_text(new.text, name, with_sweep(new.overrides, mode, axes), new.source)


MAX_ROUNDING = 4.0 * np.finfo(float).eps
"""Relative difference of two labels that are one number, computed or written in two ways."""


def with_labels_of(old: Study, new: Study) -> Study:
    """Return the new study with the labels of the old one where its own differ by rounding only, as
    those of a range and of the same numbers in a list."""
    axes = tuple(_with_labels_of(_axis(old, axis.path), axis) for axis in new.axes)
    return replace(new, axes=axes)


def _with_labels_of(old: Axis, new: Axis) -> Axis:
    if any(isinstance(label, str) for label in (*old.labels, *new.labels)):
        return new
    values = dict(old.labelled())
    known = np.sort(np.array(old.labels, dtype=float))
    labels = np.array(new.labels, dtype=float)
    above = np.clip(np.searchsorted(known, labels), 1, max(1, len(known) - 1))
    pairs = known[np.clip([above - 1, above], 0, len(known) - 1)]
    nearest = pairs[np.argmin(np.abs(pairs - labels), axis=0), np.arange(len(labels))]
    equal = np.abs(nearest - labels) <= MAX_ROUNDING * np.abs(labels)
    kept = np.where(equal, nearest, labels).tolist()
    fitted = dict(zip(kept, new.values, strict=True)) | values
    return replace(new, labels=tuple(kept), values=tuple(fitted[label] for label in kept))


def _axis(study: Study, path: tuple[str, ...]) -> Axis:
    """The axis of a parameter."""
    return next(axis for axis in study.axes if axis.path == path)


DECIDE_NOTHING = ("title", "institution", "path", "output was", "output.path", "output.live")
FREE = ("sweep", *DECIDE_NOTHING)
"""How what is said of keys begins in which studies may differ: they decide nothing about a
point."""


def differences(old: Study, new: Study, free: tuple[str, ...] = FREE) -> list[str]:
    """What differs beside what is free, "key was value, is value" each; empty if the studies are
    one."""
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
                was, now = (
                    shortened(json.dumps(v, ensure_ascii=False), 120)
                    for v in (value, values[label])
                )
                lines.append(f"{key}.{label} was {was}, is {now}")
    return lines
