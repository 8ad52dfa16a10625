"""A contact problem linearised at a solution: how the solution moves with its data, exactly, while its pieces stay.

With F the nodes that slide, H = A_FF + diag(c b′) on their pieces and the others resting on kinks of b,

    dv_F = H⁻¹ (r_F − A_FR dv_R),   dv_R = ∂(kink)/∂p,   r = ∂l̃/∂p − (∂Ã/∂p) v − c ∂b/∂p.

H is factorised once; a parameter then costs two triangular solves and a product, O(m²).

v is continuous and piecewise smooth in the data. Where a node begins to slide, comes to rest or passes a kink, the
derivatives of the two sides differ: such nodes are counted as events, and what is said is true of the pieces found.
Where H is singular, at a fold, there is no derivative.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.linalg
from numpy.typing import NDArray

from tcstudy.contact.problem import ContactProblem

Array = NDArray[np.float64]
Index = NDArray[np.intp]

EVENT = 1e-9
"""How near an event is: of the largest |v| for a slip and its kink, of the scale of b for a traction and its bound."""
SINGULAR = 1e-13
"""Reciprocal condition of H below which the solution is at a fold."""


@dataclass(frozen=True, eq=False)
class Linearised:
    """A solution v (m,) of a contact problem and the factor of H.

    free: (f,) nodes that slide;  rest: (m − f,) nodes on an up-jump;  piece: (m,) pieces of b, at kinks on the right
    near: (m,) nodes within EVENT of an event;  singular: whether H is, to SINGULAR
    """

    problem: ContactProblem
    v: Array
    free: Index
    rest: Index
    piece: Index
    near: NDArray[np.bool_]
    singular: bool
    _factor: tuple[Array, Index]

    @classmethod
    def at(cls, problem: ContactProblem, v: Array) -> Linearised:
        """The problem linearised at its solution v."""
        rests = problem.law.sticking(v)
        free, rest = np.flatnonzero(~rests), np.flatnonzero(rests)
        piece = np.asarray(problem.law.piece(v), dtype=np.intp)
        H = problem.A_tilde[np.ix_(free, free)]
        norm = float(np.linalg.norm(H, 1)) if len(free) else 0.0
        slope = np.asarray(problem.law.slope(v, piece))[free]
        H[np.diag_indices(len(free))] += problem.c[free] * slope
        # LU, since at an unstable solution H is indefinite; a zero pivot is judged by the condition
        lu, pivots, _ = scipy.linalg.lapack.dgetrf(H) if len(free) else (H, free, 0)
        singular = len(free) > 0 and bool(scipy.linalg.lapack.dgecon(lu, norm)[0] < SINGULAR)
        return cls(problem, v, free, rest, piece, _events(problem, v, rests), singular, (lu, pivots))

    @property
    def events(self) -> int:
        """How many nodes are near an event."""
        return int(np.count_nonzero(self.near))

    def step(self, r: Array, kinks: Array | None = None) -> Array:
        """(m,) dv/dp of a right side r (m,); kinks: (m,) ∂(kink)/∂p of the nodes that rest, 0 by default."""
        dv = np.zeros(len(self.v))
        rhs = r[self.free]
        if kinks is not None and np.any(kinks[self.rest]):
            dv[self.rest] = kinks[self.rest]
            rhs = rhs - self.problem.A_tilde[np.ix_(self.free, self.rest)] @ dv[self.rest]
        if len(rhs):
            dv[self.free] = scipy.linalg.lapack.dgetrs(*self._factor, rhs)[0]
        return dv


def _events(problem: ContactProblem, v: Array, rests: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """(m,) nodes that slide at a kink, or rest with the traction at a bound of what the kink can bear."""
    law = problem.law
    if not np.size(law.kinks):
        return np.zeros(len(v), dtype=bool)
    kink = law.nearest_kink(v)
    apart = np.abs(v - law.kink(kink))
    near = ~rests & (apart <= EVENT * float(np.max(np.abs(v), initial=0.0)))
    traction = problem.xi(v) / problem.c
    left, right = law.limits(kink)
    slack = np.minimum(np.abs(traction - left), np.abs(traction - right))
    return near | (rests & (slack <= EVENT * problem.traction_scale))
