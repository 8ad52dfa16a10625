"""What a study whose contact edges may lift off must not ask for, with reasons and remedies.

An edge opens if it is unilateral or has a law in the section `adhesion`. Its nodes have an unknown
along the normal beside the slip. Both have laws of their own, so that what else holds such a node
must hold it along the edge or across it. What is proved, estimated or remembered of the slip alone
is refused here.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from tcstudy.read.document import Node
from tcstudy.read.fields import Context
from tcstudy.scene.histories import HistoryPlan, Memory
from tcstudy.scene.mesh_plan import MeshPlan
from tcstudy.scene.records import Body, Boundary, Clamped, Contact, Edge, Free, Rigid, Role, Scene
from tcstudy.scene.study import OutputPlan
from tcstudy.shapes.edges import edge_normal
from tcstudy.shapes.rigid_motions import components

Array = NDArray[np.float64]
Fault = tuple[tuple[str, ...], str, str]
"""A key path, the fault there, and the remedy."""

RIGHT_ANGLE = 1e-9
"""Largest cosine or sine at which two directions count as orthogonal or parallel."""
SMOOTH = 1e-6
"""Sine of the largest angle at which two edges go on smoothly, as on a mesh."""


def corner_faults(body: Body, boundary: Boundary) -> Iterator[tuple[str, str, str]]:
    """Yield (edge, fault, remedy) of corners at which u_N of an edge that is not held is not alone.

    A body from a file has no corners here; those are found on its mesh.
    """
    roles = dict(boundary)
    for before, after in (pair for loop in body.loops for pair in loop.corners):
        for edge, other in ((before, after), (after, before)):
            role = roles.get(edge.name, Free())
            if not _moves_along_normal(role):
                continue
            other_role = roles.get(other.name, Free())
            if fault := _corner_fault((edge, role), (other, other_role), before.end):
                yield fault
                break


def _moves_along_normal(role: Role) -> bool:
    return isinstance(role, Contact) and role.normal != "held"


def _may_open(role: Role) -> bool:
    return isinstance(role, Contact) and role.opens


def _corner_fault(
    first: tuple[Edge, Role], second: tuple[Edge, Role], corner: tuple[float, float]
) -> tuple[str, str, str] | None:
    """Return the fault of the corner of an edge that is not held and another, with their roles."""
    edge, edge_role = first
    other, role = second
    point = np.array([corner])
    normal = edge_normal(edge, point)[0]
    other_normal = edge_normal(other, point)[0]
    place = f"({corner[0]:g}, {corner[1]:g})"
    meets = f"{edge.name}, which may move along its normal, at {place}"
    gap = "leave a short free edge between them"
    if isinstance(role, Rigid):
        return edge.name, f"the rigid edge {other.name} meets {meets}", gap
    if _moves_along_normal(role):
        is_smooth = abs(other_normal @ _turned(normal)) <= SMOOTH
        is_upright = abs(other_normal @ normal) <= RIGHT_ANGLE
        if is_smooth or is_upright or not (_may_open(edge_role) and _may_open(role)):
            return None
        fault = f"{other.name}, which may move along its normal, meets {meets}, at an oblique angle"
        return edge.name, f"{fault}: their laws are not of two directions", gap
    if not isinstance(role, Clamped | Contact):
        return None
    directions = [np.array(d) for *d, _ in components(role.frame, role.u, other_normal)]
    if len(directions) != 1:
        return None
    (d,) = directions
    if min(abs(d @ normal), abs(d @ _turned(normal))) <= RIGHT_ANGLE:
        return None
    return edge.name, f"{other.name} is a slanted guide and meets {meets}", gap


def _turned(normal: Array) -> Array:
    """Return the tangent t = (−n₂, n₁)."""
    return np.array([-normal[1], normal[0]])


def check_opening(
    ctx: Context,
    root: Node,
    scenes: Sequence[Scene],
    mesh: MeshPlan | None,
    output: OutputPlan | None,
    history: HistoryPlan | None,
) -> None:
    """Record what a study asks for and cannot have where contact is not bilateral.

    scenes: its points, none after a fault
    mesh, output, history: None where a section has faults, or is not there
    """
    faults = [*_of_proofs(root, mesh), *_of_estimates(root, mesh, scenes)]
    if any(scene.opens for scene in scenes[:1]):
        faults += _of_requests(output)
        if history is not None:
            faults += _of_memory(history.memory, scenes[0])
    for keys, fault, remedy in faults:
        ctx.at(root.nearest(*keys), fault, remedy)


def _of_proofs(root: Node, mesh: MeshPlan | None) -> Iterator[Fault]:
    """Yield what is asked of errors that is proved or known of the slip alone."""
    if mesh is not None and mesh.bounds_errors:
        fault = f"errors are bounded for {BILATERAL}"
        yield ("mesh", "guarantee"), fault, "remove guarantee, and compare levels instead"
    if root.at("exact"):
        fault = f"an exact solution is of {BILATERAL}"
        yield ("exact",), fault, "remove exact, and compare levels instead"


def _of_estimates(root: Node, mesh: MeshPlan | None, scenes: Sequence[Scene]) -> Iterator[Fault]:
    """Yield estimates of errors of goals, and those of solutions without an energy."""
    if mesh is None or not mesh.estimates:
        return
    if mesh.goal.quantity != "energy":
        key = next(key for key in ("of", "goal") if root.at("mesh", key))
        fault = f"errors of {mesh.goal.quantity} are estimated for {BILATERAL}"
        yield ("mesh", key), fault, "remove it: meshes then follow the energy norm"
    if any(scene.knows_pressure for scene in scenes):
        key = next((key for key in ("tolerance", "estimate", "family") if root.at("mesh", key)), "")
        fault = "errors are estimated in energy, and friction that follows the pressure has none"
        remedy = "use a uniform or graded family without it, with levels"
        yield ("mesh", key), fault, remedy


BILATERAL = "bilateral contact, and an edge is not held along its normal here"


def _of_requests(output: OutputPlan | None) -> Iterator[Fault]:
    """Yield what is asked of solutions and is not known of edges that open."""
    if output is not None and output.live:
        fault = "a live page solves for the slip alone, and an edge may open"
        yield ("output", "live"), fault, "remove live: true"


def _of_memory(memory: Memory, scene: Scene) -> Iterator[Fault]:
    """Yield adhesive edges whose memory is none of an opening, which has one side."""
    for edge in scene.adhesive_edges:
        name = dict(memory.edges).get(edge, memory.name)
        if name != "damage":
            fault = f"{edge} opens by a law of one side, which has no memory {name}"
            remedy = "write memory: damage"
            if len(scene.edges(Contact)) > 1:
                remedy = f"write memory: {{{edge}: damage, ...}}"
            yield ("history", "memory"), fault, remedy
