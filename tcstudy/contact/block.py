"""Solve and certify P contact problems on one condensed body at once.

Problems:  0 ∈ Ãv − l̃_p + ∂Ψ_p(v), Ψ_p(v) = Σ c_i j_p(v_i), p = 1..P with one Ã and c, own loads and laws
Order:     1. unique or not, before any solution;
           2. one descent of every point, nested over the coarse copies of the body that all points share;
           3. what is not unique: the certificate of a global minimum;
           4. what has neither: the search for less energy (neighbours, frictionless start, hulls, moves of nodes);
           5. what is not solved yet: the plain starts, zero and the frictionless solution, on the body itself.
A block's numbers depend on its own points and their order only, not on what else is solved where.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tcstudy.contact.active_set import Judged, finish, judge, refined
from tcstudy.contact.bounds import least_slopes
from tcstudy.contact.certificates import (
    definite,
    global_minimum,
    margins,
    solution_boxes,
    strict_minimum,
)
from tcstudy.contact.descent import TOLERANCE, Descended, descend, descend_nested, hull_starts, move_starts
from tcstudy.contact.loop import Status
from tcstudy.contact.problem import MARGIN, CondensedBody, ContactProblem, kept
from tcstudy.laws.laws import Laws
from tcstudy.scene.study import ESCAPE, EXACT, FRICTIONLESS, NEIGHBOUR, START_NAMES, ZERO, Acceptance, Branch

Array = NDArray[np.float64]
Index = NDArray[np.intp]
Flags = NDArray[np.bool_]

TIE = 1e-12
"""Relative difference of energies up to which two answers count as equally low; the earlier start then wins."""
MOVES = 20
"""Moves of single nodes at most (trials needed two)."""
FAR = 100.0
"""Multiples of the rounding of ξ up to which a residual that is too large is put down to it."""
NOT_POSITIVE_DEFINITE = (
    "the condensed stiffness is not positive definite; the body can move freely (clamp it) or its elastic "
    "constants are wrong"
)


@dataclass(frozen=True, eq=False)
class Certificates:
    """What is proved about P points, (P,) each; the meaning is that of tcstudy.contact.certificates.Certificate.

    margin: NaN with one law a row, where it is λ₁ − ω [Pa/m]
    """

    omega: Array
    convex: Flags
    unique: Flags
    strict_minimum: Flags
    global_minimum: Flags
    margin: Array


@dataclass(frozen=True, eq=False)
class BlockAnswers:
    """Judged solutions of P points: fields (P,), (P, m) or (P, 5) with the meaning of tcstudy.contact.contact.Answer.

    steps: Newton steps on the body itself of the descent that led to v, or of the single solve
    certificates: what is proved
    """

    v: Array
    v_low: Array
    xi: Array
    inclusion_residual: Array
    rounding: Array
    limited: Flags
    energy: Array
    status: NDArray[np.int8]
    reasons: tuple[str, ...]
    start: NDArray[np.int8]
    start_energies: Array
    steps: NDArray[np.intp]
    certificates: Certificates


@dataclass(frozen=True)
class Options:
    """What is asked of a block.

    branch:    as in tcstudy.contact.contact.solve_contact
    tolerance: largest inclusion residual of a solution as a study writes it; None for the default of
               tcstudy/scene/study.py
    """

    branch: Branch = "lowest"
    tolerance: float | None = None

    @property
    def acceptance(self) -> Acceptance:
        """The test of an inclusion residual."""
        return Acceptance(self.tolerance)


def solve_block(
    body: CondensedBody,
    loads: Array,
    laws: Laws,
    options: Options | None = None,
    neighbours: Array | None = None,
    exact: Array | None = None,
    prove: bool = True,
) -> BlockAnswers:
    """Solve and certify P points.

    loads:      (P, m) l̃ of every point [N/m]
    laws:       the law of every row, or of every node
    neighbours: (P, m) solutions of neighbouring points for branch "continued", NaN in rows without one [m]
    exact:      (m,) the exact solution at the contact nodes, where it is known, for branch "lowest" [m]
    prove:      False if only the solutions are wanted, with no more proofs than the search for them needs
    """
    block = _Block(ContactProblem.on(body, np.asarray(loads, dtype=float), laws), options or Options(), neighbours)
    lowest = block.options.branch == "lowest"
    if prove or lowest:
        block.prove_unique()
    block.descend()
    if prove or lowest:
        block.certify(np.flatnonzero(~block.unique))
    if lowest:
        block.search(np.flatnonzero(~block.unique & ~block.lowest))
    block.begin_elsewhere()
    if prove:
        block.prove_strict(np.arange(len(block.v)))
    if exact is not None and block.options.branch == "lowest":
        block.begin_at(exact)
    return block.answers()


class _Block:
    """The points of a block on their way to answers."""

    def __init__(self, rows: ContactProblem, options: Options, neighbours: Array | None) -> None:
        count, m = rows.l_tilde.shape
        self.rows, self.options = rows, options
        self.neighbours = np.full((count, m), np.nan) if neighbours is None else neighbours
        self.v, self.energy = np.zeros((count, m)), np.full(count, np.inf)
        self.solved = np.zeros(count, dtype=bool)
        self.start, self.energies = np.zeros(count, dtype=np.int8), np.full((count, len(START_NAMES)), np.nan)
        self.steps = np.zeros(count, dtype=np.intp)
        self.omega = rows.law.omega_by_row
        self.smooth = ContactProblem.on(rows.body, rows.l_tilde, rows.law.without_narrow_pieces)
        self.convex = self.omega < (1.0 - MARGIN) * kept(rows.body.A_error) * rows.body.lambda_1
        self.margin = np.full(count, np.nan)
        if rows.law.index.shape[1] > 1 and not rows.body.loose:
            self.margin = margins(rows)
            self.convex |= self.margin > rows.body.shift
        self.unique = self.convex.copy()
        self.low, self.high = np.zeros((count, m)), np.zeros((count, m))
        self.lowest, self.strict = np.zeros(count, dtype=bool), np.zeros(count, dtype=bool)

    def prove_unique(self) -> None:
        """Boxes of all solutions, and what is convex on them."""
        open_, body = np.flatnonzero(~self.convex), self.rows.body
        if body.loose or not len(open_):
            return
        rows = self.rows.take(open_)
        self.low[open_], self.high[open_] = low, high = solution_boxes(rows)
        self.unique[open_] = definite(rows.body, least_slopes(rows.law, rows.law.index, low, high))

    def descend(self) -> None:
        """The first descent: from the neighbour where the branch is continued, else from zero.

        A neighbour that is a solution is not moved at all: a descent would leave one that is no minimum.
        """
        continued = self.options.branch == "continued"
        known = np.all(np.isfinite(self.neighbours), axis=1) & continued
        near, far = np.flatnonzero(known), np.flatnonzero(~known)
        if len(near):
            v = self.neighbours[near]
            residual = judge(self.rows.take(near), v, self.options.acceptance).residual
            ended = Descended(v.copy(), residual, np.zeros(len(near), dtype=np.intp))
            moved = np.flatnonzero(~(residual <= self.options.acceptance.aim))
            open_ = near[moved]
            found = descend(self.smooth.take(open_), v[moved], self.aim, minima=True)
            ended.v[moved], ended.residual[moved], ended.steps[moved] = found.v, found.residual, found.steps
            self.offer(near, ended, NEIGHBOUR)
        zero, minima = np.zeros((len(far), self.rows.body.m)), self.options.branch != "lowest"
        self.offer(far, descend_nested(self.smooth.take(far), zero, self.aim, minima), ZERO)

    @property
    def aim(self) -> float:
        """The residual that descents aim at."""
        return min(TOLERANCE, self.options.acceptance.aim)

    def offer(self, points: Index, ended: Descended, start: int) -> Flags:
        """Keep the ends of descents of different points that have less energy; whether each has (n,)."""
        rows, energy = self.rows.take(points), self.rows.take(points).energy(ended.v)
        accepted = ended.residual <= self.options.acceptance.aim
        doubtful = np.flatnonzero(~accepted)
        if len(doubtful):
            accepted[doubtful] = judge(rows.take(doubtful), ended.v[doubtful], self.options.acceptance).accepted
        found = self.energies[points, start]
        self.energies[points, start] = np.where(accepted, np.fmin(found, energy), found)
        known = np.isfinite(self.energy[points])
        slack = TIE * np.maximum(np.abs(energy), np.abs(np.where(known, self.energy[points], 0.0)))
        lower = accepted & (~self.solved[points] | (energy < self.energy[points] - slack))
        kept = lower | ~known
        own = points[kept]
        self.v[own], self.energy[own], self.solved[own] = ended.v[kept], energy[kept], accepted[kept]
        self.start[own], self.steps[own] = start, ended.steps[kept]
        return lower

    def certify(self, points: Index) -> None:
        """Prove a global minimum where that is possible."""
        points = points[self.solved[points]]
        if len(points) and not self.rows.body.loose:
            rows = self.rows.take(points)
            self.lowest[points] = global_minimum(rows, self.v[points], self.low[points], self.high[points])

    def prove_strict(self, points: Index) -> None:
        """Prove a strict minimum where that is possible; one that is unique or lowest is one."""
        self.strict[points] = self.solved[points] & (self.unique[points] | self.lowest[points])
        open_ = points[self.solved[points] & ~self.strict[points]]
        self.strict[open_] = strict_minimum(self.rows.take(open_), self.v[open_])

    def search(self, points: Index) -> None:
        """Look for less energy at points of which nothing is proved."""
        if self.rows.body.loose:
            return
        beside = points[np.all(np.isfinite(self.neighbours[points]), axis=1)]
        if len(beside):
            ended = descend(self.smooth.take(beside), self.neighbours[beside], self.aim, minima=True)
            points = np.union1d(np.setdiff1d(points, beside), self.improve(beside, ended, NEIGHBOUR))
        if not len(points):
            return
        points = self.improve(points, descend(self.smooth.take(points), self.v[points], self.aim, minima=True), ZERO)
        rows = self.smooth.take(points)
        frictionless = rows.l_tilde @ rows.body.inverse
        points = self.improve(points, descend_nested(rows, frictionless, self.aim, minima=True), FRICTIONLESS)
        rows = self.smooth.take(points)
        starts, done = hull_starts(rows, self.v[points])
        left = self.improve(points, descend(rows, starts, self.aim, minima=True), ESCAPE)
        self.move(np.setdiff1d(left, points[done]))

    def improve(self, points: Index, ended: Descended, start: int) -> Index:
        """Offer ends of descents, certify what has less energy, and return the points left without proof."""
        self.certify(points[self.offer(points, ended, start)])
        return points[~self.lowest[points]]

    def move(self, points: Index) -> None:
        """Moves of single nodes as long as they lower the energy; the first promise of two that does is kept."""
        points = points[self.solved[points]]
        for _ in range(MOVES):
            if not len(points):
                break
            starts, owner, promise = move_starts(self.smooth.take(points), self.v[points])
            owners = points[owner]
            ended = descend(self.smooth.take(owners), starts, self.aim, minima=True)
            moved = np.zeros(len(self.v), dtype=bool)
            for rank in range(int(np.max(promise, initial=-1)) + 1):
                mine = np.flatnonzero((promise == rank) & ~moved[owners])
                part = Descended(ended.v[mine], ended.residual[mine], ended.steps[mine])
                moved[owners[mine]] |= self.offer(owners[mine], part, ESCAPE)
            points = np.flatnonzero(moved)
            self.certify(points)
            points = points[~self.lowest[points]]

    def begin_elsewhere(self) -> None:
        """What no start has solved from the other plain ones, without coarse copies."""
        body = self.rows.body
        for start in (ZERO,) if body.loose else (ZERO, FRICTIONLESS):
            points = np.flatnonzero(~self.solved)
            if len(points):
                rows = self.smooth.take(points)
                begin = rows.l_tilde @ body.inverse if start == FRICTIONLESS else np.zeros((len(points), body.m))
                self.certify(points[self.offer(points, descend(rows, begin, self.aim, minima=True), start)])

    def begin_at(self, exact: Array) -> None:
        """Newton's method on the pieces that the exact solution is on, as in solve_contact; unique ones are known."""
        only = self.unique & self.solved
        self.energies[only, EXACT] = self.energy[only]
        for p in np.flatnonzero(~only):
            v, residual = finish(self.rows.single(int(p)), exact)
            ended = Descended(v[None], np.array([residual]), np.zeros(1, dtype=np.intp))
            if self.offer(np.array([p]), ended, EXACT)[0]:
                self.certify(np.array([p]))
                self.prove_strict(np.array([p]))

    def answers(self) -> BlockAnswers:
        """Everything judged once more at the points' final v."""
        rows, v, acceptance = self.rows, self.v, self.options.acceptance
        judged = judge(rows, v, acceptance)
        v_low = self._refine(judged)
        missed = Status.NOT_POSITIVE_DEFINITE if rows.body.loose else Status.INCLUSION_VIOLATED
        status = np.where(judged.accepted, Status.CONVERGED, missed)
        reasons = ["" if good else self._failure(judged, p) for p, good in enumerate(judged.accepted)]
        return BlockAnswers(
            v,
            v_low,
            judged.xi,
            judged.residual,
            judged.rounding,
            judged.accepted & (judged.residual > acceptance.aim),
            self.energy,
            status.astype(np.int8),
            tuple(reasons),
            self.start,
            self.energies,
            self.steps,
            self.certificates(judged.accepted),
        )

    def _refine(self, judged: Judged) -> Array:
        """(P, m) low parts of v: refined, in the end on the active pieces, where v in one double misses the aim."""
        v_low, aim = np.zeros(self.v.shape), self.options.acceptance.aim
        for p in np.flatnonzero(judged.residual > aim):
            problem = self.rows.single(int(p))
            point = refined(problem, self.v[p], aim)
            if not point.residual <= aim:
                other = refined(problem, finish(problem, self.v[p])[0], aim)
                point = other if other.residual < point.residual else point
            if point.residual < judged.residual[p]:
                self.v[p], v_low[p], judged.xi[p], judged.residual[p] = point.v, point.v_low, point.xi, point.residual
                judged.rounding[p], self.energy[p] = problem.xi_rounding(point.v), problem.energy(point.v)
                judged.accepted[p] = self.options.acceptance.accepts(point.residual, float(judged.rounding[p]))
                if judged.accepted[p]:
                    self.energies[p, self.start[p]] = self.energy[p]
        return v_low

    def _failure(self, judged: Judged, p: int) -> str:
        """Why a point is no solution."""
        loose = NOT_POSITIVE_DEFINITE if self.rows.body.loose else STALLED
        return failure(float(judged.residual[p]), float(judged.rounding[p]), self.options.acceptance, loose)

    def certificates(self, accepted: Flags) -> Certificates:
        """What is proved about the points, of solutions only beside `convex` and `unique`."""
        lowest = accepted & (self.unique | self.lowest)
        strict = accepted & (self.strict | lowest)
        return Certificates(self.omega, self.convex, self.unique, strict, lowest, self.margin)


STALLED = (
    "no descent leads to a solution; the data span too many orders of magnitude for double precision: check the units, "
    "start from another point, or use another solver"
)


def failure(residual: float, rounding: float, acceptance: Acceptance, otherwise: str) -> str:
    """Why an answer misses the tolerance and what to try; more steps do not help against rounding."""
    limit = acceptance.limit(rounding)
    missed = f"inclusion residual {residual:.1e} above the tolerance {limit:.1e}"
    if limit < residual <= FAR * rounding:
        return (
            f"{missed}; rounding alone leaves about {rounding:.0e} because friction is small against the forces in the "
            "body or elements on the contact line are very thin: raise solver.tolerance, check the units, or coarsen"
        )
    return f"{missed}: {otherwise}"
