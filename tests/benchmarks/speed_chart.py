"""Three charts of the measured times, drawn from the stored data alone."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import xarray as xr

from tcstudy.reports.figures.style import INK, PALE, SHADE, WIDTH, save, styled
from tests.benchmarks.panels import inches

if TYPE_CHECKING:
    from matplotlib.axes import Axes

COLOURS = ("#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9", "#444444", "#999933")
SHAPES = ("o", "s", "D", "^", "v", "P", "X", "d")
HEIGHT, PANEL, BOTTOM = 7.6, 2.75, 0.52
LEFT, NARROW, SECOND = 0.62, 1.95, 4.3
"""Layout [inch]: left ends and width of the upper panels; the names of their lines stand on their right."""


def draw(data: xr.Dataset, target: Path) -> None:
    """Write the picture."""
    with styled():
        from matplotlib.figure import Figure

        figure = Figure(figsize=(WIDTH, HEIGHT))
        top = HEIGHT - 0.42 - PANEL
        axes = inches(figure, LEFT, top, NARROW, PANEL)
        _lines(axes, data["n_dof"].values, data["stage_time"], "Stages of one point")
        axes = inches(figure, SECOND, top, NARROW, PANEL)
        _lines(axes, data["n_dof"].values, data["factor_time"], "Factorisations of the stiffness matrix")
        axes = inches(figure, LEFT, BOTTOM, WIDTH - LEFT - 1.75, PANEL)
        _sweep(axes, data)
        save(figure, target)


def spread(times: xr.DataArray, dim: str) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """(lower quartile, median, upper quartile) over the runs."""
    values = times.transpose(..., dim).values
    found = np.full((3, *values.shape[:-1]), np.nan)
    known = np.isfinite(values).any(axis=-1)
    found[:, known] = np.nanquantile(values[known], (0.25, 0.5, 0.75), axis=-1)
    return found[0], found[1], found[2]


def _lines(axes: Axes, n_dof: np.ndarray, times: xr.DataArray, title: str) -> None:
    """Medians against N with quartiles, named at their right ends."""
    low, middle, high = spread(times, "run")
    ends = []
    for i, name in enumerate(times[times.dims[1]].values):
        known = np.flatnonzero(np.isfinite(middle[:, i]) & (middle[:, i] > 0))
        if not len(known):
            continue
        x, y = n_dof[known], middle[known, i]
        axes.fill_between(x, np.maximum(low[known, i], 1e-6), high[known, i], color=COLOURS[i], alpha=0.18, linewidth=0)
        axes.plot(x, y, color=COLOURS[i], marker=SHAPES[i], markersize=4, linewidth=1.2)
        ends.append((float(x[-1]), float(y[-1]), str(name), COLOURS[i]))
    axes.set(xscale="log", yscale="log", xlabel="displacement unknowns N", ylabel="CPU time [s]")
    _grid(axes)
    axes.set_title(title, loc="left", color=INK)
    _names(axes, ends)


def _names(axes: Axes, ends: list[tuple[float, float, str, str]]) -> None:
    """Names right of the panel at the height of the ends of their lines, moved apart where they would touch."""
    low, high = (np.log10(v) for v in axes.get_ylim())
    gap = 0.066 * (high - low)
    ends = sorted(ends, key=lambda end: end[1])
    place = np.log10([y for _, y, _, _ in ends])
    for _ in range(200):
        missing = np.maximum(gap - np.diff(place), 0.0)
        place[:-1] -= 0.3 * missing
        place[1:] += 0.3 * missing
    for (x, y, name, colour), at in zip(ends, place, strict=True):
        axes.annotate(name, (x, y), (1.07, 10**at), textcoords=axes.get_yaxis_transform(), color=colour, fontsize=8.5,
                      va="center", annotation_clip=False,
                      arrowprops={"arrowstyle": "-", "color": PALE, "linewidth": 0.6, "relpos": (0, 0.5)})  # fmt: skip


def _sweep(axes: Axes, data: xr.Dataset) -> None:
    """Cost of a sweep in units of its first point; a dashed line shows what it would cost without reuse."""
    cold = data["sweep_time"].sel(kind=data["kind"][0], count=1)
    low, middle, high = spread(data["sweep_time"] / cold, "sweep_run")
    count = data["count"].values
    for i, kind in enumerate(data["kind"].values):
        axes.fill_between(count, low[i], high[i], color=COLOURS[i], alpha=0.18, linewidth=0)
        axes.plot(count, middle[i], color=COLOURS[i], marker=SHAPES[i], markersize=4, linewidth=1.2)
        below = i == 0
        axes.annotate(str(kind), (count[-1], middle[i, -1]), (7, -2 if below else 2), textcoords="offset points",
                      color=COLOURS[i], va="top" if below else "bottom", fontsize=8.5,
                      annotation_clip=False)  # fmt: skip
    axes.plot([1, 6], [1, 6], color=PALE, linewidth=1.0, linestyle=(0, (4, 3)))
    axes.annotate(
        "without reuse: every point like the first",
        (6, 6),
        (5, 0),
        textcoords="offset points",
        fontsize=8.5,
        va="center",
    )
    axes.set(xscale="log", xlabel="points of the sweep", ylabel="CPU time / that of one point", ylim=(0, 6.2))
    axes.set_xticks([1, 10, 100, 1000], ["1", "10", "100", "1000"])
    _grid(axes)
    n = int(data.attrs["sweep_n_dof"])
    axes.set_title(f"Loads and temperatures of a sweep, N = {n:,}", loc="left", color=INK)


def _grid(axes: Axes) -> None:
    axes.grid(axis="both", color=SHADE, linewidth=0.5)
    axes.set_axisbelow(True)
    axes.tick_params(axis="both", which="minor", length=0, labelleft=False, labelbottom=False)
