"""Exact one-dimensional pieces of Ψ at the nodes: integrals of b, next up-jump, one-sided slopes and energies.

Ψ(v) = Σ c_i j(v_i) is separable, so everything nonsmooth in L̃ happens node by node and is known in closed form.
Differences of energy are summed from small terms instead of subtracting two energies: near a solution the
difference is far below the rounding of L̃ itself.

Newton's equations on the free nodes are (A_FF + C q_F) d_F = −g_F. A falling piece contributes a negative slope q;
where that makes the matrix indefinite the falls are lifted to zero, since Ã alone is positive definite. (Lifting them
in halves first saved no iterations in trials and cost more factorisations.)
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.linalg
from numpy.typing import NDArray

from tcstudy.contact.problem import ContactProblem
from tcstudy.laws.pieces import BEND

Array = NDArray[np.float64]
Index = NDArray[np.intp]


@dataclass(frozen=True)
class Slopes:
    """One-sided first-order information at v, all (m,).

    left, right: derivatives of L̃ in v_i from the left and from the right [N/m]
    descent:     the steeper descending one of both (the derivative itself where L̃ is smooth), 0 at rest
    at_jump:     v_i sits bitwise on a jump of b
    """

    left: Array
    right: Array
    descent: Array
    at_jump: NDArray[np.bool_]

    @property
    def at_rest(self) -> NDArray[np.bool_]:
        """Nodes on an up-jump that hold: left ≤ 0 ≤ right."""
        return self.at_jump & (self.descent == 0.0)


def slopes(problem: ContactProblem, v: Array, xi: Array) -> Slopes:
    """One-sided slopes c b(v∓0) − ξ of L̃ and the descending one of both."""
    law = problem.law
    at = law.locate(v)
    left = problem.c * law.value(v, at.piece) - xi
    right = problem.c * law.value(v, at.piece + at.on) - xi
    return slopes_of(left, right, law.kind(at) != BEND)


def slopes_of(left: Array, right: Array, at_jump: NDArray[np.bool_]) -> Slopes:
    """The record from the one-sided slopes."""
    climb_right, climb_left = np.maximum(-right, 0.0), np.maximum(left, 0.0)
    descent = np.where(climb_right >= climb_left, -climb_right, climb_left)
    return Slopes(left, right, np.where(at_jump, descent, right), at_jump)


def energy_change(problem: ContactProblem, v: Array, xi: Array, step: Array, A_step: Array) -> float:
    """L̃(v + step) − L̃(v), summed from the small terms −ξᵀstep + ½ stepᵀÃ step + Σ c_i ∫ b [J/m]."""
    friction = problem.c * problem.law.integral(v, v + step)
    return float(np.sum(friction - xi * step + 0.5 * step * A_step))


class IndefiniteSystem(ValueError):
    """Ã itself (with all falls of b lifted to zero) has no Cholesky factor."""


@dataclass(frozen=True)
class FreeSystem:
    """Cholesky factor of A_FF + C q_F and how it was obtained.

    free:           (n,) indices of the free nodes
    factor:         lower factor, Fortran order (upper part not meaningful)
    factorisations: factorisations tried
    curvature:      None if A_FF + C q_F itself is positive definite; else the slopes were lifted, and this is a
                    direction (n,) with dᵀ(A_FF + C q_F)d ≤ 0
    """

    free: Index
    factor: Array
    factorisations: int
    curvature: Array | None

    def solve(self, rhs: Array) -> Array:
        """(A_FF + C q_F)⁻¹ rhs."""
        return scipy.linalg.lapack.dpotrs(self.factor, rhs, lower=1)[0]


def submatrix(M: Array, nodes: Index) -> Array:
    """M[nodes, nodes] of growing nodes as a new matrix; slices where these follow one another, as a zone that slips."""
    n = len(nodes)
    first, last = (int(nodes[0]), int(nodes[-1])) if n else (0, -1)
    if last - first == n - 1:
        return M[first : last + 1, first : last + 1].copy()
    left = int(np.searchsorted(nodes - np.arange(n), first, side="right"))  # nodes of the first run
    if last - int(nodes[left]) != n - left - 1:
        return M.take(nodes, axis=0).take(nodes, axis=1)  # faster than one fancy index
    matrix, a, b = np.empty((n, n)), slice(first, first + left), slice(last - n + left + 1, last + 1)
    matrix[:left, :left], matrix[:left, left:] = M[a, a], M[a, b]
    matrix[left:, :left], matrix[left:, left:] = M[b, a], M[b, b]
    return matrix


def with_diagonal(M: Array, nodes: Index, added: Array) -> Array:
    """M[nodes, nodes] + diag `added`."""
    matrix = submatrix(M, nodes)
    matrix.reshape(-1)[:: len(nodes) + 1] += added
    return matrix


def cholesky(matrix: Array) -> tuple[Array, int]:
    """Lower factor of a symmetric C-ordered matrix (overwritten) and LAPACK's info (0 if positive definite)."""
    factor, info = scipy.linalg.lapack.dpotrf(matrix.T, lower=1, clean=0, overwrite_a=1)
    return factor, int(info)


def factor_free(A_tilde: Array, free: Index, added: Array) -> tuple[Array, int]:
    """Cholesky factor of A_FF + diag `added` and LAPACK's info (0 if positive definite)."""
    return cholesky(with_diagonal(A_tilde, free, added)) if len(free) else (np.zeros((0, 0)), 0)


def factorise(problem: ContactProblem, free: Index, slope: Array) -> FreeSystem:
    """Factor A_FF + C q_F, or with all falls lifted to zero; q = `slope` (n,) of the free nodes' pieces [Pa/m].

    Raises IndefiniteSystem if even q ≥ 0 fails.
    """
    diagonal = np.diagonal(problem.A_tilde)[free]
    tried, curvature = 0, None
    for q in (slope, np.maximum(slope, 0.0)):
        shifted = diagonal + problem.c[free] * q
        if np.all(shifted > 0.0):
            factor, info = factor_free(problem.A_tilde, free, problem.c[free] * q)
            tried += 1
            if info == 0:
                return FreeSystem(free, factor, tried, curvature)
            if curvature is None:
                curvature = negative_direction(factor, info, problem.A_tilde[free[info - 1], free])
        elif curvature is None:
            curvature = np.where(np.arange(len(free)) == np.argmin(shifted / diagonal), 1.0, 0.0)
    raise IndefiniteSystem


def negative_direction(factor: Array, info: int, row: Array) -> Array:
    """From a factorisation of H that broke down at pivot `info`: d with dᵀHd ≤ 0; row: (n,) of H that fails."""
    k, direction = info - 1, np.zeros(len(factor))
    direction[k] = 1.0
    if k:
        direction[:k] = -scipy.linalg.lapack.dpotrs(np.asfortranarray(factor[:k, :k]), row[:k], lower=1)[0]
    return direction


def negative_curvature(A_tilde: Array, free: Index, added: Array) -> Array | None:
    """(n,) d with dᵀ(A_FF + diag `added`)d ≤ 0, None if that matrix is positive definite."""
    diagonal = np.diagonal(A_tilde)[free]
    if np.any(diagonal + added <= 0.0):
        return np.where(np.arange(len(free)) == np.argmin((diagonal + added) / diagonal), 1.0, 0.0)
    factor, info = factor_free(A_tilde, free, added)
    return None if info == 0 else negative_direction(factor, info, A_tilde[free[info - 1], free])
