"""What is proved of the body, not of its mesh: λ₁ from both sides.

λ₁ = min a(v,v)/‖v_T‖² over Γ_C decides uniqueness: one solution for every ω < λ₁. P1 displacements are a subset, so
that λ_min(Ã, M) with the exact mass matrix M of Γ_C bounds it from above. From below, with λ̂ of the equilibrium
elements: 1/λ₁ = sup_g ‖u_g‖²_a/‖g‖² over tangential tractions g; split g = πg + (g − πg), π the L² projection onto
linear functions on every segment. ‖u_πg‖² ≤ ‖πg‖²/λ̂, as the dual overestimates compliance, ‖u_{g−πg}‖ ≤ C‖g − πg‖ with
C² = max_K Σ_e sup_v ‖(I − π)v_T‖²_e/a_K(v,v), so that
    λ̂/(1 + C²λ̂) ≤ λ₁ ≤ λ_min(Ã, M).
A triangle gives C² ≤ C₀² h_e/2μ, C₀ of its shape alone. C₀ is bounded without a constant of Korn: refine the triangle k
times, and its parts at e are copies of it, 2⁻ᵏ as large; hence C₀² ≤ ν_k + 2⁻ᵏC₀², ν_k that of piecewise πv on the
equilibrium elements of the refinement. A triangle that holds a smaller one on the same edge has no greater constant, so
that a few shapes serve all. All up to rounding, which is estimated.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np
import scipy.linalg
import scipy.sparse as sp
from numpy.typing import NDArray
from scipy.sparse.linalg import LinearOperator, eigsh

from tcstudy.contact.problem import least_eigenpair
from tcstudy.errors import GeometryFailed
from tcstudy.fem.boundary import ContactLine
from tcstudy.fem.meshes import PlaneMesh
from tcstudy.fem.rigid import edge_arms, unknown
from tcstudy.offline.equilibrium import (
    Elements,
    EquilibriumBody,
    Supports,
    equilibrium_body,
)
from tcstudy.scene.records import Point, Rigid, Role, Scene
from tcstudy.shapes.triangles import GAUSS, TriangleGeometry

Array = NDArray[np.float64]
Indices = NDArray[np.intp]

ROUNDINGS = 4.0
"""Of K̂, by which the error of λ̂ is estimated."""
LEAST_ERROR, STEPS = 1e-9, 300
"""Relative error of λ̂ that is tried to prove, and most steps of inverse iteration."""
DENSE = 500
"""Points of Γ_C up to which all eigenvalues are as cheap."""
REFINED = 3
"""Times that a triangle is refined for its constant."""
SHAPES = 16
"""Shapes of triangles are told apart by so many places along the edge, and their heights by as many a factor of e."""


@dataclass(frozen=True)
class Band:
    """low ≤ λ₁ of the body ≤ high [Pa/m];  hat: λ̂ of the equilibrium elements, nearer to λ₁ than λ₁ of P1."""

    low: float
    hat: float
    high: float

    def times(self, factor: float) -> Band:
        """That of a body which is so many times as stiff."""
        return Band(self.low * factor, self.hat * factor, self.high * factor)

    def numbers(self, omega: Array | float, factor: Array | float = 1.0) -> dict[str, Any]:
        """What is stored of it; ω of the law [Pa/m], and how many times as stiff the bodies are."""
        low, high, hat = (value * factor for value in (self.low, self.high, self.hat))
        proved = np.less(omega, low)
        return {"lambda_1_low": low, "lambda_1_high": high, "lambda_1_dual": hat, "proved_unique": proved}


def dual_body(mesh: PlaneMesh, scene: Scene, line: ContactLine) -> EquilibriumBody:
    """The equilibrium elements of a scene on a mesh, all moduli those of the scene."""
    supports, ties = _supports(mesh, scene.boundary, line)
    lam, mu = (mesh.of_material(scene, name) for name in ("lam", "mu"))
    return equilibrium_body(mesh, mesh.segments, lam, mu, supports, ties)


def lambda_1_band(body: EquilibriumBody, mesh: PlaneMesh, line: ContactLine, A_tilde: Array) -> Band:
    """λ₁ of the body from both sides. A_tilde: (m, m) that of P1 on the mesh with the moduli of `body` [Pa]"""
    hat, x, error = _proved_least(body.A_hat, body.c)
    whole = body.condensation.expand(x)
    error += ROUNDINGS * float(np.finfo(float).eps) * float(body.diagonal @ whole**2) / hat
    lam, mu = body.elements.lam, body.elements.mu
    C2 = neglected(mesh, line, np.minimum(mu, lam + mu))
    high = _least_quotient(A_tilde, mass_of(line))
    return Band(hat * (1.0 - error) / (1.0 + C2 * hat), hat, high * (1.0 + error))


def _proved_least(A: Array, c: Array) -> tuple[float, Array, float]:
    """(λ, x, error) of the least λ with Ax = λCx: no eigenvalue is below λ(1 − error), by a Cholesky factorisation."""
    if len(c) <= DENSE:
        return least_eigenpair(A, c)
    root = 1.0 / np.sqrt(c)
    scaled = A * root[:, None] * root
    factor = scipy.linalg.cho_factor(scaled, lower=True)
    inverse = LinearOperator(A.shape, matvec=lambda x: scipy.linalg.cho_solve(factor, x), dtype=float)
    values, vectors = eigsh(inverse, k=1, which="LA", v0=np.ones(len(c)), tol=LEAST_ERROR)
    value, error = 1.0 / float(values[0]), LEAST_ERROR
    while scipy.linalg.lapack.dpotrf(scaled - (1.0 - error) * value * np.eye(len(c)), lower=1)[1] and error < 1.0:
        error *= 10.0
    return value, root * vectors[:, 0], error


def _least_quotient(A: Array, M: Array) -> float:
    """vᵀAv/vᵀMv after inverse iteration: the least eigenvalue, and no less than it whatever v is."""
    factor, v, value, before = scipy.linalg.cho_factor(A, lower=True), np.ones(len(A)), np.inf, np.inf
    for _ in range(STEPS):
        v = scipy.linalg.cho_solve(factor, M @ v)
        before, value = value, float(v @ A @ v) / float(v @ M @ v)
        v /= np.linalg.norm(v)
        if not value < before * (1.0 - 1e-13):
            break
    return min(value, before)


def require_straight(mesh: PlaneMesh) -> None:
    """Raise GeometryFailed for curved edges: their polygon is another body."""
    curved = sorted({curve.name for curve in mesh.geometry.curves if not curve.straight})
    if curved:
        what = f"a guarantee needs straight edges, but the mesh of {', '.join(curved)} is another body"
        raise GeometryFailed(f"{what}; draw straight edges, or leave guarantee out", ("mesh", "guarantee"))


def mass_of(line: ContactLine) -> Array:
    """(m, m) ∫_{Γ_C} φ_i φ_j of P1 [m]."""
    ends, length = line.unknowns, np.hypot(*(line.ends[:, 1] - line.ends[:, 0]).T)
    M = np.zeros((line.m + 1, line.m + 1))  # what is held goes to the last row
    for i in (0, 1):
        for j in (0, 1):
            np.add.at(M, (ends[:, i], ends[:, j]), length / (3.0 if i == j else 6.0))
    return M[:-1, :-1]


def _supports(
    mesh: PlaneMesh, boundary: tuple[tuple[str, Role], ...], line: ContactLine
) -> tuple[Supports, sp.csr_array | None]:
    """What holds the boundary segments of a mesh, and T of its rigid edges."""
    s = len(mesh.segments)
    along = mesh.points[mesh.segments[:, 1]] - mesh.points[mesh.segments[:, 0]]
    t = along / np.hypot(*along.T)[:, None]
    tn = np.stack([t, np.column_stack([t[:, 1], -t[:, 0]])], axis=2)
    axes, held, springs = np.tile(np.eye(2), (s, 1, 1)), np.zeros((s, 2), dtype=bool), np.zeros((s, 2))
    tied = []
    for name, role in boundary:
        on, given = mesh.on(name), np.array([component is not None for component in role.u])
        if role.frame == "nt":
            axes[on], held[on], springs[on] = tn[on], given[::-1], role.spring[::-1]
        else:
            held[on] = given
        if isinstance(role, Rigid):
            tied.append((name, role))
    return Supports(axes, held, springs, line.which), _ties(mesh, tied) if tied else None


def _ties(mesh: PlaneMesh, rigid: list[tuple[str, Rigid]]) -> sp.csr_array:
    """T of w = T w': the displacements of a rigid edge in rows of its first segment, a_x, a_y and, if it turns, φℓ."""
    edges, sides = mesh.edges
    e = len(edges)
    rest, parts = np.ones(4 * e, dtype=bool), []
    for name, role in rigid:
        number = sides.ravel()[mesh.sides_at(mesh.segments[mesh.on(name)])]
        ends = mesh.points[edges[number]]
        at = ends[:, :1] + GAUSS[None, :, None] * (ends[:, 1:] - ends[:, :1])  # (k, 2, 2) by edge and Gauss point
        rows = 2 * e * np.arange(2) + number[:, None]
        nodes, _, arms = edge_arms(mesh, name)
        middle = mesh.points[nodes[0]] - arms[0]
        length = float(np.hypot(*arms.T).max())
        for c in unknown(role):
            parts.append((rows + c * e, np.full(rows.shape, number[0] + c * e), np.ones(rows.shape)))
            rest[rows + c * e] = False
            if role.moment is not None:
                arm = (at - middle)[..., 1 - c] * (-1.0 if c == 0 else 1.0) / length
                parts.append((rows + c * e, np.full(rows.shape, 2 * e + number[0]), arm))
    kept = np.flatnonzero(rest)
    row, column, value = (np.concatenate([a.ravel() for a in part]) for part in zip(*parts, strict=True))
    entries = (np.append(value, np.ones(len(kept))), (np.append(row, kept), np.append(column, kept)))
    return sp.csr_array(entries, shape=(4 * e, 4 * e))


# -- what linear tractions leave out ---------------------------------------------------------------


def neglected(mesh: PlaneMesh, line: ContactLine, stiffness: Array) -> float:
    """C² = max_K Σ_e sup_v ‖(I − π)v_T‖²_e/a_K(v,v) over triangles at Γ_C [m/Pa].

    stiffness: (t,) half the least of c, min(μ, λ + μ) [Pa]
    """
    owner, (a, b) = mesh.owner[line.which], np.moveaxis(line.ends, 1, 0)
    corners, ends = mesh.triangles[owner], line.segments
    apex = mesh.points[corners[(corners != ends[:, :1]) & (corners != ends[:, 1:])]]
    h = np.hypot(*(b - a).T)
    along, across = (b - a) / h[:, None], apex - a
    x = np.einsum("ij,ij->i", along, across) / h
    y = (along[:, 0] * across[:, 1] - along[:, 1] * across[:, 0]) / h
    shapes, which = np.unique(_smaller(x, y), axis=0, return_inverse=True)
    C2 = shape_constants(tuple(map(tuple, shapes.tolist())))[which]
    return float(np.bincount(owner, C2 * h / (2.0 * stiffness[owner])).max())


def _smaller(x: Array, y: Array) -> Array:
    """(n, 2) apexes of triangles on (0, 0), (1, 0) within those with apexes (x, y), of few kinds; by symmetry x ≤ ½."""
    x = np.minimum(x, 1.0 - x)
    low = np.exp(np.floor(np.log(y * (1.0 - 1.0 / SHAPES)) * SHAPES) / SHAPES)
    share = low / y  # at this height the triangle reaches from x·share to 1 − (1 − x)·share, 1/SHAPES wide or more
    at = np.ceil(x * share * SHAPES) / SHAPES
    assert np.all((x * share <= at) & (at <= 1.0 - (1.0 - x) * share))
    return np.column_stack([at, low])


CHILDREN = np.array([[0, 6, 5], [1, 2, 7], [8, 3, 4], [8, 6, 7]])
"""Sides of the four parts of a triangle: 0 to 5 are halves of its own sides, in order; the last part is in the middle,
its sides run backwards; it is turned by 180°, which leaves its stiffness as it is."""


@lru_cache(maxsize=64)
def shape_constants(shapes: tuple[Point, ...]) -> Array:
    """(n,) C₀²: ‖(I − π)v_T‖²_e ≤ C₀² h_e ‖ε(v)‖²_K for v_N = 0 on the side e of a triangle with its apex at (x, y)h_e.

    The stiffness of a refined triangle at its boundary is that of four parts, each refined once less.
    """
    n, none = len(shapes), np.zeros(len(shapes))
    points = np.stack([none, none, none + 1.0, none, *np.array(shapes).T], axis=1).reshape(-1, 2)
    apart = TriangleGeometry(points, np.arange(3 * n).reshape(n, 3))
    K = Elements(apart, none, none + 0.5, np.tile(np.eye(2), (3 * n, 1, 1))).stiffness()
    for level in range(REFINED):
        side = np.arange(2 * 2**level)  # Gauss points of a part's side
        whole = np.zeros((n, 18 * len(side), 18 * len(side)))
        for part, numbers in enumerate(CHILDREN):
            points_of = len(side) * numbers[:, None] + (side[::-1] if part == 3 else side)
            rows = (2 * points_of[..., None] + np.arange(2)).ravel()
            whole[:, rows[:, None], rows] += K
        K = _condensed(whole, np.arange(18 * len(side)) < 12 * len(side))
    k = 2 * 2**REFINED
    A = _condensed(K, (np.arange(6 * k) % 2 == 0) & (np.arange(6 * k) < 2 * k), held=slice(1, 2 * k, 2)) * k
    at = (np.arange(k // 2)[:, None] + GAUSS).ravel() / (k // 2)
    Q = np.linalg.qr(np.column_stack([np.ones(k), at]))[0]  # linear functions on e, rigid motion first
    trace = np.trace(A, axis1=1, axis2=2)[:, None, None]
    left = np.eye(k) - Q @ Q.T
    nu = np.linalg.eigvalsh(left @ np.linalg.inv(A + trace * np.outer(Q[:, 0], Q[:, 0])) @ left)[:, -1]
    return np.asarray(nu / (1.0 - 0.5**REFINED))


def _condensed(K: Array, keep: NDArray[np.bool_], held: slice = slice(0)) -> Array:
    """(n, m, m) K (n, r, r) condensed onto some rows, others held at 0."""
    inner = ~keep
    inner[held] = False
    k, i = np.flatnonzero(keep), np.flatnonzero(inner)
    K_ik = K[:, i[:, None], k]
    return np.asarray(K[:, k[:, None], k] - np.swapaxes(K_ik, 1, 2) @ np.linalg.solve(K[:, i[:, None], i], K_ik))
