"""The convergence file: errors, rates and extrapolated numbers of a study's levels (netCDF-4, CF-1.11).

One file per `tcstudy converge`, complete or not there at all, like the result file. Dimensions are those of the sweep
and the level; each error E has the variables error_E (relative to the norm of the reference) and rate_E by level, and
size_squared_E (that norm squared: it has a unit that CF can write), slope_E, slope_error_E, first_level_E, verdict_E,
expected_E and reason_E by sweep point; each number Q has value_Q and order_Q by level, and limit_Q, uncertainty_Q,
limit_order_Q and exact_Q by sweep point.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from tcstudy.data import schema
from tcstudy.data.files import FINISHED, replace_file
from tcstudy.data.provenance import Provenance, global_attributes
from tcstudy.data.records import PointStatus
from tcstudy.data.store import ascending, sweep_points
from tcstudy.scene.study import Study

if TYPE_CHECKING:
    import xarray

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
    data = _dataset(study, convergence)
    attributes = global_attributes(study, provenance)
    data.attrs = {**attributes, "reference": convergence.reference, "notes": "\n".join(convergence.notes)}
    data.attrs[FINISHED] = np.int32(1)
    storage = {name: encoding(data[name]) for name in data.variables}
    replace_file(path, lambda aside: data.to_netcdf(aside, engine="netcdf4", encoding=storage))


def encoding(variable: Any) -> dict[str, Any]:
    """How a variable is stored: NaN for missing numbers, with a checksum where HDF5 has one (arrays of numbers)."""
    checked = bool(variable.ndim) and variable.dtype.kind in "iuf"
    floats = variable.dtype.kind == "f" and variable.name not in variable.coords
    return {"_FillValue": float("nan") if floats else None, **({"fletcher32": True} if checked else {})}


def _dataset(study: Study, convergence: Convergence) -> xarray.Dataset:
    sweep = schema.sweep_dims(study)
    shape, levels = study.shape, len(convergence.h_max)
    level = ("level", np.arange(levels, dtype=np.int32), {"long_name": "mesh level", "units": "1"})
    data = sweep_points(study).drop_vars("status").assign_coords(level=level)
    plain = study.units == "none"
    for name, values, units, what in (
        ("h_max", convergence.h_max, "m", "longest element edge"),
        ("n_dof", convergence.n_dof, "1", "number of displacement unknowns"),
        ("n_contact", convergence.n_contact, "1", "number of contact unknowns"),
        ("compared", convergence.compared.astype(np.int8), "1", "1 if the level is compared with the reference"),
    ):
        data[name] = ("level", values, {"long_name": what, "units": "1" if plain else units})

    def put(name: str, dims: tuple[str, ...], get: Any, units: str, what: str, **more: Any) -> None:
        sizes = tuple({"level": levels}.get(d) or shape[sweep.index(d)] for d in dims)
        first = np.asarray(get(convergence.points[0]))
        values = np.empty(sizes, dtype=object if first.dtype.kind in "UO" else first.dtype)
        for point in convergence.points:
            values[point.index] = get(point)
        data[name] = (dims, values, {"long_name": what, "units": "1" if plain else units, **more})

    flags = {"flag_values": np.array([int(s) for s in PointStatus], dtype=np.int8)}
    meanings = " ".join(s.name.lower() for s in PointStatus)
    both = (*sweep, "level")
    put(
        "status",
        both,
        lambda p: np.array(p.status, dtype=np.int8),
        "1",
        "status of the solution",
        standard_name="status_flag",
        flag_meanings=meanings,
        **flags,
    )
    for measure in ERRORS:
        if any(measure.name in p.errors for p in convergence.points):
            _put_error(put, measure, sweep, both)
    for measure in NUMBERS:
        if any(measure.name in p.numbers for p in convergence.points):
            _put_number(put, measure, sweep, both)
    return ascending(data, study)


def _put_error(put: Any, measure: Measure, sweep: Sequence[str], both: Sequence[str]) -> None:
    name, what = measure.name, measure.long_name
    verdicts = {
        "flag_values": np.arange(len(VERDICTS), dtype=np.int8),
        "flag_meanings": " ".join(VERDICTS),
    }
    get = {
        "error": (both, lambda s: s.error, "1", f"relative {what}"),
        "rate": (both, lambda s: s.rate, "1", f"rate from the level before: {what}"),
        "size_squared": (
            sweep,
            lambda s: s.size**2,
            measure.units,
            f"square of the norm of the reference, for the {what}",
        ),
        "slope": (sweep, lambda s: s.slope, "1", f"least-squares order: {what}"),
        "slope_error": (sweep, lambda s: s.slope_error, "1", f"standard error of the order: {what}"),
        "first_level": (sweep, lambda s: np.int32(s.first_level), "1", f"first asymptotic level, -1 for none: {what}"),
        "expected": (sweep, lambda s: s.expected, "1", f"expected order: {what}"),
        "reason": (sweep, lambda s: s.reason, "1", f"reason of the expected order: {what}"),
    }
    for part, (dims, of, units, text) in get.items():
        put(f"{part}_{name}", tuple(dims), lambda p, of=of: of(p.errors.get(name, UNMEASURED)), units, text)
    verdict = lambda p: np.int8(VERDICTS.index(p.errors.get(name, UNMEASURED).verdict))  # noqa: E731
    put(f"verdict_{name}", tuple(sweep), verdict, "1", f"what the rates say: {what}", **verdicts)


def _put_number(put: Any, measure: Measure, sweep: Sequence[str], both: Sequence[str]) -> None:
    name, what, units = measure.name, measure.long_name, measure.units
    get = {
        "value": (both, lambda s: s.value, units, what),
        "order": (both, lambda s: s.order, "1", f"order from three levels: {what}"),
        "limit": (sweep, lambda s: s.limit, units, f"extrapolated: {what}"),
        "uncertainty": (sweep, lambda s: s.uncertainty, units, f"uncertainty of the extrapolated value: {what}"),
        "limit_order": (sweep, lambda s: s.limit_order, "1", f"order of the extrapolation: {what}"),
        "exact": (sweep, lambda s: s.exact, units, f"exact value where known: {what}"),
    }
    for part, (dims, of, unit, text) in get.items():
        put(f"{part}_{name}", tuple(dims), lambda p, of=of: of(p.numbers.get(name, NO_NUMBER)), unit, text)
