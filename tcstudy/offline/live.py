"""What a browser needs to solve a level's contact problems by itself: Ã, c and loads as functions of a few numbers.

For every point whose elastic ratio and load shapes are those of the first point,

    Ã = μ/μ₀ Ã₀,   l̃ = φ l̃_mech + l̃_held + β (q/α s(α/k) + θ̄ t(α/k)),

with φ a factor of all mechanical loads, s and t the condensed loads of the temperatures of a unit source (times α) and
of unit surroundings. In a = α/k both are rational with real negative poles (tcstudy.offline.thermal); they are kept in
barycentric form, Σ_j w_j f_j/(a − a_j) / Σ_j w_j/(a − a_j), over the range of the sweep, widened by RANGE. Every point
is put to the test: `valid` says for which of them the formula gives the problem of `Level.condensed` to AGREEMENT.
Left out: more than one λ/μ, more than one shape of q or θ̄, α = 0.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tcstudy.contact.problem import ContactProblem
from tcstudy.offline.level import Level
from tcstudy.offline.loads import loaded_by, split
from tcstudy.scene.records import Heat, Scene
from tcstudy.scene.study import Study

Array = NDArray[np.float64]

MOST_NODES = 250
"""Contact nodes up to which a level is kept: Ã of more would make a page of several megabytes."""
MOST_LOADS = 64
"""Different mechanical or prescribed loads that are kept; points with further ones are not valid."""
RANGE = 4.0
"""How far the range of α/k goes beyond that of the sweep, as a factor at either end."""
NONE, TOO_MANY = -1.0, -2.0
"""In place of a load's number."""
ACCURACY = 1e-13
AGREEMENT = 1e-11


@dataclass(frozen=True)
class Rational:
    """A vector-valued rational function in barycentric form: nodes (J,), weights (J,), values (J, m)."""

    nodes: Array
    weights: Array
    values: Array

    def __call__(self, a: float) -> Array:
        """Its value at a (m,)."""
        at = np.flatnonzero(self.nodes == a)
        if len(at):
            return np.asarray(self.values[at[0]])
        share = self.weights / (a - self.nodes)
        return np.asarray(share @ self.values / share.sum())


def live_arrays(study: Study, level: Level) -> dict[str, NDArray[np.generic]]:
    """The arrays of data.schema.LIVE for one level, "live_" before their names; empty where it has too many nodes.

    Raises NotPositiveDefinite as `Level.condensed`.
    """
    if not 0 < level.line.m <= MOST_NODES:
        return {}
    first, heat = study.scenes[0], _heat(study, level)
    A_tilde = level.condensed(first).problem.A_tilde
    loads: dict[str, dict[Scene, Array]] = {"mechanical": {}, "held": {}}
    points: list[dict[str, float]] = []
    for scene in study.scenes:
        cold, rigid = replace(scene.material, beta=0.0), replace(first.material, beta=0.0)
        loaded, moved = loaded_by(scene, loads=True), loaded_by(scene, moves=True)
        found = _coefficients(scene, first)
        # the load of given displacements goes with the stiffness
        for name, one, material in (("mechanical", loaded, rigid), ("held", moved, cold)):
            own, known = replace(one, material=material, heat=Heat(), friction=first.friction), loads[name]
            if one == loaded_by(one):
                found[name] = NONE
            elif own not in known and len(known) == MOST_LOADS:
                found[name] = TOO_MANY
            else:
                if own not in known:
                    known[own] = level.condensed(own).problem.l_tilde
                found[name] = float(list(known).index(own))
        points.append(found | {"valid": float(_agrees(level.condensed(scene).problem, found, A_tilde, loads, heat))})
    arrays: dict[str, NDArray[np.generic]] = {"A_tilde": A_tilde}
    arrays |= {f"{name}_load": np.array(list(own.values())).reshape(-1, level.line.m) for name, own in loads.items()}
    for name, function in heat.items():
        arrays |= {f"{name}_node": function.nodes, f"{name}_weight": function.weights, f"{name}_load": function.values}
    arrays |= {name: np.array([point[name] for point in points]).reshape(study.shape) for name in points[0]}
    return {f"live_{name}": values for name, values in arrays.items()}


def _coefficients(scene: Scene, first: Scene) -> dict[str, float]:
    """The numbers that make up a point's problem."""
    heat, known, nan = scene.heat, scene.heat.theta is not None, float("nan")
    return {
        "stiffness": scene.material.mu / first.material.mu,
        "beta": scene.material.beta,
        "alpha": nan if known else heat.alpha,
        "k": nan if known or scene.material.k is None else scene.material.k,
        "q": 0.0 if known else split(heat.q)[1],
        "theta_bar": split(heat.theta_bar if heat.theta is None else heat.theta)[1],
    }


def _heat(study: Study, level: Level) -> dict[str, Rational]:
    """α × load of a unit source, and load of unit surroundings (or of the known temperature), over α/k."""
    scenes = [scene for scene in study.scenes if scene.material.beta != 0.0]
    if not scenes:
        return {}
    scene = next((s for s in scenes if split(s.heat.q)[1] != 0.0), scenes[0])
    unit = replace(loaded_by(scene), material=replace(study.scenes[0].material, beta=1.0, k=scene.material.k))

    def load(**heat: Any) -> Array:
        return level.condensed(replace(unit, heat=replace(scene.heat, **heat))).problem.l_tilde

    def constant(load: Array) -> Rational:
        return Rational(np.zeros(1), np.ones(1), load[None])

    if scene.heat.theta is not None:
        return {"surroundings": constant(load(theta=split(scene.heat.theta)[0]))}
    ratios = [s.heat.alpha / s.material.k for s in scenes if s.material.k and s.heat.alpha > 0.0]
    if not ratios:
        return {}
    k, bounds, found = float(scene.material.k or 1.0), (min(ratios) / RANGE, max(ratios) * RANGE), {}
    (q, heated), (theta_bar, _) = split(scene.heat.q), split(scene.heat.theta_bar)
    if heated != 0.0:
        found["source"] = interpolated(lambda a: a * k * load(alpha=a * k, q=q, theta_bar=0.0), bounds)
    if theta_bar == 1.0:
        return found | {"surroundings": constant(load(alpha=ratios[0] * k, q=0.0, theta_bar=1.0))}
    return found | {"surroundings": interpolated(lambda a: load(alpha=a * k, q=0.0, theta_bar=theta_bar), bounds)}


def interpolated(function: Callable[[float], Array], bounds: tuple[float, float]) -> Rational:
    """The function of a through Chebyshev's points of x = (a − a₀)/(a + a₀), a₀² the product of the bounds.

    Its poles in x are real, beyond ±1: the error falls like ρ⁻ⁿ, ρ = (R + 1)/(R − 1) with R⁴ the ratio of the bounds.
    1/(x − x_j) is proportional to (a_j + a₀)/(a − a_j) (Berrut & Trefethen, SIAM Rev. 46 (2004) 501–517).
    """
    middle, R = np.sqrt(bounds[0] * bounds[1]), (bounds[1] / bounds[0]) ** 0.25
    n = int(np.ceil(np.log(1.0 / ACCURACY) / np.log((R + 1.0) / (R - 1.0))))
    x = np.cos(np.pi * np.arange(n + 1) / n) * (R**2 - 1.0) / (R**2 + 1.0)
    nodes, weights = middle * (1.0 + x) / (1.0 - x), (-1.0) ** np.arange(n + 1)
    weights[[0, -1]] *= 0.5
    return Rational(nodes, weights * (nodes + middle), np.array([function(float(a)) for a in nodes]))


def _agrees(
    problem: ContactProblem,
    found: dict[str, float],
    A_tilde: Array,
    loads: dict[str, dict[Scene, Array]],
    heat: dict[str, Rational],
) -> bool:
    """Whether the formula gives the point's problem; its numbers decide, so that no shape of a load is trusted."""
    if TOO_MANY in (found["mechanical"], found["held"]):
        return False
    total = np.zeros(problem.m)
    for name, known in loads.items():
        if found[name] != NONE:
            total = total + list(known.values())[int(found[name])]
    if found["beta"] != 0.0:
        a = found["alpha"] / found["k"] if found["alpha"] > 0.0 else 0.0
        if "source" in heat and found["q"] != 0.0:
            total = total + found["beta"] * found["q"] / found["alpha"] * heat["source"](a)
        if "surroundings" in heat:
            total = total + found["beta"] * found["theta_bar"] * heat["surroundings"](a)
    size = float(np.max(np.abs(problem.l_tilde), initial=0.0))
    same = bool(np.max(np.abs(total - problem.l_tilde), initial=0.0) <= AGREEMENT * size)
    stiffness = np.max(np.abs(found["stiffness"] * A_tilde - problem.A_tilde))
    return same and bool(stiffness <= AGREEMENT * np.max(np.abs(problem.A_tilde)))
