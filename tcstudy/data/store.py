"""The result file of a run: one netCDF-4 file, complete or not there at all (see `tcstudy.data.files`).

`tcstudy.data.schema` says what stands in it.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from tcstudy.data import schema
from tcstudy.data.files import FINISHED, StoreError, new_dataset, replace_file
from tcstudy.data.live import put_live
from tcstudy.data.provenance import Provenance, global_attributes, without_paths
from tcstudy.data.reading import attributes
from tcstudy.data.records import LevelRecord, PointRecord
from tcstudy.scene.records import Study

if TYPE_CHECKING:
    import netCDF4
    import xarray

Arrays = dict[str, np.ndarray[Any, Any]]

KEPT = "finished points are kept in the journal"


def write(
    path: Path,
    study: Study,
    levels: Sequence[LevelRecord],
    points: Iterable[PointRecord],
    provenance: Provenance,
) -> None:
    """Write all results of a run to `path`, replacing an old file in one step.

    Points without a record stay "not run"; of two records of one point the last one counts. Whole-body fields go
    to the disk record by record, so `points` may be a generator.

    Raises StoreError if the file cannot be written (the old one is then untouched), ValueError if a record does
    not fit the study.
    """
    problems = schema.axis_problems(study)
    if problems:
        raise StoreError("; ".join(problems))
    replace_file(path, lambda aside: _write_file(aside, study, levels, points, provenance), KEPT)


def open_results(path: Path) -> xarray.DataTree:
    """Open a result file lazily; close it after use or open it in a `with`.

    Raises StoreError if there is no file, if it is not a result file or if its run has not finished.
    """
    attributes(path)
    import xarray  # here, because a run needs no xarray and its import takes longer than writing the file

    return xarray.open_datatree(path, engine="netcdf4")


def _write_file(
    file: Path,
    study: Study,
    levels: Sequence[LevelRecord],
    points: Iterable[PointRecord],
    provenance: Provenance,
) -> None:
    """One complete file; sweep arrays are allocated whole, so that every point has its place at once."""
    with new_dataset(file) as nc:
        nc.setncatts(global_attributes(study, provenance))
        _put_axes(nc, study)
        variables = schema.root_variables(study)
        sizes = {"level": study.mesh.levels, "start": len(schema.START_NAMES), "solver": len(study.solver.names)}
        root = _allocate(variables, study, sizes)
        groups: dict[int, netCDF4.Group] = {}
        contact: dict[int, Arrays] = {}
        for level in levels:
            _take_level(root, variables, level)
            groups[level.level] = _make_group(nc, study, level)
            contact[level.level] = _contact_arrays(study, level)
        places = [schema.axis_places(axis) for axis in study.axes] if study.mode == "grid" else []
        for point in points:
            check_point(point, study)
            if places:
                point = replace(point, index=tuple(int(p[i]) for p, i in zip(places, point.index, strict=True)))
            _take_point(root, contact.get(point.level, {}), point)
            _put_fields(groups.get(point.level), study, point)
        for variable in variables:
            _put(nc, variable, study, root[variable.name])
        for level in levels:
            group = groups[level.level]
            for variable in schema.CONTACT:
                _put(group, variable, study, contact[level.level][variable.name])
            group["edge"].setncatts(schema.edge_attributes(level.edge_names))
        nc.setncattr(FINISHED, np.int32(1))


def _allocate(variables: Sequence[schema.Variable], study: Study, sizes: dict[str, int]) -> Arrays:
    """Arrays full of missing values."""
    arrays: Arrays = {}
    for v in variables:
        shape = tuple(n for d in v.dims for n in (study.shape if d == schema.SWEEP else (sizes[d],)))
        arrays[v.name] = np.full(shape, v.missing, dtype=object if v.dtype == "str" else v.dtype)
    return arrays


def _put(where: netCDF4.Dataset, variable: schema.Variable, study: Study, values: np.ndarray[Any, Any] | None) -> None:
    """Define a variable and write its values; without any, those of each point in its place come later."""
    dims = schema.expand(variable.dims, study)
    kind: Any = str if variable.dtype == "str" else variable.dtype
    checked = bool(dims) and variable.dtype != "str"  # HDF5 has no checksums of scalars and texts
    # without values yet: whole-body fields, which are written point by point
    chunks = (1,) * len(study.shape) + (where.dimensions["mesh_node"].size,) if values is None else None
    new = where.createVariable(
        variable.name, kind, dims, fill_value=variable.fill_value, fletcher32=checked, chunksizes=chunks
    )
    new.setncatts(schema.attributes(variable, study))
    if values is not None:
        new[...] = values


def _put_axes(nc: netCDF4.Dataset, study: Study) -> None:
    """Dimensions and coordinates of the sweep, and the level."""
    for name, size in zip(schema.sweep_dims(study), study.shape, strict=True):
        nc.createDimension(name, size)
    nc.createDimension("level", study.mesh.levels)
    for axis in study.axes:
        labels = schema.axis_labels(axis)
        name = schema.axis_name(axis)
        dim = name if study.mode == "grid" else schema.POINT
        texts = labels.dtype == object
        new = nc.createVariable(name, str if texts else "f8", (dim,), fill_value=False, fletcher32=not texts)
        new.setncatts(schema.axis_attributes(axis))
        new[...] = labels[np.argsort(schema.axis_places(axis))] if study.mode == "grid" else labels
    _put(nc, schema.LEVEL_COORDINATE, study, np.arange(study.mesh.levels, dtype=np.int32))
    _put_names(nc, "start", schema.START_NAMES, "where the solver started")
    if len(study.solver.names) > 1:
        _put_names(nc, "solver", study.solver.names, "solver")


def _put_names(nc: netCDF4.Dataset, dim: str, names: Sequence[str], long_name: str) -> None:
    """A dimension with texts as its coordinate."""
    nc.createDimension(dim, len(names))
    new = nc.createVariable(dim, str, (dim,), fill_value=False)
    new.setncatts({"long_name": long_name, "units": "1"})
    new[...] = np.array(names, dtype=object)


def _make_group(nc: netCDF4.Dataset, study: Study, level: LevelRecord) -> netCDF4.Group:
    """The group of a level, with its whole mesh if the record has one."""
    group = nc.createGroup(f"level_{level.level}")
    group.setncattr("level", np.int32(level.level))
    group.createDimension("node", len(level.arclength))
    if "node_x" in level.fields:
        group.createDimension("mesh_node", len(level.fields["node_x"]))
        group.createDimension("mesh_face", len(level.fields["triangle"]))
        group.createDimension("corner", 3)
        mesh = group.createVariable("mesh", "i4", (), fill_value=False)
        mesh.setncatts(schema.MESH_TOPOLOGY)
        mesh[...] = 0
        for variable in schema.MESH:
            _put(group, variable, study, level.fields[variable.name])
    put_live(group, study, level.fields, _put)
    return group


def _contact_arrays(study: Study, level: LevelRecord) -> Arrays:
    """The contact line of a level, and room for what every point has on it."""
    arrays = _allocate(schema.CONTACT, study, {"node": len(level.arclength)})
    for name in ("arclength", "x", "y", "c", "edge"):
        values = getattr(level, name)
        if values.shape != arrays[name].shape:
            raise ValueError(f"level {level.level}: {name} has shape {values.shape}, not {arrays[name].shape}")
        arrays[name][...] = values
    return arrays


def _take_level(root: Arrays, variables: Sequence[schema.Variable], level: LevelRecord) -> None:
    for variable in variables:
        if variable.dims == ("level",):
            root[variable.name][level.level] = getattr(level, variable.name)


def _take_point(root: Arrays, contact: Arrays, point: PointRecord) -> None:
    """Put a record in its place."""
    place = (*point.index, point.level)
    root["status"][place] = int(point.status)
    root["reason"][place] = without_paths(point.reason)
    for name, number in point.numbers.items():
        if isinstance(number, tuple | list):
            root[name][place] = [_or_missing(root[name], value) for value in number]
        elif number == number:  # NaN stands for missing, also in counts, which have no NaN
            root[name][place] = number
    for name, values in (("u_T", point.u_T), ("xi", point.xi), ("sticks", point.sticks)):
        if len(values):
            if not contact:
                raise ValueError(f"point {point.index} has values on level {point.level}, which has no record")
            contact[name][point.index] = values


def _or_missing(array: np.ndarray[Any, Any], value: float) -> float:
    """A value for an array: NaN stands for missing, also in counts, which have no NaN."""
    return value if value == value or array.dtype.kind == "f" else schema.MISSING_COUNT


def _put_fields(group: netCDF4.Group | None, study: Study, point: PointRecord) -> None:
    """Write a point's whole-body fields; a field's variable is made when its first values come."""
    if not point.fields:
        return
    if group is None or "mesh_node" not in group.dimensions:
        raise ValueError(f"point {point.index} has whole-body fields, but level {point.level} has no mesh")
    known = {variable.name: variable for variable in schema.FIELDS}
    for name, values in point.fields.items():
        if name not in group.variables:
            _put(group, known[name], study, None)
        group[name][point.index] = values


def check_point(point: PointRecord, study: Study) -> None:
    """Raise ValueError unless the record has a place in the file of this study."""
    inside = len(point.index) == len(study.shape) and all(
        0 <= i < n for i, n in zip(point.index, study.shape, strict=True)
    )
    if not inside or not 0 <= point.level < study.mesh.levels:
        raise ValueError(
            f"point {point.index}, level {point.level} is outside the sweep {study.shape} × {study.mesh.levels}"
        )
    unknown = sorted(point.numbers.keys() - schema.NUMBERS) + sorted(point.fields.keys() - schema.FIELD_NAMES)
    if unknown:
        raise ValueError(f"no variable {', '.join(unknown)} in the schema")
