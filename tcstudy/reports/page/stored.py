"""A result file in memory for a page: its data, and the study that stands in it."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tcstudy.data.files import kind_of
from tcstudy.data.reading import GEOMETRIES, of_largest, open_results, sweep_dims
from tcstudy.errors import StoreError
from tcstudy.reports.picture import stored_study
from tcstudy.scene.study import Study

MOST_SOLUTIONS = 100_000
"""Points times levels that a page holds: more marks no screen shows, and more numbers no browser unpacks at once."""
MOST_SCENES = 20_000
"""Points up to which their scenes are read, with their laws; of more the body alone is known."""


@dataclass(frozen=True)
class Stored:
    """One result file in memory.

    kind:   "run", "convergence", "cost", "path", "history" or "fit"
    data:   the root dataset
    groups: datasets of the level groups by number; those of live data by number
    study:  the study in the file, None if its text can no longer be read (a body's own file may be gone)
    swept:  whether it has the scenes of all points
    homes:  what each geometry has of its own, None for one without a mesh; empty where all points share one
    kept:   which points of the file these are, in its order, None for all;  points: how many the file has
    """

    path: Path
    kind: str
    data: Any
    groups: dict[int, Any]
    live: dict[int, Any]
    study: Study | None
    homes: tuple[Stored | None, ...] = ()
    swept: bool = True
    kept: NDArray[np.intp] | None = None
    points: int = 0

    @property
    def words(self) -> str:
        """Which points a page of it shows; empty where it is all."""
        if self.kept is None:
            return ""
        return f"shown are {len(self.kept)} of the {self.points} points, evenly taken from the sweep; the file has all"


def read(path: Path, whole: bool = False) -> Stored:
    """What is in a result file; of a long sweep no more than MOST_SOLUTIONS, evenly taken, unless the whole is wanted.

    Raises StoreError if it is none or not complete.
    """
    kind = kind_of(path)
    with open_results(path) as tree:
        root = tree.to_dataset()
        steps = _steps(root) if kind == "run" and "status" in root and not whole else {}
        data = of_largest(root.isel(steps).load())
        if kind == "run" and not {"status", "level"} <= set(data.variables):
            raise StoreError(f"{path} is no file of a command of tcstudy, so there is no page of it")
        swept = kind != "run" or GEOMETRIES in data.attrs or root["status"].isel(level=0).size <= MOST_SCENES
        study = stored_study(data, swept)
        found = Stored(
            path, kind, data, *_levels(tree, steps), study, homes=_homes(path, tree, data, study), swept=swept
        )
        if steps:
            shape = [int(root.sizes[dim]) for dim in sweep_dims(root)]
            numbers = np.arange(np.prod(shape)).reshape(shape)
            found = replace(found, kept=numbers[tuple(steps.values())].ravel(), points=numbers.size)
    return found


def _steps(root: Any) -> dict[str, slice]:
    """By sweep dimension every how many-th place is kept, so that no more than MOST_SOLUTIONS are; empty for all.

    Of several geometries all are.
    """
    sizes = {dim: int(root.sizes[dim]) for dim in sweep_dims(root)}
    most, every = max(1, MOST_SOLUTIONS // int(root.sizes.get("level", 1))), dict.fromkeys(sizes, 1)
    if GEOMETRIES in root.attrs or np.prod(list(sizes.values())) <= most:
        return {}
    while np.prod([-(-n // every[dim]) for dim, n in sizes.items()]) > most:
        every[max(sizes, key=lambda dim: sizes[dim] / every[dim])] += 1
    return {dim: slice(None, None, step) for dim, step in every.items()}


def _levels(tree: Any, steps: dict[str, slice] | None = None) -> tuple[dict[int, Any], dict[int, Any]]:
    """The groups of the levels of a run, and of their live data."""
    levels = {n: tree[f"level_{n}"] for n in range(tree.sizes.get("level", 0)) if f"level_{n}" in tree.children}

    def kept(data: Any) -> Any:
        return data.isel(steps or {}, missing_dims="ignore").load()

    groups = {n: kept(group.to_dataset(inherit=False)) for n, group in levels.items()}
    live = {n: kept(group["live"].to_dataset()) for n, group in levels.items() if "live" in group.children}
    return groups, live


def _homes(path: Path, tree: Any, data: Any, study: Study | None) -> tuple[Stored | None, ...]:
    """The geometries of a sweep over several, in the order of their numbers."""
    found: list[Stored | None] = []
    for i in range(int(data.attrs.get(GEOMETRIES, 0))):
        group = tree.children.get(f"geometry_{i}")
        own = None if study is None else study.variants[i].study
        found.append(group and Stored(path, "run", group.to_dataset(inherit=False).load(), *_levels(group), own))
    return tuple(found)
