"""Parts of a page as JSON that the scripts draw: panels, tables, sheets, states of a contact line.

The page of any kind of file but a run is a list of sections: a title, a name and a list of parts.
The key `part` names the kind of a part. One slider chooses a state (a step, a vertex of a path, a
datum of a fit), which panels, sheets and contact lines show.

The numbers follow the JSON in binary form, and both are compressed together: 4 bytes length of the
header (little-endian), the header in UTF-8, padding to 8 bytes, the arrays, each at a multiple of 8
bytes. An array stands in the header as {"$": type, "s": shape, "o": offset}.
"""

from __future__ import annotations

import base64
import gzip
import json
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tcstudy.reports.figures import style
from tcstudy.reports.figures.panels import Item, Panel
from tcstudy.reports.json_values import Json, flag_words, json_value
from tcstudy.reports.text import Heading, Part, Table, column_notes

SERIES_COLOURS = {colour: f"var(--c{i})" for i, colour in enumerate(style.SERIES[:-1], 1)}
COLOURS = SERIES_COLOURS | {
    style.INK: "var(--ink)",
    style.PALE: "var(--soft)",
    style.SHADE: "var(--body)",
    "white": "var(--bg)",
}
"""Colours of the pictures that follow the page's theme."""


def panel_part(
    panel: Panel,
    box: Container,
    state_places: tuple[ArrayLike, ArrayLike] | None = None,
    height: int = 320,
) -> Json:
    """Return a panel.

    state_places: x and y of the states in it [units of the file]; a ring marks the chosen state,
    and a click chooses another one.
    """
    places = None
    if state_places is not None:
        x, y = panel.x(state_places[0]), panel.y(state_places[1])
        places = [box.array(x, "f4"), box.array(y, "f4")]
    part: Json = {"part": "panel", "title": panel.title}
    part["labels"] = [panel.x.label, panel.y.label]
    part["log"] = list(panel.log)
    part["limits"] = [limits and list(limits) for limits in panel.limits]
    part["ticks"] = _ticks(panel)
    part["items"] = [_item(item, box) for item in panel.items]
    part["high"] = height
    part["at"] = places
    return part


def _ticks(panel: Panel) -> list[Any] | None:
    """Return places on the x axis and their texts, or None for round numbers."""
    if panel.ticks is None:
        return None
    places, texts = panel.ticks
    return [np.asarray(places, dtype=float).tolist(), list(texts)]


_LOOK_KEYS = """
    color linewidth linestyle marker markersize markerfacecolor
    fillstyle alpha label text shift ha texts names
"""
LOOK_KEYS = tuple(_LOOK_KEYS.split())
"""Names of matplotlib for the look of an item that the scripts know."""


def _item(item: Item, box: Container) -> Json:
    """Return an item of a panel in the colours of the page."""
    look = item.look
    part: Json = {"kind": item.kind}
    part["x"] = box.array(item.x, "f4")
    part["y"] = box.array(item.y, "f4")
    part |= page_look(look)
    if item.kind == "cells":
        part["kinds"] = box.array(look["kinds"], "i1")
        part["colours"] = list(map(_page_colour, look["colours"]))
    return part


def page_look(look: Mapping[str, Any]) -> Json:
    """Return what the scripts know of a look, in the colours of the page."""
    page = {key: look[key] for key in LOOK_KEYS if key in look}
    if "color" in look:
        page["color"] = _page_colour(look["color"])
    return page


def _page_colour(colour: Any) -> Any:
    """Return a colour that follows the theme of the page, where there is one."""
    return COLOURS.get(colour, colour)


def text_part(lines: Sequence[str]) -> Json:
    """Return lines of text."""
    return {"part": "text", "lines": list(lines)}


def text_parts(parts: Iterable[Part]) -> list[Json]:
    """Return the parts of a text of the terminal, without its titles."""
    page_parts: list[Json] = []
    for part in parts:
        if isinstance(part, Table):
            page_parts.append(_table(part))
        elif isinstance(part, str):
            lines = [line.strip() for line in part.split("\n")]
            page_parts.append(text_part([line for line in lines if line]))
        elif isinstance(part, Heading) and part.level > 1:
            page_parts.append(text_part([part.text]))
    return page_parts


def _table(table: Table) -> Json:
    titles = [column.title for column in table.columns]
    rows = zip(*(column.cells for column in table.columns), strict=True)
    part: Json = {"part": "table", "caption": table.caption}
    part |= {"head": titles, "rows": list(rows)}
    part["notes"] = [*table.notes, *column_notes(table.columns)]
    return part


def column(name: str, title: str, units: str, values: Any, box: Container) -> Json:
    """Return a column of a sheet: numbers in the units of the file, or texts."""
    is_numeric = np.asarray(values).dtype.kind in "fiub"
    cells = box.array(values) if is_numeric else [str(value) for value in values]
    return {"name": name, "title": title, "units": units, "v": cells}


def columns_of(data: Any, dim: str, box: Container) -> list[Json]:
    """Return a column of every variable along one dimension alone, titled by its long name."""
    columns = []
    for name in (*data.coords, *data.data_vars):
        variable = data.variables[name]
        if variable.dims != (dim,):
            continue
        title = str(variable.attrs["long_name"])
        units = str(variable.attrs.get("units", "1"))
        values = flag_words(variable, variable.values)
        columns.append(column(str(name), title, units, values, box))
    return columns


def sheet_part(
    columns: Sequence[Json],
    file: str,
    *,
    states: bool = False,
    chart: tuple[str, str] | None = None,
) -> Json:
    """Return a table that sorts and is saved as CSV, and the chart of any column over another.

    states: whether the rows are the states;  chart: first names of x and y, or None
    """
    part: Json = {"part": "sheet", "columns": list(columns), "file": file}
    return part | {"states": states, "chart": chart and list(chart)}


def beside_part(*parts: Json) -> Json:
    """Return parts side by side, where the screen is wide enough."""
    return {"part": "beside", "parts": list(parts)}


def choice_part(label: str, key: str, options: Mapping[str, list[Json]]) -> Json:
    """Return a choice of one of several lists of parts."""
    part: Json = {"part": "choice", "label": label, "key": key}
    return part | {"options": list(options), "parts": list(options.values())}


def states_part(label: str, texts: Sequence[str], first: int) -> Json:
    """Return the slider of the states; first: its first position."""
    return {"part": "states", "label": label, "texts": list(texts), "first": first}


def section(title: str, name: str, *parts: Json) -> Json:
    """Return a section of the page, with its heading."""
    return {"title": title, "id": name, "parts": list(parts)}


# -- numbers ---------------------------------------------------------------------------------------

TYPES = {"f8": "<f8", "f4": "<f4", "i4": "<i4", "i2": "<i2", "i1": "i1", "u2": "<u2"}
MAX_QUANTISED = 32767
"""Largest of the 16-bit integers that stand for numbers."""
MISSING_QUANTISED = -MAX_QUANTISED - 1
"""The integer that stands for NaN."""


@dataclass
class Container:
    """Collects arrays; `packed` returns the text that stands in the page."""

    _blocks: list[bytes] = field(default_factory=list)
    _size: int = 0

    def array(self, values: Any, kind: str = "f8") -> Json:
        """Add values as they are, in one of TYPES, and return their place."""
        array = np.ascontiguousarray(values, dtype=TYPES[kind])
        place = {"$": kind, "s": list(array.shape), "o": self._size}
        block = _padded(array.tobytes())
        self._blocks.append(block)
        self._size += len(block)
        return place

    def rows(self, values: NDArray[np.float64]) -> Json:
        """Add (P, n) values for drawing: 16 bits each, within 3e-5 of the largest of their row."""
        is_finite = np.isfinite(values)
        largest = np.max(np.abs(np.where(is_finite, values, 0.0)), axis=1, initial=0.0)
        scale = np.where(largest > 0.0, largest / MAX_QUANTISED, 1.0)
        rounded = np.rint(np.nan_to_num(values) / scale[:, None])
        quantised = np.where(is_finite, rounded, MISSING_QUANTISED)
        return {"rows": self.array(quantised, "i2"), "scale": self.array(scale, "f8")}

    def fields(self, values: NDArray[np.float64], tolerance: float = 1e-3) -> Json:
        """Add (P, n) fields on a body for drawing, as few modes: Σ_j factor_pj mode_jn.

        The sum is within tolerance × the range of the fields. The points of a sweep have few
        independent fields: a thousand points need hardly more room than ten.
        """
        u, s, vt = np.linalg.svd(values, full_matrices=False)
        span = float(np.ptp(values)) or 1.0
        # a dropped mode changes no value by more than s_j max|u_j| max|v_j|
        largest_change = s * np.max(np.abs(u), axis=0) * np.max(np.abs(vt), axis=1)
        # the change if this mode and all after it are dropped; none are dropped after the last
        change_from = np.append(np.cumsum(largest_change[::-1])[::-1], 0.0)
        rank = int(np.argmax(change_from <= tolerance * span))
        factors = self.array(u[:, :rank] * s[:rank], "f4")
        return {"factor": factors, "mode": self.rows(vt[:rank])}

    def packed(self, header: Json) -> str:
        """Return header and arrays, compressed, as base64 text."""
        values = json_value(header)
        text = json.dumps(values, ensure_ascii=False, separators=(",", ":"), allow_nan=False)
        encoded = text.encode()
        head = _padded(len(encoded).to_bytes(4, "little") + encoded)
        # without the time, equal files give equal pages
        compressed = gzip.compress(head + b"".join(self._blocks), 9, mtime=0)
        return base64.b64encode(compressed).decode()


def _padded(block: bytes) -> bytes:
    """Return bytes followed by zeros up to a multiple of 8."""
    return block + b"\0" * (-len(block) % 8)
