"""The chart of accuracy against cost: error over wall time and over unknowns, for mesh families and solvers."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from tcstudy.data.measured import OWN
from tcstudy.data.store import load_root
from tcstudy.reports.figures import style
from tcstudy.reports.figures.convergence_plot import math_symbol
from tcstudy.reports.figures.sheet import Sheet
from tcstudy.reports.terminal.cost import EXACT, SYMBOLS, Setting, advice, best, front, measure_of, settings
from tcstudy.scene.families import FAMILIES

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from matplotlib.lines import Line2D

GOLD = "#f0c000"
COLOURS = dict(zip((*FAMILIES, OWN), (style.INK, style.VERMILLION, style.BLUE, style.GREEN), strict=True))
MARKS = dict(zip((*FAMILIES, OWN), "sDo^", strict=True))
LINES: tuple[Any, ...] = ("-", (0, (1.2, 1.6)), (0, (4, 2)), (0, (4, 2, 1, 2)))
"""Line styles of the first, second … solver."""

PANEL = 3.6
"""Height of the panels with the key above them [inch]."""
PALE = 0.32
"""Opacity of curves that others beat everywhere, and of the fill of marks that others beat."""


def plot_cost(path: Path, measure: str | None, look: style.Look) -> tuple[Figure, str]:
    """The chart of accuracy against cost, and what it shows. Raises DrawError if the file has no such error."""
    data = load_root(path, "cost")
    name = measure_of(data, measure)
    return _figure(data, name, look), f"{SYMBOLS[name]}, {data.attrs['point'] or data.attrs['title']}"


def _figure(data: Any, measure: str, look: style.Look | None = None) -> Figure:
    found = settings(data, measure)
    words = [style.point_words(data.attrs["point"]), f"reference: {data.attrs['reference']}"]
    sheet = Sheet(look or style.Look(), data.attrs["title"], words, [("time", "unknowns")], [PANEL], advice(found))
    left, right = sheet.panels.values()
    _over_time(left, data, found)
    _over_unknowns(right, data, found)
    errors = [s.error for s in found if s.error > 0]
    for axes in (left, right):
        axes.set(xscale="log", yscale="log", ylim=(min(errors) / 1.6, max(errors) * 1.6))
        axes.grid(True, which="major", color=style.SHADE, linewidth=0.6)
        axes.set_axisbelow(True)
        for axis in (axes.xaxis, axes.yaxis):
            style.few_ticks(axis)
    left.set_ylabel(f"relative error of {math_symbol(SYMBOLS[measure])}")
    if len(sheet.heights) == 1:
        right.tick_params(which="both", labelleft=False)
    sheet.key(_handles(data, found), "upper left")
    return sheet.finish()


def _over_time(axes: Axes, data: Any, found: list[Setting]) -> None:
    """Curves over wall time with bands to the upper quartile; those that are beaten everywhere are pale."""
    worthy, champion = {s.curve for s in front(found)}, best(found)
    solvers = data["solver"].values.tolist()
    for family in data["family"].values.tolist():
        for k, solver in enumerate(solvers):
            own = [s for s in found if s.curve == (family, solver) and s.error > 0 and s.time > 0]
            if not own:
                continue
            color, opacity = COLOURS[family], 1.0 if (family, solver) in worthy else PALE
            solved = [s for s in own if s.solved]
            time, error, upper = np.array([(s.time, s.error, s.upper) for s in solved]).reshape(-1, 3).T
            heavy = (family, solver) == champion
            axes.fill_betweenx(error, time, upper, color=color, alpha=0.16 * opacity, linewidth=0)
            width = 2.2 if heavy else 1.2
            axes.plot(time, error, color=color, linestyle=LINES[k % len(LINES)], linewidth=width, alpha=opacity)
            _points(axes, own, color, opacity)
    if champion is not None:  # named in the corner that falling curves leave free
        how: dict[str, Any] = {"color": COLOURS[champion[0]], "fontweight": "bold", "fontsize": style.pt(8.5)}
        axes.annotate(f"fastest: {', '.join(champion)}", (0.03, 0.04), xycoords="axes fraction", **how)
    _star(axes, found, lambda s: s.time)
    axes.set_xlabel("wall time [s]: least of all runs, band to the upper quartile")


def _points(axes: Axes, own: list[Setting], color: str, opacity: float) -> None:
    """Marks: filled on the front, pale where another setting is better in both, hollow where it did not converge."""
    from matplotlib.colors import to_rgba

    for s in own:
        face = to_rgba(color, 1.0 if not s.dominated else 0.5 * PALE) if s.solved else "white"
        edge = to_rgba(color, opacity)
        how: dict[str, Any] = {"color": edge, "markersize": 4.5, "markerfacecolor": face, "markeredgewidth": 0.9}
        axes.plot(s.time, s.error, MARKS[s.family], **how)


def _over_unknowns(axes: Axes, data: Any, found: list[Setting]) -> None:
    """Curves of the first solver over displacement unknowns, with the rates of P1 elements."""
    first = data["solver"].values.tolist()[0]
    rates: list[tuple[str, str]] = []
    for family in data["family"].values.tolist():
        own = [s for s in found if s.family == family and s.solver == first and s.error > 0]
        solved = [s for s in own if s.solved]
        n, error = [s.n_dof for s in solved], [s.error for s in solved]
        color = COLOURS[family]
        axes.plot(n, error, color=color, linewidth=1.2)
        for s in own:
            face = color if s.solved else "white"
            axes.plot(s.n_dof, s.error, MARKS[family], color=color, markersize=4.5, markerfacecolor=face)
        if len(solved) > 2 and max(error) > EXACT:
            slope = float(np.polyfit(np.log(n[-3:]), np.log(error[-3:]), 1)[0])
            rates.append((family, f"{family} $N^{{{slope:.2f}}}$"))
    for i, (family, text) in enumerate(reversed(rates)):
        place = 0.03, 0.04 + 0.065 * i
        axes.annotate(text, place, xycoords="axes fraction", color=COLOURS[family], fontsize=style.pt(9))
    _star(axes, found, lambda s: s.n_dof)
    axes.set_xlabel("displacement unknowns N")


def _star(axes: Axes, found: list[Setting], x: Any) -> None:
    """The study's own settings; white inside where another setting is better in both."""
    for s in found:
        if s.own and np.isfinite(s.error):
            face = "white" if s.dominated else GOLD
            axes.plot(x(s), s.error, "*", color=face, markersize=13, markeredgecolor=style.INK, markeredgewidth=0.9)


def _handles(data: Any, found: list[Setting]) -> list[Line2D]:
    """Families by colour and mark, solvers by line, what pale and hollow marks mean."""
    from matplotlib.colors import to_rgba
    from matplotlib.lines import Line2D

    beaten = any(s.own and s.dominated for s in found)
    star = {"marker": "*", "markersize": 10, "markeredgecolor": style.INK, "linestyle": ""}
    dot = {"color": style.INK, "marker": "o", "markersize": 4.5, "markeredgewidth": 0.9, "linestyle": ""}
    pale = to_rgba(style.INK, 0.5 * PALE)
    entries: list[tuple[bool, str, dict[str, Any]]] = [
        *((True, f, {"color": COLOURS[f], "marker": MARKS[f], "markersize": 4.5, "linewidth": 1.2})
          for f in data["family"].values.tolist()),
        *((True, solver, {"color": style.INK, "linestyle": LINES[k % len(LINES)], "linewidth": 1.2})
          for k, solver in enumerate(data["solver"].values.tolist())),
        (True, "the study's own" + " (beaten)" * beaten, star | {"color": "white" if beaten else GOLD}),
        (any(not s.dominated for s in found), "best at its error", dot),
        (any(s.dominated and s.solved for s in found), "pale: another is faster and closer",
         dot | {"markerfacecolor": pale}),
        (any(not s.solved for s in found), "not converged", dot | {"markerfacecolor": "white"}),
    ]  # fmt: skip
    return [Line2D([], [], label=label, **how) for there, label, how in entries if there]
