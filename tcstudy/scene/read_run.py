"""Reads the sections that say how a study is run: `solver`, `output`; read_mesh.py has `mesh`."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from tcstudy.scene import walker
from tcstudy.scene.fields import Fields
from tcstudy.scene.node import Node
from tcstudy.scene.records import Branch, OutputPlan, SolverPlan
from tcstudy.scene.units import NONE
from tcstudy.scene.walker import Context

SOLVERS = ("separable-newton", "bundle-newton")
BRANCHES: tuple[Branch, ...] = ("lowest", "continued", "from-zero")


def read_solver(ctx: Context, node: Node | None) -> SolverPlan | None:
    """The solver by name, with its options; None after a fault."""
    default = SolverPlan()
    if node is None:
        return default
    before = len(ctx.errors)
    if not isinstance(node.value, Mapping):
        names = _solvers(ctx, node)
        return SolverPlan(names) if len(ctx.errors) == before else None
    fields = Fields(ctx, node, (), ("name", "tolerance", "max_iterations", "branch"))
    names = _solvers(ctx, value) if (value := fields["name"]) else default.names
    tolerance = fields.quantity("tolerance", NONE, "positive", 0.0) or default.tolerance
    if tolerance is not None and tolerance >= 1.0:
        remedy = "write for example 1e-10"
        ctx.errors.at(fields.values["tolerance"], f"must be less than 1, but is {tolerance:g}", remedy)
    limit = walker.integer(ctx, value, 1) if (value := fields["max_iterations"]) else None
    branch = walker.choice(ctx, value, BRANCHES) if (value := fields["branch"]) else default.branch
    return SolverPlan(names, tolerance, limit, branch) if len(ctx.errors) == before else None


def _solvers(ctx: Context, node: Node) -> tuple[str, ...]:
    """One solver by name, or a list of several to compare."""
    if not isinstance(node.value, tuple):
        return (walker.choice(ctx, node, SOLVERS),)
    names = tuple(walker.choice(ctx, item, SOLVERS) for item in walker.items(ctx, node, "a list of solvers", 1))
    if len(set(names)) < len(names):
        ctx.errors.at(node, "names a solver twice", "name each solver once")
    return names


def read_output(ctx: Context, node: Node | None) -> OutputPlan | None:
    """Where the data go; None after a fault."""
    if node is None:
        return OutputPlan()
    before = len(ctx.errors)
    if not isinstance(node.value, Mapping):
        path: Path | None = Path(walker.text(ctx, node, "a path"))
        fields = None
    else:
        fields = Fields(ctx, node, (), ("path", "fields", "live"))
        path = Path(walker.text(ctx, value, "a path")) if (value := fields["path"]) else None
    kept = walker.flag(ctx, value) if fields and (value := fields["fields"]) else False
    live = walker.flag(ctx, value) if fields and (value := fields["live"]) else False
    return OutputPlan(path, kept, live) if len(ctx.errors) == before else None
