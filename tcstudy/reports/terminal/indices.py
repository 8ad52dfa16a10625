"""Sobol indices of a design, as `tcstudy show` has them: which parameter a number, or its side of a gap, comes from."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import netCDF4
import numpy as np

from tcstudy.accuracy.sobol import LEVEL, Index, correlation_ratios, jump, sobol
from tcstudy.data.files import reading
from tcstudy.data.schema import PointStatus
from tcstudy.errors import UsageError
from tcstudy.read.node import hint
from tcstudy.reports.terminal.tables import TextColumn, columns_table, wrapped
from tcstudy.reports.text import number
from tcstudy.scene.designs import SALTELLI

ORDERS = ("first order", "total")


@dataclass(frozen=True, eq=False)
class SobolIndices:
    """What the points of a design say of a number: sentences before the table, its caption, and estimates by heading.

    names: (d,) swept parameters, in the order of each estimate
    """

    of: str
    names: tuple[str, ...]
    said: list[str]
    caption: str
    estimates: dict[str, Index]


def indices(file: Path, of: str) -> SobolIndices:
    """The indices of a number at the points of a design, on the finest level; points without a solution are left out.

    Raises UsageError where there is no such number, or too few points have a solution.
    """
    with reading(file), netCDF4.Dataset(file) as nc:
        drawn = {name: one for name, one in nc.variables.items() if "distribution" in one.ncattrs()}
        known = [name for name, v in nc.variables.items() if v.dimensions == ("point", "level") and v.dtype == "f8"]
        if of not in known:
            remedy = hint(of, known, f"choose of {', '.join(known)}")
            raise UsageError(f"{file} has no number {of!r} at its points; {remedy}")
        level = nc.dimensions["level"].size - 1
        ok, group = nc["status"][:, level] == PointStatus.OK, nc.groups.get(f"level_{level}")
        # (n, r, d) values of the parameters, of a choice its number, and (n, r) the number: r points a base point
        rows = len(drawn) + 2 if nc.getncattr("design_mode") == SALTELLI else 1
        values = [np.unique(one[:], return_inverse=True)[1] if one.dtype is str else one[:] for one in drawn.values()]
        x = np.column_stack(values).astype(float).reshape(-1, rows, len(drawn))
        f = np.where(ok, np.ma.filled(nc[of][:, level].astype(float), np.nan), np.nan).reshape(-1, rows)
        named = tuple(one.distribution.startswith("choice") for one in drawn.values())
        names, units = tuple(drawn), f" {nc[of].units}" if nc[of].units != "1" else ""
        step = float(np.max(group["c"][:])) if of == "slip_length" and group is not None else 0.0
        proved = bool(np.all(nc["unique"][:, level][ok] == 1))
    whole = np.isfinite(f).all(axis=1)
    if np.count_nonzero(whole) < 2:
        raise UsageError(f"{of} has no whole rows of the design: too few points have a solution")
    f, x = f[whole], x[whole]
    confidence = f"{f'{LEVEL:.0%}'} confidence by resampling them"
    said = [f"{f.size} points of {len(f)} base points, {confidence}"]
    if rows == 1:
        said = [f"{f.size} points, {confidence}; totals need points of their own (mode: {SALTELLI})"]
    if lost := int(np.count_nonzero(~whole)):
        which = "base points with a point that has" if rows > 1 else "points with"
        said.append(f"left out: {lost} {which} no solution or no {of}")

    gap = None if proved else jump(f[:, :2].ravel(), step, f[:, 2:].ravel())
    caption = f"Indices of {of}"
    if gap is None:
        why = "every solution is certified to be the only one" if proved else "no gap among the values"
        said.append(f"one side: {why}")
    else:
        f, caption = (f > (gap[0] + gap[1]) / 2.0).astype(float), "Indices of the side on which a point lies"
        share = f[:, :2].mean()
        said.append(
            f"{of} leaves a gap: {1 - share:.1%} of the points lie at {number(gap[0])}{units} or below, {share:.1%} at "
            f"{number(gap[1])}{units} or above, none between; a mean over both sides is a value that no point has"
        )
    orders = sobol(f) if rows > 1 else [correlation_ratios(x[:, 0], f[:, 0], named)]
    return SobolIndices(of, names, said, caption, dict(zip(ORDERS, orders, strict=False)))


def indices_text(file: Path, of: str) -> str:
    """The table of all indices, as text."""
    found = indices(file, of)
    cells = [("parameter", list(found.names))]
    for heading, e in found.estimates.items():
        cells.append((heading, [f"{v:.3f}" for v in e.value]))
        cells.append(("from … to", [f"{low:.3f} … {high:.3f}" for low, high in zip(e.low, e.high, strict=True)]))
    table = columns_table([TextColumn(*one, rank) for rank, one in enumerate(cells)])
    return wrapped("\n".join([*(f"  {line}" for line in found.said), "", f"  {found.caption}:", "", table]))


def indices_json(file: Path, of: str) -> dict[str, Any]:
    """The same, not rounded."""
    found = indices(file, of)
    table: dict[str, Any] = {"caption": found.caption}
    for heading, e in found.estimates.items():
        rows = zip(found.names, e.value.tolist(), e.low.tolist(), e.high.tolist(), strict=True)
        table[heading] = {name: {"value": v, "low": low, "high": high} for name, v, low, high in rows}
    return {"of": of, "said": found.said, "tables": [table]}
