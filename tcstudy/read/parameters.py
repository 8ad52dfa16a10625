"""Reads the section `parameters`: numbers of the study's own, by name, and expressions between them.

Wherever a study takes a number or a field, an expression may use these names: `width: "2*height"`. Their units are
carried through it; a plain number has none, and x and y are numbers of metres, whose products are not followed. A sweep
may vary a name: every section that uses it, directly or by another name, is then read again for each of its values.

Not here: the expressions themselves (`expressions`), which value a sweep point has (`read.scenes`).
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from functools import lru_cache
from typing import TYPE_CHECKING

from tcstudy.expressions.expression import CONSTANTS, FUNCTIONS, VARIABLES, ExpressionError, parse
from tcstudy.read.fields import Context
from tcstudy.read.node import Node
from tcstudy.scene.units import (
    DIMENSIONS,
    NONE,
    Dimension,
    Named,
    UnitError,
    dimensions_of,
    split_quantity,
    to_si,
    units_of,
)

if TYPE_CHECKING:
    from tcstudy.read.sweep import Sweep

WORD = re.compile(r"[A-Za-z_][A-Za-z_0-9]*")
UNNAMED = ("title", "institution", "units", "output", "parameters", "sweep")
"""Sections in which a name of a parameter is a word like others."""


def read_parameters(ctx: Context, node: Node | None) -> dict[str, Named]:
    """The value and the dimension of every name; without those that have a fault."""
    if node is None:
        return {}
    given = ctx.mapping(node, "names to numbers", "write {height: 20 mm}")
    for name, item in given.items():
        if not WORD.fullmatch(name) or name in (*VARIABLES, *CONSTANTS, *FUNCTIONS):
            taken = f"{name!r} is no name of a parameter: it has a meaning in expressions, or other signs than letters"
            ctx.errors.at(item, taken, "use letters, digits and _", on_key=True)
    known: dict[str, Named] = {}
    for name in _in_order(ctx, given):
        inner = Context(ctx.errors, ctx.units, ctx.folder, known)
        before = len(ctx.errors)
        found = _number(inner, given[name])
        if len(ctx.errors) == before:
            known[name] = found
    return known


def _in_order(ctx: Context, given: Mapping[str, Node]) -> Iterator[str]:
    """Every name after those that it is made of; a circle is a fault, and what needs it is left out."""
    done: dict[str, bool] = {}

    def visit(name: str, way: tuple[str, ...]) -> Iterator[str]:
        if name in way:
            circle = " → ".join((*way[way.index(name) :], name))
            ctx.errors.at(given[name], f"is made of itself: {circle}", "give one of these a number")
            done.update(dict.fromkeys(way, False))
        if name in way or name in done:
            return
        for other in sorted(words_in(given[name], given)):
            yield from visit(other, (*way, name))
        if done.setdefault(name, True):
            yield name

    for name in given:
        yield from visit(name, ())


def _number(ctx: Context, node: Node) -> Named:
    """A number, a quantity of any dimension that a study has, or an expression."""
    parts = split_quantity(node.value) if isinstance(node.value, str) else None
    if parts is None or ctx.units == "none":
        dimension = _dimension(ctx, node.value) if isinstance(node.value, str) and parts is None else NONE
        return Named(ctx.quantity(node, dimension), dimension)
    dimension, remedy = _of_unit(parts[1])
    try:
        if remedy:
            raise UnitError(f"{parts[1]!r} is not a unit of any number of a study", remedy)
        return Named(to_si(*parts, dimension), dimension)
    except UnitError as error:
        ctx.errors.at(node, *error.args)
        return Named(float("nan"), NONE)


@lru_cache(maxsize=256)
def _of_unit(unit: str) -> tuple[Dimension, str]:
    """The first dimension that has a unit; if none has, what to write instead."""
    remedy = ""
    for dimension in DIMENSIONS:
        try:
            to_si("1", unit, dimension)
            return dimension, ""
        except UnitError as error:
            remedy = error.args[1]
    return NONE, remedy


def _dimension(ctx: Context, text: str) -> Dimension:
    """The dimension of an expression between names; plain numbers for one that a study has not."""
    if ctx.units == "none" or not ctx.named:
        return NONE
    try:
        found = units_of(parse(text, tuple(ctx.named)), ctx.named)
    except (ExpressionError, UnitError):  # which whoever reads the number says
        return NONE
    return next((one for one in DIMENSIONS if dimensions_of(one.si) == found), NONE)


def words_in(node: Node, names: Iterable[str]) -> frozenset[str]:
    """The names that occur in the texts below a node."""
    return _words(node) & {*names}


@lru_cache(maxsize=65536)
def _words(node: Node) -> frozenset[str]:
    """All words of the texts below a node."""
    if isinstance(node.value, str):
        return frozenset(WORD.findall(node.value))
    inner = node.children.values() if node.children else node.value if isinstance(node.value, tuple) else ()
    return frozenset().union(*map(_words, inner))


def users(root: Node, name: str) -> set[str]:
    """The names that follow from one, itself included."""
    section = root.child("parameters")
    given = section.value if section is not None and isinstance(section.value, Mapping) else {}
    found, size = {name}, 0
    while len(found) > size:
        size = len(found)
        found |= {other for other, node in given.items() if words_in(node, found)}
    return found


def check_swept_names(ctx: Context, root: Node, sweep: Sweep, sections: Sequence[str]) -> None:
    """A swept name may act in the sections of a scene only, and in no swept value."""
    for axis in sweep.axes:
        if axis.parameter.path[0] != "parameters":
            continue
        following = users(root, axis.parameter.path[-1])
        for other in sweep.axes:
            for value in other.values:
                if words := words_in(value, following):
                    what = f"is made of {min(words)}, which is swept as well"
                    ctx.errors.at(value, what, "write its values out, or put the expression where the key is")
                    break
        assert isinstance(root.value, Mapping)
        for key, node in root.value.items():
            if key not in (*UNNAMED, *sections) and (words := words_in(node, following)):
                what = f"is swept, but {key} depends on it ({min(words)}), and a study has one {key}"
                ctx.errors.at(axis.node, what, "write one study for each value, with --set", on_key=True)
