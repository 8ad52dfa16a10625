"""Tables and words as plain text that fits the terminal."""

from __future__ import annotations

import math
import re
import textwrap
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass
from typing import Any

from tcstudy.reports.text import headed, number, prefix

WIDTH = 110
"""Characters of a line of running text where no terminal says how wide it is."""


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


def quantity(title: str, values: Any, units: str = "1", digits: int = 4, rank: int = 0, like: Any = None) -> TextColumn:
    """A column of numbers under a heading with their unit, whose prefix suits them, or the values `like` them."""
    divisor, unit = prefix(values if like is None else like, units)
    return TextColumn(headed(title, unit), [number(value / divisor, digits) for value in values], rank)


@dataclass(frozen=True)
class Table:
    """Columns of equal length under a caption; `notes` stand below. A text that is indented is a block of lines."""

    caption: str
    columns: Sequence[TextColumn]
    notes: tuple[str, ...] = ()

    @classmethod
    def of_rows(
        cls, caption: str, header: Sequence[str], rows: Iterable[Sequence[str]], ranks: Sequence[int] = (), *notes: str
    ) -> Table:
        """The table by rows; without ranks columns go from the right, and the first one stays."""
        cells = list(zip(*rows, strict=True)) or [()] * len(header)
        return cls(caption, list(map(TextColumn, header, cells, ranks or range(len(header)))), notes)


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
    head = [wrapped(f"  {part.caption}"), ""] if part.caption else []
    return "\n".join([*head, columns_table(part.columns), *(wrapped(f"  {note}") for note in part.notes)])


def _filled(text: str, width: int, indent: str) -> str:
    return textwrap.fill(text, width, subsequent_indent=indent, break_long_words=False, break_on_hyphens=False)


def wrapped(text: str) -> str:
    """The text with its lines of words filled to the width; lines of tables stay."""
    width = _width.get()
    if width is None:
        return text
    return "\n".join(_filled(line, width, "    ") if _WORDS.match(line) else line for line in text.split("\n"))


def columns_table(columns: Sequence[TextColumn]) -> str:
    """Plain text: columns aligned right where every cell looks like a number, left otherwise.

    Where the width is too small for all, the highest ranks go first, those of 0 never, and a line says which went.
    """
    kept, gone = list(columns), list[str]()
    while sum(max(map(len, column.lines)) + 2 for column in kept) > (_width.get() or math.inf):
        last = max(range(len(kept)), key=lambda i: (kept[i].rank, i))
        if kept[last].rank == 0:
            break
        gone.append(kept.pop(last).title)
    text = _aligned(kept)
    return "\n".join([text, wrapped(f"  no room for {', '.join(gone)} (-v has all)")] if gone else [text])


def _aligned(columns: Sequence[TextColumn]) -> str:
    """A column is a number's, and aligned right, if every cell looks like one, alone, in parentheses or missing."""
    padded = []
    for column in columns:
        width = max(map(len, column.lines))
        right = all(not cell or cell[0].isdigit() or cell[0] in "-+–∞−(" for cell in column.cells)
        padded.append([line.rjust(width) if right else line.ljust(width) for line in column.lines])
    header, *rows = (f"  {'  '.join(cells).rstrip()}" for cells in zip(*padded, strict=True))
    return "\n".join([header, "  " + "─" * (sum(len(column[0]) + 2 for column in padded) - 2), *rows])
