"""Aligned plain-text tables."""

from __future__ import annotations

import math
from collections.abc import Sequence


def number(value: float, digits: int = 4) -> str:
    """A number for a table: few digits, '–' for a missing one."""
    value = float(value)
    if math.isnan(value):
        return "–"
    if math.isinf(value):
        return "∞" if value > 0 else "−∞"
    return f"{value:.{digits}g}"


PREFIXES = ((1e9, "G"), (1e6, "M"), (1e3, "k"), (1.0, ""), (1e-3, "m"), (1e-6, "µ"), (1e-9, "n"))


def prefix(values: Sequence[float], units: str) -> tuple[float, str]:
    """(divisor, units with an SI prefix) that bring the middle of the magnitudes of `values` to 1 … 1000.

    Units that a prefix does not suit ("1", "K", "s" and dimensionless data) stay as they are.
    """
    sizes = sorted(abs(v) for v in values if math.isfinite(v) and v != 0.0)
    if not sizes or units in ("1", "K", "s"):
        return 1.0, units
    middle = sizes[len(sizes) // 2]
    divisor, letter = next((p for p in PREFIXES if middle >= p[0]), PREFIXES[-1])
    return divisor, letter + units


def table(header: Sequence[str], rows: Sequence[Sequence[str]], indent: str = "  ") -> str:
    """Columns aligned right where every cell looks like a number, left otherwise."""
    columns = list(zip(header, *rows, strict=True))
    widths = [max(len(cell) for cell in column) for column in columns]
    right = [all(_numeric(cell) for cell in column[1:]) for column in columns]
    lines = []
    for row in (header, *rows):
        cells = [
            cell.rjust(width) if aligned else cell.ljust(width)
            for cell, width, aligned in zip(row, widths, right, strict=True)
        ]
        lines.append((indent + "  ".join(cells)).rstrip())
    rule = indent + "─" * (sum(widths) + 2 * (len(widths) - 1))
    return "\n".join([lines[0], rule, *lines[1:]])


def _numeric(cell: str) -> bool:
    return bool(cell) and (cell[0].isdigit() or cell[0] in "-+–∞−")
