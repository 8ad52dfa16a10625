"""The panel of the body: deformed, coloured with a field, its edges drawn by what they do and named.

The boundary of a triangulation is found as closed chains of nodes, the contact line and the edges as parts of them.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from tcstudy.reports.figures import style
from tcstudy.reports.figures.panels import Array, Scale, note, scale
from tcstudy.reports.figures.sheet import Sheet
from tcstudy.reports.picture import BodyFields, LineFields, Picture
from tcstudy.reports.stored_study import NamedEdge, nearest
from tcstudy.reports.text import number, pretty

if TYPE_CHECKING:
    from matplotlib.axes import Axes

Indices = NDArray[np.intp]

MARGIN = 0.42
"""Room around the body for the names of its edges [inch]."""
SHOWN = 0.06
"""Largest displacement drawn, as a part of the diagonal of the body."""
FINE = 3000
"""Triangles from which on their sides would only darken the picture."""
UNIFORM = 1e-6
"""Relative spread up to which a field is drawn and named as one number."""
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


@dataclass(frozen=True)
class Drawn:
    """A body as it is drawn: exaggerated, in scaled units, with the extent of its panel.

    x, y, x0, y0: (n,) coordinates of the nodes, deformed and not, as they are drawn;  axis: what is drawn as 1
    factor:       exaggeration of the displacement
    box:          left, right, bottom and top of the panel;  per_inch: what is one inch of it
    """

    x: Array
    y: Array
    x0: Array
    y0: Array
    axis: Scale
    factor: float
    box: tuple[float, float, float, float]
    per_inch: float

    @property
    def height(self) -> float:
        """Height of the panel [inch]."""
        return (self.box[3] - self.box[2]) / self.per_inch


def exaggeration(body: BodyFields) -> float:
    """A factor 1, 2 or 5 times a power of ten that makes the displacement visible; 1 for a body at rest."""
    largest = float(np.hypot(body.u_x, body.u_y).max())
    if largest == 0.0:
        return 1.0
    wanted = SHOWN * math.hypot(np.ptp(body.x), np.ptp(body.y)) / largest
    power = 10.0 ** math.floor(math.log10(wanted))
    return float(f"{max(step for step in (1, 2, 5) if step == 1 or step * power <= wanted) * power:.1g}")


def drawn(body: BodyFields, length_units: str, widest: float = 5.9, highest: float = 4.4) -> Drawn:
    """Scale a body to its panel, at most so wide and high [inch]."""
    factor = exaggeration(body)
    axis = scale("", [np.ptp(body.x), np.ptp(body.y)], length_units)
    x0, y0 = axis(body.x), axis(body.y)
    x, y = axis(body.x + factor * body.u_x), axis(body.y + factor * body.u_y)
    (left, right), (bottom, top) = ((min(a.min(), b.min()), max(a.max(), b.max())) for a, b in ((x, x0), (y, y0)))
    per_inch = max((right - left) / (widest - 2 * MARGIN), (top - bottom) / (highest - 2 * MARGIN))
    pad = MARGIN * per_inch
    return Drawn(x, y, x0, y0, axis, factor, (left - pad, right + pad, bottom - pad, top + pad), per_inch)


def draw_body(sheet: Sheet, axes: Axes, picture: Picture, shape: Drawn) -> None:
    """Fill the panel and put the colour bar of the temperature to its right."""
    body = picture.body
    assert body is not None
    axes.set(xlabel=f"x{shape.axis.label}", ylabel=f"y{shape.axis.label}")
    axes.set_aspect("equal", adjustable="datalim")
    said = _fill(sheet, axes, shape, body.triangles, body.theta, body.theta_units)
    axes.set_title(f"Deformed body (deformation × {shape.factor:g}; dashed: undeformed){said}", loc="left")
    if len(body.triangles) <= FINE:
        axes.triplot(shape.x, shape.y, body.triangles, color=style.INK, linewidth=0.4, alpha=0.25)
    chains = loops(boundary_edges(body))
    for loop in chains:
        axes.plot(shape.x0[loop], shape.y0[loop], color=style.INK, alpha=0.6, linewidth=0.9, linestyle=(0, (5, 3)))
        axes.plot(shape.x[loop], shape.y[loop], color=style.INK, linewidth=1.0)
    named = [run for run in runs(body, chains, picture.edges) if run[0].role not in ("contact", "free")]
    _draw_edges(axes, shape, named)
    _draw_contact(axes, shape, contact_chains(body, chains, picture.line), picture.line)
    for source in picture.sources:
        _draw_source(axes, body, shape, source)
    axes.set_xlim(*shape.box[:2], auto=True)  # at least: they grow to the shape of the panel
    axes.set_ylim(*shape.box[2:], auto=True)


def _fill(sheet: Sheet, axes: Axes, shape: Drawn, triangles: Indices, theta: Array | None, units: str) -> str:
    """Colour the body in bands between round temperatures, with a bar; or evenly, and return what there is to say."""
    from matplotlib.colors import ListedColormap
    from matplotlib.ticker import MaxNLocator
    from matplotlib.tri import Triangulation

    if theta is None or np.ptp(theta) <= UNIFORM * np.abs(theta).max():
        colour = ListedColormap([style.SHADE if theta is None else style.EVEN])
        axes.tripcolor(shape.x, shape.y, triangles, facecolors=np.zeros(len(triangles)), cmap=colour)
        if theta is None:
            return ""
        return rf",  $\theta$ = {number(float(theta.mean()))} {pretty(units)}".rstrip() + " everywhere"
    bands = MaxNLocator(nbins=12, steps=[1, 2, 2.5, 5, 10]).tick_values(theta.min(), theta.max())
    filled = axes.tricontourf(Triangulation(shape.x, shape.y, triangles), theta, levels=bands, cmap=style.HEAT)
    sheet.bar(axes, filled, style.labelled(r"temperature $\theta$", units))
    return ""


def _draw_edges(axes: Axes, shape: Drawn, named: Sequence[tuple[NamedEdge, Indices]]) -> None:
    """Lines in the way of their roles, hatched outside where clamped; each name once, along its longest run."""
    from matplotlib.patheffects import TickedStroke

    longest: dict[str, tuple[float, NamedEdge, Indices]] = {}
    for edge, nodes in named:
        x, y = shape.x[nodes], shape.y[nodes]
        axes.plot(x, y, solid_capstyle="butt", zorder=3, **ROLES[edge.role])
        if edge.role == "clamped":
            strokes = [TickedStroke(spacing=6.5, angle=-135, length=0.7, linewidth=0.8)]
            axes.plot(x, y, color=style.INK, zorder=3, path_effects=strokes)
        length = float(np.hypot(np.diff(x), np.diff(y)).sum()) / shape.per_inch
        if length > longest.get(edge.name, (0.0, edge, nodes))[0]:
            longest[edge.name] = (length, edge, nodes)
    for length, edge, nodes in longest.values():
        words = (edge_words(edge), edge.name)
        text = next((text for text in words if style.LETTER * len(text) <= length), "")
        at, t = _middle(shape, nodes)
        angle = (math.degrees(math.atan2(t[1], t[0])) + 90.0 - 1e-9) % 180.0 - 90.0
        how = {"rotation": angle, "rotation_mode": "anchor", "ha": "center", "va": "center", "zorder": 6}
        note(axes, text, at, (13.0 * t[1], -13.0 * t[0]), color=ROLES[edge.role]["color"], **how)


def edge_words(edge: NamedEdge) -> str:
    """What an edge is and does, "end: convection, traction"."""
    return f"{edge.name}: {edge.role}" + (", traction" if edge.loaded and edge.role != "traction" else "")


def _middle(shape: Drawn, nodes: Indices) -> tuple[Array, Array]:
    """The place at half the length of a chain of nodes, and the direction there."""
    line = np.column_stack([shape.x[nodes], shape.y[nodes]])
    step = np.diff(line, axis=0)
    s = np.concatenate([[0.0], np.cumsum(np.hypot(*step.T))])
    k = min(int(np.searchsorted(s, 0.5 * s[-1], side="right")) - 1, len(step) - 1)
    t = step[k] / (np.hypot(*step[k]) or 1.0)
    return line[k] + (0.5 * s[-1] - s[k]) * t, t


def _draw_contact(axes: Axes, shape: Drawn, chains: Sequence[tuple[Indices, Indices]], line: LineFields) -> None:
    """Thick contact edges; each name once, at its longest run, with an arrow in the direction of the arclength."""
    longest: dict[int, Indices] = {}
    for chain, index in chains:
        axes.plot(shape.x[chain], shape.y[chain], solid_capstyle="butt", **ROLES["contact"])
        edge = line.edge[index]
        for run in np.split(np.arange(len(chain)), np.flatnonzero(np.diff(edge)) + 1):
            if len(run) > max(1, len(longest.get(int(edge[run[0]]), ()))):
                longest[int(edge[run[0]])] = chain[run]
    how: dict[str, Any] = {"color": style.BLUE, "fontweight": "bold"}
    for k, run in longest.items():
        name = line.edge_names[k] if k < len(line.edge_names) else ""
        if run[0] == run[-1]:  # within the ring if there is room, else beside it; it may cover the body
            x, y = shape.x[run], shape.y[run]
            fits = style.LETTER * (len(name) + 2) * shape.per_inch <= np.ptp(x)
            place = (x.min() + x.max()) / 2 if fits else x.max(), (y.min() + y.max()) / 2
            ground = {"boxstyle": "round,pad=0.2", "facecolor": "white", "edgecolor": "none", "alpha": 0.85}
            ha = "center" if fits else "left"
            note(axes, name, place, (0 if fits else 7, 0), ha=ha, va="center", bbox=ground, **how)
            continue
        at, t = _middle(shape, run)
        tail = at + 0.16 * shape.per_inch * np.array([t[1], -t[0]])
        arrow = {"arrowstyle": "->", "color": style.BLUE, "shrinkA": 0, "shrinkB": 0}
        axes.annotate("", tuple(tail + 0.34 * shape.per_inch * t), tuple(tail), arrowprops=arrow)
        if abs(t[0]) > 0.6:
            where: dict[str, Any] = {"ha": "right" if t[0] > 0 else "left", "va": "center"}
        else:  # beside a steep edge there is room for the height of letters only
            where = {"ha": "center", "va": "top" if t[1] > 0 else "bottom", "rotation": 90}
        note(axes, name, tail, -4.0 * t, **where, **how)


def _draw_source(axes: Axes, body: BodyFields, shape: Drawn, source: Array) -> None:
    """The outline of a heated region, displaced like the nodes near it."""
    loop = np.append(source, source[:1], axis=0)
    fine = np.concatenate([a + np.linspace(0.0, 1.0, 16)[:, None] * (b - a) for a, b in pairwise(loop)])
    near = [int(np.argmin(np.hypot(body.x - x, body.y - y))) for x, y in fine]
    x, y = shape.axis(fine).T + np.stack([shape.x - shape.x0, shape.y - shape.y0])[:, near]
    axes.plot(x, y, color=style.INK, linewidth=1.1, linestyle=(0, (4, 2)), zorder=4)
    ground = {"boxstyle": "round,pad=0.15", "facecolor": "white", "edgecolor": "none", "alpha": 0.8}
    look: dict[str, Any] = {"ha": "center", "va": "center", "fontsize": style.pt(8.5), "bbox": ground, "zorder": 5}
    axes.text(float(x.mean()), float(y.mean()), "heated", **look)


def boundary_edges(body: BodyFields) -> Indices:
    """(e, 2) edges that belong to one triangle only, with the body on their left."""
    x, y, t = body.x, body.y, body.triangles
    a, b, c = t[:, 0], t[:, 1], t[:, 2]
    area = (x[b] - x[a]) * (y[c] - y[a]) - (x[c] - x[a]) * (y[b] - y[a])
    t = np.where((area < 0.0)[:, None], t[:, ::-1], t)
    edges = np.concatenate([t[:, [0, 1]], t[:, [1, 2]], t[:, [2, 0]]])
    _, first, count = np.unique(np.sort(edges, axis=1), axis=0, return_index=True, return_counts=True)
    return edges[first[count == 1]]


def loops(edges: Indices) -> list[Indices]:
    """Closed chains of nodes (the last is the first again) that use every edge once."""
    leaving: dict[int, list[int]] = {}
    for start, end in edges.tolist():
        leaving.setdefault(start, []).append(end)
    chains = []
    for head in leaving:
        while leaving[head]:
            chain = [head]
            while leaving.get(chain[-1]):
                chain.append(leaving[chain[-1]].pop())
            chains.append(np.array(chain, dtype=np.intp))
    return chains


def runs(body: BodyFields, chains: Sequence[Indices], named: Sequence[NamedEdge]) -> list[tuple[NamedEdge, Indices]]:
    """The boundary cut where one edge ends and another begins; empty if no edges are known."""
    found = []
    for loop in chains if named else ():
        xy = np.column_stack([body.x, body.y])[loop]
        at = nearest(0.5 * (xy[1:] + xy[:-1]), list(named))
        cuts = np.flatnonzero(np.diff(at)) + 1
        if len(cuts):  # begin at a cut, so that no edge is in two parts
            loop, at = np.append(np.roll(loop[:-1], -cuts[0]), loop[cuts[0]]), np.roll(at, -cuts[0])
            cuts = np.flatnonzero(np.diff(at)) + 1
        for part in np.split(np.arange(len(at)), cuts):
            found.append((named[at[part[0]]], np.append(loop[part], loop[part[-1] + 1])))
    return found


def contact_chains(body: BodyFields, chains: Sequence[Indices], line: LineFields) -> list[tuple[Indices, Indices]]:
    """Mesh nodes of every part of the contact line, and the contact node that each of them is.

    A held node beside a part carries no unknown and is not in the line, but belongs to the drawn edge; it counts as
    the contact node next to it. A ring ends with its first node.
    """
    rings, found = [loop[:-1] for loop in chains], []
    for part in line.parts:
        x, y = line.x[part.start], line.y[part.start]
        ring = min(rings, key=lambda ring: np.min((body.x[ring] - x) ** 2 + (body.y[ring] - y) ** 2))
        first = int(np.argmin((body.x[ring] - x) ** 2 + (body.y[ring] - y) ** 2))
        before, after = line.held(part)
        steps = np.arange(-before, part.stop - part.start + (after or line.closed(part)))
        index = part.start + (steps % (part.stop - part.start) if line.closed(part) else steps)
        found.append((ring[(first + steps) % len(ring)], np.clip(index, part.start, part.stop - 1)))
    return found
