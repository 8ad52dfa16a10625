"""A worker that does as it is told: `python cruel.py WHAT TAU FILE` and what a worker is given.

WHAT happens whenever a block holds a law of scale TAU: kill, crash, hang, exhaust; "once-…" only the first time. FILE
gets the process id each time.
"""

from __future__ import annotations

import ctypes
import os
import resource
import signal
import sys
import time
from pathlib import Path

import numpy as np

from tcstudy.executors import protocol, worker
from tcstudy.laws.laws import Laws

WHAT, TAU, FILE = sys.argv[1], float(sys.argv[2]), Path(sys.argv[3])
original = protocol.solve_block


def happen(what: str) -> None:
    if what == "kill":
        os.kill(os.getpid(), signal.SIGKILL)
    elif what == "crash":
        ctypes.string_at(0)
    elif what == "hang":
        time.sleep(600)
    elif what == "exhaust":
        resource.setrlimit(resource.RLIMIT_AS, (2**33, 2**33))
        np.ones(2**36)  # 512 GB


def cruel(body: object, loads: object, laws: Laws, *more: object) -> object:
    if np.any(laws.scales[laws.index] == TAU):
        before = FILE.exists()
        with FILE.open("a") as file:
            file.write(f"{os.getpid()}\n")
        if not (WHAT.startswith("once-") and before):
            happen(WHAT.removeprefix("once-"))
    return original(body, loads, laws, *more)  # type: ignore[arg-type]


protocol.solve_block = cruel  # type: ignore[assignment]
del sys.argv[1:4]
worker.main()
