"""Panels of lines and marks, and of cells in colours, as records, and the sheet of any size that
they stand on.

matplotlib draws them here, the page in its scripts; the third kind is the body (`body`). What is
drawn is given in the units of the file; an axis counts in the unit that suits its numbers, and says
it. What has a label stands in the key of the sheet. Looks are those of Axes.plot: color, linewidth,
linestyle, marker, markersize, markerfacecolor, alpha.

matplotlib's constrained layout finds the places on the sheet. Heading, facts, titles and labels are
wrapped to the room that they have: it does not look how long they are.
"""

from __future__ import annotations

import re
import textwrap
import warnings
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, cast

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
    """An axis: its label with the unit that it counts in, and what is drawn as 1 [unit of the
    file]."""

    label: str
    one: float = 1.0

    def __call__(self, values: ArrayLike) -> Array:
        """Values of the file as they are drawn."""
        return np.asarray(values, dtype=float) / self.one


def scale(name: str, values: ArrayLike, units: str) -> Scale:
    """The axis that suits the largest of some values of the file."""
    one, unit = axis_unit(np.ravel(np.asarray(values, dtype=float)), units)
    return Scale(headed(name, unit), one)


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
    limits: list[tuple[float | None, float | None] | None] = field(
        default_factory=lambda: [None, None]
    )
    ticks: tuple[Any, Any] | None = None
    items: list[tuple[str, Any, Any, dict[str, Any]]] = field(default_factory=list)

    def _add(self, kind: str, x: ArrayLike, y: ArrayLike, how: dict[str, Any]) -> None:
        self.items.append((kind, np.atleast_1d(self.x(x)), np.atleast_1d(self.y(y)), how))

    def line(self, x: ArrayLike, y: ArrayLike, **how: Any) -> None:
        """Add a line or marks, as in Axes.plot."""
        self._add("line", x, y, how)

    def fill(self, x: ArrayLike, y: ArrayLike, **how: Any) -> None:
        """Add the area inside a ring."""
        self._add("fill", x, y, {"color": style.BLUE, "alpha": 0.25, "linewidth": 0} | how)

    def band(self, x: ArrayLike, low: ArrayLike, high: ArrayLike, **how: Any) -> None:
        """Add the area between two lines."""
        x_ring = np.concatenate([np.asarray(x), np.asarray(x)[::-1]])
        y_ring = np.concatenate([np.asarray(low), np.asarray(high)[::-1]])
        self.fill(x_ring, y_ring, **how)

    def across(self, value: float, **how: Any) -> None:
        """Add a horizontal line all across."""
        self._add("across", 0.0, value, {"color": style.SHADE, "linewidth": 0.8, "zorder": 0} | how)

    def up(self, value: float, **how: Any) -> None:
        """Add a vertical line from end to end."""
        self._add("up", value, 0.0, {"color": style.SHADE, "linewidth": 0.8, "zorder": 0} | how)

    def shade(self, low: float, high: float, upright: bool = True) -> None:
        """Shade the area between two values of x, or of y."""
        look = {"color": style.SHADE, "linewidth": 0, "zorder": 0}
        if upright:
            self._add("columns", (low, high), 0.0, look)
        else:
            self._add("rows", 0.0, (low, high), look | {"alpha": 0.5})

    def note(
        self, text: str, at: Sequence[float], shift: tuple[float, float] = (0.0, 0.0), **how: Any
    ) -> None:
        """Add a text beside a place, or at the upper edge (`top`), shifted by (x, y) points.

        how: ha, va, fontsize (among usual letters) … as of Axes.annotate
        """
        self._add("note", at[0], at[1], how | {"text": text, "shift": shift})

    def arrow(
        self, start: Sequence[float], end: Sequence[float], head: float = 12.0, **how: Any
    ) -> None:
        """Add an arrow; head: size of its head [pt]."""
        x, y = np.array([start, end], dtype=float).T
        self._add("arrow", x, y, how | {"head": head})

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
        for k, (values, share) in enumerate(((self.x(x), room[0]), (self.y(y), room[1]))):
            wide = float(np.ptp(values)) or 1.0
            self.limits[k] = float(values.min()) - share * wide, float(values.max()) + share * wide

    def draw(self, axes: Axes) -> None:
        """Draw it with matplotlib; names come with `place_names`, after the layout."""
        axes.set(xlabel=style.math(self.x.label), ylabel=style.math(self.y.label))
        if self.title:
            axes.set_title(style.math(self.title), loc="left")
        for name, logarithmic in zip(("xscale", "yscale"), self.log, strict=True):
            if logarithmic:
                axes.set(**{name: "log"})
        for kind, x, y, look in self.items:
            _draw_item(axes, kind, x, y, look)
        x_limits, y_limits = self.limits
        if x_limits is not None:
            axes.set_xlim(*x_limits)
        if y_limits is not None:
            axes.set_ylim(*y_limits)
        if self.ticks is not None:
            axes.set_xticks(list(self.ticks[0]), list(map(style.math, self.ticks[1])))
        if self.grid:
            axes.grid(True, which="major", color=style.SHADE, linewidth=0.6)
            axes.set_axisbelow(True)


def _draw_item(axes: Axes, kind: str, x: Array, y: Array, look: dict[str, Any]) -> None:
    if "label" in look:
        look = look | {"label": style.math(look["label"])}
    match kind:
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
    own_keys = ("text", "shift", "top")
    text_look = {key: value for key, value in look.items() if key not in own_keys}
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


LETTER, LINE_HIGH = 0.6, 1.4
"""Width of a letter and height of a line, of the height of letters: of wide words, so that none
runs off the sheet."""
COVER, FAR = 1000, 15.0
"""Places of lines that weigh as much as another text; from where on a line leads from its place to
a text [pt]."""
ROUND = np.array([(1, 1), (-1, 1), (1, -1), (-1, -1), (0, 1.4), (0, -1.4)]) / 1.4
"""Ways from a dot to its name."""


class Labels:
    """Texts of axes that have their place, one after the other where nothing, or the least, is in
    their way.

    drawn: (k, 2) places of lines and marks that texts should not cover, as dense as letters are
    wide
    """

    def __init__(self, axes: Axes, drawn: Sequence[Array], letters: float = 8.5) -> None:
        self.axes, self.letters, self._texts = axes, style.pt(letters), list[tuple[Array, Array]]()
        self._drawn = self._points(np.concatenate(drawn))

    def _points(self, xy: Array) -> Array:
        return np.asarray(self.axes.transData.transform(xy) / self.axes.figure.dpi * 72.0)

    def put(
        self,
        text: str,
        at: Array,
        ways: Any,
        apart: Sequence[float] = (6.0,),
        upright: bool = False,
        **how: Any,
    ) -> None:
        """A text beside one of the places at (k, 2) in its way (k, 2), one of these distances [pt]
        from it, the other way below 0, with a line to what is far; upright: turned. A loose one is
        left out where others are everywhere.
        """
        loose, lines = how.pop("loose", False), text.split("\n")
        half = (
            0.5 * self.letters * np.array([LETTER * max(map(len, lines)), LINE_HIGH * len(lines)])
        )
        half = half[::-1] if upright else half
        dots, ways = np.tile(self._points(at), (len(apart), 1)), np.tile(ways, (len(apart), 1))
        gaps = np.repeat(apart, len(at))
        centres = dots + ways * (gaps + np.copysign(np.abs(ways) @ half, gaps))[:, None]
        low, high = np.array([self.axes.bbox.min, self.axes.bbox.max]) / self.axes.figure.dpi * 72.0
        centres = np.clip(centres, low + half, np.maximum(high - half, low + half))
        hits = np.array(
            [np.sum(np.all(np.abs(self._drawn - one) < half + 2.0, axis=1)) for one in centres]
        )
        for centre, wide in self._texts:
            hits += COVER * np.all(np.abs(centres - centre) < wide + half, axis=1)
        k = int(np.argmin(hits))
        if loose and hits[k] >= COVER:
            return
        self._texts.append((centres[k], half))
        shift = centres[k] - dots[k]
        if np.any(np.abs(shift) > half + FAR):
            how["arrowprops"] = {
                "arrowstyle": "-",
                "color": style.PALE,
                "linewidth": 0.6,
                "shrinkB": 0,
            }
        how |= {
            "ha": "center",
            "va": "center",
            "rotation": 90.0 * upright,
            "fontsize": self.letters,
            "zorder": 6,
        }
        self.axes.annotate(
            style.math(text), at[k % len(at)], shift, textcoords="offset points", bbox=GROUND, **how
        )


GROUND = {"boxstyle": "round,pad=0.1", "facecolor": "white", "edgecolor": "none", "alpha": 0.75}


DOT, NAMED = 20, 60
"""Places of a line that weigh as much as a dot near a name, which could be taken for its own; dots
that have names."""


def place_names(axes: Axes, panel: Panel) -> None:
    """The names of a panel, each once, when its axes have their place."""
    share = np.linspace(0.0, 1.0, 60)[:, None, None]
    curves = [
        np.column_stack([x, y]) for kind, x, y, _ in panel.items if kind == "line" and len(x) > 1
    ]
    dense = [((1.0 - share) * xy[:-1] + share * xy[1:]).reshape(-1, 2) for xy in curves]
    for x, y, names in ((x, y, how["texts"]) for kind, x, y, how in panel.items if kind == "names"):
        dots = np.column_stack([x, y])
        labels = Labels(axes, [*dense, *[dots] * DOT])
        for name in dict.fromkeys(names[:NAMED]):
            labels.put(name, dots[[names.index(name)] * len(ROUND)], ROUND, loose=True)


def contact_nodes(data: Any) -> tuple[NDArray[np.intp], Scale, Array]:
    """Of a stored contact line: its nodes along the arclength, the axis of that, and the ends of
    their segments."""
    order = np.argsort(data["arclength"].values, kind="stable")
    ends = np.concatenate([[0.0], np.cumsum(data["c"].values[order])])
    return order, scale("arclength", ends, str(data["arclength"].attrs["units"])), ends


# -- the sheet -------------------------------------------------------------------------------------

SMALL, LARGE = 0.9, 1.25
"""Size of facts and keys and of the heading, relative to the other letters."""
LINE, SPACED, EDGE = 1.5, 1.45, 0.6
"""Height of a line, relative to its letters, and what matplotlib calls it; margin of the sheet,
relative to letters."""
NARROW, BESIDE = 80, 60
"""Letters that fit side by side on a sheet below which panels stand below each other; from which on
a key that may do so stands beside the panel."""
ROOM = 0.7
"""Room below a row of panels for its labels [inch of usual letters]."""
SAMPLE = 7
"""Letters that the sample of a line beside a label of a key takes, with the room before and behind
it."""
APART = 0.8
"""Room between keys and panels, relative to the letters of the keys."""
SMALLEST = 0.3
"""Panels can shrink to this part of their usual height."""


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

        self.look, self.em, scale = look, look.letters / 72.0, look.letters / style.USUAL
        self.width = look.size[0] if look.size else style.WIDTH
        self.wide = look.columns(self.width - 2 * EDGE * self.em)
        if self.wide < NARROW:
            own = {
                name: high
                for row, high in zip(rows, heights, strict=True)
                for name in row
                if name != "."
            }
            rows, heights = [[name] for name in own], list(own.values())
        texts = ((heading,), LARGE), (facts, SMALL), ((*feet, *look.remarks), SMALL)
        wrapped = [
            [line for text in some for line in self._wrapped(text, size)] for some, size in texts
        ]
        head, fact, foot = (
            LINE * size * self.em * len(lines)
            for lines, (_, size) in zip(wrapped, texts, strict=True)
        )
        least = head + fact + foot + scale * (SMALLEST * sum(heights) + ROOM * len(heights))
        self.height = look.size[1] if look.size else least + (1.0 - SMALLEST) * sum(heights)
        if self.height < least:
            least *= 2.54
            raise DrawError(
                f"size: {least:.1f} cm is the smallest height of this picture at that width"
            )
        self.heights, edge = heights, EDGE * self.em
        self.figure = Figure((self.width, self.height), dpi=look.dpi, layout="constrained")
        tops = edge, edge + head, self.height - edge - foot
        for lines, (_, size), top, weight in zip(
            wrapped, texts, tops, ("bold", "normal", "normal"), strict=True
        ):
            how: dict[str, Any] = {"va": "top", "linespacing": SPACED, "in_layout": False}
            how |= {"fontsize": size * look.letters, "fontweight": weight}
            self.figure.text(
                edge / self.width, 1.0 - top / self.height, style.math("\n".join(lines)), **how
            )
        above, below = head + fact + 2.0 * edge, foot + edge * (1.0 + bool(foot))
        sides, engine = (
            np.array([self.width, self.height] * 2),
            cast("Any", self.figure.get_layout_engine()),
        )
        self._rect = tuple(
            np.array([edge, below, self.width - 2.0 * edge, self.height - above - below]) / sides
        )
        engine.set(rect=self._rect, w_pad=0.0, h_pad=0.0, hspace=0.05, wspace=0.03)
        self.panels: dict[str, Axes] = self.figure.subplot_mosaic(
            [list(row) for row in rows], height_ratios=heights
        )
        if look.into is not None:
            name = look.panel if look.panel is not None else next(iter(self.panels))
            if name not in self.panels:
                raise DrawError(
                    f"panel: this picture has no {name!r}; choose of {', '.join(self.panels)}"
                )
            self.panels[name] = look.into

    def _wrapped(self, text: str, size: float) -> list[str]:
        """Lines of a text, fewer letters of bold ones, which are wider."""
        columns = int(self.wide / size * (0.92 if size > 1.0 else 1.0))
        return textwrap.wrap(
            text.replace(" %", "\N{NO-BREAK SPACE}%"), columns, break_long_words=False
        )

    def key(self, *panels: str, place: str = "lower center", title: str | None = None) -> None:
        """Add a legend of the labels in these panels, or in all, outside the panels.

        place: as in Figure.legend
        """
        entries: dict[str, Any] = {}
        for name in panels or self.panels:
            handles, labels = self.panels[name].get_legend_handles_labels()
            entries = dict(zip(labels, handles, strict=True)) | entries
        # a user who draws into axes of his own asks them for their legend
        if not entries or self.look.into is not None:
            return
        columns = 1 if "right" in place else _columns(list(entries), self.wide / SMALL)
        where: dict[str, Any] = {"loc": f"outside {place}"}
        self.figure.legend(
            handles=list(entries.values()),
            **where,
            title=title and style.math(title),
            ncols=columns,
            frameon=False,
            fontsize=SMALL * self.look.letters,
            borderaxespad=0.0,
            borderpad=0.5 * APART,
            handlelength=1.6,
            columnspacing=1.2,
        )

    def draw(self, panels: Mapping[str, Panel]) -> None:
        """Draw the panels that the sheet has."""
        for name in panels:
            if name in self.panels:
                panels[name].draw(self.panels[name])

    def legend(self, name: str) -> None:
        """The labels of a panel within it."""
        self.panels[name].legend(fontsize=style.pt(8), framealpha=0.85, edgecolor="none")

    def bar(self, axes: Axes, drawn: Any, label: str) -> Colorbar:
        """A colour bar beside a panel."""
        bar = axes.figure.colorbar(
            drawn, ax=axes, aspect=25.0, pad=0.02, fraction=0.04, label=style.math(label)
        )
        bar.outline.set_visible(False)
        return bar

    def share(self, *names: str) -> None:
        """Panels below each other have the x axis of the last."""
        for name in names[:-1]:
            if self.panels[name] is not self.look.into:
                self.panels[name].tick_params(labelbottom=False)
                self.panels[name].set_xlabel("")

    def finish(self) -> Figure:
        """Lay everything out; returns the figure."""
        if (own := self.look.into) is not None:  # in a small panel long texts would leave no room
            own.set_title("", loc="left")
            for text in own.texts:
                text.set_in_layout(False)
            return cast("Figure", own.figure)
        figure, engine = self.figure, self.figure.get_layout_engine()
        assert engine is not None
        for axes in figure.axes:
            self._wrap(axes)
        figure.align_ylabels()
        with warnings.catch_warnings(action="error"):
            try:
                engine.execute(figure)
                if any(
                    axes.get_aspect() != "auto" and axes.get_adjustable() == "box"
                    for axes in figure.axes
                ):
                    engine.execute(
                        figure
                    )  # labels were measured beside a panel that its shape had made smaller
            except UserWarning as error:
                raise DrawError("size: the panels do not fit; choose a larger picture") from error
        figure.set_layout_engine("none")
        for legend in figure.legends:
            legend.set_bbox_to_anchor(self._rect, figure.transFigure)
        for axes in figure.axes:
            axes.apply_aspect()
        return figure

    def _wrap(self, axes: Axes) -> None:
        """Wrap title and labels to the panel, as large as it is before the layout; its title may
        leave it."""
        box, wider = axes.get_position(), 1.15 if self.wide >= NARROW else 1.0
        across = self.look.columns(wider * box.width * self.width)
        up = self.look.columns(box.height * self.height)
        axes.set_ylabel(_wrapped(axes.get_ylabel(), up), linespacing=1.0)
        if len(_seen(axes.get_ylabel())) <= UPRIGHT:
            axes.yaxis.label.set(rotation=0, ha="right", va="center")
        axes.set_xlabel(_wrapped(axes.get_xlabel(), across))
        title = (
            self.look.columns((1.0 - box.x0) * self.width - EDGE * self.em)
            if len(self.panels) < 2
            else across
        )
        axes.set_title(_wrapped(axes.get_title(loc="left"), title), loc="left")


UPRIGHT = 3
"""Letters up to which the label of a y axis stands upright, τ_s."""


def _seen(text: str) -> str:
    """About as many letters as are seen: an index is shorter than its source."""
    return re.sub(r"\\bar|[$_{}]", "", text)


def _wrapped(text: str, columns: int) -> str:
    """A label in lines of so many letters; its unit stays on one."""
    if len(_seen(text)) <= columns:
        return text
    whole = re.sub(r"\[[^]]*\]$", lambda unit: unit[0].replace(" ", "\u00a0"), text)
    return "\n".join(textwrap.wrap(whole, columns, break_long_words=False)).replace("\u00a0", " ")


def _columns(labels: Sequence[str], letters: float) -> int:
    """Columns of a key in as few rows as do on the room of so many letters; columns are filled one
    after the other."""
    for rows in range(1, len(labels)):
        columns = -(-len(labels) // rows)
        split = np.array_split([len(_seen(text)) for text in labels], columns)
        if sum(int(column.max()) + SAMPLE for column in split) <= letters:
            return columns
    return 1
