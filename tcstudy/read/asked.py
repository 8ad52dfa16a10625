"""Reads by which numbers results are differentiated, and says what does not go together with the rest of a study.

`output.sensitivity`: the numbers by which results are differentiated exactly, which are those for which that takes no
other factorisation (`offline.slopes`): numbers in which the load is affine, of materials E, nu, alpha_T or beta and k,
α, stiffness of springs, and the numbers of friction laws. Everything else is refused with its reason.

What theory or code does not have for a feature of the scenes is refused (`check_together`).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from tcstudy.laws.composed import EdgeLaws
from tcstudy.read.checks import corner_faults
from tcstudy.read.fields import Context
from tcstudy.read.history import check_numbers
from tcstudy.read.node import Node
from tcstudy.read.plans import meant_number
from tcstudy.scene.histories import HistoryPlan
from tcstudy.scene.keys import row
from tcstudy.scene.parameters import Number, numbers, path_of, path_scene, sweepable
from tcstudy.scene.points import distinct
from tcstudy.scene.records import Rigid, Scene
from tcstudy.scene.study import Exact, MeshPlan, OutputPlan, Sensitivity, SolverPlan

Keys = tuple[str, ...]


def read_sensitivity(
    ctx: Context,
    node: Node,
    root: Node,
    base: Scene | None,
    scenes: Sequence[Scene],
    exact: Exact | None,
    history: HistoryPlan | None,
) -> tuple[Sensitivity, ...]:
    """The numbers by name or key path, each once.

    base: the scene without the sweep;  exact: the exact solution, whose derived loads would have to follow
    """
    if base is None:
        return ()
    if exact is not None and exact.derived:
        what = "the loads are derived from the exact solution and would change with the number"
        ctx.errors.at(node, what, "give the loads, or remove sensitivity")
        return ()
    known = differentiable(root, base, scenes)
    found: dict[Keys, Sensitivity] = {}
    for item in node.entries:
        word = ctx.text(item, "the name of a number")
        if (path := path_of(word)) in found:
            ctx.errors.at(item, f"{word} is given twice", "give every number once")
        elif word and (number := named_number(ctx, item, word, known)):
            found[path] = number
            if path[0] == "boundary" and path[-1].startswith("u_"):  # which a corner may share with another edge
                moved = path_scene(base, path, 1.0 + 2.0 * abs(float(known[path].value)))  # type: ignore[arg-type]
                if fault := next(corner_faults(base.body, moved.boundary), None):
                    remedy = "free a component of one of the two edges"
                    ctx.errors.at(item, f"{'.'.join(path)} cannot change alone: {fault[1]}", remedy)
    if history is not None:
        check_numbers(ctx, node, found.values(), history)
    return tuple(found.values())


def differentiable(root: Node, base: Scene, scenes: Sequence[Scene]) -> dict[Keys, Number]:
    """The numbers by which results can be differentiated, and those that have a reason why not; of materials those
    that the study gives, of laws those of all scenes."""
    found = {path: one for path, one in numbers(base) if path[0] != "friction"}
    found = {path: one for path, one in found.items() if path[0][:8] != "material" or root.at(*path)}
    for scene in distinct(scenes, "friction"):
        found |= {path: one for path, one in numbers(scene) if path[0] == "friction"}
    if root.at("history", "stiffness"):
        found["history", "stiffness"] = Number(row("history", "stiffness"), 0.0)
    return found


def named_number(
    ctx: Context, node: Node, word: str, known: Mapping[Keys, Number], on_key: bool = False
) -> Sensitivity | None:
    """The number that a word names, of those that are `differentiable`; None after a fault."""
    path = ("parameters", word) if word in ctx.named else path_of(word)
    if path in known and not known[path].no_number:
        return Sensitivity(word, path, ctx.cf(known[path].row.dimension))
    what, remedy = f"there is no derivative by {word}", "compare points of a sweep over it"
    if path in known:
        what, remedy = f"{what}: {known[path].no_number}", "name a single number that has an effect"
    elif path[0] in ("body", "mesh"):
        what += ": it moves the mesh"
    elif path[0] in ("material", "materials") and path[-1] in ("lambda", "mu"):
        remedy = "give the material by E and nu, and name these"
    elif path[0] == "parameters":
        what, remedy = f"{what}: it may stand in any expression", "name a number of a section"
    elif path in sweepable({}, None):
        what = f"this study has no number {word} by which its solution can be differentiated"
    else:
        what, remedy = f"the study has no number {word!r}", meant_number(word, known, "use")
    ctx.errors.at(node, what, remedy, on_key=on_key)
    return None


def check_together(
    ctx: Context,
    root: Node,
    scenes: Sequence[Scene],
    mesh: MeshPlan | None,
    solver: SolverPlan | None,
    output: OutputPlan | None,
    exact: Exact | None,
) -> None:
    """Report what a feature of the scenes, a path, a history or a fit excludes and the study asks for.

    mesh … exact: what it asks for beside its scenes; None for what it does not, or has faults in
    """
    roles = dict(scenes[0].boundary).values() if scenes else ()
    laws = any(isinstance(scene.friction, EdgeLaws) for scene in distinct(scenes, "friction"))
    springs = any(scene.springs for scene in distinct(scenes, "boundary"))
    own, no_edge = any(role.heat is not None for role in roles), "an exact solution has no such edge; remove exact"
    one = "an exact solution takes one material; remove exact, or write one material"
    derived = "loads are derived for the section heat only; give the loads, or loads: given"
    for has, feature, page, why in (  # what a live page takes in its place, why an exact solution has it not
        (laws, "friction differs along the contact line", "one law", ""),
        (root.child("materials"), "materials differ by region, where stresses jump", "one material", one),
        (any(isinstance(role, Rigid) for role in roles), "an edge is rigid", "none", no_edge),
        (springs, "an edge rests on springs", "none", no_edge),
        (own, "an edge has heat of its own", "one alpha and one theta_bar", derived if exact and exact.derived else ""),
    ):
        if has and output and output.live:
            ctx.errors.at(root.nearest("output"), f"{feature}, and a live page takes {page}; remove live: true")
        if has and exact and why:
            ctx.errors.at(root.nearest("exact"), f"{feature}, and {why}")
    for key in ("path", "history", "fit"):
        if root.child(key) and mesh and mesh.guarantee:
            ctx.errors.at(root.nearest("mesh", "guarantee"), f"is of single points, not of a {key}; remove it")
        if root.child(key) and solver and solver.every:
            remedy = "write path.complete: true" if key == "path" else "remove it"
            ctx.errors.at(root.nearest("solver", "branch"), f"is of single points, not of a {key}", remedy)
