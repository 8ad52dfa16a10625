"""Sobol indices of a design, as `tcstudy show` has them: which parameter a number comes from, by sides of a gap."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import chain
from pathlib import Path
from typing import Any

import netCDF4
import numpy as np
from numpy.typing import NDArray

from tcstudy.accuracy.sobol import LEVEL, Index, correlation_ratios, jump, sobol
from tcstudy.data.reading import reading
from tcstudy.data.records import PointStatus
from tcstudy.errors import UsageError
from tcstudy.read.node import hint
from tcstudy.reports.terminal.tables import plain_table, wrapped
from tcstudy.reports.text import number

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Sample:
    """A stored number at the points of a design, on the finest level.

    names: (d,) swept parameters;  x: (n, d + 2, d);  f: (n, d + 2), NaN where there is no solution
    resolution: steps in which the number comes;  unique: whether every solution is certified to be the only one
    """

    of: str
    units: str
    names: tuple[str, ...]
    x: Array
    f: Array
    resolution: float
    unique: bool


@dataclass(frozen=True, eq=False)
class IndexTable:
    """Indices of one thing: its caption, and estimates by heading."""

    caption: str
    columns: dict[str, Index]


def sample(file: Path, of: str) -> Sample:
    """Read the file of a run of a design for indices. Raises UsageError if there is no such number."""
    with reading(file), netCDF4.Dataset(file) as nc:
        names = [name for name, one in nc.variables.items() if "distribution" in one.ncattrs()]
        by_point = {name: one for name, one in nc.variables.items() if one.dimensions == ("point", "level")}
        known = [name for name, one in by_point.items() if one.dtype == "f8"]
        if of not in known:
            remedy = hint(of, known, f"choose of {', '.join(known)}")
            raise UsageError(f"{file} has no number {of!r} at its points; {remedy}")
        shape = (-1, len(names) + 2)
        level = nc.dimensions["level"].size - 1
        values = np.ma.filled(nc[of][:, level].astype(float), np.nan)
        ok = nc["status"][:, level] == PointStatus.OK
        x = np.column_stack([np.asarray(nc[name][:], dtype=float) for name in names])
        group = nc.groups.get(f"level_{level}")
        step = float(np.max(group["c"][:])) if of == "slip_length" and group is not None else 0.0
        return Sample(
            of=of,
            units=str(nc[of].units),
            names=tuple(names),
            x=x.reshape(*shape, len(names)),
            f=np.where(ok, values, np.nan).reshape(shape),
            resolution=step,
            unique=bool(np.all(nc["unique"][:, level][ok] == 1)),
        )


def tables(one: Sample) -> tuple[list[str], list[IndexTable]]:
    """What is to be said beforehand, and the tables. Raises UsageError where too few points have a solution."""
    whole = np.isfinite(one.f).all(axis=1)
    if np.count_nonzero(whole) < 2:
        raise UsageError(f"{one.of} has no whole rows of the design: too few points have a solution")
    f, x = one.f[whole], one.x[whole]
    said = [f"{f.size} points of {len(f)} base points, {f'{LEVEL:.0%}'} confidence by resampling them"]
    if not whole.all():
        said.append(
            f"left out: {np.count_nonzero(~whole)} base points with a point that has no solution or no {one.of}"
        )
    gap = None if one.unique else jump(f[:, :2].ravel(), one.resolution, f[:, 2:].ravel())
    if gap is None:
        why = "every solution is certified to be the only one" if one.unique else "no gap among the values"
        said.append(f"one side: {why}")
        first, total = sobol(f)
        return said, [IndexTable(f"Indices of {one.of}", {"first order": first, "total": total})]
    above = f > (gap[0] + gap[1]) / 2.0
    units = f" {one.units}" if one.units != "1" else ""
    share = above[:, :2].mean()
    said.append(
        f"{one.of} leaves a gap: {1 - share:.1%} of the points lie at {number(gap[0])}{units} or below, {share:.1%} at "
        f"{number(gap[1])}{units} or above, none between; a mean over both sides is a value that no point has"
    )
    first, total = sobol(above.astype(float))
    made = [IndexTable("Indices of the side on which a point lies", {"first order": first, "total": total})]
    for word, side in (("Below", ~above[:, :2]), ("Above", above[:, :2])):
        y, inputs = f[:, :2][side], x[:, :2][side]
        mean = f"mean {number(float(y.mean()))}{units}, standard deviation {number(float(y.std()))}{units}"
        made.append(IndexTable(f"{word}: {mean}", {"correlation ratio": correlation_ratios(inputs, y)}))
    return said, made


def indices_text(file: Path, of: str) -> str:
    """The tables of all indices, as text."""
    one = sample(file, of)
    said, made = tables(one)
    lines = [f"  {line}" for line in said]
    for table in made:
        header = ["parameter", *(word for heading in table.columns for word in (heading, "from … to"))]
        found = [zip(e.value, e.low, e.high, strict=True) for e in table.columns.values()]
        cells = [[(f"{value:.3f}", f"{low:.3f} … {high:.3f}") for value, low, high in column] for column in found]
        rows = [[name, *chain(*own)] for name, *own in zip(one.names, *cells, strict=True)]
        lines += ["", f"  {table.caption}:", "", plain_table(header, rows)]
    if len(made) > 1:
        what = "share of the variance on a side that a parameter alone explains"
        lines += ["", f"  correlation ratio: {what}; parameters are not independent there, so there is no total"]
    return wrapped("\n".join(lines))


def indices_json(file: Path, of: str) -> dict[str, Any]:
    """The same, not rounded."""
    one = sample(file, of)
    said, made = tables(one)
    found: list[dict[str, Any]] = []
    for table in made:
        found.append({"caption": table.caption})
        for heading, e in table.columns.items():
            rows = zip(one.names, e.value.tolist(), e.low.tolist(), e.high.tolist(), strict=True)
            found[-1][heading] = {name: {"value": v, "low": low, "high": high} for name, v, low, high in rows}
    return {"of": of, "said": said, "tables": found}
