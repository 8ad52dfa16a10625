"""Moves of single nodes to other pieces of b, for any number of problems and laws at once.

At a strict local minimum v let F be the nodes that do not rest on an up-jump and H = A_FF + C b_F′ ≻ 0. If node i is
put at s and the others of F follow on their pieces (linearised), the energy changes by c_i φ_i(s),

    φ_i(s) = ½ (k_i/c_i) (s − v_i)² − (ξ_i/c_i) (s − v_i) + j(s) − j(v_i),
    k_i = 1/(H⁻¹)_ii − c_i b_i′ for i in F,   k_i = ã_ii − ã_iFᵀ H⁻¹ ã_Fi for a resting node,

exactly so for linear pieces as long as nobody else leaves its piece. A promise only: descent puts it to the test.
"""

from __future__ import annotations

import numpy as np
import scipy.linalg
from numpy.typing import NDArray

from tcstudy.laws.laws import Laws
from tcstudy.laws.pieces import UP

Array = NDArray[np.float64]
Index = NDArray[np.intp]

_STEPS = 5
"""Newton steps for the stationary point on an exponential piece; a linear one needs one."""
_NO_GAIN = 1e-10
"""Gains below this part of the terms that they are made of are rounding."""


def relaxed_stiffness(A: Array, free: Index, resting: Index, factor: Array, added: Array) -> Array:
    """(m,) k_i: how stiff a node is while the free ones follow; factor: Cholesky, lower, of H = A_FF + diag added."""
    stiffness = np.diagonal(A).copy()
    if len(free):
        inverse = np.tril(scipy.linalg.lapack.dtrtri(factor, lower=1)[0])
        stiffness[free] = 1.0 / np.einsum("ij,ij->j", inverse, inverse) - added
        if len(resting):
            held = scipy.linalg.blas.dtrmm(1.0, inverse, A.take(free, axis=0).take(resting, axis=1), lower=1)
            stiffness[resting] -= np.einsum("ij,ij->j", held, held)
    return stiffness


def follow(A: Array, free: Index, factor: Array, node: int, move: float) -> Array:
    """(m,) step of all nodes if one is moved and the free ones relax."""
    step, place = np.zeros(len(A)), int(np.searchsorted(free, node))
    if place < len(free) and free[place] == node:
        unit = np.zeros(len(free))
        unit[place] = 1.0
        response = scipy.linalg.lapack.dpotrs(factor, unit, lower=1)[0]
        step[free] = response * (move / response[place])
    elif len(free):
        step[free] = -move * scipy.linalg.lapack.dpotrs(factor, A[free, node], lower=1)[0]
    step[node] = move
    return step


def best_places(tables: Laws, law: Index, v: Array, force: Array, k: Array) -> tuple[Array, Array]:
    """(φ, s), shape of v: the least φ, 0 where nothing is gained, and where it is taken [Pa·m, m]."""
    gain, place, at = np.zeros(v.shape), v.copy(), tables.locate(v, law)

    def consider(s: Array) -> None:
        known = np.isfinite(s)
        s = np.where(known, s, v)
        move = s - v
        parts = 0.5 * k * move**2, -force * move, tables.integral(v, s, at, tables.locate(s, law))
        phi = parts[0] + parts[1] + parts[2]
        size = np.abs(parts[0]) + np.abs(parts[1]) + np.abs(parts[2])
        better = known & (phi < -_NO_GAIN * size) & (phi < gain)
        gain[better], place[better] = phi[better], s[better]

    for column in range(tables.q.shape[1]):
        if not np.all(np.isinf(tables.lower[:, column])) or column == 0:
            for s in _stationary(tables, law, column, v, force, k):
                consider(s)
    for column in np.flatnonzero(np.any(tables.kinds == UP, axis=0)).tolist():
        s = np.where(tables.kinds[:, column] == UP, tables.kinks[:, column], np.nan)[law]
        consider(np.broadcast_to(s, v.shape))
    return gain, place


def _stationary(tables: Laws, law: Index, column: int, v: Array, force: Array, k: Array) -> list[Array]:
    """Stationary slips of φ inside one piece of every law, NaN where there is none or v is on that piece.

    Newton begins at the end of the piece that is nearest to v. A law that falls like an exponential is steepest there
    and φ concave; so it begins also where the slip would be without the exponential, beyond the minimum.
    """
    piece = np.broadcast_to((tables.first + column)[law], v.shape)
    low, high = tables.lower.take(piece), tables.upper.take(piece)
    elsewhere = ((v <= low) | (v >= high)) & (low < high)
    starts, steps = [np.clip(v, low, high)], 1
    if np.any(tables.bent[:, column]):
        with np.errstate(divide="ignore", invalid="ignore"):
            q = tables.q.take(piece)
            beyond = (force + k * v - tables.b_0.take(piece) + q * tables.s_0.take(piece)) / (q + k)
        starts, steps = [starts[0], np.clip(beyond, low, high)], _STEPS
    found = []
    for s in starts:
        s = np.where(elsewhere & np.isfinite(s), s, np.nan)
        for _ in range(steps):
            slope = tables.slope(s, piece) + k
            defect = tables.value(s, piece) + k * (s - v) - force
            s = np.where(slope > 0.0, np.clip(s - defect / np.where(slope > 0.0, slope, 1.0), low, high), np.nan)
        found.append(np.where((low < s) & (s < high), s, np.nan))
    return found
