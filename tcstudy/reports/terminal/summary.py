"""Report of any result file on the terminal.

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
from tcstudy.data.schema import DIFFERENTIABLE, LIMITED, POLYGON, UNBALANCED, PointStatus
from tcstudy.data.store import GUARANTEE
from tcstudy.reports import sentences
from tcstudy.reports.rounding import floors_of
from tcstudy.reports.select_point import Value, axis_labels, axis_symbol, describe, matching
from tcstudy.reports.terminal import accuracy, fit, paths
from tcstudy.reports.text import (
    PROOFS,
    FailedSolution,
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

NOT_REPORTED = ("start_energy", "start_used", "iterations", "evaluations", "uniqueness_margin")
"""Variables that a summary does not use: of a long sweep they need not be in memory."""
MAX_ROWS = 48
"""Points shown; the file has them all."""


def text_of(
    file: Path, full: bool = False, point: Mapping[str, Value] | None = None, of: str | None = None
) -> str:
    """Return the sentences and tables of a file, from the file alone. Raises StoreError.

    full:  all rows, steps and tables
    point: labels of the points of a run to list, or of that of a convergence to show
    of:    of a design, the variable whose indices to show
    """
    kind, verdict = kind_of(file), verdict_of(file)
    data = load_table(file, NOT_REPORTED if kind == "run" else ())
    _, parts_of = KINDS[kind]
    heading, *parts = parts_of(data, full, point)
    # the labelled lines of costs stand in their parts, which are those of one error
    first = [] if kind == "cost" else [verdict]
    text = render([heading, *first, *parts]).rstrip("\n")
    if of:
        from tcstudy.reports.terminal.indices import indices_text

        text += f"\n\n{indices_text(file, of)}"
    return text


def verdict_of(path: Path) -> Verdict:
    """Return the verdict of a file of any kind. Raises StoreError.

    A run may have a million points: of it a few variables are read.
    """
    kind = kind_of(path)
    if kind != "run":
        verdict, _ = KINDS[kind]
        return verdict(load_table(path))
    with opened(path) as nc:
        return sentences.run_verdict(nc)


def run_parts(
    data: Any, full: bool = False, point: Mapping[str, Value] | None = None
) -> Iterator[Part]:
    """Yield the levels of a run, its points, and what failed or is limited.

    full: list all points;  point: labels of the points to list
    """
    data = of_largest(data)
    yield Heading(data.attrs["title"], 1)
    yield _levels(data)
    if GEOMETRIES in data.attrs:
        count = data.attrs[GEOMETRIES]
        yield f"  {count} geometries: the largest h_max, DOFs and contact, the least λ₁"
    if "stop" in data and data["stop"].values[-1]:
        yield f"  stopped: {data['stop'].values[-1]}"
    yield from _points(data, None if full else MAX_ROWS, point or {})
    yield from solvers_compared(data)
    for line in (*_failures(data), *_limits(data)):
        yield f"  {line}"


_ESTIMATED = (
    ("error_estimate", "est. rel. error"),
    ("error_bound_relative", "rel. error bound"),
    ("goal_estimate", "est. error of goal"),
    ("goal_error", "error of goal"),
    ("goal_effectivity", "effectivity"),
)
"""Columns of the table of levels where errors are estimated: the largest of all points."""


def _levels(data: Any) -> Table:
    """Return one row per level: size, solved points, their worst residual, and seconds it took."""

    def by_level(name: str) -> Any:
        """Return (P, levels) values of a number of the points."""
        return by_point(data[name], data)

    status = by_level("status")
    total = len(status)
    is_solved = status == PointStatus.OK
    ok = is_solved.sum(axis=0)
    worst = np.fmax.reduce(np.where(is_solved, by_level("inclusion_residual"), np.nan))
    lowest = np.fmin.reduce(by_level("lambda_1"))
    of_points = np.nansum(by_level("time_condense") + by_level("time_solve"), axis=0)
    spent = data["time_mesh"].values + data["time_assemble"].values + of_points
    columns = [
        TextColumn("level", data["level"].values.astype(str)),
        quantity("h_max", data["h_max"].values, data["h_max"].attrs["units"], rank=2),
        TextColumn("DOFs", data["n_dof"].values.astype(int).astype(str), 1),
        TextColumn("contact", data["n_contact"].values.astype(int).astype(str), 7),
        TextColumn("ok", [f"{int(n)}/{total}" for n in ok]),
        quantity("worst residual", worst, digits=2),
        quantity("λ₁", lowest, data["lambda_1"].attrs["units"], rank=6),
        quantity("time [s]", spent, digits=2, rank=8),
    ]
    estimated = [(name, title) for name, title in _ESTIMATED if name in data]
    for rank, (name, title) in enumerate(estimated, 1):
        units = data[name].attrs.get("units", "1")
        largest = np.fmax.reduce(by_level(name))
        columns.append(quantity(title, largest, units, 2, rank, data[name].values))
    return Table("", columns, _bound_notes(data, total))


def _bound_notes(data: Any, total: int) -> tuple[str, ...]:
    """Return what the column of proved bounds has, where that is more than its title says.

    total: number of points
    """
    if "error_bound_relative" not in data:
        return ()
    is_polygon = data.attrs.get(GUARANTEE) == "polygon"
    facts = ["the largest of all points that have one"] if total > 1 else []
    facts += [f"of the {POLYGON}"] if is_polygon else []
    return (f"rel. error bound: {', '.join(facts)}",) if facts else ()


_COLUMNS = (
    ("opening_max", "max opening", 0),
    ("opened_length", "opened", 3),
    ("peel_stress_max", "peel stress", 1),
    ("pressure_max", "pressure", 1),
    ("u_T_max", "max |u_T|", 0),
    ("slip_length", "slip length", 3),
    ("debonded_length", "debonded", 3),
    ("softening_length", "softening", 4),
    ("yielded_length", "yielded", 5),
    ("elastic_length", "elastic", 7),
    ("shear_max", "max |ξ|", 8),
    ("friction_resultant", "∫ξ", 2),
    ("adhesion_resultant", "∫S_N", 4),
    ("mode_mixity", "mode mixity", 7),
    ("energy", "energy", 5),
    ("theta_mean", "mean θ", 6),
)
"""Numbers of a point, their titles, and their importance where there is no room for all."""
CERTIFIED = (
    "certified: strongest property proved of the solution on its mesh "
    "(unique, global or local minimum of the energy)"
)
CERTIFIED_PRESSED = (
    "certified: unique where the contraction of the pressures is below 1 on this mesh "
    "(friction that follows the pressure has no energy)"
)
EVERY = (
    'equilibria: proved to be all, but "at least" where not; '
    "of exponential laws those of their piecewise-linear approximation, within 1e-3 of b"
)
SOFTENING = "ω/λ₁: below 1 the solution is unique on its mesh"
SOFTENING_RANK = 9
"""The column of ω/λ₁ is the first one hidden: it decides only what `certified` tells already."""
NO_PART = "–: the law has no such part (slip length: it sticks nowhere)"
FAILED = "failed: no solution; the numbers in (parentheses) are those of the last step"
REGIONS = {
    "debonded_length": "debonded: length on which b has reached its residual level",
    "softening_length": (
        "softening: length on a softening branch of b, with slip linear between nodes "
        "(slip length: by whole nodes, so up to half an element apart)"
    ),
    "yielded_length": "yielded: length of sliding at constant b (plateau)",
    "elastic_length": "elastic: length on the initial elastic branch of b",
    "opened_length": "opened: length on which the opening is above 0",
    "adhesion_resultant": "∫S_N: over the edges that may open, positive in tension",
    "mode_mixity": "mode mixity: 0° peels, 90° slides, at the node that takes most work",
}
"""Legends of columns."""
NEEDED = {
    "shear_max": "shear_max",
    "friction_resultant": "shear_max",
    "peel_stress_max": "peel_stress_max",
    "mode_mixity": "peel_stress_max",
}
"""Numbers that tell nothing where the other one is 0 at all points, of contact that may open."""
FEW_POINTS = 4
"""Points up to which requested numbers have a row each, and the points columns."""


def _points(data: Any, most: int | None, point: Mapping[str, Value]) -> Iterator[Part]:
    """Yield one row per point on the finest level, with the change by the last level."""
    rows = _Rows(data, most, point)
    fine = rows.fine
    part = ""
    if len(rows.shown) < rows.chosen:
        part = f" first {len(rows.shown)} of {rows.chosen} points"
    yield f"  Level {int(fine['level'])}, the finest:{part}"
    labels = rows.labels()
    usual = [row for row in _COLUMNS if row[0] in fine and np.isfinite(fine[row[0]].values).any()]
    if "opening_max" in fine:
        usual = [row for row in usual if rows.tells(row[0])]
    usual_columns = rows.usual(usual)
    proofs = rows.proofs_and_changes()
    requested = _requested(data)
    columns = [rows.column(name, name, rank) for rank, name in enumerate(requested, 1)]
    in_one_table = [*labels, *usual_columns, *columns, *proofs]
    if fits(in_one_table):
        yield Table("", in_one_table)
        return
    yield Table("", [*labels, *usual_columns, *proofs])
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

    shown: indices of the points in the sweep;  chosen: number of points that have the labels
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
        index_along = dict(zip(dims, index, strict=True))
        # labels with the digits that tell those of the listed points apart
        extent = {dim: slice(int(indices.max()) + 1) for dim, indices in index_along.items()}
        listed = data.isel(extent)
        columns = []
        for axis in axis_names(data):
            texts, unit = axis_labels(listed, axis)
            heading = headed(axis_symbol(data, axis), unit)
            cells = [texts[i] for i in index_along[str(data[axis].dims[0])]]
            columns.append(TextColumn(heading, cells))
        return columns

    def tells(self, name: str) -> bool:
        """Return whether a number tells something of contact that may open.

        Without friction or without tension it does not: its columns would be 0, and the mode 90°.
        """
        needed = NEEDED.get(name, name)
        return needed not in NEEDED.values() or bool(np.any(self.values(needed)[self.solved]))

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

    def proofs_and_changes(self) -> list[TextColumn]:
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
        certified = CERTIFIED_PRESSED if "contraction" in self.fine else CERTIFIED
        notes = (certified, FAILED) if "failed" in proofs else (certified,)
        columns.append(TextColumn("certified", proofs, 1, notes))
        columns += self._softening()
        if "contraction" in self.fine and np.isfinite(self.values("contraction")).any():
            columns.append(self.column("contraction", "contraction", 2))
        if self.data.sizes["level"] > 1:
            # equilibrium may fix ∫ξ, but not the slip
            columns.append(self._change("u_T_max", "Δmax |u_T| to last level", 5))
            if "opening_max" in self.fine:
                columns.append(self._change("opening_max", "Δmax opening to last level", 5))
            if "opening_max" not in self.fine or self.tells("friction_resultant"):
                columns.append(self._change("friction_resultant", "Δ∫ξ to last level", 4))
        return columns

    def _softening(self) -> list[TextColumn]:
        """Return the column of ω/λ₁ if a point has it; without it λ₁ = 0 at every point."""
        omega, lambda_1 = self.values("omega"), self.values("lambda_1")
        has_ratio = self.solved & (lambda_1 > 0.0)
        ratio = np.divide(omega, lambda_1, out=np.full(len(omega), np.nan), where=has_ratio)
        if np.isnan(ratio).all():
            return []
        return [quantity("ω/λ₁", ratio, digits=3, rank=SOFTENING_RANK, notes=(SOFTENING,))]

    def _equilibria(self) -> list[str]:
        names = ("solutions", "stable_solutions", "complete")
        counts = np.stack([self.values(name) for name in names], axis=1).tolist()
        words = []
        for count, solved in zip(counts, self.solved, strict=True):
            words.append(sentences.equilibria(*count) if solved else "–")
        return words

    def _change(self, name: str, title: str, rank: int) -> TextColumn:
        """Return the column of the change of a number by the last level, in its unit."""
        values = self.values(name)
        change = np.abs(values - self.values(name, -2))
        change = np.where(self.solved, change, np.nan)
        units = self.fine[name].attrs["units"]
        return quantity(title, change, units, 2, rank, values[self.solved])

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
    """Yield a table of the solvers where a run kept several side by side."""
    if "solver" not in data.dims:
        return

    def by_solver(name: str) -> Any:
        """Return (solvers, P × levels) values of a number."""
        values = data[f"solver_{name}"].transpose("solver", ...).values.astype(float)
        return values.reshape(values.shape[0], -1)

    is_known = np.isfinite(by_solver("energy")).any(axis=0)
    energy, steps, time, residual, difference = (
        by_solver(name)[:, is_known]
        for name in ("energy", "iterations", "time", "residual", "difference")
    )
    size = np.max(np.abs(np.nan_to_num(energy)), axis=0)
    lowest = np.count_nonzero(energy <= np.nanmin(energy, axis=0) + SAME * size, axis=1)
    step_sums = [f"{steps_of_one[steps_of_one > 0].sum():.0f}" for steps_of_one in steps]
    names = data["solver"].values.tolist()
    stored = f"the solutions stored are those of {names[0]}"
    yield f"  Solvers compared on all points and levels; {stored}:"
    columns = [
        TextColumn("solver", names),
        quantity("worst residual", np.fmax.reduce(residual, axis=1), digits=2, rank=1),
        TextColumn("steps", step_sums, 2),
        quantity("solve [s]", np.nansum(time, axis=1), digits=2, rank=3),
        TextColumn("lowest found", [f"{count}/{energy.shape[1]}" for count in lowest], 4),
        quantity("largest difference of u_T", np.fmax.reduce(difference, axis=1), digits=2, rank=5),
    ]
    yield Table("", columns)


def _failures(data: Any) -> Iterator[str]:
    """Yield the failures by kind."""
    status, dims = data["status"].values, data["status"].dims
    failed = np.argwhere((status != PointStatus.OK) & (status != PointStatus.NOT_RUN))
    if not len(failed):
        return
    reasons = data["reason"].values
    sizes = [1 if dim == "level" else data.sizes[dim] for dim in dims]
    rows = list[FailedSolution]()
    for place in map(tuple, failed.tolist()):
        index = [0 if dim == "level" else i for dim, i in zip(dims, place, strict=True)]
        point = int(np.ravel_multi_index(index, sizes))
        status_here = PointStatus(int(status[place]))
        rows.append((status_here, str(reasons[place]), _point(data, place), point))
    yield from failure_lines(rows)


def _limits(data: Any) -> Iterator[str]:
    """Yield what was not run, or holds only as far as rounding lets it, and proofs of the body."""
    status, total = data["status"].values, data["status"].size
    fine = data.isel(level=-1)
    if "sensitivity_status" in data:
        is_known = fine["sensitivity_status"].values == DIFFERENTIABLE
        points = f"{np.count_nonzero(is_known)} of {fine['status'].size} points"
        yield (
            f"derivatives known at {points} of the finest level, NaN at changes of contact state "
            "and folds: "
            "sensitivity_…"
        )
    not_run = np.argwhere(status == PointStatus.NOT_RUN)
    if len(not_run):
        example = _point(data, not_run[0])
        yield f"not run: {len(not_run)} of {total} places of the grid (for example {example})"
    limited = np.argwhere(data["inclusion_status"].values == LIMITED)
    if len(limited):
        residuals = data["inclusion_residual"].values
        allowed = data["inclusion_rounding"].values
        worst = max(map(tuple, limited), key=lambda place: float(residuals[place]))
        yield (
            f"limited by rounding: {len(limited)} of {total} solutions hold to "
            f"{number(residuals[worst], 2)} of the scale of b or better, where rounding alone "
            f"allows {number(allowed[worst], 2)}; friction is small against the forces in the body "
            f"(worst at {_point(data, worst)})"
        )
    if "omega" in data:
        jumps = int(np.isinf(fine["omega"].values).sum())
        if jumps:
            yield (
                f"ω = ∞ at {counted(jumps, 'point')}: the friction law jumps down, and ω < λ₁ "
                "cannot prove a solution unique there"
            )
    if "lambda_1_error" in data:
        yield from filter(None, [digits_lost(float(data["lambda_1_error"].max()))])
    if "lambda_1_low" in data:
        yield from filter(None, _of_the_body(fine))
    unbalanced = np.argwhere(data["heat_status"].values == UNBALANCED)
    if len(unbalanced):
        defects = data["heat_balance"].values[tuple(unbalanced.T)]
        worst = unbalanced[np.argmax(defects)]
        points = counted(len(unbalanced), "point")
        yield (
            f"heat balance up to {number(defects.max(), 2)} at {points}: as thin triangles cost "
            "the temperature its digits, remove slits and slivers of the body or refine towards "
            f"them (worst at {_point(data, worst)})"
        )


def _of_the_body(fine: Any) -> list[str]:
    """Return what is proved of the body itself, and whether the mesh is too stiff."""
    low, high = fine["lambda_1_low"].values.ravel(), fine["lambda_1_high"].values.ravel()
    mesh, dual = fine["lambda_1"].values.ravel(), fine["lambda_1_dual"].values.ravel()
    is_unique = fine["proved_unique"].values.ravel() == 1
    units = fine["lambda_1_low"].attrs["units"]
    guarantee = str(fine.attrs.get(GUARANTEE, ""))
    proved = sentences.of_the_body(low, high, is_unique, units, guarantee)
    return [proved, sentences.too_stiff(mesh, dual)]


def _point(data: Any, place: Any) -> str:
    """Return the labels of a point and its level in words; place: index along the status."""
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
"""Functions that return the verdict and the parts of a file of each kind, from its root dataset;
the verdict of a run is made from the open file."""
