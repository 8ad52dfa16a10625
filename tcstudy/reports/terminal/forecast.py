"""The text of `tcstudy plan`."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol

from tcstudy.reports.terminal.tables import plain_table, wrapped
from tcstudy.reports.text import counted, headed, number, prefix, scaled_labels, span


class _Level(Protocol):
    @property
    def h(self) -> float: ...
    @property
    def n_dof(self) -> int: ...
    @property
    def n_contact(self) -> int: ...
    @property
    def exact(self) -> bool: ...


def forecast_text(
    title: str,
    axes: Sequence[tuple[str, Sequence[object], str]],
    points: int,
    factorisations: int,
    heat_solves: int,
    levels: Sequence[_Level],
    level_count: int,
    left_out: Sequence[str],
    notes: Sequence[str],
    output: str,
    size: int,
    at_most: bool = False,
    length: str = "1",
    work: str = "",
    time: str = "",
    steps: int = 0,
) -> str:
    """Counts, sizes, what is left out and why.

    axes: (name, values, units);  length: the unit of h;  work: who solves the contact problems, in words
    time: what a run would take, in words;  steps: of a history, which is followed on one of the levels
    """
    lines = [title, ""]
    for name, values, units in axes:
        words, units = scaled_labels([v if isinstance(v, str) else float(str(v)) for v in values], units)
        shown = ", ".join(words[:6])
        more = f", … ({len(values)} values)" if len(values) > 6 else ""
        lines.append(f"  {name}: {shown}{more}" + (f" [{units}]" if units != "1" else ""))
    most = "at most " if at_most else ""
    times = counted(steps, "step") if steps else f"{most}{counted(level_count, 'level')}"
    lines.append(
        f"  {counted(points, 'point')} × {times} = {most}{counted(points * (steps or level_count), 'solution')}"
    )
    fields = counted(heat_solves, "temperature field") if heat_solves else "no temperature field"
    lines.append(f"  per level: {counted(factorisations, 'stiffness factorisation')}, {fields}")
    lines += [f"  {work}"] * bool(work)
    lines.append("")
    divisor, unit = prefix([v.h for v in levels], length)
    rows = [[str(i), number(v.h / divisor), _count(v.n_dof, v), _count(v.n_contact, v)] for i, v in enumerate(levels)]
    lines += [plain_table(["level", headed("maxh", unit), "dofs", "contact unknowns"], rows), ""]
    lines += [f"  left out: {text}" for text in left_out]
    lines += [f"  note: {text}" for text in notes]
    lines.append(f"  output: {output} ({'up to ' if at_most else ''}about {size / 1e6:.2g} MB)")
    lines += [f"  {time}"] * bool(time)
    return wrapped("\n".join(lines))


def expected_words(seconds: float, memory: float, at_most: bool = False) -> str:
    """Time and memory to expect, in words: rough figures."""
    most = "up to " if at_most else ""
    return f"{most}about {span(seconds)} of one process on this machine when idle, {most}about {memory / 1e9:.1g} GB"


def _count(value: int, level: _Level) -> str:
    """A number that is counted, or predicted."""
    if level.exact:
        return str(value)
    return f"about {float(f'{value:.2g}'):.0f}"
