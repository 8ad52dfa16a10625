"""Numbers of a solved point: by law along Γ_C, forces of edges and sections, what else a study asks
for.

Lengths:    u_T is linear between the nodes of Γ_C, so that the part of a segment with slips up to a breakpoint s of its
            law is (s − min u_T)/(max u_T − min u_T), and lengths of regions (`LawPieces.regions`)
            are exact differences
            of such parts. The law of a segment is that of its edge; where strength varies along it,
            each half has the
            law of its own node
Edges:      what loads, springs and supports of an edge do at its nodes: g, p, resultants, −S_e u, and r = Au + Su − l_θ
            where the edge holds or touches the body; their sum with ∫f is 0 to rounding. Work:
            force times displacement
Sections:   N(s), positive in tension, is −Σ_{s_j < s} F_j·t of all forces F_j on the nodes before the section across
            Γ_C at s, as the triangles have them there, ∫σ:∇φ. Of a segment the mean over its
            sections is taken, which
            is exact for nodal forces of P1: l(φt), φ = 1 before it, 0 behind it and linear on it,
            is a(u, φt) but
            for rounding. Friction adds ∫ξ/c over the cells S_i, so that N(s) between the middles of
            segments is exact
            where the line carries no other load
Layers:     N of a region with a material of its own, of the forces of its triangles; with that of the rest they sum to
            that of the body. What passes between two layers is that of P1, so that N of one has an
            error that falls
            with h
Stress:     σ = cε(u) − βθI, one on each triangle, θ being its mean there; in plane strain σ_zz = λ div u − βθ
Left out:   lines that bend.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tcstudy.fem.energy_error import own_strain, stress_of
from tcstudy.fem.forms import ContactLine
from tcstudy.laws.laws import Laws
from tcstudy.laws.pieces import BARE, DEBONDED, REGIONS, UP
from tcstudy.offline.level import Level, mechanical_terms
from tcstudy.scene.records import Clamped, Contact, Free, Scene
from tcstudy.scene.study import OutputPlan

Array = NDArray[np.float64]
EQUAL = 1e-9
"""Relative difference of two tractions that are one, as on a plateau of b: the first of them
counts."""


def line_numbers(
    level: Level, scenes: Sequence[Scene], laws: Laws, v: Array, xi: Array
) -> dict[str, Array]:
    """(P,) by name: `shear_max` [Pa], `shear_max_at` and `<region>_length` [m], NaN where a point's
    laws have none; and (P, h) `held_u_T` of held ends [m].

    laws: of rows (P, 1) or (P, m);  v, xi: (P, m) slips [m] and tractions [Pa]
    """
    given = {id(scene.boundary): scene for scene in scenes}
    slips = {key: level.held_slips(scene) for key, scene in given.items()}
    held = np.array([slips[id(scene.boundary)] for scene in scenes])
    found = region_lengths(level, laws, v, held) | ({"held_u_T": held} if held.size else {})
    slipping, size = np.where(laws.kind(laws.locate(v)) == UP, 0.0, level.line.c), np.abs(xi)
    most = np.max(size, axis=1)
    return found | {
        "slip_length": np.where(
            np.isnan(found.get("breathing_length", np.nan)), np.nan, slipping.sum(axis=1)
        ),
        "shear_max": most,
        "shear_max_at": level.line.arclength[
            np.argmax(size >= (1.0 - EQUAL) * most[:, None], axis=1)
        ],
    }


def region_lengths(level: Level, laws: Laws, v: Array, held: Array) -> dict[str, Array]:
    """(P,) lengths by name [m]. laws: of rows (P, 1) or (P, m)

    held: (P, h) slips of the held ends of segments, NaN for that of the node beside it
    """
    line, index, by_node = level.line, laws.index, laws.index.shape[1] > 1
    length, loose = line.lengths, line.unknowns < 0
    ends = v[:, np.where(loose, line.own_law, line.unknowns)]
    ends[:, loose] = np.where(np.isnan(held), ends[:, loose], held)
    first, second = ends[..., 0], ends[..., 1]
    if by_node:
        middle = 0.5 * (first + second)
        first, second = np.hstack([first, middle]), np.hstack([middle, second])
        length, index = np.tile(0.5 * length, 2), index[:, line.own_law.T.ravel()]
    low, high = np.minimum(first, second), np.maximum(first, second)
    resting = low == high
    # what rests on an up-jump is in no region
    size = length * ~(resting & (laws.kind(laws.locate(low, index)) == UP))
    change = np.any(np.diff(laws.regions, axis=1) != 0, axis=0)  # breakpoints between regions
    kinks, regions = laws.kinks[:, change][index], laws.regions[:, np.append(change, True)][index]
    width = np.where(resting, 1.0, high - low)[..., None]
    below = np.where(
        resting[..., None],
        kinks >= high[..., None],
        np.clip((kinks - low[..., None]) / width, 0.0, 1.0),
    )
    parts = size[..., None] * np.diff(
        below, axis=-1, prepend=0.0, append=1.0
    )  # (P, s, pieces) of every segment
    # a joint has its edges' laws
    known, found = (
        laws.index if not by_node else np.delete(laws.index, line.joints.node, axis=1),
        dict[str, Array](),
    )
    for k in np.unique(laws.regions):
        has = np.any(laws.regions == k, axis=1)[known].any(axis=1)
        if k != BARE and np.any(has):
            total = np.sum(parts, axis=(1, 2), where=regions == k)
            found[f"{REGIONS[k]}_length"] = np.where(has, total, np.nan)
    sticks = np.any(laws.kinds == UP, axis=1)[known].any(axis=1)
    if np.any(sticks):
        slips = ((first != 0.0) | (second != 0.0)) @ length
        found["breathing_length"] = np.where(sticks, slips, np.nan)
    return found


def debonded_front(line: ContactLine, law: Laws, kappa: Array) -> dict[str, float]:
    """`debonded_from`, `debonded_to`: arclengths between which a bond is debonded whose nodes have
    slipped by up to kappa (m,), linear between them; NaN where it is nowhere, nothing for a law
    that never has fallen [m].
    """
    table, m = law.tables, line.m
    debonded = (table.regions == DEBONDED) & (table.lower >= 0.0)
    if not np.any(debonded):
        return {}
    beyond = kappa - np.min(np.where(debonded, table.lower, np.inf), axis=1)[law.node_index(m)]
    at, x = np.flatnonzero(beyond >= 0.0), line.arclength

    def passed(node: int, other: int, end: float) -> float:
        if not 0 <= other < m:
            return end
        return float(x[node] + beyond[node] / (beyond[node] - beyond[other]) * (x[other] - x[node]))

    if not len(at):
        return {"debonded_from": np.nan, "debonded_to": np.nan}
    whole = float(line.lengths.sum())
    return {
        "debonded_from": passed(at[0], at[0] - 1, 0.0),
        "debonded_to": passed(at[-1], at[-1] + 1, whole),
    }


STRAIGHT = 1e-9
"""Sine of the angle up to which two segments of the contact line have one direction."""


def support_forces(level: Level, scene: Scene, u: Array) -> dict[str, Array]:
    """(2, n) force of every edge that holds or touches the body on its nodes, r = Au + Su − l_θ
    there [N/m].

    A node where two of them meet counts to the first, clamped before contact.
    """
    rest, taken, found = (
        level.reactions(scene, u).reshape(2, -1),
        np.zeros(level.mesh.n_points, dtype=bool),
        {},
    )
    for name, role in sorted(scene.boundary, key=lambda item: not isinstance(item[1], Clamped)):
        if isinstance(role, Clamped | Contact):
            own = np.isin(np.arange(len(taken)), level.mesh.nodes_on(name)) & ~taken
            taken |= own
            found[name] = np.where(own, rest, 0.0)
    return found


def edge_forces(level: Level, scene: Scene, u: Array) -> dict[str, Array]:
    """(2, n) force of every edge on the nodes, without those of free edges [N/m]; u (2n,) [m]"""
    found = support_forces(level, scene, u)
    for name, role in scene.boundary:
        if not isinstance(role, Free):
            own = -level.forces(u, (), ((name, *role.spring),) if any(role.spring) else ())
            own += sum(
                factor * level.vector(load)
                for load, factor in mechanical_terms((0.0, 0.0), ((name, role),))
            )
            found[name] = found.get(name, 0.0) + own.reshape(2, -1)
    return found


def section_force(
    level: Level, scene: Scene, u_T: Array, sigma: Array
) -> tuple[Array, dict[str, Array], Array] | None:
    """N at the nodes of Γ_C, held ones included (s + 1,), of the body and of layers by region
    [N/m]; arc lengths [m].

    u_T: (m,) [m];  sigma: (t, 4) stress [Pa]. None for a line that bends.
    """
    line, mesh, h = level.line, level.mesh, level.line.lengths
    along = (line.ends[:, 1] - line.ends[:, 0]) / h[:, None]
    chain = np.array_equal(line.segments[1:, 0], line.segments[:-1, 1])
    if not chain or np.abs(along @ [along[0, 1], -along[0, 0]]).max() > STRAIGHT:
        return None
    xi, at = level.condensed(scene).problem.xi(u_T), np.concatenate([[0.0], np.cumsum(h)])
    density = (xi / line.c)[np.where(line.unknowns < 0, line.unknowns[:, ::-1], line.unknowns)]
    s = (mesh.points - line.ends[0, 0]) @ along[0]
    k = np.clip(np.searchsorted(at, s, side="right") - 1, 0, len(h) - 1)
    share = np.clip((at[k + 1] - s) / h[k], 0.0, 1.0)
    friction = np.concatenate([[0.0], np.cumsum(0.5 * h * density.sum(axis=1))])

    def sections(nodal: Array, rubs: bool) -> Array:
        """N of forces (2, n) on nodes; rubs: whether friction is among them, which acts along the
        cells."""
        force = along[0] @ nodal
        if rubs:
            force[line.nodes] += xi
        before = np.cumsum(np.bincount(k, force, len(h))) - np.bincount(k, force, len(h))
        rest = -before - np.bincount(k, force * share, len(h))  # between the ends of every segment
        middle = 0.5 * (at[1:] + at[:-1])
        if len(h) > 1:  # at the ends of the line it goes on as it begins
            slopes = (np.diff(rest) / np.diff(middle))[[0, -1]]
            ends = [rest[0] - slopes[0] * middle[0]], [rest[-1] + slopes[1] * (at[-1] - middle[-1])]
            rest, middle = (
                np.concatenate([ends[0], rest, ends[1]]),
                np.concatenate([[0.0], middle, at[-1:]]),
            )
        return np.interp(at, middle, rest) + (friction if rubs else 0.0)

    contact = mesh.owner[mesh.on(*scene.edges(Contact))]
    pulled, found = (
        np.einsum(
            "tij,tkj->tki", sigma[:, [[0, 2], [2, 1]]] * mesh.area[:, None, None], mesh.slopes
        ),
        {},
    )
    for name in (
        "",
        *(name for name, _ in scene.material.regions),
    ):  # the body, regions with a material of their own
        nodal, own = np.zeros((2, mesh.n_points)), mesh.inside((name,) if name else ())
        np.add.at(nodal.T, mesh.triangles[own], pulled[own])
        found[name] = sections(nodal, bool(own[contact].all()))
    return found.pop(""), found, at


OUTSIDE = 0.1
"""How far outside all triangles a point may lie, in barycentric coordinates: between a chord and
its arc, say."""


@dataclass(frozen=True)
class RequestedOutputs:
    """What a study asks for, on one level."""

    level: Level
    output: OutputPlan

    def of(self, scene: Scene, u_T: Array) -> dict[str, Any]:
        """The numbers by variable name (data.schema) at a solution u_T (m,) of a scene; N is
        (m,)."""
        level, wanted, mesh, found = (
            self.level,
            self.output.quantities,
            self.level.mesh,
            dict[str, Any](),
        )
        u, warm = level.displacement(scene, u_T), scene.material.expands
        theta = level.temperature(scene).theta if warm else np.zeros(mesh.n_points)
        stressed = self.output.probes or {"von_mises", "section_force"} & {*wanted}
        sigma = self._stress(scene, u, theta) if stressed else None
        if sigma is not None:
            found |= self._probes(u, theta if warm else theta + np.nan, sigma)
            if "von_mises" in wanted:
                xx, yy, xy, zz = sigma.T
                size = np.sqrt(
                    0.5 * ((xx - yy) ** 2 + (yy - zz) ** 2 + (zz - xx) ** 2) + 3.0 * xy**2
                )
                x, y = mesh.corners[worst := int(np.argmax(size))].mean(axis=0)
                found |= {
                    "von_mises_max": float(size[worst]),
                    "von_mises_x": float(x),
                    "von_mises_y": float(y),
                }
        for kind, forces in (("reaction", support_forces), ("force", edge_forces)):
            for name, force in forces(level, scene, u).items() if f"{kind}s" in wanted else ():
                x, y = force.sum(axis=1)
                found |= {f"{kind}_{name}_x": float(x), f"{kind}_{name}_y": float(y)}
                found |= {f"work_{name}": float(force.ravel() @ u)} if kind == "force" else {}
        if (
            "section_force" in wanted
            and sigma is not None
            and (section := section_force(level, scene, u_T, sigma))
        ):
            N, layers, at = section
            most = int(np.argmax(np.abs(N) >= (1.0 - EQUAL) * np.abs(N).max()))
            free = np.append(level.line.unknowns[:, 0], level.line.unknowns[-1, 1]) >= 0
            found |= {
                "section_force_max": float(N[most]),
                "section_force_at": float(at[most]),
                "section_force": N[free],
            }
            found |= {f"layer_force_{name}": of_layer[free] for name, of_layer in layers.items()}
        for name, _ in scene.boundary if "theta_edges" in wanted and warm else ():
            ends = mesh.segments[mesh.on(name)]
            length = np.hypot(*(mesh.points[ends[:, 1]] - mesh.points[ends[:, 0]]).T)
            found[f"theta_mean_{name}"] = float(length @ theta[ends].mean(axis=1) / length.sum())
        return found

    def _stress(self, scene: Scene, u: Array, theta: Array) -> Array:
        """(t, 4) σ_xx, σ_yy, σ_xy, σ_zz of the triangles [Pa]."""
        mesh, strain = self.level.mesh, own_strain(self.level.mesh, u)
        lam, mu, beta = (mesh.of_material(scene, name) for name in ("lam", "mu", "beta"))
        sigma = np.column_stack([stress_of(strain, lam, mu), lam * (strain[:, 0] + strain[:, 1])])
        sigma[:, [0, 1, 3]] -= (beta * theta[mesh.triangles].mean(axis=1))[:, None]
        for where, material in scene.pieces:
            sigma[mesh.inside(where), 3] *= material.plane == "strain"
        return sigma

    def _probes(self, u: Array, theta: Array, sigma: Array) -> dict[str, float]:
        line, components, found = self.level.line, u.reshape(2, -1), dict[str, float]()
        for probe in self.output.probes:
            inside = self.level.mesh.barycentric(np.array(probe.at))
            triangle, start = int(np.argmax(inside.min(axis=1))), f"probe_{probe.name}"
            nodes, weights = self.level.mesh.triangles[triangle], inside[triangle]
            if weights.min() <= -OUTSIDE:
                continue
            at = components[:, nodes] @ weights
            found |= {
                f"{start}_u_x": at[0],
                f"{start}_u_y": at[1],
                f"{start}_theta": theta[nodes] @ weights,
            }
            found |= {
                f"{start}_sigma_{c}": sigma[triangle, i] for i, c in enumerate(("xx", "yy", "xy"))
            }
            if probe.on_contact:
                # the contact line's ends may be held, so that u_T is that of the segment that is
                # nearest
                k, share = line.nearest(probe.at)
                first, second = components[:, line.segments[k]].T
                along = line.ends[k, 1] - line.ends[k, 0]
                value: Array = (1.0 - share) * first + share * second
                found[f"{start}_u_T"] = float(value @ along) / float(np.hypot(*along))
        return {name: float(value) for name, value in found.items()}
