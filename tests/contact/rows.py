"""Blocks of contact problems for the tests of the engine."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from tcstudy.contact.problem import CondensedBody
from tcstudy.contact.solve import Answer, solve_block
from tcstudy.laws.laws import Laws
from tests.contact import contact_cases as cases

Array = NDArray[np.float64]
Index = NDArray[np.intp]


def some_laws() -> list[Laws]:
    """One law of every kind: softening, smooth, without kinks, with down-jumps, and two random ones."""
    rng = np.random.default_rng(7)
    return [
        cases.slip_weakening(1.0, 0.4, 0.15),
        cases.exponential_decay(1.0, 0.5, 0.1),
        cases.spring(2.0),
        cases.sawtooth(),
        cases.random_law(rng, np.pi, 9),
        cases.random_law(rng, np.pi, 9, smooth=True),
    ]


def block(m: int, laws: Sequence[Laws], points: int, seed: int = 0) -> tuple[CondensedBody, Array, Laws, Index]:
    """(body, loads (P, m), tables, law of every point): waves of 0.4 to 2.5 times the size of b."""
    rng = np.random.default_rng([seed, m])
    body = CondensedBody.of(*cases.half_laplacian(m))
    law = rng.integers(0, len(laws), points)
    x, loads = (np.arange(m) + 0.5) / m, np.empty((points, m))
    for p in range(points):
        waves = (rng.normal() / k * np.sin(np.pi * k * x + rng.uniform(0, 6)) for k in range(1, 5))
        shape = rng.normal() + sum(waves)
        size = laws[law[p]].b_scale or 1.0
        loads[p] = body.c * shape * rng.uniform(0.4, 2.5) * size / np.max(np.abs(shape))
    return body, loads, Laws.of(laws), law


def solve_points(body: CondensedBody, loads: Array, tables: Laws, law: Index, tolerance: float | None = None) -> Answer:
    """All points as one block with only the laws in use."""
    used, rows = np.unique(law, return_inverse=True)
    return solve_block(body, loads, tables.at(used[rows].reshape(-1, 1)), tolerance=tolerance)
