"""The discrete problem on a mesh: which displacements are held, the contact line, P1 forms and
loads.

Constraints:    Γ_D by component, u_N = 0 on Γ_C exactly, in a local frame where needed. At a node with one constrained
                direction d it is (t, d) with t = (−d₂, d₁), so that the first local component is
                free and the second is
                fixed; on Γ_C that is (u_T, u_N). Two directions fix the node.
Contact line:   its nodes in order, arclength, and the segment lengths c_i = meas(S_i) of method §2. A node that carries
                no unknown (on the closure of Γ_D, or in a corner of Γ_C) gives its half cells to
                its free neighbours,
                so that Σ c_i = meas(Γ_C) whatever the ends.
Rigid edges:    one unknown for each component that nothing prescribes. With w the local unknowns of the nodes, w = T w'
                where every row of an edge and a component is ± that of one node, the master; the
                stiffness becomes TᵀAT
                and a load TᵀF, so that what acts on any node of the edge acts on the edge. A master
                on the contact line
                is a contact unknown like any other. An edge that turns has three unknowns (a_x,
                a_y, φℓ), in rows of
                two of its nodes: u = a + φ × (x − x_m), x_m the middle of the edge, ℓ the length of
                its longest arm;
                TᵀF are then its resultants and its moment over ℓ. Left out: edges that turn and
                meet another support.
Elasticity:     div σ + f = 0,  σ = λ tr ε(u) I + 2μ ε(u) − βθI, eqs. (1), (3);  a(u,v) = ∫cε(u):ε(v),
                l_θ(v) = ∫f·v + β∫θ tr ε(v) + ∫_{Γ_N} g·v, eqs. (10), (11)
Heat:           kΔθ + qχ_ω = 0,  −k∂θ/∂n = α(θ − θ̄) on Γ_θ, eqs. (2), (5);
                k∫∇θ·∇φ + α∫_{Γ_θ}θφ = ∫_ω qφ + α∫_{Γ_θ}θ̄φ + ∫ flux φ, eq. (8)
Discretisation: P1, displacements component-blocked (x of all nodes, then y). One assembly (div·div
on vector-valued P1)
                of G_cd[i, j] = ∫∂_cφ_i ∂_dφ_j serves all materials and the heat problem: ∫∇θ·∇φ is
                G_xx + G_yy,
                ∫div u div v has the blocks G_cd, ∫2ε(u):ε(v) has G_xy and G_yx exchanged off the
                diagonal
Literature:     Šestak & Jovanović, Appl. Math. Mech. 31 (2010)
"""

from __future__ import annotations

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
    """Collect the constraints of all clamped and contact edges and turn them into local frames.

    Raises GeometryFailed where two edges prescribe different displacements at their common corner.
    """
    parts: list[
        tuple[Indices, Array, Array, str]
    ] = []  # d·u(node) = value: node, d, value, name of the edge
    for name, role in sorted(boundary, key=lambda item: not isinstance(item[1], Contact)):
        # contact first, so that its frame (t, n) wins where it stands alone
        if not isinstance(role, Contact | Clamped):
            continue
        for own in (
            mesh.segment_curve == i
            for i, curve in enumerate(mesh.geometry.curves)
            if curve.name == name
        ):
            nodes, first = np.unique(mesh.segments[own], return_index=True)
            normals = mesh.end_normals[own].reshape(-1, 2)[first]  # of the exact curve
            if isinstance(role, Symmetry) and np.max(np.abs(_cross(normals, normals[:1]))) > SMOOTH:
                raise GeometryFailed(
                    f"the symmetry edge {name} is not straight; use u_N: 0 for a guide", EDGES
                )
            directions = [np.tile(axis, (len(nodes), 1)) for axis in ((1.0, 0.0), (0.0, 1.0))]
            if role.frame == "nt":
                directions = [normals, np.column_stack([-normals[:, 1], normals[:, 0]])]
            for along, component in zip(directions, role.u, strict=True):
                if component is not None:
                    parts.append((nodes, along, values_at(component, mesh.points[nodes]), name))
    names = [name for nodes, _, _, name in parts for _ in nodes]
    node, direction, value = (
        np.concatenate(column) for column in list(zip(*parts, strict=True))[:3]
    )
    order = np.argsort(node, kind="stable")
    node, direction, value = node[order], direction[order], value[order]
    nodes, first, count = np.unique(node, return_index=True, return_counts=True)
    d0, v0, own = direction[first], value[first], np.repeat(np.arange(len(nodes)), count)
    sine = np.abs(_cross(d0[own], direction))
    second = np.lexsort((-sine, own))[
        first
    ]  # of every node the direction that is farthest from its first
    both, d1, v1 = sine[second] > SMOOTH, direction[second], value[second]
    det = np.where(both, _cross(d0, d1), 1.0)
    pair = np.column_stack(
        [(v0 * d1[:, 1] - v1 * d0[:, 1]) / det, (v1 * d0[:, 0] - v0 * d1[:, 0]) / det]
    )
    u = np.where(both[:, None], pair, v0[:, None] * d0)
    apart = np.abs(np.einsum("ij,ij->i", direction, u[own]) - value)
    wrong = np.flatnonzero(apart > 1e-9 * float(np.max(np.abs(value), initial=0.0)))
    if len(wrong):
        x, y = mesh.points[node[wrong[0]]]
        others = {names[i] for i in order[own == own[wrong[0]]]}
        raise GeometryFailed(
            f"edges {', '.join(sorted(others))} prescribe different displacements at their common "
            f"corner ({x:g}, {y:g}); make them agree there, or free a component",
            ("boundary",),
        )
    n, one, two, d = mesh.n_points, nodes[~both], nodes[both], d0[~both]
    axes, fixed, values = (
        np.tile(np.eye(2), (n, 1, 1)),
        np.zeros(2 * n, dtype=bool),
        np.zeros(2 * n),
    )
    axes[one] = np.stack(
        [np.column_stack([-d[:, 1], d[:, 0]]), d], axis=2
    )  # columns t = (−d₂, d₁) and d
    fixed[one + n], values[one + n] = True, v0[~both]
    fixed[two] = fixed[two + n] = True
    values[two], values[two + n] = u[both].T
    return _tied(mesh, boundary, Frames(axes, fixed, values))


def values_at(scalar: Scalar, points: Array) -> Array:
    """A number or an expression at points (…, 2) → (…)."""
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

    nodes:     (m,) mesh nodes; in the local frames their tangential rows are these very numbers
    arclength: (m,) position along Γ_C, parts counted on one after the other [m]
    xy:        (m, 2) coordinates [m];  c: (m,) segment lengths [m]
    edge:      (m,) index into edge_names of the edge the node lies on
    segments:  (s, 2) all segments of Γ_C, clamped nodes included, in order;  ends: (s, 2, 2) their ends [m]
    which:     (s,) their places among all boundary segments of the mesh;  segment_edge: (s,) index into edge_names
    joints:    the nodes where one edge ends and another begins, `edge` being that which begins
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
        """Number of contact unknowns."""
        return len(self.nodes)

    @cached_property
    def unknowns(self) -> Indices:
        """(s, 2) the contact unknown at both ends of every segment, −1 at held nodes."""
        number = np.full(int(self.segments.max()) + 1, -1, dtype=np.intp)
        number[self.nodes] = np.arange(self.m)
        return number[self.segments]

    @cached_property
    def own_law(self) -> Indices:
        """(s, 2) the contact unknown whose law half a segment has: its end, the other one at a
        joint or held end."""
        own, joint = self.unknowns, np.isin(self.unknowns, self.joints.node)
        return np.where(
            (own < 0) | (joint & (own[:, ::-1] >= 0) & ~joint[:, ::-1]), own[:, ::-1], own
        )

    @cached_property
    def lengths(self) -> Array:
        """(s,) lengths of the segments [m]."""
        return np.asarray(np.linalg.norm(self.ends[:, 1] - self.ends[:, 0], axis=1))

    @cached_property
    def held(self) -> tuple[Indices, Indices]:
        """(h,) the segments with an end that carries no unknown, in order, and 0 or 1, which of
        their ends it is."""
        at, side = np.nonzero(self.unknowns < 0)
        return at, side

    def nodal(self, values: Array, n: int, elsewhere: float = 0.0) -> Array:
        """(n,) values at the contact nodes (m,) as those at all nodes of the mesh."""
        found = np.full(n, elsewhere)
        found[self.nodes] = values
        return found

    def nearest(self, at: Point) -> tuple[int, float]:
        """The segment of Γ_C that is nearest to a point, and where on it from 0 to 1."""
        along = self.ends[:, 1] - self.ends[:, 0]
        offset = np.asarray(at) - self.ends[:, 0]
        t = np.clip(
            np.einsum("sd,sd->s", offset, along) / np.einsum("sd,sd->s", along, along), 0.0, 1.0
        )
        k = int(np.argmin(np.linalg.norm(offset - t[:, None] * along, axis=1)))
        return k, float(t[k])


def contact_line(mesh: PlaneMesh, frames: Frames, names: tuple[str, ...]) -> ContactLine:
    """Order the contact nodes of the study edges `names` and measure their segments S_i.

    Raises GeometryFailed if a piece of Γ_C has no free node at all (the mesh is too coarse there).
    """
    curves = mesh.geometry.curves
    edge_of_curve = np.array([names.index(c.name) if c.name in names else -1 for c in curves])
    which = np.flatnonzero(edge_of_curve[mesh.segment_curve] >= 0)
    parts = _parts(mesh.segments[which], mesh.segment_curve[which])
    which = which[np.concatenate(parts)]
    segments, edge = mesh.segments[which], edge_of_curve[mesh.segment_curve[which]]
    lengths = np.linalg.norm(mesh.points[segments[:, 1]] - mesh.points[segments[:, 0]], axis=1)
    loose = ~frames.fixed[segments]
    if len(lost := np.flatnonzero(~loose.any(axis=1))):
        x, y = mesh.points[segments[lost[0], 0]]
        raise GeometryFailed(
            f"the contact line has no free node at ({x:g}, {y:g}), all its nodes there are held; refine the mesh, "
            "or draw short edges that stand for a curve as arcs with through"
        )
    # what a segment adds to c_i of its ends: half of it, a fixed end's half goes to the other end
    halves = np.where(loose.all(axis=1, keepdims=True), 0.5, loose) * lengths[:, None]
    c = np.zeros(mesh.n_points)
    np.add.at(c, segments.T, halves.T)
    before, stops = np.cumsum(lengths) - lengths, np.cumsum([len(part) for part in parts])
    found: list[tuple[Indices, Array, Indices]] = []
    for first, stop in zip(
        [0, *stops[:-1]], stops, strict=True
    ):  # each node once: as the start of its segment, or as
        found.append((segments[first:stop, 0], before[first:stop], edge[first:stop]))
        if segments[stop - 1, 1] != segments[first, 0]:  # the end of an open part
            last = slice(stop - 1, stop)
            found.append((segments[last, 1], before[last] + lengths[last], edge[last]))
    nodes, at, edges = (np.concatenate(column) for column in zip(*found, strict=True))
    free, ends = ~frames.fixed[nodes], mesh.points[segments]
    nodes, at, on = nodes[free], at[free], edges[free].astype(np.int8)
    own = np.full(mesh.n_points, -1)
    own[nodes] = np.arange(len(nodes))
    into = own[segments[:, 1]]
    meets = np.flatnonzero((into >= 0) & (on[into] != edge))
    joints = Joints(into[meets], edge[meets], halves[meets, 1] / c[segments[meets, 1]])
    return ContactLine(
        nodes, at, mesh.points[nodes], c[nodes], on, names, segments, ends, which, edge, joints
    )


def _parts(segments: Indices, rank: Indices) -> list[list[int]]:
    """The directed segments in order along their chains.

    Open parts start at the node that no segment ends in; closed ones at their first segment by
    rank.
    """
    outgoing = {a: i for i, a in enumerate(segments[:, 0].tolist())}
    ends, by_rank = set(segments[:, 1].tolist()), np.argsort(rank, kind="stable").tolist()
    seen, parts = set[int](), list[list[int]]()
    for head in [*(i for i in by_rank if int(segments[i, 0]) not in ends), *by_rank]:
        part, i = list[int](), head
        while i is not None and i not in seen:
            seen.add(i)
            part.append(i)
            i = outgoing.get(int(segments[i, 1]))
        parts += [part] if part else []
    return parts


def _tied(mesh: PlaneMesh, boundary: tuple[tuple[str, Role], ...], frames: Frames) -> Frames:
    """The frames with all nodes of a rigid edge tied to one, on the contact line if it meets it.

    Raises GeometryFailed where another edge holds a rigid one.
    """
    rigid = [(name, role) for name, role in boundary if isinstance(role, Rigid)]
    if not rigid:
        return frames
    n, fixed, axes = mesh.n_points, frames.fixed.copy(), frames.axes
    contact = mesh.nodes_on(*(name for name, role in boundary if isinstance(role, Contact)))
    columns, signs = np.arange(2 * n), np.ones(2 * n)
    turning: list[tuple[Indices, Indices, Array]] = []
    for name, role in rigid:
        if role.moment is not None:
            nodes, _, arms = edge_arms(mesh, name)
            taken = (
                fixed | (np.bincount(columns, minlength=2 * n) != 1) | (signs == 0.0)
            )  # held or tied already
            wrong = (
                taken[nodes]
                | taken[nodes + n]
                | (np.abs(axes[nodes] - np.eye(2)) > SMOOTH).any(axis=(1, 2))
            )
            if wrong.any():
                x, y = mesh.points[nodes[np.argmax(wrong)]]
                what = f"the rigid edge {name} cannot turn: another edge holds it at ({x:g}, {y:g})"
                raise GeometryFailed(f"{what}; leave out its moment", EDGES)
            length, ones = float(np.hypot(*arms.T).max()), np.ones(len(nodes))
            masters = np.array([nodes[0], nodes[0] + n, nodes[-1]])  # rows of a_x, a_y and φℓ
            row = np.concatenate([nodes, nodes + n, nodes, nodes + n])
            value = np.concatenate([ones, ones, -arms[:, 1] / length, arms[:, 0] / length])
            turning.append((row, np.repeat(masters[[0, 1, 2, 2]], len(nodes)), value))
            signs[row], fixed[np.setdiff1d(row, masters)] = 0.0, True
            continue
        for c in unknown(role):
            nodes = mesh.nodes_on(name)
            nodes = nodes[np.argsort(~np.isin(nodes, contact), kind="stable")]
            row, sign = _rows_along(mesh, axes, fixed, nodes, c, name)
            if np.isin(nodes[1:2], contact).any():
                raise GeometryFailed(
                    f"the rigid edge {name} meets contact at both ends; give one component", EDGES
                )
            columns[row[1:]], signs[row[1:]], fixed[row[1:]] = row[0], sign[1:] * sign[0], True
    parts = [(np.arange(2 * n), columns, signs), *turning]
    row, column, value = (np.concatenate(part) for part in zip(*parts, strict=True))
    ties = sp.csr_array((value, (row, column)), shape=(2 * n, 2 * n))
    ties.eliminate_zeros()
    return replace(frames, fixed=fixed, ties=ties)


def unknown(role: Role) -> list[int]:
    """The components of a rigid edge that nothing prescribes; none of another edge."""
    return [c for c, given in enumerate(role.u) if given is None] if isinstance(role, Rigid) else []


def edge_arms(mesh: PlaneMesh, name: str) -> tuple[Indices, Array, Array]:
    """(k,) nodes of an edge, (k,) their shares of its length and (k, 2) where they are from its
    middle [m]."""
    segments = mesh.segments[mesh.on(name)]
    share = np.bincount(
        segments.ravel(), np.repeat(0.5 * mesh.boundary.length[mesh.on(name)], 2), mesh.n_points
    )
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
        if not fixed[
            row[wrong[0]]
        ]:  # u_N = 0 on an inclined line, along which alone the edge could move
            what = f"the rigid edge {name} meets an edge that holds it in a slanted direction at ({x:g}, {y:g})"
            raise GeometryFailed(
                f"{what}; give it the role clamped, or let a free edge lie between the two", EDGES
            )
        what = f"the rigid edge {name} cannot move in {'xy'[c]}: another edge holds it at ({x:g}, {y:g})"
        raise GeometryFailed(f"{what}; give it u_{'xy'[c]}: 0", EDGES)
    return row, np.sign(sign)


DEGREES = {ngs.SEGM: 6, ngs.TRIG: 5}
"""Up to which quadrature of data given as expressions is exact, times φ; of numbers 1 is enough."""

Moduli = tuple[tuple[Where, float, float], ...]
"""Where the body has which λ and μ [Pa]."""
Springs = tuple[tuple[str, float, float], ...]
"""(edge, k_N, k_T) of edges on springs [Pa/m]."""
Conductivity = tuple[tuple[Where, float], ...]
"""Where the body has which k; () where k is the same everywhere."""
NodeGraph = tuple[NDArray[np.int32], NDArray[np.int32]]
"""CSR pattern of G, which nodes share a triangle: where rows start, and columns, ascending."""


@dataclass(frozen=True)
class ElasticForms:
    """The matrices and loads of the elastic problem on one mesh, in x and y (2n rows), and products
    of gradients."""

    mesh: PlaneMesh
    _products: dict[Where, tuple[NodeGraph, Array]] = field(
        default_factory=dict, repr=False, compare=False
    )

    def products(self, where: Where = ()) -> tuple[NodeGraph, Array]:
        """The graph of the nodes and G on it, (2, 2, nnz): [c, d, entry], with integrals over some
        regions."""
        if where not in self._products:
            u, v = self._space.TnT()
            divergences = ngs.Trace(ngs.grad(u)) * ngs.Trace(ngs.grad(v))
            # a factor 0 elsewhere, since a form that is not defined there has no entries there
            # either
            if where:
                divergences = (
                    self.mesh.mesh.MaterialCF(dict.fromkeys(where, 1.0), default=0.0) * divergences
                )
            if not where or self.mesh.inside(where).any():
                graph, G = _blocks(ngs.BilinearForm(divergences * ngs.dx).Assemble())
            else:  # of a factor that is 0 everywhere NGSolve makes no form
                graph, G = self.products()
                G = np.zeros_like(G)
            self._products[where] = graph, G
        return self._products[where]

    @cached_property
    def _space(self) -> Any:
        return ngs.H1(
            self.mesh.mesh, order=1, dim=2
        )  # one vector a node: cheaper than the compound VectorH1

    def conduction(self, k: Conductivity = ()) -> sp.csr_array:
        """∫k∇φ_i·∇φ_j, (n, n), dimensionless; k = 1 if none is given."""
        (starts, columns), n = self.products()[0], self.mesh.n_points
        pairs = ((value, self.products(where)[1]) for where, value in k or (((), 1.0),))
        entries = sum(value * (G[0, 0] + G[1, 1]) for value, G in pairs)
        return sp.csr_array((entries, columns, starts), shape=(n, n))

    def stiffness_of(self, moduli: Moduli, frames: Frames | None = None) -> sp.csr_array:
        """a(φ_i, φ_j) = ∫λ div φ_i div φ_j + 2μ ε(φ_i):ε(φ_j), (2n, 2n) [Pa], in x and y, or RᵀAR
        in local rows."""
        graph, whole = self.products()
        A = np.empty_like(whole)
        for number, (where, lam, mu) in enumerate(moduli):
            G, part = self.products(where)[1], A if number == 0 else np.empty_like(A)
            for c, d in ((0, 1), (1, 0)):
                part[c, c] = (lam + 2.0 * mu) * G[c, c] + mu * G[d, d]
                part[c, d] = lam * G[c, d] + mu * G[d, c]
            if number:
                A += part
        return _matrix(graph, A, frames)

    def expansion(self, theta: Array, where: Where = ()) -> Array:
        """∫θ div φ_i over some regions for nodal values θ (n,): (2n,) [K m]; the load is β times
        that."""
        mesh, whole = self.mesh, self.mesh.area * theta[self.mesh.triangles].mean(axis=1)
        pulled = (whole * mesh.inside(where) if where else whole)[:, None, None] * mesh.slopes
        corners = mesh.triangles.ravel()
        return np.concatenate(
            [np.bincount(corners, pulled[..., c].ravel(), mesh.n_points) for c in (0, 1)]
        )

    def springs(self, springs: Springs, frames: Frames | None = None) -> sp.csr_array:
        """Σ_Γ ∫k_N u_N v_N + k_T u_T v_T over study edges, (2n, 2n) [Pa], in x and y or in local
        rows."""
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
    """∫_ω q φ_i, (n,); an empty omega means the whole body."""
    inside = mesh.inside(omega)
    return _load(mesh, density, mesh.triangles[inside], 2.0 * mesh.area[inside], ngs.TRIG)


def _load(
    mesh: PlaneMesh, density: Scalar, nodes: NDArray[np.intp], size: Array, kind: Any
) -> Array:
    """∫ q φ_i over segments or triangles with these nodes (e, k) and sizes over that of the unit
    one (e,)."""
    rule = ngs.IntegrationRule(kind, DEGREES[kind] if isinstance(density, Expression) else 1)
    corners, parts = mesh.points[nodes], np.zeros(nodes.shape)
    for at, weight in zip(rule.points, rule.weights, strict=True):
        phi = np.array([*at, 1.0 - sum(at)])
        parts += np.outer(weight * size * values_at(density, phi @ corners), phi)
    return np.asarray(np.bincount(nodes.ravel(), parts.ravel(), mesh.n_points), dtype=float)


def _blocks(form: Any) -> tuple[NodeGraph, Array]:
    """The pattern and the blocks (2, 2, nnz) of an assembled form of vectors."""
    values, columns, starts = form.mat.CSR()  # views, which die with the form
    graph = (
        np.array(np.asarray(starts).view(np.int64), dtype=np.int32),
        np.array(columns, dtype=np.int32),
    )
    return graph, np.array(np.asarray(values).reshape(-1, 2, 2).transpose(1, 2, 0), order="C")


def _matrix(graph: NodeGraph, A: Array, frames: Frames | None) -> sp.csr_array:
    """The matrix of blocks A (2, 2, nnz) in the numbering x of all nodes, then y; every row has x,
    then y columns.

    With frames A_ij ← R_iᵀ A_ij R_j, in place, on the entries that a turned node has part in.
    """
    (starts, columns), n = graph, len(graph[0]) - 1
    if frames is not None:
        axes, rows = frames.axes, np.repeat(np.arange(n), np.diff(starts))
        turned = (axes != np.eye(2)).any(axis=(1, 2))
        entries = np.flatnonzero(turned[rows] | turned[columns])
        left, right = axes[rows[entries]], axes[columns[entries]]
        A[:, :, entries] = np.einsum("eac,abe,ebd->cde", left, A[:, :, entries], right)
    blocks = [
        [sp.csr_array((A[c, d], columns, starts), shape=(n, n)) for d in (0, 1)] for c in (0, 1)
    ]
    return sp.csr_array(sp.block_array(blocks, format="csr"))
