"""Frozen records of a study in SI (or consistent) units, made by the reader and used by all rooms.

Symbols follow Šestak & Jovanović (2010): alpha, theta_bar, q, omega (the source region), f, g, k,
beta.
"""

from __future__ import annotations

from collections.abc import Callable, Collection
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, ClassVar, Literal, NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from tcstudy.expressions.expression import Scalar
from tcstudy.laws.composed import EdgeLaws, bonded_edges
from tcstudy.laws.laws import NONE, Laws
from tcstudy.laws.shapes import knows_pressure, unilateral

Array = NDArray[np.float64]
Point = tuple[float, float]


@dataclass(frozen=True)
class Edge:
    """A straight edge, or a circular arc through a third point.

    The next edge starts where this one ends.
    """

    start: Point
    end: Point
    name: str
    through: Point | None = None


@dataclass(frozen=True)
class Loop:
    """A closed chain of edges, counter-clockwise (outlines, holes and regions alike).

    turned: whether the study gives it clockwise
    """

    edges: tuple[Edge, ...]
    turned: bool = field(default=False, compare=False)

    @property
    def corners(self) -> tuple[tuple[Edge, Edge], ...]:
        """Every edge with the one after it."""
        next_edges = (*self.edges[1:], *self.edges[:1])
        return tuple(zip(self.edges, next_edges, strict=True))


@dataclass(frozen=True)
class Region:
    """A named part of the body, for heat sources and materials.

    moved: how far a corner was moved onto an edge that it nearly met [m]
    """

    name: str
    loop: Loop
    moved: float = field(default=0.0, compare=False)


@dataclass(frozen=True)
class BrepFace:
    """A plane face of a STEP or BREP file.

    face:    which face of it, from 0
    scale:   length of one unit of the file as the kernel gives it [m]
    edges:   name → points on it; the edge nearest to each point gets the name
    other:   name of all others
    written: unit that the study writes these points in, and its length [m]; ("", 1) of one without
             units
    """

    path: Path
    face: int
    scale: float
    edges: tuple[tuple[str, tuple[Point, ...]], ...]
    other: str | None
    written: tuple[str, float] = field(default=("", 1.0), compare=False)

    def in_words(self, length: float) -> str:
        """Return a length [m] in the unit of the study."""
        unit, metres = self.written
        return f"{length / metres:.3g} {unit}".rstrip()

    def entry(self, point: Point) -> str:
        """Return a point [m] as the study would write it under `edges`."""
        unit, metres = self.written
        coordinates = (f"{x / metres:.9g} {unit}".rstrip() for x in point)
        return f"[{', '.join(coordinates)}]"

    def place_in_words(self, point: Point) -> str:
        """Return a point [m] in the unit of the study."""
        unit, metres = self.written
        return f"({point[0] / metres:.6g}, {point[1] / metres:.6g}) {unit}".rstrip()


@dataclass(frozen=True)
class Body:
    """The body Ω: an outline with holes, or a face of a file; and its named regions."""

    outline: Loop | None
    holes: tuple[Loop, ...] = ()
    regions: tuple[Region, ...] = ()
    brep: BrepFace | None = None

    @property
    def loops(self) -> tuple[Loop, ...]:
        """The outline, if it has one, and the holes."""
        return self.holes if self.outline is None else (self.outline, *self.holes)

    @property
    def edges(self) -> tuple[Edge, ...]:
        """The edges of its loops."""
        return tuple(edge for loop in self.loops for edge in loop.edges)

    @property
    def curved_regions(self) -> tuple[str, ...]:
        """The regions with arcs, in place of which a mesh has polygons."""
        return tuple(
            region.name
            for region in self.regions
            if any(edge.through is not None for edge in region.loop.edges)
        )


@dataclass(frozen=True)
class EdgeHeat:
    """The thermal conditions of an edge: k∂θ/∂n = flux − α(θ − θ̄), or θ prescribed.

    theta:     temperature held on the edge; then nothing else is given [K]
    flux:      heat into the body [W/m²]
    alpha:     heat transfer coefficient; None for that of the section `heat` [W/(m² K)]
    theta_bar: temperature of the surroundings of the edge; None for that of the section `heat` [K]
    """

    theta: Scalar | None = None
    flux: Scalar = 0.0
    alpha: float | None = None
    theta_bar: Scalar | None = None


Given = tuple[Scalar | None, Scalar | None]


@dataclass(frozen=True)
class Direction:
    """A direction along an edge: x e_x + y e_y + normal n + tangential t, with t = (−n₂, n₁)."""

    x: float = 0.0
    y: float = 0.0
    normal: float = 0.0
    tangential: float = 0.0

    def at(self, normals: Array) -> Array:
        """Return the directions (…, 2) at points with the outward unit normals (…, 2)."""
        tangents = np.stack([-normals[..., 1], normals[..., 0]], axis=-1)
        fixed = np.array([self.x, self.y])
        return fixed + self.normal * normals + self.tangential * tangents


class TractionTerm(NamedTuple):
    """A term of the traction on an edge: value [Pa] times direction. key: the key that gives it."""

    key: str
    value: Scalar
    direction: Direction


@dataclass(frozen=True)
class Role:
    """The boundary condition type of an edge: constraints, loads, springs and thermal conditions.

    A kind of role has what its keys say. All else is as it is here, so that loads and supports of
    any edge can be asked for.

    word:     its name in a study
    u, frame: displacement [m], (u_x, u_y) or in the frame "nt" (u_N, u_T) of the edge; None is free
    g:        traction in x and y [Pa]
    pressure: positive when it pushes [Pa]
    force:    a resultant per unit thickness, uniformly distributed over the edge, or of a rigid
              one [N/m]
    moment:   about the middle of an edge that turns as a whole [N], None for one that does not
    spring:   (k_N, k_T), stiffness of the support per area [Pa/m]
    """

    word: ClassVar[str]
    loads: ClassVar[tuple[str, ...]] = ("g", "pressure", "force", "moment")
    """Fields that load the body; those with a traction have their terms in `traction_terms`."""
    u: Given = field(default=(None, None), kw_only=True)
    frame: Literal["xy", "nt"] = field(default="xy", kw_only=True)
    g: tuple[Scalar, Scalar] = field(default=(0.0, 0.0), kw_only=True)
    pressure: Scalar = field(default=0.0, kw_only=True)
    heat: EdgeHeat | None = field(default=None, kw_only=True)
    force: tuple[float, float] = field(default=(0.0, 0.0), kw_only=True)
    moment: float | None = field(default=None, kw_only=True)
    spring: tuple[float, float] = field(default=(0.0, 0.0), kw_only=True)

    @property
    def traction_terms(self) -> tuple[TractionTerm, ...]:
        """Return the terms whose sum is the traction on the edge, g − p n."""
        return (
            TractionTerm("g", self.g[0], Direction(x=1.0)),
            TractionTerm("g", self.g[1], Direction(y=1.0)),
            TractionTerm("pressure", self.pressure, Direction(normal=-1.0)),
        )

    def traction(self, normals: Array, values_of: Callable[[Scalar], Array]) -> Array:
        """Return the traction (…, 2) at points with the outward unit normals (…, 2) [Pa].

        values_of: from a number or an expression to its values (…) at the points
        """
        traction = np.zeros(normals.shape)
        for term in self.traction_terms:
            values = values_of(term.value)
            traction = traction + values[..., None] * term.direction.at(normals)
        return traction

    @property
    def loaded(self) -> bool:
        """Return whether a traction, a resultant or a moment acts on the edge."""
        resultants = (*self.force, self.moment or 0.0)
        return any(load != 0.0 for load in (*self._tractions, *resultants))

    @property
    def _tractions(self) -> tuple[Scalar, ...]:
        return tuple(term.value for term in self.traction_terms)

    def without_loads(self) -> Self:
        """Return the role without its loads; an edge that turns as a whole still does."""
        defaults: dict[str, Any] = {name: getattr(type(self), name) for name in self.loads}
        defaults["moment"] = self.moment and 0.0
        return replace(self, **defaults)

    @property
    def held(self) -> Given:
        """The components of u that an edge holds, in its frame; 0 where it rests on springs.

        A rigid edge holds them as a whole.
        """
        first, second = self.u
        first_k, second_k = self.spring
        return 0.0 if first_k > 0.0 else first, 0.0 if second_k > 0.0 else second


@dataclass(frozen=True)
class Clamped(Role):
    """Γ_D: prescribed displacement."""

    word = "clamped"
    u: Given = (0.0, 0.0)
    frame: Literal["xy", "nt"] = "xy"


@dataclass(frozen=True)
class Symmetry(Clamped):
    """A straight edge on which the body is mirrored: u_N = 0 and no shear."""

    word = "symmetry"
    u: Given = (0.0, None)
    frame: Literal["xy", "nt"] = "nt"


@dataclass(frozen=True)
class Rigid(Clamped):
    """An edge that moves as a whole.

    A component u is prescribed, or None: one unknown under a resultant `force`.
    """

    word = "rigid"
    u: Given = (None, None)


@dataclass(frozen=True)
class Loaded(Role):
    """An edge of Γ_N: σn = g − p n + force/|Γ| − k_N u_N n − k_T u_T t."""

    g: tuple[Scalar, Scalar] = (0.0, 0.0)
    pressure: Scalar = 0.0
    frame: Literal["xy", "nt"] = field(default="nt", kw_only=True)


@dataclass(frozen=True)
class Traction(Loaded):
    """Γ_N."""

    word = "traction"


Normal = Literal["held", "free", "unilateral", "adhesive"]
"""What a contact edge does along its normal: u_N = 0, S_N = 0, u_N ≤ 0, or S_N ∈ b̂_N(−u_N)."""


@dataclass(frozen=True)
class Contact(Role):
    """Γ_C: −S_T ∈ b̂(u_T), eq. (4), and along the normal what `normal` says.

    normal: "held", where u_N = 0; the edge has no u_N of its own to find. "free", "unilateral",
            or "adhesive" by a law of `Scene.adhesion`; then u holds nothing
    """

    word = "contact"
    u: Given = field(default=(0.0, None), kw_only=True)
    frame: Literal["xy", "nt"] = field(default="nt", kw_only=True)
    normal: Normal = field(default="held", kw_only=True)

    def __post_init__(self) -> None:
        u_N = 0.0 if self.normal == "held" else None
        object.__setattr__(self, "u", (u_N, None))

    @property
    def opens(self) -> bool:
        """Whether the edge may lift off: a law or a constraint of one side decides u_N."""
        return self.normal in ("unilateral", "adhesive")


@dataclass(frozen=True)
class Convection(Loaded):
    """Γ_θ: −k∂θ/∂n = α(θ − θ̄), eq. (5); loaded and supported as `Traction` is, or not at all."""

    word = "convection"


@dataclass(frozen=True)
class Free(Role):
    """Neither load nor, by itself, heat."""

    word = "free"


Boundary = tuple[tuple[str, Role], ...]
"""What every edge does, in the order of the study."""


def exchanges(role: Role) -> bool:
    """Return whether an edge is part of Γ_θ."""
    if isinstance(role, Convection):
        return True
    heat = role.heat
    return heat is not None and (heat.alpha, heat.theta_bar) != (None, None)


BODY = "body"
"""Name of what of the body no region takes; no region has it."""
Where = tuple[str, ...]
"""Names of regions, BODY for what is outside of all; () is the whole body."""


@dataclass(frozen=True)
class Material:
    """An isotropic material with the plane assumption, and the materials of regions.

    lam, mu: Lamé moduli of the plane problem (plane stress already folded into lam) [Pa]
    beta:      stress–temperature modulus of the plane problem, σ = cε − βθI, eq. (3) [Pa/K]
    k:         conductivity [W/(m K)], None if the study gives none
    E, nu:     the three-dimensional constants
    alpha_T:   coefficient of thermal expansion that beta follows from; None where beta is given
               [1/K]
    bulk_beta: the three-dimensional modulus that the study gives in place of alpha_T, else None
               [Pa/K]
    regions:   (region, material) of those that have their own
    """

    lam: float
    mu: float
    beta: float
    k: float | None
    E: float
    nu: float
    plane: Literal["strain", "stress"]
    regions: tuple[tuple[str, Material], ...] = ()
    alpha_T: float | None = None
    bulk_beta: float | None = None

    @classmethod
    def of(
        cls,
        E: float,
        nu: float,
        plane: Literal["strain", "stress"],
        k: float | None = None,
        alpha_T: float | None = 0.0,
        beta: float | None = None,
        lame: tuple[float, float] | None = None,
    ) -> Material:
        """Return the material of the plane problem.

        lame: λ and μ of the body, if they do not follow from E and ν

        λ = Eν/((1 + ν)(1 − 2ν)), μ = E/2(1 + ν). Plane strain keeps them, β = (3λ + 2μ) α_T, eq.
        (3); plane stress has λ → 2λμ/(λ + 2μ), β → 2μβ/(λ + 2μ) = E α_T/(1 − ν). A given beta is,
        as given λ and μ are, that of the body and is converted like them. Numbers may be complex
        (laws/composed.py).
        """
        if lame:
            lam, mu = lame
        else:
            lam = E * nu / ((1 + nu) * (1 - 2 * nu))
            mu = E / (2 * (1 + nu))
        bulk_beta = beta
        if bulk_beta is not None:
            alpha_T = None
            beta = bulk_beta if plane == "strain" else 2 * mu * bulk_beta / (lam + 2 * mu)
        elif alpha_T is not None:
            beta = (3 * lam + 2 * mu) * alpha_T if plane == "strain" else E * alpha_T / (1 - nu)
        if plane == "stress":
            lam = 2 * lam * mu / (lam + 2 * mu)
        beta = 0.0 if beta is None else beta
        return cls(lam, mu, beta, k, E, nu, plane, alpha_T=alpha_T, bulk_beta=bulk_beta)

    def with_number(self, value: float, name: str) -> Material:
        """Return the material with another E, nu, alpha_T, beta or k; those of regions stay."""
        numbers = {"E": self.E, "nu": self.nu, "k": self.k, "alpha_T": self.alpha_T}
        numbers["beta"] = self.bulk_beta if self.alpha_T is None else None
        new = Material.of(plane=self.plane, **(numbers | {name: value}))  # type: ignore[arg-type]
        if name not in ("E", "nu"):
            new = replace(new, lam=self.lam, mu=self.mu)
        return replace(new, regions=self.regions)

    @property
    def all(self) -> tuple[Material, ...]:
        """The material and those of the regions."""
        return (self, *(material for _, material in self.regions))

    @property
    def expands(self) -> bool:
        """Whether temperature loads the body."""
        return any(material.beta != 0.0 for material in self.all)


@dataclass(frozen=True)
class Heat:
    """The temperature above the stress-free state: known, or by conduction, eqs. (2), (5).

    theta:     a known temperature field; then nothing else here is used [K]
    alpha:     heat transfer coefficient on Γ_θ, where an edge has none of its own [W/(m² K)]
    theta_bar: temperature of the surroundings, where an edge has none of its own [K]
    q:         source density in ω [W/m³]
    omega:     names of the regions that make up ω; empty for the whole body
    """

    theta: Scalar | None = None
    alpha: float = 0.0
    theta_bar: Scalar = 0.0
    q: Scalar = 0.0
    omega: tuple[str, ...] = ()


@dataclass(frozen=True)
class Scene:
    """One complete problem: every number of one sweep point.

    adhesion: laws b_N of the opening s_N = −u_N ≥ 0 of the edges whose `normal` is "adhesive"
    load, unscaled: the factor by which the mechanical loads of another scene were multiplied, and
    that scene
    """

    body: Body
    boundary: Boundary
    material: Material
    f: tuple[Scalar, Scalar]
    heat: Heat
    friction: Laws | EdgeLaws
    load: float = 1.0
    unscaled: Scene | None = None
    adhesion: Laws | EdgeLaws | None = None

    @property
    def opens(self) -> bool:
        """Whether a contact edge may lift off the foundation."""
        return bool(self.opening_edges)

    @property
    def holds_normal(self) -> bool:
        """Whether u_N = 0 on all of Γ_C, as what is proved of the body assumes."""
        contact = (role for _, role in self.boundary if isinstance(role, Contact))
        return all(role.normal == "held" for role in contact)

    @property
    def adhesive_edges(self) -> tuple[str, ...]:
        """The names of the contact edges whose opening has a law of `adhesion`."""
        contact = ((name, role) for name, role in self.boundary if isinstance(role, Contact))
        return tuple(name for name, role in contact if role.normal == "adhesive")

    @property
    def opening_edges(self) -> tuple[str, ...]:
        """The names of the contact edges that may lift off, in the order of the study."""
        contact = ((name, role) for name, role in self.boundary if isinstance(role, Contact))
        return tuple(name for name, role in contact if role.opens)

    @property
    def opening_laws(self) -> EdgeLaws:
        """The law of the opening of every edge that may lift off, with its strength."""
        adhesion = self.adhesion
        edge_laws: tuple[tuple[str, Laws, Scalar], ...] = ()
        if isinstance(adhesion, EdgeLaws):
            edge_laws = adhesion.laws
        elif adhesion is not None:
            edge_laws = (("", adhesion, 1.0),)
        of_edge = {name: (law, strength) for name, law, strength in edge_laws}
        laws = list[tuple[str, Laws, Scalar]]()
        for name in self.opening_edges:
            law: Laws = unilateral()
            strength: Scalar = 1.0
            if name in self.adhesive_edges:
                law, strength = of_edge.get(name) or of_edge[""]
            laws.append((name, law, strength))
        return EdgeLaws(tuple(laws))

    @property
    def pieces(self) -> tuple[tuple[Where, Material], ...]:
        """The parts of the body, as names of regions, with their materials."""
        materials = dict(self.material.regions)
        if not materials:
            return (((), self.material),)
        others = [region.name for region in self.body.regions if region.name not in materials]
        pieces: list[tuple[Where, Material]] = [((BODY, *others), self.material)]
        pieces += [((name,), material) for name, material in self.material.regions]
        return tuple(pieces)

    @property
    def laws(self) -> tuple[Laws, ...]:
        """The friction law, or those of the edges."""
        if isinstance(self.friction, EdgeLaws):
            return tuple(law for _, law, _ in self.friction.laws)
        return (self.friction,)

    @property
    def resisting(self) -> frozenset[str]:
        """The contact edges whose friction resists slip."""
        return resisting_edges(self.boundary, bonded_edges(self.friction))

    @property
    def friction_by_edge(self) -> tuple[tuple[str, Laws, Scalar], ...]:
        """(edge, law, strength) of every contact edge."""
        if isinstance(self.friction, Laws):
            return tuple((edge, self.friction, 1.0) for edge in self.edges(Contact))
        laws = {edge: (law, strength) for edge, law, strength in self.friction.laws}
        of_all = laws.get("", (None, 1.0))
        edges = list[tuple[str, Laws, Scalar]]()
        for edge in self.edges(Contact):
            law, strength = laws.get(edge, of_all)
            if law is not None:
                edges.append((edge, law, strength))
        return tuple(edges)

    @property
    def pressed_friction(self) -> EdgeLaws | None:
        """The friction that acts only where its edge is pressed, b ≡ 0 on others; None without any.

        It is Coulomb's, and that of every edge that is unilateral.
        """
        return self._friction_of(True) if self.knows_pressure else None

    @property
    def bond_friction(self) -> Laws | EdgeLaws:
        """The friction that does not know the pressure, b ≡ 0 on edges that have the other one."""
        return self._friction_of(False) if self.knows_pressure else self.friction

    @property
    def knows_pressure(self) -> bool:
        """Whether friction acts only where an edge is pressed; then there is no energy."""
        edges = self.friction_by_edge
        return any(self._needs_pressure(edge, law) for edge, law, _ in edges)

    def _needs_pressure(self, edge: str, law: Laws) -> bool:
        role = dict(self.boundary)[edge]
        is_unilateral = isinstance(role, Contact) and role.normal == "unilateral"
        return knows_pressure(law) or (is_unilateral and not law.vanishes)

    def _friction_of(self, pressed: bool) -> EdgeLaws:
        """Return the laws of the edges that need the pressure, or of the others."""
        laws = []
        for edge, law, strength in self.friction_by_edge:
            is_counted = self._needs_pressure(edge, law) == pressed
            laws.append((edge, law, strength) if is_counted else (edge, NONE, 1.0))
        return EdgeLaws(tuple(laws))

    @property
    def one_law(self) -> Laws:
        """The law of all of Γ_C. Raises ValueError where it differs along Γ_C."""
        if isinstance(self.friction, EdgeLaws):
            raise ValueError("the friction law differs along the contact line")
        return self.friction

    def with_laws(self, change: Callable[[Laws], Laws]) -> Scene:
        """Return the same scene with every friction law changed, strengths as they are."""
        friction = self.friction
        if isinstance(friction, Laws):
            return replace(self, friction=change(friction))
        laws = tuple((edge, change(law), strength) for edge, law, strength in friction.laws)
        return replace(self, friction=EdgeLaws(laws))

    def edges(self, *kinds: type) -> tuple[str, ...]:
        """Return the names of the edges with one of these roles, in the order of the study."""
        return tuple(name for name, role in self.boundary if isinstance(role, kinds))

    @property
    def springs(self) -> tuple[tuple[str, float, float], ...]:
        """(edge, k_N, k_T) of the edges that rest on springs [Pa/m]."""
        return tuple((name, *role.spring) for name, role in self.boundary if any(role.spring))

    @property
    def heat_by_edge(self) -> bool:
        """Whether an edge has thermal conditions of its own."""
        return any(role.heat is not None for _, role in self.boundary)

    @property
    def exchange(self) -> tuple[tuple[str, float, Scalar], ...]:
        """(edge, α, θ̄) of Γ_θ, in the order of the study."""
        edges = list[tuple[str, float, Scalar]]()
        for name, role in self.boundary:
            if exchanges(role):
                heat = role.heat or EdgeHeat()
                theta_bar = self.heat.theta_bar if heat.theta_bar is None else heat.theta_bar
                edges.append((name, heat.alpha or self.heat.alpha, theta_bar))
        return tuple(edges)

    @property
    def held_theta(self) -> tuple[tuple[str, Scalar], ...]:
        """(edge, θ) of the edges whose temperature is prescribed, in the order of the study."""
        edges = list[tuple[str, Scalar]]()
        for name, role in self.boundary:
            if role.heat and role.heat.theta is not None:
                edges.append((name, role.heat.theta))
        return tuple(edges)

    @property
    def flux(self) -> tuple[tuple[str, Scalar], ...]:
        """(edge, heat into the body) of the edges with a prescribed flux, in the study's order."""
        edges = list[tuple[str, Scalar]]()
        for name, role in self.boundary:
            if role.heat and role.heat.flux != 0.0:
                edges.append((name, role.heat.flux))
        return tuple(edges)

    @property
    def conducts(self) -> bool:
        """Whether an edge decides the temperature: by exchanging heat, or by a prescribed θ."""
        return any(exchanges(role) for _, role in self.boundary) or bool(self.held_theta)


def is_clamped(boundary: Boundary) -> bool:
    """Return whether an edge holds both components, so that no rigid motion is left."""
    return any(None not in role.held for _, role in boundary)


def supports(boundary: Boundary) -> tuple[object, ...]:
    """Return the edges that hold a component, with the part of them that decides about motions."""
    edges = ((edge, role.frame, *(u is None for u in role.held)) for edge, role in boundary)
    return tuple(edge for edge in edges if edge[2:] != (True, True))


def resisting_edges(boundary: Boundary, bonded: Collection[str]) -> frozenset[str]:
    """Return the contact edges on which friction resists slip.

    bonded: names of `bonded_edges`, of one scene or of several
    """
    contact = frozenset(name for name, role in boundary if isinstance(role, Contact))
    return contact if "" in bonded else contact.intersection(bonded)
