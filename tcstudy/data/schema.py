"""What stands in the file of a run: one table of variables, their dimensions, units and meaning
(CF-1.11).

Root:           results by sweep point and level, and what a level has once
/level_0, …:    the contact line of that mesh and, if asked for, the whole-body fields (UGRID-1.0)
Geometries:     a sweep over geometries has the same groups (layout 2). The contact line of every geometry is padded
                to the longest one of the level; meshes stand end to end as one UGRID mesh of parts that do not touch
Missing values: NaN for floats (as _FillValue); −1 for counts, outside their valid_min and without _FillValue,
                so that no reader turns an integer array into floats; for flags the one that says so

What `output` asks for: `probe_<name>_u_x`, `_u_y`, `_theta`, `_sigma_xx`, `_sigma_yy`, `_sigma_xy`
and on a contact edge `_u_T`; `reaction_<edge>_x`, `_y`; `force_<edge>_x`, `_y`, `work_<edge>`;
`section_force_max`, `section_force_at` and along the contact line `section_force`,
`layer_force_<region>`; `theta_mean_<edge>`; `von_mises_max` with `von_mises_x` and `_y`.
Derivatives are `sensitivity_<quantity>_<number>`: ∂quantity/∂number at the solution of the point
and level, the number's dots written as `_`, as in `sensitivity_friction_resultant_friction_delta`.
They belong to the solution found while its nodes keep their pieces of b: at an event, where
derivatives of two sides differ, they are missing, and `sensitivity_status` says so. Those of steps
of a history are differences of whole histories. (Sobol indices, as `tcstudy show` has them, are
something else.)
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
from tcstudy.scene.study import Study

UNPROVED_BRANCHES, OPEN_LOOP = (
    "the branches are not proved to be all",
    "the hysteresis loop is not whole",
)
"""How those shortfalls of a path begin that leave its own solutions complete."""


class PointStatus(IntEnum):
    """Status of a sweep point in the data (CF status_flag). Anything but OK carries a reason."""

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
"""Stand for the dimensions of the sweep along which the geometry changes, and for those of the
points of one geometry."""
POINT = "point"
"""The one sweep dimension of a study in list mode."""
OWN_POINT = "own_point"
"""In list mode the dimension of the points of one geometry."""
GEOMETRIES = "geometries"
"""Global attribute of a file of several geometries, and its dimension: how many there are."""
LAYOUT, PADDED = "layout", 2
"""Global attribute that tells how a file keeps several geometries. PADDED: in the groups of the
levels; files of version 0.8 have none, and a group for every geometry."""
T, RATE = "t", "J m-1/t"
"""Stand for the units of a path's parameter, and of an energy per unit of it, in a
`FileVariable.units`."""
POINT_LEVEL, LEVEL = (SWEEP, "level"), ("level",)
MISSING_COUNT = -1


@dataclass(frozen=True)
class FileVariable:
    """One netCDF variable.

    units:      SI; a dimensionless study ("none") writes "1" in place of everything but seconds; texts have none
    long_name:  short enough for the axis of a plot;  comment: what more there is to say
    dims:       dimension names; SWEEP stands for those of the sweep
    extra:      further attributes
    coordinate: True if it locates data: no missing values, no _FillValue
    no_value:   the flag that stands where there is no value
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
        """What stands where there is no value."""
        of_type: dict[Dtype, float | int | str] = {
            "f8": float("nan"),
            "i4": MISSING_COUNT,
            "str": "not run",
        }
        return of_type.get(self.dtype, self.no_value)

    @property
    def fill_value(self) -> float | Literal[False]:
        """The _FillValue attribute; False for none."""
        return float("nan") if self.dtype == "f8" and not self.coordinate else False


def flags(*meanings: str, first: int = 0) -> Extra:
    """Attributes of bytes that count `meanings` from `first`."""
    values = np.arange(first, first + len(meanings), dtype=np.int8)
    return {"flag_values": values, "flag_meanings": " ".join(meanings)}


JUDGED: Extra = {"ancillary_variables": "status"}
DIFFERENCE: Extra = {"units_metadata": "temperature: difference"}
STATUS: Extra = {"standard_name": "status_flag", **flags(*(s.name.lower() for s in PointStatus))}
CERTIFIED = ("not_certified", "certified")


def count(
    name: str, long_name: str, dims: Dims = POINT_LEVEL, extra: Extra = JUDGED
) -> FileVariable:
    """A count, −1 where there is none; extra: further attributes."""
    told = f"{MISSING_COUNT} where there is no value"
    return FileVariable(name, "i4", "1", long_name, dims, told, {"valid_min": np.int32(0), **extra})


def flag(
    name: str,
    long_name: str,
    meanings: Sequence[str] = CERTIFIED,
    dims: Dims = POINT_LEVEL,
    comment: str = "",
) -> FileVariable:
    """Bytes that count meanings from 0; `status` judges them."""
    return FileVariable(name, "i1", "1", long_name, dims, comment, {**flags(*meanings), **JUDGED})


def result(
    name: str, units: str, long_name: str, comment: str = "", dims: Dims = POINT_LEVEL
) -> FileVariable:
    """A number that `status` judges."""
    extra = {**JUDGED, **DIFFERENCE} if units == "K" else JUDGED
    return FileVariable(name, "f8", units, long_name, dims, comment, extra)


def _time(what: str, dims: Dims = POINT_LEVEL) -> FileVariable:
    return FileVariable(f"time_{what}", "f8", "s", f"time to {what}", dims, "wall time")


HEAT_BOUND = 1e-10
"""Largest heat balance that passes: heat is asked to be as exact as friction is by default
(solver.tolerance).

The defect is rounding × condition of the heat matrix, about 1e-12 on 1e6 good triangles and 1e-9 to
1e-4 of slivers.
"""
NOT_JUDGED, BALANCED, UNBALANCED = 0, 1, 2
MET, LIMITED = 1, 2
UNKNOWN, STICKS = -1, 1
_INTEGRAL = "integral of -S_T over the contact line, per unit thickness"
_SLIPPING = "length of the contact line that does not stick"
_ROUNDED = (
    "limited_by_rounding: above the tolerance by default, but no larger than inclusion_rounding"
)
_SLIVERS = (
    f"unbalanced where heat_balance exceeds {HEAT_BOUND:g}: thin triangles cost digits of theta"
)

ROOT: tuple[FileVariable, ...] = (
    FileVariable("h_max", "f8", "m", "longest element edge", LEVEL),
    count("n_dof", "displacement unknowns", LEVEL, {}),
    count("n_contact", "contact unknowns m", LEVEL, {}),
    FileVariable("status", "i1", "1", "status of the point", extra=STATUS),
    FileVariable("reason", "str", "", "reason of the status", comment="why the point is not ok"),
    result(
        "energy", "J m-1", "energy", "of the discrete problem at the solution, per unit thickness"
    ),
    result(
        "inclusion_residual",
        "1",
        "inclusion residual",
        "largest distance of -S_T from b, filled, over its scale",
    ),
    result(
        "inclusion_rounding",
        "1",
        "inclusion residual of rounding",
        "what the rounding of doubles allows",
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
        "tangential displacement on the contact line, of nodes that no edge holds along it",
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
        "by rounding; proofs take the body softer by it",
    ),
    result(
        "omega", "Pa m-1", "steepest fall omega of b", "infinite if the friction law jumps down"
    ),
    result(
        "uniqueness_margin",
        "Pa m-1",
        "lambda_1 - omega",
        "with the omega of each node; unique if positive",
    ),
    flag("unique", "only solution"),
    flag("strict_minimum", "strict local energy minimum"),
    flag("global_minimum", "least energy of all states"),
    flag("start_used", "start of the stored solution", START_NAMES),
    FileVariable("start_energy", "f8", "J m-1", "energy by start", (*POINT_LEVEL, "start")),
    result("theta_mean", "K", "mean temperature", "of the body above its stress-free state"),
    result(
        "heat_balance",
        "1",
        "defect of heat balance",
        "heat through edges against heat put in, relative",
    ),
    flag(
        "heat_status",
        "verdict on heat balance",
        ("not_judged", "balanced", "unbalanced"),
        comment=_SLIVERS,
    ),
    *(_time(what, LEVEL) for what in ("mesh", "assemble")),
    *(_time(what) for what in ("condense", "solve")),
)

_OF_REGIONS = {
    "elastic": "where b rises from 0 along its first piece",
    "yielded": "beyond sticking or the first piece of b, where b does not fall",
    "softening": "where b falls",
    "debonded": "beyond the last fall of b",
}
REGIONS: tuple[FileVariable, ...] = (
    result(
        "breathing_length",
        "m",
        "breathing length",
        "where u_T is not 0; missing for laws that stick nowhere",
    ),
    *(result(f"{name}_length", "m", f"{name} length", what) for name, what in _OF_REGIONS.items()),
)
"""What is kept where the laws have such a region: lengths of the contact line, u_T being linear
between its nodes."""


def region_variables(study: Study) -> tuple[FileVariable, ...]:
    """Those of REGIONS that some law of the study has."""
    own = law_regions(study.scenes)
    return tuple(v for v in REGIONS if v.name.removesuffix("_length") in own)


NOT_ALL, ALL_PROVED, OF_POLYGON = 0, 1, 2
_LISTED = "a list that is not proved complete counts those found; of the polygon: within 1e-3 of b"
EVERY: tuple[FileVariable, ...] = (
    count("solutions", "number of equilibria"),
    count("stable_solutions", "equilibria that are strict local minima"),
    flag(
        "complete",
        "whether these are all",
        ("not_proved", "proved", "proved_of_the_polygon"),
        comment=_LISTED,
    ),
)
"""What is kept of a point where all its solutions are sought."""

_SOLUTION, _SIDES = ("solution",), "counted from the left, jumps included"
SOLUTION: tuple[FileVariable, ...] = (
    FileVariable(
        "solution_point", "i4", "1", "place of its point in the sweep, in C order", _SOLUTION
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
        "solution_piece", "i4", "1", "side of the law's graph", (*_SOLUTION, "node"), _SIDES
    ),
)
"""All solutions of all points of a level, those of a point one after the other, lowest energy
first."""

_BY_SOLVER, _FIRST = (
    (*POINT_LEVEL, "solver"),
    "max |u_T - u_T of the first solver| over max |u_T| of the first",
)
SOLVERS: tuple[FileVariable, ...] = (
    FileVariable("solver_residual", "f8", "1", "inclusion residual by solver", _BY_SOLVER),
    FileVariable("solver_energy", "f8", "J m-1", "energy by solver", _BY_SOLVER),
    count("solver_iterations", "steps by solver", _BY_SOLVER, {}),
    FileVariable("solver_time", "f8", "s", "wall time by solver", _BY_SOLVER),
    FileVariable(
        "solver_difference", "f8", "1", "difference to the first solver", _BY_SOLVER, _FIRST
    ),
)
"""What is kept of every solver where a study names several; the first one's solution is the stored
one."""

ESTIMATES: tuple[FileVariable, ...] = (
    result(
        "error_estimate",
        "1",
        "estimated error",
        "of the displacement in the energy norm, over its own norm",
    ),
    FileVariable("stop", "str", "", "why refinement ended", LEVEL),
)
"""What is kept where errors are estimated."""

_BODY, _PROVED = "of the body itself, not of the mesh", ("not_proved", "proved")
_UNIQUE = "omega < lambda_1_low: the problem itself, not its discretisation, has one solution"
_BOUND = "over the norm of the body's solution, no less; missing where that may be 0"
GUARANTEED: tuple[FileVariable, ...] = (
    result("lambda_1_low", "Pa m-1", "lower bound of lambda_1 of the body", _BODY),
    result("lambda_1_high", "Pa m-1", "upper bound of lambda_1 of the body", _BODY),
    result(
        "lambda_1_dual",
        "Pa m-1",
        "lambda_1 of equilibrium elements",
        "nearer to the body than that of the mesh",
    ),
    flag("proved_unique", "only solution of the body", _PROVED, comment=_UNIQUE),
    result(
        "error_bound",
        "J0.5 m-0.5",
        "bound of the error",
        "of the body's solution, not of a finer mesh's; proved",
    ),
    result("error_bound_relative", "1", "relative bound of the error", _BOUND),
)
"""What is kept where a guarantee is asked for."""

_GOALS = {
    "friction_resultant": ("N m-1", _INTEGRAL),
    "slip_length": ("m", _SLIPPING),
    "u_T": ("m", "tangential displacement at the point of the study"),
}
_GOAL_NAMES = ("goal", "goal_estimate", "goal_error", "goal_effectivity")


def goal_variables(goal: Goal, exact: bool) -> tuple[FileVariable, ...]:
    """What is kept of a goal; the energy norm has none, its error is `error_estimate`."""
    if goal.quantity == "energy":
        return ()
    units, what = _GOALS[goal.quantity]
    known = (
        "against the exact solution"
        if goal.known is None
        else f"against {goal.known!r}, which is known"
    )
    own = (
        result("goal", units, "goal of the study", what),
        result("goal_estimate", units, "estimated error of the goal", "absolute"),
        result("goal_error", units, "error of the goal", f"absolute, {known}"),
        result(
            "goal_effectivity", "1", "effectivity of the estimate", "goal_estimate over goal_error"
        ),
    )
    return own[:2] if goal.known is None and not exact else own


LEVEL_COORDINATE = FileVariable("level", "i4", "1", "mesh level", LEVEL, coordinate=True)

_NODE, _END, _MESH_NODE = ("node",), ("held_end",), ("mesh_node",)
_AT_NODE, _ON_LINE = {"coordinates": "arclength x y"}, (SWEEP, "node")
_RESULT_AT_NODE = {**JUDGED, **_AT_NODE}


def place(name: str, long_name: str, dims: Dims) -> FileVariable:
    """A coordinate in metres."""
    return FileVariable(name, "f8", "m", long_name, dims, coordinate=True)


_SENSE = "positive with the body on the left, counter-clockwise on an outline, to larger arclength"

CONTACT: tuple[FileVariable, ...] = (
    place("arclength", "arc length on contact line", _NODE),
    *(place(name, f"{name} of the contact node", _NODE) for name in "xy"),
    FileVariable("c", "f8", "m", "contact length of the node", _NODE, extra=_AT_NODE),
    FileVariable("edge", "i1", "1", "contact edge", _NODE, extra=_AT_NODE),
    FileVariable(
        "u_T", "f8", "m", "tangential displacement", _ON_LINE, _SENSE, extra=_RESULT_AT_NODE
    ),
    FileVariable("xi", "f8", "Pa", "tangential traction -S_T", _ON_LINE, extra=_RESULT_AT_NODE),
    FileVariable(
        *("sticks", "i1", "1", "rests on an up-jump of b", _ON_LINE),
        extra={**flags("unknown", "slips", "sticks", first=UNKNOWN), **_RESULT_AT_NODE},
        no_value=UNKNOWN,
    ),
)

_WHOLE = "of the whole body across the line at the node, positive in tension"
SECTION = FileVariable(
    "section_force", "f8", "N m-1", "force of the section", _ON_LINE, _WHOLE, _RESULT_AT_NODE
)
LAYER = "layer_force_"
"""How the names of the forces of layers begin, which are as SECTION."""

_AT_END = {"coordinates": "held_arclength held_x held_y"}
HELD: tuple[FileVariable, ...] = (
    place("held_arclength", "arc length of the held end", _END),
    *(place(f"held_{name}", f"{name} of the held end", _END) for name in "xy"),
    FileVariable(
        "held_u_T",
        "f8",
        "m",
        "tangential displacement of the held end",
        (SWEEP, *_END),
        extra=_AT_END,
    ),
)
"""Ends of the contact line that carry no unknown, as a clamped edge prescribes their u_T; a level
without has none."""

JOINTS: tuple[FileVariable, ...] = (
    FileVariable("joint_node", "i4", "1", "contact node where two contact edges meet", ("joint",)),
    FileVariable("joint_edge", "i1", "1", "the edge before the node", ("joint",)),
    FileVariable(
        "joint_share", "f8", "1", "part of its contact length on the edge before", ("joint",)
    ),
)
"""Nodes with the friction of two edges (`tcstudy.laws.composed`); a level of one contact edge has
none."""

MESH_TOPOLOGY: dict[str, Any] = {
    "cf_role": "mesh_topology",
    "long_name": "triangulation of the body",
    "topology_dimension": np.int32(2),
    "node_coordinates": "node_x node_y",
    "face_node_connectivity": "triangle",
}
"""Attributes of the scalar variable `mesh` that ties a level's mesh together (UGRID-1.0)."""
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
"""The boundary of a body from a CAD file, whose shape the study does not have: straight segments
with the body on their left, and the edge that each belongs to."""
_FACE = {"mesh": "mesh", "location": "face"}
REGION = FileVariable(
    "region", "i1", "1", "region with a material of its own", ("mesh_face",), extra=_FACE
)
"""Where materials differ by region: 0 is the material of the body, i the i-th region of the study's
`materials`."""
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

_GIVE = "1 where lambda/mu is that of the first point, so that these arrays give the problem"
LIVE: tuple[FileVariable, ...] = (
    FileVariable(
        "A_tilde", "f8", "Pa", "condensed stiffness of the first point", ("node", "node_column")
    ),
    FileVariable("stiffness", "f8", "1", "mu over that of the first point", (SWEEP,)),
    FileVariable("load", "f8", "N m-1", "condensed load", _ON_LINE),
    FileVariable("mechanical_load", "f8", "N m-1", "its part from f, g and pressure", _ON_LINE),
    FileVariable("valid", "f8", "1", _GIVE, (SWEEP,)),
)
"""The group `live` of a level, what a browser needs to solve its contact problems (output.live;
`live_arrays` in tcstudy.offline.level). A record hands them over as fields, LIVE_PREFIX before
their names."""
LIVE_PREFIX = "live_"

NUMBER = FileVariable(
    *("geometry", "i4", "1", "number of the geometry", (SWEEP,)),
    comment="-1 where the geometry was refused or has no mesh",
)
OVERRIDES = FileVariable(
    *("overrides", "str", "", "options that make the study of the geometry", (GEOMETRIES,)),
    comment="with study_yaml, one option a line; empty where the geometry was refused",
)
_UNDER_MESH = "of one mesh after the other, geometries without a mesh have none"
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
"""What the level of a file of several geometries has beside MESH, so that one mesh is found."""
NO_EDGE, NONE = -1, "none"
"""Flag, and its meaning, behind the end of a contact line that is shorter than others."""
_ENDS = ("node", "held_end", "joint", "rim_segment")
"""Dimensions whose lengths differ from geometry to geometry, and which are padded."""


def among_geometries(variable: FileVariable) -> FileVariable:
    """Return the variable of a level as a file of several geometries has it.

    What a contact line has once lies along OUTER, too, and may end in missing values; fields lie
    along INNER, since every geometry has its own part of the mesh nodes.
    """
    dims = variable.dims
    if dims == _IN_BODY:
        return replace(variable, dims=(INNER, *_MESH_NODE))
    if dims and dims[0] in _ENDS:
        variable = replace(variable, dims=(OUTER, *dims), coordinate=False)
    return replace(variable, no_value=NO_EDGE) if variable.dtype == "i1" else variable


ONCE = frozenset(v.name for v in (*CONTACT, *HELD, *JOINTS, *RIM, *LIVE) if SWEEP not in v.dims)
"""Names of what the contact line of a geometry has once, whatever the point."""

_POINTS = (*ROOT, *REGIONS, *EVERY, *SOLVERS, *ESTIMATES, *GUARANTEED)
_ALL = (*_POINTS, *SOLUTION, *CONTACT, SECTION, *HELD, *JOINTS, *MESH, *RIM, REGION, *FIELDS)
_OF_GEOMETRIES = (NUMBER, OVERRIDES, *MESH_COUNTS, MESH_GEOMETRY)
_EVERY = (*_ALL, *LIVE, *_OF_GEOMETRIES)
RESERVED = frozenset(name for v in _EVERY for name in (v.name, *v.dims)) | {
    *_GOAL_NAMES,
    "live",
    "mesh",
    POINT,
    OWN_POINT,
}
"""Names that the file of a run has; all that no swept parameter may take: `tables.is_taken`."""
NUMBERED = re.compile(r"(level|geometry)_[0-9]+")
"""Names of groups, which share those of variables and dimensions."""
REQUESTED = re.compile(
    r"probe_\w+_(u_[xyT]|theta|sigma_(xx|yy|xy))|(reaction|force)_\w+_[xy]|work_\w+"
    r"|theta_mean_\w+|section_force_(max|at)|layer_force_\w+|von_mises_(max|x|y)|sensitivity_\w+"
)
"""Names of what `output` asks for."""
BESIDE = 500
"""Bytes that HDF5 spends on a variable beside its values, at least."""


def bytes_of(study: Study, variables: Iterable[FileVariable], sizes: Mapping[str, int]) -> int:
    """Size of variables [byte] without compression. sizes: of their dimensions beside those of the
    sweep"""
    extent = {SWEEP: math.prod(study.shape), **sizes}
    widths = ((v, 8 if v.dtype == "str" else np.dtype(v.dtype).itemsize) for v in variables)
    return sum(
        BESIDE + width * math.prod(extent.get(dim, 1) for dim in v.dims) for v, width in widths
    )


def expected_bytes(study: Study, levels: Sequence[tuple[int, int]]) -> int:
    """Size of the result file [byte] without compression, for a look at the disk before the work.

    levels: contact nodes and mesh nodes of each
    """
    tables = _expected_tables(study, levels)
    return _texts(study) + sum(bytes_of(study, variables, sizes) for variables, sizes in tables)


def shared_bytes(study: Study, levels: Sequence[tuple[int, int]]) -> int:
    """Return how much of the expected size several geometries of one file share: all but values."""
    counts = [len(variables) for variables, _ in _expected_tables(study, levels)]
    return _texts(study) + BESIDE * sum(counts)


def _texts(study: Study) -> int:
    """Return the bytes of attributes."""
    return 60_000 + len(study.text.encode())


def _expected_tables(
    study: Study, levels: Sequence[tuple[int, int]]
) -> Iterator[tuple[Sequence[FileVariable], Mapping[str, int]]]:
    """Yield the variables of each group with the sizes of their dimensions."""
    yield ROOT, {"level": study.mesh.levels, "start": len(START_NAMES)}
    for m, n in levels:
        yield CONTACT, {"node": m}
        if study.output.fields:
            yield (*MESH, *FIELDS), {"mesh_node": n, "mesh_face": 2 * n, "corner": 3}
        if study.output.live and m <= 250:
            yield LIVE, {"node": m, "node_column": m}


SENSITIVITY = "sensitivity_"
"""How the names of derivatives begin."""
SENSITIVITY_STATUS, SENSITIVITY_EVENTS = f"{SENSITIVITY}status", f"{SENSITIVITY}events"
NOT_JUDGED, DIFFERENTIABLE, AT_EVENT, AT_FOLD = range(4)
_VERDICTS = ("not_judged", "differentiable", "at_event", "at_fold")
QUANTITIES = {
    "u_T_max": ("m", "largest |u_T|"),
    "friction_resultant": ("N m-1", "friction resultant"),
    "theta_mean": ("K", "mean temperature"),
    "lambda_1": ("Pa m-1", "tangential stiffness lambda_1"),
    "omega": ("Pa m-1", "steepest fall omega of b"),
    "energy": ("J m-1", "energy"),
}
"""Differentiated quantities, their units and names. `slip_length` is not among them: on one mesh it
is a step function of every number, and its derivative 0 would say nothing."""
STEP_QUANTITIES = ("u_T_max", "friction_resultant", "theta_mean")
"""Those of the steps of a history."""


def requested_variables(study: Study) -> tuple[FileVariable, ...]:
    """The variables that this study asks for."""
    wanted = study.output.quantities
    found = [*_probes(study), *_of_edges(study)]
    if "von_mises" in wanted:
        found.append(
            result(
                "von_mises_max",
                "Pa",
                "largest von Mises stress",
                "of a triangle; it grows with h at corners",
            )
        )
        where = "of the middle of the triangle with the largest stress"
        found += [
            result(f"von_mises_{x}", "m", f"{x} of the largest von Mises stress", where)
            for x in "xy"
        ]
    if "section_force" in wanted:
        sign = "with its sign, positive in tension"
        found.append(result("section_force_max", "N m-1", "largest force of a section", sign))
        found.append(
            result("section_force_at", "m", "arc length of the largest force of a section")
        )
    return (*found, *derivatives(study.output.sensitivity))


def line_variables(study: Study) -> tuple[FileVariable, ...]:
    """Those along the contact line."""
    if "section_force" not in study.output.quantities:
        return ()
    told = "of the layer across the line at the node, positive in tension; in balance with all others, of P1 stresses"
    layer = replace(SECTION, comment=told)
    names = [name for name, _ in study.scenes[0].material.regions]
    own = (
        replace(layer, name=LAYER + name, long_name=f"force of the section of {name}")
        for name in names
    )
    return (SECTION, *own)


def step_variables(study: Study) -> tuple[FileVariable, ...]:
    """What a history has on request of every step."""
    given = replace(study, output=replace(study.output, sensitivity=()))
    dims = {POINT_LEVEL: (SWEEP, "step"), SECTION.dims: (SWEEP, "step", "node")}
    own = (
        replace(v, dims=dims[v.dims]) for v in (*requested_variables(given), *line_variables(study))
    )
    return (*own, *derivatives(study.output.sensitivity, STEP_QUANTITIES, (SWEEP, "step")))


def _probes(study: Study) -> Iterator[FileVariable]:
    for probe in study.output.probes:
        x, y = probe.at
        at, start = f"at ({x:g}, {y:g})", f"probe_{probe.name}"
        for axis in "xy":
            yield result(f"{start}_u_{axis}", "m", f"displacement in {axis} at {probe.name}", at)
        yield result(
            f"{start}_theta",
            "K",
            f"temperature at {probe.name}",
            f"{at}, above the stress-free state",
        )
        in_triangle = f"{at}, of the triangle that holds the point, which has one stress"
        for c in ("xx", "yy", "xy"):
            yield result(f"{start}_sigma_{c}", "Pa", f"stress {c} at {probe.name}", in_triangle)
        if probe.on_contact:
            yield result(
                f"{start}_u_T",
                "m",
                f"tangential displacement at {probe.name}",
                f"{at} of the contact line",
            )


def _of_edges(study: Study) -> Iterator[FileVariable]:
    wanted, per = study.output.quantities, "per unit thickness"
    if not wanted:
        return
    corner = f"of the support on the body, {per}; a corner counts to the first clamped edge"
    for name, role in study.scenes[0].boundary:
        if "reactions" in wanted and isinstance(role, Clamped | Contact):
            for axis in "xy":
                yield result(
                    f"reaction_{name}_{axis}", "N m-1", f"reaction of {name} in {axis}", corner
                )
        if "forces" in wanted and not isinstance(role, Free):
            for axis in "xy":
                yield result(
                    f"force_{name}_{axis}",
                    "N m-1",
                    f"force of {name} in {axis}",
                    f"on the body, {per}",
                )
            yield result(
                f"work_{name}",
                "J m-1",
                f"work of {name}",
                f"its force times its displacement, {per}",
            )
        if "theta_edges" in wanted:
            told = "above the stress-free state, over the edge"
            yield result(f"theta_mean_{name}", "K", f"mean temperature of {name}", told)


def name_of(quantity: str, number: str) -> str:
    """The variable of a quantity differentiated by a number of the study."""
    return f"{SENSITIVITY}{quantity}_{number.replace('.', '_')}"


def derivatives(
    numbers: Sequence[Sensitivity], of: Iterable[str] = QUANTITIES, dims: Dims = POINT_LEVEL
) -> Iterator[FileVariable]:
    """The variables of derivatives by these numbers, of points, or of the steps of a history; none
    of none."""
    if not numbers:
        return
    steps = "step" in dims
    yield FileVariable(
        SENSITIVITY_STATUS, "i1", "1", "verdict on derivatives", dims, extra=flags(*_VERDICTS)
    )
    if not steps:
        events = "where a node begins to slide, comes to rest or passes a kink, to 1e-9"
        yield replace(
            count(SENSITIVITY_EVENTS, "contact nodes at an event", extra={}), comment=events
        )
    told = "at the solution, while its nodes keep their pieces of b"
    told = "difference of whole histories; missing where both sides differ" if steps else told
    for number, quantity in product(numbers, of):
        units, what = QUANTITIES[quantity]
        name, over = name_of(quantity, number.name), quotient(units, number.units)
        judged = {"ancillary_variables": SENSITIVITY_STATUS}
        yield FileVariable(name, "f8", over, f"{what} by {number.name}", dims, told, judged)


def quotient(units: str, by: str) -> str:
    """Units of a derivative in CF form: "m" by "Pa m-1" is "m Pa-1 m"."""
    parts = [units] if units != "1" else []
    for word in by.split() if by != "1" else ():
        letters = word.rstrip("-0123456789")
        power = -int(word[len(letters) :] or 1)
        parts.append(letters if power == 1 else f"{letters}{power}")
    return " ".join(parts) or "1"


def missing(variable: FileVariable, shape: tuple[int, ...]) -> np.ndarray[Any, Any]:
    """An array full of missing values."""
    return np.full(
        shape, variable.missing, dtype=object if variable.dtype == "str" else variable.dtype
    )


def free_name(name: str, path: Sequence[str], is_taken: Callable[[str], bool]) -> str:
    """Return a name that is not taken: the given one, else the key path, else that with a number."""
    joined = "_".join(path)
    choices = chain((name, joined), (f"{joined}_{number}" for number in counter(2)))
    return next(choice for choice in choices if not is_taken(choice))
