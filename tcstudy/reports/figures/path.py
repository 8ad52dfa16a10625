"""The picture of a path: response curve with folds and hysteresis loop, and the state of the contact line."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from tcstudy.errors import DrawError
from tcstudy.reports.figures import style
from tcstudy.reports.figures.panels import Array, Panel, Scale, contact_nodes, scale
from tcstudy.reports.figures.sheet import Sheet
from tcstudy.reports.terminal.paths import STATES, seen_folds
from tcstudy.reports.text import counted, labels, number, with_unit

if TYPE_CHECKING:
    from matplotlib.figure import Figure

RESPONSES: dict[str, tuple[str, str, Callable[[Array, Array, Array], Array]]] = {
    "mean-slip": ("mean $u_T$", "u_T", lambda u, xi, c: np.asarray(u @ c / c.sum())),
    "max-slip": ("max $|u_T|$", "u_T", lambda u, xi, c: np.max(np.abs(u), axis=1, initial=0.0)),
    "friction": (r"$\int\xi\,$ds", "xi", lambda u, xi, c: np.asarray(xi @ c)),
}
"""What may stand over the parameter: label, the variable that it is made of, formula."""
CURVE, MAP = 3.4, 1.25
"""Heights of the response curve and of a map of states [inch]."""
LETTERS, APART = 7, 0.06
"""Room for the name of a vertex of a path; part of the path by which folds that are named lie apart."""

STABLE: dict[str, Any] = {"color": style.INK, "linewidth": 1.3, "zorder": 4}
UNSTABLE: dict[str, Any] = {"color": style.VERMILLION, "linewidth": 0.9, "linestyle": (0, (4, 2)), "zorder": 3}
FOLD: dict[str, Any] = {"color": style.VERMILLION, "marker": "o", "markersize": 3.2, "markerfacecolor": "white"}
FOLD |= {"markeredgewidth": 0.9, "linestyle": "none", "zorder": 5}
ASKED: dict[str, Any] = {"color": style.BLUE, "marker": "D", "markersize": 5, "linestyle": "none", "zorder": 7}
LEAST = (("#5aa9dc", "global minimum (proved)"), ("#c3dff2", "least energy on the path"))
COLOURS = ("#dedede", "#7fb8de", "#f2c14e", "#d55e00", "#b7a3d6")
"""Of `ContactState`."""


def path_figure(data: Any, response: str, look: style.Look) -> Figure:
    """The figure of a path's file; response: one of RESPONSES, which stands over the parameter."""
    if response not in RESPONSES:
        raise DrawError(f"there is no response {response!r}; use one of {', '.join(RESPONSES)}")
    panels = path_panels(data, response)
    heights = (CURVE, MAP, MAP)[: len(panels)]
    sheet = Sheet(look, data.attrs["title"], [_caption(data)], [[name] for name in panels], heights)
    if "along" in panels:
        panels["along"].ticks = _apart(panels["along"].ticks, LETTERS / sheet.wide)
    sheet.draw(panels)
    sheet.share(*list(panels)[:2])
    sheet.key("curve", place="upper left")
    sheet.key(*list(panels)[1:], place="lower left")
    return sheet.finish()


def path_panels(data: Any, response: str) -> dict[str, Panel]:
    """The response curve, the state of the contact line over the parameter, and, where there are folds, along the path.

    The state over the parameter is that of the solution of least energy. The length of the path is counted in the plane
    of the response curve; its ends and folds are named.
    """
    name, (title, source, formula) = str(data.attrs["parameter"]), RESPONSES[response]
    units = str(data[source].attrs["units"])
    c, span = data["c"].values, np.sort(np.asarray(data.attrs["parameter_range"], dtype=float))
    values = {
        kind: formula(data[f"{kind}u_T"].values, data[f"{kind}xi"].values, c)
        for kind in ("", "loop_", "solution_", "branch_")
        if f"{kind}u_T" in data
    }
    t, y = data["parameter"].values, values[""]
    folds = seen_folds(data)[0]
    pieces, inside, drawn = within(t, y, span)
    seen = np.concatenate([drawn.ravel() if len(pieces) else y, values.get("branch_", np.zeros(0))])
    across = scale("load factor" if name == "load" else style.symbol(name), span, str(data["parameter"].attrs["units"]))
    curve = Panel(across, scale(title, seen, "N m-1" if source == "xi" and units != "1" else units))
    curve.across(0.0)
    _pieces(curve, t, y, data["stable"].values.astype(bool))
    if "branch_" in values:
        _branches(curve, data, values["branch_"])
    _least(curve, data, t, y)
    curve.line(t[folds], y[folds], **FOLD, label="fold" if len(folds) else "")
    _asked(curve, data, values.get("solution_", np.zeros(0)))
    if "loop_" in values:
        _loop(curve, data, values["loop_"], float(np.ptp(span)))
    curve.window(span, seen, (0.0, 0.05))
    found = {"curve": curve, "over": _over(data, across, curve.limits[0])}
    if np.isin(pieces, folds).any():
        found["along"] = _along(data, across, pieces, inside, drawn)
    return found


def within(t: Array, y: Array, span: Array) -> tuple[NDArray[np.intp], Array, Array]:
    """The pieces of a line that have a part with t inside the span, and t and y (p, 2) at the ends of that part."""
    ends = np.stack([t[:-1], t[1:]], axis=1)
    pieces = np.flatnonzero((ends.min(axis=1) < span[1]) & (ends.max(axis=1) > span[0]))
    ends, values = ends[pieces], np.stack([y[:-1], y[1:]], axis=1)[pieces]
    inside, length = np.clip(ends, *span), np.diff(ends, axis=1)
    share = np.where(length == 0.0, [0.0, 1.0], (inside - ends[:, :1]) / np.where(length == 0.0, 1.0, length))
    return pieces, inside, values[:, :1] + share * np.diff(values, axis=1)


def _caption(data: Any) -> str:
    low, high = sorted(float(x) for x in data.attrs["parameter_range"])
    t = data["parameter"].values[seen_folds(data)[0]]
    parts = [
        f"{data.sizes.get('piece', 0)} pieces",
        counted(int(np.count_nonzero((t >= low) & (t <= high))), "fold"),
        f"{int(data['n_contact'])} contact nodes, level {int(data['level'])}",
        f"worst residual {number(float(data['residual'].max()), 2)}",
    ]
    if "energy_lost" in data:
        parts.append(f"{with_unit(float(data['energy_lost']), data['energy_lost'].attrs['units'])} lost in one loop")
    if float(data["law_error"]) > 0.0:
        parts.append(f"law approximated to {float(data['law_error']):.1g}")
    return ",  ".join(parts)


def _pieces(panel: Panel, t: Array, y: Array, stable: NDArray[np.bool_], **how: Any) -> None:
    """Stable and unstable pieces as two lines that are broken where pieces of the other kind lie."""
    for which, look, name in ((stable, STABLE, "stable"), (~stable, UNSTABLE, "unstable")):
        cuts = np.flatnonzero(~which) + 1
        named = {"label": name} if which.any() and not how else {}
        panel.line(np.insert(t, cuts, np.nan), np.insert(y, cuts, np.nan), **look | how | named)


def _branches(panel: Panel, data: Any, y: Array) -> None:
    """Branches that the path does not meet."""
    of, t, stable = (data[f"branch_{name}"].values for name in ("of", "parameter", "stable"))
    for k in np.flatnonzero(data["branch_on_path"].values == 0):
        own = np.flatnonzero(of == k)
        _pieces(panel, t[own], y[own], stable[own[:-1]].astype(bool), color=style.BLUE, linewidth=1.3)
    if not data["branch_on_path"].values.all():
        panel.line([], [], color=style.BLUE, linewidth=1.3, label="not met by the path")


def _least(panel: Panel, data: Any, t: Array, y: Array) -> None:
    """A broad band behind the curve where the solution has the least energy on the path."""
    if "lowest_begin" not in data:
        return
    piece, proved = data["lowest_piece"].values, data["lowest_certified"].values.astype(bool)
    ends = np.stack([data["lowest_begin"].values, data["lowest_end"].values], axis=1)
    step = t[piece + 1] - t[piece]
    slope = np.divide(y[piece + 1] - y[piece], step, out=np.zeros(len(step)), where=step != 0.0)
    values = y[piece, None] + slope[:, None] * (ends - t[piece, None])
    for which, (colour, name) in zip((proved, ~proved), LEAST, strict=True):
        if which.any():
            broken = [np.insert(x[which], 2, np.nan, axis=1).ravel() for x in (ends, values)]
            panel.line(*broken, color=colour, linewidth=6.0, solid_capstyle="butt", zorder=1, label=name)


def _asked(panel: Panel, data: Any, y: Array) -> None:
    """Solutions at the requested values: filled if stable."""
    if not len(y):
        return
    t, stable = data["solution_parameter"].values, data["solution_stable"].values.astype(bool)
    for value in data["at"].values:
        panel.up(float(value), color=style.PALE, linewidth=0.6, linestyle=":")
    panel.line(t[stable], y[stable], **ASKED, label="requested (open: unstable)")
    panel.line(t[~stable], y[~stable], **ASKED, markerfacecolor="white")


def _loop(panel: Panel, data: Any, y: Array, span: float) -> None:
    """Arrows: along the stable branches, and where the body falls."""
    t, branch = data["loop_parameter"].values, data["loop_branch"].values
    for b in np.unique(branch):
        at = np.flatnonzero(branch == b)
        if np.ptp(t[at]) < 0.1 * span:
            continue
        rising = t[at[-1]] > t[at[0]]
        middle = t[at[0]] + (0.6 if rising else 0.4) * (t[at[-1]] - t[at[0]])
        order, step = at[np.argsort(t[at], kind="stable")], 0.012 * span * (1.0 if rising else -1.0)
        start, end = ((x, float(np.interp(x, t[order], y[order]))) for x in (middle - step, middle + step))
        panel.arrow(start, end, 15.0, color=style.GREEN, linewidth=0.0)
    for k in data["jump_vertex"].values if "jump_vertex" in data else []:
        panel.arrow((t[k], y[k]), (t[k + 1], y[k + 1]), 12.0, color=style.GREEN, linewidth=1.1)
    panel.line([], [], color=style.GREEN, marker=">", markersize=6, label="slow loading and unloading")


def _over(data: Any, across: Scale, limits: Any) -> Panel:
    """State of the line at the solution of least energy over the parameter."""
    nodes, arclength, ends = contact_nodes(data)
    panel = Panel(across, arclength, "State of the contact line: least energy on the path")
    panel.limits = [limits, (0.0, float(arclength(ends[-1])))]
    if data.sizes.get("interval", 0):
        edges = np.stack([data["lowest_begin"].values, data["lowest_end"].values], axis=1).ravel()
        least = np.full((len(edges) - 1, len(nodes)), -1)
        least[::2] = data["state"].values[data["lowest_piece"].values][:, nodes]
        panel.cells(edges, ends, least, COLOURS, STATES)
    return panel


def _along(data: Any, across: Scale, pieces: NDArray[np.intp], t: Array, y: Array) -> Panel:
    """State of the line along the path within the range, its ends and folds named."""
    nodes, arclength, ends = contact_nodes(data)
    title = "State along the path; ticks: the parameter at its ends and folds"
    step = [np.diff(values, axis=1)[:, 0] / (float(np.ptp(values)) or 1.0) for values in (t, y)]
    length = np.concatenate([[0.0], np.cumsum(np.hypot(*step))])
    named = [0, len(pieces)]
    for k in np.flatnonzero(np.isin(pieces, seen_folds(data)[0])):
        if np.abs(length[named] - length[k]).min() > APART * length[-1]:
            named.append(int(k))
    values = across(np.append(t[:, 0], t[-1, 1])[named])
    texts = [text.replace("-", "−") for text in labels(values.tolist(), 3)]
    panel = Panel(Scale(across.label), arclength, title, ticks=(length[named], texts))
    panel.limits = [(0.0, float(length[-1])), (0.0, float(arclength(ends[-1])))]
    panel.cells(length, ends, data["state"].values[pieces][:, nodes], COLOURS, STATES)
    for place in length[named[2:]]:
        panel.up(float(place), color=style.VERMILLION, linewidth=0.8, linestyle=(0, (4, 2)), zorder=2)
    return panel


def _apart(ticks: Any, room: float) -> tuple[list[float], list[str]]:
    """Ticks that are so large a part of the axis apart; the first two are its ends."""
    kept: list[tuple[float, str]] = []
    for place, text in zip(*ticks, strict=True):
        if all(abs(place - other) > room * ticks[0][1] for other, _ in kept):
            kept.append((float(place), text))
    return [place for place, _ in kept], [text for _, text in kept]
