"""What the page has of a run: axes, numbers of every point and level, reasons, the verdict in one sentence."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from tcstudy.reports.page.container import Container, Json
from tcstudy.reports.page.stored import PointStatus, Stored, axis_names, different_energies, pretty, scaled_labels
from tcstudy.scene.key import symbol

Array = NDArray[np.float64]

ROOM_FOR_DOUBLES = 300_000
"""Bytes of numbers up to which the page has all digits; beyond it has seven (the energy always has all)."""

QUANTITIES = (
    "u_T_max", "slip_length", "friction_resultant", "energy", "theta_mean", "uniqueness_margin", "inclusion_residual",
    "error_estimate", "goal", "goal_estimate", "goal_error", "iterations", "lambda_1", "omega", "time_solve",
    "time_condense", "heat_balance", "evaluations",
)  # fmt: skip
"""Numbers by sweep point and level in the order in which they are offered."""

FLAGS = ("status", "unique", "strict_minimum", "global_minimum", "heat_status", "start_used")
LEVEL_NUMBERS = ("h_max", "n_dof", "n_contact", "time_mesh", "time_assemble")

FEWEST, STEEP, NOTABLE = 4, 4.0, 0.25
"""A jump is told from a slope where a line has so many points, a step is so many times the median of the others and
so large a part of the largest value of the whole line."""


def run_part(stored: Stored, box: Container) -> Json:
    """Axes, numbers and flags, with points flattened in C order of the sweep."""
    data = stored.data
    dims = [str(d) for d in data["status"].dims if d != "level"]
    shape = [int(data.sizes[d]) for d in dims]
    points, levels = int(np.prod(shape, dtype=int)), int(data.sizes["level"])

    def flat(name: str) -> Any:
        own = data[name].transpose(*dims, "level", ...)
        return own.values.reshape(points, levels, *own.shape[len(dims) + 1 :])

    names = [name for name in QUANTITIES if name in data and np.isfinite(flat(name)).any()]
    kind = "f8" if points * levels * len(names) * 8 <= ROOM_FOR_DOUBLES else "f4"
    numbers = {
        name: {
            "long_name": ": ".join(data[name].attrs.get(key, "") for key in ("long_name", "comment")).rstrip(": "),
            "units": str(data[name].attrs.get("units", "1")),
            "v": box.array(flat(name), "f8" if name == "energy" else kind),
        }
        for name in names
    }
    reasons = flat("reason")
    texts = sorted({str(one) for one in reasons.ravel()} - {""})
    place = {text: i + 1 for i, text in enumerate(texts)}
    return {
        "mode": str(data.attrs["sweep_mode"]),
        "dims": dims,
        "shape": shape,
        "axes": axes(data),
        "levels": {name: data[name].values.tolist() for name in LEVEL_NUMBERS if name in data},
        "stop": [str(one) for one in data["stop"].values] if "stop" in data else [],
        "units": {name: str(data[name].attrs.get("units", "1")) for name in LEVEL_NUMBERS if name in data},
        "numbers": numbers,
        "flags": {name: box.array(flat(name), "i1") for name in FLAGS if name in data},
        "statuses": [status.name.lower().replace("_", " ") for status in PointStatus],
        "reasons": ["", *texts],
        "reason": box.array([[place.get(str(one), 0) for one in row] for row in reasons], "u2"),
        "starts": [str(one) for one in data["start"].values] if "start" in data else [],
        "start_energy": box.array(flat("start_energy"), "f8") if "start_energy" in data else None,
        "verdict": verdict(data),
    }


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
                "values": [float(v) if number else str(v) for v in values],
                "dim": str(data[name].dims[0]),
            }
        )
    return found


def verdict(data: Any) -> Json:
    """The sentence that stands first, in parts: what was solved, proved, how exact it is, where the slip jumps."""
    fine = data.isel(level=-1)
    ok = fine["status"].values == int(PointStatus.OK)
    total, solved = int(ok.size), int(ok.sum())
    parts = [f"{solved} of {total} solved"]
    for name, words in (("unique", "proved unique"), ("global_minimum", "proved to have the least energy")):
        count = int(np.count_nonzero(ok & (fine[name].values == 1))) if name in fine else 0
        if name == "unique":
            parts.append(f"{count} {words}" if count else "none proved unique")
        elif count > _count(fine, "unique", ok):
            parts.append(f"{count} {words}")
    starts = fine["start_energy"].transpose(..., "start").values if "start_energy" in fine else np.zeros((*ok.shape, 1))
    several = int(np.count_nonzero(ok & (different_energies(starts) > 1)))
    if several:
        parts.append(f"{several} with more than one solution found")
    error, how = mesh_error(data, ok)
    if error is not None:
        parts.append(f"mesh error about {_percent(error)}")
    if places := jumps(fine, ok)[:2]:
        parts.append(f"slip jumps {' and '.join(places)}")
    bad = int(np.count_nonzero(data["heat_status"].values == 2)) if "heat_status" in data else 0
    if bad:
        parts.append(f"heat balance missed at {bad}")
    return {"text": ", ".join(parts) + ".", "how": how, "ok": solved == total}


def _count(fine: Any, name: str, ok: NDArray[np.bool_]) -> int:
    return int(np.count_nonzero(ok & (fine[name].values == 1))) if name in fine else 0


def _percent(error: float) -> str:
    return f"{100 * error:.2g} %" if error >= 1e-6 else f"{error:.1e}"


def mesh_error(data: Any, ok: NDArray[np.bool_]) -> tuple[float | None, str]:
    """The largest relative mesh error of the solved points and how it is known; None if it is not."""
    if "error_estimate" in data and np.isfinite(data["error_estimate"].isel(level=-1).values[ok]).any():
        estimates = data["error_estimate"].isel(level=-1).values[ok]
        return float(np.nanmax(estimates)), "largest estimated error of the displacement in the energy norm"
    if data.sizes["level"] < 2 or "friction_resultant" not in data or not ok.any():
        return None, "one mesh says nothing about its own error: add levels"
    resultant = data["friction_resultant"].values
    both = ok & (data["status"].values[..., -2] == int(PointStatus.OK))
    last, before = resultant[..., -1][both], resultant[..., -2][both]
    size = np.abs(last)
    if not len(size) or not np.any(size > 0.0):
        return None, "there is no friction to measure it by"
    change = np.max(np.abs(last - before)[size > 0.0] / size[size > 0.0])
    return float(change), "largest change of the friction resultant from the level before; first order is assumed"


def jumps(fine: Any, ok: NDArray[np.bool_]) -> list[str]:
    """Places between two neighbouring values of a swept number where the slip changes abruptly, the largest first."""
    if fine.attrs.get("sweep_mode") != "grid" or "u_T_max" not in fine:
        return []
    found: list[tuple[float, str]] = []
    slip, dims = fine["u_T_max"], [str(d) for d in fine["status"].dims]
    values = np.where(ok, slip.transpose(*dims).values, np.nan)
    for axis, name in enumerate(dims):
        labels = fine[name].values
        if labels.dtype.kind in "OUS" or len(labels) < FEWEST:
            continue
        lines = np.moveaxis(values, axis, -1)
        best = (0.0, "")
        for index in np.ndindex(*lines.shape[:-1]):
            step = np.abs(np.diff(lines[index]))
            if not np.isfinite(step).all():
                continue
            at = int(np.argmax(step))
            others = float(np.median(np.delete(step, at)))
            largest = float(np.max(np.abs(lines[index])))
            if step[at] > STEEP * others and step[at] > max(NOTABLE * largest, best[0]):
                where = dict(zip([d for d in dims if d != name], index, strict=True))
                best = (float(step[at]), _between(fine, name, at, where))
        if best[1]:
            found.append(best)
    return [text for _, text in sorted(found, reverse=True)]


def _between(fine: Any, name: str, at: int, where: dict[str, int]) -> str:
    """ "between θ̄ = 12 and 14 K (friction: brittle)"."""
    labels, unit = _labels(fine[name])
    ends = f"between {symbol(name)} = {labels[at]} and {labels[at + 1]} {unit}".rstrip()
    rest = []
    for other, i in where.items():
        if fine.sizes[other] > 1:
            labels, unit = _labels(fine[other])
            mark = ": " if fine[other].values.dtype.kind in "OUS" else " = "
            rest.append(f"{symbol(other)}{mark}{labels[i]} {unit}".rstrip())
    return ends + (f" ({', '.join(rest)})" if rest else "")


def _labels(axis: Any) -> tuple[list[str], str]:
    """The labels of an axis and their unit as it is read."""
    shown, unit = scaled_labels(axis.values.tolist(), str(axis.attrs.get("units", "1")))
    return shown, pretty(unit) if unit != "1" else ""
