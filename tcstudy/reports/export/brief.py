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

from tcstudy.data.measured import ERRORS, MEASURES, NUMBERS, VERDICTS
from tcstudy.data.provenance import kind_of, remarks_of
from tcstudy.data.reading import attributes, by_point, each_point
from tcstudy.data.records import PointStatus
from tcstudy.data.store import load_root
from tcstudy.reports import sentences
from tcstudy.reports.figures.path import RESPONSES
from tcstudy.reports.page.container import Container, Json, plain
from tcstudy.reports.page.run_part import axes, run_part
from tcstudy.reports.page.stored import read
from tcstudy.reports.terminal.convergence import shown
from tcstudy.reports.terminal.cost import advice, settings, stages
from tcstudy.reports.terminal.path_summary import seen_folds
from tcstudy.reports.terminal.summary import verdict_of
from tcstudy.reports.text import counted


class Lists(Container):
    """Arrays as lists, where a page has them packed."""

    def array(self, values: Any, kind: str = "f8") -> Json:
        return np.asarray(values).tolist()


def brief(path: Path) -> dict[str, Json]:
    """The object that --json prints; its `verdict` is the sentence of --quiet. Raises StoreError."""
    kind, told = kind_of(path), [asdict(one) for one in remarks_of(attributes(path))]
    if kind == "run":
        stored = read(path, whole=True)
        data, found = stored.data, _run(run_part(stored, Lists()), stored.data)
    else:
        data = load_root(path, kind)
        of_kind = {"convergence": _convergence, "cost": _cost, "path": _path, "history": _history, "fit": _fit}
        found = of_kind[kind](data)
    verdict = verdict_of(data, kind, path)[0]
    about = {"kind": kind, "file": str(path), "title": str(data.attrs["title"]), "warnings": told, "verdict": verdict}
    return about | found


def json_text(value: Json) -> str:
    """One line of JSON; numbers that there are not are null."""
    return json.dumps(plain(value), ensure_ascii=False, allow_nan=False)


def _points(data: Any) -> Iterator[tuple[dict[str, Json], dict[str, int]]]:
    """The labels of each point, and its place."""
    swept = axes(data)
    for where in each_point(data):
        yield {axis["name"]: axis["values"][where[axis["dim"]]] for axis in swept}, where


def _run(part: Json, data: Any) -> dict[str, Json]:
    numbers, flags = part["numbers"], part["flags"]
    units = {axis["name"]: axis["units"] for axis in part["axes"]} | part["units"]
    points = []
    for i, (labels, _) in enumerate(_points(data)):
        point = {
            **labels,
            "status": [part["statuses"][PointStatus(code)] for code in flags["status"][i]],
            "reason": [part["reasons"][code] for code in part["reason"][i]],
        }
        proved = {name: flags[name][i] for name in ("unique", "global_minimum", "strict_minimum") if name in flags}
        points.append(point | proved | {name: one["v"][i] for name, one in numbers.items()})
    units |= {name: one["units"] for name, one in numbers.items()}
    return {"units": units, "levels": part["levels"], "points": points}


def _convergence(data: Any) -> dict[str, Json]:
    names = {"errors": [m.name for m in ERRORS if shown(data, m.name)],
             "numbers": [m.name for m in NUMBERS if f"value_{m.name}" in data]}  # fmt: skip
    parts = {"errors": ("error", "rate", "slope", "slope_error", "expected", "first_level", "verdict", "reason"),
             "numbers": ("value", "limit", "uncertainty", "exact")}  # fmt: skip
    points = []
    for labels, where in _points(data):
        at = data.isel(where)
        tables: dict[str, Any] = {
            kind: {name: {part: at[f"{part}_{name}"].values.tolist() for part in parts[kind]} for name in names[kind]}
            for kind in names
        }
        for one in tables["errors"].values():
            one["verdict"] = sentences.VERDICTS[VERDICTS[one["verdict"]]]
            one["order"] = sentences.order(one["slope"], one["slope_error"])
        points.append({**labels, "status": at["status"].values.tolist(), **tables})
    units = {axis["name"]: axis["units"] for axis in axes(data)} | {"h_max": str(data["h_max"].attrs["units"])}
    levels = {}
    for name in ("h_max", "n_dof", "n_contact"):  # of several geometries by point
        own = data[name]
        levels[name] = (own.values if own.ndim == 1 else by_point(own.broadcast_like(data["status"]), data)).tolist()
    return {
        "reference": str(data.attrs["reference"]),
        "notes": str(data.attrs["notes"]).splitlines(),
        "levels": levels,
        "units": units | {name: str(data[f"value_{name}"].attrs["units"]) for name in names["numbers"]},
        "points": points,
    }  # fmt: skip


def _cost(data: Any) -> dict[str, Json]:
    charts: list[Json] = []
    for name in (m.name for m in MEASURES if f"error_{m.name}" in data):
        found = settings(data, name)
        rows = [vars(s) | {"stages": stages(data, s)} for s in found]
        charts.append({"name": name, "rows": rows, "advice": advice(found)})
    about = {name: str(data.attrs[name]) for name in ("reference", "point")}
    notes = str(data.attrs["notes"]).splitlines()
    return {**about, "notes": notes, "h_units": str(data["h_max"].attrs["units"]), "charts": charts}


def _path(data: Any) -> dict[str, Json]:
    c, (folds, turns) = data["c"].values, seen_folds(data)
    units = {name: str(data[of].attrs["units"]) for name, of in
             (("parameter", "parameter"), ("slip", "u_T"), ("xi", "xi"), ("energy", "energy"))}  # fmt: skip

    def curve(kind: str, *names: str) -> dict[str, Json]:
        found = {name: data[f"{kind}{name}"].values.tolist() for name in ("parameter", "energy", *names)}
        u, xi = data[f"{kind}u_T"].values, data[f"{kind}xi"].values
        return found | {key.replace("-", "_"): formula(u, xi, c).tolist() for key, (_, _, formula) in RESPONSES.items()}

    proofs = ("unique", "strict_minimum", "global_minimum")
    solutions = curve("solution_", "residual", "stable", "lowest", *proofs) if data.sizes.get("solution", 0) else None
    branches = curve("branch_", "stable") if data.sizes.get("branch_vertex", 0) else None
    if branches is not None:
        loop, complete = data["branch_loop"].values, int(data["complete"])
        branches["begin"] = np.searchsorted(data["branch_of"].values, np.arange(len(loop) + 1)).tolist()
        branches |= {"complete": complete, "apart": (data["branch_on_path"].values == 0).tolist()}
        told = f"{counted(int(loop.sum()), 'closed loop')}, {int(np.sum(loop == 0))} open branches in the range"
        branches["words"] = [told, sentences.WHOLE if complete else str(data.attrs["complete_reason"])]
    falls = ("jump_parameter", "jump_rising", "jump_drop")
    numbers = ("level", "h_max", "n_dof", "n_contact", "lambda_1", "omega", "law_error", "energy_lost")
    lowest = ("lowest_begin", "lowest_end", "lowest_certified")
    return {
        "parameter": str(data.attrs["parameter"]),
        "units": units | {"friction": "1" if units["xi"] == "1" else "N m-1"},
        "range": [float(v) for v in data.attrs["parameter_range"]],
        "folds": folds.tolist(),
        "turns": turns,
        "lowest": [data[name].values.tolist() for name in lowest] if data.sizes.get("interval", 0) else [[], [], []],
        "solutions": solutions,
        "falls": np.column_stack([data[n].values for n in falls]).tolist() if data.sizes.get("jump", 0) else [],
        "branches": branches,
        "numbers": {name: float(data[name]) for name in numbers if name in data},
        "ends": [str(data.attrs["begin_reason"]), str(data.attrs["end_reason"])],
    }


def _history(data: Any) -> dict[str, Json]:
    named = [str(n) for n, one in data.variables.items() if "step" in one.dims and "node" not in one.dims]
    units = {name: str(data[name].attrs["units"]) for name in named if "units" in data[name].attrs}
    values = {name: data[name].values.tolist() for name in [*named, "reason"]}
    return {"units": units, "dimensions": list(data["status"].dims), **values}


def _fit(data: Any) -> dict[str, Json]:
    told = {}
    for i, name in enumerate(map(str, data["parameter"].values)):
        keys = ("estimate", "standard_error", "interval", "mesh_shift", "at_bound", "parameter_within")
        told[name] = {"units": str(data["parameter_units"].values[i])}
        told[name] |= {key: data[key].values[i].tolist() for key in keys if key in data}
    lists = ("covariance", "singular_value", "singular_vector", "start_cost", "start_count", "start_estimate",
             "start_evaluations")  # fmt: skip
    found = {"parameters": told} | {key: data[key].values.tolist() for key in lists if key in data}
    return found | {key: data.attrs[key] for key in ABOUT if key in data.attrs}


ABOUT = (
    *("compare", "loss", "data_file", "data_sha256", "known_noise", "chi_square", "degrees_of_freedom"),
    *("fit_probability", "runs", "runs_probability", "information_criterion", "not_determined", "determined"),
    *("solves", "evaluations", "message", "starts", "starts_tried", "starts_failed", "start_failure", "noise_assumed"),
)
"""Attributes of a file that are told of it as they are."""
