"""Starts of the search for less energy, for many rows at once: convexified problems, and moves of single nodes.

The same two steps as tcstudy/solvers/search.py: descent on the problems with the laws' proximal hulls b_κ, κ growing
from below λ₁, knows all wells of j; a move puts one node on another piece or up-jump of b while all others relax.
Both give starts; what they are worth is found by descent.

A single node goes where φ(s) = ½ k (s − v)² − f (s − v) + j(s) − j(v) per length of its segment is least, k its
stiffness with the others relaxed and f = ξ/c, over all pieces and up-jumps of b other than the piece that v is on
(tcstudy/solvers/search.py).
"""

from __future__ import annotations

import numpy as np
import scipy.linalg
from numpy.typing import NDArray

from tcstudy.online.descent import descend, descend_nested
from tcstudy.online.law_hulls import proximal_hulls
from tcstudy.online.newton import block_of, factor_free, slopes
from tcstudy.online.problems import Rows
from tcstudy.online.row_laws import RowLaws
from tcstudy.scene.friction import UP
from tcstudy.solvers.law_tables import LawTables
from tcstudy.solvers.search import GROWTH, LOOSE, PROMISES

Array = NDArray[np.float64]
Index = NDArray[np.intp]
Flags = NDArray[np.bool_]

_BELOW = 0.9
"""First κ over λ₁."""


def hull_starts(rows: Rows, v: Array) -> tuple[Array, Flags]:
    """(starts (R, m), whether the first, convex problem is the original one at its solution, which then is the lowest).

    v: (R, m) where the first problem begins
    """
    lowest = np.zeros(len(v), dtype=bool)
    found, at, kappa, nested = v.copy(), np.arange(len(v)), _BELOW * rows.body.lambda_1, True
    stiffest = float(np.max(np.diagonal(rows.body.A_tilde) / rows.body.c))
    ceiling = np.minimum(rows.laws.omega(), stiffest)
    while len(at):
        laws = rows.laws.tabulated()
        hulls, bridges = proximal_hulls(laws.tables, kappa)
        smooth = Rows(rows.body, RowLaws(hulls, laws.law, laws.moved), rows.loads)
        ended = descend_nested(smooth, v, LOOSE, coarse=LOOSE) if nested else descend(smooth, v, LOOSE, minima=True)
        on_bridge = np.any(bridges.cover(laws.law, laws.own_slip(ended.v)), axis=1)
        found[at] = ended.v
        if nested:
            lowest[at] = ~on_bridge & (ended.residual <= LOOSE)
        kappa, nested = GROWTH * kappa, False
        on = np.flatnonzero(on_bridge & (kappa < ceiling[at]))
        rows, at, v = rows.take(on), at[on], ended.v[on]
    return found, lowest


def move_starts(rows: Rows, v: Array) -> tuple[Array, Index, Index]:
    """(starts (n, m), the rows they belong to (n,), which promise of its row each is (n,)), the best promise first.

    None for rows whose free nodes have no positive definite matrix, or where no move promises less energy.
    """
    body, xi = rows.body, rows.xi(v)
    s = slopes(rows, v, xi)
    free, added = s.free, body.c * rows.laws.slope(v, s.piece)
    stiffness, factors = np.full(v.shape, np.nan), {}
    for i in range(len(v)):
        nodes = np.flatnonzero(free[i])
        factor, info = factor_free(body, nodes, added[i, nodes])
        if info == 0:
            stiffness[i] = _relaxed_stiffness(body.A_tilde, nodes, np.flatnonzero(~free[i]), factor, added[i, nodes])
            factors[i] = nodes, factor
    known = np.array(sorted(factors), dtype=np.intp)
    c = body.c
    gain, place = _best_places(rows.laws.take(known), v[known], xi[known] / c, stiffness[known] / c)
    gain = gain * c
    starts, owners, promises = [], [], []
    for i, own_gain, own_place in zip(known, gain, place, strict=True):
        order = np.argsort(own_gain, kind="stable")[: min(PROMISES, np.count_nonzero(own_gain))]
        for promise, node in enumerate(order):
            step = _follow(body.A_tilde, *factors[int(i)], int(node), float(own_place[node] - v[i, node]))
            starts.append(v[i] + step)
            owners.append(i)
            promises.append(promise)
    shape = len(starts), v.shape[1]
    return np.array(starts).reshape(shape), np.array(owners, dtype=np.intp), np.array(promises, dtype=np.intp)


def _relaxed_stiffness(A: Array, free: Index, resting: Index, factor: Array, added: Array) -> Array:
    """(m,) k_i of solvers/search.py: a node, stiff as the free ones follow (factor of A_FF + diag added)."""
    stiffness = np.diagonal(A).copy()
    if len(free):
        inverse = np.tril(scipy.linalg.lapack.dtrtri(factor, lower=1)[0])
        stiffness[free] = 1.0 / np.einsum("ij,ij->j", inverse, inverse) - added
        if len(resting):
            held = scipy.linalg.blas.dtrmm(1.0, inverse, block_of(A, free, resting), lower=1)
            stiffness[resting] -= np.einsum("ij,ij->j", held, held)
    return stiffness


def _follow(A: Array, free: Index, factor: Array, node: int, move: float) -> Array:
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


def _best_places(laws: RowLaws, v: Array, force: Array, k: Array) -> tuple[Array, Array]:
    """(gain per length, slip), (R, m): where single nodes would go; force = ξ/c [Pa], stiffness k [Pa/m]."""
    sigma = 1.0 if laws.stretched is None else laws.stretched
    own = laws.own_slip(v), laws.own_traction(force), laws.own_traction(k * sigma)
    gain, place = _places(laws.tables, laws.law, *own)
    return laws.traction(gain, 1), np.where(gain < 0.0, laws.slip(place), v)


_PLACE_STEPS = 5
"""Newton steps for the stationary point on an exponential piece; a linear one needs one."""
_PLACE_NOISE = 1e-10
"""Gains below this part of the terms that they are made of are rounding."""


def _places(tables: LawTables, law: Index, v: Array, force: Array, k: Array) -> tuple[Array, Array]:
    """(φ, s), shape of v: the least φ, 0 where nothing is gained, and where it is taken [Pa·m, m]."""
    gain, place, at = np.zeros(v.shape), v.copy(), tables.locate(law, v)

    def consider(s: Array) -> None:
        known = np.isfinite(s)
        s = np.where(known, s, v)
        move = s - v
        parts = 0.5 * k * move**2, -force * move, tables.integral(v, s, at, tables.locate(law, s))
        phi = parts[0] + parts[1] + parts[2]
        size = np.abs(parts[0]) + np.abs(parts[1]) + np.abs(parts[2])
        better = known & (phi < -_PLACE_NOISE * size) & (phi < gain)
        gain[better], place[better] = phi[better], s[better]

    for column in range(tables.q.shape[1]):
        if not np.all(np.isinf(tables.lower[:, column])) or column == 0:
            for s in _stationary(tables, law, column, v, force, k):
                consider(s)
    for column in np.flatnonzero(np.any(tables.kinds == UP, axis=0)).tolist():
        s = np.where(tables.kinds[:, column] == UP, tables.kinks[:, column], np.nan)[law]
        consider(np.broadcast_to(s, v.shape))
    return gain, place


def _stationary(tables: LawTables, law: Index, column: int, v: Array, force: Array, k: Array) -> list[Array]:
    """Stationary slips of φ inside one piece of every law, NaN where there is none or v is on that piece.

    Newton begins at the end of the piece that is nearest to v. A law that falls like an exponential is steepest there
    and φ concave; so it begins also where the slip would be without the exponential, beyond the minimum.
    """
    piece = np.broadcast_to((tables.first + column)[law], v.shape)
    low, high = tables.lower.take(piece), tables.upper.take(piece)
    elsewhere = ((v <= low) | (v >= high)) & (low < high)
    starts, steps = [np.clip(v, low, high)], 1
    if np.any(tables.a[:, column]):
        with np.errstate(divide="ignore", invalid="ignore"):
            q = tables.q.take(piece)
            beyond = (force + k * v - tables.b_0.take(piece) + q * tables.s_0.take(piece)) / (q + k)
        starts, steps = [starts[0], np.clip(beyond, low, high)], _PLACE_STEPS
    found = []
    for s in starts:
        s = np.where(elsewhere & np.isfinite(s), s, np.nan)
        for _ in range(steps):
            slope = tables.slope(s, piece) + k
            defect = tables.value(s, piece) + k * (s - v) - force
            s = np.where(slope > 0.0, np.clip(s - defect / np.where(slope > 0.0, slope, 1.0), low, high), np.nan)
        found.append(np.where((low < s) & (s < high), s, np.nan))
    return found
