"""Reads the section `mesh` (or `h` of a sweep): element sizes, the family of meshes, and when refinement stops.

Reads the sections that say how a study is run: `solver`, `output`; read_mesh.py has `mesh`.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Any, get_args

from tcstudy.read.fields import Context, Fields
from tcstudy.read.node import Node
from tcstudy.scene.families import FAMILIES, PLAIN, TO_TOLERANCE, FamilyName
from tcstudy.scene.keys import rows
from tcstudy.scene.study import MOST_REFINE, SOLVERS, Goal, MeshPlan, OutputPlan, Quantity, SolverPlan
from tcstudy.scene.units import LENGTH, LINE_FORCE

ROWS = rows("mesh")
LEVELS_TO_TOLERANCE = 30
QUANTITIES: tuple[Quantity, ...] = get_args(Quantity)
OPTIONS = tuple(name for name in ROWS if name != "maxh")
IN_SWEEP = ("tolerance", "of", "max_levels", "known")
"""Keys that h: {tolerance: …} of a sweep may hold."""


@dataclass(frozen=True)
class _Options:
    """Where each option stands: the section `mesh`, with the keys of the sweep's `h` put in."""

    ctx: Context
    values: Mapping[str, Node]

    def __getitem__(self, key: str) -> Node | None:
        return self.values.get(key)

    def choice(self, key: str) -> Any:
        """The word of a key that is given."""
        return self.ctx.choice(self.values[key], ROWS[key].words)

    def fault(self, key: str, what: str, remedy: str) -> None:
        self.ctx.errors.at(self.values[key], what, remedy, on_key=True)


def read_mesh(ctx: Context, node: Node | None, h: Node | None) -> MeshPlan | None:
    """The meshes, coarse to fine; None after a fault.

    h: of the sweep: a list of sizes in place of maxh, or a mapping {tolerance, of, …}
    """
    before = len(ctx.errors)
    listed = h if h and isinstance(h.value, tuple) else None
    required, optional = ((), ("maxh", *OPTIONS)) if listed else (("maxh",), OPTIONS)
    if node is None and not listed:  # the missing section is recorded already
        return None
    fields = Fields(ctx, node, "mesh", required, optional) if node else None
    given = listed or (fields["maxh"] if fields else None)
    values = dict(fields.values) if fields else {}
    if h and not listed:
        swept = Fields(ctx, h, "mesh", ("tolerance",), IN_SWEEP[1:])
        for key in sorted(swept.values.keys() & values.keys()):
            ctx.errors.at(swept.values[key], f"mesh.{key} is given, too", "give it once", on_key=True)
        values |= swept.values
    options = _Options(ctx, values)
    sizes = () if given is None else _sizes(ctx, given)
    single = given is not None and not isinstance(given.value, tuple)
    plan = _plan(options, sizes, single or len(sizes) == 1)
    return plan if len(ctx.errors) == before and sizes else None


def _plan(options: _Options, sizes: tuple[float, ...], single: bool) -> MeshPlan:
    ctx = options.ctx
    tolerance = _fraction(options, "tolerance", 0.0) or None
    default = PLAIN if tolerance is None else TO_TOLERANCE
    family: FamilyName = options.choice("family") if options["family"] else default
    _check_keys(options, family, sizes, single)
    most = FAMILIES[family].max_levels
    key = "levels" if tolerance is None else "max_levels"
    usual = 1 if tolerance is None else min(LEVELS_TO_TOLERANCE, most)
    levels = ctx.integer(node, 1, most) if (node := options[key]) else usual
    basic = MeshPlan(sizes, levels if single else len(sizes))
    return MeshPlan(
        maxh=basic.maxh,
        levels=basic.levels,
        family=family,
        grading=_fraction(options, "grading", basic.grading),
        marking=_fraction(options, "marking", basic.marking),
        goal=_goal(options),
        tolerance=tolerance,
        max_dofs=ctx.integer(node, 1) if (node := options["max_dofs"]) else basic.max_dofs,
        estimate=ctx.flag(node) if (node := options["estimate"]) else False,
        refine=ctx.integer(node, 0, MOST_REFINE) if (node := options["refine"]) else basic.refine,
    )


def _check_keys(options: _Options, family: FamilyName, sizes: tuple[float, ...], single: bool) -> None:
    """Keys that contradict one another."""
    to_tolerance = "tolerance" in options.values
    if not single:
        if not sizes or any(not b < a for a, b in pairwise(sizes)):  # the sizes have faults of their own
            return
        remedy = "give one maxh and levels (nested meshes), or a list of maxh alone"
        for key in ("levels", "family", "tolerance", "max_levels"):
            one_level = key == "levels" and (node := options[key]) is not None and node.value == 1
            if key in options.values and not one_level:
                what = "levels go with a single maxh" if key == "levels" else f"{key} goes with a single maxh"
                options.fault(key, what, remedy)
        return
    wrong = {
        one.option: (one is not FAMILIES[family], f"is for {name} meshes", f"add family: {name}, or remove it")
        for name, one in FAMILIES.items()
        if one.option
    } | {
        "levels": (to_tolerance, "the tolerance decides how many levels there are", "use max_levels for the most"),
        "max_levels": (not to_tolerance, "is for a tolerance", "use levels, or add tolerance: 1e-3"),
        "of": (not to_tolerance, "says what the tolerance is of, but there is none", "use goal, or add tolerance"),
    }
    if "goal" in options.values:
        estimated = FAMILIES[family].adapts or to_tolerance or "estimate" in options.values
        wrong["goal"] = (
            ("of" in options.values, "of names the goal already", "keep one of the two")
            if "of" in options.values
            else (not estimated, "no error is estimated here, so the goal is not used", "add estimate: true")
        )
    for key, (bad, what, remedy) in wrong.items():
        if bad and key in options.values:
            options.fault(key, what, remedy)


def _fraction(options: _Options, key: str, default: float) -> float:
    """A number between 0 and 1."""
    node = options[key]
    if node is None:
        return default
    known = ROWS[key]
    value, least = options.ctx.quantity(node, known.dimension, known.sign), known.least or 0.0
    if value >= 1.0 or value < least:
        bound = "less than 1" if value >= 1.0 else f"{least:g} or more"
        options.ctx.errors.at(node, f"must be {bound}, but is {value:g}", f"write for example {known.example}")
    return value


def _goal(options: _Options) -> Goal:
    """The quantity by name, or {u_T: [x, y]}; with its known value."""
    ctx = options.ctx
    node = options["of"] or options["goal"]
    goal = Goal()
    if node and isinstance(node.value, Mapping):
        fields = Fields(ctx, node, "goal")
        goal = Goal("u_T", fields.point("u_T"))
    elif node:
        goal = Goal(ctx.choice(node, QUANTITIES))
        if goal.quantity == "u_T":
            ctx.errors.at(node, "u_T needs its point on a contact edge", "write {u_T: [20 mm, 0 mm]}")
    known = options["known"]
    if known is None:
        return goal
    if goal.quantity == "energy":
        options.fault("known", "a known value needs a goal that is a number", "add goal: friction_resultant")
        return goal
    dimension = LINE_FORCE if goal.quantity == "friction_resultant" else LENGTH
    value = ctx.quantity(known, dimension)
    return Goal(goal.quantity, goal.at, None if math.isnan(value) else value)


def _sizes(ctx: Context, node: Node) -> tuple[float, ...]:
    """One element size, or a decreasing list of them."""
    if not isinstance(node.value, tuple):
        return (ctx.quantity(node, LENGTH, "positive"),)
    sizes = [ctx.quantity(item, LENGTH, "positive") for item in ctx.items(node, "a list of sizes", 1)]
    for i in range(1, len(sizes)):
        if sizes[i] >= sizes[i - 1]:
            remedy = "order the sizes from coarse to fine, each once"
            ctx.errors.at(node.value[i], f"{sizes[i]:g} does not decrease after {sizes[i - 1]:g}", remedy)
    return tuple(sizes)


def read_solver(ctx: Context, node: Node | None) -> SolverPlan | None:
    """The solver by name, with its options; None after a fault."""
    default = SolverPlan()
    if node is None:
        return default
    before = len(ctx.errors)
    if not isinstance(node.value, Mapping):
        names = _solvers(ctx, node)
        return SolverPlan(names) if len(ctx.errors) == before else None
    fields = Fields(ctx, node, "solver")
    names = _solvers(ctx, value) if (value := fields["name"]) else default.names
    tolerance = fields.quantity("tolerance", 0.0) or default.tolerance
    if tolerance is not None and tolerance >= 1.0:
        remedy = "write for example 1e-10"
        ctx.errors.at(fields.values["tolerance"], f"must be less than 1, but is {tolerance:g}", remedy)
    limit, branch = fields.integer("max_iterations"), fields.choice("branch")
    return SolverPlan(names, tolerance, limit, branch) if len(ctx.errors) == before else None


def _solvers(ctx: Context, node: Node) -> tuple[str, ...]:
    """One solver by name, or a list of several to compare."""
    if not isinstance(node.value, tuple):
        return (ctx.choice(node, SOLVERS),)
    names = tuple(ctx.choice(item, SOLVERS) for item in ctx.items(node, "a list of solvers", 1))
    if len(set(names)) < len(names):
        ctx.errors.at(node, "names a solver twice", "name each solver once")
    return names


def read_output(ctx: Context, node: Node | None) -> OutputPlan | None:
    """Where the data go; None after a fault."""
    if node is None:
        return OutputPlan()
    before = len(ctx.errors)
    if not isinstance(node.value, Mapping):
        plan = OutputPlan(Path(ctx.text(node, "a path")))
    else:
        fields = Fields(ctx, node, "output")
        path = fields.text("path", "a path")
        plan = OutputPlan(None if path is None else Path(path), fields.flag("fields"), fields.flag("live"))
    return plan if len(ctx.errors) == before else None
