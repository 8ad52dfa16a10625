"""`tcstudy draw`: a picture of a result file of any kind."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from tcstudy.data.provenance import kind_of
from tcstudy.data.reading import reading
from tcstudy.reports.convergence_plot import plot_convergence
from tcstudy.reports.cost_plot import plot_cost
from tcstudy.reports.path_figure import draw_path
from tcstudy.reports.point_figure import draw


def picture(
    file: Path, target: Path, point: Mapping[str, Any] | None, level: int, response: str, error: str | None
) -> str:
    """Draw a file of any kind; returns what was drawn. Raises StoreError, DrawError."""
    kind = kind_of(file)
    with reading(file):
        if kind == "path":
            return draw_path(file, target, response)
        if kind == "cost":
            return plot_cost(file, target, error)
        if kind == "convergence":
            return plot_convergence(file, target, point)
        return draw(file, target, point, level)
