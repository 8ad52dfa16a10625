"""Sobol indices of a design, as `tcstudy show` has them: which parameter a number comes from, by sides of a gap."""

from __future__ import annotations

from dataclasses import dataclass
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
ORDERS = ("first order", "total")


@dataclass(frozen=True, eq=False)
class SobolIndices:
    """What the points of a design say of a number: sentences before the tables, and estimates by caption and heading.

    names: (d,) swept parameters, in the order of each estimate
    """

    of: str
    names: tuple[str, ...]
    said: list[str]
    tables: dict[str, dict[str, Index]]


def sample(file: Path, of: str) -> tuple[tuple[str, ...], Array, Array, str, float, bool]:
    """A stored number at the points of a design, on the finest level.

    Returns the swept parameters (d,), their values (n, d + 2, d), the number (n, d + 2), NaN where there is no
    solution, its units, the steps in which it comes, and whether every solution is certified to be the only one.
    Raises UsageError if there is no such number.
    """
    with reading(file), netCDF4.Dataset(file) as nc:
        names = [name for name, one in nc.variables.items() if "distribution" in one.ncattrs()]
        known = [name for name, v in nc.variables.items() if v.dimensions == ("point", "level") and v.dtype == "f8"]
        if of not in known:
            remedy = hint(of, known, f"choose of {', '.join(known)}")
            raise UsageError(f"{file} has no number {of!r} at its points; {remedy}")
        level = nc.dimensions["level"].size - 1
        values, ok = np.ma.filled(nc[of][:, level].astype(float), np.nan), nc["status"][:, level] == PointStatus.OK
        x = np.column_stack([np.asarray(nc[name][:], dtype=float) for name in names])
        group, shape = nc.groups.get(f"level_{level}"), (-1, len(names) + 2)
        step = float(np.max(group["c"][:])) if of == "slip_length" and group is not None else 0.0
        unique = bool(np.all(nc["unique"][:, level][ok] == 1))
        f = np.where(ok, values, np.nan).reshape(shape)
        return tuple(names), x.reshape(*shape, len(names)), f, str(nc[of].units), step, unique


def indices(file: Path, of: str) -> SobolIndices:
    """The indices of a number; raises UsageError where too few points have a solution."""
    names, x, f, units, step, unique = sample(file, of)
    whole = np.isfinite(f).all(axis=1)
    if np.count_nonzero(whole) < 2:
        raise UsageError(f"{of} has no whole rows of the design: too few points have a solution")
    f, x = f[whole], x[whole]
    said = [f"{f.size} points of {len(f)} base points, {f'{LEVEL:.0%}'} confidence by resampling them"]
    if lost := int(np.count_nonzero(~whole)):
        said.append(f"left out: {lost} base points with a point that has no solution or no {of}")
    gap = None if unique else jump(f[:, :2].ravel(), step, f[:, 2:].ravel())
    if gap is None:
        why = "every solution is certified to be the only one" if unique else "no gap among the values"
        said.append(f"one side: {why}")
        return SobolIndices(of, names, said, {f"Indices of {of}": dict(zip(ORDERS, sobol(f), strict=True))})
    above = f > (gap[0] + gap[1]) / 2.0
    units = f" {units}" if units != "1" else ""
    share = above[:, :2].mean()
    said.append(
        f"{of} leaves a gap: {1 - share:.1%} of the points lie at {number(gap[0])}{units} or below, {share:.1%} at "
        f"{number(gap[1])}{units} or above, none between; a mean over both sides is a value that no point has"
    )
    sides = dict(zip(ORDERS, sobol(above.astype(float)), strict=True))
    tables = {"Indices of the side on which a point lies": sides}
    for word, side in (("Below", ~above[:, :2]), ("Above", above[:, :2])):
        y, inputs = f[:, :2][side], x[:, :2][side]
        mean = f"mean {number(float(y.mean()))}{units}, standard deviation {number(float(y.std()))}{units}"
        tables[f"{word}: {mean}"] = {"correlation ratio": correlation_ratios(inputs, y)}
    return SobolIndices(of, names, said, tables)


def indices_text(file: Path, of: str) -> str:
    """The tables of all indices, as text."""
    found = indices(file, of)
    lines = [f"  {line}" for line in found.said]
    for caption, columns in found.tables.items():
        header, cells = ["parameter"], [list(found.names)]
        for heading, e in columns.items():
            header += [heading, "from … to"]
            cells += [[f"{v:.3f}" for v in e.value]]
            cells += [[f"{low:.3f} … {high:.3f}" for low, high in zip(e.low, e.high, strict=True)]]
        lines += ["", f"  {caption}:", "", plain_table(header, list(zip(*cells, strict=True)))]
    if len(found.tables) > 1:
        what = "share of the variance on a side that a parameter alone explains"
        lines += ["", f"  correlation ratio: {what}; parameters are not independent there, so there is no total"]
    return wrapped("\n".join(lines))


def indices_json(file: Path, of: str) -> dict[str, Any]:
    """The same, not rounded."""
    found = indices(file, of)
    tables: list[dict[str, Any]] = []
    for caption, columns in found.tables.items():
        tables.append({"caption": caption})
        for heading, e in columns.items():
            rows = zip(found.names, e.value.tolist(), e.low.tolist(), e.high.tolist(), strict=True)
            tables[-1][heading] = {name: {"value": v, "low": low, "high": high} for name, v, low, high in rows}
    return {"of": of, "said": found.said, "tables": tables}
