"""Eliminate the unknowns without a law, which are linear in the others.

Where edges lift off without friction, half of the unknowns have the law b ≡ 0, and the time of a
path is ∝ m² a piece. With f the rows without a law and k the others, Ã_ff u_f = l̃_f − Ã_fk u_k.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TypeVar

import numpy as np
import scipy.linalg
from numpy.typing import NDArray

from tcstudy.laws.laws import Laws

Value = TypeVar("Value", bound=np.generic)
Array = NDArray[np.float64]
Index = NDArray[np.intp]
Flags = NDArray[np.bool_]


@dataclass(frozen=True)
class Elimination:
    """The rows of Ã (m, m) with a law, and those without as functions of them.

    rows: (k,) rows with a law;  free_rows: (f,) rows without
    """

    A_tilde: Array
    rows: Index
    free_rows: Index

    @classmethod
    def of(
        cls, A_tilde: Array, law: Laws, blocks: tuple[int, ...], loose: bool
    ) -> Elimination | None:
        """Return the elimination of a body with openings, None if all rows have a law or none has.

        blocks: numbers of slips and openings, () without openings
        loose:  contact alone holds the body, whose rows without a law may be singular; then None
        """
        if loose or not blocks:
            return None
        vanishes = rows_without_law(law, len(A_tilde))
        if np.all(vanishes) or not np.any(vanishes):
            return None
        return cls(A_tilde, np.flatnonzero(~vanishes), np.flatnonzero(vanishes))

    @cached_property
    def _coupling(self) -> Array:
        return self.A_tilde[np.ix_(self.free_rows, self.rows)]

    @cached_property
    def _factor(self) -> tuple[Array, bool]:
        block = self.A_tilde[np.ix_(self.free_rows, self.free_rows)]
        factor: tuple[Array, bool] = scipy.linalg.cho_factor(block)
        return factor

    @cached_property
    def _following(self) -> Array:
        """U (f, k) with u_f = … + U u_k."""
        following: Array = -scipy.linalg.cho_solve(self._factor, self._coupling)
        return following

    def _unforced(self, load: Array) -> Array:
        """Return u_f (…, f) at u_k = 0 under loads (…, m)."""
        unforced: Array = scipy.linalg.cho_solve(self._factor, load[..., self.free_rows].T).T
        return unforced

    @cached_property
    def kept(self) -> Array:
        """Ã of the rows with a law (k, k)."""
        A = self.A_tilde[np.ix_(self.rows, self.rows)] + self._coupling.T @ self._following
        return 0.5 * (A + A.T)

    def load(self, load: Array) -> Array:
        """Return loads (…, k) on the rows with a law from those (…, m) on all."""
        condensed: Array = load[..., self.rows] - self._unforced(load) @ self._coupling
        return condensed

    def energy(self, load: Array) -> float:
        """Return −½ l̃_f·Ã_ff⁻¹ l̃_f, the part of the energy that no u_k changes [J/m]."""
        return -0.5 * float(load[self.free_rows] @ self._unforced(load))

    def displacements(self, u: Array, load: Array) -> Array:
        """Return all displacements (…, m) from those (…, k) with a law under loads (…, m)."""
        full = self.spread(u)
        full[..., self.free_rows] = self._unforced(load) + u @ self._following.T
        return full

    def spread(self, values: NDArray[Value]) -> NDArray[Value]:
        """Return values (…, m), 0 in rows without a law, from those (…, k) of the others."""
        full = np.zeros((*values.shape[:-1], len(self.A_tilde)), dtype=values.dtype)
        full[..., self.rows] = values
        return full

    def blocks(self, blocks: tuple[int, ...]) -> tuple[int, ...]:
        """Return the sizes of the blocks of rows that are left of these."""
        ends = np.cumsum(blocks)
        return tuple(np.diff(np.searchsorted(self.rows, ends), prepend=0).tolist())


def rows_without_law(law: Laws, m: int) -> Flags:
    """Return which of m rows have the law b ≡ 0."""
    vanishes = [single_law.vanishes for single_law in law.tables.laws]
    return np.array(vanishes)[law.node_index(m)]
