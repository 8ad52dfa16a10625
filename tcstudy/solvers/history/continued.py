"""A load step along its exact path: what slides goes on sliding, what turns back starts a new part, what folds jumps.

Inside a step the load is l̃(t) = l̃ⁿ⁻¹ + t (l̃ⁿ − l̃ⁿ⁻¹), t from 0 to 1, with the laws that the last state gives. They hold
as long as no node takes back what it has done since: slipped, yielded or torn. So a step is a sequence of parts, each
with laws of its own and each a piece of a piecewise-linear path (solvers/path):
  1. A descent to the load a little further on finds the pieces on which every node goes on. The path through it is
     traced back to the state: where it ends elsewhere, no solution is near, and the state *jumps* there at once, with
     the energy that is released.
  2. Else the path is followed forward as long as it is stable; at a fold the next part begins with a jump.
  3. It is cut where the first node begins to take back what it has done: there the memory is updated.
Between vertices forces and slips are linear, so that work and dissipation are exact: closure is rounding.
Left out: exponential pieces, and bodies that only friction holds, whose Ã has no inverse (`substeps`).
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from tcstudy.solvers.contact import Answer, solve_contact
from tcstudy.solvers.history.rows import RememberedLaws, graph_of
from tcstudy.solvers.history.steps import Energies, HistoryProblem, HistoryStep, booked, proved
from tcstudy.solvers.loop import Status, iterate
from tcstudy.solvers.path.follow import Direction, Follower, ParametricProblem, Path
from tcstudy.solvers.path.vertex import NoSolutionError
from tcstudy.solvers.problem import ContactProblem
from tcstudy.solvers.separable.newton import SeparableNewton

Array = NDArray[np.float64]

AHEAD, DIGITS = 1e-6, 1e-10
"""Share of what is left of a step that a part looks ahead, and part of the load that it is at least."""
BACK = 0.5
"""The path back from there has ended elsewhere if it is this far from the state, relative to the way ahead."""
ROUNDING = 1e-11
"""Part of the largest slip that rounding may seem to take back, or to be apart."""
MOST_PARTS = 1000
ENDED = "the path inside the step ends at {share:.3g} of it: {reason}; write substeps: 8, or make more steps"


def continued(body: HistoryProblem, last: HistoryStep, load: Array) -> HistoryStep:
    """The step along its path, as `next_step` has it; one that cannot be followed fails with its reason."""
    step = _Step(body, last, load)
    while step.t < 1.0:
        if step.parts > MOST_PARTS or not step.go_on():
            reason = step.reason or f"more than {MOST_PARTS} times a node turns back or jumps"
            failed = ENDED.format(share=step.t, reason=reason)
            return replace(step.now, energies=step.energies, status=Status.STALLED, reason=failed)
    return step.finished()


class _Step:
    """The parts of one step so far.

    now: where the last part has ended, at the share t;  energies: of all parts;  pieces: of all paths
    """

    def __init__(self, body: HistoryProblem, last: HistoryStep, load: Array) -> None:
        self.body, self.last, self.load, self.change = body, last, load, load - last.load
        self.now, self.t, self.energies = last, 0.0, Energies()
        self.jumped = np.zeros(body.m, dtype=bool)
        self.parts = self.pieces = self.jumps = self.iterations = 0
        self.before, self.reason = last.state, ""

    def load_at(self, t: float) -> Array:
        return self.load if t == 1.0 else self.last.load + t * self.change

    def go_on(self) -> bool:
        """The next part or the next jump; False if there is none."""
        body, state = self.body, self.now.state
        self.parts += 1
        w = state.v - body.model.origin(state)
        ahead = self._ahead()
        problem = body.problem(state, self.load_at(ahead))
        found = self._descended(problem, w)
        if self._in_one_cell(problem, w, found):
            return True
        path = self._path(found, ahead, "forward")
        if path is None:
            return False
        self.pieces += path.pieces
        way, size = found - w, float(np.max(np.abs(path.u)))
        allowed = max(BACK * float(np.max(np.abs(way))), ROUNDING * size)
        if path.pieces and path.t[1] > path.t[0]:
            speed = (path.u[1] - path.u[0]) / (path.t[1] - path.t[0])
            if np.max(np.abs(way - (ahead - self.t) * speed)) <= allowed:
                return self._along(path)
        back = self._path(found, ahead, "backward")  # follows all that happens on the way, where much does
        if back is None:
            return False
        if np.max(np.abs(back.u[-1] - w)) > allowed:
            return self._jump(back)
        return self._along(path)

    def _descended(self, problem: ContactProblem, w: Array) -> Array:
        """Where descent from w ends, to rounding: a state that is nearly a solution is moved, too."""
        outcome = iterate(SeparableNewton(tolerance=1e-14, coarsest=0), problem, w)
        self.iterations += outcome.iterations
        return outcome.x

    def _in_one_cell(self, problem: ContactProblem, w: Array, found: Array) -> bool:
        """Whether all nodes stay on their pieces to the end of the step, which then is straight and is taken.

        The pieces of all nodes together are a convex cell in which the solution is linear in t.
        """
        law, model, state = problem.law, self.body.model, self.now.state
        end = replace(problem, l_tilde=problem.l_tilde + (self.load - self.load_at(self._ahead())))
        last = self._descended(end, found)
        same = np.array_equal(law.on_kink(found), law.on_kink(last)) and np.array_equal(
            law.piece(found), law.piece(last)
        )
        share = (self._ahead() - self.t) / (1.0 - self.t)
        straight = np.max(np.abs(w + share * (last - w) - found)) <= BACK * np.max(np.abs(found - w))
        grown = np.all(model.done(state, last) >= model.done(state, found))
        if not (same and grown and straight):
            return False
        answer = self._answer(last, 1.0)
        if answer.status != Status.CONVERGED:
            return False
        step = booked(self.body, self.now, self.load, answer, model.after(state, answer.v))
        self.energies += step.energies
        self.pieces += 1
        self._take(step, 1.0)
        return True

    def _ahead(self) -> float:
        """The share to look at: a little further, but not so little that rounding of the loads decides."""
        size = float(np.max(np.abs(self.load))) + float(np.max(np.abs(self.last.load)))
        share = max(AHEAD * (1.0 - self.t), DIGITS * size / float(np.max(np.abs(self.change))))
        return min(1.0, self.t + share)

    def _path(self, w: Array, t: float, direction: Direction) -> Path | None:
        """The path through w at t, backward to the present share or forward; None, with the reason, without one."""
        body, state = self.body, self.now.state
        origin, law = body.model.origin(state), body.model.next_law(state)
        begin = self.last.load - body.A_tilde @ origin
        problem = ParametricProblem(body.A_tilde, begin, self.change, body.c, law)
        if isinstance(law, RememberedLaws):
            vars(problem)["graph"] = graph_of(law)  # in place of one made law by law
        follower = Follower(self.t, 1.0, tolerance=body.tolerance, stable_only=True)
        try:
            return follower.follow(problem, w, t, direction)
        except (NoSolutionError, ValueError) as error:
            self.reason = str(error).partition("; ")[0]
            return None

    def _jump(self, path: Path) -> bool:
        """To the solution that the path back from the load ahead has led to."""
        body, state, t = self.body, self.now.state, float(path.t[-1])
        landed = self._answer(path.u[-1], t)
        if landed.status != Status.CONVERGED:
            self.reason = landed.reason
            return False
        step = booked(body, self.now, self.load_at(t), landed, body.model.after(state, landed.v))
        released = step.energies.closure
        self.energies += replace(step.energies, closure=0.0, released=released)
        moved = np.abs(step.state.v - state.v)
        self.jumped |= moved > ROUNDING * np.max(moved)
        self.jumps += 1
        self._take(step, t)
        return True

    def _along(self, path: Path) -> bool:
        """Forward to where the first node takes something back, or to the end of the path."""
        body, state = self.body, self.now.state
        last = self._first_return(path)
        t = float(path.t[last]) if last else self.t
        answer = self._answer(path.u[last], t)
        if answer.status != Status.CONVERGED:
            self.reason = answer.reason
            return False
        if not t > self.t:
            self.reason = path.end.reason
            return False
        begin = state.v - body.model.origin(state)
        ts = np.array([self.t, *path.t[1 : last + 1]])
        ws = np.array([begin, *path.u[1:last], answer.v])
        xi = np.array([self.now.xi, *path.traction[1:last] * body.c, answer.xi])
        slips, shares = np.diff(ws, axis=0), np.diff(ts)
        middle = 0.5 * (ws[1:] + ws[:-1]) + body.model.origin(state)
        way = -float(shares @ (middle @ self.change)), 0.5 * float(np.sum((xi[1:] + xi[:-1]) * slips))
        step = booked(body, self.now, self.load_at(t), answer, body.model.after(state, answer.v), way)
        self.energies += step.energies
        self._take(step, t)
        return True

    def _take(self, step: HistoryStep, t: float) -> None:
        self.before, self.now, self.t = self.now.state, step, t

    def _answer(self, w: Array, t: float) -> Answer:
        """w, judged as a solution at the share t."""
        problem = self.body.problem(self.now.state, self.load_at(t))
        return solve_contact(problem, tolerance=self.body.tolerance, branch="continued", neighbour=w)

    def _first_return(self, path: Path) -> int:
        """Vertex up to which nobody takes back anything: slips, plastic slips and openings only grow."""
        model, state = self.body.model, self.now.state
        rounding = ROUNDING * float(np.max(np.abs(path.u)))
        done = model.done(state, path.u[0])
        for vertex in range(1, path.pieces + 1):
            following = model.done(state, path.u[vertex])
            if np.any(following < done - rounding):
                return vertex - 1
            done = np.maximum(done, following)
        return path.pieces

    def finished(self) -> HistoryStep:
        """The whole step, with the certificates of its last part."""
        body, before = self.body, self.before
        problem = body.problem(before, self.load)
        answer = solve_contact(problem, tolerance=body.tolerance, branch="continued",
                               neighbour=self.now.state.v - body.model.origin(before))  # fmt: skip
        whole = replace(self.now, energies=self.energies, parts=self.pieces, iterations=self.iterations,
                        jumps=self.jumps, jumped=self.jumped)  # fmt: skip
        return proved(body, problem, answer, whole)
