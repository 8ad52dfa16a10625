"""How variables get into a netCDF-4 file: the one writer of runs, paths, convergence and cost.

A small variable lies in one piece, because chunks of their own would cost it more than its values; the seal of the file
is its checksum. A large one lies in compressed chunks with a checksum each. A chunk over the sweep is a tile: tiles
follow one another in C order and each is a run of points, so that a sweep can be written, and read, from front to back.

The sweep of a study in its files: names, labels and order of the dimensions.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from tcstudy.data.schema import (
    DIFFERENCE,
    POINT,
    RATE,
    RESERVED,
    SWEEP,
    Dtype,
    FileVariable,
    T,
    edge_flags,
)
from tcstudy.scene.study import Axis, Study, Variant

if TYPE_CHECKING:
    import netCDF4
    import xarray
Places = NDArray[np.intp]


def sweep_dims(study: Study) -> tuple[str, ...]:
    """Names of the sweep dimensions, in the order of `study.shape`."""
    return _dims_of(study, study.axes)


def _dims_of(study: Study, axes: Sequence[Axis]) -> tuple[str, ...]:
    return tuple(dict.fromkeys(axis_name(axis) if study.mode == "grid" else POINT for axis in axes))


def outer_axes(study: Study) -> list[Axis]:
    """The axes that change the geometry: those that its variants fix, in the order of the study."""
    inner = next({axis.path for axis in one.study.axes} for one in study.variants if one.study is not None)
    return [axis for axis in study.axes if axis.path not in inner]


def geometry_dims(study: Study) -> tuple[str, ...]:
    """Dimensions of what every geometry has once; none if there is one geometry."""
    return _dims_of(study, outer_axes(study)) if study.variants else ()


def geometry_place(study: Study, variant: Variant) -> Any:
    """Where a geometry stands along these dimensions."""
    if study.mode != "grid":
        return variant.places
    return tuple(variant.index)


def expand(dims: tuple[str, ...], study: Study) -> tuple[str, ...]:
    """Dimension names with SWEEP replaced by those of the study."""
    return tuple(name for d in dims for name in (sweep_dims(study) if d == SWEEP else (d,)))


def axis_name(axis: Axis) -> str:
    """Name of a swept parameter in the file: its own, or its path where a result has that name ("heat_omega")."""
    return "_".join(axis.path) if axis.name in RESERVED else axis.name


def axis_attributes(axis: Axis) -> dict[str, Any]:
    """Attributes of the coordinate variable of a swept parameter."""
    attrs: dict[str, Any] = {"long_name": ".".join(axis.path)}
    drawn = {"distribution": axis.distribution} if axis.distribution else {}
    if axis_labels(axis).dtype == object:  # texts have no units
        return attrs | drawn
    attrs["units"] = axis.units
    if axis.written[0]:
        attrs |= {"study_unit": axis.written[0], "study_unit_size": axis.written[1]}
    attrs |= drawn
    return attrs | dict(DIFFERENCE) if axis.units == "K" else attrs


def axis_labels(axis: Axis) -> np.ndarray[Any, Any]:
    """Labels of a swept parameter: float64, or objects if one of them is a text."""
    if any(isinstance(label, str) for label in axis.labels):
        return np.array([str(label) for label in axis.labels], dtype=object)
    return np.array(axis.labels, dtype=float)


def axis_problems(study: Study) -> list[str]:
    """One sentence for each swept parameter whose name cannot stand in the file."""
    names = [axis_name(axis) for axis in study.axes]
    problems = [f"two swept parameters are named {n!r}" for n in sorted({n for n in names if names.count(n) > 1})]
    for name in names:
        if name in RESERVED:
            problems.append(f"the swept parameter {name!r} has the name of a result; give it another name")
        elif not re.fullmatch(r"[A-Za-z][A-Za-z0-9_]*", name):
            problems.append(f"the swept parameter {name!r} needs a name of letters, digits and underscores")
    return problems


SMALL = 2**16
"""Bytes up to which a variable lies in one piece."""
CHUNK = 2**20
"""Bytes of a chunk at most."""
COMPRESSED: dict[str, Any] = {"compression": "zlib", "complevel": 1, "shuffle": True, "fletcher32": True}

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
        cut = tuple(slice(i * t, min((i + 1) * t, n)) for i, t, n in zip(index, tile, shape, strict=True))
        stop = start + math.prod(s.stop - s.start for s in cut)
        yield cut, start, stop
        start = stop


def define(where: netCDF4.Dataset, variable: FileVariable, study: Study, chunk: Shape = ()) -> netCDF4.Variable:
    """Make a variable whose dimensions are there. chunk: extent of its chunks if it is large; () for usual ones."""
    dims = expand(variable.dims, study)
    sizes = dimensions(where)
    shape = tuple(sizes[name] for name in dims)
    new = where.createVariable(
        variable.name,
        str if variable.dtype == "str" else variable.dtype,
        dims,
        fill_value=variable.fill_value,
        **storage(variable, shape, chunk),
    )
    if new.chunking() not in (None, "contiguous"):
        new.set_var_chunk_cache(size=2 * CHUNK)  # the library's own would keep the greater part of the file in memory
    new.setncatts(attributes(variable, study))
    return new


def storage(variable: FileVariable, shape: Shape, chunk: Shape = ()) -> dict[str, Any]:
    """How a variable of this shape lies in the file. HDF5 has no filters for scalars and texts."""
    width = 16 if variable.dtype == "str" else np.dtype(variable.dtype).itemsize
    count = math.prod(shape)
    if width * count <= SMALL:
        return {"contiguous": True} if variable.dtype != "str" and count else {}
    sizes: dict[str, Any] = {"chunksizes": chunk or tile_shape(shape, CHUNK // width)}
    return sizes if variable.dtype == "str" else COMPRESSED | sizes


def put(where: netCDF4.Dataset, variable: FileVariable, study: Study, values: Any, **more: Any) -> None:
    """Make a variable and write its values; dimensions come with the first variable that has them.

    more: further attributes
    """
    array = np.asarray(values, dtype=object if variable.dtype == "str" else variable.dtype)
    for name, size in zip(expand(variable.dims, study), array.shape, strict=True):
        if name not in dimensions(where):
            where.createDimension(name, size)
    new = define(where, variable, study)
    new.setncatts(more)
    new[...] = array


def put_all(where: netCDF4.Dataset, variables: Iterable[FileVariable], values: Mapping[str, Any], study: Study) -> None:
    """Make the variables that `values` has by name, and write them; edge_names are the contact edges of `edge`."""
    for variable in variables:
        if variable.name in values:
            edges = variable.name in ("edge", "joint_edge")
            put(where, variable, study, values[variable.name], **(edge_flags(values["edge_names"]) if edges else {}))


def dimensions(where: netCDF4.Dataset) -> dict[str, int]:
    """Sizes of the dimensions of a group, with those that it has from the groups above."""
    above = dimensions(where.parent) if where.parent is not None else {}
    return above | {name: int(dim.size) for name, dim in where.dimensions.items()}


def put_axes(nc: netCDF4.Dataset, study: Study) -> None:
    """Dimensions and coordinates of the sweep."""
    for name, size in zip(sweep_dims(study), study.shape, strict=True):
        nc.createDimension(name, size)
    for axis in study.axes:
        labels = axis_labels(axis)
        kind: Dtype = "str" if labels.dtype == object else "f8"
        dims = _dims_of(study, (axis,))
        new = define(nc, FileVariable(axis_name(axis), kind, axis.units, "", dims, coordinate=True), study)
        new.setncatts(axis_attributes(axis))
        new[...] = labels


def put_names(nc: netCDF4.Dataset, dim: str, names: Iterable[str], long_name: str, study: Study) -> None:
    """A dimension with texts as its coordinate."""
    put(nc, FileVariable(dim, "str", "", long_name, (dim,), coordinate=True), study, list(names))


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
        names = (extra.get("coordinates", ""), *(axis_name(axis) for axis in study.axes))
        extra["coordinates"] = " ".join(names).strip()
    named = {"long_name": long_name} if variable.dtype == "str" else {"long_name": long_name, "units": units}
    return named | extra


def sweep_points(study: Study) -> xarray.Dataset:
    """A dataset with the study's axes and an empty `status`, to find a point by its labels."""
    import xarray

    data = xarray.Dataset(attrs={"sweep_mode": study.mode})
    for axis in study.axes:
        coordinate = (_dims_of(study, (axis,)), axis_labels(axis), axis_attributes(axis))
        data = data.assign_coords({axis_name(axis): coordinate})
    data["status"] = (sweep_dims(study), np.zeros(study.shape, dtype=np.int8))
    return data
