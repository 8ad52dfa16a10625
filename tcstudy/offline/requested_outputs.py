"""Results of a solved point: lengths along Γ_C, forces of edges and sections, requested quantities.

Lengths:  u_T is linear between the nodes of Γ_C, so that the part of a segment with slips up to a
          breakpoint s of its law is (s − min u_T)/(max u_T − min u_T), and lengths of regions
          (`LawPieces.regions`) are exact differences of such parts. The law of a segment is that of
          its edge; where strength varies along it, each half has the law of its own node
Edges:    what loads, springs and supports of an edge do at its nodes: g, p, resultants, −S_e u, and
          r = Au + Su − l_θ where the edge holds or touches the body; their sum with ∫f is 0 to
          rounding. Work: force times displacement
Sections: N(s), positive in tension, is −Σ_{s_j < s} F_j·t of all forces F_j on the nodes before the
          section across Γ_C at s, as the triangles have them there, ∫σ:∇φ. Of a segment the mean
          over its sections is taken, which is exact for nodal forces of P1: l(φt), φ = 1 before it,
          0 behind it and linear on it, is a(u, φt) but for rounding. Friction adds ∫ξ/c over the
          cells S_i, so that N(s) between the middles of segments is exact where the line carries no
          other load
Layers:   N of a region with a material of its own, of the forces of its triangles; with that of the
          rest they sum to that of the body. What passes between two layers is that of P1, so that N
          of one has an error that falls with h
Stress:   σ = cε(u) − βθI, one on each triangle, θ being its mean there; in plane strain σ_zz = λ
          div u − βθ
Left out: lines that bend.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tcstudy.fem.energy_error import own_strain, stress_of
from tcstudy.laws.laws import Laws
from tcstudy.laws.pieces import BARE, DEBONDED, REGIONS, UP
from tcstudy.offline.level import Level, mechanical_terms
from tcstudy.scene.records import Clamped, Contact, Free, Scene
from tcstudy.scene.study import OutputPlan, Probe

Array = NDArray[np.float64]
EQUAL = 1e-9
"""Relative difference up to which tractions count as equal, as on a plateau of b."""


def line_numbers(
    level: Level, scenes: Sequence[Scene], laws: Laws, v: Array, xi: Array
) -> dict[str, Array]:
    """Return results (P,) along the contact line by name.

    They are `shear_max` [Pa], `shear_max_at` and `<region>_length` [m], NaN where a point's laws
    have no such region, and `held_u_T` (P, h) of held ends [m]. The first of equal tractions
    counts.

    laws: of rows (P, 1) or (P, m);  v, xi: (P, m) slips [m] and tractions [Pa]
    """
    held = of_boundaries(scenes, level.held_slips)
    results = region_lengths(level, laws, v, held)
    if held.size:
        results["held_u_T"] = held
    slipping = np.where(laws.kind(laws.locate(v)) == UP, 0.0, level.line.c)
    has_no_slip = np.isnan(results.get("breathing_length", np.nan))
    shear = np.abs(xi)
    largest = np.max(shear, axis=1)
    first_largest = np.argmax(shear >= (1.0 - EQUAL) * largest[:, None], axis=1)
    return results | {
        "slip_length": np.where(has_no_slip, np.nan, slipping.sum(axis=1)),
        "shear_max": largest,
        "shear_max_at": level.line.arclength[first_largest],
    }


def of_boundaries(scenes: Sequence[Scene], values: Callable[[Scene], Array]) -> Array:
    """Return values (P, …) that depend on the boundary of scenes, made once for each boundary."""
    scene_of_boundary = {id(scene.boundary): scene for scene in scenes}
    of_boundary = {key: values(scene) for key, scene in scene_of_boundary.items()}
    return np.array([of_boundary[id(scene.boundary)] for scene in scenes])


def region_lengths(level: Level, laws: Laws, v: Array, held: Array) -> dict[str, Array]:
    """Return lengths (P,) of the regions of the laws along Γ_C by name [m].

    laws: of rows (P, 1) or (P, m)
    held: (P, h) slips of the held ends of segments, NaN for that of the node beside it
    """
    line = level.line
    index = laws.index
    by_node = laws.index.shape[1] > 1
    lengths = line.lengths
    is_held = line.unknowns < 0
    ends = v[:, np.where(is_held, line.own_law, line.unknowns)]
    ends[:, is_held] = np.where(np.isnan(held), ends[:, is_held], held)
    first = ends[..., 0]
    second = ends[..., 1]
    if by_node:
        middle = 0.5 * (first + second)
        first = np.hstack([first, middle])
        second = np.hstack([middle, second])
        lengths = np.tile(0.5 * lengths, 2)
        index = index[:, line.own_law.T.ravel()]
    low = np.minimum(first, second)
    high = np.maximum(first, second)
    uniform = low == high
    # what sticks at an up-jump is in no region
    sticks = uniform & (laws.kind(laws.locate(low, index)) == UP)
    counted_lengths = lengths * ~sticks
    changes = np.any(np.diff(laws.regions, axis=1) != 0, axis=0)  # breakpoints between regions
    kinks = laws.kinks[:, changes][index]
    regions = laws.regions[:, np.append(changes, True)][index]
    width = np.where(uniform, 1.0, high - low)[..., None]
    linear_share = np.clip((kinks - low[..., None]) / width, 0.0, 1.0)
    share_below = np.where(uniform[..., None], kinks >= high[..., None], linear_share)
    shares = np.diff(share_below, axis=-1, prepend=0.0, append=1.0)
    parts = counted_lengths[..., None] * shares  # (P, s, pieces)
    # a node at a joint has a composed law; those of its edges count
    law_numbers = np.delete(laws.index, line.joints.node, axis=1) if by_node else laws.index
    results = dict[str, Array]()
    for region in np.unique(laws.regions):
        has_region = np.any(laws.regions == region, axis=1)[law_numbers].any(axis=1)
        if region != BARE and np.any(has_region):
            total = np.sum(parts, axis=(1, 2), where=regions == region)
            results[f"{REGIONS[region]}_length"] = np.where(has_region, total, np.nan)
    can_stick = np.any(laws.kinds == UP, axis=1)[law_numbers].any(axis=1)
    if np.any(can_stick):
        slip_lengths = ((first != 0.0) | (second != 0.0)) @ lengths
        results["breathing_length"] = np.where(can_stick, slip_lengths, np.nan)
    return results


def debonded_front(level: Level, law: Laws, kappa: Array) -> dict[str, float]:
    """Return the arclengths `debonded_from` and `debonded_to` of the debonded part of a bond [m].

    It is debonded where the slip or the opening is, from the first such place to the last. They are
    NaN where nothing is debonded; the dictionary is empty for laws without such a branch.

    law:   of all unknowns
    kappa: (m,) largest slips and openings so far, linear between nodes [m]
    """
    table = law.tables
    debonded = (table.regions == DEBONDED) & (table.lower >= 0.0)
    if not np.any(debonded):
        return {}
    limit = np.min(np.where(debonded, table.lower, np.inf), axis=1)
    beyond_of_slips, beyond_of_openings = level.split(kappa - limit[law.node_index(level.m)])
    line = level.line
    length = float(line.lengths.sum())
    fronts = [_front(beyond_of_slips, line.arclength, (0.0, length))]
    opening = level.opening
    if opening is not None:
        starts = np.cumsum(line.lengths) - line.lengths
        begin = float(starts[opening.which[0]])
        end = float((starts + line.lengths)[opening.which[-1]])
        fronts.append(_front(beyond_of_openings, opening.arclength, (begin, end)))
    begins, ends = np.array([front for front in fronts if front]).reshape(-1, 2).T
    if not len(begins):
        return {"debonded_from": np.nan, "debonded_to": np.nan}
    return {"debonded_from": float(begins.min()), "debonded_to": float(ends.max())}


def _front(beyond: Array, x: Array, line_ends: tuple[float, float]) -> tuple[float, ...]:
    """Return the arclengths of the first and the last place at or above 0, () without any [m].

    beyond: (k,) values at the nodes x (k,), linear between them;  line_ends: of the line [m]
    """
    nodes = np.flatnonzero(beyond >= 0.0)
    if not len(nodes):
        return ()

    def front(node: int, neighbour: int, line_end: float) -> float:
        if not 0 <= neighbour < len(x):
            return line_end
        share = beyond[node] / (beyond[node] - beyond[neighbour])
        return float(x[node] + share * (x[neighbour] - x[node]))

    begin, end = line_ends
    return front(nodes[0], nodes[0] - 1, begin), front(nodes[-1], nodes[-1] + 1, end)


STRAIGHT = 1e-9
"""Sine of the angle up to which two segments of the contact line have one direction."""


def supported_nodes(level: Level, scene: Scene) -> dict[str, NDArray[np.bool_]]:
    """Return which nodes (n,) clamped and contact edges hold or touch, by name.

    A node where two of them meet counts to the first, clamped before contact.
    """
    counted = np.zeros(level.mesh.n_points, dtype=bool)
    nodes = dict[str, NDArray[np.bool_]]()
    for name, role in sorted(scene.boundary, key=lambda item: not isinstance(item[1], Clamped)):
        if isinstance(role, Clamped | Contact):
            on_edge = np.isin(np.arange(len(counted)), level.mesh.nodes_on(name))
            nodes[name] = on_edge & ~counted
            counted |= on_edge
    return nodes


def support_forces(level: Level, scene: Scene, u: Array) -> dict[str, Array]:
    """Return the nodal forces (2, n) of clamped and contact edges, Au + Su − l_θ there [N/m]."""
    reactions = level.reactions(scene, u).reshape(2, -1)
    nodes_of_edge = supported_nodes(level, scene)
    return {name: np.where(nodes, reactions, 0.0) for name, nodes in nodes_of_edge.items()}


def edge_forces(level: Level, scene: Scene, u: Array) -> dict[str, Array]:
    """Return the nodal forces (2, n) of every edge that is not free [N/m].

    u: (2n,) displacement [m]
    """
    forces = support_forces(level, scene, u)
    for name, role in scene.boundary:
        if isinstance(role, Free):
            continue
        springs = ((name, *role.spring),) if any(role.spring) else ()
        force = -level.forces(u, (), springs)
        terms = mechanical_terms((0.0, 0.0), ((name, role),))
        force += sum(factor * level.vector(load) for load, factor in terms)
        forces[name] = forces.get(name, 0.0) + force.reshape(2, -1)
    return forces


def section_force(
    level: Level, scene: Scene, v: Array, sigma: Array
) -> tuple[Array, dict[str, Array], Array] | None:
    """Return N (s + 1,) at the nodes of Γ_C, of the body and by layer [N/m], and arc lengths [m].

    Held nodes are included; layers are regions with a material of their own. None for a line that
    bends.

    v: (m,) contact unknowns [m];  sigma: (t, 4) stress [Pa]
    """
    line = level.line
    mesh = level.mesh
    lengths = line.lengths
    tangents = (line.ends[:, 1] - line.ends[:, 0]) / lengths[:, None]
    tangent = tangents[0]
    is_chain = np.array_equal(line.segments[1:, 0], line.segments[:-1, 1])
    sines = tangents @ [tangent[1], -tangent[0]]
    if not is_chain or np.abs(sines).max() > STRAIGHT:
        return None
    xi, _ = level.split(level.condensed(scene).problem.xi(v))
    node_at = np.concatenate([[0.0], np.cumsum(lengths)])
    unknowns = np.where(line.unknowns < 0, line.unknowns[:, ::-1], line.unknowns)
    traction = (xi / line.c)[unknowns]
    friction = np.concatenate([[0.0], np.cumsum(0.5 * lengths * traction.sum(axis=1))])
    s = (mesh.points - line.ends[0, 0]) @ tangent
    segment = np.clip(np.searchsorted(node_at, s, side="right") - 1, 0, len(lengths) - 1)
    share = np.clip((node_at[segment + 1] - s) / lengths[segment], 0.0, 1.0)

    def section_forces(nodal: Array, with_friction: bool) -> Array:
        """Return N of nodal forces (2, n); friction, if among them, acts along the cells."""
        force = tangent @ nodal
        if with_friction:
            force[line.nodes] += xi
        in_segment = np.bincount(segment, force, len(lengths))
        before = np.cumsum(in_segment) - in_segment
        N = -before - np.bincount(segment, force * share, len(lengths))  # means of the segments
        middle = 0.5 * (node_at[1:] + node_at[:-1])
        if len(lengths) > 1:  # linear extrapolation to the ends of the line
            slopes = (np.diff(N) / np.diff(middle))[[0, -1]]
            N_begin = N[0] - slopes[0] * middle[0]
            N_end = N[-1] + slopes[1] * (node_at[-1] - middle[-1])
            N = np.concatenate([[N_begin], N, [N_end]])
            middle = np.concatenate([[0.0], middle, node_at[-1:]])
        return np.interp(node_at, middle, N) + (friction if with_friction else 0.0)

    contact_triangles = mesh.owner[mesh.on(*scene.edges(Contact))]
    stress = sigma[:, [[0, 2], [2, 1]]] * mesh.area[:, None, None]
    corner_forces = np.einsum("tij,tkj->tki", stress, mesh.slopes)
    results = dict[str, Array]()
    for region in ("", *(name for name, _ in scene.material.regions)):  # "": the whole body
        nodal = np.zeros((2, mesh.n_points))
        inside = mesh.inside((region,) if region else ())
        np.add.at(nodal.T, mesh.triangles[inside], corner_forces[inside])
        results[region] = section_forces(nodal, bool(inside[contact_triangles].all()))
    return results.pop(""), results, node_at


MAX_OUTSIDE = 0.1
"""Largest distance of a point outside all triangles, in barycentric coordinates.

A point between a chord and its arc is outside, for example.
"""


@dataclass(frozen=True)
class RequestedOutputs:
    """The requested quantities of a study on one level."""

    level: Level
    output: OutputPlan

    def of(self, scene: Scene, v: Array) -> dict[str, Any]:
        """Return the requested variables by name (data.schema) at a solution v (m,) of a scene.

        All are numbers but N, which is (m,).
        """
        level = self.level
        quantities = self.output.quantities
        u = level.displacement(scene, v)
        is_warm = scene.material.expands
        theta = np.zeros(level.mesh.n_points)
        if is_warm:
            theta = level.temperature(scene).theta
        variables = dict[str, Any]()
        if self.output.probes or {"von_mises", "section_force"} & {*quantities}:
            sigma = self._stress(scene, u, theta)
            for probe in self.output.probes:
                variables |= self._probe_values(probe, u, theta if is_warm else None, sigma)
            if "von_mises" in quantities:
                variables |= self._von_mises(sigma)
        if "reactions" in quantities:
            for name, force in support_forces(level, scene, u).items():
                variables |= _resultant(f"reaction_{name}", force)
        if "forces" in quantities:
            for name, force in edge_forces(level, scene, u).items():
                variables |= _resultant(f"force_{name}", force)
                variables[f"work_{name}"] = float(force.ravel() @ u)
        if "section_force" in quantities:
            variables |= self._section_forces(scene, v, sigma)
        if "theta_edges" in quantities and is_warm:
            variables |= self._edge_means(scene, theta)
        return variables

    def _von_mises(self, sigma: Array) -> dict[str, float]:
        xx, yy, xy, zz = sigma.T
        normal_part = (xx - yy) ** 2 + (yy - zz) ** 2 + (zz - xx) ** 2
        von_mises = np.sqrt(0.5 * normal_part + 3.0 * xy**2)
        triangle = int(np.argmax(von_mises))
        x, y = self.level.mesh.corners[triangle].mean(axis=0)
        return {
            "von_mises_max": float(von_mises[triangle]),
            "von_mises_x": float(x),
            "von_mises_y": float(y),
        }

    def _section_forces(self, scene: Scene, v: Array, sigma: Array) -> dict[str, Any]:
        """Return the section forces of the body and its layers, nothing for a line that bends."""
        section = section_force(self.level, scene, v, sigma)
        if section is None:
            return {}
        N, layers, arclength = section
        size = np.abs(N)
        largest = int(np.argmax(size >= (1.0 - EQUAL) * size.max()))
        unknowns = self.level.line.unknowns
        is_free = np.append(unknowns[:, 0], unknowns[-1, 1]) >= 0
        variables: dict[str, Any] = {
            "section_force_max": float(N[largest]),
            "section_force_at": float(arclength[largest]),
            "section_force": N[is_free],
        }
        for name, layer_force in layers.items():
            variables[f"layer_force_{name}"] = layer_force[is_free]
        return variables

    def _edge_means(self, scene: Scene, theta: Array) -> dict[str, float]:
        mesh = self.level.mesh
        means = dict[str, float]()
        for name, _ in scene.boundary:
            ends = mesh.segments[mesh.on(name)]
            along = mesh.points[ends[:, 1]] - mesh.points[ends[:, 0]]
            lengths = np.hypot(*along.T)
            mean = lengths @ theta[ends].mean(axis=1) / lengths.sum()
            means[f"theta_mean_{name}"] = float(mean)
        return means

    def _stress(self, scene: Scene, u: Array, theta: Array) -> Array:
        """Return σ_xx, σ_yy, σ_xy, σ_zz (t, 4) of the triangles [Pa]."""
        mesh = self.level.mesh
        strain = own_strain(mesh, u)
        lam, mu, beta = (mesh.of_material(scene, name) for name in ("lam", "mu", "beta"))
        sigma_zz = lam * (strain[:, 0] + strain[:, 1])
        sigma = np.column_stack([stress_of(strain, lam, mu), sigma_zz])
        thermal_stress = beta * theta[mesh.triangles].mean(axis=1)
        sigma[:, [0, 1, 3]] -= thermal_stress[:, None]
        for where, material in scene.pieces:
            sigma[mesh.inside(where), 3] *= material.plane == "strain"
        return sigma

    def _probe_values(
        self, probe: Probe, u: Array, theta: Array | None, sigma: Array
    ) -> dict[str, float]:
        """Return u, θ, σ and, on Γ_C, u_T at a probe; nothing for a point outside the mesh."""
        mesh = self.level.mesh
        barycentric = mesh.barycentric(np.array(probe.at))
        triangle = int(np.argmax(barycentric.min(axis=1)))
        nodes = mesh.triangles[triangle]
        weights = barycentric[triangle]
        if weights.min() <= -MAX_OUTSIDE:
            return {}
        u_x, u_y = u.reshape(2, -1)[:, nodes] @ weights
        xx, yy, xy, _ = sigma[triangle]
        values = {
            "u_x": u_x,
            "u_y": u_y,
            "theta": np.nan if theta is None else theta[nodes] @ weights,
            "sigma_xx": xx,
            "sigma_yy": yy,
            "sigma_xy": xy,
        }
        if probe.on_contact:
            values["u_T"] = self._slip_at(probe, u)
        return {f"probe_{probe.name}_{name}": float(value) for name, value in values.items()}

    def _slip_at(self, probe: Probe, u: Array) -> float:
        """Return u_T at a probe, that of the nearest segment: ends of Γ_C may be held."""
        line = self.level.line
        segment, share = line.nearest(probe.at)
        first, second = u.reshape(2, -1)[:, line.segments[segment]].T
        along = line.ends[segment, 1] - line.ends[segment, 0]
        displacement: Array = (1.0 - share) * first + share * second
        return float(displacement @ along) / float(np.hypot(*along))


def _resultant(name: str, force: Array) -> dict[str, float]:
    x, y = force.sum(axis=1)
    return {f"{name}_x": float(x), f"{name}_y": float(y)}
