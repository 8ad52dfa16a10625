"""Where in a study's text something stands, for faults that are found after the study was read."""

from __future__ import annotations

from collections.abc import Sequence

from tcstudy.errors import Problem
from tcstudy.scene.document import apply_overrides, compose
from tcstudy.scene.node import Collector, Keys, deepest, holds
from tcstudy.scene.parameters import SHORT
from tcstudy.scene.records import Study

Found = tuple[Keys, str, str]
"""A fault: key path ("body", "regions", "heater"), what is wrong, what to do."""


def located(study: Study, faults: Sequence[Found]) -> list[Problem]:
    """The faults with file, line and column of their keys, or of the deepest key on the way that the study has."""
    if not faults:
        return []
    errors = Collector()
    file = str(study.source) if study.source is not None else "<text>"
    root = apply_overrides(compose(study.text, file, errors), study.overrides, SHORT, errors)
    for keys, what, remedy in faults:
        if keys[:2] == ("mesh", "maxh") and holds(root, ("sweep", "h")):
            keys = ("sweep", "h", *keys[2:])  # where the sizes may stand as well
        errors.at(deepest(root, keys), what, remedy)
    return sorted(errors.problems, key=lambda problem: (problem.line, problem.column))
