"""Follow a path of the unknowns that have a law (contact/without_law.py)."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from tcstudy.contact.path.problem import ParametricProblem, Path
from tcstudy.contact.without_law import Elimination

Array = NDArray[np.float64]


@dataclass(frozen=True)
class LawfulRows:
    """The rows of a problem that have a law.

    full:    the problem of all rows;  problem: that of the rows with a law
    """

    full: ParametricProblem
    problem: ParametricProblem
    elimination: Elimination

    @classmethod
    def of(cls, full: ParametricProblem) -> LawfulRows | None:
        """Return the rows of a problem with openings, None if all have a law or none has.

        For a body that contact alone holds it is None, too.
        """
        elimination = Elimination.of(full.A_tilde, full.law, full.blocks, full.loose)
        if elimination is None:
            return None
        rows = elimination.rows
        problem = replace(
            full,
            A_tilde=elimination.kept,
            l_0=elimination.load(full.l_0),
            l_1=elimination.load(full.l_1),
            c=full.c[rows],
            law=full.law.of_nodes(rows),
            blocks=elimination.blocks(full.blocks),
        )
        return cls(full, problem, elimination)

    def states(self, t: Array, u: Array, traction: Array) -> tuple[Array, Array]:
        """Return displacements and tractions (n, m) of all rows from (n, k) those with a law."""
        load = self.full.l_0 + t[:, None] * self.full.l_1
        return self.elimination.displacements(u, load), self.elimination.spread(traction)

    def kept_path(self, path: Path) -> Path:
        """Return the path of the rows with a law from that of all rows."""
        rows = self.elimination.rows
        u, traction, codes = path.u[:, rows], path.traction[:, rows], path.codes[:, rows]
        return replace(path, problem=self.problem, u=u, traction=traction, codes=codes)

    def full_path(self, path: Path) -> Path:
        """Return the path of all rows from that of the rows with a law."""
        full, elimination = self.full, self.elimination
        load = full.l_0 + path.t[:, None] * full.l_1
        u, traction = self.states(path.t, path.u, path.traction)
        codes = elimination.spread(path.codes)
        codes[:, elimination.free_rows] = full.graph.first[elimination.free_rows]
        defect = np.abs(load - u @ full.A_tilde - traction * full.c) / full.c
        residual = np.max(defect, axis=1) / full.traction_scale
        return replace(path, problem=full, u=u, traction=traction, codes=codes, residual=residual)
