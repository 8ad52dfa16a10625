"""Panels of lines and marks, and strips of colours; the third kind is the body (`body`).

What is drawn is given in the units of the file. An axis counts in the unit that suits its numbers, and says it; what
has a label stands in the key of the sheet.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tcstudy.reports.figures import style
from tcstudy.reports.text import axis_unit

if TYPE_CHECKING:
    from matplotlib.axes import Axes

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Scale:
    """An axis: its label with the unit that it counts in, and what is drawn as 1 [unit of the file]."""

    label: str
    one: float = 1.0

    def __call__(self, values: ArrayLike) -> Array:
        """Values of the file as they are drawn."""
        return np.asarray(values, dtype=float) / self.one


def scale(name: str, values: ArrayLike, units: str) -> Scale:
    """The axis that suits the largest of some values of the file."""
    one, unit = axis_unit(np.ravel(np.asarray(values, dtype=float)), units)
    return Scale(style.labelled(name, unit), one)


class Lines:
    """A panel of lines, marks and bands."""

    def __init__(self, axes: Axes, x: Scale, y: Scale) -> None:
        self.axes, self.x, self.y = axes, x, y
        axes.set(xlabel=x.label, ylabel=y.label)

    def line(self, x: ArrayLike, y: ArrayLike, **how: Any) -> None:
        """A line or marks, as in Axes.plot."""
        self.axes.plot(self.x(x), self.y(y), **how)

    def band(self, x: ArrayLike, low: ArrayLike, high: ArrayLike, **how: Any) -> None:
        """What lies between two lines."""
        look: dict[str, Any] = {"color": style.BLUE, "alpha": 0.25, "linewidth": 0} | how
        self.axes.fill_between(self.x(x), self.y(low), self.y(high), **look)

    def zero(self) -> None:
        """The line on which y is zero."""
        self.axes.axhline(0.0, color=style.SHADE, linewidth=0.8, zorder=0)

    def window(self, x: ArrayLike, y: ArrayLike, room: tuple[float, float] = (0.0, 0.0)) -> None:
        """Show all of x and y, and parts of their ranges beyond."""
        for values, share, put in ((self.x(x), room[0], self.axes.set_xlim), (self.y(y), room[1], self.axes.set_ylim)):
            wide = float(np.ptp(values)) or 1.0
            put(float(values.min()) - share * wide, float(values.max()) + share * wide)

    def grid(self) -> None:
        """Fine lines at the ticks, behind all else."""
        self.axes.grid(True, which="major", color=style.SHADE, linewidth=0.6)
        self.axes.set_axisbelow(True)


def note(axes: Axes, text: str, at: Any, shift: Any, **how: Any) -> None:
    """A text beside a place of the data, shifted by (x, y) points."""
    axes.annotate(text, tuple(at), tuple(shift), textcoords="offset points", **how)


def strip(
    axes: Axes, x: ArrayLike, y: ArrayLike, kinds: NDArray[Any], colours: Sequence[str], names: Sequence[str]
) -> None:
    """Cells between the edges x (n + 1) and y (m + 1), coloured by their kind (n, m); −1 is blank."""
    from matplotlib.colors import BoundaryNorm, ListedColormap

    if not kinds.size:
        return
    norm = BoundaryNorm(np.arange(len(colours) + 1) - 0.5, len(colours))
    shown = np.ma.masked_less(kinds.T, 0)
    axes.pcolormesh(np.asarray(x), np.asarray(y), shown, cmap=ListedColormap(colours), norm=norm, rasterized=True)
    for k in np.unique(shown.compressed()):
        axes.fill([], [], color=colours[k], label=names[k])


def contact_nodes(data: Any) -> tuple[NDArray[np.intp], Scale, Array]:
    """Of a stored contact line: its nodes along the arclength, the axis of that, and the ends of their segments."""
    order = np.argsort(data["arclength"].values, kind="stable")
    ends = np.concatenate([[0.0], np.cumsum(data["c"].values[order])])
    axis = scale("arclength", ends, str(data["arclength"].attrs["units"]))
    return order, axis, axis(ends)
