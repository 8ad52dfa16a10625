"""One mesh level of a study: matrices once, a factorisation for each λ/μ, a condensed problem for
each sweep point.

A(λ, μ) = μ A(λ/μ, 1), so that one factorisation serves all materials of the same ratio: Ã scales
with μ, l̃ does not depend on it, A⁻¹l scales with 1/μ. Where materials differ by region the ratio
is that of all their moduli, and of springs, to μ of the material of the body.
"""

from __future__ import annotations

import time
from collections.abc import Hashable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any, Literal, NamedTuple

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from tcstudy.condense import Condensation, condense
from tcstudy.condense.condensation import EliminationPlan
from tcstudy.contact.problem import ContactProblem, least_eigenpair
from tcstudy.fem.forms import (
    ElasticForms,
    Moduli,
    Springs,
    constrain,
    contact_line,
    couple,
    edge_load,
    source_load,
)
from tcstudy.fem.meshes import Frames, PlaneMesh
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
from tcstudy.scene.records import Boundary, Clamped, Contact, EdgeHeat, Rigid, Role, Scalar, Scene

Array = NDArray[np.float64]
Mechanical = Literal["body", "edge", "pressure", "force", "moment"]
Ratio = tuple[Moduli, Springs]
"""All moduli and springs over μ of the material of the body."""

MEMORY = 512e6
"""Bytes of basis loads, and again of temperatures, that a level keeps for reuse."""
ROUNDINGS = 4.0
"""Of A, by which the error of λ₁ is estimated."""


@dataclass(frozen=True)
class BasisLoad:
    """A load of no number but its shape.

    kind: "body", "edge": ∫f·v and, over the study edge `where`, ∫g·v; f or g of shape s along the
    axis a, data = (s, a)
          "pressure":     −∫ s n·v over an edge
          "force":        a resultant of 1 along the axis a, spread evenly over an edge
          "moment":       a moment of 1 about the middle of an edge
          "temperature":  ∫ θ tr ε(v) over regions (all without `where`) of the field `data`
          "prescribed":   −a(w_D, v) for μ = 1, w_D what the roles `data` prescribe; it scales with μ
    """

    kind: Mechanical | Literal["temperature", "prescribed"]
    data: Any = None
    where: tuple[str, ...] = ()


LoadTerm = tuple[BasisLoad, float]
"""A basis load and its coefficient."""


def mechanical_terms(f: tuple[Scalar, Scalar], boundary: Boundary) -> Iterator[LoadTerm]:
    """Terms of ∫f·v and of what loads all edges."""
    given: list[tuple[Mechanical, int | None, Scalar, str]] = [
        ("body", axis, f[axis], "") for axis in (0, 1)
    ]
    for name, role in boundary:
        given += [("force", axis, role.force[axis], name) for axis in (0, 1)]
        given += [("moment", None, role.moment or 0.0, name)]
        given += [("edge", axis, role.g[axis], name) for axis in (0, 1)]
        given += [("pressure", None, role.pressure, name)]
    for kind, axis, value, name in given:
        shape, factor = split(value)
        if factor != 0.0:
            yield BasisLoad(kind, (shape, axis), (name,)), factor


def loaded_by(scene: Scene, *, loads: bool = False) -> Scene:
    """The scene with its mechanical loads as they are or none, and nothing else: no given
    displacement, θ = 0."""
    boundary, none, body = [], (0.0, 0.0), scene.heat
    for name, role in scene.boundary:
        x, y = (None if one is None else 0.0 for one in role.u)
        kept = replace(role, u=(x, y))
        if not loads:
            kept = replace(kept, g=none, pressure=0.0, force=none, moment=role.moment and 0.0)
        if (own := kept.heat) is not None:
            theta, theta_bar = (None if one is None else 0.0 for one in (own.theta, own.theta_bar))
            kept = replace(kept, heat=EdgeHeat(theta, 0.0, own.alpha, theta_bar))
        boundary.append((name, kept))
    body = (
        replace(body, theta=0.0) if body.theta is not None else replace(body, theta_bar=0.0, q=0.0)
    )
    f = scene.f if loads else none
    return replace(scene, boundary=tuple(boundary), f=f, heat=body, load=1.0, unscaled=None)


def ratio_of(scene: Scene) -> Ratio:
    """λ/μ, μ/μ of the regions and springs over μ, to 15 digits: scenes that share it share a
    factor."""
    mu = scene.material.mu
    moduli = tuple(
        (at, to_digits(one.lam / mu), to_digits(one.mu / mu)) for at, one in scene.pieces
    )
    return moduli, tuple(
        (edge, to_digits(n / mu), to_digits(t / mu)) for edge, n, t in scene.springs
    )


class Condensed(NamedTuple):
    """One scene on one level: Ã, l̃, c, law, and what the total potential energy L_θ(u) has beside
    L̃(u₁) [J/m]."""

    problem: ContactProblem
    constant: float


@dataclass(frozen=True)
class CondensedBlock:
    """P scenes on one level whose bodies differ in μ only: plain arrays, nothing of the mesh.

    A_tilde:  (m, m) for μ = 1; the scenes have mu·A_tilde [1]
    c:        (m,) [m];  lambda_1: of A_tilde [1/m];  lambda_1_error: relative
    mu:       (P,) shear moduli [Pa];  l_tilde: (P, m) condensed loads [N/m]
    constant: (P,) what the total potential energies have beside L̃(u₁) [J/m]
    theta_mean, heat_balance: (P,) as in `Temperature`; NaN where temperature does not load the body
    time:     wall time spent on factorisation and loads [s]
    band:     λ₁ of the body itself for μ = 1, where it is asked for
    """

    A_tilde: Array
    c: Array
    lambda_1: float
    lambda_1_error: float
    mu: Array
    l_tilde: Array
    constant: Array
    theta_mean: Array
    heat_balance: Array
    time: float
    band: Band | None = None


def _held(boundary: Boundary) -> Boundary:
    """The part of the boundary that constrains displacements, as a key."""
    found: list[tuple[str, Role]] = []
    for name, role in boundary:
        if isinstance(role, Rigid):
            role = replace(role, force=(0.0, 0.0), moment=role.moment and 0.0)
        if isinstance(role, Clamped | Contact):
            found.append((name, replace(role, heat=None)))
    return tuple(found)


_Basis = tuple[Array, Array]
"""A basis load: L⁻¹F in elimination order (N,), and F at the rows that are held."""


class ElasticBody:
    """The body of one ratio of moduli, condensed, for μ = 1: all that its scenes share."""

    def __init__(self, level: Level, ratio: Ratio) -> None:
        """Raises NotPositiveDefinite if the body is not held."""
        self._level, (moduli, springs), frames, line = level, ratio, level.frames, level.line
        A = level.elastic.stiffness_of(moduli, frames)
        A = sp.csr_array(A + level.elastic.springs(springs, frames)) if springs else A
        A = A if frames.ties is None else sp.csr_array(frames.ties.T @ A @ frames.ties)
        eliminate = ~frames.fixed
        eliminate[line.nodes] = False
        at = level.mesh.points, line.nodes, eliminate, 2
        self.condensation: Condensation = condense(A, *at, plan=level.elimination)
        level.elimination = self.condensation.plan
        self.lambda_1, self.lambda_1_error = 0.0, 0.0
        if level.held:
            self.condensation.require_definite()
            # Assembly and factorisation know A up to about ε√(A_ii A_jj) in every entry (Cholesky:
            # Demmel, LAPACK Working Note 14, 1989), which moves λ₁ = uᵀAu by ε Σ A_ii u_i² with u
            # the mode of the whole body: what is lost where that is stiff but only moves as a
            # whole, or along an edge that a spring holds across. An estimate, ROUNDINGS of them; of
            # 200 random bodies none lost more than one.
            value, x, error = least_eigenpair(self.condensation.A_tilde, line.c)
            work = float(A.diagonal() @ self.condensation.expand(x) ** 2)
            lost = ROUNDINGS * np.finfo(float).eps * work / value if value > 0.0 else np.inf
            self.lambda_1, self.lambda_1_error = value, error + lost
        self._fixed = np.flatnonzero(frames.fixed)
        self._reactions = A[self._fixed]  # all that is needed of the matrix from here on
        self._basis: Recent[_Basis] = Recent(MEMORY, lambda basis: basis[0].nbytes)
        self._spans: Recent[tuple[Array, ...]] = Recent(MEMORY, lambda span: span[0].nbytes)

    def _reaction(self, w_D: Array) -> Array:
        """A w_D (2n,) for prescribed local displacements w_D (2n,)."""
        return self._reactions.T @ w_D[self._fixed]

    def load(self, mu: float, terms: Sequence[LoadTerm], w_D: Array) -> tuple[Array, float]:
        """l̃ (m,) and what the energy has beside L̃, of a load whose last term is "prescribed"
        where w_D (2n,) is not 0.

        L_θ(u) − L̃(u₁) = −½⟨l₂, A₂₂⁻¹l₂⟩ + ½⟨w_D, A w_D⟩ − ⟨l, w_D⟩
        """
        loads, factors = tuple(load for load, _ in terms), np.array([factor for _, factor in terms])
        l_tilde, gram, held = self._spans.of(loads, lambda: self._span(loads))
        constant = -0.5 / mu * float(factors @ gram @ factors)
        given = w_D[self._fixed]
        if np.any(given):
            constant += 0.5 * mu * float(w_D @ self._reaction(w_D))
            constant -= float(factors[:-1] @ (held[:-1] @ given))
        return l_tilde @ factors, constant

    def _span(self, loads: Sequence[BasisLoad]) -> tuple[Array, Array, Array]:
        """Of t basis loads: l̃ (m, t), ⟨l_a, A₂₂⁻¹ l_b⟩ (t, t), and what they are at the rows that
        are held (t, h)."""
        bases, t, m = self._bases(loads), len(loads), self.condensation.m
        rows = [own[: len(own) - m] for own, _ in bases]  # L⁻¹l₂: the kept unknowns come last
        gram = np.array([[a @ b for b in rows] for a in rows]).reshape(t, t)
        l_tilde = np.reshape([self.condensation.condensed(own) for own, _ in bases], (t, m)).T
        return l_tilde, gram, np.array([held for _, held in bases]).reshape(t, len(self._fixed))

    def _bases(self, loads: Sequence[BasisLoad]) -> list[_Basis]:
        """Basis loads condensed, from the cache or eliminated at once with their companions.

        A load always goes with the same companions, so that its digits do not depend on what was
        asked for before.
        """

        found, level = dict[BasisLoad, _Basis](), self._level
        for load in loads:
            if load in self._basis:
                found[load] = self._basis[load]
            elif load.kind == "prescribed":
                found |= self._eliminated(
                    [load], [-self._reaction(level.frames_of(load.data).values)]
                )
            elif load not in found:
                is_column = isinstance(load.data, Column)
                together = (
                    [replace(load, data=column) for column in load.data.together]
                    if is_column
                    else [load]
                )
                found |= self._eliminated(
                    together, [level.frames.local(level.vector(one)) for one in together]
                )
        return [found[load] for load in loads]

    def _eliminated(
        self, loads: Sequence[BasisLoad], F: Sequence[Array]
    ) -> dict[BasisLoad, _Basis]:
        """Loads with their vectors in local rows (2n,), after one elimination."""
        forward = zip(loads, F, self.condensation.forward(np.column_stack(F)).T, strict=True)
        found = dict[BasisLoad, _Basis]()
        for load, own, rows in forward:
            found[load] = self._basis[load] = rows.copy(), own[self._fixed]
        return found

    def displacement(self, mu: float, u_T: Array, terms: Sequence[LoadTerm]) -> Array:
        """Local displacements (2n,), eq. (20), without the prescribed ones."""
        rows = np.zeros(len(self.condensation.plan.permutation))
        bases = self._bases([load for load, _ in terms])
        for (_, factor), (own, _) in zip(terms, bases, strict=True):
            rows += factor / mu * own
        return self.condensation.expand(u_T, rows)


class Level:
    """All scenes of a study on one mesh. Caches are keyed by value: equal inputs are computed
    once."""

    def __init__(
        self,
        mesh: PlaneMesh,
        scene: Scene,
        scenes: Sequence[Scene] = (),
        held: bool = True,
        guarantee: bool = False,
    ) -> None:
        """mesh: one level;  scene: any scene of the study (body and roles are the same in all of them).

        scenes: all scenes to come, if known: many values of α then cost a few temperatures, not one
        each held: False for a body that may slide along the contact line, which then has no λ₁
        guarantee: whether λ₁ of the body itself is asked for; raises GeometryFailed if an edge is
        curved then
        """
        start = time.perf_counter()
        self.mesh, self.held, self.guarantee = mesh, held, guarantee
        if guarantee:
            require_straight(mesh)
        self._bands, self._frames, self._laws = Recent[Band](), Recent[Frames](), Recent[Laws]()
        self._duals: dict[Ratio, tuple[EquilibriumBody, float]] = {}
        self.elastic = ElasticForms(mesh)
        self.temperatures = Temperatures(self.elastic, scene, scenes, MEMORY)
        self.elimination: EliminationPlan | None = None
        self._bodies: dict[Ratio, ElasticBody] = {}
        self.frames = self.frames_of(scene.boundary)
        self.line = contact_line(mesh, self.frames, scene.edges(Contact))
        self.elastic.products()
        self.time_assemble = time.perf_counter() - start

    def frames_of(self, boundary: Boundary) -> Frames:
        """The local frames of the nodes, with the displacements that a scene's boundary
        prescribes."""
        key = _held(boundary)
        return self._frames.of(key, lambda: constrain(self.mesh, key))

    def _body(self, scene: Scene) -> ElasticBody:
        """The body of this λ/μ, factorised; one at a time, as factors are large."""
        ratio = ratio_of(scene)
        if ratio not in self._bodies:
            self._bodies.clear()
            self._bodies[ratio] = ElasticBody(self, ratio)
        return self._bodies[ratio]

    # -- the condensed problem ---------------------------------------------------------------------

    def temperature(self, scene: Scene) -> Temperature:
        """θ of a scene with its mean and heat balance; zero where the scene has no heat."""
        return self.temperatures.of(scene)

    def condensed(self, scene: Scene) -> Condensed:
        """Ã, l̃ and c of a scene, eq. (20); factors and basis loads are reused by value.

        Raises NotPositiveDefinite if the body is not held or the material is not elastic.
        """
        l_tilde, constant = self._load(scene)
        body = self._body(scene)
        A_tilde = scene.material.mu * body.condensation.A_tilde
        return Condensed(
            ContactProblem(A_tilde, l_tilde, self.line.c, self.law(scene), body.lambda_1_error),
            constant,
        )

    def _load(self, scene: Scene) -> tuple[Array, float]:
        """l̃ (m,) [N/m], and what the energy has beside L̃ [J/m]."""
        terms = self._terms(scene)  # heat first: its factor may go before the elastic one comes
        return self._body(scene).load(
            scene.material.mu, terms, self.frames_of(scene.boundary).values
        )

    def _given(self, scene: Scene) -> list[LoadTerm]:
        heats = self.temperatures.terms(scene)
        thermal = ((BasisLoad("temperature", name, where), factor) for where, name, factor in heats)
        return [*mechanical_terms(scene.f, scene.boundary), *thermal]

    def _terms(self, scene: Scene) -> list[LoadTerm]:
        """The basis terms of the load; the last is what is prescribed, if anything is."""
        terms = self._given(scene)
        if np.any(self.frames_of(scene.boundary).values):
            terms.append((BasisLoad("prescribed", _held(scene.boundary)), scene.material.mu))
        return terms

    def law(self, scene: Scene) -> Laws:
        """The friction law of Γ_C, or of every contact node where it differs along Γ_C.

        Raises ValueError for a strength below 0.
        """
        friction, line = scene.friction, self.line
        if isinstance(friction, Laws):
            return friction
        at = line.edge_names, line.edge, line.xy, line.joints
        return self._laws.of(friction, lambda: law_along(friction, *at))

    def block(self, scenes: Sequence[Scene]) -> CondensedBlock:
        """The condensed problems of scenes that share λ/μ (see `ratio`), each distinct load once.

        A scene's numbers do not depend on the other scenes of its block, to the bit.
        Raises as `condensed`; ValueError for scenes of different ratios.
        """
        start = time.perf_counter()
        which: dict[
            Hashable, int
        ] = {}  # by identity: a sweep shares its records, and equal ones only cost time
        of = [
            which.setdefault((id(s.boundary), id(s.heat), id(s.material), s.f), len(which))
            for s in scenes
        ]
        first = np.unique(of, return_index=True)[1]
        if len({self.ratio(scenes[i]) for i in first}) > 1:
            raise ValueError("the scenes of a block differ in λ/μ")
        loads = []
        for scene in (scenes[i] for i in first):
            load, theta = (
                self._load(scene),
                self.temperature(scene) if scene.material.expands else None,
            )
            loads.append(
                (*load, theta.mean, theta.heat_balance) if theta else (*load, np.nan, np.nan)
            )
        body = self._body(scenes[0])
        l_tilde, constant, mean, balance = (
            np.array(column)[of] for column in zip(*loads, strict=True)
        )
        mu = np.array([scene.material.mu for scene in scenes])
        own = (body.condensation.A_tilde, self.line.c, body.lambda_1, body.lambda_1_error, mu)
        band = self.band(scenes[0]).times(1.0 / mu[0]) if self.guarantee else None
        return CondensedBlock(
            *own, l_tilde, constant, mean, balance, time.perf_counter() - start, band
        )

    ratio = staticmethod(ratio_of)

    def lambda_1(self, scene: Scene) -> float:
        """λ₁ of the body on this mesh (method §5) [Pa/m], once per λ/μ."""
        return scene.material.mu * self._body(scene).lambda_1

    def band(self, scene: Scene) -> Band:
        """λ₁ of the body of a scene, not of its mesh, from both sides [Pa/m], once per λ/μ."""
        ratio, mu = ratio_of(scene), scene.material.mu
        if ratio not in self._bands:
            dual, factor = self.dual(scene)
            A_tilde = mu / factor * self._body(scene).condensation.A_tilde
            self._bands[ratio] = lambda_1_band(dual, self.mesh, self.line, A_tilde).times(
                factor / mu
            )
        return self._bands[ratio].times(mu)

    def dual(self, scene: Scene) -> tuple[EquilibriumBody, float]:
        """Equilibrium elements of this λ/μ, one at a time, and how many times as stiff the scene
        is."""
        ratio, mu = ratio_of(scene), scene.material.mu
        if ratio not in self._duals:
            self._duals.clear()
            self._duals[ratio] = dual_body(self.mesh, scene, self.line), mu
        body, own = self._duals[ratio]
        return body, mu / own

    def held_slips(self, scene: Scene) -> Array:
        """(h,) u_T along the exact edge at held ends of Γ_C, as prescribed; NaN where a rigid edge
        moves one [m]."""
        (at, side), frames, n = self.line.held, self.frames_of(scene.boundary), self.mesh.n_points
        node, normal = (
            self.line.segments[at, side],
            self.mesh.end_normals[self.line.which[at], side],
        )
        u_x, u_y = frames.cartesian(frames.values).reshape(2, n)[:, node]
        found = normal[:, 0] * u_y - normal[:, 1] * u_x
        if frames.ties is not None:
            moved = abs(frames.ties - sp.eye_array(2 * n)).sum(axis=1).reshape(2, n)
            found[np.any(moved[:, node] > 0.0, axis=0)] = np.nan
        return found

    # -- the whole body ----------------------------------------------------------------------------

    def displacement(self, scene: Scene, u_T: Array) -> Array:
        """The whole displacement in x and y (2n,) from the contact solution, eq. (20)."""
        frames = self.frames_of(scene.boundary)
        w = self._body(scene).displacement(scene.material.mu, u_T, self._terms(scene))
        return frames.cartesian(w + frames.values)

    def fields(self, scene: Scene, u_T: Array) -> dict[str, Array]:
        """Nodal fields of the whole body by name, (n,) each: u_x, u_y [m] and, where it loads the
        body, theta [K]."""
        u, n = self.displacement(scene, u_T), self.mesh.n_points
        known = {"u_x": u[:n], "u_y": u[n:]}
        return (
            known
            if not scene.material.expands
            else known | {"theta": self.temperature(scene).theta}
        )

    def extension(self, scene: Scene, u_T: Array) -> Array:
        """The displacement in x and y (2n,) of a body without load whose contact nodes are moved by
        u_T (m,)."""
        return self.frames.cartesian(self._body(scene).condensation.expand(u_T))

    def condensed_of(self, scene: Scene, load: Array) -> Array:
        """(m,) l̃ of a load (2n,) in x and y on the body of a scene [N/m]: one forward
        elimination."""
        condensation = self._body(scene).condensation
        return condensation.condensed(condensation.forward(self.frames.local(load)))

    def load(self, scene: Scene) -> Array:
        """l_θ in x and y (2n,) [N/m]: mechanical and thermal loads, without prescribed
        displacements."""
        parts = (factor * self.vector(load) for load, factor in self._given(scene))
        return np.asarray(sum(parts, np.zeros(2 * self.mesh.n_points)))

    def forces(self, u: Array, moduli: Moduli, springs: Springs) -> Array:
        """(A + S)u of a displacement u, both (2n,) in x and y [N/m]."""
        found = self.elastic.stiffness_of(moduli) @ u if moduli else np.zeros(len(u))
        return found + self.elastic.springs(springs) @ u if springs else found

    def stiffness_times(self, scene: Scene, u: Array) -> Array:
        """(A + S)u of a scene's body, as `forces`."""
        return self.forces(
            u, tuple((at, one.lam, one.mu) for at, one in scene.pieces), scene.springs
        )

    def reactions(self, scene: Scene, u: Array) -> Array:
        """(2n,) Au + Su − l_θ in x and y [N/m]: what supports do, at a solution u (2n,)."""
        return self.stiffness_times(scene, u) - self.load(scene)

    def vector(self, load: BasisLoad) -> Array:
        """A basis load in x and y (2n,); of what is prescribed there is none without a body."""
        if load.kind == "temperature":
            return self.elastic.expansion(self.temperatures.field(load.data), load.where)
        mesh, (shape, axis), F = self.mesh, load.data, np.zeros((2, self.mesh.n_points))
        match load.kind:
            case "body":
                F[axis] = source_load(mesh, shape, ())
            case "edge" | "force":
                F[axis] = edge_load(mesh, shape, load.where)
                F /= F.sum() if load.kind == "force" else 1.0
            case "pressure":
                F -= [edge_load(mesh, shape, load.where, normal) for normal in (0, 1)]
            case "moment":
                return couple(mesh, load.where[0])
        return F.ravel()


MOST_NODES = 250
"""Contact nodes up to which a level is kept for a page: Ã of more would be several megabytes."""


def live_arrays(level: Level, scenes: Sequence[Scene], shape: tuple[int, ...]) -> dict[str, Array]:
    """What a page needs to solve the points of a sweep by itself; empty where a level has more than
    MOST_NODES nodes.

    A_tilde: (m, m) of the first point;  stiffness: (*shape) μ over that of the first point
    load, mechanical_load: (*shape, m) l̃, and its part from f, g, pressure and forces
    valid:   (*shape) 1 where A_tilde × stiffness is Ã of a point: of the same elastic ratio as the first; 0 elsewhere
    Raises NotPositiveDefinite as `Level.condensed`.
    """
    first, m = scenes[0], level.line.m
    if not 0 < m <= MOST_NODES:
        return {}
    valid = np.array([level.ratio(scene) == level.ratio(first) for scene in scenes])
    own, loads = (
        [scene for scene, same in zip(scenes, valid, strict=True) if same],
        np.zeros((2, len(scenes), m)),
    )
    mechanical = [loaded_by(scene, loads=True) for scene in own]
    for found, some in zip(loads, (own, mechanical), strict=True):
        found[valid] = level.block(some).l_tilde
    stiffness = np.array([scene.material.mu / first.material.mu for scene in scenes])
    return {
        "A_tilde": level.condensed(first).problem.A_tilde,
        "stiffness": stiffness.reshape(shape),
        "load": loads[0].reshape(*shape, m),
        "mechanical_load": loads[1].reshape(*shape, m),
        "valid": valid.astype(float).reshape(shape),
    }
