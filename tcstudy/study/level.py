"""One mesh level of a study: matrices once, a factorisation per λ/μ, a condensed problem per sweep point."""

from __future__ import annotations

import time
from collections.abc import Callable, Hashable, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from tcstudy.condense.symbolic import EliminationPlan
from tcstudy.fem.boundary import Frames, constrain, values_at
from tcstudy.fem.contact_line import contact_line
from tcstudy.fem.elasticity import ElasticForms
from tcstudy.fem.gradients import GradientProducts
from tcstudy.fem.heat import HeatForms
from tcstudy.fem.meshes import PlaneMesh
from tcstudy.scene.expressions import Expression
from tcstudy.scene.records import Clamped, Contact, Convection, Material, Role, Scene
from tcstudy.solve.problem import ContactProblem
from tcstudy.study.cache import Recent
from tcstudy.study.elastic import PRESCRIBED, Elastic, Load
from tcstudy.study.heat_families import Column
from tcstudy.study.loads import Term, mechanical_terms, split, traction_of
from tcstudy.study.thermal import BATCH, Conduction, Part

Array = NDArray[np.float64]
Field = Expression | Column
"""A temperature field on the body: given, or a column of a heat problem."""

UNIFORM = ("uniform",)
"""Key of the load that a uniform temperature makes."""
MEMORY = 512e6
"""Bytes of basis loads, and again of temperatures, that a level keeps for reuse."""


@dataclass(frozen=True)
class Temperature:
    """θ of one scene: its mean [K], and the defect of α∫(θ−θ̄) = ∫q relative to the heat that moves (NaN if unused)."""

    mean: float
    heat_balance: float
    _nodal: Callable[[], Array] = field(repr=False)

    @cached_property
    def theta(self) -> Array:
        """Nodal values (n,) [K], computed when asked for."""
        return self._nodal()


class _ThetaPart(NamedTuple):
    """One part of θ: a uniform temperature, (field, factor) on top; heat out through Γ_θ, heat moved [W/m]."""

    constant: float
    fields: list[tuple[Field, float]]
    heat_out: float = 0.0
    through: float = 0.0


@dataclass(frozen=True)
class Condensed:
    """One scene on one level, ready to solve.

    problem:  Ã, l̃, c, law
    constant: what the total potential energy L_θ(u) has beside L̃(u₁) [J/m]
    terms:    the load's basis terms, for the way back
    time:     wall time spent on factorisation and loads for this scene [s]
    """

    problem: ContactProblem
    constant: float
    terms: tuple[Term, ...]
    time: float


def _held(boundary: tuple[tuple[str, Role], ...]) -> tuple[tuple[str, Role], ...]:
    """The part of the boundary that constrains displacements, as a key."""
    return tuple(item for item in boundary if isinstance(item[1], Clamped | Contact))


def _ratio_and_scale(material: Material) -> tuple[float, float]:
    """(λ/μ, μ); the ratio to 15 digits, so that E varies without a new factorisation whatever the rounding."""
    return float(f"{material.lam / material.mu:.14e}"), material.mu


def _groups(scenes: Sequence[Scene]) -> dict[Hashable, list[Hashable]]:
    """Key of a load that needs no temperature → the keys of all that go through the factor with it."""
    keys: dict[Hashable, None] = {}
    for f, boundary in dict.fromkeys((scene.f, scene.boundary) for scene in scenes):
        keys |= dict.fromkeys(term.key for term in mechanical_terms(f, boundary))
    if any(scene.material.beta != 0.0 for scene in scenes):
        keys[UNIFORM] = None
    listed = list(keys)
    batches = [listed[first : first + BATCH] for first in range(0, len(listed), BATCH)]
    return {key: batch for batch in batches for key in batch}


class Level:
    """All scenes of a study on one mesh. Caches are keyed by value: equal inputs are computed once."""

    def __init__(self, mesh: PlaneMesh, scene: Scene, scenes: Sequence[Scene] = ()) -> None:
        """mesh: one level;  scene: any scene of the study (body and roles are the same in all of them).

        scenes: all scenes to come, if known: many values of α then cost a few temperatures, not one each
        """
        start = time.perf_counter()
        self.mesh = mesh
        gradients = GradientProducts(mesh)
        self.elastic = ElasticForms(gradients)
        self.heat = HeatForms(gradients, scene.edges(Convection))
        heated = [s for s in scenes if s.material.beta != 0.0] if scene.edges(Convection) else []
        self.conduction = Conduction(self.heat, ((s.heat, s.material.k) for s in heated), MEMORY)
        self._groups = _groups(scenes)
        self._frames: dict[Hashable, Frames] = {}
        self._plan: EliminationPlan | None = None
        self._bodies: Recent[Elastic] = Recent(1, lambda _: 1)  # one factor at a time: they are large
        self._known: Recent[Array] = Recent(MEMORY, lambda theta: theta.nbytes)
        self.frames = self._frames_of(scene.boundary)
        self.line = contact_line(mesh, self.frames, scene.edges(Contact))
        gradients.assemble()
        self.time_assemble = time.perf_counter() - start

    # -- displacement constraints ------------------------------------------------------------------

    def _frames_of(self, boundary: tuple[tuple[str, Role], ...]) -> Frames:
        key = _held(boundary)
        if key not in self._frames:
            self._frames[key] = constrain(self.mesh, key)
        return self._frames[key]

    # -- temperature -------------------------------------------------------------------------------

    def _theta_parts(self, scene: Scene) -> list[_ThetaPart]:
        """All parts of θ; nothing is solved for what is constant or unused."""
        heat = scene.heat
        if heat.theta is not None:
            given = heat.theta
            return [_ThetaPart(0.0, [(given, 1.0)]) if isinstance(given, Expression) else _ThetaPart(float(given), [])]
        if not scene.edges(Convection):
            return []
        k = scene.material.k
        parts: list[tuple[Part, float]] = []
        if isinstance(heat.theta_bar, Expression) or heat.theta_bar != 0.0:
            parts.append((self.conduction.surroundings(heat.theta_bar, heat.alpha, k or 1.0), 1.0))
        shape, factor = split(heat.q)
        if factor != 0.0:
            assert k is not None
            parts.append((self.conduction.source(shape, heat.omega, heat.alpha, k), factor))
        return [
            _ThetaPart(f * p.constant, [(c, f * w) for c, w in p.columns], f * p.heat_out, abs(f) * p.through)
            for p, f in parts
        ]

    def _field(self, name: Field) -> Array:
        """Nodal values (n,) of a field."""
        if isinstance(name, Column):
            return self.conduction.field(name)
        return self._known.get(name, lambda: values_at(name, self.mesh.points))

    def _mean(self, name: Field) -> float:
        """Mean of a field over the body."""
        if isinstance(name, Column):
            return self.conduction.mean(name)
        area = self.heat.nodal_area
        return float(area @ self._field(name)) / float(area.sum())

    def temperature(self, scene: Scene) -> Temperature:
        """θ of a scene with its mean and heat balance; zero where the scene has no heat."""
        parts = self._theta_parts(scene)
        constant = sum(part.constant for part in parts)
        fields = [item for part in parts for item in part.fields]

        def nodal() -> Array:
            theta = np.full(self.mesh.n_points, constant)
            for name, factor in fields:
                theta += factor * self._field(name)
            return theta

        mean = constant + sum(factor * self._mean(name) for name, factor in fields)
        balance = float("nan")
        shape, factor = split(scene.heat.q)
        if scene.heat.theta is None and scene.edges(Convection) and factor != 0.0:
            # relative to all heat that moves, because sources and sinks may cancel, and little q pass much heat by
            defect = sum(part.heat_out for part in parts) - factor * self.conduction.heat_in(shape, scene.heat.omega)
            through = sum(part.through for part in parts)
            balance = abs(defect) / through if through else 0.0
        return Temperature(mean, balance, nodal)

    # -- the condensed problem ---------------------------------------------------------------------

    def condensed(self, scene: Scene) -> Condensed:
        """Ã, l̃ and c of a scene, eq. (20); factors and basis loads are reused by value.

        Raises NotPositiveDefinite if the body is not held or the material is not elastic.
        """
        start = time.perf_counter()
        frames = self._frames_of(scene.boundary)
        # heat first: its factor may go before the elastic one comes
        terms = (*mechanical_terms(scene.f, scene.boundary), *self._thermal_terms(scene))
        body, mu = self._body(scene, frames)
        loads = len(terms)
        if np.any(frames.values):
            terms = (*terms, Term((*PRESCRIBED, _held(scene.boundary)), mu))
        span = body.span(tuple(term.key for term in terms), self._load(body, frames))
        coefficients = np.array([term.coefficient for term in terms])
        constant = body.energy_constant(mu, span, coefficients, loads, frames.values)
        problem = ContactProblem(body.A_tilde(mu), span.l_tilde @ coefficients, self.line.c, scene.friction)
        return Condensed(problem, constant, terms, time.perf_counter() - start)

    def lambda_1(self, scene: Scene) -> float:
        """λ₁ of the body on this mesh (method §5) [Pa/m], once per λ/μ."""
        body, mu = self._body(scene, self._frames_of(scene.boundary))
        return mu * body.lambda_1

    def A_inverse(self, scene: Scene) -> Array:
        """Ã⁻¹ of a scene's body [1/Pa], once per E, for the certificates."""
        body, mu = self._body(scene, self._frames_of(scene.boundary))
        return body.A_inverse(mu)

    def displacement(self, scene: Scene, condensed: Condensed, u_T: Array) -> Array:
        """The whole displacement in x and y (2n,) from the contact solution, eq. (20)."""
        frames = self._frames_of(scene.boundary)
        body, mu = self._body(scene, frames)
        w = body.displacement(mu, u_T, condensed.terms, self._load(body, frames))
        return frames.cartesian(w + frames.values)

    def extension(self, scene: Scene, u_T: Array) -> Array:
        """The displacement in x and y (2n,) of a body without load whose contact nodes are moved by u_T (m,)."""
        frames = self._frames_of(scene.boundary)
        return frames.cartesian(self._body(scene, frames)[0].extension(u_T))

    def load(self, scene: Scene) -> Array:
        """l_θ in x and y (2n,) [N/m]: mechanical and thermal loads, without prescribed displacements."""
        total = np.zeros(2 * self.mesh.n_points)
        for term in (*mechanical_terms(scene.f, scene.boundary), *self._thermal_terms(scene)):
            total += term.coefficient * self._basis_load(term.key)
        return total

    def _body(self, scene: Scene, frames: Frames) -> tuple[Elastic, float]:
        """The body of this λ/μ, factorised, and μ."""
        ratio, mu = _ratio_and_scale(scene.material)
        body = self._bodies.find(ratio)
        if body is None:
            self._bodies.clear()
            body = Elastic(self.elastic, frames, self.line, ratio, MEMORY, self._plan)
            self._plan = body.plan
            self._bodies.put(ratio, body)
        return body, mu

    def _thermal_terms(self, scene: Scene) -> list[Term]:
        """β∫θ tr ε(v): the uniform part through one vector, the rest through one for each temperature field."""
        beta = scene.material.beta
        if beta == 0.0:
            return []
        self.conduction.prepare()
        parts = self._theta_parts(scene)
        terms = [Term(("theta", name), beta * factor) for part in parts for name, factor in part.fields]
        uniform = sum(part.constant for part in parts)
        if uniform != 0.0:
            terms.append(Term(UNIFORM, beta * uniform))
        return terms

    def _load(self, body: Elastic, frames: Frames) -> Load:
        """How the basis loads of a body are made."""

        def local(key: Hashable) -> Array:
            assert isinstance(key, tuple)
            if key[:1] == PRESCRIBED:
                return -body.reaction(frames.values)
            return frames.local(self._basis_load(key))

        def together(key: Hashable) -> list[Hashable]:
            assert isinstance(key, tuple)
            if key[0] == "theta" and isinstance(key[1], Column):
                return [("theta", column) for column in self.conduction.together(key[1])]
            group = self._groups.get(key)
            return group if group is not None else [key]

        return Load(local, together)

    def _basis_load(self, key: Hashable) -> Array:
        """The load vector in x and y (2n,) that a key names."""
        assert isinstance(key, tuple)
        kind = key[0]
        if kind == "f":
            return self.elastic.body_force((key[2], 0.0) if key[1] == 0 else (0.0, key[2]))
        if key == UNIFORM:
            return self.elastic.thermal_load(np.ones(self.mesh.n_points))
        if kind == "theta":
            return self.elastic.thermal_load(self._field(key[1]))
        return self.elastic.traction(key[1], traction_of(kind, key[2]))
