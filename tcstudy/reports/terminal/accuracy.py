"""What the files of convergence and of accuracy against cost say: errors with rates and orders,
errors against time."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from tcstudy.accuracy.limits import MIN_LEVELS as LIMIT_LEVELS
from tcstudy.accuracy.orders import TIED, dominated, equal_settings
from tcstudy.data.reading import axis_names, by_point, each_point
from tcstudy.data.schema import PointStatus
from tcstudy.data.tables import BY_ITSELF, ERRORS, MEASURES, NUMBERS, OWN, VERDICTS, Measure
from tcstudy.errors import DrawError
from tcstudy.reports import sentences
from tcstudy.reports.select_point import Value, axis_labels, describe, locate
from tcstudy.reports.sentences import percent
from tcstudy.reports.text import (
    Heading,
    Part,
    Table,
    TextColumn,
    Verdict,
    counted,
    failure_lines,
    headed,
    labelled,
    number,
    prefix,
    pretty,
)

# -- convergence
# -------------------------------------------------------------------------------------------------------

GROUPS = {
    "θ": "temperature",
    "u": "displacement",
    "u_T": "tangential displacement on Γ_C",
    "ξ": "friction traction on Γ_C",
}
"""What errors are of, by which they share a panel of the plot: their symbol up to the norm."""
SYMBOLS = {measure.name: measure.symbol for measure in (*ERRORS, *MEASURES)}
LEGEND = (
    "rate: from the level before. order: least-squares slope ± standard error over the levels named; of two levels it "
    f"is a guess ({sentences.GUESS}). PRE-ASYMPTOTIC: rates of the finest levels differ by more than 0.2. Values in "
    "(parentheses) did not converge and enter no fit. Errors are relative to the norm of the reference; H¹ is the "
    "seminorm; ξ is compared in L²(Γ_C) as a step function, and at the contact nodes."
)
UNCERTAINTY = (
    "h → 0: limit ± uncertainty, which held 95 % or more of the limits of random scenes that are "
    "known well enough to judge; a slip length is uncertain by one cell at least; fewer than "
    f"{LIMIT_LEVELS} levels give no limit"
)
MARKS = {"slower": " <", "faster": " >", "pre_asymptotic": " ~", "too_few_levels": sentences.GUESS}
"""What stands behind an order that is not as expected."""
OVERVIEW = (
    "Orders fitted over the levels. < slower and > faster than expected, ~ not yet settled (pre-asymptotic), exact: "
    f"all errors are rounding, {sentences.GUESS}: a guess from two levels, (order): some level was not solved. "
    "Tables of a point: --at NAME=VALUE; of all: -v."
)
STEADY = 1e-12
"""Relative uncertainty that is rounding and not worth a word."""


TEMPERATURE = "θ"
"""Begins the symbols of errors of the temperature, which are no mechanical ones."""


def convergence_lines(data: Any) -> list[tuple[str, str]]:
    """Return labelled lines: orders, the reference, errors with limits, and what was solved.

    Levels that were not solved come first, with their reasons.
    """
    verdicts = _verdicts(data)
    mechanical = [(m.symbol, word) for m, word in verdicts if m.symbol[0] != TEMPERATURE]
    warm = [(m.symbol, word) for m, word in verdicts if m.symbol[0] == TEMPERATURE]
    lines = [("Answer", text) for text in sentences.orders(mechanical)]
    if any(word not in sentences.OPEN for _, word in warm):
        lines += [("Answer", f"temperature: {text}") for text in sentences.orders(warm)]
    lines.append(("Trust", _reference_words(data)))
    lines += [("Accuracy", text) for text in (_finest_errors(data), *_limit_words(data))]
    solved, failures = _solved_words(data)
    if failures:
        return [("Solved", solved), *(("Reason", text) for text in failures), *lines]
    return [*lines, ("Solved", solved)]


def _verdicts(data: Any) -> list[tuple[Measure, str]]:
    """Return every measured order of every point: its measure and its verdict."""
    verdicts = list[tuple[Measure, str]]()
    for measure in shown(data):
        flags = by_point(data[f"verdict_{measure.name}"], data)
        slopes = by_point(data[f"slope_{measure.name}"], data)
        for flag, slope in zip(flags, slopes, strict=True):
            word = VERDICTS[int(flag)]
            if np.isfinite(slope) or word == "exact":
                verdicts.append((measure, word))
    return verdicts


def _reference_words(data: Any) -> str:
    """Return what errors are measured against, and on how many levels."""
    reference = str(data.attrs["reference"]).removeprefix("the ")
    return f"reference: {reference}; {counted(data.sizes['level'], 'level')}"


def _finest_errors(data: Any) -> str:
    """Return the largest errors of u and ξ on the finest level that has errors."""
    errors = list[str]()
    level, point_count = -1, data["status"].size // data.sizes["level"]
    for name, words in (("u_energy", "u {} (energy)"), ("xi_L2", "ξ {} (L²)")):
        if f"error_{name}" not in data:
            continue
        ok = by_point(data["status"], data) == int(PointStatus.OK)
        error = np.where(ok, by_point(data[f"error_{name}"], data), np.nan)
        known_levels = np.flatnonzero(np.isfinite(error).any(axis=0))
        if not len(known_levels):
            continue
        level = int(known_levels[-1])
        errors.append(words.format(percent(float(np.nanmax(error[:, level])))))
    if not errors:
        return ""
    rank = "the finest" if level == data.sizes["level"] - 1 else "the finest compared"
    most = "at most " if point_count > 1 else ""
    return f"level {level}, {rank}: {most}{', '.join(errors)}"


def _limit_words(data: Any) -> list[str]:
    """Return the limits of one point, or how well those of several points are known."""
    if "limit_energy" not in data:
        return []
    if not np.isfinite(data["limit_energy"]).any():
        return [f"no limits h → 0: they need {LIMIT_LEVELS} solved levels"]
    limits = list[str]()
    for measure in NUMBERS:
        if f"limit_{measure.name}" not in data:
            continue
        limit = by_point(data[f"limit_{measure.name}"], data)
        uncertainty = by_point(data[f"uncertainty_{measure.name}"], data)
        known = np.isfinite(limit)
        if not known.any():
            continue
        if len(limit) == 1:
            divisor, unit = prefix(limit, str(data[f"limit_{measure.name}"].attrs["units"]))
            value = _uncertain(limit[0] / divisor, uncertainty[0] / divisor)
            limits.append(f"{measure.symbol} → {value} {pretty(unit)}".rstrip())
            continue
        scale = float(np.abs(limit[known]).max())
        if scale > 0.0:
            share = percent(float(uncertainty[known].max()) / scale)
            limits.append(f"{share} ({measure.symbol})")
    if data["status"].size == data.sizes["level"]:
        return limits
    return [f"limits h → 0 known to {', '.join(limits)}, relative to the largest of all points"]


def _solved_words(data: Any) -> tuple[str, list[str]]:
    """Return how much was solved, and the failures by kind with their reasons."""
    status = by_point(data["status"], data)
    points, levels = status.shape
    ok = status == int(PointStatus.OK)
    solved = f"{int(ok.sum())} of {levels} levels"
    if points > 1:
        solved = f"{int(ok.sum())} of {ok.size} solutions ({points} points, {levels} levels)"
    reasons = by_point(data["reason"], data) if "reason" in data else None
    words = [describe(data, where) for where in each_point(data)]
    failures = list[tuple[PointStatus, str, str, int]]()
    for place_number, (point, level) in enumerate(np.argwhere(~ok).tolist()):
        reason = "" if reasons is None else str(reasons[point, level])
        place = ", ".join(filter(None, [words[point], f"level {level}"]))
        failures.append((PointStatus(int(status[point, level])), reason, place, place_number))
    return solved, failure_lines(failures, "solution")


def convergence_verdict(data: Any) -> Verdict:
    """Return the labelled lines; complete where every level is solved and no order is slower than
    expected."""
    solved = bool(np.all(data["status"].values == int(PointStatus.OK)))
    slower = any(word == "slower" for _, word in _verdicts(data))
    return Verdict.of_lines(convergence_lines(data), complete=solved and not slower)


def convergence_parts(
    data: Any, full: bool = True, point: Mapping[str, Value] | None = None
) -> Iterator[Part]:
    """Everything the report says, in order; not `full`, of a sweep the orders alone. Raises
    DrawError if there is no such point.
    """
    yield Heading(f"Convergence: {data.attrs['title']}", 1)
    yield _levels(data)
    points = [locate(data, point)] if point else each_point(data)
    if len(points) > 1 and not full:
        yield from _overview(data, points)
        points = []
    for where in points:
        if where:
            yield Heading(describe(data, where))
        yield from tables(data.isel(where))
    if points:
        yield LEGEND
    yield from notes(data)


def notes(data: Any) -> list[str]:
    """What the file notes of how it was measured."""
    return [f"Note: {note}" for note in str(data.attrs["notes"]).split("\n") if note]


def tables(at: Any) -> Iterator[Table]:
    """The tables of a sweep point."""
    if shown(at):
        yield _errors(at)
    if measures := [
        m for m in NUMBERS if f"value_{m.name}" in at and np.isfinite(at[f"value_{m.name}"]).any()
    ]:
        yield _numbers(at, measures)


def shown(at: Any) -> list[Measure]:
    """The errors that there are on some level."""
    return [
        m for m in ERRORS if f"error_{m.name}" in at and np.isfinite(at[f"error_{m.name}"]).any()
    ]


def _levels(data: Any) -> Table:
    """The levels; of a sweep over geometries those of each, beside what makes it."""
    dims = list(data["h_max"].dims)
    columns = [
        np.nan_to_num(data[name].values, nan=-1.0) for name in ("h_max", "n_dof", "n_contact")
    ]
    sizes = np.stack(columns, axis=-1).astype(float)
    for dim in [dim for dim in dims if dim != "level"]:
        axis = dims.index(dim)
        first = sizes.take(0, axis)
        if np.all(sizes == np.expand_dims(first, axis)):
            dims.remove(dim)
            sizes = first
    divisor, unit = prefix(data["h_max"].values, data["h_max"].attrs["units"])
    names = [name for name in axis_names(data) if data[name].dims[0] in dims]
    labels = {name: axis_labels(data, name) for name in names}
    rows = []
    for place in np.ndindex(sizes.shape[:-1]):
        where = dict(zip(dims, place, strict=True))
        h, dofs, contact = sizes[place]
        if h > 0.0:
            own = [texts[where[data[name].dims[0]]] for name, (texts, _) in labels.items()]
            size = number(h / divisor), f"{dofs:.0f}", f"{contact:.0f}"
            rows.append((*own, str(place[-1]), *size))
    header = [
        *(headed(name, unit) for name, (_, unit) in labels.items()),
        "level",
        headed("h_max", unit),
    ]
    return Table.of_rows("Meshes", [*header, "dofs", "contact unknowns"], rows)


def _overview(data: Any, points: Sequence[dict[str, int]]) -> Iterator[Part]:
    """The orders of all points in one table, below the order expected of each error."""
    if not shown(data):
        yield "There is no reference, and so no errors. Limits h → 0 of every point: -v."
        return
    columns = []
    for i, name in enumerate(axis_names(data)):
        texts, unit = axis_labels(data, name)
        own = [texts[where[str(data[name].dims[0])]] for where in points]
        columns.append(TextColumn(headed(name, unit), ["" if i else "expected", *own]))
    for rank, m in enumerate(shown(data)):
        span = np.unique(np.round(data[f"expected_{m.name}"].values, 2))
        span = span[np.isfinite(span)]  # a point without a mesh has none
        cells = ["…".join(dict.fromkeys(map(_fixed, span[[0, -1]]))) if len(span) else "–"]
        for at in map(data.isel, points):
            verdict, slope = (
                VERDICTS[int(at[f"verdict_{m.name}"])],
                _fixed(float(at[f"slope_{m.name}"])),
            )
            text = verdict if verdict == "exact" else slope + MARKS.get(verdict, "")
            cells.append(text if np.all(at["status"].values == PointStatus.OK) else f"({text})")
        columns.append(TextColumn(m.symbol, cells, rank))
    yield Table("Orders of convergence", columns)
    yield OVERVIEW


def _errors(at: Any) -> Table:
    """A row for each error: its values by level with their rates, and the fitted beside the
    expected order."""
    levels = np.flatnonzero(at["compared"].values)
    ok = at["status"].values == int(PointStatus.OK)
    rows = []
    for m in shown(at):
        error, slope, expected = (
            at[f"{part}_{m.name}"].values for part in ("error", "slope", "expected")
        )
        row = [m.symbol]
        for i in levels:
            text = f"{error[i]:.3e}" if np.isfinite(error[i]) else "–"
            row += [text if ok[i] else f"({text})", _fixed(at[f"rate_{m.name}"].values[i])]
        fitted = f"{int(at[f'first_level_{m.name}'])}–{np.flatnonzero(np.isfinite(error))[-1]}"
        row += [
            sentences.order(slope, float(at[f"slope_error_{m.name}"]), 3),
            fitted if np.isfinite(slope) else "–",
        ]
        verdict = VERDICTS[int(at[f"verdict_{m.name}"])]
        word = sentences.VERDICTS[verdict]
        loud = word.upper() if verdict in ("slower", "pre_asymptotic") else word
        rows.append((*row, _fixed(expected), loud, str(at[f"reason_{m.name}"].item())))
        for beside in (one for one in BY_ITSELF if one.split("_", 1)[1] == m.name and one in at):
            values = (
                f"{value:.3e}" if np.isfinite(value) else "–" for value in at[beside].values[levels]
            )
            rows.append(
                (
                    f"  {beside.split('_')[0]}",
                    *(cell for text in values for cell in (text, "–")),
                    *("–",) * 5,
                )
            )
    header, ranks, k = ["error"], [0], len(levels)
    for left, level in zip(range(k, 0, -1), levels, strict=True):  # coarse ones go first
        header += [f"level {level}", "rate"]
        ranks += [2 * left + 4, 2 * left + 3] if left > 2 else [0, 3]
    table = Table.of_rows(
        f"Relative errors; reference: {str(at.attrs['reference']).split(' (')[0]}",
        [*header, "order", "levels", "expected", "verdict", "reason of the expected order"],
        rows,
        [*ranks, 0, 98, 2, 1, 99],
    )
    return replace(
        table, columns=[one for one in table.columns if {*one.cells} != {"–"}]
    )  # no rate on the first


def _numbers(at: Any, measures: Sequence[Measure]) -> Table:
    """A row for each result: by level, extrapolated to h = 0."""
    ok = at["status"].values == int(PointStatus.OK)
    rows, levels = [], len(ok)
    for m in measures:
        divisor, unit = prefix(at[f"value_{m.name}"].values, at[f"value_{m.name}"].attrs["units"])
        values = [number(value / divisor, 7) for value in at[f"value_{m.name}"].values]
        values = [value if good else f"({value})" for value, good in zip(values, ok, strict=True)]
        limit, unsure, known = (
            float(at[f"{p}_{m.name}"]) / divisor for p in ("limit", "uncertainty", "exact")
        )
        ends = [
            _uncertain(limit, unsure),
            _fixed(float(at[f"limit_order_{m.name}"])),
            number(known, 7),
        ]
        rows.append((headed(m.symbol, unit), *values, *ends))
    header = ("result", *(f"level {i}" for i in range(levels)), "h → 0", "order", "exact")
    ranks = (0, *(levels - i if i < levels - 1 else 0 for i in range(levels)), 0, 1, 0)
    table = Table.of_rows("Results, extrapolated to h = 0", header, rows, ranks, UNCERTAINTY)
    return (
        table if {*table.columns[-1].cells} != {"–"} else replace(table, columns=table.columns[:-1])
    )


def _uncertain(value: float, uncertainty: float) -> str:
    """A value with as many digits as its uncertainty lets stand."""
    if not np.isfinite(value):
        return "–"
    if not uncertainty > STEADY * abs(value):
        return number(value, 7)
    if abs(value) <= STEADY * uncertainty:  # rounding of zero
        return f"0 ± {uncertainty:.2g}"
    first, last = np.floor(np.log10([max(abs(value), uncertainty), uncertainty])).astype(int)
    return f"{value:#.{min(first - last + 2, 10)}g}".rstrip(".") + f" ± {uncertainty:.2g}"


def _fixed(value: float) -> str:
    return f"{value:z.2f}" if np.isfinite(value) else "–"


# -- accuracy against cost
# ---------------------------------------------------------------------------------------------

DEFAULT = "u_energy"
EXACT = 1e-10
"""Relative error that is rounding: a solution in the P1 space of every mesh has no other."""


def measure_of(data: Any, wanted: str | None) -> str:
    """The error to report: the one asked for, or of u in energy. Raises DrawError if the file does
    not have it."""
    held = [m.name for m in MEASURES if f"error_{m.name}" in data]
    if not held:
        raise DrawError("the file has no errors: nothing was there to compare with")
    name = wanted or (DEFAULT if DEFAULT in held else held[0])
    if name not in held:
        raise DrawError(f"there is no error {name!r} in the file; it has {', '.join(held)}")
    return name


@dataclass(frozen=True)
class Setting:
    """A family of meshes, a level and a solver that were measured.

    error: relative;  time, upper: least wall time of all runs and their upper quartile [s]
    solved: whether it passed its acceptance test;  own: whether it is the study's own
    families: all that have this very mesh, whose runs are taken together;  first: it stands for them
    dominated: whether another setting is as fast and as accurate, and better in one of the two
    """

    family: str
    solver: str
    level: int
    status: int
    n_dof: int
    n_contact: int
    h_max: float
    error: float
    solved: bool
    own: bool
    time: float = math.nan
    upper: float = math.nan
    first: bool = True
    families: tuple[str, ...] = ()
    dominated: bool = False


def settings(data: Any, measure: str) -> list[Setting]:
    """Return all settings that were measured, family by family and solver by solver, coarse to
    fine."""
    dims = ("family", "solver", "level")
    runs = data["time"].transpose(*dims, "run").values
    measured = list[Setting]()
    times = list[Any]()
    for place in np.ndindex(runs.shape[:-1]):
        setting = _setting(data, measure, dict(zip(dims, place, strict=True)))
        if setting.status != PointStatus.NOT_RUN:
            measured.append(setting)
            times.append(runs[place])
    solvers = data["solver"].values.tolist()
    sizes = [(solvers.index(s.solver), s.n_dof, s.n_contact, s.h_max) for s in measured]
    errors = np.array([setting.error for setting in measured])
    first = equal_settings(np.array(sizes, dtype=float).reshape(-1, 4), errors)
    for mesh in np.unique(first):
        equal = np.flatnonzero(first == mesh)
        representative = next((i for i in equal if measured[i].own), mesh)
        first[equal] = representative
        least, upper = np.quantile([times[i] for i in equal], (0.0, 0.75))
        families = tuple(measured[i].family for i in equal)
        for i in equal:
            measured[i] = replace(
                measured[i],
                time=float(least),
                upper=float(upper),
                first=i == representative,
                families=families,
            )
    time = np.array([setting.time if setting.solved else np.nan for setting in measured])
    beaten = dominated(time, errors)
    return [
        replace(setting, dominated=bool(b)) for setting, b in zip(measured, beaten, strict=True)
    ]


def _setting(data: Any, measure: str, where: Mapping[str, int]) -> Setting:
    """Return what a file has of a setting by its index along family, solver and level."""

    def at(name: str) -> Any:
        variable = data[name]
        return variable.isel({dim: i for dim, i in where.items() if dim in variable.dims}).item()

    family, solver, level = at("family"), at("solver"), at("level")
    own = tuple(data.attrs[f"own_{part}"] for part in ("family", "solver", "level"))
    status = at("status")
    return Setting(
        family=family,
        solver=solver,
        level=level,
        status=status,
        n_dof=at("n_dof"),
        n_contact=at("n_contact"),
        h_max=at("h_max"),
        error=at(f"error_{measure}"),
        solved=status == PointStatus.OK,
        own=(family, solver, level) == own,
    )


def words(setting: Setting) -> str:
    """A setting in words; "study" is its own family of meshes."""
    family = "the study's meshes" if setting.family == "study" else setting.family
    return f"{family}, level {setting.level}, {setting.solver}"


def front(found: Sequence[Setting]) -> list[Setting]:
    """Settings that no other beats in both, from fast to accurate, each mesh once."""
    return sorted((s for s in found if s.first and not s.dominated), key=lambda s: s.time)


def clearly_faster(one: Setting, other: Setting) -> bool:
    """Return whether a setting is faster beyond noise: the upper quartile of its times lies below
    every time of the other one."""
    return bool(one.upper < other.time)


def advice(found: Sequence[Setting]) -> list[str]:
    """Sentences: the study's own setting, what is better, and which meshes suit which error."""
    measured = [s for s in found if s.first and s.solved and np.isfinite(s.error)]
    if not measured:
        return ["no setting was solved"]
    largest_error = max(s.error for s in measured)
    if largest_error <= EXACT:
        least = min(measured, key=lambda s: s.time)
        return [
            f"all errors are rounding (at most {largest_error:.1e}): every mesh represents this solution exactly",
            f"least time measured: {words(least)} in {_seconds(least.time)}",
        ]
    return [*_own_and_better(found, measured), *_front_words(found)]


def _own_and_better(found: Sequence[Setting], measured: Sequence[Setting]) -> list[str]:
    """Return the study's own setting, and those that are more accurate in less time, or in a time
    that the runs do not tell apart."""
    own = next((s for s in found if s.own), None)
    if own is None:
        return []
    if not (own.solved and np.isfinite(own.error)):
        return [f"the study's own setting ({words(own)}) was not solved"]
    answer = [
        f"the study's mesh: error {percent(own.error)} in {_seconds(own.time)} ({words(own)})"
    ]
    better = [s for s in measured if s.error < own.error * (1.0 - TIED)]
    faster = [s for s in better if clearly_faster(s, own)]
    if faster:
        quickest = min(faster, key=lambda s: s.time)
        most_accurate = min(faster, key=lambda s: s.error)
        for s in dict.fromkeys((quickest, most_accurate)):
            answer.append(f"faster and more accurate: {_setting_words(s, own)}")
        return answer
    alike = [s for s in better if not clearly_faster(own, s)]
    if alike:
        best = min(alike, key=lambda s: s.error)
        return [*answer, f"more accurate, no clear difference in time: {_setting_words(best, own)}"]
    return [*answer, "no other setting measured is both faster and more accurate"]


def _setting_words(setting: Setting, own: Setting) -> str:
    """Return a setting with its error and its time; the solver only where it is another one."""
    mesh = words(setting).removesuffix(f", {own.solver}")
    return f"{mesh}: {percent(setting.error)} in {_seconds(setting.time)}"


def _front_words(found: Sequence[Setting]) -> list[str]:
    """Return which meshes and solvers are on the Pareto front at which errors.

    A mesh that several families share counts with the family beside it on the front.
    """
    spans = list[tuple[set[str], list[Any]]]()
    for s in front(found):
        families = set(s.families)
        joined = spans[-1][0] & families if spans and spans[-1][1][-1].solver == s.solver else set()
        if joined:
            spans[-1] = joined, [*spans[-1][1], s]
        else:
            spans.append((families, [s]))
    solvers = {points[0].solver for _, points in spans}
    texts = list[str]()
    for families, points in spans:
        family = next(s.family for s in found if s.family in families)
        meshes = "the study's meshes" if family == OWN else family
        solver = f" with {points[0].solver}" if len(solvers) > 1 else ""
        errors = [percent(s.error).removesuffix(" %") for s in points]
        ends = dict.fromkeys((errors[0], errors[-1]))
        texts.append(f"{' to '.join(ends)} %: {meshes}{solver}")
    return [f"least time for errors of {'; '.join(texts)}"] if texts else []


def cost_lines(data: Any, measure: str) -> list[tuple[str, str]]:
    """Return labelled lines: the advice, the scene, the reference, and what was solved."""
    found = settings(data, measure)
    point, runs = str(data.attrs["point"]), counted(data.sizes["run"], "run")
    scene = f"one scene: {point}; {runs} each" if point else f"one scene; {runs} each"
    reference = str(data.attrs["reference"]).removeprefix("the ")
    solved = sum(s.solved for s in found)
    lines = [("Answer", text) for text in advice(found)]
    lines += [("Trust", scene), ("Accuracy", f"reference: {reference}")]
    return [*lines, ("Solved", f"{solved} of {counted(len(found), 'setting')}")]


def _seconds(time: float) -> str:
    """A wall time, "0.16 s"."""
    return f"{time:.2g} s" if time < 99.5 else f"{time:.0f} s"


def cost_verdict(data: Any) -> Verdict:
    """Return the labelled lines of the error that is reported unless another one is named."""
    if not any(f"error_{m.name}" in data for m in MEASURES):
        return Verdict(answer=("nothing was measured",))
    return Verdict.of_lines(cost_lines(data, measure_of(data, None)))


def cost_parts(data: Any, *_: Any) -> Iterator[Part]:
    """Everything the report says, in order. Raises DrawError where there is no error."""
    yield from cost_of(data, measure_of(data, None))


def cost_of(data: Any, measure: str) -> Iterator[Part]:
    """The same of one of the errors."""
    found = settings(data, measure)
    yield Heading(f"Accuracy against cost: {data.attrs['title']}", 1)
    yield labelled(cost_lines(data, measure))
    yield (
        f"Errors of {SYMBOLS[measure]}. Wall time from the body to the displacements, each run from "
        "nothing: least of all runs, upper quartile. Equal meshes are one setting with the runs of all."
    )
    rows, solvers = [], data["solver"].values.tolist()
    meshes = dict.fromkeys((s.family, s.level) for s in found if s.first)
    for family, level in meshes:
        by_solver = {s.solver: s for s in found if (s.family, s.level) == (family, level)}
        one = by_solver.get(solvers[0]) or next(iter(by_solver.values()))
        error = f"{one.error:.3e}" if np.isfinite(one.error) else "–"
        row = [
            ", ".join(one.families),
            str(level),
            str(one.n_dof),
            str(one.n_contact),
            error if one.solved else f"({error})",
        ]
        for s in map(by_solver.get, solvers):
            mark = "" if s is None else "†" * s.own + "*" * (not s.dominated)
            row += ["–", "–"] if s is None else [f"{s.time:.3g}{mark}", f"{s.upper:.3g}"]
        rows.append(row)
    header = ["meshes", "level", "dofs", "contact unknowns", f"error of {SYMBOLS[measure]}"]
    ranks = [0, 0, 1, 4, 0]
    for place, solver in enumerate(solvers):
        header += [f"{solver} [s]", "quartile"]
        ranks += [0 if place == 0 else 2, 3]
    marks = "* on the front   † the study's own settings   (error) not solved"
    yield Table.of_rows("All that was measured", header, rows, ranks, marks)
    yield from notes(data)
