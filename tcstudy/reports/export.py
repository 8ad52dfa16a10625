"""A result file for other programs: its fields for ParaView, or one table, or one JSON object.

Fields: every sweep point's body (VTU) and contact line (VTP), and one PVD for the sweep.

The body has the displacement u and the temperature theta at its nodes, as stored, and in its
triangles, where the strain ε of P1 elements is constant,

    σ = cε − βθI   (eq. (3) of the paper, θ the mean of the corners)
    w = ½ σ : c⁻¹ σ,   von Mises' stress √(3/2 s : s)

with σ_zz = λ tr ε − βθ in plane strain and 0 in plane stress; c, β are those of the point. The
contact line has u_T, xi = −S_T, c and what every node does. Time in the PVD is the number of the
point in the sweep, in the order of the file; parameters stand in the names and, in full, in the
field data of every file.

Left out: jumps of the stress between elements (no averaging); the ends of a line without unknown.

The XML format of VTK 1.0 with compressed arrays in base64 (docs.vtk.org, "VTK File Formats") needs
three elements and one way to write an array; libraries that write more (vtk: 100 MB; meshio: no
lines, no units of arrays, no collections) are needed to read the files, not to make them.

The table has a row per point and level, those of the file's `status`: of cost every family, solver
and level, of a history every point and step. Rows of a path are the vertices, of a fit the data.
Every variable of the root with a value per row is a column `name [unit]`. One with several values
(by start, by solver) has a column for each. Numbers are written so that reading gives them back to
the bit; flags are their words; what is missing is an empty field, or null. The object has every
variable by its name, lists within lists along its dimensions.
"""

from __future__ import annotations

import base64
import json
import math
import re
import zlib
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, TextIO
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
    BodyFields,
    LineFields,
    body_fields,
    contact_line,
    opening_line,
    opening_states,
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
from tcstudy.scene.contact_states import ContactState, NormalState
from tcstudy.scene.records import Scene

if TYPE_CHECKING:
    import pandas


KEEP_FIELDS = "run its study again with --set output.fields=true to keep them"
BODY, LINE, OPENINGS = 0, 1, 2
"""Parts of a point in the PVD."""
MAX_NAME = 120
"""Characters of a file's name; further parameters stand in the file alone."""

Label = tuple[str, float | str, str]
"""Name, value and unit of a swept parameter at a point."""
Listed = tuple[int, int, str, str]
"""A file in the PVD: time, part, name of the part, file beside the PVD."""


@dataclass(frozen=True)
class Exported:
    """The PVD that was written, its number of points, and sentences on what is missing."""

    path: Path
    points: int
    lacks: tuple[str, ...]


def write_fields(
    path: Path, folder: Path, point: Mapping[str, Value] | None = None, level: int = -1
) -> Exported:
    """Write the fields of a run's points on one level into a folder; the PVD comes last.

    point: labels of swept parameters that the points have; of several geometries they name one
    level: −1 is the finest

    Raises StoreError if `path` is no result file or a file cannot be written, DrawError for a point
    or level that there is not, UsageError for a file of another kind or several geometries.
    """
    kind = kind_of(path)
    if kind != "run":
        raise UsageError(
            f"--vtu: {path} is a file of tcstudy {kind} and has no fields; name that of a run"
        )
    with reading(path):
        with open_root(path) as root:
            number = level_number(root, level)
            wanted = matching(root, point or {})
            geometry = chosen_geometry(root, wanted, f"--vtu: {path}", "--at ")
            labels = labels_by_point(root)
            units = {name: str(root[name].attrs.get("units", "1")) for name in labels}
            solved = by_point(root["status"], root)[:, number] == PointStatus.OK
        with unmasked(path) as nc:
            body = StoredBody.of(nc, geometry) if geometry >= 0 else None
            if body is None or number not in body.levels:
                lack = f"{path} has no mesh of level {number}"
                raise UsageError(f"--vtu: {lack}; see the reasons with: tcstudy show")
            study = stored_study(body.about)
            files = list[Listed]()
            for point_of_body, i in enumerate(body.places):
                if not (wanted[i] and solved[i]):
                    continue
                scene = None if study is None else study.scenes[point_of_body]
                label = [(name, array[i].item(), units[name]) for name, array in labels.items()]
                group = body.dataset(number, body.cut(point_of_body))
                name = _file_name(f"{path.stem}_{int(i):04d}", label)
                files += _write_point(folder, name, int(i), label, group, scene)
            has_fields = "u_x" in body.group(number).variables
        pvd = folder / f"{path.stem}.pvd"
        write_collection(pvd, files)

    lacks = list[str]()
    if not has_fields:
        lack = "the file has no fields of the body, so only contact lines were written"
        lacks.append(f"{lack}; {KEEP_FIELDS}")
    elif study is None:
        lacks.append(
            "the study in the file cannot be read by this version, so stresses are left out"
        )
    missing, total = int(np.count_nonzero(wanted & ~solved)), np.count_nonzero(wanted)
    if missing:
        lacks.append(f"{missing} of {total} points have no solution on level {number}")
    return Exported(pvd, int(np.count_nonzero(wanted & solved)), tuple(lacks))


def _write_point(
    folder: Path, name: str, time: int, label: list[Label], group: Any, scene: Scene | None
) -> Iterator[Listed]:
    """Write the files of one point and yield their rows of the PVD."""
    about = list[Values]()
    for key, value, unit in label:
        about.append(Values(key, value if isinstance(value, str) else np.array([value]), unit))
    body = body_fields(group)
    if body is not None:
        fields, cells = _body_values(body, group, scene)
        write_vtk(folder / f"{name}.vtu", body.xy, body.triangles, fields, cells, about)
        yield time, BODY, "body", f"{name}.vtu"
    line, line_about = contact_line(group), [*about, _meanings(ContactState)]
    xy, fields = np.column_stack([line.x, line.y]), _line_values(group, scene)
    write_vtk(folder / f"{name}.vtp", xy, _chains(line), fields, (), line_about)
    yield time, LINE, "contact line", f"{name}.vtp"
    if "opening" not in group:
        return
    line, line_about = opening_line(group), [*about, _meanings(NormalState)]
    xy, fields = np.column_stack([line.x, line.y]), _opening_values(line, group, scene)
    file = f"{name}_openings.vtp"
    write_vtk(folder / file, xy, _chains(line), fields, (), line_about)
    yield time, OPENINGS, "openings", file


def _meanings(states: type[ContactState] | type[NormalState]) -> Values:
    meanings = ", ".join(f"{int(state)} {state.name.lower()}" for state in states)
    return Values("state_meanings", meanings)


def _stored(group: Any, name: str) -> Values:
    return Values(name, group[name].values, str(group[name].attrs.get("units", "1")))


def _body_values(
    body: BodyFields, group: Any, scene: Scene | None
) -> tuple[list[Values], list[Values]]:
    """Return the arrays of a body at its nodes and in its triangles, stresses only with a scene."""
    u = np.column_stack([body.u, np.zeros(len(body.u))])
    fields = [Values("u", u, _stored(group, "u_x").units, ("x", "y", "z"))]
    if body.theta is not None:
        fields.append(_stored(group, "theta"))
    if scene is None:
        return fields, []
    sigma, energy = stresses(body, scene.material)
    stress_units = _stored(group, "xi").units
    cells = [
        Values("stress", sigma, stress_units, SYMMETRIC),
        Values("von_mises", von_mises(sigma), stress_units),
        Values("energy_density", energy, "1" if stress_units == "1" else "J m-3"),
    ]
    if "region" in group:
        cells.append(_stored(group, "region"))
    return fields, cells


def _line_values(group: Any, scene: Scene | None) -> list[Values]:
    """Return the arrays of a contact line at its nodes."""
    friction = None if scene is None else scene.friction
    sticks = group["sticks"].values == STICKS
    states = states_of(friction, group, group["u_T"].values, sticks)
    variables = map(str, group.data_vars)
    forces = [name for name in variables if name == SECTION.name or name.startswith(LAYER)]
    names = ("u_T", "xi", *forces, "arclength", "c")
    return [*(_stored(group, name) for name in names), Values("state", states)]


def _opening_values(line: LineFields, group: Any, scene: Scene | None) -> list[Values]:
    """Return the arrays of the nodes that may open."""
    states = opening_states(scene, group, line.u_T, line.sticks)
    arclength = Values("arclength", line.arclength, line.length_units)
    stored = [_stored(group, name) for name in ("opening", "S_N", "c_N")]
    return [*stored, arclength, Values("state", states)]


def _chains(line: LineFields) -> list[NDArray[np.intp]]:
    """Return the nodes of each part of a contact line; a ring ends at its first node."""
    chains = list[NDArray[np.intp]]()
    for part in line.parts:
        nodes = np.arange(part.start, part.stop)
        chains.append(np.append(nodes, part.start) if line.closed(part) else nodes)
    return chains


def _file_name(start: str, label: list[Label]) -> str:
    """Return the start, and labels as long as there is room: "plate_0003_alpha-25"."""
    for key, value, _ in label:
        text = value if isinstance(value, str) else f"{value:.6g}"
        part = "_" + re.sub(r"[^\w.+-]", "_", f"{key}-{text}", flags=re.ASCII)
        if len(start) + len(part) > MAX_NAME:
            break
        start += part
    return start


# -- files of VTK

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

    points: (n, 2) in the plane;  cells: (t, 3) triangles, or an array of points for each line
    about:  arrays of the file as a whole
    Raises StoreError.
    """
    joined = np.concatenate([np.zeros(0), *cells]).astype(np.int64)
    ends = np.cumsum([len(cell) for cell in cells]).astype(np.int64)
    topology = [Values("connectivity", joined), Values("offsets", ends)]
    kind, name, count = "PolyData", "Lines", "NumberOfLines"
    if path.suffix == ".vtu":
        kind, name, count = "UnstructuredGrid", "Cells", "NumberOfCells"
        topology.append(Values("types", np.full(len(cells), TRIANGLE, dtype=np.uint8)))
    coordinates = Values("Points", np.column_stack([points, np.zeros(len(points))]))
    sections = [
        _section("PointData", at_points),
        _section("CellData", at_cells),
        _section("Points", [coordinates]),
        _section(name, topology),
    ]
    piece = f'<Piece NumberOfPoints="{len(points)}" {count}="{len(cells)}">'
    _put(
        path,
        f'<VTKFile type="{kind}" version="1.0" byte_order="LittleEndian" header_type="UInt64" '
        f'compressor="vtkZLibDataCompressor">\n<{kind}>\n{_section("FieldData", about)}{piece}\n'
        f"{''.join(sections)}</Piece>\n</{kind}>\n</VTKFile>\n",
    )


def write_collection(path: Path, files: Sequence[Listed]) -> None:
    """Write the PVD of files. Raises StoreError."""
    lines = list[str]()
    for time, part, name, file in files:
        names = f"name={quoteattr(name)} file={quoteattr(file)}"
        lines.append(f'<DataSet timestep="{time}" part="{part}" {names}/>\n')
    collection = f"<Collection>\n{''.join(lines)}</Collection>"
    _put(path, f'<VTKFile type="Collection" version="1.0">\n{collection}\n</VTKFile>\n')


def _put(path: Path, element: str) -> None:
    text = f'<?xml version="1.0"?>\n{element}'
    replace_file(path, lambda aside: aside.write_text(text, encoding="utf-8"), sealed=False)


def _section(name: str, arrays: Sequence[Values]) -> str:
    return f"<{name}>\n{''.join(map(_array, arrays))}</{name}>\n"


def _array(values: Values) -> str:
    """Return the element of one array: a text as its codes, numbers compressed in base64."""
    name = f"Name={quoteattr(values.name)}"
    if isinstance(values.array, str):
        codes = " ".join(str(byte) for byte in (*values.array.encode(), 0))
        head = f'type="String" {name} NumberOfTuples="1" format="ascii"'
        return f"<Array {head}>{codes}</Array>\n"
    array = np.ascontiguousarray(values.array)
    array = array.astype(array.dtype.newbyteorder("<"))
    components = array.shape[1] if array.ndim == 2 else 1
    head = f'type="{TYPES[array.dtype.str[1:]]}" {name} NumberOfComponents="{components}"'
    head += f' NumberOfTuples="{len(array)}"'
    head += "".join(f' ComponentName{i}="{part}"' for i, part in enumerate(values.parts))
    unit = ""
    if values.units not in ("", "1"):
        key = '<InformationKey name="UNITS_LABEL" location="vtkDataArray">'
        unit = f"{key}{values.units}</InformationKey>\n"
    text = _compressed(array.tobytes())
    return f'<DataArray {head} format="binary">\n{text}\n{unit}</DataArray>\n'


def _compressed(raw: bytes) -> str:
    """Return bytes as one compressed block of VTK behind its header, each in base64."""
    packed = zlib.compress(raw, 6) if raw else b""
    # number of blocks, size of a block, of the last one if it is shorter, compressed size
    sizes = [1, len(raw), 0, len(packed)] if raw else [0, 0, 0]
    header = np.array(sizes, dtype="<u8").tobytes()
    return base64.b64encode(header).decode() + base64.b64encode(packed).decode()


# -- one table, or one object

MAX_VALUES = 2**18
"""Values that are in memory at a time."""
ROWS = {"path": "vertex", "fit": "row"}
"""Dimension of the rows where there is no status, by the kind of the file."""
LABELLED = ("start", "solver", "run")
"""Dimensions after those of the rows whose every label makes a column of its own."""


def write_table(path: Path, target: Path, point: Mapping[str, Value] | None = None) -> int:
    """Write the table, replacing an old file in one step, and return the number of its rows.

    target: a .csv (RFC 4180, UTF-8, a header line), or a .json with one object: `title`, `kind`,
            `warnings`, `units` by column, and `rows`, a list of objects, one per line, in which
            "inf", "-inf" and null stand for what is not finite
    point:  labels of swept parameters that the points of the rows have

    Raises StoreError, DrawError, UsageError.
    """
    faults = check_writable(target)
    if faults:
        raise StoreError("; ".join(faults))
    written = 0
    with reading(path) as source, open_root(path) as root:
        kind = kind_from(root.attrs)
        if point and kind in (*ROWS, "cost"):
            lack = f"the file of tcstudy {kind} has one scene and no sweep points"
            raise UsageError(f"--at: {lack}; leave it out")
        wanted = matching(root, point) if point else None
        dims = tuple(map(str, root["status"].dims)) if "status" in root else (ROWS[kind],)
        columns = _columns(root, dims)
        units = {name: str(column.attrs.get("units", "1")) for name, column in columns.items()}
        about = {
            "title": root.title,
            "kind": kind,
            "warnings": [*map(asdict, remarks_of(root.attrs))],
            "units": units,
        }
        sizes = {dim: root.sizes[dim] for dim in dims}
        write = _write_csv if target.suffix == ".csv" else _write_json

        def make(aside: Path) -> None:
            nonlocal written
            with open(aside, "w", encoding="utf-8", newline="") as stream:
                written = write(stream, about, _frames(columns, sizes, wanted))
            source.check()

        replace_file(target, make, sealed=False)
    return written


def _write_csv(stream: TextIO, about: Json, frames: Iterable[pandas.DataFrame]) -> int:
    """Write rows below a header line; return their number."""
    header = list[str]()
    for name, unit in about["units"].items():
        header.append(name if unit in ("", "1") else f"{name} [{unit}]")
    written = 0
    for frame in frames:
        frame_header = header if written == 0 else False
        frame.to_csv(stream, header=frame_header, index=False, lineterminator="\n")
        written += len(frame)
    return written


def _write_json(stream: TextIO, about: Json, frames: Iterable[pandas.DataFrame]) -> int:
    """Write an object whose `rows` stand one per line; return their number."""
    stream.write(f'{json.dumps(about, ensure_ascii=False)[:-1]}, "rows": [')
    written = 0
    for frame in frames:
        stream.write("\n" if written == 0 else ",\n")
        rows = frame.itertuples(index=False, name=None)
        objects = (dict(zip(about["units"], row, strict=True)) for row in rows)
        stream.write(",\n".join(map(json_text, objects)))
        written += len(frame)
    stream.write("\n]}\n")
    return written


def _columns(root: Any, dims: tuple[str, ...]) -> dict[str, Any]:
    """Return the variables with a value per row, in the order of the file.

    One with several values per row, each with a label, is a column for each label.
    """
    columns = dict[str, Any]()
    for name in (*root.coords, *root.data_vars):
        variable = root.variables[name]
        if not variable.dims:
            continue
        *before, inner = variable.dims
        is_labelled = bool(before) and inner in LABELLED and inner not in dims
        if not set(before if is_labelled else variable.dims) <= set(dims):
            continue
        if is_labelled:
            for i, label in enumerate(root[inner].values.tolist()):
                columns[f"{name}.{label}"] = variable[..., i]
        else:
            columns[str(name)] = variable
    return columns


def _frames(
    columns: Mapping[str, Any], sizes: Mapping[str, int], wanted: NDArray[np.bool_] | None
) -> Iterator[pandas.DataFrame]:
    """Yield rows in C order of their index, some thousand at a time.

    sizes:  of the dimensions of the rows
    wanted: (P,) points of a run whose rows are kept; the last dimension is the level
    """
    import pandas

    dims = list(sizes)
    first, last = dims[0], dims[-1]
    rows_per_step = math.prod([sizes[dim] for dim in dims[1:]])
    is_wanted = None if wanted is None else np.repeat(wanted, sizes[last])
    step = max(1, MAX_VALUES // len(columns) // rows_per_step)
    for start in range(0, sizes[first], step):
        rows: Any = slice(None)
        if is_wanted is not None:
            rows = is_wanted[start * rows_per_step : (start + step) * rows_per_step]
        cut = {first: slice(start, start + step)}
        shape = {**sizes, first: min(step, sizes[first] - start)}
        cells = dict[str, Any]()
        for name, variable in columns.items():
            cells[name] = _cells(variable.isel(cut, missing_dims="ignore"), shape)[rows]
        frame = pandas.DataFrame(cells)
        if len(frame):
            yield frame


def _cells(variable: Any, shape: Mapping[str, int]) -> Any:
    """Return the values of a variable by row, None for what is missing of whole numbers."""
    values = variable.set_dims(shape).transpose(*shape).values.ravel()
    values = flag_words(variable, values)
    least = None if values.dtype.kind == "f" else variable.attrs.get("valid_min")
    return values if least is None else np.where(values >= least, values.astype(object), None)


def brief(path: Path) -> dict[str, Json]:
    """Return the object that --json prints; its `verdict` has the labelled lines by label.

    Raises StoreError.
    """
    kind, data = kind_of(path), load_root(path)
    attributes = {name: data.attrs[name] for name in data.attrs if name not in ("title", WARNINGS)}
    variables = dict[str, Any]()
    for name in map(str, (*data.coords, *data.data_vars)):
        if "node" not in data[name].dims:
            variables[name] = data.variables[name]
    units = {name: one.attrs["units"] for name, one in variables.items() if "units" in one.attrs}
    values = dict[str, Json]()
    for name, variable in variables.items():
        values[name] = flag_words(variable, variable.values).tolist()
    return {
        "kind": kind,
        "file": str(path),
        "title": str(data.attrs["title"]),
        "warnings": [*map(asdict, remarks_of(data.attrs))],
        "verdict": {label: list(facts) for label, facts in verdict_of(path).fields.items()},
        "attributes": json_value(attributes),
        "units": {name: str(unit) for name, unit in units.items()},
        "dimensions": {name: variable.dims for name, variable in variables.items()},
        "values": values,
    }


# -- any of these

TABLE_FORMS = ("csv", "json")
FORMS = ("vtu", *TABLE_FORMS)


def write_form(
    file: Path,
    form: str,
    target: Path | None = None,
    point: Mapping[str, Value] | None = None,
    level: int | None = None,
) -> tuple[Path, list[str]]:
    """Write a result file in one of FORMS; return the path and what there is to report of it.

    target: folder of the fields or name of the table; None for a name beside the file
    point, level: as of `write_fields` and `write_table`

    Raises as they do, and UsageError for a name that does not fit the form.
    """
    if form in TABLE_FORMS:
        table = target or file.with_suffix(f".{form}")
        if table.suffix != f".{form}":
            fault = f"a table of this form has a name that ends in .{form}"
            raise UsageError(f"{table}: {fault}; what else is there stays")
        return table, [counted(write_table(file, table, point), "row")]
    folder = target or file.with_suffix("")
    faults = check_writable(folder / file.name)
    if faults:
        raise UsageError("; ".join(faults))
    fields = write_fields(file, folder, point, -1 if level is None else level)
    return fields.path, [counted(fields.points, "point"), *fields.lacks]
