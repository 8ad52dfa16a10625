"""The upper panel: the deformed body, coloured with its temperature, its contact edges named.

The boundary of a triangulation as closed chains of nodes, and the contact line as a part of it.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from tcstudy.reports.figures import style
from tcstudy.reports.picture import NEAR, BodyFields, LineFields
from tcstudy.reports.text import axis_unit, number, pretty

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from tcstudy.reports.figures.sheet import Sheet

Array = NDArray[np.float64]

MARGIN = 0.42
"""Room around the body for the names of its contact edges [inch]."""

SHOWN = 0.06
"""Largest displacement drawn, as a part of the diagonal of the body."""

FINE = 3000
"""Triangles from which on their sides would only darken the picture."""

NAME: dict[str, Any] = {"color": style.BLUE, "fontweight": "bold"}
"""How contact edges are named."""

UNIFORM = 1e-6
"""Relative spread up to which a field is drawn and named as one number."""


@dataclass(frozen=True)
class Drawn:
    """A body as it is drawn: exaggerated, in scaled units, with the extent of its panel.

    x, y, x0, y0:   (n,) coordinates of the nodes, deformed and not [unit]
    factor:         exaggeration of the displacement
    left, right, bottom, top: limits of the axes [unit]
    per_inch:       length of the body drawn as one inch [unit]
    """

    x: Array
    y: Array
    x0: Array
    y0: Array
    factor: float
    left: float
    right: float
    bottom: float
    top: float
    per_inch: float
    unit: str

    @property
    def size(self) -> tuple[float, float]:
        """Width and height of the axes [inch]."""
        return (self.right - self.left) / self.per_inch, (self.top - self.bottom) / self.per_inch


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
    divisor, unit = axis_unit([float(np.ptp(body.x)), float(np.ptp(body.y))], length_units)
    x0, y0 = body.x / divisor, body.y / divisor
    x, y = x0 + factor * body.u_x / divisor, y0 + factor * body.u_y / divisor
    low = min(x.min(), x0.min()), min(y.min(), y0.min())
    high = max(x.max(), x0.max()), max(y.max(), y0.max())
    per_inch = max((high[0] - low[0]) / (widest - 2 * MARGIN), (high[1] - low[1]) / (highest - 2 * MARGIN))
    pad = MARGIN * per_inch
    return Drawn(
        *(x, y, x0, y0, factor),
        *(low[0] - pad, high[0] + pad, low[1] - pad, high[1] + pad),
        per_inch=per_inch,
        unit=unit,
    )


def draw_body(sheet: Sheet, axes: Axes, body: BodyFields, line: LineFields, shape: Drawn) -> None:
    """Fill the panel and put the colour bar to its right."""
    axes.set(xlabel=style.labelled("x", shape.unit), ylabel=style.labelled("y", shape.unit))
    axes.set_aspect("equal", adjustable="datalim")
    uniform = _fill(sheet, axes, shape, body)
    if len(body.triangles) <= FINE:
        axes.triplot(shape.x, shape.y, body.triangles, color=style.INK, linewidth=0.4, alpha=0.25)
    for loop in loops(boundary_edges(body)):
        axes.plot(shape.x0[loop], shape.y0[loop], color=style.INK, alpha=0.6, linewidth=0.9, linestyle=(0, (5, 3)))
        axes.plot(shape.x[loop], shape.y[loop], color=style.INK, linewidth=1.0)
    _draw_contact(axes, body, line, shape)
    axes.set_title(f"Deformed body (deformation × {shape.factor:g}; dashed: undeformed){uniform}", loc="left")


def _fill(sheet: Sheet, axes: Axes, shape: Drawn, body: BodyFields) -> str:
    """Colour the body in bands between round temperatures, with a bar; or evenly, and return what there is to say."""
    from matplotlib.ticker import MaxNLocator
    from matplotlib.tri import Triangulation

    if body.theta is None:
        _fill_evenly(axes, shape, body, style.SHADE)
        return ""
    low, high = float(body.theta.min()), float(body.theta.max())
    if high - low <= UNIFORM * max(abs(low), abs(high)):
        _fill_evenly(axes, shape, body, style.EVEN)
        return rf",  $\theta$ = {number(0.5 * (low + high))} {pretty(body.theta_units)}".rstrip() + " everywhere"
    bands = MaxNLocator(nbins=12, steps=[1, 2, 2.5, 5, 10]).tick_values(low, high)
    filled = axes.tricontourf(
        Triangulation(shape.x, shape.y, body.triangles), body.theta, levels=bands, cmap=style.HEAT
    )
    sheet.bar(axes, filled, style.labelled(r"temperature $\theta$", body.theta_units))
    return ""


def _fill_evenly(axes: Axes, shape: Drawn, body: BodyFields, colour: str) -> None:
    from matplotlib.colors import ListedColormap

    axes.tripcolor(
        shape.x, shape.y, body.triangles, facecolors=np.zeros(len(body.triangles)), cmap=ListedColormap([colour])
    )


def _draw_contact(axes: Axes, body: BodyFields, line: LineFields, shape: Drawn) -> None:
    """Thick contact edges; each name once, at its longest run."""
    runs: dict[int, NDArray[np.intp]] = {}
    for chain, index in contact_chains(body, line):
        axes.plot(shape.x[chain], shape.y[chain], color=style.BLUE, linewidth=3.0, solid_capstyle="butt")
        edge = line.edge[index]
        for run in np.split(np.arange(len(chain)), np.flatnonzero(np.diff(edge)) + 1):
            name = int(edge[run[0]])
            if len(run) > len(runs.get(name, ())):
                runs[name] = chain[run]
    for name, run in runs.items():
        if len(run) < 2 or name >= len(line.edge_names):
            continue
        if run[0] == run[-1]:
            _name_ring(axes, shape, run, line.edge_names[name])
        else:
            _name_edge(axes, shape, run, line.edge_names[name])


def _name_edge(axes: Axes, shape: Drawn, run: NDArray[np.intp], name: str) -> None:
    """An arrow outside the middle of an edge, in the direction of the arclength, and the name behind it."""
    middle = max(len(run) // 2, 1)
    a, b = run[middle - 1], run[middle]
    t = np.array([shape.x[b] - shape.x[a], shape.y[b] - shape.y[a]])
    t /= np.hypot(*t) or 1.0
    n = np.array([t[1], -t[0]])
    tail = np.array([shape.x[a], shape.y[a]]) + 0.16 * shape.per_inch * n
    head = tail + 0.34 * shape.per_inch * t
    arrow = {"arrowstyle": "->", "color": style.BLUE, "shrinkA": 0, "shrinkB": 0}
    axes.annotate("", xy=tuple(head), xytext=tuple(tail), arrowprops=arrow)
    along = abs(t[0]) > 0.6
    x, y = tail - 0.06 * shape.per_inch * t
    if along:
        place: dict[str, Any] = {"ha": "right" if t[0] > 0 else "left", "va": "center"}
    else:  # beside a steep edge there is room for the height of letters only
        place = {"ha": "center", "va": "top" if t[1] > 0 else "bottom", "rotation": 90}
    axes.text(float(x), float(y), name, **place, **NAME)


def _name_ring(axes: Axes, shape: Drawn, run: NDArray[np.intp], name: str) -> None:
    """The name within the ring if it fits, else beside it; on a pale ground, because it may cover the body."""
    x, y = shape.x[run], shape.y[run]
    fits = style.LETTER * (len(name) + 2) * shape.per_inch <= np.ptp(x)
    at = (x.min() + x.max()) / 2 if fits else x.max() + 0.1 * shape.per_inch
    ground = {"boxstyle": "round,pad=0.2", "facecolor": "white", "edgecolor": "none", "alpha": 0.85}
    ha = "center" if fits else "left"
    axes.text(float(at), float(y.min() + y.max()) / 2, name, ha=ha, va="center", bbox=ground, **NAME)


Indices = NDArray[np.intp]


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


def contact_chains(body: BodyFields, line: LineFields) -> list[tuple[Indices, Indices]]:
    """Mesh nodes of every part of the contact line, and the contact node that each of them is.

    A held node beside a part carries no unknown and is not in the line, but belongs to the drawn edge; it counts as
    the contact node next to it. A ring ends with its first node.
    """
    edges = boundary_edges(body)
    after = dict(zip(edges[:, 0].tolist(), edges[:, 1].tolist(), strict=True))
    before = dict(zip(edges[:, 1].tolist(), edges[:, 0].tolist(), strict=True))
    nodes = _nearest(body, line, np.unique(edges))
    chains = []
    for part in line.parts:
        chain, index = nodes[part].tolist(), list(range(part.start, part.stop))
        cells, first, last = line.cells(part), part.start, part.stop - 1
        if line.closed(part):
            chain, index = [*chain, chain[0]], [*index, first]
        else:
            held, beyond = before.get(chain[0]), after.get(chain[-1])
            if held is not None and _reaches(body, held, chain[0], line.arclength[first] - cells[0]):
                chain, index = [held, *chain], [first, *index]
            if beyond is not None and _reaches(body, beyond, chain[-1], cells[-1] - line.arclength[last]):
                chain, index = [*chain, beyond], [*index, last]
        chains.append((np.array(chain, dtype=np.intp), np.array(index, dtype=np.intp)))
    return chains


def _nearest(body: BodyFields, line: LineFields, candidates: Indices) -> Indices:
    """(m,) the boundary node of the mesh at each contact node."""
    x, y = body.x[candidates], body.y[candidates]
    return np.array(
        [candidates[np.argmin((x - a) ** 2 + (y - b) ** 2)] for a, b in zip(line.x, line.y, strict=True)], dtype=np.intp
    )


def _reaches(body: BodyFields, a: int, b: int, distance: float) -> bool:
    """True if two nodes are this far from each other."""
    actual = float(np.hypot(body.x[a] - body.x[b], body.y[a] - body.y[b]))
    return abs(actual - distance) <= NEAR * actual
