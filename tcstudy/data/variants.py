"""The file of a sweep over geometries: one table of all points, and for each geometry a group with all that it has.

Root:        status, reason and numbers by point, as of any run; what a level has (h_max, n_dof, times) by geometry, too
/geometry_i: the file of a run of that geometry alone: attributes, table, and /level_0, … with profiles and fields,
             whose lengths differ from mesh to mesh. The dimension `point` is `own_point` there: it has another length.
A point of a refused geometry has the status mesh_failed and its reason; such a geometry has no group, and −1 stands in
place of its number in the variable `geometry`, by point.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from tcstudy.data.files import refuse_changed, write_dataset
from tcstudy.data.reading import GEOMETRIES, opened, read_blocks
from tcstudy.data.records import BlockRecord
from tcstudy.data.schema import POINT, SWEEP, FileVariable
from tcstudy.data.store import (
    COMPRESSED,
    KEPT,
    SMALL,
    define,
    fill,
    geometry_dims,
    geometry_place,
    missing,
    put,
    root_variables,
)
from tcstudy.errors import UsageError
from tcstudy.scene.study import Study

if TYPE_CHECKING:
    import netCDF4


OWN_POINT = "own_point"
_WHAT = "i of the group geometry_i; -1 where the geometry was refused or has no mesh"
NUMBER = FileVariable("geometry", "i4", "1", "number of the geometry", (SWEEP,), _WHAT)


def write_variants(
    path: Path, study: Study, files: Sequence[Path | None], others: Sequence[BlockRecord], attributes: Mapping[str, Any]
) -> tuple[int, int]:
    """Join the files of the geometries into one, replacing an old file in one step.

    files: of every geometry, None where there is none;  others: the points of those, with their reasons
    Returns how many solutions were sought and how many failed. Raises StoreError if a file cannot be read or written.
    """

    parts = [
        (i, one, file) for i, (one, file) in enumerate(zip(study.variants, files, strict=True)) if file is not None
    ]
    numbers = np.full(len(study.scenes), -1, dtype=np.int32)
    for number, variant, _ in parts:
        numbers[variant.places] = number
    wanted = np.ones((len(study.scenes), study.mesh.levels), dtype=bool)

    def records() -> Iterable[BlockRecord]:
        """The points without what has the length of their meshes."""
        yield from others
        for _, variant, file in parts:
            for block in read_blocks(file, study, variant.places, wanted):
                yield replace(block, u_T=None, xi=None, sticks=None, fields={}, solutions={})

    counts: list[tuple[int, int]] = []

    def make(nc: netCDF4.Dataset) -> None:
        counts.append(fill(nc, study, (), records))
        put(nc, NUMBER, study, numbers.reshape(study.shape))
        dims = (*geometry_dims(study), "level")
        by_level = [replace(v, dims=dims) for v in root_variables(study) if v.dims == ("level",)]
        new = {v.name: define(nc, v, study) for v in by_level}
        values = {v.name: missing(v, new[v.name].shape) for v in by_level}
        for number, variant, file in parts:
            with opened(file) as own:
                for name, array in values.items():
                    array[geometry_place(study, variant)] = own[name][...]
                _define(own, nc.createGroup(f"geometry_{number}"), {POINT: OWN_POINT})
        for name, array in values.items():
            new[name][...] = array
        for number, _, file in parts:
            with opened(file) as own:
                _fill(own, nc[f"geometry_{number}"])

    write_dataset(path, {**attributes, GEOMETRIES: len(files)}, make, KEPT)
    return counts[0]


def extract(path: Path, number: int, target: Path) -> None:
    """Write the file of the run of one geometry. Raises StoreError; UsageError if it has no mesh."""
    refuse_changed(path)
    with opened(path) as nc:
        if (group := nc.groups.get(f"geometry_{number}")) is None:
            raise UsageError(f"{path} has no mesh of this geometry; tcstudy show says why")

        def copy(root: netCDF4.Dataset) -> None:
            _define(group, root, {OWN_POINT: POINT})
            _fill(group, root)

        write_dataset(target, {}, copy)


def _define(source: netCDF4.Dataset, target: netCDF4.Dataset, rename: dict[str, str]) -> None:
    """All dimensions, attributes, variables and groups of a group; some dimensions change their names.

    Values come later: the first one written after a definition makes the library look through the whole file.
    """
    target.setncatts({name: source.getncattr(name) for name in source.ncattrs()})
    for name, dim in source.dimensions.items():
        target.createDimension(rename.get(name, name), dim.size)
    for name, old in source.variables.items():
        given = {key: old.getncattr(key) for key in old.ncattrs()}
        none = given.pop("_FillValue", False)
        large = old.dtype is not str and old.size * old.dtype.itemsize > SMALL
        dims = tuple(rename.get(dim, dim) for dim in old.dimensions)
        new = target.createVariable(name, old.dtype, dims, fill_value=none, **(COMPRESSED if large else {}))
        new.setncatts(given)
    for name, group in source.groups.items():
        _define(group, target.createGroup(name), rename)


def _fill(source: netCDF4.Dataset, target: netCDF4.Dataset) -> None:
    """The values of all variables of a group that `_define` has made."""
    for name, old in source.variables.items():
        target[name][...] = old[...]
    for name, group in source.groups.items():
        _fill(group, target[name])
