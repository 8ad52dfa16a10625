"""Blocks of contact problems for the tests of the engine, and their single problems."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import fields, is_dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tcstudy.contact.block import Answer, solve_block
from tcstudy.contact.problem import CondensedBody, ContactProblem
from tcstudy.laws.laws import Laws
from tcstudy.study.level_solver import ENOUGH, ENTRIES, MOST, POINTS
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


def single(body: CondensedBody, load: Array, law: Laws) -> ContactProblem:
    """One point as the single solve takes it."""
    return ContactProblem(body.A_tilde, load, body.c, law)


def solve_points(body: CondensedBody, loads: Array, tables: Laws, law: Index, tolerance: float | None = None) -> Answer:
    """Any number of points, sorted by law and cut into blocks of the size that a study has; answers in their order."""
    size = max(1, min(POINTS, max(ENTRIES // max(1, body.m), min(ENOUGH, MOST // max(1, body.m)))))
    order = np.argsort(law, kind="stable")
    parts = []
    for own in np.array_split(order, -(-len(order) // size)):
        used, rows = np.unique(law[own], return_inverse=True)
        parts.append(solve_block(body, loads[own], tables.at(used[rows].reshape(-1, 1)), tolerance=tolerance))
    return reordered(parts, np.argsort(order, kind="stable"))


def reordered(parts: Sequence[Any], points: Index) -> Any:
    """The named points of several records of points that follow each other."""
    own: dict[str, Any] = {}
    for field in fields(parts[0]):
        values = [getattr(part, field.name) for part in parts]
        if is_dataclass(values[0]):
            own[field.name] = reordered(values, points)
        elif values[0] is not None:
            own[field.name] = np.concatenate([np.asarray(value) for value in values])[points]
    return replace(parts[0], **own)
