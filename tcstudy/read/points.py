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
from typing import Any

import numpy as np

from tcstudy.errors import StudyError
from tcstudy.read.document import load_text
from tcstudy.read.fields import Context, Fields, none_after_fault, only_key
from tcstudy.read.node import Mark, Node
from tcstudy.scene import keys as table
from tcstudy.scene.designs import ENDS, PARAMETERS, SALTELLI, Design, Distribution, correlated, count, cube
from tcstudy.scene.parameters import NUMBERS, WHOLE, Parameter, path_of
from tcstudy.scene.units import NONE, NUMBER, common_unit, split_quantity

CELL = re.compile(r'\s*("(?:[^"]|"")*"|[^,"]*)\s*(?:,|$)')
HEAD = re.compile(r"([^\s\[\]]+)\s*(?:\[(.+)\])?")
MOST_VALUES = 400_000
OF_DESIGNS = ("points", "seed", "correlation")
"""Keys of a sweep whose points are drawn."""
Columns = list[tuple[str, Node, Parameter, tuple[Node, ...]]]
"""Key, its place, its parameter and its values."""


def read_table(ctx: Context, node: Node, parameter: Callable[[str, Node], Parameter | None]) -> Columns:
    """The columns of the table that `sweep.points` names; empty after a fault.

    parameter: what a key stands for; records a fault if it is nothing
    """
    head, *rows = table_lines(ctx, node)[1] or [()]
    if len(rows) * (len(head) + 1) > MOST_VALUES:
        what = f"the table has {len(rows)} × {len(head)} values, more than a study can keep"
        ctx.errors.at(node, what, "use fewer points, or several studies, whose files xarray joins")
        return []
    columns: Columns = []
    for j, cell in enumerate(head):
        match = HEAD.fullmatch(str(cell.value))
        if match is None:
            remedy = "write a key and its unit, separated by commas: alpha,E [GPa]"
            ctx.errors.at(cell, f"{cell.brief()!r} is no parameter", remedy)
            continue
        key, unit, found = match[1], (match[2] or "").strip(), parameter(match[1], cell)
        if found is not None and found.is_whole:
            remedy = "list the points by mode: list, or sweep the numbers of one"
            ctx.errors.at(cell, f"whole {found.row.kind}s cannot stand in a table", remedy, key=key)
        elif found is not None and (not unit or ctx.unit(cell, unit, found.row.dimension, key)):
            cells = [replace(row[j], path=f"sweep.{key}") for row in rows]
            columns.append((key, cell, found, tuple(table_value(ctx, one, unit) for one in cells)))
    return columns


def table_lines(ctx: Context, node: Node) -> tuple[str, list[tuple[Node, ...]]]:
    """Text of the CSV table that a key names, and the cells of its lines, the headings first; nothing after a fault."""
    before, path = len(ctx.errors), ctx.folder / ctx.text(node, "the path of a table")
    try:
        text = load_text(path)
    except StudyError as error:
        ctx.errors.at(node, f"{path}: {error.problems[0].what}", "name a CSV table beside the study")
        return "", []
    lines = list(_csv_lines(ctx, text.removeprefix("\N{BYTE ORDER MARK}"), str(path)))
    heads, wrong = lines[0] if lines else (), [line for line in lines if len(line) != len(lines[0])]
    words = [str(cell.value) for cell in heads]
    twice = [k for k, word in enumerate(words) if word and word in words[:k]]
    other = [name for name, mark in {"semicolons": ";", "tabs": "\t"}.items() if len(words) == 1 and mark in words[0]]
    if len(ctx.errors) > before:
        pass
    elif other:
        ctx.errors.at(heads[0], f"columns are separated by {other[0]}; write commas, and a point in decimals")
    elif words and all(re.fullmatch(NUMBER, word) for word in words):
        ctx.errors.at(heads[0], "the table has no headings; write a name and its unit over each column, as u_x [mm]")
    elif len(lines) < 2:
        ctx.errors.at(node, f"{path} has no data", "write a heading for each column and a line for each point")
    elif twice:
        said = f"the heading {words[twice[0]]!r} stands twice; give every column its own heading"
        ctx.errors.at(heads[twice[0]], said)
    elif wrong:
        others = f", and {len(wrong) - 1} other lines likewise" if len(wrong) > 1 else ""
        what = f"has {len(wrong[0])} entries, but the header {len(heads)}{others}"
        ctx.errors.at(wrong[0][-1], what, "give every column a value; decimals have a point, columns a comma")
    return (text, lines) if len(ctx.errors) == before else ("", [])


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


def table_value(ctx: Context, cell: Node, unit: str) -> Node:
    """A cell as the study would have it."""
    word = str(cell.value)
    if not word:
        ctx.errors.unreadable(cell.mark, cell.path, "is empty", "give every parameter a value in every line")
    number = re.fullmatch(NUMBER, word)
    if unit and split_quantity(word) is not None:
        ctx.errors.at(cell, f"{word!r} has a unit beside that of the header", "write the number alone")
    return cell if number is None else replace(cell, value=f"{word} {unit}" if unit else float(word))


Drawn = tuple[tuple[Node, ...], tuple[str, ...], str]
"""The values of one parameter; names of laws that stand for them in the data, if they are laws; the distribution."""


@none_after_fault
def read_design(ctx: Context, node: Node, mode: str, most: int, d: int) -> Design | None:
    """How many points are drawn, and from which seed; None after a fault."""
    points, seed = node.at("points"), node.at("seed")
    if points is None:
        ctx.errors.at(node, "is missing", "say how many are drawn: points: 500", key=f"{node.path}.points")
        return None
    n, start = ctx.integer(points, 1, most), ctx.value(seed, table.row("sweep", "seed")) if seed else 0
    ctx.sound()
    if count(mode, n, d) > most:
        what = f"{n} × ({d} + 2) points of {mode} are more than {most}"
        ctx.errors.at(points, what, "draw fewer points, or leave parameters out")
    return Design(mode, n, start)


def draw(
    ctx: Context, design: Design, items: Mapping[str, tuple[Node, Parameter]], correlation: Node | None = None
) -> dict[str, Drawn]:
    """The drawn values by key; none if a distribution, or the correlation, could not be read."""
    read = {key: _distribution(ctx, node, parameter, design.mode) for key, (node, parameter) in items.items()}
    R = _correlation(ctx, correlation, design.mode, {p.path: i for i, (_, p) in enumerate(items.values())})
    if not items or R is None or any(found is None for found in read.values()):
        return {}
    drawn, points = dict[str, Drawn](), cube(design, len(items))
    for (key, found), u in zip(read.items(), (points if correlation is None else correlated(points, R)).T, strict=True):
        node, parameter = items[key]
        if isinstance(found, Distribution):
            inner = next(iter(node.children.values()))
            ends = inner.children.values() or inner.entries
            written = [end.value for end in ends if isinstance(end.value, str)]
            unit = common_unit(written, parameter.row.dimension) if ctx.units == "SI" else ("", 1.0)
            values = tuple(replace(node, value=value, shown_in=unit) for value in found.at(u).tolist())
            drawn[key] = values, (), str(found)
        elif found is not None:
            names, entries = (tuple(found), tuple(found.values())) if isinstance(found, dict) else ((), found)
            which = np.minimum((u * len(entries)).astype(int), len(entries) - 1).tolist()
            said = f"choice({', '.join(names or [entry.text() for entry in entries])})"
            drawn[key] = tuple(entries[i] for i in which), tuple(names[i] for i in which if names), said
    return drawn


@none_after_fault
def _correlation(
    ctx: Context, node: Node | None, mode: str, places: Mapping[tuple[str, ...], int]
) -> np.ndarray[Any, Any] | None:
    """The correlation matrix of the drawn parameters; None after a fault. places: of each by its path"""
    R = np.eye(len(places))
    pairs = ctx.mapping(node, "pairs to numbers", 'write {"E, tau_s": 0.6}', least=0)
    for key, item in pairs.items():
        rho, two = ctx.quantity(item, NONE), [path_of(name.strip()) for name in key.split(",")]
        at = [places.get(path, places.get(("parameters", *path), -1)) for path in two]
        if len(at) != 2 or at[0] == at[1] or -1 in at:
            names = ", ".join(path[-1] for path in places)
            ctx.errors.at(item, f"{key!r} is no pair of drawn parameters", f"name two of {names}", on_key=True)
        elif not -1.0 < rho < 1.0:
            ctx.errors.at(item, f"is {rho:g}", "a correlation lies between -1 and 1, without these")
        else:
            R[at[0], at[1]] = R[at[1], at[0]] = rho
    ctx.sound()
    if pairs and node is not None and mode == SALTELLI:
        ctx.errors.at(node, f"mode: {SALTELLI} takes its parameters as independent", "use mode: sobol or random")
    elif pairs and node is not None and np.linalg.eigvalsh(R)[0] <= 0.0:
        what = "no parameters can be correlated like this: the matrix is not positive definite"
        ctx.errors.at(node, what, "bring the numbers nearer to 0")
    return R


Choice = dict[str, Node] | tuple[Node, ...]


@none_after_fault
def _distribution(ctx: Context, node: Node, parameter: Parameter, mode: str) -> Distribution | Choice | None:
    """The distribution of a parameter, or the values that are equally likely; None after a fault."""
    whole, dimension, children = parameter.is_whole, parameter.row.dimension, node.children
    found: Choice | Distribution | None = None
    if whole and children and not parameter.is_one(children):
        found = dict(children)
    elif whole or not isinstance(node.value, Mapping):
        shape = f"{{NAME: {{{WHOLE[parameter.row.kind][0]}: ...}}, NAME: ...}}" if whole else "{uniform: [a, b]}"
        remedy = f"with mode: {mode} write {shape}" + ("" if whole else " or {choice: [a, b]}")
        ctx.errors.at(node, f"must be a distribution, but is {node.kind()}", remedy)
    else:
        kind, item = only_key(ctx, node, "distribution", "{uniform: [a, b]}")
        ctx.sound()
        if kind == "choice":
            found = ctx.items(item, "a list of values", least=1)
        elif parameter.row.kind not in NUMBERS:
            ctx.errors.at(item, f"{parameter.path[-1]} is no single number", "write {choice: [..., ...]}")
        else:
            names, of = PARAMETERS[kind], {"sigma": NONE} if kind == "lognormal" else {}
            if names == ENDS:
                numbers = ctx.value(item, table.row("distribution", kind), dimension)
            else:
                inner = Fields(ctx, item, kind)
                numbers = tuple(inner.value(name, of.get(name, dimension)) for name in names)
            ctx.sound()
            found = Distribution(kind, tuple(zip(names, numbers, strict=True)))
            if any(found.fault):
                ctx.errors.at(item, *found.fault)
    ctx.sound()
    if mode == SALTELLI and not isinstance(found, Distribution):
        remedy = "give it a distribution of numbers, or write one study for each value"
        ctx.errors.at(node, f"a choice has no indices by mode: {SALTELLI}", remedy)
    return found
