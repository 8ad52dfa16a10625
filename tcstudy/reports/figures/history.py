"""The picture of a load history: the loop of a number over a load, what nodes do step by step, what cycles change."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from tcstudy.data.schema import PointStatus
from tcstudy.errors import DrawError
from tcstudy.reports.figures import style
from tcstudy.reports.figures.panels import Array, Panel, Scale, contact_nodes, place_names, scale
from tcstudy.reports.figures.sheet import Sheet
from tcstudy.reports.select_point import Value, describe, locate
from tcstudy.reports.terminal.paths import MOVES, last_change, motion
from tcstudy.reports.text import counted

if TYPE_CHECKING:
    from matplotlib.figure import Figure

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
    where = locate(data.isel(step=0), point)
    words, data = describe(data.isel(step=0), where), solved_steps(data.isel(where))
    if not data.sizes["step"]:
        raise DrawError(f"no step of the history was solved: {data['reason'].values.item()}")
    names = loop_names(data, x, y)
    told = ", ".join(filter(None, [f"{names[1]} over {names[0]}", counted(data.sizes["step"] - 1, "step"), words]))
    return history_figure(data, *names, words, look), told


def solved_steps(data: Any) -> Any:
    """One history up to its last solved step, with "slip", u_T where it is largest."""
    data = data.isel(step=slice(int(np.sum(data["status"].values == PointStatus.OK))))
    if not data.sizes["step"]:
        return data
    data = data.assign(slip=data["u_T"].isel(node=int(np.abs(data["u_T"].values).max(axis=0).argmax())))
    data["slip"].attrs |= {"units": data["u_T"].attrs["units"], "long_name": "$u_T$ where it is largest"}
    return data


def loop_names(data: Any, x: str | None = None, y: str | None = None) -> tuple[str, str]:
    """What the loop is of: y over x, numbers that the file has by step, or "slip". Over the first load that changes,
    unless given: the slip, or the friction resultant if a displacement is prescribed. Raises DrawError.
    """
    loads = str(data.attrs["loads"]).split()
    pulled = any(name in ("u_x", "u_y", "u_N", "u_T") for name in loads)
    names = x or loads[0], y or ("friction_resultant" if pulled else "slip")
    held = [str(v) for v in data.variables if data[v].dims == ("step",) and data[v].dtype.kind == "f"]
    for name in names:
        if name not in held:
            raise DrawError(f"the history has no number {name!r} by step; it has {', '.join(held)}")
    return names


def history_figure(data: Any, x: str, y: str, point: str, look: style.Look) -> Figure:
    """The figure of one history, its solved steps; call it within `style.styled()` for its letters."""
    panels = history_panels(data, x, y)
    told = [f"memory: {data.attrs['memory']}", counted(data.sizes["step"] - 1, "step"), last_change(data).words]
    facts = [style.point_words(point), ";  ".join(filter(None, told))]
    rows = [
        (("spent", "change") if name == "spent" else (name, name), HEIGHTS[name]) for name in panels if name in HEIGHTS
    ]
    sheet = Sheet(look, data.attrs["title"], facts, *zip(*rows, strict=True))
    sheet.draw(panels)
    sheet.key("motion", *(["section"] if "section" in panels else []))
    figure = sheet.finish()
    place_names(sheet.panels["loop"], panels["loop"])
    return figure


def history_panels(data: Any, x: str, y: str) -> dict[str, Panel]:
    """Its panels by name: the loop of y over x, what nodes do, where the bond is debonded over the load, and of several
    whole cycles what each changes."""
    cycle = data["cycle"].values
    whole, count = np.unique(cycle[cycle > 0], return_counts=True)
    whole = whole[count == count.max(initial=0)]
    found = {"loop": _loop(data, x, y), "motion": _motion(data)}
    if "debonded_to" in data and np.any(data["debonded_to"] > data["debonded_from"]):
        found["front"] = _front(data, x)
    found |= {"section": _section(data)} if "section_force" in data else {}
    if len(whole) < 2:
        return found
    spent = np.array([data["dissipated"].values[cycle == c].sum() for c in whole])
    ends = [0, *(int(np.flatnonzero(cycle == c)[-1]) for c in whole)]
    left = np.abs(np.diff(data["u_T"].values[ends], axis=0)).max(axis=1)
    number = np.arange(1, len(whole) + 1)
    shown = number if len(number) <= 12 else number[:: len(number) // 6]
    kinds = (("spent", "dissipated", spent, "dissipated"), ("change", "change of $u_T$", left, "u_T"))
    for name, title, values, of in kinds:
        up = scale(title, values, str(data[of].attrs["units"]))
        found[name] = Panel(Scale("cycle"), up, ticks=(shown, [str(c) for c in shown]))
        found[name].line(number, values, color=style.VERMILLION, marker="o", markersize=4, linewidth=1.0)
        high = 1.12 * float(up(values.max())) or 1.0
        found[name].limits[1] = -0.06 * high, high  # a mark at 0 is whole
    return found


def _axis(data: Any, name: str) -> Scale:
    """Of a load or another number by step."""
    title = style.symbol(name) if name in str(data.attrs["loads"]).split() else data[name].attrs.get("long_name", name)
    return scale(title, data[name].values, str(data[name].attrs.get("units", "1")))


def _front(data: Any, x: str) -> Panel:
    """Where the debonded stretch of the contact line begins and ends over x, dots at steps."""
    _, arclength, ends = contact_nodes(data)
    panel = Panel(_axis(data, x), replace(arclength, label=arclength.label.replace("arclength", "debonded from, to")))
    for name, sign in (("debonded_from", "v"), ("debonded_to", "^")):
        panel.line(data[x].values, data[name].values, color=style.VERMILLION, linewidth=1.2, marker=sign, markersize=4)
    panel.window(data[x].values, np.zeros(1), ROOM)
    panel.limits[1] = 0.0, 1.04 * float(arclength(ends[-1]))
    return panel


def _loop(data: Any, x: str, y: str) -> Panel:
    """y over x through all steps, the last cycle heavy; dots, last of all, at steps with names; rings at jumps."""
    values, panel = np.stack([data[x].values, data[y].values]), Panel(_axis(data, x), _axis(data, y))
    panel.across(0.0)
    cycle, names = data["cycle"].values, data["step_name"].values
    last, jumps = slice(max(int(np.flatnonzero(cycle >= cycle[-1])[0]) - 1, 0), None), data["jumps"].values > 0
    panel.line(*values, color=style.BLUE, linewidth=1.1, alpha=0.55)
    panel.line(*values[:, last], color=style.BLUE, linewidth=2.0)
    _arrows(panel, values[0, last], values[1, last])
    panel.line(*values[:, jumps], **DOT, color=style.VERMILLION, markerfacecolor="none", markersize=8, zorder=4)
    panel.line(*values[:, names != ""], **DOT, color=style.INK, markersize=4, zorder=5)
    panel.window(values[0], np.append(values[1], 0.0), ROOM)
    panel.names(values[0, names != ""], values[1, names != ""], [str(name) for name in names if name])
    return panel


def _arrows(panel: Panel, x: Array, y: Array) -> None:
    """The sense of a loop: an arrow on the longest step of every stretch in which x goes one way."""
    step = np.diff(x)
    size = np.hypot(step / (np.ptp(x) or 1.0), np.diff(y) / (np.ptp(y) or 1.0))
    for part in np.split(np.arange(len(step)), np.flatnonzero(np.diff(np.sign(step))) + 1):
        k = part[np.argmax(size[part])] if len(part) else 0
        if len(part) and size[k] > LONG:
            places = [(x[k] + share * step[k], y[k] + share * (y[k + 1] - y[k])) for share in (0.45, 0.58)]
            panel.arrow(places[0], places[1], 18.0, color=style.BLUE, linewidth=0.0)


def _section(data: Any) -> Panel:
    """The force of the section along the contact line after the last steps with names, or after the last."""
    (nodes, s, _), N, names = contact_nodes(data), data["section_force"], data["step_name"].values
    title = "Force of the section, positive in tension"
    panel = Panel(s, scale("$N$", N.values, str(N.attrs["units"])), title)
    panel.across(0.0)
    shown = [*np.flatnonzero(names != "")[-len(style.SERIES) :]] or [len(names) - 1]
    for i, colour in zip(shown, style.SERIES, strict=False):
        panel.line(
            data["arclength"].values[nodes], N.values[i, nodes], color=colour, label=f"N: {names[i] or 'step'} ({i})"
        )
    return panel


def _motion(data: Any) -> Panel:
    """What every node does in every step: rests, slides along t or back, jumps."""
    nodes, arclength, ends = contact_nodes(data)
    u, cycle = data["u_T"].values, data["cycle"].values
    what = motion(u, data["jumped"].values if "jumped" in data else None)[1:, nodes]
    panel = Panel(Scale("step (dashed: cycles)" if cycle[-1] > 1 else "step"), arclength)
    panel.cells(np.arange(len(u)) + 0.5, ends, what, MOTION, MOVES)
    for i in np.flatnonzero(np.diff(cycle[1:])):
        panel.up(i + 1.5, color=style.INK, linewidth=0.7, linestyle=(0, (4, 2)), zorder=2)
    every = max(1, -(-len(u) // 8))
    shown = range(every, len(u), every)
    panel.ticks = list(shown), [str(i) for i in shown]
    panel.limits = [(0.5, max(len(u) - 0.5, 1.5)), (0.0, float(arclength(ends[-1])))]
    return panel
