"""One mesh level of a study, from its matrices to a condensed problem for each sweep point.

Matrices are assembled once. A(λ, μ) = μ A(λ/μ, 1), so that one factorisation serves all materials
of the same ratio: Ã scales with μ, l̃ does not depend on it, A⁻¹l scales with 1/μ. Where materials
differ by region, the ratio has all their moduli and all springs over μ of the material of the body.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Collection, Hashable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, Literal, NamedTuple

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from tcstudy.condense import Condensation, condense
from tcstudy.condense.condensation import EliminationPlan
from tcstudy.contact.problem import CondensedBody, ContactProblem, least_eigenpair
from tcstudy.fem.forms import (
    ElasticForms,
    Moduli,
    Springs,
    constrain,
    contact_line,
    couple,
    edge_load,
    source_load,
    traction_load,
)
from tcstudy.fem.geometry import Geometry
from tcstudy.fem.meshes import Frames, PlaneMesh
from tcstudy.fem.openings import OpeningLine, opening_line
from tcstudy.laws.composed import law_along
from tcstudy.laws.laws import Laws
from tcstudy.offline.guaranteed import (
    Band,
    EquilibriumBody,
    dual_body,
    lambda_1_band,
    require_straight,
)
from tcstudy.offline.heat import Column, Recent, Temperature, Temperatures, split, to_digits
from tcstudy.offline.opening_laws import laws_of_unknowns
from tcstudy.scene.mesh_plan import Guarantee
from tcstudy.scene.records import (
    Boundary,
    Clamped,
    Contact,
    Direction,
    EdgeHeat,
    Role,
    Scalar,
    Scene,
    is_clamped,
    supports,
)
from tcstudy.shapes.rigid_motions import BoundaryPiece, RigidMotions, rigid_motions

if TYPE_CHECKING:
    from tcstudy.contact.pressure_friction import PressureFriction

Array = NDArray[np.float64]
Mechanical = Literal["body", "traction", "force", "moment"]
Ratio = tuple[Moduli, Springs]
"""All moduli and springs over μ of the material of the body."""

MEMORY = 512e6
"""Bytes of basis loads, and again of temperatures, that a level keeps for reuse."""
NO_BAND = Band(np.nan, np.nan, np.nan)
"""Bounds of λ₁ of a body that contact alone holds."""
NULL = 1e-9
"""Part of the largest forces of Ã up to which those of a rigid motion are rounding."""
NORMAL_ACCURACY = 1e-7
"""Accuracy of the normals of curves that the geometry kernel has."""
ROUNDINGS = 4.0
"""Rounding errors of A by which the error of λ₁ is estimated."""


@dataclass(frozen=True)
class BasisLoad:
    """A load without its magnitude: its kind, its shape s in space, and where it acts.

    kind: "body":        ∫ s e_a·v over the body, data = (s, axis a)
          "traction":    ∫ s d·v over the study edge `where`, data = (s, direction d)
          "force":       a resultant of 1, uniformly distributed over an edge, data = (s, axis)
          "moment":      a moment of 1 about the middle of an edge
          "temperature": ∫ θ tr ε(v) over regions (all without `where`) of the field `data`
          "prescribed":  −a(w_D, v) for μ = 1, w_D prescribed by the roles `data`; scales with μ
    """

    kind: Mechanical | Literal["temperature", "prescribed"]
    data: Any = None
    where: tuple[str, ...] = ()


LoadTerm = tuple[BasisLoad, float]
"""A basis load and its coefficient."""


def mechanical_terms(f: tuple[Scalar, Scalar], boundary: Boundary) -> Iterator[LoadTerm]:
    """Yield the terms of ∫f·v and of the loads of all edges that are not zero."""
    loads: list[tuple[Mechanical, int | Direction | None, Scalar, str]] = []
    loads += [("body", axis, f[axis], "") for axis in (0, 1)]
    for edge, role in boundary:
        loads += [("force", axis, role.force[axis], edge) for axis in (0, 1)]
        loads += [("moment", None, role.moment or 0.0, edge)]
        loads += [("traction", term.direction, term.value, edge) for term in role.traction_terms]
    for kind, direction, value, edge in loads:
        shape, factor = split(value)
        if factor != 0.0:
            yield BasisLoad(kind, (shape, direction), (edge,)), factor


def loaded_by(scene: Scene, *, loads: bool = False) -> Scene:
    """Return the scene with its mechanical loads alone: no given displacement, θ = 0.

    loads: whether the mechanical loads stay; without them nothing acts on the body
    """
    boundary = []
    for edge, role in scene.boundary:
        first, second = (None if component is None else 0.0 for component in role.u)
        role = replace(role, u=(first, second))
        if not loads:
            role = role.without_loads()
        if role.heat is not None:
            role = replace(role, heat=_cold_edge(role.heat))
        boundary.append((edge, role))
    if scene.heat.theta is not None:
        heat = replace(scene.heat, theta=0.0)
    else:
        heat = replace(scene.heat, theta_bar=0.0, q=0.0)
    f = scene.f if loads else (0.0, 0.0)
    return replace(scene, boundary=tuple(boundary), f=f, heat=heat, load=1.0, unscaled=None)


def _cold_edge(heat: EdgeHeat) -> EdgeHeat:
    """Return the same thermal conditions with no heat and all temperatures 0."""
    theta = None if heat.theta is None else 0.0
    theta_bar = None if heat.theta_bar is None else 0.0
    return EdgeHeat(theta, 0.0, heat.alpha, theta_bar)


def ratio_of(scene: Scene) -> Ratio:
    """Return λ/μ, μ/μ of the regions and springs over μ, to 15 digits.

    Scenes with equal ratios share one factorisation.
    """
    mu = scene.material.mu
    moduli = tuple(
        (where, to_digits(material.lam / mu), to_digits(material.mu / mu))
        for where, material in scene.pieces
    )
    springs = tuple(
        (edge, to_digits(normal / mu), to_digits(tangential / mu))
        for edge, normal, tangential in scene.springs
    )
    return moduli, springs


class Condensed(NamedTuple):
    """One scene on one level: the contact problem and the constant L_θ(u) − L̃(u₁) [J/m]."""

    problem: ContactProblem
    constant: float


@dataclass(frozen=True)
class CondensedBlock:
    """P scenes on one level whose bodies differ in μ only: plain arrays, nothing of the mesh.

    A_tilde:          (m, m) for μ = 1; the scenes have mu·A_tilde [1]
    c:                (m,) [m]
    lambda_1:         of A_tilde [1/m]
    lambda_1_error:   relative
    is_held:          False for a body with rigid motions that contact alone resists; λ₁ is 0
    mu:               (P,) shear moduli [Pa]
    l_tilde:          (P, m) condensed loads [N/m]
    constant:         (P,) total potential energies less L̃(u₁) [J/m]
    theta_mean, heat_balance: (P,) as in `Temperature`; NaN where temperature does not load the body
    time:             wall time spent on factorisation and loads [s]
    band:             λ₁ of the continuous body for μ = 1, if requested
    blocks:           numbers of the slips and of the openings among the unknowns, () without these
    """

    A_tilde: Array
    c: Array
    lambda_1: float
    lambda_1_error: float
    is_held: bool
    mu: Array
    l_tilde: Array
    constant: Array
    theta_mean: Array
    heat_balance: Array
    time: float
    band: Band | None = None
    blocks: tuple[int, ...] = ()


def loose_body(A_tilde: Array, c: Array, blocks: tuple[int, ...] = ()) -> CondensedBody:
    """Return the record of a body that contact alone holds: Ã is semidefinite, and λ₁ is 0.

    blocks: numbers of the slips and of the openings, () without these
    """
    return CondensedBody.known(A_tilde, c, blocks=blocks, lambda_1=0.0, loose=True)


def _held(boundary: Boundary) -> Boundary:
    """Return the edges that constrain displacements, without their loads and heat, as a key."""
    held: list[tuple[str, Role]] = []
    for edge, role in boundary:
        if isinstance(role, Clamped | Contact):
            held.append((edge, replace(role.without_loads(), heat=None)))
    return tuple(held)


_Basis = tuple[Array, Array]
"""A basis load: L⁻¹F in elimination order (N,), and F at the rows that are held."""


class ElasticBody:
    """The condensed body of one ratio of moduli, for μ = 1, which its scenes share."""

    def __init__(self, level: Level, ratio: Ratio, motions: Array) -> None:
        """Condense the body.

        motions: (k, m) rigid motions that contact alone resists, so that there is no λ₁; springs on
                 the chords of an arc may resist them as well
        Raises NotPositiveDefinite if the body is not held.
        """
        self._level = level
        moduli, springs = ratio
        frames = level.frames
        A = level.elastic.stiffness_of(moduli, frames)
        if springs:
            A = sp.csr_array(A + level.elastic.springs(springs, frames))
        if frames.ties is not None:
            A = sp.csr_array(frames.ties.T @ A @ frames.ties)
        eliminate = ~frames.fixed
        eliminate[level.rows] = False
        self.condensation: Condensation = condense(
            A, level.mesh.points, level.rows, eliminate, 2, plan=level.elimination
        )
        level.elimination = self.condensation.plan
        self.lambda_1 = 0.0
        self.lambda_1_error = 0.0
        A_tilde = self.condensation.A_tilde
        rest = np.abs(motions @ A_tilde).max(initial=0.0)
        size = np.abs(motions).max(initial=0.0) * np.abs(A_tilde).max(initial=0.0)
        self.is_held = not len(motions) or bool(rest > NULL * size)
        if self.is_held:
            self.condensation.require_definite()
            # Assembly and factorisation know A up to about ε√(A_ii A_jj) in every entry (Cholesky:
            # Demmel, LAPACK Working Note 14, 1989), which moves λ₁ = uᵀAu by ε Σ A_ii u_i², u being
            # the mode of the whole body. Digits are lost where u is stiff but moves as a whole, or
            # along an edge that a spring holds across. This is an estimate of ROUNDINGS such
            # errors; none of 200 random bodies lost more than one.
            value, mode, error = least_eigenpair(self.condensation.A_tilde, level.c)
            work = float(A.diagonal() @ self.condensation.expand(mode) ** 2)
            rounding = np.inf
            if value > 0.0:
                rounding = ROUNDINGS * np.finfo(float).eps * work / value
            self.lambda_1 = value
            self.lambda_1_error = error + rounding
        self._fixed = np.flatnonzero(frames.fixed)
        self._reactions = A[self._fixed]  # the only rows of A that are used below
        self._basis: Recent[_Basis] = Recent(MEMORY, lambda basis: basis[0].nbytes)
        self._spans: Recent[tuple[Array, ...]] = Recent(MEMORY, lambda span: span[0].nbytes)

    def _reaction(self, w_D: Array) -> Array:
        """Return A w_D (2n,) of prescribed local displacements w_D (2n,)."""
        return self._reactions.T @ w_D[self._fixed]

    def load(self, mu: float, terms: Sequence[LoadTerm], w_D: Array) -> tuple[Array, float]:
        """Return l̃ (m,) of a load, and the constant part of its energy.

        The last term is "prescribed" where w_D (2n,) is not 0. The constant part is
        L_θ(u) − L̃(u₁) = −½⟨l₂, A₂₂⁻¹l₂⟩ + ½⟨w_D, A w_D⟩ − ⟨l, w_D⟩.
        """
        loads = tuple(load for load, _ in terms)
        factors = np.array([factor for _, factor in terms])
        l_tilde, gram, held = self._spans.of(loads, lambda: self._span(loads))
        constant = -0.5 / mu * float(factors @ gram @ factors)
        prescribed = w_D[self._fixed]
        if np.any(prescribed):
            constant += 0.5 * mu * float(w_D @ self._reaction(w_D))
            constant -= float(factors[:-1] @ (held[:-1] @ prescribed))
        return l_tilde @ factors, constant

    def _span(self, loads: Sequence[BasisLoad]) -> tuple[Array, Array, Array]:
        """Return l̃ (m, t) of t basis loads, ⟨l_a, A₂₂⁻¹ l_b⟩ (t, t) and their held rows (t, h)."""
        bases = self._bases(loads)
        count = len(loads)
        m = self.condensation.m
        # L⁻¹l₂: the kept unknowns come last
        eliminated = [rows[: len(rows) - m] for rows, _ in bases]
        gram = np.array([[a @ b for b in eliminated] for a in eliminated]).reshape(count, count)
        condensed = [self.condensation.condensed(rows) for rows, _ in bases]
        l_tilde = np.reshape(condensed, (count, m)).T
        held = np.array([held_rows for _, held_rows in bases])
        return l_tilde, gram, held.reshape(count, len(self._fixed))

    def _bases(self, loads: Sequence[BasisLoad]) -> list[_Basis]:
        """Return basis loads condensed, from the cache or eliminated at once with their companions.

        A load is always eliminated with the same companions, so that its digits do not depend on
        earlier requests.
        """
        level = self._level
        bases = dict[BasisLoad, _Basis]()
        for load in loads:
            if load in self._basis:
                bases[load] = self._basis[load]
            elif load.kind == "prescribed":
                prescribed = level.frames_of(load.data).values
                bases |= self._eliminated([load], [-self._reaction(prescribed)])
            elif load not in bases:
                companions = [load]
                if isinstance(load.data, Column):
                    companions = [replace(load, data=column) for column in load.data.together]
                vectors = [level.frames.local(level.vector(basis)) for basis in companions]
                bases |= self._eliminated(companions, vectors)
        return [bases[load] for load in loads]

    def _eliminated(
        self, loads: Sequence[BasisLoad], vectors: Sequence[Array]
    ) -> dict[BasisLoad, _Basis]:
        """Eliminate loads with their vectors in local rows (2n,), and keep the results."""
        columns = self.condensation.forward(np.column_stack(vectors)).T
        bases = dict[BasisLoad, _Basis]()
        for load, vector, rows in zip(loads, vectors, columns, strict=True):
            bases[load] = self._basis[load] = rows.copy(), vector[self._fixed]
        return bases

    def displacement(self, mu: float, v: Array, terms: Sequence[LoadTerm]) -> Array:
        """Return local displacements (2n,), eq. (20), without the prescribed ones."""
        rows = np.zeros(len(self.condensation.plan.permutation))
        bases = self._bases([load for load, _ in terms])
        for (_, factor), (basis_rows, _) in zip(terms, bases, strict=True):
            rows += factor / mu * basis_rows
        return self.condensation.expand(v, rows)


def motions_of_geometry(
    geometry: Geometry, boundary: Boundary, resisting: Collection[str] | None = None
) -> RigidMotions:
    """Return the rigid motions that the supports of a body leave.

    resisting: as of `rigid_motions`
    """
    pieces = [BoundaryPiece(*sample) for sample in geometry.samples()]
    x, y = pieces[0].points[0]
    centre = (float(x), float(y))
    return rigid_motions(pieces, boundary, centre, geometry.size, resisting, NORMAL_ACCURACY)


class Level:
    """All scenes of a study on one mesh.

    Caches are keyed by value, so that equal inputs are computed once.

    line, opening: the contact line and, where edges may lift off, their openings; the unknowns of
                   the condensed problem are v = (u_T, s_N) of both, one block after the other
    rows, c:       (m,) local rows of these unknowns, and their segment lengths [m]
    """

    def __init__(
        self,
        mesh: PlaneMesh,
        scene: Scene,
        scenes: Sequence[Scene] = (),
        guarantee: Guarantee = "none",
        band_of: Callable[[Scene], Band] | None = None,
    ) -> None:
        """Assemble the forms of a mesh.

        scene:     any scene of the study; body and roles are the same in all of them
        scenes:    all scenes to come, if known: many values of α then share a few temperatures
        guarantee: what is proved of the body (scene/mesh_plan.py)
        band_of:   gives bounds of λ₁ of the body; None for those of this mesh, if they are wanted
        Raises GeometryFailed if errors of the body are bounded and an edge is curved.
        """
        start = time.perf_counter()
        self.mesh = mesh
        self._band_of = band_of
        self._has_band = band_of is not None or guarantee in ("bounds", "polygon")
        if guarantee == "bounds":
            require_straight(mesh, scene.body)
        self._bands = Recent[Band]()
        self._frames = Recent[Frames]()
        self._laws = Recent[Laws]()
        self._motions = Recent[RigidMotions]()
        self._duals: dict[Ratio, tuple[EquilibriumBody, float]] = {}
        self.elastic = ElasticForms(mesh)
        self.temperatures = Temperatures(self.elastic, scene, scenes, MEMORY)
        self.elimination: EliminationPlan | None = None
        self._bodies: dict[Ratio, ElasticBody] = {}
        self.frames = self.frames_of(scene.boundary)
        self.line = contact_line(mesh, self.frames, scene.edges(Contact))
        self.opening: OpeningLine | None = None
        self.rows = self.line.nodes
        self.c = self.line.c
        if scene.opens:
            opening = opening_line(mesh, self.frames, self.line, scene.opening_edges)
            self.opening = opening
            self.rows = np.append(self.rows, opening.rows)
            self.c = np.append(self.c, opening.c)
        self.elastic.products()
        self.time_assemble = time.perf_counter() - start

    @property
    def m(self) -> int:
        """Number of contact unknowns: slips, then openings."""
        return len(self.rows)

    @property
    def blocks(self) -> tuple[int, ...]:
        """Numbers of the slips and of the openings, () without openings."""
        return () if self.opening is None else (self.line.m, self.opening.m)

    def split(self, v: NDArray[Any]) -> tuple[NDArray[Any], NDArray[Any]]:
        """Return the slips (…, m_T) and the openings (…, m_N) of unknowns v (…, m)."""
        return v[..., : self.line.m], v[..., self.line.m :]

    def frames_of(self, boundary: Boundary) -> Frames:
        """Return the local frames of the nodes with the prescribed displacements of a boundary."""
        key = _held(boundary)
        return self._frames.of(key, lambda: constrain(self.mesh, key))

    def is_held(self, scene: Scene) -> bool:
        """Return whether supports and springs leave no rigid motion of the mesh."""
        if is_clamped(scene.boundary) or not self.motions(scene):
            return True
        return self._body(scene).is_held

    def contact_motions(self, scene: Scene) -> Array:
        """Return (k, m) the rigid motions that the supports leave, at the contact DOFs."""
        if is_clamped(scene.boundary):
            return np.zeros((0, self.m))
        u = self.motions(scene).at(self.mesh.points)
        rows = [self.frames.rows(motion.T.ravel())[self.rows] for motion in u]
        return np.array(rows).reshape(-1, self.m)

    def motion_name(self, scene: Scene, weights: Array) -> str:
        """Return a sum of the rigid motions in words; a translation that opens an edge separates.

        weights: (k,) of the motions
        """
        motions = self.motions(scene)
        coefficients = weights @ motions.coefficients
        size = float(np.max(np.abs(coefficients))) or 1.0
        name = replace(motions, coefficients=coefficients[None] / size).words
        opens = np.any(weights @ self.contact_motions(scene)[:, self.line.m :] != 0.0)
        return name.replace("slide", "separate") if opens else name

    def motions(self, scene: Scene) -> RigidMotions:
        """Return the rigid motions that the supports of a scene leave, so that contact holds it."""
        boundary = scene.boundary
        return self._motions.of(
            supports(boundary), lambda: motions_of_geometry(self.mesh.geometry, boundary)
        )

    def _body(self, scene: Scene) -> ElasticBody:
        """Return the factorised body of this λ/μ; one is kept at a time, as factors are large."""
        ratio = ratio_of(scene)
        if ratio not in self._bodies:
            self._bodies.clear()
            self._bodies[ratio] = ElasticBody(self, ratio, self.contact_motions(scene))
        return self._bodies[ratio]

    # -- the condensed problem ---------------------------------------------------------------------

    def temperature(self, scene: Scene) -> Temperature:
        """Return θ of a scene with its mean and heat balance, zero for a scene without heat."""
        return self.temperatures.of(scene)

    def condensed(self, scene: Scene) -> Condensed:
        """Return Ã, l̃ and c of a scene, eq. (20); factors and basis loads are reused by value.

        Raises NotPositiveDefinite if the body is not held or the material is not elastic.
        """
        l_tilde, constant = self._load(scene)
        body = self._body(scene)
        A_tilde = scene.material.mu * body.condensation.A_tilde
        problem = ContactProblem(
            A_tilde, l_tilde, self.c, self.law(scene), body.lambda_1_error, self.blocks
        )
        if not body.is_held:
            loose = loose_body(A_tilde, self.c, self.blocks)
            problem = ContactProblem.on(loose, l_tilde, problem.law)
        return Condensed(problem, constant)

    def _load(self, scene: Scene) -> tuple[Array, float]:
        """Return l̃ (m,) [N/m] and the constant part of the energy [J/m]."""
        # heat first: its factor may be freed before the elastic one is made
        terms = self._terms(scene)
        prescribed = self.frames_of(scene.boundary).values
        return self._body(scene).load(scene.material.mu, terms, prescribed)

    def _load_terms(self, scene: Scene) -> list[LoadTerm]:
        """Return the basis terms of the mechanical and thermal loads."""
        terms = list(mechanical_terms(scene.f, scene.boundary))
        for where, field, factor in self.temperatures.terms(scene):
            terms.append((BasisLoad("temperature", field, where), factor))
        return terms

    def _terms(self, scene: Scene) -> list[LoadTerm]:
        """Return the basis terms of the load, those of prescribed displacements last."""
        terms = self._load_terms(scene)
        if np.any(self.frames_of(scene.boundary).values):
            terms.append((BasisLoad("prescribed", _held(scene.boundary)), scene.material.mu))
        return terms

    def law(self, scene: Scene) -> Laws:
        """Return the friction law of Γ_C, or the law of every unknown where these differ.

        The laws of openings come after those of slips.
        Raises ValueError for a strength below 0.
        """
        friction = scene.friction
        line = self.line
        opening = self.opening
        if opening is not None:
            key = friction, scene.adhesion, _held(scene.boundary)
            return self._laws.of(key, lambda: laws_of_unknowns(scene, line, opening))
        if isinstance(friction, Laws):
            return friction
        return self._laws.of(
            friction,
            lambda: law_along(friction, line.edge_names, line.edge, line.xy, line.joints),
        )

    def pressure_friction(self, scene: Scene) -> PressureFriction | None:
        """Return the friction that acts only where an edge is pressed; None without any.

        The law of the scene (`law`) is without it. Raises ValueError for a strength below 0.
        """
        if self.opening is None or not scene.knows_pressure:
            return None
        # imported only for such scenes
        from tcstudy.offline.pressed import pressure_friction

        return pressure_friction(scene, self.line, self.opening)

    def block(self, scenes: Sequence[Scene]) -> CondensedBlock:
        """Return the condensed problems of scenes that share λ/μ (see `ratio`).

        Each distinct load is condensed once. The results of a scene do not depend on the other
        scenes of its block, to the bit.
        Raises as `condensed`, and ValueError for scenes of different ratios.
        """
        start = time.perf_counter()
        # by identity: the scenes of a sweep share records, and comparing equal ones only takes time
        numbers = dict[Hashable, int]()
        load_of_scene = []
        for scene in scenes:
            key = id(scene.boundary), id(scene.heat), id(scene.material), scene.f
            load_of_scene.append(numbers.setdefault(key, len(numbers)))
        first_scenes = [scenes[i] for i in np.unique(load_of_scene, return_index=True)[1]]
        if len({self.ratio(scene) for scene in first_scenes}) > 1:
            raise ValueError("the scenes of a block differ in λ/μ")
        loads = []
        for scene in first_scenes:
            load, constant = self._load(scene)
            mean = np.nan
            balance = np.nan
            if scene.material.expands:
                temperature = self.temperature(scene)
                mean = temperature.mean
                balance = temperature.heat_balance
            loads.append((load, constant, mean, balance))
        body = self._body(scenes[0])
        l_tilde, constants, means, balances = (
            np.array(column)[load_of_scene] for column in zip(*loads, strict=True)
        )
        mu = np.array([scene.material.mu for scene in scenes])
        band = self.band(scenes[0]).times(1.0 / mu[0]) if self._has_band else None
        return CondensedBlock(
            body.condensation.A_tilde,
            self.c,
            body.lambda_1,
            body.lambda_1_error,
            body.is_held,
            mu,
            l_tilde,
            constants,
            means,
            balances,
            time.perf_counter() - start,
            band,
            self.blocks,
        )

    ratio = staticmethod(ratio_of)

    def lambda_1(self, scene: Scene) -> float:
        """Return λ₁ of the body on this mesh (method §5) [Pa/m], computed once per λ/μ."""
        return scene.material.mu * self._body(scene).lambda_1

    def band(self, scene: Scene) -> Band:
        """Return bounds of λ₁ of the continuous body [Pa/m], computed once per λ/μ.

        They are NaN for a body that contact alone holds.
        """
        if self._band_of is not None:
            return self._band_of(scene)
        ratio = ratio_of(scene)
        mu = scene.material.mu
        if ratio not in self._bands and not self.is_held(scene):
            self._bands[ratio] = NO_BAND
        elif ratio not in self._bands:
            dual, factor = self.dual(scene)
            A_tilde = mu / factor * self._body(scene).condensation.A_tilde
            band = lambda_1_band(dual, self.mesh, self.line, A_tilde)
            self._bands[ratio] = band.times(factor / mu)
        return self._bands[ratio].times(mu)

    def dual(self, scene: Scene) -> tuple[EquilibriumBody, float]:
        """Return equilibrium elements of this λ/μ, and the stiffness of the scene relative to them.

        One such body is kept at a time.
        """
        ratio = ratio_of(scene)
        mu = scene.material.mu
        if ratio not in self._duals:
            self._duals.clear()
            self._duals[ratio] = dual_body(self.mesh, scene, self.line), mu
        body, mu_of_body = self._duals[ratio]
        return body, mu / mu_of_body

    def held_slips(self, scene: Scene) -> Array:
        """Return u_T (h,) prescribed at the held ends of Γ_C, along the exact edge [m].

        It is NaN where a rigid edge moves the end, or where two edges that open meet in a corner.
        """
        frames = self.frames_of(scene.boundary)
        n = self.mesh.n_points
        segments, sides = self.line.held
        nodes = self.line.segments[segments, sides]
        normals = self.mesh.end_normals[self.line.which[segments], sides]
        u_x, u_y = frames.cartesian(frames.values).reshape(2, n)[:, nodes]
        slips = normals[:, 0] * u_y - normals[:, 1] * u_x
        if frames.ties is not None:
            changes = abs(frames.ties - sp.eye_array(2 * n)).sum(axis=1).reshape(2, n)
            slips[np.any(changes[:, nodes] > 0.0, axis=0)] = np.nan
        slips[np.isin(nodes, frames.corners)] = np.nan
        return slips

    def held_openings(self, scene: Scene) -> Array:
        """Return the openings (h,) prescribed at the held ends of edges that may lift off [m]."""
        opening = self.opening
        assert opening is not None
        segments, sides = np.nonzero(opening.unknowns < 0)
        segments = opening.which[segments]
        nodes = self.line.segments[segments, sides]
        normals = self.mesh.end_normals[self.line.which[segments], sides]
        frames = self.frames_of(scene.boundary)
        u = frames.cartesian(frames.values).reshape(2, -1)[:, nodes]
        return -np.einsum("ij,ji->i", normals, u)

    # -- the whole body ----------------------------------------------------------------------------

    def displacement(self, scene: Scene, v: Array) -> Array:
        """Return the displacement in x and y (2n,) of a contact solution v (m,), eq. (20)."""
        frames = self.frames_of(scene.boundary)
        w = self._body(scene).displacement(scene.material.mu, v, self._terms(scene))
        return frames.cartesian(w + frames.values)

    def fields(self, scene: Scene, v: Array) -> dict[str, Array]:
        """Return nodal fields (n,) of the whole body by name.

        They are u_x, u_y [m] and, if temperature loads the body, theta [K].
        """
        u = self.displacement(scene, v)
        n = self.mesh.n_points
        fields = {"u_x": u[:n], "u_y": u[n:]}
        if scene.material.expands:
            fields["theta"] = self.temperature(scene).theta
        return fields

    def extension(self, scene: Scene, v: Array) -> Array:
        """Return the displacement in x and y (2n,) of an unloaded body with contact unknowns v."""
        return self.frames.cartesian(self._body(scene).condensation.expand(v))

    def extensions(self, scene: Scene, v: Array) -> Array:
        """Return the displacements (2n, k) of an unloaded body with contact unknowns v (m, k)."""
        return self.frames.cartesian(self._body(scene).condensation.expand(v))

    def condensed_of(self, scene: Scene, load: Array) -> Array:
        """Return l̃ (m,) of a load (2n,) in x and y on the body of a scene [N/m]."""
        condensation = self._body(scene).condensation
        return condensation.condensed(condensation.forward(self.frames.local(load)))

    def load(self, scene: Scene) -> Array:
        """Return l_θ in x and y (2n,), without prescribed displacements [N/m]."""
        parts = (factor * self.vector(load) for load, factor in self._load_terms(scene))
        return np.asarray(sum(parts, np.zeros(2 * self.mesh.n_points)))

    def forces(self, u: Array, moduli: Moduli, springs: Springs) -> Array:
        """Return (A + S)u of a displacement u, both (2n,) in x and y [N/m]."""
        forces = np.zeros(len(u))
        if moduli:
            forces = self.elastic.stiffness_of(moduli) @ u
        if springs:
            forces = forces + self.elastic.springs(springs) @ u
        return forces

    def stiffness_times(self, scene: Scene, u: Array) -> Array:
        """Return (A + S)u of the body of a scene, as `forces` does."""
        moduli = tuple((where, material.lam, material.mu) for where, material in scene.pieces)
        return self.forces(u, moduli, scene.springs)

    def reactions(self, scene: Scene, u: Array) -> Array:
        """Return the reactions Au + Su − l_θ (2n,) in x and y of a solution u (2n,) [N/m]."""
        return self.stiffness_times(scene, u) - self.load(scene)

    def vector(self, load: BasisLoad) -> Array:
        """Return a basis load in x and y (2n,); "prescribed" needs a body and is not among them."""
        mesh = self.mesh
        if load.kind == "temperature":
            return self.elastic.expansion(self.temperatures.field(load.data), load.where)
        if load.kind == "moment":
            return couple(mesh, load.where[0])
        shape, direction = load.data
        F = np.zeros((2, mesh.n_points))
        match load.kind:
            case "body":
                F[direction] = source_load(mesh, shape, ())
            case "force":
                F[direction] = edge_load(mesh, shape, load.where)
                F /= F.sum()
            case "traction":
                F = traction_load(mesh, shape, load.where, direction)
        return F.ravel()


MAX_LIVE_NODES = 250
"""Contact nodes up to which a page gets the arrays of a level.

Ã of more nodes takes several megabytes.
"""


def live_arrays(level: Level, scenes: Sequence[Scene], shape: tuple[int, ...]) -> dict[str, Array]:
    """Return the arrays from which a page solves the points of a sweep by itself.

    The dictionary is empty for a level with more than MAX_LIVE_NODES contact nodes, or where edges
    may lift off, for which a page has no solver.

    A_tilde: (m, m) of the first point;  stiffness: (*shape) μ over that of the first point
    load, mechanical_load: (*shape, m) l̃, and its part from f, g, pressure and forces
    valid: (*shape) 1 where Ã of a point is A_tilde × stiffness, at equal elastic ratios; else 0
    Raises NotPositiveDefinite as `Level.condensed`.
    """
    first = scenes[0]
    m = level.line.m
    if not 0 < m <= MAX_LIVE_NODES or level.opening is not None:
        return {}
    valid = np.array([level.ratio(scene) == level.ratio(first) for scene in scenes])
    valid_scenes = [scene for scene, same in zip(scenes, valid, strict=True) if same]
    load = np.zeros((len(scenes), m))
    load[valid] = level.block(valid_scenes).l_tilde
    mechanical_scenes = [loaded_by(scene, loads=True) for scene in valid_scenes]
    mechanical_load = np.zeros((len(scenes), m))
    mechanical_load[valid] = level.block(mechanical_scenes).l_tilde
    stiffness = np.array([scene.material.mu / first.material.mu for scene in scenes])
    return {
        "A_tilde": level.condensed(first).problem.A_tilde,
        "stiffness": stiffness.reshape(shape),
        "load": load.reshape(*shape, m),
        "mechanical_load": mechanical_load.reshape(*shape, m),
        "valid": valid.astype(float).reshape(shape),
    }
