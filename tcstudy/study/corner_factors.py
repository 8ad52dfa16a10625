"""By how much the change from h to h/2 is smaller than the error, corner by corner.

In a corner where u ~ r^λ the error of a number falls by 2^{2λ} at halving (λ from the solution, λ from the dual
solution), so that it is the change times 1/(1 − 2^{−2λ}): 2 in a crack's tip, 13 where two slipping edges meet at 170°
(λ = 1/17). Refinement towards a corner makes its part of the change small, not its factor.
Left out: corners of a body from a file, which nothing looks at
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from tcstudy.accuracy.vertices import Vertex, vertices
from tcstudy.fem.contact_line import ContactLine
from tcstudy.fem.meshes import PlaneMesh
from tcstudy.scene.records import Body, Material, Point, Role, Scene
from tcstudy.study.halved import Halved

Array = NDArray[np.float64]

SMOOTH, DIFFERENCE = 4.0 / 3.0, 1.0 / 3.0
"""1/(1 − 2^{−p}) for p = 2, and by how much its mean with p = 1 differs from it."""


@dataclass(frozen=True)
class Regions:
    """What the nodes of the finer mesh belong to.

    factors: (n_f,) from what a node contributes to a change to its part of J(u) − J(u_h)
    region:  (n_f,) the part of the body, from 0 on, whose contributions go by one order
    """

    factors: Array
    region: NDArray[np.intp]

    def sums(self, parts: Array) -> Array:
        """Contributions (n_f,) summed over each region."""
        return np.asarray(np.bincount(self.region, parts))


def regions(halved: Halved, scene: Scene, sticks: NDArray[np.bool_], more: Array) -> Regions:
    """Every singular corner with the triangles that touch it, and the nodes that are nearest to one end of a curve.

    sticks: (m,) whether the contact nodes stick;  more: (k, 2) other places with nodes of their own, beside curve ends
    """
    coarse, fine, line = halved.coarse.mesh, halved.level.mesh, halved.coarse.line
    ends = [end for name in line.edge_names for end in _ends(scene.body, name)]
    stuck = frozenset((name, at) for name, at in ends if _sticks_near(line, sticks, name, at))
    factors = np.full(fine.n_points, SMOOTH)
    places = np.concatenate([fine.points[curve_ends(fine)], more])
    region = np.argmin(np.linalg.norm(fine.points[:, None] - places[None], axis=2), axis=1)
    for vertex in _vertices(scene.body, scene.boundary, scene.material, stuck):
        if vertex.exponent < 1.0:
            node = int(np.argmin(np.linalg.norm(coarse.points - np.array(vertex.at), axis=1)))
            around = fine.triangles[np.any(coarse.triangles == node, axis=1)[halved.parent]]
            factors[around] = np.maximum(factors[around], 1.0 / (1.0 - 2.0 ** (-2.0 * vertex.exponent)))
            region[around] = region.max() + 1
    return Regions(factors, region)


def curve_ends(mesh: PlaneMesh) -> NDArray[np.intp]:
    """Nodes at which one curve of the boundary ends and another begins."""
    own = np.full(mesh.n_points, -1)
    own[mesh.segments[:, 0]] = mesh.segment_curve
    return mesh.segments[own[mesh.segments[:, 1]] != mesh.segment_curve, 1]


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
