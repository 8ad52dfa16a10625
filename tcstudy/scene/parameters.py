"""What a sweep may vary, out of the table of keys: key paths with their kind and dimension, and the short names.

The scene with another value of one of its numbers: of a path's parameter, and of those that a fit is to find; and how
fast the moduli of a material change with one of its numbers. Of E and ν: μ = E/2(1 + ν); plane strain
λ = Eν/((1 + ν)(1 − 2ν)), plane stress λ = Eν/(1 − ν²); β = α_T E/(1 − cν) with c = 2 and 1 (`Material.bulk`), which
changes with E and ν where α_T is given and not β.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple, TypeVar

from tcstudy.expressions.expression import Expression, parse
from tcstudy.laws.composed import EdgeLaws
from tcstudy.laws.derivatives import POINTS, number_of, point_of
from tcstudy.laws.laws import Laws
from tcstudy.laws.shapes import SHAPES
from tcstudy.scene.fits import Sensitivity
from tcstudy.scene.key import Key
from tcstudy.scene.keys import ROWS, law_rows, rows
from tcstudy.scene.records import Clamped, Loaded, Material, Rigid, Role, Scalar, Scene, resultant

Keys = tuple[str, ...]
R = TypeVar("R")


NUMBERS = ("number", "integer", "field", "component")
"""Kinds of keys whose values are numbers, or texts where they are none."""
WHOLE: dict[str, tuple[str, ...]] = {"law": ("law",), "material": tuple(rows("material"))}
"""Kinds of keys that are sections whose values a sweep names, and keys of which each has one."""


@dataclass(frozen=True)
class Parameter:
    """A key that can be swept, and where.

    idle: whether the role of its edge has no use for it, so that it is none to propose
    """

    path: Keys
    row: Key
    idle: bool = False

    @property
    def is_whole(self) -> bool:
        """Whether its values are whole laws or materials, by name."""
        return self.row.kind in WHOLE

    def is_one(self, value: object) -> bool:
        """Whether a value is a single law or material, not several by name."""
        return isinstance(value, Mapping) and any(key in value for key in WHOLE[self.row.kind])


OF_EDGES = ("boundary", "edge_heat", "spring")
"""Sections whose keys belong to one edge."""
PLAIN: dict[Keys, Parameter] = {
    path: Parameter(path, row)
    for row in ROWS
    if row.swept and row.section not in OF_EDGES and (path := (row.section, row.name) if row.section else (row.name,))
}
"""Parameters of every study but those of the law and of the edges."""
EDGE: dict[Keys, Key] = {
    **{(row.name,): row for row in rows("boundary").values() if row.swept},
    **{("heat", row.name): row for row in rows("edge_heat").values() if row.swept},
    **{("spring", row.name): row for row in rows("spring").values() if row.swept},
}
"""Parameters of one edge, by path in its mapping."""

FIXED = {row.name: row.fixed for row in rows("").values() if row.fixed}
"""Sections that cannot be swept, and what to do instead."""


def sweepable(
    edges: Mapping[str, Sequence[str]], law: str | Mapping[str, str] | None, regions: Sequence[str] = ()
) -> dict[Keys, Parameter]:
    """All parameters by path.

    edges:   the keys that each edge's role takes
    law:     the base law, which decides where laws differ in a parameter's dimension; of each contact edge where edges
             have their own
    regions: those that have a material of their own
    """
    found = dict(PLAIN)
    for region in regions:
        for one in (one for path, one in PLAIN.items() if path[0] == "material" and path[-1] != "plane"):
            here = ("materials", region, *one.path[1:])
            found[here] = Parameter(here, one.row)
    places: dict[Keys, str | None] = {("friction",): law if isinstance(law, str) else None}
    if isinstance(law, Mapping):
        del found["friction", "strength"]
        places = {("friction", edge): own for edge, own in law.items()}
        found |= {path: Parameter(path, PLAIN[("friction",)].row) for path in places}
    for place, own in places.items():
        for name in (*([own] if own in SHAPES else []), *SHAPES):
            for row in (*law_rows(str(name)), PLAIN["friction", "strength"].row):
                path = (*place, row.name)
                found.setdefault(path, Parameter(path, row))
    for edge, taken in edges.items():
        for inner, row in EDGE.items():
            path = ("boundary", edge, *inner)
            found[path] = Parameter(path, row, idle=inner[0] not in taken)
    return found


SHORT = {
    path[-1]: ".".join(path)
    for path in (
        *(path for path, one in sweepable({}, None).items() if path[0] == "friction" and one.row.kind in NUMBERS),
        *(path for path in PLAIN if len(path) == 2),
    )
}
"""Short names: alpha for heat.alpha, k for material.k (a law's k is friction.k)."""


def path_scene(scene: Scene, parameter: tuple[str, ...], t: float) -> Scene:
    """The scene with the value t [SI] put at a parameter's key path (see records.PathPlan).

    ("load",) multiplies f, g, pressure, force and moment by t; everything else is replaced. Raises KeyError for a
    parameter that the scene does not have.
    """
    section, key = parameter[0], parameter[-1]
    if parameter == ("load",):
        boundary = tuple((name, _scaled_role(role, t)) for name, role in scene.boundary)
        return replace(scene, f=(_scaled(scene.f[0], t), _scaled(scene.f[1], t)), boundary=boundary)
    if section == "heat":
        return replace(scene, heat=_put(scene.heat, section, key, t))
    if section == "loads":
        return _put(scene, section, key, t)
    if section == "boundary" and len(parameter) > 2:
        roles = ((name, _role(role, key, t) if name == parameter[1] else role) for name, role in scene.boundary)
        return replace(scene, boundary=tuple(roles))
    raise KeyError(".".join(parameter))


def loaded_scene(scene: Scene, values: Mapping[Keys, float]) -> Scene:
    """The scene with several loads put in (see `path_scene`); raises KeyError for one that it does not have."""
    for keys, value in values.items():
        scene = path_scene(scene, keys, value)
    return scene


def with_number(scene: Scene, by: Sensitivity, value: float) -> Scene:
    """The scene with another value of one number. Raises LawError or GrowthError where a law cannot have it."""
    section, name = by.path[0], by.path[-1]
    if section == "friction":
        name, friction = number_of(by.path), scene.friction
        if isinstance(friction, Laws):
            return replace(scene, friction=_law(friction, name, value))
        edges = ("", *by.path)
        laws = ((edge, _law(law, name, value) if edge in edges else law, at) for edge, law, at in friction.laws)
        return replace(scene, friction=EdgeLaws(tuple(laws)))
    material = scene.material
    if section == "material":
        return replace(scene, material=with_modulus(material, name, value, by.heat_grows))
    if section == "materials":
        own = (
            (at, with_modulus(m, name, value, by.heat_grows) if at == by.path[1] else m) for at, m in material.regions
        )
        return replace(scene, material=replace(material, regions=tuple(own)))
    return path_scene(scene, by.path, value)


def number_in(scene: Scene, by: Sensitivity) -> float:
    """The value of a number that `with_number` puts in. Raises KeyError for one that the scene does not have."""
    section, name = by.path[0], by.path[-1]
    if section == "load":
        return 1.0
    if section == "friction":
        edges, found = ("", *by.path), scene.friction
        laws = [found] if isinstance(found, Laws) else [law for edge, law, _ in found.laws if edge in edges]
        return _number_of_law(laws[0], number_of(by.path))
    if section in ("material", "materials"):
        own = scene.material if section == "material" else dict(scene.material.regions)[by.path[1]]
        return float(own.beta / own.bulk if name == "alpha_T" else getattr(own, name))
    if section != "boundary":
        return _got(scene.heat if section == "heat" else scene, section, name)
    role = dict(scene.boundary)[by.path[1]]
    if isinstance(role, Clamped) and name in ("u_x", "u_y", "u_N", "u_T"):
        return float(role.u[name in ("u_y", "u_T")])  # type: ignore[arg-type]
    if name in rows("edge_heat"):
        return _got(role.heat, "edge_heat", name)
    if isinstance(role, Loaded) and name in rows("spring"):
        return float(role.spring[name != "normal"])
    return _got(role, "boundary", name)


def _number_of_law(law: Laws, name: str) -> float:
    made = law.made
    if made is None:
        raise KeyError(name)
    if name == "strength":
        return made.strength
    value = made.values[POINTS][point_of(law, name)][1] if name.startswith(f"{POINTS}.") else made.values[name]
    return float(value)


def _law(law: Laws, name: str, value: float) -> Laws:
    made = law.made
    if made is None:
        raise KeyError(name)
    shape = SHAPES[made.shape]
    if name == "strength":
        return shape.build(**made.values).times(value)
    if name.startswith(f"{POINTS}."):
        points = list(made.values[POINTS])
        points[point_of(law, name)] = (points[point_of(law, name)][0], value)
        name, value = POINTS, points  # type: ignore[assignment]
    return shape.build(**{**made.values, name: value}).times(made.strength)


def affine_numbers(record: object, section: str) -> Iterator[tuple[Key, str, Scalar]]:
    """(key, name, value) of every number of a record in which the load is affine; u of a clamped edge is not among
    them, as its names depend on the frame, and nothing that is not given."""
    for row in rows(section).values():
        value = getattr(record, row.name, None)
        if row.affine and value is not None:
            for name, part in zip(row.numbers, value if row.kind == "vector" else (value,), strict=True):
                yield row, name, part


def _put(record: R, section: str, key: str, t: float) -> R:
    """The record with one number put in. Raises KeyError where it has none of this name."""
    for row in rows(section).values():
        value = getattr(record, row.name, None)
        if key in row.numbers and value is not None:
            parts = zip(row.numbers, value if row.kind == "vector" else (value,), strict=True)
            new = tuple(t if name == key else part for name, part in parts)
            return replace(record, **{row.name: new if row.kind == "vector" else t})  # type: ignore[type-var]
    raise KeyError(key)


def _got(record: object, section: str, key: str) -> float:
    """One number of a record. Raises KeyError where it has none of this name."""
    for row in rows(section).values():
        value = getattr(record, row.name, None)
        if key in row.numbers and value is not None:
            return float(value[row.numbers.index(key)] if row.kind == "vector" else value)
    raise KeyError(key)


def _role(role: Role, key: str, t: float) -> Role:
    """The role with one number put in."""
    if isinstance(role, Clamped) and key in ("u_x", "u_N"):
        return replace(role, u=(t, role.u[1]))
    if isinstance(role, Clamped) and key in ("u_y", "u_T"):
        return replace(role, u=(role.u[0], t))
    if key in rows("edge_heat"):
        return replace(role, heat=_put(role.heat, "edge_heat", key, t))
    if isinstance(role, Loaded) and key in rows("spring"):
        return replace(role, spring=(t, role.spring[1]) if key == "normal" else (role.spring[0], t))
    return _put(role, "boundary", key, t)


def _scaled_role(role: Role, factor: float) -> Role:
    x, y = resultant(role)
    if isinstance(role, Rigid):
        moment = None if role.moment is None else factor * role.moment
        return replace(role, force=(factor * x, factor * y), moment=moment)
    if not isinstance(role, Loaded):
        return role
    g = (_scaled(role.g[0], factor), _scaled(role.g[1], factor))
    return replace(role, g=g, pressure=_scaled(role.pressure, factor), force=(factor * x, factor * y))


def _scaled(scalar: Scalar, factor: float) -> Scalar:
    """factor × a number or an expression."""
    if not isinstance(scalar, Expression):
        return factor * scalar
    return 0.0 if factor == 0.0 else parse(f"{float(factor)!r}*({scalar.text})")


class ModuliSlope(NamedTuple):
    """Derivatives of λ, μ, β and k of a material by one of its numbers."""

    lam: float = 0.0
    mu: float = 0.0
    beta: float = 0.0
    k: float = 0.0


def with_modulus(material: Material, name: str, value: float, heat_grows: bool) -> Material:
    """The material with another E, nu, alpha_T, beta or k; materials of regions stay.

    heat_grows: whether alpha_T is given, so that β follows E and ν
    """
    if name in ("alpha_T", "beta"):
        return replace(material, beta=value * (material.bulk if name == "alpha_T" else 1.0))
    if name == "k":
        return replace(material, k=value)
    if name == "E":
        t = value / material.E
        beta = t * material.beta if heat_grows else material.beta
        return replace(material, E=value, lam=t * material.lam, mu=t * material.mu, beta=beta)
    if name != "nu":
        raise KeyError(name)
    lam = material.E * value / ((1.0 + value) * _second(material, value))
    new = replace(material, nu=value, lam=lam, mu=0.5 * material.E / (1.0 + value))
    return replace(new, beta=material.beta * new.bulk / material.bulk) if heat_grows else new


def moduli_slope(material: Material, name: str, heat_grows: bool) -> ModuliSlope:
    """Derivatives by E, nu, alpha_T, beta or k."""
    E, nu = material.E, material.nu
    if name in ("alpha_T", "beta"):
        return ModuliSlope(beta=material.bulk if name == "alpha_T" else 1.0)
    if name == "k":
        return ModuliSlope(k=1.0)
    if name == "E":
        return ModuliSlope(material.lam / E, material.mu / E, material.beta / E if heat_grows else 0.0)
    if name != "nu":
        raise KeyError(name)
    c = 2.0 if material.plane == "strain" else 1.0
    lam = E * (1.0 + c * nu**2) / ((1.0 + nu) * _second(material, nu)) ** 2
    beta = c * material.beta / (1.0 - c * nu) if heat_grows else 0.0
    return ModuliSlope(lam, -0.5 * E / (1.0 + nu) ** 2, beta)


def _second(material: Material, nu: float) -> float:
    """1 − 2ν in plane strain, 1 − ν in plane stress."""
    return 1.0 - (2.0 if material.plane == "strain" else 1.0) * nu
