"""Which of the lowest solutions of a path are proved to be global minima: those in the middle of every interval."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from tcstudy.contact.certificates import Proofs
from tcstudy.contact.path.query import Lowest
from tcstudy.contact.path.record import Path
from tcstudy.contact.problem import CondensedBody, ContactProblem
from tcstudy.scene.study import Acceptance

_AT_ONCE = 2**20
"""Entries of the arrays of solutions that are proved together."""


def proved_minima(path: Path, low: Lowest, lambda_1: float, acceptance: Acceptance) -> NDArray[np.bool_]:
    """(n,) whether the lowest solution in the middle of every interval is proved to have the least energy of all.

    lambda_1: λ_min(C^{−½}ÃC^{−½}) [Pa/m];  acceptance: which residual makes a solution
    """
    along, proved = path.problem, np.zeros(len(low.piece), dtype=bool)
    problem, law = along.at(0.0), along.law
    body = CondensedBody.known(along.A_tilde, along.c, problem.A_error, lambda_1=lambda_1)
    index = np.atleast_2d(law.index)
    for own in np.array_split(np.arange(len(proved)), 1 + len(proved) * along.m // _AT_ONCE):
        t, k = 0.5 * (low.begin + low.end)[own], low.piece[own]
        share = (t - path.t[k]) / (path.t[k + 1] - path.t[k])
        v = path.u[k] + share[:, None] * (path.u[k + 1] - path.u[k])
        laws = law.tables.at(np.broadcast_to(index, (len(own), index.shape[1])))
        rows = ContactProblem.on(body, along.l_0 + t[:, None] * along.l_1, laws)
        residuals = zip(rows.inclusion_residual(v).tolist(), rows.xi_rounding(v).tolist(), strict=True)
        solved = np.array([acceptance.accepts(*pair) for pair in residuals], dtype=bool)
        proofs = Proofs(rows)
        proofs.prove_unique()
        proofs.prove_lowest(np.flatnonzero(solved), v)
        proved[own] = solved & (proofs.unique | proofs.lowest)
    return proved
