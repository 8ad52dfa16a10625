"""The terminal's summary of a result file: one table of levels, one of the finest level's points.

What a study that names several solvers says of them: one row per solver over all points and levels. What a netCDF file
is that holds no study, such as those of the benchmarks: its title, maker and variables.
"""

from __future__ import annotations

import textwrap
from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np

from tcstudy.data.reading import GEOMETRIES, Unreadable, asked, axis_names, of_largest, probe, sweep_dims
from tcstudy.data.records import PointStatus
from tcstudy.data.schema import LIMITED, OF_POLYGON, UNBALANCED
from tcstudy.data.store import open_results
from tcstudy.reports.select_point import axis_labels, describe
from tcstudy.reports.sentences import equilibria, locks, of_the_body
from tcstudy.reports.terminal.tables import fits, plain_table, split_table, wrapped
from tcstudy.reports.text import Failure, counted, digits_lost, failure_lines, headed, number, prefix, proved

NOT_SAID = ("start_energy", "start_used", "iterations", "evaluations", "omega", "uniqueness_margin")
"""Variables of which a summary says nothing: of a long sweep they need not be in memory."""
MOST_ROWS = 48
"""Points shown; the file has them all."""


SIZES = "h_max: longest edge; mesh.maxh is what the mesher aims at, its longest edges come to 1.2 to 1.6 times that"
"""Measured on all uniform meshes in configs/ and eight more."""


def summary(path: Path, most: int | None = MOST_ROWS) -> str:
    """Text for the terminal, read from the result file alone. Raises StoreError if it is not one.

    most: points that are listed, None for all
    """
    with open_results(path) as tree:
        data = tree.to_dataset().drop_vars(NOT_SAID, errors="ignore").load()
    extremes, data = _extremes(data), of_largest(data)
    stopped = f"  stopped: {data['stop'].values[-1]}" if "stop" in data and data["stop"].values[-1] else ""
    parts = [
        data.attrs["title"],
        _levels(data),
        extremes,
        stopped,
        _points(data, most),
        solver_table(data),
        _failures(data),
    ]
    parts += [_derivatives(data), _not_run(data), _rounding(data), _stiff(data), *_guaranteed(data), _heat(data)]
    return wrapped("\n\n".join(part for part in parts if part))


def _levels(data: Any) -> str:
    """One row per mesh level: size, outcome, worst residual, where the time went."""
    dims = sweep_dims(data)
    ok = (data["status"] == int(PointStatus.OK)).sum(dims)
    total = int(np.prod([data.sizes[d] for d in dims], dtype=int))
    rows = []
    lambda_1 = data["lambda_1"].min(dims)
    stiffness, stiffness_unit = prefix(lambda_1.values.tolist(), data["lambda_1"].attrs["units"])
    size, unit = prefix(data["h_max"].values.tolist(), data["h_max"].attrs["units"])
    estimated = [
        (name, title, *prefix(data[name].values, data[name].attrs.get("units", "1")))
        for name, title in _ESTIMATED
        if name in data
    ]
    for i in range(data.sizes["level"]):
        at = data.isel(level=i)
        estimates = [number(at[name].max() / divisor, 2) for name, _, divisor, _ in estimated]
        row = [str(int(at["level"])), number(at["h_max"] / size), str(int(at["n_dof"])), str(int(at["n_contact"]))]
        row += [f"{int(ok[i])}/{total}", number(at["inclusion_residual"].max(), 2), number(lambda_1[i] / stiffness)]
        times = at["time_mesh"] + at["time_assemble"], at["time_condense"].sum(), at["time_solve"].sum()
        rows.append([*row, *(number(time, 2) for time in times), *estimates])
    header = ["level", headed("h_max", unit), "dofs", "contact", "ok", "worst residual"]
    header += [headed("λ₁", stiffness_unit), "mesh+assembly [s]", "condense [s]", "solve [s]"]
    header += [headed(title, unit) for _, title, _, unit in estimated]
    shown = plain_table(header, rows, (*_LEVEL_RANKS, *range(1, len(estimated) + 1)))
    return f"{shown}\n\n  {SIZES}"


_LEVEL_RANKS = (0, 2, 1, 7, 0, 0, 6, 9, 10, 8)
"""Importance of the columns of the table of levels."""

_ESTIMATED = (
    ("error_estimate", "est. rel. error"),
    ("goal_estimate", "est. error of goal"),
    ("goal_error", "its true error"),
    ("goal_effectivity", "est./true"),
)
"""Columns of the table of levels where errors are estimated: the largest of all points."""


_COLUMNS = (
    ("u_T_max", "max |u_T|", 0),
    ("slip_length", "slip length", 3),
    ("friction_resultant", "∫ξ", 2),
    ("energy", "energy", 5),
    ("theta_mean", "mean θ", 6),
)
"""Numbers of a point, their titles, and their importance where there is no room for all."""


EVERY_LEGEND = (
    'proved to be all, but "at least" where a limit was met or rounding leaves some open',
    'proved to be all, but "at least" where not; of exponential laws those of their polygon, within 1e-3 of b',
)
"""Without and with exponential laws."""


def _extremes(data: Any) -> str:
    """Which of several geometries the table of levels means; empty for one."""
    if GEOMETRIES not in data.attrs:
        return ""
    fine = data.isel(level=-1)
    dims = [str(dim) for dim in fine["n_dof"].dims]
    outer = data.drop_vars([name for name in axis_names(data) if str(data[name].dims[0]) not in dims])
    said = []
    for title, name, sign in (("h_max", "h_max", 1.0), ("dofs", "n_dof", 1.0), ("λ₁", "lambda_1", -1.0)):
        values = sign * fine[name].transpose(*dims, ...).values.astype(float)
        if not np.isfinite(values).any():
            return ""
        place = np.unravel_index(int(np.nanargmax(values)), values.shape)
        said.append(f"{title} of {describe(outer, dict(zip(dims, map(int, place), strict=False)))}")
    what = f"{data.attrs[GEOMETRIES]} geometries: the largest h_max, dofs and contact, the least λ₁"
    return f"  {what}; on level {int(fine['level'])} {'; '.join(said)}"


def _points(data: Any, most: int | None) -> str:
    """One row per point on the finest level, with what changed in ∫ξ since the level before."""
    dims = sweep_dims(data)
    shape = tuple(data.sizes[d] for d in dims)
    fine = data.isel(level=-1)
    usual = [one for one in _COLUMNS if np.isfinite(fine[one[0]].values).any()]
    wanted = [(name, name, 0) for name in asked(data)]
    axes = axis_names(data)
    scales = {name: prefix(fine[name].values, fine[name].attrs["units"]) for name, _, _ in (*usual, *wanted)}
    labelled = {axis: axis_labels(data, axis) for axis in axes}
    header = [headed(axis, labelled[axis][1]) for axis in axes]
    header += [headed(title, scales[name][1]) for name, title, _ in (*usual, *wanted)]
    refined = data.sizes["level"] > 1
    size, unit = scales.get("friction_resultant", (1.0, "1"))
    every = "solutions" in fine
    header += ["equilibria"] * every + ["certified", *([headed("Δ∫ξ to last level", unit)] if refined else [])]
    rows, failed = [], False
    for index in islice(np.ndindex(shape), most):
        where = dict(zip(dims, index, strict=True))
        at = fine.isel(where)
        row = [labelled[axis][0][where[str(data[axis].dims[0])]] for axis in axes]
        solved = int(at["status"]) == int(PointStatus.OK)
        failed = failed or not (solved or int(at["status"]) == int(PointStatus.NOT_RUN))
        cells = [number(at[name] / scales[name][0]) for name in scales]
        row += cells if solved else [cell if cell == "–" else f"({cell})" for cell in cells]
        if every:
            told = (int(at[name]) for name in ("solutions", "stable_solutions", "complete"))
            row.append(equilibria(*told) if solved else "–")
        row.append(_certified(at))
        if refined:
            ends = data["friction_resultant"].isel(where).values[-2:]
            row.append(number(abs(ends[1] - ends[0]) / size, 2) if solved else "–")
        rows.append(row)
    level = int(fine["level"])
    more = int(np.prod(shape)) - len(rows)
    title = f"  Level {level}, the finest:" + (f" first {len(rows)} of {len(rows) + more} points" if more > 0 else "")
    legend = "  certified: what is proved of the solution on its mesh (unique, global or local minimum of the energy)"
    if every:
        legend += f"\n  equilibria: {EVERY_LEGEND[bool((fine['complete'] == OF_POLYGON).any())]}"
    if failed:
        legend += "\n  failed: no solution; the numbers in (parentheses) are those of the last step"
    ranks, below = (*(0 for _ in axes), *(rank for _, _, rank in usual), *[1] * every, 1, 4), ""
    if wanted and not fits(header, rows):
        first, last = len(axes) + len(usual), len(axes) + len(scales)
        own = [[*row[: len(axes)], *row[first:last]] for row in (header, *rows)]
        header, *rows = ([*row[:first], *row[last:]] for row in (header, *rows))
        below = "\n\n  Asked for by output:\n\n" + split_table(own[0], own[1:], len(axes))
    else:
        ranks = (*ranks[: -2 - every], *(0 for _ in wanted), *ranks[-2 - every :])
    return title + "\n\n" + plain_table(header, rows, ranks) + below + "\n\n" + legend


def _certified(at: Any) -> str:
    """The strongest statement that is proved of a solution; "failed" or "not run" where there is none."""
    if (status := PointStatus(int(at["status"]))) != PointStatus.OK:
        return "not run" if status == PointStatus.NOT_RUN else "failed"
    return proved(at)


def _derivatives(data: Any) -> str:
    """The derivatives of the first point on the finest level that has them; the file has those of all."""
    if "sensitivity_status" not in data:
        return ""
    from tcstudy.data.on_request import DIFFERENTIABLE, QUANTITIES, STATUS

    fine = data.isel(level=-1)
    places = np.argwhere(fine[STATUS].values == DIFFERENTIABLE)
    known = f"known at {len(places)} of {fine[STATUS].size} points of the finest level, NaN at events and folds"
    title = f"  Derivatives at the solution ({known})"
    if not len(places):
        return f"{title}."
    at = fine.isel(dict(zip(fine[STATUS].dims, (int(i) for i in places[0]), strict=True)))
    first = f"sensitivity_{next(iter(QUANTITIES))}_"
    numbers = [str(name).removeprefix(first) for name in data if str(name).startswith(first)]
    shown = [(quantity, title) for quantity, title, _ in _COLUMNS if quantity in QUANTITIES]
    rows = []
    for one in numbers:
        found = [at[f"sensitivity_{quantity}_{one}"] for quantity, _ in shown]
        rows.append([one, *(f"{number(value)} {value.attrs['units']}".removesuffix(" 1") for value in found)])
    where = _point(data, [*places[0], data.sizes["level"] - 1])
    return f"{title}; at {where}:\n\n" + plain_table(["by", *(name for _, name in shown)], rows)


def _failures(data: Any) -> str:
    """One line for each kind of failure."""
    status, reason = data["status"], data["reason"].values
    places = np.argwhere((status.values != PointStatus.OK) & (status.values != PointStatus.NOT_RUN))
    failed = [(PointStatus(int(status.values[tuple(p)])), str(reason[tuple(p)]), _point(data, p)) for p in places]
    return "\n".join(f"  {line}" for line in failure_lines(Failure(*one) for one in failed))


def _not_run(data: Any) -> str:
    """Points that the grid of a file has, but that no run was asked for."""
    places = np.argwhere(data["status"].values == PointStatus.NOT_RUN)
    if not len(places):
        return ""
    return (
        f"  not run: {len(places)} of {data['status'].size} places of the grid (for example {_point(data, places[0])})"
    )


def _rounding(data: Any) -> str:
    """Where the inclusion holds only as far as rounding allows."""
    places = np.argwhere(data["inclusion_status"].values == LIMITED)
    if not len(places):
        return ""
    worst = max(places, key=lambda place: float(data["inclusion_residual"].values[tuple(place)]))
    residual, allowed = (data[f"inclusion_{name}"].values[tuple(worst)] for name in ("residual", "rounding"))
    return (
        f"  limited by rounding: {len(places)} of {data['status'].size} solutions hold to {number(residual, 2)} of the "
        f"scale of b or better, where rounding alone allows {number(allowed, 2)}; friction is small against the forces "
        f"in the body (worst at {_point(data, worst)})"
    )


def _stiff(data: Any) -> str:
    """Where λ₁ has lost digits."""
    error = data["lambda_1_error"].max() if "lambda_1_error" in data else 0.0
    return f"  {lost}" if (lost := digits_lost(float(error))) else ""


def _guaranteed(data: Any) -> list[str]:
    """What is proved of the body itself, on the finest level."""
    if "lambda_1_low" not in data:
        return []
    fine = data.isel(level=-1)
    low, high, dual, mesh = (fine[f"lambda_1{name}"].values.ravel() for name in ("_low", "_high", "_dual", ""))
    proved_here = fine["proved_unique"].values.ravel() == 1
    said = of_the_body(low, high, proved_here, data["lambda_1_low"].attrs["units"]), locks(mesh, dual)
    return [f"  {words}" if words else "" for words in said]


def _heat(data: Any) -> str:
    """Where heat is lost in rounding although the inclusion holds."""
    places = np.argwhere(data["heat_status"].values == UNBALANCED)
    if not len(places):
        return ""
    defects = [float(data["heat_balance"].values[tuple(place)]) for place in places]
    low, high = number(min(defects), 2), number(max(defects), 2)
    count, example = counted(len(places), "point"), "for example " if len(places) > 1 else ""
    return (
        f"  heat balance {low if low == high else f'{low} to {high}'} at {count}: as thin triangles cost the "
        f"temperature its digits, remove slits and slivers of the body or refine towards them "
        f"({example}{_point(data, places[0])})"
    )


def _point(data: Any, place: Any) -> str:
    """The labels of a point and its level in words; place: index along every dimension of the status."""
    where = dict(zip(data["status"].dims, (int(i) for i in place), strict=True))
    level = f"level {int(data['level'][where.pop('level')])}"
    name = describe(data, where)
    return f"{name} on {level}" if name else level


SAME = 1e-9
"""Difference of energies, relative to the largest of a point, that is rounding."""


def solver_table(data: Any) -> str:
    """Solvers compared where a run kept them side by side; empty where it used one."""
    if "solver" not in data.dims:
        return ""
    energy = _by_solver(data, "solver_energy")
    known = np.isfinite(energy).any(axis=0)
    lowest = np.min(np.where(np.isfinite(energy), energy, np.inf), axis=0)
    slack = SAME * np.max(np.abs(np.nan_to_num(energy)), axis=0)
    names = [str(name) for name in data["solver"].values]
    columns = [_by_solver(data, f"solver_{what}") for what in ("residual", "iterations", "time", "difference")]
    rows = []
    for i, name in enumerate(names):
        residual, steps, time, apart = (column[i][known] for column in columns)
        least = int(np.count_nonzero((energy[i] <= lowest + slack)[known]))
        largest = number(_largest(apart), 2) if i else "–"
        rows.append([name, number(_largest(residual), 2), f"{steps[steps > 0].sum():.0f}", number(np.nansum(time), 2),
                     f"{least}/{int(known.sum())}", largest])  # fmt: skip
    header = ["solver", "worst residual", "steps", "solve [s]", "lowest found", "largest difference of u_T"]
    legend = f"  Solvers compared on all points and levels; the solutions stored are those of {names[0]}:"
    return legend + "\n\n" + plain_table(header, rows)


def _by_solver(data: Any, name: str) -> Any:
    """(solver, point and level) values of a variable."""
    values = data[name].transpose("solver", ...).values.astype(float)
    return values.reshape(values.shape[0], -1)


def _largest(values: Any) -> float:
    return float(np.nanmax(values)) if np.isfinite(values).any() else float("nan")


SHOWN = 200
"""Characters of an attribute that are shown."""
WIDEST = 48
"""Characters of a meaning."""
BENCHMARKS = "tests.benchmarks"


def other_text(path: Path) -> str:
    """What the file is; empty where it holds a study, whole or not, and where nothing can be read."""
    import netCDF4

    try:
        told = {name: str(value) for name, value in probe(path).items()}
        with netCDF4.Dataset(path) as nc:  # all of it was read by the probe
            if "study_yaml" in told or not nc.variables:
                return ""
            rows = [_row(name, variable) for name, variable in nc.variables.items()]
    except (Unreadable, OSError):
        return ""
    maker = told.pop("source", "")
    benchmark = "data of a benchmark" if BENCHMARKS in maker else "a data file that tcstudy did not write as results"
    lines = [told.pop("title", path.name), "", f"  {benchmark}; no results of a study, so there is no summary of it"]
    lines += [f"  made by {maker}"] * bool(maker)
    lines += [f"  {name}: {value[:SHOWN]}{'…' * (len(value) > SHOWN)}" for name, value in told.items()]
    table = plain_table(("variable", "dimensions", "unit", "meaning"), rows, (0, 1, 3, 2))
    return wrapped("\n".join([*lines, "", table]))


def _row(name: str, variable: object) -> tuple[str, str, str, str]:
    sizes = zip(variable.dimensions, variable.shape, strict=True)  # type: ignore[attr-defined]
    units, meaning = (str(getattr(variable, key, "")) for key in ("units", "long_name"))
    dims = ", ".join(f"{dim} {size}" for dim, size in sizes)
    return name, dims, units, textwrap.shorten(meaning, WIDEST, placeholder=" …")
