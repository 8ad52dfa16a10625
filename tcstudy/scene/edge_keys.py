"""The keys of an edge: its role, what the role holds or carries, and what the edge does to heat.

Role and heat are two things: `convection` takes its heat transfer coefficient by itself, every other role a section
`heat`. The rows are part of the table of keys (`scene.keys`), which says what a row does.
"""

from __future__ import annotations

from dataclasses import replace

from tcstudy.scene import units as u
from tcstudy.scene.key import Key, in_section

ROLES = ("clamped", "traction", "contact", "convection", "free")
LOADED = ("traction", "convection")
"""Roles that take a traction and a pressure."""
WITH_HEAT = tuple(role for role in ROLES if role != "convection")
"""Roles with a section `heat`."""


def _component(name: str, meaning: str) -> Key:
    return Key(name, "component", meaning, u.LENGTH, swept=True, affine=True, roles=("clamped",))


_MECHANICAL = (
    Key("role", "choice", "of the edge", example="clamped", required=True, words=ROLES),
    Key(
        *("u", "displacement", "both components (default: 0; `free` frees one)", u.LENGTH),
        swept=True,
        roles=("clamped",),
    ),
    _component("u_x", "displacement in x; a component left out is free"),
    _component("u_y", "displacement in y"),
    _component("u_N", "displacement along the outward normal"),
    _component("u_T", "displacement along the edge"),
    Key("g", "vector", "traction", u.TRACTION, swept=True, affine=True, roles=LOADED),
    Key("pressure", "field", "on the edge, positive when it pushes", u.TRACTION, swept=True, affine=True, roles=LOADED),
)
_EXCHANGE = (
    Key("alpha", "number", "its own heat transfer coefficient", u.HEAT_TRANSFER, above=0.0, swept=True),
    Key("theta_bar", "field", "its own surroundings", u.TEMPERATURE, swept=True, affine=True),
    Key("flux", "field", "heat into the body", u.HEAT_FLUX, swept=True, affine=True),
)
_HEAT = Key("heat", "section", "what the edge does to heat (default: nothing)", roles=WITH_HEAT, of=("edge_heat",))
_THETA = Key("theta", "field", "temperature held on the edge", u.TEMPERATURE, swept=True, affine=True)

EDGE_ROWS: tuple[Key, ...] = (
    *in_section("boundary", *_MECHANICAL, *(replace(row, roles=("convection",)) for row in _EXCHANGE), _HEAT),
    *in_section("edge_heat", _THETA, *_EXCHANGE),
)
"""Rows of `boundary.EDGE` and of `boundary.EDGE.heat`."""
