"""The picture of a fit: data with their noise, the fitted curve with its folds and band, residuals, the fitted law."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from tcstudy.data.store import load_root
from tcstudy.reports.figures import style
from tcstudy.reports.figures.panels import Lines, Scale, scale
from tcstudy.reports.figures.sheet import Sheet
from tcstudy.reports.terminal.fit import BAND, columns, prediction_error
from tcstudy.reports.text import number, prefix, pretty

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

CURVE, REST = 2.75, 1.4
"""Heights of the curve and of the panels below it [inch]."""
DATA: dict[str, Any] = {"color": style.INK, "marker": "o", "markersize": 3, "linestyle": "none", "linewidth": 0.7}
FITTED: dict[str, Any] = {"color": style.BLUE, "linewidth": 1.2, "zorder": 3}
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


def fit_figure(data: Any, look: style.Look) -> Figure:
    """The figure of a fit; call it within `style.styled()` for its letters."""
    rows = (("curve", "curve"), ("residuals", "law" if "law_slip" in data else "residuals"))
    sheet = Sheet(look, data.attrs["title"], [_caption(data)], rows, (CURVE, REST))
    _curve(sheet.panels["curve"], data)
    residuals = Lines(sheet.panels["residuals"], Scale("number of the datum"), Scale("residual / noise"))
    residuals.zero()
    residuals.axes.axhspan(-BAND, BAND, color=style.SHADE, alpha=0.5, linewidth=0, zorder=0)
    column = data["measured_column"].values
    for i in np.unique(column):
        own = np.flatnonzero(column == i)
        first = 1 if len(own) > 1 else own[0] + 1  # a fold or a peak stands behind the table
        residuals.line(first + np.arange(len(own)), data["residual"].values[own], **(DATA | {"marker": "osD^"[i % 4]}))
    if "law_slip" in data:
        _law(sheet.panels["law"], data)
    return sheet.finish()


def _caption(data: Any) -> str:
    found = []
    for i, name in enumerate(data["parameter"].values):
        divisor, unit = prefix([float(data["estimate"][i])], str(data["parameter_units"].values[i]))
        value, error = (float(data[key][i]) / divisor for key in ("estimate", "standard_error"))
        told = f"{style.symbol(str(name))} = {number(value)} ± {number(error, 2)} {pretty(unit)}".rstrip()
        found.append(told.replace(" ", "\xa0"))  # no line ends within it
    return ",  ".join(found)


def _curve(axes: Axes, data: Any) -> None:
    """Data and curve of the first measured column, with its band of 95 %."""
    given, measured = columns(data)
    own, path = data["measured_column"].values == 0, "curve_given" in data
    names = ("datum_given", "datum", "predicted_given", "predicted", "noise")
    x, y, at, fitted, noise = (data[name].values[own] for name in names)
    error = BAND * prediction_error(data)[own]
    label = style.symbol(given[0][0]) if given else "datum"
    across = scale(label, x, given[0][1] if given else "1")
    panel = Lines(axes, across, scale(NAMES[measured[0][0]], y, measured[0][1]))
    if path:
        curve = np.stack([data["curve_given"].values, data["curve_measured"].values])
        panel.line(*curve, **FITTED)
        if "fold_vertex" in data:
            panel.line(*curve[:, data["fold_vertex"].values], color=style.VERMILLION, marker="o", markersize=4,
                       markerfacecolor="white", linestyle="none", zorder=4, label="fold")  # fmt: skip
        # the band lies across the curve, at the feet of the data, in units of the noise of both
        size = np.array([float(data.attrs["given_noise"]), float(noise[0])])
        feet = np.stack([at, fitted], axis=1) / size
        way = np.gradient(feet, axis=0)
        normal = np.stack([-way[:, 1], way[:, 0]], axis=1) / np.maximum(np.hypot(*way.T), 1e-300)[:, None]
        sides = [feet + sign * (error / noise)[:, None] * normal for sign in (1.0, -1.0)]
        ring = np.concatenate([sides[0], sides[1][::-1]]) * size / [panel.x.one, panel.y.one]
        axes.fill(*ring.T, color=style.BLUE, alpha=0.25, linewidth=0, zorder=1, label="95 % band")
    else:
        order = np.argsort(at, kind="stable")
        panel.line(at[order], fitted[order], **FITTED)
        panel.band(at[order], (fitted - error)[order], (fitted + error)[order], label="95 % band")
    spread = float(data.attrs["given_noise"]) / panel.x.one if path else None
    axes.errorbar(panel.x(x), panel.y(y), panel.y(noise), spread, elinewidth=0.5, label="data", zorder=2, **DATA)
    for i, (name, _) in enumerate(measured):
        if name in ("fold", "peak"):
            value = data["datum"].values[data["measured_column"].values == i][0]
            mark, one = (axes.axvline, panel.x) if name == "fold" else (axes.axhline, panel.y)
            mark(float(one(value)), color=style.INK, lw=0.7, ls=(0, (4, 3)), label=f"measured {name}")
    panel.window(x, np.append(y, 0.0) if y.min() > 0.0 else y, (0.06, 0.08))
    axes.legend(fontsize=style.pt(8), framealpha=0.85, edgecolor="none")


def _law(axes: Axes, data: Any) -> None:
    slip, traction, error = (data[f"law_{name}"].values for name in ("slip", "traction", "error"))
    units = (str(data[name].attrs["units"]) for name in ("law_slip", "law_traction"))
    panel = Lines(axes, *map(scale, ("slip", "traction"), (slip, traction), units))
    panel.band(slip, traction - BAND * error, traction + BAND * error)
    panel.line(slip, traction, **FITTED)
    axes.set_xlim(0.0, float(panel.x(slip[-1])))
    axes.set_ylim(float(panel.y(np.min(traction - BAND * error, initial=0.0))), None)
