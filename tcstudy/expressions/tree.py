"""The tree of an expression in x and y: its nodes, its value in any arithmetic, its text.

A tree may share nodes (derivatives do, see `algebra`): every node is visited once, so the cost is the number of
different nodes, not the length of the expression written out. Nothing here recurses, so that depth does not matter.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, replace
from functools import reduce
from typing import Any, Literal

import numpy as np

MAX_INTEGER_POWER = 64


@dataclass(frozen=True, eq=False)
class TreeNode:
    """A part of an expression.

    kind:  "Number", "Coordinate", "Negative" (−part), "Binary" (left operator right) or "Call" (function(parts))
    name:  of the coordinate, the operator (one of + - * / **) or the function
    parts: the nodes that it is made of;  value: of a number
    """

    kind: Literal["Number", "Coordinate", "Negative", "Binary", "Call"]
    name: str = ""
    parts: tuple[TreeNode, ...] = ()
    value: float = 0.0

    @property
    def label(self) -> str:
        """The name, or the number as text."""
        return repr(float(self.value)) if self.kind == "Number" else self.name


Order = tuple[TreeNode, ...]
"""The nodes of a tree, each once, every node after its parts; the root is the last."""


def ordered(roots: Iterable[TreeNode]) -> Order:
    """The nodes of one or more trees, each once, every node after its parts."""
    done: dict[TreeNode, None] = {}
    stack = [(root, False) for root in reversed(list(roots))]
    while stack:
        node, ready = stack.pop()
        if node in done:
            continue
        if ready:
            done[node] = None
        else:
            stack.append((node, True))
            stack.extend((child, False) for child in reversed(node.parts))
    return tuple(done)


def variables(order: Order) -> dict[TreeNode, frozenset[str]]:
    """The variables that occur below each node."""
    found: dict[TreeNode, frozenset[str]] = {}
    for node in order:
        own = frozenset((node.name,)) if node.kind == "Coordinate" else frozenset[str]()
        found[node] = own.union(*(found[part] for part in node.parts))
    return found


def fold(
    order: Order,
    known: Mapping[TreeNode, frozenset[str]],
    given: Mapping[str, Any],
    functions: Mapping[str, Callable[..., Any]],
    constants: Mapping[str, Callable[..., Any]],
) -> Any:
    """The tree in another arithmetic: operators on the `given` variables, functions by name.

    known:     the variables below each node
    constants: the functions for parts without variables, which are floats: no power of integers would ever end
    """
    values: dict[TreeNode, Any] = {}
    for node in order:
        if node.kind == "Coordinate":
            values[node] = given[node.name]
        elif known[node]:
            values[node] = applied(node, [values[part] for part in node.parts], functions)
        else:
            with np.errstate(all="ignore"):
                values[node] = float(applied(node, [np.float64(values[part]) for part in node.parts], constants))
    return values[order[-1]]


def applied(node: TreeNode, values: list[Any], functions: Mapping[str, Callable[..., Any]]) -> Any:
    """One node applied to the values of its parts."""
    match node.kind, node.name:
        case "Number", _:
            return np.float64(node.value)
        case "Negative", _:
            return -values[0]
        case "Call", "min" | "max":
            return reduce(functions[node.name], sorted(values, key=lambda value: type(value) is float))
        case "Call", _:
            return functions[node.name](*values)
    left, right = values
    match node.name:
        case "+":
            return left + right
        case "-":
            return left - right
        case "*":
            return left * right
        case "/":
            return left / right
    whole = type(right) is float and right.is_integer() and abs(right) <= MAX_INTEGER_POWER
    return left ** (int(right) if whole else right)


# -- text -------------------------------------------------------------------------------------------

PRIORITY = {"+": 1, "-": 1, "*": 2, "/": 2, "**": 4}
ATOM, SIGN = 5, 3


def to_text(order: Order, longest: int) -> str:
    """The tree as text that `parse` reads back, with parentheses only where the grammar needs them. What has more than
    `longest` characters ends in a hash of all nodes, so that trees of one text are one function."""
    done: dict[TreeNode, tuple[str, int]] = {}

    def inner(node: TreeNode, least: int) -> str:
        text, priority = done[node]
        return text if priority >= least else f"({text})"

    for node in order:
        if node.kind == "Number":
            text, rank = node.label, ATOM if node.value >= 0 and not node.label.startswith("-") else 0
        elif node.kind == "Coordinate":
            text, rank = node.name, ATOM
        elif node.kind == "Negative":
            text, rank = f"-{inner(node.parts[0], SIGN + 1)}", 1
        elif node.kind == "Call":
            text, rank = f"{node.name}({', '.join(done[part][0] for part in node.parts)})", ATOM
        else:
            rank = PRIORITY[node.name]
            left = inner(node.parts[0], rank + (node.name == "**"))
            right = inner(node.parts[1], rank + 1)
            sign = f" {node.name} " if rank == 1 else "^" if rank == PRIORITY["**"] else node.name
            text = f"{left}{sign}{right}"
        if len(text) > longest:  # before the texts of shared parts grow without bound
            return f"{text[:60]} … [{len(order)} operations, {_digest(order)}]"
        done[node] = text, rank
    return done[order[-1]][0]


def _digest(order: Order) -> str:
    place = {node: i for i, node in enumerate(order)}
    text = "\n".join(f"{node.label}{node.kind}{[place[part] for part in node.parts]}" for node in order)
    return hashlib.sha256(text.encode()).hexdigest()[:16]


Packed = tuple[tuple[TreeNode, tuple[int, ...]], ...]


def pack(order: Order) -> Packed:
    """A tree as (node without its parts, places of the parts), for pickling without recursion."""
    place = {node: i for i, node in enumerate(order)}
    return tuple((replace(node, parts=()), tuple(place[part] for part in node.parts)) for node in order)


def unpack(packed: Packed) -> TreeNode:
    """The root of a packed tree."""
    nodes: list[TreeNode] = []
    for node, places in packed:
        nodes.append(replace(node, parts=tuple(nodes[place] for place in places)))
    return nodes[-1]
