"""Derivatives of a condensed problem by one number of its scene: ∂Ã/∂p, ∂l̃/∂p, and of b and its kinks at every node.

Exact, each by how the number enters:

- θ̄, θ, q, f, g, pressure, prescribed u: l̃ is affine, so ∂l̃/∂p is the l̃ of the scene with p = 1 and no other load;
- E: Ã and what prescribed displacements load grow with it, so does heat where alpha_T is given (β ∝ E): l̃/E of these;
- alpha_T, beta: heat alone;
- α, k: θ is a sum of modes with factors 1/(μ_k + α/k), differentiated mode by mode (`Conduction.slope`);
- a number of a law, or its strength: by the numbers that the law is made of (`scene.law_slopes`).

Left out: ν, λ, μ and the geometry, which change Ã as a matrix; where materials differ by region, all their numbers.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from tcstudy.expressions.expression import Expression
from tcstudy.offline.level import Level
from tcstudy.offline.loads import (
    FamilyKey,
    LoadTerm,
    Part,
    TemperatureField,
    UniformTemperature,
    relative_k,
    split,
    unloaded,
)
from tcstudy.scene.friction import FrictionLaw
from tcstudy.scene.law_slopes import law_slopes, number_of
from tcstudy.scene.parameters import path_scene
from tcstudy.scene.records import Clamped, Convection, Heat, Role, Scene, Traction
from tcstudy.scene.study import Sensitivity
from tcstudy.solvers.linearised import Linearised

Array = NDArray[np.float64]
Index = NDArray[np.intp]


@dataclass(frozen=True, eq=False)
class LoadSlope:
    """What does not depend on the solution: ∂Ã/∂p = stiffness·Ã; (m,) l_tilde = ∂l̃/∂p; ∂(mean θ)/∂p."""

    stiffness: float
    l_tilde: Array
    theta_mean: float


def load_slope(level: Level, scene: Scene, by: Sensitivity) -> LoadSlope:
    """∂Ã/∂p, ∂l̃/∂p and that of the mean temperature. Raises NotPositiveDefinite as `Level.condensed`."""
    path = by.path
    if path[0] == "friction":
        return LoadSlope(0.0, np.zeros(level.line.m), 0.0)
    if path == ("heat", "alpha") or path == ("material", "k"):
        return _by_heat(level, scene, path[1])
    material, stiffness, factor = scene.material, 0.0, 1.0
    if path == ("material", "E"):
        stiffness = factor = 1.0 / material.E
        beta = material.beta if by.heat_grows else 0.0
        linear = replace(scene, boundary=_without(scene, Clamped), f=(0.0, 0.0), material=replace(material, beta=beta))
    elif path[0] == "material":
        one = replace(material, beta=material.bulk if path[1] == "alpha_T" else 1.0)
        linear = replace(scene, boundary=_without(scene), f=(0.0, 0.0), material=one)
    elif path == ("load",):
        linear = replace(scene, boundary=_without(scene, Traction, Convection), heat=Heat())
    else:
        linear = path_scene(_bare(scene), path, 1.0)
    block = level.block([linear])
    mean = float(block.theta_mean[0]) if path[0] == "heat" else 0.0
    return LoadSlope(stiffness, factor * block.l_tilde[0], mean)


def _without(scene: Scene, *kept: type) -> tuple[tuple[str, Role], ...]:
    """The boundary without loads and prescribed displacements, those of the kept roles apart."""
    return tuple((name, role if isinstance(role, kept) else unloaded(role)) for name, role in scene.boundary)


def _bare(scene: Scene) -> Scene:
    """The scene without any load; its temperature is 0."""
    heat = scene.heat
    cold = replace(heat, theta=0.0) if heat.theta is not None else replace(heat, theta_bar=0.0, q=0.0)
    return replace(scene, boundary=_without(scene), f=(0.0, 0.0), heat=cold)


def _by_heat(level: Level, scene: Scene, name: str) -> LoadSlope:
    """By α or k: with a = α/k and Θ the temperature for k = 1, θ = Θ_θ̄(a) + Θ_q(a)/k."""
    parts = list(_heat_parts(level, scene, name))
    constant = sum(part.constant for part in parts)
    fields = [item for part in parts for item in part.fields]
    terms = []
    for at, beta in ((where, own.beta) for where, own in scene.pieces):
        terms += [LoadTerm(TemperatureField(field, at), beta * factor) for field, factor in fields]
        terms.append(LoadTerm(UniformTemperature(at), beta * constant))
    mean = constant + sum(factor * level.temperatures.mean(field) for field, factor in fields)
    return LoadSlope(0.0, level.load_of(scene, terms), mean)


def _heat_parts(level: Level, scene: Scene, name: str) -> list[Part]:
    """The parts of ∂θ/∂α or ∂θ/∂k."""
    heat, k, ratios = scene.heat, scene.material.k, relative_k(scene)
    if k is None or heat.theta is not None or not scene.edges(Convection):
        return []
    a, conduction = heat.alpha / k, level.temperatures.conduction(ratios)
    rate, parts = (1.0 if name == "alpha" else -a) / k, []
    if isinstance(heat.theta_bar, Expression):
        parts.append(conduction.slope(FamilyKey("surroundings", heat.theta_bar, (), ratios), a).times(rate))
    shape, factor = split(heat.q)
    if factor != 0.0:
        parts.append(conduction.slope(FamilyKey("source", shape, heat.omega, ratios), a).times(factor * rate / k))
        if name == "k":
            source = FamilyKey("source", shape, heat.omega, ratios)
            parts.append(conduction.part(source, heat.alpha, k).times(-factor / k))
    return parts


def law_slope(level: Level, scene: Scene, by: Sensitivity, at: Linearised) -> tuple[Array, Array]:
    """(m,) ∂b/∂p at the slips of a solution, and of the kinks on which nodes rest; 0 where p is no number of the law.

    Raises KeyError where no law has the parameter.
    """
    b, kinks = np.zeros(len(at.v)), np.zeros(len(at.v))
    if by.path[0] != "friction":
        return b, kinks
    for law, nodes, factor in _laws(level, scene, by.path):
        slopes, s = law_slopes(law, number_of(by.path)), at.v[nodes]
        b[nodes] = factor * slopes.value(s, law.piece(s))
        if len(law.kinks):
            kinks[nodes] = slopes.kinks[law.nearest_kink(s)]
    return b, kinks


def _laws(level: Level, scene: Scene, path: tuple[str, ...]) -> list[tuple[FrictionLaw, Index, Array]]:
    """(law, its nodes, strength there) of the laws that a parameter belongs to."""
    friction = scene.friction
    if isinstance(friction, FrictionLaw):
        nodes = np.arange(level.line.m, dtype=np.intp)
        return [(friction, nodes, np.ones(len(nodes)))]
    index, strength = friction.along(level.line.edge_names, level.line.edge, level.line.xy)
    named = [(law, np.flatnonzero(index == k)) for k, (edge, law, _) in enumerate(friction.laws) if edge in ("", *path)]
    return [(law, nodes, strength[nodes]) for law, nodes in named]
