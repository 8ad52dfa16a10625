"""What reports say of results in words, and what must be true for it; first of a run: what slips,
debonds or jumps where, what is proved and how exact it is, how much is solved.

A sentence whose condition does not hold is "" or a weaker one. Reports of all kinds take their
words from here. That of a run reads the few variables that it speaks of, and of them only the last
levels.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tcstudy.data.bodies import StoredBody
from tcstudy.data.schema import OF_POLYGON, UNBALANCED, PointStatus
from tcstudy.data.store import BRANCH, SWEPT_LOADS
from tcstudy.reports.symbols import symbol
from tcstudy.reports.text import (
    PROOFS,
    Failure,
    Verdict,
    between,
    counted,
    failure_kinds,
    first_largest,
    number,
    pretty,
    scaled_labels,
    with_unit,
)

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]

SAME = 1e-9
"""Relative difference of two energies that are one; part of the largest change of slips, or ∫ξ,
that is none."""
EQUAL = 1e-6
"""Relative difference of the changes of two cycles that are equal; part of the slips below which
they are settled."""
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
"""By data.tables.VERDICTS, whose conditions are those of study.convergence.verdict; no order is
called slow where corners were not analysed or errors are rounding."""
GUESS = "?"
"""Stands behind an order of two levels, whose own error nothing tells."""


def percent(share: float) -> str:
    """A share that is known to one or two digits."""
    return (
        f"{100 * share:.0f} %"
        if share >= 0.1
        else f"{100 * share:.2g} %"
        if share >= 1e-6
        else f"{share:.1e}"
    )


def slip_lengths(spans: Mapping[str, tuple[float, float]], units: str) -> str:
    """Return on how much of the contact line it slips, has debonded, …: "slip length 2 to 9 mm".

    spans: name of the length → least and largest of all points [units]
    """
    texts = list[str]()
    for name, (low, high) in spans.items():
        length = between(low, high, units, 3) if low > 0.0 else f"up to {with_unit(high, units, 3)}"
        texts.append(f"{name} length {length}")
    return ", ".join(texts)


# -- runs
# --------------------------------------------------------------------------------------------------------------

FEWEST, STEEP, NOTABLE = 4, 4.0, 0.25
"""A step is abrupt where a line has so many points, it is so many times the median of the others
and so large a part of the largest value of the whole line."""
LENGTHS = ("slip", "debonded", "softening", "yielded")
"""Lengths of the contact line of which a verdict speaks, by what happens there."""
HOW = {
    "goal": "mesh error: largest estimated error of the goal",
    "energy": "mesh error: largest estimated error of the displacement in the energy norm",
    "change": "change: the largest relative one of max |u_T|, energy and ∫ξ (of ∫|ξ|) at all points",
    "no change": "not estimated: nothing slips, no friction and no energy to compare",
    "one mesh": "not estimated: one mesh",
}
"""How the mesh error is known, or why there is none."""


class RunSeen:
    """A run's file as the sentence sees it: a few variables, of their last levels only.

    dims: sweep dimensions;  units: of the slip;  ok: (*dims) points solved on the last level
    """

    def __init__(self, nc: Any) -> None:
        nc.set_auto_maskandscale(False)
        self.nc, self.grid, self.levels = (
            nc,
            nc.sweep_mode == "grid",
            int(nc.dimensions["level"].size),
        )
        self.dims = tuple(dim for dim in nc["status"].dimensions if dim != "level")
        self.units = str(nc["u_T_max"].units) if "u_T_max" in nc.variables else "1"
        self._shown = dict[str, tuple[list[str], str]]()
        self.status = np.asarray(self.take("status"))
        self.ok: Flags = self.status == int(PointStatus.OK)

    def take(self, name: str, level: int = -1) -> NDArray[Any] | None:
        """(*dims, …) values of a variable on one level, counted from the end; None if the file has
        none."""
        if name not in self.nc.variables:
            return None
        return np.asarray(self.nc[name][(slice(None),) * len(self.dims) + (self.levels + level,)])

    def flag(self, name: str) -> Flags:
        """(*dims) which solved points have a flag."""
        values = self.take(name)
        return self.ok & (values == 1) if values is not None else np.zeros_like(self.ok)

    def failures(self) -> list[Failure]:
        """Return the failures of all levels by their cause, the most frequent first."""
        status = np.asarray(self.nc["status"][...])
        failed = (status != int(PointStatus.OK)) & (status != int(PointStatus.NOT_RUN))
        if not failed.any():
            return []
        reasons, rows = self.nc["reason"][...], list[tuple[PointStatus, str, str, int]]()
        points = np.arange(self.ok.size).reshape(self.ok.shape)
        for *place, level in np.argwhere(failed):
            where = dict(zip(self.dims, (int(i) for i in place), strict=True))
            words = ", ".join(self.labelled(where)) if self.grid else ""
            at = (*place, level)
            rows.append(
                (PointStatus(int(status[at])), str(reasons[at]), words, int(points[tuple(place)]))
            )
        return failure_kinds(rows)

    def friction(self, place: tuple[int, ...]) -> float:
        """∫|ξ| on the last level at a point."""
        body, point = StoredBody.at(self.nc, int(np.ravel_multi_index(place, self.ok.shape)))
        level = self.levels - 1
        group = body.group(level)
        xi = body.read(group["xi"], level, body.cut(point))
        return float(np.abs(xi) @ body.read(group["c"], level))

    def symbol(self, name: str) -> str:
        """How reports write the parameter of an axis, with the edge or region it belongs to."""
        return symbol(str(self.nc[name].__dict__.get("long_name", name)))

    def shown(self, name: str) -> tuple[list[str], str]:
        """The labels of an axis and their unit as it is read; each is asked of many failed points."""
        if name not in self._shown:
            shown, unit = scaled_labels(self.nc[name][...].tolist(), self.nc[name].__dict__)
            self._shown[name] = shown, pretty(unit)
        return self._shown[name]

    def labelled(self, place: Mapping[str, int]) -> list[str]:
        """The labels of a point along axes with several values, "θ̄ = 12 K", "friction:
        brittle"."""
        found = []
        for name, i in ((name, i) for name, i in place.items() if self.nc[name].size > 1):
            (labels, unit), mark = self.shown(name), ": " if self.nc[name].dtype is str else " = "
            found.append(f"{self.symbol(name)}{mark}{labels[i]} {unit}".rstrip())
        return found


CLASSES = {"unique": "unique", "global": "global minimum", "local": "local minimum"}
"""By `text.PROOFS`: names of the classes into which solutions fall by the strongest proof."""
UNPROVED = "without certificate"


def proof_classes(flags: Mapping[str, Flags], solved: Flags) -> str:
    """Return how many of the solved points or steps have which strongest proof; the counts add up.

    flags: by the names of `text.PROOFS`
    """
    remaining, counts = solved.copy(), dict[str, int]()
    for name, word in PROOFS:
        counts[CLASSES[word]] = int((remaining & flags[name]).sum())
        remaining &= ~flags[name]
    counts[UNPROVED] = int(remaining.sum())
    return ", ".join(f"{count} {word}" for word, count in counts.items() if count)


def run_verdict(nc: Any) -> Verdict:
    """Return what the open file of a run says first."""
    run = RunSeen(nc)
    failures = run.failures()
    not_run = int(np.count_nonzero(run.status == int(PointStatus.NOT_RUN)))
    verdict = Verdict(
        answer=("no point is solved",),
        solved=_solved(run, failures, not_run),
        **failure_fields(failures),
        complete=not failures and not not_run,
    )
    if not run.ok.any():
        return verdict
    unique = run.flag("unique")
    ambiguous = several_found(run, unique)
    return replace(
        verdict,
        answer=(*_answer(run), *abrupt(run, ambiguous)[:2]),
        trust=_trust(run, unique, ambiguous),
        accuracy=_accuracy(run),
    )


def failure_fields(failures: Sequence[Failure]) -> dict[str, tuple[str, ...]]:
    """Return the labels `reason` and `fix` of a verdict: those of the most frequent failure."""
    if not failures:
        return {}
    most = failures[0]
    return {"reason": (most.cause,), "fix": (most.remedy,)}


def _solved(run: RunSeen, failures: Sequence[Failure], not_run: int) -> tuple[str, ...]:
    """Return how many points are solved, on how many levels, and the largest residual."""
    total, solved = int(run.ok.size), int(run.ok.sum())
    text = f"{solved} of {counted(total, 'point')}"
    if run.levels > 1:
        text += f", {run.levels} levels"
    failed = len({point for failure in failures for point in failure.points})
    unsolved = [f"; {failed} failed" if failed else ""]
    if failed > total - solved - not_run:
        unsolved.append(f", {failed + solved + not_run - total} on coarser levels only")
    unsolved.append(f"; {not_run} not run" if not_run else "")
    residual = run.take("inclusion_residual")
    known = residual[run.ok & np.isfinite(residual)] if residual is not None else np.zeros(0)
    if known.size:
        unsolved.append(f"; residual ≤ {number(float(known.max()), 2)}")
    return (text + "".join(unsolved),)


def _trust(run: RunSeen, unique: Flags, ambiguous: Flags) -> tuple[str, ...]:
    """Return what is proved of the solutions of the finest level, and what speaks against them."""
    flags = {name: run.flag(name) for name, _ in PROOFS}
    facts = [f"{proof_classes(flags, run.ok)} (this mesh)"]
    if (body := run.take("proved_unique")) is not None:
        of_body = int((run.ok & (body == 1)).sum())
        facts.append(f"{of_body} of {int(unique.sum())} unique for the body itself")
    count, complete = run.take("solutions"), run.take("complete")
    if count is not None and complete is not None:
        facts.append(all_equilibria(count[run.ok], complete[run.ok]))
    if ambiguous.any():
        points = counted(int(ambiguous.sum()), "point")
        facts.append(f"several solutions found at {points}")
    facts += no_loading_curve(run, ambiguous)
    if "heat_status" in run.nc.variables:
        missed = np.count_nonzero(run.nc["heat_status"][...] == UNBALANCED)
        facts.append(f"heat balance missed at {missed}" if missed else "")
    return tuple(filter(None, facts))


FOLLOW_LOADING = "to follow the loading, take solver.branch: continued or path:"


def no_loading_curve(run: RunSeen, ambiguous: Flags) -> list[str]:
    """Return that a sweep of loads is not what a body does that is loaded from rest; empty where
    nothing shows that it is not.

    With `branch: lowest` the stored solution leaves the branch from rest where another one has
    less energy, long before the fold at which a loaded body leaves it.
    """
    names = run.nc.__dict__.get(SWEPT_LOADS, "").split()
    if run.nc.__dict__.get(BRANCH, "") != "lowest":
        return []
    words = least_energy_words(names, run.take("start_energy"), ambiguous)
    return [words] if words else []


def least_energy_words(loads: Sequence[str], energy: Array | None, ambiguous: Flags) -> str:
    """Return what separates solutions of least energy from a loading curve over these loads.

    energy: (…, s) to which each start led;  ambiguous: (…) more than one solution was found
    """
    if not loads or not ambiguous.any():
        return ""
    over = " and ".join(symbol(name) for name in loads)
    if energy is not None and from_rest_left(energy, ambiguous):
        return f"not the loading curve over {over}, but the least energy; {FOLLOW_LOADING}"
    return f"the least energy need not be the loading curve over {over}; {FOLLOW_LOADING}"


def from_rest_left(energy: Array, ambiguous: Flags) -> bool:
    """Return whether somewhere the solution of least energy is not that which descent from zero,
    the first of the starts (…, s), leads to."""
    known = energy[ambiguous]
    size = np.nanmax(np.abs(known), axis=-1)
    return bool(np.any(known[:, 0] - np.nanmin(known, axis=-1) > SAME * size))


def _accuracy(run: RunSeen) -> tuple[str, ...]:
    """Return how large the error of the mesh is, as far as that is known."""
    error, how = mesh_error(run)
    facts = [error]
    if not error or how in (HOW["goal"], HOW["energy"]):
        facts.append(how)
    if (bound := run.take("error_bound_relative")) is not None:
        largest = float(np.max(bound[run.ok], initial=0.0))  # NaN where one point has none
        if 0.0 < largest < 1.0:
            facts.append(f"error of u proved to be at most {percent(largest)}")
    stop = str(run.nc["stop"][-1]) if "stop" in run.nc.variables else ""
    if " not met:" in stop:
        facts.append(stop.partition(":")[0])
    return tuple(filter(None, facts))


def _answer(run: RunSeen) -> tuple[str, ...]:
    """Return the largest slip with its point, and the lengths on which the line slips, has
    debonded, softens or yields."""
    slip, ok = run.take("u_T_max"), run.ok
    if slip is None:
        return ()
    most = first_largest(np.where(ok, slip, -1.0))
    if slip[most] == 0.0:
        return ("nothing slips",)
    spans = dict[str, tuple[float, float]]()
    for name in LENGTHS:
        if ok.size > 1 and name in ("softening", "yielded") and (name == "softening" or spans):
            continue  # of a sweep the least that says it
        length = run.take(f"{name}_length")
        if length is None:
            continue
        known = length[ok & np.isfinite(length)]
        if known.size and known.max() > 0.0:
            spans[name] = float(known.min()), float(known.max())
    place = dict(zip(run.dims, (int(i) for i in most), strict=True)) if run.grid else {}
    words = ", ".join(run.labelled(place))
    largest = f"largest slip {with_unit(float(slip[most]), run.units)}"
    facts = [f"{largest} at {words}" if words else largest, slip_lengths(spans, run.units)]
    shear, at = run.take("shear_max"), run.take("shear_max_at")
    if ok.size == 1 and shear is not None and at is not None:
        stress = with_unit(shear.item(), "1" if run.units == "1" else "Pa")
        facts.append(f"largest shear {stress} at s = {with_unit(at.item(), run.units)}")
    return tuple(filter(None, facts))


def several_found(run: RunSeen, unique: Flags) -> Flags:
    """(*dims) solved points at which more than one solution was found."""
    if (count := run.take("solutions")) is not None:
        return np.asarray(run.ok & (count > 1))
    energy = run.take("start_energy")
    return run.ok & several(energy, unique) if energy is not None else np.zeros_like(run.ok)


def several(energy: Array, unique: Flags) -> Flags:
    """(…) more than one solution was found: starts (…, s) led to energies that differ by more than
    rounding, and no proof says that this is all that it can be.
    """
    energy = np.sort(energy, axis=-1)
    size = np.max(np.abs(np.where(np.isfinite(energy), energy, 0.0)), axis=-1, keepdims=True)
    return np.asarray(np.any(np.diff(energy, axis=-1) > SAME * size, axis=-1) & ~unique)


def equilibria(count: int, stable: int | None = None, complete: int = 1) -> str:
    """A number of equilibria in words; stable: how many of them;  complete: the flag of the file, 0 not proved."""
    words = f"{count}" if complete else f"at least {count}"
    return f"{words}, {stable} stable" if stable is not None and count > 1 else words


def all_equilibria(count: NDArray[np.int_], complete: NDArray[np.int_]) -> str:
    """At how many of P points all equilibria are known, and how many they are at each; empty
    without points."""
    if not len(count):
        return ""
    known = count[complete > 0]
    span = f"{known.min()} each" if len(known) and known.min() == known.max() else ""
    span = span or (f"{known.min()} to {known.max()}" if len(known) else "")
    told = f"all equilibria proved at {len(known)} of {len(count)}" + (f" ({span})" if span else "")
    return told + (" of the polygons of exponential laws" if np.any(complete == OF_POLYGON) else "")


def mesh_error(run: RunSeen) -> tuple[str, str]:
    """The largest mesh error of the solved points, relative to a number that it is smaller than,
    and how it is known: estimated, or else what the last level changed; "" where nothing is known
    of it.
    """
    ok, goal, wide = run.ok, run.take("goal"), run.take("goal_estimate")
    if (
        goal is not None
        and wide is not None
        and np.any(known := ok & np.isfinite(wide) & np.isfinite(goal))
    ):
        small = (
            known & (wide > 0.0) & (wide >= np.abs(goal))
        )  # the number is no larger than its error
        share = (
            wide[known & ~small] / np.where(goal == 0.0, 1.0, np.abs(goal))[known & ~small]
        ).max(initial=0.0)
        said = [_share(float(share), "mesh error about {}")] if share > 0.0 else []
        said += [f"the goal no larger than its mesh error at {small.sum()}"] if small.any() else []
        return ", ".join(said), HOW["goal"]
    estimates = run.take("error_estimate")
    if estimates is not None and np.isfinite(estimates[ok]).any():
        return _share(float(np.nanmax(estimates[ok])), "mesh error about {}"), HOW["energy"]
    if run.levels < 2 or not ok.any():
        return "", HOW["one mesh"]
    change = last_change(run)
    if change is None:
        return "", HOW["no change"]
    if change.share >= 1.0:
        return f"mesh too coarse for the order of magnitude of {change.symbol}", HOW["change"]
    at_most = "at most " if ok.size > 1 else ""
    place = dict(zip(run.dims, change.place, strict=True)) if run.grid else {}
    labels = run.labelled(place)
    where = f" (at {', '.join(labels)})" if labels else ""
    text = f"last refinement changed {change.symbol} by {at_most}{percent(change.share)}{where}"
    return text, HOW["change"]


def _share(error: float, words: str) -> str:
    return (
        words.format(percent(error))
        if error < 1.0
        else "mesh too coarse for the order of magnitude"
    )


CHANGED = {"u_T_max": "max |u_T|", "energy": "energy", "friction_resultant": "∫ξ"}
"""Results whose change by the last refinement is judged, and their symbols."""
SMALL = 1e-3
"""Part of the largest value of all points: a smaller value is compared with this part, so that a
point where next to nothing happens does not decide."""


@dataclass(frozen=True)
class MeshChange:
    """The largest relative change by the last refinement: of which result, at which point."""

    share: float
    symbol: str
    place: tuple[int, ...]


def last_change(run: RunSeen) -> MeshChange | None:
    """Return the largest relative change of max |u_T|, energy and ∫ξ by the last refinement.

    That of ∫ξ is relative to ∫|ξ|. None where all of them are rounding. Equilibrium may fix one of
    them, so that it alone says nothing of the mesh.
    """
    changes = list[MeshChange]()
    solved_before = run.take("status", -2) == int(PointStatus.OK)
    for name, result in CHANGED.items():
        last, before = run.take(name), run.take(name, -2)
        if last is None or before is None:
            continue
        both = run.ok & solved_before & np.isfinite(last) & np.isfinite(before)
        if not both.any():
            continue
        largest = float(np.abs(last[both]).max())
        size = np.maximum(np.abs(last), SMALL * largest)
        if name == "u_T_max":
            both &= np.maximum(np.abs(last), np.abs(before)) > _slip_rounding(run)
        change = np.where(both, np.abs(last - before), 0.0)
        share = np.divide(change, size, out=np.zeros_like(change), where=size > 0.0)
        if name == "friction_resultant":
            found = _resultant_change(run, both, change, share, largest)
        else:
            found = _most(share, both & (size > 0.0))
        if found is not None:
            changes.append(MeshChange(found[0], result, found[1]))
    return max(changes, key=lambda change: change.share, default=None)


def _most(share: Array, known: Flags) -> tuple[float, tuple[int, ...]] | None:
    """Return the largest share of the known points and its place."""
    if not known.any():
        return None
    masked = np.where(known, share, -1.0)
    place = first_largest(masked)
    return float(masked[place]), place


def _slip_rounding(run: RunSeen) -> Array | float:
    """Return (*dims) the slip that SAME of the largest shear stress of a point causes at most."""
    shear, lambda_1 = run.take("shear_max"), run.take("lambda_1")
    if shear is None or lambda_1 is None:
        return 0.0
    known = np.isfinite(shear) & (lambda_1 > 0.0)
    return np.divide(SAME * shear, lambda_1, out=np.zeros_like(shear), where=known)


def _resultant_change(
    run: RunSeen, both: Flags, change: Array, share: Array, largest: float
) -> tuple[float, tuple[int, ...]] | None:
    """Return the largest change of ∫ξ relative to ∫|ξ|, and its place.

    |∫ξ| ≤ ∫|ξ|, so that no point whose change relative to the first is less than the largest so far
    need be read.
    """
    most: tuple[float, tuple[int, ...]] | None = None
    bound = np.where(both, share, -1.0)
    for k in np.argsort(-bound, axis=None)[: both.sum()]:
        place = tuple(int(i) for i in np.unravel_index(k, bound.shape))
        if most is not None and bound[place] <= most[0]:
            break
        size = max(run.friction(place), SMALL * largest)
        if size > SAME * largest:
            own_share = float(change[place] / size)
            if most is None or own_share > most[0]:
                most = own_share, place
    return most


def abrupt(run: RunSeen, several: Flags) -> list[str]:
    """Sentences on where the slip changes between two neighbouring values of a swept number, so
    much beside the steps around it that it is worth a word, the largest first.

    It is called a jump only if two solutions were seen at one of them: a solution that is unique
    all the way (ω < λ₁) changes steeply, but continuously, and two points do not tell a steep
    change from a jump.
    """
    slip = run.take("u_T_max")
    if not run.grid or slip is None:
        return []
    values, found = np.where(run.ok, slip, np.nan), list[tuple[float, str]]()
    for axis, name in enumerate(run.dims):
        if run.nc[name].dtype is str or values.shape[axis] < FEWEST:
            continue
        lines = np.moveaxis(values, axis, -1)
        step = np.abs(np.diff(lines, axis=-1))
        ordered = np.sort(step, axis=-1)  # NaN last
        largest, size = ordered[..., -1], np.max(np.abs(lines), axis=-1)
        others = np.median(ordered[..., :-1], axis=-1)
        with np.errstate(invalid="ignore"):
            abrupt = (largest > STEEP * others) & (largest > NOTABLE * size)
        if not abrupt.any():
            continue
        line = np.unravel_index(int(np.argmax(np.where(abrupt, largest, 0.0))), abrupt.shape)
        where = dict(zip([d for d in run.dims if d != name], (int(i) for i in line), strict=True))
        at = int(np.argmax(step[line]))
        change, seen = (
            float(step[line][at]),
            bool(np.moveaxis(several, axis, -1)[line][at : at + 2].any()),
        )
        labels, unit = run.shown(name)
        place = f"between {run.symbol(name)} = {labels[at]} and {labels[at + 1]} {unit}".rstrip()
        place += f" ({', '.join(rest)})" if (rest := run.labelled(where)) else ""
        words = (
            f"slip jumps {place}"
            if seen
            else f"slip changes by {with_unit(change, run.units, 2)} {place}"
        )
        found.append((change, words))
    return [text for _, text in sorted(found, reverse=True)]


LOCKS = 1.1
"""λ₁ of a P1 mesh over that of equilibrium elements, beyond which the mesh is said to lock."""


def of_the_body(low: Array, high: Array, proved: NDArray[np.bool_], units: str) -> str:
    """What is proved of the body itself: low ≤ λ₁ ≤ high and ω < low, at the points of the finest
    level.

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
    """Where λ₁ of the mesh (P,) is far above that of equilibrium elements (P,), which do not
    lock."""
    ratio = float(np.nanmax(mesh / dual, initial=0.0, where=np.isfinite(dual)))
    if not ratio > LOCKS:
        return ""
    return (
        f"the mesh locks: its λ₁ is up to {number(ratio, 3)} times that of equilibrium elements, so that what is "
        "certified of the mesh by ω < λ₁ need not hold of the body; refine, or go by what is proved of the body"
    )


# -- convergence
# -------------------------------------------------------------------------------------------------------


def order(slope: float, error: float, digits: int = 2) -> str:
    """A measured order ± its standard error; of two levels it has none and is marked as a guess."""
    if not np.isfinite(slope):
        return "–"
    return f"{slope:z.{digits}f}" + (f" ± {number(error, 1)}" if np.isfinite(error) else GUESS)


GOOD = ("as_expected", "faster")
"""Verdicts of orders that are as expected or better."""
OPEN = {
    "too_few_levels": ("rests on two levels", "rest on two levels"),
    "exact": ("error is rounding", "errors are rounding"),
    "unknown": ("has corners that are not analysed", "have corners that are not analysed"),
}
"""Verdicts by which an order cannot be judged, in words for one and for several of them."""


def orders(verdicts: Iterable[tuple[str, str]]) -> list[str]:
    """Return what is said of measured orders, from the symbol of each error and its verdict.

    Only orders that can be judged are counted among those as expected: not those of two levels, of
    errors that are rounding, or beside corners that are not analysed.
    """
    measured = list(verdicts)
    if not measured:
        return ["no order is measured: there is no reference"]
    count = Counter(verdict for _, verdict in measured)
    open_words = list[str]()
    for verdict, (singular, plural) in OPEN.items():
        if count[verdict]:
            open_words.append(f"{count[verdict]} {singular if count[verdict] == 1 else plural}")
    judged = len(measured) - sum(count[verdict] for verdict in OPEN)
    if not judged:
        return [f"no order can be judged: {', '.join(open_words)}"]
    good = sum(count[verdict] for verdict in GOOD)
    answer = [f"{good} of {judged} orders are as expected or better"]
    for verdict, words in (
        ("slower", "slower than expected"),
        ("pre_asymptotic", "pre-asymptotic"),
    ):
        symbols = sorted({symbol for symbol, one in measured if one == verdict})
        if symbols:
            answer.append(f"{count[verdict]} {words}: {', '.join(symbols)}")
    return [*answer, f"not judged: {', '.join(open_words)}"] if open_words else answer


# -- histories
# ---------------------------------------------------------------------------------------------------------


def cycle_change(
    v: Array, dissipated: Array, units: tuple[str, str] = ("m", "J m-1"), rounding: float = 0.0
) -> tuple[str, str]:
    """(its kind, the same as a sentence) of the change from cycle to cycle, from the slips at their
    ends.

    shakedown:  the last cycle changed no slip and dissipated nothing
    closed:     it changed no slip;  walking, ratcheting: it changed slips as the one before did
    settled:    it changed them otherwise, but by no more than EQUAL of the largest;  settling: by more
    "":         there are less than two

    v: (C + 1, m) at the start and the end of every cycle;  dissipated: (C,) in each;  units: of both
    rounding: what rounding of the forces may move the slips by in a cycle
    """
    if len(v) < 3:
        return "", ""
    size = float(np.max(np.abs(v))) or 1.0
    last, before = v[-1] - v[-2], v[-2] - v[-3]
    largest, same = float(np.max(np.abs(last))), max(SAME * size, rounding)
    moved = with_unit(largest, units[0], 6)
    if largest <= same and dissipated[-1] <= SAME * float(np.max(dissipated)):
        words = "shakedown: the last cycle leaves the slips as they were and dissipates nothing"
        return "shakedown", words
    if largest <= same:
        one, two = dissipated[-2:]
        spent = [with_unit(float(each), units[1], 6) for each in (two, one)]
        words = f"the last cycle leaves no slip behind; it dissipates {spent[0]}, the one before {spent[1]}"
        if abs(two - one) <= SPENT * max(one, two) and float(np.max(np.abs(before))) <= same:
            words = "the last two cycles dissipate the same and leave no slip behind"
        return "closed", f"a closed loop: {words}"
    if np.max(np.abs(last - before)) <= max(EQUAL * largest, rounding):
        whole = np.ptp(last) <= max(EQUAL * largest, rounding)
        kind = "walking" if whole else "ratcheting"
        what = "moved the whole contact line by" if whole else "added slips of up to"
        return kind, f"{kind}: the last two cycles each {what} {moved}"
    if largest <= EQUAL * size:
        share = f"{largest / size:.0e}"
        return (
            "settled",
            f"settled to {share} of the slip, by which the last cycle changed it at most",
        )
    return (
        "settling",
        f"not settled: the last cycle changed slips by up to {moved}, unlike the one before",
    )


KINDS = {
    "shakedown": "shake down", "closed": "close their loop", "settled": "have settled", "walking": "walk",
    "ratcheting": "ratchet", "settling": "have not settled",
}  # fmt: skip
"""What the histories of a sweep do, by the kind of `cycle_change`."""


WHOLE = "all branches of equilibria in the range are proved to be known"
"""Said of a path with every branch."""
CONNECTED = "the connected branch only; other branches are not excluded"
"""Said of every other path."""
