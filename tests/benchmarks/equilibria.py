"""Are lists of equilibria complete, and what do they cost? `python -m tests.benchmarks.equilibria`

N random problems with 3 to 5 nodes against brute force over all pieces, at a load and along an interval of loads; N
points of quickstart's body (m = 13) against mixed-integer programs; seconds of CPU for maps of quickstart's body over
traction × air temperature.
"""

from __future__ import annotations

import argparse
import time
from collections import Counter
from itertools import pairwise

import numpy as np

from tcstudy.contact.all_solutions import all_solutions, of_rows
from tcstudy.contact.path.complete import all_branches
from tcstudy.contact.path.problem import ParametricProblem
from tcstudy.contact.path.record import PathStatus
from tests.contact.random_polygons import NEAR, by_brute_force, random_problem
from tests.verification.test_all_solutions import FILMS, equal_to_milp, quickstart_problems

MAPS = {"softening": (2, 40), "brittle": (2, 40), "saw-tooth": (2, 40)}


def against_brute_force(count: int) -> str:
    """`count` problems at one load each."""
    differ, degenerate, counts = [], 0, Counter[int]()
    for seed, m in enumerate(_sizes(count)):
        problem, _ = random_problem(10_000 + seed, m)
        v, _, nearest = by_brute_force(problem)
        if nearest < NEAR:
            degenerate += 1
            continue
        found = all_solutions(problem)
        same = found.complete and len(found) == len(v)
        if same:
            order = [np.lexsort(x.round(7).T) for x in (found.v, v)]
            same = bool(np.allclose(found.v[order[0]], v[order[1]], atol=1e-7))
        counts[len(found)] += 1
        if not same:
            differ.append(10_000 + seed)
    told = f"{count} random problems: {len(differ)} differ {differ or ''}, {degenerate} degenerate"
    return f"{told}; counts {dict(sorted(counts.items()))}"


def against_segments(count: int) -> str:
    """`count` intervals of loads, of the same sizes: ends of all segments, in what branches and loops they are."""
    differ, unproved, degenerate, segments, loops = [], [], 0, 0, 0
    for seed, m in enumerate(_sizes(count)):
        problem, per_t = random_problem(20_000 + seed, m)
        _, rows, nearest = by_brute_force(problem, per_t)
        if nearest < 1e-7:  # a segment so short that brute force, which has no bounds of rounding, may err
            degenerate += 1
            continue
        along = ParametricProblem(problem.A_tilde, problem.l_tilde, per_t, problem.c, problem.law)
        found = all_branches(along, 0.0, 1.0, problem.lambda_1)
        ends = np.array([sorted(pair) for branch in found.branches for pair in pairwise(branch.t)])
        if not found.complete:
            unproved.append(20_000 + seed)
        elif len(ends) != len(rows) or not np.allclose(np.sort(ends, axis=0), np.sort(rows, axis=0), atol=1e-7):
            differ.append(20_000 + seed)
        segments += len(rows)
        loops += sum(branch.end == PathStatus.CLOSED_LOOP for branch in found.branches)
    return (
        f"{count} intervals: {len(differ)} differ {differ or ''}, {len(unproved)} not proved {unproved or ''}, "
        f"{degenerate} degenerate; {segments} segments, {loops} loops"
    )


def _sizes(count: int) -> list[int]:
    """Three quarters with three nodes, a fifth with four, the rest with five."""
    sizes = [3] * (3 * count // 4) + [4] * (count // 5)
    return sizes + [5] * (count - len(sizes))


def against_programs(count: int) -> str:
    """`count` points of quickstart's body."""
    rng, found = np.random.default_rng(0), []
    for number in range(count):
        film = list(FILMS)[number % 3]
        g, theta = rng.uniform(0.0, 30.0), rng.uniform(0.0, 40.0)
        [problem] = quickstart_problems(film, f"{{boundary.end.g: [[{g:.3f} MPa, 0]], theta_bar: [{theta:.3f} K]}}")
        found.append(equal_to_milp(problem))
    return f"{count} points by integer programs: {found.count(0)} differ; counts {found}"


def map_of(film: str, levels: int, n: int) -> str:
    """An n × n map, its counts and its cost."""
    tractions = ", ".join(f"[{g:.6f} MPa, 0]" for g in np.linspace(0.0, 30.0, n))
    sweep = f"{{boundary.end.g: [{tractions}], theta_bar: {{linspace: [0 K, 40 K, {n}]}}}}"
    problems = quickstart_problems(film, sweep, levels)
    one, loads = problems[0], np.array([p.l_tilde for p in problems])
    began = time.process_time()
    found = [x for some in np.array_split(loads, max(1, len(loads) // 400))
             for x in of_rows(one.A_tilde, one.c, one.law, some, one.lambda_1)]  # fmt: skip
    took, counts = time.process_time() - began, Counter(map(len, found))
    unproved = sum(not x.complete for x in found)
    return (f"{film}, m = {one.m}, {n} × {n}: {took:.1f} s of CPU, boxes {sum(x.boxes for x in found)}, "
            f"not proved {unproved}, counts {dict(sorted(counts.items()))}")  # fmt: skip


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--problems", type=int, default=2_000, help="random problems; 2,000")
    parser.add_argument("--intervals", type=int, default=2_000, help="intervals of random problems; 2,000")
    parser.add_argument("--milp", type=int, default=20, help="points by integer programs; 20")
    parser.add_argument("--map", nargs=3, action="append", metavar=("FILM", "LEVELS", "N"), help="instead of all maps")
    given = parser.parse_args()
    if given.problems:
        print(against_brute_force(given.problems), flush=True)
    if given.intervals:
        print(against_segments(given.intervals), flush=True)
    if given.milp:
        print(against_programs(given.milp), flush=True)
    for film, (levels, n) in ({f: (int(x), int(y)) for f, x, y in given.map} if given.map else MAPS).items():
        print(map_of(film, levels, n), flush=True)


if __name__ == "__main__":
    main()
