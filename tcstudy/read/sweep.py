"""Reads the section `sweep`: which parameters take which values, how they are combined, and their labels in the data.

The values stay nodes of the study: a sweep point is the study with these nodes put at their paths.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Literal

from tcstudy.laws.shapes import SHAPES
from tcstudy.read.fields import Context
from tcstudy.read.node import Node, hint, nearest
from tcstudy.read.points import draw, only_key, read_design, read_table
from tcstudy.scene import keys as table
from tcstudy.scene.designs import DESIGNS, Design
from tcstudy.scene.histories import short_names
from tcstudy.scene.parameters import FIXED, NUMBERS, SHORT, Keys, Parameter
from tcstudy.scene.study import Axis
from tcstudy.scene.units import Dimension, common_unit

MODES = table.row("sweep", "mode").words
MAX_POINTS = 1_000_000
Nodes = tuple[Node, ...]


@dataclass(frozen=True)
class SweptAxis:
    """One parameter, its values as nodes, and what stands for them in the data."""

    key: str
    node: Node
    parameter: Parameter
    values: tuple[Node, ...]
    labels: tuple[float | str, ...]
    distribution: str = ""


@dataclass(frozen=True)
class Sweep:
    """The sweep of a study.

    mode: "grid" for the product of the axes, "list" for axes that are read together
    h:    the list of element sizes, if the sweep has one
    design: how the points were drawn, if they were
    tabled: whether the points stand in a table
    """

    mode: Literal["grid", "list"] = "grid"
    axes: tuple[SweptAxis, ...] = ()
    h: Node | None = None
    design: Design | None = None
    tabled: bool = False

    def written(self) -> dict[str, object]:
        """The section `sweep` with all points listed."""
        points = zip(*([value.plain() for value in axis.values] for axis in self.axes), strict=True)
        listed = [dict(zip((axis.key for axis in self.axes), values, strict=True)) for values in points]
        return {"mode": "list", "points": listed} | ({"h": self.h.plain()} if self.h else {})


def read_sweep(ctx: Context, node: Node, known: Mapping[Keys, Parameter], law: Node | None) -> Sweep | None:
    """The sweep; None after a fault.

    known: the parameters that can be swept
    law:   the friction section of the base study
    """
    before = len(ctx.errors)
    if not isinstance(node.value, Mapping):
        remedy = "write one PARAMETER: [values] per line, for example alpha: [25, 100]"
        ctx.errors.at(node, f"must be a mapping of parameters to values, but is {node.kind()}", remedy)
        return None
    table = node.child("points")
    tabled = table is not None and isinstance(table.value, str)
    mode = ctx.choice(item, MODES) if (item := node.child("mode")) else "list" if tabled else "grid"
    given = {key: item for key, item in node.value.items() if key not in ("mode", "h")}
    design = None
    if mode in DESIGNS:
        design, axes = _drawn(ctx, node, given, known, mode)
    else:
        axes = _point_list(ctx, node, given, known) if mode == "list" else _lists(ctx, given, known)
    _check_axes(ctx, node, axes, mode)
    _check_law_parameters(ctx, axes, law)
    if len(ctx.errors) > before:
        return None
    return Sweep("grid" if mode == "grid" else "list", tuple(axes), node.child("h"), design, tabled)


def _drawn(
    ctx: Context, node: Node, given: Mapping[str, Node], known: Mapping[Keys, Parameter], mode: str
) -> tuple[Design | None, list[SweptAxis]]:
    """The axes of a design, whose values are drawn and read together."""
    items = {key: item for key, item in given.items() if key not in ("points", "seed")}
    found = {key: (item, p) for key, item in items.items() if (p := _parameter(ctx, key, item, known))}
    if not items:
        ctx.errors.at(node, "has no parameter to draw", "add one, for example alpha: {uniform: [25, 100]}")
    design = read_design(ctx, node, mode, MAX_POINTS, len(items))
    axes = []
    for key, (values, names, distribution) in draw(ctx, design, found).items() if design else ():
        axes.append(_axis(ctx, key, *found[key], values, names, distribution))
    return design, axes


def _axis(
    ctx: Context, key: str, node: Node, p: Parameter, values: Nodes, names: tuple[str, ...] = (), drawn: str = ""
) -> SweptAxis:
    """An axis, labelled by names or by its values: numbers in SI, or texts if any value is none."""
    texts, kind = tuple(value.text() for value in values), p.row.kind
    if names or kind not in NUMBERS or (kind == "component" and "free" in texts):
        return SweptAxis(key, node, p, values, names or texts, drawn)
    labels = [ctx.scalar(value, p.row.dimension, varies=kind in ("field", "component")) for value in values]
    numbers = tuple(label for label in labels if isinstance(label, float))
    return SweptAxis(key, node, p, values, numbers if len(numbers) == len(labels) else texts, drawn)


def _lists(ctx: Context, given: Mapping[str, Node], known: Mapping[Keys, Parameter]) -> list[SweptAxis]:
    """The axes whose values stand beside their keys; a fault says what else a short name may have been meant for."""
    found = {key: p for key, item in given.items() if (p := _parameter(ctx, key, item, known))}
    axes, faults = [], ctx.errors.problems
    for key, p in found.items():
        first, others = len(faults), [".".join(path) for path in known if path[-1] == key and path != p.path]
        axes.append(_axis(ctx, key, given[key], p, *_values(ctx, given[key], p)))
        meant = f", or {' or '.join(others)} for {key}, which is {'.'.join(p.path)}" if others else ""
        faults[first:] = [replace(fault, remedy=fault.remedy + meant) for fault in faults[first:]]
    return axes


def _parameter(ctx: Context, key: str, item: Node, known: Mapping[Keys, Parameter]) -> Parameter | None:
    """What a key of the sweep stands for; None after a fault."""
    path = tuple(SHORT.get(key, key).split("."))
    if (found := known.get(path) or known.get(("parameters", key))) is not None:
        return found
    names = [".".join(path) for path in known]
    if path[0] in FIXED:
        what, remedy = f"{path[0]} cannot be swept", FIXED[path[0]]
    elif key in ("points", "seed"):
        what = f"{key} {'are' if key == 'points' else 'is'} for modes that list or draw points"
        remedy = f"add mode: list, or one of {', '.join(DESIGNS)}"
    else:
        stem, _, part = path[-1].rpartition("_")
        of_vector = part in ("x", "y") and [
            ".".join(keys) for keys in known if keys[-1] == stem and keys[: len(path) - 1] == path[:-1]
        ]
        same = [".".join(keys) for keys, p in known.items() if keys[-1] == path[-1] and not p.idle]
        if path[1:] and same:
            same = [nearest(key, same) or same[0]]
        own = [path[1] for path in known if path[0] == "parameters"]
        remedy = hint(key, [*SHORT, *own, *names, "mode"], "use a key path such as heat.alpha or friction.delta")
        if same:
            remedy = f"did you mean {' or '.join(map(repr, same))}?"
        if of_vector and not same:
            remedy = f"sweep all of it, {of_vector[0]}: [[..., ...], [..., ...]]"
            remedy += ", or a number of parameters that it uses"
        what = f"the study has no parameter {key!r} to sweep"
    ctx.errors.at(item, what, remedy, on_key=True)
    return None


def _point_list(
    ctx: Context, node: Node, given: Mapping[str, Node], known: Mapping[Keys, Parameter]
) -> list[SweptAxis]:
    """mode: list, whose points all name the same parameters."""
    points = given.get("points")
    stray = [key for key in given if key != "points"]
    if stray:
        remedy = "put it into points: [{PARAMETER: value, ...}, ...], or use mode: grid"
        what = f"with mode: list the parameter {stray[0]!r} belongs into points"
        ctx.errors.at(given[stray[0]], what, remedy, on_key=True)
    elif points is None:
        ctx.errors.at(node, "is missing", "add points: [{alpha: 25}, {alpha: 100}]", key=f"{node.path}.points")
    if points is None:
        return []
    if isinstance(points.value, str):
        columns = read_table(ctx, points, lambda key, cell: _parameter(ctx, key, cell, known))
        return [_axis(ctx, *column) for column in columns]
    rows = ctx.items(points, "a list of points {PARAMETER: value, ...}", least=1)
    first = rows[0].value if rows else {}
    for row in rows:
        if not isinstance(row.value, Mapping) or not row.value:
            what = f"must be a mapping of parameters to values, but is {row.kind()}"
            ctx.errors.at(row, what, "write {PARAMETER: value, ...}")
            return []
        if isinstance(first, Mapping) and set(row.value) != set(first):
            remedy = "name the same parameters in every point"
            ctx.errors.at(row, f"names {', '.join(row.value)}, but the first point {', '.join(first)}", remedy)
            return []
    axes = []
    for key, item in first.items() if isinstance(first, Mapping) else ():
        if parameter := _parameter(ctx, key, item, known):
            values = tuple(row.value[key] for row in rows if isinstance(row.value, Mapping))
            names: tuple[str, ...] = ()
            if parameter.is_whole:
                names, values = zip(*(_whole(value, parameter) for value in values), strict=True)
            axes.append(_axis(ctx, key, points, parameter, values, names))
    return axes


def _whole(node: Node, parameter: Parameter) -> tuple[str, Node]:
    """A law or a material in a point, after its name: its key in {NAME: law}, else that of its shape or all it says."""
    if isinstance(node.value, Mapping) and len(node.value) == 1 and not parameter.is_one(node.value):
        return next(iter(node.value.items()))
    return str(word.value) if (word := node.child("law")) else node.text(), node


def _check_axes(ctx: Context, node: Node, axes: list[SweptAxis], mode: str) -> None:
    """No parameter twice, equal lengths where read together, no value or point repeated, a bounded number."""
    paths: dict[Keys, str] = {}
    for axis in axes:
        if axis.parameter.path in paths:
            what = f"sweeps the same parameter as {paths[axis.parameter.path]!r}"
            ctx.errors.at(axis.node, what, "keep one of the two", on_key=True)
        paths[axis.parameter.path] = axis.key
    lengths = [len(axis.values) for axis in axes if axis.values]
    same = [  # of numbers those in SI, of others the texts
        [a if isinstance(a, float) else value.text() for a, value in zip(axis.labels, axis.values, strict=True)]
        for axis in axes
    ]
    if mode == "grid":
        for axis, identities in zip(axes, same, strict=True):
            _check_repeated(ctx, axis.values, identities)
        if math.prod(lengths) > MAX_POINTS:
            ctx.errors.at(node, f"the sweep has {math.prod(lengths)} points", f"at most {MAX_POINTS}: use fewer values")
        return
    for axis in axes:
        if axis.values and len(axis.values) != lengths[0]:
            remedy = "with mode: zip give all lists the same length, or use mode: grid"
            what = f"has {len(axis.values)} values, but {axes[0].key} has {lengths[0]}"
            ctx.errors.at(axis.node, what, remedy)
            return
    if axes and len(lengths) == len(axes):
        _check_repeated(ctx, axes[0].values, list(zip(*same, strict=True)))


def _check_law_parameters(ctx: Context, axes: list[SweptAxis], law: Node | None) -> None:
    """A swept parameter of the law must belong to every law of the study."""
    for axis in axes:
        place = axis.parameter.path[:-1]
        if place[:1] != ("friction",) or axis.parameter.is_whole or axis.parameter.path[-1] == "strength":
            continue
        base = law.child(place[1]) if law and place[1:] else law
        laws = [v for whole in axes if whole.parameter.is_whole and whole.parameter.path == place for v in whole.values]
        words = [str(word.value) for node in laws or ([base] if base else []) if (word := node.child("law"))]
        for law_name in words:
            names = [p.name for p in SHAPES[law_name].parameters] if law_name in SHAPES else None
            if names is not None and axis.parameter.path[-1] not in names:
                remedy = f"it has {', '.join(names)}; sweep the whole law by friction: {{NAME: {{law: ...}}, ...}}"
                what = f"the law {law_name} has no parameter {axis.parameter.path[-1]!r}"
                ctx.errors.at(axis.node, what, remedy, on_key=True)
                break


def _check_repeated(ctx: Context, nodes: tuple[Node, ...], identities: Sequence[object]) -> None:
    seen: set[object] = set()
    for node, identity in zip(nodes, identities, strict=True):
        if identity in seen:
            ctx.errors.at(node, f"the value {node.brief()} is repeated", "give every value once")
        if identity == identity:  # a value that could not be read is NaN
            seen.add(identity)


def records(sweep: Sweep, units: str) -> tuple[Axis, ...]:
    """The axes as the rest of the package sees them."""
    names = short_names([axis.parameter.path for axis in sweep.axes])
    axes = []
    for axis, name in zip(sweep.axes, names, strict=True):
        numbers = all(isinstance(label, float) for label in axis.labels)
        cf = axis.parameter.row.dimension.cf if numbers and units == "SI" else "1"
        values = tuple(value.plain() for value in axis.values)
        unit = axis.values[0].shown_in or common_unit(values, axis.parameter.row.dimension)
        written = unit if numbers and units == "SI" and unit[1] != 1.0 else ("", 1.0)
        axes.append(Axis(name, axis.parameter.path, values, axis.labels, cf, axis.distribution, written))
    return tuple(axes)


def _values(ctx: Context, node: Node, parameter: Parameter) -> tuple[tuple[Node, ...], tuple[str, ...]]:
    """The values of an axis, and their names if they are laws or materials."""
    row = parameter.row
    if parameter.is_whole:
        one = parameter.is_one(node.value)
        if isinstance(node.value, Mapping) and not one and node.value:
            return tuple(node.value.values()), tuple(node.value)
        own = "{law: tresca, tau: 20 MPa}" if row.kind == "law" else "{E: 210 GPa, nu: 0.3}"
        remedy = ctx.example(f"write {{NAME: {own}, NAME: ...}}")
        what = f"must be a mapping of names to {row.kind}s, but is {node.kind()}"
        ctx.errors.at(node, f"is a single {row.kind}, not a mapping of names to {row.kind}s" if one else what, remedy)
        return (), ()
    spaced, empty = row.kind in NUMBERS, node.value in (None, (), {})
    if isinstance(node.value, tuple) and not empty:
        return node.value, ()
    if isinstance(node.value, Mapping) and spaced:
        return _spaced(ctx, node, row.dimension), ()
    shown = ctx.example(row.dimension.example) if empty else node.brief()
    example = f"{shown}, ...] or {{linspace: [a, b, n]}}" if spaced else "..., ...]"
    what = "has no values" if empty else f"must be a list of values, but is {node.kind()}"
    ctx.errors.at(node, what, f"write a list such as [{example}")
    return (), ()


def _spaced(ctx: Context, node: Node, dimension: Dimension) -> tuple[Node, ...]:
    """{linspace: [a, b, n]} or {geomspace: [a, b, n]}: n values from a to b, both included."""
    before = len(ctx.errors)
    kind, item = only_key(ctx, node, "values", "linspace and geomspace", "{linspace: [a, b, n]}") or ("", node)
    if not kind:
        return ()
    if not isinstance(item.value, tuple) or len(item.value) != 3:
        ctx.errors.at(item, f"must be [a, b, n], but is {item.kind()}", f"write {{{kind}: [a, b, n]}}")
        return ()
    a, b = (ctx.quantity(end, dimension) for end in item.value[:2])
    n = ctx.integer(item.value[2], 2, MAX_POINTS)
    if kind == "geomspace" and a * b <= 0.0:
        remedy = "give two positive numbers, or use linspace"
        ctx.errors.at(item, f"geomspace needs two ends of one sign, not {a:g} and {b:g}", remedy)
    if a == b:
        ctx.errors.at(item, "both ends are equal, so the values are repeated", "give two different ends")
    if len(ctx.errors) > before:
        return ()
    unit = common_unit([end.value for end in item.value[:2]], dimension) if ctx.units == "SI" else ("", 1.0)
    numbers = (_between(kind, a, b, i / (n - 1)) for i in range(n))
    return tuple(replace(item, value=value, shown_in=unit) for value in numbers)


def _between(kind: str, a: float, b: float, t: float) -> float:
    """The point at t of [a, b], the ends exact; geometric spacing rounded to what logarithms give."""
    if t in (0.0, 1.0):
        return b if t else a
    if kind == "linspace":
        return float(f"{a + (b - a) * t:.15g}")
    return float(f"{math.copysign(math.exp((1 - t) * math.log(abs(a)) + t * math.log(abs(b))), a):.15g}")
