"""States of contact nodes: what the part of the friction law does that a node is on.

A part of b is a piece between two kinks, or a kink itself, where b̂ is an interval. Its code is 2k
for piece k and 2k + 1 for kink k, as in `tcstudy.contact.path.problem`.
"""

from __future__ import annotations

from enum import IntEnum

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tcstudy.laws.laws import Laws
from tcstudy.laws.pieces import DOWN, UP


class ContactState(IntEnum):
    """The state of a contact node."""

    STICK = 0
    """at rest on an up-jump of b"""
    SLIP = 1
    """on a part of b that does not soften and has not softened since s = 0"""
    SOFTEN = 2
    """on a softening part of b"""
    DROP = 3
    """at rest on a down-jump of b"""
    WEAKENED = 4
    """on a part of b that does not soften, beyond one that does"""


def contact_states(law: Laws) -> NDArray[np.int8]:
    """Return the ContactState of the law's parts by code (2K+1,).

    A piece with an exponential part softens where it decays.
    """
    softens = law.end_slopes.sum(axis=0) < 0.0
    states = np.full(2 * len(law.kinks) + 1, ContactState.STICK, dtype=np.int8)
    states[0::2] = np.where(softens, ContactState.SOFTEN, ContactState.SLIP)
    states[1::2][law.kinds == DOWN] = ContactState.DROP
    for direction in (1, -1):
        first = 2 * int(law.piece(0.0, direction))
        outward = states[first::direction]  # a view of the parts from s = 0 outwards
        has_softened = np.logical_or.accumulate(
            (outward == ContactState.SOFTEN) | (outward == ContactState.DROP)
        )
        outward[has_softened & (outward == ContactState.SLIP)] = ContactState.WEAKENED
    return states


def node_states(law: Laws, u_T: ArrayLike, sticks: ArrayLike) -> NDArray[np.int8]:
    """Return the ContactState of nodes with tangential displacements (…, m) [m].

    A bend counts to the piece beyond it, seen from s = 0.

    sticks: nodes that are known to rest on an up-jump
    """
    u = np.asarray(u_T, dtype=float)
    states_of_pieces = np.zeros(law.tables.q.shape, dtype=np.int8)
    for row, single_law in zip(states_of_pieces, law.laws, strict=True):
        states = contact_states(single_law)[0::2]
        row[:] = states[np.minimum(np.arange(len(row)), len(states) - 1)]
    location = law.locate(u)
    kind = law.kind(location)
    piece = np.where(u < 0.0, location.piece, location.piece + location.on)
    states = states_of_pieces.take(piece)
    states[kind == DOWN] = ContactState.DROP
    states[np.asarray(sticks, dtype=bool) | (kind == UP)] = ContactState.STICK
    return states


class NormalState(IntEnum):
    """The state of a contact node that may lift off."""

    CLOSED = 0
    """rests on the foundation, or is pressed into one that gives way"""
    ELASTIC = 1
    """its bond is open and has not softened"""
    SOFTENING = 2
    """its bond softens, or has dropped down"""
    OPEN = 3
    """no bond holds it: lifted off, or beyond the last softening"""


_NORMAL_STATES = {
    ContactState.STICK: NormalState.CLOSED,
    ContactState.SLIP: NormalState.ELASTIC,
    ContactState.SOFTEN: NormalState.SOFTENING,
    ContactState.DROP: NormalState.SOFTENING,
    ContactState.WEAKENED: NormalState.OPEN,
}


def normal_states(law: Laws, s_N: ArrayLike, rests: ArrayLike) -> NDArray[np.int8]:
    """Return the NormalState of nodes with openings (…, m) [m].

    law:   of the openings;  rests: nodes that are known to rest on a vertical segment of it
    """
    opening = np.asarray(s_N, dtype=float)
    normal_state_of = np.array([_NORMAL_STATES[state] for state in ContactState], dtype=np.int8)
    states = normal_state_of[node_states(law, opening, rests)]
    is_free = (states == NormalState.ELASTIC) & (law.b(opening) == 0.0)
    states[is_free] = NormalState.OPEN
    states[opening <= 0.0] = NormalState.CLOSED
    return states
