"""What the page has of a fit: data, curve, residuals, what was found, and what the data do not determine."""

from __future__ import annotations

from typing import Any

import numpy as np

from tcstudy.reports.page.container import Container, Json
from tcstudy.reports.terminal.fit import BAND, columns, correlation, fit_doubts, prediction_error
from tcstudy.reports.text import number, prefix, pretty
from tcstudy.scene.key import symbol


def fit_part(data: Any, box: Container) -> Json:
    """Everything that a fit's file says, numbers in SI units."""
    given, measured = columns(data)
    error = prediction_error(data)
    named = {"given": "datum_given", "value": "datum", "at": "predicted_given", "predicted": "predicted",
             "residual": "residual", "noise": "noise"}  # fmt: skip
    found = {name: float(data.attrs[name]) for name in
             ("chi_square", "degrees_of_freedom", "fit_probability", "runs", "runs_probability", "known_noise",
              "given_noise", "information_criterion", "evaluations", "solves") if name in data.attrs}  # fmt: skip
    return {
        "given": [{"name": name, "units": units} for name, units in given],
        "measured": [{"name": name, "units": units} for name, units in measured],
        "data": {name: box.array(data[variable].values) for name, variable in named.items()}
        | {"error": box.array(error), "column": data["measured_column"].values.tolist()},
        "parameters": _parameters(data),
        "correlation": correlation(data).tolist(),
        "directions": [
            {"size": float(size), "vector": vector.tolist()}
            for size, vector in zip(data["singular_value"].values, data["singular_vector"].values, strict=True)
        ],
        "curve": _curve(data, box),
        "law": _law(data, box),
        "cost": data["cost"].values.tolist(),
        "starts": _starts(data),
        "numbers": found,
        "words": {name: str(data.attrs.get(name, "")) for name in
                  ("compare", "loss", "data_file", "data_sha256", "message", "not_determined", "determined")},
        "doubts": fit_doubts(data),
        "band": BAND,
        "verdict": _verdict(data),
    }  # fmt: skip


def _parameters(data: Any) -> list[Json]:
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


def _curve(data: Any, box: Container) -> Json | None:
    if "curve_given" not in data:
        return None
    folds = data["fold_vertex"].values.tolist() if "fold_vertex" in data else []
    return {"x": box.array(data["curve_given"].values), "y": box.array(data["curve_measured"].values), "folds": folds}


def _law(data: Any, box: Container) -> Json | None:
    if "law_slip" not in data:
        return None
    units = {key: str(data[f"law_{key}"].attrs["units"]) for key in ("slip", "traction")}
    return {key: box.array(data[f"law_{key}"].values) for key in ("slip", "traction", "error")} | {"units": units}


def _starts(data: Any) -> list[Json]:
    if "start_cost" not in data:
        return []
    columns = (data[f"start_{key}"].values for key in ("cost", "estimate", "evaluations"))
    return [
        {"cost": float(cost), "estimate": estimate.tolist(), "evaluations": int(count)}
        for cost, estimate, count in zip(*columns, strict=True)
    ]


def _verdict(data: Any) -> Json:
    """The numbers with their standard errors, and whether the data agree with them."""
    parts = []
    for one in _parameters(data):
        divisor, unit = prefix([one["estimate"]], one["units"])
        told = f"{one['symbol']} = {number(one['estimate'] / divisor)}"
        known = np.isfinite(one["standard_error"]) and not one["at_bound"]
        told += (
            f" ± {number(one['standard_error'] / divisor, 2)}"
            if known
            else " (on its bound)"
            if one["at_bound"]
            else " (not determined)"
        )
        parts.append(f"{told} {pretty(unit)}".removesuffix(" 1"))
    doubts = [words for words, doubt in fit_doubts(data) if doubt]
    agree = "; ".join(doubts) if doubts else "the data agree with the study"
    return {"text": f"{', '.join(parts)}; {agree}.", "how": "", "ok": not doubts}
