"""A scene's load as a sum of basis loads, so that a sweep condenses each basis load once (method §4).

l_θ is affine in f, g, p, q, θ̄ and β: every number of the scene becomes a coefficient, and only what changes the
shape of a load (an expression, α, k, a region) becomes a new basis load. Basis loads are values: equal ones are one.

Also here: the cache by value in which a sweep keeps what such loads become.
"""

from __future__ import annotations

from collections.abc import Callable, Hashable, Iterator
from dataclasses import dataclass, replace
from typing import Any, Literal, TypeVar

from tcstudy.expressions.expression import Expression
from tcstudy.fem.forms import Conductivity
from tcstudy.scene.records import EdgeHeat, Role, Scalar, Scene

Roles = tuple[tuple[str, Role], ...]
Mechanical = Literal["body", "edge", "pressure", "force", "moment"]
Ratios = tuple[tuple[str, float], ...]


@dataclass(frozen=True)
class Datum:
    """What of a heat problem is given.

    kind:  "source", density of shape `data` in regions; "flux", the same into edges; "surroundings" at `data`, of
           edges or of all of Γ_θ; "held", `data` being the temperature of an edge
    where: names of the regions or edges
    """

    kind: Literal["source", "flux", "surroundings", "held"]
    data: Scalar
    where: tuple[str, ...] = ()

    @property
    def heats(self) -> bool:
        """Whether heat is put in."""
        return self.kind in ("source", "flux")


BATCH = 16
"""Columns that are carried through a factor together: more cost memory and gain nothing."""


@dataclass(frozen=True)
class Column:
    """Names one of the temperature fields of a heat problem, of which so many are listed at the start.

    k:      relative conductivities where they differ by region
    ratios: between the α of the edges, none if they are equal
    """

    k: Conductivity
    ratios: Ratios
    number: int
    listed: int

    @property
    def together(self) -> tuple[Column, ...]:
        """The columns that are computed with this one."""
        if self.number >= self.listed:
            return (self,)
        first = self.number - self.number % BATCH
        return tuple(replace(self, number=i) for i in range(first, min(first + BATCH, self.listed)))


Field = Expression | Column | None
"""A temperature field on the body: given, a column of a heat problem, or θ = 1."""


@dataclass(frozen=True)
class BasisLoad:
    """A load of no number but its shape.

    kind: "body", "edge": ∫f·v and, over the study edge `where`, ∫g·v; f or g of shape s along the axis a, data = (s, a)
          "pressure":     −∫ s n·v over an edge
          "force":        a resultant of 1 along the axis a, spread evenly over an edge
          "moment":       a moment of 1 about the middle of an edge
          "temperature":  ∫ θ tr ε(v) over regions (all without `where`) of the field `data`
          "prescribed":   −a(w_D, v) for μ = 1, w_D what the roles `data` prescribe; it scales with μ
    """

    kind: Mechanical | Literal["temperature", "prescribed"]
    data: Any = None
    where: tuple[str, ...] = ()


LoadTerm = tuple[BasisLoad, float]
"""A basis load and its coefficient."""


def split(scalar: Scalar) -> tuple[Scalar, float]:
    """A scalar as (shape, factor): numbers become factors of the unit shape 1."""
    return (scalar, 1.0) if isinstance(scalar, Expression) else (1.0, float(scalar))


def mechanical_terms(f: tuple[Scalar, Scalar], boundary: Roles) -> Iterator[LoadTerm]:
    """Terms of ∫f·v and of what loads all edges."""
    given: list[tuple[Mechanical, int | None, Scalar, str]] = [("body", axis, f[axis], "") for axis in (0, 1)]
    for name, role in boundary:
        given += [("force", axis, role.force[axis], name) for axis in (0, 1)]
        given += [("moment", None, role.moment or 0.0, name)]
        given += [("edge", axis, role.g[axis], name) for axis in (0, 1)]
        given += [("pressure", None, role.pressure, name)]
    for kind, axis, value, name in given:
        shape, factor = split(value)
        if factor != 0.0:
            yield BasisLoad(kind, (shape, axis), (name,)), factor


def loaded_by(scene: Scene, *, loads: bool = False) -> Scene:
    """The scene with its mechanical loads as they are or none, and nothing else: no given displacement, θ = 0."""
    boundary, none, body = [], (0.0, 0.0), scene.heat
    for name, role in scene.boundary:
        x, y = (None if one is None else 0.0 for one in role.u)
        kept = replace(role, u=(x, y))
        if not loads:
            kept = replace(kept, g=none, pressure=0.0, force=none, moment=role.moment and 0.0)
        if (own := kept.heat) is not None:
            theta, theta_bar = (None if one is None else 0.0 for one in (own.theta, own.theta_bar))
            kept = replace(kept, heat=EdgeHeat(theta, 0.0, own.alpha, theta_bar))
        boundary.append((name, kept))
    body = replace(body, theta=0.0) if body.theta is not None else replace(body, theta_bar=0.0, q=0.0)
    f = scene.f if loads else none
    return replace(scene, boundary=tuple(boundary), f=f, heat=body, load=1.0, unscaled=None)


def to_digits(ratio: float) -> float:
    """A ratio to 15 digits, so that numbers that vary together keep it whatever the rounding."""
    return float(f"{ratio:.14e}")


def exchange_level(scene: Scene) -> tuple[float, Ratios]:
    """α of the edge that exchanges most, and the α of all edges over it, to 15 digits; none where they are equal."""
    if not scene.heat_by_edge:
        return scene.heat.alpha, ()
    alpha = max((own for _, own, _ in scene.exchange), default=0.0)
    if alpha == 0.0:
        return alpha, ()
    ratios = tuple((edge, to_digits(own / alpha)) for edge, own, _ in scene.exchange)
    return alpha, ratios if any(ratio != 1.0 for _, ratio in ratios) else ()


def heat_shares(scene: Scene) -> tuple[float, list[tuple[Datum, float]]]:
    """θ of a scene without known temperature: a uniform part [K], and (datum, factor) of what is added to it.

    What is constant on all edges is the uniform part: then nothing is solved for it.
    """
    heat = scene.heat
    given: list[tuple[Datum, Scalar]] = [(Datum("surroundings", 1.0), heat.theta_bar)]
    if scene.heat_by_edge:
        given = [(Datum("surroundings", 1.0, (edge,)), bar) for edge, _, bar in scene.exchange]
        given += [(Datum("held", 1.0, (edge,)), theta) for edge, theta in scene.held_theta]
    numbers = [value for _, value in given if not isinstance(value, Expression)]
    uniform = float(numbers[0]) if len(numbers) == len(given) else 0.0
    given += [(Datum("source", 1.0, heat.omega), heat.q)]
    given += [(Datum("flux", 1.0, (edge,)), flux) for edge, flux in scene.flux]
    found = []
    for datum, value in given:
        shape, factor = split(value)
        if not datum.heats and shape == 1.0:
            factor -= uniform
        if factor != 0.0:
            found.append((replace(datum, data=shape), factor))
    return uniform, found


def relative_k(scene: Scene) -> Conductivity:
    """k over that of the material of the body, to 15 digits; () where it is the same everywhere."""
    k = scene.material.k
    if not k or not scene.material.regions:
        return ()
    return tuple((where, to_digits((own.k or 0.0) / k)) for where, own in scene.pieces)


T = TypeVar("T")


class Recent(dict[Hashable, T]):
    """Values by key, made on demand; all are let go of where the total size would pass `budget` bytes.

    Values that are still referenced elsewhere stay alive there: forgetting costs time later, never correctness.
    """

    def __init__(self, budget: float, size: Callable[[T], int]) -> None:
        super().__init__()
        self._budget, self._size, self._total = budget, size, 0

    def __setitem__(self, key: Hashable, value: T) -> None:
        self._total += self._size(value)
        if self._total > self._budget:
            self.clear()
            self._total = self._size(value)
        super().__setitem__(key, value)

    def of(self, key: Hashable, make: Callable[[], T]) -> T:
        """The value of `key`, made by `make` if it is not there."""
        if key not in self:
            self[key] = make()
        return self[key]
