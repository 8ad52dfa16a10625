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

import numpy as np

from tcstudy.data.files import check_writable, replace_file
from tcstudy.data.provenance import kind_of, remarks_of
from tcstudy.data.reading import reading
from tcstudy.data.store import open_root
from tcstudy.errors import StoreError, UsageError
from tcstudy.reports.select_point import Value, matching

Row = tuple[Any, ...]
VALUES = 2**20
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
    with reading(path), open_root(path) as root:
        dims = tuple(map(str, root["status"].dims)) if "status" in root else (ROWS[kind],)
        columns = _columns(root, dims)
        units = {name: str(one.attrs.get("units", "1")) for name, one in columns.items()}
        about = {"title": root.attrs["title"], "kind": kind, "warnings": [*map(asdict, remarks_of(root.attrs))]}
        sizes, wanted = [root.sizes[dim] for dim in dims], matching(root, point) if point else None
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


def _columns(data: Any, dims: tuple[str, ...]) -> dict[str, Any]:
    """The variables that have a value a row, coordinates first, or several with a label each."""
    found = dict[str, Any]()
    for name, one in ((name, data.variables[name]) for name in (*data.coords, *data.data_vars)):
        more = one.dims[-1] if len(one.dims) > 1 and one.dims[-1] in LABELLED and one.dims[-1] not in dims else None
        if one.dims and {*one.dims} - {more} <= {*dims}:
            labels = data[more].values if more else ()
            found |= {f"{name}.{label}": one[..., i] for i, label in enumerate(labels)} if more else {name: one}
    return found


def _rows(columns: Mapping[str, Any], dims: tuple[str, ...], sizes: Sequence[int], wanted: Any) -> Iterator[list[Row]]:
    """Rows in C order of their index, some thousand at a time; the last dimension of a run's is the level."""
    inner = math.prod(sizes[1:])
    step = max(1, VALUES // len(columns) // inner)
    for start in range(0, sizes[0], step):
        shape = dict(zip(dims, (min(step, sizes[0] - start), *sizes[1:]), strict=True))
        index = np.arange(start * inner, start * inner + math.prod(shape.values()))
        kept = slice(None) if wanted is None else np.flatnonzero(wanted[index // sizes[-1]])
        cut = {dims[0]: slice(start, start + step)}
        cells = (_cells(one.isel(cut, missing_dims="ignore"), shape, kept) for one in columns.values())
        if rows := list(zip(*cells, strict=True)):
            yield rows


def _cells(one: Any, shape: Mapping[str, int], kept: Any) -> list[Any]:
    """The values of a variable in the rows that are kept, flags as words; None where there is none."""
    array, attrs = one.set_dims(shape).transpose(*shape).values.ravel()[kept], one.attrs
    values: list[Any] = array.tolist()
    if "flag_meanings" in attrs:
        words = dict(zip(np.atleast_1d(attrs["flag_values"]).tolist(), attrs["flag_meanings"].split(), strict=True))
        return [words.get(value) for value in values]
    if array.dtype.kind == "f":
        return [None if value != value else value for value in values]
    least = attrs.get("valid_min")
    return values if least is None else [None if value < least else value for value in values]
