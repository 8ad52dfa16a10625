"""How far a computed temperature is from that of the body, in the norm that loads the body.

θ_h is the P1 temperature. With ρ = β²/(λ + μ),

    c(s,t) = ∫k∇s·∇t + ∫_{Γ_θ} αst,   ‖t‖²_c = c(t,t),   ‖t‖²_ρ = ∫ρt².

A quadratic t with the P1 temperature Pt = θ_h (heat_quadratic.py) loads τ. What it leaves out adds
‖θ − t‖_ρ to the error of the displacement (error_bound.py). With ε = θ − t

    ‖ε‖_ρ ≤ T := M_h η_t.

η_t:  Let p have div p = −q and p·n = flux on edges without exchange. Then
      c(ε,ε) = ∫(p − k∇t)·∇ε − ∫_{Γ_θ}(p·n + α(t − θ̄))ε, so that
          ‖ε‖²_c ≤ η²_t = ‖k^{−½}(p − k∇t)‖² + ‖α^{−½}(p·n + α(t − θ̄))‖²_{Γ_θ}.
p:    BDM1, linear on every triangle with p·n continuous, in hybrid form. F are the moments of p·n
      at the Gauss points of a triangle's sides, G = ∫k⁻¹p·p in them, r = G⁻¹1, s = 1ᵀr. The
      multipliers ϑ are temperatures at the Gauss points of the edges (2 an edge):
          K̂ = Σ G⁻¹ − rrᵀ/s,   (K̂ + diag αh/2)ϑ = Σ r q|K|/s + αh/2 θ̄ + h/2 flux,
          F = K̂ϑ − r q|K|/s.
M_h:  M²_h = κ²_h + max ρ(h_K/j₁₁)²/k. κ²_h is the largest eigenvalue of (S_dual − S_P1)g = κ²ρ|K|g
      over piecewise constant sources: the compliance of BDM1 less that of P1. As Pε = 0 for the
      projection P onto P1, ‖ε‖²_ρ = c((I − P)z, ε), with z the temperature of the source ρε. The
      mean of ε on each triangle gives at most κ_h, the rest (h/j₁₁)√(ρ/k) by Poincaré's inequality.
      z has no better approximation in a smaller space, so that M_H of a mesh of which this one is a
      refinement serves too.
T:    M_h is that of the worst source, so that T may be far above ‖ε‖_ρ. Where it is not small
      beside η, also ‖ε‖_ρ ≤ ‖t − t*‖_ρ + T* with t* and T* of a refinement of the mesh.
κ_h:  from Lanczos, which is from below; then proved from above. With t a little greater,
          [K̂ + diag αh/2, 0, B; 0, −A, F; Bᵀ, Fᵀ, t²/ρ|K| − 1/s]
      has as many negative pivots as A (P1) has rows if and only if κ_h < t.
Data: sources that vary on a triangle, and fluxes and θ̄ that are not linear on a segment. Their
      means and linear parts go into p, and the rest adds to η_t what oscillation.py says; that of
      θ̄, orthogonal to what is linear, adds α‖rest‖² to η²_t.
Literature: X. Liu and S. Oishi, SIAM J. Numer. Anal. 51 (2013) 1634–1654 (the constant M_h).
Left out: held temperatures that are not linear on an edge.

All up to rounding.
"""

from __future__ import annotations

from collections.abc import Hashable
from dataclasses import dataclass
from functools import cached_property
from weakref import WeakKeyDictionary

import numpy as np
import scipy.linalg
import scipy.sparse as sp
import scipy.sparse.linalg as sla
from numpy.typing import NDArray

from tcstudy.condense import Condensation, condense
from tcstudy.condense.condensation import NotPositiveDefinite
from tcstudy.expressions.expression import Expression, Scalar
from tcstudy.fem.forms import ElasticForms, values_at
from tcstudy.fem.meshes import PlaneMesh, refine
from tcstudy.offline.heat import Recent, Temperatures, relative_k, to_digits
from tcstudy.offline.heat_quadratic import BubbleForm, QuadraticTemperature
from tcstudy.offline.oscillation import (
    linear_on_segments,
    mean_in_triangles,
    poincare,
    trace_constants,
)
from tcstudy.scene.records import Scene
from tcstudy.shapes.edges import GAUSS, segment_mass

Array = NDArray[np.float64]
Indices = NDArray[np.intp]

LANCZOS_TOLERANCE = 0.03
"""Relative accuracy of κ²_h from Lanczos: T is small beside η of the displacement."""
LANCZOS_VECTORS = 6
SMALL = 0.1
"""T relative to η of the displacement up to which the constant of a coarser mesh serves."""
HALVINGS = 2
"""Refinements of a mesh for a temperature closer to θ, where T is not small."""
MAX_FINER = 20_000
"""Most triangles of such a refinement."""
MEMORY = 1e8
"""Bytes of temperatures that it keeps."""
MARGINS = (1.02, 1.1, 1.5, 3.0)
"""Factors of κ²_h for which the bound from above is tried in turn."""
MAX_ROUNDING = 1e-6
"""Largest rounding error of the pivots with which signs are counted, relative to the matrix.

The smallest margin changes the last block, scaled to 1, by 0.02."""


MASS_ROOT: Array = np.asarray(np.linalg.cholesky((np.ones((3, 3)) + np.eye(3)) / 12.0).T)
"""Its square is the mass matrix of linear functions on a triangle of area 1."""


@dataclass(frozen=True)
class HeatData:
    """The data of a heat problem on a mesh.

    k, rho: (t,) conductivity [W/(m K)] and β²/(λ + μ) [Pa/K²]
    alpha:  (s,) heat transfer coefficient of boundary segments, 0 without exchange [W/(m² K)]
    held:   (s,) segments whose temperature is given
    """

    k: Array
    rho: Array
    alpha: Array
    held: NDArray[np.bool_]


@dataclass(frozen=True)
class HeatLoads:
    """The loads of a heat problem as BDM1 has them.

    heat:        (t,) total heat of triangles [W/m]
    inflow:      (s, 2) αθ̄ + flux at the Gauss points of segments, times half their length [W/m]
    given:       (s, 2) held temperatures at the Gauss points [K]
    ambient:     Σ α‖rest of θ̄‖² [W K/m]
    oscillation: bound of what the rest of the sources and fluxes does [√(W K/m)]
    """

    heat: Array
    inflow: Array
    given: Array
    ambient: float
    oscillation: float


def thermal_weight(mesh: PlaneMesh, scene: Scene) -> Array:
    """Return ρ = β²/(λ + μ) (t,) of the triangles [Pa/K²]."""
    beta, lam, mu = (mesh.of_material(scene, name) for name in ("beta", "lam", "mu"))
    return beta**2 / (lam + mu)


class FluxElements:
    """BDM1 fluxes in hybrid form on a mesh with given conductivities.

    Rows (2e,) run over the Gauss points of the edges, from the lower node on, then over edges.
    """

    def __init__(self, mesh: PlaneMesh, k: Array) -> None:
        """k: (t,) conductivity, in any unit."""
        self.mesh, self._k = mesh, k
        edges, edge_of_side = mesh.edges
        self.n_edges = len(edges)
        self.number = edge_of_side.ravel()[mesh.sides_at(mesh.segments)]
        first, second = np.moveaxis(mesh.sides.reshape(-1, 3, 2), 2, 0)
        runs_backwards = (first > second)[..., None]
        gauss = np.arange(2) ^ runs_backwards
        self.rows: Indices = (gauss * self.n_edges + edge_of_side[..., None]).reshape(-1, 6)
        corner_flux = self._corner_fluxes()
        # G = RᵀR by QR of the fluxes themselves: their products would lose twice as many digits
        samples = np.einsum("ij,tjdm->tidm", MASS_ROOT, corner_flux).reshape(-1, 6, 6)
        self._samples = samples * np.sqrt(mesh.area / k)[:, None, None]
        R = np.asarray(np.linalg.qr(self._samples, mode="r"))
        half = np.linalg.inv(R)
        G_inverse = np.matmul(half, np.swapaxes(half, 1, 2))
        self.r: Array = G_inverse.sum(axis=2)
        self.s: Array = self.r.sum(axis=1)
        self.local: Array = (
            G_inverse - self.r[:, :, None] * self.r[:, None, :] / self.s[:, None, None]
        )

    def _corner_fluxes(self) -> Array:
        """Return p (t, 3, 2, 6) at the corners, from its moments at the sides' Gauss points."""
        corners = self.mesh.corners
        sides = np.roll(corners, -1, axis=1) - corners
        # from the moments h/2 p·n at the Gauss points of a side to h p·n at its start and end
        at_ends = 2.0 * np.linalg.inv(np.column_stack([1.0 - GAUSS, GAUSS]))
        flux = np.zeros((len(corners), 3, 2, 6))
        for corner in range(3):
            leaving, arriving = corner, (corner + 2) % 3
            outflow_leaving, outflow_arriving = np.zeros(6), np.zeros(6)
            outflow_leaving[2 * leaving : 2 * leaving + 2] = at_ends[0]
            outflow_arriving[2 * arriving : 2 * arriving + 2] = at_ends[1]
            # p = (a·outflow through the one side + b·outflow through the other)/2|K|
            along_arriving = np.multiply.outer(sides[:, arriving], outflow_leaving)
            along_leaving = np.multiply.outer(sides[:, leaving], outflow_arriving)
            flux[:, corner] = along_arriving - along_leaving
        return flux / (2.0 * self.mesh.area)[:, None, None, None]

    def stiffness(self) -> sp.csr_array:
        """Return K̂ (2e, 2e)."""
        entries = np.repeat(self.rows, 6, axis=1).ravel(), np.tile(self.rows, (1, 6)).ravel()
        size = (2 * self.n_edges, 2 * self.n_edges)
        return sp.coo_array((self.local.ravel(), entries), shape=size).tocsr()

    def source(self, heat: Array) -> Array:
        """Return the right-hand side (2e,) of sources with the total heat (t,) of triangles."""
        load = np.zeros(2 * self.n_edges)
        np.add.at(load, self.rows, self.r * (heat / self.s)[:, None])
        return load

    def distance(self, t: QuadraticTemperature, potentials: Array, heat: Array) -> float:
        """Return ‖k^{−½}(p − k∇t)‖² for the multipliers (2e,) of p.

        heat: (t,) total heat of the triangles' sources
        """
        # k∇ of the P1 part is its flux at the Gauss points without a source: it cancels exactly
        mesh = self.mesh
        edges, _ = mesh.edges
        first, second = t.nodal[edges].T
        at_gauss = np.concatenate([(1.0 - g) * first + g * second for g in GAUSS])
        difference = (potentials - at_gauss)[self.rows]
        moments = np.einsum("tij,tj->ti", self.local, difference)
        moments -= self.r * (heat / self.s)[:, None]
        samples = np.einsum("tij,tj->ti", self._samples, moments)
        slopes = MASS_ROOT @ t.bubble_slopes(mesh) * np.sqrt(self._k * mesh.area)[:, None, None]
        return float(np.sum((samples - slopes.reshape(-1, 6)) ** 2))


class _Solver:
    """A heat matrix with exchange at its kept rows, factorised once for all α."""

    def __init__(self, condensation: Condensation, exchange: Array) -> None:
        """exchange: (r, r) of α on the kept rows."""
        self._condensation = condensation
        self._factor = None
        if len(exchange):
            self._factor = scipy.linalg.cho_factor(condensation.A_tilde + exchange)

    def solve(self, load: Array) -> Array:
        """Return the solution (n,) of a load (n,), 0 at held rows."""
        rows = self._condensation.forward(load)
        kept = self._condensation.condensed(rows)
        if self._factor is not None:
            kept = scipy.linalg.cho_solve(self._factor, kept)
        return self._condensation.expand(kept, rows)


_CONSTANTS: WeakKeyDictionary[PlaneMesh, Recent[float]] = WeakKeyDictionary()
"""M_h that were computed, by mesh: the levels refined from a mesh share those of it."""


class HeatBounds:
    """Bounds ‖θ − θ_h‖_ρ ≤ T of the computed temperatures of one mesh."""

    def __init__(self, mesh: PlaneMesh) -> None:
        self.mesh = mesh
        self._dual_factors = Recent[tuple[FluxElements, sp.csr_array, Condensation]](4)
        self._p1_factors = Recent[tuple[sp.csr_array, Condensation]](4)
        self._improved = Recent[QuadraticTemperature](4)
        self._temperatures = Recent[Temperatures](4)
        self._of_finer = Recent[float](64)
        self._constants = _CONSTANTS.setdefault(mesh, Recent[float](256))
        self._energies = Recent[float](64)

    def bound(self, scene: Scene, theta: Array, residual: float = 0.0) -> float:
        """Return T = M_h η_t ≥ ‖θ − t‖_ρ [√(J/m)] of the improved P1 temperature θ_h (n,).

        It is NaN where it is not proved.

        residual: η that T is added to; a T that is small beside it may come from a coarser mesh
        """
        key = scene.boundary, scene.heat, scene.material
        try:
            t = self.improved(scene, theta)
            energy = self._energies.of(key, lambda: self.energy(scene, t))
            coarse = self._coarse(scene)
            if coarse is not None:
                bound = coarse.constant(scene) * energy
                if bound <= SMALL * residual:
                    return bound
            own = self.constant(scene) * energy
            if own <= SMALL * residual or self._is_curved(scene) or self.finer is None:
                return own
        except NotPositiveDefinite:  # to rounding: nearly no exchange of heat
            return float("nan")
        finer = self.finer
        by_finer = self._of_finer.of(key, lambda: finer.bound_of_coarse(scene, t, self.mesh))
        return float(np.fmin(own, by_finer))

    def bound_of_coarse(self, scene: Scene, t: QuadraticTemperature, coarse: PlaneMesh) -> float:
        """Return ‖t − t*‖_ρ + T of the own t*, a bound of ‖θ − t‖_ρ for t of a coarser mesh.

        It is NaN where it is not proved.
        """
        mesh = self.mesh
        key = tuple(edge for edge, _, _ in scene.exchange), tuple(dict(scene.held_theta))
        temperatures = self._temperatures.of(
            key, lambda: Temperatures(ElasticForms(mesh), scene, (), MEMORY)
        )
        own = self.improved(scene, temperatures.of(scene).theta)
        change = t.refined(coarse, mesh).less(own)
        try:
            T = self.constant(scene) * self.energy(scene, own)
        except NotPositiveDefinite:
            return float("nan")
        return change.norm(mesh, thermal_weight(mesh, scene)) + T

    @cached_property
    def finer(self) -> HeatBounds | None:
        """The bounds of a refinement of a small mesh, None of others."""
        mesh = self.mesh
        for _ in range(HALVINGS):
            if 4 * len(mesh.triangles) <= MAX_FINER:
                mesh = refine(mesh)
        return None if mesh is self.mesh else HeatBounds(mesh)

    def _is_curved(self, scene: Scene) -> bool:
        """Whether a refinement is another polygon than the mesh."""
        return bool(self.mesh.geometry.curved or scene.body.curved_regions)

    def _coarse(self, scene: Scene) -> HeatBounds | None:
        """Return the bounds of a coarser mesh of the same body, whose constant holds here too."""
        coarse = self.mesh.ancestor
        if coarse is None or self._is_curved(scene):
            return None
        return HeatBounds(coarse)

    # -- data --------------------------------------------------------------------------------------

    def data(self, scene: Scene) -> HeatData:
        """Return conductivity, weight, exchange and held segments of a scene."""
        mesh = self.mesh
        k = mesh.of_material(scene, "k")
        alpha, held = np.zeros(len(mesh.segments)), np.zeros(len(mesh.segments), dtype=bool)
        for name, value, _ in scene.exchange:
            alpha[mesh.on(name)] = value
        for name, _ in scene.held_theta:
            held |= mesh.on(name)
        return HeatData(k, thermal_weight(mesh, scene), alpha, held)

    def _on_segments(self, scalar: Scalar, on: NDArray[np.bool_]) -> tuple[Array, Array]:
        """Return the linear part (k, 2) at the Gauss points of segments, and ‖rest‖² (k,)."""
        if not isinstance(scalar, Expression):
            n = int(on.sum())
            return np.full((n, 2), float(scalar)), np.zeros(n)
        return linear_on_segments(self.mesh, lambda points: values_at(scalar, points), on)

    def _sources(self, scene: Scene) -> tuple[Array, Array]:
        """Return the total heat (t,) of triangles [W/m], and ‖q − q̄‖² (t,)."""
        mesh, q = self.mesh, scene.heat.q
        inside = mesh.inside(scene.heat.omega)
        if not isinstance(q, Expression):
            return float(q) * inside * mesh.area, np.zeros(len(inside))
        mean, rest = mean_in_triangles(mesh, q)
        return np.where(inside, mean, 0.0) * mesh.area, np.where(inside, rest, 0.0)

    # -- the energy of the error -------------------------------------------------------------------

    def loads(self, scene: Scene, data: HeatData) -> HeatLoads:
        """Return the loads of a scene."""
        mesh = self.mesh
        length = mesh.boundary.length
        heat, source_rest = self._sources(scene)
        oscillation = poincare(mesh) * np.sqrt(source_rest / data.k)
        inflow, given = np.zeros((len(length), 2)), np.zeros((len(length), 2))
        trace = trace_constants(mesh) / np.sqrt(data.k[mesh.owner])
        for name, value in scene.flux:
            on = mesh.on(name)
            inflow[on], rest = self._on_segments(value, on)
            oscillation += mesh.from_segments(trace[on] * np.sqrt(rest), np.flatnonzero(on))
        ambient = 0.0
        for name, alpha, theta_bar in scene.exchange:
            on = mesh.on(name)
            surroundings, rest = self._on_segments(theta_bar, on)
            inflow[on] += alpha * surroundings
            ambient += alpha * float(rest.sum())
        for name, value in scene.held_theta:
            on = mesh.on(name)
            given[on], _ = self._on_segments(value, on)
        inflow *= 0.5 * length[:, None]
        return HeatLoads(heat, inflow, given, ambient, float(np.linalg.norm(oscillation)))

    def energy(self, scene: Scene, t: QuadraticTemperature) -> float:
        """Return η_t ≥ ‖θ − t‖_c [√(W K/m)]."""
        mesh, data = self.mesh, self.data(scene)
        elements, K, condensation = self.dual(scene, data)
        loads = self.loads(scene, data)
        conductivity = scene.material.k or 1.0
        number, n_edges = elements.number, elements.n_edges
        heat = loads.heat / conductivity
        given, edge_load = np.zeros((2, n_edges)), np.zeros((2, n_edges))
        given[:, number] = loads.given.T
        edge_load[:, number] = loads.inflow.T / conductivity
        load = elements.source(heat) + edge_load.ravel() - K @ given.ravel()
        solver = self.with_exchange(condensation, data, conductivity)
        potentials = given.ravel() + solver.solve(load)
        eta2 = loads.ambient + conductivity * elements.distance(t, potentials, heat)
        on = data.alpha > 0.0
        ends = t.nodal[np.sort(mesh.segments[on], axis=1)]
        bubbles = t.bubbles[number[on]]
        at_gauss = np.stack([(1.0 - g) * ends[:, 0] + g * ends[:, 1] for g in GAUSS], axis=1)
        jump = at_gauss - potentials.reshape(2, -1)[:, number[on]].T
        # a bubble is ⅔ there; the rest of it, −⅔ of a Legendre polynomial, has the square 4/45
        jump += 2.0 / 3.0 * bubbles[:, None]
        squares = 0.5 * (jump**2).sum(axis=1) + 4.0 / 45.0 * bubbles**2
        eta2 += float((data.alpha * mesh.boundary.length)[on] @ squares)
        return float(np.sqrt(eta2)) + loads.oscillation

    def improved(self, scene: Scene, theta: Array) -> QuadraticTemperature:
        """Return a quadratic temperature with the P1 temperature θ_h (n,), θ_h where there is none.

        The last few are kept.
        """
        key = scene.boundary, scene.heat, scene.material
        return self._improved.of(key, lambda: self._new_improved(scene, theta))

    def _new_improved(self, scene: Scene, theta: Array) -> QuadraticTemperature:
        mesh, data = self.mesh, self.data(scene)
        loads = self.loads(scene, data)
        conductivity = scene.material.k or 1.0
        alpha = data.alpha / conductivity
        form = BubbleForm(mesh, data.k / conductivity, alpha, data.held)
        residual = form.residual(theta, loads.heat / conductivity, loads.inflow / conductivity)
        try:
            solver, _ = self.p1(scene, data)
        except NotPositiveDefinite:  # to rounding: nearly no exchange of heat
            return QuadraticTemperature(theta, np.zeros_like(residual))
        return form.corrected(theta, residual, solver.solve)

    def dual(self, scene: Scene, data: HeatData) -> tuple[FluxElements, sp.csr_array, Condensation]:
        """Return BDM1 with k relative to the body's own, and its matrix condensed onto Γ_θ."""
        key = relative_k(scene), tuple(map(bool, data.alpha)), tuple(data.held)
        return self._dual_factors.of(key, lambda: self._new_dual(scene, data))

    def _new_dual(
        self, scene: Scene, data: HeatData
    ) -> tuple[FluxElements, sp.csr_array, Condensation]:
        mesh = self.mesh
        elements = FluxElements(mesh, data.k / (scene.material.k or 1.0))
        K = elements.stiffness()
        edges, _ = mesh.edges
        is_inner = np.ones((2, elements.n_edges), dtype=bool)
        is_inner[:, elements.number[data.held | (data.alpha > 0.0)]] = False
        kept = self.exchange_rows(elements, data)
        middles = mesh.points[edges].mean(axis=1)
        return elements, K, condense(K, middles, kept, is_inner.ravel(), components=2)

    @staticmethod
    def exchange_rows(elements: FluxElements, data: HeatData) -> Indices:
        """Return the rows of the Gauss points of Γ_θ."""
        number = elements.number[data.alpha > 0.0]
        return np.concatenate([number, number + elements.n_edges])

    def with_exchange(
        self, condensation: Condensation, data: HeatData, conductivity: float
    ) -> _Solver:
        on = data.alpha > 0.0
        weights = 0.5 * self.mesh.boundary.length[on] * data.alpha[on] / conductivity
        return _Solver(condensation, np.diag(np.tile(weights, 2)))

    def held_nodes(self, data: HeatData) -> NDArray[np.bool_]:
        """Return which nodes (n,) have a given temperature."""
        held = np.zeros(self.mesh.n_points, dtype=bool)
        held[self.mesh.segments[data.held]] = True
        return held

    def p1(self, scene: Scene, data: HeatData) -> tuple[_Solver, sp.csr_array]:
        """Return the solver of P1 with k relative to the body's own, and its matrix (n, n)."""
        mesh, held = self.mesh, self.held_nodes(data)
        conductivity = scene.material.k or 1.0
        on = data.alpha > 0.0
        alpha = data.alpha[on] / conductivity
        key = relative_k(scene), tuple(map(bool, data.alpha)), tuple(data.held)
        segments, lengths = mesh.segments[on], mesh.boundary.length[on] * alpha
        nodes_of_exchange = np.unique(segments)
        is_free = ~held[nodes_of_exchange]
        kept = nodes_of_exchange[is_free]
        conduction, condensation = self._p1_factors.of(
            key, lambda: self._new_p1(data.k / conductivity, kept, held)
        )
        ends = np.searchsorted(nodes_of_exchange, segments)
        exchange = segment_mass(ends, lengths, len(nodes_of_exchange))[np.ix_(is_free, is_free)]
        place = np.repeat(kept, len(kept)), np.tile(kept, len(kept))
        added = sp.coo_array((exchange.ravel(), place), shape=conduction.shape).tocsr()
        added.eliminate_zeros()
        return _Solver(condensation, exchange), sp.csr_array(conduction + added)

    def _new_p1(
        self, k: Array, kept: Indices, held: NDArray[np.bool_]
    ) -> tuple[sp.csr_array, Condensation]:
        mesh = self.mesh
        entries = np.einsum("tid,tjd,t->tij", mesh.slopes, mesh.slopes, k * mesh.area)
        nodes, n = mesh.triangles, mesh.n_points
        place = np.repeat(nodes, 3, axis=1).ravel(), np.tile(nodes, (1, 3)).ravel()
        conduction = sp.coo_array((entries.ravel(), place), shape=(n, n)).tocsr()
        is_inner = ~held
        is_inner[kept] = False
        return conduction, condense(conduction, mesh.points, kept, is_inner, components=1)

    # -- the constant of the norm ------------------------------------------------------------------

    def constant(self, scene: Scene) -> float:
        """Return M_h with ‖θ − θ_h‖_ρ ≤ M_h ‖θ − θ_h‖_c [√(J/(W K))]; NaN where it is not proved.

        It depends on the mesh, k, α and the material only, and is computed once for each of their
        ratios.
        """
        data = self.data(scene)
        conductivity = scene.material.k or 1.0
        rho = float(data.rho.max())
        if rho == 0.0:
            return 0.0
        relative = [to_digits(float(value) / rho) for value in data.rho]
        exchange = [to_digits(float(value) / conductivity) for value in data.alpha]
        key: Hashable = relative_k(scene), tuple(exchange), tuple(data.held), tuple(relative)
        M = self._constants.of(key, lambda: self._new_constant(scene, data))
        return M * float(np.sqrt(rho / conductivity))

    def _new_constant(self, scene: Scene, data: HeatData) -> float:
        """Return M_h for k and ρ relative to the body's k and the largest ρ [m]."""
        conductivity = scene.material.k or 1.0
        k, rho = data.k / conductivity, data.rho / data.rho.max()
        poincare2 = float(np.max(poincare(self.mesh) ** 2 * rho / k))
        pair = CompliancePair(self, scene, data, rho)
        kappa2 = pair.largest()
        for margin in MARGINS:
            if pair.is_below(margin * kappa2):
                return float(np.sqrt(margin * kappa2 + poincare2))
        return float("nan")


class CompliancePair:
    """The compliances of piecewise constant sources by BDM1 and by P1 on one mesh."""

    def __init__(self, bounds: HeatBounds, scene: Scene, data: HeatData, rho: Array) -> None:
        """rho: (t,) weight of the sources."""
        mesh = self.mesh = bounds.mesh
        conductivity = scene.material.k or 1.0
        self.elements, K, condensation = bounds.dual(scene, data)
        self._heated = np.flatnonzero(rho > 0.0)
        self._weight = (rho * mesh.area)[self._heated]
        self._dual = bounds.with_exchange(condensation, data, conductivity)
        on = data.alpha > 0.0
        alpha = data.alpha[on] / conductivity
        rows = bounds.exchange_rows(self.elements, data)
        robin = np.zeros(2 * self.elements.n_edges)
        robin[rows] = np.tile(0.5 * mesh.boundary.length[on] * alpha, 2)
        is_held = np.zeros((2, self.elements.n_edges), dtype=bool)
        is_held[:, self.elements.number[data.held]] = True
        self._dual_free = np.flatnonzero(~is_held.ravel())
        self._dual_matrix = sp.csr_array(K + sp.diags_array(robin))
        self._p1, self._p1_matrix = bounds.p1(scene, data)
        self._p1_free = np.flatnonzero(~bounds.held_nodes(data))

    @cached_property
    def _source_columns(self) -> tuple[sp.csr_array, sp.csr_array]:
        """Return the loads (2e, t') of BDM1 and (n, t') of P1 of unit heat in triangles."""
        heated, elements = self._heated, self.elements
        column = np.arange(len(heated))
        dual_entries = (elements.r / elements.s[:, None])[heated]
        dual = sp.coo_array(
            (dual_entries.ravel(), (elements.rows[heated].ravel(), np.repeat(column, 6))),
            shape=(2 * elements.n_edges, len(heated)),
        )
        nodes = self.mesh.triangles[heated]
        p1 = sp.coo_array(
            (np.full(nodes.size, 1.0 / 3.0), (nodes.ravel(), np.repeat(column, 3))),
            shape=(self.mesh.n_points, len(heated)),
        )
        return dual.tocsr(), p1.tocsr()

    def largest(self) -> float:
        """Return the largest eigenvalue κ² of S_dual − S_P1 against ρ|K| from Lanczos [m²]."""
        root = np.sqrt(self._weight)
        dual_columns, p1_columns = self._source_columns
        own = 1.0 / self.elements.s[self._heated]

        def difference(g: Array) -> Array:
            heat = root * g
            dual = own * heat + dual_columns.T @ self._dual.solve(dual_columns @ heat)
            primal = p1_columns.T @ self._p1.solve(p1_columns @ heat)
            return np.asarray(root * (dual - primal))

        size = len(root)
        if size == 1:
            return float(difference(np.ones(1))[0])
        operator = sla.LinearOperator((size, size), matvec=difference, dtype=float)
        start = np.random.default_rng(0).standard_normal(size)
        value = sla.eigsh(
            operator,
            k=1,
            which="LA",
            tol=LANCZOS_TOLERANCE,
            ncv=min(LANCZOS_VECTORS, size),
            v0=start,
            return_eigenvectors=False,
        )
        return float(value[0]) * (1.0 + LANCZOS_TOLERANCE)

    def is_below(self, bound: float) -> bool:
        """Return whether all eigenvalues κ² are proved to be less than `bound`, up to rounding."""
        free, nodes = self._dual_free, self._p1_free
        all_dual_columns, all_p1_columns = self._source_columns
        dual_columns, p1_columns = all_dual_columns[free], all_p1_columns[nodes]
        K = self._dual_matrix[free][:, free]
        A = self._p1_matrix[nodes][:, nodes]
        own = bound / self._weight - 1.0 / self.elements.s[self._heated]
        if np.all(own > 0.0):
            # the sources are eliminated first: triangle by triangle, with positive pivots
            D = sp.diags_array(1.0 / own)
            coupling = dual_columns @ D @ p1_columns.T
            blocks = [
                [K - dual_columns @ D @ dual_columns.T, -coupling],
                [-coupling.T, -A - p1_columns @ D @ p1_columns.T],
            ]
        else:
            blocks = [
                [K, None, dual_columns],
                [None, -A, p1_columns],
                [dual_columns.T, p1_columns.T, sp.diags_array(own)],
            ]
        matrix = sp.csc_array(sp.block_array(blocks))
        diagonal = np.abs(matrix.diagonal())
        scale = 1.0 / np.sqrt(np.where(diagonal > 0.0, diagonal, diagonal.max()))
        scaled = sp.csc_array(sp.diags_array(scale) @ matrix @ sp.diags_array(scale))
        negative = _negative_pivots(scaled)
        return negative == len(nodes)


def _negative_pivots(A: sp.csc_array) -> int | None:
    """Return how many eigenvalues of a symmetric matrix are negative, None if rounding hides it."""
    options = {"SymmetricMode": True}
    try:
        factor = sla.splu(A, permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options=options)
    except RuntimeError:  # a pivot is exactly zero
        return None
    if not np.array_equal(factor.perm_r, factor.perm_c):
        return None
    ones = np.ones(A.shape[0])
    sizes = abs(factor.L) @ (abs(factor.U) @ ones)
    largest = float(abs(A).sum(axis=0).max())
    if np.finfo(float).eps * float(sizes.max()) > MAX_ROUNDING * largest:
        return None
    return int(np.count_nonzero(factor.U.diagonal() < 0.0))
