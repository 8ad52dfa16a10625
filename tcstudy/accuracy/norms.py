"""Norms of P1 functions on a triangle mesh, and their distance from functions given by value and gradient.

    ‖v‖² = ∫v²,   |v|₁² = ∫|∇v|²,   ‖v‖_a² = a(v, v) = ∫λ(div v)² + 2μ ε(v):ε(v)

Differences of P1 functions on one mesh are integrated exactly; against a given function with the seven-point rule of
degree five on every triangle. H¹ stands for the seminorm |·|₁: it has one physical dimension, the full norm has not.

Norms on the contact line Γ_C: u_T is piecewise linear on its segments, ξ constant on the S_i around its nodes.

A segment's two halves belong to the S_i of its two ends; where one end carries no unknown, both belong to the other
(method §2). So ξ is an array (s, 2) of values on half segments, and a refinement of the line halves every segment.

Exact prolongation between the P1 spaces of uniformly refined meshes.

A uniform refinement keeps the coarse nodes with their numbers and adds one node per coarse edge. Every edge of the
fine mesh from a new node to an old one is half of the coarse edge, so the topology alone names the two parents of a
new node. On straight boundaries the new node is the midpoint, the coarse space is a subspace of the fine one and the
prolongation is exact. On a curved boundary the new node moves to the arc: the spaces are then not nested, and the
prolongation is the coarse function carried along with the moved nodes.

P1 functions carried from one mesh of a body to the nodes of another, nested or not.

Points outside the mesh (beside an arc that it cuts short) get the linear function of the triangle nearest to them.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from tcstudy.shapes.edges import INNER, TriangleGeometry

Array = NDArray[np.float64]
Indices = NDArray[np.intp]
Modulus = float | Array
"""λ or μ: of the whole body, or (t,) of every triangle."""
Sample = tuple[Array, Array]
"""Values (t, q) and gradients (2, t, q) of a function at q points of every triangle; (2, t, 1) if they are constant."""
Function = Callable[[Array, Array], tuple[Array, Array]]
"""x, y (…) → value (…) and gradient (2, …)."""

_A, _B = (6 - np.sqrt(15)) / 21, (6 + np.sqrt(15)) / 21
_RADON = np.array([[1 / 3] * 3] + [np.roll([1 - 2 * t, t, t], i).tolist() for t in (_A, _B) for i in range(3)])
_WEIGHTS = np.array([9 / 40] + [(155 - np.sqrt(15)) / 1200] * 3 + [(155 + np.sqrt(15)) / 1200] * 3)
_RULES = {3: (INNER, np.full(3, 1 / 3)), 7: (_RADON, _WEIGHTS)}
"""Barycentric points (q, 3) and weights (q,) of q points: exact for squares of linear functions, or degree five."""


class Triangles(TriangleGeometry):
    """A mesh for integration."""

    def _at(self, q: int) -> Array:
        """(2, t, q) x and y of the points."""
        return np.einsum("qk,tkd->dtq", _RULES[q][0], self.corners)

    # -- functions, and their norms ----------------------------------------------------------------

    def p1(self, v: Array, q: int = 3) -> Sample:
        """A P1 function (n,)."""
        return v[self.triangles] @ _RULES[q][0].T, self.gradient(v).T[:, :, None]

    def linear(self, value: Array, gradient: Array) -> Sample:
        """A function that is linear on every triangle, from its values at the centres (t,) and gradients (t, 2)."""
        apart = self._at(3) - self.centres.T[:, :, None]
        return value[:, None] + np.einsum("td,dtq->tq", gradient, apart), gradient.T[:, :, None]

    def given(self, function: Function) -> Sample:
        """A function given by value and gradient, at seven points."""
        return function(*self._at(7))

    def norms(self, parts: Sequence[Sample], lam: Modulus, mu: Modulus) -> dict[str, float]:
        """‖·‖_a, |·|₁ and ‖·‖ of a displacement, as u_energy, u_H1 and u_L2; of a third part theta_L2 and theta_H1."""
        weight = self.area[:, None] * _RULES[parts[0][0].shape[1]][1]
        (u, du), (v, dv), *theta = parts

        def norm(square: Array) -> float:
            return float(np.sqrt((weight * square).sum()))

        lam, mu = (np.reshape(modulus, (-1, 1)) for modulus in (lam, mu))
        energy = lam * (du[0] + dv[1]) ** 2 + 2 * mu * (du[0] ** 2 + dv[1] ** 2 + 0.5 * (du[1] + dv[0]) ** 2)
        slopes = (du**2).sum(axis=0) + (dv**2).sum(axis=0)
        found = {"u_energy": norm(energy), "u_H1": norm(slopes), "u_L2": norm(u**2 + v**2)}
        for value, slope in theta:
            found |= {"theta_L2": norm(value**2), "theta_H1": norm((slope**2).sum(axis=0))}
        return found

    def integral(self, density: Callable[[Array, Array], Array]) -> float:
        """∫ of a function of x and y, by the seven-point rule."""
        return float((self.area[:, None] * _WEIGHTS * density(*self._at(7))).sum())


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


def line_norms(ends: Array, normals: Array, v: list[Array], f: LineFunction | None = None) -> tuple[float, float]:
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
        error, size = error + float((weight * (part - exact) ** 2).sum()), size + float((weight * exact**2).sum())
    return float(np.sqrt(error)), float(np.sqrt(size))


def prolongation(coarse: int, fine_points: Array, fine_triangles: Indices) -> sp.csr_array:
    """(n_fine, n_coarse) from nodal values of a mesh of so many nodes to those on its uniform refinement."""
    n, n_fine = coarse, len(fine_points)
    sides = np.concatenate([fine_triangles[:, [a, b]] for a, b in ((0, 1), (1, 2), (2, 0))])
    half = (sides >= n).sum(axis=1) == 1
    pairs = np.unique(np.sort(sides[half], axis=1), axis=0)
    parents = pairs[np.argsort(pairs[:, 1], kind="stable"), 0]  # two of every new node
    rows = np.concatenate([np.arange(n), np.repeat(np.arange(n, n_fine), 2)])
    entries = np.concatenate([np.ones(n), np.full(len(parents), 0.5)])
    return sp.csr_array((entries, (rows, np.concatenate([np.arange(n), parents]))), shape=(n_fine, n))


INSIDE = -1e-10
"""Least barycentric coordinate of a point that counts as inside."""


def interpolation(mesh: TriangleGeometry, at: Array) -> sp.csr_array:
    """(q, n) matrix from nodal values of a P1 function to its values at the points `at` (q, 2).

    Where `at` are the nodes of a refinement of the mesh it is the exact prolongation.
    """
    found, weights = located(mesh, at)
    rows = np.repeat(np.arange(len(at)), 3)
    columns = mesh.triangles[found].ravel()
    return sp.csr_array((weights.ravel(), (rows, columns)), shape=(len(at), len(mesh.points)))


def located(mesh: TriangleGeometry, at: Array) -> tuple[Indices, Array]:
    """The triangle (q,) that each point lies in, or that is nearest to it, and its barycentric coordinates (q, 3)."""
    from scipy.spatial import cKDTree  # here, because a run imports this module and seldom needs it

    found = cKDTree(mesh.centres).query(at)[1]
    weights = mesh.barycentric(at, found)
    lost = np.flatnonzero(weights.min(axis=1) < INSIDE)
    if len(lost):
        import shapely

        found[lost] = shapely.STRtree(shapely.polygons(mesh.corners)).nearest(shapely.points(at[lost]))
        weights[lost] = mesh.barycentric(at[lost], found[lost])
    return found, weights
