"""The families of meshes that a study can ask for: what is known of each before there is a mesh, in one table.

A new family is one record here and one way to make its meshes, in fem/study_meshes.py (in refine/family.py if they
follow from the solutions); readers, forecasts, notes and reports ask the record.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

FamilyName = Literal["uniform", "graded", "adaptive"]


@dataclass(frozen=True)
class MeshFamily:
    """One family.

    name:       in words, and in a study if it can be asked for
    title:      heading of its table
    how:        how its meshes follow one another, in words
    adapts:     whether the mesh of a level follows from the solutions on the level before
    nested:     whether all levels are uniform refinements of the first
    growth:     usual ratio of the unknowns of two levels;  least_growth: what to reckon with before two are known
    max_levels: most levels
    option:     the key of the section `mesh` that is for this family only
    note:       what a forecast says of it, with {goal} and {power}
    """

    name: str
    title: str
    how: str
    adapts: bool = False
    nested: bool = False
    growth: float = 4.0
    least_growth: float = 4.0
    max_levels: int = 15
    option: str = ""
    note: str = ""


UNIFORM = MeshFamily("uniform", "Uniform meshes", "refined uniformly", nested=True)
GRADED = MeshFamily(
    "graded",
    "Graded meshes",
    "graded",
    option="grading",
    note="graded: at singular points the elements are smaller than maxh, h ~ r^{power:g}",
)
ADAPTIVE = MeshFamily(
    "adaptive",
    "Adaptive meshes (time includes all levels before)",
    "refined where the error is large",
    adapts=True,
    growth=2.0,
    least_growth=1.0,
    max_levels=60,
    option="marking",
    note="adaptive: levels after the first follow from the estimated error of {goal}; "
    "the worst point of the sweep decides",
)
LISTED = MeshFamily("listed", "Meshes of given sizes", "one of each size")
"""What a list of maxh makes; not for one maxh."""

FAMILIES: dict[FamilyName, MeshFamily] = {"uniform": UNIFORM, "graded": GRADED, "adaptive": ADAPTIVE}
"""The families that a study can ask for by name."""
PLAIN: FamilyName = "uniform"
"""The family of a study that gives none."""
TO_TOLERANCE: FamilyName = "adaptive"
"""The family of a study that gives a tolerance and no family."""
