"""What a run would do, found out without doing it: counts, sizes, what is left out and why.

The checks beyond the study's text that run and plan make before any work: the output and a body from a file.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path

from tcstudy.data import schema
from tcstudy.data.files import check_writable
from tcstudy.errors import GeometryFailed, StoreError, UsageError, UserFault
from tcstudy.exact.loads import description
from tcstudy.offline.elastic import swept_parts
from tcstudy.offline.level import Level
from tcstudy.offline.loads import exchange_level
from tcstudy.read.document import located
from tcstudy.scene.points import FELT, count_points, distinct, idle_notes, needs_heat_solve, of_stiffness, why_no_heat
from tcstudy.scene.study import MeshPlan, Study
from tcstudy.study.doubts import built_doubts, built_faults, doubts, locking_notes
from tcstudy.study.forecasts import LevelForecast, forecast, refined
from tcstudy.study.sizes import measured, meshing_seconds, sizes


@dataclass(frozen=True)
class Plan:
    """The forecast of a run.

    points:          sweep points per level
    factorisations:  of the stiffness per level: one for every ratio of its moduli to one another
    heat_solves:     distinct (α, k, data) temperature fields per level; 0 if no heat problem is solved
    levels:          the mesh levels whose number is known beforehand, counted where their meshes are small
    left_out:        what is not computed, each with its reason
    notes:           what the user may want to know before starting
    bytes:           expected size of the result file; the most to expect where an estimate decides about meshes
    """

    points: int
    factorisations: int
    heat_solves: int
    levels: tuple[LevelForecast, ...]
    left_out: tuple[str, ...]
    notes: tuple[str, ...]
    bytes: int


def plan(study: Study) -> Plan:
    """The forecast of a study that the reader has accepted.

    Raises GeometryFailed where a run would before it solves anything.
    """
    if study.variants:
        from tcstudy.study.variants import plan_variants

        return plan_variants(study)[0]
    ratios = {Level.ratio(s) for s in distinct(study.scenes, *of_stiffness(study.scenes))}
    heats = {
        (s.heat, tuple(one.k for one in s.material.all)) for s in distinct(study.scenes, *FELT) if needs_heat_solve(s)
    }
    levels = sizes(study)
    return Plan(
        points=len(study.scenes),
        factorisations=len(ratios),
        heat_solves=len(heats),
        levels=levels,
        left_out=tuple(_left_out(study, bool(heats))),
        notes=tuple(_notes(study, levels)),
        bytes=_bytes(study, levels),
    )


def output_of(study: Study) -> Path:
    """The study's output, or results/<name of the study file>.nc."""
    if study.output.path is not None:
        return study.output.path
    stem = study.source.stem if study.source is not None else "study"
    return Path("results") / f"{stem}.nc"


def output_beside(study: Study, kind: str) -> Path:
    """Where `tcstudy path`, `history` and `fit` write: beside the results of a run, with "-path" added to the name."""
    output = output_of(study)
    return output.with_name(f"{output.stem}-{kind}{output.suffix or '.nc'}")


def check_kind(study: Study, kind: str, name: str) -> None:
    """Raise UsageError where a command would leave out what a study is about, or needs meshes that only a run makes.

    A history is no set of static points; a path is of one mesh, and adaptive ones follow from the points of a run.
    """
    if study.history is not None and kind not in ("history", "fit"):
        command = COMMAND_OF.get(kind, kind)
        raise UsageError(
            f"{name}: history: the study is a load history, and tcstudy {command} has no memory; use tcstudy "
            "history, or --set history=null for its points without memory"
        )
    if kind == "path" and study.path is not None and study.mesh.strategy.adapts:
        what = "the path is of one mesh, and adaptive meshes follow from the solutions of a run"
        raise UsageError(f"{name}: path: {what}; give it others, for example --set 'mesh={{maxh: ..., levels: 3}}'")


def _left_out(study: Study, heat_solved: bool) -> list[str]:
    scenes = study.scenes
    out = []
    cold = count_points(scenes, FELT, lambda s: not needs_heat_solve(s))
    if not heat_solved:
        out.append(f"heat problem: {why_no_heat(scenes)}")
    elif cold:
        out.append(f"heat problem at {cold} of {len(scenes)} points: {why_no_heat(scenes)}")
    if not any(s.f != (0.0, 0.0) for s in distinct(scenes, "f")):
        out.append("body force: f is zero or not given")
    if not study.mesh.estimates and study.history is None:
        out.append("error estimates: not asked for (mesh.estimate: true, a tolerance or family: adaptive adds them)")
    if study.mesh.tolerance is not None:
        out.append(_levels_not_needed(study.mesh, "" if study.units == "none" else " m"))
    if not study.output.fields and study.history is None:
        out.append("whole-body fields u₂ and θ in the data: not asked for (output.fields: true keeps them)")
    return out


def _levels_not_needed(mesh: MeshPlan, unit: str) -> str:
    return (
        f"meshes finer than needed: {mesh.strategy.how} from maxh = {mesh.maxh[0]:g}{unit} until the estimated "
        f"relative error of {mesh.goal.quantity} is at most {mesh.tolerance:g} at every point, {mesh.max_dofs} dofs "
        f"are passed or there are {mesh.levels} levels"
    )


COMMAND_OF = {"convergence": "converge"}
"""Commands whose files have another name."""
WORTH_SAYING = 2.0
"""Seconds of meshing from which on a forecast says so."""


def _meshing_note(study: Study, levels: tuple[LevelForecast, ...]) -> list[str]:
    """What meshing will cost, where it costs much, and how it would cost little."""
    if (seconds := meshing_seconds(study.mesh, levels)) < WORTH_SAYING:
        return []
    more = math.ceil(math.log(seconds / WORTH_SAYING, 4)) + 1
    what = f"meshing takes about {seconds:.0f} s"
    return [f"{what}; mesh.refine: {study.mesh.refine + more} makes meshes of this size from coarser ones, much faster"]


def _notes(study: Study, levels: tuple[LevelForecast, ...]) -> list[str]:
    notes = [*idle_notes(study), *_doubts(study), *_mesh_notes(study.mesh), *_other_commands(study)]
    if study.design is not None:
        notes.insert(0, study.design.note)
    if (derived := description(study)) is not None:
        notes.insert(0, derived)
    notes += [*_shared_parts(study), *_heat_by_edge(study), *locking_notes(study.scenes), *_meshing_note(study, levels)]
    down = count_points(study.scenes, ("friction",), lambda s: any(math.isinf(law.omega) for law in s.laws))
    if down:
        notes.append(f"{down} of {len(study.scenes)} points have a law with down-jumps: solutions may not be unique")
    return notes


def _shared_parts(study: Study) -> list[str]:
    """What factorisations share where only a part of the body has moduli that are swept."""
    scenes = study.scenes
    if not scenes[0].material.regions or not (swept := swept_parts(scenes)):
        return []
    count = len({Level.ratio(scene) for scene in distinct(scenes, *of_stiffness(scenes))})
    names = ", ".join(name for where in swept for name in where)
    return [f"only what meets {names} is computed again after the first of the {count} stiffness factorisations"]


def _heat_by_edge(study: Study) -> list[str]:
    """What edges that have heat of their own share."""
    scenes = distinct(study.scenes, *FELT)
    if not any(scene.heat_by_edge and needs_heat_solve(scene) for scene in scenes):
        return []
    sets = len({exchange_level(scene)[1] for scene in scenes})
    modes = "one set of modes" if sets == 1 else f"{sets} sets of modes, one for each ratio of alpha between edges,"
    return [f"heat by edge: one factorisation and {modes} on a level serve all alpha, theta_bar, theta, flux and q"]


def warnings(study: Study) -> list[str]:
    """Notes that a run says as well, since its numbers would mislead without them."""
    return [*idle_notes(study), *_doubts(study), *locking_notes(study.scenes)]


def _doubts(study: Study) -> list[str]:
    """What the author may not have meant. Raises GeometryFailed if a file has no such face."""
    return [*built_doubts(study), *doubts(study)]


def _other_commands(study: Study) -> list[str]:
    """Sections that a run leaves alone, and the command that reads them."""
    notes = []
    if study.path is not None:
        path, units = study.path, f" {study.path.units}" if study.path.units != "1" else ""
        span = f"from {path.begin:.6g}{units} to {path.end:.6g}{units}"
        notes.append(f"path along {path.name} {span}: follow it with tcstudy path")
    if study.history is not None:
        steps, points = study.history.steps, len(study.scenes)
        how = f"{steps} steps of {', '.join(study.history.names)}" + (
            f" at each of {points} points" if points > 1 else ""
        )
        alone = "" if study.fit is not None else ", and nothing else is computed of this study"
        notes.append(f"load history, {how}: tcstudy history follows it{alone}")
    if study.fit is not None:
        names = ", ".join(one.number.name for one in study.fit.parameters)
        notes.append(f"fit of {names} to {study.fit.file}: find them with tcstudy fit")
    if study.exact is not None:
        notes.append("exact solution given: measure the errors against it with tcstudy converge")
    return notes


def _mesh_notes(mesh: MeshPlan) -> list[str]:
    """What the table of levels does not say."""
    note = mesh.strategy.note.format(goal=mesh.goal.quantity, power=1 - mesh.grading)
    return [note] if note else []


def expected_bytes(study: Study) -> int:
    """Rough size of the result file, for the check of free space."""
    if study.variants:
        return sum(expected_bytes(one.study) for one in study.variants if one.study is not None)
    if study.scenes[0].body.brep is None:
        return _bytes(study, forecast(study))
    try:
        return _bytes(study, measured(study))
    except GeometryFailed:  # which is said elsewhere
        return _bytes(study, ())


def _bytes(study: Study, levels: tuple[LevelForecast, ...]) -> int:
    if study.history is not None:
        from tcstudy.data.history_store import history_bytes

        return history_bytes(study, study.history.of(levels).n_contact)
    return schema.expected_bytes(study, [(level.n_contact, level.nodes) for level in refined(levels, study.mesh)])


def faults(study: Study, output: Path) -> list[str]:
    """What would stop a run of this study into `output`, one line each, as the user sees it; empty if nothing would."""
    file = str(study.source) if study.source is not None else "<text>"
    return [*_body_faults(study), *(f"{file}: {text}" for text in _output_faults(study, output))]


def fault_in(study: Study, fault: UserFault, name: str) -> str:
    """What stopped a command, as the user sees it: with its place in the study, or the study's name."""
    if fault.placed:
        return str(fault)
    if fault.keys is None:
        return f"{name}: {fault}"
    what, _, remedy = str(fault).partition("; ")
    return "\n".join(map(str, located(study, [(fault.keys, what, remedy or "check the body, or try another maxh")])))


def _body_faults(study: Study) -> list[str]:
    return [str(problem) for problem in located(study, built_faults(study))]


def _output_faults(study: Study, output: Path) -> list[str]:
    try:
        return check_writable(output, expected_bytes(study))
    except StoreError as error:
        return [str(error)]
