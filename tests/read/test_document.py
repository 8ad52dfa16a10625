"""YAML text to marked nodes, values put at paths, and `--set` options."""

import pytest

from tcstudy.errors import Problem, StudyError
from tcstudy.read.document import Collector, Mark, Node, apply_overrides, compose, put


def tree(text: str) -> Node:
    errors = Collector()
    root = compose(text, "a.yaml", errors)
    assert not errors.problems
    return root


def first_problem(text: str) -> Problem:
    errors = Collector()
    try:
        compose(text, "a.yaml", errors)
    except StudyError as error:
        return error.problems[0]
    return errors.problems[0]


def test_scalars_are_those_of_yaml_1_2() -> None:
    texts = "1e-3", "0x1F", "1_000", "-.inf", "no", "2001-01-01", "!!str 5", "true", "~"
    values = tree(f"[{', '.join(texts)}]").plain()
    assert repr(values) == repr(
        [1e-3, 31, 1000, float("-inf"), "no", "2001-01-01", "5", True, None]
    )


@pytest.mark.parametrize(
    ("text", "line", "column", "part"),
    [
        ("a: [1", 1, 6, "YAML syntax"),
        ("{a.b[0].c: [1]}", 1, 5, 'needs quotes: "a.b[0].c"'),
        ("a: *x", 1, 4, "undefined alias"),
        ("x: 1\na: \x07", 2, 4, "not allowed in YAML"),
        ("a: 1\nb: 2\na: 3", 3, 1, "given twice (first in line 1)"),
        ("a: !foo 3", 1, 4, "!foo is not supported"),
        ("a: !!int x", 1, 4, "'x' is not a number"),
        ("? [a]\n: b", 1, 3, "a key must be one word"),
        ("<<: {a: 1}", 1, 1, "merge keys are not supported"),
        ("a: &a [*a]", 1, 4, "an alias contains itself"),
        ("a: 1\nb:\n  " + "[" * 99 + "]" * 99, 3, 43, "nested too deeply"),
        ("".join(" " * i + "-\n" for i in range(99)), 42, 42, "nested too deeply"),
        ("", 0, 0, "the file is empty"),
        ("a: " + "9" * 5000, 1, 4, "at most 2000 are read"),
    ],
)
def test_faults_of_the_text(text: str, line: int, column: int, part: str) -> None:
    problem = first_problem(text)
    assert (problem.line, problem.column) == (line, column)
    assert part in f"{problem.what}; {problem.remedy}"
    assert problem.remedy


def test_halves_of_characters_are_joined_or_refused() -> None:
    assert tree(r'{"\ud83d\ude00": "a \ud83d\ude00"}').plain() == {"😀": "a 😀"}
    for text, place in (
        (r'{a: 1, b: "\ud83d"}', (1, 11)),
        ('a: 1\n"\\ude00": 2', (2, 1)),
        (r'a: "\ud83d \ude00"', (1, 4)),
        (r'a: "\UFFFFFFFF"', (1, 5)),
        (r'a: "\U00110000"', (1, 5)),
    ):
        problem = first_problem(text)
        assert (problem.line, problem.column) == place
        assert "write the character itself" in problem.remedy


def test_an_option_of_json_is_the_same_tree_as_one_of_yaml() -> None:
    texts = (
        '{"a": [1, 2.5, "x", null, true], "b": {"c": 1e3}}',
        "{a: [1, 2.5, x, null, true], b: {c: 1e3}}",
    )
    one, other = (compose(text, "--set s", Collector(), "s", option=True) for text in texts)
    assert [repr(node) for node in one.all()] == [repr(node) for node in other.all()]
    errors = Collector()
    compose('{"a": 1, "a": 2}', "--set s", errors, "s", option=True)
    assert "given twice" in errors.problems[0].what


def test_aliases_cannot_explode(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("tcstudy.read.document.MAX_NODES", 5000)
    lines = ["a0: &a0 [1, 1, 1, 1, 1, 1, 1, 1, 1, 1]"]
    lines += [f"a{i + 1}: &a{i + 1} [{', '.join([f'*a{i}'] * 10)}]" for i in range(8)]
    assert "too large" in first_problem("\n".join(lines)).what


def test_put_writes_words_out_that_stand_for_mappings() -> None:
    root = tree(
        "boundary: {top: convection, left: clamped, right: {role: clamped, u_x: 1}}\nsolver: bundle-newton\n"
    )
    for keys, made in (
        (("solver", "tolerance"), {"name": "bundle-newton", "tolerance": 5}),
        (("boundary", "top", "pressure"), {"role": "convection", "pressure": 5}),
        # clamped means u = 0: one prescribed component must not set the other one free
        (("boundary", "left", "u_y"), {"role": "clamped", "u_x": 0, "u_y": 5}),
        (("boundary", "right", "u_y"), {"role": "clamped", "u_x": 1, "u_y": 5}),
    ):
        assert put(root, keys, tree("5")).nearest(*keys[:-1]).plain() == made


def test_overrides() -> None:
    errors, root = Collector(), tree("a: {b: 1}\nc: {d: 3}\n")
    root = apply_overrides(
        root, ["a.b=[1, 2 mm]", "s=1e-3", "c=null", "e.f.g = text"], {"s": "a.s"}, errors
    )
    assert not errors.problems
    assert root.plain() == {"a": {"b": [1, "2 mm"], "s": 1e-3}, "e": {"f": {"g": "text"}}}
    node = root.nearest("a", "b", 1)
    assert (node.path, node.mark) == ("a.b[1]", Mark("--set a.b=[1, 2 mm]", 0, 0))
