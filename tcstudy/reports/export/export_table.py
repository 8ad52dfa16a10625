"""A result file as one table, for spreadsheets, pandas and R: a CSV or JSON file with a row a point and level.

Rows are those of the result file's `status`: of a run and of its convergence every point on every level, of cost every
family, solver and level, of a history every point and step; of a path they are the vertices, of a fit the data. Every
variable of the root that has a value a row is a column `name [unit]`, of one with several (by start, by solver) each is
one, `start_energy.zero [J m-1]`. Numbers are written so that reading gives them back to the bit; flags are their words;
what is missing is an empty field, or null.

The table goes through memory some thousand rows at a time. Left out: what lies along the contact line and in the body
(`tcstudy.reports.export.export_fields`), and of a path what is no number of a vertex.
"""

from __future__ import annotations

import json
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import IO, TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from tcstudy.data.files import check_writable, replace_file
from tcstudy.data.provenance import kind_of, remarks_of
from tcstudy.data.reading import reading
from tcstudy.data.store import open_results
from tcstudy.errors import StoreError, UsageError
from tcstudy.reports.select_point import Value, matching

if TYPE_CHECKING:
    import xarray

VALUES = 2**18
"""Values that are in memory at a time."""
ROWS = {"path": "vertex", "fit": "row"}
"""Dimension of the rows where there is no status, by the kind of the file."""
LABELLED = ("start", "solver", "run")
"""Dimensions after those of the rows whose every label makes a column of its own."""


def write_csv(path: Path, target: Path, point: Mapping[str, Value] | None = None) -> int:
    """Write the table as CSV (RFC 4180, UTF-8, a header line), replacing an old file in one step; returns its rows.

    point: labels of swept parameters; only the points that have them. Raises StoreError, DrawError, UsageError.
    """

    def fill(stream: IO[str], frames: Iterator[Any], units: Mapping[str, str], _: object) -> int:
        written, header = 0, [name if unit in ("", "1") else f"{name} [{unit}]" for name, unit in units.items()]
        stream.write(",".join(header) + "\n")
        for frame in frames:
            frame.to_csv(stream, header=False, index=False, lineterminator="\n")
            written += len(frame)
        return written

    return _write(path, target, point, fill)


def write_json(path: Path, target: Path, point: Mapping[str, Value] | None = None) -> int:
    """Write the table as one JSON object, replacing an old file in one step; returns its rows.

    It has `title`, `kind`, `warnings`, `units` by column, and `rows`: a list of objects, one a line. What is not finite
    is a text, "inf" or "-inf", or null.
    """

    def fill(stream: IO[str], frames: Iterator[Any], units: Mapping[str, str], about: Any) -> int:
        head, written = json.dumps({**about, "units": units}, ensure_ascii=False), 0
        stream.write(f'{head[:-1]}, "rows": [')
        for frame in frames:
            for row in frame.replace({np.inf: "inf", -np.inf: "-inf"}).to_dict("records"):
                text = json.dumps(row, ensure_ascii=False, allow_nan=False)
                stream.write(f"{',' if written else ''}\n{text}")
                written += 1
        stream.write("\n]}\n")
        return written

    return _write(path, target, point, fill)


def _write(path: Path, target: Path, point: Mapping[str, Value] | None, fill: Any) -> int:
    """Open the result file, put what `fill` makes of its frames into the target; returns the number of rows."""
    import netCDF4

    if faults := check_writable(target):
        raise StoreError("; ".join(faults))
    written = 0
    with reading(path):
        kind = kind_of(path)
        if point and kind in (*ROWS, "cost"):
            raise UsageError(f"--at: the file of tcstudy {kind} has one scene and no sweep points; leave it out")
        with open_results(path) as tree:
            data = tree.to_dataset()
            dims = tuple(map(str, data["status"].dims)) if "status" in data else (ROWS[kind],)
            with netCDF4.Dataset(path) as nc:
                columns = _columns(data, [name for name in nc.variables if name in data.variables], dims)
            units = {name: str(one.attrs.get("units", "1")) for name, one in columns.items()}
            remarks = [asdict(one) for one in remarks_of(data.attrs)]
            about = {"title": str(data.attrs["title"]), "kind": kind, "warnings": remarks}
            wanted = matching(data, point) if point else None

            def make(aside: Path) -> None:
                nonlocal written
                with open(aside, "w", encoding="utf-8", newline="") as stream:
                    written = fill(stream, _frames(data, dims, columns, wanted), units, about)

            replace_file(target, make, sealed=False)
    return written


def _columns(data: xarray.Dataset, names: Sequence[str], dims: tuple[str, ...]) -> dict[str, xarray.DataArray]:
    """What has a value a row, in the order of the file."""
    found = {}
    for name in names:
        one = data[name].variable
        more = one.dims[-1] if len(one.dims) > 1 and one.dims[-1] in LABELLED and one.dims[-1] not in dims else None
        held = one.dims[:-1] if more else one.dims
        if not held or not set(held) <= set(dims):
            continue
        if more is None:
            found[name] = data[name]
        else:
            labels = data[more].values.tolist()
            found |= {f"{name}.{label}": data[name].isel({more: i}) for i, label in enumerate(labels)}
    return found


def _frames(
    data: xarray.Dataset, dims: tuple[str, ...], columns: Mapping[str, xarray.DataArray], wanted: Any
) -> Iterator[Any]:
    """Rows in C order of the index, some thousand at a time; the last dimension of a run's is the level."""
    import pandas

    sizes = [data.sizes[dim] for dim in dims]
    rows = max(1, VALUES // len(columns) // math.prod(sizes[1:]))
    for start in range(0, sizes[0], rows):
        cut = slice(start, min(start + rows, sizes[0]))
        index = np.arange(cut.start * math.prod(sizes[1:]), cut.stop * math.prod(sizes[1:]))
        kept = np.ones(len(index), dtype=bool) if wanted is None else wanted[index // sizes[-1]]
        if kept.any():
            shape = (cut.stop - cut.start, *sizes[1:])
            cells = {name: _cells(one.isel({dims[0]: cut}, missing_dims="ignore"), dims, shape)[kept]
                     for name, one in columns.items()}  # fmt: skip
            yield pandas.DataFrame(cells)


def _cells(one: xarray.DataArray, dims: tuple[str, ...], shape: tuple[int, ...]) -> NDArray[Any]:
    """The values of the rows, None where there is none."""
    own = one.transpose(*(dim for dim in dims if dim in one.dims))
    values = own.values.reshape([size if dim in own.dims else 1 for dim, size in zip(dims, shape, strict=True)])
    values = np.broadcast_to(values, shape).ravel().astype(object)
    if "flag_meanings" in one.attrs:
        codes = np.atleast_1d(one.attrs["flag_values"]).tolist()
        words = dict(zip(codes, one.attrs["flag_meanings"].split(), strict=True))
        return np.array([words.get(value) for value in values], dtype=object)
    least = one.attrs.get("valid_min")
    missing = values != values if one.dtype.kind == "f" else values < least if least is not None else []
    values[np.flatnonzero(missing)] = None
    return values
