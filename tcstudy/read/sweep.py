"""Read the section `sweep`: parameters, their values and labels, and how they are combined.

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
from tcstudy.read.physics import has_no_friction, keys_of, laws_by_edge
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
from tcstudy.scene.keys import LAWS, Key, of_all_laws, parameter_names, row, rows
from tcstudy.scene.parameters import FIXED, NUMBERS, OF_POINT, SHORT, Keys, path_of, swept_row
from tcstudy.scene.points import GEOMETRIC
from tcstudy.scene.study import Axis
from tcstudy.scene.units import LENGTH, Dimension, common_unit

SECTIONS = ("boundary", "material", "loads", "heat", *LAWS)
"""Sections of a scene beside the body."""
MODES = row("sweep", "mode").words
HEAD = re.compile(r"([^\s\[\]]+)\s*(?:\[(.+)\])?")
MAX_VALUES = 400_000
"""Values of a table of points; a study keeps them as text."""
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
        """Return the axis with some of its values."""
        values, labels = zip(*((self.values[k], self.labels[k]) for k in places), strict=True)
        return replace(self, values=values, labels=labels)

    def ascending(self) -> SweptAxis:
        """Return the axis with its numbers in ascending order, as CF coordinates must be monotonic.

        Texts stay in their order: as the values of a dimension they are no strict CF coordinate,
        but as a label variable of another name `data.sel(friction="tresca")` would find no index.
        """
        if any(isinstance(label, str) for label in self.labels):
            return self
        labels = [float(label) for label in self.labels]
        order = sorted(range(len(labels)), key=labels.__getitem__)
        is_monotonic = order in ([*range(len(labels))], [*reversed(range(len(labels)))])
        return self if is_monotonic else self.at(order)


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
        """Return the axes as the rest of the package sees them; units are those of the study."""
        axes = list[Axis]()
        names = short_names([axis.path for axis in self.axes])
        for axis, name in zip(self.axes, names, strict=True):
            in_si = units == "SI" and all(isinstance(label, float) for label in axis.labels)
            dimension = axis.row.dimension
            values = tuple(value.plain() for value in axis.values)
            unit = axis.values[0].shown_in or common_unit(values, dimension)
            written = unit if in_si and unit[1] != 1.0 else ("", 1.0)
            cf = dimension.cf if in_si else "1"
            axes.append(Axis(name, axis.path, values, axis.labels, cf, axis.distribution, written))
        return tuple(axes)


def read_sweep(ctx: Context, root: Node, swept: bool) -> Sweep:
    """Return the sweep; none after a fault in its form, so that the base study is still checked.

    swept: whether it is used, so that values of `--set` options must not be lost to it
    """
    node = root.at("sweep")
    before = len(ctx.errors)
    if node is None or node.value == {}:
        return Sweep()
    if not isinstance(node.value, Mapping):
        remedy = "write one PARAMETER: [values] per line, for example alpha: [25, 100]"
        ctx.at(node, f"must be a mapping of parameters to values, but is {node.kind()}", remedy)
        return Sweep()
    tabled = isinstance((node.at("points") or node).value, str)
    mode = "list" if tabled else "grid"
    mode_node = node.at("mode")
    if mode_node:
        mode = ctx.choice(mode_node, MODES)
    items = {key: item for key, item in node.value.items() if key != "mode"}
    design = None
    if mode == "list":
        axes = _point_list(ctx, root, node, items)
    elif mode in DESIGNS:
        items = {key: item for key, item in items.items() if key not in OF_DESIGNS}
        parameters = _parameters(ctx, root, items)
        design = read_design(ctx, node, mode, len(items))
        axes = _drawn(ctx, design, parameters, node.at("correlation")) if design else []
    else:
        parameters = _parameters(ctx, root, items)
        axes = [_listed(ctx, root, key, item, p) for key, (item, p) in parameters.items()]
    _check_axes(ctx, node, axes, mode)
    for section in LAWS:
        _check_law_parameters(ctx, axes, section, root.at(section))
    if len(ctx.errors) > before:
        return Sweep()
    # of a boundary or a law that is missing, the section is the fault, not its keys
    missing = {section for section in ("boundary", *LAWS) if root.at(section) is None}
    axes = [axis for axis in axes if axis.path[0] not in missing or axis.is_whole]
    if mode == "grid":
        axes = [axis.ascending() for axis in axes]
    sweep = Sweep("grid" if mode == "grid" else "list", tuple(axes), design, tabled)
    if ctx.named:
        _check_names(ctx, root, sweep)
    if swept:
        _check_options(ctx, root, sweep)
    return sweep


def _parameters(
    ctx: Context, root: Node, items: Mapping[str, Node]
) -> dict[str, tuple[Node, Parameter]]:
    """Return the items whose keys are parameters of the study; record the others."""
    parameters = {key: _parameter(ctx, root, key, item) for key, item in items.items()}
    return {key: (items[key], p) for key, p in parameters.items() if p}


def _parameter(ctx: Context, root: Node, key: str, item: Node) -> Parameter | None:
    path = path_of(key)
    named = ("parameters", key.removeprefix("parameters."))  # also a misspelt name with points
    for candidate in (named, path):  # names of the study go first
        row_at = _row_at(ctx, root, candidate)
        if row_at is None:
            continue
        if candidate[0] == "parameters" and candidate[-1] in ctx.unread:
            ctx.errors.met_again()
            return None
        return Parameter(candidate, row_at)
    fault = f"the study has no parameter {key!r} to sweep"
    names = _known(ctx, root)
    alike = [name for name in names if name.endswith(f".{path[-1]}")]
    meant = _meant_of_law(root, path)
    if path[0] in FIXED:
        fault, remedy = f"{path[0]} cannot be swept", FIXED[path[0]]
    elif key == "points":
        fault = "points are for modes that list or draw points"
        remedy = f"add mode: list, or one of {', '.join(DESIGNS)}"
    elif key in OF_DESIGNS:
        fault = f"{key} is for modes that draw points"
        remedy = f"add mode: one of {', '.join(DESIGNS)}"
    elif meant:
        remedy = f"did you mean {meant!r}?"
    elif path[1:] and _without_law(root, path[0]):
        fault = f"the study has no section {path[0]}, so {key} cannot be swept"
        remedy = ctx.example(f"add {path[0]}: {row('', path[0]).example}")
    elif alike:
        if path[1:]:
            alike = [nearest(key, alike) or alike[0]]
        remedy = f"did you mean {' or '.join(map(repr, alike))}?"
    else:
        words = [*SHORT, *names, "mode", *LAWS, "material"]
        remedy = hint(key, words, "use a key path such as heat.alpha")
    ctx.at(item, fault, remedy, on_key=True)
    return None


def _without_law(root: Node, section: str) -> bool:
    """Return whether a study need not have a section of laws, and does not have it."""
    is_needed = section == "friction" and not has_no_friction(root)
    return section in LAWS and root.at(section) is None and not is_needed


def _meant_of_law(root: Node, path: Keys) -> str:
    """Return the parameter of the study's law that a misspelt path stands for; empty for none."""
    section = path[0]
    law = root.at(section, "law")
    if section not in LAWS or law is None or str(law.value) not in SHAPES:
        return ""
    name = nearest(path[-1], list(parameter_names(str(law.value), section)))
    return f"{section}.{name}" if name and len(path) == 2 else ""


def _row_at(ctx: Context, root: Node, path: Keys) -> Key | None:
    """Return the row of the number or record that a sweep of this study may vary at a key path.

    It is that of a key of the scene, of a component, of a number of the body or the meshes, or of a
    name; None where there is none such.
    """
    section, name = path[0], path[-1]
    if section == "parameters":
        is_named = path[1:] == (name,) and name in ctx.named
        return Key(name, "number", "", ctx.named[name].dimension) if is_named else None
    if section == "body":
        number = root.at(*(split_path(".".join(path)) or ()))
        is_number = number is not None and isinstance(number.value, int | float | str)
        return Key(name, "number", "number of the body", LENGTH) if is_number else None
    if path[1:] and _without_law(root, section):
        return None
    place = place_of(root, path)
    edges = root.at(section)
    if section == "boundary" and edges:
        edge = edges.at(*path[1:2])
        if edge is None or path[2:3] == () or place[2] not in keys_of(edge):
            return None
    laws = root.at(section) if section in LAWS else None
    by_edge = laws_by_edge(laws)
    law = (by_edge.get(path[1]) if path[1:] and by_edge else laws) or root
    shape_node = law.at("law")
    shape = str(shape_node.value) if shape_node else ""
    row_at = swept_row(path, shape, by_edge)
    if place != path:
        words = tuple(word for word in place if isinstance(word, str))
        whole_row = swept_row(words, shape, by_edge)
        if row_at is None and whole_row is not None and whole_row.kind == "vector":
            return replace(whole_row, name=name, kind="field")
        if row_at is None and whole_row is not None and root.at(*place):
            return OF_POINT["s" if name == "s" else "b"]
    if row_at and section == "mesh":
        return replace(row_at, kind="number")  # its levels are no axis
    return row_at


def _known(ctx: Context, root: Node) -> list[str]:
    """Return all names and key paths that a sweep of this study may vary."""
    of_heat = [f"heat.{key}" for key in rows("edge_heat")]
    of_spring = [f"spring.{key}" for key in rows("spring")]
    keys = {
        "boundary": [*rows("boundary"), *of_heat, *of_spring],
        "materials": rows("material"),
        **{section: rows(section) for section in LAWS},
    }
    paths = [f"{section}.{key}" for section in LAWS for key in keys[section]]
    for section, keys_of_section in keys.items():
        node = root.at(section)
        for name in node.children if node else ():
            paths += [f"{section}.{name}.{key}" for key in keys_of_section]
    names = [f"parameters.{name}" for name in ctx.named]
    possible = [path for path in paths if _row_at(ctx, root, path_of(path))]
    return [*ctx.named, *names, *SHORT.values(), *possible]


def _check_names(ctx: Context, root: Node, sweep: Sweep) -> None:
    """Record swept names that act outside the sections of a scene, or in a swept value."""
    varied = (*UNNAMED, *SECTIONS, "materials", *GEOMETRIC)
    for axis in sweep.axes:
        if axis.path[0] != "parameters":
            continue
        following = users(root, axis.path[-1])
        for other_axis in sweep.axes:
            value = next((node for node in other_axis.values if words_in(node, following)), None)
            if value:
                fault = f"is made of {min(words_in(value, following))}, which is swept as well"
                ctx.at(value, fault, "write its values out, or put the expression where the key is")
        for key, node in root.children.items():
            words = frozenset() if key in varied else words_in(node, following)
            if words:
                effect = f"{key} depends on it ({min(words)}), and a study has one {key}"
                remedy = "write one study for each value, with --set"
                ctx.at(axis.node, f"is swept, but {effect}", remedy, on_key=True)


def _check_options(ctx: Context, root: Node, sweep: Sweep) -> None:
    """Record values of options that the sweep replaces: they would be lost without a word."""
    for axis in sweep.axes:
        keys = split_path(".".join(axis.path)) or axis.path  # of a misspelt name as they are
        node = root.at(*place_of(root, keys))
        nodes = node.all() if node else ()
        lost = next((value for value in nodes if value.mark.file.startswith("--set ")), None)
        if lost is None:
            continue
        listed = ""
        if sweep.mode == "grid" and not axis.is_whole:
            listed = f', --set "sweep.{axis.key}=[{lost.text()}]"'
        other_values = f"give the sweep other values{listed}"
        remedy = f"leave it out here, {other_values}, or remove it by --set sweep=null"
        fault = f"the sweep gives {axis.key} its values, and this option would have no effect"
        ctx.at(lost, fault, remedy)


def with_swept_keys(root: Node, sweep: Sweep) -> Node:
    """Return the base study, in which swept keys that it does not give have their first values."""
    whole_paths = {axis.path for axis in sweep.axes if root.at(*axis.path)}
    for axis in sorted(sweep.axes, key=lambda axis: len(axis.path)):
        # a parameter of a law that is itself swept may be foreign to the base law
        path = axis.path
        if not root.at(*place_of(root, path)) and path[:1] not in whole_paths:
            # KeyError where something else stands there, which the section's reader records
            with suppress(KeyError):
                root = put_number(root, path, axis.values[0])
    return root


def _axis(
    ctx: Context,
    key: str,
    node: Node,
    p: Parameter,
    values: Nodes,
    names: tuple[str, ...] = (),
    distribution: str = "",
) -> SweptAxis:
    texts = tuple(value.text() for value in values)
    kind = p.row.kind
    labels: tuple[float | str, ...] = names or texts
    words = ("free",) if kind == "component" else p.row.words
    if not names and kind in NUMBERS and not any(word in texts for word in words):
        varies = kind in ("field", "component")
        scalars = [ctx.scalar(value, p.row.dimension, varies=varies) for value in values]
        numbers = tuple(scalar for scalar in scalars if isinstance(scalar, float))
        labels = numbers if len(numbers) == len(values) else texts
    return SweptAxis(p.path, p.row, key, node, values, labels, distribution)


def _point_list(ctx: Context, root: Node, node: Node, items: Mapping[str, Node]) -> list[SweptAxis]:
    """Return the axes of mode: list, whose points name the same parameters or stand in a table."""
    points = items.get("points")
    stray = next((key for key in items if key != "points"), None)
    if stray in OF_DESIGNS:
        ctx.at(items[stray], f"{stray} is for modes that draw points; remove it", on_key=True)
    elif stray is not None:
        fault = f"with mode: list the parameter {stray!r} belongs into points"
        remedy = "put it into points: [{PARAMETER: value, ...}, ...], or use mode: grid"
        ctx.at(items[stray], fault, remedy, on_key=True)
    elif points is None:
        remedy = "add points: [{alpha: 25}, {alpha: 100}]"
        ctx.at(node, "is missing", remedy, key=f"{node.path}.points")
    if not points:
        return []
    axes = list[SweptAxis]()
    for key, unit, item, values in _columns(ctx, points):
        p = _parameter(ctx, root, key, item)
        if p is not None and p.is_whole:
            names, laws = zip(*(_whole(value, p) for value in values), strict=True)
            axes.append(_axis(ctx, key, item, p, laws, names))
        elif p is not None and (not unit or ctx.unit(item, unit, p.row.dimension, key)):
            if isinstance(points.value, str):
                values = tuple(table_value(ctx, cell, unit) for cell in values)
            axes.append(_axis(ctx, key, item, p, values))
    return axes


def _columns(ctx: Context, points: Node) -> Iterator[tuple[str, str, Node, Nodes]]:
    """Yield (key, unit, its place, values) of listed points or of the table that `points` names.

    Nothing after a fault.
    """
    if isinstance(points.value, str):
        head, *lines = table_lines(ctx, points)[1] or [()]
        if len(lines) * (len(head) + 1) > MAX_VALUES:
            fault = f"the table has {len(lines)} × {len(head)} values, more than a study can keep"
            ctx.at(points, fault, "use fewer points, or several studies, whose files xarray joins")
            return
        for j, cell in enumerate(head):
            heading = HEAD.fullmatch(str(cell.value))
            key = heading[1] if heading else str(cell.value)
            unit = heading[2] or "" if heading else ""
            column = tuple(replace(line[j], path=f"sweep.{key}") for line in lines)
            yield key, unit.strip(), cell, column
        return
    listed = ctx.items(points, "a list of points {PARAMETER: value, ...}", least=1)
    if not listed:
        return
    first = listed[0].children
    for point in listed:
        if not point.children or {*point.children} != {*first}:
            names = f"names {', '.join(point.children)}" if point.children else f"is {point.kind()}"
            fault = f"{names}, but the first point names {', '.join(first) or 'nothing'}"
            remedy = "write {PARAMETER: value, ...} with the same parameters in every point"
            ctx.at(point, fault, remedy)
            return
    for key, item in first.items():
        yield key, "", item, tuple(point.children[key] for point in listed)


def _whole(node: Node, parameter: Parameter) -> tuple[str, Node]:
    """Return a law or a material of a point, after its name.

    The name is its key in {NAME: law}, else that of its shape, or its whole text.
    """
    several = parameter.several(node)
    if len(several) == 1:
        return next(iter(several.items()))
    shape = node.at("law")
    return str(shape.value) if shape else node.text(), node


def _check_axes(ctx: Context, node: Node, axes: list[SweptAxis], mode: str) -> None:
    """Record parameters that are swept twice, lists of unequal lengths and repeated values."""
    first_of: dict[Keys, SweptAxis] = {}
    for axis in axes:
        first = first_of.setdefault(axis.path, axis)
        if first is not axis:
            # of a table the headings tell them apart, which differ in units only
            name = first.key if first.key != axis.key else first.node.text()
            fault = f"sweeps the same parameter as {name!r}"
            ctx.at(axis.node, f"{fault}; keep one of the two", on_key=True)
    lengths = [len(axis.values) for axis in axes if axis.values]
    identities = [_identities(axis) for axis in axes]
    if mode == "grid":
        for axis, of_values in zip(axes, identities, strict=True):
            _check_repeated(ctx, axis.values, of_values, "value")
        count = math.prod(lengths)
        if count > MAX_POINTS:
            ctx.at(node, f"the sweep has {count} points; at most {MAX_POINTS}: use fewer values")
        return
    unequal = [axis for axis in axes if axis.values and len(axis.values) != lengths[0]]
    if unequal:
        fault = f"has {len(unequal[0].values)} values, but {axes[0].key} has {lengths[0]}"
        remedy = "with mode: zip give all lists the same length, or use mode: grid"
        ctx.at(unequal[0].node, fault, remedy)
    elif axes and len(lengths) == len(axes):
        _check_repeated(ctx, axes[0].values, list(zip(*identities, strict=True)), "point")


def _identities(axis: SweptAxis) -> list[object]:
    """Return what tells the values of an axis apart: numbers in SI, else the texts."""
    labelled = zip(axis.labels, axis.values, strict=True)
    return [label if isinstance(label, float) else value.text() for label, value in labelled]


def _check_repeated(ctx: Context, nodes: Nodes, identities: Sequence[object], item: str) -> None:
    """Record values, or points that begin with a value, which are given before."""
    seen: set[object] = set()
    words = "value" if item == "value" else "point of the value"
    for value, identity in zip(nodes, identities, strict=True):
        if identity in seen:
            ctx.at(value, f"the {words} {value.brief()} is repeated", f"give every {item} once")
        if identity == identity:  # a value that could not be read is NaN
            seen.add(identity)


def _check_law_parameters(
    ctx: Context, axes: list[SweptAxis], section: str, laws: Node | None
) -> None:
    """Record swept parameters that the law of a section, or a swept one, does not have."""
    whole_values = {axis.path: axis.values for axis in axes if axis.is_whole}
    for axis in axes:
        *place, name = axis.path
        if axis.path[0] != section or axis.is_whole or name in of_all_laws(section):
            continue
        base = laws.at(*place[1:]) if laws else None
        for node in whole_values.get(tuple(place), (base,) if base else ()):
            shape_node = node.at("law")
            shape = str(shape_node.value) if shape_node else ""
            if shape not in SHAPES:
                continue
            names = parameter_names(shape, section)
            if name not in names:
                whole = "{NAME: {law: ...}, ...}"
                remedy = f"it has {', '.join(names)}; sweep the whole law by {section}: {whole}"
                fault = f"the law {shape} has no parameter {name!r}"
                ctx.at(axis.node, fault, remedy, on_key=True)
                break


def _listed(ctx: Context, root: Node, key: str, node: Node, p: Parameter) -> SweptAxis:
    """Return the axis of a parameter with a list of values, a range, or whole laws by name."""
    n_faults = len(ctx.errors.problems)
    kind = p.row.kind
    names: tuple[str, ...] = ()
    values = node.entries if isinstance(node.value, tuple) else ()
    if p.is_whole:
        several = p.several(node)
        names, values = tuple(several), tuple(several.values())
        if not several:
            fault = f"must be a mapping of names to {kind}s, but is {node.kind()}"
            if node.children:
                fault = f"is a single {kind}, not a mapping of names to {kind}s"
            record = p.row.example if kind == "law" else "{E: 210 GPa, nu: 0.3}"
            ctx.at(node, fault, ctx.example(f"write {{NAME: {record}, NAME: ...}}"))
    elif node.children and kind in NUMBERS:
        values = _spaced(ctx, node, p.row.dimension) or ()
    elif not values:
        is_empty = node.value in (None, (), {})
        value = ctx.example(p.row.dimension.example) if is_empty else node.brief()
        example = f"{value}, ...] or {{linspace: [a, b, n]}}" if kind in NUMBERS else "..., ...]"
        fault = "has no values" if is_empty else f"must be a list of values, but is {node.kind()}"
        ctx.at(node, fault, f"write a list such as [{example}")
    axis = _axis(ctx, key, node, p, values, names)
    faults = ctx.errors.problems
    if faults[n_faults:] and values:
        path = ".".join(p.path)
        namesakes = [name for name in _known(ctx, root) if name.endswith(f".{key}")]
        meant = [name for name in namesakes if name != path]
        hint_of_path = f"; {key} is {path} here, not {' or '.join(meant)}" if meant else ""
        for i in range(n_faults, len(faults)):
            faults[i] = replace(faults[i], remedy=faults[i].remedy + hint_of_path)
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
    range_words = {word for words in ENDS_AND_COUNT.values() for word in words}
    if not children or not range_words.issuperset(children):
        return ""
    parts = []
    for part, words in ENDS_AND_COUNT.items():
        parts.append(next((children[word].text() for word in words if word in children), part))
    return f"{{linspace: [{', '.join(parts)}]}}"


@none_after_fault
def _spaced(ctx: Context, node: Node, dimension: Dimension) -> Nodes:
    """Return the n values of {linspace: [a, b, n]} or {geomspace: [a, b, n]} from a to b.

    Both ends are included. The values are those that NumPy gives of the ends in SI. None after a
    fault.
    """
    meant = _range_meant(node)
    if meant:
        ctx.at(node, "is no range", f"write {meant}")
    ctx.sound()
    kind, item = only_key(ctx, node, "values", "{linspace: [a, b, n]}")
    ctx.sound()
    if not isinstance(item.value, tuple) or len(item.value) != 3:
        fault = f"must be [a, b, n], but is {item.kind()}"
        ctx.at(item, fault, "write [a, b, n]: both ends, how many")
    ctx.sound()
    a = ctx.quantity(item.entries[0], dimension)
    b = ctx.quantity(item.entries[1], dimension)
    n = ctx.integer(item.entries[2], 2, MAX_POINTS)
    if kind == "geomspace" and a * b <= 0.0:
        remedy = "give two positive numbers, or use linspace"
        ctx.at(item, f"geomspace needs two ends of one sign, not {a:g} and {b:g}", remedy)
    if a == b:
        ctx.at(item, "both ends are equal, so the values are repeated", "give two different ends")
    ctx.sound()
    space = np.linspace if kind == "linspace" else np.geomspace
    between = space(a, b, n)[1:-1].tolist()
    unit = _unit_of(ctx, [end.value for end in item.entries[:2]], dimension)
    return tuple(replace(item, value=value, shown_in=unit) for value in (a, *between, b))


def _unit_of(ctx: Context, texts: Sequence[object], dimension: Dimension) -> tuple[str, float]:
    """Return the unit that the study writes numbers in, and its size in SI."""
    return common_unit(texts, dimension) if ctx.units == "SI" else ("", 1.0)


def _drawn(
    ctx: Context,
    design: Design,
    items: Mapping[str, tuple[Node, Parameter]],
    correlation: Node | None,
) -> list[SweptAxis]:
    distributions = {
        key: read_distribution(ctx, node, parameter, design.mode)
        for key, (node, parameter) in items.items()
    }
    places = {parameter.path: i for i, (_, parameter) in enumerate(items.values())}
    R = read_correlation(ctx, correlation, design.mode, places)
    if not items or R is None or any(law is None for law in distributions.values()):
        return []
    axes = list[SweptAxis]()
    points = cube(design, len(items))
    if correlation is not None:
        points = correlated(points, R)
    for (key, law), u in zip(distributions.items(), points.T, strict=True):
        node, parameter = items[key]
        if isinstance(law, Distribution):
            numbers = next(iter(node.children.values()))
            ends = numbers.children.values() or numbers.entries
            texts = [end.value for end in ends if isinstance(end.value, str)]
            unit = _unit_of(ctx, texts, parameter.row.dimension)
            values = tuple(
                replace(node, value=value, shown_in=unit) for value in law.at(u).tolist()
            )
            axes.append(_axis(ctx, key, node, parameter, values, (), str(law)))
        elif law is not None:
            names, entries = law
            place = np.minimum((u * len(entries)).astype(int), len(entries) - 1).tolist()
            words = ", ".join(names or [entry.text() for entry in entries])
            values = tuple(entries[i] for i in place)
            labels = tuple(names[i] for i in place) if names else ()
            axes.append(_axis(ctx, key, node, parameter, values, labels, f"choice({words})"))
    return axes
