"""The report of a convergence file: errors with rates and orders, extrapolated numbers."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from tcstudy.data.reading import axis_names, by_point, each_point
from tcstudy.data.schema import PointStatus
from tcstudy.data.tables import BY_ITSELF, ERRORS, NUMBERS, VERDICTS, Measure
from tcstudy.reports import sentences
from tcstudy.reports.select_point import Value, axis_labels, describe, locate
from tcstudy.reports.terminal.tables import Heading, Part, Table
from tcstudy.reports.text import headed, number, prefix

GROUPS: tuple[tuple[str, str, tuple[str, ...]], ...] = (
    ("θ", "temperature", ("theta_L2", "theta_H1")),
    ("u", "displacement", ("u_energy", "u_H1", "u_L2")),
    ("u_T", "tangential displacement on Γ_C", ("u_T_L2", "u_T_max")),
    ("ξ", "friction traction on Γ_C", ("xi_L2", "xi_nodes", "xi_max")),
)
"""Errors that share a panel of the plot, in the order of the tables."""
SYMBOLS = {measure.name: measure.symbol for measure in ERRORS}
LEGEND = (
    "rate: from the level before. order: least-squares slope ± standard error over the levels named; of two levels it "
    f"is a guess ({sentences.GUESS}). PRE-ASYMPTOTIC: rates of the finest levels differ by more than 0.2. Values in "
    "(parentheses) did not converge and enter no fit. Errors are relative to the norm of the reference; H¹ is the "
    "seminorm; ξ is compared in L²(Γ_C) as a step function, and at the contact nodes."
)
MARKS = {"exact": "exact", "slower": " <", "faster": " >", "pre_asymptotic": " ~", "too_few_levels": sentences.GUESS}
"""What stands in place of an order that is rounding, and behind one that is not as expected."""
OVERVIEW = (
    "Orders fitted over the levels. < slower and > faster than expected, ~ not yet settled (pre-asymptotic), exact: "
    f"all errors are rounding, {sentences.GUESS}: a guess from two levels, (order): some level was not solved. "
    "Tables of a point: --at NAME=VALUE; of all: -v."
)
RANKS = {"u_H1": 1, "xi_L2": 2, "u_L2": 3, "theta_H1": 4, "u_energy": 5, "theta_L2": 6, "u_T_L2": 7, "xi_nodes": 8}
"""Importance of errors where there is no room for all."""
STEADY = 1e-12
"""Relative uncertainty that is rounding and not worth a word."""


def parts(data: Any, full: bool = True, point: Mapping[str, Value] | None = None) -> Iterator[Part]:
    """Everything the report says, in order. Raises DrawError if there is no such point.

    point: the sweep point whose tables to show;  full: the tables of every point where none is named, else of a sweep
           the orders alone
    """
    yield Heading(f"Convergence: {data.attrs['title']}", 1)
    yield f"Reference: {data.attrs['reference']}."
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
    if names := _shown(at):
        yield _errors(at, names, str(at.attrs["reference"]).split(" (")[0])
    if measures := [m for m in NUMBERS if f"value_{m.name}" in at and np.isfinite(at[f"value_{m.name}"]).any()]:
        yield _numbers(at, measures)


def verdict(data: Any) -> tuple[str, str, bool]:
    """How many orders are as expected, how that is known, and whether all is well."""
    found = [(m.symbol, VERDICTS[int(v)]) for m in ERRORS if shown(data, m.name)
             for v in by_point(data[f"verdict_{m.name}"], data)]  # fmt: skip
    solved = bool(np.all(data["status"].values == int(PointStatus.OK)))
    lack = next((text for text in str(data.attrs["notes"]).split("\n") if text.startswith("No errors")), None)
    told = lack if lack and not found else f"{sentences.orders(found, solved)}."
    return told, "", solved and all(verdict != "slower" for _, verdict in found)


def shown(at: Any, name: str) -> bool:
    """Whether the point has this error on some level."""
    return f"error_{name}" in at and bool(np.isfinite(at[f"error_{name}"]).any())


def _shown(at: Any) -> list[str]:
    return [name for *_, group in GROUPS for name in group if shown(at, name)]


def _overview(data: Any, points: Sequence[dict[str, int]]) -> Iterator[Part]:
    """The orders of all points in one table, below the order expected of each error."""
    names, swept = _shown(data), _swept(data)
    if not names:
        yield "There is no reference, and so no errors; what the numbers tend to: -v."
        return
    spans = [np.unique(np.round(data[f"expected_{name}"].values, 2)) for name in names]
    spans = [span[np.isfinite(span)] for span in spans]  # a point without a mesh has none
    expected = ["…".join(dict.fromkeys(map(_fixed, span[[0, -1]]))) if len(span) else "–" for span in spans]
    rows = [("expected", *("" for _ in swept[1:]), *expected)]
    for where in points:
        at, cells = data.isel(where), [texts[where[str(data[name].dims[0])]] for name, texts, _ in swept]
        whole = bool((at["status"] == int(PointStatus.OK)).all())
        for name in names:
            verdict, slope = VERDICTS[int(at[f"verdict_{name}"])], float(at[f"slope_{name}"])
            text = MARKS["exact"] if verdict == "exact" else _fixed(slope) + MARKS.get(verdict, "")
            cells.append(text if whole else f"({text})")
        rows.append(tuple(cells))
    header = (*(headed(name, unit) for name, _, unit in swept), *(SYMBOLS[name] for name in names))
    ranks = (*(0 for _ in swept), *(RANKS.get(name, 9) for name in names))
    yield Table("Orders of convergence", header, tuple(rows), ranks=ranks)
    yield OVERVIEW


def _swept(data: Any) -> list[tuple[str, list[str], str]]:
    """(name, labels, unit) of the swept parameters."""
    return [(name, *axis_labels(data, name)) for name in axis_names(data)]


def _levels(data: Any) -> Table:
    """The levels; of a sweep over geometries those of each, beside what makes it."""
    size, unit = prefix(data["h_max"].values, data["h_max"].attrs["units"])
    dims = [str(dim) for dim in data["h_max"].dims if dim != "level"]
    swept = [one for one in _swept(data) if str(data[one[0]].dims[0]) in dims]
    rows = []
    for place in np.ndindex(*(data.sizes[dim] for dim in dims)):
        where = dict(zip(dims, place, strict=True))
        own = [texts[where[str(data[name].dims[0])]] for name, texts, _ in swept]
        h, dofs, contact = (data[name].isel(where).values for name in ("h_max", "n_dof", "n_contact"))
        for i in range(len(h)) if np.isfinite(h).all() else ():
            rows.append((*own, str(i), number(h[i] / size), str(int(dofs[i])), str(int(contact[i]))))
    header = (*(headed(name, unit) for name, _, unit in swept), "level", headed("h_max", unit))
    return Table("Meshes", (*header, "dofs", "contact unknowns"), tuple(rows))


def _errors(at: Any, names: Sequence[str], reference: str) -> Table:
    """A row for each error: its values by level with their rates, and the fitted beside the expected order."""
    levels = np.flatnonzero(at["compared"].values)
    ok = at["status"].values == int(PointStatus.OK)
    header = ["error", *(word for i in levels for word in (f"level {i}", "rate"))]
    header += ["order", "levels", "expected", "verdict", "reason of the expected order"]
    rows = []
    for name in names:
        error, rate = at[f"error_{name}"].values, at[f"rate_{name}"].values
        row = [SYMBOLS[name]]
        for i in levels:
            text = f"{error[i]:.3e}" if np.isfinite(error[i]) else "–"
            row += [text if ok[i] else f"({text})", _fixed(rate[i])]
        slope, verdict = float(at[f"slope_{name}"]), VERDICTS[int(at[f"verdict_{name}"])]
        fitted = f"{int(at[f'first_level_{name}'])}–{np.flatnonzero(np.isfinite(error))[-1]}"
        word = sentences.VERDICTS[verdict]
        row += [sentences.order(slope, float(at[f"slope_error_{name}"]), 3), fitted if np.isfinite(slope) else "–"]
        row += [
            _fixed(float(at[f"expected_{name}"])),
            word.upper() if verdict in ("slower", "pre_asymptotic") else word,
        ]
        rows.append((*row, str(at[f"reason_{name}"].item())))
        for beside in (one for one in BY_ITSELF if one.split("_", 1)[1] == name and one in at):
            values = (f"{value:.3e}" if np.isfinite(value) else "–" for value in at[beside].values[levels])
            rows.append((f"  {beside.split('_')[0]}", *(cell for text in values for cell in (text, "–")), *("–",) * 5))
    k = len(levels)
    pairs = [(2 * (k - i) + 4, 2 * (k - i) + 3) if i < k - 2 else (0, 3) for i in range(k)]  # coarse ones go first
    ranks = [0, *(rank for pair in pairs for rank in pair), 0, 98, 2, 1, 99]
    kept = [j for j, column in enumerate(zip(*rows, strict=True)) if set(column) != {"–"}]  # no rate on the first
    cells = tuple(tuple(row[j] for j in kept) for row in rows)
    title = f"Relative errors; reference: {reference}"
    return Table(title, tuple(header[j] for j in kept), cells, ranks=tuple(ranks[j] for j in kept))


def _numbers(at: Any, measures: Sequence[Measure]) -> Table:
    """A row for each number: by level, extrapolated to h = 0; the heat balance tends to nothing and has two digits."""
    ok = at["status"].values == int(PointStatus.OK)
    rows = []
    for m in measures:
        divisor, unit = prefix(at[f"value_{m.name}"].values, at[f"value_{m.name}"].attrs["units"])
        tends = m.name != "heat_balance"
        values = [number(value / divisor, 7 if tends else 2) for value in at[f"value_{m.name}"].values]
        row = [
            headed(m.symbol, unit),
            *(value if good else f"({value})" for value, good in zip(values, ok, strict=True)),
        ]
        if tends:
            limit, unsure, known = (float(at[f"{p}_{m.name}"]) / divisor for p in ("limit", "uncertainty", "exact"))
            row += [_uncertain(limit, unsure), _fixed(float(at[f"limit_order_{m.name}"])), number(known, 7)]
        rows.append(tuple(row) if tends else (*row, "–", "–", "–"))
    levels = len(ok)
    header = ("number", *(f"level {i}" for i in range(levels)), "h → 0", "order", "exact")
    ranks = (0, *(levels - i if i < levels - 1 else 0 for i in range(levels)), 0, 1, 0)
    last = None if any(row[-1] != "–" for row in rows) else -1
    cells = tuple(row[:last] for row in rows)
    return Table("Numbers, extrapolated by Richardson's rule", header[:last], cells, ranks=ranks[:last])


def _uncertain(value: float, uncertainty: float) -> str:
    """A value with as many digits as its uncertainty lets stand."""
    if not np.isfinite(value):
        return "–"
    if not uncertainty > STEADY * abs(value):
        return number(value, 7)
    if abs(value) <= STEADY * uncertainty:  # rounding of zero
        return f"0 ± {uncertainty:.2g}"
    decimals = 1 - int(np.floor(np.log10(uncertainty)))
    if decimals >= 0 and 1e-3 <= abs(value) < 1e7:
        spread = f"{uncertainty:.{decimals}f}" if decimals <= 5 else f"{uncertainty:.2g}"
        return f"{value:z.{decimals}f} ± {spread}"
    digits = int(np.clip(np.ceil(np.log10(max(abs(value), uncertainty) / uncertainty)) + 2, 2, 10))
    return f"{value:.{digits}g} ± {uncertainty:.2g}"


def _fixed(value: float) -> str:
    return f"{value:z.2f}" if np.isfinite(value) else "–"
