"""A start from coarser copies of a contact problem (nested iteration).

The coarse problem is the Galerkin restriction to every second contact node with linear interpolation P:
Ã_c = PᵀÃP, l̃_c = Pᵀl̃, c_c = Pᵀc and the same law; it is a contact problem again and costs an eighth. The nodes are
taken in the order of their numbers, along Γ_C; another order costs quality of the start, never correctness.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import scipy.sparse
from numpy.typing import NDArray

from tcstudy.solve.nodal_pieces import energy_change
from tcstudy.solve.problem import ContactProblem

Array = NDArray[np.float64]


def interpolation(m: int) -> scipy.sparse.csr_matrix:
    """(m, ⌈m/2⌉) linear interpolation from the nodes 0, 2, 4, …"""
    coarse = (m + 1) // 2
    node = np.arange(m)
    columns = np.concatenate([node // 2, np.minimum((node + 1) // 2, coarse - 1)])
    rows = np.concatenate([node, node])
    return scipy.sparse.csr_matrix((np.full(2 * m, 0.5), (rows, columns)), shape=(m, coarse))


def restricted(problem: ContactProblem, P: scipy.sparse.csr_matrix) -> ContactProblem:
    """The Galerkin restriction of a problem to the columns of P."""
    A_coarse = P.T @ (P.T @ problem.A_tilde).T
    return ContactProblem(
        np.ascontiguousarray(0.5 * (A_coarse + A_coarse.T)),
        P.T @ problem.l_tilde,
        P.T @ problem.c,
        problem.law,
    )


def coarse_start(
    problem: ContactProblem, x0: Array, solve: Callable[[ContactProblem, Array], Array], smallest: int
) -> Array:
    """x0, or the interpolated solution of the coarser problem where its energy is lower (m,).

    solve:    solves one level from a start
    smallest: problems of at most this size are not coarsened further
    """
    if problem.m <= smallest:
        return x0
    P = interpolation(problem.m)
    coarse = restricted(problem, P)
    interpolated = P @ solve(coarse, coarse_start(coarse, x0[::2], solve, smallest))
    step = interpolated - x0
    lower = energy_change(problem, x0, problem.xi(x0), step, problem.A_tilde @ step) < 0.0
    return interpolated if lower else x0
