"""A worker process: takes bodies and work from its parent, gives answers, and ends when the parent does.

Messages to it: a CondensedBody, which it keeps until the next; and what `parts` leaves of any work, each answered by
what came of it or by its exception. It writes nothing.
"""

from __future__ import annotations

import contextlib
import os
import signal
import sys
import threading
import time
from multiprocessing.connection import Connection

from tcstudy.executors.protocol import whole
from tcstudy.online import CondensedBody


def serve(parent: Connection) -> None:
    """Answer tasks until the parent hangs up."""
    body: CondensedBody | None = None
    with contextlib.suppress(OSError):  # one that has gone is noticed below
        parent.send("ready")
    while True:
        try:
            message = parent.recv()
        except (EOFError, OSError):  # the parent has gone
            return
        if isinstance(message, CondensedBody):
            body = message
            continue
        try:
            parent.send(whole(body, message).solve())
        except (BrokenPipeError, ConnectionResetError):
            return
        except Exception as error:  # the parent decides what becomes of the block
            parent.send(portable(error))


def portable(error: Exception) -> Exception:
    """An exception that pickles: of solve_block they are NumPy's, SciPy's and Python's, MemoryError among them."""
    try:
        return type(error)(str(error))
    except Exception:  # one that is made otherwise
        return RuntimeError(f"{type(error).__name__}: {error}")


def follow(parent: int) -> None:
    """End with the parent, even in the middle of a block."""
    while os.getppid() == parent:
        time.sleep(1.0)
    os._exit(1)


def main() -> None:
    """Serve the parent whose connection has the number that is the argument."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # a terminal's Ctrl-C is for the parent, which then ends its workers
    threading.Thread(target=follow, args=(os.getppid(),), daemon=True).start()
    serve(Connection(int(sys.argv[1])))


if __name__ == "__main__":
    main()
