"""Numbers, failed points and tables as text: few digits, SI prefixes, columns that fit."""

from __future__ import annotations

import math
import re
import textwrap
import unicodedata
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass
from decimal import ROUND_CEILING, ROUND_FLOOR, Context
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tcstudy.data.files import without_paths
from tcstudy.data.schema import PointStatus
from tcstudy.errors import NUMBER, ranged
from tcstudy.reports.symbols import GREEK

# -- numbers and units

RAISED = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")


def pretty(units: str) -> str:
    """Return units with raised exponents, "W m⁻² K⁻¹"; "" for a plain number."""
    if units == "1":
        return ""
    return re.sub(r"(?<=[A-Za-z])-?\d+", lambda power: power[0].translate(RAISED), units)


def number(value: float, digits: int = 4) -> str:
    """Return a number with few digits for a table, "–" for a missing one."""
    value = float(value)
    if math.isnan(value):
        return "–"
    if math.isinf(value):
        return "∞" if value > 0 else "−∞"
    text = f"{value:.{digits}g}"
    # 410, not 4.1e+02
    if "e+0" in text and abs(value) < 1e4:
        return f"{float(text):.0f}"
    return text


def in_sentences(remark: str) -> str:
    """Return the lines of a warning as sentences of one paragraph."""
    *lines, remedy = (line.strip() for line in remark.split("\n"))
    ended = (line if line.endswith((".", ":")) else f"{line}." for line in lines)
    return " ".join([*ended, remedy])


def counted(number: int, noun: str) -> str:
    """Return a number with its noun: 1 point, 2 points."""
    return f"{number} {noun}" if number == 1 else f"{number} {noun}s"


def span(seconds: float) -> str:
    """Return a duration, "8 s", "2 min 5 s" or "3.5 h"."""
    whole_seconds = max(0, round(seconds))
    if whole_seconds >= 7200:
        return f"{whole_seconds / 3600:.2g} h"
    if whole_seconds >= 90:
        return f"{whole_seconds // 60} min {whole_seconds % 60} s"
    return f"{whole_seconds} s"


LETTERS = GREEK | {"xi": "ξ"}


def spelled(text: str) -> str:
    """Return words of a file with Greek letters in place of their names: λ₁ of lambda_1."""
    text = text.replace("lambda_1", "λ₁")
    names = r"\b(lambda|omega|theta|xi)(?![A-Za-z])"
    return re.sub(names, lambda name: LETTERS[name[0]], text)


MAX_ROUNDING = 1e-12
"""Relative difference up to which two values are equal: 0.1 + 0.2 is shown as 0.3."""
MAX_DIGITS = 15
"""Digits that every number in double precision keeps."""


def label(value: float, digits: int = 4) -> str:
    """Return a value that someone chose, with more digits where these make it a rounder number.

    ν = 0.4999999 must not look like the bound 0.5, and 1000.4 not like 1000. 17.7827… is 17.78.
    """
    if not math.isfinite(value):
        return number(value)
    for count in range(digits, MAX_DIGITS):
        text = f"{value:.{count}g}"
        mantissa = text.split("e")[0].lstrip("-0.").replace(".", "")
        is_exact = abs(float(text) - value) <= MAX_ROUNDING * abs(value)
        if len(mantissa.rstrip("0")) > count - 2 or is_exact:
            return text
    return f"{value:.{MAX_DIGITS}g}"


def labels(values: Sequence[float | str], digits: int = 4) -> list[str]:
    """Return the values of a parameter, with enough digits to tell different ones apart."""
    numbers = [value for value in values if not isinstance(value, str)]
    distinct = len(set(numbers))
    while digits < MAX_DIGITS and len({label(value, digits) for value in numbers}) < distinct:
        digits += 1
    return [value if isinstance(value, str) else label(value, digits) for value in values]


PREFIXES = ((1e9, "G"), (1e6, "M"), (1e3, "k"), (1.0, ""), (1e-3, "m"), (1e-6, "µ"), (1e-9, "n"))
POWER_FIRST = re.compile(r"[A-Za-z]+-?\d")
"""Units that begin with a power, K-1: a prefix would be raised to it as well."""


def prefix(values: ArrayLike, units: str) -> tuple[float, str]:
    """Return (divisor, units with a prefix) that bring the largest magnitude to 1 … 1000.

    Units that a prefix does not suit stay as they are: "1", "K", "s", and those of POWER_FIRST.
    """
    # an array, as a long sweep has a million numbers
    sizes = np.abs(np.asarray(values, dtype=float).ravel())
    largest = float(np.max(sizes, initial=0.0, where=np.isfinite(sizes)))
    if largest == 0.0 or units in ("1", "K", "s") or POWER_FIRST.match(units):
        return 1.0, units
    # what four digits round up to the next unit is shown in it: 1 mm, not 1000 µm
    rounded = float(f"{largest:.4g}")
    divisor, letter = next((row for row in PREFIXES if rounded >= row[0]), PREFIXES[-1])
    return divisor, letter + units


def axis_unit(values: Iterable[float], units: str) -> tuple[float, str]:
    """Return `prefix` of the values; a plain number far from 1 gets a power of ten, "10⁻⁵"."""
    largest = max((abs(float(value)) for value in values), default=0.0)
    if units != "1" or largest == 0.0 or 1e-2 <= largest < 1e4:
        return prefix([largest], units)
    power = math.floor(math.log10(largest))
    return 10.0**power, f"10{str(power).translate(RAISED)}"


def with_unit(value: float, units: str, digits: int = 4) -> str:
    """Return a number with the prefix that suits it: 12.5 mm."""
    divisor, unit = prefix([value], units)
    return f"{number(float(value) / divisor, digits)} {pretty(unit)}".rstrip()


def enclosing(low: float, high: float, units: str, digits: int = 4) -> tuple[str, str]:
    """Return both ends of a range in one unit, rounded outwards: 4.111 MPa, 4.113 MPa."""
    divisor, unit = prefix([max(abs(low), abs(high))], units)
    context = Context(prec=digits)
    ends = []
    for end, rounding in ((low, ROUND_FLOOR), (high, ROUND_CEILING)):
        context.rounding = rounding
        scaled = f"{float(end) / divisor:.13g}"  # a prefix rounds by less
        ends.append(float(context.create_decimal(scaled)))
    first, second = (f"{number(end, digits)} {pretty(unit)}".rstrip() for end in ends)
    return first, second


def between(low: float, high: float, units: str, digits: int = 4) -> str:
    """Return a range in the unit of its larger end, "2.88 to 200 mm".

    Ends that read the same are one number.
    """
    divisor, unit = prefix([max(abs(low), abs(high))], units)
    ends = [number(float(end) / divisor, digits) for end in (low, high)]
    return f"{' to '.join(dict.fromkeys(ends))} {pretty(unit)}".rstrip()


def headed(name: str, unit: str) -> str:
    """Return the heading of a column, with its unit if it has one."""
    return f"{name} [{pretty(unit)}]" if pretty(unit) else name


def study_unit(attrs: Mapping[str, Any]) -> tuple[float, str] | None:
    """Return (divisor, unit) in which a study writes the values of a swept parameter.

    None if it writes them in SI units, or in several units.
    """
    if "study_unit" not in attrs:
        return None
    return float(attrs["study_unit_size"]), str(attrs["study_unit"])


def scaled_labels(
    values: Sequence[float | str], attrs: Mapping[str, Any], digits: int = 4
) -> tuple[list[str], str]:
    """Return (`labels`, unit) of a swept parameter whose coordinate has these attributes.

    The unit is that of the study, else one with an SI prefix where that spares powers of ten:
    2e+06 Pa is 2 MPa.
    """
    numbers = [value for value in values if not isinstance(value, str)]
    written_unit = study_unit(attrs)
    if written_unit is not None:
        divisor, unit = written_unit
        return labels([value / divisor for value in numbers], digits), unit
    unscaled = labels(values, digits), str(attrs.get("units", "1"))
    has_expressions = len(numbers) < len(values)  # they are in the unit without a prefix
    if has_expressions or not _have_powers(unscaled[0]):
        return unscaled
    divisor, unit = prefix(numbers, unscaled[1])
    scaled = labels([value / divisor for value in numbers], digits)
    return unscaled if _have_powers(scaled) else (scaled, unit)


def _have_powers(texts: Iterable[str]) -> bool:
    return any("e" in text for text in texts)


EQUAL = 1e-9
"""Numbers that differ by this part of the largest are equal but for rounding."""


def first_largest(sizes: NDArray[np.float64]) -> tuple[int, ...]:
    """Return the index of the first number that is the largest but for rounding; NaN is none."""
    comparable = np.where(np.isnan(sizes), -np.inf, sizes)
    largest = float(comparable.max())
    slack = EQUAL * abs(largest) if math.isfinite(largest) else 0.0
    place = int(np.argmax(comparable >= largest - slack))
    return tuple(int(i) for i in np.unravel_index(place, sizes.shape))


# -- proofs

PROOFS = (("unique", "unique"), ("global_minimum", "global"), ("strict_minimum", "local"))
"""Flags of a solution in the file, the strongest first, and their words."""


def proved(flags: Any, prefix: str = "", none: str = "nothing") -> str:
    """Return the strongest property that is proved of a solution.

    prefix: of the names of its flags
    """
    for name, word in PROOFS:
        if int(flags[prefix + name]) == 1:
            return word
    return none


LAMBDA_1_TOLERANCE = 1e-6
"""Relative error of λ₁ above which it is shown, and proofs take the body softer."""


def digits_lost(error: float) -> str:
    """Return what a relative error of λ₁ means; "" where λ₁ has six digits."""
    if not error > LAMBDA_1_TOLERANCE:
        return ""
    return (
        f"λ₁ holds to {number(error, 2)} only: rounding takes its digits, as it is far below the "
        "largest stiffness of the body (a body on soft springs alone, or stiff springs or "
        "materials beside soft ones); every proof reduces the stiffness by as much"
    )


# -- failures

_REMEDIES = {
    PointStatus.NOT_CONVERGED: "try the other solver",
    PointStatus.INCLUSION_VIOLATED: "raise solver.tolerance, check the units, or coarsen the mesh",
    PointStatus.SINGULAR: "check that the supports restrain the body and the material is elastic",
    PointStatus.MESH_FAILED: "change mesh.maxh, and look at the body for slits and slivers",
    PointStatus.ERROR: (
        "run the study again, which repeats these points; if it stays, it is a fault of the program"
    ),
}
"""What to try where a reason names no remedy."""

FailedSolution = tuple[PointStatus, str, str, int]
"""Status, reason as stored, the point in words, the number of the point."""


def kind(status: PointStatus, reason: str) -> tuple[PointStatus, str]:
    """Return what failures of the same cause share: status and reason without its numbers."""
    return status, NUMBER.sub("#", without_paths(reason))


def named(status: PointStatus) -> str:
    """Return the status in words."""
    return status.name.lower().replace("_", " ")


@dataclass(frozen=True)
class Failure:
    """Failures of one kind.

    cause:  status and reason, with the ranges of its numbers, and a point
    remedy: "" if none is known
    points: numbers of the points that failed like this
    """

    cause: str
    remedy: str
    points: tuple[int, ...]


def failure_kinds(failures: Iterable[FailedSolution]) -> list[Failure]:
    """Return the failures by their kind, the most frequent first."""
    groups: dict[tuple[PointStatus, str], list[tuple[str, str, int]]] = {}
    for status, reason, words, point in failures:
        row = without_paths(reason), words, point
        groups.setdefault(kind(status, reason), []).append(row)
    kinds = [_failure(status, rows) for (status, _), rows in groups.items()]
    return sorted(kinds, key=lambda failure: -len(failure.points))


def _failure(status: PointStatus, rows: Sequence[tuple[str, str, int]]) -> Failure:
    """Return the failures of one kind, from their rows (reason, point in words, its number)."""
    reason = ranged([text for text, _, _ in rows]).rstrip(". ")
    cause, _, remedy = reason.partition("; ")
    # a reason of the house ends in its own remedy, an unexpected exception has none
    if status in _REMEDIES and (not remedy or status == PointStatus.ERROR):
        cause, remedy = reason, _REMEDIES[status]
    name = named(status)
    cause = name if cause in ("", name) else f"{name}: {cause}"
    words = rows[0][1]
    if words:
        cause += f" (for example {words})" if len(rows) > 1 else f" ({words})"
    points = tuple(dict.fromkeys(point for _, _, point in rows))
    return Failure(cause, remedy, points)


def failure_lines(failures: Iterable[FailedSolution], noun: str = "point") -> list[str]:
    """Return one line for each kind of failure: how many points, the cause, the remedy."""
    lines = list[str]()
    for failure in failure_kinds(failures):
        points = counted(len(failure.points), noun)
        remedy = f"; {failure.remedy}" if failure.remedy else ""
        lines.append(f"{points} failed: {failure.cause}{remedy}")
    return lines


# -- parts of a report

WIDTH = 110
"""Characters of a line of running text where the width of the terminal is not known."""


@dataclass(frozen=True)
class TextColumn:
    """A column of a table: a heading and its cells.

    rank:  where there is no room for all columns, those of the highest rank are hidden first
    notes: lines below the table that tell what the column means; hidden with it
    """

    title: str
    cells: Sequence[str]
    rank: int = 0
    notes: tuple[str, ...] = ()

    @property
    def lines(self) -> tuple[str, ...]:
        """The heading and the cells."""
        return (self.title, *self.cells)


def quantity(
    title: str,
    values: Any,
    units: str = "1",
    digits: int = 4,
    rank: int = 0,
    like: Any = None,
    notes: tuple[str, ...] = (),
) -> TextColumn:
    """Return a column of numbers, with the prefix that suits them, or the values `like` them."""
    divisor, unit = prefix(values if like is None else like, units)
    cells = [number(value / divisor, digits) for value in values]
    return TextColumn(headed(title, unit), cells, rank, notes)


@dataclass(frozen=True)
class Table:
    """Columns of equal length under a caption; `notes` stand below, before those of columns."""

    caption: str
    columns: Sequence[TextColumn]
    notes: tuple[str, ...] = ()

    @classmethod
    def of_rows(
        cls,
        caption: str,
        header: Sequence[str],
        rows: Iterable[Sequence[str]],
        ranks: Sequence[int] = (),
        *notes: str,
    ) -> Table:
        """Return the table of rows; without ranks, columns are hidden from the right."""
        cells = list(zip(*rows, strict=True)) or [()] * len(header)
        columns = map(TextColumn, header, cells, ranks or range(len(header)))
        return cls(caption, list(columns), notes)


@dataclass(frozen=True)
class Heading:
    """A line of text between tables; level 1 is the title."""

    text: str
    level: int = 2


def facts_by_label(lines: Iterable[tuple[str, str]]) -> dict[str, tuple[str, ...]]:
    """Return the texts of lines (label, text) by label in lower case, without empty ones."""
    facts = dict[str, tuple[str, ...]]()
    for label, text in lines:
        if text:
            key = label.lower().replace(" ", "_")
            facts[key] = (*facts.get(key, ()), text)
    return facts


VERDICT_LABELS = ("answer", "cycles", "trust", "accuracy", "solved", "reason", "fix")
"""Labels in the order in which they are read."""


@dataclass(frozen=True)
class Verdict:
    """The first lines of a report on a result file: a few facts under each label.

    complete: whether the file has everything that was requested. Where it has a reason why not,
              `solved` comes first.
    """

    answer: tuple[str, ...] = ()
    cycles: tuple[str, ...] = ()
    trust: tuple[str, ...] = ()
    accuracy: tuple[str, ...] = ()
    solved: tuple[str, ...] = ()
    reason: tuple[str, ...] = ()
    fix: tuple[str, ...] = ()
    complete: bool = True

    @classmethod
    def of_lines(cls, lines: Iterable[tuple[str, str]], complete: bool = True) -> Verdict:
        """Return the verdict of lines (label, text)."""
        return cls(**facts_by_label(lines), complete=complete)

    @property
    def fields(self) -> dict[str, tuple[str, ...]]:
        """The facts by label, in reading order; labels without a fact are left out."""
        first = ("solved", "reason", "fix") if any(self.reason) else ()
        labels = dict.fromkeys((*first, *VERDICT_LABELS))
        facts = {label: tuple(filter(None, getattr(self, label))) for label in labels}
        return {label: texts for label, texts in facts.items() if texts}

    @property
    def lines(self) -> list[tuple[str, str]]:
        """The facts with their labels, for `labelled`."""
        fields = self.fields.items()
        return [(label.capitalize(), fact) for label, facts in fields for fact in facts]

    @property
    def sentence(self) -> str:
        """The facts in one line, a sentence for each label."""
        return answered(*self.fields.values())


def answered(*sentences: Iterable[str]) -> str:
    """Return sentences of the parts that are not empty, each with a capital and a full stop."""
    texts = ["; ".join(filter(None, parts)) for parts in sentences]
    return " ".join(f"{text[0].upper()}{text[1:]}." for text in texts if text)


Part = Table | Heading | Verdict | str
"""A part of a report. A text that begins with two blanks is a block of lines."""

# -- plain text

_LINE_OF_WORDS = re.compile(r" *[^ ─]+(?: [^ ]+)+$")
"""A line of words; columns of a table are two spaces or more apart."""
_width: ContextVar[int | None] = ContextVar("width", default=None)
"""Characters of a line; None: tables are as wide as they are."""


@contextmanager
def fitting(width: int | None) -> Iterator[None]:
    """Fit plain text into lines of `width` characters inside a `with`; None: do not fit."""
    token = _width.set(width)
    try:
        yield
    finally:
        _width.reset(token)


def render(parts: Iterable[Part]) -> str:
    """Return all parts as text."""
    return "\n\n".join(map(_text, parts)) + "\n"


def _text(part: Part) -> str:
    if isinstance(part, Heading):
        return part.text if part.level == 1 else f"{part.text}\n{'─' * len(part.text)}"
    if isinstance(part, Verdict):
        return labelled(part.lines)
    if isinstance(part, Table):
        return _table_text(part)
    if part.startswith("  "):
        return wrapped(part)
    return _filled(part, min(WIDTH, _width.get() or WIDTH), "  ")


def _table_text(table: Table) -> str:
    """Return the caption, the columns for which there is room, and the notes of a table."""
    columns, hidden = _with_room(table.columns)
    lines = [wrapped(f"  {table.caption}"), ""] if table.caption else []
    lines += [_aligned(columns), *_hidden_line(hidden)]
    lines += [wrapped(f"  {note}") for note in table.notes]
    meanings = column_notes(columns)
    if meanings:
        lines.append("")
        lines += [wrapped(f"  {note}") for note in meanings]
    return "\n".join(lines)


def column_notes(columns: Sequence[TextColumn]) -> list[str]:
    """Return what columns mean, each note once."""
    return list(dict.fromkeys(note for column in columns for note in column.notes))


def _filled(text: str, width: int, indent: str) -> str:
    return textwrap.fill(
        text, width, subsequent_indent=indent, break_long_words=False, break_on_hyphens=False
    )


MAX_LABELLED_WIDTH = 80
"""Characters of a labelled line."""
LABEL_WIDTH = 10
"""Characters of the column of its label."""


def labelled(lines: Iterable[tuple[str, str]]) -> str:
    """Return a block of lines (label, text) with the labels in a column of their own.

    An empty text is left out. A label is printed once for lines of the same label that follow each
    other. Lines that are too long continue below their text.
    """
    width = min(MAX_LABELLED_WIDTH, _width.get() or MAX_LABELLED_WIDTH)
    block, label_before = list[str](), ""
    for label, text in lines:
        if not text:
            continue
        new_label = "" if label == label_before else label
        first_indent = f"  {new_label:<{LABEL_WIDTH}}"
        next_indent = " " * len(first_indent)
        block += textwrap.wrap(
            text,
            width,
            initial_indent=first_indent,
            subsequent_indent=next_indent,
            break_long_words=False,
            break_on_hyphens=False,
        )
        label_before = label
    return "\n".join(block)


def wrapped(text: str) -> str:
    """Return the text with its lines of words filled to the width; lines of tables stay."""
    width = _width.get()
    if width is None:
        return text
    lines = list[str]()
    for line in text.split("\n"):
        lines.append(_filled(line, width, "    ") if _LINE_OF_WORDS.match(line) else line)
    return "\n".join(lines)


def columns_table(columns: Sequence[TextColumn]) -> str:
    """Return plain text: columns of numbers aligned right, others left.

    Where the width is too small, headings are wrapped. Where that is not enough, the columns of the
    highest ranks are hidden, those of rank 0 never, and a line names the hidden ones.
    """
    shown_columns, hidden = _with_room(columns)
    return "\n".join([_aligned(shown_columns), *_hidden_line(hidden)])


def _with_room(columns: Sequence[TextColumn]) -> tuple[list[TextColumn], list[str]]:
    """Return the columns that are shown, and the headings of the hidden ones."""
    remaining, hidden = list(columns), list[str]()
    while not fits(remaining):
        least_important = max(range(len(remaining)), key=lambda i: (remaining[i].rank, i))
        if remaining[least_important].rank == 0:
            break
        hidden.append(remaining.pop(least_important).title)
    return remaining, hidden


def _hidden_line(hidden: Sequence[str]) -> list[str]:
    if not hidden:
        return []
    names = ", ".join(dict.fromkeys(hidden))
    return [wrapped(f"  hidden columns: {names} (show with -v)")]


def fits(columns: Sequence[TextColumn]) -> bool:
    """Return whether all columns have room, with their headings wrapped if need be."""
    return sum(_min_width(column) + 2 for column in columns) <= (_width.get() or math.inf)


_UNIT = re.compile(r"\[[^]]*\]")
_NO_BREAK = "\u00a0"


def _heading_words(title: str) -> list[str]:
    """Return the words of a heading; its unit is one word."""
    joined = _UNIT.sub(lambda unit: unit[0].replace(" ", _NO_BREAK), title)
    return [word.replace(_NO_BREAK, " ") for word in joined.split(" ")]


def _characters(text: str) -> int:
    """Return how wide a text is on a terminal; the bar of θ̄ stands above its letter."""
    return sum(not unicodedata.combining(letter) for letter in text)


def _min_width(column: TextColumn) -> int:
    """Return the width of a column whose heading has a line for each word."""
    return max(map(_characters, (*_heading_words(column.title), *column.cells)))


def _heading_lines(column: TextColumn, width: int) -> list[str]:
    """Return the lines of a heading, each no wider than the column."""
    lines = [""]
    for word in _heading_words(column.title):
        longer = f"{lines[-1]} {word}".lstrip(" ")
        if _characters(longer) <= width:
            lines[-1] = longer
        else:
            lines.append(word)
    return lines if lines[0] else lines[1:]


def _widths(columns: Sequence[TextColumn]) -> list[int]:
    """Return the widths of columns, with headings in as few lines as there is room for."""
    full_widths = [max(map(_characters, column.lines)) for column in columns]
    room = (_width.get() or math.inf) - 2 * len(columns)
    if sum(full_widths) <= room:
        return full_widths
    widths = [_min_width(column) for column in columns]
    while True:
        headings = map(_heading_lines, columns, widths)
        heights = [len(lines) for lines in headings]
        highest = max(range(len(columns)), key=heights.__getitem__)
        if heights[highest] == 1 or sum(widths) >= room:
            return widths
        widths[highest] += 1


def _aligned(columns: Sequence[TextColumn]) -> str:
    """Return the lines of a table; columns in which every cell looks like a number stand right."""
    widths = _widths(columns)
    headings = list(map(_heading_lines, columns, widths))
    height = max(map(len, headings))
    blocks = list[list[str]]()
    for column, width, heading in zip(columns, widths, headings, strict=True):
        lines = [*[""] * (height - len(heading)), *heading, *column.cells]
        is_right = all(map(_looks_like_number, column.cells))
        blocks.append([_padded(line, width, is_right) for line in lines])
    rows = [f"  {'  '.join(cells).rstrip()}" for cells in zip(*blocks, strict=True)]
    rule = "  " + "─" * (sum(widths) + 2 * len(widths) - 2)
    return "\n".join([*rows[:height], rule, *rows[height:]])


def _looks_like_number(cell: str) -> bool:
    """Return whether a cell is a number, alone or in parentheses, or empty."""
    return not cell or cell[0].isdigit() or cell[0] in "-+–∞−("


def _padded(text: str, width: int, is_right: bool) -> str:
    """Return the text filled to a width with blanks before it, or behind."""
    blanks = " " * (width - _characters(text))
    return blanks + text if is_right else text + blanks
