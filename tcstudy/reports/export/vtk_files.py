"""Files of VTK, which ParaView, PyVista and VisIt open: meshes (VTU), lines (VTP), and their order in a sweep (PVD).

The XML format of VTK 1.0 with compressed arrays in base64 (docs.vtk.org, "VTK File Formats"). Three elements and one
way to write an array are all that results need; the libraries that write more (vtk: 100 MB; meshio: no lines, no units
of arrays, no collections) are needed to read the files, not to make them.
"""

from __future__ import annotations

import base64
import zlib
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from xml.sax.saxutils import quoteattr

import numpy as np
from numpy.typing import NDArray

from tcstudy.data.files import replace_file

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
    """Write a mesh (VTU) or lines (VTP), as the suffix says, replacing an old file in one step. Raises StoreError.

    points: (n, 2) in the plane;  cells: (t, 3) triangles, or an array of points for each line
    about:  arrays of the file as a whole
    """
    joined, ends = np.concatenate([np.zeros(0), *cells]), np.cumsum([len(cell) for cell in cells])
    ways = [Values("connectivity", joined.astype(np.int64)), Values("offsets", ends.astype(np.int64))]
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
    """Write the PVD of files by (time, part, name of the part, file beside it). Raises StoreError."""
    lines = "".join(
        f'<DataSet timestep="{time}" part="{part}" name={quoteattr(name)} file={quoteattr(file)}/>\n'
        for time, part, name, file in files
    )
    _put(path, f'<VTKFile type="Collection" version="1.0">\n<Collection>\n{lines}</Collection>\n</VTKFile>\n')


def _put(path: Path, text: str) -> None:
    whole = '<?xml version="1.0"?>\n' + text
    replace_file(path, lambda aside: aside.write_text(whole, encoding="utf-8"), sealed=False)


def _section(name: str, arrays: Sequence[Values]) -> str:
    return f"<{name}>\n" + "".join(map(_array, arrays)) + f"</{name}>\n"


def _array(values: Values) -> str:
    """One <DataArray>."""
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
    unit = '<InformationKey name="UNITS_LABEL" location="vtkDataArray">{}</InformationKey>\n'
    return f'<DataArray {head} format="binary">\n{_packed(array)}\n' + (
        f"{unit.format(values.units)}</DataArray>\n" if values.units not in ("", "1") else "</DataArray>\n"
    )


def _packed(array: NDArray[Any]) -> str:
    """An array as one compressed block behind its header: blocks, size of a block, of the last one, compressed size."""
    raw = array.tobytes()
    if not raw:
        return base64.b64encode(np.zeros(3, dtype="<u8").tobytes()).decode()
    packed = zlib.compress(raw, 6)
    head = np.array([1, len(raw), 0, len(packed)], dtype="<u8")  # 0: the last block is a whole one
    return base64.b64encode(head.tobytes()).decode() + base64.b64encode(packed).decode()
