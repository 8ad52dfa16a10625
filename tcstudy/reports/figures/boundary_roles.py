"""The boundary of a drawn body by what its edges do: a line of its own for each role, hatched where it is clamped."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from tcstudy.reports.figures import style
from tcstudy.reports.figures.body_panel import boundary_edges, loops
from tcstudy.reports.picture import BodyFields
from tcstudy.reports.stored_study import NamedEdge, nearest

if TYPE_CHECKING:
    from matplotlib.axes import Axes

Array = NDArray[np.float64]

ROLES: dict[str, dict[str, Any]] = {
    "clamped": {"color": style.INK, "linewidth": 2.2},
    "symmetry": {"color": style.INK, "linewidth": 1.6, "linestyle": "dashdot"},
    "rigid": {"color": style.INK, "linewidth": 3.0},
    "contact": {"color": style.BLUE, "linewidth": 3.0},
    "convection": {"color": style.GREEN, "linewidth": 2.4},
    "traction": {"color": style.SERIES[3], "linewidth": 2.4},
    "free": {"color": style.INK, "linewidth": 1.0},
}
"""How edges of each role are drawn."""
TICK, SPACING = 0.07, 0.09
"""Length of the hatches of a clamped edge and their distance [inch]."""


@dataclass(frozen=True)
class EdgeRun:
    """A part of the boundary that belongs to one edge: nodes in order, with the body on their left."""

    edge: NamedEdge
    nodes: NDArray[np.intp]


def runs(body: BodyFields, named: Sequence[NamedEdge]) -> list[EdgeRun]:
    """The boundary of a mesh cut where one edge ends and another begins; empty if no edges are known."""
    if not named:
        return []
    found = []
    for loop in loops(boundary_edges(body)):
        middles = 0.5 * (np.column_stack([body.x, body.y])[loop[1:]] + np.column_stack([body.x, body.y])[loop[:-1]])
        at = nearest(middles, list(named))
        cuts = np.flatnonzero(np.diff(at)) + 1
        if len(cuts):  # begin at a cut, so that no edge is in two parts
            loop, at = np.append(np.roll(loop[:-1], -cuts[0]), loop[cuts[0]]), np.roll(at, -cuts[0])
            cuts = np.flatnonzero(np.diff(at)) + 1
        for part in np.split(np.arange(len(at)), cuts):
            found.append(EdgeRun(named[at[part[0]]], np.append(loop[part], loop[part[-1] + 1])))
    return found


def draw_roles(axes: Axes, x: Array, y: Array, parts: Sequence[EdgeRun], per_inch: float) -> None:
    """Draw the parts of the boundary at the places x, y of the nodes; per_inch: length drawn as one inch."""
    for run in parts:
        axes.plot(x[run.nodes], y[run.nodes], solid_capstyle="butt", zorder=3, **ROLES[run.edge.role])
        if run.edge.role == "clamped":
            _hatch(axes, np.column_stack([x[run.nodes], y[run.nodes]]), per_inch)


def _hatch(axes: Axes, line: Array, per_inch: float) -> None:
    """Short slanted strokes on the outer side of a line."""
    count = max(int(np.hypot(*np.diff(line, axis=0).T).sum() / (SPACING * per_inch)), 1)
    for i in range(count):
        foot, t = _at(line, (i + 0.5) / count)
        head = foot + TICK * per_inch * (np.array([t[1], -t[0]]) - t)
        axes.plot(*np.transpose([foot, head]), color=style.INK, linewidth=0.8, zorder=3, clip_on=False)


def _at(line: Array, part: float) -> tuple[Array, Array]:
    """The place at a part of the length of a line, and the direction there."""
    step = np.diff(line, axis=0)
    s = np.concatenate([[0.0], np.cumsum(np.hypot(*step.T))])
    k = min(int(np.searchsorted(s, part * s[-1], side="right")) - 1, len(step) - 1)
    t = step[k] / np.hypot(*step[k])
    return line[k] + (part * s[-1] - s[k]) * t, t


def words(run: EdgeRun) -> str:
    """What an edge is and does, "end: convection, traction"."""
    more = ", traction" if run.edge.loaded and run.edge.role != "traction" else ""
    return f"{run.edge.name}: {run.edge.role}{more}"


def name_parts(axes: Axes, x: Array, y: Array, parts: Sequence[EdgeRun], per_inch: float, letter: float) -> None:
    """Name each edge once, outside its longest part and along it, where the name is no longer than that.

    letter: width of a letter [inch]
    """
    longest: dict[str, tuple[float, EdgeRun]] = {}
    for run in parts:
        length = float(np.hypot(np.diff(x[run.nodes]), np.diff(y[run.nodes])).sum()) / per_inch
        if run.edge.role not in ("free", "contact") and length > longest.get(run.edge.name, (0.0, run))[0]:
            longest[run.edge.name] = (length, run)
    for length, run in longest.values():
        text = next((t for t in (words(run), run.edge.name) if letter * len(t) <= length), "")
        middle, t = _at(np.column_stack([x[run.nodes], y[run.nodes]]), 0.5)
        at = middle + 0.18 * per_inch * np.array([t[1], -t[0]])
        angle = float(np.degrees(np.arctan2(t[1], t[0])))
        angle = angle - 180.0 if angle > 90.0 else angle + 180.0 if angle <= -90.0 else angle
        axes.text(float(at[0]), float(at[1]), text, rotation=angle, rotation_mode="anchor", ha="center", va="center",
                  color=ROLES[run.edge.role]["color"], zorder=6)  # fmt: skip
