"""The one writer: the file of a run, complete or not there at all.

The file of a run is written once, from the records of the journal. Values by point are gathered in
parts, which are runs of tiles, as many at a time as MAX_MEMORY holds. The blocks of a geometry come
in any order, the geometries one after the other. A part is written as soon as the last of its
geometries is read, so that one pass over the records suffices for a sweep over geometries.

The file of a sweep over geometries looks like that of one geometry. It has a table of all points,
in which the values of a level (h_max, n_dof, times) stand by point. It has a group for each level
with the contact lines and the meshes of all geometries (`schema.among_geometries`). Tiles are runs
of geometries with all their points, whatever the order of the axes. A point of a refused geometry
has the status mesh_failed and its reason. Its contact lines are missing values, its mesh has no
nodes, and its number in the variable `geometry` is −1.
"""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from tcstudy.data import schema
from tcstudy.data.files import CONTENT, Snapshot, without_directories, without_paths, write_dataset
from tcstudy.data.records import BlockRecord, LevelRecord, Record
from tcstudy.data.schema import (
    GEOMETRIES,
    LAYOUT,
    LEVEL,
    OUTER,
    OWN_POINT,
    PADDED,
    POINT_LEVEL,
    SWEEP,
    Dtype,
    FileVariable,
    PointStatus,
    among_geometries,
    line_variables,
    missing,
)
from tcstudy.data.tables import axis_names
from tcstudy.data.variables import (
    CHUNK,
    Places,
    Shape,
    define,
    dimensions,
    expand,
    inner_dims,
    put,
    put_all,
    put_axes,
    tile_shape,
    tiles,
)
from tcstudy.scene.points import distinct, load_axes
from tcstudy.scene.records import BODY
from tcstudy.scene.study import Study

if TYPE_CHECKING:
    import netCDF4


BRANCH, SWEPT_LOADS, GUARANTEE = "solver_branch", "swept_loads", "guarantee"
"""Global attributes of a run: the stored solution; coordinates along which only loads change."""
Arrays = dict[str, np.ndarray[Any, Any]]
MAX_MEMORY = 2**26
"""Results that the writer holds at a time [byte]; a longer sweep takes several passes."""
JOURNAL_NOTE = "finished points are kept in the journal"


@dataclass(frozen=True, eq=False)
class Results:
    """The results of a run for one body.

    levels, blocks: read the records again at every call, so that they need not fit into memory. The
                    last record of a point counts. A point without a record stays "not run".
    attributes:     global ones of the file (`tcstudy.data.files`)
    """

    study: Study
    levels: Callable[[], Iterable[LevelRecord]]
    blocks: Callable[[], Iterable[BlockRecord]]
    attributes: Mapping[str, Any] = field(default_factory=dict)


def write(
    path: Path,
    results: Results,
    geometries: Mapping[int, Results] | None = None,
    done: Callable[[], object] = tuple,
    seen: Snapshot | None = None,
) -> tuple[int, int]:
    """Write all results of a run to `path`, replacing an old file in one step.

    results:    of the study; of a sweep over geometries those of geometries without a mesh
    geometries: results of the geometries that have a mesh, by number
    done: called when all records are read, before the old file is replaced
    seen: the only file at `path` that may be replaced; None for any
    Returns how many solutions were sought, on all levels, and how many of them failed.

    Raises StoreError if the file cannot be written (the old one is then untouched).
    """
    study = results.study
    counts: list[tuple[int, int]] = []

    def make(nc: netCDF4.Dataset) -> None:
        contents = _Contents(results, geometries or {})
        _put_once(nc, contents)  # all variables are made before the first value is written
        parts, meshes = _put_once(nc, contents)
        counts.append(_put_points(nc, contents, parts, meshes))
        done()

    attributes = dict(results.attributes)
    if study.variants:
        attributes |= {GEOMETRIES: len(study.variants), LAYOUT: PADDED}
    names = axis_names(study.axes) if study.axes else ()
    swept_loads = " ".join(names[d] for d in load_axes(study))
    attributes |= {
        BRANCH: "all" if study.solver.every else study.solver.branch,
        SWEPT_LOADS: swept_loads,
    }
    if study.encloses_lambda_1:
        attributes |= {GUARANTEE: study.mesh.guarantee}
    write_dataset(path, attributes, make, JOURNAL_NOTE, seen)
    return counts[0]


def write_record(
    path: Path,
    study: Study,
    record: Record,
    attributes: Mapping[str, Any],
    seen: Snapshot | None = None,
) -> None:
    """Write a record to `path`, replacing an old file in one step.

    seen: the only file at `path` that may be replaced; None for any
    Raises StoreError if that is not possible.
    """

    def make(nc: netCDF4.Dataset) -> None:
        values = dict(record.values)
        swept = [v.name for v in record.tables if SWEEP in v.dims and v.name in values]
        for name in swept:
            rows = np.asarray(values[name])
            values[name] = rows.reshape((*study.shape, *rows.shape[1:]))
        if "reason" in values:
            values["reason"] = np.vectorize(without_paths, otypes=[object])(values["reason"])
        for _ in ("made", "written"):
            if swept:
                put_axes(nc, study)
            put_all(nc, record.tables, values, study)

    all_attributes = {**attributes, CONTENT: record.kind}
    if study.mesh.bounds_errors:
        all_attributes[GUARANTEE] = study.mesh.guarantee
    for name, value in record.attributes.items():
        all_attributes[name] = without_paths(value) if isinstance(value, str) else value
    write_dataset(path, all_attributes, make, seen=seen)


def root_variables(study: Study) -> tuple[FileVariable, ...]:
    """Return the variables of the root group of this study's file."""
    mesh = study.mesh
    return (
        *schema.ROOT,
        *schema.region_variables(study),
        *schema.opening_variables(study),
        *(schema.SOLVERS if len(study.solver.names) > 1 else ()),
        *schema.guaranteed_variables(study),
        *(schema.EVERY if study.solver.every else ()),
        *(schema.ESTIMATES if mesh.estimates else ()),
        *(schema.goal_variables(mesh.goal, study.exact is not None) if mesh.estimates else ()),
        *schema.requested_variables(study),
    )


def numbers(study: Study) -> list[FileVariable]:
    """Return the variables of the root group that have numbers by point and level."""
    by_point = (v for v in root_variables(study) if v.dims[:2] == schema.POINT_LEVEL)
    return [v for v in by_point if v.name not in ("status", "reason")]


@dataclass(eq=False)
class _Sizes:
    """Sizes of one level of several geometries.

    counts:     (G,) by dimension, 0 for a geometry that does not have the level
    names:      of the arrays that some geometry has
    edge_names: of the contact edges
    """

    counts: dict[str, NDArray[np.int64]]
    names: set[str]
    edge_names: tuple[str, ...]

    @classmethod
    def none(cls, geometries: int, edge_names: tuple[str, ...]) -> _Sizes:
        """Return the sizes 0 of a number of geometries, before any level is added."""
        counts = {dim: np.zeros(geometries, dtype=np.int64) for dim in _SIZED}
        return cls(counts, set(), edge_names)

    def add(self, number: int, arrays: Mapping[str, Any]) -> None:
        """Add the level of a geometry by its arrays."""
        self.names.update(arrays)
        for dim, name in _SIZED.items():
            self.counts[dim][number] = len(arrays.get(name, ()))

    def longest(self, dim: str) -> int:
        """Return the size of a dimension along which geometries are padded."""
        return int(self.counts[dim].max())

    def total(self, dim: str) -> int:
        """Return the size of a dimension along which geometries stand end to end."""
        return int(self.counts[dim].sum())

    def start(self, dim: str, number: int) -> int:
        """Return where a geometry begins along a dimension of geometries that stand end to end."""
        return int(self.counts[dim][:number].sum())


_SIZED = {
    "node": "x",
    "held_end": "held_x",
    "joint": "joint_node",
    "opening_node": "opening_x",
    "rim_segment": "rim_edge",
    "mesh_node": "node_x",
    "mesh_face": "triangle",
    "node_column": schema.LIVE_PREFIX + "A_tilde",
}
"""Array that has the length of a dimension of a level, by dimension."""


@dataclass(frozen=True, eq=False)
class _Contents:
    """All records of a run, body by body: geometry by geometry, or of the one body.

    results, geometries: as of `write`
    """

    results: Results
    geometries: Mapping[int, Results]

    @property
    def study(self) -> Study:
        """The study of the whole file."""
        return self.results.study

    def levels(self, number: int) -> Iterable[LevelRecord]:
        """Return the levels of a body; a refused geometry has none."""
        if not self.study.variants:
            return self.results.levels()
        return self.geometries[number].levels() if number in self.geometries else ()

    def blocks(self, number: int) -> Iterable[BlockRecord]:
        """Return the blocks of a body; their points are those of the sweep of the body."""
        if not self.study.variants:
            return self.results.blocks()
        if number in self.geometries:
            return self.geometries[number].blocks()
        return self._refused.get(number, ())

    @cached_property
    def _refused(self) -> dict[int, list[BlockRecord]]:
        """Blocks of the geometries without a mesh, by number."""
        variant_of = np.empty(len(self.study.scenes), dtype=np.intp)
        for number, variant in enumerate(self.study.variants):
            variant_of[variant.places] = number
        by_number = defaultdict[int, list[BlockRecord]](list)
        for block in self.results.blocks():
            number = int(variant_of[block.points[0]])
            places = self.study.variants[number].places
            by_number[number].append(replace(block, points=np.searchsorted(places, block.points)))
        return by_number

    @cached_property
    def level_values(self) -> dict[str, NDArray[Any]]:
        """(P, levels) values that a level has once, by name; (1, levels) for one body."""
        return self._level_summary[0]

    @cached_property
    def sizes(self) -> dict[int, _Sizes]:
        """Sizes of the levels that some geometry has, by number of the level."""
        return dict(sorted(self._level_summary[1].items()))

    @cached_property
    def _level_summary(self) -> tuple[dict[str, NDArray[Any]], dict[int, _Sizes]]:
        """`level_values` and `sizes` (unsorted), of one pass over the levels of all bodies."""
        study = self.study
        rows = len(study.scenes) if study.variants else 1
        variables = [v for v in root_variables(study) if v.dims == LEVEL]
        table = {v.name: missing(v, (rows, study.mesh.levels)) for v in variables}
        sizes = dict[int, _Sizes]()
        for number, body in enumerate(study.bodies):
            places = body.places if study.variants else 0
            for level in self.levels(number):
                for name, values in table.items():
                    values[places, level.level] = getattr(level, name)
                if level.level not in sizes:
                    sizes[level.level] = _Sizes.none(len(study.bodies), level.edge_names)
                sizes[level.level].add(number, vars(level) | level.fields)
        return table, sizes

    @cached_property
    def solutions(self) -> dict[int, list[Arrays]]:
        """All solutions by level, at places of the whole sweep; empty unless the study asks."""
        by_level = defaultdict[int, list[Arrays]](list)
        if not self.study.solver.every:
            return by_level
        for number, places in enumerate(self.places):
            for block in self.blocks(number):
                if block.solutions:
                    points = places[block.solutions["solution_point"]]
                    by_level[block.level].append(block.solutions | {"solution_point": points})
        return by_level

    @property
    def places(self) -> list[Places]:
        """Places of every body in the whole sweep, in C order."""
        if not self.study.variants:
            return [np.arange(math.prod(self.study.shape))]
        return [variant.places for variant in self.study.variants]

    @cached_property
    def sweep(self) -> _Extent:
        """The points of the whole sweep, geometry by geometry."""
        study = self.study
        geometric = [*dict.fromkeys(study.geometric)] if study.mode == "grid" else []
        order = geometric + [d for d in range(len(study.shape)) if d not in geometric]
        return _Extent.of(study.shape, tuple(order), self.places)

    @cached_property
    def outer(self) -> _Extent:
        """The places of the geometries along the dimensions in which they change."""
        study = self.study
        if study.mode == "list":
            return self.sweep
        shape, dims = study.shape, study.geometric
        outer_shape = tuple(shape[d] for d in dims)
        places = []
        for variant in study.variants:
            index = np.unravel_index(variant.places, shape)
            outer_index = tuple(index[d] for d in dims)
            places.append(np.unique(np.ravel_multi_index(outer_index, outer_shape)))
        return _Extent.of(outer_shape, tuple(range(len(dims))), places)


@dataclass(frozen=True, eq=False)
class _Extent:
    """Dimensions of places, and the order in which the places are gathered.

    shape:  of the dimensions, in the order of the file
    order:  the dimensions in the order of gathering, those of geometries first
    places: of every body, in C order of the shape
    body:   (P,) number of the body that has a place, in the order of gathering
    """

    shape: Shape
    order: tuple[int, ...]
    places: Sequence[Places]
    body: NDArray[np.intp]

    @classmethod
    def of(cls, shape: Shape, order: tuple[int, ...], places: Sequence[Places]) -> _Extent:
        """Return the extent of bodies that have these places."""
        extent = cls(shape, order, places, np.zeros(math.prod(shape), dtype=np.intp))
        for number in range(len(places)):
            extent.body[extent.positions(number)] = number
        return extent

    @property
    def gathered(self) -> Shape:
        """The shape in the order in which places are gathered."""
        return tuple(self.shape[d] for d in self.order)

    def positions(self, number: int, points: Any = slice(None)) -> Places:
        """Return the positions of points of a body (by default all) in the order of gathering."""
        places = self.places[number][points]
        if self.order == tuple(range(len(self.shape))):
            return places
        index = np.unravel_index(places, self.shape)
        return np.ravel_multi_index(tuple(index[d] for d in self.order), self.gathered)

    def as_in_file(self, gathered: Sequence[Any]) -> tuple[Any, ...]:
        """Return items of the dimensions, given in the order of gathering, in that of the file."""
        by_dim = dict(zip(self.order, gathered, strict=True))
        return tuple(by_dim[d] for d in range(len(self.shape)))


@dataclass(eq=False)
class _Part:
    """A run of tiles of the variables of a group, which is written at once.

    level:     of the group; None for the root
    variables: of the group that lie along the extent
    shapes:    of the values that a place has, by variable
    tiles:     as of `variables.tiles`
    size:      memory of the values [byte]
    arrays:    the values, once the part is begun
    """

    group: netCDF4.Dataset
    level: int | None
    variables: list[FileVariable]
    shapes: dict[str, tuple[int, ...]]
    extent: _Extent
    tiles: list[tuple[tuple[slice, ...], int, int]]
    size: int
    arrays: Arrays = field(default_factory=dict)

    @cached_property
    def bodies(self) -> tuple[int, int]:
        """The first and the last body that has a place in the part."""
        bodies = self.extent.body[self.start : self.stop]
        return int(bodies.min()), int(bodies.max())

    @property
    def start(self) -> int:
        """First position of the part in the order of gathering."""
        return self.tiles[0][1]

    @property
    def stop(self) -> int:
        """Position after the last one of the part."""
        return self.tiles[-1][2]

    def begin(self) -> None:
        """Make the arrays, full of missing values."""
        count = self.stop - self.start
        self.arrays = {v.name: missing(v, (count, *self.shapes[v.name])) for v in self.variables}

    def take(self, positions: Places, level: int, values: Mapping[str, Any]) -> None:
        """Take the values (R, …) at those of R positions that the part has; rows are padded."""
        rows = np.flatnonzero((positions >= self.start) & (positions < self.stop))
        if not len(rows):
            return
        row_index = positions[rows] - self.start
        for variable in self.variables:
            if values.get(variable.name) is None:
                continue
            array = self.arrays[variable.name]
            new = values[variable.name][rows]
            if new.dtype.kind == "f":
                new = np.where(np.isnan(new), variable.missing, new)
            if self.level is None:
                array[row_index, level] = new
            else:
                index: Any = (row_index, *(slice(length) for length in new.shape[1:]))
                array[index] = new

    def write(self) -> None:
        """Write the values to the file, tile by tile, each a hyperslab."""
        dims = len(self.extent.shape)
        for variable in self.variables:
            array = self.arrays.pop(variable.name)
            target = self.group[variable.name]
            for cut, start, stop in self.tiles:
                values = array[start - self.start : stop - self.start]
                # a text that is never written is empty, and costs nothing
                if variable.dtype == "str" and not values.any():
                    continue
                gathered = values.reshape(*(s.stop - s.start for s in cut), *values.shape[1:])
                axes = self.extent.as_in_file(range(dims))
                inner_axes = range(dims, gathered.ndim)
                target[self.extent.as_in_file(cut)] = gathered.transpose(*axes, *inner_axes)


def _parts(
    group: netCDF4.Dataset,
    level: int | None,
    study: Study,
    variables: Sequence[FileVariable],
    sizes: Mapping[str, int],
    extent: _Extent,
    max_size: int = 0,
) -> list[_Part]:
    """Define variables along an extent, and cut them into parts.

    sizes:    of the dimensions after those of the extent
    max_size: of a part that has several tiles [byte]; 0 for a quarter of MAX_MEMORY
    """
    shapes = dict[str, Shape]()
    widths = list[int]()
    for variable in variables:
        shape = tuple(sizes[dim] for dim in variable.dims if dim not in (SWEEP, OUTER))
        shapes[variable.name] = shape
        widths.append(math.prod(shape) * variable.itemsize)
    tile = tile_shape(extent.gathered, max(1, CHUNK // max(1, *widths)))
    for variable in variables:
        define(group, variable, study, (*extent.as_in_file(tile), *shapes[variable.name]))
    all_tiles = list(tiles(extent.gathered, tile))
    tile_size = sum(widths) * math.prod(tile)
    count = max(1, (max_size or MAX_MEMORY // 4) // max(1, tile_size))
    parts = list[_Part]()
    for first in range(0, len(all_tiles), count):
        run = all_tiles[first : first + count]
        size = len(run) * tile_size
        parts.append(_Part(group, level, [*variables], shapes, extent, run, size))
    return parts


def _along(variables: Iterable[FileVariable], *dims: str) -> list[FileVariable]:
    """Return the variables that have one of these dimensions."""
    return [v for v in variables if {*dims} & {*v.dims}]


Meshes = Mapping[int, "_Meshes"]


def _put_once(nc: netCDF4.Dataset, contents: _Contents) -> tuple[list[_Part], Meshes]:
    """Write all that does not come by record, and make the variables of all that does.

    Returns the parts in which the points and the contact lines of geometries are to be written, and
    by level the writer of the meshes of several geometries.
    """
    study = contents.study
    max_size = MAX_MEMORY // 4
    if study.variants:  # parts of all groups are begun with the first geometry
        max_size //= 1 + 2 * len(contents.sizes)
    parts = _put_root(nc, contents, max_size)
    if not study.variants:
        for level in contents.levels(0):
            parts += _put_level(nc, contents, level)
        return parts, {}
    _put_geometries(nc, contents)
    meshes = dict[int, _Meshes]()
    for number, level_sizes in contents.sizes.items():
        parts += _put_lines(nc, contents, number, max_size)
        if level_sizes.total("mesh_node"):
            meshes[number] = _Meshes.of(nc[f"level_{number}"], study, level_sizes)
    return parts, meshes


def _put_root(nc: netCDF4.Dataset, contents: _Contents, max_size: int) -> list[_Part]:
    """Write the coordinates and the levels in the root group; return the parts of its points."""
    study = contents.study
    variables = root_variables(study)
    put_axes(nc, study)
    put(nc, schema.LEVEL_COORDINATE, study, np.arange(study.mesh.levels))
    _put_names(nc, study, "start", "where the solver started", schema.START_NAMES)
    _put_names(nc, study, "solver", "solver", study.solver.names)
    sizes = {
        "level": study.mesh.levels,
        "start": len(schema.START_NAMES),
        "solver": len(study.solver.names),
    }
    parts = _parts(nc, None, study, _along(variables, SWEEP), sizes, contents.sweep, max_size)
    shape, dims = (study.shape, POINT_LEVEL) if study.variants else ((), LEVEL)
    for variable in (v for v in variables if v.dims == LEVEL):
        values = contents.level_values[variable.name].reshape(*shape, -1)
        put(nc, replace(variable, dims=dims), study, values)
    return parts


def _put_names(
    nc: netCDF4.Dataset, study: Study, dim: str, long_name: str, names: Sequence[str]
) -> None:
    """Make, then write, the names along a dimension; a single one has no dimension."""
    if len(names) > 1:
        variable = FileVariable(dim, "str", "", long_name, (dim,), coordinate=True)
        put(nc, variable, study, list(names))


def _put_points(
    nc: netCDF4.Dataset, contents: _Contents, parts: Iterable[_Part], meshes: Meshes
) -> tuple[int, int]:
    """Write all that comes by record, in as few passes as MAX_MEMORY allows; return as `write`."""
    counts = np.zeros(len(PointStatus), dtype=np.intp)
    waiting = sorted(parts, key=lambda part: part.bodies[0])
    is_first = True
    while waiting:
        passing, waiting = _divide(waiting)
        for number in range(len(contents.study.bodies)):
            for part in passing:
                if part.bodies[0] == number:
                    part.begin()
            begun = [part for part in passing if part.bodies[0] <= number <= part.bodies[1]]
            _take_body(nc, contents, number, begun, meshes, has_fields=is_first)
            for part in begun:
                if part.bodies[1] != number:
                    continue
                if part.level is None:
                    statuses = part.arrays["status"].ravel()
                    counts += np.bincount(statuses, minlength=len(counts))
                part.write()
        is_first = False
    sought = int(counts.sum() - counts[PointStatus.NOT_RUN])
    return sought, sought - int(counts[PointStatus.OK])


def _take_body(
    nc: netCDF4.Dataset,
    contents: _Contents,
    number: int,
    parts: Sequence[_Part],
    meshes: Meshes,
    has_fields: bool,
) -> None:
    """Read the records of a body once, for parts and, if `has_fields`, for meshes and fields."""
    has_variants = bool(contents.study.variants)
    for level in contents.levels(number) if has_variants else ():
        _take_level(contents, number, level, parts)
        if has_fields and level.level in meshes:
            meshes[level.level].put_level(number, level)
    for block in contents.blocks(number):
        if has_fields and block.fields:
            if has_variants:
                meshes[block.level].put_fields(number, block)
            else:
                _put_fields(nc[f"level_{block.level}"], block)
        positions = contents.sweep.positions(number, block.points)
        values = _values(block)
        for part in parts:
            if part.extent is contents.sweep and part.level in (None, block.level):
                part.take(positions, block.level, values)


def _divide(parts: Sequence[_Part]) -> tuple[list[_Part], list[_Part]]:
    """Divide parts, sorted by their first bodies, into those of the next pass and the others.

    MAX_MEMORY holds all parts of a pass that are begun and not yet written.
    """
    passing, waiting = list[_Part](), list[_Part]()
    for part in parts:
        begun_size = sum(p.size for p in passing if p.bodies[1] >= part.bodies[0])
        if passing and begun_size + part.size > MAX_MEMORY:
            waiting.append(part)
        else:
            passing.append(part)
    return passing, waiting


def _values(block: BlockRecord) -> dict[str, Any]:
    """Return the values (R, …) of the points of a block by the names of variables."""
    reasons = np.full(len(block), "", dtype=object)
    for row, reason in block.reasons.items():
        reasons[row] = without_paths(reason)
    names = ("status", "u_T", "xi", "sticks", "opening", "S_N", "rests_N")
    along = {name: getattr(block, name) for name in names}
    return along | block.numbers | {"reason": reasons}


def _take_level(
    contents: _Contents, number: int, level: LevelRecord, parts: Iterable[_Part]
) -> None:
    """Pass to parts the arrays of a level that do not come by block.

    Those are the contact line of the geometry, and the arrays with which a page solves its points.
    """
    once, by_point = dict[str, Any](), dict[str, Any]()
    live_variables = {v.name: v for v in schema.LIVE}
    outer_positions = contents.outer.positions(number)
    sweep_positions = contents.sweep.positions(number)
    for name, values in (vars(level) | level.fields).items():
        plain = name.removeprefix(schema.LIVE_PREFIX)
        if plain in schema.ONCE:
            once[plain] = np.broadcast_to(values, (len(outer_positions), *values.shape))
        elif plain != name:
            sweep_ndim = values.ndim - len(live_variables[plain].dims[1:])
            by_point[plain] = values.reshape(-1, *values.shape[sweep_ndim:])
    for part in parts:
        if part.level == level.level and part.extent is contents.outer:
            part.take(outer_positions, level.level, once)
        if part.level == level.level and part.extent is contents.sweep:
            part.take(sweep_positions, level.level, by_point)


def _put_level(nc: netCDF4.Dataset, contents: _Contents, level: LevelRecord) -> list[_Part]:
    """Write the group of a level of one body; return the parts of its points.

    The group has the contact line, the whole mesh if the record has it, and all solutions.
    """
    study = contents.study
    group = nc.createGroup(f"level_{level.level}")
    group.setncattr("level", np.int32(level.level))
    if "node" not in group.dimensions:
        group.createDimension("node", len(level.arclength))
    if "node_x" in level.fields:
        _put_topology(group)
        put_all(group, schema.MESH, level.fields, study)
        if "region" in level.fields:
            _put_region(group, study, level.fields["region"])
        for variable in _fields(study):
            define(group, variable, study, (1,) * len(study.shape) + level.fields["node_x"].shape)
    put_all(group, schema.RIM, level.fields, study)
    if schema.RIM_EDGE.name in group.variables:
        names = (name for name, _ in study.scenes[0].boundary)
        group[schema.RIM_EDGE.name].setncatts(dict(schema.flags(*names)))
    live = dict[str, Any]()
    for variable in schema.LIVE:
        name = schema.LIVE_PREFIX + variable.name
        if name in level.fields:
            live[variable.name] = level.fields[name]
    if live:
        put_all(group.createGroup("live"), schema.LIVE, live, study)
    line = (*schema.CONTACT, *schema.OPENING, *schema.HELD, *schema.JOINTS)
    put_all(group, line, {**vars(level), **level.fields}, study)
    held = level.fields.get("held_x", ())
    along = [*schema.CONTACT, *line_variables(study)]
    along += schema.HELD if len(held) else ()
    openings = level.fields.get("opening_x", ())
    along += schema.OPENING if len(openings) else ()
    nodes = len(level.arclength)
    sizes = {"node": nodes, "held_end": len(held), "opening_node": len(openings)}
    parts = _parts(group, level.level, study, _along(along, SWEEP), sizes, contents.sweep)
    _put_solutions(group, contents, level.level)
    return parts


def _put_topology(group: netCDF4.Group) -> None:
    """Make, then write, the variable that names the arrays of the mesh of a level."""
    if "mesh" not in group.variables:
        group.createVariable("mesh", "i4", (), fill_value=False).setncatts(schema.MESH_TOPOLOGY)
    else:
        group["mesh"][...] = 0


def _put_region(group: netCDF4.Group, study: Study, values: Any) -> None:
    """Make, then write, the materials of the triangles."""
    names = (name for name, _ in study.scenes[0].material.regions)
    put(group, schema.REGION, study, values).setncatts(dict(schema.flags(BODY, *names)))


def _fields(study: Study) -> tuple[FileVariable, ...]:
    """Return the fields of the body; the temperature only if some material expands."""
    expands = {scene.material.expands for scene in distinct(study.scenes, "material")}
    return schema.FIELDS[1:] if expands == {False} else schema.FIELDS


def _put_solutions(
    group: netCDF4.Group,
    contents: _Contents,
    level: int,
    longest: Mapping[str, int] | None = None,
) -> None:
    """Make, then write, all solutions of the points of a level, if the study asks for them.

    longest: sizes of the dimensions of the longest contact line, if there are several geometries
    """
    blocks = contents.solutions.get(level, [])
    if longest is not None:
        blocks = [_padded(block, longest) for block in blocks]
    if not blocks:
        return
    variables = list(schema.SOLUTION)
    if contents.study.opens:
        variables += schema.SOLUTION_OPENING
    if all(schema.EXISTENCE_RADIUS.name in block for block in blocks):
        variables.append(schema.EXISTENCE_RADIUS)
    columns = dict[str, Any]()
    for variable in variables:
        columns[variable.name] = np.concatenate([block[variable.name] for block in blocks])
    order = np.argsort(columns["solution_point"], kind="stable")
    sorted_columns = {name: column[order] for name, column in columns.items()}
    put_all(group, variables, sorted_columns, contents.study)


def _padded(solutions: Mapping[str, NDArray[Any]], longest: Mapping[str, int]) -> Arrays:
    """Return solutions of a geometry with missing values up to sizes of dimensions."""
    padded = dict(solutions)
    for variable in (*schema.SOLUTION, *schema.SOLUTION_OPENING):
        if variable.name in solutions and len(variable.dims) > 1:
            values = solutions[variable.name]
            padded[variable.name] = missing(variable, (len(values), longest[variable.dims[1]]))
            padded[variable.name][:, : values.shape[1]] = values
    return padded


def _put_fields(group: netCDF4.Group, block: BlockRecord) -> None:
    """Write whole-body fields point by point, because they are large."""
    for name, rows in block.fields.items():
        for row, values in enumerate(rows):
            if not np.isnan(values).all():
                group[name][block.index(row)] = values


# -- several geometries


def _put_geometries(nc: netCDF4.Dataset, contents: _Contents) -> None:
    """Make, then write, the geometry of every point, and the options that make its study."""
    study = contents.study
    numbers = np.full(len(study.scenes), -1, dtype=np.int32)
    for number in contents.geometries:
        numbers[study.variants[number].places] = number
    put(nc, schema.NUMBER, study, numbers.reshape(study.shape))
    texts = []
    for variant in study.variants:
        options = variant.study.overrides if variant.study is not None else ()
        texts.append("\n".join(without_directories(options)))
    put(nc, schema.OVERRIDES, study, texts)
    if OWN_POINT in inner_dims(study) and OWN_POINT not in nc.dimensions:
        nc.createDimension(OWN_POINT, max(len(variant.places) for variant in study.variants))


def _put_lines(nc: netCDF4.Dataset, contents: _Contents, number: int, max_size: int) -> list[_Part]:
    """Make the group of a level with the contact lines of all geometries, padded to the longest.

    Returns the parts in which they are written.
    """
    study, sizes = contents.study, contents.sizes[number]
    group = nc.createGroup(f"level_{number}")
    group.setncattr("level", np.int32(number))
    ends = ("node", "held_end", "joint", "rim_segment", "opening_node")
    padded = {dim: sizes.longest(dim) for dim in (*ends, "node_column")}
    padded["rim_end"] = 2 if padded["rim_segment"] else 0
    for dim in (*ends, "rim_end"):
        if padded[dim] and dim not in group.dimensions:
            group.createDimension(dim, padded[dim])
    line = [*schema.CONTACT, *line_variables(study)]
    line += schema.HELD if padded["held_end"] else ()
    line += schema.JOINTS if padded["joint"] else ()
    line += schema.OPENING if padded["opening_node"] else ()
    line += schema.RIM if padded["rim_segment"] else ()
    groups = {group: [among_geometries(v) for v in line]}
    if padded["node_column"]:
        live = group.createGroup("live")
        if "node_column" not in live.dimensions:
            live.createDimension("node_column", padded["node_column"])
        groups[live] = [among_geometries(v) for v in schema.LIVE]
    parts = list[_Part]()
    for target, variables in groups.items():
        once, swept = _along(variables, OUTER), _along(variables, SWEEP)
        parts += _parts(target, number, study, once, padded, contents.outer, max_size)
        parts += _parts(target, number, study, swept, padded, contents.sweep, max_size)
    flags = schema.flags(schema.NONE, *sizes.edge_names, first=schema.NO_EDGE)
    for name in {*schema.EDGE_FLAGS} & {*group.variables}:
        group[name].setncatts(dict(flags))
    if schema.RIM_EDGE.name in group.variables:
        names = (name for name, _ in study.scenes[0].boundary)
        meanings = schema.flags(schema.NONE, *names, first=schema.NO_EDGE)
        group[schema.RIM_EDGE.name].setncatts(dict(meanings))
    _put_solutions(group, contents, number, padded)
    return parts


@dataclass(frozen=True, eq=False)
class _Meshes:
    """The meshes of one level of several geometries, end to end, and their fields."""

    group: netCDF4.Group
    sizes: _Sizes

    @classmethod
    def of(cls, group: netCDF4.Group, study: Study, sizes: _Sizes) -> _Meshes:
        """Make the variables of the meshes of a level, and write the sizes of the meshes."""
        nodes, faces = sizes.total("mesh_node"), sizes.total("mesh_face")
        for dim, size in {"mesh_node": nodes, "mesh_face": faces, "corner": 3}.items():
            if dim not in group.dimensions:
                group.createDimension(dim, size)
        _put_topology(group)
        for variable in schema.MESH_COUNTS:
            dim = variable.name.removesuffix("_count")
            put(group, variable, study, sizes.counts[dim])
        node_dtype: Dtype = "i8" if nodes > MAX_INT32 else "i4"
        for variable in (*schema.MESH, schema.MESH_GEOMETRY):
            if variable.name == "triangle":
                variable = replace(variable, dtype=node_dtype)
            define(group, variable, study)
        if "region" in sizes.names:
            names = (name for name, _ in study.scenes[0].material.regions)
            region = define(group, schema.REGION, study)
            region.setncatts(dict(schema.flags(BODY, *names)))
        fields = [among_geometries(v) for v in _fields(study)]
        extents = [dimensions(group)[dim] for dim in expand(fields[0].dims, study)[:-1]]
        # a chunk as long as a mesh, so that a mesh is written without a look at its neighbours
        node_counts = sizes.counts["mesh_node"]
        typical_count = int(np.median(node_counts[node_counts > 0]))
        max_length = CHUNK // 8
        length = min(nodes, max_length, max(max_length // math.prod(extents), typical_count))
        points = tile_shape(tuple(extents), max(1, max_length // length))
        for variable in fields:
            define(group, variable, study, (*points, length))
        return cls(group, sizes)

    def _slice(self, dim: str, number: int) -> slice:
        start = self.sizes.start(dim, number)
        return slice(start, start + int(self.sizes.counts[dim][number]))

    def put_level(self, number: int, level: LevelRecord) -> None:
        """Write the mesh of a geometry; its triangles count the nodes of the whole level."""
        if "node_x" not in level.fields:
            return
        nodes, faces = self._slice("mesh_node", number), self._slice("mesh_face", number)
        for name in ("node_x", "node_y"):
            self.group[name][nodes] = level.fields[name]
        triangle = self.group["triangle"]
        triangle[faces] = level.fields["triangle"] + triangle.dtype.type(nodes.start)
        self.group["mesh_geometry"][faces] = number
        if "region" in level.fields:
            self.group["region"][faces] = level.fields["region"]

    def put_fields(self, number: int, block: BlockRecord) -> None:
        """Write the fields of points of a geometry."""
        nodes = self._slice("mesh_node", number)
        for name, rows in block.fields.items():
            variable = self.group[name]
            for row, values in enumerate(rows):
                if not np.isnan(values).all():
                    index = block.index(row) if variable.ndim > 1 else ()
                    variable[*index, nodes] = values


MAX_INT32 = 2**31 - 1
"""Largest number of a mesh node in 4 bytes."""
