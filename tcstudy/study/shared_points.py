"""Which points two sweeps share, found by the labels of their swept parameters.

A list and a grid, axes in another order and sweeps that overlap have their points in common.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tcstudy.scene.study import Study

Places = NDArray[np.intp]

FEW = 2**62
"""Numbers that fit an integer."""


@dataclass(frozen=True, eq=False)
class LabelledPoints:
    """A sweep: its extents, and by swept parameter labels and which dimension it lies along."""

    shape: tuple[int, ...]
    labels: Mapping[str, Sequence[Any]]
    along: dict[str, int]

    @classmethod
    def of_study(cls, study: Study) -> LabelledPoints:
        """Those of a study, by key path."""
        axes = {".".join(axis.path): axis for axis in study.axes}
        labels = {name: axis.labels for name, axis in axes.items()}
        along = {name: i if study.mode == "grid" else 0 for i, name in enumerate(axes)}
        return cls(study.shape, labels, along)


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


def places_in(study: Study, other: Study, absent: int | None = None) -> Places:
    """(P,) where the points of another study with the same axes stand in this one, in C order of both.

    absent: what stands for a point that is not there; None where all must be
    """
    own, wanted = numbered(LabelledPoints.of_study(study), LabelledPoints.of_study(other))
    order = np.argsort(own, kind="stable")
    found = order[np.minimum(np.searchsorted(own, wanted, sorter=order), len(own) - 1)]
    return found if absent is None else np.where(own[found] == wanted, found, absent)
