"""Scenes whose solutions have a proved error bound."""

from __future__ import annotations

from tcstudy.expressions.expression import is_linear
from tcstudy.scene.records import Scene


def why_no_bound(scene: Scene) -> str:
    """Return why `error_bound` is not proved of a scene, and what to do.

    Empty if it is proved wherever ω < λ₁ of the body.
    """
    for name, role in scene.boundary:
        if not all(component is None or is_linear(component) for component in role.u):
            return f"u of {name} is not linear in x and y; write it so"
    for name, theta in scene.held_theta:
        if not is_linear(theta):
            return f"theta of {name} is not linear in x and y; write it so"
    return ""
