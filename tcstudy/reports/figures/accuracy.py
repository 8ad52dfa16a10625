"""Pictures of accuracy: errors over mesh size, with expected orders, and over time and unknowns."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import zip_longest
from typing import TYPE_CHECKING, Any

import numpy as np

from tcstudy.data.schema import PointStatus
from tcstudy.data.tables import BY_ITSELF, OWN, VERDICTS
from tcstudy.errors import DrawError
from tcstudy.reports import sentences
from tcstudy.reports.figures import style
from tcstudy.reports.figures.panels import Panel, Scale, Sheet, scale
from tcstudy.reports.select_point import Value, axis_symbols, describe, locate
from tcstudy.reports.terminal.accuracy import (
    EXACT,
    GROUPS,
    SYMBOLS,
    UNREFERENCED,
    Setting,
    advice,
    bound_words,
    front,
    settings,
    shown,
    unreferenced,
)
from tcstudy.scene.mesh_plan import FAMILIES

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

# -- errors over the mesh size ---------------------------------------------------------------------

LOOKS = (
    {"color": style.BLUE, "marker": "o", "markersize": 8, "linewidth": 3.0},
    {"color": style.VERMILLION, "marker": "s", "markersize": 5, "linewidth": 1.6},
    {"color": style.INK, "marker": "^", "markersize": 4, "linewidth": 1.1},
)
"""Looks of the first, second and third error of a panel: none hides another below it."""
DASHES = (":", "-.")
"""Line styles of estimates and proved bounds."""
PANEL, LEGEND_LINE = 2.55, 0.18
"""Height of a panel and of a line of its legend [inch]."""
BESIDE = 0.2
"""Room for the order left of the finest mesh, as a part of the range of h."""
BELOW = 1.7
"""Factor between the finest error and the line of the order to expect."""


def convergence_figure(
    data: Any, point: Mapping[str, Value] | None, look: style.Look
) -> tuple[Figure, str]:
    """Return the errors of one sweep point, the first unless named, and its name.

    Raises DrawError if all errors are at rounding level, or there is no reference.
    """
    where = locate(data, point)
    selected, words = data.isel(where), describe(data, where)
    panels = convergence_panels(selected)
    if not panels:
        raise DrawError(
            "the file has no errors to draw: no reference was there, or all errors are rounding"
        )
    facts = [style.point_words(words, axis_symbols(data))] if words else []
    facts += _legend(data, selected)
    names = list(panels)
    rows = list(zip_longest(names[0::2], names[1::2], fillvalue="."))
    heights = [PANEL] * len(rows)
    sheet = Sheet(look, data.attrs["title"], [";  ".join(facts)], rows, heights)
    sheet.draw(panels)
    for axes in sheet.panels.values():
        _add_legend(axes)
    return sheet.finish(), words or data.attrs["title"]


def _legend(data: Any, selected: Any) -> list[str]:
    """Return the explanations of the looks that the errors of a point have."""
    states = {_state(selected, measure.name) for measure in shown(selected)}
    is_failed = bool((selected["status"].values != int(PointStatus.OK)).any())
    legend = [
        f"reference: {str(data.attrs['reference']).split(' (')[0]}",
        "relative errors",
        "dotted: orders to expect",
    ]
    if "pre_asymptotic" in states:
        legend.append("dashed: pre-asymptotic")
    if "guess" in states:
        legend.append(f"pale: two levels, not judged ({sentences.GUESS})")
    if is_failed:
        legend.append("hollow: did not converge")
    return legend


def _add_legend(axes: Axes) -> None:
    """Add a legend below all curves, and the room for it."""
    axes.minorticks_off()
    style.few_ticks(axes.yaxis)
    low, high = np.log10(axes.get_ylim())
    room = (LEGEND_LINE * len(axes.get_legend_handles_labels()[1]) + 0.05) / PANEL
    axes.set_ylim(10 ** (high - (high - low) / (1 - room)), 10**high)
    letters = style.pt(8.5)
    look = {"frameon": False, "handlelength": 1.6, "borderaxespad": 0.1}
    axes.legend(loc="lower right", fontsize=letters, **look)


def _state(selected: Any, name: str) -> str:
    """Return the verdict on an error, "guess" if two levels give its rate, "" if it is rounding."""
    verdict = VERDICTS[int(selected[f"verdict_{name}"])]
    if verdict == "exact" or not bool((selected[f"error_{name}"] > 0).any()):
        return ""
    has_slope = np.isfinite(selected[f"slope_{name}"])
    is_guess = has_slope and not np.isfinite(selected[f"slope_error_{name}"])
    return "guess" if is_guess else verdict


def convergence_panels(selected: Any) -> dict[str, Panel]:
    """Return panels of the errors of one sweep point over h, by the symbol of their quantity.

    Solutions that did not converge are hollow and not joined.
    """
    h = selected["h_max"].values
    h_axis = scale("largest element edge h", h, str(selected["h_max"].attrs["units"]))
    panels = dict[str, Panel]()
    for symbol, title in GROUPS.items():
        measures = [m.name for m in shown(selected) if m.symbol.split(" ")[0] == symbol]
        states = {name: _state(selected, name) for name in measures}
        states = {name: state for name, state in states.items() if state}
        if states:
            panel = Panel(h_axis, Scale("relative error"), log=(True, True), grid=True)
            panel.title = f"{symbol}: {title}"
            _draw_errors(panel, selected, states)
            _draw_estimates(panel, selected, states)
            _draw_expected_orders(panel, selected, states)
            _limit_sizes(panel, selected, states)
            panels[symbol] = panel
    return panels


def _draw_errors(panel: Panel, selected: Any, states: Mapping[str, str]) -> None:
    h, converged = selected["h_max"].values, selected["status"].values == int(PointStatus.OK)
    for (name, state), look in zip(states.items(), LOOKS, strict=False):
        error = selected[f"error_{name}"].values
        good, bad = converged & (error > 0), ~converged & (error > 0)
        slope = float(selected[f"slope_{name}"])
        order = sentences.order(slope, float(selected[f"slope_error_{name}"]))
        curve_look = look | {"linestyle": "-", "alpha": 1.0}
        if state in ("guess", "pre_asymptotic"):
            curve_look["linestyle"] = "--"
        if state == "guess":
            curve_look["alpha"] = 0.45
        curve_look["label"] = SYMBOLS[name] + ("" if order == "–" else f": {order}")
        face = "white" if look is LOOKS[0] else None
        panel.line(h[good], error[good], **curve_look, markerfacecolor=face)
        panel.line(h[bad], error[bad], **look | {"linestyle": "none", "fillstyle": "none"})


def _draw_estimates(panel: Panel, selected: Any, states: Mapping[str, str]) -> None:
    """Draw estimates and bounds, which stand by themselves in the file."""
    h = selected["h_max"].values
    names = [name for name in BY_ITSELF if name.split("_", 1)[1] in states and name in selected]
    for name, dash in zip(names, DASHES, strict=False):
        look = {"color": style.INK, "linestyle": dash, "linewidth": 1.2}
        panel.line(h, selected[name].values, **look, label=UNREFERENCED[name.split("_")[0]])


def _draw_expected_orders(panel: Panel, selected: Any, states: Mapping[str, str]) -> None:
    """Draw each expected order once, below the smallest of its errors on the finest mesh."""
    h, converged = selected["h_max"].values, selected["status"].values == int(PointStatus.OK)
    finest = dict[float, tuple[float, float]]()
    for name, _ in zip(states, LOOKS, strict=False):
        error = selected[f"error_{name}"].values
        good = converged & (error > 0)
        order = round(float(selected[f"expected_{name}"]), 2)
        if order > 0 and np.count_nonzero(good) > 1:
            error_and_size = float(error[good][-1]), float(h[good][-1])
            finest[order] = min(finest.get(order, (np.inf, 0.0)), error_and_size)
    for order, (error, size) in finest.items():
        ends = np.array([size, h[converged].max()])
        values = error / BELOW * (ends / size) ** order
        panel.line(ends, values, color=style.PALE, linewidth=0.9, linestyle=":")
        look = {"ha": "right", "fontsize": 8.5, "color": style.PALE}
        panel.note(f"{order:g}", (size, error / BELOW), (-4, -3), **look)


def _limit_sizes(panel: Panel, selected: Any, states: Mapping[str, str]) -> None:
    """Set ticks at the mesh sizes with errors, and leave room for the expected orders."""
    has_error = np.array([selected[f"error_{name}"].values > 0 for name in states]).any(axis=0)
    sizes = panel.x(selected["h_max"].values[has_error])
    panel.ticks = sizes.tolist(), [f"{value:.2g}" for value in sizes]
    finest, coarsest = sizes.min(), sizes.max()
    start = finest * (finest / coarsest) ** BESIDE
    end = coarsest * (coarsest / finest) ** 0.06 if coarsest > finest else None
    panel.limits[0] = start, end


# -- errors over time and unknowns -----------------------------------------------------------------

GOLD = "#f0c000"
_FAMILY_COLOURS = (style.INK, style.VERMILLION, style.BLUE, style.GREEN)
COLOURS = dict(zip((*FAMILIES, OWN), _FAMILY_COLOURS, strict=True))
MARKS = dict(zip((*FAMILIES, OWN), "sDo^", strict=True))
LINES: tuple[Any, ...] = ("-", (0, (1.2, 1.6)), (0, (4, 2)), (0, (4, 2, 1, 2)))
"""Line styles of the first, second … solver."""
CHART = 3.6
"""Height of the panels with the key above them [inch]."""
PALE = 0.32
"""Opacity of curves with no setting on the Pareto front."""


def cost_figure(data: Any, measure: str, look: style.Look) -> Figure:
    """Return errors over wall time, with bands to the upper quartile, and over unknowns."""
    measured = settings(data, measure)
    facts = [
        style.point_words(data.attrs["point"], axis_symbols(data)),
        f"reference: {data.attrs['reference']}",
    ]
    if unreferenced(data, measure):
        facts += bound_words(data)
    title, feet = data.attrs["title"], advice(measured)
    sheet = Sheet(look, title, facts, [("time", "unknowns")], [CHART], feet)
    sheet.draw(cost_panels(data, measure))
    for axes in sheet.panels.values():
        style.few_ticks(axes.xaxis)
        style.few_ticks(axes.yaxis)
    unknowns = sheet.panels["unknowns"]
    unknowns.margins(x=0.15)
    if len(sheet.heights) == 1:
        unknowns.set_ylabel("")
        unknowns.tick_params(which="both", labelleft=False)
    sheet.key("unknowns", "time", place="upper left")
    return sheet.finish()


def cost_panels(data: Any, measure: str) -> dict[str, Panel]:
    """Return the panels of an error over time and over unknowns."""
    measured = settings(data, measure)
    error = Scale(f"relative error of {SYMBOLS[measure]}")
    time_axis = Scale("wall time [s]: shortest of all runs, band to the upper quartile")
    time = Panel(time_axis, error, log=(True, True), grid=True)
    unknowns = Panel(Scale("displacement DOFs N"), error, log=(True, True), grid=True)
    families, solvers = data["family"].values.tolist(), data["solver"].values.tolist()
    on_front = {(setting.family, setting.solver) for setting in front(measured)}
    drawn = [setting for setting in measured if setting.error > 0 and setting.time > 0]
    for family in families:
        unknowns.line([], [], **_marks(family), label=family)
        for number, solver in enumerate(solvers):
            curve = [
                setting for setting in drawn if (setting.family, setting.solver) == (family, solver)
            ]
            alpha = 1.0 if (family, solver) in on_front else PALE
            _draw_times(time, family, curve, LINES[number % len(LINES)], alpha)
            if number == 0:
                _draw_unknowns(unknowns, family, curve)
                _draw_unreferenced(unknowns, curve)
    for number, solver in enumerate(solvers):
        look = {"color": style.INK, "linestyle": LINES[number % len(LINES)], "linewidth": 1.2}
        time.line([], [], **look, label=solver)
    _draw_own_setting(time, unknowns, measured)
    if not all(setting.solved and not setting.dominated for setting in measured):
        look = {"color": style.INK, "marker": "o", "markersize": 4.5}
        look |= {"linestyle": "none", "markerfacecolor": "white"}
        time.line([], [], **look, label="open: dominated, or not converged")
    errors = [setting.error for setting in measured if setting.error > 0]
    for setting in measured:
        errors += [error for error in setting.without_reference if error > 0]
    for name, dash in zip(unreferenced(data, measure), DASHES, strict=False):
        label = UNREFERENCED[name.name.removeprefix("u_")]
        unknowns.line([], [], color=style.INK, linestyle=dash, linewidth=0.9, label=label)
    if errors:
        limits = min(errors) / 1.6, max(errors) * 1.6
        time.limits[1] = limits
        unknowns.limits[1] = limits
    return {"time": time, "unknowns": unknowns}


def _marks(family: str) -> dict[str, Any]:
    return {"color": COLOURS[family], "marker": MARKS[family], "markersize": 4.5}


def _draw_times(
    panel: Panel, family: str, curve: Sequence[Setting], dash: Any, alpha: float
) -> None:
    """Draw errors over time; open marks are dominated or not solved."""
    colour = COLOURS[family]
    solved = [setting for setting in curve if setting.solved]
    t = np.array([setting.time for setting in solved])
    upper = np.array([setting.upper for setting in solved])
    error = np.array([setting.error for setting in solved])
    ring_t = np.concatenate([t, upper[::-1]])
    ring_error = np.concatenate([error, error[::-1]])
    panel.fill(ring_t, ring_error, color=colour, alpha=0.16 * alpha)
    panel.line(t, error, color=colour, linestyle=dash, linewidth=1.2, alpha=alpha)
    for setting in curve:
        look = _marks(family) | {"linestyle": "none", "alpha": alpha}
        is_open = not setting.solved or setting.dominated
        face = "white" if is_open else None
        panel.line(setting.time, setting.error, **look, markerfacecolor=face)


def _draw_unknowns(panel: Panel, family: str, curve: Sequence[Setting]) -> None:
    """Draw the errors of a family over the unknowns, with the rate of the last three meshes."""
    solved = [setting for setting in curve if setting.solved]
    n = np.array([setting.n_dof for setting in solved])
    error = np.array([setting.error for setting in solved])
    panel.line(n, error, **_marks(family), linewidth=1.2)
    if len(n) > 2 and error.max() > EXACT:
        rate, _ = np.polyfit(np.log(n[-3:]), np.log(error[-3:]), 1)
        look = {"color": COLOURS[family], "fontsize": 9}
        panel.note(f"N^{rate:.2f}", (n[-1], error[-1]), (7, 3), **look)


def _draw_unreferenced(panel: Panel, curve: Sequence[Setting]) -> None:
    """Draw the estimates and proved bounds of a family over the unknowns."""
    n_dof = [setting.n_dof for setting in curve]
    columns = zip(*(setting.without_reference for setting in curve), strict=True)
    for errors, dash in zip(columns, DASHES, strict=False):
        look = {"color": COLOURS[curve[0].family], "linestyle": dash, "linewidth": 0.9}
        panel.line(n_dof, errors, **look)


def _draw_own_setting(time: Panel, unknowns: Panel, measured: Sequence[Setting]) -> None:
    """Draw a star at the setting of the study, white inside where another is better in both."""
    of_study = [setting for setting in measured if setting.own and np.isfinite(setting.error)]
    if not of_study:
        return
    setting = of_study[0]
    star = {"marker": "*", "markersize": 13, "markeredgecolor": style.INK, "linestyle": "none"}
    star["color"] = "white" if setting.dominated else GOLD
    dominated = " (dominated)" if setting.dominated else ""
    time.line(setting.time, setting.error, **star, label=f"the study's own{dominated}")
    unknowns.line(setting.n_dof, setting.error, **star)
