"""A friction law b̂ with its jumps filled in, and the operating point (u_T, ξ) of every contact node on it."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from tcstudy.errors import DrawError
from tcstudy.laws.composed import EdgeLaws, laws_along
from tcstudy.laws.laws import Laws
from tcstudy.laws.pieces import DOWN, UP
from tcstudy.reports.figures import style
from tcstudy.reports.figures.panels import Array, Panel, scale
from tcstudy.reports.figures.sheet import Sheet
from tcstudy.reports.picture import Picture
from tcstudy.reports.text import DIGITS, axis_unit, counted, number, pretty

if TYPE_CHECKING:
    from matplotlib.figure import Figure

SAMPLES = 100
"""Points on a curved piece; a straight one has two."""
JUMPS: tuple[tuple[int, str, dict[str, Any]], ...] = (
    (UP, "up-jump", {"color": style.BLUE, "linewidth": 3.2, "solid_capstyle": "butt"}),
    (DOWN, "down-jump: sudden loss", {"color": style.VERMILLION, "linewidth": 2.2, "linestyle": (0, (2, 1.2))}),
)
CURVE: dict[str, Any] = {"color": style.INK, "linewidth": 1.4}
NODE: dict[str, Any] = {"linestyle": "none", "markersize": 4.5, "markeredgewidth": 0.4, "markeredgecolor": "white"}
NODE |= {"clip_on": False, "zorder": 4}
ROOM, BEYOND = 1.15, 4.0
"""The panel reaches a little past the outermost node, and so many times as far if the law has more to show there."""

Operating = tuple[list[tuple[str, Laws]], NDArray[np.intp], Array]
"""(edge, law), one of "" where friction is the same along the line, after them those of joints; which of them each node
has (m,); the strength of the law there (m,)."""


def laws_of(point: Picture) -> Operating:
    """The laws of a stored point; raises DrawError where the study in its file cannot be read."""
    if point.scene is None:
        raise DrawError("the study in the file cannot be read any more, so its friction laws are not known")
    friction, line = point.scene.friction, point.line
    if isinstance(friction, Laws):
        friction = EdgeLaws((("", friction, 1.0),))
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
        scale("slip $u_T$", [low, high], line.length_units),
        scale(r"friction $\xi = -S_T$" + scaled, [*within, *xi[bonded]], line.traction_units),
    )
    kinds = (("sticks", line.sticks, "s", style.INK), ("slips", ~line.sticks, "o", style.VERMILLION))
    for k, (edge, law) in enumerate(laws):
        colour = {"color": style.SERIES[k % len(style.SERIES)]} if len(laws) > 1 else {}
        draw_law(panel, law, (low, high), f"{edge}: {law.name}" if colour else "law b(s)", **colour)
        for _, which, mark, own in kinds:
            here = which & bonded & (index == k)
            panel.line(line.u_T[here], xi[here], marker=mark, **NODE | {"color": own} | colour)
    for word, which, mark, own in kinds:
        if count := int(np.count_nonzero(which & bonded)):
            look_of = NODE | {"color": style.INK if len(laws) > 1 else own}
            panel.line([], [], marker=mark, **look_of | {"clip_on": True}, label=f"{word} ({counted(count, 'node')})")
    panel.draw(sheet.panels[""])
    sheet.panels[""].margins(y=0.12)
    sheet.key()
    return sheet.finish()


def _facts(point: Picture) -> list[str]:
    """The point, and what the law says of uniqueness."""
    steep, at = "", point.at
    if "lambda_1" in at and np.isfinite(at["lambda_1"]):
        divisor, unit = axis_unit([float(at["lambda_1"])], str(at["omega"].attrs.get("units", "1")))
        omega, lambda_1 = (number(float(at[name]) / divisor, 3) for name in ("omega", "lambda_1"))
        steep = rf"steepest fall $\omega$ = {omega}, stiffness $\lambda_1$ = {lambda_1} {pretty(unit)}".rstrip()
        if (error := float(at["lambda_1_error"])) > DIGITS:
            steep += f" (relative error {number(error, 2)})"
    return [",  ".join(filter(None, [style.point_words(point.point), f"level {point.level}"])), steep]


def slip_window(law: Laws, u_T: Array) -> tuple[float, float]:
    """Slips between which a law is drawn: the nodes and, if it is not too far away, all that the law does."""
    largest, reach = float(np.abs(u_T).max(initial=0.0)), slip_range(law)
    span = ROOM * max(largest, min(reach, BEYOND * largest)) or reach or 1.0
    low = -span if u_T.min(initial=0.0) < -0.01 * largest else -0.12 * span
    high = span if u_T.max(initial=0.0) > 0.01 * largest else 0.12 * span
    return (-span, span) if largest == 0.0 else (low, high)


def draw_law(panel: Panel, law: Laws, window: tuple[float, float], name: str = "", **colour: str) -> None:
    """The pieces of a law as curves, each jump as the vertical interval that fills it."""
    for i, (s, b) in enumerate(curves(law, max(abs(window[0]), abs(window[1])))):
        panel.line(s, b, **CURVE | colour, label=name if i == 0 else "")
    for kind, word, look in JUMPS:
        for k in np.flatnonzero(law.kinds == kind):
            if window[0] <= law.kinks[k] <= window[1]:
                label = {} if colour else {"label": word}
                panel.line([law.kinks[k]] * 2, [law.b_left[k], law.b_right[k]], zorder=1, **look | colour | label)
    panel.across(0.0)
    panel.up(0.0, linewidth=0.7)
    panel.limits[0] = float(panel.x(window[0])), float(panel.x(window[1]))


def slip_range(law: Laws, decays: float = 4.0) -> float:
    """Largest |s| that matters to a law: past the outermost kink and some decay lengths; 0 for a law without either."""
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
