"""The panel of the body: deformed, coloured with a field, its named edges drawn by their roles.

Clamped edges are hatched.
"""

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
MAX_DRAWN_DISPLACEMENT = 0.06
"""Largest displacement drawn, as a part of the diagonal of the body."""
MAX_DRAWN_TRIANGLES = 3000
"""Triangles from which on their sides would only darken the picture."""
UNIFORM = 1e-6
"""Relative spread up to which a field is drawn and named as one number."""


@dataclass(frozen=True)
class BodyShape:
    """A body as it is drawn: exaggerated, in scaled units, with the extent of its panel.

    moved, still: (n, 2) coordinates of the nodes, deformed and not, in drawn units
    axis:         scale of the drawn units
    factor:       exaggeration of the displacement
    box:          left, right, bottom and top of the panel [drawn units]
    per_inch:     drawn units per inch of the panel
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
    """Return a factor 1, 2 or 5 times a power of ten that makes displacements u (…, n, 2) visible.

    It is 1 for a body at rest.
    """
    largest = float(np.hypot(u[..., 0], u[..., 1]).max())
    if largest == 0.0:
        return 1.0
    target = MAX_DRAWN_DISPLACEMENT * math.hypot(*np.ptp(xy, axis=0)) / largest
    power = 10.0 ** math.floor(math.log10(target))
    steps = [step for step in (1, 2, 5) if step == 1 or step * power <= target]
    return float(f"{max(steps) * power:.1g}")


def scale_body(
    body: BodyFields, length_units: str, max_width: float, max_height: float, factor: float | None
) -> BodyShape:
    """Scale a body to its panel, at most so wide and high [inch].

    factor: of displacements, None for one that suits
    """
    factor = exaggeration(body.xy, body.u) if factor is None else factor
    axis = scale("", np.ptp(body.xy, axis=0), length_units)
    still, moved = axis(body.xy), axis(body.xy + factor * body.u)
    places = np.concatenate([still, moved])
    low, high = np.min(places, axis=0), np.max(places, axis=0)
    room = np.array([max_width, max_height]) - 2 * MARGIN
    per_inch = float(np.max((high - low) / room))
    low, high = low - MARGIN * per_inch, high + MARGIN * per_inch
    box = low[0], high[0], low[1], high[1]
    rim = boundary_edges(body.xy, body.triangles)
    return BodyShape(moved, still, axis, factor, box, per_inch, rim)


@dataclass(frozen=True)
class Field:
    """A field that colours the body.

    parts: triangles of each part of the body, and the values (n,) at their nodes
    note:  sentence on the source of the values, empty for computed ones
    """

    name: str
    units: str
    parts: tuple[tuple[Indices, Array], ...]
    note: str = ""

    @property
    def symbol(self) -> str:
        """Last word of the name: σ_x of "stress σ_x"."""
        return self.name.rpartition(" ")[2]

    @property
    def ends(self) -> tuple[float, float]:
        """The least and the greatest value."""
        values = np.concatenate([values[np.unique(triangles)] for triangles, values in self.parts])
        return float(values.min()), float(values.max())


def field_of(picture: Picture, name: str | None) -> Field | None:
    """Return a field: one of COMPONENTS, u_x, u_y, or without a name the temperature.

    Returns None if the picture has no body or no temperature. Raises DrawError for a field that
    the file does not have.
    """
    body = picture.body
    if body is None:
        if name is None:
            return None
        raise DrawError(
            "of: the run kept no fields of the body; run it again with output.fields: true"
        )
    if name in (None, "theta"):
        if body.theta is None:
            return None
        return Field("temperature θ", body.theta_units, ((body.triangles, body.theta),))
    if name in ("u_x", "u_y"):
        floor = SHARE * float(np.abs(body.u).max())
        u = cleared(body.u[:, "xy".index(name[-1])], floor)
        return Field(name, picture.line.length_units, ((body.triangles, u),))
    if name not in COMPONENTS:
        raise DrawError(
            f"of: the body has no field {name!r}; it has theta, u_x, u_y, {', '.join(COMPONENTS)}"
        )
    return _stress(picture, body, name)


def _stress(picture: Picture, body: BodyFields, name: str) -> Field:
    if picture.scene is None:
        raise DrawError(
            "the study in the file cannot be read any more, so its materials are not known"
        )
    label, component = COMPONENTS[name]
    sigma, error = recovered(body, picture.scene.material)
    floor = stress_floor(body, picture.scene.material, sigma)
    parts = []
    for region in np.unique(body.region):
        triangles = body.triangles[body.region == region]
        parts.append((triangles, cleared(component(sigma[region]), floor)))
    note = f"stress recovered from elements, estimated error {number(100.0 * error, 2)} %"
    return Field(label, picture.line.traction_units, tuple(parts), note)


EdgeLines = Sequence[tuple[list[Array], NamedEdge]]
"""Edges with the lines that they are drawn as."""


def draw_body(
    sheet: Sheet, axes: Axes, picture: Picture, shape: BodyShape, field: Field | None
) -> EdgeLines:
    """Draw the body with the colour bar of the field, and return its edges that are not free."""
    body = picture.body
    assert body is not None
    axes.set(xlabel=f"x{shape.axis.label}", ylabel=f"y{shape.axis.label}")
    axes.set_aspect("equal", adjustable="datalim")
    note = _fill(sheet, axes, shape, body, field)
    title = f"Deformed body (deformation × {shape.factor:g}; dashed: undeformed){note}"
    axes.set_title(style.math(title), loc="left")
    _draw_outlines(axes, shape, body)
    _draw_foundation(axes, picture, shape)
    edges = list(edge_lines(picture, shape))
    for lines, edge in edges:
        draw_edge(axes, lines, ROLES[edge.role], edge.role == "clamped", shape.per_inch)
        if edge.role == "contact":
            _draw_direction(axes, max(lines, key=length_of), shape.per_inch)
    for source in picture.sources:
        ring = _moved(shape, body, source)
        axes.plot(*ring.T, color=style.INK, linewidth=1.1, linestyle=(0, (4, 2)), zorder=4)
    axes.set_xlim(*shape.box[:2], auto=True)  # at least: they grow to the shape of the panel
    axes.set_ylim(*shape.box[2:], auto=True)
    return edges


def _draw_outlines(axes: Axes, shape: BodyShape, body: BodyFields) -> None:
    """Draw sides of triangles, the outline of the body before and after, and of its regions."""
    if len(body.triangles) <= MAX_DRAWN_TRIANGLES:
        axes.triplot(*shape.moved.T, body.triangles, color=style.INK, linewidth=0.4, alpha=0.25)
    dashes: dict[str, Any] = {"alpha": 0.6, "linewidth": 0.9, "linestyle": (0, (5, 3))}
    draw_lines(axes, polylines(shape.still[shape.rim]), color=style.INK, **dashes)
    draw_lines(axes, polylines(shape.moved[shape.rim]), color=style.INK, linewidth=1.0)
    for region in np.unique(body.region)[1:]:
        rim = boundary_edges(body.xy, body.triangles[body.region == region])
        draw_lines(axes, polylines(shape.moved[rim]), color=style.INK, linewidth=0.7)


def _draw_foundation(axes: Axes, picture: Picture, shape: BodyShape) -> None:
    """Draw the foundation of edges that may open, hatched, and fill the gap above it."""
    from matplotlib.collections import PolyCollection

    openings, body = picture.openings, picture.body
    if openings is None or body is None:
        return
    line = openings.line
    names = {line.edge_names[index] for index in np.unique(line.edge)}
    indices = [k for k, edge in enumerate(picture.edges) if edge.name in names]
    is_side = np.isin(nearest(body.xy[shape.rim], picture.edges), indices)
    start, end = shape.rim[is_side].T
    still, moved = shape.still, shape.moved
    gaps = np.stack([still[start], still[end], moved[end], moved[start]], axis=1)
    axes.add_collection(PolyCollection(list(gaps), facecolor=style.OPEN, edgecolor="none"))
    look = {"color": style.PALE, "linewidth": 1.2}
    draw_edge(axes, polylines(still[shape.rim[is_side]]), look, True, shape.per_inch)


def _draw_direction(axes: Axes, line: Array, per_inch: float) -> None:
    """Draw an arrow in the direction of the arclength in the middle of a line."""
    (middle,), (direction,) = points_along(line, 1)
    look = {
        "arrowstyle": "-|>",
        "color": style.BLUE,
        "mutation_scale": 16,
        "shrinkA": 0,
        "shrinkB": 0,
    }
    tip = middle + 0.1 * per_inch * direction
    axes.annotate("", tuple(tip), tuple(middle), arrowprops=look)


def edge_lines(picture: Picture, shape: BodyShape) -> Iterator[tuple[list[Array], NamedEdge]]:
    """Yield the lines of the deformed edges that are not free, grouped by name."""
    assert picture.body is not None
    edge_of_side = nearest(picture.body.xy[shape.rim], picture.edges)
    by_name = {edge.name: edge for edge in picture.edges if edge.role != "free"}
    for edge in by_name.values():
        indices = [k for k, other in enumerate(picture.edges) if other.name == edge.name]
        is_side = np.isin(edge_of_side, indices)
        if is_side.any():
            yield polylines(shape.moved[shape.rim[is_side]]), edge


def name_body(axes: Axes, picture: Picture, shape: BodyShape, edges: EdgeLines) -> None:
    """Write names of edges, regions and heated regions, after the layout of the axes."""
    body = picture.body
    assert body is not None
    labels = Labels(axes, [shape.moved[shape.rim].mean(axis=1)])
    for lines, edge in edges:
        line = max(lines, key=length_of)
        is_contact = edge.role == "contact"
        text = edge.name if is_contact else edge_words(edge)
        if style.LETTER * len(text) > length_of(line) / shape.per_inch:
            text = edge.name
        is_upright = bool(np.ptp(line[:, 0]) < np.ptp(line[:, 1]))
        weight = "bold" if is_contact else "normal"
        colour = ROLES[edge.role]["color"]
        beside_line(labels, line, text, is_upright, color=colour, fontweight=weight)
    regions = picture.scene.material.regions if picture.scene else ()
    places_of_texts = []
    for index, (name, _) in enumerate(regions, 1):
        nodes = body.triangles[body.region == index].ravel()
        places_of_texts.append((name, shape.moved[nodes]))
    places_of_texts += [("heated", _moved(shape, body, source)) for source in picture.sources]
    for text, places in places_of_texts:
        if len(places):
            labels.put(text, places.mean(axis=0)[None], [[0.0, 0.0]], optional=True)


def beside_line(labels: Labels, line: Array, text: str, upright: bool = False, **look: Any) -> None:
    """Put a label outside a line with the body on its left, or else inside."""
    points, directions = points_along(line, 20)
    tried = [10, 6, 13, 3, 16]
    labels.put(text, points[tried], outside(directions[tried]), LABEL_DISTANCES, upright, **look)


def _fill(sheet: Sheet, axes: Axes, shape: BodyShape, body: BodyFields, field: Field | None) -> str:
    """Colour the body and return the end of its title.

    A uniform field is one colour and its value; any other is drawn in bands with a colour bar.
    """
    if field is None:
        _fill_evenly(axes, shape, body, FILLS if body.region.any() else (style.SHADE,))
        return ""
    low, high = field.ends
    if high - low <= UNIFORM * max(abs(low), abs(high)):
        _fill_evenly(axes, shape, body, (style.EVEN,))
        value = f"{number(0.5 * (low + high))} {pretty(field.units)}".rstrip()
        return f",  {field.symbol} = {value} everywhere"
    _fill_bands(sheet, axes, shape, field)
    return f";  {field.note}" if field.note else ""


def _fill_evenly(axes: Axes, shape: BodyShape, body: BodyFields, colours: Sequence[str]) -> None:
    """Fill each region with a colour of its own."""
    from matplotlib.colors import ListedColormap

    x, y = shape.moved.T
    axes.tripcolor(
        x,
        y,
        body.triangles,
        facecolors=body.region % len(colours),
        cmap=ListedColormap(colours),
        vmax=len(colours) - 0.5,
    )


def _fill_bands(sheet: Sheet, axes: Axes, shape: BodyShape, field: Field) -> None:
    """Fill bands between round values of a field, and add their colour bar."""
    from matplotlib.ticker import MaxNLocator
    from matplotlib.tri import Triangulation

    low, high = field.ends
    axis = scale(field.name, [low, high], field.units)
    locator = MaxNLocator(nbins=12, steps=[1, 2, 2.5, 5, 10])
    levels = locator.tick_values(low / axis.unit, high / axis.unit)
    colours = style.HEAT if low >= 0.0 or not field.note else style.SIGNED
    x, y = shape.moved.T
    for triangles, values in field.parts:
        mesh = Triangulation(x, y, triangles)
        bands = axes.tricontourf(mesh, axis(values), levels=levels, cmap=colours)
    sheet.bar(axes, bands, axis.label)


def edge_words(edge: NamedEdge) -> str:
    is_loaded = edge.loaded and edge.role != "traction"
    return f"{edge.name}: {edge.role}" + (", traction" if is_loaded else "")


def _moved(shape: BodyShape, body: BodyFields, ring: Array) -> Array:
    """Return a ring (n, 2) [length units] displaced like the nodes near it, in drawn units."""
    points, _ = points_along(np.concatenate([ring, ring[:1]]), 16 * len(ring))
    near = [int(np.argmin(np.hypot(*(body.xy - point).T))) for point in points]
    moved = shape.axis(points) + (shape.moved - shape.still)[near]
    return np.asarray(np.concatenate([moved, moved[:1]]))


def boundary_edges(xy: Array, triangles: Indices) -> Indices:
    """Return (e, 2) edges that belong to one triangle only, with the body on their left."""
    a, b, c = xy[triangles.T]
    area = np.linalg.det(np.stack([b - a, c - a], axis=-1))
    t = np.where((area < 0.0)[:, None], triangles[:, ::-1], triangles)
    edges = np.concatenate([t[:, [0, 1]], t[:, [1, 2]], t[:, [2, 0]]])
    undirected = np.sort(edges, axis=1)
    _, first, count = np.unique(undirected, axis=0, return_index=True, return_counts=True)
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
"""Looks of the edges of each role."""
CONTACTS: dict[str, tuple[str, dict[str, Any]]] = {
    "held": ("contact", {}),
    "unilateral": ("contact, unilateral", {"linestyle": (0, (5, 1.2))}),
    "adhesive": ("contact, adhesive", {"linestyle": (0, (1, 0.6))}),
    "free": ("contact, frictional only", {"linewidth": 1.6}),
}
"""Words and looks of contact edges by what they do along their normal."""
FILLS = ("#f3f1ea", "#cfe3f2", "#f6dcc6", "#d3ead9", "#efd4e4", "#f5ebc0", "#d9d9d9")
"""Colours of the body and of its regions."""
HATCH = 0.1
"""Distance of the hatches of a clamped edge along it [inch]."""
LABEL_DISTANCES = (7.0, 14.0, 20.0, 33.0, 46.0, -7.0, -28.0)
"""Distances of the label of an edge outside it, below 0 inside, in the order tried [pt]."""


def length_of(line: Array) -> float:
    """Return the length of a line (n, 2)."""
    return float(np.hypot(*np.diff(line, axis=0).T).sum())


def outside(directions: Array) -> Array:
    """Return unit normals to the right of directions (…, 2), which is outside."""
    return np.stack([directions[..., 1], -directions[..., 0]], axis=-1)


def points_along(line: Array, count: int) -> tuple[Array, Array]:
    """Return points (count, 2) spread evenly along a line, and the unit directions there.

    A single point is the middle of the line.
    """
    step = np.diff(line, axis=0)
    arclength = np.concatenate([[0.0], np.cumsum(np.hypot(*step.T))])
    places = (np.arange(count) + 0.5) / count * arclength[-1]
    direction = step[np.searchsorted(arclength, places) - 1]
    points = np.column_stack([np.interp(places, arclength, x) for x in line.T])
    return points, direction / np.hypot(*direction.T)[:, None]


def draw_lines(axes: Axes, lines: Sequence[Array], **look: Any) -> None:
    """Draw lines (n, 2) as one that is broken between them."""
    gap = np.full((1, 2), np.nan)
    pieces = [piece for line in lines for piece in (line, gap)]
    axes.plot(*np.concatenate(pieces).T, **look)


def draw_edge(
    axes: Axes, lines: Sequence[Array], look: dict[str, Any], hatched: bool, inch: float = 1.0
) -> list[Array]:
    """Draw an edge, hatched outside on request, and return the ends of the hatches.

    inch: an inch in units of the axes
    """
    draw_lines(axes, lines, solid_capstyle="butt", zorder=3, **look)
    if not hatched:
        return []
    hatches = list[Array]()
    for line in lines:
        starts, directions = points_along(line, round(length_of(line) / (HATCH * inch)))
        ends = starts + 0.7 * HATCH * inch * (outside(directions) - directions)
        hatches += [*np.stack([starts, ends], axis=1)]
    if hatches:
        draw_lines(axes, hatches, color=style.INK, linewidth=0.7, zorder=3)
    return [hatch[1:] for hatch in hatches]
