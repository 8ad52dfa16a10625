"""The plot of a convergence file: errors of one sweep point over h, with the slopes to expect."""

from __future__ import annotations

from collections.abc import Mapping
from itertools import zip_longest
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from tcstudy.data.measured import ERRORS, VERDICTS
from tcstudy.data.records import PointStatus
from tcstudy.data.store import load_root
from tcstudy.reports import sentences
from tcstudy.reports.figures import style
from tcstudy.reports.figures.sheet import Sheet
from tcstudy.reports.select_point import Value, describe, locate
from tcstudy.reports.terminal.convergence import GROUPS, shown
from tcstudy.reports.text import axis_unit

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

Array = NDArray[np.float64]

LOOKS = ((style.BLUE, "o"), (style.VERMILLION, "s"), (style.INK, "^"))
"""Colour and marker of the first, second and third error of a panel."""
HIDDEN = 0.1
"""Relative difference up to which one curve hides another, as that in H¹ does the one in energy; it is then broad."""

PANEL, LEGEND_LINE = 2.55, 0.18
"""Height of a panel and of a line of its legend [inch]."""

BESIDE = 0.2
"""Room for the number of a triangle left of the finest mesh, as a part of the range of h."""

APART = 1.7
"""Factor between a curve and its triangle."""

_SYMBOLS = {measure.name: measure.symbol for measure in ERRORS}


def plot_convergence(path: Path, point: Mapping[str, Value] | None, look: style.Look) -> tuple[Figure, str]:
    """The errors of one sweep point, the first unless named, and which it is.

    Raises DrawError if there is no such point or nothing to draw.
    """
    data = load_root(path)
    where = locate(data, point)
    at = data.isel(where)
    groups = [(s, words, [n for n in names if _drawable(at, n)]) for s, words, names in GROUPS]
    groups = [(s, words, names) for s, words, names in groups if names]
    if not groups:
        raise style.DrawError("the file has no errors to draw: no reference was there, or all errors are rounding")
    words = describe(data, where)
    return _figure(data, at, words, groups, look), words or data.attrs["title"]


def _drawable(at: Any, name: str) -> bool:
    """Whether there is an error to draw; rounding is none."""
    exact = int(at[f"verdict_{name}"]) == VERDICTS.index("exact") if shown(at, name) else True
    return not exact and bool((at[f"error_{name}"] > 0).any())


def _unsettled(at: Any, name: str) -> bool:
    return int(at[f"verdict_{name}"]) == VERDICTS.index("pre_asymptotic")


def _two_points(at: Any, name: str) -> bool:
    """Whether the rate is that of two levels, so that nothing says how far to trust it."""
    return bool(np.isfinite(float(at[f"slope_{name}"])) and not np.isfinite(float(at[f"slope_error_{name}"])))


def _marks(at: Any, names: list[str]) -> str:
    """What dashes and hollow points mean, where there are some."""
    words = []
    if any(_unsettled(at, name) for name in names):
        words.append("dashed: pre-asymptotic")
    if any(_two_points(at, name) for name in names):
        words.append(f"pale: a guess ({sentences.GUESS}) from two levels")
    if (at["status"].values != int(PointStatus.OK)).any():
        words.append("hollow: did not converge")
    return ";  ".join(["relative errors", *words])


def _figure(data: Any, at: Any, point: str, groups: list[tuple[str, str, list[str]]], look: style.Look) -> Figure:
    named = [style.point_words(point)] if point else []
    reference = f"reference: {str(data.attrs['reference']).split(' (')[0]}"
    marks = _marks(at, [n for g in groups for n in g[2]])
    symbols = [symbol for symbol, _, _ in groups]
    rows = list(zip_longest(symbols[::2], symbols[1::2], fillvalue="."))
    sheet = Sheet(look, data.attrs["title"], [";  ".join([*named, reference, marks])], rows, [PANEL] * len(rows))
    h = at["h_max"].values
    divisor, unit = axis_unit(h, data["h_max"].attrs["units"])
    for symbol, words, names in groups:
        axes = sheet.panels[symbol]
        _panel(axes, at, h / divisor, names, PANEL)
        axes.set_title(f"{math_symbol(symbol)}: {words.replace('Γ_C', math_symbol('Γ_C'))}", loc="left")
        axes.set_xlabel(style.labelled("longest element edge h", unit))
    return sheet.finish()


def _panel(axes: Axes, at: Any, h: Array, names: list[str], height: float) -> None:
    """Errors over h on logarithmic scales; solutions that did not converge are hollow and joined to nothing."""
    ok = at["status"].values == int(PointStatus.OK)
    for name, (color, marker) in zip(names, LOOKS, strict=False):
        error = at[f"error_{name}"].values
        good, bad = ok & (error > 0), ~ok & (error > 0)
        line = "--" if _unsettled(at, name) or _two_points(at, name) else "-"
        solid: dict[str, Any] = {"label": _label(at, name), "markersize": 5, "linewidth": 1.4, "linestyle": line}
        solid |= {"alpha": 0.45} if _two_points(at, name) else {}
        if any(_hides(at, other, name) for other in names[names.index(name) + 1 :]):
            solid |= {"markersize": 9, "linewidth": 3.2, "markerfacecolor": "white"}
        axes.loglog(h[good], error[good], color=color, marker=marker, **solid)
        axes.loglog(h[bad], error[bad], color=color, marker=marker, markersize=6, fillstyle="none", linestyle="")
    _triangles(axes, at, h, names, ok)
    axes.grid(True, which="major", color=style.SHADE, linewidth=0.6)
    axes.minorticks_off()
    drawn = np.array([(at[f"error_{n}"].values > 0) for n in names]).any(axis=0)
    axes.set_xticks(h[drawn], [f"{v:.2g}" for v in h[drawn]])
    low, high = np.log10(axes.get_ylim())
    room = (LEGEND_LINE * len(names) + 0.05) / height  # below all curves, so that the legend covers none
    axes.set_ylim(10 ** (high - (high - low) / (1 - room)), 10**high)
    left, right = np.log10([h[drawn].min(), h[drawn].max()])
    span = (right - left) or 1.0
    axes.set_xlim(10 ** (left - BESIDE * span), 10 ** (right + 0.06 * span))
    axes.set_ylabel("relative error")
    style.few_ticks(axes.yaxis)
    axes.legend(loc="lower right", frameon=False, fontsize=style.pt(8.5), handlelength=1.6, borderaxespad=0.1)


def _hides(at: Any, one: str, other: str) -> bool:
    """Whether one curve, drawn later, lies on another."""
    a, b = at[f"error_{one}"].values, at[f"error_{other}"].values
    both = (a > 0) & (b > 0)
    return bool(both.any() and np.all(np.abs(a[both] - b[both]) <= HIDDEN * b[both]))


def _label(at: Any, name: str) -> str:
    slope, error = float(at[f"slope_{name}"]), float(at[f"slope_error_{name}"])
    text = math_symbol(_SYMBOLS[name])
    if np.isfinite(slope):
        text += f": {slope:z.2f}" + (f" ± {error:.1g}" if np.isfinite(error) else sentences.GUESS)
    return text


def _triangles(axes: Axes, at: Any, h: Array, names: list[str], ok: NDArray[np.bool_]) -> None:
    """At the finest step a triangle for each expected order: above the highest curve, below the others."""
    curves: dict[float, tuple[float, float, float, float]] = {}
    errors = {name: np.where(ok, at[f"error_{name}"].values, np.nan) for name in names}
    for name, error in errors.items():
        order = round(float(at[f"expected_{name}"]), 2)
        if order > 0 and np.count_nonzero(error > 0) >= 2:
            a, b = np.flatnonzero(error > 0)[-2:]
            if order not in curves or error[b] < curves[order][3]:
                curves[order] = (h[a], error[a], h[b], error[b])
    highest = max(curves, key=lambda order: curves[order][3], default=0.0) if len(curves) > 1 else 0.0
    for order, (right, coarse, left, fine) in curves.items():
        steep = (right / left) ** order
        if order == highest:
            finest = [e[np.flatnonzero(e > 0)[-1]] for e in errors.values() if (e > 0).any()]
            low = APART * max(fine, coarse / steep, *finest)
            top = low * steep
            corners, place, shift, align = ([left, right, left], [low, top, top]), left, -3, "right"
        else:
            top = min(coarse, fine * steep) / APART
            low = top / steep
            corners, place, shift, align = ([left, right, right], [low, top, low]), right, 3, "left"
        axes.fill(*corners, facecolor="none", edgecolor=style.PALE, linewidth=0.9)
        axes.annotate(f"{order:g}", (place, np.sqrt(low * top)), (shift, 0), textcoords="offset points", va="center",
                      ha=align, color=style.INK, fontsize=style.pt(8.5))  # fmt: skip


def math_symbol(symbol: str) -> str:
    """A symbol of the tables for matplotlib."""
    for plain, tex in (("u_T", "$u_T$"), ("Γ_C", r"$\Gamma_C$"), ("θ", r"$\theta$"), ("ξ", r"$\xi$")):
        symbol = symbol.replace(plain, tex)
    return symbol
