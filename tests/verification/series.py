"""Errors and numbers of a measured point by name, each with its parts as attributes: `errors(point)["u_H1"].rate`."""

from collections.abc import Mapping
from types import SimpleNamespace
from typing import Any

from tcstudy.data.tables import ERRORS, VERDICTS, convergence_table
from tests.verification.scenes import RECTANGLE, study_of

NAMES = {v.name for v in convergence_table(study_of(RECTANGLE))}


def series(point: Mapping[str, Any], name: str) -> Any:
    """What a point has of one error or number; the verdict in words, and the norm of the reference."""
    parts = {key.removesuffix(f"_{name}"): point[key] for key in NAMES & {*point} if key.endswith(f"_{name}")}
    if "verdict" in parts:
        parts |= {"verdict": VERDICTS[parts["verdict"]], "size": parts["size_squared"] ** 0.5}
    return SimpleNamespace(**parts)


def errors(point: Mapping[str, Any]) -> dict[str, Any]:
    return {m.name: series(point, m.name) for m in ERRORS if f"error_{m.name}" in point}
