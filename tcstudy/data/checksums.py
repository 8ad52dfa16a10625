"""Checksums by variable and attribute: what another program has changed in a file, told by name.

The seal of a file says that something has changed; these say what. Every group keeps, as JSON in the attribute
`checksums`, of each of its variables the type, the dimensions with their sizes, and CRC-32 of values and attributes.
"""

from __future__ import annotations

import json
import zlib
from collections.abc import Iterator
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from tcstudy.data.writer import tile_shape, tiles

if TYPE_CHECKING:
    import netCDF4

NAME = "checksums"
SLAB = 2**22
"""Numbers of one variable that are in memory at a time."""


class Changes(NamedTuple):
    """What of a file is not as it was written, by name (`level_0/u_T`).

    broken: variables and groups that are gone or have another type or shape;  values: variables with other values
    notes:  attributes that differ, variables and groups that were added
    """

    broken: tuple[str, ...] = ()
    values: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()

    @property
    def words(self) -> str:
        """The changes in a line; empty if none is known."""
        parts = (
            ("gone or of another shape: ", self.broken),
            ("other values: ", self.values),
            ("annotations: ", self.notes),
        )
        return "; ".join(what + _some(names) for what, names in parts if names)


def _some(names: tuple[str, ...]) -> str:
    more = len(names) - 5
    return ", ".join(names[:5]) + (f" and {more} more" if more > 0 else "")


def stamp(nc: netCDF4.Dataset) -> None:
    """Write the checksums of an open file whose values are complete."""
    nc.set_auto_maskandscale(False)
    for _, group in _groups(nc):
        group.setncattr(NAME, json.dumps(_of_group(group), separators=(",", ":")))


def changes(nc: netCDF4.Dataset) -> Changes:
    """What differs from the checksums of an open file; nothing of a file of an earlier version, which has none."""
    broken: list[str] = []
    values: list[str] = []
    notes: list[str] = []
    nc.set_auto_maskandscale(False)
    groups = dict(_groups(nc))
    if NAME not in nc.ncattrs():
        return Changes()
    for path, group in groups.items():
        if NAME not in group.ncattrs():
            notes.append(f"{path} (added)")
            continue
        then, now = json.loads(group.getncattr(NAME)), _of_group(group)
        broken += [f"{path}{name}/" for name in then["groups"] if name not in group.groups]
        for name, (kind, crc, attributes) in then["variables"].items():
            new_kind, new_crc, new_attributes = now["variables"].get(name, ("", 0, 0))
            if new_kind != kind:
                broken.append(path + name)
            elif new_crc != crc:
                values.append(path + name)
            if new_kind and new_attributes != attributes:
                notes.append(f"attributes of {path}{name}")
        notes += [f"{path}{name} (added)" for name in now["variables"] if name not in then["variables"]]
        old, new = then["attributes"], now["attributes"]
        notes += [f"attribute {path}{name}" for name in {**old, **new} if old.get(name) != new.get(name)]
    return Changes(tuple(broken), tuple(values), tuple(notes))


def _groups(group: netCDF4.Dataset, path: str = "") -> Iterator[tuple[str, Any]]:
    yield path, group
    for name, inner in group.groups.items():
        yield from _groups(inner, f"{path}{name}/")


def _of_group(group: Any) -> dict[str, Any]:
    return {
        "variables": {
            name: (f"{v.dtype} {dict(zip(v.dimensions, v.shape, strict=True))}", _values(v), _crc(v, *v.ncattrs()))
            for name, v in group.variables.items()
        },
        "attributes": {name: _crc(group, name) for name in group.ncattrs() if name != NAME},
        "groups": list(group.groups),
    }


def _values(variable: netCDF4.Variable) -> int:
    crc = 0
    for cut, _, _ in tiles(variable.shape, tile_shape(variable.shape, SLAB)):
        part = np.asarray(variable[cut or ...])
        crc = zlib.crc32("\0".join(map(str, part.ravel())).encode() if part.dtype.hasobject else part.tobytes(), crc)
    return crc


def _crc(holder: Any, *names: str) -> int:
    """Of attributes by name."""
    values = {name: np.asarray(holder.getncattr(name)).tolist() for name in sorted(names)}
    return zlib.crc32(json.dumps(values, default=str).encode())
