"""The stability map in one picture, drawn from the stored rows alone.

Above: what every method made of every cell, a strip for each load. Below: the default in figures, the worst load of
every cell. The theory's line ω = λ₁ (one solution on its near side) is drawn wherever a map crosses it.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from tcstudy.contact.problem import least_eigenvalue
from tcstudy.reports.figures.style import INK, PALE, WIDTH, save, styled
from tests.benchmarks.panels import inches
from tests.benchmarks.stability_chain import HEAT, POISSON, SHAPE, WEAK
from tests.benchmarks.stability_maps import DOWN_JUMPS, MAPS, NODES, REACH, SOFTENING, UNITS, UP_JUMPS
from tests.benchmarks.stability_measure import FLAGGED, LEFT_OUT, SILENT, SLOW, SOLVED, Row
from tests.benchmarks.stability_trial import CONTENDERS
from tests.contact.contact_cases import half_laplacian

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

Array = NDArray[np.float64]

HEIGHT = 10.9
LEFT, GAP, ROW, STEP = 1.2, 0.52, 0.62, 0.72
"""Left margin, gap between columns, height of a row of outcomes and distance to the next [inch]."""
PANEL, PANEL_STEP = 1.0, 1.8
"""Height of a panel of figures and distance to the next row [inch]."""

NOTE = """\
Dashed: ω = λ₁; to its left (below it for up-jumps) every problem has one solution. Three random loads a cell, a strip \
each. Solved:
inclusion residual ≤ 10⁻¹⁰ in extended precision; of BFGS, L-BFGS-B and trust-exact with nodes within 10⁻⁶ of the kink \
spacing put on the
kink. Limit: 1 s a solve. Thinness: thickness of an even mesh layer over that of the layer on the contact line. \
Iterations: of all runs.
Energy gap: above the lowest solution of all methods, relative to it."""

OUTCOMES = (SOLVED, FLAGGED, SILENT, SLOW, LEFT_OUT)
COLOURS = ("#a6cee3", "#f0b429", "#a50f15", "#9a9a9a", "#f2f2f2")
SAID = ("solved", "no solution, and says so", "no solution, reports success", "too slow", "left out to save time")

TITLES = {
    SOFTENING: ("ω/λ₁", "m", "softening × size"),
    DOWN_JUMPS: ("jump height / peak", "jumps", "down-jumps (ω = ∞)"),
    UP_JUMPS: ("jump height / peak", "jumps", "up-jumps"),
    UNITS: ("unit of slip", "unit of b", "units"),
    POISSON: ("ω/λ₁", "1 − 2ν", "Poisson's ratio"),
    HEAT: ("ω/λ₁", "α", "heat transfer"),
    SHAPE: ("aspect ratio", "thinness", "body and mesh"),
    WEAK: ("ω/λ₁", "load / peak", "friction against load"),
}


@dataclass(frozen=True)
class Panel:
    """A panel of figures of the default: map, title, value of a row, lowest and highest power of ten shown."""

    map: str
    title: str
    value: Callable[[Row], float]
    low: float
    high: float
    colours: str


PANELS = (
    Panel(SOFTENING, "iterations", lambda r: r.iterations, 0.0, 2.5, "Greens"),
    Panel(SOFTENING, "residual", lambda r: r.residual, -16.0, -4.0, "RdYlBu_r"),
    Panel(SOFTENING, "energy gap", lambda r: r.gap, -8.0, 0.0, "Purples"),
    Panel(SHAPE, "heat balance, shape", lambda r: r.heat_balance, -16.0, -4.0, "RdYlBu_r"),
    Panel(POISSON, "residual, ν → ½", lambda r: r.residual, -16.0, -4.0, "RdYlBu_r"),
    Panel(HEAT, "residual, α", lambda r: r.residual, -16.0, -4.0, "RdYlBu_r"),
    Panel(SHAPE, "residual, shape", lambda r: r.residual, -16.0, -4.0, "RdYlBu_r"),
    Panel(WEAK, "residual, weak b", lambda r: r.residual, -16.0, -4.0, "RdYlBu_r"),
)


def draw(rows: Sequence[Row], target: Path) -> None:
    """Write the picture."""
    from matplotlib.figure import Figure

    with styled():
        figure = Figure(figsize=(WIDTH, HEIGHT))
        _outcomes(figure, rows)
        _figures(figure, rows)
        save(figure, target)
    fewer_colours(target)


def fewer_colours(target: Path) -> None:
    """A palette of 256 colours, a third of the size; nothing in the picture needs more."""
    from PIL import Image

    with Image.open(target) as picture:
        small = picture.convert("RGB").quantize(256)
    small.save(target, optimize=True)


def _width() -> float:
    return (WIDTH - LEFT - 0.1 - 3 * GAP) / 4


def _outcomes(figure: Figure, rows: Sequence[Row]) -> None:
    """Methods by maps."""
    from matplotlib.colors import BoundaryNorm, ListedColormap
    from matplotlib.patches import Patch

    colours, norm = ListedColormap(COLOURS), BoundaryNorm(np.arange(len(COLOURS) + 1) - 0.5, len(COLOURS))
    figure.text(0.1 / WIDTH, 1 - 0.2 / HEIGHT, "What the methods make of every problem", fontsize=11, va="center")
    patches = [Patch(facecolor=c, edgecolor=PALE, linewidth=0.5) for c in COLOURS]
    figure.legend(patches, SAID, loc="upper left", bbox_to_anchor=(0.08 / WIDTH, 1 - 0.3 / HEIGHT), ncols=5,
                  frameon=False, fontsize=8, borderaxespad=0.0, handlelength=1.2, columnspacing=1.3)  # fmt: skip
    for column, name in enumerate(MAPS):
        of_map = [row for row in rows if row.map == name]
        xs, ys = _axis(of_map)
        for line, contender in enumerate(CONTENDERS):
            bottom = HEIGHT - 1.4 - line * STEP
            axes = inches(figure, LEFT + column * (_width() + GAP), bottom, _width(), ROW)
            own = [row for row in of_map if row.method == contender.name]
            loads = 1 + max(row.load for row in of_map)
            grid = np.full((len(ys), len(xs) * loads), OUTCOMES.index(LEFT_OUT))
            for row in own:
                grid[ys.index(row.y), xs.index(row.x) * loads + row.load] = OUTCOMES.index(row.outcome)
            across = np.arange(grid.shape[1] + 1) / loads
            axes.pcolormesh(across, np.arange(len(ys) + 1), grid, cmap=colours, norm=norm, rasterized=True)
            axes.vlines(np.arange(1, len(xs)), 0, len(ys), color="white", linewidth=0.7)
            axes.hlines(np.arange(1, len(ys)), 0, len(xs), color="white", linewidth=0.7)
            _line(axes, name, xs, ys)
            _ticks(axes, name, xs, ys, last=line == len(CONTENDERS) - 1)
            if line == 0:
                axes.set_title(TITLES[name][2], fontsize=9, pad=3)
            if column == 0:
                label = contender.name.replace(" ", "\n").replace("-newton", "\n-newton")
                axes.text(-1.1 / _width(), 0.5, label, transform=axes.transAxes, va="center", fontsize=8)


def _figures(figure: Figure, rows: Sequence[Row]) -> None:
    """The default in figures."""
    top = HEIGHT - 1.4 - len(CONTENDERS) * STEP - 0.1
    default = [row for row in rows if row.method == CONTENDERS[0].name]
    text = f"The default ({CONTENDERS[0].name}), worst load of a cell; hatched: flagged as failed; ×: silent failure"
    figure.text(0.1 / WIDTH, (top + 0.1) / HEIGHT, text, fontsize=9.5, va="center")
    for number, panel in enumerate(PANELS):
        column, line = number % 4, number // 4
        bottom = top - 0.55 - PANEL - line * PANEL_STEP
        axes = inches(figure, LEFT + column * (_width() + GAP), bottom, _width(), PANEL)
        own = [row for row in default if row.map == panel.map]
        xs, ys = _axis(own)
        grid, failed = np.full((len(ys), len(xs)), np.nan), np.zeros((len(ys), len(xs)), dtype=bool)
        for row in own:
            i, j = ys.index(row.y), xs.index(row.x)
            value = np.log10(max(panel.value(row), 10.0**panel.low)) if np.isfinite(panel.value(row)) else np.nan
            grid[i, j] = np.nanmax([grid[i, j], value]) if np.isfinite([grid[i, j], value]).any() else np.nan
            failed[i, j] |= row.outcome != SOLVED
        image = axes.pcolormesh(grid, cmap=panel.colours, vmin=panel.low, vmax=panel.high, rasterized=True)
        for i, j in {(ys.index(r.y), xs.index(r.x)) for r in own if r.outcome == SILENT}:
            axes.plot(j + 0.5, i + 0.5, "x", color=INK, markersize=5, markeredgewidth=1.5)
            failed[i, j] = False
        for i, j in np.argwhere(failed):
            axes.fill_between([j, j + 1], i, i + 1, facecolor="none", edgecolor=INK, hatch="////", linewidth=0.0)
        _line(axes, panel.map, xs, ys)
        _ticks(axes, panel.map, xs, ys, last=True)
        axes.set_title(panel.title, fontsize=9, pad=19)
        _bar(figure, axes, image, panel)
    figure.text(0.1 / WIDTH, 0.08 / HEIGHT, NOTE, fontsize=7, va="bottom")


def _bar(figure: Figure, axes: Axes, image: Any, panel: Panel) -> None:
    """A colour bar between title and panel."""
    box = axes.get_position()
    place = figure.add_axes((box.x0, box.y1 + 0.035 / HEIGHT, box.width, 0.05 / HEIGHT))
    bar = figure.colorbar(image, cax=place, orientation="horizontal")
    bar.outline.set_visible(False)
    place.set_xticks([])
    for where, value, side in ((0.0, panel.low, "left"), (1.0, panel.high, "right")):
        place.text(where, 1.3, _power(value), transform=place.transAxes, ha=side, va="bottom", fontsize=7)


def _power(value: float) -> str:
    return f"{10**value:.0f}" if 0 <= value <= 3 else f"$10^{{{value:g}}}$"


def _axis(rows: Sequence[Row]) -> tuple[list[float], list[float]]:
    return sorted({row.x for row in rows}), sorted({row.y for row in rows})


def _line(axes: Axes, name: str, xs: Sequence[float], ys: Sequence[float]) -> None:
    """ω = λ₁ in counted cells."""
    if name in (SOFTENING, POISSON, HEAT, WEAK):
        at = float(np.interp(0.0, np.log10(xs), np.arange(len(xs)) + 0.5))
        axes.plot([at, at], [0, len(ys)], "--", color=INK, linewidth=1.1)
    if name == UP_JUMPS:
        lambda_1 = least_eigenvalue(*half_laplacian(NODES))
        log_x = np.linspace(np.log10(xs[0]), np.log10(xs[-1]), 200)
        log_y = np.log10(REACH * lambda_1) - log_x
        seen = (log_y >= np.log10(ys[0])) & (log_y <= np.log10(ys[-1]))
        across = np.interp(log_x, np.log10(xs), np.arange(len(xs)) + 0.5)
        up = np.interp(log_y, np.log10(ys), np.arange(len(ys)) + 0.5)
        axes.plot(across[seen], up[seen], "--", color=INK, linewidth=1.1)


def _ticks(axes: Axes, name: str, xs: Sequence[float], ys: Sequence[float], last: bool) -> None:
    axes.set(xlim=(0, len(xs)), ylim=(0, len(ys)))
    axes.tick_params(length=2, labelsize=7, pad=1.5)
    shown_x = list(range(0, len(xs), 2 if len(xs) > 5 else 1))
    shown_y = list(range(0, len(ys), 2 if len(ys) > 3 else 1))
    axes.set_yticks([i + 0.5 for i in shown_y], [_text(ys[i], name) for i in shown_y])
    axes.set_xticks([i + 0.5 for i in shown_x], [_text(xs[i], name) for i in shown_x] if last else [])
    x_label, y_label, _ = TITLES[name]
    axes.set_ylabel(y_label, fontsize=7.5, labelpad=1)
    if last:
        axes.set_xlabel(x_label, fontsize=8, labelpad=1)


def _text(value: float, name: str) -> str:
    """A short number: powers of ten as such."""
    if name == UNITS:
        return "1" if value == 0 else f"$10^{{{value:g}}}$"
    power = float(np.log10(value))
    if abs(power) >= 3 and abs(power - round(power)) < 1e-9:
        return f"$10^{{{round(power)}}}$"
    if abs(power) > 2.5:
        return f"${value / 10.0 ** np.floor(power):.0f}·10^{{{int(np.floor(power))}}}$"
    return f"{value:.2g}" if value < 100.0 else f"{value:g}"
