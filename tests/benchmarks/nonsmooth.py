"""Bundle-Newton on scalable and random nonsmooth problems: `python -m tests.benchmarks.nonsmooth [N]`.

The published ones with 50 variables, and N random convex ones (300 unless given) with 2 to 100, of known
minimum by construction. Set OPENBLAS_CORETYPE to try the kernels of other processors.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Sequence

from tcstudy.contact.bundle import BundleNewton
from tests.contact.bundle.scalable import Problem, published, random_problem


def line(problem: Problem) -> str:
    """Status, iterations, error relative to 1 + |f*|, and seconds of CPU."""
    begin = time.process_time()
    outcome = BundleNewton().run(problem.oracle, problem.x0)
    error = (outcome.f - problem.f_star) / (1.0 + abs(problem.f_star))
    seconds = time.process_time() - begin
    cells = f"{outcome.status.name:15s} {outcome.iterations:4d}/{outcome.evaluations:<4d} {error:9.1e} {seconds:7.2f}"
    return f"{problem.name:24s} {len(problem.x0):3d} {cells}"


def main(arguments: Sequence[str]) -> None:
    for problem in published(50):
        print(line(problem), flush=True)
    for seed in range(int(arguments[0]) if arguments else 300):
        print(f"{seed:3d} {line(random_problem(seed))}", flush=True)


if __name__ == "__main__":
    main(sys.argv[1:])
