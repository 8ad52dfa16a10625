"""What does not go together: a scene with one of these features is refused what its theory or its code does not have.

A row says what the feature is, and for each thing that it excludes why and what to do: one line a fault.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from tcstudy.read.fields import Context
from tcstudy.read.node import Node
from tcstudy.scene.points import distinct
from tcstudy.scene.records import EdgeLaws, Rigid, Scene
from tcstudy.scene.study import Exact, MeshPlan, OutputPlan


@dataclass(frozen=True)
class Asked:
    """What a study asks for beside its scenes; None for what it does not, or has faults in."""

    mesh: MeshPlan | None
    output: OutputPlan | None
    exact: Exact | None


Why = tuple[str, str]
"""Why something is excluded, what to do."""

GOALS = ("errors of goals are not estimated then", "estimate the energy norm, or use tcstudy converge")


def _one(what: str) -> dict[str, Why]:
    """Exclusions of a scene that has several of what others have one of."""
    return {
        "goals": GOALS,
        "exact": (f"an exact solution takes one {what}", f"remove exact, or write one {what}"),
        "live": (f"a live page takes one {what}", "remove live: true"),
    }


OF_BODY: dict[str, Why] = {
    "goals": GOALS,
    "exact": ("an exact solution has no such edge", "remove exact"),
    "live": ("a live page takes none", "remove live: true"),
}
"""Of a body that not its material alone makes stiff."""

FEATURES: tuple[tuple[str, Callable[[Node, Sequence[Scene]], bool], dict[str, Why]], ...] = (
    (
        "friction differs along the contact line",
        lambda _, scenes: any(isinstance(scene.friction, EdgeLaws) for scene in distinct(scenes, "friction")),
        _one("law"),
    ),
    (
        "materials differ by region, where stresses jump",
        lambda root, _: root.child("materials") is not None,
        _one("material"),
    ),
    (
        "an edge is rigid",
        lambda _, scenes: bool(scenes) and any(isinstance(role, Rigid) for _, role in scenes[0].boundary),
        OF_BODY,
    ),
    (
        "an edge rests on springs",
        lambda _, scenes: any(scene.springs for scene in distinct(scenes, "boundary")),
        OF_BODY,
    ),
    (
        "an edge has heat of its own",
        lambda _, scenes: bool(scenes) and scenes[0].heat_by_edge,
        {
            "derived": ("loads are derived for the section heat only", "give the loads, or loads: given"),
            "live": ("a live page takes one alpha and one theta_bar", "remove live: true"),
        },
    ),
)


def check_together(ctx: Context, root: Node, scenes: Sequence[Scene], asked: Asked) -> None:
    """Report what a feature of the scenes excludes and the study asks for."""
    output, exact = asked.output, asked.exact
    wanted = {
        "goals": ("mesh", bool(asked.mesh and asked.mesh.estimates and asked.mesh.goal.quantity != "energy")),
        "exact": ("exact", exact is not None),
        "derived": ("exact", bool(exact and exact.derived)),
        "live": ("output", bool(output and output.live)),
    }
    for feature, has, excluded in FEATURES:
        if not any(wanted[what][1] for what in excluded) or not has(root, scenes):
            continue
        for what, (why, remedy) in excluded.items():
            section, there = wanted[what]
            if there and (node := root.child(section)):
                ctx.errors.at(node, f"{feature}, and {why}", remedy)
