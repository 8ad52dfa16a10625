"""Points of a sweep that stand in a table or are drawn: lines and cells, sizes of designs,
distributions.

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
from typing import Any

import numpy as np

from tcstudy.errors import StudyError
from tcstudy.read.document import Mark, Node, load_text
from tcstudy.read.fields import Context, Fields, none_after_fault, only_key
from tcstudy.scene.designs import ENDS, PARAMETERS, SALTELLI, Design, Distribution, count
from tcstudy.scene.keys import Key, row
from tcstudy.scene.parameters import NUMBERS, WHOLE, Keys, path_of
from tcstudy.scene.units import LONGEST, NONE, NUMBER, split_quantity

CELL = re.compile(r'\s*+(?:"((?:[^"]|"")*+)"\s*+|([^,"]*+))(,|$)')
"""A cell, in quotes or bare, and what ends it; it never tries again what it has read."""
MAX_CELLS = 450_000
"""Cells of a table; a study keeps them as text."""
MAX_POINTS = 1_000_000
Nodes = tuple[Node, ...]


@dataclass(frozen=True)
class Parameter:
    """What a sweep may vary: its key path and its row."""

    path: Keys
    row: Key

    @property
    def is_whole(self) -> bool:
        """Whether its values are whole laws or materials, by name."""
        return self.row.kind in WHOLE

    def several(self, node: Node) -> dict[str, Node]:
        """The laws or materials of a node by name; none of a single one, or of what is no
        mapping."""
        return (
            {} if any(key in node.children for key in WHOLE[self.row.kind]) else dict(node.children)
        )


def table_lines(ctx: Context, node: Node) -> tuple[str, list[tuple[Node, ...]]]:
    """Text of the CSV table that a key names, and the cells of its lines, the headings first;
    nothing after a fault."""
    before, path = len(ctx.errors), ctx.folder / ctx.text(node, "the path of a table")
    try:
        text = load_text(path)
    except StudyError as error:
        ctx.at(node, f"{path}: {error.problems[0].what}", "name a CSV table beside the study")
        return "", []
    cells = text.count(",") + text.count("\n") + 1
    if cells > MAX_CELLS:
        what = f"{path} has about {cells} values; at most {MAX_CELLS} are read"
        ctx.at(node, what, "use fewer lines, or several studies, whose files xarray joins")
        return "", []
    lines = list(_csv_lines(ctx, text.removeprefix("\N{BYTE ORDER MARK}"), str(path)))
    heads, wrong = lines[0] if lines else (), [line for line in lines if len(line) != len(lines[0])]
    words = [str(cell.value) for cell in heads]
    first = {word: k for k, word in reversed([*enumerate(words)])}
    twice = [k for k, word in enumerate(words) if word and first[word] < k]
    other = [
        name
        for name, mark in {"semicolons": ";", "tabs": "\t"}.items()
        if len(words) == 1 and mark in words[0]
    ]
    if len(ctx.errors) > before:
        pass
    elif other:
        ctx.at(
            heads[0], f"columns are separated by {other[0]}; write commas, and a point in decimals"
        )
    elif words and all(re.fullmatch(NUMBER, word) for word in words):
        ctx.at(
            heads[0],
            "the table has no headings; write a name and its unit over each column, as u_x [mm]",
        )
    elif len(lines) < 2:
        ctx.at(
            node, f"{path} has no data", "write a heading for each column and a line for each point"
        )
    elif twice:
        ctx.at(
            heads[twice[0]],
            f"the heading {words[twice[0]]!r} stands twice; give every column its own heading",
        )
    elif wrong:
        others = f", and {len(wrong) - 1} other lines likewise" if len(wrong) > 1 else ""
        what = f"has {len(wrong[0])} entries, but the header {len(heads)}{others}"
        ctx.at(
            wrong[0][-1], what, "give every column a value; decimals have a point, columns a comma"
        )
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
                ctx.errors.at_mark(
                    mark,
                    "",
                    "a quote is not where a text begins or ends",
                    'write "..." around a text',
                )
                break
            quoted, bare, end = match.groups()
            start = match.start(2) if quoted is None else match.start(1) - 1
            mark = Mark(file, number, start + 1)
            word = bare.strip() if quoted is None else quoted.replace('""', '"')
            cells.append(Node(word, "", mark, mark))
            at = match.end() + (end != ",")
        yield tuple(cells)


def table_value(ctx: Context, cell: Node, unit: str) -> Node:
    """A cell as the study would have it."""
    word = str(cell.value)
    if not word:
        ctx.errors.unreadable(
            cell.mark, cell.path, "is empty", "give every parameter a value in every line"
        )
    number = re.fullmatch(NUMBER, word) if len(word) <= LONGEST else None
    if unit and split_quantity(word) is not None:
        ctx.at(cell, f"{word!r} has a unit beside that of the header", "write the number alone")
    return (
        cell if number is None else replace(cell, value=f"{word} {unit}" if unit else float(word))
    )


@none_after_fault
def read_design(ctx: Context, node: Node, mode: str, d: int) -> Design:
    """How many points are drawn, and from which seed; None after a fault. d: parameters"""
    points, seed = node.at("points") or node, node.at("seed")
    if not d:
        ctx.at(node, "has no parameter to draw; add one, for example alpha: {uniform: [25, 100]}")
    if points is node:
        ctx.at(node, "is missing", "say how many are drawn: points: 500", key=f"{node.path}.points")
    ctx.sound()
    n, start = (
        ctx.integer(points, 1, MAX_POINTS),
        ctx.value(seed, row("sweep", "seed")) if seed else 0,
    )
    if count(mode, n, d) > MAX_POINTS:
        what = f"{n} × ({d} + 2) points of {mode} are more than {MAX_POINTS}"
        ctx.at(points, what, "draw fewer points, or leave parameters out")
    return Design(mode, n, start)


@none_after_fault
def read_correlation(
    ctx: Context, node: Node | None, mode: str, places: Mapping[tuple[str, ...], int]
) -> np.ndarray[Any, Any] | None:
    """R (d, d) of the drawn parameters, 1 on its diagonal; None after a fault. places: which of
    them a key path is"""
    R = np.eye(len(places))
    pairs = ctx.mapping(node, "pairs to numbers", 'write {"E, tau_s": 0.6}', least=0)
    for key, item in pairs.items():
        rho, two = ctx.quantity(item, NONE), [path_of(name.strip()) for name in key.split(",")]
        at = [places.get(path, places.get(("parameters", *path), -1)) for path in two]
        if len(at) != 2 or at[0] == at[1] or -1 in at:
            names = ", ".join(path[-1] for path in places)
            ctx.at(
                item, f"{key!r} is no pair of drawn parameters", f"name two of {names}", on_key=True
            )
        elif not -1.0 < rho < 1.0:
            ctx.at(item, f"is {rho:g}", "a correlation lies between -1 and 1, without these")
        else:
            R[at[0], at[1]] = R[at[1], at[0]] = rho
    ctx.sound()
    if pairs and node is not None and mode == SALTELLI:
        ctx.at(
            node,
            f"mode: {SALTELLI} takes its parameters as independent",
            "use mode: sobol or random",
        )
    elif pairs and node is not None and np.linalg.eigvalsh(R)[0] <= 0.0:
        what = "no parameters can be correlated like this: the matrix is not positive definite"
        ctx.at(node, what, "bring the numbers nearer to 0")
    return R


Choice = tuple[tuple[str, ...], Nodes]
"""Names, if laws or materials have some, and values."""


@none_after_fault
def read_distribution(
    ctx: Context, node: Node, parameter: Parameter, mode: str
) -> Distribution | Choice | None:
    """The distribution of a parameter, or the values of a choice; None after a fault."""
    whole, dimension = parameter.is_whole, parameter.row.dimension
    found: Choice | Distribution | None = None
    if several := parameter.several(node) if whole else {}:
        found = tuple(several), tuple(several.values())
    elif whole or not isinstance(node.value, Mapping):
        shape = (
            f"{{NAME: {{{WHOLE[parameter.row.kind][0]}: ...}}, NAME: ...}}"
            if whole
            else "{uniform: [a, b]}"
        )
        remedy = f"with mode: {mode} write {shape}" + ("" if whole else " or {choice: [a, b]}")
        ctx.at(node, f"must be a distribution, but is {node.kind()}", remedy)
    else:
        kind, item = only_key(ctx, node, "distribution", "{uniform: [a, b]}")
        ctx.sound()
        if kind == "choice":
            found = (), ctx.items(item, "a list of values", least=1)
        elif parameter.row.kind not in NUMBERS:
            ctx.at(item, f"{parameter.path[-1]} is no single number", "write {choice: [..., ...]}")
        else:
            names, of = PARAMETERS[kind], {"sigma": NONE} if kind == "lognormal" else {}
            if names == ENDS:
                numbers = ctx.value(item, row("distribution", kind), dimension)
            else:
                inner = Fields(ctx, item, kind)
                numbers = tuple(inner.value(name, of.get(name, dimension)) for name in names)
            ctx.sound()
            found = Distribution(kind, tuple(zip(names, numbers, strict=True)))
            if not found.is_sound:
                remedy = "its ends grow, those of a logarithm, sigma and a median are above 0, a mode is between ends"
                ctx.at(item, f"{found} is no distribution", remedy)
    ctx.sound()
    if mode == SALTELLI and not isinstance(found, Distribution):
        remedy = "give it a distribution of numbers, or write one study for each value"
        ctx.at(node, f"a choice has no indices by mode: {SALTELLI}", remedy)
    return found
