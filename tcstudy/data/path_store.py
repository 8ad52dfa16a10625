"""The file of a path: one group, vertices and pieces of one polygon (CF-1.11), complete or not there at all.

`parameter`, `u_T` and `xi` hold the vertices exactly, so that every point between two vertices is their linear
combination; piece i lies between the vertices i and i + 1. Flags are bytes with flag_meanings; nothing is missing.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from tcstudy.data.files import write_dataset
from tcstudy.data.provenance import CONTENT, SHORTFALLS, Provenance, global_attributes, without_paths
from tcstudy.data.reading import attributes
from tcstudy.data.records import LevelRecord
from tcstudy.data.schema import CERTIFIED, CONTACT, RATE, FileVariable, T, flags
from tcstudy.data.writer import put_all, put_edges
from tcstudy.scene.contact_states import ContactState
from tcstudy.scene.study import Study

if TYPE_CHECKING:
    import netCDF4

Values = Mapping[str, Any]


@dataclass(frozen=True)
class PathRecord:
    """A study's path on a mesh level; values by name, whose shapes, units and meanings are those of the tables below.

    curve:      the polygon of solutions with k vertices and k − 1 pieces, and lists beside it; see CURVE
    start:      vertex from which the path was followed
    begin, end: why it ends at the first and at the last vertex: (name of the status, sentence)
    solutions:  all solutions on the path at the requested values, in the order of `at` and along the path
    loop:       the quasi-static hysteresis loop: stable branches one after the other and the falls between them
    branches:   every branch of the range where they are asked for;  complete_reason: why not proved to be all, if so
    The rest is in LEVEL.
    """

    line: LevelRecord
    curve: Values
    start: int
    begin: tuple[str, str]
    end: tuple[str, str]
    solutions: Values
    loop: Values | None
    lambda_1: float
    lambda_1_error: float
    omega: float
    law_error: float
    affine_defect: float
    branches: Values | None = None
    complete_reason: str = ""


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
"""Of `PathRecord.curve`."""

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
"""Of `PathRecord.solutions`; solution_parameter is at[solution_at]."""

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
"""Of `PathRecord.loop`, which has loop_reason, a text, beside these."""

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
"""Of `PathRecord.branches`; a closed branch has its first vertex again at its end."""

LINE = tuple(replace(v, coordinate=True) for v in CONTACT if v.dims == ("node",))
"""The contact line, as in the files of runs."""

LEVEL: tuple[FileVariable, ...] = (
    _index("level", "mesh level, from coarse to fine"),
    _number("h_max", "m", "longest element edge"),
    _index("n_dof", "number of displacement unknowns"),
    _index("n_contact", "number of contact unknowns m"),
    _index("start", "vertex from which the path was followed in both directions"),
    _number("lambda_1", "Pa m-1", "smallest tangential stiffness of the body per contact length"),
    _number("lambda_1_error", "1", "relative error of lambda_1 by rounding; proofs take the body softer by it"),
    _number("omega", "Pa m-1", "steepest fall of the friction law; infinite if it jumps down"),
    _number("law_error", "1", "error of the law's piecewise-linear stand-in over its scale; 0 where it is exact"),
    _number("affine_defect", "1", "relative deviation of the load from a straight line in the parameter"),
)
"""What there is once."""


def write_path(
    path: Path, study: Study, record: PathRecord, provenance: Provenance, shortfalls: Sequence[str] = ()
) -> None:
    """Write a path to `path`, replacing an old file in one step; raises StoreError if that is not possible.

    shortfalls: what is not as it was asked for, in words
    """
    plan, line, solutions = study.path, record.line, record.solutions
    assert plan is not None
    parts: list[tuple[tuple[FileVariable, ...], Values]] = [
        (LINE, vars(line)),
        (LEVEL, {**vars(line), **vars(record)}),
        (CURVE, record.curve),
        (SOLUTIONS, {**solutions, "solution_parameter": solutions["at"][solutions["solution_at"]]}),
    ]
    told = {
        SHORTFALLS: without_paths("\n".join(shortfalls)),
        CONTENT: "path",
        "parameter": plan.name,
        "parameter_range": np.array([plan.begin, plan.end]),
        "parameter_within": np.array(plan.within),
        "begin_status": record.begin[0],
        "begin_reason": record.begin[1],
        "end_status": record.end[0],
        "end_reason": record.end[1],
    }
    if record.loop is not None:
        parts.append((LOOP, record.loop))
        told["loop_reason"] = without_paths(record.loop["loop_reason"])

    if record.branches is not None:
        parts.append((BRANCHES, record.branches))
        told["complete_reason"] = without_paths(record.complete_reason)

    def fill(nc: netCDF4.Dataset) -> None:
        for variables, values in parts:
            put_all(nc, variables, values, study)
        put_edges(nc, line, study)

    write_dataset(path, global_attributes(study, provenance) | told, fill)


def stored_shortfalls(path: Path) -> list[str]:
    """What the file says of a path that is not as it was asked for. Raises StoreError."""
    return [line for line in str(attributes(path).get(SHORTFALLS, "")).split("\n") if line]
