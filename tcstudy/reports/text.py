"""Numbers and failed points in words: few digits and SI prefixes; failures by status and reason;
tables that fit."""

from __future__ import annotations

import math
import re
import textwrap
import unicodedata
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tcstudy.data.files import without_paths
from tcstudy.data.schema import PointStatus
from tcstudy.errors import NUMBER, ranged
from tcstudy.reports.symbols import GREEK

RAISED = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")


def pretty(units: str) -> str:
    """Units with raised exponents, "W m⁻² K⁻¹"; empty for a plain number."""
    if units == "1":
        return ""
    return re.sub(r"(?<=[A-Za-z])-?\d+", lambda power: power[0].translate(RAISED), units)


def number(value: float, digits: int = 4) -> str:
    """A number for a table: few digits, '–' for a missing one."""
    value = float(value)
    if math.isnan(value):
        return "–"
    if math.isinf(value):
        return "∞" if value > 0 else "−∞"
    rounded = f"{value:.{digits}g}"
    return (
        f"{float(rounded):.0f}" if "e+0" in rounded and abs(value) < 1e4 else rounded
    )  # 410, not 4.1e+02


def counted(number: int, noun: str) -> str:
    """A number with its noun: 1 point, 2 points."""
    return f"{number} {noun}" if number == 1 else f"{number} {noun}s"


def span(seconds: float) -> str:
    """A duration, "8 s", "2 min 5 s" or "3.5 h"."""
    whole = max(0, round(seconds))
    if whole >= 7200:
        return f"{whole / 3600:.2g} h"
    return f"{whole} s" if whole < 90 else f"{whole // 60} min {whole % 60} s"


def spelled(text: str) -> str:
    """Words of a file in which Greek letters stand for their names: λ₁ of lambda_1."""
    text = text.replace("lambda_1", "λ₁")
    return re.sub(
        r"\b(lambda|omega|theta|xi)(?![A-Za-z])", lambda name: (GREEK | {"xi": "ξ"})[name[0]], text
    )


EXACT = 1e-12
"""Relative difference that counts as the rounding of a value computed from others (0.1 + 0.2 is
shown as 0.3)."""
MOST_DIGITS = 15


def label(value: float, digits: int = 4) -> str:
    """A value that someone chose: `number`, with more digits where those few make a rounder number
    of it.

    ν = 0.4999999 must not look like the bound 0.5, and 1000.4 not like 1000; 17.7827… stays 17.78.
    """
    if not math.isfinite(value):
        return number(value)
    for count in range(digits, MOST_DIGITS):
        shown = f"{value:.{count}g}"
        kept = len(shown.split("e")[0].lstrip("-0.").replace(".", "").rstrip("0"))
        if kept > count - 2 or abs(float(shown) - value) <= EXACT * abs(value):
            return shown
    return f"{value:.{MOST_DIGITS}g}"


def labels(values: Sequence[float | str], digits: int = 4) -> list[str]:
    """Values of one parameter, with as many digits as tell different ones apart."""
    numbers = [value for value in values if not isinstance(value, str)]
    while digits < MOST_DIGITS and len({label(v, digits) for v in numbers}) < len(set(numbers)):
        digits += 1
    return [value if isinstance(value, str) else label(value, digits) for value in values]


PREFIXES = ((1e9, "G"), (1e6, "M"), (1e3, "k"), (1.0, ""), (1e-3, "m"), (1e-6, "µ"), (1e-9, "n"))


POWER_FIRST = re.compile(r"[A-Za-z]+-?\d")


def prefix(values: ArrayLike, units: str) -> tuple[float, str]:
    """(divisor, units with an SI prefix) that bring the largest magnitude of `values` to 1 … 1000.

    Units that a prefix does not suit stay as they are: "1", "K", "s" and those that begin with a
    power (K-1), to which it would be raised as well.
    """
    sizes = np.abs(
        np.asarray(values, dtype=float).ravel()
    )  # of a long sweep no list of a million numbers
    largest = float(np.max(sizes, initial=0.0, where=np.isfinite(sizes)))
    if largest == 0.0 or units in ("1", "K", "s") or POWER_FIRST.match(units):
        return 1.0, units
    # what four digits round up to the next unit is shown in it: 1 mm, not 1000 µm
    rounded = float(f"{largest:.4g}")
    divisor, letter = next((p for p in PREFIXES if rounded >= p[0]), PREFIXES[-1])
    return divisor, letter + units


def with_unit(value: float, units: str, digits: int = 4) -> str:
    """A number with the prefix that suits it: 12.5 mm."""
    divisor, unit = prefix([value], units)
    return f"{number(float(value) / divisor, digits)} {pretty(unit)}".rstrip()


def between(low: float, high: float, units: str, digits: int = 4) -> str:
    """Return a range in one unit, that of its larger end: "2.88 to 200 mm"; one number where both
    read the same."""
    divisor, unit = prefix([max(abs(low), abs(high))], units)
    ends = [number(float(end) / divisor, digits) for end in (low, high)]
    return f"{' to '.join(dict.fromkeys(ends))} {pretty(unit)}".rstrip()


def headed(name: str, unit: str) -> str:
    """The heading of a column, with its unit if there is one."""
    return f"{name} [{pretty(unit)}]" if pretty(unit) else name


PROOFS = (("unique", "unique"), ("global_minimum", "global"), ("strict_minimum", "local"))


def proved(at: Any, prefix: str = "", none: str = "nothing") -> str:
    """The strongest statement that is proved of a solution; prefix: of the names of its flags."""
    return next((word for name, word in PROOFS if int(at[prefix + name]) == 1), none)


DIGITS = 1e-6
"""Relative error of λ₁ above which it is shown beside it, and proofs take the body softer."""


def digits_lost(error: float) -> str:
    """What is said of a λ₁ that holds to this relative error only; empty where it has six
    digits."""
    if not error > DIGITS:
        return ""
    return (
        f"λ₁ holds to {number(error, 2)} only: rounding takes its digits, as it is far below the "
        "largest stiffness of the body (soft springs that alone hold it, or stiff springs or "
        "materials beside soft ones); every proof takes the body softer by as much"
    )


def study_unit(attrs: Mapping[str, Any]) -> tuple[float, str] | None:
    """(divisor, unit) in which a study writes the values of a swept parameter; None if it has SI
    units, or several."""
    return (
        (float(attrs["study_unit_size"]), str(attrs["study_unit"]))
        if "study_unit" in attrs
        else None
    )


def scaled_labels(
    values: Sequence[float | str], attrs: Mapping[str, Any], digits: int = 4
) -> tuple[list[str], str]:
    """(`labels`, unit) of a swept parameter: in the study's own unit, else with an SI prefix where
    that spares powers.

    attrs: of its coordinate; 2e+06 Pa is 2 MPa
    """
    numbers = [value for value in values if not isinstance(value, str)]
    if own := study_unit(attrs):
        return labels([value / own[0] for value in numbers], digits), own[1]
    shown, units = labels(values, digits), str(attrs.get("units", "1"))
    texts = len(numbers) < len(values)  # expressions are in the unit without a prefix
    if texts or not any("e" in one for one in shown):
        return shown, units
    divisor, unit = prefix(numbers, units)
    scaled = labels([value / divisor for value in numbers], digits)
    return (shown, units) if any("e" in one for one in scaled) else (scaled, unit)


_REMEDIES = {
    PointStatus.NOT_CONVERGED: "try the other solver",
    PointStatus.INCLUSION_VIOLATED: "raise solver.tolerance, check the units, or coarsen the mesh",
    PointStatus.SINGULAR: "check that the body is held and that the material is elastic",
    PointStatus.MESH_FAILED: "change mesh.maxh, and look at the body for slits and slivers",
    PointStatus.ERROR: "run the study again, which repeats these points; if it stays, it is a fault of the program",
}
"""What to try where a reason names no remedy of its own."""


def kind(status: PointStatus, reason: str) -> tuple[PointStatus, str]:
    """What failures of the same cause have in common: the status and the reason without its
    numbers."""
    return status, NUMBER.sub("#", without_paths(reason))


def named(status: PointStatus) -> str:
    """The status in words."""
    return status.name.lower().replace("_", " ")


@dataclass(frozen=True)
class Failure:
    """Failures of one kind.

    cause:  status and reason, with the ranges of its numbers, and a point;  remedy: empty if none is known
    points: numbers of the points that failed like this
    """

    cause: str
    remedy: str
    points: tuple[int, ...]


def failure_kinds(failures: Iterable[tuple[PointStatus, str, str, int]]) -> list[Failure]:
    """Return the failures by their kind, the most frequent first.

    failures: (status, reason as stored, the point in words, its number), a row for each solution
    """
    groups: dict[tuple[PointStatus, str], list[tuple[str, str, int]]] = {}
    for status, reason, words, point in failures:
        row = without_paths(reason), words, point
        groups.setdefault(kind(status, reason), []).append(row)
    kinds = list[Failure]()
    for (status, _), rows in groups.items():
        reason = ranged([text for text, _, _ in rows]).rstrip(". ")
        cause, _, remedy = reason.partition("; ")
        # a reason of the house ends in its own remedy, an unexpected exception has none
        if status in _REMEDIES and (not remedy or status == PointStatus.ERROR):
            cause, remedy = reason, _REMEDIES[status]
        cause = named(status) if cause in ("", named(status)) else f"{named(status)}: {cause}"
        points = tuple(dict.fromkeys(point for _, _, point in rows))
        if words := rows[0][1]:
            cause += f" ({'for example ' if len(rows) > 1 else ''}{words})"
        kinds.append(Failure(cause, remedy, points))
    return sorted(kinds, key=lambda kind: -len(kind.points))


def failure_lines(
    failures: Iterable[tuple[PointStatus, str, str, int]], noun: str = "point"
) -> list[str]:
    """Return one line for each kind of failure: how many points, the cause, the remedy."""
    lines = list[str]()
    for failure in failure_kinds(failures):
        points = counted(len(failure.points), noun)
        remedy = f"; {failure.remedy}" if failure.remedy else ""
        lines.append(f"{points} failed: {failure.cause}{remedy}")
    return lines


def axis_unit(values: Iterable[float], units: str) -> tuple[float, str]:
    """`prefix` of the largest magnitude; plain numbers that are very large or small get a power of
    ten, "10⁻⁵"."""
    largest = max((abs(float(v)) for v in values), default=0.0)
    if units != "1" or largest == 0.0 or 1e-2 <= largest < 1e4:
        return prefix([largest], units)
    power = math.floor(math.log10(largest))
    return 10.0**power, f"10{str(power).translate(RAISED)}"


WIDTH = 110
"""Characters of a line of running text where no terminal says how wide it is."""


@dataclass(frozen=True)
class TextColumn:
    """A heading, its cells, and how important it is: where there is no room for all, the highest
    ranks go first.

    notes: what the column means, lines below the table that stand there only with the column
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
    """A column of numbers under a heading with their unit, whose prefix suits them, or the values
    `like` them."""
    divisor, unit = prefix(values if like is None else like, units)
    return TextColumn(
        headed(title, unit), [number(value / divisor, digits) for value in values], rank, notes
    )


@dataclass(frozen=True)
class Table:
    """Columns of equal length under a caption; `notes` stand below, before those of columns. A text
    that is indented is a block of lines."""

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
        """The table by rows; without ranks columns go from the right, and the first one stays."""
        cells = list(zip(*rows, strict=True)) or [()] * len(header)
        return cls(
            caption, list(map(TextColumn, header, cells, ranks or range(len(header)))), notes
        )


@dataclass(frozen=True)
class Heading:
    """A line of text between tables; level 1 is the title."""

    text: str
    level: int = 2


EQUAL = 1e-9
"""Numbers that differ by this part of the largest are equal but for rounding."""


def first_largest(sizes: NDArray[np.float64]) -> tuple[int, ...]:
    """Return the place of the first number that is the largest but for rounding; NaN is none."""
    known = np.where(np.isnan(sizes), -np.inf, sizes)
    largest = float(known.max())
    slack = EQUAL * abs(largest) if math.isfinite(largest) else 0.0
    place = int(np.argmax(known >= largest - slack))
    return tuple(int(i) for i in np.unravel_index(place, sizes.shape))


def facts_by_label(lines: Iterable[tuple[str, str]]) -> dict[str, tuple[str, ...]]:
    """Return the texts of lines (label, text) by their labels in lower case; empty ones left out."""
    facts = dict[str, tuple[str, ...]]()
    for label, text in lines:
        if text:
            key = label.lower().replace(" ", "_")
            facts[key] = (*facts.get(key, ()), text)
    return facts


@dataclass(frozen=True)
class Verdict:
    """What a result file says first: a few facts under each label, each fact a line.

    complete: whether the file has everything that was asked for; where it has a reason why not,
              `solved` comes first
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
        """The facts by label, in the order in which they are read; labels without a fact are left
        out."""
        first = ("solved", "reason", "fix") if any(self.reason) else ()
        labels = dict.fromkeys((*first, *VERDICT_LABELS))
        facts = {label: tuple(filter(None, getattr(self, label))) for label in labels}
        return {label: texts for label, texts in facts.items() if texts}

    @property
    def lines(self) -> list[tuple[str, str]]:
        """Return the facts with their labels, for `labelled`."""
        rows = self.fields.items()
        return [(label.capitalize(), fact) for label, facts in rows for fact in facts]

    @property
    def sentence(self) -> str:
        """The same in one line, a sentence for each label."""
        return answered(*self.fields.values())


VERDICT_LABELS = ("answer", "cycles", "trust", "accuracy", "solved", "reason", "fix")


def answered(*sentences: Iterable[str]) -> str:
    """Return sentences of the parts that are not empty, each with a capital and a full stop."""
    texts = ["; ".join(filter(None, parts)) for parts in sentences]
    return " ".join(f"{text[0].upper()}{text[1:]}." for text in texts if text)


Part = Table | Heading | Verdict | str

_WORDS = re.compile(r" *[^ ─]+(?: [^ ]+)+$")
"""A line of words; columns of a table are two spaces or more apart."""


_width: ContextVar[int | None] = ContextVar("width", default=None)


@contextmanager
def fitting(width: int | None) -> Iterator[None]:
    """For the time of a `with`, plain text fits lines of so many characters; None: tables are as
    wide as they are."""
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
    if isinstance(part, Verdict):
        return labelled(part.lines)
    if isinstance(part, str):
        block = part.startswith("  ")
        return wrapped(part) if block else _filled(part, min(WIDTH, _width.get() or WIDTH), "  ")
    head = [wrapped(f"  {part.caption}"), ""] if part.caption else []
    kept, hidden = _with_room(part.columns)
    below = [*_hidden_line(hidden), *(wrapped(f"  {note}") for note in part.notes)]
    if meanings := column_notes(kept):
        below += ["", *(wrapped(f"  {note}") for note in meanings)]
    return "\n".join([*head, _aligned(kept), *below])


def column_notes(columns: Sequence[TextColumn]) -> list[str]:
    """Return what columns mean, each note once."""
    return list(dict.fromkeys(note for column in columns for note in column.notes))


def _filled(text: str, width: int, indent: str) -> str:
    return textwrap.fill(
        text, width, subsequent_indent=indent, break_long_words=False, break_on_hyphens=False
    )


LABELLED_WIDTH, LABEL_WIDTH = 80, 10
"""Characters of a labelled line at most, and of the column of its label."""


def labelled(lines: Iterable[tuple[str, str]]) -> str:
    """Return a block of lines (label, text) with the labels in a column of their own.

    An empty text is left out. A label is printed once for lines of the same label that follow each
    other. Lines that are too long go on below their text.
    """
    width = min(LABELLED_WIDTH, _width.get() or LABELLED_WIDTH)
    block, label_before = list[str](), ""
    for label, text in lines:
        if not text:
            continue
        label_shown = "" if label == label_before else label
        first_indent = f"  {label_shown:<{LABEL_WIDTH}}"
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
    """The text with its lines of words filled to the width; lines of tables stay."""
    width = _width.get()
    if width is None:
        return text
    return "\n".join(
        _filled(line, width, "    ") if _WORDS.match(line) else line for line in text.split("\n")
    )


def columns_table(columns: Sequence[TextColumn]) -> str:
    """Plain text: columns aligned right where every cell looks like a number, left otherwise.

    Where the width is too small, headings are wrapped. Where that is not enough, the columns of the
    highest ranks are hidden, those of rank 0 never, and a line says which.
    """
    kept, hidden = _with_room(columns)
    return "\n".join([_aligned(kept), *_hidden_line(hidden)])


def _with_room(columns: Sequence[TextColumn]) -> tuple[list[TextColumn], list[str]]:
    """Return the columns that are shown, and the headings of the hidden ones."""
    kept, hidden = list(columns), list[str]()
    while not fits(kept):
        last = max(range(len(kept)), key=lambda i: (kept[i].rank, i))
        if kept[last].rank == 0:
            break
        hidden.append(kept.pop(last).title)
    return kept, hidden


def _hidden_line(hidden: Sequence[str]) -> list[str]:
    names = ", ".join(dict.fromkeys(hidden))
    return [wrapped(f"  hidden columns: {names} (show with -v)")] if hidden else []


def fits(columns: Sequence[TextColumn]) -> bool:
    """Whether a table of all these columns has room, with its headings wrapped if need be."""
    return sum(_narrowest(column) + 2 for column in columns) <= (_width.get() or math.inf)


_UNIT = re.compile(r"\[[^]]*\]")


def _words(title: str) -> list[str]:
    """Return the words of a heading; its unit is one."""
    whole = _UNIT.sub(lambda unit: unit[0].replace(" ", "\u00a0"), title)
    return [word.replace("\u00a0", " ") for word in whole.split(" ")]


def _wide(text: str) -> int:
    """Return the columns of a terminal that a text takes; the bar of θ̄ stands above its letter."""
    return sum(not unicodedata.combining(letter) for letter in text)


def _put(text: str, width: int, right: bool) -> str:
    """Return the text filled to a width with blanks before it, or behind."""
    blanks = " " * (width - _wide(text))
    return blanks + text if right else text + blanks


def _narrowest(column: TextColumn) -> int:
    """Return the width of a column whose heading has a line for each word."""
    return max(map(_wide, (*_words(column.title), *column.cells)))


def _heading(column: TextColumn, width: int) -> list[str]:
    """Return the lines of a heading, each no wider than the column."""
    lines = [""]
    for word in _words(column.title):
        longer = f"{lines[-1]} {word}".lstrip(" ")
        if _wide(longer) <= width:
            lines[-1] = longer
        else:
            lines.append(word)
    return lines if lines[0] else lines[1:]


def _widths(columns: Sequence[TextColumn]) -> list[int]:
    """Return the widths of columns: of whole headings if there is room, else as few lines as do."""
    whole = [max(map(_wide, column.lines)) for column in columns]
    room = (_width.get() or math.inf) - 2 * len(columns)
    if sum(whole) <= room:
        return whole
    widths = [_narrowest(column) for column in columns]
    while True:
        heights = [
            len(_heading(column, width)) for column, width in zip(columns, widths, strict=True)
        ]
        highest = max(range(len(columns)), key=heights.__getitem__)
        if heights[highest] == 1 or sum(widths) >= room:
            return widths
        widths[highest] += 1


def _aligned(columns: Sequence[TextColumn]) -> str:
    """A column is a number's, and aligned right, if every cell looks like one, alone, in
    parentheses or missing."""
    padded, headings = [], []
    for column, width in zip(columns, _widths(columns), strict=True):
        right = all(not cell or cell[0].isdigit() or cell[0] in "-+–∞−(" for cell in column.cells)
        padded.append([_put(cell, width, right) for cell in column.cells])
        headings.append([_put(line, width, right) for line in _heading(column, width)])
    high = max(map(len, headings))
    wide = [_wide(lines[0]) for lines in headings]
    top = [[" " * width] * (high - len(one)) for one, width in zip(headings, wide, strict=True)]
    whole = [above + one for above, one in zip(top, headings, strict=True)]
    head = [f"  {'  '.join(line).rstrip()}" for line in zip(*whole, strict=True)]
    rows = [f"  {'  '.join(cells).rstrip()}" for cells in zip(*padded, strict=True)]
    return "\n".join([*head, "  " + "─" * (sum(wide) + 2 * len(wide) - 2), *rows])
