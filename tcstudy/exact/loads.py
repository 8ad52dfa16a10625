"""The loads under which a given u and θ are the solution: the method of manufactured solutions.

    σ = λ div u I + 2μ ε(u) − βθI,     f = −div σ in Ω,     g = σn on traction and convection edges,
    u on clamped edges (held components only),     q = −kΔθ in Ω,     θ̄ = θ + (k/α) ∂θ/∂n on Γ_θ,   eqs. (1)–(5)

All are expressions by symbolic differentiation. What vanishes to rounding at sample points becomes the number 0, so
that nothing is assembled for it; of expressions with abs, min or max only what vanishes identically does, because
samples may miss where they do not.
Without a convection edge no heat problem is solved: θ is then the known temperature.
Left out: heat flux through other edges and tractions on contact and free edges, which a scene cannot have
(`exact.checks` finds them); a body from a file, whose normals are no expressions.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from tcstudy.exact.fields import Vector, body_edges, edge_samples, kinks, normal_field
from tcstudy.expressions.derivative import Calculus, Scalar
from tcstudy.expressions.expression import Expression
from tcstudy.expressions.tree import TreeNode
from tcstudy.scene.points import distinct
from tcstudy.scene.records import Body, Clamped, Convection, Heat, Loaded, Material, Role, Scene
from tcstudy.scene.study import Exact, Study
from tcstudy.shapes.edges import inside

Array = NDArray[np.float64]

VANISHING = 1e-12
"""A load that is smaller everywhere, relative to the terms it is the sum of, is rounding."""


class Derivation:
    """Loads for one exact solution on one body; scenes that agree in what matters share their expressions."""

    def __init__(self, exact: Exact, body: Body) -> None:
        self.body, self._exact = body, exact
        self.algebra = Calculus()
        theta = exact.theta if exact.theta is not None else 0.0
        self.u, self.theta = tuple(self.algebra.tree(component) for component in exact.u), self.algebra.tree(theta)
        self._smooth = not any(kinks(scalar) for scalar in (*exact.u, theta))
        self._inside = inside(body)
        self._normals: dict[tuple[str, ...], Vector] = {}
        self._scalars: dict[tuple[TreeNode, tuple[str, ...]], Scalar] = {}
        self._made: dict[tuple[tuple[str, ...], Material], tuple[Scalar, Scalar]] = {}

    def scene(self, scene: Scene) -> Scene:
        """The scene with its loads, prescribed displacements and temperatures derived; what it holds is not used."""
        roles = tuple((name, self._role(name, role, scene.material)) for name, role in scene.boundary)
        return replace(scene, boundary=roles, f=self.load((), scene.material), heat=self.heat(scene))

    # -- fields ------------------------------------------------------------------------------------

    def stress(self, material: Material) -> tuple[TreeNode, TreeNode, TreeNode]:
        """(σ_xx, σ_yy, σ_xy)."""
        a = self.algebra
        (u_xx, u_xy), (u_yx, u_yy) = (a.gradient(component) for component in self.u)
        even = a.times(a.number(material.lam), a.plus(u_xx, u_yy))
        even = a.less(even, a.times(a.number(material.beta), self.theta))
        double, shear = a.number(2.0 * material.mu), a.number(material.mu)
        normal = (a.plus(even, a.times(double, u_xx)), a.plus(even, a.times(double, u_yy)))
        return *normal, a.times(shear, a.plus(u_xy, u_yx))

    def load(self, names: tuple[str, ...], material: Material) -> tuple[Scalar, Scalar]:
        """g = σn on the edges of the given names; for no names f = −div σ in the body."""
        if (names, material) in self._made:
            return self._made[names, material]
        a, (s_xx, s_yy, s_xy) = self.algebra, self.stress(material)
        rows, parts, heat = ((s_xx, s_xy), (s_xy, s_yy)), [d for u in self.u for d in a.gradient(u)], [self.theta]
        if names:
            n = self.normal(names)
            made = [a.plus(a.times(row[0], n[0]), a.times(row[1], n[1])) for row in rows]
        else:
            made = [a.minus(a.plus(a.derivative(row[0], "x"), a.derivative(row[1], "y"))) for row in rows]
            parts, heat = [second for d in parts for second in a.gradient(d)], list(a.gradient(self.theta))
        parts = [a.times(a.number(material.lam + 2.0 * material.mu), d) for d in parts]
        parts += [a.times(a.number(material.beta), d) for d in heat]
        self._made[names, material] = self._scalar(made[0], parts, names), self._scalar(made[1], parts, names)
        return self._made[names, material]

    def normal(self, names: tuple[str, ...]) -> Vector:
        """N = n on the edges of the given names."""
        if names not in self._normals:
            self._normals[names] = normal_field(self.algebra, self.body, body_edges(self.body, names))
        return self._normals[names]

    def heat(self, scene: Scene) -> Heat:
        """q and θ̄, or the known θ where no edge convects."""
        names, a = scene.edges(Convection), self.algebra
        if self._exact.theta is None:
            return Heat()
        k, alpha = scene.material.k, scene.heat.alpha
        if not names or not k or not alpha > 0.0:
            return Heat(theta=self._exact.theta)
        slope, n = a.gradient(self.theta), self.normal(names)
        second = [a.derivative(d, v) for d, v in zip(slope, "xy", strict=True)]
        q = a.times(a.number(-k), a.plus(*second))
        flux = a.plus(a.times(slope[0], n[0]), a.times(slope[1], n[1]))
        insulated = self._scalar(flux, slope, names) == 0.0
        theta_bar = self.theta if insulated else a.plus(self.theta, a.times(a.number(k / alpha), flux))
        parts = [a.times(a.number(k), d) for d in second]
        return Heat(None, alpha, self._scalar(theta_bar, [], names), self._scalar(q, parts, ()), ())

    # -- edges -------------------------------------------------------------------------------------

    def _role(self, name: str, role: Role, material: Material) -> Role:
        if isinstance(role, Loaded):
            return replace(role, g=self.load((name,), material), pressure=0.0, force=(0.0, 0.0))
        if not isinstance(role, Clamped):
            return role
        a, given = self.algebra, self._exact.u
        if role.frame == "nt":
            n = self.normal((name,))
            u_N = a.plus(a.times(self.u[0], n[0]), a.times(self.u[1], n[1]))
            u_T = a.less(a.times(self.u[1], n[0]), a.times(self.u[0], n[1]))
            parts = list(self.u)
            given = (self._scalar(u_N, parts, (name,)), self._scalar(u_T, parts, (name,)))
        held = [None if old is None else new for old, new in zip(role.u, given, strict=True)]
        return replace(role, u=(held[0], held[1]))

    def _scalar(self, node: TreeNode, parts: Iterable[TreeNode], names: tuple[str, ...]) -> Scalar:
        """The tree as a scalar, 0 if it is rounding of its parts on the edges of the names (in the body without)."""
        if (node, names) not in self._scalars:
            scalar = self.algebra.scalar(node)
            if isinstance(scalar, Expression) and self._smooth and self._vanishes(scalar, parts, names):
                scalar = 0.0
            self._scalars[node, names] = scalar
        return self._scalars[node, names]

    def _vanishes(self, scalar: Expression, parts: Iterable[TreeNode], names: tuple[str, ...]) -> bool:
        points = self._inside
        if names:
            points = np.concatenate([edge_samples(*edge)[0] for edge in body_edges(self.body, names)])
        x, y = points.T
        size = np.zeros(len(points))
        for part in parts:
            value = self.algebra.scalar(part)
            size += np.abs(value.evaluate(x, y)) if isinstance(value, Expression) else abs(value)
        found = np.abs(scalar.evaluate(x, y))
        return len(points) > 0 and bool(np.isfinite(size).all()) and bool(np.all(found <= VANISHING * size))


def description(study: Study) -> str | None:
    """What was derived, in words; None if nothing was."""
    if study.exact is None or not study.exact.derived:
        return None
    scenes = distinct(study.scenes, "boundary", "f", "heat")
    first = scenes[0]
    words = ["f" if any(s.f != (0.0, 0.0) for s in scenes) else "f = 0"]
    for name, role in first.boundary:
        if isinstance(role, Clamped):
            symbols = ("u_N", "u_T") if role.frame == "nt" else ("u_x", "u_y")
            held = [s for s, component in zip(symbols, role.u, strict=True) if component is not None]
            words.append(f"{' and '.join(held)} on {name}")
        elif isinstance(role, Loaded):
            loaded = any(dict(s.boundary)[name].g != (0.0, 0.0) for s in scenes)
            words.append(f"g on {name}" if loaded else f"g = 0 on {name}")
    if first.heat.theta is not None:
        words.append("theta in the body")
    elif study.exact.theta is not None and (edges := first.edges(Convection)):
        words.append("q" if any(s.heat.q != 0.0 for s in scenes) else "q = 0")
        words.append(f"theta_bar on {', '.join(edges)}")
    return f"derived from the exact solution: {', '.join(words)}"
