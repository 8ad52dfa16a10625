"""Which points of a level are solved together, and where they begin from.

A block depends on the study and on the size of the contact line alone, so that a run that was stopped, or that others
help with, has the same blocks and in them the same numbers, to the bit. Points of a block share λ/μ; their loads are
rows of one array and their laws rows of one table (tcstudy.online).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tcstudy.data.records import BlockRecord, PointStatus
from tcstudy.offline.level import Level
from tcstudy.scene.methods import SEPARABLE
from tcstudy.scene.points import combinations
from tcstudy.scene.study import Study

Array = NDArray[np.float64]
Places = NDArray[np.intp]

POINTS, ENTRIES = 1024, 2**16
"""Points of a block at most, and entries of its arrays (P, m) to aim at, so that many have a part in the work."""
ENOUGH, MOST = 256, 2**18
"""Points from which a larger block is hardly cheaper by the point, and entries at most."""
FIELDS = 2**22
"""Numbers of whole-body fields that a block holds at most."""


@dataclass(frozen=True)
class Block:
    """Points that are solved together.

    number: which block of its level;  points: their places in the sweep in C order
    wave:   blocks that begin from solutions of other waves follow these;  ratio: which λ/μ, which all points share
    """

    number: int
    points: Places
    wave: int = 0
    ratio: int = 0


def in_blocks(study: Study) -> bool:
    """Whether points are solved together."""
    solver = study.solver
    return solver.names == (SEPARABLE,) and solver.max_iterations is None


def blocks_of(study: Study, m: int, n_points: int) -> list[Block]:
    """The blocks of a level in the order in which they are solved.

    m: contact unknowns;  n_points: nodes of the mesh
    """
    materials, of = combinations(study.scenes, "material")
    numbers: dict[object, int] = {}
    ratio = np.array([numbers.setdefault(("ratio", Level.ratio(s)), len(numbers)) for s in materials])[of]
    mu = np.array([numbers.setdefault(("mu", s.material.mu), len(numbers)) for s in materials])[of]
    laws = combinations(study.scenes, "friction")[1]
    heats, of = combinations(study.scenes, "material", "heat")
    keys = [numbers.setdefault(("thermal", s.heat.alpha, s.material.k), len(numbers)) for s in heats]
    thermal = np.array(keys)[of]
    places = np.arange(len(study.scenes))
    wave = _waves(study)
    order = np.lexsort((places, thermal, laws, mu, ratio, wave))
    size = _size(study, m, n_points)
    kind = wave[order] * (ratio.max(initial=0) + 1) + ratio[order]
    cuts = np.flatnonzero(np.diff(kind)) + 1
    parts = [part for whole in np.split(order, cuts) for part in np.array_split(whole, -(-len(whole) // size))]
    return [Block(number, p, int(wave[p[0]]), int(ratio[p[0]])) for number, p in enumerate(parts)]


def _size(study: Study, m: int, n_points: int) -> int:
    if not in_blocks(study) or study.mesh.estimates:
        return 1
    size = max(1, min(POINTS, max(ENTRIES // max(1, m), min(ENOUGH, MOST // max(1, m)))))
    return max(1, min(size, FIELDS // (3 * n_points))) if study.output.fields else size


def _waves(study: Study) -> Places:
    """(P,) how many steps back along the sweep a point has, where each begins from its neighbour's solution."""
    if study.solver.branch != "continued" or not study.shape:
        return np.zeros(len(study.scenes), dtype=np.intp)
    return np.asarray(sum(np.indices(study.shape)), dtype=np.intp).ravel()


class Solutions:
    """Contact solutions of a level found so far: where neighbours begin from."""

    def __init__(self, study: Study, m: int) -> None:
        self._shape = study.shape
        self.kept = study.solver.branch == "continued" or not in_blocks(study)
        self._v = np.full((len(study.scenes), m), np.nan) if self.kept else np.empty((0, m))

    def take(self, block: BlockRecord) -> None:
        """Remember a block's solutions."""
        if self.kept and block.u_T is not None:
            ok = block.status == PointStatus.OK
            self._v[block.points[ok]] = block.u_T[ok]

    def beside(self, points: Places) -> Array | None:
        """(P, m) the solutions one step back along the last sweep dimension that has a step back and a solution there.

        NaN in rows without one; None if the study has no use for them.
        """
        if not self.kept:
            return None
        found = np.full((len(points), self._v.shape[1]), np.nan)
        index = np.array(np.unravel_index(points, self._shape)) if self._shape else np.zeros((0, len(points)), int)
        for d in range(len(self._shape)):  # the last dimension overwrites those before
            back = index.copy()
            back[d] -= 1
            inside = np.flatnonzero(back[d] >= 0)
            v = self._v[np.ravel_multi_index(tuple(back[:, inside]), self._shape)]
            known = ~np.isnan(v).any(axis=1)
            found[inside[known]] = v[known]
        return found
