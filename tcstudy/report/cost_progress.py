"""What `tcstudy cost` shows while it works: one line with the time left on a terminal, a line per run elsewhere."""

from __future__ import annotations

import sys
import time
from typing import TextIO

from tcstudy.report.outlet import raw_terminal, visible


class CostProgress:
    """What is being measured, and how long it may still take."""

    def __init__(self, stream: TextIO | None = None) -> None:
        self._stream = raw_terminal(stream if stream is not None else sys.stderr)
        self._terminal = self._stream.isatty()
        self._open = False
        self._start = time.monotonic()

    def __call__(self, text: str, left: float | None) -> None:
        """Called with what begins now and the seconds left, if they are known."""
        text = visible(text)
        if left is not None:
            text += f", about {_span(left)} left"
        if self._terminal:
            elapsed = _span(time.monotonic() - self._start)
            self._stream.write(f"\r\x1b[K{text} ({elapsed} so far)")
            self._open = True
        else:
            self._stream.write(f"{text}\n")
        self._stream.flush()

    def close(self) -> None:
        """Remove the line."""
        if self._open:
            self._stream.write("\r\x1b[K")
            self._stream.flush()
            self._open = False


def _span(seconds: float) -> str:
    """A duration, "8 s" or "2 min 5 s"."""
    whole = max(0, round(seconds))
    return f"{whole} s" if whole < 90 else f"{whole // 60} min {whole % 60} s"
