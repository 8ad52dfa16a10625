"""Small multiples of friction laws, with their jumps filled in."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from tcstudy.reports import style
from tcstudy.reports.text import number
from tcstudy.scene.friction import DOWN, UP, FrictionLaw

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.axis import Axis
    from matplotlib.figure import Figure

Array = NDArray[np.float64]

COLUMNS = 3
SAMPLES = 100
"""Points on a curved piece; a straight one has two."""

LEGIBLE = (1e-2, 1e4)
"""Magnitudes that need no prefix."""

UP_STYLE: dict[str, Any] = {"color": style.BLUE, "linewidth": 3.2, "solid_capstyle": "butt"}
DOWN_STYLE: dict[str, Any] = {"color": style.VERMILLION, "linewidth": 2.2, "linestyle": (0, (2, 1.2))}
CURVE_STYLE: dict[str, Any] = {"color": style.INK, "linewidth": 1.4}


def draw_laws(laws: Sequence[FrictionLaw], target: Path) -> str:
    """Draw filled friction laws b̂(s) side by side into `target` (.png, .svg or .pdf by its suffix).

    Up-jumps, on which nodes stick, and down-jumps are told apart, and ω, the steepest fall, stands with each law.
    Returns one line that says what was drawn. Raises DrawError if there is no law to draw, if `target` cannot be
    written or if matplotlib is not installed.
    """
    style.check_target(target)
    if not laws:
        raise style.DrawError("there is no friction law to draw; give at least one")
    with style.styled():
        style.save(law_figure(laws), target)
    return f"{target}: {len(laws)} friction laws"


def law_figure(laws: Sequence[FrictionLaw]) -> Figure:
    """The figure of `draw_laws`; call it within `style.styled()` for the usual letters."""
    from matplotlib.figure import Figure

    columns = min(COLUMNS, len(laws))
    rows = -(-len(laws) // columns)
    high, foot = 2.1, 0.5
    figure = Figure(figsize=(style.WIDTH, rows * high + foot))
    across = style.WIDTH / columns
    for i, law in enumerate(laws):
        row, column = divmod(i, columns)
        bottom = foot + (rows - 1 - row) * high + 0.35
        axes = style.inches(figure, column * across + 0.5, bottom, across - 0.65, high - 0.75)
        draw_law(axes, law)
    _key(figure)
    return figure


def draw_law(axes: Axes, law: FrictionLaw) -> None:
    """One law: its pieces as curves, each jump as the vertical interval that fills it."""
    reach = slip_range(law)
    for s, b in curves(law, reach):
        axes.plot(s, b, **CURVE_STYLE)
    kinds = [(UP, UP_STYLE), (DOWN, DOWN_STYLE)]
    for kind, look in kinds:
        for k in np.flatnonzero(law.kinds == kind):
            axes.plot([law.kinks[k]] * 2, [law.b_left[k], law.b_right[k]], **look)
    axes.axhline(0.0, color=style.PALE, linewidth=0.7, zorder=0)
    axes.axvline(0.0, color=style.PALE, linewidth=0.7, zorder=0)
    axes.set_xlim(-reach, reach)
    axes.margins(y=0.12)
    for axis, largest in ((axes.xaxis, reach), (axes.yaxis, max(map(abs, axes.get_ylim())))):
        _ticks(axis, largest)
    axes.set_title(law.name, loc="left", fontweight="bold")
    axes.set_title(rf"$\omega$ = {_short(law.omega)}", loc="right")


def _ticks(axis: Axis, largest: float) -> None:
    """A few round numbers; very large or small ones with a prefix, "20M", so that no power stands in the title."""
    from matplotlib.ticker import EngFormatter, MaxNLocator

    axis.set_major_locator(MaxNLocator(nbins=5, steps=[1, 2, 5, 10]))
    if not LEGIBLE[0] <= largest < LEGIBLE[1]:
        axis.set_major_formatter(EngFormatter(sep=""))


def _short(value: float) -> str:
    """Three digits, with a prefix where there is one on the axes, too: "375G"."""
    from matplotlib.ticker import EngFormatter

    if value == 0.0 or not math.isfinite(value) or LEGIBLE[0] <= value < LEGIBLE[1]:
        return number(value, 3)
    return EngFormatter(sep="")(float(f"{value:.3g}"))


def slip_range(law: FrictionLaw) -> float:
    """Largest |s| drawn: past the outermost kink and three decay lengths; 1 for a law without either."""
    reach = float(np.abs(law.kinks).max(initial=0.0))
    decay = float((1.0 / np.abs(law.r[law.r != 0.0])).max(initial=0.0))
    return max(1.4 * reach, 4.0 * decay) or 1.0


def curves(law: FrictionLaw, reach: float) -> list[tuple[Array, Array]]:
    """(s, b) along each piece of the law within −reach … reach."""
    ends = np.concatenate([[-reach], law.kinks, [reach]])
    found = []
    for piece in range(len(law.q)):
        s = np.linspace(ends[piece], ends[piece + 1], SAMPLES if law.a[piece] else 2)
        found.append((s, law.value(s, piece)))
    return found


def _key(figure: Figure) -> None:
    """What the line styles mean, once for all panels."""
    from matplotlib.lines import Line2D

    figure.legend(
        handles=[
            Line2D([], [], **CURVE_STYLE, label="b(s) = $-S_T$ against the slip s = $u_T$"),
            Line2D([], [], **UP_STYLE, label="up-jump: sticks here"),
            Line2D([], [], **DOWN_STYLE, label="down-jump: sudden loss"),
        ],
        loc="lower center",
        ncols=3,
        frameon=False,
        handlelength=2.2,
    )
