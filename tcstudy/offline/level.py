"""One mesh level of a study: matrices once, a factorisation per λ/μ, a condensed problem per sweep point."""

from __future__ import annotations

import time
from collections.abc import Hashable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from tcstudy.condense.multifrontal import Known
from tcstudy.condense.symbolic import EliminationPlan
from tcstudy.contact.problem import ContactProblem
from tcstudy.fem.boundary import constrain, contact_line
from tcstudy.fem.forms import ElasticForms, Moduli, Springs
from tcstudy.fem.heat_forms import HeatForms
from tcstudy.fem.meshes import Frames, PlaneMesh
from tcstudy.fem.rigid import couple
from tcstudy.laws.composed import EdgeLaws, law_along
from tcstudy.laws.laws import Laws
from tcstudy.offline.conduction import BATCH
from tcstudy.offline.elastic import Elastic, ratio_and_scale, swept_parts
from tcstudy.offline.guaranteed import Band, lambda_1_band, require_straight
from tcstudy.offline.loads import (
    BasisLoad,
    BodyForce,
    Column,
    EdgeForce,
    EdgeLoad,
    EdgeMoment,
    LoadTerm,
    Prescribed,
    Recent,
    Roles,
    TemperatureField,
    UniformTemperature,
    loaded_by,
    mechanical_terms,
)
from tcstudy.offline.thermal import Temperature, Temperatures
from tcstudy.scene.points import distinct
from tcstudy.scene.records import Clamped, Contact, Rigid, Role, Scene

Array = NDArray[np.float64]
MEMORY = 512e6
"""Bytes of basis loads, and again of temperatures, that a level keeps for reuse."""


@dataclass(frozen=True)
class Condensed:
    """One scene on one level, ready to solve.

    problem:  Ã, l̃, c, law
    constant: what the total potential energy L_θ(u) has beside L̃(u₁) [J/m]
    terms:    the load's basis terms, for the way back
    time:     wall time spent on factorisation and loads for this scene [s]
    band:     λ₁ of the body itself, where it is asked for
    """

    problem: ContactProblem
    constant: float
    terms: tuple[LoadTerm, ...]
    time: float
    band: Band | None = None


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


def _held(boundary: Roles) -> Roles:
    """The part of the boundary that constrains displacements, as a key."""
    found: list[tuple[str, Role]] = []
    for name, role in boundary:
        if isinstance(role, Rigid):
            role = replace(role, force=(0.0, 0.0), moment=role.moment and 0.0)
        if isinstance(role, Clamped | Contact):
            found.append((name, replace(role, heat=None)))
    return tuple(found)


def _groups(scenes: Sequence[Scene]) -> dict[BasisLoad, list[BasisLoad]]:
    """Load that needs no temperature → all that go through the factor with it."""
    loads: dict[BasisLoad, None] = {}
    for scene in distinct(scenes, "f", "boundary"):
        loads |= dict.fromkeys(term.load for term in mechanical_terms(scene.f, scene.boundary))
    for scene in distinct(scenes, "material"):
        loads |= dict.fromkeys(UniformTemperature(where) for where, own in scene.pieces if own.beta != 0.0)
    listed = list(loads)
    batches = [listed[first : first + BATCH] for first in range(0, len(listed), BATCH)]
    return {load: batch for batch in batches for load in batch}


class Level:
    """All scenes of a study on one mesh. Caches are keyed by value: equal inputs are computed once."""

    def __init__(
        self, mesh: PlaneMesh, scene: Scene, scenes: Sequence[Scene] = (), held: bool = True, guarantee: bool = False
    ) -> None:
        """mesh: one level;  scene: any scene of the study (body and roles are the same in all of them).

        scenes: all scenes to come, if known: many values of α then cost a few temperatures, not one each
        held: False for a body that may slide along the contact line
        guarantee: whether λ₁ of the body itself is asked for; raises GeometryFailed if an edge is curved then
        """
        start = time.perf_counter()
        self.mesh, self.held, self.guarantee = mesh, held, guarantee
        if guarantee:
            require_straight(mesh)
        self._bands: dict[tuple[Moduli, Springs], Band] = {}
        self.elastic = ElasticForms(mesh)
        given = tuple(edge for edge, _ in scene.held_theta)
        self.heat = HeatForms(self.elastic, tuple(edge for edge, _, _ in scene.exchange), held=given)
        self.temperatures = Temperatures(self.heat, mesh.points, scenes, MEMORY)
        self._groups = _groups(scenes)
        self._frames: dict[Hashable, Frames] = {}
        self._laws: dict[EdgeLaws, Laws] = {}
        self._plan: EliminationPlan | None = None
        self._known: Known | None = None
        self._changing = self._changing_rows(scenes) if scene.material.regions else None
        self._bodies: Recent[Elastic] = Recent(1, lambda _: 1)  # one factor at a time: they are large
        self._rows: Recent[tuple[Array, float, float, float]] = Recent(MEMORY / 8, lambda row: row[0].nbytes + 1000)
        self.frames = self._frames_of(scene.boundary)
        self.line = contact_line(mesh, self.frames, scene.edges(Contact))
        self.elastic.assemble()
        self.time_assemble = time.perf_counter() - start

    def _changing_rows(self, scenes: Sequence[Scene]) -> NDArray[np.bool_] | None:
        """(2n,) rows of the stiffness in which factors of the scenes differ; None where that is no part of the body."""
        if not (parts := swept_parts(scenes)):
            return None
        nodes = np.zeros(self.mesh.n_points, dtype=bool)
        nodes[self.mesh.triangles[self.mesh.inside(tuple(name for part in parts for name in part))]] = True
        return np.tile(nodes, 2)

    # -- displacement constraints ------------------------------------------------------------------

    def _frames_of(self, boundary: Roles) -> Frames:
        key = _held(boundary)
        if key not in self._frames:
            self._frames[key] = constrain(self.mesh, key)
        return self._frames[key]

    # -- the condensed problem ---------------------------------------------------------------------

    def temperature(self, scene: Scene) -> Temperature:
        """θ of a scene with its mean and heat balance; zero where the scene has no heat."""
        return self.temperatures.of(scene)

    def condensed(self, scene: Scene) -> Condensed:
        """Ã, l̃ and c of a scene, eq. (20); factors and basis loads are reused by value.

        Raises NotPositiveDefinite if the body is not held or the material is not elastic.
        """
        start = time.perf_counter()
        l_tilde, constant, terms = self._condensed_load(scene)
        body, mu, _ = self._body(scene)
        problem = ContactProblem(body.A_tilde(mu), l_tilde, self.line.c, self.law(scene), body.lambda_1_error)
        band = self.band(scene) if self.guarantee else None
        return Condensed(problem, constant, terms, time.perf_counter() - start, band)

    def law(self, scene: Scene) -> Laws:
        """The friction law of Γ_C, or of every contact node where it differs along Γ_C.

        Raises ValueError for a strength below 0.
        """
        friction, line = scene.friction, self.line
        if isinstance(friction, Laws):
            return friction
        if friction not in self._laws:
            self._laws[friction] = law_along(friction, line.edge_names, line.edge, line.xy, line.joints)
        return self._laws[friction]

    def condensed_of(self, scene: Scene, load: Array) -> Array:
        """(m,) l̃ of a load (2n,) in x and y on the body of a scene [N/m]: one forward elimination."""
        body, _, frames = self._body(scene)
        return body.condensed(frames.local(load))

    def held_values(self, scene: Scene) -> Array:
        """(2n,) the displacements that a scene prescribes, in local rows [m]."""
        return self._frames_of(scene.boundary).values

    def _condensed_load(self, scene: Scene) -> tuple[Array, float, tuple[LoadTerm, ...]]:
        """l̃ (m,) [N/m], what the energy has beside L̃ [J/m], and the basis terms of the load."""
        # heat first: its factor may go before the elastic one comes
        terms = (*mechanical_terms(scene.f, scene.boundary), *self.temperatures.terms(scene))
        body, mu, frames = self._body(scene)
        loads = len(terms)
        if np.any(frames.values):
            terms = (*terms, LoadTerm(Prescribed(_held(scene.boundary)), mu))
        span = body.span(tuple(term.load for term in terms))
        coefficients = np.array([term.coefficient for term in terms])
        constant = body.energy_constant(mu, span, coefficients, loads, frames.values)
        return span.l_tilde @ coefficients, constant, terms

    def block(self, scenes: Sequence[Scene]) -> CondensedBlock:
        """The condensed problems of scenes that share λ/μ (see `ratio`), each distinct load once.

        A scene's numbers do not depend on the other scenes of its block, to the bit.
        Raises as `condensed`; ValueError for scenes of different ratios.
        """
        start = time.perf_counter()
        which: dict[Hashable, int] = {}  # by identity: a sweep shares its records, and equal ones only cost time
        of = [which.setdefault((id(s.boundary), id(s.heat), id(s.material), s.f), len(which)) for s in scenes]
        first = np.unique(of, return_index=True)[1]
        if len({self.ratio(scenes[i]) for i in first}) > 1:
            raise ValueError("the scenes of a block differ in λ/μ")
        loads = [self._loads(scenes[i]) for i in first]
        body = self._body(scenes[0])[0]
        l_tilde, constant, mean, balance = (np.array(column) for column in zip(*loads, strict=True))
        mu = np.array([scene.material.mu for scene in scenes])
        return CondensedBlock(
            A_tilde=body.A_tilde(1.0),
            c=self.line.c,
            lambda_1=body.lambda_1,
            lambda_1_error=body.lambda_1_error,
            mu=mu,
            l_tilde=l_tilde[of],
            constant=constant[of],
            theta_mean=mean[of],
            heat_balance=balance[of],
            band=self.band(scenes[0]).times(1.0 / mu[0]) if self.guarantee else None,
            time=time.perf_counter() - start,
        )

    def _loads(self, scene: Scene) -> tuple[Array, float, float, float]:
        """l̃, the energy's constant, mean of θ and heat balance of a scene, kept for the next block."""

        def made() -> tuple[Array, float, float, float]:
            l_tilde, constant, _ = self._condensed_load(scene)
            if not scene.material.expands:
                return l_tilde, constant, float("nan"), float("nan")
            theta = self.temperature(scene)
            return l_tilde, constant, theta.mean, theta.heat_balance

        return self._rows.get((scene.f, scene.boundary, scene.heat, scene.material), made)

    @staticmethod
    def ratio(scene: Scene) -> tuple[Moduli, Springs]:
        """λ/μ to 15 digits, that of the regions, and springs over μ: scenes that share it share a factor."""
        return ratio_and_scale(scene)[0]

    def lambda_1(self, scene: Scene) -> float:
        """λ₁ of the body on this mesh (method §5) [Pa/m], once per λ/μ."""
        body, mu, _ = self._body(scene)
        return mu * body.lambda_1

    def band(self, scene: Scene) -> Band:
        """λ₁ of the body of a scene, not of its mesh, from both sides [Pa/m], once per λ/μ."""
        body, mu, _ = self._body(scene)
        ratio = self.ratio(scene)
        if ratio not in self._bands:
            self._bands[ratio] = lambda_1_band(self.mesh, scene, self.line, body.A_tilde(mu)).times(1.0 / mu)
        return self._bands[ratio].times(mu)

    def A_inverse(self, scene: Scene) -> Array:
        """Ã⁻¹ of a scene's body [1/Pa], once per E, for the certificates."""
        body, mu, _ = self._body(scene)
        return body.A_inverse(mu)

    def displacement(self, scene: Scene, condensed: Condensed, u_T: Array) -> Array:
        """The whole displacement in x and y (2n,) from the contact solution, eq. (20)."""
        body, mu, frames = self._body(scene)
        w = body.displacement(mu, u_T, condensed.terms)
        return frames.cartesian(w + frames.values)

    def fields(self, scene: Scene, condensed: Condensed, u_T: Array) -> dict[str, Array]:
        """Nodal fields of the whole body by name, (n,) each: u_x, u_y [m] and, where it loads the body, theta [K]."""
        u, n = self.displacement(scene, condensed, u_T), self.mesh.n_points
        known = {"u_x": u[:n], "u_y": u[n:]}
        return known if not scene.material.expands else known | {"theta": self.temperature(scene).theta}

    def extension(self, scene: Scene, u_T: Array) -> Array:
        """The displacement in x and y (2n,) of a body without load whose contact nodes are moved by u_T (m,)."""
        body, _, frames = self._body(scene)
        return frames.cartesian(body.extension(u_T))

    def load(self, scene: Scene) -> Array:
        """l_θ in x and y (2n,) [N/m]: mechanical and thermal loads, without prescribed displacements."""
        total = np.zeros(2 * self.mesh.n_points)
        for term in (*mechanical_terms(scene.f, scene.boundary), *self.temperatures.terms(scene)):
            total += term.coefficient * self._vector(term.load)
        return total

    def forces(self, u: Array, moduli: Moduli, springs: Springs) -> Array:
        """(A + S)u of a displacement u, both (2n,) in x and y [N/m]."""
        found = self.elastic.stiffness_of(moduli) @ u if moduli else np.zeros(len(u))
        if springs:
            R = self.frames.rotation
            found += R @ (self.elastic.springs(springs, self.frames) @ (R.T @ u))
        return found

    def reactions(self, scene: Scene, u: Array) -> Array:
        """(2n,) Au + Su − l_θ in x and y [N/m]: what supports do, at a solution u (2n,)."""
        return self.stiffness_times(scene, u) - self.load(scene)

    def stiffness_times(self, scene: Scene, u: Array) -> Array:
        """(A + S)u of a scene's body, as `forces`."""
        return self.forces(u, tuple((at, one.lam, one.mu) for at, one in scene.pieces), scene.springs)

    def _body(self, scene: Scene) -> tuple[Elastic, float, Frames]:
        """The body of this λ/μ, factorised, μ, and its local frames with what is prescribed."""
        (ratio, mu), frames = ratio_and_scale(scene), self._frames_of(scene.boundary)
        body = self._bodies.find(ratio)
        if body is None:
            self._bodies.clear()
            own = (self.elastic, frames, self.line, ratio[0], MEMORY, self._plan, self._changing, self._known)
            body = Elastic(*own, self.held, ratio[1], local=self._local, together=self._together)
            self._plan, self._known = body.condensation.plan, body.condensation.known
            self._bodies.put(ratio, body)
        return body, mu, frames

    def _local(self, load: BasisLoad) -> Array:
        """(2n,) a basis load in local rows; of what is prescribed the displacements."""
        if isinstance(load, Prescribed):
            return self._frames_of(load.held).values
        return self.frames.local(self._vector(load))

    def _together(self, load: BasisLoad) -> Sequence[BasisLoad]:
        """The loads that go through a factor with one."""
        if isinstance(load, TemperatureField) and isinstance(load.field, Column):
            return [TemperatureField(column, load.where) for column in self.temperatures.together(load.field)]
        return self._groups.get(load, [load])

    def _vector(self, load: BasisLoad) -> Array:
        """A basis load in x and y (2n,)."""
        match load:
            case BodyForce():
                return self.elastic.body_force(load.f)
            case UniformTemperature():
                return self.elastic.expansion(np.ones(self.mesh.n_points), load.where)
            case TemperatureField():
                return self.elastic.expansion(self.temperatures.field(load.field), load.where)
            case EdgeMoment():
                return couple(self.mesh, load.edge)
            case EdgeForce():
                return self.elastic.force(load.edge, load.axis)
        assert isinstance(load, EdgeLoad)  # what is prescribed belongs to a factorised body
        return self.elastic.traction(load.edge, load.role)


MOST_NODES = 250
"""Contact nodes up to which a level is kept for a page: Ã of more would be several megabytes."""


def live_arrays(level: Level, scenes: Sequence[Scene], shape: tuple[int, ...]) -> dict[str, Array]:
    """What a page needs to solve the points of a sweep by itself; empty where a level has more than MOST_NODES nodes.

    A_tilde: (m, m) of the first point;  stiffness: (*shape) μ over that of the first point
    load, mechanical_load: (*shape, m) l̃, and its part from f, g, pressure and forces
    valid:   (*shape) 1 where A_tilde × stiffness is Ã of a point: of the same elastic ratio as the first; 0 elsewhere
    Raises NotPositiveDefinite as `Level.condensed`.
    """
    first, m = scenes[0], level.line.m
    if not 0 < m <= MOST_NODES:
        return {}
    valid = np.array([level.ratio(scene) == level.ratio(first) for scene in scenes])
    own, loads = [scene for scene, same in zip(scenes, valid, strict=True) if same], np.zeros((2, len(scenes), m))
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
