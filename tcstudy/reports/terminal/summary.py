"""What the terminal says of any result file.

Of a run one table of levels, one of the finest level's points, and a row for each of several
solvers.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from tcstudy.data.files import kind_of
from tcstudy.data.reading import (
    GEOMETRIES,
    asked,
    axis_names,
    by_point,
    load_root,
    of_largest,
    open_root,
    opened,
    sweep_dims,
)
from tcstudy.data.schema import DIFFERENTIABLE, LIMITED, UNBALANCED, PointStatus
from tcstudy.reports import sentences
from tcstudy.reports.select_point import Value, axis_labels, describe, matching
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
    split_table,
)

NOT_SAID = ("start_energy", "start_used", "iterations", "evaluations", "omega", "uniqueness_margin")
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
    with open_root(file) as root:
        data = root.drop_vars(NOT_SAID if kind == "run" else [], errors="ignore").load()
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

    A run may have a million points: of it a few variables are read, without the import of xarray.
    """
    if (kind := kind_of(path)) != "run":
        return KINDS[kind][0](load_root(path))
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
    yield f"  {SIZES}"
    if GEOMETRIES in data.attrs:
        yield f"  {data.attrs[GEOMETRIES]} geometries: the largest h_max, dofs and contact, the least λ₁"
    if "stop" in data and data["stop"].values[-1]:
        yield f"  stopped: {data['stop'].values[-1]}"
    yield from _points(data, None if full else MOST_ROWS, point or {})
    yield from _solvers(data)
    for line in _said(data):
        yield f"  {line}"


SIZES = "h_max: longest edge; mesh.maxh is what the mesher aims at, its longest edges come to 1.2 to 1.6 times that"
"""Measured on all uniform meshes in configs/ and eight more."""
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
    dims, total = sweep_dims(data), data["status"].isel(level=0).size
    ok = (data["status"] == int(PointStatus.OK)).sum(dims).values
    worst, lowest = data["inclusion_residual"].max(dims).values, data["lambda_1"].min(dims).values
    spent = (
        data["time_mesh"]
        + data["time_assemble"]
        + (data["time_condense"] + data["time_solve"]).sum(dims)
    )
    columns = [
        TextColumn("level", data["level"].values.astype(str)),
        quantity("h_max", data["h_max"].values, data["h_max"].attrs["units"], rank=2),
        TextColumn("dofs", data["n_dof"].values.astype(int).astype(str), 1),
        TextColumn("contact", data["n_contact"].values.astype(int).astype(str), 7),
        TextColumn("ok", [f"{int(n)}/{total}" for n in ok]),
        quantity("worst residual", worst, digits=2),
        quantity("λ₁", lowest, data["lambda_1"].attrs["units"], rank=6),
        quantity("time [s]", spent.values, digits=2, rank=8),
    ]
    for rank, (name, title) in enumerate(((n, t) for n, t in _ESTIMATED if n in data), 1):
        units = data[name].attrs.get("units", "1")
        columns.append(
            quantity(title, data[name].max(dims).values, units, 2, rank, data[name].values)
        )
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
CERTIFIED = "certified: what is proved of the solution on its mesh (unique, global or local minimum of the energy)"
EVERY = 'proved to be all, but "at least" where not; of exponential laws those of their polygon, within 1e-3 of b'


def _points(data: Any, most: int | None, point: Mapping[str, Value]) -> Iterator[Part]:
    """One row per point on the finest level, with what changed in ∫ξ since the level before."""
    dims, fine = sweep_dims(data), data.isel(level=-1)
    own = np.flatnonzero(matching(data, point)) if point else np.arange(fine["status"].size)
    shown = own[:most]
    place = (
        dict(zip(dims, np.unravel_index(shown, [data.sizes[d] for d in dims]), strict=True))
        if dims
        else {}
    )
    near = data.isel({dim: slice(int(index.max()) + 1) for dim, index in place.items()})

    def first(name: str, level: int = -1) -> Any:
        return by_point(data[name].isel(level=level), data)[shown]

    status = first("status")
    solved, run = status == PointStatus.OK, status != PointStatus.NOT_RUN

    def column(name: str, title: str, rank: int) -> TextColumn:
        found = quantity(
            title, first(name), fine[name].attrs["units"], rank=rank, like=fine[name].values
        )
        cells = [
            c if good or c == "–" else f"({c})" for c, good in zip(found.cells, solved, strict=True)
        ]
        return TextColumn(found.title, cells, rank)

    labels, rest, legend = list[TextColumn](), list[TextColumn](), [CERTIFIED]
    for axis in axis_names(data):
        texts, unit = axis_labels(near, axis)
        labels.append(
            TextColumn(headed(axis, unit), [texts[i] for i in place[str(data[axis].dims[0])]])
        )
    usual = [one for one in _COLUMNS if one[0] in fine and np.isfinite(fine[one[0]].values).any()]
    # a reaction is the force of a held edge: once is enough
    more = [
        n
        for n in asked(data)
        if not (n.startswith("reaction_") and n.replace("reaction_", "force_", 1) in fine)
    ]
    columns = [*labels, *(column(*one) for one in usual)]
    wanted = [column(name, name, 0) for name in more]
    if "solutions" in fine:
        told = zip(
            *(first(name).tolist() for name in ("solutions", "stable_solutions", "complete")),
            strict=True,
        )
        words = [
            sentences.equilibria(*one) if good else "–"
            for one, good in zip(told, solved, strict=True)
        ]
        rest.append(TextColumn("equilibria", words, 1))
        legend.append(f"equilibria: {EVERY}")
    flags = {name: first(name) for name, _ in PROOFS}
    proofs = [proved({name: flag[i] for name, flag in flags.items()}) for i in range(len(shown))]
    proofs = [
        p if good else "failed" if was else "not run"
        for p, good, was in zip(proofs, solved, run, strict=True)
    ]
    rest.append(TextColumn("certified", proofs, 1))
    if data.sizes["level"] > 1:
        change = np.abs(first("friction_resultant") - first("friction_resultant", -2))
        change, like = np.where(solved, change, np.nan), fine["friction_resultant"]
        rest.append(quantity("Δ∫ξ to last level", change, like.attrs["units"], 2, 4, like.values))
    lengths = [name for name, *_ in usual if name.endswith("_length")]
    if "slip_length" not in lengths or any(np.isnan(first(name)[solved]).any() for name in lengths):
        legend.append("–: of a law without such a part (slip length: that sticks nowhere)")
    if len(lengths) > 1:
        legend.append(
            "debonded, softening, yielded, elastic: lengths where b has fallen, falls, does neither, rises from 0"
        )
    if np.any(run & ~solved):
        legend.append(
            "failed: no solution; the numbers in (parentheses) are those of the last step"
        )
    few = f" first {len(shown)} of {len(own)} points" if len(shown) < len(own) else ""
    yield f"  Level {int(fine['level'])}, the finest:{few}"
    if wanted and not fits([*columns, *wanted, *rest]):
        yield Table("", [*columns, *rest])
        yield "  Asked for by output:"
        yield split_table(labels, wanted)
    else:
        yield Table("", [*columns, *wanted, *rest])
    yield "\n".join(f"  {line}" for line in legend)


SAME = 1e-9
"""Difference of energies, relative to the largest of a point, that is rounding."""


def _solvers(data: Any) -> Iterator[Part]:
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
    level = f"level {int(data['level'][where.pop('level')])}"
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
