"""Solve and certify P contact problems on one condensed body at once.

Problems:  0 ∈ Ãv − l̃_p + ∂Ψ_p(v), Ψ_p(v) = Σ c_i j_p(v_i), p = 1..P with one Ã and c, own loads and laws
Order:     1. unique or not, before any solution;
           2. one descent of every point, nested over the coarse copies of the body that all points
             share;
           3. what is not unique: the certificate of a global minimum;
           4. what has neither: the search for less energy (neighbours, frictionless start,
             envelopes, other nodes);
           5. what is not solved yet: the plain starts, zero and the frictionless solution, on the
             body itself.
A block's numbers depend on its own points and their order only, not on what else is solved where.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tcstudy.contact.all_solutions import (
    LAW_ERROR,
    Equilibria,
    Limits,
    all_solutions,
    of_rows,
    polygon_laws,
    with_solution,
)
from tcstudy.contact.certificates import Certificate, Proofs, row_of
from tcstudy.contact.descent import TOLERANCE, descend, descend_nested
from tcstudy.contact.problem import CondensedBody, ContactProblem, Outcome, Status, kept
from tcstudy.contact.search import envelope_starts, move_starts
from tcstudy.contact.solution import Acceptance, judge, polished
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
"""Relative difference of energies up to which two answers count as equally low; the earlier start
then wins."""
MOVES = 20
"""Moves of single nodes at most (trials needed two)."""
FAR = 100.0
"""Multiples of the rounding of ξ up to which a residual that is too large is put down to it."""
NOT_POSITIVE_DEFINITE = (
    "the condensed stiffness is not positive definite; the body can move freely (clamp it) or its elastic "
    "constants are wrong"
)


@dataclass(frozen=True, eq=False)
class Answer:
    """A judged solution; of P problems the same with one axis more, (P,), (P, m), (P, 5).

    v, v_low:           (m,) tangential displacements v + v_low [m]; the low part is 0 where one double is enough
    xi:                 (m,) nodal friction forces l̃ − Ã(v + v_low) [N/m]
    inclusion_residual: max_i dist(ξ_i/c_i, b̂(v_i)) / (scale of b), with what rounding may hide in it: in exact
                        arithmetic v + v_low has no larger one
    rounding:           what rounding of the problem allows of it, `ContactProblem.xi_rounding`
    limited:            accepted only because rounding allows no better (scene/study.py)
    energy:             L̃(v) [J/m]
    status, reason:     CONVERGED, or why not; reason is empty for a solution
    start:              ZERO, FRICTIONLESS, NEIGHBOUR, ESCAPE or EXACT: where the run that found it began
    energies:           (5,) L̃ of the solutions found from these starts, in this order; NaN where none was
    iterations, evaluations: steps on the body itself of the descent that led to v; by bundle-newton of all starts
    certificate:        what is proved, None if that was not asked for
    solutions:          all solutions of each problem, None if these were not asked for
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
        """The answer to one of the problems."""
        one: Answer = row_of(self, p)
        return replace(one, status=Status(int(one.status)))


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
    neighbours: (P, m) solutions of neighbouring points for branch "continued", NaN in rows without one [m]
    exact:      (m,) the exact solution at the contact nodes, where it is known, for branch "lowest" [m]
    limits:     of the search for all solutions of every point, None if these are not asked for. Where they are proved
                to be all, the answer is the one of least energy and certified to be; of exponential
                laws nothing more
                is said than of their polygon, which is another problem
    prove:      False if only the solutions are wanted, with no more proofs than the search for them needs
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
    """The points of a block on their way to answers."""

    def __init__(
        self,
        rows: ContactProblem,
        branch: Branch,
        tolerance: float | None = None,
        neighbours: Array | None = None,
        prove: bool = True,
    ) -> None:
        count, m = rows.l_tilde.shape
        self.rows, self.branch, self.acceptance = rows, branch, Acceptance(tolerance)
        self.neighbours = np.full((count, m), np.nan) if neighbours is None else neighbours
        self.v, self.energy = np.zeros((count, m)), np.full(count, np.inf)
        self.solved = np.zeros(count, dtype=bool)
        self.start, self.energies = (
            np.zeros(count, dtype=np.int8),
            np.full((count, len(START_NAMES)), np.nan),
        )
        self.steps = np.zeros(count, dtype=np.intp)
        self.smooth = ContactProblem.on(rows.body, rows.l_tilde, rows.law.without_narrow_pieces)
        self.aim = min(TOLERANCE, self.acceptance.aim)
        self.proofs = Proofs(rows, prove)

    def descend(self) -> None:
        """The first descent: from the neighbour where the branch is continued, else from zero.

        A neighbour that is a solution is not moved at all: a descent would leave one that is no
        minimum.
        """
        known = np.all(np.isfinite(self.neighbours), axis=1) & (self.branch == "continued")
        near, far = np.flatnonzero(known), np.flatnonzero(~known)
        if len(near):
            v = self.neighbours[near]
            residual = judge(self.rows.take(near), v, self.acceptance).residual
            there = residual <= self.acceptance.aim
            self.offer(near[there], v[there], residual[there], NEIGHBOUR)
            self.begin_from(near[~there], v[~there], NEIGHBOUR)
        zero, minima = np.zeros((len(far), self.rows.body.m)), self.branch != "lowest"
        self.begin_from(far, zero, ZERO, nested=True, minima=minima)

    def begin_from(
        self, points: Index, v: Array, start: int, nested: bool = False, minima: bool = True
    ) -> Index:
        """Descend from v (n, m), keep and certify what has less energy, and return the points left
        without proof."""
        ended = (descend_nested if nested else descend)(
            self.smooth.take(points), v, self.aim, minima
        )
        self.offer(points, ended.v, ended.residual, start, ended.steps)
        return self.unproved(points)

    def offer(
        self, points: Index, v: Array, residual: Array, start: int, steps: Index | int = 0
    ) -> Flags:
        """Keep and certify ends (n, m) of different points that have less energy; whether each has
        (n,)."""
        rows, energy = self.rows.take(points), self.rows.take(points).energy(v)
        accepted = residual <= self.acceptance.aim
        doubtful = np.flatnonzero(~accepted)
        if len(doubtful):
            accepted[doubtful] = judge(rows.take(doubtful), v[doubtful], self.acceptance).accepted
        found = self.energies[points, start]
        self.energies[points, start] = np.where(accepted, np.fmin(found, energy), found)
        known = np.isfinite(self.energy[points])
        slack = TIE * np.maximum(np.abs(energy), np.abs(np.where(known, self.energy[points], 0.0)))
        lower = accepted & (~self.solved[points] | (energy < self.energy[points] - slack))
        kept = lower | ~known
        own = points[kept]
        self.v[own], self.energy[own], self.solved[own] = v[kept], energy[kept], accepted[kept]
        self.start[own], self.steps[own] = start, np.broadcast_to(steps, len(points))[kept]
        self.proofs.prove_lowest(points[lower], self.v)
        return lower

    def unproved(self, points: Index) -> Index:
        """Those of the points whose solution is not known to have the least energy."""
        return points[~(self.proofs.unique | self.proofs.lowest)[points]]

    def search(self) -> None:
        """Look for less energy at points of which nothing is proved."""
        points = self.unproved(np.arange(len(self.v)))
        if self.rows.body.loose:
            return
        beside = points[np.all(np.isfinite(self.neighbours[points]), axis=1)]
        if len(beside):
            left = self.begin_from(beside, self.neighbours[beside], NEIGHBOUR)
            points = np.union1d(np.setdiff1d(points, beside), left)
        if not len(points):
            return
        points = self.begin_from(points, self.v[points], ZERO)
        frictionless = self.rows.l_tilde[points] @ self.rows.body.inverse
        points = self.begin_from(points, frictionless, FRICTIONLESS, nested=True)
        starts, done = envelope_starts(self.smooth.take(points), self.v[points])
        left = self.begin_from(points, starts, ESCAPE)
        self.move(np.setdiff1d(left, points[done]))

    def move(self, points: Index) -> None:
        """Moves of single nodes as long as they lower the energy; the first promise of two that
        does is kept."""
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
                one = ended.v[mine], ended.residual[mine], ESCAPE, ended.steps[mine]
                moved[owners[mine]] |= self.offer(owners[mine], *one)
            points = self.unproved(np.flatnonzero(moved))

    def begin_elsewhere(self) -> None:
        """What no start has solved from the other plain ones, without coarse copies."""
        body = self.rows.body
        for start in (ZERO,) if body.loose else (ZERO, FRICTIONLESS):
            points = np.flatnonzero(~self.solved)
            if len(points):
                loads = self.rows.l_tilde[points]
                self.begin_from(
                    points, loads @ body.inverse if start == FRICTIONLESS else 0.0 * loads, start
                )

    def begin_at(self, exact: Array) -> None:
        """Newton's method on the pieces that the exact solution is on; unique solutions are
        known."""
        only = self.solved & self.proofs.unique
        self.energies[only, EXACT] = self.energy[only]
        for p in np.flatnonzero(~only):
            end = polished(self.rows.single(int(p)), exact, exact=False)
            self.offer(np.array([p]), end.v[None], np.array([end.residual]), EXACT)

    def take_least(self, solutions: Sequence[Equilibria]) -> None:
        """The least of all solutions of every point, where these are proved to be all of the law
        itself."""
        known = kept(self.rows.body.A_error) == 1.0
        proved = np.array(
            [known and one.complete and not one.law_error for one in solutions], dtype=bool
        )
        least = np.array([one.energy[0] if len(one) else np.inf for one in solutions])
        higher = self.energy > least + TIE * np.maximum(np.abs(least), np.abs(self.energy))
        changed = np.flatnonzero(proved & (~self.solved | higher))
        if len(changed):
            v = np.array([solutions[i].v[0] for i in changed.tolist()])
            residual = judge(self.rows.take(changed), v, self.acceptance).residual
            proved[changed] = self.offer(changed, v, residual, ESCAPE)
        self.proofs.lowest |= proved
        self.proofs.unique |= proved & np.array([len(one) == 1 for one in solutions], dtype=bool)

    def answer(self, prove: bool, otherwise: tuple[Status, str] | None = None) -> Answer:
        """Everything judged once more at the points' final v.

        otherwise: status and reason of points that are no solutions
        """
        rows, loose = self.rows, self.rows.body.loose
        judged = judge(rows, self.v, self.acceptance, refine=True)
        differs = np.any(judged.v != self.v, axis=1)
        if np.any(differs):
            moved, again = np.flatnonzero(differs), np.flatnonzero(differs & judged.accepted)
            self.energy[moved] = rows.take(moved).energy(judged.v[moved])
            self.energies[again, self.start[again]] = self.energy[again]
        missed = otherwise or (Status.INCLUSION_VIOLATED, STALLED)
        if otherwise is None and loose:
            missed = Status.NOT_POSITIVE_DEFINITE, NOT_POSITIVE_DEFINITE
        numbers = zip(
            judged.residual.tolist(),
            judged.rounding.tolist(),
            judged.accepted.tolist(),
            strict=True,
        )
        reasons = tuple(
            "" if good else failure(x, noise, self.acceptance, missed[1])
            for x, noise, good in numbers
        )
        proved = (
            self.proofs.certificate(judged.v, judged.residual, judged.accepted) if prove else None
        )
        return Answer(
            v=judged.v,
            v_low=judged.v_low,
            xi=judged.xi,
            inclusion_residual=judged.residual,
            rounding=judged.rounding,
            limited=judged.accepted & (judged.residual > self.acceptance.aim),
            energy=self.energy,
            status=np.where(judged.accepted, Status.CONVERGED, missed[0]).astype(np.int8),
            reason=reasons,
            start=self.start,
            energies=self.energies,
            iterations=self.steps,
            evaluations=self.steps,
            certificate=proved,
        )


STALLED = (
    "no descent leads to a solution; the data span too many orders of magnitude for double precision: check the units, "
    "start from another point, or use another solver"
)


def failure(residual: float, rounding: float, acceptance: Acceptance, otherwise: str) -> str:
    """Why an answer misses the tolerance and what to try; more steps do not help against
    rounding."""
    limit = acceptance.limit(rounding)
    missed = f"inclusion residual {residual:.1e} above the tolerance {limit:.1e}"
    if limit < residual <= FAR * rounding:
        return (
            f"{missed}; rounding alone leaves about {rounding:.0e} because friction is small against the forces in the "
            "body or elements on the contact line are very thin: raise solver.tolerance, check the units, or coarsen"
        )
    return f"{missed}: {otherwise}"


ACCURACY = 1e-12
"""Residual that methods work for, whatever larger one is accepted."""
SEMIDEFINITE = 1e-9
"""Negative eigenvalues up to this part of the largest entry of Ã are rounding: the body lies
loose."""
UNFIT = (
    "the pieces of the law on which the method ended do not hold to that accuracy; raise solver.tolerance or try the "
    "other solver"
)
NOT_FINITE = "a load, the stiffness or the law has a value that is not finite; check them, and units that overflow"


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

    tolerance: largest inclusion residual, strict; None for 1e-10 or what rounding allows (scene/study.py)
    max_iterations: steps of bundle-newton, None for its own limit; separable-newton has one of its own
    branch:    "lowest": of the solutions found from zero, from the frictionless solution, from the neighbour, beside
               the exact one and, unless the best of them seems global or the solver is
               bundle-newton, by the escape
               phase the lowest found; "continued": from the neighbour, without leaving its basin on
               purpose,
               and not moved at all if it is a solution; "from-zero": from zero. These two try zero,
               the frictionless
               solution and the neighbour, too, but only where theirs fails
    neighbour: (m,) a solution of a neighbouring problem, if there is one
    exact:     (m,) the exact solution at the contact nodes, where it is known; its own branch may be a saddle

    An answer that misses the tolerance is solved again to higher accuracy, in the end with v as a
    sum of two doubles; one that still misses it is returned as failed, with its residual. Raises
    ValueError for an unknown solver.
    """
    if solver not in SOLVERS:
        raise ValueError(f"unknown solver {solver!r}; use one of {', '.join(SOLVERS)}")
    if problem.m == 0:
        return unsolved(problem, Status.CONVERGED, "", 0.0)
    near = None if neighbour is None else np.asarray(neighbour, dtype=float)
    if solver != SEPARABLE:
        return _by_bundle(problem, Acceptance(tolerance), max_iterations, branch, near, exact)
    if not all(np.all(np.isfinite(x)) for x in (problem.A_tilde, problem.l_tilde, problem.c)):
        return unsolved(problem, Status.NOT_FINITE, NOT_FINITE, np.nan)
    rows = problem.rows
    if rows.body.loose and np.linalg.eigvalsh(problem.A_tilde)[0] < -SEMIDEFINITE * np.max(
        np.abs(problem.A_tilde)
    ):
        return unsolved(problem, Status.NOT_POSITIVE_DEFINITE, NOT_POSITIVE_DEFINITE, 0.0)
    near = None if near is None else near[None]
    return solve_block(
        rows.body, rows.l_tilde, rows.law, branch, tolerance, near, exact, prove=False
    ).row(0)


def unsolved(problem: ContactProblem, status: Status, reason: str, energy: float) -> Answer:
    """The answer to a problem without nodes, or to one that cannot be solved."""
    v, residual = np.full(problem.m, 0.0 * energy), 0.0 if status == Status.CONVERGED else np.inf
    none = np.full(len(START_NAMES), np.nan)
    return Answer(
        v, 0.0 * v, 0.0 * v, residual, 0.0, False, energy, status, reason, ZERO, none, 0, 0
    )


def nearest_minimum(
    problem: ContactProblem, v: Array, tolerance: float, over_barriers: bool = True
) -> tuple[Array, int]:
    """(minimum to which descent leads from v (m,), steps); over no barriers: laws of straight
    pieces."""
    ended = descend(
        problem.rows, v[None].copy(), tolerance, minima=True, downhill=not over_barriers
    )
    return ended.v[0], int(ended.steps[0])


def as_it_is(problem: ContactProblem, v: Array, tolerance: float | None = None) -> Answer | None:
    """v as `solve_contact` has it where it starts from a solution, without its energies; None if v
    is none."""
    acceptance = Acceptance(tolerance)
    one = judge(problem.rows, v[None], acceptance, refine=True)
    if not one.residual[0] <= acceptance.aim:
        return None
    return replace(
        unsolved(problem, Status.CONVERGED, "", np.nan),
        v=one.v[0], v_low=one.v_low[0], xi=one.xi[0], inclusion_residual=one.residual[0], rounding=one.rounding[0],
        start=NEIGHBOUR,
    )  # fmt: skip


def _by_bundle(
    problem: ContactProblem,
    acceptance: Acceptance,
    max_iterations: int | None,
    branch: Branch,
    neighbour: Array | None,
    exact: Array | None,
) -> Answer:
    """The least solution from all starts, or the first; what fails has the least residual, and work
    is summed."""
    from tcstudy.contact.bundle import solve_with_bundle  # needs the QP library

    block, here = (
        SolutionBlock(problem.rows, branch, acceptance.tolerance, prove=False),
        np.zeros(1, dtype=np.intp),
    )
    tried, missed, least = list[Outcome](), None, np.inf
    starts = [(ZERO, np.zeros(problem.m))]
    if not problem.rows.body.loose:  # a body that can move freely has no frictionless solution
        starts.append((FRICTIONLESS, problem.frictionless()))
    if neighbour is not None:
        starts.insert(0 if branch == "continued" else len(starts), (NEIGHBOUR, neighbour))
    for start, x0 in starts:
        tried.append(
            outcome := solve_with_bundle(problem, x0, max_iterations, min(ACCURACY, acceptance.aim))
        )
        judged = judge(problem.rows, outcome.x[None], acceptance, refine=True)
        if missed is None or judged.residual[0] < least:
            missed = (
                (Status.INCLUSION_VIOLATED, UNFIT)
                if outcome.converged
                else (outcome.status, outcome.reason)
            )
            least = judged.residual[0]
            block.energy[~block.solved] = np.inf  # so that it takes the place of what has more
        block.offer(here, judged.v, judged.residual, start)
        if branch != "lowest" and block.solved[0]:
            break
    if branch == "lowest" and exact is not None:
        block.begin_at(exact)
    work = {
        name: sum(getattr(one, name) for one in tried) for name in ("iterations", "evaluations")
    }
    return replace(block.answer(prove=False, otherwise=missed).row(0), **work)
