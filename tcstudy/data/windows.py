"""Values by point on their way into a result file: windows of its chunks, filled by blocks in whatever order.

A window is a run of tiles, which follow one another as the points of the sweep do (`tcstudy.data.writer`). One that is
full is written, every chunk once.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from tcstudy.data.provenance import without_paths
from tcstudy.data.records import BlockRecord
from tcstudy.data.schema import MISSING_COUNT, SWEEP, FileVariable
from tcstudy.data.writer import CHUNK, Places, define, tile_shape, tiles
from tcstudy.scene.study import Study

if TYPE_CHECKING:
    import netCDF4

Arrays = dict[str, np.ndarray[Any, Any]]
Tile = tuple[tuple[slice, ...], int, int]
"""(slices, first place, place after the last), as from `tcstudy.data.writer.tiles`."""

MEMORY = 2**26
"""Bytes of results that the writer holds at a time; a longer sweep takes several passes over its records."""


@dataclass(frozen=True, eq=False)
class Section:
    """Variables by point of one group: the root, which has all levels, or the contact line of one level.

    level: None for the root;  group: where they stand;  runs: the tiles of every window;  starts: its first place
    after: sizes of the dimensions after those of the sweep, by variable;  point_bytes: what a point takes in memory
    """

    level: int | None
    group: netCDF4.Dataset
    variables: tuple[FileVariable, ...]
    runs: list[list[Tile]]
    starts: list[int]
    after: dict[str, tuple[int, ...]]
    point_bytes: int

    def bytes_of(self, run: list[Tile]) -> int:
        """What a window takes in memory."""
        return (run[-1][2] - run[0][1]) * self.point_bytes

    def window(self, number: int) -> Window:
        """A window without any value."""
        run = self.runs[number]
        start, stop = run[0][1], run[-1][2]
        arrays = {v.name: missing(v, (stop - start, *self.after[v.name])) for v in self.variables}
        return Window(self, run, start, stop, arrays)


@dataclass(eq=False)
class Window:
    """A run of tiles of a section, and what their points have there.

    start, stop: places;  arrays: (stop − start, …) by variable;  taken: how many points have come, on all levels
    """

    section: Section
    run: list[Tile]
    start: int
    stop: int
    arrays: Arrays
    taken: int = 0

    def take(self, block: BlockRecord, places: Places) -> None:
        """Put the points of a block that lie in the window in their places."""
        rows = np.flatnonzero((places >= self.start) & (places < self.stop))
        at = places[rows] - self.start
        self.taken += len(rows)
        if self.section.level is None:
            _take_numbers(self.arrays, block, rows, at)
            return
        known = np.zeros(0, dtype=bool) if block.u_T is None else ~np.isnan(block.u_T[rows]).any(axis=1)
        for name, line in (("u_T", block.u_T), ("xi", block.xi), ("sticks", block.sticks)) if known.any() else ():
            if line is not None:
                self.arrays[name][at[known]] = line[rows[known]]


def _width(variable: FileVariable) -> int:
    return 8 if variable.dtype == "str" else np.dtype(variable.dtype).itemsize


def section_of(
    level: int | None, group: netCDF4.Dataset, study: Study, variables: Iterable[FileVariable], sizes: dict[str, int]
) -> Section:
    """Define the variables by point of a group, which goes to the disk by windows of a quarter of MEMORY."""
    own = tuple(v for v in variables if SWEEP in v.dims)
    after = {v.name: tuple(sizes[d] for d in v.dims if d != SWEEP) for v in own}
    widths = {v.name: math.prod(after[v.name]) * _width(v) for v in own}
    tile = tile_shape(study.shape, max(1, CHUNK // max(1, *widths.values())))
    for variable in own:
        define(group, variable, study, (*tile, *after[variable.name]))
    point_bytes = sum(widths.values())
    every = list(tiles(study.shape, tile))
    count = max(1, MEMORY // (4 * max(1, point_bytes) * math.prod(tile)))
    runs = [every[i : i + count] for i in range(0, len(every), count)]
    return Section(level, group, own, runs, [run[0][1] for run in runs], after, point_bytes)


def missing(variable: FileVariable, shape: tuple[int, ...]) -> np.ndarray[Any, Any]:
    """An array full of missing values."""
    return np.full(shape, variable.missing, dtype=object if variable.dtype == "str" else variable.dtype)


def _take_numbers(arrays: Arrays, block: BlockRecord, rows: Places, at: Places) -> None:
    """Status, reason and numbers of some rows of a block, to their places in the arrays of the root."""
    words = np.full(len(block), "", dtype=object)
    for row, reason in block.reasons.items():
        words[row] = without_paths(reason)
    arrays["status"][at, block.level] = block.status[rows]
    arrays["reason"][at, block.level] = words[rows]
    for name, values in block.numbers.items():
        array, found = arrays[name][:, block.level], values[rows]
        if array.dtype.kind != "f":
            # NaN stands for missing: of several values of a point each for itself, a single one leaves what is there
            none = MISSING_COUNT if found.ndim > 1 else array[at]
            missing = np.isnan(found)
            found = np.where(missing, none, np.where(missing, 0.0, found))
        array[at] = found


def put_window(window: Window) -> None:
    """Write a window tile by tile, each a hyperslab."""
    for variable in window.section.variables:
        array, new = window.arrays.pop(variable.name), window.section.group[variable.name]
        for cut, start, stop in window.run:
            values = array[start - window.start : stop - window.start]
            if variable.dtype == "str" and not values.any():
                continue  # what is never written is empty, and costs nothing
            new[cut] = values.reshape(*(s.stop - s.start for s in cut), *values.shape[1:])
