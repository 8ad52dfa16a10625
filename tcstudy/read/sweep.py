"""Reads the section `sweep`: which parameters take which values, how they are combined, and their
labels in the data.

The values stay nodes of the study: a sweep point is the study with these nodes put at their paths.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from tcstudy.errors import hint, nearest
from tcstudy.laws.shapes import SHAPES
from tcstudy.read.document import Node, place_of, put_number, split_path
from tcstudy.read.fields import UNNAMED, Context, none_after_fault, only_key, users, words_in
from tcstudy.read.physics import keys_of, laws_by_edge
from tcstudy.read.points import (
    MAX_POINTS,
    Nodes,
    Parameter,
    read_correlation,
    read_design,
    read_distribution,
    table_lines,
    table_value,
)
from tcstudy.scene.designs import DESIGNS, Design, Distribution, correlated, cube
from tcstudy.scene.histories import short_names
from tcstudy.scene.keys import OF_ALL_LAWS, Key, row, rows
from tcstudy.scene.parameters import FIXED, NUMBERS, OF_POINT, SHORT, Keys, path_of, swept_row
from tcstudy.scene.points import GEOMETRIC
from tcstudy.scene.study import Axis
from tcstudy.scene.units import LENGTH, Dimension, common_unit

SECTIONS = ("boundary", "material", "loads", "heat", "friction")
"""What makes up a scene beside the body."""
MODES = row("sweep", "mode").words
HEAD = re.compile(r"([^\s\[\]]+)\s*(?:\[(.+)\])?")
MOST_VALUES = 400_000
OF_DESIGNS = ("points", "seed", "correlation")
"""Keys of a sweep whose points are drawn."""


@dataclass(frozen=True)
class SweptAxis(Parameter):
    """A parameter with its key in the sweep, its values as nodes, and what stands for them in the
    data."""

    key: str
    node: Node
    values: Nodes
    labels: tuple[float | str, ...]
    distribution: str = ""

    def at(self, places: Iterable[int]) -> SweptAxis:
        """The axis with some of its values."""
        values, labels = zip(*((self.values[k], self.labels[k]) for k in places), strict=True)
        return replace(self, values=values, labels=labels)

    def ascending(self) -> SweptAxis:
        """The same, its numbers in ascending order where they go up and down: CF wants monotonic
        coordinates.

        Texts stay in their order: as the values of a dimension they are no strict CF coordinate,
        but as a label variable of another name `data.sel(friction="tresca")` would find no index.
        """
        if any(isinstance(label, str) for label in self.labels):
            return self
        labels = [float(label) for label in self.labels]
        order = sorted(range(len(labels)), key=labels.__getitem__)
        return (
            self
            if order in ([*range(len(labels))], [*reversed(range(len(labels)))])
            else self.at(order)
        )


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

    @cached_property
    def places(self) -> NDArray[np.intp]:
        """(axes, P): which of its values an axis has at every point, in C order of the axes."""
        sizes = [len(axis.values) for axis in self.axes]
        if self.mode == "list":
            return np.tile(np.arange(sizes[0]), (len(sizes), 1))
        return np.indices(sizes).reshape(len(sizes), math.prod(sizes))

    def records(self, units: str) -> tuple[Axis, ...]:
        """The axes as the rest of the package sees them. units: of the study"""
        axes, names = list[Axis](), short_names([axis.path for axis in self.axes])
        for axis, name in zip(self.axes, names, strict=True):
            in_si = units == "SI" and all(isinstance(label, float) for label in axis.labels)
            dimension, values = axis.row.dimension, tuple(value.plain() for value in axis.values)
            unit = axis.values[0].shown_in or common_unit(values, dimension)
            written = unit if in_si and unit[1] != 1.0 else ("", 1.0)
            cf = dimension.cf if in_si else "1"
            axes.append(Axis(name, axis.path, values, axis.labels, cf, axis.distribution, written))
        return tuple(axes)


def read_sweep(ctx: Context, root: Node, swept: bool) -> Sweep:
    """The sweep; none after a fault in its form, so that the base study is still checked.

    swept: whether it is used, so that values of `--set` options must not be lost to it
    """
    node, before, design = root.at("sweep"), len(ctx.errors), None
    if node is None or node.value == {}:
        return Sweep()
    if not isinstance(node.value, Mapping):
        remedy = "write one PARAMETER: [values] per line, for example alpha: [25, 100]"
        ctx.at(node, f"must be a mapping of parameters to values, but is {node.kind()}", remedy)
        return Sweep()
    tabled = isinstance((node.at("points") or node).value, str)
    mode = ctx.choice(item, MODES) if (item := node.at("mode")) else "list" if tabled else "grid"
    given = {key: item for key, item in node.value.items() if key != "mode"}
    if mode == "list":
        axes = _point_list(ctx, root, node, given)
    else:
        items = {
            key: item for key, item in given.items() if mode not in DESIGNS or key not in OF_DESIGNS
        }
        found = {
            key: (item, p) for key, item in items.items() if (p := _parameter(ctx, root, key, item))
        }
        if mode not in DESIGNS:
            axes = [_listed(ctx, root, key, item, p) for key, (item, p) in found.items()]
        else:
            design = read_design(ctx, node, mode, len(items))
            axes = _drawn(ctx, design, found, node.at("correlation")) if design else []
    _check_axes(ctx, node, axes, mode)
    _check_law_parameters(ctx, axes, root.at("friction"))
    if len(ctx.errors) > before:
        return Sweep()
    # parameters of a boundary or a friction that is not there: that is missing, not its keys
    lost = {section for section in ("boundary", "friction") if root.at(section) is None}
    axes = [a for a in axes if a.path[0] not in lost or a.is_whole]
    axes = [axis.ascending() for axis in axes] if mode == "grid" else axes
    sweep = Sweep("grid" if mode == "grid" else "list", tuple(axes), design, tabled)
    if ctx.named:
        _check_names(ctx, root, sweep)
    if swept:
        _check_options(ctx, root, sweep)
    return sweep


def _parameter(ctx: Context, root: Node, key: str, item: Node) -> Parameter | None:
    path = path_of(key)
    named = ("parameters", key.removeprefix("parameters."))  # also a misspelt name with points
    for own in (named, path):  # what a study names goes first
        if found := _row_at(ctx, root, own):
            if own[0] == "parameters" and own[-1] in ctx.unread:
                ctx.errors.met_again()
                return None
            return Parameter(own, found)
    what = f"the study has no parameter {key!r} to sweep"
    known = _known(ctx, root)
    same = [one for one in known if one.endswith(f".{path[-1]}")]
    meant = _meant_of_law(root, path)
    if path[0] in FIXED:
        what, remedy = f"{path[0]} cannot be swept", FIXED[path[0]]
    elif key in OF_DESIGNS:
        lists = key == "points"
        what = f"{key} {'are for modes that list or' if lists else 'is for modes that'} draw points"
        remedy = f"add mode: {'list, or ' * lists}one of {', '.join(DESIGNS)}"
    elif meant:
        remedy = f"did you mean {meant!r}?"
    elif same:
        same = [nearest(key, same) or same[0]] if path[1:] else same
        remedy = f"did you mean {' or '.join(map(repr, same))}?"
    else:
        remedy = hint(
            key,
            [*SHORT, *known, "mode", "friction", "material"],
            "use a key path such as heat.alpha",
        )
    ctx.at(item, what, remedy, on_key=True)
    return None


def _meant_of_law(root: Node, path: Keys) -> str:
    """Return the parameter of the study's law that a misspelt path stands for; empty for none."""
    law = root.at("friction", "law")
    if path[0] != "friction" or law is None or law.value not in SHAPES:
        return ""
    name = nearest(path[-1], [one.name for one in SHAPES[str(law.value)].parameters])
    return f"friction.{name}" if name and len(path) == 2 else ""


def _row_at(ctx: Context, root: Node, path: Keys) -> Key | None:
    """The row of what a sweep of this study may vary at a key path: of a key of its scene, a
    component, a number of the body or the meshes, a name; None where there is none such."""
    section, name = path[0], path[-1]
    if section == "parameters":
        return (
            Key(name, "number", "", ctx.named[name].dimension)
            if path[1:] == (name,) and name in ctx.named
            else None
        )
    if section == "body":
        number = root.at(*(split_path(".".join(path)) or ()))
        is_one = number is not None and isinstance(number.value, int | float | str)
        return Key(name, "number", "number of the body", LENGTH) if is_one else None
    if section == "boundary" and (edges := root.at(section)):
        edge = edges.at(*path[1:2])
        if edge is None or path[2:3] == () or place_of(root, path)[2] not in keys_of(edge):
            return None
    friction, place = root.at("friction"), place_of(root, path)
    by_edge = laws_by_edge(friction)
    law = (by_edge.get(path[1]) if path[1:] and by_edge else friction) or root
    of = str(word.value) if (word := law.at("law")) else ""
    found = swept_row(path, of, by_edge)
    whole = (
        swept_row(tuple(word for word in place if isinstance(word, str)), of, by_edge)
        if place != path
        else None
    )
    if found is None and whole is not None and whole.kind == "vector":
        return replace(whole, name=name, kind="field")
    if found is None and whole is not None and root.at(*place):
        return OF_POINT["s" if name == "s" else "b"]
    return (
        replace(found, kind="number") if found and section == "mesh" else found
    )  # its levels are no axis


def _known(ctx: Context, root: Node) -> list[str]:
    inner = [
        f"{key}.{one}"
        for key, of in {"heat": "edge_heat", "spring": "spring"}.items()
        for one in rows(of)
    ]
    keys = {
        "boundary": [*rows("boundary"), *inner],
        "materials": rows("material"),
        "friction": rows("friction"),
    }
    named = [
        f"{section}.{name}"
        for section in keys
        for name in (root.at(section) or Node.of({}, "")).children
    ]
    paths = [
        f"{place}.{key}" for place in ("friction", *named) for key in keys[place.partition(".")[0]]
    ]
    names = (f"parameters.{name}" for name in ctx.named)
    return [
        *ctx.named,
        *names,
        *SHORT.values(),
        *(path for path in paths if _row_at(ctx, root, path_of(path))),
    ]


def _check_names(ctx: Context, root: Node, sweep: Sweep) -> None:
    """A swept name may act in the sections of a scene only, and in no swept value."""
    for axis in (axis for axis in sweep.axes if axis.path[0] == "parameters"):
        following = users(root, axis.path[-1])
        for other in sweep.axes:
            if value := next((one for one in other.values if words_in(one, following)), None):
                what = f"is made of {min(words_in(value, following))}, which is swept as well"
                ctx.at(value, what, "write its values out, or put the expression where the key is")
        for key, node in root.children.items():
            if key not in (*UNNAMED, *SECTIONS, "materials", *GEOMETRIC) and (
                words := words_in(node, following)
            ):
                what = (
                    f"is swept, but {key} depends on it ({min(words)}), and a study has one {key}"
                )
                ctx.at(axis.node, what, "write one study for each value, with --set", on_key=True)


def _check_options(ctx: Context, root: Node, sweep: Sweep) -> None:
    """A value of an option that the sweep replaces would be lost without a word."""
    for axis in sweep.axes:
        keys = split_path(".".join(axis.path)) or axis.path  # of a misspelt name as they are
        node = root.at(*place_of(root, keys))
        lost = [one for one in (node.all() if node else ()) if one.mark.file.startswith("--set ")]
        if lost:
            one = sweep.mode == "grid" and not axis.is_whole
            listed = f', --set "sweep.{axis.key}=[{lost[0].text()}]"' if one else ""
            remedy = f"leave it out here, give the sweep other values{listed}, or remove it by --set sweep=null"
            ctx.at(
                lost[0],
                f"{axis.key} is swept, so what this option says of it would not be used",
                remedy,
            )


def with_swept_keys(root: Node, sweep: Sweep) -> Node:
    """The base study: swept keys that it does not give have the first of their values."""
    whole = {axis.path for axis in sweep.axes if root.at(*axis.path)}
    for axis in sorted(sweep.axes, key=lambda axis: len(axis.path)):
        # A parameter of a law that is itself swept may be foreign to the base law.
        path = axis.path
        if not root.at(*place_of(root, path)) and path[:1] not in whole:
            with suppress(
                KeyError
            ):  # something else stands there, which the section's reader records
                root = put_number(root, path, axis.values[0])
    return root


def _axis(
    ctx: Context,
    key: str,
    node: Node,
    p: Parameter,
    values: Nodes,
    names: tuple[str, ...] = (),
    drawn: str = "",
) -> SweptAxis:
    texts, kind = tuple(value.text() for value in values), p.row.kind
    numbers = tuple[float, ...]()
    if not names and kind in NUMBERS and not (kind == "component" and "free" in texts):
        labels = [
            ctx.scalar(value, p.row.dimension, varies=kind in ("field", "component"))
            for value in values
        ]
        numbers = tuple(label for label in labels if isinstance(label, float))
    alike = len(numbers) == len(values)
    return SweptAxis(
        p.path, p.row, key, node, values, names or (numbers if alike else texts), drawn
    )


def _point_list(ctx: Context, root: Node, node: Node, given: Mapping[str, Node]) -> list[SweptAxis]:
    """mode: list, whose points all name the same parameters, or stand in a table."""
    points, stray = given.get("points"), [key for key in given if key != "points"]
    if stray and stray[0] in OF_DESIGNS:
        ctx.at(given[stray[0]], f"{stray[0]} is for modes that draw points; remove it", on_key=True)
    elif stray:
        remedy = "put it into points: [{PARAMETER: value, ...}, ...], or use mode: grid"
        ctx.at(
            given[stray[0]],
            f"with mode: list the parameter {stray[0]!r} belongs into points",
            remedy,
            on_key=True,
        )
    elif points is None:
        ctx.at(
            node, "is missing", "add points: [{alpha: 25}, {alpha: 100}]", key=f"{node.path}.points"
        )
    axes = list[SweptAxis]()
    for key, unit, item, values in _columns(ctx, points) if points else ():
        p = _parameter(ctx, root, key, item)
        if p is not None and p.is_whole:
            names, laws = zip(*(_whole(value, p) for value in values), strict=True)
            axes.append(_axis(ctx, key, item, p, laws, names))
        elif p is not None and (not unit or ctx.unit(item, unit, p.row.dimension, key)):
            cells = (
                (table_value(ctx, cell, unit) for cell in values)
                if points and isinstance(points.value, str)
                else values
            )
            axes.append(_axis(ctx, key, item, p, tuple(cells)))
    return axes


def _columns(ctx: Context, points: Node) -> Iterator[tuple[str, str, Node, Nodes]]:
    """(key, unit, its place, values) of listed points or of the table that `points` names; none
    after a fault."""
    if isinstance(points.value, str):
        head, *lines = table_lines(ctx, points)[1] or [()]
        if len(lines) * (len(head) + 1) > MOST_VALUES:
            what = f"the table has {len(lines)} × {len(head)} values, more than a study can keep"
            ctx.at(points, what, "use fewer points, or several studies, whose files xarray joins")
            return
        for j, cell in enumerate(head):
            key, unit = (
                match.groups()
                if (match := HEAD.fullmatch(str(cell.value)))
                else (str(cell.value), None)
            )
            yield (
                key,
                (unit or "").strip(),
                cell,
                tuple(replace(line[j], path=f"sweep.{key}") for line in lines),
            )
        return
    listed = ctx.items(points, "a list of points {PARAMETER: value, ...}", least=1)
    for point in listed:
        if not point.children or {*point.children} != {*listed[0].children}:
            said = f"names {', '.join(point.children)}" if point.children else f"is {point.kind()}"
            what = f"{said}, but the first point names {', '.join(listed[0].children) or 'nothing'}"
            ctx.at(
                point, what, "write {PARAMETER: value, ...} with the same parameters in every point"
            )
            return
    for key, item in listed[0].children.items() if listed else ():
        yield key, "", item, tuple(point.children[key] for point in listed)


def _whole(node: Node, parameter: Parameter) -> tuple[str, Node]:
    """A law or a material in a point, after its name: its key in {NAME: law}, else that of its
    shape or all it says."""
    if len(several := parameter.several(node)) == 1:
        return next(iter(several.items()))
    return str(word.value) if (word := node.at("law")) else node.text(), node


def _check_axes(ctx: Context, node: Node, axes: list[SweptAxis], mode: str) -> None:
    first_of: dict[Keys, SweptAxis] = {}
    for axis in axes:
        first = first_of.setdefault(axis.path, axis)
        if first is not axis:
            # of a table the headings tell them apart, which differ in units only
            name = first.key if first.key != axis.key else first.node.text()
            what = f"sweeps the same parameter as {name!r}"
            ctx.at(axis.node, f"{what}; keep one of the two", on_key=True)
    lengths = [len(axis.values) for axis in axes if axis.values]
    same = [  # of numbers those in SI, of others the texts
        [
            a if isinstance(a, float) else value.text()
            for a, value in zip(axis.labels, axis.values, strict=True)
        ]
        for axis in axes
    ]
    repeated: list[tuple[Nodes, Sequence[object]]] = []
    if mode == "grid":
        repeated = [(axis.values, one) for axis, one in zip(axes, same, strict=True)]
        if (count := math.prod(lengths)) > MAX_POINTS:
            ctx.at(node, f"the sweep has {count} points; at most {MAX_POINTS}: use fewer values")
    elif odd := next(
        (axis for axis in axes if axis.values and len(axis.values) != lengths[0]), None
    ):
        remedy = "with mode: zip give all lists the same length, or use mode: grid"
        ctx.at(
            odd.node, f"has {len(odd.values)} values, but {axes[0].key} has {lengths[0]}", remedy
        )
    elif axes and len(lengths) == len(axes):
        repeated = [(axes[0].values, list(zip(*same, strict=True)))]
    for nodes, identities in repeated:
        seen: set[object] = set()
        for value, identity in zip(nodes, identities, strict=True):
            if identity in seen:
                what = f"the {'value' if mode == 'grid' else 'point of the value'} {value.brief()} is repeated"
                ctx.at(value, what, f"give every {'value' if mode == 'grid' else 'point'} once")
            if identity == identity:  # a value that could not be read is NaN
                seen.add(identity)


def _check_law_parameters(ctx: Context, axes: list[SweptAxis], friction: Node | None) -> None:
    whole = {axis.path: axis.values for axis in axes if axis.is_whole}
    for axis in axes:
        *place, name = axis.path
        if axis.path[0] != "friction" or axis.is_whole or name in OF_ALL_LAWS:
            continue
        base = friction.at(*place[1:]) if friction else None
        for node in whole.get(tuple(place), (base,) if base else ()):
            word = str(own.value) if (own := node.at("law")) else ""
            names = [one.name for one in SHAPES[word].parameters] if word in SHAPES else [name]
            if name not in names:
                remedy = f"it has {', '.join(names)}; sweep the whole law by friction: {{NAME: {{law: ...}}, ...}}"
                ctx.at(axis.node, f"the law {word} has no parameter {name!r}", remedy, on_key=True)
                break


def _listed(ctx: Context, root: Node, key: str, node: Node, p: Parameter) -> SweptAxis:
    first, kind, values = (
        len(ctx.errors.problems),
        p.row.kind,
        node.entries if isinstance(node.value, tuple) else (),
    )
    names: tuple[str, ...] = ()
    if p.is_whole:
        names, values = tuple(several := p.several(node)), tuple(several.values())
        if not several:
            own = "{law: tresca, tau: 20 MPa}" if kind == "law" else "{E: 210 GPa, nu: 0.3}"
            is_one = f"is a single {kind}, not" if node.children else "must be"
            what = f"{is_one} a mapping of names to {kind}s" + (
                "" if node.children else f", but is {node.kind()}"
            )
            ctx.at(node, what, ctx.example(f"write {{NAME: {own}, NAME: ...}}"))
    elif node.children and kind in NUMBERS:
        values = _spaced(ctx, node, p.row.dimension) or ()
    elif not values:
        empty = node.value in (None, (), {})
        shown = ctx.example(p.row.dimension.example) if empty else node.brief()
        example = f"{shown}, ...] or {{linspace: [a, b, n]}}" if kind in NUMBERS else "..., ...]"
        what = "has no values" if empty else f"must be a list of values, but is {node.kind()}"
        ctx.at(node, what, f"write a list such as [{example}")
    axis = _axis(ctx, key, node, p, values, names)
    faults, full = ctx.errors.problems, ".".join(p.path)
    if faults[first:] and values:
        others = [one for one in _known(ctx, root) if one.endswith(f".{key}") and one != full]
        meant = f"; {key} is {full} here, not {' or '.join(others)}" if others else ""
        faults[first:] = [replace(fault, remedy=fault.remedy + meant) for fault in faults[first:]]
    return axis


ENDS_AND_COUNT = {
    "a": ("from", "start", "begin", "min", "low"),
    "b": ("to", "stop", "end", "max", "high"),
    "n": ("n", "num", "count", "steps", "points", "number"),
}
"""Words that people type for the parts of a range."""


def _range_meant(node: Node) -> str:
    """Return a range as it is written, of one with its parts by name; empty for anything else."""
    children = node.children
    parts = {
        part: next((children[word].text() for word in words if word in children), part)
        for part, words in ENDS_AND_COUNT.items()
    }
    known = {word for words in ENDS_AND_COUNT.values() for word in words}
    if not children or not known.issuperset(children):
        return ""
    return f"{{linspace: [{parts['a']}, {parts['b']}, {parts['n']}]}}"


@none_after_fault
def _spaced(ctx: Context, node: Node, dimension: Dimension) -> Nodes:
    """Return the n values of {linspace: [a, b, n]} or {geomspace: [a, b, n]} from a to b, both
    included: those that NumPy gives of the ends in SI. None after a fault."""
    if meant := _range_meant(node):
        ctx.at(node, "is no range", f"write {meant}")
    ctx.sound()
    kind, item = only_key(ctx, node, "values", "{linspace: [a, b, n]}")
    ctx.sound()
    if not isinstance(item.value, tuple) or len(item.value) != 3:
        ctx.at(
            item, f"must be [a, b, n], but is {item.kind()}", "write [a, b, n]: both ends, how many"
        )
    ctx.sound()
    a, b = (ctx.quantity(end, dimension) for end in item.entries[:2])
    n = ctx.integer(item.entries[2], 2, MAX_POINTS)
    if kind == "geomspace" and a * b <= 0.0:
        remedy = "give two positive numbers, or use linspace"
        ctx.at(item, f"geomspace needs two ends of one sign, not {a:g} and {b:g}", remedy)
    if a == b:
        ctx.at(item, "both ends are equal, so the values are repeated", "give two different ends")
    ctx.sound()
    between = (np.linspace if kind == "linspace" else np.geomspace)(a, b, n)[1:-1].tolist()
    unit = (
        common_unit([end.value for end in item.entries[:2]], dimension)
        if ctx.units == "SI"
        else ("", 1.0)
    )
    return tuple(replace(item, value=value, shown_in=unit) for value in (a, *between, b))


def _drawn(
    ctx: Context,
    design: Design,
    items: Mapping[str, tuple[Node, Parameter]],
    correlation: Node | None,
) -> list[SweptAxis]:
    read = {
        key: read_distribution(ctx, node, parameter, design.mode)
        for key, (node, parameter) in items.items()
    }
    R = read_correlation(
        ctx, correlation, design.mode, {p.path: i for i, (_, p) in enumerate(items.values())}
    )
    if not items or R is None or any(found is None for found in read.values()):
        return []
    axes, points = list[SweptAxis](), cube(design, len(items))
    for (key, found), u in zip(
        read.items(), (points if correlation is None else correlated(points, R)).T, strict=True
    ):
        node, parameter = items[key]
        if isinstance(found, Distribution):
            inner = next(iter(node.children.values()))
            ends = inner.children.values() or inner.entries
            written = [end.value for end in ends if isinstance(end.value, str)]
            unit = common_unit(written, parameter.row.dimension) if ctx.units == "SI" else ("", 1.0)
            values = tuple(
                replace(node, value=value, shown_in=unit) for value in found.at(u).tolist()
            )
            axes.append(_axis(ctx, key, node, parameter, values, (), str(found)))
        elif found is not None:
            names, entries = found
            which = np.minimum((u * len(entries)).astype(int), len(entries) - 1).tolist()
            said = f"choice({', '.join(names or [entry.text() for entry in entries])})"
            values, labels = (
                tuple(entries[i] for i in which),
                tuple(names[i] for i in which if names),
            )
            axes.append(_axis(ctx, key, node, parameter, values, labels, said))
    return axes
