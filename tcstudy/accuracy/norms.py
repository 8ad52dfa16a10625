"""Norms of P1 functions on a triangle mesh and on the contact line, and their distance from given
functions.

    ‖v‖² = ∫v²,   |v|₁² = ∫|∇v|²,   ‖v‖_a² = a(v, v) = ∫λ(div v)² + 2μ ε(v):ε(v)

Differences of P1 functions on one mesh are integrated exactly; against a function given by value
and gradient with the seven-point rule of degree five. H¹ stands for the seminorm: it has one
physical dimension, the full norm has not.

On Γ_C u_T is piecewise linear on segments, and ξ constant on the S_i around its nodes: an array (s,
2) of values on half segments. Where one end of a segment carries no unknown, both halves belong to
the other (method §2).

P1 functions are carried to the nodes of other meshes of a body by `interpolation`; points outside
the mesh (beside an arc that it cuts short) get the linear function of the triangle nearest to them.
`prolongation` is that to a uniform refinement: it keeps the coarse nodes with their numbers, and
every edge of the fine mesh from a new node to an old one is half of a coarse edge, so that the
topology alone names the two parents of a new node. On a curved boundary the new node moves to the
arc, and the coarse function is carried along.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from tcstudy.shapes.edges import INNER, TriangleGeometry
from tcstudy.shapes.places import located as located

if TYPE_CHECKING:
    import scipy.sparse as sp

Array = NDArray[np.float64]
Indices = NDArray[np.intp]
Modulus = float | Array
"""λ or μ: of the whole body, or (t,) of every triangle."""
Sample = tuple[Array, Array]
"""Values (t, q) and gradients (2, t, q) of a function at q points of every triangle; (2, t, 1) if
they are constant."""
Function = Callable[[Array, Array], tuple[Array, Array]]
"""x, y (…) → value (…) and gradient (2, …)."""

_A, _B = (6 - np.sqrt(15)) / 21, (6 + np.sqrt(15)) / 21
_RADON = np.array(
    [[1 / 3] * 3] + [np.roll([1 - 2 * t, t, t], i).tolist() for t in (_A, _B) for i in range(3)]
)
_WEIGHTS = np.array([9 / 40] + [(155 - np.sqrt(15)) / 1200] * 3 + [(155 + np.sqrt(15)) / 1200] * 3)
_RULES = {3: (INNER, np.full(3, 1 / 3)), 7: (_RADON, _WEIGHTS)}
"""Barycentric points (q, 3) and weights (q,) of q points: exact for squares of linear functions, or
degree five."""


def _points(mesh: TriangleGeometry, q: int) -> Array:
    """Return (2, t, q) x and y of the points of a rule."""
    return np.einsum("qk,tkd->dtq", _RULES[q][0], mesh.corners)


def nodal(mesh: TriangleGeometry, v: Array, q: int = 3) -> Sample:
    """Return the sample of a P1 function with nodal values v (n,)."""
    return v[mesh.triangles] @ _RULES[q][0].T, mesh.gradient(v).T[:, :, None]


def affine(mesh: TriangleGeometry, value: Array, gradient: Array) -> Sample:
    """Return the sample of a function that is linear on every triangle.

    value: (t,) at the centres;  gradient: (t, 2)
    """
    offset = _points(mesh, 3) - mesh.centres.T[:, :, None]
    values = value[:, None] + np.einsum("td,dtq->tq", gradient, offset)
    return values, gradient.T[:, :, None]


def given(mesh: TriangleGeometry, function: Function) -> Sample:
    """Return the sample of a function given by value and gradient, at seven points."""
    return function(*_points(mesh, 7))


def norms(
    mesh: TriangleGeometry, parts: Sequence[Sample], lam: Modulus, mu: Modulus
) -> dict[str, float]:
    """Return ‖·‖_a, |·|₁ and ‖·‖ of a displacement, as u_energy, u_H1 and u_L2.

    A third part is a temperature and gives theta_L2 and theta_H1.
    """
    n_points = parts[0][0].shape[1]
    weight = mesh.area[:, None] * _RULES[n_points][1]
    (u, du), (v, dv), *theta = parts
    lam = np.reshape(lam, (-1, 1))
    mu = np.reshape(mu, (-1, 1))
    strain = du[0] ** 2 + dv[1] ** 2 + 0.5 * (du[1] + dv[0]) ** 2
    squares = {
        "u_energy": lam * (du[0] + dv[1]) ** 2 + 2 * mu * strain,
        "u_H1": (du**2).sum(axis=0) + (dv**2).sum(axis=0),
        "u_L2": u**2 + v**2,
    }
    for value, slope in theta:
        squares |= {"theta_L2": value**2, "theta_H1": (slope**2).sum(axis=0)}
    return {name: float(np.sqrt((weight * square).sum())) for name, square in squares.items()}


def integral(mesh: TriangleGeometry, density: Callable[[Array, Array], Array]) -> float:
    """Return ∫ of a function of x and y, by the seven-point rule."""
    values = density(*_points(mesh, 7))
    return float((mesh.area[:, None] * _WEIGHTS * values).sum())


def less(a: Sample, b: Sample) -> Sample:
    """Return a − b."""
    return a[0] - b[0], a[1] - b[1]


LineFunction = Callable[[Array, Array, Array], Array]
"""x, y (…) and normals (…, 2) → values (…)."""

_GAUSS, _LINE_WEIGHTS = np.polynomial.legendre.leggauss(5)
_PLACES = 0.5 * (1 + _GAUSS)
_LINE_RULE = 0.5 * _LINE_WEIGHTS
"""Gauss points of [0, 1] and their weights."""


def linear(ends: Array) -> list[Array]:
    """Return for `line_norms` a function linear on every segment, given at its ends (s, 2)."""
    return [ends[:, :1] * (1 - _PLACES) + ends[:, 1:] * _PLACES]


def steps(halves: Array) -> list[Array]:
    """Return for `line_norms` a function constant on half segments (s, 2)."""
    return [halves[:, :1], halves[:, 1:]]


def line_norms(
    ends: Array, normals: Array, v: list[Array], f: LineFunction | None = None
) -> tuple[float, float]:
    """Return ‖v − f‖ and ‖f‖ in L² of segments with these ends (s, 2, 2); f = 0 without one.

    normals: (s, 2, 2) outward unit normals of the exact curve at the ends
    v:       for each of equal parts of every segment its values (s, q), or (s, 1), at the Gauss
             points
    """
    square_error = 0.0
    square_size = 0.0
    share = 1.0 / len(v)
    start = ends[:, :1]
    chord = ends[:, 1:] - start
    weight = share * _LINE_RULE * np.linalg.norm(chord, axis=2)
    for i, part in enumerate(v):
        t = (share * (i + _PLACES))[None, :, None]
        points = start + t * chord
        n = normals[:, :1] * (1 - t) + normals[:, 1:] * t
        n /= np.linalg.norm(n, axis=2, keepdims=True)
        exact = np.zeros(len(_PLACES)) if f is None else f(points[..., 0], points[..., 1], n)
        square_error += float((weight * (part - exact) ** 2).sum())
        square_size += float((weight * exact**2).sum())
    return float(np.sqrt(square_error)), float(np.sqrt(square_size))


def prolongation(n_coarse: int, fine_points: Array, fine_triangles: Indices) -> sp.csr_array:
    """Return (n_fine, n_coarse) from nodal values of a mesh to those on its uniform refinement."""
    import scipy.sparse as sp  # here, since reading a study must not wait for it

    n_fine = len(fine_points)
    corner_pairs = ((0, 1), (1, 2), (2, 0))
    sides = np.concatenate([fine_triangles[:, pair] for pair in corner_pairs])
    is_half_edge = (sides >= n_coarse).sum(axis=1) == 1
    half_edges = np.unique(np.sort(sides[is_half_edge], axis=1), axis=0)
    by_new_node = np.argsort(half_edges[:, 1], kind="stable")
    parents = half_edges[by_new_node, 0]  # two of every new node
    old_nodes = np.arange(n_coarse)
    rows = np.concatenate([old_nodes, np.repeat(np.arange(n_coarse, n_fine), 2)])
    columns = np.concatenate([old_nodes, parents])
    entries = np.concatenate([np.ones(n_coarse), np.full(len(parents), 0.5)])
    return sp.csr_array((entries, (rows, columns)), shape=(n_fine, n_coarse))


def interpolation(mesh: TriangleGeometry, points: Array) -> sp.csr_array:
    """Return (q, n) from nodal values of a P1 function to its values at points (q, 2)."""
    import scipy.sparse as sp

    triangle, weights = located(mesh, points)
    rows = np.repeat(np.arange(len(points)), 3)
    columns = mesh.triangles[triangle].ravel()
    shape = (len(points), len(mesh.points))
    return sp.csr_array((weights.ravel(), (rows, columns)), shape=shape)
