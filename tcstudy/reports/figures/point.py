"""Pictures of one point: body and contact line, a profile along any line, the friction law.

The body stands above u_T, ξ = −S_T and N along the contact line. The law b̂ has its jumps filled
in, and the operating point (u_T, ξ) of every contact node on it.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from tcstudy.errors import DrawError, UsageError
from tcstudy.laws.composed import EdgeLaws, laws_along
from tcstudy.laws.laws import Laws
from tcstudy.laws.pieces import DOWN, UP
from tcstudy.laws.shapes import knows_pressure
from tcstudy.reports.figures import style
from tcstudy.reports.figures.body import Field, draw_body, field_of, name_body, scale_body
from tcstudy.reports.figures.panels import Array, Panel, Scale, Sheet, scale
from tcstudy.reports.picture import LineFields, Openings, Picture, edge_laws
from tcstudy.reports.text import LAMBDA_1_TOLERANCE, counted, number, pretty, with_unit
from tcstudy.scene.contact_states import NormalState
from tcstudy.scene.records import Scene
from tcstudy.scene.units import LENGTH, UnitError, split_quantity, to_si

if TYPE_CHECKING:
    from matplotlib.figure import Figure

PANEL_HEIGHT = 1.3
"""Height of a contact panel [inch]."""
MAX_BODY_HEIGHT = 4.4
"""Largest height of the body [inch]."""
BODY_SIDES = 2.1
"""Room left and right of the body, with the bar of the temperature [inch]."""
MAX_DOTTED_NODES = 60
"""Contact nodes up to which each one gets a dot."""


def point_figure(
    picture: Picture, look: style.Look, of: str | None = None, factor: float | None = None
) -> Figure:
    """Return the figure of one point; call it within `style.styled()` for its letters.

    of: the field of the body (`field_of`);  factor: of its displacement, None for one that suits
    """
    line, body = picture.line, picture.body
    width = look.size[0] / (look.letters / style.USUAL) if look.size else style.WIDTH
    shape = None
    if body:
        max_width = width - BODY_SIDES
        shape = scale_body(body, line.length_units, max_width, MAX_BODY_HEIGHT, factor)
    field = field_of(picture, of)
    body_axis = shape.axis if shape and line.along_x is not None else None
    panels = line_panels(picture, body_axis)
    rows = [[name] for name in panels]
    heights = [PANEL_HEIGHT] * len(panels)
    if shape:
        rows, heights = [["body"], *rows], [shape.height, *heights]
    facts = [style.point_words(picture.point, picture.symbols), _mesh_words(picture)]
    sheet = Sheet(look, picture.title, facts, rows, heights)
    sheet.draw(panels)
    sheet.share(*panels)
    for name, panel in panels.items():
        if not any(np.any(item.y) for item in panel.items if item.kind == "line"):
            # a scale around nothing but zero would mean nothing
            sheet.panels[name].set_yticks([0.0])
    if shape is None:
        return sheet.finish()
    axes = sheet.panels["body"]
    edges = draw_body(sheet, axes, picture, shape, field)
    figure = sheet.finish()
    if body_axis is not None and look.into is None:
        # axes that share x would cut off a high body
        for name in panels:
            sheet.panels[name].set_xlim(axes.get_xlim())
    name_body(axes, picture, shape, edges)
    return figure


def _mesh_words(picture: Picture) -> str:
    values = picture.values
    h_max = with_unit(float(values["h_max"]), picture.line.length_units, 3)
    facts = [
        f"level {picture.level}",
        f"largest element edge {h_max}",
        f"{int(values['n_dof'])} displacement DOFs",
        f"inclusion residual {number(float(values['inclusion_residual']), 2)}",
    ]
    return ",  ".join(facts)


@dataclass(frozen=True)
class Abscissa:
    """The x axis of the panels of a contact line: the arclength, or the x of a straight line."""

    axis: Scale
    start: float = 0.0
    sign: float = 1.0

    def at(self, arclength: Any) -> Any:
        """Return what stands on the axis at arclengths [units of the file]."""
        return self.start + self.sign * arclength


def _abscissa(line: LineFields, body_axis: Scale | None) -> Abscissa:
    if body_axis is not None:
        sign, start = line.along_x or (1.0, 0.0)
        return Abscissa(replace(body_axis, label=f"x{body_axis.label}"), start, sign)
    place = "the contact line"
    if len(np.unique(line.edge)) == 1 and line.edge_names:
        place = line.edge_names[line.edge[0]]
    length = float(line.c.sum())
    return Abscissa(scale(f"arclength s along {place}", [length], line.length_units))


def line_panels(picture: Picture, body_axis: Scale | None) -> dict[str, Panel]:
    """Return panels of u_T, ξ and, on request, the force of the section over the arclength.

    body_axis: x axis of the body above the panels, on which they have the x of the line

    ξ is drawn as it is computed: constant on the segment S_i around every contact node.
    """
    line = picture.line
    x = _abscissa(line, body_axis)
    direction = "u_T > 0 with the body on the left"
    title = f"Slip; {direction}" if picture.openings else f"{contact_title(picture)}; {direction}"
    slip = Panel(x.axis, scale("u_T", line.u_T, line.length_units), title)
    traction = Panel(x.axis, scale("ξ = −S_T", line.xi, line.traction_units))
    panels = {"upper": slip, "lower": traction}
    if picture.openings:
        panels = opening_panels(picture, picture.openings, x) | panels
        if not np.any(line.xi):
            del panels["lower"]  # without friction
    if line.section:
        panels["section"] = _section_panel(line, x)
    for index, part in enumerate(line.parts):
        end_slips = picture.held[index] if len(picture.held) else (np.nan, np.nan)
        _draw_part(slip, traction, line, part, x, end_slips)
    length = float(line.c.sum())
    for panel in panels.values():
        for first, last in stick_ranges(line):
            panel.shade(x.at(first), x.at(last))
        if picture.openings:
            _shade_openings(panel, picture.openings, x)
        panel.across(0.0, color=style.PALE, zorder=1)
        panel.limits[0] = None if body_axis else (0.0, length / x.axis.unit)
    named = panels.get("lower", slip)
    _draw_edge_names(named, panels.values(), line, x)
    return panels


SHADED = {
    NormalState.OPEN: ("is open (blue)", style.OPEN),
    NormalState.SOFTENING: ("softens (orange)", style.SOFTENING),
}
"""States of openings that are shaded, with their words."""
ROOM_BELOW = 0.12
"""Height of the foundation below an opening, of the largest opening."""


def opening_panels(picture: Picture, openings: Openings, x: Abscissa) -> dict[str, Panel]:
    """Return panels of the gap over the foundation, which is shaded, and of S_N."""
    line = openings.line
    opening = scale("opening s_N", line.u_T, line.length_units)
    gap = Panel(x.axis, opening, contact_title(picture))
    title = "Normal stress, positive in tension"
    stress = Panel(x.axis, scale("S_N", line.xi, line.traction_units), title)
    for part in line.parts:
        ends, nodes = line.steps(part)
        arclength = np.append(line.arclength[part], ends[-1])[: len(nodes)]
        gap.band(x.at(arclength), np.zeros(len(nodes)), line.u_T[nodes])
        _draw_part(gap, stress, line, part, x, (np.nan, np.nan))
    lowest = min(float(line.u_T.min()), -ROOM_BELOW * float(np.abs(line.u_T).max()))
    if lowest < 0.0:
        gap.shade(lowest, 0.0, upright=False)
        gap.limits[1] = (float(gap.y(lowest)), None)
    return {"opening": gap, "normal": stress}


def _shade_openings(panel: Panel, openings: Openings, x: Abscissa) -> None:
    for state, (_, colour) in SHADED.items():
        for first, last in _ranges(openings.line, openings.states == state):
            panel.shade(x.at(first), x.at(last), color=colour)


def _section_panel(line: LineFields, x: Abscissa) -> Panel:
    assert line.section is not None
    N, units = line.section
    panel = Panel(x.axis, scale("N", N, units), "Force of the section, positive in tension")
    panel.line(x.at(line.arclength), N, color=style.GREEN, linewidth=1.5)
    return panel


def _draw_part(
    slip: Panel,
    traction: Panel,
    line: LineFields,
    part: slice,
    x: Abscissa,
    end_slips: Sequence[float],
) -> None:
    """Draw u_T and ξ of a part of the line; end_slips: u_T of its constrained ends, or NaN."""
    ends, nodes = line.steps(part)
    # a ring ends with its first node
    places = np.append(line.arclength[part], ends[-1])[: len(nodes)]
    constrained = [
        (place, value)
        for place, value in zip(ends[[0, -1]], end_slips, strict=True)
        if np.isfinite(value)
    ]
    points = [*constrained, *np.column_stack([places, line.u_T[nodes]])]
    points.sort(key=lambda point: float(point[0]))
    s, u = np.array(points).T
    highest = float(u.max())
    lowest = float(u.min())
    marker = "o" if len(line.u_T) <= MAX_DOTTED_NODES else ""
    dots: dict[str, Any] = {"marker": marker, "markersize": 3.0, "clip_on": False}
    slip.line(x.at(s), u, color=style.BLUE, linewidth=1.5, **dots)
    step_ends, step_values = np.repeat(ends, 2)[1:-1], np.repeat(line.xi[nodes], 2)
    traction.line(x.at(step_ends), step_values, color=style.VERMILLION, linewidth=1.5)
    s, u = np.array(constrained).reshape(-1, 2).T
    square = {"color": style.INK, "marker": "s", "markersize": 5, "linestyle": "none"}
    slip.line(x.at(s), u, **square)
    if constrained:
        end, value = constrained[-1]
        is_left = x.sign * (np.mean(places) - end) > 0.0
        is_at_top = value == highest > lowest
        shift = 5 * (1.0 if is_left else -1.0), -18 if is_at_top else 5
        look: dict[str, Any] = {"ha": "left" if is_left else "right", "fontsize": 8.5}
        if is_at_top:
            look["va"] = "top"
        slip.note("constrained", (x.at(end), value), shift, **look)


def _draw_edge_names(named: Panel, panels: Iterable[Panel], line: LineFields, x: Abscissa) -> None:
    """Name the contact edges of a line of several, and mark the nodes where they meet."""
    cuts = np.flatnonzero(np.diff(line.edge)) + 1
    if not len(cuts):
        return
    middles = 0.5 * (line.arclength[cuts - 1] + line.arclength[cuts])
    ends = x.at(np.array([0.0, *middles, float(line.c.sum())]))
    look = {"ha": "center", "color": style.BLUE, "fontweight": "bold"}
    for index, node in enumerate([0, *cuts]):
        name = line.edge_names[line.edge[node]]
        middle = ends[index : index + 2].mean()
        named.note(name, (middle, 0.0), (0, 2), top=True, **look)
        if index > 0:
            for panel in panels:
                panel.up(ends[index], color=style.PALE, zorder=1)


def contact_title(picture: Picture) -> str:
    """Return what sticks and what slips; of an elastic bond, where no node can stick, neither."""
    scene, line = picture.scene, picture.line
    if picture.openings:
        return f"Contact line: {opening_text(picture.openings, line, scene)}"
    can_stick = scene is None or any(np.any(law.kinds == UP) for law in scene.laws)
    if not can_stick and not line.sticks.any():
        return "Contact line: elastic bond, which sticks nowhere"
    return f"Contact line: {stick_text(line)}"


def opening_text(openings: Openings, line: LineFields, scene: Scene | None) -> str:
    """Return which parts of a contact line that may open are open, soften, stick and slip."""
    normal = openings.line
    shares = {"sticks (shaded)": line.c[line.sticks].sum() / line.c.sum()}
    for state, (words, _) in SHADED.items():
        shares[words] = normal.c[openings.states == state].sum() / normal.c.sum()
    texts = [f"{100.0 * share:.1f} % {words}" for words, share in shares.items() if share > 0.0]
    slips = scene is None or not all(law.vanishes for law in scene.laws)
    rest = "the bond holds" if _is_bond(scene) else "it slips" if slips else "it is closed"
    if not texts and _is_bond(scene):
        return "the bond holds all of it"
    if not texts:
        return f"all of it is closed{' and slips' if slips else ''}"
    return ", ".join([*texts, f"otherwise {rest}"])


def _is_bond(scene: Scene | None) -> bool:
    return scene is not None and bool(scene.adhesive_edges)


def stick_text(line: LineFields) -> str:
    if not line.sticks.any():
        return "all of it slips"
    if line.sticks.all():
        return "all of it sticks (shaded)"
    share = line.c[line.sticks].sum() / line.c.sum()
    return f"the shaded part sticks ({100.0 * share:.1f} %), otherwise slip"


def stick_ranges(line: LineFields) -> list[tuple[float, float]]:
    """Return arclengths between which the line sticks: joined segments S_i of sticking nodes."""
    return _ranges(line, line.sticks)


def _ranges(line: LineFields, is_node: NDArray[np.bool_]) -> list[tuple[float, float]]:
    """Return arclengths between which are joined segments S_i of some nodes (m,) of a line."""
    ranges: list[tuple[float, float]] = []
    for part in line.parts:
        ends, nodes = line.steps(part)
        change = np.diff(np.concatenate([[0], is_node[nodes].astype(int), [0]]))
        first, last = np.flatnonzero(change == 1), np.flatnonzero(change == -1)
        ranges += [(float(ends[a]), float(ends[b])) for a, b in zip(first, last, strict=True)]
    return ranges


# -- profiles --------------------------------------------------------------------------------------

PROFILE_POINTS = 1001
"""Points of a line; fields are linear in a triangle."""
PROFILE_HEIGHT = 2.2
"""Height of a panel [inch]."""
GROUPS = (("u_x", "u_y"), ("theta",), ("sigma_x", "sigma_y", "tau_xy"))
"""Fields of each panel, unless one is named."""
LOOKS: tuple[dict[str, Any], ...] = (
    {"color": style.BLUE},
    {"color": style.VERMILLION, "linestyle": "--"},
    {"color": style.GREEN, "linestyle": ":"},
)
Ends = tuple[tuple[float, float], tuple[float, float]]


def ends_of(along: str | Ends) -> Array:
    """Return (2, 2) both ends of a line, of numbers [m] or a text "0 mm, 5 mm: 200 mm, 5 mm".

    Raises UsageError.
    """

    def metres(text: str) -> float:
        quantity = split_quantity(text.strip())
        return to_si(*quantity, LENGTH) if quantity else float(text)

    try:
        if isinstance(along, str):
            points = [[metres(text) for text in point.split(",")] for point in along.split(":")]
        else:
            points = [list(point) for point in along]
        ends = np.array(points, dtype=float)
    except (TypeError, ValueError, UnitError):
        ends = np.zeros(0)
    if ends.shape != (2, 2) or not np.isfinite(ends).all() or np.array_equal(*ends):
        remedy = 'give two points of the body, for example "0 mm, 5 mm: 200 mm, 5 mm"'
        raise UsageError(f"along: {along!r} is no line; {remedy}")
    return ends


def profile_figure(
    picture: Picture, look: style.Look, along: str | Ends, of: str | None = None
) -> Figure:
    """Return the figure of a profile: displacement, temperature and stresses, or one field.

    Raises DrawError, UsageError.
    """
    ends = ends_of(along)
    share = np.linspace(0.0, 1.0, PROFILE_POINTS)
    places = ends[0] + share[:, None] * (ends[1] - ends[0])
    distance = share * float(np.hypot(*(ends[1] - ends[0])))
    panels = dict[str, Panel]()
    groups = GROUPS if of is None else ((of,),)
    for group in groups:
        fields = [field_of(picture, name) for name in group]
        drawn_fields = [field for field in fields if field is not None]
        if drawn_fields:
            panels[group[0]] = _profile_panel(picture, drawn_fields, places, distance)
    units = picture.line.length_units
    start, end = (", ".join(number(x) for x in point) for point in ends)
    facts = [
        style.point_words(picture.point, picture.symbols),
        f"level {picture.level},  from ({start}) to ({end}) {pretty(units)}".rstrip(),
    ]
    rows, heights = [[name] for name in panels], [PROFILE_HEIGHT] * len(panels)
    sheet = Sheet(look, picture.title, facts, rows, heights)
    sheet.draw(panels)
    for name, panel in panels.items():
        if sum("label" in item.look for item in panel.items) > 1:
            sheet.legend(name)
    sheet.share(*panels)
    return sheet.finish()


def _profile_panel(
    picture: Picture, fields: Sequence[Field], places: Array, distance: Array
) -> Panel:
    """Return fields of one unit over the distance along a line.

    Raises DrawError if no place lies in the body.
    """
    curves_of_fields = [_curves(picture, field, places) for field in fields]
    values = np.concatenate([curve for field_curves in curves_of_fields for curve in field_curves])
    if not np.isfinite(values).any():
        raise DrawError("along: no point of this line lies in the body")
    x = scale("distance along the line", distance, picture.line.length_units)
    title = ", ".join(field.symbol for field in fields)
    y = scale(title, values[np.isfinite(values)], fields[0].units)
    panel = Panel(x, y, fields[0].note)
    panel.across(0.0, color=style.PALE)
    panel.limits[0] = 0.0, float(panel.x(distance[-1]))
    for field, field_curves, look in zip(fields, curves_of_fields, LOOKS, strict=False):
        label = {"label": field.symbol}  # once for all parts of the body
        for curve in field_curves:
            panel.line(distance, curve, linewidth=1.5, **look, **label)
            label = {}
    return panel


def _curves(picture: Picture, field: Field, places: Array) -> list[Array]:
    """Return the values (n,) at places of each part of a field, NaN outside the part."""
    from matplotlib.tri import LinearTriInterpolator, Triangulation

    assert picture.body is not None
    x, y = picture.body.xy.T
    curves = list[Array]()
    for triangles, values in field.parts:
        values_at = LinearTriInterpolator(Triangulation(x, y, triangles), values)(*places.T)
        curves.append(np.ma.filled(np.ma.asarray(values_at, dtype=float), np.nan))
    return curves


# -- laws ------------------------------------------------------------------------------------------

CURVE_SAMPLES = 100
"""Points on a curved piece; a straight one has two."""
JUMPS: tuple[tuple[int, str, dict[str, Any]], ...] = (
    (UP, "up-jump", {"color": style.BLUE, "linewidth": 3.2, "solid_capstyle": "butt"}),
    (
        DOWN,
        "down-jump: sudden loss",
        {"color": style.VERMILLION, "linewidth": 2.2, "linestyle": (0, (2, 1.2))},
    ),
)
"""Kinds of jumps with their labels and looks."""
CURVE: dict[str, Any] = {"color": style.INK, "linewidth": 1.4}
NODE: dict[str, Any] = {
    "linestyle": "none",
    "markersize": 4.5,
    "markeredgewidth": 0.4,
    "markeredgecolor": "white",
    "clip_on": False,
    "zorder": 4,
}
SLIP_ROOM = 1.15
"""Width of the panel relative to the outermost node."""
MAX_SLIP_ROOM = 4.0
"""The same, at most, where the law has more to show beyond the nodes."""


@dataclass(frozen=True)
class OperatingLaws:
    """The laws of a contact line.

    laws:     (edge, law) with "" for the edge where friction is the same along the line; the laws
              of joints come last
    index:    (m,) index of the law of every node
    strength: (m,) strength of the law at every node
    """

    laws: Sequence[tuple[str, Laws]]
    index: NDArray[np.intp]
    strength: Array


def laws_of(point: Picture) -> OperatingLaws:
    """Return the laws of a stored point.

    Raises DrawError where the study in its file cannot be read.
    """
    if point.scene is None:
        raise DrawError(
            "the study in the file cannot be read any more, so its friction laws are not known"
        )
    line = point.line
    friction = EdgeLaws(edge_laws(point.scene.friction))
    xy = np.stack([line.x, line.y], axis=1)
    laws, index, strength = laws_along(friction, line.edge_names, line.edge, xy, line.joints)
    return OperatingLaws(list(laws), index, strength * _pressure_factor(point, point.scene))


def _pressure_factor(point: Picture, scene: Scene) -> Array:
    """Return (m,) the factor of friction by the pressure of the contact nodes, 1 on other edges.

    It is the pressure itself for a coefficient of friction; other friction of unilateral edges
    acts where they are pressed.
    """
    line, openings, pressed = point.line, point.openings, scene.pressed_friction
    factor = np.ones(len(line.u_T))
    if openings is None or pressed is None:
        return factor
    pressure = np.interp(line.arclength, openings.line.arclength, -openings.S_N)
    for edge, law, _ in pressed.laws:
        if law.vanishes or edge not in line.edge_names:
            continue
        is_on_edge = line.edge == line.edge_names.index(edge)
        acting = np.maximum(pressure, 0.0) if knows_pressure(law) else 1.0 * (pressure > 0.0)
        factor[is_on_edge] = acting[is_on_edge]
    return factor


@dataclass(frozen=True)
class NodeGroup:
    """Contact nodes (m,) drawn with one marker, and its colour where there is one law."""

    name: str
    nodes: NDArray[np.bool_]
    marker: str
    colour: str


def law_figure(point: Picture, operating: OperatingLaws, look: style.Look) -> Figure:
    """Return the laws of one point with the operating points of its nodes.

    The laws of bonds that may open stand below those of friction, or alone without any.
    """
    has_bond = point.openings is not None and _is_bond(point.scene)
    has_friction = not (has_bond and all(law.vanishes for _, law in operating.laws))
    names = [""] * has_friction + ["opening"] * has_bond
    height = LAW_HEIGHT if len(names) == 1 else LOW_LAW_HEIGHT
    rows = [[name] for name in names]
    sheet = Sheet(look, point.title, _facts(point), rows, [height] * len(names))
    if has_friction:
        _friction_panel(point, operating).draw(sheet.panels[""])
        sheet.panels[""].margins(y=0.12)
        sheet.key("")
    if has_bond:
        _opening_law_panel(point).draw(sheet.panels["opening"])
        sheet.legend("opening")
    return sheet.finish()


def _friction_panel(point: Picture, operating: OperatingLaws) -> Panel:
    """Return the friction laws with (u_T, ξ) of the nodes on them."""
    line, laws, strength = point.line, operating.laws, operating.strength
    is_bonded = strength > 0.0
    xi = np.divide(line.xi, strength, out=np.zeros_like(line.xi), where=is_bonded)
    panel, window = _law_panel(line, operating, xi)
    groups = (
        NodeGroup("sticks", line.sticks & is_bonded, "s", style.INK),
        NodeGroup("slips", ~line.sticks & is_bonded, "o", style.VERMILLION),
    )
    has_one_law = len(laws) == 1
    for index, (edge, law) in enumerate(laws):
        colour, label = {}, "law b(s)"
        if not has_one_law:
            colour = {"color": style.SERIES[index % len(style.SERIES)]}
            label = f"{edge}: {law.name}"
        draw_law(panel, law, window, label, **colour)
        for group in groups:
            nodes = group.nodes & (operating.index == index)
            if point.openings is not None and not nodes.any():
                continue  # without a place they would stand in the corner of the sheet
            dots = NODE | {"color": group.colour} | colour
            panel.line(line.u_T[nodes], xi[nodes], marker=group.marker, **dots)
    for group in groups:
        count = int(np.count_nonzero(group.nodes))
        if count:
            dots = NODE | {"color": group.colour if has_one_law else style.INK, "clip_on": True}
            label = f"{group.name} ({counted(count, 'node')})"
            panel.line([], [], marker=group.marker, **dots, label=label)
    return panel


LAW_HEIGHT, LOW_LAW_HEIGHT = 3.6, 2.6
"""Height of a panel of laws; of each of two [inch]."""
NORMAL_LOOKS = (
    ("closed", "s", style.INK),
    ("elastic", "o", style.BLUE),
    ("softening", "o", style.SERIES[4]),
    ("open", "o", style.VERMILLION),
)
"""Name, marker and colour of openings, by NormalState."""


def _opening_law_panel(point: Picture) -> Panel:
    """Return the laws of the bonds that may open, with (s_N, S_N) of their nodes on them."""
    openings, scene = point.openings, point.scene
    assert openings is not None
    assert scene is not None
    line = openings.line
    bonds = [(edge, law) for edge, law, _ in scene.opening_laws.laws if law.name != "unilateral"]
    codes = [line.edge_names.index(edge) for edge, _ in bonds]
    is_bond = np.isin(line.edge, codes)
    is_bond[np.asarray(line.joints.node, dtype=np.intp)] = False  # they have two laws
    s_N, S_N, states = openings.s_N[is_bond], openings.S_N[is_bond], openings.states[is_bond]
    reach = max(slip_range(law) for _, law in bonds)
    high = max(min(reach, MAX_SLIP_ROOM * float(s_N.max())), SLIP_ROOM * float(s_N.max())) or reach
    low = min(float(s_N.min()), 0.0)
    samples = [law.b(np.linspace(0.0, high, CURVE_SAMPLES)) for _, law in bonds]
    opening = scale("opening s_N", [low, high], line.length_units)
    panel = Panel(opening, scale("S_N", np.concatenate([S_N, *samples]), line.traction_units))
    for index, (edge, law) in enumerate(bonds):
        label, colour = "law b_N(s_N)", {}
        if len(bonds) > 1:
            label = f"{edge}: {law.name}"
            colour = {"color": style.SERIES[index % len(style.SERIES)]}
        for s, b in curves(law, max(high, -low)):
            is_inside = s >= (0.0 if np.all(law.is_closed) else low)
            if np.count_nonzero(is_inside) > 1:
                panel.line(s[is_inside], b[is_inside], **CURVE | colour, label=label)
                label = ""
        if np.all(law.is_closed):
            bottom = min(float(S_N.min()), 0.0)
            panel.line([0.0, 0.0], [bottom, float(law.b(0.0))], **CURVE | colour)
    for state, (name, marker, colour_of_state) in enumerate(NORMAL_LOOKS):
        nodes = states == state
        if nodes.any():
            dots = NODE | {"color": colour_of_state}
            label = f"{name} ({counted(int(nodes.sum()), 'node')})"
            panel.line(s_N[nodes], S_N[nodes], marker=marker, **dots, label=label)
    panel.across(0.0)
    panel.up(0.0, linewidth=0.7)
    return panel


def _law_panel(
    line: LineFields, operating: OperatingLaws, xi: Array
) -> tuple[Panel, tuple[float, float]]:
    """Return an empty panel for the laws and ξ by strength, and the slips between its ends."""
    windows = []
    for index, (_, law) in enumerate(operating.laws):
        windows.append(slip_window(law, line.u_T[operating.index == index]))
    low, high = min(low for low, _ in windows), max(high for _, high in windows)
    tractions = [xi[operating.strength > 0.0]]
    for _, law in operating.laws:
        for s, b in curves(law, max(abs(low), abs(high))):
            tractions.append(b[(s >= low) & (s <= high)])
    has_unit_strength = np.all(operating.strength[operating.strength > 0.0] == 1.0)
    title = "friction ξ = −S_T" + ("" if has_unit_strength else " / strength")
    units = line.traction_units
    if any(knows_pressure(law) for _, law in operating.laws):
        title, units = "friction ξ / pressure", "1"
    slip = scale("slip u_T", [low, high], line.length_units)
    return Panel(slip, scale(title, np.concatenate(tractions), units)), (low, high)


def _facts(point: Picture) -> list[str]:
    values = point.values
    words = filter(None, [style.point_words(point.point, point.symbols), f"level {point.level}"])
    facts = [",  ".join(words), ""]
    has_stiffness = "lambda_1" in values and np.isfinite(values["lambda_1"])
    if has_stiffness and not np.isnan(values["omega"]):
        units = str(values["omega"].attrs.get("units", "1"))
        omega = with_unit(float(values["omega"]), units, 3)
        lambda_1 = with_unit(float(values["lambda_1"]), units, 3)
        facts[1] = f"maximum softening slope ω = {omega}, stiffness λ_1 = {lambda_1}"
        error = float(values["lambda_1_error"])
        if error > LAMBDA_1_TOLERANCE:
            facts[1] += f" (relative error {number(error, 2)})"
    return facts


def slip_window(law: Laws, u_T: Array) -> tuple[float, float]:
    """Return the slips between which a law is drawn: the nodes, and the whole law if near."""
    largest = float(np.abs(u_T).max(initial=0.0))
    reach = slip_range(law)
    span = SLIP_ROOM * max(largest, min(reach, MAX_SLIP_ROOM * largest)) or reach or 1.0
    if largest == 0.0:
        return -span, span
    low = -span if u_T.min(initial=0.0) < -0.01 * largest else -0.12 * span
    high = span if u_T.max(initial=0.0) > 0.01 * largest else 0.12 * span
    return low, high


def draw_law(
    panel: Panel, law: Laws, window: tuple[float, float], name: str = "", **colour: str
) -> None:
    """Draw the pieces of a law as curves, each jump as the vertical interval that fills it."""
    low, high = window
    label = name
    for s, b in curves(law, max(abs(low), abs(high))):
        panel.line(s, b, **CURVE | colour, label=label)
        label = ""
    for kind, word, look in JUMPS:
        jump_look = look | colour if colour else look | {"label": word}
        for kink in np.flatnonzero(law.kinds == kind):
            slip = law.kinks[kink]
            if low <= slip <= high:
                ends = [law.b_left[kink], law.b_right[kink]]
                panel.line([slip] * 2, ends, zorder=1, **jump_look)
    panel.across(0.0)
    panel.up(0.0, linewidth=0.7)
    panel.limits[0] = float(panel.x(low)), float(panel.x(high))


def slip_range(law: Laws, decays: float = 4.0) -> float:
    """Return the largest |s| that matters to a law: past its outermost kink and decay lengths.

    It is 0 for a law without either.
    """
    reach = float(np.abs(law.kinks).max(initial=0.0))
    decay = float((1.0 / law.rate[law.rate > 0.0]).max(initial=0.0))
    return max(1.4 * reach, decays * decay)


def curves(law: Laws, reach: float, samples: int = CURVE_SAMPLES) -> list[tuple[Array, Array]]:
    """Return (s, b) along each piece of the law as far as it lies within −reach … reach."""
    ends = np.clip(np.concatenate([[-reach], law.kinks, [reach]]), -reach, reach)
    pieces = []
    for piece in range(len(law.q)):
        if ends[piece] < ends[piece + 1]:
            count = samples if law.bent[piece] else 2
            s = np.linspace(ends[piece], ends[piece + 1], count)
            pieces.append((s, law.value(s, piece)))
    return pieces
