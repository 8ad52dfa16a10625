"""What differs between two result files of one command: study, versions, points, numbers.

Studies are compared by what their YAML means (`study.union`), points by the labels of their swept parameters, numbers
of points that both have relative to the largest value of their kind on their level, as merge does; what is a residual
or a relative error itself is compared as it is. Counts, flags and texts must be the same. Versions are told, but two
versions with the same numbers are no difference. Left out: wall times and how many steps a solver took, which say how
the numbers were come by, and the group `live`, which repeats them.
"""

from __future__ import annotations

import json
import math
from collections.abc import Iterator, Mapping, Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tcstudy.data.provenance import kind_from
from tcstudy.data.reading import attributes, reading
from tcstudy.data.stored import VALUES
from tcstudy.errors import StudyError, UsageError, shortened
from tcstudy.read.study import read_study_text
from tcstudy.scene.study import Study
from tcstudy.study.shared_points import LabelledPoints, Places, shared_points
from tcstudy.study.union import differences

Pair = tuple[Any, Any]

EFFORT = ("time", "solver_time", "iterations", "evaluations", "solver_iterations", "dominated")
"""How names of variables begin that say how numbers were come by, or follow from wall times."""
APART = ("mesh", "live", "geometry")
"""How names begin of what is not compared by name: geometries are found by their points."""
RELATIVE = ("inclusion_", "heat_balance", "value_heat_balance", "residual", "solver_residual", "solver_difference",
            "solution_residual", "solution_rounding", "error_", "affine_defect", "law_error")  # fmt: skip
"""How names of variables begin that are relative themselves; there rounding is as large as the value."""
ASKED = ("point", "reference", "begin_status", "end_status", "shortfalls")
"""Global attributes that say what was asked for beside the study, or how it ended."""


@dataclass(frozen=True)
class NumberDifference:
    """A variable that differs: its name (with its group), how many points do, the worst place and its two values.

    relative: the worst difference over the largest value of the kind; infinite where one file has no value
    """

    name: str
    units: str
    points: int
    of: int
    where: str
    values: Pair
    relative: float

    def __str__(self) -> str:
        one, two = (f"{v:.12g}" if isinstance(v, float) else str(v) for v in self.values)
        unit = "" if self.units in ("", "1") else f" [{self.units}]"
        size = f", {self.relative:.2g} of the largest" if math.isfinite(self.relative) else ""
        many = f"at {self.points} of {self.of} points, worst " if self.of > 1 else ""
        return f"{self.name}{unit}: {many}{self.where + ': ' if self.where else ''}{one} | {two}{size}"


@dataclass(frozen=True)
class Comparison:
    """What differs between two files; lines are "key: value of the first | value of the second".

    points: that one file has alone, or has run alone
    layout: meshes, variables and outcomes that cannot be compared one to one
    compared: variables that were
    """

    files: tuple[Path, Path]
    rtol: float
    study: tuple[str, ...]
    versions: tuple[str, ...]
    points: tuple[str, ...]
    layout: tuple[str, ...]
    numbers: tuple[NumberDifference, ...]
    compared: int

    @property
    def equal(self) -> bool:
        """Whether nothing but the versions differs."""
        return not (self.study or self.points or self.layout or self.numbers)

    @property
    def verdict(self) -> str:
        """One sentence."""
        names = f"{self.files[0]} and {self.files[1]}"
        if self.equal:
            return f"{names} hold the same results: {self.compared} variables within {self.rtol:g}"
        parts = (("study", self.study), ("points", self.points), ("layout", self.layout), ("numbers", self.numbers))
        return f"{names} differ in {', '.join(name for name, lines in parts if lines)}"

    @property
    def text(self) -> str:
        """The verdict, and all that differs."""
        parts: tuple[tuple[str, Sequence[Any]], ...] = (
            ("study", self.study),
            ("versions (told, no difference by themselves)", self.versions),
            ("points", self.points),
            ("layout", self.layout),
            (f"{len(self.numbers)} of {self.compared} variables beyond {self.rtol:g}", self.numbers),
        )
        lines = [self.verdict]
        for title, found in parts:
            lines += ["", title, *(f"  {line}" for line in found)] if found else []
        return "\n".join(lines)


def compare_files(first: Path, second: Path, rtol: float = 1e-9) -> Comparison:
    """Compare two result files. Raises StoreError if one is none, UsageError if they are of different commands."""
    import netCDF4

    found = attributes(first), attributes(second)
    kinds = [kind_from(one) for one in found]
    if kinds[0] != kinds[1]:
        raise UsageError(f"{first} is a file of tcstudy {kinds[0]}, {second} of {kinds[1]}; name two of one command")
    with ExitStack() as stack:
        for path in (first, second):
            stack.enter_context(reading(path))
        one, two = (stack.enter_context(netCDF4.Dataset(path)) for path in (first, second))
        for nc in (one, two):
            nc.set_auto_mask(False)
        sweeps = LabelledPoints.of_file(one), LabelledPoints.of_file(two)
        study = tuple(_study(found))
        layout = [f"{name}: {a} | {b}" for name in ASKED if (a := found[0].get(name)) != (b := found[1].get(name))]
        points: tuple[str, ...] = ()
        results: list[NumberDifference | str | None] = []
        if [*sweeps[0].labels] == [*sweeps[1].labels]:
            shared, points = shared_points(sweeps, (first, second))
            results = list(_Shared(shared, sweeps[0], rtol).group((one, two)))
        elif not study:
            study = (f"swept parameters: {', '.join(sweeps[0].labels)} | {', '.join(sweeps[1].labels)}",)
    layout += [result for result in results if isinstance(result, str)]
    numbers = tuple(result for result in results if isinstance(result, NumberDifference))
    compared = sum(not isinstance(result, str) for result in results)
    return Comparison((first, second), rtol, study, tuple(_versions(found)), points, tuple(layout), numbers, compared)


def _study(found: tuple[Mapping[str, Any], Mapping[str, Any]]) -> list[str]:
    """What differs between the studies of two files beside the sweep."""
    texts = [(str(one["study_yaml"]), str(one.get("overrides", ""))) for one in found]
    if texts[0] == texts[1]:
        return []
    studies: list[Study] = []
    for text, overrides in texts:
        try:
            studies.append(read_study_text(text, "study", [line for line in overrides.split("\n") if line]))
        except (StudyError, OSError) as error:
            why = shortened(str(error).splitlines()[0], 200)
            return [f"the texts differ, and one of them cannot be read here ({why})"]
    return differences(studies[0], studies[1])


def _versions(found: tuple[Mapping[str, Any], Mapping[str, Any]]) -> Iterator[str]:
    held = [
        {**json.loads(str(one.get("versions", "{}"))), **json.loads(str(one.get("program", "{}")))} for one in found
    ]
    for one, attrs in zip(held, found, strict=True):
        one["code of tcstudy"] = str(one.pop("content", "unknown"))[:12]
        one["git commit of the study"] = str(attrs.get("git_commit", "unknown"))
    for name in dict.fromkeys((*held[0], *held[1])):
        pair = [one.get(name, "unknown") for one in held]
        if pair[0] != pair[1]:
            yield f"{name}: {pair[0]} | {pair[1]}"


@dataclass(frozen=True)
class _Shared:
    """The points that two files, or a geometry in both, share: where they stand in either; the first one's sweep."""

    places: tuple[Places, Places]
    sweep: LabelledPoints
    rtol: float

    def group(self, pair: tuple[Any, Any], prefix: str = "") -> Iterator[NumberDifference | str | None]:
        """Of every variable of a group and of those in it how it differs, None if not, or why it is not compared."""
        several = all("geometry" in group.variables for group in pair)  # whose groups have what a level has, too
        for kind in ("variables", "groups"):
            one, two = (getattr(group, kind) for group in pair)
            for name in dict.fromkeys((*one, *two)):
                if name in self.sweep.labels or name.startswith((*EFFORT, *APART)):
                    continue
                if name not in one or name not in two:
                    yield f"{prefix}{name}: only in the {'first' if name in one else 'second'}"
                elif kind == "groups":
                    yield from self.group((one[name], two[name]), f"{prefix}{name}/")
                elif not several or self._swept(one[name]):
                    yield self._variable((one[name], two[name]), prefix + name)
        if several:
            numbers = (group["geometry"][...].ravel()[at].tolist() for group, at in zip(pair, self.places, strict=True))
            for i, j in dict.fromkeys(zip(*numbers, strict=True)):
                if min(i, j) >= 0:
                    yield from _geometries((pair[0][f"geometry_{i}"], pair[1][f"geometry_{j}"]), i, self.rtol)

    def _swept(self, variable: Any) -> bool:
        """Whether a variable has a value for every point."""
        n = len(self.sweep.dims)
        return n > 0 and variable.dimensions[:n] == self.sweep.dims

    def _variable(self, pair: tuple[Any, Any], name: str) -> NumberDifference | str | None:
        """The worst difference of a variable, of all levels, if it is beyond the tolerance."""
        one, two = pair
        after = len(self.sweep.dims) if self._swept(one) else 0
        shapes = one.shape[after:], two.shape[two.ndim - one.ndim + after :]
        if shapes[0] != shapes[1]:
            return f"{name}: " + " | ".join(f"{' × '.join(map(str, shape))}" for shape in shapes) + " values"
        rest = one.dimensions[after:]
        levels = range(one.shape[one.dimensions.index("level")]) if "level" in rest else (None,)
        found = [self._on_level(pair, name, self._swept(one), rest, level) for level in levels]
        return max((worst for worst in found if worst is not None), key=lambda worst: worst.relative, default=None)

    def _on_level(
        self, pair: tuple[Any, Any], name: str, swept: bool, rest: tuple[str, ...], level: int | None
    ) -> NumberDifference | None:
        """The worst difference of a variable on one level; all points of some values at a time."""
        inner = [d for d in rest if d != "level"]
        wide = bool(inner) and inner[-1] == rest[-1]
        width = pair[0].shape[-1] if wide else 1
        rows = len(self.places[0]) if swept else 1
        step = max(1, VALUES // max(1, pair[0].size // max(1, width)))
        gaps, scale = np.zeros(rows), 0.0
        best: tuple[float, str, Pair] = (0.0, "", (None, None))
        for j in range(0, width if rows else 0, step):
            cut = tuple(level if d == "level" else slice(None) for d in rest)
            cut = (*cut[:-1], slice(j, j + step)) if wide else cut
            one, two = (_taken(v, cut, at if swept else None) for v, at in zip(pair, self.places, strict=True))
            gap, size = _gap(one, two)
            scale = max(scale, size)
            gaps = np.maximum(gaps, gap.max(axis=1, initial=0.0))
            if gap.size and gap.max() > best[0]:
                row, place = (int(i) for i in np.unravel_index(int(np.argmax(gap)), gap.shape))
                where = [self.sweep.describe(int(self.places[0][row]))] if swept else []
                where += [] if level is None else [f"level {level}"]
                where += [f"{inner[-1]} {j + place}"] if inner else []
                best = (float(gap[row, place]), ", ".join(filter(None, where)), (one[row, place], two[row, place]))
        exact = pair[0].dtype is str or np.dtype(pair[0].dtype).kind != "f"
        scale = 1.0 if exact or name.rpartition("/")[2].startswith(RELATIVE) else scale
        beyond = gaps > (0.0 if exact else self.rtol * scale)
        if not beyond.any():
            return None
        first, second = (v.item() if hasattr(v, "item") else v for v in best[2])
        relative = math.nan if exact else best[0] / scale if scale else math.inf
        units = str(getattr(pair[0], "units", ""))
        return NumberDifference(name, units, int(np.count_nonzero(beyond)), rows, best[1], (first, second), relative)


def _geometries(pair: tuple[Any, Any], number: int, rtol: float) -> Iterator[NumberDifference | str | None]:
    """The same of one geometry in two files, by its number in the first."""
    sweeps = LabelledPoints.of_file(pair[0]), LabelledPoints.of_file(pair[1])
    places, _ = shared_points(sweeps, (Path(), Path()))
    return _Shared(places, sweeps[0], rtol).group(pair, f"geometry_{number}/")


def _taken(variable: Any, cut: tuple[Any, ...], places: Places | None) -> NDArray[Any]:
    """(rows, values) of a variable: of the points at these places, or one row where it has no sweep."""
    if places is None:
        return np.asarray(variable[cut or ...]).reshape(1, -1)
    array = np.asarray(variable[(..., *cut)])
    points = math.prod(variable.shape[: variable.ndim - len(cut)])
    return array.reshape(points, -1)[places]


def _gap(one: NDArray[Any], two: NDArray[Any]) -> tuple[NDArray[np.float64], float]:
    """Differences, and the largest finite value: the same (NaN and infinities too) is 0, one without value infinite."""
    if one.dtype.kind != "f":
        return (one != two).astype(float), 1.0
    same = (one == two) | (np.isnan(one) & np.isnan(two))
    finite = np.isfinite(one) & np.isfinite(two)
    gap = np.where(same, 0.0, np.inf)
    gap[finite] = np.abs(one[finite] - two[finite])
    sizes = [float(np.max(np.abs(v), where=np.isfinite(v), initial=0.0)) for v in (one, two)]
    return gap, max(sizes)
