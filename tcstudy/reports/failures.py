"""Failed points in few lines: grouped by status and reason, whatever the numbers in the reason are."""

from __future__ import annotations

import re
from collections.abc import Iterable
from dataclasses import dataclass

from tcstudy.data.provenance import without_paths
from tcstudy.data.records import PointStatus
from tcstudy.reports.text import counted

_NUMBER = re.compile(r"(?<![\w.])-?\d+(?:\.\d+)?(?:[eE][-+]?\d+)?(?![\w.]*\w)")
"""A number that stands by itself: not the 1 of u_1 or "level_1"."""

_REMEDIES = {
    PointStatus.NOT_RUN: "run the study again to resume it",
    PointStatus.NOT_CONVERGED: "raise solver.max_iterations, or try the other solver",
    PointStatus.INCLUSION_VIOLATED: "raise solver.tolerance, check the units, or coarsen the mesh",
    PointStatus.SINGULAR: "check that the body is held and that the material is elastic",
    PointStatus.MESH_FAILED: "change mesh.maxh, and look at the body for slits and slivers",
    PointStatus.ERROR: "run the study again, which repeats these points; if it stays, it is a fault of the program",
}
"""What to try where a reason names no remedy of its own."""


@dataclass(frozen=True)
class Failure:
    """One failed point: its status and reason as stored, and in words which one it is."""

    status: PointStatus
    reason: str
    point: str


def kind(status: PointStatus, reason: str) -> tuple[PointStatus, str]:
    """What failures of the same cause have in common: the status and the reason without its numbers."""
    return status, _NUMBER.sub("#", without_paths(reason))


def named(status: PointStatus) -> str:
    """The status in words."""
    return status.name.lower().replace("_", " ")


def failure_lines(failures: Iterable[Failure]) -> list[str]:
    """One line for each kind of failure: count, status, reason with the ranges of its numbers, a point, a remedy."""
    groups: dict[tuple[PointStatus, str], list[Failure]] = {}
    for failure in failures:
        groups.setdefault(kind(failure.status, failure.reason), []).append(failure)
    return [_line(status, group) for (status, _), group in sorted(groups.items(), key=lambda item: -len(item[1]))]


def _line(status: PointStatus, group: list[Failure]) -> str:
    what = _merged([without_paths(failure.reason) for failure in group]).rstrip(". ")
    what = "" if what == named(status) else what
    # reasons of the house end in their own remedy after a semicolon; an unexpected exception has none
    if status in _REMEDIES and (";" not in what or status == PointStatus.ERROR):
        what = "; ".join(filter(None, (what, _REMEDIES[status])))
    count = counted(len(group), "solution")
    example = group[0].point if len(group) == 1 else f"for example {group[0].point}"
    return f"{count} failed: {named(status)}: {what} ({example})"


def _merged(reasons: list[str]) -> str:
    """The common text of reasons that differ in numbers; a number that differs is shown as its range."""
    texts = _NUMBER.split(reasons[0])
    columns = zip(*(_NUMBER.findall(reason) for reason in reasons), strict=True)
    shown = [_range(column) for column in columns]
    return "".join(text + number for text, number in zip(texts, [*shown, ""], strict=True))


def _range(numbers: tuple[str, ...]) -> str:
    low, high = min(numbers, key=float), max(numbers, key=float)
    return low if float(low) == float(high) else f"{low} to {high}"
