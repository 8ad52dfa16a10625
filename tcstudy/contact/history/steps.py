"""A load history one step after the other, each along its exact path or to the lowest state of its
contact problem.

Along its path what slides goes on sliding, what turns back starts a new part, what folds jumps.
Inside a step the load is l̃(t) = l̃ⁿ⁻¹ + t (l̃ⁿ − l̃ⁿ⁻¹), t from 0 to 1, with the laws that the
last state gives. They hold as long as no node takes back what it has done since: slipped, yielded
or torn. So a step is a sequence of parts, each with laws of its own and each a piece of a
piecewise-linear path (contact/path):
  1. From the state the path is followed on the stable way on which t grows, up to a fold, or to
    where the first node
     begins to take back what it has done: there the memory is updated. All parts of a step share
     one inverse.
  2. Where there is no such way, a descent to the load a little further on finds what comes next.
    The path through it
     is traced back: where it ends elsewhere, no solution is near, and the state *jumps* there at
     once, with the energy
     that is released. Else the path through it leads on.
Between vertices forces and slips are linear, so that work and dissipation are exact: closure is
rounding. In the place of exponential pieces the path has straight ones (memory.py). At the end of
every part the law's own solution is found beside it, at a fold the law's own (path/smooth.py), and
what friction takes on the way there has a closed form: states and energies are exact.

Loop: of a bond that remembers nothing the state follows its stable branch and falls off it at
folds. With the load l̃₀ + t l̃₁ the work of a step is −∫W dt, W = l̃₁ᵀv: of a closed loop it is its
area in the plane of t and W, and all of it is lost at the jumps.
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
    booked,
    proved,
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

AHEAD, DIGITS = 1e-6, 1e-10
"""Share of what is left of a step that a part looks ahead, and part of the load that it is at
least."""
BACK = 0.5
"""The path back from there has ended elsewhere if it is this far from the state, relative to the
way ahead."""
ASIDE = 0.05
"""The law's own solution lies beside that of straight pieces if it is nearer than this part of the
way to it."""
ROUNDING = 1e-11
"""Part of the largest slip that rounding may seem to take back, or to be apart."""
MOST_PARTS = 1000
UPHILL = (
    "no state of less energy is found beyond a fold: the next one found has {gain:.2g} J/m more"
)
HIDDEN = "the law's own way is not the one along straight pieces in the place of its curve"
ENDED = "the path inside the step ends at {share:.3g} of it: {reason}; make more steps"


class Way(NamedTuple):
    """Vertices of a part: shares t (k,), slips v (k, m) [m], tractions ξ/c (k, m) [Pa]."""

    t: Array
    v: Array
    xi: Array


class Jump(NamedTuple):
    """After so many ways, at the share t, from v to another state of less energy [J/m]."""

    ways: int
    t: float
    v_from: Array
    v_to: Array
    released: float


def continued(history: HistoryProblem, last: HistoryStep, load: Array) -> HistoryStep:
    """The step along its path, as `next_step` has it; one that cannot be followed fails with its
    reason."""
    step = ContinuedStep(history, last, load)
    if not step.run():
        reason = ENDED.format(share=step.t, reason=step.reason)
        return replace(step.now, status=Status.STALLED, reason=reason)
    assert step.judged is not None
    return proved(history, *step.judged, replace(step.now, iterations=step.iterations))


class ContinuedStep:
    """One step while it is followed, in parts; each in w = v − a (memory.py), with the laws that
    its first state gives.

    now:   all parts together up to the share t;  ways, jumps: what they went through
    rest:  (m,) what a load is more in terms of w;  law: of the part
    problem: the same over the shares of the step, with straight pieces in the place of exponential ones
    beyond: (m,) slips a little beyond the end of the last path;  fold: share up to which no way leads on
    senses: (m,) in which nodes between two pieces of their graphs went on last
    """

    origin: Array
    w: Array
    rest: Array
    law: Laws
    problem: ParametricProblem

    def __init__(self, history: HistoryProblem, last: HistoryStep, load: Array) -> None:
        self.history, self.body, self.straight = (
            history,
            history.body,
            history.model.law.piecewise_linear,
        )
        self.last, self.load, self.change = last, load, load - last.load
        self.now, self.t = last.unchanged(), 0.0
        self.ways, self.jumps = list[Way](), list[Jump]()
        self.iterations = 0
        self.judged: tuple[ContactProblem, Answer] | None = None
        self.reason, self.beyond, self.fold = "", last.v, 0.0
        self.basis: BasisInverse | None = None
        on = 1.0 if float(np.sign(last.xi) @ self.change) >= 0.0 else -1.0
        self.senses = np.where(last.xi == 0.0, np.sign(self.change), on * np.sign(last.xi))

    def run(self) -> bool:
        """Part after part and jump after jump to the load; False where none leads on, with the
        reason."""
        for _ in range(MOST_PARTS):
            self._set_out()
            path = None
            if self.fold <= self.t:
                path = self._onward()
            if not ((path is not None and self._along(path)) or self._elsewhere()):
                return False
            if self.t == 1.0:
                return True
        self.reason = f"more than {MOST_PARTS} times a node turns back or jumps"
        return False

    def load_at(self, t: float) -> Array:
        """l̃ at the share t (m,)."""
        return self.load if t == 1.0 else self.last.load + t * self.change

    def _set_out(self) -> None:
        """Let the next part begin at the present state.

        A stiff body makes much of a slip's last digit: forces that rounding alone takes off their
        limits, outside or inside, are put on them, as no path would begin at the state, or all go
        back to its first vertex.
        """
        A, c, now, model = self.body.A_tilde, self.body.c, self.now, self.history.model
        self.origin = model.origin(now)
        self.w, self.law = now.v - self.origin, model.next_law(now)
        xi, size = now.load - A @ now.v, np.abs(now.load) + np.abs(A) @ np.abs(now.v)
        low, high = (c * limit - xi for limit in self.law.interval(self.w))
        apart = np.where(np.abs(low) < np.abs(high), low, high)
        rounding = 8.0 * np.sqrt(self.body.m) * np.finfo(float).eps * size
        self.rest = np.where(np.abs(apart) <= rounding, apart, 0.0) - A @ self.origin
        law = self.law if self.straight else model.next_law(now, straight=True)
        self.problem = ParametricProblem(A, self.last.load + self.rest, self.change, c, law)
        vars(self.problem)["body"] = self.history.scaled  # the same in all parts and steps

    def _at(self, t: float) -> ContactProblem:
        """The part's problem with the law itself."""
        return ContactProblem.on(self.body, self.load_at(t) + self.rest, self.law)

    def _answer(self, w: Array, t: float) -> Answer:
        """w, judged as a solution at the share t."""
        problem, tolerance = self._at(t), self.history.tolerance
        answer = as_it_is(problem, w, tolerance) if self.straight else None
        answer = answer or solve_contact(
            problem, tolerance=tolerance, branch="continued", neighbour=w
        )
        self.judged = problem, answer
        return answer

    @property
    def _follower(self) -> Follower:
        one_way, most = self.history.model.remembers, self.history.max_pieces
        return Follower(
            self.t, 1.0, most, self.history.tolerance, stable_only=True, one_way=one_way
        )

    def _onward(self) -> Path | None:
        """The path from the state, as far as it is stable and nobody turns back; None without
        one."""
        try:
            walk = locate(self.problem, self.w, self.t, self.senses, self.basis)
        except (ValueError, SingularCellError) as error:
            self.reason = str(error).partition("; ")[0]
            return None
        self.basis = walk.basis
        path = self._follower.onward(
            walk, falling=not self.straight
        )  # the law may go on where no chord does
        self.senses = walk.graph.sense[walk.codes] * np.sign(walk.dx[:-1])
        if path is None:
            return None
        if (
            path.end == PathStatus.TURNS and path.pieces
        ):  # what turns back takes none with it: they go on
            moved, pushed = path.u[-1] - path.u[-2], path.traction[-1] - path.traction[-2]
            self.senses = np.sign(np.where(moved != 0.0, moved, pushed))
        over = (
            path.u[-1] if path.end != PathStatus.UNSTABLE else 0.5 * (path.u[-1] + path.u[-2])
        )  # there energy falls
        self.beyond = self.origin + over
        return path

    def _along(self, path: Path, lead: Path | None = None) -> bool:
        """Forward to the end of the path.

        lead: the path back from its beginning to the state

        Along the graph of b ∫ξᵀdv = Σ c (j(w₁) − j(w₀)) whatever the curve, and what straight
        pieces miss of that they miss of the work as well: between the same ends each balances ΔE.
        Where they miss much the law goes elsewhere.
        """
        p, c, reached = self.problem, self.body.c, self._reached(path)
        if reached is None:
            return False
        t, w, answer = reached
        end, parts = float(t[-1]), len(t) - 1
        if lead is not None:
            t, w = (np.concatenate([x[:1], y[::-1], x[1:]]) for x, y in ((t, lead.t), (w, lead.u)))
        balance = p.l_0 + t[1:-1, None] * p.l_1 - w[1:-1] @ p.A_tilde
        xi = np.array([c * self.now.xi, *balance, answer.xi])
        slips, middle = np.diff(w, axis=0), 0.5 * (w[1:] + w[:-1]) + self.origin
        work, friction = (
            -float(np.diff(t) @ (middle @ self.change)),
            0.5 * float(np.sum((xi[1:] + xi[:-1]) * slips)),
        )
        if not self.straight:
            missed = float(c @ self.law.integral(w[0], answer.v)) - friction
            if abs(missed) > 4.0 * LAW_ERROR * self.history.model.law.b_scale * float(
                np.sum(np.abs(slips) @ c)
            ):
                self.reason = HIDDEN
                return False
            work, friction = work + missed, friction + missed
        part = booked(self.history, self.now, self.load_at(end), answer, (work, friction))
        self.now, self.t = self.now.then(replace(part, parts=parts)), end
        self.ways.append(Way(t, self.origin + w, xi / c))
        return True

    def _reached(self, path: Path) -> tuple[Array, Array, Answer] | None:
        """Shares and slips from the state to the last vertex beside which the law itself has a
        solution, and that; None without one, with the reason.

        That is where the law folds beside the end. Straight pieces in the place of a curve may fold
        a little later than it does: short of that the part ends.
        """
        falls = path.end == PathStatus.UNSTABLE
        last, law = len(path.t) - 1 - falls, self.history.model.law
        slip = law.b_scale * float(np.max(self.body.c / np.diagonal(self.body.A_tilde)))
        fold = fold_beside(path, self.law, law.s_scale) if falls and not self.straight else None
        if fold is not None:
            answer, at = (
                self._answer(fold[1], fold[0]),
                int(np.searchsorted(path.t[: last + 1], fold[0])),
            )
            if answer.status == Status.CONVERGED and np.array_equal(answer.v, fold[1]):
                self.fold = float(np.nextafter(fold[0], 2.0))
                return (
                    np.array([self.t, *path.t[1:at], fold[0]]),
                    np.array([self.w, *path.u[1:at], answer.v]),
                    answer,
                )
        self.reason = path.end.reason
        if not path.t[last] > self.t:
            return None
        steps = [
            2**k
            for k in range(20)
            if 2**k < last and path.t[last - 2**k] > self.t and not self.straight
        ]
        for back in (0, *steps):
            at = last - back
            answer = self._answer(path.u[at], float(path.t[at]))
            way, off = np.max(np.abs(path.u[at] - path.u[0])), np.max(np.abs(answer.v - path.u[at]))
            near = self.straight or off <= ASIDE * way + 30.0 * LAW_ERROR * slip
            if near and answer.status == Status.CONVERGED:
                break
        self.fold = float(path.t[last]) if falls or back else 0.0
        if near and answer.status == Status.CONVERGED:
            return (
                np.array([self.t, *path.t[1:at], path.t[at]]),
                np.array([self.w, *path.u[1:at], answer.v]),
                answer,
            )
        self.reason = answer.reason if near else self.reason if self.fold else HIDDEN
        return None

    def _elsewhere(self) -> bool:
        """By a descent to the load a little further on, where the path does not lead on by
        itself."""
        size = float(np.max(np.abs(self.load))) + float(np.max(np.abs(self.last.load)))
        share = max(AHEAD * (1.0 - self.t), DIGITS * size / float(np.max(np.abs(self.change))))
        ahead, self.fold, w = min(1.0, self.t + share + max(0.0, self.fold - self.t)), 0.0, self.w
        problem, beyond = self.problem.at(ahead), self.beyond - self.origin
        falls = problem.energy_change(w, beyond)[0] < 0.0
        begin = beyond if falls else w  # who turned back rests: it may bar the way beyond
        found, steps = nearest_minimum(problem, begin, 1e-14, over_barriers=False)
        self.iterations += steps
        try:
            back = replace(self._follower, one_way=False).follow(
                self.problem, found, ahead, "backward"
            )
        except ValueError as error:
            self.reason = str(error).partition("; ")[0]
            return False
        stable = slice(back.pieces + (back.end != PathStatus.UNSTABLE))  # vertices
        back = replace(back, t=back.t[stable], u=back.u[stable])
        allowed = max(
            BACK * float(np.max(np.abs(found - w))), ROUNDING * float(np.max(np.abs(back.u)))
        )
        if np.max(np.abs(back.u[-1] - w)) > allowed:
            return self._jump(back)
        if self._along(self._follower.follow(self.problem, found, ahead, "forward"), back):
            self.beyond = self.now.v
            return True
        if self.reason == HIDDEN:
            return self._jump(back)
        return self.fold > ahead and self._elsewhere()  # straight pieces may fold later still

    def _jump(self, path: Path) -> bool:
        """To the solution to which the path back from the load ahead leads, or ahead if only that
        gains.

        Where the energy of the step is convex no state lets go: what looks like a jump is rounding,
        and counts as none.
        """
        now, A, c = self.now, self.body.A_tilde, self.body.c
        for vertex in (-1, 0):
            t = float(path.t[vertex])
            landed = self._answer(path.u[vertex], t)
            if landed.status != Status.CONVERGED:
                self.reason = landed.reason
                return False
            change = (
                self.load_at(t) - now.load
            )  # at rest until then: at the fold, but for straight pieces
            drop = 0.5 * float((landed.xi + c * now.xi + change) @ (self.origin + landed.v - now.v))
            part = booked(
                self.history, now, self.load_at(t), landed, (-float(now.v @ change), drop)
            )
            moved = np.abs(part.v - now.v)
            if part.closure > 0.0 and np.max(moved) > ROUNDING * np.max(
                np.abs(part.v)
            ):  # not the state itself
                break
        size = np.abs(part.load) + np.abs(A) @ np.abs(part.v)
        rounding = np.sqrt(self.body.m) * np.finfo(float).eps * float(size @ moved)
        if part.closure < -rounding:
            self.reason = UPHILL.format(gain=-part.closure)
            return False
        if part.closure > rounding and not self._held():
            jumped = moved > ROUNDING * np.max(moved)
            part = replace(part, closure=0.0, released=part.closure, jumps=1, jumped=jumped)
            self.jumps.append(Jump(len(self.ways), t, now.v, part.v, part.released))
        self.now, self.t, self.beyond = now.then(replace(part, parts=0)), t, part.v
        return True

    def _held(self) -> bool:
        """Whether the state is a solution of the part and the only one: just behind a down-jump it
        is none."""
        problem = self._at(self.t)
        residual, rounding = problem.inclusion_residual(self.w), problem.xi_rounding(self.w)
        solved = Acceptance(self.history.tolerance).accepts(residual, rounding)
        return solved and self.history.one_solution(self.law)


MOST_CYCLES = 3
"""How often the loop is driven for it to close; the last cycle is returned."""
CLOSED = 1e-9
"""Of the largest slip, by which the end of a closed cycle may differ from its begin."""


def history(
    problem: HistoryProblem, loads: Iterable[Array], start: HistoryStep | None = None
) -> Iterator[HistoryStep]:
    """The steps to these loads l̃ (m,), one after the other; a step that fails is the last.

    start: the step after which to begin, by default the virgin body without loads
    """
    last = HistoryStep.virgin(problem.body.m) if start is None else start
    for load in loads:
        last = next_step(problem, last, np.asarray(load, dtype=float))
        yield last
        if not last.solved:
            return


def next_step(history: HistoryProblem, last: HistoryStep, load: Array) -> HistoryStep:
    """The step from `last` to a load; loads that do not change change nothing, to the bit."""
    if np.array_equal(load, last.load):
        return last.unchanged()
    if (
        history.branch == "continued" and not history.model.law.vanishes
    ):  # else nothing is remembered, no path has a scale
        return continued(history, last, load)
    return lowest(history, last, load)


def lowest(history: HistoryProblem, last: HistoryStep, load: Array) -> HistoryStep:
    """The state of least energy that is found of the step's one contact problem in w = v − a.

    A body that lies loose while all its nodes slide is solved from the minimum of the convex model.
    """
    body, tolerance, a = history.body, history.tolerance, history.model.origin(last)
    problem = ContactProblem.on(
        body, load - body.A_tilde @ a if np.any(a) else load, history.model.next_law(last)
    )
    branch: Branch = "continued" if history.convex or history.monotone else "lowest"
    answer = solve_contact(problem, tolerance=tolerance, branch=branch, neighbour=last.v - a)
    failed = answer.status == Status.NOT_POSITIVE_DEFINITE
    if failed and (begin := convex_step(problem, last.v - a)) is not None:
        again = solve_contact(problem, tolerance=tolerance, branch="continued", neighbour=begin)
        answer = replace(again, iterations=again.iterations + answer.iterations)
    step = booked(history, last, load, answer)
    return proved(history, problem, answer, step) if step.solved else step


class Hysteresis(NamedTuple):
    """One cycle of t, there and back.

    ways:   stable branches in order, with t in the place of shares;  jumps: falls between them, likewise
    there:  how many of these belong to the way there
    lost:   energy lost at the jumps;  area: −∮W dt, the same if the loop is closed [J/m]
    closed: the cycle ends in the solution in which it began
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
    """The loop from the stable solution v (m,) of t = begin to end and back: the first cycle that
    closes.

    max_pieces, tolerance: as of a `Follower`
    Where it falls to is decided by energy descent from the fold, which is a rule, not mechanics:
    inertia might carry
    the body past a shallow minimum. Raises ValueError for an empty range.
    """
    if begin == end:
        raise ValueError(f"the loop begins and ends at t = {begin:g}; give it a range")
    body = CondensedBody.known(problem.A_tilde, problem.c, problem.A_error)
    history = HistoryProblem(
        body,
        MemoryModel(Memory("none"), problem.law, problem.m),
        tolerance=tolerance,
        max_pieces=max_pieces,
    )
    load = problem.load(begin)
    last = replace(
        HistoryStep.virgin(problem.m),
        v=v,
        load=load,
        xi=problem.at(begin).xi(v) / problem.c,
        stored=float(problem.c @ problem.law.j(v)),
        energy=history.energy(v, load),
    )
    for _ in range(MOST_CYCLES):
        first, ways, jumps, there, lost, area = last, list[Way](), list[Jump](), 0, 0.0, 0.0
        for one, other in ((begin, end), (end, begin)):
            step = ContinuedStep(history, last, problem.load(other))
            reason = "" if step.run() else f"at t = {_between(step.t, one, other):g}: {step.reason}"
            for jump in step.jumps:
                jumps.append(
                    jump._replace(ways=len(ways) + jump.ways, t=float(_between(jump.t, one, other)))
                )
            ways += [way._replace(t=_between(way.t, one, other)) for way in step.ways]
            there = len(jumps) if other == end else there
            lost, area = lost + step.now.released, area + step.now.work
            last = step.now
            if reason:
                break
        size = max((float(np.max(np.abs(way.v))) for way in ways), default=0.0)
        closed = not reason and bool(np.max(np.abs(last.v - first.v)) <= CLOSED * size)
        if closed or reason:
            break
    return Hysteresis(ways, jumps, there, lost, area, closed, reason)


def _between(share: float | Array, begin: float, end: float) -> Array:
    return np.where(share == 1.0, end, begin + share * (end - begin))
