"""Typed reading of marked nodes: numbers, quantities, expressions, points, words; and of sections whose keys stand in
the table, of which what is unknown or missing is recorded.

A reader returns the value, or after recording a fault a neutral stand-in (NaN, the first choice, an empty tuple), so
that one pass finds all faults. Comparisons with NaN are false, which keeps a fault from causing further ones; whoever
builds a record asks the collector afterwards whether anything was wrong.
"""

from __future__ import annotations

import difflib
import math
import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any, Literal, TypeVar

from tcstudy.expressions import expression as expressions
from tcstudy.read.node import Collector, Node
from tcstudy.scene import keys
from tcstudy.scene.records import Point, Scalar
from tcstudy.scene.units import LENGTH, NUMBER, Dimension, UnitError, split_quantity, to_si

T = TypeVar("T", bound=str)
Sign = Literal["any", "positive", "not negative"]


def nearest(word: str, known: Iterable[str]) -> str | None:
    """The known word most like the given one, if any is."""
    known = list(known)
    lowered = {name.lower(): name for name in known}
    if word.lower() in lowered:
        return lowered[word.lower()]
    near = difflib.get_close_matches(word, known, n=1, cutoff=0.55)
    return near[0] if near else None


def choose(word: str, known: Iterable[str], noun: str) -> str:
    """Remedy for a word that is not known: the nearest one, or all."""
    known = list(known)
    near = nearest(word, known)
    return f"did you mean {near!r}?" if near else f"use {noun} {', '.join(known)}"


@lru_cache(maxsize=4096)
def _expression(text: str) -> expressions.Expression:
    return expressions.parse(text)


MOST = 2**31 - 1
"""Largest whole number that any key takes."""


@dataclass
class Context:
    """What every reader needs: where faults go, whether texts with units are allowed, the study's folder."""

    errors: Collector
    units: Literal["SI", "none"] = "SI"
    folder: Path = Path()

    def example(self, text: str) -> str:
        """An example for a remedy, without units in a dimensionless study."""
        return text if self.units == "SI" else re.sub(rf"({NUMBER}) [^,\]}}]+", r"\1", text)

    def scalar(self, node: Node, dimension: Dimension, *, varies: bool) -> Scalar:
        """A number in SI, or where it may vary in space an expression; NaN after a fault."""
        value = node.value
        if isinstance(value, str):
            return self._from_text(node, value, dimension, varies)
        if isinstance(value, bool) or not isinstance(value, int | float):
            self.errors.at(node, f"must be {dimension.name}, but is {node.kind()}", self._example(dimension, varies))
            return math.nan
        return self._finite(node, value)

    def _finite(self, node: Node, value: float) -> float:
        try:
            number = float(value)
        except OverflowError:
            number = math.inf
        if not math.isfinite(number):
            self.errors.at(node, f"{node.brief()} is not a finite number", "write a finite number")
            return math.nan
        return number

    def _example(self, dimension: Dimension, varies: bool) -> str:
        return f"write for example {self.example(dimension.example)}" + (
            " or an expression such as 2*sin(pi*x)" if varies else ""
        )

    def _from_text(self, node: Node, text: str, dimension: Dimension, varies: bool) -> Scalar:
        """The value of a text: number and unit, or an expression."""
        parts = split_quantity(text)
        if parts and self.units == "none":
            remedy = "write the plain number, or drop `units: none`"
            self.errors.at(node, f"{node.brief()!r} has a unit, but the study says units: none", remedy)
            return math.nan
        if parts:
            try:
                return to_si(*parts, dimension)
            except UnitError as error:
                self.errors.at(node, str(error), error.remedy)
                return math.nan
        if comma := re.match(r"\s*[-+]?\d+,\d", text):
            remedy = f"write a decimal point: {text.replace(',', '.', 1).strip()}"
            self.errors.at(node, f"{comma[0].strip()!r} has a decimal comma", remedy)
            return math.nan
        try:
            expression = _expression(text)
        except expressions.ExpressionError as error:
            what, _, remedy = str(error).partition("; ")
            if not varies or not remedy:
                what = f"{node.brief()!r} is not {dimension.name}" if not varies else what
                remedy = self._example(dimension, varies)
            self.errors.at(node, what, remedy)
            return math.nan
        if expression.constant is not None:
            return self._finite(node, expression.constant)
        if not varies:
            self.errors.at(node, "may not vary with x and y", self._example(dimension, varies))
            return math.nan
        return expression

    def quantity(self, node: Node, dimension: Dimension, sign: Sign = "any") -> float:
        """A number in SI that is the same everywhere; NaN after a fault."""
        value = self.scalar(node, dimension, varies=False)
        assert isinstance(value, float)
        if (sign == "positive" and value <= 0.0) or (sign == "not negative" and value < 0.0):
            bound = "greater than 0" if sign == "positive" else "0 or more"
            self.errors.at(node, f"must be {bound}, but is {node.brief()}", self._example(dimension, False))
            return math.nan
        return value

    def items(self, node: Node, content: str, least: int = 0) -> tuple[Node, ...]:
        """The entries of a list; empty after a fault."""
        if not isinstance(node.value, tuple) or len(node.value) < least:
            self.errors.at(node, f"must be {content}, but is {node.kind()}", f"write {content}: [..., ...]")
            return ()
        return node.value

    def pair(self, node: Node, content: str, example: str) -> tuple[Node, Node] | None:
        """The two entries of a list of two; None after a fault."""
        if isinstance(node.value, tuple) and len(node.value) == 2:
            return node.value[0], node.value[1]
        hint = ""
        if isinstance(node.value, tuple) and len(node.value) in (3, 4):
            hint = " (decimals have a point, a comma separates entries)"
        remedy = f"write for example {self.example(example)}{hint}"
        self.errors.at(node, f"must be {content}, but is {node.kind()}", remedy)
        return None

    def vector(self, node: Node, dimension: Dimension) -> tuple[Scalar, Scalar]:
        """Two components, each a number or an expression."""
        both = self.pair(node, "a pair of components", f"[0, {dimension.example}]")
        if both is None:
            return math.nan, math.nan
        return self.scalar(both[0], dimension, varies=True), self.scalar(both[1], dimension, varies=True)

    def point(self, node: Node) -> Point:
        """A point [x, y] in metres."""
        both = self.pair(node, "a point [x, y]", "[0 mm, 20 mm]")
        if both is None:
            return math.nan, math.nan
        return self.quantity(both[0], LENGTH), self.quantity(both[1], LENGTH)

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
            self.errors.at(
                node, f"must be {content}, but is {node.kind()}", "write a text, in quotes if it looks like a number"
            )
            return ""
        return node.value

    def choice(self, node: Node, words: tuple[T, ...]) -> T:
        """One of some words; the first after a fault."""
        for word in words:
            if node.value == word:
                return word
        what = f"must be one of {', '.join(words)}, but is {node.kind()}"
        near = nearest(str(node.value), words)
        self.errors.at(node, what, f"did you mean {near!r}?" if near else f"write for example {words[0]}")
        return words[0]

    def name(self, node: Node, content: str = "a name") -> str:
        """A name of an edge or a region: letters, digits and underscores; empty after a fault."""
        value = node.value
        if not isinstance(value, str) or not value.isascii() or not value.replace("_", "a").isalnum():
            remedy = "use letters, digits and _"
            self.errors.at(node, f"must be {content} of letters, digits and _, but is {node.kind()}", remedy)
            return ""
        return value


class Fields:
    """The values of a section whose keys stand in the table; unknown and missing keys are recorded on the way in."""

    def __init__(
        self,
        ctx: Context,
        node: Node,
        section: str,
        required: Iterable[str] | None = None,
        optional: Iterable[str] | None = None,
    ) -> None:
        """required, optional: keys, where they depend on others; else those of the table."""
        self.ctx, self.node, self.rows = ctx, node, keys.rows(section)
        required = [row.name for row in self.rows.values() if row.required] if required is None else list(required)
        rest = (name for name in self.rows if name not in required) if optional is None else optional
        known = [*required, *rest]
        self.values: Mapping[str, Node] = {}
        if not isinstance(node.value, Mapping):
            example = (
                f"for example {{{required[0]}: {ctx.example(self.rows[required[0]].suggestion)}}}"
                if required
                else "key: value"
            )
            remedy = f"write a mapping with the keys {', '.join(known)}, {example}"
            ctx.errors.at(node, f"must be a mapping, but is {node.kind()}", remedy)
            self.is_mapping = False
            return
        self.is_mapping = True
        self.values = node.value
        wrong = [key for key in node.value if key not in known]
        free = [name for name in known if name not in node.value]
        near = {key: _meant(key, free, known) for key in wrong}
        for key in wrong:
            remedy = f"did you mean {near[key]!r}?" if near[key] else f"use one of the keys {', '.join(free or known)}"
            if key[:1].isdigit():
                remedy = "write decimals with a point: a comma begins the next entry"
            ctx.errors.at(node.value[key], "unknown key", remedy, on_key=True)
        guessed = set(near.values())
        for key in required:
            # A misspelt key is one fault, not an unknown and a missing one.
            if key not in node.value and key not in guessed:
                self.missing(key)

    def missing(self, key: str) -> None:
        """Record that a key is missing."""
        where = f"{self.node.path}.{key}" if self.node.path else key
        remedy = f"add {key}: {self.ctx.example(self.rows[key].suggestion)}"
        self.ctx.errors.at(self.node, "is missing", remedy, key=where)

    def __getitem__(self, key: str) -> Node | None:
        return self.values.get(key)

    def quantity(self, key: str, default: float = math.nan, dimension: Dimension | None = None) -> float:
        """A number, the same everywhere in the body.

        dimension: where another key decides about it
        """
        node, row = self[key], self.rows[key]
        return self.ctx.quantity(node, dimension or row.dimension, row.sign) if node else default

    def field(self, key: str, default: Scalar = 0.0) -> Scalar:
        """A number or an expression in x and y."""
        node = self[key]
        return self.ctx.scalar(node, self.rows[key].dimension, varies=True) if node else default

    def vector(self, key: str) -> tuple[Scalar, Scalar]:
        """Two components, each a number or an expression; zero if the key is not given."""
        node = self[key]
        return self.ctx.vector(node, self.rows[key].dimension) if node else (0.0, 0.0)

    def point(self, key: str, default: Point = (math.nan, math.nan)) -> Point:
        """A point [x, y]."""
        node = self[key]
        return self.ctx.point(node) if node else default

    def choice(self, key: str, default: Any = None) -> Any:
        """One of the words of the key, by default its own default."""
        node, row = self[key], self.rows[key]
        return self.ctx.choice(node, row.words) if node else (row.default if default is None else default)

    def integer(self, key: str, default: int | None = None, most: int | None = None) -> Any:
        """A whole number within its bounds, of which the upper one may depend on others."""
        node, row = self[key], self.rows[key]
        bounds = int(row.least or 0), (int(row.most) if row.most else None) if most is None else most
        return self.ctx.integer(node, *bounds) if node else default

    def flag(self, key: str) -> bool:
        """true or false, by default its own default."""
        node = self[key]
        return self.ctx.flag(node) if node else bool(self.rows[key].default)

    def text(self, key: str, content: str = "a text") -> str | None:
        """A text, None if the key is not given."""
        node = self[key]
        return self.ctx.text(node, content) if node else None


def _meant(key: str, free: list[str], known: list[str]) -> str | None:
    """The key that a misspelt one stands for: one that is not given yet, unless another is more like it."""
    best, unused = nearest(key, known), nearest(key, free)
    if best is None or unused is None:
        return unused or best
    likeness = [difflib.SequenceMatcher(None, key, word).ratio() for word in (best, unused)]
    return best if likeness[0] > likeness[1] else unused
