"""The result file of a run: one netCDF-4 file, complete or not there at all (see `tcstudy.data.files`).

`tcstudy.data.schema` says what stands in it.

The points of a sweep as their files have them, before there is any file.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from tcstudy.data import schema
from tcstudy.data.files import FINISHED, StoreError, new_dataset, replace_file
from tcstudy.data.live import put_live
from tcstudy.data.provenance import Provenance, global_attributes, without_paths
from tcstudy.data.reading import attributes
from tcstudy.data.records import BlockRecord, LevelRecord, PointRecord, PointStatus, block_of
from tcstudy.scene.study import Study

if TYPE_CHECKING:
    import netCDF4
    import xarray
if TYPE_CHECKING:
    import xarray

Arrays = dict[str, np.ndarray[Any, Any]]
Places = np.ndarray[Any, np.dtype[np.intp]]

KEPT = "finished points are kept in the journal"


def write(
    path: Path,
    study: Study,
    levels: Sequence[LevelRecord],
    records: Iterable[BlockRecord | PointRecord],
    provenance: Provenance,
) -> None:
    """Write all results of a run to `path`, replacing an old file in one step.

    Points without a record stay "not run"; of two records of one point the last one counts. Whole-body fields go
    to the disk record by record, so `records` may be a generator.

    Raises StoreError if the file cannot be written (the old one is then untouched), ValueError if a record does
    not fit the study.
    """
    problems = schema.axis_problems(study)
    if problems:
        raise StoreError("; ".join(problems))
    replace_file(path, lambda aside: _write_file(aside, study, levels, records, provenance), KEPT)


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
    records: Iterable[BlockRecord | PointRecord],
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
        known = {level.level: level for level in levels}
        for level in levels:
            check_level(level, study)
            _take_level(root, variables, level)
            groups[level.level] = _make_group(nc, study, level)
            contact[level.level] = _contact_arrays(study, level)
        for record in records:
            block = record if isinstance(record, BlockRecord) else block_of((record,), study.shape)
            check_block(block, study, known.get(block.level))
            places = _places(study, block)
            _take_block(root, contact.get(block.level, {}), block, places, math.prod(study.shape))
            _put_fields(groups.get(block.level), study, block, places)
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
        arrays[name][...] = values
    return arrays


def _take_level(root: Arrays, variables: Sequence[schema.Variable], level: LevelRecord) -> None:
    for variable in variables:
        if variable.dims == ("level",):
            root[variable.name][level.level] = getattr(level, variable.name)


def _places(study: Study, block: BlockRecord) -> Places:
    """(P,) where the points of a block stand in the file, counted in C order of its dimensions."""
    if study.mode != "grid" or not study.shape:
        return block.points
    index = np.unravel_index(block.points, study.shape)
    moved = tuple(schema.axis_places(axis)[i] for axis, i in zip(study.axes, index, strict=True))
    return np.ravel_multi_index(moved, study.shape)


def _take_block(root: Arrays, contact: Arrays, block: BlockRecord, places: Places, count: int) -> None:
    """Put the points of a block in their places; count: points of the sweep."""

    def at_level(name: str) -> np.ndarray[Any, Any]:
        array = root[name]
        levels = root["status"].size // count
        return array.reshape(count, levels, -1)[:, block.level]  # a view: the arrays are contiguous

    words = np.full(len(block), "", dtype=object)
    for row, reason in block.reasons.items():
        words[row] = without_paths(reason)
    at_level("status")[places, 0] = block.status
    at_level("reason")[places, 0] = words
    for name, values in block.numbers.items():
        array, values = at_level(name), values.reshape(len(block), -1)
        if array.dtype.kind != "f":
            # NaN stands for missing: of several values of a point each for itself, a single one leaves what is there
            none = schema.MISSING_COUNT if values.shape[1] > 1 else array[places]
            missing = np.isnan(values)
            values = np.where(missing, none, np.where(missing, 0.0, values))
        array[places] = values
    known = np.zeros(0, dtype=bool) if block.u_T is None else ~np.isnan(block.u_T).any(axis=1)
    for name, line in (("u_T", block.u_T), ("xi", block.xi), ("sticks", block.sticks)) if known.any() else ():
        if line is not None and name in contact:
            contact[name].reshape(count, -1)[places[known]] = line[known]


def _put_fields(group: netCDF4.Group | None, study: Study, block: BlockRecord, places: Places) -> None:
    """Write whole-body fields point by point; a field's variable is made when its first values come."""
    if group is None:  # as `check_block` has seen, a level without a record has no fields
        return
    known = {variable.name: variable for variable in schema.FIELDS}
    for name, rows in block.fields.items():
        if name not in group.variables:
            _put(group, known[name], study, None)
        for row, values in enumerate(rows):
            if not np.isnan(values).all():
                place = np.unravel_index(places[row], study.shape) if study.shape else ()
                group[name][tuple(int(i) for i in place)] = values


def check_block(block: BlockRecord, study: Study, level: LevelRecord | None) -> None:
    """Raise ValueError unless the points have places in the file of this study, and each its values.

    level: the record of the block's level; without one its points have no values on the contact line or the body
    """
    name = f"block {block.number} on level {block.level}"
    inside = len(block) and int(block.points.min()) >= 0 and int(block.points.max()) < math.prod(study.shape)
    if not inside or not 0 <= block.level < study.mesh.levels:
        raise ValueError(f"{name} is outside the sweep {study.shape} × {study.mesh.levels}")
    line = {"u_T": block.u_T, "xi": block.xi, "sticks": block.sticks}
    rows = (block.points, block.status, *line.values(), *block.numbers.values(), *block.fields.values())
    if any(len(values) != len(block) or values.dtype.kind not in "iuf" for values in rows if values is not None):
        raise ValueError(f"{name} has not one row of numbers for each of its points")
    if not {*block.status.tolist()} <= {*PointStatus}:
        raise ValueError(f"{name} has a status that does not exist")
    unknown = sorted(block.numbers.keys() - schema.NUMBERS) + sorted(block.fields.keys() - schema.FIELD_NAMES)
    if unknown:
        raise ValueError(f"no variable {', '.join(unknown)} in the schema")
    mesh = level.fields.get("node_x") if level is not None else None
    _check_width(name, line, None if level is None else level.n_contact)
    _check_width(name, block.fields, None if mesh is None else len(mesh))


def _check_width(name: str, arrays: Mapping[str, np.ndarray[Any, Any] | None], width: int | None) -> None:
    """Raise ValueError unless every row has a value for each node; width: nodes of the level, None if not recorded."""
    for key, values in arrays.items():
        if values is not None and width is None:
            raise ValueError(f"{name} has {key}, but no record says on which nodes")
        if values is not None and values.shape[1:] != (width,):
            raise ValueError(f"{name} has {key} of shape {values.shape}, but the level has {width} nodes")


def check_level(level: LevelRecord, study: Study) -> None:
    """Raise ValueError unless a level belongs to the study and every array has a value for each of its nodes."""
    line = (level.arclength, level.x, level.y, level.c, level.edge)
    if {values.shape for values in line} != {(level.n_contact,)} or not 0 <= level.level < study.mesh.levels:
        raise ValueError(f"level {level.level} does not fit the study")
    numbers: list[np.ndarray[Any, Any]] = [*line, *level.fields.values()]
    mesh = [level.fields[name].shape for name in ("node_x", "node_y") if name in level.fields]
    corners = level.fields.get("triangle", np.empty((0, 3))).shape
    if any(v.dtype.kind not in "iuf" for v in numbers) or len({*mesh}) > 1 or corners[1:] != (3,):
        raise ValueError(f"the mesh of level {level.level} has not one number for each node")


def sweep_points(study: Study) -> xarray.Dataset:
    """A dataset with the study's axes and an empty `status`, to find a point by its labels."""
    import xarray

    data = xarray.Dataset(attrs={"sweep_mode": study.mode})
    for axis in study.axes:
        name = schema.axis_name(axis)
        dim = name if study.mode == "grid" else schema.POINT
        data = data.assign_coords({name: (dim, schema.axis_labels(axis), schema.axis_attributes(axis))})
    data["status"] = (schema.sweep_dims(study), np.zeros(study.shape, dtype=np.int8))
    return data


def ascending(data: xarray.Dataset, study: Study) -> xarray.Dataset:
    """The same data with axes of numbers that go up and down sorted: CF wants monotonic coordinates."""
    if study.mode == "grid":
        for axis in study.axes:
            places = schema.axis_places(axis)
            if np.any(places != np.arange(len(places))):
                data = data.isel({schema.axis_name(axis): np.argsort(places)})
    return data
