"""Which points two sweeps share, found by the labels of their swept parameters, of files or of studies.

A list and a grid, axes in another order and sweeps that overlap have their points in common. A point that was run on no
level is none of its file.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from tcstudy.data.provenance import kind_from
from tcstudy.data.records import PointStatus
from tcstudy.scene.study import Study

if TYPE_CHECKING:
    import netCDF4

Places = NDArray[np.intp]

SHOWN = 3
"""Points that are named of those that one file has alone."""
FEW = 2**62
"""Numbers that fit an integer."""


@dataclass(frozen=True, eq=False)
class LabelledPoints:
    """A sweep: its dimensions, and by swept parameter labels and which dimension it lies along.

    shown: name, unit in which the study writes the labels, and its size in SI;  dims: names of the dimensions
    run:   (P,) which points were run
    """

    shape: tuple[int, ...]
    labels: Mapping[str, Sequence[Any]]
    along: dict[str, int]
    shown: dict[str, tuple[str, str, float]]
    run: NDArray[np.bool_]
    dims: tuple[str, ...] = ()

    @classmethod
    def of_file(cls, nc: netCDF4.Dataset) -> LabelledPoints:
        """Those of a result file, or of a geometry in it."""
        dims = tuple(d for d in nc["status"].dimensions if d != "level") if "level" in nc.dimensions else ()
        dims = dims if kind_from(nc.__dict__) in ("run", "convergence") else ()
        listed = len(dims) == 1 and dims[0] not in nc.variables  # a list names its parameters
        names = getattr(nc["status"], "coordinates", "").split() if listed else dims
        own = {name: nc[name] for name in sorted(names)}
        shape = tuple(int(nc.dimensions[d].size) for d in dims)
        status = (
            np.moveaxis(nc["status"][...], nc["status"].dimensions.index("level"), -1) if dims else np.zeros((1, 1))
        )
        return cls(
            shape,
            {name: variable[...].tolist() for name, variable in own.items()},
            {name: dims.index(variable.dimensions[0]) for name, variable in own.items()},
            {name: (name, *_unit(variable)) for name, variable in own.items()},
            (status != PointStatus.NOT_RUN).any(axis=-1).ravel(),
            dims,
        )

    @classmethod
    def of_study(cls, study: Study) -> LabelledPoints:
        """Those of a study, by key path."""
        axes = {".".join(axis.path): axis for axis in study.axes}
        labels = {name: axis.labels for name, axis in axes.items()}
        along = {name: i if study.mode == "grid" else 0 for i, name in enumerate(axes)}
        units = {name: axis.written if axis.written[0] else (axis.units, 1.0) for name, axis in axes.items()}
        shown = {name: (axis.name, *units[name]) for name, axis in axes.items()}
        return cls(study.shape, labels, along, shown, np.ones(math.prod(study.shape), dtype=bool))

    def at(self, place: int) -> dict[str, Any]:
        """The labels of a point by parameter."""
        index = np.unravel_index(place, self.shape)
        return {name: labels[int(index[self.along[name]])] for name, labels in self.labels.items()}

    def describe(self, place: int) -> str:
        """The labels of a point in words, in the units of the study."""
        parts = []
        for key, label in self.at(place).items():
            name, unit, size = self.shown[key]
            number = label if isinstance(label, str) else f"{label / size:.12g} {unit}".removesuffix(" 1")
            parts.append(f"{name} = {number}")
        return ", ".join(parts)


def _unit(variable: netCDF4.Variable) -> tuple[str, float]:
    """The unit in which a study writes the labels of a coordinate, and its size in SI."""
    if hasattr(variable, "study_unit"):
        return str(variable.study_unit), float(variable.study_unit_size)
    return str(getattr(variable, "units", "1")), 1.0


def numbered(*sweeps: LabelledPoints) -> list[NDArray[np.int64]]:
    """(P,) of every sweep one number a point, the same for the same labels; all have the same parameters."""
    totals, most = [np.zeros(sweep.shape, dtype=np.int64) for sweep in sweeps], 1
    for name in sweeps[0].labels:
        ids = {label: i for i, label in enumerate(dict.fromkeys(v for one in sweeps for v in one.labels[name]))}
        if most * len(ids) > FEW:  # else numbers of points of a long list with many parameters would not fit
            ends = np.cumsum([total.size for total in totals])[:-1]
            found = np.unique(np.concatenate([total.ravel() for total in totals]), return_inverse=True)[1]
            totals = [part.reshape(one.shape) for part, one in zip(np.split(found, ends), sweeps, strict=True)]
            most = int(found.max()) + 1
        most *= len(ids)
        for k, sweep in enumerate(sweeps):
            along = [-1 if d == sweep.along[name] else 1 for d in range(len(sweep.shape))]
            own = np.array([ids[label] for label in sweep.labels[name]], dtype=np.int64)
            totals[k] = totals[k] * len(ids) + own.reshape(along)
    return [total.ravel() for total in totals]


def shared_points(
    sweeps: tuple[LabelledPoints, LabelledPoints], files: tuple[Path, Path]
) -> tuple[tuple[Places, Places], tuple[str, ...]]:
    """Places of the points that both files have run, in either; and what only one has, in words."""
    keys = numbered(*sweeps)
    held = [np.flatnonzero(sweep.run) for sweep in sweeps]
    keys = [key[at] for key, at in zip(keys, held, strict=True)]
    _, one, two = np.intersect1d(keys[0], keys[1], return_indices=True)
    one, two = held[0][one], held[1][two]
    lines = []
    for k, (sweep, path) in enumerate(zip(sweeps, files, strict=True)):
        alone = held[k][~np.isin(keys[k], keys[1 - k])]
        if len(alone):
            named = "; ".join(sweep.describe(int(place)) for place in alone[:SHOWN])
            lines.append(f"{len(alone)} only in {path}: {named}{'; …' if len(alone) > SHOWN else ''}")
    order = np.argsort(one)
    return (one[order], two[order]), tuple(lines)


def places_in(study: Study, other: Study, absent: int | None = None) -> Places:
    """(P,) where the points of another study with the same axes stand in this one, in C order of both.

    absent: what stands for a point that is not there; None where all must be
    """
    own, wanted = numbered(LabelledPoints.of_study(study), LabelledPoints.of_study(other))
    order = np.argsort(own, kind="stable")
    found = order[np.minimum(np.searchsorted(own, wanted, sorter=order), len(own) - 1)]
    return found if absent is None else np.where(own[found] == wanted, found, absent)
