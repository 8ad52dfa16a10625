"""Derivatives of a condensed problem by one number of its scene: ∂Ã/∂p, ∂l̃/∂p, and of b and its kinks at every node.

Exact, each by how the number enters:

- θ̄, θ, q, f, g, pressure, prescribed u: l̃ is affine, so ∂l̃/∂p is the l̃ of the scene with p = 1 and no other load;
- E: Ã and what prescribed displacements load grow with it, so does heat where alpha_T is given (β ∝ E): l̃/E of these;
- alpha_T, beta: heat alone;
- a number of a law, or its strength: by the numbers that the law is made of (`laws.derivatives`);
- ν, k, α, springs, all of materials by region: by the whole body (`offline.whole_slopes`).
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from tcstudy.contact.linearised import Linearised
from tcstudy.laws.derivatives import agreed, law_slopes, number_of
from tcstudy.laws.laws import Laws
from tcstudy.offline.level import Level
from tcstudy.offline.loads import loaded_by
from tcstudy.offline.whole_slopes import WholeBody, affine_scene, change_of
from tcstudy.scene.fits import Sensitivity
from tcstudy.scene.records import Scene

Array = NDArray[np.float64]
Index = NDArray[np.intp]


@dataclass(frozen=True, eq=False)
class LoadSlope:
    """(m,) right = ∂l̃/∂p − (∂Ã/∂p) v at a solution v, and ∂(mean θ)/∂p."""

    right: Array
    theta_mean: float


def load_slope(level: Level, scene: Scene, by: Sensitivity, v: Array, whole: WholeBody | None = None) -> LoadSlope:
    """What a number does to the load and the stiffness, at v (m,).

    whole: the body at v, if it is at hand
    Raises NotPositiveDefinite as `Level.condensed`.
    """
    path = by.path
    if path[0] in ("friction", "history"):
        return LoadSlope(np.zeros(level.line.m), 0.0)
    if not _is_short(scene, path):
        change = change_of(level, scene, by)
        return LoadSlope((whole or WholeBody(level, scene, v)).right_side(change), change.theta_mean)
    material = scene.material
    if path == ("material", "E"):
        grown = level.block([loaded_by(scene, moves=True, heat=by.heat_grows)]).l_tilde[0]
        return LoadSlope((grown - level.condensed(scene).problem.A_tilde @ v) / material.E, 0.0)
    if path[0] == "material":
        one = replace(material, beta=material.bulk if path[1] == "alpha_T" else 1.0)
        return LoadSlope(level.block([replace(loaded_by(scene, heat=True), material=one)]).l_tilde[0], 0.0)
    linear = affine_scene(scene, path)
    block = level.block([linear])
    mean = float(block.theta_mean[0]) if path[0] == "heat" or linear.heat_by_edge else 0.0
    return LoadSlope(block.l_tilde[0], mean)


def is_load(path: tuple[str, ...]) -> bool:
    """Whether it is the load alone that a number changes, and is affine in it."""
    return path[0] in ("load", "loads", "heat", "boundary") and path[-1] != "alpha" and path[-2:-1] != ("spring",)


def _is_short(scene: Scene, path: tuple[str, ...]) -> bool:
    """Whether ∂Ã/∂p is Ã/p or 0 and ∂l̃/∂p a sum of basis loads."""
    if path[0] in ("material", "materials"):
        alone = {"E": not scene.springs, "alpha_T": True, "beta": True}
        return not scene.material.regions and alone.get(path[-1], False)
    return is_load(path)


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
            kinks[nodes] += np.where(law.on_kink(s), slopes.kinks[law.nearest_kink(s)], 0.0)
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
