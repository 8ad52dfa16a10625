"""An exact solution: loads under which it is one, whether a scene has them, and its numbers.

The loads under which a given u and θ are the solution: the method of manufactured solutions.

    σ = λ div u I + 2μ ε(u) − βθI,     f = −div σ in Ω,     g = σn on traction and convection edges,
    u on clamped edges (held components only),     q = −kΔθ in Ω,     θ̄ = θ + (k/α) ∂θ/∂n on Γ_θ,   eqs. (1)–(5)

All are expressions by symbolic differentiation. What vanishes to rounding at sample points becomes
the number 0, so that nothing is assembled for it; of expressions with abs, min or max only what
vanishes identically does, because samples may miss where they do not. Without a convection edge θ
is the known temperature, and no heat problem is solved. Left out: heat flux through other edges and
tractions on contact and free edges, which a scene cannot have; a body from a file, whose normals
are no expressions.

Normals as expressions: on a line n is constant, on an arc it is (x − centre)/radius. Several curves
get one field that is the normal of each on each, N = Σ w_i n_i / Σ w_i with w_i = Π_{j≠i} D_j,
where D_j vanishes on curve j only (Shepard's interpolation): what depends on n is then one
expression for all of them. Off the curves N means nothing.

Checks: what no load of a scene can give must vanish, and Γ_C must obey (4). Everything is sampled at SAMPLES points of
every edge, none of them an end, and on a grid in the body:
contact:  u_N = 0, −S_T ∈ b̂(u_T), and a given ξ is −S_T
free:     σn = 0; likewise the traction of a component that a clamped edge leaves free
heat:     ∂θ/∂n = 0 on edges without convection
values:   all derived fields are finite
kinks:    at abs, min and max the gradients of u and θ have no jump. A jump of ∇u would need a load on a line inside the
          body (u is continuous and the material is one, so σn is continuous across the line only if
          ∇u is).

Numbers, by quadrature that uses no discrete field: L_θ(u) = ½a(u,u) − ∫f·u − β∫θ div u − ∫g·u +
∫_{Γ_C} j(u_T) of a body with straight edges; ∫ξ over Γ_C; the length of Γ_C that slips; with these
the value of a goal, so that estimates can be compared with true errors.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, replace
from functools import cache, partial
from itertools import islice
from typing import cast

import numpy as np
from numpy.typing import NDArray

from tcstudy.accuracy.norms import LineFunction, integral
from tcstudy.expressions.expression import (
    NUMBER,
    ONE,
    ZERO,
    Expression,
    Term,
    call,
    derivative,
    gradient,
    number,
    scalar,
    term,
    value_and_gradient,
    value_of,
    variable,
)
from tcstudy.laws.composed import law_along
from tcstudy.laws.laws import Laws
from tcstudy.laws.pieces import UP
from tcstudy.scene.mesh_plan import Goal
from tcstudy.scene.records import (
    Body,
    Clamped,
    Contact,
    Convection,
    Edge,
    Free,
    Heat,
    Loaded,
    Material,
    Role,
    Scalar,
    Scene,
)
from tcstudy.scene.study import Exact
from tcstudy.shapes.edges import (
    INWARD,
    TriangleGeometry,
    body_size,
    edge_arc,
    edge_at,
    edge_distance,
    edge_length,
    edge_normal,
    grid,
    inside,
)
from tcstudy.shapes.faults import LARGEST, spot

Array = NDArray[np.float64]
Vector = tuple[Term, Term]

SAME = 9
"""Digits up to which normals, and centres over the size of the body, are compared."""
SAMPLES = 64


def body_edges(body: Body, names: Iterable[str] | None = None) -> list[tuple[Edge, bool]]:
    """Edges with the given names (all without), each with whether it is a hole's, so that the body
    is on its right."""
    assert body.outline is not None
    wanted = None if names is None else set(names)
    loops = [(body.outline, False), *((hole, True) for hole in body.holes)]
    return [
        (edge, hole)
        for loop, hole in loops
        for edge in loop.edges
        if wanted is None or edge.name in wanted
    ]


def edge_samples(edge: Edge, hole: bool, count: int = SAMPLES) -> tuple[Array, Array]:
    """Points (n, 2) inside an edge, its ends and middle avoided, and outward unit normals there (n,
    2)."""
    points = edge_at(edge, (np.arange(count) + 0.38) / count)
    return points, outward(edge, hole, points)


def outward(edge: Edge, hole: bool, points: Array) -> Array:
    """(n, 2) outward unit normals of the body at points of an edge; a hole's edges have the body on
    their right."""
    n = edge_normal(edge, points)
    return -n if hole else n


def normal_field(body: Body, edges: list[tuple[Edge, bool]]) -> Vector:
    """N = n on all the edges."""
    size = body_size(body)
    found: dict[tuple[float, ...], tuple[Vector, list[Edge]]] = {}
    for edge, hole in edges:
        if (arc := edge_arc(edge)) is None:
            n = edge_samples(edge, hole, 1)[1][0].tolist()
            key, vector = n, (number(n[0]), number(n[1]))
        else:
            sign, (along_x, along_y) = (
                math.copysign(1.0, arc.sweep) * (-1.0 if hole else 1.0),
                _from(*arc.center),
            )
            key = [
                arc.center[0] / size,
                arc.center[1] / size,
                arc.radius / size,
                sign,
            ]  # what tells normals apart
            vector = (sign / arc.radius * along_x, sign / arc.radius * along_y)
        found.setdefault(tuple(round(part, SAME) for part in key), (vector, []))[1].append(edge)
    normals, members = zip(*found.values(), strict=True)
    if len(normals) == 1:
        return cast("Vector", normals[0])
    off = [math.prod((size**-2 * _off(edge) for edge in own), start=ONE) for own in members]
    weights = [
        math.prod((D for j, D in enumerate(off) if j != i), start=ONE) for i in range(len(off))
    ]
    x, y = (sum((w * n[i] for w, n in zip(weights, normals, strict=True)), ZERO) for i in (0, 1))
    total = sum(weights, ZERO)
    return x / total, y / total


def _from(x: float, y: float) -> Vector:
    """(x, y) less a point."""
    return variable("x") - x, variable("y") - y


def _off(edge: Edge) -> Term:
    """The square of the distance from an edge, or from its circle, as a term that vanishes on the
    edge only."""
    start, chord, at, arc = (
        np.array(edge.start),
        np.subtract(edge.end, edge.start),
        _from(*edge.start),
        edge_arc(edge),
    )

    def along(direction: Array) -> Term:
        return direction[0] * at[0] + direction[1] * at[1]

    def beyond(a: Term) -> Term:
        """a² where a is positive."""
        return call("max", ZERO, a) ** 2

    if arc is None:
        t = chord / edge_length(edge)
        ahead = along(t)
        return (
            along(np.array([t[1], -t[0]])) ** 2 + beyond(-ahead) + beyond(ahead - edge_length(edge))
        )
    assert edge.through is not None
    chord = chord / np.linalg.norm(chord)
    inward = np.array([-chord[1], chord[0]])
    inward *= math.copysign(1.0, float(inward @ (np.array(edge.through) - start)))
    x, y = _from(*arc.center)
    return (call("sqrt", x**2 + y**2) - arc.radius) ** 2 + beyond(
        -along(inward)
    )  # the side of the chord with the arc


def kinks(of: Scalar) -> tuple[Expression, ...]:
    """Expressions that change their sign where the scalar may have a kink: at abs, min and max."""
    if not isinstance(of, Expression):
        return ()
    found = dict[Term, None]()
    for node in of.order:
        if node.name in ("abs", "min", "max"):
            found[node.parts[0] - (ZERO if node.name == "abs" else node.parts[1])] = None
    return tuple(Expression("kink", node) for node in found if node.name != NUMBER)


def sides(bend: Expression, body: Body) -> tuple[Array, Array]:
    """Points on both sides of where `bend` changes its sign along the lines of a grid."""
    x, y, within = grid(body)
    points, pairs = np.stack([x, y], axis=-1), []
    for first, second in ((np.s_[:-1], np.s_[1:]), (np.s_[:, :-1], np.s_[:, 1:])):
        both = within[first] & within[second]
        pairs.append((points[first][both], points[second][both]))
    a, b = (np.concatenate(ends) for ends in zip(*pairs, strict=True))
    sign = np.sign(bend.evaluate(*a.T))
    change = sign * np.sign(bend.evaluate(*b.T)) < 0
    a, b, sign = a[change], b[change], sign[change]
    apart = INWARD * (b - a)
    for _ in range(60):
        middle = 0.5 * (a + b)
        left = np.sign(bend.evaluate(*middle.T)) == sign
        a, b = np.where(left[:, None], middle, a), np.where(left[:, None], b, middle)
    return a - apart, b + apart  # at the kink itself a slope may be neither


VANISHING = 1e-12
"""A load that is smaller everywhere, relative to the terms it is the sum of, is rounding."""


class Derivation:
    """Loads for one exact solution on one body; scenes that agree in what matters share their
    expressions."""

    def __init__(self, exact: Exact, body: Body) -> None:
        self.body, self._exact = body, exact
        theta = exact.theta if exact.theta is not None else 0.0
        self.u, self.theta = tuple(map(term, exact.u)), term(theta)
        self._smooth = not any(kinks(component) for component in (*exact.u, theta))
        self._inside = inside(body)
        self.normal = cache(lambda names: normal_field(body, body_edges(body, names)))
        """N = n on the edges of the given names."""
        self.load, self._scalar = cache(self._load), cache(self._shown)

    def scene(self, scene: Scene) -> Scene:
        """The scene with its loads, prescribed displacements and temperatures derived; what it
        holds is not used."""
        roles = tuple(
            (name, self._role(name, role, scene.material)) for name, role in scene.boundary
        )
        return replace(
            scene, boundary=roles, f=self.load((), scene.material), heat=self.heat(scene)
        )

    def _load(self, names: tuple[str, ...], material: Material) -> tuple[Scalar, Scalar]:
        """g = σn on the edges of the given names; for no names f = −div σ in the body."""
        lam, mu, beta = material.lam, material.mu, material.beta
        (u_xx, u_xy), (u_yx, u_yy) = map(gradient, self.u)
        even, shear = lam * (u_xx + u_yy) - beta * self.theta, mu * (u_xy + u_yx)
        rows = (even + 2.0 * mu * u_xx, shear), (shear, even + 2.0 * mu * u_yy)
        parts, heat = [u_xx, u_xy, u_yx, u_yy], [self.theta]
        if names:
            n = self.normal(names)
            made = [row[0] * n[0] + row[1] * n[1] for row in rows]
        else:
            made = [-(derivative(row[0], "x") + derivative(row[1], "y")) for row in rows]
            parts, heat = (
                [second for d in parts for second in gradient(d)],
                list(gradient(self.theta)),
            )
        sums = (*((lam + 2.0 * mu) * d for d in parts), *(beta * d for d in heat))
        return self._scalar(made[0], sums, names), self._scalar(made[1], sums, names)

    def heat(self, scene: Scene) -> Heat:
        """q and θ̄, or the known θ where no edge convects."""
        names, k, alpha = scene.edges(Convection), scene.material.k, scene.heat.alpha
        if self._exact.theta is None:
            return Heat()
        if not names or not k or not alpha > 0.0:
            return Heat(theta=self._exact.theta)
        slope, n = gradient(self.theta), self.normal(names)
        second = [derivative(d, v) for d, v in zip(slope, "xy", strict=True)]
        flux = slope[0] * n[0] + slope[1] * n[1]
        insulated = self._scalar(flux, slope, names) == 0.0
        theta_bar = self.theta if insulated else self.theta + k / alpha * flux
        q = self._scalar(-k * (second[0] + second[1]), tuple(k * d for d in second), ())
        return Heat(None, alpha, self._scalar(theta_bar, (), names), q, ())

    def _role(self, name: str, role: Role, material: Material) -> Role:
        if isinstance(role, Loaded):
            return replace(role, g=self.load((name,), material), pressure=0.0, force=(0.0, 0.0))
        if not isinstance(role, Clamped):
            return role
        given = self._exact.u
        if role.frame == "nt":
            n, (u_x, u_y) = self.normal((name,)), self.u
            along = u_x * n[0] + u_y * n[1], u_y * n[0] - u_x * n[1]
            given = self._scalar(along[0], self.u, (name,)), self._scalar(along[1], self.u, (name,))
        held = [None if old is None else new for old, new in zip(role.u, given, strict=True)]
        return replace(role, u=(held[0], held[1]))

    def _shown(self, of: Term, parts: tuple[Term, ...], names: tuple[str, ...]) -> Scalar:
        """The term as a scalar, 0 if it is rounding of its parts on the edges of the names (in the
        body without)."""
        made = scalar(of)
        if isinstance(made, Expression) and self._smooth:
            points = self._inside
            if names:
                points = np.concatenate(
                    [edge_samples(*edge)[0] for edge in body_edges(self.body, names)]
                )
            size = sum(
                (np.abs(value_of(scalar(part), *points.T)) for part in parts), np.zeros(len(points))
            )
            small = np.abs(value_of(made, *points.T)) <= VANISHING * size
            made = 0.0 if len(points) and np.isfinite(size).all() and np.all(small) else made
        return made


TOLERANCE = 1e-8
"""Largest violation, relative to the largest value of its kind on the boundary."""
JUMP = 1e-4
"""Jump of a gradient across a kink, relative to its largest value, that is no rounding of the place
of the kink."""


SolutionFault = tuple[tuple["str | int", ...], str, str]
"""In which key of `exact` or at which edge something is wrong, what is, and what to do."""


@dataclass(frozen=True)
class Samples:
    """The exact solution at points of one or more edges: u (2, n), ∇u (2, 2, n) with ∂_d u_c at [c,
    d], θ and ∇θ."""

    points: Array
    normals: Array
    u: Array
    slope: Array
    theta: Array
    theta_slope: Array

    @property
    def tangents(self) -> Array:
        """(n, 2) t = (−n₂, n₁)."""
        return np.column_stack([-self.normals[:, 1], self.normals[:, 0]])

    def stress(self, scene: Scene) -> Array:
        """(2, 2, n) σ."""
        material = scene.material
        even = material.lam * (self.slope[0, 0] + self.slope[1, 1]) - material.beta * self.theta
        double = material.mu * (self.slope + self.slope.transpose(1, 0, 2))
        return np.asarray(double + even * np.eye(2)[:, :, None])


Keys = tuple[str | int, ...]


class Checks:
    """The checks of one exact solution on one body."""

    def __init__(self, exact: Exact, body: Body) -> None:
        self._exact, self._body, self._inside = exact, body, inside(body)
        self._finite: set[tuple[Scalar, str]] = set()
        self._checked: set[tuple[object, ...]] = set()
        self._edges = {edge.name: self._samples((edge.name,)) for edge, _ in body_edges(body)}
        self._all = self._samples(tuple(self._edges))

    def _samples(self, names: tuple[str, ...]) -> Samples:
        pairs = [edge_samples(*edge) for edge in body_edges(self._body, names)]
        points, normals = (np.concatenate(parts) for parts in zip(*pairs, strict=True))
        within = points - INWARD * body_size(self._body) * normals
        scalars = (*self._exact.u, self._exact.theta if self._exact.theta is not None else 0.0)
        values = [value_of(scalar, *points.T) for scalar in scalars]
        slopes = [value_and_gradient(scalar, *within.T)[1] for scalar in scalars]
        return Samples(
            points, normals, np.array(values[:2]), np.array(slopes[:2]), values[2], slopes[2]
        )

    def kinks(self) -> Iterator[SolutionFault]:
        """Jumps of ∇u or ∇θ inside the body."""
        fields: list[tuple[Keys, Scalar]] = [(("u", i), u) for i, u in enumerate(self._exact.u)]
        fields += [(("theta",), self._exact.theta)] if self._exact.theta is not None else []
        for keys, component in fields:
            largest = np.max(np.abs(value_and_gradient(component, *self._inside.T)[1]), initial=0.0)
            for bend in kinks(component):
                before, after = sides(bend, self._body)
                jump = np.abs(
                    value_and_gradient(component, *before.T)[1]
                    - value_and_gradient(component, *after.T)[1]
                )
                if np.max(jump, initial=0.0) > JUMP * largest:
                    at = spot(before[int(np.argmax(jump.max(axis=0)))])
                    what = f"bends at {at}, where its gradient jumps by {np.max(jump):.3g}"
                    remedy = "no load of a scene balances that; use a smooth expression, like max(0, s)^2 for max(0, s)"
                    yield keys, what, remedy
                    break

    def scene(self, scene: Scene) -> Iterator[SolutionFault]:
        """What is wrong with a scene whose loads were derived; nothing new where scenes differ in
        heat only."""
        yield from self._values(scene)
        key = (scene.material, scene.boundary, scene.friction)
        if key not in self._checked:
            self._checked.add(key)
            stress = max(
                _largest(self._all.stress(scene)), scene.material.beta * _largest(self._all.theta)
            )
            for name, role in scene.boundary:
                yield from islice(
                    self._edge(name, role, scene, stress), 1
                )  # others on the edge may follow from it

    def _edge(self, name: str, role: Role, scene: Scene, stress: float) -> Iterator[SolutionFault]:
        """What an edge leaves no room for: values that must vanish and do not, and what the
        friction law forbids."""
        at, u, theta = self._edges[name], ("u",), self._exact.theta
        pull = np.einsum("cdn,nd->cn", at.stress(scene), at.normals)

        def zero(
            keys: Keys, values: Array, scale: float, what: str, remedy: str
        ) -> Iterator[SolutionFault]:
            size = np.nan_to_num(np.abs(values))
            worst = int(np.argmax(size))
            if size[worst] > TOLERANCE * scale:
                yield (
                    keys,
                    f"{what.format(f'{values[worst]:.3g}')}, at {spot(at.points[worst])}",
                    remedy,
                )

        if isinstance(role, Contact):
            u_N, u_T = (np.einsum("cn,nc->n", at.u, axis) for axis in (at.normals, at.tangents))
            xi, largest = -np.einsum("cn,nc->n", pull, at.tangents), _largest(self._all.u)
            remedy = f"give an exact solution that slides along {name}"
            yield from zero(
                u, u_N, largest, f"u_N is {{}} on the contact edge {name}, not 0", remedy
            )
            if self._exact.xi is not None:
                given, remedy = (
                    value_of(self._exact.xi, *at.points.T),
                    "correct xi, or leave it out: it follows from u",
                )
                yield from zero(
                    ("xi",),
                    given - xi,
                    stress,
                    f"xi differs from -S_T of u by {{}} on {name}",
                    remedy,
                )
                xi = given
            b = law_along(scene.friction, (name,), np.zeros(len(u_T), dtype=np.intp), at.points)
            low, high = b.interval(u_T, 1e-9 * largest)
            off = np.maximum(np.maximum(low - xi, xi - high), 0.0)
            i = int(np.argmax(np.nan_to_num(off)))
            # stress is sampled INWARD of the edge, which alone leaves so much where no friction is
            # to compare with
            if off[i] > max(TOLERANCE * max(b.b_scale, _largest(xi)), 10 * INWARD * stress):
                law = f"[{low[i]:.6g}, {high[i]:.6g}]" if low[i] < high[i] else f"{low[i]:.6g}"
                where = f"{name}: at {spot(at.points[i])}, where u_T = {u_T[i]:.6g}"
                what = f"the friction law does not hold on {where}, -S_T is {xi[i]:.6g}, but b(u_T) is {law}"
                remedy = (
                    f"change u or friction, so that -S_T of u lies in b(u_T) everywhere on {name}"
                )
                yield u, what, remedy
        elif isinstance(role, Free):
            for c, axis in enumerate("xy"):
                what = f"the {axis} component of sigma n is {{}} on the free edge {name}"
                yield from zero(
                    u, pull[c], stress, what, f"give {name} the role traction; its g is derived"
                )
        elif isinstance(role, Clamped) and None in role.u:
            straight = [np.broadcast_to(axis, at.points.shape) for axis in np.eye(2)]
            axes, symbols = (
                ((at.normals, at.tangents), "NT") if role.frame == "nt" else (straight, "xy")
            )
            for held, direction, symbol in zip(role.u, axes, symbols, strict=True):
                if held is None:
                    what = (
                        f"u_{symbol} is free on {name}, but the traction in its direction is {{}}"
                    )
                    remedy = f"hold it too (u_{symbol}: derived), or give a u without that traction"
                    yield from zero(u, np.einsum("cn,nc->n", pull, direction), stress, what, remedy)
        if not isinstance(role, Convection) and scene.edges(Convection) and theta is not None:
            what = f"d(theta)/dn is {{}} on the edge {name}, which is insulated"
            remedy = f"make {name} a convection edge, or give a theta without slope across it"
            flux = np.einsum("dn,nd->n", at.theta_slope, at.normals)
            yield from zero(("theta",), flux, _largest(self._all.theta_slope), what, remedy)

    def _values(self, scene: Scene) -> Iterator[SolutionFault]:
        """Derived fields without a finite value somewhere."""
        fields: list[tuple[str, str, tuple[Scalar | None, ...], Array]] = [
            ("f", "u", scene.f, self._inside)
        ]
        if scene.heat.theta is None:
            fields.append(("q", "theta", (scene.heat.q,), self._inside))
        for name, role in scene.boundary:
            points = self._edges[name].points
            if isinstance(role, Clamped) and role.frame == "nt":
                ends = np.array([edge.start for edge, _ in body_edges(self._body, (name,))])
                fields.append(
                    (f"u_N or u_T on {name}", "u", role.u, np.concatenate([points, ends]))
                )
            if isinstance(role, Loaded):
                fields.append((f"g on {name}", "u", role.g, points))
            if isinstance(role, Convection) and scene.heat.theta is None:
                fields.append((f"theta_bar on {name}", "theta", (scene.heat.theta_bar,), points))
        for symbol, key, scalars, points in fields:
            for field in scalars:
                if not isinstance(field, Expression) or (field, symbol) in self._finite:
                    continue
                self._finite.add((field, symbol))
                values = field.evaluate(*points.T)
                bad = np.flatnonzero(~(np.abs(values) <= LARGEST))
                if len(bad):
                    is_finite = np.isfinite(values[bad[0]])
                    fault = "is too large to compute with" if is_finite else "has no finite value"
                    what = f"{symbol}, derived from it, {fault} at {spot(points[bad[0]])}"
                    remedy = "give an expression that has its derivatives there, or give the loads"
                    yield (key,), what, remedy
                    return


def _largest(values: Array) -> float:
    return float(np.max(np.abs(values[np.isfinite(values)]), initial=0.0))


PANELS = 200
STICKS = 64 * np.finfo(float).eps
"""Distance from an up-jump, relative to the largest displacement on Γ_C, that is rounding."""
_GAUSS, _WEIGHTS = np.polynomial.legendre.leggauss(5)


def exact_energy(exact: Exact, scene: Scene, mesh: TriangleGeometry) -> float:
    """L_θ(u) [J/m]; NaN for a body that no mesh fills (with arcs, from a file), and without the θ
    that loads it."""
    theta = exact.theta if exact.theta is not None else scene.heat.theta
    straight = scene.body.outline is not None and all(
        edge.through is None for edge in scene.body.edges
    )
    if not straight or (scene.material.expands and theta is None):
        return math.nan

    def density(x: Array, y: Array) -> Array:
        (ux, gx), (uy, gy) = (value_and_gradient(component, x, y) for component in exact.u)
        f_x, f_y, heat = (
            value_of(data, x, y) for data in (*scene.f, 0.0 if theta is None else theta)
        )
        lam, mu, beta = scene.material.lam, scene.material.mu, scene.material.beta
        divergence, strain = gx[0] + gy[1], gx[0] ** 2 + gy[1] ** 2 + 0.5 * (gx[1] + gy[0]) ** 2
        return np.asarray(
            0.5 * lam * divergence**2 + mu * strain - f_x * ux - f_y * uy - beta * heat * divergence
        )

    return integral(mesh, density) + sum(
        _on_edge(exact, scene, *edge) for edge in body_edges(scene.body)
    )


def exact_friction_resultant(scene: Scene, xi: LineFunction) -> float:
    """∫ξ over the exact Γ_C [N/m]; NaN for a body from a file."""
    if scene.body.outline is None:
        return math.nan
    pieces = (_samples(*edge) for edge in body_edges(scene.body, scene.edges(Contact)))
    return sum(float(weights @ xi(points[:, 0], points[:, 1], n)) for points, n, weights in pieces)


def exact_slip_length(exact: Exact, scene: Scene) -> float:
    """Length of Γ_C where u_T is not at an up-jump of b [m]; NaN for a body from a file.

    Changes between stick and slip are found at 5·PANELS points of every edge and bisected until
    floats end; pairs of changes between two points are missed. u_T counts as at the jump within its
    rounding, so that where slip begins like r^p the change lies off by (rounding /
    amplitude)^(1/p).
    """
    if scene.body.outline is None:
        return math.nan
    edges = body_edges(scene.body, scene.edges(Contact))
    at = [edge_at(edge, _places()) for edge, _ in edges]
    size = max(
        (float(np.max(np.abs(value_of(u, *points.T)))) for points in at for u in exact.u),
        default=0.0,
    )

    def slips(edge: Edge, hole: bool, places: Array) -> NDArray[np.bool_]:
        points = edge_at(edge, places)
        u_T = exact_u_T(exact)(points[:, 0], points[:, 1], outward(edge, hole, points))
        law = _law(scene, edge, points)
        at, tables = law.node_index(len(points)), law.tables
        near = np.abs(u_T[:, None] - tables.kinks[at]) <= STICKS * size
        return ~np.any(near & (tables.kinds[at] == UP), axis=1)

    return sum(edge_length(edge) * _share(partial(slips, edge, hole)) for edge, hole in edges)


def _law(scene: Scene, edge: Edge, points: Array) -> Laws:
    return law_along(scene.friction, (edge.name,), np.zeros(len(points), dtype=np.intp), points)


def _share(slips: Callable[[Array], NDArray[np.bool_]]) -> float:
    """Share of [0, 1] where a predicate holds, its changes bisected."""
    places = np.concatenate([[0.0], _places(), [1.0]])
    inner = slips(places[1:-1])
    holds = np.concatenate(
        [inner[:1], inner, inner[-1:]]
    )  # an end may be a corner where all is held
    change = np.flatnonzero(holds[1:] != holds[:-1])
    low, high = places[change], places[change + 1]
    for _ in range(64):
        middle = 0.5 * (low + high)
        same = slips(middle) == holds[change]
        low, high = np.where(same, middle, low), np.where(same, high, middle)
    borders = np.concatenate([[0.0], high, [1.0]])
    return float(np.diff(borders)[0 if holds[0] else 1 :: 2].sum())


def _on_edge(exact: Exact, scene: Scene, edge: Edge, hole: bool) -> float:
    """What an edge adds: −∫g·u + ∫p u_N, or ∫j(u_T) on Γ_C."""
    role = dict(scene.boundary)[edge.name]
    if not isinstance(role, Contact | Loaded):
        return 0.0
    points, n, weights = _samples(edge, hole)
    x, y = points.T
    if isinstance(role, Contact):
        return float(weights @ _law(scene, edge, points).j(exact_u_T(exact)(x, y, n)))
    u = np.column_stack([value_of(component, x, y) for component in exact.u])
    traction = role.traction(n, lambda value: value_of(value, x, y))
    return -float(weights @ np.sum(traction * u, axis=1))


def _places() -> Array:
    """Gauss points of PANELS equal parts of [0, 1]."""
    return np.asarray(((np.arange(PANELS)[:, None] + 0.5 * (1 + _GAUSS)) / PANELS).ravel())


def _samples(edge: Edge, hole: bool) -> tuple[Array, Array, Array]:
    """Gauss points (q, 2) on a line or an arc in PANELS equal parts, outward normals (q, 2) and
    weights (q,)."""
    points, weights = (
        edge_at(edge, _places()),
        np.tile(0.5 * _WEIGHTS / PANELS, PANELS) * edge_length(edge),
    )
    return points, outward(edge, hole, points), weights


def exact_u_T(exact: Exact) -> LineFunction:
    """u·t with t = (−n₂, n₁) [m]."""

    def slip(x: Array, y: Array, n: Array) -> Array:
        ux, uy = (value_of(component, x, y) for component in exact.u)
        return np.asarray(uy * n[..., 0] - ux * n[..., 1])

    return slip


def exact_xi(exact: Exact, scene: Scene) -> LineFunction:
    """−S_T [Pa]: as given, or −t·2με(u)n; λ and the temperature only act normally."""
    given, mu = exact.xi, scene.material.mu
    if given is not None:
        return lambda x, y, n: value_of(given, x, y)

    def traction(x: Array, y: Array, n: Array) -> Array:
        gx, gy = (value_and_gradient(component, x, y)[1] for component in exact.u)
        shear = 0.5 * (gx[1] + gy[0])
        n1, n2 = n[..., 0], n[..., 1]
        return np.asarray(
            -2 * mu * (-n2 * (gx[0] * n1 + shear * n2) + n1 * (shear * n1 + gy[1] * n2))
        )

    return traction


def known_goal(goal: Goal, exact: Exact, scene: Scene) -> float | None:
    """J(u), by quadrature on the exact Γ_C; None for the energy norm and where the body comes from
    a file."""
    if scene.body.outline is None or goal.quantity == "energy":
        return None
    if goal.quantity == "u_T":
        point = np.array([goal.at])
        edges = body_edges(scene.body, scene.edges(Contact))
        edge, hole = min(edges, key=lambda one: float(edge_distance(one[0], point)[0]))
        value = float(exact_u_T(exact)(point[:, 0], point[:, 1], outward(edge, hole, point))[0])
    elif goal.quantity == "friction_resultant":
        value = exact_friction_resultant(scene, exact_xi(exact, scene))
    else:
        value = exact_slip_length(exact, scene)
    return value if math.isfinite(value) else None
