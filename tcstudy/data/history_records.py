"""What stands in the file of a load history: one group, a row for each sweep point and step (CF-1.11).

Step 0 puts the loads of the study as it is written on the virgin body. After the step in which a history ends early
everything is missing, and `reason` says why it ended. `u_T`, `kappa` and `plastic` are all that the next step
remembers, to the bit, so that a history can be continued from its file.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, fields
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tcstudy.data.path_records import LINE
from tcstudy.data.schema import BESIDE, CERTIFIED, DIFFERENCE, MISSING_COUNT, STATUS, SWEEP, FileVariable
from tcstudy.data.writer import axis_name
from tcstudy.scene.histories import START
from tcstudy.scene.study import Study

__all__ = ["LINE", "HistoryRecord", "load_variables", "variables"]

Array = NDArray[np.float64]


@dataclass
class HistoryRecord:
    """All steps of all points: arrays (P, N), at nodes (P, N, m), filled row by row; meanings are those of STEPS.

    reason: (P,) why a history ended early, empty if it did not
    lambda_1, margin: (P,) of the body, and of the body with its memory
    """

    status: NDArray[np.int8]
    energy: Array
    stored: Array
    dissipated: Array
    work: Array
    closure: Array
    released: Array
    identity: Array
    inclusion_residual: Array
    inclusion_rounding: Array
    friction_resultant: Array
    u_T_max: Array
    slip_length: Array
    unique: NDArray[np.int8]
    strict_minimum: NDArray[np.int8]
    global_minimum: NDArray[np.int8]
    parts: NDArray[np.int32]
    iterations: NDArray[np.int32]
    jumps: NDArray[np.int32]
    u_T: Array
    xi: Array
    kappa: Array
    plastic: Array
    jumped: NDArray[np.int8]
    reason: list[str]
    lambda_1: Array
    margin: Array

    @classmethod
    def empty(cls, points: int, steps: int, m: int) -> HistoryRecord:
        """Nothing is known yet."""
        made: dict[str, Any] = {"reason": [""] * points}
        for variable in (*STEPS, *NODES, *POINTS):
            shape = {"step": (points, steps), "node": (points, steps, m)}.get(variable.dims[-1], (points,))
            if variable.dtype != "str":
                made[variable.name] = np.full(shape, variable.missing, dtype=variable.dtype)
        return cls(**made)

    def of(self, point: int) -> HistoryRecord:
        """That of one point."""
        return HistoryRecord(**{one.name: getattr(self, one.name)[point : point + 1] for one in fields(self)})

    def take(self, point: int, one: HistoryRecord) -> None:
        """Put the record of one point into its row."""
        for row in fields(self):
            getattr(self, row.name)[point] = getattr(one, row.name)[0]

    def arrays(self) -> Iterator[tuple[str, NDArray[Any]]]:
        """(name, array) of all that has a row a point."""
        for one in fields(self):
            value = getattr(self, one.name)
            yield one.name, np.array(value, dtype=object) if one.name == "reason" else value


_STEP, _NODE = (SWEEP, "step"), (SWEEP, "step", "node")
_AT = (("coordinates", "cycle arclength x y"), ("ancillary_variables", "status"))
_JUDGED = (("ancillary_variables", "status"),)
_COUNT = (("valid_min", np.int32(0)), ("comment", f"{MISSING_COUNT} where there is no value"))


def _number(name: str, units: str, long_name: str, comment: str = "", dims: tuple[str, ...] = _STEP) -> FileVariable:
    told = (("comment", comment),) if comment else ()
    return FileVariable(name, "f8", units, long_name, dims, extra=told + (_JUDGED if dims == _STEP else ()))


def _count(name: str, long_name: str) -> FileVariable:
    return FileVariable(name, "i4", "1", long_name, _STEP, extra=_COUNT + _JUDGED)


def _flag(name: str, long_name: str) -> FileVariable:
    return FileVariable(name, "i1", "1", long_name, _STEP, extra=(*CERTIFIED, *_JUDGED))


def _node(name: str, units: str, long_name: str) -> FileVariable:
    return FileVariable(name, "f8", units, long_name, _NODE, extra=_AT)


_PER = "per unit thickness"
STEPS: tuple[FileVariable, ...] = (
    FileVariable("status", "i1", "1", "status of the step", _STEP, extra=STATUS),
    _number("energy", "J m-1", "energy of body and loads", f"1/2 v A v - l v at the contact nodes, {_PER}"),
    _number("stored", "J m-1", "energy stored in the bond", _PER),
    _number("dissipated", "J m-1", "energy dissipated in the step", f"by friction, yielding or damage, {_PER}"),
    _number(
        "work", "J m-1", "work of the loads' change", f"-1/2 (v + v before) dl, summed over parts of the step, {_PER}"
    ),
    _number(
        "closure",
        "J m-1",
        "energy missed by finite steps",
        f"work - d(energy + stored) - dissipated - released, {_PER}",
    ),
    _number("released", "J m-1", "energy released by jumps", _PER),
    _number("identity", "1", "defect of energy identity", "relative to its terms; rounding"),
    _number("inclusion_residual", "1", "inclusion residual", "largest distance of -S_T from the law of the step"),
    _number("inclusion_rounding", "1", "inclusion residual of rounding", "what the rounding of doubles allows"),
    _number("friction_resultant", "N m-1", "friction resultant", f"integral of -S_T over the contact line, {_PER}"),
    _number("u_T_max", "m", "largest |u_T|", "tangential displacement on the contact line"),
    _number("slip_length", "m", "length that slipped in the step"),
    _flag("unique", "only solution of the step"),
    _flag("strict_minimum", "strict local energy minimum"),
    _flag("global_minimum", "least energy of the step"),
    _count("parts", "problems solved, or pieces of the path"),
    _count("iterations", "steps of the solver"),
    _count("jumps", "jumps in the step"),
)
"""Variables of HistoryRecord with a number a step."""
NODES: tuple[FileVariable, ...] = (
    _node("u_T", "m", "tangential displacement"),
    _node("xi", "Pa", "tangential traction -S_T"),
    _node("kappa", "m", "accumulated or largest slip kappa"),
    _node("plastic", "m", "plastic slip"),
    FileVariable("jumped", "i1", "1", "moved by a jump", _NODE, extra=(*CERTIFIED[:0], *_AT), no_value=-1),
)
"""Variables of HistoryRecord with a number a step and node."""
POINTS: tuple[FileVariable, ...] = (
    FileVariable("reason", "str", "", "why the history ended early", (SWEEP,)),
    _number("lambda_1", "Pa m-1", "tangential stiffness lambda_1", "0 where only friction holds the body", (SWEEP,)),
    _number("margin", "Pa m-1", "uniqueness margin", "all steps are unique if positive", (SWEEP,)),
)
"""Variables of HistoryRecord with a value a point."""
LEVEL: tuple[FileVariable, ...] = (
    FileVariable("level", "i4", "1", "mesh level, from coarse to fine", (), coordinate=True),
    FileVariable("h_max", "f8", "m", "longest element edge", (), coordinate=True),
    FileVariable("n_dof", "i4", "1", "displacement unknowns", (), coordinate=True),
    FileVariable("n_contact", "i4", "1", "contact unknowns m", (), coordinate=True),
)


def variables(study: Study) -> tuple[FileVariable, ...]:
    """The variables of this study's file; what its memory does not have is left out."""
    assert study.history is not None
    name, jumping = study.history.memory.name, study.history.branch == "continued"
    without = {"plastic"} if name != "elastic-plastic" else set()
    return tuple(v for v in (*STEPS, *NODES, *POINTS) if v.name not in without and (jumping or v.name != "jumped"))


def history_bytes(study: Study, m: int) -> int:
    """Size of the file [byte] without compression, with m contact unknowns."""
    assert study.history is not None
    steps, row = len(study.scenes) * (study.history.steps + 1), {"step": 1, "node": m}
    own = variables(study)
    numbers = sum(np.dtype(v.dtype).itemsize * row.get(v.dims[-1], 0) for v in own if v.dtype != "str")
    return 60_000 + len(study.text.encode()) + BESIDE * len(own) + steps * numbers


def load_variables(study: Study) -> list[tuple[FileVariable, Array]]:
    """Coordinates of the steps: number, name, cycle and every load that changes, with their values (N,)."""
    plan = study.history
    assert plan is not None
    schedule, stations = list(plan.schedule()), plan.stations()
    cycles = np.array([0, *(cycle for *_, cycle in schedule)])
    names = np.array([START, *(name for *_, name, _ in schedule)], dtype=object)
    found: list[tuple[FileVariable, Any]] = [
        (FileVariable("step", "i4", "1", "step", ("step",), coordinate=True), np.arange(len(cycles))),
        (FileVariable("step_name", "str", "", "name of the step", ("step",), coordinate=True), names),
        (FileVariable("cycle", "i4", "1", "cycle, from 1", ("step",), coordinate=True), cycles),
    ]
    taken = {axis_name(axis) for axis in study.axes} | {v.name for v in (*STEPS, *NODES, *POINTS, *LEVEL, *LINE)}
    for name, (keys, units, _) in zip(plan.names, plan.parameters, strict=True):
        at = [station[keys] for station in stations]
        values = [at[0], *(at[i] if share == 0.0 else at[j] if share == 1.0 else at[i] + share * (at[j] - at[i])
                           for i, j, share, *_ in schedule)]  # fmt: skip
        extra = DIFFERENCE if units == "K" else ()
        chosen = "_".join(keys) if name in taken else name
        variable = FileVariable(chosen, "f8", units, ".".join(keys), ("step",), coordinate=True, extra=extra)
        found.append((variable, np.array(values)))
    return found
