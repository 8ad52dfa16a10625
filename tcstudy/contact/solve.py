"""Solve and certify P contact problems on one condensed body at once.

Problems: 0 ∈ Ãv − l̃_p + ∂Ψ_p(v), Ψ_p(v) = Σ c_i j_p(v_i), p = 1..P
          with one Ã and c; every problem (point) has its loads and laws
Order:    1. unique or not, before any solution;
          2. one descent of every point, nested over the coarse copies of the body that all points
             share;
          3. points that are not unique: the certificate of a global minimum;
          4. points with neither proof: the search for less energy (neighbours, frictionless start,
             envelopes, other nodes);
          5. points that are not solved yet: the plain starts, zero and the frictionless solution,
             on the body itself.
A block's numbers depend on its points and their order only, not on other blocks.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from tcstudy.contact.all_solutions import (
    LAW_ERROR,
    Equilibria,
    all_solutions,
    of_rows,
    polygon_laws,
    with_solution,
)
from tcstudy.contact.boxes import Limits
from tcstudy.contact.certificates import Certificate, Proofs, row_of
from tcstudy.contact.descent import TOLERANCE, descend, descend_nested
from tcstudy.contact.problem import CondensedBody, ContactProblem, Outcome, Status, trusted_share
from tcstudy.contact.search import envelope_starts, move_starts
from tcstudy.contact.solution import Acceptance, is_in_balance, judge, polished
from tcstudy.laws.laws import Laws
from tcstudy.scene.solver_plan import (
    ESCAPE,
    EXACT,
    FRICTIONLESS,
    NEIGHBOUR,
    SEPARABLE,
    SOLVERS,
    START_NAMES,
    ZERO,
    Branch,
)

Array = NDArray[np.float64]
Index = NDArray[np.intp]
Flags = NDArray[np.bool_]

TIE = 1e-12
"""Relative difference of energies up to which two are equal; the earlier start then wins."""
MAX_MOVES = 20
"""Moves of single nodes in a row (trials needed two)."""
MAX_ROUNDINGS = 100.0
"""Multiples of the rounding of ξ up to which a residual that is too large is put down to it."""
ACCURACY = 1e-12
"""Residual that methods work for, whatever larger one is accepted."""
SEMIDEFINITE = 1e-9
"""Part of the largest entry of Ã up to which negative eigenvalues are rounding."""
NOT_POSITIVE_DEFINITE = (
    "the condensed stiffness is not positive definite; the body can move freely (clamp it) or its "
    "elastic constants are wrong"
)
NOT_FINITE = (
    "a load, the stiffness or the law has a value that is not finite; check them, and units that "
    "overflow"
)
STALLED = (
    "no descent leads to a solution; the data span too many orders of magnitude for double "
    "precision: check the units, start from another point, or use another solver"
)
UNFIT = (
    "the pieces of the law on which the method ended do not hold to that accuracy; raise "
    "solver.tolerance or try the other solver"
)


@dataclass(frozen=True, eq=False)
class Answer:
    """A judged solution; of P problems the same with one axis more, (P,), (P, m), (P, 5).

    v, v_low:           (m,) tangential displacements v + v_low [m]; the low part is 0 where one
                        double is enough
    xi:                 (m,) nodal friction forces l̃ − Ã(v + v_low) [N/m]
    inclusion_residual: max_i dist(ξ_i/c_i, b̂(v_i)) / (scale of b), plus the rounding error that it
                        may hide: in exact arithmetic v + v_low has no larger one
    rounding:           residual that rounding of the problem allows, `ContactProblem.xi_rounding`
    limited:            accepted only because rounding allows no better (scene/study.py)
    energy:             L̃(v) [J/m]
    status, reason:     CONVERGED, or why not; reason is empty for a solution
    start:              ZERO, FRICTIONLESS, NEIGHBOUR, ESCAPE or EXACT: the start that led to it
    energies:           (5,) L̃ of the solutions from these starts, in this order; NaN without one
    iterations:         steps on the body itself of the descent that led to v; by bundle-newton of
                        all starts
    evaluations:        the same number; by bundle-newton evaluations of L̃
    certificate:        the proved properties, None if they were not requested
    solutions:          all solutions of each problem, None if these were not requested
    """

    v: Array
    v_low: Array
    xi: Array
    inclusion_residual: Any
    rounding: Any
    limited: Any
    energy: Any
    status: Any
    reason: Any
    start: Any
    energies: Array
    iterations: Any
    evaluations: Any
    certificate: Certificate | None = None
    solutions: Sequence[Equilibria] | None = None

    def row(self, p: int) -> Answer:
        """Return the answer to one of the problems."""
        answer: Answer = row_of(self, p)
        return replace(answer, status=Status(int(answer.status)))


def solve_block(
    body: CondensedBody,
    loads: Array,
    laws: Laws,
    branch: Branch = "lowest",
    tolerance: float | None = None,
    neighbours: Array | None = None,
    exact: Array | None = None,
    limits: Limits | None = None,
    prove: bool = True,
) -> Answer:
    """Solve and certify P points.

    loads:      (P, m) l̃ of every point [N/m]
    laws:       the law of every row, or of every node
    branch, tolerance: as in `solve_contact`
    neighbours: (P, m) solutions of neighbouring points for branch "continued", NaN in rows without
                one [m]
    exact:      (m,) the exact solution at the contact nodes, where it is known, for branch "lowest"
                [m]
    limits:     of the search for all solutions of every point, None if these are not requested.
                Where they are proved to be all, the answer is the one of least energy and certified
                to be. Of exponential laws the search only finds the solutions of their polygon,
                which is another problem
    prove:      False for the solutions alone, with no more proofs than the search for them needs
    """
    rows = ContactProblem.on(body, np.asarray(loads, dtype=float), laws)
    block = SolutionBlock(rows, branch, tolerance, neighbours, prove or branch == "lowest")
    block.descend()
    if branch == "lowest":
        block.search()
    block.begin_elsewhere()
    if exact is not None and branch == "lowest":
        block.begin_at(exact)
    solutions = None
    if limits is not None:
        solutions = of_rows(rows, limits)
        block.take_least(solutions)
    answer = block.answer(prove)
    if solutions is not None:
        solutions = [
            _with_answer(equilibria, rows, answer, row) for row, equilibria in enumerate(solutions)
        ]
    return replace(answer, solutions=solutions)


def _with_answer(
    equilibria: Equilibria, rows: ContactProblem, answer: Answer, row: int
) -> Equilibria:
    """Return the solutions of a row with its answer, where they are not proved to be all.

    Solutions of a polygon that stands for an exponential law are those of another problem.
    """
    is_solved = answer.status[row] == Status.CONVERGED
    if equilibria.complete or equilibria.law_error > 0.0 or not is_solved:
        return equilibria
    return with_solution(equilibria, rows.single(row), answer.v[row])


def known_solutions(
    problem: ContactProblem, limits: Limits | None = None, law_error: float = LAW_ERROR
) -> Equilibria:
    """Return all solutions of a problem, or those known: at least the one that the solver finds.

    Of laws with exponential pieces they are those of their polygon.
    """
    equilibria = all_solutions(problem, limits, law_error)
    if equilibria.complete:
        return equilibria
    rows = problem.rows
    laws = polygon_laws(rows, law_error, problem.lambda_1)
    answer = solve_block(rows.body, rows.l_tilde, laws)
    polygon = ContactProblem.on(rows.body, rows.l_tilde, laws)
    known = _with_answer(replace(equilibria, law_error=0.0), polygon, answer, 0)
    return replace(known, law_error=equilibria.law_error)


class SolutionBlock:
    """The points of a block while they are solved.

    rows, smooth: their problems, and these with laws without narrow pieces
    neighbours:   (P, m) solutions of neighbouring points, NaN in rows without one
    v, energy:    (P, m), (P,) the lowest solution so far, else the first end of a descent
    solved:       (P,) v is accepted
    start, steps: (P,) where the descent that led to v began, and its steps
    energies:     (P, 5) least energy from each start
    aim:          residual to work for
    """

    def __init__(
        self,
        rows: ContactProblem,
        branch: Branch,
        tolerance: float | None = None,
        neighbours: Array | None = None,
        prove: bool = True,
    ) -> None:
        count, m = rows.l_tilde.shape
        self.rows = rows
        self.smooth = ContactProblem.on(rows.body, rows.l_tilde, rows.law.without_narrow_pieces)
        self.branch = branch
        self.acceptance = Acceptance(tolerance)
        self.aim = min(TOLERANCE, self.acceptance.aim)
        self.neighbours = np.full((count, m), np.nan) if neighbours is None else neighbours
        self.v = np.zeros((count, m))
        self.energy = np.full(count, np.inf)
        self.solved = np.zeros(count, dtype=bool)
        self.start = np.zeros(count, dtype=np.int8)
        self.steps = np.zeros(count, dtype=np.intp)
        self.energies = np.full((count, len(START_NAMES)), np.nan)
        self.proofs = Proofs(rows, prove)

    def descend(self) -> None:
        """Run the first descent: from the neighbour where the branch is continued, else from zero.

        A neighbour that is a solution is not moved at all: a descent would leave one that is no
        minimum.
        """
        is_near = np.all(np.isfinite(self.neighbours), axis=1) & (self.branch == "continued")
        near = np.flatnonzero(is_near)
        if len(near):
            v = self.neighbours[near]
            residual = judge(self.rows.take(near), v, self.acceptance).residual
            is_solution = residual <= self.acceptance.aim
            self.offer(near[is_solution], v[is_solution], residual[is_solution], NEIGHBOUR)
            self.begin_from(near[~is_solution], v[~is_solution], NEIGHBOUR)
        far = np.flatnonzero(~is_near)
        zero = np.zeros((len(far), self.rows.body.m))
        self.begin_from(far, zero, ZERO, nested=True, minima=self.branch != "lowest")

    def begin_from(
        self, points: Index, v: Array, start: int, nested: bool = False, minima: bool = True
    ) -> Index:
        """Descend from v (n, m), offer the ends, and return the points without proof."""
        method = descend_nested if nested else descend
        ended = method(self.smooth.take(points), v, self.aim, minima)
        self.offer(points, ended.v, ended.residual, start, ended.steps)
        return self.unproved(points)

    def offer(
        self, points: Index, v: Array, residual: Array, start: int, steps: Index | int = 0
    ) -> Flags:
        """Store and certify ends (n, m) of different points that have less energy.

        Returns (n,) whether each has.
        """
        rows = self.rows.take(points)
        energy = rows.energy(v)
        accepted = residual <= self.acceptance.aim
        if rows.body.loose:
            accepted &= is_in_balance(rows, v, rows.xi_rounding(v))
        doubtful = np.flatnonzero(~accepted)
        if len(doubtful):
            judged = judge(rows.take(doubtful), v[doubtful], self.acceptance)
            accepted[doubtful] = judged.accepted
        from_start = self.energies[points, start]
        lowest = np.where(accepted, np.fmin(from_start, energy), from_start)
        self.energies[points, start] = lowest
        stored = self.energy[points]
        is_stored = np.isfinite(stored)
        size = np.maximum(np.abs(energy), np.abs(np.where(is_stored, stored, 0.0)))
        lower = accepted & (~self.solved[points] | (energy < stored - TIE * size))
        taken = lower | ~is_stored
        changed = points[taken]
        self.v[changed] = v[taken]
        self.energy[changed] = energy[taken]
        self.solved[changed] = accepted[taken]
        self.start[changed] = start
        self.steps[changed] = np.broadcast_to(steps, len(points))[taken]
        self.proofs.prove_lowest(points[lower], self.v)
        return lower

    def unproved(self, points: Index) -> Index:
        """Return the points whose solution is not proved to be the global minimum."""
        return points[~(self.proofs.unique | self.proofs.lowest)[points]]

    def search(self) -> None:
        """Look for less energy at points without a proof."""
        points = self.unproved(np.arange(len(self.v)))
        is_loose = self.rows.body.loose
        if is_loose and not self.rows.law.has_rays:
            return
        if is_loose:  # where nothing resists a motion there is no least energy
            is_bounded = [not _moved_away(self.rows.single(p)) for p in points.tolist()]
            points = points[is_bounded]
        beside = points[np.all(np.isfinite(self.neighbours[points]), axis=1)]
        if len(beside):
            unproved = self.begin_from(beside, self.neighbours[beside], NEIGHBOUR)
            points = np.union1d(np.setdiff1d(points, beside), unproved)
        if not len(points):
            return
        points = self.begin_from(points, self.v[points], ZERO)
        if not is_loose:
            frictionless = self.rows.l_tilde[points] @ self.rows.body.inverse
            points = self.begin_from(points, frictionless, FRICTIONLESS, nested=True)
        starts, is_done = envelope_starts(self.smooth.take(points), self.v[points])
        unproved = self.begin_from(points, starts, ESCAPE)
        self.move(np.setdiff1d(unproved, points[is_done]))

    def move(self, points: Index) -> None:
        """Move single nodes as long as that lowers the energy.

        Of two promising moves of a point the first that lowers it is taken.
        """
        points = points[self.solved[points]]
        for _ in range(MAX_MOVES):
            if not len(points):
                break
            starts, row, rank = move_starts(self.smooth.take(points), self.v[points])
            point = points[row]
            ended = descend(self.smooth.take(point), starts, self.aim, minima=True)
            has_moved = np.zeros(len(self.v), dtype=bool)
            for k in range(int(np.max(rank, initial=-1)) + 1):
                tried = np.flatnonzero((rank == k) & ~has_moved[point])
                v, residual, steps = ended.v[tried], ended.residual[tried], ended.steps[tried]
                has_moved[point[tried]] |= self.offer(point[tried], v, residual, ESCAPE, steps)
            points = self.unproved(np.flatnonzero(has_moved))

    def begin_elsewhere(self) -> None:
        """Start unsolved points from zero and the frictionless solution, without coarse copies."""
        body = self.rows.body
        points = np.flatnonzero(~self.solved)
        if len(points):
            self.begin_from(points, 0.0 * self.rows.l_tilde[points], ZERO)
        points = np.flatnonzero(~self.solved)
        if len(points) and not body.loose:
            self.begin_from(points, self.rows.l_tilde[points] @ body.inverse, FRICTIONLESS)

    def begin_at(self, exact: Array) -> None:
        """Run Newton's method on the pieces that the exact solution is on.

        Unique solutions are known already.
        """
        is_unique = self.solved & self.proofs.unique
        self.energies[is_unique, EXACT] = self.energy[is_unique]
        for p in np.flatnonzero(~is_unique):
            end = polished(self.rows.single(int(p)), exact, exact=False)
            residual = np.array([end.residual])
            self.offer(np.array([p]), end.v[None], residual, EXACT)

    def take_least(self, solutions: Sequence[Equilibria]) -> None:
        """Take the least solution of every point where all solutions are known.

        They must be proved to be all of the law itself.
        """
        can_prove = trusted_share(self.rows.body.A_error) == 1.0
        count = np.array([len(equilibria) for equilibria in solutions], dtype=np.intp)
        least = np.full(len(solutions), np.inf)
        proved = np.zeros(len(solutions), dtype=bool)
        for p, equilibria in enumerate(solutions):
            proved[p] = can_prove and equilibria.complete and not equilibria.law_error
            if len(equilibria):
                least[p] = equilibria.energy[0]
        higher = self.energy > least + TIE * np.maximum(np.abs(least), np.abs(self.energy))
        changed = np.flatnonzero(proved & (~self.solved | higher))
        if len(changed):
            v = np.array([solutions[p].v[0] for p in changed.tolist()])
            residual = judge(self.rows.take(changed), v, self.acceptance).residual
            proved[changed] = self.offer(changed, v, residual, ESCAPE)
        self.proofs.lowest |= proved
        self.proofs.unique |= proved & (count == 1)

    def answer(self, prove: bool, failed: Shortfall | None = None) -> Answer:
        """Judge all points once more at their final v and return the answer.

        failed: status and reason of points that are no solutions
        """
        rows = self.rows
        judged = judge(rows, self.v, self.acceptance, refine=True)
        differs = np.any(judged.v != self.v, axis=1)
        if np.any(differs):
            refined = np.flatnonzero(differs)
            self.energy[refined] = rows.take(refined).energy(judged.v[refined])
            solved = np.flatnonzero(differs & judged.accepted)
            self.energies[solved, self.start[solved]] = self.energy[solved]
        if failed is None and rows.body.loose:
            failed = Shortfall(Status.NOT_POSITIVE_DEFINITE, NOT_POSITIVE_DEFINITE)
        elif failed is None:
            failed = Shortfall(Status.INCLUSION_VIOLATED, STALLED)
        reasons = []
        status = np.where(judged.accepted, Status.CONVERGED, failed.status).astype(np.int8)
        for p, is_accepted in enumerate(judged.accepted.tolist()):
            reason = "" if is_accepted or not rows.body.loose else _moved_away(rows.single(p))
            if reason:
                status[p] = Status.UNBOUNDED
            elif not is_accepted:
                residual, rounding = float(judged.residual[p]), float(judged.rounding[p])
                reason = failure(residual, rounding, self.acceptance, failed.reason)
            reasons.append(reason)
        certificate = None
        if prove:
            certificate = self.proofs.certificate(judged.v, judged.residual, judged.accepted)
        return Answer(
            v=judged.v,
            v_low=judged.v_low,
            xi=judged.xi,
            inclusion_residual=judged.residual,
            rounding=judged.rounding,
            limited=judged.accepted & (judged.residual > self.acceptance.aim),
            energy=self.energy,
            status=status,
            reason=tuple(reasons),
            start=self.start,
            energies=self.energies,
            iterations=self.steps,
            evaluations=self.steps,
            certificate=certificate,
        )


def _moved_away(problem: ContactProblem) -> str:
    """Return in one sentence how the load moves a loose body away, "" if it does not."""
    from tcstudy.contact.loose_body import LooseBody

    motions = LooseBody(problem)
    motion = motions.unresisted()
    return "" if motion is None else motions.reason(motion)


class Shortfall(NamedTuple):
    """Status and reason of a run that finds no solution."""

    status: Status
    reason: str


def failure(residual: float, rounding: float, acceptance: Acceptance, otherwise: str) -> str:
    """Return why an answer misses the tolerance and what to try.

    More steps do not help against rounding.

    otherwise: reason if rounding is not to blame
    """
    limit = acceptance.limit(rounding)
    missed = f"inclusion residual {residual:.1e} above the tolerance {limit:.1e}"
    if limit < residual <= MAX_ROUNDINGS * rounding:
        return (
            f"{missed}; rounding alone leaves about {rounding:.0e} because friction is small "
            "against the forces in the body or elements on the contact line are very thin: raise "
            "solver.tolerance, check the units, or coarsen"
        )
    return f"{missed}: {otherwise}"


def solve_contact(
    problem: ContactProblem,
    solver: str = SEPARABLE,
    tolerance: float | None = None,
    max_iterations: int | None = None,
    branch: Branch = "lowest",
    neighbour: Array | None = None,
    exact: Array | None = None,
) -> Answer:
    """Find v with 0 ∈ Ãv − l̃ + ∂Ψ(v) and an inclusion residual that is accepted.

    An answer that misses the tolerance is solved again to higher accuracy, in the end with v as a
    sum of two doubles. One that still misses it is returned as failed, with its residual. Raises
    ValueError for an unknown solver.

    tolerance:      largest inclusion residual, strict; None for 1e-10 or the residual that rounding
                    allows (scene/study.py)
    max_iterations: steps of bundle-newton, None for its default; separable-newton has a fixed limit
    branch:         the solution to prefer, see below
    neighbour:      (m,) a solution of a neighbouring problem, if there is one
    exact:          (m,) the exact solution at the contact nodes, where it is known; its branch may
                    be a saddle

    "lowest" is the lowest of the solutions found from zero, from the frictionless solution, from
    the neighbour, beside the exact one and by the escape phase. The escape phase is left out if the
    best of the others seems global, and by bundle-newton. "continued" goes from the neighbour,
    without leaving its basin on purpose, and does not move at all if that is a solution.
    "from-zero" goes from zero. These two try zero, the frictionless solution and the neighbour,
    too, but only where theirs fails.
    """
    if solver not in SOLVERS:
        raise ValueError(f"unknown solver {solver!r}; use one of {', '.join(SOLVERS)}")
    if problem.m == 0:
        return unsolved(problem, Status.CONVERGED, "", 0.0)
    near = None if neighbour is None else np.asarray(neighbour, dtype=float)
    if solver != SEPARABLE:
        return _by_bundle(problem, Acceptance(tolerance), max_iterations, branch, near, exact)
    arrays = (problem.A_tilde, problem.l_tilde, problem.c)
    if not all(np.all(np.isfinite(numbers)) for numbers in arrays):
        return unsolved(problem, Status.NOT_FINITE, NOT_FINITE, np.nan)
    rows = problem.rows
    if rows.body.loose:
        eigenvalues = np.linalg.eigvalsh(problem.A_tilde)
        if eigenvalues[0] < -SEMIDEFINITE * np.max(np.abs(problem.A_tilde)):
            return unsolved(problem, Status.NOT_POSITIVE_DEFINITE, NOT_POSITIVE_DEFINITE, 0.0)
    answer = solve_block(
        rows.body,
        rows.l_tilde,
        rows.law,
        branch,
        tolerance,
        neighbours=None if near is None else near[None],
        exact=exact,
        prove=False,
    )
    return answer.row(0)


def unsolved(problem: ContactProblem, status: Status, reason: str, energy: float) -> Answer:
    """Return the answer to a problem without nodes, or to one that cannot be solved."""
    v = np.full(problem.m, 0.0 * energy)
    return Answer(
        v=v,
        v_low=0.0 * v,
        xi=0.0 * v,
        inclusion_residual=0.0 if status == Status.CONVERGED else np.inf,
        rounding=0.0,
        limited=False,
        energy=energy,
        status=status,
        reason=reason,
        start=ZERO,
        energies=np.full(len(START_NAMES), np.nan),
        iterations=0,
        evaluations=0,
    )


def nearest_minimum(
    problem: ContactProblem, v: Array, tolerance: float, over_barriers: bool = True
) -> tuple[Array, int]:
    """Return the minimum to which descent leads from v (m,), and its steps.

    over_barriers: False only for laws of straight pieces
    """
    downhill = not over_barriers
    ended = descend(problem.rows, v[None].copy(), tolerance, minima=True, downhill=downhill)
    return ended.v[0], int(ended.steps[0])


def as_it_is(problem: ContactProblem, v: Array, tolerance: float | None = None) -> Answer | None:
    """Return the answer of `solve_contact` that starts from a solution v, without its energies.

    None if v is no solution.
    """
    acceptance = Acceptance(tolerance)
    judged = judge(problem.rows, v[None], acceptance, refine=True)
    if not judged.residual[0] <= acceptance.aim:
        return None
    return replace(
        unsolved(problem, Status.CONVERGED, "", np.nan),
        v=judged.v[0],
        v_low=judged.v_low[0],
        xi=judged.xi[0],
        inclusion_residual=judged.residual[0],
        rounding=judged.rounding[0],
        start=NEIGHBOUR,
    )


def _by_bundle(
    problem: ContactProblem,
    acceptance: Acceptance,
    max_iterations: int | None,
    branch: Branch,
    neighbour: Array | None,
    exact: Array | None,
) -> Answer:
    """Return the least solution from all starts, or the first; the work is that of all starts.

    A failure has the least residual.
    """
    from tcstudy.contact.bundle import solve_with_bundle  # needs the QP library

    block = SolutionBlock(problem.rows, branch, acceptance.tolerance, prove=False)
    point = np.zeros(1, dtype=np.intp)
    starts = [(ZERO, np.zeros(problem.m))]
    if not problem.rows.body.loose:  # a body that can move freely has no frictionless solution
        starts.append((FRICTIONLESS, problem.frictionless()))
    if neighbour is not None:
        starts.insert(0 if branch == "continued" else len(starts), (NEIGHBOUR, neighbour))
    accuracy = min(ACCURACY, acceptance.aim)
    outcomes = list[Outcome]()
    failed = None
    least_residual = np.inf
    for start, x0 in starts:
        outcome = solve_with_bundle(problem, x0, max_iterations, accuracy)
        outcomes.append(outcome)
        judged = judge(problem.rows, outcome.x[None], acceptance, refine=True)
        if failed is None or judged.residual[0] < least_residual:
            least_residual = judged.residual[0]
            failed = Shortfall(outcome.status, outcome.reason)
            if outcome.converged:
                failed = Shortfall(Status.INCLUSION_VIOLATED, UNFIT)
            block.energy[~block.solved] = np.inf  # an infinite energy is always replaced
        block.offer(point, judged.v, judged.residual, start)
        if branch != "lowest" and block.solved[0]:
            break
    if branch == "lowest" and exact is not None:
        block.begin_at(exact)
    answer = block.answer(prove=False, failed=failed).row(0)
    return replace(
        answer,
        iterations=sum(outcome.iterations for outcome in outcomes),
        evaluations=sum(outcome.evaluations for outcome in outcomes),
    )
