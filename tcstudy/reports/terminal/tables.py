"""Tables and words as plain text that fits the terminal."""

from __future__ import annotations

import math
import re
import textwrap
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass

WIDTH, WIDE = 110, 200
"""Characters of a line of running text; of a table that may be split, where no terminal says how wide it is."""


@dataclass(frozen=True)
class Table:
    """A table: caption, header and rows of equal length; `notes` stand below it. A text that is indented is a block
    of lines.

    ranks: as of `plain_table`
    """

    caption: str
    header: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    notes: tuple[str, ...] = ()
    ranks: tuple[int, ...] = ()


@dataclass(frozen=True)
class Heading:
    """A line of text between tables; level 1 is the title."""

    text: str
    level: int = 2


Part = Table | Heading | str

_WORDS = re.compile(r" *[^ ─]+(?: [^ ]+)+$")
"""A line of words; columns of a table are two spaces or more apart."""


_width: ContextVar[int | None] = ContextVar("width", default=None)


@contextmanager
def fitting(width: int | None) -> Iterator[None]:
    """For the time of a `with`, plain text fits lines of so many characters; None: tables are as wide as they are."""
    token = _width.set(width)
    try:
        yield
    finally:
        _width.reset(token)


def render(parts: Iterable[Part]) -> str:
    """All parts as text."""
    return "\n\n".join(map(_text, parts)) + "\n"


def _text(part: Part) -> str:
    if isinstance(part, Heading):
        return part.text if part.level == 1 else f"{part.text}\n{'─' * len(part.text)}"
    if isinstance(part, str):
        block = part.startswith("  ")
        return wrapped(part) if block else _filled(part, min(WIDTH, _width.get() or WIDTH), "  ")
    table = plain_table(part.header, part.rows, part.ranks)
    head = [wrapped(f"  {part.caption}"), ""] if part.caption else []
    return "\n".join([*head, table, *(wrapped(f"  {note}") for note in part.notes)])


def _filled(text: str, width: int, indent: str) -> str:
    return textwrap.fill(text, width, subsequent_indent=indent, break_long_words=False, break_on_hyphens=False)


def wrapped(text: str) -> str:
    """The text with its lines of words filled to the width; lines of tables stay."""
    width = _width.get()
    if width is None:
        return text
    return "\n".join(_filled(line, width, "    ") if _WORDS.match(line) else line for line in text.split("\n"))


@dataclass(frozen=True)
class TextColumn:
    """A heading, its cells, and how important it is: where there is no room for all, the highest ranks go first."""

    title: str
    cells: Sequence[str]
    rank: int = 0

    @property
    def lines(self) -> tuple[str, ...]:
        """The heading and the cells."""
        return (self.title, *self.cells)


def plain_table(header: Sequence[str], rows: Sequence[Sequence[str]], ranks: Sequence[int] = ()) -> str:
    """A table by rows; ranks of its columns, without which they go from the right, and the first one stays."""
    cells = zip(*rows, strict=True) if rows else [()] * len(header)
    return columns_table(list(map(TextColumn, header, cells, ranks or range(len(header)))))


def columns_table(columns: Sequence[TextColumn]) -> str:
    """Plain text: columns aligned right where every cell looks like a number, left otherwise.

    Where the width is too small for all, the highest ranks go first, those of 0 never, and a line says which went.
    """
    kept = list(range(len(columns)))
    while not fits([columns[i] for i in kept]):
        last = max(kept, key=lambda i: (columns[i].rank, i))
        if columns[last].rank == 0:
            break
        kept.remove(last)
    gone = [column.title for i, column in enumerate(columns) if i not in kept]
    text = _aligned([columns[i].lines for i in kept])
    return "\n".join([text, wrapped(f"  no room for {', '.join(gone)} (-v has all)")] if gone else [text])


def fits(columns: Sequence[TextColumn], otherwise: float = math.inf) -> bool:
    """Whether a table of all these columns has room; otherwise: characters of a line that is no terminal's."""
    return sum(max(map(len, column.lines)) + 2 for column in columns) <= (_width.get() or otherwise)


def split_table(columns: Sequence[TextColumn], labels: int) -> str:
    """All columns in as many tables as the width asks for, each with the first `labels` columns."""
    parts = list[list[TextColumn]]([[]])
    for column in columns[labels:]:
        if parts[-1] and not fits([*columns[:labels], *parts[-1], column], WIDE):
            parts.append([])
        parts[-1].append(column)
    return "\n\n".join(_aligned([column.lines for column in (*columns[:labels], *part)]) for part in parts)


def _aligned(cells: Sequence[Sequence[str]]) -> str:
    header, *rows = zip(*cells, strict=True)
    widths = [max(len(cell) for cell in column) for column in cells]
    right = [_numeric(column[1:]) for column in cells]
    lines = [
        "  " + "  ".join(c.rjust(w) if r else c.ljust(w) for c, w, r in zip(row, widths, right, strict=True)).rstrip()
        for row in (header, *rows)
    ]
    return "\n".join([lines[0], "  " + "─" * (sum(widths) + 2 * (len(widths) - 1)), *lines[1:]])


def _numeric(column: Sequence[str]) -> bool:
    """Whether every cell looks like a number, alone, in parentheses or missing; such columns are aligned right."""
    return all(not cell or cell[0].isdigit() or cell[0] in "-+–∞−(" for cell in column)
