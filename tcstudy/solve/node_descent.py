"""Node-by-node descent of L̃: one-dimensional minimisations on the exact pieces, one node after the other.

Slow but certain: used only where a Newton path gives no decrease.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tcstudy.scene.friction import FrictionLaw
from tcstudy.solve.problem import ContactProblem

Array = NDArray[np.float64]

_MAJORANT_STEPS = 8
"""Steps with a curvature majorant inside an exponential piece; each descends, so none needs to be exact."""


def descend_nodes(problem: ContactProblem, v: Array, xi: Array, descent: Array) -> Array:
    """v after one Gauss–Seidel pass over the descending nodes, largest expected gain first (m,).

    descent: the descending one-sided slopes at v (0 at rest) [N/m]
    """
    diagonal = np.diagonal(problem.A_tilde)
    gain = descent**2 / diagonal
    v, xi = v.copy(), xi.copy()
    for node in np.argsort(-gain, kind="stable")[: np.count_nonzero(gain)]:
        c = float(problem.c[node])
        energy = NodeEnergy(problem.law, float(v[node]), float(xi[node]) / c, float(diagonal[node]) / c)
        target = energy.descend()
        xi -= problem.A_tilde[node] * (target - v[node])
        v[node] = target
    return v


@dataclass(frozen=True)
class NodeEnergy:
    """½ k (s − s₀)² − traction (s − s₀) + j(s), the energy per length of one node with the others held.

    s_0 [m], traction ξ/c at s₀ [Pa], stiffness k = Ã_ii/c_i [Pa/m]
    """

    law: FrictionLaw
    s_0: float
    traction: float
    stiffness: float

    def derivative(self, s: float, piece: int) -> float:
        """Slope of the energy on the named piece."""
        return float(self.law.value(s, piece)) + self.stiffness * (s - self.s_0) - self.traction

    def descend(self) -> float:
        """First resting place downhill from s₀: a zero of the slope, or a jump behind which it climbs."""
        s = self.s_0
        left = self.derivative(s, int(self.law.piece(s, -1)))
        right = self.derivative(s, int(self.law.piece(s, +1)))
        if max(-right, left) <= 0.0:
            return s
        sign = 1 if -right >= left else -1
        piece = int(self.law.piece(s, sign))
        while True:
            end = self._end(piece, sign)
            s = self._descend_piece(piece, sign, s, end)
            if s != end or sign * self.derivative(s, piece + sign) >= 0.0:
                return s
            piece += sign

    def _end(self, piece: int, sign: int) -> float:
        """Where the piece ends in the direction `sign` (±inf for an outer piece)."""
        ends = np.concatenate([[-np.inf], self.law.kinks, [np.inf]])
        return float(ends[piece + 1] if sign > 0 else ends[piece])

    def _descend_piece(self, piece: int, sign: int, s: float, end: float) -> float:
        """First zero of the slope on the way to `end`, or `end`; exponential pieces stop short of the zero.

        The curvature k + b′ is monotone on a piece, so its larger end bounds it and no step passes a zero.
        """
        far = float(self.law.slope(end, piece)) if np.isfinite(end) else float(self.law.q[piece])
        for _ in range(1 if self.law.a[piece] == 0.0 else _MAJORANT_STEPS):
            bound = self.stiffness + max(float(self.law.slope(s, piece)), far)
            downhill = -sign * self.derivative(s, piece)
            if downhill <= 0.0:
                return s
            if bound <= 0.0 or abs(end - s) * bound <= downhill:
                return end
            s += sign * downhill / bound
        return s
