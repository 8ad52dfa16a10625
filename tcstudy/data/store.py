"""The one writer: how variables get into a netCDF-4 file, and the file of a run, complete or not
there at all.

A small variable lies in one piece, because chunks of their own would cost it more than its values;
the seal of the file is its checksum. A large one lies in compressed chunks with a checksum each. A
chunk over the sweep is a tile: tiles follow one another in C order and each is a run of points, so
that a sweep can be written, and read, from front to back.

The file of a run is written once, from the records of the journal. Values by point are gathered in
parts, runs of tiles, as many at a time as MEMORY holds; blocks come in any order, so that each time
all of them are looked through.

The file of a sweep over geometries has one table of all points, with what a level has (h_max,
n_dof, times) by point, and a group geometry_i with all that the file of a run of that geometry
alone has, also /level_0, … with profiles and fields, whose lengths differ from mesh to mesh. A
point of a refused geometry has the status mesh_failed and its reason; such a geometry has no group,
and −1 stands in place of its number in the variable `geometry`, by point.
"""

from __future__ import annotations

import math
import re
from collections import defaultdict
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from itertools import accumulate
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from tcstudy.data import schema
from tcstudy.data.files import CONTENT, FINISHED, without_paths, write_dataset
from tcstudy.data.records import BlockRecord, LevelRecord, Record
from tcstudy.data.schema import (
    DIFFERENCE,
    LEVEL,
    OWN_POINT,
    POINT,
    POINT_LEVEL,
    RATE,
    SWEEP,
    Dtype,
    FileVariable,
    PointStatus,
    T,
    line_variables,
    missing,
)
from tcstudy.data.tables import axis_names
from tcstudy.scene.points import distinct, load_axes
from tcstudy.scene.records import BODY
from tcstudy.scene.study import Axis, Study

if TYPE_CHECKING:
    import netCDF4
    import xarray


Places = NDArray[np.intp]
GEOMETRIES = "geometries"
"""Global attribute of a file of a sweep over geometries: how many it has."""
BRANCH, SWEPT_LOADS = "solver_branch", "swept_loads"
"""Global attributes of a run: which solution is stored; coordinates along which only loads
change."""
_GEOMETRY = re.compile(r"/geometry_\d+")
_WHAT = "i of the group geometry_i; -1 where the geometry was refused or has no mesh"
NUMBER = FileVariable("geometry", "i4", "1", "number of the geometry", (SWEEP,), _WHAT)


def sweep_dims(study: Study, *axes: Axis) -> tuple[str, ...]:
    """Names of the dimensions of these axes, or of the whole sweep in the order of
    `study.shape`."""
    if not study.axes:
        return ()
    if study.mode == "list":
        return (POINT,)
    paths = [axis.path for axis in study.axes]
    names = dict(zip(paths, axis_names(study.axes), strict=True))
    return tuple(names[axis.path] for axis in axes or study.axes)


def names_of(where: netCDF4.Dataset, variable: FileVariable, study: Study) -> tuple[str, ...]:
    """Names of the dimensions of a variable in a group; a list of points within a geometry has
    another length."""
    own = OWN_POINT if _GEOMETRY.match(where.path) else POINT
    return tuple(own if name == POINT else name for name in expand(variable.dims, study))


def expand(dims: tuple[str, ...], study: Study) -> tuple[str, ...]:
    """Dimension names with SWEEP replaced by those of the study."""
    return tuple(name for d in dims for name in (sweep_dims(study) if d == SWEEP else (d,)))


def axis_attributes(axis: Axis) -> dict[str, Any]:
    """Attributes of the coordinate variable of a swept parameter; texts have no units."""
    found: dict[str, Any] = {"long_name": ".".join(axis.path)}
    if axis_labels(axis).dtype != object:
        found["units"] = axis.units
        if axis.written[0]:
            found |= {"study_unit": axis.written[0], "study_unit_size": axis.written[1]}
    found |= {"distribution": axis.distribution} if axis.distribution else {}
    return found | dict(DIFFERENCE) if axis.units == "K" else found


def axis_labels(axis: Axis) -> np.ndarray[Any, Any]:
    """Labels of a swept parameter: float64, or objects if one of them is a text."""
    if any(isinstance(label, str) for label in axis.labels):
        return np.array([str(label) for label in axis.labels], dtype=object)
    return np.array(axis.labels, dtype=float)


SMALL = 2**16
"""Bytes up to which a variable lies in one piece."""
CHUNK = 2**20
"""Bytes of a chunk at most."""
COMPRESSED: dict[str, Any] = {
    "compression": "zlib",
    "complevel": 1,
    "shuffle": True,
    "fletcher32": True,
}
Shape = tuple[int, ...]


def tile_shape(shape: Shape, points: int) -> Shape:
    """Extent of tiles of at most `points` points that follow one another in C order."""
    tile, rest = [1] * len(shape), 1
    for d in reversed(range(len(shape))):
        parts = math.ceil(shape[d] / max(1, points // rest))
        tile[d] = max(1, math.ceil(shape[d] / max(1, parts)))
        if parts > 1:
            break
        rest *= shape[d]
    return tuple(tile)


def tiles(shape: Shape, tile: Shape) -> Iterator[tuple[tuple[slice, ...], int, int]]:
    """(slices, first place, place after the last) of every tile; places count points in C order."""
    start = 0
    for index in np.ndindex(*(math.ceil(n / t) for n, t in zip(shape, tile, strict=True))):
        cut = tuple(
            slice(i * t, min((i + 1) * t, n)) for i, t, n in zip(index, tile, shape, strict=True)
        )
        stop = start + math.prod(s.stop - s.start for s in cut)
        yield cut, start, stop
        start = stop


def define(
    where: netCDF4.Dataset, variable: FileVariable, study: Study, chunk: Shape = ()
) -> netCDF4.Variable:
    """Make a variable whose dimensions are there, unless it is there. chunk: of a large one; () for
    usual ones."""
    if variable.name in where.variables:
        return where[variable.name]
    dims, sizes, text = names_of(where, variable, study), dimensions(where), variable.dtype == "str"
    shape, width = (
        tuple(sizes[name] for name in dims),
        16 if text else np.dtype(variable.dtype).itemsize,
    )
    how: dict[str, Any] = {} if text or not math.prod(shape) else {"contiguous": True}
    if large := width * math.prod(shape) > SMALL:  # HDF5 has no filters for scalars and texts
        how = {
            "chunksizes": chunk or tile_shape(shape, CHUNK // width),
            **({} if text else COMPRESSED),
        }
    kind = str if text else variable.dtype
    new = where.createVariable(variable.name, kind, dims, fill_value=variable.fill_value, **how)
    if large:
        new.set_var_chunk_cache(
            size=2 * CHUNK
        )  # the library's own would keep the greater part of the file in memory
    new.setncatts(attributes(variable, study))
    return new


def put(
    where: netCDF4.Dataset, variable: FileVariable, study: Study, values: Any
) -> netCDF4.Variable:
    """Make a variable, or write its values if it is there; dimensions come with the first variable
    that has them.

    All of a file are made before values are written: the first one written after a definition makes
    the library look through the whole file.
    """
    array = np.asarray(values, dtype=object if variable.dtype == "str" else variable.dtype)
    for name, size in zip(names_of(where, variable, study), array.shape, strict=True):
        if name not in dimensions(where):
            where.createDimension(name, size)
    there = variable.name in where.variables
    new = define(where, variable, study)
    if there:
        new[...] = array
    return new


def put_all(
    where: netCDF4.Dataset,
    variables: Iterable[FileVariable],
    values: Mapping[str, Any],
    study: Study,
) -> None:
    """Make, then write, the variables that `values` has by name; edge_names are the contact edges
    of `edge`."""
    for variable in variables:
        if variable.name in values:
            new = put(where, variable, study, values[variable.name])
            if variable.name in ("edge", "joint_edge") and values["edge_names"]:
                new.setncatts(dict(schema.flags(*values["edge_names"])))


def dimensions(where: netCDF4.Dataset) -> dict[str, int]:
    """Sizes of the dimensions of a group, with those that it has from the groups above, up to its
    geometry."""
    above = (
        {} if where.parent is None or _GEOMETRY.fullmatch(where.path) else dimensions(where.parent)
    )
    return above | {name: int(dim.size) for name, dim in where.dimensions.items()}


def put_axes(nc: netCDF4.Dataset, study: Study) -> None:
    """Dimensions and coordinates of the sweep."""
    if not study.axes:
        return
    for axis, name in zip(study.axes, axis_names(study.axes), strict=True):
        labels, dims = axis_labels(axis), sweep_dims(study, axis)
        kind: Dtype = "str" if labels.dtype == object else "f8"
        extra = axis_attributes(axis)
        variable = FileVariable(name, kind, axis.units, "", dims, extra=extra, coordinate=True)
        put(nc, variable, study, labels)


def attributes(variable: FileVariable, study: Study) -> dict[str, Any]:
    """Attributes of a variable in the file of this study (without _FillValue)."""
    extra, units, long_name = dict(variable.extra), variable.units, variable.long_name
    extra |= {"comment": variable.comment} if variable.comment else {}
    if units in (T, RATE):
        assert study.path is not None
        t = study.path.units
        if units == T:
            long_name += f" ({study.path.name})"
            extra |= {"units_metadata": "temperature: difference"} if t == "K" else {}
        units = t if units == T else ("J m-1" if t == "1" else f"J m-1/({t})")
    if study.units == "none" and units != "s":
        extra.pop("units_metadata", None)
        units = "1"
    if study.mode == "list" and SWEEP in variable.dims:
        names = (extra.get("coordinates", ""), *axis_names(study.axes))
        extra["coordinates"] = " ".join(names).strip()
    named = (
        {"long_name": long_name}
        if variable.dtype == "str"
        else {"long_name": long_name, "units": units}
    )
    return named | extra


def sweep_points(study: Study) -> xarray.Dataset:
    """A dataset with the study's axes and an empty `status`, to find a point by its labels."""
    import xarray

    data = xarray.Dataset(attrs={"sweep_mode": study.mode})
    for axis, name in zip(study.axes, axis_names(study.axes), strict=True):
        coordinate = (sweep_dims(study, axis), axis_labels(axis), axis_attributes(axis))
        data = data.assign_coords({name: coordinate})
    data["status"] = (sweep_dims(study), np.zeros(study.shape, dtype=np.int8))
    return data


Arrays = dict[str, np.ndarray[Any, Any]]
MEMORY = 2**26
"""Bytes of results that the writer holds at a time; a longer sweep takes several passes over its
records."""
KEPT = "finished points are kept in the journal"


@dataclass(frozen=True, eq=False)
class Results:
    """What a run has of a body, for a file or a group of it.

    levels, blocks: read anew whenever they are called, so that they need not fit into memory; of
    two records of one
                point the last one counts, and points without any stay "not run"
    attributes: global ones (`tcstudy.data.files`)
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
) -> tuple[int, int]:
    """Write all results of a run to `path`, replacing an old file in one step.

    geometries: of a sweep over geometries, those that have a mesh, by number; `whole` has the
    points of the others
    done: called when all is read, before the old file goes
    Returns how many solutions were sought, on all levels, and how many of them failed.

    Raises StoreError if the file cannot be written (the old one is then untouched).
    """
    study, bodies = whole.study, geometries or {}
    counts: list[tuple[int, int]] = []

    def blocks() -> Iterator[BlockRecord]:
        """Those of all geometries, without what has the length of their meshes."""
        yield from whole.blocks()
        for number, own in bodies.items():
            for block in own.blocks():
                points = study.variants[number].places[block.points]
                yield replace(
                    block,
                    points=points,
                    shape=study.shape,
                    u_T=None,
                    xi=None,
                    sticks=None,
                    fields={},
                    solutions={},
                )

    def make(nc: netCDF4.Dataset) -> None:
        groups = [(nc, replace(whole, blocks=blocks))]
        for number, own in bodies.items():
            groups.append((nc.createGroup(f"geometry_{number}"), own))
            groups[-1][0].setncatts({**own.attributes, FINISHED: np.int32(1)})
        for _ in ("made", "written"):
            left = [_put_once(group, own, bodies) for group, own in groups]
        counts.extend(
            _put_points(group, own, parts) for (group, own), parts in zip(groups, left, strict=True)
        )
        done()

    of_run: dict[str, Any] = {GEOMETRIES: len(study.variants)} if study.variants else {}
    names = axis_names(study.axes) if study.axes else ()
    swept_loads = " ".join(names[d] for d in load_axes(study))
    of_run |= {BRANCH: study.solver.branch, SWEPT_LOADS: swept_loads}
    write_dataset(path, {**whole.attributes, **of_run}, make, KEPT)
    return counts[0]


def write_record(path: Path, study: Study, record: Record, attributes: Mapping[str, Any]) -> None:
    """Write a record to `path`, replacing an old file in one step; raises StoreError if that is not
    possible."""
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

    write_dataset(path, {**attributes, CONTENT: record.kind, **texts}, make)


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
class _Part:
    """A run of tiles of the variables by point of one group: the root, of all levels, or the
    contact line of one level.

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

    def take(self, block: BlockRecord) -> None:
        """The points of a block that lie here."""
        start, stop, places = self.tiles[0][1], self.tiles[-1][2], block.points
        rows = np.flatnonzero((places >= start) & (places < stop))
        at: Any = (
            places[rows] - start if self.level is not None else (places[rows] - start, block.level)
        )
        own = {
            name: getattr(block, name) for name in ("status", "u_T", "xi", "sticks")
        } | block.numbers
        own["reason"] = reasons = np.full(len(block), "", dtype=object)
        for row, reason in block.reasons.items():
            reasons[row] = without_paths(reason)
        for variable in self.variables:
            if (values := own.get(variable.name)) is not None:
                found = values[rows]
                if found.dtype.kind == "f":  # where NaN stands for missing
                    found = np.where(np.isnan(found), variable.missing, found)
                self.arrays[variable.name][at] = found

    def write(self) -> None:
        """To the file, tile by tile, each a hyperslab."""
        begin = self.tiles[0][1]
        for variable in self.variables:
            array, new = self.arrays.pop(variable.name), self.group[variable.name]
            for cut, start, stop in self.tiles:
                values = array[start - begin : stop - begin]
                if (
                    variable.dtype != "str" or values.any()
                ):  # a text that is never written is empty, and costs nothing
                    new[cut] = values.reshape(*(s.stop - s.start for s in cut), *values.shape[1:])


def _parts(
    group: netCDF4.Dataset,
    level: int | None,
    study: Study,
    variables: Iterable[FileVariable],
    sizes: dict[str, int],
) -> list[_Part]:
    """Define the variables by point of a group, and cut them into parts of a quarter of MEMORY at
    most. sizes: of the dimensions after those of the sweep"""
    own = [v for v in variables if SWEEP in v.dims]
    shapes = {v.name: tuple(sizes[d] for d in v.dims if d != SWEEP) for v in own}
    widths = [
        math.prod(shapes[v.name]) * (8 if v.dtype == "str" else np.dtype(v.dtype).itemsize)
        for v in own
    ]
    tile = tile_shape(study.shape, max(1, CHUNK // max(1, *widths)))
    for variable in own:
        define(group, variable, study, (*tile, *shapes[variable.name]))
    every, size = list(tiles(study.shape, tile)), sum(widths) * math.prod(tile)
    count = max(1, MEMORY // (4 * max(1, size)))
    cuts = (every[i : i + count] for i in range(0, len(every), count))
    return [_Part(group, level, own, shapes, cut, len(cut) * size) for cut in cuts]


def _put_once(nc: netCDF4.Dataset, own: Results, geometries: Mapping[int, Results]) -> list[_Part]:
    """All that does not lie along the sweep; what does is made, and cut into parts. geometries: of
    a sweep over them, whose levels the root has, while their profiles are in their groups"""
    study, variables = own.study, root_variables(own.study)
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
    left = _parts(nc, None, study, variables, sizes)
    shape, dims = (study.shape, POINT_LEVEL) if study.variants else ((), LEVEL)
    by_level = [
        (v, missing(v, (math.prod(shape), study.mesh.levels))) for v in variables if v.dims == LEVEL
    ]
    numbers = np.full(len(study.scenes), -1, dtype=np.int32)
    for number, one in geometries.items() if study.variants else ((0, own),):
        numbers[study.bodies[number].places] = number
        for level in one.levels():
            for variable, values in by_level:
                values[study.bodies[number].places if study.variants else 0, level.level] = getattr(
                    level, variable.name
                )
    for variable, values in by_level:
        put(nc, replace(variable, dims=dims), study, values.reshape(*shape, -1))
    if study.variants:
        put(nc, NUMBER, study, numbers.reshape(study.shape))
        return left
    found = defaultdict[int, list[Arrays]](list)
    for block in own.blocks() if study.solver.every else ():
        found[block.level] += [block.solutions] if block.solutions else []
    for level in own.levels():
        group = _put_level(nc, study, level)
        held = level.fields.get("held_x", ())
        along = (*schema.CONTACT, *line_variables(study), *(schema.HELD if len(held) else ()))
        left += _parts(
            group, level.level, study, along, {"node": level.n_contact, "held_end": len(held)}
        )
        if blocks := found[level.level]:
            order = np.argsort(
                np.concatenate([one["solution_point"] for one in blocks]), kind="stable"
            )
            columns = {
                v.name: np.concatenate([one[v.name] for one in blocks])[order]
                for v in schema.SOLUTION
            }
            put_all(group, schema.SOLUTION, columns, study)
    return left


def _put_points(nc: netCDF4.Dataset, own: Results, left: list[_Part]) -> tuple[int, int]:
    """All that lies along the sweep; returns what `write` does."""
    count, first = np.zeros(len(PointStatus), dtype=np.intp), True
    while left:
        together = max(1, sum(size <= MEMORY for size in accumulate(part.size for part in left)))
        now, left = left[:together], left[together:]
        for part in now:
            part.begin()
        for block in own.blocks():
            if first and block.fields:
                _put_fields(nc[f"level_{block.level}"], block)
            for part in now:
                if part.level in (None, block.level):
                    part.take(block)
        for part in now:
            if part.level is None:
                count += np.bincount(part.arrays["status"].ravel(), minlength=len(count))
            part.write()
        first = False
    sought = int(count.sum() - count[PointStatus.NOT_RUN])
    return sought, sought - int(count[PointStatus.OK])


def _put_level(nc: netCDF4.Dataset, study: Study, level: LevelRecord) -> netCDF4.Group:
    """The group of a level: its contact line, and its whole mesh if the record has one."""
    group = nc.createGroup(f"level_{level.level}")
    group.setncattr("level", np.int32(level.level))
    if "node" not in group.dimensions:
        group.createDimension("node", len(level.arclength))
    if "node_x" in level.fields:
        if "mesh" not in group.variables:
            group.createVariable("mesh", "i4", (), fill_value=False).setncatts(schema.MESH_TOPOLOGY)
        else:
            group["mesh"][...] = 0
        put_all(group, schema.MESH, level.fields, study)
        if "region" in level.fields:
            names = (name for name, _ in study.scenes[0].material.regions)
            put(group, schema.REGION, study, level.fields["region"]).setncatts(
                dict(schema.flags(BODY, *names))
            )
        cold = {scene.material.expands for scene in distinct(study.scenes, "material")} == {False}
        for variable in schema.FIELDS[1 if cold else 0 :]:
            define(group, variable, study, (1,) * len(study.shape) + level.fields["node_x"].shape)
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
    return group


def _put_fields(group: netCDF4.Group, block: BlockRecord) -> None:
    """Whole-body fields point by point: they are large."""
    for name, rows in block.fields.items():
        for row, values in enumerate(rows):
            if not np.isnan(values).all():
                group[name][block.index(row)] = values
