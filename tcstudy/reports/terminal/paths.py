"""What the files of paths and load histories say: a sentence, their tables, and what happens along
them."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tcstudy.data.files import SHORTFALLS
from tcstudy.data.reading import asked, by_point, each_point
from tcstudy.data.schema import OPEN_LOOP, UNPROVED_BRANCHES, PointStatus
from tcstudy.reports import sentences
from tcstudy.reports.select_point import describe
from tcstudy.reports.sentences import KINDS, LENGTHS, cycle_change
from tcstudy.reports.symbols import symbol
from tcstudy.reports.text import (
    PROOFS,
    Heading,
    Part,
    Table,
    TextColumn,
    Verdict,
    columns_table,
    counted,
    digits_lost,
    first_largest,
    number,
    prefix,
    pretty,
    proved,
    quantity,
    with_unit,
)
from tcstudy.scene.histories import AT_REST

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


NEAREST = 1e-9
"""Part of the range within which two values of the parameter are one."""
MOST_INTERVALS, MOST_SNAPS = 3, 2
"""Intervals with the largest number of equilibria and snap-backs that a verdict names."""


def path_verdict(data: Any) -> Verdict:
    """Return what the file of a path says first: the peak, snap-backs, equilibria, the loop."""
    unit = Unit.of_parameter(data)
    answer = [_peak(data, unit), _snap_backs(data, unit), *_equilibria(data, unit)]
    shortfalls = str(data.attrs.get(SHORTFALLS, "")).splitlines()
    segments = int(data.sizes.get("piece", len(data["parameter"]) - 1))
    solved = counted(segments, "segment")
    if segments:
        solved += f"; residual ≤ {number(float(data['residual'].max()), 2)}"
    of_path = [line for line in shortfalls if not line.startswith((UNPROVED_BRANCHES, OPEN_LOOP))]
    cause, _, remedy = of_path[0].partition("; ") if of_path else ("", "", "")
    return Verdict(
        answer=tuple(filter(None, answer)),
        cycles=_cycle(data, unit),
        trust=_branches_known(data) if segments else (),
        accuracy=("not estimated: one mesh",) if segments else (),
        solved=(solved,),
        reason=(cause,),
        fix=(remedy,),
        complete=not shortfalls,
    )


@dataclass(frozen=True)
class Unit:
    """One unit for all values of a parameter, so that those of a line can be compared."""

    divisor: float
    name: str

    @classmethod
    def of_parameter(cls, data: Any) -> Unit:
        """Return the unit that suits the range of a path's parameter."""
        low, high = (float(end) for end in data.attrs["parameter_range"])
        return cls(*prefix([low, high], data["parameter"].attrs["units"]))

    def number(self, value: Any) -> str:
        """Return a value in this unit, without it."""
        return number(float(value) / self.divisor)

    def text(self, *values: Any) -> str:
        """Return values, the last with the unit: "1.131 to 0.8525 mm"."""
        texts = " to ".join(self.number(value) for value in values)
        return f"{texts} {pretty(self.name)}".rstrip()


def _peak(data: Any, unit: Unit) -> str:
    """Return the largest friction of the path in its range, and where it is."""
    low, high = sorted(float(end) for end in data.attrs["parameter_range"])
    t, c = data["parameter"].values, data["c"].values
    stress_units = str(data["xi"].attrs["units"])
    inside = (t >= low) & (t <= high)
    force = np.where(inside, np.abs(data["xi"].values @ c), 0.0)
    most = int(np.argmax(force))
    if not data.sizes.get("piece", len(t) - 1):
        return f"no path: it ends where it begins, at {_parameter(data)} = {unit.text(t[0])}"
    if force[most] == 0.0:
        return "no friction along the path"
    total = with_unit(force[most], "1" if stress_units == "1" else "N m-1")
    mean = with_unit(force[most] / c.sum(), stress_units)
    return f"peak friction {total} (mean {mean}), at {_parameter(data)} = {unit.text(t[most])}"


def _parameter(data: Any) -> str:
    """Return the symbol of the parameter of a path."""
    return symbol(str(data.attrs["parameter"]))


def _snap_backs(data: Any, unit: Unit) -> str:
    """Return between which values the path steps back."""
    low, high = sorted(float(end) for end in data.attrs["parameter_range"])
    t = data["parameter"].values
    turns = [t[[a, b]] for a, b in pairwise(folds_of(data)) if low <= t[a] <= high and t[a] > t[b]]
    if not turns:
        return ""
    steps = " and ".join(f"{unit.number(a)} → {unit.text(b)}" for a, b in turns[:MOST_SNAPS])
    more = f" and {len(turns) - MOST_SNAPS} more" if len(turns) > MOST_SNAPS else ""
    return f"snap-back {steps}{more}"


def equilibria_by_interval(
    first: Array, last: Array, low: float, high: float
) -> list[tuple[float, float, int]]:
    """Return (from, to, number) of the intervals of a range between which the number of equilibria
    changes.

    first, last: (n,) the parameter at both ends of each segment
    """
    ends = np.unique(np.clip(np.concatenate([first, last, [low, high]]), low, high))
    apart = np.diff(ends) > NEAREST * (high - low)
    ends = ends[np.append(True, apart)]
    middle = 0.5 * (ends[1:] + ends[:-1])
    begins, stops = np.sort(np.minimum(first, last)), np.sort(np.maximum(first, last))
    counts = np.searchsorted(begins, middle) - np.searchsorted(stops, middle)
    intervals = list[tuple[float, float, int]]()
    for start, stop, count in zip(ends[:-1], ends[1:], counts, strict=True):
        if intervals and intervals[-1][2] == count:
            start = intervals.pop()[0]
        intervals.append((float(start), float(stop), int(count)))
    return intervals


def _equilibria(data: Any, unit: Unit) -> list[str]:
    """Return the largest number of equilibria and where there are so many, of the path and, where
    all branches are proved to be known, of all of them; the proved totals at requested values."""
    name = _parameter(data)
    low, high = sorted(float(end) for end in data.attrs["parameter_range"])
    t = data["parameter"].values
    texts = [_largest_number(equilibria_by_interval(t[:-1], t[1:], low, high), "on it", name, unit)]
    if int(data.get("complete", 0)):
        branch, t = data["branch_of"].values, data["branch_parameter"].values
        same = branch[1:] == branch[:-1]
        intervals = equilibria_by_interval(t[:-1][same], t[1:][same], low, high)
        polygon = " of the law's polygon" if float(data["law_error"]) > 0.0 else ""
        texts.append(_largest_number(intervals, f"in all{polygon} (proved)", name, unit))
        apart = (data["branch_loop"].values == 1) & (data["branch_on_path"].values == 0)
        if apart.any():
            texts.append(f"{counted(int(apart.sum()), 'closed loop')} that the path does not meet")
    return [*texts, _proved_totals(data, name, unit)]


def _largest_number(
    intervals: list[tuple[float, float, int]], where: str, name: str, unit: Unit
) -> str:
    """Return the largest number of equilibria with the intervals in which there are so many."""
    most = max((count for _, _, count in intervals), default=0)
    if most < 2:
        whole = intervals and min(count for _, _, count in intervals) == 1
        return f"one equilibrium {where} at every value of the range" if whole else ""
    spans = [_interval(a, b, unit) for a, b, count in intervals if count == most]
    spans = list(dict.fromkeys(spans))
    places = " and ".join(spans[:MOST_INTERVALS])
    more = len(spans) - MOST_INTERVALS
    places += f" and in {counted(more, 'more interval')}" if more > 0 else ""
    return f"up to {most} equilibria {where}, for {name} {places}"


def _interval(low: float, high: float, unit: Unit) -> str:
    """Return an interval of the parameter; one that is narrower than its digits is a place."""
    ends = [unit.number(low), unit.number(high)]
    return f"near {unit.text(low)}" if ends[0] == ends[1] else f"from {unit.text(low, high)}"


def _proved_totals(data: Any, name: str, unit: Unit) -> str:
    """Return how many equilibria there are in all at the requested values where that is proved."""
    if "at_complete" not in data or float(data["law_error"]) > 0.0:
        return ""
    known = np.flatnonzero(data["at_complete"].values)
    counts, values = data["solution_count"].values[known], data["at"].values[known]
    totals = [
        f"{count} at {name} = {unit.text(value)}"
        for count, value in zip(counts, values, strict=True)
    ]
    return f"equilibria in all, proved: {', '.join(totals)}" if totals else ""


def _cycle(data: Any, unit: Unit) -> tuple[str, ...]:
    """Return what quasi-static loading and unloading over the range loses, and in which jumps."""
    if "energy_lost" not in data:
        return ()
    if not int(data["loop_complete"]):
        return (f"hysteresis loop not completed: {data.attrs['loop_reason']}",)
    lost = with_unit(float(data["energy_lost"]), str(data["energy_lost"].attrs["units"]))
    jumps = data["jump_parameter"].values if "jump_parameter" in data else np.zeros(0)
    if not len(jumps):
        return (f"{lost} lost, no jumps",)
    text = f"{lost} lost in {counted(len(jumps), 'jump')}"
    if len(jumps) <= MOST_INTERVALS:
        first = ", ".join(unit.number(t) for t in jumps[:-1])
        text += f", at {f'{first} and ' if first else ''}{unit.text(jumps[-1])}"
    return (text if int(data["loop_closed"]) else f"{text}; it does not close",)


def _branches_known(data: Any) -> tuple[str, ...]:
    """Return what is known of branches that the path does not meet."""
    if int(data.get("complete", 0)):
        return (sentences.WHOLE,)
    if reason := str(data.attrs.get("complete_reason", "")):
        return (sentences.CONNECTED, f"{UNPROVED_BRANCHES}: {reason}")
    return (sentences.CONNECTED,)


def path_parts(data: Any, *_: Any) -> Iterator[Part]:
    """What a path's file holds: its extent and ends, the branches, the loop, the requested
    solutions."""
    at = Unit.of_parameter(data).text
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
        f"omega/lambda_1 = {number(float(data['omega']) / float(data['lambda_1']))}"
    )
    if lost := digits_lost(float(data.get("lambda_1_error", 0.0))):
        yield f"  {lost}"
    stable = np.count_nonzero(data["stable"].values)
    folds = counted(len(vertices), "fold")
    worst = number(float(data["residual"].max()), 2)
    yield (
        f"  {data.sizes['piece']} pieces ({stable} stable), {folds}, {inside} of the folds in the "
        f"range, worst residual {worst}"
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
    elif len(closed):
        yield f"  branches found in the range: {told}; not proved complete"
    for k in np.flatnonzero(closed & ~on_path):
        yield f"  a closed loop from {at(t[of == k].min(), t[of == k].max())} that the path does not meet"
    if polygon or not data.sizes.get("at", 0):
        return
    off_path = np.bincount(
        data["solution_at"].values[data["solution_piece"].values < 0], minlength=data.sizes["at"]
    )
    values, known, counts = (data[name].values for name in ("at", "at_complete", "solution_count"))
    for value, sure, count, off in zip(values, known, counts, off_path, strict=True):
        if not (sure or count):
            continue
        told = f"{sentences.equilibria(count, complete=sure)} equilibri{'um' if count == 1 else 'a'} at {at(value)}"
        yield f"  {told}" + (f", {off} of them not on the path from the start" if off else "")


def _solutions(data: Any, at: Callable[..., str]) -> Part:
    """One row per solution at the requested values."""
    every, columns = int(data.sizes.get("solution", 0)), list[TextColumn]()
    if every:
        shown, c = data.isel(solution=slice(MOST_ROWS)), data["c"].values
        numbers = {
            symbol(str(data.attrs["parameter"])): (
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
MOVES = ("at rest", "slips forward", "slips backward", "jumps")
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


def history_verdict(data: Any) -> Verdict:
    """Return what the file of a history says first: the largest slip, jumps, what a cycle changes,
    proofs, and how far the histories were followed."""
    solved, points = by_point(data["status"], data) == int(PointStatus.OK), each_point(data)
    complete = int(np.count_nonzero(solved.all(axis=1)))
    steps, cycles = solved.shape[1] - 1, int(data["cycle"].max())
    steps_of = f"{counted(steps, 'step')}" + (f" in {cycles} cycles" if cycles > 1 else "")
    if len(points) == 1:
        count = f"{max(int(solved.sum()) - 1, 0)} of {steps_of}"
    else:
        count = f"{complete} of {len(points)} histories of {steps_of} followed to their end"
    residuals = by_point(data["inclusion_residual"], data)[solved]
    if len(residuals):
        count += f"; residual ≤ {number(float(np.nanmax(residuals)), 2)}"
    reasons = [str(reason) for reason in by_point(data["reason"], data) if reason]
    cause, _, remedy = reasons[0].partition("; ") if reasons else ("", "", "")
    if len(reasons) > 1:
        cause += f" (the first of {len(reasons)})"
    return Verdict(
        answer=tuple(filter(None, _history_answer(data, solved, points))),
        cycles=_history_cycles(data, points),
        trust=_history_proofs(data, solved),
        accuracy=_history_accuracy(data, solved),
        solved=(count,),
        reason=(cause,),
        fix=(remedy,),
        complete=complete == len(points),
    )


def _history_answer(
    data: Any, solved: NDArray[np.bool_], points: list[dict[str, int]]
) -> list[str]:
    """Return the largest slip with its step, lengths of the contact line, and the jumps."""
    units = str(data["u_T_max"].attrs["units"])
    slip = np.where(solved, by_point(data["u_T_max"], data), -1.0)
    point, step = first_largest(slip)
    jumps = int(np.where(solved, by_point(data["jumps"], data), 0).sum())
    jumped = counted(jumps, "jump") if jumps else "no jumps"
    if slip[point, step] <= 0.0:
        return ["nothing slips", jumped]
    place = f"step {str(data['step_name'].values[step]) or step}"
    if (cycle := int(data["cycle"].values[step])) > 1:
        place += f" of cycle {cycle}"
    if words := describe(data, points[point]):
        place += f" ({words})"
    spans = dict[str, tuple[float, float]]()
    for name in LENGTHS:
        if name == "slip" or f"{name}_length" not in data:
            continue
        length = np.nanmax(by_point(data[f"{name}_length"], data)[solved], initial=0.0)
        if length > 0.0:
            spans[name] = 0.0, float(length)
    largest = f"largest slip {with_unit(float(slip[point, step]), units)} at {place}"
    lengths = sentences.slip_lengths(spans, units)
    return [largest, ", ".join(filter(None, [lengths, jumped]))]


def _history_cycles(data: Any, points: list[dict[str, int]]) -> tuple[str, ...]:
    """Return what the last cycle of a history changes, or how many histories of a sweep do what."""
    changes = [last_change(data.isel(where)) for where in points]
    if len(points) == 1:
        return (changes[0][1],)
    kinds = [kind for kind, _ in changes if kind]
    counts = [f"{kinds.count(kind)} {KINDS[kind]}" for kind in dict.fromkeys(kinds)]
    return (", ".join(counts),)


def _history_proofs(data: Any, solved: NDArray[np.bool_]) -> tuple[str, ...]:
    """Return how many steps after step 0 have which strongest proof."""
    steps = solved.copy()
    steps[:, 0] = False
    if not steps.any():
        return ()
    flags = {name: by_point(data[name], data) == 1 for name, _ in PROOFS if name in data}
    missing = dict.fromkeys([name for name, _ in PROOFS], np.zeros_like(steps))
    classes = sentences.proof_classes(missing | flags, steps)
    return (f"steps: {classes} (this mesh)",)


def _history_accuracy(data: Any, solved: NDArray[np.bool_]) -> tuple[str, ...]:
    """Return that the error of the mesh is not known, and how well the energy balances."""
    text = "not estimated: one mesh"
    defects = by_point(data["identity"], data)[solved]
    if np.isfinite(defects).any():
        text += f"; relative energy balance error {number(float(np.nanmax(defects)), 2)}"
    return (text,)


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
            [
                *([f"  {name}"] if name else []),
                *table,
                *(f"  {text}" for text in sentences_of(part, len(points) == 1)),
            ]
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
    numbers = []
    for name in _loads(part):
        title = symbol(str(part[name].attrs.get("long_name", name)))
        numbers.append((title, name, part[name].values[rows][kept]))
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


def sentences_of(part: Any, alone: bool = False) -> list[str]:
    """Return the change from cycle to cycle, energies, and why the history ended early.

    alone: whether the verdict of the file is of this history, too, and has told of the cycles
    """
    done = np.flatnonzero(part["status"].values == PointStatus.OK)
    reason = str(part["reason"].values.item())
    if not len(done):
        return [f"no step was solved: {reason}"]
    defect = number(float(np.nanmax(part["identity"].values[done])), 2)
    missed, spent = (
        float(np.abs(part[name].values[done]).sum()) for name in ("closure", "dissipated")
    )
    steps = counted(len(done) - 1, "step")
    told = [
        "" if alone else last_change(part)[1],
        "" if alone else f"{steps} solved, relative energy balance error {defect}",
        f"finite steps miss {sentences.percent(missed / spent)} of the energy dissipated; take more steps"
        if 0.0 < MISSED * spent < missed
        else "",
        f"ended at step {len(done)}: {reason}" if reason and not alone else "",
    ]
    return list(filter(None, told))
