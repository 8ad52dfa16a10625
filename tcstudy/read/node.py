"""The study as a tree of marked nodes: every value knows its key path and its place in the file."""

from __future__ import annotations

import difflib
import json
import re
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from typing import TypeAlias

from tcstudy.errors import Problem, shortened
from tcstudy.scene.keys import of_role, rows, short_of

Scalar: TypeAlias = "bool | int | float | str | None"
Keys: TypeAlias = "tuple[str | int, ...]"

COMPONENTS = tuple(name for name in of_role("clamped") if name != "heat")
"""Keys that give the displacement of a clamped edge."""


@dataclass(frozen=True, slots=True)
class Mark:
    """A place: file, line and column from 1 (0, 0 in a command-line option)."""

    file: str = ""
    line: int = 0
    column: int = 0


@dataclass(frozen=True, slots=True, eq=False)
class Node:
    """One value of the study.

    value: a scalar, a mapping of nodes or a sequence of nodes
    path:  key path where the user wrote the value, e.g. "sweep.alpha[1]"
    mark:  where the value stands;  key_mark: where its key stands (its own place in a list)
    shown_in: of a number that stands nowhere, as in a linspace: the unit for messages and its size
    """

    value: Scalar | Mapping[str, Node] | tuple[Node, ...]
    path: str
    mark: Mark
    key_mark: Mark
    shown_in: tuple[str, float] | None = None

    @classmethod
    def of(cls, plain: object, path: str) -> Node:
        """The node of a value without marks, which stands in no file."""
        if isinstance(plain, list):
            return cls(tuple(cls.of(item, f"{path}[{i}]") for i, item in enumerate(plain)), path, Mark(), Mark())
        made = {key: cls.of(item, f"{path}.{key}") for key, item in plain.items()} if isinstance(plain, dict) else plain
        return cls(made, path, Mark(), Mark())  # type: ignore[arg-type]

    def plain(self) -> object:
        """The value without marks: scalars, dicts and lists."""
        if isinstance(self.value, tuple):
            return [item.plain() for item in self.value]
        if isinstance(self.value, Mapping):
            return {key: item.plain() for key, item in self.value.items()}
        return self.value

    @property
    def children(self) -> Mapping[str, Node]:
        """The entries of a mapping; none of anything else."""
        return self.value if isinstance(self.value, Mapping) else {}

    @property
    def entries(self) -> tuple[Node, ...]:
        """The entries of a list; a value that is none is one."""
        return self.value if isinstance(self.value, tuple) else (self,)

    def all(self) -> Iterator[Node]:
        """The node and all below it."""
        yield self
        for inner in self.value if isinstance(self.value, tuple) else self.children.values():
            yield from inner.all()

    def at(self, *keys: str | int) -> Node | None:
        """The value at a path, None if there is none."""
        node = self
        for key in keys:
            here = node.value
            if isinstance(here, Mapping) and key in here:
                node = here[key]  # type: ignore[index]
            elif isinstance(here, tuple) and isinstance(key, int) and key < len(here):
                node = here[key]
            else:
                return None
        return node

    def nearest(self, *keys: str | int) -> Node:
        """The value at a path, or the last one that exists on the way."""
        return next(node for n in range(len(keys), -1, -1) if (node := self.at(*keys[:n])) is not None)

    def text(self) -> str:
        """The value as one line of YAML-like text, for messages and labels."""
        plain = self.plain()
        json_like = isinstance(plain, bool | list | dict | None)
        text = json.dumps(plain, ensure_ascii=False).replace('"', "") if json_like else str(plain)
        return " ".join(text.split())

    def kind(self) -> str:
        """What the node holds, in words."""
        if isinstance(self.value, Mapping):
            return "a mapping"
        if isinstance(self.value, tuple):
            return f"a list of {len(self.value)}" if self.value else "an empty list"
        if isinstance(self.value, bool):
            return f"the truth value {self.text()}"
        if self.value is None or self.value == "":
            return "empty"
        return f"the text {self.brief()!r}" if isinstance(self.value, str) else f"the number {self.brief()}"

    def brief(self) -> str:
        """The text, shortened so that a message stays one readable line; numbers that stand nowhere in six digits."""
        if self.shown_in is not None and isinstance(self.value, float):
            return f"{self.value / self.shown_in[1]:.6g} {self.shown_in[0]}".rstrip()
        return shortened(self.text())


MOST_LINES = 10
"""Lines of a table that are named with faults in one column."""


class Collector:
    """The problems found so far. Faults are collected, never raised one by one; each is said as "what; remedy".

    point: words for the sweep point being read; empty while the base study is read
    drawn: whether the values of sweep points stand nowhere in the file, so that every fault must name the point
    refused: what is wrong with the shape or the element sizes of one geometry of several, which then is left out
    """

    def __init__(self) -> None:
        self.problems: list[Problem] = []
        self.point = ""
        self.drawn = False
        self.refused: list[str] | None = None
        self._count = 0
        self._met: set[object] = set()
        self._unreadable: set[Mark] = set()
        self._lines: Counter[tuple[str, str]] = Counter()

    def __len__(self) -> int:
        """How often a fault was met, repeated ones included: unchanged if what was read in between is sound."""
        return self._count

    def at(self, node: Node, *said: str, key: str | None = None, on_key: bool = False) -> None:
        """Record a fault at a node, or at its key; the same fault in further sweep points is one fault.

        said: what is wrong and what to do, in one text "what; remedy" or several
        """
        self.at_mark(node.key_mark if on_key else node.mark, node.path if key is None else key, *said)

    def unfit(self, node: Node, key: str, *said: str) -> None:
        """Record a shape or an element size that is none: a fault, unless it is that of one geometry of several."""
        if self.refused is None:
            self.at(node, *said, key=key)
        else:
            self._count += 1
            self.refused.append(f"{key}: {'; '.join(said)}")

    def unreadable(self, mark: Mark, key: str, *said: str) -> None:
        """Record that there is no value at a place; whatever its readers say about it is no news."""
        self.at_mark(mark, key, *said)
        self._unreadable.add(mark)

    def at_mark(self, mark: Mark, key: str, *said: str) -> None:
        self._count += 1
        what, remedy = halves(said)
        if mark in self._unreadable or (self.point and not {(mark, key), what}.isdisjoint(self._met)):
            return
        self._met |= {(mark, key), what}
        if self.point and (self.drawn or not key.startswith("sweep")):
            what = f"{what} ({'' if self.drawn else 'with '}{self.point})"
        problem = Problem(mark.file, mark.line, mark.column, key, what, remedy)
        if problem in self._met:
            return
        self._met.add(problem)
        self._lines[mark.file, key] += 1
        if self._lines[mark.file, key] <= MOST_LINES:  # of a column of a table, which has one key
            self.problems.append(problem)


def halves(said: tuple[str, ...]) -> tuple[str, str]:
    """What is wrong and what to do, of a text "what; remedy" or of both."""
    what, *remedy = said if len(said) > 1 else said[0].split("; ", 1)
    return what, "; ".join(remedy)


def is_name(text: str) -> bool:
    """Whether a text may be the name of an edge or a region: letters, digits and underscores."""
    return text.isascii() and text.replace("_", "a").isalnum()


def nearest(word: str, known: Iterable[str]) -> str | None:
    """The known word most like the given one, if any is."""
    lowered = {name.lower(): name for name in known}
    near = difflib.get_close_matches(word.lower(), lowered, n=1, cutoff=0.55)
    return lowered[near[0]] if near else None


def hint(word: str, known: Iterable[str], otherwise: str) -> str:
    """Remedy for a word that is not known: the nearest that is, or something else."""
    near = nearest(word, known)
    return f"did you mean {near!r}?" if near else otherwise


def elsewhere(key: str, path: str) -> str:
    """Where a key belongs that the section at a path does not have: another section of the study, or its top."""
    if "." in path or "[" in path:
        return ""
    homes = [name for name in rows("") if name != path and key in rows(name)]
    top = f"{key} belongs at the top of the study" if path and key in rows("") else ""
    return f"{key} belongs in {' or '.join(homes)}" if homes else top


def split_path(path: str) -> Keys | None:
    """The keys of a path such as "body.outline[2].edge"; None if it is not one."""
    if not re.fullmatch(r"[^.\[\]\s]+(\[\d{1,6}\])*(\.[^.\[\]\s]+(\[\d{1,6}\])*)*", path):
        return None
    tokens = re.findall(r"\[\d+\]|[^.\[\]]+", path)
    return tuple(int(token[1:-1]) if token[0] == "[" else token for token in tokens)


def place_of(root: Node, path: Keys) -> Keys:
    """Where the number of a key path stands in the study: a component in its pair, b or s of a law's point in its list,
    everything else at the path itself."""
    *inner, name = path
    for n, column in (2, 1), (3, 0):
        if len(path) > n and path[-n] == "points" and str(path[1 - n]).isdecimal() and (n == 2 or name == "s"):
            return (*path[: 1 - n], int(path[1 - n]), column)
    stem, _, part = str(name).rpartition("_")
    paired = stem in ("f", "g", "force") or (stem == "u" and root.at(*inner, "u"))
    if paired and part in ("x", "y") and path[0] in ("loads", "boundary"):
        return (*inner, stem, "xy".index(part))
    return path


def put_number(root: Node, path: Keys, new: Node) -> Node:
    """A copy of the tree with a number put where it stands (`place_of`); of a pair that is not given the other is 0.

    Raises KeyError as `put` does.
    """
    keys = place_of(root, path)
    if keys != path and keys[-2] != "points" and root.at(*keys[:-1]) is None:
        root = put(root, keys[:-1], replace(new, value=(replace(new, value=0),) * 2))
    return put(root, keys, new)


def put(root: Node, keys: Keys, new: Node | None, done: Keys = ()) -> Node:
    """A copy of the tree with a value put at a path (None removes the key); shares all that is untouched.

    Missing mappings on the way are made; a word that stands for a mapping is written out first.
    Raises KeyError with a text if a key on the way holds something else.
    """
    if not keys:
        return root if new is None else new
    key, rest = keys[0], keys[1:]
    here = ".".join(map(str, done)) or "the study"
    if isinstance(key, int):
        if not isinstance(root.value, tuple) or key >= len(root.value) or (new is None and not rest):
            raise KeyError(f"{here} has no entry [{key}] to set")
        items = list(root.value)
        items[key] = put(items[key], rest, new, (*done, key))
        return replace(root, value=tuple(items))
    children = _children(root, here, done)
    if new is None and not rest:
        children.pop(key, None)
    elif new is not None or key in children:
        if len(done) == 2 and done[0] == "boundary":
            _hold_other(children, key)
        empty = Node({}, ".".join(map(str, (*done, key))), (new or root).mark, (new or root).key_mark)
        children[key] = put(children.get(key, empty), rest, new, (*done, key))
    return replace(root, value=children)


def _hold_other(children: dict[str, Node], key: str) -> None:
    """A clamped edge without a displacement has u = 0: putting one component must not set the other one free."""
    role = children.get("role")
    frame = next((pair for pair in (("u_x", "u_y"), ("u_N", "u_T")) if key in pair), ())
    if role is not None and role.value == "clamped" and not any(name in COMPONENTS for name in children):
        children.update({name: replace(role, value=0) for name in frame})


def _children(node: Node, here: str, done: Keys) -> dict[str, Node]:
    if isinstance(node.value, Mapping) or node.value is None:
        return dict(node.children)
    word = short_of(str(done[0])) if len(done) == (2 if done[:1] == ("boundary",) else 1) else ""
    if not word or not isinstance(node.value, str):
        raise KeyError(f"{here} is {node.kind()}, not a mapping with keys")
    return {word: node}
