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

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from tcstudy.exact.fields import Vector, body_edges, edge_samples, kinks, normal_field
from tcstudy.expressions.algebra import Term, scalar, term
from tcstudy.expressions.derivative import derivative, gradient
from tcstudy.expressions.expression import Expression, Scalar, value_of
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
        theta = exact.theta if exact.theta is not None else 0.0
        self.u, self.theta = tuple(map(term, exact.u)), term(theta)
        self._smooth = not any(kinks(component) for component in (*exact.u, theta))
        self._inside = inside(body)
        self._normals: dict[tuple[str, ...], Vector] = {}
        self._scalars: dict[tuple[Term, tuple[str, ...]], Scalar] = {}
        self._made: dict[tuple[tuple[str, ...], Material], tuple[Scalar, Scalar]] = {}

    def scene(self, scene: Scene) -> Scene:
        """The scene with its loads, prescribed displacements and temperatures derived; what it holds is not used."""
        roles = tuple((name, self._role(name, role, scene.material)) for name, role in scene.boundary)
        return replace(scene, boundary=roles, f=self.load((), scene.material), heat=self.heat(scene))

    def load(self, names: tuple[str, ...], material: Material) -> tuple[Scalar, Scalar]:
        """g = σn on the edges of the given names; for no names f = −div σ in the body."""
        if (names, material) in self._made:
            return self._made[names, material]
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
            parts, heat = [second for d in parts for second in gradient(d)], list(gradient(self.theta))
        parts = [(lam + 2.0 * mu) * d for d in parts] + [beta * d for d in heat]
        self._made[names, material] = self._scalar(made[0], parts, names), self._scalar(made[1], parts, names)
        return self._made[names, material]

    def normal(self, names: tuple[str, ...]) -> Vector:
        """N = n on the edges of the given names."""
        if names not in self._normals:
            self._normals[names] = normal_field(self.body, body_edges(self.body, names))
        return self._normals[names]

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
        q = self._scalar(-k * (second[0] + second[1]), [k * d for d in second], ())
        return Heat(None, alpha, self._scalar(theta_bar, [], names), q, ())

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

    def _scalar(self, of: Term, parts: Sequence[Term], names: tuple[str, ...]) -> Scalar:
        """The term as a scalar, 0 if it is rounding of its parts on the edges of the names (in the body without)."""
        if (of, names) not in self._scalars:
            made = scalar(of)
            if isinstance(made, Expression) and self._smooth:
                points = self._inside
                if names:
                    points = np.concatenate([edge_samples(*edge)[0] for edge in body_edges(self.body, names)])
                size = sum((np.abs(value_of(scalar(part), *points.T)) for part in parts), np.zeros(len(points)))
                small = np.abs(value_of(made, *points.T)) <= VANISHING * size
                made = 0.0 if len(points) and np.isfinite(size).all() and np.all(small) else made
            self._scalars[of, names] = made
        return self._scalars[of, names]


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
