"""The solver of one level: blocks of points are condensed here, solved by an executor, and become
records.

A block depends on the study and on the size of the contact line alone. A run that was stopped, or
that others help with, therefore has the same blocks, and in them the same numbers, to the bit. The
points of a block share λ/μ; their loads are rows of one array and their laws rows of one table
(tcstudy.contact). Points are solved one by one, in this process, where the study names several
solvers for comparison, or the bundle method.

The contact line has the normals of the exact curve: the mesh cuts arcs into chords, but errors, and
the exact solution as a start, belong to the curve.
"""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from concurrent.futures import Future
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from functools import cached_property, partial
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from tcstudy.accuracy.norms import LineFunction
from tcstudy.condense import NotPositiveDefinite
from tcstudy.contact.all_solutions import Equilibria
from tcstudy.contact.boxes import Limits
from tcstudy.contact.certificates import as_row, certify
from tcstudy.contact.problem import CondensedBody, ContactProblem, Status
from tcstudy.contact.solve import Answer, solve_block, solve_contact
from tcstudy.data.records import BlockRecord
from tcstudy.data.schema import (
    ALL_PROVED,
    BALANCED,
    EXISTENCE_RADIUS,
    HEAT_BOUND,
    LIMITED,
    MET,
    NOT_ALL,
    NOT_JUDGED,
    OF_POLYGON,
    SOLUTION_OPENING,
    UNBALANCED,
    UNKNOWN,
    PointStatus,
    requested_variables,
)
from tcstudy.exact.solution import exact_u_T
from tcstudy.executors.processes import TIMEOUT, Job, SerialExecutor, WorkersFailed, timed
from tcstudy.fem.forms import ContactLine
from tcstudy.fem.meshes import PlaneMesh
from tcstudy.laws.composed import row_laws
from tcstudy.laws.laws import Laws
from tcstudy.laws.pieces import UP
from tcstudy.offline.error_bound import ErrorBounds
from tcstudy.offline.existence import Existence, count_of_body, distances_of
from tcstudy.offline.level import CondensedBlock, Level, loose_body
from tcstudy.offline.openings import opening_numbers
from tcstudy.offline.requested_outputs import line_numbers
from tcstudy.offline.unresisted import judged
from tcstudy.refine.family import ErrorEstimator
from tcstudy.scene.points import combinations, load_axes, of_stiffness
from tcstudy.scene.records import Scene
from tcstudy.scene.study import SLIP_BOUNDS, Study

if TYPE_CHECKING:
    from tcstudy.contact.pressure_friction import PressureFriction

Array = NDArray[np.float64]
Places = NDArray[np.intp]
Pending = Callable[[], BlockRecord]
"""A block on its way: the call waits for the executor and returns the record."""


@dataclass
class Times:
    """Wall times of a level [s]; the last two grow as its points are taken.

    geometry: of the body, once a run
    mesh:     of this mesh alone
    assemble: of matrices and contact line
    points:   of all points, without estimates
    estimate: of error estimates, and of the choice of the next mesh
    """

    geometry: float = 0.0
    mesh: float = 0.0
    assemble: float = 0.0
    points: float = 0.0
    estimate: float = 0.0

    @contextmanager
    def measure(self, stage: str) -> Iterator[None]:
        """Add the time of the statements within to that of a stage."""
        clock = time.perf_counter()
        yield
        setattr(self, stage, getattr(self, stage) + time.perf_counter() - clock)


@dataclass(frozen=True)
class LevelSolver:
    """The solver of the blocks of a level."""

    study: Study
    level: Level
    estimator: ErrorEstimator | None
    executor: SerialExecutor = field(default_factory=SerialExecutor)
    times: Times = field(default_factory=Times)
    bodies: dict[object, CondensedBody] = field(default_factory=dict)

    @cached_property
    def solutions(self) -> NeighbourSolutions | None:
        """Solutions found so far, where other points start from them."""
        if not keeps_solutions(self.study):
            return None
        order = np.concatenate([block.points for block in self.blocks])
        return NeighbourSolutions(self.study, self.level.m, order)

    @cached_property
    def blocks(self) -> list[Block]:
        """All blocks of the level, in the order in which they are solved."""
        return blocks_of(self.study, self.level.m, self.level.mesh.n_points)

    @cached_property
    def exact(self) -> Array | None:
        """(m,) the exact solution at the contact nodes, a start where the study gives one."""
        if self.study.exact is None:
            return None
        return at_contact_nodes(exact_u_T(self.study.exact), self.level.mesh, self.level.line)

    @cached_property
    def has_extras(self) -> bool:
        """Whether solved points get estimates, bounds, fields or requested outputs."""
        output = self.study.output
        return bool(
            self.estimator is not None
            or self.study.mesh.bounds_errors
            or output.fields
            or output.asks
        )

    def solve(self, finished: Sequence[BlockRecord] = ()) -> Iterator[BlockRecord]:
        """Solve the unfinished points of the level and yield their blocks in order.

        finished: blocks of an earlier run. Their solutions start neighbours. Their errors are
                  estimated again, since the next mesh depends on them.
        A few blocks are prepared ahead, so that the executor need not wait for loads.
        """
        is_done = np.zeros(len(self.study.scenes), dtype=bool)
        for record in finished:
            is_done[record.points] = True
            if self.estimator is not None:
                record = self._completed(record)
            self._remember(record)
        waiting = deque[tuple[Block, Pending]]()
        for block in self.blocks:
            while waiting and self._must_wait(block, waiting):
                yield from self._finished(*waiting.popleft())
            unsolved = replace(block, points=block.points[~is_done[block.points]])
            if len(unsolved.points):
                waiting.append((unsolved, self._started(unsolved)))
        while waiting:
            yield from self._finished(*waiting.popleft())

    def _must_wait(self, block: Block, waiting: deque[tuple[Block, Pending]]) -> bool:
        """Return whether blocks on their way must end before this block is started.

        They must end if it starts from their solutions, or takes away the factor that they need.
        """
        last_block, _ = waiting[-1]
        if len(waiting) > self.executor.ahead:
            return True
        if self.solutions is not None and block.wave != last_block.wave:
            return True
        return self.has_extras and block.ratio != last_block.ratio

    def _finished(self, block: Block, pending: Pending) -> Iterator[BlockRecord]:
        for record in self._records(block, pending):
            self._remember(record)
            yield record

    def _remember(self, record: BlockRecord) -> None:
        if self.solutions is not None:
            self.solutions.store(record)

    def _records(self, block: Block, pending: Pending) -> Iterator[BlockRecord]:
        """Yield the record of a block; if it breaks down, halve it until a single point fails.

        The failure of a point becomes a status with its reason: one point must not end a sweep.
        """
        try:
            yield self._completed(pending())
            return
        except WorkersFailed:
            raise
        except Exception as error:  # the data keep its words
            if len(block.points) == 1:
                yield all_failed(self.study, self.level.mesh.level, block.points, *failed_by(error))
                return
        halves = [replace(block, points=part) for part in np.array_split(block.points, 2)]
        started = [self._started(half) for half in halves]
        for half, pending_half in zip(halves, started, strict=True):
            yield from self._records(half, pending_half)

    def _started(self, block: Block) -> Pending:
        """Return the block on its way; an early exception is raised where its record is due."""
        try:
            starts = None if self.solutions is None else self.solutions.neighbours(block.points)
            if self.study.in_blocks:
                return self._submitted(block, starts)
            (place,) = block.points.tolist()
            start = None
            if starts is not None and not np.isnan(starts).any():
                start = starts[0]
            return lambda: solve_point(self.study, self.level, place, start, self.exact)
        except Exception as error:
            broken: Future[BlockRecord] = Future()
            broken.set_exception(error)
            return broken.result

    def _submitted(self, block: Block, starts: Array | None) -> Pending:
        """Condense a block and hand its contact problems to the executor.

        starts: (P, m) solutions that points start from, NaN in rows without; None if there are none
        """
        plan = self.study.solver
        scenes = [self.study.scenes[place] for place in block.points.tolist()]
        condensed = self.level.block(scenes)
        factor = condensed.mu / condensed.mu[0]
        loads = condensed.l_tilde / factor[:, None]
        laws = row_laws([self.level.law(scene) for scene in scenes], factor)
        points, m = loads.shape
        timeout = max(TIMEOUT, MAX_FACTORISATIONS / SLOW_FLOPS * points * m**3 / 3.0)
        limits = None
        if plan.every:
            limits = Limits(plan.max_boxes, plan.max_seconds)
            timeout += points * (limits.seconds + MAX_SECONDS_OVER_LIMIT)
        name = f"level-{self.level.mesh.level} points {block.points.min()}-{block.points.max()}"
        future = self.executor.submit(
            Job(timed, name, timeout),
            solve_block,
            self._body(scenes[0], condensed),
            loads,
            laws,
            plan.branch,
            plan.tolerance,
            starts,
            self.exact,
            limits,
        )

        def record() -> BlockRecord:
            answers, seconds = future.result()
            return block_record(
                self.study, self.level, block.points, scenes, condensed, laws, answers, seconds
            )

        return record

    def _body(self, scene: Scene, condensed: CondensedBlock) -> CondensedBody:
        """Return the condensed body of a block, made once for blocks that follow one another."""
        mu = float(condensed.mu[0])
        key = (Level.ratio(scene), mu)
        if key not in self.bodies:
            self.bodies.clear()
            A_tilde = mu * condensed.A_tilde
            if condensed.is_held:
                body = CondensedBody.of(
                    A_tilde, condensed.c, condensed.lambda_1_error, condensed.blocks
                )
            else:
                body = loose_body(A_tilde, condensed.c, condensed.blocks)
            self.bodies[key] = body
        return self.bodies[key]

    @cached_property
    def _proofs(self) -> Existence:
        return Existence(self.level, self._bounds)

    @cached_property
    def _bounds(self) -> ErrorBounds:
        return ErrorBounds(self.level)

    @cached_property
    def _output_functions(self) -> list[Callable[[Scene, Array], dict[str, Any]]]:
        """Functions of a scene and its solution v (m,) that return outputs by variable name."""
        # imported only for a study that requests more
        from tcstudy.offline.requested_outputs import RequestedOutputs

        output = self.study.output
        functions: list[Callable[[Scene, Array], dict[str, Any]]] = []
        if output.probes or output.quantities:
            functions.append(RequestedOutputs(self.level, output).of)
        if output.sensitivity:
            from tcstudy.study.sensitivities import derivatives_of

            functions.append(
                lambda scene, v: derivatives_of(self.level, scene, v, output.sensitivity)
            )
        return functions

    def _completed(self, record: BlockRecord) -> BlockRecord:
        """Return the record with the extras of its solved points: errors, fields, outputs."""
        if record.v is None or not self.has_extras:
            return record
        solutions_of_rows = record.v
        output = self.study.output
        numbers = dict(record.numbers)
        fields = dict(record.fields)
        status = record.status.copy()
        reasons = dict(record.reasons)
        if output.asks:
            for variable in requested_variables(self.study):
                numbers[variable.name] = np.full(len(record), np.nan)
        solutions = self._with_radii(record.solutions)
        for row in np.flatnonzero(record.status == PointStatus.OK).tolist():
            scene = self.study.scenes[int(record.points[row])]
            v = solutions_of_rows[row]
            values = self._errors(record.index(row), scene, v)
            if EXISTENCE_RADIUS.name in solutions:
                is_own = solutions["solution_point"] == record.points[row]
                values |= self._existence(scene, solutions, np.flatnonzero(is_own))
            if output.fields and not record.fields:
                _put_row(fields, row, len(record), self.level.fields(scene, v))
            try:
                values |= self._requested_outputs(scene, v)
            except Exception as error:  # the solution itself stays, without all requested outputs
                status[row] = PointStatus.ERROR
                reasons[row] = f"numbers on request: {type(error).__name__}: {error}"
            _put_row(numbers, row, len(record), values)
        return replace(
            record,
            status=status,
            reasons=reasons,
            numbers=numbers,
            fields=fields,
            solutions=solutions,
        )

    def _with_radii(self, solutions: dict[str, NDArray[Any]]) -> dict[str, NDArray[Any]]:
        """Return the solutions of a block with room for what is proved near them, if asked for."""
        if not solutions or not self.study.mesh.bounds_errors:
            return solutions
        radii = np.full(len(solutions["solution_point"]), np.nan)
        return {**solutions, EXISTENCE_RADIUS.name: radii}

    def _existence(
        self, scene: Scene, solutions: dict[str, NDArray[Any]], own: Places
    ) -> dict[str, float]:
        """Return how many solutions the body has at least, by variable name; put their radii.

        own: rows of the solutions of one point
        """
        radii, v = solutions[EXISTENCE_RADIUS.name], solutions["solution_u_T"][own]
        is_stable = solutions["solution_stable"][own] == 1
        with self.times.measure("estimate"):
            distances = distances_of(self.level.condensed(scene).problem.A_tilde, v)
            apart = distances + np.diag(np.full(len(own), np.inf))
            sizes = list[float]()
            for i in np.flatnonzero(is_stable).tolist():
                ball = self._proofs.ball(scene, v[i], 0.5 * float(apart[i].min()))
                radii[own[i]] = ball.radius
                if np.isnan(ball.radius):
                    sizes.append(ball.size_needed(self.level.mesh.h_max))
        return {
            "solutions_of_body": count_of_body(radii[own], distances),
            "existence_size": float(np.min(sizes)) if sizes else float("nan"),
        }

    def _errors(self, index: tuple[int, ...], scene: Scene, v: Array) -> dict[str, Any]:
        """Return the error bounds and estimates of a solution by variable name."""
        values = dict[str, Any]()
        with self.times.measure("estimate"):
            if self.study.mesh.bounds_errors:
                with_slips = SLIP_BOUNDS in self.study.output.quantities
                values |= self._bounds.look(scene, v, with_slips)
            if self.estimator is not None:
                bound = values.get("error_bound_relative")
                values |= self.estimator.look(index, scene, v, bound)
        return values

    def _requested_outputs(self, scene: Scene, v: Array) -> dict[str, Any]:
        values = dict[str, Any]()
        if self.study.output.asks:
            for function in self._output_functions:
                values |= function(scene, v)
        return values


def _put_row(arrays: dict[str, Array], row: int, n_rows: int, values: Mapping[str, Any]) -> None:
    """Store values in a row of their arrays; a new array is NaN in all other rows."""
    for name, value in values.items():
        if name not in arrays:
            arrays[name] = np.full((n_rows, *np.shape(value)), np.nan)
        arrays[name][row] = value


# -- which points are solved together

MAX_POINTS = 1024
"""Points of a block."""
TARGET_ENTRIES = 2**17
"""Entries of the arrays (P, m) of a block to aim at, so that many workers have a part."""
MIN_POINTS = 256
"""Points from which a larger block is hardly cheaper per point."""
MAX_ENTRIES = 2**18
"""Entries of the arrays of a block, which may take away from MIN_POINTS."""
MAX_ESTIMATED_POINTS = 16
"""Points of a block where the error of each is estimated, which takes longer than a solution."""
MAX_SEARCHED_POINTS = 64
"""Points of a block where all solutions of each are sought."""
MAX_FIELD_VALUES = 2**22
"""Values of whole-body fields in a block."""
MAX_SECONDS_OVER_LIMIT = 10.0
"""Time of a point beyond its limit, which is checked between two sets of boxes [s]."""
MAX_FACTORISATIONS = 2000.0
"""Factorisations of Ã per point whose time a block may take on a slow processor."""
SLOW_FLOPS = 1e9
"""Speed of a slow processor [1/s]."""


@dataclass(frozen=True)
class Block:
    """Points that are solved together.

    points: their places in the sweep in C order
    wave:   number of steps to the start of the sweep; a wave starts from solutions of earlier ones
    ratio:  number of the λ/μ that all points share
    """

    points: Places
    wave: int = 0
    ratio: int = 0


def keeps_solutions(study: Study) -> bool:
    """Return whether points start from solutions of their neighbours."""
    return study.solver.branch == "continued" or not study.in_blocks


def blocks_of(study: Study, m: int, n_points: int) -> list[Block]:
    """Return the blocks of a level in the order in which they are solved.

    m: contact DOFs;  n_points: nodes of the mesh
    """
    materials, material_of_point = combinations(study.scenes, *of_stiffness(study.scenes))
    ratio = _numbered(Level.ratio(scene) for scene in materials)[material_of_point]
    mu = _numbered(scene.material.mu for scene in materials)[material_of_point]
    wave = _waves(study)
    places = np.arange(len(study.scenes))
    order = np.lexsort((places, mu, ratio, wave))  # else as in the file, which is written meanwhile
    group = wave[order] * (ratio.max(initial=0) + 1) + ratio[order]
    cuts = np.flatnonzero(np.diff(group)) + 1
    size = _size(study, m, n_points)
    blocks = list[Block]()
    for points_of_group in np.split(order, cuts):
        n_blocks = -(-len(points_of_group) // size)
        for points in np.array_split(points_of_group, n_blocks):
            first = points[0]
            blocks.append(Block(points, int(wave[first]), int(ratio[first])))
    return blocks


def _numbered(keys: Iterable[object]) -> Places:
    """Return a number for every key: equal keys share it, in order of their appearance."""
    numbers = dict[object, int]()
    return np.array([numbers.setdefault(key, len(numbers)) for key in keys], dtype=np.intp)


def _size(study: Study, m: int, n_points: int) -> int:
    """Return the largest number of points of a block."""
    if not study.in_blocks:
        return 1
    if study.mesh.estimates or study.mesh.bounds_errors:
        return MAX_ESTIMATED_POINTS
    if study.solver.every:
        return MAX_SEARCHED_POINTS
    nodes = max(1, m)
    size = max(TARGET_ENTRIES // nodes, min(MIN_POINTS, MAX_ENTRIES // nodes))
    size = max(1, min(MAX_POINTS, size))
    if study.output.fields:
        size = max(1, min(size, MAX_FIELD_VALUES // (3 * n_points)))
    return size


def _waves(study: Study) -> Places:
    """Return (P,) the steps back to the start of the sweep, 0 where points start on their own."""
    if study.solver.branch != "continued" or not study.shape:
        return np.zeros(len(study.scenes), dtype=np.intp)
    return np.asarray(sum(np.indices(study.shape)), dtype=np.intp).ravel()


class NeighbourSolutions:
    """Contact solutions of a level found so far, from which neighbours start."""

    def __init__(self, study: Study, m: int, order: Places) -> None:
        """Store no solution yet.

        m: contact DOFs;  order: (P,) places in the order in which they are solved
        """
        self._shape = study.shape
        self._rank = np.argsort(order)
        loads = load_axes(study)
        parameters = [axis for axis in range(len(study.shape)) if axis not in loads]
        self._axes = [*parameters, *loads]  # of a later one the neighbour is preferred
        self._v = np.full((len(study.scenes), m), np.nan)

    def store(self, block: BlockRecord) -> None:
        """Store a block's solutions."""
        if block.v is not None:
            is_solved = block.status == PointStatus.OK
            self._v[block.points[is_solved]] = block.v[is_solved]

    def neighbours(self, points: Places) -> Array:
        """Return (P, m) the solutions one step back along an axis, NaN in rows without one.

        It is the last axis of a load, or else the last axis, with a step back and a solution there.
        A solution of a point that is solved later is not used, so that a resumed run has the same
        bits.
        """
        solutions = np.full((len(points), self._v.shape[1]), np.nan)
        index = np.zeros((0, len(points)), int)
        if self._shape:
            index = np.array(np.unravel_index(points, self._shape))
        for axis in self._axes:
            step_back = index.copy()
            step_back[axis] -= 1
            rows = np.flatnonzero(step_back[axis] >= 0)
            neighbours = np.ravel_multi_index(tuple(step_back[:, rows]), self._shape)
            v = self._v[neighbours]
            is_earlier = self._rank[neighbours] < self._rank[points[rows]]
            is_usable = ~np.isnan(v).any(axis=1) & is_earlier
            solutions[rows[is_usable]] = v[is_usable]
        return solutions


def at_contact_nodes(function: LineFunction, mesh: PlaneMesh, line: ContactLine) -> Array:
    """Return (m,) a function of place and normal at the contact nodes.

    The normals are those of the exact curve.
    """
    normals = np.zeros_like(mesh.points)
    normals[line.segments] = mesh.end_normals[line.which]
    x, y = line.xy.T
    return function(x, y, normals[line.nodes])


# -- a point by itself


def solve_point(
    study: Study,
    level: Level,
    place: int,
    neighbour: Array | None = None,
    exact: Array | None = None,
) -> BlockRecord:
    """Solve one point of the sweep on one level; a failure becomes a status with its reason.

    neighbour: (m,) solution of a neighbouring point, a start where the study's branch asks for one
    exact:     (m,) exact solution at the contact nodes, a start where the study gives one
    """
    points = np.array([place])
    try:
        return _solved_point(study, level, points, neighbour, exact)
    except Exception as error:  # one point must not end a sweep; the data keep its words
        return all_failed(study, level.mesh.level, points, *failed_by(error))


def _solved_point(
    study: Study, level: Level, points: Places, neighbour: Array | None, exact: Array | None
) -> BlockRecord:
    plan = study.solver
    scene = study.scenes[int(points[0])]
    problem = level.condensed(scene).problem
    condensed = level.block([scene])
    friction = level.pressure_friction(scene)
    if friction is not None:
        return _pressed_point(study, level, points, neighbour, problem, condensed, friction)
    solve = partial(
        solve_contact,
        tolerance=plan.tolerance,
        max_iterations=plan.max_iterations,
        branch=plan.branch,
        neighbour=neighbour,
        exact=exact,
    )
    runs = [timed(solve, problem, name) for name in plan.names]
    answer, seconds = runs[0]
    lambda_1 = level.lambda_1(scene)
    certificate = certify(
        problem, answer.v, lambda_1, plan.tolerance, residual=answer.inclusion_residual
    )
    row = as_row(replace(answer, certificate=certificate))
    laws = row_laws([problem.law], np.ones(1))
    record = block_record(study, level, points, [scene], condensed, laws, row, seconds)
    numbers = {"evaluations": answer.evaluations}
    if len(runs) > 1:
        numbers |= _by_solver(condensed, runs)
    fields = level.fields(scene, answer.v) if study.output.fields else {}
    return replace(record, numbers=record.numbers | _one_row(numbers), fields=_one_row(fields))


def _pressed_point(
    study: Study,
    level: Level,
    points: Places,
    neighbour: Array | None,
    problem: ContactProblem,
    condensed: CondensedBlock,
    friction: PressureFriction,
) -> BlockRecord:
    """Solve one point whose friction knows the pressure."""
    # imported only for such scenes
    from tcstudy.contact.pressure_friction import as_answer, solve_with_pressure

    scene = study.scenes[int(points[0])]
    tolerance = study.solver.tolerance
    solved, seconds = timed(solve_with_pressure, problem, friction, tolerance, neighbour)
    answer, law = as_answer(problem, friction, solved, tolerance)
    laws = row_laws([law], np.ones(1))
    record = block_record(study, level, points, [scene], condensed, laws, as_row(answer), seconds)
    numbers = record.numbers | _one_row({"contraction": solved.contraction})
    fields = level.fields(scene, answer.v) if study.output.fields else {}
    return replace(record, numbers=numbers, fields=_one_row(fields))


def _by_solver(condensed: CondensedBlock, runs: Sequence[tuple[Answer, float]]) -> dict[str, Any]:
    """Return the results of every solver, and their distances from the first solution."""
    answers = [answer for answer, _ in runs]
    constant = float(condensed.constant[0])
    first = answers[0].v
    scale = float(np.max(np.abs(first), initial=0.0))
    distances = [float(np.max(np.abs(answer.v - first), initial=0.0)) for answer in answers]
    if scale > 0.0:
        distances = [distance / scale for distance in distances]
    return {
        "solver_residual": [answer.inclusion_residual for answer in answers],
        "solver_energy": [answer.energy + constant for answer in answers],
        "solver_iterations": [answer.iterations for answer in answers],
        "solver_time": [seconds for _, seconds in runs],
        "solver_difference": distances,
    }


def _one_row(values: Mapping[str, Any]) -> dict[str, Array]:
    return {name: np.array([value], dtype=float) for name, value in values.items()}


def failed_by(error: Exception) -> tuple[PointStatus, str]:
    """Return the status and the reason of points that an exception ends."""
    if isinstance(error, NotPositiveDefinite):
        return PointStatus.SINGULAR, str(error)
    return PointStatus.ERROR, f"{type(error).__name__}: {error}"


def all_failed(
    study: Study, level: int, points: Places, status: PointStatus, reason: str
) -> BlockRecord:
    """Return the record of points of a level without results."""
    n_points = len(points)
    statuses = np.full(n_points, int(status), dtype=np.int8)
    reasons = dict.fromkeys(range(n_points), reason)
    return BlockRecord(level, study.shape, points, statuses, reasons, numbers={})


# -- the record of a block

STATUS = np.full(max(Status) + 1, int(PointStatus.NOT_CONVERGED), dtype=np.int8)
"""Statuses of the data by those of a solver."""
STATUS[Status.CONVERGED] = PointStatus.OK
STATUS[Status.INCLUSION_VIOLATED] = PointStatus.INCLUSION_VIOLATED
STATUS[Status.NOT_POSITIVE_DEFINITE] = PointStatus.SINGULAR


def block_record(
    study: Study,
    level: Level,
    points: Places,
    scenes: Sequence[Scene],
    condensed: CondensedBlock,
    laws: Laws,
    answers: Answer,
    seconds: float,
) -> BlockRecord:
    """Return the record of a block of answers, in the units of data.schema.

    laws: of the rows of the block;  seconds: for all of them
    """
    factor = condensed.mu / condensed.mu[0]  # stiffness of a point's body over that of the block's
    if not condensed.is_held:
        answers = judged(
            answers,
            condensed.l_tilde / factor[:, None],
            laws,
            condensed.c,
            level.contact_motions(scenes[0]),
            partial(level.motion_name, scenes[0]),
            scenes[0].knows_pressure,
        )
    # without friction a solution has nothing but rounding of ξ, which the inclusion residual tells
    is_frictionless = np.array([scene.friction.vanishes for scene in scenes])
    is_zero = (answers.status == Status.CONVERGED) & is_frictionless
    is_slip = np.arange(len(condensed.c)) < level.line.m
    xi = np.where(is_zero[:, None] & is_slip, 0.0, answers.xi * factor[:, None])
    traction = xi / condensed.c
    is_on_jump = laws.kind(laws.locate(answers.v)) == UP
    rests = np.where(np.isnan(answers.v), UNKNOWN, is_on_jump).astype(np.int8)
    u_T, opening = level.split(answers.v)
    xi_T, S_N = level.split(traction)
    sticks, rests_N = level.split(rests)
    slip_laws = laws.at(level.split(laws.index)[0])
    values = {
        **_answer_values(answers, condensed, factor),
        "u_T_max": np.max(np.abs(u_T), axis=-1, initial=0.0),
        "friction_resultant": level.split(xi)[0].sum(axis=-1),
        **_proof_values(answers, condensed, factor),
        **_condensed_values(condensed),
        "time_solve": np.full(len(points), seconds / len(points)),
        **line_numbers(level, scenes, slip_laws, u_T, xi_T),
    }
    if level.opening is not None:
        values |= opening_numbers(level, scenes, laws, answers.v, traction)
    solutions: dict[str, Array] = {}
    if answers.solutions is not None:
        values |= _solution_counts(answers.solutions)
        solutions = _all_solutions(answers.solutions, points, factor, condensed)
    return BlockRecord(
        level=level.mesh.level,
        shape=study.shape,
        points=points,
        status=STATUS[answers.status],
        reasons={row: reason for row, reason in enumerate(answers.reason) if reason},
        numbers={name: np.asarray(value, dtype=float) for name, value in values.items()},
        u_T=u_T,
        xi=xi_T,
        sticks=sticks,
        solutions=solutions,
        opening=opening if level.opening is not None else None,
        S_N=S_N if level.opening is not None else None,
        rests_N=rests_N if level.opening is not None else None,
    )


def _answer_values(answers: Answer, condensed: CondensedBlock, factor: Array) -> dict[str, Any]:
    """Return the results of the solver by variable name.

    factor: (P,) stiffness of a point's body over that of the block's
    """
    is_solved = answers.status == Status.CONVERGED
    accepted = np.where(answers.limited, LIMITED, MET)
    constant = condensed.constant
    return {
        "energy": answers.energy * factor + constant,
        "inclusion_residual": answers.inclusion_residual,
        "inclusion_rounding": answers.rounding,
        "inclusion_status": np.where(is_solved, accepted, NOT_JUDGED),
        "iterations": answers.iterations,
        "start_used": answers.start,
        "start_energy": answers.energies * factor[:, None] + constant[:, None],
    }


def _proof_values(answers: Answer, condensed: CondensedBlock, factor: Array) -> dict[str, Any]:
    """Return the certificates of the answers, and λ₁ and ω that they rest on, by variable name."""
    certificate = answers.certificate
    assert certificate is not None
    omega = certificate.omega * factor
    values = {
        "lambda_1": condensed.mu * condensed.lambda_1,
        "lambda_1_error": np.full(len(factor), condensed.lambda_1_error),
        "omega": omega,
        "uniqueness_margin": certificate.margin * factor,
        "unique": certificate.unique,
        "strict_minimum": certificate.strict_minimum,
        "global_minimum": certificate.global_minimum,
    }
    if condensed.band is not None:
        values |= condensed.band.numbers(omega, condensed.mu)
    return values


def _condensed_values(condensed: CondensedBlock) -> dict[str, Array]:
    """Return the temperatures and the time of the condensation by variable name."""
    n_points = len(condensed.mu)
    balance = condensed.heat_balance
    heat_status = np.where(balance <= HEAT_BOUND, BALANCED, UNBALANCED)
    return {
        "theta_mean": condensed.theta_mean,
        "heat_balance": balance,
        "heat_status": np.where(np.isnan(balance), NOT_JUDGED, heat_status),
        "time_condense": np.full(n_points, condensed.time / n_points),
    }


def _solution_counts(equilibria: Sequence[Equilibria]) -> dict[str, Array]:
    """Return (P,) how many solutions points have, and whether these are all, by variable name."""
    is_complete = np.array([point.complete for point in equilibria], dtype=bool)
    is_polygon = np.array([point.law_error > 0.0 for point in equilibria], dtype=bool)
    proved = np.where(is_polygon, OF_POLYGON, ALL_PROVED)
    return {
        "solutions": np.array([len(point) for point in equilibria]),
        "stable_solutions": np.array([np.count_nonzero(point.stable) for point in equilibria]),
        "complete": np.where(is_complete, proved, NOT_ALL),
    }


def _all_solutions(
    equilibria: Sequence[Equilibria], points: Places, factor: Array, condensed: CondensedBlock
) -> dict[str, NDArray[Any]]:
    """Return all solutions of a block, one row per solution, by variable name.

    points: (P,) places in the sweep
    factor: (P,) stiffness of a point's body over that of the block's
    """
    row = np.repeat(np.arange(len(points)), [len(point) for point in equilibria])
    energy = np.concatenate([point.energy for point in equilibria])
    xi = np.concatenate([point.xi for point in equilibria])
    stable = np.concatenate([point.stable for point in equilibria])
    pieces = np.concatenate([point.sides for point in equilibria])
    by_unknown = {
        "solution_u_T": np.concatenate([point.v for point in equilibria]),
        "solution_xi": xi * factor[row, None] / condensed.c,
        "solution_piece": pieces.astype(np.int32),
    }
    if condensed.blocks:
        m = condensed.blocks[0]
        for name, of_openings in zip(by_unknown.copy(), SOLUTION_OPENING, strict=True):
            by_unknown[of_openings.name] = by_unknown[name][:, m:]
            by_unknown[name] = by_unknown[name][:, :m]
    return {
        "solution_point": points[row].astype(np.int32),
        "solution_energy": energy * factor[row] + condensed.constant[row],
        "solution_stable": stable.astype(np.int8),
        **by_unknown,
    }
