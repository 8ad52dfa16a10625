"""Pictures of accuracy: errors over the mesh size with the slopes to expect, and errors over time
and unknowns."""

from __future__ import annotations

from collections.abc import Mapping
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
from tcstudy.reports.terminal.accuracy import EXACT, GROUPS, SYMBOLS, advice, front, settings, shown
from tcstudy.scene.mesh_plan import FAMILIES

if TYPE_CHECKING:
    from matplotlib.figure import Figure

# -- errors over the mesh size
# -----------------------------------------------------------------------------------------

LOOKS = (
    {"color": style.BLUE, "marker": "o", "markersize": 8, "linewidth": 3.0},
    {"color": style.VERMILLION, "marker": "s", "markersize": 5, "linewidth": 1.6},
    {"color": style.INK, "marker": "^", "markersize": 4, "linewidth": 1.1},
)
"""Of the first, second and third error of a panel: one that lies on another hides it not."""
PANEL, LEGEND_LINE = 2.55, 0.18
"""Height of a panel and of a line of its legend [inch]."""
BESIDE = 0.2
"""Room for the order left of the finest mesh, as a part of the range of h."""
BELOW = 1.7
"""Factor between the finest error and the line of the order to expect."""


def convergence_figure(
    data: Any, point: Mapping[str, Value] | None, look: style.Look
) -> tuple[Figure, str]:
    """The errors of one sweep point, the first unless named, and which it is. Raises DrawError."""
    where = locate(data, point)
    at, words = data.isel(where), describe(data, where)
    panels, states = convergence_panels(at), {_state(at, m.name) for m in shown(at)}
    if not panels:
        raise DrawError(
            "the file has no errors to draw: no reference was there, or all errors are rounding"
        )
    marks = {
        f"reference: {str(data.attrs['reference']).split(' (')[0]}": True,
        "relative errors": True,
        "dotted: orders to expect": True,
        "dashed: pre-asymptotic": "pre_asymptotic" in states,
        f"pale: a guess ({sentences.GUESS}) from two levels": "guess" in states,
        "hollow: did not converge": bool((at["status"].values != int(PointStatus.OK)).any()),
    }
    facts = [
        *filter(None, [style.point_words(words, axis_symbols(data))]),
        *(mark for mark, there in marks.items() if there),
    ]
    rows = list(zip_longest(*(list(panels)[k::2] for k in (0, 1)), fillvalue="."))
    sheet = Sheet(look, data.attrs["title"], [";  ".join(facts)], rows, [PANEL] * len(rows))
    sheet.draw(panels)
    for axes in sheet.panels.values():
        axes.minorticks_off()
        style.few_ticks(axes.yaxis)
        low, high = np.log10(axes.get_ylim())
        room = (
            LEGEND_LINE * len(axes.get_legend_handles_labels()[1]) + 0.05
        ) / PANEL  # below all curves
        axes.set_ylim(10 ** (high - (high - low) / (1 - room)), 10**high)
        axes.legend(
            loc="lower right",
            frameon=False,
            fontsize=style.pt(8.5),
            handlelength=1.6,
            borderaxespad=0.1,
        )
    return sheet.finish(), words or data.attrs["title"]


def _state(at: Any, name: str) -> str:
    """What is drawn of an error: nothing if it is rounding, else its verdict; "guess" if its rate
    is of two levels."""
    verdict = VERDICTS[int(at[f"verdict_{name}"])]
    if verdict == "exact" or not bool((at[f"error_{name}"] > 0).any()):
        return ""
    guess = np.isfinite(at[f"slope_{name}"]) and not np.isfinite(at[f"slope_error_{name}"])
    return "guess" if guess else verdict


def convergence_panels(at: Any) -> dict[str, Panel]:
    """By the symbol of what errors are of, a panel of those of one sweep point over h, with the
    slopes to expect.

    Solutions that did not converge are hollow and joined to nothing.
    """
    h, ok = at["h_max"].values, at["status"].values == int(PointStatus.OK)
    across, found = (
        scale("longest element edge h", h, str(at["h_max"].attrs["units"])),
        dict[str, Panel](),
    )
    for symbol, title in GROUPS.items():
        own = (m.name for m in shown(at) if m.symbol.split(" ")[0] == symbol)
        names = {name: state for name in own if (state := _state(at, name))}
        if not names:
            continue
        panel = found[symbol] = Panel(across, Scale("relative error"), log=(True, True), grid=True)
        panel.title, finest = f"{symbol}: {title}", dict[float, tuple[float, float]]()
        for (name, state), look in zip(names.items(), LOOKS, strict=False):
            error = at[f"error_{name}"].values
            good, bad = ok & (error > 0), ~ok & (error > 0)
            slope = sentences.order(float(at[f"slope_{name}"]), float(at[f"slope_error_{name}"]))
            label = SYMBOLS[name] + ("" if slope == "–" else f": {slope}")
            dashed = "--" if state in ("guess", "pre_asymptotic") else "-"
            how = look | {
                "linestyle": dashed,
                "alpha": 0.45 if state == "guess" else 1.0,
                "label": label,
            }
            panel.line(
                h[good], error[good], **how, markerfacecolor="white" if look is LOOKS[0] else None
            )
            panel.line(h[bad], error[bad], **look | {"linestyle": "none", "fillstyle": "none"})
            order = round(float(at[f"expected_{name}"]), 2)
            if (
                order > 0 and np.count_nonzero(good) > 1
            ):  # by order the least error at its finest step, and that step
                finest[order] = min(
                    finest.get(order, (np.inf, 0.0)), (float(error[good][-1]), float(h[good][-1]))
                )
        beside = (one for one in BY_ITSELF if one.split("_", 1)[1] in names and one in at)
        for one, dash in zip(beside, (":", "-."), strict=False):
            panel.line(
                h,
                at[one].values,
                color=style.INK,
                linestyle=dash,
                linewidth=1.2,
                label=one.split("_")[0],
            )
        for order, (fine, size) in finest.items():
            ends = np.array([size, h[ok].max()])
            panel.line(
                ends,
                fine / BELOW * (ends / size) ** order,
                color=style.PALE,
                linewidth=0.9,
                linestyle=":",
            )
            panel.note(
                f"{order:g}",
                (size, fine / BELOW),
                (-4, -3),
                ha="right",
                fontsize=8.5,
                color=style.PALE,
            )
        drawn = across(h[np.array([at[f"error_{name}"].values > 0 for name in names]).any(axis=0)])
        panel.ticks = drawn.tolist(), [f"{value:.2g}" for value in drawn]
        left, right = drawn.min(), drawn.max()
        panel.limits[0] = (
            left * (left / right) ** BESIDE,
            right * (right / left) ** 0.06 if right > left else None,
        )
    return found


# -- errors over time and unknowns
# -------------------------------------------------------------------------------------

GOLD = "#f0c000"
COLOURS = dict(
    zip((*FAMILIES, OWN), (style.INK, style.VERMILLION, style.BLUE, style.GREEN), strict=True)
)
MARKS = dict(zip((*FAMILIES, OWN), "sDo^", strict=True))
LINES: tuple[Any, ...] = ("-", (0, (1.2, 1.6)), (0, (4, 2)), (0, (4, 2, 1, 2)))
"""Line styles of the first, second … solver."""
CHART = 3.6
"""Height of the panels with the key above them [inch]."""
PALE = 0.32
"""Opacity of curves that others beat everywhere."""


def cost_figure(data: Any, measure: str, look: style.Look) -> Figure:
    """Error over wall time, with bands to the upper quartile, and over unknowns, with the rates of
    the families."""
    found = settings(data, measure)
    facts = [
        style.point_words(data.attrs["point"], axis_symbols(data)),
        f"reference: {data.attrs['reference']}",
    ]
    sheet = Sheet(look, data.attrs["title"], facts, [("time", "unknowns")], [CHART], advice(found))
    sheet.draw(cost_panels(data, measure))
    for axis in (one for axes in sheet.panels.values() for one in (axes.xaxis, axes.yaxis)):
        style.few_ticks(axis)
    sheet.panels["unknowns"].margins(x=0.15)
    if len(sheet.heights) == 1:
        sheet.panels["unknowns"].set_ylabel("")
        sheet.panels["unknowns"].tick_params(which="both", labelleft=False)
    sheet.key("unknowns", "time", place="upper left")
    return sheet.finish()


def cost_panels(data: Any, measure: str) -> dict[str, Panel]:
    """The two panels of an error by name."""
    found = settings(data, measure)
    error = Scale(f"relative error of {SYMBOLS[measure]}")
    time = Panel(
        Scale("wall time [s]: least of all runs, band to the upper quartile"),
        error,
        log=(True, True),
        grid=True,
    )
    unknowns = Panel(Scale("displacement unknowns N"), error, log=(True, True), grid=True)
    families, solvers = (data[name].values.tolist() for name in ("family", "solver"))
    worthy = {(s.family, s.solver) for s in front(found)}
    for family in families:
        how: dict[str, Any] = {"color": COLOURS[family], "marker": MARKS[family], "markersize": 4.5}
        unknowns.line([], [], **how, label=family)
        for k, solver in enumerate(solvers):
            own = [
                s
                for s in found
                if (s.family, s.solver) == (family, solver) and s.error > 0 and s.time > 0
            ]
            solved = [s for s in own if s.solved]
            dash, alpha = LINES[k % len(LINES)], 1.0 if (family, solver) in worthy else PALE
            t, e, upper, n = (
                np.array([(s.time, s.error, s.upper, s.n_dof) for s in solved]).reshape(-1, 4).T
            )
            ring = [np.concatenate([t, upper[::-1]]), np.concatenate([e, e[::-1]])]
            time.fill(*ring, color=COLOURS[family], alpha=0.16 * alpha)
            time.line(t, e, color=COLOURS[family], linestyle=dash, linewidth=1.2, alpha=alpha)
            for s in own:
                face = "white" if not s.solved or s.dominated else None
                time.line(
                    s.time, s.error, **how, linestyle="none", markerfacecolor=face, alpha=alpha
                )
            if k == 0:
                unknowns.line(n, e, **how, linewidth=1.2)
                if len(n) > 2 and e.max() > EXACT:
                    steep = np.polyfit(np.log(n[-3:]), np.log(e[-3:]), 1)[0]
                    look = {"color": COLOURS[family], "fontsize": 9}
                    unknowns.note(f"N^{steep:.2f}", (n[-1], e[-1]), (7, 3), **look)
    for k, solver in enumerate(solvers):
        time.line(
            [], [], color=style.INK, linestyle=LINES[k % len(LINES)], linewidth=1.2, label=solver
        )
    own_setting = next((s for s in found if s.own and np.isfinite(s.error)), None)
    if own_setting is not None:  # white inside where another setting is better in both
        star = {"marker": "*", "markersize": 13, "markeredgecolor": style.INK, "linestyle": "none"}
        star |= {"color": "white" if own_setting.dominated else GOLD}
        dominated = " (dominated)" * own_setting.dominated
        time.line(own_setting.time, own_setting.error, **star, label=f"the study's own{dominated}")
        unknowns.line(own_setting.n_dof, own_setting.error, **star)
    if not all(s.solved and not s.dominated for s in found):
        open_ = {
            "color": style.INK,
            "marker": "o",
            "markersize": 4.5,
            "linestyle": "none",
            "markerfacecolor": "white",
        }
        time.line([], [], **open_, label="open: dominated, or not converged")
    errors = [s.error for s in found if s.error > 0]
    if errors:
        time.limits[1] = unknowns.limits[1] = min(errors) / 1.6, max(errors) * 1.6
    return {"time": time, "unknowns": unknowns}
