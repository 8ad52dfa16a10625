"""What a contact line remembers from one load to the next: the models by name, and which laws they
are meant for.

The scene's law gives the monotone virgin curve τ(κ) = b(s > 0). Beside it a node has a state, the
next step's law is
    friction         sgn(s − a) τ(κ + |s − a|)              a last slip, κ = Σ|Δv|
    elastic-plastic  ±k (|s − p| − Δp), at most τ(κ + Δp)   p plastic slip, κ = Σ|Δp|
    damage           τ(κ) s/κ for |s| ≤ κ, beyond it τ(|s|)   κ = max |v|
Literature: Ortiz & Pandolfi, Int. J. Numer. Meth. Engng 44 (1999) 1267–1282 (damage, κ the largest
opening); Simo & Hughes, Computational Inelasticity (1998) (return mapping). Here only what a study
says of it; contact/history solves.
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
"""Those of a study; with "none" a history is a walk to and fro on the paths of its loads."""
HistoryBranch = Literal["continued", "lowest"]
HISTORY_BRANCHES: tuple[HistoryBranch, ...] = get_args(HistoryBranch)
Keys = tuple[str, ...]
T = TypeVar("T")
V = TypeVar("V", float, NDArray[np.float64])
AT_REST = 1e-9
"""Change of a slip in a step, of the largest slip, that is rounding: the node rests."""
MOST_STEPS = 100_000
"""Steps of one history."""
START = "start"
"""Name of step 0, the study as it is written: its loads are put on the virgin body."""


class UnfitLaw(ValueError):
    """A memory cannot be made of this law; the text says why and what to do."""


@dataclass(frozen=True)
class Memory:
    """What every node of the contact line remembers.

    name:      one of MEMORIES, or "none";  edges: which one each contact edge has, if they differ
    stiffness: k of `elastic-plastic`, None for the others [Pa/m]
    """

    name: MemoryName
    stiffness: float | None = None
    edges: tuple[tuple[str, MemoryName], ...] = ()

    @property
    def words(self) -> str:
        """For reports."""
        return ", ".join(f"{edge}: {name}" for edge, name in self.edges) or self.name

    @property
    def names(self) -> set[MemoryName]:
        """All that some edge has."""
        return {name for _, name in self.edges} or {self.name}

    def by_node(
        self, law: Laws, edge_names: Sequence[str], edge: NDArray[np.integer], joints: Joints
    ) -> NDArray[np.str_] | None:
        """(m,) names of nodes on edges by number; None where all have one.

        A node between edges of different memories has one for the law of both: `damage` if it is
        among them and can be made of that law, else `friction`, which is an error of first order in
        the length of its cell.
        """
        if not self.edges:
            return None
        of = np.array([dict(self.edges)[name] for name in edge_names])
        found = of[edge]
        for node, before in zip(joints.node, of[joints.edge], strict=True):
            if before != found[node]:
                fits = "damage" in (before, found[node])
                fits = fits and not any(replace(self, name="damage").unfit(law.single(int(node))))
                found[node] = "damage" if fits else "friction"
        return found

    def fits(self, friction: Laws | EdgeLaws) -> None:
        """Raise UnfitLaw unless the memory of every edge can be made of its law."""
        laws = (
            [("", friction)]
            if isinstance(friction, Laws)
            else [(edge, law) for edge, law, _ in friction.laws]
        )
        for edge, law in laws:
            for on, name in self.edges or (("", self.name),):
                if not (on and edge) or on == edge:
                    replace(self, name=name).check(law)

    def check(self, law: Laws) -> None:
        """Raise UnfitLaw unless the memory `name` can be made of every node's law."""
        for said in (said for own in law.laws for said in self.unfit(own)):
            raise UnfitLaw(said)

    def unfit(self, law: Laws) -> Iterator[str]:
        """Why it cannot be made of one law, and what to do.

        Every law is odd and opposes slip everywhere. Backward Euler needs a return map with one
        answer, so that a law falls less steeply than the spring. Where τ(κ)/κ rises a film would
        heal by being pulled.
        """
        if law.vanishes or self.name == "none":
            return
        after, ups, k = (
            law.kinks[law.kinks > 0.0],
            law.kinks[(law.kinds == UP) & (law.kinks > 0.0)],
            self.stiffness,
        )
        starts = np.concatenate([[0.0], after])
        if not is_odd(law):
            yield (f"a history needs an odd law, b(-s) = -b(s), and {law.name} is not: what is remembered has no "
                   "sides; leave out odd: false")  # fmt: skip
        least = float(np.min(np.concatenate([law.b(starts, +1), law.b(after, -1)])))
        if least < -1e-12 * law.b_scale:
            yield (f"a history needs a law that opposes slip, but b falls to {least:g} Pa at s > 0 and would push; "
                   "let it end at 0")  # fmt: skip
        if self.name == "elastic-plastic":
            if k is None or not (np.isfinite(k) and k > 0.0):
                yield "elastic-plastic memory needs a stiffness above 0; add stiffness: 100 MPa/mm"
            if not law.piecewise_linear:
                yield (f"elastic-plastic memory needs a law of straight pieces, and {law.name} has exponential ones; "
                       "give it by its points (piecewise-linear)")  # fmt: skip
            if len(ups):
                yield "elastic-plastic memory needs a law without up-jumps at s > 0; make them steep slopes"
            if not law.omega < (k or 0.0):
                yield (f"the spring is too soft for the law: stiffness k = {k:g} Pa/m must be above the steepest fall "
                       f"h = {law.omega:g} Pa/m, or the slip of a step has several values; take a stiffer spring or a "
                       "law that falls more slowly")  # fmt: skip
        elif self.name == "damage":
            other = "use memory: friction, or a law that only falls"
            if len(ups):
                yield f"damage needs a law whose secant b(s)/s never rises, but b jumps up at s = {ups[0]:g} m; {other}"
            piece = int(law.piece(0.0, +1)) + np.arange(len(starts))
            ends = np.append(after, starts[-1] + 40.0 / (float(law.rate[piece[-1]]) or 1.0))
            s, piece = np.stack([starts, ends], axis=1).ravel(), np.repeat(piece, 2)
            value, slope = law.value(s, piece), law.slope(s, piece)
            size = np.maximum(np.maximum(np.abs(value), np.abs(slope * s)), law.b_scale)
            for i in np.flatnonzero(value - slope * s < -1e-12 * size):
                secant = value[i] / (s[i] or np.inf)
                yield (
                    f"damage needs a law whose secant b(s)/s never rises, but b climbs faster than its secant at "
                    f"s = {s[i]:g} m (slope {slope[i]:g}, secant {secant:g} Pa/m); {other}"
                )


def is_odd(law: Laws) -> bool:
    """Whether b(−s) = −b(s) to the bit, as every shape but a one-sided piecewise-linear one is
    made."""
    mirror = slice(None, None, -1)
    pieces = law.b_0 == -law.b_0[mirror], law.q == law.q[mirror], law.a == -law.a[mirror]
    anchors = (law.s_0 == -law.s_0[mirror]) | ((law.q == 0.0) & (law.a == 0.0))
    rates = (law.r == -law.r[mirror]) | (law.a == 0.0)
    return bool(np.array_equal(law.kinks, -law.kinks[mirror]) and np.all([*pieces, anchors, rates]))


def short_names(paths: Sequence[Keys]) -> tuple[str, ...]:
    """The last words of key paths, the whole paths where these do not tell them apart."""
    last = [
        "_".join(keys[keys.index("points", 1) :]) if "points" in keys[1:] else keys[-1]
        for keys in paths
    ]
    return tuple(
        name if last.count(name) == 1 else "_".join(keys)
        for name, keys in zip(last, paths, strict=True)
    )


@dataclass(frozen=True)
class HistoryLine:
    """Loads that change together, in equal steps.

    values: what they are at the end of the line, by key path [SI]; what is not named stays
    count:  steps;  name: of the last of them
    """

    values: tuple[tuple[Keys, float], ...]
    count: int
    name: str


@dataclass(frozen=True)
class HistoryPlan:
    """The load history of every scene of a study (section `history`).

    lines:      one after the other, `repeat` times
    parameters: (key path, CF units, value in the scene) of every load that changes
    branch:     which solution of a step: "continued" along the path from the last state, or the lowest found, "lowest"
    level:      mesh level, None for the finest
    loose:      whether nothing but friction holds the body
    """

    memory: Memory
    lines: tuple[HistoryLine, ...]
    parameters: tuple[tuple[Keys, str, float], ...]
    repeat: int = 1
    branch: HistoryBranch = "continued"
    level: int | None = None
    loose: bool = False

    @property
    def steps(self) -> int:
        """Number of steps, without step 0."""
        return self.repeat * sum(line.count for line in self.lines)

    def of(self, levels: Sequence[T]) -> T:
        """That of the levels of a study on which the history is followed."""
        return levels[-1 if self.level is None else self.level]

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the loads that change, as short as tells them apart."""
        return short_names([keys for keys, _, _ in self.parameters])

    def stations(self) -> list[dict[Keys, float]]:
        """Loads at step 0, at the ends of all lines of the first cycle, and of the second, which
        all others repeat.

        In the first what is not named yet has the value of the study, later the one that the cycle
        before has left.
        """
        values = {keys: value for keys, _, value in self.parameters}
        found = [dict(values)]
        for line in self.lines * min(self.repeat, 2):
            values |= dict(line.values)
            found.append(dict(values))
        return found

    def schedule(self) -> Iterator[tuple[int, int, float, str, int]]:
        """(station before, station after, share of the way, name or "", cycle from 1) of every step
        but step 0."""
        for cycle in range(self.repeat):
            for before, line in enumerate(self.lines, len(self.lines) if cycle else 0):
                for j in range(1, line.count + 1):
                    yield (
                        before,
                        before + 1,
                        j / line.count,
                        line.name if j == line.count else "",
                        cycle + 1,
                    )

    def along(self, at: Sequence[V]) -> list[V]:
        """Of every step, step 0 included, what is affine in the loads, from what it is at the
        stations."""
        found = [at[0]]
        for i, j, share, *_ in self.schedule():
            found.append(at[j] if share == 1.0 else at[i] + share * (at[j] - at[i]))
        return found

    def loads(self) -> list[dict[Keys, float]]:
        """Those of every step, step 0 included."""
        keys, at = [keys for keys, *_ in self.parameters], self.stations()
        rows = self.along([np.array([values[key] for key in keys]) for values in at])
        return [dict(zip(keys, row.tolist(), strict=True)) for row in rows]
