"""Pictures of accuracy: errors over the mesh size with the slopes to expect, and errors over time and unknowns."""

from __future__ import annotations

from collections.abc import Mapping
from itertools import zip_longest
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from tcstudy.data.measured import ERRORS, OWN, VERDICTS
from tcstudy.data.records import PointStatus
from tcstudy.data.store import load_root
from tcstudy.errors import DrawError
from tcstudy.reports import sentences
from tcstudy.reports.figures import style
from tcstudy.reports.figures.panels import Array, Lines, Scale, note, scale
from tcstudy.reports.figures.sheet import Sheet
from tcstudy.reports.select_point import Value, describe, locate
from tcstudy.reports.terminal.convergence import GROUPS, shown
from tcstudy.reports.terminal.cost import EXACT, SYMBOLS, Setting, advice, best, front, measure_of, settings
from tcstudy.scene.families import FAMILIES

if TYPE_CHECKING:
    from matplotlib.figure import Figure

# -- errors over the mesh size -----------------------------------------------------------------------------------------

LOOKS = (
    {"color": style.BLUE, "marker": "o", "markersize": 8, "linewidth": 3.0},
    {"color": style.VERMILLION, "marker": "s", "markersize": 5, "linewidth": 1.6},
    {"color": style.INK, "marker": "^", "markersize": 4, "linewidth": 1.1},
)
"""Of the first, second and third error of a panel: one that lies on another hides it not."""
PANEL, LEGEND_LINE = 2.55, 0.18
"""Height of a panel and of a line of its legend [inch]."""
BESIDE = 0.2
"""Room for the number of a triangle left of the finest mesh, as a part of the range of h."""
APART = 1.7
"""Factor between a curve and its triangle."""

_SYMBOLS = {measure.name: measure.symbol for measure in ERRORS}


def draw_convergence(path: Path, point: Mapping[str, Value] | None, look: style.Look) -> tuple[Figure, str]:
    """The errors of one sweep point, the first unless named, and which it is.

    Raises DrawError if there is no such point or nothing to draw.
    """
    data = load_root(path)
    where = locate(data, point)
    at, words = data.isel(where), describe(data, where)
    groups = [(symbol, title, [name for name in names if _drawable(at, name)]) for symbol, title, names in GROUPS]
    groups = [group for group in groups if group[2]]
    if not groups:
        raise DrawError("the file has no errors to draw: no reference was there, or all errors are rounding")
    used = [name for *_, names in groups for name in names]
    marks = {
        "relative errors": True,
        "dashed: pre-asymptotic": any(_verdict(at, name) == "pre_asymptotic" for name in used),
        f"pale: a guess ({sentences.GUESS}) from two levels": any(_two_points(at, name) for name in used),
        "hollow: did not converge": bool((at["status"].values != int(PointStatus.OK)).any()),
    }
    reference = f"reference: {str(data.attrs['reference']).split(' (')[0]}"
    facts = [
        *([style.point_words(words)] if words else []),
        reference,
        *(mark for mark, there in marks.items() if there),
    ]
    rows = list(zip_longest(*([symbol for symbol, *_ in groups][k::2] for k in (0, 1)), fillvalue="."))
    sheet = Sheet(look, data.attrs["title"], [";  ".join(facts)], rows, [PANEL] * len(rows))
    h = at["h_max"].values
    across = scale("longest element edge h", h, str(data["h_max"].attrs["units"]))
    for symbol, title, names in groups:
        panel = Lines(sheet.panels[symbol], across, Scale("relative error"))
        _errors(panel, at, h, names)
        panel.axes.set_title(f"{math_symbol(symbol)}: {math_symbol(title)}", loc="left")
    return sheet.finish(), words or data.attrs["title"]


def _verdict(at: Any, name: str) -> str:
    return VERDICTS[int(at[f"verdict_{name}"])]


def _drawable(at: Any, name: str) -> bool:
    """Whether there is an error to draw; rounding is none."""
    return shown(at, name) and _verdict(at, name) != "exact" and bool((at[f"error_{name}"] > 0).any())


def _two_points(at: Any, name: str) -> bool:
    """Whether the rate is that of two levels, so that nothing says how far to trust it."""
    return bool(np.isfinite(at[f"slope_{name}"]) and not np.isfinite(at[f"slope_error_{name}"]))


def _errors(panel: Lines, at: Any, h: Array, names: list[str]) -> None:
    """Errors over h on logarithmic scales; solutions that did not converge are hollow and joined to nothing."""
    axes, ok = panel.axes, at["status"].values == int(PointStatus.OK)
    axes.set(xscale="log", yscale="log")
    for name, look in zip(names, LOOKS, strict=False):
        error, guess = at[f"error_{name}"].values, _two_points(at, name)
        good, bad = ok & (error > 0), ~ok & (error > 0)
        dashed = guess or _verdict(at, name) == "pre_asymptotic"
        slope = sentences.order(float(at[f"slope_{name}"]), float(at[f"slope_error_{name}"]))
        label = math_symbol(_SYMBOLS[name]) + ("" if slope == "–" else f": {slope}")
        how = look | {"linestyle": "--" if dashed else "-", "alpha": 0.45 if guess else 1.0, "label": label}
        panel.line(h[good], error[good], **how, markerfacecolor="white" if look is LOOKS[0] else None)
        panel.line(h[bad], error[bad], **look | {"linestyle": "none", "fillstyle": "none"})
    _triangles(panel, at, h, names, ok)
    panel.grid()
    axes.minorticks_off()
    drawn = np.array([at[f"error_{name}"].values > 0 for name in names]).any(axis=0)
    axes.set_xticks(panel.x(h[drawn]), [f"{value:.2g}" for value in panel.x(h[drawn])])
    low, high = np.log10(axes.get_ylim())
    room = (LEGEND_LINE * len(names) + 0.05) / PANEL  # below all curves, so that the legend covers none
    axes.set_ylim(10 ** (high - (high - low) / (1 - room)), 10**high)
    left, right = np.log10(np.quantile(panel.x(h[drawn]), [0.0, 1.0]))
    span = (right - left) or 1.0
    axes.set_xlim(10 ** (left - BESIDE * span), 10 ** (right + 0.06 * span))
    style.few_ticks(axes.yaxis)
    axes.legend(loc="lower right", frameon=False, fontsize=style.pt(8.5), handlelength=1.6, borderaxespad=0.1)


def _triangles(panel: Lines, at: Any, h: Array, names: list[str], ok: Any) -> None:
    """At the finest step a triangle for each expected order: above the highest curve, below the others."""
    curves: dict[float, tuple[float, float, float, float]] = {}
    finest: list[float] = []
    for name in names:
        error = np.where(ok, at[f"error_{name}"].values, np.nan)
        known, order = np.flatnonzero(error > 0), round(float(at[f"expected_{name}"]), 2)
        finest += error[known[-1:]].tolist()
        if order > 0 and len(known) >= 2:
            a, b = known[-2:]
            if order not in curves or error[b] < curves[order][3]:
                curves[order] = (h[a], error[a], h[b], error[b])
    highest = max(curves, key=lambda order: curves[order][3], default=0.0) if len(curves) > 1 else 0.0
    for order, (right, coarse, left, fine) in curves.items():
        steep = (right / left) ** order
        above = order == highest
        top = (
            APART * max(fine * steep, coarse, *(e * steep for e in finest))
            if above
            else min(coarse, fine * steep) / APART
        )
        low = top / steep
        corner = (left, top) if above else (right, low)
        x, y = panel.x([left, right, corner[0]]), [low, top, corner[1]]
        panel.axes.fill(x, y, facecolor="none", edgecolor=style.PALE, linewidth=0.9)
        how = {"va": "center", "ha": "right" if above else "left", "fontsize": style.pt(8.5)}
        note(panel.axes, f"{order:g}", (x[2], np.sqrt(low * top)), (-3 if above else 3, 0), **how)


def math_symbol(symbol: str) -> str:
    """A symbol of the tables for matplotlib."""
    for plain, tex in (("u_T", "$u_T$"), ("Γ_C", r"$\Gamma_C$"), ("θ", r"$\theta$"), ("ξ", r"$\xi$")):
        symbol = symbol.replace(plain, tex)
    return symbol


# -- errors over time and unknowns -------------------------------------------------------------------------------------

GOLD = "#f0c000"
COLOURS = dict(zip((*FAMILIES, OWN), (style.INK, style.VERMILLION, style.BLUE, style.GREEN), strict=True))
MARKS = dict(zip((*FAMILIES, OWN), "sDo^", strict=True))
LINES: tuple[Any, ...] = ("-", (0, (1.2, 1.6)), (0, (4, 2)), (0, (4, 2, 1, 2)))
"""Line styles of the first, second … solver."""
CHART = 3.6
"""Height of the panels with the key above them [inch]."""
PALE = 0.32
"""Opacity of curves that others beat everywhere."""


def draw_cost(path: Path, measure: str | None, look: style.Look) -> tuple[Figure, str]:
    """The chart of accuracy against cost, and what it shows. Raises DrawError if the file has no such error."""
    data = load_root(path, "cost")
    name = measure_of(data, measure)
    return cost_figure(data, name, look), f"{SYMBOLS[name]}, {data.attrs['point'] or data.attrs['title']}"


def cost_figure(data: Any, measure: str, look: style.Look) -> Figure:
    """Error over wall time, with bands to the upper quartile, and over unknowns, with the rates of the families."""
    found = settings(data, measure)
    facts = [style.point_words(data.attrs["point"]), f"reference: {data.attrs['reference']}"]
    sheet = Sheet(look, data.attrs["title"], facts, [("time", "unknowns")], [CHART], advice(found))
    error = Scale(f"relative error of {math_symbol(SYMBOLS[measure])}")
    time = Lines(sheet.panels["time"], Scale("wall time [s]: least of all runs, band to the upper quartile"), error)
    unknowns = Lines(sheet.panels["unknowns"], Scale("displacement unknowns N"), error)
    families, solvers = (data[name].values.tolist() for name in ("family", "solver"))
    worthy, champion = {s.curve for s in front(found)}, best(found)
    for family in families:
        how: dict[str, Any] = {"color": COLOURS[family], "marker": MARKS[family], "markersize": 4.5}
        unknowns.line([], [], **how, label=family)
        for k, solver in enumerate(solvers):
            own = [s for s in found if s.curve == (family, solver) and s.error > 0 and s.time > 0]
            solved = [s for s in own if s.solved]
            dash, alpha = LINES[k % len(LINES)], 1.0 if (family, solver) in worthy else PALE
            t, e, upper, n = np.array([(s.time, s.error, s.upper, s.n_dof) for s in solved]).reshape(-1, 4).T
            time.axes.fill_betweenx(e, t, upper, color=COLOURS[family], alpha=0.16 * alpha, linewidth=0)
            width = 2.2 if (family, solver) == champion else 1.2
            time.line(t, e, color=COLOURS[family], linestyle=dash, linewidth=width, alpha=alpha)
            for s in own:
                face = "white" if not s.solved or s.dominated else None
                time.line(s.time, s.error, **how, linestyle="none", markerfacecolor=face, alpha=alpha)
            if k == 0:
                unknowns.line(n, e, **how, linewidth=1.2)
                steep = f"$N^{{{np.polyfit(np.log(n[-3:]), np.log(e[-3:]), 1)[0]:.2f}}}$" if len(n) > 2 else ""
                if steep and e.max() > EXACT:
                    note(unknowns.axes, steep, (n[-1], e[-1]), (7, 3), color=COLOURS[family], fontsize=style.pt(9))
    for k, solver in enumerate(solvers):
        time.line([], [], color=style.INK, linestyle=LINES[k % len(LINES)], linewidth=1.2, label=solver)
    if champion is not None:  # named in the corner that falling curves leave free
        how = {"color": COLOURS[champion[0]], "fontweight": "bold", "fontsize": style.pt(8.5)}
        time.axes.text(0.03, 0.04, f"fastest: {', '.join(champion)}", transform=time.axes.transAxes, **how)
    _own(time, unknowns, next((s for s in found if s.own and np.isfinite(s.error)), None))
    ink = {"color": style.INK, "marker": "o", "markersize": 4.5, "linestyle": "none"}
    time.line([], [], **ink, label="best at its error")
    if not all(s.solved and not s.dominated for s in found):
        time.line([], [], **ink, markerfacecolor="white", label="open: beaten, or not converged")
    errors = [s.error for s in found if s.error > 0]
    for panel in (time, unknowns):
        panel.axes.set(xscale="log", yscale="log", ylim=(min(errors) / 1.6, max(errors) * 1.6))
        panel.grid()
        for axis in (panel.axes.xaxis, panel.axes.yaxis):
            style.few_ticks(axis)
    unknowns.axes.margins(x=0.15)
    if len(sheet.heights) == 1:
        unknowns.axes.set_ylabel("")
        unknowns.axes.tick_params(which="both", labelleft=False)
    sheet.key("unknowns", "time", place="upper left")
    return sheet.finish()


def _own(time: Lines, unknowns: Lines, own: Setting | None) -> None:
    """A star at the study's own settings; white inside where another setting is better in both."""
    if own is None:
        return
    star = {"marker": "*", "markersize": 13, "markeredgecolor": style.INK, "linestyle": "none"}
    star |= {"color": "white" if own.dominated else GOLD}
    time.line(own.time, own.error, **star, label="the study's own" + " (beaten)" * own.dominated)
    unknowns.line(own.n_dof, own.error, **star)
