"""Reading finished files: with xarray, and as the records that they were written of, to the bit.

Records are read to append to a file or to mend it: they go through the one writer again. The study
of a file is read by `tcstudy.study.append`. The group `live` is not read, because it is computed
from the whole sweep.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from itertools import product
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from tcstudy.data import schema
from tcstudy.data.bodies import Cut, StoredBody
from tcstudy.data.files import OTHER_OUTPUT, Kind, attributes, kind_of, reading
from tcstudy.data.labelled import LabelledTable
from tcstudy.data.records import BlockRecord, LevelRecord
from tcstudy.data.schema import GEOMETRIES, SWEEP, PointStatus, line_variables
from tcstudy.data.store import numbers
from tcstudy.data.tables import history_variables, load_variables, step_record
from tcstudy.data.variables import Places, tile_shape, tiles
from tcstudy.errors import StoreError
from tcstudy.scene.study import Axis, Study

if TYPE_CHECKING:
    import netCDF4
    import xarray


def open_results(path: Path) -> xarray.DataTree:
    """Open a result file lazily; close it after use or open it in a `with`.

    Raises StoreError if there is no file, if it is not a result file or if its run has not
    finished.
    """
    attributes(path)
    # here, because a run needs no xarray and its import takes longer than writing the file
    import xarray

    return xarray.open_datatree(path, engine="netcdf4")


def open_root(path: Path, group: str = "") -> xarray.Dataset:
    """Open the root group of a result file, or another group, lazily.

    A file of many geometries takes less time than with `open_results`. Raises StoreError.
    """
    attributes(path)
    import xarray

    return xarray.open_dataset(path, engine="netcdf4", group=group or None)


def load_root(path: Path, kind: Kind | None = None) -> xarray.Dataset:
    """Return the root group of a result file, read whole.

    Raises StoreError if it is no result file, or not of this kind.
    """
    if kind is not None:
        stored_kind = kind_of(path)
        if stored_kind != kind:
            raise StoreError(f"{path} holds a {stored_kind}, not a {kind}; use tcstudy show")
    with open_root(path) as data:
        return data.load()


def load_table(path: Path, without: tuple[str, ...] = ()) -> LabelledTable:
    """Return the root group of a result file for reports, except for variables of these names.

    xarray is not imported. Raises StoreError.
    """
    with opened(path) as nc:
        return LabelledTable.of(nc, without)


def sweep_dims(data: Any) -> list[str]:
    """Return the dimensions of the sweep of a root dataset; none if it has one point."""
    return [str(dim) for dim in data["status"].dims if dim not in ("level", "step")]


def each_point(data: Any) -> list[dict[str, int]]:
    """Return the index of every point along each sweep dimension, in C order."""
    dims = sweep_dims(data)
    ranges = (range(data.sizes[dim]) for dim in dims)
    return [dict(zip(dims, index, strict=True)) for index in product(*ranges)]


def by_point(values: Any, data: Any) -> NDArray[Any]:
    """Return (P, …) values of a variable along the sweep of `data`, its points in C order."""
    dims = sweep_dims(data)
    transposed = values.transpose(*dims, ...)
    count = math.prod(transposed.shape[: len(dims)])
    rows: NDArray[Any] = transposed.values.reshape(count, *transposed.shape[len(dims) :])
    return rows


def axis_names(data: Any) -> list[str]:
    """Return the names of the swept parameters of a root dataset."""
    sweep = set(sweep_dims(data))
    coordinates = (name for name in data.coords if data[name].dims)
    return [str(name) for name in coordinates if set(data[name].dims) <= sweep]


ASKED = ("force_", "work_", "section_force_", "probe_", "reaction_", "theta_mean_", "von_mises_")
"""Prefixes of the variables on request of `output.probes` and `output.quantities`."""


def asked(data: Any) -> list[str]:
    """Return the names of the variables on request of `output`, in the order of the file.

    A load `force_x` of a history is not one of them.
    """
    loads = str(data.attrs.get("loads", "")).split()
    names = (str(name) for name in data.data_vars)
    return [name for name in names if name.startswith(ASKED) and name not in loads]


def of_largest(data: Any) -> Any:
    """Return the table of a run with the largest value of a level over its geometries."""
    if GEOMETRIES not in data.attrs:
        return data
    largest = dict[str, Any]()
    for name in ("h_max", "n_dof", "n_contact", "time_mesh", "time_assemble"):
        if name in data:
            largest[name] = data[name].max([dim for dim in data[name].dims if dim != "level"])
    return data.assign(largest)


Values = NDArray[Any]
MAX_VALUES = 2**22
"""Numbers of one variable that are in memory at a time."""


@contextmanager
def unmasked(path: Path) -> Iterator[netCDF4.Dataset]:
    """Open a file that is known to be a result, without masks."""
    import netCDF4

    with netCDF4.Dataset(path) as nc:
        nc.set_auto_mask(False)
        yield nc


@contextmanager
def opened(path: Path, group: str = "") -> Iterator[netCDF4.Dataset]:
    """Open a finished file, or a group of it, without masks. Raises StoreError."""
    with reading(path), unmasked(path) as nc:
        yield nc[group] if group else nc


def read_level(body: StoredBody, level: int) -> LevelRecord:
    """Return the record of a level, without the arrays of `live`."""
    group = body.group(level)
    values = dict[str, Any]()
    for name in ("arclength", "x", "y", "c", "edge"):
        values[name] = body.read(group[name], level)
    for name in ("h_max", "n_dof", "n_contact", "time_mesh", "time_assemble"):
        values[name] = body.once(name, level)
    if "stop" in body.nc.variables:
        values["stop"] = str(body.once("stop", level))
    meanings = str(body.attributes(group["edge"]).get("flag_meanings", ""))
    fields = dict[str, Values]()
    once = (*schema.MESH, *schema.RIM, schema.REGION, *schema.HELD[:-1], *schema.JOINTS)
    for variable in (*once, *schema.OPENING):
        if variable.name in group.variables and SWEEP not in variable.dims:
            array = body.read(group[variable.name], level)
            if len(array):
                fields[variable.name] = array
    return LevelRecord(level=level, **values, edge_names=tuple(meanings.split()), fields=fields)


def read_blocks(
    body: StoredBody, study: Study, places: Places, selected: NDArray[np.bool_]
) -> Iterator[BlockRecord]:
    """Yield the points of a stored body as blocks of another study.

    places:   (P,) of the points of the body, in its order, in the sweep of `study`
    selected: (points of study, levels) points to yield; those that were not run are left out
    """
    levels = body.levels
    for level in range(body.nc.dimensions["level"].size):
        widths = body.sizes(level) if level in levels else []
        tile = tile_shape(body.shape, max(1, MAX_VALUES // max(32, *widths, 1)))
        for cut, start, stop in tiles(body.shape, tile):
            status = body.rows(body.nc["status"], level, cut)
            is_selected = selected[places[start:stop], level]
            rows = np.flatnonzero((status != PointStatus.NOT_RUN) & is_selected)
            if not len(rows):
                continue
            reasons = body.rows(body.nc["reason"], level, cut)[rows]
            values = _numbers(body, study, level, cut, rows)
            solutions = dict[str, Values]()
            if level in levels:
                values |= _line_values(body, study, level, cut, rows)
                solutions = _solutions(body, level, places, start + rows)
            yield BlockRecord(
                level,
                study.shape,
                places[start + rows],
                status[rows],
                reasons={row: str(reason) for row, reason in enumerate(reasons) if reason},
                u_T=values.pop("u_T", None),
                xi=values.pop("xi", None),
                sticks=values.pop("sticks", None),
                opening=values.pop("opening", None),
                S_N=values.pop("S_N", None),
                rests_N=values.pop("rests_N", None),
                fields={v.name: values.pop(v.name) for v in schema.FIELDS if v.name in values},
                numbers=values,
                solutions=solutions,
            )


def _numbers(
    body: StoredBody, study: Study, level: int, cut: Cut, rows: Places
) -> dict[str, Values]:
    """Return the (R, …) numbers of points at rows of a cut, by name."""
    names = [v.name for v in numbers(study) if v.name in body.nc.variables]
    return {name: body.rows(body.nc[name], level, cut)[rows] for name in names}


def _line_values(
    body: StoredBody, study: Study, level: int, cut: Cut, rows: Places
) -> dict[str, Values]:
    """Return (R, …) values along the contact line, and fields, at rows of a cut, by name."""
    values = dict[str, Values]()
    group = body.group(level)
    line = (*schema.CONTACT, *schema.OPENING, *line_variables(study), *schema.HELD)
    for variable in (*line, *schema.FIELDS):
        if SWEEP in variable.dims and variable.name in group.variables:
            array = body.rows(group[variable.name], level, cut)[rows]
            # a geometry may have no held ends although others of the file have some
            if array.shape[-1]:
                values[variable.name] = array
    return values


def _solutions(body: StoredBody, level: int, places: Places, rows: Places) -> dict[str, Values]:
    """Return all solutions of these points of a body, if the file has them.

    places: of all points of the body in the sweep to which they go
    """
    group = body.group(level)
    if "solution_point" not in group.variables:
        return {}
    stored_places = body.places if body.number is not None else np.arange(len(body.places))
    solution_places = np.asarray(group["solution_point"][...])
    belongs = np.isin(solution_places, stored_places[rows])
    columns = dict[str, Values]()
    for variable in (*schema.SOLUTION, *schema.SOLUTION_OPENING, schema.EXISTENCE_RADIUS):
        if variable.name in group.variables:
            columns[variable.name] = body.read(group[variable.name], level)[belongs]
    points = np.searchsorted(stored_places, solution_places[belongs])
    return columns | {"solution_point": places[points]}


def places_in(study: Study, source: Study) -> Places:
    """Return (P,) places in this study of the points of a source with the same axes.

    Points and places are in C order. The place −1 stands for a point that this study does not have.
    """
    if not study.axes:
        return np.zeros(1, dtype=np.intp)
    points = points_of(study, study, lambda axis: axis.labels)
    place_of = {point: place for place, point in enumerate(points)}
    source_points = points_of(source, study, lambda axis: axis.labels)
    return np.array([place_of.get(point, -1) for point in source_points], dtype=np.intp)


def points_of(
    study: Study, order: Study, items_of: Callable[[Axis], Iterable[Any]]
) -> Iterator[tuple[Any, ...]]:
    """Yield the items of the axes at every point, in C order of the points.

    order: study whose order of axes the items of a point have
    """
    paths = [axis.path for axis in study.axes]
    axis_index = [paths.index(axis.path) for axis in order.axes]
    combine = product if study.mode == "grid" else zip
    for point in combine(*map(items_of, study.axes)):
        yield tuple(point[i] for i in axis_index)


def stored_steps(path: Path, study: Study) -> Iterator[BlockRecord]:
    """Yield the first steps of this study's history that its file has.

    The file may have more steps or fewer. Raises StoreError if it has other loads.
    """
    data = load_root(path)
    loads = load_variables(study)
    count = min(len(loads[0][1]), data.sizes["step"])
    for variable, values in loads:
        if variable.dtype != "f8":
            continue
        name = variable.name
        if name not in data or not np.array_equal(data[name].values[:count], values[:count]):
            raise StoreError(f"{path} holds a history with other steps; {OTHER_OUTPUT}")
    stored = {v.name: by_point(data[v.name], data) for v in history_variables(study)}
    status = stored["status"]
    for point, step in np.argwhere(status[:, :count] != PointStatus.NOT_RUN).tolist():
        step_values = dict[str, Any]()
        for name, values in stored.items():
            step_values[name] = values[point, step] if values.ndim > 1 else values[point]
        is_ok = status[point, step] == PointStatus.OK
        reason = "" if is_ok else str(step_values["reason"])
        yield step_record(study, point, step, step_values, reason)
