"""Calls that treat their worker badly. As a script, `python cruel.py WHAT TAU FILE` and what a
worker is given: one to which WHAT happens whenever a block holds a law of scale TAU. FILE gets the
process id each time."""

import os
import signal
import sys
import time
from pathlib import Path

import numpy as np

from tcstudy.contact import solve
from tcstudy.errors import GeometryFailed
from tcstudy.executors import worker
from tcstudy.laws.laws import Laws


class Stubborn(Exception):
    """An exception that does not come out of a pickle."""

    def __init__(self, one: int, other: int) -> None:
        super().__init__(f"{one} and {other}")


def treat(what: str, seen: Path, once: bool) -> int:
    """Note the worker in a file, and do the harm, or only the first time; else the worker's process
    id."""
    before = seen.exists()
    with seen.open("a") as file:
        file.write(f"{os.getpid()}\n")
    if not (once and before):
        harm(what)
    return os.getpid()


def harm(what: str) -> None:
    if what == "kill":
        os.kill(os.getpid(), signal.SIGKILL)
    elif what == "hang":
        time.sleep(600)
    elif what == "exhaust":
        np.ones(2**50)
    elif what == "fault":
        raise GeometryFailed("no such body", ("body", "file"))
    elif what == "stubborn":
        raise Stubborn(1, 2)


if __name__ == "__main__":
    WHAT, TAU, FILE = sys.argv[1], float(sys.argv[2]), Path(sys.argv[3])
    original = solve.solve_block

    def cruel(body: object, loads: object, laws: Laws, *more: object) -> object:
        if np.any(laws.scales[laws.index] == TAU):
            treat(WHAT, FILE, once=False)
        return original(body, loads, laws, *more)  # type: ignore[arg-type]

    solve.solve_block = cruel  # type: ignore[assignment]
    del sys.argv[1:4]
    worker.main()
