"""A row of the table of keys: what is said of one key of a study file; and the rows of an edge.

An edge has a role, which holds or carries something, and may do something to heat: `convection` takes its heat transfer
coefficient by itself, every other role a section `heat`.
"""

from __future__ import annotations

import re
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

from tcstudy.scene import units
from tcstudy.scene.units import NONE, Dimension

Kind = str
"""What a value may be; `read.schema.FRAGMENTS` has all kinds.

number: one for the whole body; quantity, quantities, span: one, some, two of a dimension that another key decides;
field: a number or an expression in x and y; component: that or `free`; vector: two fields; displacement: two
components; named places: a point a name;
section: a mapping of its own; sections, points: a list of them, or by name; names: of regions, or a shape;
one or more: of the words; words: a list of any; choice by edge: a word, or one for each contact edge;
sweep points: a list of them, or their number;
sizes: one or more numbers; law: a friction law; material: the keys of one, whole ones by name in a sweep."""


GREEK = dict(zip(["alpha", "beta", "delta", "lambda", "mu", "nu", "omega", "tau", "theta"], "αβδλμνωτθ", strict=True))
"""Letters that names spell out."""
OF_EDGE = r"boundary{0}(\w+?){0}((?:u|g|f|force)_[xyNT]|theta_bar|[a-z]+)"
"""Names of what an edge has, with {0} between their parts: the edge and its key."""


def symbol(name: str) -> str:
    """How reports write a parameter: `friction.tau_s` is τ_s, `theta_bar` θ̄, `u_x` itself, `friction.points.0` b_0,
    that of its slip s_0; a column `boundary_grip_u_x` u_x of grip, `heat_theta` θ; the rest in words."""
    if match := re.fullmatch(OF_EDGE.format("_"), name):
        return f"{symbol(match[2])} of {match[1].replace('_', ' ')}"
    name = re.sub(r"^(?:heat|friction|material)_(?=\w)", "", name)
    if match := re.search(r"\bpoints[._](\d+)([._]s)?$", name):
        return f"{'s' if match[2] else 'b'}_{match[1]}"
    letter, _, rest = name.rpartition(".")[2].partition("_")
    if len(letter) == 1:
        return name.rpartition(".")[2]
    if letter not in GREEK:
        return f"{letter} {rest}".replace("_", " ").strip()
    return GREEK[letter] + ("\N{COMBINING MACRON}" if rest == "bar" else f"_{rest}" if rest else "")


@dataclass(frozen=True)
class Key:
    """One key of a section.

    section:   the mapping that it belongs to, "" for the study; "boundary" is the mapping of one edge
    dimension: of its numbers
    meaning:   in a line, without the dimension
    example:   a value as it is suggested; by default that of the dimension
    required:  the section cannot be without it; where it depends, the reader decides
    default:   what stands for it if it is not given
    words:     what a choice is between
    least, above, most, below: bounds of a number, with and without themselves
    swept:     whether a sweep may vary it
    affine:    whether the load is affine in it, so that a path may run along it
    roles:     roles of an edge that take it
    of:        the section, or sections, that its value is; of a section by default that of its name
    short:     of a section: the key that a word in its place stands for
    """

    name: str
    kind: Kind
    meaning: str
    dimension: Dimension = NONE
    example: str = ""
    section: str = ""
    required: bool = False
    default: object = None
    words: tuple[str, ...] = ()
    least: float | None = None
    above: float | None = None
    most: float | None = None
    below: float | None = None
    swept: bool = False
    affine: bool = False
    roles: tuple[str, ...] = ()
    of: tuple[str, ...] = ()
    short: str = ""

    def __post_init__(self) -> None:
        if not self.of and self.kind in ("section", "sections", "named sections", "law", "material"):
            object.__setattr__(self, "of", (self.name,))

    @property
    def numbers(self) -> tuple[str, ...]:
        """Names of its single numbers, along which a path may run: f_x and f_y of f."""
        return (f"{self.name}_x", f"{self.name}_y") if self.kind == "vector" else (self.name,)

    @property
    def suggestion(self) -> str:
        """A value that it might have."""
        return self.example or (self.dimension.example if self.dimension != NONE else "...")


def key(path: str, kind: Kind, meaning: str, *more: Any, **given: Any) -> Key:
    """The row of a key by its section and name, "mesh.maxh"; the rest as `Key` has it."""
    section, _, name = path.rpartition(".")
    return replace(Key(name, kind, meaning, *more, **given), section=section)


swept = partial(key, swept=True)
"""The row of a key that a sweep may vary."""
load = partial(swept, affine=True)
"""The row of a key in which the load is affine."""
needed = partial(key, required=True)
"""The row of a key that its section cannot be without."""


ROLES = ("clamped", "symmetry", "rigid", "traction", "contact", "convection", "free")
LOADED = ("traction", "convection")
"""Roles that take a traction, a pressure and springs."""
MOVED = ("clamped", "rigid")
"""Roles that take displacements in x and y."""


def _exchange(section: str, **roles: Any) -> tuple[Key, ...]:
    """What an edge exchanges by itself."""
    alpha = f"{section}.alpha", "number", "its own heat transfer coefficient", units.HEAT_TRANSFER
    return (
        swept(*alpha, above=0.0, **roles),
        load(f"{section}.theta_bar", "field", "its own surroundings", units.TEMPERATURE, **roles),
        load(f"{section}.flux", "field", "heat into the body", units.HEAT_FLUX, **roles),
    )


_FORCED, _OTHERS = (*LOADED, "rigid"), tuple(role for role in ROLES if role != "convection")
_HELD = {"u_x": "in x; a component left out is free", "u_y": "in y"}
_ALONG = {"u_N": "along the outward normal", "u_T": "along the edge"}
_STIFFNESS = {"dimension": units.STIFFNESS, "default": 0.0, "least": 0.0}

EDGE_ROWS: tuple[Key, ...] = (
    needed("boundary.role", "choice", "of the edge", example="clamped", words=ROLES),
    swept("boundary.u", "displacement", "both components (default: 0; `free` frees one)", units.LENGTH, roles=MOVED),
    *(
        load(f"boundary.{name}", "component", f"displacement {said}", units.LENGTH, roles=roles)
        for names, roles in ((_HELD, MOVED), (_ALONG, ("clamped",)))
        for name, said in names.items()
    ),
    load("boundary.g", "vector", "traction", units.TRACTION, roles=LOADED),
    load("boundary.pressure", "field", "on the edge, positive when it pushes", units.TRACTION, roles=LOADED),
    load("boundary.force", "vector", "resultant, spread evenly; moves a rigid edge", units.LINE_FORCE, roles=_FORCED),
    load("boundary.moment", "number", "about the middle of a rigid edge, which turns", units.MOMENT, roles=("rigid",)),
    key("boundary.spring", "section", "stiffness of a support (Winkler)", roles=LOADED),
    *_exchange("boundary", roles=("convection",)),
    key("boundary.heat", "section", "what the edge does to heat (default: nothing)", roles=_OTHERS, of=("edge_heat",)),
    load("edge_heat.theta", "field", "temperature held on the edge", units.TEMPERATURE),
    *_exchange("edge_heat"),
    swept("spring.normal", "number", "along the normal", **_STIFFNESS),
    swept("spring.tangential", "number", "along the edge", **_STIFFNESS),
)
"""Rows of `boundary.EDGE`, of `boundary.EDGE.heat` and of `boundary.EDGE.spring`."""
