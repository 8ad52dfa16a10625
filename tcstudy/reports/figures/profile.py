"""The profile of a point's body along a straight line: displacement, temperature, stresses, in pieces by material."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from tcstudy.errors import DrawError, UsageError
from tcstudy.reports.figures import style
from tcstudy.reports.figures.body import Field, field_of
from tcstudy.reports.figures.panels import Array, Panel, scale
from tcstudy.reports.figures.sheet import Sheet
from tcstudy.reports.picture import Picture
from tcstudy.reports.text import number, pretty
from tcstudy.scene.units import LENGTH, UnitError, split_quantity, to_si

if TYPE_CHECKING:
    from matplotlib.figure import Figure

SAMPLES = 1001
"""Points of a line; fields are linear in a triangle."""
HEIGHT = 2.2
GROUPS = (("u_x", "u_y"), ("theta",), ("sigma_x", "sigma_y", "tau_xy"))
"""What is drawn unless one is named, a panel each."""
LOOKS: tuple[dict[str, Any], ...] = (
    {"color": style.BLUE},
    {"color": style.VERMILLION, "linestyle": "--"},
    {"color": style.GREEN, "linestyle": ":"},
)
Ends = tuple[tuple[float, float], tuple[float, float]]


def ends_of(along: str | Ends) -> Array:
    """(2, 2) both ends of a line, of numbers [m] or of a text "0 mm, 5 mm: 200 mm, 5 mm". Raises UsageError."""
    remedy = 'give two points of the body, for example "0 mm, 5 mm: 200 mm, 5 mm"'
    try:
        if not isinstance(along, str):
            ends = np.array(along, dtype=float)
        else:
            ends = np.array([[_metres(one.strip()) for one in point.split(",")] for point in along.split(":")])
    except (TypeError, ValueError, UnitError) as error:
        raise UsageError(f"along: {along!r} is no line; {remedy}") from error
    if ends.shape != (2, 2) or not np.isfinite(ends).all() or np.array_equal(*ends):
        raise UsageError(f"along: {along!r} is no line; {remedy}")
    return ends


def _metres(text: str) -> float:
    quantity = split_quantity(text)
    return to_si(*quantity, LENGTH) if quantity else float(text)


def profile_figure(picture: Picture, look: style.Look, along: str | Ends, of: str | None = None) -> Figure:
    """The figure of one point: a panel each for displacement, temperature and stresses, or one for a field.

    Raises DrawError, UsageError.
    """
    ends, units = ends_of(along), picture.line.length_units
    share = np.linspace(0.0, 1.0, SAMPLES)
    places, s = ends[0] + share[:, None] * (ends[1] - ends[0]), share * float(np.hypot(*(ends[1] - ends[0])))
    panels = dict[str, Panel]()
    for group in ((of,),) if of is not None else GROUPS:
        fields = [field for name in group if (field := field_of(picture, name)) is not None]
        if not fields:
            continue
        curves = [_curves(picture, field, places) for field in fields]
        values = np.concatenate([curve for parts in curves for curve in parts])
        if not np.isfinite(values).any():
            raise DrawError("along: no point of this line lies in the body")
        symbols = [field.name.rpartition(" ")[2] for field in fields]
        y = scale(", ".join(symbols), values[np.isfinite(values)], fields[0].units)
        panel = panels[group[0]] = Panel(scale("distance along the line", s, units), y, fields[0].told)
        panel.across(0.0, color=style.PALE)
        panel.limits[0] = 0.0, float(panel.x(s[-1]))
        for parts, symbol, look_of in zip(curves, symbols, LOOKS, strict=False):
            for i, curve in enumerate(parts):
                panel.line(s, curve, linewidth=1.5, **look_of, **({"label": symbol} if i == 0 else {}))
    a, b = (", ".join(number(x) for x in end) for end in ends)
    facts = [style.point_words(picture.point), f"level {picture.level},  from ({a}) to ({b}) {pretty(units)}".rstrip()]
    sheet = Sheet(look, picture.title, facts, [[name] for name in panels], [HEIGHT] * len(panels))
    sheet.draw(panels)
    for name, panel in panels.items():
        if sum("label" in how for *_, how in panel.items) > 1:
            sheet.panels[name].legend(fontsize=style.pt(8), framealpha=0.85, edgecolor="none")
    sheet.share(*panels)
    return sheet.finish()


def _curves(picture: Picture, field: Field, places: Array) -> list[Array]:
    """Values (n,) of a field at places, of each of its parts, NaN outside of it."""
    from matplotlib.tri import LinearTriInterpolator, Triangulation

    assert picture.body is not None
    x, y = picture.body.xy.T
    found = list[Array]()
    for triangles, values in field.parts:
        values_at = LinearTriInterpolator(Triangulation(x, y, triangles), values)(*places.T)
        found.append(np.ma.filled(np.ma.asarray(values_at, dtype=float), np.nan))
    return found
