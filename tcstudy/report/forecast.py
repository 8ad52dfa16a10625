"""The text of `tcstudy plan`."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol

from tcstudy.report.text import labels, number, table


class _Level(Protocol):
    @property
    def h(self) -> float: ...
    @property
    def n_dof(self) -> int: ...
    @property
    def n_contact(self) -> int: ...


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
) -> str:
    """Counts, predicted sizes, what is left out and why; axes are (name, values, units)."""
    lines = [title, ""]
    for name, values, units in axes:
        shown = ", ".join(labels([v if isinstance(v, str) else float(str(v)) for v in values])[:6])
        more = f", … ({len(values)} values)" if len(values) > 6 else ""
        lines.append(f"  {name}: {shown}{more}" + (f" [{units}]" if units != "1" else ""))
    most = "at most " if at_most else ""
    lines.append(
        f"  {_counted(points, 'point')} × {most}{_counted(level_count, 'level')} = "
        f"{most}{_counted(points * level_count, 'solution')}"
    )
    lines.append(f"  per level: {factorisations} stiffness factorisation(s), {heat_solves} temperature field(s)")
    lines.append("")
    if levels:
        rows = [[str(i), number(v.h), f"≈ {v.n_dof}", f"≈ {v.n_contact}"] for i, v in enumerate(levels)]
        lines.append(table(["level", "maxh", "dofs", "contact unknowns"], rows))
    else:
        lines.append("  sizes are known once the file's face is meshed")
    lines.append("")
    lines += [f"  left out: {text}" for text in left_out]
    lines += [f"  note: {text}" for text in notes]
    lines.append(f"  output: {output} (about {size / 1e6:.2g} MB)")
    return "\n".join(lines)


def _counted(number: int, noun: str) -> str:
    """A number with its noun: 1 point, 2 points."""
    return f"{number} {noun}" if number == 1 else f"{number} {noun}s"
