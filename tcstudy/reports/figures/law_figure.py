"""A friction law b̂ with its jumps filled in, and the operating point (u_T, ξ) of every contact node on it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from tcstudy.laws.composed import EdgeLaws, laws_along
from tcstudy.laws.laws import Laws
from tcstudy.laws.pieces import DOWN, UP
from tcstudy.reports.figures import style
from tcstudy.reports.figures.sheet import Sheet
from tcstudy.reports.picture import Picture, read_picture
from tcstudy.reports.select_point import Value
from tcstudy.reports.text import DIGITS, axis_unit, counted, number, pretty

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]

SAMPLES = 100
"""Points on a curved piece; a straight one has two."""

UP_STYLE: dict[str, Any] = {"color": style.BLUE, "linewidth": 3.2, "solid_capstyle": "butt"}
DOWN_STYLE: dict[str, Any] = {"color": style.VERMILLION, "linewidth": 2.2, "linestyle": (0, (2, 1.2))}
CURVE_STYLE: dict[str, Any] = {"color": style.INK, "linewidth": 1.4}
STICKING: dict[str, Any] = {"color": style.INK, "marker": "s"}
SLIPPING: dict[str, Any] = {"color": style.VERMILLION, "marker": "o"}
ROOM, BEYOND = 1.15, 4.0
"""The panel reaches a little past the outermost node, and so many times as far if the law has more to show there."""


@dataclass(frozen=True)
class LawPicture:
    """One point of a sweep and its laws.

    laws:     (edge, law), one of "" where friction is the same along the contact line; after them those of joints
    index:    (m,) which of them a node has;  strength: (m,) that of the law there
    """

    point: Picture
    laws: tuple[tuple[str, Laws], ...]
    index: NDArray[np.intp]
    strength: Array


def read_law(path: Path, point: Mapping[str, Value] | None, level: int) -> LawPicture:
    """Read a point and the law in the study of the file.

    Raises StoreError if `path` is no complete result file, DrawError if it has no such solved point or its study
    cannot be read.
    """
    picture = read_picture(path, point, level)
    if picture.scene is None:
        raise style.DrawError("the study in the file cannot be read any more, so its friction laws are not known")
    friction, line = picture.scene.friction, picture.line
    if isinstance(friction, Laws):
        friction = EdgeLaws((("", friction, 1.0),))
    xy = np.stack([line.x, line.y], axis=1)
    laws, index, strength = laws_along(friction, line.edge_names, line.edge, xy, line.joints)
    return LawPicture(picture, tuple(laws), index, strength)


def law_figure(picture: LawPicture, look: style.Look) -> Figure:
    """The figure of one point."""
    point, line = picture.point, picture.point.line
    sheet, bonded = Sheet(look, point.title, _facts(picture)), picture.strength > 0.0
    (axes,) = sheet.panels.values()
    xi = np.divide(line.xi, picture.strength, out=np.zeros_like(line.xi), where=bonded)
    windows = [slip_window(law, line.u_T[picture.index == k]) for k, (_, law) in enumerate(picture.laws)]
    low, high = min(one[0] for one in windows), max(one[1] for one in windows)
    drawn = [pair for _, law in picture.laws for pair in curves(law, max(abs(low), abs(high)))]
    within = [b for s, values in drawn for b in values[(s >= low) & (s <= high)]]
    slip, slip_unit = axis_unit([low, high], line.length_units)
    stress, stress_unit = axis_unit([*within, *xi[bonded]], line.traction_units)
    one = len(picture.laws) == 1
    for k, (_, law) in enumerate(picture.laws):
        colour = {} if one else {"color": style.SERIES[k % len(style.SERIES)]}
        draw_law(axes, law, (low, high), slip, stress, colour)
        for which, how in ((line.sticks, STICKING), (~line.sticks, SLIPPING)):
            here = which & bonded & (picture.index == k)
            if here.any():
                axes.plot(line.u_T[here] / slip, xi[here] / stress, linestyle="none", markersize=4, markeredgewidth=0.4,
                          markeredgecolor="white", clip_on=False, zorder=4, **how | colour)  # fmt: skip
    axes.set_xlabel(style.labelled("slip $u_T$", slip_unit))
    scaled = "" if np.all(picture.strength[bonded] == 1.0) else " / strength"
    axes.set_ylabel(style.labelled(r"friction $\xi = -S_T$" + scaled, stress_unit))
    sheet.key(_handles(picture, line.sticks & bonded, ~line.sticks & bonded))
    return sheet.finish()


def _facts(picture: LawPicture) -> list[str]:
    """The point, and what the law says of uniqueness."""
    point = picture.point
    words = [*style.parameter_words(point.parameters), f"level {point.level}"]
    divisor, unit = axis_unit([point.lambda_1], point.stiffness_units)
    omega, lambda_1 = number(point.omega / divisor, 3), number(point.lambda_1 / divisor, 3)
    steep = rf"steepest fall $\omega$ = {omega}, stiffness $\lambda_1$ = {lambda_1} {pretty(unit)}".rstrip()
    if point.lambda_1_error > DIGITS:
        steep += f" (relative error {number(point.lambda_1_error, 2)})"
    return [",  ".join(words), steep if np.isfinite(point.lambda_1) else ""]


def slip_window(law: Laws, u_T: Array) -> tuple[float, float]:
    """Slips between which a law is drawn: the nodes and, if it is not too far away, all that the law does."""
    largest, reach = float(np.abs(u_T).max(initial=0.0)), slip_range(law)
    span = ROOM * max(largest, min(reach, BEYOND * largest)) or reach or 1.0
    low = -span if u_T.min(initial=0.0) < -0.01 * largest else -0.12 * span
    high = span if u_T.max(initial=0.0) > 0.01 * largest else 0.12 * span
    return (-span, span) if largest == 0.0 else (low, high)


def draw_law(
    axes: Axes, law: Laws, window: tuple[float, float], slip: float, stress: float, colour: dict[str, str]
) -> None:
    """The pieces of a law as curves, each jump as the vertical interval that fills it; in units of slip and stress."""
    for s, b in curves(law, max(abs(window[0]), abs(window[1]))):
        axes.plot(s / slip, b / stress, **CURVE_STYLE | colour)
    for kind, how in ((UP, UP_STYLE), (DOWN, DOWN_STYLE)):
        for k in np.flatnonzero(law.kinds == kind):
            if window[0] <= law.kinks[k] <= window[1]:
                ends = np.array([law.b_left[k], law.b_right[k]]) / stress
                axes.plot([law.kinks[k] / slip] * 2, ends, zorder=1, **how | colour)
    axes.axhline(0.0, color=style.SHADE, linewidth=0.7, zorder=0)
    axes.axvline(0.0, color=style.SHADE, linewidth=0.7, zorder=0)
    axes.set_xlim(window[0] / slip, window[1] / slip)
    axes.margins(y=0.12)


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


def _handles(picture: LawPicture, sticking: Flags, slipping: Flags) -> list[Any]:
    """The key; of several laws, each in its colour, with the kinds of nodes in ink."""
    from matplotlib.lines import Line2D

    point: dict[str, Any] = {"linestyle": "none", "markersize": 5}
    named = [
        (CURVE_STYLE | {"color": style.SERIES[k % len(style.SERIES)]}, f"{edge}: {law.name}")
        for k, (edge, law) in enumerate(picture.laws)
    ]
    several, law = len(named) > 1, picture.laws[0][1]
    ink = {"color": style.INK} if several else {}
    entries = [
        *((True, *one) for one in (named if several else [(CURVE_STYLE, "law b(s)")])),
        (not several and bool(np.any(law.kinds == UP)), UP_STYLE, "up-jump"),
        (not several and bool(np.any(law.kinds == DOWN)), DOWN_STYLE, "down-jump: sudden loss"),
    ]
    for nodes, how, text in ((sticking, STICKING, "sticks"), (slipping, SLIPPING, "slips")):
        entries.append((bool(nodes.any()), how | point | ink, f"{text} ({counted(int(nodes.sum()), 'node')})"))
    return [Line2D([], [], **how, label=text) for there, how, text in entries if there]
