"""Sobol indices of a design, as `tcstudy show` has them: which parameter a number, or its side of a
gap, comes from.

Y = f(X₁, …, X_d) with independent X_i.  First order S_i = Var(E[Y|X_i])/Var(Y), total T_i = E[Var(Y|X_~i)]/Var(Y), by
the estimators (b) and (f) of Saltelli et al., Comput. Phys. Commun. 181 (2010) 259, table 2. They are those of
scipy.stats.sobol_indices, which takes neither a number of rows that is no power of two nor rows left out.
Of points drawn otherwise the correlation ratio Var(E[Y|X_i])/Var(Y) is estimated, which means what it says where the
X_i are not independent, too. Where Y jumps, a mean over both sides is a value that no point has: there the side itself
has indices.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import netCDF4
import numpy as np
from numpy.typing import NDArray

from tcstudy.data.files import reading
from tcstudy.data.schema import PointStatus
from tcstudy.errors import UsageError, hint
from tcstudy.reports.text import TextColumn, columns_table, number, wrapped
from tcstudy.scene.designs import SALTELLI

Array = NDArray[np.float64]
Estimate = Array
"""(3, d) values and the ends of their confidence intervals."""
RESAMPLES, LEVEL = 1000, 0.95
"""Bootstrap resamples of rows, and the confidence of their intervals."""
ROUNDING = 1e-9
"""Differences of values, relative to the largest, that solutions do not tell apart."""
ORDERS = ("first order", "total")


@dataclass(frozen=True, eq=False)
class SobolIndices:
    """What a design says of a number: sentences before the table, its caption, and estimates (3, d)
    by heading."""

    names: tuple[str, ...]
    said: list[str]
    caption: str
    estimates: dict[str, Estimate]


def indices(file: Path, of: str) -> SobolIndices:
    """The indices of a number at the points of a design, on the finest level; points without a
    solution are left out.

    Raises UsageError where there is no such number, or too few points have it.
    """
    with reading(file), netCDF4.Dataset(file) as nc:
        drawn = {name: one for name, one in nc.variables.items() if "distribution" in one.ncattrs()}
        known = [
            name
            for name, v in nc.variables.items()
            if v.dimensions == ("point", "level") and v.dtype == "f8"
        ]
        if of not in known:
            remedy = hint(of, known, f"choose of {', '.join(known)}")
            is_there = of in nc.variables
            lack = f"{of!r} is not one real number" if is_there else f"it has no number {of!r}"
            raise UsageError(f"{file}: {lack} at its points; {remedy}")
        level = nc.dimensions["level"].size - 1
        ok, group = nc["status"][:, level] == PointStatus.OK, nc.groups.get(f"level_{level}")
        # (n, r, d) values of the parameters, of a choice its number, and (n, r) the number: r
        # points a base point
        rows = len(drawn) + 2 if nc.getncattr("design_mode") == SALTELLI else 1
        values = [
            np.unique(one[:], return_inverse=True)[1] if one.dtype is str else one[:]
            for one in drawn.values()
        ]
        x = np.column_stack(values).astype(float).reshape(-1, rows, len(drawn))
        f = np.where(ok, np.ma.filled(nc[of][:, level].astype(float), np.nan), np.nan).reshape(
            -1, rows
        )
        named = tuple(one.distribution.startswith("choice") for one in drawn.values())
        names, units = tuple(drawn), f" {nc[of].units}" if nc[of].units != "1" else ""
        step = float(np.max(group["c"][:])) if of == "slip_length" and group is not None else 0.0
        proved = bool(np.all(nc["unique"][:, level][ok] == 1))
    whole = np.isfinite(f).all(axis=1)
    if np.count_nonzero(whole) < 2:
        raise UsageError(f"{of} has no whole rows of the design: too few points have this number")
    f, x = f[whole], x[whole]
    confidence = f"{f'{LEVEL:.0%}'} confidence by resampling them"
    said = [f"{f.size} points of {len(f)} base points, {confidence}"]
    if rows == 1:
        said = [
            f"{f.size} points, {confidence}; totals need points of their own (mode: {SALTELLI})"
        ]
    if lost := int(np.count_nonzero(~whole)):
        which = "base points with a point that has" if rows > 1 else "points with"
        said.append(f"left out: {lost} {which} no solution or no {of}")

    gap = None if proved else jump(f[:, :2].ravel(), step, f[:, 2:].ravel())
    caption = f"Indices of {of}"
    if gap is None:
        why = (
            "every solution is certified to be the only one"
            if proved
            else "no gap among the values"
        )
        said.append(f"one side: {why}")
    else:
        f, caption = (
            (f > (gap[0] + gap[1]) / 2.0).astype(float),
            "Indices of the side on which a point lies",
        )
        share = f[:, :2].mean()
        said.append(
            f"{of} leaves a gap: {1 - share:.1%} of the points lie at {number(gap[0])}{units} or below, {share:.1%} at "
            f"{number(gap[1])}{units} or above, none between; a mean over both sides is a value that no point has"
        )
    orders = sobol(f) if rows > 1 else [correlation_ratios(x[:, 0], f[:, 0], named)]
    return SobolIndices(names, said, caption, dict(zip(ORDERS, orders, strict=False)))


def indices_text(file: Path, of: str) -> str:
    """The table of all indices, as text."""
    found = indices(file, of)
    cells = [("parameter", list(found.names))]
    for heading, (value, low, high) in found.estimates.items():
        cells.append((heading, [f"{v:.3f}" for v in value]))
        cells.append(("from … to", [f"{a:.3f} … {b:.3f}" for a, b in zip(low, high, strict=True)]))
    table = columns_table([TextColumn(*one, rank) for rank, one in enumerate(cells)])
    return wrapped(
        "\n".join([*(f"  {line}" for line in found.said), "", f"  {found.caption}:", "", table])
    )


def indices_json(file: Path, of: str) -> dict[str, Any]:
    """The same, not rounded."""
    found = indices(file, of)
    table: dict[str, Any] = {"caption": found.caption}
    for heading, estimate in found.estimates.items():
        rows = (
            dict(zip(("value", "low", "high"), one, strict=True)) for one in estimate.T.tolist()
        )
        table[heading] = dict(zip(found.names, rows, strict=True))
    return {"of": of, "said": found.said, "tables": [table]}


def sobol(f: Array, seed: int = 0) -> list[Estimate]:
    """First-order and total indices of (n, d + 2) values at A, B and the d mixtures, n ≥ 2; 0 if
    nothing varies."""
    n = len(f)
    least = (ROUNDING * np.abs(f).max()) ** 2
    f = f - f[:, :2].mean()
    A, B, AB = f[:, 0], f[:, 1], f[:, 2:]
    terms = np.column_stack(
        [A + B, A**2 + B**2, B[:, None] * (AB - A[:, None]), (A[:, None] - AB) ** 2]
    )
    weights = np.random.default_rng(seed).multinomial(n, np.full(n, 1.0 / n), RESAMPLES)
    means = np.vstack([np.ones(n), weights]) @ terms / n
    variance = means[:, 1:2] / 2.0 - (means[:, :1] / 2.0) ** 2
    d = AB.shape[1]
    ratios = np.divide(
        means[:, 2:], variance, out=np.zeros_like(means[:, 2:]), where=variance > least
    )
    return [_estimate(ratios[:, :d]), _estimate(ratios[:, d:] / 2.0)]


def correlation_ratios(x: Array, y: Array, named: tuple[bool, ...] = (), seed: int = 0) -> Estimate:
    """Var(E[y|x_i])/Var(y) from (N, d) inputs and (N,) values, in ½√N classes of equally many
    points each.

    Of independent inputs, however they were drawn, it is the first-order index. named: (d,) inputs
    with a class a value

    The share that N points in that many classes have by chance alone is taken off: 1 − (1 − η²)(N −
    1)/(N − classes).
    """
    rng, N = np.random.default_rng(seed), len(y)
    samples = [np.arange(N), *(rng.integers(0, N, (RESAMPLES // 10, N)))]
    named = named or (False,) * x.shape[1]
    return _estimate(
        np.array(
            [[_ratio(x[one, i], y[one], own) for i, own in enumerate(named)] for one in samples]
        )
    )


def _ratio(x: Array, y: Array, named: bool) -> float:
    N = len(y)
    parts = np.array_split(y[np.argsort(x, kind="stable")], max(2, math.isqrt(N) // 2))
    if named:
        parts = [y[x == value] for value in np.unique(x)]
    classes = len(parts)
    within = sum(float(((part - part.mean()) ** 2).sum()) for part in parts)
    whole = float(((y - y.mean()) ** 2).sum())
    flat = whole <= N * (ROUNDING * float(np.abs(y).max())) ** 2
    return 0.0 if flat or classes >= N else max(0.0, 1.0 - within / whole * (N - 1) / (N - classes))


def _estimate(samples: Array) -> Estimate:
    return np.vstack(
        [samples[:1], np.quantile(samples[1:], [(1 - LEVEL) / 2, (1 + LEVEL) / 2], axis=0)]
    )


def jump(
    values: Array, resolution: float = 0.0, dependent: Array | None = None
) -> tuple[float, float] | None:
    """The ends of the widest gap that no smooth distribution has by chance; None if there is none.

    A gap is a jump if it is wider than the stretch of the k nearest values on either side together with twice the
    resolution: of N values of a smooth density that happens with a chance of at most N 2^−k, here 1e-3, wherever the
    gap lies and whatever the scale.
    resolution: steps in which the values come by themselves, e.g. the length of a contact segment
    dependent:  further values, which are no independent ones: they narrow a gap, but make none
    """
    v = np.sort(values)
    k = math.ceil(math.log2(1000.0 * max(1, len(v))))
    if len(v) < 2 * k:
        return None
    at = np.arange(k - 1, len(v) - k)
    gap = v[at + 1] - v[at]
    stretch = np.maximum(v[at] - v[at - k + 1], v[at + k] - v[at + 1])
    found = np.where(gap > stretch + 2.0 * resolution, gap, 0.0)
    best = int(np.argmax(found)) if len(found) else 0
    if not len(found) or found[best] <= ROUNDING * float(np.abs(v).max()):
        return None
    low, high = float(v[at[best]]), float(v[at[best] + 1])
    if dependent is None:
        return low, high
    inside = np.sort(
        np.concatenate([[low, high], dependent[(low < dependent) & (dependent < high)]])
    )
    widest = int(np.argmax(np.diff(inside)))
    low, high = float(inside[widest]), float(inside[widest + 1])
    return (low, high) if high - low > stretch[best] + 2.0 * resolution else None
