"""Reads the section `history`: which loads change, line by line, and what the contact line remembers.

Laws that a memory cannot be made of, lines that change nothing, and loads in which the condensed load is not affine are
faults here, so that no history begins that cannot be computed.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import replace
from typing import Any

from tcstudy.read.checks import supports_fault
from tcstudy.read.fields import Context, Fields, none_after_fault
from tcstudy.read.node import Node
from tcstudy.read.plans import level_of, meant_number, no_single_load
from tcstudy.read.sweep import Sweep
from tcstudy.scene.histories import MOST_STEPS, HistoryLine, HistoryPlan, Keys, Memory, UnfitLaw
from tcstudy.scene.keys import rows
from tcstudy.scene.parameters import FACTORED, Number, affine_numbers, path_of
from tcstudy.scene.points import distinct
from tcstudy.scene.records import Contact, Scene
from tcstudy.scene.study import SEPARABLE, STEP, FitPlan, MeshPlan, Sensitivity


@none_after_fault
def read_history(
    ctx: Context,
    node: Node,
    root: Node,
    base: Scene | None,
    scenes: Sequence[Scene],
    mesh: MeshPlan | None,
    sweep: Sweep,
) -> HistoryPlan | None:
    """The history; None after a fault.

    base: the scene without the sweep, None if it has faults of its own;  scenes: of the sweep
    """
    swept = [axis.parameter.path for axis in sweep.axes]
    fields = Fields(ctx, node, "history")
    ctx.sound()
    if base is None:
        return None
    memory = _memory(ctx, fields, base)
    known = dict(affine_numbers(base))
    lines = _lines(ctx, fields, known, swept)
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
    _refuse(ctx, root, mesh)
    used = dict.fromkeys(keys for line in lines for keys, _ in line.values)
    parameters = tuple((keys, ctx.cf(known[keys].row.dimension), float(known[keys].value)) for keys in used)  # type: ignore[arg-type]
    options = fields.given(("repeat", "branch")) | level_of(ctx, fields, mesh, "a history")
    plan = HistoryPlan(memory, lines, parameters, **options)
    if plan.steps > MOST_STEPS:
        remedy = f"{MOST_STEPS} are possible; write fewer cycles or steps"
        fields.fault("steps", f"the history has {plan.steps} steps", remedy, on_key=True)
    return replace(plan, loose=any(supports_fault(s.body, s.boundary) for s in distinct(scenes, "boundary")))


def _memory(ctx: Context, fields: Fields, base: Scene) -> Memory:
    """The memory, or one for every contact edge, of which none may be left out."""
    given, stiffness, own = fields.value("memory"), fields.value("stiffness"), base.edges(Contact)
    if not isinstance(given, Mapping):
        return Memory(given, stiffness)
    for edge in given.keys() - set(own):
        what, remedy = f"{edge} is no contact edge", f"use {', '.join(own)}"
        ctx.errors.at(fields.values["memory"].children[edge], what, remedy, on_key=True)
    ctx.sound()
    for edge in own:
        if edge not in given:
            fields.fault("memory", f"says nothing of {edge}, which is in contact, too", f"add {edge}: friction")
    ctx.sound()
    edges = tuple((edge, given[edge]) for edge in own)
    return Memory(edges[0][1], stiffness, edges if len(set(given.values())) > 1 else ())


def _lines(
    ctx: Context, fields: Fields, known: Mapping[Keys, Number], swept: Collection[Keys]
) -> tuple[HistoryLine, ...]:
    """The lines in order; one that leaves all loads as they are is a fault."""
    now: dict[Keys, Any] = {keys: one.value for keys, one in known.items()}
    own, found, changed, told = rows("step"), [], set[Keys](), False
    for item in ctx.items(fields.values["steps"], "a list of lines {theta: 60 K, in: 8, name: hot}", 1):
        if not isinstance(item.value, Mapping):
            ctx.errors.at(item, f"must be a mapping, but is {item.kind()}", "write {theta: 60 K, in: 8, name: hot}")
            continue
        before = len(ctx.errors)
        given = {word: ctx.value(node, own[word]) for word, node in item.value.items() if word in own}
        loads = {word: node for word, node in item.value.items() if word not in own}
        named = {word: _load(ctx, word, node, known, swept) for word, node in loads.items()}
        values = {k: ctx.quantity(loads[word], known[k].row.dimension) for word, k in named.items() if k is not None}
        if len(ctx.errors) == before and not values:
            ctx.errors.at(item, "changes nothing: no load is named", "write for example {theta: 60 K, in: 8}")
        if len(ctx.errors) > before:
            told = True  # what the loads are is no longer known
            continue
        if not told and all(now[keys] == value for keys, value in values.items()):
            what = "changes nothing: the loads are there already"
            ctx.errors.at(item, what, "give one of them another value, or remove the line")
        now |= values
        changed |= values.keys()
        words = ", ".join(f"{word} {node.brief()}" for word, node in loads.items())
        found.append(HistoryLine(tuple(values.items()), given.get("in", 1), given.get("name", words)))
    if ("load",) in changed and (
        other := next((keys for keys in now if keys in changed and keys[-1] in FACTORED), None)
    ):
        what = f"load is a factor of all mechanical loads, and {'.'.join(other)} is one of them"
        fields.fault("steps", what, "change one of the two", on_key=True)
    return tuple(found)


def _load(ctx: Context, word: str, node: Node, known: Mapping[Keys, Number], swept: Collection[Keys]) -> Keys | None:
    """The load that a key of a line names; None after a fault."""
    keys = path_of(word)
    if keys not in known:
        remedy = meant_number(word, known, "use one of", rows("step"))
        said = f"is no load of this study that a history may change; {remedy}"
    elif not (said := no_single_load(keys, known[keys], "in a history")) and keys in swept:
        said = "is swept, too; sweep something else, or leave it out of the steps"
    if said:
        ctx.errors.at(node, said, on_key=True)
    return None if said else keys


def _refuse(ctx: Context, root: Node, mesh: MeshPlan | None) -> None:
    """What a history does not do."""
    solver = root.at("solver", "name") or root.child("solver")
    named = solver is not None and not isinstance(solver.value, Mapping) and solver.value != SEPARABLE
    errors = bool(mesh and mesh.estimates and not mesh.strategy.adapts)
    past = "an exact solution is of one scene without a past, and the study has a history; remove one of them"
    estimates = (
        "errors are not estimated in a history; remove estimate and tolerance, and compare histories on meshes of "
    )
    asked = {
        ("exact",): past,
        ("mesh",): estimates + "your own" if errors else "",
        ("output", "fields"): "is not kept of a history; remove it",
        ("output", "live"): "is not kept of a history; remove it",
        ("solver", "name"): f"a history is solved by {SEPARABLE} alone; write solver: {SEPARABLE}" if named else "",
        ("solver", "branch"): "is of single points; write history.branch: continued or lowest",
    }
    for keys, said in asked.items():
        node = solver if keys == ("solver", "name") else root.at(*keys)
        if said and node and node.value is not False:
            ctx.errors.at(node, said, on_key=True)


def check_fit(ctx: Context, fields: Fields, plan: FitPlan, history: HistoryPlan) -> None:
    """What a fit at the steps of a history needs and does not take."""
    if plan.compare == "orthogonal":
        said = "distances to a path are of one monotone load, but the study has a history; use compare: vertical"
        fields.fault("compare", said)
    steps = [value for column in plan.given if column.path == STEP for value in column.values]
    if not steps:
        remedy = 'add {step: "step"}, the number of the step at every line, 0 for the study as it is written'
        fields.fault("data", "a fit of a history needs a column step", remedy)
    elif wrong := [value for value in steps if value != int(value) or not 0 <= value <= history.steps]:
        remedy = f"steps are 0 for the study as it is written, then 1 to {history.steps}"
        fields.fault("data", f"the history has no step {wrong[0]:g}", remedy)
    check_numbers(ctx, fields.values["parameters"], [one.number for one in plan.parameters], history)


def check_numbers(ctx: Context, node: Node, numbers: Iterable[Sensitivity], history: HistoryPlan) -> None:
    """Numbers to differentiate by must not be loads that the history changes."""
    changed = {keys for keys, *_ in history.parameters}
    for number in numbers:
        if number.path in changed or (("load",) in changed and number.path[-1] in FACTORED):
            ctx.errors.at(node, f"{number.name} is what the history changes, so it is known", "remove it")
        elif number.path == ("load",) and any(keys[-1] in FACTORED for keys in changed):
            ctx.errors.at(node, "load is a factor of loads that the history changes", "remove it")
