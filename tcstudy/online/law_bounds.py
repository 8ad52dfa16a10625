"""Range and least slope of b on intervals of slip, for laws in tables; as tcstudy/solve/bounds.py, law by law.

A piece q (s − s_0) + b_0 + a exp(−r (s − s_0)) has a monotone slope, so that its ends within an interval, and for the
range the one slip where b′ = 0, decide.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from tcstudy.online.law_tables import LawTables
from tcstudy.scene.friction import DOWN

Array = NDArray[np.float64]
Index = NDArray[np.intp]


def value_range(tables: LawTables, law: Index, low: Array, high: Array) -> tuple[Array, Array]:
    """(least, largest) value of the filled graph of b on [low, high] (shape of low); law broadcasts with low [Pa]."""
    least, largest = np.full(low.shape, np.inf), np.full(low.shape, -np.inf)

    def meet(inside: NDArray[np.bool_] | bool, value: Array) -> None:
        np.minimum(least, value, out=least, where=inside)
        np.maximum(largest, value, out=largest, where=inside)

    for s in (low, high):
        at = tables.locate(law, s)
        meet(True, tables.value(s, at.piece))
        if np.any(at.on):
            meet(at.on, tables.value(s, at.piece + at.on))
    for kink in range(tables.kinks.shape[1]):
        s = tables.kinks[:, kink]
        inside = (low <= s[law]) & (s[law] <= high)
        if np.any(inside):
            s, piece = np.where(np.isfinite(s), s, 0.0), tables.first + kink
            meet(inside, tables.value(s, piece)[law])
            meet(inside, tables.value(s, piece + 1)[law])
    if not tables.linear:
        turning, value = _turning_points(tables)
        for column in np.flatnonzero(np.any(np.isfinite(turning), axis=0)):
            s = turning[:, column][law]
            meet((low <= s) & (s <= high), value[:, column][law])
    return least, largest


def _turning_points(tables: LawTables) -> tuple[Array, Array]:
    """(L, K+1) slip where b′ = q − a r exp(−r (s − s_0)) vanishes inside a piece, NaN where it does not; b there."""
    with np.errstate(divide="ignore", invalid="ignore"):
        s = tables.s_0 - np.log(tables.q / (tables.a * tables.r)) / tables.r
        s = np.where(np.isfinite(s) & (tables.lower < s) & (s < tables.upper), s, np.nan)
    piece = tables.first[:, None] + np.arange(s.shape[1])
    return s, tables.value(np.where(np.isnan(s), 0.0, s), piece)


def least_slope(tables: LawTables, law: Index, low: Array, high: Array) -> Array:
    """inf (b(s₁) − b(s₂))/(s₁ − s₂) over [low, high]: −∞ with a down-jump in it (shape of low) [Pa/m]."""
    least = np.full(low.shape, np.inf)
    for piece in range(tables.q.shape[1]):
        first, last = (tables.lower[:, piece])[law], (tables.upper[:, piece])[law]
        met = (low <= last) & (first <= high)
        if tables.linear:
            np.minimum(least, tables.q[:, piece][law], out=least, where=met)
        elif np.any(met):
            address = np.broadcast_to((tables.first + piece)[law], low.shape)[met]
            for s in (np.maximum(low, first)[met], np.minimum(high, last)[met]):
                least[met] = np.minimum(least[met], tables.slope(s, address))
    for kink in np.flatnonzero(np.any(tables.kinds == DOWN, axis=0)):
        s = np.where(tables.kinds[:, kink] == DOWN, tables.kinks[:, kink], np.nan)[law]
        least[(low <= s) & (s <= high)] = -np.inf
    return least


def largest_push(tables: LawTables) -> Array:
    """(L,) sup over s of −sign(s) b(s), at least 0: how hard friction may push slip on (finite by (15)) [Pa]."""
    reach, every = far(tables), np.arange(len(tables.q), dtype=np.intp)
    least, _ = value_range(tables, every, np.zeros(len(reach)), reach)
    _, largest = value_range(tables, every, -reach, np.zeros(len(reach)))
    return np.maximum(0.0, np.maximum(-least, largest))


def far(tables: LawTables) -> Array:
    """(L,) slip beyond which a law has no kink and its exponentials have decayed [m]."""
    kinks = np.where(np.isfinite(tables.kinks), np.abs(tables.kinks), 0.0)
    decays = np.divide(40.0, np.abs(tables.r), out=np.zeros(tables.r.shape), where=tables.r != 0.0)
    return np.asarray(2.0 * np.max(kinks, axis=1) + np.max(decays, axis=1))
