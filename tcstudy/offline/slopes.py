"""Derivatives of a condensed problem by one number p of its scene.

They are those of its load and body, and those of its friction.

Of the whole body's problem A(p) u = l(p), with û the displacement at a solution, prescribed part
w_D included, and E the extension of contact nodes,

    r = ∂l̃/∂p − (∂Ã/∂p) v = Eᵀ(∂l/∂p − (∂A/∂p) û − A ∂w_D/∂p)           one forward elimination
    ∂(energy)/∂p = ½ ûᵀ(∂A/∂p)û − (∂l/∂p)ᵀû + (Aû − l)ᵀ ∂w_D/∂p         envelope theorem, and the
                                                                         law's part of friction
    ∂λ₁/∂p = x̂ᵀ(∂A/∂p)x̂ / xᵀCx,   x̂ = E x, x the eigenvector

exactly, for E, ν, alpha_T, beta and k of the body or of a region, stiffness of springs, α of edges
(the heat problem solved once more with what the change puts in: −∫_e (θ − θ̄)φ, −∫_ω ∇θ·∇φ), and
all in which the load is affine: the derivative is then the load of the scene with p = 1 and nothing
else. Numbers of a law, or its strength, change b and its kinks by the numbers that the law is made
of (`laws.composed`).

Left out: the geometry, which moves the mesh.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import scipy.linalg
from numpy.typing import NDArray

from tcstudy.contact.solution import Linearised
from tcstudy.fem.forms import ContactLine, Moduli, Springs
from tcstudy.fem.openings import OpeningLine
from tcstudy.laws.composed import EdgeLaws, agreed, derivative, law_slopes, number_of, stepped
from tcstudy.laws.laws import Laws
from tcstudy.offline.level import Level, loaded_by
from tcstudy.scene.fit_plan import Sensitivity
from tcstudy.scene.keys import LAWS, parameter_names
from tcstudy.scene.parameters import FACTORED, path_scene
from tcstudy.scene.records import Scene, exchanges

Array = NDArray[np.float64]
Index = NDArray[np.intp]


@dataclass(frozen=True, eq=False)
class Change:
    """Derivatives of the load and of the stiffness of the whole body by a number p.

    load: (2n,) ∂l/∂p in x and y;  held: (2n,) ∂w_D/∂p in local rows
    moduli, springs: of ∂A/∂p;  theta_mean: ∂(mean θ)/∂p
    """

    load: Array
    held: Array
    moduli: Moduli = ()
    springs: Springs = ()
    theta_mean: float = 0.0


def is_load(path: tuple[str, ...]) -> bool:
    """Return whether a number changes the load alone, which is affine in it."""
    if path[-1] == "alpha" or path[-2:-1] == ("spring",):
        return False
    return path[0] in ("load", "loads", "heat", "boundary")


def change_of(level: Level, scene: Scene, by: Sensitivity) -> Change:
    """Return ∂A/∂p, ∂l/∂p and ∂w_D/∂p, all zero for a number of a law.

    Raises KeyError for a number that the scene does not have.
    """
    path = by.path
    none = np.zeros(2 * level.mesh.n_points)
    if path[0] in (*LAWS, "history"):
        return Change(none, none)
    if path[0] in ("material", "materials"):
        return _material_change(level, scene, path)
    if path[-2:-1] == ("spring",):
        stiffness = (path[1], float(path[-1] == "normal"), float(path[-1] == "tangential"))
        return Change(none, none, springs=(stiffness,))
    if path[-1] == "alpha":
        edges: tuple[str, ...] = (path[1],)
        if path[0] != "boundary":
            edges = _edges_without_alpha(scene)
        load, mean = _heated(level, scene, level.temperatures.exchanged(scene, edges))
        return Change(load, none, theta_mean=mean)
    factor = scene.load if path[-1] in FACTORED else 1.0
    unscaled = loaded_by(scene.unscaled or scene, loads=True)
    linear = unscaled if path == ("load",) else path_scene(loaded_by(scene), path, factor)
    mean = 0.0
    if path[0] == "heat" or linear.heat_by_edge:
        mean = level.temperature(linear).mean if scene.material.expands else float("nan")
    return Change(level.load(linear), level.frames_of(linear.boundary).values, theta_mean=mean)


def _material_change(level: Level, scene: Scene, path: tuple[str, ...]) -> Change:
    """Return the change by a number of the body's material, or of that of a region."""
    region = path[1:2]
    name = path[-1]
    where, material = scene.pieces[0]
    if path[0] == "materials":
        where, material = next(piece for piece in scene.pieces if piece[0] == region)
    stepped_material = material.with_number(stepped(getattr(material, name)), name)
    lam, mu, beta, k = (
        derivative(getattr(stepped_material, symbol)) for symbol in ("lam", "mu", "beta", "k")
    )
    none = np.zeros(2 * level.mesh.n_points)
    load = none
    mean = 0.0
    if beta:
        load = beta * level.elastic.expansion(level.temperature(scene).theta, where)
    if k and scene.heat.theta is None and scene.conducts:
        conduction = level.elastic.conduction(((where, 1.0),))
        heated_load, mean = _heated(level, scene, -(conduction @ level.temperature(scene).theta))
        load = load + heated_load
    moduli = ((where, lam, mu),) if lam or mu else ()
    return Change(load, none, moduli, theta_mean=mean)


def _heated(level: Level, scene: Scene, heat: Array) -> tuple[Array, float]:
    """Return the load and the mean of the temperature that heat at the nodes (n,) causes."""
    theta = level.temperatures.response(scene, heat)
    load = np.zeros(2 * level.mesh.n_points)
    for where, material in scene.pieces:
        if material.beta != 0.0:
            load = load + material.beta * level.elastic.expansion(theta, where)
    return load, level.temperatures.mean_of(theta)


def _edges_without_alpha(scene: Scene) -> tuple[str, ...]:
    """Return the edges that exchange heat with the α of the section `heat`."""
    return tuple(
        edge
        for edge, role in scene.boundary
        if exchanges(role) and not (role.heat and role.heat.alpha)
    )


@dataclass(frozen=True)
class WholeBody:
    """A scene on a level at a solution v (m,) of its contact problem."""

    level: Level
    scene: Scene
    v: Array

    @cached_property
    def u(self) -> Array:
        """Return the displacement (2n,) in x and y."""
        return self.level.displacement(self.scene, self.v)

    def right_side(self, change: Change) -> Array:
        """Return ∂l̃/∂p − (∂Ã/∂p) v (m,)."""
        level = self.level
        load = change.load
        if change.moduli or change.springs:
            load = load - self._times(change, self.u)
        if np.any(change.held):
            load = load - level.stiffness_times(self.scene, level.frames.cartesian(change.held))
        if not np.any(load):
            return np.zeros(level.m)
        return level.condensed_of(self.scene, load)

    def energy(self, change: Change) -> float:
        """Return ∂/∂p of the energy without friction at constant v [J/m per unit of p]."""
        u = self.u
        slope = 0.5 * float(u @ self._times(change, u)) - float(change.load @ u)
        if np.any(change.held):
            slope += float(self._reaction @ change.held)
        return slope

    @cached_property
    def _reaction(self) -> Array:
        """Return Aû − l (2n,) in local rows."""
        return self.level.frames.local(self.level.reactions(self.scene, self.u))

    def lambda_1(self, change: Change) -> float:
        """Return ∂λ₁/∂p, NaN where λ₁ is a double eigenvalue."""
        if not change.moduli and not change.springs:
            return 0.0
        (first, second), x = self._least
        if second - first <= 1e-9 * second:
            return float("nan")
        moved = self.level.extension(self.scene, x)
        return float(moved @ self._times(change, moved))

    @cached_property
    def _least(self) -> tuple[Array, Array]:
        """Return λ₁ with the next eigenvalue, and the eigenvector x (m,) with xᵀCx = 1."""
        problem = self.level.condensed(self.scene).problem
        last_index = min(1, problem.m - 1)
        values, vectors = scipy.linalg.eigh(
            problem.A_tilde, np.diag(problem.c), subset_by_index=[0, last_index]
        )
        return np.append(values, np.inf)[:2], vectors[:, 0]

    def _times(self, change: Change, u: Array) -> Array:
        """Return (∂A/∂p) u (2n,) in x and y."""
        return self.level.forces(u, change.moduli, change.springs)


@dataclass(frozen=True, eq=False)
class FrictionSlopes:
    """Derivatives of friction and adhesion by a number, at a solution v; 0 unless a law has it.

    b:      (m,) ∂b/∂p
    kinks:  (m,) derivatives of the kinks at which nodes stick
    energy: derivative of Σ c_i j_i, with that of nodes that stick at a moving kink [J/m per unit of
            p]
    omega:  derivative of the largest ω; NaN at a down-jump, where laws of equal ω do not agree, and
            where the law of a joint alone has it
    """

    b: Array
    kinks: Array
    energy: float = 0.0
    omega: float = 0.0


def friction_slopes(
    level: Level, scene: Scene, by: Sensitivity, solution: Linearised
) -> FrictionSlopes:
    """Return the derivatives of friction and adhesion by a number at a solution.

    A node that sticks at a kink has v = κ(p): with b on the inner side of κ, its energy changes by
    c (∂j/∂p + b κ′) − ξ κ′.
    Raises KeyError where no law has the parameter.
    """
    c = solution.problem.c
    b = np.zeros(len(solution.v))
    kinks = np.zeros(len(solution.v))
    energy = 0.0
    if by.path[0] not in LAWS:
        return FrictionSlopes(b, kinks)
    softening: list[tuple[float, float]] = []  # ω of each law and its derivative
    for law, nodes, strength, share, has_parameter in _laws(level, scene, by.path):
        largest_factor = float(np.max(strength, initial=0.0))
        omega_slope = 0.0
        if has_parameter:
            slopes = law_slopes(law, _name_in_shape(law, by.path))
            s = solution.v[nodes]
            # the strength of a one-sided law is of openings alone
            factor = strength if law.closing is None else np.where(s < 0.0, share, strength)
            b[nodes] += factor * slopes.value(s, law.piece(s))
            if len(law.kinks):
                kink_slopes = slopes.kinks[law.nearest_kink(s)]
                kinks[nodes] += np.where(law.locate(s).on, kink_slopes, 0.0)
            energy += float(np.sum(c[nodes] * factor * slopes.potential(s)))
            omega_slope = largest_factor * slopes.omega()
        softening.append((largest_factor * law.omega if law.omega else 0.0, omega_slope))
    if np.any(kinks[solution.stuck]):
        v = solution.v
        law = solution.problem.law
        inner = np.where(v > 0.0, *law.limits(law.nearest_kink(v)))
        change = (c * inner - solution.problem.xi(v)) * kinks
        energy += float(change[solution.stuck].sum())
    largest = max(omega for omega, _ in softening)
    if not np.isfinite(largest) or abs(largest - level.law(scene).omega) > 1e-9 * largest:
        return FrictionSlopes(b, kinks, energy, float("nan"))
    slopes_of_largest = [slope for omega, slope in softening if omega >= largest * (1.0 - 1e-9)]
    return FrictionSlopes(b, kinks, energy, agreed(np.array(slopes_of_largest)))


def _name_in_shape(law: Laws, path: tuple[str, ...]) -> str:
    """Return the name that the shape of a law has for the number at a key path."""
    name = number_of(path)
    if law.made is None:
        raise KeyError(name)
    return parameter_names(law.made.shape, path[0]).get(name, name)


_Law = tuple[Laws, Index, Array, Array, bool]
"""A law, its nodes, its factor there with and without strength, whether it has the parameter."""


def _laws(level: Level, scene: Scene, path: tuple[str, ...]) -> Iterator[_Law]:
    """Yield the laws of the slips, and of the openings where the level has some."""
    yield from _laws_along(level.line, scene.friction, path if path[0] == "friction" else ())
    if level.opening is None:
        return
    places = path if path[0] == "adhesion" else ()
    if places and _is_of_all(scene.adhesion):
        places = (*places, *scene.adhesive_edges)
    of_openings = _laws_along(level.opening, scene.opening_laws, places)
    for law, nodes, strength, share, has_parameter in of_openings:
        yield law, level.line.m + nodes, strength, share, has_parameter


def _is_of_all(laws: Laws | EdgeLaws | None) -> bool:
    """Return whether one law is that of every edge."""
    return not isinstance(laws, EdgeLaws) or any(not edge for edge, _, _ in laws.laws)


def _laws_along(
    line: ContactLine | OpeningLine, laws: Laws | EdgeLaws, path: tuple[str, ...]
) -> Iterator[_Law]:
    """Yield the laws of a line. path: of the parameter, () where it is no number of these laws."""
    if isinstance(laws, Laws):
        nodes = np.arange(line.m, dtype=np.intp)
        ones = np.ones(line.m)
        yield laws, nodes, ones, ones, bool(path)
        return
    places = line.edge_names, line.edge, line.xy, line.joints
    factors = laws.factors(*places)
    of_full_strength = tuple((edge, law, 1.0) for edge, law, _ in laws.laws)
    shares = EdgeLaws(of_full_strength).factors(*places)
    for (edge, law, _), factor, share in zip(laws.laws, factors, shares, strict=True):
        nodes = np.flatnonzero(~np.isnan(factor))
        has_parameter = bool(path) and edge in ("", *path)
        yield law, nodes, factor[nodes], share[nodes], has_parameter
