"""A picture of one sweep point of a result file: the body, and below it u_T and ξ = −S_T along the contact line."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from tcstudy.reports.figures import style
from tcstudy.reports.figures.body_panel import NAME, Drawn, draw_body, drawn
from tcstudy.reports.figures.boundary_roles import draw_roles, name_parts, runs
from tcstudy.reports.figures.sheet import Sheet
from tcstudy.reports.picture import NEAR, BodyFields, Held, LineFields, Picture, read_picture
from tcstudy.reports.select_point import Value
from tcstudy.reports.text import axis_unit, number

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

Array = NDArray[np.float64]

PANEL, BODY = 1.3, 4.4
"""Height of a contact panel and largest height of the body [inch]."""
BESIDE = 2.1
"""Room left and right of the body, with the bar of the temperature [inch]."""


def draw_point(path: Path, point: Mapping[str, Value] | None, level: int, look: style.Look) -> tuple[Figure, str]:
    """The picture of one sweep point of a run's file (see `read_picture`), and which it is."""
    picture = read_picture(path, point, level)
    fields = "" if picture.body else " (contact line only: the run kept no fields, see output.fields)"
    return point_figure(picture, look), f"{picture.point or picture.title}, level {picture.level}{fields}"


def point_figure(picture: Picture, look: style.Look | None = None) -> Figure:
    """The figure of one point; call it within `style.styled()` for its letters."""
    look, line, body = look or style.Look(), picture.line, picture.body
    scale = look.letters / style.USUAL
    width = look.size[0] / scale - BESIDE if look.size else style.WIDTH - BESIDE
    shape = drawn(body, line.length_units, width, BODY) if body else None
    rows, heights = [["upper"], ["lower"]], [PANEL, PANEL]
    if shape:
        rows, heights = [["body"], *rows], [shape.size[1], *heights]
    sheet = Sheet(look, picture.title, _caption(picture), rows, heights)
    upper, lower = sheet.panels["upper"], sheet.panels["lower"]
    window = window_below(line, body, shape) if shape and body else None
    metre = draw_line(upper, lower, line, width, picture.held, window is not None)
    if shape:
        _put_body(sheet, picture, shape)
    figure = sheet.finish()
    if window and shape and body:  # the body has the width of its panel now
        left, right = sheet.panels["body"].get_xlim()
        window = window_below(line, body, replace(shape, left=left, right=right))
        assert window is not None
        for axes in (upper, lower):
            axes.set_xlim(window[0] / metre, window[1] / metre)
    return figure


def _put_body(sheet: Sheet, picture: Picture, shape: Drawn) -> None:
    assert picture.body
    axes = sheet.panels["body"]
    draw_body(sheet, axes, picture.body, picture.line, shape)
    parts = [run for run in runs(picture.body, picture.edges) if run.edge.role not in ("contact", "free")]
    draw_roles(axes, shape.x, shape.y, parts, shape.per_inch)
    name_parts(axes, shape.x, shape.y, parts, shape.per_inch, style.LETTER)
    for source in picture.sources:
        _put_source(axes, picture.body, shape, source)
    axes.set_xlim(shape.left, shape.right, auto=True)  # at least: they grow to the shape of the panel
    axes.set_ylim(shape.bottom, shape.top, auto=True)


def _put_source(axes: Axes, body: BodyFields, shape: Drawn, source: Array) -> None:
    """The outline of a heated region, displaced like the nodes near it."""
    loop = np.append(source, source[:1], axis=0)
    fine = np.concatenate([a + np.linspace(0.0, 1.0, 16)[:, None] * (b - a) for a, b in pairwise(loop)])
    near = [int(np.argmin(np.hypot(body.x - x, body.y - y))) for x, y in fine]
    unit = float(np.ptp(body.x)) / float(np.ptp(shape.x0))
    x = fine[:, 0] / unit + shape.x[near] - shape.x0[near]
    y = fine[:, 1] / unit + shape.y[near] - shape.y0[near]
    axes.plot(x, y, color=style.INK, linewidth=1.1, linestyle=(0, (4, 2)), zorder=4)
    ground = {"boxstyle": "round,pad=0.15", "facecolor": "white", "edgecolor": "none", "alpha": 0.8}
    look: dict[str, Any] = {"ha": "center", "va": "center", "fontsize": style.pt(8.5), "bbox": ground, "zorder": 5}
    axes.text(float(x.mean()), float(y.mean()), "heated", **look)


def window_below(line: LineFields, body: BodyFields, shape: Drawn) -> tuple[float, float] | None:
    """Arclengths at the ends of a panel that stands below that of the body, so that s lies below its x [length units].

    None for a contact line that is not straight along x.
    """
    length = float(line.c.sum())
    if np.ptp(line.y) > NEAR * length or len(line.x) < 2:
        return None
    sign = 1.0 if line.x[-1] > line.x[0] else -1.0
    start = line.x - sign * line.arclength
    if np.ptp(start) > NEAR * length:
        return None
    unit = float(np.ptp(body.x)) / float(np.ptp(shape.x0))
    return sign * (shape.left * unit - float(start[0])), sign * (shape.right * unit - float(start[0]))


def _caption(picture: Picture) -> list[str]:
    """Lines below the title: the swept parameters, then the mesh and how well the inclusion is met."""
    size = style.with_unit(picture.h_max, picture.line.length_units, 3)
    mesh = [
        f"level {picture.level}",
        f"longest element edge {size}",
        f"{picture.n_dof} displacement unknowns",
        f"inclusion residual {number(picture.residual, 2)}",
    ]
    return [",  ".join(style.parameter_words(picture.parameters)), ",  ".join(mesh)]


FEW = 60
"""Contact nodes up to which each one gets a dot."""


def draw_line(upper: Axes, lower: Axes, line: LineFields, width: float, held: Sequence[Held], wider: bool) -> float:
    """Both panels; they share the arclength, of which what is returned is drawn as 1; `width` is their width [inch].

    held:  u_T at the held ends of every part, drawn where it is known
    wider: whether the panels reach beyond the line; then ticks and frame end with it
    ξ is drawn as it is computed: constant on the segment S_i around every contact node.
    """
    from matplotlib.ticker import MaxNLocator

    length = float(line.c.sum())
    metre, unit = axis_unit([length], line.length_units)
    slip, slip_unit = axis_unit(line.u_T, line.length_units)
    stress, stress_unit = axis_unit(line.xi, line.traction_units)
    for axes in (upper, lower):
        for start, end in stick_ranges(line):
            axes.axvspan(start / metre, end / metre, color=style.SHADE, linewidth=0, zorder=0)
        axes.axhline(0.0, color=style.PALE, linewidth=0.8, zorder=1)
        axes.set_xlim(0.0, length / metre)
        if wider:
            ticks = MaxNLocator(nbins=6, steps=[1, 2, 2.5, 5, 10]).tick_values(0.0, length / metre)
            axes.set_xticks([tick for tick in ticks if -1e-9 * length <= tick * metre <= (1.0 + 1e-9) * length])
            axes.spines["bottom"].set_bounds(0.0, length / metre)
    for axes, values in ((upper, line.u_T), (lower, line.xi)):
        if not np.any(values):  # a scale around nothing but zero would mean nothing
            axes.set_ylim(-1.0, 1.0)
            axes.set_yticks([0.0])
    dots: dict[str, Any] = {"marker": "o" if len(line.u_T) <= FEW else "", "markersize": 3.0, "clip_on": False}
    for k, part in enumerate(line.parts):
        ends, nodes = line.steps(part)
        at = np.append(line.arclength[part], ends[-1])[: len(nodes)]  # a ring ends with its first node
        u_T, (first, last) = line.u_T[nodes], held[k] if held else (None, None)
        if first is not None:
            at, u_T = np.append(ends[0], at), np.append(first, u_T)
        if last is not None:
            at, u_T = np.append(at, ends[-1]), np.append(u_T, last)
        upper.plot(at / metre, u_T / slip, color=style.BLUE, linewidth=1.5, **dots)
        places = [(end / metre, u / slip) for end, u in ((ends[0], first), (ends[-1], last)) if u is not None]
        upper.plot(*zip(*places, strict=True) if places else ((), ()), "s", color=style.INK, markersize=5, zorder=4)
        if places:  # named at the lower end, where there is room above, or else below
            low = min(places, key=lambda end: end[1])
            side, shift = ("left", 4) if low[0] < np.mean(at) / metre else ("right", -4)
            size, above = style.pt(8.5), low[1] < 0.7 * np.max(u_T, initial=0.0) / slip or low[1] <= 0.0
            upper.annotate(
                "held", low, (shift, 5 if above else -16), textcoords="offset points", ha=side, fontsize=size
            )
        lower.stairs(line.xi[nodes] / stress, ends / metre, baseline=None, color=style.VERMILLION, linewidth=1.5)
    upper.tick_params(labelbottom=False)
    upper.set_ylabel(style.labelled("$u_T$", slip_unit))
    lower.set_ylabel(style.labelled(r"$\xi = -S_T$", stress_unit))
    upper.set_title(f"Contact line: {stick_text(line)}", loc="left")
    edges = np.unique(line.edge)
    alone = len(edges) == 1 and edges[0] < len(line.edge_names)
    along = line.edge_names[edges[0]] if alone else "the contact line"
    lower.set_xlabel(style.labelled(f"arclength s along {along}", unit))
    if len(edges) > 1:
        _name_runs(upper, lower, line, metre, width)
    return metre


def stick_text(line: LineFields) -> str:
    """How much of the contact line sticks, in words."""
    if not line.sticks.any():
        return "all of it slips"
    if line.sticks.all():
        return "all of it sticks (shaded)"
    share = line.c[line.sticks].sum() / line.c.sum()
    return f"the shaded part sticks ({100.0 * share:.1f} %), the rest slips"


def stick_ranges(line: LineFields) -> list[tuple[float, float]]:
    """Arclengths between which the line sticks: joined segments S_i of sticking nodes."""
    ranges: list[tuple[float, float]] = []
    for part in line.parts:
        ends, nodes = line.steps(part)
        change = np.diff(np.concatenate([[0], line.sticks[nodes].astype(int), [0]]))
        first, last = np.flatnonzero(change == 1), np.flatnonzero(change == -1)
        ranges += [(float(ends[a]), float(ends[b])) for a, b in zip(first, last, strict=True)]
    return ranges


def _name_runs(upper: Axes, lower: Axes, line: LineFields, metre: float, width: float) -> None:
    """Thin lines where one contact edge ends and another begins, names between them where they fit."""
    cuts = np.flatnonzero(np.diff(line.edge)) + 1
    ends = [0.0, *(0.5 * (line.arclength[cuts - 1] + line.arclength[cuts])).tolist(), float(line.c.sum())]
    for cut in ends[1:-1]:
        for axes in (upper, lower):
            axes.axvline(cut / metre, color=style.PALE, linewidth=0.8)
    for first, start, end in zip([0, *cuts.tolist()], ends[:-1], ends[1:], strict=True):
        name = line.edge_names[line.edge[first]] if line.edge[first] < len(line.edge_names) else ""
        if style.LETTER * len(name) <= (end - start) / ends[-1] * width:
            place = {"x": (start + end) / 2 / metre, "y": 1.03, "transform": lower.get_xaxis_transform()}
            lower.text(s=name, ha="center", va="bottom", **place, **NAME)
