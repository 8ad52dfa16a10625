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
"""What a user writes for a label: a number, a text or a quantity ("20 K"), or a pair of them."""

MAX_DISTANCE = 1e-3
"""Relative distance up to which a number means a label; tables print four digits of labels."""


def locate(data: Any, point: Mapping[str, Value] | None) -> dict[str, int]:
    """Return the index along each sweep dimension of the point with the given labels.

    point: label by name of the swept parameter or by its key path ("alpha" or "heat.alpha"). A
           parameter that is left out has its first value; of a list of points, the first one that
           fits is taken.

    Raises DrawError for an unknown name, and where no point has the value or the combination.
    """
    fits, dims = matching(data, point or {}), sweep_dims(data)
    if not dims:
        return {}
    first = np.unravel_index(int(np.argmax(fits)), [data.sizes[dim] for dim in dims])
    return {dim: int(i) for dim, i in zip(dims, first, strict=True)}


def sweep_point(study: Study, labels: Mapping[str, Value] | None) -> tuple[tuple[int, ...], str]:
    """Return index and words of the point of a study that has the given labels.

    labels: as of `locate`, which says, too, what is raised
    """
    points = sweep_points(study)
    place = locate(points, labels)
    return tuple(place.values()), describe(points, place)


def of_largest_slip(data: Any) -> dict[str, int]:
    """Return the index along each sweep dimension of the point with the largest slip.

    It is the point that the verdict names: on the finest level, or in any step. It is the first
    point where none is solved.
    """
    dims = sweep_dims(data)
    slip = data["u_T_max"].where(data["status"] == int(PointStatus.OK))
    if "level" in slip.dims:
        slip = slip.isel(level=-1)
    slips = slip.max([dim for dim in slip.dims if dim not in dims]).transpose(*dims).values
    if not np.isfinite(slips).any():
        return dict.fromkeys(dims, 0)
    return dict(zip(dims, first_largest(slips), strict=True))


def matching(data: Any, point: Mapping[str, Value]) -> NDArray[np.bool_]:
    """Return (P,) which points, in the order of the file, have all the given labels.

    Raises DrawError as `locate`.
    """
    values, dims = _by_name(data, point), sweep_dims(data)
    fits = np.ones([int(data.sizes[dim]) for dim in dims], dtype=bool)
    fits_one = dict[str, NDArray[np.bool_]]()
    for name, value in values.items():
        fits_one[name] = _fits(name, data[name], value)
        shape = [-1 if dim == str(data[name].dims[0]) else 1 for dim in dims]
        fits &= fits_one[name].reshape(shape)
    if not fits.any():
        labels = " and ".join(f"{name} = {value}" for name, value in values.items())
        name, fit = next(iter(fits_one.items()))
        examples = [describe(data, {dims[0]: int(i)}) for i in np.flatnonzero(fit)[:3]]
        near = f"with that {name} there are: {'; '.join(examples)}"
        raise DrawError(f"no point has {labels} together; {near}")
    return fits.ravel()


def chosen_geometry(data: Any, wanted: NDArray[np.bool_], file: str, option: str = "") -> int:
    """Return the number of the geometry of the wanted points (P,).

    0 in a file of one body, −1 for a geometry without a mesh.

    file, option: how a message, and a label in it, begins
    Raises UsageError where these points are of several geometries.
    """
    if GEOMETRIES not in data.attrs:
        return 0
    geometries = data["geometry"].values
    chosen = np.unique(geometries.ravel()[wanted])
    if len(chosen) == 1:
        return int(chosen[0])

    # an example: the labels of one of the points, of the parameters that change the geometry
    place = int(np.argmax(wanted & (geometries.ravel() >= 0)))
    changing = set[str]()
    for axis, dim in enumerate(data["geometry"].dims):
        if (geometries != geometries.take([0], axis=axis)).any():
            changing.add(dim)
    example = list[str]()
    for name, labels in labels_by_point(data).items():
        if data[name].dims[0] in changing:
            label = labels[place]
            text = label if isinstance(label, str) else f"{label:.6g}"
            example.append(f"{option}{name}={text}")
    raise UsageError(
        f"{file}: the requested points are of {len(chosen)} geometries, and this takes one; "
        f"name it, for example {' '.join(example)}"
    )


def load_geometry(path: Path, point: Mapping[str, Value], level: int) -> xarray.Dataset:
    """Return the geometry of a point on a level, as `tcstudy.open_geometry` does."""
    kind = kind_of(path)
    if kind != "run":
        raise UsageError(f"{path} is a file of tcstudy {kind}; name that of a run")
    with reading(path):
        with open_root(path) as data:
            number = level_number(data, level)
            geometry = chosen_geometry(data, matching(data, point), str(path))
        with unmasked(path) as nc:
            body = StoredBody.of(nc, geometry) if geometry >= 0 else None
            if body is None or number not in body.levels:
                lack = f"{path} has no mesh of level {number} of this geometry"
                raise DrawError(f"{lack}; see the reasons with: tcstudy show")
            dataset = body.dataset(number)
            return dataset.assign_coords(body.coordinates()).assign_attrs(body.about)


def parameter(data: Any, key: str) -> str:
    """Return the name in the data of a swept parameter.

    key: this name, its key path, or an end of the path that no other parameter has
    Raises DrawError if there is none.
    """
    names = axis_names(data)
    if key in names:
        return key
    with_this_end = [name for name in names if key in _ends(_long_name(data, name))]
    if len(with_this_end) == 1:
        return with_this_end[0]
    if not names:
        raise DrawError(f"there is one point and no swept parameter {key!r}; leave the point out")
    choice = _choice(key, names, len(names))
    raise DrawError(f"there is no swept parameter {key!r}; {choice}")


def _long_name(data: Any, name: str) -> str:
    return str(data[name].attrs.get("long_name", ""))


def _ends(path: str) -> set[str]:
    """Return the ends of a key path, with dots or with the underscores of names in files."""
    keys = path.split(".")
    ends = [keys[i:] for i in range(len(keys))]
    return {mark.join(end) for end in ends for mark in "._"}


def numbers_of(data: Any) -> list[str]:
    """Return the names of the numbers that a file has by sweep point and level, in its order."""
    dims = set(data["status"].dims)
    names = list[str]()
    for name in data.data_vars:
        is_number = data[name].dtype.kind in "fi" and "flag_values" not in data[name].attrs
        if is_number and set(data[name].dims) == dims:
            names.append(str(name))
    return names


def quantity(data: Any, name: str, of_levels: Container[str] = ()) -> str:
    """Return a name if the file has a number of this name by sweep point and level.

    of_levels: names of what the groups of the levels have, along the contact line or in the body
    Raises DrawError with the names that it has.
    """
    names = numbers_of(data)
    if name in names:
        return name
    if name in of_levels:
        fault = f"{name!r} has a value at every node of a level, not one per point"
    elif name not in data.variables:
        fault = f"the file has no variable {name!r} by point and level"
    elif "flag_values" in data[name].attrs:
        fault = f"{name!r} is a flag, not a quantity"
    else:
        dims = ", ".join(map(str, data[name].dims)) or "no dimension"
        fault = f"{name!r} has the dimensions {dims}, and is not one number per point and level"
    raise DrawError(f"{fault}; {_choice(name, names, 30)}")


def _by_name(data: Any, point: Mapping[str, Value]) -> dict[str, Value]:
    """Return labels by the names of their parameters in the data."""
    key_of_name: dict[str, str] = {}
    for key in point:
        name = parameter(data, key)
        if name in key_of_name:
            raise DrawError(f"{key_of_name[name]} and {key} are one parameter; give it once")
        key_of_name[name] = key
    return {name: point[key] for name, key in key_of_name.items()}


def fitting(
    data: Any, point: Mapping[str, Value] | None, free: tuple[str, ...]
) -> tuple[NDArray[np.bool_], list[str]]:
    """Return (P,) which points have the given labels, and the parameters that have one value.

    Points are in C order, parameters in words. Parameters in `free` may have any value. In a grid
    all others have one, the first unless given. The points of a list keep those that they have.

    Raises DrawError as `locate` does, and for a label given to a free parameter.
    """
    values, fixed = _by_name(data, point or {}), list[str]()
    for name in values:
        if name in free:
            raise DrawError(f"{name} is drawn with all its values; leave it out of the point")
    is_grid = data.attrs["sweep_mode"] == "grid"
    for name in axis_names(data):
        if name in free:
            continue
        if name in values:
            place = int(np.argmax(_fits(name, data[name], values[name])))
            fixed.append(_stated(data, name, place))
        elif is_grid:
            place = 0
            by_default = " (its first value)" if data[name].size > 1 else ""
            fixed.append(_stated(data, name, place) + by_default)
        else:
            continue
        values[name] = data[name].values[place].item()
    return matching(data, values), fixed


def labels_by_point(data: Any) -> dict[str, NDArray[Any]]:
    """Return (P,) labels of each swept parameter at all points of the sweep, in C order."""
    like = data["status"].isel(level=0)
    return {
        name: data[name].broadcast_like(like).transpose(*like.dims).values.ravel()
        for name in axis_names(data)
    }


def level_number(data: Any, level: int) -> int:
    """Return the level counted from 0; a negative one is counted from the finest.

    Raises DrawError if there is none.
    """
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
    cause = f"{status.name.lower().replace('_', ' ')}: {reason}"
    point = describe(data, where) or "of the file"
    solved = np.argwhere(statuses.values == int(PointStatus.OK)).tolist()
    if solved:
        example = describe(data, dict(zip(statuses.dims, solved[0], strict=True)))
        remedy = f"draw another point, for example {example}"
    else:
        remedy = "no other point has one there; see the reasons with: tcstudy show"
    raise DrawError(f"the point {point} has no solution on level {level} ({cause}); {remedy}")


def axis_symbol(data: Any, name: str) -> str:
    """Return the symbol of a swept parameter of a file, with the edge or region it belongs to."""
    return symbol(str(data[name].attrs.get("long_name", name)))


def axis_symbols(data: Any) -> dict[str, str]:
    """Return `axis_symbol` of all swept parameters by name, also those of one chosen point."""
    names = (str(name) for name in data.coords if "long_name" in data[name].attrs)
    return {name: axis_symbol(data, name) for name in names}


def axis_labels(data: Any, name: str, digits: int = 4) -> tuple[list[str], str]:
    """Return the labels of a swept parameter as they are read, and their common unit."""
    return scaled_labels(data[name].values.tolist(), data[name].attrs, digits)


def _stated(data: Any, name: str, place: int) -> str:
    """Return a label in words, "alpha = 100 W m-2 K-1"."""
    labels, unit = axis_labels(data, name, 6)
    return f"{name} = {labels[place]}" + (f" {unit}" if unit != "1" else "")


def describe(data: Any, where: Mapping[str, int]) -> str:
    """Return the labels of a point in words, "alpha = 100 W m-2 K-1, friction = tresca"."""
    labels = list[str]()
    for name in axis_names(data):
        labels.append(_stated(data, name, where[str(data[name].dims[0])]))
    return ", ".join(labels)


def naming(data: Any) -> Callable[[tuple[int, ...]], str]:
    """Return `describe` as a function of the index of a point along the sweep dimensions."""
    return lambda index: describe(data, dict(zip(sweep_dims(data), index, strict=True)))


def _fits(name: str, axis: Any, value: Value) -> NDArray[np.bool_]:
    """Return which labels of an axis are the wanted value; at least one is.

    Raises DrawError if none is.
    """
    labels = axis.values
    if labels.dtype.kind in "OUS":
        return _fits_text(name, [str(label) for label in labels], value)
    units = str(axis.attrs["units"])
    wanted = _as_number(name, value, units)
    distance = np.abs(labels - wanted)
    nearest = labels[np.argmin(distance)]
    if not abs(nearest - wanted) <= MAX_DISTANCE * max(abs(wanted), abs(nearest)):
        distinct = np.unique(labels)
        order = np.argsort(np.abs(distinct - wanted), kind="stable")
        nearby = ", ".join(map(number, np.sort(distinct[order[:3]])))
        unit = f" {units}" if units != "1" else ""
        raise DrawError(f"no point has {name} = {value}; the nearest values are {nearby}{unit}")
    return np.asarray(labels == nearest)


def _fits_text(name: str, labels: Sequence[str], value: Value) -> NDArray[np.bool_]:
    if isinstance(value, str | int | float):
        wanted = str(value)
    else:
        wanted = f"[{', '.join(map(str, value))}]"  # a pair as the study has it
    if wanted not in labels:
        raise DrawError(f"no point has {name} = {wanted}; {_choice(wanted, labels)}")
    return np.array([label == wanted for label in labels])


def _as_number(name: str, value: Any, units: str) -> float:
    """Return a value, or a quantity such as "20 K", in SI units."""
    with suppress(ValueError, TypeError):
        return float(value)
    quantity = u.split_quantity(str(value))
    dimension = next((dimension for dimension in u.DIMENSIONS if dimension.cf == units), None)
    if quantity is None or dimension is None:
        remedy = f"give one in {units}" if units != "1" else "give one"
        raise DrawError(f"{name} = {value!r} is not a number; {remedy}")
    try:
        return u.to_si(*quantity, dimension)
    except u.UnitError as error:
        raise DrawError(f"{name} = {value!r}: {error}") from error


def _choice(word: str, names: Sequence[str], most: int = 8) -> str:
    """Return the name that was probably meant, and the names that there are."""
    suggestion = hint(word, names, "")
    more = ", …" if len(names) > most else ""
    return f"{suggestion} there is {', '.join(names[:most])}{more}".strip()
