"""What a run would do, found out without doing it: counts, sizes, what is left out and why.

The checks beyond the study's text that run and plan make before any work: the output and a body from a file.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from tcstudy.data import schema
from tcstudy.data.files import check_writable
from tcstudy.data.provenance import Remark
from tcstudy.errors import GeometryFailed, StoreError, UsageError, UserFault
from tcstudy.exact.loads import description
from tcstudy.executors import WorkerDied, in_order
from tcstudy.offline.level import Level, swept_parts
from tcstudy.offline.loads import exchange_level
from tcstudy.read.document import located
from tcstudy.scene.points import FELT, count_points, distinct, idle_notes, needs_heat_solve, of_stiffness, why_no_heat
from tcstudy.scene.records import Contact
from tcstudy.scene.study import Study
from tcstudy.shapes.edges import body_area, boundary_lengths
from tcstudy.study.doubts import built_faults, doubts, locking_notes, unused
from tcstudy.study.expected import counting, meshing_seconds, rough_sizes, sizes
from tcstudy.study.jobs import LevelForecast, Staff, forecast, refined, submit


@dataclass(frozen=True)
class Plan:
    """The forecast of a run.

    points:          sweep points per level
    factorisations:  of the stiffness per level: one for every ratio of its moduli to one another
    heat_solves:     distinct (α, k, data) temperature fields per level; 0 if no heat problem is solved
    levels:          the mesh levels whose number is known beforehand, counted where their meshes are small
    left_out:        what is not computed, each with its reason
    notes:           what the user may want to know before starting
    bytes:           expected size of the result file; the most to expect where an estimate decides about meshes; 0 for
                     a path or a fit, which are small
    asked:           what a run does in place of solving points, in words; empty for a sweep
    """

    points: int
    factorisations: int
    heat_solves: int
    levels: tuple[LevelForecast, ...]
    left_out: tuple[str, ...]
    notes: tuple[str, ...]
    bytes: int
    asked: str = ""


def plan(study: Study) -> Plan:
    """The forecast of a study that the reader has accepted.

    Raises GeometryFailed where a run would before it solves anything.
    """
    if study.variants:
        return of_geometries(study, [(one.study, plan(one.study)) for one in study.variants if one.study is not None])
    if study.kind == "path" and (path := study.path) is not None:  # of one scene and one level
        mesh = study.mesh if path.level is None else replace(study.mesh, levels=path.level + 1)
        study = replace(study, scenes=(path.scene,), axes=(), mesh=mesh)
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
        bytes=0 if study.kind in ("path", "fit") else _bytes(study, levels),
        asked=asked(study),
    )


START = 2.0
"""Seconds that a worker needs before it can make a mesh."""


def plans(studies: Sequence[Study], staff: Staff) -> Iterator[Plan]:
    """The forecasts of geometries in their order, whose meshes workers make where that pays.

    Raises GeometryFailed, WorkersFailed.
    """
    expected = [counting(study) for study in studies] if len(studies) > 1 else []
    who = staff.whole(expected, START)
    if who is None:
        yield from map(plan, studies)
        return
    pairs = zip(studies, expected, strict=True)
    for answer in in_order(who, (submit(who, plan, study, name="plan", seconds=one.seconds) for study, one in pairs)):
        try:
            yield answer.result()
        except WorkerDied as error:
            raise GeometryFailed(
                f"a geometry of the sweep cannot be meshed ({error}); plan it alone", ("sweep",)
            ) from error


def of_geometries(study: Study, found: Sequence[tuple[Study, Plan]]) -> Plan:
    """The forecast of all geometries from those of each that has a mesh, with the meshes of the largest."""
    words = [one.words for one in study.variants if one.study is not None]
    factors, meshes = sum(plan.factorisations for _, plan in found), sum(own.mesh.levels for own, _ in found)
    note = (
        f"{len(found)} {'geometry' if len(found) == 1 else 'geometries'}: {meshes} meshes, "
        f"{factors * study.mesh.levels} stiffness factorisations; the points of a geometry share both. "
        "Sizes are those of the largest"
    )
    refused = [f"refused, {one.words}: {one.reason}" for one in study.variants if one.study is None]
    return replace(
        max((plan for _, plan in found), key=lambda plan: plan.levels[-1].n_dof),
        points=len(study.scenes),
        factorisations=factors,
        heat_solves=sum(plan.heat_solves for _, plan in found),
        notes=(
            note,
            *refused,
            *map(str, once([(own, plan.notes) for own, (_, plan) in zip(words, found, strict=True)])),
        ),
        bytes=sum(plan.bytes for _, plan in found),
    )


NUMBER = re.compile(r"\d+(?:\.\d+)?(?:e[+-]?\d+)?")


def once(notes: Sequence[tuple[str, Iterable[str]]]) -> list[Remark]:
    """Every note once, with the geometries that it is of unless it is of all.

    notes: (words of a geometry, its notes). Those that differ in numbers only are one, with the range of each number.
    """
    alike: dict[str, dict[str, list[str]]] = {}
    for words, own in notes:
        for note in own:
            text = NUMBER.sub("{}", note.replace("{", "{{").replace("}", "}}"))
            alike.setdefault(text, {})[words] = NUMBER.findall(note)
    found = []
    for text, numbers in alike.items():
        said = text.format(*map(_span, zip(*numbers.values(), strict=True)))
        few = "; ".join(numbers) if len(numbers) == 1 else f"{len(numbers)} of {len(notes)} geometries"
        found.append(Remark(said, "" if len(numbers) == len(notes) else few))
    return found


def _span(texts: Sequence[str]) -> str:
    least, greatest = min(texts, key=float), max(texts, key=float)
    return least if least == greatest else f"{least} to {greatest}"


def output_of(study: Study) -> Path:
    """The study's output, or results/<name of the study file>.nc."""
    if study.output.path is not None:
        return study.output.path
    stem = study.source.stem if study.source is not None else "study"
    return Path("results") / f"{stem}.nc"


def output_beside(study: Study, kind: str) -> Path:
    """Where a path, a history and a fit are written: beside the results of a sweep, with "-path" added to the name."""
    output = output_of(study)
    return output.with_name(f"{output.stem}-{kind}{output.suffix or '.nc'}")


def check_kind(study: Study, kind: str, name: str) -> None:
    """Raise UsageError where a command would leave out what a study is about, or needs meshes that only a run makes.

    A history is no set of static points; a path is of one mesh, and adaptive ones follow from the points of a run.
    """
    if study.history is not None and kind not in ("history", "fit"):
        command = "converge" if kind == "convergence" else kind
        raise UsageError(
            f"{name}: history: the study is a load history, and tcstudy {command} has no memory; use tcstudy "
            "run, or --set history=null for its points without memory"
        )
    if kind == "path" and study.path is not None and study.mesh.strategy.adapts:
        what = "the path is of one mesh, and adaptive meshes follow from the solutions of a run"
        remedy = "give it others, for example --set 'mesh={maxh: ..., levels: 3}', or solve points by --set path=null"
        raise UsageError(f"{name}: path: {what}; {remedy}")


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
        mesh, unit = study.mesh, "" if study.units == "none" else " m"
        out.append(
            f"meshes finer than needed: {mesh.strategy.how} from maxh = {mesh.maxh[0]:g}{unit} until the estimated "
            f"relative error of {mesh.goal.quantity} is at most {mesh.tolerance:g} at every point, {mesh.max_dofs} "
            f"dofs are passed or there are {mesh.levels} levels"
        )
    if not study.output.fields and study.history is None:
        out.append("whole-body fields u₂ and θ in the data: not asked for (output.fields: true keeps them)")
    return out


WORTH_SAYING = 2.0
"""Seconds of meshing from which on a forecast says so."""


def _notes(study: Study, levels: tuple[LevelForecast, ...]) -> Iterator[str]:
    scenes, mesh = study.scenes, study.mesh
    if (derived := description(study)) is not None:
        yield derived
    if study.design is not None:
        yield study.design.note
    yield from (*idle_notes(study), *doubts(study))
    if mesh.strategy.note:  # what the table of levels does not say
        yield mesh.strategy.note.format(goal=mesh.goal.quantity, power=1 - mesh.grading)
    yield from _other_commands(study)
    yield from _long_elements(study, levels)
    if scenes[0].material.regions and (swept := swept_parts(scenes)):
        count = len({Level.ratio(scene) for scene in distinct(scenes, *of_stiffness(scenes))})
        names = ", ".join(name for where in swept for name in where)
        yield f"only what meets {names} is computed again after the first of the {count} stiffness factorisations"
    if any(scene.heat_by_edge and needs_heat_solve(scene) for scene in distinct(scenes, *FELT)):
        sets = len({exchange_level(scene)[1] for scene in distinct(scenes, *FELT)})
        modes = "one set of modes" if sets == 1 else f"{sets} sets of modes, one for each ratio of alpha between edges,"
        yield f"heat by edge: one factorisation and {modes} on a level serve all alpha, theta_bar, theta, flux and q"
    yield from locking_notes(scenes)
    if (seconds := meshing_seconds(mesh, levels)) >= WORTH_SAYING:
        more = mesh.refine + math.ceil(math.log(seconds / WORTH_SAYING, 4)) + 1
        remedy = f"mesh.refine: {more} makes meshes of this size from coarser ones, much faster"
        yield f"meshing takes about {seconds:.0f} s; {remedy}"
    down = count_points(scenes, ("friction",), lambda s: any(math.isinf(law.omega) for law in s.laws))
    if down:
        yield f"{down} of {len(scenes)} points have a law with down-jumps: solutions may not be unique"


def warnings(study: Study, text: bool = True) -> list[Remark]:
    """Notes that results have as well, since their numbers would mislead without them; with the geometry where there
    are several. Raises GeometryFailed if a file has no such face.

    text: whether with those of the study's text, which all geometries share and which takes long to read
    """
    if study.variants:
        own = [(one.words, map(str, warnings(one.study, False))) for one in study.variants if one.study is not None]
        return [*map(Remark, unused(study)), *once(own)]
    seen = study if text else replace(study, text="", overrides=())
    return [Remark(note) for note in (*idle_notes(seen), *doubts(seen), *locking_notes(seen.scenes))]


def asked(study: Study) -> str:
    """What a run does in place of solving points, in words; empty for a sweep."""
    if study.kind == "fit" and study.fit is not None:
        return f"fit of {', '.join(one.number.name for one in study.fit.parameters)} to {study.fit.file}"
    if study.kind == "history" and study.history is not None:
        points = f" at each of {len(study.scenes)} points" if len(study.scenes) > 1 else ""
        return f"load history, {study.history.steps} steps of {', '.join(study.history.names)}{points}"
    if study.kind == "path" and (path := study.path) is not None:
        units = f" {path.units}" if path.units != "1" else ""
        return f"path along {path.name} from {path.begin:.6g}{units} to {path.end:.6g}{units}"
    return ""


def _other_commands(study: Study) -> Iterator[str]:
    """What a run leaves alone, and what would do it."""
    if study.kind != "run":
        others = [name for name in ("history", "path") if getattr(study, name) is not None and name != study.kind]
        left = f"section {others[0]}" if others else "points of the sweep"
        yield f"{asked(study)}: run does this; for the {left} add --set {study.kind}=null"
    if study.exact is not None:
        yield "exact solution given: measure the errors against it with tcstudy converge"


LONG = 2.0
"""Lengths of elements over the height of a strip above which path and one descent may differ (configs/README.md)."""


def _long_elements(study: Study, levels: tuple[LevelForecast, ...]) -> Iterator[str]:
    """Where the mesh pushes nodes of a thin strip back; the strip's height is its area over its contact line."""
    scene = study.scenes[0]
    if study.history is None or scene.body.brep is not None:
        return
    lengths = boundary_lengths(scene.body)
    contact = sum(lengths[name] for name in scene.edges(Contact))
    ratio = contact**2 / (study.history.of(levels).n_contact * body_area(scene.body))
    if ratio > LONG:
        yield (
            f"elements on the contact line are {ratio:.2g} times as long as the body is high there: they push nodes "
            "back before the front that comes to them, so that a path and one descent may differ by some per cent; "
            "choose a smaller mesh.maxh or more levels"
        )


def expected_bytes(study: Study) -> int:
    """Rough size of the result file, for the check of free space."""
    if study.variants:
        return sum(expected_bytes(one.study) for one in study.variants if one.study is not None)
    try:
        return _bytes(study, forecast(study) or rough_sizes(study))
    except GeometryFailed:  # which is said elsewhere
        return _bytes(study, ())


def _bytes(study: Study, levels: Sequence[LevelForecast]) -> int:
    if study.history is not None:
        from tcstudy.data.history_store import history_bytes

        return history_bytes(study, study.history.of(levels).n_contact)
    return schema.expected_bytes(study, [(level.n_contact, level.nodes) for level in refined(levels, study.mesh)])


def faults(study: Study, output: Path) -> list[str]:
    """What would stop a run of this study into `output`, one line each, as the user sees it; empty if nothing would."""
    file = str(study.source) if study.source is not None else "<text>"
    try:
        found = check_writable(output, expected_bytes(study))
    except StoreError as error:
        found = [str(error)]
    return [*map(str, located(study, built_faults(study))), *(f"{file}: {text}" for text in found)]


def fault_in(study: Study, fault: UserFault, name: str) -> str:
    """What stopped a command, as the user sees it: with its place in the study, or the study's name."""
    if fault.placed:
        return str(fault)
    if fault.keys is None:
        return f"{name}: {fault}"
    what, _, remedy = str(fault).partition("; ")
    return "\n".join(map(str, located(study, [(fault.keys, what, remedy or "check the body, or try another maxh")])))
