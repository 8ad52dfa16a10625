"""Contact problems on one body as rows of arrays: their forces ξ and energies L̃."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tcstudy.online.body import Body
from tcstudy.online.law_tables import Place
from tcstudy.online.row_laws import RowLaws

Array = NDArray[np.float64]
Index = NDArray[np.intp]


@dataclass(frozen=True, eq=False)
class Rows:
    """R contact problems on one body: loads l̃ (R, m) [N/m] and laws."""

    body: Body
    laws: RowLaws
    loads: Array

    def take(self, rows: Index) -> Rows:
        """The named rows."""
        return Rows(self.body, self.laws.take(rows), self.loads[rows])

    def xi(self, v: Array) -> Array:
        """ξ = l̃ − Ãv (R, m) [N/m]."""
        return np.asarray(self.loads - v @ self.body.A_tilde)

    def energy(self, v: Array) -> Array:
        """(R,) L̃(v) [J/m]."""
        zero = np.zeros(v.shape)
        friction = self.laws.integral(zero, v, self.laws.locate(zero), self.laws.locate(v))
        return np.asarray(friction @ self.body.c - 0.5 * np.einsum("ri,ri->r", v, self.loads + self.xi(v)))

    def energy_change(self, x: Array, xi: Array, target: Array, at: Place) -> tuple[Array, Array]:
        """(R,) each: L̃(target) − L̃(x), summed from small terms, and the work of ξ that it is small against [J/m].

        xi, at: ξ and place of x
        """
        move = target - x
        work = xi * move
        friction = self.body.c * self.laws.integral(x, target, at, self.laws.locate(target))
        change = np.sum(friction - work + 0.5 * move * (move @ self.body.A_tilde), axis=1)
        return change, np.abs(work).sum(axis=1)
