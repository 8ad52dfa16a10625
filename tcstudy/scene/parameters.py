"""What a sweep may vary, out of the table of keys, and short names of key paths.

The numbers of a scene that a path, a history, a fit or a derivative may change, and the scene with
other loads; with another value of any number it is read again (`read.scenes.SceneReader`).
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Any

from tcstudy.expressions.expression import Expression, product
from tcstudy.laws.composed import POINTS, EdgeLaws
from tcstudy.laws.shapes import SHAPES
from tcstudy.scene.keys import LOADED, Key, law_rows, row, rows
from tcstudy.scene.records import (
    Clamped,
    Convection,
    Loaded,
    Rigid,
    Role,
    Scalar,
    Scene,
    exchanges,
)
from tcstudy.scene.units import LENGTH, TRACTION

Keys = tuple[str, ...]
Place = tuple["str | int", ...]


NUMBERS = ("number", "integer", "field", "component")
"""Kinds of keys whose values are numbers, or texts where they are none."""
WHOLE: dict[str, tuple[str, ...]] = {"law": ("law",), "material": tuple(rows("material"))}
"""Kinds of keys that are sections whose values a sweep names, and keys of which each has one."""

_ALONE = ("title", "institution", "units", "solver", "exact", "history", "output")
FIXED = dict.fromkeys(_ALONE, "write one study for each, or use --set") | {
    "body": "sweep a number that it gives, such as body.rectangle.height, or a name of parameters that it uses",
    "load": "sweep a load by its path, or follow it: path: {parameter: load, from: 0, to: 1}",
    "mesh": "sweep mesh.maxh, mesh.grading or mesh.marking",
    "h": "sweep mesh.maxh, or give the sizes as levels: mesh: {maxh: [20 mm, 10 mm]}",
}
"""Sections that cannot be swept, and what to do instead."""


def swept_row(path: Keys, law: str = "", edges: Collection[str] = ()) -> Key | None:
    """The row of the key at a path if a sweep may vary it, by the table alone; names of edges and
    regions as they come.

    law: of which a parameter is meant where laws differ in its dimension;  edges: those with laws of their own
    """
    section, found, words = "", None, list(path)
    while words:
        known = (
            {one.name: one for one in law_rows(law)}
            if section == "friction" and law in SHAPES
            else {}
        )
        found = known.get(words[0]) or rows(section).get(words[0])
        by_edge = words.pop(0) == "friction" and bool(edges) and bool(words)
        if found is None or (by_edge and words[0] not in edges):
            return None
        if words and (by_edge or found.kind == "named sections"):
            words = words[1:]
        section = found.of[0] if found.of else "."
    if path[0] == "materials" and len(path) == 2:
        return row("", "material")
    return found if found is not None and found.swept else None


SHORT = {
    name: f"{section}.{name}"
    for section in ("friction", "material", "loads", "heat")
    for one in rows(section).values()
    if one.swept and (section != "friction" or one.kind in NUMBERS)
    for name in (one.name, *one.numbers)
}
"""Short names: alpha for heat.alpha, f_x for loads.f_x, k for material.k (a law's k is
friction.k)."""


def path_of(word: str) -> Keys:
    """The key path that a name or a path stands for."""
    return tuple(SHORT.get(word, word).split("."))


@dataclass(frozen=True)
class Number:
    """A number of a scene that a path, a history, a fit or a derivative may change.

    value: in the scene [SI];  idle: why it changes nothing
    place: of one in which the load is affine: the fields and places of the scene that lead to it; else empty
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
    for one in (*rows("loads").values(), *map(rows("boundary").get, Role.loads))
    if one
    for name in one.numbers
}
"""Names of the loads that `load` multiplies."""


def _of_rows(record: object, section: str, path: Keys, place: Place, idle: str = "") -> Found:
    """The affine numbers of a record that are given; u of a clamped edge is not among them, whose
    frame has names."""
    for one in rows(section).values():
        value = getattr(record, one.name, None)
        if one.affine and value is not None:
            parts = (
                [((), value)]
                if one.kind != "vector"
                else [((i,), part) for i, part in enumerate(value)]
            )
            for name, (inner, part) in zip(one.numbers, parts, strict=True):
                yield (*path, name), Number(one, part, idle, (*place, one.name, *inner))


def affine_numbers(scene: Scene) -> Found:
    """The numbers of a scene in which the load is affine, by key path; ("load",) is a factor of f,
    g, pressure, force and moment."""
    heat, roles = (
        scene.heat,
        [(edge, role, ("boundary", i, 1)) for i, (edge, role) in enumerate(scene.boundary)],
    )
    idle = "" if scene.material.expands else "beta is 0, so temperature does not load the body"
    left = any(exchanges(r) and (r.heat is None or r.heat.theta_bar is None) for _, r, _ in roles)
    acts = {"theta": True, "theta_bar": heat.theta is None and left}
    acts["q"] = bool(scene.held_theta) or any(alpha > 0.0 for _, alpha, _ in scene.exchange)
    yield from (
        one for one in _of_rows(heat, "heat", ("heat",), ("heat",), idle) if acts[one[0][-1]]
    )
    for edge, role, place in roles:
        inner = () if isinstance(role, Convection) else ("heat",)
        yield from _of_rows(
            role.heat, "edge_heat", ("boundary", edge, *inner), (*place, "heat"), idle
        )
    yield from _of_rows(scene, "loads", ("loads",), ())
    for edge, role, place in roles:
        path = ("boundary", edge)
        if role.moment is not None:
            yield (
                (*path, "moment"),
                Number(row("boundary", "moment"), role.moment, place=(*place, "moment")),
            )
        if isinstance(role, Clamped):
            for i, name in enumerate(("u_x", "u_y") if role.frame == "xy" else ("u_N", "u_T")):
                if (held := role.u[i]) is not None:
                    yield (*path, name), Number(row("boundary", name), held, place=(*place, "u", i))
                elif isinstance(role, Rigid):
                    force = Number(
                        row("boundary", "force"), role.force[i], place=(*place, "force", i)
                    )
                    yield (*path, f"force_{name[-1]}"), force
        elif isinstance(role, Loaded):
            yield from _of_rows(role, "boundary", path, place)
    loaded = scene.f != (0.0, 0.0) or any(role.loaded for _, role in scene.boundary)
    yield (
        ("load",),
        Number(LOAD, 1.0, "" if loaded else "the study has no f, g, pressure, force or moment"),
    )


def numbers(scene: Scene) -> Found:
    """All numbers of a scene by which its solution can be differentiated, by key path."""
    yield from affine_numbers(scene)
    regions = ((("materials", name), own) for name, own in scene.material.regions)
    for path, material in (("material",), scene.material), *regions:
        for name in ("E", "nu", "alpha_T", "beta", "k"):
            if (value := getattr(material, name)) is not None:
                yield (*path, name), Number(row("material", name), value)
    roles = [(("boundary", edge), role) for edge, role in scene.boundary]
    if scene.heat.theta is None and scene.conducts:
        if any(exchanges(role) and not (role.heat and role.heat.alpha) for _, role in roles):
            yield ("heat", "alpha"), Number(row("heat", "alpha"), scene.heat.alpha)
        for path, role in roles:
            if role.heat and role.heat.alpha:
                inner = ("alpha",) if isinstance(role, Convection) else ("heat", "alpha")
                yield (*path, *inner), Number(row("edge_heat", "alpha"), role.heat.alpha)
    for path, role in roles:
        for one, k in (
            zip(rows("spring").values(), role.spring, strict=True) if role.word in LOADED else ()
        ):
            idle = "" if any(role.spring) else "the edge rests on no springs"
            yield (*path, "spring", one.name), Number(one, k, idle)
    alone = (
        scene.friction.laws
        if isinstance(scene.friction, EdgeLaws)
        else (("", scene.friction, 1.0),)
    )
    for edge, law, strength in alone:
        path = ("friction", edge) if edge else ("friction",)
        if law.made is not None:
            for one in law_rows(law.made.shape):
                value = law.made.values[one.name]
                if isinstance(value, float) and one.kind != "integer":
                    yield (*path, one.name), Number(one, value)
            points = law.made.values.get(POINTS, ())
            for i, (s, b) in enumerate(points):
                held = "an odd law begins at s = 0" if i == 0 and law.made.values["odd"] else ""
                shared = (
                    "another point has the same s"
                    if [other for other, _ in points].count(s) > 1
                    else ""
                )
                yield (*path, POINTS, str(i)), Number(OF_POINT["b"], float(b))
                yield (*path, POINTS, str(i), "s"), Number(OF_POINT["s"], float(s), held or shared)
            whole = strength if isinstance(strength, Expression) else law.made.strength
            yield (*path, "strength"), Number(row("friction", "strength"), whole)


def path_scene(scene: Scene, parameter: Keys, t: float) -> Scene:
    """The scene with the value t [SI] of a number in which its load is affine; raises KeyError if
    it has none such.

    The factor `load` multiplies the loads that the scene was made with, and those put in later.
    """
    whole = scene.unscaled or scene
    place = dict(affine_numbers(whole))[parameter].place
    if not place:
        return _scaled_by(whole, t)
    found: Scene = _put(whole, place, t)
    return found if scene.unscaled is None else _scaled_by(found, scene.load)


def loaded_scene(scene: Scene, values: Mapping[Keys, float]) -> Scene:
    """The scene with several loads put in (see `path_scene`); raises KeyError for one that it does
    not have."""
    for keys, value in values.items():
        scene = path_scene(scene, keys, value)
    return scene


def _put(record: Any, place: Place, value: float) -> Any:
    if not place:
        return value
    key, rest = place[0], place[1:]
    if isinstance(key, int):
        return (*record[:key], _put(record[key], rest, value), *record[key + 1 :])
    return replace(record, **{key: _put(getattr(record, key), rest, value)})


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
