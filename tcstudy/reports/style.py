"""What the pictures share: colours, letters, units, saving, and the error of a picture that cannot be made.

matplotlib is imported when a picture is made, so that the package works without it; pyplot and its list of open
figures are not used at all.
"""

from __future__ import annotations

import io
import math
import re
from collections.abc import Iterable
from contextlib import AbstractContextManager
from pathlib import Path
from typing import TYPE_CHECKING, Any

from tcstudy.data.files import place_faults, replace_file
from tcstudy.errors import DrawError, StoreError
from tcstudy.reports.text import POWER_FIRST, prefix

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

WIDTH = 8.0
"""Width of every picture [inch]."""

DPI = 160
"""Pixels per inch of a PNG."""

SUFFIXES = (".png", ".svg", ".pdf")

INK, PALE, SHADE = "#222222", "#8a8a8a", "#dedede"
BLUE, VERMILLION = "#0072b2", "#d55e00"
"""From the palette of Okabe and Ito, told apart with every kind of colour vision."""

EVEN = "#fed976"
"""Of the colours of HEAT, the one for a body of one temperature."""

LETTER = 0.09
"""Width of a bold letter [inch], to know what fits."""

HEAT = "YlOrRd"
"""Colour map of the body: light enough for dark lines and letters on most of its range."""

_RAISED = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")

_STYLE: dict[Any, Any] = {
    "font.size": 9.5,
    "axes.titlesize": 9.5,
    "axes.labelsize": 9.5,
    "xtick.labelsize": 8.5,
    "ytick.labelsize": 8.5,
    "axes.edgecolor": PALE,
    "axes.labelcolor": INK,
    "text.color": INK,
    "text.usetex": False,
    "xtick.color": PALE,
    "ytick.color": PALE,
    "xtick.labelcolor": INK,
    "ytick.labelcolor": INK,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.unicode_minus": True,
    "svg.hashsalt": "tcstudy",
    "svg.fonttype": "none",  # text that other programs can edit and search
    "pdf.fonttype": 42,  # TrueType: journals refuse Type 3
}


def styled() -> AbstractContextManager[None]:
    """The settings of the pictures, for the time of a `with`; raises DrawError if there is no matplotlib."""
    settings: AbstractContextManager[None] = _matplotlib().rc_context(_STYLE)
    return settings


def _matplotlib() -> Any:
    try:
        import matplotlib
    except ImportError as error:
        raise DrawError('pictures need matplotlib, which is not installed; pip install "tcstudy[plot]"') from error
    return matplotlib


def check_target(target: Path) -> None:
    """Raise DrawError, before any work is done, unless the name asks for a known format and pictures can be put there.

    Raises it, too, where there is no matplotlib.
    """
    if target.suffix.lower() not in SUFFIXES:
        raise DrawError(f"{target}: a picture's name ends in {', '.join(SUFFIXES)}; choose one of them")
    if faults := place_faults(target):
        raise DrawError("; ".join(faults))
    _matplotlib()


def save(figure: Figure, target: Path) -> None:
    """Write a figure in the format of the suffix in place of an old one; the same figure gives the same bytes.

    Raises DrawError if the file cannot be written; an old one is then untouched.
    """
    kind = target.suffix.lower()[1:]
    dates = {"svg": {"Date": None}, "pdf": {"CreationDate": None}}
    buffer = io.BytesIO()
    figure.savefig(buffer, format=kind, dpi=DPI, metadata=dates.get(kind))

    def put(aside: Path) -> None:
        aside.write_bytes(buffer.getvalue())

    try:
        replace_file(target, put, sealed=False)
    except StoreError as error:
        raise DrawError(str(error)) from error


def inches(figure: Figure, left: float, bottom: float, width: float, height: float) -> Axes:
    """New axes at a place counted in inches from the lower left corner."""
    across, up = figure.get_size_inches()
    return figure.add_axes((left / across, bottom / up, width / across, height / up))


def scaled_unit(values: Iterable[float], units: str) -> tuple[float, str]:
    """(divisor, unit) that bring the largest magnitude to 1 … 1000, where a prefix suits the unit."""
    if POWER_FIRST.match(units):
        return 1.0, units
    return prefix([max((abs(float(v)) for v in values), default=0.0)], units)


def axis_unit(values: Iterable[float], units: str) -> tuple[float, str]:
    """As `scaled_unit`; plain numbers that are very large or small get a power of ten, "10⁻⁵"."""
    largest = max((abs(float(v)) for v in values), default=0.0)
    if units != "1" or largest == 0.0 or 1e-2 <= largest < 1e4:
        return scaled_unit([largest], units)
    power = math.floor(math.log10(largest))
    return 10.0**power, f"10{str(power).translate(_RAISED)}"


def pretty(units: str) -> str:
    """Units with raised exponents, "W m⁻² K⁻¹"; empty for a plain number."""
    if units == "1":
        return ""
    return re.sub(r"(?<=[A-Za-z])-?\d+", lambda power: power[0].translate(_RAISED), units)


def labelled(name: str, units: str) -> str:
    """Text for an axis: the name with its units."""
    return f"{name} [{pretty(units)}]" if pretty(units) else name
