"""A result file for other programs: its fields for ParaView, or one table, or one JSON object.

Fields: every sweep point's body (VTU) and contact line (VTP), and one PVD for the sweep.

The body has the displacement u and the temperature theta at its nodes, as stored, and in its
triangles, where the strain ε of P1 elements is constant,

    σ = cε − βθI (eq. (3) of the paper, θ the mean of the corners),   w = ½ σ : c⁻¹ σ,   von Mises' stress √(3/2 s : s)

with σ_zz = λ tr ε − βθ in plane strain and 0 in plane stress; c, β are those of the point. The
contact line has u_T, xi = −S_T, c and what every node does. Time in the PVD is the number of the
point in the sweep, in the order of the file; parameters stand in the names and, in full, in the
field data of every file.

Left out: jumps of the stress between elements (no averaging); the ends of a line without unknown.

The XML format of VTK 1.0 with compressed arrays in base64 (docs.vtk.org, "VTK File Formats") needs
three elements and one way to write an array; libraries that write more (vtk: 100 MB; meshio: no
lines, no units of arrays, no collections) are needed to read the files, not to make them.

The table has a row a point and level, those of the file's `status`: of cost every family, solver
and level, of a history every point and step; of a path rows are the vertices, of a fit the data.
Every variable of the root that has a value a row is a column `name [unit]`, of one with several (by
start, by solver) each is one. Numbers are written so that reading gives them back to the bit; flags
are their words; what is missing is an empty field, or null. The object has every variable by its
name, lists within lists along its dimensions.
"""

from __future__ import annotations

import base64
import json
import math
import re
import zlib
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any
from xml.sax.saxutils import quoteattr

import numpy as np
from numpy.typing import NDArray

from tcstudy.data.bodies import StoredBody
from tcstudy.data.files import (
    WARNINGS,
    check_writable,
    kind_from,
    kind_of,
    reading,
    remarks_of,
    replace_file,
)
from tcstudy.data.reading import by_point, load_root, open_root, unmasked
from tcstudy.data.schema import LAYER, SECTION, STICKS, PointStatus
from tcstudy.errors import StoreError, UsageError
from tcstudy.reports.json_values import Json, flag_words, json_text, json_value
from tcstudy.reports.picture import (
    body_fields,
    contact_line,
    states_of,
    stresses,
    von_mises,
)
from tcstudy.reports.rounding import stored_study
from tcstudy.reports.select_point import (
    Value,
    chosen_geometry,
    labels_by_point,
    level_number,
    matching,
)
from tcstudy.reports.terminal.summary import verdict_of
from tcstudy.reports.text import counted
from tcstudy.scene.histories import ContactState
from tcstudy.scene.records import Scene

if TYPE_CHECKING:
    import pandas


HOW = "run its study again with --set output.fields=true to keep them"
BODY, LINE = 0, 1
LONGEST = 120
"""Characters of a file's name: more parameters than that are in the file alone."""


@dataclass(frozen=True)
class Exported:
    """What was written: the PVD, how many points it has, and what is missing, a sentence each."""

    path: Path
    points: int
    lacks: tuple[str, ...]


def write_fields(
    path: Path, folder: Path, point: Mapping[str, Value] | None = None, level: int = -1
) -> Exported:
    """Write the fields of a run's points on one level into a folder; the PVD comes last.

    point: labels of swept parameters, only the points that have them; of several geometries they name one
    level: −1 is the finest

    Raises StoreError if `path` is no result file or a file cannot be written, DrawError for a point
    or level that there is not, UsageError for a file of another kind or several geometries.
    """
    if (kind := kind_of(path)) != "run":
        raise UsageError(
            f"--vtu: {path} is a file of tcstudy {kind} and has no fields; name that of a run"
        )
    with reading(path):
        with open_root(path) as root:
            n = level_number(root, level)
            wanted = matching(root, point or {})
            geometry = chosen_geometry(root, wanted, f"--vtu: {path}", "--at ")
            labels = labels_by_point(root)
            units = {name: str(root[name].attrs.get("units", "1")) for name in labels}
            solved = by_point(root["status"], root)[:, n] == PointStatus.OK
        with unmasked(path) as nc:
            body = StoredBody.of(nc, geometry) if geometry >= 0 else None
            if body is None or n not in body.levels:
                raise UsageError(
                    f"--vtu: {path} has no mesh of level {n}; see the reasons with: tcstudy show"
                )
            study = stored_study(body.about)
            files: list[tuple[int, int, str, str]] = []
            for own_point, i in enumerate(body.places):
                if not (wanted[i] and solved[i]):
                    continue
                scene = None if study is None else study.scenes[own_point]
                labelled = [(name, array[i].item(), units[name]) for name, array in labels.items()]
                group = body.dataset(n, body.cut(own_point))
                files += _write_point(path.stem, folder, int(i), labelled, group, scene)
            has_fields = "u_x" in body.group(n).variables
        pvd = folder / f"{path.stem}.pvd"
        write_collection(pvd, files)
    lacks = []
    if not has_fields:
        lacks.append(
            f"the file has no fields of the body, so only contact lines were written; {HOW}"
        )
    elif study is None:
        lacks.append(
            "the study in the file cannot be read by this version, so stresses are left out"
        )
    if missing := int(np.count_nonzero(wanted & ~solved)):
        lacks.append(
            f"{missing} of {np.count_nonzero(wanted)} points have no solution on level {n}"
        )
    return Exported(pvd, int(np.count_nonzero(wanted & solved)), tuple(lacks))


def _write_point(
    stem: str,
    folder: Path,
    i: int,
    point: list[tuple[str, float | str, str]],
    group: Any,
    scene: Scene | None,
) -> Iterator[tuple[int, int, str, str]]:
    name, line = _file_name(f"{stem}_{i:04d}", point), contact_line(group)
    about = [
        Values(key, label if isinstance(label, str) else np.array([label]), unit)
        for key, label, unit in point
    ]

    def stored(name: str, title: str = "") -> Values:
        return Values(title or name, group[name].values, str(group[name].attrs.get("units", "1")))

    if (body := body_fields(group)) is not None:
        u = np.column_stack([body.u, np.zeros(len(body.u))])
        fields = [Values("u", u, stored("u_x").units, ("x", "y", "z"))]
        fields += [stored("theta")] if body.theta is not None else []
        cells: list[Values] = []
        if scene is not None:
            sigma, energy = stresses(body, scene.material)
            pressure = stored("xi").units
            cells += [
                Values("stress", sigma, pressure, SYMMETRIC),
                Values("von_mises", von_mises(sigma), pressure),
            ]
            cells += [Values("energy_density", energy, "1" if pressure == "1" else "J m-3")]
            cells += [stored("region")] if "region" in group else []
        write_vtk(folder / f"{name}.vtu", body.xy, body.triangles, fields, cells, about)
        yield i, BODY, "body", f"{name}.vtu"
    sticks = group["sticks"].values == STICKS
    states = states_of(
        None if scene is None else scene.friction, group, group["u_T"].values, sticks
    )
    chains = [
        np.append(
            np.arange(part.start, part.stop), [part.start] if line.closed(part) else []
        ).astype(np.intp)
        for part in line.parts
    ]
    forces = [
        str(one) for one in group.data_vars if one == SECTION.name or str(one).startswith(LAYER)
    ]
    names = ("u_T", "xi", *forces, "arclength", "c")
    fields = [*map(stored, names), Values("state", states)]
    about.append(
        Values(
            "state_meanings",
            ", ".join(f"{int(state)} {state.name.lower()}" for state in ContactState),
        )
    )
    write_vtk(folder / f"{name}.vtp", np.column_stack([line.x, line.y]), chains, fields, (), about)
    yield i, LINE, "contact line", f"{name}.vtp"


def _file_name(start: str, point: list[tuple[str, float | str, str]]) -> str:
    """The start, and parameters as long as there is room: "plate_0003_alpha-25_friction-tresca"."""
    for key, label, _ in point:
        text = label if isinstance(label, str) else f"{label:.6g}"
        part = "_" + re.sub(r"[^\w.+-]", "_", f"{key}-{text}", flags=re.ASCII)
        if len(start) + len(part) > LONGEST:
            break
        start += part
    return start


# -- files of VTK
# ------------------------------------------------------------------------------------------------------

TRIANGLE = 5
"""VTK's number of a triangle with three nodes."""
TYPES = {"f8": "Float64", "i8": "Int64", "i1": "Int8", "u1": "UInt8"}
SYMMETRIC = ("XX", "YY", "ZZ", "XY", "YZ", "XZ")
"""Components of a symmetric tensor in the order of VTK."""


@dataclass(frozen=True, eq=False)
class Values:
    """One array: (n,) numbers, (n, k) vectors or tensors, or one text.

    units: as VTK keeps them with the array (UNITS_LABEL);  parts: names of the k components
    """

    name: str
    array: NDArray[Any] | str
    units: str = ""
    parts: tuple[str, ...] = ()


def write_vtk(
    path: Path,
    points: NDArray[np.float64],
    cells: NDArray[np.intp] | Sequence[NDArray[np.intp]],
    at_points: Sequence[Values],
    at_cells: Sequence[Values] = (),
    about: Sequence[Values] = (),
) -> None:
    """Write a mesh (VTU) or lines (VTP), as the suffix says, replacing an old file in one step.
    Raises StoreError.

    points: (n, 2) in the plane;  cells: (t, 3) triangles, or an array of points for each line
    about:  arrays of the file as a whole
    """
    joined, ends = np.concatenate([np.zeros(0), *cells]), np.cumsum([len(cell) for cell in cells])
    ways = [
        Values("connectivity", joined.astype(np.int64)),
        Values("offsets", ends.astype(np.int64)),
    ]
    kind, name, count = "PolyData", "Lines", "NumberOfLines"
    if path.suffix == ".vtu":
        kind, name, count = "UnstructuredGrid", "Cells", "NumberOfCells"
        ways.append(Values("types", np.full(len(cells), TRIANGLE, dtype=np.uint8)))
    places = Values("Points", np.column_stack([points, np.zeros(len(points))]))
    sections = {"PointData": at_points, "CellData": at_cells, "Points": (places,), name: ways}
    body = "".join(_section(name, arrays) for name, arrays in sections.items())
    _put(
        path,
        f'<VTKFile type="{kind}" version="1.0" byte_order="LittleEndian" header_type="UInt64" '
        f'compressor="vtkZLibDataCompressor">\n<{kind}>\n{_section("FieldData", about)}<Piece NumberOfPoints='
        f'"{len(points)}" {count}="{len(cells)}">\n{body}</Piece>\n</{kind}>\n</VTKFile>\n',
    )


def write_collection(path: Path, files: Sequence[tuple[int, int, str, str]]) -> None:
    """Write the PVD of files by (time, part, name of the part, file beside it). Raises
    StoreError."""
    lines = "".join(
        f'<DataSet timestep="{time}" part="{part}" name={quoteattr(name)} file={quoteattr(file)}/>\n'
        for time, part, name, file in files
    )
    _put(
        path,
        f'<VTKFile type="Collection" version="1.0">\n<Collection>\n{lines}</Collection>\n</VTKFile>\n',
    )


def _put(path: Path, text: str) -> None:
    whole = '<?xml version="1.0"?>\n' + text
    replace_file(path, lambda aside: aside.write_text(whole, encoding="utf-8"), sealed=False)


def _section(name: str, arrays: Sequence[Values]) -> str:
    return f"<{name}>\n{''.join(map(_array, arrays))}</{name}>\n"


def _array(values: Values) -> str:
    if isinstance(values.array, str):
        codes = " ".join(str(byte) for byte in (*values.array.encode(), 0))
        head = f'type="String" Name={quoteattr(values.name)} NumberOfTuples="1" format="ascii"'
        return f"<Array {head}>{codes}</Array>\n"
    array = np.ascontiguousarray(values.array)
    array = array.astype(array.dtype.newbyteorder("<"))
    k = array.shape[1] if array.ndim == 2 else 1
    head = f'type="{TYPES[array.dtype.str[1:]]}" Name={quoteattr(values.name)} NumberOfComponents="{k}"'
    head += f' NumberOfTuples="{len(array)}"'
    head += "".join(f' ComponentName{i}="{part}"' for i, part in enumerate(values.parts))
    # one compressed block behind its header: blocks, size of a block, of the last one if it is
    # shorter, compressed size
    raw = array.tobytes()
    packed = zlib.compress(raw, 6) if raw else b""
    header = np.array([1, len(raw), 0, len(packed)] if raw else [0, 0, 0], dtype="<u8").tobytes()
    text = "".join(base64.b64encode(one).decode() for one in (header, packed))
    unit = f'<InformationKey name="UNITS_LABEL" location="vtkDataArray">{values.units}</InformationKey>\n'
    has = values.units not in ("", "1")
    return f'<DataArray {head} format="binary">\n{text}\n{unit * has}</DataArray>\n'


# -- one table, or one object
# ------------------------------------------------------------------------------------------

VALUES = 2**18
"""Values that are in memory at a time."""
ROWS = {"path": "vertex", "fit": "row"}
"""Dimension of the rows where there is no status, by the kind of the file."""
LABELLED = ("start", "solver", "run")
"""Dimensions after those of the rows whose every label makes a column of its own."""


def write_table(path: Path, target: Path, point: Mapping[str, Value] | None = None) -> int:
    """Write the table, replacing an old file in one step; returns its rows.

    target: a .csv (RFC 4180, UTF-8, a header line), or a .json with one object: `title`, `kind`,
    `warnings`, `units` by
            column, and `rows`, a list of objects, one a line, in which what is not finite is "inf",
            "-inf" or null
    point:  labels of swept parameters; only the points that have them

    Raises StoreError, DrawError, UsageError.
    """
    if faults := check_writable(target):
        raise StoreError("; ".join(faults))
    written, as_csv = 0, target.suffix == ".csv"
    with reading(path) as source, open_root(path) as root:
        kind = kind_from(root.attrs)
        if point and kind in (*ROWS, "cost"):
            raise UsageError(
                f"--at: the file of tcstudy {kind} has one scene and no sweep points; leave it out"
            )
        wanted = matching(root, point) if point else None
        dims = tuple(map(str, root["status"].dims)) if "status" in root else (ROWS[kind],)
        columns = _columns(root, dims)
        units = {name: str(one.attrs.get("units", "1")) for name, one in columns.items()}
        heads = [name if unit in ("", "1") else f"{name} [{unit}]" for name, unit in units.items()]
        about = {
            "title": root.title,
            "kind": kind,
            "warnings": [*map(asdict, remarks_of(root.attrs))],
            "units": units,
        }

        def make(aside: Path) -> None:
            nonlocal written
            with open(aside, "w", encoding="utf-8", newline="") as stream:
                if not as_csv:
                    stream.write(f'{json.dumps(about, ensure_ascii=False)[:-1]}, "rows": [')
                for frame in _frames(columns, {dim: root.sizes[dim] for dim in dims}, wanted):
                    if as_csv:
                        frame.to_csv(
                            stream,
                            header=heads if written == 0 else False,
                            index=False,
                            lineterminator="\n",
                        )
                    else:
                        rows = (
                            dict(zip(units, row, strict=True))
                            for row in frame.itertuples(index=False, name=None)
                        )
                        stream.write("\n" if written == 0 else ",\n")
                        stream.write(",\n".join(map(json_text, rows)))
                    written += len(frame)
                stream.write("" if as_csv else "\n]}\n")
            source.check()

        replace_file(target, make, sealed=False)
    return written


def _columns(root: Any, dims: tuple[str, ...]) -> dict[str, Any]:
    """What has a value a row, in the order of the file, or several with a label each."""
    found = dict[str, Any]()
    for name, one in ((name, root.variables[name]) for name in (*root.coords, *root.data_vars)):
        more = (
            one.dims[-1]
            if len(one.dims) > 1 and one.dims[-1] in LABELLED and one.dims[-1] not in dims
            else None
        )
        if one.dims and {*one.dims} - {more} <= {*dims}:
            labels = root[more].values.tolist() if more else ()
            found |= (
                {f"{name}.{label}": one[..., i] for i, label in enumerate(labels)}
                if more
                else {str(name): one}
            )
    return found


def _frames(
    columns: Mapping[str, Any], sizes: Mapping[str, int], wanted: Any
) -> Iterator[pandas.DataFrame]:
    """Rows in C order of their index, some thousand at a time; the last dimension of a run's is the
    level."""
    import pandas

    (first, count), (*_, last) = next(iter(sizes.items())), sizes.values()
    inner = math.prod([*sizes.values()][1:])
    step = max(1, VALUES // len(columns) // inner)
    for start in range(0, count, step):
        shape, cut = {**sizes, first: min(step, count - start)}, {first: slice(start, start + step)}
        kept = (
            slice(None)
            if wanted is None
            else np.repeat(wanted, last)[start * inner : (start + step) * inner]
        )
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
    """Return the object that --json prints; its `verdict` has the labelled lines of the terminal,
    by label. Raises StoreError."""
    kind, data = kind_of(path), load_root(path)
    told = {
        name: json_value(value)
        for name, value in data.attrs.items()
        if name not in ("title", WARNINGS)
    }
    every = ((str(name), data.variables[name]) for name in (*data.coords, *data.data_vars))
    values = {name: one for name, one in every if "node" not in one.dims}
    return {
        "kind": kind,
        "file": str(path),
        "title": str(data.attrs["title"]),
        "warnings": [*map(asdict, remarks_of(data.attrs))],
        "verdict": {label: list(facts) for label, facts in verdict_of(path).fields.items()},
        "attributes": told,
        "units": {
            name: str(one.attrs["units"]) for name, one in values.items() if "units" in one.attrs
        },
        "dimensions": {name: one.dims for name, one in values.items()},
        "values": {name: flag_words(one, one.values).tolist() for name, one in values.items()},
    }


TABLE_FORMS = ("csv", "json")
FORMS = ("vtu", *TABLE_FORMS)


def write_form(
    file: Path,
    form: str,
    target: Path | None = None,
    point: Mapping[str, Value] | None = None,
    level: int | None = None,
) -> tuple[Path, list[str]]:
    """Write a result file in one of FORMS; return what was written, and what there is to say of it.

    target: folder of the fields or name of the table; None for a name beside the file
    point, level: as of `write_fields` and `write_table`

    Raises as they do, and UsageError for a name that does not fit the form.
    """
    if form in TABLE_FORMS:
        table = target or file.with_suffix(f".{form}")
        if table.suffix != f".{form}":
            what = f"a table of this form has a name that ends in .{form}"
            raise UsageError(f"{table}: {what}; what else is there stays")
        return table, [counted(write_table(file, table, point), "row")]
    folder = target or file.with_suffix("")
    if faults := check_writable(folder / file.name):
        raise UsageError("; ".join(faults))
    fields = write_fields(file, folder, point, -1 if level is None else level)
    return fields.path, [counted(fields.points, "point"), *fields.lacks]
