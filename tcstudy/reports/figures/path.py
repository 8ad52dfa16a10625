"""Pictures along a parameter: of a path, a load history and a fit.

A path: the response curve with folds and hysteresis loop, the state of the contact line below.
A history: the loop of a variable over a load, the states of the nodes in every step, the changes in
every cycle. A fit: data with their noise, the fitted curve with its folds and band, residuals, the
fitted law.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
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
from tcstudy.reports.rounding import cleared, resultant_floor
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

DASHED: dict[str, Any] = {"linestyle": (0, (4, 2)), "zorder": 2}
DOT: dict[str, Any] = {"marker": "o", "linestyle": "none"}

RED_DOT = DOT | {"color": style.VERMILLION, "markerfacecolor": "white"}

# -- paths -----------------------------------------------------------------------------------------

RESPONSES: dict[str, tuple[str, str, Callable[[Array, Array, Array], Array]]] = {
    "mean-slip": ("mean u_T", "u_T", lambda u_T, xi, c: np.asarray(u_T @ c / c.sum())),
    "max-slip": ("max |u_T|", "u_T", lambda u_T, xi, c: np.max(np.abs(u_T), axis=1, initial=0.0)),
    "friction": ("∫ξ ds", "xi", lambda u_T, xi, c: np.asarray(xi @ c)),
}
"""Responses over the parameter of a path: label, source variable, formula."""
OPENING_RESPONSES: dict[str, tuple[str, str, Callable[[Array, Array, Array], Array]]] = {
    "peel": ("∫S_N ds", "S_N", lambda s_N, S_N, c: np.asarray(S_N @ c)),
    "opening": ("max s_N", "opening", lambda s_N, S_N, c: np.max(s_N, axis=1, initial=0.0)),
}
"""The same of openings, where edges may open."""
OF_FORCE = ("xi", "S_N")
"""Source variables whose responses are forces."""


def responses_of(data: Any) -> dict[str, tuple[str, str, Callable[[Array, Array, Array], Array]]]:
    """Return the responses that a path has, the usual one first."""
    return OPENING_RESPONSES | RESPONSES if "opening" in data else RESPONSES


def response_of(data: Any, response: str, kind: str = "") -> Array:
    """Return a response of the vertices, or of the states with another prefix in the file."""
    _, _, formula = responses_of(data)[response]
    names = (f"{kind}u_T", f"{kind}xi", "c")
    if response in OPENING_RESPONSES:
        names = (f"{kind}opening", f"{kind}S_N", "c_N")
    values = formula(*(data[name].values for name in names))
    return cleared(values, resultant_floor(data)) if response == "friction" else values


CURVE, MAP = 3.4, 1.25
"""Heights of the response curve and of the map of states [inch]."""
STABLE: dict[str, Any] = {"color": style.INK, "linewidth": 1.3, "zorder": 4}
UNSTABLE = DASHED | {"color": style.VERMILLION, "linewidth": 0.9, "zorder": 3}
REQUESTED = DOT | {"color": style.BLUE, "marker": "D", "markersize": 5, "zorder": 7}
LEAST = (("#5aa9dc", "global minimum (proved)"), ("#c3dff2", "lowest energy on the path"))
COLOURS = ("#dedede", "#7fb8de", "#f2c14e", "#d55e00", "#b7a3d6")
"""Colours of `ContactState`."""


def path_figure(data: Any, response: str | None, look: style.Look) -> Figure:
    """Return the figure of a path; response: drawn over the parameter, None for the usual one."""
    responses = responses_of(data)
    response = response or next(iter(responses))
    if response not in responses:
        raise DrawError(f"there is no response {response!r}; use one of {', '.join(responses)}")
    panels = path_panels(data, response)
    facts = [path_verdict(data).sentence]
    maps = [name for name in panels if name != "curve"]
    rows = [["curve"], *([name] for name in maps)]
    sheet = Sheet(look, data.attrs["title"], facts, rows, (CURVE, *[MAP] * len(maps)))
    sheet.draw(panels)
    sheet.share(*panels)
    sheet.key("curve", place="upper left")
    for name in maps:
        sheet.key(name, place="lower left")
    return sheet.finish()


def path_panels(data: Any, response: str) -> dict[str, Panel]:
    """Return the response curve, and the states of the contact line with the least energy."""
    curve = _response_panel(data, response)
    _draw_branches(curve, data, response)
    if "lowest_begin" in data:
        _draw_least_energy(curve, data, response)
    t, y, folds = data["parameter"].values, response_of(data, response), folds_of(data)
    dots = RED_DOT | {"markersize": 3.2, "markeredgewidth": 0.9, "zorder": 5}
    curve.line(t[folds], y[folds], **dots, label="fold" if len(folds) else "")
    if "solution_u_T" in data:
        _draw_requested(curve, data, response)
    if "loop_u_T" in data:
        _draw_hysteresis(curve, data, response)
    floor = resultant_floor(data)
    span = np.sort(np.asarray(data.attrs["parameter_range"], dtype=float))
    curve.window(span, _drawn_values(data, response), (0.0, 0.05))
    panels = {"curve": curve}
    if "opening" in data:
        panels["bond"] = _bond_panel(data, curve)
    if "opening" not in data or np.any(np.abs(data["xi"].values) @ data["c"].values > floor):
        panels["over"] = _state_panel(data, curve)
    return panels


def _drawn_values(data: Any, response: str) -> Array:
    """Return the values of a response in the range of the parameter, on all branches."""
    span = np.sort(np.asarray(data.attrs["parameter_range"], dtype=float))
    y = response_of(data, response)
    values_in_range = within(data["parameter"].values, y, span)
    branches = np.zeros(0)
    if "branch_u_T" in data:
        branches = response_of(data, response, "branch_")
    return np.concatenate([values_in_range if len(values_in_range) else y, branches])


def _response_panel(data: Any, response: str) -> Panel:
    """Return the panel of a response over the parameter, with the path in it."""
    title, source, _ = responses_of(data)[response]
    units = str(data[source].attrs["units"])
    if source in OF_FORCE and units != "1":
        units = "N m-1"
    name = str(data.attrs["parameter"])
    name = "load factor" if name == "load" else style.symbol(name)
    span = np.sort(np.asarray(data.attrs["parameter_range"], dtype=float))
    parameter = scale(name, span, str(data["parameter"].attrs["units"]))
    panel = Panel(parameter, scale(title, _drawn_values(data, response), units))
    panel.across(0.0)
    stable = data["stable"].values.astype(bool)
    _draw_pieces(panel, data["parameter"].values, response_of(data, response), stable)
    return panel


def _draw_branches(panel: Panel, data: Any, response: str) -> None:
    """Draw the branches that the path does not meet."""
    if "branch_u_T" not in data:
        return
    branch_of_vertex, t = data["branch_of"].values, data["branch_parameter"].values
    stable, on_path = data["branch_stable"].values, data["branch_on_path"].values
    y = response_of(data, response, "branch_")
    look: dict[str, Any] = {"color": style.BLUE, "linewidth": 1.3}
    for branch in np.flatnonzero(on_path == 0):
        vertices = np.flatnonzero(branch_of_vertex == branch)
        is_stable = stable[vertices[:-1]].astype(bool)
        _draw_pieces(panel, t[vertices], y[vertices], is_stable, **look)
    if not on_path.all():
        panel.line([], [], **look, label="not met by the path")


def _draw_least_energy(panel: Panel, data: Any, response: str) -> None:
    """Draw a broad band behind the curve where the solution has the lowest energy on the path."""
    t, y = data["parameter"].values, response_of(data, response)
    ends = _ends_of_lowest(data)
    piece, proved = data["lowest_piece"].values, data["lowest_certified"].values.astype(bool)
    step, rise = t[piece + 1] - t[piece], y[piece + 1] - y[piece]
    slope = np.divide(rise, step, out=np.zeros(len(step)), where=step != 0.0)
    values = y[piece, None] + slope[:, None] * (ends - t[piece, None])
    look = {"linewidth": 6.0, "solid_capstyle": "butt", "zorder": 1}
    for is_drawn, (colour, label) in zip((proved, ~proved), LEAST, strict=True):
        if is_drawn.any():
            xs, ys = _broken(*ends[is_drawn].T), _broken(*values[is_drawn].T)
            panel.line(xs, ys, color=colour, **look, label=label)


def _ends_of_lowest(data: Any) -> Array:
    """Return (k, 2) the values of the parameter between which a piece has the lowest energy."""
    return np.stack([data["lowest_begin"].values, data["lowest_end"].values], axis=1)


def _broken(start: Array, end: Array) -> Array:
    """Return one coordinate of separate pieces in one line, which NaN breaks between them."""
    gap = np.full(len(start), np.nan)
    return np.stack([start, end, gap], axis=1).ravel()


def _draw_requested(panel: Panel, data: Any, response: str) -> None:
    """Draw the solutions at requested values; those not stable are open."""
    y = response_of(data, response, "solution_")
    if not len(y):
        return
    t, stable = data["solution_parameter"].values, data["solution_stable"].values.astype(bool)
    for value in data["at"].values:
        panel.up(float(value), color=style.PALE, linewidth=0.6, linestyle=":")
    panel.line(t[stable], y[stable], **REQUESTED, label="requested (open: unstable)")
    panel.line(t[~stable], y[~stable], **REQUESTED, markerfacecolor="white")


def _draw_hysteresis(panel: Panel, data: Any, response: str) -> None:
    """Draw slow loading and unloading, with arrows along the jumps."""
    t, y = data["loop_parameter"].values, response_of(data, response, "loop_")
    look = {"color": style.GREEN, "linewidth": 3.2, "alpha": 0.6, "zorder": 2}
    panel.line(t, y, **look, label="slow loading and unloading")
    jumps = data["jump_vertex"].values if "jump_vertex" in data else []
    for vertex in jumps:
        if vertex + 1 == len(t):  # the last one of a loop that is not completed
            continue
        start, end = np.stack([t, y], axis=1)[vertex : vertex + 2]
        panel.arrow(start.tolist(), end.tolist(), 12.0, color=style.GREEN, linewidth=1.1)


def _state_panel(data: Any, curve: Panel) -> Panel:
    """Return the states of the contact line over the parameter, below a response curve."""
    nodes, arclength, cuts = contact_nodes(data)
    panel = Panel(curve.x, arclength, "State of the contact line: lowest energy on the path")
    panel.limits = [curve.limits[0], (0.0, float(arclength(cuts[-1])))]
    if "lowest_begin" in data and data["lowest_begin"].size:
        ends = _ends_of_lowest(data)
        # between two pieces with the lowest energy nothing is drawn
        states = np.full((2 * len(ends) - 1, len(nodes)), -1)
        states[::2] = data["state"].values[data["lowest_piece"].values][:, nodes]
        panel.cells(ends.ravel(), cuts, states, COLOURS, STATES)
    return panel


BONDS = ("closed", "bond is elastic", "bond softens", "open")
"""States of openings in words, by NormalState."""
BOND_COLOURS = ("#dedede", "#7fb8de", "#f2c14e", "#d55e00")
NORMAL_STATE = np.array([0, 1, 2, 2, 3])
"""NormalState of the states of openings in a file of a path: closed, elastic, softening, drop,
weakened."""


def _bond_panel(data: Any, curve: Panel) -> Panel:
    """Return the states of the openings over the parameter, below a response curve."""
    arclength, c = data["opening_arclength"].values, data["c_N"].values
    first_half = 0.5 * (arclength[1] - arclength[0]) if len(arclength) > 1 else 0.5 * c[0]
    cuts = arclength[0] + first_half - c[0] + np.concatenate([[0.0], np.cumsum(c)])
    units = str(data["opening_arclength"].attrs["units"])
    panel = Panel(curve.x, scale("arclength", cuts, units), "Opening: lowest energy on the path")
    panel.limits = [curve.limits[0], (float(panel.y(cuts[0])), float(panel.y(cuts[-1])))]
    if "lowest_begin" in data and data["lowest_begin"].size:
        piece = data["lowest_piece"].values
        states = np.full((2 * len(piece) - 1, len(c)), -1)
        states[::2] = bond_states(data, piece)
        panel.cells(_ends_of_lowest(data).ravel(), cuts, states, BOND_COLOURS, BONDS)
    return panel


def bond_states(data: Any, piece: NDArray[np.intp]) -> NDArray[np.intp]:
    """Return (k, m) the index in BONDS of every opening on k segments of a path.

    An opening without a law is open where it is not closed; so is one whose stress is 0.
    """
    states = NORMAL_STATE[data["state_N"].values[piece]]
    S_N = np.abs(data["S_N"].values)
    is_free = np.maximum(S_N[piece], S_N[piece + 1]) <= FREE * S_N.max()
    states[(states == 1) & is_free] = 3
    return states


FREE = 1e-12
"""Part of the largest normal stress up to which a node is free of stress."""


def within(t: Array, y: Array, span: Array) -> Array:
    """Return the values of a line y(t) at its vertices in a span and at the ends of the span."""
    step = np.where(np.diff(t) == 0.0, 1.0, np.diff(t))
    share = (span[:, None] - t[:-1]) / step
    crossings = y[:-1] + share * np.diff(y)
    is_crossed = (share > 0.0) & (share < 1.0)
    is_inside = (t >= span[0]) & (t <= span[1])
    return np.concatenate([y[is_inside], crossings[is_crossed]])


def _draw_pieces(
    panel: Panel, t: Array, y: Array, stable: NDArray[np.bool_], **branch_look: Any
) -> None:
    """Draw stable and unstable segments as two lines, each broken at the segments of the other."""
    for is_drawn, look, name in ((stable, STABLE, "stable"), (~stable, UNSTABLE, "unstable")):
        cuts = np.flatnonzero(~is_drawn) + 1
        label = {"label": name} if is_drawn.any() and not branch_look else {}
        xs, ys = np.insert(t, cuts, np.nan), np.insert(y, cuts, np.nan)
        panel.line(xs, ys, **look | branch_look | label)


# -- histories -------------------------------------------------------------------------------------

HEIGHTS = {
    "loop": 3.1,
    "motion": 1.35,
    "opening": 1.35,
    "front": 1.35,
    "section": 1.3,
    "spent": 1.0,
}
"""Heights of the panels, or of the first in their row [inch]."""
MOTION = (style.SHADE, style.SERIES[5], style.SERIES[4], style.VERMILLION)
"""Colours of MOVES."""
ROOM = 0.16, 0.1
"""Room beside and above the loop for names, of its width and height."""
LONG = 0.1
"""Least length of a step with an arrow, relative to the loop."""


def draw_history(
    data: Any, point: Mapping[str, Value] | None, x: str | None, y: str | None, look: style.Look
) -> tuple[Figure, str]:
    """Return the picture of one history of a file and one line on it; x, y: as of `loop_names`.

    Raises DrawError if the file has no such point or variable, or no solved step.
    """
    where = locate(data.isel(step=0), point) if point else of_largest_slip(data)
    point_words = describe(data.isel(step=0), where)
    history = solved_steps(data.isel(where))
    if not history.sizes["step"]:
        reason = data.isel(where)["reason"].values.item()
        raise DrawError(f"no step of the history was solved: {reason}")
    x_name, y_name = loop_names(history, x, y)
    panels = history_panels(history, x_name, y_name)
    steps = counted(history.sizes["step"] - 1, "step")
    memory, change = f"memory: {history.attrs['memory']}", last_change(history)[1]
    title = style.point_words(point_words, axis_symbols(history))
    facts = [title, ";  ".join(filter(None, [memory, steps, change]))]
    rows = []
    for name in panels:
        if name in HEIGHTS:
            rows.append(("spent", "change") if name == "spent" else (name, name))
    heights = [HEIGHTS[name] for name in panels if name in HEIGHTS]
    sheet = Sheet(look, history.attrs["title"], facts, rows, heights)
    sheet.draw(panels)
    sheet.key("motion", *(name for name in ("opening", "section") if name in panels))
    figure = sheet.finish()
    place_names(sheet.panels["loop"], panels["loop"])
    words = [f"{y_name} over {x_name}", steps, point_words]
    return figure, ", ".join(filter(None, words))


def solved_steps(data: Any) -> Any:
    """Return one history up to its last solved step, with "slip": u_T where it is largest."""
    solved_count = int(np.sum(data["status"].values == PointStatus.OK))
    data = data.isel(step=slice(solved_count))
    if not solved_count:
        return data
    resultant = cleared(data["friction_resultant"], resultant_floor(data))
    data["friction_resultant"] = data["friction_resultant"].copy(data=resultant)
    node = int(np.abs(data["u_T"].values).max(axis=0).argmax())
    data = data.assign(slip=data["u_T"].isel(node=node))
    units = data["u_T"].attrs["units"]
    data["slip"].attrs |= {"units": units, "long_name": "u_T where it is largest"}
    return data


def loop_names(data: Any, x: str | None = None, y: str | None = None) -> tuple[str, str]:
    """Return the names of x and y of the loop: variables by step, or "slip".

    Unless given, x is the first load that changes, and y the slip, or the friction resultant if a
    displacement is prescribed; where edges may open, the opening or the normal resultant. Raises
    DrawError.
    """
    loads = str(data.attrs["loads"]).split()
    is_pulled = any(name in ("u_x", "u_y", "u_N", "u_T") for name in loads)
    usual = "friction_resultant" if is_pulled else "slip"
    if "opening_max" in data:
        usual = "adhesion_resultant" if is_pulled else "opening_max"
    names = x or loads[0], y or usual
    by_step = []
    for variable in data.variables:
        if data[variable].dims == ("step",) and data[variable].dtype.kind == "f":
            by_step.append(str(variable))
    for name in names:
        if name in by_step:
            continue
        fault = f"there is no {name!r}"
        if name in data.variables:
            fault = f"{name!r} is not one number a step"
        raise DrawError(f"history: {fault}; choose of {', '.join(by_step)}")
    return names


def history_panels(data: Any, x: str, y: str) -> dict[str, Panel]:
    """Return the panels of a history, by name.

    The loop of y over x, the states of the nodes, the debonded part over the load, the section
    force, and of several whole cycles the changes in each.
    """
    panels = {"loop": _loop(data, x, y), "motion": _motion_panel(data)}
    if "opening" in data:
        panels["opening"] = _opening_motion_panel(data)
        if not np.any(data["friction_resultant"]):
            panels["motion"] = panels.pop("opening")
    if "debonded_to" in data and np.any(data["debonded_to"] > data["debonded_from"]):
        panels["front"] = _front_panel(data, x)
    if "section_force" in data:
        panels["section"] = _section_panel(data)
    return panels | _cycle_panels(data)


def _axis(data: Any, name: str) -> Scale:
    """Return the axis of a variable by step; loads are named by their symbols."""
    title = data[name].attrs.get("long_name", name)
    if name in str(data.attrs["loads"]).split():
        title = style.symbol(title)
    return scale(title, data[name].values, str(data[name].attrs.get("units", "1")))


def _motion_panel(data: Any) -> Panel:
    """Return the motion of the nodes in every step, with dashed lines between cycles."""
    nodes, arclength, cuts = contact_nodes(data)
    jumped = data["jumped"].values if "jumped" in data else None
    moves = motion(data["u_T"].values, jumped)[1:, nodes]
    return _moves_panel(data, arclength, cuts, moves, MOVES)


OPENING_MOVES = ("rests", "opens", "closes", "jumps")
"""Motions of an opening in a step, in the order of MOVES."""


def _opening_motion_panel(data: Any) -> Panel:
    """Return the motion of the openings in every step, with dashed lines between cycles."""
    nodes, arclength, cuts = contact_nodes(data, "opening_arclength", "c_N")
    jumped = data["jumped_N"].values if "jumped_N" in data else None
    moves = motion(data["opening"].values, jumped)[1:, nodes]
    return _moves_panel(data, arclength, cuts, moves, OPENING_MOVES)


def _moves_panel(
    data: Any, arclength: Scale, cuts: Array, moves: NDArray[np.int8], words: Sequence[str]
) -> Panel:
    cycle = data["cycle"].values
    step_count = len(cycle)
    panel = Panel(Scale("step (dashed: cycles)" if cycle[-1] > 1 else "step"), arclength)
    panel.cells(np.arange(step_count) + 0.5, cuts, moves, MOTION, words)
    for step in np.flatnonzero(np.diff(cycle[1:])):
        panel.up(step + 1.5, color=style.INK, linewidth=0.7, **DASHED)
    stride = max(1, -(-step_count // 8))
    ticks = list(range(stride, step_count, stride))
    panel.ticks = ticks, [str(step) for step in ticks]
    last_edge = max(step_count - 0.5, 1.5)
    panel.limits = [(0.5, last_edge), (0.0, float(arclength(cuts[-1])))]
    return panel


def _front_panel(data: Any, x: str) -> Panel:
    """Return both ends of the debonded part over the load."""
    _, arclength, _ = contact_nodes(data)
    label = arclength.label.replace("arclength", "debonded from, to")
    panel = Panel(_axis(data, x), replace(arclength, label=label))
    look: dict[str, Any] = {"color": style.VERMILLION, "linewidth": 1.2, "markersize": 4}
    panel.line(data[x].values, data["debonded_from"].values, **look, marker="v")
    panel.line(data[x].values, data["debonded_to"].values, **look, marker="^")
    return panel


def _section_panel(data: Any) -> Panel:
    """Return the section force after the last steps with names, or after the last step."""
    nodes, arclength, _ = contact_nodes(data)
    N, names = data["section_force"], data["step_name"].values
    title = "Force of the section, positive in tension"
    panel = Panel(arclength, scale("N", N.values, str(N.attrs["units"])), title)
    panel.across(0.0)
    named_steps = np.flatnonzero(names != "")[-len(style.SERIES) :].tolist()
    steps = named_steps or [len(names) - 1]
    places = data["arclength"].values[nodes]
    for step, colour in zip(steps, style.SERIES, strict=False):
        label = f"N: {names[step] or 'step'} ({step})"
        panel.line(places, N.values[step, nodes], color=colour, label=label)
    return panel


def _cycle_panels(data: Any) -> dict[str, Panel]:
    """Return dissipation and change of u_T of every whole cycle; empty for fewer than two."""
    cycle = data["cycle"].values
    cycles, step_counts = np.unique(cycle[cycle > 0], return_counts=True)
    whole_cycles = cycles[step_counts == step_counts.max(initial=0)]
    if len(whole_cycles) < 2:
        return {}
    last_steps = [int(np.flatnonzero(cycle == number)[-1]) for number in whole_cycles]
    dissipated = [data["dissipated"].values[cycle == number].sum() for number in whole_cycles]
    u_T = data["u_T"].values[[0, *last_steps]]
    change = np.abs(np.diff(u_T, axis=0)).max(axis=1)
    spent_panel = _cycle_panel("dissipated", np.array(dissipated), data["dissipated"])
    return {"spent": spent_panel, "change": _cycle_panel("change of u_T", change, data["u_T"])}


def _cycle_panel(title: str, values: Array, source: Any) -> Panel:
    numbers = np.arange(1, len(values) + 1)
    ticks = numbers if len(numbers) <= 12 else numbers[:: len(numbers) // 6]
    panel = Panel(Scale("cycle"), scale(title, values, str(source.attrs["units"])))
    panel.ticks = ticks, [str(number) for number in ticks]
    look = {"color": style.VERMILLION, "marker": "o", "markersize": 4, "linewidth": 1.0}
    panel.line(numbers, values, **look)
    panel.across(0.0)
    return panel


def _loop(data: Any, x: str, y: str) -> Panel:
    """Return the loop of y over x, with arrows, jumps and named steps; the last cycle is heavy."""
    values = np.stack([data[x].values, data[y].values])
    cycle, names = data["cycle"].values, data["step_name"].values
    panel = Panel(_axis(data, x), _axis(data, y))
    panel.across(0.0)
    first_step = int(np.flatnonzero(cycle >= cycle[-1])[0])
    last_cycle = values[:, max(first_step - 1, 0) :]
    panel.line(*values, color=style.BLUE, linewidth=1.1, alpha=0.55)
    panel.line(*last_cycle, color=style.BLUE, linewidth=2.0)
    _draw_sense(panel, last_cycle)
    rings: dict[str, Any] = {"color": style.VERMILLION, "markerfacecolor": "none"}
    jumps = values[:, data["jumps"].values > 0]
    panel.line(jumps[0], jumps[1], **DOT, **rings, markersize=8, zorder=4)
    named_x, named_y = values[:, names != ""]
    panel.line(named_x, named_y, **DOT, color=style.INK, markersize=4, zorder=5)
    panel.window(values[0], np.append(values[1], 0.0), ROOM)
    panel.names(named_x, named_y, [str(name) for name in names if name])
    return panel


def _draw_sense(panel: Panel, values: Array) -> None:
    """Draw an arrow on the longest step of every stretch (2, n) in which x goes one way."""
    step, extent = np.diff(values, axis=1), np.ptp(values, axis=1, keepdims=True)
    length = np.hypot(*(step / np.where(extent > 0.0, extent, 1.0)))
    turns = np.flatnonzero(np.diff(np.sign(step[0]))) + 1
    for stretch in np.split(np.arange(len(length)), turns):
        if not len(stretch):
            continue
        longest = stretch[np.argmax(length[stretch])]
        if length[longest] > LONG:
            start = (values[:, longest] + 0.45 * step[:, longest]).tolist()
            end = (values[:, longest] + 0.58 * step[:, longest]).tolist()
            panel.arrow(start, end, 18.0, color=style.BLUE, linewidth=0.0)


# -- fits ------------------------------------------------------------------------------------------

DATA: dict[str, Any] = {"color": style.INK, "marker": "o", "markersize": 3, "linestyle": "none"}
FITTED: dict[str, Any] = {"color": style.BLUE, "linewidth": 1.2, "zorder": 3}
NAMES = {
    "friction_resultant": "friction resultant ∫ξ",
    "u_T_max": "max |u_T|",
    "theta_mean": "mean θ",
}


def fit_figure(data: Any, look: style.Look) -> Figure:
    """Return the figure of a fit, with the fitted parameters and their standard errors."""
    panels = fit_panels(data)
    estimates = []
    for i, name in enumerate(data["parameter"].values):
        units = str(data["parameter_units"].values[i])
        divisor, unit = prefix([float(data["estimate"][i])], units)
        value = float(data["estimate"][i]) / divisor
        error = float(data["standard_error"][i]) / divisor
        estimate = f"{style.symbol(str(name))} = {number(value)} {pretty(unit)}".rstrip()
        if np.isfinite(error):
            estimate += f", s.e. {number(error, 2)}"
        estimates.append(estimate.replace(" ", "\xa0"))  # no line ends within it
    rows = (("curve", "curve"), ("residuals", "law" if "law" in panels else "residuals"))
    sheet = Sheet(look, data.attrs["title"], [";  ".join(estimates)], rows, (2.75, 1.4))
    sheet.draw(panels)
    sheet.legend("curve")
    return sheet.finish()


def fit_panels(data: Any) -> dict[str, Panel]:
    """Return the panels of a fit, by name: curves of the measured columns, residuals, the law."""
    panels = {"curve": _curve(data, 0), "residuals": _residual_panel(data)}
    if "law_slip" in data:
        panels["law"] = _law_panel(data)
    for column in range(1, len(columns(data)[1])):
        panels[f"curve {column}"] = _curve(data, column)
    return panels


def _residual_panel(data: Any) -> Panel:
    """Return the residuals of every measured column in the order of its data."""
    panel = Panel(Scale("number of the datum"), Scale("(observed − fitted) / noise"))
    panel.shade(-BAND, BAND, upright=False)
    panel.across(0.0)
    column_of_datum = data["measured_column"].values
    for column in np.unique(column_of_datum):
        residuals = data["residual"].values[column_of_datum == column]
        look = DATA | {"marker": "osD^"[column % 4]}
        panel.line(1 + np.arange(len(residuals)), residuals, **look)
    return panel


def _law_panel(data: Any) -> Panel:
    """Return the fitted law with its band."""
    slip, traction, error = (data[f"law_{name}"].values for name in ("slip", "traction", "error"))
    slip_axis = scale("slip", slip, str(data["law_slip"].attrs["units"]))
    panel = Panel(slip_axis, scale("traction", traction, str(data["law_traction"].attrs["units"])))
    low, high = traction - BAND * error, traction + BAND * error
    panel.band(slip, low, high)
    panel.line(slip, traction, **FITTED)
    bottom = float(panel.y(np.min(low, initial=0.0)))
    panel.limits = [(0.0, float(panel.x(slip[-1]))), (bottom, None)]
    return panel


def _curve(data: Any, column: int) -> Panel:
    """Return data and curve of a measured column, with its band of 95 %."""
    given, measured = columns(data)
    rows = data["measured_column"].values == column
    is_path = "curve_given" in data and column == 0
    x, y, noise = (data[name].values[rows] for name in ("datum_given", "datum", "noise"))
    x_axis = scale("datum", x, "1")
    if given:
        name, units = given[0]
        x_axis = scale(style.symbol(name), x, units)
    quantity, _, file = measured[column][0].partition(" in ")  # of several tests
    title = NAMES.get(quantity, quantity) + (f", {file}" if file else "")
    panel = Panel(x_axis, scale(title, y, measured[column][1]))
    given_noise = 0.0
    if is_path:
        given_noise = float(data.attrs["given_noise"])
        _draw_fitted_path(panel, data, rows, given_noise)
    else:
        _draw_fitted_values(panel, data, rows)
    _draw_noise(panel, x, y, given_noise, noise)
    panel.line(x, y, **DATA, label="data", zorder=2)
    shown_values = np.append(y, 0.0) if y.min() > 0.0 else y
    panel.window(x, shown_values, (0.06, 0.08))
    return panel


def _draw_fitted_path(panel: Panel, data: Any, rows: Any, given_noise: float) -> None:
    """Draw the fitted path with its folds, and the band of 95 % across it.

    The band stands on the feet of the data on the curve, normal to it in units of both noises.
    """
    curve = np.stack([data["curve_given"].values, data["curve_measured"].values])
    panel.line(*curve, **FITTED, label="fit")
    if "fold_vertex" in data:
        folds = curve[:, data["fold_vertex"].values]
        panel.line(*folds, **RED_DOT, markersize=4, zorder=4, label="fold")
    noise = data["noise"].values[rows]
    error = BAND * prediction_error(data)[rows]
    feet = np.stack([data[f"predicted{end}"].values[rows] for end in ("_given", "")], axis=1)
    size = np.array([given_noise, float(noise[0])])
    feet = feet / size
    tangent = np.gradient(feet, axis=0)
    length = np.maximum(np.hypot(*tangent.T), 1e-300)[:, None]
    normal = np.stack([-tangent[:, 1], tangent[:, 0]], axis=1) / length
    width = (error / noise)[:, None]
    ring = np.concatenate([feet + width * normal, (feet - width * normal)[::-1]])
    panel.fill(*(ring * size).T, zorder=1, label="95 % band")


def _draw_fitted_values(panel: Panel, data: Any, rows: Any) -> None:
    """Draw the fitted values and their band of 95 %, in the order of x."""
    x = data["predicted_given"].values[rows]
    order = np.argsort(x, kind="stable")
    x = x[order]
    fitted = data["predicted"].values[rows][order]
    error = BAND * prediction_error(data)[rows][order]
    panel.line(x, fitted, **FITTED, label="fit")
    panel.band(x, fitted - error, fitted + error, label="95 % band")


def _draw_noise(panel: Panel, x: Array, y: Array, x_noise: float, y_noise: Array) -> None:
    """Draw the standard uncertainty of the data as crosses."""
    look = {"color": style.INK, "linewidth": 0.5}
    panel.line(_broken(x, x), _broken(y - y_noise, y + y_noise), **look)
    panel.line(_broken(x - x_noise, x + x_noise), _broken(y, y), **look)
