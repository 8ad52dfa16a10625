"""The panel of the body: deformed, coloured with a field, its edges drawn by their roles, named, hatched where held."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from tcstudy.errors import DrawError
from tcstudy.reports.figures import style
from tcstudy.reports.figures.panels import Array, Scale, Sheet, note, scale
from tcstudy.reports.picture import BodyFields, LineFields, NamedEdge, Picture, nearest
from tcstudy.reports.stresses import COMPONENTS, recovered
from tcstudy.reports.text import number, pretty
from tcstudy.scene.records import Scene

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

    moved, still: (n, 2) coordinates of the nodes, deformed and not, as they are drawn;  axis: what is drawn as 1
    factor:       exaggeration of the displacement
    box:          left, right, bottom and top of the panel;  per_inch: what is one inch of it
    """

    moved: Array
    still: Array
    axis: Scale
    factor: float
    box: tuple[float, float, float, float]
    per_inch: float

    @property
    def height(self) -> float:
        """Height of the panel [inch]."""
        return (self.box[3] - self.box[2]) / self.per_inch


def exaggeration(xy: Array, u: Array) -> float:
    """A factor 1, 2 or 5 times a power of ten that makes displacements u (…, n, 2) visible; 1 for a body at rest."""
    largest = float(np.hypot(u[..., 0], u[..., 1]).max())
    if largest == 0.0:
        return 1.0
    wanted = SHOWN * math.hypot(*np.ptp(xy, axis=0)) / largest
    power = 10.0 ** math.floor(math.log10(wanted))
    return float(f"{max(step for step in (1, 2, 5) if step == 1 or step * power <= wanted) * power:.1g}")


def drawn(body: BodyFields, length_units: str, widest: float, highest: float, factor: float | None = None) -> Drawn:
    """Scale a body to its panel, at most so wide and high [inch]; factor: of displacements, None for one that suits."""
    factor = exaggeration(body.xy, body.u) if factor is None else factor
    axis = scale("", np.ptp(body.xy, axis=0), length_units)
    still, moved = axis(body.xy), axis(body.xy + factor * body.u)
    low, high = (end(np.concatenate([still, moved]), axis=0) for end in (np.min, np.max))
    per_inch = float(np.max((high - low) / (np.array([widest, highest]) - 2 * MARGIN)))
    low, high = low - MARGIN * per_inch, high + MARGIN * per_inch
    return Drawn(moved, still, axis, factor, (low[0], high[0], low[1], high[1]), per_inch)


@dataclass(frozen=True)
class Field:
    """What the body is coloured with: triangles and values (n,) at their nodes of each part, and what is said of it."""

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
    """The field of a name of COMPONENTS, a displacement u_x or u_y, or else the temperature, None where there is none.

    Raises DrawError.
    """
    body = picture.body
    if body is None:
        if name is not None:
            raise DrawError("of: the run kept no fields of the body; run it again with output.fields: true")
        return None
    if name in (None, "theta"):
        found = (body.triangles, body.theta) if body.theta is not None else None
        return found and Field(r"temperature $\theta$", body.theta_units, (found,))
    if name in ("u_x", "u_y"):
        return Field(f"${name}$", picture.line.length_units, ((body.triangles, body.u[:, "xy".index(name[-1])]),))
    if name not in COMPONENTS:
        raise DrawError(f"of: the body has no field {name!r}; it has theta, u_x, u_y, {', '.join(COMPONENTS)}")
    if picture.scene is None:
        raise DrawError("the study in the file cannot be read any more, so its materials are not known")
    (label, component), (sigma, error) = COMPONENTS[name], recovered(body, picture.scene.material)
    parts = tuple((body.triangles[body.region == k], component(sigma[k])) for k in np.unique(body.region))
    told = f"stress recovered from elements, estimated error {number(100.0 * error, 2)} %"
    return Field(label, picture.line.traction_units, parts, told)


def draw_body(sheet: Sheet, axes: Axes, picture: Picture, shape: Drawn, field: Field | None) -> None:
    """Fill the panel and put the colour bar of the field to its right."""
    body = picture.body
    assert body is not None
    axes.set(xlabel=f"x{shape.axis.label}", ylabel=f"y{shape.axis.label}")
    axes.set_aspect("equal", adjustable="datalim")
    said = _fill(sheet, axes, shape, body, field)
    axes.set_title(f"Deformed body (deformation × {shape.factor:g}; dashed: undeformed){said}", loc="left")
    if len(body.triangles) <= FINE:
        axes.triplot(*shape.moved.T, body.triangles, color=style.INK, linewidth=0.4, alpha=0.25)
    rim = boundary_edges(body.xy, body.triangles)
    undeformed = joined(chained(shape.still[rim]))
    axes.plot(*undeformed, color=style.INK, alpha=0.6, linewidth=0.9, linestyle=(0, (5, 3)))
    axes.plot(*joined(chained(shape.moved[rim])), color=style.INK, linewidth=1.0)
    for k in np.unique(body.region)[1:]:
        _draw_region(axes, shape, body, int(k), picture.scene)
    _draw_edges(axes, shape, picture.edges, rim, nearest(body.xy[rim].mean(axis=1), picture.edges))
    _draw_contact(axes, shape, contact_chains(body.xy, rim, picture.line), picture.line)
    for source in picture.sources:
        _draw_source(axes, body, shape, source)
    axes.set_xlim(*shape.box[:2], auto=True)  # at least: they grow to the shape of the panel
    axes.set_ylim(*shape.box[2:], auto=True)


def _fill(sheet: Sheet, axes: Axes, shape: Drawn, body: BodyFields, field: Field | None) -> str:
    """Colour the body in bands between round values, with a bar; or evenly, and return what there is to say."""
    from matplotlib.colors import ListedColormap
    from matplotlib.ticker import MaxNLocator
    from matplotlib.tri import Triangulation

    x, y = shape.moved.T
    low, high = field.ends if field else (0.0, 0.0)
    if field is None or high - low <= UNIFORM * max(abs(low), abs(high)):
        colours = FILLS if field is None and body.region.any() else [style.EVEN if field else style.SHADE]
        shown = body.region % len(colours)
        axes.tripcolor(x, y, body.triangles, facecolors=shown, cmap=ListedColormap(colours), vmax=len(colours) - 0.5)
        if field is None:
            return ""
        symbol = field.name.rpartition(" ")[2]
        return f",  {symbol} = {number(0.5 * (low + high))} {pretty(field.units)}".rstrip() + " everywhere"
    axis = scale(field.name, [low, high], field.units)
    bands = MaxNLocator(nbins=12, steps=[1, 2, 2.5, 5, 10]).tick_values(low / axis.one, high / axis.one)
    how: dict[str, Any] = {"levels": bands, "cmap": style.HEAT if low >= 0.0 or not field.told else style.SIGNED}
    for triangles, values in field.parts:
        filled = axes.tricontourf(Triangulation(x, y, triangles), axis(values), **how)
    sheet.bar(axes, filled, axis.label)
    return f";  {field.told}" if field.told else ""


def _draw_region(axes: Axes, shape: Drawn, body: BodyFields, k: int, scene: Scene | None) -> None:
    """The outline of a region with a material of its own, with its name where there is room."""
    own = body.triangles[body.region == k]
    axes.plot(*joined(chained(shape.moved[boundary_edges(body.xy, own)])), color=style.INK, linewidth=0.7)
    places = shape.moved[np.unique(own)]
    name, size = scene.material.regions[k - 1][0] if scene else "", np.ptp(places, axis=0) / shape.per_inch
    if size[0] > style.LETTER * len(name) and size[1] > 2 * style.LETTER:
        note(axes, name, 0.5 * (places.min(axis=0) + places.max(axis=0)), (0, 0), ha="center", va="center", bbox=GROUND)


def _draw_edges(axes: Axes, shape: Drawn, named: Sequence[NamedEdge], rim: Indices, of: NDArray[np.int8]) -> None:
    """Lines in the way of their roles, hatched outside where clamped; each name once, along its longest edge."""
    longest: dict[str, tuple[float, NamedEdge, Array]] = {}
    for k in np.unique(of) if named else ():
        edge, segments = named[k], chained(shape.moved[rim[of == k]])
        if edge.role not in ("contact", "free"):
            draw_edge(axes, segments, ROLES[edge.role], edge.role == "clamped", shape.per_inch)
            length = float(directions(segments)[0].sum()) / shape.per_inch
            if length > longest.get(edge.name, (0.0, edge, segments))[0]:
                longest[edge.name] = length, edge, segments
    for length, edge, segments in longest.values():
        text = next((one for one in (edge_words(edge), edge.name) if style.LETTER * len(one) <= length), "")
        at, t, n = _middle(segments)
        angle = (math.degrees(math.atan2(t[1], t[0])) + 90.0 - 1e-9) % 180.0 - 90.0
        how = {"rotation": angle, "rotation_mode": "anchor", "ha": "center", "va": "center", "zorder": 6}
        note(axes, text, at, 13.0 * n, color=ROLES[edge.role]["color"], **how)


def edge_words(edge: NamedEdge) -> str:
    """What an edge is and does, "end: convection, traction"."""
    return f"{edge.name}: {edge.role}" + (", traction" if edge.loaded and edge.role != "traction" else "")


def _middle(segments: Array) -> tuple[Array, Array, Array]:
    """The place at half the length of pieces in order, the direction and the normal there."""
    (at,), (k,) = evenly(segments, 1)
    _, along, normals = directions(segments)
    return at, along[k], normals[k]


def _draw_contact(axes: Axes, shape: Drawn, chains: Sequence[tuple[Indices, Indices]], line: LineFields) -> None:
    """Thick contact edges; each name once, at its longest run, with an arrow in the direction of the arclength."""
    longest: dict[int, Indices] = {}
    for chain, index in chains:
        axes.plot(*shape.moved[chain].T, solid_capstyle="butt", **ROLES["contact"])
        edge = line.edge[index]
        for run in np.split(np.arange(len(chain)), np.flatnonzero(np.diff(edge)) + 1):
            if len(run) > max(1, len(longest.get(int(edge[run[0]]), ()))):
                longest[int(edge[run[0]])] = chain[run]
    how: dict[str, Any] = {"color": style.BLUE, "fontweight": "bold"}
    for k, run in longest.items():
        name, places = line.edge_names[k] if k < len(line.edge_names) else "", shape.moved[run]
        if run[0] == run[-1]:  # within the ring if there is room, else beside it; it may cover the body
            low, high = places.min(axis=0), places.max(axis=0)
            fits = style.LETTER * (len(name) + 2) * shape.per_inch <= high[0] - low[0]
            place = (low[0] + high[0]) / 2 if fits else high[0], (low[1] + high[1]) / 2
            ha = "center" if fits else "left"
            note(axes, name, place, (0 if fits else 7, 0), ha=ha, va="center", bbox=GROUND, zorder=6, **how)
            continue
        at, t, n = _middle(np.stack([places[:-1], places[1:]], axis=1))
        tail = at + 0.16 * shape.per_inch * n
        arrow = {"arrowstyle": "->", "color": style.BLUE, "shrinkA": 0, "shrinkB": 0}
        axes.annotate("", tuple(tail + 0.34 * shape.per_inch * t), tuple(tail), arrowprops=arrow)
        if abs(t[0]) > 0.6:
            where: dict[str, Any] = {"ha": "right" if t[0] > 0 else "left", "va": "center"}
        else:  # beside a steep edge there is room for the height of letters only
            where = {"ha": "center", "va": "top" if t[1] > 0 else "bottom", "rotation": 90}
        note(axes, name, tail, -4.0 * t, **where, **how)


GROUND = {"boxstyle": "round,pad=0.2", "facecolor": "white", "edgecolor": "none", "alpha": 0.85}


def _draw_source(axes: Axes, body: BodyFields, shape: Drawn, source: Array) -> None:
    """The outline of a heated region, displaced like the nodes near it."""
    share = np.linspace(0.0, 1.0, 16)[:, None, None]
    fine = ((1.0 - share) * source + share * np.roll(source, -1, axis=0)).swapaxes(0, 1).reshape(-1, 2)
    near = [int(np.argmin(np.hypot(*(body.xy - place).T))) for place in fine]
    places = shape.axis(fine) + (shape.moved - shape.still)[near]
    axes.plot(*places.T, color=style.INK, linewidth=1.1, linestyle=(0, (4, 2)), zorder=4)
    look: dict[str, Any] = {"ha": "center", "va": "center", "fontsize": style.pt(8.5), "bbox": GROUND, "zorder": 5}
    axes.text(float(places[:, 0].mean()), float(places[:, 1].mean()), "heated", **look)


def boundary_edges(xy: Array, triangles: Indices) -> Indices:
    """(e, 2) edges that belong to one triangle only, with the body on their left."""
    a, b, c = xy[triangles.T]
    area = np.linalg.det(np.stack([b - a, c - a], axis=-1))
    t = np.where((area < 0.0)[:, None], triangles[:, ::-1], triangles)
    edges = np.concatenate([t[:, [0, 1]], t[:, [1, 2]], t[:, [2, 0]]])
    _, first, count = np.unique(np.sort(edges, axis=1), axis=0, return_index=True, return_counts=True)
    return edges[first[count == 1]]


def contact_chains(xy: Array, rim: Indices, line: LineFields) -> list[tuple[Indices, Indices]]:
    """Mesh nodes of every part of the contact line, and the contact node that each of them is.

    A held node beside a part carries no unknown and is not in the line, but belongs to the drawn edge; it counts as
    the contact node next to it. A ring ends with its first node.
    """
    after, before = dict(rim.tolist()), dict(rim[:, ::-1].tolist())
    nodes, found = np.unique(rim), []
    for part in line.parts:
        places = np.column_stack([line.x[part], line.y[part]])
        chain = [int(nodes[np.argmin(np.hypot(*(xy[nodes] - place).T))]) for place in places]
        index, (first, last) = [*range(part.start, part.stop)], line.held(part)
        if first:
            chain, index = [before[chain[0]], *chain], [index[0], *index]
        if last or line.closed(part):
            chain, index = [*chain, after[chain[-1]]], [*index, index[-1] if last else index[0]]
        found.append((np.array(chain), np.array(index)))
    return found


# -- edges -------------------------------------------------------------------------------------------------------------

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


def chained(segments: Array) -> Array:
    """Straight pieces (k, 2, 2) in the order in which one walks along them, whatever that of the mesh is."""
    starts = {tuple(point): i for i, point in enumerate(segments[:, 0].tolist())}
    after = [starts.get(tuple(point)) for point in segments[:, 1].tolist()]
    order = dict[int, None]()
    for first in [*sorted(set(range(len(segments))) - set(after)), *range(len(segments))]:
        at: int | None = first
        while at is not None and at not in order:
            order[at] = None
            at = after[at]
    return segments[list(order)]


def joined(segments: Array) -> Array:
    """(2, n) x and y of pieces in order as one line, broken where they do not meet."""
    gaps = np.flatnonzero(np.any(segments[1:, 0] != segments[:-1, 1], axis=1))
    return np.insert(segments.reshape(-1, 2), 2 * (gaps + 1), np.nan, axis=0).T


def directions(segments: Array) -> tuple[Array, Array, Array]:
    """Lengths (k,), unit vectors along the pieces and unit normals to their right, which is outside (k, 2)."""
    along = segments[:, 1] - segments[:, 0]
    lengths = np.hypot(*along.T)
    along = along / lengths[:, None]
    return lengths, along, np.column_stack([along[:, 1], -along[:, 0]])


def evenly(segments: Array, count: int) -> tuple[Array, NDArray[np.intp]]:
    """Places (count, 2) evenly spread along pieces in order, and which piece each lies on; the middle if it is one."""
    lengths = directions(segments)[0]
    upto = np.cumsum(lengths)
    along = (np.arange(count) + 0.5) / count * upto[-1]
    of = np.searchsorted(upto[:-1], along)
    share = (along - (upto - lengths)[of]) / lengths[of]
    return segments[of, 0] + share[:, None] * (segments[of, 1] - segments[of, 0]), of


def draw_edge(axes: Axes, segments: Array, how: dict[str, Any], held: bool, inch: float = 1.0) -> Array:
    """Draw pieces in order, hatched outside where they are held; inch: what is one of the axes. Returns the ends of
    the hatches (n, 2)."""
    axes.plot(*joined(segments), solid_capstyle="butt", zorder=3, **how)
    lengths, along, normals = directions(segments)
    count = round(float(lengths.sum()) / (HATCH * inch))
    if not held or not count:
        return np.zeros((0, 2))
    starts, of = evenly(segments, count)
    ends = starts + 0.7 * HATCH * inch * (normals - along)[of]
    axes.plot(*joined(np.stack([starts, ends], axis=1)), color=style.INK, linewidth=0.7, zorder=3)
    return ends
