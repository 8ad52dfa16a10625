"""Reads the sections that say how a study is run: `mesh`, `solver`, `output`, `path`."""

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
from tcstudy.scene.mesh_plan import FAMILIES, PROVED, FamilyName, Goal, MeshPlan, Quantity
from tcstudy.scene.records import Contact
from tcstudy.scene.solver_plan import ALL, BUNDLE, SEPARABLE, SolverPlan
from tcstudy.scene.study import OutputPlan, Probe, shell_name
from tcstudy.scene.units import LENGTH, LINE_FORCE
from tcstudy.shapes.edges import body_polygon, body_size, edge_distance

QUANTITIES: tuple[Quantity, ...] = get_args(Quantity)
NEAR = 1e-6
"""Distance from an edge that counts as on it, over the size of the body."""
STRAIGHT = 1e-9
"""Sine of the angle up to which two edges have one direction."""
SINGLE = ("levels", "family", "tolerance", "max_levels", "grading", "marking", "max_dofs")
"""Keys of `mesh` that a list of sizes has no use for."""
OF_MESH = ("maxh", "levels", "max_levels", "family", "goal", "of", "known")
"""Keys that depend on each other; every other one of `mesh` is a field of the plan."""


def read_mesh(ctx: Context, reader: SceneReader) -> MeshPlan | None:
    """The meshes, coarse to fine; None after a fault in them by themselves, not in what they are
    for this body."""
    root, body = reader.root, reader.body
    plan = (
        _mesh(ctx, section) if (section := root.at("mesh")) else None
    )  # that it is missing is recorded already
    if section and plan and body:
        before = len(ctx.errors)
        check_mesh(ctx, root.nearest("mesh", "maxh"), plan, body)
        if reader.base is not None and len(ctx.errors) == before:
            check_contact_nodes(ctx, root.nearest("mesh", "maxh"), plan, body, reader.base.boundary)
        if reader.scenes and (goal := section.at("of") or section.at("goal")):
            check_goal(ctx, goal, plan.goal, body, reader.scenes)
    return plan


@none_after_fault
def _mesh(ctx: Context, section: Node) -> MeshPlan:
    fields = Fields(ctx, section, "mesh")
    if (one := fields["tolerance"]) and isinstance(one.value, Mapping) and len(one.value) == 1:
        what, size = next(iter(one.children.items()))
        fields.fault(
            "tolerance",
            "is a number, what it is of stands beside it",
            f"write tolerance: {size.text()}, of: {what}",
        )
        ctx.sound()
    node, sizes = fields["maxh"], fields.value("maxh") if fields["maxh"] else ()
    for i, (coarse, fine) in enumerate(pairwise(sizes), start=1):
        if node and fine >= coarse:
            said = f"{fine:g} does not decrease after {coarse:g}; order the sizes from coarse to fine, each once"
            ctx.at(node.entries[i], said)
    ctx.sound()
    to_tolerance = fields["tolerance"] is not None
    family: FamilyName = (
        "adaptive" if to_tolerance and not fields["family"] else fields.value("family")
    )
    for key, said in _contradictions(fields, family, len(sizes) > 1).items():
        if key and fields[key]:
            fields.fault(key, said, on_key=True)
    key, most = "max_levels" if to_tolerance else "levels", FAMILIES[family].max_levels
    levels = ctx.integer(node, 1, most) if (node := fields[key]) else min(fields.value(key), most)
    options, goal = (
        fields.given(name for name in fields.rows if name not in OF_MESH),
        _goal(ctx, fields),
    )
    options |= {"guarantee": True} if goal.proved else {}
    return MeshPlan(sizes, len(sizes) if len(sizes) > 1 else levels, family, goal=goal, **options)


def _contradictions(fields: Fields, family: FamilyName, listed: bool) -> dict[str, str]:
    strategy, to_tolerance = FAMILIES[family], fields["tolerance"] is not None
    used = {
        one.option: f"is for {name} meshes; add family: {name}, or remove it"
        for name, one in FAMILIES.items()
    }
    used.pop(strategy.option)
    if to_tolerance:
        used["levels"] = (
            "the tolerance decides how many levels there are; use max_levels for the most"
        )
    else:
        used["max_levels"] = "is for a tolerance; use levels, or add tolerance: 1e-3"
        used["of"] = "says what the tolerance is of, but there is none; use goal, or add tolerance"
        if not strategy.adapts:
            used["max_dofs"] = (
                "ends adaptive meshes and those for a tolerance; remove it, or add family: adaptive"
            )
    if listed:
        one = (
            "with a single maxh; give one maxh and levels (nested meshes), or a list of maxh alone"
        )
        used |= {key: f"{key} {'go' if key == 'levels' else 'goes'} {one}" for key in SINGLE}
        if (levels := fields["levels"]) and levels.value == 1:
            del used["levels"]
    if fields["of"]:
        used["goal"] = "of names the goal already; keep one of the two"
    elif not (strategy.adapts or to_tolerance or fields["estimate"]):
        used["goal"] = "no error is estimated here, so the goal is not used; add estimate: true"
    return used


def _goal(ctx: Context, fields: Fields) -> Goal:
    node, goal = fields["of"] or fields["goal"], Goal()
    if node and isinstance(node.value, Mapping):
        goal = Goal("u_T", Fields(ctx, node, "goal").value("u_T"))
    elif node:
        word: Any = ctx.choice(node, (*QUANTITIES, PROVED))
        goal = Goal(proved=True) if word == PROVED else Goal(word)
        if goal.quantity == "u_T":
            ctx.at(node, "u_T needs its point on a contact edge", "write {u_T: [20 mm, 0 mm]}")
    if fields["known"] and goal.quantity == "energy":
        fields.fault(
            "known",
            "a known value needs a goal that is a number; add goal: friction_resultant",
            on_key=True,
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
    fields, before = Fields(ctx, node, "solver"), len(ctx.errors)
    given = fields.given()
    names = given.pop("name", SolverPlan().names)
    read = len(ctx.errors) == before  # else a name may be another one than was written
    if read and len(set(names)) < len(names):
        fields.fault("name", "names a solver twice", "name each solver once")
    if read and BUNDLE not in names and fields["max_iterations"]:
        fields.fault(
            "max_iterations", f"is of {BUNDLE} alone", f"remove it, or choose name: {BUNDLE}"
        )
    every = given.get("branch") == ALL
    for key in ("max_boxes", "max_seconds"):
        if fields[key] and not every:
            fields.fault(key, f"is of branch: {ALL} alone", f"remove it, or choose branch: {ALL}")
    if every and names != SolverPlan().names:
        fields.fault("branch", f"is of {SEPARABLE} alone", "leave `name` out")
    return SolverPlan(
        names, **(given | {"branch": SolverPlan().branch, "every": True} if every else given)
    )


@none_after_fault
def read_output(ctx: Context, reader: SceneReader) -> OutputPlan:
    """Where the data go, and what is asked for beside the mandatory ones but derivatives; None
    after a fault."""
    if (node := reader.root.at("output")) is None:
        return OutputPlan()
    fields = Fields(ctx, node, "output")
    given = fields.given(key for key in fields.rows if key not in ("sensitivity", "probes"))
    if where := fields["path"]:
        text, path = given["path"], Path(given["path"])
        if fault := shell_name(text):
            ctx.at(where, f"{where.brief()!r} {fault[0]}", fault[1])
        elif text and (path.name in ("", "..") or text.endswith("/")):
            ctx.at(
                where, f"{where.brief()!r} names no file", "write a name such as results/study.nc"
            )
        given["path"] = path
    if (node := fields["quantities"]) and "section_force" in (given["quantities"] or ()):
        _check_section(ctx, node, reader)
    ctx.sound()
    return OutputPlan(**given, probes=_probes(ctx, fields["probes"], reader))


def _check_section(ctx: Context, node: Node, reader: SceneReader) -> None:
    """Sections are cut across one straight contact line; that of a body from a file shows on its
    mesh."""
    if reader.body is None or reader.body.outline is None or not reader.scenes:
        return
    edges = [edge for edge in reader.body.edges if edge.name in reader.scenes[0].edges(Contact)]
    along = np.array([np.subtract(edge.end, edge.start) for edge in edges])
    along /= np.hypot(*along.T)[:, None]
    bends = (
        any(edge.through for edge in edges)
        or np.abs(along @ [along[0, 1], -along[0, 0]]).max() > STRAIGHT
    )
    gaps = len({edge.start for edge in edges} - {edge.end for edge in edges}) > 1
    if bends or gaps:
        what = (
            f"section_force: the contact line {'is not straight' if bends else 'has several parts'}"
        )
        ctx.at(
            node,
            f"{what}, and no one section lies across it",
            "remove it; forces gives those of edges",
        )


def _probes(ctx: Context, node: Node | None, reader: SceneReader) -> tuple[Probe, ...]:
    """The probes; one outside the body is a fault. A body from a file is not judged, and has no u_T
    at probes."""
    if node is None:
        return ()
    before, point, body = (
        len(ctx.errors),
        replace(rows("output")["probes"], kind="point"),
        reader.body,
    )
    places = ctx.mapping(node, "names to points", "write {tip: [200 mm, 60 mm]}", named=True)
    probes = [Probe(name, ctx.value(place, point)) for name, place in places.items()]
    if body is None or body.outline is None or not reader.scenes or len(ctx.errors) > before:
        return tuple(probes)
    import shapely

    shape, contact = body_polygon(body), reader.scenes[0].edges(Contact)
    found = []
    for probe in probes:
        away = [float(edge_distance(edge, np.array([probe.at]))[0]) for edge in body.edges]
        on = [
            edge
            for edge, distance in zip(body.edges, away, strict=True)
            if distance <= NEAR * body_size(body)
        ]
        if not on and not shape.covers(shapely.Point(probe.at)):
            what = f"the point ({probe.at[0]:g}, {probe.at[1]:g}) is {min(away):g} outside the body"
            ctx.at(places[probe.name], what, "give a point of the body")
        found.append(replace(probe, on_contact=any(edge.name in contact for edge in on)))
    return tuple(found)
