"""Panels of lines and marks, and of cells in colours, as records: matplotlib draws them here, the page in its scripts.

The third kind is the body (`body`). What is drawn is given in the units of the file; an axis counts in the unit that
suits its numbers, and says it. What has a label stands in the key of the sheet. Looks are those of Axes.plot: color,
linewidth, linestyle, marker, markersize, markerfacecolor, alpha, zorder.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
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


@dataclass
class Panel:
    """What is drawn over two axes, in order.

    title:  above it, at the left
    log:    whether x and y are logarithmic;  grid: whether fine lines stand at the ticks
    limits: ends of the two axes, None for what fits, as of Axes.set_xlim [drawn units]
    ticks:  places on the x axis and their texts, None for round numbers [drawn units]
    items:  (kind, x, y, look) of what is drawn [drawn units]
    """

    x: Scale
    y: Scale
    title: str = ""
    log: tuple[bool, bool] = (False, False)
    grid: bool = False
    limits: list[tuple[float | None, float | None] | None] = field(default_factory=lambda: [None, None])
    ticks: tuple[Any, Any] | None = None
    items: list[tuple[str, Any, Any, dict[str, Any]]] = field(default_factory=list)

    def _add(self, kind: str, x: ArrayLike, y: ArrayLike, how: dict[str, Any]) -> None:
        self.items.append((kind, np.atleast_1d(self.x(x)), np.atleast_1d(self.y(y)), how))

    def line(self, x: ArrayLike, y: ArrayLike, **how: Any) -> None:
        """A line or marks, as in Axes.plot."""
        self._add("line", x, y, how)

    def fill(self, x: ArrayLike, y: ArrayLike, **how: Any) -> None:
        """An area inside a ring."""
        self._add("fill", x, y, {"color": style.BLUE, "alpha": 0.25, "linewidth": 0} | how)

    def band(self, x: ArrayLike, low: ArrayLike, high: ArrayLike, **how: Any) -> None:
        """What lies between two lines."""
        both = [np.concatenate([np.asarray(one), np.asarray(other)[::-1]]) for one, other in ((x, x), (low, high))]
        self.fill(*both, **how)

    def across(self, value: float, **how: Any) -> None:
        """A horizontal line all across."""
        self._add("across", 0.0, value, {"color": style.SHADE, "linewidth": 0.8, "zorder": 0} | how)

    def up(self, value: float, **how: Any) -> None:
        """A vertical line from end to end."""
        self._add("up", value, 0.0, {"color": style.SHADE, "linewidth": 0.8, "zorder": 0} | how)

    def shade(self, low: float, high: float, upright: bool = True) -> None:
        """All that lies between two values of x, or of y."""
        ends = (low, high), (0.0, 0.0)
        x, y = ends if upright else ends[::-1]
        self._add("columns" if upright else "rows", x, y, {"color": style.SHADE})

    def note(self, text: str, at: Sequence[float], shift: tuple[float, float] = (0.0, 0.0), **how: Any) -> None:
        """A text beside a place, or above it at the upper edge (`top`), shifted by (x, y) points.

        how: ha, va, fontsize (among usual letters) … as of Axes.annotate
        """
        self._add("note", at[0], at[1], how | {"text": text, "shift": shift})

    def arrow(self, start: Sequence[float], end: Sequence[float], head: float = 12.0, **how: Any) -> None:
        """An arrow with a head so large [pt]."""
        x, y = np.array([start, end], dtype=float).T
        self._add("arrow", x, y, how | {"head": head})

    def names(self, x: ArrayLike, y: ArrayLike, texts: Sequence[str]) -> None:
        """Texts beside dots, each once, where neither another nor the edge is in the way, nor, if it can be, a line."""
        self._add("names", x, y, {"texts": list(texts)})

    def cells(self, x: ArrayLike, y: ArrayLike, kinds: Any, colours: Sequence[str], names: Sequence[str]) -> None:
        """Cells between edges x (n + 1) and y (m + 1), coloured by their kind (n, m); −1 is blank."""
        self._add("cells", x, y, {"kinds": np.asarray(kinds), "colours": list(colours), "names": list(names)})

    def window(self, x: Array, y: Array, room: tuple[float, float] = (0.0, 0.0)) -> None:
        """Show all of x and y, and parts of their ranges beyond."""
        for k, (values, share) in enumerate(((self.x(x), room[0]), (self.y(y), room[1]))):
            wide = float(np.ptp(values)) or 1.0
            self.limits[k] = float(values.min()) - share * wide, float(values.max()) + share * wide

    def draw(self, axes: Axes) -> None:
        """Draw it with matplotlib; names come with `place_names`, after the layout."""
        axes.set(xlabel=self.x.label, ylabel=self.y.label)
        if self.title:
            axes.set_title(self.title, loc="left")
        for name, logarithmic in zip(("xscale", "yscale"), self.log, strict=True):
            if logarithmic:
                axes.set(**{name: "log"})
        for kind, x, y, how in self.items:
            match kind:
                case "line":
                    axes.plot(x, y, **how)
                case "fill":
                    axes.fill(x, y, **how)
                case "across":
                    axes.axhline(y[0], **how)
                case "up":
                    axes.axvline(x[0], **how)
                case "columns":
                    axes.axvspan(*x, linewidth=0, zorder=0, **how)
                case "rows":
                    axes.axhspan(*y, linewidth=0, zorder=0, alpha=0.5, **how)
                case "note":
                    rest = {key: value for key, value in how.items() if key not in ("text", "shift", "top")}
                    rest["fontsize"] = style.pt(how.get("fontsize", style.USUAL))
                    if "top" in how:
                        y, rest["xycoords"] = np.array([1.0]), axes.get_xaxis_transform()
                    note(axes, how["text"], (x[0], y[0]), how["shift"], **rest)
                case "arrow":
                    shape = {"arrowstyle": "-|>", "mutation_scale": how["head"], "shrinkA": 0, "shrinkB": 0}
                    shape |= {key: value for key, value in how.items() if key in ("color", "linewidth")}
                    axes.annotate("", (x[1], y[1]), (x[0], y[0]), arrowprops=shape, zorder=6)
                case "cells":
                    _draw_cells(axes, x, y, **how)
        puts: tuple[Any, Any] = axes.set_xlim, axes.set_ylim
        for limits, put in zip(self.limits, puts, strict=True):
            if limits is not None:
                put(*limits)
        if self.ticks is not None:
            axes.set_xticks(list(self.ticks[0]), list(self.ticks[1]))
        if self.grid:
            axes.grid(True, which="major", color=style.SHADE, linewidth=0.6)
            axes.set_axisbelow(True)


def _draw_cells(
    axes: Axes, x: Array, y: Array, kinds: NDArray[Any], colours: Sequence[str], names: Sequence[str]
) -> None:
    from matplotlib.colors import BoundaryNorm, ListedColormap

    if not kinds.size:
        return
    norm = BoundaryNorm(np.arange(len(colours) + 1) - 0.5, len(colours))
    shown = np.ma.masked_less(kinds.T, 0)
    axes.pcolormesh(x, y, shown, cmap=ListedColormap(colours), norm=norm, rasterized=True)
    for k in np.unique(shown.compressed()):
        axes.fill([], [], color=colours[k], label=names[k])


LETTER = 0.6
"""Width of a letter, of its height: that of wide words, so that none runs off the sheet."""
DOT = 20
"""How many places of a line weigh as much as another dot near a name, which could be taken for its own."""
NAMED = 60
"""Dots whose names may stand beside them."""


SIDES = ((1, 1.0), (-1, 1.0), (1, -1.0), (-1, -1.0), (0, 2.3), (0, -2.3))
"""Where a name may stand beside its dot: to which side, and how many letters above."""


def place_names(axes: Axes, panel: Panel) -> None:
    """The names of a panel, once its axes have their place."""
    from matplotlib.patheffects import withStroke

    letters, inch = style.pt(8.5), axes.figure.dpi / 72.0
    left, right = axes.bbox.x0 / inch + letters, axes.bbox.x1 / inch

    def placed(x: Array, y: Array) -> Array:
        return np.asarray(axes.transData.transform(np.column_stack([x, y])) / inch)

    share = np.linspace(0.0, 1.0, 60)[:, None, None]
    drawn = [placed(x, y) for kind, x, y, _ in panel.items if kind == "line" and len(x) > 1]
    curve = np.concatenate([((1.0 - share) * xy[:-1] + share * xy[1:]).reshape(-1, 2) for xy in drawn])
    taken: dict[str, tuple[Array, Array]] = {}
    for _, xs, ys, how in (item for item in panel.items if item[0] == "names"):
        dots = placed(xs, ys)
        for name, x, y, dot in list(zip(how["texts"], xs, ys, dots, strict=True))[:NAMED]:
            half, others = (
                0.5 * letters * np.array([LETTER * len(name), 1.0]),
                dots[np.hypot(*(dots - dot).T) > letters],
            )
            free = list[tuple[int, float, float]]()
            for side, up in SIDES if name not in taken else ():
                shift = np.array([side * (6.0 + half[0]), up * letters])
                centre = dot + shift
                apart = (np.any(np.abs(centre - other) > wide + half) for other, wide in taken.values())
                if left < centre[0] - half[0] and centre[0] + half[0] <= right and all(apart):
                    hits = int(np.all(np.abs(curve - centre) < half, axis=1).sum())
                    hits += DOT * int(np.all(np.abs(others - centre) < half + letters, axis=1).sum())
                    free.append((hits, *shift.tolist()))
            if free:
                _, *moved = min(free, key=lambda one: one[0])
                taken[name] = dot + moved, half
                white = [withStroke(linewidth=2.0, foreground="white")]
                note(axes, name, (x, y), moved, ha="center", va="center", fontsize=letters, path_effects=white)


def note(axes: Axes, text: str, at: Any, shift: Any, **how: Any) -> None:
    """A text beside a place of the data, shifted by (x, y) points."""
    axes.annotate(text, tuple(at), tuple(shift), textcoords="offset points", **how)


def contact_nodes(data: Any) -> tuple[NDArray[np.intp], Scale, Array]:
    """Of a stored contact line: its nodes along the arclength, the axis of that, and the ends of their segments."""
    order = np.argsort(data["arclength"].values, kind="stable")
    ends = np.concatenate([[0.0], np.cumsum(data["c"].values[order])])
    return order, scale("arclength", ends, str(data["arclength"].attrs["units"])), ends
