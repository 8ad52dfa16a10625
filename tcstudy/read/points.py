"""The points of a sweep that are not written one by one: those of a CSV table, and those that are drawn.

A table has a header of parameters with their units and a line for each point, `alpha [W/(m^2*K)],friction.delta [um]`
and then `25,40`: separated by commas, decimals with a point, texts with a comma in double quotes; empty lines and
lines that begin with # are left out. Every cell knows its line and column, and the study keeps the values, so that its
results need no table afterwards.

Points are drawn by `mode: random`, `latin-hypercube`, `sobol` or `saltelli`: every parameter has a distribution; what
comes out are the same axes that a list of points has. A drawn point that the study cannot have is refused like a
written one, before any work: left out, it would bend the distribution that the user asked for.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np

from tcstudy.errors import StudyError
from tcstudy.read.document import load_text
from tcstudy.read.fields import Context, Fields
from tcstudy.read.node import Mark, Node
from tcstudy.scene import keys as table
from tcstudy.scene.designs import ENDS, PARAMETERS, SALTELLI, Cube, Design, Distribution, count, cube
from tcstudy.scene.parameters import NUMBERS, WHOLE, Parameter
from tcstudy.scene.units import NONE, NUMBER, common_unit, split_quantity

CELL = re.compile(r'\s*("(?:[^"]|"")*"|[^,"]*)\s*(?:,|$)')
HEAD = re.compile(r"([^\s\[\]]+)\s*(?:\[(.+)\])?")
MOST_VALUES = 400_000
Columns = list[tuple[str, Node, Parameter, tuple[Node, ...]]]
"""Key, its place, its parameter and its values."""


def read_table(ctx: Context, node: Node, parameter: Callable[[str, Node], Parameter | None]) -> Columns:
    """The columns of the table that `sweep.points` names; empty after a fault.

    parameter: what a key stands for; records a fault if it is nothing
    """
    before = len(ctx.errors)
    path, _, lines = table_lines(ctx, node)
    if len(ctx.errors) > before:
        return []
    if len(lines) < 2:
        ctx.errors.at(node, f"{path} has no points", "write a header of parameters and a line for each point")
        return []
    head, rows = lines[0], lines[1:]
    if len(rows) * (len(head) + 1) > MOST_VALUES:
        what = f"{path} has {len(rows)} × {len(head)} values, more than a study can keep"
        ctx.errors.at(node, what, "use fewer points, or several studies, whose files xarray joins")
        return []
    for row in rows:
        if len(row) != len(head):
            what = f"has {len(row)} entries, but the header {len(head)}"
            ctx.errors.at(row[-1], what, "give every parameter a value; decimals have a point")
    if len(ctx.errors) > before:
        return []
    return [
        (key, cell, found, tuple(_value(ctx, row[j], unit) for row in rows))
        for j, cell in enumerate(head)
        if (column := _column(ctx, cell, parameter))
        for key, unit, found in (column,)
    ]


def table_lines(ctx: Context, node: Node) -> tuple[Path, str, list[tuple[Node, ...]]]:
    """Path and text of the CSV table that a key names, and the cells of every line that has some."""
    path = ctx.folder / ctx.text(node, "the path of a table")
    try:
        text = load_text(path)
    except StudyError as error:
        ctx.errors.at(node, f"{path}: {error.problems[0].what}", "name a CSV table beside the study")
        return path, "", []
    return path, text, list(_csv_lines(ctx, text.removeprefix("\N{BYTE ORDER MARK}"), str(path)))


def _csv_lines(ctx: Context, text: str, file: str) -> Iterator[tuple[Node, ...]]:
    for number, line in enumerate(text.splitlines(), 1):
        if not line.strip() or line.lstrip().startswith("#"):
            continue
        cells, at = [], 0
        while at <= len(line):
            match = CELL.match(line, at)
            if match is None:
                mark = Mark(file, number, at + 1)
                ctx.errors.at_mark(mark, "", "a quote is not where a text begins or ends", 'write "..." around a text')
                break
            mark = Mark(file, number, match.start(1) + 1)
            word = match[1].strip()
            cells.append(Node(word[1:-1].replace('""', '"') if word[:1] == '"' else word, "", mark, mark))
            at = match.end() + (not match[0].endswith(","))
        yield tuple(cells)


def _column(
    ctx: Context, cell: Node, parameter: Callable[[str, Node], Parameter | None]
) -> tuple[str, str, Parameter] | None:
    """Key, unit and parameter of a column; None after a fault."""
    match = HEAD.fullmatch(str(cell.value))
    if match is None or ";" in str(cell.value):
        remedy = "write a key and its unit, separated by commas: alpha,E [GPa]"
        ctx.errors.at(cell, f"{cell.brief()!r} is no parameter", remedy)
        return None
    key, unit = match[1], (match[2] or "").strip()
    found = parameter(key, cell)
    if found is None:
        return None
    if found.is_whole:
        remedy = "list the points by mode: list, or sweep the numbers of one"
        ctx.errors.at(cell, f"whole {found.row.kind}s cannot stand in a table", remedy, key=key)
        return None
    if unit and not ctx.unit(cell, unit, found.row.dimension, key):
        return None
    return key, unit, found


def _value(ctx: Context, cell: Node, unit: str) -> Node:
    """A cell as the study would have it."""
    word = str(cell.value)
    if not word:
        ctx.errors.unreadable(cell.mark, "", "is empty", "give every parameter a value in every line")
    number = re.fullmatch(NUMBER, word)
    if unit and split_quantity(word) is not None:
        ctx.errors.at(cell, f"{word!r} has a unit beside that of the header", "write the number alone")
    return cell if number is None else replace(cell, value=f"{word} {unit}" if unit else float(word))


Drawn = tuple[tuple[Node, ...], tuple[str, ...], str]
"""The values of one parameter; names of laws that stand for them in the data, if they are laws; the distribution."""


def read_design(ctx: Context, node: Node, mode: str, most: int, d: int) -> Design | None:
    """How many points are drawn, and from which seed; None after a fault."""
    before = len(ctx.errors)
    points, seed = node.child("points"), node.child("seed")
    if points is None:
        ctx.errors.at(node, "is missing", "say how many are drawn: points: 500", key=f"{node.path}.points")
        return None
    n = ctx.integer(points, 1, most)
    start = ctx.value(seed, table.row("sweep", "seed")) if seed is not None else 0
    if len(ctx.errors) == before and count(mode, n, d) > most:
        what = f"{n} × ({d} + 2) points of {mode} are more than {most}"
        ctx.errors.at(points, what, "draw fewer points, or leave parameters out")
    return Design(mode, n, start) if len(ctx.errors) == before else None


def draw(ctx: Context, design: Design, items: Mapping[str, tuple[Node, Parameter]]) -> dict[str, Drawn]:
    """The drawn values by key; only those whose distribution could be read."""
    read = {key: _distribution(ctx, node, parameter, design.mode) for key, (node, parameter) in items.items()}
    if not items or any(found is None for found in read.values()):
        return {}
    u = cube(design, len(items))
    units = {key: _unit(node, p) if ctx.units == "SI" else ("", 1.0) for key, (node, p) in items.items()}
    return {key: _at(items[key][0], found, u[:, j], units[key]) for j, (key, found) in enumerate(read.items()) if found}


def _unit(node: Node, parameter: Parameter) -> tuple[str, float]:
    """The unit in which the numbers of a distribution are written, and its size in SI."""
    inner = next(iter(node.value.values())).value if isinstance(node.value, Mapping) else ()
    entries = inner.values() if isinstance(inner, Mapping) else inner if isinstance(inner, tuple) else ()
    return common_unit([entry.value for entry in entries if isinstance(entry.value, str)], parameter.row.dimension)


Choice = dict[str, Node] | tuple[Node, ...]


def _distribution(ctx: Context, node: Node, parameter: Parameter, mode: str) -> Distribution | Choice | None:
    """The distribution of a parameter, or the values that are equally likely; None after a fault."""
    if parameter.is_whole and isinstance(node.value, Mapping) and node.value and not parameter.is_one(node.value):
        found: Choice | Distribution | None = dict(node.value)
    elif not isinstance(node.value, Mapping) or parameter.is_whole:
        shape = "{uniform: [a, b]} or {choice: [a, b]}"
        if parameter.is_whole:
            shape = f"{{NAME: {{{WHOLE[parameter.row.kind][0]}: ...}}, NAME: ...}}"
        ctx.errors.at(node, f"must be a distribution, but is {node.kind()}", f"with mode: {mode} write {shape}")
        return None
    else:
        found = _named(ctx, node, parameter)
    if mode == SALTELLI and found is not None and not isinstance(found, Distribution):
        remedy = "give it a distribution of numbers, or write one study for each value"
        ctx.errors.at(node, f"a choice has no indices by mode: {SALTELLI}", remedy)
        return None
    return found


def _named(ctx: Context, node: Node, parameter: Parameter) -> Distribution | Choice | None:
    """{NAME: its numbers}."""
    before = len(ctx.errors)
    known = ", ".join(table.rows("distribution"))
    kind, item = only_key(ctx, node, "distribution", known, "{uniform: [a, b]}") or ("", node)
    if not kind:
        return None
    if kind == "choice":
        return ctx.items(item, "a list of values", least=1) or None
    dimension = parameter.row.dimension
    if parameter.row.kind not in NUMBERS:
        ctx.errors.at(item, f"{parameter.path[-1]} is no single number", "write {choice: [..., ...]}")
        return None
    names = PARAMETERS[kind]
    if names == ENDS:
        both = ctx.pair(item, "two ends [a, b]", "[1, 2]")
        numbers = tuple(ctx.quantity(end, dimension) for end in both) if both else ()
    else:
        inner = Fields(ctx, item, kind, names)
        plain = kind == "lognormal"
        numbers = tuple(inner.value(name, NONE if plain and name == "sigma" else dimension) for name in names)
    if len(ctx.errors) > before:
        return None
    found = Distribution(kind, tuple(zip(names, numbers, strict=True)))
    if any(found.fault):
        ctx.errors.at(item, *found.fault)
        return None
    return found


def only_key(ctx: Context, node: Node, section: str, known: str, example: str) -> tuple[str, Node] | None:
    """The one key of a section that has no more, and its value; None after a fault. known: its keys in words"""
    before, given = len(ctx.errors), Fields(ctx, node, section).values
    if len(given) != 1 and len(ctx.errors) == before:
        ctx.errors.at(node, f"needs one of {known}", f"write {example}")
    return next(iter(given.items())) if len(ctx.errors) == before else None


def _at(node: Node, found: Distribution | Choice | None, u: Cube, unit: tuple[str, float]) -> Drawn:
    """The values at points in (0, 1). unit: in which they are shown, and its size."""
    if isinstance(found, Distribution):
        values = tuple(replace(node, value=value, shown_in=unit) for value in found.at(u).tolist())
        return values, (), str(found)
    assert found is not None
    entries = tuple(found.values()) if isinstance(found, dict) else found
    which = np.minimum((u * len(entries)).astype(int), len(entries) - 1).tolist()
    names = tuple(found) if isinstance(found, dict) else ()
    said = ", ".join(names or [entry.text() for entry in entries])
    return tuple(entries[i] for i in which), tuple(names[i] for i in which if names), f"choice({said})"
