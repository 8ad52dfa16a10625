"""A picture of a load history: the loop of a number over a load, what nodes do step by step, what cycles change."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from tcstudy.data.records import PointStatus
from tcstudy.data.store import load_root
from tcstudy.errors import DrawError
from tcstudy.reports.figures import style
from tcstudy.reports.figures.sheet import Sheet
from tcstudy.reports.select_point import Value, describe, locate
from tcstudy.reports.terminal.history_summary import MOVES, last_change, motion
from tcstudy.reports.text import axis_unit, counted, pretty

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

Array = NDArray[np.float64]

HEIGHTS = (3.1, 1.35, 1.0)
"""Heights of the loop, of the map of motion and of the chart of cycles [inch]."""
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
    at = data.isel(step=0)
    where = locate(at, point)
    words, data = describe(at, where), data.isel(where)
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
    spent, ends = _cycles(data)
    told = [f"memory: {data.attrs['memory']}", counted(data.sizes["step"] - 1, "step"), pretty(last_change(data).words)]
    rows = [["loop"], ["motion"], ["cycles"]][: 3 if len(spent) > 1 else 2]
    facts = [style.point_words(point), ";  ".join(filter(None, told))]
    sheet = Sheet(look, data.attrs["title"], facts, rows, HEIGHTS[: len(rows)])
    _draw_loop(sheet.panels["loop"], data, x, y)
    sheet.key(_draw_motion(sheet.panels["motion"], data))
    if "cycles" in sheet.panels:
        _draw_cycles(sheet.panels["cycles"], data, spent, ends)
    figure = sheet.finish()
    _name_steps(sheet.panels["loop"], [str(name) for name in data["step_name"].values if name])
    return figure


def _draw_loop(axes: Axes, data: Any, x: str, y: str) -> None:
    """y over x through all steps, the last cycle heavy; dots, last of all, at steps with names; rings at jumps."""
    across, up = (data[name].values for name in (x, y))
    scales = [axis_unit(values, str(data[name].attrs.get("units", "1"))) for name, values in ((x, across), (y, up))]
    across, up = across / scales[0][0], up / scales[1][0]
    cycle = data["cycle"].values
    axes.axhline(0.0, color=style.SHADE, linewidth=0.8, zorder=0)
    axes.plot(across, up, color=style.BLUE, linewidth=1.1, alpha=0.55)
    last = np.flatnonzero(cycle >= cycle[-1])
    last = np.concatenate([[max(last[0] - 1, 0)], last])
    axes.plot(across[last], up[last], color=style.BLUE, linewidth=2.0)
    jumps = np.flatnonzero(data["jumps"].values > 0)
    axes.plot(across[jumps], up[jumps], "o", color=style.VERMILLION, markerfacecolor="none", markersize=8, zorder=4)
    named = data["step_name"].values != ""
    axes.plot(across[named], up[named], "o", color=style.INK, markersize=4, zorder=5)
    loads = str(data.attrs["loads"]).split()
    for name, (_, unit), put in ((x, scales[0], axes.set_xlabel), (y, scales[1], axes.set_ylabel)):
        put(style.labelled(style.symbol(name) if name in loads else data[name].attrs.get("long_name", name), unit))
    axes.margins(x=0.08, y=0.1)


def _name_steps(axes: Axes, names: list[str]) -> None:
    """Names beside the dots of a loop, each once, where neither another name nor the edge is in the way."""
    from matplotlib.patheffects import withStroke

    letters = style.pt(8.5)
    taken: list[tuple[str, float, float, float]] = []
    inch = axes.figure.dpi / 72.0
    right = float(axes.bbox.x1) / inch
    places = [(float(x), float(y)) for x, y in np.asarray(axes.lines[-1].get_xydata())]
    for name, at in list(zip(names, places, strict=True))[:NAMED]:
        if any(name == other for other, *_ in taken):
            continue
        x, y = axes.transData.transform(at) / inch
        wide = LETTER * letters * len(name)
        for dx, dy in ((6, 4), (-6, 4), (6, -4 - letters), (-6, -4 - letters)):
            left, low = x + dx - (wide if dx < 0 else 0.0), y + dy
            apart = (left + wide < a or left > b or abs(low - h) > 1.2 * letters for _, a, b, h in taken)
            if left + wide <= right and all(apart):
                break
        else:
            continue
        taken.append((name, left, left + wide, low))
        ha = "left" if dx > 0 else "right"
        axes.annotate(name, at, (dx, dy), textcoords="offset points", ha=ha, fontsize=letters,
                      path_effects=[withStroke(linewidth=2.0, foreground="white")])  # fmt: skip


def _draw_motion(axes: Axes, data: Any) -> list[Any]:
    """What every node does in every step: rests, slides along t or back, jumps; returns the key."""
    from matplotlib.colors import BoundaryNorm, ListedColormap
    from matplotlib.patches import Patch
    from matplotlib.ticker import MaxNLocator

    u = data["u_T"].values
    what = motion(u, data["jumped"].values if "jumped" in data else None)[1:]
    order = np.argsort(data["arclength"].values, kind="stable")
    ends = np.concatenate([[0.0], np.cumsum(data["c"].values[order])])
    metre, unit = axis_unit([ends[-1]], str(data["arclength"].attrs["units"]))
    norm = BoundaryNorm(np.arange(len(MOTION) + 1) - 0.5, len(MOTION))
    colours = ListedColormap(MOTION)
    steps = np.arange(len(u)) + 0.5
    axes.pcolormesh(steps, ends / metre, what[:, order].T, cmap=colours, norm=norm, rasterized=True)
    for i in np.flatnonzero(np.diff(data["cycle"].values[1:])):
        axes.axvline(i + 1.5, color=style.INK, linewidth=0.7, linestyle=(0, (4, 2)))
    axes.xaxis.set_major_locator(MaxNLocator(6, integer=True))
    axes.set_xlabel("step (dashed: cycles)" if data["cycle"].values[-1] > 1 else "step")
    axes.set_ylabel(style.labelled("arclength", unit))
    return [Patch(color=MOTION[k], label=MOVES[k]) for k in range(len(MOTION)) if np.any(what == k)]


def _cycles(data: Any) -> tuple[Array, NDArray[np.intp]]:
    """What whole cycles dissipate, and the last step of each."""
    cycle = data["cycle"].values
    whole = np.unique(cycle[cycle > 0])
    count = np.array([np.count_nonzero(cycle == c) for c in whole])
    whole = whole[count == count.max(initial=0)]
    spent = np.array([data["dissipated"].values[cycle == c].sum() for c in whole])
    return spent, np.array([np.flatnonzero(cycle == c)[-1] for c in whole], dtype=np.intp)


def _draw_cycles(axes: Axes, data: Any, spent: Array, ends: NDArray[np.intp]) -> None:
    """Dissipated energy of every cycle, and the largest slip that it leaves behind, on an axis of its own."""
    number = np.arange(1, len(spent) + 1)
    divisor, unit = axis_unit(spent, str(data["dissipated"].attrs["units"]))
    axes.bar(number, spent / divisor, width=0.5, color=style.SHADE, edgecolor=style.PALE)
    axes.set_xlabel("cycle")
    axes.set_ylabel(style.labelled("dissipated", unit))
    axes.set_xticks(number if len(number) <= 20 else number[:: len(number) // 10])
    u = data["u_T"].values[np.concatenate([[0], ends])]
    left = np.abs(np.diff(u, axis=0)).max(axis=1)
    metre, unit = axis_unit(left, str(data["u_T"].attrs["units"]))
    beside = axes.twinx()
    beside.plot(number, left / metre, "o-", color=style.VERMILLION, markersize=4, linewidth=1.0)
    beside.set_ylabel(style.labelled(r"change of $u_T$", unit), color=style.VERMILLION)
    beside.set_ylim(bottom=0.0)
    beside.spines["right"].set_visible(True)
