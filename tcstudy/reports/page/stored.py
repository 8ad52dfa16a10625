"""One result file in memory, as the page needs it: points, levels, live data, study, geometries."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tcstudy.data.bodies import StoredBody
from tcstudy.data.files import kind_of
from tcstudy.data.reading import GEOMETRIES, of_largest, open_results, sweep_dims, unmasked
from tcstudy.data.schema import OVERRIDES
from tcstudy.errors import StoreError
from tcstudy.reports.rounding import Floors, floors, stored_study
from tcstudy.scene.study import Study

MAX_SOLUTIONS = 100_000
"""Points times levels on a page: no screen shows more, and no browser unpacks more at once."""
MAX_SCENES = 20_000
"""Points up to which their scenes are read, with their laws; of more the body alone is known."""
LEVEL_VARIABLES = ("h_max", "n_dof", "n_contact", "time_mesh", "time_assemble")
"""Variables with one value for each level."""
Levels = dict[int, Any]
"""Datasets by their level."""


@dataclass(frozen=True)
class Stored:
    """One result file in memory.

    kind:       "run", "convergence", "cost", "path", "history" or "fit"
    data:       the root dataset
    groups:     datasets of the level groups;  live: datasets of the live data
    study:      the study in the file, None if its text can no longer be read (a CAD file may be
                gone)
    has_scenes: whether the study has the scenes of all points
    geometries: the part of each geometry, None without a mesh; empty where all points share one
    selection:  indices in the file of the points that the page has, None for all
    n_points:   number of points in the file
    cut_floors: floors of one geometry, cut from those of the whole file
    """

    path: Path
    kind: str
    data: Any
    groups: Levels
    live: Levels
    study: Study | None
    geometries: tuple[Stored | None, ...] = ()
    has_scenes: bool = True
    selection: NDArray[np.intp] | None = None
    n_points: int = 0
    cut_floors: Floors | None = None

    @cached_property
    def floors(self) -> Floors:
        """Sizes below which the numbers of a run's points are rounding; empty for other files."""
        if self.cut_floors is not None:
            return self.cut_floors
        return floors(self.data, self.study) if self.kind == "run" else Floors({})

    @property
    def selection_note(self) -> str:
        """Sentence on the points that the page has; empty where it has all."""
        if self.selection is None:
            return ""
        return (
            f"shown are {len(self.selection)} of the {self.n_points} points, "
            "evenly taken from the sweep; the file has all"
        )


def read(path: Path, whole: bool = False) -> Stored:
    """Read a result file; of a long sweep at most MAX_SOLUTIONS, evenly taken, unless `whole`.

    Raises StoreError if it is no result file or not complete.
    """
    kind = kind_of(path)
    with open_results(path) as tree:
        root = tree.to_dataset().drop_vars(OVERRIDES.name, errors="ignore")
        can_be_cut = kind == "run" and "status" in root and not whole
        slices = _slices(root) if can_be_cut else {}
        data = of_largest(root.isel(slices).load())
        if kind == "run" and not {"status", "level"} <= set(data.variables):
            raise StoreError(
                f"{path} is no file of a command of tcstudy, so there is no page of it"
            )
        has_geometries = GEOMETRIES in data.attrs
        is_short = kind != "run" or root["status"].isel(level=0).size <= MAX_SCENES
        has_scenes = has_geometries or is_short
        study = stored_study(data.attrs, has_scenes)
        groups, live = _levels(tree, slices)
    stored = Stored(path, kind, data, groups, live, study, has_scenes=has_scenes)
    if slices:
        indices = _point_indices(root)
        selection = indices[tuple(slices.values())].ravel()
        stored = replace(stored, selection=selection, n_points=indices.size)
    if has_geometries:
        stored = replace(stored, geometries=_geometries(stored))
    return stored


def _point_indices(root: Any) -> NDArray[np.intp]:
    """Return the index of every point in the shape of the sweep."""
    shape = [int(root.sizes[dim]) for dim in sweep_dims(root)]
    return np.arange(math.prod(shape)).reshape(shape)


def _slices(root: Any) -> dict[str, slice]:
    """Return slices of the sweep dimensions that keep at most MAX_SOLUTIONS; empty for all.

    Of several geometries all points are kept.
    """
    sizes = {dim: int(root.sizes[dim]) for dim in sweep_dims(root)}
    max_points = max(1, MAX_SOLUTIONS // int(root.sizes.get("level", 1)))
    if GEOMETRIES in root.attrs or math.prod(sizes.values()) <= max_points:
        return {}
    strides = dict.fromkeys(sizes, 1)
    while _count(sizes, strides) > max_points:
        densest = max(sizes, key=lambda dim: sizes[dim] / strides[dim])
        strides[densest] += 1
    return {dim: slice(None, None, stride) for dim, stride in strides.items()}


def _count(sizes: Mapping[str, int], strides: Mapping[str, int]) -> int:
    """Return how many points remain of dimensions of which every stride-th index is kept."""
    return math.prod(len(range(0, size, strides[dim])) for dim, size in sizes.items())


def _levels(tree: Any, slices: Mapping[str, slice]) -> tuple[Levels, Levels]:
    """Return the groups of the levels of a run and their live data.

    Both are empty for a file of several geometries: each of them has its own levels.
    """

    def load(data: Any) -> Any:
        return data.isel(slices, missing_dims="ignore").load()

    groups, live = Levels(), Levels()
    for level in _stored_levels(tree):
        group = tree[f"level_{level}"]
        groups[level] = load(group.to_dataset(inherit=False))
        if "live" in group.children:
            live[level] = load(group["live"].to_dataset())
    return groups, live


def _stored_levels(tree: Any) -> Iterable[int]:
    """Return the levels of a run whose meshes and lines stand in its file."""
    if GEOMETRIES in tree.attrs:
        return []
    levels = range(tree.sizes.get("level", 0))
    return [level for level in levels if f"level_{level}" in tree.children]


def _geometries(stored: Stored) -> tuple[Stored | None, ...]:
    """Return the part of each geometry of a file, with its study and floors."""
    geometries = list[Stored | None]()
    with unmasked(stored.path) as nc:
        for number, body in enumerate(StoredBody.every(nc)):
            geometries.append(None if body is None else _geometry(stored, number, body))
    return tuple(geometries)


def _geometry(stored: Stored, number: int, body: StoredBody) -> Stored:
    """Return the part of the geometry with a number."""
    return Stored(
        stored.path,
        "run",
        data=body.level_table(LEVEL_VARIABLES),
        groups={level: body.dataset(level) for level in body.levels},
        live={},
        study=None if stored.study is None else stored.study.variants[number].study,
        cut_floors=stored.floors.of_points(body.places),
    )
