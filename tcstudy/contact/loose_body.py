"""Rigid motions that Ã does not resist: whether a load moves the body away, and how far at most.

Motions:   r with Ãr = 0, the space of N (m, k), NᵀCN = I
Resisted:  f(r) = Σ c_i (β⁺_i r_i⁺ + β⁻_i r_i⁻) − l̃ᵀr > 0 for every motion r ≠ 0, with the limits
           β⁺ = b(∞) and β⁻ = −b(−∞), ∞ at a ray. Then L̃ → ∞ wherever v goes, and has a minimum.
           Otherwise the load takes the body away once its bond has failed; equilibria may exist
           before. f is sublinear, so that its sign on the faces y_j = ±1 of |y| ≤ 1, r = Ny,
           decides: linear programmes
Reach:     with K_i ≥ (β|s| − s b(s)) for all s, v = Ny + w, yᵀNᵀCw = 0, δ the least f on the faces
           and L = ‖β + |l̃|/c‖_C, a solution has λ₊‖w‖² − L‖w‖ + δ|y| ≤ Σ c_i K_i, where λ₊ is the
           least eigenvalue above 0
Literature: Fichera's condition of Signorini problems; Kinderlehrer & Stampacchia, An Introduction
           to Variational Inequalities (1980)
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from tcstudy.contact.certificates import far, largest_push
from tcstudy.contact.problem import ContactProblem
from tcstudy.laws.laws import Laws

Array = NDArray[np.float64]
Index = NDArray[np.intp]

BALANCED = 1e-9
"""Part of its terms up to which the resistance to a motion counts as none."""
MOVES = 1e-6
"""Part of the largest move of a motion above which a row takes part in it."""
_STEEPNESS = 4.0 ** np.arange(8)
"""Finite values, in units of the largest load per length, that are tried in place of infinite β."""
_MAX_ROWS_NAMED = 6
"""Rows of a motion that a reason names."""


class Motion(NamedTuple):
    """A rigid motion r (m,), its largest entry 1, and f(r) < 0."""

    r: Array
    resistance: float


@dataclass(frozen=True, eq=False)
class LooseBody:
    """The rigid motions of a body under one load.

    problem: of one row
    """

    problem: ContactProblem

    @property
    def N(self) -> Array:
        """(m, k) a basis of the motions."""
        return self.problem.body.motions

    @property
    def count(self) -> int:
        """Number k of independent motions."""
        return self.N.shape[1]

    @cached_property
    def limits(self) -> tuple[Array, Array]:
        """(m,) each: β⁻ and β⁺ of the rows [Pa]."""
        tables = self.problem.law.tables
        index = self.problem.law.node_index(self.problem.m)
        on_right = np.where(tables.q[:, -1] > 0.0, np.inf, tables.b_0[:, -1])
        on_left = np.where(tables.q[:, 0] > 0.0, np.inf, -tables.b_0[:, 0])
        return np.maximum(on_left, 0.0)[index], np.maximum(on_right, 0.0)[index]

    def _least(self, left: Array, right: Array) -> tuple[float, Array]:
        """Return the least f on the faces, and the motion y (k,) there.

        left, right: β⁻ and β⁺; motions against infinite ones are left out
        """
        c, load, N = self.problem.c, self.problem.l_tilde, self.N
        if self.count == 1:
            values = []
            for r in (N[:, 0], -N[:, 0]):
                size = np.where(r > 0.0, right, left) * np.abs(r)
                moves = np.abs(r) > MOVES * np.max(np.abs(r))
                values.append(float(np.sum(c * size, where=moves) - load @ r))
            sign = 1.0 if values[0] <= values[1] else -1.0
            return min(values), np.array([sign])
        least, motion = np.inf, np.zeros(self.count)
        for face in range(self.count):
            for side in (1.0, -1.0):
                value, y = self._least_on_face(face, side, left, right)
                if value < least:
                    least, motion = value, y
        return least, motion

    def _least_on_face(
        self, face: int, side: float, left: Array, right: Array
    ) -> tuple[float, Array]:
        """Return the least f on the face y_j = side, ∞ where no motion is allowed, and y."""
        from scipy.optimize import linprog  # few bodies are loose

        c, load, N = self.problem.c, self.problem.l_tilde, self.N
        k, m = self.count, self.problem.m
        cost = np.append(-load @ N, np.ones(m))  # of y and of t ≥ c β⁺ r, −c β⁻ r
        rows = []
        for beta, sign in ((right, 1.0), (left, -1.0)):
            is_finite = np.isfinite(beta)
            slope = np.where(is_finite, beta, 0.0)
            rows.append(np.hstack([sign * (c * slope)[:, None] * N, -np.eye(m)]))
            barred = np.hstack([sign * N[~is_finite], np.zeros((np.sum(~is_finite), m))])
            rows.append(barred)
        bounds = [(-1.0, 1.0)] * k + [(0.0, None)] * m
        bounds[face] = (side, side)
        A_ub = np.vstack(rows)
        programme = linprog(cost, A_ub=A_ub, b_ub=np.zeros(len(A_ub)), bounds=bounds)
        if programme.status != 0:
            return np.inf, np.zeros(k)
        return float(programme.fun), np.asarray(programme.x[:k])

    def unresisted(self) -> Motion | None:
        """Return the motion of least f < 0, None if the load is against every one, or balanced."""
        if not self.count:
            return None
        least, y = self._least(*self.limits)
        r = self.N @ y
        largest = float(np.max(np.abs(r)))
        if not np.isfinite(least) or largest == 0.0:
            return None
        if least > -BALANCED * float(np.abs(self.problem.l_tilde) @ np.abs(r)):
            return None
        return Motion(r / largest, least / largest)

    def reach(self, change: Array) -> Array:
        """Return (m,) bounds of |v_i| for every solution, ∞ where a motion is not resisted [m].

        change: (m,) by how much the load may differ from that of the problem [N/m]
        """
        problem = self.problem
        tables = problem.law.tables
        index = problem.law.node_index(problem.m)
        largest_load = float(np.max(np.abs(problem.l_tilde) / problem.c))
        unit = largest_load or problem.law.b_scale or 1.0
        push = largest_push(problem.law)[index]
        softest = problem.body.softest
        reach = np.full(problem.m, np.inf)
        for steepness in _STEEPNESS * unit:
            left, right = (np.minimum(beta, steepness) for beta in self.limits)
            delta, _ = self._least(left, right)
            delta -= float(np.sum(change @ np.abs(self.N)))
            if not delta > 0.0:
                continue
            beta = np.maximum(left, right)
            K = float(np.sum(problem.c * (beta + push) * _far_at(tables, beta, index)))
            traction = beta + (np.abs(problem.l_tilde) + change) / problem.c
            L = float(np.sqrt(np.sum(problem.c * traction**2)))
            w = (L + np.sqrt(L**2 + 4.0 * softest * K)) / (2.0 * softest)
            y = (K + L**2 / (4.0 * softest)) / delta
            bound = 1.01 * (w / np.sqrt(problem.c) + y * np.abs(self.N).sum(axis=1))
            if np.max(bound) < np.max(reach):
                reach = bound
        return reach

    def reason(self, motion: Motion) -> str:
        """Return in one sentence what the motion does, and which rows it moves."""
        law = self.problem.law
        moves = np.abs(motion.r) > MOVES
        is_closed = np.broadcast_to(law.is_closed, moves.shape)
        rows = _named(np.flatnonzero(moves))
        scales = np.broadcast_to(law.tables.scales[law.index], moves.shape)
        is_bonded = bool(np.any(scales[moves] > 0.0))
        if np.any(is_closed & moves):
            when = " once its bond has failed" if is_bonded else ""
            return (
                f"nothing presses the body onto its foundation{when}: it flies off ({rows} open or "
                "slide); press it on, or constrain it"
            )
        cause = "nothing restrains the body: it slides"
        if is_bonded:
            cause = "the load is more than the bond can carry: the body slides once it has failed"
        return f"{cause} ({rows} move); lower the load, or prescribe a displacement"


def why_unbounded(problem: ContactProblem) -> str:
    """Return in one sentence why solutions may be anywhere, "" where their reach is known."""
    motions = LooseBody(problem)
    motion = motions.unresisted()
    if motion is not None:
        return motions.reason(motion)
    if np.all(np.isfinite(motions.reach(np.zeros(problem.m)))):
        return ""
    return "nothing resists a motion of the body, and the load does not decide where it is"


def _far_at(tables: Laws, beta: Array, index: Index) -> Array:
    """Return (m,) slips beyond which |b| is at least β, or its limit [m]."""
    slopes = np.stack([tables.q[:, -1], np.where(tables.closed, 0.0, tables.q[:, 0])])
    levels = np.abs(np.stack([tables.value(tables.s_0[:, -1], tables.addresses[:, -1]),
                              np.where(tables.closed, 0.0, tables.b_0[:, 0])]))  # fmt: skip
    reached = np.zeros((2, len(index)))
    rises = slopes[:, index] > 0.0
    np.divide(beta + levels[:, index], slopes[:, index], out=reached, where=rises)
    anchor = np.max(np.abs(tables.s_0), axis=1)[index]
    return np.asarray(far(tables)[index] + anchor + np.max(reached, axis=0))


def _named(rows: Index) -> str:
    """Return the numbers of rows in words."""
    names = ", ".join(str(row) for row in rows[:_MAX_ROWS_NAMED])
    more = ", …" if len(rows) > _MAX_ROWS_NAMED else ""
    return f"row{'s' if len(rows) > 1 else ''} {names}{more}"
