"""The scene of one value of a path's parameter."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from tcstudy.expressions.expression import Expression, parse
from tcstudy.scene.records import Clamped, Convection, Role, Scalar, Scene, Traction


def path_scene(scene: Scene, parameter: tuple[str, ...], t: float) -> Scene:
    """The scene with the value t [SI] put at a parameter's key path (see records.PathPlan).

    ("load",) multiplies f, g and pressure by t; everything else is replaced. Raises KeyError for a parameter that the
    scene does not have.
    """
    section, key = parameter[0], parameter[-1]
    if parameter == ("load",):
        boundary = tuple((name, _scaled_role(role, t)) for name, role in scene.boundary)
        return replace(scene, f=(_scaled(scene.f[0], t), _scaled(scene.f[1], t)), boundary=boundary)
    if section == "heat" and key in ("theta", "theta_bar", "q"):
        values: dict[str, Any] = {key: t}
        return replace(scene, heat=replace(scene.heat, **values))
    if section == "loads" and key in ("f_x", "f_y"):
        return replace(scene, f=(t, scene.f[1]) if key == "f_x" else (scene.f[0], t))
    if section == "boundary" and len(parameter) == 3:
        edge = parameter[1]
        boundary = tuple((name, _role(role, key, t) if name == edge else role) for name, role in scene.boundary)
        return replace(scene, boundary=boundary)
    raise KeyError(".".join(parameter))


def _role(role: Role, key: str, t: float) -> Role:
    """The role with one number put in."""
    if isinstance(role, Clamped) and key in ("u_x", "u_N"):
        return replace(role, u=(t, role.u[1]))
    if isinstance(role, Clamped) and key in ("u_y", "u_T"):
        return replace(role, u=(role.u[0], t))
    if isinstance(role, Traction | Convection) and key in ("g_x", "g_y"):
        return replace(role, g=(t, role.g[1]) if key == "g_x" else (role.g[0], t))
    if isinstance(role, Traction | Convection) and key == "pressure":
        return replace(role, pressure=t)
    raise KeyError(key)


def _scaled_role(role: Role, factor: float) -> Role:
    if not isinstance(role, Traction | Convection):
        return role
    g = (_scaled(role.g[0], factor), _scaled(role.g[1], factor))
    return replace(role, g=g, pressure=_scaled(role.pressure, factor))


def _scaled(scalar: Scalar, factor: float) -> Scalar:
    """factor × a number or an expression."""
    if not isinstance(scalar, Expression):
        return factor * scalar
    return 0.0 if factor == 0.0 else parse(f"{float(factor)!r}*({scalar.text})")
