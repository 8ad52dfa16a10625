"""From a YAML 1.2 text to a tree of marked nodes: every value knows its key path and its place in
the file; `--set` options put into it; faults collected; and where in a study's text something
stands that is found later.

Anchors and aliases work; tags, merge keys and keys that are not plain words are refused with a
remedy.
"""

from __future__ import annotations

import json
import re
import sys
import warnings
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, TypeAlias

from ruamel.yaml import YAML
from ruamel.yaml.error import MarkedYAMLError, YAMLError, YAMLWarning
from ruamel.yaml.nodes import MappingNode, ScalarNode, SequenceNode
from ruamel.yaml.nodes import Node as YamlNode

from tcstudy.errors import Problem, StudyError, shortened
from tcstudy.scene.keys import of_role, rows, short_of
from tcstudy.scene.parameters import SHORT
from tcstudy.scene.study import Axis, Study
from tcstudy.scene.units import LONGEST

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


NOWHERE = Mark()


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
    def of(cls, plain: object, path: str, mark: Mark = NOWHERE) -> Node:
        """Return the node of a plain value, all of which has one mark."""
        value: Any = plain
        if isinstance(plain, list):
            value = tuple(cls.of(item, f"{path}[{i}]", mark) for i, item in enumerate(plain))
        elif isinstance(plain, dict):
            value = {key: cls.of(item, f"{path}.{key}", mark) for key, item in plain.items()}
        return cls(value, path, mark, mark)

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
        return next(
            node for n in range(len(keys), -1, -1) if (node := self.at(*keys[:n])) is not None
        )

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
        return (
            f"the text {self.brief()!r}"
            if isinstance(self.value, str)
            else f"the number {self.brief()}"
        )

    def brief(self) -> str:
        """The text, shortened so that a message stays one readable line; numbers that stand nowhere
        in six digits."""
        if self.shown_in is not None and isinstance(self.value, float):
            return f"{self.value / self.shown_in[1]:.6g} {self.shown_in[0]}".rstrip()
        return shortened(self.text())


MOST_LINES = 10
"""Lines of a table that are named with faults in one column."""


class Collector:
    """The problems found so far. Faults are collected, never raised one by one; each is said as
    "what; remedy".

    point: words for the sweep point being read; empty while the base study is read drawn: whether
    the values of sweep points stand nowhere in the file, so that every fault must name the point
    refused: what is wrong with the shape or the element sizes of one geometry of several, which
    then is left out
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
        """How often a fault was met, repeated ones included: unchanged if what was read in between
        is sound."""
        return self._count

    def at(self, node: Node, *said: str, key: str | None = None, on_key: bool = False) -> None:
        """Record a fault at a node, or at its key; the same fault in further sweep points is one
        fault.

        said: what is wrong and what to do, in one text "what; remedy" or several
        """
        self.at_mark(
            node.key_mark if on_key else node.mark, node.path if key is None else key, *said
        )

    def unfit(self, node: Node, key: str, *said: str) -> None:
        """Record a shape or an element size that is none: a fault, unless it is that of one
        geometry of several."""
        if self.refused is None:
            self.at(node, *said, key=key)
        else:
            self._count += 1
            self.refused.append(f"{key}: {'; '.join(said)}")

    def unreadable(self, mark: Mark, key: str, *said: str) -> None:
        """Record that there is no value at a place; whatever its readers say about it is no
        news."""
        self.at_mark(mark, key, *said)
        self._unreadable.add(mark)

    def met_again(self) -> None:
        """Count a fault that is recorded elsewhere, so that what needs its value is left unread."""
        self._count += 1

    def at_mark(self, mark: Mark, key: str, *said: str) -> None:
        self._count += 1
        what, remedy = halves(said)
        same: set[object] = {
            (mark, key),
            (key.rpartition(".")[2].partition("[")[0], what),
        }  # or of another value of it
        if mark in self._unreadable or (self.point and not same.isdisjoint(self._met)):
            return
        self._met |= same
        if self.point and (self.drawn or not key.startswith("sweep")):
            what = f"{what} ({'' if self.drawn else 'with '}{self.point})"
            if self.drawn and remedy.startswith("write"):  # a value, where a distribution stands
                remedy = "give a distribution of values that are possible"
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


def split_path(path: str) -> Keys | None:
    """The keys of a path such as "body.outline[2].edge"; None if it is not one."""
    if not re.fullmatch(r"[^.\[\]\s]+(\[\d{1,6}\])*(\.[^.\[\]\s]+(\[\d{1,6}\])*)*", path):
        return None
    tokens = re.findall(r"\[\d+\]|[^.\[\]]+", path)
    return tuple(int(token[1:-1]) if token[0] == "[" else token for token in tokens)


def place_of(root: Node, path: Keys) -> Keys:
    """Where the number of a key path stands in the study: a component in its pair, b or s of a
    law's point in its list, everything else at the path itself."""
    *inner, name = path
    for n, column in (2, 1), (3, 0):
        if (
            len(path) > n
            and path[-n] == "points"
            and str(path[1 - n]).isdecimal()
            and (n == 2 or name == "s")
        ):
            return (*path[: 1 - n], int(path[1 - n]), column)
    stem, _, part = str(name).rpartition("_")
    paired = stem in ("f", "g", "force") or (stem == "u" and root.at(*inner, "u"))
    if paired and part in ("x", "y") and path[0] in ("loads", "boundary"):
        return (*inner, stem, "xy".index(part))
    return path


def put_number(root: Node, path: Keys, new: Node) -> Node:
    """A copy of the tree with a number put where it stands (`place_of`); of a pair that is not
    given the other is 0. Raises KeyError as `put` does."""
    keys = place_of(root, path)
    if keys != path and keys[-2] != "points" and root.at(*keys[:-1]) is None:
        root = put(root, keys[:-1], replace(new, value=(replace(new, value=0),) * 2))
    return put(root, keys, new)


def put(root: Node, keys: Keys, new: Node | None, done: Keys = ()) -> Node:
    """A copy of the tree with a value put at a path (None removes the key); shares all that is
    untouched.

    Missing mappings on the way are made; a word that stands for a mapping is written out first.
    Raises KeyError with a text if a key on the way holds something else.
    """
    if not keys:
        return root if new is None else new
    key, rest = keys[0], keys[1:]
    here = ".".join(map(str, done)) or "the study"
    if isinstance(key, int):
        if (
            not isinstance(root.value, tuple)
            or key >= len(root.value)
            or (new is None and not rest)
        ):
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
        empty = Node(
            {}, ".".join(map(str, (*done, key))), (new or root).mark, (new or root).key_mark
        )
        children[key] = put(children.get(key, empty), rest, new, (*done, key))
    return replace(root, value=children)


def _hold_other(children: dict[str, Node], key: str) -> None:
    """A clamped edge without a displacement has u = 0: putting one component must not set the other
    one free."""
    role = children.get("role")
    frame = next((pair for pair in (("u_x", "u_y"), ("u_N", "u_T")) if key in pair), ())
    if (
        role is not None
        and role.value == "clamped"
        and not any(name in COMPONENTS for name in children)
    ):
        children.update({name: replace(role, value=0) for name in frame})


def _children(node: Node, here: str, done: Keys) -> dict[str, Node]:
    if isinstance(node.value, Mapping) or node.value is None:
        return dict(node.children)
    word = short_of(str(done[0])) if len(done) == (2 if done[:1] == ("boundary",) else 1) else ""
    if not word or not isinstance(node.value, str):
        raise KeyError(f"{here} is {node.kind()}, not a mapping with keys")
    return {word: node}


MAX_NODES = 500_000
MAX_DEPTH = 40
MAX_BYTES = 16_000_000
"""Of a study, or a table beside it; MAX_NODES numbers with their keys take less."""
UNCOUNTED = re.compile(r"#[^\n]*|'[^']*'|\"[^\"]*\"|\n(?=\s*(?:#|\n))")
"""Comments, texts in quotes and empty lines, which separate no values."""
MALFORMED = (
    ArithmeticError,
    ValueError,
    IndexError,
    AttributeError,
    TypeError,
    AssertionError,
)
"""What malformed escapes, directives and tags make the YAML library fail with in its own code."""
ESCAPE = re.compile(r"\\U([0-9A-Fa-f]{8})")
TAG = "tag:yaml.org,2002:"
TEXTS, NUMBERS = (
    {"!!str", "!!timestamp", "!!merge", "!!value"},
    {"!!null", "!!bool", "!!int", "!!float"},
)
"""Tags of scalars that stay texts, and of those that have a value."""


def load_text(path: Path) -> str:
    """The text of a study file; raises StudyError if it cannot be had."""
    line, column, what, remedy = (
        0,
        0,
        "there is no such file",
        "check the path; see configs/ for examples",
    )
    try:
        if path.is_file() and path.stat().st_size <= MAX_BYTES:
            return path.read_bytes().decode("utf-8")
        if path.is_file():
            what = f"the file has more than {MAX_BYTES // 10**6} MB"
            remedy = "check the name; a sweep of many points can be several studies"
        elif path.is_dir():
            what, remedy = "this is a folder", "name the study file in it"
        elif path.exists():
            what, remedy = (
                "this is a device or a pipe, no file",
                "save the text in a file and name it",
            )
    except UnicodeDecodeError as error:
        what, remedy = "this is a result file", "name its study, or use tcstudy show"
        if path.suffix != ".nc":
            before = error.object[: error.start]
            line, column = before.count(b"\n") + 1, len(before) - before.rfind(b"\n")
            what, remedy = "the file is not UTF-8 text", "save it as UTF-8"
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or str(error)
        what, remedy = f"the file cannot be read ({reason})", "check its path and its permissions"
    raise _refusal(str(path), what, remedy, line, column)


def compose(
    text: str, file: str, errors: Collector, path: str = "", *, option: bool = False
) -> Node:
    """The tree of a YAML text; raises StudyError if the text is no YAML, collects what else is wrong.
    path:   key path of the text's root
    option: the text is the value of a `--set` option, so that marks have no line"""
    if (values := _values_at_least(text)) > MAX_NODES:
        what = f"the text has about {values} values, of which at most {MAX_NODES} are read"
        raise _refusal(file, what, "write long sweeps as {linspace: [a, b, n]}, or several studies")
    if option and (node := _json_node(text, file, path)) is not None:
        return node
    try:
        with warnings.catch_warnings():
            warnings.simplefilter(
                "ignore", YAMLWarning
            )  # an anchor may be used again, says YAML 1.2
            library = YAML(typ="safe", pure=True)
            root = library.compose(text)
        if root is None:
            raise _refusal(file, "the file is empty", "start from configs/quickstart.yaml")
        return _Builder(library, file, errors, option).node(root, path, None)
    except RecursionError:
        raise _refusal(
            file, "the YAML is nested too deeply", "a study needs fewer than ten levels"
        ) from None
    except YAMLError as error:
        raise _syntax_error(error, text, file, option) from None
    except MALFORMED as error:
        if large := next((one for one in ESCAPE.finditer(text) if _is_beyond(one)), None):
            line, column = (0, 0) if option else _line_and_column(text, large.start())
            what, remedy = f"the escape {large[0]} is no character", "write the character itself"
            raise _refusal(file, what, remedy, line, column) from None
        raise _refusal(
            file, f"the YAML cannot be read ({error})", "look for odd directives, tags or escapes"
        ) from None


def _is_beyond(escape: re.Match[str]) -> bool:
    return int(escape[1], 16) > sys.maxunicode


def _json_node(text: str, file: str, path: str) -> Node | None:
    """Return the tree of an option that is JSON, as programs write them: that takes a hundredth of
    the time. None for other texts, and for those with a fault."""
    if text[:1] not in ("[", "{") or "\\" in text:
        return None

    def distinct(pairs: list[tuple[str, object]]) -> dict[str, object]:
        mapping = dict(pairs)
        if len(mapping) < len(pairs):
            raise ValueError("a key is given twice")
        return mapping

    try:
        plain = json.loads(text, object_pairs_hook=distinct)
    except (ValueError, RecursionError):
        return None
    return Node.of(plain, path, Mark(file))


def _values_at_least(text: str) -> int:
    """Return a lower bound of the values in a YAML text of the usual form, counted without reading
    it: a line of a block has one at least, a comma of a list or a mapping separates two."""
    if len(text) <= MAX_NODES:
        return 0
    bare = UNCOUNTED.sub("", text)
    return bare.count(",") + bare.count("\n")


def _line_and_column(text: str, position: int) -> tuple[int, int]:
    """Return the place of a character, both from 1."""
    return text.count("\n", 0, position) + 1, position - text.rfind("\n", 0, position)


def joined_surrogates(text: str) -> str:
    """Return a text with pairs of surrogates, as JSON writes characters beyond 16 bits, joined to
    these characters. Raises UnicodeError for half of a pair."""
    if text.isascii():
        return text
    return text.encode("utf-16", "surrogatepass").decode("utf-16")


def _refusal(
    file: str, what: str, remedy: str, line: int = 0, column: int = 0, key: str = ""
) -> StudyError:
    return StudyError([Problem(file, line, column, key, what, remedy)])


def _syntax_error(error: YAMLError, text: str, file: str, option: bool) -> StudyError:
    line, column, what = 1, 1, "this is not valid YAML"
    position = getattr(error, "position", None)
    if isinstance(error, MarkedYAMLError):
        mark = error.problem_mark or error.context_mark
        line, column = (mark.line + 1, mark.column + 1) if mark else (1, 1)
        what = ", ".join(str(part) for part in (error.context, error.problem) if part)
        start = error.context_mark
        if start is not None and start.line + 1 != line:
            what += f" (begun in line {start.line + 1})"
    elif isinstance(position, int):
        line, column = _line_and_column(text, position)
        what = f"the character {text[position : position + 1]!r} is not allowed in YAML"
    remedy = "correct the YAML here or in the lines above: quotes, brackets, a colon, indentation by blanks"
    if what.endswith("but got '['") and (
        path := re.search(r"[\w.]*\w\[\d+\][\w.\[\]]*", text.splitlines()[line - 1])
    ):
        remedy = f'between braces a key with brackets needs quotes: "{path[0]}"'
    return _refusal(file, f"YAML syntax: {what}", remedy, *((0, 0) if option else (line, column)))


class _Builder:
    def __init__(self, library: YAML, file: str, errors: Collector, option: bool) -> None:
        self.library, self.file, self.errors, self.option, self.count = (
            library,
            file,
            errors,
            option,
            0,
        )
        self.open: list[YamlNode] = []

    def mark(self, node: YamlNode) -> Mark:
        line, column = node.start_mark.line + 1, node.start_mark.column + 1
        return Mark(self.file, 0, 0) if self.option else Mark(self.file, line, column)

    def node(self, node: YamlNode, path: str, key: Mark | None) -> Node:
        """Our node for one of the library's; key is the place of the key it stands under."""
        mark, said, remedy = self.mark(node), "", ""
        if key and isinstance(node, ScalarNode) and node.value == "" and node.style is None:
            mark = key  # the library puts an empty value where the next key begins
        self.count += 1
        if any(node is outer for outer in self.open):
            said, remedy = "an alias contains itself", "write the value out"
        elif self.count > MAX_NODES or len(self.open) > MAX_DEPTH:
            said, remedy = (
                "the study is too large or nested too deeply",
                "write long sweeps as {linspace: [a, b, n]}",
            )
        if said:
            raise _refusal(self.file, said, remedy, mark.line, mark.column, path)
        self.open.append(node)
        value: Scalar | Mapping[str, Node] | tuple[Node, ...] = None
        tag = str(node.tag).replace(TAG, "!!")
        if isinstance(node, SequenceNode) and tag == "!!seq":
            value = tuple(
                self.node(item, f"{path}[{i}]", None) for i, item in enumerate(node.value)
            )
        elif isinstance(node, MappingNode) and tag == "!!map":
            value = self.mapping(node, path)
        elif not isinstance(node, ScalarNode) or tag not in TEXTS | NUMBERS:
            self.errors.unreadable(
                mark, path, f"the YAML tag {tag} is not supported", "remove the tag"
            )
        elif tag in TEXTS:
            value = self.text(str(node.value), mark, path)
        elif len(node.value) > LONGEST:
            said = (
                f"is a number of {len(node.value)} characters, of which at most {LONGEST} are read"
            )
            self.errors.unreadable(mark, path, said, "round it, or write it with an exponent")
        else:
            try:
                value = self.library.constructor.construct_object(node)
            except (ValueError, KeyError):
                self.errors.unreadable(
                    mark, path, f"{node.value[:40]!r} is not a number", "write a decimal number"
                )
        self.open.pop()
        return Node(value, path, mark, key or mark)

    def text(self, text: str, mark: Mark, path: str) -> str:
        """Return a text as it was meant; an empty one after a fault."""
        try:
            return joined_surrogates(text)
        except UnicodeError:
            what = "an escape such as \\ud83d is half a character"
            self.errors.unreadable(mark, path, what, "write the character itself, or both halves")
            return ""

    def mapping(self, node: MappingNode, path: str) -> dict[str, Node]:
        children: dict[str, Node] = {}
        for key, item in node.value:
            mark = self.mark(key)
            name = self.text(str(key.value), mark, path)
            inner = f"{path}.{name}" if path else name
            if not isinstance(key, ScalarNode):
                self.errors.at_mark(mark, path, "a key must be one word", "write `key: value`")
            elif str(key.tag) == TAG + "merge":
                self.errors.at_mark(
                    mark, inner, "merge keys are not supported", "write the keys out"
                )
            elif name in children:
                first = children[name].key_mark.line
                where = f" (first in line {first})" if first else ""
                self.errors.at_mark(
                    mark, inner, f"the key is given twice{where}", "keep one of the two"
                )
            else:
                children[name] = self.node(item, inner, mark)
        return children


def apply_overrides(
    root: Node, overrides: Sequence[str], short: Mapping[str, str], errors: Collector
) -> Node:
    """The tree with the values of `--set key=value` options put in, one after the other.
    short: short names of keys, such as alpha for heat.alpha. The value null removes a key.
    An option that a later one replaces is a fault: it would be lost without a word."""
    given: list[tuple[Keys, str]] = []
    for option in overrides:
        file = f"--set {option}"
        key, equals, text = (part.strip() for part in option.partition("="))
        key = whole_key(root, key, short)
        keys = (_of_sweep(root, key) or split_path(key)) if equals else None
        if keys is None or not text:
            remedy = "write --set key.path=value, for example --set heat.alpha=25"
            errors.at_mark(Mark(file, 0, 0), "", "this option is not key=value", remedy)
            continue
        lost = [text for keys_before, text in given if keys_before[: len(keys)] == keys]
        given.append((keys, option))
        if lost:
            what = f"--set {lost[-1]} would not be used, as this option replaces it"
            errors.at_mark(
                Mark(file, 0, 0), key, what, "give every key once, a section before its keys"
            )
            continue
        try:
            before, new = len(errors), compose(text, file, errors, key, option=True)
            if new.value is not None or len(errors) == before:
                root = put(root, keys, None) if new.value is None else put_number(root, keys, new)
        except StudyError as error:
            errors.problems.extend(error.problems)
        except KeyError as error:
            errors.at_mark(
                Mark(file, 0, 0), key, str(error.args[0]), "set a key that the study can have there"
            )
    return root


def whole_key(root: Node, key: str, short: Mapping[str, str] = SHORT) -> str:
    """The key path of a bare name of the section `parameters`, or of a short name; others as they
    are."""
    names = root.at("parameters")
    own = names is not None and names.at(key) is not None and key not in rows("")
    return f"parameters.{key}" if own else short.get(key, key)


def _of_sweep(root: Node, key: str) -> Keys | None:
    """The place of sweep.PARAMETER, whose key in the sweep may be a path or a short name; None if
    it has none yet."""
    sweep, rest = root.at("sweep"), key.removeprefix("sweep.")
    if rest == key or sweep is None or not isinstance(sweep.value, Mapping):
        return None
    for own in sorted(sweep.value, key=len, reverse=True):
        if rest == own or (rest.startswith(f"{own}.") and split_path(rest[len(own) + 1 :])):
            return ("sweep", own, *(split_path(rest[len(own) + 1 :]) or ()))
    same = [
        own
        for own in sweep.value
        if SHORT.get(own, own) == SHORT.get(rest, rest) or own.endswith(f".{rest}")
    ]
    return ("sweep", same[0]) if len(same) == 1 else None


def with_sweep(overrides: Sequence[str], mode: str, axes: Sequence[Axis]) -> tuple[str, ...]:
    """The options with a section `sweep` of these axes, all values or points written out, in place
    of all that change it; whole laws and materials by their names."""
    kept = (
        text
        for text in overrides
        if SHORT.get(key := text.partition("=")[0].strip(), key).split(".")[0] != "sweep"
    )
    named = {".".join(axis.path): (axis.is_whole, axis.labelled()) for axis in axes}
    written: dict[str, object] = {
        key: dict(v) if whole else [one for _, one in v] for key, (whole, v) in named.items()
    }
    if mode == "list":
        columns = [
            [{str(label): v} if whole else v for label, v in values]
            for whole, values in named.values()
        ]
        written = {
            "mode": "list",
            "points": [
                dict(zip(named, point, strict=True)) for point in zip(*columns, strict=True)
            ],
        }
    return (*kept, f"sweep={json.dumps(written, ensure_ascii=False)}")


def tree_of(study: Study, errors: Collector | None = None) -> Node:
    """The text of a study as a tree, with its `--set` options put in."""
    errors = errors if errors is not None else Collector()
    file = str(study.source) if study.source is not None else "<text>"
    return apply_overrides(compose(study.text, file, errors), study.overrides, SHORT, errors)


def changes(text: str, overrides: Sequence[str], study: Study) -> list[str]:
    """In which values a study differs from one of that text and options: "friction.delta was 1 mm,
    is 2 mm"."""
    errors = Collector()
    before = leaves(apply_overrides(compose(text, "", errors), overrides, SHORT, errors))
    now = leaves(tree_of(study))
    pairs = {key: (before.get(key, "absent"), now.get(key, "absent")) for key in {**before, **now}}
    return [
        f"{key} was {shortened(old)}, is {shortened(new)}"
        for key, (old, new) in pairs.items()
        if old != new
    ]


def leaves(node: Node) -> dict[str, str]:
    """Values by key path, as text; lists whole."""
    if not isinstance(node.value, Mapping):
        return {node.path: node.text()}
    return {key: value for child in node.value.values() for key, value in leaves(child).items()}


Found = tuple[Keys, str, str]
"""A fault: key path ("body", "regions", "heater"), what is wrong, what to do."""


def located(study: Study, faults: Sequence[Found]) -> list[Problem]:
    """The faults with file, line and column of their keys, or of the deepest key on the way that
    the study has."""
    if not faults:
        return []
    errors = Collector()
    root = tree_of(study, errors)
    for keys, what, remedy in faults:
        errors.at(root.nearest(*keys), what, remedy)
    return sorted(errors.problems, key=lambda problem: (problem.line, problem.column))
