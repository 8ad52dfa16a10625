"""The variables in the file of a run: their dimensions, units and meaning (CF-1.11).

Root:           results by sweep point and level, and the values of a level
/level_0, …:    the contact line of that mesh and, on request, the whole-body fields (UGRID-1.0)
Geometries:     A sweep over geometries has the same groups (layout 2). The contact line of every
                geometry is padded to the longest one of the level. Meshes stand end to end as one
                UGRID mesh of parts that do not touch.
Missing values: NaN for floats (as _FillValue). −1 for counts, outside their valid_min and without
                _FillValue, so that no reader turns an integer array into floats. For flags the one
                with that meaning.

Variables on request of `output`: `probe_<name>_u_x`, `_u_y`, `_theta`, `_sigma_xx`, `_sigma_yy`,
`_sigma_xy` and on a contact edge `_u_T`; `reaction_<edge>_x`, `_y`; `force_<edge>_x`, `_y`,
`work_<edge>`; `section_force_max`, `section_force_at` and along the contact line `section_force`,
`layer_force_<region>`; `theta_mean_<edge>`; `von_mises_max` with `von_mises_x` and `_y`.

Derivatives are `sensitivity_<quantity>_<parameter>`: ∂quantity/∂parameter at the solution of the
point and level, the parameter's dots written as `_`, as in
`sensitivity_friction_resultant_friction_delta`. They hold for the stored solution while its nodes
keep their pieces of b. At an event the derivatives of two sides differ: they are missing there, and
`sensitivity_status` says so. Derivatives of steps of a history are differences of whole histories.
They are not the Sobol indices of `tcstudy show`.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from enum import IntEnum
from itertools import chain, product
from itertools import count as counter
from typing import Any, Literal

import numpy as np

from tcstudy.scene.fit_plan import Sensitivity
from tcstudy.scene.mesh_plan import Goal
from tcstudy.scene.points import law_regions
from tcstudy.scene.records import Clamped, Contact, Free
from tcstudy.scene.solver_plan import START_NAMES
from tcstudy.scene.study import SLIP_BOUNDS, Study

UNPROVED_BRANCHES = "the branches are not proved to be all"
OPEN_LOOP = "the hysteresis loop is not whole"
"""First words of those shortfalls of a path that leave the solutions on it complete."""


class PointStatus(IntEnum):
    """Status of a sweep point in a file (CF status_flag); every status but OK has a reason."""

    NOT_RUN = 0
    OK = 1
    NOT_CONVERGED = 2
    INCLUSION_VIOLATED = 3
    SINGULAR = 4
    MESH_FAILED = 5
    ERROR = 6


Dtype = Literal["f8", "i8", "i4", "i1", "str"]
Dims = tuple[str, ...]
Extra = Mapping[str, Any]
SWEEP = "*"
"""Stands for the dimensions of the sweep in a `FileVariable.dims`."""
OUTER, INNER = "+", "-"
"""Stand for the dimensions of the sweep that change the geometry, and for those of its points."""
POINT = "point"
"""The one sweep dimension of a study in list mode."""
OWN_POINT = "own_point"
"""In list mode the dimension of the points of one geometry."""
GEOMETRIES = "geometries"
"""Global attribute of a file of several geometries, and its dimension: the number of geometries."""
LAYOUT, PADDED = "layout", 2
"""Global attribute with the layout of several geometries, and its value: groups of levels.

Files of version 0.8 have no such attribute, and a group for every geometry.
"""
T, RATE = "t", "J m-1/t"
"""Stand for the units of a path's parameter, and of energy per parameter, in a `FileVariable`."""
POINT_LEVEL, LEVEL = (SWEEP, "level"), ("level",)
MISSING_COUNT = -1


@dataclass(frozen=True)
class FileVariable:
    """A netCDF variable.

    units:      SI; a dimensionless study ("none") has "1" in place of everything but seconds; texts
                have no units
    long_name:  short enough for the axis of a plot
    comment:    further explanation
    dims:       dimension names; SWEEP stands for those of the sweep
    extra:      further attributes
    coordinate: whether it locates data: no missing values, no _FillValue
    no_value:   the flag of a missing value
    """

    name: str
    dtype: Dtype
    units: str
    long_name: str
    dims: Dims = POINT_LEVEL
    comment: str = ""
    extra: Extra = field(default_factory=dict)
    coordinate: bool = False
    no_value: int = 0

    @property
    def missing(self) -> float | int | str:
        """The value that stands where there is none."""
        by_type: dict[Dtype, float | int | str] = {
            "f8": float("nan"),
            "i4": MISSING_COUNT,
            "str": "not run",
        }
        return by_type.get(self.dtype, self.no_value)

    @property
    def fill_value(self) -> float | Literal[False]:
        """The _FillValue attribute; False for none."""
        return float("nan") if self.dtype == "f8" and not self.coordinate else False

    @property
    def itemsize(self) -> int:
        """Size of a value in memory [byte]; of a text that of the reference to it."""
        return 8 if self.dtype == "str" else np.dtype(self.dtype).itemsize


def flags(*meanings: str, first: int = 0) -> Extra:
    """Return the attributes of bytes that count `meanings` from `first`."""
    values = np.arange(first, first + len(meanings), dtype=np.int8)
    return {"flag_values": values, "flag_meanings": " ".join(meanings)}


JUDGED: Extra = {"ancillary_variables": "status"}
DIFFERENCE: Extra = {"units_metadata": "temperature: difference"}
STATUS: Extra = {"standard_name": "status_flag", **flags(*(s.name.lower() for s in PointStatus))}
CERTIFIED = ("not_certified", "certified")


def count(
    name: str,
    long_name: str,
    dims: Dims = POINT_LEVEL,
    extra: Extra = JUDGED,
    comment: str = "",
) -> FileVariable:
    """Return the variable of a count, −1 where there is none. extra: further attributes"""
    comment = comment or f"{MISSING_COUNT} where there is no value"
    extra = {"valid_min": np.int32(0), **extra}
    return FileVariable(name, "i4", "1", long_name, dims, comment, extra)


def flag(
    name: str,
    long_name: str,
    meanings: Sequence[str] = CERTIFIED,
    dims: Dims = POINT_LEVEL,
    comment: str = "",
) -> FileVariable:
    """Return the variable of bytes that count meanings from 0; `status` qualifies them."""
    return FileVariable(name, "i1", "1", long_name, dims, comment, {**flags(*meanings), **JUDGED})


def result(
    name: str, units: str, long_name: str, comment: str = "", dims: Dims = POINT_LEVEL
) -> FileVariable:
    """Return the variable of a number that `status` qualifies."""
    extra = {**JUDGED, **DIFFERENCE} if units == "K" else JUDGED
    return FileVariable(name, "f8", units, long_name, dims, comment, extra)


def _time(step: str, dims: Dims = POINT_LEVEL) -> FileVariable:
    return FileVariable(f"time_{step}", "f8", "s", f"time to {step}", dims, "wall time")


HEAT_BOUND = 1e-10
"""Largest relative defect of the heat balance that passes, as the default of solver.tolerance.

The defect is rounding × condition of the heat matrix, about 1e-12 on 1e6 good triangles and 1e-9 to
1e-4 of slivers.
"""
NOT_JUDGED, BALANCED, UNBALANCED = 0, 1, 2
MET, LIMITED = 1, 2
UNKNOWN, STICKS = -1, 1
_INTEGRAL = "integral of -S_T over the contact line, per unit thickness"
_INTEGRAL_N = (
    "integral of S_N over the edges that lift off, per unit thickness, positive in tension"
)
_MIXITY = "angle of the works of slip and opening where they are largest, 90 for slip alone"
_SLIPPING = "length of the contact line that does not stick"
_ROUNDED = (
    "limited_by_rounding: above the tolerance by default, but no larger than inclusion_rounding"
)
_SLIVERS = f"unbalanced where heat_balance exceeds {HEAT_BOUND:g}: thin triangles cost theta digits"

ROOT: tuple[FileVariable, ...] = (
    FileVariable("h_max", "f8", "m", "largest element edge", LEVEL),
    count("n_dof", "displacement degrees of freedom", LEVEL, {}),
    count("n_contact", "contact degrees of freedom m", LEVEL, {}),
    FileVariable("status", "i1", "1", "status of the point", extra=STATUS),
    FileVariable("reason", "str", "", "reason of the status", comment="why the point is not ok"),
    result(
        "energy", "J m-1", "energy", "of the discrete problem at the solution, per unit thickness"
    ),
    result(
        "inclusion_residual",
        "1",
        "inclusion residual",
        "largest distance of -S_T from the filled graph of b, over its scale",
    ),
    result(
        "inclusion_rounding",
        "1",
        "rounding level of the inclusion residual",
        "residual that the rounding of doubles alone can cause",
    ),
    flag(
        *(
            "inclusion_status",
            "verdict on inclusion residual",
            ("not_judged", "met", "limited_by_rounding"),
        ),
        comment=_ROUNDED,
    ),
    count("iterations", "steps of the solver"),
    count("evaluations", "evaluations of the energy"),
    result(
        "u_T_max",
        "m",
        "largest |u_T|",
        "at the contact nodes; constrained ends do not count",
    ),
    result("friction_resultant", "N m-1", "friction resultant", _INTEGRAL),
    result("slip_length", "m", "slip length", f"{_SLIPPING}; missing for laws that stick nowhere"),
    result("shear_max", "Pa", "largest |xi|", "tangential traction on the contact line"),
    result("shear_max_at", "m", "arc length of the largest |xi|"),
    result(
        "lambda_1",
        "Pa m-1",
        "tangential stiffness lambda_1",
        "smallest of the body, per contact length",
    ),
    result(
        "lambda_1_error",
        "1",
        "relative error of lambda_1",
        "by rounding; proofs use a body that is softer by it",
    ),
    result("omega", "Pa m-1", "maximum softening slope omega of b", "infinite for a sudden drop"),
    result(
        "uniqueness_margin",
        "Pa m-1",
        "lambda_1 - omega",
        "with the omega of each node; unique if positive",
    ),
    flag("unique", "unique solution of the discrete problem"),
    flag("strict_minimum", "strict local minimum of the energy"),
    flag("global_minimum", "global minimum of the energy"),
    flag("start_used", "start of the stored solution", START_NAMES),
    FileVariable("start_energy", "f8", "J m-1", "energy by start", (*POINT_LEVEL, "start")),
    result("theta_mean", "K", "mean temperature", "of the body above its stress-free state"),
    result(
        "heat_balance",
        "1",
        "heat balance residual",
        "heat through edges minus heat input, relative",
    ),
    flag(
        "heat_status",
        "verdict on heat balance",
        ("not_judged", "balanced", "unbalanced"),
        comment=_SLIVERS,
    ),
    *(_time(step, LEVEL) for step in ("mesh", "assemble")),
    *(_time(step) for step in ("condense", "solve")),
)

_OF_REGIONS = {
    "elastic": ("elastic", "where b is on its initial elastic branch"),
    "yielded": ("plateau", "beyond sticking or the elastic branch, where b does not soften"),
    "softening": ("softening", "where b softens"),
    "debonded": ("debonded", "beyond the last softening of b"),
}
REGIONS: tuple[FileVariable, ...] = (
    result(
        "breathing_length",
        "m",
        "slip zone length",
        "where u_T is not 0; missing for laws that stick nowhere",
    ),
    *(
        result(f"{name}_length", "m", f"{region} length", meaning)
        for name, (region, meaning) in _OF_REGIONS.items()
    ),
)
"""Lengths of the contact line in the regions that the laws have; u_T is linear between nodes."""


def region_variables(study: Study) -> tuple[FileVariable, ...]:
    """Return the variables of REGIONS whose region some law of the study has."""
    regions = law_regions(study.scenes)
    return tuple(v for v in REGIONS if v.name.removesuffix("_length") in regions)


_OVER_LINE = "at the contact nodes"
OPENINGS: tuple[FileVariable, ...] = (
    result("opening_max", "m", "largest opening", _OVER_LINE),
    result("peel_stress_max", "Pa", "largest peel stress", f"tension across the bond {_OVER_LINE}"),
    result("pressure_max", "Pa", "largest contact pressure", _OVER_LINE),
    result(
        "opened_length", "m", "opened length", "of the contact line where the opening is above 0"
    ),
    result("adhesion_resultant", "N m-1", "normal resultant", _INTEGRAL_N),
    result("mode_mixity", "degree", "mode mixity", _MIXITY),
)
"""Results of studies with edges that may lift off."""
CONTRACTION = result(
    "contraction",
    "1",
    "contraction of the pressures",
    "upper bound; the solution is unique if it is below 1, missing where there is no bound",
)
"""Result of studies whose friction acts only where an edge is pressed."""


def opening_variables(study: Study) -> tuple[FileVariable, ...]:
    """Return the variables by point of a study with edges that may lift off, else none."""
    if not study.opens:
        return ()
    either = "beyond the last softening of b of the slip or of the opening"
    debonded = result("debonded_length", "m", "debonded length", either)
    is_there = any(v.name == debonded.name for v in region_variables(study))
    is_added = not is_there and "debonded" in law_regions(study.scenes, "adhesion")
    of_pressure = (CONTRACTION,) if study.knows_pressure else ()
    return (*OPENINGS, *((debonded,) if is_added else ()), *of_pressure)


NOT_ALL, ALL_PROVED, OF_POLYGON = 0, 1, 2
_LISTED = "not_proved counts the equilibria found; of_the_polygon: of a polygon within 1e-3 of b"
EVERY: tuple[FileVariable, ...] = (
    count("solutions", "number of equilibria"),
    count("stable_solutions", "equilibria that are strict local minima"),
    flag(
        "complete",
        "completeness of the list of equilibria",
        ("not_proved", "proved", "proved_of_the_polygon"),
        comment=_LISTED,
    ),
)
"""Variables of points of which all solutions are sought."""

_SOLUTION = ("solution",)
_SIDES = "counted from the left, jumps included"
SOLUTION: tuple[FileVariable, ...] = (
    FileVariable(
        "solution_point", "i4", "1", "index of its point in the sweep, in C order", _SOLUTION
    ),
    FileVariable("solution_energy", "f8", "J m-1", "energy of the equilibrium", _SOLUTION),
    FileVariable(
        "solution_stable",
        "i1",
        "1",
        "strict local minimum",
        _SOLUTION,
        extra=flags("unstable", "stable"),
    ),
    FileVariable("solution_u_T", "f8", "m", "tangential displacement", (*_SOLUTION, "node")),
    FileVariable("solution_xi", "f8", "Pa", "tangential traction -S_T", (*_SOLUTION, "node")),
    FileVariable(
        "solution_piece", "i4", "1", "segment of the law's graph", (*_SOLUTION, "node"), _SIDES
    ),
)
"""All solutions of all points of a level, point by point, the lowest energy of a point first."""
_AT_OPENING = ("opening_node",)
SOLUTION_OPENING: tuple[FileVariable, ...] = (
    FileVariable("solution_opening", "f8", "m", "opening -u_N", (*_SOLUTION, *_AT_OPENING)),
    FileVariable("solution_S_N", "f8", "Pa", "normal traction S_N", (*_SOLUTION, *_AT_OPENING)),
    FileVariable(
        *("solution_piece_N", "i4", "1", "segment of the graph of the law of the opening"),
        (*_SOLUTION, *_AT_OPENING),
        _SIDES,
    ),
)
"""Of solutions of studies with edges that may lift off, beside SOLUTION."""
EXISTENCE_RADIUS = FileVariable(
    "existence_radius",
    "f8",
    "J0.5 m-0.5",
    "radius of a ball that holds a solution of the body",
    _SOLUTION,
    "about the stable equilibrium, in the energy norm; proved, missing without a proof",
)
"""Of solutions of studies that bound errors."""

_BY_SOLVER = (*POINT_LEVEL, "solver")
_FIRST = "max |u_T - u_T of the first solver| over max |u_T| of the first"
SOLVERS: tuple[FileVariable, ...] = (
    FileVariable("solver_residual", "f8", "1", "inclusion residual by solver", _BY_SOLVER),
    FileVariable("solver_energy", "f8", "J m-1", "energy by solver", _BY_SOLVER),
    count("solver_iterations", "steps by solver", _BY_SOLVER, {}),
    FileVariable("solver_time", "f8", "s", "wall time by solver", _BY_SOLVER),
    FileVariable(
        "solver_difference", "f8", "1", "difference to the first solver", _BY_SOLVER, _FIRST
    ),
)
"""Variables by solver of a study that names several; the solution of the first one is stored."""

ESTIMATES: tuple[FileVariable, ...] = (
    result(
        "error_estimate",
        "1",
        "estimated error",
        "of the displacement in the energy norm, over its own norm",
    ),
    FileVariable("stop", "str", "", "reason why refinement ended", LEVEL),
)
"""Variables of a study that estimates errors."""

_PROVED = ("not_proved", "proved")
POLYGON = "polygon that the mesh has"
"""What guarantees are of in place of a body with arcs."""


def band_variables(body: str = "body") -> tuple[FileVariable, ...]:
    """Return the variables of λ₁ of the body itself, or of what has its place."""
    itself = f"of the {body} itself, not of its discretisation"
    unique = "omega < lambda_1_low: the problem itself, not its discretisation, has one solution"
    return (
        result("lambda_1_low", "Pa m-1", f"lower bound of lambda_1 of the {body}", itself),
        result("lambda_1_high", "Pa m-1", f"upper bound of lambda_1 of the {body}", itself),
        result(
            "lambda_1_dual",
            "Pa m-1",
            "lambda_1 of equilibrium elements",
            f"nearer to the {body} than that of linear elements",
        ),
        flag("proved_unique", f"only solution of the {body}", _PROVED, comment=unique),
    )


def bound_variables(body: str = "body") -> tuple[FileVariable, ...]:
    """Return the variables of proved bounds of errors."""
    exact = f"of the solution of the {body}, not of a finer mesh"
    norm = f"over the norm of the solution of the {body}, no less; missing where that may be 0"
    of = _of_polygon(body)
    return (
        result("error_bound", "J0.5 m-0.5", f"proved bound of the error of u{of}", exact),
        result("error_bound_relative", "1", f"proved bound of the relative error of u{of}", norm),
    )


def _of_polygon(body: str) -> str:
    """Return what a name of a bound ends with where it is not of the body."""
    return "" if body == "body" else f", of the {body}"


def slip_bound_variables(body: str = "body") -> tuple[FileVariable, ...]:
    """Return the variables of proved bounds of slips and of the friction resultant."""
    exact = f"against the solution of the {body}"
    of = _of_polygon(body)
    slip = f"proved bound of the error of the mean slip of every segment{of}"
    resultant = f"proved bound of the error of the friction resultant{of}"
    held = f"{exact}; missing where an end of the contact line is constrained"
    return (
        result("slip_bound", "m", slip, exact),
        result("friction_bound", "N m-1", resultant, held),
    )


def existence_variables(body: str = "body") -> tuple[FileVariable, ...]:
    """Return the variables of how many solutions the body has, of points with all solutions."""
    least = "proved; no fewer, and 0 without a proof"
    estimated = "estimated; missing where it is not known, and where none is needed"
    return (
        count(
            "solutions_of_body", f"least number of solutions of the {body}", extra={}, comment=least
        ),
        result(
            "existence_size",
            "m",
            f"largest element edge at which all stable solutions have proofs for the {body}",
            estimated,
        ),
    )


GUARANTEED = (
    *band_variables(),
    *bound_variables(),
    *slip_bound_variables(),
    *existence_variables(),
)
"""All variables of what is proved of the body."""


def guaranteed_variables(study: Study) -> tuple[FileVariable, ...]:
    """Return the variables of what is proved of the body of a study."""
    variables = list[FileVariable]()
    body = POLYGON if study.mesh.guarantee == "polygon" else "body"
    if study.encloses_lambda_1:
        variables += band_variables(body)
    if study.mesh.bounds_errors:
        variables += bound_variables(body)
        if SLIP_BOUNDS in study.output.quantities:
            variables += slip_bound_variables(body)
        if study.solver.every:
            variables += existence_variables(body)
    return tuple(variables)


_GOALS = {
    "friction_resultant": ("N m-1", _INTEGRAL),
    "slip_length": ("m", _SLIPPING),
    "u_T": ("m", "tangential displacement at the point of the study"),
}
_GOAL_NAMES = ("goal", "goal_estimate", "goal_error", "goal_effectivity")


def goal_variables(goal: Goal, exact: bool) -> tuple[FileVariable, ...]:
    """Return the variables of a goal; the error in the energy norm is `error_estimate`.

    exact: whether the study has an exact solution
    """
    if goal.quantity == "energy":
        return ()
    units, meaning = _GOALS[goal.quantity]
    estimates = (
        result("goal", units, "quantity of interest", meaning),
        result("goal_estimate", units, "estimated error of the quantity of interest", "absolute"),
    )
    if goal.known is None and not exact:
        return estimates
    reference = "absolute, against the exact solution"
    if goal.known is not None:
        reference = f"absolute, against {goal.known!r}, which is known"
    ratio = "goal_estimate over goal_error"
    return (
        *estimates,
        result("goal_error", units, "error of the quantity of interest", reference),
        result("goal_effectivity", "1", "effectivity of the estimate", ratio),
    )


LEVEL_COORDINATE = FileVariable("level", "i4", "1", "mesh level", LEVEL, coordinate=True)

_NODE, _END, _MESH_NODE = ("node",), ("held_end",), ("mesh_node",)
_AT_NODE, _ON_LINE = {"coordinates": "arclength x y"}, (SWEEP, "node")
_RESULT_AT_NODE = {**JUDGED, **_AT_NODE}


def place(name: str, long_name: str, dims: Dims) -> FileVariable:
    """Return the variable of a coordinate in metres."""
    return FileVariable(name, "f8", "m", long_name, dims, coordinate=True)


_SENSE = "positive with the body on the left, counter-clockwise on an outline, to larger arclength"

CONTACT: tuple[FileVariable, ...] = (
    place("arclength", "arc length on contact line", _NODE),
    *(place(name, f"{name} of the contact node", _NODE) for name in "xy"),
    FileVariable("c", "f8", "m", "tributary length of the node", _NODE, extra=_AT_NODE),
    FileVariable("edge", "i1", "1", "contact edge", _NODE, extra=_AT_NODE),
    FileVariable(
        "u_T", "f8", "m", "tangential displacement", _ON_LINE, _SENSE, extra=_RESULT_AT_NODE
    ),
    FileVariable("xi", "f8", "Pa", "tangential traction -S_T", _ON_LINE, extra=_RESULT_AT_NODE),
    FileVariable(
        *("sticks", "i1", "1", "sticks, on a vertical segment of b", _ON_LINE),
        extra={**flags("unknown", "slips", "sticks", first=UNKNOWN), **_RESULT_AT_NODE},
        no_value=UNKNOWN,
    ),
)

_WHOLE = "of the whole body across the line at the node, positive in tension"
SECTION = FileVariable(
    "section_force", "f8", "N m-1", "section force", _ON_LINE, _WHOLE, _RESULT_AT_NODE
)
LAYER = "layer_force_"
"""Prefix of the names of the forces of layers, which are variables like SECTION."""

_AT_END = {"coordinates": "held_arclength held_x held_y"}
HELD: tuple[FileVariable, ...] = (
    place("held_arclength", "arc length of the constrained end", _END),
    *(place(f"held_{name}", f"{name} of the constrained end", _END) for name in "xy"),
    FileVariable(
        "held_u_T",
        "f8",
        "m",
        "tangential displacement of the constrained end",
        (SWEEP, *_END),
        extra=_AT_END,
    ),
)
"""Ends of the contact line that carry no unknown, because a clamped edge prescribes their u_T."""

JOINTS: tuple[FileVariable, ...] = (
    FileVariable("joint_node", "i4", "1", "contact node where two contact edges meet", ("joint",)),
    FileVariable("joint_edge", "i1", "1", "the edge before the node", ("joint",)),
    FileVariable(
        "joint_share", "f8", "1", "part of its tributary length on the edge before", ("joint",)
    ),
)
"""Nodes with the friction of two contact edges (`tcstudy.laws.composed`)."""

_OPENS = {"coordinates": "opening_arclength opening_x opening_y"}
_RESULT_AT_OPENING = {**JUDGED, **_OPENS}
_ON_OPENING = (SWEEP, *_AT_OPENING)
OPENING: tuple[FileVariable, ...] = (
    place("opening_arclength", "arc length of the node that may lift off", _AT_OPENING),
    *(
        place(f"opening_{name}", f"{name} of the node that may lift off", _AT_OPENING)
        for name in "xy"
    ),
    FileVariable("opening_edge", "i1", "1", "contact edge of it", _AT_OPENING, extra=_OPENS),
    FileVariable(
        "c_N",
        "f8",
        "m",
        "tributary length of the node, of edges that lift off",
        _AT_OPENING,
        extra=_OPENS,
    ),
    FileVariable(
        *("opening", "f8", "m", "opening -u_N", _ON_OPENING),
        "positive where the body has lifted off the foundation",
        _RESULT_AT_OPENING,
    ),
    FileVariable(
        *("S_N", "f8", "Pa", "normal traction S_N", _ON_OPENING, "positive in tension"),
        _RESULT_AT_OPENING,
    ),
    FileVariable(
        *("rests_N", "i1", "1", "rests, on a vertical segment of the law", _ON_OPENING),
        extra={**flags("unknown", "free", "rests", first=UNKNOWN), **_RESULT_AT_OPENING},
        no_value=UNKNOWN,
    ),
)
"""Nodes of contact edges that may lift off; a study without such edges has none of these."""

MESH_TOPOLOGY: dict[str, Any] = {
    "cf_role": "mesh_topology",
    "long_name": "triangulation of the body",
    "topology_dimension": np.int32(2),
    "node_coordinates": "node_x node_y",
    "face_node_connectivity": "triangle",
}
"""Attributes of the scalar variable `mesh`, which names the arrays of a mesh (UGRID-1.0)."""
_CONNECTIVITY = {"cf_role": "face_node_connectivity", "start_index": np.int32(0)}
MESH: tuple[FileVariable, ...] = (
    *(place(f"node_{name}", f"{name} of the mesh node", _MESH_NODE) for name in "xy"),
    FileVariable(
        "triangle", "i4", "1", "nodes of the triangle", ("mesh_face", "corner"), extra=_CONNECTIVITY
    ),
)
_RIM_ENDS = ("rim_segment", "rim_end")
RIM_EDGE = FileVariable("rim_edge", "i1", "1", "edge of the body", ("rim_segment",))
RIM: tuple[FileVariable, ...] = (
    *(place(f"rim_{name}", f"{name} of an end of the segment", _RIM_ENDS) for name in "xy"),
    RIM_EDGE,
)
"""Boundary of a body from a CAD file: straight segments with the body on their left, their edges.

The study itself does not have the shape of such a body.
"""
_FACE = {"mesh": "mesh", "location": "face"}
REGION = FileVariable(
    "region", "i1", "1", "region with a material of its own", ("mesh_face",), extra=_FACE
)
"""Region of a triangle: 0 for the material of the body, i for the i-th one of `materials`."""
_AT_MESH = {"coordinates": "node_x node_y", "mesh": "mesh", "location": "node", **JUDGED}
_IN_BODY, _HEATED = (SWEEP, *_MESH_NODE), {**_AT_MESH, **DIFFERENCE}
FIELDS: tuple[FileVariable, ...] = (
    FileVariable(
        "theta", "f8", "K", "temperature", _IN_BODY, "above the stress-free state", _HEATED
    ),
    *(
        FileVariable(f"u_{name}", "f8", "m", f"displacement in {name}", _IN_BODY, extra=_AT_MESH)
        for name in "xy"
    ),
)

_GIVE = (
    "1 where lambda/mu is that of the first point: only there do these arrays define the problem"
)
LIVE: tuple[FileVariable, ...] = (
    FileVariable(
        "A_tilde", "f8", "Pa", "condensed stiffness of the first point", ("node", "node_column")
    ),
    FileVariable("stiffness", "f8", "1", "mu over that of the first point", (SWEEP,)),
    FileVariable("load", "f8", "N m-1", "condensed load", _ON_LINE),
    FileVariable(
        "mechanical_load",
        "f8",
        "N m-1",
        "part of the condensed load from f, g and pressure",
        _ON_LINE,
    ),
    FileVariable("valid", "f8", "1", _GIVE, (SWEEP,)),
)
"""The group `live` of a level: arrays with which a browser solves its contact problems.

A study asks for them with output.live (`live_arrays` in tcstudy.offline.level). They are fields of
a record, with LIVE_PREFIX before their names.
"""
LIVE_PREFIX = "live_"

NUMBER = FileVariable(
    *("geometry", "i4", "1", "number of the geometry", (SWEEP,)),
    comment="-1 where the geometry was refused or has no mesh",
)
OVERRIDES = FileVariable(
    *("overrides", "str", "", "options that make the study of the geometry", (GEOMETRIES,)),
    comment="with study_yaml, one option per line; empty where the geometry was refused",
)
_UNDER_MESH = "mesh by mesh; geometries without a mesh have none"
MESH_COUNTS: tuple[FileVariable, ...] = (
    FileVariable(
        "mesh_node_count", "i4", "1", "mesh nodes of the geometry", (GEOMETRIES,), _UNDER_MESH
    ),
    FileVariable(
        "mesh_face_count", "i4", "1", "triangles of the geometry", (GEOMETRIES,), _UNDER_MESH
    ),
)
MESH_GEOMETRY = FileVariable(
    "mesh_geometry", "i4", "1", "number of the geometry", ("mesh_face",), extra=_FACE
)
"""Variables beside MESH of a level of several geometries, by which the mesh of one is found."""
EDGE_FLAGS = ("edge", "joint_edge", "opening_edge")
"""Variables whose flags mean the contact edges."""
NO_EDGE, NONE = -1, "none"
"""Flag, and its meaning, behind the end of a contact line that is shorter than others."""
_ENDS = ("node", "held_end", "joint", "rim_segment", "opening_node")
"""Dimensions whose lengths differ from geometry to geometry, and which are padded."""


def among_geometries(variable: FileVariable) -> FileVariable:
    """Return the variable of a level as a file of several geometries has it.

    Variables of the contact line that do not depend on the point lie along OUTER, too, and may end
    in missing values. Fields lie along INNER, since every geometry has its part of the mesh nodes.
    """
    dims = variable.dims
    if dims == _IN_BODY:
        return replace(variable, dims=(INNER, *_MESH_NODE))
    if dims and dims[0] in _ENDS:
        variable = replace(variable, dims=(OUTER, *dims), coordinate=False)
    return replace(variable, no_value=NO_EDGE) if variable.dtype == "i1" else variable


_LINES = (*CONTACT, *OPENING, *HELD, *JOINTS, *RIM, *LIVE)
ONCE = frozenset(v.name for v in _LINES if SWEEP not in v.dims)
"""Names of the variables of a contact line that do not depend on the point."""

_POINTS = (
    *ROOT,
    *REGIONS,
    *OPENINGS,
    CONTRACTION,
    *EVERY,
    *SOLVERS,
    *ESTIMATES,
    *GUARANTEED,
)
_ALL = (
    *_POINTS,
    *SOLUTION,
    *SOLUTION_OPENING,
    EXISTENCE_RADIUS,
    *CONTACT,
    *OPENING,
    SECTION,
    *HELD,
    *JOINTS,
    *MESH,
    *RIM,
    REGION,
    *FIELDS,
)
_OF_GEOMETRIES = (NUMBER, OVERRIDES, *MESH_COUNTS, MESH_GEOMETRY)
_EVERY = (*_ALL, *LIVE, *_OF_GEOMETRIES)
RESERVED = frozenset(name for v in _EVERY for name in (v.name, *v.dims)) | {
    *_GOAL_NAMES,
    "live",
    "mesh",
    POINT,
    OWN_POINT,
}
"""Names in the file of a run. `tables.is_taken` has all that no swept parameter may take."""
NUMBERED = re.compile(r"(level|geometry)_[0-9]+")
"""Names of groups, which share those of variables and dimensions."""
REQUESTED = re.compile(
    r"probe_\w+_(u_[xyT]|theta|sigma_(xx|yy|xy))|(reaction|force)_\w+_[xy]|work_\w+"
    r"|theta_mean_\w+|section_force_(max|at)|layer_force_\w+|von_mises_(max|x|y)|sensitivity_\w+"
)
"""Names of the variables on request of `output`."""
OVERHEAD = 500
"""Least number of bytes that HDF5 spends on a variable beside its values."""


def bytes_of(study: Study, variables: Iterable[FileVariable], sizes: Mapping[str, int]) -> int:
    """Return the size of variables [byte] without compression.

    sizes: of their dimensions beside those of the sweep
    """
    extent = {SWEEP: math.prod(study.shape), **sizes}
    total = 0
    for variable in variables:
        values = math.prod(extent.get(dim, 1) for dim in variable.dims)
        total += OVERHEAD + variable.itemsize * values
    return total


def expected_bytes(study: Study, levels: Sequence[tuple[int, int]]) -> int:
    """Return the size of the result file [byte] without compression, to check the free disk.

    levels: numbers of contact nodes and of mesh nodes
    """
    tables = _expected_tables(study, levels)
    sizes = (bytes_of(study, variables, dim_sizes) for variables, dim_sizes in tables)
    return _attribute_bytes(study) + sum(sizes)


def shared_bytes(study: Study, levels: Sequence[tuple[int, int]]) -> int:
    """Return the part of the expected size that geometries of one file share: all but values."""
    counts = [len(variables) for variables, _ in _expected_tables(study, levels)]
    return _attribute_bytes(study) + OVERHEAD * sum(counts)


def _attribute_bytes(study: Study) -> int:
    return 60_000 + len(study.text.encode())


def _expected_tables(
    study: Study, levels: Sequence[tuple[int, int]]
) -> Iterator[tuple[Sequence[FileVariable], Mapping[str, int]]]:
    """Yield the variables of each group with the sizes of their dimensions."""
    yield ROOT, {"level": study.mesh.levels, "start": len(START_NAMES)}
    for m, n in levels:
        yield CONTACT, {"node": m}
        if study.opens:  # m counts slips and openings, here as if all were both
            yield OPENING, {"opening_node": m}
        if study.output.fields:
            yield (*MESH, *FIELDS), {"mesh_node": n, "mesh_face": 2 * n, "corner": 3}
        if study.output.live and m <= 250:
            yield LIVE, {"node": m, "node_column": m}


SENSITIVITY = "sensitivity_"
"""Prefix of the names of derivatives."""
SENSITIVITY_STATUS, SENSITIVITY_EVENTS = f"{SENSITIVITY}status", f"{SENSITIVITY}events"
NOT_JUDGED, DIFFERENTIABLE, AT_EVENT, AT_FOLD = range(4)
_VERDICTS = ("not_judged", "differentiable", "at_event", "at_fold")
QUANTITIES = {
    "u_T_max": ("m", "largest |u_T|"),
    "friction_resultant": ("N m-1", "friction resultant"),
    "theta_mean": ("K", "mean temperature"),
    "lambda_1": ("Pa m-1", "tangential stiffness lambda_1"),
    "omega": ("Pa m-1", "maximum softening slope omega of b"),
    "energy": ("J m-1", "energy"),
}
"""Differentiated quantities, their units and names.

`slip_length` is not among them: on one mesh it is a step function of every parameter, whose
derivative 0 would say nothing.
"""
OPENING_QUANTITIES = {
    "opening_max": ("m", "largest opening"),
    "peel_stress_max": ("Pa", "largest peel stress"),
    "adhesion_resultant": ("N m-1", "normal resultant"),
}
"""The same of studies with edges that may lift off, beside the others."""
STEP_QUANTITIES = ("u_T_max", "friction_resultant", "theta_mean")
"""Differentiated quantities of the steps of a history, without those of openings."""


def requested_variables(study: Study) -> tuple[FileVariable, ...]:
    """Return the variables by point that this study asks for."""
    quantities = study.output.quantities
    variables = [*_probe_variables(study), *edge_variables(study)]
    if "von_mises" in quantities:
        comment = "of a triangle; it grows with h at corners"
        variables.append(result("von_mises_max", "Pa", "largest von Mises stress", comment))
        comment = "of the middle of the triangle with the largest stress"
        for axis in "xy":
            long_name = f"{axis} of the largest von Mises stress"
            variables.append(result(f"von_mises_{axis}", "m", long_name, comment))
    if "section_force" in quantities:
        long_name = "largest section force"
        sign = "with its sign, positive in tension"
        variables.append(result("section_force_max", "N m-1", long_name, sign))
        variables.append(result("section_force_at", "m", f"arc length of the {long_name}"))
    differentiated = [*QUANTITIES, *(OPENING_QUANTITIES if study.opens else ())]
    return (*variables, *derivatives(study.output.sensitivity, differentiated))


def line_variables(study: Study) -> tuple[FileVariable, ...]:
    """Return the variables along the contact line that this study asks for."""
    if "section_force" not in study.output.quantities:
        return ()
    position = "of the layer across the line at the node, positive in tension"
    layer = replace(SECTION, comment=f"{position}; in balance with all others, of P1 stresses")
    variables = [SECTION]
    for name, _ in study.scenes[0].material.regions:
        long_name = f"section force of {name}"
        variables.append(replace(layer, name=LAYER + name, long_name=long_name))
    return tuple(variables)


def step_quantities(study: Study) -> tuple[str, ...]:
    """Return the differentiated quantities of the steps of this study's history."""
    return (*STEP_QUANTITIES, *OPENING_QUANTITIES) if study.opens else STEP_QUANTITIES


def step_variables(study: Study) -> tuple[FileVariable, ...]:
    """Return the variables that this study asks for of every step of its history."""
    without_slopes = replace(study, output=replace(study.output, sensitivity=()))
    variables = (*requested_variables(without_slopes), *line_variables(study))
    dims = {POINT_LEVEL: (SWEEP, "step"), SECTION.dims: (SWEEP, "step", "node")}
    slopes = derivatives(study.output.sensitivity, step_quantities(study), (SWEEP, "step"))
    return (*(replace(v, dims=dims[v.dims]) for v in variables), *slopes)


def _probe_variables(study: Study) -> Iterator[FileVariable]:
    for probe in study.output.probes:
        x, y = probe.at
        position = f"at ({x:g}, {y:g})"
        prefix = f"probe_{probe.name}"
        for axis in "xy":
            long_name = f"displacement in {axis} at {probe.name}"
            yield result(f"{prefix}_u_{axis}", "m", long_name, position)
        long_name = f"temperature at {probe.name}"
        comment = f"{position}, above the stress-free state"
        yield result(f"{prefix}_theta", "K", long_name, comment)
        comment = f"{position}, of the triangle that holds the point, which has one stress"
        for component in ("xx", "yy", "xy"):
            long_name = f"stress {component} at {probe.name}"
            yield result(f"{prefix}_sigma_{component}", "Pa", long_name, comment)
        if probe.on_contact:
            long_name = f"tangential displacement at {probe.name}"
            yield result(f"{prefix}_u_T", "m", long_name, f"{position} of the contact line")


def edge_variables(study: Study) -> Iterator[FileVariable]:
    """Yield the variables of reactions, forces and mean temperatures of edges on request."""
    quantities = study.output.quantities
    if not quantities:
        return
    for name, role in study.scenes[0].boundary:
        if "reactions" in quantities and isinstance(role, Clamped | Contact):
            yield from _reaction_variables(name)
        if "forces" in quantities and not isinstance(role, Free):
            yield from _force_variables(name)
        if "theta_edges" in quantities:
            comment = "above the stress-free state, over the edge"
            yield result(f"theta_mean_{name}", "K", f"mean temperature of {name}", comment)


_PER_THICKNESS = "per unit thickness"


def _reaction_variables(edge: str) -> Iterator[FileVariable]:
    corners = "a corner counts to the first clamped edge"
    comment = f"of the support on the body, {_PER_THICKNESS}; {corners}"
    for axis in "xy":
        yield result(f"reaction_{edge}_{axis}", "N m-1", f"reaction of {edge} in {axis}", comment)


def _force_variables(edge: str) -> Iterator[FileVariable]:
    comment = f"on the body, {_PER_THICKNESS}"
    for axis in "xy":
        yield result(f"force_{edge}_{axis}", "N m-1", f"force of {edge} in {axis}", comment)
    comment = f"its force times its displacement, {_PER_THICKNESS}"
    yield result(f"work_{edge}", "J m-1", f"work of {edge}", comment)


def name_of(quantity: str, parameter: str) -> str:
    """Return the name of the variable of a quantity differentiated by a parameter."""
    return f"{SENSITIVITY}{quantity}_{parameter.replace('.', '_')}"


def derivatives(
    parameters: Sequence[Sensitivity],
    quantities: Iterable[str] = QUANTITIES,
    dims: Dims = POINT_LEVEL,
) -> Iterator[FileVariable]:
    """Yield the variables of derivatives by these parameters, of points or of steps of a history.

    Without parameters there is no variable.
    """
    if not parameters:
        return
    verdicts = flags(*_VERDICTS)
    yield FileVariable(
        SENSITIVITY_STATUS, "i1", "1", "verdict on derivatives", dims, extra=verdicts
    )
    comment = "difference of complete histories; missing where one-sided derivatives differ"
    if "step" not in dims:
        comment = "at the solution, while its nodes keep their segments of b"
        events = "nodes about to slip, to stop or to pass a kink, to 1e-9"
        variable = count(SENSITIVITY_EVENTS, "contact nodes at a change of contact state", extra={})
        yield replace(variable, comment=events)
    in_words = QUANTITIES | OPENING_QUANTITIES
    for parameter, quantity in product(parameters, quantities):
        units, words = in_words[quantity]
        name = name_of(quantity, parameter.name)
        units = quotient(units, parameter.units)
        long_name = f"{words} by {parameter.name}"
        qualified = {"ancillary_variables": SENSITIVITY_STATUS}
        yield FileVariable(name, "f8", units, long_name, dims, comment, qualified)


def quotient(units: str, divisor: str) -> str:
    """Return the units of a quotient in CF form: "m" over "Pa m-1" is "m Pa-1 m"."""
    factors = [units] if units != "1" else []
    for word in divisor.split() if divisor != "1" else ():
        symbol = word.rstrip("-0123456789")
        power = -int(word[len(symbol) :] or 1)
        factors.append(symbol if power == 1 else f"{symbol}{power}")
    return " ".join(factors) or "1"


def missing(variable: FileVariable, shape: tuple[int, ...]) -> np.ndarray[Any, Any]:
    """Return an array full of missing values."""
    dtype = object if variable.dtype == "str" else variable.dtype
    return np.full(shape, variable.missing, dtype=dtype)


def free_name(name: str, path: Sequence[str], is_taken: Callable[[str], bool]) -> str:
    """Return a free name: the given one, else the key path, else that with a number."""
    joined = "_".join(path)
    choices = chain((name, joined), (f"{joined}_{number}" for number in counter(2)))
    return next(choice for choice in choices if not is_taken(choice))
