"""Verdicts of results in words, and the conditions under which they are true.

First of a run: what slips, debonds or jumps where, what is proved, how exact it is, how much is
solved. A sentence whose condition does not hold is "" or a weaker one. Reports of all kinds take
their words from here. The verdict of a run reads only the variables that it names, and of them the
last levels.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tcstudy.data.bodies import StoredBody
from tcstudy.data.schema import OF_POLYGON, POLYGON, UNBALANCED, PointStatus
from tcstudy.data.store import BRANCH, GUARANTEE, SWEPT_LOADS
from tcstudy.reports.rounding import stored_study
from tcstudy.reports.symbols import symbol
from tcstudy.reports.text import (
    PROOFS,
    FailedSolution,
    Failure,
    Verdict,
    between,
    counted,
    enclosing,
    failure_kinds,
    first_largest,
    number,
    pretty,
    scaled_labels,
    with_unit,
)
from tcstudy.scene.records import Contact, Scene

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]
Place = tuple[int, ...]
"""Index of a point along the sweep dimensions."""

SAME = 1e-9
"""Relative difference up to which energies are equal, and part of the largest slip or ∫ξ up to
which changes are 0."""
EQUAL = 1e-6
"""Relative difference up to which the changes of two cycles are equal; up to this part of the slips
a cycle counts as settled."""
EQUAL_DISSIPATION = 1e-5
"""Relative difference up to which two cycles dissipate the same."""

PROVED = {
    "unique": "proved to be the only solution",
    "global": "proved to be the global minimum of the energy",
    "local": "proved to be a local minimum",
    "nothing": "a solution without a certificate",
    "failed": "no solution",
}
"""Meaning of the strongest proof of a solution, by the words of `text.PROOFS`."""
PROVED_STEPS = {
    "unique": "every step proved to be the only solution",
    "global": "every step proved to be the global minimum of the energy",
    "local": "every step proved to be a local minimum",
    "nothing": "steps without a certificate",
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
"""By data.tables.VERDICTS, with the conditions of study.convergence.verdict. No order is called
slow where corners were not analysed or errors are rounding."""
GUESS = "?"
"""Stands behind an order of two levels, whose error is not known."""


def percent(share: float) -> str:
    """Return a share that is known to one or two digits."""
    if share >= 0.1:
        return f"{100 * share:.0f} %"
    if share >= 1e-6:
        return f"{100 * share:.2g} %"
    return f"{share:.1e}"


def slip_lengths(spans: Mapping[str, tuple[float, float]], units: str) -> str:
    """Return lengths of parts of the contact line: "slip length 2 to 9 mm".

    spans: (least, largest) of all points by the name of the length [units]
    """
    texts = list[str]()
    for name, (low, high) in spans.items():
        if low > 0.0:
            length = between(low, high, units, 3)
        else:
            length = f"up to {with_unit(high, units, 3)}"
        texts.append(f"{name} length {length}")
    return ", ".join(texts)


# -- the file of a run

LENGTHS = ("slip", "debonded", "softening", "yielded")
"""Lengths of the contact line that a verdict names, by what happens there."""
HOW = {
    "goal": "mesh error: largest estimated error of the goal",
    "energy": "mesh error: largest estimated error of the displacement in the energy norm",
    "change": (
        "change: the largest relative one of max |u_T|, energy and ∫ξ (of ∫|ξ|) at all points"
    ),
    "change with openings": (
        "change: the largest relative one of max |u_T|, largest opening, energy and ∫ξ (of ∫|ξ|) "
        "at all points"
    ),
    "no change": "not estimated: no slip, no friction and no energy to compare",
    "one mesh": "not estimated: one mesh",
}
"""How the mesh error is known, or why there is none."""


MIN_PLACE = 1e-2
"""Openings up to this part of the largest are no place of their own: nodes beside a contact that
rests lift off by a little."""


class RunSeen:
    """The file of a run, read by variable and level.

    dims:   sweep dimensions
    units:  of the slip
    status: (*dims) of the points on the last level
    ok:     (*dims) points solved on the last level
    """

    def __init__(self, nc: Any) -> None:
        nc.set_auto_maskandscale(False)
        self.nc = nc
        self.grid = nc.sweep_mode == "grid"
        self.levels = int(nc.dimensions["level"].size)
        self.dims = tuple(dim for dim in nc["status"].dimensions if dim != "level")
        self.units = str(nc["u_T_max"].units) if "u_T_max" in nc.variables else "1"
        self._axis_labels = dict[str, tuple[list[str], str]]()
        self.status = np.asarray(self.take("status"))
        self.ok: Flags = self.status == int(PointStatus.OK)

    def take(self, name: str, level: int = -1) -> NDArray[Any] | None:
        """Return (*dims, …) values of a variable on one level, counted from the end.

        None if the file does not have it.
        """
        if name not in self.nc.variables:
            return None
        all_points = (slice(None),) * len(self.dims)
        return np.asarray(self.nc[name][(*all_points, self.levels + level)])

    def flag(self, name: str) -> Flags:
        """Return (*dims) which solved points have a flag."""
        values = self.take(name)
        return self.ok & (values == 1) if values is not None else np.zeros_like(self.ok)

    def failures(self) -> list[Failure]:
        """Return the failures of all levels by their cause, the most frequent first."""
        status = np.asarray(self.nc["status"][...])
        failed = (status != int(PointStatus.OK)) & (status != int(PointStatus.NOT_RUN))
        if not failed.any():
            return []
        reasons = self.nc["reason"][...]
        point_numbers = np.arange(self.ok.size).reshape(self.ok.shape)
        rows = list[FailedSolution]()
        for index in map(tuple, np.argwhere(failed).tolist()):
            place = index[:-1]  # without the level
            status_here = PointStatus(int(status[index]))
            point = int(point_numbers[place])
            rows.append((status_here, str(reasons[index]), self.point_words(place), point))
        return failure_kinds(rows)

    def friction(self, place: Place) -> float:
        """Return ∫|ξ| on the last level at a point."""
        body, point = StoredBody.at(self.nc, int(np.ravel_multi_index(place, self.ok.shape)))
        level = self.levels - 1
        group = body.group(level)
        xi = body.read(group["xi"], level, body.cut(point))
        return float(np.abs(xi) @ body.read(group["c"], level))

    @property
    def opens(self) -> bool:
        """Whether edges of the contact may open."""
        return "opening_max" in self.nc.variables

    @cached_property
    def _scene(self) -> Scene | None:
        """The scene outside the sweep, None where the study in the file cannot be read."""
        study = stored_study(self.nc.__dict__, swept=False)
        return None if study is None else study.scenes[0]

    @property
    def adheres(self) -> bool:
        """Whether an edge that may open is a bond, which a law closes."""
        return self.opens and self._scene is not None and bool(self._scene.adhesive_edges)

    @property
    def is_bond(self) -> bool:
        """Whether all contact edges are bonds that may open, so that what debonds is a crack."""
        if not self.opens or self._scene is None:
            return False
        return set(self._scene.adhesive_edges) == set(self._scene.edges(Contact))

    def open_places(self, place: Place) -> str:
        """Return where the contact is open on the last level at a point; "" if it is not stored."""
        body, point = StoredBody.at(self.nc, int(np.ravel_multi_index(place, self.ok.shape)))
        level = self.levels - 1
        group = body.group(level)
        if "opening" not in group.variables:
            return ""
        opening = body.read(group["opening"], level, body.cut(point))
        edge = np.asarray(body.read(group["opening_edge"], level), dtype=np.intp)
        names = str(group["edge"].__dict__.get("flag_meanings", "")).split()
        is_open = np.asarray(opening > MIN_PLACE * np.max(opening, initial=0.0))
        return open_ranges(is_open, edge, names)

    def symbol(self, name: str) -> str:
        """Return the symbol of the parameter of an axis, with the edge or region it belongs to."""
        return symbol(str(self.nc[name].__dict__.get("long_name", name)))

    def axis_labels(self, name: str) -> tuple[list[str], str]:
        """Return the labels of an axis and their unit as it is read."""
        if name not in self._axis_labels:  # many failed points need the same
            labels, unit = scaled_labels(self.nc[name][...].tolist(), self.nc[name].__dict__)
            self._axis_labels[name] = labels, pretty(unit)
        return self._axis_labels[name]

    def labelled(self, place: Mapping[str, int]) -> list[str]:
        """Return the labels of a point along axes with several values, "θ̄ = 12 K"."""
        texts = list[str]()
        for name, i in place.items():
            if self.nc[name].size <= 1:
                continue
            labels, unit = self.axis_labels(name)
            sign = ": " if self.nc[name].dtype is str else " = "
            texts.append(f"{self.symbol(name)}{sign}{labels[i]} {unit}".rstrip())
        return texts

    def point_words(self, place: Place) -> str:
        """Return the labels of a point of a grid; "" of a list."""
        if not self.grid:
            return ""
        return ", ".join(self.labelled(dict(zip(self.dims, place, strict=True))))


# -- the verdict of a run


def run_verdict(nc: Any) -> Verdict:
    """Return the verdict of the open file of a run."""
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
    most_frequent = failures[0]
    return {"reason": (most_frequent.cause,), "fix": (most_frequent.remedy,)}


def _solved(run: RunSeen, failures: Sequence[Failure], not_run: int) -> tuple[str, ...]:
    """Return how many points are solved, on how many levels, and the largest residual."""
    total, solved = int(run.ok.size), int(run.ok.sum())
    text = f"{solved} of {counted(total, 'point')}"
    if run.levels > 1:
        text += f", {run.levels} levels"
    failed = len({point for failure in failures for point in failure.points})
    if failed:
        text += f"; {failed} failed"
    on_coarser_levels = failed + solved + not_run - total
    if on_coarser_levels > 0:
        text += f", {on_coarser_levels} on coarser levels only"
    if not_run:
        text += f"; {not_run} not run"
    residual = run.take("inclusion_residual")
    if residual is not None:
        finite = residual[run.ok & np.isfinite(residual)]
        if finite.size:
            text += f"; residual ≤ {number(float(finite.max()), 2)}"
    return (text,)


def _answer(run: RunSeen) -> tuple[str, ...]:
    """Return what opens, if edges may, and what slips."""
    return (*_openings(run), *_slips(run))


def _openings(run: RunSeen) -> tuple[str, ...]:
    """Return where the body lifts off or has debonded, the largest opening and normal stresses.

    Empty without edges that may open.
    """
    opening, length = run.take("opening_max"), run.take("opened_length")
    if opening is None or length is None:
        return ()
    place = first_largest(np.where(run.ok, opening, -1.0))
    facts = [_crack(run)]
    if opening[place] == 0.0:
        facts.append("nothing lifts off")
    else:
        largest = f"largest opening {with_unit(float(opening[place]), run.units)}"
        words = run.point_words(place)
        facts += [_lift_off(run, length), f"{largest} at {words}" if words else largest]
    facts.append(_normal_stresses(run))
    return tuple(filter(None, facts))


def _crack(run: RunSeen) -> str:
    """Return how long the crack in a bond is; "" where the debonded length is also another's."""
    span = _length_spans(run).get("debonded")
    if span is None or not run.is_bond:
        return ""
    low, high = span
    if low > 0.0:
        return f"the crack in the bond is {between(low, high, run.units)} long"
    return f"the crack in the bond is up to {with_unit(high, run.units)} long"


def _lift_off(run: RunSeen, length: Array) -> str:
    """Return over which length the contact opens, and where at the point where it is longest.

    "" of bonds alone: most of an elastic one is open a little.

    length: (*dims) that is open
    """
    if run.is_bond:
        return ""
    lengths = length[run.ok]
    low, high = float(lengths.min()), float(lengths.max())
    verb = "opens" if run.adheres else "lifts off"
    over = between(low, high, run.units) if low > 0.0 else f"up to {with_unit(high, run.units)}"
    place = first_largest(np.where(run.ok, length, -1.0))
    where, words = run.open_places(place), run.point_words(place)
    if not words:
        over = with_unit(high, run.units)
        return f"{verb} over {over} {where}".rstrip()
    return f"{verb} over {over} (longest at {', '.join(filter(None, [words, where]))})"


def _normal_stresses(run: RunSeen) -> str:
    """Return the largest peel stress and the largest pressure of all points."""
    units = "1" if run.units == "1" else "Pa"
    largest = dict[str, float]()
    for name in ("peel_stress_max", "pressure_max"):
        values = run.take(name)
        largest[name] = 0.0 if values is None else float(np.max(values[run.ok], initial=0.0))
    peel, pressure = largest.values()
    facts = list[str]()
    if peel > SAME * pressure:
        facts.append(f"largest peel stress {with_unit(peel, units)}")
    if pressure > SAME * peel:
        facts.append(f"pressed with at most {with_unit(pressure, units)}")
    return ", ".join(facts)


def open_ranges(is_open: Flags, edge: NDArray[np.intp], names: Sequence[str]) -> str:
    """Return where a contact is open in words: "at both ends", "in the middle of base".

    Edges are named where several may open.

    is_open, edge: (n,) of the nodes along the line that may open
    """
    places = list[str]()
    edges = list(dict.fromkeys(edge.tolist()))
    for index in edges:
        is_open_here = is_open[edge == index]
        if not is_open_here.any():
            continue
        starts = np.flatnonzero(np.diff(np.append(0, is_open_here)) == 1)
        at_ends = int(is_open_here[0]) + int(is_open_here[-1])
        between_ends = len(starts) - at_ends
        if is_open_here.all():
            words = "everywhere"
        elif between_ends > 1 or (between_ends and at_ends):
            words = f"at {counted(len(starts), 'place')}"
        elif between_ends:
            words = "between its ends"
        else:
            words = "at both ends" if at_ends == 2 else "at one end"
        if len(edges) > 1:
            words = f"{words} ({names[index]})"
        places.append(words)
    return " and ".join(places)


def _slips(run: RunSeen) -> tuple[str, ...]:
    """Return the largest slip with its point, and the lengths that slip, have debonded, …."""
    slip = run.take("u_T_max")
    if slip is None:
        return ()
    place = first_largest(np.where(run.ok, slip, -1.0))
    opening = run.take("opening_max")
    if opening is not None and slip[place] <= SAME * np.max(opening[run.ok]):
        return ()
    if slip[place] == 0.0:
        return ("nothing slips",)
    largest = f"largest slip {with_unit(float(slip[place]), run.units)}"
    words = run.point_words(place)
    facts = [
        f"{largest} at {words}" if words else largest,
        slip_lengths(_lengths_of_slip(run), run.units),
    ]
    shear, arclength = run.take("shear_max"), run.take("shear_max_at")
    has_friction = not (run.opens and shear is not None and np.all(shear[run.ok] == 0.0))
    if run.ok.size == 1 and shear is not None and arclength is not None and has_friction:
        stress = with_unit(shear.item(), "1" if run.units == "1" else "Pa")
        facts.append(f"largest shear {stress} at s = {with_unit(arclength.item(), run.units)}")
    return tuple(filter(None, facts))


def _lengths_of_slip(run: RunSeen) -> dict[str, tuple[float, float]]:
    """Return the lengths of `_length_spans` without that of a crack, which is told before."""
    spans = _length_spans(run)
    if run.is_bond:
        spans.pop("debonded", None)
    return spans


def _length_spans(run: RunSeen) -> dict[str, tuple[float, float]]:
    """Return (least, largest) of the lengths that a verdict names.

    Of a sweep the fewest that tell what happens: no softening, and yielding only alone.
    """
    is_sweep = run.ok.size > 1
    spans = dict[str, tuple[float, float]]()
    for name in LENGTHS:
        if is_sweep and (name == "softening" or (name == "yielded" and spans)):
            continue
        length = run.take(f"{name}_length")
        if length is None:
            continue
        finite = length[run.ok & np.isfinite(length)]
        if finite.size and finite.max() > 0.0:
            spans[name] = float(finite.min()), float(finite.max())
    return spans


# -- proofs and other solutions

CLASSES = {"unique": "unique", "global": "global minimum", "local": "local minimum"}
"""Classes of solutions by their strongest proof, by the words of `text.PROOFS`."""
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


def _trust(run: RunSeen, unique: Flags, ambiguous: Flags) -> tuple[str, ...]:
    """Return what is proved of the solutions of the finest level, and what speaks against them."""
    flags = {name: run.flag(name) for name, _ in PROOFS}
    facts = [f"{proof_classes(flags, run.ok)} (this mesh)", *_of_pressed_friction(run)]
    if run.take("proved_unique") is not None and unique.any():
        of_body = int(run.flag("proved_unique").sum())
        body = proved_object(run.nc.__dict__.get(GUARANTEE, ""))
        facts.append(f"{of_body} of {int(unique.sum())} unique for {body}")
    count, complete = run.take("solutions"), run.take("complete")
    if count is not None and complete is not None:
        facts.append(all_equilibria(count[run.ok], complete[run.ok]))
        facts.append(_equilibria_of_body(run))
    if ambiguous.any():
        points = counted(int(ambiguous.sum()), "point")
        facts.append(f"several solutions found at {points}")
    facts += no_loading_curve(run, ambiguous)
    if "heat_status" in run.nc.variables:
        missed = np.count_nonzero(run.nc["heat_status"][...] == UNBALANCED)
        facts.append(f"heat balance missed at {missed}" if missed else "")
    return tuple(filter(None, facts))


NO_ENERGY = "friction follows the pressure: there is no energy to be least"


def _of_pressed_friction(run: RunSeen) -> list[str]:
    """Return why friction that follows the pressure has no minimum, and when it is unique.

    Empty for other friction. The pressures are a fixed point, unique where their map contracts.
    """
    contraction = run.take("contraction")
    if contraction is None:
        return []
    return [NO_ENERGY, contraction_words(contraction[run.ok])]


def contraction_words(contraction: Array) -> str:
    """Return what the bounds (p,) of the contraction prove at p solved points, NaN for none."""
    bounds = contraction[np.isfinite(contraction)]
    if not bounds.size:
        return "no bound of the contraction, which proves uniqueness below 1"
    low, high = float(bounds.min()), float(bounds.max())
    span = number(high, 2) if low == high else f"{number(low, 2)} to {number(high, 2)}"
    words = f"bound of the contraction {span}: unique below 1"
    if bounds.size < contraction.size:
        words += f", none at {contraction.size - bounds.size}"
    return words


FOLLOW_LOADING = "to follow the loading, take solver.branch: continued or path:"


def no_loading_curve(run: RunSeen, ambiguous: Flags) -> list[str]:
    """Return that a sweep of loads is no loading curve; empty where nothing indicates it.

    With `branch: lowest` the stored solution leaves the branch from rest where another one has
    less energy, long before the fold at which a loaded body leaves it.
    """
    names = run.nc.__dict__.get(SWEPT_LOADS, "").split()
    if run.nc.__dict__.get(BRANCH, "") not in ("lowest", "all"):
        return []
    words = least_energy_words(names, run.take("start_energy"), ambiguous)
    return [words] if words else []


def least_energy_words(loads: Sequence[str], energy: Array | None, ambiguous: Flags) -> str:
    """Return what separates solutions of least energy from a loading curve over these loads.

    energy: (…, s) to which each start led;  ambiguous: (…) more than one solution was found
    """
    if not loads or not ambiguous.any():
        return ""
    parameters = " and ".join(symbol(name) for name in loads)
    if energy is not None and from_rest_left(energy, ambiguous):
        return (
            f"not the loading curve over {parameters}, but the lowest energy found; "
            f"{FOLLOW_LOADING}"
        )
    return (
        f"the lowest energy found need not be the loading curve over {parameters}; {FOLLOW_LOADING}"
    )


def from_rest_left(energy: Array, ambiguous: Flags) -> bool:
    """Return whether the solution of least energy is somewhere not that of descent from zero.

    energy: (…, s) to which each start led, that from zero first
    """
    energies = energy[ambiguous]
    size = np.nanmax(np.abs(energies), axis=-1)
    excess = energies[:, 0] - np.nanmin(energies, axis=-1)
    return bool(np.any(excess > SAME * size))


def several_found(run: RunSeen, unique: Flags) -> Flags:
    """Return (*dims) the solved points at which more than one solution was found."""
    count, energy = run.take("solutions"), run.take("start_energy")
    if count is not None:
        return np.asarray(run.ok & (count > 1))
    if energy is not None:
        return run.ok & several(energy, unique)
    return np.zeros_like(run.ok)


def several(energy: Array, unique: Flags) -> Flags:
    """Return (…) where more than one solution was found.

    Starts (…, s) led to energies that differ by more than rounding, and the solution is not proved
    to be the only one.
    """
    energy = np.sort(energy, axis=-1)
    finite = np.where(np.isfinite(energy), energy, 0.0)
    size = np.max(np.abs(finite), axis=-1, keepdims=True)
    are_different = np.diff(energy, axis=-1) > SAME * size
    return np.asarray(np.any(are_different, axis=-1) & ~unique)


def _equilibria_of_body(run: RunSeen) -> str:
    """Return how many equilibria the body itself has at least; "" where that was not asked for."""
    counts = run.take("solutions_of_body")
    if counts is None or not run.ok.any():
        return ""
    counts = counts[run.ok]
    body = proved_object(run.nc.__dict__.get(GUARANTEE, ""))
    several = np.count_nonzero(counts > 1)
    if several:
        most = counted_in_words(int(counts.max()))
        where = "" if several == len(counts) else f" at {several} of {len(counts)}"
        least = counts[counts > 1].min()
        words = most if least == counts.max() else f"{counted_in_words(int(least))} to {most}"
        return f"{body} has at least {words} equilibria{where}"
    sizes = run.take("existence_size")
    solutions = run.take("solutions")
    if sizes is None or solutions is None or not np.any(solutions[run.ok] > 1):
        return ""
    size = float(np.min(sizes[run.ok][solutions[run.ok] > 1]))  # NaN where it is not known
    words = f"several equilibria of {body} not proved"
    return f"{words}: needs about h_max = {with_unit(size, run.units, 2)}" if size > 0.0 else words


_IN_WORDS = ("no", "one", "two", "three", "four", "five", "six", "seven", "eight", "nine", "ten")


def counted_in_words(count: int) -> str:
    """Return a count in words up to ten."""
    return _IN_WORDS[count] if count < len(_IN_WORDS) else str(count)


def equilibria(count: int, stable: int | None = None, complete: int = 1) -> str:
    """Return a number of equilibria in words.

    stable: how many of them are stable;  complete: the flag of the file, 0 not proved
    """
    words = f"{count}" if complete else f"at least {count}"
    return f"{words}, {stable} stable" if stable is not None and count > 1 else words


def all_equilibria(count: NDArray[np.int_], complete: NDArray[np.int_]) -> str:
    """Return at how many of P points all equilibria are known, and how many these are.

    Empty without points.
    """
    if not len(count):
        return ""
    proved = count[complete > 0]
    words = f"all equilibria proved at {len(proved)} of {len(count)}"
    if len(proved):
        low, high = proved.min(), proved.max()
        words += f" ({low} each)" if low == high else f" ({low} to {high})"
    if np.any(complete == OF_POLYGON):
        words += " of the piecewise-linear approximations of exponential laws"
    return words


MIN_STIFF_RATIO = 1.1
"""λ₁ of a P1 mesh over that of equilibrium elements, above which the mesh is too stiff."""


def proved_object(guarantee: str) -> str:
    """Return what the proofs of a file are of, by its attribute: the body, or a polygon."""
    return f"the {POLYGON}" if guarantee == "polygon" else "the body itself"


def of_the_body(low: Array, high: Array, proved: Flags, units: str, guarantee: str) -> str:
    """Return what is proved of the body itself, by low ≤ λ₁ ≤ high and ω < low.

    low, high: (P,) at the points of the finest level, NaN where a point was not solved [units]
    proved:    (P,) points with ω < low
    guarantee: what the proofs are of (data/store.py)
    """
    is_solved = np.isfinite(low)
    if not is_solved.any():
        return ""
    least = int(np.nanargmin(low))
    least_low, least_high = enclosing(float(low[least]), float(high[least]), units)
    is_constant = float(np.nanmin(low)) > (1.0 - EQUAL) * float(np.nanmax(low))
    verb = "lies" if is_constant else "is least"
    body = proved_object(guarantee)
    words = f"λ₁ of {body} {verb} between {least_low} and {least_high}"
    words += f": one solution for ω below {least_low}, proved up to rounding"
    count, total = int(np.count_nonzero(proved[is_solved])), int(np.count_nonzero(is_solved))
    if not count:
        return words
    points = "this point" if total == 1 else f"{count} of {total} points"
    return f"{words}; so at {points}"


def too_stiff(mesh: Array, dual: Array) -> str:
    """Return that the mesh is too stiff where its λ₁ is far above that of equilibrium elements.

    The cause is a coarse mesh, or volumetric locking for ν near ½.

    mesh, dual: (P,) λ₁ of the mesh and of equilibrium elements, which are not too stiff
    """
    ratio = float(np.nanmax(mesh / dual, initial=0.0, where=np.isfinite(dual)))
    if not ratio > MIN_STIFF_RATIO:
        return ""
    return (
        "the mesh is too stiff (coarse, or locking for ν near ½): its λ₁ is up to "
        f"{number(ratio, 3)} times that of equilibrium elements, so that uniqueness on the mesh "
        "(ω < λ₁) need not hold for the continuous problem; refine, or use the proved bounds of "
        "the body"
    )


# -- the error of the mesh


def _accuracy(run: RunSeen) -> tuple[str, ...]:
    """Return how large the error of the mesh is, as far as that is known."""
    error, how = mesh_error(run)
    facts = [error]
    if not error or how in (HOW["goal"], HOW["energy"]):
        facts.append(how)
    bound = run.take("error_bound_relative")
    if bound is not None:
        of_polygon = run.nc.__dict__.get(GUARANTEE, "") == "polygon"
        bounded_object = f" (of the {POLYGON})" if of_polygon else ""
        facts.append(_error_bound(bound[run.ok], bounded_object))
        facts.append(_slip_bound(run))
    stop = str(run.nc["stop"][-1]) if "stop" in run.nc.variables else ""
    if " not met:" in stop:
        facts.append(stop.partition(":")[0])
    return tuple(filter(None, facts))


def _error_bound(bound: Array, bounded_object: str) -> str:
    """Return how large the error of u is proved to be; "" where that is nothing.

    bound:          (P,) of solved points, relative, NaN where there is none
    bounded_object: what it is of, in brackets, where that is not the body
    """
    is_useful = bound < 1.0
    count, total = int(np.count_nonzero(is_useful)), len(bound)
    if not count or not np.max(bound[is_useful]) > 0.0:
        return ""
    words = f"error of u proved to be at most {percent(float(np.max(bound[is_useful])))}"
    if count < total:
        words += f" at {count} of {total} points, not bounded below 100 % elsewhere"
    return words + bounded_object


def _slip_bound(run: RunSeen) -> str:
    """Return how well the slips are proved to be known; "" where that was not asked for."""
    bounds = run.take("slip_bound")
    slips = run.take("u_T_max")
    if bounds is None or slips is None:
        return ""
    widest = float(np.max(bounds[run.ok], initial=0.0))
    if not np.isfinite(widest):
        return "no bound of the slips is proved at some points"
    largest = float(np.max(slips[run.ok], initial=0.0))
    words = f"mean slips of segments proved to within {with_unit(widest, run.units, 2)}"
    if widest >= largest:
        return f"{words}: more than the largest slip, so it says nothing"
    return f"{words} (largest slip {with_unit(largest, run.units)})"


def mesh_error(run: RunSeen) -> tuple[str, str]:
    """Return the largest relative mesh error of the solved points, and how it is known.

    It is estimated, or else the change by the last level. "" where it is not known.
    """
    of_goal = _goal_error(run)
    if of_goal is not None:
        return of_goal, HOW["goal"]
    estimates = run.take("error_estimate")
    if estimates is not None and np.isfinite(estimates[run.ok]).any():
        return _about(float(np.nanmax(estimates[run.ok]))), HOW["energy"]
    if run.levels < 2 or not run.ok.any():
        return "", HOW["one mesh"]
    change = last_change(run)
    if change is None:
        return "", HOW["no change"]
    how = HOW["change with openings" if run.opens else "change"]
    if change.share >= 1.0:
        return f"mesh too coarse for the order of magnitude of {change.symbol}", how
    at_most = "at most " if run.ok.size > 1 else ""
    text = f"last refinement changed {change.symbol} by {at_most}{percent(change.share)}"
    words = run.point_words(change.place)
    return f"{text} (at {words})" if words else text, how


def _goal_error(run: RunSeen) -> str | None:
    """Return the largest estimated error of the goal; None where it is not estimated."""
    goal, estimate = run.take("goal"), run.take("goal_estimate")
    if goal is None or estimate is None:
        return None
    is_estimated = run.ok & np.isfinite(estimate) & np.isfinite(goal)
    if not is_estimated.any():
        return None
    # a goal that is no larger than its error has no relative error
    is_small = is_estimated & (estimate > 0.0) & (estimate >= np.abs(goal))
    size = np.where(goal == 0.0, 1.0, np.abs(goal))
    is_comparable = is_estimated & ~is_small
    share = (estimate[is_comparable] / size[is_comparable]).max(initial=0.0)
    words = [_about(float(share))] if share > 0.0 else []
    if is_small.any():
        words.append(f"the goal no larger than its mesh error at {is_small.sum()}")
    return ", ".join(words)


def _about(error: float) -> str:
    if error < 1.0:
        return f"mesh error about {percent(error)}"
    return "mesh too coarse for the order of magnitude"


CHANGED = {
    "u_T_max": "max |u_T|",
    "energy": "energy",
    "friction_resultant": "∫ξ",
    "opening_max": "largest opening",
}
"""Results whose change by the last refinement is judged, and their symbols."""
MIN_SIZE = 1e-3
"""Part of the largest value of all points with which smaller values are compared, so that a point
where next to nothing happens does not decide."""


@dataclass(frozen=True)
class MeshChange:
    """The largest relative change by the last refinement: of which result, at which point."""

    share: float
    symbol: str
    place: Place


def last_change(run: RunSeen) -> MeshChange | None:
    """Return the largest relative change of the results of CHANGED by the last refinement.

    That of ∫ξ is relative to ∫|ξ|. None where all of them are rounding. Equilibrium may fix one of
    them, so that it alone says nothing of the mesh.
    """
    changes = [_change_of(run, name) for name in CHANGED]
    judged = [change for change in changes if change is not None]
    return max(judged, key=lambda change: change.share, default=None)


def _change_of(run: RunSeen, name: str) -> MeshChange | None:
    """Return the largest relative change of one result by the last refinement."""
    finest, coarser = run.take(name), run.take(name, -2)
    if finest is None or coarser is None:
        return None
    is_solved = run.ok & (run.take("status", -2) == int(PointStatus.OK))
    is_judged = is_solved & np.isfinite(finest) & np.isfinite(coarser)
    if not is_judged.any():
        return None
    change = np.abs(finest - coarser)
    largest = float(np.abs(finest[is_judged]).max())
    size = np.maximum(np.abs(finest), MIN_SIZE * largest)
    if name == "friction_resultant":
        bound = _relative(change, size, is_judged)
        return _resultant_change(run, change, bound, largest)
    is_judged &= size > 0.0
    if name == "u_T_max":
        is_judged &= np.maximum(np.abs(finest), np.abs(coarser)) > _slip_rounding(run)
    if not is_judged.any():
        return None
    share = _relative(change, size, is_judged)
    place = first_largest(share)
    return MeshChange(float(share[place]), CHANGED[name], place)


NOT_JUDGED = -1.0
"""Relative change of a point that has none: less than any other."""


def _relative(change: Array, size: Array, is_judged: Flags) -> Array:
    """Return (*dims) the change relative to a size, 0 for the size 0, NOT_JUDGED elsewhere."""
    share = np.where(is_judged, 0.0, NOT_JUDGED)
    return np.divide(change, size, out=share, where=is_judged & (size > 0.0))


def _slip_rounding(run: RunSeen) -> Array | float:
    """Return (*dims) the slip that SAME of the largest shear stress of a point causes at most."""
    shear, lambda_1 = run.take("shear_max"), run.take("lambda_1")
    if shear is None or lambda_1 is None:
        return 0.0
    has_bound = np.isfinite(shear) & (lambda_1 > 0.0)
    return np.divide(SAME * shear, lambda_1, out=np.zeros_like(shear), where=has_bound)


def _resultant_change(
    run: RunSeen, change: Array, bound: Array, largest: float
) -> MeshChange | None:
    """Return the largest change of ∫ξ relative to ∫|ξ|.

    |∫ξ| ≤ ∫|ξ|, so that no point whose change relative to the first is less than the largest so far
    need be read.

    bound: (*dims) the change relative to |∫ξ|, or NOT_JUDGED
    """
    most: MeshChange | None = None
    judged_first = np.argsort(-bound, axis=None)
    for k in judged_first[: np.count_nonzero(bound >= 0.0)]:
        place = tuple(int(i) for i in np.unravel_index(k, bound.shape))
        if most is not None and bound[place] <= most.share:
            break
        size = max(run.friction(place), MIN_SIZE * largest)
        if size > SAME * largest:
            share = float(change[place] / size)
            if most is None or share > most.share:
                most = MeshChange(share, CHANGED["friction_resultant"], place)
    return most


# -- abrupt changes over a parameter

MIN_POINTS = 4
"""Points of a line on which a step can be abrupt."""
MIN_STEEPNESS = 4.0
"""An abrupt step is so many times the median of the other steps of its line …"""
MIN_STEP = 0.25
"""… and so large a part of the largest value of the line."""


def abrupt(run: RunSeen, several: Flags) -> list[str]:
    """Return where the slip changes abruptly between two values of a parameter, the largest first.

    It is called a jump only if several solutions were found at one of the two points. A solution
    that is unique on the way (ω < λ₁) changes steeply, but continuously, and two points do not tell
    a steep change from a jump.
    """
    slip = run.take("u_T_max")
    if not run.grid or slip is None:
        return []
    values = np.where(run.ok, slip, np.nan)
    steps = list[tuple[float, str]]()
    for axis, name in enumerate(run.dims):
        if run.nc[name].dtype is str or values.shape[axis] < MIN_POINTS:
            continue
        lines, several_on_lines = np.moveaxis(values, axis, -1), np.moveaxis(several, axis, -1)
        steps += _abrupt_step(run, name, lines, several_on_lines)
    return [text for _, text in sorted(steps, reverse=True)]


def _abrupt_step(
    run: RunSeen, name: str, lines: Array, several: Flags
) -> Iterator[tuple[float, str]]:
    """Yield the largest abrupt step along the axis of a parameter, and its sentence."""
    step = np.abs(np.diff(lines, axis=-1))
    ordered = np.sort(step, axis=-1)  # NaN last
    largest, size = ordered[..., -1], np.max(np.abs(lines), axis=-1)
    usual_step = np.median(ordered[..., :-1], axis=-1)
    with np.errstate(invalid="ignore"):
        is_abrupt = (largest > MIN_STEEPNESS * usual_step) & (largest > MIN_STEP * size)
    if not is_abrupt.any():
        return
    most_abrupt = int(np.argmax(np.where(is_abrupt, largest, 0.0)))
    line = tuple(int(i) for i in np.unravel_index(most_abrupt, is_abrupt.shape))
    start = int(np.argmax(step[line]))
    change = float(step[line][start])

    labels, unit = run.axis_labels(name)
    ends = f"{labels[start]} and {labels[start + 1]} {unit}"
    place = f"between {run.symbol(name)} = {ends}".rstrip()
    other_dims = [dim for dim in run.dims if dim != name]
    other_labels = run.labelled(dict(zip(other_dims, line, strict=True)))
    if other_labels:
        place += f" ({', '.join(other_labels)})"
    if several[line][start : start + 2].any():
        yield change, f"slip jumps {place}"
    else:
        yield change, f"slip changes by {with_unit(change, run.units, 2)} {place}"


# -- convergence


def order(slope: float, error: float, digits: int = 2) -> str:
    """Return a measured order ± its standard error; of two levels it is marked as a guess."""
    if not np.isfinite(slope):
        return "–"
    uncertainty = f" ± {number(error, 1)}" if np.isfinite(error) else GUESS
    return f"{slope:z.{digits}f}{uncertainty}"


GOOD = ("as_expected", "faster")
"""Verdicts of orders that are as expected or better."""
BAD = {
    "slower": "slower than expected",
    "pre_asymptotic": "pre-asymptotic (rates still vary)",
}
"""Verdicts of other orders, in words."""
OPEN = {
    "too_few_levels": ("has only two levels", "have only two levels"),
    "exact": ("error is rounding", "errors are rounding"),
    "unknown": ("has corners that are not analysed", "have corners that are not analysed"),
}
"""Verdicts by which an order cannot be judged, in words for one and for several of them."""


def orders(verdicts: Iterable[tuple[str, str]]) -> list[str]:
    """Return the judgement of measured orders, from the symbol of each error and its verdict.

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
    facts = [f"{good} of {judged} orders are as expected or better"]
    for bad_verdict, words in BAD.items():
        symbols = {symbol for symbol, verdict in measured if verdict == bad_verdict}
        if symbols:
            facts.append(f"{count[bad_verdict]} {words}: {', '.join(sorted(symbols))}")
    if open_words:
        facts.append(f"not judged: {', '.join(open_words)}")
    return facts


# -- histories

KINDS = {
    "shakedown": "shake down",
    "closed": "close their loop",
    "settled": "reach a steady cycle",
    "walking": "walk",
    "ratcheting": "ratchet",
    "settling": "do not reach a steady cycle",
}
"""What the histories of a sweep do, by the kind of `cycle_change`."""


def cycle_change(
    v: Array, dissipated: Array, units: tuple[str, str] = ("m", "J m-1"), rounding: float = 0.0
) -> tuple[str, str]:
    """Return (kind, sentence) of the change from cycle to cycle, from the slips at their ends.

    shakedown:  the last cycle changed no slip and dissipated nothing
    closed:     it changed no slip
    walking:    it changed all slips alike, as the one before did
    ratcheting: it changed slips as the one before did
    settled:    it changed them otherwise, but by no more than EQUAL of the largest
    settling:   it changed them by more
    "":         there are less than two

    v:          (C + 1, m) at the start and the end of every cycle
    dissipated: (C,) in each cycle
    units:      of slips and of energies
    rounding:   slip that rounding of the forces may cause in a cycle
    """
    if len(v) < 3:
        return "", ""
    size = float(np.max(np.abs(v))) or 1.0
    change, change_before = v[-1] - v[-2], v[-2] - v[-3]
    largest, unchanged = float(np.max(np.abs(change))), max(SAME * size, rounding)
    moved = with_unit(largest, units[0], 6)
    if largest <= unchanged:
        if dissipated[-1] <= SAME * float(np.max(dissipated)):
            words = "the last cycle leaves the slips as they were and dissipates nothing"
            return "shakedown", f"shakedown: {words}"
        was_unchanged = float(np.max(np.abs(change_before))) <= unchanged
        return "closed", f"plastic shakedown: {_closed_loop(dissipated, was_unchanged, units[1])}"
    equal = max(EQUAL * largest, rounding)
    if np.max(np.abs(change - change_before)) <= equal:
        if np.ptp(change) <= equal:
            words = f"the last two cycles each moved the whole contact line by {moved}"
            return "walking", f"walking: {words}"
        words = f"the last two cycles each added slips of up to {moved}"
        return "ratcheting", f"ratcheting: {words}"
    if largest <= EQUAL * size:
        share = f"{largest / size:.0e}"
        words = f"steady cycle: the last cycle changed slips by at most {share} of the largest"
        return "settled", words
    words = f"the last cycle changed slips by up to {moved}, unlike the one before"
    return "settling", f"no steady cycle: {words}"


def _closed_loop(dissipated: Array, was_unchanged: bool, units: str) -> str:
    """Return what the last two cycles dissipate, of which the last leaves no net slip.

    was_unchanged: whether the one before left none, too
    """
    energy_before, energy = dissipated[-2:]
    difference = abs(energy - energy_before)
    if difference <= EQUAL_DISSIPATION * max(energy_before, energy) and was_unchanged:
        return "the last two cycles dissipate the same and leave no net slip"
    return (
        f"the last cycle leaves no net slip; it dissipates {with_unit(float(energy), units, 6)}, "
        f"the one before {with_unit(float(energy_before), units, 6)}"
    )


# -- paths

WHOLE = "all branches of equilibria in the range are proved to be known"
"""Of a path with every branch."""
CONNECTED = "the connected branch only; other branches are not excluded"
"""Of every other path."""
