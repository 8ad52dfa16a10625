"""From a YAML 1.2 text to a tree of marked nodes, and `--set` options put into it.

Anchors and aliases work; tags, merge keys and keys that are not plain words are refused with a remedy.

Where in a study's text something stands, for faults that are found after the study was read.
"""

from __future__ import annotations

import json
import re
import warnings
from collections.abc import Mapping, Sequence
from pathlib import Path

from ruamel.yaml import YAML
from ruamel.yaml.error import MarkedYAMLError, YAMLError, YAMLWarning
from ruamel.yaml.nodes import MappingNode, ScalarNode, SequenceNode
from ruamel.yaml.nodes import Node as YamlNode

from tcstudy.errors import Problem, StudyError, shortened
from tcstudy.read.node import Collector, Keys, Mark, Node, Scalar, put, put_number, split_path
from tcstudy.scene.keys import rows
from tcstudy.scene.parameters import SHORT
from tcstudy.scene.study import Axis, Study
from tcstudy.scene.units import LONGEST

MAX_NODES = 500_000
MAX_DEPTH = 40
MAX_BYTES = 16_000_000
"""Of a study, or a table beside it; MAX_NODES numbers with their keys take less."""
TAG = "tag:yaml.org,2002:"
TEXTS, NUMBERS = {"!!str", "!!timestamp", "!!merge", "!!value"}, {"!!null", "!!bool", "!!int", "!!float"}
"""Tags of scalars that stay texts, and of those that have a value."""


def load_text(path: Path) -> str:
    """The text of a study file; raises StudyError if it cannot be had."""
    line, column, what, remedy = 0, 0, "there is no such file", "check the path; see configs/ for examples"
    try:
        if path.is_file() and path.stat().st_size <= MAX_BYTES:
            return path.read_bytes().decode("utf-8")
        if path.is_file():
            what = f"the file has more than {MAX_BYTES // 10**6} MB"
            remedy = "check the name; a sweep of many points can be several studies"
        elif path.is_dir():
            what, remedy = "this is a folder", "name the study file in it"
        elif path.exists():
            what, remedy = "this is a device or a pipe, no file", "save the text in a file and name it"
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


def compose(text: str, file: str, errors: Collector, path: str = "", *, option: bool = False) -> Node:
    """The tree of a YAML text; raises StudyError if the text is no YAML, collects what else is wrong.

    path:   key path of the text's root
    option: the text is the value of a `--set` option, so that marks have no line
    """
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", YAMLWarning)  # an anchor may be used again, says YAML 1.2
            library = YAML(typ="safe", pure=True)
            root = library.compose(text)
        if root is None:
            raise _refusal(file, "the file is empty", "start from configs/quickstart.yaml")
        return _Builder(library, file, errors, option).node(root, path, None)
    except RecursionError:
        raise _refusal(file, "the YAML is nested too deeply", "a study needs fewer than ten levels") from None
    except YAMLError as error:
        raise _syntax_error(error, text, file, option) from None
    except (ValueError, IndexError, AttributeError, TypeError, AssertionError) as error:
        # Malformed escapes, directives and tags make the YAML library fail in its own code.
        raise _refusal(file, f"the YAML cannot be read ({error})", "look for odd directives, tags or escapes") from None


def _refusal(file: str, what: str, remedy: str, line: int = 0, column: int = 0, key: str = "") -> StudyError:
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
        line, column = text.count("\n", 0, position) + 1, position - text.rfind("\n", 0, position)
        what = f"the character {text[position : position + 1]!r} is not allowed in YAML"
    remedy = "correct the YAML here or in the lines above: quotes, brackets, a colon, indentation by blanks"
    if what.endswith("but got '['") and (path := re.search(r"[\w.]*\w\[\d+\][\w.\[\]]*", text.splitlines()[line - 1])):
        remedy = f'between braces a key with brackets needs quotes: "{path[0]}"'
    return _refusal(file, f"YAML syntax: {what}", remedy, *((0, 0) if option else (line, column)))


class _Builder:
    def __init__(self, library: YAML, file: str, errors: Collector, option: bool) -> None:
        self.library, self.file, self.errors, self.option, self.count = library, file, errors, option, 0
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
            said, remedy = "the study is too large or nested too deeply", "write long sweeps as {linspace: [a, b, n]}"
        if said:
            raise _refusal(self.file, said, remedy, mark.line, mark.column, path)
        self.open.append(node)
        value: Scalar | Mapping[str, Node] | tuple[Node, ...] = None
        tag = str(node.tag).replace(TAG, "!!")
        if isinstance(node, SequenceNode) and tag == "!!seq":
            value = tuple(self.node(item, f"{path}[{i}]", None) for i, item in enumerate(node.value))
        elif isinstance(node, MappingNode) and tag == "!!map":
            value = self.mapping(node, path)
        elif not isinstance(node, ScalarNode) or tag not in TEXTS | NUMBERS:
            self.errors.unreadable(mark, path, f"the YAML tag {tag} is not supported", "remove the tag")
        elif tag in TEXTS:
            value = str(node.value)
        elif len(node.value) > LONGEST:
            said = f"is a number of {len(node.value)} characters, of which at most {LONGEST} are read"
            self.errors.unreadable(mark, path, said, "round it, or write it with an exponent")
        else:
            try:
                value = self.library.constructor.construct_object(node)
            except (ValueError, KeyError):
                self.errors.unreadable(mark, path, f"{node.value[:40]!r} is not a number", "write a decimal number")
        self.open.pop()
        return Node(value, path, mark, key or mark)

    def mapping(self, node: MappingNode, path: str) -> dict[str, Node]:
        children: dict[str, Node] = {}
        for key, item in node.value:
            mark, inner = self.mark(key), f"{path}.{key.value}" if path else str(key.value)
            if not isinstance(key, ScalarNode):
                self.errors.at_mark(mark, path, "a key must be one word", "write `key: value`")
            elif str(key.tag) == TAG + "merge":
                self.errors.at_mark(mark, inner, "merge keys are not supported", "write the keys out")
            elif (name := str(key.value)) in children:
                first = children[name].key_mark.line
                where = f" (first in line {first})" if first else ""
                self.errors.at_mark(mark, inner, f"the key is given twice{where}", "keep one of the two")
            else:
                children[name] = self.node(item, inner, mark)
        return children


def apply_overrides(root: Node, overrides: Sequence[str], short: Mapping[str, str], errors: Collector) -> Node:
    """The tree with the values of `--set key=value` options put in, one after the other.

    short: short names of keys, such as alpha for heat.alpha. The value null removes a key.
    An option that a later one replaces is a fault: it would be lost without a word.
    """
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
            errors.at_mark(Mark(file, 0, 0), key, what, "give every key once, a section before its keys")
            continue
        try:
            before, new = len(errors), compose(text, file, errors, key, option=True)
            if new.value is not None or len(errors) == before:
                root = put(root, keys, None) if new.value is None else put_number(root, keys, new)
        except StudyError as error:
            errors.problems.extend(error.problems)
        except KeyError as error:
            errors.at_mark(Mark(file, 0, 0), key, str(error.args[0]), "set a key that the study can have there")
    return root


def whole_key(root: Node, key: str, short: Mapping[str, str] = SHORT) -> str:
    """The key path of a bare name of the section `parameters`, or of a short name; others as they are."""
    names = root.at("parameters")
    own = names is not None and names.at(key) is not None and key not in rows("")
    return f"parameters.{key}" if own else short.get(key, key)


def _of_sweep(root: Node, key: str) -> Keys | None:
    """The place of sweep.PARAMETER, whose key in the sweep may be a path or a short name; None if it has none yet."""
    sweep, rest = root.at("sweep"), key.removeprefix("sweep.")
    if rest == key or sweep is None or not isinstance(sweep.value, Mapping):
        return None
    for own in sorted(sweep.value, key=len, reverse=True):
        if rest == own or (rest.startswith(f"{own}.") and split_path(rest[len(own) + 1 :])):
            return ("sweep", own, *(split_path(rest[len(own) + 1 :]) or ()))
    same = [own for own in sweep.value if SHORT.get(own, own) == SHORT.get(rest, rest) or own.endswith(f".{rest}")]
    return ("sweep", same[0]) if len(same) == 1 else None


def with_sweep(overrides: Sequence[str], mode: str, axes: Sequence[Axis]) -> tuple[str, ...]:
    """The options with a section `sweep` of these axes, all values or points written out, in place of all that change
    it; whole laws and materials by their names."""
    kept = (
        text for text in overrides if SHORT.get(key := text.partition("=")[0].strip(), key).split(".")[0] != "sweep"
    )
    named = {".".join(axis.path): (axis.is_whole, axis.labelled()) for axis in axes}
    written: dict[str, object] = {key: dict(v) if whole else [one for _, one in v] for key, (whole, v) in named.items()}
    if mode == "list":
        columns = [[{str(label): v} if whole else v for label, v in values] for whole, values in named.values()]
        written = {
            "mode": "list",
            "points": [dict(zip(named, point, strict=True)) for point in zip(*columns, strict=True)],
        }
    return (*kept, f"sweep={json.dumps(written, ensure_ascii=False)}")


def tree_of(study: Study, errors: Collector | None = None) -> Node:
    """The text of a study as a tree, with its `--set` options put in."""
    errors = errors if errors is not None else Collector()
    file = str(study.source) if study.source is not None else "<text>"
    return apply_overrides(compose(study.text, file, errors), study.overrides, SHORT, errors)


def changes(text: str, overrides: Sequence[str], study: Study) -> list[str]:
    """In which values a study differs from one of that text and options: "friction.delta was 1 mm, is 2 mm"."""
    errors = Collector()
    before = leaves(apply_overrides(compose(text, "", errors), overrides, SHORT, errors))
    now = leaves(tree_of(study))
    pairs = {key: (before.get(key, "absent"), now.get(key, "absent")) for key in {**before, **now}}
    return [f"{key} was {shortened(old)}, is {shortened(new)}" for key, (old, new) in pairs.items() if old != new]


def leaves(node: Node) -> dict[str, str]:
    """Values by key path, as text; lists whole."""
    if not isinstance(node.value, Mapping):
        return {node.path: node.text()}
    return {key: value for child in node.value.values() for key, value in leaves(child).items()}


Found = tuple[Keys, str, str]
"""A fault: key path ("body", "regions", "heater"), what is wrong, what to do."""


def located(study: Study, faults: Sequence[Found]) -> list[Problem]:
    """The faults with file, line and column of their keys, or of the deepest key on the way that the study has."""
    if not faults:
        return []
    errors = Collector()
    root = tree_of(study, errors)
    for keys, what, remedy in faults:
        errors.at(root.nearest(*keys), what, remedy)
    return sorted(errors.problems, key=lambda problem: (problem.line, problem.column))
