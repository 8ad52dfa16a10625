"""Calls that treat their worker badly, to be submitted to executors."""

from __future__ import annotations

import ctypes
import os
import signal
import time
from pathlib import Path

import numpy as np

from tcstudy.errors import GeometryFailed


class Stubborn(Exception):
    """An exception that does not come out of a pickle."""

    def __init__(self, one: int, other: int) -> None:
        super().__init__(f"{one} and {other}")


def treat(what: str, seen: Path, once: bool) -> int:
    """Note the worker in a file, and do the harm, or only the first time; else the worker's process id."""
    before = seen.exists()
    with seen.open("a") as file:
        file.write(f"{os.getpid()}\n")
    if not (once and before):
        harm(what)
    return os.getpid()


def harm(what: str) -> None:
    if what == "kill":
        os.kill(os.getpid(), signal.SIGKILL)
    elif what == "crash":
        ctypes.string_at(0)
    elif what == "exit":
        os._exit(3)
    elif what == "hang":
        time.sleep(600)
    elif what == "exhaust":
        np.ones(2**50)
    elif what == "fault":
        raise GeometryFailed("no such body", ("body", "file"))
    elif what == "stubborn":
        raise Stubborn(1, 2)
