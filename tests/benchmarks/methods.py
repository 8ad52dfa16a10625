"""The methods that are compared, each with one signature: a problem and a start in, a point and a claim out.

Ours run as tcstudy.contact.contact runs them, with its last step `finish` on the identified pieces. The peers of scipy
get L̃ in units of c·(peak of b), one subgradient (right limits of b), the second derivatives where they take them,
and tolerances of 1e-10 or better with no limit of iterations. Every method is stopped at a deadline and then judged
by the best point it has seen.
"""

from __future__ import annotations

import time
import warnings
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

import numpy as np
import scipy.optimize
from numpy.typing import NDArray

from tcstudy.contact.active_set import polished
from tcstudy.contact.bundle.contact import solve_with_bundle
from tcstudy.contact.contact import solve_contact
from tcstudy.contact.problem import ContactProblem
from tcstudy.contact.status import Outcome, Status
from tests.benchmarks.semismooth import SemismoothNewton

Array = NDArray[np.float64]

TOLERANCE = 1e-10
"""Largest inclusion residual of a solution."""


@dataclass(frozen=True)
class Attempt:
    """One run from one start: the point, whether the method reports success, whether the deadline stopped it."""

    v: Array
    claims: bool
    out_of_time: bool = False


Run = Callable[[ContactProblem, Array, float], Attempt]
"""(problem, start, deadline on time.process_time) → attempt."""


@dataclass(frozen=True)
class Peer:
    """A method of the comparison under the name it has in the chart."""

    name: str
    run: Run


class OutOfTimeError(Exception):
    """The deadline has passed."""


@dataclass
class Best:
    """The point of lowest energy that a method has evaluated."""

    v: Array
    energy: float = np.inf


@dataclass(frozen=True)
class Watched(ContactProblem):
    """A contact problem with a deadline; it remembers the best point that a method asked the energy of."""

    deadline: float = np.inf
    best: Best = field(default_factory=lambda: Best(np.zeros(0)))

    def check(self) -> None:
        """Raise OutOfTimeError after the deadline."""
        if time.process_time() > self.deadline:
            raise OutOfTimeError

    def energy(self, v: Array) -> float:
        """L̃(v); raises OutOfTimeError after the deadline."""
        self.check()
        energy = super().energy(v)
        if energy < self.best.energy:
            self.best.v, self.best.energy = v.copy(), energy
        return energy


def watched(problem: ContactProblem, x0: Array, deadline: float) -> Watched:
    """The problem under watch from a start on."""
    return Watched(problem.A_tilde, problem.l_tilde, problem.c, problem.law, deadline=deadline, best=Best(x0))


def separable(problem: ContactProblem, x0: Array, deadline: float) -> Attempt:
    """Bundle-Newton with a bundle per node, from x0 alone; it is not stopped at the deadline."""
    answer = solve_contact(problem, branch="continued", neighbour=x0)
    return Attempt(answer.v, answer.status == Status.CONVERGED)


def default(problem: ContactProblem, x0: Array, deadline: float) -> Attempt:
    """The default as a study calls it, with all its starts and the search for less energy; it takes no start from here.

    It is not stopped at the deadline.
    """
    answer = solve_contact(problem)
    return Attempt(answer.v, answer.status == Status.CONVERGED)


def bundle(problem: ContactProblem, x0: Array, deadline: float) -> Attempt:
    """Bundle-Newton with one bundle for L̃."""
    return _finished(problem, lambda watch: solve_with_bundle(watch, x0), x0, deadline)


def _finished(problem: ContactProblem, run: Callable[[Watched], Outcome], x0: Array, deadline: float) -> Attempt:
    """As tcstudy.contact.contact ends: on the exact active pieces if the tolerance is missed, success by inclusion.

    What the deadline stops is not finished: that would credit the method with what it has not reached.
    """
    watch = watched(problem, x0, deadline)
    try:
        v = run(watch).x
    except OutOfTimeError:
        return Attempt(watch.best.v, False, out_of_time=True)
    residual = problem.inclusion_residual(v)
    if residual > TOLERANCE:
        v = polished(problem, v, exact=False).v
        residual = problem.inclusion_residual(v)
    return Attempt(v, residual <= TOLERANCE)


def semismooth(problem: ContactProblem, x0: Array, deadline: float) -> Attempt:
    """Primal–dual active set without globalisation; so short that it needs no deadline."""
    outcome = SemismoothNewton(tolerance=TOLERANCE).run(problem, x0)
    return Attempt(outcome.x, outcome.converged)


def scipy_method(name: str, options: Mapping[str, float], order: int) -> Run:
    """A method of scipy.optimize.minimize; order: derivatives that it is given."""

    def run(problem: ContactProblem, x0: Array, deadline: float) -> Attempt:
        watch = watched(problem, x0, deadline)
        unit, law, c = float(np.mean(problem.c)) * problem.traction_scale, problem.law, problem.c

        def value(v: Array) -> float:
            return watch.energy(v) / unit

        def value_and_gradient(v: Array) -> tuple[float, Array]:
            return value(v), (c * law.b(v) - problem.xi(v)) / unit

        def hessian(v: Array) -> Array:
            return (problem.A_tilde + np.diag(c * law.slope(v, law.piece(v)))) / unit

        derivatives = ({"jac": True} if order else {}) | ({"hess": hessian} if order > 1 else {})
        function = value_and_gradient if order else value
        try:
            with warnings.catch_warnings():  # what they warn of is in the success flag and in the residual
                warnings.simplefilter("ignore")
                found = scipy.optimize.minimize(function, x0, method=name, options=dict(options), **derivatives)
        except OutOfTimeError:
            return Attempt(watch.best.v, False, out_of_time=True)
        except (ValueError, np.linalg.LinAlgError):  # trust-exact breaks down on some nonsmooth steps
            return Attempt(watch.best.v, False)
        return Attempt(np.asarray(found.x, dtype=float), bool(found.success))

    return run


ENDLESS = 10**9

PEERS = (
    Peer("separable-newton", separable),
    Peer("bundle-newton", bundle),
    Peer("default", default),
    Peer("semismooth Newton", semismooth),
    Peer("BFGS", scipy_method("BFGS", {"gtol": TOLERANCE, "maxiter": ENDLESS}, 1)),
    Peer(
        "L-BFGS-B",
        scipy_method("L-BFGS-B", {"gtol": TOLERANCE, "ftol": 0.0, "maxiter": ENDLESS, "maxfun": ENDLESS}, 1),
    ),
    Peer("trust-exact", scipy_method("trust-exact", {"gtol": TOLERANCE, "maxiter": ENDLESS}, 2)),
    Peer(
        "Powell",
        scipy_method("Powell", {"xtol": 1e-12, "ftol": 1e-15, "maxiter": ENDLESS, "maxfev": ENDLESS}, 0),
    ),
)
"""All methods; the first three are ours."""
