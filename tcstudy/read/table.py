"""Reads the points of a sweep from a CSV table: a header of parameters with their units, a line for each point.

`alpha [W/(m^2*K)],friction.delta [um]` and then `25,40`: separated by commas, decimals with a point, texts with a comma
in double quotes; empty lines and lines that begin with # are left out. Every cell knows its line and column, and the
study keeps the values, so that its results need no table afterwards.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator

from tcstudy.errors import StudyError
from tcstudy.read.document import load_text
from tcstudy.read.fields import Context
from tcstudy.read.node import Mark, Node
from tcstudy.scene.parameters import Parameter
from tcstudy.scene.units import NUMBER, UnitError, split_quantity, to_si

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
    path = ctx.folder / ctx.text(node, "the path of a table")
    try:
        text = load_text(path)
    except StudyError as error:
        ctx.errors.at(node, f"{path}: {error.problems[0].what}", "name a CSV table beside the study")
        return []
    lines = list(csv_lines(ctx, text.removeprefix("\N{BYTE ORDER MARK}"), str(path)))
    if len(ctx.errors) > before:
        return []
    if len(lines) < 2:
        ctx.errors.at(node, f"{path} has no points", "write a header of parameters and a line for each point")
        return []
    head, rows = lines[0], lines[1:]
    if len(rows) * (len(head) + 1) > MOST_VALUES:
        what = f"{path} has {len(rows)} × {len(head)} values, more than a study can keep"
        ctx.errors.at(node, what, "use fewer points, or several studies and tcstudy merge")
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


def csv_lines(ctx: Context, text: str, file: str) -> Iterator[tuple[Node, ...]]:
    """The cells of every line that has some."""
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
    if unit and ctx.units == "none":
        ctx.errors.at(cell, "has a unit, but the study says units: none", "drop the unit", key=key)
        return None
    try:
        if unit:
            to_si("1", unit, found.row.dimension)
    except UnitError as error:
        ctx.errors.at(cell, str(error), error.remedy, key=key)
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
    if number is None:
        return cell
    return Node(f"{word} {unit}" if unit else float(word), "", cell.mark, cell.key_mark)
