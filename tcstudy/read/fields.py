"""Mappings with known keys: what is unknown or missing is recorded, what is there is read by its type."""

from __future__ import annotations

import difflib
import math
from collections.abc import Iterable, Mapping
from typing import Any

from tcstudy.read import walker
from tcstudy.read.node import Node
from tcstudy.read.walker import Context
from tcstudy.scene import keys
from tcstudy.scene.records import Point, Scalar
from tcstudy.scene.units import Dimension


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
        return walker.quantity(self.ctx, node, dimension or row.dimension, row.sign) if node else default

    def field(self, key: str, default: Scalar = 0.0) -> Scalar:
        """A number or an expression in x and y."""
        node = self[key]
        return walker.scalar(self.ctx, node, self.rows[key].dimension, varies=True) if node else default

    def vector(self, key: str) -> tuple[Scalar, Scalar]:
        """Two components, each a number or an expression; zero if the key is not given."""
        node = self[key]
        return walker.vector(self.ctx, node, self.rows[key].dimension) if node else (0.0, 0.0)

    def point(self, key: str, default: Point = (math.nan, math.nan)) -> Point:
        """A point [x, y]."""
        node = self[key]
        return walker.point(self.ctx, node) if node else default

    def choice(self, key: str, default: Any = None) -> Any:
        """One of the words of the key, by default its own default."""
        node, row = self[key], self.rows[key]
        return walker.choice(self.ctx, node, row.words) if node else (row.default if default is None else default)

    def integer(self, key: str, default: int | None = None, most: int | None = None) -> Any:
        """A whole number within its bounds, of which the upper one may depend on others."""
        node, row = self[key], self.rows[key]
        bounds = int(row.least or 0), int(row.most or walker.MOST) if most is None else most
        return walker.integer(self.ctx, node, *bounds) if node else default

    def flag(self, key: str) -> bool:
        """true or false, by default its own default."""
        node = self[key]
        return walker.flag(self.ctx, node) if node else bool(self.rows[key].default)

    def text(self, key: str, content: str = "a text") -> str | None:
        """A text, None if the key is not given."""
        node = self[key]
        return walker.text(self.ctx, node, content) if node else None


def _meant(key: str, free: list[str], known: list[str]) -> str | None:
    """The key that a misspelt one stands for: one that is not given yet, unless another is more like it."""
    best, unused = walker.nearest(key, known), walker.nearest(key, free)
    if best is None or unused is None:
        return unused or best
    likeness = [difflib.SequenceMatcher(None, key, word).ratio() for word in (best, unused)]
    return best if likeness[0] > likeness[1] else unused
