"""Follow a study's equilibrium path into its file: the branch connected to the unloaded state, its
equilibria at requested values, and the hysteresis loop.

Along one parameter t the load is l̃(t) = l̃₀ + t l̃₁, found from two values of t and checked at two
others (method: l̃ is affine in f, g, q, θ̄ and in prescribed displacements, eq. (20) of the paper
with fixed Ã).
"""

from __future__ import annotations

import pathlib
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
from numpy.polynomial import Polynomial
from numpy.typing import NDArray

from tcstudy.condense import NotPositiveDefinite
from tcstudy.contact.boxes import Limits
from tcstudy.contact.certificates import certify_rows, solution_boxes
from tcstudy.contact.history.steps import Hysteresis, Way, hysteresis
from tcstudy.contact.path.follow import Follower, ParametricProblem, Path, Progress
from tcstudy.contact.path.problem import WHOLE, PathStatus
from tcstudy.contact.path.query import (
    Branches,
    PathSolution,
    all_branches,
    folds,
    lowest,
    proved_minima,
    solutions_at,
    solutions_of,
)
from tcstudy.contact.path.walk import NoSolutionError
from tcstudy.contact.path.without_law import LawfulRows
from tcstudy.contact.problem import Status
from tcstudy.contact.solution import Acceptance
from tcstudy.contact.solve import TIE, solve_contact
from tcstudy.data.files import SHORTFALLS, Remark, tell
from tcstudy.data.records import Journal, LevelRecord, Record
from tcstudy.data.schema import OPEN_LOOP, UNPROVED_BRANCHES
from tcstudy.data.tables import path_variables
from tcstudy.errors import GeometryFailed, PathError
from tcstudy.laws.composed import piecewise_linear
from tcstudy.laws.laws import Laws
from tcstudy.offline.level import Condensed, Level
from tcstudy.scene.contact_states import ContactState, node_states
from tcstudy.scene.parameters import path_scene
from tcstudy.scene.path_plan import Direction, PathPlan
from tcstudy.scene.records import Scene
from tcstudy.scene.solver_plan import Branch
from tcstudy.scene.study import Study
from tcstudy.study.run import stages, to_file

Array = NDArray[np.float64]
Places = NDArray[np.intp]
Values = dict[str, Any]
LIMITS = Limits(boxes=20_000, seconds=20.0)
"""Limits of the search in each of the slabs in which all branches of a range are proved."""
MIN_FOLD = 0.005
"""Share of the range that t must go back at a fold: t turns wherever a single node debonds."""
MAX_AFFINE_ERROR = 1e-9
"""Relative deviation of the load from a straight line that counts as rounding."""
MIN_LOAD_CHANGE = 1e-13
"""Change of the load over the range, relative to the load, that counts as rounding."""
MAX_SAME_DIFFERENCE = 1e-7
"""Difference of two equal solutions, on the path and on a branch, relative to their slip."""
MAX_ROUNDING = 1e-12
"""The same relative to the largest slip of the path."""
SHARES = np.array([0.0, 1.0, 0.4, 0.75])
"""Positions in the range at which the load is computed: two that define it, two that check it."""


class AffineLoad(NamedTuple):
    """The contact problem of a level along t.

    problem:  Ã, l̃₀, l̃₁, c and the law
    constant: total potential energy less L̃(u₁), eq. (20), a parabola of t [J/m]
    level:    tells slips from openings
    """

    problem: ParametricProblem
    constant: Polynomial
    level: Level

    def states(
        self, prefix: str, t: Array, u: Array, traction: Array, law: Laws | None = None
    ) -> Values:
        """Return what the file has of solutions at t (n,), (n, m) each, by prefixed names."""
        problem = self.problem if law is None else self.problem.with_law(law)
        energy = problem.energy(t, u, traction) + self.constant(t)
        u_T, opening = self.level.split(u)
        xi, S_N = self.level.split(traction)
        values: Values = {
            f"{prefix}parameter": t,
            f"{prefix}u_T": u_T,
            f"{prefix}xi": xi,
            f"{prefix}energy": energy,
        }
        if self.level.opening is not None:
            values |= {f"{prefix}opening": opening, f"{prefix}S_N": S_N}
        return values


def affine_load(
    level: Level, scene_of: Callable[[float], Scene], begin: float, end: float, name: str
) -> AffineLoad:
    """Return the contact problem of `scene_of` along t.

    begin, end: two values of t;  name: of the parameter, for messages
    Raises PathError if l̃ is not affine in t or does not depend on it.
    """
    length = end - begin
    condensed = list[Condensed]()
    for share in SHARES.tolist():
        t = end if share == 1.0 else begin + share * length
        condensed.append(level.condensed(scene_of(t)))
    first = condensed[0].problem
    if not all(np.array_equal(first.A_tilde, scene.problem.A_tilde) for scene in condensed):
        raise PathError(
            f"the stiffness changes with {name}: a path needs a parameter of the loads alone"
        )
    loads = np.array([scene.problem.l_tilde for scene in condensed])
    change = loads[1] - loads[0]
    size = float(np.max(np.abs(loads), initial=0.0))
    if np.max(np.abs(change), initial=0.0) <= MIN_LOAD_CHANGE * size:
        raise PathError(
            f"the load on the contact line does not depend on {name}; choose another path.parameter"
        )
    deviation = float(np.max(np.abs(loads - loads[0] - SHARES[:, None] * change)))
    if deviation > MAX_AFFINE_ERROR * size:
        raise PathError(
            f"the load is not affine in {name} (relative deviation {deviation / size:.1e} from a "
            "straight line), so there is no piecewise-linear path along it; use a sweep"
        )
    l_1 = change / length
    span = (begin, end)
    problem = ParametricProblem(
        first.A_tilde,
        loads[0] - begin * l_1,
        l_1,
        first.c,
        first.law,
        span,
        first.A_error,
        loose=first.body.loose,
        blocks=level.blocks,
    )
    return AffineLoad(problem, _parabola([scene.constant for scene in condensed], span), level)


def _parabola(constants: Sequence[float], span: tuple[float, float]) -> Polynomial:
    """Return the parabola through the first three constants, which belong to SHARES."""
    at_0 = constants[0]
    at_1 = constants[1] - at_0
    at_04 = constants[2] - at_0
    k_2 = (at_1 - at_04 / 0.4) / 0.6
    return Polynomial([at_0, at_1 - k_2, k_2], domain=span, window=(0.0, 1.0))


def straightened(
    level: Level,
    scene: Scene,
    problem: ParametricProblem,
    law_error: float,
    within: tuple[float, float],
) -> ParametricProblem:
    """Return the problem with straight pieces in the place of exponential ones.

    within: two values of t; the pieces reach as far as solutions between them may slip
    """
    if problem.law.piecewise_linear:
        return problem
    boxes = [solution_boxes(problem.at(t).rows) for t in within]
    max_slip = max(float(np.max(np.abs(side))) for box in boxes for side in box)
    straight_scene = scene.with_laws(lambda law: piecewise_linear(law, law_error, max_slip))
    return problem.with_law(level.law(straight_scene))


def follow_branch(
    problem: ParametricProblem,
    follower: Follower,
    branch: Branch,
    begin: float,
    direction: Direction,
    name: str,
    progress: Progress | None = None,
) -> tuple[Path, Array]:
    """Return the path from a solution at t = begin, and that solution (m,).

    branch: of `solve_contact`;  name: of t, for messages
    Raises PathError without a solution to start from.
    """
    answer = solve_contact(problem.at(begin), tolerance=follower.tolerance, branch=branch)
    if answer.status != Status.CONVERGED:
        raise PathError(
            f"there is no solution to start from at {name} = {begin:g}: {answer.reason}"
        )
    lawful = LawfulRows.of(problem)
    try:
        if lawful is None:
            path = follower.follow(problem, answer.v, begin, direction, progress)
        else:
            start = answer.v[lawful.elimination.rows]
            path = follower.follow(lawful.problem, start, begin, direction, progress)
            path = lawful.full_path(path)
    except NoSolutionError as error:
        raise PathError(str(error)) from error
    return path, answer.v


def follow_path(study: Study, progress: Progress | None = None) -> Record:
    """Return the path that the study requests.

    progress: called with (segments, t) from time to time
    Raises PathError if there is nothing to follow or the start has no solution, GeometryFailed if
    the body has no mesh.
    """
    plan = study.path
    if plan is None:
        raise PathError(
            "the study has no section path; add path: {parameter: theta_bar, from: 0 K, to: 40 K}"
        )
    tolerance = study.solver.tolerance
    level, line = _level_of(study, plan)

    def scene_of(t: float) -> Scene:
        return path_scene(plan.scene, plan.parameter, t)

    try:
        load = affine_load(level, scene_of, plan.begin, plan.end, plan.name)
        problem = straightened(level, plan.scene, load.problem, plan.law_error, plan.within)
        lambda_1 = level.lambda_1(plan.scene)
    except NotPositiveDefinite as error:
        raise PathError(str(error)) from error
    follower = Follower(*plan.within, plan.max_pieces, tolerance)
    branch: Branch = "from-zero" if plan.start == "zero" else "lowest"
    path, start = follow_branch(
        problem, follower, branch, plan.begin, _direction(plan), plan.name, progress
    )
    branches: Branches | None = None
    if plan.complete:
        branches = all_branches(
            problem, plan.begin, plan.end, lambda_1, LIMITS, plan.at, known=(path,)
        )
    lawful = LawfulRows.of(problem)
    kept_path = path if lawful is None else lawful.kept_path(path)
    lowest_states = lowest(kept_path)
    slide = ""
    if not level.is_held(plan.scene):
        slide = f"the body can {level.motions(plan.scene).words} once the bond has failed"
    is_smooth = not load.problem.law.piecewise_linear
    values = {
        **vars(line),
        **line.fields,
        "start": path.start,
        "lambda_1": lambda_1,
        "lambda_1_error": load.problem.A_error,
        "omega": load.problem.law.omega,
        "law_error": plan.law_error if is_smooth else 0.0,
        **_curve_values(load, path),
        **{f"lowest_{name}": column for name, column in lowest_states._asdict().items()},
        "lowest_certified": proved_minima(
            kept_path, lowest_states, lambda_1, Acceptance(tolerance)
        ),
        **_solution_values(plan, load, path, branches, lambda_1, tolerance),
    }
    values |= _requested_values(study, load, scene_of, path, values)
    attributes: Values = {
        "parameter": plan.name,
        "parameter_range": np.array([plan.begin, plan.end]),
        "begin_status": path.begin.name.lower(),
        "begin_reason": _end_reason(path.begin, slide),
        "end_status": path.end.name.lower(),
        "end_reason": _end_reason(path.end, slide),
    }
    if plan.hysteresis:
        loop = _loop(plan, problem, lawful, start, tolerance)
        values |= _loop_values(plan, load, problem, loop)
        attributes["loop_reason"] = loop.reason or "both ends of the range of t were reached"
        if slide and loop.reason:
            attributes["loop_reason"] = f"{slide} ({loop.reason.partition(': ')[0]})"
    if branches is not None:
        values |= _branch_values(plan, load, path, branches)
        attributes["complete_reason"] = branches.reason
    return Record("path", path_variables(study), values, attributes)


def _requested_values(
    study: Study,
    load: AffineLoad,
    scene_of: Callable[[float], Scene],
    path: Path,
    values: Values,
) -> Values:
    """Return what the file has of vertices and solutions along openings and on request.

    values: those that the file has already
    """
    quantities = study.output.quantities
    if not (study.opens or {"forces", "reactions"} & {*quantities}):
        return {}
    # imported only for a study that requests more
    from tcstudy.offline.along_path import AffineScene

    level = load.level
    begin, end = load.problem.span
    scene = AffineScene(level, scene_of, begin, end, quantities)
    names = {variable.name for variable in path_variables(study)}
    numbers: Values = {}
    for prefix, law in (("", path.problem.law), ("solution_", load.problem.law)):
        t = values[f"{prefix}parameter"]
        if not len(t):
            continue
        v = values[f"{prefix}u_T"]
        traction = values[f"{prefix}xi"]
        if level.opening is not None:
            v = np.hstack([v, values[f"{prefix}opening"]])
            traction = np.hstack([traction, values[f"{prefix}S_N"]])
        of_states = scene.numbers(t, v, traction, law)
        numbers |= {f"{prefix}{name}": row for name, row in of_states.items()}
    return {name: row for name, row in numbers.items() if name in names}


def _end_reason(status: PathStatus, slide: str) -> str:
    """Return why a path ends. slide: what a body that contact alone holds can do, else empty"""
    return slide if slide and status == PathStatus.UNBOUNDED else str(status.reason)


def _level_of(study: Study, plan: PathPlan) -> tuple[Level, LevelRecord]:
    """Return the level of a path as a run would have it. Raises GeometryFailed."""
    number = study.mesh.levels - 1 if plan.level is None else plan.level
    mesh = replace(study.mesh, levels=number + 1, tolerance=None, estimate=False)
    one_scene = replace(study, mesh=mesh, scenes=(plan.scene,), axes=())
    stage = next(stages(one_scene, first=number))
    if stage.level is None or stage.record is None:
        raise GeometryFailed(next(stage.blocks).reasons[0])
    return stage.level, stage.record


def _direction(plan: PathPlan) -> Direction:
    """Return the direction of the plan as that of the follower, whose forward is growing t."""
    if plan.direction == "both" or plan.begin <= plan.end:
        return plan.direction
    return "backward" if plan.direction == "forward" else "forward"


def _curve_values(load: AffineLoad, path: Path) -> Values:
    """Return what the file has of the path by vertex and by segment."""
    middle = 0.5 * (path.u[1:] + path.u[:-1])
    state, state_N = load.level.split(node_states(path.problem.law, middle, sticks=False))
    slipping = state != ContactState.STICK
    begin, end = load.problem.span
    of_openings = {} if load.level.opening is None else {"state_N": state_N}
    return {
        **load.states("", path.t, path.u, path.traction, path.problem.law),
        "energy_rate": load.constant.deriv()(path.t) - path.conjugate,
        "residual": path.residual,
        "stable": path.stable,
        "state": state,
        **of_openings,
        "slip_length": np.asarray(slipping @ load.level.line.c),
        "fold_vertex": folds(path, MIN_FOLD * abs(end - begin)),
    }


def _branch_values(plan: PathPlan, load: AffineLoad, path: Path, proof: Branches) -> Values:
    """Return what the file has of all branches, one after the other."""
    branches = proof.branches
    codes_of_path = {code.tobytes() for code in path.codes}
    t = np.concatenate([path.t[:0], *(branch.t for branch in branches)])
    u = np.concatenate([path.u[:0], *(branch.u for branch in branches)])
    traction = np.concatenate([path.traction[:0], *(branch.traction for branch in branches)])
    stable = [path.stable[:0]]
    is_loop = list[int]()
    is_on_path = list[bool]()
    for branch in branches:
        stable.append(np.append(branch.stable, False))
        is_loop.append(int(branch.end == PathStatus.CLOSED_LOOP))
        is_on_path.append(any(code.tobytes() in codes_of_path for code in branch.codes))
    return {
        "complete": int(proof.complete),
        "at_complete": np.array([proof.complete_at(t) for t in plan.at], dtype=bool),
        "branch_of": np.repeat(np.arange(len(branches)), [len(branch.t) for branch in branches]),
        **load.states("branch_", t, u, traction, path.problem.law),
        "branch_stable": np.concatenate(stable),
        "branch_loop": is_loop,
        "branch_on_path": is_on_path,
    }


def _solution_values(
    plan: PathPlan,
    load: AffineLoad,
    path: Path,
    branches: Branches | None,
    lambda_1: float,
    tolerance: float | None,
) -> Values:
    """Return what the file has of solutions at the requested values.

    branches: all branches, whose solutions are added; those of a smooth law belong to another
              problem
    """
    law = load.problem.law
    is_complete = np.zeros(len(plan.at), dtype=bool)
    groups = list[list[PathSolution]]()
    for n, t in enumerate(plan.at):
        if law.piecewise_linear:
            groups.append(solutions_at(path, t))
            if branches is not None:
                is_complete[n] = branches.complete_at(t)
                groups[n] += _missing(branches, t, groups[n], path)
        else:  # by Newton's method, from the solutions of the piecewise-linear law
            groups.append(solutions_of(law, path, t))
    solutions = [solution for group in groups for solution in group]
    at = np.array(plan.at)
    count = np.array([len(group) for group in groups], dtype=np.intp)
    row = np.repeat(np.arange(len(at)), count)
    u = np.array([solution.v for solution in solutions]).reshape(-1, path.problem.m)
    rows = load.problem.rows(at[row], lambda_1)
    certificate = certify_rows(rows, u, tolerance)
    states = load.states("solution_", at[row], u, rows.xi(u) / rows.c)
    is_lowest = _are_lowest(states["solution_energy"], row, len(at))
    is_proved_lowest = is_lowest & is_complete[row]
    is_alone = count[row] == 1
    return {
        "at": at,
        "solution_count": count.tolist(),
        "solution_at": row,
        **states,
        "solution_piece": [solution.piece for solution in solutions],
        "solution_stable": [solution.stable for solution in solutions],
        "solution_residual": certificate.residual,
        "solution_rounding": rows.xi_rounding(u),
        "solution_lowest": is_lowest,
        "solution_unique": certificate.unique | (is_proved_lowest & is_alone),
        "solution_strict_minimum": certificate.strict_minimum | is_proved_lowest,
        "solution_global_minimum": certificate.global_minimum | is_proved_lowest,
    }


def _missing(
    branches: Branches, t: float, solutions: Sequence[PathSolution], path: Path
) -> list[PathSolution]:
    """Return the solutions of the branches at t that are not among those of the path."""
    rounding = MAX_ROUNDING * float(np.max(np.abs(path.u)))
    missing = list[PathSolution]()
    for v, stable in branches.solutions(t):
        size = MAX_SAME_DIFFERENCE * float(np.max(np.abs(v), initial=0.0))
        distances = [np.max(np.abs(v - solution.v)) for solution in (*solutions, *missing)]
        if all(distance > max(size, rounding) for distance in distances):
            missing.append(PathSolution(v, stable, -1))
    return missing


def _are_lowest(energy: Array, row: Places, n_rows: int) -> NDArray[np.bool_]:
    """Return whether solutions have the lowest energy of their row, up to rounding."""
    lowest_energy = np.full(n_rows, np.inf)
    np.minimum.at(lowest_energy, row, energy)
    scale = float(np.max(np.abs(energy), initial=0.0))
    return np.asarray(energy <= lowest_energy[row] + TIE * scale)


def _loop(
    plan: PathPlan,
    problem: ParametricProblem,
    lawful: LawfulRows | None,
    start: Array,
    tolerance: float | None,
) -> Hysteresis:
    """Return the hysteresis loop between begin and end, from the solution `start` (m,).

    lawful: rows with a law, if others are eliminated
    """
    options = plan.begin, plan.end, plan.max_pieces, tolerance
    if lawful is None:
        return hysteresis(problem, start, *options)
    loop = hysteresis(lawful.problem, start[lawful.elimination.rows], *options)
    ways = [Way(way.t, *lawful.states(way.t, way.v, way.xi)) for way in loop.ways]
    return loop._replace(ways=ways)


def _loop_values(
    plan: PathPlan, load: AffineLoad, problem: ParametricProblem, loop: Hysteresis
) -> Values:
    """Return what the file has of the hysteresis loop between begin and end."""
    counts = np.array([len(way.t) for way in loop.ways], dtype=np.int32)
    t = np.concatenate([way.t for way in loop.ways])
    u = np.concatenate([way.v for way in loop.ways])
    traction = np.concatenate([way.xi for way in loop.ways])
    is_increasing = plan.begin < plan.end
    vertices = [counts[: jump.ways].sum() - 1 for jump in loop.jumps]
    return {
        **load.states("loop_", t, u, traction, problem.law),
        "loop_branch": np.repeat(np.arange(len(counts), dtype=np.int32), counts),
        "jump_parameter": np.array([jump.t for jump in loop.jumps]),
        "jump_vertex": np.array(vertices, dtype=np.int32),
        "jump_rising": [(n < loop.there) == is_increasing for n in range(len(loop.jumps))],
        "jump_drop": [jump.released for jump in loop.jumps],
        "energy_lost": loop.lost,
        "loop_area": loop.area,
        "loop_closed": int(loop.closed),
        "loop_complete": int(not loop.reason),
    }


def execute_path(
    study: Study,
    output: pathlib.Path,
    progress: Progress | None = None,
    command: Sequence[str] = ("tcstudy",),
    swept: Sequence[str] = (),
    lock: Journal | None = None,
) -> None:
    """Follow the path and write its file, with its shortfalls in words.

    swept: names of the sweep, whose values a path does not have
    lock:  that of the output, if it is taken already
    Raises PathError, StoreError or GeometryFailed.
    """
    one_scene = replace(study, axes=(), variants=())
    if study.path is not None:
        one_scene = replace(one_scene, scenes=(study.path.scene,))
    remarks = list[Remark]()
    if swept:
        names = ", ".join(swept)
        remarks.append(
            Remark(
                "a path is of one scene, that outside the sweep; "
                f"the values of {names} are not used"
            )
        )

    def compute() -> Record:
        record = follow_path(study, progress)
        sentences = shortfalls(study, record)
        tell(sentences)
        attributes = {**record.attributes, SHORTFALLS: "\n".join(sentences)}
        return replace(record, attributes=attributes)

    to_file(output, study, command, compute, one_scene, remarks, lock)


def shortfalls(study: Study, record: Record) -> list[str]:
    """Return what a user must know beside the results.

    That is an early end, missing or inexact solutions, or an incomplete loop.
    """
    assert study.path is not None
    values = record.values
    attributes = record.attributes
    sentences = list[str]()
    expected_ends = [status.name.lower() for status in WHOLE]
    for end, t in (("begin", values["parameter"][0]), ("end", values["parameter"][-1])):
        if attributes[f"{end}_status"] not in expected_ends:
            sentences.append(f"the path ends early, at {t:g}: {attributes[f'{end}_reason']}")
    for t, count in zip(values["at"], values["solution_count"], strict=True):
        if not count:
            sentences.append(f"the path has no solution at {study.path.name} = {t:g}")
    acceptance = Acceptance(study.solver.tolerance)
    solved = acceptance.accepts(values["solution_residual"], values["solution_rounding"])
    inexact = int(np.count_nonzero(~solved))
    if inexact:
        solutions = "1 solution misses" if inexact == 1 else f"{inexact} solutions miss"
        sentences.append(f"{solutions} the tolerance {acceptance.aim:g}; see solution_residual")
    if attributes.get("complete_reason"):
        sentences.append(f"{UNPROVED_BRANCHES}: {attributes['complete_reason']}")
    if study.path.hysteresis:
        if not values["loop_complete"]:
            sentences.append(f"{OPEN_LOOP}: {attributes['loop_reason']}")
        elif not values["loop_closed"]:
            sentences.append(f"{OPEN_LOOP}: it does not end where it began")
    return sentences
