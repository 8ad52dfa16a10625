"""One sweep point of a result file, found by the labels of its swept parameters."""

from __future__ import annotations

import difflib
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tcstudy.data.records import PointStatus
from tcstudy.reports.style import DrawError
from tcstudy.reports.text import number, scaled_labels
from tcstudy.scene import units as u

Value = float | int | str

SWEPT = "swept parameter "
"""What stands before the key path in the long name of an axis (see data.schema)."""
CLOSE = 1e-3
"""Relative distance at which a number is taken for a label: what tables print has four digits."""


_DIMENSIONS = (
    *(u.LENGTH, u.TRACTION, u.STIFFNESS, u.BODY_FORCE, u.HEAT_SOURCE, u.HEAT_TRANSFER, u.TEMPERATURE),
    *(u.CONDUCTIVITY, u.EXPANSION, u.THERMAL_STRESS),
)
"""Physical dimensions whose units stand in a result file."""


def axis_names(data: Any) -> list[str]:
    """Names of the swept parameters of an opened result file (its root dataset)."""
    sweep = set(data["status"].dims) - {"level"}
    return [str(name) for name in data.coords if data[name].dims and set(data[name].dims) <= sweep]


def locate(data: Any, point: Mapping[str, Value] | None, holder: str = "file") -> dict[str, int]:
    """Index along each sweep dimension of the point with the given labels.

    point:  value by name of the swept parameter or by its key path ("alpha" or "heat.alpha"); a text may be a label,
            a number or a quantity ("20 K"). A parameter that is left out has its first value (in list mode, the first
            point that fits is taken).
    holder: what has the points, for messages: "file", or "study" before there is one

    Raises DrawError for an unknown name, or a value or combination that there is not.
    """
    names = axis_names(data)
    wanted = _by_name(data, point or {}, holder)
    fits = {name: _fits(name, data[name], value, holder) for name, value in wanted.items()}
    if data.attrs["sweep_mode"] == "grid":
        return {name: int(np.argmax(fits[name])) if name in fits else 0 for name in names}
    if not names:
        return {}
    together = np.ones(data.sizes["point"], dtype=bool)
    for fit in fits.values():
        together &= fit
    if not together.any():
        given = " and ".join(f"{name} = {value}" for name, value in wanted.items())
        one = next(iter(fits))
        near = "; ".join(describe(data, {"point": int(i)}) for i in np.flatnonzero(fits[one])[:3])
        raise DrawError(f"no point of the {holder} has {given} together; with that {one} it has: {near}")
    return {"point": int(np.argmax(together))}


def matching(data: Any, point: Mapping[str, Value]) -> NDArray[np.bool_]:
    """(points,) those that have all the given labels, in the order of the file. Raises DrawError as `locate`, and
    where no point has them together."""
    locate(data, point)
    dims = [str(d) for d in data["status"].dims if d != "level"]
    fits = np.ones([int(data.sizes[d]) for d in dims], dtype=bool)
    for name, value in _by_name(data, point, "file").items():
        own = str(data[name].dims[0])
        fits &= _fits(name, data[name], value, "file").reshape([-1 if d == own else 1 for d in dims])
    return fits.ravel()


def _by_name(data: Any, point: Mapping[str, Value], holder: str) -> dict[str, Value]:
    """The wanted values by the names that the axes have in the data."""
    names = axis_names(data)
    paths = {str(data[name].attrs.get("long_name", "")).removeprefix(SWEPT): name for name in names}
    wanted: dict[str, Value] = {}
    said: dict[str, str] = {}
    for given, value in point.items():
        name = given if given in names else paths.get(given)
        if name is None:
            raise DrawError(_unknown_name(given, names, holder))
        if name in wanted:
            raise DrawError(f"{said[name]} and {given} are one parameter; give it once")
        wanted[name], said[name] = value, given
    return wanted


def level_number(data: Any, level: int) -> int:
    """The level from 0 on; negative ones are counted from the finest. Raises DrawError if there is none."""
    count = int(data.sizes["level"])
    if not -count <= level < count:
        raise DrawError(f"the file has no level {level}; it has levels 0 to {count - 1}, and -1 is the finest")
    return level % count


def check_solved(data: Any, where: Mapping[str, int], level: int) -> None:
    """Raise DrawError with the stored reason unless the point was solved on this level."""
    statuses = data["status"].isel(level=level)
    status = PointStatus(int(statuses.isel(where)))
    if status == PointStatus.OK:
        return
    reason = str(data["reason"].isel(level=level).isel(where).item())
    what = f"the point {describe(data, where) or 'of the file'} has no solution on level {level}"
    solved = np.argwhere(statuses.values == int(PointStatus.OK))
    if not len(solved):
        remedy = "no other point has one there; see the reasons with: tcstudy show"
    else:
        other = describe(data, dict(zip(statuses.dims, (int(i) for i in solved[0]), strict=True)))
        remedy = f"draw another point, for example {other}"
    raise DrawError(f"{what} ({status.name.lower().replace('_', ' ')}: {reason}); {remedy}")


def describe(data: Any, where: Mapping[str, int]) -> str:
    """The labels of a point in words, "alpha = 100 W m-2 K-1, friction = tresca"."""
    parts = []
    for name in axis_names(data):
        axis = data[name]
        shown, unit = scaled_labels(axis.values.tolist(), str(axis.attrs["units"]), 6)  # one unit for a whole axis
        parts.append(f"{name} = {shown[where[str(axis.dims[0])]]}" + (f" {unit}" if unit != "1" else ""))
    return ", ".join(parts)


def naming(data: Any) -> Callable[[tuple[int, ...]], str]:
    """`describe` by the index of a point along the sweep dimensions."""
    dims = [str(dim) for dim in data["status"].dims if dim != "level"]
    return lambda index: describe(data, dict(zip(dims, index, strict=True)))


def labels(data: Any, where: Mapping[str, int]) -> list[tuple[str, float | str, str]]:
    """(name, label, units) of each swept parameter at a point."""
    found = []
    for name in axis_names(data):
        value = data[name].isel(where, missing_dims="ignore").item()
        found.append((name, value if isinstance(value, str) else float(value), str(data[name].attrs["units"])))
    return found


def _fits(name: str, axis: Any, value: Value, holder: str) -> NDArray[np.bool_]:
    """Which labels of an axis are the wanted value; at least one is."""
    held = axis.values
    if held.dtype.kind in "OUS":
        texts = [str(label) for label in held]
        if str(value) not in texts:
            near = difflib.get_close_matches(str(value), texts, n=1)
            hint = f"did you mean {near[0]!r}? " if near else ""
            raise DrawError(f"no point of the {holder} has {name} = {value}; {hint}it has {_listed(texts)}")
        return np.array([text == str(value) for text in texts])
    wanted = _as_number(name, value, str(axis.attrs["units"]))
    distance = np.abs(held - wanted)
    nearest = held[np.argmin(distance)]
    if not abs(nearest - wanted) <= CLOSE * max(abs(wanted), abs(nearest)):
        order = np.unique(held)
        nearby = _listed(
            number(label) for label in np.sort(order[np.argsort(np.abs(order - wanted), kind="stable")[:3]])
        )
        raise DrawError(f"no point of the {holder} has {name} = {value}; the nearest values are {nearby}")
    return np.asarray(held == nearest)


def _as_number(name: str, value: Value, units: str) -> float:
    """The value in the units of the axis."""
    try:
        return float(value)
    except ValueError:
        pass
    quantity, dimension = u.split_quantity(str(value)), next((d for d in _DIMENSIONS if d.cf == units), None)
    if quantity is None or dimension is None:
        raise DrawError(f"{name} = {value!r} is not a number; give one{f' in {units}' if units != '1' else ''}")
    try:
        return u.to_si(*quantity, dimension)
    except u.UnitError as error:
        raise DrawError(f"{name} = {value!r}: {error}; {error.remedy}") from error


def _unknown_name(name: str, names: list[str], holder: str) -> str:
    if not names:
        return f"the {holder} has one point and no swept parameter {name!r}; leave the point out"
    near = difflib.get_close_matches(name, names, n=1)
    hint = f"did you mean {near[0]!r}? " if near else ""
    return f"the {holder} has no swept parameter {name!r}; {hint}it has {', '.join(names)}"


def _listed(texts: Any, most: int = 8) -> str:
    shown = list(texts)
    return ", ".join(shown[:most]) + (", …" if len(shown) > most else "")
