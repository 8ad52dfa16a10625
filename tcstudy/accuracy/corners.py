"""Places where the solution of a body may be singular, and how much: its corners, ends and kinks of
interfaces.

A contact edge holds u_N; where its last nodes stick it holds u_T as well. Stick and slip are told
apart by the solution on the finest mesh, because the bound of the friction law, not the corner,
decides between them.

Exponents: u ~ r^α with the smallest positive Re α, θ ~ r^γ with the smallest positive γ.

Around a place lie wedges, each of one material. In the wedge 0 < φ < ω Airy's stress function
r^{α+1} F(φ), F = A cos(α+1)φ + B sin(α+1)φ + C cos(α−1)φ + D sin(α−1)φ, gives with κ = (λ+3μ)/(λ+μ)

    σ_φφ ∝ (α+1) F,  σ_rφ ∝ −F′,
    2μ u_r = −(α+1) F + (κ+1)(C cos(α−1)φ + D sin(α−1)φ),  2μ u_φ = −F′ + (κ+1)(C sin(α−1)φ − D cos(α−1)φ).

With M(φ) from (A, B, C, D) to s = (u_r, u_φ, σ_rφ, σ_φφ), M(ω) M(0)⁻¹ carries s through the wedge,
and s goes on at an
interface. So with T the product over the wedges, the exponents are the zeros of det(R₂ T N₁), N₁ a
basis of the s that
the condition of the first side allows and R₂ what that of the last side makes vanish; of det(T − 1)
where the wedges
close. Heat alike, with s = (θ, k ∂_φ θ/γ) and the rotation by γω.
Literature: M. L. Williams, J. Appl. Mech. 19 (1952) 526–528; D. B. Bogy, J. Appl. Mech. 38 (1971)
377–386;
R. B. Kellogg, Appl. Anal. 4 (1975) 101–129.
Left out: exponents at which u is a polynomial (0, 1), and logarithms at double roots.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache, reduce
from itertools import groupby

import numpy as np
from numpy.typing import NDArray

from tcstudy.laws.composed import EdgeLaws
from tcstudy.scene.records import BODY, Clamped, Contact, Point, Rigid, Role, Scene
from tcstudy.shapes.edges import Junction, Side

Array = NDArray[np.float64]
Sticks = Callable[[str, Point], bool]
"""Whether the contact edge sticks near a point."""


def sticking_near(edges: Sequence[str], xy: Array, sticks: NDArray[np.bool_]) -> Sticks:
    """Whether that contact node of an edge sticks which is nearest to a point; edges: (m,) names,
    xy: (m, 2) places."""
    names = np.array(edges, dtype=str)

    def near(edge: str, at: Point) -> bool:
        own = np.flatnonzero(names == edge)
        return len(own) > 0 and bool(
            sticks[own[np.argmin(np.linalg.norm(xy[own] - np.array(at), axis=1))]]
        )

    return near


@dataclass(frozen=True)
class Vertex:
    """A corner of the body, or a point where materials meet.

    at:       its place;  angle: opening angle inside the body [rad], 2π within it
    words:    conditions of the edges that meet in words, none within the body
    exponent: u ~ r^exponent, SMOOTH if the corner leaves u smooth, NaN in a cusp;  heat: θ ~ r^heat, likewise
    steps:    the shear stress has a step there, or may have, and Γ_C meets it
    meeting:  regions around it, counter-clockwise, where materials differ
    """

    at: Point
    angle: float
    words: tuple[str, ...]
    exponent: float
    heat: float
    steps: bool = False
    meeting: tuple[str, ...] = ()


THINNEST = 1e-3
"""Angle [rad] below which two edges meet in a cusp, and by which two make a corner."""


def vertices(corners: Iterable[Junction], scene: Scene, sticks: Sticks) -> list[Vertex]:
    """The corners of the body, and the places where interfaces of materials end, turn or meet."""
    found = (_vertex(corner, scene, sticks) for corner in corners)
    return [one for one in found if one is not None]


def _vertex(corner: Junction, scene: Scene, sticks: Sticks) -> Vertex | None:
    """None where nothing but an interface of one material ends or goes straight on."""
    own, rest, roles = (
        dict(scene.material.regions),
        replace(scene.material, regions=()),
        dict(scene.boundary),
    )
    parts = [(region if region in own else BODY, angle) for angle, region in corner.wedges]
    if corner.within:  # from an interface on
        first = next((i for i, (name, _) in enumerate(parts) if name != parts[i - 1][0]), 0)
        parts = [*parts[first:], *parts[:first]]
    of = [
        (name, math.fsum(angle for _, angle in group))
        for name, group in groupby(parts, lambda part: part[0])
    ]
    wedges = [(angle, own.get(name, rest)) for name, angle in of]
    one_material = len({material for _, material in wedges}) == 1
    if corner.within and (
        one_material or (len(wedges) == 2 and abs(wedges[0][0] - math.pi) < THINNEST)
    ):
        return None
    if corner.cut and not corner.within and len(wedges) == 1:
        return None
    bound = [side for side in corner.sides if side.name]
    sides = () if corner.within else (bound[0], bound[-1])
    held = [_condition(roles[side.name], side, corner.at, sticks) for side in sides]
    words, unit = tuple(said for _, said in held), wedges[0][1].mu
    cusp, exponent, heat = min(angle for angle, _ in wedges) < THINNEST, math.nan, SMOOTH
    if not cusp:
        elastic = tuple(
            (round(w, 12), m.mu / unit, (m.lam + 3 * m.mu) / (m.lam + m.mu)) for w, m in wedges
        )
        exponent = corner_exponent(elastic, *(directions for directions, _ in held))
    if not cusp and scene.conducts and scene.heat.theta is None:
        given = [
            (edge := roles[side.name].heat) is not None and edge.theta is not None for side in sides
        ]
        heat = heat_exponent(tuple((round(w, 12), m.k or 1.0) for w, m in wedges), *given)
    free = [m.beta / (m.lam + m.mu) for _, m in wedges]  # expansion, over θ/2
    if (scene.conducts or scene.heat.theta) and max(free) - min(free) > 1e-12 * max(map(abs, free)):
        exponent = min(exponent, 1.0)  # u ~ r log r
    contact = any(isinstance(roles[side.name], Contact) for side in sides)
    laws = isinstance(scene.friction, EdgeLaws) and len({side.name for side in sides}) > 1
    steps = contact and (set(words) != {"slipping contact"} or not one_material or laws)
    meeting = () if one_material else tuple(name for name, _ in of)
    return Vertex(
        corner.at, math.fsum(angle for angle, _ in wedges), words, exponent, heat, steps, meeting
    )


def _condition(
    role: Role, side: Side, at: Point, sticks: Sticks
) -> tuple[tuple[Direction, ...], str]:
    """Held directions in the polar frame of a side, and the condition in words."""
    if isinstance(role, Contact):
        return (
            (CLAMPED, "sticking contact")
            if sticks(side.name, at)
            else (SLIDING, "slipping contact")
        )
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
    where = f"at ({x:.4g}, {y:.4g})"
    corner = f"{'–'.join(vertex.words)} corner of {math.degrees(vertex.angle):.4g}°"
    if not vertex.meeting:
        return f"{corner} {where}"
    met = " and ".join(dict.fromkeys(vertex.meeting))
    return f"{met} meeting {f'in a {corner} ' if vertex.words else ''}{where}"


Complex = NDArray[np.complex128]
Direction = tuple[float, float]
"""A held direction in the polar frame (e_r, e_φ) of a side."""
Held = tuple[Direction, ...]
"""Directions held on a side: none where it is free, two where it is clamped."""

FREE: Held = ()
CLAMPED: Held = ((1.0, 0.0), (0.0, 1.0))
SLIDING: Held = ((0.0, 1.0),)
"""u_N = 0 without (or with a bounded, smooth) tangential traction."""

SMOOTH = 2.0
"""Exponent that stands for a corner without any below it: P1 elements cannot tell it from a smooth
solution."""


@lru_cache(maxsize=256)
def corner_exponent(wedges: tuple[tuple[float, float, float], ...], *sides: Held) -> float:
    """Smallest Re α in (0, SMOOTH) of u ~ r^α, SMOOTH if there is none.

    wedges: opening angle [rad], shear modulus, κ of each, counter-clockwise;  sides: what is held on the first and on
    the last side, nothing where the wedges close
    """

    def carried(alpha: Complex) -> list[Complex]:
        return [_carried(alpha, *wedge) for wedge in wedges]

    # a rotation of the whole is a zero at 1 of several orders where the wedges close, known to few
    # digits
    ends = (_allowed(sides[0]), _vanishing(sides[1])) if sides else None
    return _least_exponent(carried, ends, SMOOTH, 1e-5 if sides else 1e-2)


@lru_cache(maxsize=256)
def heat_exponent(wedges: tuple[tuple[float, float], ...], *given: bool) -> float:
    """Smallest γ in (0, 1) of θ ~ r^γ, SMOOTH if there is none.

    wedges: opening angle [rad], conductivity of each;  given: whether θ is, on the first and on the last side (else
    the flux), nothing where the wedges close
    """

    def carried(gamma: Complex) -> list[Complex]:
        turned = [(np.cos(gamma * angle), np.sin(gamma * angle), k) for angle, k in wedges]
        return [np.moveaxis(np.array([[c, s / k], [-k * s, c]]), -1, 0) for c, s, k in turned]

    ends = (np.eye(2)[:, [int(given[0])]], np.eye(2)[[int(not given[1])]]) if given else None
    return _least_exponent(carried, ends, 1.0, 1e-6)


def _least_exponent(
    carried: Callable[[Complex], list[Complex]],
    ends: tuple[Array, Array] | None,
    most: float,
    near: float,
) -> float:
    """The smallest real part of the zeros of det(R₂ T N₁), or of det(T − 1) without ends; SMOOTH if
    there is none.

    carried: exponents (n,) → (n, k, k) what carries through every wedge;  ends: N₁ and R₂
    """

    def determinant(exponent: Complex) -> Complex:
        through = reduce(lambda before, wedge: wedge @ before, carried(exponent))
        closed = (
            through - np.eye(through.shape[-1]) if ends is None else ends[1] @ through @ ends[0]
        )
        return np.asarray(np.linalg.det(closed))

    return float(min((root.real for root in _roots(determinant, most, near)), default=SMOOTH))


def _carried(alpha: Complex, angle: float, mu: float, kappa: float) -> Complex:
    """(n, 4, 4) M(ω) M(0)⁻¹ of a wedge."""
    plus, minus, zero = (alpha + 1) * angle, (alpha - 1) * angle, np.zeros_like(alpha)
    cos_m, sin_m = np.cos(minus), np.sin(minus)
    F = np.array([np.cos(plus), np.sin(plus), cos_m, sin_m])
    dF = np.array(
        [-(alpha + 1) * F[1], (alpha + 1) * F[0], -(alpha - 1) * sin_m, (alpha - 1) * cos_m]
    )
    u_r = -(alpha + 1) * F + (kappa + 1) * np.array([zero, zero, cos_m, sin_m])
    u_phi = -dF + (kappa + 1) * np.array([zero, zero, sin_m, -cos_m])
    there = np.array([u_r / (2 * mu), u_phi / (2 * mu), -dF, (alpha + 1) * F])
    one = np.ones_like(alpha) / (kappa + 1)
    C = np.array([2 * mu * one, zero, zero, one])  # from u_r, u_φ, σ_rφ, σ_φφ at φ = 0
    D = np.array([zero, -2 * mu * one, one, zero])
    A = np.array([zero, zero, zero, 1 / (alpha + 1)]) - C
    B = (np.array([zero, zero, -1 + zero, zero]) - (alpha - 1) * D) / (alpha + 1)
    return np.asarray(np.einsum("ijn,jkn->nik", there, np.array([A, B, C, D])))


def _allowed(held: Held) -> Array:
    """(4, 2) basis of the (u_r, u_φ, σ_rφ, σ_φφ) that a side allows."""
    if len(held) != 1:
        return np.eye(4)[:, 2:] if held else np.eye(4)[:, :2]
    ((a, b),) = held
    return np.array([[-b, 0.0], [a, 0.0], [0.0, a], [0.0, b]])


def _vanishing(held: Held) -> Array:
    """(2, 4) what of them vanishes on a side: what one allows that holds the other directions."""
    other = tuple((b, -a) for a, b in held) if len(held) == 1 else FREE if held else CLAMPED
    return _allowed(other).T


def _roots(function: Callable[[Complex], Complex], most: float, near: float) -> list[complex]:
    """Zeros in 0 < Re α < most but 1, and not so near the ends: Newton's method from a grid of
    starts."""
    real, imaginary = np.meshgrid(np.linspace(0.05, most, 40), np.linspace(0.0, 1.6, 9))
    alpha: Complex = (real + 1j * imaginary).ravel().astype(np.complex128)
    step, eps = np.full(alpha.shape, np.inf, dtype=complex), 1e-6
    with np.errstate(all="ignore"):
        for _ in range(60):
            on = np.abs(step) > 1e-12
            value, right, left = np.split(
                function(np.concatenate([alpha[on] + d for d in (0.0, eps, -eps)])), 3
            )
            newton = value * 2 * eps / (right - left)
            step[on] = newton = np.where(
                np.isfinite(newton), newton, 1.0
            )  # where the slope vanishes
            moved = alpha[on] - newton * np.minimum(1.0, 0.3 / np.maximum(np.abs(newton), 1e-300))
            alpha[on] = np.where(np.abs(moved) < 20, moved, 20.0)
    found: list[complex] = []
    for root in alpha[np.abs(step) < 1e-6]:
        inside = 1e-3 < root.real < most - near and abs(root.imag) < 3
        if inside and abs(root - 1) > near and all(abs(root - other) > 1e-6 for other in found):
            found.append(complex(root))
    return found
