"""Derivatives of a condensed problem by one number p of its scene: of its load and body, and of its friction.

Of the whole body's problem A(p) u = l(p), with û the displacement at a solution, prescribed part w_D included, and E
the extension of contact nodes,

    r = ∂l̃/∂p − (∂Ã/∂p) v = Eᵀ(∂l/∂p − (∂A/∂p) û − A ∂w_D/∂p)           one forward elimination
    ∂(energy)/∂p = ½ ûᵀ(∂A/∂p)û − (∂l/∂p)ᵀû + (Aû − l)ᵀ ∂w_D/∂p         envelope theorem; friction's part is the law's
    ∂λ₁/∂p = x̂ᵀ(∂A/∂p)x̂ / xᵀCx,   x̂ = E x, x the eigenvector

exactly, for E, ν, alpha_T, beta and k of the body or of a region, stiffness of springs, α of edges (the heat problem
solved once more with what the change puts in: −∫_e (θ − θ̄)φ, −∫_ω ∇θ·∇φ), and all in which the load is affine: the
derivative is then the load of the scene with p = 1 and nothing else. Numbers of a law, or its strength, change b and
its kinks by the numbers that the law is made of (`laws.derivatives`).

Left out: the geometry, which moves the mesh.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import scipy.linalg
from numpy.typing import NDArray

from tcstudy.contact.linearised import Linearised
from tcstudy.fem.forms import Moduli, Springs
from tcstudy.laws.derivatives import agreed, law_slopes, number_of
from tcstudy.laws.dual import Dual, slope_of
from tcstudy.laws.laws import Laws
from tcstudy.offline.level import Level
from tcstudy.offline.loads import loaded_by
from tcstudy.scene.fits import Sensitivity
from tcstudy.scene.parameters import path_scene
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
    return path[0] in ("load", "loads", "heat", "boundary") and path[-1] != "alpha" and path[-2:-1] != ("spring",)


def change_of(level: Level, scene: Scene, by: Sensitivity) -> Change:
    """∂A/∂p, ∂l/∂p and ∂w_D/∂p; none for a number of a law. Raises KeyError for a number that there is not."""
    path, none = by.path, np.zeros(2 * level.mesh.n_points)
    load, mean, heat = none, 0.0, level.temperatures

    def heated(put_in: Array) -> tuple[Array, float]:
        """The load and the mean of the temperature that heat at the nodes (n,) makes."""
        theta = heat.response(scene, put_in)
        loads = (own.beta * level.elastic.expansion(theta, where) for where, own in scene.pieces if own.beta != 0.0)
        return np.asarray(sum(loads, none)), heat.mean_of(theta)

    if path[0] in ("friction", "history"):
        return Change(none, none)
    if path[0] in ("material", "materials"):
        where, own = next(one for one in scene.pieces if path[0] == "material" or one[0] == (path[1],))
        one = own.with_number(path[-1], Dual(getattr(own, path[-1]), 1.0))
        lam, mu, beta, k = map(slope_of, (one.lam, one.mu, one.beta, one.k))
        if beta:
            load = beta * level.elastic.expansion(level.temperature(scene).theta, where)
        if k and scene.heat.theta is None and scene.conducts:
            more, mean = heated(-(level.elastic.conduction(((where, 1.0),)) @ level.temperature(scene).theta))
            load = load + more
        return Change(load, none, ((where, lam, mu),) if lam or mu else (), (), mean)
    if path[-2:-1] == ("spring",):
        return Change(none, none, (), ((path[1], float(path[-1] == "normal"), float(path[-1] == "tangential")),))
    if path[-1] == "alpha":
        # of one edge, or of all without an α of their own
        others = (name for name, role in scene.boundary if exchanges(role) and not (role.heat and role.heat.alpha))
        load, mean = heated(heat.exchanged(scene, (path[1],) if path[0] == "boundary" else tuple(others)))
        return Change(load, none, theta_mean=mean)
    linear = loaded_by(scene, loads=True) if path == ("load",) else path_scene(loaded_by(scene), path, 1.0)
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
        return self.level.displacement(self.scene, self.level.condensed(self.scene), self.v)

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
        values, vectors = scipy.linalg.eigh(problem.A_tilde, np.diag(problem.c), subset_by_index=[0, last])
        return np.append(values, np.inf)[:2], vectors[:, 0]

    def _times(self, change: Change, u: Array) -> Array:
        """(∂A/∂p) u, (2n,) in x and y."""
        return self.level.forces(u, change.moduli, change.springs)


def law_slope(level: Level, scene: Scene, by: Sensitivity, at: Linearised) -> tuple[Array, Array]:
    """(m,) ∂b/∂p at the slips of a solution, and of the kinks on which nodes rest; 0 where p is no number of the law.

    Raises KeyError where no law has the parameter.
    """
    b, kinks = np.zeros(len(at.v)), np.zeros(len(at.v))
    if by.path[0] != "friction":
        return b, kinks
    for law, nodes, factor in _laws(level, scene, by.path):
        slopes, s = law_slopes(law, number_of(by.path)), at.v[nodes]
        b[nodes] += factor * slopes.value(s, law.piece(s))
        if len(law.kinks):
            kinks[nodes] += np.where(law.locate(s).on, slopes.kinks[law.nearest_kink(s)], 0.0)
    return b, kinks


def friction_energy(level: Level, scene: Scene, by: Sensitivity, at: Linearised) -> float:
    """∂/∂p of Σ c_i j_i at the slips of a solution, and of what nodes that rest on a moving kink do [J/m per unit].

    Of such a node v = κ(p): with b on the inner side of κ, c (∂j/∂p + b κ′) − ξ κ′.
    """
    if by.path[0] != "friction":
        return 0.0
    found, c, law = 0.0, at.problem.c, at.problem.law
    for own, nodes, factor in _laws(level, scene, by.path):
        slopes = law_slopes(own, number_of(by.path))
        found += float(np.sum(c[nodes] * factor * slopes.potential(at.v[nodes])))
    kinks = law_slope(level, scene, by, at)[1]
    if np.any(kinks[at.rest]):
        left, right = law.limits(law.nearest_kink(at.v))
        inner = np.where(at.v > 0.0, left, right)
        found += float(((c * inner - at.problem.xi(at.v)) * kinks)[at.rest].sum())
    return found


def omega_slope(level: Level, scene: Scene, by: Sensitivity) -> float:
    """∂ω/∂p of the law that falls most; NaN at a down-jump, where several fall as much and do not agree, and where that
    is the law of a joint alone."""
    if by.path[0] != "friction":
        return 0.0
    every = _laws(level, scene, ())
    falls = [float(np.max(factor, initial=0.0)) * law.omega if law.omega else 0.0 for law, _, factor in every]
    named = [law for law, _, _ in _laws(level, scene, by.path)]
    largest, found = max(falls), []
    if not np.isfinite(largest) or abs(largest - level.law(scene).omega) > 1e-9 * largest:
        return float("nan")
    for (law, _, factor), fall in zip(every, falls, strict=True):
        if fall >= largest * (1.0 - 1e-9):
            own = any(law is one for one in named)
            found.append(
                float(np.max(factor, initial=0.0)) * law_slopes(law, number_of(by.path)).omega() if own else 0.0
            )
    return agreed(np.array(found))


def _laws(level: Level, scene: Scene, path: tuple[str, ...]) -> list[tuple[Laws, Index, Array]]:
    """(law, its nodes, its factor in their laws) of the laws that a parameter belongs to."""
    friction = scene.friction
    if isinstance(friction, Laws):
        nodes = np.arange(level.line.m, dtype=np.intp)
        return [(friction, nodes, np.ones(len(nodes)))]
    line = level.line
    factors = friction.factors(line.edge_names, line.edge, line.xy, line.joints)
    return [
        (law, np.flatnonzero(~np.isnan(factor)), factor[~np.isnan(factor)])
        for (edge, law, _), factor in zip(friction.laws, factors, strict=True)
        if edge in ("", *path) or not path
    ]
