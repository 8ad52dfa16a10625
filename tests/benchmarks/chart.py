"""The comparison in one chart, drawn from the stored measurements alone."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import groupby
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import xarray as xr

from tcstudy.reports.figures.style import INK, PALE, SHADE, WIDTH, save, styled
from tests.benchmarks.measure import NOT_RUN
from tests.benchmarks.panels import inches
from tests.benchmarks.problems import BODY_RATIO, WEAKENING
from tests.benchmarks.stability_draw import fewer_colours
from tests.benchmarks.summary import cell, columns, lowest, residual, solved, wrong_claims

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

MARKS = (
    ("#d55e00", "o"),
    ("#0072b2", "s"),
    ("#009e73", "D"),
    ("#e69f00", "^"),
    ("#56b4e9", "v"),
    ("#cc79a7", "P"),
    ("#444444", "X"),
    ("#b8a000", "*"),
)
"""Colour (Okabe and Ito) and shape of each method: either alone tells them apart."""

FLOOR = 1e-16
"""Smaller values are drawn here."""

HEIGHT = 7.83
LEFT, RIGHT, GAP, PANEL = 0.78, 0.12, 0.14, 1.75
ROW, LABEL, TOTAL = 0.23, 1.62, 0.66
"""Layout [inch]: margins, gap and height of panels; height of a table row, width of its first and last columns."""


def draw(data: xr.Dataset, target: Path) -> None:
    """Write the picture."""
    from matplotlib.figure import Figure

    with styled():
        figure = Figure(figsize=(WIDTH, HEIGHT))
        _panels(figure, data)
        _table(figure, data)
        save(figure, target)
    if target.suffix == ".png":
        fewer_colours(target)


def _panels(figure: Figure, data: xr.Dataset) -> None:
    """Residual and energy gap over time, a column for every size."""
    sizes = np.unique(data["m"].values[data["family"].values == WEAKENING])
    width = (WIDTH - LEFT - RIGHT - GAP * (len(sizes) - 1)) / len(sizes)
    limits = 0.5 * float(data["time"].min()), 4.0 * float(data["time"].max())
    rows = ((residual(data), "inclusion residual", 1e3), (data["energy_gap"], "energy gap", 1e3))
    for row, (values, label, top) in enumerate(rows):
        bottom = HEIGHT - 0.62 - (row + 1) * PANEL - row * 0.14
        for column, m in enumerate(sizes):
            axes = inches(figure, LEFT + column * (width + GAP), bottom, width, PANEL)
            one = (data["family"].values == WEAKENING) & (data["m"].values == m)
            axes.set(xscale="log", yscale="log", xlim=limits, ylim=(0.2 * FLOOR, top))
            _marks(figure, axes, data["time"].values[one], values.values[one])
            axes.set_yticks([1e-16, 1e-12, 1e-8, 1e-4, 1.0], ["10⁻¹⁶", "10⁻¹²", "10⁻⁸", "10⁻⁴", "1"])
            axes.set_yticks([], minor=True)
            axes.tick_params(axis="x", which="minor", length=0)
            axes.grid(axis="both", color=SHADE, linewidth=0.5)
            axes.set_axisbelow(True)
            axes.axvline(data.attrs["time_limit"], color=PALE, linewidth=0.8, linestyle=":")
            if row == 0:
                axes.set_title(f"m = {m}", color=INK)
                axes.axhline(data.attrs["tolerance"], color=INK, linewidth=0.8, linestyle=(0, (4, 3)))
            if row == 0 and column == 0:
                axes.annotate("solved below", (1.0, data.attrs["tolerance"]), (-2, -3), ha="right", va="top",
                              xycoords=("axes fraction", "data"), textcoords="offset points", fontsize=8)  # fmt: skip
            axes.tick_params(labelbottom=row == len(rows) - 1, labelleft=column == 0)
            if column == 0:
                axes.set_ylabel(label)
            if row == len(rows) - 1:
                axes.set_xlabel("time of a solve [s]")
    title = "Solving one contact problem: small marks are solves, large ones medians"
    figure.text(LEFT / WIDTH, 1 - 0.14 / HEIGHT, title, va="top", fontsize=10.5, color=INK)


def _marks(figure: Figure, axes: Axes, time: np.ndarray, value: np.ndarray) -> None:
    """All solves small, the median large and, where medians meet, moved aside on a leader."""
    value = np.where(np.isnan(value), value, np.maximum(value, FLOOR))
    medians = {}
    for method, (colour, shape) in enumerate(MARKS[: time.shape[1]]):
        t, y = time[:, method], value[:, method]
        if np.all(np.isnan(t)):
            continue
        axes.plot(t, y, shape, color=colour, markersize=3, alpha=0.45, markeredgewidth=0)
        medians[method] = (float(np.nanmedian(t)), float(np.nanmedian(y)))
    to_inches = axes.transData + figure.dpi_scale_trans.inverted()
    true = to_inches.transform(list(medians.values()))
    for method, point, place in zip(medians, true, apart(true, 0.16), strict=True):
        (x0, y0), (x, y) = to_inches.inverted().transform([point, place])
        colour, shape = MARKS[method]
        axes.plot([x0, x], [y0, y], color=colour, linewidth=1.0)
        axes.plot(x, y, shape, color=colour, markersize=8.5, markeredgecolor="white", markeredgewidth=0.9)


def apart(points: np.ndarray, least: float) -> np.ndarray:
    """Points (n, 2) moved until no two are closer than `least`, so that no mark covers another."""
    moved = points + 1e-3 * np.arange(len(points))[:, None] * [[1.0, -1.0]]
    for _ in range(200):
        step = moved[:, None] - moved[None]
        distance = np.linalg.norm(step, axis=-1) + np.eye(len(points)) * least
        push = np.maximum(0.0, least - distance)[..., None] * step / distance[..., None]
        moved = moved + 0.4 * push.sum(axis=1)
        if not push.any():
            break
    return moved


def _table(figure: Figure, data: xr.Dataset) -> None:
    """Success rates beside the marks' names: solved/run for every size and softening."""
    from matplotlib.colors import LinearSegmentedColormap

    shown = columns(data)
    step = (WIDTH - 0.1 - LABEL - 3 * TOTAL - RIGHT) / len(shown)
    rows = data.sizes["solver"]
    height = (rows + 3.2) * ROW
    axes = inches(figure, 0.1, 0.64, WIDTH - 0.1 - RIGHT, height)
    axes.set(xlim=(0, WIDTH - 0.1 - RIGHT), ylim=(rows, -3.2))
    axes.axis("off")
    colours = LinearSegmentedColormap.from_list("share", ["#ffffff", "#7fb8dc"])
    _heads(axes, data, step)
    for row, method in enumerate(str(name) for name in data["solver"].values):
        colour, shape = MARKS[row]
        axes.plot(0.12, row + 0.5, shape, color=colour, markersize=8, markeredgecolor="white", clip_on=False)
        axes.text(0.27, row + 0.5, method, va="center", fontsize=9)
        for k, column in enumerate(shown):
            text, share = cell(data, method, column.cases)
            if share > 0.0:
                axes.fill_between([LABEL + k * step + 0.015, LABEL + (k + 1) * step - 0.015], row + 0.06, row + 0.94,
                                  color=colours(share), linewidth=0)  # fmt: skip
            axes.text(LABEL + (k + 0.5) * step, row + 0.5, text, ha="center", va="center", fontsize=8)
        end = LABEL + len(shown) * step
        for k, (a, b) in enumerate(_totals(data, method)):
            axes.text(end + (k + 0.5) * TOTAL, row + 0.5, f"{a}/{b}", ha="center", va="center", fontsize=8)
    figure.text(0.1 / WIDTH, 0.1 / HEIGHT, "\n".join(_footnotes(data)), fontsize=7.5, color=INK, va="bottom")


def _totals(data: xr.Dataset, method: str) -> tuple[tuple[int, int], ...]:
    return lowest(data, method), wrong_claims(data, method), solved(data, method, finished=True)


def _heads(axes: Axes, data: xr.Dataset, step: float) -> None:
    """Two lines of headings, a rule under each group."""
    shown = columns(data)
    axes.text(0.0, -2.0, "solved / run", va="center", fontsize=9, fontweight="bold")
    axes.text(0.0, -0.75, "by softening ω/λ₁, or by m", va="center", fontsize=8)
    start = 0
    for group, members in groupby(shown, key=lambda column: column.group):
        count = len(list(members))
        left, right = LABEL + start * step + 0.03, LABEL + (start + count) * step - 0.03
        axes.text((left + right) / 2, -2.0, group, ha="center", va="center", fontsize=8.5)
        axes.plot([left, right], [-1.4, -1.4], color=PALE, linewidth=0.8)
        start += count
    for k, column in enumerate(shown):
        axes.text(LABEL + (k + 0.5) * step, -0.75, column.title, ha="center", va="center", fontsize=8)
    end = LABEL + len(shown) * step
    for k, text in enumerate(("of lowest\nenergy", "false\nsuccess", "solved when\nfinished")):
        axes.text(end + (k + 0.5) * TOTAL, -0.3, text, ha="center", va="bottom", fontsize=7.5, linespacing=1.1)


def _footnotes(data: xr.Dataset) -> Iterator[str]:
    left_out = int(np.sum(data["end"].values == NOT_RUN))
    yield f"Solved: inclusion residual ≤ 10⁻¹⁰, nodes within 10⁻⁶ kink spacings snapped. Body: ω/λ₁ = {BODY_RATIO:g}."
    yield "Of lowest energy: of its solutions, those that no method undercuts. False success: of the answers that the"
    yield "method calls a success, those that are no solution. Finished: every answer given our methods’ last step."
    yield (
        f"{left_out} solves (–, or fewer than {int(data['load'].max()) + 1} run) left out, the method was too slow "
        f"(limit {data.attrs['time_limit']:g} s a solve, dotted). Values below 10⁻¹⁶ are drawn there."
    )
