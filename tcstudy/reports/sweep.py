"""What a picture of a whole sweep shows, read from a result file: one number at the points of one level.

Points without a solution have no number: they are left out, counted, and said with their status.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tcstudy.data.records import PointStatus
from tcstudy.data.schema import NOT_ALL
from tcstudy.data.store import open_results
from tcstudy.errors import DrawError
from tcstudy.reports.select_point import (
    Fixed,
    Value,
    axis_names,
    fitting,
    labels_by_point,
    level_number,
    parameter,
    quantity,
)
from tcstudy.reports.sentences import several
from tcstudy.reports.text import axis_unit, counted, labels, named, study_unit

Array = NDArray[np.float64]


COUNTS = ("solutions", "stable_solutions")
"""Numbers of equilibria."""


@dataclass(frozen=True)
class DrawnParameter:
    """A swept parameter of a picture.

    labels:  its different values, ascending if they are numbers
    numbers: the same as numbers in `unit`, None if one of them is a text
    place:   (P,) which of them each point has
    drawn:   from a distribution, so that neighbours have nothing in common
    """

    name: str
    labels: tuple[str, ...]
    numbers: Array | None
    unit: str
    place: NDArray[np.intp]
    drawn: bool = False


@dataclass(frozen=True)
class SweepPicture:
    """P points of a sweep on one level, and one number at each of them.

    at_least: (P,) of numbers of equilibria, which are not proved to be all; None for any other number
    values:  (P,) the number in the units of the file; NaN where there is none
    status:  (P,) PointStatus;  proved: (P,) proved to be the only solution;  several: (P,) starts led to solutions of
             different energies
    """

    title: str
    level: int
    quantity: str
    long_name: str
    units: str
    parameters: tuple[DrawnParameter, ...]
    fixed: tuple[Fixed, ...]
    values: Array
    status: NDArray[np.int_]
    proved: NDArray[np.bool_]
    several: NDArray[np.bool_]
    at_least: NDArray[np.bool_] | None = None

    @property
    def left_out(self) -> str:
        """How many points have no number and why, "2 of 9 points left out: 2 not converged"; empty if all have one."""
        missing = np.isnan(self.values)
        if not missing.any():
            return ""
        reasons = [
            f"{count} {'without a value' if status == PointStatus.OK else named(PointStatus(int(status)))}"
            for status, count in zip(*np.unique(self.status[missing], return_counts=True), strict=True)
        ]
        return f"{int(missing.sum())} of {counted(len(missing), 'point')} left out: {', '.join(reasons)}"

    @property
    def words(self) -> str:
        """What the points have in common, for messages."""
        parts = [one.words + (" (its first value)" if one.first else "") for one in self.fixed]
        return ", ".join(filter(None, [*parts, f"level {self.level}", self.left_out]))


def read_sweep(
    path: Path, along: tuple[str, ...], number: str, point: Mapping[str, Value] | None, level: int
) -> SweepPicture:
    """Read the points of a sweep with the labels `point`, along the parameters `along` (see `fitting`).

    Raises StoreError if `path` is no complete result file, DrawError for names that it does not have.
    """
    with open_results(path) as tree:
        data = tree.to_dataset()
        if not axis_names(data):
            raise DrawError("the file has one point and no swept parameter; draw the point, without x, y and map")
        names = tuple(parameter(data, given) for given in along)
        if len(set(names)) < len(names):
            raise DrawError(f"{names[0]} is named twice; name two different swept parameters")
        name = quantity(data, number)
        keep, fixed = fitting(data, point, names)
        at = data.isel(level=level_number(data, level)).load()
        dims = [str(dim) for dim in at["status"].dims]
        needed = [key for key in (name, "status", "unique", "start_energy", "complete") if key in at]
        flat = {key: at[key].transpose(*dims, ...).values.reshape(len(keep), -1)[keep] for key in needed}
        by_point = labels_by_point(data)
        status = flat["status"][:, 0]
        unique = flat["unique"][:, 0] == 1 if "unique" in flat else np.zeros(len(status), dtype=bool)
        values = flat[name][:, 0].astype(float)
        good = (status == PointStatus.OK) & np.isfinite(values) & ((values != -1) | (flat[name].dtype.kind == "f"))
        return SweepPicture(
            title=str(data.attrs["title"]),
            level=level_number(data, level),
            quantity=name,
            long_name=str(data[name].attrs.get("long_name", name)),
            units=str(data[name].attrs.get("units", "1")),
            parameters=tuple(_parameter(data[one], one, by_point[one][keep]) for one in names),
            fixed=tuple(fixed),
            values=np.where(good, values, np.nan),
            status=status,
            proved=unique,
            at_least=flat["complete"][:, 0] == NOT_ALL if name in COUNTS and "complete" in flat else None,
            several=several(flat.get("start_energy", np.zeros((len(status), 1))), unique),
        )


def _parameter(axis: Any, name: str, held: NDArray[Any]) -> DrawnParameter:
    """The different labels among those that the points have."""
    if held.dtype.kind in "OUS":
        texts = list(dict.fromkeys(str(one) for one in axis.values if one in set(held.tolist())))
        place = np.array([texts.index(str(one)) for one in held], dtype=np.intp)
        return DrawnParameter(name, tuple(texts), None, "1", place)
    different, place = np.unique(held, return_inverse=True)
    divisor, unit = study_unit(axis.attrs) or axis_unit(different, str(axis.attrs["units"]))
    numbers = different / divisor
    drawn = "distribution" in axis.attrs
    return DrawnParameter(name, tuple(labels(numbers.tolist())), numbers, unit, place.ravel(), drawn)
