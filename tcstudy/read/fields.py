"""Typed reading of marked nodes: numbers, quantities, expressions, points, words; and of sections whose keys stand in
the table, of which what is unknown or missing is recorded.

A reader returns the value, or after recording a fault a neutral stand-in (NaN, the first choice, an empty tuple), so
that one pass finds all faults. Comparisons with NaN are false, which keeps a fault from causing further ones; whoever
builds a record asks the collector afterwards whether anything was wrong.
"""

from __future__ import annotations

import math
import re
import sys
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field, replace
from functools import wraps
from pathlib import Path
from typing import Any, Concatenate, Literal, ParamSpec, TypeVar

from tcstudy.expressions import expression as expressions
from tcstudy.read.node import Collector, Node, elsewhere, hint, is_name, meant
from tcstudy.scene.key import Key
from tcstudy.scene.keys import rows, short_of
from tcstudy.scene.named import Named, expression_of
from tcstudy.scene.records import Point, Scalar
from tcstudy.scene.units import LENGTH, LONGEST, NUMBER, TRACTION, Dimension, UnitError, split_quantity, to_si
from tcstudy.shapes.faults import LARGEST, SMALLEST

P = ParamSpec("P")
T = TypeVar("T", bound=str)
V = TypeVar("V")


def none_after_fault(reader: Callable[Concatenate[Context, P], V]) -> Callable[Concatenate[Context, P], V | None]:
    """The reader of a section, with None in place of its value where it recorded a fault."""

    @wraps(reader)
    def read(ctx: Context, *args: P.args, **kwargs: P.kwargs) -> V | None:
        before = len(ctx.errors)
        value = reader(ctx, *args, **kwargs)
        return value if len(ctx.errors) == before else None

    return read


MOST = 2**31 - 1
"""Largest whole number that any key takes."""


def out_of_bounds(row: Key, value: float) -> str:
    """What a number of a row must that is out of its bounds, in words; empty for one within them, and for NaN."""
    low = row.above is not None and value <= row.above
    if low or (row.below is not None and value >= row.below):
        if row.above and row.below:
            return f"lie between {row.above:g} and {row.below:g}"
        return f"be greater than {row.above:g}" if low else f"be less than {row.below:g}"
    if row.least is not None and value < row.least:
        return f"be {row.least:g} or more"
    return f"be {row.most:g} or less" if row.most is not None and value > row.most else ""


@dataclass
class Context:
    """What every reader needs: where faults go, whether texts may have units, the study's folder, its named numbers."""

    errors: Collector
    units: Literal["SI", "none"] = "SI"
    folder: Path = Path()
    named: dict[str, Named] = field(default_factory=dict)

    def example(self, text: str) -> str:
        """An example for a remedy, without units in a dimensionless study."""
        return text if self.units == "SI" else re.sub(rf"({NUMBER}) [^,\]}}]+", r"\1", text)

    def scalar(self, node: Node, dimension: Dimension, *, varies: bool) -> Scalar:
        """A number in SI, or where it may vary in space an expression; NaN after a fault."""
        value = node.value
        if isinstance(value, str):
            return self._from_text(node, value, dimension, varies)
        if isinstance(value, bool) or not isinstance(value, int | float):
            what = f"must be {dimension.name}, but is {node.kind()}"
            return self._none(node, what, self._example(dimension, varies))
        return self._finite(node, value)

    def _none(self, node: Node, what: str, remedy: str) -> float:
        """NaN, after the fault is recorded."""
        self.errors.at(node, what, remedy)
        return math.nan

    def _finite(self, node: Node, value: float) -> float:
        if not abs(value) <= sys.float_info.max:  # before the conversion, which whole numbers can be too large for
            return self._none(node, f"{node.brief()} is not a finite number", "write a finite number")
        if value and not SMALLEST <= abs(value) <= LARGEST:
            size = "large" if abs(value) > 1.0 else "small"
            return self._none(node, f"{node.brief()} is too {size} to compute with", "check the number and its unit")
        return float(value)

    def _example(self, dimension: Dimension, varies: bool) -> str:
        expression = " or an expression such as 2*sin(pi*x)" if varies else ""
        return f"write for example {self.example(dimension.example)}{expression}"

    def _from_text(self, node: Node, text: str, dimension: Dimension, varies: bool) -> Scalar:
        """The value of a text: number and unit, or an expression."""
        if len(text) > LONGEST:
            what = f"is a text of {len(text)} characters, of which at most {LONGEST} are read"
            return self._none(node, what, "round it, or shorten the expression")
        parts = split_quantity(text)
        if parts and self.units == "none":
            remedy = "write the plain number, or drop `units: none`"
            return self._none(node, f"{node.brief()!r} has a unit, but the study says units: none", remedy)
        if parts:
            try:
                return self._finite(node, to_si(*parts, dimension))
            except UnitError as error:
                return self._none(node, str(error), error.remedy)
        if comma := re.match(r"\s*[-+]?\d+,\d", text):
            remedy = f"write a decimal point: {text.replace(',', '.', 1).strip()}"
            return self._none(node, f"{comma[0].strip()!r} has a decimal comma", remedy)
        try:
            expression = expression_of(text, self.named, dimension if self.units == "SI" else None)
        except UnitError as error:
            return self._none(node, str(error), error.remedy)
        except expressions.ExpressionError as error:
            what, _, remedy = str(error).partition("; ")
            if not varies and not self.named:  # with names it was meant as an expression
                what, remedy = f"{node.brief()!r} is not {dimension.name}", ""
            return self._none(node, what, remedy or self._example(dimension, varies))
        if expression.constant is not None:
            return self._finite(node, expression.constant)
        if not varies:
            return self._none(node, "may not vary with x and y", self._example(dimension, varies))
        return expression

    def quantity(self, node: Node, dimension: Dimension) -> float:
        """A number in SI that is the same everywhere; NaN after a fault."""
        value = self.scalar(node, dimension, varies=False)
        assert isinstance(value, float)
        return value

    def bounded(self, node: Node, row: Key, dimension: Dimension) -> float:
        """A number in SI within the bounds of a row; NaN after a fault."""
        value = self.quantity(node, dimension)
        if not (must := out_of_bounds(row, value)):
            return value
        remedy = f"write for example {self.example(row.example or dimension.example)}"
        return self._none(node, f"must {must}, but is {node.brief()}", remedy)

    def items(self, node: Node, content: str, least: int = 0) -> tuple[Node, ...]:
        """The entries of a list; empty after a fault."""
        if not isinstance(node.value, tuple) or len(node.value) < least:
            self.errors.at(node, f"must be {content}, but is {node.kind()}", f"write {content}: [..., ...]")
            return ()
        return node.value

    def _some(self, node: Node, content: str) -> tuple[Node, ...]:
        """The entries of a list, or the one that stands for it."""
        return self.items(node, f"a list of {content}", 1) if isinstance(node.value, tuple) else (node,)

    def pair(self, node: Node, content: str, example: str) -> tuple[Node, Node] | None:
        """The two entries of a list of two; None after a fault."""
        count = len(node.value) if isinstance(node.value, tuple) else 0
        if isinstance(node.value, tuple) and count == 2:
            return node.value[0], node.value[1]
        more = " (decimals have a point, a comma separates entries)" if count in (3, 4) else ""
        remedy = f"write for example {self.example(example)}{more}"
        self.errors.at(node, f"must be {content}, but is {node.kind()}", remedy)
        return None

    def point(
        self, node: Node, content: str = "a point [x, y]", example: str = "[0 mm, 20 mm]", second: Dimension = LENGTH
    ) -> Point:
        """A point [x, y] in metres, or another pair of a length and a number of the second dimension."""
        both = self.pair(node, content, example)
        return (self.quantity(both[0], LENGTH), self.quantity(both[1], second)) if both else (math.nan, math.nan)

    def mapping(self, node: Node, content: str, remedy: str, least: int = 1) -> Mapping[str, Node]:
        """The entries of a mapping of `content`; empty after a fault."""
        if isinstance(node.value, Mapping) and len(node.value) >= least:
            return node.value
        self.errors.at(node, f"must be a mapping of {content}, but is {node.kind()}", remedy)
        return {}

    def cf(self, dimension: Dimension) -> str:
        """Units of a dimension in CF form, "1" in a dimensionless study."""
        return dimension.cf if self.units == "SI" else "1"

    def unit(self, cell: Node, unit: str, dimension: Dimension, key: str | None = None) -> bool:
        """Whether a unit in the heading of a column is one of the dimension; if not, that is a fault."""
        what, remedy = "has a unit, but the study says units: none", "drop the unit"
        if self.units == "SI":
            try:
                to_si("1", unit, dimension)
                return True
            except UnitError as error:
                what, remedy = str(error), error.remedy
        self.errors.at(cell, what, remedy, key=key)
        return False

    def integer(self, node: Node, least: int, most: int | None = None) -> int:
        """A whole number within limits; the lower limit after a fault."""
        value = node.value
        if isinstance(value, float) and value.is_integer():
            value = int(value)
        if isinstance(value, bool) or not isinstance(value, int):
            self.errors.at(node, f"must be a whole number, but is {node.kind()}", f"write for example {least}")
            return least
        if not least <= value <= (most or MOST):
            limits = f"from {least} to {most}" if most else f"{least} or more"
            self.errors.at(node, f"must be {limits}, but is {node.brief()}", f"write for example {least}")
            return least
        return value

    def flag(self, node: Node) -> bool:
        """true or false; false after a fault."""
        if not isinstance(node.value, bool):
            self.errors.at(node, f"must be true or false, but is {node.kind()}", "write true or false, without quotes")
            return False
        return node.value

    def text(self, node: Node, content: str = "a text") -> str:
        """A text that is not empty; empty after a fault."""
        if not isinstance(node.value, str) or not node.value.strip():
            remedy = "write a text, in quotes if it looks like a number"
            self.errors.at(node, f"must be {content}, but is {node.kind()}", remedy)
            return ""
        return node.value

    def choice(self, node: Node, words: tuple[T, ...]) -> T:
        """One of some words; the first after a fault."""
        for word in words:
            if node.value == word:
                return word
        what = f"must be one of {', '.join(words)}, but is {node.kind()}"
        self.errors.at(node, what, hint(str(node.value), words, f"write for example {words[0]}"))
        return words[0]

    def name(self, node: Node, content: str = "an edge name") -> str:
        """A name of an edge or a region: letters, digits and underscores; empty after a fault."""
        value = node.value
        if not isinstance(value, str) or not is_name(value):
            remedy = "use letters, digits and _"
            self.errors.at(node, f"must be {content} of letters, digits and _, but is {node.kind()}", remedy)
            return ""
        return value

    def value(self, node: Node, row: Key, dimension: Dimension | None = None) -> Any:
        """What a row of the table says that a value is; after a fault a stand-in.

        dimension: where another key decides about it
        """
        dimension, least = dimension or row.dimension, int(row.least or 1)
        match row.kind:
            case "number" | "quantity":
                return self.bounded(node, row, dimension)
            case "integer":
                return self.integer(node, int(row.least or 0), None if row.most is None else int(row.most))
            case "field":
                return self.scalar(node, dimension, varies=True)
            case "component":
                return None if node.value == "free" else self.scalar(node, dimension, varies=True)
            case "vector" | "displacement":
                what, other = ("components", dimension.example) if row.kind == "vector" else ("displacements", "free")
                both = self.pair(node, f"a pair of {what}", f"[0, {other}]")
                one = replace(row, kind="field" if row.kind == "vector" else "component")
                return tuple(self.value(part, one, dimension) for part in both) if both else (math.nan, math.nan)
            case "point":
                return self.point(node)
            case "points":
                return tuple(self.point(entry) for entry in self.items(node, "a list of points", least))
            case "law points":
                said = ("a pair [s, b] of slip and traction", "[40 um, 5 MPa]", TRACTION)
                return tuple(self.point(entry, *said) for entry in self.items(node, "a list of pairs [s, b]", least))
            case "numbers":
                return tuple(self.quantity(entry, dimension) for entry in self.items(node, "a list of numbers", least))
            case "choice":
                return self.choice(node, row.words)
            case "one or more":
                return tuple(self.choice(entry, row.words) for entry in self._some(node, "words"))
            case "words":
                return tuple(self.text(entry, "the name of a number") for entry in self._some(node, "names"))
            case "sizes":
                return tuple(self.bounded(entry, row, dimension) for entry in self._some(node, "sizes"))
            case "flag":
                return self.flag(node)
            case "name":
                return self.name(node)
            case "text":
                return self.text(node, "a path" if row.name == "path" else "a text")
        raise AssertionError(row.kind)


UNREAD = {"point": (math.nan, math.nan), "name": "", "text": ""}
"""What stands for a missing value by its kind, where it is not NaN."""


class Fields:
    """The values of a section whose keys stand in the table; unknown and missing keys are recorded on the way in."""

    def __init__(
        self,
        ctx: Context,
        node: Node,
        section: str | Mapping[str, Key],
        required: Iterable[str] | None = None,
        optional: Iterable[str] | None = None,
    ) -> None:
        """section: its name in the table, or its rows.  required, optional: keys, where they depend on others."""
        self.ctx, self.node, self.rows = ctx, node, rows(section) if isinstance(section, str) else section
        required = [row.name for row in self.rows.values() if row.required] if required is None else list(required)
        rest = (name for name in self.rows if name not in required) if optional is None else optional
        self.required, known = required, [*required, *rest]
        short = short_of(section) if isinstance(section, str) else ""
        if short and not isinstance(node.value, Mapping):
            node = replace(node, value={short: node})
        self.values: Mapping[str, Node] = node.value if isinstance(node.value, Mapping) else {}
        if not isinstance(node.value, Mapping):
            top = rows("").get(section) if isinstance(section, str) else None
            pairs = ", ".join(f"{key}: {self.rows[key].suggestion}" for key in required or known[:1])
            example = ctx.example(top.example if top and top.example else f"{{{pairs}}}")
            remedy = f"write a mapping with the keys {', '.join(known)}, for example {example}"
            ctx.errors.at(node, f"must be a mapping, but is {node.kind()}", remedy)
            return
        wrong = [key for key in node.value if key not in known]
        free = [name for name in known if name not in node.value]
        near = {key: meant(key, free, known) for key in wrong}
        for key in wrong:
            remedy = elsewhere(key, node.path, near[key]) or f"use one of the keys {', '.join(free or known)}"
            if key[:1].isdigit():
                remedy = "write decimals with a point: a comma begins the next entry"
            ctx.errors.at(node.value[key], "unknown key", remedy, on_key=True)
        for key in required:
            if key not in node.value and key not in near.values():  # a misspelt key is one fault, not two
                self.missing(key)

    def missing(self, key: str) -> None:
        """Record that a key is missing."""
        where = f"{self.node.path}.{key}" if self.node.path else key
        remedy = f"add {key}: {self.ctx.example(self.rows[key].suggestion)}"
        self.ctx.errors.at(self.node, "is missing", remedy, key=where)

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
        return {name: self.value(name) for name in (self.rows if names is None else names) if self[name] is not None}
