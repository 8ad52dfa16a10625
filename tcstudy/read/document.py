"""From a YAML 1.2 text to a tree of marked nodes, with `--set` options put in.

Every value knows its key path and its place in the file. Faults are collected, and faults that are
found later get their place in the text of the study.

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

    value:    a scalar, a mapping of nodes or a sequence of nodes
    path:     key path where the user wrote the value, e.g. "sweep.alpha[1]"
    mark:     place of the value
    key_mark: place of its key; of an entry of a list, that of the entry
    shown_in: unit for messages and its size, of a number that does not stand in the file, as those
              of a linspace
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
        """Return the value without marks: scalars, dicts and lists."""
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
        """The entries of a list; any other value is a list of one."""
        return self.value if isinstance(self.value, tuple) else (self,)

    def all(self) -> Iterator[Node]:
        """Yield the node and all below it."""
        yield self
        nodes_below = self.value if isinstance(self.value, tuple) else self.children.values()
        for inner in nodes_below:
            yield from inner.all()

    def at(self, *keys: str | int) -> Node | None:
        """Return the value at a path, None if there is none."""
        node = self
        for key in keys:
            value = node.value
            if isinstance(value, Mapping) and key in value:
                node = value[key]  # type: ignore[index]
            elif isinstance(value, tuple) and isinstance(key, int) and key < len(value):
                node = value[key]
            else:
                return None
        return node

    def nearest(self, *keys: str | int) -> Node:
        """Return the value at a path, or at the longest part of it that exists."""
        for length in range(len(keys), 0, -1):
            node = self.at(*keys[:length])
            if node is not None:
                return node
        return self

    def text(self) -> str:
        """Return the value as one line of YAML-like text, for messages and labels."""
        plain = self.plain()
        if isinstance(plain, bool | list | dict | None):
            text = json.dumps(plain, ensure_ascii=False).replace('"', "")
        else:
            text = str(plain)
        return " ".join(text.split())

    def kind(self) -> str:
        """Return in words what the node holds."""
        if isinstance(self.value, Mapping):
            return "a mapping"
        if isinstance(self.value, tuple):
            return f"a list of {len(self.value)}" if self.value else "an empty list"
        if isinstance(self.value, bool):
            return f"the truth value {self.text()}"
        if self.value is None or self.value == "":
            return "empty"
        if isinstance(self.value, str):
            return f"the text {self.brief()!r}"
        return f"the number {self.brief()}"

    def brief(self) -> str:
        """Return the text, shortened so that a message stays one readable line.

        Numbers that stand nowhere in the file have six digits.
        """
        if self.shown_in is not None and isinstance(self.value, float):
            unit, size = self.shown_in
            return f"{self.value / size:.6g} {unit}".rstrip()
        return shortened(self.text())


MAX_LINES = 10
"""Lines of a table that are reported with faults in one column."""


class KnownFaults:
    """The faults that are known already, so that each is reported once."""

    def __init__(self) -> None:
        self._known: set[object] = set()
        self._unreadable: set[Mark] = set()
        self._lines: Counter[tuple[str, str]] = Counter()

    def leave_out(self, mark: Mark) -> None:
        """Leave further faults of this place out, since it has no value."""
        self._unreadable.add(mark)

    def is_left_out(self, mark: Mark, key: str, fault: str, is_repeated: bool) -> bool:
        """Return whether a fault needs no report; remember it for the next call.

        is_repeated: whether the place is read again, for another sweep point. A fault of another
                     value of the same key is then known as well.
        """
        last_word = key.rpartition(".")[2].partition("[")[0]
        identities: set[object] = {(mark, key), (last_word, fault)}
        if mark in self._unreadable or (is_repeated and not identities.isdisjoint(self._known)):
            return True
        self._known |= identities
        return False

    def is_reported(self, problem: Problem) -> bool:
        """Return whether a problem is new, and not one of too many in a column of a table."""
        if problem in self._known:
            return False
        self._known.add(problem)
        column = problem.file, problem.key  # all lines of a column have one key
        self._lines[column] += 1
        return self._lines[column] <= MAX_LINES


class Collector:
    """The faults that reading a study has met, each as "problem; remedy".

    Faults are collected, never raised one by one; `KnownFaults` decides which are reported.
    point:   words for the sweep point being read; empty while the base study is read
    drawn:   whether the values of sweep points stand nowhere in the file, so that every fault must
             name the point
    refused: faults of the shape or the element sizes of one geometry of several, which then is
             left out
    """

    def __init__(self) -> None:
        self.problems: list[Problem] = []
        self.point = ""
        self.drawn = False
        self.refused: list[str] | None = None
        self._count = 0
        self._known = KnownFaults()

    def __len__(self) -> int:
        """Return how often a fault was met, repeated ones included.

        The number is unchanged if all that was read in between is sound.
        """
        return self._count

    def at(self, node: Node, *sentences: str, key: str | None = None, on_key: bool = False) -> None:
        """Record a fault at a node, or at its key.

        The same fault in further sweep points is one fault.
        sentences: the problem and the remedy, in one text "problem; remedy" or in several
        """
        mark = node.key_mark if on_key else node.mark
        self.at_mark(mark, node.path if key is None else key, *sentences)

    def unfit(self, node: Node, key: str, *sentences: str) -> None:
        """Record that no body has this shape, or no mesh this element size.

        It is a fault, unless it is that of one geometry of several.
        """
        if self.refused is None:
            self.at(node, *sentences, key=key)
        else:
            self._count += 1
            self.refused.append(f"{key}: {'; '.join(sentences)}")

    def unreadable(self, mark: Mark, key: str, *sentences: str) -> None:
        """Record that a place has no value; further faults of this place are left out."""
        self.at_mark(mark, key, *sentences)
        self._known.leave_out(mark)

    def met_again(self) -> None:
        """Count a fault that is recorded elsewhere, so that what needs its value is left unread."""
        self._count += 1

    def at_mark(self, mark: Mark, key: str, *sentences: str) -> None:
        """Record a fault at a place in the file, of a key."""
        self._count += 1
        fault, remedy = halves(sentences)
        if self._known.is_left_out(mark, key, fault, is_repeated=bool(self.point)):
            return
        if self.point and (self.drawn or not key.startswith("sweep")):
            words = self.point if self.drawn else f"with {self.point}"
            fault = f"{fault} ({words})"
        if self.point and self.drawn and remedy.startswith("write"):
            # a distribution stands where the remedy means a value
            remedy = "give a distribution of values that are possible"
        problem = Problem(mark.file, mark.line, mark.column, key, fault, remedy)
        if self._known.is_reported(problem):
            self.problems.append(problem)


def halves(sentences: tuple[str, ...]) -> tuple[str, str]:
    """Return the problem and the remedy of a text "problem; remedy", or of several texts."""
    parts = sentences if len(sentences) > 1 else sentences[0].split("; ", 1)
    return parts[0], "; ".join(parts[1:])


def split_path(path: str) -> Keys | None:
    """Return the keys of a path such as "body.outline[2].edge"; None if it is not one."""
    if not re.fullmatch(r"[^.\[\]\s]+(\[\d{1,6}\])*(\.[^.\[\]\s]+(\[\d{1,6}\])*)*", path):
        return None
    tokens = re.findall(r"\[\d+\]|[^.\[\]]+", path)
    return tuple(int(token[1:-1]) if token[0] == "[" else token for token in tokens)


def place_of(root: Node, path: Keys) -> Keys:
    """Return the place in the study of the number of a key path.

    A component stands in its pair, b or s of a law's point in its list, and every other number at
    the path itself.
    """
    *section, name = path
    if _is_law_point(path, 2):  # friction.points.0 is b
        return (*path[:-1], int(name), 1)
    if _is_law_point(path, 3) and name == "s":
        return (*path[:-2], int(path[-2]), 0)
    stem, _, component = str(name).rpartition("_")
    is_paired = stem in ("f", "g", "force") or (stem == "u" and root.at(*section, "u"))
    if is_paired and component in ("x", "y") and path[0] in ("loads", "boundary"):
        return (*section, stem, "xy".index(component))
    return path


def _is_law_point(path: Keys, depth: int) -> bool:
    """Return whether a path ends in a number of a law's point, `depth` keys from "points" on."""
    return len(path) > depth and path[-depth] == "points" and str(path[1 - depth]).isdecimal()


def put_number(root: Node, path: Keys, new: Node) -> Node:
    """Return a copy of the tree with a number put where it stands (`place_of`).

    Of a pair that is not given, the other component is 0. Raises KeyError as `put` does.
    """
    keys = place_of(root, path)
    if keys != path and keys[-2] != "points" and root.at(*keys[:-1]) is None:
        zero = replace(new, value=0)
        root = put(root, keys[:-1], replace(new, value=(zero, zero)))
    return put(root, keys, new)


def put(root: Node, keys: Keys, new: Node | None, done: Keys = ()) -> Node:
    """Return a copy of the tree with a value put at a path; shares all that is untouched.

    Missing mappings on the way are made. A word that stands for a mapping is written out first.
    new:  None removes the key
    done: the keys from the top of the study to `root`
    Raises KeyError with a text if a key on the way holds something else.
    """
    if not keys:
        return root if new is None else new
    key, inner_keys = keys[0], keys[1:]
    is_removed = new is None and not inner_keys
    place = ".".join(map(str, done)) or "the study"
    if isinstance(key, int):
        entries = root.value
        if not isinstance(entries, tuple) or key >= len(entries) or is_removed:
            raise KeyError(f"{place} has no entry [{key}] to set")
        items = list(entries)
        items[key] = put(items[key], inner_keys, new, (*done, key))
        return replace(root, value=tuple(items))
    children = _children(root, place, done)
    if is_removed:
        children.pop(key, None)
    elif new is not None or key in children:
        if len(done) == 2 and done[0] == "boundary":
            _hold_other(children, key)
        source = new or root
        path = ".".join(map(str, (*done, key)))
        empty = Node({}, path, source.mark, source.key_mark)
        children[key] = put(children.get(key, empty), inner_keys, new, (*done, key))
    return replace(root, value=children)


def _hold_other(children: dict[str, Node], key: str) -> None:
    """Hold the other component of a clamped edge when one is put in.

    A clamped edge without a displacement has u = 0, and that of the other component must stay.
    """
    role = children.get("role")
    if role is None or role.value != "clamped":
        return
    if any(name in COMPONENTS for name in children):
        return
    for components in (("u_x", "u_y"), ("u_N", "u_T")):
        if key in components:
            children.update({name: replace(role, value=0) for name in components})


def _children(node: Node, place: str, done: Keys) -> dict[str, Node]:
    if isinstance(node.value, Mapping) or node.value is None:
        return dict(node.children)
    section_depth = 2 if done[:1] == ("boundary",) else 1
    word = short_of(str(done[0])) if len(done) == section_depth else ""
    if not word or not isinstance(node.value, str):
        raise KeyError(f"{place} is {node.kind()}, not a mapping with keys")
    return {word: node}


MAX_NODES = 500_000
"""Values of a study."""
MAX_DEPTH = 40
"""Nested lists and mappings of a study."""
MAX_BYTES = 16_000_000
"""Size of a study or a table beside it; MAX_NODES numbers with their keys take less."""
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
"""Exceptions of the YAML library's own code at malformed escapes, directives and tags."""
ESCAPE = re.compile(r"\\U([0-9A-Fa-f]{8})")
TAG = "tag:yaml.org,2002:"
TEXTS = {"!!str", "!!timestamp", "!!merge", "!!value"}
"""Tags of scalars that stay texts."""
NUMBERS = {"!!null", "!!bool", "!!int", "!!float"}
"""Tags of scalars that have a value."""


def load_text(path: Path) -> str:
    """Return the text of a study file; raise StudyError if it cannot be read."""
    line, column = 0, 0
    fault = "there is no such file"
    remedy = "check the path; see configs/ for examples"
    try:
        if path.is_file() and path.stat().st_size <= MAX_BYTES:
            return path.read_bytes().decode("utf-8")
        if path.is_file():
            fault = f"the file has more than {MAX_BYTES // 10**6} MB"
            remedy = "check the name; a sweep of many points can be several studies"
        elif path.is_dir():
            fault = "this is a folder"
            remedy = "name the study file in it"
        elif path.exists():
            fault = "this is a device or a pipe, no file"
            remedy = "save the text in a file and name it"
    except UnicodeDecodeError as error:
        if path.suffix == ".nc":
            fault = "this is a result file"
            remedy = "name its study, or use tcstudy show"
        else:
            fault = "the file is not UTF-8 text"
            remedy = "save it as UTF-8"
            before = error.object[: error.start]
            line = before.count(b"\n") + 1
            column = len(before) - before.rfind(b"\n")
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or str(error)
        fault = f"the file cannot be read ({reason})"
        remedy = "check its path and its permissions"
    raise _refusal(str(path), fault, remedy, line, column)


def compose(
    text: str, file: str, errors: Collector, path: str = "", *, option: bool = False
) -> Node:
    """Return the tree of a YAML text; collect the faults of its values.

    path:   key path of the text's root
    option: the text is the value of a `--set` option, so that marks have no line
    Raises StudyError if the text is no YAML.
    """
    n_values = _values_at_least(text)
    if n_values > MAX_NODES:
        fault = f"the text has about {n_values} values, of which at most {MAX_NODES} are read"
        raise _refusal(
            file, fault, "write long sweeps as {linspace: [a, b, n]}, or several studies"
        )
    json_node = _json_node(text, file, path) if option else None
    if json_node is not None:
        return json_node
    try:
        library = YAML(typ="safe", pure=True)
        with warnings.catch_warnings():
            # YAML 1.2 allows an anchor to be used again
            warnings.simplefilter("ignore", YAMLWarning)
            root = library.compose(text)
        if root is None:
            raise _refusal(file, "the file is empty", "start from configs/quickstart.yaml")
        return _Builder(library, file, errors, option).node(root, path, None)
    except RecursionError:
        fault = "the YAML is nested too deeply"
        raise _refusal(file, fault, "a study needs fewer than ten levels") from None
    except YAMLError as error:
        raise _syntax_error(error, text, file, option) from None
    except MALFORMED as error:
        raise _malformed(error, text, file, option) from None


def _malformed(error: Exception, text: str, file: str, option: bool) -> StudyError:
    """Return the fault of a text in which the YAML library fails in its own code."""
    escape = next(filter(_is_beyond, ESCAPE.finditer(text)), None)
    if escape is None:
        fault = f"the YAML cannot be read ({error})"
        return _refusal(file, fault, "look for odd directives, tags or escapes")
    line, column = (0, 0) if option else _line_and_column(text, escape.start())
    fault = f"the escape {escape[0]} is no character"
    return _refusal(file, fault, "write the character itself", line, column)


def _is_beyond(escape: re.Match[str]) -> bool:
    return int(escape[1], 16) > sys.maxunicode


def _json_node(text: str, file: str, path: str) -> Node | None:
    """Return the tree of an option that is JSON, as programs write them.

    None for other texts, and for those with a fault. It takes a hundredth of the time of YAML.
    """
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
    """Return a lower bound of the number of values in a YAML text, counted without reading it.

    Every line of a block has one value at least, and a comma of a list or a mapping separates two.
    """
    if len(text) <= MAX_NODES:
        return 0
    bare = UNCOUNTED.sub("", text)
    return bare.count(",") + bare.count("\n")


def _line_and_column(text: str, position: int) -> tuple[int, int]:
    """Return the place of a character, both from 1."""
    return text.count("\n", 0, position) + 1, position - text.rfind("\n", 0, position)


def joined_surrogates(text: str) -> str:
    """Return a text with pairs of surrogates joined to the characters that they stand for.

    JSON writes characters beyond 16 bits as pairs. Raises UnicodeError for half of a pair.
    """
    if text.isascii():
        return text
    return text.encode("utf-16", "surrogatepass").decode("utf-16")


def _refusal(
    file: str, fault: str, remedy: str, line: int = 0, column: int = 0, key: str = ""
) -> StudyError:
    return StudyError([Problem(file, line, column, key, fault, remedy)])


def _syntax_error(error: YAMLError, text: str, file: str, option: bool) -> StudyError:
    line, column, fault = 1, 1, "this is not valid YAML"
    position = getattr(error, "position", None)
    if isinstance(error, MarkedYAMLError):
        mark = error.problem_mark or error.context_mark
        if mark:
            line, column = mark.line + 1, mark.column + 1
        fault = ", ".join(str(part) for part in (error.context, error.problem) if part)
        start = error.context_mark
        if start is not None and start.line + 1 != line:
            fault += f" (begun in line {start.line + 1})"
    elif isinstance(position, int):
        line, column = _line_and_column(text, position)
        fault = f"the character {text[position : position + 1]!r} is not allowed in YAML"
    causes = "quotes, brackets, a colon, indentation by blanks"
    remedy = f"correct the YAML here or in the lines above: {causes}"
    if fault.endswith("but got '['"):
        path = re.search(r"[\w.]*\w\[\d+\][\w.\[\]]*", text.splitlines()[line - 1])
        if path:
            remedy = f'between braces a key with brackets needs quotes: "{path[0]}"'
    if option:
        line, column = 0, 0
    return _refusal(file, f"YAML syntax: {fault}", remedy, line, column)


class _Builder:
    def __init__(self, library: YAML, file: str, errors: Collector, option: bool) -> None:
        self.library = library
        self.file = file
        self.errors = errors
        self.option = option
        self.count = 0
        self.open: list[YamlNode] = []

    def mark(self, node: YamlNode) -> Mark:
        if self.option:
            return Mark(self.file, 0, 0)
        return Mark(self.file, node.start_mark.line + 1, node.start_mark.column + 1)

    def node(self, node: YamlNode, path: str, key: Mark | None) -> Node:
        """Return our node for one of the library's; key is the place of its key."""
        mark = self.mark(node)
        if key and isinstance(node, ScalarNode) and node.value == "" and node.style is None:
            mark = key  # the library puts an empty value where the next key begins
        self.count += 1
        fault = ""
        if any(node is outer for outer in self.open):
            fault = "an alias contains itself"
            remedy = "write the value out"
        elif self.count > MAX_NODES or len(self.open) > MAX_DEPTH:
            fault = "the study is too large or nested too deeply"
            remedy = "write long sweeps as {linspace: [a, b, n]}"
        if fault:
            raise _refusal(self.file, fault, remedy, mark.line, mark.column, path)
        self.open.append(node)
        value = self.value(node, mark, path)
        self.open.pop()
        return Node(value, path, mark, key or mark)

    def value(
        self, node: YamlNode, mark: Mark, path: str
    ) -> Scalar | Mapping[str, Node] | tuple[Node, ...]:
        """Return the value of a node; None after a fault, which is recorded."""
        tag = str(node.tag).replace(TAG, "!!")
        if isinstance(node, SequenceNode) and tag == "!!seq":
            items = enumerate(node.value)
            return tuple(self.node(item, f"{path}[{i}]", None) for i, item in items)
        if isinstance(node, MappingNode) and tag == "!!map":
            return self.mapping(node, path)
        if not isinstance(node, ScalarNode) or tag not in TEXTS | NUMBERS:
            fault = f"the YAML tag {tag} is not supported"
            self.errors.unreadable(mark, path, fault, "remove the tag")
            return None
        if tag in TEXTS:
            return self.text(str(node.value), mark, path)
        if len(node.value) > LONGEST:
            fault = (
                f"is a number of {len(node.value)} characters, of which at most {LONGEST} are read"
            )
            self.errors.unreadable(mark, path, fault, "round it, or write it with an exponent")
            return None
        try:
            number: Scalar = self.library.constructor.construct_object(node)
        except (ValueError, KeyError):
            fault = f"{node.value[:40]!r} is not a number"
            self.errors.unreadable(mark, path, fault, "write a decimal number")
            return None
        return number

    def text(self, text: str, mark: Mark, path: str) -> str:
        """Return a text as it was meant; an empty one after a fault."""
        try:
            return joined_surrogates(text)
        except UnicodeError:
            fault = "an escape such as \\ud83d is half a character"
            self.errors.unreadable(mark, path, fault, "write the character itself, or both halves")
            return ""

    def mapping(self, node: MappingNode, path: str) -> dict[str, Node]:
        at_mark = self.errors.at_mark
        children: dict[str, Node] = {}
        for key, item in node.value:
            mark = self.mark(key)
            name = self.text(str(key.value), mark, path)
            inner = f"{path}.{name}" if path else name
            if not isinstance(key, ScalarNode):
                at_mark(mark, path, "a key must be one word", "write `key: value`")
            elif str(key.tag) == TAG + "merge":
                at_mark(mark, inner, "merge keys are not supported", "write the keys out")
            elif name in children:
                line = children[name].key_mark.line
                place = f" (first in line {line})" if line else ""
                at_mark(mark, inner, f"the key is given twice{place}", "keep one of the two")
            else:
                children[name] = self.node(item, inner, mark)
        return children


def apply_overrides(
    root: Node, overrides: Sequence[str], short: Mapping[str, str], errors: Collector
) -> Node:
    """Return the tree with the values of `--set key=value` options put in, one after the other.

    The value null removes a key. An option that a later one replaces is a fault: it would be lost
    without a word.
    short: short names of keys, such as alpha for heat.alpha
    """
    earlier: list[tuple[Keys, str]] = []
    for option in overrides:
        mark = Mark(f"--set {option}", 0, 0)
        name, equals, text = (part.strip() for part in option.partition("="))
        key = whole_key(root, name, short)
        keys = (_of_sweep(root, key) or split_path(key)) if equals else None
        if keys is None or not text:
            remedy = "write --set key.path=value, for example --set heat.alpha=25"
            errors.at_mark(mark, "", "this option is not key=value", remedy)
            continue
        replaced = [text for earlier_keys, text in earlier if earlier_keys[: len(keys)] == keys]
        earlier.append((keys, option))
        if replaced:
            fault = f"--set {replaced[-1]} would not be used, as this option replaces it"
            errors.at_mark(mark, key, fault, "give every key once, a section before its keys")
            continue
        try:
            before = len(errors)
            new = compose(text, mark.file, errors, key, option=True)
            if new.value is not None:
                root = put_number(root, keys, new)
            elif len(errors) == before:
                root = put(root, keys, None)
        except StudyError as error:
            errors.problems.extend(error.problems)
        except KeyError as error:
            remedy = "set a key that the study can have there"
            errors.at_mark(mark, key, str(error.args[0]), remedy)
    return root


def whole_key(root: Node, key: str, short: Mapping[str, str] = SHORT) -> str:
    """Return the key path of a name of the section `parameters`, or of a short name.

    Other keys are returned as they are.
    """
    names = root.at("parameters")
    is_name = names is not None and names.at(key) is not None and key not in rows("")
    return f"parameters.{key}" if is_name else short.get(key, key)


def _of_sweep(root: Node, key: str) -> Keys | None:
    """Return the place of sweep.PARAMETER, whose key in the sweep may be a path or a short name.

    None if the sweep has no such parameter yet.
    """
    sweep = root.at("sweep")
    name = key.removeprefix("sweep.")
    if name == key or sweep is None or not isinstance(sweep.value, Mapping):
        return None
    for swept in sorted(sweep.value, key=len, reverse=True):
        if name == swept:
            return ("sweep", swept)
        inner_keys = split_path(name.removeprefix(f"{swept}."))
        if name.startswith(f"{swept}.") and inner_keys:
            return ("sweep", swept, *inner_keys)
    path = SHORT.get(name, name)
    meant = [
        swept
        for swept in sweep.value
        if SHORT.get(swept, swept) == path or swept.endswith(f".{name}")
    ]
    return ("sweep", meant[0]) if len(meant) == 1 else None


def _changes_sweep(option: str) -> bool:
    key = option.partition("=")[0].strip()
    return SHORT.get(key, key).split(".")[0] == "sweep"


def _point_values(axis: Axis) -> list[object]:
    """Return the values of an axis as they stand in listed points."""
    if axis.is_whole:
        return [{str(label): value} for label, value in axis.labelled()]
    return [value for _, value in axis.labelled()]


def with_sweep(overrides: Sequence[str], mode: str, axes: Sequence[Axis]) -> tuple[str, ...]:
    """Return the options with a section `sweep` of these axes, all values or points written out.

    It replaces all options that change the sweep. Whole laws and materials go by their names.
    """
    unrelated = [text for text in overrides if not _changes_sweep(text)]
    section: dict[str, object] = {}
    if mode == "list":
        columns = {".".join(axis.path): _point_values(axis) for axis in axes}
        points = zip(*columns.values(), strict=True)
        section["mode"] = "list"
        section["points"] = [dict(zip(columns, point, strict=True)) for point in points]
    else:
        for axis in axes:
            labelled = axis.labelled()
            values = dict(labelled) if axis.is_whole else [value for _, value in labelled]
            section[".".join(axis.path)] = values
    return (*unrelated, f"sweep={json.dumps(section, ensure_ascii=False)}")


def tree_of(study: Study, errors: Collector | None = None) -> Node:
    """Return the text of a study as a tree, with its `--set` options put in."""
    errors = errors if errors is not None else Collector()
    file = str(study.source) if study.source is not None else "<text>"
    return apply_overrides(compose(study.text, file, errors), study.overrides, SHORT, errors)


def changes(text: str, overrides: Sequence[str], study: Study) -> list[str]:
    """Return the values in which a study differs from one of that text and options.

    Each is a sentence: "friction.delta was 1 mm, is 2 mm".
    """
    errors = Collector()
    before = leaves(apply_overrides(compose(text, "", errors), overrides, SHORT, errors))
    after = leaves(tree_of(study))
    sentences = []
    for key in {**before, **after}:
        old, new = before.get(key, "absent"), after.get(key, "absent")
        if old != new:
            sentences.append(f"{key} was {shortened(old)}, is {shortened(new)}")
    return sentences


def leaves(node: Node) -> dict[str, str]:
    """Return the values by key path, as text; lists are whole."""
    if not isinstance(node.value, Mapping):
        return {node.path: node.text()}
    texts: dict[str, str] = {}
    for child in node.value.values():
        texts |= leaves(child)
    return texts


LocatedFault = tuple[Keys, str, str]
"""A fault: key path ("body", "regions", "heater"), problem, remedy."""


def located(study: Study, faults: Sequence[LocatedFault]) -> list[Problem]:
    """Return the faults with file, line and column of their keys.

    Where the study has not the key, it is the place of the deepest key on the way to it.
    """
    if not faults:
        return []
    errors = Collector()
    root = tree_of(study, errors)
    for keys, fault, remedy in faults:
        errors.at(root.nearest(*keys), fault, remedy)
    return sorted(errors.problems, key=lambda problem: (problem.line, problem.column))
