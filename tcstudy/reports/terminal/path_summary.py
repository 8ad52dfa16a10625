"""The summary of a path's file as text."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tcstudy.reports import sentences
from tcstudy.reports.sentences import closed_loop, equilibria_at, state_taken
from tcstudy.reports.terminal.tables import Heading, Part, Table
from tcstudy.reports.text import counted, digits_lost, headed, number, prefix, proved, with_unit
from tcstudy.scene.keys import symbol

MOST_ROWS = 60
"""Solutions that are listed; the file has them all."""

STATES = ("sticks", "slips", "slips and softens", "on a drop of b", "slips, weakened")
"""What a contact node does, by ContactState."""

VISIBLE = 0.005
"""Part of the range below which a step back of the parameter cannot be told from a point of the picture."""


def seen_folds(data: Any) -> tuple[NDArray[np.intp], int]:
    """(vertices of the folds that show, number of smaller turns): these come from nodes that let go one by one."""
    if not data.sizes.get("fold", 0):
        return np.zeros(0, dtype=np.intp), 0
    vertices = data["fold_vertex"].values.astype(np.intp)
    low, high = data.attrs["parameter_range"]
    large = data["fold_size"].values >= VISIBLE * abs(float(high) - float(low))
    return vertices[large], int(np.count_nonzero(~large))


def parts(data: Any, *_: Any) -> Iterator[Part]:
    """What a path's file holds: its extent and ends, the branches, the requested solutions, the loop."""
    yield Heading(str(data.attrs["title"]), 1)
    yield from filter(None, (_path(data), _branches(data)))
    yield from _solutions(data)
    yield from filter(None, (_loop(data),))


def verdict(data: Any) -> tuple[str, str, bool]:
    """Where friction is largest, where the path snaps back, how many equilibria there are; what is known of others."""
    low, high = sorted(float(x) for x in data.attrs["parameter_range"])
    t, units, c = data["parameter"].values, str(data["parameter"].attrs["units"]), data["c"].values
    name, inside = symbol(str(data.attrs["parameter"])), (t >= low) & (t <= high)
    force, stress = np.where(inside, np.abs(data["xi"].values @ c), 0.0), str(data["xi"].attrs["units"])
    k = int(np.argmax(force))
    whole, mean = with_unit(force[k], "1" if stress == "1" else "N m-1"), with_unit(force[k] / c.sum(), stress)
    peak = f"∫ξ {whole}, {mean} in the mean, at {name} = {with_unit(t[k], units)}"
    turning, maxima = data["fold_vertex"].values.tolist() if "fold_vertex" in data else [], data.get("fold_maximum")
    limit = dict(zip(turning, maxima.values.tolist(), strict=True)) if maxima is not None else {}
    vertices = [v for v in seen_folds(data)[0].tolist() if inside[v]]
    snaps = [
        f"{with_unit(t[a], units)} to {with_unit(t[b], units)}"
        for a, b in pairwise(vertices)
        if limit[a] and not limit[b]
    ]
    loops = f", {counted(int(data['branch_loop'].sum()), 'closed loop')}" if "branch_loop" in data else ""
    many, falls = _most(t, low, high, units) + loops, int(data.sizes.get("jump", 0))
    happens = sentences.path(peak if force[k] > 0.0 else "", snaps, many, falls)
    known = sentences.WHOLE if int(data.get("complete", 0)) else sentences.CONNECTED
    text = sentences.answered(happens, [f"worst residual {number(float(data['residual'].max()), 2)}"])
    return text, known, True


def _most(t: NDArray[np.float64], low: float, high: float, units: str) -> str:
    """How many equilibria of the path there are at most at one value of its range, and between which values."""
    ends = np.unique(np.clip(t, low, high))
    middle = 0.5 * (ends[1:] + ends[:-1])
    a, b = np.minimum(t[1:], t[:-1]), np.maximum(t[1:], t[:-1])
    count = np.searchsorted(np.sort(a), middle) - np.searchsorted(np.sort(b), middle)
    if not len(count) or count.max() < 2:
        return "one equilibrium on it at every value of the range" if len(count) else ""
    at = np.flatnonzero(count == count.max())
    first, last = (with_unit(ends[i], units) for i in (at[0], at[-1] + 1))
    return f"{count.max()} equilibria on it between {first} and {last}"


def _path(data: Any) -> str:
    """Where the path runs, how it was computed, and why it ends."""
    low, high = data.attrs["parameter_range"]
    t = data["parameter"].values
    units = data["parameter"].attrs["units"]
    divisor, unit = prefix([float(low), float(high)], units)
    followed = f"{number(t.min() / divisor)} … {number(t.max() / divisor)}"
    span = f"from {number(low / divisor)} to {number(high / divisor)} {unit}".removesuffix(" 1")
    vertices, small = seen_folds(data)
    folds = t[vertices]
    turns = f" and {counted(small, 'turn')} below {100 * VISIBLE:g} % of the range" if small else ""
    inside = int(np.count_nonzero((folds >= min(low, high)) & (folds <= max(low, high))))
    stable = int(data["stable"].sum())
    lost = digits_lost(float(data.get("lambda_1_error", 0.0)))
    lines = [
        f"  Path along {data.attrs['parameter']} {span}, reaching {followed}",
        f"  level {int(data['level'])}: {int(data['n_dof'])} dofs, {int(data['n_contact'])} contact unknowns; "
        f"omega/lambda_1 = {number(float(data['omega'] / data['lambda_1']))}",
        *([f"  {lost}"] if lost else []),
        f"  {data.sizes['piece']} pieces ({stable} stable), {counted(len(folds), 'fold')}{turns}, "
        f"{inside} of the folds in the range, worst residual {number(float(data['residual'].max()), 2)}",
    ]
    if float(data["law_error"]) > 0.0:
        lines.append(f"  the law is replaced by straight pieces, relative error {number(float(data['law_error']), 1)}")
    ends = [("begins", "begin"), ("ends", "end")]
    lines += [f"  {verb} at {number(t[at] / divisor)} {unit}".removesuffix(" 1") + f": {data.attrs[f'{name}_reason']}"
              for (verb, name), at in zip(ends, (0, -1), strict=True)]  # fmt: skip
    return "\n".join(lines)


def _branches(data: Any) -> str:
    """What is known of all branches, the loops among them, and the number of equilibria at the requested values."""
    if "complete" not in data:
        return ""
    complete, closed = bool(data["complete"]), data["branch_loop"].values.astype(bool)
    of, t, stable = (data[f"branch_{name}"].values for name in ("of", "parameter", "stable"))
    divisor, unit = prefix([float(x) for x in data.attrs["parameter_range"]], data["parameter"].attrs["units"])
    polygon = " of the law's polygon" if float(data["law_error"]) > 0.0 else ""
    apart = np.count_nonzero(~closed & ~data["branch_on_path"].values.astype(bool))
    open_ = int(np.count_nonzero(~closed))
    count = f"{open_} open branch{'es' if open_ != 1 else ''}"
    count += f" ({apart} not on the path in the range)" if apart else ""
    told = f"{count} and {counted(int(closed.sum()), 'closed loop')}{polygon}"
    lines = [f"  every branch of the range: {told}; complete (proved)"]
    if not complete:
        lines = [f"  branches found in the range: {told}; not proved complete: {data.attrs['complete_reason']}"]
    for k in np.flatnonzero(closed & (data["branch_on_path"].values == 0)):
        own = t[of == k] / divisor
        low, high = number(own.min()), f"{number(own.max())} {unit}".removesuffix(" 1")
        lines.append(f"  {closed_loop(low, high, len(own) - 1, int(stable[of == k].sum()))}")
    if not polygon:
        known = data["at_complete"].values if "at_complete" in data else [complete] * data.sizes.get("at", 0)
        for i, value in enumerate(data["at"].values if data.sizes.get("at", 0) else []):
            on = data["solution_piece"].values[data["solution_at"].values == i]
            told = f"{number(value / divisor)} {unit}".removesuffix(" 1")
            lines.append(f"  {equilibria_at(len(on), int(np.count_nonzero(on < 0)), told, bool(known[i]))}")
    return "\n".join(lines)


def _solutions(data: Any) -> Iterator[Table]:
    """One row per solution at the requested values."""
    if not data.sizes.get("at", 0):
        return
    c = data["c"].values
    names = ("solution_parameter", "solution_energy", "solution_stable", "solution_lowest", "solution_residual")
    t, energy, stable, least, residual = (data[name].values if name in data else np.zeros(0) for name in names)
    slip = data["solution_u_T"].values @ c / c.sum() if len(t) else np.zeros(0)
    columns = ((data["at"].values, "at"), (slip, "u_T"), (energy, "energy"))
    scales = [prefix([float(np.max(np.abs(x), initial=0.0))], data[name].attrs["units"]) for x, name in columns]
    titles = (data.attrs["parameter"].split(".")[-1], "mean u_T", "energy")
    header = [headed(name, unit) for name, (_, unit) in zip(titles, scales, strict=True)]
    header += ["stable", "least" if "complete" in data else "least on path", "certified", "residual"]
    rows = []
    for i in range(min(len(t), MOST_ROWS)):
        values = (t[i], slip[i], energy[i])
        row = [number(value / scale, 5) for value, (scale, _) in zip(values, scales, strict=True)]
        proof = proved(data.isel(solution=i), "solution_")
        row += ["yes" if stable[i] else "no", "yes" if least[i] else "no", proof, number(residual[i], 2)]
        rows.append(row)
    counts = zip(data["at"].values, data["solution_count"].values, strict=True)
    missing = [number(value / scales[0][0]) for value, count in counts if not count]
    notes = [f"… {len(t) - MOST_ROWS} more solutions in the file"] if len(t) > MOST_ROWS else []
    notes += [f"no solution on the path at {', '.join(missing)}"] if missing else []
    yield Table("", tuple(header), tuple(map(tuple, rows)), tuple(notes))


def taken_state(data: Any) -> str:
    """Where all branches are known, a line on the stable state in which the way to the end of the range ends."""
    if not int(data.get("complete", 0)) or "loop_energy" not in data:
        return ""
    end = float(data.attrs["parameter_range"][1])
    of, t, stable = (data[f"branch_{name}"].values for name in ("of", "parameter", "stable"))
    first = np.append(True, of[1:] != of[:-1])
    last = np.append(first[1:], True)
    beside = np.where(first, stable, np.roll(stable, 1))  # the piece that a branch's end is on
    at = np.flatnonzero((first | last) & (t == end) & (beside != 0))
    turn = int(np.argmin(np.abs(data["loop_parameter"].values - end)))
    apart = np.abs(data["branch_u_T"].values[at] - data["loop_u_T"].values[turn]).max(axis=1, initial=0.0)
    if not len(at):
        return ""
    rank = int(np.argsort(np.argsort(data["branch_energy"].values[at]))[np.argmin(apart)]) + 1
    return f"\n    {state_taken(len(at), rank, with_unit(end, data['parameter'].attrs['units']))}"


def _loop(data: Any) -> str:
    """The energy lost in the loop and where the body falls."""
    if "energy_lost" not in data:
        return ""
    units = data["energy_lost"].attrs["units"]
    if not int(data["loop_complete"]):
        return f"  hysteresis loop not completed: {data.attrs['loop_reason']}"
    text = f"  hysteresis loop: {with_unit(float(data['energy_lost']), units)} lost"
    if not data.sizes.get("jump", 0):
        return text + ", the body never falls to another branch" + taken_state(data)
    t_units = data["parameter"].attrs["units"]
    falls = (data[name].values for name in ("jump_parameter", "jump_rising", "jump_drop"))
    for t, rising, drop in zip(*falls, strict=True):
        way = "rising" if rising else "falling"
        text += f"\n    falls at {with_unit(t, t_units)} ({way}), {with_unit(drop, units)} lost"
    text += taken_state(data)
    return text if int(data["loop_closed"]) else text + "\n    the loop does not close"
