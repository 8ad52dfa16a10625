"""What stands in a result file: one table of variables, their dimensions, units and meaning (CF-1.11).

Root:           results by sweep point and level, and what a level has once
/level_0, …:    the contact line of that mesh and, if asked for, the whole-body fields (UGRID-1.0)
Missing values: NaN for floats (as _FillValue); −1 for counts, outside their valid_min and without _FillValue,
                so that no reader turns an integer array into floats; for flags the one that says so
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

from tcstudy.data.records import LevelRecord, PointStatus
from tcstudy.scene.methods import START_NAMES
from tcstudy.scene.study import Axis, Goal, Study

Dtype = Literal["f8", "i4", "i1", "str"]

SWEEP = "*"
"""Stands for the dimensions of the sweep in a `Variable.dims`."""

POINT = "point"
"""The one sweep dimension of a study in list mode."""

POINT_LEVEL = (SWEEP, "level")
MISSING_COUNT = -1
NOT_RUN = "not run"


@dataclass(frozen=True)
class Variable:
    """One netCDF variable.

    units:      SI; a dimensionless study ("none") writes "1" in place of everything but seconds
    dims:       dimension names; SWEEP stands for those of the sweep
    coordinate: True if it locates data: no missing values, no _FillValue
    extra:      further attributes
    no_value:   the flag that stands where there is no value
    """

    name: str
    dtype: Dtype
    units: str
    long_name: str
    dims: tuple[str, ...] = POINT_LEVEL
    coordinate: bool = False
    extra: tuple[tuple[str, Any], ...] = ()
    no_value: int = 0

    @property
    def missing(self) -> float | int | str:
        """What stands where there is no value."""
        of_type: dict[Dtype, float | int | str] = {"f8": float("nan"), "i4": MISSING_COUNT, "str": NOT_RUN}
        return of_type.get(self.dtype, self.no_value)

    @property
    def fill_value(self) -> float | Literal[False]:
        """The _FillValue attribute; False for none."""
        return float("nan") if self.dtype == "f8" and not self.coordinate else False


_STATUS = (
    ("standard_name", "status_flag"),
    ("flag_values", np.array([int(s) for s in PointStatus], dtype=np.int8)),
    ("flag_meanings", " ".join(s.name.lower() for s in PointStatus)),
)
_COUNT = (("valid_min", np.int32(0)), ("comment", f"{MISSING_COUNT} where there is no value"))
_JUDGED = (("ancillary_variables", "status"),)
_DIFFERENCE = (("units_metadata", "temperature: difference"),)
_LEVEL = ("level",)
_CERTIFIED = (("flag_values", np.array([0, 1], dtype=np.int8)), ("flag_meanings", "not_certified certified"), *_JUDGED)
_STARTS = (
    ("flag_values", np.arange(len(START_NAMES), dtype=np.int8)),
    ("flag_meanings", " ".join(START_NAMES)),
    *_JUDGED,
)
HEAT_BOUND = 1e-10
"""Largest heat balance that passes: heat is asked to be as exact as friction is by default (solver.tolerance).

The defect is rounding × condition of the heat matrix, about 1e-12 on 1e6 good triangles and 1e-9 to 1e-4 of slivers.
"""
NOT_JUDGED, BALANCED, UNBALANCED = 0, 1, 2
_BALANCE = (
    ("flag_values", np.arange(3, dtype=np.int8)),
    ("flag_meanings", "not_judged balanced unbalanced"),
    ("comment", f"unbalanced where heat_balance exceeds {HEAT_BOUND:g}: thin triangles cost digits of theta"),
    *_JUDGED,
)
MET, LIMITED = 1, 2
_INCLUSION = (
    ("flag_values", np.arange(3, dtype=np.int8)),
    ("flag_meanings", "not_judged met limited_by_rounding"),
    ("comment", "limited_by_rounding: above the tolerance by default, but no larger than inclusion_rounding"),
    *_JUDGED,
)
UNKNOWN, SLIPS, STICKS = -1, 0, 1
_STICKS = (
    ("flag_values", np.array([UNKNOWN, SLIPS, STICKS], dtype=np.int8)),
    ("flag_meanings", "unknown slips sticks"),
    *_JUDGED,
)


def _count(name: str, long_name: str, dims: tuple[str, ...] = POINT_LEVEL, extra: Any = ()) -> Variable:
    return Variable(name, "i4", "1", long_name, dims, extra=_COUNT + extra)


def _result(name: str, units: str, long_name: str, extra: Any = ()) -> Variable:
    return Variable(name, "f8", units, long_name, extra=_JUDGED + extra)


ROOT: tuple[Variable, ...] = (
    Variable("h_max", "f8", "m", "longest element edge", _LEVEL),
    _count("n_dof", "number of displacement unknowns", _LEVEL),
    _count("n_contact", "number of contact unknowns m", _LEVEL),
    Variable("status", "i1", "1", "status of the sweep point", extra=_STATUS),
    Variable("reason", "str", "1", "why the point is not ok, in words; empty if it is"),
    _result("energy", "J m-1", "energy of the discrete problem at the solution, per unit thickness"),
    _result("inclusion_residual", "1", "largest distance of -S_T from the filled friction law, over its scale"),
    _result("inclusion_rounding", "1", "inclusion residual that rounding of displacements and data to doubles allows"),
    Variable("inclusion_status", "i1", "1", "judgement of the inclusion residual", extra=_INCLUSION),
    _count("iterations", "steps of the solver", extra=_JUDGED),
    _count("evaluations", "evaluations of the energy", extra=_JUDGED),
    _result("u_T_max", "m", "largest absolute tangential displacement on the contact line"),
    _result("friction_resultant", "N m-1", "integral of -S_T over the contact line, per unit thickness"),
    _result("slip_length", "m", "length of the contact line that does not stick"),
    _result("lambda_1", "Pa m-1", "smallest tangential stiffness of the body per contact length"),
    _result("omega", "Pa m-1", "steepest fall of the friction law; infinite if it jumps down"),
    _result("uniqueness_margin", "Pa m-1", "lambda_1 - omega; the solution is unique if positive"),
    Variable("unique", "i1", "1", "certified to be the only solution", extra=_CERTIFIED),
    Variable("strict_minimum", "i1", "1", "certified to be a strict local minimum of the energy", extra=_CERTIFIED),
    Variable("global_minimum", "i1", "1", "certified to have the least energy of all states", extra=_CERTIFIED),
    Variable("start_used", "i1", "1", "start that led to the stored solution", extra=_STARTS),
    Variable("start_energy", "f8", "J m-1", "energy of the solution that each start leads to", (*POINT_LEVEL, "start")),
    _result("theta_mean", "K", "mean temperature of the body above its stress-free state", _DIFFERENCE),
    _result("heat_balance", "1", "defect of heat convected away against heat put in, over all heat that moves"),
    Variable("heat_status", "i1", "1", "judgement of the heat balance", extra=_BALANCE),
    Variable("time_mesh", "f8", "s", "wall time of the mesh", _LEVEL),
    Variable("time_assemble", "f8", "s", "wall time of assembling the matrices", _LEVEL),
    Variable("time_condense", "f8", "s", "wall time of condensing to the contact line"),
    Variable("time_solve", "f8", "s", "wall time of solving the contact problem"),
)

_BY_SOLVER = (*POINT_LEVEL, "solver")
SOLVERS: tuple[Variable, ...] = (
    Variable("solver_residual", "f8", "1", "inclusion residual by solver", _BY_SOLVER),
    Variable("solver_energy", "f8", "J m-1", "energy by solver", _BY_SOLVER),
    Variable("solver_iterations", "i4", "1", "steps by solver", _BY_SOLVER, extra=_COUNT),
    Variable("solver_time", "f8", "s", "wall time by solver", _BY_SOLVER),
    Variable(
        "solver_difference", "f8", "1", "max |u_T - u_T of the first solver| over max |u_T| of the first", _BY_SOLVER
    ),
)
"""What is kept of every solver where a study names several; the first one's solution is the stored one."""

ESTIMATES: tuple[Variable, ...] = (
    _result("error_estimate", "1", "estimated error of the displacement in the energy norm, relative to its own norm"),
    Variable("stop", "str", "1", "why refinement ended on the level, in words; empty if it went on", _LEVEL),
)
"""What is kept where errors are estimated."""

_GOALS = {
    "friction_resultant": ("N m-1", "integral of -S_T over the contact line, per unit thickness"),
    "slip_length": ("m", "length of the contact line that does not stick"),
    "u_T": ("m", "tangential displacement at the point of the study"),
}


def _goal_variables(goal: Goal, exact: bool) -> tuple[Variable, ...]:
    """What is kept of a goal; the energy norm has none, its error is `error_estimate`."""
    if goal.quantity == "energy":
        return ()
    units, what = _GOALS[goal.quantity]
    estimate = _result("goal_estimate", units, "estimated absolute error of goal")
    kept = (_result("goal", units, f"goal: {what}"), estimate)
    if goal.known is None and not exact:
        return kept
    known = " against the exact solution" if goal.known is None else f"; it is known to be {goal.known!r}"
    error = _result("goal_error", units, f"absolute error of goal{known}")
    return (*kept, error, _result("goal_effectivity", "1", "goal_estimate over goal_error"))


_GOAL_NAMES = ("goal", "goal_estimate", "goal_error", "goal_effectivity")

LEVEL_COORDINATE = Variable("level", "i4", "1", "mesh level, from coarse to fine", _LEVEL, coordinate=True)

_NODE = ("node",)
_AT_NODE = (("coordinates", "arclength x y"),)

CONTACT: tuple[Variable, ...] = (
    Variable("arclength", "f8", "m", "arc length along the contact line", _NODE, coordinate=True),
    Variable("x", "f8", "m", "x of the contact node", _NODE, coordinate=True),
    Variable("y", "f8", "m", "y of the contact node", _NODE, coordinate=True),
    Variable("c", "f8", "m", "length of the contact segment around the node", _NODE, extra=_AT_NODE),
    Variable("edge", "i1", "1", "contact edge that the node lies on", _NODE, extra=_AT_NODE),
    Variable("u_T", "f8", "m", "tangential displacement", (SWEEP, "node"), extra=_JUDGED + _AT_NODE),
    Variable("xi", "f8", "Pa", "tangential traction -S_T", (SWEEP, "node"), extra=_JUDGED + _AT_NODE),
    Variable(
        "sticks",
        "i1",
        "1",
        "whether the node rests on an up-jump of the friction law",
        (SWEEP, "node"),
        extra=_STICKS + _AT_NODE,
        no_value=UNKNOWN,
    ),
)

_MESH_NODE = ("mesh_node",)
_AT_MESH = (("coordinates", "node_x node_y"), ("mesh", "mesh"), ("location", "node"), *_JUDGED)
_CONNECTIVITY = (("cf_role", "face_node_connectivity"), ("start_index", np.int32(0)))
MESH_TOPOLOGY: dict[str, Any] = {
    "cf_role": "mesh_topology",
    "long_name": "triangulation of the body",
    "units": "1",
    "topology_dimension": np.int32(2),
    "node_coordinates": "node_x node_y",
    "face_node_connectivity": "triangle",
}
"""Attributes of the scalar variable `mesh` that ties a level's mesh together (UGRID-1.0)."""

MESH: tuple[Variable, ...] = (
    Variable("node_x", "f8", "m", "x of the mesh node", _MESH_NODE, coordinate=True),
    Variable("node_y", "f8", "m", "y of the mesh node", _MESH_NODE, coordinate=True),
    Variable("triangle", "i4", "1", "nodes of the triangle", ("mesh_face", "corner"), extra=_CONNECTIVITY),
)
FIELDS: tuple[Variable, ...] = (
    Variable(
        "theta",
        "f8",
        "K",
        "temperature above the stress-free state",
        (SWEEP, "mesh_node"),
        extra=_AT_MESH + _DIFFERENCE,
    ),
    Variable("u_x", "f8", "m", "displacement in x", (SWEEP, "mesh_node"), extra=_AT_MESH),
    Variable("u_y", "f8", "m", "displacement in y", (SWEEP, "mesh_node"), extra=_AT_MESH),
)

_POINTWISE = frozenset(v.name for v in (*ROOT, *SOLVERS, *ESTIMATES) if v.dims[:2] == POINT_LEVEL)
NUMBERS = (_POINTWISE | {*_GOAL_NAMES}) - {"status", "reason"}
"""Names that `PointRecord.numbers` may hold."""


def root_variables(study: Study) -> tuple[Variable, ...]:
    """The variables of the root group of this study's file."""
    solvers = SOLVERS if len(study.solver.names) > 1 else ()
    estimates = ESTIMATES + _goal_variables(study.mesh.goal, study.exact is not None) if study.mesh.estimates else ()
    return (*ROOT, *solvers, *estimates)


FIELD_NAMES = frozenset(v.name for v in FIELDS)
"""Names that `PointRecord.fields` may hold."""

RESERVED = frozenset(v.name for v in (*ROOT, *SOLVERS, *ESTIMATES, *CONTACT, *MESH, *FIELDS)) | {
    *_GOAL_NAMES,
    *("level", "start", "solver", "node", "mesh_node", "mesh_face", "corner", "mesh", POINT),
}
"""Names of the file that no swept parameter may take; see `axis_name`."""


def sweep_dims(study: Study) -> tuple[str, ...]:
    """Names of the sweep dimensions, in the order of `study.shape`."""
    if not study.axes:
        return ()
    return tuple(axis_name(axis) for axis in study.axes) if study.mode == "grid" else (POINT,)


def expand(dims: tuple[str, ...], study: Study) -> tuple[str, ...]:
    """Dimension names with SWEEP replaced by those of the study."""
    return tuple(name for d in dims for name in (sweep_dims(study) if d == SWEEP else (d,)))


def attributes(variable: Variable, study: Study) -> dict[str, Any]:
    """Attributes of a variable in the file of this study (without _FillValue)."""
    dimensionless = study.units == "none" and variable.units != "s"
    extra = dict(variable.extra)
    if dimensionless:
        extra.pop("units_metadata", None)
    if study.mode == "list" and SWEEP in variable.dims:
        names = (extra.get("coordinates", ""), *(axis_name(axis) for axis in study.axes))
        extra["coordinates"] = " ".join(names).strip()
    return {"long_name": variable.long_name, "units": "1" if dimensionless else variable.units, **extra}


def axis_name(axis: Axis) -> str:
    """Name of a swept parameter in the file: its own, or its path where a result has that name ("heat_omega")."""
    return "_".join(axis.path) if axis.name in RESERVED else axis.name


def axis_attributes(axis: Axis) -> dict[str, Any]:
    """Attributes of the coordinate variable of a swept parameter."""
    attrs = {"long_name": f"swept parameter {'.'.join(axis.path)}", "units": axis.units}
    return attrs | dict(_DIFFERENCE) if axis.units == "K" else attrs


def axis_labels(axis: Axis) -> np.ndarray[Any, Any]:
    """Labels of a swept parameter: float64, or objects if one of them is a text."""
    if any(isinstance(label, str) for label in axis.labels):
        return np.array([str(label) for label in axis.labels], dtype=object)
    return np.array(axis.labels, dtype=float)


def axis_places(axis: Axis) -> np.ndarray[Any, Any]:
    """Place of every label along the file's dimension: in ascending order where the study's goes up and down.

    CF wants monotonic coordinates. Texts stay in their order: as the values of a dimension they are no strict CF
    coordinate, but as a label variable of another name `data.sel(friction="tresca")` would find no index.
    """
    labels = axis_labels(axis)
    places = np.arange(len(labels))
    if labels.dtype == object or np.all(np.diff(labels) > 0.0) or np.all(np.diff(labels) < 0.0):
        return places
    places[np.argsort(labels, kind="stable")] = np.arange(len(labels))
    return places


def edge_attributes(edge_names: Sequence[str]) -> dict[str, Any]:
    """Flags that name the contact edges of `edge`."""
    if not edge_names:
        return {}
    values = np.arange(len(edge_names), dtype=np.int8)
    return {"flag_values": values, "flag_meanings": " ".join(edge_names)}


def axis_problems(study: Study) -> list[str]:
    """One sentence for each swept parameter whose name cannot stand in the file."""
    names = [axis_name(axis) for axis in study.axes]
    problems = [f"two swept parameters are named {n!r}" for n in sorted({n for n in names if names.count(n) > 1})]
    for name in names:
        if name in RESERVED:
            problems.append(f"the swept parameter {name!r} has the name of a result; give it another name")
        elif not re.fullmatch(r"[A-Za-z][A-Za-z0-9_]*", name):
            problems.append(f"the swept parameter {name!r} needs a name of letters, digits and underscores")
    return problems


CHUNKED = 2_500
"""Bytes that HDF5 spends on a variable with a checksum beside its values."""


def expected_bytes(study: Study, levels: Sequence[LevelRecord | tuple[int, int]]) -> int:
    """Size of the result file [byte], for a look at the disk before the work.

    levels: one record per level, or predicted (contact nodes, mesh nodes)
    """
    points = int(np.prod(study.shape, dtype=np.int64))
    total = 100_000 + len(study.text.encode()) + 8 * (len(ROOT) + 2) * points * study.mesh.levels
    total += CHUNKED * (len(ROOT) + len(CONTACT) * len(levels))
    for level in levels:
        contact, nodes = level if isinstance(level, tuple) else _counts(level)
        total += (17 * points + 48) * contact
        if study.output.fields:
            total += 8 * (len(FIELDS) * points + 5) * nodes
        if study.output.live:
            total += 8 * (min(contact, 250) + 40) * contact + 72 * points
    return total


def _counts(level: LevelRecord) -> tuple[int, int]:
    return level.n_contact, len(level.fields.get("node_x", ()))
