"""Derivatives of a condensed problem by one number p of its scene: of its load and body, and of its
friction.

Of the whole body's problem A(p) u = l(p), with û the displacement at a solution, prescribed part
w_D included, and E the extension of contact nodes,

    r = ∂l̃/∂p − (∂Ã/∂p) v = Eᵀ(∂l/∂p − (∂A/∂p) û − A ∂w_D/∂p)           one forward elimination
    ∂(energy)/∂p = ½ ûᵀ(∂A/∂p)û − (∂l/∂p)ᵀû + (Aû − l)ᵀ ∂w_D/∂p         envelope theorem; friction's part is the law's
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
from tcstudy.fem.forms import Moduli, Springs
from tcstudy.laws.composed import agreed, derivative, law_slopes, number_of, stepped
from tcstudy.laws.laws import Laws
from tcstudy.offline.level import Level, loaded_by
from tcstudy.scene.fit_plan import Sensitivity
from tcstudy.scene.parameters import FACTORED, path_scene
from tcstudy.scene.records import Scene, exchanges

Array = NDArray[np.float64]
Index = NDArray[np.intp]


@dataclass(frozen=True, eq=False)
class Change:
    """What a number changes of the whole body.

    load: (2n,) ∂l/∂p in x and y;  held: (2n,) ∂w_D/∂p in local rows
    moduli, springs: of ∂A/∂p;  theta_mean: ∂(mean θ)/∂p
    """

    load: Array
    held: Array
    moduli: Moduli = ()
    springs: Springs = ()
    theta_mean: float = 0.0


def is_load(path: tuple[str, ...]) -> bool:
    """Whether it is the load alone that a number changes, and is affine in it."""
    return (
        path[0] in ("load", "loads", "heat", "boundary")
        and path[-1] != "alpha"
        and path[-2:-1] != ("spring",)
    )


def change_of(level: Level, scene: Scene, by: Sensitivity) -> Change:
    """∂A/∂p, ∂l/∂p and ∂w_D/∂p; none for a number of a law. Raises KeyError for a number that there
    is not."""
    path, none = by.path, np.zeros(2 * level.mesh.n_points)
    load, mean, heat = none, 0.0, level.temperatures

    def heated(put_in: Array) -> tuple[Array, float]:
        """The load and the mean of the temperature that heat at the nodes (n,) makes."""
        theta = heat.response(scene, put_in)
        loads = (
            own.beta * level.elastic.expansion(theta, where)
            for where, own in scene.pieces
            if own.beta != 0.0
        )
        return np.asarray(sum(loads, none)), heat.mean_of(theta)

    if path[0] in ("friction", "history"):
        return Change(none, none)
    if path[0] in ("material", "materials"):
        where, own = next(
            one for one in scene.pieces if path[0] == "material" or one[0] == (path[1],)
        )
        one = own.with_number(stepped(getattr(own, path[-1])), path[-1])
        lam, mu, beta, k = map(derivative, (one.lam, one.mu, one.beta, one.k))
        if beta:
            load = beta * level.elastic.expansion(level.temperature(scene).theta, where)
        if k and scene.heat.theta is None and scene.conducts:
            more, mean = heated(
                -(level.elastic.conduction(((where, 1.0),)) @ level.temperature(scene).theta)
            )
            load = load + more
        return Change(load, none, ((where, lam, mu),) if lam or mu else (), (), mean)
    if path[-2:-1] == ("spring",):
        return Change(
            none,
            none,
            (),
            ((path[1], float(path[-1] == "normal"), float(path[-1] == "tangential")),),
        )
    if path[-1] == "alpha":
        # of one edge, or of all without an α of their own
        others = (
            name
            for name, role in scene.boundary
            if exchanges(role) and not (role.heat and role.heat.alpha)
        )
        load, mean = heated(
            heat.exchanged(scene, (path[1],) if path[0] == "boundary" else tuple(others))
        )
        return Change(load, none, theta_mean=mean)
    factor = scene.load if path[-1] in FACTORED else 1.0
    whole = loaded_by(scene.unscaled or scene, loads=True)
    linear = whole if path == ("load",) else path_scene(loaded_by(scene), path, factor)
    if path[0] == "heat" or linear.heat_by_edge:
        mean = level.temperature(linear).mean if scene.material.expands else float("nan")
    return Change(level.load(linear), level.frames_of(linear.boundary).values, theta_mean=mean)


@dataclass(frozen=True)
class WholeBody:
    """A scene on a level at a solution v (m,) of its contact problem."""

    level: Level
    scene: Scene
    v: Array

    @cached_property
    def u(self) -> Array:
        """(2n,) the displacement in x and y."""
        return self.level.displacement(self.scene, self.v)

    def right_side(self, change: Change) -> Array:
        """(m,) ∂l̃/∂p − (∂Ã/∂p) v."""
        level, load = self.level, change.load
        if change.moduli or change.springs:
            load = load - self._times(change, self.u)
        if np.any(change.held):
            load = load - level.stiffness_times(self.scene, level.frames.cartesian(change.held))
        return level.condensed_of(self.scene, load) if np.any(load) else np.zeros(level.line.m)

    def energy(self, change: Change) -> float:
        """∂/∂p of the energy but for that of friction, v being kept [J/m per unit of p]."""
        u = self.u
        found = 0.5 * float(u @ self._times(change, u)) - float(change.load @ u)
        if np.any(change.held):
            found += float(self._reaction @ change.held)
        return found

    @cached_property
    def _reaction(self) -> Array:
        """(2n,) Aû − l in local rows."""
        return self.level.frames.local(self.level.reactions(self.scene, self.u))

    def lambda_1(self, change: Change) -> float:
        """∂λ₁/∂p; NaN where λ₁ is a double eigenvalue."""
        if not change.moduli and not change.springs:
            return 0.0
        (first, second), x = self._least
        if second - first <= 1e-9 * second:
            return float("nan")
        moved = self.level.extension(self.scene, x)
        return float(moved @ self._times(change, moved))

    @cached_property
    def _least(self) -> tuple[Array, Array]:
        """λ₁ and the next eigenvalue, and the eigenvector x (m,) with xᵀCx = 1."""
        problem = self.level.condensed(self.scene).problem
        last = min(1, problem.m - 1)
        values, vectors = scipy.linalg.eigh(
            problem.A_tilde, np.diag(problem.c), subset_by_index=[0, last]
        )
        return np.append(values, np.inf)[:2], vectors[:, 0]

    def _times(self, change: Change, u: Array) -> Array:
        """(∂A/∂p) u, (2n,) in x and y."""
        return self.level.forces(u, change.moduli, change.springs)


@dataclass(frozen=True, eq=False)
class FrictionSlopes:
    """Derivatives of friction by a number at the slips v of a solution; 0 where it is no number of
    a law.

    b:      (m,) ∂b/∂p;  kinks: (m,) of those on which nodes rest
    energy: of Σ c_i j_i, and of what nodes that rest on a moving kink do [J/m per unit of p]
    omega:  of the law that falls most; NaN at a down-jump, where several fall as much and do not agree, and where that
            is the law of a joint alone
    """

    b: Array
    kinks: Array
    energy: float = 0.0
    omega: float = 0.0


def friction_slopes(level: Level, scene: Scene, by: Sensitivity, at: Linearised) -> FrictionSlopes:
    """Of a node that rests on a kink, v = κ(p): with b on the inner side of κ its energy has c
    (∂j/∂p + b κ′) − ξ κ′.

    Raises KeyError where no law has the parameter.
    """
    b, kinks, energy, c = np.zeros(len(at.v)), np.zeros(len(at.v)), 0.0, at.problem.c
    if by.path[0] != "friction":
        return FrictionSlopes(b, kinks)
    falls: list[tuple[float, float]] = []
    for law, nodes, factor, named in _laws(level, scene, by.path):
        most, change = float(np.max(factor, initial=0.0)), 0.0
        if named:
            slopes, s = law_slopes(law, number_of(by.path)), at.v[nodes]
            b[nodes] += factor * slopes.value(s, law.piece(s))
            if len(law.kinks):
                kinks[nodes] += np.where(law.locate(s).on, slopes.kinks[law.nearest_kink(s)], 0.0)
            energy += float(np.sum(c[nodes] * factor * slopes.potential(s)))
            change = most * slopes.omega()
        falls.append((most * law.omega if law.omega else 0.0, change))
    if np.any(kinks[at.rest]):
        law = at.problem.law
        inner = np.where(at.v > 0.0, *law.limits(law.nearest_kink(at.v)))
        energy += float(((c * inner - at.problem.xi(at.v)) * kinks)[at.rest].sum())
    largest = max(fall for fall, _ in falls)
    if not np.isfinite(largest) or abs(largest - level.law(scene).omega) > 1e-9 * largest:
        return FrictionSlopes(b, kinks, energy, float("nan"))
    found = np.array([change for fall, change in falls if fall >= largest * (1.0 - 1e-9)])
    return FrictionSlopes(b, kinks, energy, agreed(found))


def _laws(
    level: Level, scene: Scene, path: tuple[str, ...]
) -> Iterator[tuple[Laws, Index, Array, bool]]:
    """(law, its nodes, its factor in their laws, whether the parameter belongs to it)."""
    friction, line = scene.friction, level.line
    if isinstance(friction, Laws):
        yield friction, np.arange(line.m, dtype=np.intp), np.ones(line.m), True
        return
    factors = friction.factors(line.edge_names, line.edge, line.xy, line.joints)
    for (edge, law, _), factor in zip(friction.laws, factors, strict=True):
        nodes = np.flatnonzero(~np.isnan(factor))
        yield law, nodes, factor[nodes], edge in ("", *path)
