"""The one writer: the file of a run, complete or not there at all.

The file of a run is written once, from the records of the journal. Values by point are gathered in
parts, runs of tiles, as many at a time as MEMORY holds; the blocks of a geometry come in any order,
the geometries one after the other. A part is written as soon as the last of its geometries is read,
so that one pass over the records does for a sweep over geometries.

The file of a sweep over geometries looks like that of one: a table of all points, in which what a
level has once (h_max, n_dof, times) stands by point, and a group for each level with the contact
lines and the meshes of all geometries (`schema.among_geometries`). Tiles are runs of geometries
with all their points, whatever the order of the axes. A point of a refused geometry has the status
mesh_failed and its reason; its contact lines are missing values, its mesh has no nodes, and −1
stands in place of its number in the variable `geometry`.
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


BRANCH, SWEPT_LOADS = "solver_branch", "swept_loads"
"""Global attributes of a run: which solution is stored; coordinates along which only loads
change."""
Arrays = dict[str, np.ndarray[Any, Any]]
MEMORY = 2**26
"""Bytes of results that the writer holds at a time; a longer sweep takes several passes over its
records."""
KEPT = "finished points are kept in the journal"


@dataclass(frozen=True, eq=False)
class Results:
    """What a run has of a body.

    levels, blocks: read anew whenever they are called, so that they need not fit into memory; of
    two records of one
                point the last one counts, and points without any stay "not run"
    attributes: global ones of the file (`tcstudy.data.files`)
    """

    study: Study
    levels: Callable[[], Iterable[LevelRecord]]
    blocks: Callable[[], Iterable[BlockRecord]]
    attributes: Mapping[str, Any] = field(default_factory=dict)


def write(
    path: Path,
    whole: Results,
    geometries: Mapping[int, Results] | None = None,
    done: Callable[[], object] = tuple,
    seen: Snapshot | None = None,
) -> tuple[int, int]:
    """Write all results of a run to `path`, replacing an old file in one step.

    geometries: of a sweep over geometries, those that have a mesh, by number; `whole` has the
    points of the others
    done: called when all is read, before the old file goes
    seen: the only file at `path` that may be replaced; None for any
    Returns how many solutions were sought, on all levels, and how many of them failed.

    Raises StoreError if the file cannot be written (the old one is then untouched).
    """
    study = whole.study
    counts: list[tuple[int, int]] = []

    def make(nc: netCDF4.Dataset) -> None:
        contents = _Contents(whole, geometries or {})
        for _ in ("made", "written"):
            parts, meshes = _put_once(nc, contents)
        counts.append(_put_points(nc, contents, parts, meshes))
        done()

    of_run: dict[str, Any] = {}
    if study.variants:
        of_run = {GEOMETRIES: len(study.variants), LAYOUT: PADDED}
    names = axis_names(study.axes) if study.axes else ()
    swept_loads = " ".join(names[d] for d in load_axes(study))
    of_run |= {BRANCH: study.solver.branch, SWEPT_LOADS: swept_loads}
    write_dataset(path, {**whole.attributes, **of_run}, make, KEPT, seen)
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
    texts = {
        name: without_paths(v) if isinstance(v, str) else v for name, v in record.attributes.items()
    }

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

    write_dataset(path, {**attributes, CONTENT: record.kind, **texts}, make, seen=seen)


def root_variables(study: Study) -> tuple[FileVariable, ...]:
    """The variables of the root group of this study's file."""
    mesh = study.mesh
    return (
        *schema.ROOT,
        *schema.region_variables(study),
        *(schema.SOLVERS if len(study.solver.names) > 1 else ()),
        *(schema.GUARANTEED if mesh.guarantee else ()),
        *(schema.EVERY if study.solver.every else ()),
        *(schema.ESTIMATES if mesh.estimates else ()),
        *(schema.goal_variables(mesh.goal, study.exact is not None) if mesh.estimates else ()),
        *schema.requested_variables(study),
    )


def numbers(study: Study) -> list[FileVariable]:
    """Those that a block of points has numbers of."""
    return [
        v
        for v in root_variables(study)
        if v.dims[:2] == schema.POINT_LEVEL and v.name not in ("status", "reason")
    ]


@dataclass(eq=False)
class _Sizes:
    """Sizes of one level of several geometries.

    counts: by dimension (G,), 0 for a geometry that does not have the level
    names:  of the arrays that some geometry has;  edge_names: of the contact edges
    """

    counts: dict[str, NDArray[np.int64]]
    names: set[str]
    edge_names: tuple[str, ...]

    @classmethod
    def none(cls, geometries: int, edge_names: tuple[str, ...]) -> _Sizes:
        """Return the sizes of so many geometries of which none has the level yet."""
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
        """Return where a geometry begins along such a dimension."""
        return int(self.counts[dim][:number].sum())


_SIZED = {
    "node": "x",
    "held_end": "held_x",
    "joint": "joint_node",
    "rim_segment": "rim_edge",
    "mesh_node": "node_x",
    "mesh_face": "triangle",
    "node_column": schema.LIVE_PREFIX + "A_tilde",
}
"""By dimension of a level the array that has its length."""


@dataclass(frozen=True, eq=False)
class _Contents:
    """All records of a run, body by body: geometry by geometry, or of the one body.

    whole, geometries: as of `write`
    """

    whole: Results
    geometries: Mapping[int, Results]

    @property
    def study(self) -> Study:
        """The study of the whole file."""
        return self.whole.study

    def levels(self, number: int) -> Iterable[LevelRecord]:
        """Return the levels of a body; a refused geometry has none."""
        if not self.study.variants:
            return self.whole.levels()
        return self.geometries[number].levels() if number in self.geometries else ()

    def blocks(self, number: int) -> Iterable[BlockRecord]:
        """Return the blocks of a body, whose points are those of its own sweep."""
        if not self.study.variants:
            return self.whole.blocks()
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
        for block in self.whole.blocks():
            number = int(variant_of[block.points[0]])
            places = self.study.variants[number].places
            by_number[number].append(replace(block, points=np.searchsorted(places, block.points)))
        return by_number

    @cached_property
    def level_values(self) -> dict[str, NDArray[Any]]:
        """(P, levels) what a level has once, by name; of one body (1, levels)."""
        return self._of_levels[0]

    @cached_property
    def sizes(self) -> dict[int, _Sizes]:
        """Sizes of the levels that some geometry has, by number of the level."""
        return dict(sorted(self._of_levels[1].items()))

    @cached_property
    def _of_levels(self) -> tuple[dict[str, NDArray[Any]], dict[int, _Sizes]]:
        """What one look through all levels tells, before any is written."""
        study, several = self.study, bool(self.study.variants)
        rows = len(study.scenes) if several else 1
        variables = [v for v in root_variables(study) if v.dims == LEVEL]
        table = {v.name: missing(v, (rows, study.mesh.levels)) for v in variables}
        sizes = dict[int, _Sizes]()
        for number, body in enumerate(study.bodies):
            places = body.places if several else 0
            for level in self.levels(number):
                for name, values in table.items():
                    values[places, level.level] = getattr(level, name)
                if level.level not in sizes:
                    sizes[level.level] = _Sizes.none(len(study.bodies), level.edge_names)
                sizes[level.level].add(number, vars(level) | level.fields)
        return table, sizes

    @cached_property
    def solutions(self) -> dict[int, list[Arrays]]:
        """All solutions by level, if they are asked for, at places of the whole sweep."""
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
        first = [*dict.fromkeys(study.geometric)] if study.mode == "grid" else []
        rest = [d for d in range(len(study.shape)) if d not in first]
        return _Extent.of(study.shape, (*first, *rest), self.places)

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
    """Dimensions along which variables lie place by place, and the order in which places are
    gathered.

    shape:  in the order of the file;  order: its dimensions, those of geometries first
    places: of every body, in C order of the shape
    body:   (P,) whose place it is, in the order in which they are gathered
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
        """Return where points of a body, by default all, come when places are gathered."""
        places = self.places[number][points]
        if self.order == tuple(range(len(self.shape))):
            return places
        index = np.unravel_index(places, self.shape)
        return np.ravel_multi_index(tuple(index[d] for d in self.order), self.gathered)

    def as_in_file(self, gathered: Sequence[Any]) -> tuple[Any, ...]:
        """Return one item for each dimension, given in the order of gathering, as the file has
        them."""
        by_dim = dict(zip(self.order, gathered, strict=True))
        return tuple(by_dim[d] for d in range(len(self.shape)))


@dataclass(eq=False)
class _Part:
    """A run of tiles of variables of one group: of the root, of all levels, or of the contact lines
    of one level.

    level:  None for the root;  shapes: of what a place has of each variable;  arrays: values of the part, once begun
    bodies: the first and the last that have a place here
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
        """The first and the last body that has a place here."""
        own = self.extent.body[self.tiles[0][1] : self.tiles[-1][2]]
        return int(own.min()), int(own.max())

    def begin(self) -> None:
        """Nothing is known yet."""
        count = self.tiles[-1][2] - self.tiles[0][1]
        self.arrays = {v.name: missing(v, (count, *self.shapes[v.name])) for v in self.variables}

    def take(self, positions: Places, level: int, values: Mapping[str, Any]) -> None:
        """Take the values (R, …) at R positions, of those that lie here; shorter rows are
        padded."""
        start, stop = self.tiles[0][1], self.tiles[-1][2]
        rows = np.flatnonzero((positions >= start) & (positions < stop))
        if not len(rows):
            return
        at = positions[rows] - start
        for variable in self.variables:
            given = values.get(variable.name)
            if given is None:
                continue
            own = given[rows]
            if own.dtype.kind == "f":  # where NaN stands for missing
                own = np.where(np.isnan(own), variable.missing, own)
            if self.level is None:
                self.arrays[variable.name][at, level] = own
            else:
                lengths = tuple(slice(n) for n in own.shape[1:])
                where: Any = (at, *lengths)
                self.arrays[variable.name][where] = own

    def write(self) -> None:
        """To the file, tile by tile, each a hyperslab."""
        begin, dims = self.tiles[0][1], len(self.extent.shape)
        for variable in self.variables:
            array, new = self.arrays.pop(variable.name), self.group[variable.name]
            for cut, start, stop in self.tiles:
                values = array[start - begin : stop - begin]
                # a text that is never written is empty, and costs nothing
                if variable.dtype == "str" and not values.any():
                    continue
                gathered = values.reshape(*(s.stop - s.start for s in cut), *values.shape[1:])
                axes = self.extent.as_in_file(range(dims))
                rest = range(dims, gathered.ndim)
                new[self.extent.as_in_file(cut)] = gathered.transpose(*axes, *rest)


def _parts(
    group: netCDF4.Dataset,
    level: int | None,
    study: Study,
    variables: Sequence[FileVariable],
    sizes: Mapping[str, int],
    extent: _Extent,
    room: int = 0,
) -> list[_Part]:
    """Define variables along an extent, and cut them into parts.

    sizes: of the dimensions after those of the extent;  room: bytes of a part, at most, if a tile is no larger
    """
    shapes = {v.name: tuple(sizes[d] for d in v.dims if d not in (SWEEP, OUTER)) for v in variables}
    widths = [
        math.prod(shapes[v.name]) * (8 if v.dtype == "str" else np.dtype(v.dtype).itemsize)
        for v in variables
    ]
    tile = tile_shape(extent.gathered, max(1, CHUNK // max(1, *widths)))
    for variable in variables:
        define(group, variable, study, (*extent.as_in_file(tile), *shapes[variable.name]))
    every, size = list(tiles(extent.gathered, tile)), sum(widths) * math.prod(tile)
    count = max(1, (room or MEMORY // 4) // max(1, size))
    cuts = (every[i : i + count] for i in range(0, len(every), count))
    return [_Part(group, level, [*variables], shapes, extent, cut, len(cut) * size) for cut in cuts]


def _along(variables: Iterable[FileVariable], *dims: str) -> list[FileVariable]:
    """Return the variables that have one of these dimensions."""
    return [v for v in variables if {*dims} & {*v.dims}]


Meshes = Mapping[int, "_Meshes"]


def _put_once(nc: netCDF4.Dataset, contents: _Contents) -> tuple[list[_Part], Meshes]:
    """Write all that does not come record by record, and make what does.

    Returns the parts in which the points, and contact lines of geometries, are to be written, and
    by level what writes the meshes of several geometries.
    """
    study = contents.study
    variables = root_variables(study)
    put_axes(nc, study)
    put(nc, schema.LEVEL_COORDINATE, study, np.arange(study.mesh.levels))
    named = {
        "start": (schema.START_NAMES, "where the solver started"),
        "solver": (study.solver.names, "solver"),
    }
    for dim, (names, what) in named.items():
        if len(names) > 1:
            put(nc, FileVariable(dim, "str", "", what, (dim,), coordinate=True), study, list(names))
    sizes = {
        "level": study.mesh.levels,
        "start": len(schema.START_NAMES),
        "solver": len(study.solver.names),
    }
    room = MEMORY // 4
    if study.variants:  # parts of all groups are begun with the first geometry
        room //= 1 + 2 * len(contents.sizes)
    parts = _parts(nc, None, study, _along(variables, SWEEP), sizes, contents.sweep, room)
    shape, dims = (study.shape, POINT_LEVEL) if study.variants else ((), LEVEL)
    for variable in (v for v in variables if v.dims == LEVEL):
        values = contents.level_values[variable.name].reshape(*shape, -1)
        put(nc, replace(variable, dims=dims), study, values)
    if not study.variants:
        for level in contents.levels(0):
            parts += _put_level(nc, contents, level)
        return parts, {}
    _put_geometries(nc, contents)
    meshes = dict[int, _Meshes]()
    for number, level_sizes in contents.sizes.items():
        parts += _put_lines(nc, contents, number, room)
        if level_sizes.total("mesh_node"):
            meshes[number] = _Meshes.of(nc[f"level_{number}"], study, level_sizes)
    return parts, meshes


def _put_points(
    nc: netCDF4.Dataset, contents: _Contents, parts: Iterable[_Part], meshes: Meshes
) -> tuple[int, int]:
    """Write all that comes record by record; returns what `write` does."""
    several = bool(contents.study.variants)
    count, first = np.zeros(len(PointStatus), dtype=np.intp), True
    left = sorted(parts, key=lambda part: part.bodies[0])
    while left:
        now, left = _together(left)
        for number in range(len(contents.study.bodies)):
            for part in (part for part in now if part.bodies[0] == number):
                part.begin()
            begun = [part for part in now if part.bodies[0] <= number <= part.bodies[1]]
            for level in contents.levels(number) if several else ():
                _take_level(contents, number, level, begun)
                if first and level.level in meshes:
                    meshes[level.level].put_level(number, level)
            for block in contents.blocks(number):
                if first and block.fields and several:
                    meshes[block.level].put_fields(number, block)
                elif first and block.fields:
                    _put_fields(nc[f"level_{block.level}"], block)
                positions, values = contents.sweep.positions(number, block.points), _values(block)
                for part in begun:
                    if part.extent is contents.sweep and part.level in (None, block.level):
                        part.take(positions, block.level, values)
            for part in (part for part in begun if part.bodies[1] == number):
                if part.level is None:
                    statuses = part.arrays["status"].ravel()
                    count += np.bincount(statuses, minlength=len(count))
                part.write()
        first = False
    sought = int(count.sum() - count[PointStatus.NOT_RUN])
    return sought, sought - int(count[PointStatus.OK])


def _together(parts: Sequence[_Part]) -> tuple[list[_Part], list[_Part]]:
    """Divide parts, sorted by their first bodies, into those of one pass over the records, of which
    MEMORY holds all that are begun and not yet written, and the others."""
    now, later = list[_Part](), list[_Part]()
    for part in parts:
        begun = sum(other.size for other in now if other.bodies[1] >= part.bodies[0])
        (later if now and begun + part.size > MEMORY else now).append(part)
    return now, later


def _values(block: BlockRecord) -> dict[str, Any]:
    """Return the values (R, …) of the points of a block by the names of variables."""
    reasons = np.full(len(block), "", dtype=object)
    for row, reason in block.reasons.items():
        reasons[row] = without_paths(reason)
    along = {name: getattr(block, name) for name in ("status", "u_T", "xi", "sticks")}
    return along | block.numbers | {"reason": reasons}


def _take_level(
    contents: _Contents, number: int, level: LevelRecord, parts: Iterable[_Part]
) -> None:
    """Give parts what the contact line of a geometry has once, and what a page needs to solve its
    points."""
    once, by_point = dict[str, Any](), dict[str, Any]()
    along = {v.name: v for v in schema.LIVE}
    outer, sweep = contents.outer.positions(number), contents.sweep.positions(number)
    for name, values in (vars(level) | level.fields).items():
        plain = name.removeprefix(schema.LIVE_PREFIX)
        if plain in schema.ONCE:
            once[plain] = np.broadcast_to(values, (len(outer), *values.shape))
        elif plain != name:
            own = values.ndim - len(along[plain].dims[1:])
            by_point[plain] = values.reshape(-1, *values.shape[own:])
    for part in parts:
        if part.level == level.level and part.extent is contents.outer:
            part.take(outer, level.level, once)
        if part.level == level.level and part.extent is contents.sweep:
            part.take(sweep, level.level, by_point)


def _put_level(nc: netCDF4.Dataset, contents: _Contents, level: LevelRecord) -> list[_Part]:
    """Write the group of a level of one body: its contact line, its whole mesh if the record has
    one, and all solutions of its points; returns the parts of what lies along the sweep."""
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
    live = {
        v.name: level.fields[name]
        for v in schema.LIVE
        if (name := schema.LIVE_PREFIX + v.name) in level.fields
    }
    if live:
        put_all(group.createGroup("live"), schema.LIVE, live, study)
    put_all(
        group,
        (*schema.CONTACT, *schema.HELD, *schema.JOINTS),
        {**vars(level), **level.fields},
        study,
    )
    held = level.fields.get("held_x", ())
    along = (*schema.CONTACT, *line_variables(study), *(schema.HELD if len(held) else ()))
    sizes = {"node": level.n_contact, "held_end": len(held)}
    parts = _parts(group, level.level, study, _along(along, SWEEP), sizes, contents.sweep)
    _put_solutions(group, contents, level.level)
    return parts


def _put_topology(group: netCDF4.Group) -> None:
    """Make, then write, the variable that ties the mesh of a level together."""
    if "mesh" not in group.variables:
        group.createVariable("mesh", "i4", (), fill_value=False).setncatts(schema.MESH_TOPOLOGY)
    else:
        group["mesh"][...] = 0


def _put_region(group: netCDF4.Group, study: Study, values: Any) -> None:
    """Make, then write, the materials of the triangles."""
    names = (name for name, _ in study.scenes[0].material.regions)
    put(group, schema.REGION, study, values).setncatts(dict(schema.flags(BODY, *names)))


def _fields(study: Study) -> tuple[FileVariable, ...]:
    """Return the fields of the body; without a temperature if it loads no scene."""
    expands = {scene.material.expands for scene in distinct(study.scenes, "material")}
    return schema.FIELDS[1:] if expands == {False} else schema.FIELDS


def _put_solutions(
    group: netCDF4.Group, contents: _Contents, level: int, nodes: int | None = None
) -> None:
    """Make, then write, all solutions of the points of a level, if they are asked for.

    nodes: of several geometries the length of the longest contact line
    """
    found = contents.solutions.get(level, [])
    if nodes is not None:
        found = [_padded(one, nodes) for one in found]
    if not found:
        return
    order = np.argsort(np.concatenate([one["solution_point"] for one in found]), kind="stable")
    columns = {
        v.name: np.concatenate([one[v.name] for one in found])[order] for v in schema.SOLUTION
    }
    put_all(group, schema.SOLUTION, columns, contents.study)


def _padded(solutions: Mapping[str, NDArray[Any]], nodes: int) -> Arrays:
    """Return solutions of a geometry with missing values up to a number of nodes."""
    padded = dict(solutions)
    for variable in _along(schema.SOLUTION, "node"):
        own = solutions[variable.name]
        padded[variable.name] = missing(variable, (len(own), nodes))
        padded[variable.name][:, : own.shape[1]] = own
    return padded


def _put_fields(group: netCDF4.Group, block: BlockRecord) -> None:
    """Whole-body fields point by point: they are large."""
    for name, rows in block.fields.items():
        for row, values in enumerate(rows):
            if not np.isnan(values).all():
                group[name][block.index(row)] = values


# -- several geometries
# ------------------------------------------------------------------------------------------------


def _put_geometries(nc: netCDF4.Dataset, contents: _Contents) -> None:
    """Make, then write, which geometry a point has, and the options that make its study."""
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


def _put_lines(nc: netCDF4.Dataset, contents: _Contents, number: int, room: int) -> list[_Part]:
    """Make the group of a level with the contact lines of all geometries, padded to the longest;
    returns the parts in which they are written."""
    study, sizes = contents.study, contents.sizes[number]
    group = nc.createGroup(f"level_{number}")
    group.setncattr("level", np.int32(number))
    ends = ("node", "held_end", "joint", "rim_segment")
    padded = {dim: sizes.longest(dim) for dim in (*ends, "node_column")}
    padded["rim_end"] = 2 if padded["rim_segment"] else 0
    for dim in (*ends, "rim_end"):
        if padded[dim] and dim not in group.dimensions:
            group.createDimension(dim, padded[dim])
    every = [*schema.CONTACT, *line_variables(study)]
    every += schema.HELD if padded["held_end"] else ()
    every += schema.JOINTS if padded["joint"] else ()
    every += schema.RIM if padded["rim_segment"] else ()
    groups = {group: [among_geometries(v) for v in every]}
    if padded["node_column"]:
        live = group.createGroup("live")
        if "node_column" not in live.dimensions:
            live.createDimension("node_column", padded["node_column"])
        groups[live] = [among_geometries(v) for v in schema.LIVE]
    parts = list[_Part]()
    for where, variables in groups.items():
        once, swept = _along(variables, OUTER), _along(variables, SWEEP)
        parts += _parts(where, number, study, once, padded, contents.outer, room)
        parts += _parts(where, number, study, swept, padded, contents.sweep, room)
    flags = schema.flags(schema.NONE, *sizes.edge_names, first=schema.NO_EDGE)
    for name in {"edge", "joint_edge"} & {*group.variables}:
        group[name].setncatts(dict(flags))
    if schema.RIM_EDGE.name in group.variables:
        names = (name for name, _ in study.scenes[0].boundary)
        meanings = schema.flags(schema.NONE, *names, first=schema.NO_EDGE)
        group[schema.RIM_EDGE.name].setncatts(dict(meanings))
    _put_solutions(group, contents, number, padded["node"])
    return parts


@dataclass(frozen=True, eq=False)
class _Meshes:
    """The meshes of one level of several geometries, end to end, and their fields."""

    group: netCDF4.Group
    sizes: _Sizes

    @classmethod
    def of(cls, group: netCDF4.Group, study: Study, sizes: _Sizes) -> _Meshes:
        """Make the variables of the meshes of a level, and write how large each mesh is."""
        nodes, faces = sizes.total("mesh_node"), sizes.total("mesh_face")
        for dim, size in {"mesh_node": nodes, "mesh_face": faces, "corner": 3}.items():
            if dim not in group.dimensions:
                group.createDimension(dim, size)
        _put_topology(group)
        for variable in schema.MESH_COUNTS:
            dim = variable.name.removesuffix("_count")
            put(group, variable, study, sizes.counts[dim])
        wide: Dtype = "i8" if nodes > MOST_COUNTED else "i4"
        for variable in (*schema.MESH, schema.MESH_GEOMETRY):
            own = replace(variable, dtype=wide) if variable.name == "triangle" else variable
            define(group, own, study)
        if "region" in sizes.names:
            names = (name for name, _ in study.scenes[0].material.regions)
            region = define(group, schema.REGION, study)
            region.setncatts(dict(schema.flags(BODY, *names)))
        inner = [among_geometries(v) for v in _fields(study)]
        extents = [dimensions(group)[dim] for dim in expand(inner[0].dims, study)[:-1]]
        # a chunk as long as a mesh, so that a mesh is written without a look at its neighbours
        having = sizes.counts["mesh_node"][sizes.counts["mesh_node"] > 0]
        length = min(
            nodes, CHUNK // 8, max(CHUNK // 8 // math.prod(extents), int(np.median(having)))
        )
        points = tile_shape(tuple(extents), max(1, CHUNK // 8 // length))
        for variable in inner:
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


MOST_COUNTED = 2**31 - 1
"""Largest number of a mesh node in 4 bytes."""
