"""Laws of the openings of contact edges, and results of a solved point along them.

An opening s_N = −u_N has the law b_N of its edge: that of `adhesion`, or none but s_N ≥ 0. Joints of
two edges have the laws of both by their shares of c, as slips have.

Lengths:  openings are linear between nodes. The debonded length is that of all points of Γ_C at
          which the slip or the opening is beyond the last softening of its law, each half of a
          segment with the law of its own node
Mixity:   of the works ξ_T u_T and ξ_N s_N per area at a node, in tension
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from tcstudy.laws.composed import EdgeLaws, law_along
from tcstudy.laws.laws import Laws
from tcstudy.laws.pieces import DEBONDED
from tcstudy.laws.shapes import unilateral
from tcstudy.scene.records import Scene

if TYPE_CHECKING:
    from tcstudy.fem.forms import ContactLine
    from tcstudy.fem.openings import OpeningLine
    from tcstudy.offline.level import Level

Array = NDArray[np.float64]
Indices = NDArray[np.intp]


def laws_of_openings(scene: Scene) -> EdgeLaws:
    """Return the law of the opening of every edge that may lift off, with its strength."""
    adhesion = scene.adhesion
    of_edge: dict[str, tuple[Laws, object]] = {}
    if isinstance(adhesion, EdgeLaws):
        of_edge = {name: (law, strength) for name, law, strength in adhesion.laws}
    elif adhesion is not None:
        of_edge = {"": (adhesion, 1.0)}
    roles = dict(scene.boundary)
    laws = []
    for name in scene.opening_edges:
        law, strength = unilateral(), 1.0
        if roles[name].normal == "adhesive":
            law, strength = of_edge[name if name in of_edge else ""]
        laws.append((name, law, strength))
    return EdgeLaws(tuple(laws))


def laws_of_unknowns(scene: Scene, line: ContactLine, opening: OpeningLine) -> Laws:
    """Return the laws of the slips and then of the openings, by unknown.

    Raises ValueError for a strength below 0.
    """
    slips = law_along(scene.friction, line.edge_names, line.edge, line.xy, line.joints)
    openings = law_along(
        laws_of_openings(scene), line.edge_names, opening.edge, opening.xy, opening.joints
    )
    number = len(slips.laws) + openings.node_index(opening.m)
    return Laws.of(
        [*slips.laws, *openings.laws], np.concatenate([slips.node_index(line.m), number])
    )


def opening_numbers(
    level: Level, scenes: Sequence[Scene], laws: Laws, v: Array, xi: Array
) -> dict[str, Array]:
    """Return results (P,) along the openings of a level by name, of a level that has some.

    laws: of rows (P, m);  v, xi: (P, m) slips and openings [m], and tractions [Pa]
    """
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
        "mode_mixity": mode_mixity(level, v, xi),
        "debonded_length": debonded_length(level, scenes, laws, v),
    }


def mode_mixity(level: Level, v: Array, xi: Array) -> Array:
    """Return the angle (P,) of the works in both directions where their sum is largest [degree].

    It is 0 where a bond only opens and 90° where it only slides, NaN where none does work.

    v, xi: (P, m) slips and openings [m], and tractions [Pa]
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
    angle = np.degrees(np.arctan2(work_T[row, largest], work_N[row, largest]))
    return np.where(work[row, largest] > 0.0, angle, np.nan)


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
        place = laws.locate(self.at(share), self.law[..., None])
        return np.asarray(laws.regions.take(place.piece) == DEBONDED)


def debonded_length(level: Level, scenes: Sequence[Scene], laws: Laws, v: Array) -> Array:
    """Return the lengths (P,) of Γ_C that are debonded in either direction [m].

    A length is NaN where no law of a point has such a region.

    laws: of rows (P, m);  v: (P, m) slips and openings [m]
    """
    index = np.broadcast_to(laws.index, v.shape)
    slips = _slip_halves(level, scenes, v, index)
    openings = _opening_halves(level, scenes, v, index)
    shares = np.sort(np.dstack([slips.shares_of(laws.kinks), openings.shares_of(laws.kinks)]))
    edge = np.zeros((*shares.shape[:2], 1))
    start = np.dstack([edge, shares])
    stop = np.dstack([shares, edge + 1.0])
    middle = 0.5 * (start + stop)
    is_debonded = slips.debonded(laws, middle) | openings.debonded(laws, middle)
    lengths = np.tile(0.5 * level.line.lengths, 2)[:, None]
    total = np.sum(lengths * (stop - start), axis=(1, 2), where=is_debonded)
    has_region = np.any(laws.regions == DEBONDED, axis=1)[index].any(axis=1)
    return np.where(has_region, total, np.nan)


def _slip_halves(level: Level, scenes: Sequence[Scene], v: Array, index: Indices) -> _Halves:
    """Return the slips and their laws on the halves of all segments.

    v, index: (P, m) displacements [m] and laws of the unknowns
    """
    line = level.line
    is_held = line.unknowns < 0
    slips, laws = level.split(v)[0], level.split(index)[0]
    ends = slips[:, np.where(is_held, line.own_law, line.unknowns)]
    held = of_boundaries(scenes, level.held_slips)
    ends[:, is_held] = np.where(np.isnan(held), ends[:, is_held], held)
    return _Halves.of(ends, laws[:, line.own_law])


def _opening_halves(level: Level, scenes: Sequence[Scene], v: Array, index: Indices) -> _Halves:
    """Return the openings and their laws on the halves of all segments, as `_slip_halves`.

    Where an edge does not lift off its opening is 0, at which no law is debonded.
    """
    opening = level.opening
    assert opening is not None
    openings, laws = level.split(v)[1], level.split(index)[1]
    is_held = opening.unknowns < 0
    some = openings[:, np.where(is_held, opening.own_law, opening.unknowns)]
    some[:, is_held] = of_boundaries(scenes, level.held_openings)
    ends = np.zeros((len(v), len(level.line.segments), 2))
    ends[:, opening.which] = some
    law = np.repeat(laws[:, :1], ends[0].size, axis=1).reshape(ends.shape)
    law[:, opening.which] = laws[:, opening.own_law]
    return _Halves.of(ends, law)


def of_boundaries(scenes: Sequence[Scene], values: Callable[[Scene], Array]) -> Array:
    """Return values (P, …) that depend on the boundary of scenes, made once for each boundary."""
    scene_of_boundary = {id(scene.boundary): scene for scene in scenes}
    of_boundary = {key: values(scene) for key, scene in scene_of_boundary.items()}
    return np.array([of_boundary[id(scene.boundary)] for scene in scenes])
