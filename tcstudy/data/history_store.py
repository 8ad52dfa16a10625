"""The file of a load history: one group, a row a sweep point and step (CF-1.11), written again as steps are done.

Step 0 puts the loads of the study as it is written on the virgin body. After the step in which a history ends early
everything is missing, and `reason` says why it ended. `u_T`, `kappa` and `plastic` are all that the next step
remembers, to the bit: a file in which steps are missing is that of a history that was stopped, the same study goes on
from there, and so does one with more steps behind the same ones.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tcstudy.data.files import StoreError
from tcstudy.data.on_request import step_variables
from tcstudy.data.provenance import Provenance, program
from tcstudy.data.reading import is_foreign, refuse_changed
from tcstudy.data.records import LevelRecord, PointStatus, Row, decode, row_of
from tcstudy.data.schema import BESIDE, DIFFERENCE, JOINTS, REGIONS, FileVariable, region_variables
from tcstudy.data.store import Record, load_root, missing, write_record
from tcstudy.data.tables import HISTORY, LINE, MESH_LEVEL
from tcstudy.data.writer import axis_name, in_file_order
from tcstudy.scene.histories import START
from tcstudy.scene.study import Study

Array = NDArray[np.float64]


@dataclass(frozen=True)
class HistoryRecord:
    """All steps of all points, filled row by row.

    values: (P, N) arrays of tables.STEPS, (P, N, m) of NODES and (P,) of POINTS by name, which are attributes as well
    """

    values: dict[str, NDArray[Any]]

    @classmethod
    def empty(cls, points: int, steps: int, m: int, asked: Sequence[FileVariable] = ()) -> HistoryRecord:
        """Nothing is known yet; asked: what there is beside HISTORY."""
        shapes: dict[str, tuple[int, ...]] = {"step": (points, steps), "node": (points, steps, m)}
        every = (*HISTORY, *asked)
        own = {v.name: missing(v, shapes.get(v.dims[-1], (points,))) for v in every}
        own["reason"][:] = ""
        return cls(own)

    def of(self, point: int) -> HistoryRecord:
        """That of one point."""
        return HistoryRecord({name: values[point : point + 1] for name, values in self.values.items()})

    def take(self, point: int, one: HistoryRecord) -> None:
        """Put the record of one point into its row."""
        for name, values in self.values.items():
            values[point] = one.values[name][0]

    def row(self, point: int, step: int) -> Row:
        """A step of a point for the journal."""
        own = {name: all_[point if all_.ndim == 1 else (point, step)] for name, all_ in self.values.items()}
        reason = {"reason": str(own.pop("reason"))}
        return row_of("step", str(point), step, reason, {name: np.asarray(value) for name, value in own.items()})

    def take_row(self, row: Row) -> None:
        """Put a step from the journal where it belongs. Raises ValueError if it belongs nowhere."""
        scalars, arrays, _ = decode(row)
        point, step = int(row[1]), int(row[2])
        if not (0 <= point < self.status.shape[0] and 0 <= step < self.status.shape[1]):
            raise ValueError(f"step {step} of point {point} is outside the history")
        self.reason[point] = str(scalars["reason"])
        for name, value in arrays.items():
            kept = self.values[name]
            kept[point if kept.ndim == 1 else (point, step)] = value

    def __getattr__(self, name: str) -> NDArray[Any]:
        try:
            return self.__dict__["values"][name]
        except KeyError as error:
            raise AttributeError(name) from error


def variables(study: Study) -> tuple[FileVariable, ...]:
    """The variables of this study's file; what its memory does not have is left out."""
    assert study.history is not None
    name, jumping = study.history.memory.name, study.history.branch == "continued"
    without = {v.name for v in REGIONS} - {v.name for v in region_variables(study)}
    without |= {"plastic"} if name != "elastic-plastic" else set()
    own = (v for v in HISTORY if v.name not in without and (jumping or v.name != "jumped"))
    return (*own, *step_variables(study))


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


def write_history(path: Path, study: Study, line: LevelRecord, record: HistoryRecord, provenance: Provenance) -> None:
    """Write all that is known so far to `path`, replacing an old file in one step; raises StoreError."""
    plan = study.history
    assert plan is not None
    loads = load_variables(study)
    told: dict[str, str] = {"memory": plan.memory.name, "branch": plan.branch}
    told["loads"] = " ".join(variable.name for variable, _ in loads if variable.dtype == "f8")
    table = (*LINE, *MESH_LEVEL, *JOINTS, *(variable for variable, _ in loads), *variables(study))
    values = {**vars(line), **line.fields, **{v.name: values for v, values in loads}, **record.values}
    write_record(path, study, Record("history", table, values, told), provenance)


def read_known(path: Path, study: Study, steps: int) -> tuple[HistoryRecord, dict[str, Any]] | None:
    """What a file knows of the first steps of this study's history, and its attributes; None if there is no such file.

    steps: of the history, step 0 included. Raises StoreError where the file has other loads or a history of another
    program; that its study is this one but for its steps is for the caller to judge.
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
    both = min(steps, data.sizes["step"])
    for variable, values in load_variables(study):
        if variable.dtype == "f8" and not (
            variable.name in data and np.array_equal(data[variable.name].values[:both], values[:both])
        ):
            raise StoreError(f"{path} holds a history with other steps; {remedy}")
    return _record(data, study, steps, both), dict(data.attrs)


def _record(data: Any, study: Study, steps: int, both: int) -> HistoryRecord:
    points = len(study.scenes)
    order = np.argsort(in_file_order(study, np.arange(points).reshape(study.shape)).ravel(), kind="stable")
    record = HistoryRecord.empty(points, steps, data.sizes["node"], step_variables(study))
    for variable in variables(study):
        stored: NDArray[Any] = data[variable.name].values
        values = stored.reshape((points, *stored.shape[len(study.shape) :]))[order]
        where = (slice(None), slice(both)) if variable.dims[-1] in ("step", "node") else ()
        record.values[variable.name][where] = values[where]
    return record


def steps_done(record: HistoryRecord) -> NDArray[np.intp]:
    """(P,) steps that every point has, the one included in which it failed."""
    return np.count_nonzero(record.status != PointStatus.NOT_RUN, axis=1)
