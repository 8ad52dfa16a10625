"""Pictures of one point: its body with u_T, ξ = −S_T, N along the contact line below; a profile
along any line through the body; its friction law b̂ with jumps filled in, and the operating point
(u_T, ξ) of every contact node on it.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from tcstudy.errors import DrawError, UsageError
from tcstudy.laws.composed import EdgeLaws, laws_along
from tcstudy.laws.laws import Laws
from tcstudy.laws.pieces import DOWN, UP
from tcstudy.reports.figures import style
from tcstudy.reports.figures.body import Field, draw_body, drawn, field_of, name_body
from tcstudy.reports.figures.panels import Array, Panel, Scale, Sheet, scale
from tcstudy.reports.picture import LineFields, Picture, edge_laws
from tcstudy.reports.text import LAMBDA_1_TOLERANCE, counted, number, pretty, with_unit
from tcstudy.scene.units import LENGTH, UnitError, split_quantity, to_si

if TYPE_CHECKING:
    from matplotlib.figure import Figure

PANEL, BODY = 1.3, 4.4
"""Height of a contact panel and largest height of the body [inch]."""
BESIDE = 2.1
"""Room left and right of the body, with the bar of the temperature [inch]."""
FEW = 60
"""Contact nodes up to which each one gets a dot."""


def point_figure(
    picture: Picture, look: style.Look, of: str | None = None, factor: float | None = None
) -> Figure:
    """The figure of one point; call it within `style.styled()` for its letters.

    of: the field of the body (`field_of`);  factor: of its displacement, None for one that suits
    """
    line, body, at = picture.line, picture.body, picture.at
    width = (look.size[0] / (look.letters / style.USUAL) if look.size else style.WIDTH) - BESIDE
    shape = drawn(body, line.length_units, width, BODY, factor) if body else None
    field, below = field_of(picture, of), shape is not None and line.along_x is not None
    panels = line_panels(picture, shape.axis if shape and below else None)
    rows, heights = [[name] for name in panels], [PANEL] * len(panels)
    if shape:
        rows, heights = [["body"], *rows], [shape.height, *heights]
    mesh = [
        f"level {picture.level}",
        f"largest element edge {with_unit(float(at['h_max']), line.length_units, 3)}",
        f"{int(at['n_dof'])} displacement DOFs",
        f"inclusion residual {number(float(at['inclusion_residual']), 2)}",
    ]
    sheet = Sheet(
        look,
        picture.title,
        [style.point_words(picture.point, picture.symbols), ",  ".join(mesh)],
        rows,
        heights,
    )
    sheet.draw(panels)
    sheet.share(*panels)
    for name, panel in panels.items():
        if not any(np.any(y) for kind, _, y, _ in panel.items if kind == "line"):
            sheet.panels[name].set_yticks(
                [0.0]
            )  # a scale around nothing but zero would mean nothing
    if shape:
        edges = draw_body(sheet, sheet.panels["body"], picture, shape, field)
    figure = sheet.finish()
    if shape:
        for name in (
            panels if below and look.into is None else ()
        ):  # axes that share x would cut off a high body
            sheet.panels[name].set_xlim(sheet.panels["body"].get_xlim())
        name_body(sheet.panels["body"], picture, shape, edges)
    return figure


def line_panels(picture: Picture, below: Scale | None) -> dict[str, Panel]:
    """u_T, ξ and, if it was asked for, the force of the section over the arclength.

    below: the axis of the body above the panels, on which they have the x of the line

    ξ is drawn as it is computed: constant on the segment S_i around every contact node.
    """
    line, length = picture.line, float(picture.line.c.sum())
    (sign, start), s = line.along_x or (1.0, 0.0), below and replace(below, label=f"x{below.label}")
    if s is None:
        alone = (
            line.edge_names[line.edge[0]]
            if len(np.unique(line.edge)) == 1 and line.edge_names
            else "the contact line"
        )
        sign, start, s = 1.0, 0.0, scale(f"arclength s along {alone}", [length], line.length_units)
    heading = f"{contact_title(picture)}; u_T > 0 with the body on the left"
    upper = Panel(s, scale("u_T", line.u_T, line.length_units), heading)
    lower = Panel(s, scale("ξ = −S_T", line.xi, line.traction_units))
    panels = {"upper": upper, "lower": lower}
    if line.section:
        N, units = line.section
        section = panels["section"] = Panel(
            s, scale("N", N, units), "Force of the section, positive in tension"
        )
        section.line(start + sign * line.arclength, N, color=style.GREEN, linewidth=1.5)
    names, dots = (
        line.edge_names,
        {"marker": "o" if len(line.u_T) <= FEW else "", "markersize": 3.0, "clip_on": False},
    )
    for k, part in enumerate(line.parts):
        ends, nodes = line.steps(part)
        at = np.append(line.arclength[part], ends[-1])[
            : len(nodes)
        ]  # a ring ends with its first node
        slips = picture.held[k] if len(picture.held) else (np.nan, np.nan)
        held = np.array(
            [one for one in zip(ends[[0, -1]], slips, strict=True) if np.isfinite(one[1])]
        ).reshape(-1, 2)
        x, u = np.array(
            sorted([*held, *np.column_stack([at, line.u_T[nodes]])], key=lambda one: float(one[0]))
        ).T
        upper.line(start + sign * x, u, color=style.BLUE, linewidth=1.5, **dots)
        steps = start + sign * np.repeat(ends, 2)[1:-1], np.repeat(line.xi[nodes], 2)
        lower.line(*steps, color=style.VERMILLION, linewidth=1.5)
        upper.line(
            start + sign * held[:, 0],
            held[:, 1],
            color=style.INK,
            marker="s",
            markersize=5,
            linestyle="none",
        )
        for end, slip in held[-1:]:
            side = 1.0 if sign * (np.mean(at) - end) > 0.0 else -1.0
            place = start + sign * end, slip
            upper.note(
                "held", place, (5 * side, 5), ha="left" if side > 0.0 else "right", fontsize=8.5
            )
    for panel in panels.values():
        for one, other in stick_ranges(line):
            panel.shade(start + sign * one, start + sign * other)
        panel.across(0.0, color=style.PALE, zorder=1)
        panel.limits[0] = None if below else (0.0, length / s.one)
    cuts = (
        np.flatnonzero(np.diff(line.edge)) + 1
    )  # where one contact edge ends and another begins, with their names
    ends = start + sign * np.array(
        [0.0, *(0.5 * (line.arclength[cuts - 1] + line.arclength[cuts])), length]
    )
    for k, cut in enumerate([0, *cuts]) if len(cuts) else ():
        look = {"ha": "center", "color": style.BLUE, "fontweight": "bold"}
        lower.note(names[line.edge[cut]], (ends[k : k + 2].mean(), 0.0), (0, 2), top=True, **look)
        for panel in panels.values() if k else ():
            panel.up(ends[k], color=style.PALE, zorder=1)
    return panels


def contact_title(picture: Picture) -> str:
    """Return what sticks and what slips; of an elastic bond, where no node can stick, neither."""
    scene, line = picture.scene, picture.line
    can_stick = scene is None or any(np.any(law.kinds == UP) for law in scene.laws)
    if not can_stick and not line.sticks.any():
        return "Contact line: elastic bond, which sticks nowhere"
    return f"Contact line: {stick_text(line)}"


def stick_text(line: LineFields) -> str:
    if not line.sticks.any():
        return "all of it slips"
    if line.sticks.all():
        return "all of it sticks (shaded)"
    share = line.c[line.sticks].sum() / line.c.sum()
    return f"the shaded part sticks ({100.0 * share:.1f} %), otherwise slip"


def stick_ranges(line: LineFields) -> list[tuple[float, float]]:
    """Arclengths between which the line sticks: joined segments S_i of sticking nodes."""
    ranges: list[tuple[float, float]] = []
    for part in line.parts:
        ends, nodes = line.steps(part)
        change = np.diff(np.concatenate([[0], line.sticks[nodes].astype(int), [0]]))
        first, last = np.flatnonzero(change == 1), np.flatnonzero(change == -1)
        ranges += [(float(ends[a]), float(ends[b])) for a, b in zip(first, last, strict=True)]
    return ranges


# -- profiles --------------------------------------------------------------------------------------

ALONG = 1001
"""Points of a line; fields are linear in a triangle."""
HEIGHT = 2.2
GROUPS = (("u_x", "u_y"), ("theta",), ("sigma_x", "sigma_y", "tau_xy"))
"""What is drawn unless one is named, a panel each."""
LOOKS: tuple[dict[str, Any], ...] = (
    {"color": style.BLUE},
    {"color": style.VERMILLION, "linestyle": "--"},
    {"color": style.GREEN, "linestyle": ":"},
)
Ends = tuple[tuple[float, float], tuple[float, float]]


def ends_of(along: str | Ends) -> Array:
    """(2, 2) both ends of a line, of numbers [m] or of a text "0 mm, 5 mm: 200 mm, 5 mm". Raises
    UsageError."""

    def metres(text: str) -> float:
        quantity = split_quantity(text.strip())
        return to_si(*quantity, LENGTH) if quantity else float(text)

    try:
        given = (
            [map(metres, point.split(",")) for point in along.split(":")]
            if isinstance(along, str)
            else along
        )
        ends = np.array([list(point) for point in given], dtype=float)
    except (TypeError, ValueError, UnitError):
        ends = np.zeros(0)
    if ends.shape != (2, 2) or not np.isfinite(ends).all() or np.array_equal(*ends):
        remedy = 'give two points of the body, for example "0 mm, 5 mm: 200 mm, 5 mm"'
        raise UsageError(f"along: {along!r} is no line; {remedy}")
    return ends


def profile_figure(
    picture: Picture, look: style.Look, along: str | Ends, of: str | None = None
) -> Figure:
    """The figure of one point: a panel each for displacement, temperature and stresses, or one for
    a field.

    Raises DrawError, UsageError.
    """
    ends, units = ends_of(along), picture.line.length_units
    share = np.linspace(0.0, 1.0, ALONG)
    places, s = (
        ends[0] + share[:, None] * (ends[1] - ends[0]),
        share * float(np.hypot(*(ends[1] - ends[0]))),
    )
    panels = dict[str, Panel]()
    for group in ((of,),) if of is not None else GROUPS:
        fields = [field for name in group if (field := field_of(picture, name)) is not None]
        if not fields:
            continue
        curves = [_curves(picture, field, places) for field in fields]
        values = np.concatenate([curve for parts in curves for curve in parts])
        if not np.isfinite(values).any():
            raise DrawError("along: no point of this line lies in the body")
        symbols = [field.name.rpartition(" ")[2] for field in fields]
        y = scale(", ".join(symbols), values[np.isfinite(values)], fields[0].units)
        panel = panels[group[0]] = Panel(
            scale("distance along the line", s, units), y, fields[0].told
        )
        panel.across(0.0, color=style.PALE)
        panel.limits[0] = 0.0, float(panel.x(s[-1]))
        for parts, symbol, look_of in zip(curves, symbols, LOOKS, strict=False):
            for i, curve in enumerate(parts):
                panel.line(
                    s, curve, linewidth=1.5, **look_of, **({"label": symbol} if i == 0 else {})
                )
    a, b = (", ".join(number(x) for x in end) for end in ends)
    facts = [
        style.point_words(picture.point, picture.symbols),
        f"level {picture.level},  from ({a}) to ({b}) {pretty(units)}".rstrip(),
    ]
    sheet = Sheet(look, picture.title, facts, [[name] for name in panels], [HEIGHT] * len(panels))
    sheet.draw(panels)
    for name, panel in panels.items():
        if sum("label" in how for *_, how in panel.items) > 1:
            sheet.legend(name)
    sheet.share(*panels)
    return sheet.finish()


def _curves(picture: Picture, field: Field, places: Array) -> list[Array]:
    """Values (n,) of a field at places, of each of its parts, NaN outside of it."""
    from matplotlib.tri import LinearTriInterpolator, Triangulation

    assert picture.body is not None
    x, y = picture.body.xy.T
    found = list[Array]()
    for triangles, values in field.parts:
        values_at = LinearTriInterpolator(Triangulation(x, y, triangles), values)(*places.T)
        found.append(np.ma.filled(np.ma.asarray(values_at, dtype=float), np.nan))
    return found


# -- laws ------------------------------------------------------------------------------------------

SAMPLES = 100
"""Points on a curved piece; a straight one has two."""
JUMPS: tuple[tuple[int, str, dict[str, Any]], ...] = (
    (UP, "up-jump", {"color": style.BLUE, "linewidth": 3.2, "solid_capstyle": "butt"}),
    (
        DOWN,
        "down-jump: sudden loss",
        {"color": style.VERMILLION, "linewidth": 2.2, "linestyle": (0, (2, 1.2))},
    ),
)
CURVE: dict[str, Any] = {"color": style.INK, "linewidth": 1.4}
NODE: dict[str, Any] = {
    "linestyle": "none",
    "markersize": 4.5,
    "markeredgewidth": 0.4,
    "markeredgecolor": "white",
}
NODE |= {"clip_on": False, "zorder": 4}
ROOM, BEYOND = 1.15, 4.0
"""The panel reaches a little past the outermost node, and so many times as far if the law has more
to show there."""

Operating = tuple[list[tuple[str, Laws]], NDArray[np.intp], Array]
"""(edge, law), one of "" where friction is the same along the line, after them those of joints;
which of them each node has (m,); the strength of the law there (m,)."""


def laws_of(point: Picture) -> Operating:
    """The laws of a stored point; raises DrawError where the study in its file cannot be read."""
    if point.scene is None:
        raise DrawError(
            "the study in the file cannot be read any more, so its friction laws are not known"
        )
    friction, line = EdgeLaws(edge_laws(point.scene.friction)), point.line
    xy = np.stack([line.x, line.y], axis=1)
    laws, index, strength = laws_along(friction, line.edge_names, line.edge, xy, line.joints)
    return list(laws), index, strength


def law_figure(point: Picture, of: Operating, look: style.Look) -> Figure:
    """The figure of one point."""
    line, (laws, index, strength) = point.line, of
    sheet, bonded = Sheet(look, point.title, _facts(point)), strength > 0.0
    xi = np.divide(line.xi, strength, out=np.zeros_like(line.xi), where=bonded)
    windows = [slip_window(law, line.u_T[index == k]) for k, (_, law) in enumerate(laws)]
    low, high = min(one[0] for one in windows), max(one[1] for one in windows)
    drawn = [pair for _, law in laws for pair in curves(law, max(abs(low), abs(high)))]
    within = [b for s, values in drawn for b in values[(s >= low) & (s <= high)]]
    scaled = "" if np.all(strength[bonded] == 1.0) else " / strength"
    panel = Panel(
        scale("slip u_T", [low, high], line.length_units),
        scale("friction ξ = −S_T" + scaled, [*within, *xi[bonded]], line.traction_units),
    )
    kinds = (
        ("sticks", line.sticks, "s", style.INK),
        ("slips", ~line.sticks, "o", style.VERMILLION),
    )
    for k, (edge, law) in enumerate(laws):
        colour = {"color": style.SERIES[k % len(style.SERIES)]} if len(laws) > 1 else {}
        draw_law(panel, law, (low, high), f"{edge}: {law.name}" if colour else "law b(s)", **colour)
        for _, which, mark, own in kinds:
            here = which & bonded & (index == k)
            panel.line(line.u_T[here], xi[here], marker=mark, **NODE | {"color": own} | colour)
    for word, which, mark, own in kinds:
        if count := int(np.count_nonzero(which & bonded)):
            look_of = NODE | {"color": style.INK if len(laws) > 1 else own}
            panel.line(
                [],
                [],
                marker=mark,
                **look_of | {"clip_on": True},
                label=f"{word} ({counted(count, 'node')})",
            )
    panel.draw(sheet.panels[""])
    sheet.panels[""].margins(y=0.12)
    sheet.key()
    return sheet.finish()


def _facts(point: Picture) -> list[str]:
    steep, at = "", point.at
    if "lambda_1" in at and np.isfinite(at["lambda_1"]):
        units = str(at["omega"].attrs.get("units", "1"))
        omega, lambda_1 = (with_unit(float(at[name]), units, 3) for name in ("omega", "lambda_1"))
        steep = f"maximum softening slope ω = {omega}, stiffness λ_1 = {lambda_1}"
        if (error := float(at["lambda_1_error"])) > LAMBDA_1_TOLERANCE:
            steep += f" (relative error {number(error, 2)})"
    return [
        ",  ".join(
            filter(None, [style.point_words(point.point, point.symbols), f"level {point.level}"])
        ),
        steep,
    ]


def slip_window(law: Laws, u_T: Array) -> tuple[float, float]:
    """Slips between which a law is drawn: the nodes and, if it is not too far away, all that the
    law does."""
    largest, reach = float(np.abs(u_T).max(initial=0.0)), slip_range(law)
    span = ROOM * max(largest, min(reach, BEYOND * largest)) or reach or 1.0
    low = -span if u_T.min(initial=0.0) < -0.01 * largest else -0.12 * span
    high = span if u_T.max(initial=0.0) > 0.01 * largest else 0.12 * span
    return (-span, span) if largest == 0.0 else (low, high)


def draw_law(
    panel: Panel, law: Laws, window: tuple[float, float], name: str = "", **colour: str
) -> None:
    """The pieces of a law as curves, each jump as the vertical interval that fills it."""
    for i, (s, b) in enumerate(curves(law, max(abs(window[0]), abs(window[1])))):
        panel.line(s, b, **CURVE | colour, label=name if i == 0 else "")
    for kind, word, look in JUMPS:
        for k in np.flatnonzero(law.kinds == kind):
            if window[0] <= law.kinks[k] <= window[1]:
                label = {} if colour else {"label": word}
                panel.line(
                    [law.kinks[k]] * 2,
                    [law.b_left[k], law.b_right[k]],
                    zorder=1,
                    **look | colour | label,
                )
    panel.across(0.0)
    panel.up(0.0, linewidth=0.7)
    panel.limits[0] = float(panel.x(window[0])), float(panel.x(window[1]))


def slip_range(law: Laws, decays: float = 4.0) -> float:
    """Largest |s| that matters to a law: past the outermost kink and some decay lengths; 0 for a
    law without either."""
    reach = float(np.abs(law.kinks).max(initial=0.0))
    decay = float((1.0 / law.rate[law.rate > 0.0]).max(initial=0.0))
    return max(1.4 * reach, decays * decay)


def curves(law: Laws, reach: float, samples: int = SAMPLES) -> list[tuple[Array, Array]]:
    """(s, b) along each piece of the law as far as it lies within −reach … reach."""
    ends = np.clip(np.concatenate([[-reach], law.kinks, [reach]]), -reach, reach)
    found = []
    for piece in range(len(law.q)):
        if ends[piece] < ends[piece + 1]:
            s = np.linspace(ends[piece], ends[piece + 1], samples if law.bent[piece] else 2)
            found.append((s, law.value(s, piece)))
    return found
