"""One run of one method on one contact problem, with what its log says about why it failed.

All start from zero and, where the answer misses the tolerance, from the frictionless solution too; both share one
deadline. The first two run exactly as a study runs them. `path` follows the load from 0 to 1 and takes the solution of
least energy it meets there. The methods of scipy see L̃ as tests.benchmarks.methods describes it.
"""

from __future__ import annotations

import time
import warnings
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
import scipy.optimize
from numpy.typing import NDArray

from tcstudy.contact.contact import solve_contact
from tcstudy.contact.factors import cholesky
from tcstudy.contact.path.follow import Follower, ParametricProblem, PathStatus
from tcstudy.contact.path.query import solutions_at
from tcstudy.contact.problem import ContactProblem
from tcstudy.contact.status import Status
from tcstudy.laws.pieces import UP
from tests.benchmarks.methods import ENDLESS, TOLERANCE, OutOfTimeError, watched
from tests.benchmarks.semismooth import SemismoothNewton, solve_branches

Array = NDArray[np.float64]

OUT_OF_TIME = "time limit"
SNAP = 1e-6
"""Distance to a kink, relative to the kink spacing, within which a node of a scipy method counts as on it."""

CYCLING = "cycling"
INDEFINITE = "cycling, indefinite"
WANDERING = "wandering"
CRAWL = "node-by-node crawl"
NULL_STEPS = "null steps"
SHORT_STEPS = "shrinking steps"
AT_KINK = "stuck at a kink"
CANCELLATION = "cancellation"
FOLDS = "too many folds"
BRANCHES = "branches meet"
TIME = "time"
OTHER = "other"
"""Mechanisms of failure.

INDEFINITE: a cycle with matrices that have lost positive definiteness;  WANDERING: 200 steps without a return;
TIME: most steps were serious;  OTHER: of a scipy method, the nodes that miss the inclusion are not at kinks
"""


@dataclass(frozen=True)
class Trial:
    """An answer: v (m,) or None, whether the method reports success, iterations, why not, what the log shows.

    v_low: (m,) low part of an answer that is a sum of two doubles
    """

    v: Array | None
    claims: bool
    iterations: int
    reason: str = ""
    mechanism: str = ""
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


class Log:
    """Counts the kinds of steps in a method's log."""

    def __init__(self) -> None:
        self.kinds: list[str] = []

    def __call__(self, line: str) -> None:
        """Take one line of the log: iteration, …, kind of step somewhere among the words."""
        self.kinds += [word for word in line.split() if word.split("/")[0] in KINDS]

    def share(self, *kinds: str) -> float:
        """Share of these kinds among the second half of the steps."""
        last = Counter(self.kinds[len(self.kinds) // 2 :])
        return sum(last[kind] for kind in kinds) / max(last.total(), 1)


KINDS = ("start", "newton", "nodes", "straight", "refined", "escape", "serious", "null", "short", "reset")
"""Words for steps in the logs of both methods of the package."""


def separable(problem: ContactProblem, deadline: float) -> Trial:
    """The default solver as a study calls it, the lowest energy it finds; not stopped at the deadline."""
    log = Log()
    answer = solve_contact(problem, log=log)
    good = answer.status == Status.CONVERGED and not answer.limited  # what is limited by rounding is said to be
    rounding = answer.limited or answer.status == Status.INCLUSION_VIOLATED
    mechanism = "" if good else CANCELLATION if rounding else CRAWL if log.share("nodes") > 0.5 else OTHER
    return Trial(answer.v, good, answer.iterations, answer.reason, mechanism, v_low=answer.v_low)


def bundle(problem: ContactProblem, deadline: float) -> Trial:
    """The aggregate bundle-Newton method as a study calls it; its kinds of steps tell why it is slow."""
    log, watch = Log(), watched(problem, np.zeros(problem.m), deadline)
    try:
        answer = solve_contact(watch, "bundle-newton", branch="from-zero", log=log)
    except OutOfTimeError:
        return Trial(watch.best.v, False, len(log.kinds), OUT_OF_TIME, _bundle_mechanism(log), slow=True)
    good = answer.status == Status.CONVERGED and not answer.limited
    mechanism = "" if good else CANCELLATION if answer.limited else _bundle_mechanism(log)
    return Trial(answer.v, good, answer.iterations, answer.reason, mechanism, v_low=answer.v_low)


def _bundle_mechanism(log: Log) -> str:
    if log.share("null", "reset") > 0.5:
        return NULL_STEPS
    return SHORT_STEPS if log.share("short", "null", "reset") > 0.5 else TIME


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
    mechanism = "" if least <= TOLERANCE else CANCELLATION if best.converged else _cycle(problem, best.x)
    return Trial(best.x, best.converged, used, best.reason, mechanism)


def _cycle(problem: ContactProblem, v: Array) -> str:
    """Walk on from v until a branch set returns, and look whether a matrix on the way is indefinite."""
    method, seen, indefinite = SemismoothNewton(), set(), False
    branch = method.branches(problem, v)
    for _ in range(method.max_iterations):
        if branch.tobytes() in seen:
            return INDEFINITE if indefinite else CYCLING
        seen.add(branch.tobytes())
        free = np.flatnonzero(branch % 2 == 0)
        matrix = problem.A_tilde[np.ix_(free, free)]
        matrix[np.diag_indices(len(free))] += problem.c[free] * problem.law.q[branch[free] // 2]
        indefinite |= bool(len(free)) and cholesky(matrix)[1] != 0
        solved = solve_branches(problem, branch)
        if solved is None:
            return INDEFINITE
        branch = method.branches(problem, solved)
    return WANDERING


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
        return Trial(None, False, pieces, OUT_OF_TIME, FOLDS, slow=True)
    solutions = solutions_at(found, 1.0)
    if solutions:
        best = min(solutions, key=lambda solution: solution.energy)
        good = best.residual <= TOLERANCE
        return Trial(best.v, good, found.pieces, "", "" if good else CANCELLATION)
    status = found.end
    known = {PathStatus.PIECE_LIMIT: FOLDS, PathStatus.LOST_ACCURACY: CANCELLATION}
    return Trial(found.u[-1], False, found.pieces, found.end.reason, known.get(status, BRANCHES))


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
        mechanism = "" if least <= TOLERANCE else _scipy_mechanism(problem, best.v)
        return replace(best, iterations=used, mechanism=mechanism)

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


def _scipy_mechanism(problem: ContactProblem, v: Array) -> str:
    """AT_KINK if the worst node, or every node off the inclusion by half as much, is close to an up-jump."""
    law = problem.law
    distance = problem.distance(v, SNAP * law.s_scale)
    worst = distance >= 0.5 * distance.max()
    up = law.kinks[law.kinds == UP]
    near = np.min(np.abs(v[worst, None] - up), axis=1)
    return AT_KINK if np.median(near) <= 0.05 * law.s_scale else OTHER


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
