"""Meshes of a study: their families, what they are refined for, and where refinement stops.

A new family of meshes is one record here and one way to make its meshes, in fem/meshes.py (in
refine/family.py if they follow from the solutions). Readers, forecasts, notes and reports ask the
record.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from tcstudy.scene.records import Point

FamilyName = Literal["uniform", "graded", "adaptive"]


@dataclass(frozen=True)
class MeshFamily:
    """One family.

    name:         in words, and in a study if it can be asked for
    title:        heading of its table
    how:          how its meshes follow one another, in words
    adapts:       whether the mesh of a level follows from the solutions on the level before
    nested:       whether all levels are uniform refinements of the first
    growth:       usual ratio of the unknowns of two levels
    least_growth: what to reckon with before two are known
    max_levels:   most levels
    option:       the key of the section `mesh` that is for this family only
    note:         what a forecast says of it, with {goal} and {power}
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

FAMILIES: dict[FamilyName, MeshFamily] = {
    "uniform": UNIFORM,
    "graded": GRADED,
    "adaptive": ADAPTIVE,
}
"""The families that a study can ask for by name."""


Quantity = Literal[
    "energy", "friction_resultant", "slip_length", "u_T"
]  # u_T comes last, with its point
PROVED = "error_bound"
"""What a study calls the proved bound of the error in the energy norm."""


@dataclass(frozen=True)
class Goal:
    """The number that meshes are refined for and whose error is estimated.

    quantity: "energy": the displacement in the energy norm √a(u, u); "friction_resultant": ∫_{Γ_C}
    ξ [N/m];
              "u_T": tangential displacement at the point `at` of Γ_C [m]; "slip_length": length
              that does not stick [m]
    known:  the exact value, if the study knows it; then the true error is stored beside the
            estimated one
    proved: whether a tolerance is of the proved bound of the error in the energy norm, not of an
            estimate
    """

    quantity: Quantity = "energy"
    at: Point | None = None
    known: float | None = None
    proved: bool = False

    @property
    def kind(self) -> str:
        """What a tolerance compares, in words."""
        return "bound of the" if self.proved else "estimated"


MOST_REFINE = 10
"""Most refinements on the way to the first mesh: a million triangles for each of the coarsest."""


Guarantee = Literal["none", "band", "bounds", "polygon"]


@dataclass(frozen=True)
class MeshPlan:
    """The meshes of a study, coarse to fine.

    maxh:      element sizes; one per mesh
    levels:    number of levels; the most that there may be if there is a tolerance
    family:    with one maxh, what level i is: "uniform": the i-th uniform refinement; "graded":
               elements of size maxh/2^i, smaller towards singular points; "adaptive": level i−1
               refined where its error is large
    grading:   exponent μ of graded meshes: h(r) ~ h (r/R)^(1−μ) at distance r from a singular point
    marking:   share of the estimated error (squared) that the triangles refined in one adaptive
               step carry
    goal:      what adaptive meshes are refined for, and what the tolerance is of
    tolerance: relative error at which refinement stops, None for all levels
    max_dofs:  displacement DOFs beyond which an adaptive family or one with a tolerance is not
               refined
    estimate:  whether errors are estimated on meshes that do not need it
    guarantee: what is proved of the body, not of its mesh. "band": bounds of λ₁, of a body without
               arcs; "bounds": bounds of λ₁ and of every error; "polygon": these of the polygon that
               the mesh has in place of a body with arcs; "none"
    refine:    uniform refinements, of a mesh of size maxh·2^refine, that make the mesh of size
               maxh: many times as fast as meshing at maxh
    """

    maxh: tuple[float, ...]
    levels: int
    family: FamilyName = "uniform"
    grading: float = 0.3
    marking: float = 0.5
    goal: Goal = Goal()
    tolerance: float | None = None
    max_dofs: int = 400_000
    estimate: bool = False
    guarantee: Guarantee = "band"
    refine: int = 0

    @property
    def bounds_errors(self) -> bool:
        """Whether every solution gets a proved bound of its error."""
        return self.guarantee in ("bounds", "polygon")

    @property
    def listed(self) -> bool:
        """True if there is one mesh for each of several sizes."""
        return len(self.maxh) > 1

    @property
    def strategy(self) -> MeshFamily:
        """What is known of the study's family of meshes."""
        return LISTED if self.listed else FAMILIES[self.family]

    @property
    def nested(self) -> bool:
        """True if the levels are uniform refinements of one coarse mesh."""
        return self.strategy.nested

    @property
    def open_ended(self) -> bool:
        """True if a mesh, or the decision to stop at it, follows from the solutions on those
        before."""
        return self.strategy.adapts or self.tolerance is not None

    @property
    def estimates(self) -> bool:
        """True if every solution gets an error estimate."""
        return self.estimate or self.open_ended
