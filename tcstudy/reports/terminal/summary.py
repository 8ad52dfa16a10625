"""What the terminal says of any result file; of a run one table of levels, one of the finest level's points.

What a study that names several solvers says of them: one row per solver over all points and levels.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from tcstudy.data.files import Seal, seal_of
from tcstudy.data.provenance import kind_of
from tcstudy.data.reading import GEOMETRIES, asked, axis_names, by_point, load_root, of_largest, open_root, sweep_dims
from tcstudy.data.schema import DIFFERENTIABLE, LIMITED, OF_POLYGON, UNBALANCED, PointStatus
from tcstudy.reports.select_point import Value, axis_labels, describe, matching
from tcstudy.reports.sentences import equilibria, locks, of_the_body
from tcstudy.reports.terminal import convergence, cost, fit, history_summary, path_summary
from tcstudy.reports.terminal.tables import (
    WIDE,
    TextColumn,
    columns_table,
    fits,
    plain_table,
    render,
    split_table,
    wrapped,
)
from tcstudy.reports.text import PROOFS, Failure, counted, digits_lost, failure_lines, headed, number, prefix, proved
from tcstudy.reports.verdict import verdict as run_verdict

NOT_SAID = ("start_energy", "start_used", "iterations", "evaluations", "omega", "uniqueness_margin")
"""Variables of which a summary says nothing: of a long sweep they need not be in memory."""
MOST_ROWS = 48
"""Points shown; the file has them all."""


SIZES = "h_max: longest edge; mesh.maxh is what the mesher aims at, its longest edges come to 1.2 to 1.6 times that"
"""Measured on all uniform meshes in configs/ and eight more."""


def text_of(file: Path, full: bool = False, point: Mapping[str, Value] | None = None, of: str | None = None) -> str:
    """Its sentences and tables, from the file alone. Raises StoreError.

    full:  all rows, steps and tables
    point: labels of the points of a run to list, or of that of a convergence to show
    of:    of a design, the number whose indices to show
    """
    kind = kind_of(file)
    if kind != "run":
        data = load_root(file)
        heading, *rest = KINDS[kind].parts(data, full, point)
        text, how, _ = verdict_of(data, kind, file)
        first = [] if kind == "cost" else [f"{text} {how[:1].upper()}{how[1:]}{'.' * bool(how)}".rstrip()]
        return render([heading, *first, *rest])
    text = summary(file, None if full else MOST_ROWS, point)
    if of:
        from tcstudy.reports.terminal.indices import indices_text

        text += f"\n\n{indices_text(file, of)}"
    return text


def verdict_of(data: Any, kind: str, path: Path) -> tuple[str, str, bool]:
    """The sentence of a file of any kind, how what it says is known, and whether all is well.

    data: its root dataset, which that of a run needs not; None where it is not read yet
    """
    if kind == "run":
        return run_verdict(path)
    found: tuple[str, str, bool] = KINDS[kind].verdict(load_root(path) if data is None else data)
    return found


KINDS = {"convergence": convergence, "cost": cost, "path": path_summary, "history": history_summary, "fit": fit}
"""What says `verdict` and `parts` of a file of another kind than a run."""


def summary(path: Path, most: int | None = MOST_ROWS, point: Mapping[str, Value] | None = None) -> str:
    """Text for the terminal, read from the result file alone. Raises StoreError if it is not one, DrawError.

    most: points that are listed, None for all;  point: labels that these have
    """
    with open_root(path) as root:
        data = of_largest(root.drop_vars(NOT_SAID, errors="ignore").load())
    several = f"  {data.attrs.get(GEOMETRIES)} geometries: the largest h_max, dofs and contact, the least λ₁"
    stopped = f"  stopped: {data['stop'].values[-1]}" if "stop" in data and data["stop"].values[-1] else ""
    told, *_ = run_verdict(path)
    parts = [
        data.attrs["title"],
        f"  {told}",
        _levels(data),
        several if GEOMETRIES in data.attrs else "",
        stopped,
        _points(data, most, point or {}),
        solver_table(data),
    ]
    parts += [f"  {line}" for line in _said(data)]
    return wrapped("\n\n".join(part for part in parts if part))


def _levels(data: Any) -> str:
    """One row per mesh level: size, outcome, worst residual, where the time went."""
    dims, total = sweep_dims(data), data["status"].isel(level=0).size
    ok = (data["status"] == int(PointStatus.OK)).sum(dims).values

    def column(title: str, values: Any, rank: int, units: str = "1", digits: int = 2, size: Any = None) -> TextColumn:
        divisor, unit = prefix(values if size is None else size, units)
        return TextColumn(headed(title, unit), [number(value / divisor, digits) for value in values.values], rank)

    columns = [
        TextColumn("level", [str(int(level)) for level in data["level"].values]),
        column("h_max", data["h_max"], 2, data["h_max"].attrs["units"], 4),
        TextColumn("dofs", [str(int(n)) for n in data["n_dof"].values], 1),
        TextColumn("contact", [str(int(n)) for n in data["n_contact"].values], 7),
        TextColumn("ok", [f"{int(n)}/{total}" for n in ok]),
        column("worst residual", data["inclusion_residual"].max(dims), 0),
        column("λ₁", data["lambda_1"].min(dims), 6, data["lambda_1"].attrs["units"], 4),
        column("mesh+assembly [s]", data["time_mesh"] + data["time_assemble"], 9),
        column("condense [s]", data["time_condense"].sum(dims), 10),
        column("solve [s]", data["time_solve"].sum(dims), 8),
    ]
    for rank, (name, title) in enumerate(((n, t) for n, t in _ESTIMATED if n in data), 1):
        units = data[name].attrs.get("units", "1")
        columns.append(column(title, data[name].max(dims), rank, units, size=data[name].values))
    return f"{columns_table(columns)}\n\n  {SIZES}"


_ESTIMATED = (
    ("error_estimate", "est. rel. error"),
    ("error_bound_relative", "bound of it"),
    ("goal_estimate", "est. error of goal"),
    ("goal_error", "its true error"),
    ("goal_effectivity", "est./true"),
)
"""Columns of the table of levels where errors are estimated: the largest of all points."""


_COLUMNS = (
    ("u_T_max", "max |u_T|", 0),
    ("slip_length", "slip length", 3),
    ("debonded_length", "debonded", 3),
    ("softening_length", "softening", 4),
    ("yielded_length", "yielded", 5),
    ("elastic_length", "elastic", 7),
    ("shear_max", "max |ξ|", 8),
    ("friction_resultant", "∫ξ", 2),
    ("energy", "energy", 5),
    ("theta_mean", "mean θ", 6),
)
"""Numbers of a point, their titles, and their importance where there is no room for all."""


CERTIFIED = "certified: what is proved of the solution on its mesh (unique, global or local minimum of the energy)"
EVERY_LEGEND = (
    'proved to be all, but "at least" where a limit was met or rounding leaves some open',
    'proved to be all, but "at least" where not; of exponential laws those of their polygon, within 1e-3 of b',
)
"""Without and with exponential laws."""


def _points(data: Any, most: int | None, point: Mapping[str, Value]) -> str:
    """One row per point on the finest level, with what changed in ∫ξ since the level before."""
    dims, fine = sweep_dims(data), data.isel(level=-1)
    own = np.flatnonzero(matching(data, point)) if point else np.arange(fine["status"].size)
    shown = own[:most]
    n, sizes = len(shown), [data.sizes[d] for d in dims]
    place = dict(zip(dims, np.unravel_index(shown, sizes), strict=True)) if dims else {}
    near = data.isel({dim: slice(int(index.max()) + 1) for dim, index in place.items()})

    def first(name: str, level: int = -1) -> Any:
        return by_point(data[name].isel(level=level), data)[shown]

    status = first("status")
    solved, run = status == PointStatus.OK, status != PointStatus.NOT_RUN
    columns, scales = [], {}
    for axis in axis_names(data):
        texts, unit = axis_labels(near, axis)
        columns.append(TextColumn(headed(axis, unit), [texts[i] for i in place[str(data[axis].dims[0])]]))
    labels = len(columns)
    usual = [one for one in _COLUMNS if one[0] in fine and np.isfinite(fine[one[0]].values).any()]
    # a reaction is the force of a held edge: once is enough
    more = [n for n in asked(data) if not (n.startswith("reaction_") and n.replace("reaction_", "force_", 1) in fine)]
    for name, title, rank in (*usual, *((name, name, 0) for name in more)):
        divisor, unit = scales[name] = prefix(fine[name].values, fine[name].attrs["units"])
        cells = [number(value / divisor) for value in first(name)]
        cells = [c if good or c == "–" else f"({c})" for c, good in zip(cells, solved, strict=True)]
        columns.append(TextColumn(headed(title, unit), cells, rank))
    columns, wanted = columns[: labels + len(usual)], columns[labels + len(usual) :]
    rest, legend = [], [CERTIFIED]
    if "solutions" in fine:
        told = zip(*(first(name).tolist() for name in ("solutions", "stable_solutions", "complete")), strict=True)
        words = [equilibria(*one) if good else "–" for one, good in zip(told, solved, strict=True)]
        rest.append(TextColumn("equilibria", words, 1))
        legend.append(f"equilibria: {EVERY_LEGEND[bool((fine['complete'] == OF_POLYGON).any())]}")
    flags = {name: first(name) for name, _ in PROOFS}
    proofs = [proved({name: flag[i] for name, flag in flags.items()}) for i in range(n)]
    proofs = [proofs[i] if solved[i] else "failed" if run[i] else "not run" for i in range(n)]
    rest.append(TextColumn("certified", proofs, 1))
    if data.sizes["level"] > 1:
        divisor, unit = scales.get("friction_resultant", (1.0, "1"))
        change = np.abs(first("friction_resultant") - first("friction_resultant", -2)) / divisor
        cells = [number(value, 2) if good else "–" for value, good in zip(change, solved, strict=True)]
        rest.append(TextColumn(headed("Δ∫ξ to last level", unit), cells, 4))
    lengths = [name for name in scales if name.endswith("_length")]
    if "slip_length" not in scales:
        legend.append("no slip length: b sticks nowhere, so that every slip is not 0")
    if any(np.isnan(first(name)[solved]).any() for name in lengths):
        legend.append("–: of a law without such a part (slip length: that sticks nowhere)")
    if len(lengths) > 1:
        legend.append(
            "debonded, softening, yielded, elastic: lengths where b has fallen, falls, does neither, rises from 0"
        )
    if np.any(run & ~solved):
        legend.append("failed: no solution; the numbers in (parentheses) are those of the last step")
    parts = [
        f"  Level {int(fine['level'])}, the finest:" + (f" first {n} of {len(own)} points" if n < len(own) else "")
    ]
    if wanted and not fits([*columns, *wanted, *rest], WIDE):
        parts += [columns_table([*columns, *rest]), "  Asked for by output:"]
        parts += [split_table([*columns[:labels], *wanted], labels)]
    else:
        parts += [columns_table([*columns, *wanted, *rest])]
    return "\n\n".join([*parts, "\n".join(f"  {line}" for line in legend)])


def _said(data: Any) -> Iterator[str]:
    """What failed, was not run, or holds only as far as rounding lets it; what is proved of the body itself."""
    status, total = data["status"].values, data["status"].size
    failed = [tuple(place) for place in np.argwhere((status != PointStatus.OK) & (status != PointStatus.NOT_RUN))]
    reasons = data["reason"].values if failed else {}
    yield from failure_lines(Failure(PointStatus(int(status[p])), str(reasons[p]), _point(data, p)) for p in failed)
    if "sensitivity_status" in data:
        known = np.count_nonzero(data["sensitivity_status"].isel(level=-1).values == DIFFERENTIABLE)
        of = data["status"].isel(level=-1).size
        yield f"derivatives known at {known} of {of} points of the finest level, NaN at events and folds: sensitivity_…"
    if len(places := np.argwhere(status == PointStatus.NOT_RUN)):
        yield f"not run: {len(places)} of {total} places of the grid (for example {_point(data, places[0])})"
    if len(places := np.argwhere(data["inclusion_status"].values == LIMITED)):
        residuals, allowed = (data[f"inclusion_{name}"].values for name in ("residual", "rounding"))
        worst = max(map(tuple, places), key=lambda place: float(residuals[place]))
        yield (
            f"limited by rounding: {len(places)} of {total} solutions hold to {number(residuals[worst], 2)} of the "
            f"scale of b or better, where rounding alone allows {number(allowed[worst], 2)}; friction is small against "
            f"the forces in the body (worst at {_point(data, worst)})"
        )
    if "lambda_1_error" in data and (lost := digits_lost(float(data["lambda_1_error"].max()))):
        yield lost
    if "lambda_1_low" in data:
        fine = data.isel(level=-1)
        low, high, dual, mesh = (fine[f"lambda_1{name}"].values.ravel() for name in ("_low", "_high", "_dual", ""))
        unique, units = fine["proved_unique"].values.ravel() == 1, data["lambda_1_low"].attrs["units"]
        yield from filter(None, (of_the_body(low, high, unique, units), locks(mesh, dual)))
    if len(places := np.argwhere(data["heat_status"].values == UNBALANCED)):
        defects = data["heat_balance"].values[tuple(places.T)]
        span = dict.fromkeys((number(defects.min(), 2), number(defects.max(), 2)))
        example = "for example " if len(places) > 1 else ""
        yield (
            f"heat balance {' to '.join(span)} at {counted(len(places), 'point')}: as thin triangles cost the "
            "temperature its digits, remove slits and slivers of the body or refine towards them "
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

    def by_solver(name: str) -> Any:
        values = data[f"solver_{name}"].transpose("solver", ...).values.astype(float)
        return values.reshape(values.shape[0], -1)

    energy = by_solver("energy")
    known = np.isfinite(energy).any(axis=0)
    lowest = np.min(np.where(np.isfinite(energy), energy, np.inf), axis=0)
    least = energy <= lowest + SAME * np.max(np.abs(np.nan_to_num(energy)), axis=0)
    names, rows = [str(name) for name in data["solver"].values], []
    columns = [by_solver(what) for what in ("residual", "iterations", "time", "difference")]
    for i, name in enumerate(names):
        residual, steps, time, apart = (column[i][known] for column in columns)
        largest = [float(np.nanmax(one)) if np.isfinite(one).any() else np.nan for one in (residual, apart)]
        counted_steps, share = f"{steps[steps > 0].sum():.0f}", f"{np.count_nonzero(least[i][known])}/{known.sum()}"
        apart_most = number(largest[1], 2) if i else "–"
        rows.append([name, number(largest[0], 2), counted_steps, number(np.nansum(time), 2), share, apart_most])
    header = ["solver", "worst residual", "steps", "solve [s]", "lowest found", "largest difference of u_T"]
    legend = f"  Solvers compared on all points and levels; the solutions stored are those of {names[0]}:"
    return legend + "\n\n" + plain_table(header, rows)


def other_text(path: Path) -> str:
    """What xarray says of a file that holds no study; empty where it holds one, or nothing can be read."""
    import xarray

    if not path.is_file() or seal_of(path) != Seal.NONE:  # a damaged file of ours may crash the library
        return ""
    try:
        with xarray.open_dataset(path, engine="netcdf4") as data:
            told = f"{path}: no results of a study, so there is no summary of it; what it has:\n\n{data}"
            return "" if "study_yaml" in data.attrs or not data.variables else told
    except (OSError, RuntimeError, ValueError):
        return ""
