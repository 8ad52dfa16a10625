"""Measure how the code of a package reads: sizes of statements, names, lines and docstrings.

`python -m tests.ruler` prints one row per package. The measures are crude: they show where to look.
"""

import ast
import io
import statistics
import tokenize
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

PACKAGE = Path(__file__).parents[1] / "tcstudy"
_VAGUE = (
    "own one found given said told what made kept whole rest other others more here now both known "
    "each every some last wrong asked wanted shown drawn left there it of at"
)
VAGUE_NAMES = frozenset(_VAGUE.split())
"""Names of variables that are no nouns: they do not say what the value is."""
LARGE_STATEMENT = 30
"""Tokens above which a statement does more than one thing."""
MAX_WIDTH = 100
"""Characters of a line, of code, text or comment."""
LAYOUT = {
    tokenize.COMMENT,
    tokenize.NL,
    tokenize.NEWLINE,
    tokenize.INDENT,
    tokenize.DEDENT,
    tokenize.ENCODING,
    tokenize.ENDMARKER,
}


@dataclass
class Measures:
    """What was counted in the files of a package."""

    statements: list[int] = field(default_factory=list)
    names: list[str] = field(default_factory=list)
    long_lines: list[str] = field(default_factory=list)
    first_sentences: list[int] = field(default_factory=list)

    @property
    def tokens_a_statement(self) -> float:
        return statistics.mean(self.statements)

    @property
    def large_statements(self) -> float:
        """Percentage of statements with more than LARGE_STATEMENT tokens."""
        return 100 * sum(n > LARGE_STATEMENT for n in self.statements) / len(self.statements)

    @property
    def vague_names(self) -> float:
        """Percentage of names that are no nouns."""
        return 100 * sum(name in VAGUE_NAMES for name in self.names) / len(self.names)

    @property
    def words_of_a_docstring(self) -> float:
        """Median of the words in the first paragraph of a docstring."""
        return statistics.median(self.first_sentences or [0])


def measure(path: Path, measures: Measures) -> None:
    """Add the counts of a file."""
    source = path.read_text(encoding="utf-8")
    tree = ast.parse(source)
    measures.names += stored_names(tree)
    measures.statements += statement_sizes(source, skipped_rows(tree))
    measures.first_sentences += docstring_sizes(tree)
    measures.long_lines += [
        f"{path.relative_to(PACKAGE)}:{number}"
        for number, line in enumerate(source.splitlines(), 1)
        if len(line) > MAX_WIDTH
    ]


def stored_names(tree: ast.AST) -> Iterator[str]:
    """Yield the names of variables and parameters, once for each place that sets them."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Name) and isinstance(node.ctx, ast.Store):
            yield node.id
        elif isinstance(node, ast.arg):
            yield node.arg


def skipped_rows(tree: ast.AST) -> set[int]:
    """Return the rows of imports and of texts that are statements, such as docstrings."""
    rows = set[int]()
    for node in ast.walk(tree):
        is_text = isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant)
        if is_text or isinstance(node, ast.Import | ast.ImportFrom):
            rows.update(range(node.lineno, (node.end_lineno or node.lineno) + 1))
    return rows


def statement_sizes(source: str, skipped: set[int]) -> Iterator[int]:
    """Yield the number of tokens of every statement outside the skipped rows."""
    size = 0
    for token in tokenize.generate_tokens(io.StringIO(source).readline):
        if token.type == tokenize.NEWLINE:
            if size:
                yield size
            size = 0
        elif token.type not in LAYOUT and token.start[0] not in skipped:
            size += 1


def docstring_sizes(tree: ast.AST) -> Iterator[int]:
    """Yield the words in the first paragraph of every docstring of a function."""
    for node in ast.walk(tree):
        if isinstance(node, ast.FunctionDef):
            text = ast.get_docstring(node)
            if text:
                yield len(text.split("\n\n")[0].split())


def by_package() -> dict[str, Measures]:
    """Return the measures of all packages; the files at the top are "top"."""
    measures = dict[str, Measures]()
    for path in sorted(PACKAGE.rglob("*.py")):
        name = path.relative_to(PACKAGE).parts[0] if path.parent != PACKAGE else "top"
        measure(path, measures.setdefault(name, Measures()))
    return measures


if __name__ == "__main__":
    for room, counts in sorted(by_package().items()):
        print(
            f"{room:12s} {counts.tokens_a_statement:5.1f} tokens a statement, "
            f"{counts.large_statements:4.1f} % over {LARGE_STATEMENT}, "
            f"{counts.vague_names:4.1f} % of names without a noun, "
            f"{len(counts.long_lines):3d} lines over {MAX_WIDTH}, "
            f"docstrings begin with {counts.words_of_a_docstring:.0f} words"
        )
