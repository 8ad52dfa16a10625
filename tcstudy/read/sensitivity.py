"""Reads `output.sensitivity`: the numbers of a study by which results are differentiated exactly.

What a number may be is what can be differentiated without another factorisation (`offline.slopes`): those in which the
load is affine, of materials E, nu, alpha_T or beta and k, α, stiffness of springs, and the numbers of friction laws.
Everything else is refused with its reason.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

from tcstudy.expressions.expression import Expression
from tcstudy.read.checks import check_corners
from tcstudy.read.fields import Context
from tcstudy.read.node import Collector, Node, nearest
from tcstudy.read.plans import affine_parameters
from tcstudy.scene.keys import row
from tcstudy.scene.law_slopes import POINTS
from tcstudy.scene.laws import SHAPES
from tcstudy.scene.parameters import SHORT, path_scene, sweepable
from tcstudy.scene.points import distinct
from tcstudy.scene.records import Convection, EdgeLaws, Scene, Traction, exchanges
from tcstudy.scene.study import Exact, Sensitivity
from tcstudy.scene.units import NONE, STIFFNESS, TRACTION, Dimension

Keys = tuple[str, ...]

NUMBERS = ("E", "nu", "alpha_T", "beta", "k")
"""Of materials."""
REMEDY = "compare points of a sweep over it"


def read_sensitivity(
    ctx: Context, node: Node, root: Node, base: Scene | None, scenes: Sequence[Scene], exact: Exact | None
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
    known = dict(differentiable(root, base, scenes))
    found: dict[Keys, Sensitivity] = {}
    for item in node.value if isinstance(node.value, tuple) else (node,):
        word = ctx.text(item, "the name of a number")
        path = path_of(word)
        if path in found:
            ctx.errors.at(item, f"{word} is given twice", "give every number once")
        elif path in known and not known[path][1]:
            units = known[path][0].cf if ctx.units == "SI" else "1"
            found[path] = Sensitivity(word, path, units, heat_grows(root, path))
            _check_corner(ctx, item, root, base, path)
        elif word:
            what, remedy = why_not(word, path, known)
            ctx.errors.at(item, what, remedy)
    return tuple(found.values())


def path_of(word: str) -> Keys:
    """The key path that a name or a path stands for."""
    short = SHORT | {name: f"loads.{name}" for one in ("f",) for name in row("loads", one).numbers}
    return tuple(short.get(word, word).split("."))


def heat_grows(root: Node, path: Keys) -> bool:
    """Whether the heat load of the material that a number belongs to grows with E: β follows from alpha_T."""
    every = root.child("materials")
    material = every.child(path[1]) if every and path[0] == "materials" else root.child("material")
    return material is None or material.child("beta") is None


def differentiable(root: Node, base: Scene, scenes: Sequence[Scene]) -> Iterator[tuple[Keys, tuple[Dimension, str]]]:
    """(path, (dimension, why not)) of the numbers that the reader knows how to differentiate by."""
    for path, parameter in affine_parameters(base):
        varies = isinstance(parameter.value, Expression)
        yield path, (parameter.dimension, "it varies in space" if varies else parameter.idle)
    every = root.child("materials")
    places = [("material",), *(("materials", region) for region, _ in base.material.regions)]
    for place in places:
        own = root.child("material") if len(place) == 1 else every.child(place[1]) if every else None
        given = set(own.value) if own and isinstance(own.value, Mapping) else set()
        for name in NUMBERS:
            if name in given:
                yield (*place, name), (row("material", name).dimension, "")
    if base.heat.theta is None and base.conducts:
        yield from _of_edges(base)
    for edge, role in base.boundary:
        if isinstance(role, Traction | Convection) and any(role.spring):
            for name in ("normal", "tangential"):
                yield ("boundary", edge, "spring", name), (STIFFNESS, "")
    for scene in distinct(scenes, "friction"):
        yield from _of_laws(scene)


def _of_edges(base: Scene) -> Iterator[tuple[Keys, tuple[Dimension, str]]]:
    """The heat transfer coefficients."""
    dimension = row("heat", "alpha").dimension
    if any(exchanges(role) and not (role.heat and role.heat.alpha) for _, role in base.boundary):
        yield ("heat", "alpha"), (dimension, "")
    for edge, role in base.boundary:
        if role.heat and role.heat.alpha:
            inner = () if isinstance(role, Convection) else ("heat",)
            yield ("boundary", edge, *inner, "alpha"), (dimension, "")


def _of_laws(scene: Scene) -> Iterator[tuple[Keys, tuple[Dimension, str]]]:
    """The numbers of a scene's laws."""
    friction = scene.friction
    laws = friction.laws if isinstance(friction, EdgeLaws) else (("", friction, 1.0),)
    for edge, law, strength in laws:
        place = ("friction", edge) if edge else ("friction",)
        values = law.made.values if law.made else {}
        for key in SHAPES[law.made.shape].parameters if law.made else ():
            if isinstance(values[key.name], float) and key.kind != "integer":
                yield (*place, key.name), (key.dimension, "")
        for i in range(len(values.get(POINTS, ()))):
            yield (*place, POINTS, str(i)), (TRACTION, "")
        yield (*place, "strength"), (NONE, "it varies in space" if isinstance(strength, Expression) else "")


def why_not(word: str, path: Keys, known: dict[Keys, tuple[Dimension, str]]) -> tuple[str, str]:
    """What is wrong with a name, and the remedy."""
    if path in known:
        return f"there is no derivative by {word}: {known[path][1]}", "name a single number that has an effect"
    if path[0] in ("body", "mesh"):
        return f"there is no derivative by {word}: it moves the mesh", REMEDY
    if path[0] in ("material", "materials") and path[-1] in ("lambda", "mu"):
        return f"there is no derivative by {word}", "give the material by E and nu, and name these"
    if path[0] == "parameters":
        return f"there is no derivative by {word}: it may stand in any expression", "name a number of a section"
    if path in sweepable({}, None):
        return f"this study has no number {word} by which its solution can be differentiated", REMEDY
    names = [".".join(one) for one, (_, why) in known.items() if not why]
    near = nearest(word, [*names, *(short for short, full in SHORT.items() if full in names)])
    return f"the study has no number {word!r}", f"did you mean {near!r}?" if near else f"use {', '.join(names)}"


def _check_corner(ctx: Context, item: Node, root: Node, base: Scene, path: Keys) -> None:
    """A prescribed displacement that a corner shares with another edge cannot change alone."""
    if path[0] != "boundary" or not path[-1].startswith("u_"):
        return
    probe, boundary = Context(Collector(), ctx.units), root.child("boundary")
    value = dict(affine_parameters(base))[path].value
    moved = path_scene(base, path, 1.0 + 2.0 * abs(float(value)))  # type: ignore[arg-type]
    if boundary is not None:
        check_corners(probe, boundary, base.body, moved.boundary)
    if probe.errors.problems:
        what = f"{'.'.join(path)} cannot change alone: {probe.errors.problems[0].what}"
        ctx.errors.at(item, what, "free a component of one of the two edges")
