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

import numpy as np
from numpy.typing import NDArray

from tcstudy.offline.level import Level
from tcstudy.offline.loads import loaded_by, split
from tcstudy.scene.records import Heat, Scalar, Scene
from tcstudy.scene.study import Study
from tcstudy.solvers.problem import ContactProblem

Array = NDArray[np.float64]

MOST_NODES = 250
"""Contact nodes up to which a level is kept: Ã of more would make a page of several megabytes."""
MOST_LOADS = 64
"""Different mechanical or prescribed loads that are kept; points with further ones are not valid."""
RANGE = 4.0
"""How far the range of α/k goes beyond that of the sweep, as a factor at either end."""
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
    first = study.scenes[0]
    base = level.condensed(first).problem
    source, surroundings = _heat(study, level)
    mechanical, held = _Distinct(), _Distinct()
    points: list[dict[str, float]] = []
    for scene in study.scenes:
        cold, rigid = replace(scene.material, beta=0.0), replace(first.material, beta=0.0)
        loaded = replace(loaded_by(scene, loads=True), material=rigid, heat=Heat(), friction=first.friction)
        # the load of given displacements goes with the stiffness
        moved = replace(loaded_by(scene, moves=True), material=cold, heat=Heat(), friction=first.friction)
        found = _coefficients(scene, first, (mechanical.number(loaded, level), held.number(moved, level)))
        problem = level.condensed(scene).problem
        valid = _agrees(problem, found, base.A_tilde, (mechanical, held), source, surroundings)
        points.append(found | {"valid": float(valid)})
    arrays: dict[str, NDArray[np.generic]] = {
        "A_tilde": base.A_tilde,
        "mechanical_load": mechanical.rows(level.line.m),
        "held_load": held.rows(level.line.m),
        **_named("source", source),
        **_named("surroundings", surroundings),
        **{name: np.array([point[name] for point in points]).reshape(study.shape) for name in points[0]},
    }
    return {f"live_{name}": values for name, values in arrays.items()}


class _Distinct:
    """The different loads of a sweep, condensed once each."""

    def __init__(self) -> None:
        self._numbers: dict[Scene, int] = {}
        self.loads: list[Array] = []

    def number(self, scene: Scene, level: Level) -> int:
        """Which load it is; −1 for none, −2 for one too many."""
        if loaded_by(scene) == scene:
            return -1
        if scene not in self._numbers:
            if len(self.loads) == MOST_LOADS:
                return -2
            self._numbers[scene] = len(self.loads)
            self.loads.append(level.condensed(scene).problem.l_tilde)
        return self._numbers[scene]

    def rows(self, m: int) -> Array:
        """(loads, m) all of them."""
        return np.array(self.loads).reshape(-1, m)


def _coefficients(scene: Scene, first: Scene, loads: tuple[int, int]) -> dict[str, float]:
    """The numbers that make up a point's problem."""
    heat = scene.heat
    known = heat.theta is not None
    return {
        "stiffness": scene.material.mu / first.material.mu,
        "mechanical": float(loads[0]),
        "held": float(loads[1]),
        "beta": scene.material.beta,
        "alpha": float("nan") if known else heat.alpha,
        "k": float("nan") if known or scene.material.k is None else scene.material.k,
        "q": 0.0 if known else split(heat.q)[1],
        "theta_bar": split(heat.theta_bar if heat.theta is None else heat.theta)[1],
    }


def _heat(study: Study, level: Level) -> tuple[Rational | None, Rational | None]:
    """α × load of a unit source, and load of unit surroundings (or of the known temperature), over α/k."""
    scenes = [scene for scene in study.scenes if scene.material.beta != 0.0]
    if not scenes:
        return None, None
    scene = next((s for s in scenes if split(s.heat.q)[1] != 0.0), scenes[0])
    unit = loaded_by(scene)
    unit = replace(unit, material=replace(study.scenes[0].material, beta=1.0, k=scene.material.k))
    if scene.heat.theta is not None:
        load = level.condensed(replace(unit, heat=replace(scene.heat, theta=split(scene.heat.theta)[0])))
        return None, _constant(load.problem.l_tilde)
    ratios = [s.heat.alpha / s.material.k for s in scenes if s.material.k and s.heat.alpha > 0.0]
    if not ratios:
        return None, None
    k, bounds = float(scene.material.k or 1.0), (min(ratios) / RANGE, max(ratios) * RANGE)

    def at(a: float, q: Scalar, theta_bar: Scalar) -> Array:
        heat = replace(scene.heat, alpha=a * k, q=q, theta_bar=theta_bar)
        return level.condensed(replace(unit, heat=heat)).problem.l_tilde

    q, theta_bar = split(scene.heat.q), split(scene.heat.theta_bar)
    source = interpolated(lambda a: a * k * at(a, q[0], 0.0), bounds) if q[1] != 0.0 else None
    if theta_bar[0] == 1.0:
        return source, _constant(at(ratios[0], 0.0, 1.0))
    return source, interpolated(lambda a: at(a, 0.0, theta_bar[0]), bounds)


def _constant(load: Array) -> Rational:
    return Rational(np.zeros(1), np.ones(1), load[None])


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
    loads: tuple[_Distinct, _Distinct],
    source: Rational | None,
    surroundings: Rational | None,
) -> bool:
    """Whether the formula gives the point's problem; its numbers decide, so that no shape of a load is trusted."""
    numbers = found["mechanical"], found["held"]
    if -2 in numbers:
        return False
    total = np.zeros(problem.m)
    for distinct, number in zip(loads, numbers, strict=True):
        if number >= 0:
            total = total + distinct.loads[int(number)]
    if found["beta"] != 0.0:
        a = found["alpha"] / found["k"] if found["alpha"] > 0.0 else 0.0
        if source is not None and found["q"] != 0.0:
            total = total + found["beta"] * found["q"] / found["alpha"] * source(a)
        if surroundings is not None:
            total = total + found["beta"] * found["theta_bar"] * surroundings(a)
    size = float(np.max(np.abs(problem.l_tilde), initial=0.0))
    same = bool(np.max(np.abs(total - problem.l_tilde), initial=0.0) <= AGREEMENT * size)
    stiffness = np.max(np.abs(found["stiffness"] * A_tilde - problem.A_tilde))
    return same and bool(stiffness <= AGREEMENT * np.max(np.abs(problem.A_tilde)))


def _named(name: str, function: Rational | None) -> dict[str, NDArray[np.generic]]:
    if function is None:
        return {}
    return {f"{name}_node": function.nodes, f"{name}_weight": function.weights, f"{name}_load": function.values}
