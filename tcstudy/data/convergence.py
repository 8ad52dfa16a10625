"""The convergence file: errors, rates and extrapolated numbers of a study's levels (netCDF-4, CF-1.11).

One file per `tcstudy converge`, complete or not there at all, like the result file. Dimensions are those of the sweep
and the level; each error E has the variables error_E (relative to the norm of the reference) and rate_E by level, and
size_squared_E (that norm squared: it has a unit that CF can write), slope_E, slope_error_E, first_level_E, verdict_E,
expected_E and reason_E by sweep point; each number Q has value_Q and order_Q by level, and limit_Q, uncertainty_Q,
limit_order_Q and exact_Q by sweep point.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tcstudy.data.files import FINISHED, new_dataset, replace_file
from tcstudy.data.provenance import Provenance, global_attributes
from tcstudy.data.records import PointStatus
from tcstudy.data.schema import LEVEL_COORDINATE, STATUS, SWEEP, Dtype, FileVariable, flags
from tcstudy.data.writer import in_file_order, put, put_all, put_axes
from tcstudy.scene.study import Study

Array = NDArray[np.float64]

VERDICTS = ("unknown", "exact", "as_expected", "faster", "slower", "pre_asymptotic", "too_few_levels")
"""What the rates say; stored as flags."""


@dataclass(frozen=True)
class Measure:
    """An error or a number by name: symbol for tables, units (of an error: of its square), meaning."""

    name: str
    symbol: str
    units: str
    long_name: str


ERRORS = (
    Measure("theta_L2", "θ in L²", "K2 m2", "error of the temperature in L2"),
    Measure("theta_H1", "θ in H¹", "K2", "error of the temperature in the H1 seminorm"),
    Measure("u_energy", "u in energy", "N", "error of the displacement in the energy norm"),
    Measure("u_H1", "u in H¹", "m2", "error of the displacement in the H1 seminorm"),
    Measure("u_L2", "u in L²", "m4", "error of the displacement in L2"),
    Measure("u_T_L2", "u_T in L²(Γ_C)", "m3", "error of the tangential displacement in L2 of the contact line"),
    Measure("u_T_max", "u_T in max", "m2", "largest error of the tangential displacement at the contact nodes"),
    Measure("xi_L2", "ξ in L²(Γ_C)", "Pa2 m", "error of the friction traction as a step function in L2"),
    Measure("xi_nodes", "ξ at nodes", "Pa2 m", "error of the friction traction at the contact nodes, weighted by c"),
    Measure("xi_max", "ξ in max", "Pa2", "largest error of the friction traction at the contact nodes"),
)
NUMBERS = (
    Measure("energy", "energy", "J m-1", "energy of the solution"),
    Measure("friction_resultant", "∫ξ", "N m-1", "integral of -S_T over the contact line"),
    Measure("slip_length", "slip length", "m", "length of the contact line that does not stick"),
    Measure("heat_balance", "heat balance", "1", "relative defect of heat convected away against heat put in"),
)


@dataclass(frozen=True)
class ErrorSeries:
    """One error of one sweep point over the levels, relative to `size`, the norm of the reference."""

    error: Array
    size: float
    rate: Array
    slope: float
    slope_error: float
    first_level: int
    verdict: str
    expected: float
    reason: str


@dataclass(frozen=True)
class NumberSeries:
    """One number of one sweep point over the levels, and its extrapolated limit."""

    value: Array
    order: Array
    limit: float
    uncertainty: float
    limit_order: float
    exact: float


_NAN = np.array(np.nan)
UNMEASURED = ErrorSeries(_NAN, np.nan, _NAN, np.nan, np.nan, -1, "unknown", np.nan, "")
"""An error that a point does not have, although other points of the sweep do; it fills all levels."""
NO_NUMBER = NumberSeries(_NAN, _NAN, np.nan, np.nan, np.nan, np.nan)
"""A number that a point does not have, such as the heat balance where no heat problem is solved."""


@dataclass(frozen=True)
class PointConvergence:
    """One sweep point: what came of each level, and the series by name."""

    index: tuple[int, ...]
    status: tuple[PointStatus, ...]
    failures: tuple[str, ...]
    errors: dict[str, ErrorSeries]
    numbers: dict[str, NumberSeries]


@dataclass(frozen=True)
class Convergence:
    """The convergence of a whole study.

    h_max, n_dof, n_contact: (levels,)
    reference:  what errors are measured against, in words;  compared: (levels,) whether a level is compared with it
    """

    h_max: Array
    n_dof: NDArray[np.int32]
    n_contact: NDArray[np.int32]
    reference: str
    compared: NDArray[np.bool_]
    points: tuple[PointConvergence, ...]
    notes: tuple[str, ...]


def default_path(output: Path) -> Path:
    """The convergence file beside a result file."""
    return output.with_name(f"{output.stem}.convergence.nc")


def write_convergence(path: Path, study: Study, convergence: Convergence, provenance: Provenance) -> None:
    """Write a convergence file, replacing an old one in one step. Raises StoreError if that cannot be done."""
    replace_file(path, lambda aside: _write_file(aside, study, convergence, provenance))


def _write_file(file: Path, study: Study, convergence: Convergence, provenance: Provenance) -> None:
    with new_dataset(file) as nc:
        nc.setncatts(global_attributes(study, provenance))
        nc.setncatts({"reference": convergence.reference, "notes": "\n".join(convergence.notes)})
        put_axes(nc, study)
        once = {**vars(convergence), "level": np.arange(len(convergence.h_max))}
        put_all(nc, LEVELS, once, study)
        for variable, value in _by_point(convergence):
            by_level = (len(convergence.h_max),) if "level" in variable.dims else ()
            values = np.empty((*study.shape, *by_level), dtype=object)
            for point in convergence.points:
                values[point.index] = value(point)
            put(nc, variable, study, in_file_order(study, values))
        nc.setncattr(FINISHED, np.int32(1))


Value = Callable[[PointConvergence], Any]
"""What a point has of a variable: a number, a text, or an array by level."""


def _by_point(convergence: Convergence) -> Iterator[tuple[FileVariable, Value]]:
    """Variables by sweep point, with the errors and numbers that some point has."""
    status = FileVariable("status", "i1", "1", "status of the solution", coordinate=True, extra=STATUS)
    yield status, lambda point: np.array(point.status)
    for measure in ERRORS:
        if any(measure.name in point.errors for point in convergence.points):
            for variable, of_error in _error_table(measure):
                yield variable, _of_error(measure.name, of_error)
    for measure in NUMBERS:
        if any(measure.name in point.numbers for point in convergence.points):
            for variable, of_number in _number_table(measure):
                yield variable, _of_number(measure.name, of_number)


def _of_error(name: str, part: Callable[[ErrorSeries], Any]) -> Value:
    return lambda point: part(point.errors.get(name, UNMEASURED))


def _of_number(name: str, part: Callable[[NumberSeries], Any]) -> Value:
    return lambda point: part(point.numbers.get(name, NO_NUMBER))


LEVELS = (
    LEVEL_COORDINATE,
    FileVariable("h_max", "f8", "m", "longest element edge", ("level",)),
    FileVariable("n_dof", "i4", "1", "number of displacement unknowns", ("level",)),
    FileVariable("n_contact", "i4", "1", "number of contact unknowns", ("level",)),
    FileVariable("compared", "i1", "1", "1 if the level is compared with the reference", ("level",)),
)
"""What a level has, by field name of `Convergence`."""

_POINT = (SWEEP,)


def _error_table(measure: Measure) -> tuple[tuple[FileVariable, Callable[[ErrorSeries], Any]], ...]:
    """Variables of one error, and what they hold of its series."""
    name, what = measure.name, measure.long_name

    def kept(part: str, units: str, long_name: str, dtype: Dtype = "f8", **more: Any) -> FileVariable:
        return FileVariable(f"{part}_{name}", dtype, units, f"{long_name}: {what}", _POINT, **more)

    verdict = kept("verdict", "1", "what the rates say", "i1", extra=flags(*VERDICTS))
    size = FileVariable(
        f"size_squared_{name}", "f8", measure.units, f"square of the norm of the reference, for the {what}", _POINT
    )
    return (
        (FileVariable(f"error_{name}", "f8", "1", f"relative {what}"), lambda s: s.error),
        (FileVariable(f"rate_{name}", "f8", "1", f"rate from the level before: {what}"), lambda s: s.rate),
        (size, lambda s: s.size**2),
        (kept("slope", "1", "least-squares order"), lambda s: s.slope),
        (kept("slope_error", "1", "standard error of the order"), lambda s: s.slope_error),
        (kept("first_level", "1", "first asymptotic level, -1 for none", "i4"), lambda s: s.first_level),
        (kept("expected", "1", "expected order"), lambda s: s.expected),
        (kept("reason", "1", "reason of the expected order", "str"), lambda s: s.reason),
        (verdict, lambda s: VERDICTS.index(s.verdict)),
    )


def _number_table(measure: Measure) -> tuple[tuple[FileVariable, Callable[[NumberSeries], Any]], ...]:
    """Variables of one number, and what they hold of its series."""
    name, what, units = measure.name, measure.long_name, measure.units

    def kept(part: str, units: str, long_name: str) -> FileVariable:
        return FileVariable(f"{part}_{name}", "f8", units, f"{long_name}: {what}", _POINT)

    return (
        (FileVariable(f"value_{name}", "f8", units, what), lambda s: s.value),
        (FileVariable(f"order_{name}", "f8", "1", f"order from three levels: {what}"), lambda s: s.order),
        (kept("limit", units, "extrapolated"), lambda s: s.limit),
        (kept("uncertainty", units, "uncertainty of the extrapolated value"), lambda s: s.uncertainty),
        (kept("limit_order", "1", "order of the extrapolation"), lambda s: s.limit_order),
        (kept("exact", units, "exact value where known"), lambda s: s.exact),
    )
