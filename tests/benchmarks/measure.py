"""Run every method on every problem and judge the answers; the result is one xarray.Dataset.

Starts:  zero and, where the answer misses the tolerance, the frictionless solution too; the better answer counts
         (a solution, else the lower energy), the time is that of both. (At zero every node sits on the kink, and a
         method that sees one subgradient may stop where it starts.)
Time:    CPU time of one thread; for fast solves the least of five runs, all methods taking turns
Judge:   inclusion residual with nodes within 0, 1e-9 or 1e-6 of the kink spacing counted as on the kink; the same
         after `tcstudy.contact.active_set.finish`, given to every method; energy above the lowest of all methods
Limits:  a solve ends after `limit` seconds; a method leaves a family when it has used `budget` seconds there, and
         leaves out larger problems when all its solves of the size before ran out of time
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from tcstudy.contact.active_set import polished
from tcstudy.contact.problem import ContactProblem
from tests.benchmarks.methods import PEERS, TOLERANCE, Attempt, Peer
from tests.benchmarks.problems import Case

Array = NDArray[np.float64]

SNAPS = (0.0, 1e-9, 1e-6)
"""Distances to a kink, relative to the law's kink spacing, within which a node counts as on it."""

ENDS = ("not_run", "returned", "time_limit", "out_of_memory")
NOT_RUN, RETURNED, TIME_LIMIT, OUT_OF_MEMORY = range(4)


@dataclass(frozen=True)
class Limits:
    """Seconds for one solve, seconds for a method in one family, and when and how often to repeat a fast solve."""

    solve: float = 15.0
    budget: float = 8.0
    fast: float = 0.1
    repeats: int = 5


@dataclass(frozen=True)
class Answer:
    """A judged answer; see the variables of `dataset`."""

    time: float
    end: int
    claims: bool
    residual: tuple[float, ...]
    residual_finished: float
    energy: float
    energy_finished: float


@dataclass
class Ledger:
    """What every method has used so far."""

    limits: Limits
    seconds: dict[tuple[str, str], float] = field(default_factory=dict)
    ends: dict[tuple[str, int], list[int]] = field(default_factory=dict)

    def allows(self, peer: Peer, case: Case) -> bool:
        """True if there is time left in the family and the smaller problems of the kind did not all run out of it."""
        if self.seconds.get((peer.name, str(case.family)), 0.0) >= self.limits.budget:
            return False
        smaller = [m for name, m in self.ends if name == peer.name and m < case.family.m]
        return not smaller or any(end == RETURNED for end in self.ends[peer.name, max(smaller)])

    def book(self, peer: Peer, case: Case, seconds: float, end: int) -> None:
        """Enter a solve."""
        key = (peer.name, str(case.family))
        self.seconds[key] = self.seconds.get(key, 0.0) + seconds
        self.ends.setdefault((peer.name, case.family.m), []).append(end)


def attempt(peer: Peer, problem: ContactProblem, limit: float) -> tuple[Attempt, float, int]:
    """(answer, seconds, end) of one method from both starts."""
    begin = time.process_time()
    best, rank, end = None, (True, np.inf), RETURNED
    for start in (np.zeros, lambda _: problem.frictionless()):
        try:
            tried = peer.run(problem, start(problem.m), begin + limit)
        except MemoryError:
            end = OUT_OF_MEMORY
            break
        residual = problem.inclusion_residual(tried.v, SNAPS[-1] * problem.law.s_scale)
        this = (not residual <= TOLERANCE, problem.energy(tried.v))
        if best is None or this < rank:
            best, rank = tried, this
        if tried.out_of_time:
            end = TIME_LIMIT
        if not rank[0] or end != RETURNED:
            break
    return best or Attempt(np.zeros(problem.m), False), time.process_time() - begin, end


def judge(problem: ContactProblem, tried: Attempt, seconds: float, end: int) -> Answer:
    """Residuals and energies of an answer, as it is and finished."""
    spacing = problem.law.s_scale
    v = polished(problem, tried.v, exact=False).v
    return Answer(
        seconds,
        end,
        tried.claims,
        tuple(problem.inclusion_residual(tried.v, snap * spacing) for snap in SNAPS),
        problem.inclusion_residual(v),
        problem.energy(tried.v),
        problem.energy(v),
    )


def solve_all(case: Case, peers: Sequence[Peer], limits: Limits, ledger: Ledger) -> list[Answer | None]:
    """All methods on one problem in turns; None for a method that is not run."""
    tried, seconds = {}, {}
    for peer in peers:
        if ledger.allows(peer, case):
            tried[peer.name] = attempt(peer, case.problem, limits.solve)
            seconds[peer.name] = tried[peer.name][1]
            ledger.book(peer, case, *tried[peer.name][1:])
    for _ in range(limits.repeats - 1):
        for peer in peers:
            if seconds.get(peer.name, np.inf) <= limits.fast:
                seconds[peer.name] = min(seconds[peer.name], attempt(peer, case.problem, limits.solve)[1])
    return [
        judge(case.problem, tried[p.name][0], seconds[p.name], tried[p.name][2]) if p.name in tried else None
        for p in peers
    ]


def measure(
    families: Iterable[list[Case]],
    peers: Sequence[Peer] = PEERS,
    limits: Limits | None = None,
    progress: Callable[[str], None] = lambda line: None,
) -> xr.Dataset:
    """Solve everything; progress gets one line for a family."""
    limits = limits or Limits()
    ledger = Ledger(limits)
    found: list[tuple[Case, list[Answer | None]]] = []
    begin = time.perf_counter()
    for cases in families:
        rows = [solve_all(case, peers, limits, ledger) for case in cases]
        found += zip(cases, rows, strict=True)
        counts = (f"{p.name} {_count([row[i] for row in rows])}" for i, p in enumerate(peers))
        progress(f"{time.perf_counter() - begin:5.0f} s  {cases[0].family!s:36s} solved: {', '.join(counts)}")
    return dataset(found, peers, limits)


def _count(answers: list[Answer | None]) -> str:
    run = [a for a in answers if a is not None]
    return f"{sum(a.residual[-1] <= TOLERANCE for a in run)}/{len(run)}" if run else "–"


def dataset(found: list[tuple[Case, list[Answer | None]]], peers: Sequence[Peer], limits: Limits) -> xr.Dataset:
    """The measurements over (case, solver); NaN where a method was not run."""
    dims = ("case", "solver")

    def grid(value: Callable[[Answer], object], missing: object = np.nan) -> list[list[object]]:
        return [[missing if a is None else value(a) for a in row] for _, row in found]

    energies = np.array(grid(lambda a: min(a.energy, a.energy_finished)))
    lowest = np.nanmin(energies, axis=1)
    energy = np.array(grid(lambda a: a.energy))
    finished = np.array(grid(lambda a: a.energy_finished))
    gap, gap_finished = ((e - lowest[:, None]) / np.abs(lowest)[:, None] for e in (energy, finished))
    flags = {"flag_values": np.arange(len(ENDS), dtype="i1"), "flag_meanings": " ".join(ENDS)}
    residuals = np.array(grid(lambda a: a.residual, (np.nan,) * len(SNAPS)))
    return xr.Dataset(
        {
            "time": (dims, grid(lambda a: a.time), _about("CPU time of the solve", "s")),
            "residual": ((*dims, "snap"), residuals, _about("inclusion residual of the answer")),
            "residual_finished": (
                dims,
                grid(lambda a: a.residual_finished),
                _about("inclusion residual after Newton on the identified pieces"),
            ),
            "energy_gap": (dims, gap, _about("energy above the lowest one found, relative to it")),
            "energy_gap_finished": (dims, gap_finished, _about("energy gap after Newton on the identified pieces")),
            "claims": (dims, np.array(grid(lambda a: a.claims, 0), "i1"), _about("1 if the method reports success")),
            "end": (dims, np.array(grid(lambda a: a.end, NOT_RUN), "i1"), _about("how the solve ended") | flags),
            "lowest_energy": ("case", lowest, _about("lowest energy found by any method")),
        },
        {
            "solver": ("solver", [p.name for p in peers], {"long_name": "method"}),
            "family": ("case", [case.family.name for case, _ in found], {"long_name": "stiffness and law"}),
            "m": ("case", [case.family.m for case, _ in found], _about("contact nodes")),
            "ratio": ("case", [case.family.ratio for case, _ in found], _about("omega / lambda_1")),
            "load": ("case", [case.load for case, _ in found], _about("number of the random load")),
            "snap": ("snap", list(SNAPS), _about("distance that counts as on a kink, relative to the kink spacing")),
        },
        {"time_limit": limits.solve, "family_budget": limits.budget, "tolerance": TOLERANCE},
    )


def _about(long_name: str, units: str = "1") -> dict[str, object]:
    return {"long_name": long_name, "units": units}
