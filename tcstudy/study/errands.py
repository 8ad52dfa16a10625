"""Work that a worker builds from the study: a geometry with its meshes and all points, or its forecast alone.

The study travels as plain data, and the file of a body as its content, so that a worker needs no files. It makes mesh
and matrices itself, solves all blocks as a run of one process does, and sends the records back; who asked writes them.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from tcstudy.data.records import BlockRecord, LevelRecord
from tcstudy.errors import GeometryFailed
from tcstudy.executors import Errand, WorkerDied, in_order, unpacked
from tcstudy.scene.points import Scenes
from tcstudy.scene.study import Study
from tcstudy.study.doubts import built_faults
from tcstudy.study.expected import counting
from tcstudy.study.jobs import Staff
from tcstudy.study.plan import Plan, plan
from tcstudy.study.run import run

PATIENCE, SLOW = 600.0, 50.0
"""Seconds after which a worker counts as hanging at least, and how many times the forecast it may take."""


def errand(function: Callable[..., object], study: Study, *given: object, name: str, seconds: float = 0.0) -> Errand:
    """A call of function(study, *given) for a worker anywhere; seconds: that it is expected to take."""
    brep = study.scenes[0].body.brep
    content = brep.path.read_bytes() if brep is not None else None
    patience = max(PATIENCE, SLOW * seconds)
    return Errand.of(_with_file, content, function, study, *given, name=name, patience=patience)


def _with_file(content: bytes | None, function: Callable[..., Any], study: Study, *given: object) -> Any:
    """Call it with a study whose body is read from the content of its file, if it has one."""
    if content is None:
        return function(study, *given)
    with TemporaryDirectory(prefix="tcstudy-") as folder:
        body = study.scenes[0].body
        assert body.brep is not None
        path = Path(folder, body.brep.path.name)
        path.write_bytes(content)
        own = replace(body, brep=replace(body.brep, path=path))
        return function(replace(study, scenes=Scenes.of(study.scenes).on(own)), *given)


def solve_geometry(study: Study) -> list[LevelRecord | BlockRecord]:
    """All records of the run of a study with one geometry, in their order. Raises GeometryFailed."""
    for keys, what, remedy in built_faults(study):
        raise GeometryFailed(f"{what}; {remedy}", tuple(map(str, keys)))
    return list(run(study))


START = 2.0
"""Seconds that a worker needs before it can make a mesh."""


def plans(studies: Sequence[Study], staff: Staff) -> Iterator[Plan]:
    """The forecasts of geometries in their order, whose meshes workers make where that pays.

    Raises GeometryFailed, WorkersFailed.
    """
    expected = [counting(study) for study in studies] if len(studies) > 1 else []
    who = staff.errands(expected, START)
    if who is None:
        yield from map(plan, studies)
        return
    pairs = zip(studies, expected, strict=True)
    sent = (errand(plan, study, name="plan", seconds=one.seconds) for study, one in pairs)
    for answer in in_order(who, sent):
        try:
            yield unpacked(answer)
        except WorkerDied as error:
            raise GeometryFailed(
                f"a geometry of the sweep cannot be meshed ({error}); plan it alone", ("sweep",)
            ) from error
