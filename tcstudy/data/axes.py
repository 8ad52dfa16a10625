"""The sweep of a study in its files: names, labels and order of the dimensions."""

from __future__ import annotations

import re
from typing import Any

import numpy as np

from tcstudy.data.schema import DIFFERENCE, POINT, RESERVED
from tcstudy.data.variable import SWEEP
from tcstudy.scene.study import Axis, Study


def sweep_dims(study: Study) -> tuple[str, ...]:
    """Names of the sweep dimensions, in the order of `study.shape`."""
    if not study.axes:
        return ()
    return tuple(axis_name(axis) for axis in study.axes) if study.mode == "grid" else (POINT,)


def expand(dims: tuple[str, ...], study: Study) -> tuple[str, ...]:
    """Dimension names with SWEEP replaced by those of the study."""
    return tuple(name for d in dims for name in (sweep_dims(study) if d == SWEEP else (d,)))


def axis_name(axis: Axis) -> str:
    """Name of a swept parameter in the file: its own, or its path where a result has that name ("heat_omega")."""
    return "_".join(axis.path) if axis.name in RESERVED else axis.name


def axis_attributes(axis: Axis) -> dict[str, Any]:
    """Attributes of the coordinate variable of a swept parameter."""
    attrs = {"long_name": f"swept parameter {'.'.join(axis.path)}", "units": axis.units}
    return attrs | dict(DIFFERENCE) if axis.units == "K" else attrs


def axis_labels(axis: Axis) -> np.ndarray[Any, Any]:
    """Labels of a swept parameter: float64, or objects if one of them is a text."""
    if any(isinstance(label, str) for label in axis.labels):
        return np.array([str(label) for label in axis.labels], dtype=object)
    return np.array(axis.labels, dtype=float)


def axis_places(axis: Axis) -> np.ndarray[Any, Any]:
    """Place of every label along the file's dimension: in ascending order where the study's goes up and down.

    CF wants monotonic coordinates. Texts stay in their order: as the values of a dimension they are no strict CF
    coordinate, but as a label variable of another name `data.sel(friction="tresca")` would find no index.
    """
    labels = axis_labels(axis)
    places = np.arange(len(labels))
    if labels.dtype == object or np.all(np.diff(labels) > 0.0) or np.all(np.diff(labels) < 0.0):
        return places
    places[np.argsort(labels, kind="stable")] = np.arange(len(labels))
    return places


def axis_order(axis: Axis) -> np.ndarray[Any, Any]:
    """Which of its labels stands at each place of the file's dimension."""
    return np.argsort(axis_places(axis))


def axis_problems(study: Study) -> list[str]:
    """One sentence for each swept parameter whose name cannot stand in the file."""
    names = [axis_name(axis) for axis in study.axes]
    problems = [f"two swept parameters are named {n!r}" for n in sorted({n for n in names if names.count(n) > 1})]
    for name in names:
        if name in RESERVED:
            problems.append(f"the swept parameter {name!r} has the name of a result; give it another name")
        elif not re.fullmatch(r"[A-Za-z][A-Za-z0-9_]*", name):
            problems.append(f"the swept parameter {name!r} needs a name of letters, digits and underscores")
    return problems
