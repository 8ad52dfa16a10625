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
would do.

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
from tcstudy.offline.level import Level
from tcstudy.scene.guarantee import why_no_bound
from tcstudy.scene.records import Scene

Array = NDArray[np.float64]

PARTS = 16
"""Of an edge in the trapezoidal rule for M."""
WEIGHTS = np.geomspace(1e-5, 0.8, 12)
"""w that are tried, over λ_low from 0 and from ω on: with the latter the bound converges, but where
nothing of what falls is near, smaller ones are better."""
POLYGON, FREE = 1e-4, 3e-3
"""Error of the polygon of an exponential law over the scale of b, and the share of λ_low that is
spent on it."""


@dataclass(frozen=True)
class _Load:
    """What loads the equilibrium elements of a scene: L⁻¹F (N,), given w (4e,), Σ_K ‖(I − Π)ρ‖²
    [J/m]."""

    rows: Array
    given: Array
    rest: float


@dataclass
class ErrorBounds:
    """The bounds of one level."""

    level: Level
    _loads: Recent[_Load] = field(default_factory=lambda: Recent(8, lambda _: 1))
    _polygons: Recent[Laws] = field(default_factory=lambda: Recent(64, lambda _: 1))

    def look(self, scene: Scene, v: Array) -> dict[str, float]:
        """What is stored of the bound for a solution v (m,), by variable name; NaN where nothing is
        proved."""
        level = self.level
        if why_no_bound(scene):
            return {"error_bound": float("nan"), "error_bound_relative": float("nan")}
        line, law, low = level.line, self.law(scene), level.band(scene).low
        u = level.displacement(scene, v).reshape(2, -1).T
        eta, xi = self.equilibrated(scene, law, u)
        along = (line.ends[:, 1] - line.ends[:, 0]) / line.lengths[:, None]
        slip = np.einsum("sed,sd->se", u[line.segments], along)
        starts = [0.0, law.omega] if law.omega < low else [0.0]
        w = np.concatenate([start + (low - start) * WEIGHTS for start in starts])
        law, error = self._polygon(law)
        slack = FREE * low if error > 0.0 else 0.0
        M, k = consistency(law, line.lengths, xi, slip, w), 1.0 - (w + slack) / low
        M, k = (
            M[k > 0.0] + (error**2 * line.lengths.sum() / (4.0 * slack) if slack else 0.0),
            k[k > 0.0],
        )
        bound = float(np.min((eta + np.sqrt(eta**2 + 4.0 * k * M)) / (2.0 * k)))
        mesh, strain = level.mesh, own_strain(level.mesh, u.T.ravel())
        stress = stress_of(strain, *(mesh.of_material(scene, name) for name in ("lam", "mu")))
        norm = float(
            np.sqrt(mesh.area @ (stress * strain * [1.0, 1.0, 2.0]).sum(axis=1))
        )  # without springs: no more
        left = norm - bound  # of ‖u‖, no more
        return {
            "error_bound": bound,
            "error_bound_relative": bound / left if left > 0.0 else float("nan"),
        }

    def equilibrated(self, scene: Scene, law: Laws, u: Array) -> tuple[float, Array]:
        """η [√(J/m)] of a displacement u (n, 2), and (s, 2) ξ* at the ends of the segments of Γ_C
        [Pa]."""
        (dual, factor), load = self.level.dual(scene), self._load(scene)
        law = law if factor == 1.0 else law.placed(1.0 / factor)
        at_gauss = law.tables.at(np.repeat(np.broadcast_to(law.index, len(dual.c) // 2), 2)[None])
        rows = load.rows / factor
        l_tilde = dual.condensation.condensed(rows)
        found = solve_block(dual.contact, l_tilde[None], at_gauss, "from-zero", prove=False)
        w = dual.condensation.expand(found.v[0], rows)
        apart = dual.rows(u) - load.given - (w if dual.ties is None else dual.ties @ w)
        eta2 = factor * float(apart @ (dual.K @ apart)) + load.rest / factor
        traction = (factor * found.xi[0] / dual.c).reshape(-1, 2)
        change = np.sqrt(3.0) * (traction[:, 1] - traction[:, 0])
        return float(np.sqrt(eta2)), traction.mean(axis=1)[:, None] + np.multiply.outer(
            change, [-0.5, 0.5]
        )

    def _polygon(self, law: Laws) -> tuple[Laws, float]:
        """A piecewise-linear law, and how far b is from it at most, at all slips [Pa]."""
        if law.piecewise_linear:
            return law, 0.0

        def made(one: Laws) -> Laws:
            ends = np.abs([*one.kinks, *one.s_0]).max() + sum(
                100.0 / np.abs(r[a != 0.0]).min() for a, r in one.exponentials
            )
            return piecewise_linear(
                one, POLYGON, float(ends)
            )  # beyond which nothing is left of an exponential

        return self._polygons.of(law, lambda: law.mapped(made)), POLYGON * law.b_scale

    def _load(self, scene: Scene) -> _Load:
        """The load of a scene on its equilibrium elements, the last ones kept."""
        (dual, factor), level, mesh = self.level.dual(scene), self.level, self.level.mesh
        key = scene.f, scene.boundary, scene.heat, scene.material, factor

        def made() -> _Load:
            theta, frames = np.zeros((len(mesh.triangles), 3)), level.frames_of(scene.boundary)
            if scene.material.expands:
                nodal_theta = level.temperature(scene).theta[mesh.triangles]
                theta = mesh.of_material(scene, "beta")[:, None] * nodal_theta
            f = np.array([float(values_at(component, np.zeros(2))) for component in scene.f])
            F, rest = dual.elements.volume_load(f, theta)
            traction = np.zeros((len(mesh.segments), 2, 2))  # in x and y at the Gauss points
            for name, role in scene.boundary:
                on = mesh.on(name)
                traction[on] = acting(
                    mesh, name, role, dual.gauss_points[on], mesh.boundary.normal[on]
                )
            own = np.zeros((2, 2, len(dual.elements.axes)))
            half = 0.5 * mesh.boundary.length
            own[:, :, dual.number] = np.einsum("s,sgd,sdk->gks", half, traction, dual.axes)
            prescribed = frames.cartesian(frames.values).reshape(2, -1).T
            given = np.where(dual.held, dual.rows(prescribed), 0.0)
            F += own.ravel() - factor * (dual.K @ given)
            rows = dual.condensation.forward(F if dual.ties is None else dual.ties.T @ F)
            return _Load(rows, given, rest)

        return self._loads.of(key, made)

    def law(self, scene: Scene) -> Laws:
        """The law of every segment of Γ_C."""
        friction, line = scene.friction, self.level.line
        if isinstance(friction, Laws):
            return friction
        index, strength = friction.along(line.edge_names, line.segment_edge, line.ends.mean(axis=1))
        return nodal([law for _, law, _ in friction.laws], index, strength)


def consistency(law: Laws, lengths: Array, xi: Array, slip: Array, w: Array) -> Array:
    """(k,) M of the module's text, no less, of several w (k,) [J/m].

    lengths: (s,);  xi, slip: (s, 2) ξ* and u_hT at the ends of segments of Γ_C
    """
    x = np.linspace(0.0, 1.0, PARTS + 1)
    at, v = (
        np.multiply.outer(ends[:, 0], 1.0 - x) + np.multiply.outer(ends[:, 1], x)
        for ends in (xi, slip)
    )
    worst = np.empty((len(w), *v.shape))
    for own, segments in law.groups(len(lengths)):
        worst[:, segments] = _worst(own, at[segments], v[segments], w[:, None, None])
    mean = worst @ np.concatenate([[0.5], np.ones(PARTS - 1), [0.5]]) / PARTS
    change, steps = (ends[:, 1] - ends[:, 0] for ends in (xi, slip))
    above = (
        (change + w[:, None] * steps) * steps / (6.0 * PARTS**2)
    )  # trapezoidal rule less integral of ξ*v + wv²
    return np.asarray(np.maximum(mean + above, 0.0) @ lengths)


def _worst(law: Laws, xi: Array, v: Array, w: Array) -> Array:
    """sup over the graph of a piecewise-linear law of (ξ* − b(s))(s − v) − w(s − v)², w > 0; all
    broadcast."""
    worst = np.zeros(np.broadcast_shapes(v.shape, w.shape))  # s = v
    for low, high, s_0, b_0, q in zip(law.lower, law.upper, law.s_0, law.b_0, law.q, strict=True):
        slope, bend = (
            xi - b_0 - q * (v - s_0),
            q + w,
        )  # (slope − bend·x)x in x = s − v; unbounded pieces have q ≥ 0
        inside = np.clip(slope / np.where(bend > 0.0, 2.0 * bend, np.inf), low - v, high - v)
        for x in (inside, *(end - v for end in (low, high) if np.isfinite(end))):
            np.maximum(worst, (slope - bend * x) * x, out=worst)
    return worst
