"""Reading the sections `mesh`, `solver` and `output`."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from typing import Any, get_args

import numpy as np

from tcstudy.read.body import check_contact_nodes, check_goal, check_mesh
from tcstudy.read.document import Node
from tcstudy.read.fields import Context, Fields, none_after_fault
from tcstudy.read.scenes import SceneReader
from tcstudy.scene.keys import rows
from tcstudy.scene.mesh_plan import (
    FAMILIES,
    PROVED,
    FamilyName,
    Goal,
    Guarantee,
    MeshPlan,
    Quantity,
)
from tcstudy.scene.records import Contact
from tcstudy.scene.solver_plan import ALL, BUNDLE, SEPARABLE, SolverPlan
from tcstudy.scene.study import OutputPlan, Probe, shell_name
from tcstudy.scene.units import LENGTH, LINE_FORCE
from tcstudy.shapes.edges import body_polygon, body_size, edge_distance

QUANTITIES: tuple[Quantity, ...] = get_args(Quantity)
MAX_EDGE_DISTANCE = 1e-6
"""Distance up to which a point counts as on an edge, over the size of the body."""
MAX_BEND = 1e-9
"""Sine of the angle up to which two edges have one direction."""
UNUSED_WITH_SIZES = (
    "levels",
    "family",
    "tolerance",
    "max_levels",
    "grading",
    "marking",
    "max_dofs",
)
"""Keys of `mesh` that a list of sizes does not use."""
DEPENDENT_KEYS = ("maxh", "levels", "max_levels", "family", "goal", "of", "known")
"""Keys of `mesh` that depend on each other; every other key is a field of the plan."""


def read_mesh(ctx: Context, reader: SceneReader) -> MeshPlan | None:
    """Return the meshes, coarse to fine; None after a fault of the section alone.

    A mesh that does not fit the body is a fault, too, but has a plan.
    """
    root, body = reader.root, reader.body
    section = root.at("mesh")
    if section is None:  # which is recorded already
        return None
    plan = _mesh(ctx, section)
    if plan and body:
        fault_count = len(ctx.errors)
        maxh = root.nearest("mesh", "maxh")
        check_mesh(ctx, maxh, plan, body)
        if reader.base is not None and len(ctx.errors) == fault_count:
            check_contact_nodes(ctx, maxh, plan, body, reader.base.boundary)
        if reader.scenes and (goal := section.at("of") or section.at("goal")):
            check_goal(ctx, goal, plan.goal, body, reader.scenes)
    return plan


@none_after_fault
def _mesh(ctx: Context, section: Node) -> MeshPlan:
    fields = Fields(ctx, section, "mesh")
    _check_tolerance(ctx, fields)
    sizes = _sizes(ctx, fields)
    has_tolerance = fields["tolerance"] is not None
    family: FamilyName = "adaptive"
    if fields["family"] or not has_tolerance:
        family = fields.value("family")
    for key, fault in _unused_keys(fields, family, len(sizes) > 1).items():
        if key and fields[key]:
            fields.fault(key, fault, on_key=True)
    levels_key = "max_levels" if has_tolerance else "levels"
    max_levels = FAMILIES[family].max_levels
    if node := fields[levels_key]:
        levels = ctx.integer(node, 1, max_levels)
    else:
        levels = min(fields.value(levels_key), max_levels)
    if len(sizes) > 1:
        levels = len(sizes)
    options = fields.given(key for key in fields.rows if key not in DEPENDENT_KEYS)
    goal = _goal(ctx, fields)
    options["guarantee"] = _guarantee(options.get("guarantee"), goal)
    return MeshPlan(sizes, levels, family, goal=goal, **options)


def _guarantee(word: bool | str | None, goal: Goal) -> Guarantee:
    """Return what is proved of the body, from the key and a tolerance of the proved bound."""
    if word == "polygon":
        return "polygon"
    if word or goal.proved:
        return "bounds"
    return "band" if word is None else "none"


def _check_tolerance(ctx: Context, fields: Fields) -> None:
    """Record a tolerance that is written as {goal: number}, and end the reading."""
    node = fields["tolerance"]
    if node and len(node.children) == 1:
        goal, size = next(iter(node.children.items()))
        remedy = f"write tolerance: {size.text()}, of: {goal}"
        fields.fault("tolerance", "is a number, what it is of stands beside it", remedy)
        ctx.sound()


def _sizes(ctx: Context, fields: Fields) -> tuple[float, ...]:
    """Return the element sizes, coarse to fine."""
    node = fields["maxh"]
    sizes: tuple[float, ...] = fields.value("maxh") if node else ()
    for i, (coarse, fine) in enumerate(pairwise(sizes), start=1):
        if node and fine >= coarse:
            fault = f"{fine:g} does not decrease after {coarse:g}"
            ctx.at(node.entries[i], fault, "order the sizes from coarse to fine, each once")
    ctx.sound()
    return sizes


def _unused_keys(fields: Fields, family: FamilyName, has_sizes: bool) -> dict[str, str]:
    """Return the keys that the family or other keys exclude, with the fault of each.

    has_sizes: whether maxh is a list
    """
    strategy = FAMILIES[family]
    has_tolerance = fields["tolerance"] is not None
    unused = dict[str, str]()
    for name, candidate in FAMILIES.items():
        unused[candidate.option] = f"is for {name} meshes; add family: {name}, or remove it"
    unused.pop(strategy.option)
    if has_tolerance:
        fault = "the tolerance decides how many levels there are"
        unused["levels"] = f"{fault}; use max_levels for the most"
    else:
        unused["max_levels"] = "is for a tolerance; use levels, or add tolerance: 1e-3"
        fault = "says what the tolerance is of, but there is none"
        unused["of"] = f"{fault}; use goal, or add tolerance"
        if not strategy.adapts:
            fault = "ends adaptive meshes and those for a tolerance"
            unused["max_dofs"] = f"{fault}; remove it, or add family: adaptive"
    if has_sizes:
        remedy = "give one maxh and levels (nested meshes), or a list of maxh alone"
        for key in UNUSED_WITH_SIZES:
            verb = "go" if key == "levels" else "goes"
            unused[key] = f"{key} {verb} with a single maxh; {remedy}"
        if (levels := fields["levels"]) and levels.value == 1:
            del unused["levels"]
    if fields["of"]:
        unused["goal"] = "of names the goal already; keep one of the two"
    elif not (strategy.adapts or has_tolerance or fields["estimate"]):
        unused["goal"] = "no error is estimated here, so the goal is not used; add estimate: true"
    return unused


def _goal(ctx: Context, fields: Fields) -> Goal:
    node = fields["of"] or fields["goal"]
    goal = Goal()
    if node and isinstance(node.value, Mapping):
        goal = Goal("u_T", Fields(ctx, node, "goal").value("u_T"))
    elif node:
        word: Any = ctx.choice(node, (*QUANTITIES, PROVED))
        goal = Goal(proved=True) if word == PROVED else Goal(word)
        if goal.quantity == "u_T":
            ctx.at(node, "u_T needs its point on a contact edge", "write {u_T: [20 mm, 0 mm]}")
    if fields["known"] and goal.quantity == "energy":
        fault = "a known value needs a goal that is a number"
        fields.fault("known", fault, "add goal: friction_resultant", on_key=True)
    elif fields["known"]:
        dimension = LINE_FORCE if goal.quantity == "friction_resultant" else LENGTH
        return replace(goal, known=fields.value("known", dimension))
    return goal


@none_after_fault
def read_solver(ctx: Context, node: Node | None) -> SolverPlan:
    """Return the solver, or several to compare, with the options; None after a fault."""
    if node is None:
        return SolverPlan()
    default = SolverPlan()
    fields = Fields(ctx, node, "solver")
    fault_count = len(ctx.errors)
    options = fields.given()
    names = options.pop("name", default.names)
    is_read = len(ctx.errors) == fault_count  # after a fault a name may be a stand-in
    if is_read and len(set(names)) < len(names):
        fields.fault("name", "names a solver twice", "name each solver once")
    if is_read and BUNDLE not in names and fields["max_iterations"]:
        remedy = f"remove it, or choose name: {BUNDLE}"
        fields.fault("max_iterations", f"is of {BUNDLE} alone", remedy)
    finds_all = options.get("branch") == ALL
    for key in ("max_boxes", "max_seconds"):
        if fields[key] and not finds_all:
            fields.fault(key, f"is of branch: {ALL} alone", f"remove it, or choose branch: {ALL}")
    if finds_all:
        if names != default.names:
            fields.fault("branch", f"is of {SEPARABLE} alone", "leave `name` out")
        options |= {"branch": default.branch, "every": True}
    return SolverPlan(names, **options)


@none_after_fault
def read_output(ctx: Context, reader: SceneReader) -> OutputPlan:
    """Return the output file and the requested variables but derivatives; None after a fault."""
    section = reader.root.at("output")
    if section is None:
        return OutputPlan()
    fields = Fields(ctx, section, "output")
    values = fields.given(key for key in fields.rows if key not in ("sensitivity", "probes"))
    if node := fields["path"]:
        text = values["path"]
        path = Path(text)
        if fault := shell_name(text):
            ctx.at(node, f"{node.brief()!r} {fault[0]}", fault[1])
        elif text and (path.name in ("", "..") or text.endswith("/")):
            remedy = "write a name such as results/study.nc"
            ctx.at(node, f"{node.brief()!r} names no file", remedy)
        values["path"] = path
    if (node := fields["quantities"]) and "section_force" in (values["quantities"] or ()):
        _check_section(ctx, node, reader)
    ctx.sound()
    return OutputPlan(**values, probes=_probes(ctx, fields["probes"], reader))


def _check_section(ctx: Context, node: Node, reader: SceneReader) -> None:
    """Record a contact line that is not one straight line, across which sections are cut.

    The contact line of a body from a file is checked on its mesh.
    """
    if reader.body is None or reader.body.outline is None or not reader.scenes:
        return
    edges = [edge for edge in reader.body.edges if edge.name in reader.scenes[0].edges(Contact)]
    directions = np.array([np.subtract(edge.end, edge.start) for edge in edges])
    directions /= np.hypot(*directions.T)[:, None]
    normal = [directions[0, 1], -directions[0, 0]]
    has_arc = any(edge.through for edge in edges)
    has_bend = has_arc or np.abs(directions @ normal).max() > MAX_BEND
    has_gap = len({edge.start for edge in edges} - {edge.end for edge in edges}) > 1
    if has_bend or has_gap:
        form = "is not straight" if has_bend else "has several parts"
        fault = f"section_force: the contact line {form}, and no one section lies across it"
        ctx.at(node, fault, "remove it; forces gives those of edges")


def _probes(ctx: Context, node: Node | None, reader: SceneReader) -> tuple[Probe, ...]:
    """Return the probes; a point outside the body is a fault.

    Points of a body from a file are not checked, and have no u_T.
    """
    if node is None:
        return ()
    body = reader.body
    fault_count = len(ctx.errors)
    point_row = replace(rows("output")["probes"], kind="point")
    items = ctx.mapping(node, "names to points", "write {tip: [200 mm, 60 mm]}", named=True)
    probes = tuple(Probe(name, ctx.value(item, point_row)) for name, item in items.items())
    if body is None or body.outline is None or not reader.scenes or len(ctx.errors) > fault_count:
        return probes
    import shapely

    shape = body_polygon(body)
    contact = reader.scenes[0].edges(Contact)
    placed = list[Probe]()
    for probe in probes:
        distances = [float(edge_distance(edge, np.array([probe.at]))[0]) for edge in body.edges]
        pairs = zip(body.edges, distances, strict=True)
        names = [edge.name for edge, d in pairs if d <= MAX_EDGE_DISTANCE * body_size(body)]
        if not names and not shape.covers(shapely.Point(probe.at)):
            x, y = probe.at
            fault = f"the point ({x:g}, {y:g}) is {min(distances):g} outside the body"
            ctx.at(items[probe.name], fault, "give a point of the body")
        placed.append(replace(probe, on_contact=any(name in contact for name in names)))
    return tuple(placed)
