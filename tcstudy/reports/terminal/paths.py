"""Verdicts, tables and sentences on the files of paths and load histories."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tcstudy.data.files import SHORTFALLS
from tcstudy.data.reading import asked, by_point, each_point
from tcstudy.data.schema import OPEN_LOOP, UNPROVED_BRANCHES, PointStatus
from tcstudy.data.tables import FROM_LAST
from tcstudy.reports import sentences
from tcstudy.reports.rounding import resultant_floor
from tcstudy.reports.select_point import axis_symbol, describe
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
Flags = NDArray[np.bool_]

MAX_ROWS = 60
"""Solutions that are listed; the file has them all."""
STATES = ("sticks", "slips", "slips and softens", "on a drop of b", "slips, weakened")
"""State of a contact node in words, by ContactState."""


# -- the verdict of a path

MIN_FOLD = 0.005
"""Part of the range by which the parameter turns back at a fold; older files list smaller turns."""


def folds_of(data: Any) -> NDArray[np.intp]:
    """Return the vertices of the folds of a path.

    Older files list smaller turns, too, with the size by which the parameter turns back at each.
    """
    if "fold_vertex" not in data:
        return np.zeros(0, dtype=np.intp)
    vertices = data["fold_vertex"].values.astype(np.intp)
    if "fold_size" not in data:
        return vertices
    start, end = data.attrs["parameter_range"]
    return vertices[data["fold_size"].values >= MIN_FOLD * abs(float(end - start))]


NEAREST = 1e-9
"""Part of the range within which two values of the parameter are one."""
MAX_INTERVALS = 3
"""Intervals with the largest number of equilibria that a verdict names."""
MAX_SNAP_BACKS = 2
"""Snap-backs that a verdict names."""
MAX_JUMPS = 3
"""Jumps of a loop of which a verdict names every place."""


def path_verdict(data: Any) -> Verdict:
    """Return the verdict of a path: the peak, snap-backs, equilibria, the hysteresis loop."""
    unit = Unit.of_parameter(data)
    answer = [*_openings(data, unit), _peak(data, unit), _snap_backs(data, unit)]
    answer += _equilibria(data, unit)
    shortfalls = str(data.attrs.get(SHORTFALLS, "")).splitlines()
    segments = _segments(data)
    solved = counted(segments, "segment")
    if segments:
        solved += f"; residual ≤ {number(float(data['residual'].max()), 2)}"
    of_path = [line for line in shortfalls if not line.startswith((UNPROVED_BRANCHES, OPEN_LOOP))]
    cause, _, remedy = of_path[0].partition("; ") if of_path else ("", "", "")
    return Verdict(
        answer=tuple(filter(None, answer)),
        cycles=_cycle(data, unit),
        trust=_branches_known(data) if segments else (),
        accuracy=("not estimated: a path is of one mesh",) if segments else (),
        solved=(solved,),
        reason=(cause,),
        fix=(remedy,),
        complete=not shortfalls,
    )


@dataclass(frozen=True)
class Unit:
    """The unit of all values of a parameter, so that those of a line can be compared."""

    divisor: float
    name: str

    @classmethod
    def of_parameter(cls, data: Any) -> Unit:
        """Return the unit that suits the range of the parameter of a path."""
        return cls(*prefix(_range(data), data["parameter"].attrs["units"]))

    def number(self, value: Any) -> str:
        """Return a value in this unit, without it."""
        return number(float(value) / self.divisor)

    def text(self, *values: Any) -> str:
        """Return values, the last with the unit: "1.131 to 0.8525 mm"."""
        texts = " to ".join(self.number(value) for value in values)
        return f"{texts} {pretty(self.name)}".rstrip()


def _range(data: Any) -> tuple[float, float]:
    """Return the ends of the range of the parameter, the smaller one first."""
    low, high = sorted(float(end) for end in data.attrs["parameter_range"])
    return low, high


def _segments(data: Any) -> int:
    return int(data.sizes.get("piece", len(data["parameter"]) - 1))


def _parameter(data: Any) -> str:
    """Return the symbol of the parameter of a path."""
    return symbol(str(data.attrs["parameter"]))


def _peak(data: Any, unit: Unit) -> str:
    """Return the largest friction of the path in its range, and where it is."""
    low, high = _range(data)
    t, c = data["parameter"].values, data["c"].values
    is_inside = (t >= low) & (t <= high)
    force = np.where(is_inside, np.abs(data["xi"].values @ c), 0.0)
    peak = int(np.argmax(force))
    if not _segments(data):
        return f"no path: it ends where it begins, at {_parameter(data)} = {unit.text(t[0])}"
    if force[peak] == 0.0 or ("opening" in data and force[peak] <= resultant_floor(data)):
        return "" if "opening" in data else "no friction along the path"
    stress_units = str(data["xi"].attrs["units"])
    total = with_unit(force[peak], "1" if stress_units == "1" else "N m-1")
    mean = with_unit(force[peak] / c.sum(), stress_units)
    return f"peak friction {total} (mean {mean}), at {_parameter(data)} = {unit.text(t[peak])}"


def _openings(data: Any, unit: Unit) -> list[str]:
    """Return the largest peel force, crack and opening of the path in its range."""
    if "opening_max" not in data or not _segments(data):
        return []
    t, ends = data["parameter"].values, np.array(_range(data))

    def largest(name: str) -> tuple[str, str]:
        """Return the largest value of a variable in the range with its unit, and its place."""
        place, value = _largest_within(t, data[name].values, ends)
        if not value > 0.0:
            return "", ""
        units = str(data[name].attrs["units"])
        return with_unit(value, units), f"{_parameter(data)} = {unit.text(place)}"

    facts = list[str]()
    force, place = largest("adhesion_resultant")
    if force:
        facts.append(f"peak peel force {force}, at {place}")
    opening, place = largest("opening_max")
    facts += [_crack(data, unit), f"largest opening {opening} at {place}" if opening else ""]
    return facts if opening else [*facts, "nothing opens"]


WEAKENED = 4
"""State of an opening on a segment of a path beyond the last softening of its law."""


def _crack(data: Any, unit: Unit) -> str:
    """Return the largest crack in the range, by whole nodes; "" without any."""
    low, high = _range(data)
    t = np.clip(data["parameter"].values, low, high)
    is_inside = t[1:] != t[:-1]
    length = np.where(is_inside, (data["state_N"].values == WEAKENED) @ data["c_N"].values, 0.0)
    piece = int(np.argmax(length))
    if not length[piece] > 0.0:
        return ""
    place = unit.text(max(t[piece], t[piece + 1]))
    words = with_unit(float(length[piece]), str(data["c_N"].attrs["units"]))
    return f"the crack in the bond grows to {words}, at {_parameter(data)} = {place}"


def _largest_within(t: Array, y: Array, ends: Array) -> tuple[float, float]:
    """Return (place, value) of the largest y of a line y(t) between two ends of t, inclusive."""
    step = np.where(np.diff(t) == 0.0, 1.0, np.diff(t))
    share = (ends[:, None] - t[:-1]) / step
    crossings = y[:-1] + share * np.diff(y)
    is_crossed = (share > 0.0) & (share < 1.0)
    is_inside = (t >= ends[0]) & (t <= ends[1])
    places = np.broadcast_to(ends[:, None], share.shape)[is_crossed]
    all_places = np.concatenate([t[is_inside], places])
    values = np.concatenate([y[is_inside], crossings[is_crossed]])
    largest = int(np.argmax(values))
    return float(all_places[largest]), float(values[largest])


def _snap_backs(data: Any, unit: Unit) -> str:
    """Return between which values the path turns back."""
    low, high = _range(data)
    t = data["parameter"].values
    steps = list[str]()
    for start, end in pairwise(folds_of(data)):
        if low <= t[start] <= high and t[start] > t[end]:
            steps.append(f"{unit.number(t[start])} → {unit.text(t[end])}")
    if not steps:
        return ""
    names = steps[:MAX_SNAP_BACKS]
    if len(steps) > MAX_SNAP_BACKS:
        names.append(f"{len(steps) - MAX_SNAP_BACKS} more")
    return f"snap-back {' and '.join(names)}"


Interval = tuple[float, float, int]
"""Values of the parameter between which there are so many equilibria."""


def equilibria_by_interval(start: Array, end: Array, low: float, high: float) -> list[Interval]:
    """Return (from, to, number) of intervals of a range with the same number of equilibria.

    start, end: (n,) the parameter at both ends of each segment
    """
    ends = np.concatenate([start, end, [low, high]])
    ends = np.unique(np.clip(ends, low, high))
    are_apart = np.diff(ends) > NEAREST * (high - low)
    ends = ends[np.append(True, are_apart)]
    middle = 0.5 * (ends[1:] + ends[:-1])
    # a segment holds one equilibrium at every value between its lower and its upper end
    begun = np.searchsorted(np.sort(np.minimum(start, end)), middle)
    ended = np.searchsorted(np.sort(np.maximum(start, end)), middle)
    counts = begun - ended
    intervals = list[Interval]()
    for left, right, count in zip(ends[:-1], ends[1:], counts, strict=True):
        if intervals and intervals[-1][2] == count:
            left = intervals.pop()[0]
        intervals.append((float(left), float(right), int(count)))
    return intervals


def _equilibria(data: Any, unit: Unit) -> list[str]:
    """Return the largest number of equilibria and where there are so many.

    Of the path and, where all branches are proved to be known, of all of them; then the proved
    totals at requested values.
    """
    name = _parameter(data)
    low, high = _range(data)
    t = data["parameter"].values
    on_path = equilibria_by_interval(t[:-1], t[1:], low, high)
    texts = [_largest_number(on_path, "on it", name, unit)]
    if int(data.get("complete", 0)):
        branch, t = data["branch_of"].values, data["branch_parameter"].values
        is_segment = branch[1:] == branch[:-1]
        in_all = equilibria_by_interval(t[:-1][is_segment], t[1:][is_segment], low, high)
        polygon = (
            " of the law's piecewise-linear approximation" if float(data["law_error"]) > 0.0 else ""
        )
        texts.append(_largest_number(in_all, f"in all{polygon} (proved)", name, unit))
        is_isola = (data["branch_loop"].values == 1) & (data["branch_on_path"].values == 0)
        if is_isola.any():
            texts.append(f"{counted(int(is_isola.sum()), 'isola')} that the path does not meet")
    return [*texts, _proved_totals(data, name, unit)]


def _largest_number(intervals: Sequence[Interval], where: str, name: str, unit: Unit) -> str:
    """Return the largest number of equilibria with the intervals in which there are so many."""
    counts = [count for _, _, count in intervals]
    most = max(counts, default=0)
    if most < 2:
        is_one_everywhere = counts and min(counts) == 1
        return f"one equilibrium {where} at every value of the range" if is_one_everywhere else ""
    spans = [_interval(low, high, unit) for low, high, count in intervals if count == most]
    spans = list(dict.fromkeys(spans))
    places = " and ".join(spans[:MAX_INTERVALS])
    if len(spans) > MAX_INTERVALS:
        places += f" and in {counted(len(spans) - MAX_INTERVALS, 'more interval')}"
    return f"up to {most} equilibria {where}, for {name} {places}"


def _interval(low: float, high: float, unit: Unit) -> str:
    """Return an interval of the parameter; one that is narrower than its digits is a place."""
    if unit.number(low) == unit.number(high):
        return f"near {unit.text(low)}"
    return f"from {unit.text(low, high)}"


def _proved_totals(data: Any, name: str, unit: Unit) -> str:
    """Return the number of all equilibria at the requested values where it is proved."""
    if "at_complete" not in data or float(data["law_error"]) > 0.0:
        return ""
    is_proved = data["at_complete"].values.astype(bool)
    counts, values = data["solution_count"].values, data["at"].values
    totals = list[str]()
    for count, value in zip(counts[is_proved], values[is_proved], strict=True):
        totals.append(f"{count} at {name} = {unit.text(value)}")
    return f"equilibria in all, proved: {', '.join(totals)}" if totals else ""


def _cycle(data: Any, unit: Unit) -> tuple[str, ...]:
    """Return the energy lost in quasi-static loading and unloading, and its jumps."""
    if "energy_lost" not in data:
        return ()
    if not int(data["loop_complete"]):
        return (f"hysteresis loop not completed: {data.attrs['loop_reason']}",)
    lost = with_unit(float(data["energy_lost"]), str(data["energy_lost"].attrs["units"]))
    jumps = data["jump_parameter"].values if "jump_parameter" in data else np.zeros(0)
    if not len(jumps):
        return (f"{lost} lost, no jumps",)
    text = f"{lost} lost in {counted(len(jumps), 'jump')}"
    if len(jumps) <= MAX_JUMPS:
        places = [unit.number(t) for t in jumps[:-1]]
        first = f"{', '.join(places)} and " if places else ""
        text += f", at {first}{unit.text(jumps[-1])}"
    return (text if int(data["loop_closed"]) else f"{text}; it does not close",)


def _branches_known(data: Any) -> tuple[str, ...]:
    """Return whether branches that the path does not meet are known."""
    if int(data.get("complete", 0)):
        return (sentences.WHOLE,)
    reason = str(data.attrs.get("complete_reason", ""))
    if reason:
        return (sentences.CONNECTED, f"{UNPROVED_BRANCHES}: {reason}")
    return (sentences.CONNECTED,)


# -- the parts of a path


def path_parts(data: Any, *_: Any) -> Iterator[Part]:
    """Yield the extent and ends of a path, its branches, its loop, the requested solutions."""
    unit = Unit.of_parameter(data)
    yield Heading(str(data.attrs["title"]), 1)
    lines = [*_path(data, unit)]
    if "complete" in data:
        lines += _branches(data, unit)
    if "energy_lost" in data:
        lines.append(_loop(data, unit))
    yield "\n".join(lines)
    if data.sizes.get("at", 0):
        yield _solutions(data, unit)


def _path(data: Any, unit: Unit) -> Iterator[str]:
    """Yield where the path runs, how it was computed, and why it ends."""
    start, end = data.attrs["parameter_range"]
    low, high = _range(data)
    t, vertices = data["parameter"].values, folds_of(data)
    yield f"  Path along {data.attrs['parameter']} from {unit.text(start, end)}"
    yield f"  {_sizes(data)}; {_softening(data)}"
    lost_digits = digits_lost(float(data.get("lambda_1_error", 0.0)))
    if lost_digits:
        yield f"  {lost_digits}"
    segments, stable = data.sizes["piece"], np.count_nonzero(data["stable"].values)
    residual = number(float(data["residual"].max()), 2)
    yield f"  {segments} segments ({stable} stable), worst residual {residual}"
    least = f"turns by at least {sentences.percent(MIN_FOLD)} of the range"
    inside = np.count_nonzero((t[vertices] >= low) & (t[vertices] <= high))
    yield f"  {counted(len(vertices), 'fold')} ({least}), {inside} in the range"
    law_error = float(data["law_error"])
    if law_error > 0.0:
        yield f"  the law is replaced by linear segments, relative error {number(law_error, 1)}"
    yield from _ends(data, unit)


def _ends(data: Any, unit: Unit) -> Iterator[str]:
    """Yield where the path ends, which may be beyond its range, and why."""
    t = data["parameter"].values
    reasons = str(data.attrs["begin_reason"]), str(data.attrs["end_reason"])
    if reasons[0] == reasons[1]:
        yield f"  followed both ways, to {unit.text(t[0])} and to {unit.text(t[-1])}: {reasons[0]}"
    else:
        yield f"  followed backwards to {unit.text(t[0])}: {reasons[0]}"
        yield f"  followed forwards to {unit.text(t[-1])}: {reasons[1]}"


def _softening(data: Any) -> str:
    """Return ω relative to the stiffness of the body."""
    lambda_1 = float(data["lambda_1"])
    if lambda_1 == 0.0:
        return "λ₁ = 0, only friction restrains rigid-body motion"
    return f"ω/λ₁ = {number(float(data['omega']) / lambda_1)}"


def _sizes(data: Any) -> str:
    """Return the level and the number of its unknowns."""
    dofs, contact = int(data["n_dof"]), int(data["n_contact"])
    return f"level {int(data['level'])}: {dofs} DOFs, {contact} contact DOFs"


def _branches(data: Any, unit: Unit) -> Iterator[str]:
    """Yield what is known of all branches, the isolas, and the equilibria at requested values."""
    is_closed = data["branch_loop"].values.astype(bool)
    is_on_path = data["branch_on_path"].values.astype(bool)
    open_branches, closed_branches = int((~is_closed).sum()), int(is_closed.sum())
    apart = int(np.sum(~is_closed & ~is_on_path))
    branches = f"{open_branches} open {'branch' if open_branches == 1 else 'branches'}"
    if apart:
        branches += f" ({apart} not on the path in the range)"
    branches += f" and {closed_branches} closed {'branch' if closed_branches == 1 else 'branches'}"
    is_polygon = float(data["law_error"]) > 0.0
    if is_polygon:
        branches += " of the law's piecewise-linear approximation"
    if data["complete"]:
        yield f"  every branch of the range: {branches}; complete (proved)"
    elif len(is_closed):
        yield f"  branches found in the range: {branches}; not proved complete"
    t, branch = data["branch_parameter"].values, data["branch_of"].values
    for isola in np.flatnonzero(is_closed & ~is_on_path):
        t_isola = t[branch == isola]
        ends = unit.text(t_isola.min(), t_isola.max())
        yield f"  an isola from {ends}, which the path does not meet"
    if not is_polygon and data.sizes.get("at", 0):
        yield from _totals(data, unit)


def _totals(data: Any, unit: Unit) -> Iterator[str]:
    """Yield the number of equilibria at each requested value, and how many are not on the path."""
    values, counts = data["at"].values, data["solution_count"].values
    is_complete = data["at_complete"].values
    at_of_solution = data["solution_at"].values
    is_off_path = data["solution_piece"].values < 0
    off_path = np.bincount(at_of_solution[is_off_path], minlength=data.sizes["at"])
    for value, complete, count, off in zip(values, is_complete, counts, off_path, strict=True):
        if not (complete or count):
            continue
        words = sentences.equilibria(count, complete=complete)
        noun = "equilibrium" if count == 1 else "equilibria"
        beside = f", {off} of them not on the path from the start" if off else ""
        yield f"  {words} {noun} at {unit.text(value)}{beside}"


def _solutions(data: Any, unit: Unit) -> Part:
    """Return one row per solution at the requested values."""
    total = int(data.sizes.get("solution", 0))
    notes = list[str]()
    if total > MAX_ROWS:
        notes.append(f"… {total - MAX_ROWS} more solutions in the file")
    is_missing = data["solution_count"].values == 0
    missing = [unit.text(value) for value in data["at"].values[is_missing]]
    if missing:
        notes.append(f"no solution on the path at {', '.join(missing)}")
    if not total:
        return f"  {notes[0]}"

    listed, c = data.isel(solution=slice(MAX_ROWS)), data["c"].values
    t = listed["solution_parameter"].values
    mean_slip = listed["solution_u_T"].values @ c / c.sum()
    energy = listed["solution_energy"].values
    units = {name: data[name].attrs["units"] for name in ("parameter", "u_T", "energy")}
    extent = data.attrs["parameter_range"]
    least = "least" if "complete" in data else "least on path"
    solutions = [listed.isel(solution=i) for i in range(listed.sizes["solution"])]
    columns = [
        quantity(_parameter(data), t, units["parameter"], 5, like=extent),
        quantity("mean u_T", mean_slip, units["u_T"], 5),
        quantity("energy", energy, units["energy"], 5),
        TextColumn("stable", _yes_or_no(listed["solution_stable"]), 1),
        TextColumn(least, _yes_or_no(listed["solution_lowest"]), 1),
        TextColumn("certified", [proved(solution, "solution_") for solution in solutions], 2),
        quantity("residual", listed["solution_residual"].values, "1", 2, 3),
    ]
    return Table("", columns, tuple(notes))


def _yes_or_no(flags: Any) -> list[str]:
    return ["yes" if int(flag) else "no" for flag in flags.values]


def _loop(data: Any, unit: Unit) -> str:
    """Return the energy lost in the hysteresis loop, and its largest jump."""
    if not int(data["loop_complete"]):
        return f"  hysteresis loop not completed: {data.attrs['loop_reason']}"
    units, jumps = str(data["energy_lost"].attrs["units"]), int(data.sizes.get("jump", 0))
    words = f"  hysteresis loop: {with_unit(float(data['energy_lost']), units)} lost"
    if not jumps:
        return f"{words}, no jumps"
    largest = data.isel(jump=int(np.argmax(data["jump_drop"].values)))
    drop = with_unit(float(largest["jump_drop"]), units)
    direction = "rising" if int(largest["jump_rising"]) else "falling"
    place = f"{unit.text(largest['jump_parameter'])} ({direction})"
    # a fold too small to be counted can cause a jump, too
    words += f" in {counted(jumps, 'jump')} at turns of any size, at most {drop} at {place}"
    return words if int(data["loop_closed"]) else f"{words}; it does not close"


# -- the verdict of a history

MAX_CYCLES = 3
"""Cycles of a point whose steps are listed: cycle 0, those after it, and the last cycle."""
MAX_POINTS = 20
"""Points that have a line; the file has them all."""
MOVES = ("sticks", "slips forward", "slips backward", "jumps")
"""Motions of a node in a step."""
MIN_DEFECT = 0.01
"""Part of the dissipated energy above which the energy that finite steps miss is reported."""
ROUNDING = 1e-10
"""Part of the largest value of a history below which a value is rounding, and reads 0."""


def motion(u_T: Array, jumped: NDArray[np.int8] | None) -> NDArray[np.int8]:
    """Return (N, m) the index in MOVES of every node in every step; of step 0 against zero.

    u_T:    (N, m) of the steps that were solved
    jumped: (N, m) 1 where a node moved by a jump, None where none can
    """
    change = np.diff(u_T, axis=0, prepend=0.0)
    rounding = AT_REST * (float(np.abs(u_T).max()) or 1.0)
    slips = np.where(change > 0.0, 1, 2)
    moves = np.where(np.abs(change) <= rounding, 0, slips).astype(np.int8)
    return moves if jumped is None else np.where(jumped == 1, np.int8(3), moves)


def history_verdict(data: Any) -> Verdict:
    """Return the verdict of histories: slip, jumps, cycles, proofs, solved steps."""
    solved, points = by_point(data["status"], data) == int(PointStatus.OK), each_point(data)
    complete = int(np.count_nonzero(solved.all(axis=1)))
    reasons = [str(reason) for reason in by_point(data["reason"], data) if reason]
    cause, _, remedy = reasons[0].partition("; ") if reasons else ("", "", "")
    if len(reasons) > 1:
        cause += f" (the first of {len(reasons)})"
    return Verdict(
        answer=tuple(filter(None, _history_answer(data, solved, points))),
        cycles=_history_cycles(data, points),
        trust=_history_proofs(data, solved),
        accuracy=_history_accuracy(data, solved),
        solved=(_history_solved(data, solved, complete),),
        reason=(cause,),
        fix=(remedy,),
        complete=complete == len(points),
    )


def _history_solved(data: Any, solved: Flags, complete: int) -> str:
    """Return how many steps or histories are solved, and the largest residual."""
    steps, cycles = solved.shape[1] - 1, int(data["cycle"].max())
    all_steps = counted(steps, "step")
    if cycles > 1:
        all_steps += f" in {cycles} cycles"
    if len(solved) == 1:
        text = f"{max(int(solved.sum()) - 1, 0)} of {all_steps}"
    else:
        text = f"{complete} of {len(solved)} histories of {all_steps} followed to their end"
    residuals = by_point(data["inclusion_residual"], data)[solved]
    if len(residuals):
        text += f"; residual ≤ {number(float(np.nanmax(residuals)), 2)}"
    return text


def _history_answer(data: Any, solved: Flags, points: Sequence[dict[str, int]]) -> list[str]:
    """Return the largest slip and the peak friction with their steps, lengths, and the jumps."""
    units = str(data["u_T_max"].attrs["units"])
    slip = np.where(solved, by_point(data["u_T_max"], data), -1.0)
    point, step = first_largest(slip)
    jumps = int(np.where(solved, by_point(data["jumps"], data), 0).sum())
    jumps_words = counted(jumps, "jump") if jumps else "no jumps"
    if slip[point, step] <= 0.0:
        return ["nothing slips", jumps_words]
    place = _step_words(data, points[point], step)
    spans = dict[str, tuple[float, float]]()
    for name in LENGTHS:
        if name == "slip" or f"{name}_length" not in data:
            continue
        length = np.nanmax(by_point(data[f"{name}_length"], data)[solved], initial=0.0)
        if length > 0.0:
            spans[name] = 0.0, float(length)
    largest = f"largest slip {with_unit(float(slip[point, step]), units)} at {place}"
    openings = _openings_of_histories(data, solved, points)
    if "opening_max" in data:
        opening = np.where(solved, by_point(data["opening_max"], data), 0.0)
        if slip[point, step] <= sentences.SAME * float(opening.max()):
            largest = ""
    lengths = sentences.slip_lengths(spans, units)
    peak = _peak_of_histories(data, solved, points)
    return [*openings, largest, peak, ", ".join(filter(None, [lengths, jumps_words]))]


def _openings_of_histories(data: Any, solved: Flags, points: Sequence[dict[str, int]]) -> list[str]:
    """Return the largest opening and the largest normal resultant in tension, with their steps."""
    facts = list[str]()
    for words, name in (
        ("largest opening", "opening_max"),
        ("peak peel force", "adhesion_resultant"),
    ):
        if name not in data:
            continue
        values = np.where(solved, by_point(data[name], data), -1.0)
        point, step = first_largest(values)
        if values[point, step] > 0.0:
            value = with_unit(float(values[point, step]), str(data[name].attrs["units"]))
            facts.append(f"{words} {value} at {_step_words(data, points[point], step)}")
    return facts


def _step_words(data: Any, point: dict[str, int], step: int) -> str:
    """Return the name or number of a step, with its cycle and the labels of its point."""
    words = f"step {str(data['step_name'].values[step]) or step}"
    cycle = int(data["cycle"].values[step])
    if cycle > 1:
        words += f" of cycle {cycle}"
    labels = describe(data, point)
    return f"{words} ({labels})" if labels else words


def _peak_of_histories(data: Any, solved: Flags, points: Sequence[dict[str, int]]) -> str:
    """Return the largest friction resultant and its step; "" where all are rounding."""
    resultant = np.abs(by_point(data["friction_resultant"], data))
    friction = np.where(solved, resultant, 0.0)
    point, step = first_largest(friction)
    peak = float(friction[point, step])
    if peak <= resultant_floor(data):
        return ""
    total = with_unit(peak, str(data["friction_resultant"].attrs["units"]))
    return f"peak friction {total} at {_step_words(data, points[point], step)}"


def _history_cycles(data: Any, points: Sequence[dict[str, int]]) -> tuple[str, ...]:
    """Return the change by the last cycle of a history, or how many of a sweep have which kind."""
    changes = [last_change(data.isel(where)) for where in points]
    if len(points) == 1:
        return (changes[0][1],)
    kinds = [kind for kind, _ in changes if kind]
    counts = [f"{kinds.count(kind)} {KINDS[kind]}" for kind in dict.fromkeys(kinds)]
    return (", ".join(counts),)


def _history_proofs(data: Any, solved: Flags) -> tuple[str, ...]:
    """Return how many steps after step 0 have which strongest proof."""
    steps = solved.copy()
    steps[:, 0] = False
    if not steps.any():
        return ()
    flags = {name: np.zeros_like(steps) for name, _ in PROOFS}
    for name in flags:
        if name in data:
            flags[name] = by_point(data[name], data) == 1
    return (f"steps: {sentences.proof_classes(flags, steps)} (this mesh)",)


def _history_accuracy(data: Any, solved: Flags) -> tuple[str, ...]:
    """Return that the error of the mesh is not known, and how well the energy balances."""
    text = "not estimated: one mesh"
    defects = by_point(data["identity"], data)[solved]
    if np.isfinite(defects).any():
        text += f"; relative energy balance error {number(float(np.nanmax(defects)), 2)}"
    return (text,)


# -- the parts of a history


def history_parts(data: Any, every_row: bool = False, *_: Any) -> Iterator[Part]:
    """Yield the loads of a history and its steps; every_row: all steps of all cycles and points."""
    points, attrs = each_point(data), data.attrs
    listed = points if every_row else points[:MAX_POINTS]
    is_alone = len(points) == 1
    yield Heading(str(attrs["title"]), 1)
    yield "\n".join(_history(data))
    for where in listed:
        name, part = describe(data, where), data.isel(where)
        lines = [f"  {name}"] if name else []
        if every_row or is_alone:
            lines.append(_steps(part, every_row))
        lines += [f"  {text}" for text in sentences_of(part, is_alone)]
        yield "\n".join(lines)
    if len(listed) < len(points):
        yield f"  … {len(points) - len(listed)} more points; --verbose shows all"


STEPS = {
    "lowest": "the state of lowest energy found",
    "continued": "along its exact path",
    FROM_LAST: "the state found from the last one",
}
"""How a step is solved, by the attribute `branch`."""


def _history(data: Any) -> Iterator[str]:
    """Yield the loads of a history and how its steps are solved."""
    attrs = data.attrs
    step = STEPS.get(attrs["branch"], STEPS["continued"])
    yield f"  History of {', '.join(_loads(data))}; memory {attrs['memory']}; each step {step}"
    yield f"  {_sizes(data)}"
    if "lambda_1_error" in data:
        lost_digits = digits_lost(float(data["lambda_1_error"].max()))
        if lost_digits:
            yield f"  {lost_digits}"


def _steps(part: Any, all_cycles: bool) -> str:
    """Return a line for every named step.

    Energies are sums since the line before, 0 where they are rounding.
    """
    names, cycle = part["step_name"].values, part["cycle"].values
    rows = np.flatnonzero((part["status"].values == PointStatus.OK) & (names != ""))
    is_listed = all_cycles | (cycle[rows] < MAX_CYCLES) | (cycle[rows] == cycle[rows[-1:]])
    listed = rows[is_listed]
    spent = part["dissipated"].values + part["released"].values + part["stored"].values
    traction_resultant = np.abs(part["xi"].values) @ part["c"].values
    slip, friction = part["u_T_max"].values, part["friction_resultant"].values

    columns = [
        TextColumn("step", names[listed].tolist()),
        TextColumn("cycle", cycle[listed].astype(str), 1),
    ]

    def add(title: str, name: str, values: Array) -> None:
        """Append a column; the later it stands, the sooner it is hidden."""
        units, rank = str(part[name].attrs.get("units", "1")), len(columns)
        columns.append(quantity(title, values, units, 6, rank))

    for name in _loads(part):
        add(axis_symbol(part, name), name, part[name].values[listed])
    if "opening_max" in part:
        for title, name in (("max opening", "opening_max"), ("∫S_N", "adhesion_resultant")):
            add(title, name, _without_rounding(part[name].values[listed], part[name].values))
    add("max |u_T|", "u_T_max", _without_rounding(slip[listed], slip))
    if "opening_max" not in part or np.nanmax(traction_resultant) > resultant_floor(part):
        add("∫ξ", "friction_resultant", _without_rounding(friction[listed], traction_resultant))
    for name in ("dissipated", "released"):
        since_row_before = np.diff(np.cumsum(part[name].values)[rows], prepend=0.0)
        add(name, name, _without_rounding(since_row_before[is_listed], spent))
    for name in asked(part):
        add(name, name, part[name].values[listed])
    proofs = [proved(part.isel(step=i), none="–") for i in listed]
    columns.append(TextColumn("proved", proofs, len(columns)))
    return columns_table(columns) + ("" if is_listed.all() else "\n  …")


def _without_rounding(values: Array, history: Array) -> Array:
    """Return values with 0 in place of those that are rounding beside the whole history."""
    largest = np.nanmax(np.abs(history), initial=0.0)
    return np.where(np.abs(values) <= ROUNDING * largest, 0.0, values)


def _loads(data: Any) -> list[str]:
    """Return the names of the loads that change."""
    return str(data.attrs["loads"]).split()


def last_change(part: Any) -> tuple[str, str]:
    """Return (kind, sentence) of the change by the last whole cycle of a point's history.

    Rounding of the forces changes slips by the rounding of tractions over the margin; by 0 where
    nothing bounds it [m].
    """
    status, cycle, spent = part["status"].values, part["cycle"].values, part["dissipated"].values
    ends, dissipated = [0], list[float]()
    for i in range(1, int(cycle.max()) + 1):
        steps = cycle == i
        if np.all(status[steps] == PointStatus.OK):
            ends.append(int(np.flatnonzero(steps)[-1]))
            dissipated.append(spent[steps].sum())
    units = str(part["u_T"].attrs["units"]), str(part["dissipated"].attrs["units"])
    margin, rounding = float(part["margin"]), 0.0
    if margin > 0.0:
        traction = float(np.nanmax(np.abs(part["xi"].values) / part["c"].values))
        rounding = float(np.nanmax(part["inclusion_rounding"].values)) * traction / margin
    return cycle_change(part["u_T"].values[ends], np.array(dissipated), units, rounding)


def sentences_of(part: Any, alone: bool = False) -> list[str]:
    """Return the change from cycle to cycle, energies, and why the history ended early.

    alone: the file has one history, so that its verdict already names cycles and solved steps
    """
    solved_steps = np.flatnonzero(part["status"].values == PointStatus.OK)
    reason = str(part["reason"].values.item())
    if not len(solved_steps):
        return [f"no step was solved: {reason}"]
    texts = list[str]()
    if not alone:
        defect = number(float(np.nanmax(part["identity"].values[solved_steps])), 2)
        steps = counted(len(solved_steps) - 1, "step")
        texts.append(last_change(part)[1])
        texts.append(f"{steps} solved, relative energy balance error {defect}")
    missed = float(np.abs(part["closure"].values[solved_steps]).sum())
    dissipated = float(np.abs(part["dissipated"].values[solved_steps]).sum())
    if 0.0 < MIN_DEFECT * dissipated < missed:
        share = sentences.percent(missed / dissipated)
        if part.attrs.get("branch") == FROM_LAST:
            fault = f"work and dissipation of the steps differ by {share}"
            texts.append(f"{fault}, since forces turn within them; take more steps to balance them")
        else:
            texts.append(f"finite steps miss {share} of the energy dissipated; take more steps")
    if reason and not alone:
        texts.append(f"ended at step {len(solved_steps)}: {reason}")
    return list(filter(None, texts))
