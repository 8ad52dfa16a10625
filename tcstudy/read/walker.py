"""Typed reading of marked nodes: numbers, quantities, expressions, points, words.

A reader returns the value, or after recording a fault a neutral stand-in (NaN, the first choice, an empty tuple), so
that one pass finds all faults. Comparisons with NaN are false, which keeps a fault from causing further ones; whoever
builds a record asks the collector afterwards whether anything was wrong.
"""

from __future__ import annotations

import difflib
import math
import re
from collections.abc import Iterable
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Literal, TypeVar

from tcstudy.expressions import expression as expressions
from tcstudy.read.node import Collector, Node
from tcstudy.scene.records import Point
from tcstudy.scene.records import Scalar as Field
from tcstudy.scene.units import LENGTH, NUMBER, Dimension, UnitError, split_quantity, to_si

T = TypeVar("T", bound=str)
Sign = Literal["any", "positive", "not negative"]


@dataclass
class Context:
    """What every reader needs: where faults go, whether texts with units are allowed, the study's folder."""

    errors: Collector
    units: Literal["SI", "none"] = "SI"
    folder: Path = Path()

    def example(self, text: str) -> str:
        """An example for a remedy, without units in a dimensionless study."""
        return text if self.units == "SI" else re.sub(rf"({NUMBER}) [^,\]}}]+", r"\1", text)


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


def scalar(ctx: Context, node: Node, dimension: Dimension, *, varies: bool) -> Field:
    """A number in SI, or where it may vary in space an expression; NaN after a fault."""
    value = node.value
    if isinstance(value, str):
        return _from_text(ctx, node, value, dimension, varies)
    if isinstance(value, bool) or not isinstance(value, int | float):
        ctx.errors.at(node, f"must be {dimension.name}, but is {node.kind()}", _example(ctx, dimension, varies))
        return math.nan
    return _finite(ctx, node, value)


def _finite(ctx: Context, node: Node, value: float) -> float:
    try:
        number = float(value)
    except OverflowError:
        number = math.inf
    if not math.isfinite(number):
        ctx.errors.at(node, f"{node.brief()} is not a finite number", "write a finite number")
        return math.nan
    return number


def _example(ctx: Context, dimension: Dimension, varies: bool) -> str:
    return f"write for example {ctx.example(dimension.example)}" + (
        " or an expression such as 2*sin(pi*x)" if varies else ""
    )


@lru_cache(maxsize=4096)
def _expression(text: str) -> expressions.Expression:
    return expressions.parse(text)


def _from_text(ctx: Context, node: Node, text: str, dimension: Dimension, varies: bool) -> Field:
    """The value of a text: number and unit, or an expression."""
    parts = split_quantity(text)
    if parts and ctx.units == "none":
        remedy = "write the plain number, or drop `units: none`"
        ctx.errors.at(node, f"{node.brief()!r} has a unit, but the study says units: none", remedy)
        return math.nan
    if parts:
        try:
            return to_si(*parts, dimension)
        except UnitError as error:
            ctx.errors.at(node, str(error), error.remedy)
            return math.nan
    if comma := re.match(r"\s*[-+]?\d+,\d", text):
        remedy = f"write a decimal point: {text.replace(',', '.', 1).strip()}"
        ctx.errors.at(node, f"{comma[0].strip()!r} has a decimal comma", remedy)
        return math.nan
    try:
        expression = _expression(text)
    except expressions.ExpressionError as error:
        what, _, remedy = str(error).partition("; ")
        if not varies or not remedy:
            what = f"{node.brief()!r} is not {dimension.name}" if not varies else what
            remedy = _example(ctx, dimension, varies)
        ctx.errors.at(node, what, remedy)
        return math.nan
    if expression.constant is not None:
        return _finite(ctx, node, expression.constant)
    if not varies:
        ctx.errors.at(node, "may not vary with x and y", _example(ctx, dimension, varies))
        return math.nan
    return expression


def quantity(ctx: Context, node: Node, dimension: Dimension, sign: Sign = "any") -> float:
    """A number in SI that is the same everywhere; NaN after a fault."""
    value = scalar(ctx, node, dimension, varies=False)
    assert isinstance(value, float)
    if (sign == "positive" and value <= 0.0) or (sign == "not negative" and value < 0.0):
        bound = "greater than 0" if sign == "positive" else "0 or more"
        ctx.errors.at(node, f"must be {bound}, but is {node.brief()}", _example(ctx, dimension, False))
        return math.nan
    return value


def items(ctx: Context, node: Node, content: str, least: int = 0) -> tuple[Node, ...]:
    """The entries of a list; empty after a fault."""
    if not isinstance(node.value, tuple) or len(node.value) < least:
        ctx.errors.at(node, f"must be {content}, but is {node.kind()}", f"write {content}: [..., ...]")
        return ()
    return node.value


def pair(ctx: Context, node: Node, content: str, example: str) -> tuple[Node, Node] | None:
    """The two entries of a list of two; None after a fault."""
    if isinstance(node.value, tuple) and len(node.value) == 2:
        return node.value[0], node.value[1]
    hint = ""
    if isinstance(node.value, tuple) and len(node.value) in (3, 4):
        hint = " (decimals have a point, a comma separates entries)"
    ctx.errors.at(node, f"must be {content}, but is {node.kind()}", f"write for example {ctx.example(example)}{hint}")
    return None


def vector(ctx: Context, node: Node, dimension: Dimension) -> tuple[Field, Field]:
    """Two components, each a number or an expression."""
    both = pair(ctx, node, "a pair of components", f"[0, {dimension.example}]")
    if both is None:
        return math.nan, math.nan
    return scalar(ctx, both[0], dimension, varies=True), scalar(ctx, both[1], dimension, varies=True)


def point(ctx: Context, node: Node) -> Point:
    """A point [x, y] in metres."""
    both = pair(ctx, node, "a point [x, y]", "[0 mm, 20 mm]")
    if both is None:
        return math.nan, math.nan
    return quantity(ctx, both[0], LENGTH), quantity(ctx, both[1], LENGTH)


MOST = 2**31 - 1
"""Largest whole number that any key takes."""


def integer(ctx: Context, node: Node, least: int, most: int = MOST) -> int:
    """A whole number within limits; the lower limit after a fault."""
    value = node.value
    if isinstance(value, float) and value.is_integer():
        value = int(value)
    if isinstance(value, bool) or not isinstance(value, int):
        ctx.errors.at(node, f"must be a whole number, but is {node.kind()}", f"write for example {least}")
        return least
    if not least <= value <= most:
        limits = f"from {least} to {most}" if most < MOST else f"{least} or more"
        ctx.errors.at(node, f"must be {limits}, but is {node.brief()}", f"write for example {least}")
        return least
    return value


def flag(ctx: Context, node: Node) -> bool:
    """true or false; false after a fault."""
    if not isinstance(node.value, bool):
        ctx.errors.at(node, f"must be true or false, but is {node.kind()}", "write true or false, without quotes")
        return False
    return node.value


def text(ctx: Context, node: Node, content: str = "a text") -> str:
    """A text that is not empty; empty after a fault."""
    if not isinstance(node.value, str) or not node.value.strip():
        ctx.errors.at(
            node, f"must be {content}, but is {node.kind()}", "write a text, in quotes if it looks like a number"
        )
        return ""
    return node.value


def choice(ctx: Context, node: Node, words: tuple[T, ...]) -> T:
    """One of some words; the first after a fault."""
    for word in words:
        if node.value == word:
            return word
    what = f"must be one of {', '.join(words)}, but is {node.kind()}"
    near = nearest(str(node.value), words)
    ctx.errors.at(node, what, f"did you mean {near!r}?" if near else f"write for example {words[0]}")
    return words[0]


def name(ctx: Context, node: Node, content: str = "a name") -> str:
    """A name of an edge or a region: letters, digits and underscores; empty after a fault."""
    value = node.value
    if not isinstance(value, str) or not value.isascii() or not value.replace("_", "a").isalnum():
        remedy = "use letters, digits and _"
        ctx.errors.at(node, f"must be {content} of letters, digits and _, but is {node.kind()}", remedy)
        return ""
    return value
