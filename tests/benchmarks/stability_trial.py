"""One run of one method on one contact problem.

All start from zero and, where the answer misses the tolerance, from the frictionless solution too; both share one
deadline. The first two run exactly as a study runs them. `path` follows the load from 0 to 1 and takes the solution of
least energy it meets there. The methods of scipy see L̃ as tests.benchmarks.methods describes it.
"""

from __future__ import annotations

import time
import warnings
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
import scipy.optimize
from numpy.typing import NDArray

from tcstudy.contact.block import Answer
from tcstudy.contact.contact import solve_contact
from tcstudy.contact.path.follow import Follower, ParametricProblem
from tcstudy.contact.path.query import solutions_at
from tcstudy.contact.problem import ContactProblem
from tcstudy.contact.status import Status
from tests.benchmarks.methods import ENDLESS, TOLERANCE, OutOfTimeError, watched
from tests.benchmarks.semismooth import SemismoothNewton

Array = NDArray[np.float64]

OUT_OF_TIME = "time limit"
SNAP = 1e-6
"""Distance to a kink, relative to the kink spacing, within which a node of a scipy method counts as on it."""


@dataclass(frozen=True)
class Trial:
    """An answer: v (m,) or None, whether the method reports success, iterations, why not.

    v_low: (m,) low part of an answer that is a sum of two doubles
    """

    v: Array | None
    claims: bool
    iterations: int
    reason: str = ""
    slow: bool = False
    snap: float = 0.0
    v_low: Array | None = None


Run = Callable[[ContactProblem, float], Trial]
"""(problem, deadline on time.process_time) → trial."""


@dataclass(frozen=True)
class Contender:
    """A method of the map. heavy: one load a cell is enough where m > 100."""

    name: str
    run: Run
    heavy: bool = True


def separable(problem: ContactProblem, deadline: float) -> Trial:
    """The default solver as a study calls it, the lowest energy it finds; not stopped at the deadline."""
    return _answered(solve_contact(problem))


def bundle(problem: ContactProblem, deadline: float) -> Trial:
    """The aggregate bundle-Newton method as a study calls it."""
    watch = watched(problem, np.zeros(problem.m), deadline)
    try:
        return _answered(solve_contact(watch, "bundle-newton", branch="from-zero"))
    except OutOfTimeError:
        return Trial(watch.best.v, False, 0, OUT_OF_TIME, slow=True)


def _answered(answer: Answer) -> Trial:
    good = answer.status == Status.CONVERGED and not answer.limited  # what is limited by rounding is said to be
    return Trial(answer.v, good, answer.iterations, answer.reason, v_low=answer.v_low)


def semismooth(problem: ContactProblem, deadline: float) -> Trial:
    """Primal–dual active set without globalisation."""
    used, best, least = 0, None, np.inf
    for start in (np.zeros(problem.m), problem.frictionless()):
        outcome = SemismoothNewton(tolerance=TOLERANCE).run(problem, start)
        used += outcome.iterations
        residual = problem.inclusion_residual(outcome.x)
        if best is None or residual < least:
            best, least = outcome, residual
        if residual <= TOLERANCE or time.process_time() > deadline:
            break
    assert best is not None
    return Trial(best.x, best.converged, used, best.reason)


def path(problem: ContactProblem, deadline: float) -> Trial:
    """Follow the load from 0 (no displacement is a solution) to 1; iterations are pieces."""
    pieces = 0

    def watch(count: int, t: float) -> None:
        nonlocal pieces
        pieces = count
        if time.process_time() > deadline:
            raise OutOfTimeError

    zero = np.zeros(problem.m)
    along = ParametricProblem(problem.A_tilde, zero, problem.l_tilde, problem.c, problem.law)
    try:
        found = Follower(t_min=0.0, t_max=1.0).follow(along, zero, 0.0, "forward", watch)
    except OutOfTimeError:
        return Trial(None, False, pieces, OUT_OF_TIME, slow=True)
    solutions = solutions_at(found, 1.0)
    if solutions:
        best = min(solutions, key=lambda solution: solution.energy)
        return Trial(best.v, best.residual <= TOLERANCE, found.pieces)
    return Trial(found.u[-1], False, found.pieces, found.end.reason)


def scipy_run(name: str, options: dict[str, float], second_order: bool = False) -> Run:
    """A method of scipy.optimize.minimize."""

    def run(problem: ContactProblem, deadline: float) -> Trial:
        best, least, used = Trial(None, False, 0, snap=SNAP), np.inf, 0
        for start in (np.zeros(problem.m), problem.frictionless()):
            one = _minimize(problem, start, deadline, name, options, second_order)
            used += one.iterations
            assert one.v is not None
            residual = problem.inclusion_residual(one.v, SNAP * problem.law.s_scale)
            if residual < least or best.v is None:
                best, least = one, residual
            if least <= TOLERANCE or one.slow:
                best = replace(best, slow=one.slow and least > TOLERANCE)
                break
        assert best.v is not None
        return replace(best, iterations=used)

    return run


def _minimize(
    problem: ContactProblem, start: Array, deadline: float, name: str, options: dict[str, float], second_order: bool
) -> Trial:
    """One run from one start, with energies in units of c·(peak of b) as tests.benchmarks.methods gives them."""
    watch, law, c = watched(problem, start, deadline), problem.law, problem.c
    unit = float(np.mean(c)) * problem.traction_scale

    def value_and_gradient(v: Array) -> tuple[float, Array]:
        return watch.energy(v) / unit, (c * law.b(v) - problem.xi(v)) / unit

    def hessian(v: Array) -> Array:
        return (problem.A_tilde + np.diag(c * law.slope(v, law.piece(v)))) / unit

    extra = {"hess": hessian} if second_order else {}
    try:
        with warnings.catch_warnings():  # what they warn of is in the success flag and in the residual
            warnings.simplefilter("ignore")
            found = scipy.optimize.minimize(value_and_gradient, start, method=name, jac=True, options=options, **extra)
    except OutOfTimeError:
        return Trial(watch.best.v, False, 0, OUT_OF_TIME, slow=True, snap=SNAP)
    except (ValueError, np.linalg.LinAlgError) as error:  # trust-exact breaks down on some nonsmooth steps
        return Trial(watch.best.v, False, 0, str(error).splitlines()[0], snap=SNAP)
    v = np.asarray(found.x, dtype=float)
    return Trial(v, bool(found.success), int(found.nit), str(found.message), snap=SNAP)


LIMITED_MEMORY = {"gtol": TOLERANCE, "ftol": 0.0, "maxiter": ENDLESS, "maxfun": ENDLESS}

CONTENDERS = (
    Contender("separable-newton", separable, heavy=False),
    Contender("bundle-newton", bundle),
    Contender("semismooth Newton", semismooth),
    Contender("path", path),
    Contender("BFGS", scipy_run("BFGS", {"gtol": TOLERANCE, "maxiter": ENDLESS})),
    Contender("L-BFGS-B", scipy_run("L-BFGS-B", LIMITED_MEMORY)),
    Contender("trust-exact", scipy_run("trust-exact", {"gtol": TOLERANCE, "maxiter": ENDLESS}, second_order=True)),
)
"""All methods of the map; the first is the default, bundle-Newton with a bundle per node (disaggregated)."""
