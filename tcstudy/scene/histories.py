"""Load histories of a study, and what a contact line remembers from one load to the next.

The scene's law gives the monotone virgin curve τ(κ) = b(s > 0). Beside it a node has a state, and
the law of the next step is

    friction         sgn(s − a) τ(κ + |s − a|)                 a last slip, κ = Σ|Δv|
    elastic-plastic  ±k (|s − p| − Δp), at most τ(κ + Δp)      p plastic slip, κ = Σ|Δp|
    damage           τ(κ) s/κ for |s| ≤ κ, beyond it τ(|s|)    κ = max |v|

Literature: Ortiz & Pandolfi, Int. J. Numer. Meth. Engng 44 (1999) 1267–1282 (damage, κ the largest
opening); Simo & Hughes, Computational Inelasticity (1998) (return mapping). Here are only the
records of a study; contact/history solves.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Literal, TypeVar, get_args

import numpy as np
from numpy.typing import NDArray

from tcstudy.laws.composed import EdgeLaws, Joints
from tcstudy.laws.laws import Laws
from tcstudy.laws.pieces import UP

MemoryName = Literal["friction", "elastic-plastic", "damage", "none"]
MEMORIES: tuple[MemoryName, ...] = ("friction", "elastic-plastic", "damage")
"""Memories that a study may name; with "none" a history goes to and fro on paths of its loads."""
HistoryBranch = Literal["continued", "lowest"]
HISTORY_BRANCHES: tuple[HistoryBranch, ...] = get_args(HistoryBranch)
Keys = tuple[str, ...]
T = TypeVar("T")
V = TypeVar("V", float, NDArray[np.float64])
AT_REST = 1e-9
"""A node rests in a step if its slip changes by less than this part of the largest slip."""
MOST_STEPS = 100_000
"""Largest number of steps of one history."""
DECAY_LENGTHS = 40.0
"""Decay lengths after which the last piece of a law has reached its level."""
START = "start"
"""Name of step 0, the study as it is written: its loads are put on the virgin body."""


class UnfitLaw(ValueError):
    """A memory cannot be made of this law; the text says why and what to do."""


@dataclass(frozen=True)
class Memory:
    """The memory of the nodes of a contact line.

    name:      one of MEMORIES, or "none"
    stiffness: k of `elastic-plastic`, None for the others [Pa/m]
    edges:     the memory of each contact edge, if they differ
    """

    name: MemoryName
    stiffness: float | None = None
    edges: tuple[tuple[str, MemoryName], ...] = ()

    @property
    def words(self) -> str:
        """The memory in words, for reports."""
        return ", ".join(f"{edge}: {name}" for edge, name in self.edges) or self.name

    @property
    def names(self) -> set[MemoryName]:
        """The names of the memories of all edges."""
        return {name for _, name in self.edges} or {self.name}

    def by_node(
        self, law: Laws, edge_names: Sequence[str], edge: NDArray[np.integer], joints: Joints
    ) -> NDArray[np.str_] | None:
        """Return (m,) names of the memories of nodes on edges by number; None where all have one.

        A node shared by edges of different memories has one memory for the law of both: `damage` if
        an edge has it and it can be made of that law, else `friction`, which is an error of first
        order in the length of its cell.
        """
        if not self.edges:
            return None
        name_of_edge = np.array([dict(self.edges)[name] for name in edge_names])
        names = name_of_edge[edge]
        damage = replace(self, name="damage")
        for node, name_before in zip(joints.node, name_of_edge[joints.edge], strict=True):
            if name_before == names[node]:
                continue
            is_damage = "damage" in (name_before, names[node])
            if is_damage and not any(damage.unfit(law.single(int(node)))):
                names[node] = "damage"
            else:
                names[node] = "friction"
        return names

    def fits(self, friction: Laws | EdgeLaws) -> None:
        """Raise UnfitLaw unless the memory of every edge can be made of its law."""
        if isinstance(friction, Laws):
            laws = [("", friction)]
        else:
            laws = [(edge, law) for edge, law, _ in friction.laws]
        memories = self.edges or (("", self.name),)
        for edge, law in laws:
            for memory_edge, name in memories:
                is_of_all = not memory_edge or not edge
                if is_of_all or memory_edge == edge:
                    replace(self, name=name).check(law)

    def check(self, law: Laws) -> None:
        """Raise UnfitLaw unless the memory `name` can be made of every node's law."""
        for single_law in law.laws:
            for reason in self.unfit(single_law):
                raise UnfitLaw(reason)

    def unfit(self, law: Laws) -> Iterator[str]:
        """Yield reasons why the memory cannot be made of one law, each with its remedy.

        Every law of slip is odd and opposes slip everywhere; that of an opening does so where it is
        open, and takes damage alone. Backward Euler needs a return map with one
        answer, so that a law softens less steeply than the spring. Where τ(κ)/κ rises, a film would
        heal by being pulled.
        """
        if law.vanishes or self.name == "none":
            return
        if law.closing is not None and self.name != "damage":
            yield (
                f"{self.name} is a memory of slips, and {law.name} is a law of openings; "
                "give the edge memory: damage"
            )
        elif law.closing is None and not is_odd(law):
            yield (
                f"a history needs an odd law, b(-s) = -b(s), and {law.name} is not: "
                "the internal variables have no sign; leave out odd: false"
            )
        kinks = law.kinks[law.kinks > 0.0]
        starts = np.concatenate([[0.0], kinks])
        least = float(np.min(np.concatenate([law.b(starts, +1), law.b(kinks, -1)])))
        if least < -1e-12 * law.b_scale:
            yield (
                f"a history needs a law that opposes slip, but b decreases to {least:g} Pa at s "
                "> 0 "
                "and would push; let it end at 0"
            )
        if self.name == "elastic-plastic":
            yield from self._unfit_for_plasticity(law)
        elif self.name == "damage":
            yield from _unfit_for_damage(law, starts)

    def _unfit_for_plasticity(self, law: Laws) -> Iterator[str]:
        k = self.stiffness
        if k is None or not (np.isfinite(k) and k > 0.0):
            yield "elastic-plastic memory needs a stiffness above 0; add stiffness: 100 MPa/mm"
        if not law.piecewise_linear:
            yield (
                f"elastic-plastic memory needs a law of straight pieces, and {law.name} has "
                "exponential ones; give it by its points (piecewise-linear)"
            )
        if len(_up_jumps(law)):
            yield (
                "elastic-plastic memory needs a law without up-jumps at s > 0; "
                "make them steep slopes"
            )
        if not law.omega < (k or 0.0):
            yield (
                f"the spring is too soft for the law: stiffness k = {k:g} Pa/m must be above the "
                f"maximum softening slope h = {law.omega:g} Pa/m, or the slip of a step has "
                "several values; "
                "take a stiffer spring or a law that softens more slowly"
            )


def _up_jumps(law: Laws) -> NDArray[np.float64]:
    """Return the slips s > 0 at which b jumps up [m]."""
    return law.kinks[(law.kinds == UP) & (law.kinks > 0.0)]


def _unfit_for_damage(law: Laws, starts: NDArray[np.float64]) -> Iterator[str]:
    """Yield reasons why the secant b(s)/s of a law rises somewhere.

    starts: slips at which the pieces with s > 0 begin [m]
    """
    need = "damage needs a law whose secant b(s)/s does not increase"
    remedy = "use memory: friction, or a law that only softens"
    up_jumps = _up_jumps(law)
    if len(up_jumps):
        yield f"{need}, but b jumps up at s = {up_jumps[0]:g} m; {remedy}"
    pieces = int(law.piece(0.0, +1)) + np.arange(len(starts))
    last_rate = float(law.rate[pieces[-1]]) or 1.0
    ends = np.append(starts[1:], starts[-1] + DECAY_LENGTHS / last_rate)
    s = np.stack([starts, ends], axis=1).ravel()
    piece = np.repeat(pieces, 2)
    value = law.value(s, piece)
    slope = law.slope(s, piece)
    size = np.maximum(np.abs(value), np.abs(slope * s))
    size = np.maximum(size, law.b_scale)
    for i in np.flatnonzero(value - slope * s < -1e-12 * size):
        secant = value[i] / (s[i] or np.inf)
        yield (
            f"{need}, but b climbs faster than its secant at "
            f"s = {s[i]:g} m (slope {slope[i]:g}, secant {secant:g} Pa/m); {remedy}"
        )


def is_odd(law: Laws) -> bool:
    """Return whether b(−s) = −b(s) to the bit.

    Every shape but a one-sided piecewise-linear one is made so.
    """
    mirror = slice(None, None, -1)
    same_kinks = np.array_equal(law.kinks, -law.kinks[mirror])
    same_levels = law.b_0 == -law.b_0[mirror]
    same_slopes = law.q == law.q[mirror]
    same_terms = law.a == -law.a[mirror]
    same_anchors = (law.s_0 == -law.s_0[mirror]) | ((law.q == 0.0) & (law.a == 0.0))
    same_rates = (law.r == -law.r[mirror]) | (law.a == 0.0)
    parts = [same_levels, same_slopes, same_terms, same_anchors, same_rates]
    return bool(same_kinks and np.all(parts))


def short_names(paths: Sequence[Keys]) -> tuple[str, ...]:
    """Return the last words of key paths, or whole paths where these do not tell them apart."""
    last_words = list[str]()
    for keys in paths:
        if "points" in keys[1:]:
            last_words.append("_".join(keys[keys.index("points", 1) :]))
        else:
            last_words.append(keys[-1])
    names = list[str]()
    for name, keys in zip(last_words, paths, strict=True):
        names.append(name if last_words.count(name) == 1 else "_".join(keys))
    return tuple(names)


@dataclass(frozen=True)
class HistoryLine:
    """Loads that change together, in equal steps.

    values: the loads at the end of the line, by key path [SI]; others stay as they are
    count:  number of steps
    name:   name of the last step
    """

    values: tuple[tuple[Keys, float], ...]
    count: int
    name: str


@dataclass(frozen=True)
class HistoryPlan:
    """The load history of every scene of a study (section `history`).

    lines:      one after the other, `repeat` times
    parameters: (key path, CF units, value in the scene) of every load that changes
    branch:     the solution of a step: "continued" along the path from the last state, or "lowest",
                the lowest found
    level:      mesh level, None for the finest
    """

    memory: Memory
    lines: tuple[HistoryLine, ...]
    parameters: tuple[tuple[Keys, str, float], ...]
    repeat: int = 1
    branch: HistoryBranch = "continued"
    level: int | None = None

    @property
    def steps(self) -> int:
        """The number of steps, without step 0."""
        return self.repeat * sum(line.count for line in self.lines)

    def of(self, levels: Sequence[T]) -> T:
        """Return that of the levels of a study on which the history is followed."""
        return levels[-1 if self.level is None else self.level]

    @property
    def names(self) -> tuple[str, ...]:
        """The names of the loads that change, as short as tells them apart."""
        return short_names([keys for keys, _, _ in self.parameters])

    def stations(self) -> list[dict[Keys, float]]:
        """Return the loads at step 0 and at the ends of all lines of the first two cycles.

        Later cycles repeat the second. In the first cycle a load that is not named yet has the
        value of the study, later the one that the cycle before has left.
        """
        values = {keys: value for keys, _, value in self.parameters}
        stations = [dict(values)]
        for line in self.lines * min(self.repeat, 2):
            values |= dict(line.values)
            stations.append(dict(values))
        return stations

    def schedule(self) -> Iterator[tuple[int, int, float, str, int]]:
        """Yield every step but step 0 as (station before, station after, share, name, cycle).

        The share is that of the way between the stations; the name is "" but at the end of a line;
        cycles count from 1.
        """
        for cycle in range(1, self.repeat + 1):
            first_station = 0 if cycle == 1 else len(self.lines)
            for station, line in enumerate(self.lines, first_station):
                for step in range(1, line.count + 1):
                    name = line.name if step == line.count else ""
                    yield station, station + 1, step / line.count, name, cycle

    def along(self, at_stations: Sequence[V]) -> list[V]:
        """Return a quantity that is affine in the loads at every step, from that at the stations.

        Step 0 is included.
        """
        steps = [at_stations[0]]
        for before, after, share, *_ in self.schedule():
            begin = at_stations[before]
            end = at_stations[after]
            steps.append(end if share == 1.0 else begin + share * (end - begin))
        return steps

    def loads(self) -> list[dict[Keys, float]]:
        """Return the loads of every step, step 0 included."""
        keys = [keys for keys, *_ in self.parameters]
        at_stations = [
            np.array([station[load_keys] for load_keys in keys]) for station in self.stations()
        ]
        rows = self.along(at_stations)
        return [dict(zip(keys, row.tolist(), strict=True)) for row in rows]
