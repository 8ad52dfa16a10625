"""One variable of a result file: what every table of variables is made of, and the status that all of them share."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from enum import IntEnum
from typing import Any, Literal

import numpy as np


class PointStatus(IntEnum):
    """Status of a sweep point in the data (CF status_flag). Anything but OK carries a reason."""

    NOT_RUN = 0
    OK = 1
    NOT_CONVERGED = 2
    INCLUSION_VIOLATED = 3
    SINGULAR = 4
    MESH_FAILED = 5
    ERROR = 6


Dtype = Literal["f8", "i4", "i1", "str"]

SWEEP = "*"
"""Stands for the dimensions of the sweep in a `FileVariable.dims`."""

T, RATE = "t", "J m-1/t"
"""Stand for the units of a path's parameter, and of an energy per unit of it, in a `FileVariable.units`."""

POINT_LEVEL = (SWEEP, "level")
MISSING_COUNT = -1
NOT_RUN = "not run"


@dataclass(frozen=True)
class FileVariable:
    """One netCDF variable.

    units:      SI; a dimensionless study ("none") writes "1" in place of everything but seconds
    dims:       dimension names; SWEEP stands for those of the sweep
    coordinate: True if it locates data: no missing values, no _FillValue
    extra:      further attributes
    no_value:   the flag that stands where there is no value
    """

    name: str
    dtype: Dtype
    units: str
    long_name: str
    dims: tuple[str, ...] = POINT_LEVEL
    coordinate: bool = False
    extra: tuple[tuple[str, Any], ...] = ()
    no_value: int = 0

    @property
    def missing(self) -> float | int | str:
        """What stands where there is no value."""
        of_type: dict[Dtype, float | int | str] = {"f8": float("nan"), "i4": MISSING_COUNT, "str": NOT_RUN}
        return of_type.get(self.dtype, self.no_value)

    @property
    def fill_value(self) -> float | Literal[False]:
        """The _FillValue attribute; False for none."""
        return float("nan") if self.dtype == "f8" and not self.coordinate else False


Extra = tuple[tuple[str, Any], ...]


def flags(*meanings: str, first: int = 0) -> Extra:
    """Attributes of bytes that count `meanings` from `first`."""
    values = np.arange(first, first + len(meanings), dtype=np.int8)
    return (("flag_values", values), ("flag_meanings", " ".join(meanings)))


STATUS: Extra = (("standard_name", "status_flag"), *flags(*(s.name.lower() for s in PointStatus)))
CERTIFIED: Extra = flags("not_certified", "certified")


def edge_flags(edge_names: Sequence[str]) -> dict[str, Any]:
    """Attributes of `edge` that name the contact edges."""
    return dict(flags(*edge_names)) if edge_names else {}
