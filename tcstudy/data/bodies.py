"""The bodies of a result file, one by one: the body of all points, or one geometry of a sweep.

A file of several geometries has one group for each level (layout 2): contact lines padded to the
longest, meshes end to end. A file of version 0.8 has a group for every geometry, which is like a
file of one body. A `StoredBody` reads from both the places of a variable that belong to the body.
Node numbers, flags and lengths are those of a run of the geometry alone.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from tcstudy.data.schema import (
    FIELDS,
    GEOMETRIES,
    LAYOUT,
    MESH_COUNTS,
    MESH_GEOMETRY,
    MISSING_COUNT,
    NONE,
    NUMBER,
    ONCE,
    OVERRIDES,
    OWN_POINT,
    POINT,
)
from tcstudy.data.variables import Places

if TYPE_CHECKING:
    import netCDF4
    import xarray

Values = NDArray[Any]
Cut = tuple[slice | int, ...]
"""A range of points, or the index of one, along every dimension of the sweep of a body."""

_GEOMETRY_NAMES = frozenset(v.name for v in (*MESH_COUNTS, MESH_GEOMETRY))
"""Variables of a level that tell geometries apart, which a body alone does not need."""
_FIELD_NAMES = frozenset(v.name for v in FIELDS)
_OPTIONAL_DIMS = ("held_end", "joint", "rim_segment", "mesh_node", "mesh_face")
"""Dimensions that not every geometry has."""


@dataclass(frozen=True, eq=False)
class StoredBody:
    """One body of an opened file without masks.

    nc:     group of the variables by point and level: that of the file, or of the geometry in a
            file of version 0.8
    places: (P,) of the points of the body in the sweep of the file, in C order
    dims:   dimensions of the sweep of the body, which have the extents `shape`
    outer:  index of the body along every dimension of the file that changes the geometry
    number: of the geometry in a file of layout 2, else None
    cache:  variables read whole, by path; None if variables are to be read in part
    """

    nc: netCDF4.Dataset
    places: Places
    dims: tuple[str, ...]
    shape: tuple[int, ...]
    outer: Mapping[str, int] = field(default_factory=dict)
    number: int | None = None
    cache: dict[str, Values] | None = None

    @classmethod
    def of(cls, nc: netCDF4.Dataset, number: int = 0) -> StoredBody:
        """Return the body of a file, or a geometry of a file by its number."""
        if GEOMETRIES not in nc.ncattrs():
            dims, shape = _sweep_of(nc)
            return cls(nc, np.arange(int(np.prod(shape))), dims, shape)
        geometry = nc[NUMBER.name]
        return cls._among(nc, geometry.dimensions, geometry[...], number, None)

    @classmethod
    def at(cls, nc: netCDF4.Dataset, place: int) -> tuple[StoredBody, int]:
        """Return the body of a point of a file, and the number of the point among its points."""
        if GEOMETRIES not in nc.ncattrs():
            return cls.of(nc), place
        body = cls.of(nc, int(nc[NUMBER.name][...].ravel()[place]))
        return body, int(np.searchsorted(body.places, place))

    @classmethod
    def every(cls, nc: netCDF4.Dataset) -> Iterator[StoredBody | None]:
        """Yield all geometries of a file in order, None for one without a mesh.

        Variables that several of them share are read once.
        """
        geometry = nc[NUMBER.name]
        numbers = geometry[...]
        cache = dict[str, Values]()
        for number in range(int(nc.getncattr(GEOMETRIES))):
            if (numbers == number).any():
                yield cls._among(nc, geometry.dimensions, numbers, number, cache)
            else:
                yield None

    @classmethod
    def _among(
        cls,
        nc: netCDF4.Dataset,
        sweep: tuple[str, ...],
        numbers: Values,
        number: int,
        cache: dict[str, Values] | None,
    ) -> StoredBody:
        places = np.flatnonzero(numbers == number)
        if LAYOUT not in nc.ncattrs():
            group = nc[f"geometry_{number}"]
            return cls(group, places, *_sweep_of(group))
        if sweep == (POINT,):
            return cls(nc, places, (OWN_POINT,), places.shape, {}, number, cache)
        index = np.unravel_index(places[0], numbers.shape)
        outer = dict[str, int]()
        inner = dict[str, int]()
        for d, dim in enumerate(sweep):
            if (numbers != numbers.take([0], axis=d)).any():
                outer[dim] = int(index[d])
            else:
                inner[dim] = numbers.shape[d]
        return cls(nc, places, tuple(inner), tuple(inner.values()), outer, number, cache)

    @property
    def levels(self) -> list[int]:
        """Numbers of the levels that the body has, coarse to fine."""
        suffixes = (name.removeprefix("level_") for name in self.nc.groups)
        numbers = sorted(int(suffix) for suffix in suffixes if suffix.isdigit())
        if self.number is None:
            return numbers
        return [level for level in numbers if self.once("n_contact", level) != MISSING_COUNT]

    def group(self, level: int) -> netCDF4.Group:
        """Return the group of a level."""
        return self.nc[f"level_{level}"]

    def cut(self, point: int) -> Cut:
        """Return the index of a point of the body, by its number, along its dimensions."""
        if not self.shape:
            return ()
        return tuple(int(i) for i in np.unravel_index(point, self.shape))

    def once(self, name: str, level: int) -> Any:
        """Return the value of a variable of the root that a level of the body has once."""
        variable = self.nc[name]
        index = {**self.outer, POINT: int(self.places[0]), "level": level}
        if self.number is None:
            index = {"level": level}
        value = self._values(variable)[tuple(index.get(dim, 0) for dim in variable.dimensions)]
        return value.item() if hasattr(value, "item") else value

    def read(self, variable: netCDF4.Variable, level: int, cut: Cut = ()) -> Values:
        """Return the values of a variable at points of the body, by default at all.

        Variables of the root are read at the level. Dimensions of the sweep are those of the body.
        They are dropped where the cut has an index, and absent from variables that do not depend on
        the point.
        """
        index = self._index(variable, level, cut)
        values = self._values(variable)[tuple(index[dim] for dim in variable.dimensions)]
        if variable.name == "triangle" and self.number is not None:
            first = self._extents(level)["mesh_node"].start
            return (values - first).astype(np.int32)
        return np.asarray(values)

    def rows(self, variable: netCDF4.Variable, level: int, cut: Cut) -> Values:
        """Return (R, …) values at the points of a cut of slices, in C order."""
        values = self.read(variable, level, cut)
        sweep_ndim = sum(dim in (*self.dims, POINT) for dim in variable.dimensions)
        return values.reshape(math.prod(values.shape[:sweep_ndim]), *values.shape[sweep_ndim:])

    def sizes(self, level: int) -> list[int]:
        """Return the numbers of nodes of the contact line and, if it is stored, of the mesh."""
        names = ("node", "mesh_node")
        if self.number is not None:
            extents = self._extents(level)
            slices = [extents[dim] for dim in names if dim in extents]
            return [extent.stop - extent.start for extent in slices]
        dims = self.group(level).dimensions
        return [int(dims[dim].size) for dim in names if dim in dims]

    def attributes(self, variable: netCDF4.Variable) -> dict[str, Any]:
        """Return the attributes of a variable, without the flag of padded nodes."""
        attributes = {name: variable.getncattr(name) for name in variable.ncattrs()}
        attributes.pop("_FillValue", None)
        meanings = str(attributes.get("flag_meanings", "")).split()
        if self.number is not None and meanings[:1] == [NONE]:
            attributes["flag_meanings"] = " ".join(meanings[1:])
            attributes["flag_values"] = attributes["flag_values"][1:]
        return attributes

    @property
    def overrides(self) -> str:
        """Options that make the study of the body of the study of the file, one per line."""
        if self.number is not None:
            return str(self._values(self.nc[OVERRIDES.name])[self.number])
        return str(self.nc.getncattr("overrides"))

    @property
    def about(self) -> dict[str, Any]:
        """The global attributes of a file of this body alone."""
        names = [name for name in self.nc.ncattrs() if name not in (GEOMETRIES, LAYOUT)]
        attributes = {name: self.nc.getncattr(name) for name in names}
        return attributes | {"overrides": self.overrides}

    def dataset(self, level: int, cut: Cut = ()) -> xarray.Dataset:
        """Return the variables of a level at points of a cut, by default at all points.

        They are those of a run of the body alone: nodes count from 0, nothing is padded. All
        solutions of a point (`solver.branch: all`) are left out if there is a cut.
        """
        import xarray

        variables = dict[str, Any]()
        for name, variable in self.group(level).variables.items():
            is_shared = self.number is not None and name in _GEOMETRY_NAMES
            if is_shared or (cut and "solution" in variable.dimensions):
                continue
            index = self._index(variable, level, cut)
            dims = [dim for dim in variable.dimensions if not isinstance(index[dim], int)]
            values = self.read(variable, level, cut)
            if self.listed:
                dims = [OWN_POINT if dim == POINT else dim for dim in dims]
                if name in _FIELD_NAMES and not cut and OWN_POINT not in dims:
                    dims = [OWN_POINT, *dims]
                    values = values[None]
            if "solution" in dims and self.number is not None:
                values = self._own_solutions(level, name, values)
            sizes = dict(zip(dims, values.shape, strict=True))
            if all(sizes.get(dim, 1) for dim in _OPTIONAL_DIMS):
                variables[name] = xarray.Variable(dims, values, self.attributes(variable))
        return xarray.Dataset(variables)

    def level_table(self, names: Sequence[str]) -> xarray.Dataset:
        """Return the status of the points by level, and the values of levels of these names."""
        import xarray

        levels = range(self.nc.dimensions["level"].size)
        status = [self.read(self.nc["status"], level) for level in levels]
        table = {"status": ((*self.dims, "level"), np.stack(status, axis=-1))}
        for name in names:
            values = [self.once(name, level) for level in levels]
            table[name] = (("level",), np.array(values))
        return xarray.Dataset(table)

    def coordinates(self) -> dict[str, Any]:
        """Return the labels of the points of the body, by name of the swept parameter.

        A parameter that changes the geometry has a single label.
        """
        import xarray

        root = self.nc if self.nc.parent is None else self.nc.parent
        status = root["status"]
        sweep = status.dimensions[:-1]
        coordinates = dict[str, Any]()
        if sweep == (POINT,):
            for name in str(status.getncattr("coordinates")).split():
                labels = root[name][...][self.places]
                attributes = self.attributes(root[name])
                coordinates[name] = xarray.Variable(self.dims, labels, attributes)
            return coordinates
        first = np.unravel_index(self.places[0], status.shape[:-1])
        for dim, place in zip(sweep, first, strict=True):
            is_swept = dim in self.dims
            labels = root[dim][...] if is_swept else root[dim][int(place)]
            dims = (dim,) if is_swept else ()
            coordinates[dim] = xarray.Variable(dims, labels, self.attributes(root[dim]))
        return coordinates

    @property
    def listed(self) -> bool:
        """Whether the points of the body stand scattered in a list of a file of layout 2."""
        return self.number is not None and self.dims == (OWN_POINT,)

    def _own_solutions(self, level: int, name: str, values: Values) -> Values:
        """Return the part of a variable of all solutions that belongs to points of the body."""
        solution_places = self._values(self.group(level)["solution_point"])[...]
        belongs = np.isin(solution_places, self.places)
        if name == "solution_point":
            return np.searchsorted(self.places, solution_places[belongs])
        return values[belongs]

    def _values(self, variable: netCDF4.Variable) -> Any:
        if self.cache is None:
            return variable
        path = f"{variable.group().path}/{variable.name}"
        if path not in self.cache:
            self.cache[path] = variable[...]
        return self.cache[path]

    def _index(self, variable: netCDF4.Variable, level: int, cut: Cut) -> dict[str, Any]:
        """Return the index of the body, at points of a cut, by dimension of a variable."""
        index: dict[str, Any] = dict.fromkeys(variable.dimensions, slice(None))
        sweep_index: dict[str, Any] = dict(zip(self.dims, cut, strict=False))
        if self.number is None:
            return index | sweep_index | {"level": level}
        if self.listed:
            points = sweep_index.get(OWN_POINT, slice(None))
            sweep_index[POINT] = _compact(self.places[points])
            if not isinstance(points, int):
                points = _within(points, self.shape[0])
            sweep_index[OWN_POINT] = points
        if variable.name in ONCE:
            sweep_index = dict.fromkeys(self.dims, 0) | {POINT: int(self.places[0])}
        return {**index, **self.outer, **sweep_index, **self._extents(level), "level": level}

    def _extents(self, level: int) -> dict[str, slice]:
        """Return the slices of the body along the dimensions of a level."""
        if level not in self._extents_by_level:
            self._extents_by_level[level] = self._find_extents(level)
        return self._extents_by_level[level]

    def _find_extents(self, level: int) -> dict[str, slice]:
        m = int(self.once("n_contact", level))
        group = self.group(level)
        padded = {"held_end": "held_arclength", "joint": "joint_node", "rim_segment": "rim_edge"}
        padded["opening_node"] = "opening_arclength"
        extents = dict[str, slice]()
        for dim, name in padded.items():
            if name in group.variables:
                variable = group[name]
                index = {**self.outer, POINT: int(self.places[0]), dim: slice(None)}
                row = self._values(variable)[tuple(index.get(d, 0) for d in variable.dimensions)]
                is_padding = np.isnan(row) if row.dtype.kind == "f" else row == MISSING_COUNT
                extents[dim] = slice(0, int(np.count_nonzero(~is_padding)))
        m -= extents.get("opening_node", slice(0, 0)).stop
        extents["node"] = extents["node_column"] = slice(0, m)
        for variable in MESH_COUNTS:
            if variable.name in group.variables:
                counts = self._values(group[variable.name])
                start = int(np.sum(counts[: self.number], dtype=np.int64))
                stop = start + int(counts[self.number])
                extents[variable.name.removesuffix("_count")] = slice(start, stop)
        return extents

    @cached_property
    def _extents_by_level(self) -> dict[int, dict[str, slice]]:
        return {}


def _sweep_of(nc: netCDF4.Dataset) -> tuple[tuple[str, ...], tuple[int, ...]]:
    """Return the dimensions and the extent of the sweep of a file, or of a group like one."""
    status = nc["status"]
    return status.dimensions[:-1], status.shape[:-1]


def _within(points: slice, count: int) -> slice:
    """Return a slice whose ends lie within so many points."""
    start, stop, _ = points.indices(count)
    return slice(start, stop)


def _compact(places: Any) -> Any:
    """Return places as an index or a slice if they can be, because that is read faster."""
    if np.ndim(places) == 0:
        return int(places)
    if len(places) and places[-1] - places[0] == len(places) - 1:
        return slice(int(places[0]), int(places[-1]) + 1)
    return places
