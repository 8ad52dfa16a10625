"""What the page has of files of converge, cost, path and fit."""

from __future__ import annotations

from typing import Any

import numpy as np

from tcstudy.data.measured import ERRORS, NUMBERS, VERDICTS
from tcstudy.data.reading import by_point, sweep_dims
from tcstudy.data.records import PointStatus
from tcstudy.errors import DrawError
from tcstudy.reports import sentences
from tcstudy.reports.page.container import Container, Json
from tcstudy.reports.page.point_part import geometry
from tcstudy.reports.page.run_part import sweep_of
from tcstudy.reports.page.stored import Stored
from tcstudy.reports.terminal.cost import advice, measure_of, settings, stages
from tcstudy.reports.terminal.fit import BAND, columns, correlation, fit_doubts, prediction_error
from tcstudy.reports.terminal.path_summary import seen_folds
from tcstudy.reports.text import counted, number, prefix, pretty
from tcstudy.scene.key import symbol

PATH_BYTES = 4_000_000
"""Room for slip and traction along a path; a longer one is thinned."""


def convergence_part(stored: Stored, box: Container) -> Json:
    """Errors, rates, expected orders and extrapolated numbers of every sweep point."""
    data = stored.data

    def flat(name: str) -> Any:
        return by_point(data[name], data)

    sizes = data[["h_max", "n_dof", "n_contact"]]
    if sizes["h_max"].ndim > 1:  # of several geometries: of every point
        sizes = sizes.broadcast_like(data["status"]).stack(at=sweep_dims(data)).transpose("at", "level")
    errors: list[Json] = [
        {
            "name": m.name,
            "symbol": m.symbol,
            "error": box.array(flat(f"error_{m.name}")),
            "rate": box.array(flat(f"rate_{m.name}")),
            **{part: flat(f"{part}_{m.name}") for part in ("slope", "slope_error", "expected", "first_level")},
            "verdict": [sentences.VERDICTS[VERDICTS[int(v)]] for v in flat(f"verdict_{m.name}")],
            "order": list(map(sentences.order, flat(f"slope_{m.name}"), flat(f"slope_error_{m.name}"))),
            "reason": [str(v) for v in flat(f"reason_{m.name}")],
        }
        for m in ERRORS
        if _measured(data, m.name)
    ]
    numbers = [
        {
            "name": m.name,
            "symbol": m.symbol,
            "units": str(data[f"value_{m.name}"].attrs["units"]),
            "value": box.array(flat(f"value_{m.name}")),
            **{part: flat(f"{part}_{m.name}") for part in ("limit", "uncertainty", "exact")},
        }
        for m in NUMBERS
        if f"value_{m.name}" in data
    ]
    return {
        **sweep_of(data),
        "levels": {name: sizes[name].values.tolist() for name in ("h_max", "n_dof", "n_contact")},
        "h_units": str(data["h_max"].attrs["units"]),
        "reference": str(data.attrs["reference"]),
        "notes": _notes(data),
        "status": box.array(flat("status"), "i1"),
        "errors": errors,
        "numbers": numbers,
        "verdict": _convergence_verdict(data, flat("status")),
    }


def _convergence_verdict(data: Any, status: Any) -> Json:
    found = [(m.symbol, VERDICTS[int(v)]) for m in ERRORS if _measured(data, m.name)
             for v in by_point(data[f"verdict_{m.name}"], data)]  # fmt: skip
    solved = bool(np.all(status == int(PointStatus.OK)))
    ok = solved and all(verdict != "slower" for _, verdict in found)
    return {"text": sentences.orders(found, solved) + ".", "how": "", "ok": ok}


def _measured(data: Any, name: str) -> bool:
    return f"error_{name}" in data and bool(np.isfinite(data[f"error_{name}"]).any())


def _notes(data: Any) -> list[str]:
    return str(data.attrs["notes"]).splitlines()


def cost_part(stored: Stored) -> Json:
    """Every measured setting by error measure, and what the file advises."""
    data = stored.data
    names = [str(name)[6:] for name in data.variables if str(name).startswith("error_")]
    charts: list[Json] = []
    for name in names:
        try:
            found = settings(data, measure_of(data, name))
        except DrawError:
            continue
        rows = [vars(s) | {"stages": stages(data, s)} for s in found]
        charts.append({"name": name, "rows": rows, "advice": advice(found)})
    first = next((c for c in charts if c["name"] == "u_energy"), charts[0] if charts else None)
    return {
        "reference": str(data.attrs["reference"]),
        "point": str(data.attrs["point"]),
        "notes": _notes(data),
        "h_units": str(data["h_max"].attrs["units"]),
        "charts": charts,
        "verdict": {"text": " ".join(first["advice"]) if first else "Nothing was measured.", "how": "", "ok": True},
    }


def path_part(stored: Stored, box: Container) -> Json:
    """The path: parameter, slip, friction and energy of its vertices, states of its pieces, folds, loop, solutions."""
    data = stored.data
    m, vertices = int(data.sizes["node"]), int(data.sizes["vertex"])
    keep = np.arange(0, vertices, max(1, -(-4 * m * vertices // PATH_BYTES)))
    if keep[-1] != vertices - 1:
        keep = np.append(keep, vertices - 1)
    c = data["c"].values

    def curve(prefix: str, dim: str, names: tuple[str, ...]) -> Json:
        if data.sizes.get(dim, 0) == 0:
            return None
        u, xi = data[f"{prefix}u_T"].values, data[f"{prefix}xi"].values
        own = {name: box.array(data[f"{prefix}{name}"].values) for name in names}
        responses = {"mean_slip": u @ c / c.sum(), "max_slip": np.abs(u).max(axis=1), "friction": xi @ c}
        return own | {name: box.array(values) for name, values in responses.items()}

    solutions = None
    if data.sizes.get("solution", 0):
        flags = ("stable", "lowest", "unique", "strict_minimum", "global_minimum")
        solutions = curve("solution_", "solution", ("parameter", "energy", "residual")) | {
            **{name: data[f"solution_{name}"].values.tolist() for name in flags},
            "u_T": box.rows(data["solution_u_T"].values),
            "xi": box.rows(data["solution_xi"].values),
        }
    falls = []
    if data.sizes.get("jump", 0):
        columns = ("jump_parameter", "jump_rising", "jump_drop")
        falls = np.column_stack([data[name].values for name in columns]).tolist()
    low, high = (float(v) for v in data.attrs["parameter_range"])
    folds, turns = seen_folds(data)
    return {
        "parameter": str(data.attrs["parameter"]),
        "units": {
            "parameter": str(data["parameter"].attrs["units"]),
            "slip": str(data["u_T"].attrs["units"]),
            "xi": str(data["xi"].attrs["units"]),
            "energy": str(data["energy"].attrs["units"]),
            "friction": "1" if str(data["xi"].attrs["units"]) == "1" else "N m-1",
        },
        "range": [low, high],
        "line": geometry(data, box),
        "curve": curve("", "vertex", ("parameter", "energy", "residual")),
        "kept": box.array(keep, "i4"),
        "u_T": box.rows(data["u_T"].values[keep]),
        "xi": box.rows(data["xi"].values[keep]),
        "state": box.array(data["state"].values, "i1"),
        "stable": box.array(data["stable"].values, "i1"),
        "folds": folds.tolist(),
        "turns": turns,
        "lowest": [data[name].values.tolist() for name in ("lowest_begin", "lowest_end", "lowest_certified")]
        if data.sizes.get("interval", 0)
        else [[], [], []],
        "solutions": solutions,
        "loop": curve("loop_", "loop_vertex", ("parameter", "energy")),
        "falls": falls,
        "branches": _branches(data, curve("branch_", "branch_vertex", ("parameter", "energy")), box),
        "numbers": {
            name: float(data[name])
            for name in ("level", "h_max", "n_dof", "n_contact", "lambda_1", "omega", "law_error", "energy_lost")
            if name in data
        },
        "ends": [str(data.attrs["begin_reason"]), str(data.attrs["end_reason"])],
        "verdict": _path_verdict(data, low, high, folds, turns),
    }


def _branches(data: Any, curve: Json, box: Container) -> Json:
    """Every branch of the range where they are known; `apart`: those that the path does not go along."""
    if curve is None:
        return None
    of, loop, apart = data["branch_of"].values, data["branch_loop"].values, data["branch_on_path"].values == 0
    return curve | {
        "stable": box.array(data["branch_stable"].values, "i1"),
        "begin": np.searchsorted(of, np.arange(len(loop) + 1)).tolist(),
        "apart": apart.tolist(),
        "complete": int(data["complete"]),
        "words": [f"{counted(int(loop.sum()), 'closed loop')}, {int(np.sum(loop == 0))} open branches in the range",
                  sentences.WHOLE if int(data["complete"]) else str(data.attrs["complete_reason"])],
    }  # fmt: skip


def _path_verdict(data: Any, low: float, high: float, folds: Any, turns: int) -> Json:
    t = data["parameter"].values[folds]
    inside = int(np.count_nonzero((t >= min(low, high)) & (t <= max(low, high))))
    most = int(data["solution_count"].max()) if data.sizes.get("at", 0) else None
    counts = int(data.sizes["piece"]), int(data["stable"].sum()), inside, turns, most, int(data.sizes.get("jump", 0))
    how = sentences.WHOLE if int(data.get("complete", 0)) else sentences.CONNECTED
    loops = int(data["branch_loop"].sum()) if "branch_loop" in data else None
    return {"text": sentences.path(*counts, float(data["residual"].max()), loops), "how": how, "ok": True}


def fit_part(data: Any, box: Container) -> Json:
    """Everything that a fit's file says, numbers in SI units."""
    given, measured = columns(data)
    named = {"given": "datum_given", "value": "datum", "at": "predicted_given", "predicted": "predicted",
             "residual": "residual", "noise": "noise"}  # fmt: skip
    found = {name: float(data.attrs[name]) for name in
             ("chi_square", "degrees_of_freedom", "fit_probability", "runs", "runs_probability", "known_noise",
              "given_noise", "information_criterion", "evaluations", "solves") if name in data.attrs}  # fmt: skip
    return {
        "given": [{"name": name, "units": units} for name, units in given],
        "measured": [{"name": name, "units": units} for name, units in measured],
        "data": {name: box.array(data[variable].values) for name, variable in named.items()}
        | {"error": box.array(prediction_error(data)), "column": data["measured_column"].values.tolist()},
        "parameters": _found_numbers(data),
        "correlation": correlation(data).tolist(),
        "directions": [
            {"size": float(size), "vector": vector.tolist()}
            for size, vector in zip(data["singular_value"].values, data["singular_vector"].values, strict=True)
        ],
        "curve": _fitted_curve(data, box),
        "law": _fitted_law(data, box),
        "cost": data["cost"].values.tolist(),
        "starts": _starts(data),
        "numbers": found,
        "words": {name: str(data.attrs.get(name, "")) for name in
                  ("compare", "loss", "data_file", "data_sha256", "message", "not_determined", "determined",
                   "noise_assumed")},
        "doubts": fit_doubts(data),
        "band": BAND,
        "verdict": _fit_verdict(data),
    }  # fmt: skip


def _found_numbers(data: Any) -> list[Json]:
    found = []
    for i, name in enumerate(data["parameter"].values):
        own = {key: float(data[key][i]) for key in ("estimate", "standard_error", "parameter_start")}
        low, high = (float(x) for x in data["interval"].values[i])
        units = str(data["parameter_units"].values[i])
        found.append(
            {"name": str(name), "symbol": symbol(str(name)), "units": units, "low": low, "high": high,
             "within": data["parameter_within"].values[i].tolist(), "at_bound": bool(data["at_bound"][i]),
             "logarithmic": bool(data["logarithmic"][i]), **own}
        )  # fmt: skip
    return found


def _fitted_curve(data: Any, box: Container) -> Json | None:
    if "curve_given" not in data:
        return None
    folds = data["fold_vertex"].values.tolist() if "fold_vertex" in data else []
    return {"x": box.array(data["curve_given"].values), "y": box.array(data["curve_measured"].values), "folds": folds}


def _fitted_law(data: Any, box: Container) -> Json | None:
    if "law_slip" not in data:
        return None
    units = {key: str(data[f"law_{key}"].attrs["units"]) for key in ("slip", "traction")}
    return {key: box.array(data[f"law_{key}"].values) for key in ("slip", "traction", "error")} | {"units": units}


def _starts(data: Any) -> list[Json]:
    if "start_cost" not in data:
        return []
    count = data["start_count"] if "start_count" in data else data["start_cost"] ** 0  # a file from before counts one
    columns = (*(data[f"start_{key}"].values for key in ("cost", "estimate", "evaluations")), count.values)
    return [
        {"cost": float(cost), "estimate": estimate.tolist(), "evaluations": int(evaluations), "count": int(count)}
        for cost, estimate, evaluations, count in zip(*columns, strict=True)
    ]


def _fit_verdict(data: Any) -> Json:
    """The numbers with their standard errors, and whether the data agree with them."""
    parts = []
    for one in _found_numbers(data):
        divisor, unit = prefix([one["estimate"]], one["units"])
        known = np.isfinite(one["standard_error"]) and not one["at_bound"]
        lost = " (on its bound)" if one["at_bound"] else " (not determined)"
        spread = f" ± {number(one['standard_error'] / divisor, 2)}" if known else lost
        told = f"{one['symbol']} = {number(one['estimate'] / divisor)}{spread}"
        parts.append(f"{told} {pretty(unit)}".removesuffix(" 1"))
    doubts = [words for words, doubt in fit_doubts(data) if doubt]
    agree = "; ".join(doubts) if doubts else "nothing in the data speaks against the study"
    return {"text": f"{', '.join(parts)}; {agree}.", "how": "", "ok": not doubts}
