"""A result file as one table, for spreadsheets, pandas and R, with a row a point and level; or as one JSON object.

Rows are those of the result file's `status`: of a run and of its convergence every point on every level, of cost every
family, solver and level, of a history every point and step; of a path they are the vertices, of a fit the data. Every
variable of the root that has a value a row is a column `name [unit]`, of one with several (by start, by solver) each is
one, `start_energy.zero [J m-1]`. Numbers are written so that reading gives them back to the bit; flags are their words;
what is missing is an empty field, or null. The table goes through memory some thousand rows at a time. Left out: what
lies along the contact line and in the body (`fields`), and of a path what is no number of a vertex.

The object has every variable by its name, lists within lists along its dimensions.
"""

from __future__ import annotations

import json
import math
from collections.abc import Iterator, Mapping
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from tcstudy.data.files import WARNINGS, check_writable, kind_of, reading, remarks_of, replace_file
from tcstudy.data.reading import load_root, open_root
from tcstudy.errors import StoreError, UsageError
from tcstudy.reports.page.parts import Json, flag_words, plain
from tcstudy.reports.select_point import Value, matching
from tcstudy.reports.terminal.summary import verdict_of

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
    kind, written, as_csv = kind_of(path), 0, target.suffix == ".csv"
    if point and kind in (*ROWS, "cost"):
        raise UsageError(f"--at: the file of tcstudy {kind} has one scene and no sweep points; leave it out")
    with reading(path), open_root(path) as root:
        wanted = matching(root, point) if point else None
        dims = tuple(map(str, root["status"].dims)) if "status" in root else (ROWS[kind],)
        columns = _columns(root, dims)
        units = {name: str(one.attrs.get("units", "1")) for name, one in columns.items()}
        heads = [name if unit in ("", "1") else f"{name} [{unit}]" for name, unit in units.items()]
        about = {"title": root.title, "kind": kind, "warnings": [*map(asdict, remarks_of(root.attrs))], "units": units}

        def make(aside: Path) -> None:
            nonlocal written
            with open(aside, "w", encoding="utf-8", newline="") as stream:
                if not as_csv:
                    stream.write(f'{json.dumps(about, ensure_ascii=False)[:-1]}, "rows": [')
                for frame in _frames(columns, {dim: root.sizes[dim] for dim in dims}, wanted):
                    if as_csv:
                        frame.to_csv(stream, header=heads if written == 0 else False, index=False, lineterminator="\n")
                    else:
                        rows = (dict(zip(units, row, strict=True)) for row in frame.itertuples(index=False, name=None))
                        stream.write("\n" if written == 0 else ",\n")
                        stream.write(",\n".join(map(json_text, rows)))
                    written += len(frame)
                stream.write("" if as_csv else "\n]}\n")

        replace_file(target, make, sealed=False)
    return written


def _columns(root: Any, dims: tuple[str, ...]) -> dict[str, Any]:
    """What has a value a row, in the order of the file, or several with a label each."""
    found = dict[str, Any]()
    for name, one in ((name, root.variables[name]) for name in (*root.coords, *root.data_vars)):
        more = one.dims[-1] if len(one.dims) > 1 and one.dims[-1] in LABELLED and one.dims[-1] not in dims else None
        if one.dims and {*one.dims} - {more} <= {*dims}:
            labels = root[more].values.tolist() if more else ()
            found |= {f"{name}.{label}": one[..., i] for i, label in enumerate(labels)} if more else {str(name): one}
    return found


def _frames(columns: Mapping[str, Any], sizes: Mapping[str, int], wanted: Any) -> Iterator[pandas.DataFrame]:
    """Rows in C order of their index, some thousand at a time; the last dimension of a run's is the level."""
    import pandas

    (first, count), (*_, last) = next(iter(sizes.items())), sizes.values()
    inner = math.prod([*sizes.values()][1:])
    step = max(1, VALUES // len(columns) // inner)
    for start in range(0, count, step):
        shape, cut = {**sizes, first: min(step, count - start)}, {first: slice(start, start + step)}
        kept = slice(None) if wanted is None else np.repeat(wanted, last)[start * inner : (start + step) * inner]
        parts = {name: one.isel(cut, missing_dims="ignore") for name, one in columns.items()}
        frame = pandas.DataFrame({name: _cells(one, shape, kept) for name, one in parts.items()})
        if len(frame):
            yield frame


def _cells(one: Any, shape: Mapping[str, int], kept: Any) -> Any:
    """Values of a variable in the rows that are kept, None for what is missing of whole numbers."""
    values = flag_words(one, one.set_dims(shape).transpose(*shape).values.ravel()[kept])
    least = None if values.dtype.kind == "f" else one.attrs.get("valid_min")
    return values if least is None else np.where(values >= least, values.astype(object), None)


def brief(path: Path) -> dict[str, Json]:
    """The object that --json prints; its `verdict` is the sentence of --quiet. Raises StoreError."""
    kind, data = kind_of(path), load_root(path)
    told = {name: plain(value) for name, value in data.attrs.items() if name not in ("title", WARNINGS)}
    every = ((str(name), data.variables[name]) for name in (*data.coords, *data.data_vars))
    values = {name: one for name, one in every if "node" not in one.dims}
    return {
        "kind": kind,
        "file": str(path),
        "title": str(data.attrs["title"]),
        "warnings": [*map(asdict, remarks_of(data.attrs))],
        "verdict": verdict_of(path)[0],
        "attributes": told,
        "units": {name: str(one.attrs["units"]) for name, one in values.items() if "units" in one.attrs},
        "dimensions": {name: one.dims for name, one in values.items()},
        "values": {name: flag_words(one, one.values).tolist() for name, one in values.items()},
    }


def json_text(value: Json) -> str:
    """One line of JSON; numbers that there are not are null."""
    return json.dumps(plain(value), ensure_ascii=False, allow_nan=False)
