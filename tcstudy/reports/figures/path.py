"""Pictures along a parameter: of a path, a load history and a fit.

A path: the response curve with folds and hysteresis loop, the state of the contact line below. A
history: the loop of a number over a load, what nodes do step by step, what cycles change. A fit:
data with their noise, the fitted curve with its folds and band, residuals, the fitted law.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from tcstudy.data.schema import PointStatus
from tcstudy.errors import DrawError
from tcstudy.reports.figures import style
from tcstudy.reports.figures.panels import (
    Array,
    Panel,
    Scale,
    Sheet,
    contact_nodes,
    place_names,
    scale,
)
from tcstudy.reports.rounding import cleared, line_floor
from tcstudy.reports.select_point import Value, axis_symbols, describe, locate, of_largest_slip
from tcstudy.reports.terminal.fit import BAND, columns, prediction_error
from tcstudy.reports.terminal.paths import (
    MOVES,
    STATES,
    folds_of,
    last_change,
    motion,
    path_verdict,
)
from tcstudy.reports.text import counted, number, prefix, pretty

if TYPE_CHECKING:
    from matplotlib.figure import Figure

RED_DOT: dict[str, Any] = {
    "color": style.VERMILLION,
    "marker": "o",
    "markerfacecolor": "white",
    "linestyle": "none",
}
DASHED: dict[str, Any] = {"linestyle": (0, (4, 2)), "zorder": 2}

# -- paths
# -------------------------------------------------------------------------------------------------------------

RESPONSES: dict[str, tuple[str, str, Callable[[Array, Array, Array], Array]]] = {
    "mean-slip": ("mean u_T", "u_T", lambda u, xi, c: np.asarray(u @ c / c.sum())),
    "max-slip": ("max |u_T|", "u_T", lambda u, xi, c: np.max(np.abs(u), axis=1, initial=0.0)),
    "friction": ("∫ξ ds", "xi", lambda u, xi, c: np.asarray(xi @ c)),
}
"""What may stand over the parameter: label, the variable that it is made of, formula."""


def response_of(data: Any, response: str, kind: str = "") -> Array:
    """One of RESPONSES of vertices, or of what the prefix of a kind of states says."""
    u_T, xi, c = (data[name].values for name in (f"{kind}u_T", f"{kind}xi", "c"))
    values = RESPONSES[response][2](u_T, xi, c)
    return cleared(values, line_floor(data["xi"], c)) if response == "friction" else values


CURVE, MAP = 3.4, 1.25
"""Heights of the response curve and of the map of states [inch]."""
STABLE: dict[str, Any] = {"color": style.INK, "linewidth": 1.3, "zorder": 4}
UNSTABLE: dict[str, Any] = {
    "color": style.VERMILLION,
    "linewidth": 0.9,
    "linestyle": (0, (4, 2)),
    "zorder": 3,
}
ASKED: dict[str, Any] = {
    "color": style.BLUE,
    "marker": "D",
    "markersize": 5,
    "linestyle": "none",
    "zorder": 7,
}
LEAST = (("#5aa9dc", "global minimum (proved)"), ("#c3dff2", "least energy on the path"))
COLOURS = ("#dedede", "#7fb8de", "#f2c14e", "#d55e00", "#b7a3d6")
"""Of `ContactState`."""


def path_figure(data: Any, response: str, look: style.Look) -> Figure:
    """The figure of a path's file; response: one of RESPONSES, which stands over the parameter."""
    if response not in RESPONSES:
        raise DrawError(f"there is no response {response!r}; use one of {', '.join(RESPONSES)}")
    panels = path_panels(data, response)
    sheet = Sheet(
        look,
        data.attrs["title"],
        [path_verdict(data).sentence],
        [["curve"], ["over"]],
        (CURVE, MAP),
    )
    sheet.draw(panels)
    sheet.share("curve", "over")
    sheet.key("curve", place="upper left")
    sheet.key("over", place="lower left")
    return sheet.finish()


def path_panels(data: Any, response: str) -> dict[str, Panel]:
    """The response curve, and under it the state of the contact line, that of the solution of least
    energy."""
    name, (title, source, _) = str(data.attrs["parameter"]), RESPONSES[response]
    units = str(data[source].attrs["units"])
    span, kinds = (
        np.sort(np.asarray(data.attrs["parameter_range"], dtype=float)),
        ("", "loop_", "solution_", "branch_"),
    )
    values = {kind: response_of(data, response, kind) for kind in kinds if f"{kind}u_T" in data}
    t, y, folds = data["parameter"].values, values[""], folds_of(data)
    drawn = within(t, y, span)
    seen = np.concatenate([drawn if len(drawn) else y, values.get("branch_", np.zeros(0))])
    across = scale(
        "load factor" if name == "load" else style.symbol(name),
        span,
        str(data["parameter"].attrs["units"]),
    )
    curve = Panel(across, scale(title, seen, "N m-1" if source == "xi" and units != "1" else units))
    curve.across(0.0)
    _pieces(curve, t, y, data["stable"].values.astype(bool))
    if "branch_" in values:  # those that the path does not meet
        of, at, stable, on_path = (
            data[f"branch_{one}"].values for one in ("of", "parameter", "stable", "on_path")
        )
        apart: dict[str, Any] = {"color": style.BLUE, "linewidth": 1.3}
        for own in (np.flatnonzero(of == k) for k in np.flatnonzero(on_path == 0)):
            _pieces(curve, at[own], values["branch_"][own], stable[own[:-1]].astype(bool), **apart)
        if not on_path.all():
            curve.line([], [], **apart, label="not met by the path")
    ends = None
    if (
        "lowest_begin" in data
    ):  # a broad band behind the curve where the solution has the least energy on the path
        ends = np.stack([data["lowest_begin"].values, data["lowest_end"].values], axis=1)
        piece, proved = data["lowest_piece"].values, data["lowest_certified"].values.astype(bool)
        step = t[piece + 1] - t[piece]
        slope = np.divide(y[piece + 1] - y[piece], step, out=np.zeros(len(step)), where=step != 0.0)
        lowest = y[piece, None] + slope[:, None] * (ends - t[piece, None])
        for which, (colour, told) in zip((proved, ~proved), LEAST, strict=True):
            if which.any():
                broken = [np.insert(x[which], 2, np.nan, axis=1).ravel() for x in (ends, lowest)]
                curve.line(
                    *broken,
                    color=colour,
                    linewidth=6.0,
                    solid_capstyle="butt",
                    zorder=1,
                    label=told,
                )
    dots = RED_DOT | {"markersize": 3.2, "markeredgewidth": 0.9, "zorder": 5}
    curve.line(t[folds], y[folds], **dots, label="fold" if len(folds) else "")
    if len(values.get("solution_", ())):
        at, stable = data["solution_parameter"].values, data["solution_stable"].values.astype(bool)
        for value in data["at"].values:
            curve.up(float(value), color=style.PALE, linewidth=0.6, linestyle=":")
        curve.line(
            at[stable], values["solution_"][stable], **ASKED, label="requested (open: unstable)"
        )
        curve.line(at[~stable], values["solution_"][~stable], **ASKED, markerfacecolor="white")
    if "loop_" in values:
        at, y = data["loop_parameter"].values, values["loop_"]
        curve.line(
            at,
            y,
            color=style.GREEN,
            linewidth=3.2,
            alpha=0.6,
            zorder=2,
            label="slow loading and unloading",
        )
        for k in (
            data["jump_vertex"].values if "jump_vertex" in data else []
        ):  # arrows where the body falls
            curve.arrow(
                (at[k], y[k]), (at[k + 1], y[k + 1]), 12.0, color=style.GREEN, linewidth=1.1
            )
    curve.window(span, seen, (0.0, 0.05))
    nodes, arclength, cuts = contact_nodes(data)
    over = Panel(across, arclength, "State of the contact line: least energy on the path")
    over.limits = [curve.limits[0], (0.0, float(arclength(cuts[-1])))]
    if ends is not None and len(ends):
        least = np.full((2 * len(ends) - 1, len(nodes)), -1)
        least[::2] = data["state"].values[data["lowest_piece"].values][:, nodes]
        over.cells(ends.ravel(), cuts, least, COLOURS, STATES)
    return {"curve": curve, "over": over}


def within(t: Array, y: Array, span: Array) -> Array:
    """Values of a line y(t) at its vertices inside a span, and where it crosses the ends of
    that."""
    step = np.where(np.diff(t) == 0.0, 1.0, np.diff(t))
    share = (span[:, None] - t[:-1]) / step
    crossed = (y[:-1] + share * np.diff(y))[(share > 0.0) & (share < 1.0)]
    return np.concatenate([y[(t >= span[0]) & (t <= span[1])], crossed])


def _pieces(panel: Panel, t: Array, y: Array, stable: NDArray[np.bool_], **how: Any) -> None:
    """Stable and unstable pieces as two lines that are broken where pieces of the other kind
    lie."""
    for which, look, name in ((stable, STABLE, "stable"), (~stable, UNSTABLE, "unstable")):
        cuts = np.flatnonzero(~which) + 1
        named = {"label": name} if which.any() and not how else {}
        panel.line(np.insert(t, cuts, np.nan), np.insert(y, cuts, np.nan), **look | how | named)


# -- histories
# ---------------------------------------------------------------------------------------------------------

HEIGHTS = {"loop": 3.1, "motion": 1.35, "front": 1.35, "section": 1.3, "spent": 1.0}
"""Of panels, or of the first in their row [inch]."""
MOTION = (style.SHADE, style.SERIES[5], style.SERIES[4], style.VERMILLION)
"""Colours of MOVES."""
ROOM = 0.16, 0.1
"""Room beside and above the loop for names, of its width and height."""
LONG = 0.1
"""Part of the loop that a step is to be long for an arrow."""
DOT: dict[str, Any] = {"marker": "o", "linestyle": "none"}


def draw_history(
    data: Any, point: Mapping[str, Value] | None, x: str | None, y: str | None, look: style.Look
) -> tuple[Figure, str]:
    """The picture of one history of a file, and what it shows; x, y: as of `loop_names`.

    Raises DrawError if the file has no such point or number, or no solved step.
    """
    where = locate(data.isel(step=0), point) if point else of_largest_slip(data)
    words, data = describe(data.isel(step=0), where), solved_steps(data.isel(where))
    if not data.sizes["step"]:
        raise DrawError(f"no step of the history was solved: {data['reason'].values.item()}")
    names, steps = loop_names(data, x, y), counted(data.sizes["step"] - 1, "step")
    panels = history_panels(data, *names)
    facts = [style.point_words(words, axis_symbols(data))]
    facts.append(
        ";  ".join(filter(None, [f"memory: {data.attrs['memory']}", steps, last_change(data)[1]]))
    )
    rows = [
        (("spent", "change") if name == "spent" else (name, name), HEIGHTS[name])
        for name in panels
        if name in HEIGHTS
    ]
    sheet = Sheet(look, data.attrs["title"], facts, *zip(*rows, strict=True))
    sheet.draw(panels)
    sheet.key("motion", *(["section"] if "section" in panels else []))
    figure = sheet.finish()
    place_names(sheet.panels["loop"], panels["loop"])
    return figure, ", ".join(filter(None, [f"{names[1]} over {names[0]}", steps, words]))


def solved_steps(data: Any) -> Any:
    """One history up to its last solved step, with "slip", u_T where it is largest."""
    data = data.isel(step=slice(int(np.sum(data["status"].values == PointStatus.OK))))
    if not data.sizes["step"]:
        return data
    resultant = cleared(data["friction_resultant"], line_floor(data["xi"], data["c"]))
    data["friction_resultant"] = data["friction_resultant"].copy(data=resultant)
    data = data.assign(
        slip=data["u_T"].isel(node=int(np.abs(data["u_T"].values).max(axis=0).argmax()))
    )
    data["slip"].attrs |= {
        "units": data["u_T"].attrs["units"],
        "long_name": "u_T where it is largest",
    }
    return data


def loop_names(data: Any, x: str | None = None, y: str | None = None) -> tuple[str, str]:
    """What the loop is of: y over x, numbers that the file has by step, or "slip". Over the first
    load that changes, unless given: the slip, or the friction resultant if a displacement is
    prescribed. Raises DrawError.
    """
    loads = str(data.attrs["loads"]).split()
    pulled = any(name in ("u_x", "u_y", "u_N", "u_T") for name in loads)
    names = x or loads[0], y or ("friction_resultant" if pulled else "slip")
    held = [
        str(v) for v in data.variables if data[v].dims == ("step",) and data[v].dtype.kind == "f"
    ]
    for name in names:
        if name not in held:
            is_there = name in data.variables
            lack = f"{name!r} is not one number a step" if is_there else f"there is no {name!r}"
            raise DrawError(f"history: {lack}; choose of {', '.join(held)}")
    return names


def history_panels(data: Any, x: str, y: str) -> dict[str, Panel]:
    """Its panels by name: the loop of y over x, what nodes do, where the bond is debonded over the
    load, the force of the section, and of several whole cycles what each changes."""
    cycle, names, loads = (
        data["cycle"].values,
        data["step_name"].values,
        str(data.attrs["loads"]).split(),
    )
    nodes, arclength, cuts = contact_nodes(data)

    def axis(name: str) -> Scale:
        title = data[name].attrs.get("long_name", name)
        title = style.symbol(title) if name in loads else title
        return scale(title, data[name].values, str(data[name].attrs.get("units", "1")))

    found = {"loop": _loop(np.stack([data[x].values, data[y].values]), axis(x), axis(y), data)}

    steps = len(cycle)
    what = motion(data["u_T"].values, data["jumped"].values if "jumped" in data else None)[
        1:, nodes
    ]
    moves = found["motion"] = Panel(
        Scale("step (dashed: cycles)" if cycle[-1] > 1 else "step"), arclength
    )
    moves.cells(np.arange(steps) + 0.5, cuts, what, MOTION, MOVES)
    for i in np.flatnonzero(np.diff(cycle[1:])):
        moves.up(i + 1.5, color=style.INK, linewidth=0.7, **DASHED)
    shown = range(every := max(1, -(-steps // 8)), steps, every)
    moves.ticks = list(shown), [str(i) for i in shown]
    moves.limits = [(0.5, max(steps - 0.5, 1.5)), (0.0, float(arclength(cuts[-1])))]

    if "debonded_to" in data and np.any(
        data["debonded_to"] > data["debonded_from"]
    ):  # dots at steps
        up = replace(arclength, label=arclength.label.replace("arclength", "debonded from, to"))
        front = found["front"] = Panel(axis(x), up)
        for name, sign in (("debonded_from", "v"), ("debonded_to", "^")):
            how: dict[str, Any] = {
                "color": style.VERMILLION,
                "linewidth": 1.2,
                "marker": sign,
                "markersize": 4,
            }
            front.line(data[x].values, data[name].values, **how)

    if "section_force" in data:  # after the last steps with names, or after the last
        N = data["section_force"]
        up = scale("N", N.values, str(N.attrs["units"]))
        section = found["section"] = Panel(
            arclength, up, "Force of the section, positive in tension"
        )
        section.across(0.0)
        last = [*np.flatnonzero(names != "")[-len(style.SERIES) :]] or [steps - 1]
        for i, colour in zip(last, style.SERIES, strict=False):
            told = f"N: {names[i] or 'step'} ({i})"
            section.line(
                data["arclength"].values[nodes], N.values[i, nodes], color=colour, label=told
            )

    whole, count = np.unique(cycle[cycle > 0], return_counts=True)
    whole = whole[count == count.max(initial=0)]
    if len(whole) < 2:
        return found
    spent = np.array([data["dissipated"].values[cycle == one].sum() for one in whole])
    ends = [0, *(int(np.flatnonzero(cycle == one)[-1]) for one in whole)]
    left, numbers = (
        np.abs(np.diff(data["u_T"].values[ends], axis=0)).max(axis=1),
        np.arange(1, len(whole) + 1),
    )
    few = numbers if len(numbers) <= 12 else numbers[:: len(numbers) // 6]
    kinds = (("spent", "dissipated", spent, "dissipated"), ("change", "change of u_T", left, "u_T"))
    for name, title, values, of in kinds:
        up = scale(title, values, str(data[of].attrs["units"]))
        found[name] = Panel(Scale("cycle"), up, ticks=(few, [str(one) for one in few]))
        found[name].line(
            numbers, values, color=style.VERMILLION, marker="o", markersize=4, linewidth=1.0
        )
        found[name].across(0.0)
    return found


def _loop(values: Array, x: Scale, y: Scale, data: Any) -> Panel:
    """(2, n) x and y through all steps, the last cycle heavy, with its sense: an arrow on the
    longest step of every stretch in which x goes one way; dots, last of all, at steps with names;
    rings at jumps."""
    panel, cycle, names = Panel(x, y), data["cycle"].values, data["step_name"].values
    panel.across(0.0)
    last = values[:, max(int(np.flatnonzero(cycle >= cycle[-1])[0]) - 1, 0) :]
    panel.line(*values, color=style.BLUE, linewidth=1.1, alpha=0.55)
    panel.line(*last, color=style.BLUE, linewidth=2.0)
    step, wide = np.diff(last, axis=1), np.ptp(last, axis=1, keepdims=True)
    size = np.hypot(*(step / np.where(wide > 0.0, wide, 1.0)))
    for part in np.split(np.arange(len(size)), np.flatnonzero(np.diff(np.sign(step[0]))) + 1):
        if len(part) and size[k := part[np.argmax(size[part])]] > LONG:
            start, end = ((last[:, k] + share * step[:, k]).tolist() for share in (0.45, 0.58))
            panel.arrow(start, end, 18.0, color=style.BLUE, linewidth=0.0)
    rings: dict[str, Any] = {
        "color": style.VERMILLION,
        "markerfacecolor": "none",
        "markersize": 8,
        "zorder": 4,
    }
    jumped = values[:, data["jumps"].values > 0]
    panel.line(jumped[0], jumped[1], **DOT, **rings)
    named = values[:, names != ""]
    panel.line(named[0], named[1], **DOT, color=style.INK, markersize=4, zorder=5)
    panel.window(values[0], np.append(values[1], 0.0), ROOM)
    panel.names(named[0], named[1], [str(name) for name in names if name])
    return panel


# -- fits
# --------------------------------------------------------------------------------------------------------------

DATA: dict[str, Any] = {"color": style.INK, "marker": "o", "markersize": 3, "linestyle": "none"}
FITTED: dict[str, Any] = {"color": style.BLUE, "linewidth": 1.2, "zorder": 3}
NAMES = {
    "friction_resultant": "friction resultant ∫ξ",
    "u_T_max": "max |u_T|",
    "theta_mean": "mean θ",
}


def fit_figure(data: Any, look: style.Look) -> Figure:
    """The figure of a fit, with the numbers found and their standard errors."""
    panels, found = fit_panels(data), []
    for i, name in enumerate(data["parameter"].values):
        divisor, unit = prefix([float(data["estimate"][i])], str(data["parameter_units"].values[i]))
        value, error = (float(data[key][i]) / divisor for key in ("estimate", "standard_error"))
        estimate = f"{style.symbol(str(name))} = {number(value)} {pretty(unit)}".rstrip()
        if np.isfinite(error):
            estimate += f", s.e. {number(error, 2)}"
        found.append(estimate.replace(" ", "\xa0"))  # no line ends within it
    rows = (("curve", "curve"), ("residuals", "law" if "law" in panels else "residuals"))
    sheet = Sheet(look, data.attrs["title"], [";  ".join(found)], rows, (2.75, 1.4))
    sheet.draw(panels)
    sheet.legend("curve")
    return sheet.finish()


def fit_panels(data: Any) -> dict[str, Panel]:
    """Its panels by name: the curve of the first measured column, residuals, the law, curves of
    other columns."""
    residuals = Panel(Scale("number of the datum"), Scale("(observed − fitted) / noise"))
    residuals.shade(-BAND, BAND, upright=False)
    residuals.across(0.0)
    for i in np.unique(column := data["measured_column"].values):
        values = data["residual"].values[column == i]
        residuals.line(1 + np.arange(len(values)), values, **(DATA | {"marker": "osD^"[i % 4]}))
    found = {"curve": _curve(data, 0), "residuals": residuals}
    if "law_slip" in data:
        slip, traction, error = (
            data[f"law_{name}"].values for name in ("slip", "traction", "error")
        )
        units = [str(data[name].attrs["units"]) for name in ("law_slip", "law_traction")]
        law = found["law"] = Panel(
            scale("slip", slip, units[0]), scale("traction", traction, units[1])
        )
        law.band(slip, traction - BAND * error, traction + BAND * error)
        law.line(slip, traction, **FITTED)
        least = float(law.y(np.min(traction - BAND * error, initial=0.0)))
        law.limits = [(0.0, float(law.x(slip[-1]))), (least, None)]
    return found | {f"curve {i}": _curve(data, i) for i in range(1, len(columns(data)[1]))}


def _curve(data: Any, i: int) -> Panel:
    """Data and curve of a measured column, with its band of 95 %."""
    given, measured = columns(data)
    own, path = data["measured_column"].values == i, "curve_given" in data and i == 0
    names = ("datum_given", "datum", "predicted_given", "predicted", "noise")
    x, y, at, fitted, noise = (data[name].values[own] for name in names)
    error = BAND * prediction_error(data)[own]
    label = style.symbol(given[0][0]) if given else "datum"
    what, _, file = measured[i][0].partition(" in ")  # of several tests
    title = NAMES.get(what, what) + (f", {file}" if file else "")
    panel = Panel(scale(label, x, given[0][1] if given else "1"), scale(title, y, measured[i][1]))
    spread = float(data.attrs["given_noise"]) if path else 0.0
    if path:
        curve = np.stack([data["curve_given"].values, data["curve_measured"].values])
        panel.line(*curve, **FITTED, label="fit")
        if "fold_vertex" in data:
            panel.line(
                *curve[:, data["fold_vertex"].values],
                **RED_DOT,
                markersize=4,
                zorder=4,
                label="fold",
            )
        # the band lies across the curve, at the feet of the data, in units of the noise of both
        size = np.array([spread, float(noise[0])])
        feet = np.stack([at, fitted], axis=1) / size
        way = np.gradient(feet, axis=0)
        normal = (
            np.stack([-way[:, 1], way[:, 0]], axis=1)
            / np.maximum(np.hypot(*way.T), 1e-300)[:, None]
        )
        sides = [feet + sign * (error / noise)[:, None] * normal for sign in (1.0, -1.0)]
        panel.fill(
            *(np.concatenate([sides[0], sides[1][::-1]]) * size).T, zorder=1, label="95 % band"
        )
    else:
        order = np.argsort(at, kind="stable")
        panel.line(at[order], fitted[order], **FITTED, label="fit")
        panel.band(at[order], (fitted - error)[order], (fitted + error)[order], label="95 % band")
    gap = np.full(len(x), np.nan)
    for ends in ((x, x, gap, y - noise, y + noise, gap), (x - spread, x + spread, gap, y, y, gap)):
        panel.line(
            *(np.stack(part, axis=1).ravel() for part in (ends[:3], ends[3:])),
            color=style.INK,
            linewidth=0.5,
        )
    panel.line(x, y, **DATA, label="data", zorder=2)
    panel.window(x, np.append(y, 0.0) if y.min() > 0.0 else y, (0.06, 0.08))
    return panel
