"""Look up what a result file has of a study before any work: where it lies, whether it is complete,
and which points stay.

A finished study is answered from here. Neither the mesher nor a solver is imported: their imports
take longer than the answer.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import ExitStack
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from tcstudy.data.bodies import StoredBody
from tcstudy.data.files import PARTIAL, Kind, holds
from tcstudy.data.reading import opened, places_in, read_blocks, read_level
from tcstudy.data.records import BlockRecord, LevelRecord
from tcstudy.data.schema import PointStatus
from tcstudy.errors import StoreError, UsageError
from tcstudy.scene.study import Study

if TYPE_CHECKING:
    import netCDF4

RUNS = 5
"""Runs of each setting in a file of costs, after a first one that is not counted."""


def output_of(study: Study, kind: Kind = "run") -> Path:
    """Return where a file of this kind is written unless another path is given.

    That is results/<name of the study file>.nc for a run, and beside it for other kinds.
    """
    stem = study.source.stem if study.source is not None else "study"
    output = study.output.path or Path("results") / f"{stem}.nc"
    if kind == "run":
        return output
    if kind in ("convergence", "cost"):
        return output.with_name(f"{output.stem}.{kind}.nc")
    return output.with_name(f"{output.stem}-{kind}{output.suffix or '.nc'}")


def check_kind(study: Study, kind: str, name: str) -> None:
    """Raise UsageError where a command does not suit a study.

    A history is no set of static points. A path is of one mesh, and adaptive meshes follow from the
    points of a run.
    """
    if study.history is not None and kind not in ("history", "fit"):
        command = "converge" if kind == "convergence" else kind
        raise UsageError(
            f"{name}: history: the study is a load history, and tcstudy {command} has no memory; "
            "use tcstudy run, or --set history=null for its points without memory"
        )
    if kind in ("convergence", "cost") and study.path is not None:
        command = "converge" if kind == "convergence" else kind
        raise UsageError(
            f"{name}: path: tcstudy {command} compares single points, not a path; "
            "run the path with "
            "--set path.level=0 and higher levels and compare its peaks, or use --set path=null "
            "for the points at the loads of the study"
        )
    if kind == "path" and study.path is not None and study.mesh.strategy.adapts:
        raise UsageError(
            f"{name}: path: the path is of one mesh, and adaptive meshes follow from the solutions "
            "of a run; give it others, for example --set 'mesh={maxh: ..., levels: 3}', or solve "
            "points by --set path=null"
        )


@dataclass(frozen=True, eq=False)
class Kept:
    """What a finished file has of a study, and what is still to be solved.

    todo:   (P, levels) points that are not there, or broke down unexpectedly
    path:   of the file
    stored: the study of the file; None where nothing is kept
    """

    study: Study
    todo: NDArray[np.bool_]
    path: Path = Path()
    stored: Study | None = None

    @classmethod
    def of(cls, path: Path, stored: Study, study: Study) -> Kept:
        """Return what a file keeps.

        Points that the solver reported as failed stay, because they would fail again. All points
        stay on meshes that follow from solutions.
        """
        with opened(path) as nc:
            status = nc["status"][...]
        is_open = np.isin(status, (PointStatus.NOT_RUN, PointStatus.ERROR))
        if study.mesh.open_ended:
            is_open[...] = False
        todo = np.ones((len(study.scenes), study.mesh.levels), dtype=bool)
        todo[places_in(study, stored)] = is_open.reshape(-1, is_open.shape[-1])
        return cls(study, todo, path, stored)

    @classmethod
    def none(cls, study: Study) -> Kept:
        """Return that nothing is kept."""
        return cls(study, np.ones((len(study.scenes), study.mesh.levels), dtype=bool))

    @cached_property
    def _file(self) -> ExitStack:
        return ExitStack()

    @cached_property
    def _stored(self) -> tuple[netCDF4.Dataset, Study] | None:
        """The open file and its study."""
        if self.stored is None:
            return None
        return self._file.enter_context(opened(self.path)), self.stored

    @cached_property
    def _bodies(self) -> dict[int, tuple[StoredBody, Study]]:
        """Bodies of the study that the file has, as they are there, and their studies there."""
        if self._stored is None:
            return {}
        nc, stored_study = self._stored
        if not self.study.variants:
            return {0: (StoredBody.of(nc), stored_study)}
        geometry_of_point = np.full(len(self.study.scenes), -1)  # in the file; −1 for none
        geometry_of_point[places_in(self.study, stored_study)] = nc["geometry"][...].ravel()
        bodies = dict[int, tuple[StoredBody, Study]]()
        for i, body in enumerate(self.study.bodies):
            number = int(geometry_of_point[body.places].max())
            geometry = stored_study.bodies[number].study if number >= 0 else None
            if geometry is not None:
                bodies[i] = StoredBody.of(nc, number), geometry
        return bodies

    def levels(self, number: int) -> list[LevelRecord]:
        """Return the levels of a body of the study, as a run found them."""
        if number not in self._bodies:
            return []
        stored_body, _ = self._bodies[number]
        return [read_level(stored_body, level) for level in stored_body.levels]

    def blocks(self, number: int) -> Iterator[BlockRecord]:
        """Yield the points of a body that stay."""
        body = self.study.bodies[number]
        if number in self._bodies and body.study is not None:
            stored_body, stored_study = self._bodies[number]
            places = places_in(body.study, stored_study)
            yield from read_blocks(stored_body, body.study, places, ~self.todo[body.places])

    def before(self, attributes: Mapping[str, Any]) -> Mapping[str, Any]:
        """Return the attributes of a run, with the file's history before its own."""
        if self._stored is None:
            return attributes
        nc, _ = self._stored
        history = f"{nc.getncattr('history')}\n{attributes['history']}"
        return {**attributes, "history": history}

    def close(self) -> None:
        """Close the file, which stays open after its first use.

        Opening a file of version 0.8 with many geometries takes long.
        """
        self._file.close()


def what_is_left(study: Study, output: Path, force: bool, append: bool) -> tuple[Study, Kept]:
    """Return the study of the whole file, and what the file keeps of it.

    append: the file may have other points of the study, which stay
    Raises StoreError if it contains something else.
    """
    if append:
        from tcstudy.study.append import appended  # which reads the study of the file again

        old, study = appended(output, study)
        return study, Kept.of(output, old, study)
    if not force and holds(output, "run", study):
        return study, Kept.of(output, study, study)
    return study, Kept.none(study)


def is_finished(study: Study, kind: Kind, output: Path, **decisive: object) -> bool:
    """Return whether a file has all results of this kind of a study.

    decisive: global attributes that options decide (`data.files.holds`)

    False for a file that contains something else, or is damaged: the writer reports that. False
    also for a file with a journal beside it, which the writer uses or removes.
    """
    try:
        if output.with_name(output.name + PARTIAL).exists():
            return False
        if not holds(output, kind, study, **decisive):
            return False
    except (OSError, StoreError):  # for example a name that the system does not take
        return False
    if kind == "run":
        return not Kept.of(output, study, study).todo.any()
    if kind == "history":
        with opened(output) as nc:
            return not np.any(nc["reason"][...] != "")
    return True
