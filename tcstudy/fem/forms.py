"""The discrete problem on a mesh: constraints, the contact line, P1 forms and loads.

Constraints:    Γ_D by component, u_N = 0 on Γ_C exactly, in a local frame where needed. At a node
                with one constrained direction d it is (t, d) with t = (−d₂, d₁), so that the first
                local component is free and the second is fixed; on Γ_C that is (u_T, u_N). Two
                directions fix the node. Edges that are not held along n: opening_frames.py
Contact line:   its nodes in order, arclength, and the segment lengths c_i = meas(S_i) of method §2.
                A node that carries no unknown (on the closure of Γ_D, or in a corner of Γ_C) gives
                its half cells to its free neighbours, so that Σ c_i = meas(Γ_C) whatever the ends.
Rigid edges:    one unknown for each component that nothing prescribes. With w the local unknowns of
                the nodes, w = T w' where every row of an edge and a component is ± that of one
                node, the master; the stiffness becomes TᵀAT and a load TᵀF, so that what acts on
                any node of the edge acts on the edge. A master on the contact line is a contact
                unknown like any other. An edge that turns has three unknowns (a_x, a_y, φℓ), in
                rows of two of its nodes: u = a + φ × (x − x_m), x_m the middle of the edge, ℓ the
                length of its longest arm; TᵀF are then its resultants and its moment over ℓ. Left
                out: edges that turn and meet another support.
Elasticity:     div σ + f = 0,  σ = λ tr ε(u) I + 2μ ε(u) − βθI, eqs. (1), (3);  a(u,v) =
                ∫cε(u):ε(v), l_θ(v) = ∫f·v + β∫θ tr ε(v) + ∫_{Γ_N} g·v, eqs. (10), (11)
Heat:           kΔθ + qχ_ω = 0,  −k∂θ/∂n = α(θ − θ̄) on Γ_θ, eqs. (2), (5); k∫∇θ·∇φ + α∫_{Γ_θ}θφ =
                ∫_ω qφ + α∫_{Γ_θ}θ̄φ + ∫ flux φ, eq. (8)
Discretisation: P1, displacements component-blocked (x of all nodes, then y). One assembly (div·div
                on vector-valued P1) of G_cd[i, j] = ∫∂_cφ_i ∂_dφ_j serves all materials and the
                heat problem: ∫∇θ·∇φ is G_xx + G_yy, ∫div u div v has the blocks G_cd, ∫2ε(u):ε(v)
                has G_xy and G_yx exchanged off the diagonal
Literature:     Šestak & Jovanović, Appl. Math. Mech. 31 (2010)
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import ngsolve as ngs
import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from tcstudy.errors import GeometryFailed
from tcstudy.expressions.expression import Expression
from tcstudy.fem.meshes import EDGES, SMOOTH, Frames, PlaneMesh
from tcstudy.laws.composed import NO_JOINTS, Joints
from tcstudy.scene.records import (
    Clamped,
    Contact,
    Direction,
    Point,
    Rigid,
    Role,
    Scalar,
    Symmetry,
    Where,
)

Array = NDArray[np.float64]
Indices = NDArray[np.intp]


def constrain(mesh: PlaneMesh, boundary: tuple[tuple[str, Role], ...]) -> Frames:
    """Return the local frames that follow from the constraints of clamped and contact edges.

    Raises GeometryFailed where two edges prescribe different displacements at their common corner.
    """
    parts: list[_Constraints] = []
    # contact first, so that its frame (t, n) wins where it stands alone
    for name, role in sorted(boundary, key=lambda item: not isinstance(item[1], Contact)):
        if isinstance(role, Contact | Clamped):
            parts += _constraints(mesh, name, role)
    parts.append((np.zeros(0, dtype=np.intp), np.zeros((0, 2)), np.zeros(0), ""))
    names = [name for nodes, _, _, name in parts for _ in nodes]
    node = np.concatenate([nodes for nodes, _, _, _ in parts])
    direction = np.concatenate([directions for _, directions, _, _ in parts])
    value = np.concatenate([values for _, _, values, _ in parts])
    order = np.argsort(node, kind="stable")
    node = node[order]
    direction = direction[order]
    value = value[order]
    nodes, first, count = np.unique(node, return_index=True, return_counts=True)
    d0 = direction[first]
    v0 = value[first]
    number = np.repeat(np.arange(len(nodes)), count)
    sine = np.abs(_cross(d0[number], direction))
    # of every node the direction that is farthest from its first
    second = np.lexsort((-sine, number))[first]
    is_fixed = sine[second] > SMOOTH
    d1 = direction[second]
    v1 = value[second]
    det = np.where(is_fixed, _cross(d0, d1), 1.0)
    u_x = (v0 * d1[:, 1] - v1 * d0[:, 1]) / det
    u_y = (v1 * d0[:, 0] - v0 * d1[:, 0]) / det
    u = np.where(is_fixed[:, None], np.column_stack([u_x, u_y]), v0[:, None] * d0)
    difference = np.abs(np.einsum("ij,ij->i", direction, u[number]) - value)
    contradicting = np.flatnonzero(difference > 1e-9 * float(np.max(np.abs(value), initial=0.0)))
    if len(contradicting):
        worst = contradicting[0]
        x, y = mesh.points[node[worst]]
        edges = {names[i] for i in order[number == number[worst]]}
        raise GeometryFailed(
            f"edges {', '.join(sorted(edges))} prescribe different displacements at their common "
            f"corner ({x:g}, {y:g}); make them agree there, or free a component",
            ("boundary",),
        )
    n = mesh.n_points
    slides = nodes[~is_fixed]
    rests = nodes[is_fixed]
    d = d0[~is_fixed]
    axes = np.tile(np.eye(2), (n, 1, 1))
    fixed = np.zeros(2 * n, dtype=bool)
    values = np.zeros(2 * n)
    t = np.column_stack([-d[:, 1], d[:, 0]])
    axes[slides] = np.stack([t, d], axis=2)
    fixed[slides + n] = True
    values[slides + n] = v0[~is_fixed]
    fixed[rests] = fixed[rests + n] = True
    values[rests], values[rests + n] = u[is_fixed].T
    frames = Frames(axes, fixed, values)
    if any(isinstance(role, Contact) and role.normal != "held" for _, role in boundary):
        # imported only for a body that may lift off
        from tcstudy.fem.opening_frames import with_openings

        frames = with_openings(mesh, boundary, frames)
    return _tied(mesh, boundary, frames)


_Constraints = tuple[Indices, Array, Array, str]
"""Conditions d·u(node) = value: nodes, d, values, name of the edge."""


def _constraints(mesh: PlaneMesh, name: str, role: Role) -> Iterator[_Constraints]:
    """Yield the constraints of an edge, curve by curve and component by component.

    Raises GeometryFailed for a symmetry edge that is not straight.
    """
    for index, curve in enumerate(mesh.geometry.curves):
        if curve.name != name:
            continue
        on_curve = mesh.segment_curve == index
        nodes, first = np.unique(mesh.segments[on_curve], return_index=True)
        normals = mesh.end_normals[on_curve].reshape(-1, 2)[first]  # of the exact curve
        if isinstance(role, Symmetry) and np.max(np.abs(_cross(normals, normals[:1]))) > SMOOTH:
            raise GeometryFailed(
                f"the symmetry edge {name} is not straight; use u_N: 0 for a guide", EDGES
            )
        if role.frame == "nt":
            directions = [normals, np.column_stack([-normals[:, 1], normals[:, 0]])]
        else:
            directions = [np.tile(axis, (len(nodes), 1)) for axis in np.eye(2)]
        for direction, component in zip(directions, role.u, strict=True):
            if component is not None:
                yield nodes, direction, values_at(component, mesh.points[nodes]), name


def values_at(scalar: Scalar, points: Array) -> Array:
    """Return a number or an expression (…) at points (…, 2).

    Raises GeometryFailed where an expression is not finite.
    """
    if not isinstance(scalar, Expression):
        return np.full(points.shape[:-1], float(scalar))
    value = scalar.evaluate(points[..., 0], points[..., 1])
    if not np.all(np.isfinite(value)):
        raise GeometryFailed(
            f"the expression {str(scalar)!r} is not finite everywhere on the mesh; correct it", ()
        )
    return value


def _cross(a: Array, b: Array) -> Array:
    return a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]


@dataclass(frozen=True)
class ContactLine:
    """Contact unknowns in order along Γ_C (direction of t = (−n₂, n₁), one part after the other).

    nodes:        (m,) mesh nodes; in the local frames their tangential rows are these very numbers
    arclength:    (m,) position along Γ_C, parts counted on one after the other [m]
    xy:           (m, 2) coordinates [m]
    c:            (m,) segment lengths [m]
    edge:         (m,) index into edge_names of the edge the node lies on
    segments:     (s, 2) all segments of Γ_C, clamped nodes included, in order
    ends:         (s, 2, 2) their ends [m]
    which:        (s,) their places among all boundary segments of the mesh
    segment_edge: (s,) index into edge_names
    joints:       the nodes where one edge ends and another begins, `edge` being that which begins
    """

    nodes: Indices
    arclength: Array
    xy: Array
    c: Array
    edge: NDArray[np.int8]
    edge_names: tuple[str, ...]
    segments: Indices
    ends: Array
    which: Indices
    segment_edge: Indices
    joints: Joints = NO_JOINTS

    @property
    def m(self) -> int:
        """Number of contact DOFs."""
        return len(self.nodes)

    @cached_property
    def unknowns(self) -> Indices:
        """Return the contact DOFs (s, 2) at both ends of segments, −1 at held nodes."""
        number = np.full(int(self.segments.max()) + 1, -1, dtype=np.intp)
        number[self.nodes] = np.arange(self.m)
        return number[self.segments]

    @cached_property
    def own_law(self) -> Indices:
        """Return the contact unknown (s, 2) whose law half a segment has.

        It is that of the end, or of the other one at an interface junction or a held end.
        """
        return laws_of_halves(self.unknowns, self.joints)

    @cached_property
    def lengths(self) -> Array:
        """Return the lengths of the segments (s,) [m]."""
        along = self.ends[:, 1] - self.ends[:, 0]
        return np.asarray(np.linalg.norm(along, axis=1))

    @cached_property
    def held(self) -> tuple[Indices, Indices]:
        """Return the segments with a held end (h,), in order, and which end it is, 0 or 1."""
        segment, end = np.nonzero(self.unknowns < 0)
        return segment, end

    def nodal(self, values: Array, n: int, elsewhere: float = 0.0) -> Array:
        """Return values at the contact nodes (m,) as nodal values of the mesh (n,)."""
        nodal = np.full(n, elsewhere)
        nodal[self.nodes] = values
        return nodal

    def nearest(self, point: Point) -> tuple[int, float]:
        """Return the segment of Γ_C nearest to a point, and the position on it from 0 to 1."""
        along = self.ends[:, 1] - self.ends[:, 0]
        offset = np.asarray(point) - self.ends[:, 0]
        projection = np.einsum("sd,sd->s", offset, along) / np.einsum("sd,sd->s", along, along)
        position = np.clip(projection, 0.0, 1.0)
        distance = np.linalg.norm(offset - position[:, None] * along, axis=1)
        segment = int(np.argmin(distance))
        return segment, float(position[segment])


def laws_of_halves(unknowns: Indices, joints: Joints) -> Indices:
    """Return the unknown (s, 2) whose law half a segment has.

    It is that of the end, or of the other one at an interface junction or a held end.
    unknowns: (s, 2) at the ends of the segments, −1 where held
    """
    other_end = unknowns[:, ::-1]
    at_joint = np.isin(unknowns, joints.node)
    to_other = at_joint & (other_end >= 0) & ~at_joint[:, ::-1]
    return np.where((unknowns < 0) | to_other, other_end, unknowns)


def contact_line(mesh: PlaneMesh, frames: Frames, names: tuple[str, ...]) -> ContactLine:
    """Return the contact nodes of the study edges `names` in order, with their segments S_i.

    Raises GeometryFailed if a piece of Γ_C has no free node at all (the mesh is too coarse there).
    """
    curve_names = [curve.name for curve in mesh.geometry.curves]
    edge_of_curve = np.array([names.index(name) if name in names else -1 for name in curve_names])
    which = np.flatnonzero(edge_of_curve[mesh.segment_curve] >= 0)
    parts = _parts(mesh.segments[which], mesh.segment_curve[which])
    which = which[np.concatenate(parts)]
    segments = mesh.segments[which]
    edge = edge_of_curve[mesh.segment_curve[which]]
    along = mesh.points[segments[:, 1]] - mesh.points[segments[:, 0]]
    lengths = np.linalg.norm(along, axis=1)
    slides = frames.slides
    is_free = slides[segments]
    held = np.flatnonzero(~is_free.any(axis=1))
    if len(held):
        x, y = mesh.points[segments[held[0], 0]]
        raise GeometryFailed(
            f"the contact line has no free node at ({x:g}, {y:g}), all its nodes there are "
            "constrained; "
            "refine the mesh, or draw short edges that stand for a curve as arcs with through"
        )
    # half of a segment for c_i of either end; the half of a fixed end goes to the other one
    halves = np.where(is_free.all(axis=1, keepdims=True), 0.5, is_free) * lengths[:, None]
    c = np.zeros(mesh.n_points)
    np.add.at(c, segments.T, halves.T)
    before = np.cumsum(lengths) - lengths
    stops = np.cumsum([len(part) for part in parts])
    # each node once, as the start of its segment or as the end of an open part
    in_order: list[tuple[Indices, Array, Indices]] = []
    for first, stop in zip([0, *stops[:-1]], stops, strict=True):
        in_order.append((segments[first:stop, 0], before[first:stop], edge[first:stop]))
        if segments[stop - 1, 1] != segments[first, 0]:
            last = slice(stop - 1, stop)
            in_order.append((segments[last, 1], before[last] + lengths[last], edge[last]))
    nodes, arclength, edges = (np.concatenate(column) for column in zip(*in_order, strict=True))
    free = slides[nodes]
    nodes = nodes[free]
    arclength = arclength[free]
    node_edge = edges[free].astype(np.int8)
    number = np.full(mesh.n_points, -1)
    number[nodes] = np.arange(len(nodes))
    end = number[segments[:, 1]]
    meets = np.flatnonzero((end >= 0) & (node_edge[end] != edge))
    shares = halves[meets, 1] / c[segments[meets, 1]]
    return ContactLine(
        nodes,
        arclength,
        mesh.points[nodes],
        c[nodes],
        node_edge,
        names,
        segments,
        mesh.points[segments],
        which,
        edge,
        Joints(end[meets], edge[meets], shares),
    )


def _parts(segments: Indices, rank: Indices) -> list[list[int]]:
    """Return the numbers of directed segments in order along their chains.

    Open parts start at the node at which no segment ends; closed ones at their first segment by
    rank.
    """
    outgoing = {start: i for i, start in enumerate(segments[:, 0].tolist())}
    ends = set(segments[:, 1].tolist())
    by_rank = np.argsort(rank, kind="stable").tolist()
    open_heads = [i for i in by_rank if int(segments[i, 0]) not in ends]
    seen = set[int]()
    parts = list[list[int]]()
    for head in [*open_heads, *by_rank]:
        part = list[int]()
        i = head
        while i is not None and i not in seen:
            seen.add(i)
            part.append(i)
            i = outgoing.get(int(segments[i, 1]))
        if part:
            parts.append(part)
    return parts


def _tied(mesh: PlaneMesh, boundary: tuple[tuple[str, Role], ...], frames: Frames) -> Frames:
    """Return the frames with all nodes of a rigid edge tied to one, if possible on Γ_C.

    Raises GeometryFailed where another edge holds a rigid one.
    """
    rigid = [(name, role) for name, role in boundary if isinstance(role, Rigid)]
    if not rigid:
        return frames
    n = mesh.n_points
    fixed = frames.fixed.copy()
    axes = frames.axes
    contact = mesh.nodes_on(*(name for name, role in boundary if isinstance(role, Contact)))
    columns = np.arange(2 * n)
    signs = np.ones(2 * n)
    turning: list[tuple[Indices, Indices, Array]] = []
    for name, role in rigid:
        if role.moment is not None:
            is_tied = (np.bincount(columns, minlength=2 * n) != 1) | (signs == 0.0)
            row, master, value = _turning(mesh, axes, fixed | is_tied, name)
            turning.append((row, master, value))
            signs[row] = 0.0
            fixed[np.setdiff1d(row, master)] = True
            continue
        for c in unknown(role):
            nodes = mesh.nodes_on(name)
            nodes = nodes[np.argsort(~np.isin(nodes, contact), kind="stable")]
            row, sign = _rows_along(mesh, axes, fixed, nodes, c, name)
            if np.isin(nodes[1:2], contact).any():
                raise GeometryFailed(
                    f"the rigid edge {name} meets contact at both ends; give one component", EDGES
                )
            columns[row[1:]] = row[0]
            signs[row[1:]] = sign[1:] * sign[0]
            fixed[row[1:]] = True
    parts = [(np.arange(2 * n), columns, signs), *turning]
    row, column, value = (np.concatenate(part) for part in zip(*parts, strict=True))
    ties = sp.csr_array((value, (row, column)), shape=(2 * n, 2 * n))
    ties.eliminate_zeros()
    return replace(frames, fixed=fixed, ties=ties)


def _turning(
    mesh: PlaneMesh, axes: Array, taken: NDArray[np.bool_], name: str
) -> tuple[Indices, Indices, Array]:
    """Return the entries of T of an edge that turns: rows, columns and values.

    taken: (2n,) rows that are held or tied already
    Raises GeometryFailed where another edge holds this one.
    """
    n = mesh.n_points
    nodes, _, arms = edge_arms(mesh, name)
    is_rotated = (np.abs(axes[nodes] - np.eye(2)) > SMOOTH).any(axis=(1, 2))
    is_held = taken[nodes] | taken[nodes + n] | is_rotated
    if is_held.any():
        x, y = mesh.points[nodes[np.argmax(is_held)]]
        fault = f"the rigid edge {name} cannot rotate: another edge constrains it at ({x:g}, {y:g})"
        raise GeometryFailed(f"{fault}; leave out its moment", EDGES)
    length = float(np.hypot(*arms.T).max())
    ones = np.ones(len(nodes))
    masters = np.array([nodes[0], nodes[0] + n, nodes[-1]])  # rows of a_x, a_y and φℓ
    row = np.concatenate([nodes, nodes + n, nodes, nodes + n])
    value = np.concatenate([ones, ones, -arms[:, 1] / length, arms[:, 0] / length])
    return row, np.repeat(masters[[0, 1, 2, 2]], len(nodes)), value


def unknown(role: Role) -> list[int]:
    """Return the components of a rigid edge that are not prescribed, none of another edge."""
    if not isinstance(role, Rigid):
        return []
    return [component for component, prescribed in enumerate(role.u) if prescribed is None]


def edge_arms(mesh: PlaneMesh, name: str) -> tuple[Indices, Array, Array]:
    """Return the nodes (k,) of an edge, their shares of its length (k,) and their arms (k, 2) [m].

    Arms lead from the middle of the edge to its nodes.
    """
    on_edge = mesh.on(name)
    halves = np.repeat(0.5 * mesh.boundary.length[on_edge], 2)
    share = np.bincount(mesh.segments[on_edge].ravel(), halves, mesh.n_points)
    nodes = np.flatnonzero(share)
    share = share[nodes] / share.sum()
    return nodes, share, mesh.points[nodes] - share @ mesh.points[nodes]


def couple(mesh: PlaneMesh, name: str) -> Array:
    """Return a load (2n,) in x and y with the moment 1 about an edge's middle, no resultant."""
    nodes, share, arms = edge_arms(mesh, name)
    F = np.zeros((2, mesh.n_points))
    inertia = share @ np.sum(arms**2, axis=1)
    F[:, nodes] = share * np.array([-arms[:, 1], arms[:, 0]]) / inertia
    return F.ravel()


def _rows_along(
    mesh: PlaneMesh, axes: Array, fixed: NDArray[np.bool_], nodes: Indices, c: int, name: str
) -> tuple[Indices, Array]:
    """Return the local rows (k,) that are ± u_x or u_y at nodes, and the signs.

    Raises GeometryFailed where another edge holds that component, or a slanted part of it.
    """
    along = axes[nodes, c]
    local = np.argmax(np.abs(along), axis=1)
    sign = along[np.arange(len(nodes)), local]
    row = nodes + mesh.n_points * local
    is_slanted = np.abs(np.abs(sign) - 1.0) > SMOOTH
    held = np.flatnonzero(is_slanted | fixed[row])
    if not len(held):
        return row, np.sign(sign)
    x, y = mesh.points[nodes[held[0]]]
    if fixed[row[held[0]]]:
        fault = f"the rigid edge {name} cannot move in {'xy'[c]}: another edge constrains it"
        remedy = f"give it u_{'xy'[c]}: 0"
    else:  # u_N = 0 on an inclined line, along which alone the edge could move
        fault = f"the rigid edge {name} meets an edge that constrains it in a slanted direction"
        remedy = "give it the role clamped, or let a free edge lie between the two"
    raise GeometryFailed(f"{fault} at ({x:g}, {y:g}); {remedy}", EDGES)


DEGREES = {ngs.SEGM: 6, ngs.TRIG: 5}
"""Degrees up to which quadrature of expressions times φ is exact; numbers need degree 1."""

Moduli = tuple[tuple[Where, float, float], ...]
"""λ and μ of the regions of the body [Pa]."""
Springs = tuple[tuple[str, float, float], ...]
"""(edge, k_N, k_T) of edges on springs [Pa/m]."""
Conductivity = tuple[tuple[Where, float], ...]
"""k of the regions of the body; () where k is uniform."""
NodeGraph = tuple[NDArray[np.int32], NDArray[np.int32]]
"""CSR pattern of the nodes that share a triangle: starts of rows, and ascending columns."""


@dataclass(frozen=True)
class ElasticForms:
    """The matrices and loads of the elastic problem on one mesh, and products of gradients.

    Rows (2n,) are in x and y.
    """

    mesh: PlaneMesh
    _products: dict[Where, tuple[NodeGraph, Array]] = field(
        default_factory=dict, repr=False, compare=False
    )

    def products(self, where: Where = ()) -> tuple[NodeGraph, Array]:
        """Return the graph of the nodes and G on it, (2, 2, nnz): [c, d, entry].

        where: regions over which to integrate, () for the whole body
        """
        if where not in self._products:
            self._products[where] = self._new_products(where)
        return self._products[where]

    def _new_products(self, where: Where) -> tuple[NodeGraph, Array]:
        if where and not self.mesh.inside(where).any():
            # NGSolve makes no form of a factor that is 0 everywhere
            graph, G = self.products()
            return graph, np.zeros_like(G)
        u, v = self._space.TnT()
        divergences = ngs.Trace(ngs.grad(u)) * ngs.Trace(ngs.grad(v))
        if where:
            # a factor 0 elsewhere: a form that is not defined there has no entries there
            factor = self.mesh.mesh.MaterialCF(dict.fromkeys(where, 1.0), default=0.0)
            divergences = factor * divergences
        return _blocks(ngs.BilinearForm(divergences * ngs.dx).Assemble())

    @cached_property
    def _space(self) -> Any:
        # one vector a node is cheaper than the compound VectorH1
        return ngs.H1(self.mesh.mesh, order=1, dim=2)

    def conduction(self, k: Conductivity = ()) -> sp.csr_array:
        """Return ∫k∇φ_i·∇φ_j (n, n), dimensionless; k = 1 by default."""
        (starts, columns), _ = self.products()
        n = self.mesh.n_points
        entries: Any = 0
        for where, value in k or (((), 1.0),):
            _, G = self.products(where)
            entries = entries + value * (G[0, 0] + G[1, 1])
        return sp.csr_array((entries, columns, starts), shape=(n, n))

    def stiffness_of(self, moduli: Moduli, frames: Frames | None = None) -> sp.csr_array:
        """Return a(φ_i, φ_j) (2n, 2n) in x and y, or RᵀAR in local rows [Pa].

        a(φ_i, φ_j) = ∫λ div φ_i div φ_j + 2μ ε(φ_i):ε(φ_j)
        """
        graph, body_G = self.products()
        A = np.empty_like(body_G)
        for number, (where, lam, mu) in enumerate(moduli):
            _, G = self.products(where)
            part = A if number == 0 else np.empty_like(A)
            for c, d in ((0, 1), (1, 0)):
                part[c, c] = (lam + 2.0 * mu) * G[c, c] + mu * G[d, d]
                part[c, d] = lam * G[c, d] + mu * G[d, c]
            if number:
                A += part
        return _matrix(graph, A, frames)

    def expansion(self, theta: Array, where: Where = ()) -> Array:
        """Return ∫θ div φ_i (2n,) of nodal values θ (n,) [K m]; the load is β times that.

        where: regions over which to integrate, () for the whole body
        """
        mesh = self.mesh
        integral = mesh.area * theta[mesh.triangles].mean(axis=1)
        if where:
            integral = integral * mesh.inside(where)
        entries = integral[:, None, None] * mesh.slopes
        corners = mesh.triangles.ravel()
        x, y = (np.bincount(corners, entries[..., c].ravel(), mesh.n_points) for c in (0, 1))
        return np.concatenate([x, y])

    def springs(self, springs: Springs, frames: Frames | None = None) -> sp.csr_array:
        """Return Σ_Γ ∫k_N u_N v_N + k_T u_T v_T (2n, 2n) in x and y, or in local rows [Pa]."""
        u, v = self._space.TnT()
        n = ngs.specialcf.normal(2)
        t = ngs.CF((-n[1], n[0]))
        form = ngs.BilinearForm(self._space, check_unused=False)
        for name, normal, tangential in springs:
            energy = normal * (u * n) * (v * n) + tangential * (u * t) * (v * t)
            form += energy * ngs.ds(self.mesh.region(name))
        form.Assemble()
        graph, S = _blocks(form)
        return _matrix(graph, self.mesh.geometry.unit * S, frames)


def edge_load(
    mesh: PlaneMesh, density: Scalar, names: tuple[str, ...], weights: Array | None = None
) -> Array:
    """Return ∫ q φ_i over study edges, (n,).

    weights: factors (s,) of q on the segments of these edges, 1 without
    """
    on_edges = mesh.on(*names)
    sizes = mesh.boundary.length[on_edges]
    if weights is not None:
        sizes = sizes * weights
    return _load(mesh, density, mesh.segments[on_edges], sizes, ngs.SEGM)


def traction_load(
    mesh: PlaneMesh, density: Scalar, names: tuple[str, ...], direction: Direction
) -> Array:
    """Return ∫ q d·v over study edges in x and y, (2, n), d being the direction there."""
    F = np.zeros((2, mesh.n_points))
    directions = direction.at(mesh.boundary.normal[mesh.on(*names)])
    for axis, weights in enumerate(directions.T):
        if np.any(weights):
            F[axis] = edge_load(mesh, density, names, weights)
    return F


def source_load(mesh: PlaneMesh, density: Scalar, omega: tuple[str, ...]) -> Array:
    """Return ∫_ω q φ_i (n,); an empty omega means the whole body."""
    inside = mesh.inside(omega)
    return _load(mesh, density, mesh.triangles[inside], 2.0 * mesh.area[inside], ngs.TRIG)


def _load(
    mesh: PlaneMesh, density: Scalar, nodes: NDArray[np.intp], size: Array, kind: Any
) -> Array:
    """Return ∫ q φ_i (n,) over segments or triangles.

    nodes: (e, k);  size: (e,) relative to the reference segment or triangle
    """
    degree = DEGREES[kind] if isinstance(density, Expression) else 1
    rule = ngs.IntegrationRule(kind, degree)
    corners = mesh.points[nodes]
    parts = np.zeros(nodes.shape)
    for point, weight in zip(rule.points, rule.weights, strict=True):
        phi = np.array([*point, 1.0 - sum(point)])
        parts += np.outer(weight * size * values_at(density, phi @ corners), phi)
    return np.asarray(np.bincount(nodes.ravel(), parts.ravel(), mesh.n_points), dtype=float)


def _blocks(form: Any) -> tuple[NodeGraph, Array]:
    """Return the pattern and the blocks (2, 2, nnz) of an assembled form of vectors."""
    values, columns, starts = form.mat.CSR()  # views, which die with the form
    row_starts = np.array(np.asarray(starts).view(np.int64), dtype=np.int32)
    blocks = np.asarray(values).reshape(-1, 2, 2).transpose(1, 2, 0)
    return (row_starts, np.array(columns, dtype=np.int32)), np.array(blocks, order="C")


def _matrix(graph: NodeGraph, A: Array, frames: Frames | None) -> sp.csr_array:
    """Return the matrix of blocks A (2, 2, nnz), numbered by x of all nodes, then y.

    With frames A_ij ← R_iᵀ A_ij R_j, in place, on the entries of nodes with turned axes.
    """
    starts, columns = graph
    n = len(starts) - 1
    if frames is not None:
        axes = frames.axes
        rows = np.repeat(np.arange(n), np.diff(starts))
        turned = (axes != np.eye(2)).any(axis=(1, 2))
        entries = np.flatnonzero(turned[rows] | turned[columns])
        R_i = axes[rows[entries]]
        R_j = axes[columns[entries]]
        A[:, :, entries] = np.einsum("eac,abe,ebd->cde", R_i, A[:, :, entries], R_j)

    def block(c: int, d: int) -> sp.csr_array:
        return sp.csr_array((A[c, d], columns, starts), shape=(n, n))

    blocks = [[block(0, 0), block(0, 1)], [block(1, 0), block(1, 1)]]
    return sp.csr_array(sp.block_array(blocks, format="csr"))
