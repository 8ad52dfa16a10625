"""Typed reading of marked nodes: numbers, quantities, expressions, points, words; and of sections
whose keys stand in the table, of which what is unknown or missing is recorded.

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
from collections.abc import Callable, Container, Iterable, Mapping
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
    """Whether a text may be the name of an edge or a region: letters, digits and underscores, at
    most MAX_NAME of them."""
    return len(text) <= MAX_NAME and text.isascii() and text.replace("_", "a").isalnum()


def elsewhere(key: str, path: str) -> str:
    """Where a key belongs that the section at a path does not have: another section of the study,
    or its top."""
    if "." in path or "[" in path:
        return ""
    homes = [name for name in rows("") if name != path and key in rows(name)]
    top = f"{key} belongs at the top of the study" if path and key in rows("") else ""
    return f"{key} belongs in {' or '.join(homes)}" if homes else top


class Unsound(Exception):
    """What comes next in a section needs what had a fault, which is recorded."""


def none_after_fault(
    reader: Callable[Concatenate[Context, P], V],
) -> Callable[Concatenate[Context, P], V | None]:
    """The reader of a section, with None in place of its value where it recorded a fault."""

    @wraps(reader)
    def read(ctx: Context, *args: P.args, **kwargs: P.kwargs) -> V | None:
        outer, ctx.before = ctx.before, len(ctx.errors)
        try:
            value = reader(ctx, *args, **kwargs)
            ctx.sound()
        except Unsound:
            return None
        finally:
            ctx.before = outer
        return value

    return read


MAX_NAME = 100
"""Characters of a name that the user gives: names in files, which are made of it, have at most 256."""
MAX_NAMES_SHOWN = 50
"""Names of a study that a message may show or suggest."""
MOST = 2**31 - 1
"""Largest whole number that any key takes."""
LISTS = {
    "points": ("point", "a list of points", 1),
    "law points": ("law point", "a list of pairs [s, b]", 1),
    "numbers": ("quantity", "a list of numbers", 1),
}
"""Kinds that are lists: of which kind, of what in words, at least how many, unless the row says
so."""
SOME = {
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
"""Kinds that are pairs: of which kind, what they are in words, an example."""
UNREAD = {"point": (math.nan, math.nan), "name": "", "text": ""}
"""What stands for a missing value by its kind, where it is not NaN."""


def out_of_bounds(row: Key, value: float) -> str:
    """What a number of a row must that is out of its bounds, in words; empty for one within them,
    and for NaN."""
    low, high = (
        row.above is not None and value <= row.above,
        row.below is not None and value >= row.below,
    )
    if (low or high) and row.above and row.below:
        return f"lie between {row.above:g} and {row.below:g}"
    if low or high:
        return f"be greater than {row.above:g}" if low else f"be less than {row.below:g}"
    if row.least is not None and value < row.least:
        return f"be {row.least:g} or more"
    return f"be {row.most:g} or less" if row.most is not None and value > row.most else ""


@dataclass
class Context:
    """What every reader needs: where faults go, whether texts may have units, the study's folder,
    its named numbers.

    before: how often faults were met before the section that is read
    unread: named numbers without a value, whose fault is recorded
    with_files: whether the file of a body must be there; results are read without it
    """

    errors: Collector
    units: Literal["SI", "none"] = "SI"
    folder: Path = Path()
    named: dict[str, Named] = field(default_factory=dict)
    before: int = 0
    unread: set[str] = field(default_factory=set)
    with_files: bool = True

    def at(self, node: Node, *said: str, key: str | None = None, on_key: bool = False) -> None:
        """Record a fault (`Collector.at`)."""
        self.errors.at(node, *said, key=key, on_key=on_key)

    def sound(self) -> None:
        """End the reading of a section that has a fault."""
        if len(self.errors) > self.before:
            raise Unsound

    def example(self, text: str) -> str:
        """An example for a remedy, without units in a dimensionless study."""
        return text if self.units == "SI" else re.sub(rf"({NUMBER}) [^,\]}}]+", r"\1", text)

    def cf(self, dimension: Dimension) -> str:
        """Units of a dimension in CF form, "1" in a dimensionless study."""
        return dimension.cf if self.units == "SI" else "1"

    def scalar(self, node: Node, dimension: Dimension, *, varies: bool) -> Scalar:
        """A number in SI, or where it may vary in space an expression; NaN after a fault."""
        write = f"write for example {self.example(dimension.example)}"
        write += " or an expression such as 2*sin(pi*x)" if varies else ""
        if self.unread and isinstance(node.value, str) and words_in(node, self.unread):
            self.errors.met_again()
            return math.nan
        try:
            value = (
                self._of_text(node, node.value, dimension, write)
                if isinstance(node.value, str)
                else node.value
            )
            if isinstance(value, expressions.Expression):
                if varies:
                    return value
                raise UnitError("may not vary with x and y", write)
            if isinstance(value, bool) or not isinstance(value, int | float):
                raise UnitError(f"must be {dimension.name}, but is {node.kind()}", write)
            if (
                not abs(value) <= sys.float_info.max
            ):  # before the conversion, which whole numbers can be too large for
                raise UnitError(f"{node.brief()} is not a finite number", "write a finite number")
            if value and not SMALLEST <= abs(value) <= LARGEST:
                size = "large" if abs(value) > 1.0 else "small"
                raise UnitError(
                    f"{node.brief()} is too {size} to compute with", "check the number and its unit"
                )
            return float(value)
        except UnitError as error:
            self.at(node, *error.args)
            return math.nan

    def _of_text(self, node: Node, text: str, dimension: Dimension, write: str) -> Scalar:
        """The value of a text: number and unit, or an expression. Raises UnitError; write: a
        remedy."""
        if len(text) > LONGEST:
            what = f"is a text of {len(text)} characters, of which at most {LONGEST} are read"
            raise UnitError(what, "round it, or shorten the expression")
        if parts := split_quantity(text):
            if self.units == "SI" and parts[1][:1].isdigit() and (marked := marked_number(text)):
                raise UnitError(*marked)
            if self.units == "SI":
                return to_si(*parts, dimension)
            what = f"{node.brief()!r} has a unit, but the study says units: none"
            raise UnitError(what, "write the plain number, or drop `units: none`")
        if marked := marked_number(text):
            raise UnitError(*marked)
        plain = text.translate(PLAIN_SIGNS)
        if plain != text and self._is_sound(node, plain, dimension):
            sign = next(character for character in text if character not in plain)
            raise UnitError(
                f"{node.brief()!r} has the sign {sign} (U+{ord(sign):04X})",
                f"write {plain.strip()}",
            )
        try:
            expression = expression_of(
                text, self.named_in(text), dimension if self.units == "SI" else None
            )
        except expressions.ExpressionError as error:
            what, _, remedy = self._expression_fault(text, str(error)).partition("; ")
            if (
                " or an expression" not in write and not self.named
            ):  # with names it was meant as an expression
                what, remedy = f"{node.brief()!r} is not {dimension.name}", ""
            raise UnitError(what, remedy or write) from None
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
        shown = islice(self.named, MAX_NAMES_SHOWN)
        try:
            parse(text, tuple(dict.fromkeys((*self.named_in(text), *shown))))
        except expressions.ExpressionError as error:
            return str(error)
        return otherwise

    def named_in(self, text: str) -> dict[str, Named]:
        """Return the named numbers that occur in a text."""
        words = dict.fromkeys(WORD.findall(text)) if self.named else ()
        return {word: self.named[word] for word in words if word in self.named}

    def quantity(self, node: Node, dimension: Dimension) -> float:
        """A number in SI that is the same everywhere; NaN after a fault."""
        value = self.scalar(node, dimension, varies=False)
        assert isinstance(value, float)
        return value

    def unit(self, cell: Node, unit: str, dimension: Dimension, key: str | None = None) -> bool:
        """Whether a unit in the heading of a column is one of the dimension; if not, that is a
        fault."""
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
        """The entries of a list; empty after a fault."""
        if node is None:
            return ()
        if isinstance(node.value, tuple) and len(node.value) >= least:
            return node.value
        self.at(
            node, f"must be {content}, but is {node.kind()}", f"write {content}: [{example}, ...]"
        )
        return ()

    def pair(self, node: Node, content: str, example: str) -> tuple[Node, Node] | None:
        """The two entries of a list of two; None after a fault."""
        if isinstance(node.value, tuple) and len(node.value) == 2:
            return node.value[0], node.value[1]
        more = (
            " (decimals have a point, a comma separates entries)"
            if len(node.entries) in (3, 4)
            else ""
        )
        self.at(
            node,
            f"must be {content}, but is {node.kind()}",
            f"write for example {self.example(example)}{more}",
        )
        return None

    def mapping(
        self, node: Node | None, content: str, remedy: str, least: int = 1, named: bool = False
    ) -> dict[str, Node]:
        """The entries of a mapping of `content`; empty after a fault, or without one. named: by
        names"""
        if node is None:
            return {}
        if not isinstance(node.value, Mapping) or len(node.value) < least:
            self.at(node, f"must be a mapping of {content}, but is {node.kind()}", remedy)
        for name, item in node.children.items() if named else ():
            if not is_name(name):
                self.at(
                    item,
                    f"{shortened(name)!r} is not a name",
                    f"use at most {MAX_NAME} letters, digits and _",
                    on_key=True,
                )
        return dict(node.children)

    def integer(self, node: Node, least: int, most: int | None = None) -> int:
        """A whole number within limits; the lower limit after a fault."""
        value = (
            int(node.value)
            if isinstance(node.value, float) and node.value.is_integer()
            else node.value
        )
        if isinstance(value, bool) or not isinstance(value, int):
            said = f"must be a whole number, but is {node.kind()}"
            if isinstance(value, str) and (marked := marked_number(value)):
                self.at(node, marked[0], marked[1].partition(" or ")[0])
                return least
        elif least <= value <= (most or MOST):
            return value
        else:
            said = f"must be {f'from {least} to {most}' if most else f'{least} or more'}, but is {node.brief()}"
        self.at(node, said, f"write for example {least}")
        return least

    def text(self, node: Node, content: str = "a text") -> str:
        """A text that is not empty; empty after a fault."""
        if isinstance(node.value, str) and node.value.strip():
            return node.value
        self.at(
            node,
            f"must be {content}, but is {node.kind()}",
            "write a text, in quotes if it looks like a number",
        )
        return ""

    def choice(self, node: Node, words: tuple[T, ...]) -> T:
        """One of some words; the first after a fault."""
        for word in words:
            if node.value == word:
                return word
        what = f"must be one of {', '.join(words)}, but is {node.kind()}"
        self.at(node, what, hint(str(node.value), words, f"write for example {words[0]}"))
        return words[0]

    def value(self, node: Node, row: Key, dimension: Dimension | None = None) -> Any:
        """What a row of the table says that a value is; after a fault a stand-in.

        dimension: where another key decides about it
        """
        dimension, kind = dimension or row.dimension, row.kind
        if kind in PAIRS:
            inner, content, example = PAIRS[kind]
            of = {"point": (LENGTH, LENGTH), "law point": (LENGTH, TRACTION)}.get(
                kind, (dimension, dimension)
            )
            example = example or (kind == "span" and row.example) or f"[0, {dimension.example}]"
            both = self.pair(node, content, example)
            one = replace(row, kind=inner)
            return tuple(map(self.value, both, (one, one), of)) if both else (math.nan, math.nan)
        if kind in LISTS or kind in SOME:
            inner, content, least = (LISTS | SOME)[kind]
            several = kind in LISTS or isinstance(node.value, tuple)
            entries = self.items(node, content, int(row.least or least)) if several else (node,)
            return tuple(
                self.value(entry, replace(row, kind=inner), dimension) for entry in entries
            )
        match kind:
            case "quantity":
                return self.quantity(node, dimension)
            case "number":
                value = self.quantity(node, dimension)
                if must := out_of_bounds(row, value):
                    remedy = f"write for example {self.example(row.example or dimension.example)}"
                    self.at(node, f"must {must}, but is {node.brief()}", remedy)
                    return math.nan
                return value
            case "integer":
                return self.integer(
                    node, int(row.least or 0), None if row.most is None else int(row.most)
                )
            case "component" if node.value == "free":
                return None
            case "field" | "component":
                return self.scalar(node, dimension, varies=True)
            case "choice by edge" if isinstance(node.value, Mapping):
                return {name: self.choice(item, row.words) for name, item in node.children.items()}
            case "choice" | "choice by edge":
                return self.choice(node, row.words)
            case "flag":
                if not isinstance(node.value, bool):
                    self.at(
                        node,
                        f"must be true or false, but is {node.kind()}",
                        "write true or false, without quotes",
                    )
                return node.value is True
            case "name":
                if isinstance(node.value, str) and is_name(node.value):
                    return node.value
                what = f"must be an edge name of letters, digits and _, but is {node.kind()}"
                self.at(node, what, f"use at most {MAX_NAME} letters, digits and _")
                return ""
            case "text":
                return self.text(node, f"a {row.name}" if row.name == "path" else "a text")
        raise AssertionError(kind)


class Fields:
    """The values of a section whose keys stand in the table; unknown and missing keys are recorded
    on the way in."""

    def __init__(
        self,
        ctx: Context,
        node: Node,
        section: str | Mapping[str, Key],
        required: Iterable[str] | None = None,
        optional: Iterable[str] | None = None,
    ) -> None:
        """section: its name in the table, or its rows.  required, optional: keys, where they depend on others."""
        self.ctx, self.node, self.rows = (
            ctx,
            node,
            rows(section) if isinstance(section, str) else section,
        )
        self.required = (
            [one.name for one in self.rows.values() if one.required]
            if required is None
            else list(required)
        )
        others = (
            (name for name in self.rows if name not in self.required)
            if optional is None
            else optional
        )
        known = [*self.required, *others]
        if (
            isinstance(section, str)
            and (short := short_of(section))
            and not isinstance(node.value, Mapping)
        ):
            node = replace(node, value={short: node})
        self.values: Mapping[str, Node] = node.children
        if not isinstance(node.value, Mapping):
            top = rows("").get(section) if isinstance(section, str) else None
            pairs = ", ".join(
                f"{key}: {self.rows[key].suggestion}" for key in self.required or known[:1]
            )
            example = ctx.example(top.example if top and top.example else f"{{{pairs}}}")
            remedy = f"write a mapping with the keys {', '.join(known)}, for example {example}"
            ctx.at(node, f"must be a mapping, but is {node.kind()}", remedy)
            return
        free = [name for name in known if name not in node.value]
        near = {
            key: nearest(key, free) or nearest(key, known) for key in node.value if key not in known
        }
        for key, like in near.items():
            remedy = (
                f"did you mean {like!r}?"
                if like
                else f"use one of the keys {', '.join(free or known)}"
            )
            if key[:1].isdigit():
                remedy = "write decimals with a point: a comma begins the next entry"
            elif not like:
                remedy = elsewhere(key, node.path) or remedy
            ctx.at(node.value[key], "unknown key", remedy, on_key=True)
        for key in self.required:
            if (
                key not in node.value and key not in near.values()
            ):  # a misspelt key is one fault, not two
                self.missing(key)

    def fault(self, key: str, *said: str, on_key: bool = False) -> None:
        """Record a fault, "what; remedy", at a key, or at the section where the key is not
        given."""
        self.ctx.at(self.values.get(key, self.node), *said, on_key=on_key and key in self.values)

    def missing(self, key: str) -> None:
        """Record that a key is missing."""
        where = f"{self.node.path}.{key}" if self.node.path else key
        self.ctx.at(
            self.node,
            "is missing",
            f"add {key}: {self.ctx.example(self.rows[key].suggestion)}",
            key=where,
        )

    def __getitem__(self, key: str) -> Node | None:
        return self.values.get(key)

    def value(self, key: str, dimension: Dimension | None = None) -> Any:
        """The value of a key; if it is not given its default, or a stand-in where it is required.

        dimension: where another key decides about it
        """
        node, row = self[key], self.rows[key]
        if node is not None:
            return self.ctx.value(node, row, dimension)
        return UNREAD.get(row.kind, math.nan) if key in self.required else row.default

    def given(self, names: Iterable[str] | None = None) -> dict[str, Any]:
        """The values of the keys that are given; of all keys, or of those named."""
        return {
            name: self.value(name)
            for name in (self.rows if names is None else names)
            if self[name] is not None
        }


def only_key(ctx: Context, node: Node, section: str, example: str) -> tuple[str, Node]:
    """The one key of a section that has no more, and its value; no key after a fault."""
    before, given = len(ctx.errors), Fields(ctx, node, section).values
    if len(given) != 1 and len(ctx.errors) == before:
        ctx.at(
            node, f"needs one of {', '.join(rows(section))}, not {len(given)}", f"write {example}"
        )
    return next(iter(given.items())) if len(ctx.errors) == before else ("", node)


def word_of(ctx: Context, node: Node, section: str, key: str) -> str:
    """The word that decides which other keys a section has; empty after a fault."""
    before, word = len(ctx.errors), node.at(key)
    if word is None:
        Fields(ctx, node, section, (key,))
    found = ctx.choice(word, rows(section)[key].words) if word else ""
    return found if len(ctx.errors) == before else ""


WORD = re.compile(r"[A-Za-z_][A-Za-z_0-9]*")
UNNAMED = ("title", "institution", "units", "output", "parameters", "sweep")
"""Sections in which a name of a parameter is a word like others."""


MAX_CIRCLES = 10
"""Circles of names that are each reported before the rest of the names is left unread."""


def read_parameters(
    ctx: Context, node: Node | None, kept: Mapping[str, Named] | None = None
) -> dict[str, Named]:
    """Return the value and the dimension of every name, and add those with a fault to `ctx.unread`.

    kept: names that need not be read again, with their values
    """
    known = kept or {}
    every = ctx.mapping(node, "names to numbers", "write {height: 20 mm}")
    given = {name: item for name, item in every.items() if name not in known}
    ctx.unread.difference_update(given)
    misnamed = {name: fault for name in given if (fault := _name_fault(name))}
    for name, fault in misnamed.items():
        remedy = f"use another name, of at most {MAX_NAME} letters, digits and _"
        ctx.at(given[name], fault, remedy, on_key=True)
    inner = replace(ctx, named={**known})
    for name in _reading_order(ctx, given):
        before = len(ctx.errors)
        value = _number(inner, given[name])
        if len(ctx.errors) == before and name not in misnamed:
            inner.named[name] = value
        else:
            inner.unread.add(name)
    ctx.unread.update(name for name in given if name not in inner.named)
    unread = Named(math.nan, NONE)
    return {name: inner.named.get(name, unread) for name in every}


def _name_fault(name: str) -> str:
    """Return why a text cannot be the name of a parameter; empty if it can."""
    if len(name) > MAX_NAME:
        return f"the name has {len(name)} characters; at most {MAX_NAME} are possible"
    if name in (*VARIABLES, *CONSTANTS, *FUNCTIONS):
        return f"{name!r} is not a name of a parameter: it has a meaning in expressions"
    if WORD.fullmatch(name):
        return ""
    return f"{shortened(name)!r} is not a name of a parameter: names begin with a letter or _"


def _reading_order(ctx: Context, given: Mapping[str, Node]) -> list[str]:
    """Return the names, each after those that it is made of; without those in circles, which are
    faults."""
    made_of = {name: words_in(item, given) for name, item in given.items()}
    position = {name: place for place, name in enumerate(given)}
    for _ in range(MAX_CIRCLES):
        try:
            return list(TopologicalSorter(made_of).static_order())
        except CycleError as error:
            circle = error.args[1][:0:-1]
        first = min(range(len(circle)), key=lambda place: position[circle[place]])
        words = " → ".join([*circle[first:], *circle[: first + 1]])
        ctx.at(given[circle[first]], f"is made of itself: {words}", "give one of these a number")
        ctx.unread.update(circle)
        made_of = {
            name: names.difference(circle) for name, names in made_of.items() if name not in circle
        }
    return []


def _number(ctx: Context, node: Node) -> Named:
    parts, dimension = split_quantity(node.value) if isinstance(node.value, str) else None, NONE
    if parts is not None and ctx.units == "SI":
        found = _of_unit(parts[1])
        if found is None:
            remedy = "units are case-sensitive: write mm, MPa, W/(m*K) and the like"
            ctx.at(node, f"{parts[1]!r} is not a unit of any number of a study", remedy)
            return Named(math.nan, NONE)
        dimension = found
    elif (
        isinstance(node.value, str) and ctx.units == "SI" and ctx.named
    ):  # plain for one that a study has not
        with suppress(
            expressions.ExpressionError, UnitError
        ):  # which whoever reads the number says
            used = ctx.named_in(node.value)
            found = units_of(parse(node.value, tuple(used)), used)
            dimension = next((one for one in DIMENSIONS if dimensions_of(one.si) == found), NONE)
    return Named(ctx.quantity(node, dimension), dimension)


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
    return frozenset().union(
        *map(_words, node.value if isinstance(node.value, tuple) else node.children.values())
    )


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
    reached, waiting = set(start), list(start)
    while waiting:
        new = [name for name in steps.get(waiting.pop(), ()) if name not in reached]
        reached.update(new)
        waiting.extend(new)
    return reached
