"""Follow a study's path: the equilibria on the branch from rest, those at requested values, and the hysteresis loop,
into its file."""

from __future__ import annotations

import pathlib
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from threadpoolctl import threadpool_limits

from tcstudy.condense import NotPositiveDefinite
from tcstudy.contact.all_solutions import Limits
from tcstudy.contact.certificates import certify
from tcstudy.contact.history.hysteresis import hysteresis
from tcstudy.contact.path.complete import Branches, all_branches
from tcstudy.contact.path.follow import Follower, ParametricProblem, Path
from tcstudy.contact.path.problem import WHOLE, PathStatus, by_code
from tcstudy.contact.path.query import PathSolution, folds, lowest, proved_minima, solutions_at, solutions_of
from tcstudy.contact.solve import TIE
from tcstudy.data.provenance import SHORTFALLS, Remark, collect, tell
from tcstudy.data.records import LevelRecord
from tcstudy.data.store import Record, write_record
from tcstudy.data.tables import PATH
from tcstudy.errors import GeometryFailed
from tcstudy.offline.level import Level
from tcstudy.scene.histories import ContactState, contact_states
from tcstudy.scene.parameters import path_scene
from tcstudy.scene.study import Acceptance, Branch, PathPlan, Study
from tcstudy.study.lint import loaded, warnings
from tcstudy.study.path_affine import AffineLoad, PathError, affine_load, followed, straightened
from tcstudy.study.run import stages

Array = NDArray[np.float64]
Values = dict[str, Any]
Progress = Callable[[int, float], None]
LIMITS = Limits(boxes=20_000, seconds=20.0)
"""Of each of the slabs that a range is proved in."""


@dataclass(frozen=True)
class _Setting:
    """A path ready to be followed: the problem with the law itself and with its piecewise-linear stand-in."""

    plan: PathPlan
    load: AffineLoad
    straight: ParametricProblem
    lambda_1: float
    tolerance: float | None


def follow_path(study: Study, progress: Progress | None = None) -> Record:
    """The path that the study asks for.

    progress: called with (pieces, t) from time to time
    Raises PathError if there is nothing to follow or the start has no solution, GeometryFailed if the body has no
    mesh.
    """
    plan = study.path
    if plan is None:
        raise PathError("the study has no section path; add path: {parameter: theta_bar, from: 0 K, to: 40 K}")
    level, line = _level(study, plan)
    try:
        load = affine_load(level, lambda t: path_scene(plan.scene, plan.parameter, t), plan.begin, plan.end, plan.name)
        straight = straightened(level, plan.scene, load.problem, plan.law_error, plan.within)
        setting = _Setting(plan, load, straight, level.lambda_1(plan.scene), study.solver.tolerance)
    except NotPositiveDefinite as error:
        raise PathError(str(error)) from error
    direction = plan.direction
    if direction != "both" and plan.begin > plan.end:  # the follower's forward is growing t
        direction = "backward" if direction == "forward" else "forward"
    follower = Follower(*plan.within, plan.max_pieces, setting.tolerance)
    branch: Branch = "from-zero" if plan.start == "zero" else "lowest"
    path, v = followed(straight, follower, branch, plan.begin, direction, plan.name, progress)
    every = None
    if plan.complete:
        every = all_branches(straight, plan.begin, plan.end, setting.lambda_1, LIMITS, plan.at)
    told = {
        "parameter": plan.name,
        "parameter_range": np.array([plan.begin, plan.end]),
        "parameter_within": np.array(plan.within),
        "begin_status": path.begin.name.lower(),
        "begin_reason": path.begin.reason,
        "end_status": path.end.name.lower(),
        "end_reason": path.end.reason,
    }
    values = {
        **vars(line),
        **line.fields,
        "start": path.start,
        "lambda_1": setting.lambda_1,
        "lambda_1_error": load.problem.A_error,
        "omega": load.problem.law.omega,
        "law_error": 0.0 if load.problem.law.piecewise_linear else plan.law_error,
        "affine_defect": load.defect,
        **_curve(setting, path),
        **_solutions(setting, path, every),
    }
    if plan.hysteresis:
        found, told["loop_reason"] = _loop(setting, v)
        values |= found
    if every is not None:
        values |= _branches(setting, path, every)
        told["complete_reason"] = every.reason
    return Record("path", PATH, values, told)


def _level(study: Study, plan: PathPlan) -> tuple[Level, LevelRecord]:
    """The mesh level of the path, as a run of its scene would have it, and what the data keep of it."""
    last = study.mesh.levels - 1 if plan.level is None else plan.level
    mesh = replace(study.mesh, levels=last + 1, tolerance=None, estimate=False)
    stage = next(stages(replace(study, mesh=mesh, scenes=(plan.scene,), axes=()), first=last))
    if stage.level is None or stage.record is None:
        raise GeometryFailed(next(stage.blocks).reasons[0])
    return stage.level, stage.record


def _curve(setting: _Setting, path: Path) -> Values:
    load, states = setting.load, by_code(path.problem.law, contact_states)
    state, low, events = states[path.codes], lowest(path), path.events
    before, after = states[events.before], states[events.after]
    changed = before != after
    return {
        "parameter": path.t,
        "u_T": path.u,
        "xi": path.traction,
        "energy": path.energy + load.constant(path.t),
        "energy_rate": load.constant.deriv()(path.t) - path.conjugate,
        "residual": path.residual,
        "stable": path.stable,
        "state": state,
        "slip_length": np.asarray((state != ContactState.STICK) @ path.problem.c),
        **{f"fold_{name}": column for name, column in folds(path)._asdict().items()},
        "event_vertex": events.vertex[changed],
        "event_node": events.node[changed],
        "event_before": before[changed],
        "event_after": after[changed],
        **{f"lowest_{name}": column for name, column in low._asdict().items()},
        "lowest_certified": proved_minima(path, low, setting.lambda_1, Acceptance(setting.tolerance)),
    }


def _branches(setting: _Setting, path: Path, every: Branches) -> Values:
    """All branches one after the other."""
    branches, known = every.branches, {code.tobytes() for code in path.codes}

    def of_all(name: str) -> Array:
        return np.concatenate([getattr(path, name)[:0], *(getattr(b, name) for b in branches)])

    return {
        "complete": int(every.complete),
        "at_complete": np.array([every.complete_at(t) for t in setting.plan.at], dtype=bool),
        "branch_of": np.repeat(np.arange(len(branches)), [len(b.t) for b in branches]),
        "branch_parameter": of_all("t"),
        "branch_energy": of_all("energy") + setting.load.constant(of_all("t")),
        "branch_u_T": of_all("u"),
        "branch_xi": of_all("traction"),
        "branch_stable": np.concatenate([path.stable[:0], *(np.append(b.stable, False) for b in branches)]),
        "branch_loop": [int(b.end == PathStatus.CLOSED_LOOP) for b in branches],
        "branch_on_path": [any(code.tobytes() in known for code in b.codes) for b in branches],
    }


SAME = 1e-7
"""Of the largest slip, by which the same solution may differ on the path and on its branch."""


def _solutions(setting: _Setting, path: Path, every: Branches | None) -> Values:
    """Solutions on the path at the requested values; those of a smooth law by Newton's method from its stand-in's.

    every: all branches, whose solutions are added; of a smooth law they are those of another problem
    """
    at, law, known = np.array(setting.plan.at), setting.load.problem.law, np.zeros(len(setting.plan.at), dtype=bool)
    found = list[list[PathSolution]]()
    for n, t in enumerate(at.tolist()):
        found.append(solutions_at(path, t) if law.piecewise_linear else solutions_of(law, path, t))
        if every is not None and law.piecewise_linear:
            problem, known[n] = path.problem.at(t), every.complete_at(t)
            for v, stable in every.solutions(t):
                size = SAME * float(np.max(np.abs(v), initial=0.0))
                if all(np.max(np.abs(v - one.v)) > size for one in found[n]):
                    found[n].append(PathSolution(v, problem.energy(v), stable, -1, problem.inclusion_residual(v)))
    count = np.array([len(group) for group in found], dtype=np.intp)
    i, rows = np.repeat(np.arange(len(at)), count), [solution for group in found for solution in group]
    problems = [setting.load.problem.at(float(t)) for t in at[i]]
    pairs = list(zip(problems, (s.v for s in rows), strict=True))
    proofs = [certify(problem, v, setting.lambda_1, setting.tolerance) for problem, v in pairs]
    v, energy = np.array([s.v for s in rows]).reshape(-1, path.problem.m), np.array([s.energy for s in rows])
    least = np.full(len(at), np.inf)
    np.minimum.at(least, i, energy)
    least_one = energy <= least[i] + TIE * float(np.max(np.abs(energy), initial=0.0))
    proved, alone = least_one & known[i], count[i] == 1
    return {
        "at": at,
        "solution_count": count.tolist(),
        "solution_at": i,
        "solution_parameter": at[i],
        "solution_piece": [s.piece for s in rows],
        "solution_energy": energy + setting.load.constant(at[i]),
        "solution_residual": [s.residual for s in rows],
        "solution_rounding": [problem.xi_rounding(v) for problem, v in pairs],
        "solution_stable": [s.stable for s in rows],
        "solution_lowest": least_one,
        "solution_unique": np.array([proof.unique for proof in proofs], dtype=bool) | (proved & alone),
        "solution_strict_minimum": np.array([proof.strict_minimum for proof in proofs], dtype=bool) | proved,
        "solution_global_minimum": np.array([proof.global_minimum for proof in proofs], dtype=bool) | proved,
        "solution_u_T": v,
        "solution_xi": np.array([problem.xi(v) / path.problem.c for problem, v in pairs]).reshape(v.shape),
    }


def _loop(setting: _Setting, v: Array) -> tuple[Values, str]:
    """The loop between begin and end, and why it is not whole."""
    plan, problem = setting.plan, setting.straight
    loop = hysteresis(problem, v, plan.begin, plan.end, plan.max_pieces, setting.tolerance)
    ways, jumps = loop.ways, loop.jumps
    counts = np.array([len(way.t) for way in ways], dtype=np.int32)
    t, u, traction = (np.concatenate(x) for x in zip(*ways, strict=True))
    return {
        "loop_parameter": t,
        "loop_branch": np.repeat(np.arange(len(ways), dtype=np.int32), counts),
        "loop_energy": problem.energy(t, u, traction) + setting.load.constant(t),
        "loop_u_T": u,
        "loop_xi": traction,
        "jump_parameter": np.array([jump.t for jump in jumps]),
        "jump_vertex": np.array([counts[: jump.ways].sum() - 1 for jump in jumps], dtype=np.int32),
        "jump_rising": [(n < loop.there) == (plan.begin < plan.end) for n in range(len(jumps))],
        "jump_drop": [jump.released for jump in jumps],
        "energy_lost": loop.lost,
        "loop_area": loop.area,
        "loop_closed": int(loop.closed),
        "loop_complete": int(loop.complete),
    }, loop.reason or "both ends of the range of t were reached"


def execute_path(
    study: Study,
    output: pathlib.Path,
    progress: Progress | None = None,
    command: Sequence[str] = ("tcstudy",),
    swept: Sequence[str] = (),
) -> list[str]:
    """Follow the path, write its file and return what is not as it was asked for, in words.

    swept: names of the sweep, whose values a path does not have. Raises PathError, StoreError or GeometryFailed.
    """
    tell(remarks := _remarks(study, swept))
    with threadpool_limits(1, user_api="blas"):
        record = follow_path(study, progress)
    found = shortfalls(study, record)
    tell(found)
    record = replace(record, attributes={**record.attributes, SHORTFALLS: "\n".join(found)})
    write_record(output, study, record, collect(study, command, remarks=remarks))
    return found


def _remarks(study: Study, swept: Sequence[str]) -> list[Remark]:
    """Warnings of the scene as it is written, or where that has no load, at the end that is farther from zero."""
    if (plan := study.path) is None:
        return []
    farther = path_scene(plan.scene, plan.parameter, max(plan.begin, plan.end, key=abs))
    scene = plan.scene if loaded([plan.scene]).all() else farther
    unused = f"a path is of one scene, that outside the sweep; the values of {', '.join(swept)} are not used"
    return [*([Remark(unused)] if swept else []), *warnings(replace(study, scenes=(scene,), axes=(), variants=()))]


def shortfalls(study: Study, record: Record) -> list[str]:
    """What a user must know beside the results: an early end, missing or inexact solutions, an incomplete loop."""
    assert study.path is not None
    values, told = record.values, record.attributes
    whole = [status.name.lower() for status in WHOLE]
    ends = (("begin", values["parameter"][0]), ("end", values["parameter"][-1]))
    early = [(t, told[f"{end}_reason"]) for end, t in ends if told[f"{end}_status"] not in whole]
    found = [f"the path ends early, at {t:g}: {reason}" for t, reason in early]
    for t, count in zip(values["at"], values["solution_count"], strict=True):
        if not count:
            found.append(f"the path has no solution at {study.path.name} = {t:g}")
    judged = zip(values["solution_residual"], values["solution_rounding"], strict=True)
    acceptance = Acceptance(study.solver.tolerance)
    inexact = sum(not acceptance.accepts(float(residual), float(rounding)) for residual, rounding in judged)
    if inexact:
        found.append(f"{inexact} solutions miss the tolerance {acceptance.aim:g}; see solution_residual")
    if told.get("complete_reason"):
        found.append(f"the branches are not proved to be all: {told['complete_reason']}")
    if study.path.hysteresis and not (values["loop_complete"] and values["loop_closed"]):
        why = told["loop_reason"] if not values["loop_complete"] else "it does not end where it began"
        found.append(f"the hysteresis loop is not whole: {why}")
    return found
