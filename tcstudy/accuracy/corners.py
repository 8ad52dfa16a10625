"""Corners of a body with the conditions that meet there, and how singular the elastic solution is in each.

A contact edge holds u_N; where its last nodes stick it holds u_T as well. Stick and slip are told apart by the
solution on the finest mesh, because the bound of the friction law, not the corner, decides between them.

Exponents of the elastic solution in a corner: u ~ r^α with the smallest positive Re α.

In the sector 0 < φ < ω Airy's stress function r^{α+1} F(φ), F = A cos(α+1)φ + B sin(α+1)φ + C cos(α−1)φ + D sin(α−1)φ,
gives with κ = (λ+3μ)/(λ+μ)

    σ_φφ ∝ (α+1) F,  σ_rφ ∝ −F′,
    2μ u_r = −(α+1) F + (κ+1)(C cos(α−1)φ + D sin(α−1)φ),  2μ u_φ = −F′ + (κ+1)(C sin(α−1)φ − D cos(α−1)φ);

two homogeneous conditions on each side make a determinant whose zeros are the exponents.
Literature: M. L. Williams, J. Appl. Mech. 19 (1952) 526–528.
Left out: exponents at which u is a polynomial (0, 1), and logarithms at double roots.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from tcstudy.scene.records import Body, Clamped, Contact, Edge, Material, Point, Rigid, Role
from tcstudy.shapes.edges import edge_normal

Array = NDArray[np.float64]
Sticks = Callable[[str, Point], bool]
"""Whether the contact edge sticks near a point."""


def sticking_near(edges: Sequence[str], xy: Array, sticks: NDArray[np.bool_]) -> Sticks:
    """Whether that contact node of an edge sticks which is nearest to a point; edges: (m,) names, xy: (m, 2) places."""
    names = np.array(edges, dtype=str)

    def near(edge: str, at: Point) -> bool:
        own = np.flatnonzero(names == edge)
        return len(own) > 0 and bool(sticks[own[np.argmin(np.linalg.norm(xy[own] - np.array(at), axis=1))]])

    return near


@dataclass(frozen=True)
class Vertex:
    """A corner of the body.

    at:        its place;  angle: opening angle inside the body [rad]
    edges:     names of the edges that meet;  words: their conditions in words
    exponent:  u ~ r^exponent, SMOOTH if the corner leaves u smooth
    contact:   one of the edges is in contact
    """

    at: Point
    angle: float
    edges: tuple[str, str]
    words: tuple[str, str]
    exponent: float
    contact: bool

    @property
    def half_turns(self) -> float:
        """The opening angle over π."""
        return self.angle / math.pi


@dataclass(frozen=True)
class Side:
    """One side of a corner: the name of its edge, and its unit tangent there, away from the corner."""

    name: str
    away: Point


def vertices(body: Body, boundary: tuple[tuple[str, Role], ...], material: Material, sticks: Sticks) -> list[Vertex]:
    """All corners of a body given by edges; none for a body from a file, whose corners are not looked at."""
    if body.outline is None:
        return []
    roles, found = dict(boundary), []
    for loop, hole in [(body.outline, False), *((hole, True) for hole in body.holes)]:
        for before, after in (*loop.corners[-1:], *loop.corners[:-1]):
            # The body lies counter-clockwise of the edge at φ = 0: the one that leaves an outline's corner.
            edges, at = (before, after) if hole else (after, before), after.start
            zero, far = (Side(edge.name, _away(edge, at)) for edge in edges)
            found.append(vertex(at, zero, far, roles, material, sticks))
    return found


def vertex(at: Point, zero: Side, far: Side, roles: dict[str, Role], material: Material, sticks: Sticks) -> Vertex:
    """The corner between two sides; the body lies counter-clockwise of `zero`."""
    (a, b), (c, d) = zero.away, far.away
    angle = (math.atan2(d, c) - math.atan2(b, a)) % (2 * math.pi)
    angle = 2 * math.pi if angle < 1e-9 else angle
    (first, said), (second, told) = (_condition(roles[side.name], side, at, sticks) for side in (zero, far))
    kappa = (material.lam + 3 * material.mu) / (material.lam + material.mu)
    exponent = corner_exponent(round(angle, 12), first, second, kappa)
    contact = any(isinstance(roles[side.name], Contact) for side in (zero, far))
    return Vertex(at, angle, (zero.name, far.name), (said, told), exponent, contact)


def _away(edge: Edge, at: Point) -> tuple[float, float]:
    """Unit tangent of an edge at one of its ends, pointing away from the corner into the edge."""
    n = edge_normal(edge, np.array([at]))[0]
    forward = (-float(n[1]), float(n[0]))  # the normal lies to the right of the edge
    return forward if edge.start == at else (-forward[0], -forward[1])


def _condition(role: Role, side: Side, at: Point, sticks: Sticks) -> tuple[tuple[Direction, ...], str]:
    """Held directions in the polar frame of a side, and the condition in words."""
    if isinstance(role, Contact):
        return (CLAMPED, "sticking contact") if sticks(side.name, at) else (SLIDING, "slipping contact")
    if isinstance(role, Rigid):  # whatever it moves by, it is straight
        return CLAMPED, "rigid"
    if not isinstance(role, Clamped):
        return FREE, "traction"
    if None not in role.u:
        return CLAMPED, "clamped"
    if role.frame == "nt":
        return (SLIDING, "roller") if role.u[0] is not None else (((1.0, 0.0),), "guided")
    d = (1.0, 0.0) if role.u[0] is not None else (0.0, 1.0)
    e_r = side.away
    e_phi = (-e_r[1], e_r[0])
    local = (round(d[0] * e_r[0] + d[1] * e_r[1], 12), round(d[0] * e_phi[0] + d[1] * e_phi[1], 12))
    return (local,), "roller"


def corner_words(vertex: Vertex) -> str:
    """Which corner, in words."""
    x, y = vertex.at
    first, second = vertex.words
    return f"{first}–{second} corner of {180 * vertex.half_turns:.4g}° at ({x:.4g}, {y:.4g})"


def describe(vertex: Vertex) -> str:
    """A corner with its exponent, for the reason of an expected order."""
    return f"{corner_words(vertex)}: u ~ r^{vertex.exponent:.3f}"


Complex = NDArray[np.complex128]
Direction = tuple[float, float]
"""A held direction in the polar frame (e_r, e_φ) of a side."""

FREE: tuple[Direction, ...] = ()
CLAMPED: tuple[Direction, ...] = ((1.0, 0.0), (0.0, 1.0))
SLIDING: tuple[Direction, ...] = ((0.0, 1.0),)
"""u_N = 0 without (or with a bounded, smooth) tangential traction."""

SMOOTH = 2.0
"""Exponent that stands for a corner without any below it: P1 elements cannot tell it from a smooth solution."""


@lru_cache(maxsize=256)
def corner_exponent(angle: float, first: tuple[Direction, ...], second: tuple[Direction, ...], kappa: float) -> float:
    """Smallest Re α in (0, SMOOTH) of a sector of the given opening angle, SMOOTH if there is none.

    first, second: directions held at φ = 0 and φ = angle (none: free; two: clamped)
    """
    roots = _roots(angle, first, second, kappa)
    return float(min((root.real for root in roots), default=SMOOTH))


def _determinant(
    alpha: Complex, angle: float, first: Sequence[Direction], second: Sequence[Direction], kappa: float
) -> Complex:
    rows = [*_conditions(alpha, 0.0, first, kappa), *_conditions(alpha, angle, second, kappa)]
    return np.asarray(np.linalg.det(np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)))


def _conditions(alpha: Complex, phi: float, held: Sequence[Direction], kappa: float) -> list[list[Complex]]:
    """Two rows of coefficients of A, B, C, D that vanish on a side."""
    plus, minus = (alpha + 1) * phi, (alpha - 1) * phi
    cos_m, sin_m = np.cos(minus), np.sin(minus)
    F = [np.cos(plus), np.sin(plus), cos_m, sin_m]
    dF = [-(alpha + 1) * F[1], (alpha + 1) * F[0], -(alpha - 1) * sin_m, (alpha - 1) * cos_m]
    zero = np.zeros_like(alpha)
    moved_r, moved_phi = [zero, zero, cos_m, sin_m], [zero, zero, sin_m, -cos_m]
    u_r = [-(alpha + 1) * f + (kappa + 1) * g for f, g in zip(F, moved_r, strict=True)]
    u_phi = [-f + (kappa + 1) * g for f, g in zip(dF, moved_phi, strict=True)]
    stress_r, stress_phi = [-f for f in dF], [(alpha + 1) * f for f in F]
    if len(held) == 2:
        return [u_r, u_phi]
    if not held:
        return [stress_r, stress_phi]
    ((a, b),) = held
    return [
        [a * x + b * y for x, y in zip(u_r, u_phi, strict=True)],
        [-b * x + a * y for x, y in zip(stress_r, stress_phi, strict=True)],
    ]


def _roots(angle: float, first: Sequence[Direction], second: Sequence[Direction], kappa: float) -> list[complex]:
    """Zeros of the determinant in 0 < Re α < SMOOTH: Newton's method from a grid of starts."""
    real, imaginary = np.meshgrid(np.linspace(0.05, SMOOTH, 40), np.linspace(0.0, 1.6, 9))
    alpha: Complex = (real + 1j * imaginary).ravel().astype(np.complex128)
    step = np.full(alpha.shape, np.inf, dtype=complex)
    eps = 1e-6
    with np.errstate(all="ignore"):
        for _ in range(60):
            value, right, left = (_determinant(alpha + d, angle, first, second, kappa) for d in (0.0, eps, -eps))
            step = value * 2 * eps / (right - left)
            step = np.where(np.isfinite(step), step, 0.0)
            alpha = alpha - step * np.minimum(1.0, 0.3 / np.maximum(np.abs(step), 1e-300))
            alpha = np.where(np.abs(alpha) < 20, alpha, 20.0)
    found: list[complex] = []
    for root in alpha[np.abs(step) < 1e-8]:
        inside = 1e-3 < root.real < SMOOTH - 1e-6 and abs(root.imag) < 3
        if inside and abs(root - 1) > 1e-5 and all(abs(root - other) > 1e-6 for other in found):
            found.append(complex(root))
    return found
