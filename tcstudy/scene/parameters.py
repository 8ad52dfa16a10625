"""What a sweep may vary, out of the table of keys, and short names of key paths.

The numbers of a scene that a path, a history, a fit or a derivative may change, and the scene with
other loads; with another value of any number it is read again (`read.scenes.SceneReader`).
"""

from __future__ import annotations

import math
from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Any

from tcstudy.expressions.expression import Expression, product
from tcstudy.laws.composed import POINTS, EdgeLaws
from tcstudy.laws.laws import Laws
from tcstudy.laws.shapes import SHAPES
from tcstudy.scene.keys import LAWS, LOADED, Key, law_rows, parameter_names, row, rows
from tcstudy.scene.records import (
    Clamped,
    Convection,
    Loaded,
    Material,
    Rigid,
    Role,
    Scalar,
    Scene,
    exchanges,
)
from tcstudy.scene.units import LENGTH, TRACTION

Keys = tuple[str, ...]
Place = tuple["str | int", ...]


NUMBERS = ("number", "integer", "field", "component", "number or word")
"""Kinds of keys whose values are numbers, or texts where they are none."""
WHOLE: dict[str, tuple[str, ...]] = {"law": ("law",), "material": tuple(rows("material"))}
"""Kinds of keys that are sections whose values a sweep names, and keys of which each has one."""

_ALONE = ("title", "institution", "units", "solver", "exact", "history", "output")
FIXED = dict.fromkeys(_ALONE, "write one study for each, or use --set") | {
    "body": "sweep a number that it gives, such as body.rectangle.height, "
    "or a name of parameters that it uses",
    "load": "sweep a load by its path, or follow it: path: {parameter: load, from: 0, to: 1}",
    "mesh": "sweep mesh.maxh, mesh.grading or mesh.marking",
    "h": "sweep mesh.maxh, or give the sizes as levels: mesh: {maxh: [20 mm, 10 mm]}",
}
"""Sections that cannot be swept, and what to do instead."""


def swept_row(path: Keys, law: str = "", edges: Collection[str] = ()) -> Key | None:
    """Return the row of the key at a path if a sweep may vary it, by the table alone.

    Names of edges and regions are not checked.
    law:   the law of which a parameter is meant, where laws differ in its dimension
    edges: names of edges that have laws of their own
    """
    section = ""
    row_at = None
    words = list(path)
    while words:
        law_row = None
        if section in LAWS and law in SHAPES:
            law_row = next((row for row in law_rows(law, section) if row.name == words[0]), None)
        row_at = law_row or rows(section).get(words[0])
        by_edge = words.pop(0) in LAWS and bool(edges) and bool(words)
        if row_at is None or (by_edge and words[0] not in edges):
            return None
        if words and (by_edge or row_at.kind == "named sections"):
            words = words[1:]
        section = row_at.of[0] if row_at.of else "."
    if path[0] == "materials" and len(path) == 2:
        return row("", "material")
    return row_at if row_at is not None and row_at.swept else None


SHORT = {
    name: f"{section}.{name}"
    for section in ("friction", "material", "loads", "heat", "adhesion")
    for short_row in rows(section).values()
    if short_row.swept and (section not in LAWS or short_row.kind in NUMBERS)
    if section != "adhesion" or short_row.name not in rows("friction")
    for name in (short_row.name, *short_row.numbers)
}
"""Short names: alpha for heat.alpha, f_x for loads.f_x, k for material.k (a law's k is
friction.k; of a name that both have, friction's is short)."""


def path_of(word: str) -> Keys:
    """Return the key path that a name or a path stands for."""
    return tuple(SHORT.get(word, word).split("."))


@dataclass(frozen=True)
class Number:
    """A number of a scene that a path, a history, a fit or a derivative may change.

    value: in the scene [SI]
    idle:  the reason why it changes nothing; empty if it acts
    place: the fields and indices of the scene that lead to it, if the load is affine in it; else
           empty
    """

    row: Key
    value: Scalar
    idle: str = ""
    place: Place = ()

    @property
    def no_number(self) -> str:
        """Why nothing can be said by this number alone; empty if it can."""
        return (
            f"it varies in space ({self.value})"
            if isinstance(self.value, Expression)
            else self.idle
        )


Found = Iterator[tuple[Keys, Number]]
LOAD = Key("load", "number", "factor of all mechanical loads")
OF_POINT = {
    "s": Key("s", "number", "slip of a law's point", LENGTH),
    "b": Key("b", "number", "b there", TRACTION),
}
FACTORED = {
    name
    for load_row in (*rows("loads").values(), *map(rows("boundary").get, Role.loads))
    if load_row
    for name in load_row.numbers
}
"""Names of the loads that `load` multiplies."""


def _of_rows(record: object, section: str, path: Keys, place: Place, idle: str = "") -> Found:
    """Yield the affine numbers of a record that are given.

    u of a clamped edge is not among them, whose frame has names.
    """
    for affine_row in rows(section).values():
        value = getattr(record, affine_row.name, None)
        if not affine_row.affine or value is None:
            continue
        field = (*place, affine_row.name)
        if affine_row.kind != "vector":
            yield (*path, affine_row.name), Number(affine_row, value, idle, field)
            continue
        for i, (name, component) in enumerate(zip(affine_row.numbers, value, strict=True)):
            yield (*path, name), Number(affine_row, component, idle, (*field, i))


def _of_clamped(role: Clamped, path: Keys, place: Place) -> Found:
    """Yield the displacements of an edge, and the forces on the free components of a rigid one."""
    components = ("u_x", "u_y") if role.frame == "xy" else ("u_N", "u_T")
    for i, name in enumerate(components):
        displacement = role.u[i]
        if displacement is not None:
            number = Number(row("boundary", name), displacement, place=(*place, "u", i))
            yield (*path, name), number
        elif isinstance(role, Rigid):
            force = Number(row("boundary", "force"), role.force[i], place=(*place, "force", i))
            yield (*path, f"force_{name[-1]}"), force


def affine_numbers(scene: Scene) -> Found:
    """Yield the numbers of a scene in which the load is affine, by key path.

    ("load",) is a factor of f, g, pressure, force and moment.
    """
    heat = scene.heat
    roles = [(edge, role, ("boundary", i, 1)) for i, (edge, role) in enumerate(scene.boundary)]
    unloaded = "alpha_T (or beta) is 0, so temperature does not load the body"
    idle = "" if scene.material.expands else unloaded
    uses_theta_bar = any(
        exchanges(role) and (role.heat is None or role.heat.theta_bar is None)
        for _, role, _ in roles
    )
    acts = {"theta": True, "theta_bar": heat.theta is None and uses_theta_bar}
    acts["q"] = bool(scene.held_theta) or any(alpha > 0.0 for _, alpha, _ in scene.exchange)
    for path, number in _of_rows(heat, "heat", ("heat",), ("heat",), idle):
        if acts[path[-1]]:
            yield path, number
    for edge, role, place in roles:
        inner = () if isinstance(role, Convection) else ("heat",)
        path = ("boundary", edge, *inner)
        yield from _of_rows(role.heat, "edge_heat", path, (*place, "heat"), idle)
    yield from _of_rows(scene, "loads", ("loads",), ())
    for edge, role, place in roles:
        path = ("boundary", edge)
        if role.moment is not None:
            moment = Number(row("boundary", "moment"), role.moment, place=(*place, "moment"))
            yield (*path, "moment"), moment
        if isinstance(role, Clamped):
            yield from _of_clamped(role, path, place)
        elif isinstance(role, Loaded):
            yield from _of_rows(role, "boundary", path, place)
    loaded = scene.f != (0.0, 0.0) or any(role.loaded for _, role in scene.boundary)
    unloaded = "the study has no f, g, pressure, force or moment"
    yield ("load",), Number(LOAD, 1.0, "" if loaded else unloaded)


def numbers(scene: Scene) -> Found:
    """Yield all numbers of a scene by which its solution can be differentiated, by key path."""
    yield from affine_numbers(scene)
    materials: list[tuple[Keys, Material]] = [(("material",), scene.material)]
    materials += [(("materials", name), material) for name, material in scene.material.regions]
    for path, material in materials:
        for name in ("E", "nu", "alpha_T", "beta", "k"):
            value = getattr(material, name)
            if value is not None:
                yield (*path, name), Number(row("material", name), value)
    roles: list[tuple[Keys, Role]]
    roles = [(("boundary", edge), role) for edge, role in scene.boundary]
    if scene.heat.theta is None and scene.conducts:
        if any(exchanges(role) and not (role.heat and role.heat.alpha) for _, role in roles):
            yield ("heat", "alpha"), Number(row("heat", "alpha"), scene.heat.alpha)
        for path, role in roles:
            if role.heat and role.heat.alpha:
                inner = ("alpha",) if isinstance(role, Convection) else ("heat", "alpha")
                yield (*path, *inner), Number(row("edge_heat", "alpha"), role.heat.alpha)
    for path, role in roles:
        if role.word not in LOADED:
            continue
        idle = "" if any(role.spring) else "the edge has no springs"
        for spring_row, stiffness in zip(rows("spring").values(), role.spring, strict=True):
            yield (*path, "spring", spring_row.name), Number(spring_row, stiffness, idle)
    for section in LAWS:
        laws = getattr(scene, section)
        if isinstance(laws, EdgeLaws):
            for edge, law, strength in laws.laws:
                # a law of all edges whose strength varies has no edge
                yield from _of_law(law, (section, edge) if edge else (section,), strength)
        elif laws is not None:
            yield from _of_law(laws, (section,), 1.0)


def _of_law(law: Laws, path: Keys, strength: Scalar) -> Found:
    """Yield the parameters of a law, those of its points, and its strength."""
    if law.made is None:
        return
    values = law.made.values
    names = parameter_names(law.made.shape, path[0])
    for parameter_row in law_rows(law.made.shape, path[0]):
        value = values[names[parameter_row.name]]
        if isinstance(value, float) and parameter_row.kind != "integer":
            yield (*path, parameter_row.name), Number(parameter_row, value)
    points = values.get(POINTS, ())
    slips = [s for s, _ in points]
    for i, (s, b) in enumerate(points):
        idle = ""
        if i == 0 and values["odd"]:
            idle = "an odd law begins at s = 0"
        elif slips.count(s) > 1:
            idle = "another point has the same s"
        yield (*path, POINTS, str(i)), Number(OF_POINT["b"], float(b))
        yield (*path, POINTS, str(i), "s"), Number(OF_POINT["s"], float(s), idle)
    closing = law.made.closing
    if closing is not None and closing < math.inf:
        yield (*path, "closing"), Number(row(path[0], "closing"), closing)
    if not isinstance(strength, Expression):
        strength = law.made.strength
    yield (*path, "strength"), Number(row(path[0], "strength"), strength)


def path_scene(scene: Scene, parameter: Keys, t: float) -> Scene:
    """Return the scene with the value t [SI] of a number in which its load is affine.

    The factor `load` multiplies the loads that the scene was made with, and those put in later.
    Raises KeyError if the scene has no such number.
    """
    unscaled = scene.unscaled or scene
    place = dict(affine_numbers(unscaled))[parameter].place
    if not place:
        return _scaled_by(unscaled, t)
    new_scene: Scene = _put(unscaled, place, t)
    return new_scene if scene.unscaled is None else _scaled_by(new_scene, scene.load)


def loaded_scene(scene: Scene, values: Mapping[Keys, float]) -> Scene:
    """Return the scene with several loads put in (see `path_scene`).

    Raises KeyError for a load that it does not have.
    """
    for keys, value in values.items():
        scene = path_scene(scene, keys, value)
    return scene


def _put(record: Any, place: Place, value: float) -> Any:
    if not place:
        return value
    key = place[0]
    inner_place = place[1:]
    if isinstance(key, int):
        return (*record[:key], _put(record[key], inner_place, value), *record[key + 1 :])
    return replace(record, **{key: _put(getattr(record, key), inner_place, value)})


def _scaled_by(scene: Scene, factor: float) -> Scene:

    def scaled(value: Any) -> Any:
        if isinstance(value, tuple):
            return tuple(map(scaled, value))
        if isinstance(value, Expression):
            return product(factor, value)
        return None if value is None else factor * value

    boundary = []
    for edge, role in scene.boundary:
        loads = {name: scaled(getattr(role, name)) for name in role.loads}
        boundary.append((edge, replace(role, **loads)))
    return replace(scene, f=scaled(scene.f), boundary=tuple(boundary), load=factor, unscaled=scene)
