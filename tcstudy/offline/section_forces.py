"""Forces of a solved scene by equilibrium: of every edge on the body, with its work, and of sections along Γ_C.

Edges:    what loads, springs and supports of an edge do at its nodes: g, p, resultants, −S_e u, and r = Au + Su − l_θ
          where the edge holds or touches the body; their sum with ∫f is 0 to rounding. Work: force times displacement.
Sections: N(s), positive in tension, is −Σ_{s_j < s} F_j·t of all forces F_j on the nodes before the section across Γ_C
          at s. Of a segment the mean over its sections is taken, which is exact for nodal forces of P1: l(φt), φ = 1
          before it, 0 behind it and linear on it, is a(u, φt) but for rounding. Friction adds ∫ξ/c over the cells S_i,
          so that N(s) between the middles of segments is exact where the line carries no other load.
Layers:   N of a region with a material of its own, of the forces ∫σ:∇φ that its triangles have at the nodes. They are
          in balance with all others: with that of the rest N of all sum to that of the body. But what passes between
          two layers is that of P1 elements, so that N of one has an error that falls with h.
Left out: lines that bend.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from tcstudy.offline.level import Level
from tcstudy.offline.loads import mechanical_terms
from tcstudy.scene.records import Clamped, Contact, Free, Scene

Array = NDArray[np.float64]
STRAIGHT = 1e-9
"""Sine of the angle up to which two segments of the contact line have one direction."""


def support_forces(level: Level, scene: Scene, u: Array) -> dict[str, Array]:
    """(2, n) force of every edge that holds or touches the body on its nodes, r = Au + Su − l_θ there [N/m].

    A node where two of them meet counts to the first, clamped before contact.
    """
    rest, taken, found = level.reactions(scene, u).reshape(2, -1), np.zeros(level.mesh.n_points, dtype=bool), {}
    for name, role in sorted(scene.boundary, key=lambda item: not isinstance(item[1], Clamped)):
        if isinstance(role, Clamped | Contact):
            own = np.isin(np.arange(len(taken)), level.mesh.nodes_on(name)) & ~taken
            taken |= own
            found[name] = np.where(own, rest, 0.0)
    return found


def edge_forces(level: Level, scene: Scene, u: Array) -> dict[str, Array]:
    """(2n,) force of every edge on the nodes in x and y, without those of free edges [N/m]; u (2n,) [m]"""
    found = {name: force.ravel() for name, force in support_forces(level, scene, u).items()}
    for name, role in scene.boundary:
        if not isinstance(role, Free):
            terms = mechanical_terms((0.0, 0.0), ((name, role),))
            own = sum((factor * level.vector(load) for load, factor in terms), np.zeros(2 * level.mesh.n_points))
            own -= level.forces(u, (), ((name, *role.spring),) if any(role.spring) else ())
            found[name] = found[name] + own if name in found else own
    return found


def layer_forces(level: Level, scene: Scene, sigma: Array) -> dict[str, Array]:
    """(2, n) ∫σ:∇φ over every region with a material of its own, at its nodes; sigma (t, 4) with xx, yy, xy first."""
    mesh, found = level.mesh, dict[str, Array]()
    pulled = np.einsum("tij,tkj->tki", sigma[:, [[0, 2], [2, 1]]] * mesh.area[:, None, None], mesh.slopes)
    for name, _ in scene.material.regions:
        found[name], own = np.zeros((2, mesh.n_points)), mesh.inside((name,))
        np.add.at(found[name].T, mesh.triangles[own], pulled[own])
    return found


def section_force(
    level: Level, scene: Scene, u: Array, u_T: Array, sigma: Array
) -> tuple[Array, dict[str, Array], Array] | None:
    """N at the nodes of Γ_C, held ones included (s + 1,), of the body and of layers by region [N/m]; arc lengths [m].

    u: (2n,) displacement in x and y;  u_T: (m,) [m];  sigma: (t, 4) stress [Pa]. None for a line that bends.
    """
    line, mesh, h = level.line, level.mesh, level.line.lengths
    along = (line.ends[:, 1] - line.ends[:, 0]) / h[:, None]
    chain = np.array_equal(line.segments[1:, 0], line.segments[:-1, 1])
    if not chain or np.abs(along @ [along[0, 1], -along[0, 0]]).max() > STRAIGHT:
        return None
    xi, at = level.condensed(scene).problem.xi(u_T), np.concatenate([[0.0], np.cumsum(h)])
    total = np.zeros(2 * mesh.n_points)
    for one in edge_forces(level, scene, u).values():
        total += one
    for load, factor in mechanical_terms(scene.f, ()):
        total += factor * level.vector(load)
    density = (xi / line.c)[np.where(line.unknowns < 0, line.unknowns[:, ::-1], line.unknowns)]
    s = (mesh.points - line.ends[0, 0]) @ along[0]
    k = np.clip(np.searchsorted(at, s, side="right") - 1, 0, len(h) - 1)
    share = np.clip((at[k + 1] - s) / h[k], 0.0, 1.0)
    friction = np.concatenate([[0.0], np.cumsum(0.5 * h * density.sum(axis=1))])

    def sections(nodal: Array, rubs: bool) -> Array:
        """N of forces (2, n) on nodes; rubs: whether friction is among them, which acts along the cells."""
        force = along[0] @ nodal
        if rubs:
            force[line.nodes] += xi
        before = np.cumsum(np.bincount(k, force, len(h))) - np.bincount(k, force, len(h))
        rest = -before - np.bincount(k, force * share, len(h))  # between the ends of every segment
        middle = 0.5 * (at[1:] + at[:-1])
        if len(h) > 1:  # at the ends of the line it goes on as it begins
            slopes = (np.diff(rest) / np.diff(middle))[[0, -1]]
            ends = [rest[0] - slopes[0] * middle[0]], [rest[-1] + slopes[1] * (at[-1] - middle[-1])]
            rest, middle = np.concatenate([ends[0], rest, ends[1]]), np.concatenate([[0.0], middle, at[-1:]])
        return np.interp(at, middle, rest) + (friction if rubs else 0.0)

    contact = mesh.owner[mesh.on(*scene.edges(Contact))]
    layers = {
        name: sections(nodal, bool(mesh.inside((name,))[contact].all()))
        for name, nodal in layer_forces(level, scene, sigma).items()
    }
    return sections(total.reshape(2, -1), True), layers, at
