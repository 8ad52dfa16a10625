"""The order of the house: which room may use which, as data; who may speak to NGSolve, to the
terminal, to files."""

import ast
import sys
from collections import Counter
from collections.abc import Callable, Iterator
from functools import cache
from graphlib import TopologicalSorter
from pathlib import Path
from types import FrameType

import pytest

from tcstudy.cli import main
from tests.ruler import Measures, by_package, skipped_rows, statement_sizes, stored_names

PACKAGE = Path(__file__).parents[1] / "tcstudy"

ARROWS: dict[str, set[str]] = {
    **{room: set[str]() for room in ("errors", "expressions", "condense")},
    "laws": {"expressions"},
    "scene": {"expressions", "laws"},
    "shapes": {"scene"},
    "accuracy": {"laws", "scene", "shapes"},
    "contact": {"laws", "scene"},
    "executors": {"errors", "laws", "contact"},
    "exact": {"accuracy", "expressions", "laws", "scene", "shapes"},
    "read": {"errors", "exact", "expressions", "laws", "scene", "shapes"},
    "fem": {"errors", "expressions", "laws", "scene", "shapes"},
    "offline": {"condense", "errors", "expressions", "fem", "laws", "scene", "shapes", "contact"},
    "refine": {"accuracy", "exact", "expressions", "fem", "laws", "offline", "scene", "contact"},
    "data": {"errors", "scene"},
    "reports": {"accuracy", "data", "errors", "laws", "read", "scene", "shapes"},
}
"""What each room may import beside itself. `study` may use every room below it; the rest of the
package, all."""

BELOW_STUDY = {*ARROWS} - {"reports"}
NUMERICS = {*ARROWS} - {"errors", "scene", "read", "fem", "data", "reports"}
"""Rooms that never print, parse or touch files."""
SPEAKING = {"print", "input", "open", "eval", "exec"}
PRINTING = ("reports", "commands", "cli")
FILES = {
    path: path.relative_to(PACKAGE).parts[0].removesuffix(".py")
    for path in sorted(PACKAGE.rglob("*.py"))
}
"""The room of every file; a file at the top is a room of its own."""


@cache
def nodes(path: Path) -> list[ast.AST]:
    """The syntax tree of a file, its root first."""
    return [*ast.walk(ast.parse(path.read_text(encoding="utf-8")))]


def imported(path: Path) -> Iterator[tuple[str, int]]:
    """Modules that a file imports, wherever in it, with their lines."""
    for node in nodes(path):
        if isinstance(node, ast.Import):
            yield from ((alias.name, node.lineno) for alias in node.names)
        elif isinstance(node, ast.ImportFrom) and node.module:
            yield node.module, node.lineno
            if node.module == "tcstudy":
                yield from ((f"tcstudy.{alias.name}", node.lineno) for alias in node.names)


def wrong(
    judge: Callable[[str, str], bool], found: Callable[[Path], Iterator[tuple[str, int]]] = imported
) -> str:
    """Where a room imports, or calls, what it must not by the judgement of (room, name)."""
    places = ((path, room, *one) for path, room in FILES.items() for one in found(path))
    return "\n".join(
        f"{path}:{line}: {name}" for path, room, name, line in places if judge(room, name)
    )


def test_every_arrow_is_allowed_and_every_room_known() -> None:
    def forbidden(room: str, name: str) -> bool:
        allowed = BELOW_STUDY if room == "study" else ARROWS.get(room)
        parts = name.split(".")
        return (
            allowed is not None
            and parts[0] == "tcstudy"
            and len(parts) > 1
            and parts[1] not in {*allowed, room}
        )

    assert not wrong(forbidden)
    rooms = {room for path, room in FILES.items() if path.parent != PACKAGE}
    assert rooms - {"study", "commands"} == {*ARROWS} - {"errors"}


def test_no_files_need_each_other() -> None:
    """No circle of imports, late ones within functions included; those for type checkers alone do
    not count."""
    dotted = {
        path: ".".join(path.with_suffix("").relative_to(PACKAGE.parent).parts) for path in FILES
    }
    names = {path: name.removesuffix(".__init__") for path, name in dotted.items()}
    known = set(names.values())
    arrows: dict[str, set[str]] = {}
    for path, name in names.items():
        typing = (
            n
            for n in nodes(path)
            if isinstance(n, ast.If) and ast.unparse(n.test) == "TYPE_CHECKING"
        )
        typing_only = {node for one in typing for node in ast.walk(one)}
        used: set[str] = set()
        for node in nodes(path):
            if node not in typing_only and isinstance(node, ast.ImportFrom) and node.module:
                whole = {f"{node.module}.{alias.name}" for alias in node.names}
                used |= (whole & known) or ({node.module} & known)
        arrows[name] = used - {name}
    TopologicalSorter(arrows).prepare()  # names the circle, if there is one


REPORTS = ("", "terminal", "export", "figures", "page")
"""The rooms of reports, each of which may use those before it; the first is what is read and said
for all."""


@pytest.mark.parametrize("own", REPORTS)
def test_rooms_of_reports_use_those_before_them(own: str) -> None:
    files = {
        path: path.relative_to(PACKAGE / "reports").with_suffix("").parts[0]
        for path in (PACKAGE / "reports").rglob("*.py")
    }
    mine = [path for path, room in files.items() if (room if room in REPORTS else "") == own]
    names = [name for path in mine for name, _ in imported(path)]
    used = {name.split(".")[2] for name in names if name.startswith("tcstudy.reports.")}
    assert not used & {*REPORTS[REPORTS.index(own) + 1 :]}


def calls(path: Path) -> Iterator[tuple[str, int]]:
    """Built-in functions that a file calls by name."""
    for node in nodes(path):
        if isinstance(node, ast.Call) and isinstance(node.func, ast.Name):
            yield node.func.id, node.lineno


def test_commands_stand_behind_the_command_line_alone() -> None:
    """The public functions use what commands use, and no command."""
    assert not wrong(
        lambda room, name: name.startswith("tcstudy.commands") and room not in ("cli", "commands")
    )


def test_who_speaks_to_whom() -> None:
    assert not wrong(
        lambda room, name: name.split(".")[0] in ("ngsolve", "netgen") and room != "fem"
    )
    assert not wrong(lambda room, name: room in NUMERICS and name in SPEAKING, calls)
    assert not wrong(lambda room, name: name == "print" and room not in PRINTING, calls)


@pytest.mark.parametrize("room", sorted({*ARROWS} - {"errors"}))
def test_a_room_says_what_belongs_in_it(room: str) -> None:
    tree = nodes(PACKAGE / room / "__init__.py")[0]
    assert isinstance(tree, ast.Module)
    assert "Not here:" in (ast.get_docstring(tree) or "")


DOOR = ("api", "matrices")
"""The public door: its Study and ContactProblem stand for those of the rooms behind it, under the
name users know."""


def test_no_two_public_classes_share_a_name() -> None:
    inner = (node for path, room in FILES.items() if room not in DOOR for node in nodes(path))
    names = Counter(
        node.name
        for node in inner
        if isinstance(node, ast.ClassDef) and not node.name.startswith("_")
    )
    assert not [name for name, count in names.items() if count > 1]


BAR = {"tokens": 13.5, "large": 4.0, "vague": 1.2, "words": 18}
"""How large statements, and how vague names may be in every package (tests/ruler.py): mean tokens
of a statement, percentage of statements over 30 tokens, percentage of names without a noun, and
median of the words that begin a docstring."""
ABOVE_THE_BAR = {
    "expressions": {"vague": 2.7},  # the left side of an operator
    "laws": {"vague": 1.4},  # limits from the left
    "offline": {"vague": 1.5},
}
"""Values of packages that do not meet it yet. They may only fall."""
LOWER_BAR = {"tokens": 13.0, "large": 3.0}
WITHIN_THE_LOWER_BAR = ("accuracy", "commands", "exact", "executors", "refine", "reports")
"""Packages that were rewritten to read at the first reading, and the bar that they keep."""


def readings(measures: Measures) -> dict[str, float]:
    """Return the measures of a package under the names of BAR."""
    return {
        "tokens": measures.tokens_a_statement,
        "large": measures.large_statements,
        "vague": measures.vague_names,
        "words": measures.words_of_a_docstring,
    }


RULED = '''def double(other: float) -> float:
    """Return twice the value."""
    load = other + other
    return load
'''


def test_the_ruler_counts_tokens_names_and_words() -> None:
    tree = ast.parse(RULED)
    assert [*statement_sizes(RULED, skipped_rows(tree))] == [10, 5, 2]
    assert sorted(stored_names(tree)) == ["load", "other"]
    counts = Measures(statements=[10, 40], names=["own", "load"], first_sentences=[5])
    assert readings(counts) == {"tokens": 25.0, "large": 50.0, "vague": 50.0, "words": 5}


def test_code_reads_no_worse_than_the_bar() -> None:
    packages = by_package()
    above = []
    for package, measures in packages.items():
        limits = BAR | ABOVE_THE_BAR.get(package, {})
        if package in WITHIN_THE_LOWER_BAR:
            limits |= LOWER_BAR
        for name, value in readings(measures).items():
            if value > limits[name]:
                above.append(f"{package}: {name} {value:.2f}, at most {limits[name]}")
    long_lines = [line for measures in packages.values() for line in measures.long_lines]
    assert not above, "python -m tests.ruler prints all: " + "; ".join(above)
    assert not long_lines


FILES_OF_A_POINT = 64
"""Files of the package in which a run of one point executes functions; a scene pays only for what
it uses."""


def test_a_point_crosses_few_files(tmp_path: Path) -> None:
    """Run for the second time, so that what is made once on import does not count."""
    study = str(PACKAGE.parent / "configs" / "quickstart.yaml")
    entered: set[str] = set()

    def enter(frame: FrameType, event: str, _: object) -> None:
        if event == "call" and frame.f_code.co_filename.startswith(str(PACKAGE)):
            entered.add(frame.f_code.co_filename)

    for name in ("a.nc", "b.nc"):
        sys.setprofile(enter if name == "b.nc" else None)
        try:
            assert (
                main(
                    [
                        "run",
                        study,
                        "--set=sweep={}",
                        "--set=mesh.levels=1",
                        f"--output={tmp_path / name}",
                    ]
                )
                == 0
            )
        finally:
            sys.setprofile(None)
    assert len(entered) <= FILES_OF_A_POINT, sorted(entered)
