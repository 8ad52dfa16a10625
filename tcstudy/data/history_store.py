"""The file of a load history: one netCDF-4 file, written whole again as steps are done, complete or not there at all.

A file in which steps are missing is that of a history that was stopped: the same study goes on from there, and so does
one with more steps behind the same ones.
"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from tcstudy.data import history_records as schema
from tcstudy.data.files import StoreError, write_dataset
from tcstudy.data.history_records import HistoryRecord
from tcstudy.data.provenance import CONTENT, Provenance, global_attributes, kind_of, program, without_paths
from tcstudy.data.reading import attributes, is_foreign
from tcstudy.data.records import LevelRecord, PointStatus
from tcstudy.data.schema import edge_flags
from tcstudy.data.writer import in_file_order, put, put_all, put_axes
from tcstudy.scene.study import Study

if TYPE_CHECKING:
    import netCDF4
    import xarray


def write_history(
    path: Path, study: Study, line: LevelRecord, record: HistoryRecord, provenance: Provenance, kept: str = ""
) -> None:
    """Write all that is known so far to `path`, replacing an old file in one step; raises StoreError."""
    plan = study.history
    assert plan is not None
    loads = schema.load_variables(study)
    told = {CONTENT: "history", "memory": plan.memory.name, "branch": plan.branch, "substeps": _substeps(study)}
    told["loads"] = " ".join(variable.name for variable, _ in loads if variable.dtype == "f8")

    def fill(nc: netCDF4.Dataset) -> None:
        put_axes(nc, study)
        put_all(nc, schema.LINE, vars(line), study)
        nc["edge"].setncatts(edge_flags(line.edge_names))
        put_all(nc, schema.LEVEL, vars(line), study)
        for variable, values in loads:
            put(nc, variable, study, values)
        known = dict(record.arrays())
        for variable in schema.variables(study):
            values = known[variable.name]
            if variable.name == "reason":
                values = np.array([without_paths(one) for one in values], dtype=object)
            shaped = values.reshape((*study.shape, *values.shape[1:]))
            put(nc, variable, study, in_file_order(study, shaped))

    write_dataset(path, global_attributes(study, provenance) | told, fill, kept)


def _substeps(study: Study) -> int:
    """Descents of a step, 0 where its path is followed."""
    plan = study.history
    assert plan is not None
    return plan.substeps or int(plan.memory.healing or plan.branch == "lowest")


def open_history(path: Path) -> xarray.Dataset:
    """Open the file of a history lazily; close it after use. Raises StoreError if it is none."""
    if kind_of(path) != "history":
        raise StoreError(f"{path} is no result of tcstudy history")
    import xarray

    return xarray.open_dataset(path, engine="netcdf4")


def read_known(path: Path, study: Study, steps: int) -> HistoryRecord | None:
    """What a file knows of the first steps of this study's history; None if there is no such file.

    steps: of the history, step 0 included. Raises StoreError where the file has other loads or a history of another
    program; that its study is this one but for its steps is for the caller to judge.
    """
    if not path.is_file() or not path.stat().st_size or is_foreign(path):
        return None
    remedy = "give another --output, or --force to replace it"
    try:
        found = attributes(path)
        if kind_of(path) != "history":
            raise StoreError(f"{path} holds results of another command")
        if found.get("program") != program():
            raise StoreError(f"{path} holds this study as another version of the program or its libraries computed it")
        with open_history(path) as opened:
            data = opened.load()
    except StoreError as error:
        raise StoreError(f"{error}; {remedy}") from error
    both = min(steps, data.sizes["step"])
    for variable, values in schema.load_variables(study):
        if variable.dtype == "f8" and not (
            variable.name in data and np.array_equal(data[variable.name].values[:both], values[:both])
        ):
            raise StoreError(f"{path} holds a history with other steps; {remedy}")
    return _record(data, study, steps, both)


def _record(data: Any, study: Study, steps: int, both: int) -> HistoryRecord:
    order = np.argsort(in_file_order(study, np.arange(len(study.scenes)).reshape(study.shape)).ravel(), kind="stable")
    m, points = data.sizes["node"], len(study.scenes)
    record = HistoryRecord.empty(points, steps, m)
    for variable in schema.variables(study):
        stored: NDArray[Any] = data[variable.name].values
        values = stored.reshape((points, *stored.shape[len(study.shape) :]))[order]
        if variable.name == "reason":
            record.reason = [str(one) for one in values]
        elif variable.dims[-1] in ("step", "node"):
            getattr(record, variable.name)[:, :both] = values[:, :both]
        else:
            getattr(record, variable.name)[...] = values
    return record


def steps_done(record: HistoryRecord) -> NDArray[np.intp]:
    """(P,) steps that every point has, the one included in which it failed."""
    return np.count_nonzero(record.status != PointStatus.NOT_RUN, axis=1)
