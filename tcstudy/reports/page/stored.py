"""A result file in memory for a page: its data, the study that stands in it, and the files of that study beside it."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from tcstudy.data.provenance import kind_of, measured_path
from tcstudy.data.reading import GEOMETRIES, of_largest
from tcstudy.data.store import open_results
from tcstudy.errors import StoreError
from tcstudy.reports.stored_study import stored_study
from tcstudy.scene.study import Study


@dataclass(frozen=True)
class Stored:
    """One result file in memory.

    kind:   "run", "convergence", "cost", "path", "history" or "fit"
    data:   the root dataset
    groups: datasets of the level groups by number; those of live data by number
    study:  the study in the file, None if its text can no longer be read (a body's own file may be gone)
    beside: convergence and cost files of the same study that lie beside a run's file
    homes:  what each geometry has of its own, None for one without a mesh; empty where all points share one
    """

    path: Path
    kind: str
    data: Any
    groups: dict[int, Any]
    live: dict[int, Any]
    study: Study | None
    beside: tuple[Stored, ...] = ()
    homes: tuple[Stored | None, ...] = ()


def read(path: Path) -> Stored:
    """Everything in a result file. Raises StoreError if it is none or not complete."""
    kind = kind_of(path)
    with open_results(path) as tree:
        data = of_largest(tree.to_dataset().load())
        if kind == "run" and not {"status", "level"} <= set(data.variables):
            raise StoreError(f"{path} is no file of a command of tcstudy, so there is no page of it")
        study = stored_study(data)
        found = Stored(path, kind, data, *_levels(tree), study, homes=_homes(path, tree, data, study))
    return replace(found, beside=tuple(_beside(found))) if kind == "run" else found


def _levels(tree: Any) -> tuple[dict[int, Any], dict[int, Any]]:
    """The groups of the levels of a run, and of their live data."""
    levels = {n: tree[f"level_{n}"] for n in range(tree.sizes.get("level", 0)) if f"level_{n}" in tree.children}
    groups = {n: group.to_dataset(inherit=False).load() for n, group in levels.items()}
    return groups, {n: group["live"].to_dataset().load() for n, group in levels.items() if "live" in group.children}


def _homes(path: Path, tree: Any, data: Any, study: Study | None) -> tuple[Stored | None, ...]:
    """The geometries of a sweep over several, in the order of their numbers."""
    found: list[Stored | None] = []
    for i in range(int(data.attrs.get(GEOMETRIES, 0))):
        group = tree.children.get(f"geometry_{i}")
        own = None if study is None else study.variants[i].study
        found.append(group and Stored(path, "run", group.to_dataset(inherit=False).load(), *_levels(group), own))
    return tuple(found)


def _beside(run: Stored) -> list[Stored]:
    """Convergence and cost files of the same study text beside a run's file."""
    found = []
    for path in (measured_path(run.path, "convergence"), measured_path(run.path, "cost")):
        with suppress(StoreError):
            if path.is_file() and (other := read(path)).data.attrs["study_yaml"] == run.data.attrs["study_yaml"]:
                found.append(other)
    return found
