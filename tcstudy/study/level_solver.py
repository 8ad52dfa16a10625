"""The solver of one level: blocks of points are condensed here, solved by an executor, and become records.

A block depends on the study and on the size of the contact line alone, so that a run that was stopped, or that others
help with, has the same blocks and in them the same numbers, to the bit. Points of a block share λ/μ; their loads are
rows of one array and their laws rows of one table (tcstudy.contact). Points for which the study names several solvers
or the bundle method are solved one by one, here.

The contact line has the normals of the exact curve: the mesh cuts arcs into chords; errors, and the exact solution as a
start, belong to the curve.
"""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Future
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tcstudy.accuracy.norms import LineFunction
from tcstudy.condense import NotPositiveDefinite
from tcstudy.contact.all_solutions import Limits
from tcstudy.contact.problem import CondensedBody
from tcstudy.contact.solve import solve_block
from tcstudy.data.records import BlockRecord
from tcstudy.data.schema import PointStatus, requested_variables
from tcstudy.exact.solution import exact_u_T
from tcstudy.executors.processes import TIMEOUT, Job, SerialExecutor, WorkersFailed, timed
from tcstudy.fem.forms import ContactLine
from tcstudy.fem.meshes import PlaneMesh
from tcstudy.laws.composed import row_laws
from tcstudy.offline.error_bound import ErrorBounds
from tcstudy.offline.level import Level
from tcstudy.refine.family import ErrorEstimator
from tcstudy.scene.points import combinations, of_stiffness
from tcstudy.scene.records import Scene
from tcstudy.scene.study import Study
from tcstudy.study.point import all_failed, block_record, derivatives_of, solve_point

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

    @contextmanager
    def of(self, what: str) -> Iterator[None]:
        """What is done within it takes so much more."""
        clock = time.perf_counter()
        yield
        setattr(self, what, getattr(self, what) + time.perf_counter() - clock)


@dataclass(frozen=True)
class LevelSolver:
    """What the blocks of a level are solved with."""

    study: Study
    level: Level
    estimator: ErrorEstimator | None
    executor: SerialExecutor = field(default_factory=SerialExecutor)
    times: Times = field(default_factory=Times)
    bodies: dict[object, CondensedBody] = field(default_factory=dict)

    @cached_property
    def solutions(self) -> Solutions | None:
        """Those found so far, where others begin from them."""
        if not keeps_solutions(self.study):
            return None
        return Solutions(self.study, self.level.line.m, np.concatenate([block.points for block in self.blocks]))

    @cached_property
    def blocks(self) -> list[Block]:
        """All of the level, in the order in which they are solved."""
        return blocks_of(self.study, self.level.line.m, self.level.mesh.n_points)

    @cached_property
    def exact(self) -> Array | None:
        """(m,) the exact solution at the contact nodes, a start where the study gives one."""
        exact, level = self.study.exact, self.level
        return None if exact is None else at_contact_nodes(exact_u_T(exact), level.mesh, level.line)

    def solve(self, finished: Sequence[BlockRecord] = ()) -> Iterator[BlockRecord]:
        """Solve the points of the level of which an earlier run left nothing, block by block in their order.

        finished: what it left; its solutions start neighbours, and their errors are estimated again, since the next
                  mesh depends on them
        A few blocks are prepared ahead, so that whoever solves them need not wait for loads; but not one that needs
        the solutions of those before, or takes away the factor that these need to end.
        """
        output, waiting = self.study.output, deque[tuple[Block, Pending]]()
        done = np.zeros(len(self.study.scenes), dtype=bool)
        more = self.estimator is not None or self.study.mesh.guarantee or output.fields or output.asks
        for record in finished:
            done[record.points] = True
            if self.estimator is not None:
                record = self._completed(record)
            if self.solutions is not None:
                self.solutions.take(record)

        def ready(block: Block | None) -> Iterator[BlockRecord]:
            """The records of blocks on their way that must end before this one is started."""
            while waiting and (
                block is None
                or len(waiting) > self.executor.ahead
                or (self.solutions is not None and block.wave != waiting[-1][0].wave)
                or (more and block.ratio != waiting[-1][0].ratio)
            ):
                for record in self._records(*waiting.popleft()):
                    if self.solutions is not None:
                        self.solutions.take(record)
                    yield record

        for block in self.blocks:
            yield from ready(block)
            left = replace(block, points=block.points[~done[block.points]])
            if len(left.points):
                waiting.append((left, self._started(left)))
        yield from ready(None)

    def _records(self, block: Block, pending: Pending) -> Iterator[BlockRecord]:
        """All points at once; where that breaks down, half of them at a time, to find the one that does it.
        Every failure becomes a status with its reason: one point must not end a sweep."""
        try:
            yield self._completed(pending())
            return
        except WorkersFailed:
            raise
        except NotPositiveDefinite as error:
            status, reason = PointStatus.SINGULAR, str(error)
        except Exception as error:  # what it was stands in the data
            status, reason = PointStatus.ERROR, f"{type(error).__name__}: {error}"
        if len(block.points) == 1:
            yield all_failed(self.study, self.level.mesh.level, block.points, status, reason)
            return
        halves = [replace(block, points=part) for part in np.array_split(block.points, 2)]
        for half, one in [(half, self._started(half)) for half in halves]:
            yield from self._records(half, one)

    def _started(self, block: Block) -> Pending:
        """The block on its way; what breaks down before it is handed over is told where its record is due."""
        try:
            near = None if self.solutions is None else self.solutions.beside(block.points)
            if self.study.solver.in_blocks:
                return self._submitted(block, near)
            start = None if near is None or np.isnan(near).any() else near[0]
            return lambda: solve_point(self.study, self.level, int(block.points[0]), start, self.exact)
        except Exception as error:
            broken: Future[BlockRecord] = Future()
            broken.set_exception(error)
            return broken.result

    def _submitted(self, block: Block, near: Array | None) -> Pending:
        """Condense a block and hand its contact problems to the executor.
        near: (P, m) solutions that the points begin from, NaN in rows without; None if there are none"""
        plan, level = self.study.solver, self.level
        scenes = [self.study.scenes[int(place)] for place in block.points]
        condensed = level.block(scenes)
        factor = condensed.mu / condensed.mu[0]
        laws, loads = row_laws([level.law(scene) for scene in scenes], factor), condensed.l_tilde / factor[:, None]
        mu, (points, m) = float(condensed.mu[0]), loads.shape
        if (key := (Level.ratio(scenes[0]), mu)) not in self.bodies:  # made once for blocks that follow one another
            self.bodies.clear()
            self.bodies[key] = CondensedBody.of(mu * condensed.A_tilde, condensed.c, condensed.lambda_1_error)
        timeout, limits = max(TIMEOUT, FACTORISATIONS / FLOPS * points * m**3 / 3.0), None
        if plan.every:
            limits = Limits(plan.max_boxes, plan.max_seconds)
            timeout += points * (limits.seconds + SLOWEST)
        job = Job(timed, f"level-{level.mesh.level} points {block.points.min()}-{block.points.max()}", timeout)
        future = self.executor.submit(
            job, solve_block, self.bodies[key], loads, laws, plan.branch, plan.tolerance, near, self.exact, limits
        )
        return lambda: block_record(self.study, level, block.points, scenes, condensed, laws, *future.result())

    @cached_property
    def _bounds(self) -> ErrorBounds:
        """What bounds the errors."""
        return ErrorBounds(self.level)

    @cached_property
    def _requested(self) -> list[Callable[[Scene, Array], dict[str, Any]]]:
        """What gives the numbers on request of a scene and its u_T (m,), by variable name."""
        from tcstudy.offline.requested_outputs import RequestedOutputs  # only for a study that asks for more

        output = self.study.output
        found: list[Callable[[Scene, Array], dict[str, Any]]] = []
        if output.probes or output.quantities:
            found.append(RequestedOutputs(self.level, output).of)
        if output.sensitivity:
            found.append(lambda scene, v: derivatives_of(self.level, scene, v, output.sensitivity))
        return found

    def _completed(self, record: BlockRecord) -> BlockRecord:
        """With what the study asks for of solved points: estimates and bounds of errors, fields, numbers on request."""
        output = self.study.output
        guarantee = self.study.mesh.guarantee
        if record.u_T is None or not (self.estimator is not None or guarantee or output.fields or output.asks):
            return record
        names = [v.name for v in requested_variables(self.study)] if output.asks else []
        numbers = dict(record.numbers) | {name: np.full(len(record), np.nan) for name in names}
        fields, status, reasons = dict(record.fields), record.status.copy(), dict(record.reasons)
        for row in np.flatnonzero(record.status == PointStatus.OK).tolist():
            scene, v, found = self.study.scenes[int(record.points[row])], record.u_T[row], dict[str, Any]()
            with self.times.of("estimate"):
                if guarantee:
                    found = self._bounds.look(scene, v)
                if self.estimator is not None:
                    found |= self.estimator.look(record.index(row), scene, v, found.get("error_bound_relative"))
            if output.fields and not record.fields:
                for name, values in self.level.fields(scene, v).items():
                    fields.setdefault(name, np.full((len(record), len(values)), np.nan))[row] = values
            try:
                for of in self._requested if output.asks else ():
                    found |= of(scene, v)
            except Exception as error:  # the solution itself stays, and all that was asked goes
                reason = f"numbers on request: {type(error).__name__}: {error}"
                status[row], reasons[row] = PointStatus.ERROR, reason
                found = {name: value for name, value in found.items() if name not in names}
            for name, value in found.items():
                numbers.setdefault(name, np.full((len(record), *np.shape(value)), np.nan))[row] = value
        return replace(record, status=status, reasons=reasons, numbers=numbers, fields=fields)


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

    points: their places in the sweep in C order
    wave:   blocks that begin from solutions of other waves follow these;  ratio: which λ/μ, which all points share
    """

    points: Places
    wave: int = 0
    ratio: int = 0


def keeps_solutions(study: Study) -> bool:
    """Whether points begin from solutions of their neighbours."""
    return study.solver.branch == "continued" or not study.solver.in_blocks


def blocks_of(study: Study, m: int, n_points: int) -> list[Block]:
    """The blocks of a level in the order in which they are solved. m: contact unknowns;  n_points: nodes of the mesh"""
    materials, of = combinations(study.scenes, *of_stiffness(study.scenes))
    numbers: dict[object, int] = {}
    ratio = np.array([numbers.setdefault(("ratio", Level.ratio(s)), len(numbers)) for s in materials])[of]
    mu = np.array([numbers.setdefault(("mu", s.material.mu), len(numbers)) for s in materials])[of]
    places = np.arange(len(study.scenes))
    wave = _waves(study)
    order = np.lexsort((places, mu, ratio, wave))  # else as in the file, which is written meanwhile
    size = _size(study, m, n_points)
    kind = wave[order] * (ratio.max(initial=0) + 1) + ratio[order]
    cuts = np.flatnonzero(np.diff(kind)) + 1
    parts = [part for whole in np.split(order, cuts) for part in np.array_split(whole, -(-len(whole) // size))]
    return [Block(part, int(wave[part[0]]), int(ratio[part[0]])) for part in parts]


def _size(study: Study, m: int, n_points: int) -> int:
    if not study.solver.in_blocks:
        return 1
    if study.mesh.estimates or study.mesh.guarantee:
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


class Solutions:
    """Contact solutions of a level found so far: where neighbours begin from."""

    def __init__(self, study: Study, m: int, order: Places) -> None:
        """m: contact unknowns;  order: (P,) places in the order in which they are solved"""
        self._shape, self._rank = study.shape, np.argsort(order)
        self._v = np.full((len(study.scenes), m), np.nan)

    def take(self, block: BlockRecord) -> None:
        """Remember a block's solutions."""
        if block.u_T is not None:
            ok = block.status == PointStatus.OK
            self._v[block.points[ok]] = block.u_T[ok]

    def beside(self, points: Places) -> Array:
        """(P, m) the solutions one step back along the last sweep dimension that has a step back and a solution there.
        NaN in rows without one. One that is solved later counts as none, so that a resumed run has the same bits."""
        found = np.full((len(points), self._v.shape[1]), np.nan)
        index = np.array(np.unravel_index(points, self._shape)) if self._shape else np.zeros((0, len(points)), int)
        for d in range(len(self._shape)):  # the last dimension overwrites those before
            back = index.copy()
            back[d] -= 1
            inside = np.flatnonzero(back[d] >= 0)
            before = np.ravel_multi_index(tuple(back[:, inside]), self._shape)
            v = self._v[before]
            known = ~np.isnan(v).any(axis=1) & (self._rank[before] < self._rank[points[inside]])
            found[inside[known]] = v[known]
        return found


def at_contact_nodes(function: LineFunction, mesh: PlaneMesh, line: ContactLine) -> Array:
    """(m,) a function of place and normal at the nodes of the line, with the normals of the exact curve."""
    normals = np.zeros_like(mesh.points)
    normals[line.segments] = mesh.end_normals[line.which]
    x, y = line.xy.T
    return function(x, y, normals[line.nodes])
