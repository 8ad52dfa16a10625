"""Bundle-Newton and its peers on the same contact problems: `python -m tests.benchmarks.peers`
writes results/peers.md.

Methods: ours run as tcstudy.contact.solve runs them. Those of scipy get L̃ in units of c·(peak of
b), one subgradient
         (right limits of b), second derivatives where they take them, and tolerances of 1e-10 or
         better without a
         limit of iterations. Each is stopped after LIMIT seconds and judged by the best point that
         it has seen
Starts:  zero and, where the answer misses the tolerance, the frictionless solution too; the better answer counts
         (a solution, else the lower energy), the time is that of both. (At zero every node sits on
         the kink, and a
         method that sees one subgradient may stop where it starts.)
Time:    CPU time of one thread; for fast solves the least of five runs, all methods taking turns
Judge:   inclusion residual with nodes within 1e-6 of the kink spacing counted as on the kink
Left out: a method leaves a family when it has used BUDGET seconds there, and larger problems when all its solves of
         the size before ran out of time. About eight minutes in all
"""

import os
import platform
import time
import warnings
from collections import defaultdict
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, field, replace

import numpy as np
import scipy.optimize
from numpy.typing import NDArray
from threadpoolctl import threadpool_info, threadpool_limits

from tcstudy.contact.bundle import solve_with_bundle
from tcstudy.contact.problem import ContactProblem, Status
from tcstudy.contact.solution import polished
from tcstudy.contact.solve import solve_contact
from tcstudy.data.files import package_versions
from tests.benchmarks.cases import Case, families, publish
from tests.benchmarks.semismooth import semismooth_newton

Array = NDArray[np.float64]

TOLERANCE, SNAP = 1e-10, 1e-6
"""Largest inclusion residual of a solution; distance that counts as on a kink, over the kink
spacing."""
LIMIT, BUDGET, FAST, REPEATS = 15.0, 8.0, 0.1, 5
"""Seconds for one solve, for a method in one family, and when and how often to repeat a fast
solve."""


@dataclass(frozen=True)
class Attempt:
    """One run from one start: the point, whether the method reports success, whether the deadline
    stopped it."""

    v: Array
    claims: bool
    out_of_time: bool = False


Run = Callable[[ContactProblem, Array, float], Attempt]
"""(problem, start, deadline on time.process_time) → attempt."""


class OutOfTimeError(Exception):
    """The deadline has passed."""


@dataclass(frozen=True)
class Watched(ContactProblem):
    """A contact problem with a deadline; best[-1] is the point of lowest energy that a method asked
    for."""

    deadline: float = np.inf
    best: list[tuple[float, Array]] = field(default_factory=list)

    def energy(self, v: Array) -> float:
        """L̃(v); raises OutOfTimeError after the deadline."""
        if time.process_time() > self.deadline:
            raise OutOfTimeError
        energy = super().energy(v)
        if energy < self.best[-1][0]:
            self.best.append((energy, v.copy()))
        return energy

    @property
    def late(self) -> Attempt:
        return Attempt(self.best[-1][1], False, out_of_time=True)


def watched(problem: ContactProblem, x0: Array, deadline: float) -> Watched:
    return Watched(
        problem.A_tilde,
        problem.l_tilde,
        problem.c,
        problem.law,
        deadline=deadline,
        best=[(np.inf, x0)],
    )


def separable(problem: ContactProblem, x0: Array, deadline: float) -> Attempt:
    """The default's descent from x0 alone; it is not stopped at the deadline."""
    answer = solve_contact(problem, branch="continued", neighbour=x0)
    return Attempt(answer.v, answer.status == Status.CONVERGED)


def default(problem: ContactProblem, x0: Array, deadline: float) -> Attempt:
    """The default as a study calls it, with all its own starts and the search for less energy; nor
    is it stopped."""
    answer = solve_contact(problem)
    return Attempt(answer.v, answer.status == Status.CONVERGED)


def bundle(problem: ContactProblem, x0: Array, deadline: float) -> Attempt:
    """Bundle-Newton with one bundle for L̃, finished on the exact active pieces if the tolerance is
    missed."""
    watch = watched(problem, x0, deadline)
    try:
        v = solve_with_bundle(watch, x0).x
    except (
        OutOfTimeError
    ):  # not finished: that would credit the method with what it has not reached
        return watch.late
    if problem.inclusion_residual(v) > TOLERANCE:
        v = polished(problem, v, exact=False).v
    return Attempt(v, problem.inclusion_residual(v) <= TOLERANCE)


def semismooth(problem: ContactProblem, x0: Array, deadline: float) -> Attempt:
    """Primal–dual active set without globalisation; so short that it needs no deadline."""
    v, stop = semismooth_newton(problem, x0)
    return Attempt(v, stop == "")


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
            with (
                warnings.catch_warnings()
            ):  # what they warn of is in the success flag and in the residual
                warnings.simplefilter("ignore")
                found = scipy.optimize.minimize(
                    function, x0, method=name, options=dict(options), **derivatives
                )
        except OutOfTimeError:
            return watch.late
        except (
            ValueError,
            np.linalg.LinAlgError,
        ):  # trust-exact breaks down on some nonsmooth steps
            return replace(watch.late, out_of_time=False)
        return Attempt(np.asarray(found.x, dtype=float), bool(found.success))

    return run


ENDLESS = 10**9
PEERS: dict[str, Run] = {
    "separable-newton": separable,
    "bundle-newton": bundle,
    "default": default,
    "semismooth Newton": semismooth,
    "BFGS": scipy_method("BFGS", {"gtol": TOLERANCE, "maxiter": ENDLESS}, 1),
    "L-BFGS-B": scipy_method(
        "L-BFGS-B", {"gtol": TOLERANCE, "ftol": 0.0, "maxiter": ENDLESS, "maxfun": ENDLESS}, 1
    ),
    "trust-exact": scipy_method("trust-exact", {"gtol": TOLERANCE, "maxiter": ENDLESS}, 2),
    "Powell": scipy_method(
        "Powell", {"xtol": 1e-12, "ftol": 1e-15, "maxiter": ENDLESS, "maxfev": ENDLESS}, 0
    ),
}
"""All methods; the first three are ours."""


@dataclass(frozen=True)
class Solve:
    """One method on one problem, judged; late: stopped at the deadline; lowest: nothing found less
    energy."""

    group: str
    method: str
    seconds: float
    claims: bool
    late: bool
    solved: bool
    lowest: bool


def attempt(run: Run, problem: ContactProblem) -> tuple[Attempt, float]:
    """(answer, CPU seconds) of one method from both starts."""
    begin, best, rank, late = time.process_time(), None, (True, np.inf), False
    for start in (np.zeros(problem.m), problem.frictionless()):
        tried = run(problem, start, begin + LIMIT)
        this = (not _residual(problem, tried.v) <= TOLERANCE, problem.energy(tried.v))
        if best is None or this < rank:
            best, rank = tried, this
        late |= tried.out_of_time
        if late or not rank[0]:
            break
    assert best is not None
    return Attempt(best.v, best.claims, late), time.process_time() - begin


def _residual(problem: ContactProblem, v: Array) -> float:
    return problem.inclusion_residual(v, SNAP * problem.law.s_scale)


def measure(groups: Iterable[list[Case]], repeats: int = REPEATS) -> Iterator[Solve]:
    """All methods on all problems in turns."""
    ends: dict[tuple[str, float], list[bool]] = defaultdict(list)
    for cases in groups:
        spent: dict[str, float] = defaultdict(float)
        for case in cases:
            problem, found = case.problem, dict[str, tuple[Attempt, float]]()
            for name, run in PEERS.items():
                smaller = [m for method, m in ends if method == name and m < problem.m]
                if spent[name] < BUDGET and not (smaller and all(ends[name, max(smaller)])):
                    found[name] = attempt(run, problem)
                    spent[name] += found[name][1]
                    ends[name, problem.m].append(found[name][0].out_of_time)
            for _ in range(repeats - 1):
                for name, (answer, seconds) in found.items():
                    if seconds <= FAST:
                        found[name] = answer, min(seconds, attempt(PEERS[name], problem)[1])
            energies = {name: problem.energy(answer.v) for name, (answer, _) in found.items()}
            least = min(energies.values())
            for name, (answer, seconds) in found.items():
                lowest = energies[name] - least <= 1e-9 * abs(least)
                solved = _residual(problem, answer.v) <= TOLERANCE
                yield Solve(
                    case.map, name, seconds, answer.claims, answer.out_of_time, solved, lowest
                )


def markdown(found: list[Solve], problems: int) -> Iterator[str]:
    """The measurements as a short Markdown table with what they were measured on."""
    groups = list(dict.fromkeys(one.group for one in found))
    yield f"Cells: solved/run (inclusion residual ≤ {TOLERANCE:.0e}), median time.\n"
    yield "| method | " + " | ".join([*groups, "of lowest energy", "false success"]) + " |"
    yield "|---" * (len(groups) + 3) + "|"
    for method in PEERS:
        own = [one for one in found if one.method == method]
        cells = []
        for group in groups:
            here = [one for one in own if one.group == group]
            time = float(np.median([one.seconds for one in here] or [0.0]))
            words = f"{1e3 * time:.2g} ms" if time < 0.0995 else f"{time:.2g} s"
            cells.append(f"{sum(one.solved for one in here)}/{len(here)}, {words}" if here else "–")
        good, claims = [one for one in own if one.solved], [one for one in own if one.claims]
        cells.append(f"{sum(one.lowest for one in good)}/{len(good)}")
        cells.append(f"{sum(not one.solved for one in claims)}/{len(claims)}")
        yield f"| {method} | " + " | ".join(cells) + " |"
    yield (
        f"\n{problems} problems; {sum(one.late for one in found)} solves stopped at {LIMIT:g} s, "
        f"{problems * len(PEERS) - len(found)} not run because the method had been too slow before (– where none was)."
    )
    yield (
        "m = …: half-Laplacian with slip weakening, ω/λ₁ = 0.5, 2 and 8 together; body: condensed rectangle, "
        "ω/λ₁ = 2. All start from zero and, if that fails, from the frictionless solution; *default* is "
        "separable-newton as a study calls it, from both and with the search for less energy."
    )
    yield (
        "*Of lowest energy*: of the solutions, those at the lowest energy that any method found. *False success*: of "
        "the answers called a success by the method, those that are no solution."
    )
    yield f"Measured on {machine()}."


def machine() -> str:
    """What of the machine and of packages decides the times; no names."""
    blas = [pool for pool in threadpool_info() if pool["user_api"] == "blas"]
    libraries = sorted({f"{pool['internal_api']} {pool['version']}" for pool in blas})
    versions = {
        "python": platform.python_version(),
        **package_versions(("numpy", "scipy", "ngsolve", "tcstudy")),
    }
    words = ", ".join(f"{name} {version}" for name, version in versions.items())
    return (
        f"{platform.machine()}, {os.cpu_count()} CPUs, {', '.join(libraries)}, one thread; {words}"
    )


def main() -> None:
    groups = list(families())  # loads every library before the limit on its threads
    with threadpool_limits(1, user_api="blas"):
        found = list(measure(groups))
    publish("peers", markdown(found, sum(map(len, groups))))


if __name__ == "__main__":
    main()
