"""By how much the change from h to h/2 is smaller than the error, corner by corner.

In a corner where u ~ r^λ the error of a number falls by 2^{2λ} at halving (λ from the solution, λ from the dual
solution), so that it is the change times 1/(1 − 2^{−2λ}): 2 in a crack's tip, 13 where two slipping edges meet at 170°
(λ = 1/17). Refinement towards a corner makes its share of the change small, not its factor.
Left out: corners of a body from a file, which nothing looks at
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from tcstudy.accuracy.vertices import Vertex, vertices
from tcstudy.fem.contact_line import ContactLine
from tcstudy.scene.records import Body, Material, Point, Role, Scene
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
    ends = [end for name in line.edge_names for end in _ends(scene.body, name)]
    stuck = frozenset((name, at) for name, at in ends if _sticks_near(line, sticks, name, at))
    factors = np.zeros(len(mesh.triangles))
    for vertex in _vertices(scene.body, scene.boundary, scene.material, stuck):
        if vertex.exponent < 1.0:
            node = int(np.argmin(np.linalg.norm(mesh.points - np.array(vertex.at), axis=1)))
            around = np.any(mesh.triangles == node, axis=1)
            factors[around] = np.maximum(factors[around], 1.0 / (1.0 - 2.0 ** (-2.0 * vertex.exponent)))
    return factors


@lru_cache(maxsize=256)
def _vertices(
    body: Body, boundary: tuple[tuple[str, Role], ...], material: Material, stuck: frozenset[tuple[str, Point]]
) -> tuple[Vertex, ...]:
    """The corners, given which (edge, end) stick; their exponents are roots that take longer than a small solution."""
    return tuple(vertices(body, boundary, material, lambda edge, at: (edge, at) in stuck))


def _ends(body: Body, name: str) -> list[tuple[str, Point]]:
    """(name, point) of both ends of the edges with this name; none for a body from a file."""
    if body.outline is None:
        return []
    found = []
    for loop in (body.outline, *body.holes):
        after = (*loop.edges[1:], loop.edges[0])
        found += [
            (name, at) for a, b in zip(loop.edges, after, strict=True) if a.name == name for at in (a.start, b.start)
        ]
    return found


def _sticks_near(line: ContactLine, sticks: NDArray[np.bool_], edge: str, at: Point) -> bool:
    """Whether the node of an edge that is nearest to a point sticks."""
    own = np.flatnonzero(line.edge == line.edge_names.index(edge))
    if not len(own):
        return False
    return bool(sticks[own[np.argmin(np.linalg.norm(line.xy[own] - np.array(at), axis=1))]])
