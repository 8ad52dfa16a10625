"""Frames of the nodes of contact edges that are not held along their normal.

Such a node has the frame (t, −n), so that its local rows are (u_T, s_N) with the opening
s_N = −u_N.

Normals: of the exact curve, the mean of both segments at a node weighted by their lengths
Ends:    a node that is held altogether has no unknown. One that is held in one direction has its
         other component, if that direction is tangential or normal; a condition along any other
         direction would couple u_T and u_N, which have laws of their own
Corners:  of two edges that are not held have the frame (−n₂, −n₁) of both openings and no slip:
          half cells of slips go to the neighbours, as at every corner of Γ_C. At other than right
          angles one of the edges must be free along its normal
Left out: rigid edges that meet such an edge
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from tcstudy.errors import GeometryFailed
from tcstudy.fem.meshes import EDGES, SMOOTH, Frames, PlaneMesh
from tcstudy.scene.records import Boundary, Contact, Rigid

Array = NDArray[np.float64]
Indices = NDArray[np.intp]

RIGHT_ANGLE = 1e-9
"""Cosine of the angle of two directions below which they are at right angles."""


def with_openings(mesh: PlaneMesh, boundary: Boundary, frames: Frames) -> Frames:
    """Return the frames with (t, −n) at the nodes of contact edges that are not held.

    Raises GeometryFailed where tangential and normal component cannot be told apart.
    """
    names = [name for name, role in boundary if isinstance(role, Contact) and role.normal != "held"]
    n = mesh.n_points
    on_edges = mesh.on(*names)
    segments = mesh.segments[on_edges]
    normals = mesh.end_normals[on_edges]
    sums = np.zeros((n, 2))
    weighted = mesh.boundary.length[on_edges][:, None, None] * normals
    np.add.at(sums, segments, weighted)
    is_held = frames.fixed[:n] & frames.fixed[n:]
    nodes = np.unique(segments)
    nodes = nodes[~is_held[nodes]]
    size = np.linalg.norm(sums, axis=1, keepdims=True)
    normal = np.divide(sums, size, out=np.zeros((n, 2)), where=size > 0.0)
    deviation = np.linalg.norm(normals - normal[segments], axis=2)
    is_corner = np.zeros(n, dtype=bool)
    is_corner[segments[deviation > SMOOTH]] = True
    rigid = mesh.nodes_on(*(name for name, role in boundary if isinstance(role, Rigid)))
    _refuse(
        mesh,
        np.intersect1d(nodes, rigid),
        "a rigid edge meets a contact edge that is not held",
        "let a free edge lie between the two, or give the contact edge normal: held",
    )
    smooth = nodes[~is_corner[nodes]]
    turned = _turned(mesh, frames, smooth, normal[smooth])
    return _with_corners(mesh, boundary, turned, nodes[is_corner[nodes]])


def _with_corners(mesh: PlaneMesh, boundary: Boundary, frames: Frames, corners: Indices) -> Frames:
    """Return the frames with the openings of both edges at corners (k,) as rows.

    Raises GeometryFailed where these are not at right angles and both have a law.
    """
    roles = dict(boundary)
    axes = frames.axes.copy()
    for node in corners.tolist():
        normals = list[Array]()
        may_open = list[bool]()
        for side in (0, 1):  # of the edge that begins and of that which ends
            segment = int(np.flatnonzero(mesh.segments[:, side] == node)[0])
            name = mesh.geometry.curves[mesh.segment_curve[segment]].name
            role = roles[name]
            normals.append(mesh.end_normals[segment, side])
            may_open.append(isinstance(role, Contact) and role.opens)
        is_oblique = bool(abs(normals[0] @ normals[1]) >= RIGHT_ANGLE)
        _refuse(
            mesh,
            np.array([node] if is_oblique and all(may_open) else [], dtype=np.intp),
            "two edges of the contact line that may lift off meet at an oblique angle",
            "let a free edge lie between them, or give one of them normal: held or free",
        )
        first = 0 if may_open[0] else 1
        second = 1 - first
        across = np.array([-normals[first][1], normals[first][0]])
        axes[node, :, first] = -normals[first]
        axes[node, :, second] = -np.sign(across @ normals[second]) * across
    return replace(frames, axes=axes, corners=corners)


def _turned(mesh: PlaneMesh, frames: Frames, nodes: Indices, normal: Array) -> Frames:
    """Return the frames with (t, −n) at nodes, whose conditions stay.

    nodes: (k,) held in one direction at most;  normal: (k, 2) outward
    Raises GeometryFailed for a condition along a direction that is neither t nor n.
    """
    n = mesh.n_points
    one = frames.fixed[n + nodes]
    direction = np.where(one[:, None], frames.axes[nodes, :, 1], normal)
    tangent = np.column_stack([-normal[:, 1], normal[:, 0]])
    along_normal = np.einsum("ij,ij->i", direction, normal)
    along_tangent = np.einsum("ij,ij->i", direction, tangent)
    holds_u_T = one & (np.abs(along_normal) < RIGHT_ANGLE)
    is_slanted = one & ~holds_u_T & (np.abs(along_tangent) >= RIGHT_ANGLE)
    _refuse(
        mesh,
        nodes[is_slanted],
        "a slanted guide meets a contact edge that is not held",
        "end the contact edge before it",
    )
    # the condition keeps its own direction to the last digit
    sign = np.sign(np.where(holds_u_T, along_tangent, along_normal))[:, None]
    turned_back = np.column_stack([direction[:, 1], -direction[:, 0]])
    exact_normal = sign * np.where(holds_u_T[:, None], turned_back, direction)
    t = np.column_stack([-exact_normal[:, 1], exact_normal[:, 0]])
    axes = frames.axes.copy()
    fixed = frames.fixed.copy()
    values = frames.values.copy()
    axes[nodes] = np.stack([t, -exact_normal], axis=2)
    prescribed = sign[:, 0] * values[n + nodes]
    fixed[nodes] = holds_u_T
    fixed[n + nodes] = one & ~holds_u_T
    values[nodes] = np.where(holds_u_T, prescribed, 0.0)
    values[n + nodes] = np.where(holds_u_T, 0.0, -prescribed)
    return replace(frames, axes=axes, fixed=fixed, values=values)


def _refuse(mesh: PlaneMesh, nodes: Indices, fault: str, remedy: str) -> None:
    """Raise GeometryFailed if there are nodes, with the place of the first."""
    if len(nodes):
        x, y = mesh.points[nodes[0]]
        raise GeometryFailed(f"{fault} at ({x:g}, {y:g}); {remedy}", EDGES)
