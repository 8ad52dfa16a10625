"""A result file as one JSON object and as one sentence: the numbers of its tables without rounding, in SI units.

Points come in the order of the file (the last axis runs fastest), lists in a point go over its levels. What lies along
the contact line and in the body stays in the file.
"""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

from tcstudy.data.provenance import kind_of, remarks_of
from tcstudy.data.reading import attributes, each_point
from tcstudy.data.records import PointStatus
from tcstudy.reports.page.container import Container, Json, plain
from tcstudy.reports.page.other_part import convergence_part, cost_part, path_part
from tcstudy.reports.page.run_part import axes, run_part
from tcstudy.reports.page.stored import Stored, read
from tcstudy.reports.terminal.fit import fit_brief

LINE = ("line", "u_T", "xi", "kept", "curve", "loop", "state", "states", "stable")
"""Of a path what has a value for each of its vertices or nodes."""


class Lists(Container):
    """Arrays as lists, where a page has them packed."""

    def array(self, values: Any, kind: str = "f8") -> Json:
        return np.asarray(values).tolist()

    rows = array


def brief(path: Path) -> dict[str, Json]:
    """The object that --json prints; its `verdict` is the sentence of --quiet. Raises StoreError."""
    remarks = {"warnings": [asdict(one) for one in remarks_of(attributes(path))]}
    if kind_of(path) == "fit":
        return {"kind": "fit", "file": str(path), **remarks, **fit_brief(path)}
    stored = read(path)
    of_kind = {"run": _run, "convergence": _convergence, "cost": cost_part, "path": _path, "history": _history}
    found = dict(of_kind[stored.kind](stored))
    about = {"kind": stored.kind, "file": str(path), "title": str(stored.data.attrs["title"]), **remarks}
    verdict = found.pop("verdict")["text"]
    return {**about, "verdict": verdict, **found}


def json_text(value: Json) -> str:
    """One line of JSON; numbers that there are not are null."""
    return json.dumps(plain(value), ensure_ascii=False, allow_nan=False)


def _labels(data: Any) -> Iterator[dict[str, Json]]:
    """The labels of each point."""
    swept = axes(data)
    for where in each_point(data):
        yield {axis["name"]: axis["values"][where[axis["dim"]]] for axis in swept}


def _run(stored: Stored) -> dict[str, Json]:
    part = run_part(stored, Lists())
    numbers, flags = part["numbers"], part["flags"]
    units = {axis["name"]: axis["units"] for axis in part["axes"]} | part["units"]
    points = []
    for i, labels in enumerate(_labels(stored.data)):
        point = {
            **labels,
            "status": [part["statuses"][PointStatus(code)] for code in flags["status"][i]],
            "reason": [part["reasons"][code] for code in part["reason"][i]],
        }
        proved = {name: flags[name][i] for name in ("unique", "global_minimum", "strict_minimum") if name in flags}
        points.append(point | proved | {name: one["v"][i] for name, one in numbers.items()})
    return {
        "verdict": part["verdict"],
        "units": units | {name: one["units"] for name, one in numbers.items()},
        "levels": part["levels"],
        "points": points,
    }


def _convergence(stored: Stored) -> dict[str, Json]:
    part = convergence_part(stored, Lists())
    points = []
    for i, labels in enumerate(_labels(stored.data)):
        tables = {}
        for kind in ("errors", "numbers"):
            entries = [{key: plain(values) for key, values in one.items()} for one in part[kind]]
            tables[kind] = {
                one["name"]: {key: value[i] for key, value in one.items() if isinstance(value, list)} for one in entries
            }
        points.append({**labels, "status": part["status"][i], **tables})
    kept = {name: part[name] for name in ("verdict", "reference", "notes", "levels")}
    units = {axis["name"]: axis["units"] for axis in part["axes"]} | {"h_max": part["h_units"]}
    return {**kept, "units": units | {one["name"]: one["units"] for one in part["numbers"]}, "points": points}


def _history(stored: Stored) -> dict[str, Json]:
    data = stored.data
    named = [str(n) for n, one in data.variables.items() if "step" in one.dims and "node" not in one.dims]
    ended = sum(bool(reason) for reason in data["reason"].values.ravel())
    said = f"{ended} of {data['reason'].size} histories ended early" if ended else "all steps solved"
    units = {name: str(data[name].attrs["units"]) for name in named if "units" in data[name].attrs}
    values = {name: data[name].values.tolist() for name in [*named, "reason"]}
    return {"verdict": {"text": said}, "units": units, "dimensions": list(data["status"].dims), **values}


def _path(stored: Stored) -> dict[str, Json]:
    part = {name: value for name, value in path_part(stored, Lists()).items() if name not in LINE}
    if part["solutions"] is not None:
        part["solutions"] = {name: value for name, value in part["solutions"].items() if name not in LINE[:3]}
    return part
