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


def _at(mesh: TriangleGeometry, q: int) -> Array:
    """(2, t, q) x and y of the points."""
    return np.einsum("qk,tkd->dtq", _RULES[q][0], mesh.corners)


def nodal(mesh: TriangleGeometry, v: Array, q: int = 3) -> Sample:
    """A P1 function (n,)."""
    return v[mesh.triangles] @ _RULES[q][0].T, mesh.gradient(v).T[:, :, None]


def affine(mesh: TriangleGeometry, value: Array, gradient: Array) -> Sample:
    """A function that is linear on every triangle, from its values at the centres (t,) and
    gradients (t, 2)."""
    apart = _at(mesh, 3) - mesh.centres.T[:, :, None]
    return value[:, None] + np.einsum("td,dtq->tq", gradient, apart), gradient.T[:, :, None]


def given(mesh: TriangleGeometry, function: Function) -> Sample:
    """A function given by value and gradient, at seven points."""
    return function(*_at(mesh, 7))


def norms(
    mesh: TriangleGeometry, parts: Sequence[Sample], lam: Modulus, mu: Modulus
) -> dict[str, float]:
    """‖·‖_a, |·|₁ and ‖·‖ of a displacement, as u_energy, u_H1 and u_L2; of a third part theta_L2
    and theta_H1."""
    weight = mesh.area[:, None] * _RULES[parts[0][0].shape[1]][1]
    (u, du), (v, dv), *theta = parts
    lam, mu = (np.reshape(modulus, (-1, 1)) for modulus in (lam, mu))
    energy = lam * (du[0] + dv[1]) ** 2 + 2 * mu * (
        du[0] ** 2 + dv[1] ** 2 + 0.5 * (du[1] + dv[0]) ** 2
    )
    squares = {
        "u_energy": energy,
        "u_H1": (du**2).sum(axis=0) + (dv**2).sum(axis=0),
        "u_L2": u**2 + v**2,
    }
    for value, slope in theta:
        squares |= {"theta_L2": value**2, "theta_H1": (slope**2).sum(axis=0)}
    return {name: float(np.sqrt((weight * square).sum())) for name, square in squares.items()}


def integral(mesh: TriangleGeometry, density: Callable[[Array, Array], Array]) -> float:
    """∫ of a function of x and y, by the seven-point rule."""
    return float((mesh.area[:, None] * _WEIGHTS * density(*_at(mesh, 7))).sum())


def less(a: Sample, b: Sample) -> Sample:
    """a − b."""
    return a[0] - b[0], a[1] - b[1]


LineFunction = Callable[[Array, Array, Array], Array]
"""x, y (…) and normals (…, 2) → values (…)."""

_GAUSS, _LINE_WEIGHTS = np.polynomial.legendre.leggauss(5)
_AT, _W = 0.5 * (1 + _GAUSS), 0.5 * _LINE_WEIGHTS


def linear(ends: Array) -> list[Array]:
    """What is linear on every segment, given at its ends (s, 2), for `line_norms`."""
    return [ends[:, :1] * (1 - _AT) + ends[:, 1:] * _AT]


def steps(halves: Array) -> list[Array]:
    """What is constant on half segments (s, 2), for `line_norms`."""
    return [halves[:, :1], halves[:, 1:]]


def line_norms(
    ends: Array, normals: Array, v: list[Array], f: LineFunction | None = None
) -> tuple[float, float]:
    """‖v − f‖ and ‖f‖ in L² of segments with these ends (s, 2, 2); f = 0 without one.

    normals: (s, 2, 2) outward unit normals of the exact curve at the ends
    v:       its values (s, q), or (s, 1), at the Gauss points of so many equal parts of every segment
    """
    error, size, share = 0.0, 0.0, 1.0 / len(v)
    a, along = ends[:, :1], ends[:, 1:] - ends[:, :1]
    weight = share * _W * np.linalg.norm(along, axis=2)
    for i, part in enumerate(v):
        t = (share * (i + _AT))[None, :, None]
        at, n = a + t * along, normals[:, :1] * (1 - t) + normals[:, 1:] * t
        n /= np.linalg.norm(n, axis=2, keepdims=True)
        exact = np.zeros(len(_AT)) if f is None else f(at[..., 0], at[..., 1], n)
        error, size = (
            error + float((weight * (part - exact) ** 2).sum()),
            size + float((weight * exact**2).sum()),
        )
    return float(np.sqrt(error)), float(np.sqrt(size))


def prolongation(coarse: int, fine_points: Array, fine_triangles: Indices) -> sp.csr_array:
    """(n_fine, n_coarse) from nodal values of a mesh of so many nodes to those on its uniform
    refinement."""
    import scipy.sparse as sp  # here, since who reads a study alone does not wait for it

    n, n_fine = coarse, len(fine_points)
    sides = np.concatenate([fine_triangles[:, [a, b]] for a, b in ((0, 1), (1, 2), (2, 0))])
    half = (sides >= n).sum(axis=1) == 1
    pairs = np.unique(np.sort(sides[half], axis=1), axis=0)
    parents = pairs[np.argsort(pairs[:, 1], kind="stable"), 0]  # two of every new node
    rows = np.concatenate([np.arange(n), np.repeat(np.arange(n, n_fine), 2)])
    entries = np.concatenate([np.ones(n), np.full(len(parents), 0.5)])
    return sp.csr_array(
        (entries, (rows, np.concatenate([np.arange(n), parents]))), shape=(n_fine, n)
    )


INSIDE = -1e-10
"""Least barycentric coordinate of a point that counts as inside."""


def interpolation(mesh: TriangleGeometry, at: Array) -> sp.csr_array:
    """(q, n) matrix from nodal values of a P1 function to its values at the points `at` (q, 2)."""
    import scipy.sparse as sp

    found, weights = located(mesh, at)
    rows = np.repeat(np.arange(len(at)), 3)
    columns = mesh.triangles[found].ravel()
    return sp.csr_array((weights.ravel(), (rows, columns)), shape=(len(at), len(mesh.points)))


def located(mesh: TriangleGeometry, at: Array) -> tuple[Indices, Array]:
    """The triangle (q,) that each point lies in, or that is nearest to it, and its barycentric
    coordinates (q, 3)."""
    from scipy.spatial import cKDTree  # here, because a run imports this module and seldom needs it

    found = cKDTree(mesh.centres).query(at)[1]
    weights = mesh.barycentric(at, found)
    lost = np.flatnonzero(weights.min(axis=1) < INSIDE)
    if len(lost):
        import shapely

        found[lost] = shapely.STRtree(shapely.polygons(mesh.corners)).nearest(
            shapely.points(at[lost])
        )
        weights[lost] = mesh.barycentric(at[lost], found[lost])
    return found, weights
