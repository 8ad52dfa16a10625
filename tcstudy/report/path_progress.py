"""What `tcstudy path` shows while it works: one line that is written again and again, on a terminal only."""

from __future__ import annotations

import sys
from typing import TextIO

from tcstudy.report.outlet import raw_terminal
from tcstudy.report.text import number


class PathProgress:
    """Pieces so far and the present value of the parameter [SI]."""

    def __init__(self, stream: TextIO | None = None) -> None:
        self._stream = raw_terminal(stream if stream is not None else sys.stderr)
        self._shown = self._stream.isatty()
        self._open = False

    def __call__(self, pieces: int, t: float) -> None:
        """Called with (pieces, t) while the path is followed."""
        if self._shown:
            self._stream.write(f"\r\x1b[K{pieces} pieces, parameter at {number(t)}")
            self._stream.flush()
            self._open = True

    def close(self) -> None:
        """Remove the line."""
        if self._open:
            self._stream.write("\r\x1b[K")
            self._stream.flush()
            self._open = False
