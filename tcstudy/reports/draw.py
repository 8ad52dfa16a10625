"""`tcstudy draw`: a picture of one sweep point of a result file, from the stored data alone."""

from __future__ import annotations

import textwrap
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING

from tcstudy.reports import style
from tcstudy.reports.body_panel import Drawn, draw_body, drawn
from tcstudy.reports.law_figure import draw_laws
from tcstudy.reports.line_panel import draw_line
from tcstudy.reports.picture import Picture, read_picture
from tcstudy.reports.select_point import Value
from tcstudy.reports.style import DrawError
from tcstudy.reports.text import label, number

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__ = ["DrawError", "draw", "draw_laws", "point_figure"]

LEFT, RIGHT, PANEL = 0.85, 0.3, 1.3
"""Margins of the picture and height of a contact panel [inch]."""

LINE_HEIGHT, COLUMNS = 0.19, 104
"""Height [inch] and letters of a line of the caption."""

SYMBOLS = {
    **{name: rf"$\{name}$" for name in ("alpha", "beta", "delta", "lambda", "mu", "nu", "tau", "theta")},
    "theta_bar": r"$\bar\theta$",
    "alpha_T": r"$\alpha_T$",
    "tau_s": r"$\tau_s$",
    "tau_k": r"$\tau_k$",
}
"""The paper's symbols for swept parameters; others stand under their names."""


def draw(path: Path, target: Path, point: Mapping[str, Value] | None = None, level: int = -1) -> str:
    """Draw one sweep point of the result file `path` into `target` (.png, .svg or .pdf by its suffix).

    point: label by name of the swept parameter, {"alpha": 100, "friction": "softening"}; numbers in the units of
           the file or texts with a unit. A parameter left out has its first value.
    level: mesh level from 0, or from the finest with -1, -2, …

    Returns one line that says what was drawn. Raises StoreError if `path` is not a complete result file, DrawError
    if it does not hold such a solved point, if `target` cannot be written or if matplotlib is not installed.
    """
    style.check_target(target)
    with style.styled():
        picture = read_picture(path, point, level)
        style.save(point_figure(picture), target)
    fields = "" if picture.body else " (contact line only: the run kept no fields, see output.fields)"
    return f"{target}: {picture.point or picture.title}, level {picture.level}{fields}"


def point_figure(picture: Picture) -> Figure:
    """The figure of one point; call it within `style.styled()` for the usual letters."""
    from matplotlib.figure import Figure

    caption = _caption(picture)
    head = 0.42 + LINE_HEIGHT * len(caption)
    shape = drawn(picture.body, picture.line.length_units) if picture.body else None
    body_height = shape.size[1] + 0.95 if shape else 0.0
    feet = 0.55 + 2 * PANEL + 0.28
    height = head + body_height + feet + 0.3
    figure = Figure(figsize=(style.WIDTH, height))
    figure.text(LEFT / style.WIDTH, 1 - 0.27 / height, picture.title, fontsize=12, fontweight="bold", parse_math=False)
    for i, text in enumerate(caption):
        figure.text(LEFT / style.WIDTH, 1 - (0.32 + LINE_HEIGHT * (i + 1)) / height, text)
    if shape:
        _put_body(figure, picture, shape, feet + 0.3 + 0.55)
    width = style.WIDTH - LEFT - RIGHT
    lower = style.inches(figure, LEFT, 0.55, width, PANEL)
    upper = style.inches(figure, LEFT, 0.55 + PANEL + 0.28, width, PANEL)
    draw_line(upper, lower, picture.line, width)
    figure.align_ylabels([upper, lower])
    return figure


def _put_body(figure: Figure, picture: Picture, shape: Drawn, bottom: float) -> None:
    assert picture.body
    width, height = shape.size
    axes = style.inches(figure, LEFT, bottom, width, height)
    draw_body(figure, axes, picture.body, picture.line, shape)


def _caption(picture: Picture) -> list[str]:
    """Lines below the title: the swept parameters, then the mesh and how well the inclusion is met."""
    parts = []
    for name, value, units in picture.parameters:
        symbol = SYMBOLS.get(name, name.replace("_", " "))
        if isinstance(value, str):
            parts.append(f"{symbol}: {value}".replace("$", r"\$") if name not in SYMBOLS else f"{symbol}: {value}")
            continue
        divisor, unit = style.scaled_unit([value], units)
        parts.append(f"{symbol} = {label(value / divisor)} {style.pretty(unit)}".rstrip())
    divisor, unit = style.scaled_unit([picture.h_max], picture.line.length_units)
    size = f"{number(picture.h_max / divisor, 3)} {style.pretty(unit)}".rstrip()
    mesh = [
        f"level {picture.level}",
        f"longest element edge {size}",
        f"{picture.n_dof} displacement unknowns",
        f"inclusion residual {number(picture.residual, 2)}",
    ]
    wrap = textwrap.TextWrapper(width=COLUMNS, break_long_words=False)
    return [line for text in (",  ".join(parts), ",  ".join(mesh)) for line in wrap.wrap(text)]
