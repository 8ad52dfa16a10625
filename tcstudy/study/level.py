"""One mesh level of a study: matrices once, a factorisation per material, a condensed problem per sweep point."""

from __future__ import annotations

import time
from collections.abc import Hashable
from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from tcstudy.condense import Condensation, ForwardLoad, condense
from tcstudy.fem.boundary import Frames, constrain, values_at
from tcstudy.fem.contact_line import ContactLine, contact_line
from tcstudy.fem.elasticity import ElasticForms
from tcstudy.fem.heat import HeatForms
from tcstudy.fem.meshes import PlaneMesh
from tcstudy.scene.expressions import Expression
from tcstudy.scene.records import Clamped, Contact, Convection, Role, Scene
from tcstudy.solve.problem import ContactProblem, least_eigenvalue
from tcstudy.study.cache import Recent
from tcstudy.study.loads import Term, mechanical_terms, split, traction_of
from tcstudy.study.thermal import Conduction, Part

Array = NDArray[np.float64]

MEMORY = 512e6
"""Bytes of basis loads, and again of temperatures, that a level keeps for reuse."""


@dataclass(frozen=True)
class Temperature:
    """θ of one scene: nodal values (n,) [K], its mean, and the relative defect of α∫(θ−θ̄) = ∫q (NaN if unused)."""

    theta: Array
    mean: float
    heat_balance: float


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


@dataclass
class _Basis:
    """One basis load: local rows (2n,), its forward elimination."""

    load: Array
    forward: ForwardLoad


class _Material:
    """Everything that depends on (lam, mu): the local stiffness, its condensation and condensed basis loads."""

    def __init__(self, stiffness: sp.csr_array, mesh: PlaneMesh, frames: Frames, line: ContactLine) -> None:
        self.stiffness = stiffness
        eliminate = ~frames.fixed
        eliminate[line.nodes] = False
        self.condensation: Condensation = condense(stiffness, mesh.points, line.nodes, eliminate, components=2)
        self.condensation.require_definite()
        self.lambda_1 = least_eigenvalue(self.condensation.A_tilde, line.c)
        self.basis: Recent[_Basis] = Recent(MEMORY, lambda b: b.load.nbytes + b.forward.rows.nbytes)
        self.products: dict[tuple[Hashable, Hashable], float] = {}

    def product(self, a: tuple[Hashable, _Basis], b: tuple[Hashable, _Basis]) -> float:
        """⟨l_a, A₂₂⁻¹ l_b⟩: the kept unknowns come last in the elimination, the rows before them are L⁻¹l₂."""
        key = (a[0], b[0])
        if key not in self.products:
            y_a, y_b = a[1].forward.rows, b[1].forward.rows
            inner = len(y_a) - self.condensation.m
            self.products[key] = self.products[key[::-1]] = float(y_a[:inner, 0] @ y_b[:inner, 0])
        return self.products[key]


def _held(boundary: tuple[tuple[str, Role], ...]) -> tuple[tuple[str, Role], ...]:
    """The part of the boundary that constrains displacements, as a key."""
    return tuple(item for item in boundary if isinstance(item[1], Clamped | Contact))


class Level:
    """All scenes of a study on one mesh. Caches are keyed by value: equal inputs are computed once."""

    def __init__(self, mesh: PlaneMesh, scene: Scene) -> None:
        """mesh: one level;  scene: any scene of the study (body and roles are the same in all of them)."""
        start = time.perf_counter()
        self.mesh = mesh
        self.elastic = ElasticForms(mesh)
        self.heat = HeatForms(mesh, scene.edges(Convection))
        self.conduction = Conduction(self.heat)
        self._frames: dict[Hashable, Frames] = {}
        self._materials: Recent[_Material] = Recent(1, lambda _: 1)  # one factor at a time: they are large
        self._temperatures: Recent[Part] = Recent(MEMORY, lambda part: part.variation.nbytes)
        self.frames = self._frames_of(scene.boundary)
        self.line = contact_line(mesh, self.frames, scene.edges(Contact))
        self.elastic.stiffness(1.0, 1.0)
        self.time_assemble = time.perf_counter() - start

    # -- displacement constraints ------------------------------------------------------------------

    def _frames_of(self, boundary: tuple[tuple[str, Role], ...]) -> Frames:
        key = _held(boundary)
        if key not in self._frames:
            self._frames[key] = constrain(self.mesh, key)
        return self._frames[key]

    # -- temperature -------------------------------------------------------------------------------

    def _theta_terms(self, scene: Scene) -> list[tuple[Hashable, float]]:
        """The temperature as (key, factor) of parts; nothing is solved for what is constant or unused."""
        heat = scene.heat
        if heat.theta is not None:
            return [(("known", *split(heat.theta)[:1]), split(heat.theta)[1])]
        assert heat.alpha is not None
        if not scene.edges(Convection):
            return []
        k = scene.material.k
        terms: list[tuple[Hashable, float]] = []
        if isinstance(heat.theta_bar, Expression):
            terms.append((("theta_bar", heat.theta_bar, heat.alpha, k), 1.0))
        elif heat.theta_bar != 0.0:
            terms.append((("known", 1.0), float(heat.theta_bar)))
        shape, factor = split(heat.q)
        if factor != 0.0:
            terms.append((("q", shape, heat.omega, heat.alpha, k), factor))
        return terms

    def _part(self, key: Hashable) -> Part:
        """One basis part of θ, for unit data."""
        return self._temperatures.get(key, lambda: self._new_part(key))

    def _new_part(self, key: Hashable) -> Part:
        assert isinstance(key, tuple)
        kind, shape = key[0], key[1]
        if kind == "known":
            return self._known(shape)
        if kind == "theta_bar":
            return self.conduction.surroundings(shape, key[2], key[3])
        return self.conduction.source(shape, key[2], key[3], key[4])

    def _known(self, shape: float | Expression) -> Part:
        if isinstance(shape, Expression):
            return Part(0.0, values_at(shape, self.mesh.points), 0.0)
        return Part(float(shape), np.zeros(self.mesh.n_points), 0.0)

    def temperature(self, scene: Scene) -> Temperature:
        """θ of a scene with its mean and heat balance; zero where the scene has no heat."""
        theta = np.zeros(self.mesh.n_points)
        out = 0.0
        for key, factor in self._theta_terms(scene):
            part = self._part(key)
            theta += factor * (part.constant + part.variation)
            out += factor * part.heat_out
        area = self.heat.nodal_area
        balance = float("nan")
        shape, factor = split(scene.heat.q)
        if scene.heat.theta is None and scene.edges(Convection) and factor != 0.0:
            heat_in = factor * self.conduction.heat_in(shape, scene.heat.omega)
            balance = abs(out - heat_in) / abs(heat_in) if heat_in else abs(out)
        return Temperature(theta, float(area @ theta) / float(area.sum()), balance)

    # -- the condensed problem ---------------------------------------------------------------------

    def condensed(self, scene: Scene) -> Condensed:
        """Ã, l̃ and c of a scene, eq. (20); factors and basis loads are reused by value.

        Raises NotPositiveDefinite if the body is not held or the material is not elastic.
        """
        start = time.perf_counter()
        frames = self._frames_of(scene.boundary)
        material = self._material(scene, frames)
        terms = list(mechanical_terms(scene))
        terms += self._thermal_terms(scene)
        if np.any(frames.values):
            terms.append(Term(("prescribed", _held(scene.boundary)), 1.0))
        bases = [self._basis(material, term.key, frames) for term in terms]
        l_tilde = np.zeros(self.line.m)
        for term, basis in zip(terms, bases, strict=True):
            l_tilde += term.coefficient * basis.forward.l_tilde
        constant = _constant(material, terms, bases, frames)
        problem = ContactProblem(material.condensation.A_tilde, l_tilde, self.line.c, scene.friction)
        return Condensed(problem, constant, tuple(terms), time.perf_counter() - start)

    def lambda_1(self, scene: Scene) -> float:
        """λ₁ of the body on this mesh (method §5) [Pa/m], once per material."""
        return self._material(scene, self._frames_of(scene.boundary)).lambda_1

    def displacement(self, scene: Scene, condensed: Condensed, u_T: Array) -> Array:
        """The whole displacement in x and y (2n,) from the contact solution, eq. (20)."""
        frames = self._frames_of(scene.boundary)
        material = self._material(scene, frames)
        w = material.condensation.expand(u_T, self._total(material, condensed.terms, frames))
        return frames.cartesian(w + frames.values)

    def load(self, scene: Scene) -> Array:
        """l_θ in x and y (2n,) [N/m]: mechanical and thermal loads, without prescribed displacements."""
        frames = self._frames_of(scene.boundary)
        material = self._material(scene, frames)
        terms = (*mechanical_terms(scene), *self._thermal_terms(scene))
        return frames.cartesian(self._total(material, terms, frames))

    def _material(self, scene: Scene, frames: Frames) -> _Material:
        key = (scene.material.lam, scene.material.mu)

        def make() -> _Material:
            R = frames.rotation
            local = sp.csr_array(R.T @ self.elastic.stiffness(*key) @ R)
            return _Material(local, self.mesh, frames, self.line)

        return self._materials.get(key, make)

    def _thermal_terms(self, scene: Scene) -> list[Term]:
        """β B θ: the uniform part through B1, the rest through one vector per temperature shape."""
        beta = scene.material.beta
        if beta == 0.0:
            return []
        uniform, terms = 0.0, []
        for key, factor in self._theta_terms(scene):
            part = self._part(key)
            uniform += factor * part.constant
            if np.any(part.variation):
                terms.append(Term(("theta", key), beta * factor))
        if uniform != 0.0:
            terms.append(Term(("uniform",), beta * uniform))
        return terms

    def _basis(self, material: _Material, key: Hashable, frames: Frames) -> _Basis:
        def make() -> _Basis:
            load = self._basis_load(material, key, frames)
            return _Basis(load, material.condensation.forward(load))

        return material.basis.get(key, make)

    def _basis_load(self, material: _Material, key: Hashable, frames: Frames) -> Array:
        """The local load vector (2n,) that a key names."""
        assert isinstance(key, tuple)
        kind = key[0]
        if kind == "prescribed":
            return -(material.stiffness @ frames.values)
        if kind == "f":
            f = (key[2], 0.0) if key[1] == 0 else (0.0, key[2])
            load = self.elastic.body_force(f)
        elif kind == "uniform":
            load = self.elastic.thermal_coupling @ np.ones(self.mesh.n_points)
        elif kind == "theta":
            load = self.elastic.thermal_coupling @ self._part(key[1]).variation
        else:
            load = self.elastic.traction(key[1], traction_of(kind, key[2]))
        return frames.local(load)

    def _total(self, material: _Material, terms: tuple[Term, ...], frames: Frames) -> Array:
        total = np.zeros(2 * self.mesh.n_points)
        for term in terms:
            total += term.coefficient * self._basis(material, term.key, frames).load
        return total


def _constant(material: _Material, terms: list[Term], bases: list[_Basis], frames: Frames) -> float:
    """L_θ(u) − L̃(u₁) = −½⟨l₂, A₂₂⁻¹l₂⟩ + ½⟨w_D, A w_D⟩ − ⟨l, w_D⟩ with w_D the prescribed part."""
    value = 0.0
    pairs = list(zip(terms, bases, strict=True))
    for a, a_basis in pairs:
        for b, b_basis in pairs:
            product = material.product((a.key, a_basis), (b.key, b_basis))
            value -= 0.5 * a.coefficient * b.coefficient * product
    if np.any(frames.values):
        w_D = frames.values
        value += 0.5 * float(w_D @ (material.stiffness @ w_D))
        for term, basis in pairs:
            if isinstance(term.key, tuple) and term.key[0] != "prescribed":
                value -= term.coefficient * float(basis.load @ w_D)
    return value
