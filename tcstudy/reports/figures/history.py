"""The picture of a load history: the loop of a number over a load, what nodes do step by step, what cycles change."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from tcstudy.data.records import PointStatus
from tcstudy.data.store import load_root
from tcstudy.errors import DrawError
from tcstudy.reports.figures import style
from tcstudy.reports.figures.panels import Array, Lines, Scale, contact_nodes, note, scale, strip
from tcstudy.reports.figures.sheet import Sheet
from tcstudy.reports.select_point import Value, describe, locate
from tcstudy.reports.terminal.history_summary import MOVES, last_change, motion
from tcstudy.reports.text import counted

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

ROWS = ((("loop", "loop"), 3.1), (("motion", "motion"), 1.35), (("spent", "change"), 1.0))
"""Panels, and their heights [inch]."""
LETTER = 0.53
"""Mean width of a letter, of its height."""
NAMED = 60
"""Steps whose names may stand beside the loop."""
MOTION = (style.SHADE, "#7fb8de", "#e69f00", style.VERMILLION)
"""Colours of MOVES."""


def draw_history(
    path: Path, point: Mapping[str, Value] | None, x: str | None, y: str | None, look: style.Look
) -> tuple[Figure, str]:
    """The picture of one history of a file, and what it shows.

    x, y: the loop is of y over x, numbers that the file has by step, or "slip" for u_T where it is largest. Over the
          first load that changes, unless given: the slip, or the friction resultant if a displacement is prescribed

    Raises DrawError if the file has no such point or number, or no solved step.
    """
    data = load_root(path, "history")
    where = locate(data.isel(step=0), point)
    words, data = describe(data.isel(step=0), where), data.isel(where)
    done = int(np.sum(data["status"].values == PointStatus.OK))
    if not done:
        raise DrawError(f"no step of the history was solved: {data['reason'].values.item()}")
    data = data.isel(step=slice(done))
    data = data.assign(slip=data["u_T"].isel(node=int(np.abs(data["u_T"].values).max(axis=0).argmax())))
    data["slip"].attrs |= {"units": data["u_T"].attrs["units"], "long_name": "$u_T$ where it is largest"}
    loads = str(data.attrs["loads"]).split()
    pulled = any(name in ("u_x", "u_y", "u_N", "u_T") for name in loads)
    names = x or loads[0], y or ("friction_resultant" if pulled else "slip")
    held = [str(v) for v in data.variables if data[v].dims == ("step",) and data[v].dtype.kind == "f"]
    for name in names:
        if name not in held:
            raise DrawError(f"the history has no number {name!r} by step; it has {', '.join(held)}")
    said = ", ".join(filter(None, [f"{names[1]} over {names[0]}", counted(done - 1, "step"), words]))
    return history_figure(data, *names, words, look), said


def history_figure(data: Any, x: str, y: str, point: str, look: style.Look) -> Figure:
    """The figure of one history, its solved steps; call it within `style.styled()` for its letters."""
    cycle = data["cycle"].values
    whole, count = np.unique(cycle[cycle > 0], return_counts=True)
    whole = whole[count == count.max(initial=0)]
    rows = ROWS[: 3 if len(whole) > 1 else 2]
    told = [f"memory: {data.attrs['memory']}", counted(data.sizes["step"] - 1, "step"), last_change(data).words]
    facts = [style.point_words(point), ";  ".join(filter(None, told))]
    sheet = Sheet(look, data.attrs["title"], facts, *zip(*rows, strict=True))
    _draw_loop(sheet.panels["loop"], data, x, y)
    _draw_motion(sheet.panels["motion"], data)
    if "spent" in sheet.panels:
        _draw_cycles(sheet, data, whole)
    sheet.key("motion")
    figure = sheet.finish()
    _name_steps(sheet.panels["loop"], [str(name) for name in data["step_name"].values if name])
    return figure


def _draw_loop(axes: Axes, data: Any, x: str, y: str) -> None:
    """y over x through all steps, the last cycle heavy; dots, last of all, at steps with names; rings at jumps."""
    loads, values = str(data.attrs["loads"]).split(), (data[x].values, data[y].values)
    titles = (style.symbol(one) if one in loads else data[one].attrs.get("long_name", one) for one in (x, y))
    units = (str(data[one].attrs.get("units", "1")) for one in (x, y))
    panel = Lines(axes, *map(scale, titles, values, units))
    panel.zero()
    cycle = data["cycle"].values
    last = slice(max(int(np.flatnonzero(cycle >= cycle[-1])[0]) - 1, 0), None)
    dot: dict[str, Any] = {"marker": "o", "linestyle": "none"}
    parts: tuple[tuple[Any, dict[str, Any]], ...] = (
        (slice(None), {"color": style.BLUE, "linewidth": 1.1, "alpha": 0.55}),
        (last, {"color": style.BLUE, "linewidth": 2.0}),
        (data["jumps"].values > 0, dot | {"color": style.VERMILLION, "mfc": "none", "markersize": 8, "zorder": 4}),
        (data["step_name"].values != "", dot | {"color": style.INK, "markersize": 4, "zorder": 5}),
    )
    for part, how in parts:
        panel.line(*(one[part] for one in values), **how)
    axes.margins(x=0.08, y=0.1)


def _name_steps(axes: Axes, names: Sequence[str]) -> None:
    """Names beside the dots of a loop, each once, where neither another name nor the edge is in the way."""
    from matplotlib.patheffects import withStroke

    letters, inch = style.pt(8.5), axes.figure.dpi / 72.0
    taken: dict[str, tuple[float, float, float]] = {}
    right = float(axes.bbox.x1) / inch
    for name, at in list(zip(names, np.asarray(axes.lines[-1].get_xydata()).tolist(), strict=True))[:NAMED]:
        x, y = axes.transData.transform(at) / inch
        wide = LETTER * letters * len(name)
        for dx, dy in ((6, 4), (-6, 4), (6, -4 - letters), (-6, -4 - letters)) if name not in taken else ():
            left, low = x + dx - (wide if dx < 0 else 0.0), y + dy
            apart = (left + wide < a or left > b or abs(low - h) > 1.2 * letters for a, b, h in taken.values())
            if left + wide <= right and all(apart):
                taken[name] = (left, left + wide, low)
                white = [withStroke(linewidth=2.0, foreground="white")]
                ha = "left" if dx > 0 else "right"
                note(axes, name, at, (dx, dy), ha=ha, fontsize=letters, path_effects=white)
                break


def _draw_motion(axes: Axes, data: Any) -> None:
    """What every node does in every step: rests, slides along t or back, jumps."""
    from matplotlib.ticker import MaxNLocator

    nodes, arclength, ends = contact_nodes(data)
    u, cycle = data["u_T"].values, data["cycle"].values
    what = motion(u, data["jumped"].values if "jumped" in data else None)[1:, nodes]
    strip(axes, np.arange(len(u)) + 0.5, ends, what, MOTION, MOVES)
    for i in np.flatnonzero(np.diff(cycle[1:])):
        axes.axvline(i + 1.5, color=style.INK, linewidth=0.7, linestyle=(0, (4, 2)))
    axes.xaxis.set_major_locator(MaxNLocator(6, integer=True))
    axes.set(xlabel="step (dashed: cycles)" if cycle[-1] > 1 else "step", ylabel=arclength.label)


def _draw_cycles(sheet: Sheet, data: Any, whole: Array) -> None:
    """Energy that every whole cycle dissipates, and the largest slip that it leaves behind."""
    cycle = data["cycle"].values
    spent = np.array([data["dissipated"].values[cycle == c].sum() for c in whole])
    ends = [0, *(int(np.flatnonzero(cycle == c)[-1]) for c in whole)]
    left = np.abs(np.diff(data["u_T"].values[ends], axis=0)).max(axis=1)
    titles, of = ("dissipated", "change of $u_T$"), (data["dissipated"], data["u_T"])
    for name, title, values, held in zip(("spent", "change"), titles, (spent, left), of, strict=True):
        panel = Lines(sheet.panels[name], Scale("cycle"), scale(title, values, str(held.attrs["units"])))
        number = np.arange(1, len(whole) + 1)
        panel.line(number, values, color=style.VERMILLION, marker="o", markersize=4, linewidth=1.0)
        panel.axes.set_xticks(number if len(number) <= 12 else number[:: len(number) // 6])
        panel.axes.set_ylim(bottom=0.0)
