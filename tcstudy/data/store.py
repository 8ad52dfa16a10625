"""The result file of a run: one netCDF-4 file, complete or not there at all (see `tcstudy.data.files`).

`tcstudy.data.schema` says what stands in it. The file is written once, from the records of the journal. Values by point
are gathered in parts, runs of tiles that follow one another as the points of the sweep do (`tcstudy.data.writer`), as
many at a time as MEMORY holds; blocks come in any order, so that each time all of them are looked through.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import accumulate
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from tcstudy.data import reading, schema
from tcstudy.data.files import StoreError, write_dataset
from tcstudy.data.on_request import line_variables, variables
from tcstudy.data.provenance import CONTENT, Kind, kind_of, without_paths
from tcstudy.data.records import BlockRecord, LevelRecord
from tcstudy.data.schema import MISSING_COUNT, SWEEP, FileVariable, PointStatus
from tcstudy.data.writer import (
    CHUNK,
    Places,
    axis_problems,
    define,
    put,
    put_all,
    put_axes,
    put_names,
    tile_shape,
    tiles,
)
from tcstudy.scene.points import combinations, prescribed
from tcstudy.scene.records import BODY
from tcstudy.scene.study import Study

if TYPE_CHECKING:
    import netCDF4
    import xarray

Arrays = dict[str, np.ndarray[Any, Any]]
Records = Collection[BlockRecord] | Callable[[], Iterable[BlockRecord]]

MEMORY = 2**26
"""Bytes of results that the writer holds at a time; a longer sweep takes several passes over its records."""
KEPT = "finished points are kept in the journal"


def write(
    path: Path, study: Study, levels: Sequence[LevelRecord], records: Records, attributes: Mapping[str, Any]
) -> tuple[int, int]:
    """Write all results of a run to `path`, replacing an old file in one step.

    Returns how many solutions were sought, on all levels, and how many of them failed.

    attributes: global ones (`tcstudy.data.provenance`)
    records: all of them, or a function that gives them anew for every pass: neither they nor the results need fit
             into memory. Of two records of one point the last one counts; points without any stay "not run"

    Raises StoreError if the file cannot be written (the old one is then untouched).
    """
    if problems := axis_problems(study):
        raise StoreError("; ".join(problems))
    counts: list[tuple[int, int]] = []
    make = lambda nc: counts.append(fill(nc, study, levels, records))  # noqa: E731
    write_dataset(path, attributes, make, KEPT)
    return counts[-1]


@dataclass(frozen=True, eq=False)
class Record:
    """What a command other than a sweep finds: what its file holds, which has one group.

    kind:       the command;  tables: variables in the order of the file; those without a value are left out
    values:     by name of a variable, (P, …) where it lies along the sweep; edge_names are those of `edge`
    attributes: global ones, beside those that the study has
    """

    kind: Kind
    tables: Sequence[FileVariable]
    values: Mapping[str, Any]
    attributes: Mapping[str, Any]


def write_record(path: Path, study: Study, record: Record, attributes: Mapping[str, Any]) -> None:
    """Write a record to `path`, replacing an old file in one step; raises StoreError if that is not possible."""
    texts = {name: without_paths(v) if isinstance(v, str) else v for name, v in record.attributes.items()}

    def make(nc: netCDF4.Dataset) -> None:
        values = dict(record.values)
        if swept := [v.name for v in record.tables if SWEEP in v.dims and v.name in values]:
            put_axes(nc, study)
        for name in swept:
            rows = np.asarray(values[name])
            values[name] = rows.reshape((*study.shape, *rows.shape[1:]))
        if "reason" in values:
            values["reason"] = np.vectorize(without_paths, otypes=[object])(values["reason"])
        put_all(nc, record.tables, values, study)

    write_dataset(path, {**attributes, CONTENT: record.kind, **texts}, make)


def root_variables(study: Study) -> tuple[FileVariable, ...]:
    """The variables of the root group of this study's file."""
    found = schema.ROOT + schema.region_variables(study)
    if len(study.solver.names) > 1:
        found += schema.SOLVERS
    if study.mesh.guarantee:
        found += schema.GUARANTEED
    if study.solver.every:
        found += schema.EVERY
    if study.mesh.estimates:
        found += schema.ESTIMATES + schema.goal_variables(study.mesh.goal, study.exact is not None)
    if study.output.asks:
        found += variables(study)
    return found


def numbers(study: Study) -> list[FileVariable]:
    """Those that a block of points has numbers of."""
    return [v for v in root_variables(study) if v.dims[:2] == schema.POINT_LEVEL and v.name not in ("status", "reason")]


def open_results(path: Path) -> xarray.DataTree:
    """Open a result file lazily; close it after use or open it in a `with`.

    Raises StoreError if there is no file, if it is not a result file or if its run has not finished.
    """
    reading.attributes(path)
    import xarray  # here, because a run needs no xarray and its import takes longer than writing the file

    return xarray.open_datatree(path, engine="netcdf4")


def open_root(path: Path, group: str = "") -> xarray.Dataset:
    """The same of the root alone, or of one group, in the order of the file: of many geometries it takes less time."""
    reading.attributes(path)
    import xarray

    return xarray.open_dataset(path, engine="netcdf4", group=group or None)


def load_root(path: Path, kind: Kind | None = None) -> xarray.Dataset:
    """The whole root group of a result file. Raises StoreError if it is none, or none of this kind."""
    if kind is not None and (found := kind_of(path)) != kind:
        raise StoreError(f"{path} holds a {found}, not a {kind}; use tcstudy show")
    with open_root(path) as data:
        return data.load()


@dataclass(eq=False)
class _Part:
    """A run of tiles of the variables by point of one group: the root, of all levels, or the contact line of one level.

    level: None for the root;  shapes: of what a point has of each variable;  arrays: values of the part, once begun
    """

    group: netCDF4.Dataset
    level: int | None
    variables: list[FileVariable]
    shapes: dict[str, tuple[int, ...]]
    tiles: list[tuple[tuple[slice, ...], int, int]]
    size: int
    arrays: Arrays = field(default_factory=dict)

    def begin(self) -> None:
        """Nothing is known yet."""
        count = self.tiles[-1][2] - self.tiles[0][1]
        self.arrays = {v.name: missing(v, (count, *self.shapes[v.name])) for v in self.variables}

    def take(self, block: BlockRecord, places: Places) -> None:
        """The points of a block that lie here; places: where they all stand in the file."""
        start, stop = self.tiles[0][1], self.tiles[-1][2]
        rows = np.flatnonzero((places >= start) & (places < stop))
        at = places[rows] - start
        if self.level is None:
            _take_numbers(self.arrays, block, rows, at)
        elif block.u_T is not None:
            known = ~np.isnan(block.u_T[rows]).any(axis=1)
            along = {"u_T": block.u_T, "xi": block.xi, "sticks": block.sticks} | block.numbers
            for name in self.arrays:
                if (line := along.get(name)) is not None:
                    self.arrays[name][at[known]] = line[rows[known]]

    def write(self) -> None:
        """To the file, tile by tile, each a hyperslab."""
        begin = self.tiles[0][1]
        for variable in self.variables:
            array, new = self.arrays.pop(variable.name), self.group[variable.name]
            for cut, start, stop in self.tiles:
                values = array[start - begin : stop - begin]
                if variable.dtype != "str" or values.any():  # a text that is never written is empty, and costs nothing
                    new[cut] = values.reshape(*(s.stop - s.start for s in cut), *values.shape[1:])


def _parts(
    group: netCDF4.Dataset, level: int | None, study: Study, variables: Iterable[FileVariable], sizes: dict[str, int]
) -> list[_Part]:
    """Define the variables by point of a group, and cut them into parts of a quarter of MEMORY at most.

    sizes: of the dimensions after those of the sweep
    """
    own = [v for v in variables if SWEEP in v.dims]
    shapes = {v.name: tuple(sizes[d] for d in v.dims if d != SWEEP) for v in own}
    widths = [math.prod(shapes[v.name]) * (8 if v.dtype == "str" else np.dtype(v.dtype).itemsize) for v in own]
    tile = tile_shape(study.shape, max(1, CHUNK // max(1, *widths)))
    for variable in own:
        define(group, variable, study, (*tile, *shapes[variable.name]))
    every, size = list(tiles(study.shape, tile)), sum(widths) * math.prod(tile)
    count = max(1, MEMORY // (4 * max(1, size)))
    cuts = (every[i : i + count] for i in range(0, len(every), count))
    return [_Part(group, level, own, shapes, cut, len(cut) * size) for cut in cuts]


def fill(nc: netCDF4.Dataset, study: Study, levels: Sequence[LevelRecord], records: Records) -> tuple[int, int]:
    """All that a run has, into an empty file; returns what `write` does.

    Of a sweep over geometries the table alone, without what a level has (`tcstudy.data.variants`).
    """
    put_axes(nc, study)
    put(nc, schema.LEVEL_COORDINATE, study, np.arange(study.mesh.levels))
    put_names(nc, "start", schema.START_NAMES, "where the solver started", study)
    if len(study.solver.names) > 1:
        put_names(nc, "solver", study.solver.names, "solver", study)
    variables = root_variables(study)
    sizes = {"level": study.mesh.levels, "start": len(schema.START_NAMES), "solver": len(study.solver.names)}
    left = _parts(nc, None, study, variables, sizes)
    for variable in variables:
        if variable.dims == ("level",) and not study.variants:
            values = missing(variable, (study.mesh.levels,))
            for level in levels:
                values[level.level] = getattr(level, variable.name)
            put(nc, variable, study, values)
    groups: dict[int, netCDF4.Group] = {}
    for level in levels:
        group = groups[level.level] = _make_group(nc, study, level)
        along = (*schema.CONTACT, *(line_variables(study) if study.output.asks else ()))
        left += _parts(group, level.level, study, along, {"node": level.n_contact})

    solutions: dict[int, dict[int, Arrays]] = {number: {} for number in groups}
    count = np.zeros(len(PointStatus), dtype=np.intp)
    first = True
    while left:
        together = max(1, sum(size <= MEMORY for size in accumulate(part.size for part in left)))
        now, left = left[:together], left[together:]
        for part in now:
            part.begin()
        for block in records() if callable(records) else records:
            places = block.points
            if first:
                _put_fields(groups.get(block.level), study, block, places)
                if block.solutions:
                    own = ((int(place), block.solutions_of(row)) for row, place in enumerate(places))
                    solutions[block.level].update(own)
            for part in now:
                if part.level in (None, block.level):
                    part.take(block, places)
        for part in now:
            if part.level is None:
                count += np.bincount(part.arrays["status"].ravel(), minlength=len(count))
            part.write()
        first = False
    for number, of_points in solutions.items():
        if of_points:
            _put_solutions(groups[number], study, of_points)
    sought = int(count.sum() - count[PointStatus.NOT_RUN])
    return sought, sought - int(count[PointStatus.OK])


def missing(variable: FileVariable, shape: tuple[int, ...]) -> np.ndarray[Any, Any]:
    """An array full of missing values."""
    return np.full(shape, variable.missing, dtype=object if variable.dtype == "str" else variable.dtype)


def _take_numbers(arrays: Arrays, block: BlockRecord, rows: Places, at: Places) -> None:
    """Status, reason and numbers of some rows of a block, to their places in the arrays of the root."""
    words = np.full(len(block), "", dtype=object)
    for row, reason in block.reasons.items():
        words[row] = without_paths(reason)
    arrays["status"][at, block.level] = block.status[rows]
    arrays["reason"][at, block.level] = words[rows]
    for name, values in block.numbers.items():
        if name == schema.SECTION.name or name.startswith(schema.LAYER):  # along the contact line
            continue
        array, found = arrays[name][:, block.level], values[rows]
        if array.dtype.kind != "f":
            # NaN stands for missing: of several values of a point each for itself, a single one leaves what is there
            none = MISSING_COUNT if found.ndim > 1 else array[at]
            missing = np.isnan(found)
            found = np.where(missing, none, np.where(missing, 0.0, found))
        array[at] = found


def _make_group(nc: netCDF4.Dataset, study: Study, level: LevelRecord) -> netCDF4.Group:
    """The group of a level: its contact line, and its whole mesh if the record has one."""
    group = nc.createGroup(f"level_{level.level}")
    group.setncattr("level", np.int32(level.level))
    group.createDimension("node", len(level.arclength))
    if "node_x" in level.fields:
        mesh = group.createVariable("mesh", "i4", (), fill_value=False)
        mesh.setncatts(schema.MESH_TOPOLOGY)
        mesh[...] = 0
        put_all(group, schema.MESH, level.fields, study)
        if "region" in level.fields:
            named = schema.flags(BODY, *(name for name, _ in study.scenes[0].material.regions))
            put(group, schema.REGION, study, level.fields["region"], **dict(named))
    live = {v.name: level.fields[name] for v in schema.LIVE if (name := schema.LIVE_PREFIX + v.name) in level.fields}
    if live:
        put_all(group.createGroup("live"), schema.LIVE, live, study)
    put_all(group, (*schema.CONTACT, *schema.JOINTS), {**vars(level), **level.fields}, study)
    _put_held(group, study, level.fields)
    return group


def _put_solutions(group: netCDF4.Group, study: Study, every: dict[int, Arrays]) -> None:
    """All solutions of the points of a level, by place, in the order of the file."""
    places = sorted(every)
    names = [v.name.removeprefix("solution_") for v in schema.SOLUTION[1:]]
    values = {f"solution_{name}": np.concatenate([every[place][name] for place in places]) for name in names}
    values["solution_point"] = np.repeat(places, [len(every[place]["energy"]) for place in places])
    put_all(group, schema.SOLUTION, values, study)


def _put_held(group: netCDF4.Group, study: Study, fields: Mapping[str, np.ndarray[Any, Any]]) -> None:
    """The held ends of the contact line, and u_T there as the scenes prescribe it."""
    if "held_edge" not in fields:
        return
    some, of = combinations(study.scenes, "boundary")
    ends = list(zip(*(fields[f"held_{name}"] for name in ("x", "y", "edge", "along")), strict=True))
    # u_T [m] is made of what the edges prescribe
    slips = [[float(along @ prescribed(scene, edge, x, y)) for x, y, edge, along in ends] for scene in some]
    values = np.array(slips)[of].reshape(*study.shape, -1)
    put_all(group, schema.HELD, {**fields, "held_u_T": values}, study)
    names = (name for name, _ in study.scenes[0].boundary)
    group["held_edge"].setncatts(dict(schema.flags("contact_corner", *names, first=-1)))


def _put_fields(group: netCDF4.Group | None, study: Study, block: BlockRecord, places: Places) -> None:
    """Write whole-body fields point by point; a field's variable is made when its first values come."""
    if group is None:  # a level without a record has no fields
        return
    known = {variable.name: variable for variable in schema.FIELDS}
    for name, rows in block.fields.items():
        if name not in group.variables:
            define(group, known[name], study, (1,) * len(study.shape) + (group.dimensions["mesh_node"].size,))
        for row, values in enumerate(rows):
            if not np.isnan(values).all():
                place = np.unravel_index(places[row], study.shape) if study.shape else ()
                group[name][tuple(int(i) for i in place)] = values
