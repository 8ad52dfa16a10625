"""Errors of the user: where in which file, what is wrong, what to do. Only these are shown without a traceback."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass


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
        place = f"{self.file}:{self.line}:{self.column}" if self.line else self.file
        key = f"{self.key}: " if self.key else ""
        return f"{place}: {key}{self.what}; {self.remedy}"


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
