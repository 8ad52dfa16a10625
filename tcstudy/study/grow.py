"""Finished files that grow: points are added to them, those that broke down are solved again.

What a file has is read back as records and written again, to the bit; in a sweep over geometries every geometry is
taken out of the file, grows by itself, and goes back. Not here: what makes two studies one but for their sweep
(`study.union`), solving (`study.run`), reading files (`data.stored`).
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from hashlib import sha256
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from tcstudy.data.provenance import Provenance, program, study_sha256
from tcstudy.data.reading import attributes, refuse_changed
from tcstudy.data.records import BlockRecord, LevelRecord, PointStatus
from tcstudy.data.stored import digest, read_blocks, read_geometries, read_levels, read_status
from tcstudy.data.variants import extract
from tcstudy.data.writer import file_places
from tcstudy.errors import StoreError, StudyError, shortened
from tcstudy.read.study import read_study_text
from tcstudy.scene.study import Study
from tcstudy.study.shared_points import places_in
from tcstudy.study.union import differences, union

Places = NDArray[np.intp]
Label = float | str


@dataclass(frozen=True)
class StoredRun:
    """A finished run's file and the study that it holds; name: of the file, or of what was taken out of it."""

    path: Path
    study: Study
    history: str
    name: str

    @cached_property
    def status(self) -> NDArray[np.int8]:
        """(P, levels) in the order of the file."""
        return read_status(self.path)

    @cached_property
    def geometry(self) -> Places:
        """(P,) number of the geometry of every point, −1 for none."""
        return read_geometries(self.path)

    def places_in(self, study: Study) -> Places:
        """(P,) where the points of the file, in its order, stand in the sweep of a study that has them all."""
        places = np.empty(len(self.status), dtype=np.intp)
        places[file_places(self.study, np.arange(len(places)))] = places_in(study, self.study)
        return places


def stored_run(path: Path, source: Path | None = None) -> StoredRun:
    """A run's file with its study. source: file of a study beside which its geometry lies, if any.

    Raises StoreError if it is no run, was computed by another version, or if its study cannot be read again.
    """
    found = attributes(path)
    refuse_changed(path)
    if "content" in found or "reference" in found:
        raise StoreError(f"{path} holds results of another command; name the file of a run")
    if found.get("program") != program():
        what = "was computed by another version of the program or its libraries"
        raise StoreError(f"{path} {what}; run its study again with --force")
    overrides = tuple(filter(None, str(found["overrides"]).split("\n")))
    try:
        study = read_study_text(str(found["study_yaml"]), str(path), overrides, source)
    except StudyError as error:
        what = shortened(str(error).splitlines()[0], 300)
        raise StoreError(
            f"the study in {path} cannot be read again ({what}); a geometry must be in its place"
        ) from error
    if study.scenes[0].body.brep is not None and study_sha256(study) != found["study_sha256"]:
        raise StoreError(f"{path} was computed for another geometry file; run its study again with --force")
    if study.mesh.open_ended:
        why = "its meshes follow from the solutions at all points of its sweep"
        raise StoreError(f"{path} cannot be added to or mended: {why}; run the whole study with --force")
    return StoredRun(path, study, str(found["history"]), str(path))


@dataclass(frozen=True, eq=False)
class Kept:
    """What a finished file has of a study, and what is still to be solved.

    places: (P of the file,) where its points stand in the study;  todo: (points of the study, levels)
    mark:   by which journals know that they go on from this file; that of the file of all geometries for one of them
    """

    file: StoredRun
    places: Places
    todo: NDArray[np.bool_]
    mark: str = ""

    @cached_property
    def levels(self) -> dict[int, LevelRecord]:
        """The levels that the file has, by number."""
        return read_levels(self.file.path) if len(self.places) else {}

    @cached_property
    def digest(self) -> str:
        """By which a journal knows that it went on from this file."""
        return self.mark or digest(self.file.path)

    def blocks(self, study: Study, level: int | None = None) -> Iterator[BlockRecord]:
        """The points that are not solved again, of one level or of all."""
        wanted = ~self.todo
        if level is not None:
            wanted &= np.arange(self.todo.shape[1]) == level
        return read_blocks(self.file.path, study, self.places, wanted) if len(self.places) else iter(())

    def of_geometries(self, study: Study, folder: Path) -> list[Kept]:
        """The same of every geometry of the study; those that the file has are taken out of it, into the folder."""
        mark = sha256(self.digest.encode() + np.packbits(self.todo).tobytes()).hexdigest()
        numbers = np.full(len(study.scenes), -1, dtype=np.intp)
        numbers[self.places] = self.file.geometry
        found = [int(numbers[variant.places].max(initial=-1)) for variant in study.variants]
        files = {number: folder / f"{mark[:16]}-{number}-before.nc" for number in found if number >= 0}
        extract(self.file.path, files)
        kept = []
        for variant, number in zip(study.variants, found, strict=True):
            run, places = self.file, np.zeros(0, dtype=np.intp)
            own = self.file.study.variants[number].study if number >= 0 else None
            if own is not None and variant.study is not None:
                history = str(attributes(files[number])["history"])
                run = StoredRun(files[number], own, history, f"{self.file.name} ({variant.words})")
                places = run.places_in(variant.study)
            kept.append(Kept(run, places, self.todo[variant.places], mark))
        return kept

    def without_geometry(self, study: Study) -> list[BlockRecord]:
        """The points that are not solved again and whose geometry has no mesh."""
        wanted = ~self.todo
        wanted[self.places[self.file.geometry >= 0]] = False
        return list(read_blocks(self.file.path, study, self.places, wanted))

    def with_levels(self, new: Sequence[LevelRecord]) -> tuple[LevelRecord, ...]:
        """The levels of the file and those of the journal, coarse to fine."""
        levels = self.levels | {level.level: level for level in new}
        return tuple(levels[i] for i in sorted(levels))

    def before(self, provenance: Provenance) -> Provenance:
        """The provenance with the file's history before it."""
        history = f"{self.file.history}\n{provenance.history}"
        return replace(provenance, history=history) if len(self.places) else provenance

    def joined(self, record: LevelRecord) -> LevelRecord:
        """The file's record of a level, with what a page needs of all points. Raises StoreError for another mesh."""
        old = self.levels.get(record.level)
        if old is None:
            return record
        same = old.n_dof == record.n_dof and all(
            np.array_equal(getattr(old, name), getattr(record, name)) for name in ("arclength", "x", "y", "c", "edge")
        )
        if not same:
            what = f"the mesh of level {record.level} is not that of {self.file.name}, whose points stay"
            raise StoreError(f"{what}; run the whole study with --force")
        return replace(old, fields=record.fields)


def appended(path: Path, new: Study) -> tuple[Study, Kept]:
    """The study with the points of a finished file and of `new`, and what the file has of it.

    Raises StoreError if they differ in more than the sweep.
    """
    file = _file_of(path, new)
    return _asked(file, union(file.study, new), new, again=file.status == PointStatus.NOT_RUN)


def all_but_broken(path: Path, study: Study) -> Kept | None:
    """What the file of this very study has without the points that broke down unexpectedly; None if none did.

    What failed by its own numbers would fail again; on meshes that follow from the solutions all points stay.
    """
    if study.mesh.open_ended or not (broken := read_status(path) == PointStatus.ERROR).any():
        return None
    return _asked(stored_run(path, study.source), study, study, again=broken)[1]


def _file_of(path: Path, new: Study) -> StoredRun:
    """The file of a study that differs in its sweep alone."""
    file = stored_run(path, new.source)
    if found := differences(file.study, new):
        remedy = "give another --output, or --force to compute all anew"
        raise StoreError(f"{path} holds another study, not only another sweep ({'; '.join(found[:5])}); {remedy}")
    return file


def _asked(file: StoredRun, study: Study, new: Study, again: NDArray[np.bool_]) -> tuple[Study, Kept]:
    """The study, of which the points of `new` are asked for; again: (P of the file, levels) those that it has not."""
    places = file.places_in(study)
    todo = np.zeros((len(study.scenes), study.mesh.levels), dtype=bool)
    todo[places_in(study, new)] = True
    todo[places] &= again
    return study, Kept(file, places, todo)
