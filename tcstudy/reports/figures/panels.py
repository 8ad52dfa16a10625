"""Panels as records: lines, marks and coloured cells; and the sheet of any size that holds them.

matplotlib draws the panels here, the page in its scripts; the third kind is the body (`body`).
Values are given in the units of the file. An axis counts in the unit that suits its numbers, which
its label names. Items with a label stand in the key of the sheet. Looks are those of Axes.plot:
color, linewidth, linestyle, marker, markersize, markerfacecolor, alpha.

matplotlib's constrained layout finds the places on the sheet, but it does not look how long texts
are. So heading, facts, titles and labels are wrapped to the room that they have.
"""

from __future__ import annotations

import re
import textwrap
import warnings
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, NamedTuple, cast

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tcstudy.errors import DrawError
from tcstudy.reports.figures import style
from tcstudy.reports.text import axis_unit, headed

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.colorbar import Colorbar
    from matplotlib.figure import Figure

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Scale:
    """An axis: its label with the unit that it counts in, and that unit in the unit of the file."""

    label: str
    unit: float = 1.0

    def __call__(self, values: ArrayLike) -> Array:
        """Return values of the file as they are drawn."""
        return np.asarray(values, dtype=float) / self.unit


def scale(name: str, values: ArrayLike, units: str) -> Scale:
    """Return the axis that suits the largest of some values of the file."""
    divisor, unit = axis_unit(np.ravel(np.asarray(values, dtype=float)), units)
    return Scale(headed(name, unit), divisor)


AREA: dict[str, Any] = {"color": style.BLUE, "alpha": 0.25, "linewidth": 0}
REFERENCE: dict[str, Any] = {"color": style.SHADE, "linewidth": 0.8, "zorder": 0}
"""Looks of areas and of reference lines, by default."""


class Item(NamedTuple):
    """A line, an area, a text … of a panel, in drawn units."""

    kind: str
    x: Array
    y: Array
    look: dict[str, Any]


@dataclass
class Panel:
    """Items that are drawn over two axes, in order.

    title:  text above the panel, at the left
    log:    whether x and y are logarithmic;  grid: whether fine lines stand at the ticks
    limits: ends of the two axes, None for what fits, as of Axes.set_xlim [drawn units]
    ticks:  places on the x axis and their texts, None for round numbers [drawn units]
    """

    x: Scale
    y: Scale
    title: str = ""
    log: tuple[bool, bool] = (False, False)
    grid: bool = False
    limits: list[tuple[float | None, float | None] | None] = field(
        default_factory=lambda: [None, None]
    )
    ticks: tuple[Any, Any] | None = None
    items: list[Item] = field(default_factory=list)

    def _add(self, kind: str, x: ArrayLike, y: ArrayLike, look: dict[str, Any]) -> None:
        item = Item(kind, np.atleast_1d(self.x(x)), np.atleast_1d(self.y(y)), look)
        self.items.append(item)

    def line(self, x: ArrayLike, y: ArrayLike, **look: Any) -> None:
        """Add a line or marks, as in Axes.plot."""
        self._add("line", x, y, look)

    def fill(self, x: ArrayLike, y: ArrayLike, **look: Any) -> None:
        """Add the area inside a ring."""
        self._add("fill", x, y, AREA | look)

    def band(self, x: ArrayLike, low: ArrayLike, high: ArrayLike, **look: Any) -> None:
        """Add the area between two lines."""
        x_ring = np.concatenate([np.asarray(x), np.asarray(x)[::-1]])
        y_ring = np.concatenate([np.asarray(low), np.asarray(high)[::-1]])
        self.fill(x_ring, y_ring, **look)

    def across(self, value: float, **look: Any) -> None:
        """Add a horizontal line all across."""
        self._add("across", 0.0, value, REFERENCE | look)

    def up(self, value: float, **look: Any) -> None:
        """Add a vertical line from end to end."""
        self._add("up", value, 0.0, REFERENCE | look)

    def shade(
        self, low: float, high: float, upright: bool = True, color: str = style.SHADE
    ) -> None:
        """Shade the area between two values of x, or of y."""
        look = {"color": color, "linewidth": 0, "zorder": 0}
        if upright:
            self._add("columns", (low, high), 0.0, look)
        else:
            self._add("rows", 0.0, (low, high), look | {"alpha": 0.5})

    def note(
        self,
        text: str,
        place: Sequence[float],
        shift: tuple[float, float] = (0.0, 0.0),
        **look: Any,
    ) -> None:
        """Add a text beside a place, or at the upper edge (`top`), shifted by (x, y) points.

        look: ha, va, fontsize (among usual letters) … as of Axes.annotate
        """
        self._add("note", place[0], place[1], look | {"text": text, "shift": shift})

    def arrow(
        self, start: Sequence[float], end: Sequence[float], head: float = 12.0, **look: Any
    ) -> None:
        """Add an arrow; head: size of its head [pt]."""
        x, y = np.array([start, end], dtype=float).T
        self._add("arrow", x, y, look | {"head": head})

    def names(self, x: ArrayLike, y: ArrayLike, texts: Sequence[str]) -> None:
        """Add texts beside dots, each once, clear of each other, the edge and lines."""
        self._add("names", x, y, {"texts": list(texts)})

    def cells(
        self, x: ArrayLike, y: ArrayLike, kinds: Any, colours: Sequence[str], names: Sequence[str]
    ) -> None:
        """Add cells between edges x (n + 1) and y (m + 1), coloured by kind (n, m); −1 is blank."""
        look = {"kinds": np.asarray(kinds), "colours": list(colours), "names": list(names)}
        self._add("cells", x, y, look)

    def window(self, x: Array, y: Array, room: tuple[float, float] = (0.0, 0.0)) -> None:
        """Show all of x and y, and parts of their ranges beyond the ends."""
        self.limits = [_window(self.x(x), room[0]), _window(self.y(y), room[1])]

    def draw(self, axes: Axes) -> None:
        """Draw the items with matplotlib; names come with `place_names`, after the layout."""
        axes.set(xlabel=style.math(self.x.label), ylabel=style.math(self.y.label))
        if self.title:
            axes.set_title(style.math(self.title), loc="left")
        is_x_log, is_y_log = self.log
        if is_x_log:
            axes.set_xscale("log")
        if is_y_log:
            axes.set_yscale("log")
        for item in self.items:
            _draw_item(axes, item)
        x_limits, y_limits = self.limits
        if x_limits is not None:
            axes.set_xlim(*x_limits)
        if y_limits is not None:
            axes.set_ylim(*y_limits)
        if self.ticks is not None:
            places, texts = self.ticks
            axes.set_xticks(list(places), list(map(style.math, texts)))
        if self.grid:
            axes.grid(True, which="major", color=style.SHADE, linewidth=0.6)
            axes.set_axisbelow(True)


def _window(values: Array, room: float) -> tuple[float, float]:
    """Return the ends of values, and a part of their range beyond them."""
    span = float(np.ptp(values)) or 1.0
    return float(values.min()) - room * span, float(values.max()) + room * span


def _draw_item(axes: Axes, item: Item) -> None:
    x, y, look = item.x, item.y, item.look
    if "label" in look:
        look = look | {"label": style.math(look["label"])}
    match item.kind:
        case "line":
            axes.plot(x, y, **look)
        case "fill":
            axes.fill(x, y, **look)
        case "across":
            axes.axhline(*y, **look)
        case "rows":
            axes.axhspan(*y, **look)
        case "up":
            axes.axvline(*x, **look)
        case "columns":
            axes.axvspan(*x, **look)
        case "note":
            _draw_note(axes, x, y, look)
        case "arrow":
            _draw_arrow(axes, x, y, look)
        case "cells":
            _draw_cells(axes, x, y, **look)


def _draw_note(axes: Axes, x: Array, y: Array, look: Mapping[str, Any]) -> None:
    note_keys = ("text", "shift", "top")
    text_look = {key: value for key, value in look.items() if key not in note_keys}
    text_look["fontsize"] = style.pt(look.get("fontsize", style.USUAL))
    place = x[0], y[0]
    if "top" in look:
        place = x[0], 1.0
        text_look["xycoords"] = axes.get_xaxis_transform()
    text = style.math(look["text"])
    axes.annotate(text, place, look["shift"], textcoords="offset points", **text_look)


def _draw_arrow(axes: Axes, x: Array, y: Array, look: Mapping[str, Any]) -> None:
    shape = {"arrowstyle": "-|>", "mutation_scale": look["head"], "shrinkA": 0, "shrinkB": 0}
    shape |= {key: look[key] for key in ("color", "linewidth") if key in look}
    axes.annotate("", (x[1], y[1]), (x[0], y[0]), arrowprops=shape, zorder=6)


def _draw_cells(
    axes: Axes,
    x: Array,
    y: Array,
    kinds: NDArray[Any],
    colours: Sequence[str],
    names: Sequence[str],
) -> None:
    from matplotlib.colors import BoundaryNorm, ListedColormap

    if not kinds.size:
        return
    norm = BoundaryNorm(np.arange(len(colours) + 1) - 0.5, len(colours))
    shown = np.ma.masked_less(kinds.T, 0)
    axes.pcolormesh(x, y, shown, cmap=ListedColormap(colours), norm=norm, rasterized=True)
    for k in np.unique(shown.compressed()):
        axes.fill([], [], color=colours[k], label=names[k])


LETTER_WIDTH = 0.6
"""Width of a letter, of the height of letters: of wide words, so that none runs off the sheet."""
LINE_HEIGHT = 1.4
"""Height of a line, of the height of letters."""
TEXT_WEIGHT = 1000
"""Covered places of lines that weigh as much as another covered text."""
MAX_LOOSE_DISTANCE = 15.0
"""Distance of a text from its place from which on a line joins them [pt]."""
AROUND = np.array([(1, 1), (-1, 1), (1, -1), (-1, -1), (0, 1.4), (0, -1.4)]) / 1.4
"""Directions from a dot to its name, in the order tried."""
GROUND = {"boxstyle": "round,pad=0.1", "facecolor": "white", "edgecolor": "none", "alpha": 0.75}
"""Look of the ground of a text."""
LEADER = {"arrowstyle": "-", "color": style.PALE, "linewidth": 0.6, "shrinkB": 0}
"""Look of the line from a place to a text far from it."""


class Labels:
    """Places texts one after the other where they cover nothing, or the least.

    The axes must have their place on the sheet.

    drawn: (k, 2) places of lines and marks that texts should not cover, as dense as letters are
    wide
    """

    def __init__(self, axes: Axes, drawn: Sequence[Array], letters: float = 8.5) -> None:
        self.axes = axes
        self.letters = style.pt(letters)
        self._texts = list[tuple[Array, Array]]()  # centres and half sizes of the texts [pt]
        self._drawn = self._in_points(np.concatenate(drawn))

    def _in_points(self, xy: Array) -> Array:
        return np.asarray(self.axes.transData.transform(xy) / self.axes.figure.dpi * 72.0)

    def put(
        self,
        text: str,
        places: Array,
        directions: Any,
        distances: Sequence[float] = (6.0,),
        upright: bool = False,
        optional: bool = False,
        **look: Any,
    ) -> None:
        """Put a text beside one of the places (k, 2), in its direction (k, 2).

        A text far from its place gets a line to it. An optional text is left out where others
        are everywhere.

        distances: distances from a place [pt], in the order tried; below 0 the other way
        upright:   whether the text is turned
        """
        lines = text.split("\n")
        size = np.array([LETTER_WIDTH * max(map(len, lines)), LINE_HEIGHT * len(lines)])
        half = 0.5 * self.letters * size
        if upright:
            half = half[::-1]
        dots = np.tile(self._in_points(places), (len(distances), 1))
        centres = self._centres(dots, directions, distances, half)
        costs = self._costs(centres, half)
        best = int(np.argmin(costs))
        if optional and costs[best] >= TEXT_WEIGHT:
            return
        self._texts.append((centres[best], half))
        shift = centres[best] - dots[best]
        if np.any(np.abs(shift) > half + MAX_LOOSE_DISTANCE):
            look["arrowprops"] = LEADER
        place = places[best % len(places)]
        look |= {"ha": "center", "va": "center", "rotation": 90.0 * upright}
        look |= {"fontsize": self.letters, "zorder": 6, "textcoords": "offset points"}
        self.axes.annotate(style.math(text), place, shift, bbox=GROUND, **look)

    def _centres(
        self, dots: Array, directions: Any, distances: Sequence[float], half: Array
    ) -> Array:
        """Return the centres of a text at all distances from all dots, inside the axes [pt]."""
        all_directions = np.tile(directions, (len(distances), 1))
        gaps = np.repeat(distances, len(dots) // len(distances))
        reach = gaps + np.copysign(np.abs(all_directions) @ half, gaps)
        centres = dots + all_directions * reach[:, None]
        box = np.array([self.axes.bbox.min, self.axes.bbox.max])
        low, high = box / self.axes.figure.dpi * 72.0
        return np.clip(centres, low + half, np.maximum(high - half, low + half))

    def _costs(self, centres: Array, half: Array) -> Array:
        """Return how much a text with these centres covers."""
        costs = np.zeros(len(centres), dtype=int)
        for index, centre in enumerate(centres):
            is_covered = np.all(np.abs(self._drawn - centre) < half + 2.0, axis=1)
            costs[index] = np.sum(is_covered)
        for centre, other_half in self._texts:
            is_overlapping = np.all(np.abs(centres - centre) < other_half + half, axis=1)
            costs += TEXT_WEIGHT * is_overlapping
        return costs


DOT_WEIGHT = 20
"""Places of a line that weigh as much as another dot, whose name a text beside it would seem."""
MAX_NAMES = 60
"""Dots that have names."""


def place_names(axes: Axes, panel: Panel) -> None:
    """Write the names of a panel, each once, after the layout of its axes."""
    share = np.linspace(0.0, 1.0, 60)[:, None, None]
    dense = []
    for item in panel.items:
        if item.kind == "line" and len(item.x) > 1:
            xy = np.column_stack([item.x, item.y])
            between = (1.0 - share) * xy[:-1] + share * xy[1:]
            dense.append(between.reshape(-1, 2))
    for item in panel.items:
        if item.kind != "names":
            continue
        dots = np.column_stack([item.x, item.y])
        labels = Labels(axes, [*dense, *[dots] * DOT_WEIGHT])
        names = item.look["texts"]
        for name in dict.fromkeys(names[:MAX_NAMES]):
            places = dots[[names.index(name)] * len(AROUND)]
            labels.put(name, places, AROUND, optional=True)


def contact_nodes(
    data: Any, arclength: str = "arclength", c: str = "c"
) -> tuple[NDArray[np.intp], Scale, Array]:
    """Return the nodes of a stored contact line along the arclength, its axis, the segment ends.

    arclength, c: variables of the nodes, of others than those that slip
    """
    order = np.argsort(data[arclength].values, kind="stable")
    ends = np.concatenate([[0.0], np.cumsum(data[c].values[order])])
    return order, scale("arclength", ends, str(data[arclength].attrs["units"])), ends


# -- the sheet -------------------------------------------------------------------------------------

SMALL = 0.9
"""Size of facts and keys, relative to the other letters."""
LARGE = 1.25
"""Size of the heading, relative to the other letters."""
LINE = 1.5
"""Height of a line, relative to its letters."""
LINE_SPACING = 1.45
"""The same in the count of matplotlib."""
EDGE = 0.6
"""Margin of the sheet, relative to letters."""
NARROW = 80
"""Letters side by side on a sheet below which its panels stand below each other."""
BESIDE = 60
"""Letters side by side on a sheet from which on a key may stand beside its panel."""
ROW_ROOM = 0.7
"""Room below a row of panels for its labels [inch of usual letters]."""
SAMPLE = 7
"""Letters that the sample of a line beside a label of a key takes, with the room around it."""
KEY_ROOM = 0.8
"""Room between keys and panels, relative to the letters of the keys."""
MIN_PANEL_SHARE = 0.3
"""Panels can shrink to this part of their usual height."""


@dataclass(frozen=True)
class TextBlock:
    """Lines of a sheet; size: of their letters, relative to the other ones."""

    lines: Sequence[str]
    size: float
    weight: str = "normal"

    def height(self, em: float) -> float:
        """Return the height of the lines [inch]; em: height of usual letters [inch]."""
        return LINE * self.size * em * len(self.lines)


class Sheet:
    """Draw into the `panels`, add keys and bars, then call `finish`.

    facts, feet: lines below the heading and at the foot of the sheet
    rows:        names of the panels by row, as of Figure.subplot_mosaic; on a narrow sheet all
                 panels stand below each other
    heights:     usual heights of the rows [inch]
    """

    def __init__(
        self,
        look: style.Look,
        heading: str,
        facts: Sequence[str],
        rows: Sequence[Sequence[str]] = (("",),),
        heights: Sequence[float] = (3.6,),
        feet: Sequence[str] = (),
    ) -> None:
        from matplotlib.figure import Figure

        self.look = look
        self.em = look.letters / 72.0
        self.width = look.size[0] if look.size else style.WIDTH
        self.columns = look.columns(self.width - 2 * EDGE * self.em)
        self.heights = heights
        if self.columns < NARROW:
            rows, self.heights = _stacked(rows, heights)
        head = TextBlock(self._wrapped([heading], LARGE), LARGE, "bold")
        fact = TextBlock(self._wrapped(facts, SMALL), SMALL)
        foot = TextBlock(self._wrapped([*feet, *look.remarks], SMALL), SMALL)
        head_height, fact_height, foot_height = (
            block.height(self.em) for block in (head, fact, foot)
        )
        self.height = self._height(head_height + fact_height + foot_height)

        size = self.width, self.height
        self.figure = Figure(size, dpi=look.dpi, layout="constrained")
        edge = EDGE * self.em
        self._write(head, edge)
        self._write(fact, edge + head_height)
        self._write(foot, self.height - edge - foot_height)
        above = head_height + fact_height + 2.0 * edge
        below = foot_height + edge * (1.0 + bool(foot_height))
        box = np.array([edge, below, self.width - 2.0 * edge, self.height - above - below])
        self._rect = tuple(box / np.array(size * 2))
        engine = cast("Any", self.figure.get_layout_engine())
        engine.set(rect=self._rect, w_pad=0.0, h_pad=0.0, hspace=0.05, wspace=0.03)
        mosaic: Any = [list(row) for row in rows]
        self.panels: dict[str, Axes] = self.figure.subplot_mosaic(
            mosaic, height_ratios=self.heights
        )
        if look.into is not None:
            self._replace_panel(look.into, look.panel)

    def _height(self, text_height: float) -> float:
        """Return the height of the sheet [inch]. Raises DrawError if it is requested too low."""
        panel_height, scale = sum(self.heights), self.look.letters / style.USUAL
        room = MIN_PANEL_SHARE * panel_height + ROW_ROOM * len(self.heights)
        least = text_height + scale * room
        if self.look.size is None:
            return least + (1.0 - MIN_PANEL_SHARE) * panel_height
        height = self.look.size[1]
        if height < least:
            raise DrawError(
                f"size: {least * 2.54:.1f} cm is the smallest height of this picture at that width"
            )
        return height

    def _write(self, block: TextBlock, top: float) -> None:
        """Write a block below a distance from the upper edge of the sheet [inch]."""
        text = style.math("\n".join(block.lines))
        look: dict[str, Any] = {"va": "top", "linespacing": LINE_SPACING, "in_layout": False}
        look |= {"fontsize": block.size * self.look.letters, "fontweight": block.weight}
        x = EDGE * self.em / self.width
        self.figure.text(x, 1.0 - top / self.height, text, **look)

    def _replace_panel(self, axes: Axes, panel: str | None) -> None:
        """Take the user's axes in place of a panel, the first unless one is named."""
        name = panel if panel is not None else next(iter(self.panels))
        if name not in self.panels:
            raise DrawError(
                f"panel: this picture has no {name!r}; choose of {', '.join(self.panels)}"
            )
        self.panels[name] = axes

    def _wrapped(self, texts: Sequence[str], size: float) -> list[str]:
        """Return the lines of texts, with fewer letters of bold ones, which are wider."""
        columns = int(self.columns / size * (0.92 if size > 1.0 else 1.0))
        lines = []
        for text in texts:
            joined = text.replace(" %", "\N{NO-BREAK SPACE}%")
            lines += textwrap.wrap(joined, columns, break_long_words=False)
        return lines

    def key(self, *panels: str, place: str = "lower center", title: str | None = None) -> None:
        """Add a legend of the labels in these panels, or in all, outside the panels.

        place: as in Figure.legend
        """
        entries: dict[str, Any] = {}
        for name in panels or self.panels:
            handles, labels = self.panels[name].get_legend_handles_labels()
            entries = dict(zip(labels, handles, strict=True)) | entries
        # users who draw into their own axes ask them for their legend
        if not entries or self.look.into is not None:
            return
        columns = 1 if "right" in place else _key_columns(list(entries), self.columns / SMALL)
        where: dict[str, Any] = {"loc": f"outside {place}"}
        self.figure.legend(
            handles=list(entries.values()),
            **where,
            title=title and style.math(title),
            ncols=columns,
            frameon=False,
            fontsize=SMALL * self.look.letters,
            borderaxespad=0.0,
            borderpad=0.5 * KEY_ROOM,
            handlelength=1.6,
            columnspacing=1.2,
        )

    def draw(self, panels: Mapping[str, Panel]) -> None:
        """Draw the panels that the sheet has."""
        for name in panels:
            if name in self.panels:
                panels[name].draw(self.panels[name])

    def legend(self, name: str) -> None:
        """Add the labels of a panel within it."""
        self.panels[name].legend(fontsize=style.pt(8), framealpha=0.85, edgecolor="none")

    def bar(self, axes: Axes, drawn: Any, label: str) -> Colorbar:
        """Add a colour bar beside a panel."""
        look: dict[str, Any] = {"aspect": 25.0, "pad": 0.02, "fraction": 0.04}
        bar = axes.figure.colorbar(drawn, ax=axes, label=style.math(label), **look)
        bar.outline.set_visible(False)
        return bar

    def share(self, *names: str) -> None:
        """Give panels below each other the x axis of the last."""
        for name in names[:-1]:
            if self.panels[name] is not self.look.into:
                self.panels[name].tick_params(labelbottom=False)
                self.panels[name].set_xlabel("")

    def finish(self) -> Figure:
        """Lay everything out and return the figure."""
        user_axes = self.look.into
        if user_axes is not None:
            # in a small panel long texts would leave no room
            user_axes.set_title("", loc="left")
            for text in user_axes.texts:
                text.set_in_layout(False)
            return cast("Figure", user_axes.figure)
        figure = self.figure
        for axes in figure.axes:
            self._wrap(axes)
        figure.align_ylabels()
        with warnings.catch_warnings(action="error"):
            try:
                self._lay_out()
            except UserWarning as error:
                raise DrawError("size: the panels do not fit; choose a larger picture") from error
        figure.set_layout_engine("none")
        for legend in figure.legends:
            legend.set_bbox_to_anchor(self._rect, figure.transFigure)
        for axes in figure.axes:
            axes.apply_aspect()
        return figure

    def _lay_out(self) -> None:
        engine = self.figure.get_layout_engine()
        assert engine is not None
        engine.execute(self.figure)
        for axes in self.figure.axes:
            if axes.get_aspect() != "auto" and axes.get_adjustable() == "box":
                # labels were measured beside a panel that its shape had made smaller
                engine.execute(self.figure)
                return

    def _wrap(self, axes: Axes) -> None:
        """Wrap title and labels to the panel before the layout; its title may leave it."""
        box = axes.get_position()
        widening = 1.15 if self.columns >= NARROW else 1.0
        across = self.look.columns(widening * box.width * self.width)
        up = self.look.columns(box.height * self.height)
        axes.set_ylabel(_wrapped(axes.get_ylabel(), up), linespacing=1.0)
        if len(_visible(axes.get_ylabel())) <= MAX_UPRIGHT_LETTERS:
            axes.yaxis.label.set(rotation=0, ha="right", va="center")
        axes.set_xlabel(_wrapped(axes.get_xlabel(), across))
        title_columns = across
        if len(self.panels) < 2:
            right_of_panel = (1.0 - box.x0) * self.width - EDGE * self.em
            title_columns = self.look.columns(right_of_panel)
        axes.set_title(_wrapped(axes.get_title(loc="left"), title_columns), loc="left")


def _stacked(
    rows: Sequence[Sequence[str]], heights: Sequence[float]
) -> tuple[list[list[str]], list[float]]:
    """Return rows of one panel each, with their heights."""
    height_of_panel = dict[str, float]()
    for row, height in zip(rows, heights, strict=True):
        height_of_panel |= {name: height for name in row if name != "."}
    return [[name] for name in height_of_panel], list(height_of_panel.values())


MAX_UPRIGHT_LETTERS = 3
"""Letters up to which the label of a y axis stands upright, τ_s."""


def _visible(text: str) -> str:
    """Return about as many letters as are seen: an index is shorter than its source."""
    return re.sub(r"\\bar|[$_{}]", "", text)


def _wrapped(text: str, columns: int) -> str:
    """Return a label in lines of so many letters; its unit stays on one."""
    if len(_visible(text)) <= columns:
        return text
    joined = re.sub(r"\[[^]]*\]$", lambda unit: unit[0].replace(" ", "\u00a0"), text)
    lines = textwrap.wrap(joined, columns, break_long_words=False)
    return "\n".join(lines).replace("\u00a0", " ")


def _key_columns(labels: Sequence[str], letters: float) -> int:
    """Return the columns of a key in as few rows as fit on the room of so many letters.

    Columns are filled one after the other.
    """
    sizes = [len(_visible(text)) for text in labels]
    for rows in range(1, len(labels)):
        columns = -(-len(labels) // rows)
        widths = [int(part.max()) + SAMPLE for part in np.array_split(sizes, columns)]
        if sum(widths) <= letters:
            return columns
    return 1
