"""Variables of the files of a path, a history and a fit (CF-1.11): one group each, complete or not there at all.

Path: `parameter`, `u_T` and `xi` hold the vertices of one polygon exactly, so that every point between two vertices is
their linear combination; piece i lies between the vertices i and i + 1. Flags are bytes with flag_meanings; nothing is
missing. History: a row a sweep point and step; after the step in which one ends early all is missing, and `reason`
says why. Fit: what was found, how well it is known, what the data say against it, in SI units, which differ from
parameter to parameter: `parameter_units` names them.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

from tcstudy.data.schema import (
    CERTIFIED,
    CONTACT,
    JOINTS,
    JUDGED,
    RATE,
    REGIONS,
    STATUS,
    SWEEP,
    FileVariable,
    T,
    count,
    flag,
    flags,
    result,
)
from tcstudy.scene.histories import ContactState

_VERTEX, _PIECE, _FOLD, _EVENT, _INTERVAL = ("vertex",), ("piece",), ("fold",), ("event",), ("interval",)
_AT, _SOLUTION, _LOOP, _JUMP = ("at",), ("solution",), ("loop_vertex",), ("jump",)
_LINE = "arclength x y"
_STATES = flags(*(s.name.lower() for s in ContactState))


def _number(name: str, units: str, long_name: str, dims: tuple[str, ...] = (), extra: Any = ()) -> FileVariable:
    return FileVariable(name, "f8", units, long_name, dims, coordinate=True, extra=extra)  # nothing is missing here


def _index(name: str, long_name: str, dims: tuple[str, ...] = ()) -> FileVariable:
    return FileVariable(name, "i4", "1", long_name, dims, coordinate=True)


def _flag(name: str, long_name: str, dims: tuple[str, ...], meanings: Sequence[str]) -> FileVariable:
    return FileVariable(name, "i1", "1", long_name, dims, coordinate=True, extra=flags(*meanings))


def _at_node(name: str, dtype: Any, units: str, long_name: str, dim: str, where: str, extra: Any = ()) -> FileVariable:
    coordinates = (("coordinates", f"{where} {_LINE}".strip()),)
    return FileVariable(name, dtype, units, long_name, (dim, "node"), coordinate=True, extra=coordinates + extra)


_ALONG = (("coordinates", "parameter"),)
_STABLE = ("unstable", "stable")

CURVE: tuple[FileVariable, ...] = (
    _number("parameter", T, "parameter of the path", _VERTEX),
    _at_node("u_T", "f8", "m", "tangential displacement", "vertex", "parameter"),
    _at_node("xi", "f8", "Pa", "tangential traction -S_T", "vertex", "parameter"),
    _number("energy", "J m-1", "total potential energy, per unit thickness; a parabola in between", _VERTEX, _ALONG),
    _number("energy_rate", RATE, "derivative of the energy by the parameter along the path", _VERTEX, _ALONG),
    _number("residual", "1", "largest distance of -S_T from balance over the scale of friction", _VERTEX, _ALONG),
    _flag("stable", "strict local minimum of the energy inside the piece", _PIECE, _STABLE),
    _at_node("state", "i1", "1", "what the contact node does on the piece", "piece", "", _STATES),
    _number("slip_length", "m", "length of the contact line that does not stick", _PIECE),
    _index("fold_vertex", "vertex at which the parameter turns", _FOLD),
    _number("fold_size", T, "how far the parameter steps back at the fold", _FOLD),
    _flag("fold_maximum", "whether the parameter has a maximum at the fold", _FOLD, ("minimum", "maximum")),
    _flag("fold_stable_before", "stability of the piece before the fold", _FOLD, _STABLE),
    _flag("fold_stable_after", "stability of the piece after the fold", _FOLD, _STABLE),
    _index("event_vertex", "vertex at which a contact node changes its state", _EVENT),
    _index("event_node", "contact node that changes its state", _EVENT),
    FileVariable("event_before", "i1", "1", "state before the vertex", _EVENT, coordinate=True, extra=_STATES),
    FileVariable("event_after", "i1", "1", "state after the vertex", _EVENT, coordinate=True, extra=_STATES),
    _number("lowest_begin", T, "lower end of a range in which one piece has the least energy", _INTERVAL),
    _number("lowest_end", T, "upper end of a range in which one piece has the least energy", _INTERVAL),
    _index("lowest_piece", "piece with the least energy on the path in the range", _INTERVAL),
    _flag("lowest_certified", "least energy of all states, proved at mid-range", _INTERVAL, CERTIFIED),
)
"""The polygon of solutions with k vertices and k − 1 pieces, and lists beside it."""

_WHERE = (("coordinates", "solution_parameter"),)

SOLUTIONS: tuple[FileVariable, ...] = (
    _number("at", T, "value at which solutions were asked for", _AT),
    _index("solution_count", "number of solutions on the path at the value", _AT),
    _index("solution_at", "index of the value that the solution belongs to", _SOLUTION),
    _number("solution_parameter", T, "parameter of the solution", _SOLUTION),
    _index("solution_piece", "piece of the path that holds the solution, -1 for none", _SOLUTION),
    _number("solution_energy", "J m-1", "total potential energy, per unit thickness", _SOLUTION, _WHERE),
    _number("solution_residual", "1", "inclusion residual over the scale of friction", _SOLUTION, _WHERE),
    _number("solution_rounding", "1", "what rounding allows of the inclusion residual", _SOLUTION, _WHERE),
    _flag("solution_stable", "strict local minimum of the energy on the path", _SOLUTION, _STABLE),
    _flag("solution_lowest", "least energy on the path at its value", _SOLUTION, ("higher", "lowest")),
    _flag("solution_unique", "certified to be the only solution", _SOLUTION, CERTIFIED),
    _flag("solution_strict_minimum", "certified to be a strict local minimum of the energy", _SOLUTION, CERTIFIED),
    _flag("solution_global_minimum", "certified to have the least energy of all states", _SOLUTION, CERTIFIED),
    _at_node("solution_u_T", "f8", "m", "tangential displacement", "solution", "solution_parameter"),
    _at_node("solution_xi", "f8", "Pa", "tangential traction -S_T", "solution", "solution_parameter"),
)
"""All solutions at the requested values, in the order of `at` and along the path."""

_ROUND = (("coordinates", "loop_parameter"),)

LOOP: tuple[FileVariable, ...] = (
    _number("loop_parameter", T, "parameter along the hysteresis loop", _LOOP),
    _index("loop_branch", "stable branch, counted along the loop", _LOOP),
    _number("loop_energy", "J m-1", "total potential energy, per unit thickness", _LOOP, _ROUND),
    _at_node("loop_u_T", "f8", "m", "tangential displacement", "loop_vertex", "loop_parameter"),
    _at_node("loop_xi", "f8", "Pa", "tangential traction -S_T", "loop_vertex", "loop_parameter"),
    _number("jump_parameter", T, "parameter at which the body falls to another branch", _JUMP),
    _index("jump_vertex", "last vertex of the loop before the fall", _JUMP),
    _flag("jump_rising", "whether the parameter was growing", _JUMP, ("falling", "rising")),
    _number("jump_drop", "J m-1", "energy lost in the fall, per unit thickness", _JUMP),
    _number("energy_lost", "J m-1", "energy lost in one loop at the falls, per unit thickness"),
    _number("loop_area", "J m-1", "area of the loop; the energy lost if it is closed"),
    FileVariable("loop_closed", "i1", "1", "whether the loop ends where it began", (), coordinate=True),
    FileVariable("loop_complete", "i1", "1", "whether both ends of the range were reached", (), coordinate=True),
)
"""The quasi-static hysteresis loop: stable branches one after the other and the falls between them."""

_BRANCH, _ON_BRANCH = ("branch",), ("branch_vertex",)
_BY_BRANCH = (("coordinates", "branch_parameter"),)
BRANCHES: tuple[FileVariable, ...] = (
    FileVariable("complete", "i1", "1", "whether these are all branches", (), coordinate=True, extra=flags(*CERTIFIED)),
    _flag("at_complete", "whether the solutions at the value are all", _AT, CERTIFIED),
    _flag("branch_loop", "whether the branch is closed", _BRANCH, ("open", "closed")),
    _flag("branch_on_path", "whether the path goes along it", _BRANCH, ("apart", "on_path")),
    _index("branch_of", "branch that the vertex is on, its vertices in their order", _ON_BRANCH),
    _number("branch_parameter", T, "parameter at the vertex", _ON_BRANCH),
    _number("branch_energy", "J m-1", "total potential energy, per unit thickness", _ON_BRANCH, _BY_BRANCH),
    _flag("branch_stable", "stability of the piece after the vertex, if there is one", _ON_BRANCH, _STABLE),
    _at_node("branch_u_T", "f8", "m", "tangential displacement", "branch_vertex", "branch_parameter"),
    _at_node("branch_xi", "f8", "Pa", "tangential traction -S_T", "branch_vertex", "branch_parameter"),
)
"""Every branch of the range, if they are asked for; a closed one has its first vertex again at its end."""

LINE = tuple(replace(v, coordinate=True) for v in CONTACT if v.dims == ("node",))
"""The contact line, as in the files of runs."""

MESH_LEVEL: tuple[FileVariable, ...] = (
    _index("level", "mesh level, from coarse to fine"),
    _number("h_max", "m", "longest element edge"),
    _index("n_dof", "number of displacement unknowns"),
    _index("n_contact", "number of contact unknowns m"),
)
LEVEL: tuple[FileVariable, ...] = (
    *MESH_LEVEL,
    _index("start", "vertex from which the path was followed in both directions"),
    _number("lambda_1", "Pa m-1", "smallest tangential stiffness of the body per contact length"),
    _number("lambda_1_error", "1", "relative error of lambda_1 by rounding; proofs take the body softer by it"),
    _number("omega", "Pa m-1", "steepest fall of the friction law; infinite if it jumps down"),
    _number("law_error", "1", "error of the law's piecewise-linear stand-in over its scale; 0 where it is exact"),
    _number("affine_defect", "1", "relative deviation of the load from a straight line in the parameter"),
)
"""What there is once."""

PATH = (*LINE, *LEVEL, *CURVE, *SOLUTIONS, *LOOP, *BRANCHES, *JOINTS)
"""Everything that a file of a path may hold."""

_AT_STEP, _STEP_NODE = (SWEEP, "step"), (SWEEP, "step", "node")
_OF_STEP = (("coordinates", "cycle arclength x y"), *JUDGED)


def _of_node(name: str, units: str, long_name: str) -> FileVariable:
    return FileVariable(name, "f8", units, long_name, _STEP_NODE, extra=_OF_STEP)


_PER = "per unit thickness"
_INTEGRAL = f"integral of -S_T over the contact line, {_PER}"
_LOOSE = "0 where only friction holds the body"
_WORK = f"-1/2 (v + v before) dl, summed over parts of the step, {_PER}"
_CLOSURE = f"work - d(energy + stored) - dissipated - released, {_PER}"
_DEBONDED = "where kappa passes the slip at which the law has fallen, linear between nodes; missing where it is nowhere"
STEPS: tuple[FileVariable, ...] = (
    FileVariable("status", "i1", "1", "status of the step", _AT_STEP, extra=STATUS),
    result("energy", "J m-1", "energy of body and loads", f"1/2 v A v - l v at the contact nodes, {_PER}", _AT_STEP),
    result("stored", "J m-1", "energy stored in the bond", _PER, _AT_STEP),
    result(
        "dissipated", "J m-1", "energy dissipated in the step", f"by friction, yielding or damage, {_PER}", _AT_STEP
    ),
    result("work", "J m-1", "work of the loads' change", _WORK, _AT_STEP),
    result("closure", "J m-1", "energy missed by finite steps", _CLOSURE, _AT_STEP),
    result("released", "J m-1", "energy released by jumps", _PER, _AT_STEP),
    result("identity", "1", "defect of energy identity", "relative to its terms; rounding", _AT_STEP),
    result(
        "inclusion_residual", "1", "inclusion residual", "largest distance of -S_T from the law of the step", _AT_STEP
    ),
    result(
        "inclusion_rounding", "1", "inclusion residual of rounding", "what the rounding of doubles allows", _AT_STEP
    ),
    result("friction_resultant", "N m-1", "friction resultant", _INTEGRAL, _AT_STEP),
    result("u_T_max", "m", "largest |u_T|", "tangential displacement on the contact line", _AT_STEP),
    result("slip_length", "m", "length that slipped in the step", dims=_AT_STEP),
    *(replace(v, dims=_AT_STEP, comment=f"{v.comment}, at kappa in place of u_T") for v in REGIONS),
    result("debonded_from", "m", "arclength from which the bond is debonded", _DEBONDED, _AT_STEP),
    result("debonded_to", "m", "arclength up to which the bond is debonded", _DEBONDED, _AT_STEP),
    flag("unique", "only solution of the step", dims=_AT_STEP),
    flag("strict_minimum", "strict local energy minimum", dims=_AT_STEP),
    flag("global_minimum", "least energy of the step", dims=_AT_STEP),
    count("parts", "problems solved, or pieces of the path", _AT_STEP),
    count("iterations", "steps of the solver", _AT_STEP),
    count("jumps", "jumps in the step", _AT_STEP),
)
"""What a history has of every step: a number."""
NODES: tuple[FileVariable, ...] = (
    _of_node("u_T", "m", "tangential displacement"),
    _of_node("xi", "Pa", "tangential traction -S_T"),
    _of_node("kappa", "m", "accumulated or largest slip kappa"),
    _of_node("plastic", "m", "plastic slip"),
    _of_node("dissipation", "J m-2", "energy dissipated in the step, by area"),
    FileVariable("jumped", "i1", "1", "moved by a jump", _STEP_NODE, extra=_OF_STEP, no_value=-1),
)
"""And of every step and node."""
POINTS: tuple[FileVariable, ...] = (
    FileVariable("reason", "str", "", "why the history ended early", (SWEEP,)),
    FileVariable("lambda_1", "f8", "Pa m-1", "tangential stiffness lambda_1", (SWEEP,), comment=_LOOSE),
    FileVariable("lambda_1_error", "f8", "1", "relative error of lambda_1", (SWEEP,), comment="by rounding"),
    FileVariable("margin", "f8", "Pa m-1", "uniqueness margin", (SWEEP,), comment="all steps are unique if positive"),
)
"""And once, of a point of the sweep."""
HISTORY = (*STEPS, *NODES, *POINTS)

P, D, S = ("parameter",), ("row",), ("start",)
_OWN = "in the units of parameter_units"


def _own(name: str, what: str, dims: tuple[str, ...] = P) -> FileVariable:
    return FileVariable(name, "f8", "1", what, dims, comment=_OWN)


FIT = (
    FileVariable("parameter", "str", "", "number that was found", P, coordinate=True),
    FileVariable("parameter_units", "str", "", "its units", P),
    _own("estimate", "estimate"),
    _own("standard_error", "standard error"),
    _own("interval", "95 % interval", (*P, "end")),
    FileVariable("mesh_shift", "f8", "1", "change on a mesh of half the size over the standard error", P),
    _own("parameter_start", "where the search began"),
    _own("parameter_within", "where it could go", (*P, "end")),
    FileVariable("logarithmic", "i1", "1", "found by its logarithm", P, extra=flags("no", "yes")),
    FileVariable("at_bound", "i1", "1", "on a bound", P, extra=flags("no", "yes")),
    FileVariable("covariance", "f8", "1", "covariance, of ln where logarithmic", (*P, "other_parameter"), comment=_OWN),
    FileVariable("singular_value", "f8", "1", "singular values of the Jacobian by ln p", ("direction",)),
    FileVariable("singular_vector", "f8", "1", "their directions in ln p", ("direction", "parameter")),
    FileVariable("measured_column", "i4", "1", "column of the datum", D),
    FileVariable("datum", "f8", "1", "measured value", D, comment="in SI units of its column"),
    FileVariable("datum_given", "f8", "1", "parameter of the load at it", D),
    FileVariable("predicted", "f8", "1", "value of the study", D),
    FileVariable("predicted_given", "f8", "1", "parameter of the load there", D),
    FileVariable("residual", "f8", "1", "residual over its noise", D),
    FileVariable("jacobian", "f8", "1", "residual by parameter, or by its logarithm", (*D, *P)),
    FileVariable("noise", "f8", "1", "standard deviation of the noise", D),
    FileVariable("cost", "f8", "1", "half the sum of squares by evaluation", ("improvement",)),
    FileVariable("start_cost", "f8", "1", "half the sum of squares, by distinct minimum", S),
    FileVariable("start_count", "i4", "1", "starts that end in this minimum", S),
    FileVariable("start_estimate", "f8", "1", "estimate, by distinct minimum", (*S, *P), comment=_OWN),
    FileVariable("start_evaluations", "i4", "1", "evaluations, by distinct minimum", S),
    FileVariable("curve_given", "f8", "1", "parameter of the load along the curve", ("vertex",)),
    FileVariable("curve_measured", "f8", "1", "value of the study along the curve", ("vertex",)),
    FileVariable("curve_error", "f8", "1", "standard error of the curve across it", ("vertex",)),
    FileVariable("fold_vertex", "i4", "1", "vertex of a fold", ("fold",)),
    FileVariable("law_slip", "f8", "m", "slip", ("law_place",)),
    FileVariable("law_traction", "f8", "Pa", "fitted friction law", ("law_place",)),
    FileVariable("law_error", "f8", "Pa", "its standard error", ("law_place",)),
)
"""Everything that a file of a fit may hold. Residuals, and the Jacobian by ln p or by p (`logarithmic`), are in units
of the noise."""
