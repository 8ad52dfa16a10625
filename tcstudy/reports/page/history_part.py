"""What the page has of load histories: numbers of every step, what every node does in it, what cycles change.

A swept history has its points' totals as a run has its numbers, so that the map, the curves and the table of a run's
page show them.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from tcstudy.data.reading import asked, by_point, each_point
from tcstudy.data.records import PointStatus
from tcstudy.reports.page.container import Container, Json
from tcstudy.reports.page.point_part import geometry, shape
from tcstudy.reports.page.run_part import FLAGS, ROOM_FOR_DOUBLES, level_numbers, reasons, sweep_of
from tcstudy.reports.page.stored import Stored
from tcstudy.reports.sentences import KINDS
from tcstudy.reports.stored_study import at_rest
from tcstudy.reports.terminal.history_summary import MOVES, last_change, motion
from tcstudy.reports.text import counted, number
from tcstudy.scene.key import symbol

NUMBERS = (
    "friction_resultant", "u_T_max", "slip_length", "breathing_length", "debonded_length", "softening_length",
    "yielded_length", "elastic_length", "stored", "dissipated", "work", "released", "closure", "energy",
    "jumps", "inclusion_residual", "identity", "parts", "iterations",
)  # fmt: skip
"""Numbers of a step in the order in which they are offered."""
SUMS = ("dissipated", "released", "work", "jumps")
"""Those of which a point has the sum over its steps."""
MEMORY = ("kappa", "plastic")


def history_content(stored: Stored, without: tuple[str, ...], box: Container) -> Json:
    """All that a history's page has: the sweep as that of a run, and the steps."""
    data = stored.data

    def flat(name: str) -> Any:
        return by_point(data[name], data)

    solved = flat("status") == int(PointStatus.OK)
    changes = [last_change(data.isel(where)) for where in each_point(data)]
    loads = str(data.attrs["loads"]).split()
    lowest = data.attrs["branch"] == "lowest"
    kind = "f8" if solved.size * len(NUMBERS) * 8 <= ROOM_FOR_DOUBLES else "f4"
    history = {
        "steps": solved.shape[1],
        "loads": [_column(data, name, data[name].values.tolist()) for name in loads],
        "names": [str(one) for one in data["step_name"].values],
        "cycle": data["cycle"].values.tolist(),
        "numbers": [
            _column(data, name, box.array(flat(name), kind)) for name in (*NUMBERS, *asked(data)) if name in data
        ],
        "flags": {name: box.array(flat(name), "i1") for name in FLAGS if name in data},
        "changes": [change.words for change in changes],
        "moves": list(MOVES),
        "about": {
            "memory": str(data.attrs["memory"]),
            "each step": "the state of least energy found" if lowest else "along its exact path",
            "mesh": f"level {int(data['level'])}, {int(data['n_dof'])} unknowns, {int(data['n_contact'])} on the "
            "contact line",
        },
        "verdict": _verdict(data, solved, changes, flat("reason")),
        "line": None if "lines" in without else _line(stored, without, flat, solved, box),
    }
    return {
        "history": history,
        "run": _sweep(stored, flat, solved, box),
        **shape(stored.study),
    }


def _column(data: Any, name: str, values: Any) -> Json:
    """A number by step, with its units and what it is."""
    about = {key: data[name].attrs[key] for key in ("units", "long_name")}
    return {"name": name, "symbol": symbol(name), **about, "v": values}


def _line(stored: Stored, without: tuple[str, ...], flat: Any, solved: NDArray[np.bool_], box: Container) -> Json:
    """The contact line with slip, traction, memory and motion of all points and steps, flattened in this order."""
    data, m = stored.data, int(stored.data.sizes["node"])
    moved = np.zeros((*solved.shape, m), dtype=np.int8)
    u_T, jumped = flat("u_T"), flat("jumped") if "jumped" in data else None
    for p, done in enumerate(np.count_nonzero(solved, axis=1)):
        if done:
            moved[p, :done] = motion(u_T[p, :done], None if jumped is None else jumped[p, :done])
    held = any(name.startswith("u_") for name in str(data.attrs["loads"]).split())
    memory = [name for name in MEMORY if name in data and "memory" not in without]
    return {
        **geometry(data, box),
        "u_T": box.rows(u_T.reshape(-1, m)),
        "xi": box.rows(flat("xi").reshape(-1, m)),
        "memory": [_column(data, name, box.rows(flat(name).reshape(-1, m))) for name in memory],
        "state": box.array(moved.reshape(-1, m), "i1"),
        "u_T_units": str(data["u_T"].attrs["units"]),
        "xi_units": str(data["xi"].attrs["units"]),
        "rest": at_rest(stored.study) and not held,
    }


def _sweep(stored: Stored, flat: Any, solved: NDArray[np.bool_], box: Container) -> Json:
    """Totals of every point in the form of a run of one level."""
    data, done, whole = stored.data, solved.any(axis=1), solved.all(axis=1)
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
        "stop": [],
        "numbers": {
            name: {"long_name": about[name]["long_name"], "units": about[name]["units"], "v": box.array(values)}
            for name, values in totals.items()
        },
        "flags": {name: box.array(values, "i1") for name, values in flags.items()},
        **reasons(flat("reason")[:, None], box),
        "starts": [],
        "start_energy": None,
    }


def _verdict(data: Any, solved: NDArray[np.bool_], changes: list[Any], reasons: Any) -> Json:
    """How far the histories were followed, what jumps, what a cycle changes, how exact it is."""
    points, steps = solved.shape
    whole = int(np.count_nonzero(solved.all(axis=1)))
    cycles = int(data["cycle"].max())
    what = f"{counted(steps - 1, 'step')} in {counted(cycles, 'cycle')}"
    if points == 1:
        done = int(np.count_nonzero(solved)) - 1
        parts = [f"All {what} solved" if whole else f"{max(done, 0)} of {what} solved, then: {reasons[0]}"]
        parts += [changes[0].words] if changes[0].words else []
    else:
        parts = [f"{whole} of {points} histories of {what} followed to their end"]
        kinds = [change.kind for change in changes if change.kind]
        parts += [", ".join(f"{kinds.count(kind)} {KINDS[kind]}" for kind in dict.fromkeys(kinds))] if kinds else []
    jumps = int(np.where(solved, data["jumps"].values.reshape(solved.shape), 0).sum())
    parts.append(counted(jumps, "jump") if jumps else "no jumps")
    worst = data["inclusion_residual"].values.reshape(solved.shape)[solved]
    if len(worst):
        parts.append(f"worst residual {number(float(worst.max()), 2)}")
    return {"text": "; ".join(parts) + ".", "how": "", "ok": whole == points}
