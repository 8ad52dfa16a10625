"""Reads the sections that say how a study is run: `mesh` (or `h` of a sweep), `solver`, `output`, `path`."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from itertools import islice, pairwise
from pathlib import Path
from typing import Any, get_args

from tcstudy.expressions.expression import Expression
from tcstudy.read.checks import check_goal, check_guarantee, check_mesh, corner_faults
from tcstudy.read.fields import Context, Fields, none_after_fault
from tcstudy.read.node import Node, hint
from tcstudy.scene.families import FAMILIES, PLAIN, TO_TOLERANCE, FamilyName
from tcstudy.scene.keys import rows
from tcstudy.scene.parameters import SHORT, Keys, Number, affine_numbers, sweepable
from tcstudy.scene.records import Body, Scene
from tcstudy.scene.study import ALL, BUNDLE, SEPARABLE, Goal, MeshPlan, OutputPlan, PathPlan, Quantity, SolverPlan
from tcstudy.scene.units import LENGTH, LINE_FORCE

QUANTITIES: tuple[Quantity, ...] = get_args(Quantity)
IN_SWEEP = ("tolerance", "of", "max_levels", "known")
"""Keys that h: {tolerance: …} of a sweep may hold."""
SINGLE = ("levels", "family", "tolerance", "max_levels", "grading", "marking", "max_dofs")
"""Keys of `mesh` that a list of sizes has no use for."""


OF_MESH = ("maxh", "levels", "max_levels", "family", "goal", "of", "known")
OF_PATH = ("parameter", "from", "to", "within", "at", "level")
"""Keys that depend on each other; every other one of `mesh` and `path` is a field of the plan."""


def read_mesh(ctx: Context, root: Node, h: Node | None, body: Body | None, scenes: Sequence[Scene]) -> MeshPlan | None:
    """The meshes, coarse to fine; None after a fault in them by themselves, not in what they are for this body.

    h: of the sweep: a list of sizes in place of maxh, or a mapping {tolerance, of, …}
    """
    section, listed = root.child("mesh"), h if h and isinstance(h.value, tuple) else None
    if h and not isinstance(h.value, tuple | Mapping):
        remedy = "write [20 mm, 10 mm] or {tolerance: 1e-3, of: friction_resultant}"
        ctx.errors.at(h, f"must be a list of sizes or a tolerance, but is {h.kind()}", remedy)
        return None
    if section is None and listed is None:  # which is recorded already
        return None
    plan = _mesh(ctx, section or replace(h or root, value={}), h)
    if plan and body:
        check_mesh(ctx, listed or root.nearest("mesh", "maxh"), plan, body)
        check_guarantee(ctx, root, plan, body)
        places = (h if not listed else None, "of"), (section, "of"), (section, "goal")
        goal = next((node for place, key in places if place and (node := place.child(key))), None)
        if scenes and goal:
            check_goal(ctx, goal, plan.goal, body, scenes[0].boundary)
    return plan


@none_after_fault
def _mesh(ctx: Context, section: Node, h: Node | None) -> MeshPlan | None:
    listed = h if h and isinstance(h.value, tuple) else None
    fields = Fields(ctx, section, "mesh", () if listed else ("maxh",))
    if listed:
        fields.values = {**fields.values, "maxh": listed}
    elif h:
        swept = Fields(ctx, h, "mesh", ("tolerance",), IN_SWEEP[1:])
        for key in sorted(swept.values.keys() & fields.values.keys()):
            swept.fault(key, f"mesh.{key} is given, too", "give it once", on_key=True)
        fields.values = {**fields.values, **swept.values}
    before, node = len(ctx.errors), fields["maxh"]
    sizes: tuple[float, ...] = fields.value("maxh") if node else ()
    for i, (coarse, fine) in enumerate(pairwise(sizes), start=1):
        if fine >= coarse:
            where = node.value[i] if node and isinstance(node.value, tuple) else section
            remedy = "order the sizes from coarse to fine, each once"
            ctx.errors.at(where, f"{fine:g} does not decrease after {coarse:g}", remedy)
    if len(ctx.errors) > before or not sizes:
        return None
    to_tolerance = fields["tolerance"] is not None
    family: FamilyName = fields.value("family") if fields["family"] else TO_TOLERANCE if to_tolerance else PLAIN
    for key, said in _contradictions(fields, family, len(sizes) > 1).items():
        if key and fields[key]:
            what, _, remedy = said.partition("; ")
            fields.fault(key, what, remedy, on_key=True)
    key, most = "max_levels" if to_tolerance else "levels", FAMILIES[family].max_levels
    levels = ctx.integer(node, 1, most) if (node := fields[key]) else min(fields.value(key), most)
    options = fields.given(name for name in fields.rows if name not in OF_MESH)
    return MeshPlan(sizes, len(sizes) if len(sizes) > 1 else levels, family, goal=_goal(ctx, fields), **options)


def _contradictions(fields: Fields, family: FamilyName, listed: bool) -> dict[str, str]:
    """Keys that contradict others or would not be used where they are given: what is wrong and what to do."""
    strategy, to_tolerance = FAMILIES[family], fields["tolerance"] is not None
    used = {one.option: f"is for {name} meshes; add family: {name}, or remove it" for name, one in FAMILIES.items()}
    used.pop(strategy.option)
    if to_tolerance:
        used["levels"] = "the tolerance decides how many levels there are; use max_levels for the most"
    else:
        used["max_levels"] = "is for a tolerance; use levels, or add tolerance: 1e-3"
        used["of"] = "says what the tolerance is of, but there is none; use goal, or add tolerance"
        if not strategy.adapts:
            used["max_dofs"] = "ends adaptive meshes and those for a tolerance; remove it, or add family: adaptive"
    if listed:
        one = "with a single maxh; give one maxh and levels (nested meshes), or a list of maxh alone"
        used |= {key: f"{key} {'go' if key == 'levels' else 'goes'} {one}" for key in SINGLE}
        if (levels := fields["levels"]) and levels.value == 1:
            del used["levels"]
    if fields["of"]:
        used["goal"] = "of names the goal already; keep one of the two"
    elif not (strategy.adapts or to_tolerance or fields["estimate"]):
        used["goal"] = "no error is estimated here, so the goal is not used; add estimate: true"
    return used


def _goal(ctx: Context, fields: Fields) -> Goal:
    """The quantity by name, or {u_T: [x, y]}; with its known value."""
    node, goal = fields["of"] or fields["goal"], Goal()
    if node and isinstance(node.value, Mapping):
        goal = Goal("u_T", Fields(ctx, node, "goal").value("u_T"))
    elif node:
        goal = Goal(ctx.choice(node, QUANTITIES))
        if goal.quantity == "u_T":
            ctx.errors.at(node, "u_T needs its point on a contact edge", "write {u_T: [20 mm, 0 mm]}")
    if fields["known"] and goal.quantity == "energy":
        fields.fault(
            "known", "a known value needs a goal that is a number", "add goal: friction_resultant", on_key=True
        )
    elif fields["known"]:
        of = LINE_FORCE if goal.quantity == "friction_resultant" else LENGTH
        return replace(goal, known=fields.value("known", of))
    return goal


@none_after_fault
def read_solver(ctx: Context, node: Node | None) -> SolverPlan:
    """The solver by name, or several to compare, with its options; None after a fault."""
    if node is None:
        return SolverPlan()
    fields = Fields(ctx, node, "solver")
    given = fields.given()
    names = given.pop("name", SolverPlan().names)
    if len(set(names)) < len(names):
        fields.fault("name", "names a solver twice", "name each solver once")
    if BUNDLE not in names and fields["max_iterations"]:
        fields.fault("max_iterations", f"is of {BUNDLE} alone", f"remove it, or choose name: {BUNDLE}")
    every = given.get("branch") == ALL
    for key in ("max_boxes", "max_seconds"):
        if fields[key] and not every:
            fields.fault(key, f"is of branch: {ALL} alone", f"remove it, or choose branch: {ALL}")
    if every and names != SolverPlan().names:
        fields.fault("branch", f"is of {SEPARABLE} alone", "leave `name` out")
    return SolverPlan(names, **(given | {"branch": SolverPlan().branch, "every": True} if every else given))


@none_after_fault
def read_output(ctx: Context, node: Node | None) -> OutputPlan:
    """Where the data go; None after a fault."""
    if node is None:
        return OutputPlan()
    fields = Fields(ctx, node, "output")  # probes and sensitivity are judged where the scenes are known
    given = fields.given(key for key in fields.rows if key not in ("sensitivity", "probes"))
    if where := fields["path"]:
        text, path = given["path"], Path(given["path"])
        if text and (path.name in ("", "..") or text.endswith("/") or text.startswith("~")):
            ctx.errors.at(where, f"{where.brief()!r} names no file", "write a name such as results/study.nc")
        given["path"] = path
    return OutputPlan(**given)


@none_after_fault
def read_path(ctx: Context, node: Node, scene: Scene | None, mesh: MeshPlan | None) -> PathPlan | None:
    """The path; None without the section or after a fault.

    scene: the scene without the sweep, mesh: the meshes; None if they have faults of their own
    """
    fields = Fields(ctx, node, "path")
    ctx.sound()
    word = fields.value("parameter")
    if scene is None or not word:
        return None
    keys, known = path_of(word), dict(affine_numbers(scene))
    if keys not in known and keys in sweepable({}, None) and keys[0] in ("heat", "material", "friction"):
        what = f"the load is not affine in {'.'.join(keys)} in this study, so no path can be followed along it"
        remedy = f"use a sweep over it; a path runs along {', '.join(usable(known))}"
        fields.fault("parameter", what, remedy)
    elif keys not in known:
        what = f"the scene has no parameter {word!r} for a path"
        fields.fault("parameter", what, meant_number(word, known, "a path runs along"))
    elif why := no_single_load(keys, known[keys], "along a path"):
        fields.fault("parameter", *why)
    ctx.sound()
    dimension = known[keys].row.dimension
    begin, end = (fields.value(key, dimension) for key in ("from", "to"))
    if begin == end:
        fields.fault("to", "is the same value as from", "give a range, from: A, to: B")
        return None
    low, high = min(begin, end), max(begin, end)
    within = low - (high - low), high + (high - low)  # as far again on both sides: folds may lie outside the range
    if fields["within"]:
        within = fields.value("within", dimension)
        if within[0] > low or within[1] < high:
            fields.fault("within", "does not contain the range from … to", "widen it, or leave it out")
    asked, at = fields["at"], fields.value("at", dimension) or ()
    items = asked.value if asked and isinstance(asked.value, tuple) else (asked,) * len(at)
    for i, (item, value) in enumerate(zip(items, at, strict=True)):
        if item and not math.isnan(value) and not within[0] <= value <= within[1]:
            remedy = f"choose a value from {within[0]:g} to {within[1]:g}, or widen from, to or within"
            ctx.errors.at(item, f"{item.brief()} is outside the range of the path", remedy)
        if item and value in at[:i]:
            ctx.errors.at(item, f"the value {item.brief()} is repeated", "give every value once")
    given = fields.given(name for name in fields.rows if name not in OF_PATH)
    level = {} if mesh and mesh.strategy.adapts else level_of(ctx, fields, mesh, "a path")  # a run needs no path
    ctx.sound()
    ends = (("from", begin), ("to", end)) if keys[0] == "boundary" else ()
    disagree = (
        (key, t, why) for key, t in ends for _, why in corner_faults(scene.body, known[keys].put(scene, t).boundary)
    )
    for key, t, fault in islice(disagree, 1):
        fields.fault(key, f"with {'.'.join(keys)} = {t:g} {fault}", "free a component of one of the two edges")
    return PathPlan(keys, ctx.cf(dimension), begin, end, within, scene, at, **given, **level)


SHORTER = SHORT | {name: f"loads.{name}" for one in rows("loads").values() for name in one.numbers}
"""Short names of parameters, with those of components."""


def path_of(word: str) -> tuple[str, ...]:
    """The key path that a name or a path stands for."""
    return tuple(SHORTER.get(word, word).split("."))


def usable(known: Mapping[Keys, Number]) -> list[str]:
    """Names of the numbers that nothing speaks against."""
    return [".".join(path) for path, one in known.items() if not one.no_number]


def meant_number(word: str, known: Mapping[Keys, Number], otherwise: str, more: Iterable[str] = ()) -> str:
    """Remedy for a name that no number has: one that ends in it, the nearest, or all after `otherwise`.

    more: other words that may have been meant
    """
    names = usable(known)
    same = [name for name in names if name.split(".")[-1] == word]
    shorter = [short for short, full in SHORTER.items() if full in names]
    return hint(same[0] if same else word, same or [*names, *shorter, *more], f"{otherwise} {', '.join(names)}")


def no_single_load(keys: Keys, load: Number, where: str) -> tuple[str, str] | None:
    """What is wrong with a load that is to change by itself, and what to do; None if nothing is."""
    name = ".".join(keys)
    if load.idle:
        return f"{load.idle}, so the solution does not depend on {name}", "choose another load"
    if isinstance(load.value, Expression):
        what = f"{name} varies in space ({load.value}), but {where} it is one number"
        return what, f"give {name} a number, or use load, the factor of all mechanical loads"
    return None


def level_of(ctx: Context, fields: Fields, mesh: MeshPlan | None, what: str) -> dict[str, Any]:
    """The key `level` of what is done on one mesh, if it is given; what: "a path"."""
    if mesh and mesh.strategy.adapts:
        remedy = f"use family: uniform or graded for {what}, for example --set mesh.family=graded"
        ctx.errors.at(fields.node, "adaptive meshes follow from the solutions of a run", remedy, on_key=True)
    elif node := fields["level"]:
        return {"level": ctx.integer(node, 0, mesh.levels - 1 if mesh else None)}
    return {}
