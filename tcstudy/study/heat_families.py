"""Families of temperatures: what one q or one θ̄ gives for all α, and the few columns that span them to rounding."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tcstudy.scene.expressions import Expression
from tcstudy.scene.records import Heat, Scalar

Array = NDArray[np.float64]

ROUNDING = 1e-14
"""Part of a variation that the columns of its family may miss, relative to the variation (norm of L²(Γ_θ))."""


@dataclass(frozen=True)
class FamilyKey:
    """What a family belongs to: a source density of shape `data` in ω, or surroundings at `data` with no source."""

    kind: str
    data: Scalar
    omega: tuple[str, ...] = ()


@dataclass(frozen=True)
class Column:
    """Names one column of a family."""

    family: FamilyKey
    number: int


def families_of(heat: Heat) -> list[FamilyKey]:
    """The families that a heat record has part in."""
    found = []
    if isinstance(heat.theta_bar, Expression):
        found.append(FamilyKey("surroundings", heat.theta_bar))
    if isinstance(heat.q, Expression):
        found.append(FamilyKey("source", heat.q, heat.omega))
    elif heat.q != 0.0:
        found.append(FamilyKey("source", 1.0, heat.omega))
    return found


def basis_of(rows: Array) -> Array:
    """(r, s) orthonormal columns from which every row (t, r) can be combined up to ROUNDING of its norm.

    Gram-Schmidt, the row that is worst represented next; as many columns as rows say that nothing was saved.
    """
    norms = np.linalg.norm(rows, axis=1)
    rest = (rows[norms > 0.0] / norms[norms > 0.0, None]).T
    basis = np.zeros((rows.shape[1], 0))
    while basis.shape[1] < rest.shape[1]:
        missed = np.linalg.norm(rest, axis=0)
        if missed.max() <= ROUNDING:
            break
        new = rest[:, missed.argmax()].copy()
        new -= basis @ (basis.T @ new)
        new /= np.linalg.norm(new)
        new -= basis @ (basis.T @ new)
        new /= np.linalg.norm(new)
        basis = np.column_stack([basis, new])
        rest -= np.outer(new, new @ rest)
    return basis
