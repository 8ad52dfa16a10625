"""Values by point on their way into a result file: windows of its chunks, filled by blocks in whatever order.

A window is a run of tiles, which follow one another as the points of the sweep do (`tcstudy.data.writer`). One that is
full is written, every chunk once.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from tcstudy.data.provenance import without_paths
from tcstudy.data.records import BlockRecord
from tcstudy.data.schema import MISSING_COUNT, SWEEP, FileVariable
from tcstudy.data.writer import CHUNK, define, tile_shape, tiles
from tcstudy.scene.study import Study

if TYPE_CHECKING:
    import netCDF4

Arrays = dict[str, np.ndarray[Any, Any]]
Places = np.ndarray[Any, np.dtype[np.intp]]

MEMORY = 2**26
"""Bytes of results that the writer holds at a time; a longer sweep takes several passes over its records."""


@dataclass(frozen=True, eq=False)
class Section:
    """Variables by point of one group: the root, which has all levels, or the contact line of one level.

    level: None for the root;  group: where they stand;  tile: extent of their chunks along the sweep
    after: sizes of the dimensions after those of the sweep, by variable
    """

    level: int | None
    group: netCDF4.Dataset
    variables: tuple[FileVariable, ...]
    tile: tuple[int, ...]
    after: dict[str, tuple[int, ...]]

    @property
    def point_bytes(self) -> int:
        """Bytes that a point takes in memory."""
        return sum(math.prod(self.after[v.name]) * _width(v) for v in self.variables)


@dataclass(frozen=True, eq=False)
class Window:
    """A run of places of a section, as many tiles as fit into memory, and what their points have there.

    places: start, stop;  arrays: (stop − start, …) by variable
    """

    section: Section
    start: int
    stop: int
    arrays: Arrays

    @classmethod
    def empty(cls, section: Section, start: int, stop: int) -> Window:
        """Without any value."""
        arrays = {v.name: missing(v, (stop - start, *section.after[v.name])) for v in section.variables}
        return cls(section, start, stop, arrays)


def _width(variable: FileVariable) -> int:
    return 8 if variable.dtype == "str" else np.dtype(variable.dtype).itemsize


def section_of(
    level: int | None, group: netCDF4.Dataset, study: Study, variables: Iterable[FileVariable], sizes: dict[str, int]
) -> Section:
    """Define the variables by point of a group."""
    own = tuple(v for v in variables if SWEEP in v.dims)
    after = {v.name: tuple(sizes[d] for d in v.dims if d != SWEEP) for v in own}
    widest = max(math.prod(after[v.name]) * _width(v) for v in own)
    tile = tile_shape(study.shape, max(1, CHUNK // max(1, widest)))
    for variable in own:
        define(group, variable, study, (*tile, *after[variable.name]))
    return Section(level, group, own, tile, after)


def passes(
    sections: Sequence[Section], study: Study, written: Collection[tuple[int | None, int]] = ()
) -> Iterator[list[Window]]:
    """Windows over all sections, but for tiles `written` (level, start), as many at a time as MEMORY holds."""
    batch: list[Window] = []
    left = MEMORY
    for section in sections:
        tile_points, cost = math.prod(section.tile), max(1, section.point_bytes)
        size = max(1, MEMORY // (cost * tile_points)) * tile_points
        for start, stop in _runs(section, study, written, size):
            if batch and cost * (stop - start) > left:
                yield batch
                batch, left = [], MEMORY
            batch.append(Window.empty(section, start, stop))
            left -= cost * (stop - start)
    if batch:
        yield batch


def _runs(
    section: Section, study: Study, written: Collection[tuple[int | None, int]], size: int
) -> Iterator[tuple[int, int]]:
    """(start, stop) of runs of tiles of at most `size` points that are not written."""
    run: tuple[int, int] | None = None
    for _, start, stop in tiles(study.shape, section.tile):
        if run and ((section.level, start) in written or stop - run[0] > size):
            yield run
            run = None
        if (section.level, start) not in written:
            run = (run[0] if run else start, stop)
    if run:
        yield run


def missing(variable: FileVariable, shape: tuple[int, ...]) -> np.ndarray[Any, Any]:
    """An array full of missing values."""
    return np.full(shape, variable.missing, dtype=object if variable.dtype == "str" else variable.dtype)


def take_block(window: Window, block: BlockRecord, places: Places) -> int:
    """Put the points of a block that lie in a window in their places; how many there are."""
    if window.section.level not in (None, block.level):
        return 0
    rows = np.flatnonzero((places >= window.start) & (places < window.stop))
    if not len(rows):
        return 0
    at = places[rows] - window.start
    if window.section.level is None:
        _take_numbers(window.arrays, block, rows, at)
        return len(rows)
    known = np.zeros(0, dtype=bool) if block.u_T is None else ~np.isnan(block.u_T[rows]).any(axis=1)
    for name, line in (("u_T", block.u_T), ("xi", block.xi), ("sticks", block.sticks)) if known.any() else ():
        if line is not None and name in window.arrays:
            window.arrays[name][at[known]] = line[rows[known]]
    return len(rows)


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


def put_window(window: Window, study: Study) -> None:
    """Write a window tile by tile, each a hyperslab."""
    section = window.section
    for variable in section.variables:
        array, new = window.arrays.pop(variable.name), section.group[variable.name]
        for cut, start, stop in tiles(study.shape, section.tile):
            if not window.start <= start < window.stop:
                continue
            values = array[start - window.start : stop - window.start]
            if variable.dtype == "str" and not values.any():
                continue  # what is never written is empty, and costs nothing
            new[cut] = values.reshape(*(s.stop - s.start for s in cut), *values.shape[1:])
