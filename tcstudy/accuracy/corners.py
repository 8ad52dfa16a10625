"""Corner singularities: corners of a body, ends and kinks of interfaces, and their exponents.

A contact edge constrains u_N; where its last nodes stick it constrains u_T as well. Stick and slip
are told apart by the solution on the finest mesh, because the bound of the friction law, not the
corner, decides between them. So are closed and open where an edge may lift off: closed it
constrains u_N, open it does not, and its laws bound the tractions.

Exponents: u ~ r^α with the smallest positive Re α, θ ~ r^γ with the smallest positive γ.

Around a place lie wedges, each of one material. In the wedge 0 < φ < ω Airy's stress function
r^{α+1} F(φ), F = A cos(α+1)φ + B sin(α+1)φ + C cos(α−1)φ + D sin(α−1)φ, gives with κ = (λ+3μ)/(λ+μ)

    σ_φφ ∝ (α+1) F,  σ_rφ ∝ −F′,
    2μ u_r = −(α+1) F + (κ+1)(C cos(α−1)φ + D sin(α−1)φ),
    2μ u_φ = −F′ + (κ+1)(C sin(α−1)φ − D cos(α−1)φ).

With M(φ) from (A, B, C, D) to s = (u_r, u_φ, σ_rφ, σ_φφ), M(ω) M(0)⁻¹ carries s through the wedge,
and s goes on at an interface. So with T the product over the wedges, the exponents are the zeros of
det(R₂ T N₁), N₁ a basis of the s that the condition of the first side allows and R₂ the part of s
that that of the last side makes vanish; of det(T − 1) where the wedges close. Heat alike, with
s = (θ, k ∂_φ θ/γ) and the rotation by γω.

Literature: M. L. Williams, J. Appl. Mech. 19 (1952) 526–528; D. B. Bogy, J. Appl. Mech. 38 (1971)
377–386; R. B. Kellogg, Appl. Anal. 4 (1975) 101–129.
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
"""Whether the contact edge sticks near a point; of openings, whether it is closed there."""


def sticking_near(edges: Sequence[str], xy: Array, sticks: NDArray[np.bool_]) -> Sticks:
    """Return the function that says whether an edge's contact node nearest to a point sticks.

    edges: (m,) names of the nodes' edges;  xy: (m, 2) their places
    """
    names = np.array(edges, dtype=str)

    def near(edge: str, point: Point) -> bool:
        nodes = np.flatnonzero(names == edge)
        if not len(nodes):
            return False
        distances = np.linalg.norm(xy[nodes] - np.array(point), axis=1)
        return bool(sticks[nodes[np.argmin(distances)]])

    return near


NOWHERE = sticking_near((), np.empty((0, 2)), np.empty(0, dtype=bool))
"""Of a body whose contact edges do not lift off: no opening is closed."""


@dataclass(frozen=True)
class Vertex:
    """A corner of the body, or a point where materials meet.

    at:       its place
    angle:    opening angle inside the body [rad], 2π within it
    words:    conditions of the edges that meet in words, none within the body
    exponent: u ~ r^exponent, SMOOTH if the corner leaves u smooth, NaN in a cusp
    heat:     θ ~ r^heat, likewise
    steps:    the shear stress has a step there, or may have, and Γ_C meets it
    meeting:  regions around it, counter-clockwise, where materials differ
    closed:   an edge that may lift off is closed there
    parts:    an edge with a law of its opening is open there
    """

    at: Point
    angle: float
    words: tuple[str, ...]
    exponent: float
    heat: float
    steps: bool = False
    meeting: tuple[str, ...] = ()
    closed: bool = False
    parts: bool = False


THINNEST = 1e-3
"""Angle [rad] below which edges meet in a cusp, and within which two edges count as straight."""


def vertices(
    corners: Iterable[Junction], scene: Scene, sticks: Sticks, closed: Sticks = NOWHERE
) -> list[Vertex]:
    """Return the corners of the body and the places where interfaces end, turn or meet.

    closed: whether an edge that may lift off is closed near a point
    """
    candidates = [_vertex(corner, scene, sticks, closed) for corner in corners]
    return [vertex for vertex in candidates if vertex is not None]


def _vertex(corner: Junction, scene: Scene, sticks: Sticks, closed: Sticks) -> Vertex | None:
    """Return None where an interface only separates one material or goes straight on."""
    regions = _merged_wedges(corner, scene)
    materials = dict(scene.material.regions)
    body_material = replace(scene.material, regions=())
    wedges = [(angle, materials.get(name, body_material)) for name, angle in regions]
    one_material = len({material for _, material in wedges}) == 1
    if corner.within:
        is_straight = len(wedges) == 2 and abs(wedges[0][0] - math.pi) < THINNEST
        if one_material or is_straight:
            return None
    elif corner.cut and len(wedges) == 1:
        return None

    roles = dict(scene.boundary)
    sides: tuple[Side, ...] = ()
    if not corner.within:
        edge_sides = [side for side in corner.sides if side.name]
        sides = (edge_sides[0], edge_sides[-1])
    conditions = [_condition(roles[side.name], side, corner.at, sticks, closed) for side in sides]
    words = tuple(condition for _, condition in conditions)
    is_cusp = min(angle for angle, _ in wedges) < THINNEST
    exponent = math.nan
    heat = SMOOTH
    # where friction follows the pressure, slip couples both tractions
    is_coupled = scene.knows_pressure and "slipping contact" in words
    if not is_cusp and not is_coupled:
        unit = wedges[0][1].mu
        elastic = []
        for angle, material in wedges:
            lam, mu = material.lam, material.mu
            elastic.append((round(angle, 12), mu / unit, (lam + 3 * mu) / (lam + mu)))
        constraints = [directions for directions, _ in conditions]
        exponent = corner_exponent(tuple(elastic), *constraints)
    if not is_cusp and scene.conducts and scene.heat.theta is None:
        prescribed = [_has_prescribed_temperature(roles[side.name]) for side in sides]
        thermal = tuple((round(angle, 12), material.k or 1.0) for angle, material in wedges)
        heat = heat_exponent(thermal, *prescribed)
    # free thermal expansion, over θ/2
    expansions = [material.beta / (material.lam + material.mu) for _, material in wedges]
    has_temperature = scene.conducts or scene.heat.theta
    difference = max(expansions) - min(expansions)
    if has_temperature and difference > 1e-12 * max(map(abs, expansions)):
        exponent = min(exponent, 1.0)  # u ~ r log r
    has_contact = any(isinstance(roles[side.name], Contact) for side in sides)
    if scene.opens:
        has_contact &= any(_has_shear(scene, side.name) for side in sides)
    edges_that_open = [side.name for side in sides if side.name in scene.opening_edges]
    is_closed = [closed(edge, corner.at) for edge in edges_that_open]
    is_adhesive = [edge in scene.adhesive_edges for edge in edges_that_open]
    has_two_edges = len({side.name for side in sides}) > 1
    has_two_laws = isinstance(scene.friction, EdgeLaws) and has_two_edges
    only_slips = set(words) == {"slipping contact"}
    return Vertex(
        corner.at,
        math.fsum(angle for angle, _ in wedges),
        words,
        exponent,
        heat,
        steps=has_contact and (not only_slips or not one_material or has_two_laws),
        meeting=() if one_material else tuple(name for name, _ in regions),
        closed=any(is_closed),
        parts=any(np.array(is_adhesive, dtype=bool) & ~np.array(is_closed, dtype=bool)),
    )


def _merged_wedges(corner: Junction, scene: Scene) -> list[tuple[str, float]]:
    """Return (region, angle) of the wedges, neighbours of one region as one."""
    names = [name for name, _ in scene.material.regions]
    wedges = [(region if region in names else BODY, angle) for angle, region in corner.wedges]
    if corner.within:  # begin at an interface
        starts = [i for i, (name, _) in enumerate(wedges) if name != wedges[i - 1][0]]
        first = starts[0] if starts else 0
        wedges = [*wedges[first:], *wedges[:first]]
    merged = []
    for name, group in groupby(wedges, lambda wedge: wedge[0]):
        merged.append((name, math.fsum(angle for _, angle in group)))
    return merged


def _has_prescribed_temperature(role: Role) -> bool:
    return role.heat is not None and role.heat.theta is not None


def _condition(
    role: Role, side: Side, corner: Point, sticks: Sticks, closed: Sticks
) -> tuple[Held, str]:
    """Return the constrained directions in a side's polar frame, and the condition in words."""
    if isinstance(role, Contact):
        holds_normal = role.normal == "held" or (role.opens and closed(side.name, corner))
        if sticks(side.name, corner):
            return (
                (CLAMPED, "sticking contact")
                if holds_normal
                else (GUIDED, "sticking, open contact")
            )
        return (SLIDING, "slipping contact") if holds_normal else (FREE, "open contact")
    if isinstance(role, Rigid):  # it stays straight
        return CLAMPED, "rigid"
    if not isinstance(role, Clamped):
        return FREE, "traction"
    if None not in role.u:
        return CLAMPED, "clamped"
    constrains_first = role.u[0] is not None
    if role.frame == "nt":
        return (SLIDING, "roller") if constrains_first else (GUIDED, "guided")
    d = (1.0, 0.0) if constrains_first else (0.0, 1.0)
    e_r = side.away
    e_phi = (-e_r[1], e_r[0])
    radial = round(d[0] * e_r[0] + d[1] * e_r[1], 12)
    angular = round(d[0] * e_phi[0] + d[1] * e_phi[1], 12)
    return ((radial, angular),), "roller"


def _has_shear(scene: Scene, edge: str) -> bool:
    """Return whether friction or a load may put a shear stress on an edge."""
    laws = {name: law for name, law, _ in scene.friction_by_edge}
    if edge in laws:
        return not laws[edge].vanishes
    role = dict(scene.boundary)[edge]
    return role != role.without_loads()


def corner_words(vertex: Vertex) -> str:
    """Return which corner it is, in words."""
    x, y = vertex.at
    place = f"at ({x:.4g}, {y:.4g})"
    corner = f"{'–'.join(vertex.words)} corner of {math.degrees(vertex.angle):.4g}°"
    if not vertex.meeting:
        return f"{corner} {place}"
    regions = " and ".join(dict.fromkeys(vertex.meeting))
    if vertex.words:
        return f"{regions} meeting in a {corner} {place}"
    return f"{regions} meeting {place}"


Complex = NDArray[np.complex128]
Direction = tuple[float, float]
"""A constrained direction in the polar frame (e_r, e_φ) of a side."""
Held = tuple[Direction, ...]
"""Constrained directions of a side: none where it is free, two where it is clamped."""

FREE: Held = ()
CLAMPED: Held = ((1.0, 0.0), (0.0, 1.0))
SLIDING: Held = ((0.0, 1.0),)
"""u_N = 0 without (or with a bounded, smooth) tangential traction."""
GUIDED: Held = ((1.0, 0.0),)
"""u_T = 0 without (or with a bounded, smooth) normal traction."""

SMOOTH = 2.0
"""Exponent of a corner without any below it.

P1 elements cannot tell it from a smooth solution.
"""


@lru_cache(maxsize=256)
def corner_exponent(wedges: tuple[tuple[float, float, float], ...], *sides: Held) -> float:
    """Return the smallest Re α in (0, SMOOTH) of u ~ r^α, SMOOTH if there is none.

    wedges: opening angle [rad], shear modulus, κ of each, counter-clockwise
    sides:  constrained directions of the first and the last side, nothing where the wedges close
    """

    def transfers(alpha: Complex) -> list[Complex]:
        return [_transfer(alpha, *wedge) for wedge in wedges]

    if not sides:
        # a rotation of the whole is a zero at 1 of several orders, known to few digits
        return _least_exponent(transfers, None, SMOOTH, 1e-2)
    ends = (_allowed(sides[0]), _vanishing(sides[1]))
    return _least_exponent(transfers, ends, SMOOTH, 1e-5)


@lru_cache(maxsize=256)
def heat_exponent(wedges: tuple[tuple[float, float], ...], *prescribed: bool) -> float:
    """Return the smallest γ in (0, 1) of θ ~ r^γ, SMOOTH if there is none.

    wedges:     opening angle [rad], conductivity of each
    prescribed: whether θ is prescribed (else the flux) on the first and the last side, nothing
                where the wedges close
    """

    def transfers(gamma: Complex) -> list[Complex]:
        matrices = []
        for angle, k in wedges:
            cosine = np.cos(gamma * angle)
            sine = np.sin(gamma * angle)
            rotation = np.array([[cosine, sine / k], [-k * sine, cosine]])
            matrices.append(np.moveaxis(rotation, -1, 0))
        return matrices

    if not prescribed:
        return _least_exponent(transfers, None, 1.0, 1e-6)
    allowed = np.eye(2)[:, [int(prescribed[0])]]
    vanishing = np.eye(2)[[int(not prescribed[1])]]
    return _least_exponent(transfers, (allowed, vanishing), 1.0, 1e-6)


def _least_exponent(
    transfers: Callable[[Complex], list[Complex]],
    ends: tuple[Array, Array] | None,
    limit: float,
    near: float,
) -> float:
    """Return the smallest real part of the zeros of det(R₂ T N₁), SMOOTH if there is none.

    Without ends it is that of det(T − 1).

    transfers: exponents (n,) → (n, k, k) that carry s through every wedge
    ends:      N₁ and R₂
    """

    def determinant(exponent: Complex) -> Complex:
        through = reduce(lambda before, wedge: wedge @ before, transfers(exponent))
        if ends is None:
            condition = through - np.eye(through.shape[-1])
        else:
            allowed, vanishing = ends
            condition = vanishing @ through @ allowed
        return np.asarray(np.linalg.det(condition))

    exponents = [root.real for root in _roots(determinant, limit, near)]
    return float(min(exponents, default=SMOOTH))


def _transfer(alpha: Complex, angle: float, mu: float, kappa: float) -> Complex:
    """Return (n, 4, 4) M(ω) M(0)⁻¹ of a wedge."""
    zero = np.zeros_like(alpha)
    cos_plus = np.cos((alpha + 1) * angle)
    sin_plus = np.sin((alpha + 1) * angle)
    cos_minus = np.cos((alpha - 1) * angle)
    sin_minus = np.sin((alpha - 1) * angle)
    F = np.array([cos_plus, sin_plus, cos_minus, sin_minus])
    dF_plus = [-(alpha + 1) * sin_plus, (alpha + 1) * cos_plus]
    dF_minus = [-(alpha - 1) * sin_minus, (alpha - 1) * cos_minus]
    dF = np.array([*dF_plus, *dF_minus])
    u_r = -(alpha + 1) * F + (kappa + 1) * np.array([zero, zero, cos_minus, sin_minus])
    u_phi = -dF + (kappa + 1) * np.array([zero, zero, sin_minus, -cos_minus])
    M = np.array([u_r / (2 * mu), u_phi / (2 * mu), -dF, (alpha + 1) * F])

    # A, B, C and D from u_r, u_φ, σ_rφ, σ_φφ at φ = 0
    unit = np.ones_like(alpha) / (kappa + 1)
    C = np.array([2 * mu * unit, zero, zero, unit])
    D = np.array([zero, -2 * mu * unit, unit, zero])
    A = np.array([zero, zero, zero, 1 / (alpha + 1)]) - C
    B = (np.array([zero, zero, -1 + zero, zero]) - (alpha - 1) * D) / (alpha + 1)
    return np.asarray(np.einsum("ijn,jkn->nik", M, np.array([A, B, C, D])))


def _allowed(constraints: Held) -> Array:
    """Return a (4, 2) basis of the (u_r, u_φ, σ_rφ, σ_φφ) that a side allows."""
    if len(constraints) != 1:
        return np.eye(4)[:, 2:] if constraints else np.eye(4)[:, :2]
    ((a, b),) = constraints
    return np.array([[-b, 0.0], [a, 0.0], [0.0, a], [0.0, b]])


def _vanishing(constraints: Held) -> Array:
    """Return (2, 4) the parts of (u_r, u_φ, σ_rφ, σ_φφ) that vanish on a side.

    They are those that a side with the other directions constrained allows.
    """
    if len(constraints) == 1:
        ((a, b),) = constraints
        return _allowed(((b, -a),)).T
    return _allowed(FREE if constraints else CLAMPED).T


def _roots(function: Callable[[Complex], Complex], limit: float, near: float) -> list[complex]:
    """Return zeros in 0 < Re α < limit but 1, and not close to the ends.

    They are sought by Newton's method from a grid of starts.
    """
    real, imaginary = np.meshgrid(np.linspace(0.05, limit, 40), np.linspace(0.0, 1.6, 9))
    alpha: Complex = (real + 1j * imaginary).ravel().astype(np.complex128)
    step = np.full(alpha.shape, np.inf, dtype=complex)
    eps = 1e-6
    with np.errstate(all="ignore"):
        for _ in range(60):
            moving = np.abs(step) > 1e-12
            start = alpha[moving]
            points = np.concatenate([start + offset for offset in (0.0, eps, -eps)])
            value, value_right, value_left = np.split(function(points), 3)
            newton = value * 2 * eps / (value_right - value_left)
            newton = np.where(np.isfinite(newton), newton, 1.0)  # where the slope vanishes
            step[moving] = newton
            damping = np.minimum(1.0, 0.3 / np.maximum(np.abs(newton), 1e-300))
            moved = start - newton * damping
            alpha[moving] = np.where(np.abs(moved) < 20, moved, 20.0)
    roots: list[complex] = []
    for root in alpha[np.abs(step) < 1e-6]:
        is_inside = 1e-3 < root.real < limit - near and abs(root.imag) < 3
        is_new = all(abs(root - earlier) > 1e-6 for earlier in roots)
        if is_inside and abs(root - 1) > near and is_new:
            roots.append(complex(root))
    return roots
