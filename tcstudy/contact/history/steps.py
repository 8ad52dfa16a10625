"""A load history step after step, each along its exact path or to the lowest state it can find.

Along its path a node that slips goes on slipping, one that turns back starts a new part, and at a
fold the state jumps. Inside a step the load is l̃(t) = l̃ⁿ⁻¹ + t (l̃ⁿ − l̃ⁿ⁻¹), t from 0 to 1, with
the laws that the last state gives. They hold as long as no node takes back what it has done since:
slipped, yielded or torn. So a step is a sequence of parts. Each has laws of its own and is a piece
of a piecewise-linear path (contact/path):
  1. From the state the path is followed on the stable branch on which t grows, up to a fold, or to
     where the first node begins to take back what it has done. There the memory is updated. All
     parts of a step share one inverse.
  2. Where there is no such branch, a descent to the load a little further on finds what comes next.
     The path through it is traced back. Where it ends elsewhere, no solution is near, and the state
     *jumps* there at once, with the energy that is released. Otherwise the path through it leads
     on.
Between vertices forces and slips are linear, so that work and dissipation are exact: closure is
rounding. Straight pieces replace exponential ones on the path (memory.py). At the end of every part
the solution with the law itself is found beside it, at a fold the fold of the law itself
(path/smooth.py). The work of friction on the way there has a closed form: states and energies are
exact.

Loop: without a memory the state follows its stable branch and jumps off it at folds. With the load
l̃₀ + t l̃₁ the work of a step is −∫W dt, W = l̃₁ᵀv. For a closed loop it is the area of the loop in
the plane of t and W, and all of it is lost at the jumps.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from tcstudy.contact.history.memory import (
    LAW_ERROR,
    HistoryProblem,
    HistoryStep,
    MemoryModel,
    with_energies,
    with_proofs,
)
from tcstudy.contact.newton import convex_step
from tcstudy.contact.path.basis_inverse import BasisInverse, SingularCellError
from tcstudy.contact.path.follow import Follower, ParametricProblem, Path, PathStatus
from tcstudy.contact.path.smooth import fold_beside
from tcstudy.contact.path.walk import locate
from tcstudy.contact.problem import CondensedBody, ContactProblem, Status
from tcstudy.contact.solution import Acceptance
from tcstudy.contact.solve import Answer, as_it_is, nearest_minimum, solve_contact
from tcstudy.laws.laws import Laws
from tcstudy.scene.histories import Memory
from tcstudy.scene.solver_plan import Branch

Array = NDArray[np.float64]

LOOK_AHEAD = 1e-6
"""Share of the remaining step by which a part looks ahead."""
MIN_LOAD_CHANGE = 1e-10
"""Least part of the load by which it changes when a part looks ahead."""
MAX_DISTANCE_BACK = 0.5
"""Distance from the state, relative to the way ahead, beyond which a path back ends elsewhere."""
MAX_ASIDE = 0.05
"""Distance of the law's solution from that of straight pieces, relative to the way to it.

Nearer solutions count as the same state.
"""
ROUNDING = 1e-11
"""Part of the largest slip that rounding may seem to take back, or to be apart."""
MAX_PARTS = 1000
SMALL_PART = 10.0 * LOOK_AHEAD
"""Share of a step below which a part hardly brings it on."""
MAX_SMALL_PARTS = 100
"""Most such parts in a row."""
MAX_DOUBLINGS = 20
"""Most doublings of the number of vertices by which a part ends early."""
UPHILL = (
    "no state of less energy is found beyond a fold: the next one found has {gain:.2g} J/m more"
)
STUCK = (
    f"{MAX_SMALL_PARTS} jumps or reversals in a row bring it hardly on; take another mesh or other "
    "steps"
)
HIDDEN = "the law leaves the path along the straight pieces that replace its curve"
ENDED = "the path inside the step ends at {share:.3g} of it: {reason}; make more steps"


class Way(NamedTuple):
    """Vertices of a part: shares t (k,), slips v (k, m) [m], tractions ξ/c (k, m) [Pa]."""

    t: Array
    v: Array
    xi: Array


class Jump(NamedTuple):
    """A jump at the share t, after so many ways, and the energy it releases [J/m]."""

    ways: int
    t: float
    v_from: Array
    v_to: Array
    released: float


class PartEnd(NamedTuple):
    """Shares t (k,) and slips w (k, m) [m] of a part up to its end, and the solution there."""

    t: Array
    w: Array
    answer: Answer


def continued(history: HistoryProblem, last_step: HistoryStep, load: Array) -> HistoryStep:
    """Return the step along its path; one that cannot be followed fails with its reason."""
    step = ContinuedStep(history, last_step, load)
    if not step.run():
        reason = ENDED.format(share=step.t, reason=step.reason)
        return replace(step.now, status=Status.STALLED, reason=reason)
    assert step.judged is not None
    problem, answer = step.judged
    return with_proofs(history, problem, answer, replace(step.now, iterations=step.iterations))


class ContinuedStep:
    """One step while it is followed, part after part.

    Each part is solved in w = v − a (memory.py), with the laws that its first state gives.

    now:        all parts together up to the share t;  ways, jumps: of these parts
    origin, w:  (m,) a and the state w of the part [m]
    load_shift: (m,) what a load is more in terms of w [N/m]
    law:        of the part
    problem:    the part over the shares of the step, with straight pieces in place of exponential
                ones
    judged:     the last problem and its answer
    beyond:     (m,) slips a little beyond the end of the last path [m]
    fold:       share up to which no path leads on
    senses:     (m,) direction in which nodes between two pieces of their graphs went on last
    """

    origin: Array
    w: Array
    load_shift: Array
    law: Laws
    problem: ParametricProblem

    def __init__(self, history: HistoryProblem, last_step: HistoryStep, load: Array) -> None:
        self.history = history
        self.body = history.body
        self.straight = history.model.law.piecewise_linear
        self.last_step = last_step
        self.load = load
        self.change = load - last_step.load
        self.now = last_step.unchanged()
        self.t = 0.0
        self.ways = list[Way]()
        self.jumps = list[Jump]()
        self.iterations = 0
        self.judged: tuple[ContactProblem, Answer] | None = None
        self.reason = ""
        self.beyond = last_step.v
        self.fold = 0.0
        self.basis: BasisInverse | None = None
        loading = 1.0 if float(np.sign(last_step.xi) @ self.change) >= 0.0 else -1.0
        sense_of_xi = loading * np.sign(last_step.xi)
        self.senses = np.where(last_step.xi == 0.0, np.sign(self.change), sense_of_xi)

    def run(self) -> bool:
        """Go on, part after part and jump after jump, to the load.

        Returns False where none leads on, with the reason.
        """
        small_parts = 0
        for _ in range(MAX_PARTS):
            last_t = self.t
            self._begin_part()
            path = self._path_on() if self.fold <= self.t else None
            goes_on = path is not None and self._follow(path)
            if not (goes_on or self._go_elsewhere()):
                return False
            if self.t == 1.0:
                return True
            small_parts = small_parts + 1 if self.t - last_t < SMALL_PART else 0
            if small_parts > MAX_SMALL_PARTS:
                self.reason = STUCK
                return False
        self.reason = f"a node reverses its slip or jumps more than {MAX_PARTS} times"
        return False

    def load_at(self, t: float) -> Array:
        """Return (m,) l̃ at the share t [N/m]."""
        return self.load if t == 1.0 else self.last_step.load + t * self.change

    def _begin_part(self) -> None:
        """Let the next part begin at the present state.

        A stiff body makes much of the last digit of a slip. Forces that rounding alone takes off
        their limits, outside or inside, are put on them. Otherwise no path would begin at the
        state, or all would go back to its first vertex.
        """
        A, c = self.body.A_tilde, self.body.c
        state, model = self.now, self.history.model
        self.origin = model.origin(state)
        self.w = state.v - self.origin
        self.law = model.next_law(state)
        xi = state.load - A @ state.v
        size = np.abs(state.load) + np.abs(A) @ np.abs(state.v)
        low, high = (c * limit - xi for limit in self.law.interval(self.w))
        to_limit = np.where(np.abs(low) < np.abs(high), low, high)
        rounding = 8.0 * np.sqrt(self.body.m) * np.finfo(float).eps * size
        correction = np.where(np.abs(to_limit) <= rounding, to_limit, 0.0)
        self.load_shift = correction - A @ self.origin
        law = self.law if self.straight else model.next_law(state, straight=True)
        first_load = self.last_step.load + self.load_shift
        self.problem = ParametricProblem(
            A, first_load, self.change, c, law, blocks=self.body.blocks
        )
        vars(self.problem)["body"] = self.history.scaled  # the same in all parts and steps

    def _problem_at(self, t: float) -> ContactProblem:
        """Return the problem of the part with the law itself."""
        return ContactProblem.on(self.body, self.load_at(t) + self.load_shift, self.law)

    def _answer(self, w: Array, t: float) -> Answer:
        """Return the solution at the share t that w is, or is near."""
        problem, tolerance = self._problem_at(t), self.history.tolerance
        answer = as_it_is(problem, w, tolerance) if self.straight else None
        if answer is None:
            answer = solve_contact(problem, tolerance=tolerance, branch="continued", neighbour=w)
        self.judged = problem, answer
        return answer

    @property
    def _follower(self) -> Follower:
        return Follower(
            t_min=self.t,
            t_max=1.0,
            max_pieces=self.history.max_pieces,
            tolerance=self.history.tolerance,
            stable_only=True,
            one_way=self.history.model.remembers,
        )

    def _path_on(self) -> Path | None:
        """Return the path from the state, as far as it is stable and no node turns back."""
        try:
            walk = locate(self.problem, self.w, self.t, self.senses, self.basis)
        except (ValueError, SingularCellError) as error:
            self.reason = str(error).partition("; ")[0]
            return None
        self.basis = walk.basis
        # the law may go on where no chord does
        path = self._follower.onward(walk, falling=not self.straight)
        self.senses = walk.graph.sense[walk.codes] * np.sign(walk.dx[:-1])
        if path is None:
            return None
        if path.end == PathStatus.TURNS and path.pieces:
            # only the node that turns back changes its direction
            moved = path.u[-1] - path.u[-2]
            pushed = path.traction[-1] - path.traction[-2]
            self.senses = np.sign(np.where(moved != 0.0, moved, pushed))
        beyond = path.u[-1]
        if path.end == PathStatus.UNSTABLE:
            beyond = 0.5 * (path.u[-1] + path.u[-2])  # the energy decreases there
        self.beyond = self.origin + beyond
        return path

    def _follow(self, path: Path, lead: Path | None = None) -> bool:
        """Go forward to the end of the path.

        Along the graph of b ∫ξᵀdv = Σ c (j(w₁) − j(w₀)) whatever the curve. What straight pieces
        miss of that they miss of the work as well: between the same ends each balances ΔE. Where
        they miss much the law goes elsewhere.

        lead: the path back from its beginning to the state
        """
        part_end = self._end_of(path)
        if part_end is None:
            return False
        t, w, answer = part_end
        end, parts = float(t[-1]), len(t) - 1
        if lead is not None:
            t = np.concatenate([t[:1], lead.t[::-1], t[1:]])
            w = np.concatenate([w[:1], lead.u[::-1], w[1:]])
        c, problem = self.body.c, self.problem
        inner_xi = problem.l_0 + t[1:-1, None] * problem.l_1 - w[1:-1] @ problem.A_tilde
        xi = np.array([c * self.now.xi, *inner_xi, answer.xi])
        slips = np.diff(w, axis=0)
        middle = 0.5 * (w[1:] + w[:-1]) + self.origin
        work = -float(np.diff(t) @ (middle @ self.change))
        friction = 0.5 * float(np.sum((xi[1:] + xi[:-1]) * slips))
        if not self.straight:
            missed = float(c @ self.law.integral(w[0], answer.v)) - friction
            total_slip = float(np.sum(np.abs(slips) @ c))
            if abs(missed) > 4.0 * LAW_ERROR * self.history.model.law.b_scale * total_slip:
                self.reason = HIDDEN
                return False
            work += missed
            friction += missed
        part = with_energies(self.history, self.now, self.load_at(end), answer, work, friction)
        self.now = self.now.then(replace(part, parts=parts))
        self.t = end
        self.ways.append(Way(t, self.origin + w, xi / c))
        return True

    def _end_of(self, path: Path) -> PartEnd | None:
        """Return the part to the last vertex of a path beside which the law itself has a solution.

        That is where the law folds beside the end. Straight pieces that replace a curve may fold a
        little later than it does: the part then ends before. Without such a vertex the result is
        None, with the reason.
        """
        ends_at_fold = path.end == PathStatus.UNSTABLE
        last_vertex = len(path.t) - 1 - ends_at_fold
        if ends_at_fold and not self.straight:
            part_end = self._end_at_fold(path, last_vertex)
            if part_end is not None:
                return part_end
        self.reason = path.end.reason
        if not path.t[last_vertex] > self.t:
            return None
        for vertices_back in self._early_ends(path, last_vertex):
            vertex = last_vertex - vertices_back
            w = path.u[vertex]
            answer = self._answer(w, float(path.t[vertex]))
            is_beside = self.straight or self._is_beside(path, w, answer)
            is_end = is_beside and answer.status == Status.CONVERGED
            if is_end:
                break
        self.fold = float(path.t[last_vertex]) if ends_at_fold or vertices_back else 0.0
        if is_end:
            return self._part_to(path, vertex, float(path.t[vertex]), answer)
        if is_beside:
            self.reason = answer.reason
        elif not self.fold:
            self.reason = HIDDEN
        return None

    def _end_at_fold(self, path: Path, last_vertex: int) -> PartEnd | None:
        """Return the part to the fold of the law itself near the end of a path, None without one.

        last_vertex: the last stable one
        """
        fold = fold_beside(path, self.law, self.history.model.law.s_scale)
        if fold is None:
            return None
        t, w = fold
        answer = self._answer(w, t)
        if answer.status != Status.CONVERGED or not np.array_equal(answer.v, w):
            return None
        self.fold = float(np.nextafter(t, 2.0))
        vertex = int(np.searchsorted(path.t[: last_vertex + 1], t))
        return self._part_to(path, vertex, t, answer)

    def _early_ends(self, path: Path, last_vertex: int) -> Iterator[int]:
        """Yield numbers of vertices before the last one at which a part may end: 0, 1, 2, 4, …

        A part along straight laws ends at the last one.
        """
        yield 0
        if self.straight:
            return
        for doublings in range(MAX_DOUBLINGS):
            vertices_back = 2**doublings
            if vertices_back < last_vertex and path.t[last_vertex - vertices_back] > self.t:
                yield vertices_back

    def _is_beside(self, path: Path, w: Array, answer: Answer) -> bool:
        """Return whether the solution with the law itself is beside a vertex w of a path."""
        body = self.body
        moved = np.max(np.abs(w - path.u[0]))
        distance = np.max(np.abs(answer.v - w))
        softest = float(np.max(body.c / np.diagonal(body.A_tilde)))
        slip = self.history.model.law.b_scale * softest
        return bool(distance <= MAX_ASIDE * moved + 30.0 * LAW_ERROR * slip)

    def _part_to(self, path: Path, vertex: int, t: float, answer: Answer) -> PartEnd:
        """Return the part from the state over the vertices before `vertex` to an answer at t."""
        shares = np.array([self.t, *path.t[1:vertex], t])
        slips = np.array([self.w, *path.u[1:vertex], answer.v])
        return PartEnd(shares, slips, answer)

    def _go_elsewhere(self) -> bool:
        """Go on by a descent to the load a little further on, where no path leads on."""
        last_load_size = float(np.max(np.abs(self.last_step.load)))
        load_size = float(np.max(np.abs(self.load))) + last_load_size
        change_size = float(np.max(np.abs(self.change)))
        share = max(LOOK_AHEAD * (1.0 - self.t), MIN_LOAD_CHANGE * load_size / change_size)
        ahead = min(1.0, self.t + share + max(0.0, self.fold - self.t))
        self.fold = 0.0
        problem = self.problem.at(ahead)
        beyond = self.beyond - self.origin
        energy_change, _ = problem.energy_change(self.w, beyond)
        # a node that turned back sticks: it may bar the way beyond
        start = beyond if energy_change < 0.0 else self.w
        w_ahead, iterations = nearest_minimum(problem, start, 1e-14, over_barriers=False)
        self.iterations += iterations
        try:
            path_back = self._path_back(w_ahead, ahead)
        except ValueError as error:
            self.reason = str(error).partition("; ")[0]
            return False
        move_ahead = float(np.max(np.abs(w_ahead - self.w)))
        largest_slip = float(np.max(np.abs(path_back.u)))
        max_distance = max(MAX_DISTANCE_BACK * move_ahead, ROUNDING * largest_slip)
        if np.max(np.abs(path_back.u[-1] - self.w)) > max_distance:
            return self._jump(path_back)
        path = self._follower.follow(self.problem, w_ahead, ahead, "forward")
        if self._follow(path, path_back):
            self.beyond = self.now.v
            return True
        if self.reason == HIDDEN:
            return self._jump(path_back)
        # straight pieces may fold later still
        return self.fold > ahead and self._go_elsewhere()

    def _path_back(self, w: Array, t: float) -> Path:
        """Return the stable part of the path back from a solution ahead."""
        path = replace(self._follower, one_way=False).follow(self.problem, w, t, "backward")
        vertices = slice(path.pieces + (path.end != PathStatus.UNSTABLE))
        return replace(path, t=path.t[vertices], u=path.u[vertices])

    def _jump(self, path: Path) -> bool:
        """Jump to the solution to which the path back from the load ahead leads.

        If only the solution ahead releases energy, jump there. Where the energy of the step is
        convex no state lets go: what looks like a jump is rounding, and does not count.
        """
        state = self.now
        A, c = self.body.A_tilde, self.body.c
        for vertex in (-1, 0):
            t = float(path.t[vertex])
            landing = self._answer(path.u[vertex], t)
            if landing.status != Status.CONVERGED:
                self.reason = landing.reason
                return False
            # nothing moves until then: this is the fold, but for straight pieces
            change = self.load_at(t) - state.load
            xi_sum = landing.xi + c * state.xi + change
            friction = 0.5 * float(xi_sum @ (self.origin + landing.v - state.v))
            work = -float(state.v @ change)
            part = with_energies(self.history, state, self.load_at(t), landing, work, friction)
            moved = np.abs(part.v - state.v)
            leaves_state = np.max(moved) > ROUNDING * np.max(np.abs(part.v))
            if part.closure > 0.0 and leaves_state:
                break
        size = np.abs(part.load) + np.abs(A) @ np.abs(part.v)
        rounding = np.sqrt(self.body.m) * np.finfo(float).eps * float(size @ moved)
        if part.closure < -rounding:
            self.reason = UPHILL.format(gain=-part.closure)
            return False
        if part.closure > rounding and not self._has_one_solution():
            jumped = moved > ROUNDING * np.max(moved)
            part = replace(part, closure=0.0, released=part.closure, jumps=1, jumped=jumped)
            self.jumps.append(Jump(len(self.ways), t, state.v, part.v, part.released))
        self.now = state.then(replace(part, parts=0))
        self.t = t
        self.beyond = part.v
        return True

    def _has_one_solution(self) -> bool:
        """Return whether the state is the only solution of the part.

        Just behind a down-jump it is not a solution.
        """
        problem = self._problem_at(self.t)
        residual, rounding = problem.inclusion_residual(self.w), problem.xi_rounding(self.w)
        is_solution = Acceptance(self.history.tolerance).accepts(residual, rounding)
        return is_solution and self.history.one_solution(self.law)


def history(
    problem: HistoryProblem, loads: Iterable[Array], start: HistoryStep | None = None
) -> Iterator[HistoryStep]:
    """Yield the steps to the loads l̃ (m,) in turn; a step that fails is the last.

    start: the step after which to begin, by default the unloaded initial state
    """
    step = HistoryStep.virgin(problem.body.m) if start is None else start
    for load in loads:
        step = next_step(problem, step, np.asarray(load, dtype=float))
        yield step
        if not step.solved:
            return


def next_step(history: HistoryProblem, last_step: HistoryStep, load: Array) -> HistoryStep:
    """Return the step from `last_step` to a load; the same load changes nothing, to the bit."""
    if np.array_equal(load, last_step.load):
        return last_step.unchanged()
    # a law that vanishes remembers nothing, and its path has no scale
    if history.branch == "continued" and not history.model.law.vanishes:
        return continued(history, last_step, load)
    return lowest(history, last_step, load)


def lowest(history: HistoryProblem, last_step: HistoryStep, load: Array) -> HistoryStep:
    """Return the state of least energy that is found of the step as one problem in w = v − a.

    A body that lies loose while all its nodes slide is solved from the minimum of the convex model.
    """
    body, model, tolerance = history.body, history.model, history.tolerance
    a = model.origin(last_step)
    w = last_step.v - a
    load_of_w = load - body.A_tilde @ a if np.any(a) else load
    problem = ContactProblem.on(body, load_of_w, model.next_law(last_step))
    has_one_energy = history.convex or history.monotone
    branch: Branch = "continued" if has_one_energy else "lowest"
    answer = solve_contact(problem, tolerance=tolerance, branch=branch, neighbour=w)
    if answer.status in (Status.NOT_POSITIVE_DEFINITE, Status.UNBOUNDED):
        start = convex_step(problem, w)
        if start is not None:
            iterations = answer.iterations
            answer = solve_contact(
                problem, tolerance=tolerance, branch="continued", neighbour=start
            )
            answer = replace(answer, iterations=answer.iterations + iterations)
    step = with_energies(history, last_step, load, answer)
    return with_proofs(history, problem, answer, step) if step.solved else step


MAX_CYCLES = 3
"""Cycles after which a loop that has not closed ends; the last cycle is returned."""
MAX_CLOSING_ERROR = 1e-9
"""Difference of the ends of a closed cycle, relative to the largest slip."""


class Hysteresis(NamedTuple):
    """One cycle of t, there and back.

    ways:   stable branches in order, with t in place of shares
    jumps:  between them, likewise;  there: number of jumps on the way to the turning point
    lost:   energy lost at the jumps [J/m]
    area:   −∮W dt, the same if the loop is closed [J/m]
    closed: whether the cycle ends in the solution in which it began
    reason: why the turning points were not both reached, else empty
    """

    ways: list[Way]
    jumps: list[Jump]
    there: int
    lost: float
    area: float
    closed: bool
    reason: str


def hysteresis(
    problem: ParametricProblem,
    v: Array,
    begin: float,
    end: float,
    max_pieces: int = 20_000,
    tolerance: float | None = None,
) -> Hysteresis:
    """Return the loop from t = begin to end and back: the first cycle that closes.

    Energy descent from the fold decides where a jump ends. That is a rule, not mechanics: inertia
    might carry the body past a shallow minimum.

    v: (m,) the stable solution at t = begin
    max_pieces, tolerance: as of a `Follower`

    Raises ValueError for an empty range.
    """
    if begin == end:
        raise ValueError(f"the loop begins and ends at t = {begin:g}; give it a range")
    body = CondensedBody.known(problem.A_tilde, problem.c, problem.A_error, problem.blocks)
    model = MemoryModel(Memory("none"), problem.law, problem.m)
    history = HistoryProblem(body, model, tolerance=tolerance, max_pieces=max_pieces)
    load = problem.load(begin)
    state = replace(
        HistoryStep.virgin(problem.m),
        v=v,
        load=load,
        xi=problem.at(begin).xi(v) / problem.c,
        stored=float(problem.c @ problem.law.j(v)),
        energy=history.energy(v, load),
    )
    for _ in range(MAX_CYCLES):
        loop, state = _cycle(history, problem, state, begin, end)
        if loop.closed or loop.reason:
            break
    return loop


def _cycle(
    history: HistoryProblem,
    problem: ParametricProblem,
    start: HistoryStep,
    begin: float,
    end: float,
) -> tuple[Hysteresis, HistoryStep]:
    """Return one cycle from a state at t = begin, and the state in which it ends."""
    ways = list[Way]()
    jumps = list[Jump]()
    jumps_there = 0
    lost = area = 0.0
    reason = ""
    state = start
    for t_from, t_to in ((begin, end), (end, begin)):
        step = ContinuedStep(history, state, problem.load(t_to))
        if not step.run():
            reason = f"at t = {_between(step.t, t_from, t_to):g}: {step.reason}"
        for jump in step.jumps:
            t = float(_between(jump.t, t_from, t_to))
            jumps.append(jump._replace(ways=len(ways) + jump.ways, t=t))
        ways += [way._replace(t=_between(way.t, t_from, t_to)) for way in step.ways]
        if t_to == end:
            jumps_there = len(jumps)
        lost += step.now.released
        area += step.now.work
        state = step.now
        if reason:
            break
    largest_slip = max((float(np.max(np.abs(way.v))) for way in ways), default=0.0)
    difference = np.max(np.abs(state.v - start.v))
    closed = not reason and bool(difference <= MAX_CLOSING_ERROR * largest_slip)
    return Hysteresis(ways, jumps, jumps_there, lost, area, closed, reason), state


def _between(share: float | Array, begin: float, end: float) -> Array:
    return np.where(share == 1.0, end, begin + share * (end - begin))
