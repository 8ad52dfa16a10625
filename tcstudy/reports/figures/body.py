"""The panel of the body: deformed, coloured with a field, its edges drawn by their roles, named,
hatched where held."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from tcstudy.errors import DrawError
from tcstudy.reports.figures import style
from tcstudy.reports.figures.panels import Array, Labels, Scale, Sheet, scale
from tcstudy.reports.picture import (
    COMPONENTS,
    BodyFields,
    NamedEdge,
    Picture,
    nearest,
    polylines,
    recovered,
    stress_floor,
)
from tcstudy.reports.rounding import SHARE, cleared
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


@dataclass(frozen=True)
class Drawn:
    """A body as it is drawn: exaggerated, in scaled units, with the extent of its panel.

    moved, still: (n, 2) coordinates of the nodes, deformed and not, in drawn units
    axis:         scale of the drawn units
    factor:       exaggeration of the displacement
    box:          left, right, bottom and top of the panel;  per_inch: what is one inch of it
    rim:          (e, 2) sides of triangles at its boundary
    """

    moved: Array
    still: Array
    axis: Scale
    factor: float
    box: tuple[float, float, float, float]
    per_inch: float
    rim: Indices

    @property
    def height(self) -> float:
        """Height of the panel [inch]."""
        return (self.box[3] - self.box[2]) / self.per_inch


def exaggeration(xy: Array, u: Array) -> float:
    """A factor 1, 2 or 5 times a power of ten that makes displacements u (…, n, 2) visible; 1 for a
    body at rest."""
    largest = float(np.hypot(u[..., 0], u[..., 1]).max())
    if largest == 0.0:
        return 1.0
    wanted = SHOWN * math.hypot(*np.ptp(xy, axis=0)) / largest
    power = 10.0 ** math.floor(math.log10(wanted))
    return float(
        f"{max(step for step in (1, 2, 5) if step == 1 or step * power <= wanted) * power:.1g}"
    )


def drawn(
    body: BodyFields, length_units: str, widest: float, highest: float, factor: float | None = None
) -> Drawn:
    """Scale a body to its panel, at most so wide and high [inch]; factor: of displacements, None
    for one that suits."""
    factor = exaggeration(body.xy, body.u) if factor is None else factor
    axis = scale("", np.ptp(body.xy, axis=0), length_units)
    still, moved = axis(body.xy), axis(body.xy + factor * body.u)
    low, high = (end(np.concatenate([still, moved]), axis=0) for end in (np.min, np.max))
    per_inch = float(np.max((high - low) / (np.array([widest, highest]) - 2 * MARGIN)))
    low, high = low - MARGIN * per_inch, high + MARGIN * per_inch
    box = low[0], high[0], low[1], high[1]
    return Drawn(moved, still, axis, factor, box, per_inch, boundary_edges(body.xy, body.triangles))


@dataclass(frozen=True)
class Field:
    """What the body is coloured with: triangles and values (n,) at their nodes of each part, and
    what is said of it."""

    name: str
    units: str
    parts: tuple[tuple[Indices, Array], ...]
    told: str = ""

    @property
    def ends(self) -> tuple[float, float]:
        """The least and the greatest value."""
        values = np.concatenate([values[np.unique(triangles)] for triangles, values in self.parts])
        return float(values.min()), float(values.max())


def field_of(picture: Picture, name: str | None) -> Field | None:
    """The field of a name of COMPONENTS, a displacement u_x or u_y, or else the temperature, None
    where there is none.

    Raises DrawError.
    """
    body = picture.body
    if body is None:
        if name is not None:
            raise DrawError(
                "of: the run kept no fields of the body; run it again with output.fields: true"
            )
        return None
    if name in (None, "theta"):
        found = (body.triangles, body.theta) if body.theta is not None else None
        return found and Field("temperature θ", body.theta_units, (found,))
    if name in ("u_x", "u_y"):
        u = cleared(body.u[:, "xy".index(name[-1])], SHARE * float(np.abs(body.u).max()))
        return Field(name, picture.line.length_units, ((body.triangles, u),))
    if name not in COMPONENTS:
        raise DrawError(
            f"of: the body has no field {name!r}; it has theta, u_x, u_y, {', '.join(COMPONENTS)}"
        )
    if picture.scene is None:
        raise DrawError(
            "the study in the file cannot be read any more, so its materials are not known"
        )
    (label, component), (sigma, error) = COMPONENTS[name], recovered(body, picture.scene.material)
    floor = stress_floor(body, picture.scene.material, sigma)
    parts = tuple(
        (body.triangles[body.region == k], cleared(component(sigma[k]), floor))
        for k in np.unique(body.region)
    )
    told = f"stress recovered from elements, estimated error {number(100.0 * error, 2)} %"
    return Field(label, picture.line.traction_units, parts, told)


Named = Sequence[tuple[list[Array], NamedEdge]]
"""Edges and the lines that they are drawn as."""


def draw_body(
    sheet: Sheet, axes: Axes, picture: Picture, shape: Drawn, field: Field | None
) -> Named:
    """Fill the panel and put the colour bar of the field to its right; returns the edges that are
    not free."""
    body = picture.body
    assert body is not None
    axes.set(xlabel=f"x{shape.axis.label}", ylabel=f"y{shape.axis.label}")
    axes.set_aspect("equal", adjustable="datalim")
    said = _fill(sheet, axes, shape, body, field)
    axes.set_title(
        style.math(f"Deformed body (deformation × {shape.factor:g}; dashed: undeformed){said}"),
        loc="left",
    )
    if len(body.triangles) <= FINE:
        axes.triplot(*shape.moved.T, body.triangles, color=style.INK, linewidth=0.4, alpha=0.25)
    dashes: dict[str, Any] = {"alpha": 0.6, "linewidth": 0.9, "linestyle": (0, (5, 3))}
    draw_lines(axes, polylines(shape.still[shape.rim]), color=style.INK, **dashes)
    draw_lines(axes, polylines(shape.moved[shape.rim]), color=style.INK, linewidth=1.0)
    for k in np.unique(body.region)[1:]:
        own = body.triangles[body.region == k]
        draw_lines(
            axes,
            polylines(shape.moved[boundary_edges(body.xy, own)]),
            color=style.INK,
            linewidth=0.7,
        )
    edges = [*edge_lines(picture, shape)]
    for lines, edge in edges:
        draw_edge(axes, lines, ROLES[edge.role], edge.role == "clamped", shape.per_inch)
        if edge.role == "contact":  # an arrow in the direction of the arclength
            (at,), (along,) = evenly(max(lines, key=length_of), 1)
            look = {
                "arrowstyle": "-|>",
                "color": style.BLUE,
                "mutation_scale": 16,
                "shrinkA": 0,
                "shrinkB": 0,
            }
            axes.annotate("", tuple(at + 0.1 * shape.per_inch * along), tuple(at), arrowprops=look)
    for places in (_moved(shape, body, source) for source in picture.sources):
        axes.plot(*places.T, color=style.INK, linewidth=1.1, linestyle=(0, (4, 2)), zorder=4)
    axes.set_xlim(*shape.box[:2], auto=True)  # at least: they grow to the shape of the panel
    axes.set_ylim(*shape.box[2:], auto=True)
    return edges


def edge_lines(picture: Picture, shape: Drawn) -> Iterator[tuple[list[Array], NamedEdge]]:
    """The edges of the deformed body that are not free as lines, all of one name together."""
    assert picture.body is not None
    of = nearest(picture.body.xy[shape.rim], picture.edges)
    for edge in {edge.name: edge for edge in picture.edges if edge.role != "free"}.values():
        own = np.isin(of, [k for k, one in enumerate(picture.edges) if one.name == edge.name])
        if own.any():
            yield polylines(shape.moved[shape.rim[own]]), edge


def name_body(axes: Axes, picture: Picture, shape: Drawn, edges: Named) -> None:
    """Names of edges, regions and heated regions, when the axes have their place."""
    body = picture.body
    assert body is not None
    labels = Labels(axes, [shape.moved[shape.rim].mean(axis=1)])
    for lines, edge in edges:
        line, contact = max(lines, key=length_of), edge.role == "contact"
        words = edge.name if contact else edge_words(edge)
        text = words if style.LETTER * len(words) <= length_of(line) / shape.per_inch else edge.name
        look = {"color": ROLES[edge.role]["color"], "fontweight": "bold" if contact else "normal"}
        beside_line(
            labels, line, text, upright=bool(np.ptp(line[:, 0]) < np.ptp(line[:, 1])), **look
        )
    names = [name for name, _ in picture.scene.material.regions] if picture.scene else []
    said = [
        (name, shape.moved[body.triangles[body.region == k].ravel()])
        for k, name in enumerate(names, 1)
    ]
    for text, places in [
        *said,
        *(("heated", _moved(shape, body, source)) for source in picture.sources),
    ]:
        if len(places):
            labels.put(text, places.mean(axis=0)[None], [[0.0, 0.0]], loose=True)


def beside_line(labels: Labels, line: Array, text: str, upright: bool = False, **look: Any) -> None:
    """A label outside a line with the body on its left, or else inside."""
    at, along = evenly(line, 20)
    some = [10, 6, 13, 3, 16]
    labels.put(text, at[some], outside(along[some]), APART, upright, **look)


def _fill(sheet: Sheet, axes: Axes, shape: Drawn, body: BodyFields, field: Field | None) -> str:
    """Colour the body in bands between round values, with a bar; or evenly, and return what there
    is to say."""
    from matplotlib.colors import ListedColormap
    from matplotlib.ticker import MaxNLocator
    from matplotlib.tri import Triangulation

    x, y = shape.moved.T
    low, high = field.ends if field else (0.0, 0.0)
    if field is None or high - low <= UNIFORM * max(abs(low), abs(high)):
        colours = (
            FILLS if field is None and body.region.any() else [style.EVEN if field else style.SHADE]
        )
        shown = body.region % len(colours)
        axes.tripcolor(
            x,
            y,
            body.triangles,
            facecolors=shown,
            cmap=ListedColormap(colours),
            vmax=len(colours) - 0.5,
        )
        if field is None:
            return ""
        symbol = field.name.rpartition(" ")[2]
        return (
            f",  {symbol} = {number(0.5 * (low + high))} {pretty(field.units)}".rstrip()
            + " everywhere"
        )
    axis = scale(field.name, [low, high], field.units)
    bands = MaxNLocator(nbins=12, steps=[1, 2, 2.5, 5, 10]).tick_values(
        low / axis.one, high / axis.one
    )
    how: dict[str, Any] = {
        "levels": bands,
        "cmap": style.HEAT if low >= 0.0 or not field.told else style.SIGNED,
    }
    for triangles, values in field.parts:
        filled = axes.tricontourf(Triangulation(x, y, triangles), axis(values), **how)
    sheet.bar(axes, filled, axis.label)
    return f";  {field.told}" if field.told else ""


def edge_words(edge: NamedEdge) -> str:
    return f"{edge.name}: {edge.role}" + (
        ", traction" if edge.loaded and edge.role != "traction" else ""
    )


def _moved(shape: Drawn, body: BodyFields, ring: Array) -> Array:
    """A ring (n, 2) [length units] displaced like the nodes near it, as it is drawn."""
    fine = evenly(np.concatenate([ring, ring[:1]]), 16 * len(ring))[0]
    near = [int(np.argmin(np.hypot(*(body.xy - place).T))) for place in fine]
    moved = shape.axis(fine) + (shape.moved - shape.still)[near]
    return np.asarray(np.concatenate([moved, moved[:1]]))


def boundary_edges(xy: Array, triangles: Indices) -> Indices:
    """(e, 2) edges that belong to one triangle only, with the body on their left."""
    a, b, c = xy[triangles.T]
    area = np.linalg.det(np.stack([b - a, c - a], axis=-1))
    t = np.where((area < 0.0)[:, None], triangles[:, ::-1], triangles)
    edges = np.concatenate([t[:, [0, 1]], t[:, [1, 2]], t[:, [2, 0]]])
    _, first, count = np.unique(
        np.sort(edges, axis=1), axis=0, return_index=True, return_counts=True
    )
    return edges[first[count == 1]]


# -- edges -----------------------------------------------------------------------------------------

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
FILLS = ("#f3f1ea", "#cfe3f2", "#f6dcc6", "#d3ead9", "#efd4e4", "#f5ebc0", "#d9d9d9")
"""Of the body and of its regions."""
HATCH = 0.1
"""How far apart the ticks of a held edge stand along it [inch]."""


APART = (7.0, 14.0, 20.0, 33.0, 46.0, -7.0, -28.0)
"""How far labels of an edge may stand outside of it, below 0 inside [pt]."""


def length_of(line: Array) -> float:
    """The length of a line (n, 2)."""
    return float(np.hypot(*np.diff(line, axis=0).T).sum())


def outside(along: Array) -> Array:
    """Unit normals to the right of directions (…, 2), which is outside."""
    return np.stack([along[..., 1], -along[..., 0]], axis=-1)


def evenly(line: Array, count: int) -> tuple[Array, Array]:
    """Places (count, 2) evenly spread along a line, the middle if it is one, and its direction
    there."""
    step = np.diff(line, axis=0)
    upto = np.concatenate([[0.0], np.cumsum(np.hypot(*step.T))])
    at = (np.arange(count) + 0.5) / count * upto[-1]
    along = step[np.searchsorted(upto, at) - 1]
    return np.column_stack([np.interp(at, upto, x) for x in line.T]), along / np.hypot(*along.T)[
        :, None
    ]


def draw_lines(axes: Axes, lines: Sequence[Array], **how: Any) -> None:
    """Draw lines (n, 2) as one that is broken between them."""
    gap = np.full((1, 2), np.nan)
    axes.plot(*np.concatenate([part for line in lines for part in (line, gap)]).T, **how)


def draw_edge(
    axes: Axes, lines: Sequence[Array], how: dict[str, Any], held: bool, inch: float = 1.0
) -> list[Array]:
    """Draw an edge, hatched outside where it is held; inch: what is one of the axes. Returns ends
    of the hatches."""
    draw_lines(axes, lines, solid_capstyle="butt", zorder=3, **how)
    ticks = list[Array]()
    for line in lines if held else ():
        starts, along = evenly(line, round(length_of(line) / (HATCH * inch)))
        ticks += [
            *np.stack([starts, starts + 0.7 * HATCH * inch * (outside(along) - along)], axis=1)
        ]
    if ticks:
        draw_lines(axes, ticks, color=style.INK, linewidth=0.7, zorder=3)
    return [tick[1:] for tick in ticks]
