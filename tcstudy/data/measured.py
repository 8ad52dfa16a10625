"""The files of `tcstudy converge` and `tcstudy cost`: errors and rates over levels, errors against wall time (CF-1.11).

Convergence has the dimensions of the sweep and the level; each error E has error_E (relative to the norm of the
reference) and rate_E by level, and size_squared_E (that norm squared: it has a unit that CF can write), slope_E,
slope_error_E, first_level_E, verdict_E, expected_E and reason_E by sweep point; each number Q has value_Q and order_Q
by level, and limit_Q, uncertainty_Q, limit_order_Q and exact_Q by sweep point.

Accuracy against cost has the dimensions family, solver, level and run (repeated timings). Sizes have (family, level),
`time` all four, stages the first three (of the fastest run); each error E has error_E and dominated_E.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from tcstudy.data.schema import LEVEL_COORDINATE, POINT_LEVEL, STATUS, SWEEP, Dtype, FileVariable, flags
from tcstudy.data.store import Record, missing
from tcstudy.data.writer import geometry_dims
from tcstudy.scene.study import Study

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
BY_ITSELF = {"estimate_u_energy": "error_estimate", "bound_u_energy": "error_bound_relative"}
"""What a study with a guarantee says of the error of the displacement by itself, by the names in a run."""
NUMBERS = (
    Measure("energy", "energy", "J m-1", "energy of the solution"),
    Measure("friction_resultant", "∫ξ", "N m-1", "integral of -S_T over the contact line"),
    Measure("slip_length", "slip length", "m", "length of the contact line that does not stick"),
    Measure("heat_balance", "heat balance", "1", "relative defect of heat convected away against heat put in"),
)


class Measured(NamedTuple):
    """The convergence of a study, before it is a record.

    points:    of every sweep point its status (levels,) and what it has of the variables of `convergence_table`
    meshes:    h_max, n_dof, n_contact and compared, whether a level is compared with the reference: (levels,), in a
               sweep over geometries (…, levels) by the axes that change them, in the order of the file
    reference: what errors are measured against, in words
    """

    points: Sequence[Mapping[str, Any]]
    meshes: Mapping[str, NDArray[Any]]
    reference: str
    notes: Sequence[str]


def convergence_record(study: Study, measured: Measured) -> Record:
    """What the file of a convergence holds. What a point does not have, although others do, is missing there."""
    levels = measured.meshes["h_max"].shape[-1]
    values: dict[str, Any] = {"level": np.arange(levels), **measured.meshes}
    table = convergence_table(study)
    for variable in table:
        having = [i for i, point in enumerate(measured.points) if variable.name in point]
        if having:
            shape = (len(measured.points), *((levels,) if "level" in variable.dims else ()))
            rows = values[variable.name] = missing(variable, shape)
            if variable.dtype == "str":
                rows[:] = ""
            for i in having:
                rows[i] = measured.points[i][variable.name]
    attributes = {"reference": measured.reference, "notes": "\n".join(measured.notes)}
    return Record("convergence", table, values, attributes)


def convergence_table(study: Study) -> tuple[FileVariable, ...]:
    """The variables that the convergence of a study may have."""
    by_geometry = (*geometry_dims(study), "level")
    found = [LEVEL_COORDINATE, *(replace(one, dims=by_geometry) for one in LEVELS)]
    found.append(FileVariable("status", "i1", "1", "status of the solution", coordinate=True, extra=STATUS))
    for measure in (*ERRORS, *NUMBERS):
        for part, dtype, meaning in _ERROR_PARTS if measure in ERRORS else _NUMBER_PARTS:
            dims = POINT_LEVEL if part in _BY_LEVEL else (SWEEP,)
            units = measure.units if part in _IN_UNITS else "1"
            extra = flags(*VERDICTS) if part == "verdict" else ()
            name, what = f"{part}_{measure.name}", meaning.format(measure.long_name)
            found.append(FileVariable(name, dtype, units, what, dims, extra=extra))
    if study.mesh.guarantee:
        words = ("estimated relative", "proved bound of the relative")
        found += [
            FileVariable(n, "f8", "1", f"{w} {ERRORS[2].long_name}") for n, w in zip(BY_ITSELF, words, strict=True)
        ]
    return tuple(found)


LEVELS = (
    FileVariable("h_max", "f8", "m", "longest element edge", ("level",)),
    FileVariable("n_dof", "i4", "1", "number of displacement unknowns", ("level",)),
    FileVariable("n_contact", "i4", "1", "number of contact unknowns", ("level",)),
    FileVariable("compared", "i1", "1", "1 if the level is compared with the reference", ("level",)),
)
"""What a level of a geometry has."""

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
"""What is kept of an error: name before that of the measure, type, meaning."""
_NUMBER_PARTS: tuple[tuple[str, Dtype, str], ...] = (
    ("value", "f8", "{}"),
    ("order", "f8", "order from three levels: {}"),
    ("limit", "f8", "extrapolated: {}"),
    ("uncertainty", "f8", "uncertainty of the extrapolated value: {}"),
    ("limit_order", "f8", "order of the extrapolation: {}"),
    ("exact", "f8", "exact value where known: {}"),
)
"""The same of a number."""
_IN_UNITS = ("size_squared", "value", "limit", "uncertainty", "exact")
_BY_LEVEL = ("error", "rate", "value", "order")


OWN = "study"
"""Name of the study's own meshes where they belong to none of the families, in a file of cost."""
STAGES = ("mesh", "assemble", "condense", "solve", "steps")
"""Parts of the wall time, in the order they are spent."""
_STAGE_NAMES = {
    "mesh": "geometry and meshing",
    "assemble": "assembly",
    "condense": "temperature, factorisation, condensation, certificates and displacements",
    "solve": "solution of the contact problem",
    "steps": "all levels before and error estimates, where the mesh depends on them",
}
BOUND = Measure("u_bound", "u in energy, proved", "1", "proved bound of the error of the displacement, energy norm")
MEASURES: tuple[Measure, ...] = (*ERRORS, BOUND, *(m for m in NUMBERS if m.name in ("energy", "friction_resultant")))
"""Errors that a chart may be of, each relative to the reference; the bound needs none, but a guarantee of the study."""


_MESHES, _SOLVED = ("family", "level"), ("family", "solver", "level")


def _time(name: str, long_name: str, *more: str) -> FileVariable:
    return FileVariable(name, "f8", "s", long_name, (*_SOLVED, *more))


def _charted_error(measure: Measure) -> tuple[FileVariable, FileVariable]:
    """An error and whether it is dominated."""
    error = measure.long_name if measure in (*ERRORS, BOUND) else f"error of the {measure.long_name}"
    of, on_front = f"whether another is as fast and as accurate: {error}", flags("on_the_front", "dominated")
    return (
        FileVariable(f"error_{measure.name}", "f8", "1", f"relative {error}", _SOLVED),
        FileVariable(f"dominated_{measure.name}", "i1", "1", of, _SOLVED, extra=on_front),
    )


COST_TABLE = (
    FileVariable("family", "str", "", "mesh family", ("family",), coordinate=True),
    FileVariable("solver", "str", "", "solver of the contact problem", ("solver",), coordinate=True),
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
"""What a file of accuracy against cost may hold; another is as accurate and as fast as what is dominated, and better
in one of the two."""
