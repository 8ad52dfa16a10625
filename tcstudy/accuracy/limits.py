"""Limits h → 0 of results of several meshes, with an uncertainty that holds the limit.

With the differences d_1, d_2, … of the results of consecutive meshes, the newest first, and the
observed order p of the three finest meshes (d_1 and d_2 of the same sign, |d_1| smaller):

    limit:        q_n + d_1/(r^p̄ − 1),                              p̄: p clipped to [1, 2]
    step:         max(|d_1|/(r^p̂ − 1), 0.6 max_k |d_k| h_n/h_k),     p̂: p clipped to [½, 2]
    uncertainty:  max(factor · step, unresolved)

unresolved is at most 4 max_k |d_k| h_n/h_k, except of a slip length. r is the ratio of the two
finest mesh sizes and h_k the finer one of the two meshes of d_k. Where the last differences turn
back or do not fall, the limit is the finest result and p̂ = ½.

The clip keeps a lucky small or large order from deciding (P. J. Roache, Verification and Validation
in Computational Science and Engineering, 1998; L. Eça and M. Hoekstra, J. Comput. Phys. 262 (2014)
104–130). The older differences stay in the step since one small difference may be chance. Results
that are sums over the cells of Γ_C move by whole cells, which `unresolved` allows for. The factors
hold at least 95 % of the limits of random scenes that finer levels give to a tenth of the error:
`python -m tests.benchmarks.limits`.
"""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
NAN = float("nan")

MIN_LEVELS, MAX_LEVELS = 3, 5
"""Levels below which no limit is given, as two say nothing of the order, and the finest levels that
count where there are more."""
MIN_ORDER, MIN_CENTRE_ORDER, MAX_ORDER = 0.5, 1.0, 2.0
"""Orders that the uncertainty and the limit rely on at least, and both at most."""
MEMORY = 0.6
"""Part of an older difference, scaled with h, that the step is never below."""
TURNS = 3
"""Finest differences that must have one sign for their order to count."""
ROUNDING = 1e-12
"""Relative difference of two results below which they are equal."""
NO_SLIP = 1e-9
"""Part of the largest slip below which a slip has no sign."""
FACTORS = {
    "energy": (0.5, 0.5, 0.5),
    "friction_resultant": (2.0, 2.0, 1.5),
    "slip_length": (1.0, 1.0, 1.0),
    "u_T_max": (4.0, 3.0, 2.5),
    "opening_max": (4.0, 3.0, 2.5),
    "adhesion_resultant": (2.0, 2.0, 1.5),
    "opened_length": (2.0, 2.0, 2.0),
    "debonded_length": (1.0, 1.0, 1.0),
}
"""Uncertainty over the step by quantity: of three, of four, of five levels."""
LENGTHS = frozenset({"slip_length", "opened_length", "debonded_length"})
"""Sums of whole cells of Γ_C."""
MOST_UNRESOLVED = 4.0
"""Scaled difference that the cells of Γ_C explain at most of a result that is no sum of cells.

Where equilibrium fixes ∫ξ, it does not follow the cells."""
JUMP_SHARE = 0.25
"""Part of a jump of ξ between neighbours, times their cell, that the place of the front may change
∫ξ by."""


@dataclass(frozen=True)
class StickSlip:
    """The contact line of the finest mesh, as far as it limits what that mesh can resolve.

    c: (m,) cells [m];  v, xi: (m,) u_T [m] and −S_T [Pa];  sticks: (m,)
    neighbours: (s, 2) contact nodes beside each other;  can_stick: whether the law lets nodes stick
    """

    c: Array
    v: Array
    xi: Array
    sticks: NDArray[np.bool_]
    neighbours: NDArray[np.intp]
    can_stick: bool

    @property
    def signs(self) -> Array:
        """(m,) 0 where a node sticks or its slip is rounding, else the sign of its slip."""
        still = np.abs(self.v) <= NO_SLIP * np.abs(self.v).max(initial=0.0)
        return np.where(self.sticks | still, 0.0, np.sign(self.v))

    @property
    def order(self) -> str:
        """Stick (0) and slip (+, −) in their order along Γ_C, "+0+"."""
        return "".join("-0+"[int(sign) + 1] for sign, _ in itertools.groupby(self.signs))

    def unresolved(self, name: str) -> float:
        """Return the change of a result that the cells of this mesh cannot show.

        lengths:    every cell between nodes of different state, at least the largest cell
        resultants: the jumps of ξ between such nodes, or a zone of stick that no node shows
        """
        if not len(self.c):
            return 0.0
        first, second = self.neighbours.T
        changes = self.signs[first] != self.signs[second]
        cells = 0.5 * (self.c[first] + self.c[second])[changes]
        largest_cell = float(self.c.max())
        if name in LENGTHS:
            return max(float(cells.sum()), largest_cell)
        if name in ("friction_resultant", "adhesion_resultant"):
            jumps = np.abs(self.xi[first] - self.xi[second])[changes]
            hidden_zone = 0.0
            if self.can_stick and not changes.any():
                hidden_zone = 0.5 * float(np.abs(self.xi).max()) * largest_cell
            return JUMP_SHARE * max(float(jumps @ cells), hidden_zone)
        return 0.0


@dataclass(frozen=True)
class Limit:
    """A limit with its uncertainty, and the order that it was extrapolated with; NaN where there is
    none."""

    value: float = NAN
    uncertainty: float = NAN
    order: float = NAN


def limit_of(name: str, h: Array, q: Array, unresolved: float = 0.0) -> Limit:
    """Return the limit of a result from its values q (levels,) on meshes of size h, coarse to fine.

    name:       of FACTORS
    unresolved: the least uncertainty, see `StickSlip.unresolved`
    NaN values, of levels that were not solved, are left out; fewer than MIN_LEVELS have no limit.
    """
    known = np.isfinite(q)
    h, q = h[known][-MAX_LEVELS:], q[known][-MAX_LEVELS:]
    if len(q) < MIN_LEVELS:
        return Limit()
    differences = np.diff(q)
    finest, last = float(q[-1]), float(differences[-1])
    if np.abs(differences).max() <= ROUNDING * np.abs(q).max():
        return Limit(finest, unresolved)
    ratio = h[-2] / h[-1]
    order = observed_order(h, differences)
    limit, centre_order, step_order = finest, NAN, MIN_ORDER
    if math.isfinite(order):
        centre_order = min(max(order, MIN_CENTRE_ORDER), MAX_ORDER)
        step_order = min(max(order, MIN_ORDER), MAX_ORDER)
        limit = finest + last / (ratio**centre_order - 1.0)
    scaled_difference = float(np.max(np.abs(differences) * h[-1] / h[1:]))
    step = max(abs(last) / (ratio**step_order - 1.0), MEMORY * scaled_difference)
    if name not in LENGTHS:
        unresolved = min(unresolved, MOST_UNRESOLVED * scaled_difference)
    factor = FACTORS[name][len(q) - MIN_LEVELS]
    return Limit(float(limit), float(max(factor * step, unresolved)), centre_order)


def observed_order(h: Array, differences: Array) -> float:
    """Return the order p of q(h) = q* + C h^p through the three finest meshes.

    NaN where the finest differences turn back or do not fall. Orders beyond the bounds that are
    used anyway are returned as these bounds.
    """
    last_signs = np.sign(differences[-TURNS:])
    if np.any(last_signs != last_signs[0]) or last_signs[0] == 0.0:
        return NAN
    coarse, middle = float(h[-3] / h[-1]), float(h[-2] / h[-1])
    fall = float(differences[-2] / differences[-1])
    if fall <= math.log(coarse / middle) / math.log(middle):
        return NAN

    def excess(order: float) -> float:
        return (coarse**order - middle**order) / (middle**order - 1.0) - fall

    if excess(MIN_ORDER) >= 0.0:
        return MIN_ORDER
    if excess(MAX_ORDER) <= 0.0:
        return MAX_ORDER
    # a run imports this module's neighbours and needs no root finder
    from scipy.optimize import brentq

    return float(brentq(excess, MIN_ORDER, MAX_ORDER, xtol=1e-12))
