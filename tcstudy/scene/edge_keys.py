"""The keys of an edge: its role, what the role holds or carries, and what the edge does to heat.

Role and heat are two things: `convection` takes its heat transfer coefficient by itself, every other role a section
`heat`. The rows are part of the table of keys (`scene.keys`), which says what a row does.
"""

from __future__ import annotations

from dataclasses import replace

from tcstudy.scene import units as u
from tcstudy.scene.key import Key, in_section

ROLES = ("clamped", "symmetry", "rigid", "traction", "contact", "convection", "free")
LOADED = ("traction", "convection")
"""Roles that take a traction, a pressure and springs."""
MOVED = ("clamped", "rigid")
"""Roles that take displacements in x and y."""
WITH_HEAT = tuple(role for role in ROLES if role != "convection")
"""Roles with a section `heat`."""


def _component(name: str, meaning: str, roles: tuple[str, ...] = MOVED) -> Key:
    return Key(name, "component", meaning, u.LENGTH, swept=True, affine=True, roles=roles)


def _stiffness(name: str, meaning: str) -> Key:
    return Key(name, "number", meaning, u.STIFFNESS, default=0.0, least=0.0, swept=True)


_MECHANICAL = (
    Key("role", "choice", "of the edge", example="clamped", required=True, words=ROLES),
    Key(
        *("u", "displacement", "both components (default: 0; `free` frees one)", u.LENGTH),
        swept=True,
        roles=MOVED,
    ),
    _component("u_x", "displacement in x; a component left out is free"),
    _component("u_y", "displacement in y"),
    _component("u_N", "displacement along the outward normal", ("clamped",)),
    _component("u_T", "displacement along the edge", ("clamped",)),
    Key("g", "vector", "traction", u.TRACTION, swept=True, affine=True, roles=LOADED),
    Key("pressure", "field", "on the edge, positive when it pushes", u.TRACTION, swept=True, affine=True, roles=LOADED),
    Key(
        *("force", "vector", "resultant, spread evenly; of a rigid edge it moves the edge", u.LINE_FORCE),
        swept=True,
        affine=True,
        roles=(*LOADED, "rigid"),
    ),
    Key(
        *("moment", "number", "about the middle of a rigid edge, which then turns", u.MOMENT),
        swept=True,
        affine=True,
        roles=("rigid",),
    ),
    Key("spring", "section", "stiffness of a support (Winkler)", roles=LOADED, of=("spring",)),
)
_SPRING = (_stiffness("normal", "along the normal"), _stiffness("tangential", "along the edge"))
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
    *in_section("spring", *_SPRING),
)
"""Rows of `boundary.EDGE`, of `boundary.EDGE.heat` and of `boundary.EDGE.spring`."""
