"""The result file of a run: one netCDF-4 file, complete or not there at all (see `tcstudy.data.files`).

`tcstudy.data.schema` says what stands in it.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from tcstudy.data import schema
from tcstudy.data.files import StoreError, write_dataset
from tcstudy.data.provenance import Provenance, global_attributes, without_paths
from tcstudy.data.reading import attributes
from tcstudy.data.records import BlockRecord, LevelRecord, check_block, check_level
from tcstudy.data.schema import MISSING_COUNT, SWEEP, FileVariable, PointStatus, edge_flags
from tcstudy.data.writer import (
    CHUNK,
    axis_problems,
    define,
    file_places,
    in_file_order,
    put,
    put_all,
    put_axes,
    put_names,
    tile_shape,
    tiles,
)
from tcstudy.scene.records import BODY
from tcstudy.scene.study import Study

if TYPE_CHECKING:
    import netCDF4
    import xarray

Arrays = dict[str, np.ndarray[Any, Any]]
Places = np.ndarray[Any, np.dtype[np.intp]]
Records = Collection[BlockRecord] | Callable[[], Iterable[BlockRecord]]

KEPT = "finished points are kept in the journal"
MEMORY = 2**26
"""Bytes of results that the writer holds at a time; a longer sweep takes several passes over its records."""


def write(
    path: Path,
    study: Study,
    levels: Sequence[LevelRecord],
    records: Records,
    provenance: Provenance,
) -> tuple[int, int]:
    """Write all results of a run to `path`, replacing an old file in one step.

    Returns how many solutions were sought, on all levels, and how many of them failed.

    records: all of them, or a function that gives them anew for every pass: neither they nor the results need fit
             into memory. Of two records of one point the last one counts; points without any stay "not run"

    Raises StoreError if the file cannot be written (the old one is then untouched), ValueError if a record does
    not fit the study.
    """
    problems = axis_problems(study)
    if problems:
        raise StoreError("; ".join(problems))
    counts: list[tuple[int, int]] = []
    make = lambda nc: counts.append(fill(nc, study, levels, records))  # noqa: E731
    write_dataset(path, global_attributes(study, provenance), make, KEPT)
    return counts[-1]


def root_variables(study: Study) -> tuple[FileVariable, ...]:
    """The variables of the root group of this study's file."""
    solvers = schema.SOLVERS if len(study.solver.names) > 1 else ()
    goal = schema.goal_variables(study.mesh.goal, study.exact is not None) if study.mesh.estimates else ()
    estimates = schema.ESTIMATES + goal if study.mesh.estimates else ()
    asked: tuple[FileVariable, ...] = ()
    if study.output.asks:
        from tcstudy.data.on_request import variables  # only for a study that asks for more

        asked = variables(study)
    return (*schema.ROOT, *solvers, *estimates, *asked)


def open_results(path: Path) -> xarray.DataTree:
    """Open a result file lazily; close it after use or open it in a `with`.

    Raises StoreError if there is no file, if it is not a result file or if its run has not finished.
    """
    attributes(path)
    import xarray  # here, because a run needs no xarray and its import takes longer than writing the file

    return xarray.open_datatree(path, engine="netcdf4")


@dataclass(frozen=True, eq=False)
class Section:
    """Variables by point of one group: the root, which has all levels, or the contact line of one level.

    level: None for the root;  group: where they stand;  tile: extent of their chunks along the sweep
    after: sizes of the dimensions after those of the sweep, by variable
    """

    level: int | None
    group: netCDF4.Dataset
    variables: tuple[FileVariable, ...]
    tile: tuple[int, ...]
    after: dict[str, tuple[int, ...]]

    @property
    def point_bytes(self) -> int:
        """Bytes that a point takes in memory."""
        return sum(math.prod(self.after[v.name]) * _width(v) for v in self.variables)


@dataclass(frozen=True, eq=False)
class Window:
    """A run of places of a section, as many tiles as fit into memory, and what their points have there.

    places: start, stop;  arrays: (stop − start, …) by variable
    """

    section: Section
    start: int
    stop: int
    arrays: Arrays


def fill(nc: netCDF4.Dataset, study: Study, levels: Sequence[LevelRecord], records: Records) -> tuple[int, int]:
    """One complete file: the sweep from front to back, every chunk once. Returns what `write` does.

    Of a sweep over geometries the table alone, without what a level has (`tcstudy.data.variants`).
    """
    count: Counter[int] = Counter()
    _put_dimensions(nc, study)
    variables = root_variables(study)
    for variable in variables:
        if variable.dims == ("level",) and not study.variants:
            put(nc, variable, study, _by_level(variable, study, levels))
    known = {level.level: level for level in levels}
    for level in levels:
        check_level(level, study)
    groups = {level.level: _make_group(nc, study, level) for level in levels}
    sizes = {"level": study.mesh.levels, "start": len(schema.START_NAMES), "solver": len(study.solver.names)}
    sections = [_section(None, nc, study, variables, sizes)]
    for level in levels:
        sizes = {"node": len(level.arclength)}
        sections.append(_section(level.level, groups[level.level], study, schema.CONTACT, sizes))
    for number, windows in enumerate(_passes(sections, study)):
        for block in _blocks(records, study, known):
            places = file_places(study, block.points)
            for window in windows:
                _take_block(window, block, places)
            if not number:
                _put_fields(groups.get(block.level), study, block, places)
        for window in windows:
            if window.section.level is None:
                found, times = np.unique(window.arrays["status"], return_counts=True)
                count.update(dict(zip(found.tolist(), times.tolist(), strict=True)))
            _put_window(window, study)
    sought = count.total() - count[PointStatus.NOT_RUN]
    return sought, sought - count[PointStatus.OK]


def _blocks(records: Records, study: Study, levels: Mapping[int, LevelRecord]) -> Iterator[BlockRecord]:
    for block in records() if callable(records) else records:
        check_block(block, study, levels.get(block.level))
        yield block


def _width(variable: FileVariable) -> int:
    return 8 if variable.dtype == "str" else np.dtype(variable.dtype).itemsize


def _section(
    level: int | None, group: netCDF4.Dataset, study: Study, variables: Iterable[FileVariable], sizes: dict[str, int]
) -> Section:
    """Define the variables by point of a group."""
    own = tuple(v for v in variables if SWEEP in v.dims)
    after = {v.name: tuple(sizes[d] for d in v.dims if d != SWEEP) for v in own}
    widest = max(math.prod(after[v.name]) * _width(v) for v in own)
    tile = tile_shape(study.shape, max(1, CHUNK // max(1, widest)))
    for variable in own:
        define(group, variable, study, (*tile, *after[variable.name]))
    return Section(level, group, own, tile, after)


def _passes(sections: Sequence[Section], study: Study) -> Iterator[list[Window]]:
    """Windows over all sections, as many at a time as MEMORY holds."""
    batch: list[Window] = []
    left = MEMORY
    for section in sections:
        tile_points, cost = math.prod(section.tile), max(1, section.point_bytes)
        size = max(1, MEMORY // (cost * tile_points)) * tile_points
        start = 0
        for _, _, stop in tiles(study.shape, section.tile):
            whole = stop - start + tile_points > size or stop == math.prod(study.shape)
            if not whole:
                continue
            if batch and cost * (stop - start) > left:
                yield batch
                batch, left = [], MEMORY
            arrays = {v.name: _missing(v, (stop - start, *section.after[v.name])) for v in section.variables}
            batch.append(Window(section, start, stop, arrays))
            left -= cost * (stop - start)
            start = stop
    yield batch


def _missing(variable: FileVariable, shape: tuple[int, ...]) -> np.ndarray[Any, Any]:
    """An array full of missing values."""
    return np.full(shape, variable.missing, dtype=object if variable.dtype == "str" else variable.dtype)


def _take_block(window: Window, block: BlockRecord, places: Places) -> None:
    """Put the points of a block that lie in a window in their places."""
    if window.section.level not in (None, block.level):
        return
    rows = np.flatnonzero((places >= window.start) & (places < window.stop))
    if not len(rows):
        return
    at = places[rows] - window.start
    if window.section.level is None:
        _take_numbers(window.arrays, block, rows, at)
        return
    known = np.zeros(0, dtype=bool) if block.u_T is None else ~np.isnan(block.u_T[rows]).any(axis=1)
    for name, line in (("u_T", block.u_T), ("xi", block.xi), ("sticks", block.sticks)) if known.any() else ():
        if line is not None and name in window.arrays:
            window.arrays[name][at[known]] = line[rows[known]]


def _take_numbers(arrays: Arrays, block: BlockRecord, rows: Places, at: Places) -> None:
    """Status, reason and numbers of some rows of a block, to their places in the arrays of the root."""
    words = np.full(len(block), "", dtype=object)
    for row, reason in block.reasons.items():
        words[row] = without_paths(reason)
    arrays["status"][at, block.level] = block.status[rows]
    arrays["reason"][at, block.level] = words[rows]
    for name, values in block.numbers.items():
        array, found = arrays[name][:, block.level], values[rows]
        if array.dtype.kind != "f":
            # NaN stands for missing: of several values of a point each for itself, a single one leaves what is there
            none = MISSING_COUNT if found.ndim > 1 else array[at]
            missing = np.isnan(found)
            found = np.where(missing, none, np.where(missing, 0.0, found))
        array[at] = found


def _put_window(window: Window, study: Study) -> None:
    """Write a window tile by tile, each a hyperslab."""
    section = window.section
    for variable in section.variables:
        array, new = window.arrays.pop(variable.name), section.group[variable.name]
        for cut, start, stop in tiles(study.shape, section.tile):
            if not window.start <= start < window.stop:
                continue
            values = array[start - window.start : stop - window.start]
            if variable.dtype == "str" and not values.any():
                continue  # what is never written is empty, and costs nothing
            new[cut] = values.reshape(*(s.stop - s.start for s in cut), *values.shape[1:])


def _put_dimensions(nc: netCDF4.Dataset, study: Study) -> None:
    """Dimensions and coordinates of the sweep, the level, the starts and, if they are compared, the solvers."""
    put_axes(nc, study)
    put(nc, schema.LEVEL_COORDINATE, study, np.arange(study.mesh.levels))
    put_names(nc, "start", schema.START_NAMES, "where the solver started", study)
    if len(study.solver.names) > 1:
        put_names(nc, "solver", study.solver.names, "solver", study)


def _by_level(variable: FileVariable, study: Study, levels: Sequence[LevelRecord]) -> np.ndarray[Any, Any]:
    values = _missing(variable, (study.mesh.levels,))
    for level in levels:
        values[level.level] = getattr(level, variable.name)
    return values


def _make_group(nc: netCDF4.Dataset, study: Study, level: LevelRecord) -> netCDF4.Group:
    """The group of a level: its contact line, and its whole mesh if the record has one."""
    group = nc.createGroup(f"level_{level.level}")
    group.setncattr("level", np.int32(level.level))
    group.createDimension("node", len(level.arclength))
    line = {v.name: getattr(level, v.name) for v in schema.CONTACT if SWEEP not in v.dims}
    if "node_x" in level.fields:
        mesh = group.createVariable("mesh", "i4", (), fill_value=False)
        mesh.setncatts(schema.MESH_TOPOLOGY)
        mesh[...] = 0
        put_all(group, schema.MESH, level.fields, study)
        if "region" in level.fields:
            named = schema.flags(BODY, *(name for name, _ in study.scenes[0].material.regions))
            put(group, schema.REGION, study, level.fields["region"], **dict(named))
    _put_live(group, study, level.fields)
    put_all(group, schema.CONTACT, line, study)
    group["edge"].setncatts(edge_flags(level.edge_names))
    return group


def _put_live(level_group: netCDF4.Group, study: Study, fields: Mapping[str, np.ndarray[Any, Any]]) -> None:
    """Make the group `live` if the record has its arrays."""
    prefix, by_point = schema.LIVE_PREFIX, {v.name for v in schema.LIVE if SWEEP in v.dims}
    arrays = {name.removeprefix(prefix): values for name, values in fields.items() if name.startswith(prefix)}
    if arrays:
        values = {name: in_file_order(study, array) if name in by_point else array for name, array in arrays.items()}
        put_all(level_group.createGroup("live"), schema.LIVE, values, study)


def _put_fields(group: netCDF4.Group | None, study: Study, block: BlockRecord, places: Places) -> None:
    """Write whole-body fields point by point; a field's variable is made when its first values come."""
    if group is None:  # as `check_block` has seen, a level without a record has no fields
        return
    known = {variable.name: variable for variable in schema.FIELDS}
    for name, rows in block.fields.items():
        if name not in group.variables:
            define(group, known[name], study, (1,) * len(study.shape) + (group.dimensions["mesh_node"].size,))
        for row, values in enumerate(rows):
            if not np.isnan(values).all():
                place = np.unravel_index(places[row], study.shape) if study.shape else ()
                group[name][tuple(int(i) for i in place)] = values
