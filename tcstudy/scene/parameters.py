"""What a sweep may vary, out of the table of keys: key paths with their kind and dimension, and the short names.

The scene with another value of one of its numbers: of a path's parameter, and of those that a fit is to find.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

from tcstudy.expressions.expression import Expression, parse
from tcstudy.laws.composed import EdgeLaws
from tcstudy.laws.derivatives import POINTS
from tcstudy.laws.laws import Laws
from tcstudy.laws.shapes import SHAPES
from tcstudy.scene.fits import Sensitivity
from tcstudy.scene.key import LOADED, Key
from tcstudy.scene.keys import ROWS, law_rows, row, rows
from tcstudy.scene.records import Clamped, Convection, Loaded, Material, Rigid, Scalar, Scene, exchanges
from tcstudy.scene.units import TRACTION

Keys = tuple[str, ...]
Place = tuple["str | int", ...]


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


OF_EDGES: dict[str, Keys] = {"boundary": (), "edge_heat": ("heat",), "spring": ("spring",)}
"""Sections whose keys belong to one edge, and where they stand in its mapping."""
PLAIN: dict[Keys, Key] = {
    (one.section, one.name) if one.section else (one.name,): one
    for one in ROWS
    if one.swept and one.section not in (*OF_EDGES, "mesh")
}
"""Parameters of every study but those of the law and of the edges."""
EDGE: dict[Keys, Key] = {
    (*inner, one.name): one for section, inner in OF_EDGES.items() for one in rows(section).values() if one.swept
}
"""Parameters of one edge, by path in its mapping."""

FIXED = {one.name: one.fixed for one in rows("").values() if one.fixed}
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
        found |= {("materials", region, *path[1:]): one for path, one in PLAIN.items() if path[0] == "material"}
        del found["materials", region, "plane"]
    if isinstance(law, Mapping):
        del found["friction", "strength"]
    for edge, own in law.items() if isinstance(law, Mapping) else [("", law)]:
        place = ("friction", edge) if edge else ("friction",)
        found[place] = PLAIN[("friction",)]
        for name in (own, *SHAPES):
            for one in (*law_rows(name), PLAIN["friction", "strength"]) if name in SHAPES else ():
                found.setdefault((*place, one.name), one)
    found |= {("boundary", edge, *inner): one for edge in edges for inner, one in EDGE.items()}
    return {
        path: Parameter(path, one, path[0] == "boundary" and path[2] not in edges[path[1]])
        for path, one in found.items()
    }


SHORT = {
    path[-1]: ".".join(path)
    for path in (
        *(path for path, one in sweepable({}, None).items() if path[0] == "friction" and one.row.kind in NUMBERS),
        *(path for path in PLAIN if len(path) == 2),
    )
}
"""Short names: alpha for heat.alpha, k for material.k (a law's k is friction.k)."""


@dataclass(frozen=True)
class Number:
    """A number of a scene that a path, a history, a fit or a derivative may change.

    value:  in the scene [SI];  place: fields and places that lead to it, or to the material or law that has it
    made:   (material or law, value) → the same with another value; None where the value stands at the place
    affine: whether the load is affine in it;  idle: why it changes nothing
    """

    row: Key
    value: Scalar
    place: Place
    made: Callable[[Any, float], Any] | None = None
    affine: bool = False
    idle: str = ""

    @property
    def no_number(self) -> str:
        """Why nothing can be said by this number alone; empty if it can."""
        return "it varies in space" if isinstance(self.value, Expression) else self.idle

    def put(self, scene: Scene, value: float) -> Scene:
        """The scene with another value. Raises LawError or GrowthError where a law cannot have it."""
        return _put(scene, self.place, value, self.made)


def _put(record: Any, place: Place, value: float, made: Callable[[Any, float], Any] | None) -> Any:
    """A record or tuple with a value at a place, or what is made with it."""
    if not place:
        return value if made is None else made(record, value)
    key, rest = place[0], place[1:]
    if isinstance(key, int):
        return (*record[:key], _put(record[key], rest, value, made), *record[key + 1 :])
    return replace(record, **{key: _put(getattr(record, key), rest, value, made)})


def _of_rows(record: object, section: str, path: Keys, place: Place, idle: str = "") -> Iterator[tuple[Keys, Number]]:
    """The affine numbers of a record that are given; u of a clamped edge is not among them, whose frame has names."""
    for one in rows(section).values():
        value = getattr(record, one.name, None)
        if one.affine and value is not None:
            parts = [((), value)] if one.kind != "vector" else [((i,), part) for i, part in enumerate(value)]
            for name, (inner, part) in zip(one.numbers, parts, strict=True):
                yield (*path, name), Number(one, part, (*place, one.name, *inner), affine=True, idle=idle)


def affine_numbers(scene: Scene) -> Iterator[tuple[Keys, Number]]:
    """The numbers of a scene in which the load is affine, by key path; ("load",) is a factor of f, g, pressure, force
    and moment."""
    heat, roles = scene.heat, [(edge, role, ("boundary", i, 1)) for i, (edge, role) in enumerate(scene.boundary)]
    idle = "" if scene.material.expands else "beta is 0, so temperature does not load the body"
    left = any(exchanges(r) and (r.heat is None or r.heat.theta_bar is None) for _, r, _ in roles)
    acts = {"theta": True, "theta_bar": heat.theta is None and left}
    acts["q"] = bool(scene.held_theta) or any(alpha > 0.0 for _, alpha, _ in scene.exchange)
    yield from (one for one in _of_rows(heat, "heat", ("heat",), ("heat",), idle) if acts[one[0][-1]])
    for edge, role, place in roles:
        inner = () if isinstance(role, Convection) else ("heat",)
        yield from _of_rows(role.heat, "edge_heat", ("boundary", edge, *inner), (*place, "heat"), idle)
    yield from _of_rows(scene, "loads", ("loads",), ())
    for edge, role, place in roles:
        path = ("boundary", edge)
        if role.moment is not None:
            yield (*path, "moment"), Number(row("boundary", "moment"), role.moment, (*place, "moment"), affine=True)
        if isinstance(role, Clamped):
            for i, name in enumerate(("u_x", "u_y") if role.frame == "xy" else ("u_N", "u_T")):
                if (held := role.u[i]) is not None:
                    yield (*path, name), Number(row("boundary", name), held, (*place, "u", i), affine=True)
                elif isinstance(role, Rigid):
                    force = Number(row("boundary", "force"), role.force[i], (*place, "force", i), affine=True)
                    yield (*path, f"force_{name[-1]}"), force
        elif isinstance(role, Loaded):
            yield from _of_rows(role, "boundary", path, place)
    loads = (scene.f, *(getattr(role, name) for _, role in scene.boundary for name in MECHANICAL))
    loaded = any(load not in (None, 0.0, (0.0, 0.0)) for load in loads)
    nothing = "" if loaded else "the study has no f, g, pressure, force or moment"
    yield ("load",), Number(LOAD, 1.0, (), _scaled_by, True, nothing)


LOAD = Key("load", "number", "factor of all mechanical loads")


def numbers(scene: Scene) -> Iterator[tuple[Keys, Number]]:
    """All numbers of a scene by which its solution can be differentiated, by key path."""
    yield from affine_numbers(scene)
    regions = enumerate(scene.material.regions)
    own = [(("materials", name), ("material", "regions", i, 1), one) for i, (name, one) in regions]
    for path, place, material in [(("material",), ("material",), scene.material), *own]:
        for name in ("E", "nu", "alpha_T", "beta", "k"):
            if (value := getattr(material, name)) is not None:
                made = partial(Material.with_number, name=name)
                yield (*path, name), Number(row("material", name), value, place, made)
    roles = [(("boundary", edge), ("boundary", i, 1), role) for i, (edge, role) in enumerate(scene.boundary)]
    if scene.heat.theta is None and scene.conducts:
        if any(exchanges(role) and not (role.heat and role.heat.alpha) for _, _, role in roles):
            yield ("heat", "alpha"), Number(row("heat", "alpha"), scene.heat.alpha, ("heat", "alpha"))
        for path, place, role in roles:
            if role.heat and role.heat.alpha:
                inner = ("alpha",) if isinstance(role, Convection) else ("heat", "alpha")
                yield (*path, *inner), Number(row("edge_heat", "alpha"), role.heat.alpha, (*place, "heat", "alpha"))
    for path, place, role in roles:
        for i, one in enumerate(rows("spring").values() if role.word in LOADED else ()):
            idle = "" if any(role.spring) else "the edge rests on no springs"
            yield (*path, "spring", one.name), Number(one, role.spring[i], (*place, "spring", i), idle=idle)
    if isinstance(scene.friction, Laws):
        yield from _of_law(scene.friction, ("friction",), ("friction",), 1.0)
    for i, (edge, law, strength) in enumerate(scene.friction.laws if isinstance(scene.friction, EdgeLaws) else ()):
        yield from _of_law(law, ("friction", edge) if edge else ("friction",), ("friction", "laws", i, 1), strength)


def _of_law(law: Laws, path: Keys, place: Place, strength: Scalar) -> Iterator[tuple[Keys, Number]]:
    """The numbers of a law, the b of its points and its strength."""
    if law.made is None:
        return
    values = law.made.values
    for one in law_rows(law.made.shape):
        if isinstance(value := values[one.name], float) and one.kind != "integer":
            yield (*path, one.name), Number(one, value, place, partial(_law, name=one.name))
    for i, (_, b) in enumerate(values.get(POINTS, ())):
        yield (*path, POINTS, str(i)), Number(_B, float(b), place, partial(_law, name=POINTS, point=i))
    whole = strength if isinstance(strength, Expression) else law.made.strength
    yield (*path, "strength"), Number(row("friction", "strength"), whole, place, partial(_law, name="strength"))


_B = Key("b", "quantity", "b of a point of a law", TRACTION)


def _law(law: Laws, value: float, name: str, point: int = 0) -> Laws:
    """The law with another value of one of its numbers."""
    assert law.made is not None
    shape, given, strength = SHAPES[law.made.shape], dict(law.made.values), law.made.strength
    if name == "strength":
        strength = value
    elif name == POINTS:
        given[name] = [(s, value if i == point else b) for i, (s, b) in enumerate(given[name])]
    else:
        given[name] = value
    return shape.build(**given).times(strength)


def path_scene(scene: Scene, parameter: Keys, t: float) -> Scene:
    """The scene with the value t [SI] of a number in which its load is affine; raises KeyError if it has none such."""
    return dict(affine_numbers(scene))[parameter].put(scene, t)


def loaded_scene(scene: Scene, values: Mapping[Keys, float]) -> Scene:
    """The scene with several loads put in (see `path_scene`); raises KeyError for one that it does not have."""
    for keys, value in values.items():
        scene = path_scene(scene, keys, value)
    return scene


def with_number(scene: Scene, by: Sensitivity, value: float) -> Scene:
    """The scene with another value of one number. Raises KeyError, and LawError or GrowthError as `Number.put`."""
    return dict(numbers(scene))[by.path].put(scene, value)


def number_in(scene: Scene, by: Sensitivity) -> float:
    """The value of a number that `with_number` puts in. Raises KeyError for one that the scene does not have."""
    return float(dict(numbers(scene))[by.path].value)  # type: ignore[arg-type]


MECHANICAL = ("g", "pressure", "force", "moment")
"""Fields of a role that `load` multiplies, beside f."""
FACTORED = {
    name for one in (*rows("loads").values(), *map(rows("boundary").get, MECHANICAL)) if one for name in one.numbers
}
"""Names of the loads that `load` multiplies."""


def _scaled_by(scene: Scene, factor: float) -> Scene:
    """The scene with f, g, pressure, force and moment times a factor."""

    def scaled(value: Any) -> Any:
        if isinstance(value, tuple):
            return tuple(map(scaled, value))
        if isinstance(value, Expression):
            return parse(f"{float(factor)!r}*({value.text})") if factor else 0.0
        return None if value is None else factor * value

    loads = [{name: scaled(getattr(role, name)) for name in MECHANICAL} for _, role in scene.boundary]
    boundary = ((name, replace(role, **own)) for (name, role), own in zip(scene.boundary, loads, strict=True))
    return replace(scene, f=scaled(scene.f), boundary=tuple(boundary))
