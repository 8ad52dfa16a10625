"""How variables get into a netCDF-4 file: names of dimensions, attributes, chunks.

A small variable lies in one piece, because chunks of their own would cost it more than its values;
the seal of the file is its checksum. A large one lies in compressed chunks with a checksum each. A
chunk over the sweep is a tile: tiles follow one another in C order and each is a run of points, so
that a sweep can be written, and read, from front to back.
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
    """Names of the dimensions of these axes, or of the whole sweep in the order of
    `study.shape`."""
    if not study.axes:
        return ()
    if study.mode == "list":
        return (POINT,)
    paths = [axis.path for axis in study.axes]
    names = dict(zip(paths, axis_names(study.axes), strict=True))
    return tuple(names[axis.path] for axis in axes or study.axes)


def outer_dims(study: Study) -> tuple[str, ...]:
    """Return the dimensions of the sweep along which the geometry changes, in the order of the
    sweep."""
    return sweep_dims(study, *(study.axes[i] for i in study.geometric)) if study.geometric else ()


def inner_dims(study: Study) -> tuple[str, ...]:
    """Return the dimensions of the points of one geometry: the other ones of the sweep, in list
    mode OWN_POINT if some geometry has several points."""
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
    dims, sizes, text = expand(variable.dims, study), dimensions(where), variable.dtype == "str"
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
    for name, size in zip(expand(variable.dims, study), array.shape, strict=True):
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
    """Return the sizes of the dimensions of a group, with those of the groups above it."""
    above = {} if where.parent is None else dimensions(where.parent)
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
    placed = SWEEP in variable.dims or (OUTER in variable.dims and "coordinates" in extra)
    if study.mode == "list" and placed:
        names = (extra.get("coordinates", ""), *axis_names(study.axes))
        extra["coordinates"] = " ".join(names).strip()
    named = (
        {"long_name": long_name}
        if variable.dtype == "str"
        else {"long_name": long_name, "units": units}
    )
    return named | extra


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
