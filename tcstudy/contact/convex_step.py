"""A step to the minimum of a convex model of L̃ that knows all rising pieces and up-jumps of b, by interior points.

Newton's steps and the moves of single nodes settle few nodes at a time where the body couples all of them strongly (Ã
dense and badly conditioned); an interior point method settles all together, in some twenty factorisations whatever
their number. The model at v: b = b_↑ + rest, where b_↑ has the up-jumps of b and its slopes where they are positive,
and the rest, which only falls, stays what it is at v:

    min over w  ½wᵀÃw − (l̃ − c·rest)ᵀw + Σ c_i j_↑(w_i)

For a law that nowhere falls this is the problem itself; else −j of the rest bends up, so that the model lies above L̃
and its minimum is no higher than v. The law b_↑ is a sum of elements: a line of the least slope, and for each up-jump
or steeper piece a force e in [0, h] that grows as the slip passes s:

    w_i − s = γ e + x⁺ − x⁻,   0 ≤ e ⟂ x⁻ ≥ 0,   0 ≤ h − e ⟂ x⁺ ≥ 0      (γ = 0 for a jump, 1/slope for a piece)

Method: Mehrotra's predictor and corrector, SIAM J. Optim. 2 (1992) 575–601; e and x are eliminated, so that each step
costs one Cholesky factor of Ã plus a diagonal.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import scipy.linalg
from numpy.typing import NDArray

from tcstudy.contact.factors import cholesky
from tcstudy.contact.newton import slopes
from tcstudy.contact.problem import ContactProblem
from tcstudy.laws.laws import Laws
from tcstudy.laws.pieces import UP

Array = NDArray[np.float64]
Index = NDArray[np.intp]

_STEPS = 80
_TO_BOUNDARY = 0.995
_SMALL = 1e-14
"""Most steps, how far each goes towards the boundary, and the complementarity, relative to its first, that ends it."""


@dataclass(frozen=True)
class _Elements:
    """The elements of b_↑ at every node, (n, m) each.

    sign: −1 for the outer piece on the left, whose slip counts to the left;  kink: index of the kink of an up-jump, −1
    A node with fewer elements than others has some of sign 0, which act on nothing.
    """

    s: Array
    h: Array
    gamma: Array
    sign: Array
    kink: Index
    slope: Array

    def force(self, v: Array, piece: Index) -> Array:
        """b_↑(v) on the named pieces, 0 left of all elements (m,) [Pa]."""
        with np.errstate(divide="ignore", invalid="ignore"):
            ramp = np.clip(self.sign * (v - self.s) / self.gamma, 0.0, self.h)
        jump = np.where(self.kink < piece, self.h, 0.0)
        return np.asarray(self.slope * v + np.sum(self.sign * np.where(self.gamma > 0.0, ramp, jump), axis=0))


def _elements(law: Laws) -> tuple[list[tuple[float, float, float, float, int]], float]:
    """(s, h, γ, sign and kink of every element, least slope) of a law; exponential pieces rise from end to end."""
    kinks, last = law.kinks, len(law.kinks)
    rise = np.maximum(law.q, 0.0)
    for piece in np.flatnonzero(law.bent):
        if 0 < piece < last:
            ends = law.value(kinks[piece - 1 : piece + 1], np.full(2, piece))
            rise[piece] = max(0.0, float(ends[1] - ends[0]) / float(kinks[piece] - kinks[piece - 1]))
    least = float(rise.min())
    rows = []
    for k in np.flatnonzero(law.kinds == UP):
        rows.append((float(kinks[k]), float(law.b_right[k] - law.b_left[k]), 0.0, 1.0, int(k)))
    for piece in np.flatnonzero(rise > least):
        steeper = float(rise[piece]) - least
        outer = piece in (0, last)
        height = np.inf if outer else steeper * float(kinks[piece] - kinks[piece - 1])
        left = piece == 0
        rows.append((float(kinks[0 if left else piece - 1]), height, 1.0 / steeper, -1.0 if left else 1.0, -1))
    return rows, least


def _rises(law: Laws) -> bool:
    """Whether b has an up-jump or pieces that rise unlike each other."""
    return bool(np.any(law.kinds == UP) or np.ptp(np.maximum(law.q, 0.0)) > 0.0)


def _by_node(laws: Sequence[Laws], index: Index, b_scale: float) -> _Elements:
    """The elements of every node's law, with some of sign 0 and of the scale of b where others have more."""
    own = [_elements(law) for law in laws]
    padded = np.tile(
        [[0.0], [b_scale or 1.0], [0.0], [0.0], [-1.0]], (max(len(rows) for rows, _ in own), 1, len(index))
    )
    for k, (rows, _) in enumerate(own):
        padded[: len(rows), :, index == k] = np.array(rows).reshape(len(rows), 5, 1)
    s, h, gamma, sign, kink = padded.transpose(1, 0, 2)
    return _Elements(s, h, gamma, sign, kink.astype(np.intp), np.array([least for _, least in own])[index])


def convex_step(problem: ContactProblem, v: Array) -> Array | None:
    """The minimum of the model at v (m,), None if b nowhere rises or the iteration fails.

    Nodes on an up-jump at the minimum are put on it bitwise.
    """
    law, c = problem.law, problem.c
    laws, index = law.laws, law.node_index(problem.m)
    if not any(_rises(laws[k]) for k in np.unique(index)):
        return None
    descent = slopes(problem, v, problem.xi(v)).descent
    piece = np.where(descent <= 0.0, law.piece(v, +1), law.piece(v, -1))
    elements = _by_node(laws, index, law.b_scale)
    rest = law.value(v, piece) - elements.force(v, piece - law.tables.first[index] if not law.one else piece)
    return _InteriorPoint(problem, elements, problem.l_tilde - c * rest).minimum(v)


class _InteriorPoint:
    """The iteration: w (m,) and e, h − e (`room`), x⁺ (`above`), x⁻ (`below`), all (n, m)."""

    def __init__(self, problem: ContactProblem, elements: _Elements, load: Array) -> None:
        self.problem, self.elements = problem, elements
        self.c, self.load = problem.c, load
        self.matrix = problem.A_tilde.copy()
        self.matrix[np.diag_indices(problem.m)] += self.c * elements.slope
        self.capped = np.isfinite(elements.h)

    def minimum(self, v: Array) -> Array | None:
        """Where the iteration ends, from v; None if it breaks down before the model is solved to any accuracy."""
        self._start(v)
        first = self._complementarity()
        for _ in range(_STEPS):
            mu = self._complementarity()
            if mu <= _SMALL * first or not self._step(mu):
                break
        return self._snapped() if self._complementarity() <= 1e-3 * first else None

    def _start(self, v: Array) -> None:
        el, p = self.elements, self.problem
        size = float(np.max(np.abs(el.h[self.capped]), initial=0.0)) or p.traction_scale
        reach = np.max(np.abs(p.l_tilde) + self.c * size) / np.min(np.diagonal(self.matrix))
        self.reach = max(float(np.max(np.abs(v - el.s))), float(reach) if np.isfinite(reach) else 0.0)
        self.w = v.copy()
        self.e = np.broadcast_to(np.where(self.capped, 0.5 * el.h, size), (len(el.h), len(v))).copy()
        self.room = np.where(self.capped, el.h - self.e, 1.0)
        gap = el.sign * (v - el.s) - el.gamma * self.e
        self.above = np.where(self.capped, np.maximum(gap, 0.0) + self.reach, 0.0)
        self.below = np.maximum(-gap, 0.0) + self.reach

    def _complementarity(self) -> float:
        """Mean of e x⁻ and (h − e) x⁺."""
        count = self.e.size * (1.0 + float(np.mean(self.capped)))
        return float(np.sum(self.e * self.below) + np.sum(self.room * self.above)) / count  # x⁺ = 0 without a cap

    def _step(self, mu: float) -> bool:
        """Predictor and corrector; False if the factor or the step is no longer of use."""
        el, room = self.elements, self.room
        theta = el.gamma + self.above / room + self.below / self.e
        matrix = self.matrix.copy()
        matrix[np.diag_indices(len(self.w))] += self.c * np.sum(el.sign**2 / theta, axis=0)
        factor, info = cholesky(matrix)
        if info != 0:
            return False
        balance = self.load - self.matrix @ self.w - self.c * np.sum(el.sign * self.e, axis=0)
        gap = el.sign * (self.w - el.s) - el.gamma * self.e - self.above + self.below

        def direction(low: Array, high: Array) -> tuple[Array, Array, Array, Array]:
            """For e x⁻ → e x⁻ + low and (h − e) x⁺ → (h − e) x⁺ + high."""
            known = gap - high / room + low / self.e
            rhs = balance - self.c * np.sum(el.sign * known / theta, axis=0)
            dw = scipy.linalg.lapack.dpotrs(factor, rhs, lower=1)[0]
            de = (el.sign * dw + known) / theta
            return dw, de, (high + self.above * de) / room, (low - self.below * de) / self.e

        low, high = -self.e * self.below, np.where(self.capped, -room * self.above, 0.0)
        _, de, d_above, d_below = direction(low, high)
        length = self._length(room, de, d_above, d_below, 1.0)
        after = np.sum((self.e + length * de) * (self.below + length * d_below))
        after += np.sum(np.where(self.capped, (room - length * de) * (self.above + length * d_above), 0.0))
        centre = mu * min(1.0, float(after) / (mu * self.e.size * (1.0 + float(np.mean(self.capped))))) ** 3
        dw, de, d_above, d_below = direction(
            low + centre - de * d_below, np.where(self.capped, high + centre + de * d_above, 0.0)
        )
        length = self._length(room, de, d_above, d_below, _TO_BOUNDARY)
        if not (length > 1e-6 and np.all(np.isfinite(dw))):
            return False
        self.w = self.w + length * dw
        self.e = self.e + length * de
        self.room = np.where(self.capped, room - length * de, 1.0)  # h − e would lose its digits
        self.above, self.below = self.above + length * d_above, self.below + length * d_below
        return True

    def _length(self, room: Array, de: Array, d_above: Array, d_below: Array, share: float) -> float:
        """Longest step, at most 1, that keeps e, h − e, x⁺ and x⁻ positive."""
        length = 1.0
        shrinking = np.where(self.capped, -de, 0.0)
        with np.errstate(divide="ignore", invalid="ignore"):
            for value, change in ((self.e, de), (self.below, d_below), (room, shrinking), (self.above, d_above)):
                length = min(length, float(np.min(np.where(change < 0.0, -share * value / change, np.inf))))
        return length

    def _snapped(self) -> Array:
        """w with the nodes that rest on an up-jump put there."""
        el, w = self.elements, self.w.copy()
        reach = max(float(np.max(np.abs(self.w - el.s))), np.finfo(float).tiny)
        rests = (el.kink >= 0) & (self.below < self.e / el.h * reach) & (self.above < self.room / el.h * reach)
        row, node = np.nonzero(rests)
        w[node] = np.broadcast_to(el.s, rests.shape)[row, node]
        return w
