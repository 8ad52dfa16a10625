"""A level at work: blocks are condensed here, solved by an executor, and become records.

Solved one by one, here: points for which the study names several solvers, the bundle method or an iteration limit.

A block depends on the study and on the size of the contact line alone, so that a run that was stopped, or that others
help with, has the same blocks and in them the same numbers, to the bit. Points of a block share λ/μ; their loads are
rows of one array and their laws rows of one table (tcstudy.contact).
"""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Callable, Iterator, Mapping
from concurrent.futures import Future
from dataclasses import dataclass, field, replace
from functools import cached_property, partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tcstudy.condense import NotPositiveDefinite
from tcstudy.contact.block import Options, solve_block
from tcstudy.contact.body import BlockAnswers, CondensedBody
from tcstudy.contact.boxes import Limits
from tcstudy.contact.every import Every, solve_every
from tcstudy.contact.loop import Status
from tcstudy.data.on_request import variables
from tcstudy.data.records import BlockRecord, PointRecord, PointStatus, block_of
from tcstudy.executors import TIMEOUT, Job, SerialExecutor, WorkersFailed, timed
from tcstudy.laws.composed import row_laws
from tcstudy.laws.laws import Laws
from tcstudy.laws.pieces import UP
from tcstudy.offline.level import CondensedBlock, Level
from tcstudy.refine.error_estimator import ErrorEstimator
from tcstudy.scene.points import combinations, of_stiffness
from tcstudy.scene.records import Scene
from tcstudy.scene.study import Study
from tcstudy.study.point import STATUS, block_numbers, every_solution, solve_point
from tcstudy.study.starts import Solutions, contact_line, exact_at

Array = NDArray[np.float64]
Pending = Callable[[], BlockRecord]
"""A block on its way: the call waits for what an executor owes of it."""


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
class Workshop:
    """A level at work: what its blocks are solved with. todo: places of the points to solve, None for all."""

    study: Study
    level: Level
    estimator: ErrorEstimator | None
    executor: SerialExecutor = field(default_factory=SerialExecutor)
    times: Times = field(default_factory=Times)
    bodies: dict[object, CondensedBody] = field(default_factory=dict)
    todo: Places | None = None

    @cached_property
    def solutions(self) -> Solutions | None:
        """Those found so far, where others begin from them."""
        return Solutions(self.study, self.level.line.m) if keeps_solutions(self.study) else None

    @cached_property
    def exact(self) -> Array | None:
        """(m,) the exact solution at the contact nodes, a start where the study gives one."""
        exact = self.study.exact
        return None if exact is None else exact_at(exact, contact_line(self.study, self.level))

    def work(self, finished: Mapping[int, BlockRecord]) -> Iterator[BlockRecord]:
        """Solve the blocks of the level of which an earlier run left nothing, and give them in their order.

        finished: what it left, by number; its solutions start neighbours, and their errors are estimated again,
                  since the next mesh depends on them
        A few blocks are prepared ahead, so that whoever solves them need not wait for loads.
        """
        waiting: deque[tuple[Block, BlockRecord | Pending]] = deque()
        for block in blocks_of(self.study, self.level.line.m, self.level.mesh.n_points, self.todo):
            while waiting and (len(waiting) > self.executor.ahead or self._must_wait(waiting[-1][0], block)):
                yield from self._finish(*waiting.popleft())
            known = finished.get(block.number)
            if known is None or not np.array_equal(known.points, block.points):
                waiting.append((block, self._prepare(block)))
            else:
                waiting.append((block, known))
        while waiting:
            yield from self._finish(*waiting.popleft())

    def _must_wait(self, last: Block, block: Block) -> bool:
        """Whether a block needs the solutions of those before, or takes away the factor that these need to end."""
        output = self.study.output
        more = self.estimator is not None or output.fields or output.asks
        return (self.solutions is not None and block.wave != last.wave) or (more and block.ratio != last.ratio)

    def _prepare(self, block: Block) -> Pending:
        """Condense a block and hand it to the executor; what breaks down there is told where answers are due."""
        if not self.study.solver.in_blocks:
            return partial(self._singly, block)
        try:
            scenes = [self._scene(place) for place in block.points]
            condensed = self.level.block(scenes)
            factor = condensed.mu / condensed.mu[0]
            laws = row_laws([self.level.law(scene) for scene in scenes], factor)
            options = Options(self.study.solver.branch, self.study.solver.tolerance)
            loads, near = condensed.l_tilde / factor[:, None], self._beside(block)
            name = f"level-{self.level.mesh.level} points {block.points.min()}-{block.points.max()}"
            points, m = loads.shape
            job = Job(timed, name, max(TIMEOUT, FACTORISATIONS / FLOPS * points * m**3 / 3.0))
            body = self._body(condensed, Level.ratio(scenes[0]))
            future: Future[Any]
            if (plan := self.study.solver).every:
                limits = Limits(plan.max_boxes, plan.max_seconds)
                job = replace(job, timeout=job.timeout + points * (limits.seconds + SLOWEST))
                future = self.executor.submit(job, solve_every, body, loads, laws, options, limits, self.exact)
            else:
                future = self.executor.submit(job, solve_block, body, loads, laws, options, near, self.exact)
            vanishing = np.array([scene.friction.vanishes for scene in scenes])
            solved = partial(self._solved, block, condensed, laws, vanishing, future)
        except Exception as error:  # as in solve_point
            broken: Future[BlockRecord] = Future()
            broken.set_exception(error)
            return partial(self._together, block, broken.result)
        return partial(self._together, block, solved)

    def _beside(self, block: Block) -> Array | None:
        """(P, m) solutions that the points of a block begin from, NaN in rows without; None if there are none."""
        return None if self.solutions is None else self.solutions.beside(block.points)

    def _finish(self, block: Block, pending: BlockRecord | Pending) -> Iterator[BlockRecord]:
        """The block's record, unless it was there before; every failure becomes a status with its reason."""
        record = pending if isinstance(pending, BlockRecord) else pending()
        if self.solutions is not None:
            self.solutions.take(record)
        if pending is not record:
            yield replace(self._with_asked(record) if self.study.output.asks else record, number=block.number)
        elif self.estimator is not None:
            self._completed(record)

    def _singly(self, block: Block) -> BlockRecord:
        """One point after the other."""
        near, points = self._beside(block), list[PointRecord]()
        for row, place in enumerate(block.points):
            neighbour = None if near is None or np.isnan(near[row]).any() else near[row]
            index = tuple(int(i) for i in np.unravel_index(place, self.study.shape))
            point = solve_point(self.study, self.level, index, self._scene(place), neighbour, self.exact)
            try:
                points.append(self._with_more(point))
            except Exception as error:  # as in solve_point
                reason = f"{type(error).__name__}: {error}"
                points.append(replace(point, status=PointStatus.ERROR, reason=reason, numbers={}, fields={}))
        return block_of(points, self.study.shape, block.number)

    def _together(self, block: Block, solved: Pending) -> BlockRecord:
        """All points at once; where that breaks down, half of them at a time, to find the one that does it."""
        try:
            return self._completed(solved())
        except WorkersFailed:
            raise
        except NotPositiveDefinite as error:
            status, reason = PointStatus.SINGULAR, str(error)
        except Exception as error:  # one point must not end a sweep; what it was stands in the data
            status, reason = PointStatus.ERROR, f"{type(error).__name__}: {error}"
        if len(block.points) == 1:
            return all_failed(self.study, self.level.mesh.level, block.points, status, reason)
        halves = [replace(block, points=part) for part in np.array_split(block.points, 2)]
        parts = [self._prepare(half) for half in halves]
        points = [point for part in parts for point in part().one_by_one()]
        return block_of(points, self.study.shape, block.number)

    def _solved(
        self,
        block: Block,
        condensed: CondensedBlock,
        laws: Laws,
        vanishing: NDArray[np.bool_],
        future: Future[tuple[BlockAnswers | Every, float]],
    ) -> BlockRecord:
        """The record of a block whose answers an executor owes; vanishing: (P,) whether a point has no friction."""
        found, seconds = future.result()
        answers = found.answers if isinstance(found, Every) else found
        factor = condensed.mu / condensed.mu[0]
        # no friction leaves a solution nothing but rounding of ξ; how far from 0 that is is its inclusion residual
        nothing = vanishing & (answers.status == Status.CONVERGED)
        xi = np.where(nothing[:, None], 0.0, answers.xi * factor[:, None])
        sticks = laws.kind(laws.locate(answers.v)) == UP
        count = len(block.points)
        numbers, solutions = block_numbers(condensed, factor, answers, xi, sticks), dict[str, Array]()
        if isinstance(found, Every):
            more, solutions = every_solution(found, factor, condensed)
            numbers |= more
        return BlockRecord(
            number=block.number,
            level=self.level.mesh.level,
            shape=self.study.shape,
            points=block.points,
            status=STATUS[answers.status],
            reasons={row: reason for row, reason in enumerate(answers.reasons) if reason},
            numbers=numbers | {"time_solve": np.full(count, seconds / count)},
            u_T=answers.v,
            xi=xi / condensed.c,
            sticks=sticks.astype(np.int8),
            solutions=solutions,
        )

    def _body(self, condensed: CondensedBlock, ratio: object) -> CondensedBody:
        """The body of a ratio of moduli at the first μ of a block, made once for blocks that follow one another."""
        mu = float(condensed.mu[0])
        key = (ratio, mu)
        if key not in self.bodies:
            self.bodies.clear()
            self.bodies[key] = CondensedBody.of(mu * condensed.A_tilde, condensed.c, condensed.lambda_1_error)
        return self.bodies[key]

    @cached_property
    def _asked(self) -> list[Callable[[Scene, Array], dict[str, float]]]:
        """What gives the numbers on request of a scene and its u_T (m,), by variable name."""
        from tcstudy.offline.requested_outputs import RequestedOutputs  # only for a study that asks for more
        from tcstudy.study.sensitivities import of_point

        output = self.study.output
        found: list[Callable[[Scene, Array], dict[str, float]]] = []
        if output.probes or output.quantities:
            found.append(RequestedOutputs(self.level, output).of)
        if output.sensitivity:
            found.append(lambda scene, v: of_point(self.level, scene, v, output.sensitivity))
        return found

    def _with_asked(self, record: BlockRecord) -> BlockRecord:
        """The block with the numbers and the derivatives that the study asks for of solved points."""
        columns = {v.name: np.full(len(record), np.nan) for v in variables(self.study)}
        status, reasons = record.status.copy(), dict(record.reasons)
        for row, place in enumerate(record.points):
            if record.status[row] == PointStatus.OK and record.u_T is not None:
                scene, v = self._scene(place), record.u_T[row]
                try:
                    asked = {name: value for of in self._asked for name, value in of(scene, v).items()}
                except Exception as error:  # as in solve_point; the solution itself stays, and all that was asked goes
                    reason = f"numbers on request: {type(error).__name__}: {error}"
                    status[row], reasons[row], asked = PointStatus.ERROR, reason, {}
                for name, value in asked.items():
                    columns[name][row] = value
        return replace(record, status=status, reasons=reasons, numbers={**record.numbers, **columns})

    def _completed(self, record: BlockRecord) -> BlockRecord:
        """Whole-body fields and estimates, where the study asks for them."""
        if self.estimator is None and not self.study.output.fields:
            return record
        points = [self._with_more(point) for point in record.one_by_one()]
        return block_of(points, self.study.shape, record.number)

    def _with_more(self, point: PointRecord) -> PointRecord:
        if point.status != PointStatus.OK:
            return point
        scene = self._scene(np.ravel_multi_index(point.index, self.study.shape))
        condensed = self.level.condensed(scene)
        numbers, fields = dict(point.numbers), dict(point.fields)
        if self.estimator is not None:
            clock = time.perf_counter()
            numbers |= self.estimator.look(point.index, scene, condensed, point.u_T)
            self.times.estimate += time.perf_counter() - clock
        if self.study.output.fields and not fields:
            fields = self.level.fields(scene, condensed, point.u_T)
        return replace(point, numbers=numbers, fields=fields)

    def _scene(self, place: np.intp) -> Scene:
        return self.study.scenes[int(place)]


def all_failed(study: Study, level: int, points: Places, status: PointStatus, reason: str) -> BlockRecord:
    """Points of a level without results."""
    count = len(points)
    return BlockRecord(
        number=0,
        level=level,
        shape=study.shape,
        points=points,
        status=np.full(count, int(status), dtype=np.int8),
        reasons=dict.fromkeys(range(count), reason),
        numbers={},
    )


Places = NDArray[np.intp]

POINTS, ENTRIES = 1024, 2**17
"""Points of a block at most, and entries of its arrays (P, m) to aim at, so that many have a part in the work."""
ENOUGH, MOST = 256, 2**18
"""Points from which a larger block is hardly cheaper by the point, and entries at most."""
ESTIMATED, EVERY = 16, 64
"""Points of a block where the error of each is estimated, or all solutions are sought, which takes longer than one."""
SLOWEST = 10.0
"""Seconds that a point may take beyond its limit, which is looked at between one set of boxes and the next."""
FACTORISATIONS, FLOPS = 2000.0, 1e9
"""A block may take the time of so many factorisations of Ã a point on a slow processor."""
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
    if study.solver.every:
        return EVERY
    size = max(1, min(POINTS, max(ENTRIES // max(1, m), min(ENOUGH, MOST // max(1, m)))))
    return max(1, min(size, FIELDS // (3 * n_points))) if study.output.fields else size


def _waves(study: Study) -> Places:
    """(P,) how many steps back along the sweep a point has, where each begins from its neighbour's solution."""
    if study.solver.branch != "continued" or not study.shape:
        return np.zeros(len(study.scenes), dtype=np.intp)
    return np.asarray(sum(np.indices(study.shape)), dtype=np.intp).ravel()
