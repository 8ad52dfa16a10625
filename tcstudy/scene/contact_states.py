"""What a contact node does: the states of the contact line, by the part of the friction law that the node is on.

A part of b is a piece between two kinks, or a kink itself, where b̂ is an interval. Its code is 2k for piece k and
2k + 1 for kink k, as in `tcstudy.contact.path.problem`.
"""

from __future__ import annotations

from enum import IntEnum

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tcstudy.laws.laws import Laws
from tcstudy.laws.pieces import DOWN, UP


class ContactState(IntEnum):
    """What a contact node does."""

    STICK = 0
    """at rest on an up-jump of b"""
    SLIP = 1
    """on a part of b that does not fall and has not fallen since s = 0"""
    SOFTEN = 2
    """on a falling part of b"""
    DROP = 3
    """at rest on a down-jump of b"""
    WEAKENED = 4
    """on a part of b that does not fall, beyond one that does"""


def contact_states(law: Laws) -> NDArray[np.int8]:
    """(2K+1,) ContactState by code of the law's parts; a piece with an exponential part falls where it decays."""
    states = np.full(2 * len(law.kinks) + 1, ContactState.STICK, dtype=np.int8)
    inner = np.concatenate([law.kinks[:1], 0.5 * (law.kinks[1:] + law.kinks[:-1]), law.kinks[-1:]])
    slope = law.slope(inner if len(inner) else np.zeros(1), np.arange(len(law.q)))  # of one sign where it decays
    states[0::2] = np.where(slope < 0.0, ContactState.SOFTEN, ContactState.SLIP)
    states[1::2][law.kinds == DOWN] = ContactState.DROP
    for side, outward in ((1, 1), (-1, -1)):
        way = states[2 * int(law.piece(0.0, side)) :: outward]  # a view: the pieces from s = 0 outwards
        fallen = np.logical_or.accumulate((way == ContactState.SOFTEN) | (way == ContactState.DROP))
        way[fallen & (way == ContactState.SLIP)] = ContactState.WEAKENED
    return states


def node_states(law: Laws, u_T: ArrayLike, sticks: ArrayLike) -> NDArray[np.int8]:
    """ContactState of nodes with these tangential displacements (…, m) [m]; sticks: those known to rest on an up-jump.

    A bend counts to the piece beyond it, seen from s = 0.
    """
    u, of_pieces = np.asarray(u_T, dtype=float), np.zeros(law.tables.q.shape, dtype=np.int8)
    for row, one in zip(of_pieces, law.laws, strict=True):
        states = contact_states(one)[0::2]
        row[:] = states[np.minimum(np.arange(len(row)), len(states) - 1)]
    at = law.locate(u)
    found = of_pieces.take(np.where(u < 0.0, at.piece, at.piece + at.on))
    found[law.kind(at) == DOWN] = ContactState.DROP
    found[np.asarray(sticks, dtype=bool) | (law.kind(at) == UP)] = ContactState.STICK
    return found
