"""The picture of a fit: data with their noise, the fitted curve with its folds and band, residuals, the fitted law."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from tcstudy.reports.figures import style
from tcstudy.reports.figures.panels import Panel, Scale, scale
from tcstudy.reports.figures.sheet import Sheet
from tcstudy.reports.terminal.fit import BAND, columns, prediction_error
from tcstudy.reports.text import number, prefix, pretty

if TYPE_CHECKING:
    from matplotlib.figure import Figure

CURVE, REST = 2.75, 1.4
"""Heights of the curve and of the panels below it [inch]."""
DATA: dict[str, Any] = {"color": style.INK, "marker": "o", "markersize": 3, "linestyle": "none"}
FITTED: dict[str, Any] = {"color": style.BLUE, "linewidth": 1.2, "zorder": 3}
NAMES = {
    "friction_resultant": r"friction resultant $\int\xi$",
    "u_T_max": "max $|u_T|$",
    "theta_mean": r"mean $\theta$",
    "u_T": "$u_T$",
}


def fit_figure(data: Any, look: style.Look) -> Figure:
    """The figure of a fit; call it within `style.styled()` for its letters."""
    panels = fit_panels(data)
    rows = (("curve", "curve"), ("residuals", "law" if "law" in panels else "residuals"))
    sheet = Sheet(look, data.attrs["title"], [caption(data)], rows, (CURVE, REST))
    sheet.draw(panels)
    sheet.panels["curve"].legend(fontsize=style.pt(8), framealpha=0.85, edgecolor="none")
    return sheet.finish()


def fit_panels(data: Any) -> dict[str, Panel]:
    """Its panels by name: the curve of the first measured column, residuals, the law, curves of other columns."""
    _, measured = columns(data)
    found = {"curve": _curve(data, 0), "residuals": _residuals(data)}
    found |= {"law": _law(data)} if "law_slip" in data else {}
    more = range(1, len(measured))
    return found | {f"curve {i}": _curve(data, i) for i in more}


def caption(data: Any) -> str:
    """The numbers found with their standard errors."""
    found = []
    for i, name in enumerate(data["parameter"].values):
        divisor, unit = prefix([float(data["estimate"][i])], str(data["parameter_units"].values[i]))
        value, error = (float(data[key][i]) / divisor for key in ("estimate", "standard_error"))
        told = f"{style.symbol(str(name))} = {number(value)} ± {number(error, 2)} {pretty(unit)}".rstrip()
        found.append(told.replace(" ", "\xa0"))  # no line ends within it
    return ",  ".join(found)


def _residuals(data: Any) -> Panel:
    panel = Panel(Scale("number of the datum"), Scale("residual / noise"))
    panel.shade(-BAND, BAND, upright=False)
    panel.across(0.0)
    column = data["measured_column"].values
    for i in np.unique(column):
        own = np.flatnonzero(column == i)
        panel.line(1 + np.arange(len(own)), data["residual"].values[own], **(DATA | {"marker": "osD^"[i % 4]}))
    return panel


def _curve(data: Any, i: int) -> Panel:
    """Data and curve of a measured column, with its band of 95 %."""
    given, measured = columns(data)
    own, path = data["measured_column"].values == i, "curve_given" in data and i == 0
    names = ("datum_given", "datum", "predicted_given", "predicted", "noise")
    x, y, at, fitted, noise = (data[name].values[own] for name in names)
    error = BAND * prediction_error(data)[own]
    label = style.symbol(given[0][0]) if given else "datum"
    what, _, file = measured[i][0].partition(" in ")  # of several tests
    title = NAMES.get(what, style.plain(what)) + (f", {style.plain(file)}" if file else "")
    panel = Panel(scale(label, x, given[0][1] if given else "1"), scale(title, y, measured[i][1]))
    spread = float(data.attrs["given_noise"]) if path else 0.0
    if path:
        curve = np.stack([data["curve_given"].values, data["curve_measured"].values])
        panel.line(*curve, **FITTED, label="fit")
        if "fold_vertex" in data:
            panel.line(*curve[:, data["fold_vertex"].values], color=style.VERMILLION, marker="o", markersize=4,
                       markerfacecolor="white", linestyle="none", zorder=4, label="fold")  # fmt: skip
        # the band lies across the curve, at the feet of the data, in units of the noise of both
        size = np.array([spread, float(noise[0])])
        feet = np.stack([at, fitted], axis=1) / size
        way = np.gradient(feet, axis=0)
        normal = np.stack([-way[:, 1], way[:, 0]], axis=1) / np.maximum(np.hypot(*way.T), 1e-300)[:, None]
        sides = [feet + sign * (error / noise)[:, None] * normal for sign in (1.0, -1.0)]
        panel.fill(*(np.concatenate([sides[0], sides[1][::-1]]) * size).T, zorder=1, label="95 % band")
    else:
        order = np.argsort(at, kind="stable")
        panel.line(at[order], fitted[order], **FITTED, label="fit")
        panel.band(at[order], (fitted - error)[order], (fitted + error)[order], label="95 % band")
    gap = np.full(len(x), np.nan)
    for ends in ((x, x, gap, y - noise, y + noise, gap), (x - spread, x + spread, gap, y, y, gap)):
        panel.line(*(np.stack(part, axis=1).ravel() for part in (ends[:3], ends[3:])), color=style.INK, linewidth=0.5)
    panel.line(x, y, **DATA, label="data", zorder=2)
    panel.window(x, np.append(y, 0.0) if y.min() > 0.0 else y, (0.06, 0.08))
    return panel


def _law(data: Any) -> Panel:
    slip, traction, error = (data[f"law_{name}"].values for name in ("slip", "traction", "error"))
    units = [str(data[name].attrs["units"]) for name in ("law_slip", "law_traction")]
    panel = Panel(scale("slip", slip, units[0]), scale("traction", traction, units[1]))
    panel.band(slip, traction - BAND * error, traction + BAND * error)
    panel.line(slip, traction, **FITTED)
    least = float(panel.y(np.min(traction - BAND * error, initial=0.0)))
    panel.limits = [(0.0, float(panel.x(slip[-1]))), (least, None)]
    return panel
