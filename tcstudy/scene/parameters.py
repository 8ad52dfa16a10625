"""What a sweep may vary: key paths with their kind and dimension, and the short names."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Literal

from tcstudy.scene.laws import SHAPES
from tcstudy.scene.units import (
    BODY_FORCE,
    CONDUCTIVITY,
    EXPANSION,
    HEAT_SOURCE,
    HEAT_TRANSFER,
    LAW_DIMENSIONS,
    LENGTH,
    NONE,
    TEMPERATURE,
    THERMAL_STRESS,
    TRACTION,
    Dimension,
)

Keys = tuple[str, ...]


@dataclass(frozen=True)
class Parameter:
    """A key that can be swept.

    kind: "number" or "field" have numbers as labels where they are numbers, "text" and "law" have texts
    idle: whether the role of its edge has no use for it, so that it is none to propose
    """

    path: Keys
    kind: Literal["number", "field", "text", "law"]
    dimension: Dimension = NONE
    idle: bool = False


PLAIN = {
    p.path: p
    for p in (
        Parameter(("heat", "alpha"), "number", HEAT_TRANSFER),
        Parameter(("heat", "theta_bar"), "field", TEMPERATURE),
        Parameter(("heat", "q"), "field", HEAT_SOURCE),
        Parameter(("heat", "theta"), "field", TEMPERATURE),
        Parameter(("heat", "omega"), "text"),
        Parameter(("material", "E"), "number", TRACTION),
        Parameter(("material", "nu"), "number", NONE),
        Parameter(("material", "lambda"), "number", TRACTION),
        Parameter(("material", "mu"), "number", TRACTION),
        Parameter(("material", "k"), "number", CONDUCTIVITY),
        Parameter(("material", "alpha_T"), "number", EXPANSION),
        Parameter(("material", "beta"), "number", THERMAL_STRESS),
        Parameter(("material", "plane"), "text"),
        Parameter(("loads", "f"), "text", BODY_FORCE),
        Parameter(("friction",), "law"),
    )
}
"""Parameters of every study but those of the law and of the edges."""

EDGE = {
    "g": ("text", TRACTION),
    "pressure": ("field", TRACTION),
    "u": ("text", LENGTH),
    "u_x": ("field", LENGTH),
    "u_y": ("field", LENGTH),
    "u_N": ("field", LENGTH),
    "u_T": ("field", LENGTH),
}
"""Parameters of one edge."""

FIXED = {
    "body": "the mesh belongs to one body; write one study for each body",
    "mesh": "element sizes are the level dimension: write h: [20 mm, 10 mm, 5 mm] in the sweep, or mesh.maxh",
    "solver": "write one study for each solver, or use --set",
    "output": "the data of a study go to one place",
    "units": "a study has one system of units",
    "title": "a study has one title",
    "institution": "a study has one institution",
    "exact": "the exact solution belongs to one scene; write one study for each",
}
"""Sections that cannot be swept, and what to do instead."""


def sweepable(edges: Mapping[str, Sequence[str]], law: str | None) -> dict[Keys, Parameter]:
    """All parameters by path.

    edges: the keys that each edge's role takes
    law:   the base law, which decides where laws differ in a parameter's dimension
    """
    found = dict(PLAIN)
    shapes = [SHAPES[law]] if law in SHAPES else []
    for shape in (*shapes, *SHAPES.values()):
        for p in shape.parameters:
            kind: Literal["number", "text"] = "number" if p.kind in ("number", "integer") else "text"
            path = ("friction", p.name)
            found.setdefault(path, Parameter(path, kind, LAW_DIMENSIONS[p.dimension]))
    for edge, taken in edges.items():
        for key, (edge_kind, dimension) in EDGE.items():
            own: Keys = ("boundary", edge, key)
            found[own] = Parameter(own, "field" if edge_kind == "field" else "text", dimension, key not in taken)
    return found


def _short_names() -> dict[str, str]:
    names = {path[-1]: ".".join(path) for path in PLAIN if path != ("friction",)}
    for path, parameter in sweepable({}, None).items():
        if path[0] == "friction" and len(path) == 2 and parameter.kind == "number":
            names.setdefault(path[-1], ".".join(path))
    return names


SHORT = _short_names()
"""Short names: alpha for heat.alpha, k for material.k (a law's k is friction.k)."""
