"""Variables of a netCDF-4 file: names of dimensions, attributes, chunks.

A small variable lies in one piece, because chunks would cost more than its values. Its checksum is
the seal of the file. A large variable lies in compressed chunks with a checksum each. A chunk over
the sweep is a tile: tiles follow one another in C order and each is a run of points, so that a
sweep can be written, and read, from front to back.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from tcstudy.data import schema
from tcstudy.data.labelled import LabelledArray, LabelledTable
from tcstudy.data.schema import (
    DIFFERENCE,
    INNER,
    OUTER,
    OWN_POINT,
    POINT,
    RATE,
    SWEEP,
    Dims,
    Dtype,
    FileVariable,
    T,
)
from tcstudy.data.tables import axis_names
from tcstudy.scene.study import Axis, Study

if TYPE_CHECKING:
    import netCDF4


Places = NDArray[np.intp]


def sweep_dims(study: Study, *axes: Axis) -> tuple[str, ...]:
    """Return the dimensions of these axes, or of the whole sweep in the order of `study.shape`."""
    if not study.axes:
        return ()
    if study.mode == "list":
        return (POINT,)
    paths = [axis.path for axis in study.axes]
    names = dict(zip(paths, axis_names(study.axes), strict=True))
    return tuple(names[axis.path] for axis in axes or study.axes)


def outer_dims(study: Study) -> tuple[str, ...]:
    """Return the dimensions of the sweep that change the geometry, in the order of the sweep."""
    if not study.geometric:
        return ()
    return sweep_dims(study, *(study.axes[i] for i in study.geometric))


def inner_dims(study: Study) -> tuple[str, ...]:
    """Return the dimensions of the points of one geometry.

    In grid mode those are the other dimensions of the sweep. In list mode it is OWN_POINT if some
    geometry has several points.
    """
    if study.mode == "grid":
        outer = outer_dims(study)
        return tuple(name for name in sweep_dims(study) if name not in outer)
    has_several = any(len(variant.places) > 1 for variant in study.variants)
    return (OWN_POINT,) if has_several else ()


def expand(dims: Dims, study: Study) -> tuple[str, ...]:
    """Return names of dimensions with SWEEP, OUTER and INNER replaced by those of the study."""
    makers = {SWEEP: sweep_dims, OUTER: outer_dims, INNER: inner_dims}
    named = (makers[name](study) if name in makers else (name,) for name in dims)
    return tuple(name for names in named for name in names)


def axis_attributes(axis: Axis) -> dict[str, Any]:
    """Return the attributes of the coordinate of a swept parameter; texts have no units."""
    attributes: dict[str, Any] = {"long_name": ".".join(axis.path)}
    if axis_labels(axis).dtype != object:
        attributes["units"] = axis.units
        unit, unit_size = axis.written
        if unit:
            attributes |= {"study_unit": unit, "study_unit_size": unit_size}
    if axis.distribution:
        attributes["distribution"] = axis.distribution
    if axis.units == "K":
        attributes |= DIFFERENCE
    return attributes


def axis_labels(axis: Axis) -> np.ndarray[Any, Any]:
    """Return the labels of a swept parameter: float64, or texts if one of them is a text."""
    if any(isinstance(label, str) for label in axis.labels):
        return np.array([str(label) for label in axis.labels], dtype=object)
    return np.array(axis.labels, dtype=float)


MAX_CONTIGUOUS = 2**16
"""Size up to which a variable lies in one piece [byte]."""
CHUNK = 2**20
"""Largest size of a chunk [byte]."""
COMPRESSED: dict[str, Any] = {
    "compression": "zlib",
    "complevel": 1,
    "shuffle": True,
    "fletcher32": True,
}
Shape = tuple[int, ...]


def tile_shape(shape: Shape, points: int) -> Shape:
    """Return the extent of tiles of at most `points` points that follow one another in C order."""
    tile = [1] * len(shape)
    tile_points = 1
    for d in reversed(range(len(shape))):
        parts = math.ceil(shape[d] / max(1, points // tile_points))
        tile[d] = max(1, math.ceil(shape[d] / max(1, parts)))
        if parts > 1:
            break
        tile_points *= shape[d]
    return tuple(tile)


def tiles(shape: Shape, tile: Shape) -> Iterator[tuple[tuple[slice, ...], int, int]]:
    """Yield (slices, first place, place after the last) of every tile.

    Places count points in C order.
    """
    start = 0
    counts = (math.ceil(n / t) for n, t in zip(shape, tile, strict=True))
    for index in np.ndindex(*counts):
        edges = zip(index, tile, shape, strict=True)
        cut = tuple(slice(i * t, min((i + 1) * t, n)) for i, t, n in edges)
        stop = start + math.prod(s.stop - s.start for s in cut)
        yield cut, start, stop
        start = stop


def define(
    group: netCDF4.Dataset, variable: FileVariable, study: Study, chunk: Shape = ()
) -> netCDF4.Variable:
    """Make a variable unless it is there, and return it; its dimensions must be there.

    chunk: its extent, if the variable is large; () for a tile
    """
    if variable.name in group.variables:
        return group[variable.name]
    dims = expand(variable.dims, study)
    sizes = dimensions(group)
    shape = tuple(sizes[name] for name in dims)
    is_text = variable.dtype == "str"
    itemsize = 16 if is_text else variable.itemsize
    is_large = itemsize * math.prod(shape) > MAX_CONTIGUOUS
    storage = dict[str, Any]()
    if is_large:
        storage["chunksizes"] = chunk or tile_shape(shape, CHUNK // itemsize)
        storage |= {} if is_text else COMPRESSED  # HDF5 has no filters for texts
    elif math.prod(shape) and not is_text:
        storage["contiguous"] = True
    dtype = str if is_text else variable.dtype
    fill_value = variable.fill_value
    new = group.createVariable(variable.name, dtype, dims, fill_value=fill_value, **storage)
    if is_large:
        # the library's own cache would keep the greater part of the file in memory
        new.set_var_chunk_cache(size=2 * CHUNK)
    new.setncatts(attributes(variable, study))
    return new


def put(
    group: netCDF4.Dataset, variable: FileVariable, study: Study, values: Any
) -> netCDF4.Variable:
    """Make a variable and its dimensions, or write its values if it is there; return it.

    All variables of a file are made before values are written, because the library looks through
    the whole file at the first value that is written after a definition.
    """
    array = np.asarray(values, dtype=object if variable.dtype == "str" else variable.dtype)
    for name, size in zip(expand(variable.dims, study), array.shape, strict=True):
        if name not in dimensions(group):
            group.createDimension(name, size)
    is_made = variable.name in group.variables
    new = define(group, variable, study)
    if is_made:
        new[...] = array
    return new


def put_all(
    group: netCDF4.Dataset,
    variables: Iterable[FileVariable],
    values: Mapping[str, Any],
    study: Study,
) -> None:
    """Make, then write, the variables that have values by name.

    The value `edge_names` gives the meanings of the flags of `schema.EDGE_FLAGS`.
    """
    for variable in variables:
        if variable.name in values:
            new = put(group, variable, study, values[variable.name])
            if variable.name in schema.EDGE_FLAGS and values["edge_names"]:
                new.setncatts(dict(schema.flags(*values["edge_names"])))


def dimensions(group: netCDF4.Dataset) -> dict[str, int]:
    """Return the sizes of the dimensions of a group, with those of the groups above it."""
    above = {} if group.parent is None else dimensions(group.parent)
    return above | {name: int(dim.size) for name, dim in group.dimensions.items()}


def put_axes(nc: netCDF4.Dataset, study: Study) -> None:
    """Make, then write, the coordinates of the sweep."""
    if not study.axes:
        return
    for axis, name in zip(study.axes, axis_names(study.axes), strict=True):
        labels = axis_labels(axis)
        dims = sweep_dims(study, axis)
        dtype: Dtype = "str" if labels.dtype == object else "f8"
        extra = axis_attributes(axis)
        variable = FileVariable(name, dtype, axis.units, "", dims, extra=extra, coordinate=True)
        put(nc, variable, study, labels)


def attributes(variable: FileVariable, study: Study) -> dict[str, Any]:
    """Return the attributes of a variable in the file of this study, without _FillValue."""
    extra = dict(variable.extra)
    if variable.comment:
        extra["comment"] = variable.comment
    long_name, units = variable.long_name, variable.units
    if units in (T, RATE):
        assert study.path is not None
        if units == T:
            long_name += f" ({study.path.name})"
            extra |= DIFFERENCE if study.path.units == "K" else {}
            units = study.path.units
        else:
            units = "J m-1" if study.path.units == "1" else f"J m-1/({study.path.units})"
    if study.units == "none" and units != "s":
        extra.pop("units_metadata", None)
        units = "1"
    has_points = SWEEP in variable.dims or (OUTER in variable.dims and "coordinates" in extra)
    if study.mode == "list" and has_points:
        names = (extra.get("coordinates", ""), *axis_names(study.axes))
        extra["coordinates"] = " ".join(names).strip()
    if variable.dtype == "str":
        return {"long_name": long_name, **extra}
    return {"long_name": long_name, "units": units, **extra}


def sweep_points(study: Study) -> LabelledTable:
    """Return a table with the study's axes and an empty `status`, to find a point by its labels."""
    status = LabelledArray(np.zeros(study.shape, dtype=np.int8), sweep_dims(study), {})
    variables = {"status": status}
    names = axis_names(study.axes)
    for axis, name in zip(study.axes, names, strict=True):
        dims = sweep_dims(study, axis)
        variables[name] = LabelledArray(axis_labels(axis), dims, axis_attributes(axis))
    attrs = {"sweep_mode": study.mode}
    return LabelledTable(variables, attrs, status.sizes, frozenset(names))
