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
would do. Where the temperature is computed, η has a quadratic t for θ (heat_quadratic.py), also
where u_h has θ_h, and grows by a bound T of ‖θ − t‖_ρ (heat_bound.py): with ε = θ − t the first
integral gains ∫βε tr ε(e) ≤ ‖ε‖_ρ‖e‖, as c⁻¹I:I = 1/(λ + μ).

η:        on a triangle cε(u_h) = N G⁻¹Pᵀw_h with w_h = u_h at the Gauss points of its edges, so
          that nothing cancels in η² = (w_h − w)ᵀK̂(w_h − w) + Σ_K ‖(I − Π)(τ_p + βθI)‖²
          (guaranteed.py). t is t₁ + r with t₁ linear on a triangle. τ is that of t₁; r adds Πr to
          a difference that is linear on the parts of triangles, and r − Πr is orthogonal to these:
          η² = (η₁ + ‖Πr‖_ρ)² + ‖r − Πr‖²_ρ at most.
M:        along an edge ξ* and u_hT are linear and sup + ξ*u_hT + wu_hT² is convex: the trapezoidal
          rule is no less. A law b = S b̂ whose strength S varies along an edge has S in [S₁, S₂] on
          a part of a segment. For a fixed s the expression is affine in S, hence the supremum
          convex in S: the larger of S₁ and S₂ serves. An exponential law b has a polygon within ε,
          and ε|x| ≤ δx² + ε²/4δ: k is less by δ/λ_low, M more by ε²|Γ_C|/4δ. A law may drop by J at
          a slip: M does not vanish where u_hT is within J/w of it, and the bound stops falling
          there.
Data:     f that is linear on the triangles is exact (guaranteed.py); of other f and of tractions
          that are not linear on the segments, the rest adds what oscillation.py says to η.
Left out: prescribed u that is not linear (`why_no_bound`).
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from tcstudy.contact.solve import solve_block
from tcstudy.expressions.enclosure import enclosure
from tcstudy.expressions.expression import Expression, Scalar, is_linear
from tcstudy.fem.energy_error import acting, own_strain, stress_of
from tcstudy.fem.forms import values_at
from tcstudy.laws.composed import EdgeLaws, nodal, piecewise_linear
from tcstudy.laws.laws import Laws
from tcstudy.offline.heat import Recent
from tcstudy.offline.heat_bound import HeatBounds, thermal_weight
from tcstudy.offline.level import Level
from tcstudy.offline.oscillation import (
    TRIANGLE_POINTS,
    TRIANGLE_WEIGHTS,
    korn_constants,
    linear_in_triangles,
    linear_on_segments,
    poincare,
    trace_constants,
)
from tcstudy.scene.guarantee import why_no_bound
from tcstudy.scene.points import needs_heat_solve
from tcstudy.scene.records import Role, Scene
from tcstudy.shapes.edges import GAUSS

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
    """The load of equilibrium elements.

    rows:        (N,) L⁻¹F
    given:       (4e,) prescribed w
    rest:        Σ_K ‖(I − Π)ρ‖² [J/m]
    beside:      ‖Πr‖_ρ and ‖r − Πr‖_ρ of what is not linear of a computed temperature [√(J/m)]
    oscillation: bound of what data do that the elements do not have exactly [√(J/m)]
    """

    rows: Array
    given: Array
    rest: float
    beside: tuple[float, float]
    oscillation: float


@dataclass
class ErrorBounds:
    """The bounds of one level."""

    level: Level
    _loads: Recent[_Load] = field(default_factory=lambda: Recent(8, lambda _: 1))
    _heat: HeatBounds = field(init=False)
    _polygons: Recent[Laws] = field(default_factory=lambda: Recent(64, lambda _: 1))

    def __post_init__(self) -> None:
        self._heat = HeatBounds(self.level.mesh)

    def look(self, scene: Scene, v: Array, with_slips: bool = False) -> dict[str, float]:
        """Return the stored variables of the bound for a solution v (m,), NaN without a proof.

        with_slips: whether the errors of slips and of the friction resultant are bounded as well
        """
        names = ["error_bound", "error_bound_relative"]
        names += ["slip_bound", "friction_bound"] if with_slips else []
        if why_no_bound(scene):
            return dict.fromkeys(names, float("nan"))
        u = self.level.displacement(scene, v).reshape(2, -1).T
        eta, xi = self.whole_residual(scene, u)
        bound = self._bound(scene, u, eta, xi)
        least_norm = self._norm(scene, u) - bound
        relative = bound / least_norm if least_norm > 0.0 else float("nan")
        values = [bound, relative]
        if with_slips:
            values.append(bound * self._slip_factor(scene))
            values.append(self._friction_bound(scene, v, bound + eta, xi))
        return dict(zip(names, values, strict=True))

    def _bound(self, scene: Scene, u: Array, eta: float, xi: Array) -> float:
        """Return the least bound of ‖u − u_h‖ over the weights w.

        u: (n, 2) u_h;  xi: (s, 2) ξ* at the ends of the segments of Γ_C
        """
        line, low = self.level.line, self.level.band(scene).low
        omega = self.law(scene).omega
        starts = [0.0, omega] if omega < low else [0.0]
        w = np.concatenate([start + (low - start) * WEIGHTS for start in starts])
        law, polygon_error = self.polygon(self.unscaled_law(scene))
        strengths = self.strengths(scene)
        if strengths is not None:
            polygon_error *= float(strengths.max())
        slack = POLYGON_SHARE * low if polygon_error > 0.0 else 0.0
        M = consistency(law, line.lengths, xi, self.slip(u), w, strengths)
        k = 1.0 - (w + slack) / low
        M, k = M[k > 0.0], k[k > 0.0]
        if slack:
            M = M + polygon_error**2 * line.lengths.sum() / (4.0 * slack)
        return float(np.min((eta + np.sqrt(eta**2 + 4.0 * k * M)) / (2.0 * k)))

    def whole_residual(self, scene: Scene, u: Array, near: bool = False) -> tuple[float, Array]:
        """Return η with what temperature and data add to it [√(J/m)], and ξ* as `equilibrated`."""
        residual, xi = self.equilibrated(scene, self.law(scene), u, near)
        eta = residual + self.thermal_part(scene, residual) + self._load(scene).oscillation
        return eta, xi

    def slip(self, u: Array) -> Array:
        """Return u_hT (s, 2) at the ends of the segments of Γ_C."""
        line = self.level.line
        along = (line.ends[:, 1] - line.ends[:, 0]) / line.lengths[:, None]
        return np.einsum("sed,sd->se", u[line.segments], along)

    def _norm(self, scene: Scene, u: Array) -> float:
        """Return a lower bound of ‖u_h‖: the energy of springs is left out."""
        mesh = self.level.mesh
        strain = own_strain(mesh, u.T.ravel())
        stress = stress_of(strain, mesh.of_material(scene, "lam"), mesh.of_material(scene, "mu"))
        energy_density = (stress * strain * [1.0, 1.0, 2.0]).sum(axis=1)
        return float(np.sqrt(mesh.area @ energy_density))

    def _slip_factor(self, scene: Scene) -> float:
        """Return the largest κ_e: the mean slip of a segment is known to ±κ_e‖u − u_h‖ [m/√(J/m)].

        κ²_e = φᵀÂ⁻¹φ with φ = (½, ½) at the Gauss points of the segment: the equilibrium stress Z
        of a unit traction there has ∫(u − u_h)_T = ∫Z : ε(u − u_h).
        """
        dual, factor = self.level.dual(scene)
        inverse = np.linalg.inv(dual.condensation.A_tilde)
        pairs = inverse.reshape(len(inverse) // 2, 2, len(inverse) // 2, 2)
        compliance = 0.25 * np.einsum("sisj->s", pairs)
        return float(np.sqrt(compliance.max() / factor))

    def _friction_bound(self, scene: Scene, v: Array, distance: float, xi: Array) -> float:
        """Return a bound of |∫ξ − ∫ξ_h| over Γ_C [N/m]; NaN where an end of Γ_C is held.

        |∫(ξ − ξ*)φ_T| ≤ (‖u − u_h‖ + η)‖φ‖ for φ in P1 with φ_T = 1 on Γ_C
        distance: ‖u − u_h‖ + η
        """
        level, line = self.level, self.level.line
        segments, _ = line.held
        if len(segments):
            return float("nan")
        problem = level.condensed(scene).problem
        norm = float(np.sqrt(problem.A_tilde.sum()))
        resultant = float(line.lengths @ xi.mean(axis=1))
        return distance * norm + abs(resultant - float(problem.xi(v).sum()))

    def _heats(self, scene: Scene) -> bool:
        """Whether a temperature is computed that loads the body."""
        given = isinstance(scene.heat.theta, Expression)
        return scene.material.expands and needs_heat_solve(scene) and not given

    def thermal_part(self, scene: Scene, residual: float = 0.0) -> float:
        """Return T ≥ ‖θ − t‖_ρ of the temperature t that loads τ (heat_bound.py) [√(J/m)].

        residual: η of the displacement
        """
        theta = scene.heat.theta
        if self._heats(scene):
            return self._heat.bound(scene, self.level.temperature(scene).theta, residual)
        if isinstance(theta, Expression) and scene.material.expands and not is_linear(theta):
            return self._interpolation_error(scene, theta)
        return 0.0

    def equilibrated(
        self, scene: Scene, law: Laws, u: Array, near: bool = False
    ) -> tuple[float, Array]:
        """Return η [√(J/m)] and ξ* (s, 2) at the ends of the segments of Γ_C [Pa].

        u:    (n, 2) the displacement u_h
        near: whether the contact problem of the equilibrium elements is solved from u_hT on, to
              find the stress of its branch, not from zero
        """
        (dual, factor), load = self.level.dual(scene), self._load(scene)
        if factor != 1.0:
            law = law.placed(1.0 / factor)
        law_of_segment = np.broadcast_to(law.index, len(dual.c) // 2)
        at_gauss = law.tables.at(np.repeat(law_of_segment, 2)[None])
        rows = load.rows / factor
        l_tilde = dual.condensation.condensed(rows)
        start = self.slip(u) @ np.array([1.0 - GAUSS, GAUSS]) if near else None
        solution = solve_block(
            dual.contact,
            l_tilde[None],
            at_gauss,
            "continued" if near else "from-zero",
            neighbours=None if start is None else start.reshape(1, -1),
            prove=False,
        )
        w = dual.condensation.expand(solution.v[0], rows)
        if dual.ties is not None:
            w = dual.ties @ w
        difference = dual.rows(u) - load.given - w
        eta2 = factor * float(difference @ (dual.K @ difference)) + load.rest / factor
        traction = (factor * solution.xi[0] / dual.c).reshape(-1, 2)
        change = np.sqrt(3.0) * (traction[:, 1] - traction[:, 0])
        xi = traction.mean(axis=1)[:, None] + np.multiply.outer(change, [-0.5, 0.5])
        in_parts, beside = load.beside
        return float(np.hypot(np.sqrt(eta2) + in_parts, beside)), xi

    def polygon(self, law: Laws) -> tuple[Laws, float]:
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
        in_parts, beside = 0.0, 0.0
        if scene.material.expands:
            theta = level.temperature(scene).theta
            corner_theta = theta[mesh.triangles]
            if self._heats(scene):
                t = self._heat.improved(scene, theta)
                corner_theta = t.linear_part(mesh)
                in_parts, beside = t.rest(mesh, thermal_weight(mesh, scene))
            thermal_stress = mesh.of_material(scene, "beta")[:, None] * corner_theta
        f, slope, oscillation = self._body_force(scene)
        if slope is not None:  # its τ_p is not linear, and not orthogonal
            in_parts, beside = float(np.hypot(in_parts, beside)), 0.0
        F, rest = dual.volume_load(f, thermal_stress, slope)
        traction = np.zeros((len(mesh.segments), 2, 2))  # in x and y at the Gauss points
        for name, role in scene.boundary:
            on = mesh.on(name)
            points, normals = dual.gauss_points[on], mesh.boundary.normal[on]
            traction[on] = acting(mesh, name, role, points, normals)
            if not all(is_linear(term.value) for term in role.traction_terms):
                linear, edge_rest = self._linear_traction(role, on)
                traction[on] += linear - self._traction(role, on, points)
                weights = trace_constants(mesh)[on] * self._korn(scene)[mesh.owner[on]]
                oscillation += mesh.from_segments(weights * np.sqrt(edge_rest), np.flatnonzero(on))
        edge_loads = np.zeros((2, 2, len(dual.elements.axes)))
        half = 0.5 * mesh.boundary.length
        edge_loads[:, :, dual.number] = np.einsum("s,sgd,sdk->gks", half, traction, dual.axes)
        prescribed = frames.cartesian(frames.values).reshape(2, -1).T
        given = np.where(dual.held, dual.rows(prescribed), 0.0)
        F += edge_loads.ravel() - factor * (dual.K @ given)
        rows = dual.condensation.forward(F if dual.ties is None else dual.ties.T @ F)
        return _Load(rows, given, rest, (in_parts, beside), float(np.linalg.norm(oscillation)))

    def _body_force(self, scene: Scene) -> tuple[Array, Array | None, Array]:
        """Return f at the centres, slopes of a linear f, and what its rest can do (t,).

        f: (2,), or (t, 2) where it varies;  slopes: (t, 2, 2), None for a constant f
        """
        mesh = self.level.mesh
        oscillation2 = np.zeros(len(mesh.triangles))
        numbers = [component for component in scene.f if not isinstance(component, Expression)]
        if len(numbers) == 2:
            return np.array(numbers, dtype=float), None, oscillation2
        corner_values = []
        for component in scene.f:
            if is_linear(component):
                corner_values.append(values_at(component, mesh.corners))
                continue
            linear, rest = linear_in_triangles(mesh, component)
            corner_values.append(linear)
            oscillation2 += (poincare(mesh) * self._korn(scene)) ** 2 * rest
        at_corners = np.stack(corner_values, axis=2)
        slope = np.einsum("tki,tkc->tic", at_corners, mesh.slopes)
        return at_corners.mean(axis=1), slope, np.sqrt(oscillation2)

    def _korn(self, scene: Scene) -> Array:
        """Return R_K/√2μ (t,) of oscillation.py."""
        mesh = self.level.mesh
        lam, mu = (mesh.of_material(scene, name) for name in ("lam", "mu"))
        return korn_constants(mesh) / np.sqrt(2.0 * np.minimum(mu, lam + mu))

    def _linear_traction(self, role: Role, on: NDArray[np.bool_]) -> tuple[Array, Array]:
        """Return the linear part (k, 2, 2) of a traction at the Gauss points, and ‖rest‖² (k,)."""
        return linear_on_segments(
            self.level.mesh, lambda points: self._traction(role, on, points), on
        )

    def _traction(self, role: Role, on: NDArray[np.bool_], points: Array) -> Array:
        """Return the traction of a role at points (k, q, 2) of the segments `on`."""
        normals = self.level.mesh.boundary.normal[on][:, None]
        all_normals = np.broadcast_to(normals, points.shape)
        return role.traction(all_normals, lambda value: values_at(value, points))

    def _interpolation_error(self, scene: Scene, theta: Expression) -> float:
        """Return ‖θ − θ_h‖_ρ of a given temperature and its values at the nodes, by quadrature."""
        mesh = self.level.mesh
        rho = thermal_weight(mesh, scene)
        points = np.einsum("qc,tcd->tqd", TRIANGLE_POINTS, mesh.corners)
        interpolated = values_at(theta, mesh.corners) @ TRIANGLE_POINTS.T
        error = values_at(theta, points) - interpolated
        return float(np.sqrt((rho * mesh.area) @ (error**2 @ TRIANGLE_WEIGHTS)))

    def unscaled_law(self, scene: Scene) -> Laws:
        """Return the law of every segment of Γ_C, without a strength that varies along an edge."""
        friction, line = scene.friction, self.level.line
        if isinstance(friction, Laws) or not self._varying(scene):
            return self.law(scene)
        index, strength = friction.along(line.edge_names, line.segment_edge, line.ends.mean(axis=1))
        varying = np.array([_varies(factor) for _, _, factor in friction.laws])
        strength = np.where(varying[index], 1.0, strength)
        return nodal([law for _, law, _ in friction.laws], index, strength)

    def _varying(self, scene: Scene) -> bool:
        friction = scene.friction
        return isinstance(friction, EdgeLaws) and any(
            _varies(factor) for _, _, factor in friction.laws
        )

    def strengths(self, scene: Scene) -> Array | None:
        """Return the least and largest strength (2, s, PARTS) on parts of segments.

        It is 1 where the strength is a number, and None if it is a number everywhere.
        """
        friction, line = scene.friction, self.level.line
        if isinstance(friction, Laws) or not self._varying(scene):
            return None
        index, _ = friction.along(line.edge_names, line.segment_edge, line.ends.mean(axis=1))
        places = np.linspace(0.0, 1.0, PARTS + 1)[:, None]
        first, second = line.ends[:, :1], line.ends[:, 1:]
        points = (1.0 - places) * first + places * second
        lower = np.minimum(points[:, :-1], points[:, 1:])
        upper = np.maximum(points[:, :-1], points[:, 1:])
        strengths = np.ones((2, *lower.shape[:2]))
        for k, (_, _, factor) in enumerate(friction.laws):
            on = index == k
            if not _varies(factor):
                continue
            if is_linear(factor):
                values = values_at(factor, points[on])
                pair = np.stack([values[:, :-1], values[:, 1:]])
                strengths[:, on] = pair.min(axis=0), pair.max(axis=0)
            else:
                boxes = [(lower[on][..., axis], upper[on][..., axis]) for axis in (0, 1)]
                strengths[:, on] = enclosure(factor, *boxes)
        return np.maximum(strengths, 0.0)

    def law(self, scene: Scene) -> Laws:
        """Return the law of every segment of Γ_C."""
        friction, line = scene.friction, self.level.line
        if isinstance(friction, Laws):
            return friction
        index, strength = friction.along(line.edge_names, line.segment_edge, line.ends.mean(axis=1))
        return nodal([law for _, law, _ in friction.laws], index, strength)


def _varies(factor: Scalar) -> bool:
    return isinstance(factor, Expression) and factor.constant is None


def consistency(
    law: Laws,
    lengths: Array,
    xi: Array,
    slip: Array,
    w: Array,
    strengths: Array | None = None,
) -> Array:
    """Return M of the module's text (k,), or an upper bound of it, for several w (k,) [J/m].

    lengths:   (s,)
    xi, slip:  (s, 2) ξ* and u_hT at the ends of segments of Γ_C
    strengths: (2, s, PARTS) least and largest factors of b on parts of the segments, None for 1
    """
    x = np.linspace(0.0, 1.0, PARTS + 1)

    def along_segments(ends: Array) -> Array:
        return np.multiply.outer(ends[:, 0], 1.0 - x) + np.multiply.outer(ends[:, 1], x)

    traction, v = along_segments(xi), along_segments(slip)
    mean = np.empty((len(w), len(lengths)))
    for segment_law, segments in law.groups(len(lengths)):
        factors = None if strengths is None else strengths[:, segments]
        mean[:, segments] = _mean_suprema(
            segment_law, traction[segments], v[segments], w[:, None, None], factors
        )
    traction_change, slip_change = xi[:, 1] - xi[:, 0], slip[:, 1] - slip[:, 0]
    # the trapezoidal rule less the integral of ξ*v + wv²
    excess = (traction_change + w[:, None] * slip_change) * slip_change / (6.0 * PARTS**2)
    return np.asarray(np.maximum(mean + excess, 0.0) @ lengths)


def _mean_suprema(law: Laws, xi: Array, v: Array, w: Array, strengths: Array | None) -> Array:
    """Return means (k, s) of suprema along segments by the trapezoidal rule on their parts.

    xi, v: (s, PARTS + 1);  w: (k, 1, 1);  strengths: (2, s, PARTS) or None
    """
    if strengths is None:
        suprema = _suprema(law, xi, v, w)
        weights = np.concatenate([[0.5], np.ones(PARTS - 1), [0.5]])
        return np.asarray(suprema @ weights / PARTS)
    total = np.zeros((len(w), len(xi)))
    for ends in (slice(None, -1), slice(1, None)):
        # the supremum is convex in the strength: it is largest at one of its ends
        least, largest = (_suprema(law, xi[:, ends], v[:, ends], w, part) for part in strengths)
        total += 0.5 * np.maximum(least, largest).mean(axis=2)
    return total


def _suprema(law: Laws, xi: Array, v: Array, w: Array, strength: Array | float = 1.0) -> Array:
    """Return sup of (ξ* − Sb(s))(s − v) − w(s − v)² over the graph of a piecewise-linear law.

    w > 0, S ≥ 0 the strength; all arrays are broadcast.
    """
    suprema = np.zeros(np.broadcast_shapes(v.shape, w.shape))  # s = v
    for low, high, s_0, b_0, q in zip(law.lower, law.upper, law.s_0, law.b_0, law.q, strict=True):
        # (slope − curvature·x) x with x = s − v; unbounded pieces have q ≥ 0
        slope = xi - strength * b_0 - strength * q * (v - s_0)
        curvature = strength * q + w
        vertex = slope / np.where(curvature > 0.0, 2.0 * curvature, np.inf)
        candidates = [np.clip(vertex, low - v, high - v)]
        candidates += [end - v for end in (low, high) if np.isfinite(end)]
        for x in candidates:
            np.maximum(suprema, (slope - curvature * x) * x, out=suprema)
    return suprema
