"""Which points two result files share, found by the labels of their swept parameters as they stand in the files.

A list and a grid, axes in another order and sweeps that overlap have their points in common. Not here: the union of two
studies and the places of points in it (`tcstudy.study.union`), which need studies that can be read.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from tcstudy.data.provenance import kind_from
from tcstudy.data.schema import POINT

if TYPE_CHECKING:
    import netCDF4

Places = NDArray[np.intp]

SHOWN = 3
"""Points that are named of those that one file has alone."""


@dataclass(frozen=True, eq=False)
class FileSweep:
    """The sweep of a file: its dimensions, and by swept parameter labels, units and which dimension it lies along."""

    dims: tuple[str, ...]
    shape: tuple[int, ...]
    labels: dict[str, NDArray[Any]]
    units: dict[str, str]
    along: dict[str, int]

    @classmethod
    def of(cls, nc: netCDF4.Dataset) -> FileSweep:
        dims = tuple(d for d in nc["status"].dimensions if d != "level") if "level" in nc.dimensions else ()
        dims = dims if kind_from(nc.__dict__) in ("run", "convergence") else ()
        names = getattr(nc["status"], "coordinates", "").split() if dims == (POINT,) else dims  # a list names them
        own = {name: nc[name] for name in names}
        return cls(
            dims,
            tuple(int(nc.dimensions[d].size) for d in dims),
            {name: np.asarray(own[name][...]) for name in sorted(own)},
            {name: str(getattr(variable, "units", "1")) for name, variable in own.items()},
            {name: dims.index(variable.dimensions[0]) for name, variable in own.items()},
        )

    @property
    def names(self) -> list[str]:
        return list(self.labels)

    def keys(self, ids: Mapping[str, Mapping[Any, int]]) -> NDArray[np.int64]:
        """(P,) one number a point, the same for the same labels."""
        total = np.zeros(self.shape, dtype=np.int64)
        for name, labels in self.labels.items():
            own = np.array([ids[name][label] for label in labels.tolist()], dtype=np.int64)
            total = total * len(ids[name]) + own.reshape(
                [-1 if k == self.along[name] else 1 for k in range(total.ndim)]
            )
        return total.ravel()

    def describe(self, place: int) -> str:
        """The labels of a point in words."""
        index = np.unravel_index(place, self.shape) if self.shape else ()
        parts = []
        for name, labels in self.labels.items():
            label = labels[index[self.along[name]]]
            unit = "" if self.units[name] in ("", "1") else f" {self.units[name]}"
            parts.append(f"{name} = {label}" if isinstance(label, str) else f"{name} = {label:.12g}{unit}")
        return ", ".join(parts)


def shared_points(
    sweeps: tuple[FileSweep, FileSweep], files: tuple[Path, Path]
) -> tuple[tuple[Places, Places], tuple[str, ...]]:
    """Places of the points that both files have, in either; and what only one has, in words."""
    ids = {
        name: {label: i for i, label in enumerate(dict.fromkeys(v for s in sweeps for v in s.labels[name].tolist()))}
        for name in sweeps[0].names
    }
    keys = [sweep.keys(ids) for sweep in sweeps]
    _, one, two = np.intersect1d(keys[0], keys[1], return_indices=True)
    lines = []
    for k, (sweep, path) in enumerate(zip(sweeps, files, strict=True)):
        alone = np.flatnonzero(~np.isin(keys[k], keys[1 - k]))
        if len(alone):
            named = "; ".join(sweep.describe(int(place)) for place in alone[:SHOWN])
            lines.append(f"{len(alone)} only in {path}: {named}{'; …' if len(alone) > SHOWN else ''}")
    order = np.argsort(one)
    return (one[order], two[order]), tuple(lines)
