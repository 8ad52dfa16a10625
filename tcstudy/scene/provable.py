"""Of which scenes the error of a solution can be bounded: those whose data equilibrium elements have exactly."""

from __future__ import annotations

from tcstudy.expressions.derivative import is_linear
from tcstudy.expressions.expression import Expression
from tcstudy.laws.laws import Laws
from tcstudy.scene.points import needs_heat_solve
from tcstudy.scene.records import Scene


def why_no_bound(scene: Scene) -> str:
    """Why `error_bound` is not proved of a scene, and what to do; empty if it is, wherever ω < λ₁ of the body."""
    if any(isinstance(f, Expression) and f.constant is None for f in scene.f):
        return "f varies in the body; give numbers"
    for name, role in scene.boundary:
        given = {"g": role.g, "pressure": (role.pressure,), "u": [u for u in role.u if u is not None]}
        for key, values in given.items():
            if not all(map(is_linear, values)):
                return f"{key} of {name} is not linear in x and y; write it so"
    if needs_heat_solve(scene):
        return "the temperature is computed on the mesh; give theta, or the same theta_bar everywhere and no q"
    if scene.material.expands and scene.heat.theta is not None and not is_linear(scene.heat.theta):
        return "theta is not linear in x and y; write it so"
    if any(law.omega == float("inf") for law in scene.laws):
        return "the friction law jumps down; let it fall over a slip"
    strengths = () if isinstance(scene.friction, Laws) else [factor for _, _, factor in scene.friction.laws]
    if any(isinstance(factor, Expression) and factor.constant is None for factor in strengths):
        return "the strength of friction varies along an edge; give numbers by edge"
    return ""
