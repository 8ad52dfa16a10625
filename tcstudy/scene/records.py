"""What a study is: frozen records in SI (or consistent) units, made by the reader, used by every other room.

Symbols follow Šestak & Jovanović (2010): alpha, theta_bar, q, omega (the source region), f, g, k, beta.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal

from tcstudy.scene.expressions import Expression
from tcstudy.scene.friction import FrictionLaw

Point = tuple[float, float]
Scalar = float | Expression
"""A quantity that is one number or an expression in x and y."""


@dataclass(frozen=True)
class Edge:
    """A straight edge, or a circular arc through a third point. The next edge starts where this one ends."""

    start: Point
    end: Point
    name: str
    through: Point | None = None


@dataclass(frozen=True)
class Loop:
    """A closed chain of edges, counter-clockwise (outlines, holes and regions alike)."""

    edges: tuple[Edge, ...]


@dataclass(frozen=True)
class Region:
    """A named part of the body, for heat sources."""

    name: str
    loop: Loop


@dataclass(frozen=True)
class BrepFace:
    """A plane face read from a STEP or BREP file.

    path:  the file
    face:  which face of it, from 0
    scale: length of one unit of the file [m]
    edges: name → points on it; the edge nearest to each point gets the name
    other: name of all edges that no point names
    """

    path: Path
    face: int
    scale: float
    edges: tuple[tuple[str, tuple[Point, ...]], ...]
    other: str | None


@dataclass(frozen=True)
class Body:
    """The body Ω: an outline with holes, or a face of a file; and its named regions."""

    outline: Loop | None
    holes: tuple[Loop, ...] = ()
    regions: tuple[Region, ...] = ()
    brep: BrepFace | None = None


@dataclass(frozen=True)
class Clamped:
    """Γ_D: prescribed displacement, per component; None leaves a component free (a roller).

    u:     the two components [m]
    frame: "xy" for (u_x, u_y), "nt" for (u_N, u_T) of the edge
    """

    u: tuple[Scalar | None, Scalar | None] = (0.0, 0.0)
    frame: Literal["xy", "nt"] = "xy"


@dataclass(frozen=True)
class Traction:
    """Γ_N: σn = g − p n, g in x and y [Pa], p a normal pressure, positive when it pushes [Pa]."""

    g: tuple[Scalar, Scalar] = (0.0, 0.0)
    pressure: Scalar = 0.0


@dataclass(frozen=True)
class Contact:
    """Γ_C: u_N = 0 and −S_T ∈ b̂(u_T), eq. (4)."""


@dataclass(frozen=True)
class Convection:
    """Γ_θ: −k∂θ/∂n = α(θ − θ̄), eq. (5); traction-free unless g or a pressure is given."""

    g: tuple[Scalar, Scalar] = (0.0, 0.0)
    pressure: Scalar = 0.0


@dataclass(frozen=True)
class Free:
    """Neither load nor heat."""


Role = Clamped | Traction | Contact | Convection | Free


@dataclass(frozen=True)
class Material:
    """Isotropic material and the plane assumption.

    lam, mu: Lamé moduli of the plane problem (plane stress already folded into lam) [Pa]
    beta:    stress–temperature modulus of the plane problem, σ = cε − βθI, eq. (3) [Pa/K]
    k:       conductivity [W/(m K)], None if the study gives none
    E, nu:   the three-dimensional constants, for reports and warnings
    plane:   plane strain or plane stress
    """

    lam: float
    mu: float
    beta: float
    k: float | None
    E: float
    nu: float
    plane: Literal["strain", "stress"]


@dataclass(frozen=True)
class Heat:
    """The temperature above the stress-free state: known, or by conduction, eqs. (2), (5).

    theta:     a known temperature field; then nothing else here is used [K]
    alpha:     heat transfer coefficient on Γ_θ [W/(m² K)]
    theta_bar: temperature of the surroundings [K]
    q:         source density in ω [W/m³]
    omega:     names of the regions that make up ω; empty for the whole body
    """

    theta: Scalar | None = None
    alpha: float = 0.0
    theta_bar: Scalar = 0.0
    q: Scalar = 0.0
    omega: tuple[str, ...] = ()


@dataclass(frozen=True)
class Scene:
    """One complete problem: every number of one sweep point."""

    body: Body
    boundary: tuple[tuple[str, Role], ...]
    material: Material
    f: tuple[Scalar, Scalar]
    heat: Heat
    friction: FrictionLaw

    def edges(self, *kinds: type) -> tuple[str, ...]:
        """Names of the edges with one of the given roles, in the order of the study."""
        return tuple(name for name, role in self.boundary if isinstance(role, kinds))


Quantity = Literal["energy", "friction_resultant", "u_T", "slip_length"]
FamilyName = Literal["uniform", "graded", "adaptive"]


@dataclass(frozen=True)
class Goal:
    """The number that meshes are refined for and whose error is estimated.

    quantity: "energy": the displacement in the energy norm √a(u, u); "friction_resultant": ∫_{Γ_C} ξ [N/m];
              "u_T": tangential displacement at the point `at` of Γ_C [m]; "slip_length": length that does not stick [m]
    known:    the exact value, if the study knows it; then the true error is stored beside the estimated one
    """

    quantity: Quantity = "energy"
    at: Point | None = None
    known: float | None = None


@dataclass(frozen=True)
class MeshPlan:
    """The meshes of a study, coarse to fine.

    maxh:      element sizes; one per mesh
    levels:    number of levels; the most that there may be if there is a tolerance
    family:    with one maxh, what level i is: "uniform": the i-th uniform refinement; "graded": elements of size
               maxh/2^i, smaller towards singular points; "adaptive": level i−1 refined where its error is large
    grading:   exponent μ of graded meshes: h(r) ~ h (r/R)^(1−μ) at distance r from a singular point
    marking:   share of the estimated error (squared) that the triangles refined in one adaptive step carry
    goal:      what adaptive meshes are refined for, and what the tolerance is of
    tolerance: relative error at which refinement stops, None for all levels
    max_dofs:  displacement unknowns beyond which an adaptive family or one with a tolerance is not refined
    estimate:  whether errors are estimated on meshes that do not need it
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

    @property
    def nested(self) -> bool:
        """True if the levels are uniform refinements of one coarse mesh."""
        return len(self.maxh) == 1 and self.family == "uniform"

    @property
    def estimates(self) -> bool:
        """True if every solution gets an error estimate."""
        return self.estimate or self.family == "adaptive" or self.tolerance is not None


@dataclass(frozen=True)
class Exact:
    """The exact solution of every sweep point, against which `tcstudy converge` measures errors.

    u:        displacement [m];  theta: temperature, None if it is not compared [K]
    xi:       tangential traction −S_T on Γ_C [Pa], None to derive it from u
    exponent: u ~ r^exponent where it is least smooth, None where it is smooth
    derived:  whether loads, prescribed displacements and temperatures of the scenes were derived from it
    """

    u: tuple[Scalar, Scalar]
    theta: Scalar | None = None
    xi: Scalar | None = None
    exponent: float | None = None
    derived: bool = False


Start = Literal["zero", "lowest"]
Direction = Literal["both", "forward", "backward"]


@dataclass(frozen=True)
class PathPlan:
    """The path of solutions along one parameter t in which the load is affine, l̃(t) = l̃₀ + t l̃₁ (`tcstudy path`).

    parameter:  key path of t, e.g. ("heat", "theta_bar"), ("boundary", "top", "u_x"), ("loads", "f_x"); ("load",) is a
                factor of all mechanical loads f, g and pressure
    units:      units of t in CF form, "1" without
    begin, end: range of interest; the path starts at begin
    within:     (low, high): how far the path is followed; it may leave the range of interest and come back
    at:         values at which all solutions are wanted
    scene:      the scene without a sweep; its own value of the parameter is not used
    start:      which solution of t = begin the path goes through: the one found from zero or the lowest one found
    direction:  ways followed from the start; "forward" is towards end
    max_pieces: most pieces on either side of the start
    hysteresis: whether the loop between begin and end is computed
    level:      mesh level, None for the finest
    law_error:  relative error of the piecewise-linear stand-in for a law with exponential pieces
    """

    parameter: tuple[str, ...]
    units: str
    begin: float
    end: float
    within: tuple[float, float]
    scene: Scene
    at: tuple[float, ...] = ()
    start: Start = "zero"
    direction: Direction = "both"
    max_pieces: int = 20_000
    hysteresis: bool = True
    level: int | None = None
    law_error: float = 1e-3

    @property
    def name(self) -> str:
        """Dotted name of the parameter."""
        return ".".join(self.parameter)


Branch = Literal["lowest", "continued", "from-zero"]


@dataclass(frozen=True)
class SolverPlan:
    """How the contact problem is solved.

    names:          solvers; the first one's solution is stored, the others are compared with it
    tolerance:      largest inclusion residual of an accepted solution, strict; None for 1e-10 or what rounding allows
                    (solve/acceptance.py)
    max_iterations: iteration limit of the method, None for its own
    branch:         which solution is stored where several are found: the one of lowest energy ("lowest": starts at
                    zero, at the frictionless solution and at the neighbouring sweep point), the one that continues
                    the neighbour's ("continued"), or the one from zero ("from-zero")
    """

    names: tuple[str, ...] = ("separable-newton",)
    tolerance: float | None = None
    max_iterations: int | None = None
    branch: Branch = "lowest"


@dataclass(frozen=True)
class Axis:
    """One swept parameter.

    name:   dimension and coordinate name in the data, e.g. "alpha", "friction"
    path:   key path in the study, e.g. ("heat", "alpha")
    values: what is put at the path, point by point (plain YAML values)
    labels: numbers (SI) or texts that stand in the data's coordinate
    units:  units of the labels, "1" for texts
    """

    name: str
    path: tuple[str, ...]
    values: tuple[object, ...]
    labels: tuple[float | str, ...]
    units: str


@dataclass(frozen=True)
class OutputPlan:
    """Where the data go and what beside the mandatory variables is kept.

    fields: θ and u of the whole body at every point
    live:   what a page needs to solve the contact problem by itself (study.live); off unless asked for, because it
            costs a run some thirty temperatures and up to half a megabyte a level
    """

    path: Path | None = None
    fields: bool = False
    live: bool = False


@dataclass(frozen=True)
class Study:
    """A whole study: the sweep and one validated Scene for each of its points.

    mode:   "grid": points are the product of the axes; "list": axes are read together (zip and list)
    scenes: one per point, in C order of the axes; each is complete (scene.points.Scenes for a sweep)
    text:   the exact YAML text;  source: its file, if any
    units:  "SI" or "none" (dimensionless)
    """

    title: str
    text: str
    source: Path | None
    units: Literal["SI", "none"]
    mode: Literal["grid", "list"]
    axes: tuple[Axis, ...]
    scenes: Sequence[Scene]
    mesh: MeshPlan
    solver: SolverPlan
    output: OutputPlan
    institution: str = ""
    overrides: tuple[str, ...] = field(default=())
    exact: Exact | None = None
    path: PathPlan | None = None

    @property
    def shape(self) -> tuple[int, ...]:
        """Extent of the sweep along each data dimension (without the level)."""
        if self.mode == "grid":
            return tuple(len(axis.values) for axis in self.axes)
        return (len(self.axes[0].values),) if self.axes else ()
