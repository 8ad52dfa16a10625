"""Reading the changes of a scene: the sections `path` and `history`, and `output.sensitivity`.

A law that does not fit the memory, a line that changes nothing, and a load in which the condensed
load is not affine are faults, so that no history begins that cannot be computed. Results are
differentiated by those numbers that need no other factorisation (`offline.slopes`): numbers in
which the load is affine, E, nu, alpha_T or beta and k of materials, α, stiffness of springs, and
numbers of friction laws. All others are refused with a reason. So are features of the scenes that
exclude each other (`check_together`).
"""

from __future__ import annotations

import math
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from tcstudy.errors import hint
from tcstudy.laws.composed import EdgeLaws
from tcstudy.read.body import corner_faults
from tcstudy.read.document import Node
from tcstudy.read.fields import Context, Fields, none_after_fault
from tcstudy.read.scenes import SceneReader
from tcstudy.scene.fit_plan import STEP, FitPlan, Sensitivity
from tcstudy.scene.histories import MOST_STEPS, HistoryLine, HistoryPlan, Memory, UnfitLaw
from tcstudy.scene.keys import LAWS, row, rows
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
from tcstudy.scene.study import SLIP_BOUNDS, Exact, OutputPlan

NOT_AFFINE = "the load of this study is not affine in it"
NO_DERIVATIVE = "there is no derivative by"
NOT_ALONE = "of this study it is no single number that acts"
DEPENDENT_KEYS = ("parameter", "from", "to", "within", "at", "level")
"""Keys of `path` that depend on each other; every other key is a field of the plan."""


@none_after_fault
def read_path(ctx: Context, reader: SceneReader, mesh: MeshPlan | None) -> PathPlan | None:
    """Return the path of the base scene; None after a fault.

    mesh: None if the section has faults
    """
    fields = Fields(ctx, reader.root.nearest("path"), "path")
    scene = reader.base
    ctx.sound()
    word = fields.value("parameter")
    if scene is None or not word:
        return None
    keys = path_of(word)
    candidates = dict(affine_numbers(scene))
    named_number(
        ctx, fields.values["parameter"], word, candidates, "no path runs along", NOT_AFFINE
    )
    ctx.sound()
    dimension = candidates[keys].row.dimension
    begin, end = (fields.value(key, dimension) for key in ("from", "to"))
    if begin == end:
        fields.fault("to", "is the same value as from; give a range, from: A, to: B")
        return None
    low, high = min(begin, end), max(begin, end)
    # as far again on both sides: folds may lie outside the range
    within = (low - (high - low), high + (high - low))
    if fields["within"]:
        within = fields.value("within", dimension)
        if within[0] > low or within[1] < high:
            fault = "does not contain the range from … to"
            fields.fault("within", fault, "widen it, or leave it out")
    requested = fields.value("at", dimension) or ()
    _check_requested(ctx, fields, requested, within)
    values = fields.given(name for name in fields.rows if name not in DEPENDENT_KEYS)
    # a run with adaptive meshes is possible without the path
    if not (mesh and mesh.strategy.adapts):
        values |= level_of(ctx, fields, mesh, "a path")
    ctx.sound()
    for key, t in (("from", begin), ("to", end)) if keys[0] == "boundary" else ():
        conflict = next(corner_faults(scene.body, path_scene(scene, keys, t).boundary), None)
        if conflict:
            fault = f"with {'.'.join(keys)} = {t:g} {conflict[1]}"
            fields.fault(key, fault, "free a component of one of the two edges")
            break
    return PathPlan(keys, ctx.cf(dimension), begin, end, within, scene, requested, **values)


def _check_requested(
    ctx: Context, fields: Fields, requested: Sequence[float], within: tuple[float, float]
) -> None:
    """Record requested values of the parameter that are outside the range, or repeated."""
    items = fields["at"].entries if fields["at"] else ()
    for i, (item, value) in enumerate(zip(items, requested, strict=False)):
        if not math.isnan(value) and not within[0] <= value <= within[1]:
            choice = f"choose a value from {within[0]:g} to {within[1]:g}"
            remedy = f"{choice}, or widen from, to or within"
            ctx.at(item, f"{item.brief()} is outside the range of the path", remedy)
        if value in requested[:i]:
            ctx.at(item, f"the value {item.brief()} is repeated", "give every value once")


def named_number(
    ctx: Context,
    node: Node,
    word: str,
    candidates: Mapping[Keys, Number],
    refusal: str,
    reason: str,
    more_words: Iterable[str] = (),
    on_key: bool = False,
) -> Keys | None:
    """Return the key path of the known number that a word names; None after a fault.

    refusal:    first words of the fault, as "no path runs along"
    reason:     why another number of the study is refused
    more_words: that may have been meant
    """
    path = ("parameters", word) if ("parameters", word) in candidates else path_of(word)
    number = candidates.get(path)
    if number is not None and not number.no_number:
        return path
    names = [".".join(keys) for keys, n in candidates.items() if not n.no_number]
    remedy = f"name one of {', '.join((*names, *more_words))}"
    if number is not None:
        reason = number.no_number
    elif word in ctx.named:
        reason = "it may stand in any expression"
    elif path[0] in GEOMETRIC:
        reason = "it moves the mesh"
    elif path[0] == "boundary" or swept_row(path) is None:
        same = [name for name in names if name.split(".")[-1] == word]
        shorter = [short for short, full in SHORT.items() if full in names]
        reason = "unknown name"
        remedy = hint(same[0] if same else word, [*names, *shorter, *more_words], remedy)
    ctx.at(node, f"{refusal} {word}: {reason}", remedy, on_key=on_key)
    return None


def level_of(ctx: Context, fields: Fields, mesh: MeshPlan | None, task: str) -> dict[str, Any]:
    """Return the key `level` of a task on one mesh, if it is given. task: as "a path"."""
    if mesh and mesh.strategy.adapts:
        fault = "adaptive meshes follow from the solutions of a run"
        remedy = f"use family: uniform or graded for {task}, for example --set mesh.family=graded"
        ctx.at(fields.node, fault, remedy, on_key=True)
    elif node := fields["level"]:
        return {"level": ctx.integer(node, 0, mesh.levels - 1 if mesh else None)}
    return {}


@none_after_fault
def read_history(ctx: Context, reader: SceneReader, mesh: MeshPlan | None) -> HistoryPlan | None:
    """Return the history of the base scene; None after a fault."""
    root, base, scenes = reader.root, reader.base, reader.scenes
    fields = Fields(ctx, root.nearest("history"), "history")
    ctx.sound()
    if base is None:
        return None
    memory = _memory(ctx, fields, base)
    candidates = dict(affine_numbers(base))
    lines = _Lines(ctx, candidates, [axis.path for axis in reader.sweep.axes]).read(fields)
    ctx.sound()
    is_plastic = "elastic-plastic" in memory.names
    if is_plastic and memory.stiffness is None:
        fields.missing("stiffness")
    elif not is_plastic and fields["stiffness"]:
        fault = f"belongs to memory: elastic-plastic, but the study has memory: {memory.words}"
        fields.fault("stiffness", fault, "remove it, or change the memory", on_key=True)
    ctx.sound()
    try:
        for scene in distinct(scenes, "friction"):
            memory.fits(scene.friction)
    except UnfitLaw as error:
        fault, _, remedy = str(error).rpartition("; ")
        fields.fault("memory", fault, remedy)
    parameters = []
    for keys in dict.fromkeys(keys for line in lines for keys, _ in line.values):
        value = float(candidates[keys].value)  # type: ignore[arg-type]
        parameters.append((keys, ctx.cf(candidates[keys].row.dimension), value))
    options = fields.given(("repeat", "branch")) | level_of(ctx, fields, mesh, "a history")
    plan = HistoryPlan(memory, lines, tuple(parameters), **options)
    if plan.steps > MOST_STEPS:
        remedy = f"{MOST_STEPS} are possible; write fewer cycles or steps"
        fields.fault("steps", f"the history has {plan.steps} steps", remedy, on_key=True)
    return plan


def _memory(ctx: Context, fields: Fields, base: Scene) -> Memory:
    """Return the memory, or one for every contact edge."""
    names = fields.value("memory")
    stiffness = fields.value("stiffness")
    if not isinstance(names, Mapping):
        return Memory(names, stiffness)
    contact_edges = base.edges(Contact)
    for edge in names.keys() - set(contact_edges):
        item = fields.values["memory"].children[edge]
        remedy = f"use {', '.join(contact_edges)}"
        ctx.at(item, f"{edge} is no contact edge", remedy, on_key=True)
    ctx.sound()
    for edge in contact_edges:
        if edge not in names:
            fault = f"says nothing of {edge}, which is in contact, too"
            fields.fault("memory", fault, f"add {edge}: friction")
    ctx.sound()
    edges = tuple((edge, names[edge]) for edge in contact_edges)
    return Memory(edges[0][1], stiffness, edges if len(set(names.values())) > 1 else ())


class _Lines:
    """Reads the lines of a history; a line that leaves all loads as they are is a fault.

    known: the loads that a line may change;  swept: the loads that the sweep changes
    """

    def __init__(
        self, ctx: Context, candidates: Mapping[Keys, Number], swept: Collection[Keys]
    ) -> None:
        self.ctx = ctx
        self.known = candidates
        self.swept = swept
        self.loads: dict[Keys, Any] = {keys: number.value for keys, number in candidates.items()}
        self.changed = set[Keys]()
        self.has_fault = False
        """Whether a line has a fault, so that the loads after it are not known."""

    def read(self, fields: Fields) -> tuple[HistoryLine, ...]:
        """Return the lines in order."""
        lines = list[HistoryLine]()
        content = "a list of lines {theta: 60 K, in: 8, name: hot}"
        for item in self.ctx.items(fields.values["steps"], content, 1):
            if not isinstance(item.value, Mapping):
                fault = f"must be a mapping, but is {item.kind()}"
                self.ctx.at(item, fault, "write {theta: 60 K, in: 8, name: hot}")
            elif line := self._line(item):
                lines.append(line)
        factored = (keys for keys in self.loads if keys in self.changed and keys[-1] in FACTORED)
        load = next(factored, None)
        if ("load",) in self.changed and load is not None:
            fault = f"load is a factor of all mechanical loads, and {'.'.join(load)} is one of them"
            fields.fault("steps", fault, "change one of the two", on_key=True)
        return tuple(lines)

    def _line(self, item: Node) -> HistoryLine | None:
        """Return a line; None after a fault that leaves its loads unknown."""
        ctx = self.ctx
        fault_count = len(ctx.errors)
        options = dict[str, Any]()
        load_nodes = dict[str, Node]()
        for word, node in item.children.items():
            if word in rows("step"):
                options[word] = ctx.value(node, rows("step")[word])
            else:
                load_nodes[word] = node
        paths = {word: self._load(word, node) for word, node in load_nodes.items()}
        values = dict[Keys, float]()
        for word, keys in paths.items():
            if keys is not None:
                values[keys] = ctx.quantity(load_nodes[word], self.known[keys].row.dimension)
        if len(ctx.errors) == fault_count and not values:
            remedy = "write for example {theta: 60 K, in: 8}"
            ctx.at(item, "changes nothing: no load is named", remedy)
        if len(ctx.errors) > fault_count:
            self.has_fault = True
            return None
        is_unchanged = all(self.loads[keys] == value for keys, value in values.items())
        if is_unchanged and not self.has_fault:
            fault = "changes nothing: the loads are there already"
            ctx.at(item, fault, "give one of them another value, or remove the line")
        self.loads |= values
        self.changed |= values.keys()
        words = ", ".join(f"{word} {node.brief()}" for word, node in load_nodes.items())
        return HistoryLine(tuple(values.items()), options.get("in", 1), options.get("name", words))

    def _load(self, word: str, node: Node) -> Keys | None:
        """Return the load that a key of a line names; None after a fault."""
        refusal = "no history changes"
        more_words = rows("step")
        keys = named_number(
            self.ctx, node, word, self.known, refusal, NOT_AFFINE, more_words, on_key=True
        )
        if keys in self.swept:
            remedy = "sweep something else, or leave it out of the steps"
            self.ctx.at(node, "is swept, too", remedy, on_key=True)
        return keys


def check_fit(ctx: Context, fields: Fields, plan: FitPlan, history: HistoryPlan) -> None:
    """Record what excludes a fit at the steps of a history."""
    if plan.compare == "orthogonal":
        fault = "distances to a path are of one monotone load, but the study has a history"
        fields.fault("compare", fault, "use compare: vertical")
    steps = [value for column in plan.given if column.path == STEP for value in column.values]
    impossible = [step for step in steps if step != int(step) or not 0 <= step <= history.steps]
    if not steps:
        meaning = "the number of the step at every line, 0 for the study as it is written"
        fault = "a fit of a history needs a column step"
        fields.fault("data", fault, f'add {{step: "step"}}, {meaning}')
    elif impossible:
        remedy = f"steps are 0 for the study as it is written, then 1 to {history.steps}"
        fields.fault("data", f"the history has no step {impossible[0]:g}", remedy)
    fitted = [parameter.number for parameter in plan.parameters]
    check_numbers(ctx, fields.values["parameters"], fitted, history)


def check_numbers(
    ctx: Context, node: Node, numbers: Iterable[Sensitivity], history: HistoryPlan
) -> None:
    """Record numbers to differentiate by that are loads which the history changes."""
    changed = {keys for keys, *_ in history.parameters}
    for number in numbers:
        if number.path in changed or (("load",) in changed and number.path[-1] in FACTORED):
            ctx.at(node, f"{number.name} is what the history changes, so it is known", "remove it")
        elif number.path == ("load",) and any(keys[-1] in FACTORED for keys in changed):
            ctx.at(node, "load is a factor of loads that the history changes", "remove it")


def read_sensitivity(
    ctx: Context, node: Node, reader: SceneReader, exact: Exact | None, history: HistoryPlan | None
) -> tuple[Sensitivity, ...]:
    """Return the numbers by which to differentiate, which are given by name or key path.

    exact: the solution, whose derived loads would change with the number
    """
    root, base, scenes = reader.root, reader.base, reader.scenes
    if base is None:
        return ()
    if exact is not None and exact.derived:
        fault = "the loads are derived from the exact solution and would change with the number"
        ctx.at(node, fault, "give the loads, or remove sensitivity")
        return ()
    candidates = differentiable(root, base, scenes)
    sensitivities: dict[Keys, Sensitivity] = {}
    for item in node.entries:
        word = ctx.text(item, "the name of a number")
        path = path_of(word)
        if path in sensitivities:
            ctx.at(item, f"{word} is given twice", "give every number once")
        elif word and (keys := named_number(ctx, item, word, candidates, NO_DERIVATIVE, NOT_ALONE)):
            sensitivities[path] = Sensitivity(word, keys, ctx.cf(candidates[keys].row.dimension))
            # a corner may share the displacement with another edge
            if path[0] == "boundary" and path[-1].startswith("u_"):
                t = 1.0 + 2.0 * abs(float(candidates[path].value))  # type: ignore[arg-type]
                moved = path_scene(base, path, t)
                if conflict := next(corner_faults(base.body, moved.boundary), None):
                    fault = f"{'.'.join(path)} cannot change alone: {conflict[1]}"
                    ctx.at(item, fault, "free a component of one of the two edges")
    if history is not None:
        check_numbers(ctx, node, sensitivities.values(), history)
    return tuple(sensitivities.values())


def differentiable(root: Node, base: Scene, scenes: Sequence[Scene]) -> dict[Keys, Number]:
    """Return the numbers of a study by which results may be differentiated.

    Some of them have a reason why there is no derivative. Numbers of materials are those that the
    study gives, numbers of laws those of all scenes.
    """
    by_path = dict[Keys, Number]()
    for path, number in numbers(base):
        is_given = not path[0].startswith("material") or root.at(*path)
        if path[0] not in LAWS and is_given:
            by_path[path] = number
    for scene in distinct(scenes, *LAWS):
        by_path |= {path: number for path, number in numbers(scene) if path[0] in LAWS}
    if root.at("history", "stiffness"):
        by_path["history", "stiffness"] = Number(row("history", "stiffness"), 0.0)
    return by_path


def check_together(
    ctx: Context,
    reader: SceneReader,
    mesh: MeshPlan | None,
    solver: SolverPlan | None,
    output: OutputPlan | None,
    exact: Exact | None,
) -> None:
    """Record requests of a study that exclude each other.

    mesh, solver, output, exact: None if the study does not have it, or it has faults
    """
    root = reader.root
    features = _features(root, reader.scenes, bool(exact and exact.derived))
    for feature in features:
        if output and output.live:
            fault = f"{feature.words}, and a live page takes {feature.on_page}"
            ctx.at(root.nearest("output"), fault, "remove live: true")
        if exact and feature.conflict:
            ctx.at(root.nearest("exact"), f"{feature.words}, and {feature.conflict}")
    if root.at("history"):
        _check_history_requests(ctx, root, mesh, solver, output, exact)
    needs_bounds = output is not None and SLIP_BOUNDS in output.quantities
    if needs_bounds and mesh is not None and not mesh.bounds_errors:
        fault = f"{SLIP_BOUNDS} follow from bounds of the error"
        ctx.at(root.nearest("output", "quantities"), fault, "add guarantee: true to mesh")
    for key in (key for key in ("path", "history", "fit") if root.at(key)):
        fault = f"is of single points, not of a {key}"
        if mesh and mesh.bounds_errors:
            remedy = "remove it; for bounds at single values write a sweep of them"
            ctx.at(root.nearest("mesh", "guarantee"), f"{fault}: {UNBOUNDED[key]}", remedy)
        if solver and solver.every and key != "history":
            remedy = "write path.complete: true" if key == "path" else "remove it"
            ctx.at(root.nearest("solver", "branch"), fault, remedy)


UNBOUNDED = {
    "path": "it passes equilibria where one solution is not proved, and no error is bounded there",
    "history": "a step depends on slips of earlier steps, whose errors are not bounded",
    "fit": "the fitted law depends on errors of all its points",
}
"""Why no error is bounded, by section."""


@dataclass(frozen=True)
class _Feature:
    """A feature of the scenes that a live page and an exact solution exclude.

    on_page:  what a live page takes in its place
    conflict: why an exact solution excludes it, and the remedy; empty if it does not
    """

    words: str
    on_page: str
    conflict: str


def _features(root: Node, scenes: Sequence[Scene], has_derived_loads: bool) -> Iterator[_Feature]:
    """Yield the features of the scenes that a live page and an exact solution may exclude."""
    roles = dict(scenes[0].boundary).values() if scenes else ()
    no_edge = "an exact solution has no such edge; remove exact"
    if any(isinstance(scene.friction, EdgeLaws) for scene in distinct(scenes, "friction")):
        yield _Feature("friction differs along the contact line", "one law", "")
    if root.at("materials"):
        words = "materials differ by region, where stresses jump"
        conflict = "an exact solution takes one material; remove exact, or write one material"
        yield _Feature(words, "one material", conflict)
    if any(isinstance(role, Rigid) for role in roles):
        yield _Feature("an edge is rigid", "none", no_edge)
    if any(scene.springs for scene in distinct(scenes, "boundary")):
        yield _Feature("an edge has springs", "none", no_edge)
    if any(role.heat is not None for role in roles):
        conflict = ""
        if has_derived_loads:
            conflict = "loads are derived for the section heat only"
            conflict = f"{conflict}; give the loads, or loads: given"
        yield _Feature("an edge has heat of its own", "one alpha and one theta_bar", conflict)


def _check_history_requests(
    ctx: Context,
    root: Node,
    mesh: MeshPlan | None,
    solver: SolverPlan | None,
    output: OutputPlan | None,
    exact: Exact | None,
) -> None:
    """Record requests of a study that a history does not take."""
    if exact:
        fault = "an exact solution is of one scene without a past, not of a history"
        ctx.at(root.nearest("exact"), fault, "remove one of them", on_key=True)
    if mesh and mesh.estimates and not mesh.strategy.adapts:
        remedy = "remove estimate and tolerance, and compare meshes of your own"
        fault = "errors are not estimated in a history"
        ctx.at(root.nearest("mesh"), fault, remedy, on_key=True)
    for key in ("fields", "live"):
        if output and getattr(output, key):
            node = root.nearest("output", key)
            ctx.at(node, "is not kept of a history", "remove it", on_key=True)
    if solver and not solver.in_blocks:
        fault = f"a history is solved by {SEPARABLE}"
        ctx.at(root.nearest("solver", "name"), fault, "name no other", on_key=True)
    if root.at("solver", "branch"):
        remedy = "write history.branch: continued or lowest"
        ctx.at(root.nearest("solver", "branch"), "is of single points", remedy, on_key=True)
