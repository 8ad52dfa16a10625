"""What reports say of results in words: a function a sentence, on plain values, and what must be true for it.

A sentence whose condition does not hold is "" or a weaker one. Reports of all kinds take their words from here.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tcstudy.data.schema import OF_POLYGON
from tcstudy.reports.text import counted, number, with_unit

Array = NDArray[np.float64]

SAME = 1e-9
"""Relative difference of two energies that are one, and change of slips, relative to the largest, that is none."""
EQUAL = 1e-6
"""Relative difference of the changes of two cycles that are equal; part of the slips below which they are settled."""
SPENT = 1e-5
"""Relative difference of what two cycles dissipate that is none."""

PROVED = {
    "unique": "proved to be the only solution",
    "global": "proved to have the least energy",
    "local": "proved to be a local minimum",
    "nothing": "a solution, nothing proved of it",
    "failed": "no solution",
}
"""By `text.PROOFS`: what the flag of a solution, the strongest that it has, says of it."""
PROVED_STEPS = {
    "unique": "every step proved to be the only solution",
    "global": "every step proved to have the least energy",
    "local": "every step proved to be a local minimum",
    "nothing": "steps of which nothing is proved",
    "failed": "ended before its last step",
}
"""The same of the steps of a history."""
VERDICTS = {
    "unknown": "not judged",
    "exact": "exact (rounding)",
    "as_expected": "as expected",
    "faster": "faster",
    "slower": "slower",
    "pre_asymptotic": "pre-asymptotic",
    "too_few_levels": "too few levels",
}
"""By data.tables.VERDICTS, whose conditions are those of study.convergence.verdict; no order is called slow where
corners were not analysed or errors are rounding."""
GUESS = "?"
"""Stands behind an order of two levels, whose own error nothing tells."""


def percent(share: float) -> str:
    """A share that is known to one or two digits."""
    return f"{100 * share:.0f} %" if share >= 0.1 else f"{100 * share:.2g} %" if share >= 1e-6 else f"{share:.1e}"


# -- runs --------------------------------------------------------------------------------------------------------------


def proved(unique: int, least: int) -> str:
    """How many solutions are proved unique, and how many, these included, of least energy."""
    said = f"{unique} proved unique" if unique else "none proved unique"
    return f"{said}, {least} proved to have the least energy" if least > unique else said


def equilibria(count: int, stable: int | None = None, complete: int = 1) -> str:
    """A number of equilibria in words; stable: how many of them;  complete: the flag of the file, 0 not proved."""
    words = f"{count}" if complete else f"at least {count}"
    return f"{words}, {stable} stable" if stable is not None and count > 1 else words


def all_equilibria(count: NDArray[np.int_], complete: NDArray[np.int_]) -> str:
    """At how many of P points all equilibria are known, and how many they are at each; empty without points."""
    if not len(count):
        return ""
    known = count[complete > 0]
    span = f"{known.min()} each" if len(known) and known.min() == known.max() else ""
    span = span or (f"{known.min()} to {known.max()}" if len(known) else "")
    told = f"all equilibria proved at {len(known)} of {len(count)}" + (f" ({span})" if span else "")
    return told + (" of the polygons of exponential laws" if np.any(complete == OF_POLYGON) else "")


def several(energy: Array, unique: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """(P,) more than one solution was found: starts (P, s) led to energies that differ by more than rounding, and no
    proof says that this is all that it can be.
    """
    return np.asarray((different_energies(energy) > 1) & ~unique)


def different_energies(energy: Array) -> NDArray[np.int_]:
    """How many different energies the starts (last axis) of each point led to, relative to the largest."""
    energy = np.sort(energy, axis=-1)
    size = np.max(np.abs(np.where(np.isfinite(energy), energy, 0.0)), axis=-1, keepdims=True)
    return np.asarray(1 + np.count_nonzero(np.diff(energy, axis=-1) > SAME * size, axis=-1))


def abrupt(change: str, place: str, seen: bool) -> str:
    """A step of the slip between two neighbouring values of a swept number, so large beside those around it that it is
    worth a word. It is called a jump only if two solutions were seen at one of them: a solution that is unique all the
    way (ω < λ₁) changes steeply, but continuously, and two points do not tell a steep change from a jump.
    """
    return f"slip jumps {place}" if seen else f"slip changes by {change} {place}"


def mesh_error(error: float | None, estimated: bool, no_larger: int = 0) -> str:
    """The largest error, relative to a number that it is smaller than: estimated, or else what the last level changed.

    error:     None where nothing is known of it, or where there is nothing that it could be relative to
    no_larger: points whose number is no larger than its estimated error, so that it is relative to nothing there
    """
    said = []
    if error is not None and error < 1.0:
        share = percent(error)
        said.append(f"mesh error about {share}" if estimated else f"∫ξ changed by {share} with the last level")
    elif error is not None:
        said.append("mesh too coarse for the order of magnitude")
    said += [f"the goal no larger than its mesh error at {no_larger}"] if no_larger else []
    return ", ".join(said)


def missed(stop: str) -> str:
    """That a tolerance is not met, from why refinement ended ("tolerance 0.1 not met: …")."""
    return stop.partition(":")[0] if " not met:" in stop else ""


def bounded(bounds: Array) -> str:
    """The proved bound of all relative errors (P,), empty where that of one is not known."""
    most = float(np.max(bounds, initial=0.0))
    return f"error of u proved to be at most {percent(most)}" if 0.0 < most < 1.0 else ""


LOCKS = 1.1
"""λ₁ of a P1 mesh over that of equilibrium elements, beyond which the mesh is said to lock."""


def of_the_body(low: Array, high: Array, proved: NDArray[np.bool_], units: str) -> str:
    """What is proved of the body itself: low ≤ λ₁ ≤ high and ω < low, at the points of the finest level.

    low, high: (P,) [units], NaN where a point was not solved
    """
    known = np.isfinite(low)
    if not known.any():
        return ""
    at = int(np.nanargmin(low))
    one = float(np.nanmin(low)) > (1.0 - EQUAL) * float(np.nanmax(low))
    span = f"between {with_unit(float(low[at]), units)} and {with_unit(float(high[at]), units)}"
    band = f"λ₁ of the body lies {span}" if one else f"λ₁ of the body is least {span}"
    below = f"one solution for ω below {with_unit(float(low[at]), units)}"
    count, total = int(np.count_nonzero(proved[known])), int(np.count_nonzero(known))
    points = "this point" if total == 1 else f"{count} of {total} points"
    here = f"; so at {points}" if count else ""
    return f"{band}: {below}, proved of the body itself, not of the mesh{here}"


def locks(mesh: Array, dual: Array) -> str:
    """Where λ₁ of the mesh (P,) is far above that of equilibrium elements (P,), which do not lock."""
    ratio = float(np.nanmax(mesh / dual, initial=0.0, where=np.isfinite(dual)))
    if not ratio > LOCKS:
        return ""
    return (
        f"the mesh locks: its λ₁ is up to {number(ratio, 3)} times that of equilibrium elements, so that what is "
        "certified of the mesh by ω < λ₁ need not hold of the body; refine, or go by what is proved of the body"
    )


HOW = {
    "goal": "mesh error: largest estimated error of the goal",
    "energy": "mesh error: largest estimated error of the displacement in the energy norm",
    "change": "change of ∫ξ: the largest of all points, of their ∫|ξ|",
    "no friction": "no friction by which to measure the mesh error",
    "one mesh": "one mesh says nothing about its own error: add levels",
}
"""How the number of `mesh_error` is known, or why there is none."""


# -- convergence -------------------------------------------------------------------------------------------------------


def order(slope: float, error: float, digits: int = 2) -> str:
    """A measured order ± its standard error; of two levels it has none and is marked as a guess."""
    if not np.isfinite(slope):
        return "–"
    return f"{slope:z.{digits}f}" + (f" ± {number(error, 1)}" if np.isfinite(error) else GUESS)


def orders(verdicts: Iterable[tuple[str, str]], solved: bool) -> str:
    """All measured orders in a sentence; verdicts: (symbol of the error, of VERDICTS), which an order has that was
    measured; what is not judged counts neither way.
    """
    told = list(verdicts)
    if not told:
        return "nothing could be compared: there is no reference"
    count = {name: sum(verdict == name for _, verdict in told) for name in VERDICTS}
    judged = len(told) - count["unknown"] - count["too_few_levels"]
    good = count["as_expected"] + count["faster"] + count["exact"]
    parts = [f"{good} of {judged} measured orders are as expected or better"]
    parts += [f"{count[name]} {words}" for name, words in OPEN.items() if count[name]]
    slow = sorted({symbol for symbol, verdict in told if verdict == "slower"})
    parts += ["slower than expected: " + ", ".join(slow)] if slow else []
    return "; ".join(parts if solved else [*parts, "some levels were not solved"])


OPEN = {
    "pre_asymptotic": "not yet settled (pre-asymptotic)",
    "too_few_levels": "of two levels",
    "unknown": "not judged, as corners were not analysed",
}
"""Orders that are neither as expected nor not."""


# -- histories ---------------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class CycleChange:
    """What the last cycle has changed.

    kind:  "shakedown", "closed", "settled", "walking", "ratcheting", "settling"; "" where there are less than two
    words: the same as a sentence
    """

    kind: str
    words: str


def cycle_change(
    v: Array, dissipated: Array, units: tuple[str, str] = ("m", "J m-1"), rounding: float = 0.0
) -> CycleChange:
    """The change from cycle to cycle, from the slips at their ends.

    shakedown:  the last cycle changed no slip and dissipated nothing
    closed:     it changed no slip;  walking, ratcheting: it changed slips as the one before did
    settled:    it changed them otherwise, but by no more than EQUAL of the largest;  settling: by more

    v: (C + 1, m) at the start and the end of every cycle;  dissipated: (C,) in each;  units: of both
    rounding: what rounding of the forces may move the slips by in a cycle
    """
    if len(v) < 3:
        return CycleChange("", "")
    size = float(np.max(np.abs(v))) or 1.0
    last, before = v[-1] - v[-2], v[-2] - v[-3]
    largest, same = float(np.max(np.abs(last))), max(SAME * size, rounding)
    moved = with_unit(largest, units[0], 6)
    if largest <= same:
        if dissipated[-1] <= SAME * float(np.max(dissipated)):
            words = "shakedown: the last cycle leaves the slips as they were and dissipates nothing"
            return CycleChange("shakedown", words)
        one, two = dissipated[-2:]
        if abs(two - one) <= SPENT * max(one, two) and float(np.max(np.abs(before))) <= same:
            words = "the last two cycles dissipate the same and leave no slip behind"
        else:
            spent = [with_unit(float(each), units[1], 6) for each in (two, one)]
            words = f"the last cycle leaves no slip behind; it dissipates {spent[0]}, the one before {spent[1]}"
        return CycleChange("closed", f"a closed loop: {words}")
    if np.max(np.abs(last - before)) > max(EQUAL * largest, rounding):
        if largest <= EQUAL * size:
            share = f"{largest / size:.0e}"
            return CycleChange("settled", f"settled to {share} of the slip, by which the last cycle changed it at most")
        words = f"not settled: the last cycle changed slips by up to {moved}, unlike the one before"
        return CycleChange("settling", words)
    if np.ptp(last) <= max(EQUAL * largest, rounding):
        return CycleChange("walking", f"walking: the last two cycles each moved the whole contact line by {moved}")
    return CycleChange("ratcheting", f"ratcheting: the last two cycles each added slips of up to {moved}")


KINDS = {
    "shakedown": "shake down", "closed": "close their loop", "settled": "have settled", "walking": "walk",
    "ratcheting": "ratchet", "settling": "have not settled",
}  # fmt: skip
"""What the histories of a sweep do, by `CycleChange.kind`."""


# -- paths -------------------------------------------------------------------------------------------------------------


def answered(*sentences: Iterable[str]) -> str:
    """What came out, how far it is to be trusted, how much of it there is: each a sentence of its parts."""
    told = ["; ".join(filter(None, parts)) for parts in sentences]
    return " ".join(f"{one[0].upper()}{one[1:]}." for one in told if one)


def slipped(slip: str, at: str, lengths: Mapping[str, tuple[str, str]]) -> str:
    """The largest slip and where it is, and on how much of the contact line what happens.

    lengths: what happens ("slips", "debonded") → least and largest length of all points; an empty least is 0
    """
    spans = [f"{what} on {f'lengths of {low} to {high}' if low and low != high else high if low else f'up to {high}'}"
             for what, (low, high) in lengths.items()]  # fmt: skip
    return ", ".join([f"largest slip {slip}{at}", *spans])


def path(peak: str, snaps: Sequence[str], many: str, falls: int) -> list[str]:
    """What happens along a path. peak: of friction;  snaps: ranges that it snaps back;  many: where equilibria are many

    falls: how often slow loading to and fro falls to another part of it
    """
    parts = [f"peak {peak}" if peak else "no friction", *(f"snap-back from {snap}" for snap in snaps[:2])]
    parts += [f"and {len(snaps) - 2} more"] if len(snaps) > 2 else []
    return [", ".join(parts), many, f"slow loading to and fro falls {counted(falls, 'time')}" if falls else ""]


def equilibria_at(count: int, off_path: int, value: str, complete: bool) -> str:
    """All equilibria at one value of a path's parameter."""
    told = f"{count} of {count} equilibria at {value}" if complete else f"at least {count} equilibria at {value}"
    return f"{told}, {off_path} of them not on the path from the start" if off_path else told


def state_taken(states: int, rank: int, value: str) -> str:
    """In which of the stable states at the end of its range slow loading ends; rank: 1 for that of least energy."""
    if states == 1:
        return f"at {value} slow loading ends in the only stable state"
    order = {1: "least", 2: "second least", 3: "third least"}.get(rank, f"{rank}th least")
    return f"at {value} there are {states} stable states; slow loading ends in that of {order} energy"


def closed_loop(low: str, high: str, pieces: int, stable: int) -> str:
    """A loop between two values, the second with its unit."""
    return (
        f"a closed loop from {low} to {high} that the path does not meet, {stable} of {counted(pieces, 'piece')} stable"
    )


WHOLE = "all branches of equilibria in the range are proved to be known"
"""Said of a path with every branch."""
CONNECTED = "other paths may exist that are not connected to it"
"""Said of every path."""
