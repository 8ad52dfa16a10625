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
from collections.abc import Iterator, Mapping
from dataclasses import asdict
from itertools import chain
from pathlib import Path
from typing import IO, TYPE_CHECKING, Any

import numpy as np

from tcstudy.data.files import check_writable, replace_file
from tcstudy.data.provenance import kind_of, remarks_of
from tcstudy.data.reading import attributes, reading
from tcstudy.data.store import open_results
from tcstudy.data.writer import CHUNK
from tcstudy.errors import StoreError, UsageError
from tcstudy.reports.select_point import Value, matching

if TYPE_CHECKING:
    import netCDF4

VALUES = 2**18
"""Values that are in memory at a time."""
Row = tuple[Any, ...]
StoredColumn = tuple["netCDF4.Variable", int | None]
"""A variable, and which of its last dimension if that is not one of the rows."""
ROWS = {"path": "vertex", "fit": "row"}
"""Dimension of the rows where there is no status, by the kind of the file."""
LABELLED = ("start", "solver", "run")
"""Dimensions after those of the rows whose every label makes a column of its own."""


def write_csv(path: Path, target: Path, point: Mapping[str, Value] | None = None) -> int:
    """Write the table as CSV (RFC 4180, UTF-8, a header line), replacing an old file in one step; returns its rows.

    point: labels of swept parameters; only the points that have them. Raises StoreError, DrawError, UsageError.
    """

    def fill(stream: IO[str], blocks: Iterator[list[Row]], units: Mapping[str, str], _: object) -> int:
        writer, written = csv.writer(stream, lineterminator="\n"), 0
        writer.writerow([name if unit in ("", "1") else f"{name} [{unit}]" for name, unit in units.items()])
        for rows in blocks:
            writer.writerows(rows)
            written += len(rows)
        return written

    return _write(path, target, point, fill)


def write_json(path: Path, target: Path, point: Mapping[str, Value] | None = None) -> int:
    """Write the table as one JSON object, replacing an old file in one step; returns its rows.

    It has `title`, `kind`, `warnings`, `units` by column, and `rows`: a list of objects, one a line. What is not finite
    is a text, "inf" or "-inf", or null.
    """

    def fill(stream: IO[str], blocks: Iterator[list[Row]], units: Mapping[str, str], about: Any) -> int:
        head, written = json.dumps({**about, "units": units}, ensure_ascii=False), 0
        stream.write(f'{head[:-1]}, "rows": [')
        for row in chain.from_iterable(blocks):
            finite = (str(cell) if cell in (math.inf, -math.inf) else cell for cell in row)
            text = json.dumps(dict(zip(units, finite, strict=True)), ensure_ascii=False, allow_nan=False)
            stream.write(f"{',' if written else ''}\n{text}")
            written += 1
        stream.write("\n]}\n")
        return written

    return _write(path, target, point, fill)


def _write(path: Path, target: Path, point: Mapping[str, Value] | None, fill: Any) -> int:
    """Open the result file, put what `fill` makes of its rows into the target; returns the number of rows."""
    import netCDF4

    if faults := check_writable(target):
        raise StoreError("; ".join(faults))
    written = 0
    with reading(path):
        kind = kind_of(path)
        if point and kind in (*ROWS, "cost"):
            raise UsageError(f"--at: the file of tcstudy {kind} has one scene and no sweep points; leave it out")
        wanted = None
        if point:
            with open_results(path) as tree:
                wanted = matching(tree.to_dataset(), point)
        with netCDF4.Dataset(path) as nc:
            nc.set_auto_mask(False)
            dims = nc["status"].dimensions if "status" in nc.variables else (ROWS[kind],)
            columns = _columns(nc, dims)
            units = {name: str(getattr(one, "units", "1")) for name, (one, _) in columns.items()}
            remarks = [asdict(one) for one in remarks_of(attributes(path))]
            about = {"title": str(nc.getncattr("title")), "kind": kind, "warnings": remarks}

            def make(aside: Path) -> None:
                nonlocal written
                with open(aside, "w", encoding="utf-8", newline="") as stream:
                    written = fill(stream, _rows(nc, dims, columns, wanted), units, about)

            replace_file(target, make, sealed=False)
    return written


def _columns(nc: netCDF4.Dataset, dims: tuple[str, ...]) -> dict[str, StoredColumn]:
    """What has a value a row, in the order of the file."""
    found: dict[str, StoredColumn] = {}
    for name, one in nc.variables.items():
        own = one.dimensions
        more = own[-1] if len(own) > 1 and own[-1] in LABELLED and own[-1] not in dims else None
        held = own[:-1] if more else own
        if not held or not set(held) <= set(dims):
            continue
        if one.chunking() not in (None, "contiguous"):
            one.set_var_chunk_cache(size=2 * CHUNK)  # the library's own may grow to 16 MB a variable
        labels = nc[more][...].tolist() if more else []
        found |= {f"{name}.{label}": (one, i) for i, label in enumerate(labels)} if more else {name: (one, None)}
    return found


def _rows(
    nc: netCDF4.Dataset, dims: tuple[str, ...], columns: Mapping[str, StoredColumn], wanted: Any
) -> Iterator[list[Row]]:
    """Rows in C order of the index, some thousand at a time; the last dimension of a run's is the level."""
    sizes = [int(nc.dimensions[dim].size) for dim in dims]
    inner = math.prod(sizes[1:])
    step = max(1, VALUES // len(columns) // inner)
    for start in range(0, sizes[0], step):
        cut = slice(start, min(start + step, sizes[0]))
        index = np.arange(cut.start * inner, cut.stop * inner)
        kept = slice(None) if wanted is None else wanted[index // sizes[-1]]
        yield list(zip(*(_cells(one, dims, cut, sizes, kept) for one in columns.values()), strict=True))


def _cells(stored: StoredColumn, dims: tuple[str, ...], cut: slice, sizes: list[int], kept: Any) -> list[Any]:
    """The values of the rows that are kept, None where there is none."""
    one, last = stored
    where = tuple(cut if dim == dims[0] else slice(None) for dim in one.dimensions if dim in dims)
    array = np.asarray(one[where if last is None else (*where, last)])
    shape = [cut.stop - cut.start, *sizes[1:]]
    array = array.reshape([size if dim in one.dimensions else 1 for dim, size in zip(dims, shape, strict=True)])
    values = np.broadcast_to(array, shape).ravel()[kept].tolist()
    if "flag_meanings" in one.ncattrs():
        words = dict(zip(np.atleast_1d(one.flag_values).tolist(), one.flag_meanings.split(), strict=True))
        return [words.get(value) for value in values]
    if array.dtype.kind == "f":
        return [None if value != value else value for value in values]
    least = getattr(one, "valid_min", None)
    return values if least is None else [None if value < least else value for value in values]
