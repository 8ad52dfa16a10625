"""Whether derived loads are the loads of a scene: what no load of a scene can give must vanish, and Γ_C must obey (4).

Everything is sampled at SAMPLES points of every edge, none of them an end, and on a grid in the body. Checked:
contact:  u_N = 0, −S_T ∈ b̂(u_T), and a given ξ is −S_T
free:     σn = 0; likewise the traction of a component that a clamped edge leaves free
heat:     ∂θ/∂n = 0 on edges without convection
values:   all derived fields are finite
kinks:    at abs, min and max the gradients of u and θ have no jump. A jump of ∇u would need a load on a line inside the
          body (u is continuous and the material is one, so σn is continuous across the line only if ∇u is).
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import islice

import numpy as np
from numpy.typing import NDArray

from tcstudy.exact.fields import body_edges, edge_samples, kinks, sides
from tcstudy.expressions.derivative import value_and_gradient
from tcstudy.expressions.expression import Expression, value_of
from tcstudy.laws.composed import law_along
from tcstudy.scene.records import Body, Clamped, Contact, Convection, Free, Loaded, Role, Scalar, Scene
from tcstudy.scene.study import Exact
from tcstudy.shapes.edges import INWARD, body_size, inside
from tcstudy.shapes.faults import spot

Array = NDArray[np.float64]

TOLERANCE = 1e-8
"""Largest violation, relative to the largest value of its kind on the boundary."""
JUMP = 1e-4
"""Jump of a gradient across a kink, relative to its largest value, that is no rounding of the place of the kink."""


@dataclass(frozen=True)
class SolutionFault:
    """What is wrong, in which key of `exact` or at which edge, and what to do."""

    keys: tuple[str | int, ...]
    what: str
    remedy: str


@dataclass(frozen=True)
class Samples:
    """The exact solution at points of one or more edges: u (2, n), ∇u (2, 2, n) with ∂_d u_c at [c, d], θ and ∇θ."""

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
        return Samples(points, normals, np.array(values[:2]), np.array(slopes[:2]), values[2], slopes[2])

    def kinks(self) -> Iterator[SolutionFault]:
        """Jumps of ∇u or ∇θ inside the body."""
        fields: list[tuple[Keys, Scalar]] = [(("u", i), u) for i, u in enumerate(self._exact.u)]
        fields += [(("theta",), self._exact.theta)] if self._exact.theta is not None else []
        for keys, scalar in fields:
            largest = np.max(np.abs(value_and_gradient(scalar, *self._inside.T)[1]), initial=0.0)
            for bend in kinks(scalar):
                before, after = sides(bend, self._body)
                jump = np.abs(value_and_gradient(scalar, *before.T)[1] - value_and_gradient(scalar, *after.T)[1])
                if np.max(jump, initial=0.0) > JUMP * largest:
                    at = spot(before[int(np.argmax(jump.max(axis=0)))])
                    what = f"bends at {at}, where its gradient jumps by {np.max(jump):.3g}"
                    remedy = "no load of a scene balances that; use a smooth expression, like max(0, s)^2 for max(0, s)"
                    yield SolutionFault(keys, what, remedy)
                    break

    def scene(self, scene: Scene) -> Iterator[SolutionFault]:
        """What is wrong with a scene whose loads were derived; nothing new where scenes differ in heat only."""
        yield from self._values(scene)
        key = (scene.material, scene.boundary, scene.friction)
        if key not in self._checked:
            self._checked.add(key)
            stress = max(_largest(self._all.stress(scene)), scene.material.beta * _largest(self._all.theta))
            for name, role in scene.boundary:
                yield from islice(self._edge(name, role, scene, stress), 1)  # others on the edge may follow from it

    def _edge(self, name: str, role: Role, scene: Scene, stress: float) -> Iterator[SolutionFault]:
        """What an edge leaves no room for: values that must vanish and do not, and what the friction law forbids."""
        at, u, theta = self._edges[name], ("u",), self._exact.theta
        pull = np.einsum("cdn,nd->cn", at.stress(scene), at.normals)

        def zero(keys: Keys, values: Array, scale: float, what: str, remedy: str) -> Iterator[SolutionFault]:
            size = np.nan_to_num(np.abs(values))
            worst = int(np.argmax(size))
            if size[worst] > TOLERANCE * scale:
                yield SolutionFault(keys, f"{what.format(f'{values[worst]:.3g}')}, at {spot(at.points[worst])}", remedy)

        if isinstance(role, Contact):
            u_N, u_T = (np.einsum("cn,nc->n", at.u, axis) for axis in (at.normals, at.tangents))
            xi, largest = -np.einsum("cn,nc->n", pull, at.tangents), _largest(self._all.u)
            remedy = f"give an exact solution that slides along {name}"
            yield from zero(u, u_N, largest, f"u_N is {{}} on the contact edge {name}, not 0", remedy)
            if self._exact.xi is not None:
                given, remedy = value_of(self._exact.xi, *at.points.T), "correct xi, or leave it out: it follows from u"
                yield from zero(("xi",), given - xi, stress, f"xi differs from -S_T of u by {{}} on {name}", remedy)
                xi = given
            yield from _friction(name, at.points, u_T, xi, scene, 1e-9 * largest, stress)
        elif isinstance(role, Free):
            for c, axis in enumerate("xy"):
                what = f"the {axis} component of sigma n is {{}} on the free edge {name}"
                yield from zero(u, pull[c], stress, what, f"give {name} the role traction; its g is derived")
        elif isinstance(role, Clamped) and None in role.u:
            straight = [np.broadcast_to(axis, at.points.shape) for axis in np.eye(2)]
            axes, symbols = ((at.normals, at.tangents), "NT") if role.frame == "nt" else (straight, "xy")
            for held, direction, symbol in zip(role.u, axes, symbols, strict=True):
                if held is None:
                    what = f"u_{symbol} is free on {name}, but the traction in its direction is {{}}"
                    remedy = f"hold it too (u_{symbol}: derived), or give a u without that traction"
                    yield from zero(u, np.einsum("cn,nc->n", pull, direction), stress, what, remedy)
        if not isinstance(role, Convection) and scene.edges(Convection) and theta is not None:
            what = f"d(theta)/dn is {{}} on the edge {name}, which is insulated"
            remedy = f"make {name} a convection edge, or give a theta without slope across it"
            flux = np.einsum("dn,nd->n", at.theta_slope, at.normals)
            yield from zero(("theta",), flux, _largest(self._all.theta_slope), what, remedy)

    def _values(self, scene: Scene) -> Iterator[SolutionFault]:
        """Derived fields without a finite value somewhere."""
        fields: list[tuple[str, str, tuple[Scalar | None, ...], Array]] = [("f", "u", scene.f, self._inside)]
        if scene.heat.theta is None:
            fields.append(("q", "theta", (scene.heat.q,), self._inside))
        for name, role in scene.boundary:
            points = self._edges[name].points
            if isinstance(role, Clamped) and role.frame == "nt":
                ends = np.array([edge.start for edge, _ in body_edges(self._body, (name,))])
                fields.append((f"u_N or u_T on {name}", "u", role.u, np.concatenate([points, ends])))
            if isinstance(role, Loaded):
                fields.append((f"g on {name}", "u", role.g, points))
            if isinstance(role, Convection) and scene.heat.theta is None:
                fields.append((f"theta_bar on {name}", "theta", (scene.heat.theta_bar,), points))
        for symbol, key, scalars, points in fields:
            for field in scalars:
                if not isinstance(field, Expression) or (field, symbol) in self._finite:
                    continue
                self._finite.add((field, symbol))
                bad = np.flatnonzero(~np.isfinite(field.evaluate(*points.T)))
                if len(bad):
                    what = f"{symbol}, derived from it, has no finite value at {spot(points[bad[0]])}"
                    remedy = "give an expression that has its derivatives there, or give the loads"
                    yield SolutionFault((key,), what, remedy)
                    return


def _largest(values: Array) -> float:
    return float(np.max(np.abs(values[np.isfinite(values)]), initial=0.0))


def _friction(
    name: str, points: Array, u_T: Array, xi: Array, scene: Scene, near: float, stress: float
) -> Iterator[SolutionFault]:
    """Where −S_T lies outside b̂(u_T)."""
    b = law_along(scene.friction, (name,), np.zeros(len(u_T), dtype=np.intp), points)
    low, high = b.interval(u_T, near)
    off = np.maximum(np.maximum(low - xi, xi - high), 0.0)
    worst = int(np.argmax(np.nan_to_num(off)))
    # stress is sampled INWARD of the edge, which alone leaves so much where there is no friction to compare with
    slack = max(TOLERANCE * max(b.b_scale, _largest(xi)), 10 * INWARD * stress)
    if off[worst] > slack:
        law = f"[{low[worst]:.6g}, {high[worst]:.6g}]" if low[worst] < high[worst] else f"{low[worst]:.6g}"
        what = (
            f"the friction law does not hold on {name}: at {spot(points[worst])}, where u_T = {u_T[worst]:.6g}, "
            f"-S_T is {xi[worst]:.6g}, but b(u_T) is {law}"
        )
        yield SolutionFault(
            ("u",), what, f"change u or friction, so that -S_T of u lies in b(u_T) everywhere on {name}"
        )
