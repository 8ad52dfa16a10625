"""What a sweep may vary, out of the table of keys: key paths with their kind and dimension, and the short names."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Literal

from tcstudy.scene import keys
from tcstudy.scene.key import Key
from tcstudy.scene.laws import SHAPES
from tcstudy.scene.units import NONE, Dimension

Keys = tuple[str, ...]


@dataclass(frozen=True)
class Parameter:
    """A key that can be swept.

    kind: "number" or "field" have numbers as labels where they are numbers, "text" and "law" have texts
    free: whether the word `free` may stand for a value
    idle: whether the role of its edge has no use for it, so that it is none to propose
    """

    path: Keys
    kind: Literal["number", "field", "text", "law"]
    dimension: Dimension = NONE
    free: bool = False
    idle: bool = False


_KINDS: dict[str, Literal["number", "field", "text", "law"]] = {
    **{"number": "number", "integer": "number"},
    **{"field": "field", "component": "field", "law": "law"},
}
"""Kinds of keys whose values are more than texts."""


def _parameter(path: Keys, row: Key) -> Parameter:
    return Parameter(path, _KINDS.get(row.kind, "text"), row.dimension, row.kind == "component")


def _plain() -> dict[Keys, Parameter]:
    """Parameters of every study but those of the law and of the edges."""
    places = ((row.section, row.name) if row.section else (row.name,) for row in keys.ROWS if row.swept)
    rows = (row for row in keys.ROWS if row.swept)
    return {path: _parameter(path, row) for path, row in zip(places, rows, strict=True) if path[0] != "boundary"}


PLAIN = _plain()
EDGE = {row.name: row for row in keys.rows("boundary").values() if row.swept}
"""Parameters of one edge."""

FIXED = {row.name: row.fixed for row in keys.rows("").values() if row.fixed}
"""Sections that cannot be swept, and what to do instead."""


def sweepable(edges: Mapping[str, Sequence[str]], law: str | None) -> dict[Keys, Parameter]:
    """All parameters by path.

    edges: the keys that each edge's role takes
    law:   the base law, which decides where laws differ in a parameter's dimension
    """
    found = dict(PLAIN)
    for name in (*([law] if law in SHAPES else []), *SHAPES):
        for row in keys.law_rows(str(name)):
            path = ("friction", row.name)
            found.setdefault(path, _parameter(path, row))
    for edge, taken in edges.items():
        for name, row in EDGE.items():
            own: Keys = ("boundary", edge, name)
            found[own] = replace(_parameter(own, row), idle=name not in taken)
    return found


def _short_names() -> dict[str, str]:
    names = {path[-1]: ".".join(path) for path in PLAIN if len(path) == 2}
    for path, parameter in sweepable({}, None).items():
        if path[0] == "friction" and len(path) == 2 and parameter.kind == "number":
            names.setdefault(path[-1], ".".join(path))
    return names


SHORT = _short_names()
"""Short names: alpha for heat.alpha, k for material.k (a law's k is friction.k)."""
