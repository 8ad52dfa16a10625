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

from tcstudy.data.convergence import ERRORS, NUMBERS, Measure, encoding
from tcstudy.data.files import FINISHED, StoreError, replace_file
from tcstudy.data.identity import CONTENT
from tcstudy.data.provenance import Provenance, global_attributes, without_paths
from tcstudy.data.records import PointStatus
from tcstudy.data.store import open_results
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
    data = _dataset(study, cost)
    data.attrs = global_attributes(study, provenance) | _own_attributes(cost)
    data.attrs[FINISHED] = np.int32(1)
    storage = {name: encoding(data[name]) for name in data.variables}
    replace_file(path, lambda aside: data.to_netcdf(aside, engine="netcdf4", encoding=storage))


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


def _dataset(study: Study, cost: Cost) -> xarray.Dataset:
    import xarray

    meshes, both = ("family", "level"), ("family", "solver", "level")
    levels, runs = cost.n_dof.shape[1], cost.time.shape[-1]
    names = {
        "family": (np.array(cost.families, dtype=object), "mesh family"),
        "solver": (np.array(cost.solvers, dtype=object), "solver of the contact problem"),
        "level": (np.arange(levels, dtype=np.int32), "mesh level, from coarse to fine"),
        "run": (np.arange(runs, dtype=np.int32), "repetition of the timing"),
    }
    coordinates = {
        n: (n, v, {"long_name": t} | ({"units": "1"} if v.dtype != object else {})) for n, (v, t) in names.items()
    }
    data = xarray.Dataset(coords=coordinates)
    length = "1" if study.units == "none" else "m"
    flags = np.array([int(s) for s in PointStatus], dtype=np.int8)
    meanings = " ".join(s.name.lower() for s in PointStatus)

    def put(name: str, dims: tuple[str, ...], values: Any, what: str, units: str = "1", **more: Any) -> None:
        data[name] = (dims, values, {"long_name": what, "units": units, **more})

    put("h_max", meshes, cost.h_max, "longest element edge", length)
    put("n_dof", meshes, cost.n_dof, "number of displacement unknowns, -1 where there is no mesh")
    put("n_contact", meshes, cost.n_contact, "number of contact unknowns, -1 where there is no mesh")
    status: dict[str, Any] = {"standard_name": "status_flag", "flag_values": flags, "flag_meanings": meanings}
    put("status", both, cost.status, "status of the solution", **status)
    reasons = np.vectorize(without_paths, otypes=[object])(cost.reason)
    data["reason"] = (both, reasons, {"long_name": "why there is no solution"})
    put("time", (*both, "run"), cost.time, "wall time from the body to the displacements", "s")
    for stage in STAGES:
        put(f"time_{stage}", both, cost.stages[stage], f"wall time of the fastest run: {_STAGE_NAMES[stage]}", "s")
    for measure in MEASURES:
        if measure.name in cost.errors:
            what = measure.long_name if measure in ERRORS else f"error of the {measure.long_name}"
            put(f"error_{measure.name}", both, cost.errors[measure.name], f"relative {what}")
            put(
                f"dominated_{measure.name}",
                both,
                cost.dominated[measure.name].astype(np.int8),
                f"whether another is as fast and as accurate: {what}",
                flag_values=np.array([0, 1], dtype=np.int8),
                flag_meanings="on_the_front dominated",
            )
    return data
