"""Mappings with known keys: what is unknown or missing is recorded, what is there is read by its type."""

from __future__ import annotations

import difflib
import math
from collections.abc import Iterable, Mapping

from tcstudy.read import walker
from tcstudy.read.node import Node
from tcstudy.read.walker import Context
from tcstudy.scene.records import Point, Scalar
from tcstudy.scene.units import Dimension

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
    "u": '["0.1*sin(pi*x)", "0"]',
}
"""What a missing key might look like."""


class Fields:
    """The values of a mapping whose keys are known; unknown and missing keys are recorded on the way in."""

    def __init__(self, ctx: Context, node: Node, required: Iterable[str] = (), optional: Iterable[str] = ()) -> None:
        self.ctx, self.node = ctx, node
        required, known = list(required), [*required, *optional]
        self.values: Mapping[str, Node] = {}
        if not isinstance(node.value, Mapping):
            example = (
                f"for example {{{required[0]}: {ctx.example(EXAMPLES.get(required[0], '...'))}}}"
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
        self.ctx.errors.at(
            self.node, "is missing", f"add {key}: {self.ctx.example(EXAMPLES.get(key, '...'))}", key=where
        )

    def __getitem__(self, key: str) -> Node | None:
        return self.values.get(key)

    def quantity(self, key: str, dimension: Dimension, sign: walker.Sign = "any", default: float = math.nan) -> float:
        """A number with the dimension, the same everywhere in the body."""
        node = self[key]
        return walker.quantity(self.ctx, node, dimension, sign) if node else default

    def field(self, key: str, dimension: Dimension, default: Scalar = 0.0) -> Scalar:
        """A number or an expression in x and y."""
        node = self[key]
        return walker.scalar(self.ctx, node, dimension, varies=True) if node else default

    def vector(self, key: str, dimension: Dimension) -> tuple[Scalar, Scalar]:
        """Two components, each a number or an expression; zero if the key is not given."""
        node = self[key]
        return walker.vector(self.ctx, node, dimension) if node else (0.0, 0.0)

    def point(self, key: str, default: Point = (math.nan, math.nan)) -> Point:
        """A point [x, y]."""
        node = self[key]
        return walker.point(self.ctx, node) if node else default


def _meant(key: str, free: list[str], known: list[str]) -> str | None:
    """The key that a misspelt one stands for: one that is not given yet, unless another is more like it."""
    best, unused = walker.nearest(key, known), walker.nearest(key, free)
    if best is None or unused is None:
        return unused or best
    likeness = [difflib.SequenceMatcher(None, key, word).ratio() for word in (best, unused)]
    return best if likeness[0] > likeness[1] else unused
