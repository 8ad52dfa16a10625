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
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import IO, TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from tcstudy.data.files import check_writable, replace_file
from tcstudy.data.provenance import kind_of, remarks_of
from tcstudy.data.reading import attributes, reading
from tcstudy.data.store import open_results
from tcstudy.data.writer import CHUNK, tile_shape, tiles
from tcstudy.errors import StoreError, UsageError
from tcstudy.reports.page.container import plain
from tcstudy.reports.select_point import Value, matching

if TYPE_CHECKING:
    import netCDF4

VALUES = 2**18
"""Values that are in memory at a time."""
ROWS = {"path": "vertex", "fit": "row"}
"""Dimension of the rows where there is no status, by the kind of the file."""
LABELLED = ("start", "solver", "run")
"""Dimensions after those of the rows whose every label makes a column of its own."""

Row = list[Any]


@dataclass(frozen=True)
class TableColumn:
    """One column: its name, units, and where its values are: a variable, and which of its last dimension if any."""

    name: str
    units: str
    variable: netCDF4.Variable
    last: int | None = None

    def values(self, dims: tuple[str, ...], cut: tuple[slice, ...]) -> Row:
        """The values of the rows in a tile of the index, None where there is none."""
        own = [d for d in dims if d in self.variable.dimensions]
        where = dict(zip(dims, cut, strict=True))
        picked: tuple[Any, ...] = tuple(where[d] for d in own)
        array = np.asarray(self.variable[picked if self.last is None else (*picked, self.last)])
        sizes = [s.stop - s.start for s in cut]
        array = array.reshape([size if d in own else 1 for d, size in zip(dims, sizes, strict=True)])
        return self._plain(np.broadcast_to(array, sizes).ravel())

    def _plain(self, values: NDArray[Any]) -> Row:
        held = self.variable
        if "flag_meanings" in held.ncattrs():
            words = dict(zip(np.atleast_1d(held.flag_values).tolist(), held.flag_meanings.split(), strict=True))
            return [words.get(value) for value in values.tolist()]
        if values.dtype.kind == "f":
            return [None if value != value else value for value in values.tolist()]
        least = getattr(held, "valid_min", None)
        return [None if least is not None and value < least else value for value in values.tolist()]


def write_csv(path: Path, target: Path, point: Mapping[str, Value] | None = None) -> int:
    """Write the table as CSV (RFC 4180, UTF-8, a header line), replacing an old file in one step; returns its rows.

    point: labels of swept parameters; only the points that have them. Raises StoreError, DrawError, UsageError.
    """

    def fill(stream: IO[str], columns: list[TableColumn], rows: Iterable[Row], _: Mapping[str, Any]) -> None:
        writer = csv.writer(stream, lineterminator="\n")
        writer.writerow(
            [column.name if column.units in ("", "1") else f"{column.name} [{column.units}]" for column in columns]
        )
        writer.writerows(rows)

    return _write(path, target, point, fill)


def write_json(path: Path, target: Path, point: Mapping[str, Value] | None = None) -> int:
    """Write the table as one JSON object, replacing an old file in one step; returns its rows.

    It has `title`, `kind`, `warnings`, `units` by column, and `rows`: a list of objects, one a line. Numbers are finite
    or null.
    """

    def fill(stream: IO[str], columns: list[TableColumn], rows: Iterable[Row], about: Mapping[str, Any]) -> None:
        units = {column.name: column.units for column in columns}
        head = json.dumps({**about, "units": units}, ensure_ascii=False)
        stream.write(f'{head[:-1]}, "rows": [')
        for i, row in enumerate(rows):
            text = json.dumps(plain(dict(zip(units, row, strict=True))), ensure_ascii=False, allow_nan=False)
            stream.write(f"{',' if i else ''}\n{text}")
        stream.write("\n]}\n")

    return _write(path, target, point, fill)


def _write(path: Path, target: Path, point: Mapping[str, Value] | None, fill: Any) -> int:
    """Open the result file, put what `fill` makes of it into the target; returns the number of rows."""
    import netCDF4

    if faults := check_writable(target):
        raise StoreError("; ".join(faults))
    written = 0
    with reading(path):
        kind = kind_of(path)
        wanted = _wanted(path, kind, point)
        with netCDF4.Dataset(path) as nc:
            nc.set_auto_mask(False)
            remarks = remarks_of(attributes(path))
            about = {"title": str(nc.getncattr("title")), "kind": kind, "warnings": [asdict(one) for one in remarks]}
            dims = nc["status"].dimensions if "status" in nc.variables else (ROWS[kind],)
            columns = _columns(nc, dims)

            def rows() -> Iterator[Row]:
                nonlocal written
                for row in _rows(nc, dims, columns, wanted):
                    yield row
                    written += 1

            def make(aside: Path) -> None:
                with open(aside, "w", encoding="utf-8", newline="") as stream:
                    fill(stream, columns, rows(), about)

            replace_file(target, make, sealed=False)
    return written


def _wanted(path: Path, kind: str, point: Mapping[str, Value] | None) -> NDArray[np.bool_] | None:
    """(points,) those that were asked for; None for all."""
    if not point:
        return None
    if kind in (*ROWS, "cost"):
        raise UsageError(f"--at: the file of tcstudy {kind} has one scene and no sweep points; leave it out")
    with open_results(path) as tree:
        return matching(tree.to_dataset(), point)


def _columns(nc: netCDF4.Dataset, dims: tuple[str, ...]) -> list[TableColumn]:
    """What has a value a row, in the order of the file."""
    found = []
    for name, variable in nc.variables.items():
        own = variable.dimensions
        more = own[-1] if own and own[-1] in LABELLED and own[-1] not in dims and own[:-1] else None
        held = own[:-1] if more else own
        if not held or not set(held) <= set(dims):
            continue
        if variable.chunking() not in (None, "contiguous"):
            variable.set_var_chunk_cache(size=2 * CHUNK)  # the library's own may grow to 16 MB a variable
        units = str(getattr(variable, "units", "1"))
        if more:
            labels = nc[more][...].tolist()
            found += [TableColumn(f"{name}.{label}", units, variable, i) for i, label in enumerate(labels)]
        else:
            found.append(TableColumn(name, units, variable))
    return found


def _rows(
    nc: netCDF4.Dataset, dims: tuple[str, ...], columns: list[TableColumn], wanted: NDArray[np.bool_] | None
) -> Iterator[Row]:
    """Rows in C order of the index; the last dimension of a run's is the level."""
    shape = tuple(int(nc.dimensions[d].size) for d in dims)
    for cut, start, stop in tiles(shape, tile_shape(shape, max(1, VALUES // len(columns)))):
        kept = None if wanted is None else wanted[np.arange(start, stop) // shape[-1]]
        if kept is not None and not kept.any():
            continue
        lists = [column.values(dims, cut) for column in columns]
        for i, row in enumerate(zip(*lists, strict=True)):
            if kept is None or kept[i]:
                yield list(row)
