"""Which points of a level are solved together, and what is recorded of them.

A block depends on the study and on the size of the contact line alone, so that a run that was stopped, or that others
help with, has the same blocks and in them the same numbers, to the bit. Points of a block share λ/μ; their loads are
rows of one array and their laws rows of one table (tcstudy.online).
Solved one by one: points for which the study names several solvers, the bundle method or an iteration limit.
"""

from __future__ import annotations

import time
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from tcstudy.condense import NotPositiveDefinite
from tcstudy.data.records import BlockRecord, PointRecord, PointStatus, block_of
from tcstudy.offline.level import CondensedBlock, Level
from tcstudy.online import Body, LawTables, Options, RowLaws, solve_block
from tcstudy.refine.survey import Survey
from tcstudy.scene.friction import FrictionLaw
from tcstudy.scene.methods import SEPARABLE
from tcstudy.scene.points import combinations
from tcstudy.scene.records import Scene
from tcstudy.scene.study import Study
from tcstudy.study.measures import block_numbers, line_values, point_status
from tcstudy.study.point import solve_point

Array = NDArray[np.float64]
Places = NDArray[np.intp]

POINTS, ENTRIES = 1024, 2**18
"""Points of a block at most, and entries of its arrays (P, m)."""
FIELDS = 2**22
"""Numbers of whole-body fields that a block holds at most."""


@dataclass(frozen=True)
class Block:
    """Points that are solved together: which block of its level, and their places in the sweep in C order."""

    number: int
    points: Places


def in_blocks(study: Study) -> bool:
    """Whether points are solved together."""
    solver = study.solver
    return solver.names == (SEPARABLE,) and solver.max_iterations is None


def blocks_of(study: Study, m: int, n_points: int) -> list[Block]:
    """The blocks of a level in the order in which they are solved.

    m: contact unknowns;  n_points: nodes of the mesh
    """
    materials, of = combinations(study.scenes, "material")
    numbers: dict[object, int] = {}
    ratio = np.array([numbers.setdefault(("ratio", Level.ratio(s)), len(numbers)) for s in materials])[of]
    mu = np.array([numbers.setdefault(("mu", s.material.mu), len(numbers)) for s in materials])[of]
    laws = combinations(study.scenes, "friction")[1]
    heats, of = combinations(study.scenes, "material", "heat")
    keys = [numbers.setdefault(("thermal", s.heat.alpha, s.material.k), len(numbers)) for s in heats]
    thermal = np.array(keys)[of]
    places = np.arange(len(study.scenes))
    wave = _waves(study)
    order = np.lexsort((places, thermal, laws, mu, ratio, wave))
    size = _size(study, m, n_points)
    kind = wave[order] * (ratio.max(initial=0) + 1) + ratio[order]
    cuts = np.flatnonzero(np.diff(kind)) + 1
    parts = [part[i : i + size] for part in np.split(order, cuts) for i in range(0, len(part), size)]
    return [Block(number, part) for number, part in enumerate(parts)]


def _size(study: Study, m: int, n_points: int) -> int:
    if not in_blocks(study) or study.mesh.estimates:
        return 1
    size = max(1, min(POINTS, ENTRIES // max(1, m)))
    return max(1, min(size, FIELDS // (3 * n_points))) if study.output.fields else size


def _waves(study: Study) -> Places:
    """(P,) how many steps back along the sweep a point has, where each begins from its neighbour's solution."""
    if study.solver.branch != "continued" or not study.shape:
        return np.zeros(len(study.scenes), dtype=np.intp)
    return np.asarray(sum(np.indices(study.shape)), dtype=np.intp).ravel()


class Solutions:
    """Contact solutions of a level found so far: where neighbours begin from."""

    def __init__(self, study: Study, m: int) -> None:
        self._shape = study.shape
        self._kept = study.solver.branch == "continued" or not in_blocks(study)
        self._v = np.full((len(study.scenes), m), np.nan) if self._kept else np.empty((0, m))

    def take(self, block: BlockRecord) -> None:
        """Remember a block's solutions."""
        if self._kept and block.u_T is not None:
            ok = block.status == PointStatus.OK
            self._v[block.points[ok]] = block.u_T[ok]

    def beside(self, points: Places) -> Array | None:
        """(P, m) the solutions one step back along the last sweep dimension that has a step back and a solution there.

        NaN in rows without one; None if the study has no use for them.
        """
        if not self._kept:
            return None
        found = np.full((len(points), self._v.shape[1]), np.nan)
        index = np.array(np.unravel_index(points, self._shape)) if self._shape else np.zeros((0, len(points)), int)
        for d in range(len(self._shape)):  # the last dimension overwrites those before
            back = index.copy()
            back[d] -= 1
            inside = np.flatnonzero(back[d] >= 0)
            v = self._v[np.ravel_multi_index(tuple(back[:, inside]), self._shape)]
            known = ~np.isnan(v).any(axis=1)
            found[inside[known]] = v[known]
        return found


@dataclass(frozen=True)
class Workshop:
    """A level at work: what its blocks are solved with."""

    study: Study
    level: Level
    solutions: Solutions
    survey: Survey | None
    bodies: dict[object, Body] = field(default_factory=dict)

    def work(self, finished: Mapping[int, BlockRecord]) -> Iterator[BlockRecord]:
        """Solve the blocks of the level of which an earlier run left nothing.

        finished: what it left, by number; its solutions start neighbours, and their errors are estimated again,
                  since the next mesh depends on them
        """
        blocks = blocks_of(self.study, self.level.line.m, self.level.mesh.n_points)
        for block in blocks:
            known = finished.get(block.number)
            if known is None or not np.array_equal(known.points, block.points):
                yield self.solve(block)
                continue
            self.solutions.take(known)
            if self.survey is not None:
                self._completed(known)

    def solve(self, block: Block) -> BlockRecord:
        """Solve a block; every failure becomes a status with its reason."""
        if not in_blocks(self.study):
            record = self._singly(block)
        else:
            record = replace(self._together(block), number=block.number)
        self.solutions.take(record)
        return record

    def _singly(self, block: Block) -> BlockRecord:
        """One point after the other."""
        near = self.solutions.beside(block.points)
        points = []
        for row, place in enumerate(block.points):
            neighbour = None if near is None or np.isnan(near[row]).any() else near[row]
            point = solve_point(self.study, self.level, self._index(place), self._scene(place), neighbour)
            try:
                points.append(self._with_more(point))
            except Exception as error:  # as in solve_point
                reason = f"{type(error).__name__}: {error}"
                points.append(replace(point, status=PointStatus.ERROR, reason=reason, numbers={}, fields={}))
        return block_of(points, self.study.shape, block.number)

    def _together(self, block: Block) -> BlockRecord:
        """All points at once; where that breaks down, half of them at a time, to find the one that does it."""
        try:
            return self._completed(self._solved(block))
        except NotPositiveDefinite as error:
            status, reason = PointStatus.SINGULAR, str(error)
        except Exception as error:  # one point must not end a sweep; what it was stands in the data
            status, reason = PointStatus.ERROR, f"{type(error).__name__}: {error}"
        if len(block.points) == 1:
            return _failed(self.study, self.level.mesh.level, block, status, reason)
        half = len(block.points) // 2
        parts = (block.points[:half], block.points[half:])
        points = [p for part in parts for p in self._together(replace(block, points=part)).one_by_one()]
        return block_of(points, self.study.shape, block.number)

    def _solved(self, block: Block) -> BlockRecord:
        scenes = [self._scene(place) for place in block.points]
        condensed = self.level.block(scenes)
        start = time.perf_counter()
        factor = condensed.mu / condensed.mu[0]
        laws = row_laws([scene.friction for scene in scenes], factor)
        options = Options(self.study.solver.branch, self.study.solver.tolerance)
        answers = solve_block(
            self._body(condensed),
            condensed.l_tilde / factor[:, None],
            laws,
            options,
            self.solutions.beside(block.points),
        )
        elapsed = (time.perf_counter() - start) / len(scenes)
        vanishing = np.array([scene.friction.vanishes for scene in scenes])
        xi, sticks = line_values(answers, laws, factor, vanishing)
        return BlockRecord(
            number=block.number,
            level=self.level.mesh.level,
            shape=self.study.shape,
            points=block.points,
            status=point_status(answers.status),
            reasons={row: reason for row, reason in enumerate(answers.reasons) if reason},
            numbers=block_numbers(condensed, factor, answers, xi, sticks, elapsed),
            u_T=answers.v,
            xi=xi / condensed.c,
            sticks=sticks.astype(np.int8),
        )

    def _body(self, condensed: CondensedBlock) -> Body:
        """The body at the first μ of a block, made once for blocks that follow one another."""
        mu = float(condensed.mu[0])
        key = (id(condensed.A_tilde), mu)
        if key not in self.bodies:
            self.bodies.clear()
            self.bodies[key] = Body.of(mu * condensed.A_tilde, condensed.c)
        return self.bodies[key]

    def _completed(self, record: BlockRecord) -> BlockRecord:
        """Whole-body fields and estimates, where the study asks for them."""
        if self.survey is None and not self.study.output.fields:
            return record
        points = [self._with_more(point) for point in record.one_by_one()]
        return block_of(points, self.study.shape, record.number)

    def _with_more(self, point: PointRecord) -> PointRecord:
        if point.status != PointStatus.OK:
            return point
        scene = self._scene(int(np.ravel_multi_index(point.index, self.study.shape)) if point.index else 0)
        condensed = self.level.condensed(scene)
        numbers, fields = dict(point.numbers), dict(point.fields)
        if self.survey is not None:
            numbers |= self.survey.look(point.index, scene, condensed, point.u_T)
        if self.study.output.fields and not fields:
            fields = self.level.fields(scene, condensed, point.u_T)
        return replace(point, numbers=numbers, fields=fields)

    def _scene(self, place: int) -> Scene:
        return self.study.scenes[int(place)]

    def _index(self, place: int) -> tuple[int, ...]:
        return tuple(int(i) for i in np.unravel_index(place, self.study.shape)) if self.study.shape else ()


def row_laws(laws: list[FrictionLaw], factor: Array) -> RowLaws:
    """The laws of a block, each scaled by the row's stiffness over that of the body."""
    known: dict[tuple[FrictionLaw, float], int] = {}
    rows = [known.setdefault((law, float(f)), len(known)) for law, f in zip(laws, factor, strict=True)]
    scaled = [law if f == 1.0 else law.scaled(1.0, f) for law, f in known]
    return RowLaws(LawTables.of(scaled), np.array(rows, dtype=np.intp)[:, None])


def all_failed(study: Study, level: int, status: PointStatus, reason: str) -> BlockRecord:
    """All points of a level that could not be made."""
    return _failed(study, level, Block(0, np.arange(len(study.scenes))), status, reason)


def _failed(study: Study, level: int, block: Block, status: PointStatus, reason: str) -> BlockRecord:
    """A block without results."""
    count = len(block.points)
    return BlockRecord(
        number=block.number,
        level=level,
        shape=study.shape,
        points=block.points,
        status=np.full(count, int(status), dtype=np.int8),
        reasons=dict.fromkeys(range(count), reason),
        numbers={},
    )
