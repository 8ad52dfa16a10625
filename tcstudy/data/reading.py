"""Finished files read: as xarray has them, and back as the records that they were written of, to
the bit.

For studies that grow or are mended: what is read here goes through the one writer again. Not here:
which study a file has (`tcstudy.study.append`), and the group `live`, which is made of the whole
sweep.
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
from tcstudy.data.bodies import StoredBody
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
    """The same of the root alone, or of one group, in the order of the file: of many geometries it
    takes less time."""
    attributes(path)
    import xarray

    return xarray.open_dataset(path, engine="netcdf4", group=group or None)


def load_root(path: Path, kind: Kind | None = None) -> xarray.Dataset:
    """The whole root group of a result file. Raises StoreError if it is none, or none of this
    kind."""
    if kind is not None and (found := kind_of(path)) != kind:
        raise StoreError(f"{path} holds a {found}, not a {kind}; use tcstudy show")
    with open_root(path) as data:
        return data.load()


def load_table(path: Path, without: tuple[str, ...] = ()) -> LabelledTable:
    """Return the root group of a result file for reports, without variables of these names; xarray
    is not imported. Raises StoreError."""
    with opened(path) as nc:
        return LabelledTable.of(nc, without)


def sweep_dims(data: Any) -> list[str]:
    """Dimensions of the sweep of an opened result file (its root dataset); none where it has one
    point."""
    return [str(dim) for dim in data["status"].dims if dim not in ("level", "step")]


def each_point(data: Any) -> list[dict[str, int]]:
    """Index along each sweep dimension of every point, in C order."""
    dims = sweep_dims(data)
    return [
        dict(zip(dims, index, strict=True))
        for index in product(*(range(data.sizes[d]) for d in dims))
    ]


def by_point(values: Any, data: Any) -> NDArray[Any]:
    """(P, …) values of a variable that lies along the sweep of `data`, its points in C order."""
    dims = sweep_dims(data)
    own = values.transpose(*dims, ...)
    flat: NDArray[Any] = own.values.reshape(
        math.prod(own.shape[: len(dims)]), *own.shape[len(dims) :]
    )
    return flat


def axis_names(data: Any) -> list[str]:
    """Names of the swept parameters of an opened result file (its root dataset)."""
    sweep = set(sweep_dims(data))
    return [str(name) for name in data.coords if data[name].dims and set(data[name].dims) <= sweep]


ASKED = ("force_", "work_", "section_force_", "probe_", "reaction_", "theta_mean_", "von_mises_")
"""How the names of numbers that `output.probes` and `output.quantities` ask for begin
(data.schema)."""


def asked(data: Any) -> list[str]:
    """Names of these numbers in a run's data, in the order of the file; a load `force_x` of a
    history is none."""
    loads = str(data.attrs.get("loads", "")).split()
    return [
        str(name) for name in data.data_vars if str(name).startswith(ASKED) and name not in loads
    ]


def of_largest(data: Any) -> Any:
    """The table of a run with one number for what a level has once: of several geometries the
    largest."""
    if GEOMETRIES not in data.attrs:
        return data
    names = [
        name
        for name in ("h_max", "n_dof", "n_contact", "time_mesh", "time_assemble")
        if name in data
    ]
    return data.assign(
        {name: data[name].max([d for d in data[name].dims if d != "level"]) for name in names}
    )


Values = NDArray[Any]
VALUES = 2**22
"""Numbers of one variable that are in memory at a time."""


@contextmanager
def unmasked(path: Path) -> Iterator[netCDF4.Dataset]:
    """Open a file that is known to be a result, nothing of which is masked."""
    import netCDF4

    with netCDF4.Dataset(path) as nc:
        nc.set_auto_mask(False)
        yield nc


@contextmanager
def opened(path: Path, group: str = "") -> Iterator[netCDF4.Dataset]:
    """A finished file, or a group of it, nothing of which is masked. Raises StoreError."""
    with reading(path), unmasked(path) as nc:
        yield nc[group] if group else nc


def read_level(body: StoredBody, level: int) -> LevelRecord:
    """Return the record of a level, without what a page needs to solve by itself."""
    group = body.group(level)
    values: dict[str, Any] = {
        name: body.read(group[name], level) for name in ("arclength", "x", "y", "c", "edge")
    }
    names = ("h_max", "n_dof", "n_contact", "time_mesh", "time_assemble")
    values |= {name: body.once(name, level) for name in names}
    meanings = str(body.attributes(group["edge"]).get("flag_meanings", ""))
    kept = (*schema.MESH, *schema.RIM, schema.REGION, *schema.HELD[:-1], *schema.JOINTS)
    fields = {v.name: body.read(group[v.name], level) for v in kept if v.name in group.variables}
    return LevelRecord(
        level=level,
        **values,
        edge_names=tuple(meanings.split()),
        fields={name: array for name, array in fields.items() if len(array)},
        stop=str(body.once("stop", level)) if "stop" in body.nc.variables else "",
    )


def read_blocks(
    body: StoredBody, study: Study, places: Places, wanted: NDArray[np.bool_]
) -> Iterator[BlockRecord]:
    """Yield the points of a stored body as blocks of another study.

    places: (P,) where the points of the body, in its order, stand in the sweep of `study`
    wanted: (points of study, levels) which of them are given; those that were not run never are
    """
    nc, count = body.nc, body.nc.dimensions["level"].size
    along = [
        v.name
        for v in (*schema.CONTACT, *line_variables(study), *schema.HELD, *schema.FIELDS)
        if SWEEP in v.dims
    ]
    names = [v.name for v in numbers(study) if v.name in nc.variables]
    having = body.levels
    for level in range(count):
        line = body.group(level) if level in having else None
        widths = body.sizes(level) if line is not None else []
        room = max(1, VALUES // max(32, *widths, 1))
        for cut, start, stop in tiles(body.shape, tile_shape(body.shape, room)):
            at, status = places[start:stop], body.rows(nc["status"], level, cut)
            rows = np.flatnonzero((status != PointStatus.NOT_RUN) & wanted[at, level])
            if not len(rows):
                continue
            words = body.rows(nc["reason"], level, cut)[rows]
            own = {name: body.rows(nc[name], level, cut)[rows] for name in names}
            if line is not None:
                present = (name for name in along if name in line.variables)
                values = {name: body.rows(line[name], level, cut)[rows] for name in present}
                # a geometry has no held ends although others of the file have some
                own |= {name: array for name, array in values.items() if array.shape[-1]}
            yield BlockRecord(
                *(level, study.shape, at[rows], status[rows]),
                reasons={row: str(reason) for row, reason in enumerate(words) if reason},
                u_T=own.pop("u_T", None),
                xi=own.pop("xi", None),
                sticks=own.pop("sticks", None),
                fields={v.name: own.pop(v.name) for v in schema.FIELDS if v.name in own},
                numbers=own,
                solutions=_every(body, level, places, start + rows) if line is not None else {},
            )


def _every(body: StoredBody, level: int, places: Places, rows: Places) -> dict[str, Values]:
    """Return all solutions of these points of a body, if the file has them.

    places: where all points of the body stand in the sweep to which they go
    """
    group = body.group(level)
    if "solution_point" not in group.variables:
        return {}
    stored = body.places if body.number is not None else np.arange(len(body.places))
    point = np.asarray(group["solution_point"][...])
    own = np.isin(point, stored[rows])
    columns = {v.name: body.read(group[v.name], level)[own] for v in schema.SOLUTION}
    return columns | {"solution_point": places[np.searchsorted(stored, point[own])]}


def places_in(study: Study, other: Study) -> Places:
    """(P,) where the points of another study with the same axes stand in this one, in C order of
    both; −1: nowhere."""
    if not study.axes:
        return np.zeros(1, dtype=np.intp)
    own = {point: i for i, point in enumerate(points_of(study, study, lambda axis: axis.labels))}
    return np.array(
        [own.get(point, -1) for point in points_of(other, study, lambda axis: axis.labels)],
        dtype=np.intp,
    )


def points_of(
    study: Study, order: Study, of: Callable[[Axis], Iterable[Any]]
) -> Iterator[tuple[Any, ...]]:
    """What every point has of the axes, these in the order of another study, in C order of the
    points."""
    at = [
        next(i for i, axis in enumerate(study.axes) if axis.path == one.path) for one in order.axes
    ]
    every = product if study.mode == "grid" else zip
    return (tuple(point[i] for i in at) for point in every(*map(of, study.axes)))


def stored_steps(path: Path, study: Study) -> Iterator[BlockRecord]:
    """The first steps of this study's history that a file of it has, whatever steps follow there.
    Raises StoreError where the file has other loads."""
    data, loads = load_root(path), load_variables(study)
    both = min(len(loads[0][1]), data.sizes["step"])
    for variable, own in loads:
        name = variable.name
        if variable.dtype == "f8" and not (
            name in data and np.array_equal(data[name].values[:both], own[:both])
        ):
            raise StoreError(f"{path} holds a history with other steps; {OTHER_OUTPUT}")
    known = {v.name: by_point(data[v.name], data) for v in history_variables(study)}
    for point, step in np.argwhere(known["status"][:, :both] != PointStatus.NOT_RUN).tolist():
        found = {
            name: every[point, step] if every.ndim > 1 else every[point]
            for name, every in known.items()
        }
        ended = known["status"][point, step] != PointStatus.OK
        yield step_record(study, point, step, found, str(found["reason"]) if ended else "")
