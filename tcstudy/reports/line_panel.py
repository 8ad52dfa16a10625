"""The lower panels: u_T and ξ = −S_T along the contact line, its sticking part shaded."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from tcstudy.reports import style
from tcstudy.reports.picture import LineFields

if TYPE_CHECKING:
    from matplotlib.axes import Axes

Array = NDArray[np.float64]

FEW = 60
"""Contact nodes up to which each one gets a dot."""


def draw_line(upper: Axes, lower: Axes, line: LineFields, width: float) -> None:
    """Both panels; they share the arclength, and `width` is their width [inch].

    ξ is drawn as it is computed: constant on the segment S_i around every contact node.
    """
    length = float(line.c.sum())
    metre, unit = style.axis_unit([length], line.length_units)
    slip, slip_unit = style.axis_unit(line.u_T, line.length_units)
    stress, stress_unit = style.axis_unit(line.xi, line.traction_units)
    for axes in (upper, lower):
        _shade(axes, line, metre)
        axes.axhline(0.0, color=style.PALE, linewidth=0.8, zorder=1)
        axes.set_xlim(0.0, length / metre)
    for axes, values in ((upper, line.u_T), (lower, line.xi)):
        if not np.any(values):  # a scale around nothing but zero would mean nothing
            axes.set_ylim(-1.0, 1.0)
            axes.set_yticks([0.0])
    dots: dict[str, Any] = {"marker": "o" if len(line.u_T) <= FEW else "", "markersize": 3.0, "clip_on": False}
    for part in line.parts:
        ends, nodes = line.steps(part)
        at = np.append(line.arclength[part], ends[-1])[: len(nodes)]  # a ring ends with its first node
        upper.plot(at / metre, line.u_T[nodes] / slip, color=style.BLUE, linewidth=1.5, **dots)
        lower.stairs(line.xi[nodes] / stress, ends / metre, baseline=None, color=style.VERMILLION, linewidth=1.5)
    upper.tick_params(labelbottom=False)
    upper.set_ylabel(style.labelled("$u_T$", slip_unit))
    lower.set_ylabel(style.labelled(r"$\xi = -S_T$", stress_unit))
    lower.set_xlabel(style.labelled(_along(line), unit))
    upper.set_title(f"Contact line: {stick_text(line)}", loc="left")
    if len(np.unique(line.edge)) > 1:
        _name_runs(upper, lower, line, metre, width)


def stick_text(line: LineFields) -> str:
    """How much of the contact line sticks, in words."""
    if line.sticks is None:
        return "the file does not tell which part sticks"
    if not line.sticks.any():
        return "all of it slips"
    if line.sticks.all():
        return "all of it sticks (shaded)"
    share = line.c[line.sticks].sum() / line.c.sum()
    return f"the shaded part sticks ({100.0 * share:.1f} %), the rest slips"


def stick_ranges(line: LineFields) -> list[tuple[float, float]]:
    """Arclengths between which the line sticks: joined segments S_i of sticking nodes."""
    ranges: list[tuple[float, float]] = []
    if line.sticks is None:
        return ranges
    for part in line.parts:
        ends, nodes = line.steps(part)
        change = np.diff(np.concatenate([[0], line.sticks[nodes].astype(int), [0]]))
        first, last = np.flatnonzero(change == 1), np.flatnonzero(change == -1)
        ranges += [(float(ends[a]), float(ends[b])) for a, b in zip(first, last, strict=True)]
    return ranges


def _shade(axes: Axes, line: LineFields, metre: float) -> None:
    for start, end in stick_ranges(line):
        axes.axvspan(start / metre, end / metre, color=style.SHADE, linewidth=0, zorder=0)


def _along(line: LineFields) -> str:
    edges = np.unique(line.edge)
    if len(edges) == 1 and edges[0] < len(line.edge_names):
        return f"arclength s along {line.edge_names[edges[0]]}"
    return "arclength s along the contact line"


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
            lower.text(
                (start + end) / 2 / metre,
                1.03,
                name,
                transform=lower.get_xaxis_transform(),
                color=style.BLUE,
                fontweight="bold",
                ha="center",
                va="bottom",
            )
