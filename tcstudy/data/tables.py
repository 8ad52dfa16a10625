"""The variables of paths, histories, fits, convergence and cost (CF-1.11): one group for each file.

Path: `parameter`, `u_T` and `xi` hold the vertices of a polygon exactly. Between two vertices they
are linear and `energy` is a parabola. Piece i lies between the vertices i and i + 1. Flags are
bytes with flag_meanings; nothing is missing.

History: one row per sweep point and step. Step 0 applies the loads of the study as it is written to
the unloaded body. After the step in which a history ends early all values are missing, and `reason`
says why. `u_T`, `kappa` and `plastic` are the state on which the next step depends, to the bit: a
study with more steps than its file goes on from there.

Fit: estimates, their uncertainty and tests of the model, in SI units. Units differ from parameter
to parameter: `parameter_units` has them.

Convergence: the dimensions are those of the sweep and the level. Each error E has error_E (relative
to the norm of the reference) and rate_E by level. By sweep point it has size_squared_E (that norm
squared, which has a unit that CF can write), slope_E, slope_error_E, first_level_E, verdict_E,
expected_E and reason_E. Each number Q has value_Q by level, and limit_Q, uncertainty_Q,
limit_order_Q and exact_Q by sweep point.

Cost: the dimensions are family, solver, level and run (repeated timings). Sizes have (family,
level), `time` has all four. Each error E has error_E and dominated_E, by the first three.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tcstudy.data.records import BlockRecord, LevelRecord, Record
from tcstudy.data.schema import (
    CERTIFIED,
    CONTACT,
    DIFFERENCE,
    JOINTS,
    JUDGED,
    LEVEL_COORDINATE,
    NUMBERED,
    OPENING,
    POINT_LEVEL,
    RATE,
    REGIONS,
    REQUESTED,
    RESERVED,
    ROOT,
    STATUS,
    SWEEP,
    Dims,
    Dtype,
    Extra,
    FileVariable,
    T,
    count,
    edge_variables,
    flags,
    free_name,
    missing,
    opening_variables,
    region_variables,
    result,
    step_variables,
)
from tcstudy.scene.contact_states import ContactState
from tcstudy.scene.histories import START
from tcstudy.scene.study import Axis, Study

_VERTEX, _PIECE, _INTERVAL = ("vertex",), ("piece",), ("interval",)
_AT, _SOLUTION, _LOOP, _JUMP = ("at",), ("solution",), ("loop_vertex",), ("jump",)
_BRANCH, _ON_BRANCH = ("branch",), ("branch_vertex",)
FROM_LAST = "from the last"
"""Attribute `branch` of a history without an energy, whose steps follow no path."""
_STATES = tuple(s.name.lower() for s in ContactState)
_STABLE = ("unstable", "stable")
_STATES_N = ("closed", "elastic", "softening", "drop", "weakened")


# variables of a path are coordinates, because nothing is missing in its file


def _number(
    name: str, units: str, long_name: str, dims: Dims = (), along: str = ""
) -> FileVariable:
    extra = {"coordinates": along} if along else {}
    return FileVariable(name, "f8", units, long_name, dims, extra=extra, coordinate=True)


def _index(name: str, long_name: str, dims: Dims = ()) -> FileVariable:
    return FileVariable(name, "i4", "1", long_name, dims, coordinate=True)


def _flag(name: str, long_name: str, dims: Dims, meanings: Sequence[str] = ()) -> FileVariable:
    extra = flags(*meanings) if meanings else {}
    return FileVariable(name, "i1", "1", long_name, dims, extra=extra, coordinate=True)


def _states(prefix: str, dim: str, meaning: str) -> tuple[FileVariable, ...]:
    """Return the variables of solutions: parameter, energy, displacements and tractions.

    Openings and normal tractions are of studies with edges that may lift off.

    meaning: of the parameter
    """
    parameter = f"{prefix}parameter"
    energy = "total potential energy, per unit thickness"
    dims = (dim, "node")
    coordinates = f"{parameter} arclength x y"
    at_opening = (dim, "opening_node")
    along_openings = f"{parameter} opening_arclength opening_x opening_y"
    return (
        _number(parameter, T, meaning, (dim,)),
        _number(f"{prefix}energy", "J m-1", energy, (dim,), parameter),
        _number(f"{prefix}u_T", "m", "tangential displacement", dims, coordinates),
        _number(f"{prefix}xi", "Pa", "tangential traction -S_T", dims, coordinates),
        _number(f"{prefix}opening", "m", "opening -u_N", at_opening, along_openings),
        _number(f"{prefix}S_N", "Pa", "normal traction S_N", at_opening, along_openings),
    )


CURVE: tuple[FileVariable, ...] = (
    *_states("", "vertex", "parameter of the path"),
    _number(
        "energy_rate",
        RATE,
        "derivative of the energy by the parameter along the path",
        _VERTEX,
        "parameter",
    ),
    _number(
        "residual",
        "1",
        "largest residual of equilibrium at the contact nodes over the scale of friction",
        _VERTEX,
        "parameter",
    ),
    _flag("stable", "strict local minimum of the energy inside the segment", _PIECE, _STABLE),
    replace(
        _flag("state", "state of the contact node on the segment", ("piece", "node"), _STATES),
        extra={"coordinates": "arclength x y", **flags(*_STATES)},
    ),
    replace(
        _flag("state_N", "state of the bond across the line", ("piece", "opening_node"), _STATES_N),
        extra={"coordinates": "opening_arclength opening_x opening_y", **flags(*_STATES_N)},
    ),
    _number("slip_length", "m", "length of the contact line that does not stick", _PIECE),
    _index(
        "fold_vertex",
        "vertex at which the parameter steps back by 0.5 % of its range or more",
        ("fold",),
    ),
    _number(
        "lowest_begin",
        T,
        "lower end of a range in which one segment has the lowest energy",
        _INTERVAL,
    ),
    _number(
        "lowest_end",
        T,
        "upper end of a range in which one segment has the lowest energy",
        _INTERVAL,
    ),
    _index("lowest_piece", "segment with the lowest energy on the path in the range", _INTERVAL),
    _flag(
        "lowest_certified",
        "global minimum of the energy, proved at mid-range",
        _INTERVAL,
        CERTIFIED,
    ),
)
"""The polygon of solutions with k vertices and k − 1 pieces, and lists beside it."""
SOLUTIONS: tuple[FileVariable, ...] = (
    _number("at", T, "requested value of the parameter", _AT),
    _index("solution_count", "number of solutions on the path at the value", _AT),
    _index("solution_at", "index of the value that the solution belongs to", _SOLUTION),
    *_states("solution_", "solution", "parameter of the solution"),
    _index(
        "solution_piece", "segment of the path that contains the solution, -1 for none", _SOLUTION
    ),
    _number(
        "solution_residual",
        "1",
        "inclusion residual over the scale of friction",
        _SOLUTION,
        "solution_parameter",
    ),
    _number(
        "solution_rounding",
        "1",
        "rounding level of the inclusion residual",
        _SOLUTION,
        "solution_parameter",
    ),
    _flag("solution_stable", "strict local minimum of the energy on the path", _SOLUTION, _STABLE),
    _flag(
        "solution_lowest", "lowest energy on the path at its value", _SOLUTION, ("higher", "lowest")
    ),
    _flag("solution_unique", "unique solution of the discrete problem", _SOLUTION, CERTIFIED),
    _flag(
        "solution_strict_minimum",
        "strict local minimum of the energy",
        _SOLUTION,
        CERTIFIED,
    ),
    _flag(
        "solution_global_minimum",
        "global minimum of the energy",
        _SOLUTION,
        CERTIFIED,
    ),
)
"""All solutions at the requested values, in the order of `at` and along the path."""
LOOP: tuple[FileVariable, ...] = (
    *_states("loop_", "loop_vertex", "parameter along the hysteresis loop"),
    _index("loop_branch", "stable branch, counted along the loop", _LOOP),
    _number("jump_parameter", T, "parameter at the jump to another branch", _JUMP),
    _index("jump_vertex", "last vertex of the loop before the jump", _JUMP),
    _flag("jump_rising", "whether the parameter was growing", _JUMP, ("falling", "rising")),
    _number("jump_drop", "J m-1", "energy released at the jump, per unit thickness", _JUMP),
    _number(
        "energy_lost", "J m-1", "energy dissipated by the jumps of one loop, per unit thickness"
    ),
    _number("loop_area", "J m-1", "area of the loop; the dissipated energy if it is closed"),
    _flag("loop_closed", "whether the loop ends where it began", ()),
    _flag("loop_complete", "whether both ends of the range were reached", ()),
)
"""The quasi-static hysteresis loop: stable branches one after the other, and the jumps between."""
BRANCHES: tuple[FileVariable, ...] = (
    _flag("complete", "completeness of the list of branches", (), CERTIFIED),
    _flag("at_complete", "completeness of the solutions at the value", _AT, CERTIFIED),
    _flag("branch_loop", "whether the branch is closed", _BRANCH, ("open", "closed")),
    _flag("branch_on_path", "whether the path goes along it", _BRANCH, ("apart", "on_path")),
    _index("branch_of", "branch that the vertex is on, its vertices in their order", _ON_BRANCH),
    *_states("branch_", "branch_vertex", "parameter at the vertex"),
    _flag(
        "branch_stable",
        "stability of the segment after the vertex, if there is one",
        _ON_BRANCH,
        _STABLE,
    ),
)
"""Every branch of the range, on request; a closed one has its first vertex again at its end."""
LINE = tuple(replace(v, coordinate=True) for v in CONTACT if v.dims == ("node",))
"""The contact line, as in the files of runs."""
MESH_LEVEL: tuple[FileVariable, ...] = (
    _index("level", "mesh level, from coarse to fine"),
    _number("h_max", "m", "largest element edge"),
    _index("n_dof", "number of displacement degrees of freedom"),
    _index("n_contact", "number of contact degrees of freedom m"),
)
LEVEL: tuple[FileVariable, ...] = (
    *MESH_LEVEL,
    _index("start", "vertex from which the path was followed in both directions"),
    _number("lambda_1", "Pa m-1", "smallest tangential stiffness of the body per contact length"),
    _number(
        "lambda_1_error",
        "1",
        "relative error of lambda_1 by rounding; proofs use a body that is softer by it",
    ),
    _number(
        "omega", "Pa m-1", "maximum softening slope of the friction law; infinite for a sudden drop"
    ),
    _number(
        "law_error",
        "1",
        "error of the piecewise-linear approximation of the law over its scale; 0 for an exact one",
    ),
)
"""Variables of a path without a dimension."""
OPENING_LINE = tuple(replace(v, coordinate=True) for v in OPENING if v.dims == ("opening_node",))
"""The nodes that may lift off, as in the files of runs."""
PATH = (*LINE, *OPENING_LINE, *LEVEL, *CURVE, *SOLUTIONS, *LOOP, *BRANCHES, *JOINTS)
"""All variables that a file of a path may hold beside those on request."""


def path_variables(study: Study) -> tuple[FileVariable, ...]:
    """Return the variables that the file of this study's path may hold.

    Results along openings, and requested forces, are by vertex and by solution.
    """
    variables = list(PATH)
    for variable in (*opening_variables(study), *edge_variables(study)):
        for prefix, dims in (("", _VERTEX), ("solution_", _SOLUTION)):
            name = f"{prefix}{variable.name}"
            extra = {"coordinates": f"{prefix}parameter"}
            variables.append(replace(variable, name=name, dims=dims, extra=extra))
    return tuple(variables)


_AT_STEP, _STEP_NODE = (SWEEP, "step"), (SWEEP, "step", "node")
_OF_ROOT = {v.name: replace(v, dims=_AT_STEP) for v in ROOT}


def _of_step(name: str, units: str, long_name: str, comment: str = "") -> FileVariable:
    return result(name, units, long_name, comment, _AT_STEP)


def _of_node(name: str, units: str, long_name: str) -> FileVariable:
    extra = {"coordinates": "cycle arclength x y", **JUDGED}
    return FileVariable(name, "f8", units, long_name, _STEP_NODE, extra=extra)


_PER = "per unit thickness"
_WORK = f"-1/2 (v + v before) dl, summed over parts of the step, {_PER}"
_CLOSURE = f"work - d(energy + stored) - dissipated - released, {_PER}"
_DEBONDED = (
    "where kappa passes the slip of full debonding, linear between nodes; "
    "missing where it is nowhere"
)
STEPS: tuple[FileVariable, ...] = (
    replace(_OF_ROOT["status"], long_name="status of the step"),
    _of_step(
        "energy",
        "J m-1",
        "energy of body and loads",
        f"1/2 v A v - l v at the contact nodes, {_PER}",
    ),
    _of_step("stored", "J m-1", "energy stored in the bond", _PER),
    _of_step(
        "dissipated",
        "J m-1",
        "energy dissipated in the step",
        f"by friction, yielding or damage, {_PER}",
    ),
    _of_step("work", "J m-1", "work of the loads' change", _WORK),
    _of_step("closure", "J m-1", "time-discretisation energy defect", _CLOSURE),
    _of_step("released", "J m-1", "energy released by jumps", _PER),
    _of_step(
        "identity", "1", "energy balance residual", "relative to its terms; at rounding level"
    ),
    replace(
        _OF_ROOT["inclusion_residual"], comment="largest distance of -S_T from the law of the step"
    ),
    *(_OF_ROOT[name] for name in ("inclusion_rounding", "friction_resultant", "u_T_max")),
    _of_step("slip_length", "m", "length that slipped in the step"),
    *(replace(v, dims=_AT_STEP, comment=f"{v.comment}, at kappa in place of u_T") for v in REGIONS),
    _of_step("debonded_from", "m", "arclength from which the bond is debonded", _DEBONDED),
    _of_step("debonded_to", "m", "arclength up to which the bond is debonded", _DEBONDED),
    replace(_OF_ROOT["unique"], long_name="unique solution of the step"),
    _OF_ROOT["strict_minimum"],
    replace(_OF_ROOT["global_minimum"], long_name="global minimum of the energy of the step"),
    count("parts", "problems solved, or segments of the path", _AT_STEP),
    _OF_ROOT["iterations"],
    count("jumps", "jumps in the step", _AT_STEP),
)
"""Variables of a history by step."""
NODES: tuple[FileVariable, ...] = (
    _of_node("u_T", "m", "tangential displacement"),
    _of_node("xi", "Pa", "tangential traction -S_T"),
    _of_node("kappa", "m", "accumulated or largest slip kappa"),
    _of_node("plastic", "m", "plastic slip"),
    _of_node("dissipation", "J m-2", "energy dissipated in the step, by area"),
    replace(_of_node("jumped", "1", "moved by a jump"), dtype="i1", no_value=-1),
)
"""Variables of a history by step and node."""


def _of_opening(variable: FileVariable, name: str, long_name: str) -> FileVariable:
    """Return a variable by step and node as one of the nodes that may lift off."""
    coordinates = {"coordinates": "cycle opening_arclength opening_x opening_y"}
    return replace(
        variable,
        name=name,
        long_name=long_name,
        dims=(SWEEP, "step", "opening_node"),
        extra={**variable.extra, **coordinates},
    )


_NODE = {v.name: v for v in NODES}
_ACROSS: tuple[FileVariable, ...] = (
    _of_opening(_NODE["u_T"], "opening", "opening -u_N"),
    _of_opening(_NODE["xi"], "S_N", "normal traction S_N"),
    _of_opening(_NODE["kappa"], "kappa_N", "largest opening kappa"),
    _of_opening(
        *(
            _NODE["dissipation"],
            "dissipation_N",
            "energy dissipated by opening in the step, by area",
        )
    ),
    _of_opening(_NODE["jumped"], "jumped_N", "opened or closed by a jump"),
)
"""Variables of a history by step and node that may lift off."""
_LOOSE = "0 where only friction restrains rigid-body motion"
POINTS: tuple[FileVariable, ...] = (
    FileVariable("reason", "str", "", "why the history ended early", (SWEEP,)),
    FileVariable("lambda_1", "f8", "Pa m-1", "tangential stiffness lambda_1", (SWEEP,), _LOOSE),
    FileVariable(
        "lambda_1_error", "f8", "1", "relative error of lambda_1", (SWEEP,), "by rounding"
    ),
    FileVariable(
        "margin", "f8", "Pa m-1", "uniqueness margin", (SWEEP,), "all steps are unique if positive"
    ),
)
"""Variables of a history by sweep point."""
HISTORY = (*STEPS, *NODES, *POINTS)

P, D, S = ("parameter",), ("row",), ("start",)
_UNITS = "in the units of parameter_units"


def _own(name: str, long_name: str, dims: Dims = P) -> FileVariable:
    return FileVariable(name, "f8", "1", long_name, dims, comment=_UNITS)


_SIGNED = "with the sign of observed minus fitted"
_DISTANCE = f"of an orthogonal fit the distance from the curve, {_SIGNED}"
_FITTED = "of fitted minus observed value over its noise"


FIT = (
    FileVariable("parameter", "str", "", "fitted parameter", P, coordinate=True),
    FileVariable("parameter_units", "str", "", "units of the parameter", P),
    _own("estimate", "estimate"),
    _own("standard_error", "standard error"),
    _own("interval", "95 % interval", (*P, "end")),
    FileVariable(
        "mesh_shift", "f8", "1", "change on a mesh of half the size over the standard error", P
    ),
    FileVariable("logarithmic", "i1", "1", "fitted by its logarithm", P, extra=flags("no", "yes")),
    FileVariable("at_bound", "i1", "1", "on a bound", P, extra=flags("no", "yes")),
    FileVariable(
        "covariance",
        "f8",
        "1",
        "covariance, of ln where logarithmic",
        (*P, "other_parameter"),
        comment=_UNITS,
    ),
    FileVariable(
        "singular_value", "f8", "1", "singular values of the Jacobian by ln p", ("direction",)
    ),
    FileVariable(
        "singular_vector",
        "f8",
        "1",
        "directions of the singular values in ln p",
        ("direction", "parameter"),
    ),
    FileVariable("measured_column", "i4", "1", "column of the datum", D),
    FileVariable("datum", "f8", "1", "measured value", D, comment="in SI units of its column"),
    FileVariable("datum_given", "f8", "1", "load parameter of the datum", D),
    FileVariable("predicted", "f8", "1", "value of the model", D),
    FileVariable("predicted_given", "f8", "1", "load parameter of the predicted value", D),
    FileVariable(
        "residual",
        "f8",
        "1",
        "observed minus fitted value over its noise",
        D,
        comment=_DISTANCE,
    ),
    FileVariable(
        "jacobian",
        "f8",
        "1",
        "derivative of the minimised residual by parameter, or by its logarithm",
        (*D, *P),
        comment=f"{_FITTED}; of an orthogonal fit of the signed distance",
    ),
    FileVariable("noise", "f8", "1", "measurement standard uncertainty", D),
    FileVariable("cost", "f8", "1", "half the sum of squares by evaluation", ("improvement",)),
    FileVariable("start_cost", "f8", "1", "half the sum of squares, by distinct minimum", S),
    FileVariable("start_count", "i4", "1", "starts that end in this minimum", S),
    FileVariable(
        "start_estimate", "f8", "1", "estimate, by distinct minimum", (*S, *P), comment=_UNITS
    ),
    FileVariable("curve_given", "f8", "1", "load parameter along the curve", ("vertex",)),
    FileVariable("curve_measured", "f8", "1", "value of the model along the curve", ("vertex",)),
    FileVariable("fold_vertex", "i4", "1", "vertex of a fold", ("fold",)),
    FileVariable("law_slip", "f8", "m", "slip", ("law_place",)),
    FileVariable("law_traction", "f8", "Pa", "fitted friction law", ("law_place",)),
    FileVariable(
        "law_error", "f8", "Pa", "standard error of the fitted friction law", ("law_place",)
    ),
)
"""All variables that a file of a fit may hold.

Residuals, and the Jacobian by ln p or by p (`logarithmic`), are in units of the noise.
"""
VERDICTS = (
    "unknown",
    "exact",
    "as_expected",
    "faster",
    "slower",
    "pre_asymptotic",
    "too_few_levels",
)
"""Verdicts on the measured orders, stored as flags."""


@dataclass(frozen=True)
class Measure:
    """An error or a number.

    symbol: for tables;  units: of an error those of its square
    """

    name: str
    symbol: str
    units: str
    long_name: str


ERRORS = (
    Measure("theta_L2", "θ in L²", "K2 m2", "error of the temperature in L2"),
    Measure("theta_H1", "θ in H¹", "K2", "error of the temperature in the H1 seminorm"),
    Measure("u_energy", "u in energy", "N", "error of the displacement in the energy norm"),
    Measure("u_H1", "u in H¹", "m2", "error of the displacement in the H1 seminorm"),
    Measure("u_L2", "u in L²", "m4", "error of the displacement in L2"),
    Measure(
        "u_T_L2",
        "u_T in L²(Γ_C)",
        "m3",
        "error of the tangential displacement in L2 of the contact line",
    ),
    Measure(
        "u_T_max",
        "u_T in max",
        "m2",
        "largest error of the tangential displacement at the contact nodes",
    ),
    Measure(
        "xi_L2", "ξ in L²(Γ_C)", "Pa2 m", "error of the friction traction as a step function in L2"
    ),
    Measure(
        "xi_nodes",
        "ξ at nodes",
        "Pa2 m",
        "error of the friction traction at the contact nodes, weighted by c",
    ),
    Measure(
        "xi_max", "ξ in max", "Pa2", "largest error of the friction traction at the contact nodes"
    ),
    Measure("opening_L2", "s_N in L²(Γ_C)", "m3", "error of the opening in L2 of the contact line"),
    Measure("opening_max", "s_N in max", "m2", "largest error of the opening at its nodes"),
    Measure(
        "S_N_L2",
        "S_N in L²(Γ_C)",
        "Pa2 m",
        "error of the normal traction of openings as a step function in L2",
    ),
    Measure(
        "S_N_nodes",
        "S_N at nodes",
        "Pa2 m",
        "error of the normal traction of openings at their nodes, weighted by c_N",
    ),
    Measure(
        "S_N_max", "S_N in max", "Pa2", "largest error of the normal traction of openings at nodes"
    ),
)
BY_ITSELF = {"estimate_u_energy": "error_estimate", "bound_u_energy": "error_bound_relative"}
"""Errors of the displacement that a study with a guarantee computes: names here, names in a run."""
OPENING_NUMBERS = (
    Measure("opening_max", "max s_N", "m", "largest opening"),
    Measure("adhesion_resultant", "∫S_N", "N m-1", "integral of the normal traction of openings"),
    Measure("opened_length", "opened length", "m", "length of the contact line that is open"),
    Measure(
        "debonded_length", "debonded length", "m", "length of the contact line that is debonded"
    ),
)
"""Numbers of studies with edges that may lift off."""
NUMBERS = (
    Measure("energy", "energy", "J m-1", "energy of the solution"),
    Measure("friction_resultant", "∫ξ", "N m-1", "integral of -S_T over the contact line"),
    Measure("slip_length", "slip length", "m", "length of the contact line that does not stick"),
    Measure("u_T_max", "max |u_T|", "m", "largest tangential displacement on the contact line"),
    *OPENING_NUMBERS,
)


def convergence_record(
    study: Study, points: Sequence[Mapping[str, Any]], reference: str, notes: Sequence[str]
) -> Record:
    """Return the record of a convergence; values that only some points have are missing elsewhere.

    points:    of every sweep point its status (levels,) and values by variable of
               `convergence_table`
    reference: solution against which errors are measured, in words
    """
    levels = len(points[0]["status"])
    values: dict[str, Any] = {"level": np.arange(levels)}
    table = convergence_table(study)
    for variable in table:
        name = variable.name
        points_with_value = [i for i, point in enumerate(points) if name in point]
        if not points_with_value:
            continue
        if SWEEP not in variable.dims:
            values[name] = points[0][name]
            continue
        shape = (len(points), levels) if "level" in variable.dims else (len(points),)
        rows = missing(variable, shape)
        if variable.dtype == "str":
            rows[:] = ""
        for i in points_with_value:
            rows[i] = points[i][name]
        values[name] = rows
    attributes = {"reference": reference, "notes": "\n".join(notes)}
    return Record("convergence", table, values, attributes)


def convergence_table(study: Study) -> tuple[FileVariable, ...]:
    """Return the variables that the convergence of a study may have."""
    variables = [LEVEL_COORDINATE]
    for variable in LEVELS:
        dims = POINT_LEVEL if study.variants else variable.dims
        variables.append(replace(variable, dims=dims))
    long_name = "status of the solution"
    variables.append(
        FileVariable("status", "i1", "1", long_name, coordinate=True, extra=STATUS),
    )
    variables.append(FileVariable("reason", "str", "", "why there is no solution", POINT_LEVEL))
    variables += _measure_variables()
    if study.mesh.bounds_errors:
        error = ERRORS[2].long_name
        estimate, bound = BY_ITSELF
        variables.append(FileVariable(estimate, "f8", "1", f"estimated relative {error}"))
        variables.append(FileVariable(bound, "f8", "1", f"proved bound of the relative {error}"))
    return tuple(variables)


LEVELS = (
    FileVariable("h_max", "f8", "m", "largest element edge", ("level",)),
    FileVariable("n_dof", "i4", "1", "number of displacement degrees of freedom", ("level",)),
    FileVariable("n_contact", "i4", "1", "number of contact degrees of freedom", ("level",)),
    FileVariable(
        "compared", "i1", "1", "1 if the level is compared with the reference", ("level",)
    ),
)
"""Variables by level; of a sweep over geometries they are by point and level."""
_ONCE = (SWEEP,)
_ERROR_PARTS: tuple[tuple[str, Dtype, str, Dims, str], ...] = (
    ("error", "f8", "1", POINT_LEVEL, "relative {}"),
    ("rate", "f8", "1", POINT_LEVEL, "observed order from the level before: {}"),
    ("size_squared", "f8", "{}", _ONCE, "square of the norm of the reference, for the {}"),
    ("slope", "f8", "1", _ONCE, "fitted order: {}"),
    ("slope_error", "f8", "1", _ONCE, "standard error of the order: {}"),
    ("first_level", "i4", "1", _ONCE, "first asymptotic level, -1 for none: {}"),
    ("expected", "f8", "1", _ONCE, "expected order: {}"),
    ("reason", "str", "1", _ONCE, "reason of the expected order: {}"),
    ("verdict", "i1", "1", _ONCE, "verdict on the measured orders: {}"),
)
"""Variables of an error: prefix of the name of the measure, type, units, dimensions, meaning."""
_NUMBER_PARTS: tuple[tuple[str, Dtype, str, Dims, str], ...] = (
    ("value", "f8", "{}", POINT_LEVEL, "{}"),
    ("limit", "f8", "{}", _ONCE, "extrapolated to h = 0: {}"),
    ("uncertainty", "f8", "{}", _ONCE, "uncertainty of the extrapolated value: {}"),
    ("limit_order", "f8", "1", _ONCE, "order of the extrapolation: {}"),
    ("exact", "f8", "{}", _ONCE, "exact value where known: {}"),
)
"""Variables of a number, in the same form."""


def _measure_variables() -> Iterator[FileVariable]:
    """Yield the variables of every error and number."""
    for measure in (*ERRORS, *NUMBERS):
        parts = _ERROR_PARTS if measure in ERRORS else _NUMBER_PARTS
        for prefix, dtype, units, dims, meaning in parts:
            name = f"{prefix}_{measure.name}"
            units = units.format(measure.units)
            long_name = meaning.format(measure.long_name)
            extra = flags(*VERDICTS) if prefix == "verdict" else {}
            yield FileVariable(name, dtype, units, long_name, dims, extra=extra)


OWN = "study"
"""Family of the study's own meshes in a file of cost, if they belong to no other family."""
BOUND = Measure(
    "u_bound",
    "u in energy, proved",
    "1",
    "proved bound of the error of the displacement, energy norm",
)
ESTIMATE = Measure(
    "u_estimate",
    "u in energy, estimated",
    "1",
    "estimated error of the displacement, energy norm",
)
MEASURES: tuple[Measure, ...] = (
    *ERRORS,
    ESTIMATE,
    BOUND,
    *(m for m in NUMBERS if m.name in ("energy", "friction_resultant")),
)
"""Errors that a chart may show, relative to the reference.

Estimate and bound need a guarantee instead.
"""
_MESHES, _SOLVED = ("family", "level"), ("family", "solver", "level")


def _charted_error(measure: Measure) -> tuple[FileVariable, FileVariable]:
    """Return the variables of an error, and of whether it is dominated."""
    is_error = measure in (*ERRORS, ESTIMATE, BOUND)
    error = measure.long_name if is_error else f"error of the {measure.long_name}"
    dominated = f"whether another setting is as fast and as accurate: {error}"
    front = flags("on_the_front", "dominated")
    return (
        FileVariable(f"error_{measure.name}", "f8", "1", f"relative {error}", _SOLVED),
        FileVariable(f"dominated_{measure.name}", "i1", "1", dominated, _SOLVED, extra=front),
    )


COST_TABLE = (
    FileVariable("family", "str", "", "mesh family", ("family",), coordinate=True),
    FileVariable(
        "solver", "str", "", "solver of the contact problem", ("solver",), coordinate=True
    ),
    LEVEL_COORDINATE,
    FileVariable("run", "i4", "1", "repetition of the timing", ("run",), coordinate=True),
    FileVariable("h_max", "f8", "m", "largest element edge", _MESHES),
    FileVariable(
        "n_dof",
        "i4",
        "1",
        "number of displacement degrees of freedom, -1 where there is no mesh",
        _MESHES,
    ),
    FileVariable(
        "n_contact",
        "i4",
        "1",
        "number of contact degrees of freedom, -1 where there is no mesh",
        _MESHES,
    ),
    FileVariable("status", "i1", "1", "status of the solution", _SOLVED, extra=STATUS),
    FileVariable("reason", "str", "", "why there is no solution", _SOLVED),
    FileVariable(
        "time", "f8", "s", "wall time from the body to the displacements", (*_SOLVED, "run")
    ),
    *(variable for measure in MEASURES for variable in _charted_error(measure)),
)
"""All variables that a file of accuracy against cost may hold.

A solution is dominated if another is as accurate and as fast, and better in one of the two.
"""


def history_variables(study: Study) -> tuple[FileVariable, ...]:
    """Return the variables of the file of this study's history.

    Variables that its laws, its memory or its branch do not have are left out.
    """
    assert study.history is not None
    absent = {v.name for v in REGIONS} - {v.name for v in region_variables(study)}
    if study.history.memory.stiffness is None:
        absent.add("plastic")
    if "debonded_length" in absent and not study.opens:
        absent |= {"debonded_from", "debonded_to"}
    if study.history.branch != "continued":
        absent.add("jumped")
    variables = [v for v in HISTORY if v.name not in absent]
    if study.opens:
        variables += [replace(v, dims=_AT_STEP) for v in opening_variables(study)]
        variables += [v for v in _ACROSS if v.name.removesuffix("_N") not in absent]
    return (*variables, *step_variables(study))


@cache
def _history_names() -> frozenset[str]:
    """Return the names of variables and dimensions in files of a history."""
    tables = (*HISTORY, *_ACROSS, *MESH_LEVEL, *LINE, *OPENING_LINE)
    names = {name for variable in tables for name in (variable.name, *variable.dims)}
    return frozenset(names | {"step", "step_name", "cycle", "level", "live", "mesh"})


@cache
def _names() -> frozenset[str]:
    """Return the names of variables and dimensions in files of any swept study."""
    tables = (*LEVELS, *_measure_variables())
    names = {name for variable in tables for name in (variable.name, *variable.dims)}
    return RESERVED | names | _history_names() | {*BY_ITSELF}


def is_taken(name: str) -> bool:
    """Return whether a file may use a name itself: for a variable, a dimension or a group."""
    return name in _names() or _is_numbered_or_requested(name)


def is_taken_in_history(name: str) -> bool:
    """Return whether the file of a history may use a name itself.

    It has no fields, so that `theta` may be the name of a load.
    """
    return name in _history_names() or _is_numbered_or_requested(name)


def _is_numbered_or_requested(name: str) -> bool:
    return any(pattern.fullmatch(name) for pattern in (NUMBERED, REQUESTED))


def axis_names(axes: Sequence[Axis]) -> tuple[str, ...]:
    """Return the names of swept parameters in files, which all differ.

    A parameter whose name is taken has its key path as a name ("heat_omega").
    """
    names = list[str]()
    for axis in axes:
        names.append(free_name(axis.name, axis.path, lambda name: name in names or is_taken(name)))
    return tuple(names)


def step_record(
    study: Study, point: int, step: int, values: Mapping[str, Any], reason: str = ""
) -> BlockRecord:
    """Return the record of a step of a point: its values by name of a variable of the file.

    The journal has a step as it has the points of a level.
    """
    numbers = dict[str, Any]()
    for variable in history_variables(study):
        name = variable.name
        if name in values and name not in ("status", "reason"):
            numbers[name] = np.asarray(values[name], variable.dtype)[None]
    points = np.array([point], dtype=np.intp)
    status = np.array([values["status"]], dtype=np.int8)
    reasons = {0: reason} if reason else {}
    return BlockRecord(step, study.shape, points, status, reasons, numbers)


def _step_coordinate(
    name: str, dtype: Dtype, units: str, long_name: str, extra: Extra | None = None
) -> FileVariable:
    return FileVariable(
        name, dtype, units, long_name, ("step",), extra=extra or {}, coordinate=True
    )


def load_variables(study: Study) -> list[tuple[FileVariable, NDArray[Any]]]:
    """Return the coordinates of the steps with their values (N,).

    They are number, name, cycle, and every load that changes.
    """
    plan = study.history
    assert plan is not None
    schedule = list(plan.schedule())
    cycles = np.array([0, *(cycle for *_, cycle in schedule)])
    step_names = np.array([START, *(name for *_, name, _ in schedule)], dtype=object)
    coordinates: list[tuple[FileVariable, NDArray[Any]]] = [
        (_step_coordinate("step", "i4", "1", "step"), np.arange(len(cycles))),
        (_step_coordinate("step_name", "str", "", "name of the step"), step_names),
        (_step_coordinate("cycle", "i4", "1", "cycle, from 1"), cycles),
    ]
    used_names = {*axis_names(study.axes)}
    loads = plan.loads()
    for name, (keys, units, _) in zip(plan.names, plan.parameters, strict=True):
        free = free_name(name, keys, lambda n: n in used_names or is_taken_in_history(n))
        used_names.add(free)
        extra = DIFFERENCE if units == "K" else {}
        variable = _step_coordinate(free, "f8", units, ".".join(keys), extra)
        coordinates.append((variable, np.array([values[keys] for values in loads])))
    return coordinates


def history_record(study: Study, line: LevelRecord, steps: Iterable[BlockRecord]) -> Record:
    """Return the record of all steps of all points."""
    plan = study.history
    assert plan is not None
    points = len(study.scenes)
    count = plan.steps + 1
    shapes: dict[str, tuple[int, ...]] = {
        "step": (points, count),
        "node": (points, count, len(line.arclength)),
        "opening_node": (points, count, len(line.fields.get("opening_x", ()))),
    }
    variables = history_variables(study)
    values = {v.name: missing(v, shapes.get(v.dims[-1], (points,))) for v in variables}
    values["reason"][:] = ""
    for step in steps:
        point = step.points[0]
        for name, (value,) in ({"status": step.status} | step.numbers).items():
            index = (point, step.level) if values[name].ndim > 1 else point
            values[name][index] = value
        values["reason"][point] = step.reasons.get(0, values["reason"][point])
    loads = load_variables(study)
    load_names = (variable.name for variable, _ in loads if variable.dtype == "f8")
    branch = FROM_LAST if study.knows_pressure else plan.branch
    attributes = {"memory": plan.memory.words, "branch": branch, "loads": " ".join(load_names)}
    load_coordinates = (variable for variable, _ in loads)
    table = (*LINE, *OPENING_LINE, *MESH_LEVEL, *JOINTS, *load_coordinates, *variables)
    coordinates = {variable.name: labels for variable, labels in loads}
    all_values = {**vars(line), **line.fields, **coordinates, **values}
    return Record("history", table, all_values, attributes)
