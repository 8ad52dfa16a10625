"""What a study asks for beside its scenes: meshes and their families, solver, sweep, path, fit and
output.

A new family of meshes is one record here and one way to make its meshes, in fem/meshes.py (in
refine/family.py if they follow from the solutions); readers, forecasts, notes and reports ask the
record.

How a contact problem may be solved: the one place of the names of solvers, of starts, and of which
solution is kept.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal, get_args

import numpy as np
from numpy.typing import NDArray

from tcstudy.scene import units as u
from tcstudy.scene.designs import Design
from tcstudy.scene.histories import HistoryPlan
from tcstudy.scene.records import Point, Scalar, Scene

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

FAMILIES: dict[FamilyName, MeshFamily] = {
    "uniform": UNIFORM,
    "graded": GRADED,
    "adaptive": ADAPTIVE,
}
"""The families that a study can ask for by name."""


COMPARE = ("vertical", "orthogonal")
LOSSES = ("linear", "soft_l1")
SCALES = ("log", "linear")
RESULTS = {
    "friction_resultant": u.LINE_FORCE,
    "u_T_max": u.LENGTH,
    "theta_mean": u.TEMPERATURE,
    "u_T": u.LENGTH,
}
"""Results that may be measured, with their dimensions; u_T is that at the x of the datum."""
PLACE = ("x",)
"""Key path of the column that says where on the contact line u_T was measured."""
STEP = ("step",)
"""Key path of the column that says at which step of a history a line was measured."""


@dataclass(frozen=True)
class Sensitivity:
    """A number of the study by which results are differentiated.

    name:  as the study writes it;  path: key path, ("load",) for a factor of all mechanical loads
    units: of the number in CF form
    """

    name: str
    path: tuple[str, ...]
    units: str


@dataclass(frozen=True)
class FitParameter:
    """A number to find: where it stands, where the search begins and may go [SI], by its logarithm
    or not."""

    number: Sensitivity
    start: float
    low: float
    high: float
    log: bool


@dataclass(frozen=True)
class FitColumn:
    """A measured column.

    name:  a parameter in which the load is affine, x, or a result;  path: of what is given, empty for a result
    units: in CF form;  values: (n,) in SI;  noise: its standard deviation, None if that is estimated
    """

    name: str
    path: tuple[str, ...]
    units: str
    values: tuple[float, ...]
    noise: float | None
    dimension: u.Dimension


@dataclass(frozen=True)
class FitPlan:
    """A fit (section `fit`).

    given, measured: columns that the scene gets, and that are compared with its results
    parameters:      the numbers to find
    scene:           that of the study, with its own values
    file, sha256:    the table and its checksum; of several tests the first one's name, and that of all checksums
    level:           mesh level, None for the finest
    smooth:          whether laws by points are to be as straight as the data let them
    history:         the load history at whose steps was measured, None for static points
    """

    given: tuple[FitColumn, ...]
    measured: tuple[FitColumn, ...]
    parameters: tuple[FitParameter, ...]
    scene: Scene
    file: str
    sha256: str
    compare: Literal["vertical", "orthogonal"] = "vertical"
    starts: int = 5
    seed: int = 0
    loss: Literal["linear", "soft_l1"] = "linear"
    level: int | None = None
    smooth: bool = False
    history: HistoryPlan | None = None

    @property
    def count(self) -> int:
        """Data."""
        return sum(len(one.values) for one in self.measured)

    @property
    def loads(self) -> tuple[FitColumn, ...]:
        """The given columns that are parameters of the load."""
        return tuple(column for column in self.given if column.path not in (PLACE, STEP))

    @property
    def at_steps(self) -> list[int]:
        """The step of every line of the table; empty for static points."""
        return [
            int(value) for column in self.given if column.path == STEP for value in column.values
        ]

    @property
    def place(self) -> FitColumn | None:
        """Where on the contact line u_T was measured."""
        return next((column for column in self.given if column.path == PLACE), None)

    @property
    def known_noise(self) -> bool:
        """Whether the noise of all that is compared is known."""
        columns = (*self.measured, *(self.given if self.compare == "orthogonal" else ()))
        return all(column.noise is not None for column in columns)

    @property
    def assumed_noise(self) -> str:
        """What intervals assume of several columns whose noise is not all known; empty if
        nothing."""
        columns = (*(self.given if self.compare == "orthogonal" else ()), *self.measured)
        known, unknown = (
            [one.name for one in columns if (one.noise is None) is no] for no in (False, True)
        )
        if len(columns) < 2 or not unknown:
            return ""
        if known:
            beside = f"1 % of its range where that of {' and '.join(known)} is as given"
            return f"the noise of {' and '.join(unknown)} is {beside}"
        return f"{' and '.join(unknown)} are measured equally well, in parts of their ranges"


TOLERANCE = 1e-10
"""Largest inclusion residual by default, as long as rounding allows it."""


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
    known:    the exact value, if the study knows it; then the true error is stored beside the estimated one
    proved:   whether a tolerance is of the proved bound of the error in the energy norm, not of an estimate
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


@dataclass(frozen=True)
class MeshPlan:
    """The meshes of a study, coarse to fine.

    maxh:      element sizes; one per mesh
    levels:    number of levels; the most that there may be if there is a tolerance
    family:    with one maxh, what level i is: "uniform": the i-th uniform refinement; "graded": elements of size
               maxh/2^i, smaller towards singular points; "adaptive": level i−1 refined where its
               error is large
    grading:   exponent μ of graded meshes: h(r) ~ h (r/R)^(1−μ) at distance r from a singular point
    marking:   share of the estimated error (squared) that the triangles refined in one adaptive step carry
    goal:      what adaptive meshes are refined for, and what the tolerance is of
    tolerance: relative error at which refinement stops, None for all levels
    max_dofs:  displacement unknowns beyond which an adaptive family or one with a tolerance is not refined
    estimate:  whether errors are estimated on meshes that do not need it
    guarantee: whether λ₁ of the body, not of the mesh, is enclosed, and errors are bounded
    refine:    uniform refinements, of a mesh of size maxh·2^refine, that make the mesh of size maxh: many times as
               fast as meshing at maxh
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
    guarantee: bool = False
    refine: int = 0

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


Start = Literal["zero", "lowest"]
Direction = Literal["both", "forward", "backward"]


@dataclass(frozen=True)
class PathPlan:
    """The path of solutions along one parameter t in which the load is affine, l̃(t) = l̃₀ + t l̃₁
    (section `path`).

    parameter:  key path of t, e.g. ("heat", "theta_bar"), ("boundary", "top", "u_x"), ("loads", "f_x"); ("load",) is a
                factor of all mechanical loads: f, g, pressure, force, moment
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
    complete:   whether every branch between begin and end is sought, and proved to be all (contact/path/query.py)
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
    complete: bool = False

    @property
    def name(self) -> str:
        """Dotted name of the parameter."""
        return ".".join(self.parameter)


SEPARABLE, BUNDLE = SOLVERS = ("separable-newton", "bundle-newton")
"""Names that a study may give under `solver`."""

Branch = Literal["lowest", "continued", "from-zero"]
"""Which solution is stored where several are found; see `SolverPlan`."""
BRANCHES: tuple[Branch, ...] = get_args(Branch)
ALL = "all"
"""The word for all solutions beside the lowest one."""

START_NAMES = ("zero", "frictionless", "neighbour", "escape", "exact")
"""Starts: no displacement, the solution without friction, the solution of a neighbouring problem,
where these may not have led to the least energy the convexified problem and moves of single nodes
(contact/descent.py), and the exact solution of the continuous problem where the study gives one."""
ZERO, FRICTIONLESS, NEIGHBOUR, ESCAPE, EXACT = range(len(START_NAMES))


@dataclass(frozen=True)
class SolverPlan:
    """How the contact problem is solved.

    names:          solvers; the first one's solution is stored, the others are compared with it
    tolerance:      largest inclusion residual of an accepted solution, strict; None for 1e-10 or what rounding allows
    max_iterations: iteration limit of bundle-newton, None for its own
    branch:         which solution is stored where several are found: the lowest found ("lowest": starts at
                    zero, at the frictionless solution and at the neighbouring sweep point), the one
                    that continues
                    the neighbour's ("continued"), or the one from zero ("from-zero")
    every:          whether all solutions are sought, and proved to be all, beside the lowest found (branch: all)
    max_boxes, max_seconds: where the search for all of one point ends (contact/all_solutions.py)
    """

    names: tuple[str, ...] = (SEPARABLE,)
    tolerance: float | None = None
    max_iterations: int | None = None
    branch: Branch = "lowest"
    every: bool = False
    max_boxes: int = 20_000
    max_seconds: float = 60.0

    @property
    def aim(self) -> float:
        """Largest inclusion residual of a solution as if there were no rounding."""
        return TOLERANCE if self.tolerance is None else self.tolerance

    @property
    def in_blocks(self) -> bool:
        """Whether points are solved together."""
        return self.names == (SEPARABLE,)


@dataclass(frozen=True)
class Axis:
    """One swept parameter.

    name:   dimension and coordinate name in the data, "alpha";  path: key path in the study, ("heat", "alpha")
    values: what is put at the path, point by point (plain YAML values)
    labels: numbers (SI) or texts that stand in the data's coordinate
    units:  units of the labels, "1" for texts;  distribution: that they were drawn from, in words; empty if not drawn
    written: unit that the study writes the numbers in, and its size in SI; ("", 1) if that is SI, or not one
    """

    name: str
    path: tuple[str, ...]
    values: tuple[object, ...]
    labels: tuple[float | str, ...]
    units: str
    distribution: str = ""
    written: tuple[str, float] = ("", 1.0)

    @property
    def is_whole(self) -> bool:
        """Whether its values are laws or materials, by name."""
        return all(isinstance(value, Mapping) for value in self.values)

    def labelled(self) -> list[tuple[float | str, object]]:
        """Every label with its value."""
        return list(zip(self.labels, self.values, strict=True))


@dataclass(frozen=True)
class Probe:
    """A point at which u, θ and σ are stored, and u_T where it lies on a contact edge."""

    name: str
    at: Point
    on_contact: bool = False


_SHELL_VARIABLE = re.compile(r"\$(\w+|\{\w+\})")


def shell_name(text: str) -> tuple[str, str] | None:
    """Return what is wrong with the name of an output that only a shell understands, and the
    remedy."""
    if text == "-":
        return "names no file, and results cannot be a stream", "write a name such as results/a.nc"
    if text.startswith("~"):
        return "begins with ~, which only a shell knows as a home directory", "write the path out"
    if variable := _SHELL_VARIABLE.search(text):
        return f"has {variable[0]}, which only a shell replaces by its value", "write the path out"
    return None


@dataclass(frozen=True)
class OutputPlan:
    """Where the data go and what beside the mandatory variables is kept.

    fields: θ and u of the whole body at every point
    live:   what a page needs to solve the contact problem by itself (`live_arrays` in offline.level); off unless
            asked for, because it takes up to half a megabyte a level and two loads a point
    sensitivity: numbers by which the results of every point are differentiated
    probes, quantities: points and words for further numbers of every point (data.schema)
    """

    path: Path | None = None
    fields: bool = False
    live: bool = False
    sensitivity: tuple[Sensitivity, ...] = ()
    probes: tuple[Probe, ...] = ()
    quantities: tuple[str, ...] = ()

    @property
    def asks(self) -> bool:
        """True if there are numbers on request."""
        return bool(self.sensitivity or self.probes or self.quantities)


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


@dataclass(frozen=True, repr=False)
class Study:
    """A whole study: the sweep and one validated Scene for each of its points.

    mode:   "grid": points are the product of the axes; "list": axes are read together (zip and list)
    scenes: one per point, in C order of the axes; each is complete (scene.points.Scenes for a sweep)
    text:   the exact YAML text;  source: its file, if any
    units:  "SI" or "none" (dimensionless)
    design: how the points were drawn, None if the study lists them
    variants: one study for each geometry where the sweep varies the body or its meshes; `mesh` is that of the first
    geometric: the axes that make the geometries, by number
    tests:  one study for each further test of a fit, with its own data and values
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
    history: HistoryPlan | None = None
    fit: FitPlan | None = None
    design: Design | None = None
    variants: tuple[Variant, ...] = ()
    geometric: tuple[int, ...] = ()
    tests: tuple[Study, ...] = ()

    def __repr__(self) -> str:
        """One line: a whole study would fill pages."""
        axes = ", ".join(f"{axis.name} ({len(axis.values)})" for axis in self.axes) or "none"
        return f"Study({self.title!r}, sweep: {axes}, points: {len(self.scenes)}, levels: {self.mesh.levels})"

    @property
    def kind(self) -> Literal["run", "path", "history", "fit"]:
        """What `run` does: the first of the sections fit, history, path that there is, else the
        sweep's points."""
        return "fit" if self.fit else "history" if self.history else "path" if self.path else "run"

    @property
    def shape(self) -> tuple[int, ...]:
        """Extent of the sweep along each data dimension (without the level)."""
        if self.mode == "grid":
            return tuple(len(axis.values) for axis in self.axes)
        return (len(self.axes[0].values),) if self.axes else ()

    @property
    def bodies(self) -> tuple[Variant, ...]:
        """The geometries of the sweep; without any the study itself as one."""
        return self.variants or (Variant("", np.arange(len(self.scenes)), self),)


@dataclass(frozen=True, eq=False)
class Variant:
    """One geometry of a sweep over numbers of the body or its meshes: its points share its mesh and
    factor.

    words:  its swept numbers, for messages
    places: (P,) its points in the sweep of the whole study, counted in C order
    study:  its study; None where the geometry is refused
    reason: why it is refused, in words
    """

    words: str
    places: NDArray[np.intp]
    study: Study | None
    reason: str = ""
