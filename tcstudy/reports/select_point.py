"""One sweep point of a result file, found by the labels of its swept parameters."""

from __future__ import annotations

from collections.abc import Callable, Container, Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from tcstudy.data.bodies import StoredBody
from tcstudy.data.files import kind_of, reading
from tcstudy.data.reading import axis_names, open_root, sweep_dims, unmasked
from tcstudy.data.schema import GEOMETRIES, PointStatus
from tcstudy.data.variables import sweep_points
from tcstudy.errors import DrawError, UsageError, hint
from tcstudy.reports.symbols import symbol
from tcstudy.reports.text import first_largest, number, scaled_labels
from tcstudy.scene import units as u
from tcstudy.scene.study import Study

if TYPE_CHECKING:
    import xarray

Value = float | int | str | Sequence[float | int | str]

CLOSE = 1e-3
"""Relative distance at which a number is taken for a label: what tables print has four digits."""


def locate(data: Any, point: Mapping[str, Value] | None) -> dict[str, int]:
    """Index along each sweep dimension of the point with the given labels.

    point: value by name of the swept parameter or by its key path ("alpha" or "heat.alpha"); a text
    may be a label, a
           number or a quantity ("20 K"), a list stands for the pair that the study has. A parameter
           that is left out
           has its first value (in list mode, the first point that fits is taken).

    Raises DrawError for an unknown name, or a value or combination that there is not.
    """
    fits, dims = matching(data, point or {}), sweep_dims(data)
    first = np.unravel_index(int(np.argmax(fits)), [data.sizes[d] for d in dims]) if dims else ()
    return {d: int(i) for d, i in zip(dims, first, strict=True)}


def sweep_point(study: Study, labels: Mapping[str, Value] | None) -> tuple[tuple[int, ...], str]:
    """Return index and words of the point of a study that has the given labels.

    labels: as of `locate`, which says, too, what is raised
    """
    points = sweep_points(study)
    place = locate(points, labels)
    return tuple(place.values()), describe(points, place)


def of_largest_slip(data: Any) -> dict[str, int]:
    """Index along each sweep dimension of the point that the verdict names: that of the largest
    slip, on the finest level or in any step; of the first one where no point is solved."""
    dims = sweep_dims(data)
    slip = data["u_T_max"].where(data["status"] == int(PointStatus.OK))
    if "level" in slip.dims:
        slip = slip.isel(level=-1)
    slips = slip.max([d for d in slip.dims if d not in dims]).transpose(*dims).values
    if not np.isfinite(slips).any():
        return dict.fromkeys(dims, 0)
    return dict(zip(dims, first_largest(slips), strict=True))


def matching(data: Any, point: Mapping[str, Value]) -> NDArray[np.bool_]:
    """(points,) those that have all the given labels, in the order of the file. Raises DrawError as
    `locate`."""
    wanted, dims = _by_name(data, point), sweep_dims(data)
    found = {name: _fits(name, data[name], value) for name, value in wanted.items()}
    fits = np.ones([int(data.sizes[d]) for d in dims], dtype=bool)
    for name, fit in found.items():
        fits &= fit.reshape([-1 if d == str(data[name].dims[0]) else 1 for d in dims])
    if not fits.any():
        given = " and ".join(f"{name} = {value}" for name, value in wanted.items())
        one = next(iter(found))
        near = "; ".join(describe(data, {dims[0]: int(i)}) for i in np.flatnonzero(found[one])[:3])
        raise DrawError(f"no point has {given} together; with that {one} there are: {near}")
    return fits.ravel()


def chosen_geometry(data: Any, wanted: NDArray[np.bool_], file: str, option: str = "") -> int:
    """Return the number of the geometry of the wanted points, 0 in a file of one body, −1 for a
    geometry without a mesh.

    file, option: how a message, and a label in it, begins
    Raises UsageError where these points are of several geometries.
    """
    if GEOMETRIES not in data.attrs:
        return 0
    numbers = data["geometry"].values
    chosen = np.unique(numbers.ravel()[wanted])
    if len(chosen) == 1:
        return int(chosen[0])
    place = int(np.argmax(wanted & (numbers.ravel() >= 0)))
    dims = data["geometry"].dims
    makes = {d for i, d in enumerate(dims) if (numbers != numbers.take([0], axis=i)).any()}
    example = list[str]()
    for name, labels in labels_by_point(data).items():
        if data[name].dims[0] in makes:
            label = labels[place]
            example.append(f"{option}{name}={label if isinstance(label, str) else f'{label:.6g}'}")
    raise UsageError(
        f"{file}: the points asked for are of {len(chosen)} geometries, and this takes one; name it, "
        f"for example {' '.join(example)}"
    )


def load_geometry(path: Path, point: Mapping[str, Value], level: int) -> xarray.Dataset:
    """Return what `tcstudy.open_geometry` does."""
    if (kind := kind_of(path)) != "run":
        raise UsageError(f"{path} is a file of tcstudy {kind}; name that of a run")
    with reading(path):
        with open_root(path) as data:
            number = level_number(data, level)
            geometry = chosen_geometry(data, matching(data, point), str(path))
        with unmasked(path) as nc:
            body = StoredBody.of(nc, geometry) if geometry >= 0 else None
            if body is None or number not in body.levels:
                what = f"{path} has no mesh of level {number} of this geometry"
                raise DrawError(f"{what}; see the reasons with: tcstudy show")
            return body.dataset(number).assign_coords(body.coordinates()).assign_attrs(body.about)


def parameter(data: Any, given: str) -> str:
    """The name that a swept parameter has in the data, by that name, its key path or an end of it
    that is no other's; raises DrawError.
    """
    names = axis_names(data)
    if given in names:
        return given
    ends = [name for name in names if given in _ends(str(data[name].attrs.get("long_name", "")))]
    if len(ends) == 1:
        return ends[0]
    if not names:
        raise DrawError(f"there is one point and no swept parameter {given!r}; leave the point out")
    raise DrawError(f"there is no swept parameter {given!r}; {_has(given, names, len(names))}")


def _ends(path: str) -> set[str]:
    """Return the ends of a key path, with dots or with the underscores of names in files."""
    keys = path.split(".")
    ends = [keys[i:] for i in range(len(keys))]
    return {mark.join(end) for end in ends for mark in "._"}


def numbers_of(data: Any) -> list[str]:
    """Names of the numbers that a file has by sweep point and level, in its order."""
    dims = set(data["status"].dims)
    numbers = [
        str(name)
        for name in data.data_vars
        if set(data[name].dims) == dims and data[name].dtype.kind in "fi"
    ]
    return [name for name in numbers if "flag_values" not in data[name].attrs]


def quantity(data: Any, given: str, of_levels: Container[str] = ()) -> str:
    """The name of a number that the file has by sweep point and level; raises DrawError with those
    that it has.

    of_levels: names of what the groups of the levels have, along the contact line or in the body
    """
    names = numbers_of(data)
    if given in names:
        return given
    choice = _has(given, names, 30)
    if given in of_levels:
        fault = f"{given!r} has a value at every node of a level, not one a point"
    elif given not in data.variables:
        fault = f"the file has no number {given!r} by point and level"
    elif "flag_values" in data[given].attrs:
        fault = f"{given!r} is a flag and no number"
    else:
        dims = ", ".join(map(str, data[given].dims)) or "no dimension"
        fault = f"{given!r} has the dimensions {dims}, and is not one number a point and level"
    raise DrawError(f"{fault}; {choice}")


def _by_name(data: Any, point: Mapping[str, Value]) -> dict[str, Value]:
    said: dict[str, str] = {}
    for given in point:
        if (name := parameter(data, given)) in said:
            raise DrawError(f"{said[name]} and {given} are one parameter; give it once")
        said[name] = given
    return {name: point[given] for name, given in said.items()}


def fitting(
    data: Any, point: Mapping[str, Value] | None, free: tuple[str, ...]
) -> tuple[NDArray[np.bool_], list[str]]:
    """(which points of the sweep, in C order, have the given labels; the parameters that have one
    value, in words).

    Parameters in `free` may have any value. In a grid all others have one, the first unless given;
    the points of a list keep those that they have. Raises DrawError as `locate` does, and for a
    label given to a free parameter.
    """
    wanted, fixed = _by_name(data, point or {}), []
    if twice := [name for name in wanted if name in free]:
        raise DrawError(f"{twice[0]} is drawn with all its values; leave it out of the point")
    for name in axis_names(data):
        if name not in free and (name in wanted or data.attrs["sweep_mode"] == "grid"):
            place = int(np.argmax(_fits(name, data[name], wanted[name]))) if name in wanted else 0
            first = name not in wanted and data[name].size > 1
            fixed.append(_stated(data, name, place) + " (its first value)" * first)
            wanted[name] = data[name].values[place].item()
    return matching(data, wanted), fixed


def labels_by_point(data: Any) -> dict[str, NDArray[Any]]:
    """(P,) labels of each swept parameter at all points of the sweep, in C order."""
    like = data["status"].isel(level=0)
    return {
        name: data[name].broadcast_like(like).transpose(*like.dims).values.ravel()
        for name in axis_names(data)
    }


def level_number(data: Any, level: int) -> int:
    """The level from 0 on; negative ones are counted from the finest. Raises DrawError if there is
    none."""
    count = int(data.sizes["level"])
    if not -count <= level < count:
        raise DrawError(
            f"the file has no level {level}; it has levels 0 to {count - 1}, and -1 is the finest"
        )
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


def axis_symbol(data: Any, name: str) -> str:
    """Return how reports write a swept parameter of a file, with the edge or region it belongs
    to."""
    return symbol(str(data[name].attrs.get("long_name", name)))


def axis_symbols(data: Any) -> dict[str, str]:
    """Return `axis_symbol` of all swept parameters, those of one chosen point, too, by name."""
    names = (str(name) for name in data.coords if "long_name" in data[name].attrs)
    return {name: axis_symbol(data, name) for name in names}


def axis_labels(data: Any, name: str, digits: int = 4) -> tuple[list[str], str]:
    """The labels of a swept parameter as they are read, and their unit: one for the whole axis."""
    return scaled_labels(data[name].values.tolist(), data[name].attrs, digits)


def _stated(data: Any, name: str, place: int) -> str:
    shown, unit = axis_labels(data, name, 6)
    return f"{name} = {shown[place]}" + (f" {unit}" if unit != "1" else "")


def describe(data: Any, where: Mapping[str, int]) -> str:
    """The labels of a point in words, "alpha = 100 W m-2 K-1, friction = tresca"."""
    return ", ".join(
        _stated(data, name, where[str(data[name].dims[0])]) for name in axis_names(data)
    )


def naming(data: Any) -> Callable[[tuple[int, ...]], str]:
    """`describe` by the index of a point along the sweep dimensions."""
    return lambda index: describe(data, dict(zip(sweep_dims(data), index, strict=True)))


def _fits(name: str, axis: Any, value: Value) -> NDArray[np.bool_]:
    """Which labels of an axis are the wanted value; at least one is."""
    held = axis.values
    if held.dtype.kind in "OUS":
        texts = [str(label) for label in held]
        wanted = (
            str(value)
            if isinstance(value, str | int | float)
            else f"[{', '.join(map(str, value))}]"
        )
        if wanted not in texts:
            raise DrawError(f"no point has {name} = {wanted}; {_has(wanted, texts)}")
        return np.array([text == wanted for text in texts])
    number_wanted, units = (
        _as_number(name, value, str(axis.attrs["units"])),
        str(axis.attrs["units"]),
    )
    distance = np.abs(held - number_wanted)
    nearest = held[np.argmin(distance)]
    if not abs(nearest - number_wanted) <= CLOSE * max(abs(number_wanted), abs(nearest)):
        order = np.unique(held)
        nearby = np.sort(order[np.argsort(np.abs(order - number_wanted), kind="stable")[:3]])
        told = f"{', '.join(map(number, nearby))}{f' {units}' if units != '1' else ''}"
        raise DrawError(f"no point has {name} = {value}; the nearest values are {told}")
    return np.asarray(held == nearest)


def _as_number(name: str, value: Any, units: str) -> float:
    with suppress(ValueError, TypeError):
        return float(value)
    quantity, dimension = (
        u.split_quantity(str(value)),
        next((d for d in u.DIMENSIONS if d.cf == units), None),
    )
    if quantity is None or dimension is None:
        raise DrawError(
            f"{name} = {value!r} is not a number; give one{f' in {units}' if units != '1' else ''}"
        )
    try:
        return u.to_si(*quantity, dimension)
    except u.UnitError as error:
        raise DrawError(f"{name} = {value!r}: {error}") from error


def _has(given: str, names: Sequence[str], most: int = 8) -> str:
    meant = hint(given, names, "")
    return f"{meant} there is {', '.join(names[:most])}{', …' * (len(names) > most)}".strip()
