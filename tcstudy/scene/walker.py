"""Typed reading of marked nodes: mappings with known keys, numbers, quantities, expressions, points, words.

A reader returns the value, or after recording a fault a neutral stand-in (NaN, the first choice, an empty tuple), so
that one pass finds all faults. Comparisons with NaN are false, which keeps a fault from causing further ones; whoever
builds a record asks the collector afterwards whether anything was wrong.
"""

from __future__ import annotations

import difflib
import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Literal, TypeVar

from tcstudy.scene import expressions
from tcstudy.scene.node import Collector, Node
from tcstudy.scene.records import Point
from tcstudy.scene.records import Scalar as Field
from tcstudy.scene.units import LENGTH, Dimension, UnitError, split_quantity, to_si

T = TypeVar("T", bound=str)
Sign = Literal["any", "positive", "not negative"]

EXAMPLES = {
    "body": "{rectangle: {width: 200 mm, height: 100 mm}}",
    "boundary": "{bottom: contact, left: clamped, top: free, right: free}",
    "material": "{E: 210 GPa, nu: 0.3}",
    "friction": "{law: tresca, tau: 20 MPa}",
    "mesh": "{maxh: 10 mm}",
    "maxh": "10 mm",
    "E": "210 GPa",
    "nu": "0.3",
    "lambda": "121 GPa",
    "mu": "81 GPa",
    "from": "[0 mm, 0 mm]",
    "edge": "NAME",
    "center": "[0 mm, 0 mm]",
    "corner": "[0 mm, 0 mm]",
    "radius": "10 mm",
    "width": "50 mm",
    "height": "20 mm",
    "alpha": "100 W/(m^2*K)",
    "theta_bar": "20 K",
    "f": "[0, -77 kN/m^3]",
    "path": "part.step",
    "edges": "{NAME: [[0, 0]]}",
    "law": "tresca",
    "role": "clamped",
    "name": "separable-newton",
    "points": "[...]",
}
"""What a missing key might look like."""


@dataclass
class Context:
    """What every reader needs: where faults go, whether texts with units are allowed, the study's folder."""

    errors: Collector
    units: Literal["SI", "none"] = "SI"
    folder: Path = Path()


def nearest(word: str, known: Iterable[str]) -> str | None:
    """The known word most like the given one, if any is."""
    known = list(known)
    lowered = {name.lower(): name for name in known}
    if word.lower() in lowered:
        return lowered[word.lower()]
    near = difflib.get_close_matches(word, known, n=1, cutoff=0.55)
    return near[0] if near else None


def choose(word: str, known: Iterable[str], noun: str = "one of") -> str:
    """Remedy for a word that is not known: the nearest one, or all."""
    known = list(known)
    near = nearest(word, known)
    return f"did you mean {near!r}?" if near else f"use {noun} {', '.join(known)}"


def kind(node: Node) -> str:
    """What the node holds, in words."""
    if isinstance(node.value, Mapping):
        return "a mapping"
    if isinstance(node.value, tuple):
        return f"a list of {len(node.value)}"
    if isinstance(node.value, bool):
        return f"the truth value {node.text()}"
    if node.value is None:
        return "empty"
    return f"the text {node.brief()!r}" if isinstance(node.value, str) else f"the number {node.value:.15g}"


class Fields:
    """The values of a mapping whose keys are known; unknown and missing keys are recorded on the way in."""

    def __init__(self, ctx: Context, node: Node, required: Iterable[str] = (), optional: Iterable[str] = ()) -> None:
        self.ctx, self.node = ctx, node
        required, known = list(required), [*required, *optional]
        self.values: Mapping[str, Node] = {}
        if not isinstance(node.value, Mapping):
            example = f"for example {{{required[0]}: {EXAMPLES.get(required[0], '...')}}}" if required else "key: value"
            remedy = f"write a mapping with the keys {', '.join(known)}, {example}"
            ctx.errors.at(node, f"must be a mapping, but is {kind(node)}", remedy)
            self.is_mapping = False
            return
        self.is_mapping = True
        self.values = node.value
        wrong = [key for key in node.value if key not in known]
        free = [name for name in known if name not in node.value]
        near = {key: nearest(key, free) or nearest(key, known) for key in wrong}
        for key in wrong:
            remedy = f"did you mean {near[key]!r}?" if near[key] else f"use one of the keys {', '.join(free or known)}"
            ctx.errors.at(node.value[key], "unknown key", remedy, on_key=True)
        guessed = set(near.values())
        for key in required:
            # A misspelt key is one fault, not an unknown and a missing one.
            if key not in node.value and key not in guessed:
                self.missing(key)

    def missing(self, key: str) -> None:
        """Record that a key is missing."""
        where = f"{self.node.path}.{key}" if self.node.path else key
        self.ctx.errors.at(self.node, "is missing", f"add {key}: {EXAMPLES.get(key, '...')}", key=where)

    def __getitem__(self, key: str) -> Node | None:
        return self.values.get(key)

    def quantity(self, key: str, dimension: Dimension, sign: Sign = "any", default: float = math.nan) -> float:
        """A number with the dimension, the same everywhere in the body."""
        node = self[key]
        return quantity(self.ctx, node, dimension, sign) if node else default

    def field(self, key: str, dimension: Dimension, default: Field = 0.0) -> Field:
        """A number or an expression in x and y."""
        node = self[key]
        return scalar(self.ctx, node, dimension, varies=True) if node else default

    def vector(self, key: str, dimension: Dimension) -> tuple[Field, Field]:
        """Two components, each a number or an expression; zero if the key is not given."""
        node = self[key]
        return vector(self.ctx, node, dimension) if node else (0.0, 0.0)

    def point(self, key: str, default: Point = (math.nan, math.nan)) -> Point:
        """A point [x, y]."""
        node = self[key]
        return point(self.ctx, node) if node else default


def scalar(ctx: Context, node: Node, dimension: Dimension, *, varies: bool) -> Field:
    """A number in SI, or where it may vary in space an expression; NaN after a fault."""
    value = node.value
    if isinstance(value, str):
        return _from_text(ctx, node, value, dimension, varies)
    if isinstance(value, bool) or not isinstance(value, int | float):
        ctx.errors.at(node, f"must be {dimension.name}, but is {kind(node)}", _example(ctx, dimension, varies))
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
    example = dimension.example if ctx.units == "SI" else "1.5"
    return f"write for example {example}" + (" or an expression such as 2*sin(pi*x)" if varies else "")


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
        ctx.errors.at(node, f"must be {content}, but is {kind(node)}", f"write {content}: [..., ...]")
        return ()
    return node.value


def pair(ctx: Context, node: Node, content: str, example: str) -> tuple[Node, Node] | None:
    """The two entries of a list of two; None after a fault."""
    if isinstance(node.value, tuple) and len(node.value) == 2:
        return node.value[0], node.value[1]
    hint = ""
    if isinstance(node.value, tuple) and len(node.value) in (3, 4):
        hint = "; write decimals with a point, a comma separates entries"
    ctx.errors.at(node, f"must be {content}, but is {kind(node)}", f"write for example {example}{hint}")
    return None


def vector(ctx: Context, node: Node, dimension: Dimension) -> tuple[Field, Field]:
    """Two components, each a number or an expression."""
    both = pair(ctx, node, "a pair of components", f"[0, {dimension.example if ctx.units == 'SI' else '1.5'}]")
    if both is None:
        return math.nan, math.nan
    return scalar(ctx, both[0], dimension, varies=True), scalar(ctx, both[1], dimension, varies=True)


def point(ctx: Context, node: Node) -> Point:
    """A point [x, y] in metres."""
    both = pair(ctx, node, "a point [x, y]", "[0 mm, 20 mm]" if ctx.units == "SI" else "[0, 1.5]")
    if both is None:
        return math.nan, math.nan
    return quantity(ctx, both[0], LENGTH), quantity(ctx, both[1], LENGTH)


def integer(ctx: Context, node: Node, least: int, most: int = 2**31 - 1) -> int:
    """A whole number within limits; the lower limit after a fault."""
    value = node.value
    if isinstance(value, float) and value.is_integer():
        value = int(value)
    if isinstance(value, bool) or not isinstance(value, int):
        ctx.errors.at(node, f"must be a whole number, but is {kind(node)}", f"write for example {least}")
        return least
    if not least <= value <= most:
        limits = f"from {least} to {most}" if most < 2**31 - 1 else f"{least} or more"
        ctx.errors.at(node, f"must be {limits}, but is {node.brief()}", f"write for example {least}")
        return least
    return value


def flag(ctx: Context, node: Node) -> bool:
    """true or false; false after a fault."""
    if not isinstance(node.value, bool):
        ctx.errors.at(node, f"must be true or false, but is {kind(node)}", "write true or false, without quotes")
        return False
    return node.value


def text(ctx: Context, node: Node, content: str = "a text") -> str:
    """A text that is not empty; empty after a fault."""
    if not isinstance(node.value, str) or not node.value.strip():
        what = kind(node) if node.value != "" else "empty"
        ctx.errors.at(node, f"must be {content}, but is {what}", "write a text, in quotes if it looks like a number")
        return ""
    return node.value


def choice(ctx: Context, node: Node, words: tuple[T, ...]) -> T:
    """One of some words; the first after a fault."""
    for word in words:
        if node.value == word:
            return word
    what = f"must be one of {', '.join(words)}, but is {kind(node)}"
    ctx.errors.at(node, what, choose(str(node.value), words))
    return words[0]


def name(ctx: Context, node: Node, content: str = "a name") -> str:
    """A name of an edge or a region: letters, digits and underscores; empty after a fault."""
    value = node.value
    if not isinstance(value, str) or not value.isascii() or not value.replace("_", "a").isalnum():
        remedy = "use letters, digits and _, and begin with a letter"
        ctx.errors.at(node, f"must be {content} of letters, digits and _, but is {kind(node)}", remedy)
        return ""
    return value
