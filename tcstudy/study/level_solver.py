"""The solver of one level: blocks of points are condensed here, solved by an executor, and become
records.

A block depends on the study and on the size of the contact line alone, so that a run that was
stopped, or that others help with, has the same blocks and in them the same numbers, to the bit.
Points of a block share λ/μ; their loads are rows of one array and their laws rows of one table
(tcstudy.contact). Points for which the study names several solvers or the bundle method are solved
one by one, here, by any solver, by several, for comparison.

The contact line has the normals of the exact curve: the mesh cuts arcs into chords; errors, and the
exact solution as a start, belong to the curve.
"""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import Future
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tcstudy.accuracy.norms import LineFunction
from tcstudy.condense import NotPositiveDefinite
from tcstudy.contact.all_solutions import Equilibria, Limits
from tcstudy.contact.certificates import as_row, certify
from tcstudy.contact.problem import CondensedBody, Status
from tcstudy.contact.solve import Answer, solve_block, solve_contact
from tcstudy.data.records import BlockRecord
from tcstudy.data.schema import (
    ALL_PROVED,
    BALANCED,
    HEAT_BOUND,
    LIMITED,
    MET,
    NOT_ALL,
    NOT_JUDGED,
    OF_POLYGON,
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
from tcstudy.offline.level import CondensedBlock, Level
from tcstudy.offline.requested_outputs import line_numbers
from tcstudy.refine.family import ErrorEstimator
from tcstudy.scene.points import combinations, load_axes, of_stiffness
from tcstudy.scene.records import Scene
from tcstudy.scene.study import Study

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
    def measure(self, what: str) -> Iterator[None]:
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
        return Solutions(
            self.study, self.level.line.m, np.concatenate([block.points for block in self.blocks])
        )

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
        """Solve the points of the level of which an earlier run left nothing, block by block in
        their order.

        finished: what it left; its solutions start neighbours, and their errors are estimated
        again, since the next
                  mesh depends on them
        A few blocks are prepared ahead, so that whoever solves them need not wait for loads; but
        not one that needs the solutions of those before, or takes away the factor that these need
        to end.
        """
        output, waiting = self.study.output, deque[tuple[Block, Pending]]()
        done = np.zeros(len(self.study.scenes), dtype=bool)
        more = (
            self.estimator is not None or self.study.mesh.guarantee or output.fields or output.asks
        )
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
        """All points at once; where that breaks down, half of them at a time, to find the one that
        does it. Every failure becomes a status with its reason: one point must not end a sweep."""
        try:
            yield self._completed(pending())
            return
        except WorkersFailed:
            raise
        except Exception as error:  # what it was stands in the data
            if len(block.points) == 1:
                yield all_failed(self.study, self.level.mesh.level, block.points, *failed_by(error))
                return
        halves = [replace(block, points=part) for part in np.array_split(block.points, 2)]
        for half, one in [(half, self._started(half)) for half in halves]:
            yield from self._records(half, one)

    def _started(self, block: Block) -> Pending:
        """The block on its way; what breaks down before it is handed over is told where its record
        is due."""
        try:
            near = None if self.solutions is None else self.solutions.beside(block.points)
            if self.study.solver.in_blocks:
                return self._submitted(block, near)
            start = None if near is None or np.isnan(near).any() else near[0]
            return lambda: solve_point(
                self.study, self.level, int(block.points[0]), start, self.exact
            )
        except Exception as error:
            broken: Future[BlockRecord] = Future()
            broken.set_exception(error)
            return broken.result

    def _submitted(self, block: Block, near: Array | None) -> Pending:
        """Condense a block and hand its contact problems to the executor.
        near: (P, m) solutions that the points begin from, NaN in rows without; None if there are
        none"""
        plan, level = self.study.solver, self.level
        scenes = [self.study.scenes[int(place)] for place in block.points]
        condensed = level.block(scenes)
        factor = condensed.mu / condensed.mu[0]
        laws, loads = (
            row_laws([level.law(scene) for scene in scenes], factor),
            condensed.l_tilde / factor[:, None],
        )
        mu, (points, m) = float(condensed.mu[0]), loads.shape
        if (
            key := (Level.ratio(scenes[0]), mu)
        ) not in self.bodies:  # made once for blocks that follow one another
            self.bodies.clear()
            self.bodies[key] = CondensedBody.of(
                mu * condensed.A_tilde, condensed.c, condensed.lambda_1_error
            )
        timeout, limits = max(TIMEOUT, FACTORISATIONS / FLOPS * points * m**3 / 3.0), None
        if plan.every:
            limits = Limits(plan.max_boxes, plan.max_seconds)
            timeout += points * (limits.seconds + SLOWEST)
        job = Job(
            timed,
            f"level-{level.mesh.level} points {block.points.min()}-{block.points.max()}",
            timeout,
        )
        future = self.executor.submit(
            job,
            solve_block,
            self.bodies[key],
            loads,
            laws,
            plan.branch,
            plan.tolerance,
            near,
            self.exact,
            limits,
        )
        return lambda: block_record(
            self.study, level, block.points, scenes, condensed, laws, *future.result()
        )

    @cached_property
    def _bounds(self) -> ErrorBounds:
        """What bounds the errors."""
        return ErrorBounds(self.level)

    @cached_property
    def _requested(self) -> list[Callable[[Scene, Array], dict[str, Any]]]:
        """What gives the numbers on request of a scene and its u_T (m,), by variable name."""
        from tcstudy.offline.requested_outputs import (
            RequestedOutputs,
        )  # only for a study that asks for more

        output = self.study.output
        found: list[Callable[[Scene, Array], dict[str, Any]]] = []
        if output.probes or output.quantities:
            found.append(RequestedOutputs(self.level, output).of)
        if output.sensitivity:
            from tcstudy.study.sensitivities import derivatives_of

            found.append(lambda scene, v: derivatives_of(self.level, scene, v, output.sensitivity))
        return found

    def _completed(self, record: BlockRecord) -> BlockRecord:
        """With what the study asks for of solved points: estimates and bounds of errors, fields,
        numbers on request."""
        output = self.study.output
        guarantee = self.study.mesh.guarantee
        if record.u_T is None or not (
            self.estimator is not None or guarantee or output.fields or output.asks
        ):
            return record
        names = [v.name for v in requested_variables(self.study)] if output.asks else []
        numbers = dict(record.numbers) | {name: np.full(len(record), np.nan) for name in names}
        fields, status, reasons = dict(record.fields), record.status.copy(), dict(record.reasons)
        for row in np.flatnonzero(record.status == PointStatus.OK).tolist():
            scene, v, found = (
                self.study.scenes[int(record.points[row])],
                record.u_T[row],
                dict[str, Any](),
            )
            with self.times.measure("estimate"):
                if guarantee:
                    found = self._bounds.look(scene, v)
                if self.estimator is not None:
                    found |= self.estimator.look(
                        record.index(row), scene, v, found.get("error_bound_relative")
                    )
            if output.fields and not record.fields:
                for name, values in self.level.fields(scene, v).items():
                    fields.setdefault(name, np.full((len(record), len(values)), np.nan))[row] = (
                        values
                    )
            try:
                for of in self._requested if output.asks else ():
                    found |= of(scene, v)
            except Exception as error:  # the solution itself stays, and all that was asked goes
                reason = f"numbers on request: {type(error).__name__}: {error}"
                status[row], reasons[row] = PointStatus.ERROR, reason
                found = {name: value for name, value in found.items() if name not in names}
            for name, value in found.items():
                numbers.setdefault(name, np.full((len(record), *np.shape(value)), np.nan))[row] = (
                    value
                )
        return replace(record, status=status, reasons=reasons, numbers=numbers, fields=fields)


Places = NDArray[np.intp]

POINTS, ENTRIES = 1024, 2**17
"""Points of a block at most, and entries of its arrays (P, m) to aim at, so that many have a part
in the work."""
ENOUGH, MOST = 256, 2**18
"""Points from which a larger block is hardly cheaper by the point, and entries at most."""
ESTIMATED, EVERY = 16, 64
"""Points of a block where the error of each is estimated, or all solutions are sought, which takes
longer than one."""
SLOWEST = 10.0
"""Seconds that a point may take beyond its limit, which is looked at between one set of boxes and
the next."""
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
    ratio = np.array(
        [numbers.setdefault(("ratio", Level.ratio(s)), len(numbers)) for s in materials]
    )[of]
    mu = np.array([numbers.setdefault(("mu", s.material.mu), len(numbers)) for s in materials])[of]
    places = np.arange(len(study.scenes))
    wave = _waves(study)
    order = np.lexsort((places, mu, ratio, wave))  # else as in the file, which is written meanwhile
    size = _size(study, m, n_points)
    kind = wave[order] * (ratio.max(initial=0) + 1) + ratio[order]
    cuts = np.flatnonzero(np.diff(kind)) + 1
    parts = [
        part
        for whole in np.split(order, cuts)
        for part in np.array_split(whole, -(-len(whole) // size))
    ]
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
    """(P,) how many steps back along the sweep a point has, where each begins from its neighbour's
    solution."""
    if study.solver.branch != "continued" or not study.shape:
        return np.zeros(len(study.scenes), dtype=np.intp)
    return np.asarray(sum(np.indices(study.shape)), dtype=np.intp).ravel()


class Solutions:
    """Contact solutions of a level found so far: where neighbours begin from."""

    def __init__(self, study: Study, m: int, order: Places) -> None:
        """m: contact unknowns;  order: (P,) places in the order in which they are solved"""
        self._shape, self._rank = study.shape, np.argsort(order)
        loads = load_axes(study)
        self._dims = [*(d for d in range(len(study.shape)) if d not in loads), *loads]
        self._v = np.full((len(study.scenes), m), np.nan)

    def take(self, block: BlockRecord) -> None:
        """Remember a block's solutions."""
        if block.u_T is not None:
            ok = block.status == PointStatus.OK
            self._v[block.points[ok]] = block.u_T[ok]

    def beside(self, points: Places) -> Array:
        """Return (P, m) the solutions one step back along the last axis of a load, or else the last
        axis, that has a step back and a solution there.

        NaN in rows without one. One that is solved later counts as none, so that a resumed run has
        the same bits.
        """
        found = np.full((len(points), self._v.shape[1]), np.nan)
        index = (
            np.array(np.unravel_index(points, self._shape))
            if self._shape
            else np.zeros((0, len(points)), int)
        )
        for d in self._dims:  # the last one overwrites those before
            back = index.copy()
            back[d] -= 1
            inside = np.flatnonzero(back[d] >= 0)
            before = np.ravel_multi_index(tuple(back[:, inside]), self._shape)
            v = self._v[before]
            known = ~np.isnan(v).any(axis=1) & (self._rank[before] < self._rank[points[inside]])
            found[inside[known]] = v[known]
        return found


def at_contact_nodes(function: LineFunction, mesh: PlaneMesh, line: ContactLine) -> Array:
    """(m,) a function of place and normal at the nodes of the line, with the normals of the exact
    curve."""
    normals = np.zeros_like(mesh.points)
    normals[line.segments] = mesh.end_normals[line.which]
    x, y = line.xy.T
    return function(x, y, normals[line.nodes])


# -- what is recorded of a block, and of a point that is solved by itself
# ------------------------------------------


def solve_point(
    study: Study,
    level: Level,
    place: int,
    neighbour: Array | None = None,
    exact: Array | None = None,
) -> BlockRecord:
    """Solve one point of the sweep on one level; every failure becomes a status with its reason.

    neighbour: the contact solution of a neighbouring point, a start where the study's branch asks for one
    exact:     the exact solution at the contact nodes, a start where the study gives one
    """
    plan, points = study.solver, np.array([place])
    try:
        scene = study.scenes[place]
        problem, condensed = level.condensed(scene).problem, level.block([scene])
        given = plan.tolerance, plan.max_iterations, plan.branch, neighbour, exact
        solved = [timed(solve_contact, problem, name, *given) for name in plan.names]
        answer, seconds = solved[0]
        lambda_1, residual = level.lambda_1(scene), answer.inclusion_residual
        proved = certify(problem, answer.v, lambda_1, plan.tolerance, residual=residual)
        row, laws = as_row(replace(answer, certificate=proved)), row_laws([problem.law], np.ones(1))
        record = block_record(study, level, points, [scene], condensed, laws, row, seconds)
        more = {"evaluations": answer.evaluations} | (
            _by_solver(condensed, solved) if len(solved) > 1 else {}
        )
        fields = level.fields(scene, answer.v) if study.output.fields else {}
        return replace(record, numbers=record.numbers | _one_row(more), fields=_one_row(fields))
    except Exception as error:  # one point must not end a sweep; what it was stands in the data
        return all_failed(study, level.mesh.level, points, *failed_by(error))


def failed_by(error: Exception) -> tuple[PointStatus, str]:
    """The status and the reason of points that an exception ends."""
    singular = isinstance(error, NotPositiveDefinite)
    return (
        (PointStatus.SINGULAR, str(error))
        if singular
        else (PointStatus.ERROR, f"{type(error).__name__}: {error}")
    )


def _one_row(values: Mapping[str, Any]) -> dict[str, Array]:
    return {name: np.array([value], dtype=float) for name, value in values.items()}


def all_failed(
    study: Study, level: int, points: NDArray[np.intp], status: PointStatus, reason: str
) -> BlockRecord:
    """Points of a level without results."""
    count = len(points)
    failed = np.full(count, int(status), dtype=np.int8)
    return BlockRecord(level, study.shape, points, failed, dict.fromkeys(range(count), reason), {})


STATUS = np.full(max(Status) + 1, int(PointStatus.NOT_CONVERGED), dtype=np.int8)
"""Statuses of the data by those of a solver."""
STATUS[Status.CONVERGED] = PointStatus.OK
STATUS[Status.INCLUSION_VIOLATED] = PointStatus.INCLUSION_VIOLATED
STATUS[Status.NOT_POSITIVE_DEFINITE] = PointStatus.SINGULAR


def block_record(
    study: Study,
    level: Level,
    points: NDArray[np.intp],
    scenes: Sequence[Scene],
    condensed: CondensedBlock,
    laws: Laws,
    answers: Answer,
    seconds: float,
) -> BlockRecord:
    """The record of a block of answers, units as in data.schema. laws: of its rows;  seconds: for all of them."""
    proved, error, count = answers.certificate, condensed.lambda_1_error, len(points)
    assert proved is not None
    factor = condensed.mu / condensed.mu[0]  # stiffness of a point's body over that of the block's
    solved = answers.status == Status.CONVERGED
    # no friction leaves a solution nothing but rounding of ξ; how far from 0 that is is its
    # inclusion residual
    nothing = solved & np.array([scene.friction.vanishes for scene in scenes])
    xi = np.where(nothing[:, None], 0.0, answers.xi * factor[:, None])
    sticks = np.where(np.isnan(answers.v), UNKNOWN, laws.kind(laws.locate(answers.v)) == UP)
    lambda_1, omega, balance = (
        condensed.mu * condensed.lambda_1,
        proved.omega * factor,
        condensed.heat_balance,
    )
    unbalanced = np.where(balance <= HEAT_BOUND, BALANCED, UNBALANCED)
    values = {
        "energy": answers.energy * factor + condensed.constant,
        "inclusion_residual": answers.inclusion_residual,
        "inclusion_rounding": answers.rounding,
        "inclusion_status": np.where(solved, np.where(answers.limited, LIMITED, MET), NOT_JUDGED),
        "iterations": answers.iterations,
        "u_T_max": np.max(np.abs(answers.v), axis=-1, initial=0.0),
        "friction_resultant": xi.sum(axis=-1),
        "lambda_1": lambda_1,
        "lambda_1_error": np.full(count, error),
        "omega": omega,
        "uniqueness_margin": proved.margin * factor,
        "unique": proved.unique,
        "strict_minimum": proved.strict_minimum,
        "global_minimum": proved.global_minimum,
        "start_used": answers.start,
        "start_energy": answers.energies * factor[:, None] + condensed.constant[:, None],
        "theta_mean": condensed.theta_mean,
        "heat_balance": balance,
        "heat_status": np.where(np.isnan(balance), NOT_JUDGED, unbalanced),
        "time_condense": np.full(count, condensed.time / count),
        "time_solve": np.full(count, seconds / count),
        **line_numbers(level, scenes, laws, answers.v, xi / condensed.c),
    }
    if condensed.band is not None:
        values |= condensed.band.numbers(omega, condensed.mu)
    solutions: dict[str, Array] = {}
    if answers.solutions is not None:
        more, solutions = _every(answers.solutions, points, factor, condensed)
        values |= more
    return BlockRecord(
        level=level.mesh.level,
        shape=study.shape,
        points=points,
        status=STATUS[answers.status],
        reasons={row: reason for row, reason in enumerate(answers.reason) if reason},
        numbers={name: np.asarray(value, dtype=float) for name, value in values.items()},
        u_T=answers.v,
        xi=xi / condensed.c,
        sticks=sticks.astype(np.int8),
        solutions=solutions,
    )


def _every(
    found: Sequence[Equilibria], points: NDArray[np.intp], factor: Array, condensed: CondensedBlock
) -> tuple[dict[str, Array], dict[str, Array]]:
    """What a block stores of all solutions of its points by variable name: (P,), and one row a solution.
    points: (P,) places in the sweep;  factor: (P,) stiffness of a point's body over that of the block's"""
    count = np.array([len(one) for one in found])
    complete = np.array([one.complete for one in found], dtype=bool)
    polygon = np.array([one.law_error > 0.0 for one in found], dtype=bool)
    numbers = {
        "solutions": count,
        "stable_solutions": np.array([np.count_nonzero(one.stable) for one in found]),
        "complete": np.where(complete, np.where(polygon, OF_POLYGON, ALL_PROVED), NOT_ALL),
    }
    row = np.repeat(np.arange(len(count)), count)
    solutions: dict[str, Any] = {
        "solution_point": points[row].astype(np.int32),
        "solution_energy": np.concatenate([one.energy for one in found]) * factor[row]
        + condensed.constant[row],
        "solution_stable": np.concatenate([one.stable for one in found]).astype(np.int8),
        "solution_u_T": np.concatenate([one.v for one in found]),
        "solution_xi": np.concatenate([one.xi for one in found]) * factor[row, None] / condensed.c,
        "solution_piece": np.concatenate([one.sides for one in found]).astype(np.int32),
    }
    return numbers, solutions


def _by_solver(condensed: CondensedBlock, solved: Sequence[tuple[Answer, float]]) -> dict[str, Any]:
    """What each solver found, and how far from the first one's solution."""
    answers, times = zip(*solved, strict=True)
    first = answers[0].v
    scale = float(np.max(np.abs(first), initial=0.0))
    apart = [float(np.max(np.abs(a.v - first), initial=0.0)) for a in answers]
    return {
        "solver_residual": [a.inclusion_residual for a in answers],
        "solver_energy": [a.energy + float(condensed.constant[0]) for a in answers],
        "solver_iterations": [a.iterations for a in answers],
        "solver_time": times,
        "solver_difference": [d / scale if scale > 0.0 else d for d in apart],
    }
