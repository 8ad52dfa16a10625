"""Points inside a body at which expressions are looked at."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from tcstudy.scene.records import Body
from tcstudy.shapes.edges import loop_size
from tcstudy.shapes.faults import loop_polygon

Array = NDArray[np.float64]

GRID = 40
SHIFT = 0.38
"""Where the points lie between lines of the grid: not in the middle, where symmetric functions vanish or bend."""

INWARD = 1e-10
"""Share of the body's size, or of a grid's width, by which points lie off edges and kinks where slopes are taken: there
abs(y) or atan2 may round to the other side."""


def grid(body: Body, count: int = GRID) -> tuple[Array, Array, NDArray[np.bool_]]:
    """A grid over the bounding box, x and y (count, count), and which of its points lie inside the body."""
    import shapely

    assert body.outline is not None
    polygon = loop_polygon(body.outline, loop_size(body.outline))
    x0, y0, x1, y1 = polygon.bounds
    t = (np.arange(count) + SHIFT) / count
    x, y = np.meshgrid(x0 + t * (x1 - x0), y0 + t * (y1 - y0))
    within = shapely.contains_xy(polygon, x, y)
    for hole in body.holes:
        within &= ~shapely.contains_xy(loop_polygon(hole, loop_size(hole)), x, y)
    return x, y, np.asarray(within)


def inside(body: Body) -> Array:
    """(n, 2) points inside the body."""
    x, y, within = grid(body)
    return np.column_stack([x[within], y[within]])
