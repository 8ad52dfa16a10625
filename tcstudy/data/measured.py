"""The files of `tcstudy converge` and `tcstudy cost`: errors and rates over levels, errors against wall time (CF-1.11).

Convergence has the dimensions of the sweep and the level; each error E has error_E (relative to the norm of the
reference) and rate_E by level, and size_squared_E (that norm squared: it has a unit that CF can write), slope_E,
slope_error_E, first_level_E, verdict_E, expected_E and reason_E by sweep point; each number Q has value_Q and order_Q
by level, and limit_Q, uncertainty_Q, limit_order_Q and exact_Q by sweep point.

Accuracy against cost has the dimensions family, solver, level and run (repeated timings). Sizes have (family, level),
`time` all four, stages the first three (of the fastest run); each error E has error_E and dominated_E.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from tcstudy.data.files import write_dataset
from tcstudy.data.provenance import CONTENT, Provenance, global_attributes, without_paths
from tcstudy.data.records import PointStatus
from tcstudy.data.schema import LEVEL_COORDINATE, POINT_LEVEL, STATUS, SWEEP, Dtype, FileVariable, flags
from tcstudy.data.writer import geometry_dims, in_file_order, put, put_all, put_axes, put_names
from tcstudy.scene.study import Study

if TYPE_CHECKING:
    import netCDF4

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
    errors: dict[str, ErrorSeries]
    numbers: dict[str, NumberSeries]


@dataclass(frozen=True)
class Convergence:
    """The convergence of a whole study.

    h_max, n_dof, n_contact: (levels,), in a sweep over geometries (…, levels) by the axes that change them, in the
    order of the file
    reference:  what errors are measured against, in words;  compared: alike, whether a level is compared with it
    """

    h_max: Array
    n_dof: NDArray[np.int32]
    n_contact: NDArray[np.int32]
    reference: str
    compared: NDArray[np.bool_]
    points: tuple[PointConvergence, ...]
    notes: tuple[str, ...]


def write_convergence(path: Path, study: Study, convergence: Convergence, provenance: Provenance) -> None:
    """Write a convergence file, replacing an old one in one step. Raises StoreError if that cannot be done."""
    own = {"reference": convergence.reference, "notes": "\n".join(convergence.notes)}
    told = global_attributes(study, provenance) | own
    write_dataset(path, told, lambda nc: _fill_convergence(nc, study, convergence))


def _fill_convergence(nc: netCDF4.Dataset, study: Study, convergence: Convergence) -> None:
    put_axes(nc, study)
    levels, points = convergence.h_max.shape[-1], convergence.points
    put(nc, LEVEL_COORDINATE, study, np.arange(levels))
    by_geometry = (*geometry_dims(study), "level")
    put_all(nc, [replace(one, dims=by_geometry) for one in LEVELS], vars(convergence), study)

    def put_points(variable: FileVariable, of_points: Iterable[Any]) -> None:
        by_level = (levels,) if "level" in variable.dims else ()
        values = np.empty((*study.shape, *by_level), dtype=object)
        for point, value in zip(points, of_points, strict=True):
            values[point.index] = value
        put(nc, variable, study, in_file_order(study, values))

    status = FileVariable("status", "i1", "1", "status of the solution", coordinate=True, extra=STATUS)
    put_points(status, (np.array(point.status) for point in points))
    for measure in (*ERRORS, *NUMBERS):
        error = measure in ERRORS
        having = [(point.errors if error else point.numbers).get(measure.name) for point in points]
        if any(having):
            series = [vars(one or (UNMEASURED if error else NO_NUMBER)) for one in having]
            for part, dtype, meaning in _ERROR_PARTS if error else _NUMBER_PARTS:
                dims = POINT_LEVEL if part in _BY_LEVEL else (SWEEP,)
                units = measure.units if part in _IN_UNITS else "1"
                extra = flags(*VERDICTS) if part == "verdict" else ()
                name, what = f"{part}_{measure.name}", meaning.format(measure.long_name)
                variable = FileVariable(name, dtype, units, what, dims, extra=extra)
                put_points(variable, (_stored(one, part) for one in series))


def _stored(series: dict[str, Any], part: str) -> Any:
    """What the file has of a series by point: a number, a text, or an array by level."""
    if part == "size_squared":
        return series["size"] ** 2
    return VERDICTS.index(series[part]) if part == "verdict" else series[part]


LEVELS = (
    FileVariable("h_max", "f8", "m", "longest element edge", ("level",)),
    FileVariable("n_dof", "i4", "1", "number of displacement unknowns", ("level",)),
    FileVariable("n_contact", "i4", "1", "number of contact unknowns", ("level",)),
    FileVariable("compared", "i1", "1", "1 if the level is compared with the reference", ("level",)),
)
"""What a level of a geometry has, by field name of `Convergence`."""

_ERROR_PARTS: tuple[tuple[str, Dtype, str], ...] = (
    ("error", "f8", "relative {}"),
    ("rate", "f8", "rate from the level before: {}"),
    ("size_squared", "f8", "square of the norm of the reference, for the {}"),
    ("slope", "f8", "least-squares order: {}"),
    ("slope_error", "f8", "standard error of the order: {}"),
    ("first_level", "i4", "first asymptotic level, -1 for none: {}"),
    ("expected", "f8", "expected order: {}"),
    ("reason", "str", "reason of the expected order: {}"),
    ("verdict", "i1", "what the rates say: {}"),
)
"""What is kept of an ErrorSeries: name before that of the measure, type, meaning."""
_NUMBER_PARTS: tuple[tuple[str, Dtype, str], ...] = (
    ("value", "f8", "{}"),
    ("order", "f8", "order from three levels: {}"),
    ("limit", "f8", "extrapolated: {}"),
    ("uncertainty", "f8", "uncertainty of the extrapolated value: {}"),
    ("limit_order", "f8", "order of the extrapolation: {}"),
    ("exact", "f8", "exact value where known: {}"),
)
"""The same of a NumberSeries."""
_IN_UNITS = ("size_squared", "value", "limit", "uncertainty", "exact")
_BY_LEVEL = ("error", "rate", "value", "order")


OWN = "study"
"""Name of the study's own meshes where they belong to none of the families."""
STAGES = ("mesh", "assemble", "condense", "solve", "steps")
"""Parts of the wall time, in the order they are spent."""
_STAGE_NAMES = {
    "mesh": "geometry and meshing",
    "assemble": "assembly",
    "condense": "temperature, factorisation, condensation, certificates and displacements",
    "solve": "solution of the contact problem",
    "steps": "all levels before and error estimates, where the mesh depends on them",
}
MEASURES: tuple[Measure, ...] = (*ERRORS, *(m for m in NUMBERS if m.name in ("energy", "friction_resultant")))
"""Errors that a chart may be of, each relative to the reference."""


@dataclass(frozen=True)
class Cost:
    """What accuracy costs for one scene, over f mesh families, s solvers, l levels and r runs.

    families:  names; "study" stands for meshes of the study that belong to none of the three families
    solvers:   names, the first is the study's own
    h_max, n_dof, n_contact: (f, l), NaN or −1 where the family has no such level
    status:    (f, s, l), NOT_RUN where there is nothing;  reason: (f, s, l) texts
    time:      (f, s, l, r) wall time from the body to the displacements [s]
    stages:    (f, s, l) by name, of the fastest run
    errors:    (f, s, l) by measure, relative
    dominated: (f, s, l) by measure: another is as accurate and as fast, and better in one of the two
    own:       (family, solver, level) of the study's settings
    reference: what errors are measured against, in words;  reference_error: its own estimated relative error in the
               energy norm, 0 if it is exact
    point:     labels of the sweep point by axis, in words
    notes:     what to know when reading
    """

    families: tuple[str, ...]
    solvers: tuple[str, ...]
    h_max: Array
    n_dof: NDArray[np.int32]
    n_contact: NDArray[np.int32]
    status: NDArray[np.int8]
    reason: NDArray[np.object_]
    time: Array
    stages: dict[str, Array]
    errors: dict[str, Array]
    dominated: dict[str, NDArray[np.bool_]]
    own: tuple[int, int, int]
    reference: str
    reference_error: float
    point: str = ""
    notes: tuple[str, ...] = field(default=())


def write_cost(path: Path, study: Study, cost: Cost, provenance: Provenance) -> None:
    """Write the file, replacing an old one in one step. Raises StoreError if that cannot be done."""
    family, solver, level = cost.own
    own = {
        CONTENT: "cost",
        "reference": cost.reference,
        "reference_error": float(cost.reference_error),
        "own_family": cost.families[family],
        "own_solver": cost.solvers[solver],
        "own_level": np.int32(level),
        "point": cost.point,
        "runs": np.int32(cost.time.shape[-1]),
        "notes": "\n".join(cost.notes),
    }
    values = {**vars(cost), "level": np.arange(cost.n_dof.shape[1]), "run": np.arange(cost.time.shape[-1])}
    values["reason"] = np.vectorize(without_paths, otypes=[object])(cost.reason)
    for part, by_name in (("time", cost.stages), ("error", cost.errors), ("dominated", cost.dominated)):
        values |= {f"{part}_{name}": array for name, array in by_name.items()}

    def fill(nc: netCDF4.Dataset) -> None:
        put_names(nc, "family", cost.families, "mesh family", study)
        put_names(nc, "solver", cost.solvers, "solver of the contact problem", study)
        put_all(nc, COST_TABLE, values, study)

    write_dataset(path, global_attributes(study, provenance) | own, fill)


_MESHES, _SOLVED = ("family", "level"), ("family", "solver", "level")


def _time(name: str, long_name: str, *more: str) -> FileVariable:
    return FileVariable(name, "f8", "s", long_name, (*_SOLVED, *more))


def _charted_error(measure: Measure) -> tuple[FileVariable, FileVariable]:
    """An error and whether it is dominated."""
    error = measure.long_name if measure in ERRORS else f"error of the {measure.long_name}"
    of, on_front = f"whether another is as fast and as accurate: {error}", flags("on_the_front", "dominated")
    return (
        FileVariable(f"error_{measure.name}", "f8", "1", f"relative {error}", _SOLVED),
        FileVariable(f"dominated_{measure.name}", "i1", "1", of, _SOLVED, extra=on_front),
    )


COST_TABLE = (
    LEVEL_COORDINATE,
    FileVariable("run", "i4", "1", "repetition of the timing", ("run",), coordinate=True),
    FileVariable("h_max", "f8", "m", "longest element edge", _MESHES),
    FileVariable("n_dof", "i4", "1", "number of displacement unknowns, -1 where there is no mesh", _MESHES),
    FileVariable("n_contact", "i4", "1", "number of contact unknowns, -1 where there is no mesh", _MESHES),
    FileVariable("status", "i1", "1", "status of the solution", _SOLVED, extra=STATUS),
    FileVariable("reason", "str", "", "why there is no solution", _SOLVED),
    _time("time", "wall time from the body to the displacements", "run"),
    *(_time(f"time_{stage}", f"wall time of the fastest run: {_STAGE_NAMES[stage]}") for stage in STAGES),
    *(variable for measure in MEASURES for variable in _charted_error(measure)),
)
"""Variables of the file beside the names of families and solvers."""
