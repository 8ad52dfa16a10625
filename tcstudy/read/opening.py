"""What a study whose contact edges may lift off must not ask for, with reasons and remedies.

An edge opens if it is unilateral or has a law in the section `adhesion`. Its nodes have an unknown
along the normal beside the slip. Laws of both directions add up node by node, so that every corner
must be one of two orthogonal directions. What is proved, estimated or remembered of the slip alone
is refused here.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping

import numpy as np

from tcstudy.read.body import components
from tcstudy.read.document import Node
from tcstudy.read.fields import Context
from tcstudy.scene.mesh_plan import MeshPlan
from tcstudy.scene.records import Body, Boundary, Clamped, Contact, Edge, Free, Rigid, Role
from tcstudy.scene.solver_plan import SolverPlan
from tcstudy.scene.study import OutputPlan
from tcstudy.shapes.edges import edge_normal

Fault = tuple[tuple[str, ...], str, str]
"""A key path, the fault there, and the remedy."""

RIGHT_ANGLE = 1e-9
"""Largest cosine or sine at which two directions count as orthogonal or parallel."""
SOLVED = False
"""Whether the solver has unknowns along the normal."""


def corner_faults(body: Body, boundary: Boundary) -> Iterator[tuple[str, str, str]]:
    """Yield (edge, fault, remedy) of every corner at which an edge that opens meets another badly.

    A body from a file has no corners here; those are found on its mesh.
    """
    roles = dict(boundary)
    for edges in (pair for loop in body.loops for pair in loop.corners):
        before, after = edges
        for edge, other in ((before, after), (after, before)):
            role = roles.get(edge.name, Free())
            if isinstance(role, Contact) and role.opens:
                other_role = roles.get(other.name, Free())
                if fault := _corner_fault(edge, other, other_role, before.end):
                    yield fault
                    break


def _corner_fault(
    edge: Edge, other: Edge, role: Role, corner: tuple[float, float]
) -> tuple[str, str, str] | None:
    """Return the fault of the corner of an edge that opens and another with this role."""
    point = np.array([corner])
    normal = edge_normal(edge, point)[0]
    tangent = np.array([-normal[1], normal[0]])
    other_normal = edge_normal(other, point)[0]
    place = f"({corner[0]:g}, {corner[1]:g})"
    if isinstance(role, Contact):
        cosine, sine = abs(other_normal @ normal), abs(other_normal @ tangent)
        if role.normal == "free" or min(cosine, sine) <= RIGHT_ANGLE:
            return None
        angle = np.degrees(np.arctan2(sine, cosine))
        fault = (
            f"{edge.name} may open and meets {other.name} at {place} with normals {angle:.4g} "
            "degrees apart: slip on one would be opening on the other, in no two independent laws"
        )
        remedy = (
            "draw a right angle or a straight joint, leave a short free edge between them, "
            f"or write {other.name}: {{role: contact, normal: free}}"
        )
        return edge.name, fault, remedy
    if isinstance(role, Rigid):
        fault = f"the rigid edge {other.name} meets {edge.name}, which may open, at {place}"
        return edge.name, fault, "leave a short free edge between them, or clamp the other edge"
    if not isinstance(role, Clamped):
        return None
    directions = [np.array(d) for *d, _ in components(role.frame, role.u, other_normal)]
    if len(directions) != 1:
        return None
    (d,) = directions
    if min(abs(d @ normal), abs(d @ tangent)) <= RIGHT_ANGLE:
        return None
    fault = f"a slanted guide, {other.name}, meets {edge.name}, which may open, at {place}"
    return edge.name, fault, "end the bond before it: leave a short free edge between them"


def check_opening(
    ctx: Context,
    root: Node,
    places: tuple[Node, ...],
    mesh: MeshPlan | None,
    solver: SolverPlan | None,
    output: OutputPlan | None,
) -> None:
    """Record what a study with edges that open asks for and cannot have.

    places: where it says that edges are not held along the normal
    mesh, solver, output: None where a section has faults
    """
    if not SOLVED:
        fault = "bonds that open are read, but cannot be solved yet"
        ctx.at(places[0], fault, "leave out adhesion and normal, and contact is bilateral")
        return
    for keys, fault, remedy in (*_of_proofs(root, mesh), *_of_requests(root, solver, output)):
        ctx.at(root.nearest(*keys), fault, remedy)


def _of_proofs(root: Node, mesh: MeshPlan | None) -> Iterator[Fault]:
    """Yield what is asked of errors: they are proved and estimated of the slip alone."""
    if mesh is not None and mesh.bounds_errors:
        fault = "errors are bounded for bilateral contact, and an edge may open here"
        yield ("mesh", "guarantee"), fault, "remove guarantee, and compare levels instead"
    if mesh is not None and mesh.estimates:
        key = next((key for key in ("tolerance", "estimate", "family") if root.at("mesh", key)), "")
        fault = "errors are estimated for bilateral contact, and an edge may open here"
        yield ("mesh", key), fault, "use a uniform or graded family without it, with levels"
    if root.at("exact"):
        fault = "an exact solution is of bilateral contact, and an edge may open here"
        yield ("exact",), fault, "remove exact, and compare levels instead"


def _of_requests(
    root: Node, solver: SolverPlan | None, output: OutputPlan | None
) -> Iterator[Fault]:
    """Yield what is asked of solutions and is not known of edges that open."""
    for key, reason in UNKNOWN.items():
        if root.at(*key.split(".")) is not None:
            yield tuple(key.split(".")), f"{reason} where an edge may open", f"remove {key}"
    if solver is not None and solver.every:
        fault = "all solutions are sought of the slip alone, and an edge may open"
        yield ("solver", "branch"), fault, "write branch: lowest"
    if output is not None and output.live:
        fault = "a live page solves for the slip alone, and an edge may open"
        yield ("output", "live"), fault, "remove live: true"


UNKNOWN: Mapping[str, str] = {
    "path": "no path is followed",
    "history": "no history is followed",
    "fit": "no law is fitted",
    "output.sensitivity": "no result is differentiated",
    "output.quantities": "these results are not known",
}
"""Keys that a study with edges that open cannot have yet, with the reason."""
