"""What a figure shows: its curves, its texts, and which of them are in each other's way."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from tcstudy.laws.laws import Laws
from tcstudy.laws.shapes import SHAPES
from tcstudy.reports.figures import draw, style
from tcstudy.reports.figures.point import point_figure
from tcstudy.reports.picture import LineFields, Picture

if TYPE_CHECKING:
    from matplotlib.figure import Figure

SIZES = (None, (3.15, 8.0))
"""Usual, and of one column of a paper [inch]."""


def drawn(file: Path, **wanted: Any) -> tuple[Figure, str]:
    with draw.drawn(file, **wanted) as (figure, words, _):
        return figure, words


def figure_of(picture: Picture, *more: Any) -> Figure:
    with style.styled():
        return point_figure(picture, style.Look(), *more)


def contact_panels(figure: Figure) -> tuple[Any, Any]:
    upper, lower = (
        [a for a in figure.axes if a.get_ylabel().startswith(name)] for name in ("$u_{T}$", "ξ")
    )
    return upper[0], lower[0]


def shown_line(axes: Any) -> np.ndarray[Any, Any]:
    """(2, m) data of the curve among the lines of a panel (the others are reference lines of two
    points)."""
    (curve,) = [line for line in axes.lines if len(line.get_xdata()) > 2]
    return np.array(curve.get_data(), dtype=float)


def key_of(figure: Figure, k: int = 0) -> list[str]:
    return [text.get_text() for text in figure.legends[k].get_texts()]


def crowded(figure: Figure, alone: bool = False) -> list[str]:
    """Texts that one sees which leave the picture or, unless only that is asked for, overlap
    another one."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.text import Text

    renderer, hidden = FigureCanvasAgg(figure).get_renderer(), set()
    figure.draw(renderer)
    for axis in (
        one for axes in figure.axes for one in (axes.xaxis, axes.yaxis)
    ):  # numbers outside are not seen
        low, high = sorted(axis.get_view_interval())
        slack = 1e-9 * (high - low)
        ticks = [*axis.get_major_ticks(), *axis.get_minor_ticks()]
        hidden |= {id(t.label1) for t in ticks if not low - slack <= t.get_loc() <= high + slack}
    shown = [text for text in figure.findobj(Text) if isinstance(text, Text) and text.get_visible()]
    seen = [text for text in shown if id(text) not in hidden and text.get_text().strip()]
    boxes, page = (
        [(text.get_text(), text.get_window_extent(renderer)) for text in seen],
        figure.bbox.padded(1.0),
    )
    found = [
        text for text, b in boxes if not (page.contains(b.x0, b.y0) and page.contains(b.x1, b.y1))
    ]
    for i, (text, box) in enumerate(() if alone else boxes):
        found += [f"{text} overlaps {other}" for other, rival in boxes[:i] if box.overlaps(rival)]
    return found


def line(
    x: list[float], y: list[float], s: list[float], c: list[float], edge: list[int]
) -> LineFields:
    arrays, u_T = [np.array(values) for values in (s, x, y, c)], np.arange(1.0, len(x) + 1)
    return LineFields(
        *arrays, np.array(edge), ("pad", "rim"), u_T, 10.0 * u_T, u_T > 1.0, "m", "Pa"
    )


def example_laws() -> tuple[Laws, ...]:
    """One law of every named shape, with parameters near 1."""
    parameters: dict[str, dict[str, object]] = {
        "tresca": {"tau": 1.0},
        "slip-weakening": {"tau_s": 1.0, "tau_k": 0.3, "delta": 1.0},
        "exponential": {"a": 1.0, "b": 0.3, "delta": 0.5},
        "saw-tooth": {"tau": 1.0, "delta": 0.5, "teeth": 3, "drop": 0.6, "decay": 0.8},
        "piecewise-linear": {"points": [(0.0, 0.0), (0.5, 1.0), (1.0, 1.0), (1.0, 0.4)]},
        "coulomb": {"mu_s": 1.0, "mu_k": 0.4, "delta": 1.0},
        "linear": {"k": 0.5},
        "elastic-plastic": {"tau": 1.0, "s0": 0.3},
        "bilinear": {"tau": 1.0, "s0": 0.3, "sf": 1.2},
        "trapezoidal": {"tau": 1.0, "s0": 0.3, "s1": 0.6, "sf": 1.2},
        "trilinear": {"tau": 1.0, "s0": 0.3, "sf": 0.9, "tau_r": 0.3},
    }
    return tuple(shape.build(**parameters[name]) for name, shape in SHAPES.items())
