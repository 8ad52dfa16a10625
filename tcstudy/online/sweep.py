"""Any number of points on one body, in blocks that depend on the points alone.

Points are sorted by law and cut into blocks of fixed size; a block's numbers depend on its own points only, so that
they are the same to the bit whoever solves which block, and a run that was stopped solves incomplete blocks anew.
Branch "continued" goes in waves: first the points without a neighbour, then those whose neighbours are solved, and so
on.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from tcstudy.online.block import Options, solve_block
from tcstudy.online.body import CondensedBody
from tcstudy.online.law_tables import LawTables
from tcstudy.online.problems import BlockAnswers, joined
from tcstudy.online.row_laws import RowLaws

Array = NDArray[np.float64]
Index = NDArray[np.intp]

POINTS, ENTRIES = 1024, 2**18
"""Points of a block at most, and entries of its arrays (P, m)."""


def solve_points(
    body: CondensedBody,
    loads: Array,
    tables: LawTables,
    law: Index,
    options: Options | None = None,
    neighbour: Index | None = None,
) -> BlockAnswers:
    """Solve and certify P points, in their order.

    loads:     (P, m) l̃ of every point [N/m]
    law:       (P,) row of the tables
    neighbour: (P,) the point whose solution branch "continued" begins from, −1 for none

    Raises ValueError if neighbours go in a circle.
    """
    options = options or Options()
    continued = options.branch == "continued" and neighbour is not None
    stages = waves(neighbour) if continued and neighbour is not None else [np.arange(len(law), dtype=np.intp)]
    known, parts, order = np.full(loads.shape, np.nan), [], []
    for stage in stages:
        for points in blocks(law[stage], body.m):
            own = stage[points]
            used, rows = np.unique(law[own], return_inverse=True)
            laws = RowLaws(tables.take(used), rows.reshape(-1, 1))
            near = known[neighbour[own]] if continued and neighbour is not None else None
            if near is not None and neighbour is not None:
                near[neighbour[own] < 0] = np.nan
            parts.append(solve_block(body, loads[own], laws, options, near))
            known[own[parts[-1].status == 0]] = parts[-1].v[parts[-1].status == 0]
            order.append(own)
    return joined(parts).take(np.argsort(np.concatenate(order), kind="stable"))


def blocks(law: Index, m: int) -> list[Index]:
    """The points of every block, sorted by law: which they are depends on the laws' order and m only."""
    size = max(1, min(POINTS, ENTRIES // max(1, m)))
    order = np.argsort(law, kind="stable")
    return [order[first : first + size] for first in range(0, len(order), size)]


def waves(neighbour: Index) -> list[Index]:
    """Points by how many neighbours their chain of neighbours has (−1 ends a chain)."""
    left, done, found = np.arange(len(neighbour), dtype=np.intp), np.zeros(len(neighbour) + 1, dtype=bool), []
    done[-1] = True  # what −1 addresses
    while len(left):
        ready = done[neighbour[left]]
        if not np.any(ready):
            raise ValueError(
                f"the neighbours of {len(left)} points go in a circle, so none of them can be solved first"
            )
        found.append(left[ready])
        done[left[ready]] = True
        left = left[~ready]
    return found
