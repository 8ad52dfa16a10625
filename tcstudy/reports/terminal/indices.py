"""Sobol indices at sampled points, as `tcstudy show` prints them.

They tell from which parameter a result comes, or its side of a gap. The numbers come from
`accuracy.indices`. Where Y jumps, a mean over both sides is a value that no point has: there the
side itself has indices.
"""

from __future__ import annotations

import math
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import netCDF4
import numpy as np
from numpy.typing import NDArray

from tcstudy.accuracy.indices.first_order import LEVEL, ROUNDING, SobolIndex, first_order
from tcstudy.accuracy.indices.saltelli import saltelli_indices
from tcstudy.data.files import reading
from tcstudy.data.schema import PointStatus
from tcstudy.errors import UsageError, hint
from tcstudy.reports.text import TextColumn, columns_table, number, wrapped
from tcstudy.scene.designs import SALTELLI, SOBOL

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]
ORDERS = ("first order", "total")
CONFIDENCE = f"{LEVEL:.0%} confidence intervals"
CORRELATED = 4.0
"""Standard deviations of the rank correlation of independent parameters from which they depend."""


@dataclass(frozen=True, eq=False)
class SobolIndices:
    """The indices of a result.

    names:     of the parameters
    notes:     sentences that stand before the table
    caption:   of the table
    estimates: of every parameter, by the order of the index
    """

    names: tuple[str, ...]
    notes: list[str]
    caption: str
    estimates: dict[str, list[SobolIndex]]


@dataclass(frozen=True, eq=False)
class Sample:
    """The sampled points of a file with one result on the finest level.

    names:      of the d parameters;  is_named: (d,) those that are a choice
    x:          (n, r, d) their values, of a choice its number; r points for each base point
    f:          (n, r) the result, NaN without a solution
    mode:       of the design
    unit:       of the result, "" without one
    resolution: steps in which the result comes by itself
    is_unique:  whether every solution is certified to be the only one
    """

    names: tuple[str, ...]
    is_named: tuple[bool, ...]
    x: Array
    f: Array
    mode: str
    unit: str
    resolution: float
    is_unique: bool

    @property
    def is_whole(self) -> Flags:
        """(n,) base points with the result at all their points."""
        return np.asarray(np.isfinite(self.f).all(axis=1))


def indices(file: Path, of: str) -> SobolIndices:
    """Return the indices of a result at the points of a design, on the finest level.

    Points without a solution are left out. Raises UsageError where there is no such result, or too
    few points have it.
    """
    sample = _read_sample(file, of)
    is_whole, points_per_base = sample.is_whole, sample.f.shape[1]
    if np.count_nonzero(is_whole) < 2:
        raise UsageError(f"{of} has no complete base samples: too few points have this variable")
    f, x = sample.f[is_whole], sample.x[is_whole]
    notes = [f"{f.size} points of {len(f)} base points, {CONFIDENCE} by resampling them"]
    if points_per_base == 1:
        remedy = f"totals need points of their own (mode: {SALTELLI})"
        notes = [f"{f.size} points, {CONFIDENCE}; {remedy}"]
    if lost := int(np.count_nonzero(~is_whole)):
        which = "base points with a point that has" if points_per_base > 1 else "points with"
        notes.append(f"left out: {lost} {which} no solution or no {of}")

    caption = f"Indices of {of}"
    gap = None
    if sample.is_unique:
        notes.append("one side: every solution is certified to be the only one")
    else:
        gap = jump(f[:, :2].ravel(), sample.resolution, f[:, 2:].ravel())
        notes.append(_gap_note(gap, f[:, :2], of, sample.unit))
    if gap is not None:
        f = (f > (gap[0] + gap[1]) / 2.0).astype(float)
        caption = "Indices of the side on which a point lies"

    if points_per_base > 1:
        estimates = dict(zip(ORDERS, saltelli_indices(f), strict=True))
    else:
        x = x[:, 0]
        is_balanced = sample.mode == SOBOL
        estimates = {ORDERS[0]: first_order(x, f[:, 0], sample.is_named, balanced=is_balanced)}
        notes += _correlation_notes(sample.names, sample.is_named, x)
    for order in estimates.values():
        notes += _reason_notes(sample.names, order)
    return SobolIndices(sample.names, list(dict.fromkeys(notes)), caption, estimates)


def _read_sample(file: Path, of: str) -> Sample:
    """Read the sampled points of a file and one result; raise UsageError if it does not have it."""
    with reading(file), netCDF4.Dataset(file) as nc:
        parameters = {name: v for name, v in nc.variables.items() if "distribution" in v.ncattrs()}
        _check_result(file, nc, of)
        level = nc.dimensions["level"].size - 1
        is_solved = nc["status"][:, level] == PointStatus.OK
        mode = nc.getncattr("design_mode")
        points_per_base = len(parameters) + 2 if mode == SALTELLI else 1
        columns = [_numbered(variable[:]) for variable in parameters.values()]
        f = np.ma.filled(nc[of][:, level].astype(float), np.nan)
        f = np.where(is_solved, f, np.nan)
        group = nc.groups.get(f"level_{level}")
        resolution = 0.0
        if of == "slip_length" and group is not None:
            resolution = float(np.max(group["c"][:]))
        return Sample(
            names=tuple(parameters),
            is_named=tuple(v.distribution.startswith("choice") for v in parameters.values()),
            x=np.column_stack(columns).astype(float).reshape(-1, points_per_base, len(parameters)),
            f=f.reshape(-1, points_per_base),
            mode=mode,
            unit=f" {nc[of].units}" if nc[of].units != "1" else "",
            resolution=resolution,
            is_unique=bool(np.all(nc["unique"][:, level][is_solved] == 1)),
        )


def _check_result(file: Path, nc: netCDF4.Dataset, of: str) -> None:
    """Raise UsageError if a file does not have one real number of this name at its points."""
    results = []
    for name, variable in nc.variables.items():
        if variable.dimensions == ("point", "level") and variable.dtype == "f8":
            results.append(name)
    if of in results:
        return
    lack = f"{of!r} is not one real number" if of in nc.variables else f"it has no number {of!r}"
    remedy = hint(of, results, f"choose of {', '.join(results)}")
    raise UsageError(f"{file}: {lack} at its points; {remedy}")


def _numbered(values: Any) -> Any:
    """Return the values of a parameter, those of a choice by their numbers."""
    values = np.asarray(values)
    is_text = values.dtype.kind in "OUS"
    return np.unique(values, return_inverse=True)[1] if is_text else values


def _gap_note(gap: tuple[float, float] | None, f: Array, of: str, unit: str) -> str:
    """Return the sentence that says which share of independent results f lies on which side."""
    if gap is None:
        return "one side: no gap among the values"
    share = float(np.mean(f > (gap[0] + gap[1]) / 2.0))
    return (
        f"{of} is bimodal: {1 - share:.1%} of the points lie at {number(gap[0])}{unit} or below, "
        f"{share:.1%} at {number(gap[1])}{unit} or above, none between; a mean over both sides is "
        "a value that no point has"
    )


def _correlation_notes(names: tuple[str, ...], is_named: tuple[bool, ...], x: Array) -> list[str]:
    """Return a sentence if two parameters of x (N, d) depend on each other more than by chance."""
    varies = np.ptp(x, axis=0) > 0.0
    columns = [i for i in range(len(names)) if varies[i] and not is_named[i]]
    if len(columns) < 2:
        return []
    order = np.argsort(x[:, columns], axis=0, kind="stable")
    ranks = np.argsort(order, axis=0, kind="stable")
    correlation = np.asarray(np.corrcoef(ranks.T))
    upper = np.triu(np.abs(correlation), 1)
    i, j = np.unravel_index(int(np.argmax(upper)), upper.shape)
    if upper[i, j] <= CORRELATED / len(x) ** 0.5:
        return []
    pair = f"{names[columns[i]]} and {names[columns[j]]}"
    return [
        f"{pair} depend on each other (rank correlation {correlation[i, j]:.2f}): the index of a "
        "parameter contains what comes along with it, and the sum may pass 1"
    ]


def _reason_notes(names: tuple[str, ...], estimates: list[SobolIndex]) -> list[str]:
    """Return a sentence for each reason why indices have no interval."""
    by_reason: dict[str, list[str]] = {}
    for name, estimate in zip(names, estimates, strict=True):
        if estimate.reason:
            by_reason.setdefault(estimate.reason, []).append(name)
    return [f"no interval of {', '.join(group)}: {why}" for why, group in by_reason.items()]


def indices_text(file: Path, of: str) -> str:
    """Return the table of all indices as text."""
    result = indices(file, of)
    columns = [("parameter", list(result.names))]
    for heading, estimates in result.estimates.items():
        columns.append((heading, [_decimals(estimate.value) for estimate in estimates]))
        columns.append((f"{LEVEL:.0%} interval", [_interval(estimate) for estimate in estimates]))
    text_columns = [TextColumn(*column, rank) for rank, column in enumerate(columns)]
    notes = [f"  {note}" for note in result.notes]
    lines = [*notes, "", f"  {result.caption}:", "", columns_table(text_columns)]
    return wrapped("\n".join(lines))


def _decimals(share: float) -> str:
    return f"{share:.3f}" if math.isfinite(share) else "–"


def _interval(estimate: SobolIndex) -> str:
    if not math.isfinite(estimate.low):
        return "–"
    return f"{_decimals(estimate.low)} … {_decimals(estimate.high)}"


def indices_json(file: Path, of: str) -> dict[str, Any]:
    """Return the same with all digits; `reason` says why an index has no interval."""
    result = indices(file, of)
    table: dict[str, Any] = {"caption": result.caption}
    for heading, estimates in result.estimates.items():
        table[heading] = {
            name: asdict(estimate) for name, estimate in zip(result.names, estimates, strict=True)
        }
    return {"of": of, "said": result.notes, "tables": [table]}


def jump(
    values: Array, resolution: float = 0.0, dependent: Array | None = None
) -> tuple[float, float] | None:
    """Return the ends of the widest gap that no smooth distribution has by chance.

    None if there is none. A gap is a jump if it is wider than the stretch of the k nearest values
    on either side together with twice the resolution. Of N values of a smooth density that happens
    with a chance of at most N 2^−k, here 1e-3, wherever the gap lies and whatever the scale.

    resolution: steps in which the values come by themselves, e.g. the length of a contact segment
    dependent:  further values, which are not independent: they narrow a gap, but make none
    """
    v = np.sort(values)
    k = math.ceil(math.log2(1000.0 * max(1, len(v))))
    if len(v) < 2 * k:
        return None
    before = np.arange(k - 1, len(v) - k)  # the value before each gap
    gap = v[before + 1] - v[before]
    stretch_below = v[before] - v[before - k + 1]
    stretch_above = v[before + k] - v[before + 1]
    stretch = np.maximum(stretch_below, stretch_above)
    jumps = np.where(gap > stretch + 2.0 * resolution, gap, 0.0)
    best = int(np.argmax(jumps)) if len(jumps) else 0
    if not len(jumps) or jumps[best] <= ROUNDING * float(np.abs(v).max()):
        return None
    low, high = float(v[before[best]]), float(v[before[best] + 1])
    if dependent is None:
        return low, high
    is_inside = (low < dependent) & (dependent < high)
    inside = np.sort(np.concatenate([[low, high], dependent[is_inside]]))
    widest = int(np.argmax(np.diff(inside)))
    low, high = float(inside[widest]), float(inside[widest + 1])
    return (low, high) if high - low > stretch[best] + 2.0 * resolution else None
