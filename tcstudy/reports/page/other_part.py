"""What the page has of files of converge, cost and path."""

from __future__ import annotations

from typing import Any

import numpy as np

from tcstudy.data.measured import ERRORS, NUMBERS, VERDICTS
from tcstudy.data.reading import by_point, sweep_dims
from tcstudy.data.records import PointStatus
from tcstudy.errors import DrawError
from tcstudy.reports.page.container import Container, Json
from tcstudy.reports.page.point_part import geometry
from tcstudy.reports.page.run_part import axes
from tcstudy.reports.page.stored import Stored
from tcstudy.reports.terminal.cost import advice, measure_of, settings
from tcstudy.reports.terminal.path_summary import seen_folds

PATH_BYTES = 4_000_000
"""Room for slip and traction along a path; a longer one is thinned."""


def convergence_part(stored: Stored, box: Container) -> Json:
    """Errors, rates, expected orders and extrapolated numbers of every sweep point."""
    data = stored.data
    dims = sweep_dims(data)

    def flat(name: str) -> Any:
        return by_point(data[name], data)

    sizes = data[["h_max", "n_dof", "n_contact"]]
    if sizes["h_max"].ndim > 1:  # of several geometries: of every point
        sizes = sizes.broadcast_like(data["status"]).stack(at=dims).transpose("at", "level")
    errors: list[Json] = [
        {
            "name": m.name,
            "symbol": m.symbol,
            "error": box.array(flat(f"error_{m.name}")),
            "rate": box.array(flat(f"rate_{m.name}")),
            **{part: flat(f"{part}_{m.name}") for part in ("slope", "slope_error", "expected", "first_level")},
            "verdict": [VERDICTS[int(v)].replace("_", " ") for v in flat(f"verdict_{m.name}")],
            "reason": [str(v) for v in flat(f"reason_{m.name}")],
        }
        for m in ERRORS
        if f"error_{m.name}" in data and np.isfinite(flat(f"error_{m.name}")).any()
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
        "axes": axes(data),
        "dims": dims,
        "shape": [int(data.sizes[d]) for d in dims],
        "mode": str(data.attrs["sweep_mode"]),
        "levels": {name: sizes[name].values.tolist() for name in ("h_max", "n_dof", "n_contact")},
        "h_units": str(data["h_max"].attrs["units"]),
        "reference": str(data.attrs["reference"]),
        "notes": [note for note in str(data.attrs["notes"]).split("\n") if note],
        "status": box.array(flat("status"), "i1"),
        "errors": errors,
        "numbers": numbers,
        "verdict": _convergence_verdict(errors, flat("status")),
    }


def _convergence_verdict(errors: list[Json], status: Any) -> Json:
    told = [verdict for error in errors for verdict in error["verdict"]]
    good = sum(verdict in ("as expected", "faster", "exact") for verdict in told)
    unknown = sum(verdict in ("unknown", "too few levels") for verdict in told)
    solved = bool(np.all(status == int(PointStatus.OK)))
    parts = [f"{good} of {len(told) - unknown} measured orders are as expected or better"]
    early = sum(verdict == "pre asymptotic" for verdict in told)
    parts += [f"{early} not yet settled (pre-asymptotic)"] if early else []
    slow = sorted({str(error["symbol"]) for error in errors if "slower" in error["verdict"]})
    parts += ["slower than expected: " + ", ".join(slow)] if slow else []
    parts += [] if solved else ["some levels were not solved"]
    if not told:
        parts = ["nothing could be compared: there is no reference"]
    return {"text": "; ".join(parts) + ".", "how": "", "ok": solved and not slow}


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
        rows = [
            {key: getattr(s, key) for key in ("family", "solver", "level", "h_max", "n_dof", "n_contact", "error",
             "time", "upper", "dominated", "solved", "own")} | {"stages": _stages(data, s)}
            for s in found
        ]  # fmt: skip
        charts.append({"name": name, "rows": rows, "advice": advice(found)})
    first = next((c for c in charts if c["name"] == "u_energy"), charts[0] if charts else None)
    return {
        "reference": str(data.attrs["reference"]),
        "point": str(data.attrs.get("point", "")),
        "notes": [note for note in str(data.attrs.get("notes", "")).split("\n") if note],
        "h_units": str(data["h_max"].attrs.get("units", "1")),
        "charts": charts,
        "verdict": {"text": " ".join(first["advice"]) if first else "Nothing was measured.", "how": "", "ok": True},
    }


def _stages(data: Any, setting: Any) -> dict[str, float]:
    at = {
        "family": data["family"].values.tolist().index(setting.family),
        "solver": data["solver"].values.tolist().index(setting.solver),
        "level": setting.level,
    }
    names = ("mesh", "assemble", "condense", "solve", "steps")
    return {name: float(data[f"time_{name}"].isel(at)) for name in names if f"time_{name}" in data}


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
        "numbers": {
            name: float(data[name])
            for name in ("level", "h_max", "n_dof", "n_contact", "lambda_1", "omega", "law_error", "energy_lost")
            if name in data
        },
        "ends": [str(data.attrs.get("begin_reason", "")), str(data.attrs.get("end_reason", ""))],
        "verdict": _path_verdict(data, low, high, folds, turns),
    }


def _path_verdict(data: Any, low: float, high: float, folds: Any, turns: int) -> Json:
    t = data["parameter"].values
    inside = int(np.count_nonzero((t[folds] >= min(low, high)) & (t[folds] <= max(low, high)))) if len(folds) else 0
    pieces, stable = int(data.sizes["piece"]), int(data["stable"].sum())
    folded = f"{inside} {'fold' if inside == 1 else 'folds'} in the range asked for"
    parts = [f"One path of {pieces} pieces, {stable} of them stable, with {folded}"]
    parts += [f"{turns} smaller turns of the parameter, as nodes let go one by one"] if turns else []
    if data.sizes.get("at", 0):
        most = int(data["solution_count"].max())
        parts.append(f"up to {most} solution{'s' if most != 1 else ''} at the values asked for")
    if data.sizes.get("jump", 0):
        parts.append(f"the body falls to another branch {data.sizes['jump']} times in a loop")
    parts.append(f"worst residual {float(data['residual'].max()):.1e}")
    return {"text": ", ".join(parts) + ".", "how": "other paths may exist that are not connected to it", "ok": True}
