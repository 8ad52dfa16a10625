"""The comparisons of solvers in a glance, drawn from the stored measurements alone."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import xarray as xr

from tcstudy.reports.figures.style import INK, SHADE, save, styled
from tests.benchmarks.panels import inches
from tests.benchmarks.stability_measure import FLAGGED, LEFT_OUT, SILENT, SLOW, SOLVED, Row
from tests.benchmarks.stability_trial import CONTENDERS
from tests.benchmarks.summary import solved, wrong_claims

if TYPE_CHECKING:
    from matplotlib.axes import Axes

WIDTH, LEFT, RIGHT, BAR, HEAD, FOOT = 6.0, 1.45, 0.75, 0.27, 0.72, 0.5
"""Layout [inch]."""
GOOD, TOLD, FALSE = "#a6cee3", "#f0b429", "#a50f15"
LOOKS = {
    SOLVED: (GOOD, "solved"),
    FLAGGED: (TOLD, "no solution, and says so"),
    SILENT: (FALSE, "no solution, reports success"),
    SLOW: ("#9a9a9a", "too slow"),
}
"""Colour and words of an outcome."""


def bars(title: str, names: Sequence[str], shares: np.ndarray, looks: Sequence[tuple[str, str]], right: Sequence[str],
         target: Path) -> None:  # fmt: skip
    """A stacked bar for each name: shares (names, kinds) of 1, (colour, meaning) of the kinds, a word beside."""
    from matplotlib.figure import Figure
    from matplotlib.patches import Patch

    with styled():
        height = HEAD + FOOT + BAR * len(names)
        figure = Figure(figsize=(WIDTH, height))
        axes: Axes = inches(figure, LEFT, FOOT, WIDTH - LEFT - RIGHT, BAR * len(names))
        start = np.zeros(len(names))
        for kind, (colour, _) in enumerate(looks):
            axes.barh(np.arange(len(names)), 100 * shares[:, kind], left=100 * start, color=colour, height=0.74)
            start += shares[:, kind]
        for i, text in enumerate(right):
            axes.text(101.5, i, text, va="center", fontsize=8.5, color=INK)
        axes.set_yticks(np.arange(len(names)), names)
        axes.set(
            xlim=(0, 100), ylim=(len(names) - 0.5, -0.5), xlabel="share of the problems that the method was run on [%]"
        )
        axes.tick_params(axis="y", length=0)
        axes.spines["left"].set_visible(False)
        axes.set_axisbelow(True)
        axes.grid(axis="x", color=SHADE, linewidth=0.6)
        figure.text(0.1 / WIDTH, 1 - 0.22 / height, title, fontsize=10.5, fontweight="bold", va="center")
        handles = [Patch(color=colour, label=text) for colour, text in looks]
        figure.legend(handles=handles, loc="upper left", bbox_to_anchor=(0.06 / WIDTH, 1 - 0.34 / height), ncols=4,
                      frameon=False, fontsize=8.5, handlelength=1.1, columnspacing=1.1, borderaxespad=0.0)  # fmt: skip
        save(figure, target)


def peers(data: xr.Dataset, target: Path) -> None:
    """Solved, refused and wrongly claimed by every method, of the problems that it was run on; its median time."""
    names = [str(name) for name in data["solver"].values]
    shares, times = np.zeros((len(names), 3)), []
    for i, name in enumerate(names):
        (good, run), (wrong, _) = solved(data, name), wrong_claims(data, name)
        shares[i] = np.array([good, run - good - wrong, wrong]) / run
        time = float(np.nanmedian(data["time"].sel(solver=name).values))
        times.append(f"{time:.2g} s" if time >= 0.1 else f"{1e3 * time:.2g} ms")
    looks = (
        (GOOD, "solved"),
        (TOLD, "not solved, or too slow, and says so"),
        (FALSE, "not solved, reports success"),
    )
    bars("Contact problems solved, and the median time of a solve", names, shares, looks, times, target)


def stability(rows: Sequence[Row], target: Path) -> None:
    """What every method made of the synthetic maps, of the problems that were not left out to save time."""
    names = [contender.name for contender in CONTENDERS]
    # the default alone was run on real bodies, too: what all methods were given is compared
    maps = set.intersection(*({row.map for row in rows if row.method == name} for name in names))
    shares, counts = np.zeros((len(names), len(LOOKS))), []
    for i, name in enumerate(names):
        own = [row.outcome for row in rows if row.method == name and row.map in maps and row.outcome != LEFT_OUT]
        shares[i] = [own.count(kind) / len(own) for kind in LOOKS]
        counts.append(f"of {len(own)}")
    title = "Softening, jumps and units over many orders of magnitude"
    bars(title, names, shares, [*LOOKS.values()], counts, target)
