"""What a step of a load history costs in warm solves: 1,000 steps, five cycles, on a line of 500 contact nodes.

    python -m tests.benchmarks.histories [nodes] [steps]

A warm solve is the static problem of the same load and law from the solution of the load before. CPU time, one thread
(OPENBLAS_NUM_THREADS=1); shared machines change both sides alike.
"""

from __future__ import annotations

import sys
import time

import numpy as np

from tcstudy.contact.contact import solve_contact
from tcstudy.contact.history.problem import HistoryStep
from tcstudy.contact.history.steps import next_step
from tcstudy.contact.problem import ContactProblem
from tcstudy.matrices import law
from tcstudy.scene.histories import Memory
from tests.contact.history.cases import coupled_line, remembering, softening

LAWS = {
    "tresca": law("tresca", tau=2e7),
    "softening": softening(),
    "exponential": law("exponential", a=2e7, b=1.4e7, delta=2e-3),
}


def main(nodes: int, steps: int) -> None:
    """One line a law, memory and way of following the step."""
    A, c, load = coupled_line(nodes)
    factors = 3.0 * np.sin(10.0 * np.pi * np.arange(1, steps + 1) / steps)
    for name, film in LAWS.items():
        v, begin = np.zeros(nodes), time.process_time()
        for factor in factors:
            v = solve_contact(ContactProblem(A, factor * load, c, film), branch="continued", neighbour=v).v
        warm = (time.process_time() - begin) / steps
        for memory in (Memory("friction"), Memory("elastic-plastic", 3e10), Memory("damage")):
            if memory.stiffness and not film.piecewise_linear:
                continue
            for branch in ("lowest", "continued"):
                body = remembering(A, c, film, memory, branch=branch)
                last, begin = HistoryStep.virgin(nodes), time.process_time()
                for factor in factors:
                    last = next_step(body, last, factor * load)
                    assert last.solved, last.reason
                step = (time.process_time() - begin) / steps
                how = "path" if branch == "continued" else "lowest"
                print(f"{name:12s} {memory.name:16s} {how:12s} {step / warm:5.2f} warm solves of {1e3 * warm:.1f} ms")


if __name__ == "__main__":
    main(*(int(word) for word in sys.argv[1:] or ("500", "1000")))
