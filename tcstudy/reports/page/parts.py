"""Parts of a page as JSON that the scripts draw: panels, tables, sheets of columns, states of the
contact line.

A page of any other kind of file than a run is a list of sections, each a title, a name and a list
of parts. A part says what it is by its `part`. States (steps, vertices of a path, data of a fit)
are counted by one slider; a panel, a sheet and a line show the one that it is at.

Numbers stand behind the JSON in a compact form, compressed together with it: 4 bytes length of the
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
from tcstudy.reports.figures.panels import Panel
from tcstudy.reports.json_values import Json, flag_words, json_value
from tcstudy.reports.text import Heading, Part, Table, column_notes

COLOURS = {
    style.INK: "var(--ink)",
    style.PALE: "var(--soft)",
    style.SHADE: "var(--body)",
    "white": "var(--bg)",
    **{colour: f"var(--c{i})" for i, colour in enumerate(style.SERIES[:-1], 1)},
}
"""Colours of the pictures that follow the page's theme."""


def panel_part(
    panel: Panel, box: Container, at: tuple[ArrayLike, ArrayLike] | None = None, high: int = 320
) -> Json:
    """A panel; at: places of the states in it [units of the file], which a ring marks and a click
    chooses."""
    places = (
        None
        if at is None
        else [
            box.array(axis(values), "f4")
            for axis, values in zip((panel.x, panel.y), at, strict=True)
        ]
    )
    return {
        "part": "panel",
        "title": panel.title,
        "labels": [panel.x.label, panel.y.label],
        "log": list(panel.log),
        "limits": [None if one is None else list(one) for one in panel.limits],
        "ticks": panel.ticks
        and [np.asarray(panel.ticks[0], dtype=float).tolist(), list(panel.ticks[1])],
        "items": [_item(*one, box) for one in panel.items],
        "high": high,
        "at": places,
    }


LOOKS = ("color", "linewidth", "linestyle", "marker", "markersize", "markerfacecolor", "fillstyle", "alpha", "label",
         "text", "shift", "ha", "texts", "names")  # fmt: skip
"""What the scripts know of the look of an item, by matplotlib's names."""


def _item(kind: str, x: Any, y: Any, how: Mapping[str, Any], box: Container) -> Json:
    found: Json = {"kind": kind, "x": box.array(x, "f4"), "y": box.array(y, "f4")}
    found |= {key: how[key] for key in LOOKS if key in how}
    if "color" in how:
        found["color"] = COLOURS.get(how["color"], how["color"])
    if kind == "cells":
        found |= {
            "kinds": box.array(how["kinds"], "i1"),
            "colours": [COLOURS.get(c, c) for c in how["colours"]],
        }
    return found


def text_parts(parts: Iterable[Part]) -> list[Json]:
    """What the terminal says, but for titles."""
    found: list[Json] = []
    for part in parts:
        if isinstance(part, Table):
            head, rows = (
                [one.title for one in part.columns],
                list(zip(*(one.cells for one in part.columns), strict=True)),
            )
            found.append(
                {
                    "part": "table",
                    "caption": part.caption,
                    "head": head,
                    "rows": rows,
                    "notes": [*part.notes, *column_notes(part.columns)],
                }
            )
        elif isinstance(part, str):
            found.append(
                {
                    "part": "text",
                    "lines": [line.strip() for line in part.split("\n") if line.strip()],
                }
            )
        elif isinstance(part, Heading) and part.level > 1:
            found.append({"part": "text", "lines": [part.text]})
    return found


def column(name: str, title: str, units: str, values: Any, box: Container) -> Json:
    """A column of a sheet: numbers in the units of the file, or texts."""
    numbers = np.asarray(values).dtype.kind in "fiub"
    return {
        "name": name,
        "title": title,
        "units": units,
        "v": box.array(values) if numbers else [str(one) for one in values],
    }


def columns_of(data: Any, dim: str, box: Container) -> list[Json]:
    """A column of every variable that has a value for each place of a dimension, by its long
    name."""
    every = ((str(name), data.variables[name]) for name in (*data.coords, *data.data_vars))
    return [
        column(
            name,
            str(one.attrs["long_name"]),
            str(one.attrs.get("units", "1")),
            flag_words(one, one.values),
            box,
        )
        for name, one in every
        if one.dims == (dim,)
    ]


def sheet_part(
    columns: Sequence[Json],
    file: str,
    *,
    states: bool = False,
    chart: tuple[str, str] | None = None,
) -> Json:
    """A table that sorts, is saved as CSV, and, with a chart, is drawn: any column over any other.

    states: whether its rows are the states;  chart: names of x and y to begin with
    """
    return {
        "part": "sheet",
        "columns": list(columns),
        "file": file,
        "states": states,
        "chart": chart and list(chart),
    }


def beside(*parts: Json) -> Json:
    """Parts side by side where there is room."""
    return {"part": "beside", "parts": list(parts)}


def choice(label: str, key: str, options: Mapping[str, list[Json]]) -> Json:
    """One of several lists of parts."""
    return {
        "part": "choice",
        "label": label,
        "key": key,
        "options": list(options),
        "parts": list(options.values()),
    }


def states(label: str, texts: Sequence[str], first: int) -> Json:
    """The slider of the states; first: where it is to begin with."""
    return {"part": "states", "label": label, "texts": list(texts), "first": first}


def section(title: str, name: str, *parts: Json) -> Json:
    """A part of the page under its heading."""
    return {"title": title, "id": name, "parts": list(parts)}


# -- numbers
# -----------------------------------------------------------------------------------------------------------

TYPES = {"f8": "<f8", "f4": "<f4", "i4": "<i4", "i2": "<i2", "i1": "i1", "u2": "<u2"}
LARGEST = 32767
"""Quantised numbers go from −LARGEST to LARGEST."""


@dataclass
class Container:
    """Collects arrays; `packed` gives the text that stands in the page."""

    _blocks: list[bytes] = field(default_factory=list)
    _size: int = 0

    def array(self, values: Any, kind: str = "f8") -> Json:
        """Values as they are, in one of TYPES."""
        array = np.ascontiguousarray(values, dtype=TYPES[kind])
        place = {"$": kind, "s": list(array.shape), "o": self._size}
        block = array.tobytes()
        block += b"\0" * (-len(block) % 8)
        self._blocks.append(block)
        self._size += len(block)
        return place

    def rows(self, values: NDArray[np.float64]) -> Json:
        """(P, n) values for drawing: 16 bits each, relative to the largest of their row (3e-5 of it
        at most)."""
        largest = np.max(np.abs(np.where(np.isfinite(values), values, 0.0)), axis=1, initial=0.0)
        scale = np.where(largest > 0.0, largest / LARGEST, 1.0)
        whole = np.where(
            np.isfinite(values), np.rint(np.nan_to_num(values) / scale[:, None]), -LARGEST - 1
        )
        return {"rows": self.array(whole, "i2"), "scale": self.array(scale, "f8")}

    def fields(self, values: NDArray[np.float64], tolerance: float = 1e-3) -> Json:
        """(P, n) fields on a body for drawing, as few modes: Σ_j factor_pj mode_jn, within
        tolerance × their range.

        Many points of a sweep have few independent fields, so that a thousand need hardly more room
        than ten.
        """
        u, s, vt = np.linalg.svd(values, full_matrices=False)
        span = float(np.ptp(values)) or 1.0
        # a dropped mode changes no value by more than s_j max|u_j| max|v_j|
        worst = s * np.max(np.abs(u), axis=0) * np.max(np.abs(vt), axis=1)
        left_out = np.concatenate([np.cumsum(worst[::-1])[::-1], [0.0]])
        rank = int(np.argmax(left_out <= tolerance * span))
        return {"factor": self.array(u[:, :rank] * s[:rank], "f4"), "mode": self.rows(vt[:rank])}

    def packed(self, header: Json) -> str:
        """Header and arrays, compressed, as base64 text."""
        text = json.dumps(
            json_value(header), ensure_ascii=False, separators=(",", ":"), allow_nan=False
        ).encode()
        head = len(text).to_bytes(4, "little") + text
        head += b"\0" * (-len(head) % 8)
        return base64.b64encode(gzip.compress(head + b"".join(self._blocks), 9, mtime=0)).decode()
