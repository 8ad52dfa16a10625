"""The sheet of every picture, of any size: heading, facts, panels, keys and colour bars.

matplotlib's constrained layout finds the places. Heading, facts, titles and labels are wrapped to the room that they
have: it does not look how long they are.
"""

from __future__ import annotations

import re
import textwrap
import warnings
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, cast

import numpy as np

from tcstudy.errors import DrawError
from tcstudy.reports.figures import style

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.colorbar import Colorbar
    from matplotlib.figure import Figure

    from tcstudy.reports.figures.panels import Panel

SMALL, LARGE = 0.9, 1.25
"""Size of facts and keys and of the heading, relative to the other letters."""
LINE, EDGE = 1.5, 0.6
"""Height of a line, relative to its letters; margin of the sheet, relative to the usual ones."""
NARROW, BESIDE = 80, 60
"""Letters that fit side by side on a sheet below which panels stand below each other; from which on a key that may do
so stands beside the panel."""
ROOM = 0.7
"""Room below a row of panels for its labels [inch of usual letters]."""
SAMPLE = 7
"""Letters that the sample of a line beside a label of a key takes, with the room before and behind it."""
APART = 0.8
"""Room between keys and panels, relative to the letters of the keys."""
SMALLEST = 0.3
"""Panels can shrink to this part of their usual height."""


class Sheet:
    """Draw into the `panels`, add keys and bars, then call `finish`.

    facts, feet: what stands below the heading and at the foot of the sheet
    rows:        names of the panels in rows of these usual heights [inch], as of Figure.subplot_mosaic; on a narrow
                 sheet all stand below each other
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
            own = {name: high for row, high in zip(rows, heights, strict=True) for name in row if name != "."}
            rows, heights = [[name] for name in own], list(own.values())
        head = self._lines(heading, LARGE, fontweight="bold")
        head += [line for fact in facts for line in self._lines(fact, SMALL)]
        foot = [line for text in (*feet, *look.remarks) for line in self._lines(text, SMALL)]
        above, below = (LINE * self.em * sum(size for _, size, _ in lines) for lines in (head, foot))
        least = above + below + scale * (SMALLEST * sum(heights) + ROOM * len(heights))
        self.height = look.size[1] if look.size else least + (1.0 - SMALLEST) * sum(heights)
        if self.height < least:
            least *= 2.54
            raise DrawError(f"size: {least:.1f} cm is the least height of this picture with such a width")
        self.heights = heights
        self.figure = Figure((self.width, self.height), dpi=look.dpi, layout="constrained")
        self._write(head, EDGE * self.em)
        self._write(foot, self.height - below - EDGE * self.em)
        margins = [EDGE * self.em * (1.0 + bool(lines)) for lines in (head, foot)]
        top, bottom = 1.0 - (above + margins[0]) / self.height, (below + margins[1]) / self.height
        edge = EDGE * self.em / self.width
        engine: Any = self.figure.get_layout_engine()
        self._rect = (edge, bottom, 1.0 - 2.0 * edge, top - bottom)
        engine.set(rect=self._rect, w_pad=0.0, h_pad=0.0, hspace=0.05, wspace=0.03)
        self.panels: dict[str, Axes] = self.figure.subplot_mosaic([list(row) for row in rows], height_ratios=heights)
        if look.into is not None:
            name = look.panel if look.panel is not None else next(iter(self.panels))
            if name not in self.panels:
                raise DrawError(f"panel: this picture has no {name!r}; choose of {', '.join(self.panels)}")
            self.panels[name] = look.into

    def _lines(self, text: str, size: float, **more: Any) -> list[tuple[str, float, dict[str, Any]]]:
        columns = int(self.wide / size * (0.92 if more else 1.0))
        return [(line, size, more) for line in textwrap.wrap(text, columns, break_long_words=False)]

    def _write(self, lines: Sequence[tuple[str, float, dict[str, Any]]], top: float) -> None:
        """Lines below each other from so many inches below the upper edge on."""
        for text, size, more in lines:
            place = EDGE * self.em / self.width, 1.0 - top / self.height
            self.figure.text(*place, text, fontsize=size * self.look.letters, va="top", parse_math=not more,
                             in_layout=False, **more)  # fmt: skip
            top += LINE * size * self.em

    def key(self, *panels: str, place: str = "lower center", title: str | None = None) -> None:
        """What lines, marks and hatches mean that have a label in these panels, or in all; place: as in Figure.legend.

        It stands outside the panels.
        """
        found: dict[str, Any] = {}
        for name in panels or self.panels:
            handles, labels = self.panels[name].get_legend_handles_labels()
            found = dict(zip(labels, handles, strict=True)) | found
        if not found or self.look.into is not None:  # whose axes they are, asks them for their legend
            return
        columns = 1 if "right" in place else _columns(list(found), self.wide / SMALL)
        where: dict[str, Any] = {"loc": f"outside {place}"}
        self.figure.legend(
            handles=list(found.values()), **where, title=title, ncols=columns, frameon=False,
            fontsize=SMALL * self.look.letters, borderaxespad=0.0, borderpad=0.5 * APART, handlelength=1.6,
            columnspacing=1.2,
        )  # fmt: skip

    def draw(self, panels: Mapping[str, Panel]) -> None:
        """Draw the panels that the sheet has."""
        for name in panels:
            if name in self.panels:
                panels[name].draw(self.panels[name])

    def bar(self, axes: Axes, drawn: Any, label: str) -> Colorbar:
        """A colour bar beside a panel."""
        bar = axes.figure.colorbar(drawn, ax=axes, aspect=25.0, pad=0.02, fraction=0.04, label=label)
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
                if any(axes.get_aspect() != "auto" and axes.get_adjustable() == "box" for axes in figure.axes):
                    engine.execute(figure)  # labels were measured beside a panel that its shape had made smaller
            except UserWarning as error:
                raise DrawError("size: panels find no room; ask for a larger picture") from error
        figure.set_layout_engine("none")
        left, bottom, width, height = self._rect  # keys have their margins towards the panels alone
        across, up = (0.5 * APART * SMALL * self.em / side for side in (self.width, self.height))
        for legend in figure.legends:
            box = (left - across, bottom - up, width + 2.0 * across, height + 2.0 * up)
            legend.set_bbox_to_anchor(box, figure.transFigure)
        for axes in figure.axes:
            axes.apply_aspect()
        return figure

    def _wrap(self, axes: Axes) -> None:
        """Wrap title and labels to the panel, as large as it is before the layout; its title may leave it."""
        box, wider = axes.get_position(), 1.15 if self.wide >= NARROW else 1.0
        across = self.look.columns(wider * box.width * self.width)
        up = self.look.columns(box.height * self.height)
        axes.set_ylabel(_wrapped(axes.get_ylabel(), up), linespacing=1.0)
        axes.set_xlabel(_wrapped(axes.get_xlabel(), across))
        title = self.look.columns((1.0 - box.x0) * self.width - EDGE * self.em) if len(self.panels) < 2 else across
        axes.set_title(_wrapped(axes.get_title(loc="left"), title), loc="left")


def _seen(text: str) -> str:
    """About as many letters as are seen: a formula is shorter than its source."""
    return re.sub(r"[$_{}]", "", re.sub(r"\\[a-z]+", "x", text))


def _wrapped(text: str, columns: int) -> str:
    """A label in lines of so many letters; its unit stays on one."""
    if len(_seen(text)) <= columns:
        return text
    whole = re.sub(r"\[[^]]*\]$", lambda unit: unit[0].replace(" ", "\u00a0"), text)
    return "\n".join(textwrap.wrap(whole, columns, break_long_words=False)).replace("\u00a0", " ")


def _columns(labels: Sequence[str], letters: float) -> int:
    """Columns of a key in as few rows as do on the room of so many letters; columns are filled one after the other."""
    for rows in range(1, len(labels)):
        columns = -(-len(labels) // rows)
        split = np.array_split([len(_seen(text)) for text in labels], columns)
        if sum(int(column.max()) + SAMPLE for column in split) <= letters:
            return columns
    return 1
