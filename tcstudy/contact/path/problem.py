"""The problem of a path, with a load affine in t and a piecewise-linear law, and the path itself.

The load is l̃(t) = l̃₀ + t l̃₁. The filled graph of b̂ of the law is a polygonal line in the
(s, ξ/c) plane. With K kinks it has the pieces 0 … 2K in the order in which the line runs from
s = −∞ to s = +∞: piece 2k is the segment between kink k−1 and kink k, piece 2k+1 the vertical side
at kink k (absent where b only bends). On a segment the coordinate that moves is s, on a vertical
side it is ξ/c.

Where nodes have different laws (tcstudy/laws) the pieces of all of them are numbered through, law
after law. So a piece's code tells its law, and whatever is asked by code needs no law.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from enum import Enum
from functools import cached_property
from typing import Any

import numpy as np
import scipy.linalg
from numpy.typing import ArrayLike, NDArray

from tcstudy.contact.problem import SOFT, CondensedBody, ContactProblem, is_singular
from tcstudy.laws.laws import Laws
from tcstudy.laws.pieces import BEND, DOWN

Array = NDArray[np.float64]
Index = NDArray[np.intp]
Codes = NDArray[np.int32]


@dataclass(frozen=True)
class ParametricProblem:
    """The problem Ãv + ξ = l̃₀ + t l̃₁ with ξ_i/c_i ∈ b̂(v_i), for all t at once.

    A_tilde: (m, m) symmetric positive definite, condensed stiffness [Pa]
    l_0:     (m,) load at t = 0 [N/m]
    l_1:     (m,) load per unit of t [N/m per unit of t], not zero
    c:       (m,) segment lengths > 0 [m]
    law:     friction law b [Pa] of the slip [m], or the laws of the nodes (tcstudy/laws)
    span:    two values of t whose loads are the scale of residuals where the law has none
    A_error: as in `ContactProblem`
    loose:   Ã is only semidefinite: the body has a rigid motion, which friction alone resists
    blocks:  as in `CondensedBody`

    t is anything the load is affine in: a load factor, θ̄, the strength of a source, the share of a
    load step.
    """

    A_tilde: Array
    l_0: Array
    l_1: Array
    c: Array
    law: Laws
    span: tuple[float, float] = (0.0, 1.0)
    A_error: float = 0.0
    loose: bool = False
    blocks: tuple[int, ...] = ()

    @property
    def m(self) -> int:
        """Number of contact DOFs."""
        return len(self.c)

    @cached_property
    def traction_scale(self) -> float:
        """Scale of b for the whole path, that of the problems at both ends of `span` [Pa]."""
        scale = max(self.at(t).traction_scale for t in self.span)
        return scale or float(np.max(np.abs(self.l_1 / self.c)))

    def xi_rounding(self, t: float, v: Array) -> float:
        """Return what rounding of v, t, l̃₀ and l̃₁ does to a residual (ContactProblem).

        Relative to `traction_scale`.
        """
        load_size = np.abs(self.l_0) + abs(t) * np.abs(self.l_1)
        return self.at(t).rounding(v, load_size) / self.traction_scale

    def load(self, t: float) -> Array:
        """Return l̃(t) (m,)."""
        return self.l_0 + t * self.l_1

    def at(self, t: float) -> ContactProblem:
        """Return the problem of one t."""
        if self.loose:
            return ContactProblem.on(self._condensed(0.0), self.load(t), self.law)
        return ContactProblem(
            self.A_tilde, self.load(t), self.c, self.law, self.A_error, self.blocks
        )

    def _condensed(self, lambda_1: float) -> CondensedBody:
        """Return the record of the body, with λ₁ known [Pa/m]."""
        loose = True if self.loose else None
        return CondensedBody.known(
            self.A_tilde,
            self.c,
            self.A_error,
            self.blocks,
            lambda_1=lambda_1,
            loose=loose,
        )

    def rows(self, t: Array, lambda_1: float) -> ContactProblem:
        """Return the problems of many t (n,), with λ₁ known [Pa/m]."""
        body = self._condensed(lambda_1)
        index = np.atleast_2d(self.law.index)
        laws = self.law.tables.at(np.broadcast_to(index, (len(t), index.shape[1])))
        return ContactProblem.on(body, self.l_0 + t[:, None] * self.l_1, laws)

    def energy(self, t: Array, u: Array, traction: Array) -> Array:
        """Return (k,) L̃ of solutions u (k, m) with tractions ξ/c (k, m) at t (k,) [J/m]."""
        load = self.l_0 + t[:, None] * self.l_1
        force = load - traction * self.c  # = Ãu up to the residual
        return np.asarray(np.sum((0.5 * force - load) * u, axis=1) + self.law.j(u) @ self.c)

    def with_law(self, law: Laws) -> ParametricProblem:
        """Return the problem of the same body and loads under another law."""
        return replace(self, law=law)

    @property
    def without_narrow_pieces(self) -> ParametricProblem:
        """The same problem with pieces a few roundings wide as jumps.

        Slips do not resolve such a piece, while the traction moves along a jump as along any piece.
        """
        law = self.law.without_narrow_pieces
        return self if law is self.law else self.with_law(law)

    @cached_property
    def body(self) -> ScaledBody:
        """Ã in working units; raises ValueError if it is not positive definite."""
        return ScaledBody.of(self.A_tilde, held=not self.loose)

    @cached_property
    def graph(self) -> LawGraph:
        """The law's pieces by their codes; raises ValueError for exponential pieces."""
        return law_graph(self.law)


@dataclass(frozen=True)
class ScaledBody:
    """A stiffness in units of its mean diagonal.

    stiffness: mean diagonal of Ã [Pa]
    A:         Ã divided by it
    blur:      approximate rounding error of a displacement relative to the largest one: ε √m times
               a condition number of Ã
    """

    stiffness: float
    A: Array
    blur: float

    @classmethod
    def of(cls, A_tilde: Array, held: bool = True) -> ScaledBody:
        """Scale a stiffness.

        held: False for a body with rigid-body modes; its compliance is that with its first node
              constrained, or with stiffness along the modes where there are several
        Raises ValueError if Ã is not positive definite.
        """
        m = len(A_tilde)
        stiffness = float(np.mean(np.diagonal(A_tilde)))
        A = np.asfortranarray(A_tilde / stiffness)
        definite = A if held else A[1:, 1:]
        factor, info = scipy.linalg.lapack.dpotrf(definite, lower=1, clean=0)
        if not held and (info != 0 or is_singular(definite)):
            eigenvalues, vectors = scipy.linalg.eigh(A)
            modes = vectors[:, eigenvalues <= SOFT * eigenvalues[-1]]
            definite = np.asfortranarray(A + modes @ modes.T)
            factor, info = scipy.linalg.lapack.dpotrf(definite, lower=1, clean=0)
        if info != 0 or not stiffness > 0.0:
            raise ValueError(
                "the condensed stiffness is not positive definite; "
                "clamp the body, check its elastic constants"
            )
        n = len(definite)
        # sixteen columns of the compliance stand for all
        probes = np.unique(np.linspace(0, n - 1, 16).astype(int))
        columns = scipy.linalg.lapack.dpotrs(factor, np.eye(n)[:, probes], lower=1)[0]
        condition = np.max(np.abs(columns), initial=0.0) * np.linalg.norm(A, np.inf)
        return cls(stiffness, A, float(np.sqrt(m) * np.finfo(float).eps * condition))


@dataclass(frozen=True)
class LawGraph:
    """Pieces of the law's graph as arrays over the piece code (2K+1,), law after law.

    free:       True on a segment, False on a vertical side
    low, high:  bounds of the moving coordinate (s [m] on a segment, ξ/c [Pa] on a vertical side)
    sense:      sign of the moving coordinate's change along the line: −1 on the side of a
                down-jump, else +1
    after_low, after_high: code of the piece that follows at either bound, −1 at an infinite one
    slope, anchor, start: b = start + slope·(s − anchor) on a segment; 0 on a vertical side
                [Pa/m, m, Pa]
    kink:       s of a vertical side, 0 on a segment [m]
    is_reversible: True on the segments of a one-sided law that begin or end at 0 with b = 0, which
                an opening takes both ways
    first:      code of the first piece of every node's law (m,), or of the only law (1,)
    """

    free: NDArray[np.bool_]
    low: Array
    high: Array
    sense: NDArray[np.int8]
    after_low: Codes
    after_high: Codes
    slope: Array
    anchor: Array
    start: Array
    kink: Array
    is_reversible: NDArray[np.bool_]
    first: Codes

    @cached_property
    def outward(self) -> Array:
        """Sense in which |s| grows on a segment that lies on one side of 0, else 0."""
        sense = np.where(self.low >= 0.0, 1.0, np.where(self.high <= 0.0, -1.0, 0.0))
        return np.asarray(self.free * ~self.is_reversible * sense)


def law_graph(law: Laws) -> LawGraph:
    """Return the graph of a piecewise-linear law, or of the laws of nodes.

    All laws have as many codes as the one with most kinks; nothing leads to those that a law does
    not need. Raises ValueError for exponential pieces.
    """
    if not law.piecewise_linear:
        raise ValueError(
            f"the law {law.name} is not piecewise linear; replace it first by "
            "piecewise_linear(law, …) of tcstudy.laws.composed"
        )
    table = law.tables
    laws, count = table.kinks.shape
    codes = np.arange(laws * (2 * count + 1), dtype=np.int32).reshape(laws, -1)

    def by_code(segments: ArrayLike, sides: ArrayLike) -> NDArray[Any]:
        """Return values by code, from those of segments and of vertical sides."""
        values = np.empty((laws, 2 * count + 1), dtype=np.result_type(segments, sides))
        values[:, 0::2] = segments
        values[:, 1::2] = sides
        return values.ravel()

    is_kink = np.isfinite(table.kinks)
    bends = is_kink & (table.kinds == BEND)
    left_code = codes - 1
    right_code = codes + 1
    right_code[:, :-1:2] += bends  # a segment is followed by the next one where b only bends
    left_code[:, 2::2] -= bends
    last_segment = 2 * np.count_nonzero(is_kink, axis=1)
    right_code[np.arange(laws), last_segment] = -1
    left_code[:, 0] = -1

    is_down = by_code(False, table.kinds == DOWN)
    s_0, b_0, q = table.pieces[:3]
    return LawGraph(
        free=by_code(True, False),
        low=by_code(table.lower, np.minimum(table.b_left, table.b_right)),
        high=by_code(table.upper, np.maximum(table.b_left, table.b_right)),
        sense=np.where(is_down, -1, 1).astype(np.int8),
        after_low=np.where(is_down, right_code.ravel(), left_code.ravel()),
        after_high=np.where(is_down, left_code.ravel(), right_code.ravel()),
        slope=by_code(q, 0.0),
        anchor=by_code(s_0, 0.0),
        start=by_code(b_0, 0.0),
        kink=by_code(0.0, np.where(is_kink, table.kinks, 0.0)),
        is_reversible=by_code(_through_zero(table), False),
        first=codes[:1, 0] if law.one else codes[law.index, 0],
    )


def _through_zero(tables: Laws) -> NDArray[np.bool_]:
    """Return (L, K + 1) pieces with b = 0 at the first kink, where that is at 0.

    They are those of openings: an odd law has as many kinks below 0, or jumps at it.
    """
    is_at_zero = tables.kinks[:, 0] == 0.0
    pieces = np.zeros(tables.q.shape, dtype=bool)
    pieces[:, 0] = is_at_zero & (tables.b_left[:, 0] == 0.0)
    pieces[:, 1] = is_at_zero & (tables.b_right[:, 0] == 0.0)
    return pieces


class PathStatus(Enum):
    """Reasons why a path was not followed further, as sentences for the user."""

    RANGE_END = "the parameter reached the end of the range that the path may use"
    CLOSED_LOOP = "the path is a closed branch and returned to its start"
    UNBOUNDED = "the last segment is unbounded: no node changes its segment any more"
    PIECE_LIMIT = (
        "the limit on the number of segments was reached; raise max_pieces to follow it further"
    )
    UNSTABLE = "the stable branch ends here"
    TURNED_BACK = (
        "the path returned to a segment that it had passed: branches meet at a bifurcation; "
        "start again from another solution to follow the others"
    )
    SINGULAR = (
        "no unique way leads on from here (a bifurcation, or a solution that no others join); "
        "start again from another solution"
    )
    LOST_ACCURACY = (
        "rounding left a residual above the tolerance even after a fresh factorisation; "
        "the problem is too badly conditioned for it, raise the tolerance or check the units"
    )
    START = "the path was followed from here in one direction only"
    TURNS = "a node reverses its slip here"

    @property
    def reason(self) -> str:
        return self.value


WHOLE = (PathStatus.RANGE_END, PathStatus.UNBOUNDED, PathStatus.CLOSED_LOOP, PathStatus.START)
"""Ends of a path that is whole: there is nothing more to follow."""


@dataclass(frozen=True)
class Path:
    """A piecewise-linear path of solutions of Ãu + ξ = l̃₀ + t l̃₁, in the order of travel.

    problem:     the problem that was followed
    t:           (k,) parameter at the vertices
    u:           (k, m) displacements [m]
    traction:    (k, m) ξ/c [Pa], on the graph of b̂
    residual:    (k,) max_i |l̃ − Ãu − ξ|_i/c_i, relative to the scale of b
    stable:      (k−1,) per piece: strict local minimum of L̃ in its interior
    codes:       (k−1, m) code of every node on every piece
    start:       vertex from which the path was followed
    begin, end:  reasons why it stops at the first and at the last vertex
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
        """Return the path that ends at a solution from which no straight piece leads on."""
        force = (problem.load(t) - problem.A_tilde @ u) / problem.c
        traction = np.clip(force, *problem.law.interval(u))
        return cls(
            problem=problem,
            t=np.array([t]),
            u=u[None],
            traction=traction[None],
            residual=np.array([np.max(np.abs(force - traction)) / problem.traction_scale]),
            stable=np.zeros(0, dtype=bool),
            codes=np.zeros((0, len(u)), dtype=np.int32),
            start=0,
            begin=end,
            end=end,
        )

    @property
    def pieces(self) -> int:
        """Number of pieces."""
        return len(self.stable)

    @cached_property
    def slipping(self) -> NDArray[np.bool_]:
        """(k−1, m) True where a node is on a segment of b, False where on a vertical side."""
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
        """Return (row, time) of a coordinate row·u + time·t along a piece.

        It measures the slips, or t where all nodes rest.
        """
        slips = self.u[side + 1] - self.u[side]
        length = float(np.max(np.abs(slips)))
        if length == 0.0:
            return np.zeros(len(slips)), float(np.sign(self.t[side + 1] - self.t[side]))
        return slips / length, 0.0

    @cached_property
    def folds(self) -> Index:
        """Vertices at which t turns.

        A piece along which t stands still belongs to the fold before it.
        """
        direction = np.sign(np.diff(self.t))
        moving = np.flatnonzero(direction)
        turns = np.flatnonzero(direction[moving][1:] != direction[moving][:-1])
        return moving[turns] + 1
