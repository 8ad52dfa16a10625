"""Reads the section `sweep`: which parameters take which values, how they are combined, and their labels in the data.

The values stay nodes of the study: a sweep point is the study with these nodes put at their paths.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from typing import Any, Literal

from tcstudy.laws.shapes import SHAPES
from tcstudy.read.document import whole_key
from tcstudy.read.fields import UNNAMED, Context, none_after_fault, only_key, users, words_in
from tcstudy.read.node import Mark, Node, hint, nearest, place_of, put_number, split_path
from tcstudy.read.physics import ALL_KEYS, keys_of, laws_by_edge
from tcstudy.read.points import OF_DESIGNS, draw, read_design, read_table
from tcstudy.scene.designs import DESIGNS, Design
from tcstudy.scene.histories import short_names
from tcstudy.scene.keys import OF_ALL_LAWS, Key, row, rows
from tcstudy.scene.parameters import FIXED, NUMBERS, OF_POINT, SHORT, Keys, Parameter, path_of, sweepable
from tcstudy.scene.points import GEOMETRIC
from tcstudy.scene.study import Axis
from tcstudy.scene.units import LENGTH, Dimension, common_unit

SECTIONS = ("boundary", "material", "loads", "heat", "friction")
"""What makes up a scene beside the body."""
MODES = row("sweep", "mode").words
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

    def at(self, places: Iterable[int]) -> SweptAxis:
        """The axis with some of its values."""
        values, labels = zip(*((self.values[k], self.labels[k]) for k in places), strict=True)
        return replace(self, values=values, labels=labels)

    def ascending(self) -> SweptAxis:
        """The same, its numbers in ascending order where they go up and down: CF wants monotonic coordinates.

        Texts stay in their order: as the values of a dimension they are no strict CF coordinate, but as a label
        variable of another name `data.sel(friction="tresca")` would find no index.
        """
        if any(isinstance(label, str) for label in self.labels):
            return self
        labels = [float(label) for label in self.labels]
        order = sorted(range(len(labels)), key=labels.__getitem__)
        return self if order in ([*range(len(labels))], [*reversed(range(len(labels)))]) else self.at(order)


@dataclass(frozen=True)
class Sweep:
    """The sweep of a study.

    mode: "grid" for the product of the axes, "list" for axes that are read together
    design: how the points were drawn, if they were
    tabled: whether the points stand in a table
    """

    mode: Literal["grid", "list"] = "grid"
    axes: tuple[SweptAxis, ...] = ()
    design: Design | None = None
    tabled: bool = False

    def written(self) -> dict[str, object]:
        """The section `sweep` with all values or points written out."""
        written: dict[str, Any] = {}
        for axis in self.axes:
            plain = [value.plain() for value in axis.values]
            named = [{str(label): value} for label, value in zip(axis.labels, plain, strict=True)]
            whole = {name: value for one in named for name, value in one.items()} if self.mode == "grid" else named
            written[axis.key] = whole if axis.parameter.is_whole else plain
        if self.mode == "list":
            points = [dict(zip(written, point, strict=True)) for point in zip(*written.values(), strict=True)]
            written = {"mode": "list", "points": points}
        return written


def read_sweep(ctx: Context, root: Node, overrides: Sequence[str]) -> Sweep:
    """The sweep; none after a fault in its form, so that the base study is still checked.

    overrides: `--set` options, whose values must not be lost to it
    """
    node, before = root.at("sweep"), len(ctx.errors)
    if node is None or node.value == {}:
        return Sweep()
    if not isinstance(node.value, Mapping):
        remedy = "write one PARAMETER: [values] per line, for example alpha: [25, 100]"
        ctx.errors.at(node, f"must be a mapping of parameters to values, but is {node.kind()}", remedy)
        return Sweep()
    points, known, design = node.at("points"), may_vary(ctx, root, node), None
    tabled = points is not None and isinstance(points.value, str)
    mode = ctx.choice(item, MODES) if (item := node.at("mode")) else "list" if tabled else "grid"
    given = {key: item for key, item in node.value.items() if key != "mode"}
    if mode == "list":
        axes = _point_list(ctx, node, given, known)
    else:
        items = {key: item for key, item in given.items() if mode not in DESIGNS or key not in OF_DESIGNS}
        found = {key: (item, p) for key, item in items.items() if (p := _parameter(ctx, key, item, known))}
        if mode in DESIGNS:
            if not items:
                ctx.errors.at(node, "has no parameter to draw; add one, for example alpha: {uniform: [25, 100]}")
            design = read_design(ctx, node, mode, MAX_POINTS, len(items))
            drawn = draw(ctx, design, found, node.at("correlation")) if design else {}
            axes = [_axis(ctx, key, *found[key], *three) for key, three in drawn.items()]  # type: ignore[arg-type]
        else:
            axes = [_listed(ctx, key, item, p, known) for key, (item, p) in found.items()]
    _check_axes(ctx, node, axes, mode)
    _check_law_parameters(ctx, axes, root.at("friction"))
    if len(ctx.errors) > before:
        return Sweep()
    # parameters of a boundary or a friction that is not there: that is missing, not its keys
    lost = {section for section in ("boundary", "friction") if root.at(section) is None}
    axes = [a for a in axes if a.parameter.path[0] not in lost or a.parameter.is_whole]
    axes = [axis.ascending() for axis in axes] if mode == "grid" else axes
    sweep = Sweep("grid" if mode == "grid" else "list", tuple(axes), design, tabled)
    if ctx.named:
        _check_names(ctx, root, sweep)
    _check_options(ctx, root, sweep, overrides)
    return sweep


def may_vary(ctx: Context, root: Node, node: Node) -> dict[Keys, Parameter]:
    """All that the sweep of this study may vary, by path: keys of its scene, numbers of its body and meshes, names."""
    points, boundary, friction = node.at("points"), root.at("boundary"), root.at("friction")
    named = [path_of(key) for one in (node, *(points.entries if points else ())) for key in one.children]
    edges = {edge: keys_of(item) for edge, item in boundary.children.items()} if boundary else {}
    if boundary is None:  # then those that the sweep names, with all keys
        edges = {words[1]: ALL_KEYS for words in named if len(words) == 3 and words[0] == "boundary"}
    laws = {edge: str(word.value) for edge, one in laws_by_edge(friction).items() if (word := one.at("law"))}
    law = word.value if friction and (word := friction.at("law")) else None
    regions = [*(own.children if (own := root.at("materials")) else ())]
    regions += [words[1] for words in named if words[0] == "materials" and words[1:]]
    known = sweepable(edges, laws or (law if isinstance(law, str) else None), tuple(dict.fromkeys(regions)))
    names = ctx.named.items()
    rows_of: dict[Keys, Key] = {("parameters", name): Key(name, "number", "", one.dimension) for name, one in names}
    for path in named:
        place = place_of(root, path)
        whole = known.get(tuple(word for word in place if isinstance(word, str)))  # a pair, or the points of a law
        keys = split_path(".".join(path)) if path[0] == "body" else None
        if path[0] == "mesh" and (one := rows("mesh").get(path[-1])) and one.swept and len(path) == 2:
            rows_of[path] = replace(one, kind="number")  # its levels are a dimension of their own
        elif keys and (at := root.at(*keys)) and isinstance(at.value, int | float | str):
            rows_of[path] = Key(path[-1], "number", "number of the body", LENGTH)
        elif whole and path not in known and place != path and whole.row.kind == "vector":
            rows_of[path] = replace(whole.row, name=path[-1], kind="field")
        elif whole and path not in known and root.at(*place):
            rows_of[path] = OF_POINT["s" if path[-1] == "s" else "b"]
    return known | {path: Parameter(path, one) for path, one in rows_of.items()}


def _check_names(ctx: Context, root: Node, sweep: Sweep) -> None:
    """A swept name may act in the sections of a scene only, and in no swept value."""
    for axis in (axis for axis in sweep.axes if axis.parameter.path[0] == "parameters"):
        following = users(root, axis.parameter.path[-1])
        for other in sweep.axes:
            if value := next((one for one in other.values if words_in(one, following)), None):
                what = f"is made of {min(words_in(value, following))}, which is swept as well"
                ctx.errors.at(value, what, "write its values out, or put the expression where the key is")
        for key, node in root.children.items():
            if key not in (*UNNAMED, *SECTIONS, "materials", *GEOMETRIC) and (words := words_in(node, following)):
                what = f"is swept, but {key} depends on it ({min(words)}), and a study has one {key}"
                ctx.errors.at(axis.node, what, "write one study for each value, with --set", on_key=True)


def _check_options(ctx: Context, root: Node, sweep: Sweep, overrides: Sequence[str]) -> None:
    """A value of an option that the sweep replaces would be lost without a word."""
    swept = [(a.key, split_path(".".join(a.parameter.path)) or (), a.parameter.is_whole) for a in sweep.axes]
    for option in (text for text in overrides if "=" in text):
        key, _, value = (part.strip() for part in option.partition("="))
        keys, place = split_path(whole_key(root, key)) or (), f"--set {option}"
        for name, path, whole in swept:
            there = root.at(*path)
            above = path[: len(keys)] == keys and there is not None and there.mark.file == place  # its value is of it
            if above or keys[: len(path)] == path:
                listed = (
                    f', --set "sweep.{name}=[{value}]"' if keys == path and sweep.mode == "grid" and not whole else ""
                )
                remedy = f"leave it out here, give the sweep other values{listed}, or remove it by --set sweep=null"
                what = f"{name} is swept, so what this option says of it would not be used"
                ctx.errors.at_mark(Mark(place, 0, 0), ".".join(map(str, path if above else keys)), what, remedy)


def with_swept_keys(root: Node, sweep: Sweep) -> Node:
    """The base study: swept keys that it does not give have the first of their values."""
    whole = {axis.parameter.path for axis in sweep.axes if root.at(*axis.parameter.path)}
    for axis in sorted(sweep.axes, key=lambda axis: len(axis.parameter.path)):
        # A parameter of a law that is itself swept may be foreign to the base law.
        path = axis.parameter.path
        if not root.at(*place_of(root, path)) and path[:1] not in whole:
            with suppress(KeyError):  # something else stands there, which the section's reader records
                root = put_number(root, path, axis.values[0])
    return root


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


def _parameter(ctx: Context, key: str, item: Node, known: Mapping[Keys, Parameter]) -> Parameter | None:
    """What a key of the sweep stands for; None after a fault."""
    path = path_of(key)
    if (found := known.get(("parameters", key)) or known.get(path)) is not None:  # what a study names goes first
        return found
    what = f"the study has no parameter {key!r} to sweep"
    same = [".".join(keys) for keys in known if keys[-1] == path[-1]]
    if path[0] in FIXED:
        what, remedy = f"{path[0]} cannot be swept", FIXED[path[0]]
    elif key in OF_DESIGNS:
        what = f"{key} {'are' if key == 'points' else 'is'} for modes that list or draw points"
        remedy = f"add mode: list, or one of {', '.join(DESIGNS)}"
    elif same:
        same = [nearest(key, same) or same[0]] if path[1:] else same
        remedy = f"did you mean {' or '.join(map(repr, same))}?"
    else:
        words = [*SHORT, *(path[1] for path in known if path[0] == "parameters"), *map(".".join, known), "mode"]
        remedy = hint(key, words, "use a key path such as heat.alpha or friction.delta")
    ctx.errors.at(item, what, remedy, on_key=True)
    return None


def _point_list(
    ctx: Context, node: Node, given: Mapping[str, Node], known: Mapping[Keys, Parameter]
) -> list[SweptAxis]:
    """mode: list, whose points all name the same parameters."""
    points, stray = given.get("points"), [key for key in given if key != "points"]
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
    listed, axes = ctx.items(points, "a list of points {PARAMETER: value, ...}", least=1), []
    for point in listed:
        if not point.children:
            what = f"must be a mapping of parameters to values, but is {point.kind()}"
            ctx.errors.at(point, what, "write {PARAMETER: value, ...}")
            return []
        if {*point.children} != {*listed[0].children}:
            what = f"names {', '.join(point.children)}, but the first point {', '.join(listed[0].children)}"
            ctx.errors.at(point, what, "name the same parameters in every point")
            return []
    for key, item in listed[0].children.items() if listed else ():
        if parameter := _parameter(ctx, key, item, known):
            values, names = tuple(point.children[key] for point in listed), ()
            if parameter.is_whole:
                names, values = zip(*(_whole(value, parameter) for value in values), strict=True)
            axes.append(_axis(ctx, key, points, parameter, values, names))
    return axes


def _whole(node: Node, parameter: Parameter) -> tuple[str, Node]:
    """A law or a material in a point, after its name: its key in {NAME: law}, else that of its shape or all it says."""
    if len(node.children) == 1 and not parameter.is_one(node.value):
        return next(iter(node.children.items()))
    return str(word.value) if (word := node.at("law")) else node.text(), node


def _check_axes(ctx: Context, node: Node, axes: list[SweptAxis], mode: str) -> None:
    """No parameter twice, equal lengths where read together, no value or point repeated, a bounded number."""
    paths: dict[Keys, str] = {}
    for axis in axes:
        if (first := paths.setdefault(axis.parameter.path, axis.key)) != axis.key:
            ctx.errors.at(axis.node, f"sweeps the same parameter as {first!r}; keep one of the two", on_key=True)
    lengths = [len(axis.values) for axis in axes if axis.values]
    same = [  # of numbers those in SI, of others the texts
        [a if isinstance(a, float) else value.text() for a, value in zip(axis.labels, axis.values, strict=True)]
        for axis in axes
    ]
    repeated: list[tuple[Nodes, Sequence[object]]] = []
    if mode == "grid":
        repeated = [(axis.values, one) for axis, one in zip(axes, same, strict=True)]
        if (count := math.prod(lengths)) > MAX_POINTS:
            ctx.errors.at(node, f"the sweep has {count} points; at most {MAX_POINTS}: use fewer values")
    elif odd := next((axis for axis in axes if axis.values and len(axis.values) != lengths[0]), None):
        remedy = "with mode: zip give all lists the same length, or use mode: grid"
        ctx.errors.at(odd.node, f"has {len(odd.values)} values, but {axes[0].key} has {lengths[0]}", remedy)
    elif axes and len(lengths) == len(axes):
        repeated = [(axes[0].values, list(zip(*same, strict=True)))]
    for nodes, identities in repeated:
        seen: set[object] = set()
        for value, identity in zip(nodes, identities, strict=True):
            if identity in seen:
                ctx.errors.at(value, f"the value {value.brief()} is repeated", "give every value once")
            if identity == identity:  # a value that could not be read is NaN
                seen.add(identity)


def _check_law_parameters(ctx: Context, axes: list[SweptAxis], law: Node | None) -> None:
    """A swept parameter of the law must belong to every law of the study."""
    for axis in axes:
        *place, name = axis.parameter.path
        if place[:1] != ["friction"] or axis.parameter.is_whole or name in OF_ALL_LAWS:
            continue
        base = law.at(place[1]) if law and place[1:] else law
        whole = [one for one in axes if one.parameter.is_whole and one.parameter.path == tuple(place)]
        laws = [value for one in whole for value in one.values] or ([base] if base else [])
        for word in (str(own.value) for node in laws if (own := node.at("law"))):
            names = [p.name for p in SHAPES[word].parameters] if word in SHAPES else [name]
            if name not in names:
                remedy = f"it has {', '.join(names)}; sweep the whole law by friction: {{NAME: {{law: ...}}, ...}}"
                ctx.errors.at(axis.node, f"the law {word} has no parameter {name!r}", remedy, on_key=True)
                break


def records(sweep: Sweep, units: str) -> tuple[Axis, ...]:
    """The axes as the rest of the package sees them."""
    names = short_names([axis.parameter.path for axis in sweep.axes])
    axes = []
    for axis, name in zip(sweep.axes, names, strict=True):
        in_si = units == "SI" and all(isinstance(label, float) for label in axis.labels)
        dimension, values = axis.parameter.row.dimension, tuple(value.plain() for value in axis.values)
        unit = axis.values[0].shown_in or common_unit(values, dimension)
        written = unit if in_si and unit[1] != 1.0 else ("", 1.0)
        cf = dimension.cf if in_si else "1"
        axes.append(Axis(name, axis.parameter.path, values, axis.labels, cf, axis.distribution, written))
    return tuple(axes)


def _listed(ctx: Context, key: str, node: Node, p: Parameter, known: Mapping[Keys, Parameter]) -> SweptAxis:
    """The axis of a parameter whose values are listed, spaced, or laws or materials by name."""
    first, kind, values = len(ctx.errors.problems), p.row.kind, node.value
    names: tuple[str, ...] = ()
    if p.is_whole and node.children and not p.is_one(node.value):
        values, names = tuple(node.children.values()), tuple(node.children)
    elif p.is_whole:
        own = "{law: tresca, tau: 20 MPa}" if kind == "law" else "{E: 210 GPa, nu: 0.3}"
        what = f"must be a mapping of names to {kind}s, but is {node.kind()}"
        what = f"is a single {kind}, not a mapping of names to {kind}s" if p.is_one(node.value) else what
        ctx.errors.at(node, what, ctx.example(f"write {{NAME: {own}, NAME: ...}}"))
    elif node.children and kind in NUMBERS:
        values = _spaced(ctx, node, p.row.dimension)
    elif not isinstance(values, tuple) or not values:
        empty = node.value in (None, (), {})
        shown = ctx.example(p.row.dimension.example) if empty else node.brief()
        example = f"{shown}, ...] or {{linspace: [a, b, n]}}" if kind in NUMBERS else "..., ...]"
        what = "has no values" if empty else f"must be a list of values, but is {node.kind()}"
        ctx.errors.at(node, what, f"write a list such as [{example}")
    axis = _axis(ctx, key, node, p, values if isinstance(values, tuple) else (), names)
    if others := [".".join(path) for path in known if path[-1] == key and path != p.path]:
        faults, meant = ctx.errors.problems, f", or {' or '.join(others)} for {key}, which is {'.'.join(p.path)}"
        faults[first:] = [replace(fault, remedy=fault.remedy + meant) for fault in faults[first:]]
    return axis


@none_after_fault
def _spaced(ctx: Context, node: Node, dimension: Dimension) -> Nodes:
    """{linspace: [a, b, n]} or {geomspace: [a, b, n]}: n values from a to b, both included; geometric spacing rounded
    to what logarithms give. None after a fault."""
    kind, item = only_key(ctx, node, "values", "{linspace: [a, b, n]}")
    ctx.sound()
    if not isinstance(item.value, tuple) or len(item.value) != 3:
        ctx.errors.at(item, f"must be [a, b, n], but is {item.kind()}", f"write {{{kind}: [a, b, n]}}")
    ctx.sound()
    a, b = (ctx.quantity(end, dimension) for end in item.entries[:2])
    n = ctx.integer(item.entries[2], 2, MAX_POINTS)
    if kind == "geomspace" and a * b <= 0.0:
        remedy = "give two positive numbers, or use linspace"
        ctx.errors.at(item, f"geomspace needs two ends of one sign, not {a:g} and {b:g}", remedy)
    if a == b:
        ctx.errors.at(item, "both ends are equal, so the values are repeated", "give two different ends")
    ctx.sound()
    shares = [i / (n - 1) for i in range(1, n - 1)]
    if kind == "linspace":
        between = [a + (b - a) * t for t in shares]
    else:
        between = [math.copysign(math.exp((1 - t) * math.log(abs(a)) + t * math.log(abs(b))), a) for t in shares]
    unit = common_unit([end.value for end in item.entries[:2]], dimension) if ctx.units == "SI" else ("", 1.0)
    numbers = (a, *(float(f"{value:.15g}") for value in between), b)
    return tuple(replace(item, value=value, shown_in=unit) for value in numbers)
