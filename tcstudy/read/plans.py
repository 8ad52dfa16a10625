"""Reads the sections that say how a study is run: `mesh` (or `h` of a sweep), `solver`, `output`, `path`."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import replace
from itertools import islice, pairwise
from pathlib import Path
from typing import Any, get_args

from tcstudy.expressions.expression import Expression
from tcstudy.read.checks import corner_faults
from tcstudy.read.fields import Context, Fields, none_after_fault
from tcstudy.read.node import Node, hint
from tcstudy.scene.families import FAMILIES, PLAIN, TO_TOLERANCE, FamilyName
from tcstudy.scene.keys import rows
from tcstudy.scene.parameters import SHORT, Keys, Number, affine_numbers, path_scene, sweepable
from tcstudy.scene.records import Scene
from tcstudy.scene.study import ALL, BUNDLE, SEPARABLE, Goal, MeshPlan, OutputPlan, PathPlan, Quantity, SolverPlan
from tcstudy.scene.units import LENGTH, LINE_FORCE, TEMPERATURE, Dimension

QUANTITIES: tuple[Quantity, ...] = get_args(Quantity)
IN_SWEEP = ("tolerance", "of", "max_levels", "known")
"""Keys that h: {tolerance: …} of a sweep may hold."""
SINGLE = ("levels", "family", "tolerance", "max_levels", "grading", "marking", "max_dofs")
"""Keys of `mesh` that a list of sizes has no use for."""


OF_MESH = ("maxh", "levels", "max_levels", "family", "goal", "of", "known")
OF_PATH = ("parameter", "from", "to", "within", "at", "level")
"""Keys that depend on each other; every other one of `mesh` and `path` is a field of the plan."""


@none_after_fault
def read_mesh(ctx: Context, node: Node | None, h: Node | None) -> MeshPlan | None:
    """The meshes, coarse to fine; None after a fault.

    h: of the sweep: a list of sizes in place of maxh, or a mapping {tolerance, of, …}
    """
    listed = h if h and isinstance(h.value, tuple) else None
    section = node or (replace(listed, value={}) if listed else None)
    if section is None:  # which is recorded already
        return None
    fields = Fields(ctx, section, "mesh", () if listed else ("maxh",))
    values = dict(fields.values)
    if listed:
        values["maxh"] = listed
    elif h:
        swept = Fields(ctx, h, "mesh", ("tolerance",), IN_SWEEP[1:])
        for key in sorted(swept.values.keys() & values.keys()):
            ctx.errors.at(swept.values[key], f"mesh.{key} is given, too", "give it once", on_key=True)
        values |= swept.values
    fields.values = values
    sizes = _sizes(ctx, fields)
    return _plan(ctx, fields, sizes) if sizes else None


def _plan(ctx: Context, fields: Fields, sizes: tuple[float, ...]) -> MeshPlan:
    listed, to_tolerance = len(sizes) > 1, fields["tolerance"] is not None
    family: FamilyName = fields.value("family") if fields["family"] else TO_TOLERANCE if to_tolerance else PLAIN
    for key, what, remedy in _contradictions(fields, family, listed):
        ctx.errors.at(fields.values[key], what, remedy, on_key=True)
    most = FAMILIES[family].max_levels
    key = "max_levels" if to_tolerance else "levels"
    levels = ctx.integer(node, 1, most) if (node := fields[key]) else min(fields.value(key), most)
    options = fields.given(name for name in fields.rows if name not in OF_MESH)
    return MeshPlan(sizes, len(sizes) if listed else levels, family, goal=_goal(ctx, fields), **options)


def _contradictions(fields: Fields, family: FamilyName, listed: bool) -> Iterator[tuple[str, str, str]]:
    """(key, what, remedy) of the keys that contradict others or would not be used."""
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
    for key, said in used.items():
        if key and fields[key]:
            what, _, remedy = said.partition("; ")
            yield key, what, remedy


def _goal(ctx: Context, fields: Fields) -> Goal:
    """The quantity by name, or {u_T: [x, y]}; with its known value."""
    node, goal = fields["of"] or fields["goal"], Goal()
    if node and isinstance(node.value, Mapping):
        goal = Goal("u_T", Fields(ctx, node, "goal").value("u_T"))
    elif node:
        goal = Goal(ctx.choice(node, QUANTITIES))
        if goal.quantity == "u_T":
            ctx.errors.at(node, "u_T needs its point on a contact edge", "write {u_T: [20 mm, 0 mm]}")
    if not fields["known"]:
        return goal
    if goal.quantity == "energy":
        what = "a known value needs a goal that is a number"
        ctx.errors.at(fields.values["known"], what, "add goal: friction_resultant", on_key=True)
        return goal
    return replace(goal, known=fields.value("known", LINE_FORCE if goal.quantity == "friction_resultant" else LENGTH))


def _sizes(ctx: Context, fields: Fields) -> tuple[float, ...]:
    """One element size, or a decreasing list of them; empty after a fault."""
    before, node = len(ctx.errors), fields["maxh"]
    sizes: tuple[float, ...] = fields.value("maxh") if node else ()
    for i, (coarse, fine) in enumerate(pairwise(sizes), start=1):
        if fine >= coarse:
            where = node.value[i] if node and isinstance(node.value, tuple) else fields.node
            remedy = "order the sizes from coarse to fine, each once"
            ctx.errors.at(where, f"{fine:g} does not decrease after {coarse:g}", remedy)
    return sizes if len(ctx.errors) == before else ()


@none_after_fault
def read_solver(ctx: Context, node: Node | None) -> SolverPlan:
    """The solver by name, or several to compare, with its options; None after a fault."""
    if node is None:
        return SolverPlan()
    fields = Fields(ctx, node, "solver")
    given = fields.given()
    names = given.pop("name", SolverPlan().names)
    if len(set(names)) < len(names):
        ctx.errors.at(fields.values["name"], "names a solver twice", "name each solver once")
    if BUNDLE not in names and "max_iterations" in fields.values:
        ctx.errors.at(fields.values["max_iterations"], f"is of {BUNDLE} alone", f"remove it, or choose name: {BUNDLE}")
    every = given.get("branch") == ALL
    for key in ("max_boxes", "max_seconds"):
        if key in fields.values and not every:
            ctx.errors.at(fields.values[key], f"is of branch: {ALL} alone", f"remove it, or choose branch: {ALL}")
    if every and names != SolverPlan().names:
        ctx.errors.at(fields.values["branch"], f"is of {SEPARABLE} alone", "leave `name` out")
    return SolverPlan(names, **(given | {"branch": SolverPlan().branch, "every": True} if every else given))


@none_after_fault
def read_output(ctx: Context, node: Node | None) -> OutputPlan:
    """Where the data go; None after a fault."""
    if node is None:
        return OutputPlan()
    fields = Fields(ctx, node, "output")  # the last two are judged where the scenes are known
    given = fields.given(key for key in fields.rows if key not in ("sensitivity", "probes"))
    if (where := fields["path"]) is None:
        return OutputPlan(**given)
    path = Path(text := given["path"])
    if text and (path.name in ("", "..") or text.endswith("/") or text.startswith("~")):
        ctx.errors.at(where, f"{where.brief()!r} names no file", "write a name such as results/study.nc")
    return OutputPlan(**(given | {"path": path}))


@none_after_fault
def read_path(ctx: Context, node: Node, scene: Scene | None, mesh: MeshPlan | None) -> PathPlan | None:
    """The path; None without the section or after a fault.

    scene: the scene without the sweep, mesh: the meshes; None if they have faults of their own
    """
    before = len(ctx.errors)
    fields = Fields(ctx, node, "path")
    if len(ctx.errors) > before or scene is None:
        return None
    keys = _parameter(ctx, fields.values["parameter"], scene)
    if keys is None:
        return None
    dimension = dict(affine_numbers(scene))[keys].row.dimension
    begin, end = (fields.value(key, dimension) for key in ("from", "to"))
    if begin == end:
        ctx.errors.at(fields.values["to"], "is the same value as from", "give a range, from: A, to: B")
        return None
    within = _within(ctx, fields, dimension, begin, end)
    plan = PathPlan(keys, ctx.cf(dimension), begin, end, within, scene)
    given = fields.given(name for name in fields.rows if name not in OF_PATH)
    level = {} if mesh and mesh.strategy.adapts else level_of(ctx, fields, mesh, "a path")  # a run needs no path
    plan = replace(plan, at=_at(ctx, fields, dimension, plan), **given, **level)
    if len(ctx.errors) == before:
        _check_corners(ctx, fields, plan)
    return plan


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


def _parameter(ctx: Context, node: Node, scene: Scene) -> tuple[str, ...] | None:
    """Key path of the parameter; None after a fault."""
    word = ctx.text(node, "the name of a parameter")
    if not word:
        return None
    keys, known = path_of(word), dict(affine_numbers(scene))
    name = ".".join(keys)
    if keys not in known:
        if keys in sweepable({}, None) and keys[0] in ("heat", "material", "friction"):
            what = f"the load is not affine in {name} in this study, so no path can be followed along it"
            ctx.errors.at(node, what, f"use a sweep over it; a path runs along {', '.join(usable(known))}")
        else:
            remedy = meant_number(word, known, "a path runs along")
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


def level_of(ctx: Context, fields: Fields, mesh: MeshPlan | None, what: str) -> dict[str, Any]:
    """The key `level` of what is done on one mesh, if it is given; what: "a path"."""
    if mesh and mesh.strategy.adapts:
        remedy = f"use family: uniform or graded for {what}, for example --set mesh.family=graded"
        ctx.errors.at(fields.node, "adaptive meshes follow from the solutions of a run", remedy, on_key=True)
    elif node := fields["level"]:
        return {"level": ctx.integer(node, 0, mesh.levels - 1 if mesh else None)}
    return {}


def _check_corners(ctx: Context, fields: Fields, plan: PathPlan) -> None:
    """A prescribed displacement must agree with its neighbours at common corners all along the path."""
    if plan.parameter[0] != "boundary":
        return
    for key, t in (("from", plan.begin), ("to", plan.end)):
        for _, why in islice(corner_faults(plan.scene.body, path_scene(plan.scene, plan.parameter, t).boundary), 1):
            what = f"with {plan.name} = {t:g} {why}"
            ctx.errors.at(fields.values[key], what, "free a component of one of the two edges")
            return
