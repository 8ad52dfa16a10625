"""An exact solution: loads under which it is one, whether a scene has them, and its results.

The loads under which a given u and θ are the solution: the method of manufactured solutions.

    σ = λ div u I + 2μ ε(u) − βθI,     f = −div σ in Ω,     g = σn on traction and convection edges,
    u on clamped edges (constrained components only),
    q = −kΔθ in Ω,     θ̄ = θ + (k/α) ∂θ/∂n on Γ_θ,     eqs. (1)–(5)

All are expressions by symbolic differentiation. What vanishes to rounding at sample points becomes
the number 0, so that nothing is assembled for it. Of expressions with abs, min or max only what
vanishes identically does, because samples may miss where they do not vanish. Without a convection
edge θ is the known temperature, and no heat problem is solved. Left out: heat flux through other
edges and tractions on contact and free edges, which a scene cannot have; a body from a file, whose
normals are no expressions.

Normals as expressions: on a line n is constant, on an arc it is (x − centre)/radius. Several curves
get one field that is the normal of each on each, N = Σ w_i n_i / Σ w_i with w_i = Π_{j≠i} D_j,
where D_j vanishes on curve j only (Shepard's interpolation). A load that depends on n is then one
expression for all of them. Off the curves N means nothing.

Checks: loads that a scene cannot have must vanish, and Γ_C must obey (4). Everything is sampled at
SAMPLES points of every edge, none of them an end, and on a grid in the body:
contact:  u_N = 0, −S_T ∈ b̂(u_T), and a given ξ is −S_T
free:     σn = 0; likewise the traction of a component that a clamped edge leaves free
heat:     ∂θ/∂n = 0 on edges without convection
values:   all derived fields are finite
kinks:    at abs, min and max the gradients of u and θ have no jump. A jump of ∇u would need a load
          on a line inside the body (u is continuous and the material is one, so σn is continuous
          across the line only if ∇u is).

Results, by quadrature that uses no discrete field: L_θ(u) = ½a(u,u) − ∫f·u − β∫θ div u − ∫g·u +
∫_{Γ_C} j(u_T) of a body with straight edges; ∫ξ over Γ_C; the slip length. They give the value of a
goal, so that estimates can be compared with true errors.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, replace
from functools import cache, partial
from itertools import islice

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
"""Points of an edge at which the checks are made."""


def body_edges(body: Body, names: Iterable[str] | None = None) -> list[tuple[Edge, bool]]:
    """Return the edges with the given names (all without), each with whether it is a hole's.

    A hole's edges have the body on their right.
    """
    assert body.outline is not None
    wanted_names = None if names is None else set(names)
    edges = [(edge, False) for edge in body.outline.edges]
    for hole in body.holes:
        edges += [(edge, True) for edge in hole.edges]
    return [
        (edge, is_hole)
        for edge, is_hole in edges
        if wanted_names is None or edge.name in wanted_names
    ]


def edge_samples(edge: Edge, is_hole: bool, count: int = SAMPLES) -> tuple[Array, Array]:
    """Return points (n, 2) inside an edge and outward unit normals there (n, 2).

    They avoid its ends and its middle.
    """
    points = edge_at(edge, (np.arange(count) + 0.38) / count)
    return points, outward(edge, is_hole, points)


def outward(edge: Edge, is_hole: bool, points: Array) -> Array:
    """Return (n, 2) outward unit normals of the body at points of an edge."""
    normals = edge_normal(edge, points)
    return -normals if is_hole else normals


def normal_field(body: Body, edges: list[tuple[Edge, bool]]) -> Vector:
    """Return N = n on all the edges."""
    size = body_size(body)
    normal_of_key: dict[tuple[float, ...], Vector] = {}
    edges_of_key: dict[tuple[float, ...], list[Edge]] = {}
    for edge, is_hole in edges:
        key, normal = _normal_on(edge, is_hole, size)
        normal_of_key.setdefault(key, normal)
        edges_of_key.setdefault(key, []).append(edge)
    normals = list(normal_of_key.values())
    if len(normals) == 1:
        return normals[0]
    distances = []
    for curve in edges_of_key.values():
        factors = [size**-2 * _squared_distance(edge) for edge in curve]
        distances.append(math.prod(factors, start=ONE))
    weights = []
    for i in range(len(distances)):
        weights.append(math.prod((D for j, D in enumerate(distances) if j != i), start=ONE))
    total = sum(weights, ZERO)
    x = sum((w * n_x for w, (n_x, _) in zip(weights, normals, strict=True)), ZERO)
    y = sum((w * n_y for w, (_, n_y) in zip(weights, normals, strict=True)), ZERO)
    return x / total, y / total


def _normal_on(edge: Edge, is_hole: bool, size: float) -> tuple[tuple[float, ...], Vector]:
    """Return the outward normal of an edge as terms, and a key that edges with it share."""
    arc = edge_arc(edge)
    if arc is None:
        n_x, n_y = edge_samples(edge, is_hole, 1)[1][0].tolist()
        return (round(n_x, SAME), round(n_y, SAME)), (number(n_x), number(n_y))
    x, y = arc.center
    sign = math.copysign(1.0, arc.sweep) * (-1.0 if is_hole else 1.0)
    from_x, from_y = _from(x, y)
    key = (x / size, y / size, arc.radius / size, sign)
    normal = (sign / arc.radius * from_x, sign / arc.radius * from_y)
    return tuple(round(part, SAME) for part in key), normal


def _from(x: float, y: float) -> Vector:
    """Return (x, y) minus a point."""
    return variable("x") - x, variable("y") - y


def _squared_distance(edge: Edge) -> Term:
    """Return a term that vanishes on an edge only.

    It is the square of the distance from the line or circle, plus that from the edge along it.
    """
    from_start = _from(*edge.start)
    arc = edge_arc(edge)

    def component(direction: Array) -> Term:
        return direction[0] * from_start[0] + direction[1] * from_start[1]

    def beyond(a: Term) -> Term:
        """Return a² where a is positive, else 0."""
        return call("max", ZERO, a) ** 2

    chord = np.subtract(edge.end, edge.start)
    if arc is None:
        length = edge_length(edge)
        t = chord / length
        along = component(t)
        across = component(np.array([t[1], -t[0]]))
        return across**2 + beyond(-along) + beyond(along - length)
    assert edge.through is not None
    chord = chord / np.linalg.norm(chord)
    toward_arc = np.array([-chord[1], chord[0]])
    to_through = np.array(edge.through) - np.array(edge.start)
    toward_arc *= math.copysign(1.0, float(toward_arc @ to_through))
    x, y = _from(*arc.center)
    across = call("sqrt", x**2 + y**2) - arc.radius
    return across**2 + beyond(-component(toward_arc))  # the side of the chord with the arc


def kinks(function: Scalar) -> tuple[Expression, ...]:
    """Return expressions that change their sign where a function may have a kink.

    They are those of abs, min and max.
    """
    if not isinstance(function, Expression):
        return ()
    differences = dict[Term, None]()
    for node in function.order:
        if node.name == "abs":
            differences[node.parts[0] - ZERO] = None
        elif node.name in ("min", "max"):
            differences[node.parts[0] - node.parts[1]] = None
    return tuple(Expression("kink", node) for node in differences if node.name != NUMBER)


def sides(bend: Expression, body: Body) -> tuple[Array, Array]:
    """Return points on both sides of where `bend` changes its sign along the lines of a grid."""
    x, y, is_inside = grid(body)
    points = np.stack([x, y], axis=-1)
    in_column = is_inside[:-1] & is_inside[1:]
    in_row = is_inside[:, :-1] & is_inside[:, 1:]
    start = np.concatenate([points[:-1][in_column], points[:, :-1][in_row]])
    end = np.concatenate([points[1:][in_column], points[:, 1:][in_row]])
    sign = np.sign(bend.evaluate(*start.T))
    changes = sign * np.sign(bend.evaluate(*end.T)) < 0
    start, end, sign = start[changes], end[changes], sign[changes]
    offset = INWARD * (end - start)
    for _ in range(60):
        middle = 0.5 * (start + end)
        is_before = (np.sign(bend.evaluate(*middle.T)) == sign)[:, None]
        start = np.where(is_before, middle, start)
        end = np.where(is_before, end, middle)
    return start - offset, end + offset  # at the kink itself a slope may be neither


VANISHING = 1e-12
"""Size of a load that is rounding, relative to the sum of its terms everywhere."""


class Derivation:
    """Loads for one exact solution on one body.

    Scenes share the expressions that are equal for them.
    """

    def __init__(self, exact: Exact, body: Body) -> None:
        self.body = body
        self._exact = exact
        theta = exact.theta if exact.theta is not None else 0.0
        self.u = tuple(map(term, exact.u))
        self.theta = term(theta)
        self._smooth = not any(kinks(component) for component in (*exact.u, theta))
        self._inside = inside(body)
        self.normal = cache(lambda names: normal_field(body, body_edges(body, names)))
        """N = n on the edges of the given names."""
        self.load = cache(self._load)
        self._scalar = cache(self._without_rounding)

    def scene(self, scene: Scene) -> Scene:
        """Return the scene with derived loads, prescribed displacements and temperatures.

        Those that the scene has are not used.
        """
        roles = []
        for name, role in scene.boundary:
            roles.append((name, self._role(name, role, scene.material)))
        f = self.load((), scene.material)
        return replace(scene, boundary=tuple(roles), f=f, heat=self.heat(scene))

    def _load(self, names: tuple[str, ...], material: Material) -> tuple[Scalar, Scalar]:
        """Return g = σn on the edges of the given names; for no names f = −div σ in the body."""
        lam, mu, beta = material.lam, material.mu, material.beta
        u_xx, u_xy = gradient(self.u[0])
        u_yx, u_yy = gradient(self.u[1])
        isotropic = lam * (u_xx + u_yy) - beta * self.theta
        shear = mu * (u_xy + u_yx)
        stress_x = (isotropic + 2.0 * mu * u_xx, shear)
        stress_y = (shear, isotropic + 2.0 * mu * u_yy)
        slopes = [u_xx, u_xy, u_yx, u_yy]
        if names:
            n = self.normal(names)
            load_x, load_y = (row[0] * n[0] + row[1] * n[1] for row in (stress_x, stress_y))
            mechanical_terms = slopes
            thermal_terms = [self.theta]
        else:
            load_x, load_y = (
                -(derivative(row[0], "x") + derivative(row[1], "y")) for row in (stress_x, stress_y)
            )
            mechanical_terms = [second for slope in slopes for second in gradient(slope)]
            thermal_terms = list(gradient(self.theta))
        terms = [(lam + 2.0 * mu) * slope for slope in mechanical_terms]
        terms += [beta * slope for slope in thermal_terms]
        return self._scalar(load_x, tuple(terms), names), self._scalar(load_y, tuple(terms), names)

    def heat(self, scene: Scene) -> Heat:
        """Return q and θ̄, or the known θ where no edge is convective."""
        names = scene.edges(Convection)
        k = scene.material.k
        alpha = scene.heat.alpha
        if self._exact.theta is None:
            return Heat()
        if not names or not k or not alpha > 0.0:
            return Heat(theta=self._exact.theta)
        slope = gradient(self.theta)
        n = self.normal(names)
        theta_xx = derivative(slope[0], "x")
        theta_yy = derivative(slope[1], "y")
        flux = slope[0] * n[0] + slope[1] * n[1]
        is_insulated = self._scalar(flux, slope, names) == 0.0
        theta_bar = self.theta if is_insulated else self.theta + k / alpha * flux
        q = self._scalar(-k * (theta_xx + theta_yy), (k * theta_xx, k * theta_yy), ())
        return Heat(None, alpha, self._scalar(theta_bar, (), names), q, ())

    def _role(self, name: str, role: Role, material: Material) -> Role:
        """Return the role of an edge with its derived load or prescribed displacement."""
        if isinstance(role, Loaded):
            return replace(role, g=self.load((name,), material), pressure=0.0, force=(0.0, 0.0))
        if not isinstance(role, Clamped):
            return role
        first, second = self._exact.u
        if role.frame == "nt":
            n_x, n_y = self.normal((name,))
            u_x, u_y = self.u
            first = self._scalar(u_x * n_x + u_y * n_y, self.u, (name,))
            second = self._scalar(u_y * n_x - u_x * n_y, self.u, (name,))
        old_first, old_second = role.u
        new_first = None if old_first is None else first
        new_second = None if old_second is None else second
        return replace(role, u=(new_first, new_second))

    def _without_rounding(
        self, load: Term, parts: tuple[Term, ...], names: tuple[str, ...]
    ) -> Scalar:
        """Return a load as a scalar, 0 if it is rounding of its parts.

        names: of the edges on which it acts; without any it acts in the body
        """
        function = scalar(load)
        if not isinstance(function, Expression) or not self._smooth:
            return function
        points = self._inside
        if names:
            samples = [edge_samples(*edge)[0] for edge in body_edges(self.body, names)]
            points = np.concatenate(samples)
        magnitude = np.zeros(len(points))
        for part in parts:
            magnitude = magnitude + np.abs(value_of(scalar(part), *points.T))
        is_small = np.abs(value_of(function, *points.T)) <= VANISHING * magnitude
        if len(points) and np.isfinite(magnitude).all() and np.all(is_small):
            return 0.0
        return function


TOLERANCE = 1e-8
"""Largest violation, relative to the largest value of its kind on the boundary."""
JUMP = 1e-4
"""Smallest jump of a gradient across a kink, relative to its largest value.

Smaller jumps are rounding of the place of the kink.
"""


Keys = tuple[str | int, ...]
SolutionFault = tuple[Keys, str, str]
"""The key of `exact` (or edge) at fault, what is wrong, and the remedy."""


@dataclass(frozen=True)
class Samples:
    """The exact solution at points of one or more edges.

    u (2, n), ∇u (2, 2, n) with ∂_d u_c at [c, d], θ (n,) and ∇θ (2, n)
    """

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
        """Return (2, 2, n) σ."""
        material = scene.material
        divergence = self.slope[0, 0] + self.slope[1, 1]
        isotropic = material.lam * divergence - material.beta * self.theta
        deviatoric = material.mu * (self.slope + self.slope.transpose(1, 0, 2))
        return np.asarray(deviatoric + isotropic * np.eye(2)[:, :, None])

    def fault(
        self, keys: Keys, values: Array, limit: float, problem: str, remedy: str
    ) -> Iterator[SolutionFault]:
        """Yield a fault if values (n,) that must vanish exceed a limit.

        problem: its text with a place {} for the largest of them
        """
        size = np.nan_to_num(np.abs(values))
        worst = int(np.argmax(size))
        if size[worst] > limit:
            text = problem.format(f"{values[worst]:.3g}")
            yield keys, f"{text}, at {spot(self.points[worst])}", remedy


class Checks:
    """The checks of one exact solution on one body."""

    def __init__(self, exact: Exact, body: Body) -> None:
        self._exact = exact
        self._body = body
        self._inside = inside(body)
        self._finite: set[tuple[Scalar, str]] = set()
        self._checked: set[tuple[object, ...]] = set()
        self._edges = {edge.name: self._samples((edge.name,)) for edge, _ in body_edges(body)}
        self._all = self._samples(tuple(self._edges))

    def _samples(self, names: tuple[str, ...]) -> Samples:
        """Return the exact solution at points of the edges of the given names."""
        samples = [edge_samples(*edge) for edge in body_edges(self._body, names)]
        points, normals = (np.concatenate(columns) for columns in zip(*samples, strict=True))
        inner_points = points - INWARD * body_size(self._body) * normals
        theta = self._exact.theta if self._exact.theta is not None else 0.0
        fields = (*self._exact.u, theta)
        values = [value_of(field, *points.T) for field in fields]
        slopes = [value_and_gradient(field, *inner_points.T)[1] for field in fields]
        u = np.array(values[:2])
        return Samples(points, normals, u, np.array(slopes[:2]), values[2], slopes[2])

    def kinks(self) -> Iterator[SolutionFault]:
        """Yield jumps of ∇u or ∇θ inside the body."""
        fields: list[tuple[Keys, Scalar]] = [(("u", i), u) for i, u in enumerate(self._exact.u)]
        if self._exact.theta is not None:
            fields.append((("theta",), self._exact.theta))
        for keys, field in fields:
            slope = value_and_gradient(field, *self._inside.T)[1]
            largest = np.max(np.abs(slope), initial=0.0)
            for bend in kinks(field):
                before, after = sides(bend, self._body)
                slope_before = value_and_gradient(field, *before.T)[1]
                slope_after = value_and_gradient(field, *after.T)[1]
                jump = np.abs(slope_before - slope_after)
                if np.max(jump, initial=0.0) > JUMP * largest:
                    place = spot(before[int(np.argmax(jump.max(axis=0)))])
                    problem = f"bends at {place}, where its gradient jumps by {np.max(jump):.3g}"
                    remedy = (
                        "no load of a scene balances that; use a smooth expression, "
                        "like max(0, s)^2 for max(0, s)"
                    )
                    yield keys, problem, remedy
                    break

    def scene(self, scene: Scene) -> Iterator[SolutionFault]:
        """Yield the faults of a scene whose loads were derived.

        Faults of edges are those of the first of all scenes that differ in heat only.
        """
        yield from self._values(scene)
        key = (scene.material, scene.boundary, scene.friction)
        if key in self._checked:
            return
        self._checked.add(key)
        thermal_stress = scene.material.beta * _largest(self._all.theta)
        stress = max(_largest(self._all.stress(scene)), thermal_stress)
        for name, role in scene.boundary:
            faults = self._edge(name, role, scene, stress)
            yield from islice(faults, 1)  # others on the edge may follow from it

    def _edge(self, name: str, role: Role, scene: Scene, stress: float) -> Iterator[SolutionFault]:
        """Yield values on an edge that must vanish and do not, and breaches of the friction law.

        stress: the largest stress on the boundary
        """
        samples = self._edges[name]
        traction = np.einsum("cdn,nd->cn", samples.stress(scene), samples.normals)
        limit = TOLERANCE * stress
        if isinstance(role, Contact):
            yield from self._contact(name, scene, stress, traction)
        elif isinstance(role, Free):
            for component, symbol in zip(traction, "xy", strict=True):
                problem = f"the {symbol} component of sigma n is {{}} on the free edge {name}"
                remedy = f"give {name} the role traction; its g is derived"
                yield from samples.fault(("u",), component, limit, problem, remedy)
        elif isinstance(role, Clamped) and None in role.u:
            shape = samples.points.shape
            if role.frame == "nt":
                axes = [samples.normals, samples.tangents]
                symbols = "NT"
            else:
                axes = [np.broadcast_to(axis, shape) for axis in np.eye(2)]
                symbols = "xy"
            for constrained, axis, symbol in zip(role.u, axes, symbols, strict=True):
                if constrained is None:
                    component = np.einsum("cn,nc->n", traction, axis)
                    problem = (
                        f"u_{symbol} is free on {name}, but the traction in its direction is {{}}"
                    )
                    remedy = f"hold it too (u_{symbol}: derived), or give a u without that traction"
                    yield from samples.fault(("u",), component, limit, problem, remedy)
        has_heat = scene.edges(Convection) and self._exact.theta is not None
        if not isinstance(role, Convection) and has_heat:
            flux = np.einsum("dn,nd->n", samples.theta_slope, samples.normals)
            limit = TOLERANCE * _largest(self._all.theta_slope)
            problem = f"d(theta)/dn is {{}} on the edge {name}, which is insulated"
            remedy = f"make {name} a convection edge, or give a theta without slope across it"
            yield from samples.fault(("theta",), flux, limit, problem, remedy)

    def _contact(
        self, name: str, scene: Scene, stress: float, traction: Array
    ) -> Iterator[SolutionFault]:
        """Yield the faults of a contact edge; traction: (2, n) σn."""
        samples = self._edges[name]
        u_N = np.einsum("cn,nc->n", samples.u, samples.normals)
        u_T = np.einsum("cn,nc->n", samples.u, samples.tangents)
        xi = -np.einsum("cn,nc->n", traction, samples.tangents)
        largest = _largest(self._all.u)
        problem = f"u_N is {{}} on the contact edge {name}, not 0"
        remedy = f"give an exact solution that slides along {name}"
        yield from samples.fault(("u",), u_N, TOLERANCE * largest, problem, remedy)
        if self._exact.xi is not None:
            given_xi = value_of(self._exact.xi, *samples.points.T)
            problem = f"xi differs from -S_T of u by {{}} on {name}"
            remedy = "correct xi, or leave it out: it follows from u"
            limit = TOLERANCE * stress
            yield from samples.fault(("xi",), given_xi - xi, limit, problem, remedy)
            xi = given_xi
        law = _law(scene, name, samples.points)
        low, high = law.interval(u_T, 1e-9 * largest)
        excess = np.maximum(np.maximum(low - xi, xi - high), 0.0)
        i = int(np.argmax(np.nan_to_num(excess)))
        # stress is sampled INWARD of the edge, which alone leaves this error where there is no
        # friction to compare with
        sampling_error = 10 * INWARD * stress
        if excess[i] > max(TOLERANCE * max(law.b_scale, _largest(xi)), sampling_error):
            b = f"[{low[i]:.6g}, {high[i]:.6g}]" if low[i] < high[i] else f"{low[i]:.6g}"
            problem = (
                f"the friction law does not hold on {name}: at {spot(samples.points[i])}, "
                f"where u_T = {u_T[i]:.6g}, -S_T is {xi[i]:.6g}, but b(u_T) is {b}"
            )
            remedy = f"change u or friction, so that -S_T of u lies in b(u_T) everywhere on {name}"
            yield ("u",), problem, remedy

    def _values(self, scene: Scene) -> Iterator[SolutionFault]:
        """Yield a derived field without a finite value somewhere."""
        for symbol, key, fields, points in self._derived_fields(scene):
            for field in fields:
                if not isinstance(field, Expression) or (field, symbol) in self._finite:
                    continue
                self._finite.add((field, symbol))
                values = field.evaluate(*points.T)
                bad_points = np.flatnonzero(~(np.abs(values) <= LARGEST))
                if len(bad_points):
                    first = bad_points[0]
                    fault = "has no finite value"
                    if np.isfinite(values[first]):
                        fault = "is too large to compute with"
                    problem = f"{symbol}, derived from it, {fault} at {spot(points[first])}"
                    remedy = "give an expression that has its derivatives there, or give the loads"
                    yield (key,), problem, remedy
                    return

    def _derived_fields(
        self, scene: Scene
    ) -> Iterator[tuple[str, str, tuple[Scalar | None, ...], Array]]:
        """Yield the symbol of every derived field, its key, its components and sample points."""
        yield "f", "u", scene.f, self._inside
        solves_heat = scene.heat.theta is None
        if solves_heat:
            yield "q", "theta", (scene.heat.q,), self._inside
        for name, role in scene.boundary:
            points = self._edges[name].points
            if isinstance(role, Clamped) and role.frame == "nt":
                ends = np.array([edge.start for edge, _ in body_edges(self._body, (name,))])
                points_and_ends = np.concatenate([points, ends])
                yield f"u_N or u_T on {name}", "u", role.u, points_and_ends
            if isinstance(role, Loaded):
                yield f"g on {name}", "u", role.g, points
            if isinstance(role, Convection) and solves_heat:
                yield f"theta_bar on {name}", "theta", (scene.heat.theta_bar,), points


def _largest(values: Array) -> float:
    return float(np.max(np.abs(values[np.isfinite(values)]), initial=0.0))


PANELS = 200
"""Equal parts of an edge, each with Gauss points of its own."""
STICKS = 64 * np.finfo(float).eps
"""Largest distance of a sticking point from its up-jump, relative to the largest u on Γ_C."""
_GAUSS, _WEIGHTS = np.polynomial.legendre.leggauss(5)


def exact_energy(exact: Exact, scene: Scene, mesh: TriangleGeometry) -> float:
    """Return L_θ(u) [J/m].

    It is NaN for a body that no mesh fills (with arcs, from a file), and without the θ that loads
    the body.
    """
    theta = exact.theta if exact.theta is not None else scene.heat.theta
    if scene.body.outline is None or any(edge.through is not None for edge in scene.body.edges):
        return math.nan
    if scene.material.expands and theta is None:
        return math.nan
    lam, mu, beta = scene.material.lam, scene.material.mu, scene.material.beta

    def density(x: Array, y: Array) -> Array:
        ux, gx = value_and_gradient(exact.u[0], x, y)
        uy, gy = value_and_gradient(exact.u[1], x, y)
        f_x = value_of(scene.f[0], x, y)
        f_y = value_of(scene.f[1], x, y)
        heat = value_of(0.0 if theta is None else theta, x, y)
        divergence = gx[0] + gy[1]
        strain = gx[0] ** 2 + gy[1] ** 2 + 0.5 * (gx[1] + gy[0]) ** 2
        stored = 0.5 * lam * divergence**2 + mu * strain
        return np.asarray(stored - f_x * ux - f_y * uy - beta * heat * divergence)

    edge_energies = [_edge_energy(exact, scene, *edge) for edge in body_edges(scene.body)]
    return integral(mesh, density) + sum(edge_energies)


def exact_friction_resultant(scene: Scene, xi: LineFunction) -> float:
    """Return ∫ξ over the exact Γ_C [N/m]; NaN for a body from a file."""
    if scene.body.outline is None:
        return math.nan
    resultant = 0.0
    for edge, is_hole in body_edges(scene.body, scene.edges(Contact)):
        points, normals, weights = _samples(edge, is_hole)
        resultant += float(weights @ xi(points[:, 0], points[:, 1], normals))
    return resultant


def exact_slip_length(exact: Exact, scene: Scene) -> float:
    """Return the length of Γ_C where u_T is not at an up-jump of b [m]; NaN for a body from a file.

    Changes between stick and slip are found at 5·PANELS points of every edge and bisected until
    floats end. Pairs of changes between two points are missed. u_T counts as at the jump within its
    rounding, so that where slip begins like r^p the change lies off by (rounding /
    amplitude)^(1/p).
    """
    if scene.body.outline is None:
        return math.nan
    edges = body_edges(scene.body, scene.edges(Contact))
    sizes = []
    for edge, _ in edges:
        points = edge_at(edge, _places())
        sizes += [float(np.max(np.abs(value_of(u, *points.T)))) for u in exact.u]
    largest = max(sizes, default=0.0)

    def slips(edge: Edge, is_hole: bool, shares: Array) -> NDArray[np.bool_]:
        points = edge_at(edge, shares)
        u_T = exact_u_T(exact)(points[:, 0], points[:, 1], outward(edge, is_hole, points))
        law = _law(scene, edge.name, points)
        row = law.node_index(len(points))
        near = np.abs(u_T[:, None] - law.tables.kinks[row]) <= STICKS * largest
        is_up_jump = law.tables.kinds[row] == UP
        return ~np.any(near & is_up_jump, axis=1)

    slip_lengths = []
    for edge, is_hole in edges:
        slip_lengths.append(edge_length(edge) * _share(partial(slips, edge, is_hole)))
    return sum(slip_lengths)


def _law(scene: Scene, edge_name: str, points: Array) -> Laws:
    """Return the law of points on one edge."""
    edge = np.zeros(len(points), dtype=np.intp)
    return law_along(scene.friction, (edge_name,), edge, points)


def _share(predicate: Callable[[Array], NDArray[np.bool_]]) -> float:
    """Return the share of [0, 1] where a predicate holds, its changes bisected."""
    places = np.concatenate([[0.0], _places(), [1.0]])
    inner = predicate(places[1:-1])
    # an end may be a constrained corner, where the predicate says nothing of its neighbours
    holds = np.concatenate([inner[:1], inner, inner[-1:]])
    change = np.flatnonzero(holds[1:] != holds[:-1])
    low = places[change]
    high = places[change + 1]
    for _ in range(64):
        middle = 0.5 * (low + high)
        is_unchanged = predicate(middle) == holds[change]
        low = np.where(is_unchanged, middle, low)
        high = np.where(is_unchanged, high, middle)
    borders = np.concatenate([[0.0], high, [1.0]])
    first = 0 if holds[0] else 1
    return float(np.diff(borders)[first::2].sum())


def _edge_energy(exact: Exact, scene: Scene, edge: Edge, is_hole: bool) -> float:
    """Return the energy of an edge: −∫g·u + ∫p u_N, or ∫j(u_T) on Γ_C."""
    role = dict(scene.boundary)[edge.name]
    if not isinstance(role, Contact | Loaded):
        return 0.0
    points, normals, weights = _samples(edge, is_hole)
    x, y = points.T
    if isinstance(role, Contact):
        u_T = exact_u_T(exact)(x, y, normals)
        return float(weights @ _law(scene, edge.name, points).j(u_T))
    ux = value_of(exact.u[0], x, y)
    uy = value_of(exact.u[1], x, y)
    work = value_of(role.g[0], x, y) * ux + value_of(role.g[1], x, y) * uy
    work -= value_of(role.pressure, x, y) * (ux * normals[:, 0] + uy * normals[:, 1])
    return -float(weights @ work)


def _places() -> Array:
    """Return Gauss points of PANELS equal parts of [0, 1]."""
    panel = np.arange(PANELS)[:, None]
    return np.asarray(((panel + 0.5 * (1 + _GAUSS)) / PANELS).ravel())


def _samples(edge: Edge, is_hole: bool) -> tuple[Array, Array, Array]:
    """Return Gauss points (q, 2) on an edge, outward normals (q, 2) and weights (q,).

    The edge is cut into PANELS equal parts.
    """
    points = edge_at(edge, _places())
    weights = np.tile(0.5 * _WEIGHTS / PANELS, PANELS) * edge_length(edge)
    return points, outward(edge, is_hole, points), weights


def exact_u_T(exact: Exact) -> LineFunction:
    """Return u·t with t = (−n₂, n₁) [m]."""

    def slip(x: Array, y: Array, n: Array) -> Array:
        ux = value_of(exact.u[0], x, y)
        uy = value_of(exact.u[1], x, y)
        return np.asarray(uy * n[..., 0] - ux * n[..., 1])

    return slip


def exact_xi(exact: Exact, scene: Scene) -> LineFunction:
    """Return −S_T [Pa]: as given, or −t·2με(u)n; λ and the temperature only act normally."""
    given_xi = exact.xi
    mu = scene.material.mu
    if given_xi is not None:
        return lambda x, y, n: value_of(given_xi, x, y)

    def traction(x: Array, y: Array, n: Array) -> Array:
        gx = value_and_gradient(exact.u[0], x, y)[1]
        gy = value_and_gradient(exact.u[1], x, y)[1]
        shear = 0.5 * (gx[1] + gy[0])
        n_x = n[..., 0]
        n_y = n[..., 1]
        strain_n_x = gx[0] * n_x + shear * n_y
        strain_n_y = shear * n_x + gy[1] * n_y
        return np.asarray(-2 * mu * (-n_y * strain_n_x + n_x * strain_n_y))

    return traction


def known_goal(goal: Goal, exact: Exact, scene: Scene) -> float | None:
    """Return J(u), by quadrature on the exact Γ_C.

    It is None for the energy norm and where the body comes from a file.
    """
    if scene.body.outline is None or goal.quantity == "energy":
        return None
    if goal.quantity == "u_T":
        point = np.array([goal.at])
        edges = body_edges(scene.body, scene.edges(Contact))
        distances = [float(edge_distance(edge, point)[0]) for edge, _ in edges]
        edge, is_hole = edges[int(np.argmin(distances))]
        normal = outward(edge, is_hole, point)
        value = float(exact_u_T(exact)(point[:, 0], point[:, 1], normal)[0])
    elif goal.quantity == "friction_resultant":
        value = exact_friction_resultant(scene, exact_xi(exact, scene))
    else:
        value = exact_slip_length(exact, scene)
    return value if math.isfinite(value) else None
