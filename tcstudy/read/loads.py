"""Reads what changes of a scene: the sections `path` and `history`, the numbers of
`output.sensitivity`.

Laws that a memory cannot be made of, lines that change nothing, and loads in which the condensed
load is not affine are faults here, so that no history begins that cannot be computed. Numbers by
which results are differentiated exactly are those for which that takes no other factorisation
(`offline.slopes`): numbers in which the load is affine, of materials E, nu, alpha_T or beta and k,
α, stiffness of springs, and the numbers of friction laws. Everything else is refused with its
reason, as is what theory or code does not have for a feature of the scenes (`check_together`).
"""

from __future__ import annotations

import math
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import replace
from typing import Any

from tcstudy.errors import hint
from tcstudy.laws.composed import EdgeLaws
from tcstudy.read.body import corner_faults, supports_fault
from tcstudy.read.document import Node
from tcstudy.read.fields import Context, Fields, none_after_fault
from tcstudy.read.scenes import SceneReader
from tcstudy.scene.fit_plan import STEP, FitPlan, Sensitivity
from tcstudy.scene.histories import MOST_STEPS, HistoryLine, HistoryPlan, Memory, UnfitLaw
from tcstudy.scene.keys import row, rows
from tcstudy.scene.mesh_plan import MeshPlan
from tcstudy.scene.parameters import (
    FACTORED,
    SHORT,
    Keys,
    Number,
    affine_numbers,
    numbers,
    path_of,
    path_scene,
    swept_row,
)
from tcstudy.scene.path_plan import PathPlan
from tcstudy.scene.points import GEOMETRIC, distinct
from tcstudy.scene.records import Contact, Rigid, Scene
from tcstudy.scene.solver_plan import SEPARABLE, SolverPlan
from tcstudy.scene.study import Exact, OutputPlan

NOT_AFFINE = "the load of this study is not affine in it"
NO_DERIVATIVE, NOT_ALONE = (
    "there is no derivative by",
    "of this study it is no single number that acts",
)
OF_PATH = ("parameter", "from", "to", "within", "at", "level")
"""Keys that depend on each other; every other one of `path` is a field of the plan."""


@none_after_fault
def read_path(ctx: Context, reader: SceneReader, mesh: MeshPlan | None) -> PathPlan | None:
    """The path of the scene without the sweep; None after a fault. mesh: None if it has faults of
    its own"""
    fields, scene = Fields(ctx, reader.root.nearest("path"), "path"), reader.base
    ctx.sound()
    word = fields.value("parameter")
    if scene is None or not word:
        return None
    keys, known = path_of(word), dict(affine_numbers(scene))
    named_number(ctx, fields.values["parameter"], word, known, "no path runs along", NOT_AFFINE)
    ctx.sound()
    dimension = known[keys].row.dimension
    begin, end = (fields.value(key, dimension) for key in ("from", "to"))
    if begin == end:
        fields.fault("to", "is the same value as from; give a range, from: A, to: B")
        return None
    low, high = min(begin, end), max(begin, end)
    within = (
        low - (high - low),
        high + (high - low),
    )  # as far again on both sides: folds may lie outside the range
    if fields["within"]:
        within = fields.value("within", dimension)
        if within[0] > low or within[1] < high:
            fields.fault(
                "within", "does not contain the range from … to; widen it, or leave it out"
            )
    at = fields.value("at", dimension) or ()
    for i, (item, value) in enumerate(
        zip(fields["at"].entries if fields["at"] else (), at, strict=False)
    ):
        if not math.isnan(value) and not within[0] <= value <= within[1]:
            remedy = (
                f"choose a value from {within[0]:g} to {within[1]:g}, or widen from, to or within"
            )
            ctx.at(item, f"{item.brief()} is outside the range of the path", remedy)
        if value in at[:i]:
            ctx.at(item, f"the value {item.brief()} is repeated", "give every value once")
    given = fields.given(name for name in fields.rows if name not in OF_PATH)
    level = (
        {} if mesh and mesh.strategy.adapts else level_of(ctx, fields, mesh, "a path")
    )  # a run needs no path
    ctx.sound()
    for key, t in (("from", begin), ("to", end)) if keys[0] == "boundary" else ():
        fault = next(corner_faults(scene.body, path_scene(scene, keys, t).boundary), None)
        if fault:
            what = f"with {'.'.join(keys)} = {t:g} {fault[1]}"
            fields.fault(key, what, "free a component of one of the two edges")
            break
    return PathPlan(keys, ctx.cf(dimension), begin, end, within, scene, at, **given, **level)


def named_number(
    ctx: Context, node: Node, word: str, known: Mapping[Keys, Number], none: str, why: str, more: Iterable[str] = (),
    on_key: bool = False
) -> Keys | None:  # fmt: skip
    """The key path of the number, of those known, that a word names; None after a fault.

    none: what another number is not good for, "no path runs along";  why: of one that the study may have
    more: other words that may have been meant
    """
    path = ("parameters", word) if ("parameters", word) in known else path_of(word)
    one, names = (
        known.get(path),
        [".".join(keys) for keys, other in known.items() if not other.no_number],
    )
    if one is not None and not one.no_number:
        return path
    remedy = f"name one of {', '.join((*names, *more))}"
    if one is not None:
        why = one.no_number
    elif word in ctx.named:
        why = "it may stand in any expression"
    elif path[0] in GEOMETRIC:
        why = "it moves the mesh"
    elif path[0] == "boundary" or swept_row(path) is None:
        same = [name for name in names if name.split(".")[-1] == word]
        shorter = [short for short, full in SHORT.items() if full in names]
        why, words = "it is none that is known here", [*names, *shorter, *more]
        remedy = hint(same[0] if same else word, words, remedy)
    ctx.at(node, f"{none} {word}: {why}", remedy, on_key=on_key)
    return None


def level_of(ctx: Context, fields: Fields, mesh: MeshPlan | None, what: str) -> dict[str, Any]:
    """The key `level` of what is done on one mesh, if it is given; what: "a path"."""
    if mesh and mesh.strategy.adapts:
        remedy = f"use family: uniform or graded for {what}, for example --set mesh.family=graded"
        ctx.at(
            fields.node, "adaptive meshes follow from the solutions of a run", remedy, on_key=True
        )
    elif node := fields["level"]:
        return {"level": ctx.integer(node, 0, mesh.levels - 1 if mesh else None)}
    return {}


@none_after_fault
def read_history(ctx: Context, reader: SceneReader, mesh: MeshPlan | None) -> HistoryPlan | None:
    """The history of the scene without the sweep; None after a fault."""
    root, base, scenes = reader.root, reader.base, reader.scenes
    fields = Fields(ctx, root.nearest("history"), "history")
    ctx.sound()
    if base is None:
        return None
    memory = _memory(ctx, fields, base)
    known = dict(affine_numbers(base))
    lines = _lines(ctx, fields, known, [axis.path for axis in reader.sweep.axes])
    ctx.sound()
    if "elastic-plastic" in memory.names and memory.stiffness is None:
        fields.missing("stiffness")
    elif "elastic-plastic" not in memory.names and fields["stiffness"]:
        what = f"belongs to memory: elastic-plastic, but the study has memory: {memory.words}"
        fields.fault("stiffness", what, "remove it, or change the memory", on_key=True)
    ctx.sound()
    try:
        for scene in distinct(scenes, "friction"):
            memory.fits(scene.friction)
    except UnfitLaw as error:
        what, _, remedy = str(error).rpartition("; ")
        fields.fault("memory", what, remedy)
    used = dict.fromkeys(keys for line in lines for keys, _ in line.values)
    parameters = tuple(
        (keys, ctx.cf(known[keys].row.dimension), float(known[keys].value))  # type: ignore[arg-type]
        for keys in used
    )
    options = fields.given(("repeat", "branch")) | level_of(ctx, fields, mesh, "a history")
    plan = HistoryPlan(memory, lines, parameters, **options)
    if plan.steps > MOST_STEPS:
        remedy = f"{MOST_STEPS} are possible; write fewer cycles or steps"
        fields.fault("steps", f"the history has {plan.steps} steps", remedy, on_key=True)
    return replace(
        plan, loose=any(supports_fault(s.body, s.boundary) for s in distinct(scenes, "boundary"))
    )


def _memory(ctx: Context, fields: Fields, base: Scene) -> Memory:
    """The memory, or one for every contact edge, of which none may be left out."""
    given, stiffness, own = fields.value("memory"), fields.value("stiffness"), base.edges(Contact)
    if not isinstance(given, Mapping):
        return Memory(given, stiffness)
    for edge in given.keys() - set(own):
        what, remedy = f"{edge} is no contact edge", f"use {', '.join(own)}"
        ctx.at(fields.values["memory"].children[edge], what, remedy, on_key=True)
    ctx.sound()
    for edge in own:
        if edge not in given:
            fields.fault(
                "memory",
                f"says nothing of {edge}, which is in contact, too",
                f"add {edge}: friction",
            )
    ctx.sound()
    edges = tuple((edge, given[edge]) for edge in own)
    return Memory(edges[0][1], stiffness, edges if len(set(given.values())) > 1 else ())


def _lines(
    ctx: Context, fields: Fields, known: Mapping[Keys, Number], swept: Collection[Keys]
) -> tuple[HistoryLine, ...]:
    """The lines in order; one that leaves all loads as they are is a fault."""
    now: dict[Keys, Any] = {keys: one.value for keys, one in known.items()}
    own, found, changed, told = rows("step"), [], set[Keys](), False
    for item in ctx.items(
        fields.values["steps"], "a list of lines {theta: 60 K, in: 8, name: hot}", 1
    ):
        if not isinstance(item.value, Mapping):
            ctx.at(
                item,
                f"must be a mapping, but is {item.kind()}",
                "write {theta: 60 K, in: 8, name: hot}",
            )
            continue
        before = len(ctx.errors)
        given = {
            word: ctx.value(node, own[word]) for word, node in item.value.items() if word in own
        }
        loads = {word: node for word, node in item.value.items() if word not in own}
        named = {word: _load(ctx, word, node, known, swept) for word, node in loads.items()}
        values = {
            k: ctx.quantity(loads[word], known[k].row.dimension)
            for word, k in named.items()
            if k is not None
        }
        if len(ctx.errors) == before and not values:
            ctx.at(
                item, "changes nothing: no load is named", "write for example {theta: 60 K, in: 8}"
            )
        if len(ctx.errors) > before:
            told = True  # what the loads are is no longer known
            continue
        if not told and all(now[keys] == value for keys, value in values.items()):
            what = "changes nothing: the loads are there already"
            ctx.at(item, what, "give one of them another value, or remove the line")
        now |= values
        changed |= values.keys()
        words = ", ".join(f"{word} {node.brief()}" for word, node in loads.items())
        found.append(
            HistoryLine(tuple(values.items()), given.get("in", 1), given.get("name", words))
        )
    if ("load",) in changed and (
        other := next((keys for keys in now if keys in changed and keys[-1] in FACTORED), None)
    ):
        what = f"load is a factor of all mechanical loads, and {'.'.join(other)} is one of them"
        fields.fault("steps", what, "change one of the two", on_key=True)
    return tuple(found)


def _load(
    ctx: Context, word: str, node: Node, known: Mapping[Keys, Number], swept: Collection[Keys]
) -> Keys | None:
    """The load that a key of a line names; None after a fault."""
    keys = named_number(
        ctx, node, word, known, "no history changes", NOT_AFFINE, rows("step"), on_key=True
    )
    if keys in swept:
        ctx.at(
            node, "is swept, too; sweep something else, or leave it out of the steps", on_key=True
        )
    return keys


def check_fit(ctx: Context, fields: Fields, plan: FitPlan, history: HistoryPlan) -> None:
    """What a fit at the steps of a history needs and does not take."""
    if plan.compare == "orthogonal":
        said = "distances to a path are of one monotone load, but the study has a history; use compare: vertical"
        fields.fault("compare", said)
    steps = [value for column in plan.given if column.path == STEP for value in column.values]
    if not steps:
        remedy = 'add {step: "step"}, the number of the step at every line, 0 for the study as it is written'
        fields.fault("data", "a fit of a history needs a column step", remedy)
    elif wrong := [
        value for value in steps if value != int(value) or not 0 <= value <= history.steps
    ]:
        remedy = f"steps are 0 for the study as it is written, then 1 to {history.steps}"
        fields.fault("data", f"the history has no step {wrong[0]:g}", remedy)
    check_numbers(
        ctx, fields.values["parameters"], [one.number for one in plan.parameters], history
    )


def check_numbers(
    ctx: Context, node: Node, numbers: Iterable[Sensitivity], history: HistoryPlan
) -> None:
    """Numbers to differentiate by must not be loads that the history changes."""
    changed = {keys for keys, *_ in history.parameters}
    for number in numbers:
        if number.path in changed or (("load",) in changed and number.path[-1] in FACTORED):
            ctx.at(node, f"{number.name} is what the history changes, so it is known", "remove it")
        elif number.path == ("load",) and any(keys[-1] in FACTORED for keys in changed):
            ctx.at(node, "load is a factor of loads that the history changes", "remove it")


def read_sensitivity(
    ctx: Context, node: Node, reader: SceneReader, exact: Exact | None, history: HistoryPlan | None
) -> tuple[Sensitivity, ...]:
    """The numbers by name or key path, each once. exact: the solution, whose derived loads would
    have to follow"""
    root, base, scenes = reader.root, reader.base, reader.scenes
    if base is None:
        return ()
    if exact is not None and exact.derived:
        what = "the loads are derived from the exact solution and would change with the number"
        ctx.at(node, what, "give the loads, or remove sensitivity")
        return ()
    known = differentiable(root, base, scenes)
    found: dict[Keys, Sensitivity] = {}
    for item in node.entries:
        word = ctx.text(item, "the name of a number")
        if (path := path_of(word)) in found:
            ctx.at(item, f"{word} is given twice", "give every number once")
        elif word and (named := named_number(ctx, item, word, known, NO_DERIVATIVE, NOT_ALONE)):
            found[path] = Sensitivity(word, named, ctx.cf(known[named].row.dimension))
            if path[0] == "boundary" and path[-1].startswith(
                "u_"
            ):  # which a corner may share with another edge
                moved = path_scene(base, path, 1.0 + 2.0 * abs(float(known[path].value)))  # type: ignore[arg-type]
                if fault := next(corner_faults(base.body, moved.boundary), None):
                    remedy = "free a component of one of the two edges"
                    ctx.at(item, f"{'.'.join(path)} cannot change alone: {fault[1]}", remedy)
    if history is not None:
        check_numbers(ctx, node, found.values(), history)
    return tuple(found.values())


def differentiable(root: Node, base: Scene, scenes: Sequence[Scene]) -> dict[Keys, Number]:
    """The numbers by which results can be differentiated, and those that have a reason why not; of
    materials those that the study gives, of laws those of all scenes."""
    found = {path: one for path, one in numbers(base) if path[0] != "friction"}
    found = {
        path: one for path, one in found.items() if path[0][:8] != "material" or root.at(*path)
    }
    for scene in distinct(scenes, "friction"):
        found |= {path: one for path, one in numbers(scene) if path[0] == "friction"}
    if root.at("history", "stiffness"):
        found["history", "stiffness"] = Number(row("history", "stiffness"), 0.0)
    return found


def check_together(
    ctx: Context, reader: SceneReader, mesh: MeshPlan | None, solver: SolverPlan | None, output: OutputPlan | None,
    exact: Exact | None
) -> None:  # fmt: skip
    """Report what a feature of the scenes, a path, a history or a fit excludes and the study asks
    for.

    mesh … exact: what it asks for beside its scenes; None for what it does not, or has faults in
    """
    root, scenes = reader.root, reader.scenes
    roles = dict(scenes[0].boundary).values() if scenes else ()
    laws = any(isinstance(scene.friction, EdgeLaws) for scene in distinct(scenes, "friction"))
    springs = any(scene.springs for scene in distinct(scenes, "boundary"))
    own, no_edge = (
        any(role.heat is not None for role in roles),
        "an exact solution has no such edge; remove exact",
    )
    one = "an exact solution takes one material; remove exact, or write one material"
    derived = "loads are derived for the section heat only; give the loads, or loads: given"
    for (
        has,
        feature,
        page,
        why,
    ) in (  # what a live page takes in its place, why an exact solution has it not
        (laws, "friction differs along the contact line", "one law", ""),
        (
            root.at("materials"),
            "materials differ by region, where stresses jump",
            "one material",
            one,
        ),
        (any(isinstance(role, Rigid) for role in roles), "an edge is rigid", "none", no_edge),
        (springs, "an edge rests on springs", "none", no_edge),
        (
            own,
            "an edge has heat of its own",
            "one alpha and one theta_bar",
            derived if exact and exact.derived else "",
        ),
    ):
        if has and output and output.live:
            ctx.at(
                root.nearest("output"),
                f"{feature}, and a live page takes {page}; remove live: true",
            )
        if has and exact and why:
            ctx.at(root.nearest("exact"), f"{feature}, and {why}")
    kept, branch = "is not kept of a history; remove it", root.at("solver", "branch")
    errors = "errors are not estimated in a history; remove estimate and tolerance, and compare meshes of your own"
    asked: tuple[tuple[object, tuple[str, ...], str], ...] = (
        (
            exact,
            ("exact",),
            "an exact solution is of one scene without a past, not of a history; remove one of them",
        ),
        (mesh and mesh.estimates and not mesh.strategy.adapts, ("mesh",), errors),
        (output and output.fields, ("output", "fields"), kept),
        (output and output.live, ("output", "live"), kept),
        (
            solver and not solver.in_blocks,
            ("solver", "name"),
            f"a history is solved by {SEPARABLE}; name no other",
        ),
        (
            branch,
            ("solver", "branch"),
            "is of single points; write history.branch: continued or lowest",
        ),
    )
    for asks, keys, said in asked if root.at("history") else ():
        if asks:
            ctx.at(root.nearest(*keys), said, on_key=True)
    for key in (key for key in ("path", "history", "fit") if root.at(key)):
        if mesh and mesh.guarantee:
            ctx.at(
                root.nearest("mesh", "guarantee"), f"is of single points, not of a {key}; remove it"
            )
        if solver and solver.every and key != "history":
            remedy = "write path.complete: true" if key == "path" else "remove it"
            ctx.at(root.nearest("solver", "branch"), f"is of single points, not of a {key}", remedy)
