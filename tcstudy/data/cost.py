"""The file of accuracy against cost: errors and wall times by mesh family, solver and level (netCDF-4, CF-1.11).

One file per `tcstudy cost`, complete or not there at all. Dimensions are family, solver, level and run (repeated
timings). Sizes have (family, level), `time` all four, stages the first three (of the fastest run); each error E has
error_E and dominated_E.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from tcstudy.data.convergence import ERRORS, NUMBERS, Measure
from tcstudy.data.files import FINISHED, StoreError, new_dataset, replace_file
from tcstudy.data.provenance import CONTENT, Provenance, global_attributes, without_paths
from tcstudy.data.schema import LEVEL_COORDINATE, STATUS, FileVariable, flags
from tcstudy.data.store import open_results
from tcstudy.data.writer import put_all, put_names
from tcstudy.scene.study import Study

if TYPE_CHECKING:
    import xarray

Array = NDArray[np.float64]

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


def default_path(output: Path) -> Path:
    """The file of accuracy against cost beside a result file."""
    return output.with_name(f"{output.stem}.cost.nc")


def write_cost(path: Path, study: Study, cost: Cost, provenance: Provenance) -> None:
    """Write the file, replacing an old one in one step. Raises StoreError if that cannot be done."""
    replace_file(path, lambda aside: _write_file(aside, study, cost, provenance))


def _write_file(file: Path, study: Study, cost: Cost, provenance: Provenance) -> None:
    with new_dataset(file) as nc:
        nc.setncatts(global_attributes(study, provenance) | _own_attributes(cost))
        put_names(nc, "family", cost.families, "mesh family", study)
        put_names(nc, "solver", cost.solvers, "solver of the contact problem", study)
        values = {**vars(cost), "level": np.arange(cost.n_dof.shape[1]), "run": np.arange(cost.time.shape[-1])}
        values["reason"] = np.vectorize(without_paths, otypes=[object])(cost.reason)
        values |= {f"time_{stage}": cost.stages[stage] for stage in STAGES}
        values |= {f"error_{name}": errors for name, errors in cost.errors.items()}
        values |= {f"dominated_{name}": worse for name, worse in cost.dominated.items()}
        put_all(nc, TABLE, values, study)
        nc.setncattr(FINISHED, np.int32(1))


def open_cost(path: Path) -> xarray.Dataset:
    """The whole content of a file of accuracy against cost. Raises StoreError if it is none."""
    with open_results(path) as tree:
        data = tree.to_dataset().load()
    if data.attrs.get(CONTENT) != "cost":
        raise StoreError(f"{path} was not written by tcstudy cost")
    return data


def _own_attributes(cost: Cost) -> dict[str, Any]:
    family, solver, level = cost.own
    return {
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


_MESHES, _SOLVED = ("family", "level"), ("family", "solver", "level")


def _time(name: str, long_name: str, *more: str) -> FileVariable:
    return FileVariable(name, "f8", "s", long_name, (*_SOLVED, *more))


def _error(measure: Measure) -> tuple[FileVariable, FileVariable]:
    """An error and whether it is dominated."""
    name, what = measure.name, measure.long_name
    error = what if measure in ERRORS else f"error of the {what}"
    on_front = f"whether another is as fast and as accurate: {error}"
    return (
        FileVariable(f"error_{name}", "f8", "1", f"relative {error}", _SOLVED),
        FileVariable(f"dominated_{name}", "i1", "1", on_front, _SOLVED, extra=flags("on_the_front", "dominated")),
    )


TABLE = (
    LEVEL_COORDINATE,
    FileVariable("run", "i4", "1", "repetition of the timing", ("run",), coordinate=True),
    FileVariable("h_max", "f8", "m", "longest element edge", _MESHES),
    FileVariable("n_dof", "i4", "1", "number of displacement unknowns, -1 where there is no mesh", _MESHES),
    FileVariable("n_contact", "i4", "1", "number of contact unknowns, -1 where there is no mesh", _MESHES),
    FileVariable("status", "i1", "1", "status of the solution", _SOLVED, extra=STATUS),
    FileVariable("reason", "str", "1", "why there is no solution", _SOLVED),
    _time("time", "wall time from the body to the displacements", "run"),
    *(_time(f"time_{stage}", f"wall time of the fastest run: {_STAGE_NAMES[stage]}") for stage in STAGES),
    *(variable for measure in MEASURES for variable in _error(measure)),
)
"""Variables of the file beside the names of families and solvers."""
