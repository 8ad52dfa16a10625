"""A sheet of any size with any letters: heading, facts, one panel, its key and colour bar, laid out by measuring.

matplotlib's own layouts let long labels push a small panel away; here the labels are wrapped to the panel instead.
"""

from __future__ import annotations

import textwrap
from typing import TYPE_CHECKING, Any

from tcstudy.reports.figures import style

if TYPE_CHECKING:
    from collections.abc import Sequence

    from matplotlib.axes import Axes

SIZE = (8.0, 5.0)
"""Usual size [inch]."""
SMALL, LARGE = 0.88, 1.2
"""Size of the facts and of the heading, relative to the other letters."""
WIDE = 60
"""Letters that fit side by side on a sheet from which on a key stands beside the panel, not below it."""
PASSES = 5
"""Labels are wrapped to a panel whose size follows from its labels."""
LINES = 2
"""Most lines of a label beside the panel, if there is a shorter one."""


class Sheet:
    """Draw into `axes`, add a key and a bar, then call `finish`."""

    def __init__(self, look: style.Look, heading: str, facts: Sequence[str]) -> None:
        from matplotlib.figure import Figure

        self.look, self.size = look, look.size or SIZE
        self.figure = Figure(figsize=self.size)
        self.axes = self.figure.add_axes((0.1, 0.1, 0.8, 0.8))
        self.em = look.letters / 72.0
        self.wide = look.columns(self.size[0] - self.em)
        self._key: Any = None
        self._bar: Any = None
        self._label: tuple[str, ...] = ()
        self._bar_label: tuple[str, ...] = ()
        self._head: list[Any] = []
        if look.title != "":
            self._write(heading if look.title is None else look.title, LARGE, fontweight="bold")
            for fact in filter(None, facts):
                self._write(fact, SMALL)

    def _write(self, text: str, size: float, **more: Any) -> None:
        lines = textwrap.wrap(text, int(self.wide / size * (0.92 if more else 1.0)), break_long_words=False)
        self._head.append(self.figure.text(0, 0, "\n".join(lines), fontsize=size * self.look.letters, va="top", **more))

    @property
    def beside(self) -> bool:
        """Whether the key stands beside the panel."""
        return self.wide >= WIDE

    def key(self, handles: Sequence[Any], title: str | None = None, below: bool = False) -> None:
        """What lines, marks and hatches mean; the labels of the handles."""
        longest = max(len(handle.get_label()) for handle in handles)
        one = self.beside and not below
        columns = 1 if one else max(1, min(len(handles), int(self.wide / SMALL) // (longest + 6)))
        where: dict[str, Any] = {
            "loc": "upper right" if one else "lower center",
            "bbox_transform": self.figure.dpi_scale_trans,
        }
        self._key = self.figure.legend(
            handles=list(handles), title=title, ncols=columns, frameon=False, fontsize=SMALL * self.look.letters,
            borderaxespad=0.0, borderpad=0.1, handlelength=1.6, columnspacing=1.2, **where,
        )  # fmt: skip
        self._below = not one

    def bar(self, drawn: Any, *label: str) -> None:
        """A colour bar beside the panel; labels as for `label`."""
        place = self.figure.add_axes((0.9, 0.1, 0.05, 0.8))
        self._bar, self._bar_label = place, label
        self.figure.colorbar(drawn, cax=place).outline.set_visible(False)

    def label(self, *texts: str) -> None:
        """What stands beside the panel, wrapped to its height: the first text that does in two lines, or the last."""
        self._label = texts

    def finish(self) -> Any:
        """Lay everything out; returns the figure."""
        from matplotlib.backends.backend_agg import FigureCanvasAgg

        renderer = FigureCanvasAgg(self.figure).get_renderer()
        for number in range(PASSES):
            left, bottom, right, top = self._region(renderer)
            if self._bar is not None:
                beyond = self._overhang(self._bar, renderer)
                right -= beyond[2] + 1.2 * self.em
                bar_left = right
                right -= 1.0 * self.em
            low, under, over, above = self._overhang(self.axes, renderer)
            box = (left + low, bottom + under, right - over - left - low, top - above - bottom - under)
            box = (*box[:2], max(box[2], 0.5 * self.em), max(box[3], 0.5 * self.em))
            self._put(self.axes, box)
            if self._bar is not None:
                self._put(self._bar, (bar_left, box[1], 1.2 * self.em, box[3]))
            if number < PASSES - 1:
                self._wrap(box[3])
        return self.figure

    def _put(self, axes: Axes, box: tuple[float, float, float, float]) -> None:
        width, height = self.size
        axes.set_position((box[0] / width, box[1] / height, box[2] / width, box[3] / height))

    def _wrap(self, length: float) -> None:
        """Put the labels along a panel of this height [inch]."""
        columns = self.look.columns(length)
        for axes, texts in ((self.axes, self._label), (self._bar, self._bar_label)):
            wrapped = [textwrap.wrap(text, columns, break_long_words=False) for text in texts]
            if wrapped:
                axes.set_ylabel("\n".join(next((lines for lines in wrapped if len(lines) <= LINES), wrapped[-1])))

    def _region(self, renderer: Any) -> tuple[float, float, float, float]:
        """Place heading and key; returns left, bottom, right and top of what is left of the sheet [inch]."""
        em, dpi = self.em, self.figure.dpi
        left, bottom, right, top = 0.6 * em, 0.5 * em, self.size[0] - 0.6 * em, self.size[1] - 0.6 * em
        for text in self._head:
            text.set_position((left / self.size[0], top / self.size[1]))
            top -= text.get_window_extent(renderer).height / dpi + 0.4 * em
        top -= 0.5 * em if self._head else 0.0
        if self._key is not None:
            at = (self.size[0] / 2, bottom) if self._below else (right, top)
            self._key.set_bbox_to_anchor(at, self.figure.dpi_scale_trans)
            box = self._key.get_window_extent(renderer)
            if self._below:
                bottom += box.height / dpi + 0.7 * em
            else:
                right -= box.width / dpi + em
        return left, bottom, right, top

    def _overhang(self, axes: Axes, renderer: Any) -> tuple[float, float, float, float]:
        """How far labels reach beyond a panel: left, below, right, above [inch].

        The label beside it counts with its width alone: it is wrapped to the height of the panel afterwards.
        """
        axes.apply_aspect()
        dpi, label = self.figure.dpi, axes.yaxis.label
        width = (
            (label.get_window_extent(renderer).width + axes.yaxis.labelpad * dpi / 72.0) if label.get_text() else 0.0
        )
        label.set_visible(False)
        inner, outer = axes.get_window_extent(renderer), axes.get_tightbbox(renderer)
        label.set_visible(True)
        assert outer is not None
        left, right = inner.x0 - outer.x0, outer.x1 - inner.x1
        left, right = (left, right + width) if axes is self._bar else (left + width, right)
        below, above = inner.y0 - outer.y0, outer.y1 - inner.y1
        return max(0.0, left / dpi), max(0.0, below / dpi), max(0.0, right / dpi), max(0.0, above / dpi)
