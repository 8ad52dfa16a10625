"""Where the law itself folds beside a path on straight pieces in the place of its curve.

Straight pieces fold at one of their own corners, a little before or after the curve does, and what a jump releases
is of first order in that. At the fold of the law there is one more equation g = 0 for the free nodes F and the share t:
  smooth  A_FF + diag(c b′) becomes singular: [H β; βᵀ 0] [φ; g] = [0; 1], g = −φᵀHφ, dg = −Σ φ² c b″ dw
  rest    a node at rest is at its limit and would slide: g = ξ_e − c_e b_e
  kink    a sliding node is at a kink of the law, behind which it falls more steeply: g = w_e − s_kink
Newton's method on both from the fold of the straight pieces. What it finds is one only if it is a solution there, all
nodes considered, and stable up to it. Literature: Griewank & Reddien, IMA J. Numer. Anal. 4 (1984) 295–303 (folds by
bordered matrices).
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import cached_property, partial
from itertools import chain

import numpy as np
import scipy.linalg
from numpy.typing import NDArray

from tcstudy.contact.factors import factor_free, with_diagonal
from tcstudy.contact.history.memory import NARROW
from tcstudy.contact.path.record import Path
from tcstudy.laws.laws import Laws

Array = NDArray[np.float64]
Index = NDArray[np.intp]
Equation = Callable[[Array, float, Array], tuple[float, Array, float]]
"""From w, t, H, in units of the fold, to g and its derivatives by w_F and t."""

NEWTON = 40
CUBE, ROOT = float(np.cbrt(np.finfo(float).eps)), float(np.sqrt(np.finfo(float).eps))
NEAR = 0.1
"""The law folds beside straight pieces if it does within this part of the slips over which b changes."""
AT_LIMIT = 1e-9
"""Part of the scale of b by which the path's rounding may keep a node from the limit that it has reached."""


def folds_beside(path: Path, vertex: int, law: Laws, slip: float) -> Iterator[tuple[float, Array]]:
    """(t, w) of folds of the law near a vertex of the path on straight pieces, that of the path's own kind first.

    A fold beyond the step is none: it is the end of the step then, on the stable side.
    slip: over which b changes [m]
    """
    yield from _Beside(path, vertex, law, slip).found()


def ended(path: Path, t: float, w: Array) -> tuple[Path, int]:
    """The path as far as t, and there w instead, with the number of that vertex."""
    count = int(np.argmax(path.t >= t)) if np.any(path.t >= t) else len(path.t)
    return replace(path, t=np.append(path.t[:count], t), u=np.vstack([path.u[:count], w])), count


@dataclass(frozen=True)
class _Beside:
    path: Path
    vertex: int
    law: Laws
    slip: float

    @cached_property
    def free(self) -> Index:
        """Nodes that slide on the side that ends at the vertex; at a state alone all that are at a limit."""
        p = self.path
        if p.pieces:
            return np.flatnonzero(p.slipping[self.vertex - 1])
        slack, (low, high) = AT_LIMIT * p.problem.traction_scale, self.law.interval(p.u[0])
        return np.flatnonzero((p.traction[0] <= low + slack) | (p.traction[0] >= high - slack))

    @cached_property
    def middle(self) -> Array:
        """(m,) a point of that side."""
        u = self.path.u
        return np.asarray(0.5 * (u[self.vertex] + u[max(self.vertex - 1, 0)]))

    @cached_property
    def piece(self) -> Index:
        """(n,) pieces of the law of the free nodes."""
        own, at = self.law.of_nodes(self.free), self.middle[self.free]
        return np.where(self.path.traction[self.vertex][self.free] < 0.0, own.piece(at, -1), own.piece(at, +1))

    @cached_property
    def stiffness(self) -> float:
        """Unit of H [Pa]."""
        return float(np.max(np.diagonal(self.path.problem.A_tilde)))

    def found(self) -> Iterator[tuple[float, Array]]:
        """Of all equations that may hold here."""
        if not len(self.free):
            return
        for equation in chain(self._limits(), self._kinks(), self._smooth()):
            at = self._newton(equation, self.path.u[self.vertex])
            if at is not None and at[0] > 1.0:  # the step ends before, on the stable side
                u = self.path.u
                begin = at[1] - (u[self.vertex] - u[self.vertex - 1]) if self.path.pieces else u[self.vertex]
                at = self._newton(self._whole, begin)
                at = (1.0, at[1]) if at is not None else None
            if at is not None:
                yield at

    def _whole(self, _w: Array, t: float, _H: Array) -> tuple[float, Array, float]:
        return t - 1.0, np.zeros(len(self.free)), 1.0

    def _matrix(self, w: Array) -> Array:
        """(n, n) H in its unit."""
        p, free = self.path.problem, self.free
        return (
            with_diagonal(p.A_tilde, free, p.c[free] * self.law.of_nodes(free).slope(w[free], self.piece))
            / self.stiffness
        )

    @np.errstate(over="ignore", invalid="ignore")  # far off an exponential passes all numbers; such a step ends it
    def _newton(self, equation: Equation, begin: Array) -> tuple[float, Array] | None:
        """The fold; None where Newton's method ends nowhere, or far off, or before the path."""
        p, free = self.path.problem, self.free
        own, c, l_1 = self.law.of_nodes(free), p.c[free], p.l_1[free] / (self.stiffness * self.slip)
        w, t, before = begin.copy(), float(self.path.t[self.vertex]), np.inf
        for _ in range(NEWTON):
            H = self._matrix(w)
            off = (p.load(t) - p.A_tilde @ w)[free] - c * own.value(w[free], self.piece)
            try:
                g, by_w, by_t = equation(w, t, H)
                J = np.block([[H, -l_1[:, None]], [by_w[None, :], np.full((1, 1), by_t)]])
                step = np.linalg.solve(J, np.append(off / (self.stiffness * self.slip), -g))
            except np.linalg.LinAlgError:
                return None
            w[free] += self.slip * step[:-1]
            t += float(step[-1])
            size = float(np.max(np.abs(step)))
            if not np.isfinite(size) or size > 1.0 / ROOT:
                return None
            if size == 0.0 or (size >= 0.5 * before and before <= ROOT):
                near = np.max(np.abs(w - self.path.u[self.vertex])) <= NEAR * self.slip
                apart = NARROW * float(np.max(np.abs(p.load(t))) / np.max(np.abs(p.l_1)))
                return (t, w) if near and self.path.t[0] + apart < t and self._stable(w) else None
            before = size
        return None

    def _stable(self, w: Array) -> bool:
        """Whether H has no negative eigenvalue, but for rounding."""
        p, slope = self.path.problem, self.law.of_nodes(self.free).slope(w[self.free], self.piece)
        added = p.c[self.free] * slope + ROOT * self.stiffness
        return factor_free(p.A_tilde, self.free, added)[1] == 0

    def _smooth(self) -> Iterator[Equation]:
        """Of a singular H; β its softest way at the fold of the straight pieces."""
        own, c, n = self.law.of_nodes(self.free), self.path.problem.c[self.free], len(self.free)
        _, border = scipy.linalg.eigh(self._matrix(self.path.u[self.vertex]), subset_by_index=[0, 0])

        def singular(w: Array, _t: float, H: Array) -> tuple[float, Array, float]:
            system = np.block([[H, border], [border.T, np.zeros((1, 1))]])
            phi, at, h = np.linalg.solve(system, np.append(np.zeros(n), 1.0)), w[self.free], CUBE * self.slip
            bend = (own.slope(at + h, self.piece) - own.slope(at - h, self.piece)) / (2.0 * h)
            return float(phi[-1]), -(phi[:-1] ** 2) * c * bend * self.slip / self.stiffness, 0.0

        yield singular

    def _limits(self) -> Iterator[Equation]:
        """Of nodes at rest that have reached their limits."""
        p, u, t = self.path.problem, self.path.u[self.vertex], float(self.path.t[self.vertex])
        traction, (low, high) = (p.load(t) - p.A_tilde @ u) / p.c, self.law.interval(u)
        limit = np.where(traction > 0.5 * (low + high), high, low)
        at = np.abs(traction - limit) <= AT_LIMIT * p.traction_scale
        at[self.free] = False
        for node in np.flatnonzero(at):
            yield partial(self._slack, int(node), float(p.c[node] * limit[node]))

    def _slack(self, node: int, limit: float, w: Array, t: float, _H: Array) -> tuple[float, Array, float]:
        p, unit = self.path.problem, self.stiffness * self.slip
        row, l_1 = p.A_tilde[node], float(p.l_1[node])
        return float(p.l_0[node] + t * l_1 - row @ w - limit) / unit, -row[self.free] / self.stiffness, l_1 / unit

    def _kinks(self) -> Iterator[Equation]:
        """Of sliding nodes that have reached a kink of the law."""
        u = self.path.u[self.vertex]
        kinks = self.law.kink(np.asarray(self.law.nearest_kink(u)))
        for node in self.free[np.abs(u - kinks)[self.free] <= AT_LIMIT * self.slip]:
            yield partial(self._to_kink, int(node), float(kinks[node]))

    def _to_kink(self, node: int, kink: float, w: Array, _t: float, _H: Array) -> tuple[float, Array, float]:
        return float(w[node] - kink) / self.slip, np.where(self.free == node, 1.0, 0.0), 0.0
