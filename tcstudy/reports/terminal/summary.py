"""What the terminal says of any result file.

Of a run one table of levels, one of the finest level's points, and a row for each of several
solvers.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from tcstudy.data.files import kind_of
from tcstudy.data.reading import (
    GEOMETRIES,
    asked,
    axis_names,
    by_point,
    load_table,
    of_largest,
    opened,
    sweep_dims,
)
from tcstudy.data.schema import DIFFERENTIABLE, LIMITED, UNBALANCED, PointStatus
from tcstudy.reports import sentences
from tcstudy.reports.rounding import floors_of
from tcstudy.reports.select_point import Value, axis_labels, axis_symbol, describe, matching
from tcstudy.reports.terminal import accuracy, fit, paths
from tcstudy.reports.text import (
    PROOFS,
    Heading,
    Part,
    Table,
    TextColumn,
    Verdict,
    counted,
    digits_lost,
    failure_lines,
    fits,
    headed,
    number,
    proved,
    quantity,
    render,
)

NOT_SAID = ("start_energy", "start_used", "iterations", "evaluations", "uniqueness_margin")
"""Variables of which a summary says nothing: of a long sweep they need not be in memory."""
MOST_ROWS = 48
"""Points shown; the file has them all."""


def text_of(
    file: Path, full: bool = False, point: Mapping[str, Value] | None = None, of: str | None = None
) -> str:
    """Its sentences and tables, from the file alone. Raises StoreError.

    full:  all rows, steps and tables
    point: labels of the points of a run to list, or of that of a convergence to show
    of:    of a design, the number whose indices to show
    """
    kind, verdict = kind_of(file), verdict_of(file)
    data = load_table(file, NOT_SAID if kind == "run" else ())
    heading, *rest = KINDS[kind][1](data, full, point)
    # the labelled lines of costs stand in their parts, which are those of one error
    first = [] if kind == "cost" else [verdict]
    text = render([heading, *first, *rest]).rstrip("\n")
    if of:
        from tcstudy.reports.terminal.indices import indices_text

        text += f"\n\n{indices_text(file, of)}"
    return text


def verdict_of(path: Path) -> Verdict:
    """Return what a file of any kind says first. Raises StoreError.

    A run may have a million points: of it a few variables are read.
    """
    if (kind := kind_of(path)) != "run":
        return KINDS[kind][0](load_table(path))
    with opened(path) as nc:
        return sentences.run_verdict(nc)


def run_parts(
    data: Any, full: bool = False, point: Mapping[str, Value] | None = None
) -> Iterator[Part]:
    """What a run's file holds.

    full: all points are listed;  point: labels that those have which are
    """
    data = of_largest(data)
    yield Heading(data.attrs["title"], 1)
    yield _levels(data)
    if GEOMETRIES in data.attrs:
        yield f"  {data.attrs[GEOMETRIES]} geometries: the largest h_max, dofs and contact, the least λ₁"
    if "stop" in data and data["stop"].values[-1]:
        yield f"  stopped: {data['stop'].values[-1]}"
    yield from _points(data, None if full else MOST_ROWS, point or {})
    yield from solvers_compared(data)
    for line in _said(data):
        yield f"  {line}"


_ESTIMATED = (
    ("error_estimate", "est. rel. error"),
    ("error_bound_relative", "rel. error bound"),
    ("goal_estimate", "est. error of goal"),
    ("goal_error", "its true error"),
    ("goal_effectivity", "est./true"),
)
"""Columns of the table of levels where errors are estimated: the largest of all points."""


def _levels(data: Any) -> Table:
    """One row per mesh level: size, outcome, worst residual, and the seconds that it took."""

    def by_level(name: str) -> Any:
        """Return (P, levels) values of a number of the points."""
        return by_point(data[name], data)

    status = by_level("status")
    total = len(status)
    ok = (status == PointStatus.OK).sum(axis=0)
    worst = np.fmax.reduce(by_level("inclusion_residual"))
    lowest = np.fmin.reduce(by_level("lambda_1"))
    of_points = np.nansum(by_level("time_condense") + by_level("time_solve"), axis=0)
    spent = data["time_mesh"].values + data["time_assemble"].values + of_points
    columns = [
        TextColumn("level", data["level"].values.astype(str)),
        quantity("h_max", data["h_max"].values, data["h_max"].attrs["units"], rank=2),
        TextColumn("dofs", data["n_dof"].values.astype(int).astype(str), 1),
        TextColumn("contact", data["n_contact"].values.astype(int).astype(str), 7),
        TextColumn("ok", [f"{int(n)}/{total}" for n in ok]),
        quantity("worst residual", worst, digits=2),
        quantity("λ₁", lowest, data["lambda_1"].attrs["units"], rank=6),
        quantity("time [s]", spent, digits=2, rank=8),
    ]
    for rank, (name, title) in enumerate(((n, t) for n, t in _ESTIMATED if n in data), 1):
        units = data[name].attrs.get("units", "1")
        largest = np.fmax.reduce(by_level(name))
        columns.append(quantity(title, largest, units, 2, rank, data[name].values))
    return Table("", columns)


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
CERTIFIED = (
    "certified: strongest property proved of the solution on its mesh "
    "(unique, global or local minimum of the energy)"
)
EVERY = (
    'equilibria: proved to be all, but "at least" where not; '
    "of exponential laws those of their polygon, within 1e-3 of b"
)
NO_PART = "–: the law has no such part (slip length: it sticks nowhere)"
FAILED = "failed: no solution; the numbers in (parentheses) are those of the last step"
REGIONS = {
    "debonded_length": "debonded: length where b has fallen",
    "softening_length": "softening: length where b falls",
    "yielded_length": "yielded: length at constant b, beyond sticking or the first rise",
    "elastic_length": "elastic: length where b rises from 0",
}
"""Legends of the columns of lengths."""
FEW_POINTS = 4
"""Points up to which requested numbers have a row each, and the points columns."""


def _points(data: Any, most: int | None, point: Mapping[str, Value]) -> Iterator[Part]:
    """One row per point on the finest level, with what changed in ∫ξ since the level before."""
    rows = _Rows(data, most, point)
    fine = rows.fine
    few = ""
    if len(rows.shown) < rows.chosen:
        few = f" first {len(rows.shown)} of {rows.chosen} points"
    yield f"  Level {int(fine['level'])}, the finest:{few}"
    labels = rows.labels()
    usual = [one for one in _COLUMNS if one[0] in fine and np.isfinite(fine[one[0]].values).any()]
    usual_columns = rows.usual(usual)
    rest = rows.rest()
    requested = _requested(data)
    columns = [rows.column(name, name, rank) for rank, name in enumerate(requested, 1)]
    whole = [*labels, *usual_columns, *columns, *rest]
    if fits(whole):
        yield Table("", whole)
        return
    yield Table("", [*labels, *usual_columns, *rest])
    if not requested:
        return
    yield "  Requested by output:"
    if len(rows.shown) <= FEW_POINTS:
        yield rows.transposed(labels, requested)
    else:
        yield Table("", [*labels, *columns])


def _requested(data: Any) -> list[str]:
    """Return the names of requested numbers; a reaction is the force of a held edge, which is
    enough."""
    names = asked(data)
    forces = {name for name in names if name.startswith("force_")}
    return [name for name in names if name.replace("reaction_", "force_", 1) not in forces - {name}]


class _Rows:
    """The points of a run that a table shows, and their columns on the finest level.

    shown: places of the points in the sweep;  chosen: points that have the labels asked for
    """

    def __init__(self, data: Any, most: int | None, point: Mapping[str, Value]) -> None:
        self.data, self.fine = data, data.isel(level=-1)
        chosen = np.arange(self.fine["status"].size)
        if point:
            chosen = np.flatnonzero(matching(data, point))
        self.chosen, self.shown = len(chosen), chosen[:most]
        self.floors = floors_of(data)
        status = self.values("status")
        self.solved = status == PointStatus.OK
        self.run = status != PointStatus.NOT_RUN

    def values(self, name: str, level: int = -1) -> Any:
        """Return the values of a variable at the points, 0 in place of rounding."""
        stored = by_point(self.data[name].isel(level=level), self.data)
        return self.floors.cleared(name, stored, level)[self.shown]

    def labels(self) -> list[TextColumn]:
        """Return a column of the labels of each swept parameter."""
        data, dims = self.data, sweep_dims(self.data)
        if not dims:
            return []
        index = np.unravel_index(self.shown, [data.sizes[dim] for dim in dims])
        place = dict(zip(dims, index, strict=True))
        near = data.isel({dim: slice(int(at.max()) + 1) for dim, at in place.items()})
        columns = []
        for axis in axis_names(data):
            texts, unit = axis_labels(near, axis)
            heading = headed(axis_symbol(data, axis), unit)
            at = place[str(data[axis].dims[0])]
            columns.append(TextColumn(heading, [texts[i] for i in at]))
        return columns

    def column(self, name: str, title: str, rank: int, like: Any = None) -> TextColumn:
        """Return the column of a number; those of points without a solution are in parentheses."""
        values = self.values(name)
        if like is None:
            like = values[self.solved]
        units = str(self.fine[name].attrs["units"])
        numbers = quantity(title, values, units, rank=rank, like=like)
        cells = []
        for cell, solved in zip(numbers.cells, self.solved, strict=True):
            cells.append(cell if solved or cell == "–" else f"({cell})")
        notes = (REGIONS[name],) if name in REGIONS else ()
        return TextColumn(numbers.title, cells, rank, notes)

    def usual(self, usual: Sequence[tuple[str, str, int]]) -> list[TextColumn]:
        """Return the columns of what every run has; all lengths have one unit."""
        lengths = [name for name, *_ in usual if name.endswith("_length")]
        sizes = [self.values(name)[self.solved] for name in lengths]
        columns = []
        for name, title, rank in usual:
            like = np.concatenate(sizes) if name in lengths else None
            column = self.column(name, title, rank, like)
            if name in lengths and "–" in column.cells:
                column = replace(column, notes=(*column.notes, NO_PART))
            columns.append(column)
        return columns

    def rest(self) -> list[TextColumn]:
        """Return the columns of what is proved, and of the change with the last level."""
        columns = []
        if "solutions" in self.fine:
            columns.append(TextColumn("equilibria", self._equilibria(), 1, (EVERY,)))
        flags = {name: self.values(name) for name, _ in PROOFS}
        proofs = []
        for i, (solved, run) in enumerate(zip(self.solved, self.run, strict=True)):
            strongest = proved({name: flag[i] for name, flag in flags.items()})
            without = "failed" if run else "not run"
            proofs.append(strongest if solved else without)
        notes = (CERTIFIED, FAILED) if "failed" in proofs else (CERTIFIED,)
        columns.append(TextColumn("certified", proofs, 1, notes))
        if self.data.sizes["level"] > 1:
            # equilibrium may fix ∫ξ, but not the slip
            columns.append(self._change("u_T_max", "Δmax |u_T| to last level", 5))
            columns.append(self._change("friction_resultant", "Δ∫ξ to last level", 4))
        return columns

    def _equilibria(self) -> list[str]:
        names = ("solutions", "stable_solutions", "complete")
        counts = np.stack([self.values(name) for name in names], axis=1).tolist()
        words = []
        for count, solved in zip(counts, self.solved, strict=True):
            words.append(sentences.equilibria(*count) if solved else "–")
        return words

    def _change(self, name: str, title: str, rank: int) -> TextColumn:
        """Return the column of what the last level changed in a number, in the unit of that
        number."""
        last = self.values(name)
        change = np.abs(last - self.values(name, -2))
        change = np.where(self.solved, change, np.nan)
        units = self.fine[name].attrs["units"]
        return quantity(title, change, units, 2, rank, last[self.solved])

    def transposed(self, labels: Sequence[TextColumn], names: Sequence[str]) -> Table:
        """Return the table of a few points with one row per number, in a unit of its own."""
        units, cells = list[str](), list[list[str]]()
        for name in names:
            heading = self.column(name, "", 0)
            units.append(heading.title.strip(" []"))
            cells.append(list(heading.cells))
        columns = [TextColumn("quantity", names), TextColumn("unit", units)]
        for i in range(len(self.shown)):
            label = ", ".join(_with_label(column, i) for column in labels)
            columns.append(TextColumn(label or "value", [row[i] for row in cells]))
        return Table("", columns)


def _with_label(column: TextColumn, place: int) -> str:
    """Return a label with its parameter and unit: width = 20 mm."""
    name, _, unit = column.title.partition(" [")
    return f"{name} = {column.cells[place]} {unit.rstrip(']')}".rstrip()


SAME = 1e-9
"""Difference of energies, relative to the largest of a point, that is rounding."""


def solvers_compared(data: Any) -> Iterator[Part]:
    """Solvers compared where a run kept them side by side."""
    if "solver" not in data.dims:
        return

    def by_solver(name: str) -> Any:
        values = data[f"solver_{name}"].transpose("solver", ...).values.astype(float)
        return values.reshape(values.shape[0], -1)[:, known]

    known: Any = slice(None)
    known = np.isfinite(by_solver("energy")).any(axis=0)
    energy, steps, time = (
        by_solver("energy"),
        by_solver("iterations"),
        np.nansum(by_solver("time"), axis=1),
    )
    size = np.max(np.abs(np.nan_to_num(energy)), axis=0)
    lowest = np.count_nonzero(energy <= np.nanmin(energy, axis=0) + SAME * size, axis=1)
    worst, apart = (np.fmax.reduce(by_solver(name), axis=1) for name in ("residual", "difference"))
    names = data["solver"].values.tolist()
    yield f"  Solvers compared on all points and levels; the solutions stored are those of {names[0]}:"
    columns = [
        TextColumn("solver", names),
        quantity("worst residual", worst, digits=2, rank=1),
        TextColumn("steps", [f"{one[one > 0].sum():.0f}" for one in steps], 2),
        quantity("solve [s]", time, digits=2, rank=3),
        TextColumn("lowest found", [f"{n}/{energy.shape[1]}" for n in lowest], 4),
        quantity("largest difference of u_T", apart, digits=2, rank=5),
    ]
    yield Table("", columns)


def _said(data: Any) -> Iterator[str]:
    """What failed, was not run, or holds only as far as rounding lets it; what is proved of the
    body itself."""
    status, total = data["status"].values, data["status"].size
    failed = [
        tuple(place)
        for place in np.argwhere((status != PointStatus.OK) & (status != PointStatus.NOT_RUN))
    ]
    reasons = data["reason"].values if failed else {}
    dims = [dim for dim in data["status"].dims if dim != "level"]
    rows = list[tuple[PointStatus, str, str, int]]()
    for place in failed:
        where = dict(zip(data["status"].dims, place, strict=True))
        index = [where[dim] for dim in dims]
        sizes = [data.sizes[dim] for dim in dims]
        point = int(np.ravel_multi_index(index, sizes)) if dims else 0
        rows.append(
            (PointStatus(int(status[place])), str(reasons[place]), _point(data, place), point)
        )
    yield from failure_lines(rows)
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
    if "omega" in data:
        jumps = int(np.isinf(data["omega"].isel(level=-1).values).sum())
        if jumps:
            yield (
                f"ω = ∞ at {counted(jumps, 'point')}: the friction law jumps down, and ω < λ₁ "
                "cannot prove a solution unique there"
            )
    if "lambda_1_error" in data and (lost := digits_lost(float(data["lambda_1_error"].max()))):
        yield lost
    if "lambda_1_low" in data:
        fine = data.isel(level=-1)
        low, high, dual, mesh = (
            fine[f"lambda_1{name}"].values.ravel() for name in ("_low", "_high", "_dual", "")
        )
        unique, units = (
            fine["proved_unique"].values.ravel() == 1,
            data["lambda_1_low"].attrs["units"],
        )
        yield from filter(
            None, (sentences.of_the_body(low, high, unique, units), sentences.locks(mesh, dual))
        )
    if len(places := np.argwhere(data["heat_status"].values == UNBALANCED)):
        defects = data["heat_balance"].values[tuple(places.T)]
        yield (
            f"heat balance up to {number(defects.max(), 2)} at {counted(len(places), 'point')}: as thin triangles cost "
            "the temperature its digits, remove slits and slivers of the body or refine towards them "
            f"(worst at {_point(data, places[np.argmax(defects)])})"
        )


def _point(data: Any, place: Any) -> str:
    """The labels of a point and its level in words; place: index along every dimension of the
    status."""
    where = dict(zip(data["status"].dims, (int(i) for i in place), strict=True))
    level = f"level {int(data['level'].values[where.pop('level')])}"
    name = describe(data, where)
    return f"{name} on {level}" if name else level


KINDS = {
    "run": (sentences.run_verdict, run_parts),
    "convergence": (accuracy.convergence_verdict, accuracy.convergence_parts),
    "cost": (accuracy.cost_verdict, accuracy.cost_parts),
    "path": (paths.path_verdict, paths.path_parts),
    "history": (paths.history_verdict, paths.history_parts),
    "fit": (fit.verdict, fit.parts),
}
"""What says the sentence and the parts of a file of each kind, from its root dataset (the sentence
of a run: file)."""
