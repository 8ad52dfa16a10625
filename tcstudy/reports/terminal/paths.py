"""What the files of paths and load histories say: a sentence, their tables, and what happens along
them."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tcstudy.data.reading import asked, by_point, each_point
from tcstudy.data.schema import PointStatus
from tcstudy.reports import sentences
from tcstudy.reports.select_point import describe
from tcstudy.reports.sentences import KINDS, LENGTHS, cycle_change
from tcstudy.reports.text import (
    Heading,
    Part,
    Table,
    TextColumn,
    columns_table,
    counted,
    digits_lost,
    number,
    prefix,
    proved,
    quantity,
    with_unit,
)
from tcstudy.scene.histories import AT_REST
from tcstudy.scene.keys import symbol

Array = NDArray[np.float64]

MOST_ROWS = 60
"""Solutions that are listed; the file has them all."""
STATES = ("sticks", "slips", "slips and softens", "on a drop of b", "slips, weakened")
"""What a contact node does, by ContactState."""


# -- paths
# -------------------------------------------------------------------------------------------------------------


def folds_of(data: Any) -> NDArray[np.intp]:
    """Vertices of the folds; older files list smaller turns, too, with how far t steps back at
    each."""
    found = (
        data["fold_vertex"].values.astype(np.intp)
        if "fold_vertex" in data
        else np.zeros(0, dtype=np.intp)
    )
    if "fold_size" not in data:
        return found
    return found[
        data["fold_size"].values >= 0.005 * abs(float(np.diff(data.attrs["parameter_range"])[0]))
    ]


def path_verdict(data: Any) -> tuple[str, str, bool]:
    """Where friction is largest, where the path snaps back, how many equilibria there are; what is
    known of others."""
    low, high = sorted(float(x) for x in data.attrs["parameter_range"])
    t, units, c = data["parameter"].values, str(data["parameter"].attrs["units"]), data["c"].values
    inside = (t >= low) & (t <= high)
    force, stress = (
        np.where(inside, np.abs(data["xi"].values @ c), 0.0),
        str(data["xi"].attrs["units"]),
    )
    k = int(np.argmax(force))
    whole, mean = (
        with_unit(force[k], "1" if stress == "1" else "N m-1"),
        with_unit(force[k] / c.sum(), stress),
    )
    at = f"at {symbol(str(data.attrs['parameter']))} = {with_unit(t[k], units)}"
    peak = [f"peak ∫ξ {whole}, {mean} in the mean, {at}" if force[k] > 0.0 else "no friction"]
    snaps = [(a, b) for a, b in pairwise(folds_of(data)) if inside[a] and t[a] > t[b]]
    peak += [
        f"snap-back from {with_unit(t[a], units)} to {with_unit(t[b], units)}" for a, b in snaps[:2]
    ]
    peak += [f"and {len(snaps) - 2} more"] if len(snaps) > 2 else []
    many, falls = _most(t, low, high, units), int(data.sizes.get("jump", 0))
    many += (
        f", {counted(int(data['branch_loop'].sum()), 'closed loop')}"
        if "branch_loop" in data
        else ""
    )
    lost = f"slow loading to and fro falls {counted(falls, 'time')}" if falls else ""
    known = sentences.WHOLE if int(data.get("complete", 0)) else sentences.CONNECTED
    trust = [f"worst residual {number(float(data['residual'].max()), 2)}"]
    return sentences.answered([", ".join(peak), many, lost], trust), known, True


def _most(t: Array, low: float, high: float, units: str) -> str:
    """How many equilibria of the path there are at most at one value of its range, and between
    which values."""
    ends = np.unique(np.clip(t, low, high))
    middle = 0.5 * (ends[1:] + ends[:-1])
    a, b = np.minimum(t[1:], t[:-1]), np.maximum(t[1:], t[:-1])
    count = np.searchsorted(np.sort(a), middle) - np.searchsorted(np.sort(b), middle)
    if not len(count) or count.max() < 2:
        return "one equilibrium on it at every value of the range" if len(count) else ""
    at = np.flatnonzero(count == count.max())
    first, last = with_unit(ends[at[0]], units), with_unit(ends[at[-1] + 1], units)
    where = f"near {first}" if first == last else f"between {first} and {last}"
    return f"{count.max()} equilibria on it {where}"


def path_parts(data: Any, *_: Any) -> Iterator[Part]:
    """What a path's file holds: its extent and ends, the branches, the loop, the requested
    solutions."""
    divisor, unit = prefix(
        [float(x) for x in data.attrs["parameter_range"]], data["parameter"].attrs["units"]
    )

    def at(value: Any, *more: Any) -> str:
        return (
            f"{' to '.join(number(one / divisor) for one in (value, *more))} {unit}".removesuffix(
                " 1"
            )
        )

    yield Heading(str(data.attrs["title"]), 1)
    told = [*_path(data, at), *(_branches(data, at) if "complete" in data else ())]
    yield "\n".join([*told, _loop(data, at)] if "energy_lost" in data else told)
    if data.sizes.get("at", 0):
        yield _solutions(data, at)


def _path(data: Any, at: Callable[..., str]) -> Iterator[str]:
    """Where the path runs, how it was computed, and why it ends."""
    low, high = data.attrs["parameter_range"]
    t, vertices = data["parameter"].values, folds_of(data)
    inside = int(
        np.count_nonzero((t[vertices] >= min(low, high)) & (t[vertices] <= max(low, high)))
    )
    yield f"  Path along {data.attrs['parameter']} from {at(low, high)}, reaching {at(t.min(), t.max())}"
    yield (
        f"  level {int(data['level'])}: {int(data['n_dof'])} dofs, {int(data['n_contact'])} contact unknowns; "
        f"omega/lambda_1 = {number(float(data['omega'] / data['lambda_1']))}"
    )
    if lost := digits_lost(float(data.get("lambda_1_error", 0.0))):
        yield f"  {lost}"
    yield (
        f"  {data.sizes['piece']} pieces ({int(data['stable'].sum())} stable), {counted(len(vertices), 'fold')}"
        f", {inside} of the folds in the range, worst residual {number(float(data['residual'].max()), 2)}"
    )
    if float(data["law_error"]) > 0.0:
        yield f"  the law is replaced by straight pieces, relative error {number(float(data['law_error']), 1)}"
    yield f"  begins at {at(t[0])}: {data.attrs['begin_reason']}"
    yield f"  ends at {at(t[-1])}: {data.attrs['end_reason']}"


def _branches(data: Any, at: Callable[..., str]) -> Iterator[str]:
    """What is known of all branches, the loops among them, and the number of equilibria at the
    requested values."""
    closed, on_path = (data[f"branch_{name}"].values.astype(bool) for name in ("loop", "on_path"))
    of, t, apart = (
        data["branch_of"].values,
        data["branch_parameter"].values,
        int(np.sum(~closed & ~on_path)),
    )
    told = f"{(~closed).sum()} open branch{'es' if (~closed).sum() != 1 else ''}"
    told += f" ({apart} not on the path in the range)" if apart else ""
    told += f" and {counted(int(closed.sum()), 'closed loop')}"
    told += " of the law's polygon" if (polygon := float(data["law_error"]) > 0.0) else ""
    if data["complete"]:
        yield f"  every branch of the range: {told}; complete (proved)"
    else:
        yield f"  branches found in the range: {told}; not proved complete: {data.attrs['complete_reason']}"
    for k in np.flatnonzero(closed & ~on_path):
        yield f"  a closed loop from {at(t[of == k].min(), t[of == k].max())} that the path does not meet"
    if polygon or not data.sizes.get("at", 0):
        return
    off_path = np.bincount(
        data["solution_at"].values[data["solution_piece"].values < 0], minlength=data.sizes["at"]
    )
    values, known, counts = (data[name].values for name in ("at", "at_complete", "solution_count"))
    for value, sure, count, off in zip(values, known, counts, off_path, strict=True):
        told = f"{sentences.equilibria(count, complete=sure)} equilibri{'um' if count == 1 else 'a'} at {at(value)}"
        yield f"  {told}" + (f", {off} of them not on the path from the start" if off else "")


def _solutions(data: Any, at: Callable[..., str]) -> Part:
    """One row per solution at the requested values."""
    every, columns = int(data.sizes.get("solution", 0)), list[TextColumn]()
    if every:
        shown, c = data.isel(solution=slice(MOST_ROWS)), data["c"].values
        numbers = {
            data.attrs["parameter"].split(".")[-1]: (
                shown["solution_parameter"].values,
                "parameter",
            ),
            "mean u_T": (shown["solution_u_T"].values @ c / c.sum(), "u_T"),
            "energy": (shown["solution_energy"].values, "energy"),
        }
        for title, (values, name) in numbers.items():
            like = data.attrs["parameter_range"] if name == "parameter" else np.abs(values).max()
            columns.append(quantity(title, values, data[name].attrs["units"], 5, like=like))
        for title, name in (
            ("stable", "stable"),
            ("least" if "complete" in data else "least on path", "lowest"),
        ):
            columns.append(
                TextColumn(
                    title, [("no", "yes")[int(one)] for one in shown[f"solution_{name}"].values], 1
                )
            )
        proofs = [
            proved(shown.isel(solution=i), "solution_") for i in range(shown.sizes["solution"])
        ]
        columns += [
            TextColumn("certified", proofs, 2),
            quantity("residual", shown["solution_residual"].values, "1", 2, 3),
        ]
    notes = [f"… {every - MOST_ROWS} more solutions in the file"] if every > MOST_ROWS else []
    missing = [at(value) for value in data["at"].values[data["solution_count"].values == 0]]
    notes += [f"no solution on the path at {', '.join(missing)}"] if missing else []
    return Table("", columns, tuple(notes)) if every else f"  {notes[0]}"


def _loop(data: Any, at: Callable[..., str]) -> str:
    """The energy lost in the loop, and where most of it."""
    units, falls = str(data["energy_lost"].attrs["units"]), int(data.sizes.get("jump", 0))
    if not int(data["loop_complete"]):
        return f"  hysteresis loop not completed: {data.attrs['loop_reason']}"
    told = f"  hysteresis loop: {with_unit(float(data['energy_lost']), units)} lost"
    if not falls:
        return f"{told}, the body never falls to another branch"
    most = data.isel(jump=int(np.argmax(data["jump_drop"].values)))
    told += (
        f" in {counted(falls, 'fall')}, at most {with_unit(float(most['jump_drop']), units)} at "
    )
    told += f"{at(float(most['jump_parameter']))} ({'rising' if int(most['jump_rising']) else 'falling'})"
    return told if int(data["loop_closed"]) else f"{told}; it does not close"


# -- histories
# ---------------------------------------------------------------------------------------------------------

MOST_CYCLES, MOST_POINTS = 3, 20
"""Cycles of one point whose steps are listed, and points that have a line; the file has them
all."""
MOVES = ("rests", "slides along t", "slides back", "jumps")
"""What a node may do in a step."""
MISSED = 0.01
"""Part of the energy dissipated from which on it is said that finite steps miss so much of the
energy."""
ROUNDING = 1e-10
"""What is smaller than this part of what the history reaches is rounding, and reads 0."""


def motion(u_T: Array, jumped: NDArray[np.int8] | None) -> NDArray[np.int8]:
    """(N, m) place in MOVES of every node in every step; in step 0 against zero.

    u_T: (N, m) of the steps that were solved;  jumped: (N, m) 1 where a node moved by a jump, None where none can
    """
    moved = np.diff(u_T, axis=0, prepend=0.0)
    still = AT_REST * (float(np.abs(u_T).max()) or 1.0)
    what = np.where(np.abs(moved) <= still, 0, np.where(moved > 0.0, 1, 2)).astype(np.int8)
    return what if jumped is None else np.where(jumped == 1, np.int8(3), what)


def history_verdict(data: Any) -> tuple[str, str, bool]:
    """How far the histories were followed, what jumps, what a cycle changes, how exact it is."""
    solved, points = by_point(data["status"], data) == int(PointStatus.OK), each_point(data)
    whole, changes = (
        int(np.count_nonzero(solved.all(axis=1))),
        [last_change(data.isel(w)) for w in points],
    )
    slip, units = (
        np.where(solved, by_point(data["u_T_max"], data), -1.0),
        str(data["u_T_max"].attrs["units"]),
    )
    p, n = np.unravel_index(int(np.argmax(slip)), slip.shape)
    at = f" at step {str(data['step_name'].values[n]) or n}"
    at += f" of cycle {cycle}" if (cycle := int(data["cycle"].values[n])) > 1 else ""
    at += f" ({words})" if (words := describe(data, points[p])) else ""
    lengths: dict[str, tuple[str, str]] = {}
    for key, what in LENGTHS.items():
        own = data.get(f"{key}_length") if key != "slip" else None
        most = np.nanmax(by_point(own, data)[solved], initial=0.0) if own is not None else 0.0
        lengths |= {what: ("", with_unit(float(most), units, 3))} if most > 0.0 else {}
    moves = slip[p, n] > 0.0
    answer = [
        sentences.slipped(with_unit(float(slip[p, n]), units), at, lengths)
        if moves
        else "nothing slips"
    ]
    what = f"{counted(solved.shape[1] - 1, 'step')} in {counted(int(data['cycle'].max()), 'cycle')}"
    if len(points) == 1:
        done, reason = int(np.count_nonzero(solved)) - 1, data["reason"].values.item()
        count = (
            f"all {what} solved" if whole else f"{max(done, 0)} of {what} solved, then: {reason}"
        )
        answer.append(changes[0][1])
    else:
        count = f"{whole} of {len(points)} histories of {what} followed to their end"
        kinds = [kind for kind, _ in changes if kind]
        answer.append(
            ", ".join(f"{kinds.count(kind)} {KINDS[kind]}" for kind in dict.fromkeys(kinds))
        )
    jumped = int(np.where(solved, by_point(data["jumps"], data), 0).sum())
    answer.append(counted(jumped, "jump") if jumped else "no jumps")
    worst = by_point(data["inclusion_residual"], data)[solved]
    trust = [f"worst residual {number(float(worst.max()), 2)}"] if len(worst) else []
    return sentences.answered(answer, trust, [count]), "", whole == len(points)


def history_parts(data: Any, every_row: bool = False, *_: Any) -> Iterator[Part]:
    """What a history's file holds; every_row: all steps of all cycles and points."""
    points, attrs = each_point(data), data.attrs
    shown = points if every_row else points[:MOST_POINTS]
    yield Heading(str(attrs["title"]), 1)
    how = (
        "the state of least energy found" if attrs["branch"] == "lowest" else "along its exact path"
    )
    lost = digits_lost(float(data["lambda_1_error"].max())) if "lambda_1_error" in data else ""
    yield (
        f"  History of {', '.join(_loads(data))}; memory {attrs['memory']}; each step {how}\n"
        f"  level {int(data['level'])}: {int(data['n_dof'])} dofs, {int(data['n_contact'])} contact unknowns"
        + (f"\n  {lost}" if lost else "")
    )
    for where in shown:
        name, part = describe(data, where), data.isel(where)
        table = [_steps(part, every_row)] if every_row or len(points) == 1 else []
        yield "\n".join(
            [*([f"  {name}"] if name else []), *table, *(f"  {one}" for one in sentences_of(part))]
        )
    if len(shown) < len(points):
        yield f"  … {len(points) - len(shown)} more points; --verbose shows all"


def _steps(part: Any, all_cycles: bool) -> str:
    """A line for every named step; energies are sums since the one before, 0 where they are
    rounding."""
    names, cycle = part["step_name"].values, part["cycle"].values
    rows = np.flatnonzero((part["status"].values == PointStatus.OK) & (names != ""))
    kept = all_cycles | (cycle[rows] < MOST_CYCLES) | (cycle[rows] == cycle[rows[-1:]])
    spent = part["dissipated"].values + part["released"].values + part["stored"].values
    pull, slip = np.abs(part["xi"].values) @ part["c"].values, part["u_T_max"].values

    def read(values: Array, reached: Array) -> Array:
        return np.where(
            np.abs(values) <= ROUNDING * np.nanmax(np.abs(reached), initial=0.0), 0.0, values
        )[kept]

    since = {
        name: np.diff(np.cumsum(part[name].values)[rows], prepend=0.0)
        for name in ("dissipated", "released")
    }
    numbers = [(name, name, part[name].values[rows][kept]) for name in _loads(part)]
    numbers += [("max |u_T|", "u_T_max", read(slip[rows], slip))]
    numbers += [("∫ξ", "friction_resultant", read(part["friction_resultant"].values[rows], pull))]
    numbers += [(name, name, read(values, spent)) for name, values in since.items()]
    numbers += [(name, name, part[name].values[rows][kept]) for name in asked(part)]
    columns = [
        TextColumn("step", names[rows][kept].tolist()),
        TextColumn("cycle", cycle[rows][kept].astype(str), 1),
    ]
    for rank, (title, name, values) in enumerate(numbers, 2):
        columns.append(quantity(title, values, str(part[name].attrs.get("units", "1")), 6, rank))
    columns.append(
        TextColumn(
            "proved", [proved(part.isel(step=i), none="–") for i in rows[kept]], len(columns)
        )
    )
    return columns_table(columns) + ("" if kept.all() else "\n  …")


def _loads(data: Any) -> list[str]:
    """Names of the loads that change."""
    return str(data.attrs["loads"]).split()


def last_change(part: Any) -> tuple[str, str]:
    """What the last whole cycle of a point's history has changed (`cycle_change`).

    What rounding of the forces may do to slips is that to tractions over the margin; 0 where
    nothing bounds it [m].
    """
    status, cycle, spent = part["status"].values, part["cycle"].values, part["dissipated"].values
    whole = [
        c for c in range(1, int(cycle.max()) + 1) if np.all(status[cycle == c] == PointStatus.OK)
    ]
    ends = [0, *(int(np.flatnonzero(cycle == c)[-1]) for c in whole)]
    each = np.array([spent[cycle == c].sum() for c in whole])
    units = str(part["u_T"].attrs["units"]), str(part["dissipated"].attrs["units"])
    margin, rounding = float(part["margin"]), 0.0
    if margin > 0.0:
        traction = float(np.nanmax(np.abs(part["xi"].values) / part["c"].values))
        rounding = float(np.nanmax(part["inclusion_rounding"].values)) * traction / margin
    return cycle_change(part["u_T"].values[ends], each, units, rounding)


def sentences_of(part: Any) -> list[str]:
    """Change from cycle to cycle, energies, and why the history ended early."""
    done = np.flatnonzero(part["status"].values == PointStatus.OK)
    reason = str(part["reason"].values.item())
    if not len(done):
        return [f"no step was solved: {reason}"]
    defect = number(float(np.nanmax(part["identity"].values[done])), 2)
    missed, spent = (
        float(np.abs(part[name].values[done]).sum()) for name in ("closure", "dissipated")
    )
    told = [
        last_change(part)[1],
        f"{counted(len(done) - 1, 'step')} solved, energy identity to {defect}",
        f"finite steps miss {sentences.percent(missed / spent)} of the energy dissipated; take more steps"
        if 0.0 < MISSED * spent < missed
        else "",
        f"ended at step {len(done)}: {reason}" if reason else "",
    ]
    return list(filter(None, told))
