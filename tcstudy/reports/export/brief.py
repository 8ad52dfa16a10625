"""A result file as one JSON object: its variables by name, not rounded, in SI units; flags are their words.

What a run and a convergence have by point is a list of points in the order of the file (the last axis runs fastest), in
which lists go over the levels. What lies along the contact line and in the body stays in the file.
"""

from __future__ import annotations

import json
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

from tcstudy.data.measured import LEVELS
from tcstudy.data.provenance import WARNINGS, kind_of, remarks_of
from tcstudy.data.reading import sweep_dims
from tcstudy.data.schema import ESTIMATES, ROOT
from tcstudy.data.store import load_root
from tcstudy.reports.page.container import Json, plain
from tcstudy.reports.terminal.summary import verdict_of

OF_LEVELS = {"level", *(v.name for v in (*ROOT, *ESTIMATES, *LEVELS) if v.dims == ("level",))}
"""What a level has once."""


def brief(path: Path) -> dict[str, Json]:
    """The object that --json prints; its `verdict` is the sentence of --quiet. Raises StoreError."""
    kind, data = kind_of(path), load_root(path)
    told = {name: plain(value) for name, value in data.attrs.items() if name not in ("title", WARNINGS)}
    named = ((str(name), data.variables[name]) for name in (*data.coords, *data.data_vars))
    every = {name: one for name, one in named if "node" not in one.dims}
    found = {
        "kind": kind,
        "file": str(path),
        "title": str(data.attrs["title"]),
        "warnings": [*map(asdict, remarks_of(data.attrs))],
        "verdict": verdict_of(data, kind, path)[0],
        "attributes": told,
        "units": {name: str(one.attrs["units"]) for name, one in every.items() if "units" in one.attrs},
    }
    if kind not in ("run", "convergence"):
        return found | {"values": {name: _listed(one) for name, one in every.items()}}
    sweep = {dim: data.sizes[dim] for dim in sweep_dims(data)}
    swept = {name for name, one in every.items() if {*one.dims} & {*sweep}}  # sizes too, of several geometries
    swept |= set() if sweep else {name for name, one in every.items() if "level" in one.dims} - OF_LEVELS
    columns = {name: _by_point(one, sweep) for name, one in every.items() if name in swept}
    points = [dict(zip(columns, row, strict=True)) for row in zip(*columns.values(), strict=True)]
    levels = {name: _listed(one) for name, one in every.items() if name not in swept}
    return found | {"levels": levels, "points": points}


def json_text(value: Json) -> str:
    """One line of JSON; numbers that there are not are null."""
    return json.dumps(plain(value), ensure_ascii=False, allow_nan=False)


def _by_point(one: Any, sweep: dict[str, int]) -> list[Json]:
    """What each point has of a variable, a number or a list over the dimensions beside the sweep."""
    whole = one.set_dims({**sweep, **dict(one.sizes)}).transpose(*sweep, ...)
    return list(_listed(whole.data.reshape(-1, *whole.shape[len(sweep) :]), one.attrs))


def _listed(one: Any, attrs: Any = None) -> Json:
    """Values as lists, flags as words."""
    values, attrs = np.asarray(one), one.attrs if attrs is None else attrs
    if "flag_meanings" in attrs:
        words = dict(zip(np.atleast_1d(attrs["flag_values"]).tolist(), attrs["flag_meanings"].split(), strict=True))
        values = np.vectorize(words.get, otypes=[object])(values)
    return values.tolist()
