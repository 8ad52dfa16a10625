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
from collections.abc import Iterator, Mapping
from dataclasses import asdict
from pathlib import Path
from typing import IO, TYPE_CHECKING, Any

import numpy as np

from tcstudy.data.files import check_writable, replace_file
from tcstudy.data.provenance import kind_of, remarks_of
from tcstudy.data.reading import reading
from tcstudy.data.store import open_root
from tcstudy.errors import StoreError, UsageError
from tcstudy.reports.select_point import Value, matching

if TYPE_CHECKING:
    import pandas

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
                for frame in _frames(columns, dims, sizes, wanted):
                    write(stream, frame, {**about, "units": units}, not written)
                    written += len(frame)
                stream.write("" if target.suffix == ".csv" else "\n]}\n")

        replace_file(target, make, sealed=False)
    return written


def _csv(stream: IO[str], frame: pandas.DataFrame, about: Mapping[str, Any], first: bool) -> None:
    titles = [name if unit in ("", "1") else f"{name} [{unit}]" for name, unit in about["units"].items()]
    frame.to_csv(stream, header=titles if first else False, index=False, lineterminator="\n")


def _json(stream: IO[str], frame: pandas.DataFrame, about: Mapping[str, Any], first: bool) -> None:
    if first:
        stream.write(f'{json.dumps(about, ensure_ascii=False)[:-1]}, "rows": [\n')
    whole = frame.astype(object).where(frame.notna(), None).replace({math.inf: "inf", -math.inf: "-inf"})
    rows = (json.dumps(row, ensure_ascii=False, allow_nan=False) for row in whole.to_dict("records"))
    stream.write(("" if first else ",\n") + ",\n".join(rows))


def _columns(data: Any, dims: tuple[str, ...]) -> dict[str, Any]:
    """The variables that have a value a row, coordinates first, or several with a label each."""
    found = dict[str, Any]()
    for name, one in ((name, data.variables[name]) for name in (*data.coords, *data.data_vars)):
        more = one.dims[-1] if len(one.dims) > 1 and one.dims[-1] in LABELLED and one.dims[-1] not in dims else None
        if one.dims and {*one.dims} - {more} <= {*dims}:
            labels = data[more].values if more else ()
            found |= {f"{name}.{label}": one[..., i] for i, label in enumerate(labels)} if more else {name: one}
    return found


def _frames(columns: Mapping[str, Any], dims: tuple[str, ...], sizes: list[int], wanted: Any) -> Iterator[Any]:
    """Rows in C order of their index, some thousand at a time; the last dimension of a run's is the level."""
    import pandas

    step = max(1, VALUES // len(columns) // math.prod(sizes[1:]))
    for start in range(0, sizes[0], step):
        shape = dict(zip(dims, (min(step, sizes[0] - start), *sizes[1:]), strict=True))
        cells = {name: _cells(one.isel({dims[0]: slice(start, start + step)}, missing_dims="ignore"), shape)
                 for name, one in columns.items()}  # fmt: skip
        frame = pandas.DataFrame(cells, copy=False)
        if wanted is not None:
            frame = frame[wanted[(start * math.prod(sizes[1:]) + np.arange(len(frame))) // sizes[-1]]]
        if len(frame):
            yield frame


def _cells(one: Any, shape: Mapping[str, int]) -> Any:
    """The values of a variable in all rows; flags as words, counts that there are not as NA."""
    import pandas

    values, attrs = one.set_dims(shape).transpose(*shape).values.ravel(), one.attrs
    if "flag_meanings" in attrs:
        words = dict(zip(np.atleast_1d(attrs["flag_values"]).tolist(), attrs["flag_meanings"].split(), strict=True))
        return pandas.Series(values).map(words)
    if "valid_min" in attrs:
        return pandas.arrays.IntegerArray(values.astype("i8"), values < attrs["valid_min"])
    return values
