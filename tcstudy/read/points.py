"""Points of a sweep that stand in a table or are drawn.

A table has a header of parameters with their units and a line for each point, `alpha
[W/(m^2*K)],friction.delta [um]` and then `25,40`: separated by commas, decimals with a point, texts
with a comma in double quotes; empty lines and lines that begin with # are left out. Every cell
knows its line and column, and the study keeps the values, so that its results need no table
afterwards.

Points are drawn by `mode: random`, `latin-hypercube`, `sobol` or `saltelli`: every parameter has a
distribution; what comes out are the same axes that a list of points has. A drawn point that the
study cannot have is refused like a written one, before any work: left out, it would bend the
distribution that the user asked for.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from tcstudy.errors import StudyError
from tcstudy.read.document import Mark, Node, load_text
from tcstudy.read.fields import Context, Fields, none_after_fault, only_key
from tcstudy.scene.designs import ENDS, PARAMETERS, SALTELLI, Design, Distribution, count
from tcstudy.scene.keys import Key, row
from tcstudy.scene.parameters import NUMBERS, WHOLE, Keys, path_of
from tcstudy.scene.units import LONGEST, NONE, NUMBER, Dimension, split_quantity

CELL = re.compile(r'\s*+(?:"((?:[^"]|"")*+)"\s*+|([^,"]*+))(,|$)')
"""A cell, in quotes or bare, and what ends it; it never tries again what it has read."""
MAX_CELLS = 450_000
"""Cells of a table; a study keeps them as text."""
MAX_POINTS = 1_000_000
"""Points of a sweep."""
Nodes = tuple[Node, ...]


@dataclass(frozen=True)
class Parameter:
    """A number or record that a sweep may vary: its key path and its row."""

    path: Keys
    row: Key

    @property
    def is_whole(self) -> bool:
        """Whether its values are whole laws or materials, by name."""
        return self.row.kind in WHOLE

    def several(self, node: Node) -> dict[str, Node]:
        """Return the laws or materials of a node by name.

        There are none in a single one, or in a node that is no mapping.
        """
        is_single = any(key in node.children for key in WHOLE[self.row.kind])
        return {} if is_single else dict(node.children)


def table_lines(ctx: Context, node: Node) -> tuple[str, list[tuple[Node, ...]]]:
    """Return the text of the CSV table that a key names, and the cells of its lines.

    The first line has the headings. Nothing after a fault.
    """
    before = len(ctx.errors)
    path = ctx.folder / ctx.text(node, "the path of a table")
    try:
        text = load_text(path)
    except StudyError as error:
        ctx.at(node, f"{path}: {error.problems[0].what}", "name a CSV table beside the study")
        return "", []
    n_cells = text.count(",") + text.count("\n") + 1
    if n_cells > MAX_CELLS:
        fault = f"{path} has about {n_cells} values; at most {MAX_CELLS} are read"
        ctx.at(node, fault, "use fewer lines, or several studies, whose files xarray joins")
        return "", []
    lines = list(_csv_lines(ctx, text.removeprefix("\N{BYTE ORDER MARK}"), str(path)))
    if len(ctx.errors) == before:
        _check_table(ctx, node, path, lines)
    return (text, lines) if len(ctx.errors) == before else ("", [])


def _check_table(ctx: Context, node: Node, path: Path, lines: list[tuple[Node, ...]]) -> None:
    """Record the first fault of a table's headings and lines."""
    heads = lines[0] if lines else ()
    words = [str(cell.value) for cell in heads]
    uneven = [line for line in lines if len(line) != len(heads)]
    first_column: dict[str, int] = {}
    for k, word in enumerate(words):
        first_column.setdefault(word, k)
    repeated = [k for k, word in enumerate(words) if word and first_column[word] < k]
    separators = []
    if len(words) == 1:
        marks = {"semicolons": ";", "tabs": "\t"}
        separators = [name for name, mark in marks.items() if mark in words[0]]
    if separators:
        fault = f"columns are separated by {separators[0]}"
        ctx.at(heads[0], fault, "write commas, and a point in decimals")
    elif words and all(re.fullmatch(NUMBER, word) for word in words):
        remedy = "write a name and its unit over each column, as u_x [mm]"
        ctx.at(heads[0], "the table has no headings", remedy)
    elif len(lines) < 2:
        remedy = "write a heading for each column and a line for each point"
        ctx.at(node, f"{path} has no data", remedy)
    elif repeated:
        fault = f"the heading {words[repeated[0]]!r} stands twice"
        ctx.at(heads[repeated[0]], fault, "give every column its own heading")
    elif uneven:
        fault = f"has {len(uneven[0])} entries, but the header {len(heads)}"
        if len(uneven) > 1:
            fault += f", and {len(uneven) - 1} other lines likewise"
        remedy = "give every column a value; decimals have a point, columns a comma"
        ctx.at(uneven[0][-1], fault, remedy)


def _csv_lines(ctx: Context, text: str, file: str) -> Iterator[tuple[Node, ...]]:
    for number, line in enumerate(text.splitlines(), 1):
        if not line.strip() or line.lstrip().startswith("#"):
            continue
        cells = []
        position = 0
        while position <= len(line):
            match = CELL.match(line, position)
            if match is None:
                mark = Mark(file, number, position + 1)
                fault = "a quote is not where a text begins or ends"
                ctx.errors.at_mark(mark, "", fault, 'write "..." around a text')
                break
            quoted, bare, end = match.groups()
            if quoted is None:
                word = bare.strip()
                start = match.start(2)
            else:
                word = quoted.replace('""', '"')
                start = match.start(1) - 1
            mark = Mark(file, number, start + 1)
            cells.append(Node(word, "", mark, mark))
            position = match.end() + (end != ",")
        yield tuple(cells)


def table_value(ctx: Context, cell: Node, unit: str) -> Node:
    """Return a cell as the study would have it."""
    word = str(cell.value)
    if not word:
        remedy = "give every parameter a value in every line"
        ctx.errors.unreadable(cell.mark, cell.path, "is empty", remedy)
    number = re.fullmatch(NUMBER, word) if len(word) <= LONGEST else None
    if unit and split_quantity(word) is not None:
        ctx.at(cell, f"{word!r} has a unit beside that of the header", "write the number alone")
    if number is None:
        return cell
    return replace(cell, value=f"{word} {unit}" if unit else float(word))


@none_after_fault
def read_design(ctx: Context, node: Node, mode: str, d: int) -> Design:
    """Return the design of d parameters: the number of its points and its seed.

    None after a fault.
    """
    points, seed = node.at("points"), node.at("seed")
    if not d:
        ctx.at(node, "has no parameter to draw; add one, for example alpha: {uniform: [25, 100]}")
    if points is None:
        remedy = "say how many are drawn: points: 500"
        ctx.at(node, "is missing", remedy, key=f"{node.path}.points")
    ctx.sound()
    assert points is not None
    n_points = ctx.integer(points, 1, MAX_POINTS)
    first_seed = ctx.value(seed, row("sweep", "seed")) if seed else 0
    if count(mode, n_points, d) > MAX_POINTS:
        fault = f"{n_points} × ({d} + 2) points of {mode} are more than {MAX_POINTS}"
        ctx.at(points, fault, "draw fewer points, or leave parameters out")
    return Design(mode, n_points, first_seed)


@none_after_fault
def read_correlation(
    ctx: Context, node: Node | None, mode: str, places: Mapping[tuple[str, ...], int]
) -> np.ndarray[Any, Any] | None:
    """Return the correlation R (d, d) of the drawn parameters, 1 on its diagonal.

    None after a fault.
    places: positions of the parameters by key path
    """
    R = np.eye(len(places))
    pairs = ctx.mapping(node, "pairs to numbers", 'write {"E, tau_s": 0.6}', least=0)
    for key, item in pairs.items():
        rho = ctx.quantity(item, NONE)
        paths = [path_of(name.strip()) for name in key.split(",")]
        pair = [places.get(path, places.get(("parameters", *path), -1)) for path in paths]
        if len(pair) != 2 or pair[0] == pair[1] or -1 in pair:
            fault = f"{key!r} is not a pair of sampled parameters"
            names = ", ".join(path[-1] for path in places)
            ctx.at(item, fault, f"name two of {names}", on_key=True)
        elif not -1.0 < rho < 1.0:
            ctx.at(item, f"is {rho:g}", "a correlation lies between -1 and 1, without these")
        else:
            R[pair[0], pair[1]] = rho
            R[pair[1], pair[0]] = rho
    ctx.sound()
    if not pairs or node is None:
        return R
    if mode == SALTELLI:
        fault = f"mode: {SALTELLI} takes its parameters as independent"
        ctx.at(node, fault, "use mode: sobol or random")
    elif np.linalg.eigvalsh(R)[0] <= 0.0:
        fault = "no parameters can be correlated like this: the matrix is not positive definite"
        ctx.at(node, fault, "bring the numbers nearer to 0")
    return R


Choice = tuple[tuple[str, ...], Nodes]
"""Names, if laws or materials have some, and values."""


def _distribution(ctx: Context, item: Node, kind: str, dimension: Dimension) -> Distribution:
    """Return a distribution of numbers; raise Unsound if one of them has a fault."""
    names = PARAMETERS[kind]
    if names == ENDS:
        numbers = ctx.value(item, row("distribution", kind), dimension)
    else:
        dimensions = dict.fromkeys(names, dimension)
        if kind == "lognormal":
            dimensions["sigma"] = NONE
        fields = Fields(ctx, item, kind)
        numbers = tuple(fields.value(name, dimensions[name]) for name in names)
    ctx.sound()
    distribution = Distribution(kind, tuple(zip(names, numbers, strict=True)))
    if not distribution.is_sound:
        positive = "those of a logarithm, sigma and a median are above 0"
        remedy = f"its ends grow, {positive}, a mode is between ends"
        ctx.at(item, f"{distribution} is no distribution", remedy)
    return distribution


@none_after_fault
def read_distribution(
    ctx: Context, node: Node, parameter: Parameter, mode: str
) -> Distribution | Choice | None:
    """Return the distribution of a parameter, or the values of a choice; None after a fault."""
    is_whole, row_kind = parameter.is_whole, parameter.row.kind
    law: Choice | Distribution | None = None
    several = parameter.several(node) if is_whole else {}
    if several:
        law = tuple(several), tuple(several.values())
    elif is_whole or not isinstance(node.value, Mapping):
        example = "{uniform: [a, b]} or {choice: [a, b]}"
        if is_whole:
            example = f"{{NAME: {{{WHOLE[row_kind][0]}: ...}}, NAME: ...}}"
        fault = f"must be a distribution, but is {node.kind()}"
        ctx.at(node, fault, f"with mode: {mode} write {example}")
    else:
        kind, item = only_key(ctx, node, "distribution", "{uniform: [a, b]}")
        ctx.sound()
        if kind == "choice":
            law = (), ctx.items(item, "a list of values", least=1)
        elif row_kind not in NUMBERS:
            ctx.at(item, f"{parameter.path[-1]} is no single number", "write {choice: [..., ...]}")
        else:
            law = _distribution(ctx, item, kind, parameter.row.dimension)
    ctx.sound()
    if mode == SALTELLI and not isinstance(law, Distribution):
        remedy = "give it a distribution of numbers, or write one study for each value"
        ctx.at(node, f"a choice has no indices by mode: {SALTELLI}", remedy)
    return law
