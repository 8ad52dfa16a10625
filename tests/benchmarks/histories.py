"""What a step of a load history costs in warm solves: 1,000 steps, five cycles, on a line of 500 contact nodes.

    python -m tests.benchmarks.histories [nodes] [steps]

A warm solve is the static problem of the same load and law from the solution of the load before. CPU time, one thread
(OPENBLAS_NUM_THREADS=1); shared machines change both sides alike.
"""

from __future__ import annotations

import sys
import time
from itertools import product

import numpy as np

from tcstudy.contact.history.steps import history
from tcstudy.contact.problem import ContactProblem
from tcstudy.contact.solve import solve_contact
from tcstudy.matrices import law
from tcstudy.scene.histories import HISTORY_BRANCHES, Memory
from tests.contact.history.cases import coupled_line, remembering, softening

LAWS = {
    "tresca": law("tresca", tau=2e7),
    "softening": softening(),
    "exponential": law("exponential", a=2e7, b=1.4e7, delta=2e-3),
}


def main(nodes: int = 500, steps: int = 1000) -> None:
    """One line a law, memory and way of following the step."""
    A, c, load = coupled_line(nodes)
    factors = 3.0 * np.sin(10.0 * np.pi * np.arange(1, steps + 1) / steps)
    ways = product(LAWS, (Memory("friction"), Memory("elastic-plastic", 3e10), Memory("damage")), HISTORY_BRANCHES)
    for name, memory, branch in ways:
        film, v, begin = LAWS[name], np.zeros(nodes), time.process_time()
        if memory.stiffness and not film.piecewise_linear:
            continue
        for factor in factors:
            v = solve_contact(ContactProblem(A, factor * load, c, film), branch="continued", neighbour=v).v
        warm, begin = time.process_time() - begin, time.process_time()
        for step in history(remembering(A, c, film, memory, branch), (factor * load for factor in factors)):
            assert step.solved, step.reason
        own = (time.process_time() - begin) / warm
        print(f"{name:12s} {memory.name:16s} {branch:10s} {own:5.2f} warm solves of {1e3 * warm / steps:.1f} ms")


if __name__ == "__main__":
    main(*map(int, sys.argv[1:]))
