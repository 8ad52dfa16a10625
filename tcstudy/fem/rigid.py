"""Rigid edges: an edge that moves as a whole has one unknown for each component that nothing prescribes.

With w the local unknowns of the nodes, w = T w' where every row of an edge and a component is ± that of one node, the
master; the stiffness becomes TᵀAT and a load TᵀF, so that what acts on any node of the edge acts on the edge.
A master on the contact line is a contact unknown like any other. An edge that turns has three unknowns (a_x, a_y, φℓ),
in rows of two of its nodes: u = a + φ × (x − x_m), x_m the middle of the edge, ℓ the length of its longest arm; TᵀF
are then its resultants and its moment over ℓ. Left out: edges that turn and meet another support.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from tcstudy.errors import GeometryFailed
from tcstudy.fem.meshes import EDGES, SMOOTH, Frames, PlaneMesh
from tcstudy.scene.records import Contact, Rigid, Role

Array = NDArray[np.float64]
Indices = NDArray[np.intp]


def with_ties(mesh: PlaneMesh, boundary: tuple[tuple[str, Role], ...], frames: Frames) -> Frames:
    """The frames with all nodes of a rigid edge tied to one, on the contact line if it meets it."""
    n, fixed = mesh.n_points, frames.fixed.copy()
    axes = np.tile(np.eye(2), (n, 1, 1))
    axes[frames.turned] = frames.axes
    contact = mesh.nodes_on(*(name for name, role in boundary if isinstance(role, Contact)))
    columns, signs = np.arange(2 * n), np.ones(2 * n)
    turning: list[tuple[Indices, Indices, Array]] = []
    for name, role in boundary:
        if isinstance(role, Rigid) and role.moment is not None:
            turning.append(
                _turning(mesh, name, fixed | (np.bincount(columns, minlength=2 * n) != 1) | (signs == 0.0), axes)
            )
            rows = np.unique(turning[-1][0])
            signs[rows], fixed[np.setdiff1d(rows, turning[-1][1])] = 0.0, True
            continue
        for c in unknown(role):
            nodes = mesh.nodes_on(name)
            nodes = nodes[np.argsort(~np.isin(nodes, contact), kind="stable")]
            row, sign = _rows_along(mesh, axes, fixed, nodes, c, name)
            if np.isin(nodes[1:2], contact).any():
                raise GeometryFailed(f"the rigid edge {name} meets contact at both ends; give one component", EDGES)
            columns[row[1:]], signs[row[1:]], fixed[row[1:]] = row[0], sign[1:] * sign[0], True
    parts = [(np.arange(2 * n), columns, signs), *turning]
    row, column, value = (np.concatenate(part) for part in zip(*parts, strict=True))
    ties = sp.csr_array((value, (row, column)), shape=(2 * n, 2 * n))
    ties.eliminate_zeros()
    return replace(frames, fixed=fixed, ties=ties)


def _turning(mesh: PlaneMesh, name: str, taken: NDArray[np.bool_], axes: Array) -> tuple[Indices, Indices, Array]:
    """(row, column, value) of T for the nodes of an edge that turns.

    taken: (2n,) rows that are held or tied already. Raises GeometryFailed where the edge meets such a node.
    """
    n, (nodes, _, arms) = mesh.n_points, edge_arms(mesh, name)
    wrong = taken[nodes] | taken[nodes + n] | (np.abs(axes[nodes] - np.eye(2)) > SMOOTH).any(axis=(1, 2))
    if wrong.any():
        x, y = mesh.points[nodes[np.argmax(wrong)]]
        what = f"the rigid edge {name} cannot turn: another edge holds it at ({x:g}, {y:g})"
        raise GeometryFailed(f"{what}; leave out its moment", EDGES)
    length, ones = float(np.hypot(*arms.T).max()), np.ones(len(nodes))
    a_x, a_y, turn = (np.full(len(nodes), row) for row in (nodes[0], nodes[0] + n, nodes[-1]))
    row = np.concatenate([nodes, nodes + n, nodes, nodes + n])
    value = np.concatenate([ones, ones, -arms[:, 1] / length, arms[:, 0] / length])
    return row, np.concatenate([a_x, a_y, turn, turn]), value


def edge_arms(mesh: PlaneMesh, name: str) -> tuple[Indices, Array, Array]:
    """(k,) nodes of an edge, (k,) their shares of its length and (k, 2) where they are from its middle [m]."""
    segments = mesh.segments[mesh.on(name)]
    half = 0.5 * np.hypot(*(mesh.points[segments[:, 1]] - mesh.points[segments[:, 0]]).T)
    share = np.bincount(segments.ravel(), np.repeat(half, 2), mesh.n_points)
    nodes = np.flatnonzero(share)
    share = share[nodes] / share.sum()
    return nodes, share, mesh.points[nodes] - share @ mesh.points[nodes]


def couple(mesh: PlaneMesh, name: str) -> Array:
    """A load of no resultant and the moment 1 about the middle of an edge, (2n,) in x and y."""
    nodes, share, arms = edge_arms(mesh, name)
    F = np.zeros((2, mesh.n_points))
    F[:, nodes] = share * np.array([-arms[:, 1], arms[:, 0]]) / (share @ np.sum(arms**2, axis=1))
    return F.ravel()


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
        if not fixed[row[wrong[0]]]:  # u_N = 0 on an inclined line, along which alone the edge could move
            what = f"the rigid edge {name} meets an edge that holds it in a slanted direction at ({x:g}, {y:g})"
            raise GeometryFailed(f"{what}; give it the role clamped, or let a free edge lie between the two", EDGES)
        what = f"the rigid edge {name} cannot move in {'xy'[c]}: another edge holds it at ({x:g}, {y:g})"
        raise GeometryFailed(f"{what}; give it u_{'xy'[c]}: 0", EDGES)
    return row, np.sign(sign)


def unknown(role: Role) -> list[int]:
    """The components of a rigid edge that nothing prescribes; none of another edge."""
    return [c for c, given in enumerate(role.u) if given is None] if isinstance(role, Rigid) else []
