"""Where the points of a level begin from: solutions of their neighbours, and the exact solution where it is given.

The contact line has the normals of the exact curve: the mesh cuts arcs into chords; errors, and the exact solution as a
start, belong to the curve.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from tcstudy.accuracy.norms import Line
from tcstudy.data.records import BlockRecord, PointStatus
from tcstudy.exact.numbers import exact_u_T
from tcstudy.offline.level import Level
from tcstudy.scene.study import Exact, Study

Array = NDArray[np.float64]
Places = NDArray[np.intp]


class Solutions:
    """Contact solutions of a level found so far: where neighbours begin from."""

    def __init__(self, study: Study, m: int, order: Places) -> None:
        """m: contact unknowns;  order: (P,) places in the order in which they are solved"""
        self._shape, self._rank = study.shape, np.argsort(order)
        self._v = np.full((len(study.scenes), m), np.nan)

    def take(self, block: BlockRecord) -> None:
        """Remember a block's solutions."""
        if block.u_T is not None:
            ok = block.status == PointStatus.OK
            self._v[block.points[ok]] = block.u_T[ok]

    def beside(self, points: Places) -> Array:
        """(P, m) the solutions one step back along the last sweep dimension that has a step back and a solution there.

        NaN in rows without one. One that is solved later counts as none, so that a resumed run has the same bits.
        """
        found = np.full((len(points), self._v.shape[1]), np.nan)
        index = np.array(np.unravel_index(points, self._shape)) if self._shape else np.zeros((0, len(points)), int)
        for d in range(len(self._shape)):  # the last dimension overwrites those before
            back = index.copy()
            back[d] -= 1
            inside = np.flatnonzero(back[d] >= 0)
            before = np.ravel_multi_index(tuple(back[:, inside]), self._shape)
            v = self._v[before]
            known = ~np.isnan(v).any(axis=1) & (self._rank[before] < self._rank[points[inside]])
            found[inside[known]] = v[known]
        return found


def exact_at(exact: Exact, line: Line) -> Array:
    """(m,) u_T of the exact solution at the nodes of the line [m]."""
    return line.at_nodes(exact_u_T(exact))


def contact_line(level: Level) -> Line:
    """The contact line with the exact curve's normals at both ends of every segment."""
    line, mesh = level.line, level.mesh
    return Line(mesh.points, line.segments, mesh.end_normals[line.which], line.nodes, line.c)
