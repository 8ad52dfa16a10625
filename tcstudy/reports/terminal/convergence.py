"""The report of a convergence file: errors with rates, orders with their reasons, extrapolated numbers."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from tcstudy.data.measured import ERRORS, NUMBERS, VERDICTS, Measure
from tcstudy.data.reading import axis_names, each_point
from tcstudy.data.records import PointStatus
from tcstudy.data.store import load_root
from tcstudy.reports import sentences
from tcstudy.reports.select_point import Value, axis_labels, describe, locate
from tcstudy.reports.terminal.tables import Heading, Part, Table, render
from tcstudy.reports.text import headed, number, prefix

GROUPS: tuple[tuple[str, str, tuple[str, ...]], ...] = (
    ("θ", "temperature", ("theta_L2", "theta_H1")),
    ("u", "displacement", ("u_energy", "u_H1", "u_L2")),
    ("u_T", "tangential displacement on Γ_C", ("u_T_L2", "u_T_max")),
    ("ξ", "friction traction on Γ_C", ("xi_L2", "xi_nodes", "xi_max")),
)
"""Errors that share a table and a panel of the plot."""

_BY_NAME = {measure.name: measure for measure in ERRORS}
LEGEND = (
    "factor, rate: from the level before. order: least-squares slope ± standard error over the levels named; of two "
    f"levels it is a guess ({sentences.GUESS}). "
    "PRE-ASYMPTOTIC: rates of the finest levels differ by more than 0.2. Values in (parentheses) did not converge "
    "and enter no fit. Errors are relative to the norm of the reference; H¹ is the seminorm; ξ is compared in L²(Γ_C) "
    "as a step function, and at the contact nodes."
)


STEADY = 1e-12
"""Relative uncertainty that is rounding and not worth a word."""


def convergence_report(
    path: Path, form: str = "text", point: Mapping[str, Value] | None = None, full: bool = True
) -> str:
    """The report in one of tables.FORMATS, from the file alone.

    point: the sweep point whose tables to show;  full: the tables of every point where none is named, else of a sweep
           the orders alone

    Raises StoreError if it is no such file, DrawError if it has no such point.
    """
    data = load_root(path)
    return render(list(parts(data, point, full)), form)


def parts(data: Any, point: Mapping[str, Value] | None = None, full: bool = True) -> Iterator[Part]:
    """Everything the report says, in order."""
    yield Heading(f"Convergence: {data.attrs['title']}", 1)
    yield f"Reference: {data.attrs['reference']}."
    yield _levels(data)
    points = each_point(data)
    if point:
        points = [locate(data, point)]
    elif len(points) > 1 and not full:
        yield from _overview(data, points)
        points = []
    for where in points:
        at = data.isel(where)
        if where:
            yield Heading(describe(data, where))
        yield from _point(at, data.attrs["reference"])
    if points:
        yield LEGEND
    for note in filter(None, str(data.attrs["notes"]).split("\n")):
        yield f"Note: {note}"


MARKS = {"exact": "exact", "slower": " <", "faster": " >", "pre_asymptotic": " ~", "too_few_levels": sentences.GUESS}
"""What stands in place of an order that is rounding, and behind one that is not as expected."""
OVERVIEW = (
    "Orders fitted over the levels. < slower and > faster than expected, ~ not yet settled (pre-asymptotic), exact: "
    f"all errors are rounding, {sentences.GUESS}: a guess from two levels, (order): some level was not solved. "
    "Tables of a point: --at NAME=VALUE; of all: -v."
)
_RANKS = {"u_H1": 1, "xi_L2": 2, "u_L2": 3, "theta_H1": 4, "u_energy": 5, "theta_L2": 6, "u_T_L2": 7, "xi_nodes": 8}
"""Importance of errors where there is no room for all."""


def _overview(data: Any, points: list[dict[str, int]]) -> Iterator[Part]:
    """The orders of all points in one table, below the order expected of each error."""
    names = [name for _, _, group in GROUPS for name in group if shown(data, name)]
    if not names:
        yield "There is no reference, and so no errors; what the numbers tend to: -v."
        return
    swept, rows = _swept(data), []
    for where in points:
        labels = [texts[where[str(data[name].dims[0])]] for name, texts, _ in swept]
        rows.append((*labels, *(_order(data.isel(where), name) for name in names)))
    expected = [np.unique(np.round(data[f"expected_{name}"].values, 2)) for name in names]
    expected = [values[np.isfinite(values)] for values in expected]  # a point without a mesh has none
    first = ("expected", *("" for _ in swept[1:]))
    rows.insert(0, (*first, *("…".join(dict.fromkeys(map(_fixed, e[[0, -1]]))) if len(e) else "–" for e in expected)))
    header = (*(headed(name, unit) for name, _, unit in swept), *(_BY_NAME[name].symbol for name in names))
    ranks = (*(0 for _ in swept), *(_RANKS.get(name, 9) for name in names))
    yield Table("Orders of convergence", header, tuple(rows), ranks=ranks)
    yield OVERVIEW


def _swept(data: Any) -> list[tuple[str, list[str], str]]:
    """(name, labels, unit) of the swept parameters."""
    return [(name, *axis_labels(data, name)) for name in axis_names(data)]


def _order(at: Any, name: str) -> str:
    verdict, slope = VERDICTS[int(at[f"verdict_{name}"])], float(at[f"slope_{name}"])
    text = MARKS["exact"] if verdict == "exact" else _fixed(slope) + MARKS.get(verdict, "")
    return text if bool((at["status"] == int(PointStatus.OK)).all()) else f"({text})"


def shown(at: Any, name: str) -> bool:
    """Whether the point has this error on some level."""
    return f"error_{name}" in at and bool(np.isfinite(at[f"error_{name}"]).any())


def _levels(data: Any) -> Table:
    """The levels; of a sweep over geometries those of each, beside what makes it."""
    size, unit = prefix(data["h_max"].values.ravel().tolist(), data["h_max"].attrs["units"])
    dims = [str(dim) for dim in data["h_max"].dims if dim != "level"]
    swept = [one for one in _swept(data) if str(data[one[0]].dims[0]) in dims]
    rows = []
    for place in np.ndindex(*(data.sizes[dim] for dim in dims)):
        where = dict(zip(dims, place, strict=True))
        own = [texts[where[str(data[name].dims[0])]] for name, texts, _ in swept]
        one = data[["h_max", "n_dof", "n_contact"]].isel(where)
        for i in range(data.sizes["level"]) if np.isfinite(one["h_max"]).all() else ():
            sizes = number(one["h_max"][i] / size), str(int(one["n_dof"][i])), str(int(one["n_contact"][i]))
            rows.append((*own, str(i), *sizes))
    header = (*(headed(name, unit) for name, _, unit in swept), "level", headed("h_max", unit))
    return Table("Meshes", (*header, "dofs", "contact unknowns"), tuple(rows))


def _point(at: Any, reference: str) -> Iterator[Part]:
    measured: list[str] = []
    for symbol, words, group in GROUPS:
        names = tuple(name for name in group if shown(at, name))
        measured += names
        if names:
            yield _errors(at, symbol, words, names, reference)
    if measured:
        yield _orders(at, tuple(measured))
    values = {measure: at.get(f"value_{measure.name}") for measure in NUMBERS}
    numbers = [measure for measure, value in values.items() if value is not None and np.isfinite(value).any()]
    if numbers:
        yield _numbers(at, numbers)


def _errors(at: Any, symbol: str, words: str, names: tuple[str, ...], reference: str) -> Table:
    """Value, factor and rate of a group of errors by level."""
    header = ["level"]
    for name in names:
        header += [_BY_NAME[name].symbol, "factor", "rate"]
    rows = []
    for i in range(at.sizes["level"]):
        if not int(at["compared"][i]):
            continue
        row = [str(i)]
        for name in names:
            error, rate = at[f"error_{name}"].values, float(at[f"rate_{name}"][i])
            ok = int(at["status"][i]) == int(PointStatus.OK)
            row.append(_small(error[i]) if ok else f"({_small(error[i])})")
            row.append(_fixed(error[i - 1] / error[i] if np.isfinite(rate) else np.nan))
            row.append(_fixed(rate))
        rows.append(tuple(row))
    caption = f"Relative error of {symbol} ({words}); reference: {reference.split(' (')[0]}"
    ranks = (0, *(0, 2, 1) * len(names))
    return Table(caption, tuple(header), tuple(rows), ranks=ranks)


def _orders(at: Any, names: tuple[str, ...]) -> Table:
    """Fitted against expected orders."""
    rows = []
    for name in names:
        slope, error = float(at[f"slope_{name}"]), float(at[f"slope_error_{name}"])
        first = int(at[f"first_level_{name}"])
        verdict = VERDICTS[int(at[f"verdict_{name}"])]
        finite = np.isfinite(slope)
        order = sentences.order(slope, error, 3)
        last = int(np.flatnonzero(np.isfinite(at[f"error_{name}"].values))[-1])
        fitted, expected = f"{first}–{last}" if finite else "–", _fixed(float(at[f"expected_{name}"]))
        reason = str(at[f"reason_{name}"].item())
        rows.append((_BY_NAME[name].symbol, order, fitted, expected, _word(verdict), reason))
    header = ("error", "order", "levels", "expected", "verdict", "reason of the expected order")
    return Table("Orders of convergence", header, tuple(rows), ranks=(0, 0, 3, 2, 1, 4))


def _word(verdict: str) -> str:
    word = sentences.VERDICTS[verdict]
    return word.upper() if verdict in ("slower", "pre_asymptotic") else word


def _numbers(at: Any, measures: list[Measure]) -> Table:
    """Numbers by level, extrapolated to h = 0; the heat balance tends to nothing and has two digits."""
    ok = at["status"].values == int(PointStatus.OK)
    header, columns = ["level"], [[*(str(i) for i in range(len(ok))), "h → 0", "exact"]]
    exact = False
    for m in measures:
        divisor, unit = prefix(at[f"value_{m.name}"].values.tolist(), at[f"value_{m.name}"].attrs["units"])
        tends = m.name != "heat_balance"
        values = [number(value / divisor, 7 if tends else 2) for value in at[f"value_{m.name}"].values]
        column = [value if good else f"({value})" for value, good in zip(values, ok, strict=True)]
        header.append(headed(m.symbol, unit))
        if not tends:
            columns.append([*column, "–", "–"])
            continue
        limit, unsure, known = (float(at[f"{part}_{m.name}"]) / divisor for part in ("limit", "uncertainty", "exact"))
        exact = exact or bool(np.isfinite(known))
        orders = [*at[f"order_{m.name}"].values, float(at[f"limit_order_{m.name}"])]
        columns += [[*column, _uncertain(limit, unsure), number(known, 7)], [*map(_fixed, orders), ""]]
        header.append("order")
    rows = list(zip(*columns, strict=True))
    caption = "Numbers, extrapolated by Richardson's rule"
    return Table(caption, tuple(header), tuple(rows if exact else rows[:-1]))


def _uncertain(value: float, uncertainty: float) -> str:
    """A value with as many digits as its uncertainty lets stand."""
    if not np.isfinite(value):
        return "–"
    if not uncertainty > STEADY * abs(value):
        return number(value, 7)
    decimals = 1 - int(np.floor(np.log10(uncertainty)))
    if abs(value) <= STEADY * uncertainty:  # rounding of zero
        return f"0 ± {uncertainty:.2g}"
    if decimals >= 0 and 1e-3 <= abs(value) < 1e7:
        spread = f"{uncertainty:.{decimals}f}" if decimals <= 5 else f"{uncertainty:.2g}"
        return f"{value:z.{decimals}f} ± {spread}"
    digits = int(np.clip(np.ceil(np.log10(max(abs(value), uncertainty) / uncertainty)) + 2, 2, 10))
    return f"{value:.{digits}g} ± {uncertainty:.2g}"


def _fixed(value: float) -> str:
    return f"{value:z.2f}" if np.isfinite(value) else "–"


def _small(value: float) -> str:
    return f"{value:.3e}" if np.isfinite(value) else "–"
