"""Typed reading of marked nodes: numbers, quantities, expressions, points, words, and sections.

The keys of a section stand in the table of keys; unknown and missing ones are recorded.

A reader returns the value, or after recording a fault a neutral stand-in (NaN, the first choice, an
empty tuple), so that one pass finds all faults. Comparisons with NaN are false, which keeps a fault
from causing further ones; the reader of a section asks `Context.sound` where it cannot go on, and
has no value after a fault.

The section `parameters` has numbers of the study's own, by name, and expressions between them.
Wherever a study takes a number or a field, an expression may use these names: `width: "2*height"`.
Their units are carried through it; a plain number has none, and x and y are numbers of metres,
whose products are not followed. A sweep may vary a name: every section that uses it, directly or by
another name, is then read again for each of its values.
"""

from __future__ import annotations

import math
import re
import sys
from collections.abc import Callable, Container, Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from functools import lru_cache, wraps
from graphlib import CycleError, TopologicalSorter
from itertools import islice
from pathlib import Path
from typing import Any, Concatenate, Literal, ParamSpec, TypeVar

from tcstudy.errors import hint, nearest, shortened
from tcstudy.expressions import expression as expressions
from tcstudy.expressions.expression import CONSTANTS, FUNCTIONS, VARIABLES, parse
from tcstudy.read.document import Collector, Node
from tcstudy.scene.keys import Key, rows, short_of
from tcstudy.scene.records import Scalar
from tcstudy.scene.units import (
    DIMENSIONS,
    LENGTH,
    LONGEST,
    NONE,
    NUMBER,
    PLAIN_SIGNS,
    TRACTION,
    Dimension,
    Named,
    UnitError,
    dimensions_of,
    expression_of,
    marked_number,
    split_quantity,
    to_si,
    units_of,
)
from tcstudy.shapes.faults import LARGEST, SMALLEST

P = ParamSpec("P")
T = TypeVar("T", bound=str)
V = TypeVar("V")


def is_name(text: str) -> bool:
    """Return whether a text may be the name of an edge or a region.

    Names have letters, digits and underscores, at most MAX_NAME of them.
    """
    return len(text) <= MAX_NAME and text.isascii() and text.replace("_", "a").isalnum()


def elsewhere(key: str, path: str) -> str:
    """Return the place of a key that the section at a path does not have, in words.

    It is another section of the study, or its top; empty if no section has the key.
    """
    if "." in path or "[" in path:
        return ""
    homes = [name for name in rows("") if name != path and key in rows(name)]
    if path == "adhesion" and "friction" in homes:  # it has what laws of both directions have
        homes.remove("friction")
    if homes:
        return f"{key} belongs in {' or '.join(homes)}"
    return f"{key} belongs at the top of the study" if path and key in rows("") else ""


class Unsound(Exception):
    """The rest of a section needs a value that had a fault, which is recorded."""


def none_after_fault(
    reader: Callable[Concatenate[Context, P], V],
) -> Callable[Concatenate[Context, P], V | None]:
    """Return the reader of a section with None in place of its value after a fault."""

    @wraps(reader)
    def read(ctx: Context, *args: P.args, **kwargs: P.kwargs) -> V | None:
        outer_count = ctx.before
        ctx.before = len(ctx.errors)
        try:
            value = reader(ctx, *args, **kwargs)
            ctx.sound()
        except Unsound:
            return None
        finally:
            ctx.before = outer_count
        return value

    return read


MAX_NAME = 100
"""Characters of a name that the user gives; names in files are made of it and have at most 256."""
MAX_NAMES_SHOWN = 50
"""Names of a study that a message may show or suggest."""
MAX_INTEGER = 2**31 - 1
"""Largest whole number that any key takes."""
LISTS = {
    "points": ("point", "a list of points", 1),
    "law points": ("law point", "a list of pairs [s, b]", 1),
    "numbers": ("quantity", "a list of numbers", 1),
}
"""Kinds that are lists: kind of the entries, the list in words, and its least length by default."""
LISTS_OR_ONE = {
    "one or more": ("choice", "a list of words", 1),
    "words": ("text", "a list of names", 1),
    "sizes": ("number", "a list of sizes", 1),
    "quantities": ("quantity", "a list of values", 0),
}
"""Kinds that are one value or a list of them."""
PAIRS = {
    "vector": ("field", "a pair of components", ""),
    "displacement": ("component", "a pair of displacements", "[0, free]"),
    "span": ("quantity", "a pair [low, high]", ""),
    "point": ("quantity", "a point [x, y]", "[0 mm, 20 mm]"),
    "law point": ("quantity", "a pair [s, b] of slip and traction", "[40 um, 5 MPa]"),
}
"""Kinds that are pairs: kind of the entries, the pair in words, an example."""
DIMENSIONS_OF_PAIRS = {"point": (LENGTH, LENGTH), "law point": (LENGTH, TRACTION)}
"""Dimensions of pairs by their kind, where no row and no other key decides about them."""
UNREAD = {"point": (math.nan, math.nan), "name": "", "text": ""}
"""Stand-ins for missing values by their kind, where it is not NaN."""


def out_of_bounds(row: Key, value: float) -> str:
    """Return the bound that a number of a row violates, in words: "be less than 1".

    Empty for a number within the bounds, and for NaN.
    """
    is_low = row.above is not None and value <= row.above
    is_high = row.below is not None and value >= row.below
    if is_low or is_high:
        if row.above and row.below:
            return f"lie between {row.above:g} and {row.below:g}"
        return f"be greater than {row.above:g}" if is_low else f"be less than {row.below:g}"
    if row.least is not None and value < row.least:
        return f"be {row.least:g} or more"
    if row.most is not None and value > row.most:
        return f"be {row.most:g} or less"
    return ""


@dataclass
class Context:
    """The collector of faults, units, folder and named numbers of the study that is read.

    before:     number of faults met before the section that is read
    unread:     named numbers without a value, whose fault is recorded
    with_files: whether the file of a body must exist; results are read without it
    """

    errors: Collector
    units: Literal["SI", "none"] = "SI"
    folder: Path = Path()
    named: dict[str, Named] = field(default_factory=dict)
    before: int = 0
    unread: set[str] = field(default_factory=set)
    with_files: bool = True

    def at(self, node: Node, *sentences: str, key: str | None = None, on_key: bool = False) -> None:
        """Record a fault (`Collector.at`)."""
        self.errors.at(node, *sentences, key=key, on_key=on_key)

    def sound(self) -> None:
        """End the reading of a section that has a fault."""
        if len(self.errors) > self.before:
            raise Unsound

    def example(self, text: str) -> str:
        """Return an example for a remedy, without units in a dimensionless study."""
        return text if self.units == "SI" else re.sub(rf"({NUMBER}) [^,\]}}]+", r"\1", text)

    def cf(self, dimension: Dimension) -> str:
        """Return the units of a dimension in CF form, "1" in a dimensionless study."""
        return dimension.cf if self.units == "SI" else "1"

    def scalar(self, node: Node, dimension: Dimension, *, varies: bool) -> Scalar:
        """Return a number in SI, or where it may vary in space an expression; NaN after a fault."""
        remedy = f"write for example {self.example(dimension.example)}"
        if varies:
            remedy += " or an expression such as 2*sin(pi*x)"
        if self.unread and isinstance(node.value, str) and words_in(node, self.unread):
            self.errors.met_again()
            return math.nan
        try:
            value: object = node.value
            if isinstance(node.value, str):
                value = self._of_text(node, node.value, dimension, remedy)
            if isinstance(value, expressions.Expression):
                if varies:
                    return value
                raise UnitError("may not vary with x and y", remedy)
            if isinstance(value, bool) or not isinstance(value, int | float):
                raise UnitError(f"must be {dimension.name}, but is {node.kind()}", remedy)
            # before the conversion, which whole numbers can be too large for
            if not abs(value) <= sys.float_info.max:
                raise UnitError(f"{node.brief()} is not a finite number", "write a finite number")
            if value and not SMALLEST <= abs(value) <= LARGEST:
                size = "large" if abs(value) > 1.0 else "small"
                fault = f"{node.brief()} is too {size} to compute with"
                raise UnitError(fault, "check the number and its unit")
            return float(value)
        except UnitError as error:
            self.at(node, *error.args)
            return math.nan

    def _of_text(self, node: Node, text: str, dimension: Dimension, remedy: str) -> Scalar:
        """Return the value of a text: number and unit, or an expression.

        remedy: of a text that is none of them
        Raises UnitError.
        """
        if len(text) > LONGEST:
            fault = f"is a text of {len(text)} characters, of which at most {LONGEST} are read"
            raise UnitError(fault, "round it, or shorten the expression")
        quantity = split_quantity(text)
        if quantity is not None and self.units == "SI":
            marked = marked_number(text) if quantity[1][:1].isdigit() else None
            if marked:
                raise UnitError(*marked)
            return to_si(*quantity, dimension)
        if quantity is not None:
            fault = f"{node.brief()!r} has a unit, but the study says units: none"
            raise UnitError(fault, "write the plain number, or drop `units: none`")
        marked = marked_number(text)
        if marked:
            raise UnitError(*marked)
        plain = text.translate(PLAIN_SIGNS)
        if plain != text and self._is_sound(node, plain, dimension):
            sign = next(character for character in text if character not in plain)
            fault = f"{node.brief()!r} has the sign {sign} (U+{ord(sign):04X})"
            raise UnitError(fault, f"write {plain.strip()}")
        try:
            dimension_of_text = dimension if self.units == "SI" else None
            expression = expression_of(text, self.named_in(text), dimension_of_text)
        except expressions.ExpressionError as error:
            fault, _, specific = self._expression_fault(text, str(error)).partition("; ")
            if " or an expression" not in remedy and not self.named:
                # without names it was not meant as an expression
                fault, specific = f"{node.brief()!r} is not {dimension.name}", ""
            raise UnitError(fault, specific or remedy) from None
        return expression if expression.constant is None else expression.constant

    def _is_sound(self, node: Node, text: str, dimension: Dimension) -> bool:
        """Return whether a text could stand in the place of the one that is there."""
        try:
            self._of_text(node, text, dimension, "")
        except UnitError:
            return False
        return True

    def _expression_fault(self, text: str, otherwise: str) -> str:
        """Return what is wrong with an expression, with the study's names among what is allowed."""
        suggested = islice(self.named, MAX_NAMES_SHOWN)
        try:
            parse(text, tuple(dict.fromkeys((*self.named_in(text), *suggested))))
        except expressions.ExpressionError as error:
            return str(error)
        return otherwise

    def named_in(self, text: str) -> dict[str, Named]:
        """Return the named numbers that occur in a text."""
        words = dict.fromkeys(WORD.findall(text)) if self.named else ()
        return {word: self.named[word] for word in words if word in self.named}

    def quantity(self, node: Node, dimension: Dimension) -> float:
        """Return a number in SI that is the same everywhere; NaN after a fault."""
        value = self.scalar(node, dimension, varies=False)
        assert isinstance(value, float)
        return value

    def unit(self, cell: Node, unit: str, dimension: Dimension, key: str | None = None) -> bool:
        """Return whether a unit in the heading of a column is one of the dimension.

        If it is not, that is a fault.
        """
        try:
            if self.units == "none":
                raise UnitError("has a unit, but the study says units: none", "drop the unit")
            to_si("1", unit, dimension)
        except UnitError as error:
            self.at(cell, *error.args, key=key)
            return False
        return True

    def items(
        self, node: Node | None, content: str, least: int = 0, example: str = "..."
    ) -> tuple[Node, ...]:
        """Return the entries of a list; empty after a fault."""
        if node is None:
            return ()
        if isinstance(node.value, tuple) and len(node.value) >= least:
            return node.value
        fault = f"must be {content}, but is {node.kind()}"
        self.at(node, fault, f"write {content}: [{example}, ...]")
        return ()

    def pair(self, node: Node, content: str, example: str) -> tuple[Node, Node] | None:
        """Return the two entries of a list of two; None after a fault."""
        if isinstance(node.value, tuple) and len(node.value) == 2:
            return node.value[0], node.value[1]
        remedy = f"write for example {self.example(example)}"
        if len(node.entries) in (3, 4):  # as of a pair with decimal commas
            remedy += " (decimals have a point, a comma separates entries)"
        self.at(node, f"must be {content}, but is {node.kind()}", remedy)
        return None

    def mapping(
        self, node: Node | None, content: str, remedy: str, least: int = 1, named: bool = False
    ) -> dict[str, Node]:
        """Return the entries of a mapping of `content`; empty after a fault, or without one.

        named: whether its keys must be names
        """
        if node is None:
            return {}
        if not isinstance(node.value, Mapping) or len(node.value) < least:
            self.at(node, f"must be a mapping of {content}, but is {node.kind()}", remedy)
        names = node.children if named else {}
        for name, item in names.items():
            if not is_name(name):
                fault = f"{shortened(name)!r} is not a name"
                self.at(item, fault, f"use at most {MAX_NAME} letters, digits and _", on_key=True)
        return dict(node.children)

    def integer(self, node: Node, least: int, most: int | None = None) -> int:
        """Return a whole number within limits; the lower limit after a fault."""
        value = node.value
        if isinstance(value, float) and value.is_integer():
            value = int(value)
        if isinstance(value, str):
            marked = marked_number(value)
            if marked:
                fault, remedy = marked
                self.at(node, fault, remedy.partition(" or ")[0])
                return least
        is_whole = isinstance(value, int) and not isinstance(value, bool)
        if isinstance(value, int) and is_whole and least <= value <= (most or MAX_INTEGER):
            return value
        limits = f"from {least} to {most}" if most else f"{least} or more"
        if is_whole:
            fault = f"must be {limits}, but is {node.brief()}"
        else:
            fault = f"must be a whole number, but is {node.kind()}"
        self.at(node, fault, f"write for example {least}")
        return least

    def text(self, node: Node, content: str = "a text") -> str:
        """Return a text that is not empty; empty after a fault."""
        if isinstance(node.value, str) and node.value.strip():
            return node.value
        fault = f"must be {content}, but is {node.kind()}"
        self.at(node, fault, "write a text, in quotes if it looks like a number")
        return ""

    def choice(self, node: Node, words: tuple[T, ...]) -> T:
        """Return one of some words; the first after a fault."""
        for word in words:
            if node.value == word:
                return word
        fault = f"must be one of {', '.join(words)}, but is {node.kind()}"
        self.at(node, fault, hint(str(node.value), words, f"write for example {words[0]}"))
        return words[0]

    def value(self, node: Node, row: Key, dimension: Dimension | None = None) -> Any:
        """Return the value of a row of the table; after a fault a stand-in.

        dimension: where another key decides about it
        """
        dimension = dimension or row.dimension
        kind = row.kind
        if kind in PAIRS:
            return self._pair_value(node, row, dimension)
        if kind in LISTS or kind in LISTS_OR_ONE:
            inner, content, least = (LISTS | LISTS_OR_ONE)[kind]
            entries: tuple[Node, ...] = (node,)
            if kind in LISTS or isinstance(node.value, tuple):
                entries = self.items(node, content, int(row.least or least))
            inner_row = replace(row, kind=inner)
            return tuple(self.value(entry, inner_row, dimension) for entry in entries)
        match kind:
            case "quantity":
                return self.quantity(node, dimension)
            case "number":
                return self._bounded_number(node, row, dimension)
            case "integer":
                most = None if row.most is None else int(row.most)
                return self.integer(node, int(row.least or 0), most)
            case "component" if node.value == "free":
                return None
            case "number or word" if node.value in row.words:
                return node.value
            case "number or word":
                return self._number_or_word(node, row, dimension)
            case "field" | "component":
                return self.scalar(node, dimension, varies=True)
            case "choice by edge" if isinstance(node.value, Mapping):
                return {name: self.choice(item, row.words) for name, item in node.children.items()}
            case "choice" | "choice by edge":
                return self.choice(node, row.words)
            case "flag or word" if isinstance(node.value, str) and node.value in row.words:
                return node.value
            case "flag or word" if not isinstance(node.value, bool):
                words = ", ".join(row.words)
                fault = f"must be true, false or {words}, but is {node.kind()}"
                self.at(node, fault, f"write true, false or {words}, without quotes")
                return False
            case "flag" | "flag or word":
                if not isinstance(node.value, bool):
                    fault = f"must be true or false, but is {node.kind()}"
                    self.at(node, fault, "write true or false, without quotes")
                return node.value is True
            case "name":
                if isinstance(node.value, str) and is_name(node.value):
                    return node.value
                fault = f"must be an edge name of letters, digits and _, but is {node.kind()}"
                self.at(node, fault, f"use at most {MAX_NAME} letters, digits and _")
                return ""
            case "text":
                return self.text(node, f"a {row.name}" if row.name == "path" else "a text")
        raise AssertionError(kind)

    def _pair_value(self, node: Node, row: Key, dimension: Dimension) -> tuple[Any, ...]:
        inner, content, example = PAIRS[row.kind]
        if row.kind == "span":
            example = row.example
        dimensions = DIMENSIONS_OF_PAIRS.get(row.kind, (dimension, dimension))
        entries = self.pair(node, content, example or f"[0, {dimension.example}]")
        if entries is None:
            return (math.nan, math.nan)
        inner_row = replace(row, kind=inner)
        first, second = dimensions
        return self.value(entries[0], inner_row, first), self.value(entries[1], inner_row, second)

    def _number_or_word(self, node: Node, row: Key, dimension: Dimension) -> float:
        """Return a number; a word that is no name of one is a fault."""
        text = node.value
        if (
            not isinstance(text, str)
            or not WORD.fullmatch(text)
            or text in {*self.named, *self.unread}
        ):
            return self._bounded_number(node, row, dimension)
        words = " or ".join(row.words)
        example = self.example(row.suggestion)
        fault = f"must be {words} or {dimension.name}, but is {node.kind()}"
        self.at(node, fault, f"write {words}, or for example {example}")
        return math.nan

    def _bounded_number(self, node: Node, row: Key, dimension: Dimension) -> float:
        value = self.quantity(node, dimension)
        violated = out_of_bounds(row, value)
        if not violated:
            return value
        example = self.example(row.example or dimension.example)
        fault = f"must {violated}, but is {node.brief()}"
        self.at(node, fault, f"write for example {example}")
        return math.nan


class Fields:
    """The values of a section whose keys stand in the table."""

    def __init__(
        self,
        ctx: Context,
        node: Node,
        section: str | Mapping[str, Key],
        required: Iterable[str] | None = None,
        optional: Iterable[str] | None = None,
    ) -> None:
        """Record unknown and missing keys of a section.

        section: its name in the table, or its rows
        required, optional: keys, where they depend on others
        """
        name = section if isinstance(section, str) else ""
        self.ctx = ctx
        self.node = node
        self.rows = rows(section) if isinstance(section, str) else section
        if required is None:
            self.required = [row.name for row in self.rows.values() if row.required]
        else:
            self.required = list(required)
        if optional is None:
            optional = [key for key in self.rows if key not in self.required]
        known_keys = [*self.required, *optional]
        short = short_of(name)
        if short and not isinstance(node.value, Mapping):
            node = replace(node, value={short: node})
        self.values: Mapping[str, Node] = node.children
        if isinstance(node.value, Mapping):
            self._check_keys(known_keys)
            return
        top = rows("").get(name)
        if top and top.example:
            example = top.example
        else:
            keys = self.required or known_keys[:1]
            pairs = ", ".join(f"{key}: {self.rows[key].suggestion}" for key in keys)
            example = f"{{{pairs}}}"
        fault = f"must be a mapping, but is {node.kind()}"
        mapping = f"a mapping with the keys {', '.join(known_keys)}"
        ctx.at(node, fault, f"write {mapping}, for example {ctx.example(example)}")

    def _check_keys(self, known_keys: Sequence[str]) -> None:
        """Record unknown and missing keys; a misspelt key is one fault, not two."""
        free = [key for key in known_keys if key not in self.values]
        unknown = [key for key in self.values if key not in known_keys]
        meant = {key: nearest(key, free) or nearest(key, known_keys) for key in unknown}
        for key, similar in meant.items():
            if key[:1].isdigit():
                remedy = "write decimals with a point: a comma begins the next entry"
            elif similar:
                remedy = f"did you mean {similar!r}?"
            else:
                keys = f"use one of the keys {', '.join(free or known_keys)}"
                remedy = elsewhere(key, self.node.path) or keys
            self.ctx.at(self.values[key], "unknown key", remedy, on_key=True)
        for key in self.required:
            if key not in self.values and key not in meant.values():
                self.missing(key)

    def fault(self, key: str, *sentences: str, on_key: bool = False) -> None:
        """Record a fault, "problem; remedy", at a key, or at the section without this key."""
        node = self.values.get(key, self.node)
        self.ctx.at(node, *sentences, on_key=on_key and key in self.values)

    def missing(self, key: str) -> None:
        """Record that a key is missing."""
        path = f"{self.node.path}.{key}" if self.node.path else key
        remedy = f"add {key}: {self.ctx.example(self.rows[key].suggestion)}"
        self.ctx.at(self.node, "is missing", remedy, key=path)

    def __getitem__(self, key: str) -> Node | None:
        return self.values.get(key)

    def value(self, key: str, dimension: Dimension | None = None) -> Any:
        """Return the value of a key, or its default.

        A required key that is not given has a stand-in.
        dimension: where another key decides about it
        """
        node, row = self[key], self.rows[key]
        if node is not None:
            return self.ctx.value(node, row, dimension)
        return UNREAD.get(row.kind, math.nan) if key in self.required else row.default

    def given(self, names: Iterable[str] | None = None) -> dict[str, Any]:
        """Return the values of the keys that are given; of all keys, or of those named."""
        keys = self.rows if names is None else names
        return {key: self.value(key) for key in keys if self[key] is not None}


def only_key(ctx: Context, node: Node, section: str, example: str) -> tuple[str, Node]:
    """Return the only key of a section and its value; no key after a fault."""
    before = len(ctx.errors)
    values = Fields(ctx, node, section).values
    if len(values) != 1 and len(ctx.errors) == before:
        fault = f"needs one of {', '.join(rows(section))}, not {len(values)}"
        ctx.at(node, fault, f"write {example}")
    return next(iter(values.items())) if len(ctx.errors) == before else ("", node)


def word_of(ctx: Context, node: Node, section: str, key: str) -> str:
    """Return the word that decides which other keys a section has; empty after a fault."""
    before = len(ctx.errors)
    word = node.at(key)
    if word is None:
        Fields(ctx, node, section, (key,))
        return ""
    choice = ctx.choice(word, rows(section)[key].words)
    return choice if len(ctx.errors) == before else ""


WORD = re.compile(r"[A-Za-z_][A-Za-z_0-9]*")
UNNAMED = ("title", "institution", "units", "output", "parameters", "sweep")
"""Sections in which a name of a parameter is an ordinary word."""
MAX_CIRCLES = 10
"""Circles of names that are each reported before the rest of the names is left unread."""


def read_parameters(
    ctx: Context, node: Node | None, read_before: Mapping[str, Named] | None = None
) -> dict[str, Named]:
    """Return the value and the dimension of every name, and add those with a fault to `ctx.unread`.

    read_before: names that need not be read again, with their values
    """
    values = read_before or {}
    numbers = ctx.mapping(node, "names to numbers", "write {height: 20 mm}")
    new_items = {name: item for name, item in numbers.items() if name not in values}
    ctx.unread.difference_update(new_items)
    misnamed = {name: fault for name in new_items if (fault := _name_fault(name))}
    for name, fault in misnamed.items():
        remedy = f"use another name, of at most {MAX_NAME} letters, digits and _"
        ctx.at(new_items[name], fault, remedy, on_key=True)
    inner = replace(ctx, named={**values})
    for name in _reading_order(ctx, new_items):
        before = len(ctx.errors)
        value = _number(inner, new_items[name])
        if len(ctx.errors) == before and name not in misnamed:
            inner.named[name] = value
        else:
            inner.unread.add(name)
    ctx.unread.update(name for name in new_items if name not in inner.named)
    unread = Named(math.nan, NONE)
    return {name: inner.named.get(name, unread) for name in numbers}


def _name_fault(name: str) -> str:
    """Return why a text cannot be the name of a parameter; empty if it can."""
    if len(name) > MAX_NAME:
        return f"the name has {len(name)} characters; at most {MAX_NAME} are possible"
    if name in (*VARIABLES, *CONSTANTS, *FUNCTIONS):
        return f"{name!r} is not a name of a parameter: it has a meaning in expressions"
    if WORD.fullmatch(name):
        return ""
    return f"{shortened(name)!r} is not a name of a parameter: names begin with a letter or _"


def _reading_order(ctx: Context, items: Mapping[str, Node]) -> list[str]:
    """Return the names, each after those in its expression.

    Names in circles are faults and left out.
    """
    names_used = {name: words_in(item, items) for name, item in items.items()}
    position = {name: place for place, name in enumerate(items)}
    for _ in range(MAX_CIRCLES):
        try:
            return list(TopologicalSorter(names_used).static_order())
        except CycleError as error:
            circle = error.args[1][:0:-1]
        first = min(range(len(circle)), key=lambda place: position[circle[place]])
        words = " → ".join([*circle[first:], *circle[: first + 1]])
        ctx.at(items[circle[first]], f"is made of itself: {words}", "give one of these a number")
        ctx.unread.update(circle)
        names_used = {
            name: used.difference(circle) for name, used in names_used.items() if name not in circle
        }
    return []


def _number(ctx: Context, node: Node) -> Named:
    """Return the number of a name and its dimension, that of its unit or expression."""
    dimension = NONE
    if isinstance(node.value, str) and ctx.units == "SI":
        quantity = split_quantity(node.value)
        if quantity is not None:
            unit = quantity[1]
            of_unit = _of_unit(unit)
            if of_unit is None:
                remedy = "units are case-sensitive: write mm, MPa, W/(m*K) and the like"
                ctx.at(node, f"{unit!r} is not a unit of any number of a study", remedy)
                return Named(math.nan, NONE)
            dimension = of_unit
        elif ctx.named:
            dimension = _of_expression(ctx, node.value)
    return Named(ctx.quantity(node, dimension), dimension)


def _of_expression(ctx: Context, text: str) -> Dimension:
    """Return the dimension of an expression; NONE for one that no number of a study has."""
    with suppress(expressions.ExpressionError, UnitError):  # the reader of the number records them
        named = ctx.named_in(text)
        dimensionality = units_of(parse(text, tuple(named)), named)
        for dimension in DIMENSIONS:
            if dimensions_of(dimension.si) == dimensionality:
                return dimension
    return NONE


@lru_cache(maxsize=256)
def _of_unit(unit: str) -> Dimension | None:
    for dimension in DIMENSIONS:
        with suppress(UnitError):
            to_si("1", unit, dimension)
            return dimension
    return None


def words_in(node: Node, names: Container[str]) -> frozenset[str]:
    """Return those of the names that occur in the texts below a node."""
    return frozenset(word for word in _words(node) if word in names)


@lru_cache(maxsize=65536)
def _words(node: Node) -> frozenset[str]:
    if isinstance(node.value, str):
        return frozenset(WORD.findall(node.value))
    nodes_below = node.value if isinstance(node.value, tuple) else node.children.values()
    return frozenset().union(*map(_words, nodes_below))


def users(root: Node, name: str) -> set[str]:
    """Return the names that follow from one, itself included."""
    section = root.at("parameters")
    return _reached({name}, _followers(section) if section else {})


@lru_cache(maxsize=16)
def _followers(section: Node) -> dict[str, list[str]]:
    """Return by name of a parameter the names whose texts have it."""
    followers: dict[str, list[str]] = {}
    for name, node in section.children.items():
        for word in words_in(node, section.children):
            followers.setdefault(word, []).append(name)
    return followers


def names_needed(section: Node, readers: Iterable[Node]) -> set[str]:
    """Return the names of the section `parameters` that other sections use, also by other names."""
    names = section.children
    used = {word for node in readers for word in words_in(node, names)}
    return _reached(used, {name: words_in(node, names) for name, node in names.items()})


def _reached(start: set[str], steps: Mapping[str, Iterable[str]]) -> set[str]:
    """Return all that can be reached from some names, these included."""
    reached = set(start)
    waiting = list(start)
    while waiting:
        new = [name for name in steps.get(waiting.pop(), ()) if name not in reached]
        reached.update(new)
        waiting.extend(new)
    return reached
