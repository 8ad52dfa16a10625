"""What the page takes from other rooms: opened result files, the study that stands in them, drawing helpers."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from tcstudy.data.files import replace_file
from tcstudy.data.measured import ERRORS, NUMBERS, VERDICTS
from tcstudy.data.provenance import kind_of, measured_path
from tcstudy.data.reading import of_largest, reading
from tcstudy.data.records import PointStatus
from tcstudy.data.store import open_results
from tcstudy.errors import DrawError, StoreError
from tcstudy.reports.body_panel import boundary_edges
from tcstudy.reports.cost import advice, measure_of, settings
from tcstudy.reports.path_summary import seen_folds
from tcstudy.reports.picture import BodyFields, LineFields
from tcstudy.reports.select_point import axis_names
from tcstudy.reports.stored_study import at_rest, file_order, nearest, outline, sources, stored_study
from tcstudy.scene.friction import DOWN, UP, FrictionLaw
from tcstudy.scene.laws import SHAPES
from tcstudy.scene.records import EdgeLaws
from tcstudy.scene.study import Study

__all__ = [
    "DOWN", "ERRORS", "NUMBERS", "SHAPES", "UP", "VERDICTS", "BodyFields", "DrawError", "EdgeLaws", "FrictionLaw",
    "LineFields",
    "PointStatus", "StoreError", "Stored", "Study", "advice", "at_rest", "axis_names", "boundary_edges",
    "file_order", "measure_of", "nearest", "outline", "read", "reading",
    "replace_file", "seen_folds", "settings", "sources",
]  # fmt: skip


@dataclass(frozen=True)
class Stored:
    """One result file in memory.

    kind:   "run", "convergence", "cost" or "path"
    data:   the root dataset
    groups: datasets of the level groups by number; those of live data by number
    study:  the study in the file, None if its text can no longer be read (a body's own file may be gone)
    beside: convergence and cost files of the same study that lie beside a run's file
    """

    path: Path
    kind: str
    data: Any
    groups: dict[int, Any]
    live: dict[int, Any]
    study: Study | None
    beside: tuple[Stored, ...] = ()


def read(path: Path) -> Stored:
    """Everything in a result file. Raises StoreError if it is none or not complete."""
    kind = kind_of(path)
    if kind == "fit":
        raise StoreError(f"{path} is the file of a fit, of which there is no page; use tcstudy show or draw")
    with open_results(path) as tree:
        data = of_largest(tree.to_dataset().load())
        if kind == "run" and not {"status", "level"} <= set(data.variables):
            raise StoreError(f"{path} is no file of tcstudy run, converge, cost or path, so there is no page of it")
        levels = {n: tree[f"level_{n}"] for n in range(data.sizes.get("level", 0)) if f"level_{n}" in tree.children}
        groups = {n: group.to_dataset().load() for n, group in levels.items()}
        live = {n: group["live"].to_dataset().load() for n, group in levels.items() if "live" in group.children}
    found = Stored(path, kind, data, groups, live, stored_study(data))
    return replace(found, beside=tuple(_beside(found))) if kind == "run" else found


def _beside(run: Stored) -> list[Stored]:
    """Convergence and cost files of the same study text beside a run's file."""
    found = []
    for path in (measured_path(run.path, "convergence"), measured_path(run.path, "cost")):
        if not path.is_file():
            continue
        try:
            other = read(path)
        except StoreError:
            continue
        if other.data.attrs.get("study_yaml") == run.data.attrs.get("study_yaml"):
            found.append(other)
    return found
