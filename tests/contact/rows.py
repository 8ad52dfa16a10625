"""Blocks of contact problems for the tests of the engine, and their single problems."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import fields

import numpy as np
from numpy.typing import NDArray

from tcstudy.contact.block import BlockAnswers, Certificates, Options, solve_block
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


def solve_points(
    body: CondensedBody, loads: Array, tables: Laws, law: Index, options: Options | None = None
) -> BlockAnswers:
    """Any number of points, sorted by law and cut into blocks of the size that a study has; answers in their order."""
    size = max(1, min(POINTS, max(ENTRIES // max(1, body.m), min(ENOUGH, MOST // max(1, body.m)))))
    order = np.argsort(law, kind="stable")
    parts = []
    for own in np.array_split(order, -(-len(order) // size)):
        used, rows = np.unique(law[own], return_inverse=True)
        parts.append(solve_block(body, loads[own], tables.at(used[rows].reshape(-1, 1)), options))
    return reordered(parts, np.argsort(order, kind="stable"))


def reordered(parts: Sequence[BlockAnswers], points: Index) -> BlockAnswers:
    """The named points of several blocks that follow each other."""

    def together(records: Sequence[object], kind: type) -> dict[str, Array]:
        names = [f.name for f in fields(kind) if f.name not in ("reasons", "certificates")]
        return {name: np.concatenate([getattr(record, name) for record in records])[points] for name in names}

    reasons = [reason for part in parts for reason in part.reasons]
    proved = Certificates(**together([part.certificates for part in parts], Certificates))
    own = together(parts, BlockAnswers)
    return BlockAnswers(**own, reasons=tuple(reasons[p] for p in points), certificates=proved)
