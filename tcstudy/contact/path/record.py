"""What a followed path is: its vertices, its pieces, its events, and why it ended."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from tcstudy.contact.path.problem import ParametricProblem

Array = NDArray[np.float64]
Index = NDArray[np.intp]
Codes = NDArray[np.int32]


class PathStatus(Enum):
    """Why a path was not followed further, as a sentence for the user."""

    RANGE_END = "the parameter reached the end of the range that the path may use"
    CLOSED_LOOP = "the path is a closed loop and came back to its start"
    UNBOUNDED = "the last piece goes on without bound and no node changes its piece any more"
    PIECE_LIMIT = "the limit on the number of pieces was reached; raise max_pieces to follow it further"
    UNSTABLE = "the stable branch ends here"
    TURNED_BACK = (
        "the path came back to a piece it had been on: branches meet at a bifurcation; start again from another "
        "solution to follow the others"
    )
    SINGULAR = (
        "no unique way leads on from here (a bifurcation, or a solution that no others join); start again from "
        "another solution"
    )
    LOST_ACCURACY = (
        "rounding left a residual above the tolerance even after a fresh factorisation; the problem is too badly "
        "conditioned for it, raise the tolerance or check the units"
    )
    START = "the path was followed from here in one direction only"
    TURNS = "a node turns back here"

    @property
    def reason(self) -> str:
        return self.value


WHOLE = (PathStatus.RANGE_END, PathStatus.UNBOUNDED, PathStatus.CLOSED_LOOP, PathStatus.START)
"""Ends at which there is nothing more to follow."""


class Events(NamedTuple):
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
    codes:       (k−1, m) code of every node on every piece
    start:       vertex from which the path was followed
    begin, end:  why it stops at the first and at the last vertex
    """

    problem: ParametricProblem
    t: Array
    u: Array
    traction: Array
    residual: Array
    stable: NDArray[np.bool_]
    codes: Codes
    start: int
    begin: PathStatus
    end: PathStatus

    @classmethod
    def standing(cls, problem: ParametricProblem, t: float, u: Array, end: PathStatus) -> Path:
        """A solution from which no straight piece leads on, as the path that ends there."""
        force = (problem.load(t) - problem.A_tilde @ u) / problem.c
        traction = np.clip(force, *problem.law.interval(u))
        residual = np.max(np.abs(force - traction)) / problem.traction_scale
        rows, none = (
            (np.array([t]), u[None], traction[None], np.array([residual])),
            np.zeros((0, len(u)), dtype=np.int32),
        )
        return cls(problem, *rows, np.zeros(0, dtype=bool), none, 0, end, end)

    @property
    def pieces(self) -> int:
        """Number of pieces."""
        return len(self.stable)

    @cached_property
    def events(self) -> Events:
        """All changes of code."""
        before, node = np.nonzero(self.codes[1:] != self.codes[:-1])
        return Events(before + 1, node, self.codes[before, node], self.codes[before + 1, node])

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
        """(k,) L̃ at the vertices [J/m]."""
        return self.problem.energy(self.t, self.u, self.traction)

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
