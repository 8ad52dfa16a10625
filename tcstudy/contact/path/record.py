"""What a followed path is: its vertices, its pieces, its events, and why it ended."""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from tcstudy.contact.path.problem import LawGraph, ParametricProblem

Array = NDArray[np.float64]
Index = NDArray[np.intp]
Codes = NDArray[np.int32]


class PathStatus(IntEnum):
    """Why a path was not followed further."""

    RANGE_END = 0
    CLOSED_LOOP = 1
    UNBOUNDED = 2
    PIECE_LIMIT = 3
    UNSTABLE = 4
    TURNED_BACK = 5
    SINGULAR = 6
    LOST_ACCURACY = 7
    START = 8
    TURNS = 9


WHOLE = (PathStatus.RANGE_END, PathStatus.UNBOUNDED, PathStatus.CLOSED_LOOP, PathStatus.START)
"""Ends at which there is nothing more to follow."""
REASONS = {
    PathStatus.RANGE_END: "the parameter reached the end of the range that the path may use",
    PathStatus.CLOSED_LOOP: "the path is a closed loop and came back to its start",
    PathStatus.UNBOUNDED: "the last piece goes on without bound and no node changes its piece any more",
    PathStatus.PIECE_LIMIT: "the limit on the number of pieces was reached; raise max_pieces to follow it further",
    PathStatus.UNSTABLE: "the stable branch ends here",
    PathStatus.TURNED_BACK: "the path came back to a piece it had been on: branches meet at a bifurcation; "
    "start again from another solution to follow the others",
    PathStatus.SINGULAR: "no unique way leads on from here (a bifurcation, or a solution that no others join); start "
    "again from another solution",
    PathStatus.TURNS: "a node turns back here",
    PathStatus.START: "the path was followed from here in one direction only",
    PathStatus.LOST_ACCURACY: "rounding left a residual above the tolerance even after a fresh factorisation; the "
    "problem is too badly conditioned for it, raise the tolerance or check the units",
}


@dataclass(frozen=True)
class PathEnd:
    """One end of a path: status and a sentence for the user."""

    status: PathStatus

    @property
    def reason(self) -> str:
        """Why."""
        return REASONS[self.status]


@dataclass(frozen=True)
class Events:
    """Changes of piece in the order of the path, all (e,): vertex, node, code before and code after.

    Codes are those of tcstudy.contact.path.problem: 2k a segment (slip), 2k+1 the vertical side at kink k (stick),
    counted on from law to law where nodes have laws of their own.
    """

    vertex: Index
    node: Index
    before: Codes
    after: Codes


@dataclass(frozen=True)
class Path:
    """A piecewise-linear path of solutions of Ãu + ξ = l̃₀ + t l̃₁, vertices in the order of travel.

    problem:     what was followed
    t:           (k,) parameter at the vertices
    u:           (k, m) displacements [m]
    traction:    (k, m) ξ/c [Pa], on the graph of b̂
    residual:    (k,) max_i |l̃ − Ãu − ξ|_i/c_i / (scale of b): how far the point on the graph is from balance
    stable:      (k−1,) per piece: strict local minimum of L̃ in its interior
    first_codes: (m,) code of every node on the first piece
    events:      all later changes of code
    start:       vertex from which the path was followed
    begin, end:  why it stops at the first and at the last vertex
    factorisations: dense factorisations used
    """

    problem: ParametricProblem
    t: Array
    u: Array
    traction: Array
    residual: Array
    stable: NDArray[np.bool_]
    first_codes: Codes
    events: Events
    start: int
    begin: PathEnd
    end: PathEnd
    factorisations: int

    @property
    def pieces(self) -> int:
        """Number of pieces."""
        return len(self.stable)

    @cached_property
    def codes(self) -> Codes:
        """(k−1, m) code of every node on every piece."""
        codes = np.tile(self.first_codes, (self.pieces, 1))
        e = self.events
        for vertex, node, after in zip(e.vertex, e.node, e.after, strict=True):
            codes[vertex:, node] = after
        return codes

    @cached_property
    def slipping(self) -> NDArray[np.bool_]:
        """(k−1, m) True where a node is on a segment of b, False where it sits on a vertical side."""
        return np.asarray(self.problem.graph.free[self.codes])

    @cached_property
    def conjugate(self) -> Array:
        """(k,) W = l̃₁ᵀu, the displacement on which t does work; dL̃/dt = −W along the path."""
        return np.asarray(self.u @ self.problem.l_1)

    @cached_property
    def energy(self) -> Array:
        """(k,) L̃ at the vertices [J/m], from the displacements themselves."""
        p = self.problem
        load = p.l_0[None, :] + self.t[:, None] * p.l_1[None, :]
        force = load - self.traction * p.c  # = Ãu up to the residual
        return np.asarray(np.sum((0.5 * force - load) * self.u, axis=1) + p.law.j(self.u) @ p.c)

    @cached_property
    def curve(self) -> Array:
        """(k, 2) t and the resultant R = Σξ [N/m] at the vertices."""
        return np.stack([self.t, self.traction @ self.problem.c], axis=1)

    def along(self, side: int) -> tuple[Array, float]:
        """(row, time) of a coordinate row·u + time·t along a piece: that of the slips, or t where all nodes rest."""
        way = self.u[side + 1] - self.u[side]
        length = float(np.max(np.abs(way)))
        if length == 0.0:
            return np.zeros(len(way)), float(np.sign(self.t[side + 1] - self.t[side]))
        return way / length, 0.0

    @cached_property
    def folds(self) -> Index:
        """Vertices at which t turns (a piece along which t stands still belongs to the fold before it)."""
        direction = np.sign(np.diff(self.t))
        moving = np.flatnonzero(direction)
        turns = np.flatnonzero(direction[moving][1:] != direction[moving][:-1])
        return moving[turns] + 1


class Recorder:
    """Vertices while a path is being followed."""

    def __init__(self) -> None:
        self.t: list[float] = []
        self.u: list[Array] = []
        self.traction: list[Array] = []
        self.residual: list[float] = []
        self.waiting: list[tuple[Array, Codes]] = []
        self.stable: list[bool] = []
        self.events: list[tuple[int, int, int, int]] = []

    @property
    def count(self) -> int:
        """Vertices so far."""
        return len(self.t)

    def add(self, t: float, x: Array, codes: Codes) -> None:
        """A vertex by its moving coordinates; the rest is filled in when it is checked."""
        self.t.append(t)
        self.waiting.append((x.copy(), codes.copy()))

    def replace_last(self, t: float, x: Array, codes: Codes) -> None:
        """The last vertex, known better."""
        self.t[-1], self.waiting[-1] = t, (x.copy(), codes.copy())

    def on_graph(self, graph: LawGraph, weight: Array) -> tuple[Array, Array]:
        """(u, ξ/c) of all vertices that waited for them, (w, m) each; weight: c in the units of x."""
        x, codes = (np.array(rows) for rows in zip(*self.waiting, strict=True))
        self.waiting.clear()
        u, traction = graph.points(codes, x, weight)
        self.u.extend(u)
        self.traction.extend(traction)
        return u, traction

    def changed(self, node: int, before: int, after: int) -> None:
        """The code of a node that changes at the last vertex."""
        if before != after:
            self.events.append((len(self.t) - 1, node, before, after))

    def cut(self, count: int) -> None:
        """Forget everything after the first `count` vertices; events at the last of them stay."""
        del (
            self.t[count:],
            self.u[count:],
            self.traction[count:],
            self.residual[count:],
            self.stable[count - 1 :],
        )
        while self.events and self.events[-1][0] >= count:
            self.events.pop()


def joined(problem: ParametricProblem, halves: list[tuple[Recorder, Codes, PathEnd]], factorisations: int) -> Path:
    """The path from its forward half and, if there is one, the backward half (reversed and put in front).

    halves: (record, codes of the half's first piece, end); forward first
    """
    record, first, end = halves[0]
    begin = end if end.status == PathStatus.CLOSED_LOOP else PathEnd(PathStatus.START)
    back, back_first = Recorder(), first
    if len(halves) > 1:
        back, back_first, begin = halves[1]
    shift = max(back.count - 1, 0)
    e, events = _event_arrays(back), _event_arrays(record)
    codes = back_first.copy()
    for node, after in zip(e.node, e.after, strict=True):
        codes[node] = after
    kink = np.flatnonzero(back_first != first)
    turned = Events(
        np.concatenate([shift - e.vertex[::-1], np.full(len(kink), shift), shift + events.vertex]),
        np.concatenate([e.node[::-1], kink, events.node]),
        np.concatenate([e.after[::-1], back_first[kink], events.before]),
        np.concatenate([e.before[::-1], first[kink], events.after]),
    )
    return Path(
        problem,
        np.array([*back.t[:0:-1], *record.t]),
        np.array([*back.u[:0:-1], *record.u]),
        np.array([*back.traction[:0:-1], *record.traction]),
        np.array([*back.residual[:0:-1], *record.residual]),
        np.array([*back.stable[::-1], *record.stable], dtype=bool),
        codes,
        turned,
        shift,
        begin,
        end,
        factorisations,
    )


def _event_arrays(record: Recorder) -> Events:
    vertex, node, before, after = np.array(record.events, dtype=np.intp).reshape(-1, 4).T
    return Events(vertex, node, before.astype(np.int32), after.astype(np.int32))
