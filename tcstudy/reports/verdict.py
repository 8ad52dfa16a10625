"""A run in one sentence: what was solved, what is proved, how exact it is, where the slip jumps.

It reads the few variables that it speaks of and, of a file, only their last levels, without the libraries of tables
and pictures: the sentence of a file of a million points takes no longer than its bytes.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tcstudy.data.records import PointStatus
from tcstudy.data.schema import UNBALANCED
from tcstudy.errors import StoreError
from tcstudy.reports.text import pretty, scaled_labels
from tcstudy.scene.key import symbol

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]

FEWEST, STEEP, NOTABLE = 4, 4.0, 0.25
"""A jump is told from a slope where a line has so many points, a step is so many times the median of the others and
so large a part of the largest value of the whole line."""
PIECE = 2**16
"""Points that are looked at together."""
SAME = 1e-9
"""Relative difference of two energies that are one."""


@dataclass(frozen=True)
class RunSeen:
    """A run as the sentence sees it.

    dims:   sweep dimensions;  levels: how many;  mode: "grid" or "list"
    labels: values and attributes along a dimension, by name
    take:   values of a variable on one level, counted from the end, (*dims, …); None if the file has none
    """

    dims: tuple[str, ...]
    levels: int
    mode: str
    labels: Callable[[str], tuple[NDArray[Any], Mapping[str, Any]]]
    take: Callable[[str, int], NDArray[Any] | None]

    def ok(self, level: int = -1) -> Flags:
        """(*dims) which points have a solution on a level."""
        return np.asarray(self.take("status", level) == int(PointStatus.OK))


def verdict(path: Path) -> dict[str, Any]:
    """Of a file of tcstudy run, which must be readable (`tcstudy.data.reading`): the sentence as `text`, how the mesh
    error in it is known as `how`, and whether all points are solved as `ok`. Raises StoreError.
    """
    import netCDF4

    with closing(netCDF4.Dataset(path)) as nc:
        if not {"status", "level"} <= {*nc.variables}:
            raise StoreError(f"{path} is no file of tcstudy run, converge, cost or path")
        nc.set_auto_maskandscale(False)
        dims = tuple(d for d in nc["status"].dimensions if d != "level")

        def take(name: str, level: int) -> NDArray[Any] | None:
            if name not in nc.variables:
                return None
            return np.asarray(nc[name][(slice(None),) * len(dims) + (nc.dimensions["level"].size + level,)])

        def labels(dim: str) -> tuple[NDArray[Any], Mapping[str, Any]]:
            return np.asarray(nc[dim][...]), nc[dim].__dict__

        return _told(RunSeen(dims, int(nc.dimensions["level"].size), str(nc.sweep_mode), labels, take))


def _told(run: RunSeen) -> dict[str, Any]:
    ok = run.ok()
    total, solved = int(ok.size), int(ok.sum())
    parts = [f"{solved} of {total} solved"]
    unique, lowest = (_count(run, name, ok) for name in ("unique", "global_minimum"))
    parts.append(f"{unique} proved unique" if unique else "none proved unique")
    if lowest > unique:
        parts.append(f"{lowest} proved to have the least energy")
    if several := _several(run, ok):
        parts.append(f"{several} with more than one solution found")
    error, how = mesh_error(run, ok)
    if error is not None:
        parts.append(f"mesh error about {_percent(error)}")
    if places := jumps(run, ok)[:2]:
        parts.append(f"slip jumps {' and '.join(places)}")
    heat = [run.take("heat_status", i - run.levels) for i in range(run.levels)]
    if bad := sum(int(np.count_nonzero(one == UNBALANCED)) for one in heat if one is not None):
        parts.append(f"heat balance missed at {bad}")
    return {"text": ", ".join(parts) + ".", "how": how, "ok": solved == total}


def _count(run: RunSeen, name: str, ok: Flags) -> int:
    values = run.take(name, -1)
    return int(np.count_nonzero(ok & (values == 1))) if values is not None else 0


def _several(run: RunSeen, ok: Flags) -> int:
    """Solved points at which starts led to different energies, counted piece by piece to save memory."""
    starts = run.take("start_energy", -1)
    if starts is None:
        return 0
    rows, solved = starts.reshape(ok.size, -1), ok.ravel()
    parts = (slice(first, first + PIECE) for first in range(0, ok.size, PIECE))
    return sum(int(np.count_nonzero(solved[part] & (different_energies(rows[part]) > 1))) for part in parts)


def _percent(error: float) -> str:
    return f"{100 * error:.0f} %" if error >= 0.1 else f"{100 * error:.2g} %" if error >= 1e-6 else f"{error:.1e}"


def mesh_error(run: RunSeen, ok: Flags) -> tuple[float | None, str]:
    """The largest relative mesh error of the solved points and how it is known; None if it is not."""
    goal, wide = run.take("goal", -1), run.take("goal_estimate", -1)
    if goal is not None and wide is not None and np.any(known := ok & np.isfinite(wide) & (goal != 0.0)):
        return float(np.max(wide[known] / np.abs(goal[known]))), "largest estimated error of the goal of the meshes"
    estimates = run.take("error_estimate", -1)
    if estimates is not None and np.isfinite(estimates[ok]).any():
        return float(np.nanmax(estimates[ok])), "largest estimated error of the displacement in the energy norm"
    if run.levels < 2 or not ok.any():
        return None, "one mesh says nothing about its own error: add levels"
    change = _change(run, "friction_resultant", ok)
    if change is None:
        return None, "there is no friction to measure it by"
    since = "from the level before; first order is assumed"
    if change >= 1.0 and (slip := _change(run, "u_T_max", ok)) is not None:
        return slip, f"largest change of max |u_T| {since}: the friction resultant all but cancels"
    return change, f"largest change of the friction resultant {since}"


def _change(run: RunSeen, name: str, ok: Flags) -> float | None:
    """Largest relative change of a number between the last two levels; None where it is 0 or not there."""
    last, before, both = run.take(name, -1), run.take(name, -2), ok & run.ok(-2)
    if last is None or before is None or not np.any(seen := both & (last != 0.0)):
        return None
    return float(np.max(np.abs(last - before)[seen] / np.abs(last[seen])))


def jumps(run: RunSeen, ok: Flags) -> list[str]:
    """Places between two neighbouring values of a swept number where the slip changes abruptly, the largest first."""
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
        found.append((float(step[line][at]), _between(run, name, at, where)))
    return [text for _, text in sorted(found, reverse=True)]


def _between(run: RunSeen, name: str, at: int, where: dict[str, int]) -> str:
    """ "between θ̄ = 12 and 14 K (friction: brittle)"."""
    labels, unit = _shown(run, name)
    ends = f"between {symbol(name)} = {labels[at]} and {labels[at + 1]} {unit}".rstrip()
    rest = []
    for other, i in where.items():
        values = run.labels(other)[0]
        if len(values) > 1:
            labels, unit = _shown(run, other)
            mark = ": " if values.dtype.kind in "OUS" else " = "
            rest.append(f"{symbol(other)}{mark}{labels[i]} {unit}".rstrip())
    return ends + (f" ({', '.join(rest)})" if rest else "")


def _shown(run: RunSeen, name: str) -> tuple[list[str], str]:
    """The labels of an axis and their unit as it is read."""
    values, attrs = run.labels(name)
    shown, unit = scaled_labels(values.tolist(), attrs)
    return shown, pretty(unit) if unit != "1" else ""


def different_energies(energy: Array) -> NDArray[np.int_]:
    """How many different energies the starts (last axis) of each point led to, relative to the largest."""
    energy = np.sort(energy, axis=-1)
    size = np.max(np.abs(np.where(np.isfinite(energy), energy, 0.0)), axis=-1, keepdims=True)
    return np.asarray(1 + np.count_nonzero(np.diff(energy, axis=-1) > SAME * size, axis=-1))
