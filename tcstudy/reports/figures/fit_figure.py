"""The picture of a fit: data with their noise, the fitted curve with its folds and band, residuals, the fitted law."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from tcstudy.data.store import load_root
from tcstudy.reports.figures import style
from tcstudy.reports.figures.sheet import Sheet
from tcstudy.reports.terminal.fit import BAND, columns, prediction_error
from tcstudy.reports.text import axis_unit, number, prefix, pretty

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

Array = NDArray[np.float64]

CURVE, REST = 2.75, 1.4
"""Heights of the curve and of the panels below it [inch]."""
DATA: dict[str, Any] = {"color": style.INK, "marker": "o", "markersize": 3, "linestyle": "none", "linewidth": 0.7}
NAMES = {
    "friction_resultant": "friction resultant",
    "u_T_max": "max $|u_T|$",
    "theta_mean": r"mean $\theta$",
    "u_T": "$u_T$",
}


def draw_fit(path: Path, look: style.Look) -> tuple[Figure, str]:
    """The picture of a fit's file, and what it shows."""
    data = load_root(path, "fit")
    return fit_figure(data, look), f"{data.attrs['title']}, fitted to {data.attrs['data_file']}"


def fit_figure(data: Any, look: style.Look | None = None) -> Figure:
    """The figure of a fit; call it within `style.styled()` for its letters."""
    panels = {"curve": _curve, "residuals": _residuals} | ({"law": _law} if "law_slip" in data else {})
    rows = (("curve", "curve"), ("residuals", "law" if "law" in panels else "residuals"))
    sheet = Sheet(look or style.Look(), data.attrs["title"], [_caption(data)], rows, (CURVE, REST))
    for name, draw in panels.items():
        draw(sheet.panels[name], data)
    return sheet.finish()


def _caption(data: Any) -> str:
    found = []
    for i, name in enumerate(data["parameter"].values):
        divisor, unit = prefix([float(data["estimate"][i])], str(data["parameter_units"].values[i]))
        value, error = (float(data[key][i]) / divisor for key in ("estimate", "standard_error"))
        sign = style.symbol(str(name))
        told = f"{sign} = {number(value)} ± {number(error, 2)} {pretty(unit)}".removesuffix(" 1")
        found.append(told.replace(" ", "\xa0"))  # no line ends within it
    return ",  ".join(found)


def _curve(axes: Axes, data: Any) -> None:
    """Data and curve of the first measured column."""
    given, measured = columns(data)
    own = data["measured_column"].values == 0
    x, y = data["datum_given"].values[own], data["datum"].values[own]
    across, x_unit = axis_unit(x, given[0][1] if given else "1")
    up, y_unit = axis_unit(y, measured[0][1])
    error = prediction_error(data)[own]
    at, fitted = data["predicted_given"].values[own], data["predicted"].values[own]
    if "curve_given" in data:
        axes.plot(data["curve_given"] / across, data["curve_measured"] / up, color=style.BLUE, linewidth=1.2, zorder=3)
        folds = data["fold_vertex"].values if "fold_vertex" in data else np.zeros(0, dtype=int)
        look: dict[str, Any] = {"color": style.VERMILLION, "marker": "o", "markersize": 4, "markerfacecolor": "white"}
        t, R = data["curve_given"].values[folds], data["curve_measured"].values[folds]
        axes.plot(t / across, R / up, linestyle="none", zorder=4, label="fold", **look)
        _oblique_band(axes, data, across, up)
    else:
        order = np.argsort(at, kind="stable")
        low, high = fitted - BAND * error, fitted + BAND * error
        axes.plot(at[order] / across, fitted[order] / up, color=style.BLUE, linewidth=1.2, zorder=3)
        axes.fill_between(at[order] / across, low[order] / up, high[order] / up, color=style.BLUE, alpha=0.25, lw=0)
    noise = data["noise"].values[own] / up
    across_noise = float(data.attrs["given_noise"]) / across if "curve_given" in data else None
    axes.errorbar(x / across, y / up, yerr=noise, xerr=across_noise, elinewidth=0.5, label="data", zorder=2, **DATA)
    for i, (name, _) in enumerate(measured):
        mark = data["datum"].values[data["measured_column"].values == i]
        how: dict[str, Any] = {"color": style.INK, "lw": 0.7, "ls": (0, (4, 3)), "label": f"measured {name}"}
        if name == "fold":
            axes.axvline(mark[0] / across, **how)
        elif name == "peak":
            axes.axhline(mark[0] / up, **how)
    room_x, room_y = 0.06 * np.ptp(x) / across, 0.08 * np.ptp(y) / up
    axes.set_xlim(x.min() / across - room_x, x.max() / across + room_x)
    axes.set_ylim(min(y.min(), 0.0) / up - room_y, y.max() / up + room_y)
    name = style.symbol(given[0][0]) if given else "datum"
    axes.set_xlabel(style.labelled(name, x_unit))
    axes.set_ylabel(style.labelled(NAMES[measured[0][0]], y_unit))
    axes.legend(fontsize=style.pt(8), framealpha=0.85, edgecolor="none")


def _oblique_band(axes: Axes, data: Any, across: float, up: float) -> None:
    """The band across the curve, at the feet of the data, in units of the noise of both; across, up: units drawn."""
    own = data["measured_column"].values == 0
    error = BAND * (prediction_error(data) / data["noise"].values)[own]
    t, R = data["predicted_given"].values[own], data["predicted"].values[own]
    scale = np.array([float(data.attrs["given_noise"]), float(data["noise"].values[0])])
    way = np.gradient(np.stack([t, R], axis=1) / scale, axis=0)
    length = np.maximum(np.linalg.norm(way, axis=1), 1e-300)
    normal = np.stack([-way[:, 1], way[:, 0]], axis=1) / length[:, None]
    sides = [np.stack([t, R], axis=1) + s * error[:, None] * normal * scale for s in (1.0, -1.0)]
    ring = np.concatenate([sides[0], sides[1][::-1]]) / [across, up]
    axes.fill(ring[:, 0], ring[:, 1], color=style.BLUE, alpha=0.25, linewidth=0, zorder=1, label="95 % band")


def _residuals(axes: Axes, data: Any) -> None:
    residual = data["residual"].values
    column = data["measured_column"].values
    for i in np.unique(column):
        own = column == i
        first = 1 if own.sum() > 1 else np.flatnonzero(own)[0] + 1  # a fold or a peak stands behind the table
        axes.plot(first + np.arange(own.sum()), residual[own], **(DATA | {"marker": "osD^"[i % 4]}))
    axes.axhline(0.0, color=style.SHADE, linewidth=0.8, zorder=0)
    axes.axhspan(-BAND, BAND, color=style.SHADE, alpha=0.5, linewidth=0, zorder=0)
    axes.set_xlabel("number of the datum")
    axes.set_ylabel("residual / noise")


def _law(axes: Axes, data: Any) -> None:
    slip, traction, error = (data[name].values for name in ("law_slip", "law_traction", "law_error"))
    across, x_unit = axis_unit(slip, data["law_slip"].attrs["units"])
    up, y_unit = axis_unit(traction, data["law_traction"].attrs["units"])
    low, high = (traction - BAND * error) / up, (traction + BAND * error) / up
    axes.fill_between(slip / across, low, high, color=style.BLUE, alpha=0.25, linewidth=0)
    axes.plot(slip / across, traction / up, color=style.BLUE, linewidth=1.2)
    axes.set_xlim(0.0, slip[-1] / across)
    axes.set_ylim(min(0.0, low.min()), 1.08 * high.max())
    axes.set_xlabel(style.labelled("slip", x_unit))
    axes.set_ylabel(style.labelled("traction", y_unit))
