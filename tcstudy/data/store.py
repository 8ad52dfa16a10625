"""The result file of a run: one netCDF-4 file, complete or not there at all (see `tcstudy.data.files`).

`tcstudy.data.schema` says what stands in it. Values by point come in windows of its chunks, filled by blocks in any
order: a window is a run of tiles, which follow one another as the points of the sweep do (`tcstudy.data.writer`). One
that is full is written, every chunk once.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from tcstudy.data import schema
from tcstudy.data.files import StoreError, aside_of, new_dataset, write_dataset
from tcstudy.data.provenance import Kind, Provenance, global_attributes, kind_of, without_paths
from tcstudy.data.reading import attributes
from tcstudy.data.records import BlockRecord, LevelRecord, check_block, check_level
from tcstudy.data.schema import MISSING_COUNT, SWEEP, FileVariable, PointStatus
from tcstudy.data.writer import (
    CHUNK,
    Places,
    axis_problems,
    define,
    file_places,
    in_file_order,
    put,
    put_all,
    put_axes,
    put_edges,
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
Tile = tuple[tuple[slice, ...], int, int]
"""(slices, first place, place after the last), as from `tcstudy.data.writer.tiles`."""

MEMORY = 2**26
"""Bytes of results that the writer holds at a time; a longer sweep takes several passes over its records."""


@dataclass(frozen=True, eq=False)
class Section:
    """Variables by point of one group: the root, which has all levels, or the contact line of one level.

    level: None for the root;  group: where they stand;  runs: the tiles of every window;  starts: its first place
    after: sizes of the dimensions after those of the sweep, by variable;  point_bytes: what a point takes in memory
    """

    level: int | None
    group: netCDF4.Dataset
    variables: tuple[FileVariable, ...]
    runs: list[list[Tile]]
    starts: list[int]
    after: dict[str, tuple[int, ...]]
    point_bytes: int

    def bytes_of(self, run: list[Tile]) -> int:
        """What a window takes in memory."""
        return (run[-1][2] - run[0][1]) * self.point_bytes

    def window(self, number: int) -> Window:
        """A window without any value."""
        run = self.runs[number]
        start, stop = run[0][1], run[-1][2]
        arrays = {v.name: missing(v, (stop - start, *self.after[v.name])) for v in self.variables}
        return Window(self, run, start, stop, arrays)


@dataclass(eq=False)
class Window:
    """A run of tiles of a section, and what their points have there.

    start, stop: places;  arrays: (stop − start, …) by variable;  taken: how many points have come, on all levels
    """

    section: Section
    run: list[Tile]
    start: int
    stop: int
    arrays: Arrays
    taken: int = 0

    def take(self, block: BlockRecord, places: Places) -> None:
        """Put the points of a block that lie in the window in their places."""
        rows = np.flatnonzero((places >= self.start) & (places < self.stop))
        at = places[rows] - self.start
        self.taken += len(rows)
        if self.section.level is None:
            _take_numbers(self.arrays, block, rows, at)
            return
        known = np.zeros(0, dtype=bool) if block.u_T is None else ~np.isnan(block.u_T[rows]).any(axis=1)
        for name, line in (("u_T", block.u_T), ("xi", block.xi), ("sticks", block.sticks)) if known.any() else ():
            if line is not None:
                self.arrays[name][at[known]] = line[rows[known]]


def _width(variable: FileVariable) -> int:
    return 8 if variable.dtype == "str" else np.dtype(variable.dtype).itemsize


def section_of(
    level: int | None, group: netCDF4.Dataset, study: Study, variables: Iterable[FileVariable], sizes: dict[str, int]
) -> Section:
    """Define the variables by point of a group, which goes to the disk by windows of a quarter of MEMORY."""
    own = tuple(v for v in variables if SWEEP in v.dims)
    after = {v.name: tuple(sizes[d] for d in v.dims if d != SWEEP) for v in own}
    widths = {v.name: math.prod(after[v.name]) * _width(v) for v in own}
    tile = tile_shape(study.shape, max(1, CHUNK // max(1, *widths.values())))
    for variable in own:
        define(group, variable, study, (*tile, *after[variable.name]))
    point_bytes = sum(widths.values())
    every = list(tiles(study.shape, tile))
    count = max(1, MEMORY // (4 * max(1, point_bytes) * math.prod(tile)))
    runs = [every[i : i + count] for i in range(0, len(every), count)]
    return Section(level, group, own, runs, [run[0][1] for run in runs], after, point_bytes)


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
        array, found = arrays[name][:, block.level], values[rows]
        if array.dtype.kind != "f":
            # NaN stands for missing: of several values of a point each for itself, a single one leaves what is there
            none = MISSING_COUNT if found.ndim > 1 else array[at]
            missing = np.isnan(found)
            found = np.where(missing, none, np.where(missing, 0.0, found))
        array[at] = found


def put_window(window: Window) -> None:
    """Write a window tile by tile, each a hyperslab."""
    for variable in window.section.variables:
        array, new = window.arrays.pop(variable.name), window.section.group[variable.name]
        for cut, start, stop in window.run:
            values = array[start - window.start : stop - window.start]
            if variable.dtype == "str" and not values.any():
                continue  # what is never written is empty, and costs nothing
            new[cut] = values.reshape(*(s.stop - s.start for s in cut), *values.shape[1:])


Key = tuple[int | None, int]
"""The level of a section, None for the root, and the number of a window in it."""
Records = Collection[BlockRecord] | Callable[[], Iterable[BlockRecord]]

KEPT = "finished points are kept in the journal"


def write(
    path: Path,
    study: Study,
    levels: Sequence[LevelRecord],
    records: Records,
    provenance: Provenance,
    begun: Begun | None = None,
) -> tuple[int, int]:
    """Write all results of a run to `path`, replacing an old file in one step.

    Returns how many solutions were sought, on all levels, and how many of them failed.

    records: all of them, or a function that gives them anew for every pass: neither they nor the results need fit
             into memory. Of two records of one point the last one counts; points without any stay "not run"
    begun:   the same file, which has some of them already

    Raises StoreError if the file cannot be written (the old one is then untouched), ValueError if a record does
    not fit the study.
    """
    if problems := axis_problems(study):
        raise StoreError("; ".join(problems))
    counts: list[tuple[int, int]] = []
    own = begun.filling if begun is not None else None
    make = lambda nc: counts.append((own or Filling(nc, study)).finish(levels, records))  # noqa: E731
    write_dataset(path, global_attributes(study, provenance), make, KEPT, own.nc if own is not None else None)
    return counts[-1]


class Begun:
    """The file of a run under way, so that little is left to write at its end; nothing is there but its journal until
    `write` has finished it. Whatever goes wrong before is left to `write`, too, which then says it."""

    def __init__(self, path: Path, study: Study, wanted: bool = True) -> None:
        """wanted: whether anything shall be written before the end."""
        self.filling: Filling | None = None
        self._aside = aside_of(path)
        with self._dropped():
            self.filling = Filling(new_dataset(self._aside), study) if wanted else None

    def add(self, record: LevelRecord | BlockRecord) -> None:
        """Take a record, each for the first time, levels before their blocks."""
        with self._dropped():
            if self.filling is not None:
                self.filling.level(record) if isinstance(record, LevelRecord) else self.filling.take(record)

    def close(self) -> None:
        """Leave nothing behind."""
        if self.filling is not None and self.filling.nc.isopen():
            with suppress(OSError, RuntimeError):
                self.filling.nc.close()
        self.filling = None
        with suppress(OSError):
            self._aside.unlink(missing_ok=True)

    @contextmanager
    def _dropped(self) -> Iterator[None]:
        try:
            yield
        except (OSError, RuntimeError):  # a full disk, for one
            self.close()


def root_variables(study: Study) -> tuple[FileVariable, ...]:
    """The variables of the root group of this study's file."""
    found = schema.ROOT
    if len(study.solver.names) > 1:
        found += schema.SOLVERS
    if study.mesh.guarantee:
        found += schema.GUARANTEED
    if study.solver.every:
        found += schema.EVERY
    if study.mesh.estimates:
        found += schema.ESTIMATES + schema.goal_variables(study.mesh.goal, study.exact is not None)
    if study.output.asks:
        from tcstudy.data.on_request import variables  # only for a study that asks for more

        found += variables(study)
    return found


def open_results(path: Path) -> xarray.DataTree:
    """Open a result file lazily; close it after use or open it in a `with`.

    Raises StoreError if there is no file, if it is not a result file or if its run has not finished.
    """
    attributes(path)
    import xarray  # here, because a run needs no xarray and its import takes longer than writing the file

    return xarray.open_datatree(path, engine="netcdf4")


def load_root(path: Path, kind: Kind | None = None) -> xarray.Dataset:
    """The whole root group of a result file. Raises StoreError if it is none, or none of this kind."""
    if kind is not None and (found := kind_of(path)) != kind:
        raise StoreError(f"{path} holds a {found}, not a {kind}; use tcstudy show")
    with open_results(path) as tree:
        return tree.to_dataset().load()


class Filling:
    """A result file as its records come: each block goes to the windows of its points, and full ones to the disk.

    What does not come in the order of the file, beyond what MEMORY holds, is left to `finish`. Of a sweep over
    geometries the table alone, without what a level has (`tcstudy.data.variants`).
    """

    def __init__(self, nc: netCDF4.Dataset, study: Study) -> None:
        self.nc, self.study = nc, study
        self.known: dict[int, LevelRecord] = {}
        self.groups: dict[int, netCDF4.Group] = {}
        self.count: Counter[int] = Counter()
        self._open: dict[Key, Window] = {}
        self._written: set[Key] = set()
        self._left: set[Key] = set()
        self._every: dict[int, dict[int, Arrays]] = {}
        put_axes(nc, study)
        put(nc, schema.LEVEL_COORDINATE, study, np.arange(study.mesh.levels))
        put_names(nc, "start", schema.START_NAMES, "where the solver started", study)
        if len(study.solver.names) > 1:
            put_names(nc, "solver", study.solver.names, "solver", study)
        self.variables = root_variables(study)
        sizes = {"level": study.mesh.levels, "start": len(schema.START_NAMES), "solver": len(study.solver.names)}
        self.sections: dict[int | None, Section] = {None: section_of(None, nc, study, self.variables, sizes)}

    def level(self, level: LevelRecord) -> None:
        """Make the group of a level, once. Raises ValueError if the level does not fit the study."""
        if level.level in self.known:
            return
        check_level(level, self.study)
        self.known[level.level] = level
        group = self.groups[level.level] = _make_group(self.nc, self.study, level)
        own = {"node": len(level.arclength)}
        self.sections[level.level] = section_of(level.level, group, self.study, schema.CONTACT, own)

    def take(self, block: BlockRecord, once: bool = True) -> Places:
        """Take the points of a block, of which MEMORY holds some; returns their places in the file.

        once: none of them has come before, so that a window with as many as it has places is full
        """
        check_block(block, self.study, self.known.get(block.level))
        places = file_places(self.study, block.points)
        if block.solutions and block.level in self.groups:
            every = self._every.setdefault(block.level, {})
            every.update((int(place), block.solutions_of(row)) for row, place in enumerate(places))
        for section in (self.sections[key] for key in (None, block.level) if key in self.sections):  # no mesh, no group
            for number in np.unique(np.searchsorted(section.starts, places, side="right") - 1).tolist():
                if (window := self._window(section, number)) is None:
                    continue
                window.take(block, places)
                levels = 1 if section.level is not None else self.study.mesh.levels
                if once and window.taken >= (window.stop - window.start) * levels:
                    self._put((section.level, number), window)
        return places

    def _window(self, section: Section, number: int) -> Window | None:
        """A window that is open, or opened while there is room; None where it is written or left to the next pass."""
        key = section.level, number
        if key not in self._open and key not in self._written and key not in self._left:
            held = sum(window.section.bytes_of(window.run) for window in self._open.values())
            if held and held + section.bytes_of(section.runs[number]) > MEMORY:
                self._left.add(key)
            else:
                self._open[key] = section.window(number)
        return self._open.get(key)

    def _put(self, key: Key, window: Window) -> None:
        """Write a window to the disk."""
        self._open.pop(key, None)
        self._written.add(key)
        if window.section.level is None:
            found, times = np.unique(window.arrays["status"], return_counts=True)
            self.count.update(dict(zip(found.tolist(), times.tolist(), strict=True)))
        put_window(window)

    def finish(self, levels: Sequence[LevelRecord], records: Records) -> tuple[int, int]:
        """The rest, in as many passes over all records as MEMORY asks for; returns what `write` does."""
        for variable in self.variables:
            if variable.dims == ("level",) and not self.study.variants:
                values = missing(variable, (self.study.mesh.levels,))
                for level in levels:
                    values[level.level] = getattr(level, variable.name)
                put(self.nc, variable, self.study, values)
        for level in levels:
            self.level(level)
        first = True
        while rest := self._rest():
            self._open.clear()
            self._left.clear()
            for block in records() if callable(records) else records:
                places = self.take(block, once=False)
                if first:
                    _put_fields(self.groups.get(block.level), self.study, block, places)
            first = False
            for key, section in rest:
                if key not in self._left:
                    self._put(key, self._open.get(key) or section.window(key[1]))
        for number, group in self.groups.items():
            if every := self._every.get(number):
                _put_solutions(group, self.study, every)
        sought = self.count.total() - self.count[PointStatus.NOT_RUN]
        return sought, sought - self.count[PointStatus.OK]

    def _rest(self) -> list[tuple[Key, Section]]:
        """The windows that are not written."""
        every = [((level, k), one) for level, one in self.sections.items() for k in range(len(one.runs))]
        return [(key, section) for key, section in every if key not in self._written]


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
    live = {v.name: level.fields[name] for v in schema.LIVE if (name := schema.LIVE_PREFIX + v.name) in level.fields}
    if live:
        live |= {v.name: in_file_order(study, live[v.name]) for v in schema.LIVE if SWEEP in v.dims}
        put_all(group.createGroup("live"), schema.LIVE, live, study)
    put_all(group, schema.CONTACT, line, study)
    put_edges(group, level, study)
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
    put_all(group, schema.HELD, {**fields, "held_u_T": in_file_order(study, values)}, study)
    names = (name for name, _ in study.scenes[0].boundary)
    group["held_edge"].setncatts(dict(schema.flags("contact_corner", *names, first=-1)))


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
