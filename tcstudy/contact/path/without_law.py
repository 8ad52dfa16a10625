"""Follow a path of the unknowns that have a law; those without one are linear in them.

Where edges lift off without friction, half of the unknowns have the law b ≡ 0. A piece of a path
takes time ∝ m², so that these are eliminated before: with f the rows without a law,
Ã_ff u_f = l̃_f − Ã_fk u_k.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import scipy.linalg
from numpy.typing import NDArray

from tcstudy.contact.path.problem import ParametricProblem, Path

Array = NDArray[np.float64]
Index = NDArray[np.intp]


@dataclass(frozen=True)
class LawfulRows:
    """The rows of a problem that have a law, and those without as functions of them.

    full:    the problem of all rows
    rows:    (k,) rows with a law;  free_rows: (f,) those without
    problem: that of the rows with a law
    u_0, u_1, U: u_f = u_0 + t u_1 + U u_k, (f,), (f,) and (f, k)
    """

    full: ParametricProblem
    rows: Index
    free_rows: Index
    problem: ParametricProblem
    u_0: Array
    u_1: Array
    U: Array

    @classmethod
    def of(cls, full: ParametricProblem) -> LawfulRows | None:
        """Return the rows of a problem in two directions, None if all have a law or none has.

        Without openings, and for a body that contact alone holds, it is None, too.
        """
        vanishes = _vanishes(full)
        if not full.blocks or full.loose or np.all(vanishes) or not np.any(vanishes):
            return None
        rows = np.flatnonzero(~vanishes)
        free_rows = np.flatnonzero(vanishes)
        A = full.A_tilde
        factor = scipy.linalg.cho_factor(A[np.ix_(free_rows, free_rows)])
        coupling = A[np.ix_(free_rows, rows)]
        right = np.column_stack([full.l_0[free_rows], full.l_1[free_rows], -coupling])
        u_0, u_1, *columns = scipy.linalg.cho_solve(factor, right).T
        U = np.array(columns).T
        A_kept = A[np.ix_(rows, rows)] + coupling.T @ U
        n_slips = int(np.count_nonzero(rows < full.blocks[0]))
        problem = replace(
            full,
            A_tilde=0.5 * (A_kept + A_kept.T),
            l_0=full.l_0[rows] - coupling.T @ u_0,
            l_1=full.l_1[rows] - coupling.T @ u_1,
            c=full.c[rows],
            law=full.law.of_nodes(rows),
            blocks=(n_slips, len(rows) - n_slips),
        )
        return cls(full, rows, free_rows, problem, u_0, u_1, U)

    def full_path(self, path: Path) -> Path:
        """Return the path of all rows from that of the rows with a law."""
        full = self.full
        u = np.empty((len(path.t), full.m))
        u[:, self.rows] = path.u
        u[:, self.free_rows] = self.u_0 + path.t[:, None] * self.u_1 + path.u @ self.U.T
        traction = np.zeros_like(u)
        traction[:, self.rows] = path.traction
        codes = np.empty((path.pieces, full.m), dtype=np.int32)
        codes[:, self.rows] = path.codes
        codes[:, self.free_rows] = full.graph.first[self.free_rows]
        load = full.l_0 + path.t[:, None] * full.l_1
        defect = np.abs(load - u @ full.A_tilde - traction * full.c) / full.c
        residual = np.max(defect, axis=1) / full.traction_scale
        return replace(path, problem=full, u=u, traction=traction, codes=codes, residual=residual)


def _vanishes(problem: ParametricProblem) -> NDArray[np.bool_]:
    """Return which rows (m,) have the law b ≡ 0."""
    table = problem.law.tables
    vanishes = [law.vanishes for law in table.laws]
    return np.array(vanishes)[problem.law.node_index(problem.m)]
