"""What an executor takes and gives; the executor of a single process."""

from __future__ import annotations

import time
from concurrent.futures import Future
from dataclasses import dataclass
from functools import cache
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from tcstudy.errors import UserFault
from tcstudy.online import BlockAnswers, CondensedBody, Options, RowLaws, solve_block

Array = NDArray[np.float64]


class WorkerDied(RuntimeError):
    """A worker was killed, crashed or never answered over a block, as often as it was tried."""


class WorkersFailed(UserFault):
    """There are no workers, or none any more; says why and what to do."""


@dataclass(frozen=True, eq=False)
class Task:
    """A block of P points on one body.

    loads:      (P, m) l̃ of every point [N/m];  laws: of every row
    neighbours: (P, m), exact: (m,) as in solve_block, None if there are none
    name:       what people see of it where they watch the work
    """

    body: CondensedBody
    loads: Array
    laws: RowLaws
    options: Options
    neighbours: Array | None = None
    exact: Array | None = None
    name: str = ""

    def solve(self) -> Solved:
        """Solve the block in this process."""
        keep_freed_memory()
        start = time.perf_counter()
        answers = solve_block(self.body, self.loads, self.laws, self.options, self.neighbours, self.exact)
        return Solved(answers, time.perf_counter() - start)


@cache
def keep_freed_memory() -> None:
    """Let the C library keep up to 64 MB of freed memory in this process, once; glibc's way, without effect elsewhere.

    By default it gives an array of a block back to the system and asks for new, empty pages for the next one, which
    took a quarter of the time of a block at m = 176. Its threshold is the largest array freed so far, of at most 32 MB.
    """
    np.empty(2**25 - 2**14, dtype=np.uint8)  # never touched, so that it costs nothing


@dataclass(frozen=True, eq=False)
class Solved:
    """The answers of a task and the wall time [s] that whoever solved it took."""

    answers: BlockAnswers
    time: float


class Executor(Protocol):
    """Solves tasks, in whatever order; the numbers of a task depend on the task alone, to the bit."""

    @property
    def ahead(self) -> int:
        """How many tasks it likes to have beside the one that is waited for."""
        ...

    def submit(self, task: Task, tries: int = 1) -> Future[Solved]:
        """Begin a task.

        tries: workers that may die over it, one after the other
        The future raises what solve_block raised, WorkerDied, or WorkersFailed.
        """
        ...

    def close(self) -> None:
        """End all workers at once, whatever they do."""
        ...


class Here:
    """The executor of a single process."""

    ahead = 0

    def submit(self, task: Task, tries: int = 1) -> Future[Solved]:  # nobody dies here but all
        """Solve the task at once."""
        future: Future[Solved] = Future()
        try:
            future.set_result(task.solve())
        except Exception as error:  # whoever asks for the result gets it
            future.set_exception(error)
        return future

    def close(self) -> None:
        """Nothing to end."""
