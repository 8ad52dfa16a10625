"""Rigid edges: an edge that moves as a whole has one unknown for each component that nothing prescribes.

With w the local unknowns of the nodes, w = T w' where every row of an edge and a component is ± that of one node, the
master; the stiffness becomes TᵀAT and a load TᵀF, so that what acts on any node of the edge acts on the edge.
A master on the contact line is a contact unknown like any other. Left out: edges that turn.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from tcstudy.errors import GeometryFailed
from tcstudy.fem.boundary import EDGES, SMOOTH, Frames
from tcstudy.fem.meshes import PlaneMesh
from tcstudy.scene.records import Contact, Rigid, Role

Array = NDArray[np.float64]
Indices = NDArray[np.intp]


def with_ties(mesh: PlaneMesh, boundary: tuple[tuple[str, Role], ...], frames: Frames) -> Frames:
    """The frames with all nodes of a rigid edge tied to one, on the contact line if it meets it."""
    n, fixed = mesh.n_points, frames.fixed.copy()
    axes = np.tile(np.eye(2), (n, 1, 1))
    axes[frames.turned] = frames.axes
    contact = nodes_of(mesh, *(name for name, role in boundary if isinstance(role, Contact)))
    columns, signs = np.arange(2 * n), np.ones(2 * n)
    for name, role in boundary:
        for c in unknown(role):
            nodes = nodes_of(mesh, name)
            nodes = nodes[np.argsort(~np.isin(nodes, contact), kind="stable")]
            row, sign = _rows_along(mesh, axes, fixed, nodes, c, name)
            if np.isin(nodes[1:2], contact).any():
                raise GeometryFailed(f"the rigid edge {name} meets contact at both ends; give one component", EDGES)
            columns[row[1:]], signs[row[1:]], fixed[row[1:]] = row[0], sign[1:] * sign[0], True
    ties = sp.csr_array((signs, (np.arange(2 * n), columns)), shape=(2 * n, 2 * n))
    return replace(frames, fixed=fixed, ties=ties)


def nodes_of(mesh: PlaneMesh, *names: str) -> Indices:
    """Nodes on the closure of the study edges of these names, ascending."""
    curves = [i for i, curve in enumerate(mesh.geometry.curves) if curve.name in names]
    return np.unique(mesh.segments[np.isin(mesh.segment_curve, curves)])


def _rows_along(
    mesh: PlaneMesh, axes: Array, fixed: NDArray[np.bool_], nodes: Indices, c: int, name: str
) -> tuple[Indices, Array]:
    """(k,) the local rows that are ± u_x or u_y at nodes, and the signs.

    Raises GeometryFailed where another edge holds that component, or a slanted part of it.
    """
    along = axes[nodes, c]
    local = np.argmax(np.abs(along), axis=1)
    sign, row = along[np.arange(len(nodes)), local], nodes + mesh.n_points * local
    wrong = np.flatnonzero((np.abs(np.abs(sign) - 1.0) > SMOOTH) | fixed[row])
    if len(wrong):
        x, y = mesh.points[nodes[wrong[0]]]
        what = f"the rigid edge {name} cannot move in {'xy'[c]}: another edge holds it at ({x:g}, {y:g})"
        raise GeometryFailed(f"{what}; give it u_{'xy'[c]}: 0", EDGES)
    return row, np.sign(sign)


def unknown(role: Role) -> list[int]:
    """The components of a rigid edge that nothing prescribes; none of another edge."""
    return [c for c, given in enumerate(role.u) if given is None] if isinstance(role, Rigid) else []
