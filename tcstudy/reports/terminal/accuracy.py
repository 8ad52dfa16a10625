"""Reports on convergence and on accuracy against cost: errors with rates and orders, with times."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from tcstudy.accuracy.limits import MIN_LEVELS as LIMIT_LEVELS
from tcstudy.accuracy.orders import TIED, dominated, equal_settings
from tcstudy.data.reading import axis_names, by_point, each_point
from tcstudy.data.schema import POLYGON, PointStatus
from tcstudy.data.store import GUARANTEE
from tcstudy.data.tables import (
    BOUND,
    BY_ITSELF,
    ERRORS,
    ESTIMATE,
    MEASURES,
    NUMBERS,
    OWN,
    VERDICTS,
    Measure,
)
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

GROUPS = {
    "θ": "temperature",
    "u": "displacement",
    "u_T": "tangential displacement on Γ_C",
    "ξ": "friction traction on Γ_C",
    "s_N": "opening of Γ_C",
    "S_N": "normal traction of openings",
}
"""Quantities whose errors share a panel of the plot, by the symbol of the error up to the norm."""
SYMBOLS = {measure.name: measure.symbol for measure in (*ERRORS, *MEASURES)}
LEGEND = (
    "rate: observed between two levels. order: least-squares slope ± standard error over the "
    "levels "
    f"named; two levels: not judged ({sentences.GUESS}). PRE-ASYMPTOTIC: rates of the finest "
    "levels differ by more than 0.2. Values in (parentheses) did not converge and enter no fit. "
    "Errors are relative to the norm of the reference; H¹ is the seminorm; ξ is compared in "
    "L²(Γ_C) as a step function, and at the contact nodes."
)
UNCERTAINTY = (
    "h → 0: limit ± uncertainty, which covered the limit of 95 % or more of the "
    "random scenes whose limit is known well enough; a slip length is uncertain by at least one "
    f"contact element; fewer than {LIMIT_LEVELS} levels give no limit"
)
MARKS = {"slower": " <", "faster": " >", "pre_asymptotic": " ~", "too_few_levels": sentences.GUESS}
"""What stands behind an order that is not as expected."""
OVERVIEW = (
    "Orders fitted over the levels. < slower and > faster than expected, ~ not in the asymptotic "
    "range (pre-asymptotic), exact: all errors are at rounding level, "
    f"{sentences.GUESS}: two levels, not judged, (order): some level was not solved. "
    "Tables of a point: --at NAME=VALUE; of all: -v."
)
MAX_ROUNDING = 1e-12
"""Relative uncertainty up to which it is rounding and not shown."""


TEMPERATURE = "θ"
"""First letter of the symbols of errors of the temperature."""


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
    # friction that follows the pressure has no energy
    names = [f"limit_{m.name}" for m in NUMBERS if f"limit_{m.name}" in data]
    if not names:
        return []
    if not np.isfinite(data[names[0]]).any():
        return [f"no limits h → 0: they need {LIMIT_LEVELS} solved levels"]
    limits = list[str]()
    for measure in NUMBERS:
        if f"limit_{measure.name}" not in data:
            continue
        limit = by_point(data[f"limit_{measure.name}"], data)
        uncertainty = by_point(data[f"uncertainty_{measure.name}"], data)
        is_finite = np.isfinite(limit)
        if not is_finite.any():
            continue
        if len(limit) == 1:
            divisor, unit = prefix(limit, str(data[f"limit_{measure.name}"].attrs["units"]))
            value = _uncertain(limit[0] / divisor, uncertainty[0] / divisor)
            limits.append(f"{measure.symbol} → {value} {pretty(unit)}".rstrip())
            continue
        scale = float(np.abs(limit[is_finite]).max())
        if scale > 0.0:
            share = percent(float(uncertainty[is_finite].max()) / scale)
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
    """Return the verdict: complete where every level is solved and no order is too slow."""
    solved = bool(np.all(data["status"].values == int(PointStatus.OK)))
    slower = any(word == "slower" for _, word in _verdicts(data))
    return Verdict.of_lines(convergence_lines(data), complete=solved and not slower)


def convergence_parts(
    data: Any, full: bool = True, point: Mapping[str, Value] | None = None
) -> Iterator[Part]:
    """Yield all parts of the report; of a sweep that is not `full` the orders alone.

    Raises DrawError if there is no such point.
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
    """Return the notes of the file on how it was measured."""
    return [f"Note: {note}" for note in str(data.attrs["notes"]).split("\n") if note]


def tables(point: Any) -> Iterator[Table]:
    """Yield the tables of a sweep point."""
    if shown(point):
        yield _errors(point)
    measures = [measure for measure in NUMBERS if _has(point, f"value_{measure.name}")]
    if measures:
        yield _numbers(point, measures)


def shown(point: Any) -> list[Measure]:
    """Return the errors that are known on some level."""
    return [measure for measure in ERRORS if _has(point, f"error_{measure.name}")]


def _has(data: Any, name: str) -> bool:
    """Return whether a file has a finite value of a variable."""
    return name in data and bool(np.isfinite(data[name]).any())


def _levels(data: Any) -> Table:
    """Return the levels; of a sweep over geometries those of each, with its parameters."""
    dims = list(data["h_max"].dims)
    names = ("h_max", "n_dof", "n_contact")
    columns = [np.nan_to_num(data[name].values, nan=-1.0) for name in names]
    sizes = np.stack(columns, axis=-1).astype(float)
    for dim in [dim for dim in dims if dim != "level"]:
        axis = dims.index(dim)
        first = sizes.take(0, axis)
        if np.all(sizes == np.expand_dims(first, axis)):
            dims.remove(dim)
            sizes = first
    divisor, unit = prefix(data["h_max"].values, data["h_max"].attrs["units"])
    axes = [name for name in axis_names(data) if data[name].dims[0] in dims]
    labels = {name: axis_labels(data, name) for name in axes}
    rows = list[list[str]]()
    for place in np.ndindex(sizes.shape[:-1]):
        where = dict(zip(dims, place, strict=True))
        h, dofs, contact = sizes[place]
        if h > 0.0:
            row = [texts[where[data[name].dims[0]]] for name, (texts, _) in labels.items()]
            row += [str(place[-1]), number(h / divisor), f"{dofs:.0f}", f"{contact:.0f}"]
            rows.append(row)
    header = [headed(name, axis_unit) for name, (_, axis_unit) in labels.items()]
    header += ["level", headed("h_max", unit), "DOFs", "contact DOFs"]
    return Table.of_rows("Meshes", header, rows)


def _overview(data: Any, points: Sequence[dict[str, int]]) -> Iterator[Part]:
    """Yield the orders of all points in one table, below the order expected of each error."""
    measures = shown(data)
    if not measures:
        yield "There is no reference, and so no errors. Limits h → 0 of every point: -v."
        return
    columns = list[TextColumn]()
    for name in axis_names(data):
        texts, unit = axis_labels(data, name)
        labels = [texts[where[str(data[name].dims[0])]] for where in points]
        first = "" if columns else "expected"
        columns.append(TextColumn(headed(name, unit), [first, *labels]))
    for rank, measure in enumerate(measures):
        cells = [_expected_orders(data, measure)]
        cells += [_fitted_order(data.isel(where), measure) for where in points]
        columns.append(TextColumn(measure.symbol, cells, rank))
    yield Table("Orders of convergence", columns)
    yield OVERVIEW


def _expected_orders(data: Any, measure: Measure) -> str:
    """Return the range of the orders expected at all points."""
    orders = np.unique(np.round(data[f"expected_{measure.name}"].values, 2))
    orders = orders[np.isfinite(orders)]  # a point without a mesh has none
    if not len(orders):
        return "–"
    return "…".join(dict.fromkeys(map(_fixed, orders[[0, -1]])))


def _fitted_order(point: Any, measure: Measure) -> str:
    """Return the order at a point with the mark of its verdict."""
    verdict = VERDICTS[int(point[f"verdict_{measure.name}"])]
    slope = _fixed(float(point[f"slope_{measure.name}"]))
    text = verdict if verdict == "exact" else slope + MARKS.get(verdict, "")
    is_solved = np.all(point["status"].values == PointStatus.OK)
    return text if is_solved else f"({text})"


UNREFERENCED = {"estimate": "estimate", "bound": "proved bound"}
"""Errors that need no reference, in words."""


def bound_words(data: Any) -> list[str]:
    """Return a sentence on what the proved bounds of a file are of, if it has any."""
    guarantee = data.attrs.get(GUARANTEE)
    if guarantee is None:
        return []
    body = f"the {POLYGON}" if guarantee == "polygon" else "the body itself"
    return [f"proved bound: of the relative error of u for {body}; it needs no reference"]


def unreferenced(data: Any, measure: str) -> list[Measure]:
    """Return what a file of costs has beside an error without a reference."""
    if measure != DEFAULT:
        return []
    return [name for name in (ESTIMATE, BOUND) if f"error_{name.name}" in data]


def _errors(point: Any) -> Table:
    """Return a row for each error: its values by level with rates, fitted and expected order."""
    levels = np.flatnonzero(point["compared"].values)
    rows = list[list[str]]()
    for measure in shown(point):
        rows.append(_error_row(point, measure, levels))
        for name in BY_ITSELF:
            part, _, measure_name = name.partition("_")
            if measure_name == measure.name and name in point:
                cells = list[str]()
                for value in point[name].values[levels]:
                    cells += [f"{value:.3e}" if np.isfinite(value) else "–", "–"]
                rows.append([f"  {UNREFERENCED[part]}", *cells, *["–"] * 5])
    header, ranks = ["error"], [0]
    for remaining, level in zip(range(len(levels), 0, -1), levels, strict=True):
        header += [f"level {level}", "rate"]
        # coarse levels are hidden first, the two finest never
        ranks += [2 * remaining + 4, 2 * remaining + 3] if remaining > 2 else [0, 3]
    header += ["order", "levels", "expected", "verdict", "reason of the expected order"]
    ranks += [0, 98, 2, 1, 99]
    reference = str(point.attrs["reference"]).split(" (")[0]
    title = f"Relative errors; reference: {reference}"
    table = Table.of_rows(title, header, rows, ranks, *bound_words(point))
    # there is no rate on the first level
    columns = [column for column in table.columns if set(column.cells) != {"–"}]
    return replace(table, columns=columns)


def _error_row(point: Any, measure: Measure, levels: Any) -> list[str]:
    """Return the row of one error."""
    error, rate = point[f"error_{measure.name}"].values, point[f"rate_{measure.name}"].values
    is_solved = point["status"].values == int(PointStatus.OK)
    row = [measure.symbol]
    for level in levels:
        text = f"{error[level]:.3e}" if np.isfinite(error[level]) else "–"
        row += [text if is_solved[level] else f"({text})", _fixed(rate[level])]
    slope = point[f"slope_{measure.name}"].values
    row.append(sentences.order(slope, float(point[f"slope_error_{measure.name}"]), 3))
    finest = np.flatnonzero(np.isfinite(error))[-1]
    fitted_levels = f"{int(point[f'first_level_{measure.name}'])}–{finest}"
    row.append(fitted_levels if np.isfinite(slope) else "–")
    row.append(_fixed(point[f"expected_{measure.name}"].values))
    verdict = VERDICTS[int(point[f"verdict_{measure.name}"])]
    word = sentences.VERDICTS[verdict]
    row.append(word.upper() if verdict in ("slower", "pre_asymptotic") else word)
    row.append(str(point[f"reason_{measure.name}"].item()))
    return row


def _numbers(point: Any, measures: Sequence[Measure]) -> Table:
    """Return a row for each result: by level, extrapolated to h = 0."""
    is_solved = point["status"].values == int(PointStatus.OK)
    levels = len(is_solved)
    rows = list[list[str]]()
    for measure in measures:
        values = point[f"value_{measure.name}"]
        divisor, unit = prefix(values.values, values.attrs["units"])
        row = [headed(measure.symbol, unit)]
        for value, solved in zip(values.values, is_solved, strict=True):
            text = number(value / divisor, 7)
            row.append(text if solved else f"({text})")
        limit = float(point[f"limit_{measure.name}"]) / divisor
        uncertainty = float(point[f"uncertainty_{measure.name}"]) / divisor
        row.append(_uncertain(limit, uncertainty))
        row.append(_fixed(float(point[f"limit_order_{measure.name}"])))
        row.append(number(float(point[f"exact_{measure.name}"]) / divisor, 7))
        rows.append(row)
    header = ["result", *(f"level {i}" for i in range(levels)), "h → 0", "order", "exact"]
    ranks = [0, *(levels - i for i in range(levels - 1)), 0, 0, 1, 0]  # never the finest level
    table = Table.of_rows("Results, extrapolated to h = 0", header, rows, ranks, UNCERTAINTY)
    has_exact = set(table.columns[-1].cells) != {"–"}
    return table if has_exact else replace(table, columns=table.columns[:-1])


def _uncertain(value: float, uncertainty: float) -> str:
    """Return a value with as many digits as its uncertainty allows."""
    if not np.isfinite(value):
        return "–"
    if not uncertainty > MAX_ROUNDING * abs(value):
        return number(value, 7)
    if abs(value) <= MAX_ROUNDING * uncertainty:  # rounding of zero
        return f"0 ± {uncertainty:.2g}"
    powers = np.floor(np.log10([max(abs(value), uncertainty), uncertainty])).astype(int)
    digits = min(powers[0] - powers[1] + 2, 10)
    return f"{value:#.{digits}g}".rstrip(".") + f" ± {uncertainty:.2g}"


def _fixed(value: float) -> str:
    return f"{value:z.2f}" if np.isfinite(value) else "–"


# -- accuracy against cost

DEFAULT = "u_energy"
EXACT = 1e-10
"""Relative error that is rounding: a solution in the P1 space of every mesh has no other."""


def measure_of(data: Any, requested: str | None) -> str:
    """Return the error to report: the requested one, or that of u in energy.

    Raises DrawError if the file does not have it.
    """
    names = [measure.name for measure in MEASURES if f"error_{measure.name}" in data]
    if not names:
        raise DrawError("the file has no errors: there was no reference to compare with")
    name = requested or (DEFAULT if DEFAULT in names else names[0])
    if name not in names:
        raise DrawError(f"there is no error {name!r} in the file; it has {', '.join(names)}")
    return name


@dataclass(frozen=True)
class Setting:
    """A family of meshes, a level and a solver that were measured.

    error:       relative
    without_reference: its estimate and its proved bound, as far as the file has them
    time, upper: least wall time of all runs and their upper quartile [s]
    solved:      it passed its acceptance test
    own:         it is that of the study
    families:    all that have this very mesh, whose runs are taken together
    first:       it stands for them
    dominated:   another setting is as fast and as accurate, and better in one of the two
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
    without_reference: tuple[float, ...] = ()
    time: float = math.nan
    upper: float = math.nan
    first: bool = True
    families: tuple[str, ...] = ()
    dominated: bool = False


def settings(data: Any, measure: str) -> list[Setting]:
    """Return all measured settings by family and by solver, from coarse to fine."""
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
    flags = dominated(time, errors).tolist()
    return [replace(setting, dominated=flag) for setting, flag in zip(measured, flags, strict=True)]


def _setting(data: Any, measure: str, where: Mapping[str, int]) -> Setting:
    """Return a setting by its index along family, solver and level, without its times."""

    def value(name: str) -> Any:
        variable = data[name]
        return variable.isel({dim: i for dim, i in where.items() if dim in variable.dims}).item()

    family, solver, level = value("family"), value("solver"), value("level")
    setting_of_study = tuple(data.attrs[f"own_{part}"] for part in ("family", "solver", "level"))
    status = value("status")
    return Setting(
        family=family,
        solver=solver,
        level=level,
        status=status,
        n_dof=value("n_dof"),
        n_contact=value("n_contact"),
        h_max=value("h_max"),
        error=value(f"error_{measure}"),
        solved=status == PointStatus.OK,
        own=(family, solver, level) == setting_of_study,
        without_reference=tuple(value(f"error_{m.name}") for m in unreferenced(data, measure)),
    )


def words(setting: Setting) -> str:
    """Return a setting in words; "study" is the study's family of meshes."""
    family = "the study's meshes" if setting.family == "study" else setting.family
    return f"{family}, level {setting.level}, {setting.solver}"


def front(settings: Sequence[Setting]) -> list[Setting]:
    """Return the settings of the Pareto front, from fast to accurate, each mesh once."""
    nondominated = [setting for setting in settings if setting.first and not setting.dominated]
    return sorted(nondominated, key=lambda setting: setting.time)


def clearly_faster(setting: Setting, rival: Setting) -> bool:
    """Return whether a setting is faster beyond noise.

    The upper quartile of its times lies below every time of the rival.
    """
    return bool(setting.upper < rival.time)


def advice(settings: Sequence[Setting]) -> list[str]:
    """Return sentences on the study's setting, better ones, and meshes by error."""
    measured = [s for s in settings if s.first and s.solved and np.isfinite(s.error)]
    if not measured:
        return ["no setting was solved"]
    largest_error = max(setting.error for setting in measured)
    if largest_error <= EXACT:
        least = min(measured, key=lambda setting: setting.time)
        largest = f"all errors are rounding (at most {largest_error:.1e})"
        return [
            f"{largest}: every mesh represents this solution exactly",
            f"shortest time measured: {words(least)} in {_seconds(least.time)}",
        ]
    return [*_own_and_better(settings, measured), *_front_words(settings)]


def _own_and_better(settings: Sequence[Setting], measured: Sequence[Setting]) -> list[str]:
    """Return the study's setting, and more accurate ones that are faster or not clearly slower."""
    current = next((setting for setting in settings if setting.own), None)
    if current is None:
        return []
    if not (current.solved and np.isfinite(current.error)):
        return [f"the study's own setting ({words(current)}) was not solved"]
    error, time = percent(current.error), _seconds(current.time)
    answer = [f"the study's mesh: error {error} in {time} ({words(current)})"]
    better = [setting for setting in measured if setting.error < current.error * (1.0 - TIED)]
    faster = [setting for setting in better if clearly_faster(setting, current)]
    if faster:
        quickest = min(faster, key=lambda setting: setting.time)
        most_accurate = min(faster, key=lambda setting: setting.error)
        for setting in dict.fromkeys((quickest, most_accurate)):
            answer.append(f"faster and more accurate: {_setting_words(setting, current)}")
        return answer
    alike = [setting for setting in better if not clearly_faster(current, setting)]
    if alike:
        best = _setting_words(min(alike, key=lambda setting: setting.error), current)
        return [*answer, f"more accurate, no clear difference in time: {best}"]
    return [*answer, "no other setting measured is both faster and more accurate"]


def _setting_words(setting: Setting, current: Setting) -> str:
    """Return a setting with its error and its time; the solver only where it is another one."""
    mesh = words(setting).removesuffix(f", {current.solver}")
    return f"{mesh}: {percent(setting.error)} in {_seconds(setting.time)}"


def _front_words(settings: Sequence[Setting]) -> list[str]:
    """Return which meshes and solvers are on the Pareto front at which errors.

    A mesh that several families share counts with the family beside it on the front.
    """
    spans = list[tuple[set[str], list[Setting]]]()
    for setting in front(settings):
        families = set(setting.families)
        if spans:
            families_before, points = spans[-1]
            shared = families_before & families
            if shared and points[-1].solver == setting.solver:
                spans[-1] = shared, [*points, setting]
                continue
        spans.append((families, [setting]))
    solvers = {points[0].solver for _, points in spans}
    texts = list[str]()
    for families, points in spans:
        family = next(setting.family for setting in settings if setting.family in families)
        meshes = "the study's meshes" if family == OWN else family
        solver = f" with {points[0].solver}" if len(solvers) > 1 else ""
        ends = [percent(points[i].error).removesuffix(" %") for i in (0, -1)]
        texts.append(f"{' to '.join(dict.fromkeys(ends))} %: {meshes}{solver}")
    return [f"shortest time for errors of {'; '.join(texts)}"] if texts else []


def cost_lines(data: Any, measure: str) -> list[tuple[str, str]]:
    """Return labelled lines: the advice, the scene, the reference, and what was solved."""
    measured = settings(data, measure)
    point, runs = str(data.attrs["point"]), counted(data.sizes["run"], "run")
    scene = f"one scene: {point}; {runs} each" if point else f"one scene; {runs} each"
    reference = str(data.attrs["reference"]).removeprefix("the ")
    solved = sum(setting.solved for setting in measured)
    lines = [("Answer", text) for text in advice(measured)]
    lines += [("Trust", scene), ("Accuracy", f"reference: {reference}")]
    return [*lines, ("Solved", f"{solved} of {counted(len(measured), 'setting')}")]


def _seconds(time: float) -> str:
    """Return a wall time, "0.16 s"."""
    return f"{time:.2g} s" if time < 99.5 else f"{time:.0f} s"


def cost_verdict(data: Any) -> Verdict:
    """Return the verdict by the error that is reported unless another one is named."""
    if not any(f"error_{measure.name}" in data for measure in MEASURES):
        return Verdict(answer=("nothing was measured",))
    return Verdict.of_lines(cost_lines(data, measure_of(data, None)))


def cost_parts(data: Any, *_: Any) -> Iterator[Part]:
    """Yield all parts of the report. Raises DrawError where there is no error."""
    measure = measure_of(data, None)
    yield Heading(f"Accuracy against cost: {data.attrs['title']}", 1)
    yield labelled(cost_lines(data, measure))
    yield from measured_parts(data, measure)


def measured_parts(data: Any, measure: str) -> Iterator[Part]:
    """Yield the table of all settings by one of the errors, with its explanations."""
    measured = settings(data, measure)
    yield (
        f"Errors of {SYMBOLS[measure]}. Wall time from the body to the displacements, each run "
        "from scratch: shortest of all runs, upper quartile. Equal meshes are one setting with the "
        "runs of all."
    )
    solvers = data["solver"].values.tolist()
    meshes = dict.fromkeys((s.family, s.level) for s in measured if s.first)
    rows = list[list[str]]()
    for mesh in meshes:
        by_solver = {s.solver: s for s in measured if (s.family, s.level) == mesh}
        rows.append(_cost_row(by_solver, solvers))
    header = ["meshes", "level", "DOFs", "contact DOFs", f"error of {SYMBOLS[measure]}"]
    ranks = [0, 0, 1, 4, 0]
    names = unreferenced(data, measure)
    header += [UNREFERENCED[name.name.removeprefix("u_")] for name in names]
    ranks += range(5, 5 + len(names))
    for place, solver in enumerate(solvers):
        header += [f"{solver} [s]", "quartile"]
        ranks += [0 if place == 0 else 2, 3]
    marks = "* on the front   † the study's own settings   (error) not solved"
    explained = bound_words(data) if names else []
    yield Table.of_rows("All that was measured", header, rows, ranks, marks, *explained)
    yield from notes(data)


def _cost_row(by_solver: Mapping[str, Setting], solvers: Sequence[str]) -> list[str]:
    """Return the row of one mesh: its sizes, its errors, and the times of each solver."""
    mesh = by_solver.get(solvers[0]) or next(iter(by_solver.values()))
    error = f"{mesh.error:.3e}" if np.isfinite(mesh.error) else "–"
    row = [", ".join(mesh.families), str(mesh.level), str(mesh.n_dof), str(mesh.n_contact)]
    row.append(error if mesh.solved else f"({error})")
    row += [f"{value:.3e}" if np.isfinite(value) else "–" for value in mesh.without_reference]
    for solver in solvers:
        if solver not in by_solver:
            row += ["–", "–"]
            continue
        setting = by_solver[solver]
        marks = ("†" if setting.own else "") + ("" if setting.dominated else "*")
        row += [f"{setting.time:.3g}{marks}", f"{setting.upper:.3g}"]
    return row
