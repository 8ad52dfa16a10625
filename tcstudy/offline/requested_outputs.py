"""Numbers of a solved point that a study asks for: u, θ and σ at points, reactions, θ by edge, the largest stress.

Stress:     σ = cε(u) − βθI, one on each triangle, θ being its mean there; in plane strain σ_zz = λ div u − βθ
Reactions:  r = Au + Su − l_θ at the nodes that are held or in contact (S: springs); Σ r + Σ loads − ΣSu = 0 to rounding
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tcstudy.fem.estimators import own_strain, stress_of
from tcstudy.offline.level import Level
from tcstudy.offline.line_numbers import EQUAL
from tcstudy.offline.section_forces import edge_forces, section_force, support_forces
from tcstudy.scene.records import Scene
from tcstudy.scene.study import OutputPlan, Probe
from tcstudy.shapes.triangles import TriangleGeometry

Array = NDArray[np.float64]
OUTSIDE = 0.1
"""How far outside all triangles a point may lie, in barycentric coordinates: between a chord and its arc, say."""


@dataclass(frozen=True)
class RequestedOutputs:
    """What a study asks for, on one level."""

    level: Level
    output: OutputPlan

    @cached_property
    def _places(self) -> dict[Probe, tuple[int, Array]]:
        """The triangle of every probe, and the barycentric coordinates in it."""
        return {probe: _place(self.level.mesh, np.array(probe.at)) for probe in self.output.probes}

    def of(self, scene: Scene, u_T: Array) -> dict[str, Any]:
        """The numbers by variable name (data.on_request) at a solution u_T (m,) of a scene; N is (m,)."""
        level, wanted, mesh, found = self.level, self.output.quantities, self.level.mesh, dict[str, Any]()
        u, warm = level.displacement(scene, u_T), scene.material.expands
        theta = level.temperature(scene).theta if warm else np.zeros(mesh.n_points)
        stressed = self.output.probes or {"von_mises", "section_force"} & {*wanted}
        sigma = self._stress(scene, u, theta) if stressed else None
        if sigma is not None:
            found |= self._probes(u, theta if warm else theta + np.nan, sigma)
            if "von_mises" in wanted:
                xx, yy, xy, zz = sigma.T
                size = np.sqrt(0.5 * ((xx - yy) ** 2 + (yy - zz) ** 2 + (zz - xx) ** 2) + 3.0 * xy**2)
                x, y = mesh.corners[worst := int(np.argmax(size))].mean(axis=0)
                found |= {"von_mises_max": float(size[worst]), "von_mises_x": float(x), "von_mises_y": float(y)}
        if "reactions" in wanted:
            for name, force in support_forces(level, scene, u).items():
                x, y = force.sum(axis=1)
                found |= {f"reaction_{name}_x": float(x), f"reaction_{name}_y": float(y)}
        if "forces" in wanted:
            for name, force in edge_forces(level, scene, u).items():
                x, y = force.reshape(2, -1).sum(axis=1)
                found |= {f"force_{name}_x": float(x), f"force_{name}_y": float(y), f"work_{name}": float(force @ u)}
        if "section_force" in wanted and sigma is not None and (section := section_force(level, scene, u, u_T, sigma)):
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
        for probe, (triangle, weights) in self._places.items():
            nodes, start = self.level.mesh.triangles[triangle], f"probe_{probe.name}"
            if triangle < 0:
                continue
            at = components[:, nodes] @ weights
            found |= {f"{start}_u_x": at[0], f"{start}_u_y": at[1], f"{start}_theta": theta[nodes] @ weights}
            found |= {f"{start}_sigma_{c}": sigma[triangle, i] for i, c in enumerate(("xx", "yy", "xy"))}
            if probe.on_contact:
                # the contact line's ends may be held, so that u_T is that of the segment that is nearest
                k, share = line.nearest(probe.at)
                first, second = components[:, line.segments[k]].T
                along = line.ends[k, 1] - line.ends[k, 0]
                value: Array = (1.0 - share) * first + share * second
                found[f"{start}_u_T"] = float(value @ along) / float(np.hypot(*along))
        return {name: float(value) for name, value in found.items()}


def _place(mesh: TriangleGeometry, at: Array) -> tuple[int, Array]:
    """(triangle, barycentric coordinates) of a point; −1 outside the body."""
    weights = mesh.barycentric(at)
    best = int(np.argmax(weights.min(axis=1)))
    return (best if weights[best].min() > -OUTSIDE else -1), weights[best]
