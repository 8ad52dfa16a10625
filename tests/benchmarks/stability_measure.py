"""Run the methods over the maps, judge every answer by a check that shares no code with the package, keep rows.

solved   inclusion residual ≤ 1e-10 (scipy's: nodes within 1e-6 of the kink spacing count as on the kink)
flagged  no solution, and the method says so
silent   no solution, but the method reports success
slow     stopped at the time limit
left out not run: m > 100 after the first load, or the method was slow on all smaller problems of the map
"""

from __future__ import annotations

import csv
import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, fields
from pathlib import Path

import numpy as np

from tests.benchmarks.methods import TOLERANCE
from tests.benchmarks.stability_maps import Case
from tests.benchmarks.stability_trial import CONTENDERS, Contender, Trial
from tests.contact.contact_cases import independent_residual

SOLVED, FLAGGED, SILENT, SLOW, LEFT_OUT = "solved", "flagged", "silent", "slow", "left out"

REASON = 48
"""Letters of a method's reason that are kept."""


@dataclass(frozen=True)
class Row:
    """One method on one case.

    gap: energy above the lowest solution of all methods, relative to its magnitude; NaN for what is no solution
    """

    map: str
    x: float
    y: float
    load: int
    method: str
    outcome: str
    residual: float
    iterations: int
    gap: float
    seconds: float
    heat_balance: float
    reason: str


@dataclass
class Ledger:
    """Which methods are too slow for larger problems: all their solves of a size ran out of time."""

    ends: dict[tuple[str, str, int], list[str]]

    def allows(self, contender: Contender, case: Case) -> bool:
        """False for what would only wait for the time limit."""
        m = case.problem.m
        if contender.heavy and m > 100 and case.load > 0:
            return False
        smaller = [k for k in self.ends if k[:2] == (case.map, contender.name) and k[2] < m]
        return not smaller or any(end != SLOW for end in self.ends[max(smaller)])

    def book(self, contender: Contender, case: Case, outcome: str) -> None:
        """Enter a solve."""
        self.ends.setdefault((case.map, contender.name, case.problem.m), []).append(outcome)


def residual_of(case: Case, trial: Trial) -> float:
    """Inclusion residual of an answer: in extended precision, or with nodes near a kink snapped."""
    if trial.v is None or not np.all(np.isfinite(trial.v)):
        return float("nan")
    if trial.snap:
        return case.problem.inclusion_residual(trial.v, trial.snap * case.problem.law.s_scale)
    return independent_residual(case.problem, trial.v, trial.v_low)


def judged(residual: float, trial: Trial) -> str:
    """What an answer is."""
    if residual <= TOLERANCE:
        return SOLVED
    if trial.slow:
        return SLOW
    return SILENT if trial.claims else FLAGGED


def solve_case(case: Case, contenders: Sequence[Contender], limit: float, ledger: Ledger) -> list[Row]:
    """All methods on one case."""
    trials: list[tuple[Contender, Trial, float, float, str]] = []
    for contender in contenders:
        if ledger.allows(contender, case):
            begin = time.process_time()
            trial = contender.run(case.problem, begin + limit)
            seconds = time.process_time() - begin
            residual = residual_of(case, trial)
            trials.append((contender, trial, seconds, residual, judged(residual, trial)))
            ledger.book(contender, case, trials[-1][-1])
    gaps = _gaps(case, [trial if outcome == SOLVED else None for _, trial, _, _, outcome in trials])
    rows = []
    for (contender, trial, seconds, residual, outcome), gap in zip(trials, gaps, strict=True):
        reason = "" if outcome == SOLVED else trial.reason[:REASON]
        found = outcome, residual, trial.iterations, gap, seconds, case.heat_balance, reason
        rows.append(Row(case.map, case.x, case.y, case.load, contender.name, *found))
    return rows


def _gaps(case: Case, solutions: Sequence[Trial | None]) -> list[float]:
    """Energies above the lowest, relative to it, from exact differences."""
    points = [None if s is None else s.v for s in solutions]
    first = next((v for v in points if v is not None), None)
    if first is None:
        return [float("nan")] * len(points)
    problem, xi = case.problem, case.problem.xi(first)

    def above_first(v: np.ndarray) -> float:
        return float(problem.energy_change(first, v, xi)[0])

    above = np.array([np.nan if v is None else above_first(v) for v in points])
    lowest = np.nanmin(above)
    size = abs(problem.energy(first) + lowest)
    return [float(gap) for gap in (above - lowest) / (size or 1.0)]


def measure(
    cases: Iterable[Case],
    contenders: Sequence[Contender] = CONTENDERS,
    limit: float = 2.0,
    progress: Callable[[str], None] = lambda line: None,
) -> Iterator[Row]:
    """Rows of all cases; progress gets a line for every row of cells."""
    ledger, begin, band, count = Ledger({}), time.perf_counter(), None, [0, 0]
    for case in cases:
        if band not in (None, (case.map, case.y)):
            progress(f"{time.perf_counter() - begin:5.0f} s  {band[0]:10s} y = {band[1]:<8g} {_said(count)}")
            count = [0, 0]
        band = (case.map, case.y)
        for row in solve_case(case, contenders, limit, ledger):
            count[row.outcome == SOLVED] += 1
            yield row
    if band is not None:
        progress(f"{time.perf_counter() - begin:5.0f} s  {band[0]:10s} y = {band[1]:<8g} {_said(count)}")


def _said(count: list[int]) -> str:
    return f"{count[1]} solved, {count[0]} not"


def write(rows: Iterable[Row], target: Path) -> None:
    """Store rows as text."""
    with target.open("w", encoding="utf-8", newline="") as file:
        out = csv.writer(file, lineterminator="\n")
        out.writerow([f.name for f in fields(Row)])
        for row in rows:
            out.writerow(
                [f"{v:.3g}" if isinstance(v, float) else v for v in (getattr(row, f.name) for f in fields(Row))]
            )


def read(source: Path) -> list[Row]:
    """The stored rows."""
    kinds = {"str": str, "float": float, "int": int}
    with source.open(encoding="utf-8", newline="") as file:
        return [Row(*(kinds[str(f.type)](line[f.name]) for f in fields(Row))) for line in csv.DictReader(file)]
