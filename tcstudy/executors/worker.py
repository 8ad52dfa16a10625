"""A worker process: it does the calls that its parent sends, and ends when the parent does."""

from __future__ import annotations

import contextlib
import os
import signal
import sys
import threading
import time
import warnings
from multiprocessing.connection import Connection

# most calls need it: imported while the parent makes meshes
import tcstudy.contact.solve  # noqa: F401
from tcstudy.executors.processes import answered, keep_freed_memory


def follow(parent: int) -> None:
    """End with the parent, even in the middle of a call."""
    while os.getppid() == parent:
        time.sleep(1.0)
    os._exit(1)


def main() -> None:
    """Serve the parent whose connection has the number that is the argument."""
    # a terminal's Ctrl-C is for the parent, which then ends its workers
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    threading.Thread(target=follow, args=(os.getppid(),), daemon=True).start()
    # as in the parent's terminal: solutions are judged by their residuals
    warnings.simplefilter("ignore", RuntimeWarning)
    keep_freed_memory()
    line = Connection(int(sys.argv[1]))
    with contextlib.suppress(EOFError, OSError):  # the parent has gone
        line.send_bytes(b"ready")
        while True:
            line.send_bytes(answered(line.recv_bytes()))


if __name__ == "__main__":
    main()
