"""The tree of an expression in x and y: its nodes, its value in any arithmetic, its text.

A tree may share nodes (derivatives do): every node is visited once, so the cost is the number of different nodes, not
the length of the expression written out. Nothing here recurses, so that depth does not matter.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from functools import reduce
from typing import Any

import numpy as np

MAX_INTEGER_POWER = 64


@dataclass(frozen=True, eq=False)
class Number:
    """A constant."""

    value: float


@dataclass(frozen=True, eq=False)
class Coordinate:
    """x or y."""

    name: str


@dataclass(frozen=True, eq=False)
class Negative:
    """−operand."""

    operand: TreeNode


@dataclass(frozen=True, eq=False)
class Binary:
    """left operator right, the operator one of + - * / **."""

    operator: str
    left: TreeNode
    right: TreeNode


@dataclass(frozen=True, eq=False)
class Call:
    """function(arguments)."""

    function: str
    arguments: tuple[TreeNode, ...]


TreeNode = Number | Coordinate | Negative | Binary | Call
Order = tuple[TreeNode, ...]
"""The nodes of a tree, each once, every node after its children; the root is the last."""


def children(node: TreeNode) -> tuple[TreeNode, ...]:
    """The nodes that a node is made of."""
    if isinstance(node, Negative):
        return (node.operand,)
    if isinstance(node, Binary):
        return (node.left, node.right)
    return node.arguments if isinstance(node, Call) else ()


def made_of(node: TreeNode, parts: tuple[TreeNode, ...]) -> TreeNode:
    """A node like this one, of other children; one without any is itself."""
    if isinstance(node, Negative):
        return Negative(parts[0])
    if isinstance(node, Binary):
        return Binary(node.operator, *parts)
    return Call(node.function, parts) if isinstance(node, Call) else node


def ordered(roots: Iterable[TreeNode]) -> Order:
    """The nodes of one or more trees, each once, every node after its children."""
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
            stack.extend((child, False) for child in reversed(children(node)))
    return tuple(done)


def variables(order: Order) -> dict[TreeNode, frozenset[str]]:
    """The variables that occur below each node."""
    found: dict[TreeNode, frozenset[str]] = {}
    for node in order:
        own = frozenset((node.name,)) if isinstance(node, Coordinate) else frozenset[str]()
        found[node] = own.union(*(found[child] for child in children(node)))
    return found


def constant(order: Order, functions: Mapping[str, Callable[..., Any]]) -> float:
    """Value of a tree without variables, in floats: no power of integers that would never end."""
    values: dict[TreeNode, Any] = {}
    with np.errstate(all="ignore"):
        for node in order:
            values[node] = np.float64(apply(node, [values[child] for child in children(node)], functions))
    return float(values[order[-1]])


def fold(
    order: Order,
    known: Mapping[TreeNode, frozenset[str]],
    given: Mapping[str, Any],
    functions: Mapping[str, Callable[..., Any]],
    constants: Mapping[str, Callable[..., Any]],
) -> Any:
    """The tree in another arithmetic: operators on the `given` variables, functions by name.

    known:     the variables below each node
    constants: the functions for parts without variables, which arrive as floats
    """
    values: dict[TreeNode, Any] = {}
    for node in order:
        if isinstance(node, Coordinate):
            values[node] = given[node.name]
        elif known[node]:
            values[node] = apply(node, [values[child] for child in children(node)], functions)
        else:
            with np.errstate(all="ignore"):
                parts = [np.float64(values[child]) for child in children(node)]
                values[node] = float(apply(node, parts, constants))
    return values[order[-1]]


def apply(node: TreeNode, values: list[Any], functions: Mapping[str, Callable[..., Any]]) -> Any:
    """One node applied to the values of its children."""
    if isinstance(node, Number):
        return np.float64(node.value)
    if isinstance(node, Negative):
        return -values[0]
    if isinstance(node, Call):
        if node.function in ("min", "max"):
            return reduce(functions[node.function], sorted(values, key=lambda value: type(value) is float))
        return functions[node.function](*values)
    assert isinstance(node, Binary)
    left, right = values
    match node.operator:
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

_PRIORITY = {"+": 1, "-": 1, "*": 2, "/": 2, "**": 4}
_ATOM, _SIGN = 5, 3


def to_text(order: Order, longest: int) -> str:
    """The tree as text that `parse` reads back, or if that has more than `longest` characters its beginning and a hash.

    Trees of one text are one function: the hash is that of all nodes.
    """
    size: dict[TreeNode, int] = {}
    for node in order:  # an upper bound, parentheses and blanks included
        own = len(_leaf(node)) + 5 if not children(node) else 4 + len(getattr(node, "function", "")) + 3
        size[node] = own + sum(size[child] + 4 for child in children(node))
    if size[order[-1]] <= 2 * longest:
        text = _written(order)
        if len(text) <= longest:
            return text
    short = order if size[order[-1]] <= 100 * longest else ()
    begin = _written(short)[:60] + " … " if short else ""
    return f"{begin}[{len(order)} operations, {_digest(order)}]"


def _leaf(node: TreeNode) -> str:
    if isinstance(node, Number):
        return repr(float(node.value))
    return node.name if isinstance(node, Coordinate) else ""


def _written(order: Order) -> str:
    """The text, with parentheses only where the grammar needs them."""
    done: dict[TreeNode, tuple[str, int]] = {}

    def inner(node: TreeNode, least: int) -> str:
        text, priority = done[node]
        return text if priority >= least else f"({text})"

    for node in order:
        if isinstance(node, Number):
            done[node] = _leaf(node), _ATOM if node.value >= 0 and not _leaf(node).startswith("-") else 0
        elif isinstance(node, Coordinate):
            done[node] = node.name, _ATOM
        elif isinstance(node, Negative):
            done[node] = f"-{inner(node.operand, _SIGN + 1)}", 1
        elif isinstance(node, Call):
            done[node] = f"{node.function}({', '.join(done[a][0] for a in node.arguments)})", _ATOM
        else:
            rank = _PRIORITY[node.operator]
            left = inner(node.left, rank + (node.operator == "**"))
            right = inner(node.right, rank + 1)
            sign = f" {node.operator} " if rank == 1 else "^" if rank == _PRIORITY["**"] else node.operator
            done[node] = f"{left}{sign}{right}", rank
    return done[order[-1]][0]


def _digest(order: Order) -> str:
    place = {node: i for i, node in enumerate(order)}
    text = "\n".join(
        f"{getattr(node, 'operator', getattr(node, 'function', _leaf(node)))}{type(node).__name__}"
        f"{[place[child] for child in children(node)]}"
        for node in order
    )
    return hashlib.sha256(text.encode()).hexdigest()[:16]


def pack(order: Order) -> tuple[tuple[TreeNode, tuple[int, ...]], ...]:
    """A tree as (node without its children, places of the children), for pickling without recursion."""
    place, bare = {node: i for i, node in enumerate(order)}, Number(0.0)
    packed = []
    for node in order:
        parts = children(node)
        packed.append((made_of(node, (bare,) * len(parts)), tuple(place[part] for part in parts)))
    return tuple(packed)


def unpack(packed: tuple[tuple[TreeNode, tuple[int, ...]], ...]) -> TreeNode:
    """The root of a packed tree."""
    nodes: list[TreeNode] = []
    for node, places in packed:
        nodes.append(made_of(node, tuple(nodes[place] for place in places)))
    return nodes[-1]
