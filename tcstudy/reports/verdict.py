"""A run in a few words: what slips, debonds or jumps where; what is proved and how exact it is; how much is solved.

It reads the few variables that it speaks of and, of a file, only their last levels, without the libraries of tables
and pictures: the sentence of a file of a million points takes no longer than its bytes. The words are those of
`sentences`, with what must be true for them.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tcstudy.data.schema import UNBALANCED, PointStatus
from tcstudy.errors import StoreError
from tcstudy.reports import sentences
from tcstudy.reports.text import pretty, scaled_labels, with_unit
from tcstudy.scene.keys import symbol

Flags = NDArray[np.bool_]

FEWEST, STEEP, NOTABLE = 4, 4.0, 0.25
"""A step is abrupt where a line has so many points, it is so many times the median of the others and so large a part
of the largest value of the whole line."""
PIECE = 2**16
"""Points that are looked at together."""


@dataclass(frozen=True)
class RunSeen:
    """A run as the sentence sees it.

    dims:   sweep dimensions;  levels: how many;  mode: "grid" or "list"
    labels: values and attributes along a dimension, by name
    take:   values of a variable on one level, counted from the end, (*dims, …); None if the file has none
    friction: ∫|ξ| on the last level at a point, by its indices along the dimensions
    units:  of the slip
    stop:   why refinement ended, empty if nothing decided it
    """

    dims: tuple[str, ...]
    levels: int
    mode: str
    labels: Callable[[str], tuple[NDArray[Any], Mapping[str, Any]]]
    take: Callable[[str, int], NDArray[Any] | None]
    friction: Callable[[tuple[int, ...]], float] = lambda place: 0.0
    units: str = "1"
    stop: str = ""

    def ok(self, level: int = -1) -> Flags:
        """(*dims) which points have a solution on a level."""
        return np.asarray(self.take("status", level) == int(PointStatus.OK))

    def flag(self, name: str, ok: Flags) -> Flags:
        """(*dims) which solved points have a flag."""
        values = self.take(name, -1)
        return ok & (values == 1) if values is not None else np.zeros_like(ok)


def verdict(path: Path) -> tuple[str, str, bool]:
    """Of a file of tcstudy run, which must be readable (`tcstudy.data.reading`): the sentence, how the mesh
    error in it is known, and whether all points are solved. Raises StoreError.
    """
    import netCDF4

    with closing(netCDF4.Dataset(path)) as nc:
        if not {"status", "level"} <= {*nc.variables}:
            raise StoreError(f"{path} is no file of tcstudy run, converge, cost or path")
        nc.set_auto_maskandscale(False)
        dims, levels = tuple(d for d in nc["status"].dimensions if d != "level"), int(nc.dimensions["level"].size)

        def take(name: str, level: int) -> NDArray[Any] | None:
            if name not in nc.variables:
                return None
            return np.asarray(nc[name][(slice(None),) * len(dims) + (levels + level,)])

        def labels(dim: str) -> tuple[NDArray[Any], Mapping[str, Any]]:
            return np.asarray(nc[dim][...]), nc[dim].__dict__

        def friction(place: tuple[int, ...]) -> float:
            where, home = dict(zip(dims, place, strict=True)), nc
            if "geometry" in nc.variables:
                home = nc[f"geometry_{int(nc['geometry'][tuple(where[d] for d in nc['geometry'].dimensions)])}"]
            group = home[f"level_{levels - 1}"]
            xi = group["xi"][tuple(where[d] for d in group["xi"].dimensions[:-1])]
            return float(np.abs(xi) @ group["c"][...])

        units = str(nc["u_T_max"].units) if "u_T_max" in nc.variables else "1"
        stop = str(nc["stop"][-1]) if "stop" in nc.variables else ""
        return _told(RunSeen(dims, levels, str(nc.sweep_mode), labels, take, friction, units, stop))


def _told(run: RunSeen) -> tuple[str, str, bool]:
    ok = run.ok()
    total, solved = int(ok.size), int(ok.sum())
    unique = run.flag("unique", ok)
    several = _several(run, ok, unique)
    error, no_larger, estimated, how = mesh_error(run, ok)
    heat = [run.take("heat_status", i - run.levels) for i in range(run.levels)]
    bad = sum(int(np.count_nonzero(one == UNBALANCED)) for one in heat if one is not None)
    body, number, complete = (run.take(name, -1) for name in ("proved_unique", "solutions", "complete"))
    bound = run.take("error_bound_relative", -1)
    answer = [_answer(run, ok), *abrupt(run, ok, several)[:2]]
    trust = [
        sentences.proved(int(unique.sum()), int(run.flag("global_minimum", ok).sum())),
        f"{int((ok & (body == 1)).sum())} of them for the body itself" if body is not None else "",
        sentences.bounded(bound[ok]) if bound is not None else "",
        sentences.all_equilibria(number[ok], complete[ok]) if number is not None and complete is not None else "",
        f"{int(several.sum())} with more than one solution found" if several.any() else "",
        sentences.mesh_error(error, estimated, no_larger),
        sentences.missed(run.stop),
        f"heat balance missed at {bad}" if bad else "",
    ]
    told = sentences.answered(
        answer, [", ".join(filter(None, trust))] if solved else [], [f"{solved} of {total} solved"]
    )
    return told, how, solved == total


LENGTHS = {"slip": "slips", "debonded": "debonded", "softening": "softening", "yielded": "yielded"}
"""Lengths of the contact line of which the sentence speaks, by what happens there."""


def _answer(run: RunSeen, ok: Flags) -> str:
    """The largest slip with its point, and the lengths on which the line slips, has debonded, softens or yields."""
    slip = run.take("u_T_max", -1)
    if slip is None or not ok.any():
        return ""
    most = np.unravel_index(int(np.argmax(np.where(ok, slip, -1.0))), ok.shape)
    if slip[most] == 0.0:
        return "nothing slips"
    lengths = dict[str, tuple[str, str]]()
    for name, what in LENGTHS.items():
        if ok.size > 1 and name in ("softening", "yielded") and (name == "softening" or lengths):
            continue  # of a sweep the least that says it
        own = run.take(f"{name}_length", -1)
        if own is not None and (known := own[ok & np.isfinite(own)]).size and known.max() > 0.0:
            low, high = (with_unit(float(x), run.units, 3) for x in (known.min(), known.max()))
            lengths[what] = (low if known.min() > 0.0 else "", high)
    place = dict(zip(run.dims, (int(i) for i in most), strict=True)) if run.mode == "grid" else {}
    words = ", ".join(_labelled(run, place))
    told = sentences.slipped(with_unit(float(slip[most]), run.units), f" at {words}" if words else "", lengths)
    shear, at = run.take("shear_max", -1), run.take("shear_max_at", -1)
    if ok.size > 1 or shear is None or at is None:
        return told
    stress = "1" if run.units == "1" else "Pa"
    return f"{told}, largest shear {with_unit(shear.item(), stress)} at s = {with_unit(at.item(), run.units)}"


def _labelled(run: RunSeen, place: dict[str, int]) -> list[str]:
    """The labels of a point along axes with several values, "θ̄ = 12 K", "friction: brittle"."""
    found = []
    for name, i in place.items():
        values = run.labels(name)[0]
        if len(values) > 1:
            labels, unit = _shown(run, name)
            mark = ": " if values.dtype.kind in "OUS" else " = "
            found.append(f"{symbol(name)}{mark}{labels[i]} {unit}".rstrip())
    return found


def _several(run: RunSeen, ok: Flags, unique: Flags) -> Flags:
    """(*dims) solved points at which more than one solution was found, piece by piece to save memory."""
    if (count := run.take("solutions", -1)) is not None:
        return np.asarray(ok & (count > 1))
    starts = run.take("start_energy", -1)
    if starts is None:
        return np.zeros_like(ok)
    rows = starts.reshape(ok.size, -1)
    parts = [slice(first, first + PIECE) for first in range(0, ok.size, PIECE)]
    found = [sentences.several(rows[part], unique.ravel()[part]) for part in parts]
    return np.asarray(ok & np.concatenate(found).reshape(ok.shape))


def mesh_error(run: RunSeen, ok: Flags) -> tuple[float | None, int, bool, str]:
    """The largest relative mesh error of the solved points (None if there is none), points whose goal is no larger than
    its error, whether it is an estimate, and how it is known.
    """
    goal, wide = run.take("goal", -1), run.take("goal_estimate", -1)
    if goal is not None and wide is not None and np.any(known := ok & np.isfinite(wide) & np.isfinite(goal)):
        small = known & (wide > 0.0) & (wide >= np.abs(goal))
        share = (wide[known & ~small] / np.where(goal == 0.0, 1.0, np.abs(goal))[known & ~small]).max(initial=0.0)
        return float(share) or None, int(small.sum()), True, sentences.HOW["goal"]
    estimates = run.take("error_estimate", -1)
    if estimates is not None and np.isfinite(estimates[ok]).any():
        return float(np.nanmax(estimates[ok])), 0, True, sentences.HOW["energy"]
    if run.levels < 2 or not ok.any():
        return None, 0, False, sentences.HOW["one mesh"]
    change = _change(run, ok)
    return change, 0, False, sentences.HOW["no friction" if change is None else "change"]


def _change(run: RunSeen, ok: Flags) -> float | None:
    """Largest change of ∫ξ between the last two levels, relative to ∫|ξ|; None where there is no friction.

    |∫ξ| ≤ ∫|ξ|, so that no point whose change relative to the first is less than what was found need be read.
    """
    last, before, both = run.take("friction_resultant", -1), run.take("friction_resultant", -2), ok & run.ok(-2)
    if last is None or before is None:
        return None
    both &= np.isfinite(last) & np.isfinite(before)
    change = np.abs(last - before)
    most = np.divide(change, np.abs(last), out=np.where(change > 0.0, np.inf, 0.0), where=last != 0.0)
    largest: float | None = None
    for k in np.argsort(-np.where(both, most, -1.0), axis=None)[: both.sum()]:
        place = tuple(int(i) for i in np.unravel_index(k, most.shape))
        if largest is not None and most[place] <= largest:
            break
        if (size := run.friction(place)) > 0.0:
            largest = max(largest or 0.0, float(change[place] / size))
    return largest


def abrupt(run: RunSeen, ok: Flags, several: Flags) -> list[str]:
    """Sentences on where the slip changes abruptly between neighbouring values of a swept number, the largest first."""
    slip = run.take("u_T_max", -1)
    if run.mode != "grid" or slip is None:
        return []
    values, found = np.where(ok, slip, np.nan), list[tuple[float, str]]()
    for axis, name in enumerate(run.dims):
        if run.labels(name)[0].dtype.kind in "OUS" or values.shape[axis] < FEWEST:
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
        change, seen = float(step[line][at]), bool(np.moveaxis(several, axis, -1)[line][at : at + 2].any())
        told = sentences.abrupt(with_unit(change, run.units, 2), _between(run, name, at, where), seen)
        found.append((change, told))
    return [text for _, text in sorted(found, reverse=True)]


def _between(run: RunSeen, name: str, at: int, where: dict[str, int]) -> str:
    """ "between θ̄ = 12 and 14 K (friction: brittle)"."""
    labels, unit = _shown(run, name)
    ends = f"between {symbol(name)} = {labels[at]} and {labels[at + 1]} {unit}".rstrip()
    rest = _labelled(run, where)
    return ends + (f" ({', '.join(rest)})" if rest else "")


def _shown(run: RunSeen, name: str) -> tuple[list[str], str]:
    """The labels of an axis and their unit as it is read."""
    values, attrs = run.labels(name)
    shown, unit = scaled_labels(values.tolist(), attrs)
    return shown, pretty(unit) if unit != "1" else ""
