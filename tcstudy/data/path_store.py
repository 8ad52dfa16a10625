"""The file of a path: one netCDF-4 file, complete or not there at all, like that of a run."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from tcstudy.data import path_records as schema
from tcstudy.data.files import FINISHED, StoreError, new_dataset, replace_file
from tcstudy.data.path_records import PathRecord
from tcstudy.data.provenance import CONTENT, Provenance, global_attributes, kind_of, without_paths
from tcstudy.data.reading import attributes
from tcstudy.data.schema import FileVariable, edge_flags
from tcstudy.data.writer import put_all
from tcstudy.scene.study import Study

if TYPE_CHECKING:
    import xarray

SHORTFALLS = "shortfalls"
"""Global attribute: what of a path is not as it was asked for, one sentence a line; empty if nothing."""


def write_path(
    path: Path, study: Study, record: PathRecord, provenance: Provenance, shortfalls: Sequence[str] = ()
) -> None:
    """Write a path to `path`, replacing an old file in one step; raises StoreError if that is not possible.

    shortfalls: what is not as it was asked for, in words
    """
    lacks = {SHORTFALLS: without_paths("\n".join(shortfalls))}
    replace_file(path, lambda aside: _write_file(aside, study, record, global_attributes(study, provenance) | lacks))


def open_path(path: Path) -> xarray.Dataset:
    """Open the file of a path lazily; close it after use or open it in a `with`.

    Raises StoreError if there is no file or if it is not that of a path.
    """
    if not is_path(path):
        raise StoreError(f"{path} is the result of a run, not of a path; use tcstudy show or draw")
    import xarray

    return xarray.open_dataset(path, engine="netcdf4")


def is_path(path: Path) -> bool:
    """True for the file of a path, False for that of a run; raises StoreError if it is neither."""
    return kind_of(path) == "path"


def stored_shortfalls(path: Path) -> list[str]:
    """What the file says of a path that is not as it was asked for. Raises StoreError."""
    return [line for line in str(attributes(path).get(SHORTFALLS, "")).split("\n") if line]


def _write_file(file: Path, study: Study, record: PathRecord, general: Mapping[str, Any]) -> None:
    curve, line, solutions = record.curve, record.line, record.solutions
    parts: list[tuple[tuple[FileVariable, ...], Mapping[str, Any]]] = [
        (schema.LINE, vars(line)),
        (schema.LEVEL, {**vars(line), **vars(record)}),
        (schema.CURVE, vars(curve)),
        (
            schema.SOLUTIONS,
            {**vars(solutions), "solution_parameter": solutions.at[solutions.solution_at]},
        ),
    ]
    if record.loop is not None:
        parts.append((schema.LOOP, vars(record.loop)))
    with new_dataset(file) as nc:
        nc.setncatts({**general, **_path_attributes(study, record)})
        for variables, values in parts:
            put_all(nc, variables, values, study)
        nc["edge"].setncatts(edge_flags(line.edge_names))
        nc.setncattr(FINISHED, np.int32(1))


def _path_attributes(study: Study, record: PathRecord) -> dict[str, Any]:
    """What the path is along, and why it ends."""
    assert study.path is not None
    plan = study.path
    loop = {"loop_reason": without_paths(record.loop.loop_reason)} if record.loop is not None else {}
    return {
        CONTENT: "path",
        "parameter": plan.name,
        "parameter_range": np.array([plan.begin, plan.end]),
        "parameter_within": np.array(plan.within),
        "begin_status": record.begin[0],
        "begin_reason": record.begin[1],
        "end_status": record.end[0],
        "end_reason": record.end[1],
        **loop,
    }
