"""Colours, letters, sizes and saving, common to all pictures.

matplotlib is imported when a picture is made, so that the package works without it; pyplot and its
list of open figures are not used at all.
"""

from __future__ import annotations

import io
import logging
import os
import re
import sys
from collections.abc import Mapping
from contextlib import AbstractContextManager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from tcstudy.data.files import check_writable, replace_file
from tcstudy.errors import DrawError, StoreError, UsageError
from tcstudy.reports.symbols import symbol
from tcstudy.reports.text import pretty

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.axis import Axis
    from matplotlib.figure import Figure

WIDTH = 8.0
"""Width of every picture [inch]."""

DPI, FINE_DPI = 160, 300
"""Pixels per inch of a PNG; of one whose size was asked for, which goes to print."""

SUFFIXES = (".png", ".svg", ".pdf")

INK, PALE, SHADE = "#222222", "#8a8a8a", "#dedede"
BLUE, VERMILLION, GREEN = "#0072b2", "#d55e00", "#009e73"
SERIES = (BLUE, VERMILLION, GREEN, "#cc79a7", "#e69f00", "#56b4e9", INK)
"""Colours of the palette of Okabe and Ito, distinct for every kind of colour vision."""

OPEN, SOFTENING = "#cfe6f5", "#fbdcc0"
"""Of contact that is open, and of a bond that softens as it opens."""

EVEN = "#fed976"
"""Of the colours of HEAT, the one for a body of one temperature."""

LETTER = 0.09
"""Width of a bold letter [inch], to know what fits."""

HEAT = "YlOrRd"
"""Colour map of the body: light enough for dark lines and letters on most of its range."""

SIGNED = "RdYlBu_r"
"""Colour map of what may have either sign."""

USUAL, LEAST = 9.5, 7.0
"""Usual size of letters [pt]; of those in a small picture, the least that journals print."""

_STYLE: dict[Any, Any] = {
    **dict.fromkeys(("font.size", "axes.titlesize", "axes.labelsize"), USUAL),
    **dict.fromkeys(("xtick.labelsize", "ytick.labelsize"), 8.5),
    **dict.fromkeys(("axes.edgecolor", "xtick.color", "ytick.color"), PALE),
    **dict.fromkeys(("axes.labelcolor", "text.color", "xtick.labelcolor", "ytick.labelcolor"), INK),
    **dict.fromkeys(("axes.spines.top", "axes.spines.right", "text.usetex"), False),
    "axes.unicode_minus": True,
    "svg.hashsalt": "tcstudy",
    "svg.fonttype": "none",  # text that other programs can edit and search
    "pdf.fonttype": 42,  # TrueType: journals refuse Type 3
}


LARGEST, SMALLEST = 40.0, 1.0
"""Width and height that a picture may have [inch]."""
INCHES = {"cm": 1 / 2.54, "mm": 1 / 25.4, "in": 1.0}


@dataclass(frozen=True)
class Look:
    """Requested looks of a picture.

    size:    width and height [inch], None for the usual ones
    remarks: lines at the foot of the picture
    into:    axes of the user's own figure for one panel: the first, or the one that `panel` names
    """

    size: tuple[float, float] | None = None
    remarks: tuple[str, ...] = ()
    into: Axes | None = None
    panel: str | None = None

    @property
    def letters(self) -> float:
        """The size of the letters [pt], which shrink with a picture narrower than the usual one."""
        return max(LEAST, USUAL * min(1.0, self.size[0] / WIDTH)) if self.size else USUAL

    @property
    def dpi(self) -> int:
        """Pixels per inch of a PNG."""
        return FINE_DPI if self.size else DPI

    def columns(self, width: float) -> int:
        """Letters of usual size that stand side by side on so many inches."""
        return max(12, int(width * 72.0 / (0.54 * self.letters)))


Size = str | tuple[float, float]
"""Width and height: a text such as "8x10cm", or [inch]."""


def look_of(
    size: Size | None,
    remarks: tuple[str, ...] = (),
    into: Axes | None = None,
    panel: str | None = None,
) -> Look:
    """Return the requested looks. Raises UsageError for a size that no picture has."""
    if panel is not None and into is None:
        raise UsageError("panel: give ax, too, the axes of your figure that it is drawn into")
    return Look(size_in_inches(size) if isinstance(size, str) else size, remarks, into, panel)


def size_in_inches(text: str) -> tuple[float, float]:
    """Return width and height [inch] of a text such as "8x10cm".

    Raises UsageError if it is no size of a picture.
    """
    match = re.fullmatch(
        r"\s*(\d+\.?\d*|\.\d+)\s*(cm|mm|in)?\s*[x×]\s*(\d+\.?\d*|\.\d+)\s*(cm|mm|in)\s*", text
    )
    if match is None:
        raise UsageError(
            f"size: {text!r} is none; write width x height with a unit, "
            "for example 8x10cm, 80x100mm or 3.2x4in"
        )
    width = float(match[1]) * INCHES[match[2] or match[4]]
    height = float(match[3]) * INCHES[match[4]]
    if not all(SMALLEST <= side <= LARGEST for side in (width, height)):
        least, most = SMALLEST * 2.54, LARGEST * 2.54
        raise UsageError(
            f"size: a picture of {text} cannot be drawn; give {least:.1f} to {most:.0f} cm a side"
        )
    return width, height


_RAISED = re.compile(r"(?<![^\W\d_])([^\W\d_])([_^])(-?\d[\d.]*|\w{1,3})(?![\w.])")
"""A letter with an index or a power, u_T, τ_xy, N^-0.3."""
_BARRED = re.compile("([^\\W\\d_])\N{COMBINING MACRON}")
"""A letter with a bar over it, θ̄."""


def math(text: str) -> str:
    """Return a text for matplotlib, with its indices, powers and bars in mathematical type."""
    plain = text.replace("$", r"\$")
    return _BARRED.sub(r"$\\bar{\1}$", _RAISED.sub(r"$\1\2{\3}$", plain))


def styled(look: Look | None = None) -> AbstractContextManager[None]:
    """Return the settings of the pictures for a `with`. Raises DrawError without matplotlib."""
    scale = look.letters / USUAL if look is not None else 1.0
    sizes = {key: scale * value for key, value in _STYLE.items() if key.endswith("size")}
    settings: AbstractContextManager[None] = _matplotlib().rc_context(_STYLE | sizes)
    return settings


def pt(letters: float) -> float:
    """Return the size of letters [pt] in a styled picture; letters: their size among usual ones."""
    return letters * float(_matplotlib().rcParams["font.size"]) / USUAL


def _matplotlib() -> Any:
    """Return matplotlib, whatever backend the environment names.

    A backend decides how windows show figures, and pictures are files. matplotlib refuses to be
    imported where MPLBACKEND names one that is not installed, such as that of a notebook in another
    virtual environment; such a name is left out. Its advice on a home that cannot be written is
    not shown.
    """
    if "matplotlib" in sys.modules:
        return _imported()
    backend = os.environ.pop("MPLBACKEND", None)
    advice = logging.getLogger("matplotlib")
    level = advice.level
    advice.setLevel(logging.ERROR)
    try:
        matplotlib = _imported()
        if backend:
            with suppress(ValueError):
                matplotlib.rcParams["backend"] = backend
    finally:
        advice.setLevel(level)
        if backend is not None:
            os.environ["MPLBACKEND"] = backend
    return matplotlib


def _imported() -> Any:
    try:
        import matplotlib
    except ImportError as error:
        raise DrawError(
            'pictures need matplotlib, which is not installed; pip install "tcstudy[plot]"'
        ) from error
    return matplotlib


def check_target(target: Path) -> None:
    """Raise DrawError unless a picture can be written there in a known format.

    Raises it, too, without matplotlib. To be called before any work is done.
    """
    if target.suffix.lower() not in SUFFIXES:
        raise DrawError(
            f"{target}: a picture's name ends in {', '.join(SUFFIXES)}; choose one of them"
        )
    if faults := check_writable(target):
        raise DrawError("; ".join(faults))
    _matplotlib()


def save(figure: Figure, target: Path, dpi: int = DPI) -> None:
    """Write a figure in the format of the suffix, in place of an old one.

    The same figure gives the same bytes. Raises DrawError if the file cannot be written, and
    leaves an old one untouched.
    """
    kind = target.suffix.lower()[1:]
    dates = {"svg": {"Date": None}, "pdf": {"CreationDate": None}}
    buffer = io.BytesIO()
    figure.savefig(buffer, format=kind, dpi=dpi, metadata=dates.get(kind))
    try:
        replace_file(target, lambda aside: aside.write_bytes(buffer.getvalue()), sealed=False)
    except StoreError as error:
        raise DrawError(str(error)) from error


def shown(figure: Figure, dpi: int = DPI) -> Figure:
    """Return the figure with its picture for a notebook, made while its style holds."""
    buffer = io.BytesIO()
    figure.savefig(buffer, format="png", dpi=dpi)
    # IPython asks an object for its picture by this name
    figure._repr_png_ = buffer.getvalue  # type: ignore[attr-defined]
    return figure


NARROW = 100.0
"""Ratio of the ends of a logarithmic axis up to which powers of ten would leave it with one tick or
none."""


def few_ticks(axis: Axis) -> None:
    """Set ticks at 1, 2 and 5 only on a logarithmic axis with a ratio below NARROW.

    Powers of ten at every digit would overlap and leave the page.
    """
    from matplotlib.ticker import FuncFormatter, LogLocator

    low, high = sorted(axis.get_view_interval())
    if high < NARROW * low:
        plain = FuncFormatter(lambda value, _: f"{value:g}")
        axis.set_minor_locator(LogLocator(subs=(2.0, 5.0)))
        axis.set_major_formatter(plain)
        axis.set_minor_formatter(plain)


_STATED = re.compile(r"(\w+) = (-?[\d.][^\s,]*)((?: [^\s,]+)*)(?=, |$)")


def point_words(text: str, symbols: Mapping[str, str]) -> str:
    """Return a point as files name it, with symbols and raised exponents.

    A file has "alpha = 100 W m-2 K-1, friction = tresca".

    symbols: of its parameters (`select_point.axis_symbols`)
    """

    def written(name: str) -> str:
        return symbols.get(name) or symbol(name)

    def with_unit(match: re.Match[str]) -> str:
        return f"{written(match[1])} = {match[2]}{pretty(match[3])}"

    named = re.sub(r"(\w+) = (?!-?[\d.])", lambda match: f"{written(match[1])}: ", text)
    return _STATED.sub(with_unit, named)
