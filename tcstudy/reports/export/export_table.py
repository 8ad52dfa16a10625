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

import csv
import json
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import IO, Any

import netCDF4
import numpy as np

from tcstudy.data.files import check_writable, replace_file
from tcstudy.data.provenance import kind_of, remarks_of
from tcstudy.data.reading import reading
from tcstudy.data.store import open_root
from tcstudy.errors import StoreError, UsageError
from tcstudy.reports.select_point import Value, matching

Row = tuple[Any, ...]
StoredColumn = tuple[netCDF4.Variable, int | None]
"""A variable, and which of its last dimension if that is not one of the rows."""
VALUES = 2**18
"""Values that are in memory at a time."""
ROWS = {"path": "vertex", "fit": "row"}
"""Dimension of the rows where there is no status, by the kind of the file."""
LABELLED = ("start", "solver", "run")
"""Dimensions after those of the rows whose every label makes a column of its own."""


def write_table(path: Path, target: Path, point: Mapping[str, Value] | None = None) -> int:
    """Write the table, replacing an old file in one step; returns its rows.

    target: a .csv (RFC 4180, UTF-8, a header line), or a .json with one object: `title`, `kind`, `warnings`, `units` by
            column, and `rows`, a list of objects, one a line, in which what is not finite is "inf", "-inf" or null
    point:  labels of swept parameters; only the points that have them

    Raises StoreError, DrawError, UsageError.
    """
    if faults := check_writable(target):
        raise StoreError("; ".join(faults))
    kind, written = kind_of(path), 0
    if point and kind in (*ROWS, "cost"):
        raise UsageError(f"--at: the file of tcstudy {kind} has one scene and no sweep points; leave it out")
    wanted = None
    with reading(path), netCDF4.Dataset(path) as nc:
        if point:
            with open_root(path) as root:
                wanted = matching(root, point)
        nc.set_auto_mask(False)
        dims = nc["status"].dimensions if "status" in nc.variables else (ROWS[kind],)
        columns, sizes = _columns(nc, dims), [nc.dimensions[dim].size for dim in dims]
        units = {name: str(getattr(one, "units", "1")) for name, (one, _) in columns.items()}
        about = {"title": nc.title, "kind": kind, "warnings": [*map(asdict, remarks_of(nc.__dict__))]}
        write = _csv if target.suffix == ".csv" else _json

        def make(aside: Path) -> None:
            nonlocal written
            with open(aside, "w", encoding="utf-8", newline="") as stream:
                for rows in _rows(columns, dims, sizes, wanted):
                    write(stream, rows, units, None if written else about)
                    written += len(rows)
                stream.write("" if target.suffix == ".csv" else "\n]}\n")

        replace_file(target, make, sealed=False)
    return written


def _csv(stream: IO[str], rows: Sequence[Row], units: Mapping[str, str], about: Mapping[str, Any] | None) -> None:
    writer = csv.writer(stream, lineterminator="\n")
    if about is not None:
        writer.writerow([name if unit in ("", "1") else f"{name} [{unit}]" for name, unit in units.items()])
    writer.writerows(rows)


def _json(stream: IO[str], rows: Sequence[Row], units: Mapping[str, str], about: Mapping[str, Any] | None) -> None:
    if about is not None:
        stream.write(f'{json.dumps({**about, "units": units}, ensure_ascii=False)[:-1]}, "rows": [\n')
    finite = ([str(cell) if cell in (math.inf, -math.inf) else cell for cell in row] for row in rows)
    texts = (json.dumps(dict(zip(units, row, strict=True)), ensure_ascii=False, allow_nan=False) for row in finite)
    stream.write(",\n" * (about is None) + ",\n".join(texts))


def _columns(nc: netCDF4.Dataset, dims: tuple[str, ...]) -> dict[str, StoredColumn]:
    """What has a value a row, in the order of the file, or several with a label each."""
    found: dict[str, StoredColumn] = {}
    for name, one in nc.variables.items():
        own = one.dimensions
        more = own[-1] if len(own) > 1 and own[-1] in LABELLED and own[-1] not in dims else None
        if own and {*own} - {more} <= {*dims}:
            labels = nc[more][...].tolist() if more else ()
            found |= {f"{name}.{label}": (one, i) for i, label in enumerate(labels)} if more else {name: (one, None)}
    return found


def _rows(
    columns: Mapping[str, StoredColumn], dims: tuple[str, ...], sizes: Sequence[int], wanted: Any
) -> Iterator[list[Row]]:
    """Rows in C order of their index, some thousand at a time; the last dimension of a run's is the level."""
    inner = math.prod(sizes[1:])
    step = max(1, VALUES // len(columns) // inner)
    for start in range(0, sizes[0], step):
        shape = dict(zip(dims, (min(step, sizes[0] - start), *sizes[1:]), strict=True))
        index = np.arange(start * inner, start * inner + math.prod(shape.values()))
        kept = slice(None) if wanted is None else wanted[index // sizes[-1]]
        if rows := list(zip(*(_cells(one, shape, start, kept) for one in columns.values()), strict=True)):
            yield rows


def _cells(column: StoredColumn, shape: Mapping[str, int], start: int, kept: Any) -> list[Any]:
    """The values of a column in the rows that are kept, flags as words; None where there is none.

    shape: of the rows, of which the first dimension begins at `start`
    """
    (one, label), (first, *_) = column, shape
    cut = [
        slice(start, start + shape[first]) if dim == first else slice(None) for dim in one.dimensions if dim in shape
    ]
    array = np.asarray(one[(*cut, *([] if label is None else [label]))])
    array = array.reshape([size if dim in one.dimensions else 1 for dim, size in shape.items()])
    values: list[Any] = np.broadcast_to(array, tuple(shape.values())).ravel()[kept].tolist()
    if "flag_meanings" in one.ncattrs():
        words = dict(zip(np.atleast_1d(one.flag_values).tolist(), one.flag_meanings.split(), strict=True))
        return [words.get(value) for value in values]
    if array.dtype.kind == "f":
        return [None if value != value else value for value in values]
    least = getattr(one, "valid_min", None)
    return values if least is None else [None if value < least else value for value in values]
