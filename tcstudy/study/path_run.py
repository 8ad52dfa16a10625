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
from tcstudy.contact.block import TIE
from tcstudy.contact.boxes import Limits
from tcstudy.contact.certificates import certify
from tcstudy.contact.history.hysteresis import hysteresis
from tcstudy.contact.path.complete import Branches, all_branches
from tcstudy.contact.path.follow import Follower, ParametricProblem, Path
from tcstudy.contact.path.problem import by_code
from tcstudy.contact.path.proofs import proved_minima
from tcstudy.contact.path.query import PathSolution, folds, lowest, solutions_at, solutions_of
from tcstudy.contact.path.record import WHOLE, PathStatus
from tcstudy.data.provenance import SHORTFALLS, Remark, collect, tell
from tcstudy.data.records import LevelRecord
from tcstudy.data.store import Record, write_record
from tcstudy.data.tables import PATH
from tcstudy.errors import GeometryFailed
from tcstudy.offline.level import Level
from tcstudy.scene.contact_states import ContactState, contact_states
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
    true: ParametricProblem
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
        lambda_1 = level.lambda_1(plan.scene)
    except NotPositiveDefinite as error:
        raise PathError(str(error)) from error
    setting = _Setting(plan, load, load.problem, straight, lambda_1, study.solver.tolerance)
    path, v = _follow(setting, progress)
    every = None
    if plan.complete:
        every = all_branches(straight, plan.begin, plan.end, lambda_1, LIMITS, plan.at)
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
        "lambda_1": lambda_1,
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


def _follow(setting: _Setting, progress: Progress | None) -> tuple[Path, Array]:
    """The path and the solution at t = begin that it starts from."""
    plan, direction = setting.plan, setting.plan.direction
    if direction != "both" and plan.begin > plan.end:  # the follower's forward is growing t
        direction = "backward" if direction == "forward" else "forward"
    follower = Follower(plan.within[0], plan.within[1], plan.max_pieces, setting.tolerance)
    branch: Branch = "from-zero" if plan.start == "zero" else "lowest"
    return followed(setting.straight, follower, branch, plan.begin, direction, plan.name, progress)


def _curve(setting: _Setting, path: Path) -> Values:
    load, states = setting.load, by_code(path.problem.law, contact_states)
    state = states[path.codes]
    turning = folds(path)
    events = path.events
    before, after = states[events.before], states[events.after]
    changed = before != after
    low = lowest(path)
    return {
        "parameter": path.t,
        "u_T": path.u,
        "xi": path.traction,
        "energy": path.energy + load.constant(path.t),
        "energy_rate": load.constant_rate(path.t) - path.conjugate,
        "residual": path.residual,
        "stable": path.stable,
        "state": state,
        "slip_length": np.asarray((state != ContactState.STICK) @ path.problem.c),
        "fold_vertex": [f.vertex for f in turning],
        "fold_size": [f.size for f in turning],
        "fold_maximum": [f.limit for f in turning],
        "fold_stable_before": [f.stable[0] for f in turning],
        "fold_stable_after": [f.stable[1] for f in turning],
        "event_vertex": events.vertex[changed],
        "event_node": events.node[changed],
        "event_before": before[changed],
        "event_after": after[changed],
        "lowest_begin": low.begin,
        "lowest_end": low.end,
        "lowest_piece": low.piece,
        "lowest_certified": proved_minima(path, low, setting.lambda_1, Acceptance(setting.tolerance)),
    }


def _branches(setting: _Setting, path: Path, every: Branches) -> Values:
    """All branches one after the other."""
    branches, known = every.branches, {code.tobytes() for code in path.codes}
    none = np.zeros((0, path.problem.m))
    t = np.concatenate([none[:, 0], *(b.t for b in branches)])
    return {
        "complete": int(every.complete),
        "at_complete": _known(setting, every),
        "branch_of": np.repeat(np.arange(len(branches)), [len(b.t) for b in branches]),
        "branch_parameter": t,
        "branch_energy": np.concatenate([none[:, 0], *(b.energy for b in branches)]) + setting.load.constant(t),
        "branch_u_T": np.concatenate([none, *(b.u for b in branches)]),
        "branch_xi": np.concatenate([none, *(b.traction for b in branches)]),
        "branch_stable": np.concatenate([np.zeros(0, bool), *(np.append(b.stable, False) for b in branches)]),
        "branch_loop": [int(b.end == PathStatus.CLOSED_LOOP) for b in branches],
        "branch_on_path": [any(code.tobytes() in known for code in b.codes) for b in branches],
    }


SAME = 1e-7
"""Of the largest slip, by which the same solution may differ on the path and on its branch."""


def _beside(path: Path, every: Branches, i: int, t: float, found: list[PathSolution]) -> list[PathSolution]:
    """The solutions at t, the requested value i, that are known beside those found on the path."""
    problem, all_of_them = path.problem.at(t), list(found)
    known = [(one.v, one.stable) for branch in every.branches for one in solutions_at(branch, t)]
    if (listed := every.listed[i]) is not None:
        known += zip(listed.v, listed.stable, strict=True)
    for v, stable in known:
        size = SAME * float(np.max(np.abs(v), initial=0.0))
        if all(np.max(np.abs(v - one.v)) > size for one in all_of_them):
            residual = problem.inclusion_residual(v)
            all_of_them.append(PathSolution(v, problem.energy(v), bool(stable), -1, residual))
    return all_of_them


def _known(setting: _Setting, every: Branches) -> Array:
    """Whether all solutions at each of the requested values are known by proof."""
    ends = sorted((setting.plan.begin, setting.plan.end))
    pairs = zip(setting.plan.at, every.listed, strict=True)
    return np.array([ends[0] <= t <= ends[1] and every.complete if x is None else x.complete for t, x in pairs], bool)


def _solutions(setting: _Setting, path: Path, every: Branches | None) -> Values:
    """Solutions on the path at the requested values; those of a smooth law by Newton's method from its stand-in's.

    every: all branches, whose solutions are added; of a smooth law they are those of another problem
    """
    law, at = setting.true.law, setting.plan.at
    found: list[list[PathSolution]] = [
        solutions_at(path, t) if law.piecewise_linear else solutions_of(law, path, t) for t in at
    ]
    known = np.zeros(len(at), dtype=bool)
    if every is not None and law.piecewise_linear:
        found = [_beside(path, every, i, at[i], group) for i, group in enumerate(found)]
        known = _known(setting, every)
    rows = [(i, s) for i, group in enumerate(found) for s in group]
    proofs = [certify(setting.true.at(at[i]), s.v, setting.lambda_1, setting.tolerance) for i, s in rows]
    energies = np.array([s.energy for _, s in rows])
    least = [min((s.energy for s in group), default=np.nan) for group in found]
    slack = TIE * float(np.max(np.abs(energies), initial=0.0))
    v = np.array([s.v for _, s in rows]).reshape(len(rows), path.problem.m)
    least_one = np.array([s.energy <= least[i] + slack for i, s in rows], dtype=bool)
    proved = least_one & known[[i for i, _ in rows]]
    alone = np.array([len(found[i]) == 1 for i, _ in rows], dtype=bool)
    tractions = [setting.true.at(at[i]).xi(s.v) / path.problem.c for i, s in rows]

    return {
        "at": np.array(at),
        "solution_count": [len(group) for group in found],
        "solution_at": [i for i, _ in rows],
        "solution_parameter": [at[i] for i, _ in rows],
        "solution_piece": [s.piece for _, s in rows],
        "solution_energy": energies + setting.load.constant(np.array([at[i] for i, _ in rows])),
        "solution_residual": [s.residual for _, s in rows],
        "solution_rounding": [setting.true.at(at[i]).xi_rounding(s.v) for i, s in rows],
        "solution_stable": [s.stable for _, s in rows],
        "solution_lowest": least_one,
        "solution_unique": np.array([proof.unique for proof in proofs], dtype=bool) | (proved & alone),
        "solution_strict_minimum": np.array([proof.strict_minimum for proof in proofs], dtype=bool) | proved,
        "solution_global_minimum": np.array([proof.global_minimum for proof in proofs], dtype=bool) | proved,
        "solution_u_T": v,
        "solution_xi": np.array(tractions).reshape(v.shape),
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
        "loop_energy": _energy(setting, t, u),
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


def _energy(setting: _Setting, t: Array, u: Array) -> Array:
    """(k,) energies of states u (k, m) at t (k,) [J/m]."""
    problem, loads = setting.straight, setting.straight.l_0 + t[:, None] * setting.straight.l_1
    body = np.sum(u * (0.5 * (u @ problem.A_tilde) - loads), axis=1)
    return np.asarray(body + problem.law.j(u) @ problem.c + setting.load.constant(t))


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
