"""Pictures with a layout of their own: counted in inches of usual letters, so that a size or letters can be asked for.

Other letters scale all places and margins; a width changes the panels and wraps the text; a height changes the panels.
"""

from __future__ import annotations

import textwrap
from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING, Any

from tcstudy.errors import DrawError
from tcstudy.reports.figures import style

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

TITLE, TITLE_LETTER = 12.0, 0.115
"""Letters of the heading [pt], and the width of one [inch]."""
LINE, TITLE_LINE = 0.19, 0.25
"""Height of a line of text, of the heading [inch]."""
NARROW = 6.0
"""Widths [inch] below which titles of panels need two lines and panels stand below each other."""
KEY_PT, KEY_LETTER, KEY_SIGN, KEY_LINE = 8.0, 0.061, 0.36, 0.17
"""Letters of a key [pt], their width, what a sign and its distances take, height of a row [inch]."""
EDGE = 0.15
"""Least margin to the right of a text [inch]."""
LETTER = 0.53
"""Mean width of a letter, of its height."""
SMALLEST = 0.3
"""Panels can shrink to this part of their usual height."""


class Paper:
    """A figure to be: its width and heading, then, once the panels have their heights, the figure itself.

    left:  margin of the panels, and of the heading where there is room for it [inch]
    lines: what stands below the heading, wrapped to the width;  letters: their size [pt]
    All lengths are in inches of a picture with usual letters.
    """

    def __init__(self, look: style.Look, left: float, title: str, lines: Iterable[str], letters: float = 9.5) -> None:
        self.look, self.left, self.letters = look, left, letters
        self.scale = look.letters / style.USUAL
        self.width = (look.size[0] / self.scale) if look.size else style.WIDTH
        self.begin = EDGE if self.width < NARROW else left
        heading = title if look.title is None else look.title
        self._title = self._wrapped(heading, int((self.width - self.begin) / TITLE_LETTER)) if heading else []
        self._lines = [line for text in lines for line in self.wrapped(text, self.begin)] if look.title != "" else []
        self.head = 0.42 + TITLE_LINE * (len(self._title) - 1) + LINE * len(self._lines)

    def wrapped(self, text: str, left: float) -> list[str]:
        """A text in lines that fit beside a margin [inch]."""
        return self._wrapped(text, int((self.width - left - EDGE) * 72.0 / (LETTER * self.letters)))

    @staticmethod
    def _wrapped(text: str, columns: int) -> list[str]:
        return textwrap.wrap(text, max(12, columns), break_long_words=False)

    def room(self, usual: float, fixed: float) -> float:
        """Height of all panels [inch]: the usual one, or what a height asked for leaves beside heading and `fixed`."""
        if self.look.size is None:
            return usual
        left = self.look.size[1] / self.scale - self.head - fixed
        if left < SMALLEST * usual:
            least = (self.head + fixed + SMALLEST * usual) * self.scale * 2.54
            raise DrawError(f"size: {least:.1f} cm is the least height of this picture with such width and letters")
        return left

    def figure(self, height: float) -> Figure:
        """The figure, `height` with its heading [inch], with the heading in it."""
        from matplotlib.figure import Figure

        self.height = height
        figure = self._figure = Figure(figsize=(self.width * self.scale, height * self.scale))
        for i, line in enumerate(self._title):
            self.text(0.27 + TITLE_LINE * i, line, TITLE, fontweight="bold", parse_math=False)
        first = 0.52 + TITLE_LINE * (len(self._title) - 1)
        for i, line in enumerate(self._lines):
            self.text(first + LINE * i, line, self.letters)
        return figure

    def text(self, below: float, text: str, letters: float, **more: Any) -> None:
        """A line at the margin of the heading, so many inches below the upper edge."""
        place = self.begin / self.width, 1.0 - below / self.height
        self._figure.text(*place, text, fontsize=letters * self.scale, **more)

    def key_rows(self, labels: Sequence[str]) -> int:
        """Rows of the key above a panel, columns as wide as their longest label, as matplotlib fills them."""
        narrow, rows = self.width < NARROW, 1
        wide = self.width - EDGE - (EDGE if narrow else self.left)
        while rows < len(labels):
            columns = [labels[i : i + rows] for i in range(0, len(labels), rows)]
            if sum(KEY_SIGN + KEY_LETTER * max(map(len, column)) for column in columns) <= wide:
                break
            rows += 1
        return rows

    def key(self, axes: Axes, handles: Sequence[Any], rows: int) -> None:
        """Put the key above a panel; the labels are those of the handles."""
        begin = -style.part_of(axes, self.left - EDGE) if self.width < NARROW else 0.0
        axes.legend(
            handles=handles, loc="lower left", bbox_to_anchor=(begin, 1.0), ncols=-(-len(handles) // rows),
            fontsize=KEY_PT * self.scale, frameon=False, handlelength=1.8, columnspacing=1.2, labelspacing=0.3,
            borderaxespad=0.3,
        )  # fmt: skip

    @property
    def extra(self) -> float:
        """Room that a panel needs above it for a second line of its title [inch]."""
        return 0.0 if self.width >= NARROW else LINE

    def wrap_title(self, axes: Axes) -> None:
        """Wrap the title of a panel to the page."""
        axes.set_title("\n".join(self.wrapped(axes.get_title(loc="left"), self.left)), loc="left")

    def fit_labels(self) -> None:
        """Wrap the names of upright axes that are longer than their panels."""
        for axes in self._figure.axes:
            label = axes.yaxis.label
            high = axes.get_position().height * self.height
            text = "\n".join(self._wrapped(label.get_text(), int((high + LINE) * 72.0 / (LETTER * style.USUAL))))
            label.set_text(text)
            label.set_linespacing(1.0)

    def axes(self, left: float, bottom: float, width: float, height: float) -> Axes:
        """New axes at a place counted in inches from the lower left corner."""
        return style.inches(self._figure, *(self.scale * x for x in (left, bottom, width, height)))
