"""Which parameter a number comes from: Sobol indices of a design made for them, and where solutions jump.

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

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
RESAMPLES, LEVEL = 1000, 0.95
"""Bootstrap resamples of rows, and the confidence of their intervals."""
ROUNDING = 1e-9
"""Differences of values, relative to the largest, that solutions do not tell apart."""


@dataclass(frozen=True, eq=False)
class Index:
    """(d,) values and the ends of their confidence intervals."""

    value: Array
    low: Array
    high: Array


def sobol(f: Array, seed: int = 0) -> tuple[Index, Index]:
    """First-order and total indices of (n, d + 2) values at A, B and the d mixtures; 0 if nothing varies.

    Intervals are percentiles of resampled rows. Raises ValueError for fewer than two rows.
    """
    n = len(f)
    if n < 2:
        raise ValueError("indices need two rows at least")
    least = (ROUNDING * np.abs(f).max()) ** 2
    f = f - f[:, :2].mean()
    A, B, AB = f[:, 0], f[:, 1], f[:, 2:]
    terms = np.column_stack([A + B, A**2 + B**2, B[:, None] * (AB - A[:, None]), (A[:, None] - AB) ** 2])
    weights = np.random.default_rng(seed).multinomial(n, np.full(n, 1.0 / n), RESAMPLES)
    means = np.vstack([np.ones(n), weights]) @ terms / n
    variance = means[:, 1:2] / 2.0 - (means[:, :1] / 2.0) ** 2
    d = AB.shape[1]
    ratios = np.divide(means[:, 2:], variance, out=np.zeros_like(means[:, 2:]), where=variance > least)
    return _estimate(ratios[:, :d]), _estimate(ratios[:, d:] / 2.0)


def correlation_ratios(x: Array, y: Array, named: tuple[bool, ...] = (), seed: int = 0) -> Index:
    """Var(E[y|x_i])/Var(y) from (N, d) inputs and (N,) values, in ½√N classes of equally many points each.

    Of independent inputs, however they were drawn, it is the first-order index. named: (d,) inputs with a class a value

    The share that N points in that many classes have by chance alone is taken off: 1 − (1 − η²)(N − 1)/(N − classes).
    """
    rng, N = np.random.default_rng(seed), len(y)
    samples = [np.arange(N), *(rng.integers(0, N, (RESAMPLES // 10, N)))]
    named = named or (False,) * x.shape[1]
    return _estimate(np.array([[_ratio(x[one, i], y[one], own) for i, own in enumerate(named)] for one in samples]))


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


def _estimate(samples: Array) -> Index:
    low, high = np.quantile(samples[1:], [(1 - LEVEL) / 2, (1 + LEVEL) / 2], axis=0)
    return Index(samples[0], low, high)


def jump(values: Array, resolution: float = 0.0, dependent: Array | None = None) -> tuple[float, float] | None:
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
    inside = np.sort(np.concatenate([[low, high], dependent[(low < dependent) & (dependent < high)]]))
    widest = int(np.argmax(np.diff(inside)))
    low, high = float(inside[widest]), float(inside[widest + 1])
    return (low, high) if high - low > stretch[best] + 2.0 * resolution else None
