"""Reads the section `path`: along which parameter all solutions are followed, from where to where."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from typing import Any

from tcstudy.expressions.expression import Expression
from tcstudy.read.checks import check_corners
from tcstudy.read.fields import Context, Fields, nearest
from tcstudy.read.node import Collector, Node
from tcstudy.scene.keys import rows
from tcstudy.scene.parameters import SHORT, affine_numbers, path_scene, sweepable
from tcstudy.scene.records import Clamped, Convection, Scalar, Scene, Traction
from tcstudy.scene.study import MeshPlan, PathPlan
from tcstudy.scene.units import NONE, TEMPERATURE, Dimension

SHORTER = SHORT | {name: f"loads.{name}" for one in rows("loads").values() for name in one.numbers}


@dataclass(frozen=True)
class _Affine:
    """A parameter that enters the load affinely: its dimension, its value in the scene, why it would do nothing."""

    dimension: Dimension
    value: Scalar
    idle: str = ""


def read_path(ctx: Context, node: Node | None, scene: Scene | None, mesh: MeshPlan | None) -> PathPlan | None:
    """The path; None without the section or after a fault.

    scene: the scene without the sweep, mesh: the meshes; None if they have faults of their own
    """
    if node is None:
        return None
    before = len(ctx.errors)
    fields = Fields(ctx, node, "path")
    if len(ctx.errors) > before or scene is None:
        return None
    keys = _parameter(ctx, fields.values["parameter"], scene)
    if keys is None:
        return None
    dimension = dict(_affine(scene))[keys].dimension
    begin, end = (fields.quantity(key, dimension=dimension) for key in ("from", "to"))
    if begin == end:
        ctx.errors.at(fields.values["to"], "is the same value as from", "give a range, from: A, to: B")
        return None
    within = _within(ctx, fields, dimension, begin, end)
    plan = PathPlan(keys, dimension.cf if ctx.units == "SI" else "1", begin, end, within, scene)
    plan = replace(plan, at=_at(ctx, fields, dimension, plan), **_options(ctx, fields, mesh))
    if len(ctx.errors) > before:
        return None
    _check_corners(ctx, fields, plan)
    return plan if len(ctx.errors) == before else None


def _affine(scene: Scene) -> Iterator[tuple[tuple[str, ...], _Affine]]:
    """All parameters of the scene that a path may run along, by key path."""
    heat = scene.heat
    idle = "" if scene.material.beta else "beta is 0, so temperature does not load the body"
    acts = {"theta"} if heat.theta is not None else {"theta_bar"} if scene.edges(Convection) else set()
    if "theta_bar" in acts and heat.alpha > 0.0:
        acts.add("q")
    for row, name, value in affine_numbers(heat, "heat"):
        if name in acts:
            yield ("heat", name), _Affine(row.dimension, value, idle)
    for row, name, value in affine_numbers(scene, "loads"):
        yield ("loads", name), _Affine(row.dimension, value)
    loads: list[Scalar] = [*scene.f]
    for edge, role in scene.boundary:
        if isinstance(role, Clamped):
            names = ("u_x", "u_y") if role.frame == "xy" else ("u_N", "u_T")
            for name, held in zip(names, role.u, strict=True):
                if held is not None:
                    yield ("boundary", edge, name), _Affine(rows("boundary")[name].dimension, held)
        elif isinstance(role, Traction | Convection):
            loads += [*role.g, role.pressure]
            for row, name, value in affine_numbers(role, "boundary"):
                yield ("boundary", edge, name), _Affine(row.dimension, value)
    no_load = "" if any(isinstance(x, Expression) or x != 0.0 for x in loads) else "the study has no f, g or pressure"
    yield ("load",), _Affine(NONE, 1.0, no_load)


def _parameter(ctx: Context, node: Node, scene: Scene) -> tuple[str, ...] | None:
    """Key path of the parameter; None after a fault."""
    word = ctx.text(node, "the name of a parameter")
    if not word:
        return None
    name = SHORTER.get(word, word)
    known = dict(_affine(scene))
    keys = tuple(name.split("."))
    if keys not in known:
        usable = (path for path, p in known.items() if not p.idle and not isinstance(p.value, Expression))
        names = [".".join(path) for path in usable]
        if keys in sweepable({}, None) and keys[0] in ("heat", "material", "friction"):
            what = f"the load is not affine in {name} in this study, so no path can be followed along it"
            ctx.errors.at(node, what, f"use a sweep over it; a path runs along {', '.join(names)}")
        else:
            shorter = {short: full for short, full in SHORTER.items() if full in names}
            same = [name for name in names if name.split(".")[-1] == word]
            near = same[0] if same else nearest(word, [*names, *shorter])
            remedy = f"did you mean {near!r}?" if near else f"a path runs along {', '.join(names)}"
            ctx.errors.at(node, f"the scene has no parameter {word!r} for a path", remedy)
        return None
    if known[keys].idle:
        ctx.errors.at(node, f"{known[keys].idle}, so the solution does not depend on {name}", "choose another")
        return None
    if isinstance(known[keys].value, Expression):
        what = f"{name} varies in space ({known[keys].value}), but along a path it is one number"
        ctx.errors.at(node, what, f"give {name} a number, or use parameter: load for a factor of all mechanical loads")
        return None
    return keys


def _within(ctx: Context, fields: Fields, dimension: Dimension, begin: float, end: float) -> tuple[float, float]:
    """Where the path may go: by default as far again on both sides, since folds may lie outside the range."""
    node = fields["within"]
    low, high = min(begin, end), max(begin, end)
    if node is None:
        return low - (high - low), high + (high - low)
    both = ctx.pair(node, "a pair [low, high]", "[-10 K, 60 K]" if dimension == TEMPERATURE else "[-1, 2]")
    if both is None:
        return low, high
    first, last = (ctx.quantity(item, dimension) for item in both)
    if first > low or last < high:
        ctx.errors.at(node, "does not contain the range from … to", "widen it, or leave it out")
    return first, last


def _at(ctx: Context, fields: Fields, dimension: Dimension, plan: PathPlan) -> tuple[float, ...]:
    """The values at which solutions are wanted, each once and where the path may go."""
    node = fields["at"]
    if node is None:
        return ()
    nodes = node.value if isinstance(node.value, tuple) else (node,)
    found: list[float] = []
    for item in nodes:
        value = ctx.quantity(item, dimension)
        low, high = plan.within
        if not math.isnan(value) and not low <= value <= high:
            remedy = f"choose a value from {low:g} to {high:g}, or widen from, to or within"
            ctx.errors.at(item, f"{item.brief()} is outside the range of the path", remedy)
        if value in found:
            ctx.errors.at(item, f"the value {item.brief()} is repeated", "give every value once")
        found.append(value)
    return tuple(found)


def _options(ctx: Context, fields: Fields, mesh: MeshPlan | None) -> dict[str, Any]:
    """The other keys that are given."""
    read: dict[str, Callable[[str], Any]] = {
        **{"choice": fields.choice, "integer": fields.integer},
        **{"flag": fields.flag, "number": fields.quantity},
    }
    given = (row for row in fields.rows.values() if fields[row.name] and row.kind in read and row.name != "level")
    found: dict[str, Any] = {row.name: read[row.kind](row.name) for row in given}
    if mesh and mesh.strategy.adapts:
        remedy = "use family: uniform or graded for a path, for example --set mesh.family=graded"
        ctx.errors.at(fields.node, "adaptive meshes follow from the solutions of a run", remedy, on_key=True)
    elif node := fields["level"]:
        found["level"] = ctx.integer(node, 0, mesh.levels - 1 if mesh else None)
    return found


def _check_corners(ctx: Context, fields: Fields, plan: PathPlan) -> None:
    """A prescribed displacement must agree with its neighbours at common corners all along the path."""
    if plan.parameter[0] != "boundary":
        return
    for key, t in (("from", plan.begin), ("to", plan.end)):
        probe = Context(Collector(), ctx.units)
        check_corners(probe, fields.node, plan.scene.body, path_scene(plan.scene, plan.parameter, t).boundary)
        if probe.errors.problems:
            what = f"with {plan.name} = {t:g} {probe.errors.problems[0].what}"
            ctx.errors.at(fields.values[key], what, "free a component of one of the two edges")
            return
