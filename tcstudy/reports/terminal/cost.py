"""What a file of accuracy against cost says: its settings, the front, how the study compares; the report as tables."""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from tcstudy.accuracy.orders import dominated
from tcstudy.data.schema import PointStatus
from tcstudy.data.tables import MEASURES
from tcstudy.errors import DrawError
from tcstudy.reports.sentences import percent
from tcstudy.reports.terminal.convergence import notes
from tcstudy.reports.terminal.tables import Heading, Part, Table
from tcstudy.reports.text import counted

SYMBOLS = {measure.name: measure.symbol for measure in MEASURES}
DEFAULT = "u_energy"


@dataclass(frozen=True)
class Setting:
    """One measured setting.

    error:     relative;  time, upper: least wall time of all runs and their upper quartile [s]
    h_max:     longest edge of its mesh
    dominated: whether another setting is as fast and as accurate, or is this one in a simpler family of meshes
    solved:    whether it passed its acceptance test
    own:       whether it is the study's own
    """

    family: str
    solver: str
    level: int
    h_max: float
    n_dof: int
    n_contact: int
    error: float
    time: float
    upper: float
    dominated: bool
    solved: bool
    own: bool

    @property
    def words(self) -> str:
        """The setting in words; "study" is its own family of meshes."""
        family = "the study's meshes" if self.family == "study" else self.family
        return f"{family}, level {self.level}, {self.solver}"

    @property
    def curve(self) -> tuple[str, str]:
        """Family and solver."""
        return self.family, self.solver


@dataclass(frozen=True)
class Stretch:
    """A range of errors, from `start` down to `end`, that a family with a solver reaches in the least time."""

    family: str
    solver: str
    start: float
    end: float


STEPS = 400
NOTABLE = 1.05
"""Ratio of times from which on another curve takes over: less is noise."""
EXACT = 1e-10
"""Relative error that is rounding: a solution in the P1 space of every mesh has no other."""
SAME = 1e-9
"""Relative difference of the errors of one mesh that two families begin with."""


def measure_of(data: Any, wanted: str | None) -> str:
    """The error to report: the one asked for, or of u in energy. Raises DrawError if the file does not have it."""
    held = [m.name for m in MEASURES if f"error_{m.name}" in data]
    if not held:
        raise DrawError("the file has no errors: nothing was there to compare with")
    name = wanted or (DEFAULT if DEFAULT in held else held[0])
    if name not in held:
        raise DrawError(f"there is no error {name!r} in the file; it has {', '.join(held)}")
    return name


def settings(data: Any, measure: str) -> list[Setting]:
    """All settings that were measured, family by family, coarse to fine.

    One mesh that two families share counts once for `dominated`, in the simplest of them and with the least of its
    times, whose difference is noise; `dominated` in the file lets both stand.
    """
    own = (data.attrs["own_family"], data.attrs["own_solver"], int(data.attrs["own_level"]))
    names = [data[dim].values.tolist() for dim in ("family", "solver")]
    sizes = (data["h_max"].values, data["n_dof"].values, data["n_contact"].values)
    errors, times, status = (data[name].values for name in (f"error_{measure}", "time", "status"))
    found = []
    for f, s, level in np.argwhere(status != PointStatus.NOT_RUN).tolist():
        name, runs = (str(names[0][f]), str(names[1][s]), level), times[f, s, level]
        upper = float(np.quantile(runs, 0.75)) if np.all(np.isfinite(runs)) else float("nan")
        h, n_dof, n_contact = (one[f, level] for one in sizes)
        solved = int(status[f, s, level]) == PointStatus.OK
        found.append(Setting(*name, float(h), int(n_dof), int(n_contact), float(errors[f, s, level]), float(runs.min()),
                             upper, dominated=True, solved=solved, own=name == own))  # fmt: skip
    first = [next(o for o in found if o is s or _one_mesh(s, o)) for s in found]
    counts = [a is b and s.solved for a, b, s in zip(first, found, found, strict=True)]
    least = [min(o.time for o, one in zip(found, first, strict=True) if one is s or o is s) for s in found]
    beaten = dominated(np.where(counts, least, np.nan), np.array([s.error for s in found]))
    return [replace(s, dominated=bool(b)) for s, b in zip(found, beaten, strict=True)]


def front(found: Sequence[Setting]) -> list[Setting]:
    """Settings that no other beats in both, from fast to accurate."""
    return sorted((s for s in found if not s.dominated), key=lambda s: s.time)


def stretches(found: Sequence[Setting]) -> list[Stretch]:
    """Which curve is the fastest to reach an error, from coarse to fine, as far as two mesh families reach.

    Between levels, times are interpolated on logarithmic scales: a slightly different maxh has such an error.
    """
    curves: dict[tuple[str, str], list[Setting]] = {}
    for s in found:
        if s.solved and s.error > 0.0:  # families that begin with one mesh have the least of its times
            same = (o.time for o in found if s.level == o.level == 0 and _one_mesh(s, o))
            curves.setdefault(s.curve, []).append(replace(s, time=min(same, default=s.time)))
    reached: dict[str, float] = {}
    for (family, _), curve in curves.items():
        reached[family] = min(reached.get(family, np.inf), *(s.error for s in curve))
    high = max((s.error for curve in curves.values() for s in curve), default=0.0)
    if high <= EXACT:
        return []
    parts: list[Stretch] = []
    for error in np.geomspace(high, sorted(reached.values())[:2][-1], STEPS).tolist():
        times = {name: _time_to(curve, error) for name, curve in curves.items()}
        now = (parts[-1].family, parts[-1].solver) if parts else None
        near = [name for name, time in times.items() if time <= NOTABLE * min(times.values())]
        if now in near:
            parts[-1] = replace(parts[-1], end=error)
        else:  # of those that noise cannot tell apart the first, which is the simplest
            parts.append(Stretch(*near[0], error, error))
    return parts


def _one_mesh(s: Setting, other: Setting) -> bool:
    """Whether two settings are one problem on one mesh, such as the first of two families."""
    if (s.solver, s.n_dof, s.n_contact, s.h_max) != (other.solver, other.n_dof, other.n_contact, other.h_max):
        return False
    return s.solved and other.solved and abs(s.error - other.error) <= SAME * s.error


def _time_to(curve: Sequence[Setting], error: float) -> float:
    """Least time in which a curve gets to an error; infinite if it does not."""
    slack = error * (1 + 1e-12)
    times = [s.time for s in curve if s.error <= slack]
    for a, b in itertools.pairwise(curve):
        if a.error > error >= b.error:
            share = np.log(a.error / error) / np.log(a.error / b.error)
            times.append(a.time * (b.time / a.time) ** share)
    return min(times, default=np.inf)


def best(found: Sequence[Setting]) -> tuple[str, str] | None:
    """The curve to take when accuracy is wanted: the fastest at the least error that two mesh families reach."""
    parts = stretches(found)
    return (parts[-1].family, parts[-1].solver) if parts else None


def advice(found: Sequence[Setting]) -> list[str]:
    """Sentences: what is best at which error, and how the study's own settings compare."""
    measured = [s for s in found if s.solved and np.isfinite(s.error)]
    if measured and max(s.error for s in measured) <= EXACT:
        least = min(measured, key=lambda s: s.time)
        return [
            f"All errors are rounding (at most {max(s.error for s in measured):.1e}): every mesh represents this "
            f"solution exactly, so more unknowns only cost time. Fastest: {least.words} in {seconds(least.time)}."
        ]
    told = [f"Fastest: {'; '.join(_stretch(s) for s in stretches(found))}."] if stretches(found) else []
    own = next((s for s in found if s.own), None)
    if own is None:
        return told
    if not (own.solved and np.isfinite(own.error)):
        return [*told, f"The study's own settings ({own.words}) were not solved."]
    told.append(f"The study's own settings ({own.words}): error {percent(own.error)} in {seconds(own.time)}.")
    solved = [s for s in found if s.solved and np.isfinite(s.error) and not s.own]
    cheaper = min((s for s in solved if s.error <= own.error), key=lambda s: s.time, default=None)
    closer = min((s for s in solved if s.time <= own.time), key=lambda s: s.error, default=None)
    better = [s for s in (cheaper, closer) if s is not None and s.time < own.time and s.error < own.error]
    better = [s for s in better if not _one_mesh(s, own)]
    if not better:
        told.append("No other setting measured is both faster and more accurate.")
    if len(better) == 2 and _one_mesh(*better):
        better.pop()
    for s in dict.fromkeys(better):
        told.append(
            f"Faster and more accurate: {s.words}: {s.error / own.error:.2f} of the error in {s.time / own.time:.2f} "
            f"of the time ({percent(s.error)} in {seconds(s.time)})."
        )
    return told


def _stretch(one: Stretch) -> str:
    family = "the study's meshes" if one.family == "study" else f"{one.family} meshes"
    start, end = percent(one.start), percent(one.end)
    return f"{family} with {one.solver} for errors " + (f"of {end}" if start == end else f"from {start} to {end}")


def seconds(time: float) -> str:
    """A wall time, "0.16 s"."""
    return f"{time:.2g} s" if time < 99.5 else f"{time:.0f} s"


def parts(data: Any, *_: Any) -> Iterator[Part]:
    """Everything the report says, in order. Raises DrawError where there is no error."""
    measure = measure_of(data, None)
    found = settings(data, measure)
    yield Heading(f"Accuracy against cost: {data.attrs['title']}", 1)
    yield from advice(found)
    where = f"Scene: {data.attrs['point']}. " if data.attrs["point"] else ""
    reference, runs = data.attrs["reference"].removeprefix("the "), counted(data.sizes["run"], "run")
    yield (
        f"{where}Errors of {SYMBOLS[measure]} against the {reference}. Wall time from the body "
        f"to the displacements, each run from nothing: least of {runs}, upper quartile."
    )
    yield _measured(found, data["solver"].values.tolist(), SYMBOLS[measure])
    yield from notes(data)


def verdict(data: Any) -> tuple[str, str, bool]:
    """What to take of the settings measured."""
    held = [m.name for m in MEASURES if f"error_{m.name}" in data]
    told = advice(settings(data, measure_of(data, None))) if held else ["Nothing was measured."]
    return " ".join(told), "", True


def _measured(found: Sequence[Setting], solvers: Sequence[str], symbol: str) -> Table:
    """Size, error and the time of every solver by mesh family and level."""
    rows = []
    for family, level in dict.fromkeys((s.family, s.level) for s in found):
        by_solver = {s.solver: s for s in found if (s.family, s.level) == (family, level)}
        one = by_solver.get(solvers[0]) or next(iter(by_solver.values()))
        row = [family, str(level), str(one.n_dof), str(one.n_contact), _error(one)]
        for s in map(by_solver.get, solvers):
            mark = "" if s is None else "†" * s.own + "*" * (not s.dominated)
            row += ["–", "–"] if s is None else [f"{s.time:.3g}{mark}", f"{s.upper:.3g}"]
        rows.append(tuple(row))
    timed = [word for solver in solvers for word in (f"{solver} [s]", "quartile")]
    header = ("meshes", "level", "dofs", "contact unknowns", f"error of {symbol}", *timed)
    notes = ("* on the front   † the study's own settings   (error) not solved",)
    return Table("All that was measured", header, tuple(rows), notes, (0,) * len(header))


def _error(setting: Setting) -> str:
    text = f"{setting.error:.3e}" if np.isfinite(setting.error) else "–"
    return text if setting.solved else f"({text})"
