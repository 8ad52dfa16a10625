"""The file of a load history: one group, a row a sweep point and step (CF-1.11), written again as steps are done.

Step 0 puts the loads of the study as it is written on the virgin body. After the step in which a history ends early
everything is missing, and `reason` says why it ended. `u_T`, `kappa` and `plastic` are all that the next step
remembers, to the bit: a file in which steps are missing is that of a history that was stopped, the same study goes on
from there, and so does one with more steps behind the same ones.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tcstudy.data.files import StoreError
from tcstudy.data.on_request import step_variables
from tcstudy.data.provenance import program
from tcstudy.data.reading import is_foreign, refuse_changed
from tcstudy.data.records import LevelRecord, PointStatus, Row, decode, row_of
from tcstudy.data.schema import BESIDE, DIFFERENCE, JOINTS, REGIONS, FileVariable, region_variables
from tcstudy.data.store import Record, load_root, missing
from tcstudy.data.tables import HISTORY, LINE, MESH_LEVEL
from tcstudy.data.writer import axis_name
from tcstudy.scene.histories import START
from tcstudy.scene.study import Study

Values = dict[str, NDArray[Any]]
"""All steps of all points by variable: (P, N) of a step, (P, N, m) of its nodes, (P,) of a point; filled row by row."""


def variables(study: Study) -> tuple[FileVariable, ...]:
    """The variables of this study's file; what its memory does not have is left out."""
    assert study.history is not None
    without = {v.name for v in REGIONS} - {v.name for v in region_variables(study)}
    without |= {"plastic"} if study.history.memory.stiffness is None else set()
    without |= {"debonded_from", "debonded_to"} if "debonded_length" in without else set()
    without |= {"jumped"} if study.history.branch != "continued" else set()
    return (*(v for v in HISTORY if v.name not in without), *step_variables(study))


def history_bytes(study: Study, m: int) -> int:
    """Size of the file [byte] without compression, with m contact unknowns."""
    assert study.history is not None
    steps, row, own = len(study.scenes) * (study.history.steps + 1), {"step": 1, "node": m}, variables(study)
    numbers = sum(np.dtype(v.dtype).itemsize * row.get(v.dims[-1], 0) for v in own if v.dtype != "str")
    return 60_000 + len(study.text.encode()) + BESIDE * len(own) + steps * numbers


def empty(study: Study, m: int, points: int) -> Values:
    """Nothing is known yet of so many points."""
    assert study.history is not None
    N = study.history.steps + 1
    shapes: dict[str, tuple[int, ...]] = {"step": (points, N), "node": (points, N, m)}
    values = {v.name: missing(v, shapes.get(v.dims[-1], (points,))) for v in variables(study)}
    values["reason"][:] = ""
    return values


def steps_done(values: Values) -> NDArray[np.intp]:
    """(P,) steps that every point has, the one included in which it failed."""
    return np.count_nonzero(values["status"] != PointStatus.NOT_RUN, axis=1)


def at_step(array: NDArray[Any], point: Any, step: Any) -> Any:
    """Where a variable has a step of a point, or the point where that has one value."""
    return point if array.ndim == 1 else (point, step)


def journal_row(values: Values, point: int, step: int) -> Row:
    """A step of a point for the journal."""
    own = {name: np.asarray(every[at_step(every, point, step)]) for name, every in values.items()}
    return row_of("step", str(point), step, {"reason": str(own.pop("reason"))}, own)


def take_row(values: Values, row: Row) -> None:
    """Put a step from the journal where it belongs. Raises ValueError if it belongs nowhere."""
    (scalars, arrays, _), point, step = decode(row), int(row[1]), int(row[2])
    points, steps = values["status"].shape
    if not (0 <= point < points and 0 <= step < steps):
        raise ValueError(f"step {step} of point {point} is outside the history")
    for name, value in {**arrays, **scalars}.items():
        values[name][at_step(values[name], point, step)] = value


def load_variables(study: Study) -> list[tuple[FileVariable, NDArray[Any]]]:
    """Coordinates of the steps: number, name, cycle and every load that changes, with their values (N,)."""
    plan = study.history
    assert plan is not None
    schedule, loads = list(plan.schedule()), plan.loads()
    cycles = np.array([0, *(cycle for *_, cycle in schedule)])
    names = np.array([START, *(name for *_, name, _ in schedule)], dtype=object)
    found: list[tuple[FileVariable, Any]] = [
        (FileVariable("step", "i4", "1", "step", ("step",), coordinate=True), np.arange(len(cycles))),
        (FileVariable("step_name", "str", "", "name of the step", ("step",), coordinate=True), names),
        (FileVariable("cycle", "i4", "1", "cycle, from 1", ("step",), coordinate=True), cycles),
    ]
    taken = {axis_name(axis) for axis in study.axes} | {v.name for v in (*HISTORY, *MESH_LEVEL, *LINE)}
    for name, (keys, units, _) in zip(plan.names, plan.parameters, strict=True):
        extra = DIFFERENCE if units == "K" else ()
        chosen = "_".join(keys) if name in taken else name
        variable = FileVariable(chosen, "f8", units, ".".join(keys), ("step",), coordinate=True, extra=extra)
        found.append((variable, np.array([values[keys] for values in loads])))
    return found


def history_record(study: Study, line: LevelRecord, values: Values) -> Record:
    """All that is known so far."""
    plan, loads = study.history, load_variables(study)
    assert plan is not None
    told: dict[str, str] = {"memory": plan.memory.words, "branch": plan.branch}
    told["loads"] = " ".join(variable.name for variable, _ in loads if variable.dtype == "f8")
    table = (*LINE, *MESH_LEVEL, *JOINTS, *(variable for variable, _ in loads), *variables(study))
    return Record("history", table, {**vars(line), **line.fields, **{v.name: x for v, x in loads}, **values}, told)


def read_known(path: Path, study: Study) -> tuple[Values, dict[str, Any]] | None:
    """What a file knows of the first steps of this study's history, and its attributes; None if there is no such file.

    Raises StoreError where the file has other loads or a history of another program; that its study is this one but for
    its steps is for the caller to judge.
    """
    if not path.is_file() or not path.stat().st_size or is_foreign(path):
        return None
    remedy = "give another --output, or --force to replace it"
    try:
        refuse_changed(path)
        data = load_root(path, "history")
        if data.attrs.get("program") != program():
            raise StoreError(f"{path} holds this study as another version of the program or its libraries computed it")
    except StoreError as error:
        raise StoreError(f"{error}; {remedy}") from error
    points = len(study.scenes)
    values = empty(study, data.sizes["node"], points)
    both = slice(min(values["status"].shape[1], data.sizes["step"]))
    for variable, own in load_variables(study):
        name = variable.name
        if variable.dtype == "f8" and not (name in data and np.array_equal(data[name].values[both], own[both])):
            raise StoreError(f"{path} holds a history with other steps; {remedy}")
    for name, every in values.items():
        stored: NDArray[Any] = data[name].values
        known = stored.reshape((points, *stored.shape[len(study.shape) :]))
        where = at_step(every, slice(None), both)
        every[where] = known[where]
    return values, dict(data.attrs)
