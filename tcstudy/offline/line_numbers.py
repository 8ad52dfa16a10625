"""What a law does along the contact line, in numbers: how long each of its regions is, where it slips and pulls most.

u_T is linear between the nodes of Γ_C, so that the part of a segment with slips up to a breakpoint s of its law is
(s − min u_T)/(max u_T − min u_T), and lengths of regions (`LawPieces.regions`) are exact differences of such parts. The
law of a segment is that of its edge; where strength varies along it, each half has the law of its own node.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from tcstudy.fem.boundary import ContactLine
from tcstudy.laws.laws import Laws
from tcstudy.laws.pieces import BARE, DEBONDED, REGIONS, UP
from tcstudy.offline.level import Level
from tcstudy.scene.records import Scene

Array = NDArray[np.float64]
EQUAL = 1e-9
"""Relative difference of two tractions that are one, as on a plateau of b: the first of them counts."""


def line_numbers(level: Level, scenes: Sequence[Scene], laws: Laws, v: Array, xi: Array) -> dict[str, Array]:
    """(P,) by name: `shear_max` [Pa], `shear_max_at` and `<region>_length` [m], NaN where a point's laws have none.

    laws: of rows (P, 1) or (P, m);  v, xi: (P, m) slips [m] and tractions [Pa]
    """
    given = {id(scene.boundary): scene for scene in scenes}
    slips = {key: level.held_slips(scene) for key, scene in given.items()}
    found = region_lengths(level, laws, v, np.array([slips[id(scene.boundary)] for scene in scenes]))
    slipping, size = np.where(laws.kind(laws.locate(v)) == UP, 0.0, level.line.c), np.abs(xi)
    most = np.max(size, axis=1)
    return found | {
        "slip_length": np.where(np.isnan(found.get("breathing_length", np.nan)), np.nan, slipping.sum(axis=1)),
        "shear_max": most,
        "shear_max_at": level.line.arclength[np.argmax(size >= (1.0 - EQUAL) * most[:, None], axis=1)],
    }


def region_lengths(level: Level, laws: Laws, v: Array, held: Array) -> dict[str, Array]:
    """(P,) lengths by name [m]. laws: of rows (P, 1) or (P, m)

    held: (P, h) slips of the held ends of segments, NaN for that of the node beside it
    """
    line, index, by_node = level.line, laws.index, laws.index.shape[1] > 1
    own, length, ends = line.own_law, line.lengths, v[:, line.own_law]
    ends = np.where(line.unknowns < 0, ends, v[:, line.unknowns])
    ends[:, line.unknowns < 0] = np.where(np.isnan(held), ends[:, line.unknowns < 0], held)
    first, second = ends[..., 0], ends[..., 1]
    if by_node:
        middle = 0.5 * (first + second)
        first, second = np.hstack([first, middle]), np.hstack([middle, second])
        length, index = np.tile(0.5 * length, 2), index[:, own.T.ravel()]
    low, high = np.minimum(first, second), np.maximum(first, second)
    resting = low == high
    width = np.where(resting, 1.0, high - low)
    # what rests on an up-jump is in no region
    moving = ~(resting & (laws.kind(laws.locate(low, index)) == UP))
    regions, found = laws.regions, dict[str, Array]()
    parts = {k: np.where(regions[index, -1] == k, 1.0, 0.0) for k in np.unique(regions)}
    for j in range(laws.kinks.shape[1]):
        if not np.any(regions[:, j] != regions[:, j + 1]):
            continue
        kink = laws.kinks[index, j]
        below = np.where(resting, kink >= high, np.clip((kink - low) / width, 0.0, 1.0))
        for k, part in parts.items():
            sign = (regions[:, j] == k).astype(float) - (regions[:, j + 1] == k)
            parts[k] = part + sign[index] * below if np.any(sign) else part
    known = (
        laws.index if not by_node else np.delete(laws.index, line.joints.node, axis=1)
    )  # a joint has its edges' laws
    for k, part in parts.items():
        has = np.any(regions == k, axis=1)[known].any(axis=1)
        if k != BARE and np.any(has):
            found[f"{REGIONS[k]}_length"] = np.where(has, (part * moving) @ length, np.nan)
    sticks = np.any(laws.kinds == UP, axis=1)[known].any(axis=1)
    if np.any(sticks):
        slips = ((first != 0.0) | (second != 0.0)) @ length
        found["breathing_length"] = np.where(sticks, slips, np.nan)
    return found


def debonded_front(line: ContactLine, law: Laws, kappa: Array) -> dict[str, float]:
    """`debonded_from`, `debonded_to`: arclengths between which a bond is debonded whose nodes have slipped by up to
    kappa (m,), linear between them; NaN where it is nowhere, nothing for a law that never has fallen [m].
    """
    table, m = law.tables, line.m
    debonded = (table.regions == DEBONDED) & (table.lower >= 0.0)
    if not np.any(debonded):
        return {}
    beyond = kappa - np.min(np.where(debonded, table.lower, np.inf), axis=1)[law.node_index(m)]
    at, x = np.flatnonzero(beyond >= 0.0), line.arclength

    def passed(node: int, other: int, end: float) -> float:
        if not 0 <= other < m:
            return end
        return float(x[node] + beyond[node] / (beyond[node] - beyond[other]) * (x[other] - x[node]))

    if not len(at):
        return {"debonded_from": np.nan, "debonded_to": np.nan}
    whole = float(line.lengths.sum())
    return {"debonded_from": passed(at[0], at[0] - 1, 0.0), "debonded_to": passed(at[-1], at[-1] + 1, whole)}
