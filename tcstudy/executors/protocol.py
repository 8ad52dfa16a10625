"""What an executor takes and gives; the executor of a single process."""

from __future__ import annotations

import pickle
import time
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import Future
from dataclasses import dataclass
from functools import cache
from typing import TYPE_CHECKING, Any, Protocol, TypeVar, cast

import numpy as np
from numpy.typing import NDArray

from tcstudy.errors import UserFault

if TYPE_CHECKING:  # at work only: who just starts others begins without it
    from tcstudy.laws.laws import Laws
    from tcstudy.online import BlockAnswers, CondensedBody, Options

Array = NDArray[np.float64]
T = TypeVar("T")
T_co = TypeVar("T_co", covariant=True)
PATIENCE = 600.0
"""Seconds that work may take at least before its worker counts as hanging."""
FACTORISATIONS, FLOPS = 2000.0, 1e9
"""A block may take the time of so many factorisations of Ã a point on a slow processor."""


class WorkerDied(RuntimeError):
    """A worker was killed, crashed or never answered over its work, as often as it was tried."""


class WorkersFailed(UserFault):
    """There are no workers, or none any more; says why and what to do."""


class Doable(Protocol[T_co]):
    """What a worker can do.

    name:     what people see of it where they watch
    patience: seconds after which a worker that has not done it counts as hanging
    """

    @property
    def name(self) -> str: ...
    @property
    def patience(self) -> float: ...
    def solve(self) -> T_co:
        """Do it in this process."""
        ...


@dataclass(frozen=True, eq=False)
class Errand:
    """A call of any function; what it needs, and its answer, are unpacked by nobody on the way. Make it by `of`."""

    content: bytes
    name: str = ""
    patience: float = PATIENCE

    @classmethod
    def of(cls, function: Callable[..., object], *given: object, name: str = "", patience: float = PATIENCE) -> Errand:
        """function: of a module, which the worker imports by name"""
        return cls(pickle.dumps((function, given)), name, patience)

    def solve(self) -> bytes:
        """Call it; the answer, packed."""
        keep_freed_memory()
        function, given = pickle.loads(self.content)
        return pickle.dumps(function(*given))


def unpacked(answer: Future[bytes]) -> Any:
    """What an errand's function returned, or raises what it raised, WorkerDied or WorkersFailed."""
    return pickle.loads(answer.result())


def solve_block(body: CondensedBody, *more: Any) -> BlockAnswers:
    """That of tcstudy.online, which is imported with the first block."""
    from tcstudy import online

    return online.solve_block(body, *more)


@dataclass(frozen=True, eq=False)
class Task:
    """A block of P points on one body.

    loads:      (P, m) l̃ of every point [N/m];  laws: of every row
    neighbours: (P, m), exact: (m,) as in solve_block, None if there are none
    name:       what people see of it where they watch the work
    """

    body: CondensedBody
    loads: Array
    laws: Laws
    options: Options
    neighbours: Array | None = None
    exact: Array | None = None
    name: str = ""

    @property
    def patience(self) -> float:
        """It grows with the block."""
        points, m = self.loads.shape
        return max(PATIENCE, FACTORISATIONS / FLOPS * points * m**3 / 3.0)

    def solve(self) -> Solved:
        """Solve the block in this process."""
        keep_freed_memory()
        start = time.perf_counter()
        answers = solve_block(self.body, self.loads, self.laws, self.options, self.neighbours, self.exact)
        return Solved(answers, time.perf_counter() - start)


def parts(work: Doable[Any]) -> tuple[CondensedBody | None, Any]:
    """(the body, which need not travel again with the next task; the rest) of any work; `whole` puts them together."""
    if not isinstance(work, Task):
        return None, work
    return work.body, (work.loads, work.laws, work.options, work.neighbours, work.exact)


def whole(body: CondensedBody | None, rest: Any) -> Doable[Any]:
    """What `parts` took apart."""
    if not isinstance(rest, tuple):
        return cast("Doable[Any]", rest)
    assert body is not None
    return Task(body, *rest)


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
    """Does work, in whatever order; the numbers depend on the work alone, to the bit."""

    @property
    def ahead(self) -> int:
        """How much work it likes to have beside what is waited for."""
        ...

    def submit(self, work: Doable[T], tries: int = 1) -> Future[T]:
        """Begin some work.

        tries: workers that may die over it, one after the other
        The future raises what the work raised, WorkerDied, or WorkersFailed.
        """
        ...

    def close(self) -> None:
        """End all workers at once, whatever they do."""
        ...


class Here:
    """The executor of a single process."""

    ahead = 0

    def submit(self, work: Doable[T], tries: int = 1) -> Future[T]:  # nobody dies here but all
        """Do it at once."""
        future: Future[T] = Future()
        try:
            future.set_result(work.solve())
        except Exception as error:  # whoever asks for the result gets it
            future.set_exception(error)
        return future

    def close(self) -> None:
        """Nothing to end."""


def in_order(executor: Executor, errands: Iterable[Errand]) -> Iterator[Future[bytes]]:
    """The answers of errands in their order; no more are under way or wait to be taken than the executor likes."""
    waiting: deque[Future[bytes]] = deque()
    for errand in errands:
        waiting.append(executor.submit(errand, tries=2))
        if len(waiting) > executor.ahead:
            yield waiting.popleft()
    yield from waiting
