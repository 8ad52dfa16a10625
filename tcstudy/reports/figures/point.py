"""The picture of one sweep point of a result file: the body, and below it u_T, ξ = −S_T, N along the contact line."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from tcstudy.reports.figures import style
from tcstudy.reports.figures.body import Drawn, draw_body, drawn, field_of
from tcstudy.reports.figures.panels import Panel, Scale, scale
from tcstudy.reports.figures.sheet import Sheet
from tcstudy.reports.picture import NEAR, LineFields, Picture
from tcstudy.reports.text import number, with_unit

if TYPE_CHECKING:
    from matplotlib.figure import Figure

PANEL, BODY = 1.3, 4.4
"""Height of a contact panel and largest height of the body [inch]."""
BESIDE = 2.1
"""Room left and right of the body, with the bar of the temperature [inch]."""
FEW = 60
"""Contact nodes up to which each one gets a dot."""


def point_figure(picture: Picture, look: style.Look, of: str | None = None, factor: float | None = None) -> Figure:
    """The figure of one point; call it within `style.styled()` for its letters.

    of: the field of the body (`field_of`);  factor: of its displacement, None for one that suits
    """
    line, body, at = picture.line, picture.body, picture.at
    width = (look.size[0] / (look.letters / style.USUAL) if look.size else style.WIDTH) - BESIDE
    shape = drawn(body, line.length_units, width, BODY, factor) if body else None
    field = field_of(picture, of)
    below = ["upper", "lower", *(["section"] if line.section else [])]
    rows, heights = [[name] for name in below], [PANEL] * len(below)
    if shape:
        rows, heights = [["body"], *rows], [shape.height, *heights]
    mesh = [
        f"level {picture.level}",
        f"longest element edge {with_unit(float(at['h_max']), line.length_units, 3)}",
        f"{int(at['n_dof'])} displacement unknowns",
        f"inclusion residual {number(float(at['inclusion_residual']), 2)}",
    ]
    sheet = Sheet(look, picture.title, [style.point_words(picture.point), ",  ".join(mesh)], rows, heights)
    aligned = shape is not None and origin_below(line) is not None
    along = _draw_line(sheet, picture, width, aligned)
    if shape:
        draw_body(sheet, sheet.panels["body"], picture, shape, field)
    figure = sheet.finish()
    if shape and aligned:  # the body has the width of its panel now
        for name in below:
            sheet.panels[name].set_xlim(*window_below(line, sheet.panels["body"].get_xlim(), shape, along.one))
    return figure


def origin_below(line: LineFields) -> tuple[float, float] | None:
    """(sign, x at s = 0) of a contact line that is straight along x, where x = x_0 ± s; None for any other."""
    length = float(line.c.sum())
    if np.ptp(line.y) > NEAR * length or len(line.x) < 2:
        return None
    sign = 1.0 if line.x[-1] > line.x[0] else -1.0
    start = line.x - sign * line.arclength
    return None if np.ptp(start) > NEAR * length else (sign, float(start[0]))


def window_below(line: LineFields, window: tuple[float, float], shape: Drawn, metre: float) -> tuple[float, float]:
    """Ends of a panel that stands below that of the body, so that s lies below its x [metre]."""
    origin = origin_below(line)
    assert origin is not None
    left, right = (origin[0] * (x * shape.axis.one - origin[1]) / metre for x in window)
    return left, right


def _draw_line(sheet: Sheet, picture: Picture, width: float, wider: bool) -> Scale:
    """u_T and ξ over the arclength, the scale of which it returns; `width` is that of the panels [inch].

    wider: whether the panels reach beyond the line; then ticks and frame end with it
    ξ is drawn as it is computed: constant on the segment S_i around every contact node.
    """
    line, length = picture.line, float(picture.line.c.sum())
    edges = np.unique(line.edge)
    alone = len(edges) == 1 and edges[0] < len(line.edge_names)
    along = line.edge_names[edges[0]] if alone else "the contact line"
    s = scale(f"arclength s along {along}", [length], line.length_units)
    upper = Panel(s, scale("$u_T$", line.u_T, line.length_units), f"Contact line: {stick_text(line)}")
    lower = Panel(s, scale(r"$\xi = -S_T$", line.xi, line.traction_units))
    panels = {"upper": (upper, line.u_T), "lower": (lower, line.xi)}
    if line.section:
        N, units = line.section
        panels["section"] = Panel(s, scale("$N$", N, units), "Force of the section, positive in tension"), N
        panels["section"][0].line(line.arclength, N, color=style.GREEN, linewidth=1.5)
    for panel, values in panels.values():
        for start, end in stick_ranges(line):
            panel.shade(start, end)
        panel.across(0.0, color=style.PALE, zorder=1)
        panel.limits = [(0.0, length / s.one), None if np.any(values) else (-1.0, 1.0)]
    for k, part in enumerate(line.parts):
        ends, nodes = line.steps(part)
        at = np.append(line.arclength[part], ends[-1])[: len(nodes)]  # a ring ends with its first node
        first, last = picture.held[k] if picture.held else (None, None)
        held = [(x, u) for x, u in ((ends[0], first), (ends[-1], last)) if u is not None]
        curve = [*held[: first is not None], *zip(at, line.u_T[nodes], strict=True), *held[first is not None :]]
        dots: dict[str, Any] = {"marker": "o" if len(line.u_T) <= FEW else "", "markersize": 3.0, "clip_on": False}
        upper.line(*np.array(curve).T, color=style.BLUE, linewidth=1.5, **dots)
        lower.line(np.repeat(ends, 2)[1:-1], np.repeat(line.xi[nodes], 2), color=style.VERMILLION, linewidth=1.5)
        _draw_held(upper, held, at, line.u_T)
    _name_edges(upper, lower, line, width)
    for name, (panel, values) in panels.items():
        axes = sheet.panels[name]
        panel.draw(axes)
        if wider:
            places = [tick for tick in axes.get_xticks() if -1e-9 <= tick * s.one / length <= 1.0 + 1e-9]
            axes.set_xticks(places)
            axes.spines["bottom"].set_bounds(0.0, length / s.one)
        if not np.any(values):  # a scale around nothing but zero would mean nothing
            axes.set_yticks([0.0])
    sheet.share(*panels)
    return s


def _draw_held(panel: Panel, held: list[tuple[float, float]], at: Any, u_T: Any) -> None:
    """Squares at held ends, named at the lower one, where there is room above, or else below."""
    if not held:
        return
    panel.line(*np.array(held).T, color=style.INK, marker="s", markersize=5, linestyle="none", zorder=4)
    x, u = min(held, key=lambda end: end[1])
    side, shift = ("left", 4) if x < np.mean(at) else ("right", -4)
    above = u < 0.7 * np.max(u_T, initial=0.0) or u <= 0.0
    panel.note("held", (x, u), (shift, 5 if above else -16), ha=side, fontsize=8.5)


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


def _name_edges(upper: Panel, lower: Panel, line: LineFields, width: float) -> None:
    """Thin lines where one contact edge ends and another begins, names between them where they fit."""
    cuts = np.flatnonzero(np.diff(line.edge)) + 1
    if not len(cuts):
        return
    length = float(line.c.sum())
    ends = [0.0, *(0.5 * (line.arclength[cuts - 1] + line.arclength[cuts])).tolist(), length]
    for panel in (upper, lower):
        for cut in ends[1:-1]:
            panel.up(cut, color=style.PALE, zorder=1)
    for first, start, end in zip([0, *cuts.tolist()], ends[:-1], ends[1:], strict=True):
        name = line.edge_names[line.edge[first]] if line.edge[first] < len(line.edge_names) else ""
        if style.LETTER * len(name) <= (end - start) / length * width:
            lower.note(name, ((start + end) / 2, 0.0), (0, 2), top=True, ha="center", va="bottom", color=style.BLUE,
                       fontweight="bold")  # fmt: skip
