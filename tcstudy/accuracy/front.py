"""What is worth its cost: the points that no other beats in cost and error together."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


def dominated(cost: Array, error: Array) -> NDArray[np.bool_]:
    """(n,) points for which another costs no more and errs no more, and less in one of the two.

    Points with NaN are dominated and dominate nothing.
    """
    known = np.isfinite(cost) & np.isfinite(error)
    out = np.ones(len(cost), dtype=bool)
    for i in np.flatnonzero(known):
        no_worse = known & (cost <= cost[i]) & (error <= error[i])
        better = no_worse & ((cost < cost[i]) | (error < error[i]))
        out[i] = bool(better.any())
    return out
