"""Panels of the charts of the benchmarks, placed by hand."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


def inches(figure: Figure, left: float, bottom: float, width: float, height: float) -> Axes:
    """New axes at a place counted in inches from the lower left corner."""
    across, up = figure.get_size_inches()
    return figure.add_axes((left / across, bottom / up, width / across, height / up))
