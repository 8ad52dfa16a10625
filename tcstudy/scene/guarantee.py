"""The scenes whose solutions have a proved error bound: their data are exact on equilibrium elements."""

from __future__ import annotations

import math

from tcstudy.expressions.expression import Expression, Scalar, is_linear
from tcstudy.laws.laws import Laws
from tcstudy.scene.records import Scene


def why_no_bound(scene: Scene) -> str:
    """Return why `error_bound` is not proved of a scene, and what to do.

    Empty if it is proved wherever ω < λ₁ of the body.
    """
    if any(map(_varies, scene.f)):
        return "f varies in the body; give numbers"
    for name, role in scene.boundary:
        data = [(term.key, term.value) for term in role.traction_terms]
        data += [("u", component) for component in role.u if component is not None]
        for key, datum in data:
            if not is_linear(datum):
                return f"{key} of {name} is not linear in x and y; write it so"
    for name, theta in scene.held_theta:
        if not is_linear(theta):
            return f"theta of {name} is not linear in x and y; write it so"
    if scene.material.expands and scene.heat.theta is not None and not is_linear(scene.heat.theta):
        return "theta is not linear in x and y; write it so"
    if any(law.omega == math.inf for law in scene.laws):
        return "the friction law jumps down; let it fall over a slip"
    if not isinstance(scene.friction, Laws):
        strengths = [strength for _, _, strength in scene.friction.laws]
        if any(map(_varies, strengths)):
            return "the strength of friction varies along an edge; give numbers by edge"
    return ""


def _varies(datum: Scalar) -> bool:
    return isinstance(datum, Expression) and datum.constant is None
