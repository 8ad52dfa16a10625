"""Derivatives of the whole body's problem A(p) u = l(p) by one number of its scene, and what follows for contact.

With û the displacement of the body at a solution, prescribed part included, and E the extension of contact nodes,

    r = ∂l̃/∂p − (∂Ã/∂p) v = Eᵀ(∂l/∂p − (∂A/∂p) û)           one forward elimination
    ∂(energy)/∂p = ½ ûᵀ(∂A/∂p)û − (∂l/∂p)ᵀû + (Aû − l)ᵀ ∂w_D/∂p         envelope theorem; friction's part is the law's
    ∂λ₁/∂p = x̂ᵀ(∂A/∂p)x̂ / xᵀCx,   x̂ = E x, x the eigenvector

exactly, for E and ν of the body or of a region, stiffness of springs, α of edges and k of regions (the heat problem
solved once more with what the change puts in: −∫_e (θ − θ̄)φ, −∫_ω ∇θ·∇φ), and all in which the load is affine.

Left out: the geometry, which moves the mesh.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import scipy.linalg
from numpy.typing import NDArray

from tcstudy.fem.forms import Moduli, Springs
from tcstudy.offline.level import Level
from tcstudy.offline.loads import loaded_by
from tcstudy.scene.fits import Sensitivity
from tcstudy.scene.parameters import moduli_slope, path_scene
from tcstudy.scene.records import Scene, exchanges

Array = NDArray[np.float64]


def affine_scene(scene: Scene, path: tuple[str, ...]) -> Scene:
    """The scene whose load is the derivative by a number in which the load is affine."""
    return loaded_by(scene, loads=True) if path == ("load",) else path_scene(loaded_by(scene), path, 1.0)


@dataclass(frozen=True, eq=False)
class Change:
    """What a number changes of the whole body.

    moduli, springs: of ∂A/∂p;  load: (2n,) ∂l/∂p in x and y;  held: (2n,) ∂w_D/∂p in local rows
    theta_mean:      ∂(mean θ)/∂p
    """

    moduli: Moduli
    springs: Springs
    load: Array
    held: Array
    theta_mean: float


def change_of(level: Level, scene: Scene, by: Sensitivity) -> Change:
    """∂A/∂p, ∂l/∂p and ∂w_D/∂p. Raises KeyError for a number that there is not."""
    path, none = by.path, np.zeros(2 * level.mesh.n_points)
    load, mean, heat = none, 0.0, level.temperatures

    def heated(put_in: Array) -> tuple[Array, float]:
        """The load and the mean of the temperature that heat at the nodes (n,) makes."""
        theta = heat.response(scene, put_in)
        loads = (own.beta * level.elastic.expansion(theta, where) for where, own in scene.pieces if own.beta != 0.0)
        return np.asarray(sum(loads, none)), heat.mean_of(theta)

    if path[0] == "friction":
        return Change((), (), none, none, 0.0)
    if path[0] in ("material", "materials"):
        where, own = next(one for one in scene.pieces if path[0] == "material" or one[0] == (path[1],))
        slope = moduli_slope(own, path[-1], by.heat_grows)
        if slope.beta:
            load = slope.beta * level.elastic.expansion(level.temperature(scene).theta, where)
        if slope.k and scene.heat.theta is None and scene.conducts:
            more, mean = heated(-(level.elastic.conduction(((where, 1.0),)) @ level.temperature(scene).theta))
            load = load + more
        return Change(((where, slope.lam, slope.mu),) if slope.lam or slope.mu else (), (), load, none, mean)
    if path[-2:-1] == ("spring",):
        return Change((), ((path[1], float(path[-1] == "normal"), float(path[-1] == "tangential")),), none, none, 0.0)
    if path[-1] == "alpha":
        # of one edge, or of all without an α of their own
        others = (name for name, role in scene.boundary if exchanges(role) and not (role.heat and role.heat.alpha))
        load, mean = heated(heat.exchanged(scene, (path[1],) if path[0] == "boundary" else tuple(others)))
        return Change((), (), load, none, mean)
    linear = affine_scene(scene, path)
    mean = level.temperature(linear).mean if path[0] == "heat" or linear.heat_by_edge else 0.0
    return Change((), (), level.load(linear), level.held_values(linear), mean)


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
        """(m,) ∂l̃/∂p − (∂Ã/∂p) v, prescribed displacements apart (`offline.slopes` has those)."""
        return self.level.condensed_of(self.scene, change.load - self._times(change, self.u))

    def energy(self, change: Change) -> float:
        """∂/∂p of the energy but for that of friction, v being kept [J/m per unit of p]."""
        u = self.u
        found = 0.5 * float(u @ self._times(change, u)) - float(change.load @ u)
        if np.any(change.held):
            found += float(self.reaction @ change.held)
        return found

    @cached_property
    def reaction(self) -> Array:
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
