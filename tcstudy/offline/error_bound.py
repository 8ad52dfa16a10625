"""How far any solution u of the body can be from u_h, in the energy norm: a bound without unknown
constants.

Let τ be admissible (div τ + f = 0, τn = g, resultants on rigid edges), as the stress of equilibrium
elements is, ξ* = −τ_T on Γ_C, η = ‖cε(u_h) − βθI − τ‖_{c⁻¹}, and w ≥ 0. With e = u − u_h, ‖e‖² =
a(e, e), and ξ ∈ b̂(u_T)
    ‖e‖² = ∫(τ + βθI − cε(u_h)):ε(e) + ∫_{Γ_C}(ξ* − ξ)e_T ≤ η‖e‖ + w∫e_T² + M,
    M = ∫_{Γ_C} sup_{(s,ξ) ∈ graph b̂} [(ξ* − ξ)(s − u_hT) − w(s − u_hT)²],   ∫e_T² ≤ ‖e‖²/λ_low,
so that with k = 1 − w/λ_low > 0
    ‖u − u_h‖ ≤ (η + √(η² + 4kM))/2k.
Springs add their energy to a, and that of w − u_h to η². τ is that of the contact problem on the
equilibrium elements, whose ξ* lies in b̂ at the Gauss points, and the best of some w is taken; any
would do. Where the temperature is computed, η grows by the bound T of its error (heat_bound.py): with
ε = θ − θ_h the first integral gains ∫βε tr ε(e) ≤ ‖ε‖_ρ‖e‖, as c⁻¹I:I = 1/(λ + μ).

η:    on a triangle cε(u_h) = N G⁻¹Pᵀw_h with w_h = u_h at the Gauss points of its edges, so that nothing cancels in
      η² = (w_h − w)ᵀK̂(w_h − w) + Σ_K ‖(I − Π)(τ_p + βθI)‖²   (guaranteed.py).
M:    along an edge ξ* and u_hT are linear and sup + ξ*u_hT + wu_hT² is convex: the trapezoidal rule is no less.
      An exponential law b has a polygon within ε, and ε|x| ≤ δx² + ε²/4δ: k is less by δ/λ_low, M
      more by ε²|Γ_C|/4δ.
Left out: f, g, θ, given u and strengths of friction that are not as the elements have them
(`why_no_bound`).
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from tcstudy.contact.solve import solve_block
from tcstudy.fem.energy_error import acting, own_strain, stress_of
from tcstudy.fem.forms import values_at
from tcstudy.laws.composed import nodal, piecewise_linear
from tcstudy.laws.laws import Laws
from tcstudy.offline.heat import Recent
from tcstudy.offline.heat_bound import HeatBounds
from tcstudy.offline.level import Level
from tcstudy.scene.guarantee import why_no_bound
from tcstudy.scene.points import needs_heat_solve
from tcstudy.scene.records import Scene

Array = NDArray[np.float64]

PARTS = 16
"""Parts of a segment in the trapezoidal rule for M."""
WEIGHTS = np.geomspace(1e-5, 0.8, 12)
"""Values of w that are tried, relative to λ_low from 0 and from ω on.

From ω on the bound converges; where no softening part of the law is near, smaller w are better."""
POLYGON_ERROR = 1e-4
"""Error of the polygon of an exponential law, relative to the scale of b."""
POLYGON_SHARE = 3e-3
"""Share of λ_low that is spent on that error."""


@dataclass(frozen=True)
class _Load:
    """The load of equilibrium elements: L⁻¹F (N,), prescribed w (4e,), Σ_K ‖(I − Π)ρ‖² [J/m]."""

    rows: Array
    given: Array
    rest: float


@dataclass
class ErrorBounds:
    """The bounds of one level."""

    level: Level
    _loads: Recent[_Load] = field(default_factory=lambda: Recent(8, lambda _: 1))
    _heat: HeatBounds = field(init=False)
    _polygons: Recent[Laws] = field(default_factory=lambda: Recent(64, lambda _: 1))

    def __post_init__(self) -> None:
        self._heat = HeatBounds(self.level.mesh)

    def look(self, scene: Scene, v: Array) -> dict[str, float]:
        """Return the stored variables of the bound for a solution v (m,), NaN without a proof."""
        level, mesh = self.level, self.level.mesh
        if why_no_bound(scene):
            return {"error_bound": float("nan"), "error_bound_relative": float("nan")}
        line, law, low = level.line, self.law(scene), level.band(scene).low
        u = level.displacement(scene, v).reshape(2, -1).T
        eta, xi = self.equilibrated(scene, law, u)
        eta += self.thermal_part(scene)
        along = (line.ends[:, 1] - line.ends[:, 0]) / line.lengths[:, None]
        slip = np.einsum("sed,sd->se", u[line.segments], along)
        starts = [0.0, law.omega] if law.omega < low else [0.0]
        w = np.concatenate([start + (low - start) * WEIGHTS for start in starts])
        law, polygon_error = self._polygon(law)
        slack = POLYGON_SHARE * low if polygon_error > 0.0 else 0.0
        M = consistency(law, line.lengths, xi, slip, w)
        k = 1.0 - (w + slack) / low
        M, k = M[k > 0.0], k[k > 0.0]
        if slack:
            M = M + polygon_error**2 * line.lengths.sum() / (4.0 * slack)
        bound = float(np.min((eta + np.sqrt(eta**2 + 4.0 * k * M)) / (2.0 * k)))
        strain = own_strain(mesh, u.T.ravel())
        stress = stress_of(strain, mesh.of_material(scene, "lam"), mesh.of_material(scene, "mu"))
        energy_density = (stress * strain * [1.0, 1.0, 2.0]).sum(axis=1)
        # a lower bound of ‖u_h‖, since the energy of springs is left out, and then of ‖u‖
        norm = float(np.sqrt(mesh.area @ energy_density))
        least_norm = norm - bound
        relative = bound / least_norm if least_norm > 0.0 else float("nan")
        return {"error_bound": bound, "error_bound_relative": relative}

    def thermal_part(self, scene: Scene) -> float:
        """Return T of a computed temperature (heat_bound.py) [√(J/m)], 0 for a given one."""
        if not (scene.material.expands and needs_heat_solve(scene)):
            return 0.0
        return self._heat.bound(scene, self.level.temperature(scene).theta)

    def equilibrated(self, scene: Scene, law: Laws, u: Array) -> tuple[float, Array]:
        """Return η [√(J/m)] and ξ* (s, 2) at the ends of the segments of Γ_C [Pa].

        u: (n, 2) the displacement u_h
        """
        (dual, factor), load = self.level.dual(scene), self._load(scene)
        if factor != 1.0:
            law = law.placed(1.0 / factor)
        law_of_segment = np.broadcast_to(law.index, len(dual.c) // 2)
        at_gauss = law.tables.at(np.repeat(law_of_segment, 2)[None])
        rows = load.rows / factor
        l_tilde = dual.condensation.condensed(rows)
        solution = solve_block(dual.contact, l_tilde[None], at_gauss, "from-zero", prove=False)
        w = dual.condensation.expand(solution.v[0], rows)
        if dual.ties is not None:
            w = dual.ties @ w
        difference = dual.rows(u) - load.given - w
        eta2 = factor * float(difference @ (dual.K @ difference)) + load.rest / factor
        traction = (factor * solution.xi[0] / dual.c).reshape(-1, 2)
        change = np.sqrt(3.0) * (traction[:, 1] - traction[:, 0])
        xi = traction.mean(axis=1)[:, None] + np.multiply.outer(change, [-0.5, 0.5])
        return float(np.sqrt(eta2)), xi

    def _polygon(self, law: Laws) -> tuple[Laws, float]:
        """Return a piecewise-linear law and the largest distance of b from it [Pa]."""
        if law.piecewise_linear:
            return law, 0.0

        def polygon(single_law: Laws) -> Laws:
            # beyond `end` the exponentials have decayed
            end = np.abs([*single_law.kinks, *single_law.s_0]).max()
            end = end + sum(100.0 / np.abs(r[a != 0.0]).min() for a, r in single_law.exponentials)
            return piecewise_linear(single_law, POLYGON_ERROR, float(end))

        polygons = self._polygons.of(law, lambda: law.mapped(polygon))
        return polygons, POLYGON_ERROR * law.b_scale

    def _load(self, scene: Scene) -> _Load:
        """Return the load of a scene on its equilibrium elements; the last ones are kept."""
        _, factor = self.level.dual(scene)
        key = scene.f, scene.boundary, scene.heat, scene.material, factor
        return self._loads.of(key, lambda: self._new_load(scene))

    def _new_load(self, scene: Scene) -> _Load:
        level, mesh = self.level, self.level.mesh
        dual, factor = level.dual(scene)
        thermal_stress = np.zeros((len(mesh.triangles), 3))
        frames = level.frames_of(scene.boundary)
        if scene.material.expands:
            corner_theta = level.temperature(scene).theta[mesh.triangles]
            thermal_stress = mesh.of_material(scene, "beta")[:, None] * corner_theta
        f = np.array([float(values_at(component, np.zeros(2))) for component in scene.f])
        F, rest = dual.elements.volume_load(f, thermal_stress)
        traction = np.zeros((len(mesh.segments), 2, 2))  # in x and y at the Gauss points
        for name, role in scene.boundary:
            on = mesh.on(name)
            points, normals = dual.gauss_points[on], mesh.boundary.normal[on]
            traction[on] = acting(mesh, name, role, points, normals)
        edge_loads = np.zeros((2, 2, len(dual.elements.axes)))
        half = 0.5 * mesh.boundary.length
        edge_loads[:, :, dual.number] = np.einsum("s,sgd,sdk->gks", half, traction, dual.axes)
        prescribed = frames.cartesian(frames.values).reshape(2, -1).T
        given = np.where(dual.held, dual.rows(prescribed), 0.0)
        F += edge_loads.ravel() - factor * (dual.K @ given)
        rows = dual.condensation.forward(F if dual.ties is None else dual.ties.T @ F)
        return _Load(rows, given, rest)

    def law(self, scene: Scene) -> Laws:
        """Return the law of every segment of Γ_C."""
        friction, line = scene.friction, self.level.line
        if isinstance(friction, Laws):
            return friction
        index, strength = friction.along(line.edge_names, line.segment_edge, line.ends.mean(axis=1))
        return nodal([law for _, law, _ in friction.laws], index, strength)


def consistency(law: Laws, lengths: Array, xi: Array, slip: Array, w: Array) -> Array:
    """Return M of the module's text (k,), or an upper bound of it, for several w (k,) [J/m].

    lengths: (s,);  xi, slip: (s, 2) ξ* and u_hT at the ends of segments of Γ_C
    """
    x = np.linspace(0.0, 1.0, PARTS + 1)

    def along_segments(ends: Array) -> Array:
        return np.multiply.outer(ends[:, 0], 1.0 - x) + np.multiply.outer(ends[:, 1], x)

    traction, v = along_segments(xi), along_segments(slip)
    suprema = np.empty((len(w), *v.shape))
    for segment_law, segments in law.groups(len(lengths)):
        suprema[:, segments] = _suprema(
            segment_law, traction[segments], v[segments], w[:, None, None]
        )
    mean = suprema @ np.concatenate([[0.5], np.ones(PARTS - 1), [0.5]]) / PARTS
    traction_change, slip_change = xi[:, 1] - xi[:, 0], slip[:, 1] - slip[:, 0]
    # the trapezoidal rule less the integral of ξ*v + wv²
    excess = (traction_change + w[:, None] * slip_change) * slip_change / (6.0 * PARTS**2)
    return np.asarray(np.maximum(mean + excess, 0.0) @ lengths)


def _suprema(law: Laws, xi: Array, v: Array, w: Array) -> Array:
    """Return sup of (ξ* − b(s))(s − v) − w(s − v)² over the graph of a piecewise-linear law.

    w > 0; all arrays are broadcast.
    """
    suprema = np.zeros(np.broadcast_shapes(v.shape, w.shape))  # s = v
    for low, high, s_0, b_0, q in zip(law.lower, law.upper, law.s_0, law.b_0, law.q, strict=True):
        # (slope − curvature·x) x with x = s − v; unbounded pieces have q ≥ 0
        slope = xi - b_0 - q * (v - s_0)
        curvature = q + w
        vertex = slope / np.where(curvature > 0.0, 2.0 * curvature, np.inf)
        candidates = [np.clip(vertex, low - v, high - v)]
        candidates += [end - v for end in (low, high) if np.isfinite(end)]
        for x in candidates:
            np.maximum(suprema, (slope - curvature * x) * x, out=suprema)
    return suprema
