"""Errors and numbers of a measured point by name, each with its parts as attributes:
`errors(point)["u_H1"].rate`."""

from collections.abc import Mapping
from types import SimpleNamespace
from typing import Any

from tcstudy.data.records import Record
from tcstudy.data.tables import ERRORS, LEVELS, VERDICTS, convergence_table
from tests.verification.scenes import RECTANGLE, study_of

SIZES = {"level", *(v.name for v in LEVELS)}
NAMES = {v.name for v in convergence_table(study_of(RECTANGLE))}


def points(found: Record) -> list[dict[str, Any]]:
    """What each point of a convergence has, by name."""
    values = {name: found.values[name] for name in NAMES & found.values.keys() if name not in SIZES}
    return [{name: rows[i] for name, rows in values.items()} for i in range(len(values["status"]))]


def notes(found: Record) -> list[str]:
    """What it notes of how it was measured."""
    return [note for note in found.attributes["notes"].split("\n") if note]


def series(point: Mapping[str, Any], name: str) -> Any:
    """What a point has of one error or number; the verdict in words, and the norm of the
    reference."""
    parts = {
        key.removesuffix(f"_{name}"): point[key]
        for key in NAMES & {*point}
        if key.endswith(f"_{name}")
    }
    if "verdict" in parts:
        parts |= {"verdict": VERDICTS[parts["verdict"]], "size": parts["size_squared"] ** 0.5}
    return SimpleNamespace(**parts)


def errors(point: Mapping[str, Any]) -> dict[str, Any]:
    return {m.name: series(point, m.name) for m in ERRORS if f"error_{m.name}" in point}
