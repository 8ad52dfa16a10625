"""What the page has of a run: axes, numbers of every point and level, reasons; of a history totals of its points."""

from __future__ import annotations

from typing import Any

import numpy as np

from tcstudy.data.reading import asked, axis_names, by_point, sweep_dims
from tcstudy.data.schema import PointStatus
from tcstudy.reports.page.container import Container, Json
from tcstudy.reports.page.stored import Stored
from tcstudy.reports.select_point import numbers_of
from tcstudy.reports.sentences import several
from tcstudy.reports.text import named, study_unit

ROOM_FOR_DOUBLES = 300_000
"""Bytes of numbers up to which the page has all digits; beyond it has seven (the energy always has all)."""

DIAGNOSTIC = ("inclusion_", "iterations", "evaluations", "heat_balance", "time_", "lambda_1_error")
"""How numbers begin that stand after the others."""
SUMS = ("dissipated", "released", "work", "jumps")
"""Numbers of which a point of a history has the sum over its steps."""
FLAGS = ("status", "unique", "strict_minimum", "global_minimum", "heat_status", "start_used", "complete")
LEVEL_NUMBERS = ("h_max", "n_dof", "n_contact", "time_mesh", "time_assemble")


def run_part(stored: Stored, box: Container) -> Json:
    """Axes, numbers and flags, with points flattened in C order of the sweep."""
    data = stored.data

    def flat(name: str) -> Any:
        return by_point(data[name], data)

    held = [name for name in numbers_of(data) if name != "inclusion_rounding" and np.isfinite(flat(name)).any()]
    first = [name for name in ("u_T_max", *asked(data)) if name in held]
    names = [*first, *sorted((name for name in held if name not in first), key=lambda n: n.startswith(DIAGNOSTIC))]
    kind = "f8" if data["status"].size * len(names) * 8 <= ROOM_FOR_DOUBLES else "f4"
    return {
        **sweep_of(data),
        "levels": level_numbers(data),
        "numbers": {
            name: {
                "long_name": ": ".join(data[name].attrs.get(key, "") for key in ("long_name", "comment")).rstrip(": "),
                "units": str(data[name].attrs["units"]),
                "v": box.array(flat(name), "f8" if name == "energy" else kind),
            }
            for name in names
        },
        "asked": [name for name in asked(data) if name in names],
        "flags": {
            **{name: box.array(flat(name), "i1") for name in FLAGS if name in data},
            "several": box.array(several(flat("start_energy"), flat("unique") == 1), "i1"),
        },
        **reasons(flat("reason"), box),
        "starts": [str(one) for one in data["start"].values],
        "start_energy": box.array(flat("start_energy"), "f8"),
    }


def history_run(data: Any, box: Container) -> Json:
    """Totals of every point of a history in the form of a run of one level."""

    def flat(name: str) -> Any:
        return by_point(data[name], data)

    solved = flat("status") == int(PointStatus.OK)
    done, whole = solved.any(axis=1), solved.all(axis=1)
    totals = {name: np.where(done, np.where(solved, flat(name), 0).sum(axis=1), np.nan) for name in SUMS}
    totals["u_T_max"] = np.where(done, np.where(solved, flat("u_T_max"), 0.0).max(axis=1), np.nan)
    about = {name: data[name].attrs for name in totals} | {"steps": {"long_name": "steps solved", "units": "1"}}
    totals["steps"] = np.count_nonzero(solved, axis=1) - 1.0
    judged = solved[:, 1:]  # nothing is proved of step 0, from which the others go on
    flags = {name: np.where(judged, flat(name)[:, 1:], 1).min(axis=1) for name in FLAGS[1:] if name in data}
    flags["status"] = np.where(whole, int(PointStatus.OK), int(PointStatus.NOT_CONVERGED))
    return {
        **sweep_of(data),
        "levels": {name: [values] for name, values in level_numbers(data).items()},
        "numbers": {
            name: {"long_name": about[name]["long_name"], "units": about[name]["units"], "v": box.array(values)}
            for name, values in totals.items()
        },
        "flags": {name: box.array(values, "i1") for name, values in flags.items()},
        **reasons(flat("reason")[:, None], box),
        "starts": [],
        "start_energy": None,
    }


def sweep_of(data: Any) -> Json:
    """The sweep, and the units of what a level has."""
    dims = sweep_dims(data)
    return {
        "mode": str(data.attrs["sweep_mode"]),
        "dims": dims,
        "shape": [int(data.sizes[d]) for d in dims],
        "axes": axes(data),
        "units": {name: str(data[name].attrs["units"]) for name in LEVEL_NUMBERS if name in data},
    }


def reasons(told: Any, box: Container) -> Json:
    """Words of the statuses, the different reasons, and which of them (P, levels) points have."""
    texts = ["", *sorted({str(one) for one in told.ravel()} - {""})]
    place = {text: i for i, text in enumerate(texts)}
    return {
        "statuses": [named(status) for status in PointStatus],
        "reasons": texts,
        "reason": box.array([[place[str(one)] for one in row] for row in told], "u2"),
    }


def level_numbers(data: Any) -> Json:
    """Sizes and times of the levels."""
    return {name: data[name].values.tolist() for name in LEVEL_NUMBERS if name in data}


def time_of_levels(geometries: list[Any]) -> Json:
    """The times of the levels of all geometries together."""
    names = [name for name in LEVEL_NUMBERS if name.startswith("time") and all(name in data for data in geometries)]
    return {name: np.nansum([data[name].values for data in geometries], axis=0).tolist() for name in names}


def axes(data: Any) -> list[Json]:
    """Swept parameters: name, key path, units, labels, and the dimension each lies along."""
    found = []
    for name in axis_names(data):
        values = data[name].values
        number = values.dtype.kind not in "OUS"
        found.append(
            {
                "name": name,
                "path": str(data[name].attrs.get("long_name", "")).removeprefix("swept parameter "),
                "units": str(data[name].attrs.get("units", "1")),
                "numeric": number,
                "written": study_unit(data[name].attrs),
                "drawn": "distribution" in data[name].attrs,
                "values": [float(v) if number else str(v) for v in values],
                "dim": str(data[name].dims[0]),
            }
        )
    return found
