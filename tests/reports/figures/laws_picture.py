"""The friction laws side by side: `python -m tests.reports.figures.laws_picture` writes results/laws.png."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from tcstudy.laws.laws import Laws
from tcstudy.reports.figures import style
from tcstudy.reports.figures.law import CURVE, JUMPS, draw_law, slip_range
from tcstudy.reports.figures.panels import Panel, Scale
from tcstudy.reports.text import number
from tests.benchmarks.panels import inches
from tests.reports.figures.draw_cases import example_laws

if TYPE_CHECKING:
    from matplotlib.figure import Figure

COLUMNS = 3
HIGH, FOOT = 2.1, 0.5
"""Height of a row and of the key below all [inch]."""


def laws_figure(laws: Sequence[Laws]) -> Figure:
    """A panel for each law, with ω."""
    from matplotlib.figure import Figure
    from matplotlib.lines import Line2D
    from matplotlib.ticker import MaxNLocator

    rows = -(-len(laws) // COLUMNS)
    figure = Figure(figsize=(style.WIDTH, rows * HIGH + FOOT))
    across = style.WIDTH / COLUMNS
    for i, law in enumerate(laws):
        row, column = divmod(i, COLUMNS)
        bottom = FOOT + (rows - 1 - row) * HIGH + 0.35
        axes = inches(figure, column * across + 0.5, bottom, across - 0.65, HIGH - 0.75)
        reach = slip_range(law) or 1.0
        panel = Panel(Scale(""), Scale(""))
        draw_law(panel, law, (-reach, reach))
        panel.draw(axes)
        axes.margins(y=0.12)
        for axis in (axes.xaxis, axes.yaxis):
            axis.set_major_locator(MaxNLocator(nbins=5, steps=[1, 2, 5, 10]))
        axes.set_title(law.name, loc="left", fontweight="bold")
        axes.set_title(rf"$\omega$ = {number(law.omega, 3)}", loc="right")
    key = [(CURVE, "b(s) = $-S_T$ against the slip s = $u_T$"), *((how, word) for _, word, how in JUMPS)]
    handles = [Line2D([], [], **how, label=text) for how, text in key]
    figure.legend(handles=handles, loc="lower center", ncols=3, frameon=False, handlelength=2.2)
    return figure


if __name__ == "__main__":
    with style.styled():
        style.save(laws_figure(example_laws()), Path(__file__).parents[3] / "results" / "laws.png")
