"""By how much the change from h to h/2 is smaller than the error, corner by corner.

In a corner where u ~ r^λ the error of a number falls by 2^{2λ} at halving (λ from the solution, λ from the dual
solution), so that it is the change times 1/(1 − 2^{−2λ}): 2 in a crack's tip, 13 where two slipping edges meet at 170°
(λ = 1/17). Refinement towards a corner makes its share of the change small, not its factor.
Left out: corners of a body from a file, which nothing looks at
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from tcstudy.accuracy.vertices import vertices
from tcstudy.scene.records import Point, Scene
from tcstudy.study.level import Level

Array = NDArray[np.float64]

SMOOTH, MIDDLE, ROUGH = 4.0 / 3.0, 5.0 / 3.0, 2.0
"""1/(1 − 2^{−p}) for p = 2, for p = 1, and their mean between them."""


def mean_factors(level: Level, scene: Scene, sticks: NDArray[np.bool_], shares: Array) -> tuple[float, float]:
    """Factors (to the limit, to the error) from a change to what it says of J(u) − J(u_h), weighted by shares (t,).

    sticks: (m,) whether the contact nodes stick
    """
    total = float(shares.sum())
    to_limit, to_error = SMOOTH, MIDDLE
    if not total > 0.0:
        return to_limit, to_error
    corner = _corner_factors(level, scene, sticks)
    singular = corner > 0.0
    weight = shares / total
    rest = 1.0 - float(weight[singular].sum())
    return (
        rest * to_limit + float(weight[singular] @ corner[singular]),
        rest * to_error + float(weight[singular] @ np.maximum(corner[singular], to_error)),
    )


def _corner_factors(level: Level, scene: Scene, sticks: NDArray[np.bool_]) -> Array:
    """(t,) 1/(1 − 2^{−2λ}) in triangles at a corner with λ < 1, 0 elsewhere."""
    mesh, line = level.mesh, level.line

    def near(edge: str, at: Point) -> bool:
        own = np.flatnonzero(line.edge == line.edge_names.index(edge))
        if not len(own):
            return False
        return bool(sticks[own[np.argmin(np.linalg.norm(line.xy[own] - np.array(at), axis=1))]])

    factors = np.zeros(len(mesh.triangles))
    for vertex in vertices(scene.body, scene.boundary, scene.material, near):
        if vertex.exponent < 1.0:
            node = int(np.argmin(np.linalg.norm(mesh.points - np.array(vertex.at), axis=1)))
            around = np.any(mesh.triangles == node, axis=1)
            factors[around] = np.maximum(factors[around], 1.0 / (1.0 - 2.0 ** (-2.0 * vertex.exponent)))
    return factors
