"""Errors of the user: where in which file, what is wrong, what to do. Only these are shown without a traceback."""

from __future__ import annotations

import unicodedata
from collections.abc import Iterable
from dataclasses import dataclass

UNSEEN = {"Cc", "Cf", "Cs", "Co", "Cn", "Zl", "Zp"}
"""Unicode categories that print nothing, begin a line or steer a terminal."""
LONGEST_KEY, LONGEST_PART = 100, 400
"""Characters that a message shows of a key path or an option, and of each of its halves."""


def printable(text: str) -> str:
    """The text with escapes such as \\x1b in place of characters that are no sign."""
    if text.isascii() and text.isprintable():
        return text
    return "".join(c.encode("unicode_escape").decode() if unicodedata.category(c) in UNSEEN else c for c in text)


def shortened(text: str, most: int = 60) -> str:
    """The text, cut so that a message stays one readable line."""
    return text if len(text) <= most else text[: most - 3] + "..."


@dataclass(frozen=True)
class Problem:
    """One fault in a study.

    file:   the file as the user named it, or the `--set` option at fault
    line, column: both from 1; 0 where there is no line (options, unreadable files)
    key:    path of the key, e.g. "boundary.top.pressure"; empty for the file as a whole
    what:   what is wrong;  remedy: what to do
    """

    file: str
    line: int
    column: int
    key: str
    what: str
    remedy: str

    def __str__(self) -> str:
        """The line the user sees: `file:line:column: key: what; remedy`."""
        file = shortened(self.file, LONGEST_KEY) if self.file.startswith("--set ") else self.file
        place = f"{file}:{self.line}:{self.column}" if self.line else file
        key = f"{shortened(self.key, LONGEST_KEY)}: " if self.key else ""
        what, remedy = shortened(self.what, LONGEST_PART), shortened(self.remedy, LONGEST_PART)
        return printable(f"{place}: {key}{what}; {remedy}")


class StoreError(Exception):
    """Results cannot be kept or read; the text says why and what to do."""


class StudyError(Exception):
    """A study that cannot be run, with all its problems, sorted by line and without duplicates."""

    problems: tuple[Problem, ...]

    def __init__(self, problems: Iterable[Problem]) -> None:
        unique = dict.fromkeys(problems)
        self.problems = tuple(sorted(unique, key=lambda p: (p.line, p.column)))
        super().__init__(self.problems)

    def __str__(self) -> str:
        """One line for each problem."""
        return "\n".join(str(problem) for problem in self.problems)
