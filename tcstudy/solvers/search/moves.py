"""Moves of one node to another piece or kink of b while all others relax: what leaves a local minimum at least cost.

At a strict local minimum v let F be the nodes that do not rest on an up-jump and H = A_FF + C b_F′ ≻ 0. If node i is
put at s and the other nodes of F follow on their pieces (linearised), the energy changes by

    φ_i(s) = ½ k_i (s − v_i)² − ξ_i (s − v_i) + c_i (j(s) − j(v_i)),
    k_i = 1/(H⁻¹)_ii − c_i b_i′ for i in F,   k_i = ã_ii − ã_iFᵀ H⁻¹ ã_Fi for a resting node,

exactly so for linear pieces as long as nobody else leaves its piece. φ_i is minimised over every piece of b, for all
nodes at once; what is promised is then put to the test by descent.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import scipy.linalg
from numpy.typing import NDArray

from tcstudy.scene.friction import UP, FrictionLaw
from tcstudy.solvers.problem import ContactProblem
from tcstudy.solvers.separable.pieces import slopes
from tcstudy.solvers.separable.system import cholesky, submatrix

Array = NDArray[np.float64]
Index = NDArray[np.intp]

_NEWTON = 5
"""Newton steps for the stationary point on an exponential piece; a linear one needs one."""
_NOISE = 1e-10
"""Gains below this part of the terms that they are made of are rounding."""


@dataclass(frozen=True)
class _Relaxed:
    """How the free nodes follow one node: Cholesky factor of H, free and resting nodes, stiffnesses k_i (m,)."""

    factor: Array
    free: Index
    resting: Index
    stiffness: Array


def node_moves(problem: ContactProblem, v: Array) -> Iterator[Array]:
    """Points (m,) that promise less energy than v, one node moved and the others relaxed; the best promise first.

    None where H is not positive definite. A promise is broken where another node leaves its piece on the way.
    """
    xi = problem.xi(v)
    relaxed = _relaxed(problem, v, xi)
    if relaxed is None:
        return
    gain, target = _best_places(problem, v, xi, relaxed.stiffness)
    for node in np.argsort(gain, kind="stable")[: np.count_nonzero(gain)]:
        yield v + _follow(problem, relaxed, int(node), float(target[node] - v[node]))


def _relaxed(problem: ContactProblem, v: Array, xi: Array) -> _Relaxed | None:
    """Factor H and form all k_i; about three factorisations' work."""
    s = slopes(problem, v, xi)
    free, resting = np.flatnonzero(~s.at_rest), np.flatnonzero(s.at_rest)
    law, c, A = problem.law, problem.c, problem.A_tilde
    q = law.slope(v[free], np.where(s.descent[free] <= 0.0, law.piece(v[free], +1), law.piece(v[free], -1)))
    matrix = submatrix(A, free)
    matrix[np.diag_indices(len(free))] += c[free] * q
    factor, info = cholesky(matrix)
    if info != 0:
        return None
    stiffness = np.diagonal(A).copy()
    if len(free):
        inverse = scipy.linalg.lapack.dtrtri(factor, lower=1)[0]
        stiffness[free] = 1.0 / np.sum(np.tril(inverse) ** 2, axis=0) - c[free] * q
        if len(resting):
            held = scipy.linalg.blas.dtrmm(1.0, inverse, A.take(free, axis=0).take(resting, axis=1), lower=1)
            stiffness[resting] -= np.sum(held**2, axis=0)
    return _Relaxed(factor, free, resting, stiffness)


def _follow(problem: ContactProblem, relaxed: _Relaxed, node: int, move: float) -> Array:
    """Displacement of all nodes if one is moved and the others in F relax (m,)."""
    free = relaxed.free
    step = np.zeros(problem.m)
    place = int(np.searchsorted(free, node))
    if place < len(free) and free[place] == node:
        rhs = np.zeros(len(free))
        rhs[place] = 1.0
        response = scipy.linalg.lapack.dpotrs(relaxed.factor, rhs, lower=1)[0]
        step[free] = response * (move / response[place])
    elif len(free):
        step[free] = -move * scipy.linalg.lapack.dpotrs(relaxed.factor, problem.A_tilde[free, node], lower=1)[0]
    step[node] = move
    return step


def _best_places(problem: ContactProblem, v: Array, xi: Array, stiffness: Array) -> tuple[Array, Array]:
    """(gain, target), (m,): least φ_i over all pieces and up-jumps of b, 0 where it is no gain, and where it is."""
    law, k, force = problem.law, stiffness / problem.c, xi / problem.c
    ups = law.kinks[law.kinds == UP]
    s = np.concatenate([_on_pieces(law, v, force, k), np.broadcast_to(ups, (len(v), len(ups)))], axis=1)
    move = s - v[:, None]
    parts = np.stack([0.5 * k[:, None] * move**2, -force[:, None] * move, law.j(s) - law.j(v)[:, None]])
    phi = np.sum(parts, axis=0)
    phi = np.where(phi < -_NOISE * np.sum(np.abs(parts), axis=0), phi, 0.0)
    best = np.nanargmin(np.where(np.isfinite(phi), phi, np.inf), axis=1)
    node = np.arange(len(v))
    return problem.c * phi[node, best], s[node, best]


def _on_pieces(law: FrictionLaw, v: Array, force: Array, k: Array) -> Array:
    """(m, …) stationary slips of φ_i on every piece but the one v_i is on; v_i itself where there is none.

    Newton begins at the end of a piece that is nearest to v_i. A law that falls like an exponential is steepest there
    and φ_i concave; so it begins also where the slip would be without the exponential, beyond the minimum.
    """
    ends = np.concatenate([[-np.inf], law.kinks, [np.inf]])
    low, high = ends[:-1], ends[1:]
    near = np.clip(v[:, None], low, high)
    if law.piecewise_linear:
        found = [_stationary(law, v, force, k, near, 1)]
    else:
        beyond = v[:, None] + (force[:, None] - law.b_0 - law.q * (v[:, None] - law.s_0)) / (law.q + k[:, None])
        starts = near, np.clip(beyond, low, high)
        found = [_stationary(law, v, force, k, start, _NEWTON) for start in starts]
    elsewhere = (v[:, None] <= low) | (v[:, None] >= high)
    inside = [(low < s) & (s < high) & elsewhere for s in found]
    return np.concatenate([np.where(own, s, v[:, None]) for own, s in zip(inside, found, strict=True)], axis=1)


def _stationary(law: FrictionLaw, v: Array, force: Array, k: Array, s: Array, steps: int) -> Array:
    """(m, K+1) Newton's method for φ_i′ = 0 on every piece from s; NaN where φ_i is not convex on the way."""
    piece = np.broadcast_to(np.arange(len(law.q)), s.shape)
    ends = np.concatenate([[-np.inf], law.kinks, [np.inf]])
    for _ in range(steps):
        slope = law.slope(s, piece) + k[:, None]
        defect = law.value(s, piece) + k[:, None] * (s - v[:, None]) - force[:, None]
        step = defect / np.where(slope > 0.0, slope, 1.0)
        s = np.where(slope > 0.0, np.clip(s - step, ends[:-1], ends[1:]), np.nan)
    return s
