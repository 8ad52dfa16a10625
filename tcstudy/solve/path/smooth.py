"""Piecewise-linear stand-ins for laws with exponential pieces, with a guaranteed interpolation error."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from tcstudy.scene.friction import FrictionLaw

Array = NDArray[np.float64]

MAX_CELLS = 100_000
"""Cells of one piece; a finer approximation than this is a mistake in the tolerance."""


def piecewise_linear(law: FrictionLaw, tolerance: float, s_max: float) -> FrictionLaw:
    """The law with every exponential piece replaced by chords, |b − b_h| ≤ tolerance · b_scale on [−s_max, s_max].

    tolerance: relative to law.b_scale
    s_max:     largest slip of interest [m]; beyond it the exponential part stays at its last value, and it is
               frozen earlier where what is left of it is below the tolerance

    A chord of a exp(−rs) between x and x + h errs by at most |a| r² h² e^{−rx}/8 (r > 0). The cells follow that
    bound: equal steps in ∫ √|b″| ds. Kinks of the law are kept bitwise, and so is an odd law's symmetry.
    Raises ValueError for a tolerance or s_max that is not positive, and GrowthError if the part that is cut off is
    what satisfied (15).
    """
    if not (tolerance > 0.0 and s_max > 0.0 and np.isfinite(s_max)):
        raise ValueError(f"tolerance and s_max must be positive and finite, not {tolerance:g} and {s_max:g}")
    if law.piecewise_linear:
        return law
    allowed = tolerance * law.b_scale
    ends = np.concatenate([[-np.inf], law.kinks, [np.inf]])
    kinks: list[float] = []
    pieces: list[tuple[float, float, float]] = []
    for k in range(len(law.q)):
        nodes = _nodes(law, k, float(ends[k]), float(ends[k + 1]), s_max, allowed)
        kinks += [*nodes[1:-1], *([nodes[-1]] if k + 1 < len(law.q) else [])]
        pieces += _chords(law, k, nodes)
    s_0, b_0, q = (np.array(column) for column in zip(*pieces, strict=True))
    zero = np.zeros(len(q))
    result = FrictionLaw(f"{law.name}, piecewise linear", np.array(kinks), s_0, b_0, q, zero, zero)
    result.check_growth()
    return result


def _nodes(law: FrictionLaw, k: int, left: float, right: float, s_max: float, allowed: float) -> list[float]:
    """Ends of the chords of piece k, its own ends included (±∞ where it has none)."""
    a, r, anchor = abs(float(law.a[k])), float(law.r[k]), float(law.s_0[k])
    if a == 0.0 or r == 0.0:
        return [left, right]
    if r < 0.0:  # the mirror image, so that an odd law stays odd to the bit
        return [-s for s in _decaying(a, -r, -anchor, -right, -left, s_max, allowed)[::-1]]
    return _decaying(a, r, anchor, left, right, s_max, allowed)


def _decaying(
    a: float, r: float, anchor: float, left: float, right: float, s_max: float, allowed: float
) -> list[float]:
    """Nodes for a exp(−r (s − anchor)), a, r > 0, between left and right."""
    faded = anchor + np.log(a / allowed) / r  # beyond it less than `allowed` is left
    first, last = max(left, -s_max), min(right, s_max)
    if not np.isfinite(right):
        last = min(last, max(faded, first))
    if last <= first:
        return [left, right]

    # √(b″/(8·allowed)) integrated from s to the end; a cell of length 1 in this measure has half its bound each side
    def measure(s: float) -> float:
        return float(np.sqrt(a / (8.0 * allowed)) * np.exp(-0.5 * r * (s - anchor)))

    total = measure(first) - measure(last)
    cells = max(1, int(np.ceil(total)))
    while True:
        if cells > MAX_CELLS:
            raise ValueError(f"more than {MAX_CELLS} chords are needed; the tolerance is too small")
        levels = measure(first) - total * np.arange(1, cells) / cells
        inner = anchor - 2.0 / r * np.log(levels / np.sqrt(a / (8.0 * allowed)))
        nodes = np.concatenate([[first], inner, [last]])
        if np.max(_chord_errors(a, r, nodes - anchor)) <= allowed:
            break
        cells += 1 + cells // 20
    outer = [left] if left < first else []
    return [*outer, *(float(s) for s in nodes), *([right] if right > last else [])]


def _chord_errors(a: float, r: float, nodes: Array) -> Array:
    """Largest distance of a exp(−r s) from each chord: h²/8 · max|b″| over the cell."""
    return np.asarray(a * r * r * np.exp(-r * nodes[:-1]) * np.diff(nodes) ** 2 / 8.0)


def _chords(law: FrictionLaw, k: int, nodes: list[float]) -> list[tuple[float, float, float]]:
    """(anchor, value there, slope) of the lines between consecutive nodes, each hung on its end nearer to s = 0.

    Beyond the first and last finite node it is the linear part that goes on.
    """
    q, a = float(law.q[k]), float(law.a[k])
    chords = []
    for x, y in pairwise(nodes):
        inner = bool(np.isfinite(x) and np.isfinite(y))
        anchor = (x if abs(x) <= abs(y) else y) if inner else x if np.isfinite(x) else y
        if a == 0.0 or not np.isfinite(anchor):
            chords.append((float(law.s_0[k]), float(law.b_0[k]) + a, q))
            continue
        slope = float((law.value(y, k) - law.value(x, k)) / (y - x)) if inner else q
        chords.append((anchor, float(law.value(anchor, k)), slope))
    return chords
