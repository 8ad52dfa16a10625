"""Solve and certify P contact problems on one condensed body at once.

Problems:  0 ∈ Ãv − l̃_p + ∂Ψ_p(v), Ψ_p(v) = Σ c_i j_p(v_i), p = 1..P with one Ã and c, own loads and laws
Order:     1. unique or not, before any solution;
           2. one descent of every point, nested over the coarse copies of the body that all points share;
           3. what is not unique: the certificate of a global minimum;
           4. what has neither: the search for less energy (frictionless start, hulls, moves of single nodes);
           5. what still has no proven minimum: the single solve.
The search takes the same steps from the same starts as tcstudy.contact.contact, so that it ends where that ends.
A block's numbers depend on its own points and their order only, not on what else is solved where.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tcstudy.contact.body import BlockAnswers, Certificates, CondensedBody, Judged, Rows, judge
from tcstudy.contact.bounds import least_slopes
from tcstudy.contact.certify import (
    definite,
    global_minimum,
    margins,
    solution_boxes,
    strict_minimum,
)
from tcstudy.contact.contact import TIE, Answer, solve_contact
from tcstudy.contact.descent import TOLERANCE, Descended, descend, descend_nested, hull_starts, move_starts
from tcstudy.contact.loop import Status
from tcstudy.contact.problem import MARGIN, kept
from tcstudy.contact.search import MOVES
from tcstudy.contact.separable.finish import finish, refined
from tcstudy.laws.laws import Laws
from tcstudy.scene.study import ESCAPE, EXACT, FRICTIONLESS, NEIGHBOUR, START_NAMES, ZERO, Acceptance, Branch

Array = NDArray[np.float64]
Index = NDArray[np.intp]
Flags = NDArray[np.bool_]


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
) -> BlockAnswers:
    """Solve and certify P points.

    loads:      (P, m) l̃ of every point [N/m]
    laws:       the law of every row, or of every node
    neighbours: (P, m) solutions of neighbouring points for branch "continued", NaN in rows without one [m]
    exact:      (m,) the exact solution at the contact nodes, where it is known, for branch "lowest" [m]
    """
    block = _Block(Rows(body, laws, np.asarray(loads, dtype=float)), options or Options(), neighbours)
    block.prove_unique()
    block.descend()
    block.certify(np.flatnonzero(~block.unique))
    if block.options.branch == "lowest":
        block.search(np.flatnonzero(~block.unique & ~block.lowest))
    block.solve_singly()
    if exact is not None and block.options.branch == "lowest":
        block.begin_at(exact)
    return block.answers()


class _Block:
    """The points of a block on their way to answers."""

    def __init__(self, rows: Rows, options: Options, neighbours: Array | None) -> None:
        count, m = rows.loads.shape
        self.rows, self.options = rows, options
        self.neighbours = np.full((count, m), np.nan) if neighbours is None else neighbours
        self.v, self.energy = np.zeros((count, m)), np.full(count, np.inf)
        self.solved = np.zeros(count, dtype=bool)
        self.start, self.energies = np.zeros(count, dtype=np.int8), np.full((count, len(START_NAMES)), np.nan)
        self.steps = np.zeros(count, dtype=np.intp)
        self.omega = rows.laws.omega_by_row
        self.convex = self.omega < (1.0 - MARGIN) * kept(rows.body.A_error) * rows.body.lambda_1
        self.margin = np.full(count, np.nan)
        if rows.laws.index.shape[1] > 1:
            self.margin = margins(rows)
            self.convex |= self.margin > rows.body.shift
        self.unique = self.convex.copy()
        self.low, self.high = np.zeros((count, m)), np.zeros((count, m))
        self.lowest, self.strict = np.zeros(count, dtype=bool), np.zeros(count, dtype=bool)
        self.single: dict[int, Answer] = {}

    def prove_unique(self) -> None:
        """Boxes of all solutions, and what is convex on them."""
        open_ = np.flatnonzero(~self.convex)
        rows = self.rows.take(open_)
        self.low[open_], self.high[open_] = low, high = solution_boxes(rows)
        self.unique[open_] = definite(rows.body, least_slopes(rows.laws, rows.laws.index, low, high))

    def descend(self) -> None:
        """The first descent: from the neighbour where the branch is continued, else from zero."""
        known = np.all(np.isfinite(self.neighbours), axis=1) & (self.options.branch == "continued")
        near, far = np.flatnonzero(known), np.flatnonzero(~known)
        self.offer(near, descend(self.rows.take(near), self.neighbours[near], self.aim), NEIGHBOUR)
        self.offer(far, descend_nested(self.rows.take(far), np.zeros((len(far), self.rows.body.m)), self.aim), ZERO)

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
        if len(points):
            rows = self.rows.take(points)
            self.lowest[points] = global_minimum(rows, self.v[points], self.low[points], self.high[points])

    def prove_strict(self, points: Index) -> None:
        """Prove a strict minimum where that is possible; one that is unique or lowest is one."""
        self.strict[points] = self.solved[points] & (self.unique[points] | self.lowest[points])
        open_ = points[self.solved[points] & ~self.strict[points]]
        self.strict[open_] = strict_minimum(self.rows.take(open_), self.v[open_])

    def search(self, points: Index) -> None:
        """Look for less energy at points of which nothing is proved, as contact/search.py does."""
        if not len(points):
            return
        points = self.improve(points, descend(self.rows.take(points), self.v[points], self.aim, minima=True), ZERO)
        rows = self.rows.take(points)
        frictionless = rows.loads @ rows.body.inverse
        points = self.improve(points, descend_nested(rows, frictionless, self.aim, minima=True), FRICTIONLESS)
        rows = self.rows.take(points)
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
            starts, owner, promise = move_starts(self.rows.take(points), self.v[points])
            owners = points[owner]
            ended = descend(self.rows.take(owners), starts, self.aim, minima=True)
            moved = np.zeros(len(self.v), dtype=bool)
            for rank in range(int(np.max(promise, initial=-1)) + 1):
                mine = np.flatnonzero((promise == rank) & ~moved[owners])
                part = Descended(ended.v[mine], ended.residual[mine], ended.steps[mine])
                moved[owners[mine]] |= self.offer(owners[mine], part, ESCAPE)
            points = np.flatnonzero(moved)
            self.certify(points)
            points = points[~self.lowest[points]]

    def solve_singly(self) -> None:
        """Prove strict minima; points without one get the single solve's answer if that is lower."""
        self.prove_strict(np.arange(len(self.v)))
        asked = np.flatnonzero(~self.strict)
        changed = np.array([p for p in asked if self._ask_single(int(p))], dtype=np.intp)
        self.certify(changed[~self.unique[changed]])
        self.prove_strict(changed)

    def begin_at(self, exact: Array) -> None:
        """Newton's method on the pieces that the exact solution is on, as in solve_contact; unique ones are known."""
        only = self.unique & self.solved
        self.energies[only, EXACT] = self.energy[only]
        for p in np.flatnonzero(~only):
            v, residual = finish(self.rows.single(int(p)), exact)
            ended = Descended(v[None], np.array([residual]), np.zeros(1, dtype=np.intp))
            if self.offer(np.array([p]), ended, EXACT)[0]:
                self.single.pop(int(p), None)
                self.certify(np.array([p]))
                self.prove_strict(np.array([p]))

    def _ask_single(self, p: int) -> bool:
        """Solve one point by tcstudy.contact.contact; whether its answer is taken."""
        options = self.options
        near = self.neighbours[p] if np.all(np.isfinite(self.neighbours[p])) else None
        if options.branch == "lowest":
            near = self.v[p] if self.solved[p] else None
        problem = self.rows.single(p)
        answer = solve_contact(problem, tolerance=options.tolerance, branch=options.branch, neighbour=near)
        converged = answer.status == Status.CONVERGED
        if self.solved[p]:
            slack = TIE * max(abs(answer.energy), abs(self.energy[p])) if options.branch == "lowest" else -np.inf
            if not converged or answer.energy >= self.energy[p] - slack:
                return False
        self.single[p] = answer
        self.v[p], self.energy[p], self.solved[p] = answer.v, answer.energy, converged
        self.start[p], self.steps[p] = answer.start, answer.iterations
        self.energies[p] = np.fmin(self.energies[p], answer.energies)
        return converged

    def answers(self) -> BlockAnswers:
        """Everything judged once more at the points' final v; of a single solve its own judgement counts."""
        rows, v = self.rows, self.v
        judged = judge(rows, v, self.options.acceptance)
        v_low = self._refine(judged)
        status = np.where(judged.accepted, Status.CONVERGED, Status.INCLUSION_VIOLATED)
        reasons = ["" if good else _violated(judged, p) for p, good in enumerate(judged.accepted)]
        for p, answer in self.single.items():
            v_low[p], judged.xi[p], judged.residual[p] = answer.v_low, answer.xi, answer.inclusion_residual
            judged.rounding[p], judged.accepted[p] = answer.rounding, answer.status == Status.CONVERGED
            status[p], reasons[p] = answer.status, answer.reason
        return BlockAnswers(
            v,
            v_low,
            judged.xi,
            judged.residual,
            judged.rounding,
            judged.accepted & (judged.residual > self.options.acceptance.aim),
            self.energy,
            status.astype(np.int8),
            tuple(reasons),
            self.start,
            self.energies,
            self.steps,
            self.certificates(judged.accepted),
        )

    def _refine(self, judged: Judged) -> Array:
        """(P, m) low parts of v: refined, as in solve_contact, where a point in one double misses the aim."""
        v_low, rows, aim = np.zeros(self.v.shape), self.rows, self.options.acceptance.aim
        for p in np.flatnonzero(judged.residual > aim):
            if int(p) in self.single:
                continue
            point = refined(rows.single(int(p)), self.v[p], aim)
            if point.residual < judged.residual[p]:
                self.v[p], v_low[p], judged.xi[p], judged.residual[p] = point.v, point.v_low, point.xi, point.residual
                judged.accepted[p] = self.options.acceptance.accepts(point.residual, float(judged.rounding[p]))
        return v_low

    def certificates(self, accepted: Flags) -> Certificates:
        """What is proved about the points, of solutions only beside `convex` and `unique`."""
        lowest = accepted & (self.unique | self.lowest)
        strict = accepted & (self.strict | lowest)
        return Certificates(self.omega, self.convex, self.unique, strict, lowest, self.margin)


def _violated(judged: Judged, p: int) -> str:
    """Why a point that only the block has solved is no solution."""
    return (
        f"inclusion residual {judged.residual[p]:.1e} above the tolerance; rounding alone leaves about "
        f"{judged.rounding[p]:.0e}: check the units, coarsen, or solve the point singly"
    )
