"""Follow a study's path: the equilibria on the branch from rest, those at requested values, and the
hysteresis loop, into its file.

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
from tcstudy.contact.all_solutions import Limits
from tcstudy.contact.certificates import certify_rows, solution_boxes
from tcstudy.contact.history.steps import hysteresis
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
from tcstudy.contact.problem import Status
from tcstudy.contact.solution import Acceptance
from tcstudy.contact.solve import TIE, solve_contact
from tcstudy.data.files import SHORTFALLS, Remark, tell
from tcstudy.data.records import Journal, Record
from tcstudy.data.schema import OPEN_LOOP, UNPROVED_BRANCHES
from tcstudy.data.tables import PATH
from tcstudy.errors import GeometryFailed, PathError
from tcstudy.laws.composed import piecewise_linear
from tcstudy.laws.laws import Laws
from tcstudy.offline.level import Level
from tcstudy.scene.histories import ContactState, node_states
from tcstudy.scene.parameters import path_scene
from tcstudy.scene.path_plan import Direction, PathPlan
from tcstudy.scene.records import Scene
from tcstudy.scene.solver_plan import Branch
from tcstudy.scene.study import Study
from tcstudy.study.run import stages, to_file

Array = NDArray[np.float64]
Values = dict[str, Any]
LIMITS = Limits(boxes=20_000, seconds=20.0)
"""Of each of the slabs that a range is proved in."""

VISIBLE = 0.005
"""Part of the range below which a step back of t is no fold: where nodes let go one by one t turns
at each."""

AFFINE = 1e-9
"""Largest relative deviation from a straight line that counts as rounding."""


class AffineLoad(NamedTuple):
    """The contact problem of a level along t.

    problem:  Ã, l̃₀, l̃₁, c and the law
    constant: what the total potential energy has beside L̃(u₁), eq. (20), a parabola of t [J/m]
    """

    problem: ParametricProblem
    constant: Polynomial

    def states(
        self, of: str, t: Array, u: Array, traction: Array, law: Laws | None = None
    ) -> Values:
        """What the file has of solutions at t (n,), (n, m) each, by the prefix of their kind."""
        problem = self.problem if law is None else self.problem.with_law(law)
        energy = problem.energy(t, u, traction) + self.constant(t)
        return {f"{of}parameter": t, f"{of}u_T": u, f"{of}xi": traction, f"{of}energy": energy}


SHARES = np.array([0.0, 1.0, 0.4, 0.75])
"""Where between two values of t the load is taken: the first two give it, it is checked at the
others."""


def affine_load(
    level: Level, scene_of: Callable[[float], Scene], begin: float, end: float, name: str
) -> AffineLoad:
    """The problem of `scene_of` along t.

    begin, end: two values of t;  name: of the parameter, for messages
    Raises PathError if l̃ is not affine in t or does not depend on it.
    """
    length = end - begin
    solved = [
        level.condensed(scene_of(end if x == 1.0 else begin + x * length)) for x in SHARES.tolist()
    ]
    first = solved[0].problem
    if not all(np.array_equal(first.A_tilde, one.problem.A_tilde) for one in solved):
        raise PathError(
            f"the stiffness changes with {name}: a path needs a parameter of the loads alone"
        )
    loads = np.array([one.problem.l_tilde for one in solved])
    change, size = loads[1] - loads[0], float(np.max(np.abs(loads), initial=0.0))
    if np.max(np.abs(change), initial=0.0) <= 1e-13 * size:
        raise PathError(
            f"the load on the contact line does not depend on {name}; choose another path.parameter"
        )
    off = float(np.max(np.abs(loads - loads[0] - SHARES[:, None] * change)))
    if off > AFFINE * size:
        raise PathError(
            f"the load is not affine in {name} (relative deviation {off / size:.1e} from a straight line), so there "
            "is no piecewise-linear path along it; use a sweep"
        )
    l_1 = change / length
    span = begin, end
    problem = ParametricProblem(
        first.A_tilde, loads[0] - begin * l_1, l_1, first.c, first.law, span, first.A_error
    )
    at_1, at_04 = (one.constant - solved[0].constant for one in solved[1:3])  # of a parabola
    k_2 = (at_1 - at_04 / 0.4) / 0.6
    constant = Polynomial([solved[0].constant, at_1 - k_2, k_2], domain=span, window=(0.0, 1.0))
    return AffineLoad(problem, constant)


def straightened(
    level: Level,
    scene: Scene,
    problem: ParametricProblem,
    law_error: float,
    within: tuple[float, float],
) -> ParametricProblem:
    """The problem with straight pieces in the place of exponential ones, as far as solutions within
    two t may slip."""
    if problem.law.piecewise_linear:
        return problem
    boxes = [solution_boxes(problem.at(t).rows) for t in within]
    reach = max(float(np.max(np.abs(side))) for box in boxes for side in box)
    return problem.with_law(
        level.law(scene.with_laws(lambda law: piecewise_linear(law, law_error, reach)))
    )


def followed(
    problem: ParametricProblem,
    follower: Follower,
    branch: Branch,
    begin: float,
    direction: Direction,
    name: str,
    progress: Progress | None = None,
) -> tuple[Path, Array]:
    """The path from a solution at t = begin, and that (m,); branch: of `solve_contact`;  name: of t, for messages.

    Raises PathError without a solution to start from.
    """
    answer = solve_contact(problem.at(begin), tolerance=follower.tolerance, branch=branch)
    if answer.status != Status.CONVERGED:
        raise PathError(
            f"there is no solution to start from at {name} = {begin:g}: {answer.reason}"
        )
    try:
        return follower.follow(problem, answer.v, begin, direction, progress), answer.v
    except NoSolutionError as error:
        raise PathError(str(error)) from error


def follow_path(study: Study, progress: Progress | None = None) -> Record:
    """The path that the study asks for.

    progress: called with (pieces, t) from time to time
    Raises PathError if there is nothing to follow or the start has no solution, GeometryFailed if
    the body has no
    mesh.
    """
    plan = study.path
    if plan is None:
        raise PathError(
            "the study has no section path; add path: {parameter: theta_bar, from: 0 K, to: 40 K}"
        )
    last = study.mesh.levels - 1 if plan.level is None else plan.level
    mesh = replace(
        study.mesh, levels=last + 1, tolerance=None, estimate=False
    )  # the level that a run would have
    stage = next(stages(replace(study, mesh=mesh, scenes=(plan.scene,), axes=()), first=last))
    if stage.level is None or stage.record is None:
        raise GeometryFailed(next(stage.blocks).reasons[0])
    level, line = stage.level, stage.record
    try:
        load = affine_load(
            level,
            lambda t: path_scene(plan.scene, plan.parameter, t),
            plan.begin,
            plan.end,
            plan.name,
        )
        straight = straightened(level, plan.scene, load.problem, plan.law_error, plan.within)
        lambda_1, tolerance = level.lambda_1(plan.scene), study.solver.tolerance
    except NotPositiveDefinite as error:
        raise PathError(str(error)) from error
    direction = plan.direction
    if direction != "both" and plan.begin > plan.end:  # the follower's forward is growing t
        direction = "backward" if direction == "forward" else "forward"
    follower = Follower(*plan.within, plan.max_pieces, tolerance)
    branch: Branch = "from-zero" if plan.start == "zero" else "lowest"
    path, v = followed(straight, follower, branch, plan.begin, direction, plan.name, progress)
    every = None
    if plan.complete:
        every = all_branches(straight, plan.begin, plan.end, lambda_1, LIMITS, plan.at)
    told: Values = {"parameter": plan.name, "parameter_range": np.array([plan.begin, plan.end])}
    for name, status in (("begin", path.begin), ("end", path.end)):
        told |= {f"{name}_status": status.name.lower(), f"{name}_reason": status.reason}
    low = lowest(path)
    values = {
        **vars(line),
        **line.fields,
        "start": path.start,
        "lambda_1": lambda_1,
        "lambda_1_error": load.problem.A_error,
        "omega": load.problem.law.omega,
        "law_error": 0.0 if load.problem.law.piecewise_linear else plan.law_error,
        **_curve(load, path),
        **{f"lowest_{name}": column for name, column in low._asdict().items()},
        "lowest_certified": proved_minima(path, low, lambda_1, Acceptance(tolerance)),
        **_solutions(plan, load, path, every, lambda_1, tolerance),
    }
    if plan.hysteresis:
        found, told["loop_reason"] = _loop(plan, load, straight, v, tolerance)
        values |= found
    if every is not None:
        values |= _branches(plan, load, path, every)
        told["complete_reason"] = every.reason
    return Record("path", PATH, values, told)


def _curve(load: AffineLoad, path: Path) -> Values:
    state = node_states(path.problem.law, 0.5 * (path.u[1:] + path.u[:-1]), sticks=False)
    return {
        **load.states("", path.t, path.u, path.traction, path.problem.law),
        "energy_rate": load.constant.deriv()(path.t) - path.conjugate,
        "residual": path.residual,
        "stable": path.stable,
        "state": state,
        "slip_length": np.asarray((state != ContactState.STICK) @ path.problem.c),
        "fold_vertex": folds(path, VISIBLE * abs(load.problem.span[1] - load.problem.span[0])),
    }


def _branches(plan: PathPlan, load: AffineLoad, path: Path, every: Branches) -> Values:
    """All branches one after the other."""
    branches, known = every.branches, {code.tobytes() for code in path.codes}
    t, u, traction = (
        np.concatenate([getattr(path, name)[:0], *(getattr(b, name) for b in branches)])
        for name in ("t", "u", "traction")
    )
    return {
        "complete": int(every.complete),
        "at_complete": np.array([every.complete_at(t) for t in plan.at], dtype=bool),
        "branch_of": np.repeat(np.arange(len(branches)), [len(b.t) for b in branches]),
        **load.states("branch_", t, u, traction, path.problem.law),
        "branch_stable": np.concatenate(
            [path.stable[:0], *(np.append(b.stable, False) for b in branches)]
        ),
        "branch_loop": [int(b.end == PathStatus.CLOSED_LOOP) for b in branches],
        "branch_on_path": [any(code.tobytes() in known for code in b.codes) for b in branches],
    }


SAME, ROUNDED = 1e-7, 1e-12
"""Of its largest slip, and of that on the path, by which a solution may differ on the path and on
its branch."""


def _solutions(
    plan: PathPlan,
    load: AffineLoad,
    path: Path,
    every: Branches | None,
    lambda_1: float,
    tolerance: float | None,
) -> Values:
    """Solutions on the path at the requested values; those of a smooth law by Newton's method from
    its stand-in's.

    every: all branches, whose solutions are added; of a smooth law they are those of another
    problem
    """
    at, law, known = np.array(plan.at), load.problem.law, np.zeros(len(plan.at), dtype=bool)
    found = list[list[PathSolution]]()
    for n, t in enumerate(plan.at):
        found.append(solutions_at(path, t) if law.piecewise_linear else solutions_of(law, path, t))
        if every is not None and law.piecewise_linear:
            known[n] = every.complete_at(t)
            for v, stable in every.solutions(t):
                size = max(
                    SAME * float(np.max(np.abs(v), initial=0.0)),
                    ROUNDED * float(np.max(np.abs(path.u))),
                )
                if all(np.max(np.abs(v - one.v)) > size for one in found[n]):
                    found[n].append(PathSolution(v, stable, -1))
    count = np.array([len(group) for group in found], dtype=np.intp)
    i, solutions = (
        np.repeat(np.arange(len(at)), count),
        [solution for group in found for solution in group],
    )
    u, rows = (
        np.array([one.v for one in solutions]).reshape(-1, path.problem.m),
        load.problem.rows(at[i], lambda_1),
    )
    proofs, rounding = certify_rows(rows, u, tolerance), rows.xi_rounding(u)
    states = load.states("solution_", at[i], u, rows.xi(u) / rows.c)
    energy, least = states["solution_energy"], np.full(len(at), np.inf)
    np.minimum.at(least, i, energy)
    least_one = energy <= least[i] + TIE * float(np.max(np.abs(energy), initial=0.0))
    sure = least_one & known[i]
    return {
        "at": at,
        "solution_count": count.tolist(),
        "solution_at": i,
        **states,
        "solution_piece": [one.piece for one in solutions],
        "solution_stable": [one.stable for one in solutions],
        "solution_residual": proofs.residual,
        "solution_rounding": rounding,
        "solution_lowest": least_one,
        "solution_unique": proofs.unique | (sure & (count[i] == 1)),
        "solution_strict_minimum": proofs.strict_minimum | sure,
        "solution_global_minimum": proofs.global_minimum | sure,
    }


def _loop(
    plan: PathPlan, load: AffineLoad, problem: ParametricProblem, v: Array, tolerance: float | None
) -> tuple[Values, str]:
    """The loop between begin and end, and why it is not whole."""
    loop = hysteresis(problem, v, plan.begin, plan.end, plan.max_pieces, tolerance)
    ways, jumps = loop.ways, loop.jumps
    counts = np.array([len(way.t) for way in ways], dtype=np.int32)
    t, u, traction = (np.concatenate(x) for x in zip(*ways, strict=True))
    return {
        **load.states("loop_", t, u, traction, problem.law),
        "loop_branch": np.repeat(np.arange(len(ways), dtype=np.int32), counts),
        "jump_parameter": np.array([jump.t for jump in jumps]),
        "jump_vertex": np.array([counts[: jump.ways].sum() - 1 for jump in jumps], dtype=np.int32),
        "jump_rising": [(n < loop.there) == (plan.begin < plan.end) for n in range(len(jumps))],
        "jump_drop": [jump.released for jump in jumps],
        "energy_lost": loop.lost,
        "loop_area": loop.area,
        "loop_closed": int(loop.closed),
        "loop_complete": int(not loop.reason),
    }, loop.reason or "both ends of the range of t were reached"


def execute_path(
    study: Study,
    output: pathlib.Path,
    progress: Progress | None = None,
    command: Sequence[str] = ("tcstudy",),
    swept: Sequence[str] = (),
    lock: Journal | None = None,
) -> None:
    """Follow the path and write its file, with what is not as it was asked for in words.

    swept: names of the sweep, whose values a path does not have
    lock:  that of the output, if it was taken before
    Raises PathError, StoreError or
    GeometryFailed.
    """
    unused = f"a path is of one scene, that outside the sweep; the values of {', '.join(swept)} are not used"
    alone, plan = replace(study, axes=(), variants=()), study.path
    if plan is not None:
        alone = replace(alone, scenes=(plan.scene,))

    def find() -> Record:
        record = follow_path(study, progress)
        tell(found := shortfalls(study, record))
        return replace(record, attributes={**record.attributes, SHORTFALLS: "\n".join(found)})

    to_file(output, study, command, find, alone, [Remark(unused)] if swept else [], lock)


def shortfalls(study: Study, record: Record) -> list[str]:
    """What a user must know beside the results: an early end, missing or inexact solutions, an
    incomplete loop."""
    assert study.path is not None
    values, told = record.values, record.attributes
    whole = [status.name.lower() for status in WHOLE]
    ends = (("begin", values["parameter"][0]), ("end", values["parameter"][-1]))
    early = [(t, told[f"{end}_reason"]) for end, t in ends if told[f"{end}_status"] not in whole]
    found = [f"the path ends early, at {t:g}: {reason}" for t, reason in early]
    for t, count in zip(values["at"], values["solution_count"], strict=True):
        if not count:
            found.append(f"the path has no solution at {study.path.name} = {t:g}")
    acceptance = Acceptance(study.solver.tolerance)
    solved = acceptance.accepts(values["solution_residual"], values["solution_rounding"])
    if inexact := int(np.count_nonzero(~solved)):
        solutions = "1 solution misses" if inexact == 1 else f"{inexact} solutions miss"
        found.append(f"{solutions} the tolerance {acceptance.aim:g}; see solution_residual")
    if told.get("complete_reason"):
        found.append(f"{UNPROVED_BRANCHES}: {told['complete_reason']}")
    if study.path.hysteresis and not (values["loop_complete"] and values["loop_closed"]):
        why = (
            told["loop_reason"] if not values["loop_complete"] else "it does not end where it began"
        )
        found.append(f"{OPEN_LOOP}: {why}")
    return found
