"""Results of a solved point along the openings of contact edges.

Lengths:  openings are linear between nodes. The debonded length is that of all points of Γ_C at
          which the slip or the opening is beyond the last softening of its law, each half of a
          segment with the law of its own node
Mixity:   of the works ξ_T u_T and ξ_N s_N per area at a node, in tension
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from tcstudy.laws.laws import Laws
from tcstudy.laws.pieces import DEBONDED
from tcstudy.offline.level import Level
from tcstudy.offline.requested_outputs import of_boundaries
from tcstudy.scene.records import Scene

Array = NDArray[np.float64]
Indices = NDArray[np.intp]
Held = tuple[Array, Array]
"""Slips and openings (P, h) at the held ends of segments, as a level has them [m]."""

ROUNDING = 1e-9
"""Work below which none is done, over that of the largest traction and displacement."""


def opening_numbers(
    level: Level, scenes: Sequence[Scene], laws: Laws, v: Array, xi: Array
) -> dict[str, Array]:
    """Return results (P,) along the openings of a level by name, of a level that has some.

    laws: of rows (P, m);  v, xi: (P, m) slips and openings [m], and tractions [Pa]
    """
    held = of_boundaries(scenes, level.held_slips), of_boundaries(scenes, level.held_openings)
    return numbers_of_openings(level, held, laws, v, xi)


def numbers_of_openings(
    level: Level, held: Held, laws: Laws, v: Array, xi: Array
) -> dict[str, Array]:
    """Return results (P,) along openings, as `opening_numbers`, from what is held at their ends."""
    opening = level.opening
    assert opening is not None
    _, s_N = level.split(v)
    _, S_N = level.split(xi)
    return {
        "opening_max": np.max(s_N, axis=1),
        "peel_stress_max": np.max(S_N, axis=1, initial=0.0),
        "pressure_max": np.max(-S_N, axis=1, initial=0.0),
        "opened_length": (s_N > 0.0) @ opening.c,
        "adhesion_resultant": S_N @ opening.c,
        "mode_mixity": mode_mixity(level, laws, v, xi),
        "debonded_length": debonded_length(level, held, laws, v),
    }


def mode_mixity(level: Level, laws: Laws, v: Array, xi: Array) -> Array:
    """Return the angle (P,) of the works in both directions where their sum is largest [degree].

    It is 0 where a bond only opens and 90° where it only slides, NaN where none does work but for
    rounding.

    laws: of rows (P, m);  v, xi: (P, m) slips and openings [m], and tractions [Pa]
    """
    opening = level.opening
    assert opening is not None
    u_T, s_N = level.split(v)
    xi_T, S_N = level.split(xi)
    work_N = np.maximum(S_N, 0.0) * np.maximum(s_N, 0.0)
    work_T = np.zeros(work_N.shape)
    _, of_slip, of_opening = np.intersect1d(level.line.nodes, opening.nodes, return_indices=True)
    work_T[:, of_opening] = np.abs(xi_T * u_T)[:, of_slip]
    work = work_T + work_N
    row = np.arange(len(work))
    largest = np.argmax(work, axis=1)
    work_T = work_T[row, largest]
    work_N = work_N[row, largest]
    angle = np.degrees(np.arctan2(work_T, work_N))
    strength = np.max(laws.scales[laws.index], axis=1)
    traction = np.maximum(strength, np.max(np.abs(xi), axis=1))
    noise = ROUNDING * traction * np.max(np.abs(v), axis=1)
    return np.where(work_T + work_N > noise, angle, np.nan)


class _Halves(NamedTuple):
    """Displacements at both ends of all half segments of Γ_C, and which law each half has.

    first, second: (P, h) [m];  law: (P, h) number of the law
    """

    first: Array
    second: Array
    law: Indices

    @classmethod
    def of(cls, ends: Array, law: Indices) -> _Halves:
        """Return the halves of segments, those at their starts first.

        ends: (P, s, 2) displacements at the ends [m];  law: (P, s, 2) that of the half at an end
        """
        middle = np.mean(ends, axis=2)
        return cls(
            np.hstack([ends[..., 0], middle]),
            np.hstack([middle, ends[..., 1]]),
            np.hstack([law[..., 0], law[..., 1]]),
        )

    def at(self, share: Array) -> Array:
        """Return displacements (P, h, …) at shares of the halves."""
        first = self.first[..., None]
        return first + share * (self.second[..., None] - first)

    def shares_of(self, kinks: Array) -> Array:
        """Return the shares (P, h, K) at which the displacement passes the kinks of its law."""
        change = (self.second - self.first)[..., None]
        distance = kinks[self.law] - self.first[..., None]
        share = np.divide(distance, change, out=np.zeros(distance.shape), where=change != 0.0)
        return np.clip(share, 0.0, 1.0)

    def debonded(self, laws: Laws, share: Array) -> NDArray[np.bool_]:
        """Return whether the laws are past their last softening at shares (P, h, …)."""
        piece = laws.locate(self.at(share), self.law[..., None]).piece
        region = laws.regions.take(piece)
        return np.asarray(region == DEBONDED)


def debonded_length(level: Level, held: Held, laws: Laws, v: Array) -> Array:
    """Return the lengths (P,) of Γ_C that are debonded in either direction [m].

    A length is NaN where no law of a point has such a region.

    laws: of rows (P, m);  v: (P, m) slips and openings [m]
    """
    index = np.broadcast_to(laws.index, v.shape)
    can_debond = np.any(laws.regions == DEBONDED, axis=1)
    has_region = can_debond[index].any(axis=1)
    if not has_region.any():
        return np.full(len(v), np.nan)
    held_slips, held_openings = held
    slips = _slip_halves(level, held_slips, v, index)
    openings = _opening_halves(level, held_openings, v, index)
    shares = [half.shares_of(laws.kinks) for half in (slips, openings)]
    cuts = np.sort(np.dstack(shares))
    edge = np.zeros((*cuts.shape[:2], 1))
    start = np.dstack([edge, cuts])
    stop = np.dstack([cuts, edge + 1.0])
    middle = 0.5 * (start + stop)
    is_debonded = slips.debonded(laws, middle) | openings.debonded(laws, middle)
    lengths = np.tile(0.5 * level.line.lengths, 2)
    parts = lengths[:, None] * (stop - start)
    total = np.sum(parts, axis=(1, 2), where=is_debonded)
    return np.where(has_region, total, np.nan)


def _slip_halves(level: Level, held: Array, v: Array, index: Indices) -> _Halves:
    """Return the slips and their laws on the halves of all segments.

    held:     (P, h) slips of held ends, NaN for that of the node beside it [m]
    v, index: (P, m) displacements [m] and laws of the unknowns
    """
    line = level.line
    is_held = line.unknowns < 0
    slips, _ = level.split(v)
    laws, _ = level.split(index)
    number = np.where(is_held, line.own_law, line.unknowns)
    ends = slips[:, number]
    ends[:, is_held] = np.where(np.isnan(held), ends[:, is_held], held)
    return _Halves.of(ends, laws[:, line.own_law])


def _opening_halves(level: Level, held: Array, v: Array, index: Indices) -> _Halves:
    """Return the openings and their laws on the halves of all segments, as `_slip_halves`.

    Where an edge does not lift off its opening is 0, at which no law is debonded.
    """
    opening = level.opening
    assert opening is not None
    _, openings = level.split(v)
    _, laws = level.split(index)
    is_held = opening.unknowns < 0
    number = np.where(is_held, opening.own_law, opening.unknowns)
    openings_at_ends = openings[:, number]
    openings_at_ends[:, is_held] = held
    ends = np.zeros((len(v), len(level.line.segments), 2))
    ends[:, opening.which] = openings_at_ends
    law = np.empty(ends.shape, dtype=np.intp)
    law[:] = laws[:, :1, None]
    law[:, opening.which] = laws[:, opening.own_law]
    return _Halves.of(ends, law)
