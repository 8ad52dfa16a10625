"""A level at work: blocks are condensed here, solved by an executor, and become records.

Solved one by one, here: points for which the study names several solvers, the bundle method or an iteration limit.

A block depends on the study and on the size of the contact line alone, so that a run that was stopped, or that others
help with, has the same blocks and in them the same numbers, to the bit. Points of a block share λ/μ; their loads are
rows of one array and their laws rows of one table (tcstudy.online).
"""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Iterator, Mapping
from concurrent.futures import Future
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from tcstudy.condense import NotPositiveDefinite
from tcstudy.data.records import BlockRecord, PointRecord, PointStatus, block_of
from tcstudy.executors import Executor, Here, Solved, Task, WorkersFailed
from tcstudy.offline.level import CondensedBlock, Level
from tcstudy.online import CondensedBody, Options, RowLaws
from tcstudy.online.row_laws import row_laws
from tcstudy.refine.survey import Survey
from tcstudy.scene.points import combinations, of_stiffness
from tcstudy.scene.records import Scene
from tcstudy.scene.study import Study
from tcstudy.study.point import block_numbers, line_values, point_status, solve_point
from tcstudy.study.starts import Solutions, exact_start

Array = NDArray[np.float64]


@dataclass
class Times:
    """Wall times of a level [s]; the last two grow as its points are taken.

    geometry: of the body, once a run;  mesh: of this mesh alone;  assemble: matrices and contact line
    points:   all points, estimates left out;  estimate: of errors, and of what they say of the next mesh
    """

    geometry: float = 0.0
    mesh: float = 0.0
    assemble: float = 0.0
    points: float = 0.0
    estimate: float = 0.0


@dataclass(frozen=True)
class Prepared:
    """A block on its way: what is known of it beside the answers that an executor owes.

    known: the block itself, if it was solved before or could not be condensed
    vanishing: (P,) whether a point has no friction
    """

    block: Block
    known: BlockRecord | None = None
    condensed: CondensedBlock | None = None
    laws: RowLaws | None = None
    vanishing: NDArray[np.bool_] | None = None
    answers: Future[Solved] | None = None


@dataclass(frozen=True)
class Workshop:
    """A level at work: what its blocks are solved with. todo: places of the points to solve, None for all."""

    study: Study
    level: Level
    survey: Survey | None
    executor: Executor = field(default_factory=Here)
    times: Times = field(default_factory=Times)
    bodies: dict[object, CondensedBody] = field(default_factory=dict)
    todo: Places | None = None

    @cached_property
    def solutions(self) -> Solutions:
        """Those found so far, where others begin from them."""
        return Solutions(self.study, self.level.line.m, keeps_solutions(self.study))

    @cached_property
    def exact(self) -> Array | None:
        """(m,) the exact solution at the contact nodes, a start where the study gives one."""
        return exact_start(self.study, self.level)

    def work(self, finished: Mapping[int, BlockRecord]) -> Iterator[BlockRecord]:
        """Solve the blocks of the level of which an earlier run left nothing, and give them in their order.

        finished: what it left, by number; its solutions start neighbours, and their errors are estimated again,
                  since the next mesh depends on them
        A few blocks are prepared ahead, so that whoever solves them need not wait for loads.
        """
        waiting: deque[Prepared] = deque()
        for block in blocks_of(self.study, self.level.line.m, self.level.mesh.n_points, self.todo):
            while waiting and (len(waiting) > self.executor.ahead or self._must_wait(waiting[-1].block, block)):
                yield from self._finish(waiting.popleft())
            known = finished.get(block.number)
            if known is None or not np.array_equal(known.points, block.points):
                waiting.append(self._prepare(block, tries=2))
            else:
                waiting.append(Prepared(block, known))
        while waiting:
            yield from self._finish(waiting.popleft())

    def _must_wait(self, last: Block, block: Block) -> bool:
        """Whether a block needs the solutions of those before, or takes away the factor that these need to end."""
        output = self.study.output
        more = self.survey is not None or output.fields or output.asks
        return (self.solutions.kept and block.wave != last.wave) or (more and block.ratio != last.ratio)

    def _prepare(self, block: Block, tries: int = 1) -> Prepared:
        """Condense a block and hand it to the executor; what breaks down there is told where answers are due.

        tries: workers that may die over it
        """
        if not self.study.solver.in_blocks:
            return Prepared(block)
        try:
            scenes = [self._scene(place) for place in block.points]
            condensed = self.level.block(scenes)
            factor = condensed.mu / condensed.mu[0]
            laws = row_laws([self.level.law(scene) for scene in scenes], factor)
            options = Options(self.study.solver.branch, self.study.solver.tolerance)
            loads, near = condensed.l_tilde / factor[:, None], self.solutions.beside(block.points)
            name = f"level-{self.level.mesh.level} points {block.points.min()}-{block.points.max()}"
            task = Task(self._body(condensed, Level.ratio(scenes[0])), loads, laws, options, near, self.exact, name)
            vanishing = np.array([scene.friction.vanishes for scene in scenes])
            return Prepared(block, None, condensed, laws, vanishing, self.executor.submit(task, tries))
        except Exception as error:  # as in solve_point
            broken: Future[Solved] = Future()
            broken.set_exception(error)
            return Prepared(block, answers=broken)

    def _finish(self, prepared: Prepared) -> Iterator[BlockRecord]:
        """The block's record, unless it was there before; every failure becomes a status with its reason."""
        known = prepared.known
        if known is not None:
            self.solutions.take(known)
            if self.survey is not None:
                self._completed(known)
            return
        block = prepared.block
        record = self._together(prepared) if self.study.solver.in_blocks else self._singly(block)
        self.solutions.take(record)
        if self.study.output.asks:
            from tcstudy.study.requested import with_requested  # only for a study that asks for more

            record = with_requested(self.study, self.level, record)
        yield replace(record, number=block.number)

    def _singly(self, block: Block) -> BlockRecord:
        """One point after the other."""
        near = self.solutions.beside(block.points)
        points = []
        for row, place in enumerate(block.points):
            neighbour = None if near is None or np.isnan(near[row]).any() else near[row]
            point = solve_point(self.study, self.level, self._index(place), self._scene(place), neighbour, self.exact)
            try:
                points.append(self._with_more(point))
            except Exception as error:  # as in solve_point
                reason = f"{type(error).__name__}: {error}"
                points.append(replace(point, status=PointStatus.ERROR, reason=reason, numbers={}, fields={}))
        return block_of(points, self.study.shape, block.number)

    def _together(self, prepared: Prepared) -> BlockRecord:
        """All points at once; where that breaks down, half of them at a time, to find the one that does it."""
        block = prepared.block
        try:
            return self._completed(self._solved(prepared))
        except WorkersFailed:
            raise
        except NotPositiveDefinite as error:
            status, reason = PointStatus.SINGULAR, str(error)
        except Exception as error:  # one point must not end a sweep; what it was stands in the data
            status, reason = PointStatus.ERROR, f"{type(error).__name__}: {error}"
        if len(block.points) == 1:
            return _failed(self.study, self.level.mesh.level, block, status, reason)
        halves = [replace(block, points=part) for part in np.array_split(block.points, 2)]
        parts = [self._prepare(half, tries=1 + (len(half.points) == 1)) for half in halves]
        points = [point for part in parts for point in self._together(part).one_by_one()]
        return block_of(points, self.study.shape, block.number)

    def _solved(self, prepared: Prepared) -> BlockRecord:
        block, condensed, laws = prepared.block, prepared.condensed, prepared.laws
        assert prepared.answers is not None
        solved = prepared.answers.result()
        assert condensed is not None
        assert laws is not None
        assert prepared.vanishing is not None
        answers, elapsed = solved.answers, solved.time / len(block.points)
        factor = condensed.mu / condensed.mu[0]
        xi, sticks = line_values(answers, laws, factor, prepared.vanishing)
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

    def _body(self, condensed: CondensedBlock, ratio: object) -> CondensedBody:
        """The body of a ratio of moduli at the first μ of a block, made once for blocks that follow one another."""
        mu = float(condensed.mu[0])
        key = (ratio, mu)
        if key not in self.bodies:
            self.bodies.clear()
            self.bodies[key] = CondensedBody.of(mu * condensed.A_tilde, condensed.c)
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
            clock = time.perf_counter()
            numbers |= self.survey.look(point.index, scene, condensed, point.u_T)
            self.times.estimate += time.perf_counter() - clock
        if self.study.output.fields and not fields:
            fields = self.level.fields(scene, condensed, point.u_T)
        return replace(point, numbers=numbers, fields=fields)

    def _scene(self, place: int) -> Scene:
        return self.study.scenes[int(place)]

    def _index(self, place: int) -> tuple[int, ...]:
        return tuple(int(i) for i in np.unravel_index(place, self.study.shape)) if self.study.shape else ()


def all_failed(study: Study, level: int, points: Places, status: PointStatus, reason: str) -> BlockRecord:
    """All points of a level that could not be made."""
    return _failed(study, level, Block(0, points), status, reason)


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


Places = NDArray[np.intp]

POINTS, ENTRIES = 1024, 2**17
"""Points of a block at most, and entries of its arrays (P, m) to aim at, so that many have a part in the work."""
ENOUGH, MOST = 256, 2**18
"""Points from which a larger block is hardly cheaper by the point, and entries at most."""
ESTIMATED = 16
"""Points of a block where the error of each is estimated, which takes longer than its solution."""
FIELDS = 2**22
"""Numbers of whole-body fields that a block holds at most."""


@dataclass(frozen=True)
class Block:
    """Points that are solved together.

    number: which block of its level;  points: their places in the sweep in C order
    wave:   blocks that begin from solutions of other waves follow these;  ratio: which λ/μ, which all points share
    """

    number: int
    points: Places
    wave: int = 0
    ratio: int = 0


def keeps_solutions(study: Study) -> bool:
    """Whether points begin from solutions of their neighbours."""
    return study.solver.branch == "continued" or not study.solver.in_blocks


def blocks_of(study: Study, m: int, n_points: int, todo: Places | None = None) -> list[Block]:
    """The blocks of a level in the order in which they are solved.

    m: contact unknowns;  n_points: nodes of the mesh;  todo: places of the points to solve, None for all
    """
    if todo is not None and not len(todo):
        return []
    materials, of = combinations(study.scenes, *of_stiffness(study.scenes))
    numbers: dict[object, int] = {}
    ratio = np.array([numbers.setdefault(("ratio", Level.ratio(s)), len(numbers)) for s in materials])[of]
    mu = np.array([numbers.setdefault(("mu", s.material.mu), len(numbers)) for s in materials])[of]
    places = np.arange(len(study.scenes))
    wave = _waves(study)
    order = np.lexsort((places, mu, ratio, wave))  # else as in the file, which is written meanwhile
    if todo is not None:
        order = order[np.isin(order, todo)]
    size = _size(study, m, n_points)
    kind = wave[order] * (ratio.max(initial=0) + 1) + ratio[order]
    cuts = np.flatnonzero(np.diff(kind)) + 1
    parts = [part for whole in np.split(order, cuts) for part in np.array_split(whole, -(-len(whole) // size))]
    return [Block(number, p, int(wave[p[0]]), int(ratio[p[0]])) for number, p in enumerate(parts)]


def _size(study: Study, m: int, n_points: int) -> int:
    if not study.solver.in_blocks:
        return 1
    if study.mesh.estimates:
        return ESTIMATED
    size = max(1, min(POINTS, max(ENTRIES // max(1, m), min(ENOUGH, MOST // max(1, m)))))
    return max(1, min(size, FIELDS // (3 * n_points))) if study.output.fields else size


def _waves(study: Study) -> Places:
    """(P,) how many steps back along the sweep a point has, where each begins from its neighbour's solution."""
    if study.solver.branch != "continued" or not study.shape:
        return np.zeros(len(study.scenes), dtype=np.intp)
    return np.asarray(sum(np.indices(study.shape)), dtype=np.intp).ravel()
